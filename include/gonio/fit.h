// SPDX-License-Identifier: BSD-3-Clause
// Samples -> model. Every method is one registration (fit/method.h); a caller names it and gets a model and a report.
#ifndef GONIO_FIT_H
#define GONIO_FIT_H

#include "gonio/coverage.h"
#include "gonio/export.h"
#include "gonio/metrics.h"
#include "gonio/model.h"
#include "gonio/sample.h"

GONIO_BEGIN

// The domains that values are fitted in. X(identifier, number, name, what it is).
#define GONIO_DOMAIN_TABLE(X)                                                                                          \
    X(LINEAR, 0, "linear", "z itself")                                                                                 \
    X(LOG, 1, "log", "ln(z + eps), eps from the data's noise; asinh(z / eps) for signed data")

#define GONIO_DOMAIN_ENUM(id, number, name, summary) GONIO_##id = number,
typedef enum gonio_domain {
    GONIO_DOMAIN_AUTO = -1, // in options: the method chooses
    GONIO_DOMAIN_TABLE(GONIO_DOMAIN_ENUM)
} gonio_domain;
#undef GONIO_DOMAIN_ENUM
#define GONIO_DOMAIN_COUNT(id, number, name, summary) +1
#define GONIO_DOMAINS (0 GONIO_DOMAIN_TABLE(GONIO_DOMAIN_COUNT)) // how many there are

const char *gonio_domain_name(gonio_domain domain); // "linear" "log"; "auto"
const char *const *gonio_domain_names(void);        // in the enum's order, NULL-terminated; static storage

// The symmetries that a fit may be given. X(identifier, bit, name, what it says).
#define GONIO_SYMMETRY_TABLE(X)                                                                                        \
    X(MIRROR, 0, "mirror", "phi -> -phi of both directions changes nothing")                                           \
    X(RECIPROCITY, 1, "reciprocity", "exchanging the directions changes nothing")

#define GONIO_SYMMETRY_ENUM(id, bit, name, summary) GONIO_SYMMETRY_##id = 1 << bit,
enum {
    GONIO_SYMMETRY_AUTO = -1, // the method chooses
    GONIO_SYMMETRY_TABLE(GONIO_SYMMETRY_ENUM)
};
#undef GONIO_SYMMETRY_ENUM
const char *const *gonio_symmetry_names(void); // of the bits, from the lowest on, NULL-terminated; static storage

// What the residuals of a fit of formulae measure. X(identifier, number, name, what it is).
#define GONIO_LOSS_TABLE(X)                                                                                            \
    X(LINEAR, 0, "linear", "differences of f_r")                                                                       \
    X(RELATIVE, 1, "relative", "differences over the measured value and its noise")                                    \
    X(LOG, 2, "log", "differences of ln(f_r + eps), eps from the data's noise")

#define GONIO_LOSS_ENUM(id, number, name, summary) GONIO_LOSS_##id = number,
typedef enum gonio_loss {
    GONIO_LOSS_AUTO = -1, // in options: the method's
    GONIO_LOSS_TABLE(GONIO_LOSS_ENUM)
} gonio_loss;
#undef GONIO_LOSS_ENUM
#define GONIO_LOSS_COUNT(id, number, name, summary) +1
#define GONIO_LOSSES (0 GONIO_LOSS_TABLE(GONIO_LOSS_COUNT)) // how many there are

const char *const *gonio_loss_names(void); // in the enum's order, NULL-terminated; static storage

// Whose the shapes of formulae are; strengths are each channel's own always.
typedef enum gonio_shapes { GONIO_SHAPES_AUTO = -1, GONIO_SHAPES_SHARED, GONIO_SHAPES_CHANNEL } gonio_shapes;
const char *const *gonio_shapes_names(void); // in the enum's order, NULL-terminated; static storage

const char *const *gonio_grid_names(void);     // angles that tables are grids of; NULL-terminated; static storage
const char *const *gonio_fill_names(void);     // methods that tables are filled by
const char *const *gonio_wavelet_names(void);  // wavelets
const char *const *gonio_distance_names(void); // what the kernel's distances are measured in

