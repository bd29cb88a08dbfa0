// SPDX-License-Identifier: BSD-3-Clause
// Radiance's BSDF files: which number belongs to which pair of directions, in matrices and in trees; colour; what is
// refused.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "gonio/io.h"
#include "io/radiance/radiance.h"
#include "tests/format_files.h"
#include "tests/fuzz/memory_file.h"
#include "tests/unit/near.h"

// A block of one quantity and way, with numbers from the caller.
static void block(FILE *to, const char *quantity, const char *direction, const char *basis, const char *numbers) {
    fprintf(to,
            "<WavelengthData><Wavelength unit=\"Integral\">%s</Wavelength><WavelengthDataBlock>"
            "<WavelengthDataDirection>%s</WavelengthDataDirection>%s<ScatteringDataType>BTDF</ScatteringDataType>"
            "<ScatteringData>\n%s</ScatteringData></WavelengthDataBlock></WavelengthData>\n",
            quantity, direction, basis, numbers);
}

static FILE *begin(char **text, size_t *size, const char *structure) {
    FILE *to = open_memstream(text, size);
    fprintf(to,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<WindowElement xmlns=\"http://windows.lbl.gov\">\n<Optical>"
            "<Layer><DataDefinition><IncidentDataStructure>%s</IncidentDataStructure></DataDefinition>\n",
            structure);
    return to;
}

static const char *end(FILE *to, char **text, size_t *size) {
    fprintf(to, "</Layer></Optical></WindowElement>\n");
    fclose(to);
    const char *path = memory_file((const uint8_t *)*text, *size);
    free(*text);
    return path;
}

static gonio_model *table_of(const char *path) {
    gonio_model *model;
    gonio_error error = {0};
    if (gonio_read_table(path, &model, &error) != GONIO_OK) {
        fail_msg("line %lld: %s", error.line, error.message);
    }
    return model;
}

static double at(const gonio_model *model, double ti, double pi, double to, double po) {
    const gonio_pair pair = {gonio_radians(ti), gonio_radians(pi), gonio_radians(to), gonio_radians(po)};
    double v[3];
    gonio_model_eval_pair(model, &pair, v);
    return v[0];
}

// ---- matrices ----

#define KLEMS(name) "<ColumnAngleBasis>" name "</ColumnAngleBasis><RowAngleBasis>" name "</RowAngleBasis>"

// 1000 x outgoing patch + incident patch, as Columns (outgoing slowest) or Rows.
static char *numbered(int patches, bool rows) {
    char *text;
    size_t size;
    FILE *to = open_memstream(&text, &size);
    for (int a = 0; a < patches; a++) {
        for (int b = 0; b < patches; b++) {
            fprintf(to, "%d,\t%s", rows ? 1000 * b + a : 1000 * a + b, b + 1 == patches ? "\n\n" : "");
        }
    }
    fclose(to);
    return text;
}

static const struct {
    const char *basis;
    int patches;
    // A patch of the second ring: its number, theta and azimuth of its centre.
    int patch;
    double theta, phi;
    int last; // patch, at azimuth 0 of the outermost ring
    double grazing;
} bases[] = {
    {KLEMS("LBNL/Klems Full"), 145, 1 + 2, 10, 90, 145 - 12, 82.5},
    {KLEMS("LBNL/Klems Half"), 77, 1 + 4, 13, 180, 77 - 8, 80.75},
    {KLEMS("LBNL/Klems Quarter"), 41, 1 + 1, 18, 45, 41 - 8, 76.5},
};

static void a_patch_is_where_it_stands(void **state) {
    (void)state;
    for (size_t k = 0; k < sizeof bases / sizeof *bases; k++) {
        for (int rows = 0; rows < 2; rows++) {
            char *text, *values = numbered(bases[k].patches, rows);
            size_t size;
            FILE *to = begin(&text, &size, rows ? "Rows" : "Columns");
            block(to, "Visible", "Reflection Back", bases[k].basis, values);
            gonio_model *model = table_of(end(to, &text, &size));
            free(values);
            assert_false(model->isotropic);
            const double theta = bases[k].theta, phi = bases[k].phi;
            // The incident patch is turned by half a turn; the outgoing one is not.
            assert_near(at(model, theta, phi + 180, 0, 0), bases[k].patch, 0);
            assert_near(at(model, 0, 0, theta, phi), 1000 * bases[k].patch, 0);
            assert_near(at(model, theta, phi + 180, theta, phi), 1001 * bases[k].patch, 0); // the mirror direction
            assert_near(at(model, bases[k].grazing, 180, 0, 0), bases[k].last, 0);
            assert_near(at(model, 90, 180, 90, 0), 1001 * bases[k].last, 0);
            gonio_model_free(model);
        }
    }
}

