# SPDX-License-Identifier: BSD-3-Clause
# Samples -> model.
lib-y  += $(call sources,fit)
pkgs-y += cmph cminpack
deps-y += libcmph-dev libcminpack-dev
