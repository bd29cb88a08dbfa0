// SPDX-License-Identifier: BSD-3-Clause
// Kameya 2002, 5.1.4: Levenberg-Marquardt on plain residuals of f_r fits three Lafortune lobes, five (16 parameters)
// "do not converge". Here from 40 random starts each, without the search that --method lafortune makes of them: where
// they end, how many say that they did not converge; and what the method makes of the same samples.
//   lafortune_starts [SPEC]
#include <stdlib.h>

#include "fit/analytic/fit.h"
#include "fit/analytic/problem.h"
#include "tests/recovery.h"

enum { STARTS = 40, SAMPLES = 600, ITERATIONS = 300 };

static int by_value(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

typedef struct outcome {
    double rmse[STARTS];
    int stuck;
} outcome;

static outcome from_random_starts(const gonio_analytic_problem *problem) {
    const gonio_analytic_layout *layout = problem->layout;
    outcome out = {.stuck = 0};
    gonio_analytic_point point;
    gonio_error error = {0};
    if (gonio_analytic_point_init(&point, problem, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    uint64_t seed = 1;
    for (int s = 0; s < STARTS; s++) {
        gonio_analytic_end end = {0};
        for (int m = 0; m < layout->shapes; m++) {
            const double u = simulate_uniform(&seed);
            point.shapes[m] = layout->low[m] + u * (layout->high[m] - layout->low[m]);
            if (layout->variables[m % layout->own].over > 0) {
                point.shapes[m] =
                    fmin(fmax(6 * point.shapes[m] / exp(point.shapes[m - 1]), layout->low[m]), layout->high[m]);
            }
        }
        gonio_analytic_units(problem, &point);
        gonio_analytic_solve_strengths(problem, &point);
        if (gonio_analytic_minimise(problem, &point, ITERATIONS, &end, &error) != GONIO_OK) {
            simulate_die(&error);
        }
        out.rmse[s] = sqrt(2 * point.cost / (double)problem->data->n);
        out.stuck += !end.converged;
    }
    gonio_analytic_point_release(&point);
    qsort(out.rmse, STARTS, sizeof *out.rmse, by_value);
    return out;
}

static double by_method(const gonio_samples *samples, int lobes) {
    gonio_fit_options o;
    gonio_fit_report report;
    gonio_model *model;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    o.method = "lafortune";
    o.lobes = lobes;
    o.thesis = true;
    o.hold_out = 0;
    if (gonio_fit(samples, &o, &model, &report, &error) != GONIO_OK) {
        simulate_die(&error);
    }
    gonio_model_free(model);
    return report.train.rmse;
}

int main(int argc, char **argv) {
    gonio_model *truth = simulate_truth(argc > 1 ? argv[1] : "cook-torrance:rho_d=0.1,rho_s=0.6,m=0.25,f0=0.04");
    uint64_t seed = 7;
    gonio_samples *samples = recovery_samples(truth, SAMPLES, 0.02, &seed);
    gonio_lobe_geometry geometry[SAMPLES];
    double weight[SAMPLES], eps = 1e-3, highest = 0;
    for (size_t i = 0; i < SAMPLES; i++) {
        const gonio_pair *p = &samples->pairs[i];
        geometry[i] =
            gonio_lobe_geometry_of(gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o));
        weight[i] = 1;
        highest = fmax(highest, samples->values[i]);
    }
    const gonio_analytic_data data = {SAMPLES, 1,       {GONIO_LOSS_LINEAR, false}, geometry, samples->values, weight,
                                      &eps,    &highest};
    printf("| lobes | parameters | rmse of the best start | of the median one | of the worst | did not converge | the "
           "method |\n|---|---|---|---|---|---|---|\n");
    for (int lobes = 1; lobes <= 5; lobes += 2) {
        gonio_analytic_layout layout;
        gonio_analytic_layout_init(&layout, &gonio_analytic_plan_lafortune, true, lobes);
        const outcome o = from_random_starts(&(gonio_analytic_problem){&layout, &data});
        printf("| %d | %d | %.4g | %.4g | %.4g | %d of %d | %.4g |\n", lobes, 3 * lobes + 1, o.rmse[0],
               o.rmse[STARTS / 2], o.rmse[STARTS - 1], o.stuck, STARTS, by_method(samples, lobes));
        fflush(stdout);
    }
    gonio_samples_free(samples);
    gonio_model_free(truth);
    return 0;
}
