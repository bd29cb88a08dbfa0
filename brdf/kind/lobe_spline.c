// Models of kind "lobe-spline": evaluation, uncertainty, file section.
//
// Section: 64 bytes of description, the lobes' shapes, their strengths, the links, the control points, the sigma
// lattice's points and the channels' sigma factors, each part aligned (brdf/model_file.h).
#include "brdf/kind/lobe_spline.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "brdf/kind.h"
#include "brdf/kind/analytic.h"
#include "brdf/model_file.h"
#include "brdf/spline/profile.h"
#include "gonio/sample.h"

typedef struct lobe_model {
    gonio_model head;
    gonio_lobe_spline_parts parts;
    double mean_strength[1 + GONIO_LOBES_MAX];
    char (*names)[32];   // NULL when they lie in the file
    gonio_mapped mapped; // base NULL: the arrays are our own
} lobe_model;

#define NO_LEVEL UINT32_MAX
#define HAS_RANGES 1u
#define HAS_TERMS 2u                         // a profile or shares: readers that do not know them refuse the file
#define LINK_GRAZING (GONIO_LINK_ASINH + 1u) // the positive link with a grazing factor: older readers refuse it
#define GRAZING_MAX 2.0F

typedef struct description {
    uint32_t dims, level, coordinates, link, lobes, family, sigma_level;
    float cosine_min;           // 0: none, as in files that are older than it
    uint32_t flags;             // what follows; in older files a spline is held nowhere
    uint32_t sigma_coordinates; // 0: the model's, as in older files; 1: half-vector
    float grazing;              // with LINK_GRAZING
    uint32_t profile;           // level of the profile's lattice + 1; 0: none
    uint32_t shares;            // 1: with lobes, multiples of their shares follow
    uint32_t reserved[3];
} description;
_Static_assert(sizeof(description) == 64, "the description is one block");

// The unit vector of the same azimuth whose cosine is at least z.
static gonio_vec3 lifted(gonio_vec3 w, double z) {
    if (w.z >= z) {
        return w;
    }
    const double shrink = sqrt((1 - z * z) / (w.x * w.x + w.y * w.y));
    return (gonio_vec3){w.x * shrink, w.y * shrink, z};
}

void gonio_lobe_base_units(const gonio_lobe_base *base, gonio_vec3 wi, gonio_vec3 wo, double out[1 + GONIO_LOBES_MAX]) {
    out[0] = 1;
    if (base->lobes == 0) {
        const double least = (double)base->cosine_min;
        out[0] = base->grazing > 0 ? -(double)base->grazing * log(fmax(wi.z, least) * fmax(wo.z, least)) : 0;
        return;
    }
    const gonio_lobe_geometry g = gonio_lobe_geometry_of(lifted(wi, base->cosine_min), lifted(wo, base->cosine_min));
    for (int j = 0; j < base->lobes; j++) {
        out[1 + j] = base->family == GONIO_LOBE_GGX ? gonio_lobe_ggx(&g, base->alpha[j], base->alpha[j], base->f0[j])
                                                    : gonio_lobe_cook_torrance(&g, base->alpha[j], base->f0[j]);
    }
}

const char *gonio_lobe_base_name(const gonio_lobe_base *base) {
#define NAME(id, number, name) [number] = name,
    static const char *const names[] = {GONIO_LOBE_FAMILY_TABLE(NAME)};
#undef NAME
    return base->lobes == 0 ? "none" : names[base->family];
}

void gonio_lobe_mean_strengths(const gonio_lobe_base *base, int channels, double mean[1 + GONIO_LOBES_MAX]) {
    for (int j = 0; j < 1 + GONIO_LOBES_MAX; j++) {
        mean[j] = 0;
        for (int c = 0; c < channels && j <= base->lobes; c++) {
            mean[j] += base->strength[c * (1 + GONIO_LOBES_MAX) + j] / channels;
        }
    }
}

void gonio_lobe_shares(const gonio_lobe_base *base, const double *mean, const double *units,
                       double share[1 + GONIO_LOBES_MAX]) {
    double sum = 0;
    for (int j = 0; j < 1 + GONIO_LOBES_MAX; j++) {
        share[j] = j <= base->lobes ? mean[j] * units[j] : 0;
        sum += share[j];
    }
    for (int j = 0; j < 1 + GONIO_LOBES_MAX; j++) {
        share[j] = sum > 0 ? share[j] / sum : 0;
    }
}