#define GONIO_LOBES_AUTO (-1)
#define GONIO_GRID_AUTO (-1)
#define GONIO_NEIGHBOURS_AUTO (-1)
#define GONIO_WAVELET_AUTO (-1)
#define GONIO_DISTANCE_AUTO (-1)
#define GONIO_ORDER_AUTO (-1)
#define GONIO_ORDER_MAX 20
#define GONIO_LEVEL_AUTO (-1)
#define GONIO_LEVEL_MAX 9

// Fits that several fits of the same samples may need: tables are filled from one, and a comparison of many fits it
// once. Not for several threads at once. The caller frees it, after the fits that use it.
typedef struct gonio_fill_store gonio_fill_store;
gonio_fill_store *gonio_fill_store_new(void); // NULL: no memory
void gonio_fill_store_free(gonio_fill_store *store);

// Called now and then by long work; returning false asks it to stop (the call then returns GONIO_E_INTERRUPTED).
typedef bool (*gonio_progress_fn)(void *context, double fraction, const char *what, double error_now);

// What to fit and how. gonio_fit_options_default() first, then change members. fit/options.c has a row for each member
// but the threads, the store and the callback; an option that the method does not have must stay at its default.
typedef struct gonio_fit_options {
    const char *method; // "mba" "cbmba" "lsq" "auto" ...; NULL: the default method
    double hold_out;    // fraction of the unique geometries; 0: none
    int folds;          // >= 2: K-fold instead of one hold-out
    uint64_t seed;
    char prior[256];            // file of a learned prior (gonio/library.h) by which few samples are fitted; empty: none
    size_t max_memory;          // bytes that fitting may take, the samples included; 0: what the machine has free
    int threads;                // 0: all
    gonio_progress_fn progress; // NULL: none
    void *progress_context;
    gonio_fill_store *fill_store; // NULL: none
    // From here on: the methods' own.
    int level;        // 0..9; GONIO_LEVEL_AUTO: chosen by held-out error. cbmba: S of (D,S,C), 6 by default
    double tolerance; // > 0: the smallest level whose held-out RMSE (training without a hold-out) meets it
    gonio_coordinates coordinates;
    gonio_domain domain;
    int symmetry;               // bits GONIO_SYMMETRY_*, or GONIO_SYMMETRY_AUTO
    bool thesis;                // exactly Kameya's form: Nusselt, linear, mirrored samples, no offset
    int diffuse_level;          // D of (D,S,C); -1: 4
    int specular_start;         // level at which the second fit begins, 0 to S; -1: the method's
    double drop_percent;        // C of it; -1: chosen
    const char *storage;        // bricks of "float" "half" "byte", or the thesis' "hash"; NULL: byte
    double lambda;              // least squares: < 0 chosen from training data
    int iterations;             // least squares: 0 default
    double max_error;           // 0: no limit
    size_t max_bytes;           // 0: no limit
    double max_ns, max_seconds; // 0: no limit
    gonio_loss loss;            // formulae, linear bases
    int lobes;                  // formulae: GONIO_LOBES_AUTO, or how many
    gonio_shapes shapes;        // formulae
    int order;                  // linear bases: 0..GONIO_ORDER_MAX, or GONIO_ORDER_AUTO; bvb: degree + 1, 2 to 4
    double points[3];           // bvb: control points along theta_i, theta_o, azimuth; 0: as few as `rate` allows
    double rate;                // bvb: largest error at the table's points over the largest value; 0: the method's
    const char *knots;          // bvb: "adaptive" "dominant" "dominant-mean" ... "ktp" "nktp"; NULL: adaptive
    double table_step;          // bvb: step of its table in degrees; 0: the method's
    int grid;                   // tables: of gonio_grid_names; GONIO_GRID_AUTO: half-angles
    const char *fill;           // tables: of gonio_fill_names, the method that fills them; NULL: auto
    int wavelet;                // wavelet: of gonio_wavelet_names; GONIO_WAVELET_AUTO: cdf53
    int neighbours;             // kernel: how many samples are averaged; GONIO_NEIGHBOURS_AUTO
    int distance;               // kernel: of gonio_distance_names; GONIO_DISTANCE_AUTO
} gonio_fit_options;

