// SPDX-License-Identifier: BSD-3-Clause
// Rig files (INI, by libinih) and settings that override them -> an open rig.
#include "host/acquire/rig_file.h"

#include <ctype.h>
#include <ini.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "host/acquire/rig_keys.h"
#include "host/drivers/null.h"

#define FILE_MAX_BYTES (1 << 20)

typedef struct builder {
    rig_keys keys;
    gonio_sim *sim;
    int file_lines;     // lines beyond come from the options
    bool driver_pass;   // only the driver keys and [sample] spec, which decide what the other keys mean
    bool hardware_only; // keys of real devices; the simulator's were journalled apart
    gonio_hardware *hardware;
    gonio_error error;
} builder;

static gonio_status set_key(builder *b, const char *section, const char *key, const char *value, gonio_error *error) {
    const bool first = strcmp(key, "driver") == 0 || (strcmp(section, "sample") == 0 && strcmp(key, "spec") == 0);
    if (first != b->driver_pass) {
        return GONIO_OK;
    }
    const gonio_key *facts = b->sim != NULL ? NULL : gonio_rig_fact_keys;
    const gonio_key *own = gonio_key_find(gonio_rig_keys, section, key);
    own = own != NULL ? own : gonio_key_find(facts, section, key);
    if (own != NULL) {
        return gonio_key_parse(own, &b->keys, value, error);
    }
    bool known, shared;
    const gonio_status status = gonio_hardware_set(b->hardware, section, key, value, &known, &shared, error);
    if (status != GONIO_OK || b->hardware_only || (known && (!shared || b->sim == NULL))) {
        return status;
    }
    if (b->driver_pass) { // devices are chosen by the drivers of these sections
        return gonio_fail(error, GONIO_E_INPUT,
                          "[%s] has no driver; stage, lamp, meter, camera, interlock and mount have", section);
    }
    if (b->sim != NULL && (known || gonio_sim_has_key(section, key))) {
        return gonio_sim_set(b->sim, section, key, value, error);
    }
    if (gonio_hardware_elsewhere(b->hardware, section, key, error)) {
        return GONIO_E_INPUT;
    }
    char list[400];
    const bool real = gonio_hardware_list(b->hardware, section, list, sizeof list);
    if (b->sim != NULL && !real) {
        gonio_sim_keys(section, list + strlen(list), sizeof list - strlen(list));
    }
    gonio_key_list(gonio_rig_keys, section, list, sizeof list);
    gonio_key_list(facts, section, list, sizeof list);
    return list[0] != 0 ? gonio_fail(error, GONIO_E_INPUT, "unknown key [%.60s] %.60s; there are%s", section, key, list)
                        : gonio_fail(error, GONIO_E_INPUT, "unknown section [%.60s]", section);
}

static int on_key(void *user, const char *section, const char *key, const char *value) {
    builder *b = user;
    if (b->error.status != GONIO_OK) {
        return 1; // inih goes on after an error; the first one counts
    }
    const gonio_status status = set_key(b, section, key, value, &b->error);
    b->error.status = status;
    return status == GONIO_OK;
}

// inih cuts lines at its buffer without a word, so longer ones are refused before.
static gonio_status check_lines(const char *text, const char *name, gonio_error *error) {
    long long line = 1;
    while (*text != 0) {
        const size_t length = strcspn(text, "\n");
        if (length > INI_MAX_LINE - 3) {
            return gonio_fail_line(error, GONIO_E_INPUT, name, line, "a line of %zu bytes; at most %d are possible",
                                   length, INI_MAX_LINE - 3);
        }
        text += length + (text[length] == '\n');
        line++;
    }
    return GONIO_OK;
}

static gonio_status apply_text(builder *b, const char *text, const char *name, gonio_error *error) {
    b->error = (gonio_error){.line = -1, .byte = -1};
    const int line = ini_parse_string(text, on_key, b);
    if (line == 0) {
        return GONIO_OK;
    }
    if (line < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", name);
    }
    if (line > b->file_lines) {
        return gonio_fail(error, GONIO_E_USAGE, "setting: %s",
                          b->error.status != GONIO_OK ? b->error.message : "expected SECTION.KEY=VALUE");
    }
    if (b->error.status == GONIO_OK) {
        return gonio_fail_line(error, GONIO_E_INPUT, name, line, "expected [section], key = value, or a comment");
    }
    return gonio_fail_line(error, GONIO_E_INPUT, name, line, "%s", b->error.message);
}

