// SPDX-License-Identifier: BSD-3-Clause
// A table on the way to the best sum of products, channel by channel.
#include <math.h>

#include "fit/check/change.h"
#include "fit/check/measures.h"
#include "fit/check/products.h"

typedef struct source {
    const gonio_table *t;
    size_t channel;
} source;

static void read_row(void *context, size_t row, double *values) {
    const source *s = context;
    for (size_t q = 0; q < s->t->columns; q++) {
        values[q] = s->t->samples->values[gonio_table_at(s->t, row, q) * (size_t)s->t->samples->channels + s->channel];
    }
}

static void put_products(const gonio_table *t, const gonio_change *change, const gonio_products *p, size_t k, size_t c,
                         gonio_samples *out) {
    const gonio_samples *in = t->samples;
    const size_t channels = (size_t)in->channels;
    for (size_t row = 0; row < t->rows; row += gonio_table_row_step(t)) {
        const double u = gonio_change_leverage(p->u, p->rows, k, row);
        for (size_t column = 0; column < t->columns; column++) {
            const size_t at = gonio_table_at(t, row, column) * channels + c;
            double target = 0;
            for (size_t j = 0; j < k; j++) {
                target += p->value[j] * p->u[j * p->rows + row] * p->v[j * p->columns + column];
            }
            out->values[at] = gonio_change_between(change, in->values[at], target);
            if (in->sigma_random != NULL) {
                out->sigma_random[at] =
                    in->sigma_random[at] *
                    gonio_change_product_sigma(change, u, gonio_change_leverage(p->v, p->columns, k, column));
            }
        }
    }
}

gonio_status gonio_change_separable(const gonio_table *t, const gonio_change *change, gonio_samples *out,
                                    gonio_error *error) {
    const bool circular = t->isotropic && t->phis > 0;
    for (size_t c = 0; c < (size_t)out->channels; c++) {
        source s = {t, c};
        const gonio_row_source rows = {t->rows, t->columns, read_row, &s};
        gonio_products p;
        const gonio_status status = gonio_products_find(&rows, (size_t)change->products + circular, 8, &p, error);
        if (status != GONIO_OK) {
            return status;
        }
        size_t k = (size_t)change->products < p.k ? (size_t)change->products : p.k;
        // Products of an isotropic table come in pairs, cosine and sine of one frequency: half a pair would not be
        // isotropic, so it stays out.
        if (circular && k < p.k && k > 1 && p.value[k - 1] - p.value[k] < 1e-6 * p.value[k - 1]) {
            k--;
        }
        put_products(t, change, &p, k, c, out);
        gonio_products_free(&p);
    }
    return GONIO_OK;
}