static void locate(const gonio_lobe_spline_parts *p, gonio_coordinates system, gonio_vec3 wi, gonio_vec3 wo,
                   double x[4]) {
    if (p->dims == 3) {
        gonio_coordinates_isotropic(system, wi, wo, x);
    } else {
        gonio_coordinates_anisotropic(system, wi, wo, x);
    }
}

double gonio_lobe_base_link(const gonio_lobe_base *base, const double *strength, const double *units,
                            gonio_link_kind kind, const gonio_link *link) {
    if (base->lobes == 0) {
        return units[0];
    }
    double sum = strength[0];
    for (int j = 0; j < base->lobes; j++) {
        sum += strength[1 + j] * units[1 + j];
    }
    return gonio_link_apply(kind, link, fmin(sum, GONIO_LOBE_CEILING * link->scale));
}

static double held(const gonio_lobe_spline_parts *p, int c, double t) {
    return p->range != NULL ? fmin(fmax(t, p->range[2 * c]), p->range[2 * c + 1]) : t;
}

// Spline value -> link value of channel c.
static double add_base(const gonio_lobe_spline_parts *p, const double *units, int c, double value) {
    if (p->base.lobes == 0) {
        return held(p, c, value + units[0]);
    }
    const double spline = held(p, c, value);
    const double *strength = p->base.strength + (ptrdiff_t)c * (1 + GONIO_LOBES_MAX);
    const double base = gonio_lobe_base_link(&p->base, strength, units, p->kind, &p->links[c]);
    return fmin(base + spline, fmax(base, gonio_link_apply(p->kind, &p->links[c], p->links[c].scale)));
}

static void add_profile(const gonio_lobe_spline_parts *p, const double x[3], double *values) {
    double y[2], more[GONIO_CHANNELS_MAX];
    if (p->profile.points != NULL) {
        gonio_profile_locate(p->coordinates, x, y);
        gonio_lattice_eval(&p->profile, y, more);
        for (int c = 0; c < p->channels; c++) {
            values[c] += more[c];
        }
    }
}

static void add_shares(const lobe_model *m, const double *units, double *values) {
    const gonio_lobe_spline_parts *p = &m->parts;
    double share[1 + GONIO_LOBES_MAX];
    if (p->shares != NULL) {
        gonio_lobe_shares(&p->base, m->mean_strength, units, share);
        for (int c = 0; c < p->channels; c++) {
            for (int j = 0; j <= p->base.lobes; j++) {
                values[c] += p->shares[c * (1 + GONIO_LOBES_MAX) + j] * share[j];
            }
        }
    }
}

// values: f_r; slopes (may be NULL): d f_r / d link value.
static void evaluate(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values, double *slopes) {
    const gonio_lobe_spline_parts *p = &((const lobe_model *)model)->parts;
    double units[1 + GONIO_LOBES_MAX];
    gonio_lobe_base_units(&p->base, wi, wo, units);
    if (p->lattice.points != NULL) {
        double x[4];
        locate(p, p->coordinates, wi, wo, x);
        gonio_lattice_eval(&p->lattice, x, values);
        add_profile(p, x, values);
    } else {
        memset(values, 0, (size_t)model->channels * sizeof *values);
    }
    add_shares((const lobe_model *)model, units, values);
    for (int c = 0; c < model->channels; c++) {
        const double t = add_base(p, units, c, values[c]);
        values[c] = gonio_link_invert(p->kind, &p->links[c], t, slopes != NULL ? &slopes[c] : NULL);
    }
}

static void eval(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *values) {
    evaluate(model, wi, wo, values, NULL);
}

// sigma_z = dz/dt sigma_t. A sigma_t above 2 (a factor of e^2) says no more than "unknown".
static void sigma(const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo, double *out) {
    const gonio_lobe_spline_parts *p = &((const lobe_model *)model)->parts;
    double values[GONIO_CHANNELS_MAX], x[4], ln_sigma;
    evaluate(model, wi, wo, values, out);
    locate(p, p->sigma_half_vector ? GONIO_HALF_VECTOR : p->coordinates, wi, wo, x);
    gonio_lattice_eval(&p->sigma, x, &ln_sigma);
    const double shape = exp(fmin(fmax(ln_sigma, -60), 60));
    for (int c = 0; c < model->channels; c++) {
        const double sigma_t = shape * p->sigma_factor[c];
        out[c] *= p->kind == GONIO_LINK_LINEAR ? sigma_t : fmin(sigma_t, 2);
    }
}

