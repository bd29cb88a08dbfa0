# SPDX-License-Identifier: BSD-3-Clause
# A Raspberry Pi Pico that the tests run the cross-built image on: the processor is Unicorn's, what is around it ours.
deps-y  += libunicorn-dev
PICO_BIN  := $(B)/tests/board/pico
PICO_OBJS := $(patsubst %,$(B)/tests/board/%.o,pico cpu rp2040)
$(PICO_BIN): $(PICO_OBJS)
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $(PICO_OBJS) -lunicorn
-include $(PICO_OBJS:.o=.d)
test-build: $(PICO_BIN)
