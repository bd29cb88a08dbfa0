// SPDX-License-Identifier: BSD-3-Clause
// Names and remarks in the letters of any laboratory, made comparable.
#ifndef GONIO_IO_FOLD_H
#define GONIO_IO_FOLD_H

#include <stdbool.h>
#include <stddef.h>

// Lower-case ASCII of UTF-8 text: accents are dropped (a-umlaut is "ae"), Greek letters that stand for angles and
// wavelengths, degree signs, micro signs, superscripts and dashes are spelt; what has no spelling stays. split: a
// blank goes in where a capital follows a small letter, "wavelengthNm". At most size - 1 bytes, and a 0.
void gonio_fold(const char *text, bool split, char *to, size_t size);

#endif
