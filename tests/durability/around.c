// SPDX-License-Identifier: BSD-3-Clause
// Where a session lies and what lies in it: moved, on a read-only medium, under strange and long names, with parts that
// are lost or not its own, with little memory.
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/durability/campaign.h"

static int any_base(worker *w) {
    const int base = (int)tree_below(&w->random, BASE_PLAIN);
    case_from(w, base);
    return base;
}

static void moved(worker *w) {
    char kept[220], folder[240];
    any_base(w);
    memcpy(kept, w->session, sizeof kept);
    snprintf(folder, sizeof folder, "%s/elsewhere", w->area);
    mkdir(folder, 0755);
    snprintf(w->session, sizeof w->session, "%.180s/elsewhere/another name", w->area);
    if (rename(kept, w->session) != 0) {
        case_trouble(w, "the harness cannot rename");
    }
    case_settle(w, false, true);
    memcpy(w->session, kept, sizeof kept);
}

// ---- a read-only medium ----

static void readers_on(worker *w, int base) {
    runner_stop(w->run); // one that lives among these mounts
    char root[200];
    snprintf(root, sizeof root, "%s/mounted", w->root);
    mkdir(root, 0755);
    w->run = runner_start(w->program, w->shim, root);
    tree_list before = tree_files(w->area), after;
    if (case_do(w, DO_DOCTOR, NULL) != 0) {
        case_trouble(w, "doctor on a read-only medium: %d %.150s", w->last.status, w->last.message);
    }
    if (case_do(w, DO_SAMPLES, NULL) != 0 || !case_same_csv(w, base)) {
        case_trouble(w, "samples on a read-only medium: %d, %s", w->last.status,
                     w->last.status == 0 ? "others" : w->last.message);
    }
    if (case_do(w, DO_REPLAY, NULL) != 0 ||
        strcmp(run_text(&w->last, "samples_sha256"), undisturbed.replayed[base]) != 0) {
        case_trouble(w, "replay on a read-only medium: %d, %s", w->last.status,
                     w->last.status == 0 ? "others" : w->last.message);
    }
    if (case_do(w, DO_RESUME, NULL) == 0 && base != BASE_FINISHED) {
        case_trouble(w, "resume on a read-only medium goes on");
    }
    case_named(w, DO_RESUME);
    after = tree_files(w->area);
    char lost[200];
    if (after.n != before.n || tree_content_lost(&before, &after, lost, sizeof lost) > 0) {
        case_trouble(w, "a read-only medium has changed");
    }
}

// Mounts of its own need a process of its own; its verdict comes back through memory that both see, the runner's file.
static void read_only(worker *w) {
    const int base = any_base(w);
    char result[220];
    snprintf(result, sizeof result, "%s/verdict", w->root);
    char shm[260];
    snprintf(shm, sizeof shm, "%s/session.db-shm", w->session);
    unlink(shm); // whoever copies a session to a medium
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        if (unshare(CLONE_NEWNS) != 0 || mount("none", "/", NULL, MS_REC | MS_PRIVATE, NULL) != 0 ||
            mount(w->session, w->session, NULL, MS_BIND, NULL) != 0 ||
            mount(NULL, w->session, NULL, MS_BIND | MS_REMOUNT | MS_RDONLY, NULL) != 0) {
            _exit(77);
        }
        readers_on(w, base);
        tree_write(result, w->verdict, sizeof *w->verdict);
        _exit(0);
    }
    int status;
    waitpid(child, &status, 0);
    const tree_bytes told = tree_read(result);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 77) {
        case_story(w, "SKIPPED, no right to mount");
        w->verdict->outcome = OUT_MISSED;
    } else if (told.size == sizeof *w->verdict) {
        memcpy(w->verdict, told.data, told.size);
    } else {
        case_trouble(w, "the harness died (%d)", status);
    }
    free(told.data);
}

// ---- names ----

