// SPDX-License-Identifier: BSD-3-Clause
// The names of domains, symmetries, storages, losses, shapes and tables.
#include "fit/names.h"

#include "brdf/grid/lifting.h"
#include "brdf/kind/kernel.h"
#include "brdf/spline/sparse.h"
#include "gonio/fit.h"

#define NAME(id, number, name, summary) [number] = name,

const char *const *gonio_domain_names(void) {
    static const char *const names[] = {GONIO_DOMAIN_TABLE(NAME)[GONIO_DOMAINS] = NULL};
    return names;
}

const char *const *gonio_symmetry_names(void) {
    static const char *const names[] = {GONIO_SYMMETRY_TABLE(NAME) NULL};
    return names;
}

const char *const *gonio_storage_names(void) {
    static const char *const names[] = {GONIO_STORAGE_TABLE(NAME)[GONIO_STORAGES] = NULL};
    return names;
}

const char *const *gonio_loss_names(void) {
    static const char *const names[] = {GONIO_LOSS_TABLE(NAME)[GONIO_LOSSES] = NULL};
    return names;
}

const char *const *gonio_shapes_names(void) {
    static const char *const names[] = {[GONIO_SHAPES_SHARED] = "shared", [GONIO_SHAPES_CHANNEL] = "channel", NULL};
    return names;
}

const char *const *gonio_grid_names(void) {
    static const char *const names[] = {GONIO_GRID_TABLE(NAME)[GONIO_GRIDS] = NULL};
    return names;
}

const char *const *gonio_fill_names(void) {
    static const char *const names[] = {"auto", "lsq", "mba", "kernel", NULL};
    return names;
}

const char *const *gonio_wavelet_names(void) {
    static const char *const names[] = {GONIO_WAVELET_TABLE(NAME)[GONIO_WAVELETS] = NULL};
    return names;
}

const char *const *gonio_distance_names(void) {
    static const char *const names[] = {GONIO_DISTANCE_TABLE(NAME)[GONIO_DISTANCES] = NULL};
    return names;
}

const char *gonio_domain_name(gonio_domain domain) {
    return domain == GONIO_DOMAIN_AUTO ? "auto" : gonio_domain_names()[domain];
}
