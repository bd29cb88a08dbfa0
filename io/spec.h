// SPDX-License-Identifier: BSD-3-Clause
// SPEC: a BRDF as text, and the body of the sample that carries it: "ward:rho_d=0.3,rho_s=0.2,alpha=0.15,shape=sphere".
#ifndef GONIO_IO_SPEC_H
#define GONIO_IO_SPEC_H

// Cut the last key=value off the end of a SPEC where the key says something about the body (shape, radius_mm,
// plate_mm); its value, inside text, with the key in *key, or NULL where the end is of the BRDF. A file's path may hold
// commas and equals signs, so only these keys are cut.
char *gonio_spec_take_body(char *text, const char **key);

#endif