// One half of a fit with transmission, fitted by itself by the same method.
typedef struct gonio_half_report {
    size_t samples; // 0: the set has none of it, and the model no such half
    gonio_errors train, held_out;
    char options[256]; // as the whole fit's
} gonio_half_report;

// What was done; the JSON of `gonio fit` is made from it.
typedef struct gonio_fit_report {
    char method[32];
    int level;
    gonio_coordinates coordinates;
    gonio_domain domain;
    size_t samples, control_points, bytes;
    int channels;
    double fit_seconds;    // of the saved model, fitted to all samples
    double fill_seconds;   // within them: of a fit that the store had, by which the model's table was filled
    gonio_errors train;    // the saved model on the samples that it was fitted to
    gonio_errors held_out; // from fits that did not see them; NaN figures and 0 samples without a hold-out
    char options[256];     // method's own choices, for people: "(4,6,95)", "lambda=1e-4"
    char note[512];        // what the user should know: warnings, how the level was chosen
    // Of samples with transmission, by gonio_half; what stands above is of all of them, the method's choices of the
    // first that is there. Of others all are empty.
    gonio_half_report half[GONIO_HALVES];
} gonio_fit_report;

void gonio_fit_options_default(gonio_fit_options *options);
// Fit; the caller frees the model. On failure *out is NULL and nothing leaks.
gonio_status gonio_fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                       gonio_fit_report *report, gonio_error *error);
// Behind the measurement's head, which gonio_fit puts there, model->about tells from then on what was sampled, by which
// method it was fitted and how well.
gonio_status gonio_model_describe(gonio_model *model, const gonio_coverage *coverage, const gonio_fit_report *report,
                                  gonio_error *error);
// The names of the registered methods, NULL-terminated; static storage.
const char *const *gonio_fit_methods(void);

// What the memory of a fit by multilevel B-splines follows from.
typedef struct gonio_fit_size {
    size_t samples;
    int channels, dims, level; // dims: 3 isotropic, 4 not
    bool sigma;                // the samples carry their uncertainties
    bool log;                  // the domain is, or may be, the log's
    bool reciprocal;           // swapped directions are added
    const char *method;        // NULL: the default one
    double hold_out;           // fraction of one held-out part; 0: none
    int threads;               // 0: all
} gonio_fit_size;

// Bytes that the process takes at most, the samples themselves (as gonio_samples keeps them) and the program's own 20
// MB among them. Nothing is allocated.
double gonio_fit_memory(const gonio_fit_size *size);
// GONIO_E_MEMORY where that exceeds the limit in bytes (0: the machine's free memory), with both figures and what would
// fit: a level, or how many samples. gonio_fit and the stream ask it themselves.
gonio_status gonio_fit_check_memory(const gonio_fit_size *size, double limit, gonio_error *error);

// Streaming: samples are added while an acquisition runs; finishing equals the batch fit of the same samples bit for
// bit.
typedef struct gonio_fit_stream gonio_fit_stream;
gonio_status gonio_fit_stream_new(int channels, const char (*channel_names)[32], const gonio_fit_options *options,
                                  gonio_fit_stream **out, gonio_error *error);
gonio_status gonio_fit_stream_add(gonio_fit_stream *stream, const gonio_samples *samples, gonio_error *error);
// The held-out RMSE now: each new sample is predicted before it is added; NaN while there are too few.
double gonio_fit_stream_error(const gonio_fit_stream *stream);
gonio_status gonio_fit_stream_finish(gonio_fit_stream *stream, gonio_model **out, gonio_fit_report *report,
                                     gonio_error *error);
void gonio_fit_stream_free(gonio_fit_stream *stream);

GONIO_END
#endif
