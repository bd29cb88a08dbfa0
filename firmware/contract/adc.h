// SPDX-License-Identifier: BSD-3-Clause
// What a board provides to the core: the slow analogue inputs. None blocks for more than 20 us.
#ifndef FW_CONTRACT_ADC_H
#define FW_CONTRACT_ADC_H

#include <stdint.h>

struct fw_core;

// Photodiode, 0..65535 of full scale. Main loop.
uint16_t gonio_fw_board_photodiode(struct fw_core *core);
// Lamp temperature in 0.001 degC; FW_NO_TEMPERATURE: the sensor is broken or unplugged. Main loop.
#define FW_NO_TEMPERATURE INT32_MIN
int32_t gonio_fw_board_temperature(struct fw_core *core);

#endif
