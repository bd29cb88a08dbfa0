// SPDX-License-Identifier: BSD-3-Clause
// The thesis' evaluation (Kameya 2002), once more and with held-out figures beside the training ones: tables as CSV,
// pictures as PNG, into the folder named by the first argument. Run by `make thesis-tables`; real data from
// $GONIO_DATA.
//
//   table_b.csv    RMSE, MAE, MRE at levels 0 to 6            (tables B.1, B.2)
//   table_c.csv    CBMBA errors                               (table C.1)
//   table_6.csv    control points dropped from one lattice    (table 6.1)
//   table_7.csv    bytes, nanoseconds an evaluation           (table 7.1, figures 5.6, 5.7)
//   scatter_*.png  fitted against measured                    (figures 5.2 to 5.5, 7.3, 7.4)
//   lobe_*.png     lobes in the plane of incidence            (figures 5.8, 5.9, 7.5, 7.6)
#include <cairo.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "brdf/kind/lattice.h"
#include "fit/options.h"
#include "gonio/fit.h"
#include "gonio/io.h"
#include "tests/bench/dropped.h"
#include "tests/simulate.h"

#define LEVELS 7

typedef struct material {
    const char *name;
    const char *source; // a file below $GONIO_DATA, or a spec
    int channel;        // of a file
} material;

// The simulated ones stand for the thesis' felt, leather, foil and lacquer: specs of that character, 1400 random
// samples.
static const material materials[] = {
    {"garnet_red", "cornell/garnet_red.brdf", 15},      {"acryl_blue", "cornell/acryl_blue.brdf", 15},
    {"mystique", "cornell/mystique.brdf", 15},          {"nist_ptfe", "nist_ptfe/PTFE.data.csv", 0},
    {"felt", "oren-nayar:rho=0.25,sigma_deg=30", 0},    {"leather", "ward:rho_d=0.08,rho_s=0.06,alpha=0.2", 0},
    {"foil", "ward:rho_d=0.05,rho_s=0.6,alpha=0.1", 0}, {"lacquer", "ward:rho_d=0.1,rho_s=0.05,alpha=0.03", 0},
};
#define MATERIALS (sizeof materials / sizeof *materials)

static const struct {
    int diffuse, specular;
    double drop;
} triples[] = {{3, 6, 90}, {4, 6, 90}, {4, 6, 95}, {4, 6, 99}, {3, 5, 90}};
#define TRIPLES (sizeof triples / sizeof *triples)

static const char *folder;

static void check(gonio_status status, const gonio_error *error) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s\n", error->message);
        exit(1);
    }
}

static FILE *table(const char *name, const char *header) {
    char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "w");
    if (f == NULL) {
        perror(path);
        exit(1);
    }
    fprintf(f, "%s\n", header);
    return f;
}

// NULL where the real data is absent.
static gonio_samples *load(const material *m) {
    gonio_error error = {0};
    if (strchr(m->source, ':') != NULL) {
        return simulate_samples(m->source, 1400, 1, 1);
    }
    const char *data = getenv("GONIO_DATA");
    char path[512];
    snprintf(path, sizeof path, "%s/%s", data != NULL ? data : "../shared/data", m->source);
    struct stat info;
    if (stat(path, &info) != 0) {
        printf("SKIP %s: no %s\n", m->name, path);
        return NULL;
    }
    gonio_read_options o;
    gonio_samples *all, *one;
    gonio_read_options_default(&o);
    o.wavelength_nm = strcmp(m->name, "nist_ptfe") == 0 ? 633 : 0;
    check(gonio_read(path, &o, &all, NULL, &error), &error);
    check(gonio_samples_channel(all, m->channel, &one, &error), &error);
    gonio_samples_free(all);
    return one;
}

static gonio_model *fit(const gonio_samples *samples, const char *method, int level, int diffuse, double drop,
                        const char *storage, gonio_fit_report *report) {
    gonio_fit_options o;
    gonio_model *model;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    o.method = method;
    o.level = level;
    o.diffuse_level = diffuse;
    o.drop_percent = drop;
    o.storage = storage;
    o.thesis = true;
    gonio_fit_options_for(&o, method); // without what it does not have
    check(gonio_fit(samples, &o, &model, report, &error), &error);
    return model;
}

static void write_errors(FILE *f, const gonio_errors *e) {
    fprintf(f, ",%.6g,%.6g,%.6g,%.6g", e->rmse, e->max_abs, e->max_rel, e->median_rel);
}

static double eval_ns(const gonio_model *model) {
    enum { N = 20000 };
    static gonio_vec3 wi[N], wo[N];
    uint64_t seed = 5;
    for (int i = 0; i < N; i++) {
        const gonio_pair p = simulate_pair(&seed, 1);
        wi[i] = gonio_direction(p.theta_i, p.phi_i);
        wo[i] = gonio_direction(p.theta_o, p.phi_o);
    }
    double best = INFINITY;
    for (int r = 0; r < 5; r++) {
        struct timespec a, b;
        float value;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &a);
        for (int i = 0; i < N; i++) {
            gonio_model_eval_f32(model, wi[i], wo[i], &value);
        }
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &b);
        best = fmin(best, (double)(b.tv_sec - a.tv_sec) * 1e9 + (double)(b.tv_nsec - a.tv_nsec));
    }
    return best / N;
}

