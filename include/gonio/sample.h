// SPDX-License-Identifier: BSD-3-Clause
// A set of scattered BRDF samples: what a measurement yields and what a fit consumes.
#ifndef GONIO_SAMPLE_H
#define GONIO_SAMPLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gonio/direction.h"
#include "gonio/export.h"
#include "gonio/status.h"

GONIO_BEGIN

#define GONIO_CHANNELS_MAX 1024
#define GONIO_CHANNEL_NAME_MAX 32

// n samples of `channels` values each. Plain data: read the members freely, change them through the calls below.
// values, sigma and sigma_systematic are n x channels, channel fastest, f_r in 1/sr; the sigmas are standard
// uncertainties (k = 1), NULL where the source has none. sigma_random varies independently from sample to sample;
// sigma_systematic is common to the set (reference scale, alignment) and does not average away. Where sets of several
// sessions were joined, it is common to the samples of one group, and one group's is independent of another's.
typedef struct gonio_samples {
    size_t n, capacity;
    int channels;
    bool isotropic; // geometry depends on phi_o - phi_i only (the set's sample was declared or read as isotropic)
    // Thetas beyond 90 deg are meant: light or camera behind the sample. False: they are an error.
    bool transmission;
    gonio_pair *pairs;
    double *values;
    double *sigma_random;
    double *sigma_systematic;
    char (*channel_names)[GONIO_CHANNEL_NAME_MAX]; // [channels], "r" "g" "b" or "550nm"
    uint16_t *group;                               // [n], from 1 on; NULL: all are of one group
    // What the measurement was: lines "key = value" (docs/formats.md), each with its line feed; NULL: nothing is known.
    // Owned; gonio_samples_tell adds to it.
    char *head;
} gonio_samples;

// A new empty set; the caller frees it with gonio_samples_free. with_sigma: carry both sigma arrays.
gonio_status gonio_samples_new(int channels, bool with_sigma, gonio_samples **out, gonio_error *error);
void gonio_samples_free(gonio_samples *samples); // NULL is allowed
// Copies one sample in; sigmas may be NULL when the set carries none.
gonio_status gonio_samples_add(gonio_samples *samples, const gonio_pair *pair, const double *values,
                               const double *sigma_random, const double *sigma_systematic, gonio_error *error);
// The group of a sample that is there; further ones take that of the sample before them.
gonio_status gonio_samples_set_group(gonio_samples *samples, size_t index, uint16_t group, gonio_error *error);
// Add a line to what is known of the measurement. Line breaks and control characters in it become blanks; an empty
// value says nothing and adds nothing.
gonio_status gonio_samples_tell(gonio_samples *samples, const char *key, const char *value, gonio_error *error);
// The first line of that key in such lines (NULL: none); false, and value "", where there is none. Cut where size is
// less.
bool gonio_head_find(const char *head, const char *key, char *value, size_t size);
gonio_status gonio_samples_reserve(gonio_samples *samples, size_t capacity, gonio_error *error);
// A new set with the samples whose keep[i] is true, in order; the caller frees it.
gonio_status gonio_samples_select(const gonio_samples *samples, const bool *keep, gonio_samples **out,
                                  gonio_error *error);
// A new set with one channel; the caller frees it.
gonio_status gonio_samples_channel(const gonio_samples *samples, int channel, gonio_samples **out, gonio_error *error);
// The halves that the set's samples lie in: bits 1 << gonio_half. Of a set without transmission: reflection's. Samples
// at the horizon, of which nothing tells reflected from transmitted, count where no other sample does.
unsigned gonio_samples_halves(const gonio_samples *samples);
// A new set, without transmission, of one half's samples, their directions raised (gonio_pair_raised) in front of the
// surface; those at the horizon belong to reflection where the set has it from their light's side. The caller frees
// it. With which (may be NULL; n flags): it tells which samples these are.
gonio_status gonio_samples_half(const gonio_samples *samples, gonio_half half, bool *which, gonio_samples **out,
                                gonio_error *error);
// GONIO_E_INPUT, with the first sample at fault, for no samples, thetas outside 0 to 90 deg (180 with transmission; by
// more than rounding, 1e-9 rad), and angles or values that are not finite: what no fit can use.
gonio_status gonio_samples_check(const gonio_samples *samples, gonio_error *error);
// Combined standard uncertainty of one value; 0 where the set carries none.
double gonio_samples_sigma(const gonio_samples *samples, size_t index, int channel);
// The wavelength in nm that a channel's name states ("550nm", "550.5nm"); NaN where it states none ("r").
double gonio_channel_wavelength_nm(const char *name);
double gonio_samples_wavelength_nm(const gonio_samples *samples, int channel);

// Splits are by unique geometry (theta_i, theta_o, phi_o - phi_i and, for anisotropic sets, phi_i), before mirroring:
// equal geometries, and mirror images of each other, always fall on the same side. fold[i] is filled with 0..folds-1;
// deterministic in (geometry, seed), independent of sample order.
gonio_status gonio_samples_folds(const gonio_samples *samples, int folds, uint64_t seed, int *fold, gonio_error *error);
// held[i] = true for about `fraction` of the unique geometries.
gonio_status gonio_samples_hold_out(const gonio_samples *samples, double fraction, uint64_t seed, bool *held,
                                    gonio_error *error);

GONIO_END
#endif
