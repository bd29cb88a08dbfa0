// SPDX-License-Identifier: BSD-3-Clause
// Writing a model as XML of Radiance and WINDOW: a tensor tree (io/radiance/adaptive.c), or a
// Klems matrix of averages over two patches.
//
// A three-dimensional tree in colour has a trap. Where its smallest value exceeds 0.01 / pi, Radiance takes that part
// out as a diffuser and then loses the colour of all the rest. So the smallest value of each of r, g, b stays out of
// the tree and stands in the scene's line, as the numbers that the BSDF primitive has for it; a comment tells our
// reader.
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread_pool.h"
#include "io/radiance/radiance.h"

#define MAX_BYTES 30000000
#define BYTES_A_VALUE 9 // of text, about
#define DARK 1e-4       // of the largest value: errors are relative to no less
#define AIM 0.93           // of the bytes that are there, and what is as good
#define FULL 0.82
#define ROUNDS 12
#define TOLERANCE_FIRST 0.01
#define TOLERANCE_LEAST 1e-7
#define FLOOR_LEAST 0.01   // times 1/pi: what Radiance takes out
#define FINE 5             // points a way of the average over a patch
#define WHITE_U (4.0 / 19) // of equal energy
#define WHITE_V (9.0 / 19)

enum { BASIS_AUTO, BASIS_TREE3, BASIS_TREE4, BASIS_FULL, BASIS_HALF, BASIS_QUARTER };

const gonio_format_option gonio_radiance_write_options[] = {
    {"radiance-basis", GONIO_FORMAT_CHOICE, "auto|tree3|tree4|klems-full|klems-half|klems-quarter", "auto",
     "a tensor tree or a Klems matrix (auto: tree3 of isotropic models, tree4 of others)"},
    {0}};

static const char *const klems_names[] = {"LBNL/Klems Full", "LBNL/Klems Half", "LBNL/Klems Quarter"};

// What is written: `parts` tables of n numbers, Y alone or Y and its colour.
typedef struct tables {
    const gonio_model *model; // of 1 channel, Y, or of r, g, b
    int parts, dimensions;
    const gonio_radiance_model *own; // a model that was read, whose tables are written as they are; NULL: none
    size_t n;
    double *values[3];
    char *text[3]; // of a tree, each part's
    size_t length[3];
    double floor[3]; // r, g, b
    gonio_half half;
} tables;

// What a file holds: the halves one after the other, all of one structure.
typedef struct sheet {
    tables half[GONIO_HALVES];
    int n;
} sheet;

// ---- trees ----

// What a walk over a tree's cells finds or uses.
typedef struct seen {
    tables *t;
    double least[3], most; // of each channel; of their sum
} seen;

static void look_at(void *context, float values[3]) {
    seen *s = context;
    double sum = 0;
    for (int c = 0; c < s->t->parts; c++) {
        s->least[c] = fmin(s->least[c], (double)values[c]);
        sum += (double)values[c];
    }
    s->most = fmax(s->most, sum);
}

// The smallest value of each of r, g, b where Radiance would take it out; else zeros.
static void find_floor(tables *t, const double least[3]) {
    double xyz[3];
    gonio_radiance_rgb_to_xyz(least, xyz);
    if (t->parts == 3 && t->dimensions == 3 && xyz[1] > FLOOR_LEAST / GONIO_PI) {
        memcpy(t->floor, least, sizeof t->floor);
    }
}

// A scene has one diffuse transmission for both ways through.
static void level_floors(sheet *s) {
    for (int a = 0; a < s->n; a++) {
        for (int b = 0; b < s->n; b++) {
            for (int c = 0; c < 3 && a != b && (s->half[a].half & s->half[b].half & GONIO_TRANSMISSION) != 0; c++) {
                s->half[a].floor[c] = fmin(s->half[a].floor[c], s->half[b].floor[c]);
            }
        }
    }
}

