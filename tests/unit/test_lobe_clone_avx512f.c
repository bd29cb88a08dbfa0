#define GONIO_TEST_TARGET "avx512f"
#include "tests/unit/lobe_clones.h"