static void release(gonio_model *model) {
    lobe_model *m = (lobe_model *)model;
    if (m->mapped.base == NULL) {
        gonio_lobe_spline_parts_release(&m->parts);
    }
    gonio_mapped_release(&m->mapped);
    free(m->names);
    free(m);
}

static gonio_status save(const gonio_model *model, const char *path, gonio_error *error) {
    const gonio_lobe_spline_parts *p = &((const lobe_model *)model)->parts;
    const description about = {.dims = (uint32_t)p->dims,
                               .level = p->lattice.points != NULL ? (uint32_t)p->lattice.level : NO_LEVEL,
                               .coordinates = (uint32_t)p->coordinates,
                               .link = p->base.grazing > 0 ? LINK_GRAZING : (uint32_t)p->kind,
                               .grazing = p->base.grazing,
                               .lobes = (uint32_t)p->base.lobes,
                               .family = (uint32_t)p->base.family,
                               .cosine_min = p->base.cosine_min,
                               .flags = (p->range != NULL ? HAS_RANGES : 0) |
                                        (p->profile.points != NULL || p->shares != NULL ? HAS_TERMS : 0),
                               .sigma_coordinates = p->sigma_half_vector,
                               .shares = p->shares != NULL,
                               .profile = p->profile.points != NULL ? (uint32_t)p->profile.level + 1 : 0,
                               .sigma_level = p->sigma.points != NULL ? (uint32_t)p->sigma.level : NO_LEVEL};
    double shapes[2 * GONIO_LOBES_MAX];
    memcpy(shapes, p->base.alpha, sizeof p->base.alpha);
    memcpy(shapes + GONIO_LOBES_MAX, p->base.f0, sizeof p->base.f0);
    const size_t c = (size_t)model->channels;
    gonio_file_part parts[10] = {{&about, sizeof about}, {p->links, c * sizeof *p->links}};
    int n = 2;
    if (p->base.lobes > 0) {
        parts[n++] = (gonio_file_part){shapes, sizeof shapes};
        parts[n++] = (gonio_file_part){p->base.strength, c * (1 + GONIO_LOBES_MAX) * sizeof(double)};
    }
    if (p->lattice.points != NULL) {
        parts[n++] = (gonio_file_part){p->lattice.points, p->lattice.count * c * sizeof(float)};
    }
    if (p->range != NULL) {
        parts[n++] = (gonio_file_part){p->range, 2 * c * sizeof(double)};
    }
    if (p->sigma.points != NULL) {
        parts[n++] = (gonio_file_part){p->sigma.points, p->sigma.count * sizeof(float)};
        parts[n++] = (gonio_file_part){p->sigma_factor, c * sizeof(double)};
    }
    if (p->profile.points != NULL) {
        parts[n++] = (gonio_file_part){p->profile.points, p->profile.count * c * sizeof(float)};
    }
    if (p->shares != NULL) {
        parts[n++] = (gonio_file_part){p->shares, c * (1 + GONIO_LOBES_MAX) * sizeof(double)};
    }
    return gonio_model_file_write(model, path, parts, n, error);
}

#define OPS .kind = "lobe-spline", .eval = eval, .save = save, .free = release
static const gonio_model_ops ops = {OPS};
static const gonio_model_ops ops_sigma = {OPS, .sigma = sigma};

static void fill_head(lobe_model *m) {
    const gonio_lobe_spline_parts *p = &m->parts;
    const size_t c = (size_t)p->channels;
    gonio_lobe_mean_strengths(&p->base, p->base.lobes > 0 ? p->channels : 0, m->mean_strength);
    m->head.ops = p->sigma.points != NULL && p->channels <= GONIO_CHANNELS_MAX ? &ops_sigma : &ops;
    m->head.channels = p->channels;
    m->head.isotropic = p->dims == 3;
    m->head.control_points =
        (p->lattice.points != NULL ? p->lattice.count : 0) + (p->profile.points != NULL ? p->profile.count : 0);
    m->head.bytes = sizeof *m + c * sizeof *p->links + (p->base.lobes > 0 ? c * 3 * sizeof(double) : 0) +
                    m->head.control_points * c * sizeof(float);
}

