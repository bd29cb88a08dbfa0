// SPDX-License-Identifier: BSD-3-Clause
// Rig files (INI, by libinih) and settings that override them -> an open rig.
#include "host/acquire/rig_file.h"

#include <ini.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "host/acquire/identity.h"
#include "host/acquire/rig_change.h"
#include "host/acquire/rig_control.h"
#include "host/acquire/rig_keys.h"
#include "host/acquire/rig_text.h"
#include "host/drivers/null.h"

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

static char *trim(char *text) {
    text += strspn(text, " \t");
    char *end = text + strlen(text);
    while (end > text && (end[-1] == ' ' || end[-1] == '\t')) {
        end--;
    }
    *end = 0;
    return text;
}

// One key from the options: an error is a wrong use of them.
static gonio_status apply_option(builder *b, const char *section, const char *key, const char *value,
                                 gonio_error *error) {
    gonio_error why = {0};
    return set_key(b, section, key, value, &why) == GONIO_OK
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_USAGE, "setting: %s", why.message);
}

// Lines of section.key=value, as gonio_rig_text_settings makes them.
static gonio_status apply_settings(builder *b, const char *lines, gonio_error *error) {
    char *copy = strdup(lines);
    gonio_status status = copy != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    char *rest = copy, *line;
    while (status == GONIO_OK && (line = strsep(&rest, "\n")) != NULL) {
        char *equals = strchr(line, '=');
        if (equals != NULL) {
            *equals = 0;
        }
        char *dot = equals != NULL ? strrchr(line, '.') : NULL;
        if (dot != NULL) {
            *dot = 0;
            status = apply_option(b, trim(line), trim(dot + 1), trim(equals + 1), error);
        } else if (line[0] != 0) {
            status = gonio_fail(error, GONIO_E_USAGE, "setting: found '%.80s', expected SECTION.KEY=VALUE", line);
        }
    }
    free(copy);
    return status;
}

// Texts that have options of their own, as they stand: no character of theirs means anything.
static gonio_status apply_texts(builder *b, const gonio_rig_file_options *options, gonio_error *error) {
    const struct {
        const char *section, *key, *value;
    } own[] = {{"rig", "operator", options->operator_name},
               {"sample", "id", options->sample_id},
               {"rig", "notes", options->notes}};
    gonio_status status = GONIO_OK;
    for (size_t i = 0; status == GONIO_OK && i < sizeof own / sizeof *own; i++) {
        status = own[i].value != NULL ? apply_option(b, own[i].section, own[i].key, own[i].value, error) : GONIO_OK;
    }
    return status;
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
    return gonio_control_stopping(rig->control) || (rig->cancelled != NULL && rig->cancelled(rig->context));
}

static gonio_status new_hardware(builder *b, gonio_rig_file *rig, gonio_error *error) {
    const gonio_hardware_hooks hooks = {.event = tell, .context = rig, .cancelled = cancelled};
    const gonio_status status = gonio_hardware_new(&hooks, &rig->hardware, error);
    b->hardware = rig->hardware;
    return status;
}

// Read the text twice: the driver first, then, with the driver there, everything else.
static gonio_status build(builder *b, const char *text, const char *settings, const char *name,
                          const gonio_rig_file_options *options, gonio_error *error) {
    const char *sample = options->sample;
    gonio_rig_keys_default(&b->keys);
    gonio_status status = gonio_rig_text_check(text, name, error);
    b->driver_pass = true;
    status = status == GONIO_OK ? apply_text(b, text, name, error) : status;
    status = status == GONIO_OK ? apply_settings(b, settings, error) : status;
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
    status = status == GONIO_OK ? apply_text(b, text, name, error) : status;
    status = status == GONIO_OK ? apply_texts(b, options, error) : status;
    return status == GONIO_OK ? apply_settings(b, settings, error) : status;
}

static void copy_texts(const gonio_rig_facts *from, gonio_rig_facts *to) {
    memcpy(to->operator_name, from->operator_name, sizeof to->operator_name);
    memcpy(to->notes, from->notes, sizeof to->notes);
    memcpy(to->sample_id, from->sample_id, sizeof to->sample_id);
    memcpy(to->light_polarisation, from->light_polarisation, sizeof to->light_polarisation);
    memcpy(to->detector_polarisation, from->detector_polarisation, sizeof to->detector_polarisation);
    memcpy(to->temperature_c, from->temperature_c, sizeof to->temperature_c);
    memcpy(to->traceability, from->traceability, sizeof to->traceability);
    memcpy(to->reference_brdf, from->reference_brdf, sizeof to->reference_brdf);
    memcpy(to->flat_path, from->flat_path, sizeof to->flat_path);
    if (from->serials[0] != 0) {
        memcpy(to->serials, from->serials, sizeof to->serials);
    }
}

