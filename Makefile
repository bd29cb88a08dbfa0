# SPDX-License-Identifier: BSD-3-Clause
# Gonio. `make help` lists the targets; everything is built under build/.
CC      ?= gcc
CXX     ?= g++
AR      ?= ar
V       ?= 0
JOBS    ?= $(shell nproc)
B       ?= build
# One name for a build folder, however it is given: compilers write down what an object depends on under the name that make used.
override B := $(patsubst $(CURDIR)/%,%,$(abspath $(B)))

ifeq ($(origin CC),default)
CC := gcc
endif
ifeq ($(origin CXX),default)
CXX := g++
endif

# include/gonio/version.h holds the version.
VERSION  := $(shell awk '/define GONIO_VERSION_(MAJOR|MINOR|PATCH) /{v = v s $$3; s = "."} END{print v}' include/gonio/version.h)
# WERROR=1 and CI=true make every warning an error; who merely builds Gonio has newer compilers than we know.
WERROR   ?= $(filter 1 true,$(CI))
WARN     := -Wall -Wextra -Wpedantic -Wconversion $(if $(WERROR),-Werror)
SANITIZE ?=
# CPPFLAGS, CFLAGS, CXXFLAGS and LDFLAGS from outside are added to; where there are none, -O2 -g.
C_OPT    := $(or $(OPT),$(if $(CFLAGS),,-O2 -g))
CXX_OPT  := $(or $(OPT),$(if $(CXXFLAGS),,-O2 -g))
# -fPIC: one set of objects for archives and shared libraries; it costs evaluation nothing (within 1 %), and a renderer's plug-in
# can hold the archive.
override CPPFLAGS += -Iinclude -I. -D_GNU_SOURCE
override CFLAGS   += -std=c17 $(C_OPT) $(WARN) -fPIC -fno-math-errno -ffp-contract=off -pthread $(SANITIZE)
override CXXFLAGS += -std=c++17 $(CXX_OPT) -Wall -Wextra $(if $(WERROR),-Werror) -fPIC -pthread $(SANITIZE)
override LDFLAGS  += -pthread $(SANITIZE)

