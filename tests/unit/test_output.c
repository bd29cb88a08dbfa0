// SPDX-License-Identifier: BSD-3-Clause
// Files that appear whole or not at all, and what cannot be renamed over.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "gonio/output.h"

static char folder[64];

static int make_folder(void **state) {
    (void)state;
    strcpy(folder, "/tmp/gonio-output-XXXXXX");
    return mkdtemp(folder) == NULL;
}

static int remove_folder(void **state) {
    (void)state;
    char command[100];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

static char *in_folder(const char *name) {
    static char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static int entries(void) {
    char command[100];
    snprintf(command, sizeof command, "ls -A '%s' | wc -l", folder);
    FILE *pipe = popen(command, "r");
    int n = -1;
    assert_int_equal(fscanf(pipe, "%d", &n), 1);
    pclose(pipe);
    return n;
}

static void it_appears_when_committed(void **state) {
    (void)state;
    gonio_output *output;
    const mode_t mask = umask(027);
    assert_int_equal(gonio_output_open(in_folder("a"), &output, NULL), GONIO_OK);
    fputs("text", gonio_output_stream(output));
    assert_int_equal(access(in_folder("a"), F_OK), -1);
    assert_int_equal(gonio_output_commit(output, NULL), GONIO_OK);
    umask(mask);
    struct stat facts;
    assert_int_equal(stat(in_folder("a"), &facts), 0);
    assert_int_equal(facts.st_size, 4);
    assert_int_equal(facts.st_mode & 0777, 0640);
    assert_int_equal(entries(), 1);
}

static void abandoned_it_never_was(void **state) {
    (void)state;
    gonio_output *output;
    assert_int_equal(gonio_output_open(in_folder("a"), &output, NULL), GONIO_OK);
    fputs("another", gonio_output_stream(output));
    gonio_output_abandon(output);
    struct stat facts;
    assert_int_equal(stat(in_folder("a"), &facts), 0);
    assert_int_equal(facts.st_size, 4); // the old file is untouched
    assert_int_equal(entries(), 1);
    gonio_output_abandon(NULL);
}

static void nowhere_to_write(void **state) {
    (void)state;
    gonio_output *output;
    gonio_error error = {0};
    assert_int_equal(gonio_output_open("/nonexistent/x", &output, &error), GONIO_E_IO);
    assert_null(output);
    assert_string_equal(error.file, "/nonexistent/x");
    assert_non_null(strstr(error.message, "No such file"));
    // A folder stands where the file should: the temporary one must not stay behind.
    assert_int_equal(mkdir(in_folder("d"), 0700), 0);
    assert_int_equal(gonio_output_open(in_folder("d"), &output, &error), GONIO_OK);
    assert_int_equal(gonio_output_commit(output, &error), GONIO_E_IO);
    assert_int_equal(rmdir(in_folder("d")), 0);
    assert_int_equal(entries(), 1);
}

static void a_pipe_is_written_directly(void **state) {
    (void)state;
    const char *path = in_folder("pipe");
    assert_int_equal(mkfifo(path, 0600), 0);
    const int fd = open(path, O_RDWR);
    gonio_output *output;
    assert_int_equal(gonio_output_open(path, &output, NULL), GONIO_OK);
    fputs("through", gonio_output_stream(output));
    assert_int_equal(gonio_output_commit(output, NULL), GONIO_OK);
    char text[16] = "";
    assert_int_equal(read(fd, text, 15), 7);
    assert_string_equal(text, "through");
    close(fd);
    struct stat facts;
    assert_int_equal(stat(path, &facts), 0);
    assert_true(S_ISFIFO(facts.st_mode));
    unlink(path);
}

static void a_full_device_is_an_error(void **state) {
    (void)state;
    gonio_output *output;
    gonio_error error = {0};
    assert_int_equal(gonio_output_open("/dev/full", &output, &error), GONIO_OK);
    fputs("lost", gonio_output_stream(output));
    assert_int_equal(gonio_output_commit(output, &error), GONIO_E_IO);
    assert_non_null(strstr(error.message, "No space left"));
    // Written long before the end: the stream remembers that it failed.
    assert_int_equal(gonio_output_open("/dev/full", &output, &error), GONIO_OK);
    fputs("lost", gonio_output_stream(output));
    fflush(gonio_output_stream(output));
    assert_int_equal(gonio_output_commit(output, &error), GONIO_E_IO);
    struct stat facts;
    assert_int_equal(stat("/dev/full", &facts), 0);
    assert_true(S_ISCHR(facts.st_mode));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_appears_when_committed), cmocka_unit_test(abandoned_it_never_was),
        cmocka_unit_test(nowhere_to_write),          cmocka_unit_test(a_pipe_is_written_directly),
        cmocka_unit_test(a_full_device_is_an_error),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
