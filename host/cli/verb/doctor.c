// SPDX-License-Identifier: BSD-3-Clause
// gonio doctor: what a session is, and whether all of it is sound.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/acquire/acquire.h"
#include "host/cli/cli.h"

static int run(int argc, char **argv);
const cli_verb cmd_doctor = {"doctor", "SESSION [--repair] [--compress]",
                             "verify a session's every checksum; --repair salvages all that is intact", run};

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

static bool is_sound(const gonio_doctor_report *r) {
    return r->database_ok && r->frames_bad == 0 && r->samples_bad == 0 && r->steps_lost == 0 && r->results_ok;
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
    printf("frames     %lld, %lld bad\n", (long long)r->frames, (long long)r->frames_bad);
    printf("samples    of %lld steps bad\nresults    %s\n", (long long)r->samples_bad, r->results_ok ? "sound" : "BAD");
    if (r->flagged > 0) {
        printf("flagged    %lld steps since the last good audit of the stage; `gonio resume` audits them\n",
               (long long)r->flagged);
    }
    cli_print_lines(r->detail);
    const char *events = json_string_value(json_object_get(about, "events"));
    printf("events\n");
    cli_print_lines(events != NULL ? events : "");
    if (!is_sound(r)) {
        printf(repair ? "repaired: %lld steps are to be measured again; `gonio resume` does it\n"
                      : "%lld steps are lost; `gonio doctor --repair` salvages the rest\n",
               (long long)r->steps_lost);
    }
}

static gonio_status make_small(const char *path, const cli_common *common, gonio_error *error) {
    gonio_session *session;
    int64_t saved = 0;
    gonio_status status = gonio_session_open(path, true, &session, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_session_compress(session, common->threads, &saved, error);
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
         "undo steps with bad frames, so that resume measures them again, and rebuild a damaged journal"},
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
        return cli_fail(&common, &error);
    }
    json_t *about = describe(path);
    if (common.json) {
        json_t *object =
            json_pack("{s:s,s:b,s:b,s:I,s:I,s:I,s:I,s:I,s:I,s:I,s:I,s:b,s:b,s:s,s:o}", "session", path, "sound",
                      is_sound(&report), "repaired", repair, "steps", (json_int_t)report.steps, "steps_done",
                      (json_int_t)report.steps_done, "steps_lost", (json_int_t)report.steps_lost, "frames",
                      (json_int_t)report.frames, "frames_bad", (json_int_t)report.frames_bad, "samples_bad",
                      (json_int_t)report.samples_bad, "strays", (json_int_t)report.strays, "flagged",
                      (json_int_t)report.flagged, "database_ok", report.database_ok, "results_ok", report.results_ok,
                      "detail", report.detail, "about", about);
        cli_json(object);
    } else {
        print(path, &report, repair, about);
        json_decref(about);
    }
    return is_sound(&report) || repair ? 0 : gonio_status_exit(GONIO_E_MISMATCH);
}
