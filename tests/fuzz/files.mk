# SPDX-License-Identifier: BSD-3-Clause
# libFuzzer targets for everything that reads what users give or devices answer; bounded by FUZZ_SECONDS a target.
FUZZ_SECONDS ?= 20
FUZZ_TARGETS ?= read model spec plan rig session hdf5 modbus usbtmc devices
FUZZ_BINS := $(addprefix $(B)/tests/fuzz/fuzz_,read model spec plan rig session hdf5 modbus usbtmc devices)

.PHONY: fuzz fuzz-build
fuzz: deps ## fuzz what is read and answered for FUZZ_SECONDS (20) each, with clang's libFuzzer; FUZZ_TARGETS chooses
	$(Q)tools/deps.sh clang libclang-rt-14-dev
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory fuzz-build B=$(B)/fuzz CC=clang CXX=clang++ OPT='-O1 -g' SANITIZE='-DFUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer'
	$(Q)tests/fuzz/run.sh $(B)/fuzz $(FUZZ_SECONDS) $(FUZZ_TARGETS)
fuzz-build: $(FUZZ_BINS) $(B)/tests/fuzz/make_seeds ## build the fuzz targets (with the flags that `make fuzz` gives)
# Waits and devices are stood in for by functions of the target itself.
comma := ,
wrap = $(addprefix -Wl$(comma)--wrap=,$(1))
$(B)/tests/fuzz/fuzz_modbus: FUZZ_LINK = $(call wrap,gonio_clock_sleep_ms gonio_modbus_drain modbus_set_byte_timeout)
$(B)/tests/fuzz/fuzz_rig: FUZZ_LINK = $(call wrap,gonio_sim_new gonio_sim_open gonio_hardware_open)
$(FUZZ_BINS): $(B)/%: $(B)/%.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CXX) $(LDFLAGS) -fsanitize=fuzzer -o $@ $< $(FUZZ_LINK) $(B)/libgonio.a $(PKG_LIBS)
$(B)/tests/fuzz/make_seeds: $(B)/tests/fuzz/make_seeds.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< $(B)/libgonio.a $(PKG_LIBS)
-include $(FUZZ_BINS:=.d) $(B)/tests/fuzz/make_seeds.d
