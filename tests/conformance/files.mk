# Tests that loop over the lists: a thing that joins one is tested by its line.
unit-y += tests/conformance/test_kinds.c