// ---- pictures ----

typedef struct picture {
    cairo_surface_t *surface;
    cairo_t *cr;
} picture;

static picture begin_picture(const char *title) {
    picture p = {cairo_image_surface_create(CAIRO_FORMAT_RGB24, 640, 640), NULL};
    p.cr = cairo_create(p.surface);
    cairo_set_source_rgb(p.cr, 1, 1, 1);
    cairo_paint(p.cr);
    cairo_set_source_rgb(p.cr, 0, 0, 0);
    cairo_set_font_size(p.cr, 18);
    cairo_move_to(p.cr, 20, 28);
    cairo_show_text(p.cr, title);
    cairo_new_path(p.cr); // the text left a current point
    return p;
}

static void end_picture(picture *p, const char *kind, const char *name) {
    char path[512];
    snprintf(path, sizeof path, "%s/%s_%s.png", folder, kind, name);
    if (cairo_surface_write_to_png(p->surface, path) != CAIRO_STATUS_SUCCESS) {
        fprintf(stderr, "cannot write %s\n", path);
        exit(1);
    }
    cairo_destroy(p->cr);
    cairo_surface_destroy(p->surface);
}

// Log axes from 1e-4 of the largest value up: fitted (y) against measured (x), with the diagonal.
static void draw_scatter(const char *name, const char *title, const gonio_samples *samples, const gonio_model *model) {
    picture p = begin_picture(title);
    double largest = 1e-12;
    for (size_t i = 0; i < samples->n; i++) {
        largest = fmax(largest, samples->values[i]);
    }
    const double low = log10(largest) - 4, scale = 560 / 4.2;
    cairo_set_source_rgb(p.cr, 0.7, 0.7, 0.7);
    cairo_move_to(p.cr, 50, 610);
    cairo_line_to(p.cr, 610, 50);
    cairo_rectangle(p.cr, 50, 50, 560, 560);
    cairo_stroke(p.cr);
    cairo_set_source_rgb(p.cr, 0.1, 0.2, 0.7);
    for (size_t i = 0; i < samples->n; i++) {
        double value;
        gonio_model_eval_pair(model, &samples->pairs[i], &value);
        const double x = fmax(log10(fmax(samples->values[i], 1e-30)) - low, 0) * scale;
        const double y = fmax(log10(fmax(value, 1e-30)) - low, 0) * scale;
        cairo_arc(p.cr, 50 + x, 610 - fmin(y, 560), 1.5, 0, 2 * GONIO_PI);
        cairo_fill(p.cr);
    }
    end_picture(&p, "scatter", name);
}

// A direction of the plane of incidence: theta_o counts toward the mirror direction.
static gonio_pair in_plane(double theta_i, double theta_o) {
    return (gonio_pair){theta_i, 0, fabs(theta_o), theta_o >= 0 ? GONIO_PI : 0};
}

static double radius(double value, double largest) {
    return 260 * fmin(fmax(log10(fmax(value, 1e-30) / largest) / 3 + 1, 0), 1.1);
}

// Lobes at theta_i = 30 and 60 deg, radius log f_r over three decades: levels 3 (grey) and 6 (colour), samples as dots.
static void draw_lobes(const char *name, const gonio_samples *samples, const gonio_model *coarse,
                       const gonio_model *fine) {
    char title[128];
    snprintf(title, sizeof title, "%s: lobes at 30 and 60 deg, levels 3 (grey) and 6", name);
    picture p = begin_picture(title);
    double largest = 1e-12;
    const double angles[2] = {GONIO_PI / 6, GONIO_PI / 3};
    for (double t = -85; t <= 85; t += 0.5) {
        for (int k = 0; k < 2; k++) {
            double value;
            const gonio_pair pair = in_plane(angles[k], t * GONIO_PI / 180);
            gonio_model_eval_pair(fine, &pair, &value);
            largest = fmax(largest, value);
        }
    }
    for (int k = 0; k < 2; k++) {
        for (int m = 0; m < 2; m++) {
            cairo_set_source_rgb(p.cr, m ? (k ? 0.8 : 0.1) : 0.7, m ? 0.2 : 0.7, m ? (k ? 0.1 : 0.8) : 0.7);
            for (double t = -89; t <= 89; t += 0.5) {
                double value;
                const gonio_pair pair = in_plane(angles[k], t * GONIO_PI / 180);
                gonio_model_eval_pair(m ? fine : coarse, &pair, &value);
                const double r = radius(value, largest), a = t * GONIO_PI / 180;
                cairo_line_to(p.cr, 320 + r * sin(a), 500 - r * cos(a));
            }
            cairo_stroke(p.cr);
        }
        for (size_t i = 0; i < samples->n; i++) {
            const gonio_pair *s = &samples->pairs[i];
            const double phi = remainder(s->phi_o - s->phi_i, 2 * GONIO_PI);
            const bool mirror = fabs(fabs(phi) - GONIO_PI) < 0.05;
            if (fabs(s->theta_i - angles[k]) < 0.02 && (mirror || fabs(phi) < 0.05)) {
                const double a = mirror ? s->theta_o : -s->theta_o, r = radius(samples->values[i], largest);
                cairo_arc(p.cr, 320 + r * sin(a), 500 - r * cos(a), 2.5, 0, 2 * GONIO_PI);
                cairo_fill(p.cr);
            }
        }
    }
    end_picture(&p, "lobe", name);
}

