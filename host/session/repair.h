// SPDX-License-Identifier: BSD-3-Clause
// The parts of a repair.
#ifndef GONIO_SESSION_REPAIR_H
#define GONIO_SESSION_REPAIR_H

#include "host/session/folder.h"
#include "host/session/internal.h"

typedef struct session_repair {
    gonio_doctor_report *report;
    char *path;       // of the session, real
    const char *base; // its name in the folder that it stands in
    int parent, folder;
    struct stat facts;      // of the session's folder
    char name[FOLDER_NAME]; // of the new session beside it; "": there is none that this run has to remove
    char *beside_path;
    int beside;
    gonio_session *session; // the session with the journal that the new one will have
    char *old_path;         // of a folder with a copy of the session's database; NULL: none
    bool journal_kept;      // that journal is the session's own
    session_findings findings;
} session_repair;

// Is there an entry beside the session whose name begins with the prefix?
bool gonio_repair_leftover(const session_repair *r, const char *prefix, char found[FOLDER_NAME]);

// repair_parts.c
// A new folder beside the session, open; -1 with errno. The caller frees *path, which is NULL where there is no memory.
int gonio_repair_make_folder(const session_repair *r, char name[FOLDER_NAME], char **path);
// Make the new session's journal, a copy or of what can be read of the old one, and open r->session on it.
gonio_status gonio_repair_journal(session_repair *r, gonio_error *error);
// Give every other file of the session a second name in the new one.
gonio_status gonio_repair_link_all(session_repair *r, gonio_error *error);
// The new session takes the path; the old one becomes SESSION.damaged-N.
gonio_status gonio_repair_exchange(session_repair *r, gonio_error *error);

#endif
