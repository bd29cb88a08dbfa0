// SPDX-License-Identifier: BSD-3-Clause
// What the campaigns share: sessions to begin with, what an undisturbed measure gives, and the judgement of a case.
#ifndef GONIO_TESTS_DURABILITY_CAMPAIGN_H
#define GONIO_TESTS_DURABILITY_CAMPAIGN_H

#include "tests/durability/run.h"
#include "tests/durability/tree.h"

typedef enum outcome {
    OUT_PENDING,
    OUT_SAME,     // the disturbed command itself ended well, with the same samples
    OUT_NAMED,    // it ended with a named error, and what followed gave the same samples
    OUT_DEAD,     // it died or power went, and what followed gave the same samples
    OUT_DETECTED, // damage was told, repaired, and resumed to the same samples
    OUT_REFUSED,  // damage was told, repair refused with its reason, and nothing was touched
    OUT_HARMLESS, // no stored value had changed
    OUT_MISSED,   // the disturbance did not happen
    OUT_FAILED,
    OUTCOMES
} outcome;

typedef struct verdict {
    int outcome;
    double processor_s;
    char story[200];   // what was done to what
    char trouble[500]; // what was wrong
} verdict;

// Sessions to begin with; each made by the program itself, once.
enum { BASE_FINISHED, BASE_HALF, BASE_KILLED, BASE_PLAIN, BASES };

// What an undisturbed measure gives.
typedef struct reference {
    char sha256[80];
    char replayed[BASES][80]; // what a replay of each base gives
    tree_bytes csv[BASES];    // what `samples` writes of each base; data NULL: it has none
    tree_list files[BASES];   // of each base
    int64_t steps, done[BASES];
    int64_t changes; // of the session's folder, by an undisturbed measure
} reference;
extern reference undisturbed;

typedef struct worker {
    runner *run, *second; // second: for two commands at once; started when first asked for
    char root[160];       // of the worker
    char area[200];       // the folder that holds the session and is watched
    char session[220];
    char scratch[200]; // for the harness' own copies
    char bases[160];
    char plan[200];
    const char *program, *shim;
    uint64_t random, salt; // salt: of the campaign, so that equal seeds differ
    verdict *verdict;
    run_result last;
} worker;

// Make the reference and the bases under root; false, with a message, where an undisturbed command fails.
bool campaign_prepare(const char *root, const char *program, const char *shim);
void worker_start(worker *w, const char *root, int number, const char *program, const char *shim);
void worker_stop(worker *w);
runner *worker_second(worker *w); // for a command beside another

// ---- steps of a case ----
void case_begin(worker *w, uint64_t seed); // an empty area
void case_from(worker *w, int base);       // the base, as the session
void case_trouble(worker *w, const char *format, ...) __attribute__((format(printf, 2, 3)));
void case_story(worker *w, const char *format, ...) __attribute__((format(printf, 2, 3)));
bool case_failed(const worker *w);
// A command on the session, its result in w->last; a crash or a hang is trouble. order may be NULL.
enum { DO_MEASURE, DO_RESUME, DO_DOCTOR, DO_REPAIR, DO_COMPRESS, DO_SAMPLES, DO_REPLAY, DO_COMMANDS };
extern const char *const command_names[DO_COMMANDS];
int case_do(worker *w, int command, const shim_order *order);
void case_words(const worker *w, int command, const char *words[SHIM_ARGUMENTS]);
// The same, and no whole frame may be gone afterwards.
int case_do_keeping(worker *w, int command, const shim_order *order);
// Trouble unless the last command's exit status has a meaning: done, or a named error.
void case_named(worker *w, int command);
shim_order case_order(const worker *w, int mode, unsigned kinds);
// Without further disturbance: the session must come to the same samples as an undisturbed measure, and be sound.
// repair: by `doctor --repair` first. began: something was promised already, so that the session must be there.
void case_settle(worker *w, bool repair, bool began);
// Doctor finds it sound, samples and frames are those of the reference.
void case_finished(worker *w);
bool case_same_csv(worker *w, int base); // what `samples` wrote, and that of the sound base

// ---- look.c: the harness' own look at a session, never through the program ----
// How many steps are done, -1 where there is no journal that can be read; *finished: it has results.
int64_t look_done(worker *w, const char *session, bool *finished);
// All stored values as text: every row of every table, pixels of frames, other files. NULL where they
// cannot be read. The caller frees it.
char *look_values(worker *w, const char *session);
void look_difference(const char *a, const char *b, char *text, size_t room); // the first line that differs

// Whether the log differs from the sound session's in what it vouches for: all but the last transaction, by which it
// may lag.
bool look_log_changed(const char *sound, const char *session);
// The first row of the session's content in one text of values that the other lacks; "" where it has all.
void look_missing(const char *before, const char *after, char *text, size_t room);

// ---- the campaigns; each a case of a seed ----
typedef void (*case_fn)(worker *w, uint64_t seed);
typedef struct campaign {
    const char *name, *what;
    case_fn one;
    int full; // how many cases the full campaign has
} campaign;
void case_kill(worker *w, uint64_t seed);
void case_cut_strict(worker *w, uint64_t seed);
void case_cut_ordered(worker *w, uint64_t seed);
void case_enospc(worker *w, uint64_t seed);
void case_eio(worker *w, uint64_t seed);
void case_eintr(worker *w, uint64_t seed);
void case_emfile(worker *w, uint64_t seed);
void case_eacces(worker *w, uint64_t seed);
void case_short(worker *w, uint64_t seed);
void case_damage(worker *w, uint64_t seed);
// Further situations: seed after seed the next one.
void case_situation(worker *w, uint64_t seed);
int situations_count(void);
typedef struct situation {
    const char *name;
    void (*one)(worker *w);
} situation;
extern const situation situations_beside[], situations_around[]; // beside.c, around.c; a NULL name ends each

// ---- damage.c ----
// Damage one file of the session, as the seed says; false: there is nothing to damage. name takes which file.
bool damage_one(worker *w, const char *session, char *name, size_t room);

#endif
