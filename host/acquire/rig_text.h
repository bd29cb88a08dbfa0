// SPDX-License-Identifier: BSD-3-Clause
// The texts that a rig is made of: its file, fragments, and the settings over both.
#ifndef GONIO_HOST_ACQUIRE_RIG_TEXT_H
#define GONIO_HOST_ACQUIRE_RIG_TEXT_H

#include "gonio/acquire.h"

// A rig file as a text without zero bytes; the caller frees it.
gonio_status gonio_rig_text_read(const char *path, char **text, gonio_error *error);
// GONIO_E_INPUT for lines that inih would cut. name: of the file, for the error.
gonio_status gonio_rig_text_check(const char *text, const char *name, gonio_error *error);
// The options' settings, a line of section.key=value each, and their fragments, one behind the other; the caller frees.
gonio_status gonio_rig_text_settings(const gonio_rig_file_options *options, char **lines, gonio_error *error);
gonio_status gonio_rig_text_fragments(const gonio_rig_file_options *options, char **text, gonio_error *error);
int gonio_rig_text_lines(const char *text); // 0 of NULL

#endif
