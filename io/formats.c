// SPDX-License-Identifier: BSD-3-Clause
// The list of formats: by number, by name, by extension; the values of their options; writing.
#include <errno.h>
#include <string.h>
#include <strings.h>

#include "gonio/output.h"
#include "io/format.h"

#define GONIO_FORMAT(name) extern const gonio_format gonio_format_##name;
#include "io/formats.def"
#undef GONIO_FORMAT

static const gonio_format *const formats[] = {
#define GONIO_FORMAT(name) &gonio_format_##name,
#include "io/formats.def"
#undef GONIO_FORMAT
};
#define COUNT ((int)(sizeof formats / sizeof *formats))

const gonio_format *gonio_format_at(int number) { return number >= 0 && number < COUNT ? formats[number] : NULL; }

static const gonio_format_option none[] = {{0}};
static const gonio_format_alias no_alias[] = {{0}};

static const gonio_format_option *options_of(const gonio_format *f) { return f->options != NULL ? f->options : none; }

static void describe(const gonio_format *f, gonio_format_facts *facts) {
    *facts = (gonio_format_facts){.name = f->name,
                                  .summary = f->summary,
                                  .extensions = f->extensions,
                                  .reads = f->read != NULL,
                                  .reads_table = f->table != NULL,
                                  .writes = f->write != NULL,
                                  .writes_table = f->write_table != NULL,
                                  .precision = f->precision,
                                  .options = options_of(f),
                                  .write_options = f->write_options != NULL ? f->write_options : none,
                                  .aliases = f->aliases != NULL ? f->aliases : no_alias};
}

bool gonio_format_get(int number, gonio_format_facts *facts) {
    const gonio_format *f = gonio_format_at(number);
    if (f != NULL) {
        describe(f, facts);
    }
    return f != NULL;
}

// Append where there is room.
static void append(char *text, size_t size, const char *more, const char *separator) {
    const size_t used = strlen(text);
    snprintf(text + used, size - used, "%s%s", used > 0 ? separator : "", more);
}

void gonio_format_summaries(bool (*which)(const gonio_format *format), char *text, size_t size) {
    text[0] = 0;
    for (int i = 0; i < COUNT; i++) {
        if (which(formats[i])) {
            append(text, size, " ", ",");
            append(text, size, formats[i]->summary, "");
        }
    }
}

// ---- options ----

static bool parse_choice(const char *words, const char *value, int *choice) {
    const size_t length = strlen(value);
    *choice = 0;
    for (const char *word = words; length > 0; (*choice)++) {
        const size_t n = strcspn(word, "|");
        if (n == length && strncmp(word, value, n) == 0) {
            return true;
        }
        if (word[n] == 0) {
            return false;
        }
        word += n + 1;
    }
    return false;
}

static bool parse_value(const gonio_format_option *option, const char *text, gonio_format_value *value) {
    value->text = text;
    switch (option->type) {
    case GONIO_FORMAT_TEXT:
        return true;
    case GONIO_FORMAT_COUNT:
        return gonio_text_count(text, &value->count);
    case GONIO_FORMAT_FLAG:
    case GONIO_FORMAT_CHOICE:
        return parse_choice(option->argument, text, &value->choice);
    }
    return false;
}

static gonio_status no_such_option(const gonio_format *f, const gonio_format_option *options, const char *name,
                                   gonio_error *error) {
    char list[200] = "";
    for (const gonio_format_option *o = options; o->name != NULL; o++) {
        append(list, sizeof list, o->name, ", ");
    }
    return gonio_fail(error, GONIO_E_USAGE, "%s: no option of format %s; it has %s", name, f->name,
                      list[0] != 0 ? list : "none");
}

static gonio_status parse_setting(const gonio_format *f, const gonio_format_option *options,
                                  const gonio_format_setting *setting, gonio_format_values *values,
                                  gonio_error *error) {
    for (int k = 0; options[k].name != NULL; k++) {
        if (strcmp(options[k].name, setting->name) == 0) {
            return parse_value(&options[k], setting->value, &values->at[k])
                       ? GONIO_OK
                       : gonio_fail(error, GONIO_E_USAGE, "%s: expected %s, found '%s'", setting->name,
                                    options[k].argument, setting->value);
        }
    }
    return no_such_option(f, options, setting->name, error);
}

static gonio_status parse_all(const gonio_format *f, const gonio_format_option *options,
                              const gonio_format_setting *settings, gonio_format_values *values, gonio_error *error) {
    for (int k = 0; options[k].name != NULL; k++) {
        parse_value(&options[k], options[k].standard, &values->at[k]);
    }
    gonio_status status = GONIO_OK;
    for (int k = 0; settings != NULL && k < GONIO_FORMAT_SETTINGS_MAX && settings[k].name != NULL && status == GONIO_OK;
         k++) {
        status = parse_setting(f, options, &settings[k], values, error);
    }
    return status;
}

