// SPDX-License-Identifier: BSD-3-Clause
// Every driver of the list: its operations are whole, its keys are its own and are refused with their line where they
// are wrong, a device that is not there is named, the null ones answer everything, and docs/hardware.md names what
// there is.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "gonio/acquire.h"
#include "gonio/sim.h"
#include "host/drivers/driver.h"
#include "host/drivers/hardware.h"
#include "host/drivers/keep_out.h"
#include "host/drivers/null.h"
#include "host/drivers/shadow.h"
#include "tests/fuzz/memory_file.h"

static size_t cases; // of the test that runs

static int tell(void **state) {
    (void)state;
    int n = 0;
    while (gonio_driver_at(n) != NULL) {
        n++;
    }
    print_message("# %d drivers, %zu cases\n", n, cases);
    cases = 0;
    return 0;
}

// Open the rig that a text describes. sample: of a simulated one, else NULL.
static gonio_status open_text(const char *text, const char *sample, gonio_error *error) {
    const gonio_rig_file_options options = {
        .path = memory_file((const uint8_t *)text, strlen(text)), .sample = sample, .seed = 1, .threads = 1};
    gonio_rig_file *rig = NULL;
    *error = (gonio_error){.line = -1, .byte = -1};
    const gonio_status status = gonio_rig_file_open(&options, &rig, error);
    gonio_rig_file_close(rig);
    return status;
}

// The keys of a driver, one table after the other; NULL past the last.
static const gonio_key *key_at(const gonio_driver *d, int number) {
    const gonio_key *const tables[] = {d->keys, d->controller ? gonio_controller_keys : NULL};
    for (int t = 0; t < 2; t++) {
        for (const gonio_key *key = tables[t]; key != NULL && key->name != NULL; key++) {
            if (number-- == 0) {
                return key;
            }
        }
    }
    return NULL;
}

static bool has_key(const gonio_driver *d, const char *section, const char *name) {
    const gonio_key *key;
    for (int i = 0; (key = key_at(d, i)) != NULL; i++) {
        if (strcmp(key->section, section) == 0 && strcmp(key->name, name) == 0) {
            return true;
        }
    }
    return false;
}

// ---- what a driver is ----

static void complete(const gonio_driver *d) {
    const gonio_stage_ops *stage = d->ops;
    const gonio_lamp_ops *lamp = d->ops;
    const gonio_meter_ops *meter = d->ops;
    const gonio_camera_ops *camera = d->ops;
    const gonio_interlock_ops *interlock = d->ops;
    const gonio_mount_ops *mount = d->ops;
    // Every operations struct begins with a name.
    assert_true(stage->name[0] != 0);
    switch (d->device) {
    case GONIO_DEVICE_INTERLOCK:
        assert_true(interlock->check != NULL && interlock->close != NULL);
        return;
    case GONIO_DEVICE_STAGE:
        assert_true(stage->home != NULL && stage->move != NULL && stage->position != NULL && stage->stop != NULL);
        assert_true(stage->duration_s != NULL && stage->close != NULL);
        assert_true(stage->real == (strcmp(d->name, "null") != 0)); // what there is nothing of needs no time to settle
        return;
    case GONIO_DEVICE_LAMP:
        assert_true(lamp->set_level != NULL && lamp->set_shutter != NULL && lamp->wait_ready != NULL);
        assert_non_null(lamp->close);
        return;
    case GONIO_DEVICE_METER:
        assert_true(meter->read != NULL && meter->close != NULL);
        return;
    case GONIO_DEVICE_CAMERA:
        assert_true(camera->info != NULL && camera->capture != NULL && camera->close != NULL);
        assert_true((camera->stream != NULL) == (camera->next != NULL));
        return;
    case GONIO_DEVICE_MOUNT:
        assert_true(mount->mount != NULL && mount->close != NULL);
        return;
    case GONIO_DEVICES:
        fail();
    }
}

