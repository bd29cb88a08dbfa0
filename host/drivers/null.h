// SPDX-License-Identifier: BSD-3-Clause
// Null backends: they answer every operation and touch nothing. A rig of them shows what a plan would do, and a real
// rig that lacks a device takes the null one in its place.
#ifndef GONIO_DRIVERS_NULL_H
#define GONIO_DRIVERS_NULL_H

#include "gonio/rig.h"

// Every device that has a null driver.
gonio_status gonio_null_rig_open(gonio_rig *rig, gonio_error *error);

#endif
