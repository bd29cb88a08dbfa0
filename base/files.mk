# SPDX-License-Identifier: BSD-3-Clause
# What every floor stands on: status, directions, samples, plans, output. The files of the list are in libgonio-eval.
base-eval := base/version.c base/status.c base/direction.c base/output.c base/number.c base/channel.c
lib-y += $(filter-out $(base-eval),$(call sources,base))
