// SPDX-License-Identifier: BSD-3-Clause
// Elementary functions of four or eight doubles at a time, for evaluation: exp, ln, asinh, arctangent, square root.
//
// Why not libm's: they take one number at a time, and glibc picks versions with or without FMA by the processor, which
// differ in the last bit. These consist of additions, multiplications, divisions and square roots alone, which IEEE 754
// rounds in one way only, so every machine and every clone (brdf/spline/clones.h) gives the same bits.
//
// Errors. The series are cut where what is left out lies below 1e-17 of the result (derived at each), so that the
// rounding of the operations, a few units of 2^-53, is all there is: rounded to float, each result is within 0.50001
// units in the last place of the exact one. tests/unit/test_exp_log.c holds them to that over every exponent of float.
#ifndef GONIO_BRDF_EXP_LOG_H
#define GONIO_BRDF_EXP_LOG_H

#include <math.h>
#include <stdint.h>

#include "brdf/spline/clones.h"

typedef int64_t gonio_l4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef uint64_t gonio_w4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef int64_t gonio_l8 __attribute__((vector_size(64), aligned(8), may_alias));
typedef uint64_t gonio_w8 __attribute__((vector_size(64), aligned(8), may_alias));

// Vectors by value have no calling convention on processors without AVX, not even where everything is inlined: so these
// are macros, and the functions below replace what they are given.
#define GONIO_ALL4(x) ((gonio_d4){(x), (x), (x), (x)})
#define GONIO_ALL8(x) ((gonio_d8){(x), (x), (x), (x), (x), (x), (x), (x)})
// mask (of a comparison) ? a : b, lane by lane.
#define GONIO_SELECT4(mask, a, b) ((gonio_d4)(((gonio_l4)(a) & (mask)) | ((gonio_l4)(b) & ~(mask))))
// Of a NaN and a number, the number, where the NaN is a.
#define GONIO_MIN4(a, b) GONIO_SELECT4((a) < (b), a, b)
#define GONIO_MAX4(a, b) GONIO_SELECT4((a) > (b), a, b)

// Code for vectors of any width is a header that is included once for each GONIO_WIDTH; there a name that ends in the
// width is GONIO_LANED(name), and these are the types and macros above.
#define GONIO_JOIN_(name, width) name##width
#define GONIO_JOIN(name, width) GONIO_JOIN_(name, width)
#define GONIO_LANED(name) GONIO_JOIN(name, GONIO_WIDTH)
#define GONIO_D GONIO_LANED(gonio_d)
#define GONIO_L GONIO_LANED(gonio_l)
#define GONIO_W GONIO_LANED(gonio_w)
#define GONIO_ALL(x) GONIO_LANED(GONIO_ALL)(x)
#define GONIO_SELECT(mask, a, b) ((GONIO_D)(((GONIO_L)(a) & (mask)) | ((GONIO_L)(b) & ~(mask))))
#define GONIO_MIN(a, b) GONIO_SELECT((a) < (b), a, b)
#define GONIO_MAX(a, b) GONIO_SELECT((a) > (b), a, b)

// The upper 33 bits of ln 2, whose product with an exponent is exact, and the rest.
#define GONIO_LN2_HIGH 0x1.62e42feep-1
#define GONIO_LN2_LOW 0x1.a39ef35793c76p-33
// Between 2^52 and 2^53 doubles are the integers: adding this rounds, and leaves the integer in the low bits.
#define GONIO_ROUNDER 0x1.8p52

#define GONIO_WIDTH 4
#include "brdf/exp_log_bodies.h"
#undef GONIO_WIDTH
#ifdef GONIO_WIDE
#define GONIO_WIDTH 8
#include "brdf/exp_log_bodies.h"
#undef GONIO_WIDTH
#endif

#endif
