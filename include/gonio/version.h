// SPDX-License-Identifier: BSD-3-Clause
// The version of Gonio: of this header when a program is compiled, of the library when it runs. The build reads it
// here.
#ifndef GONIO_VERSION_H
#define GONIO_VERSION_H

#include "gonio/export.h"

GONIO_BEGIN

#define GONIO_VERSION_MAJOR 0
#define GONIO_VERSION_MINOR 1
#define GONIO_VERSION_PATCH 0

#define GONIO_VERSION_TEXT_(x) #x
#define GONIO_VERSION_JOIN_(major, minor, patch)                                                                       \
    GONIO_VERSION_TEXT_(major) "." GONIO_VERSION_TEXT_(minor) "." GONIO_VERSION_TEXT_(patch)
// "MAJOR.MINOR.PATCH" as a string literal.
#define GONIO_VERSION GONIO_VERSION_JOIN_(GONIO_VERSION_MAJOR, GONIO_VERSION_MINOR, GONIO_VERSION_PATCH)

// "MAJOR.MINOR.PATCH" of the library that the program runs with; static storage.
const char *gonio_version(void);

GONIO_END
#endif
