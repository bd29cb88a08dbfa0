# Loops over the lists: what a list's every member must do.
unit-y += tests/conformance/test_methods.c