# Each folder's files.mk says what of it goes where, and adds to: eval-y (libgonio-eval: libc and libm only), lib-y (libgonio), cli-y (the program),
# unit-y (cmocka programs, run under sanitizers), bench-y, pkgs-y (pkg-config
# names), libs-y (libraries without a pkg-config file), deps-y (Debian packages).
$(foreach list,eval lib cli unit bench pkgs libs deps,$(eval $(list)-y :=))
# The C files of a folder and of the folders in it.
sources = $(sort $(wildcard $(1)/*.c $(1)/*/*.c))
LISTS := $(sort $(wildcard */files.mk */*/files.mk))
include $(LISTS)

Q := $(if $(filter 1,$(V)),,@)
say = $(if $(filter 1,$(V)),,@printf '  %-5s %s\n' $(1) $(2))
PKG_CFLAGS = $(shell pkg-config --cflags $(sort $(pkgs-y)))
PKG_LIBS   = $(shell pkg-config --libs $(sort $(pkgs-y))) $(sort $(libs-y)) -lstdc++ -lm

objs = $(addprefix $(B)/,$(addsuffix .o,$(basename $(1))))
EVAL_OBJS := $(call objs,$(eval-y))
LIB_OBJS  := $(EVAL_OBJS) $(call objs,$(lib-y))
CLI_OBJS  := $(call objs,$(cli-y))
UNIT_BINS := $(addprefix $(B)/,$(basename $(unit-y)))
BENCH_BINS := $(addprefix $(B)/,$(basename $(bench-y)))

.PHONY: all program help deps demo test test-slow test-build unit bench asan ubsan tsan clean
.DEFAULT_GOAL := all
.SECONDARY:
.DELETE_ON_ERROR:

all: program shared manual ## build the program, the libraries and the manual pages
program: $(B)/gonio $(B)/libgonio.a $(B)/libgonio-eval.a ## build the program and the static libraries alone

help: ## list the targets
	@grep -hE '^[a-z][a-z -]*:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  %-18s %s\n", $$1, $$2}' | sort

deps: ## install missing Debian packages (sudo where not root)
	$(Q)tools/deps.sh $(sort $(deps-y))

demo: deps ## measure, replay, fit, compare and render a simulated sample
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory all
	$(Q)tools/demo.sh $(B)

test: deps ## set up, build and run every test
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory test-build
	$(Q)tests/run.sh $(B)

# Unit and property tests run under ASan and UBSan; system tests drive the program as users get it.
test-build: all ## build what `make test` runs
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory unit B=$(B)/asan OPT='-O2 -g1' SANITIZE='-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer'
unit: $(UNIT_BINS) ## build the unit, property, golden and conformance tests, without sanitizers

test-slow: deps ## a minute of fuzzing a target and of the durability campaign, the virtual machine and the packages, as CI runs them after the tests
	$(Q)tests/slow.sh $(B)

bench: deps ## speed and accuracy figures, as ratios against references of the same run
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory all bench-build
	$(Q)for b in $(BENCH_BINS); do echo "== $$b"; $$b || exit 1; done
.PHONY: bench-build
bench-build: $(BENCH_BINS) ## build what `make bench` runs

asan: ## build the program and the tests with AddressSanitizer
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory program unit B=$(B)/asan OPT='-O2 -g1' SANITIZE='-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer'
ubsan: ## build with UndefinedBehaviorSanitizer
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory program unit B=$(B)/ubsan OPT='-O1 -g' SANITIZE='-fsanitize=undefined -fno-sanitize-recover=undefined'
tsan: ## build with ThreadSanitizer
	$(Q)$(MAKE) -j$(JOBS) --no-print-directory program unit B=$(B)/tsan OPT='-O1 -g' SANITIZE='-fsanitize=thread'

$(B)/gonio: $(CLI_OBJS) $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $(CLI_OBJS) $(B)/libgonio.a $(PKG_LIBS)
# What the archives hold is a prerequisite too: an object that leaves changes them without being newer.
$(shell mkdir -p $(B) && echo $(LIB_OBJS) | cmp -s - $(B)/objects || echo $(LIB_OBJS) > $(B)/objects)
$(B)/libgonio.a: $(LIB_OBJS) $(B)/objects
$(B)/libgonio-eval.a: $(EVAL_OBJS) $(B)/objects
$(B)/libgonio.a $(B)/libgonio-eval.a:
	$(call say,AR,$@)
	$(Q)rm -f $@ && $(AR) rcs $@ $(filter %.o,$^)
$(UNIT_BINS): $(B)/%: $(B)/%.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< $(B)/libgonio.a $(PKG_LIBS) -lcmocka
$(BENCH_BINS): $(B)/%: $(B)/%.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< $(B)/libgonio.a $(PKG_LIBS)
$(B)/%.o: %.c
	$(call say,CC,$<)
	$(Q)mkdir -p $(@D) && $(CC) $(CPPFLAGS) $(PKG_CFLAGS_ONCE) $(CFLAGS) $(VISIBILITY) $(CFLAGS_$(basename $(notdir $<))) -MMD -MP -c -o $@ $<
$(B)/%.o: %.cpp
	$(call say,CXX,$<)
	$(Q)mkdir -p $(@D) && $(CXX) $(CPPFLAGS) $(PKG_CFLAGS_ONCE) $(CXXFLAGS) $(VISIBILITY) -MMD -MP -c -o $@ $<
# The libraries' objects hide what is not public (include/gonio/export.h, tools/packaging.mk).
$(LIB_OBJS): VISIBILITY := -fvisibility=hidden
$(EVAL_OBJS): VISIBILITY := -fvisibility=protected
# pkg-config once a run, and only when something is compiled.
PKG_CFLAGS_ONCE = $(eval PKG_CFLAGS_ONCE := $(subst -I,-isystem ,$(PKG_CFLAGS)))$(PKG_CFLAGS_ONCE)

clean: ## remove build/
	rm -rf $(B)

include tools/packaging.mk tools/lint.mk

-include $(LIB_OBJS:.o=.d) $(CLI_OBJS:.o=.d) $(UNIT_BINS:=.d) $(BENCH_BINS:=.d) $(B)/firmware/board/posix/main.d