// Take the floor out and turn colours to Y, u', v'.
static void finish_cell(void *context, float values[3]) {
    const tables *t = context;
    double xyz[3], rgb[3];
    for (int c = 0; c < 3; c++) {
        rgb[c] = fmax((double)values[c] - t->floor[c], 0);
    }
    gonio_radiance_rgb_to_xyz(rgb, xyz);
    const double sum = xyz[0] + 15 * xyz[1] + 3 * xyz[2];
    values[0] = (float)xyz[1];
    values[1] = (float)(xyz[1] > 1e-9 ? 4 * xyz[0] / sum : WHITE_U);
    values[2] = (float)(xyz[1] > 1e-9 ? 9 * xyz[1] / sum : WHITE_V);
}

// A tree that was read, as it is.
static void emit_tree(const gonio_tensor_tree *t, int node, FILE *stream) {
    if (node >= 0) {
        fputs("{\n", stream);
        for (int child = 0; child < 1 << t->dimensions; child++) {
            emit_tree(t, t->nodes[node + child], stream);
        }
        fputs("}\n", stream);
        return;
    }
    const int *leaf = t->nodes + (-1 - node);
    for (size_t k = 0; k < (size_t)1 << (leaf[1] * t->dimensions); k++) {
        fprintf(stream, k == 0 ? "{%.6g" : " %.6g", t->values[(size_t)leaf[0] + k]);
    }
    fputs("}\n", stream);
}

// ---- Klems matrices ----

typedef struct matrix_job {
    tables *t;
    const gonio_klems_basis *basis;
} matrix_job;

// Point k of FINE x FINE in a patch, uniform in projected solid angle.
static gonio_vec3 point_in(const gonio_klems_basis *basis, int patch, int k, double turn) {
    int r = 0;
    while (r + 1 < basis->rings && patch >= basis->first[r + 1]) {
        r++;
    }
    const double low = sin(basis->bound[r]), high = sin(basis->bound[r + 1]);
    const double part = (k / FINE + 0.5) / FINE; // NOLINT(bugprone-integer-division)
    const double phi = 2 * GONIO_PI * (patch - basis->first[r] + (k % FINE + 0.5) / FINE - 0.5) / basis->n[r];
    return gonio_direction(asin(sqrt(low * low + part * (high * high - low * low))), phi + turn);
}

// The outgoing patches of one incident patch, which stands for light from the opposite azimuth.
static void fill_column(void *context, size_t in) {
    const matrix_job *j = context;
    const int patches = j->basis->patches, points = FINE * FINE;
    for (int out = 0; out < patches; out++) {
        double sum[3] = {0}, value[3], xyz[3];
        for (int k = 0; k < points * points; k++) {
            gonio_model_eval(j->t->model, point_in(j->basis, (int)in, k / points, GONIO_PI),
                             point_in(j->basis, out, k % points, 0), value);
            for (int c = 0; c < j->t->parts; c++) {
                sum[c] += fmax(value[c], 0) / (points * points);
            }
        }
        const size_t at = (size_t)out * (size_t)patches + in;
        if (j->t->parts == 1) {
            j->t->values[0][at] = sum[0];
            continue;
        }
        gonio_radiance_rgb_to_xyz(sum, xyz);
        j->t->values[0][at] = xyz[1];
        j->t->values[1][at] = xyz[0];
        j->t->values[2][at] = xyz[2];
    }
}

// ---- the file ----

static const char head[] = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                           "<WindowElement xmlns=\"http://windows.lbl.gov\">\n"
                           "<WindowElementType>System</WindowElementType>\n<FileType>BSDF</FileType>\n";
static const char material[] =
    "<Optical>\n<Layer>\n<Material>\n<Name>Gonio</Name>\n<Manufacturer>Gonio</Manufacturer>\n"
    "<DeviceType>Other</DeviceType>\n</Material>\n<DataDefinition>\n";

