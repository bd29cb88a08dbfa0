// SPDX-License-Identifier: BSD-3-Clause
// What the name of a channel tells: "550nm" and "550.5nm" are how every reader of Gonio names a channel of known
// wavelength, and how samples and model files keep it.
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
