// SPDX-License-Identifier: BSD-3-Clause
// Simulated views of a chessboard at the level of corners: what gonio_camera_calibrate is given.
#ifndef TESTS_CAMERA_VIEWS_H
#define TESTS_CAMERA_VIEWS_H

#include <math.h>
#include <string.h>

#include "gonio/characterise.h"
#include "tests/pixel.h"

// A normalised point through intrinsics k (fx fy cx cy k1 k2 p1 p2 k3).
static inline void camera_distort(const double k[9], double a, double b, double out[2]) {
    const double r2 = a * a + b * b, d = 1 + r2 * (k[4] + r2 * (k[5] + r2 * k[8]));
    out[0] = k[2] + k[0] * (a * d + 2 * k[6] * a * b + k[7] * (r2 + 2 * a * a));
    out[1] = k[3] + k[1] * (b * d + k[6] * (r2 + 2 * b * b) + 2 * k[7] * a * b);
}

// Rotation by angles about x, then y, then z.
static inline void camera_rotation(double ax, double ay, double az, double r[3][3]) {
    const double ca = cos(ax), sa = sin(ax), cb = cos(ay), sb = sin(ay), cg = cos(az), sg = sin(az);
    const double m[3][3] = {{cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa},
                            {sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa},
                            {-sb, cb * sa, cb * ca}};
    memcpy(r, m, sizeof m);
}

// Corners of a 9 x 6 board, 25 mm, 700 to 1000 mm away, turned anyhow and tilted by up to tilt / 2 about each axis,
// with normal noise. number < 0: near the frame's middle; else every other view stands in one of its four corners,
// partly outside. Corners outside the frame are not seen.
static inline void camera_view(uint64_t *random, const double truth[9], int width, int height, double tilt,
                               double noise_px, int number, gonio_corners *corners) {
    double r[3][3];
    const double z = 700 + 300 * pixel_uniform(random);
    double t[3] = {60 * (pixel_uniform(random) - 0.5), 60 * (pixel_uniform(random) - 0.5), z};
    if (number >= 0 && number % 2 == 0) {
        t[0] += (number / 2 % 2 ? 1 : -1) * 0.3 * width / truth[0] * z;
        t[1] += (number / 4 % 2 ? 1 : -1) * 0.3 * height / truth[1] * z;
    }
    camera_rotation(tilt * (pixel_uniform(random) - 0.5), tilt * (pixel_uniform(random) - 0.5),
                    6.28 * pixel_uniform(random), r);
    corners->n = 0;
    for (int i = 0; i < 54; i++) {
        const double x = 25 * (i % 9) - 100, y = 25 * (i / 9) - 62.5;
        double at[3], *pixel = corners->pixel[corners->n];
        for (int k = 0; k < 3; k++) {
            at[k] = r[k][0] * x + r[k][1] * y + t[k];
        }
        camera_distort(truth, at[0] / at[2], at[1] / at[2], pixel);
        if (number >= 0 && !(pixel[0] > 5 && pixel[1] > 5 && pixel[0] < width - 6 && pixel[1] < height - 6)) {
            continue;
        }
        corners->board[corners->n][0] = x;
        corners->board[corners->n][1] = y;
        pixel[0] += noise_px * pixel_normal(random);
        pixel[1] += noise_px * pixel_normal(random);
        corners->n++;
    }
}

// Solve the n x n system a x = b (rows of n + 1 numbers, b last) by elimination with pivots.
static inline void camera_solve(int n, double a[][16], double *x) {
    for (int k = 0; k < n; k++) {
        int pivot = k;
        for (int i = k; i < n; i++) {
            pivot = fabs(a[i][k]) > fabs(a[pivot][k]) ? i : pivot;
        }
        for (int j = 0; j <= n; j++) {
            const double kept = a[k][j];
            a[k][j] = a[pivot][j];
            a[pivot][j] = kept;
        }
        for (int i = k + 1; i < n; i++) {
            for (int j = n; j >= k; j--) {
                a[i][j] -= a[i][k] / a[k][k] * a[k][j];
            }
        }
    }
    for (int k = n - 1; k >= 0; k--) {
        x[k] = a[k][n];
        for (int j = k + 1; j < n; j++) {
            x[k] -= a[k][j] * x[j];
        }
        x[k] /= a[k][k];
    }
}

// The largest distance (px) over the frame between what the true camera shows of straight lines and what the found one
// takes them for, after the homography that fits best: focal length and principal point are exchangeable with the
// board's pose, and a homography keeps lines straight. A small one is linear in its eight parameters.
static inline double camera_distortion_left(const double truth[9], const double found[9], int width, int height) {
    enum { GRID = 17, N = 8 };
    double normal[N][16] = {{0}}, h[N] = {0}, worst = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; k < GRID * GRID; k++) {
            // The normalised point that the true camera shows at this place of the frame, by fixed-point iteration.
            const double u = (k % GRID) * (width - 1.0) / (GRID - 1), v = (k / GRID) * (height - 1.0) / (GRID - 1);
            double a = (u - truth[2]) / truth[0], b = (v - truth[3]) / truth[1], seen[2];
            for (int i = 0; i < 60; i++) {
                double at[2];
                camera_distort(truth, a, b, at);
                a += (u - at[0]) / truth[0];
                b += (v - at[1]) / truth[1];
            }
            camera_distort(found, a, b, seen);
            const double x = (u - width / 2.0) / width, y = (v - height / 2.0) / width;
            const double rows[2][N] = {{1, x, y, 0, 0, 0, x * x, x * y}, {0, 0, 0, 1, x, y, x * y, y * y}};
            const double d[2] = {seen[0] - u, seen[1] - v};
            double left[2] = {d[0], d[1]};
            for (int c = 0; c < 2; c++) {
                for (int i = 0; i < N; i++) {
                    left[c] -= h[i] * rows[c][i];
                    for (int j = 0; j < N && pass == 0; j++) {
                        normal[i][j] += rows[c][i] * rows[c][j];
                    }
                    normal[i][N] += pass == 0 ? rows[c][i] * d[c] : 0;
                }
            }
            worst = pass == 1 ? fmax(worst, hypot(left[0], left[1])) : 0;
        }
        if (pass == 0) {
            camera_solve(N, normal, h);
        }
    }
    return worst;
}

#endif
