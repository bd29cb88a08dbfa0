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
fw-core-c := $(patsubst %,firmware/core/%.c,$(fw-core)) firmware/board/cortex_m/cortex_m.c

# A board is a folder with a board.mk, a link.ld and C files (docs/porting.md). board.mk says, of the board NAME:
#   fw-flags-NAME   the processor
#   fw-speed-NAME   MHz, flash wait states at that speed, bytes a fetch; and m0 for the instruction times of a Cortex-M0+
#   fw-shared-NAME  a folder whose C files it shares with other boards
#   fw-seal-NAME    a command that finishes the linked image $@
#   fw-also-NAME    further files that `make firmware` makes of it, beside NAME.elf and NAME.bin
#   fw-more-NAME    further images of the folder, each with flags of its own, the linker script NAME.ld and no limits
fw-boards := $(patsubst firmware/board/%/board.mk,%,$(wildcard firmware/board/*/board.mk))
include $(fw-boards:%=firmware/board/%/board.mk)

# $(call fw-image,name,board,linker script,check)
define fw-image
fw-objs-$(1) := $(patsubst %.c,$(B)/firmware/$(1)/%.o,$(fw-core-c) $(wildcard firmware/board/$(2)/*.c $(patsubst %,firmware/board/%/*.c,$(fw-shared-$(2)))))
$$(fw-objs-$(1)): $(B)/firmware/$(1)/%.o: %.c firmware/files.mk firmware/board/$(2)/board.mk
	$$(call say,ARMCC,$$@)
	$$(Q)mkdir -p $$(@D) && $(ARM)gcc $$(ARMFLAGS) $$(fw-flags-$(1)) -MMD -MP -c -o $$@ $$<
$(B)/firmware/$(1).elf: $$(fw-objs-$(1)) $(wildcard firmware/board/$(2)/*.ld firmware/board/$(2)/*.py firmware/board/cortex_m/*.ld firmware/tools/*.py)
	$$(call say,ARMLD,$$@)
	$$(Q)$(ARM)gcc $$(fw-flags-$(1)) -mthumb -nostdlib -T firmware/board/$(2)/$(3) -Wl,--gc-sections,--fatal-warnings -o $$@ $$(fw-objs-$(1)) -lgcc
	$(if $(fw-seal-$(2)),$$(Q)$$(fw-seal-$(2)) || { rm -f $$@; exit 1; })
	$$(Q)$(ARM)size $$@ > $$(@:.elf=.size)
	$(if $(4),$$(Q)python3 firmware/tools/stack.py $$(@:.elf=.size) $(FLASH_LIMIT) $(RAM_LIMIT) $$(fw-objs-$(1):.o=.ci) > $$(@:.elf=.fits) || { cat $$(@:.elf=.fits); rm -f $$@; exit 1; })
	$(if $(4),$$(Q)printf '%-13s ' $(1) && cat $$(@:.elf=.fits))
	$(if $(4),$$(Q)$(ARM)objdump -d --no-show-raw-insn $$@ > $$(@:.elf=.lst) && python3 firmware/tools/cycles.py $$(@:.elf=.lst) $$(fw-speed-$(2)) || { rm -f $$@; exit 1; })
firmware: $(B)/firmware/$(1).elf
-include $$(fw-objs-$(1):.o=.d)
endef
define fw-board
$(call fw-image,$(1),$(1),link.ld,check)
$(foreach image,$(fw-more-$(1)),$(call fw-image,$(image),$(1),$(image).ld,)
)
firmware: $(B)/firmware/$(1).bin $(fw-also-$(1))
endef
$(foreach board,$(fw-boards),$(eval $(call fw-board,$(board))))
$(B)/firmware/%.bin: $(B)/firmware/%.elf
	$(call say,BIN,$@)
	$(Q)$(ARM)objcopy -O binary $< $@
firmware: ## cross-build the controller for every board: .elf, .bin (and .uf2); sizes and stack against their limits
.PHONY: firmware
-include $(B)/firmware/board/posix/main.d $(B)/firmware/tools/protocol.d
