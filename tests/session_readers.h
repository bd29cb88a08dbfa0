// SPDX-License-Identifier: BSD-3-Clause
// A small finished session, and everything that reads one: for tests of sessions that come from elsewhere.
#ifndef GONIO_TESTS_SESSION_READERS_H
#define GONIO_TESTS_SESSION_READERS_H

#include <sqlite3.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "gonio/acquire.h"
#include "gonio/io.h"
#include "host/acquire/acquire.h"
#include "host/session/info.h"

// Measure with a simulated rig of a tiny camera; more (NULL: none) settings.
static inline gonio_status make_small_session(const char *path, const gonio_rig_file_options *texts,
                                              gonio_error *error) {
    static const char *const settings[] = {
        "camera.width=24,camera.height=24,camera.white_e_per_s=4e6,camera.exposure_max_s=0.06,camera.exposure_min_s="
        "1e-6,sample.region_radius_mm=1,scan.settle_s=0.05,scan.audit_poses=0,scan.trap_frames=2,scan.dark_frames=4,"
        "scan.reference_frames=4"};
    gonio_rig_file_options rig_options = texts != NULL ? *texts : (gonio_rig_file_options){0};
    rig_options.sample = "lambert:rho=0.4";
    rig_options.settings = texts != NULL && texts->n_settings > 0 ? texts->settings : settings;
    rig_options.n_settings = texts != NULL && texts->n_settings > 0 ? texts->n_settings : 1;
    rig_options.seed = 3;
    rig_options.threads = 1;
    gonio_measure_options options;
    gonio_measure_options_default(&options);
    options.plan = "nusselt:3";
    options.fit.method = "mba";
    options.fit.hold_out = 0;
    options.threads = 1;
    gonio_rig_file *rig = NULL;
    gonio_session *session = NULL;
    gonio_outcome outcome = {0};
    gonio_status status = gonio_rig_file_open(&rig_options, &rig, error);
    status = status == GONIO_OK ? gonio_measure_begin(path, rig, &options, &session, error) : status;
    status = status == GONIO_OK ? gonio_measure_run(session, rig, &options, &outcome, error) : status;
    gonio_outcome_free(&outcome);
    gonio_session_close(session);
    gonio_rig_file_close(rig);
    return status;
}

// Run SQL. An UPDATE is not held up by the tables' own constraints: NULL goes anywhere.
static inline bool run_loose_sql(const char *file, const char *text, char message[200]) {
    static const char before[] =
        "PRAGMA synchronous = OFF; PRAGMA journal_mode = DELETE; PRAGMA writable_schema = ON;"
        "CREATE TEMP TABLE kept AS SELECT name, sql FROM sqlite_master WHERE type = 'table';"
        "UPDATE sqlite_master SET sql = replace(sql, ' NOT NULL', ''); PRAGMA writable_schema = RESET";
    static const char after[] =
        "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = (SELECT kept.sql FROM "
        "kept WHERE kept.name = sqlite_master.name) WHERE type = 'table' AND name IN (SELECT name FROM kept)";
    const bool loose = strncmp(text, "UPDATE", 6) == 0;
    const char *const all[] = {loose ? before : "PRAGMA synchronous = OFF; PRAGMA journal_mode = DELETE", text,
                               loose ? after : ""};
    sqlite3 *db;
    bool good = sqlite3_open(file, &db) == SQLITE_OK;
    for (int i = 0; good && i < 3; i++) {
        good = sqlite3_exec(db, all[i], NULL, NULL, NULL) == SQLITE_OK;
    }
    snprintf(message, 200, "%s", good ? "" : sqlite3_errmsg(db));
    sqlite3_close(db);
    return good;
}

// A session of this version as the first version would have it, which has no chain to prove itself.
static inline void make_it_version_1(const char *file) {
    static const char text[] =
        "PRAGMA journal_mode = DELETE; DROP TABLE chain; DROP TABLE hosts; PRAGMA user_version = 1;"
        "ALTER TABLE steps DROP COLUMN utc; ALTER TABLE frames DROP COLUMN utc;"
        "ALTER TABLE frames DROP COLUMN monotonic_s; ALTER TABLE frames DROP COLUMN bytes";
    sqlite3 *db;
    if (sqlite3_open(file, &db) != SQLITE_OK || sqlite3_exec(db, text, NULL, NULL, NULL) != SQLITE_OK) {
        abort();
    }
    sqlite3_close(db);
}

// What was read, so that two readings can be held together; not a checksum of quality.
static inline void digest_bytes(uint64_t *digest, const void *bytes, size_t n) {
    for (size_t i = 0; i < n; i++) {
        *digest = (*digest ^ ((const unsigned char *)bytes)[i]) * 1099511628211u;
    }
}

static inline gonio_status read_settings(gonio_session *session, uint64_t *digest, gonio_error *error) {
    static const char *const keys[] = {"gonio.version",
                                       "plan",
                                       "rig.driver",
                                       "rig.ini",
                                       "rig.settings",
                                       "sim.settings",
                                       "sim.seed",
                                       "sim.spec",
                                       "camera.bits",
                                       "samples.channels",
                                       "samples.isotropic",
                                       "model",
                                       "camera",
                                       "result.model_sha256"};
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < sizeof keys / sizeof *keys; i++) {
        char *value;
        status = gonio_session_find(session, keys[i], &value, error);
        digest_bytes(digest, value != NULL ? value : "-", value != NULL ? strlen(value) : 1);
        free(value);
    }
    if (status == GONIO_OK) {
        gonio_setup setup;
        status = gonio_setup_get(session, &setup, error);
    }
    return status;
}

