// SPDX-License-Identifier: BSD-3-Clause
// gonio check: is a BRDF reciprocal, does it conserve energy, is it isotropic, how separable is it.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/keys.h"
#include "fit/check/kernel.h"
#include "gonio/check.h"
#include "host/cli/apart.h"
#include "host/cli/check_pictures.h"
#include "host/cli/input.h"

enum { CHANGES_MAX = 8 };

typedef struct check_arguments {
    const char *apply, *output, *images, *reflectances;
    gonio_pair pair; // of --reflectances
    double cone_rad, nine[3][3];
    double max_reciprocity, max_energy, significance, delta, ceiling;
    bool one_scalar, geometric, stream;
    size_t memory;
    gonio_change changes[CHANGES_MAX];
    int n_changes;
    gonio_check_report after;        // of what was written
    gonio_change shown[CHANGES_MAX]; // in pictures: those of --apply, or the usual ones
    int n_shown;
    cli_picture_error picture[CHANGES_MAX];
    gonio_coverage coverage; // no samples: of a model
    bool sigma;              // the samples carry it
    gonio_mueller_report mueller;
    cli_input input;
} check_arguments;

// "reciprocity,energy,isotropy,separable:K", in the order in which they are applied.
static bool parse_change(const cli_common *common, check_arguments *a, const char *item) {
    const char *colon = strchr(item, ':');
    const size_t length = colon != NULL ? (size_t)(colon - item) : strlen(item);
    char end = 0;
    int kind = 0, products = 1;
    while (kind < GONIO_CHANGES &&
           (strncmp(gonio_change_name(kind), item, length) != 0 || gonio_change_name(kind)[length] != 0)) {
        kind++;
    }
    const bool separable = kind == GONIO_CHANGE_SEPARABLE;
    if (kind == GONIO_CHANGES || (colon != NULL) != separable || a->n_changes == CHANGES_MAX ||
        (separable && (sscanf(colon + 1, "%9d%c", &products, &end) != 1 || products < 1 || products > 64))) {
        cli_usage(
            common,
            "check: --apply '%s'; expected reciprocity, energy, isotropy, separable:K (1 to 64 products), mirror or "
            "clamp, at most %d of them",
            item, CHANGES_MAX);
        return false;
    }
    a->changes[a->n_changes++] = (gonio_change){kind, products, a->delta, a->ceiling, a->one_scalar, a->geometric};
    return true;
}

static bool parse_apply(const cli_common *common, check_arguments *a) {
    char copy[256], *rest;
    if (a->apply == NULL && a->output != NULL) {
        cli_usage(common, "check: -o is where --apply writes");
        return false;
    }
    if (a->apply != NULL && a->output == NULL && a->images == NULL) {
        cli_usage(common, "check: --apply and -o belong together");
        return false;
    }
    if (!(a->delta >= 0 && a->delta <= 1) || !(a->ceiling > 0 && a->ceiling <= 1)) {
        cli_usage(common, "check: --delta is 0 to 1, --ceiling above 0 to 1; found %g and %g", a->delta, a->ceiling);
        return false;
    }
    snprintf(copy, sizeof copy, "%s", a->apply != NULL ? a->apply : "");
    for (char *item = strtok_r(copy, ",", &rest); item != NULL; item = strtok_r(NULL, ",", &rest)) {
        if (!parse_change(common, a, item)) {
            return false;
        }
    }
    return true;
}

// ---- the nine reflectances ----

static bool parse_reflectances(const cli_common *common, check_arguments *a) {
    double v[5];
    char end;
    if (a->reflectances == NULL) {
        return true;
    }
    const int found = sscanf(a->reflectances, "%lf,%lf,%lf,%lf,%lf%c", &v[0], &v[1], &v[2], &v[3], &v[4], &end);
    if (found != 5 || !(v[0] >= 0 && v[0] < 90) || !(v[2] >= 0 && v[2] < 90) || !(fabs(v[1]) <= 360) ||
        !(fabs(v[3]) <= 360) || !(v[4] > 0 && v[4] <= 90)) {
        cli_usage(common,
                  "check: --reflectances '%s'; expected theta_i,phi_i,theta_o,phi_o and half a cone's opening, deg",
                  a->reflectances);
        return false;
    }
    a->pair = (gonio_pair){gonio_radians(v[0]), gonio_radians(v[1]), gonio_radians(v[2]), gonio_radians(v[3])};
    a->cone_rad = gonio_radians(v[4]);
    return true;
}

