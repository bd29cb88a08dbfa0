// SPDX-License-Identifier: BSD-3-Clause
#include "io/table_guess.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/number.h"
#include "base/statistics.h"
#include "io/columns.h"
#include "io/table_matrix.h"

// ---- what stands in the columns ----

typedef struct distinct {
    double *values;
    size_t n;
} distinct;

static void note_value(distinct *seen, double value) {
    size_t k = 0;
    while (k < seen->n && seen->values[k] != value) {
        k++;
    }
    if (k == seen->n && k < GONIO_TABLE_DISTINCT_MAX) {
        seen->values[seen->n++] = value;
    }
}

static void take_row(gonio_table_guess *g, char *const *fields, distinct *seen) {
    g->rows++;
    for (int k = 0; k < g->layout.columns; k++) {
        gonio_table_column_facts *c = &g->columns[k];
        double value;
        if (gonio_table_number(fields[k], g->layout.decimal, &value)) {
            c->low = c->numbers == 0 ? value : fmin(c->low, value);
            c->high = c->numbers == 0 ? value : fmax(c->high, value);
            c->numbers++;
            note_value(&seen[k], value);
        }
    }
}

static gonio_status find_ranges(const gonio_source *source, gonio_table_guess *g, gonio_error *error) {
    const gonio_table_layout *l = &g->layout;
    const size_t columns = (size_t)l->columns;
    g->columns = calloc(columns, sizeof *g->columns);
    distinct *seen = calloc(columns, sizeof *seen);
    double *values = malloc(columns * GONIO_TABLE_DISTINCT_MAX * sizeof *values);
    char **fields = malloc(GONIO_TABLE_COLUMNS_MAX * sizeof *fields), *line;
    gonio_table_lines lines = gonio_table_lines_begin(source);
    const bool room = g->columns != NULL && seen != NULL && values != NULL && fields != NULL;
    for (size_t k = 0; k < columns && room; k++) {
        seen[k].values = values + k * GONIO_TABLE_DISTINCT_MAX;
        snprintf(g->columns[k].name, sizeof g->columns[k].name, "%s", l->names[k]);
    }
    while (room && (line = gonio_table_lines_next(&lines)) != NULL) {
        if (lines.number >= l->first_row && !gonio_table_is_blank(line) &&
            gonio_table_split(line, l->separator, l->columns, fields, GONIO_TABLE_COLUMNS_MAX) == l->columns) {
            take_row(g, fields, seen);
        }
    }
    for (size_t k = 0; k < columns && room; k++) {
        g->columns[k].distinct = seen[k].n;
    }
    free(lines.buffer);
    free(seen);
    free(values);
    free(fields);
    return room ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for the columns' ranges");
}

// ---- what they are ----

static void because(gonio_table_guess *g, const char *reason) {
    gonio_text_append(g->reasons, sizeof g->reasons, "%s\n", reason);
}

static int column_of(const gonio_table_guess *g, const char *key) {
    for (int k = 0; k < g->layout.columns; k++) {
        if (strcmp(g->columns[k].key, key) == 0) {
            return k;
        }
    }
    return -1;
}

static void set_key(gonio_table_guess *g, int column, const char *key) {
    snprintf(g->columns[column].key, sizeof g->columns[column].key, "%s", key);
}

static int roles_by_name(gonio_table_guess *g) {
    int angles = 0;
    for (int k = 0; k < g->layout.columns; k++) {
        gonio_mapped_role role;
        if (gonio_table_angle_of_name(g->columns[k].name, &role) && column_of(g, gonio_mapped_role_name(role)) < 0) {
            set_key(g, k, gonio_mapped_role_name(role));
            angles++;
        }
    }
    return angles;
}

// A lone polar angle whose name tells no side is what was scanned.
static void lone_angle(gonio_table_guess *g) {
    static const char *const words[] = {"angle", "theta", "zenith", "winkel", "deg", NULL};
    for (int k = 0; k < g->layout.columns && column_of(g, "theta_o") < 0; k++) {
        for (int w = 0; words[w] != NULL; w++) {
            if (g->columns[k].key[0] == 0 && strncasecmp(g->columns[k].name, words[w], strlen(words[w])) == 0) {
                set_key(g, k, "theta_o");
                because(g, "the only polar angle without a side is taken for theta_o");
                return;
            }
        }
    }
}

