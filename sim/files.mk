# The simulated rig and the preview renderer.
lib-y += sim/sim.c sim/settings.c sim/sample.c sim/random.c sim/scene.c sim/sensor.c sim/camera.c sim/response.c \
         sim/stage.c sim/lamp.c sim/mount.c sim/fault.c sim/render.c sim/caster.c sim/mesh.c sim/normals.c sim/colour.c
pkgs-y += assimp libpng
libs-y += -lembree3
deps-y += libembree-dev libassimp-dev libpng-dev
bench-y += tests/bench/sim_frame.c
unit-y += tests/unit/test_random.c tests/unit/test_camera.c tests/unit/test_stage.c tests/unit/test_lamp.c tests/unit/test_sim.c
unit-y += tests/unit/test_scene.c tests/unit/test_sensor.c tests/unit/test_colour.c tests/unit/test_mesh.c tests/unit/test_render.c
