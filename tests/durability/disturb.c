// SPDX-License-Identifier: BSD-3-Clause
// Campaigns of commands that die, or whose system calls fail.
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "tests/durability/campaign.h"

// The session that the seed asks for, and the command that is to be disturbed.
static int set_scene(worker *w, bool reads, bool *repairs) {
    char name[120];
    const uint32_t choice = tree_below(&w->random, reads ? 12 : 10);
    *repairs = false;
    if (choice < 4) {
        return DO_MEASURE;
    }
    if (choice < 6) {
        case_from(w, choice == 4 ? BASE_HALF : BASE_KILLED);
        return DO_RESUME;
    }
    if (choice < 8) {
        const int base = (int)tree_below(&w->random, 3);
        case_from(w, base);
        if (damage_one(w, w->session, name, sizeof name)) {
            case_story(w, "damaged in %s; ", name);
        }
        *repairs = true;
        return DO_REPAIR;
    }
    if (choice < 10) {
        case_from(w, BASE_PLAIN);
        return DO_COMPRESS;
    }
    case_from(w, (int)tree_below(&w->random, 3));
    static const int readers[] = {DO_DOCTOR, DO_SAMPLES, DO_REPLAY};
    return readers[tree_below(&w->random, 3)];
}

// How many calls of these kinds the command makes: on a session that is thrown away.
static int64_t count_calls(worker *w, int command, unsigned kinds) {
    char kept[220];
    snprintf(kept, sizeof kept, "%s/kept", w->scratch);
    tree_remove(kept);
    tree_copy(w->area, kept);
    const shim_order order = case_order(w, SHIM_PASS, kinds);
    case_do(w, command, &order);
    const int64_t calls = w->last.calls;
    tree_remove(w->area);
    tree_copy(kept, w->area);
    tree_remove(kept);
    return calls;
}

static void tell_order(worker *w, int command, const shim_order *order, int64_t calls) {
    static const char *const parts[] = {"before", "within", "after"};
    if (order->mode == SHIM_KILL) {
        case_story(w, "%s killed %s", command_names[command], parts[order->part]);
    } else {
        case_story(w, "%s with %s for %lld calls from", command_names[command],
                   order->error != 0 ? strerrorname_np(order->error) : "short transfers", (long long)order->times);
    }
    const char *hit = strstr(w->last.hit, "/area");
    case_story(w, " call %lld of %lld (%.60s)", (long long)order->at, (long long)calls,
               w->last.hits > 0 ? (hit != NULL ? hit + 5 : w->last.hit) : "none");
}

// After the disturbed command: everything goes on to the same end.
static void judge(worker *w, int command, bool repairs, const shim_order *order) {
    const bool killed = order->mode == SHIM_KILL && w->last.hits > 0;
    const int status = w->last.status;
    bool finished;
    w->verdict->outcome = w->last.hits == 0 ? OUT_MISSED : killed ? OUT_DEAD : status == 0 ? OUT_SAME : OUT_NAMED;
    if (!killed) {
        case_named(w, command);
    }
    if ((command == DO_MEASURE || command == DO_RESUME || command == DO_REPLAY) && status == 0 &&
        undisturbed.done[BASE_FINISHED] == look_done(w, w->session, &finished) &&
        strcmp(run_text(&w->last, "samples_sha256"), undisturbed.sha256) != 0) {
        case_trouble(w, "%s gives other samples, exit 0", command_names[command]);
    }
    const int64_t done = look_done(w, w->session, &finished);
    case_settle(w, repairs, command != DO_MEASURE || done > 0);
}

static void disturb(worker *w, uint64_t seed, shim_order *order, bool reads) {
    bool repairs;
    case_begin(w, seed);
    const int command = set_scene(w, reads, &repairs);
    const shim_order plain = *order;
    *order = case_order(w, plain.mode, plain.kinds);
    order->error = plain.error;
    order->times = plain.times;
    order->part = (int)tree_below(&w->random, 3);
    order->random = tree_random(&w->random);
    const int64_t calls = command == DO_MEASURE && order->kinds == SHIM_CHANGES ? undisturbed.changes
                                                                                : count_calls(w, command, order->kinds);
    order->at = 1 + tree_below(&w->random, (uint32_t)(calls > 0 ? calls : 1));
    case_do_keeping(w, command, order);
    tell_order(w, command, order, calls);
    const bool died = order->mode == SHIM_KILL && w->last.hits > 0;
    // A repair that is disturbed, and a resume that is killed again.
    if (order->mode == SHIM_KILL && tree_chance(&w->random, 3) && !case_failed(w)) {
        const int again = repairs ? DO_REPAIR : DO_RESUME;
        order->at = 1 + tree_below(&w->random, (uint32_t)undisturbed.changes);
        order->part = (int)tree_below(&w->random, 3);
        case_do_keeping(w, again, order);
        case_story(w, "; then %s at call %lld", command_names[again], (long long)order->at);
    }
    judge(w, command, repairs, order);
    if (died && !case_failed(w)) {
        w->verdict->outcome = OUT_DEAD;
    }
}

void case_kill(worker *w, uint64_t seed) {
    shim_order order = {.mode = SHIM_KILL, .kinds = SHIM_CHANGES};
    disturb(w, seed, &order, false);
}

// How long an error lasts: once, some calls, or until somebody does something about it.
static int64_t lasting(uint64_t seed) {
    uint64_t random = seed + UINT64_C(0x1234567);
    const uint32_t choice = tree_below(&random, 4);
    return choice < 2 ? 1 : choice == 2 ? 2 + tree_below(&random, 6) : INT32_MAX;
}

static void fail(worker *w, uint64_t seed, int error, unsigned kinds, int64_t times) {
    shim_order order = {.mode = SHIM_FAIL, .kinds = kinds, .error = error, .times = times};
    disturb(w, seed, &order, true);
}

void case_enospc(worker *w, uint64_t seed) {
    fail(w, seed, ENOSPC, SHIM_CREATE | SHIM_WRITE | SHIM_TRUNCATE | SHIM_NAME, lasting(seed));
}
void case_eio(worker *w, uint64_t seed) { fail(w, seed, EIO, SHIM_ALL & ~(unsigned)SHIM_CLOSE, lasting(seed)); }
void case_eintr(worker *w, uint64_t seed) {
    const int64_t times = lasting(seed);
    fail(w, seed, EINTR, SHIM_OPEN | SHIM_CREATE | SHIM_READ | SHIM_WRITE | SHIM_TRUNCATE | SHIM_LOCK,
         times > 8 ? 8 : times);
}
void case_emfile(worker *w, uint64_t seed) { fail(w, seed, EMFILE, SHIM_OPEN | SHIM_CREATE, lasting(seed)); }
void case_eacces(worker *w, uint64_t seed) {
    fail(w, seed, EACCES, SHIM_OPEN | SHIM_CREATE | SHIM_NAME, lasting(seed));
}
void case_short(worker *w, uint64_t seed) { fail(w, seed, 0, SHIM_READ | SHIM_WRITE, lasting(seed)); }
