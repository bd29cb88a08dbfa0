// SPDX-License-Identifier: BSD-3-Clause
// The steps of a case, and what an undisturbed measure gives.
#include "tests/durability/campaign.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

reference undisturbed;

const char *const command_names[DO_COMMANDS] = {"measure",           "resume",  "doctor", "doctor --repair",
                                                "doctor --compress", "samples", "replay"};

// A measure of everything that a session has, in a twentieth of a second.
static const char plan_text[] =
    "theta_i,phi_i,theta_o,phi_o\n0,0,30,0\n30,0,20,180\n45,0,45,180\n60,0,10,90\n30,0,60,150\n"
    "10,0,70,60\n50,0,40,170\n";
static const char settings[] =
    "scan.dark_frames=4,scan.reference_frames=2,scan.trap_frames=1,sample.region_radius_mm=1,"
    "camera.window=24x24,camera.width=96,camera.height=96";

// ---- a case ----

void case_trouble(worker *w, const char *format, ...) {
    char *text = w->verdict->trouble;
    const size_t used = strlen(text), room = sizeof w->verdict->trouble - used;
    va_list values;
    va_start(values, format);
    if (room > 2) {
        const size_t gap = used > 0 ? 2 : 0;
        memcpy(text + used, "; ", gap);
        vsnprintf(text + used + gap, room - gap, format, values);
    }
    va_end(values);
}

void case_story(worker *w, const char *format, ...) {
    char *text = w->verdict->story;
    const size_t used = strlen(text);
    va_list values;
    va_start(values, format);
    vsnprintf(text + used, sizeof w->verdict->story - used, format, values);
    va_end(values);
}

bool case_failed(const worker *w) { return w->verdict->trouble[0] != 0; }

void case_begin(worker *w, uint64_t seed) {
    w->random = seed * UINT64_C(0x2545f4914f6cdd1d) + w->salt + 1;
    tree_remove(w->area);
    mkdir(w->area, 0755);
}

void case_from(worker *w, int base) {
    static const char *const told[BASES] = {"finished", "half", "half, killed", "finished, not compressed"};
    char path[220];
    snprintf(path, sizeof path, "%s/%d", w->bases, base);
    tree_copy(path, w->session);
    case_story(w, "%s session; ", told[base]);
}

shim_order case_order(const worker *w, int mode, unsigned kinds) {
    shim_order order = {.mode = mode, .kinds = kinds, .times = 1};
    snprintf(order.watched, sizeof order.watched, "%s", w->area);
    snprintf(order.trace, sizeof order.trace, "%s/trace", w->root);
    return order;
}

static int put_words(const char **to, const char *const *words) {
    int n = 0;
    for (; words[n] != NULL; n++) {
        to[n] = words[n];
    }
    to[n] = NULL;
    return n;
}

void case_words(const worker *w, int command, const char *words[SHIM_ARGUMENTS]) {
    static _Thread_local char csv[240];
    snprintf(csv, sizeof csv, "%s/samples.csv", w->root);
    const char *const all[DO_COMMANDS][20] = {{"measure", "--json", "--threads", "2", "--sample",
                                               "ward:rho_d=0.3,rho_s=0.2,alpha=0.3", "--plan", w->plan, "--method",
                                               "ggx", "--hold-out", "0", "--set", settings, w->session},
                                              {"resume", "--json", "--threads", "2", w->session},
                                              {"doctor", "--json", w->session},
                                              {"doctor", "--json", "--repair", w->session},
                                              {"doctor", "--json", "--compress", w->session},
                                              {"samples", w->session, "-o", csv},
                                              {"replay", "--json", "--threads", "2", w->session}};
    put_words(words, all[command]);
}

int case_do(worker *w, int command, const shim_order *order) {
    const char *words[SHIM_ARGUMENTS];
    run_free(&w->last);
    case_words(w, command, words);
    run(w->run, order, words, &w->last);
    if (w->last.hangs) {
        case_trouble(w, "%s hangs", command_names[command]);
    } else if (w->last.status < 0 && !(order != NULL && order->mode == SHIM_KILL && w->last.hits > 0)) {
        case_trouble(w, "%s dies of signal %d", command_names[command], -w->last.status);
    }
    return w->last.status;
}

