// SPDX-License-Identifier: BSD-3-Clause
#include "gonio/version.h"

const char *gonio_version(void) { return GONIO_VERSION; }
