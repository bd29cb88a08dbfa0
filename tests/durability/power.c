// SPDX-License-Identifier: BSD-3-Clause
// Power cuts at any operation of a measure, a resume, a repair or a compression, and again in the resume after it.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/durability/campaign.h"
#include "tests/durability/cuts.h"

// What the session promised before power went: the steps of the newest journal that was synced.
typedef struct promise {
    int64_t done;
    bool finished;
} promise;

static promise promised(worker *w, disk *d, size_t n) {
    char folder[240], session[260];
    promise p;
    snprintf(folder, sizeof folder, "%s/promised", w->scratch);
    snprintf(session, sizeof session, "%s/s", folder);
    tree_remove(folder);
    disk_build(d, disk_synced(d, n, "session.db"), CUT_NOTHING, 0, folder);
    p.done = look_done(w, session, &p.finished);
    tree_remove(folder);
    return p;
}

static void judge_promise(worker *w, const promise *p) {
    bool finished;
    const int64_t done = look_done(w, w->session, &finished);
    if (p->done > 0 && done < 0) {
        case_trouble(w, "the session is lost with %lld steps", (long long)p->done);
    } else if (p->done > 0 && done < p->done) {
        case_trouble(w, "%lld of %lld steps are lost", (long long)(p->done - done), (long long)p->done);
    } else if (p->finished && !finished) {
        case_trouble(w, "the results are lost");
    }
}

// Do the command, then leave the area as a cut in it does; what was promised comes back.
static promise cut_in(worker *w, int command, int model) {
    char what[100];
    const shim_order order = case_order(w, SHIM_TRACE, SHIM_CHANGES);
    disk *d = disk_load(w->area);
    if (case_do(w, command, &order) != 0 || !disk_trace(d, order.trace)) {
        case_trouble(w, "%s ends with %d without a disturbance: %.150s", command_names[command], w->last.status,
                     w->last.message);
        disk_free(d);
        return (promise){0, false};
    }
    const size_t n = tree_below(&w->random, (uint32_t)disk_operations(d) + 1);
    const promise p = promised(w, d, n);
    tree_remove(w->area);
    disk_build(d, n, model, tree_random(&w->random), w->area);
    disk_tell(d, n, what, sizeof what);
    case_story(w, "%s, power cut before operation %zu of %zu (%s)", command_names[command], n, disk_operations(d),
               what);
    disk_free(d);
    return p;
}

static int set_scene(worker *w) {
    char name[120];
    const uint32_t choice = tree_below(&w->random, 10);
    if (choice < 5) {
        return DO_MEASURE;
    }
    case_from(w, choice == 5   ? BASE_HALF
                 : choice == 6 ? BASE_KILLED
                 : choice < 9  ? BASE_PLAIN
                               : (int)tree_below(&w->random, 3));
    if (choice == 9 && damage_one(w, w->session, name, sizeof name)) {
        case_story(w, "damaged in %s; ", name);
    }
    return choice < 7 ? DO_RESUME : choice < 9 ? DO_COMPRESS : DO_REPAIR;
}

static void cut(worker *w, uint64_t seed, int model) {
    bool finished;
    case_begin(w, seed);
    const int command = set_scene(w);
    promise p = cut_in(w, command, model);
    if (case_failed(w)) {
        return;
    }
    if (command != DO_REPAIR) { // a repair takes steps back
        judge_promise(w, &p);
    }
    const bool there = look_done(w, w->session, &finished) > 0;
    if (there && command != DO_REPAIR && case_do_keeping(w, DO_DOCTOR, NULL) != 0) {
        case_trouble(w, "doctor does not find it sound after the cut (%d): %.150s", w->last.status,
                     run_text(&w->last, "detail"));
    }
    if (there && command != DO_REPAIR && !case_failed(w) && tree_chance(&w->random, 4)) {
        case_story(w, "; ");
        p = cut_in(w, DO_RESUME, model);
        judge_promise(w, &p);
    }
    w->verdict->outcome = OUT_DEAD;
    if (!case_failed(w)) {
        case_settle(w, command == DO_REPAIR, there || command != DO_MEASURE);
    }
}

void case_cut_strict(worker *w, uint64_t seed) { cut(w, seed, CUT_STRICT); }
void case_cut_ordered(worker *w, uint64_t seed) { cut(w, seed, CUT_ORDERED); }
