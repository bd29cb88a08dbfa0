// SPDX-License-Identifier: BSD-3-Clause
// DDR, the directional distribution of reflectance of Integra's Lumicept and its family: for each channel the scale of
// each incidence (kbdf) and values about the mirror direction (def). Luminance values are pi f_r over kbdf, intensities
// pi f_r cos(theta_o) over kbdf. Transmission (DDT) has the same form, about the way straight through. Relative values,
// which a reader has to scale to a reflectance, are refused.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "io/optics/integra.h"

// SDR, which holds no distribution, has the same head without these.
static bool recognise(const gonio_source *source) {
    return (gonio_source_begins(source, ";;", "Source") || gonio_source_begins(source, ";;", "TypeSym")) &&
           strstr(source->data, "TypeColorModel") != NULL &&
           (strstr(source->data, "TypeData") != NULL || strstr(source->data, "TypeSym") != NULL ||
            strstr(source->data, "kbdf") != NULL);
}

typedef struct ddr {
    gonio_words words;
    gonio_grid grid;
    bool spectral, intensity, has_unit, has_psi;
    int done; // channels read
} ddr;

static gonio_status read_unit(ddr *d, gonio_error *error) {
    int choice;
    gonio_status status = gonio_word_choice(&d->words, "TypeData", "Luminance|Intensity", &choice, error);
    d->intensity = choice == 1;
    d->has_unit = true;
    return status == GONIO_OK
               ? gonio_word_choice(&d->words, "TypeData (relative values have no scale)", "Absolute", &choice, error)
               : status;
}

static gonio_status read_symmetry(ddr *d, gonio_error *error) {
    int choice;
    return gonio_word_choice(&d->words, "TypeSym", "AxiSymmetrical|DirSymmetrical|PlaneSymmetrical|ASymmetrical",
                             &choice, error);
}

static gonio_status read_entry(ddr *d, const char *word, gonio_error *error) {
    gonio_grid *grid = &d->grid;
    int choice;
    if (strcasecmp(word, "Source") == 0) {
        return gonio_word_choice(&d->words, "Source", "Measured|Generated|Edited|Morphed", &choice, error);
    }
    if (strcasecmp(word, "TypeSym") == 0) {
        return read_symmetry(d, error);
    }
    if (strcasecmp(word, "4D") == 0) {
        return GONIO_OK; // of ASymmetrical 4D
    }
    if (strcasecmp(word, "TypeColorModel") == 0) {
        return gonio_integra_colours(&d->words, grid, &d->spectral, error);
    }
    if (strcasecmp(word, "TypeData") == 0) {
        return read_unit(d, error);
    }
    if (strcasecmp(word, "psi") == 0) {
        return gonio_grid_axis_counted(grid, GONIO_GRID_IN_PHI, &d->words, "psi", 0, 360, error);
    }
    if (strcasecmp(word, "sigma") == 0) {
        return gonio_grid_axis_counted(grid, GONIO_GRID_IN_THETA, &d->words, "sigma", 0, 90, error);
    }
    if (strcasecmp(word, "phi") == 0) {
        return gonio_grid_axis_counted(grid, GONIO_GRID_OUT_PHI, &d->words, "phi", 0, 360, error);
    }
    if (strcasecmp(word, "theta") == 0) {
        return gonio_grid_axis_counted(grid, GONIO_GRID_OUT_THETA, &d->words, "theta", 0, 180, error);
    }
    return gonio_text_fail(&d->words.text, error, "unknown keyword '%.40s' of a DDR file", word);
}

// ---- one channel ----

static gonio_status read_scales(ddr *d, double *scales, gonio_error *error) {
    const size_t n = (size_t)d->grid.axis[GONIO_GRID_IN_PHI].n * (size_t)d->grid.axis[GONIO_GRID_IN_THETA].n;
    int choice;
    gonio_status status = gonio_word_choice(&d->words, "after a channel's name", "kbdf", &choice, error);
    for (size_t k = 0; status == GONIO_OK && k < n; k++) {
        status = gonio_word_number(&d->words, "kbdf", &scales[k], error);
        if (status == GONIO_OK && !(scales[k] >= 0)) {
            status = gonio_text_fail(&d->words.text, error, "kbdf: expected 0 or more, found %g", scales[k]);
        }
    }
    return status == GONIO_OK ? gonio_word_choice(&d->words, "after kbdf", "def", &choice, error) : status;
}

