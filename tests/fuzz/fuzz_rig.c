// SPDX-License-Identifier: BSD-3-Clause
// Any text as a rig file, and any as a setting: refused with a message, or keys that every device took. Nothing is
// opened: the linker puts the functions below in place of those that would (--wrap).
#include <stdlib.h>
#include <string.h>

#include "host/acquire/rig_file.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
gonio_status __wrap_gonio_sim_new(const char *spec, uint64_t seed, gonio_sim **out, gonio_error *error);
gonio_status __real_gonio_sim_new(const char *spec, uint64_t seed, gonio_sim **out, gonio_error *error);
gonio_status __wrap_gonio_sim_open(gonio_sim *sim, int threads, gonio_rig *rig, gonio_error *error);
gonio_status __wrap_gonio_hardware_open(gonio_hardware *hardware, gonio_rig *rig, bool simulated, gonio_error *error);

gonio_status __wrap_gonio_sim_new(const char *spec, uint64_t seed, gonio_sim **out, gonio_error *error) {
    // A measured table: any path would be read.
    return strstr(spec, "file:") == NULL ? __real_gonio_sim_new(spec, seed, out, error)
                                         : gonio_fail(error, GONIO_E_INPUT, "no files here");
}

gonio_status __wrap_gonio_sim_open(gonio_sim *sim, int threads, gonio_rig *rig, gonio_error *error) {
    (void)threads, (void)rig, (void)error;
    free(gonio_sim_settings(sim));
    return GONIO_OK;
}

gonio_status __wrap_gonio_hardware_open(gonio_hardware *hardware, gonio_rig *rig, bool simulated, gonio_error *error) {
    (void)hardware, (void)rig, (void)simulated, (void)error;
    return GONIO_OK;
}

// The first byte: its low bit says whether a sample is given as well, the others how much of the rest is a setting.
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size == 0) {
        return 0;
    }
    const size_t set_n = (data[0] >> 1) % 4 == 0 ? 0 : (size - 1) * (data[0] >> 3) / 64;
    char *set = strndup((const char *)data + 1, set_n);
    gonio_rig_file_options options = {.path = memory_file(data + 1 + set_n, size - 1 - set_n),
                                      .sample = (data[0] & 1) != 0 ? "lambert:rho=0.5" : NULL,
                                      .seed = 1,
                                      .threads = 1};
    const char *const settings[] = {set};
    options.settings = settings;
    options.n_settings = set_n > 0 ? 1 : 0;
    gonio_rig_file *rig;
    gonio_error error = {0};
    if (gonio_rig_file_open(&options, &rig, &error) != GONIO_OK && error.message[0] == 0) {
        abort();
    }
    gonio_rig_file_close(rig);
    free(set);
    return 0;
}