static void drivers_are_whole(void **state) {
    (void)state;
    for (int i = 0; gonio_driver_at(i) != NULL; i++) {
        const gonio_driver *d = gonio_driver_at(i);
        assert_ptr_equal(gonio_driver_find(d->device, d->name), d); // no other has its name
        assert_true(d->summary[0] != 0 && d->open != NULL && (d->keys != NULL) == (d->settings > 0));
        complete(d);
        for (const gonio_key *key = d->keys; key != NULL && key->name != NULL; key++) {
            assert_true(key->size > 0 && key->offset + key->size <= d->settings && key->low <= key->high);
            for (const gonio_key *other = d->keys; other != key; other++) {
                assert_true(strcmp(other->section, key->section) != 0 || strcmp(other->name, key->name) != 0);
            }
        }
        cases++;
    }
    for (int k = 0; k < GONIO_DEVICES; k++) { // a rig of null devices has every one
        assert_non_null(gonio_driver_find((gonio_device)k, "null"));
    }
}

// A stage behind keep-out zones, or in front of a simulated one, is what it was: no operation is made up or lost.
static void a_wrapped_stage_stays_what_it_is(void **state) {
    (void)state;
    for (int i = 0; gonio_driver_at(i) != NULL; i++) {
        const gonio_driver *d = gonio_driver_at(i);
        const gonio_stage_ops *inner = d->ops;
        const gonio_keep_out zones = {0};
        for (int how = 0; how < 2 && d->device == GONIO_DEVICE_STAGE; how++) {
            gonio_rig rig = {.stage = inner};
            assert_int_equal(how == 0 ? gonio_keep_out_guard(&zones, &rig, NULL)
                                      : gonio_shadow_stage(&rig, inner, NULL, NULL),
                             GONIO_OK);
            assert_true((rig.stage->audit != NULL) == (inner->audit != NULL));
            assert_true((rig.stage->verify != NULL) == (inner->verify != NULL));
            assert_true(how == 0 || (rig.stage->encoders != NULL) == (inner->encoders != NULL));
            assert_true(rig.stage->independent == inner->independent && rig.stage->real == inner->real);
            free(rig.stage_device); // the wrapping alone: there is no device in it
            cases++;
        }
    }
}

// ---- null devices ----

static void null_camera_answers(const gonio_rig *rig) {
    const gonio_stamp stamp = {0};
    gonio_camera_info info;
    assert_int_equal(rig->camera->info(rig->camera_device, &info, NULL), GONIO_OK);
    uint16_t pixels[6] = {1, 1, 1, 1, 1, 1};
    const gonio_window window = {info.width - 3, info.height - 2, 3, 2}, outside = {info.width - 2, 0, 3, 2};
    gonio_frame frame = {.pixels = pixels};
    assert_int_equal(rig->camera->capture(rig->camera_device, &window, 0.1, 0, &stamp, 1, &frame, NULL), GONIO_OK);
    assert_true(pixels[0] == 0 && pixels[5] == 0);
    assert_int_equal(rig->camera->capture(rig->camera_device, &outside, 0.1, 0, &stamp, 1, &frame, NULL),
                     GONIO_E_RANGE);
}

static void null_devices_answer(void **state) {
    (void)state;
    gonio_rig rig = {0};
    assert_int_equal(gonio_null_rig_open(&rig, NULL), GONIO_OK);
    // Once more by name, in place of those.
    gonio_hardware *hardware;
    const gonio_hardware_hooks hooks = {0};
    assert_int_equal(gonio_hardware_new(&hooks, &hardware, NULL), GONIO_OK);
    for (int k = 0; k < GONIO_DEVICES; k++) {
        bool taken, shared;
        assert_int_equal(
            gonio_hardware_set(hardware, gonio_device_name((gonio_device)k), "driver", "null", &taken, &shared, NULL),
            GONIO_OK);
        assert_true(taken);
    }
    assert_int_equal(gonio_hardware_open(hardware, &rig, false, NULL), GONIO_OK);
    const gonio_stamp stamp = {0};
    const double there[GONIO_AXES] = {0.1, 0.2, -0.3, 0.4};
    double at[GONIO_AXES], value, sigma, waited;
    assert_int_equal(rig.stage->home(rig.stage_device, 1, NULL), GONIO_OK);
    assert_int_equal(rig.stage->move(rig.stage_device, there, 1, &stamp, 1, NULL), GONIO_OK);
    assert_int_equal(rig.stage->position(rig.stage_device, at, NULL), GONIO_OK);
    assert_memory_equal(at, there, sizeof at);
    assert_true(rig.stage->duration_s(rig.stage_device, at, there) == 0);
    assert_int_equal(rig.stage->stop(rig.stage_device, NULL), GONIO_OK);
    assert_int_equal(rig.lamp->set_level(rig.lamp_device, 1, NULL), GONIO_OK);
    assert_int_equal(rig.lamp->set_level(rig.lamp_device, 1.5, NULL), GONIO_E_RANGE);
    assert_int_equal(rig.lamp->set_shutter(rig.lamp_device, true, NULL), GONIO_OK);
    assert_int_equal(rig.lamp->wait_ready(rig.lamp_device, &stamp, 0, &waited, NULL), GONIO_OK);
    assert_int_equal(rig.meter->read(rig.meter_device, &stamp, 0.1, &value, &sigma, NULL), GONIO_OK);
    assert_true(value > 0 && sigma > 0);
    assert_int_equal(rig.interlock->check(rig.interlock_device, NULL), GONIO_OK);
    for (int target = GONIO_TARGET_SAMPLE; target <= GONIO_TARGET_MIRROR; target++) {
        assert_int_equal(rig.mount->mount(rig.mount_device, (gonio_target)target, NULL), GONIO_OK);
    }
    null_camera_answers(&rig);
    gonio_rig_close(&rig);
    gonio_hardware_free(hardware);
    cases += GONIO_DEVICES;
}

