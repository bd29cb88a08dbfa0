// SPDX-License-Identifier: BSD-3-Clause
// One situation a seed, in turn.
#include <stdio.h>

#include "tests/durability/campaign.h"

static int count(const situation *list) {
    int n = 0;
    while (list[n].name != NULL) {
        n++;
    }
    return n;
}

int situations_count(void) { return count(situations_beside) + count(situations_around); }

void case_situation(worker *w, uint64_t seed) {
    const int beside = count(situations_beside),
              i = (int)((seed + (uint64_t)situations_count() - 1) % (uint64_t)situations_count());
    const situation *s = i < beside ? &situations_beside[i] : &situations_around[i - beside];
    case_begin(w, seed);
    case_story(w, "%s: ", s->name);
    w->verdict->outcome = OUT_SAME;
    s->one(w);
}
