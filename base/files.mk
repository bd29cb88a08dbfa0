# What every floor stands on: status, direction, sample, plan, output.
eval-y += base/status.c base/direction.c base/coordinates.c
lib-y  += base/output.c base/sample.c base/split.c base/text.c base/plan.c
