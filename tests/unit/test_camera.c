// SPDX-License-Identifier: BSD-3-Clause
// The simulated camera: radiometry against closed forms written here anew, noise by its moments, formats, windows,
// determinism.
//
// Statistics: seeds are fixed; bounds are 5 standard errors (6e-7 each for a fresh seed), fewer than 100 of them.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "tests/unit/near.h"
#include "tests/unit/sim_rig.h"

// Electrons of a word at 12 bit and the default well.
static double electrons(double word) { return (word - 64) / (4095 - 64) * 10000; }

// What a Lambert plate of reflectance rho sends to the pixel, of a perfect diffuser at the centre: the camera looks
// straight down at phi = 0, so that columns run along +y and rows along +x, 0.1 mm a pixel.
static double lambert_plate(double rho, double u, double v, double theta, double d0) {
    const double x = 0.1 * v, y = 0.1 * u;
    const double dx = d0 * sin(theta) - x, dz = d0 * cos(theta), d2 = dx * dx + y * y + dz * dz;
    return rho * dz / sqrt(d2) * d0 * d0 / d2;
}

// The mean signal of blocks of the frame equals the closed form within 5 sigma of its shot noise, with a near light, so
// that cosine and inverse square both matter.
static void lambert_closure(void **state) {
    (void)state;
    const char *const extra[] = {"rig.light_distance_mm=120", "camera.width=64",          "camera.height=64",
                                 "camera.fx_px=10000",        "camera.full_well_e=10000", NULL};
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 5, 1, sim_perfect, extra);
    const double thetas[] = {0, 40, 80};
    for (int k = 0; k < 3; k++) {
        const gonio_stamp stamp = sim_rig_move(&r, k, thetas[k], 0, 0, 0);
        uint16_t *pixels = sim_rig_capture(&r, sim_rig_full(&r), 0.02, stamp);
        for (int block = 0; block < 4; block++) {
            double measured = 0, expected = 0;
            for (int v = 16 * block; v < 16 * block + 16; v++) {
                for (int u = 0; u < 64; u++) {
                    measured += electrons(pixels[v * 64 + u]);
                    expected += 500000 * 0.02 * lambert_plate(0.5, u - 31.5, v - 31.5, gonio_radians(thetas[k]), 120);
                }
            }
            assert_near(measured, expected, 5 * sqrt(expected + 1024 * 0.52)); // 0.52: rounding to 2.5 electrons
        }
        free(pixels);
    }
    sim_rig_close(&r);
}

// A Lambert sphere seen and lit from far away at phase angle alpha sends 2/3 rho r^2 (sin a + (pi - a) cos a) / pi x pi
// of a normally lit white disc's radiance: Lambert's phase law (1760).
static void lambert_sphere_phase_law(void **state) {
    (void)state;
    const char *const extra[] = {"rig.light_distance_mm=100000",
                                 "rig.camera_distance_mm=100000",
                                 "camera.width=128",
                                 "camera.height=128",
                                 "camera.fx_px=250000",
                                 NULL};
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.6,shape=sphere,radius_mm=20", 9, 2, sim_perfect, extra);
    assert_true(r.rig.facts.sphere);
    const double radius_px = 50;
    const double alphas[] = {0, 30, 75, 120};
    for (int k = 0; k < 4; k++) {
        // A plane through the normal: light and camera on either side of it.
        const double a = gonio_radians(alphas[k]);
        const gonio_stamp stamp = sim_rig_move(&r, k, alphas[k] / 2, 0, alphas[k] / 2, 180);
        uint16_t *pixels = sim_rig_capture(&r, sim_rig_full(&r), 0.01, stamp);
        double sum = 0;
        for (int i = 0; i < 128 * 128; i++) {
            sum += electrons(pixels[i]);
        }
        free(pixels);
        const double law = 2.0 / 3 * radius_px * radius_px * (sin(a) + (GONIO_PI - a) * cos(a));
        const double expected = 500000 * 0.01 * 0.6 * law;
        // 5 sigma of shot noise, and 0.1 % for the pixels that the limb cuts.
        assert_near(sum, expected, 5 * sqrt(expected + 16384 * 0.52) + 1e-3 * expected);
    }
    sim_rig_close(&r);
}