void gonio_lobe_spline_parts_release(gonio_lobe_spline_parts *parts) {
    free(parts->links);
    free(parts->base.strength);
    free(parts->sigma_factor);
    free(parts->range);
    free(parts->shares);
    gonio_lattice_release(&parts->lattice);
    gonio_lattice_release(&parts->sigma);
    gonio_lattice_release(&parts->profile);
    *parts = (gonio_lobe_spline_parts){0};
}

gonio_status gonio_lobe_spline_new(gonio_lobe_spline_parts *parts, gonio_model **out, gonio_error *error) {
    *out = NULL;
    const size_t c = (size_t)parts->channels;
    lobe_model *m = calloc(1, sizeof *m);
    if (m == NULL || (m->names = malloc(c * sizeof *m->names)) == NULL) {
        free(m);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %zu channels", c);
    }
    memcpy(m->names, parts->channel_names, c * sizeof *m->names);
    m->head.channel_names = (const char(*)[32])m->names;
    m->parts = *parts;
    m->parts.channel_names = m->head.channel_names;
    *parts = (gonio_lobe_spline_parts){0};
    fill_head(m);
    *out = &m->head;
    return GONIO_OK;
}

const gonio_lobe_spline_parts *gonio_lobe_spline_about(const gonio_model *model) {
    return model->ops == &ops || model->ops == &ops_sigma ? &((const lobe_model *)model)->parts : NULL;
}

// ---- from a file ----

static bool level_possible(uint32_t level) { return level == NO_LEVEL || level <= 9; }

static bool grazing_possible(const description *about) {
    return about->link == LINK_GRAZING
               ? about->lobes == 0 && about->cosine_min > 0 && about->grazing > 0 && about->grazing <= GRAZING_MAX
               : about->grazing == 0;
}

static bool terms_possible(const description *about) {
    const bool profile =
        about->profile == 0 || (about->profile <= 10 && about->level != NO_LEVEL && about->dims == 3 &&
                                gonio_coordinates_are_half_vector((gonio_coordinates)about->coordinates));
    const bool shares = about->shares == 0 || (about->shares == 1 && about->lobes > 0);
    const bool told = (about->flags & HAS_TERMS) != 0;
    return profile && shares && told == (about->profile > 0 || about->shares > 0);
}

static gonio_status check_description(const gonio_mapped *mapped, const description *about, gonio_error *error) {
    if (about == NULL) {
        return gonio_mapped_fail(mapped, 0, "the lobe-spline's description is cut short", error);
    }
    if (about->dims != (mapped->isotropic ? 3u : 4u) || !level_possible(about->level) ||
        !level_possible(about->sigma_level) || about->coordinates >= GONIO_COORDINATES || about->link > LINK_GRAZING ||
        about->lobes > GONIO_LOBES_MAX || about->family >= GONIO_LOBE_FAMILIES ||
        about->flags > (HAS_RANGES | HAS_TERMS) || about->sigma_coordinates > 1 ||
        !(about->cosine_min >= 0 && about->cosine_min <= 1) || !grazing_possible(about) || !terms_possible(about)) {
        return gonio_mapped_fail(mapped, 0, "a lobe-spline of impossible dimensions, level, lobes or domain", error);
    }
    return GONIO_OK;
}

// The model never writes to what it maps; the members are not const because the fit fills the same struct.
static void *take(const gonio_mapped *mapped, size_t *at, size_t count, size_t size, bool *complete) {
    const void *data = size == 0 || count <= SIZE_MAX / size ? gonio_mapped_take(mapped, at, count * size) : NULL;
    *complete = *complete && data != NULL;
    return (void *)(uintptr_t)data;
}

static void take_lattice(const gonio_mapped *mapped, size_t *at, uint32_t level, int dims, int channels,
                         gonio_lattice *lattice, bool *complete) {
    if (level == NO_LEVEL) {
        return;
    }
    const size_t count = gonio_lattice_count(dims, (int)level);
    *lattice = (gonio_lattice){.dims = dims,
                               .level = (int)level,
                               .channels = channels,
                               .size = gonio_bspline_size((int)level),
                               .count = count};
    lattice->points = take(mapped, at, count * (size_t)channels, sizeof(float), complete);
}

static void take_base(const gonio_mapped *mapped, size_t *at, gonio_lobe_base *base, bool *complete) {
    const double *shapes = take(mapped, at, 2 * GONIO_LOBES_MAX, sizeof(double), complete);
    if (shapes != NULL) {
        memcpy(base->alpha, shapes, sizeof base->alpha);
        memcpy(base->f0, shapes + GONIO_LOBES_MAX, sizeof base->f0);
    }
    base->strength = take(mapped, at, (size_t)mapped->channels * (1 + GONIO_LOBES_MAX), sizeof(double), complete);
}

