// SPDX-License-Identifier: BSD-3-Clause
// What the files of host/session/ share.
#ifndef GONIO_SESSION_INTERNAL_H
#define GONIO_SESSION_INTERNAL_H

#include <jansson.h>
#include <openssl/evp.h>
#include <sqlite3.h>
#include <stdatomic.h>

#include "gonio/session.h"

// What a session may hold, far beyond what one does: more is damage or malice. Bytes of the database, of one of its
// rows, and of a setting; pixels of a frame.
#define SESSION_DATABASE_MAX ((int64_t)1 << 40)
#define SESSION_ROW_MAX (1 << 29)
#define SESSION_SETTING_MAX (1 << 24)
#define SESSION_PIXELS_MAX ((int64_t)1 << 28)
#define SESSION_SIZE_MAX 65536 // of a frame's sides
#define SESSION_STEP_MAX INT32_MAX
#define SESSION_FRAMES_MAX 1000000        // of a step
#define SESSION_CLOCK_MAX 1e12            // s
#define SESSION_EXPOSURE_MAX 1e6          // s
#define SESSION_APPLICATION_ID 0x474f4e49 // "GONI"

// Hashes and sample rows are of little-endian words; every machine that Gonio runs on is one.
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the session's hashes need a little-endian machine");

enum { SESSION_TABLES = 10, SESSION_COLUMNS = 20, SESSION_KEY = 160 };

// What a transaction of a writing connection does beside SQLite's part: chain.c sets it.
typedef struct session_hooks {
    gonio_status (*before_begin)(gonio_session *session, gonio_error *error);
    gonio_status (*before_commit)(gonio_session *session, gonio_error *error);
    void (*after_commit)(gonio_session *session);
} session_hooks;

// How long SQLite may work at one query: pages of a damaged database can lead in circles.
typedef struct session_budget {
    atomic_llong looks; // at the query, so far
    long long limit;
} session_budget;

struct gonio_session {
    sqlite3 *db;
    const session_hooks *hooks; // NULL: what is changed enters no chain
    char *path;
    char *db_path;
    char *private_path;   // a copy of the journal is open instead of the journal itself; NULL: none
    char *private_folder; // that it stands in
    bool private_made;    // for this session alone, and removed with it
    int folder_fd;        // also holds the lock of a writable session
    int frames_fd;
    int version; // of the format that the database is in
    bool writable;
    bool in_transaction;
    bool plain;    // frames are stored uncompressed
    bool unsynced; // nothing waits for the disk
    session_budget budget;
    bool host_known;                      // this run has its row in `hosts`
    sqlite3_stmt *row_of[SESSION_TABLES]; // one row by its key, prepared at the first use
    struct {                              // session.log, as far as this connection may write it
        int fd;                           // -1: not
        int64_t seq, size;                // of its last record, and where that ends
        char hash[65];
        bool lags, off, tail; // off: it contradicts the database, and nothing is added to it; tail: something may
        // stand behind that end
    } log;
};

// ---- database.c: SQLite with gonio's errors ----
// Fill the error from the database's last failure: a full disk, damage and misuse are told apart.
gonio_status gonio_session_db_fail(gonio_session *session, gonio_error *error, const char *what);
gonio_status gonio_session_exec(gonio_session *session, const char *sql, gonio_error *error);
// The caller finalizes the statement.
gonio_status gonio_session_prepare(gonio_session *session, const char *sql, sqlite3_stmt **out, gonio_error *error);
// Step a statement that returns no rows, and finalize it in every case. One that changes something is a transaction of
// its own, unless the caller has opened one.
gonio_status gonio_session_run(gonio_session *session, sqlite3_stmt *statement, gonio_error *error);
// A statement that returns no rows, with its parameters; kinds has a letter for each: i an int, l an int64_t, r a
// double (NaN: NULL), t a text (NULL: NULL).
gonio_status gonio_session_do(gonio_session *session, gonio_error *error, const char *sql, const char *kinds, ...);
// One integer from a query without parameters.
gonio_status gonio_session_integer(gonio_session *session, const char *sql, int64_t *value, gonio_error *error);
// A transaction of its own, unless the caller has opened one.
gonio_status gonio_session_begin_own(gonio_session *session, bool *own, gonio_error *error);
gonio_status gonio_session_end_own(gonio_session *session, bool own, gonio_status status, gonio_error *error);

