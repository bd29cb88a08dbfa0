# SPDX-License-Identifier: BSD-3-Clause
# Rays, meshes, scenes and their pictures.
lib-y  += $(call sources,scene)
pkgs-y += assimp libpng
libs-y += -lembree3 -lOpenEXRCore -lmeshoptimizer
deps-y += libembree-dev libassimp-dev libpng-dev libopenexr-dev libmeshoptimizer-dev
# Long sums of products: worth vectorising.
CFLAGS_select := -O3