// False where the section ends early.
static bool take_parts(const gonio_mapped *mapped, const description *about, size_t at, gonio_lobe_spline_parts *p) {
    const size_t c = (size_t)mapped->channels;
    const int dims = (int)about->dims;
    bool complete = true;
    p->links = take(mapped, &at, c, sizeof *p->links, &complete);
    if (p->base.lobes > 0) {
        take_base(mapped, &at, &p->base, &complete);
    }
    take_lattice(mapped, &at, about->level, dims, mapped->channels, &p->lattice, &complete);
    if ((about->flags & HAS_RANGES) != 0) {
        p->range = take(mapped, &at, 2 * c, sizeof *p->range, &complete);
    }
    take_lattice(mapped, &at, about->sigma_level, dims, 1, &p->sigma, &complete);
    if (about->sigma_level != NO_LEVEL) {
        p->sigma_factor = take(mapped, &at, c, sizeof(double), &complete);
    }
    take_lattice(mapped, &at, about->profile > 0 ? about->profile - 1 : NO_LEVEL, 2, mapped->channels, &p->profile,
                 &complete);
    if (about->shares == 1) {
        p->shares = take(mapped, &at, c * (1 + GONIO_LOBES_MAX), sizeof *p->shares, &complete);
    }
    return complete;
}

static bool all_finite(const double *numbers, size_t n) {
    bool finite = true;
    for (size_t i = 0; numbers != NULL && i < n; i++) {
        finite = finite && isfinite(numbers[i]);
    }
    return finite;
}

// The numbers of which there are few; control points are not looked at.
static bool numbers_possible(const gonio_lobe_spline_parts *p) {
    const size_t c = (size_t)p->channels, row = 1 + GONIO_LOBES_MAX;
    bool possible = gonio_scales_possible(&p->links->scale, c, p->kind != GONIO_LINK_LINEAR) &&
                    all_finite(p->base.strength, c * row) && all_finite(p->range, 2 * c) &&
                    all_finite(p->sigma_factor, c) && all_finite(p->shares, c * row);
    for (int j = 0; j < p->base.lobes; j++) {
        possible =
            possible && p->base.alpha[j] > 0 && isfinite(p->base.alpha[j]) && p->base.f0[j] >= 0 && p->base.f0[j] <= 1;
    }
    return possible;
}

static gonio_status read_model(gonio_mapped *mapped, gonio_model **out, gonio_error *error) {
    size_t at = 0;
    const description *about = gonio_mapped_take(mapped, &at, sizeof *about);
    const gonio_status status = check_description(mapped, about, error);
    if (status != GONIO_OK) {
        return status;
    }
    const bool grazing = about->link == LINK_GRAZING;
    gonio_lobe_spline_parts p = {.channels = mapped->channels,
                                 .dims = (int)about->dims,
                                 .coordinates = (gonio_coordinates)about->coordinates,
                                 .kind = grazing ? GONIO_LINK_POSITIVE : (gonio_link_kind)about->link,
                                 .base = {.lobes = (int)about->lobes,
                                          .family = (gonio_lobe_family)about->family,
                                          .cosine_min = about->cosine_min,
                                          .grazing = about->grazing},
                                 .sigma_half_vector = about->sigma_coordinates == 1,
                                 .channel_names = mapped->names};
    if (!take_parts(mapped, about, at, &p)) {
        return gonio_mapped_fail(mapped, 0, "the section is shorter than its level, lobes and channels need", error);
    }
    if (!numbers_possible(&p)) {
        return gonio_mapped_fail(mapped, sizeof *about, "scales, strengths or shapes that no fit makes", error);
    }
    lobe_model *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a model of %d channels", mapped->channels);
    }
    m->parts = p;
    m->mapped = *mapped;
    *mapped = (gonio_mapped){0};
    m->head.channel_names = m->mapped.names;
    fill_head(m);
    *out = &m->head;
    return GONIO_OK;
}

const gonio_kind gonio_kind_lobe_spline = {
    .name = "lobe-spline",
    .summary = "analytic lobes times what a B-spline says about their error, with an uncertainty; either may be absent",
    .ops = &ops_sigma,
    .read = read_model,
};
