// SPDX-License-Identifier: BSD-3-Clause
// Two programs at one session, copies of a session that is being written, signals, clocks that jump.
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "tests/durability/campaign.h"

static bool right(const run_result *r) {
    return r->status == 0 && strcmp(run_text(r, "samples_sha256"), undisturbed.sha256) == 0;
}

// Begin a measure, and wait until it is at some place of the seed's choice.
static int64_t begin_measure(worker *w) {
    const char *words[SHIM_ARGUMENTS];
    const shim_order order = case_order(w, SHIM_PASS, SHIM_CHANGES);
    const int64_t at = tree_below(&w->random, (uint32_t)undisturbed.changes);
    case_words(w, DO_MEASURE, words);
    run_begin(w->run, &order, words);
    run_until(w->run, at);
    case_story(w, "at change %lld of %lld", (long long)at, (long long)undisturbed.changes);
    return at;
}

static void end_measure(worker *w) {
    run_free(&w->last);
    run_end(w->run, &w->last);
    if (w->last.hangs || w->last.status < 0) {
        case_trouble(w, "measure ends with %d", w->last.status);
    }
}

static void second(worker *w, int command, run_result *result) {
    const char *words[SHIM_ARGUMENTS];
    case_words(w, command, words);
    run(worker_second(w), NULL, words, result);
    case_story(w, "; beside it %s: %d", command_names[command], result->status);
    if (result->hangs || result->status < 0 ||
        (result->status > 0 && result->message[0] == 0 && result->json == NULL)) {
        case_trouble(w, "%s beside a measure ends with %d '%s'", command_names[command], result->status,
                     result->message);
    }
}

// One writer wins, the other is told so; the session is one of them alone.
static void two_measures(worker *w) {
    run_result other;
    worker_second(w);
    begin_measure(w);
    second(w, DO_MEASURE, &other);
    end_measure(w);
    if (right(&w->last) == right(&other)) {
        case_trouble(w, "two measures into one folder end with %d and %d: %.100s", w->last.status, other.status,
                     other.message);
    }
    run_free(&other);
    case_finished(w);
}

// Commands that write: refused while the measure runs, harmless after it.
static void writer_beside(worker *w) {
    static const int commands[] = {DO_RESUME, DO_REPAIR, DO_COMPRESS};
    run_result other;
    worker_second(w);
    begin_measure(w);
    second(w, commands[tree_below(&w->random, 3)], &other);
    run_free(&other);
    end_measure(w);
    if (!right(&w->last)) { // the other one may have come first; then it went on instead
        case_named(w, DO_MEASURE);
        case_settle(w, false, false);
    } else {
        case_finished(w);
    }
}

// Commands that read, all the time: sound as far as it is, and the measure does not notice.
static void reader_beside(worker *w) {
    static const int commands[] = {DO_DOCTOR, DO_SAMPLES, DO_REPLAY};
    worker_second(w);
    begin_measure(w);
    for (int i = 0; i < 12; i++) {
        const int command = commands[tree_below(&w->random, 3)];
        run_result other;
        const bool during = !run_is_over(w->run);
        second(w, command, &other);
        if (command == DO_DOCTOR && other.status == 1 && during) {
            case_trouble(w, "doctor beside a measure: %.200s", run_text(&other, "detail"));
        }
        run_free(&other);
    }
    end_measure(w);
    if (!right(&w->last)) {
        case_trouble(w, "measure ends with %d beside readers: %.150s", w->last.status, w->last.message);
    }
    case_finished(w);
}

// A copy that somebody makes while the measure runs: frames or rows may be missing in it, and that is told.
static void copied_meanwhile(worker *w) {
    char copy[240], away[240];
    begin_measure(w);
    snprintf(copy, sizeof copy, "%s/copy", w->scratch);
    snprintf(away, sizeof away, "%s/away", w->scratch);
    tree_remove(copy);
    struct stat info;
    const bool there = stat(w->session, &info) == 0;
    if (there) {
        tree_copy_live(w->session, copy);
    }
    end_measure(w);
    tree_remove(w->session);
    if (!there) {
        w->verdict->outcome = OUT_MISSED;
        return;
    }
    tree_copy(copy, w->session);
    bool finished;
    const bool began = look_done(w, w->session, &finished) > 0;
    const int found = case_do_keeping(w, DO_DOCTOR, NULL);
    case_named(w, DO_DOCTOR);
    const int status = case_do_keeping(w, DO_RESUME, NULL);
    case_named(w, DO_RESUME);
    if (status == 0) {
        if (!right(&w->last)) {
            case_trouble(w, "a copy (doctor: %d) resumes to other samples, exit 0", found);
        }
        case_finished(w);
    } else if (began) {
        w->verdict->outcome = OUT_DETECTED;
        case_settle(w, true, true);
    }
}

static void clock_jumps(worker *w) {
    static const int64_t years[] = {-30, -1, 1, 40};
    const bool half = tree_chance(&w->random, 2);
    if (half) {
        case_from(w, BASE_HALF);
    }
    shim_order order = case_order(w, SHIM_PASS, SHIM_CHANGES);
    order.clock_at = 1 + tree_below(&w->random, half ? 100 : (uint32_t)undisturbed.changes);
    order.clock_jump_s = years[tree_below(&w->random, 4)] * 31556952;
    case_story(w, "%lld s at change %lld", (long long)order.clock_jump_s, (long long)order.clock_at);
    case_do_keeping(w, half ? DO_RESUME : DO_MEASURE, &order);
    if (!right(&w->last)) {
        case_trouble(w, "ends with %d: %.150s", w->last.status, w->last.message);
    }
    case_finished(w);
}

// A signal stops at the next checkpoint, with an event and exit status 4.
static void stopped_by(worker *w, int signal) {
    begin_measure(w);
    run_signal(w->run, signal);
    run_free(&w->last);
    run_end(w->run, &w->last);
    case_story(w, ", signal %d: %d", signal, w->last.status);
    const int status = w->last.hangs ? -1000 : w->last.status;
    case_settle(w, false, false);
    if (status != 4 && status != 0) {
        case_trouble(w, "signal %d: measure ends with %d", signal, status);
    }
}

static void interrupted(worker *w) { stopped_by(w, SIGINT); }
static void terminated(worker *w) { stopped_by(w, SIGTERM); }
static void hung_up(worker *w) { stopped_by(w, SIGHUP); }

const situation situations_beside[] = {{"two measures", two_measures},
                                       {"a writer beside a measure", writer_beside},
                                       {"readers beside a measure", reader_beside},
                                       {"copied while it runs", copied_meanwhile},
                                       {"the clock jumps", clock_jumps},
                                       {"interrupted", interrupted},
                                       {"terminated", terminated},
                                       {"hung up", hung_up},
                                       {NULL, NULL}};
