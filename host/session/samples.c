// SPDX-License-Identifier: BSD-3-Clause
// Samples in the journal: one blob of little-endian doubles a step, with its SHA-256.
//
// A row is theta_i, phi_i, theta_o, phi_o (rad), then the values, the random and the systematic sigmas, a channel each.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "gonio/plan.h"
#include "host/session/internal.h"

static size_t row_doubles(int channels) { return 4 + 3 * (size_t)channels; }

static double *pack(const gonio_samples *samples, size_t first, size_t n) {
    const size_t channels = (size_t)samples->channels, bytes = channels * sizeof(double);
    double *rows = calloc(n * row_doubles(samples->channels) + 1, sizeof *rows);
    double *row = rows;
    for (size_t i = first; rows != NULL && i < first + n; i++, row += row_doubles(samples->channels)) {
        memcpy(row, &samples->pairs[i], 4 * sizeof *row);
        memcpy(row + 4, samples->values + i * channels, bytes);
        if (samples->sigma_random != NULL) {
            memcpy(row + 4 + channels, samples->sigma_random + i * channels, bytes);
            memcpy(row + 4 + 2 * channels, samples->sigma_systematic + i * channels, bytes);
        }
    }
    return rows;
}

gonio_status gonio_sha256_rows(const gonio_samples *samples, char hex[GONIO_SHA256_HEX], gonio_error *error) {
    double *rows = pack(samples, 0, samples->n);
    const gonio_status status =
        rows != NULL ? gonio_sha256(rows, samples->n * row_doubles(samples->channels) * sizeof *rows, hex, error)
                     : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples", samples->n);
    free(rows);
    return status;
}

// The channels' names and the isotropy are the same for all steps; the first step with samples tells them.
static gonio_status describe(gonio_session *session, const gonio_samples *samples, gonio_error *error) {
    char *known;
    gonio_status status = gonio_session_find(session, "samples.channels", &known, error);
    if (status != GONIO_OK || known != NULL) {
        free(known);
        return status;
    }
    char *names;
    size_t size;
    FILE *stream = open_memstream(&names, &size);
    if (stream == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for channel names");
    }
    for (int c = 0; c < samples->channels; c++) {
        fprintf(stream, "%s%s", c > 0 ? "," : "", samples->channel_names[c]);
    }
    fclose(stream);
    status = gonio_session_put(session, "samples.channels", names, error);
    free(names);
    return status == GONIO_OK ? gonio_session_put(session, "samples.isotropic", samples->isotropic ? "1" : "0", error)
                              : status;
}

// Samples first .. first + n - 1 of the set as the row of a step, in one of the two tables.
static gonio_status store(gonio_session *session, const char *table, int64_t step, const gonio_samples *samples,
                          size_t first, size_t n, gonio_error *error) {
    char sql[128], hash[GONIO_SHA256_HEX];
    snprintf(sql, sizeof sql, "INSERT OR REPLACE INTO %s(step, n, channels, rows, sha256) VALUES(?, ?, ?, ?, ?)",
             table);
    sqlite3_stmt *insert;
    gonio_status status = gonio_session_prepare(session, sql, &insert, error);
    if (status != GONIO_OK) {
        return status;
    }
    double *rows = pack(samples, first, n);
    const size_t size = n * row_doubles(samples->channels) * sizeof *rows;
    status = rows != NULL ? gonio_sha256(rows, size, hash, error)
                          : gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples", n);
    if (status != GONIO_OK) {
        sqlite3_finalize(insert);
        free(rows);
        return status;
    }
    sqlite3_bind_int64(insert, 1, step);
    sqlite3_bind_int64(insert, 2, (sqlite3_int64)n);
    sqlite3_bind_int(insert, 3, samples->channels);
    sqlite3_bind_blob64(insert, 4, rows, size, free);
    sqlite3_bind_text(insert, 5, hash, -1, SQLITE_STATIC);
    return gonio_session_run(session, insert, error);
}

gonio_status gonio_session_store_samples(gonio_session *session, int64_t step, const gonio_samples *samples,
                                         gonio_error *error) {
    const gonio_status status = describe(session, samples, error);
    return status == GONIO_OK ? store(session, "samples", step, samples, 0, samples->n, error) : status;
}

gonio_status gonio_session_put_step_samples(gonio_session *session, int64_t step, const gonio_samples *samples,
                                            gonio_error *error) {
    if (samples != NULL) {
        return gonio_session_store_samples(session, step, samples, error);
    }
    return gonio_session_do(session, error, "DELETE FROM samples WHERE step = ?", "l", step);
}

// ---- reading ----

static bool set_names(gonio_samples *samples, char *names) {
    const bool good = gonio_text_is_printable(names);
    char *rest = names;
    for (int c = 0; c < samples->channels; c++) {
        const char *name = strsep(&rest, ",");
        snprintf(samples->channel_names[c], sizeof samples->channel_names[c], "%s", name != NULL ? name : "");
    }
    return good;
}

