// SPDX-License-Identifier: BSD-3-Clause
// formats/: the model in every format that is written from one, each with its report.
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "base/text.h"
#include "host/cli/bundle/bundle.h"

// Formats of which a folder for all programs wants more than the standard form.
static const struct {
    const char *format, *suffix, *setting, *value;
} variants[] = {
    {"rgl", "-rgb", "rgl-channels", "rgb"}, // Mitsuba takes this in rgb variants alone, and the other in spectral ones
    {"rgl", "-spectra", "rgl-channels", "spectra"}, // pbrt takes no other
    {"radiance", "-tree", NULL, NULL},
    {"radiance", "-klems", "radiance-basis", "klems-full"}, // WINDOW takes no tree
};
#define VARIANTS (sizeof variants / sizeof *variants)

static bool is_alias(const gonio_format_facts *f, const char *name, size_t n) {
    for (const gonio_format_alias *a = f->aliases; a->name != NULL; a++) {
        if (strlen(a->name) == n && strncmp(a->name, name, n) == 0) {
            return true;
        }
    }
    return strlen(f->name) == n && strncmp(f->name, name, n) == 0;
}

// Is the format one of a list with commas? NULL: all are.
static bool is_listed(const gonio_format_facts *f, const char *list) {
    bool is = list == NULL;
    for (const char *at = list; at != NULL && *at != 0; at += strspn(at, ",")) {
        const size_t n = strcspn(at, ",");
        is = is || is_alias(f, at, n);
        at += n;
    }
    return is;
}

gonio_status cli_bundle_check_list(const char *list, gonio_error *error) {
    for (const char *at = list; at != NULL && *at != 0; at += strspn(at, ",")) {
        const size_t n = strcspn(at, ",");
        gonio_format_facts f;
        char all[400] = "";
        bool found = false;
        for (int i = 0; gonio_format_get(i, &f); i++) {
            found = found || (f.writes_table && is_alias(&f, at, n));
            if (f.writes_table) {
                gonio_text_append(all, sizeof all, "%s%s", all[0] != 0 ? ", " : "", f.name);
            }
        }
        if (!found) {
            return gonio_fail(error, GONIO_E_USAGE,
                              "formats: no format '%.*s' is written from a model; those are %s, and their other names",
                              (int)n, at, all);
        }
        at += n;
    }
    return GONIO_OK;
}

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

// What a format refuses is told in the folder; what the machine refuses ends the work.
static bool is_refusal(gonio_status status) {
    return status != GONIO_E_IO && status != GONIO_E_MEMORY && status != GONIO_E_INTERRUPTED;
}

static gonio_status write_file(cli_bundle *b, const gonio_format_facts *f, const char *suffix, const char *setting,
                               const char *value, gonio_error *error) {
    if (b->n == CLI_BUNDLE_FILES) {
        return gonio_fail(error, GONIO_E_FAILED, "more than %d formats", CLI_BUNDLE_FILES);
    }
    cli_bundle_file *file = &b->files[b->n++];
    gonio_write_options options = {.threads = b->common->threads, .max_bytes = b->max_bytes};
    if (setting != NULL) {
        options.settings[0] = (gonio_format_setting){setting, value};
    }
    snprintf(file->format, sizeof file->format, "%s", f->name);
    snprintf(file->name, sizeof file->name, "%s%s%.*s", f->name, suffix, (int)strcspn(f->extensions, " "),
             f->extensions);
    char path[CLI_BUNDLE_PATH];
    snprintf(path, sizeof path, "%s/formats/%s", b->folder, file->name);
    gonio_error own = {.line = -1, .byte = -1};
    const double began = seconds();
    gonio_status status =
        cli_export_table_file(b->model, b->source, path, f->name, &options, b->fitted, &file->result, &own);
    file->seconds = seconds() - began;
    file->written = status == GONIO_OK;
    if (status != GONIO_OK && is_refusal(status)) {
        snprintf(file->refused, sizeof file->refused, "%s", own.message);
        status = GONIO_OK;
    } else if (status != GONIO_OK && error != NULL) {
        *error = own;
    }
    if (status == GONIO_OK && cli_interrupted()) {
        status = gonio_fail(error, GONIO_E_INTERRUPTED, "interrupted; nothing was written");
    }
    return status;
}

static void tell(const cli_bundle_file *file) {
    const gonio_write_report *r = &file->result.report;
    if (!file->written) {
        fprintf(stderr, "  %-20s not written: %s\n", file->name, cli_text(file->refused));
    } else {
        fprintf(stderr, "  %-20s %9.4g MB  median %.2g, p95 %.2g%s  %.1f s\n", file->name, (double)r->bytes / 1e6,
                r->median, r->p95, r->at_its_nodes ? " at its nodes" : "", file->seconds);
    }
}

gonio_status cli_bundle_formats(cli_bundle *b, const char *list, gonio_error *error) {
    gonio_format_facts f;
    gonio_status status = GONIO_OK;
    for (int i = 0; gonio_format_get(i, &f) && status == GONIO_OK; i++) {
        if (!f.writes_table || !is_listed(&f, list)) {
            continue;
        }
        const int first = b->n;
        for (size_t k = 0; k < VARIANTS && status == GONIO_OK; k++) {
            if (strcmp(variants[k].format, f.name) == 0) {
                status = write_file(b, &f, variants[k].suffix, variants[k].setting, variants[k].value, error);
            }
        }
        if (b->n == first && status == GONIO_OK) {
            status = write_file(b, &f, "", NULL, NULL, error);
        }
        for (int k = first; k < b->n && status == GONIO_OK && !b->common->json; k++) {
            tell(&b->files[k]);
        }
    }
    return status;
}

const cli_bundle_file *cli_bundle_find(const cli_bundle *bundle, const char *format, const char *name) {
    for (int k = 0; k < bundle->n; k++) {
        const cli_bundle_file *f = &bundle->files[k];
        if (f->written && strcmp(f->format, format) == 0 && (name == NULL || strcmp(f->name, name) == 0)) {
            return f;
        }
    }
    return NULL;
}