static inline gonio_status read_step(gonio_session *session, const gonio_step *step, uint64_t *digest,
                                     gonio_error *error) {
    gonio_exposure *exposures;
    int n;
    gonio_samples *samples = NULL;
    digest_bytes(digest, &step->pose, sizeof step->pose);
    digest_bytes(digest, &step->kind, sizeof step->kind);
    gonio_status status = gonio_session_exposures(session, step->index, &exposures, &n, error);
    for (int i = 0; status == GONIO_OK && i < n; i++) {
        const gonio_frame *f = &exposures[i].frame;
        digest_bytes(digest, &f->exposure_s, sizeof f->exposure_s);
        digest_bytes(digest, f->pixels, (size_t)f->window.width * (size_t)f->window.height * sizeof *f->pixels);
    }
    gonio_exposures_free(exposures, n);
    status = status == GONIO_OK ? gonio_session_step_samples(session, step->index, &samples, error) : status;
    gonio_samples_free(samples);
    return status;
}

static inline gonio_status read_steps(gonio_session *session, uint64_t *digest, gonio_error *error) {
    gonio_step *steps;
    size_t n;
    gonio_status status = gonio_session_steps(session, &steps, &n, error);
    for (size_t i = 0; status == GONIO_OK && i < n; i++) {
        status = read_step(session, &steps[i], digest, error);
    }
    free(steps);
    return status;
}

static inline gonio_status read_sets(gonio_session *session, uint64_t *digest, gonio_error *error) {
    gonio_samples *sets[2] = {NULL, NULL};
    bool final = false;
    double monitor = 0;
    char *events = NULL;
    gonio_status status = gonio_session_samples(session, &sets[0], error);
    status = status == GONIO_OK ? gonio_session_final_samples(session, &sets[1], &final, error) : status;
    for (int i = 0; status == GONIO_OK && i < 2; i++) {
        digest_bytes(digest, sets[i]->values, sets[i]->n * (size_t)sets[i]->channels * sizeof(double));
    }
    status = status == GONIO_OK ? gonio_session_monitor(session, &monitor, error) : status;
    status = status == GONIO_OK ? gonio_session_events(session, &events, error) : status;
    gonio_samples_free(sets[0]);
    gonio_samples_free(sets[1]);
    free(events);
    return status;
}

// What a replay reads: setup, calibration and every pose's frames.
static inline gonio_status read_as_replay(gonio_session *session, uint64_t *digest, gonio_error *error) {
    gonio_process process = {0};
    gonio_samples **sets = NULL;
    gonio_step_radiance *radiance = NULL;
    bool ready = false;
    gonio_status status = gonio_process_begin(session, &process, error);
    status = status == GONIO_OK ? gonio_process_prepare(session, &process, NULL, NULL, 0, &ready, error) : status;
    if (status == GONIO_OK && ready) {
        status = gonio_process_samples(session, &process, false, 1, NULL, NULL, &sets, &radiance, error);
    }
    for (size_t i = 0; status == GONIO_OK && sets != NULL && i < process.n; i++) {
        if (sets[i] != NULL && sets[i]->n > 0) {
            digest_bytes(digest, sets[i]->values, sizeof(double));
        }
    }
    gonio_sets_free(sets, process.n);
    free(radiance);
    gonio_process_end(&process);
    return status;
}

// What a replay holds its stages against, and what the session tells of itself.
static inline gonio_status read_stages(gonio_session *session, uint64_t *digest, gonio_error *error) {
    static const gonio_stage stages[] = {GONIO_STAGE_FRAMES, GONIO_STAGE_RADIANCE, GONIO_STAGE_SAMPLES};
    gonio_step *steps;
    size_t n;
    char hex[GONIO_SHA256_HEX];
    gonio_status status = gonio_session_steps(session, &steps, &n, error);
    for (size_t i = 0; status == GONIO_OK && i < n; i++) {
        gonio_step_radiance radiance;
        status = gonio_session_radiance(session, steps[i].index, &radiance, error);
        digest_bytes(digest, radiance.mean, (size_t)radiance.channels * sizeof(double));
    }
    free(steps);
    for (size_t k = 0; status == GONIO_OK && k < sizeof stages / sizeof *stages; k++) {
        status = gonio_session_stage_hash(session, stages[k], hex, error);
        digest_bytes(digest, hex, strlen(hex));
    }
    return status;
}

static inline gonio_status read_info(gonio_session *session, uint64_t *digest, gonio_error *error) {
    json_t *info = NULL;
    const gonio_status status = gonio_session_info(session, &info, error);
    const json_int_t files = (json_int_t)json_array_size(json_object_get(info, "files"));
    digest_bytes(digest, &files, sizeof files);
    json_decref(info);
    return status;
}

// Every reader, each whatever the others say; the first failure, its reason, and a digest of what was read.
static inline gonio_status read_everything(const char *path, uint64_t *digest, gonio_error *error) {
    static gonio_status (*const readers[])(gonio_session *, uint64_t *, gonio_error *) = {
        read_steps, read_settings, read_sets, read_stages, read_info, read_as_replay};
    gonio_session *session;
    gonio_doctor_report report;
    gonio_error why = {0};
    *digest = 14695981039346656037u;
    gonio_status status = gonio_session_open(path, false, &session, error);
    for (size_t i = 0; session != NULL && i < sizeof readers / sizeof *readers; i++) {
        const gonio_status one = readers[i](session, digest, &why);
        if (status == GONIO_OK && one != GONIO_OK) {
            status = one;
            *error = why;
        }
    }
    gonio_session_close(session);
    const gonio_status doctor = gonio_session_doctor(path, false, &report, &why);
    if (status == GONIO_OK && doctor != GONIO_OK) {
        status = doctor;
        *error = why;
    }
    return status;
}

#endif
