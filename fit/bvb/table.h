// SPDX-License-Identifier: BSD-3-Clause
// Tables for lofting: of samples that lie on a grid, or of a model.
#ifndef GONIO_FIT_BVB_TABLE_H
#define GONIO_FIT_BVB_TABLE_H

#include "brdf/transform.h"
#include "fit/bvb/loft.h"
#include "gonio/sample.h"

// A table of `intervals` equal steps over 90 deg of theta, of steps as wide over the azimuths; isotropic ones have
// three axes. The caller releases it.
gonio_status gonio_bvb_table_init(gonio_bvb_table *table, bool isotropic, int channels, int intervals,
                                  gonio_error *error);
void gonio_bvb_table_release(gonio_bvb_table *table);
// Values of the model, transformed.
void gonio_bvb_table_of_model(gonio_bvb_table *table, const gonio_model *model, gonio_transform_kind kind,
                              const gonio_transform *transforms, int threads);
// Values of the samples, transformed, where they lie on the table's nodes; isotropic samples lie on both sides of the
// plane of incidence, and where a direction is the normal, at every azimuth. Thetas beyond the largest sampled one take
// the values there. false: some node has no sample, and the table is undefined.
bool gonio_bvb_table_of_samples(gonio_bvb_table *table, const gonio_samples *samples, gonio_transform_kind kind,
                                const gonio_transform *transforms);
// The angles of a node.
gonio_pair gonio_bvb_table_pair(const gonio_bvb_table *table, const size_t node[GONIO_BVB_AXES]);

#endif
