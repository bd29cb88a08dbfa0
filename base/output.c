// SPDX-License-Identifier: BSD-3-Clause
#include "gonio/output.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <libgen.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

struct gonio_output {
    FILE *stream;
    char *path;
    char *temporary; // NULL: a pipe or device, written directly
};

static void release(gonio_output *output) {
    free(output->path);
    free(output->temporary);
    free(output);
}

static gonio_status cannot_write(gonio_output *output, gonio_error *error) {
    const gonio_status status =
        gonio_fail_line(error, GONIO_E_IO, output->path, -1, "cannot write it: %s", strerror(errno));
    release(output);
    return status;
}

// A pipe or a terminal cannot be renamed over, and /dev/stdout must not be, though it lead to an ordinary file: what is
// there is written to, after what it already holds.
static bool is_special(const char *path) {
    struct stat facts;
    if (stat(path, &facts) != 0 || S_ISDIR(facts.st_mode)) {
        return false;
    }
    return !S_ISREG(facts.st_mode) || strncmp(path, "/dev/std", 8) == 0 || strncmp(path, "/dev/fd/", 8) == 0 ||
           strncmp(path, "/proc/", 6) == 0;
}

// A new file of a random name beside path; its name goes to temporary. Not mkstemp, whose files are the user's alone:
// results are ordinary files under the umask, which nobody can ask for without changing it for a moment.
static int create_beside(const char *path, char *temporary, size_t size) {
    int fd;
    int tries = 100;
    do {
        uint32_t number;
        if (getrandom(&number, sizeof number, 0) != sizeof number) {
            return -1;
        }
        snprintf(temporary, size, "%s.%06" PRIx32, path, number & 0xffffff);
        fd = open(temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    } while (fd < 0 && errno == EEXIST && --tries > 0);
    return fd;
}

gonio_status gonio_output_open(const char *path, gonio_output **out, gonio_error *error) {
    *out = NULL;
    gonio_output *output = calloc(1, sizeof *output);
    if (output == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to write %s", path);
    }
    const size_t size = strlen(path) + sizeof ".XXXXXX";
    const bool direct = is_special(path);
    output->path = strdup(path);
    output->temporary = direct ? NULL : malloc(size);
    if (output->path == NULL || (!direct && output->temporary == NULL)) {
        release(output);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to write %s", path);
    }
    int fd;
    if (direct) {
        fd = open(path, O_WRONLY | O_APPEND | O_CLOEXEC);
    } else {
        fd = create_beside(path, output->temporary, size);
    }
    if (fd < 0) {
        return cannot_write(output, error);
    }
    output->stream = fdopen(fd, "wb");
    if (output->stream == NULL) {
        close(fd);
        if (!direct) {
            unlink(output->temporary);
        }
        return cannot_write(output, error);
    }
    *out = output;
    return GONIO_OK;
}

FILE *gonio_output_stream(gonio_output *output) { return output->stream; }

const char *gonio_output_temporary(const gonio_output *output) { return output->temporary; }

// The rename is durable only once the folder itself is synced.
static int sync_folder(const char *path) {
    char *copy = strdup(path);
    if (copy == NULL) {
        return -1;
    }
    const int fd = open(dirname(copy), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    free(copy);
    if (fd < 0) {
        return -1;
    }
    const int result = fsync(fd);
    close(fd);
    return result;
}

gonio_status gonio_output_commit(gonio_output *output, gonio_error *error) {
    FILE *stream = output->stream;
    const bool direct = output->temporary == NULL;
    // errno of the first failure is the reason; later calls overwrite it. A pipe cannot be synced.
    errno = 0;
    bool failed = fflush(stream) != 0 || ferror(stream) || (!direct && fsync(fileno(stream)) != 0);
    int why = errno;
    if (fclose(stream) != 0 && !failed) {
        failed = true;
        why = errno;
    }
    if (!failed && !direct && rename(output->temporary, output->path) != 0) {
        failed = true;
        why = errno;
    }
    gonio_status status = GONIO_OK;
    if (failed) {
        if (!direct) {
            unlink(output->temporary);
        }
        status = gonio_fail_line(error, GONIO_E_IO, output->path, -1, "cannot write it: %s",
                                 why != 0 ? strerror(why) : "an earlier write failed");
    } else if (!direct && sync_folder(output->path) != 0) {
        status = gonio_fail_line(error, GONIO_E_IO, output->path, -1, "cannot sync its folder: %s", strerror(errno));
    }
    release(output);
    return status;
}

void gonio_output_abandon(gonio_output *output) {
    if (output == NULL) {
        return;
    }
    fclose(output->stream);
    if (output->temporary != NULL) {
        unlink(output->temporary);
    }
    release(output);
}