// A line so bad that it is told no more; what it does shows in the measure's pace.
#define RETRIES_TOLD 100

static void tell(void *context, const char *kind, const char *text) {
    gonio_rig_file *rig = context;
    const bool retry = strcmp(kind, "retry") == 0;
    if (retry && ++rig->retries > RETRIES_TOLD) {
        return;
    }
    if (rig->journal != NULL) {
        gonio_session_event(rig->journal, kind, text, NULL);
    }
    if (!retry && rig->event != NULL) { // retries are for whoever reads the journal
        rig->event(rig->context, kind, text);
    }
}

static bool cancelled(void *context) {
    const gonio_rig_file *rig = context;
    return rig->cancelled != NULL && rig->cancelled(rig->context);
}

static gonio_status new_hardware(builder *b, gonio_rig_file *rig, gonio_error *error) {
    const gonio_hardware_hooks hooks = {.event = tell, .context = rig, .cancelled = cancelled};
    const gonio_status status = gonio_hardware_new(&hooks, &rig->hardware, error);
    b->hardware = rig->hardware;
    return status;
}

// Read the text twice: the driver first, then, with the driver there, everything else.
static gonio_status build(builder *b, const char *text, const char *name, const gonio_rig_file_options *options,
                          gonio_error *error) {
    const char *sample = options->sample;
    gonio_rig_keys_default(&b->keys);
    gonio_status status = check_lines(text, name, error);
    b->driver_pass = true;
    status = status == GONIO_OK ? apply_text(b, text, name, error) : status;
    b->driver_pass = false;
    if (status != GONIO_OK) {
        return status;
    }
    if (sample != NULL && strlen(sample) >= sizeof b->keys.sample) {
        return gonio_fail(error, GONIO_E_USAGE, "sample: more than %zu bytes", sizeof b->keys.sample - 1);
    }
    if (sample != NULL) {
        strcpy(b->keys.sample, sample);
    }
    if (strcmp(b->keys.driver, "sim") == 0) {
        if (b->keys.sample[0] == 0 && options->stand_in != NULL) {
            snprintf(b->keys.sample, sizeof b->keys.sample, "%s", options->stand_in);
        } else if (b->keys.sample[0] == 0) {
            return gonio_fail(error, GONIO_E_USAGE,
                              "the simulated rig needs a sample (--sample, or spec under [sample]) such as "
                              "ward:rho_d=0.3,rho_s=0.2,alpha=0.15");
        }
        status = gonio_sim_new(b->keys.sample, options->seed, &b->sim, error);
    } else if (strcmp(b->keys.driver, "null") != 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, name, -1, "[rig] driver: found '%s', expected sim or null",
                               b->keys.driver);
    } else if (sample != NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "sample: only the simulated rig makes its sample from a SPEC");
    }
    return status == GONIO_OK ? apply_text(b, text, name, error) : status;
}

static void copy_texts(const gonio_rig_facts *from, gonio_rig_facts *to) {
    memcpy(to->operator_name, from->operator_name, sizeof to->operator_name);
    memcpy(to->notes, from->notes, sizeof to->notes);
    memcpy(to->sample_id, from->sample_id, sizeof to->sample_id);
    memcpy(to->reference_brdf, from->reference_brdf, sizeof to->reference_brdf);
    memcpy(to->flat_path, from->flat_path, sizeof to->flat_path);
    if (from->serials[0] != 0) {
        memcpy(to->serials, from->serials, sizeof to->serials);
    }
}

static gonio_status open_devices(builder *b, int threads, gonio_rig_file *rig, gonio_error *error) {
    gonio_status status;
    if (b->sim != NULL) {
        status = gonio_sim_open(b->sim, threads, &rig->rig, error);
        if (status == GONIO_OK) {
            copy_texts(&b->keys.facts, &rig->rig.facts);
        }
    } else {
        status = gonio_null_rig_open(&rig->rig, error);
        rig->rig.facts = b->keys.facts;
    }
    status = status == GONIO_OK ? gonio_hardware_open(b->hardware, &rig->rig, b->sim != NULL, error) : status;
    rig->sim = b->sim;
    rig->scan = b->keys.scan;
    snprintf(rig->driver, sizeof rig->driver, "%s", b->keys.driver);
    snprintf(rig->spec, sizeof rig->spec, "%s", b->keys.sample);
    return status;
}

