// SPDX-License-Identifier: BSD-3-Clause
// LightTools' BSDF text (docs/formats.md): absolute outgoing angles, f_r in 1/sr, a block for each incidence and
// channel. The light of a plane-symmetrical or isotropic file stands at azimuth 90 deg. Angles of a side or of
// transmission count from the normal of the side that the light comes from or leaves by.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "io/optics/grid.h"

#define LIGHT_DEG 90

static bool recognise(const gonio_source *source) {
    return (gonio_source_begins(source, "#", "Symmetry") || gonio_source_begins(source, "#", "SpectralContent")) &&
           strstr(source->data, "ScatterAzimuth") != NULL && strstr(source->data, "AOI") != NULL;
}

static gonio_status read_header(gonio_words *words, gonio_grid *grid, gonio_error *error) {
    int choice;
    for (char *word; (word = gonio_word(words)) != NULL;) {
        gonio_status status = GONIO_OK;
        if (strcasecmp(word, "Symmetry") == 0) {
            status = gonio_word_choice(words, "Symmetry", "PlaneSymmetrical|Asymmetric", &choice, error);
        } else if (strcasecmp(word, "SpectralContent") == 0) {
            status = gonio_word_choice(words, "SpectralContent", "Monochrome|XYZ", &choice, error);
            grid->xyz = choice == 1;
            status = status == GONIO_OK ? gonio_grid_channels(grid, grid->xyz ? 3 : 1, error) : status;
        } else if (strcasecmp(word, "ScatterAzimuth") == 0) {
            status = gonio_grid_axis_counted(grid, GONIO_GRID_OUT_PHI, words, "ScatterAzimuth", -360, 360, error);
        } else if (strcasecmp(word, "ScatterRadial") == 0) {
            status = gonio_grid_axis_counted(grid, GONIO_GRID_OUT_THETA, words, "ScatterRadial", 0, 180, error);
        } else if (strcasecmp(word, "DataBegin") == 0) {
            return GONIO_OK;
        } else {
            status = gonio_text_fail(&words->text, error, "unknown keyword '%.40s' of a LightTools BSDF", word);
        }
        if (status != GONIO_OK) {
            return status;
        }
    }
    return gonio_text_fail(&words->text, error, "the file ends before DataBegin");
}

// ---- what incidences there are ----

typedef struct block {
    double aoi, poi, tis;
    int side, type, channel; // front, back; BRDF, BTDF; of X, Y, Z
} block;

static gonio_half half_of(const block *b) {
    return (gonio_half)((b->side == 1 ? GONIO_REFLECTION_BACK : 0) | (b->type == 1 ? GONIO_TRANSMISSION : 0));
}

// The lines before a block's values; *end: DataEnd stood there.
static gonio_status read_block_head(gonio_words *words, block *b, bool *end, gonio_error *error) {
    *b = (block){0};
    *end = false;
    double wavelength;
    for (char *word; (word = gonio_word(words)) != NULL;) {
        gonio_status status = GONIO_OK;
        if (strcasecmp(word, "AOI") == 0) {
            status = gonio_word_number(words, "AOI", &b->aoi, error);
        } else if (strcasecmp(word, "POI") == 0) {
            status = gonio_word_number(words, "POI", &b->poi, error);
        } else if (strcasecmp(word, "Side") == 0) {
            status = gonio_word_choice(words, "Side", "Front|Back", &b->side, error);
        } else if (strcasecmp(word, "Wavelength") == 0) {
            status = gonio_word_number(words, "Wavelength", &wavelength, error);
        } else if (strcasecmp(word, "ScatterType") == 0) {
            status = gonio_word_choice(words, "ScatterType", "BRDF|BTDF", &b->type, error);
        } else if (strcasecmp(word, "TristimulusValue") == 0) {
            status = gonio_word_choice(words, "TristimulusValue", "TrisX|TrisY|TrisZ", &b->channel, error);
        } else if (strcasecmp(word, "TIS") == 0) {
            return gonio_word_number(words, "TIS", &b->tis, error);
        } else if (strcasecmp(word, "DataEnd") == 0) {
            *end = true;
            return GONIO_OK;
        } else {
            status = gonio_text_fail(&words->text, error, "unknown keyword '%.40s' of a block", word);
        }
        if (status != GONIO_OK) {
            return status;
        }
    }
    return gonio_text_fail(&words->text, error, "the file ends before DataEnd");
}

// Blocks come in any order, so values are kept by block until all are known.
typedef struct blocks {
    block *items;
    double *values; // of all, one after the other
    size_t n, room, each;
} blocks;

