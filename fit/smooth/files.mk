# SPDX-License-Identifier: BSD-3-Clause
# Dense linear algebra is most of a fit's time, and several times that when it is instrumented: the tests' library holds
# it as users get it, and test_matrix links a copy of its own that the sanitizers watch.
smooth-dense := kernels matrix cholesky tridiagonal eigen
$(foreach file,$(smooth-dense),$(eval CFLAGS_$(file) := -O2 $(if $(SANITIZE),-fno-sanitize=all)))
smooth-watched := $(patsubst %,$(B)/fit/smooth/watched/%.o,$(smooth-dense))
$(smooth-watched): $(B)/fit/smooth/watched/%.o: fit/smooth/%.c
	$(call say,CC,$<)
	$(Q)mkdir -p $(@D) && $(CC) $(CPPFLAGS) $(CFLAGS) -MMD -MP -c -o $@ $<
$(B)/tests/unit/test_matrix: $(smooth-watched)
$(B)/tests/unit/test_matrix: override LDFLAGS += $(smooth-watched)
-include $(smooth-watched:.o=.d)
