// SPDX-License-Identifier: BSD-3-Clause
// The words by which a remark speaks of what could change a value.
#ifndef GONIO_IO_DECLARATION_WORDS_H
#define GONIO_IO_DECLARATION_WORDS_H

#include <stdbool.h>
#include <stddef.h>

// Without case, accents, blanks and the characters that spellings differ by; brackets too where `bare`.
void gonio_declaration_plain(const char *from, size_t length, bool bare, char *to, size_t size);
// What a key speaks of that could change values, units, angles, factors ..., for messages; NULL: of nothing such.
const char *gonio_declaration_key_weight(const char *plain_key);
const char *gonio_declaration_weight(const char *name); // the same of a key as it stands
// The same of a whole remark, without a key that weighs.
const char *gonio_declaration_remark_weight(const char *remark);
// Does the remark say that what was measured went through the sample?
bool gonio_declaration_speaks_of_transmission(const char *remark);

#endif
