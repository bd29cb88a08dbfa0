# What every floor stands on: status, direction, sample, plan, output.
eval-y += base/status.c base/direction.c base/coordinates.c base/output.c
lib-y  += base/sample.c base/split.c base/text.c base/plan.c
unit-y += tests/unit/test_status.c tests/unit/test_direction.c tests/unit/test_coordinates.c tests/unit/test_sample.c tests/unit/test_output.c
