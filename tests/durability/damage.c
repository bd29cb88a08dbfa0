// SPDX-License-Identifier: BSD-3-Clause
// Damage to what is stored: bit flips, zeroed and swapped blocks, a cut end. Each is found, or has changed nothing.
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/durability/campaign.h"

// ---- what is damaged, and how ----

typedef struct target {
    const char *what;
    unsigned weight;
} target;
// Kinds of files, as kind_of tells them; a lost frame costs a pose, a lost journal all.
enum { DATABASE, WAL, BESIDE, FRAME, OTHER, KINDS };
static const target targets[KINDS] = {
    {"database", 8}, {"WAL", 4}, {"log or head", 5}, {"frame", 4}, {"model or other", 1}};

static int kind_of(const char *path) {
    if (strcmp(path, "session.db") == 0) {
        return DATABASE;
    }
    if (strcmp(path, "session.db-wal") == 0) {
        return WAL;
    }
    if (strcmp(path, "session.db-shm") == 0) {
        return KINDS; // never read after a crash
    }
    return strncmp(path, "frames/", 7) == 0 ? FRAME : strncmp(path, "session.", 8) == 0 ? BESIDE : OTHER;
}

static const tree_file *choose(worker *w, const tree_list *list) {
    unsigned counts[KINDS + 1] = {0}, sum = 0;
    for (size_t i = 0; i < list->n; i++) {
        counts[kind_of(list->files[i].path)] += list->files[i].size > 0;
    }
    for (int k = 0; k < KINDS; k++) {
        sum += counts[k] > 0 ? targets[k].weight : 0;
    }
    if (sum == 0) {
        return NULL;
    }
    int at = (int)tree_below(&w->random, sum), kind = 0;
    while (counts[kind] == 0 || at >= (int)targets[kind].weight) {
        at -= counts[kind] > 0 ? (int)targets[kind].weight : 0;
        kind++;
    }
    unsigned number = tree_below(&w->random, counts[kind]);
    for (size_t i = 0; i < list->n; i++) {
        if (kind_of(list->files[i].path) == kind && list->files[i].size > 0 && number-- == 0) {
            return &list->files[i];
        }
    }
    return NULL;
}

static void flip(worker *w, tree_bytes *file, char *how, size_t room) {
    const uint32_t n = tree_chance(&w->random, 3) ? 2 + tree_below(&w->random, 4) : 1;
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t at = tree_below(&w->random, (uint32_t)file->size), bit = tree_below(&w->random, 8);
        file->data[at] = (unsigned char)(file->data[at] ^ 1u << bit);
        snprintf(how, room, "bit %u of byte %u%s", bit, at, n > 1 ? " and others" : "");
    }
}

static void change_blocks(worker *w, tree_bytes *file, bool swap, char *how, size_t room) {
    static const uint32_t sizes[] = {512, 4096, 64};
    uint32_t size = sizes[tree_below(&w->random, 3)];
    size = file->size < size ? (uint32_t)file->size : size;
    const uint32_t blocks = (uint32_t)file->size / size;
    unsigned char *a = file->data + (size_t)size * tree_below(&w->random, blocks);
    unsigned char *b = file->data + (size_t)size * tree_below(&w->random, blocks);
    for (uint32_t i = 0; i < size; i++) {
        const unsigned char kept = a[i];
        a[i] = swap ? b[i] : 0;
        b[i] = swap ? kept : b[i];
    }
    snprintf(how, room, swap ? "%u bytes at %td and %td swapped" : "%u bytes at %td zeroed", size, a - file->data,
             b - file->data);
}

bool damage_one(worker *w, const char *session, char *name, size_t room) {
    tree_list list = tree_files(session);
    const tree_file *file = choose(w, &list);
    char path[500], how[100] = "";
    bool changed = false;
    for (int tries = 0; file != NULL && !changed && tries < 20; tries++) {
        snprintf(path, sizeof path, "%s/%s", session, file->path);
        tree_bytes bytes = tree_read(path);
        const uint32_t kind = tree_below(&w->random, 20);
        if (kind < 10) {
            flip(w, &bytes, how, sizeof how);
        } else if (kind < 18) {
            change_blocks(w, &bytes, kind >= 14, how, sizeof how);
        } else {
            bytes.size = tree_below(&w->random, (uint32_t)bytes.size);
            snprintf(how, sizeof how, "cut at byte %zu", bytes.size);
        }
        changed = bytes.size != file->size || tree_hash(bytes.data, bytes.size) != file->content;
        if (changed) {
            tree_write(path, bytes.data, bytes.size);
            snprintf(name, room, "%s (%s)", file->path, how);
        }
        free(bytes.data);
    }
    tree_files_free(&list);
    return changed;
}

// ---- a case ----

typedef struct damaged {
    int base, n;
    bool changed, sound;
    bool frame, model; // what the damage is to: then rows go with it
    char difference[260];
    char kept[240]; // a copy of the damaged session
    char *before;   // the sound session's values
} damaged;

static bool same_text(const char *a, const char *b) { return strcmp(a, b) == 0 && a[0] != 0; }

static void restore(worker *w, const damaged *d) {
    tree_remove(w->area);
    tree_copy(d->kept, w->area);
}

