// SPDX-License-Identifier: BSD-3-Clause
// gonio doctor: what a session is, and whether all of it is sound.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/acquire/acquire.h"
#include "host/cli/cli.h"

static int run(int argc, char **argv);
const cli_verb cmd_doctor = {
    "doctor", "SESSION [--repair] [--compress]",
    "verify a session's every checksum and change nothing; --repair makes a session of all that is intact", run};

static const char *const shown[] = {"gonio.version",         "rig.driver",         "sim.spec", "sim.seed", "plan",
                                    "result.samples_sha256", "result.model_sha256"};
#define SHOWN (sizeof shown / sizeof *shown)

static json_t *describe(const char *path) {
    json_t *object = json_object();
    gonio_session *session;
    if (gonio_session_open(path, false, &session, NULL) != GONIO_OK) {
        return object; // the report says why
    }
    for (size_t i = 0; i < SHOWN; i++) {
        char *value;
        if (gonio_session_get(session, shown[i], &value, NULL) == GONIO_OK) {
            json_object_set_new(object, shown[i], json_string(value));
            free(value);
        }
    }
    gonio_setup setup;
    if (gonio_setup_get(session, &setup, NULL) == GONIO_OK) {
        const gonio_rig_facts *f = &setup.facts;
        const char *const texts[][2] = {
            {"operator", f->operator_name}, {"sample_id", f->sample_id},   {"notes", f->notes},
            {"serials", f->serials},        {"camera", setup.camera.name}, {"camera_serial", setup.camera.serial}};
        for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
            json_object_set_new(object, texts[i][0], json_string(texts[i][1]));
        }
    }
    char *events;
    if (gonio_session_events(session, &events, NULL) == GONIO_OK) {
        json_object_set_new(object, "events", json_string(events));
        free(events);
    }
    gonio_session_close(session);
    return object;
}

static void print_repair(const char *path, const gonio_doctor_report *r) {
    if (!r->repaired) {
        printf("repair     there is nothing to repair\n");
        return;
    }
    if (r->damaged_path[0] != 0) {
        printf("repaired   %lld files linked, %lld copied; the session as it was is %s\n", (long long)r->files_linked,
               (long long)r->files_copied, r->damaged_path);
    }
    if (r->files_aside > 0) {
        printf("set aside  %lld files: %s/lost+found/LIST\n", (long long)r->files_aside, path);
    }
    if (r->steps_lost > 0) {
        printf("undone     %lld steps are to be measured again; `gonio resume` does it\n", (long long)r->steps_lost);
    }
    if (r->steps_missing > 0 || r->rows_lost > 0) {
        printf("LOST       what the journal has lost is named above; it cannot be restored\n");
    }
}

static void print(const char *path, const gonio_doctor_report *r, bool repair, json_t *about) {
    printf("session    %s\n", cli_text(path));
    const char *key;
    json_t *value;
    json_object_foreach(about, key, value) {
        if (strcmp(key, "events") != 0 && json_string_length(value) > 0) {
            printf("%-10s %s\n", key, cli_text(json_string_value(value)));
        }
    }
    printf("database   %s\n", r->database_ok ? "sound" : "DAMAGED");
    printf("steps      %lld, %lld done%s\n", (long long)r->steps, (long long)r->steps_done,
           r->steps_done < r->steps ? "; `gonio resume` goes on" : "");
    printf("frames     %lld, %lld bad, %lld unreadable\n", (long long)r->frames, (long long)r->frames_bad,
           (long long)r->frames_unreadable);
    printf("samples    of %lld steps bad\nresults    %s\n", (long long)r->samples_bad, r->results_ok ? "sound" : "BAD");
    if (r->flagged > 0) {
        printf("flagged    %lld steps since the last good audit of the stage; `gonio resume` audits them\n",
               (long long)r->flagged);
    }
    if (r->strays > 0) {
        printf("strays     %lld files; `gonio doctor --repair` moves them to lost+found/\n", (long long)r->strays);
    }
    cli_print_lines(r->detail);
    if (r->findings_cut > 0) {
        printf("... and %lld findings more\n", (long long)r->findings_cut);
    }
    const char *events = json_string_value(json_object_get(about, "events"));
    printf("events\n");
    cli_print_lines(events != NULL ? events : "");
    if (repair) {
        print_repair(path, r);
    } else if (!gonio_doctor_sound(r)) {
        printf("%lld steps are lost; `gonio doctor --repair` salvages the rest\n", (long long)r->steps_lost);
    }
}

