// SPDX-License-Identifier: BSD-3-Clause
// P_s of what is no table: of one made from it.
#include <stdlib.h>

#include "fit/check/measures.h"
#include "gonio/io.h"

enum { GRID_THETAS = 9 }; // 10 deg

gonio_status gonio_check_cell_plan(int thetas, bool isotropic, gonio_plan **out, gonio_error *error) {
    const size_t n = (size_t)thetas, phis = 4 * n, turns = isotropic ? 1 : phis;
    gonio_plan *plan = calloc(1, sizeof *plan);
    *out = plan;
    if (plan != NULL) {
        plan->poses = malloc(n * turns * n * phis * sizeof *plan->poses);
    }
    if (plan == NULL || plan->poses == NULL) {
        free(plan);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a grid of %zu thetas", n);
    }
    const double step = 90.0 / thetas;
    for (size_t i = 0; i < n * turns * n * phis; i++) {
        plan->poses[plan->n++] = (gonio_pair){gonio_radians(step * ((double)(i / phis / n / turns) + 0.5)),
                                              gonio_radians(step * (double)(i / phis / n % turns)),
                                              gonio_radians(step * ((double)(i / phis % n) + 0.5)),
                                              gonio_radians(step * (double)(i % phis))};
    }
    return GONIO_OK;
}

gonio_status gonio_check_grid_plan(bool isotropic, gonio_plan **out, gonio_error *error) {
    return gonio_check_cell_plan(GRID_THETAS, isotropic, out, error);
}

gonio_status gonio_check_gridded_ranks(const gonio_model *model, int threads, gonio_check_report *report,
                                       gonio_error *error) {
    gonio_plan *plan;
    gonio_samples *samples = NULL;
    gonio_table *table = NULL;
    gonio_status status = gonio_check_grid_plan(model->isotropic, &plan, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_samples_of_model(model, plan->poses, plan->n, threads, &samples, error);
    status = status == GONIO_OK ? gonio_table_of(samples, &table, error) : status;
    status = status == GONIO_OK ? gonio_check_table_ranks(table, threads, report, error) : status;
    gonio_table_free(table);
    gonio_samples_free(samples);
    gonio_plan_free(plan);
    return status;
}