int case_do_keeping(worker *w, int command, const shim_order *order) {
    char lost[200];
    tree_list before = tree_files(w->area);
    const int status = case_do(w, command, order);
    tree_list after = tree_files(w->area);
    const size_t n = tree_lost(&before, &after, command == DO_COMPRESS, lost, sizeof lost);
    if (n > 0) {
        case_trouble(w, "%s (%d) destroys %zu intact frames: %s", command_names[command], status, n, lost);
    }
    tree_files_free(&before);
    tree_files_free(&after);
    return status;
}

void case_named(worker *w, int command) {
    const int status = w->last.status;
    if (status > 0 && ((status != 1 && status != 3 && status != 4) || w->last.message[0] == 0) &&
        !((command == DO_DOCTOR || command == DO_REPAIR || command == DO_COMPRESS) && status == 1 &&
          w->last.json != NULL)) {
        case_trouble(w, "%s ends with %d and '%s'", command_names[command], status, w->last.message);
    }
}

static void same_pixels(worker *w) {
    char frames[240];
    snprintf(frames, sizeof frames, "%s/frames", w->session);
    tree_list list = tree_files(frames);
    const tree_list *wanted = &undisturbed.files[BASE_FINISHED];
    size_t missing = 0, pictures = 0, files = 0;
    for (size_t i = 0; i < list.n; i++) {
        files += list.files[i].path[0] != '.'; // an old temporary may stay with a session that was finished
    }
    for (size_t i = 0; i < wanted->n; i++) {
        pictures += wanted->files[i].pixels != 0;
        missing += wanted->files[i].pixels != 0 && !tree_has_pixels(&list, wanted->files[i].pixels);
    }
    if (missing > 0 || files != pictures) {
        case_trouble(w, "frames/ holds %zu files, %zu of %zu frames are missing", files, missing, pictures);
    }
    tree_files_free(&list);
}

bool case_same_csv(worker *w, int base) {
    char path[240];
    snprintf(path, sizeof path, "%s/samples.csv", w->root);
    tree_bytes csv = tree_read(path);
    const tree_bytes *wanted = &undisturbed.csv[base];
    const bool same = csv.size == wanted->size && csv.size > 0 && memcmp(csv.data, wanted->data, csv.size) == 0;
    free(csv.data);
    unlink(path);
    return same;
}

void case_finished(worker *w) {
    if (case_do(w, DO_DOCTOR, NULL) != 0) {
        case_trouble(w, "doctor does not find it sound in the end (%d): %.150s", w->last.status,
                     run_text(&w->last, "detail"));
    }
    if (case_do(w, DO_SAMPLES, NULL) != 0 || !case_same_csv(w, BASE_FINISHED)) {
        case_trouble(w, "samples writes others in the end (%d)", w->last.status);
    }
    if (tree_chance(&w->random, 3) &&
        (case_do(w, DO_REPLAY, NULL) != 0 || strcmp(run_text(&w->last, "samples_sha256"), undisturbed.sha256) != 0)) {
        case_trouble(w, "replay gives others in the end (%d)", w->last.status);
    }
    same_pixels(w);
}

void case_settle(worker *w, bool repair, bool began) {
    if (repair && case_do_keeping(w, DO_REPAIR, NULL) != 0) {
        case_trouble(w, "doctor --repair ends with %d: %.150s", w->last.status, w->last.message);
        return;
    }
    int status = case_do_keeping(w, DO_RESUME, NULL);
    if (status != 0 && !began && !case_failed(w)) {
        status = case_do_keeping(w, DO_MEASURE, NULL);
    }
    if (status != 0) {
        case_trouble(w, "cannot go on (%d): %.150s", status, w->last.message);
    } else if (strcmp(run_text(&w->last, "samples_sha256"), undisturbed.sha256) != 0) {
        case_trouble(w, "other samples, exit 0");
    } else {
        case_finished(w);
    }
}

// ---- workers ----

