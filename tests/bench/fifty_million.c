// SPDX-License-Identifier: BSD-3-Clause
// 50 million samples, streamed: memory predicted before it starts, and measured; time; error at directions not seen.
// An argument sets another number of samples.
#include <sys/resource.h>

#include "base/clock.h"
#include "gonio/fit.h"
#include "tests/simulate.h"

#define LEVEL 6
#define BATCH 100000
#define UNSEEN 20000
#define SPEC "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"

static double peak_bytes(void) {
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (double)usage.ru_maxrss * 1024;
}

static void check(gonio_status status, const gonio_error *error) {
    if (status != GONIO_OK) {
        fprintf(stderr, "%s\n", error->message);
        exit(1);
    }
}

static double add_all(gonio_fit_stream *stream, size_t n) {
    gonio_error error = {0};
    double seconds = 0;
    for (size_t done = 0; done < n; done += BATCH) {
        gonio_samples *part = simulate_samples(SPEC, n - done < BATCH ? n - done : BATCH, 1, 1000 + done);
        const double start = gonio_clock_s();
        check(gonio_fit_stream_add(stream, part, &error), &error);
        seconds += gonio_clock_s() - start;
        gonio_samples_free(part);
    }
    return seconds;
}

int main(int argc, char **argv) {
    const size_t n = argc > 1 ? strtoull(argv[1], NULL, 10) : 50000000;
    gonio_fit_options o;
    gonio_error error = {0};
    gonio_fit_options_default(&o);
    o.method = "mba";
    o.level = LEVEL;
    o.domain = GONIO_LINEAR;
    o.coordinates = GONIO_NUSSELT;
    o.hold_out = 0;
    const gonio_fit_size size = {.samples = n, .channels = 1, .dims = 3, .level = LEVEL};
    const double before = peak_bytes(), predicted = gonio_fit_memory(&size);
    printf("%zu samples, level %d: %.3f GB predicted\n", n, LEVEL, predicted / 1e9);
    check(gonio_fit_check_memory(&size, 0, &error), &error);
    gonio_fit_stream *stream;
    check(gonio_fit_stream_new(1, &(const char[32]){"550nm"}, &o, &stream, &error), &error);
    const double adding = add_all(stream, n);
    gonio_model *model;
    gonio_fit_report report;
    check(gonio_fit_stream_finish(stream, &model, &report, &error), &error);
    printf("added in %.1f s (provisional fits among it), running error %.3g; fitted in %.2f s, %.1f ns a sample and "
           "level\n",
           adding, gonio_fit_stream_error(stream), report.fit_seconds,
           report.fit_seconds * 1e9 / (double)n / (LEVEL + 1));
    printf("peak %.3f GB measured (%.3f GB before), %.3f of the prediction\n", peak_bytes() / 1e9, before / 1e9,
           peak_bytes() / predicted);
    gonio_samples *unseen = simulate_samples(SPEC, UNSEEN, 1, 77);
    gonio_errors errors;
    check(gonio_errors_model(model, unseen, NULL, 0, &errors, &error), &error);
    printf("RMSE at %d unseen directions: %.4g\n", UNSEEN, errors.rmse);
    gonio_samples_free(unseen);
    gonio_model_free(model);
    gonio_fit_stream_free(stream);
    return 0;
}