static void put_klems_basis(FILE *stream, const char *name, const gonio_klems_basis *basis) {
    fprintf(stream,
            "<IncidentDataStructure>Columns</IncidentDataStructure>\n<AngleBasis>\n<AngleBasisName>%s"
            "</AngleBasisName>\n",
            name);
    for (int r = 0; r < basis->rings; r++) {
        const double low = gonio_degrees(basis->bound[r]), high = gonio_degrees(basis->bound[r + 1]);
        fprintf(stream,
                "<AngleBasisBlock>\n<Theta>%g</Theta>\n<nPhis>%d</nPhis>\n<ThetaBounds>\n<LowerTheta>%g</LowerTheta>\n"
                "<UpperTheta>%g</UpperTheta>\n</ThetaBounds>\n</AngleBasisBlock>\n",
                r == 0 ? 0 : (low + high) / 2, basis->n[r], low, high);
    }
    fputs("</AngleBasis>\n</DataDefinition>\n", stream);
}

static void put_table(FILE *stream, const tables *t, int part, const char *quantity, const char *klems) {
    fprintf(stream,
            "<WavelengthData>\n<LayerNumber>System</LayerNumber>\n<Wavelength unit=\"Integral\">%s</Wavelength>\n"
            "<WavelengthDataBlock>\n<WavelengthDataDirection>%s</WavelengthDataDirection>\n",
            quantity, gonio_radiance_direction(t->half));
    if (klems != NULL) {
        fprintf(stream, "<ColumnAngleBasis>%s</ColumnAngleBasis>\n<RowAngleBasis>%s</RowAngleBasis>\n", klems, klems);
    } else {
        fputs("<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>\n", stream);
    }
    fputs("<ScatteringDataType>BTDF</ScatteringDataType>\n<ScatteringData>\n", stream);
    if (klems != NULL) {
        for (size_t k = 0; k < t->n; k++) {
            fprintf(stream, k % 8 == 7 ? "%.7g\n" : "%.7g ", t->values[part][k]);
        }
    } else if (t->own != NULL) {
        emit_tree(&t->own->tree[part], t->own->tree[part].nodes[0], stream);
    } else {
        fwrite(t->text[part], 1, t->length[part], stream);
    }
    fputs("</ScatteringData>\n</WavelengthDataBlock>\n</WavelengthData>\n", stream);
}

static void put_floor(FILE *stream, const tables *t) {
    if (t->floor[0] + t->floor[1] + t->floor[2] > 0) {
        fprintf(stream, "<!-- " GONIO_RADIANCE_FLOOR "%s%s %.9g %.9g %.9g -->\n",
                t->half != GONIO_REFLECTION ? " " : "",
                t->half != GONIO_REFLECTION ? gonio_radiance_direction(t->half) : "", t->floor[0], t->floor[1],
                t->floor[2]);
    }
}

static void put_file(FILE *stream, const sheet *s, const char *klems, const gonio_klems_basis *basis) {
    fputs(head, stream);
    for (int h = 0; h < s->n; h++) {
        put_floor(stream, &s->half[h]);
    }
    fputs(material, stream);
    if (klems != NULL) {
        put_klems_basis(stream, klems, basis);
    } else {
        fprintf(stream, "<IncidentDataStructure>TensorTree%d</IncidentDataStructure>\n</DataDefinition>\n",
                s->half[0].dimensions);
    }
    static const char *const colours[2][3] = {{"Visible", "CIE-u", "CIE-v"}, {"Visible", "CIE-X", "CIE-Z"}};
    for (int h = 0; h < s->n; h++) {
        for (int part = 0; part < s->half[h].parts; part++) {
            put_table(stream, &s->half[h], part, colours[klems != NULL][part], klems);
        }
    }
    fputs("</Layer>\n</Optical>\n</WindowElement>", stream); // no line end: a file that is cut anywhere shows it
}

static gonio_status allocate(tables *t, gonio_error *error) {
    for (int c = 0; c < t->parts; c++) {
        t->values[c] = malloc(t->n * sizeof *t->values[c]);
        if (t->values[c] == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a table of %zu values", t->n);
        }
    }
    return GONIO_OK;
}

