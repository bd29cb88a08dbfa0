// SPDX-License-Identifier: BSD-3-Clause
// What the files of host/session/ share.
#ifndef GONIO_SESSION_INTERNAL_H
#define GONIO_SESSION_INTERNAL_H

#include <openssl/evp.h>
#include <sqlite3.h>

#include "gonio/session.h"

#define SESSION_APPLICATION_ID 0x474f4e49 // "GONI"

// Hashes and sample rows are of little-endian words; every machine that Gonio runs on is one.
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the session's hashes need a little-endian machine");

struct gonio_session {
    sqlite3 *db;
    char *path;
    char *db_path;
    int folder_fd; // also holds the lock of a writable session
    int frames_fd;
    bool writable;
    bool in_transaction;
    bool plain; // frames are stored uncompressed
};

// ---- database.c: SQLite with gonio's errors ----
// Fill the error from the database's last failure: a full disk, damage and misuse are told apart.
gonio_status gonio_session_db_fail(gonio_session *session, gonio_error *error, const char *what);
gonio_status gonio_session_exec(gonio_session *session, const char *sql, gonio_error *error);
// The caller finalizes the statement.
gonio_status gonio_session_prepare(gonio_session *session, const char *sql, sqlite3_stmt **out, gonio_error *error);
// Step a statement that returns no rows, and finalize it in every case.
gonio_status gonio_session_run(gonio_session *session, sqlite3_stmt *statement, gonio_error *error);
// A statement that returns no rows, with its parameters; kinds has a letter for each: i an int, l an int64_t, r a
// double (NaN: NULL), t a text.
gonio_status gonio_session_do(gonio_session *session, gonio_error *error, const char *sql, const char *kinds, ...);
// One integer from a query without parameters.
gonio_status gonio_session_integer(gonio_session *session, const char *sql, int64_t *value, gonio_error *error);
// A transaction of its own, unless the caller has opened one.
gonio_status gonio_session_begin_own(gonio_session *session, bool *own, gonio_error *error);
gonio_status gonio_session_end_own(gonio_session *session, bool own, gonio_status status, gonio_error *error);
extern const char gonio_session_schema[];

// ---- session.c ----
// Lock the folder against other writers for as long as fd stays open.
gonio_status gonio_session_lock(int fd, const char *path, gonio_error *error);

// ---- frame_file.c: one frame <-> one PNG ----
enum { SESSION_FRAME_NAME = 48 };
void gonio_session_frame_name(int64_t step, int frame, char name[SESSION_FRAME_NAME]); // within frames/
gonio_status gonio_session_frame_hash(const gonio_frame *frame, char hex[GONIO_SHA256_HEX], gonio_error *error);
typedef struct session_png {
    unsigned char *data;
    size_t size, capacity;
} session_png;
// 16-bit grey, the sensor's bits at the top (sBIT tells how many), so that ordinary viewers show it. The caller frees
// png->data. GONIO_E_DEVICE where a pixel has more bits than the camera claims. plain: stored, not deflated.
gonio_status gonio_session_png_encode(const gonio_frame *frame, int bits, bool plain, session_png *png,
                                      gonio_error *error);
// frame->window.width and height are expected; frame->pixels is allocated, the caller frees it.
gonio_status gonio_session_png_decode(const session_png *png, const char *file, int bits, gonio_frame *frame,
                                      gonio_error *error);

// ---- store.c: files, written whole under a temporary name, synced, renamed ----
typedef struct session_file {
    int fd; // -1: there is none
    char name[48];
} session_file;
gonio_status gonio_session_file_write(gonio_session *session, const char *name, const session_png *png,
                                      session_file *file, gonio_error *error);
// Sync them all, then give them their names. Where one fails, those without their name are removed; a file that has its
// name and no row in the journal is swept when the session goes on.
gonio_status gonio_session_files_keep(gonio_session *session, session_file *files, int n, gonio_error *error);
// The frames of one step as one group; their hashes come back.
gonio_status gonio_session_store_frames(gonio_session *session, int64_t step, const gonio_exposure *exposures, int n,
                                        int bits, char (*hashes)[GONIO_SHA256_HEX], gonio_error *error);

// ---- steps.c ----
// Call for every step that is done, in order, with the bits of the camera's words; the first failure ends it. *steps
// takes how many steps there are, done or not, before the first call; NULL: not wanted.
typedef gonio_status (*session_step_fn)(gonio_session *session, const gonio_step *step, int bits, void *context,
                                        gonio_error *error);
gonio_status gonio_session_for_done(gonio_session *session, session_step_fn call, void *context, int64_t *steps,
                                    gonio_error *error);

// ---- frames.c ----
// The bits that the camera's words carry, from the journal.
gonio_status gonio_session_frame_bits(gonio_session *session, int *bits, gonio_error *error);
// The bytes of a frame's file; the caller frees png->data.
gonio_status gonio_session_frame_file(gonio_session *session, const char *name, session_png *png, gonio_error *error);
// Read one file and verify it; frame's window and stamp are what the journal says.
gonio_status gonio_session_frame_read(gonio_session *session, const char *name, const char *sha256, int bits,
                                      gonio_frame *frame, gonio_error *error);

// ---- hash.c: a SHA-256 in pieces; end frees the context ----
gonio_status gonio_session_hash_begin(EVP_MD_CTX **context, gonio_error *error);
void gonio_session_hash_end(EVP_MD_CTX *context, char hex[GONIO_SHA256_HEX]);

// ---- samples.c ----
gonio_status gonio_session_store_samples(gonio_session *session, int64_t step, const gonio_samples *samples,
                                         gonio_error *error);

// ---- salvage.c ----
// Copy what the damaged database of the folder still gives into a new one, which takes its place.
gonio_status gonio_session_salvage(const char *path, gonio_error *error);

#endif
