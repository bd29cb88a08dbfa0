// SPDX-License-Identifier: BSD-3-Clause
// What a prior learnt from other materials is worth: 20 poses with it beside 200 without.
//
// The published fits of 100 measured materials (sgd:NAME) and the RGL tensors. A quarter of the materials is left out
// at a time, the prior is learnt from the rest, and each that was left out is fitted from 20 poses of the prior's plan
// with it, and from nusselt:200 without it; samples have the default rig's noise. Errors are at 2,000 directions that
// nobody measured. Sigma is true where an error is within 2 of it, over all materials.
//
// bench_prior [STEP (1): every STEP-th material] [POSES (20)]
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/statistics.h"
#include "gonio/gonio.h"
#include "gonio/library.h"
#include "tests/adaptive_run.h"

#define MATERIALS_MAX 256
#define PARTS 4
#define DIRECTIONS 2000
#define WITHOUT 200

static gonio_error error;
static char names[MATERIALS_MAX][96];
static gonio_model *models[MATERIALS_MAX];
static size_t n;

static void must(gonio_status status) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s: %s\n", gonio_status_text(status), error.message);
        exit(1);
    }
}

static void add(const char *spec) {
    if (n < MATERIALS_MAX && gonio_model_from_spec(spec, &models[n], &error) == GONIO_OK) {
        snprintf(names[n++], sizeof names[0], "%s", spec);
    }
}

static void read_materials(void) {
    static const char *const rgl[] = {"aurora_white", "chm_orange", "cm_military_green", "ilm_solo_m_68",
                                      "vch_silk_blue"};
    const char *data = getenv("GONIO_DATA") != NULL ? getenv("GONIO_DATA") : "../shared/data";
    char path[512], line[8192];
    snprintf(path, sizeof path, "%s/fits/bagher_sgd.fit", data);
    FILE *f = fopen(path, "r");
    while (f != NULL && fgets(line, sizeof line, f) != NULL) {
        if (line[0] != '#' && strchr(line, '=') != NULL) {
            snprintf(path, sizeof path, "sgd:%.*s", (int)strcspn(line, " ="), line);
            add(path);
        }
    }
    if (f != NULL) {
        fclose(f);
    }
    for (size_t k = 0; k < sizeof rgl / sizeof *rgl; k++) {
        snprintf(path, sizeof path, "file:%s/rgl/%s_rgb.bsdf", data, rgl[k]);
        add(path);
    }
}

static gonio_samples *measured(const gonio_model *truth, const gonio_plan *plan) {
    adaptive_run run;
    gonio_samples *samples;
    run_begin(&run, truth, "adaptive:100", 17);
    must(gonio_samples_new(truth->channels, true, &samples, &error));
    samples->isotropic = true;
    for (size_t i = 0; i < plan->n; i++) {
        run_sample(&run, &plan->poses[i], samples);
    }
    run_end(&run);
    return samples;
}

typedef struct result {
    gonio_errors errors;
    double within; // of 2 sigma
    bool refused;
} result;

static result judge(gonio_model *model, const gonio_samples *all) {
    result r = {.refused = false};
    size_t within = 0;
    must(gonio_errors_model(model, all, NULL, 1, &r.errors, &error));
    for (size_t i = 0; i < all->n; i++) {
        double f[GONIO_CHANNELS_MAX], sigma[GONIO_CHANNELS_MAX];
        const gonio_pair *p = &all->pairs[i];
        gonio_model_eval_pair(model, p, f);
        gonio_model_sigma(model, gonio_direction(p->theta_i, p->phi_i), gonio_direction(p->theta_o, p->phi_o), sigma);
        for (int c = 0; c < all->channels; c++) {
            within += fabs(f[c] - all->values[i * (size_t)all->channels + (size_t)c]) <= 2 * sigma[c];
        }
    }
    r.within = (double)within / (double)(all->n * (size_t)all->channels);
    gonio_model_free(model);
    return r;
}

static result with_prior(const gonio_library *library, const gonio_samples *samples, const gonio_samples *all) {
    gonio_model *model;
    if (gonio_library_fit(library, samples, 1, &model, NULL, &error) != GONIO_OK) {
        return (result){.errors = {NAN, NAN, NAN, NAN, NAN, NAN, 0}, .within = NAN, .refused = true};
    }
    return judge(model, all);
}

