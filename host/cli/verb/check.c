// SPDX-License-Identifier: BSD-3-Clause
// gonio check: is a BRDF reciprocal, does it conserve energy, is it isotropic, how separable is it.
#include <stdio.h>
#include <string.h>

#include "base/keys.h"
#include "gonio/check.h"
#include "host/cli/input.h"

typedef struct check_arguments {
    const char *apply, *output;
    double max_reciprocity, max_energy;
    int transforms;
    gonio_coverage coverage;
    gonio_mueller_report mueller; // no samples: of a model
    cli_input input;
} check_arguments;

static bool parse_apply(const cli_common *common, check_arguments *a) {
    static const char *const names[] = {"mirror", "reciprocity", "isotropy", "clamp", "energy", NULL};
    if ((a->apply == NULL) != (a->output == NULL)) {
        cli_usage(common, "check: --apply and -o belong together");
        return false;
    }
    char copy[128], *rest;
    snprintf(copy, sizeof copy, "%s", a->apply != NULL ? a->apply : "");
    for (char *item = strtok_r(copy, ",", &rest); item != NULL; item = strtok_r(NULL, ",", &rest)) {
        const int k = gonio_names_find(names, item);
        if (k < 0) {
            cli_usage(common, "check: --apply: expected mirror, reciprocity, isotropy, clamp, energy, found '%s'",
                      item);
            return false;
        }
        a->transforms |= 1 << k;
    }
    return true;
}

static gonio_status limits(const check_arguments *a, const gonio_check_report *r, gonio_error *error) {
    if (a->max_energy > 0 && r->energy > a->max_energy) {
        return gonio_fail(error, GONIO_E_MISMATCH, "energy %g at theta_i = %g deg exceeds %g", r->energy,
                          gonio_degrees(r->energy_theta_rad), a->max_energy);
    }
    if (a->max_reciprocity > 0 && r->reciprocity > a->max_reciprocity) {
        return gonio_fail(error, GONIO_E_MISMATCH, "reciprocity differs by %g, more than %g", r->reciprocity,
                          a->max_reciprocity);
    }
    return GONIO_OK;
}

static gonio_status check(const char *name, check_arguments *a, const cli_common *common, gonio_check_report *report,
                          gonio_error *error) {
    const bool is_model = strncmp(name, "spec:", 5) == 0 || gonio_model_file_is(name);
    gonio_samples *samples = NULL, *changed = NULL;
    gonio_model *model = NULL;
    gonio_status status;
    if (is_model && a->transforms != 0) {
        return gonio_fail(error, GONIO_E_USAGE, "--apply changes samples; `gonio convert` makes them of a model");
    }
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
        status =
            status == GONIO_OK ? gonio_check_samples(samples, common->seed, common->threads, report, error) : status;
    }
    if (status == GONIO_OK && a->transforms != 0) {
        status = gonio_check_apply(samples, a->transforms, report->energy, &changed, error);
    }
    status = status == GONIO_OK && a->transforms != 0 ? gonio_write_samples(changed, a->output, error) : status;
    gonio_samples_free(changed);
    gonio_samples_free(samples);
    gonio_model_free(model);
    return status == GONIO_OK ? limits(a, report, error) : status;
}

static json_t *to_json(const char *name, const check_arguments *a, const gonio_check_report *r) {
    json_t *ranks = json_array();
    for (int k = 0; k < GONIO_CHECK_RANKS; k++) {
        json_array_append_new(ranks, cli_json_real(r->separability[k]));
    }
    return json_pack("{s:s,s:o,s:o,s:f,s:i,s:o,s:o,s:I,s:o,s:o}", "input", name, "reciprocity",
                     cli_json_real(r->reciprocity), "energy", cli_json_real(r->energy), "energy_theta_i",
                     gonio_degrees(r->energy_theta_rad), "energy_channel", r->energy_channel, "isotropy",
                     cli_json_real(r->isotropy), "separability", ranks, "negative", (json_int_t)r->negative, "sampled",
                     a->coverage.samples > 0 ? cli_json_coverage(&a->coverage) : json_null(), "mueller",
                     cli_json_mueller(&a->mueller));
}

static void print(const check_arguments *a, const gonio_check_report *r) {
    if (a->coverage.samples > 0) {
        cli_print_coverage(&a->coverage);
        cli_print_mueller(&a->mueller);
    }
    printf("reciprocity   %.3g %% median difference when incident and outgoing are exchanged\n", 100 * r->reciprocity);
    printf("energy        %.4g largest directional albedo, at theta_i = %g deg%s\n", r->energy,
           gonio_degrees(r->energy_theta_rad), r->energy > 1.002 ? ": MORE THAN ARRIVES" : "");
    printf("isotropy      %.3g %% median difference when the sample turns\n", 100 * r->isotropy);
    printf("separability ");
    for (int k = 0; k < GONIO_CHECK_RANKS; k++) {
        printf(" %d: %.3g %%", k + 1, 100 * r->separability[k]);
    }
    printf("\n");
    if (r->negative > 0) {
        printf("negative      %zu values\n", r->negative);
    }
}

static int run(int argc, char **argv) {
    check_arguments a = {0};
    const cli_option options[] = {
        {"apply", 0, CLI_TEXT, &a.apply, NULL, "LIST",
         "mirror,reciprocity,isotropy,clamp,energy: write changed samples"},
        {"output", 'o', CLI_OUTPUT, &a.output, NULL, "CSV", "where --apply writes"},
        {"max-energy", 0, CLI_DOUBLE, &a.max_energy, NULL, "X", "fail (status 1) above it"},
        {"max-reciprocity", 0, CLI_DOUBLE, &a.max_reciprocity, NULL, "X", "fail (status 1) above it"},
        CLI_INPUT_OPTIONS(a.input),
        {0}};
    extern const cli_verb cmd_check;
    const char *name;
    int count;
    cli_common common;
    if (!cli_parse(&cmd_check, options, argc, argv, &name, 1, 1, &count, &common) || !parse_apply(&common, &a)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_check_report report = {0};
    if (check(name, &a, &common, &report, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    if (common.json) {
        return cli_json(to_json(name, &a, &report));
    }
    print(&a, &report);
    return 0;
}

const cli_verb cmd_check = {"check", "INPUT|MODEL [options]",
                            "reciprocity, energy, isotropy and separability of samples or a model", run};
