// SPDX-License-Identifier: BSD-3-Clause
// A session as one HDF5 file, spoiled: the input is a list of bytes to change, or where to cut, in the file of a small
// finished session. Its samples are read, or it is refused with a reason; what was changed inside a block that a
// checksum covers never comes back as another sample.
#include <fcntl.h>
#include <hdf5.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/text.h"
#include "tests/fuzz/memory_file.h"
#include "tests/session_readers.h"

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static char *whole, *spoiled;
static size_t whole_size;
static gonio_samples *truth;

static void require(bool condition) {
    if (!condition) {
        abort();
    }
}

int LLVMFuzzerInitialize(int *argc, char ***argv) {
    (void)argc, (void)argv;
    char root[64], path[96], hdf5[96], command[160];
    gonio_error error = {0};
    gonio_session *session;
    H5dont_atexit();
    snprintf(root, sizeof root, "%s/gonio-fuzz-XXXXXX", access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp");
    require(mkdtemp(root) != NULL);
    snprintf(path, sizeof path, "%s/s", root);
    snprintf(hdf5, sizeof hdf5, "%s/s.h5", root);
    require(make_small_session(path, NULL, &error) == GONIO_OK);
    require(gonio_session_open(path, false, &session, &error) == GONIO_OK);
    require(gonio_session_export(session, hdf5, NULL, NULL, &error) == GONIO_OK);
    gonio_session_close(session);
    require(gonio_file_read(hdf5, 0, &whole, &whole_size, &error) == GONIO_OK);
    require((spoiled = malloc(whole_size)) != NULL);
    require(gonio_session_read_hdf5(hdf5, &truth, &error) == GONIO_OK);
    snprintf(command, sizeof command, "rm -rf %s", root);
    require(system(command) == 0);
    return 0;
}

// Of five bytes each: where (three bytes), what (0: cut here, 1: exclusive or, else: put), the byte.
static size_t spoil(const uint8_t *data, size_t size) {
    size_t end = whole_size;
    memcpy(spoiled, whole, whole_size);
    for (; size >= 5; data += 5, size -= 5) {
        const size_t at = (data[0] | (size_t)data[1] << 8 | (size_t)data[2] << 16) % whole_size;
        if (data[3] == 0) {
            end = at;
        } else {
            spoiled[at] = data[3] == 1 ? (char)(spoiled[at] ^ data[4]) : (char)data[4];
        }
    }
    return end;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    const size_t end = spoil(data, size < 400 ? size : 400);
    const char *path = memory_file((const uint8_t *)spoiled, end);
    gonio_samples *samples;
    gonio_error error = {.line = -1, .byte = -1};
    if (gonio_session_read_hdf5(path, &samples, &error) != GONIO_OK) {
        require(samples == NULL && error.message[0] != 0);
        return 0;
    }
    // The journal proves its rows: what is read at all is what was written.
    require(samples->n == truth->n && samples->channels == truth->channels);
    require(memcmp(samples->values, truth->values, truth->n * (size_t)truth->channels * sizeof(double)) == 0);
    gonio_samples_free(samples);
    return 0;
}
