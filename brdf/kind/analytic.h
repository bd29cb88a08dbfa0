// SPDX-License-Identifier: BSD-3-Clause
// Analytic models: sums of terms with one parameter vector. A term is a formula (brdf/analytic/formula.h) with values
// of its parameters for every channel.
#ifndef GONIO_BRDF_KIND_ANALYTIC_H
#define GONIO_BRDF_KIND_ANALYTIC_H

#include "brdf/analytic/formula.h"
#include "gonio/model.h"

#define GONIO_ANALYTIC_TERMS_MAX 8

typedef struct gonio_analytic_term {
    const gonio_formula *formula;
    const double *parameters; // [channels][formula->n]
} gonio_analytic_term;

// The sum of 1 to GONIO_ANALYTIC_TERMS_MAX terms; everything is copied. names (may be NULL: "value", or r g b for
// three channels, or c1, c2 ...). GONIO_E_RANGE where a parameter is outside its bounds. The caller frees the model.
gonio_status gonio_analytic_new(const gonio_analytic_term *terms, int n_terms, int channels, const char (*names)[32],
                                gonio_model **out, gonio_error *error);
// The same from "FORMULA:key=value,key=a/b/c+FORMULA:...", a value for every channel or one a channel. GONIO_E_USAGE
// where the text is no such thing; the message lists what exists. The caller frees the model.
gonio_status gonio_analytic_from_spec(const char *spec, gonio_model **out, gonio_error *error);
// The model's terms, borrowed from it; 0 and NULL for a model of another kind.
int gonio_analytic_terms(const gonio_model *model, const gonio_analytic_term **terms);
// All parameters as one vector, term by term, channel by channel; change them only while nobody evaluates. Borrowed.
double *gonio_analytic_parameters(gonio_model *model, size_t *count);
// Standard uncertainties of the parameters, in their order; infinite where the data did not decide. They are kept and
// saved with the model; NULL where it has none.
gonio_status gonio_analytic_set_sigmas(gonio_model *model, const double *sigmas, gonio_error *error);
const double *gonio_analytic_sigmas(const gonio_model *model);

#endif
