// SPDX-License-Identifier: BSD-3-Clause
// The verbs, one X(name) each, defined in host/cli/verb/<name>.c as `const cli_verb cmd_<name>`.
#define CLI_VERBS(X)                                                                                                   \
    X(measure)                                                                                                         \
    X(resume)                                                                                                          \
    X(status)                                                                                                          \
    X(pause)                                                                                                           \
    X(stop)                                                                                                            \
    X(replay)                                                                                                          \
    X(info)                                                                                                            \
    X(merge)                                                                                                           \
    X(samples)                                                                                                         \
    X(doctor)                                                                                                          \
    X(plan)                                                                                                            \
    X(rig)                                                                                                             \
    X(drivers)                                                                                                         \
    X(look)                                                                                                            \
    X(fit)                                                                                                             \
    X(learn)                                                                                                           \
    X(eval)                                                                                                            \
    X(compare)                                                                                                         \
    X(tradeoff)                                                                                                        \
    X(convert)                                                                                                         \
    X(bundle)                                                                                                          \
    X(formats)                                                                                                         \
    X(check)                                                                                                           \
    X(calibrate)                                                                                                       \
    X(virtual)                                                                                                         \
    X(render)                                                                                                          \
    X(scene)                                                                                                           \
    X(cpm)                                                                                                             \
    X(kinds)
