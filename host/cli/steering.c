// SPDX-License-Identifier: BSD-3-Clause
#include "host/cli/steering.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"

gonio_status cli_steering_begin(cli_steering *s, const char *path, gonio_error *error) {
    const bool is = gonio_session_is(path);
    *s = (cli_steering){.path = path, .place = realpath(path, NULL)};
    return s->place != NULL && is
               ? GONIO_OK
               : gonio_fail_line(error, GONIO_E_INPUT, path, -1,
                                 "not a session: a folder with a session.db is expected");
}

void cli_steering_end(cli_steering *s) { free(s->place); }

gonio_status cli_steering_ask(const cli_steering *s, const char *word, json_t **answer, gonio_error *error) {
    gonio_error why = {.line = -1, .byte = -1};
    const gonio_status status = cli_ask(GONIO_CONTROL_SESSION, s->place, word, answer, &why);
    return status == GONIO_OK ? GONIO_OK : gonio_fail_line(error, status, s->path, -1, "%s", why.message);
}

gonio_status cli_ask(gonio_control_kind kind, const char *identity, const char *word, json_t **answer,
                     gonio_error *error) {
    char text[GONIO_CONTROL_ANSWER];
    *answer = NULL;
    const gonio_status status = gonio_control_request(kind, identity, word, text, error);
    if (status != GONIO_OK) {
        return status;
    }
    json_error_t why;
    *answer = json_loads(text, JSON_REJECT_DUPLICATES, &why);
    return json_is_object(*answer) ? GONIO_OK
                                   : gonio_fail(error, GONIO_E_IO, "its answer is no JSON object: %s", why.text);
}

static json_t *note(const gonio_session_note *n) {
    return n->kind[0] != 0 ? json_pack("{s:s,s:s,s:s}", "utc", n->utc, "kind", n->kind, "text", n->text) : json_null();
}

// Who is at work, and what it says; the state of a session that nobody is at work on stands in the journal.
static const char *ask(const cli_steering *s, const gonio_session_overview *overview, json_t **live, json_t *out) {
    long pid;
    const gonio_status status = cli_ask(GONIO_CONTROL_SESSION, s->place, "status", live, NULL);
    if (status == GONIO_OK) {
        const char *state = json_string_value(json_object_get(*live, "state"));
        json_object_set(out, "pid", json_object_get(*live, "pid"));
        return state != NULL ? state : "starting";
    }
    const bool written = gonio_session_writer(s->path, &pid);
    if (written) {
        json_object_set_new(out, "pid", json_integer(pid));
    }
    return status == GONIO_E_TIMEOUT ? "not answering"
           : written                 ? "running"
           : overview->results > 0   ? "finished"
                                     : "stopped";
}

gonio_status cli_steering_status(const cli_steering *s, gonio_session_overview *overview, json_t **out,
                                 gonio_error *error) {
    static const char *const told[] = {"phase", "doing", "rate_per_s", "eta_s", "held_out_rmse"};
    gonio_session_overview own, *o = overview != NULL ? overview : &own;
    gonio_session *session;
    gonio_status status = gonio_session_open(s->path, false, &session, error);
    if (status != GONIO_OK) {
        return status;
    }
    char *held_out = NULL; // of the final model
    status = gonio_session_overview_read(session, o, error);
    if (status == GONIO_OK) {
        gonio_session_get(session, "result.held_out_rmse", &held_out, NULL);
    }
    gonio_session_close(session);
    if (status != GONIO_OK) {
        return status;
    }
    json_t *live = NULL;
    *out = json_pack("{s:s,s:s,s:o}", "session", s->path, "state", "", "pid", json_null());
    json_object_set_new(*out, "state", json_string(ask(s, o, &live, *out)));
    for (size_t i = 0; i < sizeof told / sizeof *told; i++) {
        json_t *value = json_object_get(live, told[i]);
        json_object_set_new(*out, told[i], value != NULL ? json_incref(value) : json_null());
    }
    if (live == NULL && o->results > 0 && held_out != NULL) {
        json_object_set_new(*out, "held_out_rmse", cli_json_real(gonio_number_parse(held_out, &(char *){NULL})));
    }
    free(held_out);
    json_decref(live);
    json_t *counts = json_pack("{s:I,s:I,s:I,s:I,s:I,s:o,s:o,s:o}", "poses_done", (json_int_t)o->poses_done, "poses",
                               (json_int_t)o->poses, "steps_done", (json_int_t)o->steps_done, "steps",
                               (json_int_t)o->steps, "frames", (json_int_t)o->frames, "begun", note(&o->first),
                               "last_event", note(&o->last), "last_alarm", note(&o->alarm));
    json_object_update(*out, counts);
    json_decref(counts);
    return GONIO_OK;
}

static void print_note(const char *name, const json_t *n) {
    if (json_is_object(n)) {
        printf("%-10s %s %s: %s\n", name, json_string_value(json_object_get(n, "utc")),
               json_string_value(json_object_get(n, "kind")), json_string_value(json_object_get(n, "text")));
    }
}

static void print_number(const char *name, const json_t *n, const char *format) {
    if (json_is_number(n)) {
        printf("%-10s ", name);
        printf(format, json_number_value(n));
        putchar('\n');
    }
}

void cli_steering_print(json_t *status) {
    json_t *pid = json_object_get(status, "pid");
    const char *doing = json_string_value(json_object_get(status, "doing"));
    printf("session    %s\nstate      %s", json_string_value(json_object_get(status, "session")),
           json_string_value(json_object_get(status, "state")));
    if (json_is_integer(pid)) {
        printf(" (process %lld)", (long long)json_integer_value(pid));
    }
    printf("%s%s\n", doing != NULL && doing[0] != 0 ? ": " : "", doing != NULL ? doing : "");
    printf("poses      %lld of %lld, %lld frames\n",
           (long long)json_integer_value(json_object_get(status, "poses_done")),
           (long long)json_integer_value(json_object_get(status, "poses")),
           (long long)json_integer_value(json_object_get(status, "frames")));
    print_number("rate", json_object_get(status, "rate_per_s"), "%.3g poses/s");
    print_number("ETA", json_object_get(status, "eta_s"), "%.0f s");
    print_number("held-out", json_object_get(status, "held_out_rmse"), "rmse %.4g /sr");
    print_note("begun", json_object_get(status, "begun"));
    print_note("last", json_object_get(status, "last_event"));
    print_note("alarm", json_object_get(status, "last_alarm"));
}