static const tables *table_of(const sheet *s, unsigned halves) {
    for (int h = 0; h < s->n; h++) {
        if (halves >> s->half[h].half & 1) {
            return &s->half[h];
        }
    }
    return NULL;
}

// The arguments of the scene's BSDF primitive: diffuse parts of the front, the back and through.
static void tell_scene(const sheet *s, gonio_write_report *told) {
    static const unsigned order[3] = {1u << GONIO_REFLECTION, 1u << GONIO_REFLECTION_BACK,
                                      1u << GONIO_TRANSMISSION | 1u << GONIO_TRANSMISSION_BACK};
    const int groups = table_of(s, order[2]) != NULL ? 3 : table_of(s, order[1]) != NULL ? 2 : 1;
    char text[200] = "";
    for (int k = 0; k < groups; k++) {
        const tables *t = table_of(s, order[k]);
        for (int c = 0; c < 3; c++) {
            gonio_text_append(text, sizeof text, " %.6g", t != NULL ? GONIO_PI * t->floor[c] : 0.0);
        }
    }
    snprintf(told->about, sizeof told->about, "adaptive TensorTree%d; scene: void BSDF m 6 0 FILE.xml 0 1 0 . 0 %d%s",
             s->half[0].dimensions, 3 * groups, text);
}

// What a tree is built with, and where the search for a tolerance is.
typedef struct building {
    sheet *s;
    int threads;
    size_t budget, bytes; // of text
    gonio_adaptive_options options;
} building;

static void forget_texts(tables *t) {
    for (int c = 0; c < 3; c++) {
        free(t->text[c]);
        t->text[c] = NULL;
    }
}

static gonio_status put_texts(tables *t, const gonio_adaptive_tree *tree, size_t *bytes, gonio_error *error) {
    for (int c = 0; c < t->parts; c++) {
        FILE *stream = open_memstream(&t->text[c], &t->length[c]);
        if (stream == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for the text of a tree");
        }
        gonio_adaptive_tree_put(tree, c, stream);
        const bool whole = !ferror(stream);
        if (fclose(stream) != 0 || !whole) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for the text of a tree");
        }
        *bytes += t->length[c];
    }
    return GONIO_OK;
}

// Every half's tree of that tolerance, and the bytes that their texts take.
static gonio_status build(building *b, gonio_error *error) {
    gonio_status status = GONIO_OK;
    b->bytes = 0;
    for (int h = 0; h < b->s->n && status == GONIO_OK; h++) {
        tables *t = &b->s->half[h];
        forget_texts(t);
        gonio_adaptive_tree *tree = gonio_adaptive_tree_new(t->model, t->dimensions, &b->options, b->threads);
        if (tree == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a tensor tree");
        }
        if (t->parts == 3) {
            gonio_adaptive_tree_each(tree, finish_cell, t);
        }
        status = put_texts(t, tree, &b->bytes, error);
        gonio_adaptive_tree_free(tree);
    }
    return status;
}

// Floors, and what is dark, from the coarsest tree.
static gonio_status look(building *b, gonio_error *error) {
    double most = 0;
    for (int h = 0; h < b->s->n; h++) {
        tables *t = &b->s->half[h];
        seen found = {.t = t, .least = {INFINITY, INFINITY, INFINITY}};
        gonio_adaptive_tree *tree = gonio_adaptive_tree_new(t->model, t->dimensions, &b->options, b->threads);
        if (tree == NULL) {
            return gonio_fail(error, GONIO_E_MEMORY, "no memory for a tensor tree");
        }
        gonio_adaptive_tree_each(tree, look_at, &found);
        gonio_adaptive_tree_free(tree);
        find_floor(t, found.least);
        most = fmax(most, found.most);
    }
    level_floors(b->s);
    b->options.dark = DARK * most;
    return GONIO_OK;
}