// Positions are rounded to steps: an error of up to half of one, equally likely anywhere between, beside what was
// stated of the repeatability. (The simulator's arms stand where they were sent.)
static void add_half_step(gonio_rig *rig) {
    if (rig->stage->step_rad != NULL) {
        const double step_deg = gonio_degrees(rig->stage->step_rad(rig->stage_device));
        rig->facts.pointing_random_deg = hypot(rig->facts.pointing_random_deg, step_deg / sqrt(12));
    }
}

static gonio_status open_devices(builder *b, int threads, gonio_rig_file *rig, gonio_error *error) {
    gonio_status status = gonio_rig_control_begin(rig, error);
    if (status != GONIO_OK) {
        return status;
    }
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
    if (status == GONIO_OK && b->sim == NULL) {
        add_half_step(&rig->rig);
    }
    rig->sim = b->sim;
    rig->scan = b->keys.scan;
    snprintf(rig->driver, sizeof rig->driver, "%s", b->keys.driver);
    snprintf(rig->spec, sizeof rig->spec, "%s", b->keys.sample);
    gonio_rig_control_opened(rig);
    return status;
}

static void begin(const gonio_rig_file_options *options, gonio_rig_file *rig) {
    *rig = (gonio_rig_file){.seed = options->seed,
                            .event = options->event,
                            .cancelled = options->cancelled,
                            .context = options->context,
                            .steered = options->control};
}

// Everything up to the devices. b->sim, which is the rig's, is made on the way.
static gonio_status read_rig(const gonio_rig_file_options *options, builder *b, gonio_rig_file *rig,
                             gonio_error *error) {
    begin(options, rig);
    const bool is_sim = options->path == NULL || strcmp(options->path, "sim") == 0;
    char *file = NULL, *extra = NULL;
    gonio_status status = gonio_rig_text_settings(options, &rig->settings, error);
    status = status == GONIO_OK ? gonio_rig_text_fragments(options, &extra, error) : status;
    for (size_t i = 0; status == GONIO_OK && i < options->n_fragments; i++) {
        status = gonio_sources_add_file(&rig->sources, "rig fragment", options->fragments[i], error);
    }
    if (status == GONIO_OK) {
        status = is_sim ? GONIO_OK : gonio_rig_text_read(options->path, &file, error);
    }
    if (status == GONIO_OK && !is_sim) {
        status = gonio_sources_add(&rig->sources, "rig", options->path, file, strlen(file), error);
    }
    if (status == GONIO_OK &&
        asprintf(&rig->text, "%s%s%s", file != NULL ? file : "", file != NULL ? "\n" : "", extra) < 0) {
        rig->text = NULL;
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    }
    *b = (builder){.file_lines = gonio_rig_text_lines(file)};
    rig->path = file != NULL ? realpath(options->path, NULL) : NULL;
    free(file);
    free(extra);
    status = status == GONIO_OK ? new_hardware(b, rig, error) : status;
    if (status == GONIO_OK) {
        status = build(b, rig->text, rig->settings, is_sim ? "settings" : options->path, options, error);
    }
    rig->sim = b->sim;
    return status;
}

gonio_status gonio_rig_file_fill(const gonio_rig_file_options *options, gonio_rig_file *rig, gonio_error *error) {
    builder b;
    gonio_status status = read_rig(options, &b, rig, error);
    status = status == GONIO_OK ? open_devices(&b, options->threads, rig, error) : status;
    // A session journals the numbers, so that a resume needs no file.
    if (status == GONIO_OK && b.keys.alignment[0] != 0) {
        status = gonio_alignment_read(b.keys.alignment, &rig->rig.facts.alignment, error);
        status =
            status == GONIO_OK ? gonio_sources_add_file(&rig->sources, "alignment", b.keys.alignment, error) : status;
    }
    return status;
}

gonio_status gonio_rig_file_identity(const gonio_rig_file_options *options, char **identity, gonio_error *error) {
    builder b;
    gonio_rig_file rig;
    *identity = NULL;
    gonio_status status = read_rig(options, &b, &rig, error);
    status = status == GONIO_OK ? gonio_rig_identity(&rig, identity, error) : status;
    gonio_rig_file_release(&rig);
    return status;
}