// ---- schema.c: the tables whose rows the chain holds; the last has no name ----
typedef struct session_table {
    const char *name, *keys[2], *columns[SESSION_COLUMNS]; // in the table's order
} session_table;
extern const char gonio_session_schema[];
extern const session_table gonio_session_tables[SESSION_TABLES + 1];
const session_table *gonio_session_table(const char *name); // NULL: none
int gonio_session_columns(const session_table *table);
// The key as a text, "3" or "3/0", as SQL; row: "NEW.", "t." or "". The columns as a list, each after `before`.
enum { SESSION_KEY_SQL = 96, SESSION_COLUMNS_SQL = 512 };
void gonio_session_key_sql(const session_table *table, const char *row, char sql[SESSION_KEY_SQL]);
void gonio_session_list_columns(const session_table *table, const char *before, char sql[SESSION_COLUMNS_SQL]);
// The same as parameters `first`, ... of a statement.
void gonio_session_bind_key(const session_table *table, sqlite3_stmt *statement, int first, const char *key);
// SHA-256 of a row that stands in the columns first, ... of a statement's answer.
gonio_status gonio_session_row_hash(const session_table *table, sqlite3_stmt *row, int first,
                                    char hex[GONIO_SHA256_HEX], gonio_error *error);
// That row as a JSON object without what is NULL; NULL: no memory. And back, into parameters 1, ...; false: no such
// row.
json_t *gonio_session_row_json(const session_table *table, sqlite3_stmt *row, int first);
bool gonio_session_row_bind(const session_table *table, sqlite3_stmt *statement, json_t *row);

// ---- hosts.c ----
gonio_status gonio_session_enter_host(gonio_session *session, gonio_error *error);

// ---- chain.c: every change of a row is a record, whose hash is over the record before it too ----
#define SESSION_CHAIN_START "0000000000000000000000000000000000000000000000000000000000000000"
typedef struct session_record {
    int64_t seq;           // 1, 2, ...
    const char *tbl, *key; // "" for a commit
    const char *op;        // put: the row is now so; delete: it is gone; commit: a transaction ends
    const char *content;   // SHA-256 of the row; "" where there is none
} session_record;
gonio_status gonio_session_record_hash(const char *prev, const session_record *record, char hex[GONIO_SHA256_HEX],
                                       gonio_error *error);
// From now on every transaction of this connection enters the chain.
gonio_status gonio_session_chain_begin(gonio_session *session, gonio_error *error);
// Every row there is counts as changed: those of a session that had no chain yet.
gonio_status gonio_session_chain_all(gonio_session *session, gonio_error *error);
// Look up a row by its key: *row stands on it (reset it), or is NULL where there is none. It lives as long as the
// session.
gonio_status gonio_session_row(gonio_session *session, const session_table *table, const char *key, sqlite3_stmt **row,
                               gonio_error *error);
void gonio_session_chain_end(gonio_session *session);

// ---- log.c: session.log, the chain a second time, with the rows ----
typedef struct session_line {
    long long number;   // 1, 2, ...
    int64_t begin, end; // bytes in the file
    bool proven;        // the rest is sound and fits hash and prev; else nothing of it counts
    session_record record;
    const char *prev, *hash;
    json_t *row; // NULL: a commit, a deletion, or a row that was not known any more when the line was written
} session_line;
typedef gonio_status (*session_line_fn)(const session_line *line, void *context, gonio_error *error);
// Call for every line of the log in a folder, or for those within its last bytes (0: all). No log: no call.
gonio_status gonio_session_log_for(int folder_fd, const char *folder, int64_t last, session_line_fn call, void *context,
                                   gonio_error *error);