static gonio_status read_isotropic(gonio_session *session, bool *isotropic, gonio_error *error) {
    char *text;
    *isotropic = true;
    const gonio_status status = gonio_session_find(session, "samples.isotropic", &text, error);
    if (status == GONIO_OK && text != NULL) {
        *isotropic = strcmp(text, "0") != 0;
    }
    free(text);
    return status;
}

// A session without samples has no names for their channels either.
static gonio_status no_names(gonio_session *session, gonio_error *error) {
    int64_t any;
    const gonio_status status = gonio_session_integer(session, "SELECT EXISTS(SELECT 1 FROM samples)", &any, error);
    if (status != GONIO_OK) {
        return status;
    }
    return any != 0
               ? gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                 "the journal is damaged: table settings: there is no row key = 'samples.channels'")
               : gonio_fail_line(error, GONIO_E_INPUT, session->path, -1, "the session holds no samples yet");
}

static gonio_status new_set(gonio_session *session, gonio_samples **out, gonio_error *error) {
    char *names;
    gonio_status status = gonio_session_find(session, "samples.channels", &names, error);
    if (status != GONIO_OK || names == NULL) {
        return status == GONIO_OK ? no_names(session, error) : status;
    }
    int channels = 1;
    for (const char *c = names; *c != 0; c++) {
        channels += *c == ',';
    }
    if (channels > GONIO_CHANNELS_MAX) {
        status = gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                 "table settings, row key = 'samples.channels', column value: found %d names, expected "
                                 "at most %d",
                                 channels, GONIO_CHANNELS_MAX);
    }
    status = status == GONIO_OK ? gonio_samples_new(channels, true, out, error) : status;
    if (status == GONIO_OK) {
        status = set_names(*out, names)
                     ? read_isotropic(session, &(*out)->isotropic, error)
                     : gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                       "table settings, row key = 'samples.channels', column value: found a control "
                                       "character, expected names");
        if (status != GONIO_OK) {
            gonio_samples_free(*out);
            *out = NULL;
        }
    }
    free(names);
    return status;
}

static bool plausible(const double *row, size_t channels) {
    for (size_t k = 0; k < 4 + 3 * channels; k++) {
        // Angles are of directions, in rad; sigmas are not negative, values may be: of noise about zero.
        if (!isfinite(row[k]) || (k < 4 && fabs(row[k]) > 100) || (k >= 4 + channels && row[k] < 0)) {
            return false;
        }
    }
    return true;
}

static gonio_status add_rows(session_rows *rows, const unsigned char *blob, size_t n, gonio_samples *samples) {
    const size_t channels = (size_t)samples->channels, row_size = row_doubles(samples->channels);
    double *values = malloc(row_size * sizeof *values); // a blob need not be aligned
    if (values == NULL) {
        return rows->status = gonio_fail(rows->error, GONIO_E_MEMORY, "no memory for %zu samples", n);
    }
    for (size_t i = 0; rows->status == GONIO_OK && i < n; i++) {
        memcpy(values, blob + i * row_size * sizeof *values, row_size * sizeof *values);
        const gonio_pair pair = {values[0], values[1], values[2], values[3]};
        if (!plausible(values, channels)) {
            gonio_row_fail(rows, 3, "finite numbers and no negative sigma in its sample %zu", i);
        } else {
            rows->status = gonio_samples_add(samples, &pair, values + 4, values + 4 + channels,
                                             values + 4 + 2 * channels, rows->error);
        }
    }
    free(values);
    return rows->status;
}

// A row of the samples table (step, n, channels, rows, sha256), verified and added to the set.
static gonio_status unpack(session_rows *rows, gonio_samples *samples) {
    const size_t row_bytes = row_doubles(samples->channels) * sizeof(double);
    gonio_row_integer(rows, 0, 0, SESSION_STEP_MAX);
    const size_t n = (size_t)gonio_row_integer(rows, 1, 0, (int64_t)(SESSION_ROW_MAX / row_bytes));
    gonio_row_integer(rows, 2, samples->channels, samples->channels);
    const unsigned char *blob = gonio_row_blob(rows, 3, n * row_bytes);
    const char *expected = gonio_row_sha256(rows, 4);
    char hash[GONIO_SHA256_HEX];
    if (rows->status == GONIO_OK) {
        rows->status = gonio_sha256(blob, n * row_bytes, hash, rows->error);
    }
    if (rows->status == GONIO_OK && strcmp(hash, expected) != 0) {
        gonio_row_fail(rows, 4,
                       "%.12s...: the samples do not match their checksum; `gonio doctor --repair` drops them and "
                       "`gonio resume` restores them",
                       hash);
    }
    return rows->status == GONIO_OK ? add_rows(rows, blob, n, samples) : rows->status;
}

static gonio_status collect(gonio_session *session, const char *table, int64_t step, gonio_samples *samples, size_t *n,
                            gonio_error *error) {
    char sql[128];
    session_rows rows;
    snprintf(sql, sizeof sql, "SELECT step, n, channels, rows, sha256 FROM %s %s ORDER BY step", table,
             step >= 0 ? "WHERE step = ?" : "");
    if (gonio_rows_open(&rows, session, table, 1, sql, error) == GONIO_OK && step >= 0) {
        sqlite3_bind_int64(rows.statement, 1, step);
    }
    for (*n = 0; gonio_rows_next(&rows); ++*n) {
        unpack(&rows, samples);
    }
    return gonio_rows_close(&rows);
}

