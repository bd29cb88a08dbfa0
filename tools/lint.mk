# SPDX-License-Identifier: BSD-3-Clause
# make lint: two compilers' warnings as errors, clang-tidy, cppcheck, and the rules of CONTRIBUTING.md that a script can check.
LINT_SOURCES := $(filter %.c,$(eval-y) $(lib-y) $(cli-y)) firmware/board/posix/main.c
LINT_TESTS   := $(filter %.c,$(unit-y) $(bench-y))
LINT_FLAGS    = $(CPPFLAGS) $(subst -I,-isystem ,$(PKG_CFLAGS) $(shell pkg-config --cflags umockdev-1.0)) -std=c17 $(WARN)
.PHONY: lint
lint: export FLAGS = $(LINT_FLAGS)
lint: deps ## what compilers, clang-tidy, cppcheck and the house's own rules object to
	$(Q)tools/deps.sh clang clang-tidy cppcheck
	$(Q)tools/spdx
	$(Q)tools/lint.sh clang $(LINT_SOURCES) $(LINT_TESTS)
	$(Q)tools/lint.sh cppcheck $(LINT_SOURCES)
	$(Q)tools/lint.sh tidy $(LINT_SOURCES)
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory program unit bench-build B=$(B)/lint WERROR=1
	$(Q)tools/floors $(B)/lint
