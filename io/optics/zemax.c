// SPDX-License-Identifier: BSD-3-Clause
// Zemax' BSDF Data Interchange format (R. Rykowski, "BSDF Data Interchange file format specification", 2008): outgoing
// directions about the mirror direction, f_r in 1/sr, for each sample rotation and incidence a block of an azimuth a
// line. The block's stated total integrated scatter (TIS) has to agree with what its values integrate to, unless an
// option says which of the two counts.
#include <math.h>
#include <string.h>
#include <strings.h>

#include "io/optics/grid.h"

static bool recognise(const gonio_source *source) {
    return gonio_source_begins(source, "#", "Source") && strstr(source->data, "ScatterRadial") != NULL &&
           strstr(source->data, "AngleOfIncidence") != NULL;
}

// The header's lines, each once, up to the first channel's name, which *channel takes.
static gonio_status read_header(gonio_words *words, gonio_grid *grid, int *channel, gonio_error *error) {
    int choice;
    for (char *word; (word = gonio_word(words)) != NULL;) {
        gonio_status status = GONIO_OK;
        if (strcasecmp(word, "Source") == 0) {
            status = gonio_word_choice(words, "Source", "Measured|Generated|Edited", &choice, error);
        } else if (strcasecmp(word, "Symmetry") == 0) {
            status =
                gonio_word_choice(words, "Symmetry", "PlaneSymmetrical|Asymmetrical|Asymmetrical4D", &choice, error);
        } else if (strcasecmp(word, "SpectralContent") == 0) {
            status = gonio_word_choice(words, "SpectralContent", "Monochrome|XYZ", &choice, error);
            grid->xyz = choice == 1;
            status = status == GONIO_OK ? gonio_grid_channels(grid, grid->xyz ? 3 : 1, error) : status;
        } else if (strcasecmp(word, "ScatterType") == 0) {
            status = gonio_word_choice(words, "ScatterType", "BRDF|BTDF", &choice, error);
            grid->half = choice == 1 ? GONIO_TRANSMISSION : GONIO_REFLECTION;
        } else if (strcasecmp(word, "SampleRotation") == 0) {
            status = gonio_grid_axis_counted(grid, GONIO_GRID_IN_PHI, words, "SampleRotation", -360, 360, error);
        } else if (strcasecmp(word, "AngleOfIncidence") == 0) {
            status = gonio_grid_axis_counted(grid, GONIO_GRID_IN_THETA, words, "AngleOfIncidence", 0, 90, error);
        } else if (strcasecmp(word, "ScatterAzimuth") == 0) {
            status = gonio_grid_axis_counted(grid, GONIO_GRID_OUT_PHI, words, "ScatterAzimuth", -360, 360, error);
        } else if (strcasecmp(word, "ScatterRadial") == 0) {
            status = gonio_grid_axis_counted(grid, GONIO_GRID_OUT_THETA, words, "ScatterRadial", 0, 180, error);
        } else if (strcasecmp(word, "Monochrome") == 0 || strncasecmp(word, "Tristimulus", 11) == 0) {
            *channel = word[0] == 'M' || word[0] == 'm' ? 0 : (word[11] | 32) - 'x';
            return GONIO_OK;
        } else {
            status = gonio_text_fail(&words->text, error, "unknown keyword '%.40s' of a Zemax BSDF", word);
        }
        if (status != GONIO_OK) {
            return status;
        }
    }
    return gonio_text_fail(&words->text, error, "the file ends inside its header");
}

enum { TIS_CHECK, TIS_VALUES, TIS_SCALE };
#define TIS_AGREES 0.3 // tables are coarse and need not reach the horizon

// The integral of f_r cos(theta_o) over the hemisphere, by the values' means over cells; azimuths up to 180 deg stand
// for both halves.
static double integral(const gonio_grid *grid, const double *v, double theta_i) {
    const gonio_grid_axis *azimuth = &grid->axis[GONIO_GRID_OUT_PHI], *radial = &grid->axis[GONIO_GRID_OUT_THETA];
    double sum = 0;
    for (int a = 0; a + 1 < azimuth->n; a++) {
        const double width = gonio_radians(azimuth->deg[a + 1] - azimuth->deg[a]);
        const double middle = gonio_radians(azimuth->deg[a] + azimuth->deg[a + 1]) / 2;
        for (int r = 0; r + 1 < radial->n; r++) {
            const double low = gonio_radians(radial->deg[r]), high = gonio_radians(radial->deg[r + 1]);
            const double *at = v + (size_t)a * (size_t)radial->n + (size_t)r;
            const double mean = (at[0] + at[1] + at[radial->n] + at[radial->n + 1]) / 4;
            const double up = sin(theta_i) * sin((low + high) / 2) * cos(middle) + cos(theta_i) * cos((low + high) / 2);
            sum += mean * fmax(up, 0) * (cos(low) - cos(high)) * width;
        }
    }
    const double span = azimuth->deg[azimuth->n - 1] - azimuth->deg[0];
    return span > 0 ? sum * 360 / span : 0;
}

