// SPDX-License-Identifier: BSD-3-Clause
// gonio merge: sessions of one sample on one rig -> one samples file.
#include <stdio.h>
#include <string.h>

#include "gonio/io.h"
#include "host/acquire/merge.h"
#include "host/cli/cli.h"

static int run(int argc, char **argv);
const cli_verb cmd_merge = {"merge", "SESSION SESSION [...] -o CSV",
                            "sessions of one sample on one rig as one samples file, each session's systematic errors "
                            "its own",
                            run};

enum { SESSIONS_MAX = 64 };

static int report(const cli_common *common, const char *output, const gonio_samples *samples, json_t *sessions,
                  const char *hash) {
    if (common->json) {
        return cli_json(json_pack("{s:s,s:I,s:i,s:s,s:O}", "output", output, "samples", (json_int_t)samples->n,
                                  "channels", samples->channels, "samples_sha256", hash, "sessions", sessions));
    }
    size_t i;
    json_t *one;
    json_array_foreach(sessions, i, one) {
        printf("group %zu    %s: %lld samples\n", i + 1, json_string_value(json_object_get(one, "session")),
               (long long)json_integer_value(json_object_get(one, "samples")));
    }
    printf("%s: %zu samples\n", output, samples->n);
    return 0;
}

static int run(int argc, char **argv) {
    const char *output = NULL, *paths[SESSIONS_MAX];
    bool force = false;
    const cli_option options[] = {
        {"output", 'o', CLI_OUTPUT, &output, NULL, "CSV", "the samples file to write"},
        {"force", 0, CLI_FLAG, &force, NULL, NULL,
         "let stated uncertainties and serial numbers differ; rig, camera, sample and calibration never may"},
        {0},
    };
    int n;
    cli_common common;
    if (!cli_parse(&cmd_merge, options, argc, argv, paths, 2, SESSIONS_MAX, &n, &common)) {
        return 2;
    }
    if (output == NULL) {
        return cli_usage(&common, "merge: -o CSV says where the samples go");
    }
    gonio_error error = {.line = -1, .byte = -1};
    gonio_samples *samples = NULL;
    json_t *sessions = NULL;
    char hash[GONIO_SHA256_HEX];
    gonio_status status = gonio_sessions_merge(paths, n, force, &samples, &sessions, &error);
    status = status == GONIO_OK ? gonio_sha256_samples(samples, hash, &error) : status;
    status = status == GONIO_OK ? gonio_write_samples(samples, output, &error) : status;
    const int result =
        status == GONIO_OK ? report(&common, output, samples, sessions, hash) : cli_fail(&common, &error);
    gonio_samples_free(samples);
    json_decref(sessions);
    return result;
}
