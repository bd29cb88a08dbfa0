# Plan -> steps; the scan loop; from stored frames to samples and model again.
lib-y  += host/acquire/steps.c host/acquire/window.c host/acquire/edges.c host/acquire/motion.c host/acquire/describe.c host/acquire/scan.c
lib-y  += host/acquire/expose.c host/acquire/process.c host/acquire/finish.c host/acquire/audit.c
pkgs-y += jansson
unit-y += tests/unit/test_acquire.c
bench-y += tests/bench/acquisition.c
