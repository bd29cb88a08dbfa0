#include "fit/rank.h"

static void swap(double *a, double *b) {
    const double t = *a;
    *a = *b;
    *b = t;
}

static double middle_of(double a, double b, double c) {
    if (a < b) {
        return b < c ? b : a < c ? c : a;
    }
    return a < c ? a : b < c ? c : b;
}

double gonio_rank(double *values, size_t n, size_t k) {
    size_t low = 0, high = n - 1;
    while (low < high) {
        const double pivot = middle_of(values[low], values[low + (high - low) / 2], values[high]);
        size_t i = low, j = high;
        // The indices step in before they can leave [low, high]: the pivot, and then what was swapped, stops each scan.
        for (;;) {
            while (values[i] < pivot) {
                i++;
            }
            while (values[j] > pivot) {
                j--;
            }
            if (i >= j) {
                break;
            }
            swap(&values[i++], &values[j--]);
        }
        // low..i-1 are at most the pivot, j+1..high at least.
        if (i == j) {
            if (k == i) {
                return values[k];
            }
            i++;
            j -= j > low;
        }
        if (k <= j) {
            high = j;
        } else if (k >= i) {
            low = i;
        } else {
            return values[k];
        }
    }
    return values[k];
}
