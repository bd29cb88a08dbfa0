# The simulated rig.
lib-y += sim/sim.c sim/settings.c sim/sample.c sim/random.c sim/scene.c sim/sensor.c sim/camera.c sim/response.c \
         sim/stage.c sim/lamp.c sim/mount.c sim/fault.c
bench-y += tests/bench/sim_frame.c
unit-y += tests/unit/test_random.c tests/unit/test_camera.c tests/unit/test_stage.c tests/unit/test_lamp.c tests/unit/test_sim.c
