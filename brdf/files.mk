# SPDX-License-Identifier: BSD-3-Clause
# libgonio-eval: this folder and the files of base/ that it stands on; libc and libm only.
eval-y += $(call sources,brdf) $(base-eval)