static gonio_status find_nine(check_arguments *a, const gonio_model *model, const gonio_samples *samples,
                              gonio_error *error) {
    gonio_kernel kernel;
    const gonio_status status = samples != NULL ? gonio_kernel_new(samples, false, &kernel, error) : GONIO_OK;
    if (status == GONIO_OK) {
        gonio_check_reflectances(samples != NULL ? &kernel.head : model, &a->pair, a->cone_rad, a->nine);
    }
    if (status == GONIO_OK && samples != NULL) {
        gonio_kernel_free(&kernel);
    }
    return status;
}

static const char *const solid_angles[3] = {"direction", "cone", "hemisphere"};

static json_t *nine_json(const check_arguments *a) {
    json_t *rows = json_object();
    for (int i = 0; i < 3; i++) {
        json_object_set_new(rows, solid_angles[i],
                            json_pack("{s:f,s:f,s:f}", solid_angles[0], a->nine[i][0], solid_angles[1], a->nine[i][1],
                                      solid_angles[2], a->nine[i][2]));
    }
    return rows;
}

static void print_nine(const check_arguments *a) {
    printf("reflectances  light from (rows) into (columns); into a direction: reflectance factor\n");
    printf("              %-12s %10s %10s %10s\n", "", solid_angles[0], solid_angles[1], solid_angles[2]);
    for (int i = 0; i < 3; i++) {
        printf("              %-12s %10.5g %10.5g %10.5g\n", solid_angles[i], a->nine[i][0], a->nine[i][1],
               a->nine[i][2]);
    }
}

// ---- pictures ----

// Those of --apply that a model can have; without --apply those that DeYoung shows.
static void choose_shown(check_arguments *a) {
    const gonio_change usual[] = {{GONIO_CHANGE_RECIPROCITY, 0, a->delta, a->ceiling, a->one_scalar, a->geometric},
                                  {GONIO_CHANGE_ENERGY, 0, a->delta, a->ceiling, a->one_scalar, a->geometric},
                                  {GONIO_CHANGE_ISOTROPY, 0, a->delta, a->ceiling, a->one_scalar, a->geometric},
                                  {GONIO_CHANGE_SEPARABLE, 1, a->delta, a->ceiling, a->one_scalar, a->geometric},
                                  {GONIO_CHANGE_SEPARABLE, 5, a->delta, a->ceiling, a->one_scalar, a->geometric}};
    const gonio_change *from = a->n_changes > 0 ? a->changes : usual;
    const int n = a->n_changes > 0 ? a->n_changes : (int)(sizeof usual / sizeof *usual);
    for (int k = 0; k < n; k++) {
        if (from[k].kind != GONIO_CHANGE_MIRROR && from[k].kind != GONIO_CHANGE_CLAMP) {
            a->shown[a->n_shown++] = from[k];
        }
    }
}

// Samples are shown as the kernel interpolates them.
static gonio_status show(check_arguments *a, const cli_common *common, const gonio_model *model,
                         const gonio_samples *samples, const gonio_check_report *report, gonio_error *error) {
    gonio_kernel kernel;
    gonio_status status = samples != NULL ? gonio_kernel_new(samples, false, &kernel, error) : GONIO_OK;
    if (status != GONIO_OK) {
        return status;
    }
    choose_shown(a);
    status = cli_check_pictures(a->images, samples != NULL ? &kernel.head : model, a->shown, a->n_shown, report,
                                common->threads, a->picture, error);
    if (samples != NULL) {
        gonio_kernel_free(&kernel);
    }
    return status;
}

