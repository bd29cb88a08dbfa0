# What every floor stands on: status, direction, sample, plan, output.
eval-y += base/status.c base/direction.c base/coordinates.c base/output.c
lib-y  += base/sample.c base/split.c base/text.c base/plan.c
