# SPDX-License-Identifier: BSD-3-Clause
fw-flags-stm32f405  := -mcpu=cortex-m4
fw-speed-stm32f405  := 168 5 16 # RM0090 3.5.1, RM0390 3.4.1, as if without caches
fw-shared-stm32f405 := stm32f4