// Apply, write, and measure what was written.
static gonio_status apply_samples(check_arguments *a, const cli_common *common, const gonio_samples *samples,
                                  gonio_error *error) {
    gonio_samples *now = NULL;
    gonio_status status = GONIO_OK;
    for (int k = 0; k < a->n_changes && status == GONIO_OK; k++) {
        gonio_samples *next;
        status = gonio_check_change(now != NULL ? now : samples, &a->changes[k], common->threads, &next, error);
        gonio_samples_free(now);
        now = status == GONIO_OK ? next : NULL;
    }
    status = status == GONIO_OK ? gonio_write_samples(now, a->output, error) : status;
    status = status == GONIO_OK ? gonio_check_samples(now, common->threads, &a->after, error) : status;
    gonio_samples_free(now);
    return status;
}

// *model: taken, and replaced by what it becomes.
static gonio_status apply_model(check_arguments *a, const cli_common *common, gonio_model **model, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; k < a->n_changes && status == GONIO_OK; k++) {
        status = gonio_check_change_model(*model, &a->changes[k], common->threads, model, error);
    }
    status = status == GONIO_OK ? gonio_model_save(*model, a->output, error) : status;
    return status == GONIO_OK ? gonio_check_model(*model, common->threads, &a->after, error) : status;
}

static gonio_status limits(const check_arguments *a, const gonio_check_report *r, gonio_error *error) {
    if (a->max_energy > 0 && r->energy > a->max_energy) {
        return gonio_fail(error, GONIO_E_MISMATCH, "energy %g at theta_i = %g deg exceeds %g", r->energy,
                          gonio_degrees(r->energy_theta_rad), a->max_energy);
    }
    if (a->max_reciprocity > 0 && r->reciprocity_median > a->max_reciprocity) {
        return gonio_fail(error, GONIO_E_MISMATCH, "reciprocity differs by %g, more than %g", r->reciprocity_median,
                          a->max_reciprocity);
    }
    if (r->reciprocity_test.p < a->significance || r->energy_test.p < a->significance) {
        return gonio_fail(error, GONIO_E_MISMATCH,
                          "not explained by sigma: p = %.2g of reciprocity, %.2g of energy, one below %g",
                          r->reciprocity_test.p, r->energy_test.p, a->significance);
    }
    return GONIO_OK;
}

// A table that memory need not hold; one change at a time.
static gonio_status check_stream(const char *name, check_arguments *a, gonio_check_report *report, gonio_error *error) {
    gonio_status status = cli_input_refuse(&a->input, "a table read in passes", error);
    if (status == GONIO_OK && (a->n_changes > 1 || a->images != NULL || a->reflectances != NULL)) {
        status = gonio_fail(error, GONIO_E_USAGE, "stream: one change at a time, no pictures and no reflectances");
    }
    status = status == GONIO_OK ? gonio_check_stream(name, a->memory, report, error) : status;
    if (status == GONIO_OK && a->n_changes == 1) {
        status = gonio_check_stream_change(name, &a->changes[0], a->memory, a->output, error);
        status = status == GONIO_OK ? gonio_check_stream(a->output, a->memory, &a->after, error) : status;
    }
    return status == GONIO_OK ? limits(a, report, error) : status;
}

static bool is_model_name(const char *name) { return strncmp(name, "spec:", 5) == 0 || gonio_model_file_is(name); }

// The nine reflectances and the pictures, of the half that the report is of.
static gonio_status look_closer(check_arguments *a, const cli_common *common, const gonio_model *model,
                                const gonio_samples *samples, const gonio_check_report *report, gonio_error *error) {
    gonio_samples *raised = NULL;
    gonio_status status = GONIO_OK;
    if (report->transmission && samples != NULL) {
        status = gonio_samples_half(samples, report->half, NULL, &raised, error);
        samples = raised;
    } else if (report->transmission) {
        model = gonio_model_half(model, report->half);
    }
    if (status == GONIO_OK && a->reflectances != NULL) {
        status = find_nine(a, model, samples, error);
    }
    if (status == GONIO_OK && a->images != NULL) {
        status = show(a, common, model, samples, report, error);
    }
    gonio_samples_free(raised);
    return status;
}

