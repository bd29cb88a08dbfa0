// SPDX-License-Identifier: BSD-3-Clause
// SDR, the specular reflectances of Integra's Lumicept and its family (read and written by libbsdf): for each channel
// the part of the light of each incidence that goes into the mirror direction. It holds no distribution and so no f_r
// in 1/sr: --cone DEG states the half angle of the cone about the mirror direction over which that part spreads evenly,
// and a sample then has f_r = reflectance / (pi sin(cone)^2 cos(theta)), the denominator being the cone's projected
// solid angle. Where the cone reaches the horizon it would be another: those incidences are left out and counted. SDT
// has the same form for the way straight through (--transmission).
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/head.h"
#include "base/number.h"
#include "io/optics/integra.h"

enum { NEGATIVES, TRANSMISSION, CONE };

static bool recognise(const gonio_source *source) {
    return gonio_source_begins(source, ";;", "Source") && strstr(source->data, "TypeColorModel") != NULL &&
           strstr(source->data, "TypeData") == NULL && strstr(source->data, "TypeSym") == NULL &&
           strstr(source->data, "kbdf") == NULL;
}

typedef struct sdr {
    gonio_words words;
    gonio_grid grid; // of incidences alone; its values are the reflectances
    bool spectral;
    int done; // channels read
    double cone;
} sdr;

static gonio_status parse_cone(const char *text, double *cone, gonio_error *error) {
    char *end;
    const double deg = gonio_number_parse(text, &end);
    *cone = gonio_radians(deg);
    return end != text && *end == 0 && deg > 0 && deg < 45
               ? GONIO_OK
               : gonio_fail(
                     error, GONIO_E_USAGE,
                     "--cone: an SDR file holds specular reflectances, which are no f_r in 1/sr; expected the half "
                     "angle of the cone that they fill, above 0 and below 45 deg, found '%s'",
                     text);
}

static gonio_status read_entry(sdr *d, const char *word, gonio_error *error) {
    int choice;
    if (strcasecmp(word, "Source") == 0) {
        return gonio_word_choice(&d->words, "Source", "Measured|Generated|Edited|Morphed", &choice, error);
    }
    if (strcasecmp(word, "TypeColorModel") == 0) {
        return gonio_integra_colours(&d->words, &d->grid, &d->spectral, error);
    }
    if (strcasecmp(word, "sigma") == 0) {
        return gonio_grid_axis_counted(&d->grid, GONIO_GRID_IN_THETA, &d->words, "sigma", 0, 90, error);
    }
    return gonio_text_fail(&d->words.text, error, "unknown keyword '%.40s' of an SDR file", word);
}

// f_r of an incidence's reflectance; NaN where the cone meets the horizon.
static double spread(const sdr *d, int in, double reflectance) {
    const double theta = gonio_radians(d->grid.axis[GONIO_GRID_IN_THETA].deg[in]);
    return theta + d->cone < GONIO_PI / 2 ? reflectance / (GONIO_PI * pow(sin(d->cone), 2) * cos(theta)) : (double)NAN;
}

static gonio_status read_channel(sdr *d, gonio_error *error) {
    gonio_grid *grid = &d->grid;
    int choice;
    if (d->done == grid->channels || grid->axis[GONIO_GRID_IN_THETA].n == 0) {
        return gonio_text_fail(&d->words.text, error, "values of channel %d, of %d, and %d incidences", d->done + 1,
                               grid->channels, grid->axis[GONIO_GRID_IN_THETA].n);
    }
    gonio_status status = grid->values == NULL ? gonio_grid_allocate(grid, &d->words, error) : GONIO_OK;
    if (status == GONIO_OK && d->spectral) {
        status = gonio_integra_wavelength(&d->words, grid->names[d->done], error);
    }
    status =
        status == GONIO_OK ? gonio_word_choice(&d->words, "after a channel's name", "def", &choice, error) : status;
    for (int in = 0; status == GONIO_OK && in < grid->axis[GONIO_GRID_IN_THETA].n; in++) {
        double *to = gonio_grid_at(grid, d->done, 0, in, 0, 0);
        status = gonio_grid_value(grid, &d->words, to, error);
        if (status == GONIO_OK && *to > 1) {
            status = gonio_text_fail(&d->words.text, error, "expected a reflectance of 0 to 1, found %g", *to);
        }
        *to = spread(d, in, *to);
    }
    d->done++;
    return status;
}

static gonio_status read_sdr(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                             gonio_read_report *report, gonio_error *error) {
    sdr d = {.words = gonio_words_begin(source, ";;"),
             .grid = {.frame = GONIO_GRID_SPECULAR,
                      .policy = (gonio_negatives)values->at[NEGATIVES].choice,
                      .half = values->at[TRANSMISSION].choice == 1 ? GONIO_TRANSMISSION : GONIO_REFLECTION}};
    gonio_status status = parse_cone(values->at[CONE].text, &d.cone, error);
    for (int axis = GONIO_GRID_OUT_PHI; axis <= GONIO_GRID_OUT_THETA && status == GONIO_OK; axis++) {
        gonio_grid_axis *one = &d.grid.axis[axis]; // the mirror direction alone
        one->deg = calloc(1, sizeof *one->deg);
        one->n = 1;
        status = one->deg != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a direction");
    }
    for (char *word; status == GONIO_OK && (word = gonio_word(&d.words)) != NULL;) {
        status = d.done > 0 && strcasecmp(word, "enddef") == 0 ? GONIO_OK
                 : gonio_integra_is_channel(word)              ? read_channel(&d, error)
                 : d.grid.values == NULL
                     ? read_entry(&d, word, error)
                     : gonio_text_fail(&d.words.text, error, "expected the next channel, found '%.40s'", word);
    }
    if (status == GONIO_OK && (d.done == 0 || d.done < d.grid.channels)) {
        status =
            gonio_text_fail(&d.words.text, error, "the file ends after %d of %d channels", d.done, d.grid.channels);
    }
    status = gonio_grid_end(&d.grid, status, source, "sdr", out, report, error);
    char cone[32];
    gonio_number_format(cone, sizeof cone, "%.10g", gonio_degrees(d.cone));
    return status == GONIO_OK ? gonio_head_add(&(*out)->head, "aperture_half_angle_deg", cone, error) : status;
}

static const gonio_format_option options[] = {
    [NEGATIVES] = GONIO_OPTION_NEGATIVES,
    [TRANSMISSION] = {"transmission", GONIO_FORMAT_FLAG, "no|yes", "no",
                      "the table is of transmission (SDT); nothing in it says so"},
    [CONE] = {"cone", GONIO_FORMAT_TEXT, "DEG", "",
              "half angle of the cone about the mirror direction that the reflectance fills; has to be stated"},
    {0}};

const gonio_format gonio_format_sdr = {.name = "sdr",
                                       .summary = "SDR text",
                                       .extensions = ".sdr",
                                       .recognise = recognise,
                                       .read = read_sdr,
                                       .options = options};
