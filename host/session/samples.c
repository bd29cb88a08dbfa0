// SPDX-License-Identifier: BSD-3-Clause
// Samples in the journal: one blob of little-endian doubles a step, with its SHA-256.
//
// A row is theta_i, phi_i, theta_o, phi_o (rad), then the values, the random and the systematic sigmas, a channel each.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

// The channels' names and the isotropy are the same for all steps; the first step with samples tells them.
static gonio_status describe(gonio_session *session, const gonio_samples *samples, gonio_error *error) {
    char *known;
    if (gonio_session_get(session, "samples.channels", &known, NULL) == GONIO_OK) {
        free(known);
        return GONIO_OK;
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
    gonio_status status = gonio_session_put(session, "samples.channels", names, error);
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

static void set_names(gonio_samples *samples, char *names) {
    char *rest = names;
    for (int c = 0; c < samples->channels; c++) {
        const char *name = strsep(&rest, ",");
        snprintf(samples->channel_names[c], sizeof samples->channel_names[c], "%s", name != NULL ? name : "");
    }
}

static gonio_status new_set(gonio_session *session, gonio_samples **out, gonio_error *error) {
    char *names, *isotropic;
    gonio_status status = gonio_session_get(session, "samples.channels", &names, error);
    if (status != GONIO_OK) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->path, -1, "the session holds no samples yet");
    }
    int channels = 1;
    for (const char *c = names; *c != 0; c++) {
        channels += *c == ',';
    }
    status = gonio_samples_new(channels, true, out, error);
    if (status == GONIO_OK) {
        set_names(*out, names);
        (*out)->isotropic = true;
        if (gonio_session_get(session, "samples.isotropic", &isotropic, NULL) == GONIO_OK) {
            (*out)->isotropic = strcmp(isotropic, "0") != 0;
            free(isotropic);
        }
    }
    free(names);
    return status;
}

// A row of the samples table (step, n, channels, rows, sha256), verified and added to the set.
static gonio_status unpack(gonio_session *session, sqlite3_stmt *row, gonio_samples *samples, gonio_error *error) {
    const long long step = sqlite3_column_int64(row, 0);
    const size_t n = (size_t)sqlite3_column_int64(row, 1), channels = (size_t)samples->channels;
    const size_t bytes = (size_t)sqlite3_column_bytes(row, 3), row_size = row_doubles(samples->channels);
    const unsigned char *blob = sqlite3_column_blob(row, 3);
    const char *expected = (const char *)sqlite3_column_text(row, 4);
    char hash[GONIO_SHA256_HEX];
    gonio_status status = gonio_sha256(blob, bytes, hash, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (sqlite3_column_int(row, 2) != samples->channels || bytes != n * row_size * sizeof(double) || expected == NULL ||
        strcmp(hash, expected) != 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                               "the samples of step %lld do not match their checksum; `gonio doctor --repair` drops "
                               "them and `gonio resume` restores them from the frames",
                               step);
    }
    double *values = malloc(row_size * sizeof *values); // a blob need not be aligned
    if (values == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for %zu samples", n);
    }
    for (size_t i = 0; status == GONIO_OK && i < n; i++) {
        memcpy(values, blob + i * row_size * sizeof *values, row_size * sizeof *values);
        const gonio_pair pair = {values[0], values[1], values[2], values[3]};
        status = gonio_samples_add(samples, &pair, values + 4, values + 4 + channels, values + 4 + 2 * channels, error);
    }
    free(values);
    return status;
}

static gonio_status collect(gonio_session *session, const char *sql, int64_t step, gonio_samples *samples, size_t *rows,
                            gonio_error *error) {
    sqlite3_stmt *statement;
    gonio_status status = gonio_session_prepare(session, sql, &statement, error);
    if (status != GONIO_OK) {
        return status;
    }
    sqlite3_bind_int64(statement, 1, step);
    int code = SQLITE_DONE;
    for (*rows = 0; status == GONIO_OK && (code = sqlite3_step(statement)) == SQLITE_ROW; ++*rows) {
        status = unpack(session, statement, samples, error);
    }
    if (status == GONIO_OK && code != SQLITE_DONE) {
        status = gonio_session_db_fail(session, error, "read samples");
    }
    sqlite3_finalize(statement);
    return status;
}

static gonio_status read_set(gonio_session *session, const char *sql, int64_t step, gonio_samples **out, size_t *rows,
                             gonio_error *error) {
    *out = NULL;
    gonio_samples *samples;
    gonio_status status = new_set(session, &samples, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = collect(session, sql, step, samples, rows, error);
    if (status != GONIO_OK) {
        gonio_samples_free(samples);
        return status;
    }
    *out = samples;
    return GONIO_OK;
}

gonio_status gonio_session_samples(gonio_session *session, gonio_samples **out, gonio_error *error) {
    size_t rows;
    return read_set(session, "SELECT step, n, channels, rows, sha256 FROM samples ORDER BY step", 0, out, &rows, error);
}

gonio_status gonio_session_step_samples(gonio_session *session, int64_t step, gonio_samples **out, gonio_error *error) {
    size_t rows = 0;
    const gonio_status status = read_set(session, "SELECT step, n, channels, rows, sha256 FROM samples WHERE step = ?",
                                         step, out, &rows, error);
    if (status == GONIO_OK && rows == 0) {
        gonio_samples_free(*out);
        *out = NULL;
    }
    return status;
}

// ---- final samples: the same table again ----

static gonio_status put_final_steps(gonio_session *session, const gonio_samples *samples, gonio_error *error) {
    sqlite3_stmt *rows;
    gonio_status status = gonio_session_prepare(session, "SELECT step, n FROM samples ORDER BY step", &rows, error);
    if (status != GONIO_OK) {
        return status;
    }
    size_t first = 0;
    int code = SQLITE_DONE;
    while (status == GONIO_OK && (code = sqlite3_step(rows)) == SQLITE_ROW) {
        const size_t n = (size_t)sqlite3_column_int64(rows, 1);
        if (first + n > samples->n) {
            break;
        }
        status = store(session, "final_samples", sqlite3_column_int64(rows, 0), samples, first, n, error);
        first += n;
    }
    sqlite3_finalize(rows);
    if (status == GONIO_OK && (first != samples->n || code != SQLITE_DONE)) {
        status = gonio_fail_line(error, GONIO_E_FAILED, session->db_path, -1,
                                 "%zu final samples do not belong to the journalled ones", samples->n);
    }
    return status;
}

gonio_status gonio_session_put_final(gonio_session *session, const gonio_samples *samples, gonio_error *error) {
    bool own;
    gonio_status status = gonio_session_begin_own(session, &own, error);
    if (status == GONIO_OK) {
        status = gonio_session_end_own(session, own, put_final_steps(session, samples, error), error);
    }
    return status;
}

gonio_status gonio_session_final_samples(gonio_session *session, gonio_samples **out, bool *final, gonio_error *error) {
    int64_t count = 0, lacking = 0;
    *out = NULL;
    gonio_status status = gonio_session_integer(session, "SELECT count(*) FROM final_samples", &count, error);
    if (status == GONIO_OK) {
        status = gonio_session_integer(
            session, "SELECT count(*) FROM samples WHERE step NOT IN (SELECT step FROM final_samples)", &lacking,
            error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    *final = count > 0 && lacking == 0;
    size_t rows;
    return read_set(session,
                    *final ? "SELECT step, n, channels, rows, sha256 FROM final_samples ORDER BY step"
                           : "SELECT step, n, channels, rows, sha256 FROM samples ORDER BY step",
                    0, out, &rows, error);
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