static bool may_be_angle(const gonio_table_column_facts *c, double limit) {
    return c->numbers > 0 && c->low >= -limit && c->high <= limit;
}

// Without names the usual orders.
static void roles_by_place(gonio_table_guess *g) {
    static const char *const orders[4][4] = {
        {"theta_o"}, {"theta_i", "theta_o"}, {"theta_i", "theta_o", "phi"}, {"theta_i", "phi_i", "theta_o", "phi_o"}};
    const int n = g->layout.columns - 1 < 4 ? g->layout.columns - 1 : 4;
    for (int k = 0; k < n; k++) {
        const char *key = orders[n - 1][k];
        if (!may_be_angle(&g->columns[k], strncmp(key, "theta", 5) == 0 ? 90 : 360)) {
            return;
        }
    }
    for (int k = 0; k < n; k++) {
        set_key(g, k, orders[n - 1][k]);
    }
    because(g, "no names: the columns' order alone says which angle is which");
}

static gonio_column_role role_of(const gonio_table_column_facts *c) {
    gonio_mapped_role angle;
    return gonio_table_angle_of_name(c->name, &angle) ? GONIO_COLUMN_ASIDE : gonio_column_role_of(c->name);
}

static void find_values(gonio_table_guess *g) {
    int values = 0;
    bool named = false;
    for (int k = 0; k < g->layout.columns; k++) {
        const gonio_table_column_facts *c = &g->columns[k];
        const gonio_column_role kind = role_of(c);
        named = named ||
                (c->key[0] == 0 && c->numbers > 0 && (kind == GONIO_COLUMN_CHANNEL || kind == GONIO_COLUMN_FOREIGN));
    }
    for (int k = 0; k < g->layout.columns; k++) {
        gonio_table_column_facts *c = &g->columns[k];
        const gonio_column_role kind = role_of(c);
        if (c->key[0] != 0 || c->numbers == 0) {
            continue;
        }
        if (kind == GONIO_COLUMN_WAVELENGTH && column_of(g, "wavelength") < 0) {
            set_key(g, k, "wavelength");
        } else if (kind == GONIO_COLUMN_SIGMA && column_of(g, "sigma") < 0) {
            set_key(g, k, "sigma");
        } else if (kind == GONIO_COLUMN_CHANNEL || kind == GONIO_COLUMN_FOREIGN ||
                   (kind == GONIO_COLUMN_UNKNOWN && !named)) {
            set_key(g, k, values++ == 0 ? "value" : "values");
        }
    }
    if (values > 1 && column_of(g, "sigma") >= 0) {
        set_key(g, column_of(g, "sigma"), "");
    }
}

// ---- an incidence that the text before the table tells ----

static bool incidence_of_line(const char *line, char decimal, double *value) {
    static const char *const words[] = {"incid", "theta_i", "theta i",      "thetai",
                                        "aoi",   "einfall", "illumination", NULL};
    for (int w = 0; words[w] != NULL; w++) {
        const char *found = strcasestr(line, words[w]);
        if (found == NULL) {
            continue;
        }
        const char *digits = strpbrk(found + strlen(words[w]), "0123456789");
        char number[32];
        if (digits != NULL) {
            const bool minus = digits > found && digits[-1] == '-';
            const size_t n = strspn(digits, "0123456789.,");
            snprintf(number, sizeof number, "%s%.*s", minus ? "-" : "", (int)(n < 24 ? n : 24), digits);
            if (gonio_table_number(number, decimal, value) && fabs(*value) <= 90) {
                return true;
            }
        }
    }
    return false;
}

static bool find_incidence(const gonio_source *source, const gonio_table_guess *g, double *value) {
    gonio_table_lines lines = gonio_table_lines_begin(source);
    bool found = false;
    for (char *line; !found && (line = gonio_table_lines_next(&lines)) != NULL && lines.number < g->layout.first_row;) {
        found = lines.number != g->layout.header_line && incidence_of_line(line, g->layout.decimal, value);
    }
    free(lines.buffer);
    return found;
}

// ---- the proposal ----