static gonio_status grow(blocks *all, const gonio_words *words, gonio_error *error) {
    if (all->n < all->room) {
        return GONIO_OK;
    }
    const size_t room = all->room > 0 ? 2 * all->room : 16;
    if (room > ((size_t)1 << 27) / (all->each + 1)) {
        return gonio_text_fail(&words->text, error, "too many values");
    }
    block *items = realloc(all->items, room * sizeof *items);
    all->items = items != NULL ? items : all->items;
    double *values = realloc(all->values, room * all->each * sizeof *values);
    all->values = values != NULL ? values : all->values;
    if (items == NULL || values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the values");
    }
    all->room = room;
    return GONIO_OK;
}

static gonio_status read_blocks(gonio_words *words, gonio_grid *grid, blocks *all, gonio_error *error) {
    all->each = (size_t)grid->axis[GONIO_GRID_OUT_PHI].n * (size_t)grid->axis[GONIO_GRID_OUT_THETA].n;
    if (all->each == 0 || grid->channels == 0) {
        return gonio_text_fail(&words->text, error,
                               "DataBegin stands before SpectralContent, ScatterAzimuth or ScatterRadial");
    }
    for (;;) {
        block b;
        bool end;
        gonio_status status = grow(all, words, error);
        status = status == GONIO_OK ? read_block_head(words, &b, &end, error) : status;
        if (status == GONIO_OK && !end && (b.aoi < 0 || b.aoi > 90 || b.poi != 0)) {
            status = gonio_text_fail(&words->text, error,
                                     "AOI %g, POI %g; expected an incidence of 0 to 90 deg in one plane (POI 0)", b.aoi,
                                     b.poi);
        }
        for (size_t k = 0; status == GONIO_OK && !end && k < all->each; k++) {
            status = gonio_grid_value(grid, words, &all->values[all->n * all->each + k], error);
        }
        if (status != GONIO_OK || end) {
            return status;
        }
        all->items[all->n++] = b;
    }
}

// ---- into the grid ----