// ---- keys ----

enum { KEY_LINE = 6 };

static void text_with(char *text, size_t size, const gonio_driver *d, const char *section, const char *key,
                      const char *value) {
    snprintf(text, size, "[rig]\ndriver = null\n[%s]\ndriver = %s\n[%s]\n%s = %s\n", gonio_device_name(d->device),
             d->name, section, key, value);
}

static void refused(const gonio_driver *d, const char *section, const char *key, const char *value, const char *says,
                    const char *says_too) {
    char text[700];
    gonio_error error;
    text_with(text, sizeof text, d, section, key, value);
    const gonio_status status = open_text(text, NULL, &error);
    if (status != GONIO_E_INPUT || error.line != KEY_LINE || strstr(error.message, says) == NULL ||
        strstr(error.message, says_too) == NULL) {
        fail_msg("[%s] %s = '%s' with driver %s: %s, line %lld: '%s'; expected '%s', '%s'", section, key, value,
                 d->name, gonio_status_name(status), error.line, error.message, says, says_too);
    }
    cases++;
}

static void unknown_keys_are_refused(void **state) {
    (void)state;
    for (int i = 0; gonio_driver_at(i) != NULL; i++) {
        const gonio_driver *d = gonio_driver_at(i);
        const char *own = gonio_device_name(d->device);
        refused(d, own, "no_such_key", "1", "no_such_key", " driver");
        const gonio_key *key;
        for (int k = 0; (key = key_at(d, k)) != NULL; k++) {
            // The list names every key of the section.
            char name[80];
            snprintf(name, sizeof name, " %s", key->name);
            refused(d, key->section, "no_such_key", "1", "no_such_key", name);
        }
    }
}

// A key of a driver that was not chosen: refused, and told whose it is.
static void a_key_of_another_driver_says_so(void **state) {
    (void)state;
    for (int i = 0; gonio_driver_at(i) != NULL; i++) {
        const gonio_driver *owner = gonio_driver_at(i);
        const gonio_key *key;
        for (int k = 0; (key = key_at(owner, k)) != NULL; k++) {
            const char *section = key->section;
            char whose[80], text[200];
            snprintf(whose, sizeof whose, "[%s] driver = %s", gonio_device_name(owner->device), owner->name);
            for (int j = 0; gonio_driver_at(j) != NULL; j++) {
                const gonio_driver *other = gonio_driver_at(j);
                if (other->device == owner->device && !has_key(other, section, key->name)) {
                    refused(other, section, key->name, "1", whose, key->name);
                }
            }
            if (!gonio_sim_has_key(section, key->name)) {
                gonio_error error;
                snprintf(text, sizeof text, "[rig]\ndriver = sim\n\n[%s]\n\n%s = 1\n", section, key->name);
                assert_int_equal(open_text(text, "lambert:rho=0.5", &error), GONIO_E_INPUT);
                assert_int_equal(error.line, KEY_LINE);
                assert_non_null(strstr(error.message, whose));
                cases++;
            }
        }
    }
}

static bool is_text(const gonio_key *key) { return key->kind == GONIO_KEY_LINE; }