static gonio_status apply_tis(gonio_words *words, gonio_grid *grid, double *v, double theta_i, double tis, int rule,
                              gonio_error *error) {
    const double whole = tis > 0 && rule != TIS_VALUES ? integral(grid, v, theta_i) : 0;
    if (!(whole > 0)) {
        return GONIO_OK; // nothing stated, or a table of one line
    }
    if (rule == TIS_CHECK && !(fabs(whole / tis - 1) <= TIS_AGREES)) {
        return gonio_text_fail(&words->text, error,
                               "the block states TIS %g and its values integrate to %.4g; --tis scale takes the first, "
                               "--tis values the second",
                               tis, whole);
    }
    const size_t n = (size_t)grid->axis[GONIO_GRID_OUT_PHI].n * (size_t)grid->axis[GONIO_GRID_OUT_THETA].n;
    for (size_t k = 0; rule == TIS_SCALE && k < n; k++) {
        v[k] *= tis / whole;
    }
    return GONIO_OK;
}

// TIS t, then a value for each azimuth and radial angle.
static gonio_status read_block(gonio_words *words, gonio_grid *grid, int channel, int rotation, int incidence, int rule,
                               gonio_error *error) {
    int choice;
    double tis;
    gonio_status status = gonio_word_choice(words, "a block", "TIS", &choice, error);
    status = status == GONIO_OK ? gonio_word_number(words, "TIS", &tis, error) : status;
    for (int a = 0; a < grid->axis[GONIO_GRID_OUT_PHI].n; a++) {
        for (int r = 0; status == GONIO_OK && r < grid->axis[GONIO_GRID_OUT_THETA].n; r++) {
            status = gonio_grid_value(grid, words, gonio_grid_at(grid, channel, rotation, incidence, a, r), error);
        }
    }
    const double theta_i = gonio_radians(grid->axis[GONIO_GRID_IN_THETA].deg[incidence]);
    return status == GONIO_OK ? apply_tis(words, grid, gonio_grid_at(grid, channel, rotation, incidence, 0, 0), theta_i,
                                          tis, rule, error)
                              : status;
}

static gonio_status read_channel(gonio_words *words, gonio_grid *grid, int channel, int rule, gonio_error *error) {
    int choice;
    if (channel < 0 || channel >= grid->channels) {
        return gonio_text_fail(&words->text, error,
                               "expected Monochrome, TristimulusX, TristimulusY or TristimulusZ as SpectralContent "
                               "has it");
    }
    gonio_status status = gonio_word_choice(words, "after a channel's name", "DataBegin", &choice, error);
    for (int p = 0; p < grid->axis[GONIO_GRID_IN_PHI].n; p++) {
        for (int t = 0; status == GONIO_OK && t < grid->axis[GONIO_GRID_IN_THETA].n; t++) {
            status = read_block(words, grid, channel, p, t, rule, error);
        }
    }
    return status == GONIO_OK ? gonio_word_choice(words, "after the values", "DataEnd", &choice, error) : status;
}

static gonio_status read_channels(gonio_words *words, gonio_grid *grid, int channel, int rule, gonio_error *error) {
    gonio_status status = grid->channels > 0 ? gonio_grid_allocate(grid, words, error)
                                             : gonio_text_fail(&words->text, error, "there is no SpectralContent");
    status = status == GONIO_OK ? read_channel(words, grid, channel, rule, error) : status;
    for (int k = 1; status == GONIO_OK && k < grid->channels; k++) {
        status =
            gonio_word_choice(words, "the next channel", "TristimulusX|TristimulusY|TristimulusZ", &channel, error);
        status = status == GONIO_OK ? read_channel(words, grid, channel, rule, error) : status;
    }
    const char *more = status == GONIO_OK ? gonio_word(words) : NULL;
    return more == NULL ? status : gonio_text_fail(&words->text, error, "expected the end, found '%.40s'", more);
}