// ---- texts ----

static gonio_status read_file(const char *path, char **text, gonio_error *error) {
    size_t size;
    const gonio_status status = gonio_file_read(path, FILE_MAX_BYTES, text, &size, error);
    if (status == GONIO_OK && strlen(*text) != size) {
        free(*text);
        *text = NULL;
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a rig file: a text without zero bytes is expected");
    }
    return status;
}

// Where the next section.key= begins after a comma; values may hold commas themselves.
static const char *next_setting(const char *text) {
    for (const char *comma = strchr(text, ','); comma != NULL; comma = strchr(comma + 1, ',')) {
        const char *c = comma + 1;
        const char *dot = NULL;
        while (isalnum((unsigned char)*c) || *c == '_' || *c == ' ' || *c == '.') {
            dot = *c == '.' ? c : dot;
            c++;
        }
        if (*c == '=' && dot != NULL) {
            return comma;
        }
    }
    return text + strlen(text);
}

static gonio_status append_setting(FILE *stream, const char *setting, size_t length, gonio_error *error) {
    const char *equals = memchr(setting, '=', length);
    const char *dot = equals;
    while (dot != NULL && dot > setting && *dot != '.') {
        dot--;
    }
    if (equals == NULL || dot == setting || memchr(setting, '\n', length) != NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "setting: found '%.*s', expected SECTION.KEY=VALUE", (int)length,
                          setting);
    }
    fprintf(stream, "[%.*s]\n%.*s = %.*s\n", (int)(dot - setting), setting, (int)(equals - dot - 1), dot + 1,
            (int)(setting + length - equals - 1), equals + 1);
    return GONIO_OK;
}

// The overrides as the text of a rig file.
static gonio_status overrides(const gonio_rig_file_options *options, char **text, gonio_error *error) {
    size_t size;
    FILE *stream = open_memstream(text, &size);
    if (stream == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    }
    const struct {
        const char *section, *key, *value;
    } own[] = {{"rig", "operator", options->operator_name},
               {"sample", "id", options->sample_id},
               {"rig", "notes", options->notes}};
    for (size_t i = 0; i < sizeof own / sizeof *own; i++) {
        if (own[i].value != NULL) {
            fprintf(stream, "[%s]\n%s = %s\n", own[i].section, own[i].key, own[i].value);
        }
    }
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < options->n_fragments; i++) {
        char *fragment;
        status = read_file(options->fragments[i], &fragment, error);
        if (status == GONIO_OK) {
            fprintf(stream, "%s\n", fragment);
            free(fragment);
        }
    }
    for (size_t i = 0; status == GONIO_OK && i < options->n_settings; i++) {
        const char *setting = options->settings[i];
        while (status == GONIO_OK && *setting != 0) {
            const char *end = next_setting(setting);
            status = append_setting(stream, setting, (size_t)(end - setting), error);
            setting = *end == ',' ? end + 1 : end;
        }
    }
    fclose(stream);
    return status;
}

static int count_lines(const char *text) {
    int lines = text != NULL ? 1 : 0;
    for (; text != NULL && *text != 0; text++) {
        lines += *text == '\n';
    }
    return lines;
}

static void begin(const gonio_rig_file_options *options, gonio_rig_file *rig) {
    *rig = (gonio_rig_file){
        .seed = options->seed, .event = options->event, .cancelled = options->cancelled, .context = options->context};
}

gonio_status gonio_rig_file_fill(const gonio_rig_file_options *options, gonio_rig_file *rig, gonio_error *error) {
    begin(options, rig);
    const bool is_sim = options->path == NULL || strcmp(options->path, "sim") == 0;
    char *file = NULL, *extra = NULL;
    gonio_status status = overrides(options, &extra, error);
    if (status == GONIO_OK) {
        status = is_sim ? GONIO_OK : read_file(options->path, &file, error);
    }
    if (status == GONIO_OK &&
        asprintf(&rig->text, "%s%s%s", file != NULL ? file : "", file != NULL ? "\n" : "", extra) < 0) {
        rig->text = NULL;
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    }
    builder b = {.file_lines = count_lines(file)};
    free(file);
    free(extra);
    if (status != GONIO_OK) {
        return status;
    }
    status = new_hardware(&b, rig, error);
    if (status == GONIO_OK) {
        status = build(&b, rig->text, is_sim ? "settings" : options->path, options, error);
    }
    rig->sim = b.sim;
    status = status == GONIO_OK ? open_devices(&b, options->threads, rig, error) : status;
    // A session journals the numbers, so that a resume needs no file.
    return status == GONIO_OK && b.keys.alignment[0] != 0
               ? gonio_alignment_read(b.keys.alignment, &rig->rig.facts.alignment, error)
               : status;
}

