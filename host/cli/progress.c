// SPDX-License-Identifier: BSD-3-Clause
// Progress lines, the clock and Ctrl-C.
#include "base/clock.h"
#include "host/cli/cli.h"

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

void cli_progress_start(cli_progress *progress, const char *what, double total) {
    const double now = gonio_clock_s();
    *progress = (cli_progress){what, now, now, isatty(STDERR_FILENO) == 1, false, total};
}

void cli_progress_update(cli_progress *progress, double done, const char *detail, double error_now) {
    const double now = gonio_clock_s();
    if (now - progress->last_s < (progress->tty ? 0.1 : 5)) {
        return;
    }
    progress->last_s = now;
    progress->shown = true;
    const double elapsed = now - progress->started_s;
    const double rate = elapsed > 0 ? done / elapsed : 0;
    char rate_text[32] = "", eta[32] = "", error_text[48] = "";
    // Work counted as a fraction of one has no rate that would tell anyone something.
    if (progress->total != 1) {
        snprintf(rate_text, sizeof rate_text, "  %.3g/s", rate);
    }
    if (progress->total > 0 && rate > 0) {
        snprintf(eta, sizeof eta, "  ETA %.0f s", fmax(0, (progress->total - done) / rate));
    }
    if (isfinite(error_now)) {
        snprintf(error_text, sizeof error_text, "  error %.4g", error_now);
    }
    const double percent = progress->total > 0 ? 100 * done / progress->total : 0;
    fprintf(stderr, "%s%s %5.1f %%%s%s%s  %s%s", progress->tty ? "\r\033[K" : "", progress->what, percent, rate_text,
            eta, error_text, detail != NULL ? detail : "", progress->tty ? "" : "\n");
    fflush(stderr);
}

void cli_progress_end(cli_progress *progress) {
    if (progress->tty && progress->shown) {
        fputs("\r\033[K", stderr);
    }
}

static volatile sig_atomic_t stops, insistences;

static void on_signal(int number) {
    stops = 1;
    // A terminal may tell twice that it is gone, and a closed pipe tells at every line; only people insist.
    if ((number == SIGINT || number == SIGTERM) && insistences++ > 0) {
        _exit(4); // what is committed is safe, and the journal never holds half a step
    }
}

void cli_catch_interrupts(void) {
    static const int caught[] = {SIGINT, SIGTERM, SIGHUP, SIGPIPE};
    struct sigaction action = {.sa_handler = on_signal}, before;
    sigemptyset(&action.sa_mask);
    for (size_t i = 0; i < sizeof caught / sizeof *caught; i++) {
        // A shell ignores SIGINT for whom it starts in the background; who asks for it by kill means it all the same.
        if (sigaction(caught[i], NULL, &before) == 0 &&
            (before.sa_handler != SIG_IGN || caught[i] == SIGINT || caught[i] == SIGTERM)) {
            sigaction(caught[i], &action, NULL);
        }
    }
    // A file at its size limit is a full disk like any other: the write fails and says so.
    signal(SIGXFSZ, SIG_IGN);
}

static const gonio_control *steering;

void cli_steered_by(const gonio_control *control) { steering = control; }

bool cli_interrupted(void) { return stops > 0 || gonio_control_stopping(steering); }