// Project a point by rig.h's formulas, undistorted.
static void project(const gonio_camera_info *c, double theta, double phi, double d, const double p[3], double uv[2]) {
    const double R[3] = {-sin(phi), cos(phi), 0}, U[3] = {-cos(theta) * cos(phi), -cos(theta) * sin(phi), sin(theta)};
    const double w[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
    double x = 0, y = 0, z = 0;
    for (int k = 0; k < 3; k++) {
        const double q = p[k] - d * w[k];
        x += R[k] * q;
        y -= U[k] * q;
        z -= w[k] * q;
    }
    x /= z;
    y /= z;
    const double r2 = x * x + y * y, radial = 1 + c->k1 * r2 + c->k2 * r2 * r2 + c->k3 * r2 * r2 * r2;
    uv[0] = c->fx * (x * radial + 2 * c->p1 * x * y + c->p2 * (r2 + 2 * x * x)) + c->cx;
    uv[1] = c->fy * (y * radial + c->p1 * (r2 + 2 * y * y) + 2 * c->p2 * x * y) + c->cy;
}

// Points of the plate project where rig.h says: walk along its edge; 1 mm inside the image is bright, 1 mm outside
// black.
static void plate_edge_is_where_projected(void **state) {
    (void)state;
    const char *const extra[] = {"camera.k1=-3",      "camera.k2=40",       "camera.p1=0.01",
                                 "camera.p2=-0.02",   "camera.cx_px=300",   "camera.cy_px=260",
                                 "camera.fy_px=9800", "sample.plate_mm=30", NULL};
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 5, 2, sim_perfect, extra);
    const double poses[3][2] = {{0, 30}, {50, -70}, {75, 160}};
    for (int k = 0; k < 3; k++) {
        const gonio_stamp stamp = sim_rig_move(&r, k, 10, 0, poses[k][0], poses[k][1]);
        uint16_t *pixels = sim_rig_capture(&r, sim_rig_full(&r), 0.02, stamp);
        for (int i = 0; i < 240; i++) {
            const double along = (i % 60 - 29.5) / 30 * 15;
            for (int out = 0; out < 2; out++) {
                const double across = out ? 16 : 14, sign = i / 60 % 2 ? -1 : 1;
                const double p[3] = {i < 120 ? sign * across : along, i < 120 ? along : sign * across, 0};
                double uv[2];
                project(&r.info, gonio_radians(poses[k][0]), gonio_radians(poses[k][1]), 1000, p, uv);
                const long u = lround(uv[0]), v = lround(uv[1]);
                if (u >= 0 && v >= 0 && u < r.info.width && v < r.info.height && fabs(along) < 13.5) {
                    assert_int_equal(pixels[v * r.info.width + u] > 1000, !out);
                }
            }
        }
        free(pixels);
    }
    sim_rig_close(&r);
}

// Photon transfer: over a grey plate the variance of the difference of two frames grows with the mean by the gain, from
// the read noise up; fixed patterns drop out.
static void photon_transfer(void **state) {
    (void)state;
    const char *const extra[] = {"camera.bits=16",
                                 "camera.width=256",
                                 "camera.height=256",
                                 "camera.prnu_percent=1",
                                 "camera.read_noise_e=5",
                                 "camera.offset_nonuniformity_e=2",
                                 NULL};
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 21, 2, sim_perfect, extra);
    gonio_stamp stamp = sim_rig_move(&r, 1, 0, 0, 0, 0);
    const double exposures[] = {2e-5, 4e-4, 0.004, 0.03}, n = 256 * 256, scale = 10000.0 / (65535 - 1024);
    for (int k = 0; k < 4; k++) {
        uint16_t *frames[2];
        for (int f = 0; f < 2; f++) {
            stamp.frame = 2 * k + f;
            frames[f] = sim_rig_capture(&r, sim_rig_full(&r), exposures[k], stamp);
        }
        double mean = 0, square = 0;
        for (int i = 0; i < 256 * 256; i++) {
            const double d = scale * (frames[0][i] - frames[1][i]);
            mean += scale * (frames[0][i] + frames[1][i] - 2048) / 2 / n;
            square += d * d / 2 / n;
        }
        const double variance = mean + 25 + scale * scale / 12;
        assert_near(mean, 250000 * exposures[k], 0.01 * 250000 * exposures[k] + 0.2);
        assert_near(square, variance, 5 * variance * sqrt(2 / n) * 1.05); // 1.05: the kurtosis at few electrons
        free(frames[0]);
        free(frames[1]);
    }
    sim_rig_close(&r);
}