static result without(const gonio_samples *samples, const gonio_samples *all) {
    gonio_fit_options options;
    gonio_model *model;
    gonio_fit_options_default(&options);
    options.hold_out = 0;
    options.threads = 1;
    must(gonio_fit(samples, &options, &model, NULL, &error));
    return judge(model, all);
}

static void left_out(const gonio_library *library, const gonio_plan *few, size_t i, size_t wins[3], double *within) {
    gonio_plan *many, *directions;
    gonio_samples *all;
    must(gonio_plan_make("nusselt:200", 5, &many, &error));
    snprintf(names[MATERIALS_MAX - 1], sizeof names[0], "nusselt:%d", DIRECTIONS);
    must(gonio_plan_make(names[MATERIALS_MAX - 1], 987654321, &directions, &error));
    must(gonio_samples_of_model(models[i], directions->poses, directions->n, 1, &all, &error));
    all->isotropic = true;
    gonio_samples *a = measured(models[i], few), *b = measured(models[i], many);
    const result with = with_prior(library, a, all), no = without(b, all), few_alone = without(a, all);
    wins[0] += with.errors.median_rel < no.errors.median_rel;
    wins[1] += with.errors.rms_log < no.errors.rms_log;
    wins[2] += with.refused;
    *within = with.within;
    printf("%-32.32s %2zu with: %6.2f %% %.3f%s   without: %6.2f %% %.3f   200 without: %6.2f %% "
           "%.3f   within 2 sigma %.0f %%, %.0f %%\n",
           names[i], few->n, 100 * with.errors.median_rel, with.errors.rms_log, with.refused ? " refused" : "",
           100 * few_alone.errors.median_rel, few_alone.errors.rms_log, 100 * no.errors.median_rel, no.errors.rms_log,
           100 * with.within, 100 * no.within);
    fflush(stdout);
    gonio_samples_free(a);
    gonio_samples_free(b);
    gonio_samples_free(all);
    gonio_plan_free(many);
    gonio_plan_free(directions);
}

// The prior of the materials that are not of the part, told; *few: its plan.
static gonio_library *learn_without(size_t part, size_t poses, gonio_plan **few) {
    const gonio_model *rest[MATERIALS_MAX];
    const char *rest_names[MATERIALS_MAX];
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        if (i % PARTS != part) {
            rest[count] = models[i];
            rest_names[count++] = names[i];
        }
    }
    gonio_library *library;
    gonio_library_facts facts;
    const gonio_library_options options = {.seed = 1, .threads = 1};
    must(gonio_library_learn(rest, rest_names, count, &options, &library, &error));
    gonio_library_tell(library, &facts);
    printf("%d models, %d components hold %.2f %%; inflation %.2f, limit %.1f, trial %.2f %%\n", facts.models,
           facts.rank, 100 * facts.explained, facts.inflation, facts.limit, 100 * facts.trial_error);
    must(gonio_library_plan(library, poses, gonio_radians(85), 1, 1, few, &error));
    return library;
}

int main(int argc, char **argv) {
    const size_t step = argc > 1 ? strtoul(argv[1], NULL, 10) : 1, poses = argc > 2 ? strtoul(argv[2], NULL, 10) : 20;
    size_t wins[3] = {0}, tried = 0, known = 0;
    double within = 0;
    read_materials();
    for (size_t part = 0; part < PARTS && n >= 2 * PARTS; part++) {
        gonio_plan *few;
        gonio_library *library = learn_without(part, poses, &few);
        for (size_t i = part; i < n; i += PARTS) {
            if (i / PARTS % step == 0) {
                double one;
                left_out(library, few, i, wins, &one);
                tried++;
                known += isfinite(one);
                within += isfinite(one) ? one : 0;
            }
        }
        gonio_plan_free(few);
        gonio_library_free(library);
    }
    if (tried == 0) {
        puts("SKIP: no published fits");
        return 0;
    }
    printf("%zu materials: %zu poses with the prior are better than %d without on %zu (median_rel), %zu (rms_log); %zu "
           "refused; %.1f %% within 2 sigma\n",
           tried, poses, WITHOUT, wins[0], wins[1], wins[2], 100 * within / (double)(known > 0 ? known : 1));
    for (size_t i = 0; i < n; i++) {
        gonio_model_free(models[i]);
    }
    return 0;
}
