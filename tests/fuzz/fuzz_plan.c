// SPDX-License-Identifier: BSD-3-Clause
// Any text as a plan: a preset, or the content of a plan file.
#include <string.h>
#include <strings.h>

#include "gonio/plan.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static bool mentions(const uint8_t *data, size_t size, const char *word) {
    const size_t length = strlen(word);
    for (size_t i = 0; i + length <= size; i++) {
        if (strncasecmp((const char *)data + i, word, length) == 0) {
            return true;
        }
    }
    return false;
}

// furthest: how far thetas may go.
static void try(const char *text, double furthest) {
    gonio_plan *plan;
    gonio_error error = {0};
    const gonio_status status = gonio_plan_make(text, 1, &plan, &error);
    if ((status == GONIO_OK) != (plan != NULL) || (status != GONIO_OK && error.message[0] == 0)) {
        abort();
    }
    for (size_t i = 0; status == GONIO_OK && i < plan->n; i++) {
        const gonio_pair *p = &plan->poses[i];
        if (!(p->theta_i >= 0 && p->theta_i <= furthest && p->theta_o >= 0 && p->theta_o <= furthest)) {
            abort();
        }
    }
    gonio_plan_free(plan);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char text[256];
    // Behind the sample only where that is declared.
    const bool behind = mentions(data, size, "transmission") || mentions(data, size, "back=");
    const double furthest = behind ? GONIO_PI : GONIO_PI / 2;
    const size_t n = size < 40 ? size : 40;
    snprintf(text, sizeof text, "%s%.*s", size % 2 == 0 ? "uniform:" : "nusselt:", (int)n, (const char *)data);
    const double number = strtod(text + 8, NULL);
    if (text[0] == 'u' ? !(number > 0 && number < 4) : !(number > 2e4 && number <= 1e8)) {
        try(text, furthest); // larger plans are allowed, but slow
    }
    try(memory_file(data, size), furthest);
    return 0;
}
