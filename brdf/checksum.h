// SPDX-License-Identifier: BSD-3-Clause
// A checksum at memory speed. It detects damage, not malice.
//
// Eight independent multiply-and-rotate lanes of 64 bits: a changed bit changes its lane for good, since every step is
// a bijection of the lane.
#ifndef GONIO_BRDF_CHECKSUM_H
#define GONIO_BRDF_CHECKSUM_H

#include <stddef.h>
#include <stdint.h>

typedef struct gonio_checksum {
    uint64_t lane[8];
    uint64_t length;
} gonio_checksum;

gonio_checksum gonio_checksum_begin(void);
// A length that is no multiple of 64 is summed with zeros up to the next one.
void gonio_checksum_add(gonio_checksum *sum, const void *data, size_t length);
uint64_t gonio_checksum_end(const gonio_checksum *sum);

#endif
