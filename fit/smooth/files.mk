# SPDX-License-Identifier: BSD-3-Clause
# Dense linear algebra of the penalised least squares.
lib-y  += fit/smooth/kernels.c fit/smooth/matrix.c fit/smooth/cholesky.c fit/smooth/tridiagonal.c fit/smooth/eigen.c
unit-y += tests/unit/test_matrix.c
# Under sanitizers too: at -O1 these loops would be most of the tests' time.
$(foreach file,kernels matrix cholesky tridiagonal eigen,$(eval CFLAGS_$(file) := -O2))