static void samples_are_the_centres(void **state) {
    (void)state;
    for (size_t k = 0; k < sizeof bases / sizeof *bases; k++) {
        char *text, *values = numbered(bases[k].patches, false);
        size_t size;
        FILE *to = begin(&text, &size, "Columns");
        block(to, "Visible", "Reflection Back", bases[k].basis, values);
        const char *path = end(to, &text, &size);
        free(values);
        gonio_model *model = table_of(path);
        gonio_samples *s;
        gonio_read_report report;
        assert_int_equal(gonio_read(path, NULL, &s, &report, NULL), GONIO_OK);
        assert_string_equal(report.format, "radiance");
        assert_int_equal(s->n, bases[k].patches * bases[k].patches);
        for (size_t i = 0; i < s->n; i++) {
            double v;
            gonio_model_eval_pair(model, &s->pairs[i], &v);
            // Each number once, and the model says the same at its place.
            assert_near(s->values[i], v, 0);
            const int o = (int)i % bases[k].patches, in = (int)i / bases[k].patches;
            assert_near(v, 1000 * o + in, 0);
        }
        gonio_samples_free(s);
        gonio_model_free(model);
    }
}

static void the_side_is_chosen(void **state) {
    (void)state;
    char *text, *values = numbered(41, false);
    size_t size;
    FILE *to = begin(&text, &size, "Columns");
    block(to, "Solar", "Reflection Back", bases[2].basis, "1");
    block(to, "Visible", "Transmission Back", bases[2].basis, values);
    block(to, "Visible", "Reflection Front", bases[2].basis, values);
    const char *path = end(to, &text, &size);
    free(values);
    static const struct {
        const char *side;
        gonio_status status;
    } sides[] = {{"auto", GONIO_OK}, {"back", GONIO_OK}, {"front", GONIO_E_INPUT}, {"left", GONIO_E_USAGE}};
    for (size_t k = 0; k < sizeof sides / sizeof *sides; k++) {
        const gonio_read_options options = {.seed = 1, .settings = {{"side", sides[k].side}, {"limit", "100"}}};
        gonio_samples *s;
        gonio_error error = {0};
        assert_int_equal(gonio_read(path, &options, &s, NULL, &error), sides[k].status);
        if (s != NULL) {
            assert_true(s->n > 50 && s->n < 150);
            assert_int_equal(s->transmission, k == 0);
            assert_int_equal(gonio_samples_halves(s),
                             k == 0 ? 1u << GONIO_TRANSMISSION | 1u << GONIO_REFLECTION_BACK : 1u << GONIO_REFLECTION);
        } else if (sides[k].status == GONIO_E_INPUT) {
            assert_non_null(strstr(error.message, "the file holds Solar Reflection Back, Visible Transmission Back"));
        }
        gonio_samples_free(s);
    }
}

// ---- halves ----

// The file's four, each a constant, at their places: what the file calls the back is Radiance's front.
static void every_half_is_read(void **state) {
    (void)state;
    static const struct {
        const char *direction;
        double theta_i, theta_o;
    } halves[] = {{"Reflection Back", 30, 40},
                  {"Transmission Back", 30, 140},
                  {"Reflection Front", 150, 140},
                  {"Transmission Front", 150, 40}};
    static const char *const structures[] = {"Columns", "TensorTree4"};
    for (int tree = 0; tree < 2; tree++) {
        for (unsigned left_out = 0; left_out < 3; left_out++) { // reflection alone at last
            char *text;
            size_t size, n = 0;
            FILE *to = begin(&text, &size, structures[tree]);
            for (int h = 0; h < GONIO_HALVES; h++) {
                if (left_out == 0 || (left_out == 1 && h != 3) || h == 0) {
                    char numbers[8 * 41 * 41] = "";
                    for (int k = 0; k < (tree ? 1 : 41 * 41); k++) {
                        snprintf(numbers + strlen(numbers), 8, tree ? "{%d}" : "%d ", h + 1);
                    }
                    block(to, "Visible", halves[h].direction,
                          tree ? "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>" : KLEMS("LBNL/Klems Quarter"), numbers);
                    n++;
                }
            }
            const char *path = end(to, &text, &size);
            gonio_model *model = table_of(path);
            for (int h = 0; h < GONIO_HALVES; h++) {
                const bool there = left_out == 0 || (left_out == 1 && h != 3) || h == 0;
                assert_near(at(model, halves[h].theta_i, 10, halves[h].theta_o, 20), there ? h + 1 : 0, 0);
            }
            gonio_samples *s;
            assert_int_equal(gonio_read(path, NULL, &s, NULL, NULL), GONIO_OK);
            assert_int_equal(s->transmission, n > 1);
            assert_int_equal(s->n, n * (tree ? 1 : 41 * 41));
            for (size_t i = 0; i < s->n; i++) {
                assert_near(s->values[i], (int)gonio_pair_half(s->pairs[i]) + 1, 0);
            }
            gonio_samples_free(s);
            gonio_model_free(model);
        }
    }
}

