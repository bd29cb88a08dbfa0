// SPDX-License-Identifier: BSD-3-Clause
// gonio calibrate reference: a white standard's certificate -> the [reference] section of a rig file.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gonio/output.h"
#include "host/cli/calibrate/calibrate.h"

// Terms that the certificate does not hold, relative (k = 1), where it is converted from another geometry.
#define SHAPE_SIGMA_PERCENT 0.5

typedef struct settings {
    const char *table, *bands, *geometry, *brdf, *out;
    double shape_sigma_percent;
} settings;

typedef struct result {
    int channels;
    double centre_nm[3], fwhm_nm[3];
    double tabulated[3], factor[3], reflectance[3], relative_sigma[3];
} result;

static bool parse_bands(const char *text, result *r) {
    for (r->channels = 0; r->channels < 3; r->channels++) {
        int used = 0;
        if (sscanf(text, "%lf:%lf%n", &r->centre_nm[r->channels], &r->fwhm_nm[r->channels], &used) != 2) {
            return false;
        }
        text += used;
        if (*text == '\0') {
            r->channels++;
            break;
        }
        if (*text++ != ',') {
            return false;
        }
    }
    return *text == '\0' && (r->channels == 1 || r->channels == 3);
}

static gonio_status convert(const settings *s, const gonio_reflectance *table, const gonio_model *brdf, result *r,
                            gonio_error *error) {
    const bool hemispherical = strcmp(s->geometry, "8/h") == 0;
    for (int c = 0; c < r->channels; c++) {
        double sigma;
        const gonio_status status =
            gonio_reflectance_band(table, r->centre_nm[c], r->fwhm_nm[c], &r->tabulated[c], &sigma, error);
        if (status != GONIO_OK) {
            return status;
        }
        r->factor[c] = hemispherical ? gonio_reflectance_factor(brdf, c < brdf->channels ? c : 0, 8) : 1;
        if (!(r->factor[c] > 0.5 && r->factor[c] < 2)) {
            return gonio_fail_line(error, GONIO_E_INPUT, s->brdf, -1,
                                   "radiance factor at 45/0 over reflectance at 8 deg: %g; no white standard is so far "
                                   "from Lambertian",
                                   r->factor[c]);
        }
        r->reflectance[c] = r->tabulated[c] * r->factor[c];
        const double shape = hemispherical ? s->shape_sigma_percent / 100 : 0;
        r->relative_sigma[c] = hypot(sigma / r->tabulated[c], shape);
    }
    return GONIO_OK;
}

static double largest_sigma(const result *r) {
    double sigma = 0;
    for (int c = 0; c < r->channels; c++) {
        sigma = fmax(sigma, r->relative_sigma[c]);
    }
    return sigma;
}

static void write_reflectance(const result *r, FILE *stream) {
    for (int c = 0; c < r->channels; c++) {
        fprintf(stream, "%s%.6f", c > 0 ? "/" : "", r->reflectance[c]);
    }
}

