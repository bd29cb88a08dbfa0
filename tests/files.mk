# SPDX-License-Identifier: BSD-3-Clause
# Every test program; each runs under sanitizers. Long benchmarks are targets of their own.
unit-y  += $(sort $(wildcard tests/unit/test_*.c tests/property/test_*.c tests/golden/test_*.c tests/conformance/test_*.c))
bench-y += $(filter-out tests/bench/fifty_million.c tests/bench/thesis_tables.c tests/bench/seed_tables.c tests/bench/significance.c,$(sort $(wildcard tests/bench/*.c)))
deps-y  += libcmocka-dev libumockdev-dev umockdev
# Only the test links umockdev, never the program.
CFLAGS_test_usbtmc = $(subst -I,-isystem ,$(shell pkg-config --cflags umockdev-1.0))
$(B)/tests/unit/test_usbtmc: PKG_LIBS += $(shell pkg-config --libs umockdev-1.0)
.PHONY: fifty-million
fifty-million: $(B)/tests/bench/fifty_million ## stream 50 million samples into a fit: memory, time, error
	$(Q)$<
$(B)/tests/bench/fifty_million: $(B)/tests/bench/fifty_million.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< $(B)/libgonio.a $(PKG_LIBS)

.PHONY: cpm-kills
cpm-kills: program ## a map's build killed 20 times ends with the same bytes
	$(Q)KILLS=20 RESOLUTION=64 GONIO=$(abspath $(B)/gonio) sh tests/system/cpm.sh
.PHONY: deps-peers test-peers
deps-peers: ## install independent readers of our files that Debian and npm have: Blender, Chromium, glTF's validator, three.js
	$(Q)tools/peers.sh $(B)
test-peers: ## what independent programs make of our files; whatever is on PATH, in PEERS_DIR or of deps-peers
	$(Q)tests/peers/run.sh $(B)

.PHONY: significance
significance: $(B)/tests/bench/significance ## false alarms and power of `gonio check` on 1,000 simulated materials
	$(Q)$<
$(B)/tests/bench/significance: $(B)/tests/bench/significance.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< $(B)/libgonio.a $(PKG_LIBS)

# Published figures beside ours; the thesis' tables as CSV and its pictures come with them.
.PHONY: seed-tables
seed-tables: $(B)/tests/bench/seed_tables thesis-tables ## docs/seed-tables.md: what the founding texts report, beside ours
	$(Q)$< > $(B)/seed-tables.md && mv $(B)/seed-tables.md docs/seed-tables.md
$(B)/tests/bench/seed_tables: $(B)/tests/bench/seed_tables.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< $(B)/libgonio.a $(PKG_LIBS)

# The thesis' tables and figures; a program of its own, since only it needs cairo.
deps-y += libcairo2-dev
.PHONY: thesis-tables
thesis-tables: $(B)/tests/bench/thesis_tables ## the thesis' tables (CSV) and figures (PNG) under build/thesis
	$(Q)$< $(B)/thesis
$(B)/tests/bench/thesis_tables: tests/bench/thesis_tables.c $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D) && $(CC) $(CPPFLAGS) $(CFLAGS) $(shell pkg-config --cflags cairo) -o $@ $< $(B)/libgonio.a $(PKG_LIBS) $(shell pkg-config --libs cairo) $(LDFLAGS)