// The smallest tolerance whose trees stay within the bytes; about, since each try costs a tree.
static gonio_status fill_budget(building *b, gonio_error *error) {
    double power = b->s->half[0].dimensions; // of the tolerance, by which the bytes grow
    double fits = INFINITY, before = 0;
    size_t before_bytes = 0;
    b->options.tolerance = TOLERANCE_FIRST;
    for (int round = 0; round < ROUNDS; round++) {
        const gonio_status status = build(b, error);
        const double ratio = (double)b->bytes / (double)b->budget;
        if (status != GONIO_OK) {
            return status;
        }
        if (ratio <= 1) {
            fits = fmin(fits, b->options.tolerance);
            if (ratio > FULL || b->options.tolerance < TOLERANCE_LEAST) {
                return GONIO_OK;
            }
        }
        if (before_bytes > 0 && b->bytes != before_bytes) {
            power =
                fmin(fmax(-log((double)b->bytes / (double)before_bytes) / log(b->options.tolerance / before), 0.5), 6);
        }
        before = b->options.tolerance;
        before_bytes = b->bytes;
        b->options.tolerance *= fmin(fmax(pow(ratio / AIM, 1 / power), 0.2), 5);
    }
    if (b->bytes <= b->budget && before == fits) {
        return GONIO_OK;
    }
    b->options.tolerance = fits;
    return build(b, error);
}

// The coarsest tree, of whose cells twice as many fit; then as fine as the bytes let it be.
static gonio_status write_tree(sheet *s, const gonio_format_values *values, FILE *stream, gonio_write_report *told,
                               gonio_error *error) {
    const int dimensions = s->half[0].dimensions, parts = s->half[0].parts;
    building b = {.s = s,
                  .threads = values->threads,
                  .budget = values->max_bytes > 0 ? values->max_bytes : MAX_BYTES,
                  .options = {.least_depth = 2, .deepest = 10, .tolerance = INFINITY}};
    while (b.options.least_depth < (dimensions == 3 ? 6 : 4) &&
           2 * (size_t)(s->n * parts * BYTES_A_VALUE) << (dimensions * (b.options.least_depth + 1)) <= b.budget) {
        b.options.least_depth++;
    }
    gonio_status status = look(&b, error);
    status = status == GONIO_OK ? fill_budget(&b, error) : status;
    if (status == GONIO_OK) {
        put_file(stream, s, NULL, NULL);
        tell_scene(s, told);
    }
    for (int h = 0; h < s->n; h++) {
        forget_texts(&s->half[h]);
    }
    return status;
}

static gonio_status write_klems(sheet *s, int which, const gonio_format_values *values, FILE *stream,
                                gonio_write_report *told, gonio_error *error) {
    gonio_klems_basis basis;
    gonio_klems_known(klems_names[which], &basis);
    gonio_status status = GONIO_OK;
    for (int h = 0; h < s->n && status == GONIO_OK; h++) {
        tables *t = &s->half[h];
        t->n = (size_t)basis.patches * (size_t)basis.patches;
        status = allocate(t, error);
        if (status == GONIO_OK) {
            gonio_pool_for(values->threads, (size_t)basis.patches, fill_column, &(matrix_job){t, &basis});
        }
    }
    if (status == GONIO_OK) {
        put_file(stream, s, klems_names[which], &basis);
        snprintf(told->about, sizeof told->about,
                 "%s, averages over patches; scene: void BSDF m 6 0 FILE.xml 0 1 0 . 0 0", klems_names[which]);
        gonio_write_lost(told, "everything finer than a patch");
    }
    return status;
}

// Which of the known bases a matrix has; -1: none.
static int known_basis(const gonio_klems *klems, gonio_klems_basis *basis) {
    for (int k = 0; k < 3; k++) {
        gonio_klems_known(klems_names[k], basis);
        if (memcmp(&klems->in, basis, sizeof *basis) == 0 && memcmp(&klems->out, basis, sizeof *basis) == 0) {
            return k;
        }
    }
    return -1;
}

