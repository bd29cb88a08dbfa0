// SPDX-License-Identifier: BSD-3-Clause
#define GONIO_TEST_TARGET "avx512f"
#define GONIO_TEST_WIDE
#include "tests/unit/lobe_clones.h"
