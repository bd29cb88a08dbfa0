# Frames -> radiance -> BRDF samples with uncertainty.
lib-y  += calib/calib.c calib/statistics.c calib/response.c calib/geometry.c calib/alignment.c calib/alignment_file.c calib/merge.c calib/dark.c calib/transfer.c \
          calib/stray.c calib/white.c calib/reflectance.c calib/flat_file.c calib/flat.c calib/bracket.c calib/radiance.c calib/pixel.c calib/uncertainty.c calib/pose.c calib/plate.c calib/edges.c calib/sphere.c calib/budget.c calib/pointing.c calib/blur.c \
          calib/noise.c calib/image.c calib/intrinsics.c calib/motion.c calib/rig_axes.c calib/bundle.c calib/bundle_frames.c calib/bundle_noise.c calib/rig_plan.c calib/highlight.c calib/curve.c calib/emor.c calib/response_fit.c calib/opencv.cpp
unit-y += tests/unit/test_merge.c tests/unit/test_geometry.c tests/unit/test_calib.c tests/unit/test_calib_budget.c tests/unit/test_blur.c tests/unit/test_flat.c tests/unit/test_noise.c tests/unit/test_intrinsics.c tests/unit/test_rig_axes.c tests/unit/test_edges.c tests/unit/test_response_fit.c
bench-y += tests/bench/radiance_speed.c tests/bench/calib_accuracy.c tests/bench/calib_coverage.c tests/bench/merge_bound.c tests/bench/calib_geometry.c
# OpenCV's pkg-config file is in libopencv-dev, which pulls in every module; these packages hold what is used.
CXXFLAGS += -isystem /usr/include/opencv4
libs-y += -lopencv_video -lopencv_aruco -lopencv_photo -lopencv_calib3d -lopencv_imgcodecs -lopencv_imgproc -lopencv_core
pkgs-y += cminpack lapacke zlib
deps-y += libcminpack-dev zlib1g-dev liblapacke-dev libopencv-contrib-dev libopencv-photo-dev libopencv-video-dev libopencv-calib3d-dev libopencv-imgcodecs-dev libopencv-imgproc-dev libopencv-core-dev
# Streaming arithmetic over whole frames: worth vectorising.
CFLAGS_radiance := -O3
