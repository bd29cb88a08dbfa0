# SPDX-License-Identifier: BSD-3-Clause
# Devices, sessions and the scan loop are part of the library; host/cli is the program.
lib-y  += $(call sources,host/session) $(call sources,host/control) $(call sources,host/acquire) $(call sources,host/drivers) $(call sources,host/transport)
cli-y  += $(call sources,host/cli)
pkgs-y += hdf5 sqlite3 libpng libcrypto libusb-1.0 libgpiod libmodbus jansson inih cairo aravis-0.8
deps-y += build-essential pkg-config libhdf5-dev libsqlite3-dev libpng-dev libssl-dev libusb-1.0-0-dev libgpiod-dev libmodbus-dev libjansson-dev libinih-dev libcairo2-dev libaravis-dev
