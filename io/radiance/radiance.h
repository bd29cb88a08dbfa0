// SPDX-License-Identifier: BSD-3-Clause
// What the files of io/radiance/ share: the XML of WINDOW and Radiance, and the two kinds of table in it.
#ifndef GONIO_IO_RADIANCE_H
#define GONIO_IO_RADIANCE_H

#include <libxml/tree.h>

#include "io/format.h"

// One WavelengthData: a table of one quantity for one way through the layer.
typedef struct gonio_radiance_block {
    const xmlNode *node;                     // its WavelengthDataBlock
    const char *quantity;                    // "Visible", "CIE-X", "CIE-u" ...
    const char *direction;                   // "Reflection Back" ...
    const char *column, *row, *basis, *data; // of angles; the numbers
    long long line;                          // where the numbers begin
} gonio_radiance_block;

enum { GONIO_RADIANCE_BLOCKS_MAX = 64 };

typedef struct gonio_radiance_file {
    const char *path;
    xmlDoc *doc;
    const xmlNode *definition; // DataDefinition
    const char *structure;     // "Columns", "Rows", "TensorTree3", "TensorTree4"
    gonio_radiance_block blocks[GONIO_RADIANCE_BLOCKS_MAX];
    int n;
} gonio_radiance_file;

// ---- xml.c ----
// Every text that the file gives is the document's and lives until gonio_radiance_close.
gonio_status gonio_radiance_open(const gonio_source *source, gonio_radiance_file *file, gonio_error *error);
void gonio_radiance_close(gonio_radiance_file *file);
// Child elements by name, whatever their namespace; NULL past the last.
const xmlNode *gonio_radiance_child(const xmlNode *parent, const char *name);
const xmlNode *gonio_radiance_next(const xmlNode *child);
// The text of a child element, blanks around it taken away; "" where there is none.
const char *gonio_radiance_text(const xmlNode *parent, const char *name);
gonio_status gonio_radiance_fail(const gonio_radiance_file *file, long long line, gonio_error *error,
                                 const char *format, ...) __attribute__((format(printf, 4, 5)));
// Numbers of a text, separated by blanks and commas, one after the other: *at moves on, *line counts. False where none
// follows, or one beyond +-1e30.
bool gonio_radiance_number(const char **at, long long *line, double *value);

// ---- colour.c ----
// CIE X, Y, Z of a file and Radiance's r, g, b; what lies outside their gamut is raised to 0. The two arrays do not
// overlap.
void gonio_radiance_rgb_to_xyz(const double rgb[3], double xyz[3]);
void gonio_radiance_xyz_to_rgb(const double xyz[3], double rgb[3]);

// ---- klems.c: matrices over patches of two hemispheres ----
// Rings of a hemisphere; patch 0 is the first ring's first. Patches of a ring are centred at azimuths 2 pi k / n.
enum { GONIO_KLEMS_RINGS_MAX = 64, GONIO_KLEMS_PATCHES_MAX = 4096 };
typedef struct gonio_klems_basis {
    int rings, patches;
    double bound[GONIO_KLEMS_RINGS_MAX + 1]; // theta, rad, ascending from 0 to pi/2
    int n[GONIO_KLEMS_RINGS_MAX], first[GONIO_KLEMS_RINGS_MAX];
} gonio_klems_basis;
typedef struct gonio_klems {
    gonio_klems_basis in, out;
    double *values; // [out patch][in patch], 1/sr
} gonio_klems;
// The caller frees klems->values, also after a failure.
gonio_status gonio_klems_read(const gonio_radiance_file *file, const gonio_radiance_block *block, gonio_klems *klems,
                              gonio_error *error);
double gonio_klems_value(const gonio_klems *klems, gonio_vec3 wi, gonio_vec3 wo);
// The pair of the two patches' centres.
gonio_pair gonio_klems_centre(const gonio_klems *klems, int in, int out);

// One of the bases that WINDOW knows by name; empty for any other name.
void gonio_klems_known(const char *name, gonio_klems_basis *basis);

// ---- tensor_tree.c: a tree of uniform grids over squares ----
typedef struct gonio_tensor_tree {
    int dimensions; // 3 or 4
    int *nodes;     // see tensor_tree.c
    double *values; // 1/sr
    size_t n_nodes, n_values;
} gonio_tensor_tree;
// The caller frees with gonio_tensor_tree_free, also after a failure.
gonio_status gonio_tensor_tree_read(const gonio_radiance_file *file, const gonio_radiance_block *block,
                                    gonio_tensor_tree *tree, gonio_error *error);
void gonio_tensor_tree_free(gonio_tensor_tree *tree);
double gonio_tensor_tree_value(const gonio_tensor_tree *tree, gonio_vec3 wi, gonio_vec3 wo);
// The directions at a place of the square of 3 or 4 dimensions; false where none lies.
bool gonio_tensor_tree_directions(int dimensions, const double at[4], gonio_vec3 *wi, gonio_vec3 *wo);
// Call for the centre of every cell that lies on the hemispheres; false from call ends it.
typedef bool (*gonio_tensor_tree_fn)(void *context, const gonio_pair *pair);
void gonio_tensor_tree_cells(const gonio_tensor_tree *tree, gonio_tensor_tree_fn call, void *context);

// ---- adaptive.c: a tree of the model's values at its cells' centres, which are as small as the model asks for ----
typedef struct gonio_adaptive_options {
    int least_depth, deepest; // halvings of every cell at least, of any at most
    double tolerance;         // relative error times the root of the volume, above which a cell is split
    double dark;              // what an error is relative to at least, the sum over channels
} gonio_adaptive_options;
typedef struct gonio_adaptive_tree gonio_adaptive_tree;
// Of a model of 1 or 3 channels. NULL: no memory, or more than 2^30 nodes.
gonio_adaptive_tree *gonio_adaptive_tree_new(const gonio_model *model, int dimensions,
                                             const gonio_adaptive_options *options, int threads);
void gonio_adaptive_tree_free(gonio_adaptive_tree *tree); // NULL is allowed
// Every cell's values, to be looked at or changed.
void gonio_adaptive_tree_each(gonio_adaptive_tree *tree, void (*call)(void *context, float values[3]), void *context);
// The text of one value of each cell. Of part 0 (Y) cells that agree to 1e-5 are one, of the others to 2e-5.
void gonio_adaptive_tree_put(const gonio_adaptive_tree *tree, int part, FILE *stream);

// ---- radiance.c: the model ----
typedef struct gonio_radiance_model {
    gonio_model head;
    bool is_tree;
    int parts;       // 1: Visible alone; 3: with its colour
    double floor[3]; // f_r of r, g, b that the tables are without
    gonio_klems klems[3];
    gonio_tensor_tree tree[3];
} gonio_radiance_model;

// ---- model.c ----
extern const gonio_model_ops gonio_radiance_ops;
// A model that was read, as one of these; NULL: it is another.
const gonio_radiance_model *gonio_radiance_own(const gonio_model *model);
// A half's name in the file.
const char *gonio_radiance_direction(gonio_half half);

// ---- write.c ----
// A comment of a file of ours: f_r of r, g, b that is to be added everywhere; of other halves than the front reflection
// with the half's name in the file before the numbers.
#define GONIO_RADIANCE_FLOOR "gonio floor r g b"
gonio_status gonio_radiance_write(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                  gonio_write_report *told, gonio_error *error);
extern const gonio_format_option gonio_radiance_write_options[];

#endif
