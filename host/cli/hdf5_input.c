// SPDX-License-Identifier: BSD-3-Clause
// libhdf5 has had crashes on damaged files for as long as it exists, and a file's own checksums keep out accidents, not
// intent. So a child reads it and hands the samples on as the CSV that gives the same bits; what kills the child is
// told.
#include "host/cli/hdf5_input.h"

#include <errno.h>
#include <hdf5.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "gonio/io.h"
#include "gonio/session.h"

typedef struct answer {
    gonio_status status;
    gonio_error error;
} answer;

static gonio_status read_and_write(const char *path, int fd, gonio_error *error) {
    gonio_samples *samples;
    gonio_status status = gonio_session_read_hdf5(path, &samples, error);
    FILE *stream = status == GONIO_OK ? fdopen(fd, "w") : NULL;
    if (status == GONIO_OK && stream == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the samples of %s", path);
    }
    status = status == GONIO_OK ? gonio_write_samples_stream(samples, stream, error) : status;
    if (stream != NULL && (fclose(stream) != 0 || status != GONIO_OK)) {
        status = status != GONIO_OK ? status : gonio_fail(error, GONIO_E_IO, "cannot hand on the samples of %s", path);
    }
    gonio_samples_free(samples);
    return status;
}

static void child(const char *path, int fd, answer *a) {
    setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
    H5dont_atexit(); // what a damaged file leaves in the library makes its own clean-up at the end complain
    a->status = read_and_write(path, fd, &a->error);
    _exit(0);
}

static gonio_status read_csv(int fd, gonio_samples **out, gonio_error *error) {
    char name[64];
    snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
    const gonio_read_options options = {.settings = {{"negatives", "keep"}, {"missing", "none"}}};
    return gonio_read(name, &options, out, NULL, error);
}

gonio_status cli_hdf5_read(const char *path, gonio_samples **out, gonio_error *error) {
    *out = NULL;
    answer *a = mmap(NULL, sizeof *a, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    const int fd = memfd_create("samples", MFD_CLOEXEC);
    if (a == MAP_FAILED || fd < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", path);
    }
    *a = (answer){GONIO_E_FAILED, {.line = -1, .byte = -1}};
    fflush(NULL);
    const pid_t pid = fork();
    int how = 0;
    if (pid == 0) {
        child(path, fd, a);
    }
    while (pid > 0 && waitpid(pid, &how, 0) < 0 && errno == EINTR) {
    }
    gonio_status status;
    if (pid < 0) {
        status = gonio_fail(error, GONIO_E_FAILED, "cannot read %s: %s", path, strerror(errno));
    } else if (!WIFEXITED(how) || WEXITSTATUS(how) != 0) {
        status =
            gonio_fail_line(error, GONIO_E_INPUT, path, -1, "libhdf5 did not survive reading it (%s): it is damaged",
                            WIFSIGNALED(how) ? strsignal(WTERMSIG(how)) : "it ended the process");
    } else if (a->status != GONIO_OK) {
        status = a->status;
        if (error != NULL) {
            *error = a->error;
        }
    } else {
        status = read_csv(fd, out, error);
    }
    close(fd);
    munmap(a, sizeof *a);
    return status;
}
