// SPDX-License-Identifier: BSD-3-Clause
// Method "cbmba": (D,S,C) as given, or the smallest that keeps --max-error.
//
// Where C is not given, it is one that costs nothing: on an inner fifth of the samples, neither the RMSE nor the median
// of relative errors may be above 1.005 times the dense lattice's of level S. 95 per cent are dropped where that is so;
// else fewer, at last none, in float and without further corrections, which is the dense lattice in another form.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/keys.h"
#include "fit/bilevel/bilevel.h"
#include "fit/memory.h"
#include "fit/names.h"

// Of isotropic samples; of anisotropic ones a level of one more dimension is as large as three levels finer.
static const int diffuse_default[2] = {2, 4}, specular_default[2] = {4, 6};
#define DROP_DEFAULT 95
#define WORSE 1.005     // than the dense lattice, and no more
#define JUDGED_LEAST 10 // samples; fewer tell nothing

typedef struct triple {
    int diffuse, specular, first; // first: level at which the second fit begins
    double drop;
    gonio_storage storage;
    bool plain; // without corrections after the dropping
} triple;

static int first_of(const gonio_fit_options *o, int diffuse) {
    return o->specular_start >= 0 ? o->specular_start : diffuse + 1;
}

static gonio_status read_options(const gonio_fit_options *o, bool isotropic, triple *t, gonio_error *error) {
    t->diffuse = o->diffuse_level >= 0 ? o->diffuse_level : diffuse_default[isotropic];
    t->specular = o->level >= 0 ? o->level : specular_default[isotropic];
    t->first = first_of(o, t->diffuse);
    t->drop = o->drop_percent >= 0 ? o->drop_percent : DROP_DEFAULT;
    if (t->diffuse >= t->specular || t->specular > GONIO_LEVEL_MAX) {
        return gonio_fail(error, GONIO_E_USAGE, "levels D = %d and S = %d: 0 <= D < S <= %d is needed", t->diffuse,
                          t->specular, GONIO_LEVEL_MAX);
    }
    if (t->first > t->specular) {
        return gonio_fail(error, GONIO_E_USAGE, "--specular-start %d is beyond S = %d", t->first, t->specular);
    }
    const int usual = isotropic ? GONIO_STORAGE_BYTE : GONIO_STORAGE_JENKINS;
    const int storage = o->storage != NULL ? gonio_names_find(gonio_storage_names(), o->storage) : usual;
    t->storage = (gonio_storage)storage; // the driver has checked the name
    if (!isotropic && !gonio_sparse_hashed(t->storage)) {
        return gonio_fail(error, GONIO_E_UNSUPPORTED,
                          "--storage %s: bricks hold isotropic models; anisotropic ones are hashed", o->storage);
    }
    return GONIO_OK;
}

// What is fitted: the scatter and the names of its channels.
typedef struct source {
    gonio_scatter scatter;
    const char (*names)[32];
    const gonio_fit_options *options;
} source;

static gonio_status source_init(source *s, const gonio_samples *samples, const gonio_fit_options *o,
                                gonio_error *error) {
    const gonio_scatter_options form = {
        .coordinates = o->coordinates != GONIO_COORDINATES_AUTO ? o->coordinates : GONIO_NUSSELT,
        .domain = o->domain != GONIO_DOMAIN_AUTO ? o->domain : GONIO_LINEAR,
        .symmetry = o->symmetry != GONIO_SYMMETRY_AUTO ? o->symmetry
                    : samples->isotropic               ? GONIO_SYMMETRY_MIRROR
                                                       : 0,
        .weighted = !o->thesis,
        .threads = o->threads,
    };
    s->names = (const char(*)[32])samples->channel_names;
    s->options = o;
    return gonio_scatter_init(&s->scatter, samples, &form, error);
}