// A record as a line of the log; the caller frees it. row: taken over; NULL: none.
json_t *gonio_session_line_json(const session_record *record, const char *prev, const char *hash, json_t *row);
// Append what the chain has and the log has not, and sync it.
gonio_status gonio_session_log_catch_up(gonio_session *session, gonio_error *error);
// Begin to write, after a verification: cut a torn tail off, write anew what cannot be gone on with.
struct session_proof;
gonio_status gonio_session_log_open(gonio_session *session, const struct session_proof *proof, gonio_error *error);

// ---- verify.c ----
typedef enum session_log_state {
    SESSION_LOG_SOUND,   // ends where the database does, or at most one transaction before
    SESSION_LOG_MISSING, // there is none
    SESSION_LOG_SHORT,   // lacks more than one transaction at its end
    SESSION_LOG_DAMAGED, // lines amid it do not prove themselves
    SESSION_LOG_AHEAD,   // holds what the database lacks
    SESSION_LOG_OTHER    // contradicts the database
} session_log_state;
typedef struct session_proof {
    bool sound;    // the database proves itself, and the log is sound
    bool database; // its pages are sound, its chain is whole, and every row is the one that the chain tells
    bool chained;  // false: of version 1, without a chain; then `database` is about its pages alone
    session_log_state log;
    int64_t seq, log_seq; // last record of the chain, and of the log as far as it is whole and agrees
    int64_t log_size;     // where that one ends
    int64_t log_lag;      // transactions that the log lacks
    char log_hash[65];    // of that record
    char what[512];       // what breaks first, with table, row and column; empty where nothing does
} session_proof;
// Hold all of the journal against its chain, and the log against it. GONIO_OK with what is wrong in the proof; an error
// is what prevented the verification.
gonio_status gonio_session_verify(gonio_session *session, session_proof *proof, gonio_error *error);
// The same, but of the log the last lines alone: enough to see whether the database is the newer of the two, which is
// all that a reader wants of it.
gonio_status gonio_session_verify_rows(gonio_session *session, session_proof *proof, gonio_error *error);
// GONIO_E_INPUT where the proof does not vouch for what the database says.
gonio_status gonio_session_vouch(const gonio_session *session, const session_proof *proof, gonio_error *error);
// Open without that: for whoever looks for what is wrong.
gonio_status gonio_session_open_unproven(const char *path, bool writable, gonio_session **out, gonio_error *error);

// The journal alone, to be written, without a look at frames/ or at whether it proves itself.
gonio_status gonio_session_open_journal(const char *path, gonio_session **out, gonio_error *error);

// ---- copy.c: a copy of the database with what its -wal and -journal hold, for whoever may not touch it ----
typedef struct session_copy {
    sqlite3 *db; // NULL: there is no database, or nothing that SQLite can open
    char *path;
    session_budget budget;
} session_copy;
// The session's folder, and one to copy into. GONIO_E_IO where a file is there and cannot be read.
gonio_status gonio_session_copy_open(const char *from, const char *into, session_copy *copy, gonio_error *error);
void gonio_session_copy_close(session_copy *copy); // and remove it

// ---- rebuild.c ----
typedef struct session_rebuilt {
    int64_t rows;      // in the new journal
    int64_t lost;      // rows that one record or another tells of and nobody has any more
    bool complete;     // every record of the chain is there; else there may have been more rows, or newer ones
    bool forked;       // database and log had gone on apart from each other; the longer one was taken
    char detail[4096]; // one line a row that is lost, cut where it grows too long
} session_rebuilt;
// Make session.db and session.log in the folder `target` from all that those in the folder `path` prove, each by
// itself or both together. `path` is only read. GONIO_E_INPUT where nothing proves itself, as in a session of
// version 1.
gonio_status gonio_session_rebuild(const char *path, const char *target, session_rebuilt *report, gonio_error *error);

// ---- adopt.c ----
// A session of version 1, just opened to be written, becomes one of this version.
gonio_status gonio_session_adopt(gonio_session *session, gonio_error *error);

