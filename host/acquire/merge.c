// SPDX-License-Identifier: BSD-3-Clause
// Sessions of one sample on one rig -> one set of samples.
//
// The reference's scale, the maps of a session's own dark and reference frames and its zero errors are common to its
// samples and drawn anew in another session. So each session is a group, and what stands in sigma_systematic is common
// to a group only.
#include "host/acquire/merge.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/head.h"
#include "base/text.h"
#include "gonio/version.h"

// What of the JSON settings need not agree. STATED: only with `force`.
typedef enum care { MUST, STATED, FREE } care;
static const struct exception {
    const char *setting, *member;
    care care;
} exceptions[] = {
    {"camera", "exposure_min_s", FREE}, // how it was used
    {"camera", "exposure_max_s", FREE},
    {"facts", "operator_name", FREE},
    {"facts", "notes", FREE},
    {"facts", "temperature_c", FREE},
    {"facts", "traceability", STATED},
    {"facts", "response_path", FREE}, // their contents are compared
    {"facts", "reference_brdf", FREE},
    {"facts", "flat_path", FREE},
    {"facts", "serials", STATED},
    {"facts", "pointing_random_deg", STATED}, // these stand in each sample's sigma already
    {"facts", "pointing_systematic_deg", STATED},
    {"facts", "reference_relative_sigma", STATED},
    {"facts", "lamp_drift_per_h", STATED},
    {"facts", "stray_variation", STATED},
    {"facts", "glare_sigma", STATED},
};
static const char *const compared[] = {"camera", "facts", "alignment"};
static const char *const texts[] = {"samples.channels", "sim.spec"};
static const char *const contents[] = {"response.csv", "reference.model", "flat.map"};

static care care_of(const char *setting, const char *member) {
    for (size_t k = 0; k < sizeof exceptions / sizeof *exceptions; k++) {
        if (strcmp(exceptions[k].setting, setting) == 0 && strcmp(exceptions[k].member, member) == 0) {
            return exceptions[k].care;
        }
    }
    return MUST;
}

// ---- what differs ----

typedef struct differences {
    bool force;
    size_t n;
    char list[400];
} differences;

static char *shown(const json_t *value) {
    char *text = value != NULL ? json_dumps(value, JSON_ENCODE_ANY | JSON_COMPACT | JSON_REAL_PRECISION(9)) : NULL;
    if (text != NULL && strlen(text) > 40) {
        strcpy(text + 37, "...");
    }
    return text;
}

static void add(differences *d, const char *setting, const char *member, const json_t *a, const json_t *b) {
    char *was = shown(a), *is = shown(b);
    d->n++;
    gonio_text_append(d->list, sizeof d->list, "%s%s%s%s (%s, %s)", d->n > 1 ? "; " : "", setting,
                      member[0] != 0 ? "." : "", member, was != NULL ? was : "none", is != NULL ? is : "none");
    free(was);
    free(is);
}

static json_t *setting_of(gonio_session *session, const char *key, bool parse) {
    char *text;
    if (gonio_session_get(session, key, &text, NULL) != GONIO_OK) {
        return NULL;
    }
    json_t *value = parse ? json_loads(text, 0, NULL) : json_string(text);
    free(text);
    return value;
}

static void compare_members(differences *d, const char *setting, json_t *a, json_t *b) {
    const char *member;
    json_t *value;
    json_object_foreach(a, member, value) {
        const care care = care_of(setting, member);
        json_t *other = json_object_get(b, member);
        if (care != FREE && !(care == STATED && d->force) && !json_equal(value, other)) {
            add(d, setting, member, value, other);
        }
    }
}

static json_t *content_of(gonio_session *session, const char *name) {
    char *path, hash[GONIO_SHA256_HEX];
    if (asprintf(&path, "%s/%s", gonio_session_path(session), name) < 0) {
        return NULL;
    }
    json_t *value = gonio_sha256_file(path, hash, NULL) == GONIO_OK ? json_string(hash) : NULL;
    free(path);
    return value;
}

static void compare_value(differences *d, const char *what, json_t *a, json_t *b) {
    if (!(a == NULL && b == NULL) && !json_equal(a, b)) {
        add(d, what, "", a, b);
    }
    json_decref(a);
    json_decref(b);
}

static gonio_status compare(gonio_session *first, gonio_session *other, bool force, gonio_error *error) {
    differences d = {.force = force};
    for (size_t k = 0; k < sizeof compared / sizeof *compared; k++) {
        json_t *a = setting_of(first, compared[k], true), *b = setting_of(other, compared[k], true);
        compare_members(&d, compared[k], a, b);
        json_decref(a);
        json_decref(b);
    }
    for (size_t k = 0; k < sizeof texts / sizeof *texts; k++) {
        compare_value(&d, texts[k], setting_of(first, texts[k], false), setting_of(other, texts[k], false));
    }
    for (size_t k = 0; k < sizeof contents / sizeof *contents; k++) {
        compare_value(&d, contents[k], content_of(first, contents[k]), content_of(other, contents[k]));
    }
    return d.n == 0 ? GONIO_OK
                    : gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(other), -1,
                                      "not of the same rig, camera and sample as the first session: %s", d.list);
}

// ---- joining ----

static gonio_status describe(gonio_session *session, uint16_t group, const gonio_samples *samples, json_t **out,
                             gonio_error *error) {
    char hash[GONIO_SHA256_HEX];
    const gonio_status status = gonio_sha256_samples(samples, hash, error);
    json_t *facts = setting_of(session, "facts", true);
    *out = json_pack("{s:i,s:s,s:s,s:O?,s:O?,s:o?,s:I,s:s}", "systematic_group", (int)group, "session",
                     gonio_session_path(session), "gonio", gonio_version(), "sample_id",
                     json_object_get(facts, "sample_id"), "operator", json_object_get(facts, "operator_name"), "plan",
                     setting_of(session, "plan", false), "samples", (json_int_t)samples->n, "samples_sha256", hash);
    json_decref(facts);
    return status == GONIO_OK && *out == NULL
               ? gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(session), -1, "its path is not UTF-8")
               : status;
}

