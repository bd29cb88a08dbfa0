// SPDX-License-Identifier: BSD-3-Clause
// What a session costs a measure; prints ratios. False where a measure fails.
#ifndef GONIO_TESTS_DURABILITY_COST_H
#define GONIO_TESTS_DURABILITY_COST_H

#include <stdbool.h>

bool cost_tell(const char *program, const char *shim, const char *folder, int pairs);

#endif