static gonio_status check(const char *name, check_arguments *a, const cli_common *common, gonio_check_report *report,
                          gonio_error *error) {
    const bool is_model = is_model_name(name);
    if (a->stream) {
        return check_stream(name, a, report, error);
    }
    gonio_samples *samples = NULL;
    gonio_model *model = NULL;
    gonio_status status;
    if (is_model) {
        status = cli_input_refuse(&a->input, "a model", error);
        status = status == GONIO_OK ? gonio_model_resolve(name, &model, error) : status;
        status = status == GONIO_OK ? gonio_check_model(model, common->threads, report, error) : status;
    } else {
        status = cli_input_read(name, &a->input, common, &samples, error);
        if (status == GONIO_OK) {
            gonio_check_mueller(samples, &a->mueller);
            status = gonio_coverage_of(samples, &a->coverage, error);
        }
        a->sigma = status == GONIO_OK && samples->sigma_random != NULL;
        status = status == GONIO_OK ? gonio_check_samples(samples, common->threads, report, error) : status;
    }
    status = status == GONIO_OK ? look_closer(a, common, model, samples, report, error) : status;
    if (status == GONIO_OK && a->n_changes > 0 && a->output != NULL) {
        status = is_model ? apply_model(a, common, &model, error) : apply_samples(a, common, samples, error);
    }
    gonio_samples_free(samples);
    gonio_model_free(model);
    return status == GONIO_OK ? limits(a, report, error) : status;
}

// ---- JSON ----

static json_t *to_json_test(const gonio_check_test *t) {
    return json_pack("{s:o,s:o,s:o,s:i}", "chi2", cli_json_real(t->chi2), "dof", cli_json_real(t->dof), "p",
                     cli_json_real(t->p), "channel", t->channel);
}

static json_t *to_json_range(const gonio_check_range *r) {
    return json_pack("{s:o,s:o,s:o,s:[f,f,f,f],s:i,s:I}", "min", cli_json_real(r->low), "mean", cli_json_real(r->mean),
                     "max", cli_json_real(r->high), "where", gonio_degrees(r->where.theta_i),
                     gonio_degrees(r->where.phi_i), gonio_degrees(r->where.theta_o), gonio_degrees(r->where.phi_o),
                     "channel", r->channel, "compared", (json_int_t)r->compared);
}

static json_t *to_json_albedos(const gonio_check_report *r) {
    json_t *rows = json_array();
    for (size_t k = 0; k < r->incidences; k++) {
        const gonio_check_albedo_point *a = &r->albedos[k];
        json_t *row = json_pack("{s:f,s:f,s:o,s:o,s:f,s:f,s:f,s:f}", "theta_i", gonio_degrees(a->theta_i), "phi_i",
                                gonio_degrees(a->phi_i), "albedo", cli_json_real(a->value), "largest",
                                cli_json_real(a->largest), "sigma_random", a->random, "sigma_systematic", a->systematic,
                                "integration", a->integration, "covered", a->covered);
        if (r->transmission) {
            json_object_set_new(row, "reflected", cli_json_real(a->reflected));
            json_object_set_new(row, "transmitted", cli_json_real(a->transmitted));
        }
        json_array_append_new(rows, row);
    }
    return rows;
}

static void add_ranges(json_t *out, const gonio_check_report *r) {
    json_object_set_new(out, "separability_error", cli_json_real(r->separability_error));
    json_object_set_new(out, "mean_square_seen", cli_json_real(r->mean_square_seen));
    json_object_set_new(out, "reciprocity_range", to_json_range(&r->reciprocity_range));
    json_object_set_new(out, "isotropy_range", to_json_range(&r->isotropy_range));
    json_object_set_new(out, "energy_range", to_json_range(&r->energy_range));
    json_object_set_new(out, "reciprocity_test", to_json_test(&r->reciprocity_test));
    json_object_set_new(out, "isotropy_test", to_json_test(&r->isotropy_test));
    json_object_set_new(out, "energy_test", to_json_test(&r->energy_test));
    json_object_set_new(out, "reciprocity_part", cli_json_real(r->reciprocity_part));
    json_object_set_new(out, "isotropy_part", cli_json_real(r->isotropy_part));
}

static json_t *to_json_pictures(const check_arguments *a) {
    json_t *pictures = json_array();
    for (int k = 0; k < a->n_shown; k++) {
        const cli_picture_error *e = &a->picture[k];
        json_array_append_new(pictures, json_pack("{s:s,s:f,s:f,s:f}", "name", e->name, "mean", e->mean, "rms", e->rms,
                                                  "largest", e->largest));
    }
    return pictures;
}

