// SPDX-License-Identifier: BSD-3-Clause
// The doctor: look at a session, or make a sound one of what is intact.
#include "host/session/internal.h"

gonio_status gonio_session_doctor(const char *path, bool repair, gonio_doctor_report *report, gonio_error *error) {
    *report = (gonio_doctor_report){0};
    gonio_session_settle(path);
    return repair ? gonio_session_repair(path, report, error) : gonio_session_look(path, report, error);
}
