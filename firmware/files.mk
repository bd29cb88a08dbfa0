# The controller: its core and the simulated machine are part of the library (sim/ runs them); the boards are programs.
fw-core := clock ramp stepgen axis homing interlock lamp modbus_slave registers parameters core
lib-y   += $(patsubst %,firmware/core/%.c,$(filter-out clock,$(fw-core))) firmware/board/posix/machine.c
unit-y  += $(patsubst %,tests/unit/test_fw_%.c,ramp stepgen axis homing interlock lamp modbus_slave parameters)

all: $(B)/gonio-controller
$(B)/gonio-controller: $(B)/firmware/board/posix/main.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $^
$(B)/firmware/tools/%: $(B)/firmware/tools/%.o
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $^
protocol: $(B)/firmware/tools/protocol ## write docs/protocol.md from firmware/regmap.def
	$(Q)mkdir -p docs && $< > docs/protocol.md
.PHONY: protocol
