// SPDX-License-Identifier: BSD-3-Clause
// The smallest model that a scene's pictures show no difference with.
//
// The samples are fitted at their best first. That fit's values at the cells that the scene asks for, weighted by what
// the pictures make of an error there, are what smaller models are made of; beside them some thousand pairs over all
// directions, weighted little, so that no model is at a loss elsewhere. How far a model's values at the cells are off
// promises the pictures' error without a picture; the cheapest that promises enough is rendered and compared, and the
// promise is adjusted to what was found, until the cheapest one holds.
#include "gonio/scene_needs.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene/needs/search.h"

static double rms_of_psnr(double psnr_db) { return 255 * sqrt(3) * pow(10, -psnr_db / 20); }

// The measure that the limit is of.
static double measure_of(const search_work *w, const gonio_picture_error *e) {
    return w->how->image_error > 0 ? e->mae : rms_of_psnr(e->psnr_db);
}

// ---- pictures ----

static bool keep_on(void *context, double fraction, double paths_per_s) {
    const search_work *w = context;
    (void)fraction;
    (void)paths_per_s;
    return w->how->progress == NULL || w->how->progress(w->how->progress_context, NULL);
}

// Of the frames with this model, which the caller keeps.
static gonio_status render(search_work *w, gonio_model *model, double turn_deg, gonio_frames **out,
                           gonio_error *error) {
    gonio_model *other = model;
    *out = NULL;
    gonio_status status = gonio_scene_exchange_model(w->scene, w->material, &other, error);
    if (status == GONIO_OK) {
        status = gonio_frames_render(w->scene, &w->render, w->about.frame, w->about.frames, turn_deg, out, error);
        const gonio_status back = gonio_scene_exchange_model(w->scene, w->material, &other, error);
        status = status == GONIO_OK ? back : status;
    }
    return status;
}

static gonio_status judge(search_work *w, gonio_model *model, const gonio_frames *truth, double turn_deg,
                          gonio_picture_error *apart, gonio_error *error) {
    gonio_frames *frames;
    gonio_status status = render(w, model, turn_deg, &frames, error);
    status = status == GONIO_OK ? gonio_frames_compare(frames, truth, apart, error) : status;
    gonio_frames_free(frames);
    return status;
}

// ---- render, compare, adjust ----

static gonio_status try_pictures(search_work *w, const search_candidate *c, gonio_scene_fit_step *step,
                                 gonio_picture_error *apart, gonio_error *error) {
    gonio_model *model = NULL;
    *step = (gonio_scene_fit_step){.ns = c->ns, .predicted = c->predicted, .bytes = c->bytes, .bricks = c->units};
    gonio_search_describe(c, step->what, sizeof step->what);
    gonio_status status = gonio_search_checkpoint(w, step->what, error);
    status = status == GONIO_OK ? gonio_search_model(w, c, false, &model, error) : status;
    status = status == GONIO_OK ? judge(w, model, w->truth, 0, apart, error) : status;
    gonio_model_free(model);
    step->mae = apart->mae;
    step->psnr_db = apart->psnr_db;
    step->met = status == GONIO_OK && measure_of(w, apart) <= w->limit;
    return status;
}

static int cheapest_of(const search_work *w) {
    int best = -1;
    for (int k = 0; k < w->n; k++) {
        const search_candidate *c = &w->candidates[k];
        best = !c->out && (best < 0 || c->cost < w->candidates[best].cost) ? k : best;
    }
    return best;
}

// What was met with room to spare may do with less.
static gonio_status spare(search_work *w, search_candidate *c, double measured, gonio_picture_error *apart,
                          gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (int k = 0; k < 3 && status == GONIO_OK && measured < 0.85 * w->limit; k++) {
        search_candidate less = *c;
        bool keeps;
        gonio_picture_error now;
        gonio_scene_fit_step *step = &w->report->step[w->report->steps];
        status = gonio_search_retarget(w, &less, c->target * GONIO_SEARCH_SAFETY * w->limit / measured, &keeps, error);
        if (status != GONIO_OK || !keeps || less.cost >= 0.98 * c->cost || w->report->steps == GONIO_SCENE_FIT_STEPS) {
            break;
        }
        status = try_pictures(w, &less, step, &now, error);
        w->report->steps += status == GONIO_OK;
        if (status != GONIO_OK || !step->met) {
            break;
        }
        *c = less;
        *apart = now;
        measured = measure_of(w, &now);
    }
    return status;
}

