// SPDX-License-Identifier: BSD-3-Clause
// Kinds of model: the representations of a BRDF that a model file can hold.
//
// A representation joins with one file and one line. The file (brdf/kind/NAME.c) opens with what it computes, the
// derivation and the source; it ends with its registration, `const gonio_kind gonio_kind_NAME`. The line is X(NAME) in
// brdf/kinds.def. Everything that goes over the kinds loops over that list: opening a file, `gonio kinds`,
// docs/kinds.md, the conformance tests (tests/conformance/test_kinds.c, which fails for a kind without a builder in
// make_kind.h) and the test that libgonio-eval alone evaluates each. How a kind is fitted is a matter of its method,
// and so are the fit's options: nothing of fitting stands here.
//
// What a kind may rely on: brdf/ is libgonio-eval, so libc and libm only. Its section of a file is written by
// gonio_model_file_write and read back with gonio_mapped_take (brdf/model_file.h): lengths, indices and enumerations
// are checked before they are used, and so is every number of which there are few (scales, strengths, shapes); control
// points are not looked at, so that mapping takes microseconds. Evaluation takes no lock and allocates nothing.
//
// Models that a file format makes by itself (a MERL or RGL table, kind "measured") have no form as a model file and are
// not in the list: their formats are.
#ifndef GONIO_BRDF_KIND_H
#define GONIO_BRDF_KIND_H

#include "brdf/model_file.h"
#include "gonio/model.h"

#define GONIO_KIND_NAME_MAX 16 // bytes in the file's head, the terminating 0 among them

typedef struct gonio_kind {
    const char *name;    // as the file's head and ops->kind have it
    const char *summary; // one line
    const gonio_model_ops
        *ops; // the fullest of its tables; a model fitted without uncertainty may carry one without sigma
    // A model from its section. On success the model owns *mapped; on failure the caller keeps it.
    gonio_status (*read)(gonio_mapped *mapped, gonio_model **out, gonio_error *error);
} gonio_kind;

// The kinds, ended by a NULL pointer; static storage.
const gonio_kind *const *gonio_kinds(void);
const gonio_kind *gonio_kind_find(const char *name); // NULL: no such kind

#endif
