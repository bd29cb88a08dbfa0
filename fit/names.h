// SPDX-License-Identifier: BSD-3-Clause
#ifndef GONIO_FIT_NAMES_H
#define GONIO_FIT_NAMES_H

const char *const *gonio_storage_names(void); // of gonio_storage, NULL-terminated
const char *const *gonio_knots_names(void);   // of gonio_knots (fit/bvb/loft.h), NULL-terminated

#endif