static void set(gonio_table_guess *g, int option, const char *value) {
    int n = 0;
    while (n < GONIO_FORMAT_SETTINGS_MAX - 1 && g->options.settings[n].name != NULL) {
        n++;
    }
    g->options.settings[n] = (gonio_format_setting){gonio_format_table.options[option].name, value};
}

static void propose_columns(const gonio_source *source, gonio_table_guess *g) {
    double incidence;
    const int values = column_of(g, "values");
    for (int k = 0; k < g->layout.columns; k++) {
        const gonio_table_column_facts *c = &g->columns[k];
        const bool value = strncmp(c->key, "value", 5) == 0;
        if (c->key[0] == 0 || (value && values >= 0)) {
            continue; // several values keep their names: they are left to the header
        }
        gonio_text_append(g->mapped, sizeof g->mapped, "%s%s=", g->mapped[0] != 0 ? "," : "", c->key);
        const bool plain = c->name[0] != 0 && strpbrk(c->name, ",=#") == NULL && strlen(c->name) < 60 &&
                           c->name[strspn(c->name, "0123456789.")] != 0 &&
                           gonio_table_find_name(g->layout.names, g->layout.columns, c->name) == k;
        if (plain) {
            gonio_text_append(g->mapped, sizeof g->mapped, "%s", c->name);
        } else {
            gonio_text_append(g->mapped, sizeof g->mapped, "#%d", k + 1);
        }
    }
    if (column_of(g, "theta_i") < 0 && find_incidence(source, g, &incidence)) {
        gonio_text_append(g->mapped, sizeof g->mapped, ",theta_i=%gdeg", incidence);
        because(g, "theta_i is in no column; the text before the table tells it");
    } else if (column_of(g, "theta_i") < 0) {
        snprintf(g->open, sizeof g->open, "theta_i is in no column: say it, as in theta_i=30deg");
    }
    if (column_of(g, "theta_o") < 0) {
        snprintf(g->open, sizeof g->open, "no column seems to be theta_o: say which, as in theta_o=#2");
    } else if (column_of(g, "value") < 0) {
        snprintf(g->open, sizeof g->open, "no column seems to be the value: say which, as in value=#3");
    }
    set(g, GONIO_TABLE_COLUMNS, g->mapped);
}

static void propose_angles(gonio_table_guess *g) {
    double low = 0, high = 0;
    bool radians = false;
    for (int k = 0; k < 2; k++) {
        const int column = column_of(g, k == 0 ? "theta_i" : "theta_o");
        if (column >= 0) {
            low = fmin(low, g->columns[column].low);
            high = fmax(high, fmax(g->columns[column].high, -g->columns[column].low));
            char unit[32];
            gonio_table_unit(&g->layout, column, unit, sizeof unit);
            radians = radians || strncmp(unit, "rad", 3) == 0 || strcmp(unit, "bogenmass") == 0;
        }
    }
    if (low < 0) {
        set(g, GONIO_TABLE_SIGNED, "yes");
    }
    const int light = column_of(g, "theta_i");
    if (light >= 0 && strncasecmp(g->columns[light].name, "elev", 4) == 0) {
        set(g, GONIO_TABLE_ELEVATION, "yes");
        because(g, "the name says elevation: polar angles from the surface, not from the normal");
    }
    if (radians || (high > 0.2 && high <= 1.5708 && high != floor(high))) {
        because(g, radians ? "the angles' units say radians" : "the polar angles end at 1.5708: radians");
        set(g, GONIO_TABLE_ANGLES, "rad");
    }
}

static void propose_signs(gonio_table_guess *g) {
    const char s = g->layout.separator;
    snprintf(g->separator, sizeof g->separator, "%s", s == '\t' ? "tab" : s == ' ' ? "blanks" : (char[]){s, 0});
    snprintf(g->decimal, sizeof g->decimal, "%c", g->layout.decimal);
    set(g, GONIO_TABLE_SEPARATOR, g->separator);
    set(g, GONIO_TABLE_DECIMAL, g->decimal);
}

// ---- the quantity ----

