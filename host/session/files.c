// SPDX-License-Identifier: BSD-3-Clause
// Files that a session was made from, verbatim.
#include "host/session/internal.h"

// Larger ones (a flat field, a measured table as the reference's BRDF) stand in the session's folder, where a replay
// reads them; the journal has their checksum.
#define BYTES_MAX ((size_t)1 << 20)

gonio_status gonio_session_put_file(gonio_session *session, const char *role, const char *name, const void *bytes,
                                    size_t size, gonio_error *error) {
    char hash[GONIO_SHA256_HEX];
    sqlite3_stmt *insert;
    gonio_status status = gonio_sha256(bytes, size, hash, error);
    if (status == GONIO_OK) {
        status = gonio_session_prepare(
            session, "INSERT OR REPLACE INTO files VALUES(?1 || '/' || ?2, ?1, ?2, ?3, ?4, ?5)", &insert, error);
    }
    if (status != GONIO_OK) {
        return status;
    }
    sqlite3_bind_text(insert, 1, role, -1, SQLITE_STATIC);
    sqlite3_bind_text(insert, 2, name, -1, SQLITE_STATIC);
    sqlite3_bind_text(insert, 3, hash, -1, SQLITE_STATIC);
    sqlite3_bind_int64(insert, 4, (sqlite3_int64)size);
    if (size <= BYTES_MAX) {
        sqlite3_bind_blob64(insert, 5, bytes, size, SQLITE_STATIC);
    }
    return gonio_session_run(session, insert, error);
}