static void measure_at(worker *w, const char *path, bool may_refuse) {
    char kept[220];
    const char *words[SHIM_ARGUMENTS];
    struct stat info;
    int n = 0;
    case_words(w, DO_MEASURE, words);
    while (words[n] != NULL) {
        n++;
    }
    words[n - 1] = path;
    memcpy(kept, w->session, sizeof kept);
    run_free(&w->last);
    run(w->run, NULL, words, &w->last);
    if (w->last.hangs || w->last.status < 0) {
        case_trouble(w, "measure ends with %d", w->last.status);
    } else if (w->last.status != 0) {
        if (!may_refuse || w->last.message[0] == 0) {
            case_trouble(w, "measure ends with %d: '%.150s'", w->last.status, w->last.message);
        }
        if (lstat(path, &info) == 0) {
            case_trouble(w, "measure refuses (%.100s) and leaves a folder", w->last.message);
        }
        w->verdict->outcome = OUT_REFUSED;
    } else if (strcmp(run_text(&w->last, "samples_sha256"), undisturbed.sha256) != 0) {
        case_trouble(w, "measure prints no JSON, or other samples, exit 0");
    } else {
        const char *const doctor[] = {"doctor", "--json", path, NULL}, *const resume[] = {"resume", "--json", path,
                                                                                          NULL};
        run_free(&w->last);
        run(w->run, NULL, doctor, &w->last);
        const int found = w->last.status;
        run_free(&w->last);
        run(w->run, NULL, resume, &w->last);
        if (found != 0 || w->last.status != 0 || w->last.json == NULL) {
            case_trouble(w, "then doctor ends with %d, resume with %d: %.150s", found, w->last.status, w->last.message);
        }
    }
}

static void utf8_name(worker *w) {
    static const char *const names[] = {"Gl\xc3\xa4nzend wei\xc3\x9f",
                                        "\xe6\xb8\xac\xe5\xae\x9a",
                                        "a b'c\"d\\e",
                                        "\xf0\x9f\x94\xac$HOME",
                                        "-rf",
                                        "line\nbreak",
                                        "%s%n;?#&"};
    char path[300];
    const char *name = names[tree_below(&w->random, sizeof names / sizeof *names)];
    snprintf(path, sizeof path, "%s/%s", w->area, name);
    case_story(w, "'%s'", name);
    measure_at(w, path, false);
}

static void no_utf8_name(worker *w) {
    char path[300];
    snprintf(path, sizeof path, "%s/\xff\xfe\x80", w->area);
    measure_at(w, path, true);
}

// A path of just so many bytes, with the folders that it needs; the last name is the session's.
static void make_path(const char *area, char *path, size_t length) {
    size_t at = strlen(area);
    memcpy(path, area, at + 1);
    while (at < length) {
        size_t name = length - at - 1 < 200 ? length - at - 1 : 200;
        name = length - at - 1 - name == 1 ? name - 1 : name; // no name of no byte
        if (at > strlen(area)) {
            mkdir(path, 0755);
        }
        path[at] = '/';
        memset(path + at + 1, 'p', name);
        at += name + 1;
        path[at] = 0;
    }
}

static void long_path(worker *w) {
    static const size_t lengths[] = {300, 400, 460, 470, 479, 480, 481, 490, 500, 512, 600, 1000, 2000};
    char path[2100];
    const size_t length = lengths[tree_below(&w->random, sizeof lengths / sizeof *lengths)];
    make_path(w->area, path, length);
    case_story(w, "%zu bytes", length);
    measure_at(w, path, length > 480);
    if (w->last.status != 0 && length > 480 && strpbrk(w->last.message, "0123456789") == NULL) {
        case_trouble(w, "the message names no limit: %.150s", w->last.message);
    }
}

// ---- parts ----

static void part(const worker *w, const char *name, char path[300]) { snprintf(path, 300, "%s/%s", w->session, name); }

static bool drop_part(const worker *w, const char *name) {
    char path[300];
    part(w, name, path);
    return unlink(path) == 0;
}

// The journal's file is gone: a new measure keeps the frames, a repair brings the journal back.
static void journal_lost(worker *w) {
    any_base(w);
    drop_part(w, "session.db");
    drop_part(w, "session.db-wal");
    drop_part(w, "session.db-shm");
    if (tree_chance(&w->random, 2)) {
        case_story(w, "then a measure; ");
        if (case_do_keeping(w, DO_MEASURE, NULL) == 0) {
            return; // it has put what lay there aside
        }
        case_named(w, DO_MEASURE);
    }
    case_do_keeping(w, DO_RESUME, NULL);
    case_named(w, DO_RESUME);
    case_settle(w, true, true);
}

// What stands beside the journal is gone: the journal suffices.
static void log_lost(worker *w) {
    static const char *const names[] = {"session.log", "session.head"};
    any_base(w);
    bool dropped = false;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        dropped = drop_part(w, names[i]) || dropped;
    }
    if (!dropped) {
        w->verdict->outcome = OUT_MISSED;
        return;
    }
    case_do_keeping(w, DO_DOCTOR, NULL);
    case_named(w, DO_DOCTOR);
    case_settle(w, true, true);
}

