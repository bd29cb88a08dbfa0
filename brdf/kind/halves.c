// SPDX-License-Identifier: BSD-3-Clause
// Models of kind "halves": up to four models of any other kind, one for each half of what a thin sheet scatters: front
// and back, reflected and transmitted (gonio_half).
//
// Each lives in front of the surface: a direction behind it is mirrored in it, (x, y, z) -> (x, y, -z). The direct way
// through, wo = -wi, then becomes the mirror direction, so the coordinates, lobes and symmetries that suit reflection
// suit transmission too. One is chosen by the signs of the two z; what is not there is 0.
#include "brdf/kind/halves.h"

#include "brdf/kind.h"
#include "brdf/lobe_sampling.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct halves_model {
    gonio_model head;
    gonio_model *part[GONIO_HALVES]; // NULL: none
    gonio_mapped mapped;             // base NULL: the parts are on their own
} halves_model;

#define HORIZON 1e-9 // cosine up to which a direction counts as there

// The part that answers, and the directions as it takes them.
static const gonio_model *part_of(const gonio_model *model, gonio_vec3 *wi, gonio_vec3 *wo) {
    const gonio_half half = gonio_half_of(*wi, *wo);
    const bool light = (half & GONIO_REFLECTION_BACK) != 0, camera = ((half & GONIO_TRANSMISSION) != 0) != light;
    const gonio_model *const *part = (const gonio_model *const *)((const halves_model *)model)->part;
    wi->z = light ? -wi->z : wi->z;
    wo->z = camera ? -wo->z : wo->z;
    // The horizon, in front by convention, is the edge of either half.
    return part[half] == NULL && wo->z < HORIZON ? part[half ^ GONIO_TRANSMISSION] : part[half];
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const gonio_model *part = part_of(model, &wi, &wo);
    if (part != NULL) {
        gonio_model_eval(part, wi, wo, values);
    } else {
        memset(values, 0, (size_t)model->channels * sizeof *values);
    }
}

static void eval_f32(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, float *values) {
    const gonio_model *part = part_of(model, &wi, &wo);
    if (part != NULL) {
        gonio_model_eval_f32(part, wi, wo, values);
    } else {
        memset(values, 0, (size_t)model->channels * sizeof *values);
    }
}

static double eval_channel(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, int channel) {
    const gonio_model *part = part_of(model, &wi, &wo);
    return part != NULL ? gonio_model_eval_channel(part, wi, wo, channel) : 0;
}

#define RUN 64 // pairs of one half that follow one another and are evaluated at once

static void eval_many(const gonio_model *model, size_t n, const gonio_vec3 *wi, const gonio_vec3 *wo, double *values) {
    gonio_vec3 in[RUN], out[RUN];
    for (size_t begin = 0, count; begin < n; begin += count) {
        const gonio_model *part = NULL;
        for (count = 0; count < RUN && begin + count < n; count++) {
            in[count] = wi[begin + count];
            out[count] = wo[begin + count];
            const gonio_model *own = part_of(model, &in[count], &out[count]);
            if (count > 0 && own != part) {
                break;
            }
            part = own;
        }
        double *to = values + begin * (size_t)model->channels;
        if (part != NULL) {
            gonio_model_eval_many(part, count, in, out, to);
        } else {
            memset(to, 0, count * (size_t)model->channels * sizeof *to);
        }
    }
}

// Where a theta was mirrored, its slope runs the other way.
static void gradient(const gonio_model *model, const gonio_pair *pair, int channel, double slopes[4]) {
    const gonio_half half = gonio_pair_half(*pair);
    const gonio_model *part = ((const halves_model *)model)->part[half];
    const gonio_pair raised = gonio_pair_raised(*pair);
    memset(slopes, 0, 4 * sizeof *slopes);
    if (part != NULL) {
        const bool light = (half & GONIO_REFLECTION_BACK) != 0, camera = ((half & GONIO_TRANSMISSION) != 0) != light;
        gonio_model_gradient(part, &raised, channel, slopes);
        slopes[0] *= light ? -1 : 1;
        slopes[2] *= camera ? -1 : 1;
    }
}

static void sigma(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    const gonio_model *part = part_of(model, &wi, &wo);
    if (part == NULL || !gonio_model_sigma(part, wi, wo, values)) {
        memset(values, 0, (size_t)model->channels * sizeof *values);
    }
}