static void make_damage(worker *w, damaged *d) {
    d->base = (int)tree_below(&w->random, BASE_PLAIN);
    d->n = tree_chance(&w->random, 8) ? 2 : 1;
    case_from(w, d->base);
    char sound[240];
    snprintf(sound, sizeof sound, "%s/%d", w->bases, d->base);
    d->before = look_values(w, w->session);
    for (int i = 0; i < d->n; i++) {
        char name[120] = "nothing";
        damage_one(w, w->session, name, sizeof name);
        case_story(w, "%s%s", i > 0 ? ", " : "", name);
        d->frame = d->frame || strncmp(name, "frames/", 7) == 0;
        d->model = d->model || strncmp(name, "model", 5) == 0;
    }
    char *after = look_values(w, w->session);
    d->changed = d->before == NULL || after == NULL || strcmp(d->before, after) != 0;
    if (d->before != NULL && after != NULL && d->changed) {
        look_difference(d->before, after, d->difference, sizeof d->difference);
    } else if (!d->changed && look_log_changed(sound, w->session)) {
        d->changed = true;
        snprintf(d->difference, sizeof d->difference, "session.log is another");
    }
    free(after);
    snprintf(d->kept, sizeof d->kept, "%s/damaged", w->scratch);
    tree_remove(d->kept);
    tree_copy(w->area, d->kept);
}

// Readers give what stands in the sound session, or refuse.
static void judge_readers(worker *w, damaged *d) {
    d->sound = case_do_keeping(w, DO_DOCTOR, NULL) == 0;
    case_named(w, DO_DOCTOR);
    if (d->sound && d->changed) {
        case_trouble(w, "doctor says sound: %s", d->difference[0] != 0 ? d->difference : "the journal cannot be read");
    }
    if (case_do_keeping(w, DO_SAMPLES, NULL) == 0 && !case_same_csv(w, d->base)) {
        case_trouble(w, "samples writes others, exit 0");
    }
    case_named(w, DO_SAMPLES);
    if (case_do_keeping(w, DO_REPLAY, NULL) == 0 &&
        !same_text(run_text(&w->last, "samples_sha256"), undisturbed.replayed[d->base])) {
        case_trouble(w, "replay gives others, exit 0");
    }
    case_named(w, DO_REPLAY);
}

static void judge_resume(worker *w, const damaged *d) {
    const int status = case_do_keeping(w, DO_RESUME, NULL);
    case_named(w, DO_RESUME);
    if (status == 0 && !same_text(run_text(&w->last, "samples_sha256"), undisturbed.sha256)) {
        case_trouble(w, "resume gives other samples, exit 0");
    } else if (status != 0 && d->sound) {
        case_trouble(w, "doctor says sound, resume ends with %d: %.150s", status, w->last.message);
    }
}

static void judge_refusal(worker *w, const damaged *d, const tree_list *before, int status) {
    char lost[200];
    tree_list after = tree_files(w->area);
    case_named(w, DO_REPAIR);
    if (tree_content_lost(before, &after, lost, sizeof lost) > 0) {
        case_trouble(w, "repair refuses (%d) and changes %s", status, lost);
    }
    if (d->n == 1) {
        case_trouble(w, "repair refuses (%d): %.150s", status, w->last.message);
    }
    w->verdict->outcome = OUT_REFUSED;
    tree_files_free(&after);
}

// All that was not damaged itself is there again, and what was damaged is kept as it was found.
static void judge_salvage(worker *w, const damaged *d, const tree_list *found) {
    bool finished;
    char changed[200];
    tree_list list = tree_files(w->area);
    if (tree_content_lost(found, &list, changed, sizeof changed) > 0) {
        case_trouble(w, "repair keeps no %s as it was found", changed);
    }
    tree_files_free(&list);
    char missing[160] = "";
    const int64_t done = look_done(w, w->session, &finished),
                  wanted = undisturbed.done[d->base] - (d->frame ? d->n : 0);
    if (done < wanted && d->n == 1) {
        case_trouble(w, "repair keeps %lld steps; %lld are intact", (long long)done, (long long)wanted);
    }
    char *after = look_values(w, w->session);
    if (!d->frame && !d->model && d->n == 1 && d->before != NULL) {
        look_missing(d->before, after != NULL ? after : "", missing, sizeof missing);
    }
    if (missing[0] != 0) {
        case_trouble(w, "repair loses a row: %s", missing);
    }
    free(after);
}

static void judge_repair(worker *w, const damaged *d) {
    restore(w, d);
    tree_list before = tree_files(w->area);
    const int status = case_do_keeping(w, DO_REPAIR, NULL);
    const bool repaired = status == 0 || (status == 1 && json_is_true(json_object_get(w->last.json, "repaired")));
    if (!repaired) {
        judge_refusal(w, d, &before, status);
    } else if (status == 1) { // it tells that it could not bring everything back
        judge_salvage(w, d, &before);
        judge_resume(w, d);
    } else {
        judge_salvage(w, d, &before);
        if (!case_failed(w)) {
            case_settle(w, false, true);
        }
    }
    tree_files_free(&before);
}

void case_damage(worker *w, uint64_t seed) {
    damaged d = {0};
    case_begin(w, seed);
    make_damage(w, &d);
    judge_readers(w, &d);
    w->verdict->outcome = d.sound ? OUT_HARMLESS : OUT_DETECTED;
    judge_resume(w, &d);
    if (!d.sound) {
        judge_repair(w, &d);
    }
    free(d.before);
}
