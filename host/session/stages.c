// SPDX-License-Identifier: BSD-3-Clause
// The stages of a result in the journal: what each step's frames say before geometry, and one checksum a stage.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/session/internal.h"

const char *gonio_stage_name(int stage) {
    static const char *const names[GONIO_STAGES] = {"frames", "radiance", "samples", "final", "model"};
    return names[stage];
}

gonio_status gonio_session_put_radiance(gonio_session *session, int64_t step, const gonio_step_radiance *radiance,
                                        gonio_error *error) {
    sqlite3_stmt *insert;
    const gonio_status status =
        gonio_session_prepare(session, "INSERT OR REPLACE INTO radiance VALUES(?, ?, ?, ?)", &insert, error);
    if (status != GONIO_OK) {
        return status;
    }
    sqlite3_bind_int64(insert, 1, step);
    sqlite3_bind_int(insert, 2, radiance->channels);
    sqlite3_bind_blob(insert, 3, radiance->mean, radiance->channels * (int)sizeof(double), SQLITE_STATIC);
    sqlite3_bind_text(insert, 4, radiance->sha256, -1, SQLITE_STATIC);
    return gonio_session_run(session, insert, error);
}

static void read_radiance(session_rows *rows, gonio_step_radiance *radiance) {
    const int channels = (int)gonio_row_integer(rows, 1, 1, 3);
    const size_t bytes = (size_t)channels * sizeof(double);
    const unsigned char *means = gonio_row_blob(rows, 2, bytes);
    const char *hash = gonio_row_sha256(rows, 3);
    if (rows->status == GONIO_OK) {
        radiance->channels = channels;
        memcpy(radiance->mean, means, bytes);
        memcpy(radiance->sha256, hash, GONIO_SHA256_HEX);
    }
}

// Sessions of the first releases lack the table.
static gonio_status has_radiance(gonio_session *session, bool *has, gonio_error *error) {
    int64_t tables = 0;
    const gonio_status status = gonio_session_integer(
        session, "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = 'radiance'", &tables, error);
    *has = tables > 0;
    return status;
}

gonio_status gonio_session_radiance(gonio_session *session, int64_t step, gonio_step_radiance *radiance,
                                    gonio_error *error) {
    bool has;
    *radiance = (gonio_step_radiance){0};
    const gonio_status status = has_radiance(session, &has, error);
    if (status != GONIO_OK || !has) {
        return status;
    }
    session_rows rows;
    if (gonio_rows_open(&rows, session, "radiance", 1,
                        "SELECT step, channels, means, sha256 FROM radiance WHERE step = ?", error) == GONIO_OK) {
        sqlite3_bind_int64(rows.statement, 1, step);
    }
    if (gonio_rows_next(&rows)) {
        read_radiance(&rows, radiance);
    }
    return gonio_rows_close(&rows);
}

// Lines of the keys and the checksum behind them.
static gonio_status hash_rows(session_rows *rows, EVP_MD_CTX *hash) {
    while (gonio_rows_next(rows)) {
        char line[48 + GONIO_SHA256_HEX];
        int n = 0;
        for (int k = 0; k < rows->keys; k++) {
            n += snprintf(line + n, sizeof line - (size_t)n, "%lld ",
                          (long long)gonio_row_integer(rows, k, 0, SESSION_STEP_MAX));
        }
        const char *sha256 = gonio_row_sha256(rows, rows->keys);
        n += snprintf(line + n, sizeof line - (size_t)n, "%s\n", sha256 != NULL ? sha256 : "");
        EVP_DigestUpdate(hash, line, (size_t)n);
    }
    return gonio_rows_close(rows);
}

gonio_status gonio_session_stage_hash(gonio_session *session, gonio_stage stage, char hex[GONIO_SHA256_HEX],
                                      gonio_error *error) {
    static const struct {
        const char *table, *sql;
        int keys;
    } stages[] = {
        [GONIO_STAGE_FRAMES] = {"frames", "SELECT step, frame, sha256 FROM frames ORDER BY step, frame", 2},
        [GONIO_STAGE_RADIANCE] = {"radiance", "SELECT step, sha256 FROM radiance ORDER BY step", 1},
        [GONIO_STAGE_SAMPLES] = {"samples", "SELECT step, sha256 FROM samples ORDER BY step", 1},
    };
    bool has = true;
    EVP_MD_CTX *hash;
    hex[0] = 0;
    gonio_status status = stage == GONIO_STAGE_RADIANCE ? has_radiance(session, &has, error) : GONIO_OK;
    status = status == GONIO_OK && has ? gonio_session_hash_begin(&hash, error) : status;
    if (status != GONIO_OK || !has) {
        return status;
    }
    session_rows rows;
    gonio_rows_open(&rows, session, stages[stage].table, stages[stage].keys, stages[stage].sql, error);
    status = hash_rows(&rows, hash);
    gonio_session_hash_end(hash, hex);
    if (rows.n == 0) {
        hex[0] = 0;
    }
    return status;
}
