// SPDX-License-Identifier: BSD-3-Clause
// One binary that is fast on every x86-64 and runs on arm64: a hot function is compiled for several instruction sets
// and the loader picks one. Contraction to FMA is off (Makefile), so every clone computes the same bits.
//
// Vectors are GCC's generic ones: narrower machines split them. The types below may lie at any address that is aligned
// to their element.
#ifndef GONIO_BRDF_SPLINE_CLONES_H
#define GONIO_BRDF_SPLINE_CLONES_H

// Sanitizers instrument before an ifunc may run; other C libraries than glibc have none.
#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define GONIO_NO_CLONES
#endif
#endif
#ifndef GONIO_NO_CLONES
// A clone takes a name that no other file uses: clang 14 makes the resolver of a static function external.
#define GONIO_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#endif
#endif
#ifndef GONIO_CLONES
#define GONIO_CLONES
#endif

// Vectors of eight doubles are fast where they are registers, and in memory elsewhere: what gains from them has a
// second form of its own, taken where GONIO_WIDE holds.
#if defined(__x86_64__) && defined(__gnu_linux__)
#define GONIO_WIDE __builtin_cpu_supports("avx512f")
#define GONIO_WIDE_TARGET __attribute__((target("avx512f")))
#endif

// Unroll the next loop wholly (up to 64 times): its arrays of vectors then live in registers.
#if defined(__clang__)
#define GONIO_UNROLL _Pragma("clang loop unroll(full)")
#else
#define GONIO_UNROLL _Pragma("GCC unroll 64")
#endif

#define GONIO_INLINE static inline __attribute__((always_inline))

typedef float gonio_f4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef float gonio_f16 __attribute__((vector_size(64), aligned(4), may_alias));
typedef double gonio_d2 __attribute__((vector_size(16), aligned(8), may_alias));
typedef double gonio_d4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef double gonio_d8 __attribute__((vector_size(64), aligned(8), may_alias));

#endif