static gonio_status read_zemax(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                               gonio_read_report *report, gonio_error *error) {
    gonio_words words = gonio_words_begin(source, "#");
    gonio_grid grid = {.frame = GONIO_GRID_SPECULAR, .policy = (gonio_negatives)values->at[0].choice};
    int channel = -1;
    gonio_status status = read_header(&words, &grid, &channel, error);
    status = status == GONIO_OK ? read_channels(&words, &grid, channel, values->at[1].choice, error) : status;
    return gonio_grid_end(&grid, status, source, "zemax", out, report, error);
}

static const gonio_format_option options[] = {
    GONIO_OPTION_NEGATIVES,
    {"tis", GONIO_FORMAT_CHOICE, "check|values|scale", "check",
     "a block's TIS and values that disagree: refused, values as they are, or scaled to TIS"},
    {0}};

// ---- writing ----

// Zemax rescales every block to its TIS, so that is the albedo itself.
static void put_block(gonio_grid *g, const gonio_model *rgb, int channel, int rotation, int incidence, FILE *stream) {
    double albedo[3];
    gonio_grid_albedo(g, rgb, rotation, incidence, albedo);
    fprintf(stream, "TIS %.9g\n", albedo[channel]);
    for (int a = 0; a < g->axis[GONIO_GRID_OUT_PHI].n; a++) {
        for (int r = 0; r < g->axis[GONIO_GRID_OUT_THETA].n; r++) {
            fprintf(stream, "%s%.9g", r > 0 ? " " : "", gonio_grid_written(g, channel, rotation, incidence, a, r));
        }
        fputc('\n', stream);
    }
}

static void put_zemax(gonio_grid *g, const gonio_model *rgb, FILE *stream) {
    static const char *const channels[] = {"TristimulusX", "TristimulusY", "TristimulusZ"};
    fprintf(stream, "Source  Measured\nSymmetry  %s\nSpectralContent  %s\nScatterType  %s\n",
            rgb->isotropic ? "Asymmetrical" : "ASymmetrical4D", g->xyz ? "XYZ" : "Monochrome",
            g->half == GONIO_TRANSMISSION ? "BTDF" : "BRDF");
    gonio_grid_put_axis(g, GONIO_GRID_IN_PHI, "SampleRotation", stream);
    gonio_grid_put_axis(g, GONIO_GRID_IN_THETA, "AngleOfIncidence", stream);
    gonio_grid_put_axis(g, GONIO_GRID_OUT_PHI, "ScatterAzimuth", stream);
    gonio_grid_put_axis(g, GONIO_GRID_OUT_THETA, "ScatterRadial", stream);
    for (int c = 0; c < g->channels; c++) {
        fprintf(stream, "\n%s\nDataBegin\n", g->xyz ? channels[c] : "Monochrome");
        for (int p = 0; p < g->axis[GONIO_GRID_IN_PHI].n; p++) {
            for (int t = 0; t < g->axis[GONIO_GRID_IN_THETA].n; t++) {
                put_block(g, rgb, c, p, t, stream);
            }
        }
        fputs("DataEnd\n", stream);
    }
}

static gonio_status write_zemax(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                gonio_write_report *told, gonio_error *error) {
    const gonio_grid g = {.frame = GONIO_GRID_SPECULAR};
    return gonio_grid_write_colours(&g, model, values, true, put_zemax, stream, told, error);
}

static const gonio_format_option write_options[] = {GONIO_OPTION_GRID_STEP, {0}};

const gonio_format gonio_format_zemax = {
    .name = "zemax",
    .summary = "Zemax BSDF text",
    .extensions = ".bsdf",
    .write_table = write_zemax,
    .write_options = write_options,
    .halves = 1u << GONIO_REFLECTION | 1u << GONIO_TRANSMISSION,
    .one_half = true,
    .quantity = "f_r, 1/sr; TIS is the directional albedo",
    .convention = "polar angle and azimuth about the mirror direction, azimuth 0 towards the normal",
    .theta_max_deg = GONIO_GRID_WRITE_MAX_DEG,
    .precision = 1e-6,
    .recognise = recognise,
    .read = read_zemax,
    .options = options};
