// Samples -> model. Every method is one registration (fit/method.h); a caller names it and gets a model and a report.
#ifndef GONIO_FIT_H
#define GONIO_FIT_H

#include "gonio/metrics.h"
#include "gonio/model.h"
#include "gonio/sample.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum gonio_domain {
    GONIO_LINEAR = 0, // z itself
    GONIO_LOG = 1,    // log(z + eps), eps from the data's noise; asinh for signed data
} gonio_domain;

#define GONIO_LEVEL_AUTO (-1)
#define GONIO_LEVEL_MAX 9

// Called now and then by long work; returning false asks it to stop (the call then returns GONIO_E_INTERRUPTED).
typedef bool (*gonio_progress_fn)(void *context, double fraction, const char *what, double error_now);

// What to fit and how. gonio_fit_options_default() first, then change members.
typedef struct gonio_fit_options {
    const char *method; // "mba" "cbmba" "lsq" "auto" ...; NULL: the default method
    int level;          // 0..9, GONIO_LEVEL_AUTO: chosen by held-out error
    double tolerance;   // > 0: the smallest level whose held-out RMSE (training without a hold-out) meets it
    gonio_coordinates coordinates;
    bool coordinates_set; // false: the method chooses
    gonio_domain domain;
    bool domain_set; // false: the method chooses
    bool thesis;     // exactly Kameya's form: Nusselt, linear, mirrored samples, no offset
    double hold_out; // fraction of the unique geometries; 0: none
    int folds;       // >= 2: K-fold instead of one hold-out
    uint64_t seed;
    int threads;                       // 0: all
    int diffuse_level, specular_level; // CBMBA (D,S,C)
    double drop_percent;
    const char *storage;        // CBMBA: bricks of "float" "half" "byte", or the thesis' "hash"; NULL: byte
    double max_error;           // 0: no limit
    size_t max_bytes;           // 0: no limit
    size_t max_memory;          // bytes that fitting may take, the samples included; 0: what the machine has free
    double max_ns, max_seconds; // 0: no limit
    double lambda;              // least squares: < 0 chosen from training data
    int iterations;             // least squares: 0 default
    int symmetry;               // bits GONIO_SYMMETRY_*; GONIO_SYMMETRY_AUTO: the method chooses
    gonio_progress_fn progress; // NULL: none
    void *progress_context;
} gonio_fit_options;

#define GONIO_SYMMETRY_AUTO (-1)
#define GONIO_SYMMETRY_MIRROR 1
#define GONIO_SYMMETRY_RECIPROCITY 2

// What was done; the JSON of `gonio fit` is made from it.
typedef struct gonio_fit_report {
    char method[32];
    int level;
    gonio_coordinates coordinates;
    gonio_domain domain;
    size_t samples, control_points, bytes;
    int channels;
    double fit_seconds;    // of the saved model, fitted to all samples
    gonio_errors train;    // the saved model on the samples that it was fitted to
    gonio_errors held_out; // from fits that did not see them; NaN figures and 0 samples without a hold-out
    char options[256];     // method's own choices, for people: "(4,6,95)", "lambda=1e-4"
    char note[512];        // what the user should know: warnings, how the level was chosen
} gonio_fit_report;

void gonio_fit_options_default(gonio_fit_options *options);
// Fit; the caller frees the model. On failure *out is NULL and nothing leaks.
gonio_status gonio_fit(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                       gonio_fit_report *report, gonio_error *error);
// The names of the registered methods, NULL-terminated; static storage.
const char *const *gonio_fit_methods(void);

// What the memory of a fit by multilevel B-splines follows from.
typedef struct gonio_fit_size {
    size_t samples;
    int channels, dims, level; // dims: 3 isotropic, 4 not
    bool sigma;                // the samples carry their uncertainties
    bool log;                  // the domain is, or may be, the log's
    bool reciprocal;           // swapped directions are added
    bool bilevel;              // cbmba; level is then S
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

#ifdef __cplusplus
}
#endif
#endif
