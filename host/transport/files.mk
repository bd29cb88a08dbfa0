# Real devices: bytes in and out (here), and rig.h's operations on top of them (host/drivers).
lib-y  += host/transport/clock.c host/transport/usbtmc.c
lib-y  += host/drivers/meter_usbtmc.c
unit-y += tests/unit/test_usbtmc.c
pkgs-y += libusb-1.0
deps-y += libusb-1.0-0-dev libumockdev-dev umockdev

# Only the test links umockdev, never the program.
CFLAGS_test_usbtmc = $(subst -I,-isystem ,$(shell pkg-config --cflags umockdev-1.0))
$(B)/tests/unit/test_usbtmc: PKG_LIBS += $(shell pkg-config --libs umockdev-1.0)