static gonio_status append(gonio_samples *all, const gonio_samples *set, uint16_t group, gonio_error *error) {
    gonio_status status = GONIO_OK;
    all->isotropic = all->isotropic && set->isotropic;
    all->transmission = all->transmission || set->transmission;
    for (size_t i = 0; status == GONIO_OK && i < set->n; i++) {
        const size_t c = i * (size_t)set->channels;
        status = gonio_samples_add(all, &set->pairs[i], set->values + c, set->sigma_random + c,
                                   set->sigma_systematic + c, error);
        status = status == GONIO_OK ? gonio_samples_set_group(all, all->n - 1, group, error) : status;
    }
    return status;
}

// Of the head the lines that both have; the others stand in none of a merged file's.
static gonio_status common_head(char **head, const char *other, gonio_error *error) {
    char key[GONIO_HEAD_KEY_MAX], value[4096], line[sizeof key + sizeof value + 4], *kept = NULL;
    gonio_status status = GONIO_OK;
    for (const char *at = *head; status == GONIO_OK && gonio_head_next(&at, key, value, sizeof value);) {
        snprintf(line, sizeof line, "%s = %s\n", key, value);
        const char *found = other != NULL ? strstr(other, line) : NULL;
        if (found != NULL && (found == other || found[-1] == '\n')) {
            status = gonio_head_add(&kept, key, value, error);
        }
    }
    free(*head);
    *head = kept;
    return status;
}

// Before it, a line a session.
static gonio_status name_sessions(gonio_samples *all, const json_t *sessions, gonio_error *error) {
    size_t i;
    json_t *one;
    char *head = NULL, key[GONIO_HEAD_KEY_MAX], value[4096];
    gonio_status status = gonio_head_add(&head, "merged", "sigma_systematic is common to one systematic_group", error);
    json_array_foreach((json_t *)sessions, i, one) {
        char *line = json_dumps(one, JSON_COMPACT | JSON_PRESERVE_ORDER); // control characters stand as \u there
        status = status == GONIO_OK && line != NULL ? gonio_head_add(&head, "session", line, error) : status;
        free(line);
    }
    for (const char *at = all->head; status == GONIO_OK && gonio_head_next(&at, key, value, sizeof value);) {
        status = gonio_head_add(&head, key, value, error);
    }
    free(all->head);
    all->head = head;
    return status;
}

// The same session twice would count every sample for two.
static gonio_status check_new(const json_t *sessions, const json_t *one, gonio_error *error) {
    size_t i;
    json_t *before;
    json_array_foreach((json_t *)sessions, i, before) {
        if (json_equal(json_object_get(before, "samples_sha256"), json_object_get(one, "samples_sha256"))) {
            return gonio_fail_line(error, GONIO_E_INPUT, json_string_value(json_object_get(one, "session")), -1,
                                   "the same samples as of %s", json_string_value(json_object_get(before, "session")));
        }
    }
    return GONIO_OK;
}

static gonio_status take(gonio_session *session, uint16_t group, gonio_samples **all, json_t *sessions,
                         gonio_error *error) {
    gonio_samples *set = NULL;
    json_t *one = NULL;
    bool final;
    gonio_status status = gonio_session_final_samples(session, &set, &final, error);
    if (status == GONIO_OK && !final) {
        status = gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(session), -1,
                                 "not finished: its samples lack the pointing term; `gonio resume` goes on");
    }
    status = status == GONIO_OK ? describe(session, group, set, &one, error) : status;
    status = status == GONIO_OK ? check_new(sessions, one, error) : status;
    if (status == GONIO_OK && *all == NULL) {
        status = gonio_samples_new(set->channels, true, all, error);
        if (status == GONIO_OK) {
            memcpy((*all)->channel_names, set->channel_names, (size_t)set->channels * sizeof *set->channel_names);
            status = gonio_head_copy(set->head, &(*all)->head, error);
        }
    }
    status = status == GONIO_OK ? common_head(&(*all)->head, set->head, error) : status;
    status = status == GONIO_OK ? append(*all, set, group, error) : status;
    if (status == GONIO_OK) {
        json_array_append(sessions, one);
    }
    json_decref(one);
    gonio_samples_free(set);
    return status;
}

gonio_status gonio_sessions_merge(const char *const *paths, int n, bool force, gonio_samples **out, json_t **sessions,
                                  gonio_error *error) {
    gonio_session *first = NULL;
    *out = NULL;
    *sessions = json_array();
    gonio_status status = gonio_session_open(paths[0], false, &first, error);
    status = status == GONIO_OK ? take(first, 1, out, *sessions, error) : status;
    for (int i = 1; status == GONIO_OK && i < n; i++) {
        gonio_session *other;
        status = gonio_session_open(paths[i], false, &other, error);
        if (status == GONIO_OK) {
            status = compare(first, other, force, error);
            status = status == GONIO_OK ? take(other, (uint16_t)(i + 1), out, *sessions, error) : status;
            gonio_session_close(other);
        }
    }
    gonio_session_close(first);
    status = status == GONIO_OK ? name_sessions(*out, *sessions, error) : status;
    if (status != GONIO_OK) {
        gonio_samples_free(*out);
        json_decref(*sessions);
        *out = NULL;
        *sessions = NULL;
    }
    return status;
}