static gonio_status read_values(ddr *d, const double *scales, gonio_error *error) {
    gonio_grid *grid = &d->grid;
    const gonio_grid_axis *a = grid->axis;
    gonio_status status = GONIO_OK;
    int at[GONIO_GRID_AXES] = {0};
    while (status == GONIO_OK && at[0] < a[0].n) {
        double *to = gonio_grid_at(grid, d->done, at[0], at[1], at[2], at[3]);
        status = gonio_grid_value(grid, &d->words, to, error);
        *to *= scales[at[0] * a[1].n + at[1]] / GONIO_PI;
        gonio_pair pair;
        if (d->intensity && gonio_grid_pair(grid, at, &pair)) {
            *to /= fmax(cos(pair.theta_o), 1e-4);
        }
        int k = GONIO_GRID_AXES - 1;
        while (++at[k] == a[k].n && k > 0) {
            at[k--] = 0;
        }
    }
    return status;
}

static gonio_status read_channel(ddr *d, gonio_error *error) {
    if (d->done == d->grid.channels || !d->has_unit) {
        return gonio_text_fail(&d->words.text, error,
                               d->has_unit ? "more channels than the %d that TypeColorModel states"
                                           : "values before TypeData, with %d channels",
                               d->grid.channels);
    }
    gonio_status status = d->grid.values == NULL ? gonio_grid_allocate(&d->grid, &d->words, error) : GONIO_OK;
    if (status != GONIO_OK) {
        return status;
    }
    double *scales = malloc((size_t)d->grid.axis[0].n * (size_t)d->grid.axis[1].n * sizeof *scales);
    if (scales == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the scales");
    }
    status = d->spectral ? gonio_integra_wavelength(&d->words, d->grid.names[d->done], error) : GONIO_OK;
    status = status == GONIO_OK ? read_scales(d, scales, error) : status;
    status = status == GONIO_OK ? read_values(d, scales, error) : status;
    free(scales);
    d->done++;
    return status;
}

static gonio_status read_ddr(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                             gonio_read_report *report, gonio_error *error) {
    ddr d = {.words = gonio_words_begin(source, ";;"),
             .grid = {.frame = GONIO_GRID_SPECULAR,
                      .policy = (gonio_negatives)values->at[0].choice,
                      .half = values->at[1].choice == 1 ? GONIO_TRANSMISSION : GONIO_REFLECTION}};
    gonio_status status = GONIO_OK;
    for (char *word; status == GONIO_OK && (word = gonio_word(&d.words)) != NULL;) {
        const bool end = d.done > 0 && strcasecmp(word, "enddef") == 0; // of a channel's values
        status = end                              ? GONIO_OK
                 : gonio_integra_is_channel(word) ? read_channel(&d, error)
                 : d.grid.values == NULL          ? read_entry(&d, word, error)
                                                  : gonio_text_fail(&d.words.text, error,
                                                                    "expected the next channel, found "
                                                                             "'%.40s'",
                                                                    word);
    }
    if (status == GONIO_OK && (d.done == 0 || d.done < d.grid.channels)) {
        status =
            gonio_text_fail(&d.words.text, error, "the file ends after %d of %d channels", d.done, d.grid.channels);
    }
    return gonio_grid_end(&d.grid, status, source, "ddr", out, report, error);
}

static const gonio_format_option options[] = {
    GONIO_OPTION_NEGATIVES,
    {"transmission", GONIO_FORMAT_FLAG, "no|yes", "no", "the table is of transmission (DDT); nothing in it says so"},
    {0}};

const gonio_format gonio_format_ddr = {.name = "ddr",
                                       .summary = "DDR text",
                                       .extensions = ".ddr",
                                       .recognise = recognise,
                                       .read = read_ddr,
                                       .options = options};
