// SPDX-License-Identifier: BSD-3-Clause
// A session -> one HDF5 file: NeXus' names for what others look for, and the journal itself, table by table.
#include <fcntl.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "gonio/output.h"
#include "gonio/version.h"
#include "host/session/hdf5.h"

// Members of the JSON settings that have a place among NeXus' names.
static const struct {
    const char *setting, *member, *path, *units;
} places[] = {
    {"facts", "operator_name", "/entry/user/name", NULL},
    {"facts", "sample_id", "/entry/sample/name", NULL},
    {"facts", "notes", "/entry/notes/description", NULL},
    {"facts", "serials", "/entry/instrument/serial_numbers", NULL},
    {"facts", "light_distance_mm", "/entry/instrument/source/distance", "mm"},
    {"camera", "name", "/entry/instrument/camera", NULL},
    {"camera", "serial", "/entry/instrument/camera_serial_number", NULL},
    {"facts", "camera_distance_mm", "/entry/instrument/camera_distance", "mm"},
};

static const struct {
    const char *path, *class;
} groups[] = {{"/entry", "NXentry"},
              {"/entry/user", "NXuser"},
              {"/entry/sample", "NXsample"},
              {"/entry/notes", "NXnote"},
              {"/entry/instrument", "NXinstrument"},
              {"/entry/instrument/source", "NXsource"},
              {"/entry/journal", "NXcollection"},
              {"/entry/files", "NXcollection"}};

static gonio_status put_place(const h5_file *file, gonio_session *session, size_t k, gonio_error *error) {
    char *text;
    if (gonio_session_get(session, places[k].setting, &text, NULL) != GONIO_OK) {
        return GONIO_OK; // a session need not be of a measure
    }
    json_t *object = json_loads(text, 0, NULL);
    const json_t *value = json_object_get(object, places[k].member);
    gonio_status status = GONIO_OK;
    if (json_is_string(value) && json_string_length(value) > 0) {
        status = gonio_h5_text(file, places[k].path, json_string_value(value), error);
    } else if (json_is_number(value)) {
        status = gonio_h5_number(file, places[k].path, json_number_value(value), places[k].units, error);
    }
    json_decref(object);
    free(text);
    return status;
}

// The time of the first or last event.
static gonio_status put_time(const h5_file *file, gonio_session *session, const char *path, const char *order,
                             gonio_error *error) {
    char sql[96];
    sqlite3_stmt *row;
    snprintf(sql, sizeof sql, "SELECT utc FROM events ORDER BY event %s LIMIT 1", order);
    gonio_status status = gonio_session_prepare(session, sql, &row, error);
    if (status == GONIO_OK && sqlite3_step(row) == SQLITE_ROW && sqlite3_column_text(row, 0) != NULL) {
        status = gonio_h5_text(file, path, (const char *)sqlite3_column_text(row, 0), error);
    }
    sqlite3_finalize(row);
    return status;
}

static gonio_status put_root(const h5_file *file, gonio_session *session, gonio_error *error) {
    char now[32];
    int64_t version = 0;
    const time_t seconds = time(NULL);
    struct tm utc;
    strftime(now, sizeof now, "%Y-%m-%dT%H:%M:%SZ", gmtime_r(&seconds, &utc));
    gonio_status status = gonio_session_integer(session, "PRAGMA user_version", &version, error);
    const char *const texts[][2] = {{"NX_class", "NXroot"},
                                    {"default", "entry"},
                                    {"creator", "gonio"},
                                    {"creator_version", GONIO_VERSION},
                                    {"file_time", now}};
    for (size_t k = 0; status == GONIO_OK && k < sizeof texts / sizeof *texts; k++) {
        status = gonio_h5_attribute(file, "/", texts[k][0], texts[k][1], error);
    }
    status =
        status == GONIO_OK ? gonio_h5_attribute_integer(file, "/", "gonio_format", H5_FORMAT_VERSION, error) : status;
    return status == GONIO_OK ? gonio_h5_attribute_integer(file, "/", "gonio_session_version", version, error) : status;
}