// ---- trees ----

#define TREE "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>"

static gonio_model *tree(const char *structure, const char *numbers) {
    char *text;
    size_t size;
    FILE *to = begin(&text, &size, structure);
    block(to, "Visible", "Reflection Back", TREE, numbers);
    return table_of(end(to, &text, &size));
}

static void a_cell_is_where_it_stands(void **state) {
    (void)state;
    // Four dimensions, a flat grid of side 2, dimension 0 slowest: value = 8 d0 + 4 d1 + 2 d2 + d3.
    gonio_model *flat = tree("TensorTree4", "{0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15}");
    // The same by subtrees, whose lowest bit chooses dimension 0.
    gonio_model *nested =
        tree("TensorTree4", "{{0},{8},{4},{12},{2},{10},{6},{14},{1},{9},{5},{13},{3},{11},{7},{15}}");
    for (int k = 0; k < 16; k++) {
        // The quadrants of the square's first axis lie at +x, of the second at +y; -wi and wo stand in them.
        const double in = (k & 8 ? 1 : -1) * 1.0, in_y = k & 4 ? 1 : -1, out = k & 2 ? 1 : -1, out_y = k & 1 ? 1 : -1;
        const double phi_i = gonio_degrees(atan2(-in_y, -in)), phi_o = gonio_degrees(atan2(out_y, out));
        assert_near(at(flat, 40, phi_i, 70, phi_o), k, 0);
        assert_near(at(nested, 40, phi_i, 70, phi_o), k, 0);
    }
    gonio_model_free(flat);
    gonio_model_free(nested);
}

static void three_dimensions_turn_with_the_light(void **state) {
    (void)state;
    // Dimension 0 is (1 - sin theta_i) / 2: its upper half is never met; here 4 d0 + 2 d1 + d2 at side 2 under it.
    gonio_model *m = tree("TensorTree3", "{{0 1 2 3 4 5 6 7}{0}{10 11 12 13 14 15 16 17}{0}{20 21 22 23 24 25 26 27}{0}"
                                         "{30 31 32 33 34 35 36 37}{0}}");
    assert_true(m->isotropic);
    for (int k = 0; k < 12; k++) {
        // sin 10 deg: .41, sin 60 deg: .07. wo 20 deg beside the mirror direction, which lies at +x: (.93, .31 or .69).
        const double turn = 30 * k;
        assert_near(at(m, 10, turn, 60, turn + 180 - 20), 10 + 4 + 2 + 1, 0);
        assert_near(at(m, 60, turn, 60, turn + 180 - 20), 10 + 0 + 2 + 1, 0);
        assert_near(at(m, 10, turn, 60, turn + 180 + 20), 30 + 4 + 2 + 0, 0);
        assert_near(at(m, 60, turn, 60, turn - 20), 20 + 0 + 0 + 0, 0);
    }
    gonio_model_free(m);
}

// ---- colour ----

static void colour(void **state) {
    (void)state;
    // Grey has X = Y = Z: u', v' = 4/19, 9/19.
    static const char *const klems[3][2] = {{"Visible", "0.2"}, {"CIE-X", "0.2"}, {"CIE-Z", "0.2"}};
    static const char *const trees[3][2] = {{"Visible", "{0.2}"}, {"CIE-u", "{0.210526}"}, {"CIE-v", "{0.473684}"}};
    for (int kind = 0; kind < 2; kind++) {
        char *text;
        size_t size;
        FILE *to = open_memstream(&text, &size);
        fprintf(to,
                "<WindowElement><Optical><Layer><DataDefinition><IncidentDataStructure>%s</IncidentDataStructure>"
                "<AngleBasis><AngleBasisName>Own</AngleBasisName>" RADIANCE_RING("0", "90",
                                                                                 "1") "</AngleBasis></DataDefinition>",
                kind == 0 ? "Columns" : "TensorTree4");
        for (int k = 0; k < 3; k++) {
            const char *const *one = kind == 0 ? klems[k] : trees[k];
            block(to, one[0], "Reflection Back", kind == 0 ? KLEMS("Own") : TREE, one[1]);
        }
        gonio_model *model = table_of(end(to, &text, &size));
        assert_int_equal(model->channels, 3);
        double v[3];
        gonio_model_eval(model, gonio_direction(0.5, 1), gonio_direction(1, 2), v);
        for (int c = 0; c < 3; c++) {
            assert_near(v[c], 0.2, 2e-4);
        }
        gonio_model_free(model);
    }
}