// The rig's name last: who waits for it to be free finds the line free, too.
void gonio_rig_file_release(gonio_rig_file *rig) {
    gonio_control_ask(rig->control, NULL, NULL);
    gonio_rig_close(&rig->rig);
    gonio_hardware_free(rig->hardware);
    gonio_control_free(rig->control);
    gonio_sim_free(rig->sim);
    free(rig->text);
    free(rig->settings);
    free(rig->path);
    gonio_sources_free(&rig->sources);
    *rig = (gonio_rig_file){0};
}

// ---- the journal ----

static gonio_status put_identity(gonio_session *session, const gonio_rig_file *rig, gonio_error *error) {
    char *devices;
    gonio_status status = gonio_rig_identity_text(rig, &devices, error);
    status = status == GONIO_OK ? gonio_session_put(session, "devices", devices, error) : status;
    free(devices);
    return status;
}

// A resume's devices may be others: the setting says which there were first, events say which there are now.
static gonio_status tell_identity(gonio_session *session, const gonio_rig_file *rig, gonio_error *error) {
    char *devices, *known = NULL;
    gonio_status status = gonio_rig_identity_text(rig, &devices, error);
    if (status == GONIO_OK &&
        (gonio_session_get(session, "devices", &known, NULL) != GONIO_OK || strcmp(known, devices) != 0)) {
        status = gonio_session_event(session, "devices changed", devices, error);
    }
    free(known);
    free(devices);
    return status;
}

gonio_status gonio_rig_file_put(gonio_session *session, const gonio_rig_file *rig, gonio_error *error) {
    gonio_status status = gonio_session_put(session, "rig.driver", rig->driver, error);
    status = status == GONIO_OK ? put_identity(session, rig, error) : status;
    status = status == GONIO_OK ? gonio_sources_put(session, &rig->sources, error) : status;
    status = status == GONIO_OK ? gonio_session_put(session, "rig.ini", rig->text, error) : status;
    status = status == GONIO_OK ? gonio_session_put(session, "rig.settings", rig->settings, error) : status;
    if (status == GONIO_OK && rig->path != NULL) {
        status = gonio_session_put(session, "rig.path", rig->path, error);
    }
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

// The camera's response may be a file.
static gonio_status check_response(const char *section, const char *key, const char *value, gonio_error *error) {
    struct stat info;
    return strcmp(section, "camera") == 0 && strcmp(key, "response") == 0 && stat(value, &info) == 0 &&
                   !S_ISREG(info.st_mode)
               ? gonio_fail(error, GONIO_E_INPUT,
                            "the session's camera.response is a folder, a pipe or a device, expected a file")
               : GONIO_OK;
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
            status = check_response(line, dot + 1, equals + 1, error);
            status = status != GONIO_OK ? status : gonio_sim_set(sim, line, dot + 1, equals + 1, error);
        }
    }
    return status;
}

// A session may come from elsewhere, and would have this machine talk to any device or host that it names.
static gonio_status ask_trust(const gonio_rig_file_options *options, const gonio_rig_file *rig, gonio_error *error) {
    char devices[400];
    if (!gonio_hardware_reach(rig->hardware, devices, sizeof devices) ||
        (options->trust != NULL && options->trust(options->context, devices))) {
        return GONIO_OK;
    }
    return gonio_fail(error, GONIO_E_USAGE,
                      "the session's rig opens what it names: %s; nobody has allowed it (gonio resume --stored-rig)",
                      devices);
}

// The real devices beside a simulated rig, as journalled; then what the resume changes, of both.
static gonio_status reopen_hardware(gonio_session *session, const char *extra, gonio_rig_file *rig,
                                    gonio_error *error) {
    char *text = NULL, *settings = NULL;
    builder b = {.sim = rig->sim};
    gonio_rig_keys_default(&b.keys);
    gonio_status status = new_hardware(&b, rig, error);
    status = status == GONIO_OK ? gonio_rig_journalled(session, &text, &settings, error) : status;
    b.file_lines = gonio_rig_text_lines(text);
    for (int pass = 0; pass < 4 && status == GONIO_OK; pass++) {
        b.driver_pass = pass % 2 == 0;
        b.hardware_only = pass < 2; // the simulator's settings were journalled with their values
        if (b.hardware_only) {
            status = apply_text(&b, text, "the journalled rig file", error);
        }
        status = status == GONIO_OK ? apply_settings(&b, b.hardware_only ? settings : extra, error) : status;
    }
    free(text);
    free(settings);
    return status;
}

