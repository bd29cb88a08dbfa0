// SPDX-License-Identifier: BSD-3-Clause
// A lab's own table read by a mapping.
#ifndef GONIO_IO_TABLE_H
#define GONIO_IO_TABLE_H

#include "io/table_columns.h"

extern const gonio_format gonio_format_table;

// Where the mirror direction of phi_i = 0 stands, by the values: 0 or 180, in the convention of the samples' phi, or
// -1 where they do not show it. means: of the values within 15 deg of the one and the other; NaN where there are none.
int gonio_mirror_of_samples(const gonio_samples *samples, double means[2]);
// Without azimuths: do the values leave open where it stands, because a retro-reflector's peak may be among them? why:
// in words, and what to say.
bool gonio_mirror_is_open(const gonio_source *source, const gonio_samples *samples, char *why, size_t size);
// May the text be such a table: no format of its own, or one whose header this may be?
bool gonio_table_may_be(const gonio_source *source);

#endif
