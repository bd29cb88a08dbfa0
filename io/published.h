// SPDX-License-Identifier: BSD-3-Clause
// Published fits of measured materials as SPECs: "sgd:gold-metallic-paint", "ngan-ward:chrome".
#ifndef GONIO_IO_PUBLISHED_H
#define GONIO_IO_PUBLISHED_H

#include "gonio/model.h"

// Is the SPEC one of a published fit? FORM:NAME with a form below and no "=" behind it.
bool gonio_published_is(const char *spec);
// The three channels of the fit, from the tables in $GONIO_DATA/fits. GONIO_E_USAGE for a name that the table lacks,
// GONIO_E_INPUT for a table that is not there or does not read. The caller frees the model.
gonio_status gonio_published_open(const char *spec, gonio_model **out, gonio_error *error);

#endif