static gonio_status write_section(const settings *s, const result *r, gonio_error *error) {
    gonio_output *output;
    gonio_status status = gonio_output_open(s->out, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    fprintf(stream, "# gonio calibrate reference %s, bands %s nm, table for %s\n[reference]\nreflectance = ", s->table,
            s->bands, s->geometry);
    write_reflectance(r, stream);
    fprintf(stream, "\nsigma_percent = %.6g\n", 100 * largest_sigma(r));
    if (s->brdf != NULL) {
        char *full = realpath(s->brdf, NULL);
        fprintf(stream, "brdf = %s\n", full != NULL ? full : s->brdf);
        free(full);
    }
    return gonio_output_commit(output, error);
}

static gonio_status calibrate(const settings *s, result *r, gonio_error *error) {
    gonio_reflectance table = {0};
    gonio_model *brdf = NULL;
    gonio_status status = gonio_reflectance_read(s->table, &table, error);
    status = status == GONIO_OK && s->brdf != NULL ? gonio_model_resolve(s->brdf, &brdf, error) : status;
    status = status == GONIO_OK ? convert(s, &table, brdf, r, error) : status;
    status = status == GONIO_OK && s->out != NULL ? write_section(s, r, error) : status;
    gonio_model_free(brdf);
    gonio_reflectance_free(&table);
    return status;
}

static int report(const settings *s, const result *r, bool json) {
    json_t *list = json_array();
    for (int c = 0; c < r->channels; c++) {
        if (!json) {
            printf("%g nm (%g nm wide): tabulated %.5f, radiance factor at 45/0 %.5f (factor %.5f) +- %.3f %%\n",
                   r->centre_nm[c], r->fwhm_nm[c], r->tabulated[c], r->reflectance[c], r->factor[c],
                   100 * r->relative_sigma[c]);
        }
        json_array_append_new(list,
                              json_pack("{s:f,s:f,s:f,s:f,s:f,s:f}", "centre_nm", r->centre_nm[c], "fwhm_nm",
                                        r->fwhm_nm[c], "tabulated", r->tabulated[c], "factor", r->factor[c],
                                        "reflectance", r->reflectance[c], "relative_sigma", r->relative_sigma[c]));
    }
    json_t *object = json_pack("{s:s,s:s,s:o,s:f}", "table", s->table, "geometry", s->geometry, "channels", list,
                               "sigma_percent", 100 * largest_sigma(r));
    if (json) {
        return cli_json(object);
    }
    json_decref(object);
    if (s->out != NULL) {
        printf("wrote %s: gonio measure --with %s\n", s->out, s->out);
    }
    return 0;
}

int calibrate_reference(int argc, char **argv) {
    settings s = {.bands = "600:80,540:80,460:80", .geometry = "45/0", .shape_sigma_percent = SHAPE_SIGMA_PERCENT};
    const cli_option options[] = {
        {"bands", 0, CLI_TEXT, &s.bands, NULL, "NM:FWHM,...",
         "the camera's one or three channels (600:80,540:80,460:80)"},
        {"geometry", 0, CLI_TEXT, &s.geometry, NULL, "45/0|0/45|8/h", "what the table states (45/0)"},
        {"brdf", 0, CLI_TEXT, &s.brdf, NULL, "MODEL",
         "the standard's own BRDF: its shape corrects each pixel's angles"},
        {"shape-sigma", 0, CLI_DOUBLE, &s.shape_sigma_percent, NULL, "PERCENT",
         "uncertainty of the conversion from 8/h by that shape (0.5)"},
        {"out", 'o', CLI_OUTPUT, &s.out, NULL, "INI", "write the [reference] section, for --with"},
        {0}};
    static const cli_verb verb = {"calibrate reference", "TABLE.csv [--brdf MODEL] [-o INI]",
                                  "white reference from its certificate; TABLE.csv: nm,reflectance,sigma", NULL};
    cli_common common;
    int count;
    if (!cli_parse(&verb, options, argc, argv, &s.table, 1, 1, &count, &common)) {
        return 2;
    }
    result r = {0};
    if (!parse_bands(s.bands, &r)) {
        return cli_usage(&common, "--bands '%s'; expected one or three CENTRE:FWHM in nm, between commas", s.bands);
    }
    const bool hemispherical = strcmp(s.geometry, "8/h") == 0;
    if (!hemispherical && strcmp(s.geometry, "45/0") != 0 && strcmp(s.geometry, "0/45") != 0) {
        return cli_usage(&common, "--geometry '%s'; 45/0, 0/45 and 8/h exist", s.geometry);
    }
    if (hemispherical && s.brdf == NULL) {
        return cli_usage(&common, "--geometry 8/h needs --brdf MODEL, whose shape tells the radiance factor at 45/0");
    }
    if (!(s.shape_sigma_percent >= 0 && s.shape_sigma_percent <= 100)) {
        return cli_usage(&common, "--shape-sigma: expected 0 to 100 %%, found %g", s.shape_sigma_percent);
    }
    gonio_error error = {.line = -1, .byte = -1};
    if (calibrate(&s, &r, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    return report(&s, &r, common.json);
}