gonio_status gonio_format_parse(const gonio_format *format, const gonio_read_options *options,
                                gonio_format_values *values, gonio_error *error) {
    *values = (gonio_format_values){.seed = 1};
    if (options != NULL) {
        values->seed = options->seed;
        values->threads = options->threads;
        values->wavelength_nm = options->wavelength_nm;
    }
    return parse_all(format, options_of(format), options != NULL ? options->settings : NULL, values, error);
}

static const gonio_format_alias *alias_of(const gonio_format *f, const char *name) {
    for (const gonio_format_alias *a = f->aliases; a != NULL && name != NULL && a->name != NULL; a++) {
        if (strcmp(a->name, name) == 0) {
            return a;
        }
    }
    return NULL;
}

gonio_status gonio_format_parse_write(const gonio_format *format, const char *name, const gonio_write_options *options,
                                      gonio_format_values *values, gonio_error *error) {
    gonio_format_setting settings[GONIO_FORMAT_SETTINGS_MAX + 1] = {{0}}; // later ones count
    const gonio_format_alias *alias = alias_of(format, name);
    int n = 0;
    *values = (gonio_format_values){.seed = 1};
    if (alias != NULL && alias->setting != NULL) {
        settings[n++] = (gonio_format_setting){alias->setting, alias->value};
    }
    if (options != NULL) {
        values->threads = options->threads;
        values->max_bytes = options->max_bytes;
        values->half = options->half;
        for (int k = 0; n < GONIO_FORMAT_SETTINGS_MAX && options->settings[k].name != NULL; k++) {
            settings[n++] = options->settings[k];
        }
    }
    return parse_all(format, format->write_options != NULL ? format->write_options : none, settings, values, error);
}

// ---- writing ----

static bool has_extension(const gonio_format *f, const char *path) {
    const size_t length = strlen(path);
    for (const char *e = f->extensions; *e != 0; e += strcspn(e, " "), e += *e == ' ') {
        const size_t n = strcspn(e, " ");
        if (length > n && strncasecmp(path + length - n, e, n) == 0) {
            return true;
        }
    }
    return false;
}

gonio_status gonio_format_find_writer(const char *name, const char *path, const gonio_format **out,
                                      gonio_error *error) {
    char list[600] = "";
    for (int i = 0; i < COUNT; i++) {
        const gonio_format *f = formats[i];
        if (f->write == NULL && f->write_table == NULL) {
            continue;
        }
        if (name != NULL ? strcmp(name, f->name) == 0 || alias_of(f, name) != NULL : has_extension(f, path)) {
            *out = f;
            return GONIO_OK;
        }
        append(list, sizeof list, f->name, ", ");
        for (const gonio_format_alias *a = f->aliases; a != NULL && a->name != NULL; a++) {
            append(list, sizeof list, a->name, "=");
        }
        append(list, sizeof list, "(", " ");
        append(list, sizeof list, f->extensions, "");
        append(list, sizeof list, ")", "");
    }
    return name != NULL ? gonio_fail(error, GONIO_E_USAGE, "no format '%s' is written; those are %s", name, list)
                        : gonio_fail(error, GONIO_E_USAGE,
                                     "%s: no format that is written has this ending; those are %s", path, list);
}

gonio_status gonio_format_writer(const char *name, const char *path, gonio_format_facts *facts, gonio_error *error) {
    const gonio_format *f;
    const gonio_status status = gonio_format_find_writer(name, path, &f, error);
    if (status == GONIO_OK) {
        describe(f, facts);
    }
    return status;
}

gonio_status gonio_write_flushed(FILE *stream, const char *path, gonio_status status, gonio_error *error) {
    if (status == GONIO_OK && (fflush(stream) != 0 || ferror(stream))) {
        return gonio_fail_line(error, GONIO_E_IO, path, -1, "cannot write it: %s", strerror(errno));
    }
    return status;
}

static gonio_status put_samples(const gonio_format *f, const gonio_samples *samples, const char *path,
                                gonio_error *error) {
    gonio_output *output;
    gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *stream = gonio_output_stream(output);
    status = gonio_write_flushed(stream, path, f->write(samples, stream, error), error);
    if (status != GONIO_OK) {
        gonio_output_abandon(output);
        return status;
    }
    return gonio_output_commit(output, error);
}

gonio_status gonio_write_as(const gonio_samples *samples, const char *path, const char *format, gonio_error *error) {
    const gonio_format *f;
    const gonio_status status = gonio_format_find_writer(format, path, &f, error);
    if (status == GONIO_OK && f->write == NULL) {
        return gonio_fail(error, GONIO_E_USAGE, "a %s is written from a model, not from samples; `gonio fit` makes one",
                          f->summary);
    }
    return status == GONIO_OK ? put_samples(f, samples, path, error) : status;
}

gonio_status gonio_write_samples(const gonio_samples *samples, const char *path, gonio_error *error) {
    return put_samples(&gonio_format_samples, samples, path, error);
}

gonio_status gonio_write_samples_stream(const gonio_samples *samples, FILE *stream, gonio_error *error) {
    return gonio_write_flushed(stream, NULL, gonio_format_samples.write(samples, stream, error), error);
}
