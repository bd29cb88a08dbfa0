# SPDX-License-Identifier: BSD-3-Clause
# Frames -> radiance -> BRDF samples with uncertainty.
lib-y  += $(call sources,calib) calib/opencv.cpp
# OpenCV's pkg-config file is in libopencv-dev, which pulls in every module; these packages hold what is used.
override CXXFLAGS += -isystem /usr/include/opencv4
libs-y += -lopencv_video -lopencv_aruco -lopencv_photo -lopencv_calib3d -lopencv_imgcodecs -lopencv_imgproc -lopencv_core
pkgs-y += cminpack zlib
deps-y += libcminpack-dev zlib1g-dev libopencv-contrib-dev libopencv-photo-dev libopencv-video-dev libopencv-calib3d-dev libopencv-imgcodecs-dev libopencv-imgproc-dev libopencv-core-dev
# Streaming arithmetic over whole frames: worth vectorising.
CFLAGS_radiance := -O3
