# SPDX-License-Identifier: BSD-3-Clause
# Samples -> model.
lib-y  += $(call sources,fit)
pkgs-y += cmph openblas lapacke cminpack
deps-y += libcmph-dev libopenblas-dev liblapacke-dev libcminpack-dev
