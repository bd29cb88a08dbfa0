// SPDX-License-Identifier: BSD-3-Clause
#include "io/optics/integra.h"

#include <math.h>
#include <strings.h>

#include "base/number.h"

gonio_status gonio_integra_colours(gonio_words *words, gonio_grid *grid, bool *spectral, gonio_error *error) {
    int choice;
    double n = 3;
    gonio_status status = gonio_word_choice(words, "TypeColorModel", "rgb|spectral|bw", &choice, error);
    *spectral = choice == 1;
    if (status == GONIO_OK && *spectral) {
        status = gonio_word_number(words, "number of wavelengths", &n, error);
    } else {
        n = choice == 0 ? 3 : 1;
    }
    if (status == GONIO_OK && !(n >= 1 && n <= GONIO_CHANNELS_MAX && n == floor(n))) {
        status = gonio_text_fail(&words->text, error, "expected 1 to %d wavelengths, found %g", GONIO_CHANNELS_MAX, n);
    }
    return status == GONIO_OK ? gonio_grid_channels(grid, (int)n, error) : status;
}

bool gonio_integra_is_channel(const char *word) {
    static const char *const names[] = {"wl", "bw", "red", "gre", "green", "blu", "blue"};
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        if (strcasecmp(word, names[k]) == 0) {
            return true;
        }
    }
    return false;
}

gonio_status gonio_integra_wavelength(gonio_words *words, char name[GONIO_CHANNEL_NAME_MAX], gonio_error *error) {
    double nm;
    const gonio_status status = gonio_word_number(words, "wavelength", &nm, error);
    if (status == GONIO_OK && !(nm >= 1 && nm <= 1e6)) {
        return gonio_text_fail(&words->text, error, "wavelength: expected 1 to 1e6 nm, found %g", nm);
    }
    gonio_number_format(name, GONIO_CHANNEL_NAME_MAX, "%.10gnm", nm);
    return status;
}