// Radiance turns X, Y, Z to the primaries and the white of its own color.h, where the floor of a scene and the rest from
// the file meet: (1, 0, 0) has the chromaticity of its red, and only equal X, Y and Z are grey.
static void colours_are_radiances_own(void **state) {
    (void)state;
    static const double xy[3][2] = {{0.64, 0.33}, {0.29, 0.60}, {0.15, 0.06}};
    double xyz[3], back[3], sum[3] = {0};
    for (int c = 0; c < 3; c++) {
        const double rgb[3] = {c == 0, c == 1, c == 2};
        gonio_radiance_rgb_to_xyz(rgb, xyz);
        const double all = xyz[0] + xyz[1] + xyz[2];
        assert_near(xyz[0] / all, xy[c][0], 1e-9);
        assert_near(xyz[1] / all, xy[c][1], 1e-9);
        gonio_radiance_xyz_to_rgb(xyz, back);
        for (int k = 0; k < 3; k++) {
            sum[k] += xyz[k];
            assert_near(back[k], rgb[k], 1e-9);
        }
    }
    for (int k = 0; k < 3; k++) {
        assert_near(sum[k], 1, 1e-9);
    }
}

// ---- what is refused ----

static void refused(const char *path, const char *words) {
    gonio_model *model;
    gonio_error error = {.line = -1};
    assert_int_equal(gonio_read_table(path, &model, &error), GONIO_E_INPUT);
    if (strstr(error.message, words) == NULL || error.line < 1) {
        fail_msg("line %lld: %s; expected '%s'", error.line, error.message, words);
    }
}

static void bad_tables(void **state) {
    (void)state;
    static const struct {
        const char *structure, *basis, *numbers, *words;
    } bad[] = {
        {"Columns", KLEMS("LBNL/Klems Full"), "1 2 3", "number 4 of 21025"},
        {"Columns", KLEMS("LBNL/Klems Full"), "1 2 nan", "number 3 of 21025"},
        {"Columns", KLEMS("LBNL/Klems Double"), "1", "neither defined"},
        {"Columns", "", "1", "angle basis ''"},
        {"TensorTree4", TREE, "{1 2 3}", "a grid of 3 numbers"},
        {"TensorTree4", TREE, "{1", "expected a finite number or '}'"},
        {"TensorTree4", TREE, "{1} 2", "expected the end"},
        {"TensorTree3", TREE, "{{1}{2}}", "expected '{'"},
        {"TensorTree3", TREE, "1", "expected '{'"},
        {"TensorTree3", KLEMS("LBNL/Klems Full"), "{1}", "Shirley-Chiu"},
        {"TensorTree3", TREE, "{{{{{{{{{{{{{{{{{{{{{{{{{{1", "more than 16 levels"},
        {"Tensor", TREE, "{1}", "IncidentDataStructure 'Tensor'"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        char *text;
        size_t size;
        FILE *to = begin(&text, &size, bad[k].structure);
        block(to, "Visible", "Reflection Back", bad[k].basis, bad[k].numbers);
        refused(end(to, &text, &size), bad[k].words);
    }
}

// Entities that expand a thousandfold, and files elsewhere, stay what they are: names.
static void entities_are_not_expanded(void **state) {
    (void)state;
    char *text;
    size_t size;
    FILE *to = open_memstream(&text, &size);
    fprintf(to, "<!DOCTYPE WindowElement [<!ENTITY a0 \"1 \"><!ENTITY secret SYSTEM \"file:///etc/passwd\">");
    for (int k = 1; k < 20; k++) {
        fprintf(to, "<!ENTITY a%d \"&a%d;&a%d;&a%d;&a%d;\">", k, k - 1, k - 1, k - 1, k - 1);
    }
    fprintf(to,
            "]><WindowElement><Optical><Layer><DataDefinition><IncidentDataStructure>Columns</IncidentDataStructure>"
            "</DataDefinition>");
    block(to, "Visible", "Reflection Back", KLEMS("LBNL/Klems Quarter"), "&a19;&secret;");
    refused(end(to, &text, &size), "number 1 of 1681");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_patch_is_where_it_stands),
        cmocka_unit_test(samples_are_the_centres),
        cmocka_unit_test(the_side_is_chosen),
        cmocka_unit_test(every_half_is_read),
        cmocka_unit_test(a_cell_is_where_it_stands),
        cmocka_unit_test(three_dimensions_turn_with_the_light),
        cmocka_unit_test(colour),
        cmocka_unit_test(colours_are_radiances_own),
        cmocka_unit_test(bad_tables),
        cmocka_unit_test(entities_are_not_expanded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
