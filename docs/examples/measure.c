// SPDX-License-Identifier: BSD-3-Clause
// Measure a sample, on the simulated rig or on the one that an INI file describes (docs/hardware.md), and keep samples
// and model. A session that exists is gone on with, so that Ctrl-C, a fault or a power cut costs one pose.
//
//     cc measure.c $(pkg-config --static --cflags --libs gonio) -o measure
//     ./measure SESSION [RIG.ini]
#include <gonio/gonio.h>
#include <signal.h>
#include <stdio.h>

static volatile sig_atomic_t stop;

static void on_interrupt(int number) {
    (void)number;
    stop = 1;
}

static bool show(void *context, const gonio_measure_progress *now) {
    (void)context;
    fprintf(stderr, "\r%-5s %zu of %zu poses, error %.3g /sr ", now->phase == GONIO_MEASURE_POSES ? "scan" : "fit",
            now->done, now->total, now->error);
    return !stop;
}

static gonio_status mount(void *context, gonio_target target, gonio_error *error) {
    (void)context;
    fprintf(stderr, "\nput the %s on the table, then press Enter ",
            target == GONIO_TARGET_REFERENCE ? "white reference"
            : target == GONIO_TARGET_TRAP    ? "light trap"
                                             : "sample");
    const int answer = getchar();
    return answer != EOF ? GONIO_OK : gonio_fail(error, GONIO_E_INTERRUPTED, "nobody is there");
}

// The sessions here are our own: the devices that they name may be opened.
static bool trust(void *context, const char *devices) {
    (void)context;
    fprintf(stderr, "opening %s\n", devices);
    return true;
}

static gonio_status measure(const char *path, const gonio_rig_file_options *which, gonio_error *error) {
    gonio_rig_file *rig = NULL;
    gonio_session *session = NULL;
    gonio_outcome outcome = {0};
    gonio_measure_options options;
    gonio_measure_options_default(&options);
    options.plan = "nusselt:40";
    options.hooks = (gonio_measure_hooks){.progress = show, .mount = mount};
    gonio_status status;
    if (gonio_session_is(path)) {
        status = gonio_session_open(path, true, &session, error);
        status = status == GONIO_OK ? gonio_rig_file_reopen(session, which, &rig, error) : status;
    } else {
        status = gonio_rig_file_open(which, &rig, error);
        status = status == GONIO_OK ? gonio_measure_begin(path, rig, &options, &session, error) : status;
    }
    if (status == GONIO_OK) {
        status = gonio_measure_run(session, rig, &options, &outcome, error);
    }
    if (status == GONIO_OK) {
        char csv[4096];
        snprintf(csv, sizeof csv, "%s/samples.csv", path);
        status = gonio_write_samples(outcome.samples, csv, error);
        printf("%zu samples in %s\nmodel in %s, held-out rmse %.3g /sr\n", outcome.samples->n, csv, outcome.model_path,
               outcome.fit.held_out.rmse);
    }
    gonio_outcome_free(&outcome);
    gonio_session_close(session);
    gonio_rig_file_close(rig);
    return status;
}

int main(int argc, char **argv) {
    const gonio_rig_file_options simulated = {.sample = "ward:rho_d=0.3,rho_s=0.2,alpha=0.15", .seed = 1};
    const gonio_rig_file_options real = {.path = argc > 2 ? argv[2] : NULL, .trust = trust};
    gonio_error error = {0};
    signal(SIGINT, on_interrupt);
    if (argc < 2 || measure(argv[1], argc > 2 ? &real : &simulated, &error) != GONIO_OK) {
        fprintf(stderr, "\n%s%s%s\n", argc < 2 ? "usage: measure SESSION [RIG.ini]" : error.file,
                error.file[0] != 0 ? ": " : "", error.message);
        return 1;
    }
    return 0;
}
