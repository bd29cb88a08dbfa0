// SPDX-License-Identifier: BSD-3-Clause
// What a record of the chain stands on: its hash, and the row that it tells of.
#include <stdio.h>
#include <string.h>

#include "host/session/internal.h"

gonio_status gonio_session_record_hash(const char *prev, const session_record *record, char hex[GONIO_SHA256_HEX],
                                       gonio_error *error) {
    char head[320];
    const int n = snprintf(head, sizeof head, "%s %lld %s %s %s ", prev, (long long)record->seq, record->tbl,
                           record->op, record->content);
    if (n < 0 || (size_t)n >= sizeof head) {
        return gonio_fail(error, GONIO_E_INPUT, "record %lld of the chain is too long", (long long)record->seq);
    }
    EVP_MD_CTX *hash;
    const gonio_status status = gonio_session_hash_begin(&hash, error);
    if (status == GONIO_OK) {
        EVP_DigestUpdate(hash, head, (size_t)n);
        EVP_DigestUpdate(hash, record->key, strlen(record->key)); // last, since it may hold anything
        gonio_session_hash_end(hash, hex);
    }
    return status;
}

gonio_status gonio_session_row(gonio_session *session, const session_table *table, const char *key, sqlite3_stmt **row,
                               gonio_error *error) {
    sqlite3_stmt **statement = &session->row_of[table - gonio_session_tables];
    *row = NULL;
    if (*statement == NULL) {
        char columns[SESSION_COLUMNS_SQL], sql[SESSION_COLUMNS_SQL + 128];
        gonio_session_list_columns(table, "", columns);
        snprintf(sql, sizeof sql, "SELECT %s FROM %s WHERE %s = ?%s%s%s", columns, table->name, table->keys[0],
                 table->keys[1] != NULL ? " AND " : "", table->keys[1] != NULL ? table->keys[1] : "",
                 table->keys[1] != NULL ? " = ?" : "");
        const gonio_status status = gonio_session_prepare(session, sql, statement, error);
        if (status != GONIO_OK) {
            return status;
        }
    }
    sqlite3_reset(*statement);
    gonio_session_bind_key(table, *statement, 1, key);
    const int code = sqlite3_step(*statement);
    if (code == SQLITE_ROW) {
        *row = *statement;
        return GONIO_OK;
    }
    const gonio_status status = code == SQLITE_DONE ? GONIO_OK : gonio_session_db_fail(session, error, "read a row");
    sqlite3_reset(*statement);
    return status;
}

void gonio_session_chain_end(gonio_session *session) {
    for (int i = 0; i < SESSION_TABLES; i++) {
        sqlite3_finalize(session->row_of[i]);
        session->row_of[i] = NULL;
    }
}
