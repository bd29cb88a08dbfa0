# SPDX-License-Identifier: BSD-3-Clause
# The fault campaign: its models stand in for system calls and for libusb, so it is a program of its own.
FAULTS ?= 10000
FAULTS_BIN := $(B)/tests/faults/faults
FAULTS_OBJS := $(patsubst %,$(B)/tests/faults/%.o,faults world clock line disk camera usb host)
$(FAULTS_BIN): $(FAULTS_OBJS) $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -rdynamic -Wl,-z,now -o $@ $(FAULTS_OBJS) $(B)/libgonio.a $(PKG_LIBS)
-include $(FAULTS_OBJS:.o=.d)
test-build: $(FAULTS_BIN)
.PHONY: faults
faults: deps ## FAULTS (10000) measures disturbed by seeded faults; SEED=N repeats one and tells what happens
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory $(FAULTS_BIN)
	$(Q)mkdir -p $(B)/faults
	$(Q)$(FAULTS_BIN) $(if $(SEED),--seed $(SEED),--count $(FAULTS) --report $(B)/faults/report.txt)
