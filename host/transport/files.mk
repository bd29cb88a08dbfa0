# Real devices: bytes in and out (here), and rig.h's operations on top of them (host/drivers).
lib-y  += host/transport/clock.c host/transport/usbtmc.c
lib-y  += host/transport/tape.c host/transport/v4l2.c host/transport/v4l2_io.c host/transport/gpio.c host/transport/modbus.c
lib-y  += host/drivers/meter_usbtmc.c host/drivers/pixels.c host/drivers/camera_controls.c host/drivers/camera_v4l2.c
lib-y  += host/drivers/debounce.c host/drivers/interlock_gpio.c host/drivers/lamp_gpio.c
lib-y  += host/drivers/controller.c host/drivers/controller_motion.c host/drivers/controller_map.c
lib-y  += host/drivers/stage_modbus.c host/drivers/lamp_modbus.c
lib-y  += host/drivers/shadow.c host/drivers/keep_out.c host/drivers/hardware.c host/drivers/hardware_keys.c
cli-y  += host/cli/rig_actions.c host/cli/rig_burst.c host/cli/rig_reports.c
unit-y += tests/unit/test_usbtmc.c tests/unit/test_pixels.c tests/unit/test_camera_v4l2.c tests/unit/test_interlock_gpio.c tests/unit/test_controller.c tests/unit/test_keep_out.c
pkgs-y += libusb-1.0 libgpiod libmodbus
deps-y += libusb-1.0-0-dev libgpiod-dev libmodbus-dev libumockdev-dev umockdev

# Only the test links umockdev, never the program.
CFLAGS_test_usbtmc = $(subst -I,-isystem ,$(shell pkg-config --cflags umockdev-1.0))
$(B)/tests/unit/test_usbtmc: PKG_LIBS += $(shell pkg-config --libs umockdev-1.0)