static void frames_away(worker *w, bool symbolic) {
    char frames[300], away[300];
    const int base = any_base(w);
    part(w, "frames", frames);
    snprintf(away, sizeof away, "%s/away", w->area);
    if (rename(frames, away) != 0 || (symbolic ? symlink(away, frames) : mkdir(frames, 0755)) != 0) {
        case_trouble(w, "the harness cannot rename");
    }
    static const int commands[] = {DO_DOCTOR, DO_REPAIR, DO_RESUME, DO_DOCTOR};
    for (int i = 0; i < 4; i++) {
        const int status = case_do_keeping(w, commands[i], NULL);
        case_named(w, commands[i]);
        const bool no_need = commands[i] == DO_RESUME && base == BASE_FINISHED; // its results stand in the journal
        if (status == 0 && !symbolic && !no_need) {
            case_trouble(w, "%s without frames ends with 0", command_names[commands[i]]);
        }
    }
    if (remove(frames) != 0 || rename(away, frames) != 0) {
        case_trouble(w, "frames/ has been filled");
    }
    case_settle(w, false, true);
}

static void not_mounted(worker *w) { frames_away(w, false); }
static void symbolic_link(worker *w) { frames_away(w, true); }

static bool holds(const worker *w, const char *text) {
    const uint64_t wanted = tree_hash(text, strlen(text));
    tree_list list = tree_files(w->area);
    bool found = false;
    for (size_t i = 0; i < list.n; i++) {
        found = found || list.files[i].content == wanted;
    }
    tree_files_free(&list);
    return found;
}

static void own_files(worker *w) {
    static const char notes[] = "the sample was wet\n", picture[] = "not a picture\n";
    char path[300];
    any_base(w);
    part(w, "frames/notes.txt", path);
    tree_write(path, notes, strlen(notes));
    part(w, "frames/mine", path);
    mkdir(path, 0755);
    part(w, "frames/mine/000001-00.png", path);
    tree_write(path, picture, strlen(picture));
    case_do_keeping(w, tree_chance(&w->random, 2) ? DO_REPAIR : DO_DOCTOR, NULL);
    case_named(w, DO_DOCTOR);
    if (case_do_keeping(w, DO_RESUME, NULL) != 0) {
        case_trouble(w, "resume ends with %d: %.150s", w->last.status, w->last.message);
    }
    if (!holds(w, notes) || !holds(w, picture)) {
        case_trouble(w, "a file that is not Gonio's is gone");
    }
}

static void little_memory(worker *w) {
    const int64_t bytes = (int64_t)(250 + tree_below(&w->random, 900)) << 20;
    runner_set(w->run, NULL, bytes);
    case_story(w, "%lld MiB", (long long)(bytes >> 20));
    case_do_keeping(w, DO_MEASURE, NULL);
    runner_set(w->run, NULL, 0);
    case_named(w, DO_MEASURE);
    if (!case_failed(w)) {
        case_settle(w, false, false);
    }
}

// With sync=off a measure asks the disk for next to nothing, and gives the same.
static void not_synced(worker *w) {
    const char *words[SHIM_ARGUMENTS];
    const shim_order order = case_order(w, SHIM_PASS, SHIM_SYNC);
    int n = 0;
    case_do(w, DO_MEASURE, &order);
    const int64_t synced = w->last.calls;
    tree_remove(w->session);
    case_words(w, DO_MEASURE, words);
    while (words[n] != NULL) {
        n++;
    }
    const char *const more[] = {"--set", "sync=off", w->session, NULL};
    memcpy(&words[n - 1], more, sizeof more);
    run_free(&w->last);
    run(w->run, &order, words, &w->last);
    case_story(w, "%lld calls, %lld with sync=off", (long long)synced, (long long)w->last.calls);
    if (strcmp(run_text(&w->last, "samples_sha256"), undisturbed.sha256) != 0 || 3 * w->last.calls > synced) {
        case_trouble(w, "measure with sync=off ends with %d: %.150s", w->last.status, w->last.message);
    }
    case_finished(w);
}

const situation situations_around[] = {{"moved", moved},
                                       {"a read-only medium", read_only},
                                       {"a name", utf8_name},
                                       {"a name that is not UTF-8", no_utf8_name},
                                       {"a long path", long_path},
                                       {"the journal is lost", journal_lost},
                                       {"what stands beside the journal is lost", log_lost},
                                       {"frames/ is not mounted", not_mounted},
                                       {"frames/ is a symbolic link", symbolic_link},
                                       {"files that are not Gonio's", own_files},
                                       {"little memory", little_memory},
                                       {"sync=off", not_synced},
                                       {NULL, NULL}};
