// SPDX-License-Identifier: BSD-3-Clause
// libhdf5 has had crashes on damaged files for as long as it exists, and a file's own checksums keep out accidents, not
// intent. So a child reads it: it hands samples on as the CSV that gives the same bits, or makes the session again;
// what kills the child is told.
#include "host/cli/hdf5_input.h"

#include <errno.h>
#include <hdf5.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "gonio/io.h"
#include "host/cli/cli.h"
#include "host/session/hdf5.h"

typedef struct answer {
    gonio_status status;
    gonio_error error;
} answer;

typedef gonio_status hdf5_work(void *context, gonio_error *error);

static void child(hdf5_work *work, void *context, answer *a) {
    setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
    H5dont_atexit(); // what a damaged file leaves in the library makes its own clean-up at the end complain
    a->status = work(context, &a->error);
    fflush(NULL);
    _exit(0);
}

// Until the child has ended; what interrupts this program interrupts it too.
static int wait_for(pid_t pid) {
    int how = 0;
    bool told = false;
    while (waitpid(pid, &how, 0) < 0 && errno == EINTR) {
        if (cli_interrupted() && !told) {
            kill(pid, SIGINT);
            told = true;
        }
    }
    return how;
}

static gonio_status apart(const char *path, hdf5_work *work, void *context, gonio_error *error) {
    answer *a = mmap(NULL, sizeof *a, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (a == MAP_FAILED) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", path);
    }
    *a = (answer){GONIO_E_FAILED, {.line = -1, .byte = -1}};
    fflush(NULL);
    const pid_t pid = fork();
    if (pid == 0) {
        child(work, context, a);
    }
    const int how = pid > 0 ? wait_for(pid) : 0;
    gonio_status status = a->status;
    if (pid < 0) {
        status = gonio_fail(error, GONIO_E_FAILED, "cannot read %s: %s", path, strerror(errno));
    } else if (!WIFEXITED(how) || WEXITSTATUS(how) != 0) {
        status =
            gonio_fail_line(error, GONIO_E_INPUT, path, -1, "libhdf5 did not survive reading it (%s): it is damaged",
                            WIFSIGNALED(how) ? strsignal(WTERMSIG(how)) : "it ended the process");
    } else if (status != GONIO_OK && error != NULL) {
        *error = a->error;
    }
    munmap(a, sizeof *a);
    return status;
}

typedef struct hand_on {
    const char *path, *made;
    int fd;
} hand_on;

static gonio_status read_and_write(void *context, gonio_error *error) {
    const hand_on *h = context;
    gonio_samples *samples;
    gonio_status status = gonio_h5_samples(h->path, h->made, &samples, error);
    FILE *stream = status == GONIO_OK ? fdopen(h->fd, "w") : NULL;
    if (status == GONIO_OK && stream == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory for the samples of %s", h->path);
    }
    status = status == GONIO_OK ? gonio_write_samples_stream(samples, stream, error) : status;
    if (stream != NULL && (fclose(stream) != 0 || status != GONIO_OK)) {
        status =
            status != GONIO_OK ? status : gonio_fail(error, GONIO_E_IO, "cannot hand on the samples of %s", h->path);
    }
    gonio_samples_free(samples);
    return status;
}

static gonio_status read_csv(int fd, gonio_samples **out, gonio_error *error) {
    char name[64];
    snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
    const gonio_read_options options = {.settings = {{"negatives", "keep"}, {"missing", "none"}}};
    return gonio_read(name, &options, out, NULL, error);
}

gonio_status cli_hdf5_read(const char *path, gonio_samples **out, gonio_error *error) {
    char *made;
    *out = NULL;
    hand_on h = {path, NULL, memfd_create("samples", MFD_CLOEXEC)};
    if (h.fd < 0) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to read %s", path);
    }
    gonio_status status = gonio_h5_folder(NULL, &made, error);
    h.made = made;
    status = status == GONIO_OK ? apart(path, read_and_write, &h, error) : status;
    status = gonio_h5_folder_end(NULL, made, status, error);
    status = status == GONIO_OK ? read_csv(h.fd, out, error) : status;
    close(h.fd);
    return status;
}

// ---- the whole session ----

typedef struct fill {
    const char *path, *made;
    gonio_progress_fn progress;
    void *context;
} fill;

static gonio_status fill_folder(void *context, gonio_error *error) {
    const fill *f = context;
    return gonio_h5_fill(f->path, f->made, f->progress, f->context, error);
}

gonio_status cli_hdf5_import(const char *path, const char *session, gonio_progress_fn progress, void *context,
                             gonio_error *error) {
    char *made;
    gonio_status status = gonio_h5_folder(session, &made, error);
    const fill f = {path, made, progress, context};
    status = status == GONIO_OK ? apart(path, fill_folder, (void *)(uintptr_t)&f, error) : status;
    return gonio_h5_folder_end(session, made, status, error);
}