static gonio_status fail_limit(const search_work *w, gonio_error *error) {
    const gonio_scene_fit_step *best = NULL;
    for (int k = 0; k < w->report->steps; k++) {
        best = best == NULL || w->report->step[k].mae < best->mae ? &w->report->step[k] : best;
    }
    return best != NULL ? gonio_fail(error, GONIO_E_CONVERGENCE,
                                     "no model of %d meets the limit; %s comes to a mean error of %.4g codes, PSNR "
                                     "%.2f dB",
                                     w->report->compared, best->what, best->mae, best->psnr_db)
                        : gonio_fail(error, GONIO_E_CONVERGENCE,
                                     "no model of %d promises to meet the limit at the pairs that the scene asks for",
                                     w->report->compared);
}

static gonio_status search(search_work *w, search_candidate *chosen, gonio_error *error) {
    gonio_status status = GONIO_OK;
    while (status == GONIO_OK && w->report->steps < GONIO_SCENE_FIT_STEPS) {
        const int k = cheapest_of(w);
        if (k < 0) {
            break;
        }
        search_candidate *c = &w->candidates[k];
        gonio_scene_fit_step *step = &w->report->step[w->report->steps];
        gonio_picture_error apart;
        status = try_pictures(w, c, step, &apart, error);
        w->report->steps += status == GONIO_OK;
        if (status == GONIO_OK && step->met) {
            *chosen = *c;
            w->report->image = apart;
            return spare(w, chosen, measure_of(w, &apart), &w->report->image, error);
        }
        bool keeps = false;
        if (status == GONIO_OK) {
            status = gonio_search_retarget(
                w, c, c->predicted * fmin(GONIO_SEARCH_SAFETY * w->limit / measure_of(w, &apart), 0.9), &keeps, error);
        }
        c->out = !keeps;
    }
    return status == GONIO_OK ? fail_limit(w, error) : status;
}

// ---- all ----

static gonio_status fit_best(search_work *w, gonio_fit_report *report, gonio_error *error) {
    gonio_fit_options o = *w->options;
    gonio_needs_facts facts;
    if (o.method != NULL && strcmp(o.method, "cbmba") == 0) {
        gonio_fit_options_default(&o);
        o.hold_out = w->options->hold_out;
        o.folds = w->options->folds;
        o.seed = w->options->seed;
        o.threads = w->options->threads;
        o.max_memory = w->options->max_memory;
        o.progress = w->options->progress;
        o.progress_context = w->options->progress_context;
    }
    gonio_needs_describe(w->needs, w->material, &facts);
    gonio_status status = gonio_fit(w->samples, &o, &w->best, report, error);
    if (status == GONIO_OK && facts.isotropic && !w->best->isotropic) {
        status = gonio_fail(error, GONIO_E_USAGE,
                            "the samples are anisotropic, the scene's model of '%s' is not: its needs tell nothing of "
                            "azimuths; give the scene an anisotropic one",
                            facts.name);
    }
    return status;
}

// The truth's pictures; of a truth that was given, how far the best fit is off.
static gonio_status render_truth(search_work *w, double turn_deg, gonio_frames **out, gonio_error *error) {
    if (w->how->truth == NULL) {
        return render(w, w->best, turn_deg, out, error);
    }
    gonio_model *truth;
    gonio_status status = gonio_model_resolve(w->how->truth, &truth, error);
    if (status == GONIO_OK) {
        status = render(w, truth, turn_deg, out, error);
        gonio_model_free(truth);
    }
    return status;
}

static gonio_status begin(search_work *w, gonio_fit_report *report, gonio_error *error) {
    gonio_status status = gonio_needs_open_scene(w->needs, &w->scene, error);
    status = status == GONIO_OK ? fit_best(w, report, error) : status;
    if (status != GONIO_OK) {
        return status;
    }
    gonio_needs_render_options(w->needs, w->scene, &w->render);
    w->render.threads = w->options->threads;
    w->render.progress = keep_on;
    w->render.progress_context = w;
    w->report->best_bytes = w->best->bytes;
    status = render_truth(w, 0, &w->truth, error);
    if (status == GONIO_OK && w->how->truth != NULL) {
        status = judge(w, w->best, w->truth, 0, &w->report->best, error);
        if (status == GONIO_OK && measure_of(w, &w->report->best) > w->limit) {
            status = gonio_fail(error, GONIO_E_CONVERGENCE,
                                "the best fit of these samples comes to a mean error of %.4g codes, PSNR %.2f dB: "
                                "measure more (gonio plan scene:NEEDS)",
                                w->report->best.mae, w->report->best.psnr_db);
        }
    }
    status = status == GONIO_OK ? gonio_search_tell(w, error) : status;
    return status;
}

static bool meets_promise(const search_work *w) {
    for (int k = 0; k < w->n; k++) {
        if (!w->candidates[k].out && w->candidates[k].predicted <= w->limit) {
            return true;
        }
    }
    return false;
}

