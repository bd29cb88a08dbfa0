// SPDX-License-Identifier: BSD-3-Clause
// Results and failures, for people and as JSON.
#include "host/cli/cli.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"

const char *cli_text(const char *text) {
    static _Thread_local char *kept[8];
    static _Thread_local unsigned next;
    char **slot = &kept[next++ % 8];
    const size_t size = 8 * strlen(text) + 4; // \\u001b of a byte
    free(*slot);
    *slot = malloc(size);
    if (*slot == NULL) {
        return "(no memory for a text)";
    }
    gonio_text_printable(text, *slot, size);
    return *slot;
}

void cli_print_lines(const char *text) {
    char *copy = strdup(text), *rest = copy;
    const char *line;
    while (copy != NULL && (line = strsep(&rest, "\n")) != NULL) {
        printf("%s%s", cli_text(line), rest != NULL ? "\n" : "");
    }
    free(copy);
}

int cli_json(json_t *object) {
    const size_t flags = JSON_COMPACT | JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(17);
    char *text = object != NULL ? json_dumps(object, flags) : NULL;
    if (text != NULL && !gonio_text_is_printable(text)) { // control characters beyond ASCII, which JSON allows
        free(text);
        text = json_dumps(object, flags | JSON_ENSURE_ASCII);
    }
    if (text == NULL) {
        puts("{\"error\":{\"status\":1,\"message\":\"not enough memory\",\"file\":null,\"line\":null}}");
        json_decref(object);
        return 1;
    }
    printf("%s\n", text);
    free(text);
    json_decref(object);
    return 0;
}

int cli_fail(const cli_common *common, const gonio_error *error) {
    const int exit_status = gonio_status_exit(error->status);
    if (common->json) {
        json_t *line = error->line >= 0 ? json_integer(error->line) : json_null();
        json_t *detail = json_pack("{s:i,s:s,s:o,s:o}", "status", exit_status, "message", error->message, "file",
                                   cli_json_text(error->file), "line", line);
        if (error->byte >= 0) {
            json_object_set_new(detail, "byte", json_integer(error->byte));
        }
        cli_json(json_pack("{s:o}", "error", detail));
    }
    fputs("gonio: ", stderr);
    if (error->file[0] != 0) {
        fputs(cli_text(error->file), stderr);
        if (error->line >= 0) {
            fprintf(stderr, ":%lld", error->line);
        }
        if (error->byte >= 0) {
            fprintf(stderr, ": byte %lld", error->byte);
        }
        fputs(": ", stderr);
    }
    fprintf(stderr, "%s\n", error->message[0] != 0 ? cli_text(error->message) : gonio_status_text(error->status));
    return exit_status;
}

int cli_usage(const cli_common *common, const char *format, ...) {
    gonio_error error = {.status = GONIO_E_USAGE, .line = -1, .byte = -1};
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(error.message, sizeof error.message, format, arguments);
    va_end(arguments);
    return cli_fail(common, &error);
}

#define FIGURE(member) CLI_FIGURE(gonio_errors, member)
const cli_figure cli_figures[] = {
    FIGURE(rmse), FIGURE(max_abs), FIGURE(max_rel), FIGURE(median_rel), FIGURE(rms_log), FIGURE(rmse_70), {0}};

double cli_figure_of(const cli_figure *figure, const void *object) {
    double value;
    memcpy(&value, (const char *)object + figure->offset, sizeof value);
    return value;
}

json_t *cli_json_figures(const cli_figure *figures, const void *object) {
    json_t *out = json_object();
    for (const cli_figure *f = figures; f->name != NULL; f++) {
        json_object_set_new(out, f->name, cli_json_real(cli_figure_of(f, object)));
    }
    return out;
}

json_t *cli_json_errors(const gonio_errors *e) {
    json_t *object = cli_json_figures(cli_figures, e);
    json_object_set_new(object, "samples", json_integer((json_int_t)e->samples));
    return object;
}

json_t *cli_json_coverage(const gonio_coverage *c) {
    char text[400];
    gonio_coverage_text(c, text, sizeof text);
    return json_pack("{s:I,s:I,s:I,s:b,s:[f,f],s:[f,f],s:f,s:f,s:[f,f,f,f],s:b,s:s}", "samples", (json_int_t)c->samples,
                     "geometries", (json_int_t)c->geometries, "incidences", (json_int_t)c->incidences, "in_plane",
                     (int)c->in_plane, "theta_i", c->theta_i_deg[0], c->theta_i_deg[1], "theta_o", c->theta_o_deg[0],
                     c->theta_o_deg[1], "horizon_deg", c->horizon_deg, "hole_deg", c->hole_deg, "hole",
                     gonio_degrees(c->hole.theta_i), gonio_degrees(c->hole.phi_i), gonio_degrees(c->hole.theta_o),
                     gonio_degrees(c->hole.phi_o), "narrow", (int)gonio_coverage_is_narrow(c), "text", text);
}

void cli_print_coverage(const gonio_coverage *coverage) {
    char text[400];
    gonio_coverage_text(coverage, text, sizeof text);
    printf("%-10s %s\n", "sampled", text);
    if (gonio_coverage_is_narrow(coverage)) {
        printf("%-10s errors, the held-out ones too, are of what was sampled and say nothing of the rest\n", "");
    }
}

json_t *cli_json_mueller(const gonio_mueller_report *report) {
    const gonio_mueller_report r = *report;
    return r.matrices == 0
               ? json_null()
               : json_pack("{s:I,s:I,s:o,s:f,s:[f,f,f,f],s:o}", "matrices", (json_int_t)r.matrices, "unphysical",
                           (json_int_t)r.unphysical, "worst", cli_json_real(r.worst), "tolerance", r.tolerance,
                           "worst_at", gonio_degrees(r.worst_pair.theta_i), gonio_degrees(r.worst_pair.phi_i),
                           gonio_degrees(r.worst_pair.theta_o), gonio_degrees(r.worst_pair.phi_o), "worst_channel",
                           cli_json_text(r.worst_channel));
}

void cli_print_mueller(const gonio_mueller_report *report) {
    const gonio_mueller_report r = *report;
    if (r.matrices == 0) {
        return;
    }
    const gonio_pair *p = &r.worst_pair;
    printf("%-10s %zu matrices of 16 elements, ", "mueller", r.matrices);
    if (r.unphysical == 0) {
        printf("all physically realisable");
    } else {
        printf("%zu of no physical sample", r.unphysical);
    }
    printf("; the smallest eigenvalue of a coherency matrix is %.3g of their sum (%s at %.5g,%.5g,%.5g,%.5g)\n",
           r.worst, cli_text(r.worst_channel), gonio_degrees(p->theta_i), gonio_degrees(p->phi_i),
           gonio_degrees(p->theta_o), gonio_degrees(p->phi_o));
}

void cli_print_errors(const char *label, const gonio_errors *e) {
    if (e->samples == 0) {
        printf("%-10s no samples\n", label);
        return;
    }
    char rmse_70[32] = "-"; // no sample up to 70 deg
    if (isfinite(e->rmse_70)) {
        snprintf(rmse_70, sizeof rmse_70, "%.4g", e->rmse_70);
    }
    printf("%-10s rmse %.4g  median_rel %.3g %%  rms_log %.3g  rmse_70 %s  max_abs %.4g  max_rel %.3g  (%zu samples)\n",
           label, e->rmse, 100 * e->median_rel, e->rms_log, rmse_70, e->max_abs, e->max_rel, e->samples);
}