static double support(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    const gonio_model *part = part_of(model, &wi, &wo);
    return part != NULL ? gonio_model_support(part, wi, wo) : NAN;
}

// Drawing is by the front reflection; where there is none, or its kind cannot draw, by what stands in for that.
static double draw(const gonio_model *model, gonio_vec3 wi, const double u[2], gonio_vec3 *wo) {
    const gonio_model *part = ((const halves_model *)model)->part[GONIO_REFLECTION];
    gonio_proposal proposals[GONIO_PROPOSALS_MAX];
    return part != NULL && part->ops->sample != NULL
               ? part->ops->sample(part, wi, u, wo)
               : gonio_proposals_sample(proposals, gonio_proposals_standard(proposals), wi, u, wo);
}

static double density(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo) {
    const gonio_model *part = ((const halves_model *)model)->part[GONIO_REFLECTION];
    gonio_proposal proposals[GONIO_PROPOSALS_MAX];
    return part != NULL && part->ops->pdf != NULL
               ? part->ops->pdf(part, wi, wo)
               : gonio_proposals_pdf(proposals, gonio_proposals_standard(proposals), wi, wo);
}

static void release(gonio_model *model) {
    halves_model *m = (halves_model *)model;
    for (int h = 0; h < GONIO_HALVES; h++) {
        gonio_model_free(m->part[h]);
    }
    gonio_mapped_release(&m->mapped);
    free(m);
}

// ---- the model file's section: where each half's own model file lies in it, then those files (docs/formats.md) ----

typedef struct description {
    struct {
        uint64_t offset, length; // from the section's begin; 0 and 0: no such half
    } half[GONIO_HALVES];
} description;
_Static_assert(sizeof(description) == GONIO_MODEL_FILE_ALIGN, "the description is written as it stands");

static gonio_status save(const gonio_model *model, FILE *stream, gonio_error *error) {
    const halves_model *m = (const halves_model *)model;
    description about = {0};
    gonio_file_part parts[1 + GONIO_HALVES] = {{&about, sizeof about}};
    gonio_status status = GONIO_OK;
    uint64_t at = sizeof about;
    int n = 1;
    for (int h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
        if (m->part[h] != NULL) {
            status = gonio_model_file_bytes(m->part[h], &parts[n], error);
            about.half[h].offset = at;
            about.half[h].length = parts[n].length;
            at += parts[n++].length; // a model file's length is a multiple of the alignment
        }
    }
    status = status == GONIO_OK ? gonio_model_file_write(model, stream, parts, n, error) : status;
    while (n-- > 1) {
        free((void *)(uintptr_t)parts[n].data);
    }
    return status;
}

static gonio_status build(gonio_model *const halves[GONIO_HALVES], gonio_model **out, gonio_error *error);

static gonio_status read_halves(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    size_t at = 0;
    const description *about = gonio_mapped_take(mapped, &at, sizeof *about);
    if (about == NULL) {
        return gonio_mapped_fail(mapped, 0, "the section ends before it says where its halves lie", error);
    }
    if (mapped->depth > 0) {
        return gonio_mapped_fail(mapped, 0, "halves inside another model", error);
    }
    gonio_model *halves[GONIO_HALVES] = {NULL};
    gonio_status status = GONIO_OK;
    bool any = false;
    for (int h = 0; h < GONIO_HALVES && status == GONIO_OK; h++) {
        const size_t offset = (size_t)about->half[h].offset, length = (size_t)about->half[h].length;
        if (offset == 0 && length == 0) {
            continue;
        }
        any = true;
        status = mapped->open_part(mapped, offset, length, &halves[h], error);
        if (status == GONIO_OK && halves[h]->channels != mapped->channels) {
            status = gonio_mapped_fail(mapped, offset, "a half of another number of channels", error);
        }
    }
    if (status == GONIO_OK && !any) {
        status = gonio_mapped_fail(mapped, 0, "none of the four halves is there", error);
    }
    status = status == GONIO_OK ? build(halves, out, error) : status;
    for (int h = 0; h < GONIO_HALVES && status != GONIO_OK; h++) {
        gonio_model_free(halves[h]);
    }
    if (status == GONIO_OK) {
        ((halves_model *)*out)->mapped = *mapped;
        *mapped = (gonio_mapped){0};
    }
    return status;
}

