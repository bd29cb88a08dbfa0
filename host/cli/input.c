#include "host/cli/input.h"

#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <string.h>

#include "gonio/session.h"

// A wavelength is given in nm; nobody measures below 20 nm or beyond 20 um, so a small number is in um.
static double wavelength_nm(double given) { return given < 20 ? 1000 * given : given; }

static gonio_status fill_options(const cli_input *in, const cli_common *common, gonio_read_options *options,
                                 gonio_error *error) {
    gonio_read_options_default(options);
    options->seed = common->seed;
    options->limit = in->limit;
    options->wavelength_um = wavelength_nm(in->wavelength) / 1000;
    if (in->mueller != NULL) {
        options->mueller = in->mueller;
    }
    if (in->negatives == NULL) {
        return GONIO_OK;
    }
    static const char *const names[] = {"reject", "clamp", "keep", "noise"};
    for (int k = 0; k < 4; k++) {
        if (strcmp(in->negatives, names[k]) == 0) {
            options->negatives = (gonio_negatives)k;
            return GONIO_OK;
        }
    }
    return gonio_fail(error, GONIO_E_USAGE, "--negatives: expected noise, reject, clamp or keep, found '%s'",
                      in->negatives);
}

// The one channel that the user wants, if any: replaces *samples.
static gonio_status choose_channel(const char *path, const cli_input *in, gonio_samples **samples, gonio_error *error) {
    char wanted[64];
    if (in->channel != NULL) {
        snprintf(wanted, sizeof wanted, "%s", in->channel);
    } else {
        snprintf(wanted, sizeof wanted, "%.10gnm", wavelength_nm(in->wavelength));
    }
    char list[200] = "";
    for (int c = 0; c < (*samples)->channels; c++) {
        const char *name = (*samples)->channel_names[c];
        if (strcmp(name, wanted) == 0) {
            gonio_samples *one;
            const gonio_status status = gonio_samples_channel(*samples, c, &one, error);
            gonio_samples_free(*samples);
            *samples = status == GONIO_OK ? one : NULL;
            return status;
        }
        const size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, " %s", name);
    }
    gonio_samples_free(*samples);
    *samples = NULL;
    return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "no channel '%s'; there are%s", wanted, list);
}

static void tell(const char *path, const gonio_read_options *options, const gonio_read_report *report) {
    if (report->negatives > 0) {
        fprintf(stderr, "gonio: %s: %zu negative values %s (first at line %lld)\n", path, report->negatives,
                options->negatives == GONIO_NEGATIVES_CLAMP ? "raised to 0"
                : report->noise == report->negatives        ? "within 5 sigma of 0 kept, as noise about zero"
                                                            : "kept",
                report->first_negative_line);
    }
    if (report->invalid > 0) {
        fprintf(stderr, "gonio: %s: %zu of %zu entries are not valid and left out\n", path, report->invalid,
                report->rows);
    }
}

gonio_status cli_input_read(const char *path, const cli_input *in, const cli_common *common, gonio_samples **out,
                            gonio_error *error) {
    *out = NULL;
    gonio_read_options options;
    gonio_status status = fill_options(in, common, &options, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (gonio_session_is(path)) {
        status = gonio_session_read(path, out, error);
    } else {
        gonio_read_report report;
        status = gonio_read(path, &options, out, &report, error);
        if (status == GONIO_OK) {
            tell(path, &options, &report);
        }
    }
    const bool choose = in->channel != NULL || (in->wavelength > 0 && status == GONIO_OK && (*out)->channels > 1);
    return status == GONIO_OK && choose ? choose_channel(path, in, out, error) : status;
}

void cli_use_threads(const cli_common *common) {
    if (common->threads > 0) {
        omp_set_num_threads(common->threads);
    }
}
