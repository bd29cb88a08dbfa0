# SPDX-License-Identifier: BSD-3-Clause
# The controller: its core and the simulated machine are part of the library (sim/ runs them); the boards are programs.
fw-core := ramp stepgen axis homing interlock lamp modbus_slave registers parameters owner core
lib-y   += $(patsubst %,firmware/core/%.c,$(fw-core)) firmware/board/posix/machine.c

all: $(B)/gonio-controller $(B)/firmware/tools/protocol
$(B)/gonio-controller: $(B)/firmware/board/posix/main.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $^
$(B)/firmware/tools/%: $(B)/firmware/tools/%.o
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $^
protocol: $(B)/firmware/tools/protocol ## write docs/protocol.md from firmware/regmap.def
	$(Q)mkdir -p docs && $< > docs/protocol.md
.PHONY: protocol

# ---- slow checks, by hand ----
firmware-soak: $(B)/tests/property/test_fw_random ## ten million random command sequences, 1e9 steps, 1e8 random bytes
	$(Q)GONIO_FW_SEQUENCES=$${SOAK_SEQUENCES:-10000000} GONIO_FW_STEPS=$${SOAK_STEPS:-1000000000} GONIO_FW_BYTES=$${SOAK_BYTES:-100000000} $<
fw-host-c := $(patsubst %,firmware/core/%.c,$(fw-core)) firmware/board/posix/machine.c
fuzz-firmware: deps ## libFuzzer on the Modbus slave, 10 minutes (FUZZ_SECONDS)
	$(Q)tools/deps.sh clang libclang-rt-14-dev
	$(call say,CC,$(B)/fuzz/fw_modbus_slave)
	$(Q)mkdir -p $(B)/fuzz && clang -std=c17 -g -O1 -I. -fsanitize=fuzzer,address,undefined -o $(B)/fuzz/fw_modbus_slave tests/fuzz/fuzz_fw_modbus_slave.c $(fw-host-c)
	$(Q)$(B)/fuzz/fw_modbus_slave -max_len=300 -max_total_time=$${FUZZ_SECONDS:-600} && echo "ok - fuzzing the slave for $${FUZZ_SECONDS:-600} s"
firmware-coverage: ## branch coverage of firmware/core by its unit and property tests; fails below 95 %
	$(Q)firmware/tools/coverage.sh $(B)/coverage
.PHONY: firmware-soak fuzz-firmware firmware-coverage

# ---- the boards: make firmware ----
deps-y   += gcc-arm-none-eabi qemu-system-arm mbpoll socat python3 python3-pymodbus python3-serial python3-serial-asyncio
ARM      ?= arm-none-eabi-
ARMFLAGS := -mthumb -mfloat-abi=soft -O2 -g -std=c17 -ffreestanding -fno-common -ffunction-sections -fdata-sections \
            -ffp-contract=off $(WARN) -I. -fstack-usage -fcallgraph-info=su
FLASH_LIMIT := 49152
RAM_LIMIT   := 12288
fw-flags-lm3s6965evb := -mcpu=cortex-m3
fw-flags-stm32f405   := -mcpu=cortex-m4
# MHz, flash wait states at that speed, bytes of flash a fetch (LM3S6965 data sheet; RM0090 3.5.1, as if without caches)
fw-speed-lm3s6965evb := 50 0 4
fw-speed-stm32f405   := 168 5 16
fw-core-c := $(patsubst %,firmware/core/%.c,$(fw-core)) firmware/board/cortex_m/cortex_m.c

firmware: $(B)/firmware/lm3s6965evb.elf $(B)/firmware/stm32f405.elf $(B)/firmware/lm3s6965evb-trace.elf ## cross-build the controller; sizes and stack against their limits
.PHONY: firmware

# $(call fw-image,name,board,sources,flags,linker script,check)
define fw-image
fw-objs-$(1) := $(patsubst %.c,$(B)/firmware/$(1)/%.o,$(3))
$$(fw-objs-$(1)): $(B)/firmware/$(1)/%.o: %.c
	$$(call say,ARMCC,$$<)
	$$(Q)mkdir -p $$(@D) && $(ARM)gcc $$(ARMFLAGS) $$(fw-flags-$(2)) $(4) -MMD -MP -c -o $$@ $$<
$(B)/firmware/$(1).elf: $$(fw-objs-$(1)) firmware/board/$(2)/$(5) firmware/board/cortex_m/sections.ld firmware/tools/stack.py firmware/tools/cycles.py
	$$(call say,ARMLD,$$@)
	$$(Q)$(ARM)gcc $$(fw-flags-$(2)) -mthumb -nostdlib -T firmware/board/$(2)/$(5) -Wl,--gc-sections,--fatal-warnings -o $$@ $$(fw-objs-$(1)) -lgcc
	$$(Q)$(ARM)size $$@ > $$(@:.elf=.size)
	$(if $(6),$$(Q)printf '%-12s ' $(1) && python3 firmware/tools/stack.py $$(@:.elf=.size) $(FLASH_LIMIT) $(RAM_LIMIT) $$(fw-objs-$(1):.o=.ci) || { rm -f $$@; exit 1; })
	$(if $(6),$$(Q)$(ARM)objdump -d --no-show-raw-insn $$@ > $$(@:.elf=.lst) && python3 firmware/tools/cycles.py $$(@:.elf=.lst) $$(fw-speed-$(2)) || { rm -f $$@; exit 1; })
-include $$(fw-objs-$(1):.o=.d)
endef
$(eval $(call fw-image,lm3s6965evb,lm3s6965evb,$(fw-core-c) firmware/board/lm3s6965evb/board.c,,link.ld,check))
$(eval $(call fw-image,stm32f405,stm32f405,$(fw-core-c) firmware/board/stm32f405/board.c,,link.ld,check))
$(eval $(call fw-image,lm3s6965evb-trace,lm3s6965evb,$(fw-core-c) firmware/board/lm3s6965evb/board.c firmware/board/lm3s6965evb/trace.c,-DFW_TRACE,trace.ld,))
-include $(B)/firmware/board/posix/main.d $(B)/firmware/tools/protocol.d
