# SPDX-License-Identifier: BSD-3-Clause
# Rays, meshes and the preview's pictures.
lib-y  += $(call sources,scene)
pkgs-y += assimp libpng
libs-y += -lembree3
deps-y += libembree-dev libassimp-dev libpng-dev