// Defaults: dark frames show black level + dark current; the share of hot pixels and PRNU are as stated.
static void default_noise_is_as_stated(void **state) {
    (void)state;
    const char *const still[] = {"camera.hot_pixel_percent=1", NULL};
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 8, 2, still, NULL);
    gonio_stamp stamp = sim_rig_move(&r, 1, 0, 0, 0, 0);
    assert_int_equal(r.rig.lamp->set_shutter(r.rig.lamp_device, false, NULL), GONIO_OK);
    uint16_t *dark = sim_rig_capture(&r, sim_rig_full(&r), 10, stamp);
    const double n = 640 * 512;
    double cold = 0, cold_n = 0, hot = 0;
    for (int i = 0; i < 640 * 512; i++) {
        const double e = electrons(dark[i]);
        if (e > 800) { // a hot pixel holds 5000 to 50000
            hot++;
        } else {
            cold += e;
            cold_n++;
        }
    }
    // 5 e-/s x 10 s, noise sqrt(50 + 25 + 25 nonuniformity + 1 + rounding).
    assert_near(cold / cold_n, 50, 5 * sqrt(102 / n));
    assert_near(hot / n, 0.01, 5 * sqrt(0.01 * 0.99 / n));
    free(dark);
    sim_rig_close(&r);
}

static void prnu_and_vignetting(void **state) {
    (void)state;
    const char *const extra[] = {"camera.prnu_percent=2",
                                 "camera.vignetting_percent=20",
                                 "camera.bits=16",
                                 "camera.full_well_e=1e7",
                                 "sample.plate_mm=100",
                                 "rig.light_distance_mm=100000",
                                 NULL};
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 8, 2, sim_perfect, extra);
    const gonio_stamp stamp = sim_rig_move(&r, 1, 0, 0, 0, 0);
    uint16_t *pixels = sim_rig_capture(&r, sim_rig_full(&r), 20, stamp);
    // Corner and centre patches of 32 x 32: 20 % apart, and 2 % from pixel to pixel.
    double mean[2] = {0}, square = 0, vignetting = 0;
    for (int v = 0; v < 32; v++) {
        for (int u = 0; u < 32; u++) {
            const double centre = pixels[(240 + v) * 640 + 304 + u] - 1024.0;
            mean[0] += centre / 1024;
            square += centre * centre / 1024;
            mean[1] += (pixels[v * 640 + u] - 1024.0) / 1024;
            const double du = u - 319.5, dv = v - 255.5;
            vignetting +=
                pow(cos(atan(sqrt((du * du + dv * dv) / (320 * 320 + 256 * 256) * (1 / sqrt(0.8) - 1)))), 4) / 1024;
        }
    }
    assert_near(mean[1] / mean[0], vignetting, 5 * 0.02 * sqrt(2.0 / 1024));
    assert_near(sqrt(square / mean[0] / mean[0] - 1), 0.02, 5 * 0.02 / sqrt(2 * 1024) + 2e-4); // 2e-4: shot, vignetting
    free(pixels);
    sim_rig_close(&r);
}

static void bits_black_and_saturation(void **state) {
    (void)state;
    const int bits[] = {8, 10, 12, 16};
    for (int k = 0; k < 4; k++) {
        char setting[32];
        snprintf(setting, sizeof setting, "camera.bits=%d", bits[k]);
        const char *const extra[] = {setting, "camera.width=32", "camera.height=32", NULL};
        sim_rig r;
        sim_rig_open(&r, "lambert:rho=0.5", 1, 1, sim_perfect, extra);
        gonio_stamp stamp = sim_rig_move(&r, 1, 0, 0, 0, 0);
        const int full = (1 << bits[k]) - 1;
        uint16_t *bright = sim_rig_capture(&r, sim_rig_full(&r), 1, stamp);
        assert_int_equal(r.rig.mount->mount(r.rig.mount_device, GONIO_TARGET_TRAP, NULL), GONIO_OK);
        uint16_t *black = sim_rig_capture(&r, sim_rig_full(&r), 1, stamp);
        for (int i = 0; i < 32 * 32; i++) {
            assert_int_equal(bright[i], full);
            assert_int_equal(black[i], (full + 1) / 64);
        }
        free(bright);
        free(black);
        sim_rig_close(&r);
    }
}