static const char *quantity_of_name(const char *name) {
    static const struct {
        const char *part, *quantity;
    } parts[] = {{"%", "percent"},
                 {"percent", "percent"},
                 {"cos", "f_r_cos"},
                 {"ccbrdf", "f_r_cos"},
                 {"ars", "f_r_cos"},
                 {"brdf", "f_r"},
                 {"bsdf", "f_r"},
                 {"1/sr", "f_r"},
                 {"sr-1", "f_r"},
                 {"sr^-1", "f_r"},
                 {"f_r", "f_r"},
                 {"reflectance factor", "brf"},
                 {"radiance factor", "brf"},
                 {"brf", "brf"},
                 {NULL, NULL}};
    for (int k = 0; parts[k].part != NULL; k++) {
        if (strcasestr(name, parts[k].part) != NULL) {
            return parts[k].quantity;
        }
    }
    return NULL;
}

// The diffuse level: the median away from the mirror direction and its opposite.
static gonio_status base_level(const gonio_samples *s, double *level, gonio_error *error) {
    double *values = malloc(s->n * sizeof *values);
    if (values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu values", s->n);
    }
    for (int pass = 0; pass < 2; pass++) {
        size_t n = 0;
        for (size_t i = 0; i < s->n; i++) {
            const gonio_pair *p = &s->pairs[i];
            if (pass == 1 || fabs(p->theta_o - p->theta_i) > gonio_radians(15)) {
                values[n++] = s->values[i * (size_t)s->channels];
            }
        }
        if (n >= 5 || pass == 1) {
            gonio_sort(values, n);
            *level = gonio_median(values, n);
            break;
        }
    }
    free(values);
    return GONIO_OK;
}

// Do the values fall as cos(theta_o) does: is their spread over it much smaller than their own?
static bool falls_with_cosine(const gonio_samples *s) {
    double sums[4] = {0};
    size_t n = 0;
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        const double value = s->values[i * (size_t)s->channels], cosine = cos(p->theta_o);
        if (value > 0 && cosine > 0.05 && fabs(p->theta_o - p->theta_i) > gonio_radians(15)) {
            const double own = log(value), divided = log(value / cosine);
            sums[0] += own;
            sums[1] += own * own;
            sums[2] += divided;
            sums[3] += divided * divided;
            n++;
        }
    }
    const double k = (double)n;
    const double own = sums[1] / k - sums[0] * sums[0] / k / k, divided = sums[3] / k - sums[2] * sums[2] / k / k;
    return n >= 8 && own > 0.01 && divided < 0.1 * own;
}

static gonio_status propose_quantity(const gonio_samples *s, gonio_table_guess *g, gonio_error *error) {
    const int column = column_of(g, "value");
    const char *name = column >= 0 ? g->columns[column].name : "";
    const char *quantity = quantity_of_name(name);
    double level = 0;
    const gonio_status status = base_level(s, &level, error);
    if (status != GONIO_OK) {
        return status;
    }
    const double limit = 1.1; // of an albedo: nothing reflects more than all, but for noise and the base's spread
    const char *by_level = GONIO_PI * level <= limit ? "f_r"
                           : level <= limit          ? "brf"
                           : level <= 100 * limit    ? "percent"
                                                     : NULL;
    char reason[200];
    if (quantity != NULL) {
        snprintf(reason, sizeof reason, "the name '%.40s' says %s%s", name, quantity,
                 strcmp(quantity, "f_r") == 0 && GONIO_PI * level > limit
                     ? ", but the values away from the lobe would reflect more than all light"
                     : "");
    } else if (falls_with_cosine(s)) {
        quantity = "f_r_cos";
        snprintf(reason, sizeof reason, "the values fall as cos(theta_o) does: f_r_cos");
    } else if (by_level != NULL) {
        quantity = by_level;
        snprintf(
            reason, sizeof reason,
            "away from the lobe the values are about %.3g, an albedo of %.3g as f_r, %.3g as brf, %.3g as percent: %s",
            level, GONIO_PI * level, level, level / 100, quantity);
    } else {
        snprintf(reason, sizeof reason,
                 "away from the lobe the values are about %.3g: no quantity fits, are they counts?", level);
        snprintf(g->open, sizeof g->open, "the values' quantity is not known: say it with --quantity");
    }
    because(g, reason);
    if (quantity != NULL) {
        set(g, GONIO_TABLE_QUANTITY, quantity);
    }
    return GONIO_OK;
}

