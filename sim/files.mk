# SPDX-License-Identifier: BSD-3-Clause
# The simulated rig.
lib-y += $(call sources,sim)
