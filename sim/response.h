// SPDX-License-Identifier: BSD-3-Clause
// The camera's response curve: relative exposure to relative value.
#ifndef GONIO_SIM_RESPONSE_H
#define GONIO_SIM_RESPONSE_H

#include "gonio/status.h"

typedef struct sim_response sim_response;

// "linear", "gamma:G" (value = exposure^(1/G), linear below 1/1000), or the path of a CSV: rows of relative exposure,
// relative value, both from 0 to 1 and rising; `#` comments and one header line may be there; straight lines between
// the rows. The caller frees it.
gonio_status gonio_sim_response_new(const char *text, sim_response **out, gonio_error *error);
void gonio_sim_response_free(sim_response *response); // NULL is allowed
// Below 0 (read noise) the first segment goes on; from 1 on the value is 1.
double gonio_sim_response_value(const sim_response *response, double exposure);

#endif
