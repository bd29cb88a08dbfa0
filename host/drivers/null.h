// Null backends: they answer every operation and touch nothing. A rig of them shows what a plan would do, and a real
// rig that lacks a device takes the null one in its place.
#ifndef GONIO_DRIVERS_NULL_H
#define GONIO_DRIVERS_NULL_H

#include "gonio/rig.h"

// Each makes a device of its own and puts it into the rig, which closes it.
gonio_status gonio_null_stage_open(gonio_rig *rig, gonio_error *error);     // moves take no time
gonio_status gonio_null_lamp_open(gonio_rig *rig, gonio_error *error);      // always warm
gonio_status gonio_null_camera_open(gonio_rig *rig, gonio_error *error);    // 640 x 512, 12 bit, black
gonio_status gonio_null_meter_open(gonio_rig *rig, gonio_error *error);     // reads 1 +- 0.1 %
gonio_status gonio_null_interlock_open(gonio_rig *rig, gonio_error *error); // always closed
gonio_status gonio_null_mount_open(gonio_rig *rig, gonio_error *error);     // changes nothing
// All six.
gonio_status gonio_null_rig_open(gonio_rig *rig, gonio_error *error);

#endif