// Values that the key must take, or must not; NULL past the last.
static const char *value_of(const gonio_key *key, bool good, int number, char *text, size_t size) {
    static const char *const good_words[][4] = {
        [GONIO_KEY_LINE] = {"a"}, [GONIO_KEY_BOOLEAN] = {"0", "1"}, [GONIO_KEY_OWN] = {"0", "fFfF", "0x1313"}};
    static const char *const bad_words[] = {"", "maybe", "2 1", "12345"};
    static const char *const bad_numbers[] = {"", "x", "nan", "1x", "inf"};
    const bool numeric = key->kind == GONIO_KEY_INTEGER || key->kind == GONIO_KEY_REAL;
    if (numeric && number < 2) {
        const double out = good ? 0 : 1 + 1e-3 * fmax(fabs(key->low), fabs(key->high));
        snprintf(text, size, "%.17g", number == 0 ? key->low - out : key->high + out);
        return text;
    }
    if (numeric) {
        return good || number - 2 >= 5 ? NULL : bad_numbers[number - 2];
    }
    if (good && key->names != NULL) {
        return key->names()[number];
    }
    if (good) {
        return good_words[key->kind][number];
    }
    if (is_text(key) && number == 1 && key->size < 150) { // what fits into a line
        memset(text, 'a', key->size);
        text[key->size] = 0;
        return text;
    }
    return number < (is_text(key) ? 1 : 4) ? bad_words[number] : NULL;
}

static void values_are_checked(void **state) {
    (void)state;
    for (int i = 0; gonio_driver_at(i) != NULL; i++) {
        const gonio_driver *d = gonio_driver_at(i);
        const gonio_key *key;
        for (int k = 0; (key = key_at(d, k)) != NULL; k++) {
            const char *section = key->section, *value;
            char text[300], place[100];
            snprintf(place, sizeof place, "[%s] %s: found '", section, key->name);
            for (int n = 0; (value = value_of(key, false, n, text, sizeof text)) != NULL; n++) {
                refused(d, section, key->name, value, place, "expected ");
            }
            gonio_hardware *hardware;
            const gonio_hardware_hooks hooks = {0};
            bool taken, shared;
            assert_int_equal(gonio_hardware_new(&hooks, &hardware, NULL), GONIO_OK);
            assert_int_equal(
                gonio_hardware_set(hardware, gonio_device_name(d->device), "driver", d->name, &taken, &shared, NULL),
                GONIO_OK);
            for (int n = 0; (value = value_of(key, true, n, text, sizeof text)) != NULL; n++) {
                gonio_error error = {0};
                if (gonio_hardware_set(hardware, section, key->name, value, &taken, &shared, &error) != GONIO_OK) {
                    fail_msg("%s", error.message);
                }
                assert_true(taken && shared == key->shared && (!shared || gonio_sim_has_key(section, key->name)));
                cases++;
            }
            gonio_hardware_free(hardware);
        }
    }
}

static void wrong_drivers_are_refused(void **state) {
    (void)state;
    for (int k = 0; k < GONIO_DEVICES; k++) {
        char text[100], names[100];
        gonio_error error;
        snprintf(text, sizeof text, "[rig]\ndriver = null\n[%s]\ndriver = magic\n", gonio_device_name((gonio_device)k));
        assert_int_equal(open_text(text, NULL, &error), GONIO_E_INPUT);
        assert_int_equal(error.line, 4);
        gonio_driver_names((gonio_device)k, names, sizeof names);
        assert_non_null(strstr(error.message, names));
        cases++;
    }
    gonio_error error;
    assert_int_equal(open_text("[rig]\ndriver = null\n[nonsense]\ndriver = gpio\n", NULL, &error), GONIO_E_INPUT);
    assert_int_equal(error.line, 4);
    assert_int_equal(open_text("[rig]\ndriver = null\n[nonsense]\nkey = 1\n", NULL, &error), GONIO_E_INPUT);
    assert_int_equal(error.line, 4);
    assert_non_null(strstr(error.message, "nonsense"));
}

// ---- faults ----

