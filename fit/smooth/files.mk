# Dense linear algebra of the penalised least squares.
lib-y  += fit/smooth/kernels.c fit/smooth/matrix.c fit/smooth/cholesky.c fit/smooth/tridiagonal.c fit/smooth/eigen.c
unit-y += tests/unit/test_matrix.c