static gonio_status pack_model(const source *s, const gonio_lattice *diffuse, const gonio_lattice *specular,
                               const triple *t, gonio_model **out, gonio_error *error) {
    gonio_bilevel_parts parts;
    gonio_status status = gonio_bilevel_pack(diffuse, specular, t->drop, t->storage, &parts, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (!gonio_sparse_hashed(t->storage) && !t->plain) {
        status = gonio_bilevel_correct(&parts, specular, &s->scatter, s->options->threads, error);
        if (status != GONIO_OK) {
            gonio_bilevel_parts_release(&parts);
            return status;
        }
    }
    parts.coordinates = s->scatter.coordinates;
    parts.kind = s->scatter.kind;
    status = gonio_bilevel_model_new(&parts, s->scatter.transforms, s->names, out, error);
    gonio_bilevel_parts_release(&parts);
    return status;
}

static gonio_status split(const source *s, const triple *t, gonio_lattice *diffuse, gonio_lattice *specular,
                          gonio_error *error) {
    return gonio_bilevel_split(&s->scatter, s->options->thesis ? NULL : s->scatter.mean, t->diffuse, t->first,
                               t->specular, s->options->threads, diffuse, specular, error);
}

static gonio_status fit_triple(const source *s, const triple *t, gonio_model **out, gonio_error *error) {
    gonio_lattice diffuse, specular;
    gonio_status status = split(s, t, &diffuse, &specular, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = pack_model(s, &diffuse, &specular, t, out, error);
    const size_t limit = s->options->max_bytes;
    if (status == GONIO_OK && limit > 0 && (*out)->bytes > limit) {
        status = gonio_fail(error, GONIO_E_RANGE, "(%d,%d,%g) takes %zu bytes; the limit is %zu", t->diffuse,
                            t->specular, t->drop, (*out)->bytes, limit);
        gonio_model_free(*out);
        *out = NULL;
    }
    gonio_lattice_release(&diffuse);
    gonio_lattice_release(&specular);
    return status;
}

// The search for --max-error: the smallest model whose RMSE on `judge` keeps it.
typedef struct search {
    const source *source;
    const gonio_samples *judge;
    triple best;
    size_t best_bytes; // 0: none yet
    double least;      // RMSE of the best that was seen
} search;

static gonio_status try_drops(search *search, triple t, gonio_error *error) {
    static const double drops[] = {99.5, 99, 98, 97, 95, 90, 80, 60, 0};
    gonio_lattice diffuse, specular;
    gonio_status status = split(search->source, &t, &diffuse, &specular, error);
    if (status != GONIO_OK) {
        return status;
    }
    for (size_t i = 0; i < sizeof drops / sizeof *drops && status == GONIO_OK; i++) {
        gonio_model *model = NULL;
        gonio_errors errors;
        t.drop = drops[i];
        status = pack_model(search->source, &diffuse, &specular, &t, &model, error);
        if (status == GONIO_E_RANGE) {
            status = GONIO_OK; // more bricks than a table can number
            break;
        }
        if (status == GONIO_OK) {
            status = gonio_errors_model(model, search->judge, NULL, search->source->options->threads, &errors, error);
        }
        const bool meets = status == GONIO_OK && errors.rmse <= search->source->options->max_error;
        search->least = status == GONIO_OK ? fmin(search->least, errors.rmse) : search->least;
        if (meets && (search->best_bytes == 0 || model->bytes < search->best_bytes)) {
            search->best_bytes = model->bytes;
            search->best = t;
        }
        gonio_model_free(model);
        if (meets) {
            break; // dropping less only adds bytes
        }
    }
    gonio_lattice_release(&diffuse);
    gonio_lattice_release(&specular);
    return status;
}

// An inner fifth of the samples, and the others; both NULL where one of them would be empty.
static gonio_status inner_split(const gonio_samples *samples, const gonio_fit_options *o, gonio_samples **train,
                                gonio_samples **judge, gonio_error *error) {
    *train = *judge = NULL;
    bool *side = malloc(samples->n * sizeof *side);
    size_t held = 0;
    gonio_status status = side != NULL ? gonio_samples_hold_out(samples, 0.2, o->seed ^ 0x696e6e6572u, side, error)
                                       : gonio_fail(error, GONIO_E_MEMORY, "no memory to hold samples out");
    for (size_t i = 0; i < samples->n && status == GONIO_OK; i++) {
        held += side[i];
    }
    if (status == GONIO_OK && held > 0 && held < samples->n) {
        status = gonio_samples_select(samples, side, judge, error);
        for (size_t i = 0; i < samples->n; i++) {
            side[i] = !side[i];
        }
        status = status == GONIO_OK ? gonio_samples_select(samples, side, train, error) : status;
    }
    free(side);
    return status;
}

// Judge on an inner fifth that the trial fits do not see; where the caller holds nothing out, on the samples
// themselves.
static gonio_status smallest(const gonio_samples *samples, const gonio_fit_options *o, triple *t, char *note,
                             size_t size, gonio_error *error) {
    const bool held_out = o->hold_out > 0 || o->folds >= 2;
    gonio_samples *train = NULL, *judge = NULL;
    gonio_status status = held_out ? inner_split(samples, o, &train, &judge, error) : GONIO_OK;
    const bool usable = train != NULL && judge != NULL;
    source s = {0};
    if (status == GONIO_OK) {
        status = source_init(&s, usable ? train : samples, o, error);
    }
    search search = {.source = &s, .judge = usable ? judge : samples, .least = INFINITY};
    // Finer levels only where coarser ones do not do: each takes eight times the time. Beyond 1024 cells a sample they
    // repeat the same answer.
    for (int specular = 5; specular <= 7 && status == GONIO_OK && search.best_bytes == 0; specular++) {
        if (specular > 5 && ldexp(1, s.scatter.dims * specular) > 1024.0 * (double)s.scatter.n) {
            break;
        }
        for (int diffuse = 2; diffuse <= 4 && status == GONIO_OK; diffuse++) {
            status = try_drops(&search, (triple){diffuse, specular, first_of(o, diffuse), 0, t->storage, false}, error);
        }
    }
    gonio_scatter_release(&s.scatter);
    gonio_samples_free(train);
    gonio_samples_free(judge);
    if (status == GONIO_OK && search.best_bytes == 0) {
        status = gonio_fail(error, GONIO_E_CONVERGENCE, "no (D,S,C) keeps a %s RMSE of %g; the best has %g",
                            usable ? "held-out" : "training", o->max_error, search.least);
    }
    *t = search.best_bytes > 0 ? search.best : *t;
    snprintf(note, size, "the smallest (D,S,C) whose RMSE on %s keeps the limit",
             usable ? "an inner fifth that it did not see" : "the training samples");
    return status;
}

// ---- C, where it is not given ----

static gonio_status judge_triple(const source *s, const gonio_lattice *diffuse, const gonio_lattice *specular,
                                 const triple *t, const gonio_samples *judge, gonio_errors *errors,
                                 gonio_error *error) {
    gonio_model *model = NULL;
    gonio_status status = pack_model(s, diffuse, specular, t, &model, error);
    status = status == GONIO_OK ? gonio_errors_model(model, judge, NULL, s->options->threads, errors, error) : status;
    gonio_model_free(model);
    return status;
}

// The most that may be dropped of a fit to `s` without loss on `judge`.
static gonio_status try_kept(const source *s, const gonio_samples *judge, triple *t, gonio_error *error) {
    static const double drops[] = {DROP_DEFAULT, 90, 80, 60, 0};
    enum { DROPS = sizeof drops / sizeof *drops };
    gonio_lattice diffuse, specular;
    gonio_errors dense, now;
    // The dense lattice of level S is both lattices of a second fit from D + 1 on.
    triple all = *t;
    all.first = t->diffuse + 1;
    all.drop = 0;
    all.plain = true;
    all.storage = gonio_sparse_hashed(t->storage) ? t->storage : GONIO_STORAGE_FLOAT;
    gonio_status status = split(s, &all, &diffuse, &specular, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = judge_triple(s, &diffuse, &specular, &all, judge, &dense, error);
    if (status == GONIO_OK && t->first != all.first) {
        gonio_lattice_release(&diffuse);
        gonio_lattice_release(&specular);
        status = split(s, t, &diffuse, &specular, error);
    }
    bool found = false;
    // Corrections win back what dropping lost where the samples are even; where a lobe stands among few samples they
    // may spread it over the others. So both ways are tried.
    for (size_t k = 0; k < 2 * DROPS && status == GONIO_OK && !found; k++) {
        t->drop = drops[k / 2];
        t->plain = k % 2 != 0;
        status = judge_triple(s, &diffuse, &specular, t, judge, &now, error);
        found = status == GONIO_OK && now.rmse <= WORSE * dense.rmse && now.median_rel <= WORSE * dense.median_rel;
    }
    gonio_lattice_release(&diffuse);
    gonio_lattice_release(&specular);
    *t = status == GONIO_OK && !found ? all : *t;
    return status;
}

static gonio_status choose_drop(const gonio_samples *samples, const gonio_fit_options *o, triple *t, char *note,
                                size_t size, gonio_error *error) {
    gonio_samples *train, *judge;
    gonio_status status = inner_split(samples, o, &train, &judge, error);
    if (status == GONIO_OK && judge != NULL && judge->n >= JUDGED_LEAST) {
        source s = {0};
        status = source_init(&s, train, o, error);
        status = status == GONIO_OK ? try_kept(&s, judge, t, error) : status;
        gonio_scatter_release(&s.scatter);
        if (status == GONIO_OK && (t->drop < DROP_DEFAULT || t->plain)) {
            snprintf(note, size, "dropping %g %%%s, as an inner fifth tells: other ways cost accuracy", t->drop,
                     t->plain ? " without corrections" : "");
        }
    }
    gonio_samples_free(train);
    gonio_samples_free(judge);
    return status;
}

static gonio_status fit_cbmba(const gonio_samples *samples, const gonio_fit_options *options, gonio_model **out,
                              gonio_fit_report *report, gonio_error *error) {
    triple t = {0};
    gonio_status status = read_options(options, samples->isotropic, &t, error);
    if (status == GONIO_OK && options->max_error > 0) {
        status = smallest(samples, options, &t, report->note, sizeof report->note, error);
    } else if (status == GONIO_OK && options->drop_percent < 0 && !options->thesis) {
        status = choose_drop(samples, options, &t, report->note, sizeof report->note, error);
    }
    source s = {0};
    status = status == GONIO_OK ? source_init(&s, samples, options, error) : status;
    if (status == GONIO_OK) {
        status = fit_triple(&s, &t, out, error);
        report->coordinates = s.scatter.coordinates;
        report->domain = s.scatter.kind == GONIO_TRANSFORM_LINEAR ? GONIO_LINEAR : GONIO_LOG;
        gonio_scatter_release(&s.scatter);
    }
    report->level = t.specular;
    snprintf(report->options, sizeof report->options, "(%d,%d,%g) storage=%s from=%d", t.diffuse, t.specular, t.drop,
             gonio_storage_names()[t.storage], t.first);
    return status;
}

// Two levels: what the first one leaves, and the second one's control points beside a correction's.
static double memory(const gonio_fit_size *size, double n) { return gonio_lattices_fit_memory(size, n, true); }

static const gonio_method_option options_of_cbmba[] = {
    GONIO_METHOD_OPTION(level, "S (6)"),
    GONIO_METHOD_OPTION(diffuse_level, "D (4)"),
    GONIO_METHOD_OPTION(specular_start, "D + 1"),
    GONIO_METHOD_OPTION(drop_percent, "C (95; fewer where that costs accuracy)"),
    GONIO_METHOD_OPTION(storage, "byte; jenkins of anisotropic samples"),
    GONIO_METHOD_OPTION(coordinates, "nusselt"),
    GONIO_METHOD_OPTION(domain, "linear"),
    GONIO_METHOD_OPTION(symmetry, "mirror"),
    GONIO_METHOD_OPTION(thesis, NULL),
    GONIO_METHOD_OPTION(max_error, NULL),
    GONIO_METHOD_OPTION(max_bytes, NULL),
    {0}};

static const gonio_method_form forms[] = {GONIO_METHOD_FORM_AUTO};

const gonio_method gonio_method_cbmba = {
    .name = "cbmba",
    .summary = "compressed bi-level B-splines (D,S,C) (Kameya 2002, chapter 6)",
    .kind = "cbmba",
    .options = options_of_cbmba,
    .fit = fit_cbmba,
    .memory = memory,
    .forms = forms,
    .forms_n = sizeof forms / sizeof *forms,
};
