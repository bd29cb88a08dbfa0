// SPDX-License-Identifier: BSD-3-Clause
// What DDR and SDR share.
#ifndef GONIO_IO_OPTICS_INTEGRA_H
#define GONIO_IO_OPTICS_INTEGRA_H

#include "io/optics/grid.h"

// What follows TypeColorModel: the grid gets its channels.
gonio_status gonio_integra_colours(gonio_words *words, gonio_grid *grid, bool *spectral, gonio_error *error);
bool gonio_integra_is_channel(const char *word);
// The number behind "wl", in nm, as the channel's name.
gonio_status gonio_integra_wavelength(gonio_words *words, char name[GONIO_CHANNEL_NAME_MAX], gonio_error *error);

#endif
