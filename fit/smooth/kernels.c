// SPDX-License-Identifier: BSD-3-Clause
// The inner loops of fit/smooth for each instruction set, and the choice among them (fit/smooth/kernels.h).
#include "fit/smooth/kernels.h"

#include "brdf/spline/clones.h"

#define VECTOR gonio_d2
#define LANES 2
#define TARGET
#define NAME(x) x##_plain
#define NAME_TEXT "plain"
#include "fit/smooth/kernel_bodies.h"

#ifdef __x86_64__
#define VECTOR gonio_d4
#define LANES 4
#define TARGET __attribute__((target("avx2")))
#define NAME(x) x##_avx2
#define NAME_TEXT "avx2"
#include "fit/smooth/kernel_bodies.h"

#define VECTOR gonio_d8
#define LANES 8
#define TARGET __attribute__((target("avx512f")))
#define NAME(x) x##_avx512
#define NAME_TEXT "avx512f"
#include "fit/smooth/kernel_bodies.h"
#endif

const gonio_kernels *const *gonio_kernels_all(size_t *count) {
#ifdef __x86_64__
    static const gonio_kernels *const all[] = {&kernels_plain, &kernels_avx2, &kernels_avx512};
    *count = __builtin_cpu_supports("avx512f") ? 3 : __builtin_cpu_supports("avx2") ? 2 : 1;
#else
    static const gonio_kernels *const all[] = {&kernels_plain};
    *count = 1;
#endif
    return all;
}

const gonio_kernels *gonio_kernels_best(void) {
    size_t count;
    const gonio_kernels *const *all = gonio_kernels_all(&count);
    return all[count - 1];
}