static gonio_status reopen_sim(gonio_session *session, const char *extra, const gonio_rig_file_options *options,
                               gonio_rig_file *rig, gonio_error *error) {
    char *spec = NULL, *seed = NULL, *settings = NULL;
    gonio_status status = gonio_session_get(session, "sim.spec", &spec, error);
    status = status == GONIO_OK ? gonio_session_get(session, "sim.seed", &seed, error) : status;
    status = status == GONIO_OK ? gonio_session_get(session, "sim.settings", &settings, error) : status;
    status = status == GONIO_OK ? gonio_spec_check_file(spec, gonio_session_path(session), error) : status;
    status = status == GONIO_OK ? gonio_sim_new(spec, strtoull(seed, NULL, 10), &rig->sim, error) : status;
    status = status == GONIO_OK ? apply_sim_settings(rig->sim, settings, error) : status;
    status = status == GONIO_OK ? reopen_hardware(session, extra, rig, error) : status;
    free(spec);
    free(seed);
    free(settings);
    status = status == GONIO_OK ? ask_trust(options, rig, error) : status;
    status = status == GONIO_OK ? gonio_rig_control_begin(rig, error) : status;
    status = status == GONIO_OK ? gonio_sim_open(rig->sim, options->threads, &rig->rig, error) : status;
    status = status == GONIO_OK ? gonio_hardware_open(rig->hardware, &rig->rig, true, error) : status;
    gonio_rig_control_opened(rig);
    return status;
}

static gonio_status reopen_file(gonio_session *session, const char *extra, const gonio_rig_file_options *options,
                                gonio_rig_file *rig, gonio_error *error) {
    char *settings = NULL;
    gonio_status status = gonio_rig_journalled(session, &rig->text, &settings, error);
    builder b = {.file_lines = gonio_rig_text_lines(rig->text)};
    if (status == GONIO_OK && asprintf(&rig->settings, "%s%s", settings, extra) < 0) {
        rig->settings = NULL;
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    }
    free(settings);
    status = status == GONIO_OK ? new_hardware(&b, rig, error) : status;
    if (status == GONIO_OK) {
        status =
            build(&b, rig->text, rig->settings, "the journalled rig file", &(gonio_rig_file_options){.seed = 1}, error);
        rig->sim = b.sim;
    }
    status = status == GONIO_OK ? ask_trust(options, rig, error) : status;
    return status == GONIO_OK ? open_devices(&b, options->threads, rig, error) : status;
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

// The lines as one text for the journal's events.
static gonio_status tell_changes(gonio_session *session, const char *lines, gonio_error *error) {
    char *text = strdup(lines);
    if (text == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for settings");
    }
    for (char *end = text; (end = strchr(end, '\n')) != NULL;) {
        *end = end[1] != 0 ? ',' : 0;
    }
    const gonio_status status = text[0] != 0 ? gonio_session_event(session, "settings changed", text, error) : GONIO_OK;
    free(text);
    return status;
}

// The caller's own file names what is opened, so he has allowed it.
static bool allowed(void *context, const char *devices) { return (void)context, (void)devices, true; }

gonio_status gonio_rig_file_refill(gonio_session *session, const gonio_rig_file_options *given, gonio_rig_file *rig,
                                   gonio_error *error) {
    gonio_rig_file_options options = *given;
    begin(&options, rig);
    char *driver = NULL, *extra = NULL;
    gonio_setup setup;
    gonio_status status = gonio_rig_text_settings(&options, &extra, error);
    status = status == GONIO_OK ? read_setup(session, &setup, error) : status;
    bool whole = false;
    if (status == GONIO_OK && options.path != NULL && strcmp(options.path, "sim") != 0) {
        status = gonio_rig_change(session, options.path, &extra, &whole, error);
        options.trust = whole ? allowed : options.trust;
    }
    status = status == GONIO_OK ? gonio_session_get(session, "rig.driver", &driver, error) : status;
    if (status == GONIO_OK) {
        gonio_session_get(session, "rig.path", &rig->path, NULL); // where there is none, it stays NULL
        snprintf(rig->driver, sizeof rig->driver, "%s", driver);
        status = strcmp(driver, "sim") == 0 ? reopen_sim(session, extra, &options, rig, error)
                                            : reopen_file(session, extra, &options, rig, error);
    }
    rig->scan = status == GONIO_OK ? setup.scan : rig->scan;
    status = status == GONIO_OK ? tell_changes(session, extra, error) : status;
    status = status == GONIO_OK ? gonio_session_event(session, "resumed", "", error) : status;
    status = status == GONIO_OK ? tell_identity(session, rig, error) : status;
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