static json_t *to_json(const char *path, const gonio_doctor_report *r) {
    const struct {
        const char *name;
        int64_t value;
    } counts[] = {
        {"steps", r->steps},
        {"steps_done", r->steps_done},
        {"steps_lost", r->steps_lost},
        {"steps_missing", r->steps_missing},
        {"rows_lost", r->rows_lost},
        {"frames", r->frames},
        {"frames_bad", r->frames_bad},
        {"frames_unreadable", r->frames_unreadable},
        {"samples_bad", r->samples_bad},
        {"strays", r->strays},
        {"foreign", r->foreign},
        {"flagged", r->flagged},
        {"files_linked", r->files_linked},
        {"files_copied", r->files_copied},
        {"files_aside", r->files_aside},
        {"findings", r->findings},
    };
    json_t *object = json_pack("{s:s,s:b,s:b,s:b,s:b,s:s,s:o}", "session", path, "sound", gonio_doctor_sound(r),
                               "repaired", r->repaired, "database_ok", r->database_ok, "results_ok", r->results_ok,
                               "detail", r->detail, "damaged_path", cli_json_text(r->damaged_path));
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        json_object_set_new(object, counts[i].name, json_integer((json_int_t)counts[i].value));
    }
    return object;
}

// What is not as it was stored, or cannot be brought back.
static bool is_well(const gonio_doctor_report *r, bool repair) {
    return repair ? r->steps_missing == 0 && r->rows_lost == 0 : gonio_doctor_sound(r);
}

// Refused or failed: what was found is worth telling all the same.
static int fail_doctor(const cli_common *common, const char *path, const gonio_doctor_report *r,
                       const gonio_error *error) {
    cli_common plain = *common;
    if (common->json) {
        json_t *object = to_json(path, r);
        json_object_set_new(object, "refused", cli_json_text(error->message));
        json_object_set_new(object, "error",
                            json_pack("{s:i,s:s,s:o,s:o}", "status", gonio_status_exit(error->status), "message",
                                      error->message, "file", cli_json_text(error->file), "line", json_null()));
        cli_json(object);
        plain.json = false;
    } else {
        cli_print_lines(r->detail);
    }
    return cli_fail(&plain, error);
}

static gonio_status make_small(const char *path, const cli_common *common, gonio_error *error) {
    gonio_session *session;
    int64_t saved = 0;
    gonio_status status = gonio_session_open(path, true, &session, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_session_compress(session, common->threads, &saved, error);
    // What an earlier one left when it was killed.
    status = status == GONIO_OK ? gonio_session_sweep(session, NULL, error) : status;
    gonio_session_close(session);
    if (!common->json && status == GONIO_OK) {
        printf("compressed %lld bytes less\n", (long long)saved);
    }
    return status;
}

static int run(int argc, char **argv) {
    cli_common common;
    bool repair = false, compress = false;
    const cli_option options[] = {
        {"repair", 0, CLI_FLAG, &repair, NULL, NULL,
         "make a session of all that is intact, which takes the path; this one stays as SESSION.damaged-N"},
        {"compress", 0, CLI_FLAG, &compress, NULL, NULL, "first make the frames of a burst small; no checksum changes"},
        {0},
    };
    const char *path;
    int count;
    if (!cli_parse(&cmd_doctor, options, argc, argv, &path, 1, 1, &count, &common)) {
        return 2;
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_doctor_report report;
    if (compress && make_small(path, &common, &error) != GONIO_OK) {
        return cli_fail(&common, &error);
    }
    if (gonio_session_doctor(path, repair, &report, &error) != GONIO_OK) {
        return fail_doctor(&common, path, &report, &error);
    }
    json_t *about = describe(path);
    if (common.json) {
        json_t *object = to_json(path, &report);
        json_object_set_new(object, "about", about);
        cli_json(object);
    } else {
        print(path, &report, repair, about);
        json_decref(about);
    }
    return is_well(&report, repair) ? 0 : gonio_status_exit(GONIO_E_MISMATCH);
}
