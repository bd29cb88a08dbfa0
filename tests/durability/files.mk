# SPDX-License-Identifier: BSD-3-Clause
# The durability campaign: a program of its own that drives the built one with a library preloaded.
DURABILITY_BIN  := $(B)/tests/durability/durability
DURABILITY_SHIM := $(B)/tests/durability/shim.so
DURABILITY_OBJS := $(patsubst %,$(B)/tests/durability/%.o,durability campaign run tree look disk cuts damage disturb power situations beside around cost)
DURABILITY_SHIM_OBJS := $(patsubst %,$(B)/tests/durability/%.o,shim trap trap_calls trap_trace timers)
$(DURABILITY_BIN): $(DURABILITY_OBJS)
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $(DURABILITY_OBJS) $(PKG_LIBS)
$(DURABILITY_SHIM): $(DURABILITY_SHIM_OBJS)
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -shared -o $@ $(DURABILITY_SHIM_OBJS) -ldl
-include $(DURABILITY_OBJS:.o=.d) $(DURABILITY_SHIM_OBJS:.o=.d)
test-build: $(DURABILITY_BIN) $(DURABILITY_SHIM)
.PHONY: durability
durability: deps ## kills, power cuts, failing disks and damages against the program, in full; COUNT=n each, SECONDS=s in all, FIRST=seed, ONLY=name,..; SEED=n repeats one
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory program $(DURABILITY_BIN) $(DURABILITY_SHIM)
	$(Q)mkdir -p $(B)/durability
	$(Q)$(DURABILITY_BIN) --program $(B)/gonio --library $(DURABILITY_SHIM) $(if $(ONLY),--only $(ONLY)) \
	    $(if $(SEED),--seed $(SEED),$(if $(COUNT),--count $(COUNT)) $(if $(SECONDS),--seconds $(SECONDS)) $(if $(FIRST),--first $(FIRST)) --report $(B)/durability/report.md)
.PHONY: durability-cost
durability-cost: deps ## what sessions cost a measure of 1.3-megapixel frames, in pairs with sync=off; COUNT=n pairs (3)
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory program $(DURABILITY_BIN) $(DURABILITY_SHIM)
	$(Q)mkdir -p $(B)/durability
	$(Q)$(DURABILITY_BIN) --program $(B)/gonio --library $(DURABILITY_SHIM) --cost $(abspath $(B))/durability $(if $(COUNT),--count $(COUNT))