void gonio_rig_file_release(gonio_rig_file *rig) {
    gonio_rig_close(&rig->rig);
    gonio_hardware_free(rig->hardware);
    gonio_sim_free(rig->sim);
    free(rig->text);
    *rig = (gonio_rig_file){0};
}

// ---- the journal ----

gonio_status gonio_rig_file_put(gonio_session *session, const gonio_rig_file *rig, gonio_error *error) {
    gonio_status status = gonio_session_put(session, "rig.driver", rig->driver, error);
    status = status == GONIO_OK ? gonio_session_put(session, "rig.ini", rig->text, error) : status;
    if (status != GONIO_OK || rig->sim == NULL) {
        return status;
    }
    // Every setting of the simulator with its value, so that later defaults cannot change what a resume simulates.
    char seed[24];
    snprintf(seed, sizeof seed, "%llu", (unsigned long long)rig->seed);
    char *settings = gonio_sim_settings(rig->sim);
    status = settings != NULL ? gonio_session_put(session, "sim.settings", settings, error)
                              : gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    free(settings);
    status = status == GONIO_OK ? gonio_session_put(session, "sim.seed", seed, error) : status;
    return status == GONIO_OK ? gonio_session_put(session, "sim.spec", rig->spec, error) : status;
}

static gonio_status apply_sim_settings(gonio_sim *sim, char *text, gonio_error *error) {
    gonio_status status = GONIO_OK;
    char *rest = text;
    const char *line;
    while (status == GONIO_OK && (line = strsep(&rest, "\n")) != NULL) {
        char *equals = strchr(line, '=');
        if (equals == NULL) {
            continue;
        }
        *equals = 0;
        char *dot = strrchr(line, '.');
        if (dot != NULL) {
            *dot = 0;
            status = gonio_sim_set(sim, line, dot + 1, equals + 1, error);
        }
    }
    return status;
}

// The real devices beside a simulated rig, as journalled; then what the resume changes, of both.
static gonio_status reopen_hardware(gonio_session *session, const char *extra, gonio_rig_file *rig,
                                    gonio_error *error) {
    char *text = NULL;
    builder b = {.sim = rig->sim};
    gonio_rig_keys_default(&b.keys);
    gonio_status status = new_hardware(&b, rig, error);
    status = status == GONIO_OK ? gonio_session_get(session, "rig.ini", &text, error) : status;
    b.file_lines = count_lines(text);
    const char *const texts[] = {text, text, extra, extra};
    for (int pass = 0; pass < 4 && status == GONIO_OK; pass++) {
        b.driver_pass = pass % 2 == 0;
        b.hardware_only = pass < 2; // the simulator's settings were journalled with their values
        b.file_lines = pass < 2 ? b.file_lines : 0;
        status = apply_text(&b, texts[pass], "the journalled rig file", error);
    }
    free(text);
    return status;
}

static gonio_status reopen_sim(gonio_session *session, const char *extra, int threads, gonio_rig_file *rig,
                               gonio_error *error) {
    char *spec = NULL, *seed = NULL, *settings = NULL;
    gonio_status status = gonio_session_get(session, "sim.spec", &spec, error);
    status = status == GONIO_OK ? gonio_session_get(session, "sim.seed", &seed, error) : status;
    status = status == GONIO_OK ? gonio_session_get(session, "sim.settings", &settings, error) : status;
    status = status == GONIO_OK ? gonio_sim_new(spec, strtoull(seed, NULL, 10), &rig->sim, error) : status;
    status = status == GONIO_OK ? apply_sim_settings(rig->sim, settings, error) : status;
    status = status == GONIO_OK ? reopen_hardware(session, extra, rig, error) : status;
    free(spec);
    free(seed);
    free(settings);
    status = status == GONIO_OK ? gonio_sim_open(rig->sim, threads, &rig->rig, error) : status;
    return status == GONIO_OK ? gonio_hardware_open(rig->hardware, &rig->rig, true, error) : status;
}