// ---- session.c, create.c, open.c: a session in pieces ----
gonio_status gonio_session_new(const char *path, gonio_session **out, gonio_error *error); // nothing is open yet
// session->folder_fd is open. GONIO_E_INPUT where frames/ is missing or no folder, GONIO_E_IO where it is unreadable.
gonio_status gonio_session_open_frames(gonio_session *session, gonio_error *error);
gonio_status gonio_session_open_database(gonio_session *session, gonio_error *error);
// How to open. UNPROVEN: whoever looks for what is wrong. JOURNAL: without frames/, and with a log that goes with the
// database although rows are missing.
enum { SESSION_WRITE = 1, SESSION_UNPROVEN = 2, SESSION_JOURNAL = 4 };
// What is opened proves itself, before it is read and before it is added to.
gonio_status gonio_session_prove(gonio_session *session, int how, gonio_error *error);
// Lock the folder against other writers for as long as fd stays open.
gonio_status gonio_session_lock(int fd, const char *path, gonio_error *error);

// The name that a new session.db has until it is whole, before six random letters.
#define SESSION_NEW_JOURNAL "session.db.new"
// SQLite opens files whose whole path, with the 8 bytes of "-journal", has at most 512 bytes. The longest are
// SESSION/session.db.new-XXXXXX and, in a repair, SESSION.repair-XXXXX/session.db, 24 more than the session's. A file's
// name has at most 255 bytes, SESSION.damaged-N too.
enum { SESSION_PATH_BYTES = 480, SESSION_NAME_BYTES = 224 };
// Between a session's name and five digits: the repaired one in the moment in which it takes the name.
#define SESSION_REPAIRED ".repaired-"
// GONIO_E_USAGE where a new session would have a longer path or name, as it is given or with every link followed.
gonio_status gonio_session_check_length(const char *path, gonio_error *error);

// ---- row.c: rows of the journal, read with the types and bounds that they must have ----
// A query's rows. The first value that is not what it must be ends the reading: the error names table, row and column,
// what was found and what was expected. Every later value is then 0, NaN or NULL.
enum { SESSION_KEYS = 2 };
typedef struct session_rows {
    gonio_session *session;
    sqlite3_stmt *statement;
    const char *table;
    int keys; // so many of the first columns tell which row it is; where they are whole numbers, they rise
    bool ordered;
    int64_t n, last[SESSION_KEYS];
    gonio_status status;
    gonio_error *error;
} session_rows;
// Close the rows in every case; binding parameters to rows->statement is between the two.
gonio_status gonio_rows_open(session_rows *rows, gonio_session *session, const char *table, int keys, const char *sql,
                             gonio_error *error);
bool gonio_rows_next(session_rows *rows); // false: no more, or a failure, which gonio_rows_close returns
gonio_status gonio_rows_close(session_rows *rows);
int64_t gonio_row_integer(session_rows *rows, int column, int64_t low, int64_t high);
double gonio_row_real(session_rows *rows, int column, double low, double high);
double gonio_row_real_or(session_rows *rows, int column, double low, double high, double null); // null where it is NULL
const char *gonio_row_text(session_rows *rows, int column, size_t limit);                       // until the next row
const char *gonio_row_sha256(session_rows *rows, int column);                                   // in hexadecimal digits
const unsigned char *gonio_row_blob(session_rows *rows, int column, size_t size);               // of exactly this size
// A value that is of its type and wrong all the same; the format says what was expected.
gonio_status gonio_row_fail(session_rows *rows, int column, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

// ---- guard.c: what a session from elsewhere may not do ----
// Open a plain file of a folder to read: no link, pipe or device, at most `limit` bytes. shown: its path for messages.
gonio_status gonio_session_open_plain(int folder, const char *name, const char *shown, int64_t limit, int *fd,
                                      int64_t *size, gonio_error *error);
// Before SQLite opens the database: its files are plain ones, and none makes SQLite touch files elsewhere.
gonio_status gonio_session_check_database_files(int folder, const char *path, gonio_error *error);
// On a new connection, before anything is read: nothing of the file's own is run, and every query ends. folder: whose
// session.db it is, or is a copy of. The budget lives as long as the connection; each query begins with looks = 0.
void gonio_session_secure(sqlite3 *db, int folder, session_budget *budget);
// The schema holds the tables of the session's version and nothing else.
gonio_status gonio_session_check_schema(gonio_session *session, gonio_error *error);

// ---- settings.c ----
enum { SESSION_EVENT_MAX = 4096 }; // bytes that are shown of an event's text

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
    char name[SESSION_FRAME_NAME], temporary[SESSION_FRAME_NAME + 16];
} session_file;
gonio_status gonio_session_file_write(gonio_session *session, const char *name, const session_png *png,
                                      session_file *file, gonio_error *error);
