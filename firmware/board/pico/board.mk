# SPDX-License-Identifier: BSD-3-Clause
# Page 0 is the boot ROM: an address there is no mistake.
fw-flags-pico := -mcpu=cortex-m0plus --param=min-pagesize=0
fw-speed-pico := 125 0 4 m0 # it runs from memory
fw-also-pico  := $(B)/firmware/pico.uf2
# The checksum behind the second stage, which the boot ROM asks for.
fw-seal-pico   = $(ARM)objcopy -O binary -j .boot2 $@ $@.boot2 && python3 firmware/board/pico/image.py crc $@.boot2 $@.crc \
    && $(ARM)objcopy --update-section .boot2_crc=$@.crc $@
$(B)/firmware/%.uf2: $(B)/firmware/%.bin
	$(call say,UF2,$@)
	$(Q)python3 firmware/board/pico/image.py uf2 $< $@
