// SPDX-License-Identifier: BSD-3-Clause
#define GONIO_TEST_TARGET "sse2"
#include "tests/unit/lobe_clones.h"
