# SPDX-License-Identifier: BSD-3-Clause
# BRDF files in and out: one file a format.
lib-y += $(call sources,io)
