# The controller: its core and the simulated machine are part of the library (sim/ runs them); the boards are programs.
fw-core := clock ramp stepgen axis homing interlock lamp modbus_slave registers parameters core
lib-y   += $(patsubst %,firmware/core/%.c,$(filter-out clock,$(fw-core))) firmware/board/posix/machine.c
unit-y  += $(patsubst %,tests/unit/test_fw_%.c,ramp stepgen axis homing interlock lamp modbus_slave parameters)