static gonio_status put_entry(const h5_file *file, gonio_session *session, gonio_error *error) {
    gonio_status status = put_root(file, session, error);
    for (size_t k = 0; status == GONIO_OK && k < sizeof groups / sizeof *groups; k++) {
        status = gonio_h5_group(file, groups[k].path, groups[k].class, error);
    }
    status = status == GONIO_OK ? gonio_h5_attribute(file, "/entry", "default", "data", error) : status;
    status = status == GONIO_OK ? gonio_h5_text(file, "/entry/program_name", "gonio", error) : status;
    status = status == GONIO_OK ? put_time(file, session, "/entry/start_time", "ASC", error) : status;
    status = status == GONIO_OK ? put_time(file, session, "/entry/end_time", "DESC", error) : status;
    for (size_t k = 0; status == GONIO_OK && k < sizeof places / sizeof *places; k++) {
        status = put_place(file, session, k, error);
    }
    return status;
}

typedef struct both {
    const h5_file *file;
    gonio_session *session;
    char names[1024]; // of the tables so far
} both;

static gonio_status put_one_table(void *context, const char *name, gonio_error *error) {
    both *b = context;
    const size_t used = strlen(b->names);
    snprintf(b->names + used, sizeof b->names - used, "%s%s", used > 0 ? "," : "", name);
    return gonio_h5_put_table(b->file, b->session, name, error);
}

// The model where it still is what was journalled.
static gonio_status put_model(const h5_file *file, gonio_session *session, gonio_error *error) {
    char *path = NULL, *wanted = NULL, sha256[GONIO_SHA256_HEX];
    gonio_status status = GONIO_OK;
    if (gonio_session_model_path(session, &path, NULL) == GONIO_OK &&
        gonio_session_get(session, "result.model_sha256", &wanted, NULL) == GONIO_OK &&
        gonio_sha256_file(path, sha256, NULL) == GONIO_OK && strcmp(wanted, sha256) == 0) {
        status = gonio_h5_put_file(file, AT_FDCWD, path, "model.gonio", -1, error);
    }
    free(path);
    free(wanted);
    return status;
}

const char *const gonio_h5_folder_files[] = {"session.log",   "response.csv", "reference.model", "flat.map",
                                             "library.prior", "scene.needs",  "model.gonio",     NULL};

static gonio_status put_all(const h5_file *file, gonio_session *session, const h5_progress *progress,
                            gonio_error *error) {
    both b = {file, session, ""};
    // Of this state of the database: somebody may be writing, and then the log has more already.
    session_proof proof;
    gonio_status status = gonio_session_verify(session, &proof, error);
    if (status == GONIO_OK && !proof.database) {
        status = gonio_session_vouch(session, &proof, error);
    }
    status = status == GONIO_OK ? put_entry(file, session, error) : status;
    status = status == GONIO_OK ? gonio_h5_for_tables(session, put_one_table, &b, error) : status;
    status = status == GONIO_OK ? gonio_h5_attribute(file, "/entry/journal", "tables", b.names, error) : status;
    for (const char *const *name = gonio_h5_folder_files; status == GONIO_OK && *name != NULL; name++) {
        if (strcmp(*name, "model.gonio") != 0) { // which may be elsewhere
            const bool log = strcmp(*name, "session.log") == 0;
            status = gonio_h5_put_file(file, session->folder_fd, *name, *name, log ? proof.log_size : -1, error);
        }
    }
    status = status == GONIO_OK ? put_model(file, session, error) : status;
    status = status == GONIO_OK ? gonio_h5_put_data(file, session, error) : status;
    return status == GONIO_OK ? gonio_h5_put_frames(file, session, progress, error) : status;
}

gonio_status gonio_session_export(gonio_session *session, const char *path, gonio_progress_fn progress, void *context,
                                  gonio_error *error) {
    gonio_output *output;
    gonio_status status = gonio_output_open(path, &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    if (gonio_output_temporary(output) == NULL) {
        gonio_output_abandon(output);
        return gonio_fail_line(error, GONIO_E_USAGE, path, -1, "HDF5 is written to a file, not to a pipe or device");
    }
    h5_file file;
    // One state of the journal, also while somebody writes it.
    status = gonio_session_exec(session, "BEGIN", error);
    if (status == GONIO_OK) {
        status = gonio_h5_create(gonio_output_temporary(output), path, &file, error);
        status = status == GONIO_OK ? put_all(&file, session, &(h5_progress){progress, context}, error) : status;
        status = gonio_h5_close(&file, status, error);
        gonio_session_exec(session, "ROLLBACK", NULL);
    }
    if (status != GONIO_OK) {
        gonio_output_abandon(output);
        return status;
    }
    return gonio_output_commit(output, error);
}