static json_t *to_json_after(const check_arguments *a) {
    const gonio_check_report *after = &a->after;
    json_t *left = json_array();
    for (int k = 0; k < after->ranks; k++) {
        json_array_append_new(left, cli_json_real(after->separability[k]));
    }
    return json_pack("{s:s,s:o,s:o,s:o,s:o,s:o}", "output", a->output, "reciprocity", cli_json_real(after->reciprocity),
                     "excess", cli_json_real(after->excess), "energy", cli_json_real(after->energy), "isotropy",
                     cli_json_real(after->isotropy), "separability", left);
}

static json_t *to_json(const char *name, const check_arguments *a, const gonio_check_report *r) {
    json_t *ranks = json_array(), *tests = json_array();
    for (int k = 0; k < r->ranks; k++) {
        json_array_append_new(ranks, cli_json_real(r->separability[k]));
        json_array_append_new(tests, to_json_test(&r->separability_test[k]));
    }
    json_t *out = json_pack(
        "{s:s,s:s,s:o,s:o,s:o,s:o,s:o,s:o,s:f,s:f,s:i,s:o,s:o,s:o,s:I,s:o}", "input", name, "form",
        gonio_check_form_name(r->form), "reciprocity", cli_json_real(r->reciprocity), "reciprocity_median",
        cli_json_real(r->reciprocity_median), "reciprocity_expected", cli_json_real(r->reciprocity_expected), "excess",
        cli_json_real(r->excess), "albedo", cli_json_real(r->albedo), "energy", cli_json_real(r->energy),
        "energy_theta_i", gonio_degrees(r->energy_theta_rad), "energy_phi_i", gonio_degrees(r->energy_phi_rad),
        "energy_channel", r->energy_channel, "isotropy", cli_json_real(r->isotropy), "isotropy_median",
        cli_json_real(r->isotropy_median), "separability", ranks, "negative", (json_int_t)r->negative, "sampled",
        a->coverage.samples > 0 ? cli_json_coverage(&a->coverage) : json_null());
    json_object_set_new(out, "separability_tests", tests);
    json_object_set_new(out, "mueller", cli_json_mueller(&a->mueller));
    add_ranges(out, r);
    json_object_set_new(out, "albedos", to_json_albedos(r));
    if (r->transmission) {
        json_object_set_new(out, "half", json_string(gonio_half_name(r->half)));
    }
    if (a->reflectances != NULL) {
        json_object_set_new(out, "reflectances", nine_json(a));
    }
    json_object_set_new(out, "pictures", to_json_pictures(a));
    if (a->n_changes > 0 && a->output != NULL) {
        json_object_set_new(out, "after", to_json_after(a));
    }
    return out;
}

// ---- for people ----

static void print_test(const gonio_check_test *t, bool sigma) {
    if (isfinite(t->p)) {
        printf("              %s %s: chi2 %.4g of %.4g degrees of freedom, p = %.2g\n",
               t->p < 0.01 ? "NOT EXPLAINED BY" : "explained by", sigma ? "SIGMA" : "SCATTER (no sigma is given)",
               t->chi2, t->dof, t->p);
    }
}

static void print_range(const char *what, const gonio_check_range *r) {
    if (r->compared > 0 && r->high > 0) {
        printf("              %s: min %.3g, mean %.3g, max %.3g %%, at %.4g,%.4g,%.4g,%.4g deg (%zu compared)\n", what,
               r->low, r->mean, r->high, gonio_degrees(r->where.theta_i), gonio_degrees(r->where.phi_i),
               gonio_degrees(r->where.theta_o), gonio_degrees(r->where.phi_o), r->compared);
    }
}

static void print_reciprocity(const gonio_check_report *r, bool sigma) {
    if (isnan(r->reciprocity)) {
        printf("reciprocity   no exchanged direction is near a sample\n");
        return;
    }
    printf("reciprocity   P_r = %.6g /sr^2", r->reciprocity);
    if (isfinite(r->reciprocity_expected)) {
        printf("; %s alone would make %.3g", sigma && r->reciprocity_part == 0 ? "sigma" : "noise and interpolation",
               r->reciprocity_expected);
    }
    printf("\n");
    print_range("difference when exchanged", &r->reciprocity_range);
    if (r->reciprocity_part > 0) {
        printf("              smooth part of it: rms %.3g %%\n", 100 * r->reciprocity_part);
    }
    print_test(&r->reciprocity_test, sigma);
}