static double window_electrons(sim_rig *r, gonio_stamp stamp) {
    uint16_t *pixels = sim_rig_capture(r, sim_rig_full(r), 0.05, stamp);
    double mean = 0;
    for (int i = 0; i < 64 * 64; i++) {
        mean += (pixels[i] - 1024.0) / (65535 - 1024) * 10000 / (64 * 64);
    }
    free(pixels);
    return mean;
}

// A light trap shows the room's scatter alone, drawn about its stated size; the lens spreads a share of the scene's
// mean over every pixel, so that a plate that fills the view grows by that share. Of 60 rigs the logarithm of the
// scatter has a sigma of 0.5 and the glare the stated root mean square: each known to 9 %, tested to 5 standard errors.
static void stray_light_is_as_stated(void **state) {
    (void)state;
    double scatter = 0, glare = 0;
    enum { RIGS = 60 };
    for (uint64_t seed = 1; seed <= RIGS; seed++) {
        const char *const extra[] = {"camera.width=64",
                                     "camera.height=64",
                                     "camera.bits=16",
                                     "camera.white_e_per_s=2e5",
                                     "stray.ambient_percent=2",
                                     "stray.glare_percent=5",
                                     "stray.variation_percent=0",
                                     NULL};
        sim_rig r;
        sim_rig_open(&r, "lambert:rho=0.5", seed, 1, sim_perfect, extra);
        gonio_stamp stamp = sim_rig_move(&r, 1, 0, 0, 0, 0);
        const double plate = window_electrons(&r, stamp);
        assert_int_equal(r.rig.mount->mount(r.rig.mount_device, GONIO_TARGET_TRAP, NULL), GONIO_OK);
        const double trap = window_electrons(&r, stamp);
        const double log_scatter = log(trap / (0.02 * 0.05 * 2e5)), share = (plate - trap) / 5000 - 1;
        scatter += log_scatter * log_scatter / RIGS;
        glare += share * share / RIGS;
        sim_rig_close(&r);
    }
    assert_near(sqrt(scatter) / 0.5, 1, 5 * sqrt(0.5 / RIGS));
    assert_near(sqrt(glare) / 0.05, 1, 5 * sqrt(0.5 / RIGS));
}

static double window_mean(sim_rig *r, double exposure_s, double gain_db, gonio_stamp stamp) {
    gonio_window w = sim_rig_full(r);
    const size_t n = (size_t)w.width * (size_t)w.height;
    gonio_frame frame = {.pixels = malloc(n * sizeof(uint16_t))};
    assert_int_equal(r->rig.camera->capture(r->rig.camera_device, &w, exposure_s, gain_db, &stamp, 100, &frame, NULL),
                     GONIO_OK);
    double mean = 0;
    for (size_t i = 0; i < n; i++) {
        mean += frame.pixels[i] / (double)n;
    }
    free(frame.pixels);
    return mean;
}

static void gain_multiplies(void **state) {
    (void)state;
    const char *const extra[] = {"camera.width=64", "camera.height=64", NULL};
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 1, 1, sim_perfect, extra);
    const gonio_stamp stamp = sim_rig_move(&r, 1, 0, 0, 0, 0);
    const double plain = window_mean(&r, 0.004, 0, stamp) - 64, amplified = window_mean(&r, 0.004, 12, stamp) - 64;
    assert_near(amplified / plain, pow(10, 0.6), 0.002);
    sim_rig_close(&r);
}

static void response_curve_is_applied(void **state) {
    (void)state;
    const char *const extra[] = {"camera.width=64", "camera.height=64", "camera.response=gamma:2.2", NULL};
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 1, 1, sim_perfect, extra);
    assert_string_equal(r.rig.facts.response_path, "");
    const gonio_stamp stamp = sim_rig_move(&r, 1, 0, 0, 0, 0);
    // 250000 x 0.01 of 10000 electrons; the curve's bend under shot noise (sigma 0.005 of 0.25) is below 1e-4.
    assert_near((window_mean(&r, 0.01, 0, stamp) - 64) / 4031, pow(0.25, 1 / 2.2), 5e-4);
    sim_rig_close(&r);
}

