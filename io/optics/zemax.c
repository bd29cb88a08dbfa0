// SPDX-License-Identifier: BSD-3-Clause
// Zemax' BSDF Data Interchange format (R. Rykowski, "BSDF Data Interchange file format specification", 2008): outgoing
// directions about the mirror direction, f_r in 1/sr, for each sample rotation and incidence a block of an azimuth a
// line. The stated total integrated scatter of a block is not applied.
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
            status = gonio_word_choice(words, "ScatterType (transmission is not read)", "BRDF", &choice, error);
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

// TIS t, then a value for each azimuth and radial angle.
static gonio_status read_block(gonio_words *words, gonio_grid *grid, int channel, int rotation, int incidence,
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
    return status;
}

static gonio_status read_channel(gonio_words *words, gonio_grid *grid, int channel, gonio_error *error) {
    int choice;
    if (channel < 0 || channel >= grid->channels) {
        return gonio_text_fail(&words->text, error,
                               "expected Monochrome, TristimulusX, TristimulusY or TristimulusZ as SpectralContent "
                               "has it");
    }
    gonio_status status = gonio_word_choice(words, "after a channel's name", "DataBegin", &choice, error);
    for (int p = 0; p < grid->axis[GONIO_GRID_IN_PHI].n; p++) {
        for (int t = 0; status == GONIO_OK && t < grid->axis[GONIO_GRID_IN_THETA].n; t++) {
            status = read_block(words, grid, channel, p, t, error);
        }
    }
    return status == GONIO_OK ? gonio_word_choice(words, "after the values", "DataEnd", &choice, error) : status;
}

static gonio_status read_channels(gonio_words *words, gonio_grid *grid, int channel, gonio_error *error) {
    gonio_status status = grid->channels > 0 ? gonio_grid_allocate(grid, words, error)
                                             : gonio_text_fail(&words->text, error, "there is no SpectralContent");
    status = status == GONIO_OK ? read_channel(words, grid, channel, error) : status;
    for (int k = 1; status == GONIO_OK && k < grid->channels; k++) {
        status =
            gonio_word_choice(words, "the next channel", "TristimulusX|TristimulusY|TristimulusZ", &channel, error);
        status = status == GONIO_OK ? read_channel(words, grid, channel, error) : status;
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
    status = status == GONIO_OK ? read_channels(&words, &grid, channel, error) : status;
    return gonio_grid_end(&grid, status, source, "zemax", out, report, error);
}

static const gonio_format_option options[] = {GONIO_OPTION_NEGATIVES, {0}};

const gonio_format gonio_format_zemax = {.name = "zemax",
                                         .summary = "Zemax BSDF text",
                                         .extensions = ".bsdf",
                                         .recognise = recognise,
                                         .read = read_zemax,
                                         .options = options};