// Standard uncertainty of the largest albedo.
static double energy_sigma(const gonio_check_report *r) {
    for (size_t k = 0; k < r->incidences; k++) {
        const gonio_check_albedo_point *a = &r->albedos[k];
        if (a->largest == r->energy) {
            return sqrt(a->random * a->random + a->systematic * a->systematic + a->integration * a->integration);
        }
    }
    return 0;
}

// At most about eight of the incidences.
static void print_parts(const gonio_check_report *r) {
    const size_t step = r->incidences / 8 + 1;
    printf("              of what is reflected and what goes through, mean over the channels:\n");
    for (size_t k = 0; k < r->incidences; k += step) {
        const gonio_check_albedo_point *a = &r->albedos[k];
        char part[2][40] = {"not measured", "not measured"};
        if (isfinite(a->reflected)) {
            snprintf(part[0], sizeof part[0], "%.4g reflected", a->reflected);
        }
        if (isfinite(a->transmitted)) {
            snprintf(part[1], sizeof part[1], "%.4g transmitted", a->transmitted);
        }
        printf("              theta_i %g, phi_i %g: %s + %s = %.4g\n", gonio_degrees(a->theta_i),
               gonio_degrees(a->phi_i), part[0], part[1], a->value);
    }
}

static void print_energy(const gonio_check_report *r) {
    const double sigma = energy_sigma(r);
    if (!isfinite(r->energy)) {
        printf("energy        no incidence has outgoing directions enough for its albedo\n");
        return;
    }
    printf(
        "energy        P_ec = %.6g; albedo %.4g mean, %.4g largest (within %.2g), at theta_i = %g, phi_i = %g deg%s\n",
        r->excess, r->albedo, r->energy, sigma, gonio_degrees(r->energy_theta_rad), gonio_degrees(r->energy_phi_rad),
        r->energy > 1.002 + 2 * sigma ? ": MORE THAN ARRIVES"
        : r->energy > 1.002           ? ": more than arrives, but no more than it may be off"
                                      : "");
    if (r->transmission) {
        print_parts(r);
    }
    print_test(&r->energy_test, true);
}

static void print(const check_arguments *a, const gonio_check_report *r) {
    if (a->coverage.samples > 0) {
        cli_print_coverage(&a->coverage);
        cli_print_mueller(&a->mueller);
    }
    printf("form          %s\n", gonio_check_form_name(r->form));
    if (r->transmission) {
        printf("half          %s, of which all but the energy is\n", gonio_half_name(r->half));
    }
    print_reciprocity(r, a->sigma);
    print_energy(r);
    printf("isotropy      P_i = %.6g /sr\n", r->isotropy);
    print_range("from the mean over azimuths", &r->isotropy_range);
    if (r->isotropy_part > 0) {
        printf("              smooth part of it: rms %.3g %%\n", 100 * r->isotropy_part);
    }
    print_test(&r->isotropy_test, a->sigma);
    printf("separability  P_s^(k), %zu x %zu directions:", r->directions[0], r->directions[1]);
    for (int k = 0; k < r->ranks && k < 8; k++) {
        printf(" %d: %.3g (%.2g %%)", k + 1, r->separability[k], 100 * r->separability_range[k]);
    }
    printf("\n");
    if (fabs(log(r->mean_square_seen)) > log(1.1)) {
        printf("              of a table of 10 deg, whose mean square is %.3g %% of f's: too coarse for its lobes\n",
               100 * r->mean_square_seen);
    }
    if (r->negative > 0) {
        printf("negative      %zu values\n", r->negative);
    }
    if (a->reflectances != NULL) {
        print_nine(a);
    }
    for (int k = 0; k < a->n_shown; k++) {
        const cli_picture_error *e = &a->picture[k];
        printf("%s/%s.png: mean difference %.3g, rms %.3g, largest %.3g of 255\n", a->images, e->name, e->mean, e->rms,
               e->largest);
    }
}