// Where nothing is: what to put into the rig file, and what the error must name of it.
static const struct {
    gonio_device device;
    const char *driver, *keys, *named;
} absent[] = {
    {GONIO_DEVICE_INTERLOCK, "gpio", "estop_line = gpiochip77:3\n", "gpiochip77"},
    {GONIO_DEVICE_STAGE, "modbus", "[controller]\nport = /dev/gonio-absent\nreplug_s = 0\n", "/dev/gonio-absent"},
    {GONIO_DEVICE_STAGE, "lines", "port = /dev/gonio-absent\n[axis light_theta]\nname = X\n", "/dev/gonio-absent"},
    {GONIO_DEVICE_STAGE, "modbus-table",
     "port = /dev/gonio-absent\nreplug_s = 0\ntable = leadshine\n[axis light_theta]\nslave = 1\n", "/dev/gonio-absent"},
    {GONIO_DEVICE_LAMP, "modbus", "[controller]\nport = /dev/gonio-absent\nreplug_s = 0\n", "/dev/gonio-absent"},
    {GONIO_DEVICE_LAMP, "gpio", "enable_line = gpiochip77:3\n", "gpiochip77"},
    {GONIO_DEVICE_METER, "usbtmc", "vendor = fffe\nproduct = fffd\nreplug_s = 0\n", "fffe"},
    {GONIO_DEVICE_METER, "scpi", "port = /dev/gonio-absent\nreplug_s = 0\n", "/dev/gonio-absent"},
    {GONIO_DEVICE_METER, "modbus", "[controller]\nport = /dev/gonio-absent\nreplug_s = 0\n", "/dev/gonio-absent"},
    {GONIO_DEVICE_CAMERA, "aravis", "device = Absent-7\nreplug_s = 0\n", "Absent-7"},
    {GONIO_DEVICE_CAMERA, "v4l2", "device = /dev/gonio-absent\nreplug_s = 0\n", "/dev/gonio-absent"},
};

static void an_absent_device_is_named(void **state) {
    (void)state;
    for (int i = 0; gonio_driver_at(i) != NULL; i++) {
        const gonio_driver *d = gonio_driver_at(i);
        size_t k = 0;
        while (k < sizeof absent / sizeof *absent &&
               (absent[k].device != d->device || strcmp(absent[k].driver, d->name) != 0)) {
            k++;
        }
        if (strcmp(d->name, "null") == 0) {
            continue;
        }
        if (k == sizeof absent / sizeof *absent) {
            fail_msg("[%s] driver = %s: say above how its device is absent", gonio_device_name(d->device), d->name);
        }
        char text[300];
        gonio_error error;
        snprintf(text, sizeof text, "[rig]\ndriver = null\n[%s]\ndriver = %s\n%s", gonio_device_name(d->device),
                 d->name, absent[k].keys);
        alarm(60); // a driver that waits for ever ends the test
        const gonio_status status = open_text(text, NULL, &error);
        alarm(0);
        if ((status != GONIO_E_DEVICE && status != GONIO_E_TIMEOUT) || strstr(error.message, absent[k].named) == NULL) {
            fail_msg("[%s] driver = %s: %s '%s'; expected a device's fault that names %s", gonio_device_name(d->device),
                     d->name, gonio_status_name(status), error.message, absent[k].named);
        }
        cases++;
    }
}

// ---- docs/hardware.md ----

static char *read_docs(void) {
    FILE *file = fopen("docs/hardware.md", "rb");
    assert_non_null(file);
    char *text = calloc(1, 1 << 18);
    assert_true(fread(text, 1, (1 << 18) - 1, file) > 0);
    fclose(file);
    return text;
}

typedef struct word {
    char section[48], name[48];
} word;

static bool is_key_word(const char *text, size_t n) {
    size_t k = 0;
    while (k < n && strchr("abcdefghijklmnopqrstuvwxyz0123456789_", text[k]) != NULL) {
        k++;
    }
    return n > 1 && n < sizeof((word *)0)->name && k == n;
}

// The words of a piece of code up to an equals sign; none where one of them cannot be a key.
static int words_of(const char *code, size_t n, const char *section, word *words) {
    const char *equals = memchr(code, '=', n);
    const char *end = equals != NULL ? equals : code + n;
    int count = 0;
    for (const char *at = code; at < end;) {
        const size_t blank = strspn(at, " ");
        const char *first = at + blank < end ? at + blank : end;
        size_t length = strcspn(first, " `");
        length = first + length > end ? (size_t)(end - first) : length;
        if (length > 0 && !is_key_word(first, length)) {
            return 0;
        }
        if (length > 0) {
            snprintf(words[count].section, sizeof words->section, "%s", section);
            snprintf(words[count++].name, sizeof words->name, "%.*s", (int)length, first);
        }
        at = first + length + (length == 0);
    }
    return count;
}

