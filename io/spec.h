// SPEC, a simulated sample as text: "ward:rho_d=0.3,rho_s=0.2,alpha=0.15,shape=sphere,radius_mm=20".
#ifndef GONIO_IO_SPEC_H
#define GONIO_IO_SPEC_H

#include "gonio/model.h"

typedef enum gonio_shape { GONIO_SHAPE_FLAT, GONIO_SHAPE_SPHERE } gonio_shape;

// The BRDF and the body that carries it. GONIO_E_USAGE where the text is no spec; its message lists what exists.
// "+" joins terms whose values add: "lambert:rho=0.2+ggx:rho_s=0.5,alpha=0.1". shape and radius_mm may stand in any
// term; without them the sample is flat and the radius 20 mm. model (may be NULL: only check and take the shape): the
// caller frees it.
gonio_status gonio_spec_parse(const char *spec, gonio_model **model, gonio_shape *shape, double *radius_mm,
                              gonio_error *error);

#endif
