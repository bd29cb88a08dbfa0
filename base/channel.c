// SPDX-License-Identifier: BSD-3-Clause
// What the name of a channel tells: "550nm" and "550.5nm" are how every reader of Gonio names a channel of known
// wavelength, and how samples and model files keep it.
#include "base/channel.h"

#include <math.h>
#include <string.h>

#include "base/number.h"
#include "gonio/sample.h"

double gonio_channel_wavelength_nm(const char *name) {
    // strtod alone would take "0x1p3nm", "infnm" and "+5nm" too.
    const size_t digits = strspn(name, "0123456789.");
    char *end;
    const double nm = gonio_number_parse(name, &end);
    return digits > 0 && end == name + digits && strcmp(end, "nm") == 0 && nm > 0 ? nm : NAN;
}

double gonio_samples_wavelength_nm(const gonio_samples *samples, int channel) {
    return gonio_channel_wavelength_nm(samples->channel_names[channel]);
}

// Beyond the first and the last wavelength nothing was measured: so far, relative, their channels still stand for it.
#define BEYOND 0.02

int gonio_wavelength_nearest(const double *wavelengths, int n, double wanted) {
    int best = -1;
    for (int k = 0; k < n; k++) {
        const double gap = fabs(wavelengths[k] - wanted);
        best = isfinite(gap) && (best < 0 || gap < fabs(wavelengths[best] - wanted)) ? k : best;
    }
    if (best < 0 || fabs(wavelengths[best] - wanted) <= 1e-6 * wanted) {
        return best;
    }
    // The spacing on the side of what is wanted, or where there is nothing on that side, on the other.
    double toward = INFINITY, away = INFINITY;
    for (int k = 0; k < n; k++) {
        const double step = wavelengths[k] - wavelengths[best];
        if (step != 0 && isfinite(step)) {
            double *side = (step > 0) == (wanted > wavelengths[best]) ? &toward : &away;
            *side = fmin(*side, fabs(step));
        }
    }
    const double reach = isfinite(toward) ? 0.5000001 * toward : fmin(0.5 * away, BEYOND * wanted);
    return isfinite(reach) && fabs(wavelengths[best] - wanted) <= reach ? best : -1;
}
