// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer on the slave: bytes with arbitrary gaps, then the same as one well-formed frame.
#include <stdlib.h>
#include <string.h>

#include "firmware/board/posix/machine.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct machine m;
    uint8_t frame[FW_ADU_MAX];
    gonio_machine_new(&m);
    gonio_machine_start(&m, FW_CAUSE_POWER);
    m.core.known = 15;
    for (size_t i = 0; i + 1 < size && !m.restart && !m.fault; i += 2) {
        gonio_machine_run(&m, (uint64_t)data[i + 1] * 10);
        gonio_fw_modbus_receive(&m.core, data[i], (uint32_t)m.now_us);
    }
    const size_t length = size < FW_ADU_MAX - 3 ? size : FW_ADU_MAX - 3;
    frame[0] = 1;
    memcpy(frame + 1, data, length);
    const uint16_t crc = gonio_fw_modbus_crc(frame, length + 1);
    frame[length + 1] = (uint8_t)crc;
    frame[length + 2] = (uint8_t)(crc >> 8);
    gonio_machine_run(&m, 10000);
    if (!m.restart && !m.fault && !m.bitten)
        gonio_machine_receive(&m, frame, (unsigned)length + 3);
    if (m.wrong_edges != 0)
        abort();
    return 0;
}