static void bayer_patterns(void **state) {
    (void)state;
    const char *const patterns[] = {"rggb", "bggr", "grbg", "gbrg", "auto"};
    const double rho[3] = {0.6, 0.3, 0.1};
    for (int k = 0; k < 5; k++) {
        const char *name = patterns[k % 4 + (k == 4 ? 4 : 0)];
        const char *sites = k == 4 ? "rggb" : name;
        char setting[32];
        snprintf(setting, sizeof setting, "camera.pattern=%s", name);
        const char *const extra[] = {setting, "camera.width=64", "camera.height=64", NULL};
        sim_rig r;
        sim_rig_open(&r, "lambert:rho=0.6/0.3/0.1", 1, 1, sim_perfect, extra);
        const gonio_stamp stamp = sim_rig_move(&r, 1, 0, 0, 0, 0);
        // An odd window, so that the colours hang on the full frame's coordinates.
        const gonio_window window = {7, 5, 40, 41};
        uint16_t *pixels = sim_rig_capture(&r, window, 0.02, stamp);
        double sum[4] = {0}, count[4] = {0};
        for (int v = 0; v < 41; v++) {
            for (int u = 0; u < 40; u++) {
                const int site = (v + 5) % 2 * 2 + (u + 7) % 2;
                sum[site] += electrons(pixels[v * 40 + u]);
                count[site]++;
            }
        }
        for (int site = 0; site < 4; site++) {
            const double expected = 10000 * rho[sites[site] == 'r' ? 0 : sites[site] == 'g' ? 1 : 2];
            assert_near(sum[site] / count[site], expected, 5 * sqrt(expected / count[site]) + 2e-5 * expected);
        }
        free(pixels);
        sim_rig_close(&r);
    }
}

// Windows, threads, call order, former moves and restarts do not change a pixel.
static void pixels_depend_on_seed_and_stamp_only(void **state) {
    (void)state;
    const char *const spec = "ward:rho_d=0.3,rho_s=0.2,alpha=0.15";
    const gonio_window windows[] = {{100, 60, 161, 127}, {639, 511, 1, 1}, {0, 200, 640, 3}};
    sim_rig a, b;
    sim_rig_open(&a, spec, 4, 1, NULL, NULL);
    sim_rig_open(&b, spec, 4, 3, NULL, NULL);
    gonio_stamp stamp = sim_rig_move(&a, 7, 30, 0, 50, 170);
    stamp.frame = 2;
    uint16_t *full = sim_rig_capture(&a, sim_rig_full(&a), 0.01, stamp);
    sim_rig_move(&b, 3, 80, 10, 20, -100);
    free(sim_rig_capture(&b, windows[0], 0.1, (gonio_stamp){.pose = 3, .frame = 1}));
    sim_rig_move(&b, 7, 30, 0, 50, 170);
    for (int k = 0; k < 3; k++) {
        const gonio_window w = windows[k];
        uint16_t *part = sim_rig_capture(&b, w, 0.01, stamp);
        for (int row = 0; row < w.height; row++) {
            assert_memory_equal(part + row * w.width, full + (w.y + row) * 640 + w.x, (size_t)w.width * 2);
        }
        free(part);
    }
    stamp.frame = 3;
    uint16_t *other = sim_rig_capture(&b, sim_rig_full(&b), 0.01, stamp);
    assert_memory_not_equal(other, full, 640 * 512 * 2);
    free(other);
    free(full);
    sim_rig_close(&a);
    sim_rig_close(&b);
}

