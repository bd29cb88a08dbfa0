# SPDX-License-Identifier: BSD-3-Clause
# BRDF files in and out: one file a format, or a folder.
lib-y  += $(call sources,io)
pkgs-y += libxml-2.0 jansson
deps-y += libxml2-dev libjansson-dev
