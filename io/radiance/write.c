// SPDX-License-Identifier: BSD-3-Clause
// Writing a model as XML of Radiance and WINDOW: a tensor tree with the model's values at its cells' centres, or a
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
#define BYTES_A_VALUE 9    // of text, about
#define SAME 1e-5          // cells whose values differ by no more, relatively, are one
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
    int parts, dimensions, depth;
    const gonio_radiance_model *own; // a model that was read, whose tables are written as they are; NULL: none
    size_t n;
    double *values[3];
    double floor[3]; // r, g, b
    gonio_half half;
} tables;

// What a file holds: the halves one after the other, all of one structure.
typedef struct sheet {
    tables half[GONIO_HALVES];
    int n;
} sheet;

// ---- trees ----

static void fill_tree_row(void *context, size_t row) {
    tables *t = context;
    const size_t side = (size_t)1 << t->depth;
    for (size_t k = row * side; k < (row + 1) * side; k++) {
        double at[4], rgb[3];
        size_t rest = k;
        for (int d = t->dimensions - 1; d >= 0; d--, rest /= side) {
            at[d] = ((double)(rest % side) + 0.5) / (double)side;
        }
        gonio_vec3 wi, wo;
        const bool lies = gonio_tensor_tree_directions(t->dimensions, at, &wi, &wo);
        if (lies) {
            gonio_model_eval(t->model, wi, wo, rgb);
        }
        for (int c = 0; c < t->parts; c++) {
            t->values[c][k] = lies ? fmax(rgb[c], 0) : -1;
        }
    }
}

// The smallest value of each of r, g, b where Radiance would take it out; else zeros.
static void find_floor(tables *t) {
    double least[3] = {INFINITY, INFINITY, INFINITY}, xyz[3];
    for (size_t k = 0; k < t->n; k++) {
        for (int c = 0; c < t->parts && t->values[0][k] >= 0; c++) {
            least[c] = fmin(least[c], t->values[c][k]);
        }
    }
    gonio_radiance_rgb_to_xyz(least, xyz);
    if (t->parts == 3 && t->dimensions == 3 && xyz[1] > FLOOR_LEAST / GONIO_PI) {
        memcpy(t->floor, least, sizeof least);
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

// Take the floor out and turn colours to Y, u', v'; where no direction lies, zeros.
static void finish_tree(tables *t) {
    double xyz[3];
    for (size_t k = 0; k < t->n; k++) {
        double rgb[3] = {0};
        if (t->values[0][k] < 0 || t->parts == 1) {
            for (int c = 0; c < t->parts; c++) {
                t->values[c][k] = fmax(t->values[c][k], 0);
            }
            continue;
        }
        for (int c = 0; c < 3; c++) {
            rgb[c] = fmax(t->values[c][k] - t->floor[c], 0);
        }
        gonio_radiance_rgb_to_xyz(rgb, xyz);
        const double sum = xyz[0] + 15 * xyz[1] + 3 * xyz[2];
        t->values[0][k] = xyz[1];
        t->values[1][k] = (xyz[1] > 1e-9 ? 4 * xyz[0] / sum : WHITE_U);
        t->values[2][k] = (xyz[1] > 1e-9 ? 9 * xyz[1] / sum : WHITE_V);
    }
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
    fputs("{", stream);
    for (size_t k = 0; k < (size_t)1 << (leaf[1] * t->dimensions); k++) {
        fprintf(stream, " %.6g", t->values[(size_t)leaf[0] + k]);
    }
    fputs(" }\n", stream);
}

typedef struct emitter {
    FILE *stream;
    const double *values;
    int dimensions, depth;
} emitter;

static size_t index_of(const emitter *e, const size_t at[4]) {
    size_t index = 0;
    for (int d = 0; d < e->dimensions; d++) {
        index = (index << e->depth) + at[d];
    }
    return index;
}

static void range_of(const emitter *e, const size_t low[4], size_t side, double *least, double *most) {
    size_t count = 1;
    for (int d = 0; d < e->dimensions; d++) {
        count *= side;
    }
    *least = INFINITY;
    *most = -INFINITY;
    for (size_t k = 0; k < count; k++) {
        size_t at[4], rest = k;
        for (int d = e->dimensions - 1; d >= 0; d--, rest /= side) {
            at[d] = low[d] + rest % side;
        }
        const double v = e->values[index_of(e, at)];
        *least = fmin(*least, v);
        *most = fmax(*most, v);
    }
}

// The cells of two a way, dimension 0 slowest.
static void emit_grid(const emitter *e, const size_t low[4]) {
    fputs("{", e->stream);
    for (int k = 0; k < 1 << e->dimensions; k++) {
        size_t at[4];
        for (int d = 0; d < e->dimensions; d++) {
            at[d] = low[d] + (size_t)(k >> (e->dimensions - 1 - d) & 1);
        }
        fprintf(e->stream, " %.6g", e->values[index_of(e, at)]);
    }
    fputs(" }\n", e->stream);
}

static void emit(const emitter *e, const size_t low[4], size_t side) {
    double least, most;
    range_of(e, low, side, &least, &most);
    if (most - least <= SAME * fabs(most)) {
        fprintf(e->stream, "{ %.6g }\n", 0.5 * (least + most));
        return;
    }
    if (side == 2) {
        emit_grid(e, low);
        return;
    }
    fputs("{\n", e->stream);
    for (int child = 0; child < 1 << e->dimensions; child++) { // the lowest bit is dimension 0
        size_t corner[4];
        for (int d = 0; d < e->dimensions; d++) {
            corner[d] = low[d] + (child >> d & 1 ? side / 2 : 0);
        }
        emit(e, corner, side / 2);
    }
    fputs("}\n", e->stream);
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
        const emitter e = {stream, t->values[part], t->dimensions, t->depth};
        emit(&e, (const size_t[4]){0}, (size_t)1 << t->depth);
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

static size_t cells_of(const tables *t) {
    const size_t n = (size_t)1 << (t->dimensions * t->depth);
    return t->dimensions == 3 ? n / 2 : n;
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
    snprintf(told->about, sizeof told->about, "TensorTree%d of side %d; scene: void BSDF m 6 0 FILE.xml 0 1 0 . 0 %d%s",
             s->half[0].dimensions, 1 << s->half[0].depth, 3 * groups, text);
}

static gonio_status write_tree(sheet *s, const gonio_format_values *values, FILE *stream, gonio_write_report *told,
                               gonio_error *error) {
    const size_t bytes = (values->max_bytes > 0 ? values->max_bytes : MAX_BYTES) / (size_t)s->n;
    const tables *first = &s->half[0];
    const int deepest = first->dimensions == 3 ? 8 : 6;
    int depth = 2;
    for (; depth < deepest; depth++) {
        const tables next = {.dimensions = first->dimensions, .depth = depth + 1};
        if (cells_of(&next) * (size_t)first->parts * BYTES_A_VALUE > bytes) {
            break;
        }
    }
    gonio_status status = GONIO_OK;
    for (int h = 0; h < s->n && status == GONIO_OK; h++) {
        tables *t = &s->half[h];
        t->depth = depth;
        t->n = (size_t)1 << (t->dimensions * t->depth);
        status = allocate(t, error);
        if (status == GONIO_OK) {
            gonio_pool_for(values->threads, t->n >> t->depth, fill_tree_row, t);
            find_floor(t);
        }
    }
    if (status == GONIO_OK) {
        level_floors(s);
        for (int h = 0; h < s->n; h++) {
            finish_tree(&s->half[h]);
        }
        put_file(stream, s, NULL, NULL);
        tell_scene(s, told);
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