// ---- making one ----

#define OPS(sigma_or_none, support_or_none)                                                                            \
    {                                                                                                                  \
        .kind = "halves", .save = save, .eval = eval, .eval_f32 = eval_f32, .eval_channel = eval_channel,              \
        .eval_many = eval_many, .gradient = gradient, .sigma = sigma_or_none, .support = support_or_none,              \
        .sample = draw, .pdf = density, .free = release, .both_sides = true                                            \
    }
static const gonio_model_ops ops = OPS(sigma, support), ops_sigma = OPS(sigma, NULL), ops_plain = OPS(NULL, NULL);

static bool is_halves(const gonio_model *model) {
    return model->ops == &ops || model->ops == &ops_sigma || model->ops == &ops_plain;
}

// What one of the halves does not tell, the model does not.
static const gonio_model_ops *ops_of(gonio_model *const halves[GONIO_HALVES]) {
    bool has_sigma = true, has_support = true;
    for (int h = 0; h < GONIO_HALVES; h++) {
        has_sigma = has_sigma && (halves[h] == NULL || halves[h]->ops->sigma != NULL);
        has_support = has_support && (halves[h] == NULL || halves[h]->ops->support != NULL);
    }
    return !has_sigma ? &ops_plain : has_support ? &ops : &ops_sigma;
}

// All that the head says of its parts.
static void describe(halves_model *m) {
    m->head.ops = ops_of(m->part);
    m->head.isotropic = true;
    m->head.bytes = m->head.control_points = 0;
    m->head.channels = 0;
    for (int h = 0; h < GONIO_HALVES; h++) {
        const gonio_model *part = m->part[h];
        if (part == NULL) {
            continue;
        }
        if (m->head.channels == 0) {
            m->head.channels = part->channels;
            m->head.channel_names = part->channel_names;
        }
        m->head.isotropic = m->head.isotropic && part->isotropic;
        m->head.bytes += part->bytes;
        m->head.control_points += part->control_points;
    }
}

static gonio_status build(gonio_model *const halves[GONIO_HALVES], gonio_model **out, gonio_error *error) {
    halves_model *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of halves");
    }
    memcpy(m->part, halves, sizeof m->part);
    describe(m);
    *out = &m->head;
    return GONIO_OK;
}

gonio_status gonio_model_of_halves(gonio_model *const halves[GONIO_HALVES], gonio_model **out, gonio_error *error) {
    int channels = 0, n = 0;
    *out = NULL;
    for (int h = 0; h < GONIO_HALVES; h++) {
        if (halves[h] == NULL) {
            continue;
        }
        if (halves[h]->ops->both_sides) {
            return gonio_fail(error, GONIO_E_USAGE, "%s: its model has halves of its own",
                              gonio_half_name((gonio_half)h));
        }
        if (channels != 0 && halves[h]->channels != channels) {
            return gonio_fail(error, GONIO_E_USAGE, "%s has %d channels, the halves before it %d",
                              gonio_half_name((gonio_half)h), halves[h]->channels, channels);
        }
        channels = halves[h]->channels;
        n++;
    }
    if (n == 0) {
        return gonio_fail(error, GONIO_E_USAGE, "no half to make a model of");
    }
    if (n == 1 && halves[GONIO_REFLECTION] != NULL) {
        *out = halves[GONIO_REFLECTION];
        return GONIO_OK;
    }
    return build(halves, out, error);
}

const gonio_model *gonio_model_half(const gonio_model *model, gonio_half half) {
    return is_halves(model) ? ((const halves_model *)model)->part[half] : half == GONIO_REFLECTION ? model : NULL;
}

gonio_model *gonio_halves_part(gonio_model *model, gonio_half half) {
    return is_halves(model) ? ((halves_model *)model)->part[half] : NULL;
}

void gonio_halves_put(gonio_model *model, gonio_half half, gonio_model *part) {
    halves_model *m = (halves_model *)model;
    m->part[half] = part;
    describe(m);
}

const gonio_kind gonio_kind_halves = {
    .name = "halves",
    .summary = "a model of any other kind for each half: reflected and transmitted, from the front and from the back",
    .ops = &ops,
    .read = read_halves,
};
