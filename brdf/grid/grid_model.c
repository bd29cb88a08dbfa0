// SPDX-License-Identifier: BSD-3-Clause
#include "brdf/grid/grid_model.h"

gonio_grid_description gonio_grid_describe(const gonio_grid_model *model) {
    return (gonio_grid_description){.dims = (uint32_t)model->grid.dims,
                                    .level = (uint32_t)model->grid.level,
                                    .system = (uint32_t)model->grid.system,
                                    .transform = (uint32_t)model->channels.kind};
}

gonio_status gonio_grid_model_new(size_t size, const gonio_model_ops *ops, const gonio_grid *grid, int channels,
                                  gonio_transform_kind kind, const gonio_transform *transforms, const char (*names)[32],
                                  void **out, gonio_error *error) {
    const gonio_status status = gonio_channels_new(size, channels, kind, transforms, names, out, error);
    if (status == GONIO_OK) {
        gonio_grid_model *m = *out;
        m->grid = *grid;
        m->channels.head.ops = ops;
        m->channels.head.isotropic = grid->dims == 3;
        m->channels.head.bytes = size + (size_t)channels * sizeof *transforms;
    }
    return status;
}

gonio_status gonio_grid_model_read(const gonio_mapped *mapped, size_t size, const gonio_model_ops *ops, size_t *at,
                                   const gonio_grid_description **about, void **out, gonio_error *error) {
    const gonio_grid_description *d = *about = gonio_mapped_take(mapped, at, sizeof *d);
    if (d == NULL || d->dims != (mapped->isotropic ? 3U : 4U) || d->level > GONIO_GRID_LEVEL_MAX ||
        d->system >= GONIO_GRIDS || d->transform > GONIO_TRANSFORM_POSITIVE) {
        return gonio_mapped_fail(mapped, 0, "a grid of impossible dimensions, level, angles or domain", error);
    }
    const size_t transforms_at = *at, channels = (size_t)mapped->channels;
    const gonio_transform *transforms = gonio_mapped_take(mapped, at, channels * sizeof *transforms);
    if (transforms == NULL) {
        return gonio_mapped_fail(mapped, transforms_at, "fewer transforms than channels", error);
    }
    if (!gonio_scales_possible(&transforms->scale, channels, d->transform != GONIO_TRANSFORM_LINEAR)) {
        return gonio_mapped_fail(mapped, transforms_at, "a channel's scale or eps that no fit makes", error);
    }
    const gonio_grid grid = gonio_grid_of((gonio_grid_system)d->system, (int)d->dims, (int)d->level);
    return gonio_grid_model_new(size, ops, &grid, mapped->channels, (gonio_transform_kind)d->transform, transforms,
                                NULL, out, error);
}