static bool alike(const gonio_radiance_model *a, const gonio_radiance_model *b) {
    gonio_klems_basis basis;
    return a != NULL && b != NULL && a->is_tree == b->is_tree && a->parts == b->parts &&
           (a->is_tree ? a->tree[0].dimensions == b->tree[0].dimensions
                       : known_basis(&a->klems[0], &basis) == known_basis(&b->klems[0], &basis));
}

// Halves that were read, all of one structure, where nothing else is asked for.
static bool write_own(sheet *s, const gonio_format_values *values, FILE *stream, gonio_write_report *told) {
    const gonio_radiance_model *first = gonio_radiance_own(s->half[0].model);
    gonio_klems_basis basis;
    const int which = first == NULL || first->is_tree ? -1 : known_basis(&first->klems[0], &basis);
    if (first == NULL || values->at[0].choice != BASIS_AUTO || values->max_bytes != 0 ||
        (!first->is_tree && which < 0)) {
        return false;
    }
    sheet own = {.n = s->n};
    for (int h = 0; h < s->n; h++) {
        const gonio_radiance_model *m = gonio_radiance_own(s->half[h].model);
        if (!alike(first, m)) {
            return false;
        }
        tables *t = &own.half[h];
        *t = (tables){.own = m, .parts = m->parts, .dimensions = m->tree[0].dimensions, .half = s->half[h].half};
        memcpy(t->floor, m->floor, sizeof t->floor);
        for (int c = 0; c < t->parts && which >= 0; c++) {
            t->values[c] = m->klems[c].values;
            t->n = (size_t)basis.patches * (size_t)basis.patches;
        }
    }
    put_file(stream, &own, which >= 0 ? klems_names[which] : NULL, &basis);
    snprintf(told->about, sizeof told->about, "the tables as they were read");
    return true;
}

static gonio_status write_sheet(sheet *s, const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                gonio_write_report *told, gonio_error *error) {
    const int choice = values->at[0].choice != BASIS_AUTO ? values->at[0].choice
                       : model->isotropic                 ? BASIS_TREE3
                                                          : BASIS_TREE4;
    if (choice == BASIS_TREE3 && !model->isotropic) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED, "radiance-basis tree3: isotropic; the model is not");
    }
    gonio_model *rgb[GONIO_HALVES] = {NULL};
    gonio_status status = GONIO_OK;
    for (int h = 0; h < s->n && status == GONIO_OK; h++) {
        tables *t = &s->half[h];
        status = model->channels == 1 ? GONIO_OK : gonio_model_as_rgb(t->model, &rgb[h], error);
        rgb[h] = rgb[h] == t->model ? NULL : rgb[h];
        t->model = rgb[h] != NULL ? rgb[h] : t->model;
        t->parts = t->model->channels;
        t->dimensions = choice == BASIS_TREE3 ? 3 : 4;
    }
    if (status == GONIO_OK) {
        if (model->channels != 1) {
            gonio_write_lost_channels(model, 3, told);
        }
        status = choice <= BASIS_TREE4 ? write_tree(s, values, stream, told, error)
                                       : write_klems(s, choice - BASIS_FULL, values, stream, told, error);
    }
    for (int h = 0; h < s->n; h++) {
        for (int c = 0; c < 3; c++) {
            free(s->half[h].values[c]);
        }
        gonio_model_free(rgb[h]);
    }
    return status;
}

gonio_status gonio_radiance_write(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                  gonio_write_report *told, gonio_error *error) {
    sheet s = {.n = 0};
    for (int h = 0; h < GONIO_HALVES; h++) {
        const gonio_model *half = gonio_written_half(model, values, (gonio_half)h);
        if (half != NULL) {
            s.half[s.n++] = (tables){.model = half, .half = (gonio_half)h};
        }
    }
    return write_own(&s, values, stream, told) ? GONIO_OK : write_sheet(&s, model, values, stream, told, error);
}
