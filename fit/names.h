// SPDX-License-Identifier: BSD-3-Clause
#ifndef GONIO_FIT_NAMES_H
#define GONIO_FIT_NAMES_H

const char *const *gonio_storage_names(void); // of gonio_storage, NULL-terminated

#endif
