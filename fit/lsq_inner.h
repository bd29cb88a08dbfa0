// A part of a set held out inside the training samples, by which large fits are chosen.
#ifndef GONIO_FIT_LSQ_INNER_H
#define GONIO_FIT_LSQ_INNER_H

#include "fit/lobe_model.h"
#include "fit/lsq_data.h"

#define GONIO_LSQ_CHANNELS_TRIED 3

typedef struct gonio_lsq_inner {
    gonio_lsq_data train, held;
    int which[GONIO_LSQ_CHANNELS_TRIED], channels; // those of the set; more say little more
    double *residuals, *work;                      // held n x channels, held n
} gonio_lsq_inner;

// keep[n]: what is not held out; NULL: a fifth is. Release with gonio_lsq_inner_release.
gonio_status gonio_lsq_inner_init(gonio_lsq_inner *in, const gonio_lsq_data *data, const bool *keep,
                                  gonio_error *error);
void gonio_lsq_inner_release(gonio_lsq_inner *in);
// The base for the channels tried: out->strength is the caller's to free.
gonio_status gonio_lsq_inner_lobes(const gonio_lsq_inner *in, const gonio_lobe_base *lobes, gonio_lobe_base *out,
                                   gonio_error *error);
// Standard normal enough (12 uniforms less 6), the same for the same i.
double gonio_lsq_inner_noise(uint64_t i);

#endif
