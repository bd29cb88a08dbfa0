bench-y += tests/bench/bench_fit.c
unit-y += tests/unit/test_lattice.c tests/unit/test_mba.c tests/unit/test_model_file.c tests/unit/test_fit.c tests/unit/test_extremes.c tests/unit/test_cbmba.c

# The thesis' tables and figures; a program of its own, since only it needs cairo.
deps-y += libcairo2-dev
.PHONY: thesis-tables
thesis-tables: $(B)/tests/bench/thesis_tables ## the thesis' tables (CSV) and figures (PNG) under build/thesis
	$(Q)$< $(B)/thesis
$(B)/tests/bench/thesis_tables: tests/bench/thesis_tables.c $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D) && $(CC) $(CPPFLAGS) $(CFLAGS) $(shell pkg-config --cflags cairo) -o $@ $< $(B)/libgonio.a $(PKG_LIBS) $(shell pkg-config --libs cairo) $(LDFLAGS)