void worker_start(worker *w, const char *root, int number, const char *program, const char *shim) {
    *w = (worker){.program = program, .shim = shim};
    snprintf(w->root, sizeof w->root, "%.100s/worker-%d", root, number);
    snprintf(w->area, sizeof w->area, "%s/area", w->root);
    snprintf(w->session, sizeof w->session, "%s/s", w->area);
    snprintf(w->scratch, sizeof w->scratch, "%s/scratch", w->root);
    snprintf(w->bases, sizeof w->bases, "%.100s/bases", root);
    snprintf(w->plan, sizeof w->plan, "%s/plan.csv", w->root);
    if (mkdir(w->root, 0755) != 0 || mkdir(w->scratch, 0755) != 0) {
        perror(w->root);
        exit(1);
    }
    tree_write(w->plan, plan_text, sizeof plan_text - 1);
    w->run = runner_start(program, shim, w->root);
    if (w->run == NULL) {
        perror("the program does not start");
        exit(1);
    }
}

void worker_stop(worker *w) {
    run_free(&w->last);
    runner_stop(w->run);
    runner_stop(w->second);
    tree_remove(w->root);
}

// ---- what to begin with ----

static void keep_base(worker *w, int base) {
    char path[220];
    bool finished;
    snprintf(path, sizeof path, "%s/%d", w->bases, base);
    tree_copy(w->session, path);
    undisturbed.files[base] = tree_files(path);
    undisturbed.done[base] = look_done(w, path, &finished);
    if (case_do(w, DO_SAMPLES, NULL) == 0) {
        snprintf(path, sizeof path, "%s/samples.csv", w->root);
        undisturbed.csv[base] = tree_read(path);
    }
    if (case_do(w, DO_REPLAY, NULL) == 0) {
        snprintf(undisturbed.replayed[base], sizeof undisturbed.replayed[base], "%s",
                 run_text(&w->last, "samples_sha256"));
    }
}

static bool make_finished(worker *w, int base) {
    case_begin(w, 0);
    shim_order order = case_order(w, SHIM_PASS, SHIM_CHANGES);
    order.plain = base == BASE_PLAIN;
    if (case_do(w, DO_MEASURE, &order) != 0) {
        return false;
    }
    if (base == BASE_FINISHED) {
        snprintf(undisturbed.sha256, sizeof undisturbed.sha256, "%s", run_text(&w->last, "samples_sha256"));
        undisturbed.changes = w->last.calls;
    }
    const bool same = strcmp(run_text(&w->last, "samples_sha256"), undisturbed.sha256) == 0;
    keep_base(w, base);
    return same && undisturbed.sha256[0] != 0 && undisturbed.csv[base].size > 0;
}

// Stopped at 0.7 of its changes: by a full disk, which ends it in order, or killed.
static bool make_half(worker *w, int base) {
    case_begin(w, 0);
    shim_order order = case_order(w, base == BASE_HALF ? SHIM_FAIL : SHIM_KILL, SHIM_CHANGES);
    order.error = ENOSPC;
    order.at = (int64_t)(0.7 * (double)undisturbed.changes);
    order.times = INT32_MAX;
    case_do(w, DO_MEASURE, &order);
    keep_base(w, base);
    return undisturbed.csv[base].size > 0 && undisturbed.done[base] > 1 &&
           undisturbed.done[base] < undisturbed.done[BASE_FINISHED];
}

bool campaign_prepare(const char *root, const char *program, const char *shim) {
    worker w;
    verdict v = {0};
    worker_start(&w, root, 9999, program, shim);
    mkdir(w.bases, 0755);
    w.verdict = &v;
    bool made = make_finished(&w, BASE_FINISHED) && make_finished(&w, BASE_PLAIN);
    for (int base = BASE_HALF; made && base <= BASE_KILLED; base++) {
        made = make_half(&w, base);
    }
    if (!made) {
        fprintf(stderr, "the undisturbed measures failed: %s %s\n", v.trouble, w.last.message);
    }
    worker_stop(&w);
    return made;
}

runner *worker_second(worker *w) {
    char root[220];
    snprintf(root, sizeof root, "%s/second", w->root);
    if (w->second == NULL &&
        (mkdir(root, 0755) != 0 || (w->second = runner_start(w->program, w->shim, root)) == NULL)) {
        perror(root);
        exit(1);
    }
    return w->second;
}
