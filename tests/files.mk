bench-y += tests/bench/bench_fit.c
unit-y += tests/unit/test_lattice.c tests/unit/test_mba.c tests/unit/test_model_file.c tests/unit/test_fit.c tests/unit/test_extremes.c tests/unit/test_cbmba.c
