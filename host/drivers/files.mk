# One file a device backend; the null ones answer everything and touch nothing.
lib-y += host/drivers/rig.c host/drivers/null_stage.c host/drivers/null_lamp.c host/drivers/null_camera.c
lib-y += host/drivers/null_meter.c host/drivers/null_interlock.c host/drivers/null_mount.c
