// Multilevel B-spline approximation (MBA).
//
// One level, Lee, Wolberg and Shin 1997, eqs. 3 to 5 (Kameya 2002, 2.3.2): a sample with residual r among the 4^d
// control points of its cell asks each for phi_c = w_c r / sum_a w_a^2; where samples disagree, the least squares
// answer is
//   phi = sum_c q_c w_c^2 phi_c / sum_c q_c w_c^2,
// with q_c the sample's weight (1 in the thesis). A point that no sample reaches keeps 0: the coarser level's value.
// Then the lattice is refined and the next level fits what is left.
//
// The residual of level h is taken from the sum of the levels below it, already refined to level h. So weights and
// addresses of a sample are computed once a level for both the residual and the sums, and no residuals are stored.
#include "fit/mba.h"

#include <stdlib.h>
#include <string.h>

struct gonio_mba {
    const gonio_scatter *scatter;
    gonio_lattice lattice;
    double start[GONIO_CHANNELS_MAX];
    int threads;
    bool begun;
};

gonio_status gonio_mba_new(const gonio_scatter *scatter, const double *start, int threads, gonio_mba **out,
                           gonio_error *error) {
    gonio_mba *mba = *out = calloc(1, sizeof *mba);
    if (mba == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a fit");
    }
    mba->scatter = scatter;
    mba->threads = threads;
    if (start != NULL) {
        memcpy(mba->start, start, (size_t)scatter->channels * sizeof *start);
    }
    return GONIO_OK;
}

void gonio_mba_free(gonio_mba *mba) {
    if (mba != NULL) {
        gonio_lattice_release(&mba->lattice);
        free(mba);
    }
}

const gonio_lattice *gonio_mba_lattice(const gonio_mba *mba) { return &mba->lattice; }

void gonio_mba_take(gonio_mba *mba, gonio_lattice *lattice) {
    *lattice = mba->lattice;
    mba->lattice.points = NULL;
}

double gonio_mba_memory(int dims, int level, int channels, size_t samples) {
    (void)samples;
    const double count = (double)gonio_lattice_count(dims, level);
    return count * (8.0 * (channels + 1) + 2 * 4.0 * channels);
}

// Add one sample to the sums; sums: count x (1 + channels), denominator first.
static void accumulate(const gonio_mba *mba, size_t sample, double *sums) {
    const gonio_scatter *s = mba->scatter;
    const gonio_lattice *l = &mba->lattice;
    const int points = s->dims == 3 ? 64 : 256;
    double w[GONIO_DIMS_MAX][4], squares = 1, weight[256];
    size_t first = 0, offset[256];
    for (int d = 0; d < s->dims; d++) {
        const uint32_t u = s->positions[sample * (size_t)s->dims + (size_t)d];
        first = first * l->size + gonio_bspline_cell(u, l->level);
        gonio_bspline_weights(gonio_bspline_place(u, l->level), w[d]);
        squares *= w[d][0] * w[d][0] + w[d][1] * w[d][1] + w[d][2] * w[d][2] + w[d][3] * w[d][3];
    }
    for (int p = 0; p < points; p++) {
        weight[p] = 1;
        offset[p] = 0;
        for (int d = 0; d < s->dims; d++) {
            const int k = p >> 2 * (s->dims - 1 - d) & 3;
            weight[p] *= w[d][k];
            offset[p] = offset[p] * l->size + (size_t)k;
        }
        offset[p] += first;
    }
    const size_t channels = (size_t)s->channels;
    const double q = s->weights != NULL ? (double)s->weights[sample] : 1;
    for (int p = 0; p < points; p++) {
        sums[offset[p] * (channels + 1)] += q * weight[p] * weight[p];
    }
    for (size_t c = 0; c < channels; c++) {
        double value = 0;
        for (int p = 0; p < points; p++) {
            value += weight[p] * (double)l->points[offset[p] * channels + c];
        }
        const double f = q * ((double)s->values[sample * channels + c] - value) / squares;
        for (int p = 0; p < points; p++) {
            sums[offset[p] * (channels + 1) + 1 + c] += f * weight[p] * weight[p] * weight[p];
        }
    }
}

// The control point that mirror symmetry exchanges with point i.
static size_t mirrored_index(const gonio_lattice *l, unsigned axes, size_t i) {
    size_t result = 0, stride = 1;
    for (int d = l->dims - 1; d >= 0; d--) {
        const size_t k = i % l->size;
        i /= l->size;
        result += (axes >> d & 1 ? l->size - 1 - k : k) * stride;
        stride *= l->size;
    }
    return result;
}

static void update(gonio_mba *mba, const double *sums) {
    gonio_lattice *l = &mba->lattice;
    const size_t channels = (size_t)l->channels, stride = channels + 1;
    for (size_t i = 0; i < l->count; i++) {
        const double *a = sums + i * stride;
        const double *b =
            mba->scatter->mirror_axes ? sums + mirrored_index(l, mba->scatter->mirror_axes, i) * stride : NULL;
        const double denominator = a[0] + (b != NULL ? b[0] : 0);
        if (denominator > 0) {
            for (size_t c = 0; c < channels; c++) {
                float *p = &l->points[i * channels + c];
                *p = (float)((double)*p + (a[c + 1] + (b != NULL ? b[c + 1] : 0)) / denominator);
            }
        }
    }
}

gonio_status gonio_mba_next(gonio_mba *mba, gonio_error *error) {
    const gonio_scatter *s = mba->scatter;
    gonio_status status;
    if (mba->begun) {
        status = gonio_lattice_refine(&mba->lattice, error);
    } else {
        status = gonio_lattice_init(&mba->lattice, s->dims, 0, s->channels, error);
        if (status == GONIO_OK) {
            gonio_lattice_fill(&mba->lattice, mba->start);
            mba->begun = true;
        }
    }
    if (status != GONIO_OK) {
        return status;
    }
    double *sums = calloc(mba->lattice.count, (size_t)(s->channels + 1) * sizeof *sums);
    if (sums == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for the sums of level %d", mba->lattice.level);
    }
    for (size_t i = 0; i < s->n; i++) {
        accumulate(mba, i, sums);
    }
    update(mba, sums);
    free(sums);
    return GONIO_OK;
}

gonio_status gonio_mba_fit(const gonio_scatter *scatter, const double *start, int level, int threads,
                           gonio_lattice *lattice, gonio_error *error) {
    gonio_mba *mba;
    gonio_status status = gonio_mba_new(scatter, start, threads, &mba, error);
    for (int h = 0; h <= level && status == GONIO_OK; h++) {
        status = gonio_mba_next(mba, error);
    }
    if (status == GONIO_OK) {
        gonio_mba_take(mba, lattice);
    }
    gonio_mba_free(mba);
    return status;
}
