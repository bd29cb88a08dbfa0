# Formats: one file a format.
lib-y  += fit/io/read.c fit/io/sink.c fit/io/samples_csv.c fit/io/cornell.c fit/io/nist.c fit/io/retro.c
lib-y  += fit/io/merl.c fit/io/rgl.c fit/io/of_model.c
unit-y += tests/unit/test_metrics.c tests/unit/test_analytic.c tests/unit/test_plan.c tests/unit/test_samples_csv.c tests/unit/test_check.c tests/golden/test_formats.c