static void propose_mirror(const gonio_source *source, const gonio_samples *s, gonio_table_guess *g) {
    double means[2];
    char why[300];
    bool azimuths = false; // of a matrix they stand among its keys
    for (int k = 0; k < g->layout.columns; k++) {
        azimuths = azimuths || strncmp(g->columns[k].key, "phi", 3) == 0;
    }
    azimuths = azimuths || strstr(g->mapped, "phi") != NULL;
    if (!azimuths && gonio_mirror_is_open(source, s, why, sizeof why)) {
        snprintf(g->open, sizeof g->open, "%s", why);
        return;
    }
    const int at = gonio_mirror_of_samples(s, means);
    char reason[160];
    if (at >= 0) {
        snprintf(reason, sizeof reason, "the lobe stands at azimuth %d: the mirror direction is there", at);
    } else {
        snprintf(reason, sizeof reason, "no lobe shows where the mirror direction stands; 180 is Gonio's own");
    }
    because(g, reason);
    set(g, GONIO_TABLE_MIRROR_AT, at == 0 ? "0" : "180");
}

// Read as proposed so far, with the mirror direction where Gonio has it, to look at the values.
static gonio_status look_at_values(const gonio_source *source, gonio_table_guess *g, gonio_error *error) {
    const char *path = source->path;
    gonio_read_options options = g->options;
    int n = 0;
    while (options.settings[n].name != NULL) {
        n++;
    }
    options.settings[n++] = (gonio_format_setting){"mirror-at", "180"};
    options.settings[n++] = (gonio_format_setting){"quantity", "f_r"};
    options.settings[n++] = (gonio_format_setting){"negatives", "keep"};
    gonio_samples *samples;
    gonio_error why = {.line = -1, .byte = -1};
    gonio_status status = gonio_read(path, &options, &samples, NULL, &why);
    if (status == GONIO_E_INPUT) {
        options.settings[n] = (gonio_format_setting){"declared", "ignore"};
        if (gonio_read(path, &options, &samples, NULL, NULL) == GONIO_OK) {
            set(g, GONIO_TEXT_DECLARED, "ignore");
            because(g, "a comment declares something that is not known here: it is taken for a remark");
            status = GONIO_OK;
        }
    }
    if (status != GONIO_OK) {
        snprintf(g->open, sizeof g->open, "line %lld: %.150s", why.line, why.message);
        return GONIO_OK;
    }
    status = propose_quantity(samples, g, error);
    propose_mirror(source, samples, g);
    gonio_samples_free(samples);
    return status;
}

// ---- a matrix ----

static const char *key_of_heading(const char *heading) {
    static const struct {
        const char *word, *key;
    } words[] = {{"phi", "phi"},         {"azim", "phi"},        {"theta_i", "theta_i"}, {"incid", "theta_i"},
                 {"aoi", "theta_i"},     {"einfall", "theta_i"}, {"theta i", "theta_i"}, {"lambda", "wavelength"},
                 {"wave", "wavelength"}, {" nm", "wavelength"},  {"theta_o", "theta_o"}, {NULL, NULL}};
    int k = 0;
    while (words[k].word != NULL && strcasestr(heading, words[k].word) == NULL) {
        k++;
    }
    return words[k].key;
}

// Rows and columns by their ranges, and by what the headings leave for them.
static bool propose_matrix(const gonio_source *source, gonio_table_guess *g) {
    int blocks;
    double columns[2], rows[2];
    char heading[80];
    if (!gonio_table_is_matrix(source, &blocks, columns, rows, heading)) {
        return false;
    }
    const char *block = blocks > 0 ? key_of_heading(heading) : NULL;
    const bool turned = blocks > 0 && block != NULL && strcmp(block, "theta_i") == 0;
    const char *row = rows[0] >= 200 && rows[1] > 360 ? "wavelength" : rows[1] > 90 ? "phi" : "theta_o";
    const char *column = strcmp(row, "theta_o") != 0 ? "theta_o" : columns[1] > 90 || turned ? "phi" : "theta_i";
    snprintf(g->mapped, sizeof g->mapped, "%s,%s%s%s", row, column, block != NULL ? "," : "",
             block != NULL ? block : "");
    set(g, GONIO_TABLE_MATRIX, g->mapped);
    because(g, "a number at the head of each row and column: a matrix, a value a cell");
    const bool light = strstr(g->mapped, "theta_i") != NULL;
    double incidence;
    if (!light && find_incidence(source, g, &incidence)) {
        snprintf(g->constants, sizeof g->constants, "theta_i=%gdeg", incidence);
        set(g, GONIO_TABLE_COLUMNS, g->constants);
        because(g, "theta_i is in neither; the text before the matrix tells it");
    } else if (!light) {
        snprintf(g->open, sizeof g->open,
                 "neither rows nor columns are theta_i: say it, as in --columns theta_i=30deg");
    } else if (blocks > 1 && block == NULL) {
        snprintf(g->open, sizeof g->open, "what does the number in '%.60s' tell? It is the third of --matrix", heading);
    }
    if (fmin(rows[0], columns[0]) < 0 && strcmp(row, "phi") != 0) {
        set(g, GONIO_TABLE_SIGNED, "yes");
    }
    return true;
}