static int compare(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static gonio_status incidences(gonio_grid *grid, const blocks *all, gonio_error *error) {
    gonio_grid_axis *in = &grid->axis[GONIO_GRID_IN_THETA];
    in->deg = malloc((all->n + 1) * sizeof *in->deg);
    if (in->deg == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu angles", all->n);
    }
    size_t n = 0;
    for (size_t k = 0; k < all->n; k++) {
        if (half_of(&all->items[k]) == grid->half) {
            in->deg[n++] = all->items[k].aoi;
        }
    }
    qsort(in->deg, n, sizeof *in->deg, compare);
    for (size_t k = 0; k < n; k++) {
        if (in->n == 0 || in->deg[k] > in->deg[in->n - 1]) {
            in->deg[in->n++] = in->deg[k];
        }
    }
    return GONIO_OK;
}

static gonio_status place(gonio_grid *grid, const blocks *all, const gonio_words *words, gonio_error *error) {
    for (size_t k = 0; k < all->n; k++) {
        const block *b = &all->items[k];
        int t = 0;
        if (half_of(b) != grid->half) {
            continue;
        }
        while (grid->axis[GONIO_GRID_IN_THETA].deg[t] != b->aoi) {
            t++;
        }
        double *to = gonio_grid_at(grid, grid->xyz ? b->channel : 0, 0, t, 0, 0);
        if (!isnan(*to)) {
            return gonio_text_fail(&words->text, error, "two blocks of AOI %g and one channel", b->aoi);
        }
        memcpy(to, all->values + k * all->each, all->each * sizeof *to);
    }
    return GONIO_OK;
}

static bool has_half(const blocks *all, int half) {
    bool any = false;
    for (size_t k = 0; k < all->n && !any; k++) {
        any = (int)half_of(&all->items[k]) == half;
    }
    return any;
}

// A copy of the header's grid, for the blocks of one half.
static gonio_status read_half(const gonio_grid *head, int half, const blocks *all, const gonio_words *words,
                              const gonio_source *source, gonio_samples **out, gonio_read_report *report,
                              gonio_error *error) {
    gonio_grid grid = *head;
    gonio_status status = GONIO_OK;
    grid.half = (gonio_half)half;
    grid.names = NULL;
    for (int k = 0; k < GONIO_GRID_AXES; k++) {
        grid.axis[k] = (gonio_grid_axis){0};
    }
    for (int k = GONIO_GRID_OUT_PHI; k <= GONIO_GRID_OUT_THETA && status == GONIO_OK; k++) {
        const size_t size = (size_t)head->axis[k].n * sizeof(double);
        grid.axis[k].deg = malloc(size);
        if (grid.axis[k].deg == NULL) {
            status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the angles");
        } else {
            memcpy(grid.axis[k].deg, head->axis[k].deg, size);
            grid.axis[k].n = head->axis[k].n;
        }
    }
    status = status == GONIO_OK ? gonio_grid_channels(&grid, head->channels, error) : status;
    status = status == GONIO_OK ? incidences(&grid, all, error) : status;
    status = status == GONIO_OK ? gonio_grid_allocate(&grid, words, error) : status;
    status = status == GONIO_OK ? place(&grid, all, words, error) : status;
    gonio_read_report own = {0};
    status = gonio_grid_end(&grid, status, source, "lighttools", out, &own, error);
    if (status == GONIO_OK && report != NULL) {
        own.rows += report->rows;
        own.invalid += report->invalid;
        *report = own; // negatives are counted while the blocks are read: each half's copy has them all
    }
    return status;
}

static gonio_status read_lighttools(const gonio_source *source, const gonio_format_values *values, gonio_samples **out,
                                    gonio_read_report *report, gonio_error *error) {
    gonio_words words = gonio_words_begin(source, "#");
    gonio_grid grid = {
        .frame = GONIO_GRID_ABSOLUTE, .light_deg = LIGHT_DEG, .policy = (gonio_negatives)values->at[0].choice};
    blocks all = {0};
    *out = NULL;
    if (report != NULL) {
        *report = (gonio_read_report){0};
    }
    gonio_status status = read_header(&words, &grid, error);
    status = status == GONIO_OK ? read_blocks(&words, &grid, &all, error) : status;
    if (status == GONIO_OK && all.n == 0) {
        status = gonio_text_fail(&words.text, error, "there is no block");
    }
    for (int h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
        if (has_half(&all, h)) {
            status = read_half(&grid, h, &all, &words, source, out, report, error);
        }
    }
    free(all.items);
    free(all.values);
    for (int k = 0; k < GONIO_GRID_AXES; k++) {
        free(grid.axis[k].deg);
    }
    free(grid.names);
    return status;
}

static const gonio_format_option options[] = {GONIO_OPTION_NEGATIVES, {0}};

// ---- writing ----

static void put_lighttools(gonio_grid *g, const gonio_model *rgb, FILE *stream) {
    static const char *const channels[] = {"TrisX", "TrisY", "TrisZ"};
    if (g->first) {
        fprintf(stream, "Symmetry Asymmetric\nSpectralContent %s\n", g->xyz ? "XYZ" : "Monochrome");
        gonio_grid_put_axis(g, GONIO_GRID_OUT_PHI, "ScatterAzimuth", stream);
        gonio_grid_put_axis(g, GONIO_GRID_OUT_THETA, "ScatterRadial", stream);
        fputs("DataBegin\n", stream);
    }
    for (int t = 0; t < g->axis[GONIO_GRID_IN_THETA].n; t++) {
        double albedo[3];
        gonio_grid_albedo(g, rgb, 0, t, albedo);
        for (int c = 0; c < g->channels; c++) {
            fprintf(stream, "AOI %.9g\nPOI 0\nSide %s\nWavelength 0\nScatterType %s\n",
                    g->axis[GONIO_GRID_IN_THETA].deg[t], (g->half & GONIO_REFLECTION_BACK) != 0 ? "Back" : "Front",
                    (g->half & GONIO_TRANSMISSION) != 0 ? "BTDF" : "BRDF");
            if (g->xyz) {
                fprintf(stream, "TristimulusValue %s\n", channels[c]);
            }
            fprintf(stream, "TIS %.9g\n", albedo[c]);
            for (int a = 0; a < g->axis[GONIO_GRID_OUT_PHI].n; a++) {
                for (int r = 0; r < g->axis[GONIO_GRID_OUT_THETA].n; r++) {
                    fprintf(stream, "%s%.9g", r > 0 ? " " : "", gonio_grid_written(g, c, 0, t, a, r));
                }
                fputc('\n', stream);
            }
        }
    }
    if (g->last) {
        fputs("DataEnd\n", stream);
    }
}

static gonio_status write_lighttools(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                     gonio_write_report *told, gonio_error *error) {
    if (!model->isotropic) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "a LightTools table is isotropic; the model is not");
    }
    const gonio_grid g = {.frame = GONIO_GRID_ABSOLUTE, .light_deg = LIGHT_DEG};
    return gonio_grid_write_colours(&g, model, values, false, put_lighttools, stream, told, error);
}

static const gonio_format_option write_options[] = {GONIO_OPTION_GRID_STEP, {0}};

const gonio_format gonio_format_lighttools = {.name = "lighttools",
                                              .summary = "LightTools BSDF text",
                                              .extensions = ".bsdf",
                                              .write_table = write_lighttools,
                                              .write_options = write_options,
                                              .halves = (1u << GONIO_HALVES) - 1,
                                              .quantity = "f_r, 1/sr; TIS is the directional albedo",
                                              .convention = "absolute outgoing angles, the light at azimuth 90 deg",
                                              .theta_max_deg = GONIO_GRID_WRITE_MAX_DEG,
                                              .precision = 1e-6,
                                              .recognise = recognise,
                                              .read = read_lighttools,
                                              .options = options};
