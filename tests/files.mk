bench-y += tests/bench/bench_fit.c
unit-y += tests/unit/test_lattice.c tests/unit/test_mba.c