static gonio_status measure_reachable(const search_work *w, const search_candidate *c, gonio_error *error) {
    gonio_needs_count count;
    w->report->lattice_bytes =
        gonio_lattice_count(w->best->isotropic ? 3 : 4, c->form.level) * (size_t)w->best->channels * sizeof(float);
    const int level = c->form.level > 2 ? c->form.level - 2 : 0; // a brick is 4 cells wide
    const gonio_status status =
        gonio_needs_count_cells(w->needs, w->material, c->form.coordinates, level, &count, error);
    if (status == GONIO_OK) {
        w->report->reachable_bytes =
            (size_t)((double)w->report->lattice_bytes * (double)count.reachable / (double)count.cells);
    }
    return status;
}

static gonio_status finish(search_work *w, const search_candidate *chosen, gonio_model **out, gonio_fit_report *report,
                           gonio_error *error) {
    gonio_frames *turned = NULL;
    const double seconds = report->fit_seconds;
    gonio_status status = gonio_search_model(w, chosen, true, out, error);
    if (status == GONIO_OK && w->how->turn_deg != 0) {
        status = render_truth(w, w->how->turn_deg, &turned, error);
        status = status == GONIO_OK ? judge(w, *out, turned, w->how->turn_deg, &w->report->turned, error) : status;
        gonio_frames_free(turned);
    }
    if (status == GONIO_OK && chosen->formula == NULL) {
        status = measure_reachable(w, chosen, error);
    }
    if (status == GONIO_OK) {
        status = gonio_errors_model(*out, w->samples, NULL, w->options->threads, &report->train, error);
    }
    status = status == GONIO_OK ? gonio_model_tell(*out, w->samples->head, error) : status;
    for (int k = 0; k < w->report->steps; k++) {
        w->report->step[k].chosen = w->report->step[k].met && w->report->step[k].bytes == chosen->bytes;
    }
    if (status != GONIO_OK) {
        return status;
    }
    snprintf(report->method, sizeof report->method, "%s", chosen->formula != NULL ? chosen->formula : "cbmba");
    report->level = chosen->formula != NULL ? 0 : chosen->form.level;
    report->coordinates = chosen->form.coordinates;
    report->domain = chosen->form.domain;
    report->control_points = (*out)->control_points;
    report->bytes = (*out)->bytes;
    report->fit_seconds = seconds;
    gonio_search_describe(chosen, report->options, sizeof report->options);
    snprintf(report->note, sizeof report->note,
             "made for a scene: fine where its pictures look; held-out errors are of the fit at its best");
    return GONIO_OK;
}

static void release(search_work *w) {
    gonio_frames_free(w->truth);
    gonio_scene_free(w->scene);
    gonio_model_free(w->best);
    gonio_samples_free(w->told);
    gonio_colour_free(&w->colour);
    free(w->reference);
    free(w->candidates);
}

gonio_status gonio_fit_scene(const gonio_samples *samples, const gonio_fit_options *options, const gonio_needs *needs,
                             int material, const gonio_scene_fit_options *how, gonio_model **out,
                             gonio_fit_report *report, gonio_scene_fit_report *steps, gonio_error *error) {
    gonio_needs_facts facts;
    *out = NULL;
    *steps = (gonio_scene_fit_report){.expected = NAN};
    *report = (gonio_fit_report){0};
    gonio_needs_describe(needs, material, &facts);
    if (!(how->image_error > 0) == !(how->psnr_db > 0)) {
        return gonio_fail(error, GONIO_E_USAGE, "either an image error or a PSNR above 0 is needed");
    }
    search_work w = {
        .samples = samples, .options = options, .needs = needs, .material = material, .how = how, .report = steps};
    w.limit = how->image_error > 0 ? how->image_error : rms_of_psnr(how->psnr_db);
    w.cells = gonio_needs_cells(needs, material);
    w.n_cells = facts.cells;
    w.candidates = calloc(GONIO_SEARCH_CANDIDATES, sizeof *w.candidates);
    gonio_needs_describe_scene(needs, &w.about);
    search_candidate chosen;
    gonio_status status = w.candidates != NULL && facts.cells > 0
                              ? begin(&w, report, error)
                              : gonio_fail(error, GONIO_E_USAGE, "no pixel sees material '%s'", facts.name);
    const bool bricks = options->method != NULL && strcmp(options->method, "cbmba") == 0;
    status = status == GONIO_OK && !bricks ? gonio_search_formulae(&w, error) : status;
    // A formula takes some hundred bytes.
    status = status == GONIO_OK && (bricks || !meets_promise(&w)) ? gonio_search_bricks(&w, error) : status;
    status = status == GONIO_OK ? search(&w, &chosen, error) : status;
    status = status == GONIO_OK ? finish(&w, &chosen, out, report, error) : status;
    release(&w);
    if (status != GONIO_OK) {
        gonio_model_free(*out);
        *out = NULL;
    }
    return status;
}
