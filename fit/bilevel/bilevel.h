// SPDX-License-Identifier: BSD-3-Clause
// Making a compressed bi-level model (CBMBA; Kameya 2002, chapter 6).
#ifndef GONIO_FIT_BILEVEL_BILEVEL_H
#define GONIO_FIT_BILEVEL_BILEVEL_H

#include "brdf/kind/bilevel.h"
#include "fit/mba/mba.h"

// Fit levels 0 .. D into *diffuse, and what remains by a second multilevel fit, levels first .. S, into *specular. With
// first = D + 1 their sum is the multilevel fit of levels 0 .. S. The caller releases both.
gonio_status gonio_bilevel_split(const gonio_scatter *scatter, const double *start, int diffuse_level, int first,
                                 int specular_level, int threads, gonio_lattice *diffuse, gonio_lattice *specular,
                                 gonio_error *error);
// Drop the drop_percent % specular control points of least magnitude (largest over the channels) and store the rest.
// Bricks hold 64 points whether they are used or not, so a brick that keeps one point keeps all that it has: less error
// for the same bytes. Release *parts with gonio_bilevel_parts_release unless a model took it over.
gonio_status gonio_bilevel_pack(const gonio_lattice *diffuse, const gonio_lattice *specular, double drop_percent,
                                gonio_storage storage, gonio_bilevel_parts *parts, gonio_error *error);
// The same of the control points that keep[] tells, `kept` of them, zeros among them or not.
gonio_status gonio_bilevel_pack_points(const gonio_lattice *diffuse, const gonio_lattice *specular, const bool *keep,
                                       size_t kept, gonio_storage storage, gonio_bilevel_parts *parts,
                                       gonio_error *error);
// Beyond chapter 6, bricks only, at no byte more: what was dropped comes back as far as the parts that are left can
// hold it. What they leave of the samples is fitted at the diffuse level and added to the diffuse control points; then
// what remains at the specular level alone, added in the bricks; then at the diffuse level once more.
gonio_status gonio_bilevel_correct(gonio_bilevel_parts *parts, const gonio_lattice *specular,
                                   const gonio_scatter *scatter, int threads, gonio_error *error);
// libcmph's minimal perfect hash of n distinct keys, packed; the caller frees *packed.
gonio_status gonio_bilevel_hash(const uint32_t *keys, size_t n, void **packed, size_t *length, gonio_error *error);
// Jenkins' perfect hash of n distinct keys; the caller frees *moves, which the hash borrows.
gonio_status gonio_bilevel_jenkins(const uint32_t *keys, size_t n, gonio_jenkins_hash *hash, unsigned char **moves,
                                   gonio_error *error);

#endif