// fsync, unless the session is not to wait for the disk.
int gonio_session_sync(const gonio_session *session, int fd);
// Sync them all, then give them their names. Where one fails, those without their name are removed; a file that has its
// name and no row in the journal is swept when the session goes on.
// replace: a file that has the name already gives way to the new one, whose pixels are the same; else it is set aside.
gonio_status gonio_session_files_keep(gonio_session *session, session_file *files, int n, bool replace,
                                      gonio_error *error);
typedef struct session_stored {
    char sha256[GONIO_SHA256_HEX]; // of the pixels
    int64_t bytes;                 // of the file
} session_stored;
// The frames of one step as one group.
gonio_status gonio_session_store_frames(gonio_session *session, int64_t step, const gonio_exposure *exposures, int n,
                                        int bits, session_stored *stored, gonio_error *error);

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
// One row of the frames' table, without pixels.
typedef struct session_frame {
    gonio_exposure exposure;
    char file[SESSION_FRAME_NAME], sha256[GONIO_SHA256_HEX];
    int64_t bytes; // of the file; -1: not journalled
} session_frame;
typedef gonio_status (*session_frame_fn)(gonio_session *session, const session_frame *frame, void *context,
                                         gonio_error *error);
// Call for every frame of a step that the journal has, in order; *n of them. The first failure ends it.
gonio_status gonio_session_for_frames(gonio_session *session, int64_t step, session_frame_fn call, void *context,
                                      int *n, gonio_error *error);
// The bytes of a frame's file, at most `limit`; the caller frees png->data.
gonio_status gonio_session_frame_file(gonio_session *session, const char *name, int64_t limit, session_png *png,
                                      gonio_error *error);
// Read one file and verify it; frame's window and stamp are what the journal says.
gonio_status gonio_session_frame_read(gonio_session *session, const char *name, const char *sha256, int bits,
                                      gonio_frame *frame, gonio_error *error);

// ---- read.c ----
// A regular file, whole; no link is followed. shown: its name in errors. GONIO_E_IO where it is there and cannot be
// read after several tries, GONIO_E_INPUT where it is missing or no regular file. The caller frees file->data.
gonio_status gonio_session_file_read(int folder, const char *name, const char *shown, int64_t limit, session_png *file,
                                     gonio_error *error);

// ---- private.c: the journal is read from a copy, so that SQLite leaves no trace beside it ----
// Copy the journal with its WAL into a folder, under the name "session.db"; GONIO_E_IO where it cannot be read, or
// written: *room is false then.
gonio_status gonio_session_copy_journal(int folder_fd, const char *path, int to, bool *room, gonio_error *error);
// Open a session without changing anything at all in its folder. A journal that another process is writing is read
// beside it, as always, and so is one of which there is no room for a copy in TMPDIR. Where frames/ cannot be opened
// frames_fd is -1, and gonio_session_open_frames tells why.
gonio_status gonio_session_open_private(const char *path, gonio_session **out, gonio_error *error);
bool gonio_session_is_being_written(int folder_fd);

// ---- strays.c ----
// What no step owns: ours tells whether Gonio gives such names. Everything else in frames/ is its owner's.
typedef struct session_stray {
    int folder;
    const char *where, *name; // where: "frames/", or "" beside the journal
    bool ours;
} session_stray;
typedef gonio_status (*session_stray_fn)(gonio_session *session, const session_stray *stray, void *context,
                                         gonio_error *error);
