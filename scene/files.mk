# SPDX-License-Identifier: BSD-3-Clause
# Rays, meshes, scenes and their pictures.
lib-y  += $(call sources,scene) scene/image_exr.cpp
pkgs-y += assimp libpng OpenEXR
libs-y += -lembree3
deps-y += libembree-dev libassimp-dev libpng-dev libopenexr-dev