// Of one step, or of all of them (below 0).
static gonio_status read_set(gonio_session *session, const char *table, int64_t step, gonio_samples **out, size_t *n,
                             gonio_error *error) {
    *out = NULL;
    gonio_samples *samples;
    gonio_status status = new_set(session, &samples, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = collect(session, table, step, samples, n, error);
    if (status != GONIO_OK) {
        gonio_samples_free(samples);
        return status;
    }
    samples->transmission = gonio_pairs_transmit(samples->pairs, samples->n); // of a plan that was declared
    *out = samples;
    return GONIO_OK;
}

gonio_status gonio_session_samples(gonio_session *session, gonio_samples **out, gonio_error *error) {
    size_t n;
    return read_set(session, "samples", -1, out, &n, error);
}

gonio_status gonio_session_step_samples(gonio_session *session, int64_t step, gonio_samples **out, gonio_error *error) {
    size_t n = 0;
    const gonio_status status = read_set(session, "samples", step < 0 ? INT64_MAX : step, out, &n, error);
    if (status == GONIO_OK && n == 0) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}

// ---- final samples: the same table again ----

static gonio_status put_final_steps(gonio_session *session, const gonio_samples *samples, gonio_error *error) {
    session_rows rows;
    size_t first = 0;
    bool fit = true;
    gonio_rows_open(&rows, session, "samples", 1, "SELECT step, n FROM samples ORDER BY step", error);
    while (fit && gonio_rows_next(&rows)) {
        const int64_t step = gonio_row_integer(&rows, 0, 0, SESSION_STEP_MAX);
        const size_t n = (size_t)gonio_row_integer(&rows, 1, 0, SESSION_ROW_MAX);
        fit = n <= samples->n - first;
        if (fit && rows.status == GONIO_OK) {
            rows.status = store(session, "final_samples", step, samples, first, n, error);
            first += n;
        }
    }
    const gonio_status status = gonio_rows_close(&rows);
    return status != GONIO_OK || (fit && first == samples->n)
               ? status
               : gonio_fail_line(error, GONIO_E_FAILED, session->db_path, -1,
                                 "%zu final samples do not belong to the journalled ones", samples->n);
}

gonio_status gonio_session_each_set(gonio_session *session, bool final, session_set_fn call, void *context,
                                    gonio_error *error) {
    gonio_samples *set;
    session_rows rows;
    const gonio_status status = new_set(session, &set, error);
    if (status != GONIO_OK) {
        return status;
    }
    gonio_rows_open(&rows, session, final ? "final_samples" : "samples", 1,
                    final ? "SELECT step, n, channels, rows, sha256 FROM final_samples ORDER BY step"
                          : "SELECT step, n, channels, rows, sha256 FROM samples ORDER BY step",
                    error);
    while (gonio_rows_next(&rows)) {
        set->n = 0;
        if (unpack(&rows, set) == GONIO_OK) {
            rows.status = call(context, gonio_row_integer(&rows, 0, 0, SESSION_STEP_MAX), set, error);
        }
    }
    gonio_samples_free(set);
    return gonio_rows_close(&rows);
}

gonio_status gonio_session_put_final(gonio_session *session, const gonio_samples *samples, gonio_error *error) {
    bool own;
    gonio_status status = gonio_session_begin_own(session, &own, error);
    if (status == GONIO_OK) {
        status = gonio_session_end_own(session, own, put_final_steps(session, samples, error), error);
    }
    return status;
}

gonio_status gonio_session_is_final(gonio_session *session, bool *final, gonio_error *error) {
    int64_t count = 0, lacking = 0;
    gonio_status status = gonio_session_integer(session, "SELECT EXISTS(SELECT 1 FROM final_samples)", &count, error);
    if (status == GONIO_OK) {
        status = gonio_session_integer(
            session, "SELECT EXISTS(SELECT 1 FROM samples WHERE step NOT IN (SELECT step FROM final_samples))",
            &lacking, error);
    }
    *final = status == GONIO_OK && count > 0 && lacking == 0;
    return status;
}

gonio_status gonio_session_final_samples(gonio_session *session, gonio_samples **out, bool *final, gonio_error *error) {
    *out = NULL;
    const gonio_status status = gonio_session_is_final(session, final, error);
    if (status != GONIO_OK) {
        return status;
    }
    size_t n;
    gonio_status read = read_set(session, *final ? "final_samples" : "samples", -1, out, &n, error);
    if (read == GONIO_OK && (read = gonio_session_head(session, &(*out)->head, error)) != GONIO_OK) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return read;
}

gonio_status gonio_session_read(const char *path, gonio_samples **out, gonio_error *error) {
    *out = NULL;
    gonio_session *session;
    gonio_status status = gonio_session_open(path, false, &session, error);
    if (status == GONIO_OK) {
        bool final;
        status = gonio_session_final_samples(session, out, &final, error);
    }
    gonio_session_close(session);
    return status;
}
