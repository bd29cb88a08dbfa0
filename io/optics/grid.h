// SPDX-License-Identifier: BSD-3-Clause
// What the readers of optics programs' tables share: words of a text, a grid over four angles, colours.
#ifndef GONIO_IO_OPTICS_GRID_H
#define GONIO_IO_OPTICS_GRID_H

#include "io/format.h"

// ---- words: a text as a stream of words, blanks and lines between them ----
typedef struct gonio_words {
    gonio_text text;     // its line is that of the last word
    const char *comment; // what begins a comment that runs to the line's end
    char *rest;
    bool open_end; // as in gonio_read_report
} gonio_words;
gonio_words gonio_words_begin(const gonio_source *source, const char *comment);
// The next word; NULL at the end. It lives as long as the source.
char *gonio_word(gonio_words *words);
// The rest of the line of the last word, which may be empty.
char *gonio_words_line(gonio_words *words);
gonio_status gonio_word_number(gonio_words *words, const char *what, double *value, gonio_error *error);
// The next word must be one of a list, "a|b|c"; *choice tells which (letters of either case).
gonio_status gonio_word_choice(gonio_words *words, const char *what, const char *list, int *choice, gonio_error *error);
// Is the first word of a text that is no comment this one? For recognising.
bool gonio_source_begins(const gonio_source *source, const char *comment, const char *word);

// ---- the grid ----
typedef enum gonio_grid_frame {
    GONIO_GRID_ABSOLUTE, // outgoing theta and azimuth
    // Outgoing polar angle and azimuth about the mirror direction; azimuth 0 towards the normal, counter-clockwise.
    GONIO_GRID_SPECULAR,
    // Rusinkiewicz: the axes are theta_h, phi_h, theta_d, phi_d.
    GONIO_GRID_HALF,
} gonio_grid_frame;
enum { GONIO_GRID_IN_PHI, GONIO_GRID_IN_THETA, GONIO_GRID_OUT_PHI, GONIO_GRID_OUT_THETA, GONIO_GRID_AXES };
typedef struct gonio_grid_axis {
    int n;
    double *deg;
} gonio_grid_axis;
typedef struct gonio_grid {
    gonio_grid_frame frame;
    gonio_grid_axis axis[GONIO_GRID_AXES];
    double light_deg; // added to every incident azimuth
    gonio_half half;  // that the table is of; its angles are those of the half raised in front of the surface
    int channels;
    char (*names)[GONIO_CHANNEL_NAME_MAX];
    bool xyz;       // the channels are X, Y, Z and become r, g, b
    double *values; // [channel][in_phi][in_theta][out_phi][out_theta], f_r in 1/sr; NaN: none
    gonio_negatives policy;
    gonio_read_report report;
    bool first, last; // of writing: of the halves of a file
} gonio_grid;
// The axis' angles: as many numbers, ascending, between two bounds.
gonio_status gonio_grid_axis_read(gonio_grid *grid, int axis, gonio_words *words, const char *what, int n, double low,
                                  double high, gonio_error *error);
// The same after their count.
gonio_status gonio_grid_axis_counted(gonio_grid *grid, int axis, gonio_words *words, const char *what, double low,
                                     double high, gonio_error *error);
// Channels with their names, "r,g,b"; the values once all axes are known (a missing incident azimuth is 0).
gonio_status gonio_grid_channels(gonio_grid *grid, int channels, gonio_error *error);
gonio_status gonio_grid_allocate(gonio_grid *grid, const gonio_words *words, gonio_error *error);
double *gonio_grid_at(gonio_grid *grid, int channel, int in_phi, int in_theta, int out_phi, int out_theta);
// The next number as a value, after the policy on negative ones.
gonio_status gonio_grid_value(gonio_grid *grid, gonio_words *words, double *value, gonio_error *error);
// The pair of a node; false where a direction lies below the horizon.
bool gonio_grid_pair(const gonio_grid *grid, const int at[GONIO_GRID_AXES], gonio_pair *pair);
// Every node above the horizon that has a value in each channel, as samples; frees the grid's arrays in every case.
// status: how reading went so far. *out may be a set of such samples, to which they are added.
gonio_status gonio_grid_end(gonio_grid *grid, gonio_status status, const gonio_source *source, const char *format,
                            gonio_samples **out, gonio_read_report *report, gonio_error *error);

// ---- writing: grid_write.c ----
// The step of the grid's polar angles in degrees; azimuths have twice it, incident azimuths three times.
#define GONIO_OPTION_GRID_STEP                                                                                         \
    { "grid-step", GONIO_FORMAT_COUNT, "DEG", "5", "between a table's polar angles, 1 to 15" }
#define GONIO_GRID_WRITE_MAX_DEG 85 // of polar angles that are written
// A grid over absolute or specular angles with the model's values at its nodes, NaN below the horizon: all channels, or
// X, Y and Z where xyz is set and the model is one of r, g, b. frame, light_deg and xyz are set before. closed:
// azimuths end with 360 deg. The caller frees it with gonio_grid_free, also after a failure.
gonio_status gonio_grid_of_model(gonio_grid *grid, const gonio_model *model, size_t step, bool closed, int threads,
                                 gonio_error *error);
void gonio_grid_free(gonio_grid *grid);
// The whole of a writer whose tables have one channel or X, Y and Z: the model seen so, its grid (head has
// frame and light_deg), and put, which writes it, for each half that is written.
typedef void gonio_grid_put_fn(gonio_grid *grid, const gonio_model *model, FILE *stream);
gonio_status gonio_grid_write_colours(const gonio_grid *head, const gonio_model *model,
                                      const gonio_format_values *values, bool closed, gonio_grid_put_fn *put,
                                      FILE *stream, gonio_write_report *told, gonio_error *error);
// Directional albedo of each of the grid's channels at an incidence of the grid.
void gonio_grid_albedo(const gonio_grid *grid, const gonio_model *model, int in_phi, int in_theta, double *albedo);
// "NAME N" and the angles on the next line.
void gonio_grid_put_axis(const gonio_grid *grid, int axis, const char *name, FILE *stream);
// The node's value, 0 where there is none.
double gonio_grid_written(gonio_grid *grid, int channel, int in_phi, int in_theta, int out_phi, int out_theta);
// What every such writer says: the grid, and what is lost.
void gonio_grid_tell(const gonio_grid *grid, const gonio_model *model, gonio_write_report *told);

// CIE XYZ -> linear sRGB (IEC 61966-2-1); what lies outside its gamut is raised to 0.
void gonio_xyz_to_rgb(const double xyz[3], double rgb[3]);
void gonio_rgb_to_xyz(const double rgb[3], double xyz[3]); // its inverse

#endif
