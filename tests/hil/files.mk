# SPDX-License-Identifier: BSD-3-Clause
# Device tests that need the kernel's simulated devices: programs for the virtual machine of make test-vm.
HIL_BINS := $(addprefix $(B)/tests/hil/,vivid gpio usbtmc usbtmc_gadget loopback chain)
$(HIL_BINS): $(B)/%: $(B)/%.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< $(B)/libgonio.a -Wl,--as-needed $(PKG_LIBS) -lpthread
-include $(HIL_BINS:=.d)
.PHONY: test-vm hil-build
hil-build: $(HIL_BINS) ## build the device tests of the virtual machine
test-vm: deps ## device tests in a virtual machine with the kernel's simulated devices (SKIP without QEMU)
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory all hil-build
	$(Q)tests/hil/run.sh $(B)
