// SPDX-License-Identifier: BSD-3-Clause
// The stages of a result in the journal: what each step's frames say before geometry, and one checksum a stage.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host/session/internal.h"

const char *gonio_stage_name(gonio_stage stage) {
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

static bool read_radiance(sqlite3_stmt *row, gonio_step_radiance *radiance) {
    const int channels = sqlite3_column_int(row, 0);
    const void *means = sqlite3_column_blob(row, 1);
    const char *hash = (const char *)sqlite3_column_text(row, 2);
    if (channels < 1 || channels > 3 || means == NULL || hash == NULL || strlen(hash) != GONIO_SHA256_HEX - 1 ||
        sqlite3_column_bytes(row, 1) != channels * (int)sizeof(double)) {
        return false;
    }
    radiance->channels = channels;
    memcpy(radiance->mean, means, (size_t)channels * sizeof(double));
    memcpy(radiance->sha256, hash, GONIO_SHA256_HEX);
    return true;
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
    sqlite3_stmt *row;
    *radiance = (gonio_step_radiance){0};
    gonio_status status = has_radiance(session, &has, error);
    if (status != GONIO_OK || !has) {
        return status;
    }
    status = gonio_session_prepare(session, "SELECT channels, means, sha256 FROM radiance WHERE step = ?", &row, error);
    if (status != GONIO_OK) {
        return status;
    }
    sqlite3_bind_int64(row, 1, step);
    const int code = sqlite3_step(row);
    if (code == SQLITE_ROW && !read_radiance(row, radiance)) {
        status = gonio_fail_line(error, GONIO_E_INPUT, session->db_path, -1,
                                 "table radiance, step %lld: not a row that a measure writes", (long long)step);
    } else if (code != SQLITE_ROW && code != SQLITE_DONE) {
        status = gonio_session_db_fail(session, error, "read a radiance");
    }
    sqlite3_finalize(row);
    return status;
}

static gonio_status hash_rows(gonio_session *session, sqlite3_stmt *rows, EVP_MD_CTX *hash, size_t *n,
                              gonio_error *error) {
    int code;
    for (*n = 0; (code = sqlite3_step(rows)) == SQLITE_ROW; ++*n) {
        const char *line = (const char *)sqlite3_column_text(rows, 0);
        EVP_DigestUpdate(hash, line != NULL ? line : "", line != NULL ? strlen(line) : 0);
        EVP_DigestUpdate(hash, "\n", 1);
    }
    return code == SQLITE_DONE ? GONIO_OK : gonio_session_db_fail(session, error, "read checksums");
}

gonio_status gonio_session_stage_hash(gonio_session *session, gonio_stage stage, char hex[GONIO_SHA256_HEX],
                                      gonio_error *error) {
    static const char *const queries[] = {
        [GONIO_STAGE_FRAMES] = "SELECT step || ' ' || frame || ' ' || sha256 FROM frames ORDER BY step, frame",
        [GONIO_STAGE_RADIANCE] = "SELECT step || ' ' || sha256 FROM radiance ORDER BY step",
        [GONIO_STAGE_SAMPLES] = "SELECT step || ' ' || sha256 FROM samples ORDER BY step",
    };
    bool has = true;
    size_t n = 0;
    sqlite3_stmt *rows;
    EVP_MD_CTX *hash;
    hex[0] = 0;
    gonio_status status = stage == GONIO_STAGE_RADIANCE ? has_radiance(session, &has, error) : GONIO_OK;
    if (status != GONIO_OK || !has) {
        return status;
    }
    status = gonio_session_prepare(session, queries[stage], &rows, error);
    if (status != GONIO_OK) {
        return status;
    }
    status = gonio_session_hash_begin(&hash, error);
    if (status == GONIO_OK) {
        status = hash_rows(session, rows, hash, &n, error);
        gonio_session_hash_end(hash, hex);
    }
    if (n == 0) {
        hex[0] = 0;
    }
    sqlite3_finalize(rows);
    return status;
}