static void impossible_requests_are_refused(void **state) {
    (void)state;
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 1, 1, NULL, NULL);
    uint16_t pixels[16];
    gonio_frame frame = {.pixels = pixels};
    const gonio_stamp stamp = {.pose = 1};
    const gonio_window good = {0, 0, 4, 4},
                       bad[] = {{-1, 0, 4, 4}, {0, 0, 0, 4}, {638, 0, 4, 4}, {0, 510, 4, 2147483647}};
    gonio_error error = {0};
    for (int k = 0; k < 4; k++) {
        assert_int_equal(r.rig.camera->capture(r.sim, &bad[k], 0.01, 0, &stamp, 1, &frame, &error), GONIO_E_RANGE);
    }
    assert_int_equal(r.rig.camera->capture(r.sim, &good, 1e-6, 0, &stamp, 1, &frame, &error), GONIO_E_RANGE);
    assert_non_null(strstr(error.message, "2e-05 to 20 s"));
    assert_int_equal(r.rig.camera->capture(r.sim, &good, NAN, 0, &stamp, 1, &frame, &error), GONIO_E_RANGE);
    assert_int_equal(r.rig.camera->capture(r.sim, &good, 0.01, -1, &stamp, 1, &frame, &error), GONIO_E_RANGE);
    assert_int_equal(r.rig.camera->capture(r.sim, &good, 5, 0, &stamp, 1, &frame, &error), GONIO_E_TIMEOUT);
    sim_rig_close(&r);
}

static void distortion_that_folds_is_refused(void **state) {
    (void)state;
    gonio_sim *sim;
    gonio_rig rig;
    gonio_error error = {0};
    assert_int_equal(gonio_sim_new("lambert:rho=0.5", 1, &sim, NULL), GONIO_OK);
    assert_int_equal(gonio_sim_set(sim, "camera", "k1", "-900", NULL), GONIO_OK);
    assert_int_equal(gonio_sim_open(sim, 1, &rig, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "folds"));
    gonio_sim_free(sim);
}

// A burst's frames are those that captures with its stamps give: numbered, one exposure and read-out apart.
static void a_burst_is_numbered_frames_at_the_nominal_rate(void **state) {
    (void)state;
    const char *const extra[] = {"camera.width=16", "camera.height=16", "camera.read_out_s=0.03", NULL};
    sim_rig r;
    sim_rig_open(&r, "lambert:rho=0.5", 5, 1, sim_perfect, extra);
    sim_rig_move(&r, 0, 30, 0, 0, 0);
    const gonio_camera_ops *camera = r.rig.camera;
    const gonio_window all = sim_rig_full(&r);
    uint16_t pixels[256];
    for (int round = 0; round < 2; round++) { // each begins with 0
        assert_int_equal(camera->stream(r.rig.camera_device, 0.02, 0, 10, NULL), GONIO_OK);
        for (int i = 0; i < 5; i++) {
            gonio_frame frame = {.pixels = pixels};
            int64_t lost = -1;
            assert_int_equal(camera->next(r.rig.camera_device, &all, 10, &frame, &lost, NULL), GONIO_OK);
            assert_int_equal(lost, 0);
            assert_int_equal(frame.stamp.frame, i);
            assert_near(frame.stamp.clock_s, 0.05 * i, 1e-12);
            assert_near(frame.exposure_s, 0.02, 0);
            uint16_t *single = sim_rig_capture(&r, all, 0.02, (gonio_stamp){0, i, frame.stamp.clock_s});
            assert_memory_equal(pixels, single, sizeof pixels);
            free(single);
        }
    }
    assert_int_equal(camera->stream(r.rig.camera_device, 1e9, 0, 10, NULL), GONIO_E_RANGE);
    sim_rig_close(&r);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lambert_closure),
        cmocka_unit_test(lambert_sphere_phase_law),
        cmocka_unit_test(plate_edge_is_where_projected),
        cmocka_unit_test(photon_transfer),
        cmocka_unit_test(default_noise_is_as_stated),
        cmocka_unit_test(prnu_and_vignetting),
        cmocka_unit_test(bits_black_and_saturation),
        cmocka_unit_test(stray_light_is_as_stated),
        cmocka_unit_test(gain_multiplies),
        cmocka_unit_test(response_curve_is_applied),
        cmocka_unit_test(bayer_patterns),
        cmocka_unit_test(pixels_depend_on_seed_and_stamp_only),
        cmocka_unit_test(a_burst_is_numbered_frames_at_the_nominal_rate),
        cmocka_unit_test(impossible_requests_are_refused),
        cmocka_unit_test(distortion_that_folds_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