static gonio_status reopen_file(gonio_session *session, const char *extra, int threads, gonio_rig_file *rig,
                                gonio_error *error) {
    char *journalled;
    gonio_status status = gonio_session_get(session, "rig.ini", &journalled, error);
    if (status != GONIO_OK) {
        return status;
    }
    builder b = {.file_lines = count_lines(journalled)};
    if (asprintf(&rig->text, "%s%s%s", journalled, extra[0] != 0 ? "\n" : "", extra) < 0) {
        rig->text = NULL;
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    }
    free(journalled);
    status = status == GONIO_OK ? new_hardware(&b, rig, error) : status;
    if (status == GONIO_OK) {
        status = build(&b, rig->text, "the journalled rig file", &(gonio_rig_file_options){.seed = 1}, error);
    }
    return status == GONIO_OK ? open_devices(&b, threads, rig, error) : status;
}

// What was journalled by gonio_measure_begin: all of it, or nothing.
static gonio_status read_setup(gonio_session *session, gonio_setup *setup, gonio_error *error) {
    gonio_step *steps;
    size_t n;
    const gonio_status status = gonio_session_steps(session, &steps, &n, error);
    if (status != GONIO_OK) {
        return status;
    }
    free(steps);
    if (n == 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, gonio_session_path(session), -1,
                               "stopped before its plan was entered, so nothing was measured; measure it again");
    }
    return gonio_setup_get(session, setup, error);
}

gonio_status gonio_rig_file_refill(gonio_session *session, const gonio_rig_file_options *options, gonio_rig_file *rig,
                                   gonio_error *error) {
    begin(options, rig);
    char *driver = NULL, *extra = NULL;
    const gonio_rig_file_options changes = {.settings = options->settings, .n_settings = options->n_settings};
    gonio_setup setup;
    gonio_status status = overrides(&changes, &extra, error);
    status = status == GONIO_OK ? read_setup(session, &setup, error) : status;
    status = status == GONIO_OK ? gonio_session_get(session, "rig.driver", &driver, error) : status;
    if (status == GONIO_OK) {
        snprintf(rig->driver, sizeof rig->driver, "%s", driver);
        status = strcmp(driver, "sim") == 0 ? reopen_sim(session, extra, options->threads, rig, error)
                                            : reopen_file(session, extra, options->threads, rig, error);
    }
    rig->scan = status == GONIO_OK ? setup.scan : rig->scan;
    if (status == GONIO_OK && extra[0] != 0) {
        status = gonio_session_event(session, "settings changed", extra, error);
    }
    status = status == GONIO_OK ? gonio_session_event(session, "resumed", "", error) : status;
    free(driver);
    free(extra);
    return status;
}

// ---- the public calls ----

static gonio_status allocated(gonio_rig_file **out, gonio_error *error) {
    *out = calloc(1, sizeof **out);
    return *out != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a rig");
}

static gonio_status given(gonio_status status, gonio_rig_file **out) {
    if (status != GONIO_OK) {
        gonio_rig_file_close(*out);
        *out = NULL;
    }
    return status;
}

gonio_status gonio_rig_file_open(const gonio_rig_file_options *options, gonio_rig_file **out, gonio_error *error) {
    const gonio_status status = allocated(out, error);
    return status == GONIO_OK ? given(gonio_rig_file_fill(options, *out, error), out) : status;
}

gonio_status gonio_rig_file_reopen(gonio_session *session, const gonio_rig_file_options *options, gonio_rig_file **out,
                                   gonio_error *error) {
    const gonio_rig_file_options none = {0};
    const gonio_status status = allocated(out, error);
    return status == GONIO_OK
               ? given(gonio_rig_file_refill(session, options != NULL ? options : &none, *out, error), out)
               : status;
}

void gonio_rig_file_close(gonio_rig_file *rig) {
    if (rig != NULL) {
        gonio_rig_file_release(rig);
        free(rig);
    }
}

gonio_rig *gonio_rig_file_devices(gonio_rig_file *rig) { return &rig->rig; }

bool gonio_rig_file_needs_hands(const gonio_rig_file *rig) { return rig->scan.hands || rig->rig.mount == NULL; }