// Table 6.1: the C % least control points of one dense lattice set to zero.
static void drop_table(FILE *f, const char *name, const gonio_samples *samples, const gonio_model *dense) {
    static const double drops[] = {0, 50, 80, 90, 95, 99};
    for (size_t d = 0; d < sizeof drops / sizeof *drops; d++) {
        gonio_errors errors;
        gonio_error error = {0};
        gonio_model *model = dropped_model(dense, drops[d]);
        check(gonio_errors_model(model, samples, NULL, 0, &errors, &error), &error);
        fprintf(f, "%s,%g,%.6g,%.6g,%.6g\n", name, drops[d], errors.rmse, errors.max_abs, errors.max_rel);
        gonio_model_free(model);
    }
}

int main(int argc, char **argv) {
    folder = argc > 1 ? argv[1] : "build/thesis";
    mkdir(folder, 0777);
    const char *figures = "rmse,mae,mre,median_rel,held_out_rmse,held_out_mae,held_out_mre,held_out_median_rel";
    char header[256];
    snprintf(header, sizeof header, "material,level,samples,%s", figures);
    FILE *b = table("table_b.csv", header);
    snprintf(header, sizeof header, "material,D,S,C,%s", figures);
    FILE *c = table("table_c.csv", header);
    FILE *drop = table("table_6.csv", "material,dropped_percent,rmse,mae,mre");
    FILE *storage = table("table_7.csv", "material,form,control_points,bytes,eval_ns");
    for (size_t k = 0; k < MATERIALS; k++) {
        const char *name = materials[k].name;
        gonio_samples *samples = load(&materials[k]);
        if (samples == NULL) {
            continue;
        }
        gonio_model *models[LEVELS];
        gonio_fit_report report;
        for (int level = 0; level < LEVELS; level++) {
            models[level] = fit(samples, "mba", level, -1, -1, NULL, &report);
            fprintf(b, "%s,%d,%zu", name, level, samples->n);
            write_errors(b, &report.train);
            write_errors(b, &report.held_out);
            fprintf(b, "\n");
            fprintf(storage, "%s,level %d,%zu,%zu,%.1f\n", name, level, models[level]->control_points,
                    models[level]->bytes, eval_ns(models[level]));
            char picture_name[64], title[128];
            snprintf(picture_name, sizeof picture_name, "%s_level_%d", name, level);
            snprintf(title, sizeof title, "%s, level %d: fitted against measured (log)", name, level);
            if (level == 3 || level == 6) {
                draw_scatter(picture_name, title, samples, models[level]);
            }
            printf("%-12s level %d  RMSE %.5f  held out %.5f\n", name, level, report.train.rmse, report.held_out.rmse);
        }
        draw_lobes(name, samples, models[3], models[6]);
        drop_table(drop, name, samples, models[6]);
        for (size_t t = 0; t < TRIPLES; t++) {
            static const char *const forms[] = {"hash", "byte"};
            for (int form = 0; form < 2; form++) {
                gonio_model *m = fit(samples, "cbmba", triples[t].specular, triples[t].diffuse, triples[t].drop,
                                     forms[form], &report);
                if (form == 0) {
                    fprintf(c, "%s,%d,%d,%g", name, triples[t].diffuse, triples[t].specular, triples[t].drop);
                    write_errors(c, &report.train);
                    write_errors(c, &report.held_out);
                    fprintf(c, "\n");
                }
                fprintf(storage, "%s,(%d;%d;%g) %s,%zu,%zu,%.1f\n", name, triples[t].diffuse, triples[t].specular,
                        triples[t].drop, forms[form], m->control_points, m->bytes, eval_ns(m));
                if (t == 2 && form == 0) {
                    char picture_name[64], title[128];
                    snprintf(picture_name, sizeof picture_name, "%s_cbmba", name);
                    snprintf(title, sizeof title, "%s, CBMBA (4,6,95): fitted against measured (log)", name);
                    draw_scatter(picture_name, title, samples, m);
                }
                gonio_model_free(m);
            }
        }
        for (int level = 0; level < LEVELS; level++) {
            gonio_model_free(models[level]);
        }
        gonio_samples_free(samples);
    }
    fclose(b);
    fclose(c);
    fclose(drop);
    fclose(storage);
    return 0;
}
