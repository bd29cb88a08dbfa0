# The simulated rig.
lib-y += sim/sim.c sim/settings.c sim/sample.c sim/random.c sim/scene.c sim/sensor.c sim/camera.c sim/response.c \
         sim/stage.c sim/lamp.c sim/mount.c sim/fault.c
