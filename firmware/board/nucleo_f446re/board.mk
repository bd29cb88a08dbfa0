# SPDX-License-Identifier: BSD-3-Clause
fw-flags-nucleo_f446re  := -mcpu=cortex-m4
fw-speed-nucleo_f446re  := 168 5 16 # RM0090 3.5.1, RM0390 3.4.1, as if without caches
fw-shared-nucleo_f446re := stm32f4