static void print_after(const check_arguments *a) {
    const gonio_check_report *r = &a->after;
    printf("%s: P_r = %.6g, P_ec = %.6g, albedo at most %.4g, P_i = %.6g, P_s^(k)", a->output, r->reciprocity,
           r->excess, r->energy, r->isotropy);
    for (int k = 0; k < r->ranks && k < 8; k++) {
        printf(" %.3g", r->separability[k]);
    }
    printf("\n");
}

static int finish(const char *name, check_arguments *a, cli_common *common) {
    // What the pictures of --images may be called.
    static const char *const pictures[] = {"albedo.png",      "albedo.svg", "separability.png", "separability.svg",
                                           "reciprocity.png", "energy.png", "isotropy.png",     NULL};
    gonio_error error = {.line = -1, .byte = -1};
    gonio_check_report report = {0};
    int status = 0;
    if (!cli_apart_folder(common, a->images, pictures)) {
        return 2;
    }
    if (check(name, a, common, &report, &error) != GONIO_OK) {
        status = cli_fail(common, &error);
    } else if (common->json) {
        status = cli_json(to_json(name, a, &report));
    } else {
        print(a, &report);
        if (a->n_changes > 0 && a->output != NULL) {
            print_after(a);
        }
    }
    gonio_check_report_free(&report);
    gonio_check_report_free(&a->after);
    return status;
}

static int run(int argc, char **argv) {
    check_arguments a = {.delta = 1, .ceiling = 1};
    const cli_option options[] = {
        {"apply", 0, CLI_TEXT, &a.apply, NULL, "LIST",
         "reciprocity,energy,isotropy,separable:K,mirror,clamp: write it changed, in that order"},
        {"delta", 0, CLI_DOUBLE, &a.delta, NULL, "D", "how far: 0 not at all, 1 all the way (1)"},
        {"geometric", 0, CLI_FLAG, &a.geometric, NULL, NULL, "on the way by powers instead of a line"},
        {"ceiling", 0, CLI_DOUBLE, &a.ceiling, NULL, "TAU", "the albedo that energy allows (1)"},
        {"one-scalar", 0, CLI_FLAG, &a.one_scalar, NULL, NULL,
         "energy: one factor for the whole BRDF instead of one an incidence"},
        {"output", 'o', CLI_OUTPUT, &a.output, NULL, "CSV|MODEL",
         "where --apply writes: samples, or of a model a model"},
        {"reflectances", 0, CLI_TEXT, &a.reflectances, NULL, "TI,PI,TO,PO,CONE",
         "the nine reflectances: direction, cone (half its opening, deg) and hemisphere on either side"},
        {"stream", 0, CLI_FLAG, &a.stream, NULL, NULL,
         "a table larger than memory: a CSV of one channel, incidence by incidence, read in passes"},
        {"max-memory", 0, CLI_SIZE, &a.memory, NULL, "BYTES", "of it that --stream holds (256M)"},
        {"images", 0, CLI_TEXT, &a.images, NULL, "DIR",
         "pictures of what each transform costs to look at: before, after, difference, lobes, curves"},
        {"max-energy", 0, CLI_DOUBLE, &a.max_energy, NULL, "X", "fail (status 1) where an albedo is above it"},
        {"max-reciprocity", 0, CLI_DOUBLE, &a.max_reciprocity, NULL, "X",
         "fail (status 1) where the median relative difference is above it"},
        {"significance", 0, CLI_DOUBLE, &a.significance, NULL, "P",
         "fail (status 1) where sigma explains reciprocity or energy with a chance below P only"},
        CLI_INPUT_OPTIONS(a.input),
        {0}};
    extern const cli_verb cmd_check;
    const char *name;
    int count;
    cli_common common;
    if (!cli_parse(&cmd_check, options, argc, argv, &name, 1, 1, &count, &common) || !parse_apply(&common, &a) ||
        !parse_reflectances(&common, &a) || !cli_ending(&common, a.output, is_model_name(name) ? "MODEL" : "CSV")) {
        return 2;
    }
    return finish(name, &a, &common);
}

const cli_verb cmd_check = {"check", "INPUT|MODEL [options]",
                            "reciprocity, energy, isotropy and separability of samples or a model", run};
