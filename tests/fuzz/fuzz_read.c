// SPDX-License-Identifier: BSD-3-Clause
// Any bytes as a BRDF file: read as samples, which must then be sound and come back from a CSV; and as a table, which
// must evaluate to finite numbers.
#include <math.h>
#include <string.h>

#include "gonio/io.h"
#include "tests/format_files.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static char removed[64];
static void remove_directions(void) { unlink(removed); }

static void require(int condition) {
    if (!condition) {
        abort();
    }
}

static void check_samples(const gonio_samples *s) {
    const double furthest = s->transmission ? GONIO_PI : GONIO_PI / 2;
    for (size_t i = 0; i < s->n; i++) {
        const gonio_pair *p = &s->pairs[i];
        require(p->theta_i >= 0 && p->theta_i <= furthest && p->theta_o >= 0 && p->theta_o <= furthest);
        require(isfinite(p->phi_i) && isfinite(p->phi_o));
        for (int c = 0; c < s->channels; c++) {
            require(isfinite(s->values[i * (size_t)s->channels + (size_t)c]));
        }
    }
    char *text;
    size_t size;
    FILE *stream = open_memstream(&text, &size);
    require(stream != NULL && gonio_write_samples_stream(s, stream, NULL) == GONIO_OK);
    fclose(stream);
    gonio_read_options options;
    gonio_read_options_default(&options);
    options.settings[0] = (gonio_format_setting){"negatives", "keep"};
    options.settings[1] = (gonio_format_setting){"missing", "none"}; // zeros among bright values are what was read
    gonio_samples *again;
    require(gonio_read(memory_file((const uint8_t *)text, size), &options, &again, NULL, NULL) == GONIO_OK);
    require(again->transmission == s->transmission && again->n == s->n &&
            memcmp(again->pairs, s->pairs, s->n * sizeof *s->pairs) == 0);
    require(memcmp(again->values, s->values, s->n * (size_t)s->channels * sizeof(double)) == 0);
    gonio_samples_free(again);
    free(text);
}

// With the second file that some formats read.
static void with_directions(const uint8_t *data, size_t size) {
    static char directions[] = "/tmp/gonio-fuzz-XXXXXX";
    if (removed[0] == 0) {
        char *text = format_directions();
        const int fd = mkstemp(directions);
        require(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text) && close(fd) == 0);
        free(text);
        atexit(remove_directions);
        snprintf(removed, sizeof removed, "%s", directions);
    }
    const gonio_read_options options = {.settings = {{"directions", directions}, {"negatives", "keep"}}};
    gonio_samples *samples;
    if (gonio_read(memory_file(data, size), &options, &samples, NULL, NULL) == GONIO_OK) {
        check_samples(samples);
        gonio_samples_free(samples);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    // Which of the options there is depends on the format.
    gonio_read_options options = {.seed = 1, .settings = {{"negatives", "keep"}}};
    const char *path = memory_file(data, size);
    gonio_samples *samples;
    gonio_error error = {0};
    gonio_status status = gonio_read(path, &options, &samples, NULL, &error);
    if (status == GONIO_E_USAGE) {
        options.settings[0] = (gonio_format_setting){"limit", "100"};
        status = gonio_read(path, &options, &samples, NULL, &error);
    }
    if (status == GONIO_OK) {
        check_samples(samples);
        gonio_samples_free(samples);
    } else {
        require(samples == NULL && error.message[0] != 0);
    }
    with_directions(data, size);
    // The same as a table of somebody's own.
    static const char *const columns[] = {"auto", "theta_i=1,theta_o=2,value=3", "theta_i=30deg,theta_o=#1"};
    for (size_t k = 0; k < sizeof columns / sizeof *columns; k++) {
        const gonio_read_options mapped = {
            .settings = {{"negatives", "keep"}, {"signed", "yes"}, {"quantity", "brf"}, {"columns", columns[k]}}};
        status = gonio_read(memory_file(data, size), &mapped, &samples, NULL, &error);
        if (status == GONIO_OK) {
            check_samples(samples);
            gonio_samples_free(samples);
        } else {
            require(samples == NULL && error.message[0] != 0);
        }
    }
    const gonio_read_options matrix = {
        .settings = {{"negatives", "keep"}, {"signed", "yes"}, {"quantity", "brf"}, {"matrix", "theta_o,theta_i,phi"}}};
    if (gonio_read(memory_file(data, size), &matrix, &samples, NULL, &error) == GONIO_OK) {
        check_samples(samples);
        gonio_samples_free(samples);
    }
    gonio_model *model;
    if (gonio_read_table(memory_file(data, size), &model, &error) == GONIO_OK) {
        double values[GONIO_CHANNELS_MAX];
        for (int k = 0; k < 20; k++) {
            gonio_model_eval(model, gonio_direction(0.08 * k, k), gonio_direction(1.57 - 0.07 * k, 2 * k), values);
            for (int c = 0; c < model->channels; c++) {
                require(!isnan(values[c]));
            }
        }
        gonio_model_free(model);
    }
    return 0;
}
