# libFuzzer targets for everything that reads what users give; bounded by FUZZ_SECONDS a target.
FUZZ_SECONDS ?= 20
FUZZ_BINS := $(addprefix $(B)/tests/fuzz/fuzz_,read model spec plan)

.PHONY: fuzz fuzz-build
fuzz: deps ## fuzz the readers for FUZZ_SECONDS (20) each, with clang's libFuzzer
	$(Q)tools/deps.sh clang libclang-rt-14-dev libomp-14-dev
	$(Q)$(MAKE) --no-print-directory fuzz-build B=$(B)/fuzz CC=clang CXX=clang++ OPT='-O1 -g' SANITIZE='-DFUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer'
	$(Q)tests/fuzz/run.sh $(B)/fuzz $(FUZZ_SECONDS)
fuzz-build: $(FUZZ_BINS) $(B)/tests/fuzz/make_seeds
$(FUZZ_BINS): $(B)/%: $(B)/%.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -fsanitize=fuzzer -o $@ $< $(B)/libgonio.a $(PKG_LIBS)
$(B)/tests/fuzz/make_seeds: $(B)/tests/fuzz/make_seeds.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< $(B)/libgonio.a $(PKG_LIBS)
-include $(FUZZ_BINS:=.d)
