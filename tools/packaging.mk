# SPDX-License-Identifier: BSD-3-Clause
# Shared libraries, manual pages, installation, Debian packages.
SOVERSION  := 1
PREFIX     ?= /usr/local
DESTDIR    ?=
BINDIR     ?= $(PREFIX)/bin
LIBDIR     ?= $(PREFIX)/lib
INCLUDEDIR ?= $(PREFIX)/include
DATADIR    ?= $(PREFIX)/share
UDEVDIR    ?= $(PREFIX)/lib/udev/rules.d

# libgonio.so needs libgonio-eval.so and holds nothing of it, so that a process has each table of operations once: models are
# told apart by the address of theirs. (The archive libgonio.a holds libgonio-eval's objects too; a linker takes each once.)
# What libgonio calls beyond the public headers bears the version GONIO_PRIVATE: the two are of one release. Which is which,
# the visibility in the objects tells: default for public functions, protected for libgonio-eval's others.
EVAL_SO := $(B)/libgonio-eval.so.$(SOVERSION)
LIB_SO  := $(B)/libgonio.so.$(SOVERSION)
SHARED  := -shared -Wl,-z,defs -Wl,--as-needed -Wl,-Bsymbolic-functions
.PHONY: shared manual install uninstall deb test-packages
shared: $(EVAL_SO) $(LIB_SO) ## build the shared libraries
$(B)/libgonio-eval.map: $(EVAL_OBJS) $(LISTS)
	$(Q)LC_ALL=C readelf -sW $(EVAL_OBJS) | awk '$$5 == "GLOBAL" && $$6 == "DEFAULT" && $$7 != "UND" { print $$8 ";" }' | sort \
	| { echo "GONIO_$(SOVERSION) { global:"; cat; echo "}; GONIO_PRIVATE { global: gonio_*; local: *; };"; } > $@
$(EVAL_SO): $(B)/libgonio-eval.map
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) $(SHARED) -Wl,-soname,$(@F) -Wl,--version-script=$< -o $@ $(EVAL_OBJS) -lm
	$(Q)ln -sf $(@F) $(@:.$(SOVERSION)=)
$(LIB_SO): $(filter-out $(EVAL_OBJS),$(LIB_OBJS)) $(EVAL_SO) tools/libgonio.map
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) $(SHARED) -Wl,-soname,$(@F) -Wl,--version-script=tools/libgonio.map -o $@ $(filter %.o,$^) $(EVAL_SO) $(PKG_LIBS)
	$(Q)ln -sf $(@F) $(@:.$(SOVERSION)=)

MANUAL := $(B)/manual/gonio.bash
manual: $(MANUAL) ## write the manual pages and the bash completion
$(MANUAL): $(B)/gonio tools/manual.sh NEWS
	$(call say,MAN,$(@D))
	$(Q)tools/manual.sh $< $(VERSION) $(@D)

# $(call put,mode,folder,files): what `install` copies and `uninstall` takes away again.
put = install -d $(DESTDIR)$(2) && install -m $(1) $(3) $(DESTDIR)$(2)
COMPLETIONS := $(DATADIR)/bash-completion/completions
# What static linking needs besides: `pkg-config --static`.
fill-pc = sed -e 's|@PREFIX@|$(PREFIX)|; s|@LIBDIR@|$(LIBDIR)|; s|@INCLUDEDIR@|$(INCLUDEDIR)|; s|@VERSION@|$(VERSION)|' \
    -e 's|@REQUIRES@|$(sort $(pkgs-y))|; s|@LIBS@|$(sort $(libs-y)) -lstdc++ -lm|'
install: all ## under $(DESTDIR)$(PREFIX): program, libraries, headers, manual pages, completion, udev rules
	$(call put,755,$(BINDIR),$(B)/gonio)
	$(call put,644,$(LIBDIR),$(B)/libgonio.a $(B)/libgonio-eval.a $(LIB_SO) $(EVAL_SO))
	ln -sf $(notdir $(LIB_SO)) $(DESTDIR)$(LIBDIR)/libgonio.so
	ln -sf $(notdir $(EVAL_SO)) $(DESTDIR)$(LIBDIR)/libgonio-eval.so
	install -d $(DESTDIR)$(LIBDIR)/pkgconfig
	for pc in gonio gonio-eval; do $(fill-pc) tools/$$pc.pc.in > $(DESTDIR)$(LIBDIR)/pkgconfig/$$pc.pc || exit 1; done
	$(call put,644,$(INCLUDEDIR)/gonio,include/gonio/*.h)
	$(call put,644,$(DATADIR)/man/man1,$(B)/manual/*.1)
	install -d $(DESTDIR)$(COMPLETIONS) && install -m 644 $(MANUAL) $(DESTDIR)$(COMPLETIONS)/gonio
	$(call put,644,$(UDEVDIR),host/transport/60-gonio.rules)
	$(if $(DESTDIR),,-ldconfig)
uninstall: manual ## take away what `make install` with the same variables put there
	rm -f $(DESTDIR)$(BINDIR)/gonio $(DESTDIR)$(COMPLETIONS)/gonio $(DESTDIR)$(UDEVDIR)/60-gonio.rules
	for lib in gonio gonio-eval; do (cd $(DESTDIR)$(LIBDIR) && rm -f lib$$lib.a lib$$lib.so lib$$lib.so.$(SOVERSION) pkgconfig/$$lib.pc); done
	for page in $(B)/manual/*.1; do rm -f $(DESTDIR)$(DATADIR)/man/man1/$${page##*/}; done
	rm -rf $(DESTDIR)$(INCLUDEDIR)/gonio

deb: ## Debian packages under build/packages
	$(Q)tools/deps.sh $(sort $(deps-y)) debhelper lintian
	$(Q)tools/deb.sh $(B)/packages
test-packages: ## install the packages into a fresh Debian and use them there (SKIP without root, network or debootstrap)
	$(Q)tests/packages/run.sh $(B)
