# SPDX-License-Identifier: BSD-3-Clause
fw-flags-lm3s6965evb := -mcpu=cortex-m3
fw-speed-lm3s6965evb := 50 0 4 # LM3S6965 data sheet
# The image that tells when its step edges left (trace.h); it has no limits to keep.
fw-more-lm3s6965evb  := lm3s6965evb-trace
fw-flags-lm3s6965evb-trace := $(fw-flags-lm3s6965evb) -DFW_TRACE
