// SPDX-License-Identifier: BSD-3-Clause
// Samples: as a table where they are one, else as they lie.
#include "gonio/check.h"

#include <math.h>

#include "fit/check/measures.h"
#include "fit/check/significance.h"

// What the table's own directions do not give is interpolated: exchanged directions that are not among them, azimuths
// that are not in rings, a hemisphere that the outgoing directions do not cover.
static gonio_status check_table(const gonio_table *table, int threads, gonio_check_report *r, gonio_error *error) {
    const gonio_status status = gonio_check_table(table, threads, r, error);
    const unsigned missing = (isnan(r->reciprocity) ? GONIO_CHECK_OF_RECIPROCITY : 0u) |
                             (isnan(r->isotropy) ? GONIO_CHECK_OF_ISOTROPY : 0u) |
                             (isnan(r->energy) ? GONIO_CHECK_OF_ENERGY : 0u);
    if (status != GONIO_OK || missing == 0 || table->samples->n < 2) {
        return status;
    }
    if ((missing & GONIO_CHECK_OF_ENERGY) != 0) {
        gonio_check_report_free(r);
        r->excess = r->albedo = 0;
    }
    return gonio_check_interpolated(table->samples, missing, threads, r, error);
}

gonio_status gonio_check_half_samples(const gonio_samples *samples, int threads, gonio_check_report *report,
                                      gonio_error *error) {
    *report = (gonio_check_report){.reciprocity_expected = NAN};
    report->reciprocity_test = report->isotropy_test = report->energy_test = gonio_check_no_test;
    gonio_table *table = NULL;
    gonio_status status = gonio_samples_check(samples, error);
    for (size_t i = 0; status == GONIO_OK && i < samples->n * (size_t)samples->channels; i++) {
        report->negative += samples->values[i] < 0;
    }
    status = status == GONIO_OK ? gonio_table_of(samples, &table, error) : status;
    if (status == GONIO_OK && table != NULL) {
        status = check_table(table, threads, report, error);
    } else if (status == GONIO_OK) {
        report->form = GONIO_CHECK_SCATTERED;
        status = gonio_check_interpolated(samples, 15, threads, report, error);
    }
    gonio_table_free(table);
    if (status != GONIO_OK) {
        gonio_check_report_free(report);
    }
    return status;
}