// ---- as a shell takes it ----

static void put_word(gonio_table_guess *g, const char *word) {
    const bool plain =
        word[strspn(word, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.,=/:+")] == 0;
    gonio_text_append(g->command, sizeof g->command, plain && word[0] != 0 ? "%s" : "'", word);
    for (const char *c = word; !plain && *c != 0; c++) {
        gonio_text_append(g->command, sizeof g->command, *c == '\'' ? "'\\''" : "%c", *c);
    }
    gonio_text_append(g->command, sizeof g->command, "%s", plain && word[0] != 0 ? "" : "'");
}

static void put_command(gonio_table_guess *g) {
    for (int k = 0; g->options.settings[k].name != NULL; k++) {
        const gonio_format_setting *s = &g->options.settings[k];
        gonio_text_append(g->command, sizeof g->command, "%s--%s", k > 0 ? " " : "", s->name);
        if (strcmp(s->name, "signed") != 0 && strcmp(s->name, "elevation") != 0) {
            gonio_text_append(g->command, sizeof g->command, " ");
            put_word(g, s->value);
        }
    }
}

static gonio_status guess(const gonio_source *source, gonio_table_guess *g, gonio_error *error) {
    static const gonio_mapping nothing = {0};
    gonio_status status = gonio_table_layout_find(source, &nothing, &g->layout, error);
    status = status == GONIO_OK ? find_ranges(source, g, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    if (propose_matrix(source, g)) {
        propose_signs(g);
        return g->open[0] == 0 ? look_at_values(source, g, error) : GONIO_OK;
    }
    const int named = roles_by_name(g);
    lone_angle(g);
    if (named == 0 && g->layout.header_line == 0) {
        roles_by_place(g);
    }
    find_values(g);
    propose_columns(source, g);
    propose_angles(g);
    propose_signs(g);
    return g->open[0] == 0 ? look_at_values(source, g, error) : GONIO_OK;
}

// Another format's file, or a samples file with its header, is no table of one's own.
static bool is_known(const gonio_source *source) {
    char line[256];
    long long number;
    for (int i = 0; gonio_format_at(i) != NULL; i++) {
        const gonio_format *f = gonio_format_at(i);
        if (f->recognise(source)) {
            return strcmp(f->name, "samples") != 0 ||
                   strncmp(gonio_source_first_line(source, line, sizeof line, &number), GONIO_PAIR_HEADER,
                           strlen(GONIO_PAIR_HEADER)) == 0;
        }
    }
    return false;
}

gonio_status gonio_table_guess_make(const char *path, gonio_table_guess *g, gonio_error *error) {
    *g = (gonio_table_guess){.options = {.seed = 1}};
    gonio_source source = {.path = path};
    gonio_status status = gonio_file_read(path, 0, &source.data, &source.size, error);
    status = status == GONIO_OK ? gonio_text_check(path, source.data, source.size, error) : status;
    if (status == GONIO_OK && (source.size == 0 || !gonio_table_may_be(&source) || is_known(&source))) {
        status = gonio_fail_line(error, GONIO_E_INPUT, path, -1, "it is no table of one's own");
    }
    status = status == GONIO_OK ? guess(&source, g, error) : status;
    free(source.data);
    if (status == GONIO_OK) {
        g->whole = g->open[0] == 0;
        put_command(g);
    }
    return status;
}

void gonio_table_guess_free(gonio_table_guess *g) {
    gonio_table_layout_free(&g->layout);
    free(g->columns);
    g->columns = NULL;
}