gonio_status gonio_session_for_strays(gonio_session *session, session_stray_fn call, void *context, gonio_error *error);

// ---- lost_found.c ----
typedef struct session_lost {
    gonio_session *session;
    int fd, list; // -1: not open
} session_lost;
gonio_status gonio_session_lost_open(gonio_session *session, session_lost *l, gonio_error *error);
// Move one entry of a folder of the session (its own: where "", or frames/: "frames/") into lost+found/, under a name
// that is not taken there, after its line in LIST.
gonio_status gonio_session_lost_put(const session_lost *l, int folder, const char *where, const char *name,
                                    const char *why, gonio_error *error);
// Sync it all, unless status is a failure already, and close.
gonio_status gonio_session_lost_close(session_lost *l, gonio_status status, gonio_error *error);
// The three for one entry.
gonio_status gonio_session_set_aside(gonio_session *session, int folder, const char *where, const char *name,
                                     const char *why, gonio_error *error);

// ---- hash.c: a SHA-256 in pieces; end frees the context ----
gonio_status gonio_session_hash_begin(EVP_MD_CTX **context, gonio_error *error);
void gonio_session_hash_end(EVP_MD_CTX *context, char hex[GONIO_SHA256_HEX]);

// ---- samples.c ----
gonio_status gonio_session_store_samples(gonio_session *session, int64_t step, const gonio_samples *samples,
                                         gonio_error *error);

// ---- complete.c ----
// How many steps of the plan the journal has no row of, and which ("step 7, steps 9 to 12"; "": none).
gonio_status gonio_session_missing_steps(gonio_session *session, int64_t *missing, char *which, size_t size,
                                         gonio_error *error);

// ---- examine.c: what the doctor finds; nothing is changed ----
void gonio_doctor_note(gonio_doctor_report *report, const char *format, ...) __attribute__((format(printf, 2, 3)));
// What a repair has to take out of the journal.
typedef struct session_findings {
    int64_t *undo, *drop; // steps that have bad frames; done steps whose samples are bad
    size_t n_undo, n_drop;
    bool calibration;      // one of undo is no sample step: every step's samples stand on it
    int64_t frames_undone; // of the steps to undo
} session_findings;
void gonio_session_findings_free(session_findings *findings);
// The database's pages, its chain, every row and the log; proof->database and report->database_ok tell.
gonio_status gonio_session_check_journal(gonio_session *session, session_proof *proof, gonio_doctor_report *report,
                                         gonio_error *error);
gonio_status gonio_session_examine(gonio_session *session, session_findings *findings, gonio_doctor_report *report,
                                   gonio_error *error);
// All of it, of a session that nobody has open: what the doctor does without repairing.
gonio_status gonio_session_look(const char *path, gonio_doctor_report *report, gonio_error *error);
// A newer version, a locked or a missing session are answers about the session as a whole, not damage.
bool gonio_session_is_damage(gonio_status status, const gonio_error *why);
// Are there final samples for every step's?
gonio_status gonio_session_is_final(gonio_session *session, bool *final, gonio_error *error);
// Step by step, in their order, each step's set verified and valid during the call: sets of any size in the memory of
// one step's.
typedef gonio_status (*session_set_fn)(void *context, int64_t step, const gonio_samples *set, gonio_error *error);
gonio_status gonio_session_each_set(gonio_session *session, bool final, session_set_fn call, void *context,
                                    gonio_error *error);

// ---- salvage.c ----
// Copy what a damaged database file still gives into a new one, fresh. report takes what could not be read.
gonio_status gonio_session_salvage(const char *damaged, const char *fresh, gonio_doctor_report *report,
                                   gonio_error *error);

// ---- settle.c ----
// Where nothing has this name, and a repair was stopped in the middle of its exchange, finish that. Any path.
void gonio_session_settle(const char *path);

// ---- repair.c ----
gonio_status gonio_session_repair(const char *path, gonio_doctor_report *report, gonio_error *error);

#endif
