// SPDX-License-Identifier: BSD-3-Clause
#include "base/order_statistic.h"

// The middle one of three as pivot: no random numbers, so the order that is left behind is the same everywhere. The
// indices step in before they can leave [low, high]: the pivot, and then what was swapped, stops each scan. Afterwards
// low..i-1 are at most the pivot, j+1..high at least.
#define ORDER_STATISTIC(name, type)                                                                                    \
    static type middle_##type(type a, type b, type c) {                                                                \
        return a < b ? (b < c ? b : a < c ? c : a) : (a < c ? a : b < c ? c : b);                                      \
    }                                                                                                                  \
    type name(type *values, size_t n, size_t k) {                                                                      \
        if (n == 0) {                                                                                                  \
            return 0;                                                                                                  \
        }                                                                                                              \
        size_t low = 0, high = n - 1;                                                                                  \
        while (low < high) {                                                                                           \
            const type pivot = middle_##type(values[low], values[low + (high - low) / 2], values[high]);               \
            size_t i = low, j = high;                                                                                  \
            for (;;) {                                                                                                 \
                while (values[i] < pivot) {                                                                            \
                    i++;                                                                                               \
                }                                                                                                      \
                while (values[j] > pivot) {                                                                            \
                    j--;                                                                                               \
                }                                                                                                      \
                if (i >= j) {                                                                                          \
                    break;                                                                                             \
                }                                                                                                      \
                const type swapped = values[i];                                                                        \
                values[i++] = values[j];                                                                               \
                values[j--] = swapped;                                                                                 \
            }                                                                                                          \
            if (i == j) {                                                                                              \
                if (k == i) {                                                                                          \
                    return values[k];                                                                                  \
                }                                                                                                      \
                i++;                                                                                                   \
                j -= j > low;                                                                                          \
            }                                                                                                          \
            if (k <= j) {                                                                                              \
                high = j;                                                                                              \
            } else if (k >= i) {                                                                                       \
                low = i;                                                                                               \
            } else {                                                                                                   \
                return values[k];                                                                                      \
            }                                                                                                          \
        }                                                                                                              \
        return values[k];                                                                                              \
    }

ORDER_STATISTIC(gonio_order_statistic, double)
ORDER_STATISTIC(gonio_order_statistic_f32, float)