// What the chapter "Keys" names: words in backticks, under the section in backticks that stands before them.
static int documented(char *docs, word *words) {
    char *at = strstr(docs, "\n## Keys\n"), *end = strstr(docs, "```ini");
    assert_true(at != NULL && end != NULL && at < end);
    char section[48] = "";
    int n = 0;
    while ((at = strchr(at, '`')) != NULL && at < end) {
        const char *code = at + 1;
        const size_t length = strcspn(code, "`");
        if (code[0] == '[' && memchr(code, ']', length) == code + length - 1) {
            snprintf(section, sizeof section, "%.*s", (int)length - 2, code + 1);
        } else if (strncmp(code, "gonio ", 6) != 0 && n < 480) {
            n += words_of(code, length, section, words + n);
        }
        at += length + 2;
    }
    return n;
}

static bool is_documented(const word *words, int n, const char *section, const char *name) {
    for (int i = 0; i < n; i++) {
        if (strcmp(words[i].section, section) == 0 && strcmp(words[i].name, name) == 0) {
            return true;
        }
    }
    return false;
}

// The four axes have the same keys, documented once.
static const char *documented_section(const char *section) {
    return strncmp(section, "axis ", 5) == 0 ? "axis light_theta" : section;
}

static bool known(const word *w) {
    bool section = false;
    for (int i = 0; gonio_driver_at(i) != NULL; i++) {
        const gonio_driver *d = gonio_driver_at(i);
        const gonio_key *key;
        for (int k = 0; (key = key_at(d, k)) != NULL; k++) {
            section = section || strcmp(key->section, w->section) == 0;
        }
        if (has_key(d, w->section, w->name) || strcmp(d->name, w->name) == 0) {
            return true;
        }
    }
    const bool axis = strcmp(w->section, "axis light_theta") == 0 &&
                      strstr(" light_theta light_phi camera_theta camera_phi ", w->name) != NULL;
    return !section || axis; // other sections' keys are not drivers'
}

static void the_documentation_names_every_key(void **state) {
    (void)state;
    char *docs = read_docs();
    word *words = calloc(500, sizeof *words);
    const int n = documented(docs, words);
    for (int i = 0; gonio_driver_at(i) != NULL; i++) {
        const gonio_driver *d = gonio_driver_at(i);
        char row[60], name[40];
        snprintf(row, sizeof row, "\n| `[%s]` |", gonio_device_name(d->device));
        snprintf(name, sizeof name, "`%s`", d->name);
        char *at = strstr(docs, row), *line_end = at != NULL ? strchr(at + 1, '\n') : NULL;
        char *found = at != NULL ? strstr(at, name) : NULL;
        if (found == NULL || found > line_end) {
            fail_msg("docs/hardware.md: the table has no `[%s]` %s", gonio_device_name(d->device), name);
        }
        const gonio_key *key;
        for (int k = 0; (key = key_at(d, k)) != NULL; k++) {
            const char *section = documented_section(key->section);
            if (!is_documented(words, n, section, key->name)) {
                fail_msg("docs/hardware.md: `[%s]` lacks `%s`", section, key->name);
            }
            cases++;
        }
    }
    for (int i = 0; i < n; i++) {
        if (!known(&words[i])) {
            fail_msg("docs/hardware.md: `[%s]`: `%s` is no key of a driver", words[i].section, words[i].name);
        }
        cases++;
    }
    assert_true(n > 60);
    free(words);
    free(docs);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(drivers_are_whole, tell),
        cmocka_unit_test_teardown(a_wrapped_stage_stays_what_it_is, tell),
        cmocka_unit_test_teardown(null_devices_answer, tell),
        cmocka_unit_test_teardown(unknown_keys_are_refused, tell),
        cmocka_unit_test_teardown(a_key_of_another_driver_says_so, tell),
        cmocka_unit_test_teardown(values_are_checked, tell),
        cmocka_unit_test_teardown(wrong_drivers_are_refused, tell),
        cmocka_unit_test_teardown(an_absent_device_is_named, tell),
        cmocka_unit_test_teardown(the_documentation_names_every_key, tell),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
