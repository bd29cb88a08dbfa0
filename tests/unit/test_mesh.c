// SPDX-License-Identifier: BSD-3-Clause
// Meshes from files: what is read, and what is refused with a clear error.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "scene/mesh.h"
#include "tests/unit/near.h"

// Assimp's OBJ reader leaks a kilobyte where it gives a file up; ours is still watched.
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libassimp"; }

static gonio_status read_text(const char *suffix, const char *text, size_t size, bool z_up, scene_mesh **mesh,
                              gonio_error *error) {
    char path[64];
    snprintf(path, sizeof path, "/tmp/gonio-mesh-XXXXXX%s", suffix);
    const int fd = mkstemps(path, (int)strlen(suffix));
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, size), (ssize_t)size);
    close(fd);
    const gonio_status status = gonio_scene_mesh_read(path, z_up, mesh, error);
    if (status != GONIO_OK) {
        assert_null(*mesh);
        assert_string_equal(error->file, path);
        assert_true(error->message[0] != 0);
    }
    unlink(path);
    return status;
}

// A cube of 2 um: small meshes stay whole, quads become triangles, edges of 90 deg stay sharp.
static const char *const cube = "v -1e-6 -1e-6 -1e-6\nv 1e-6 -1e-6 -1e-6\nv 1e-6 1e-6 -1e-6\nv -1e-6 1e-6 -1e-6\n"
                                "v -1e-6 -1e-6 1e-6\nv 1e-6 -1e-6 1e-6\nv 1e-6 1e-6 1e-6\nv -1e-6 1e-6 1e-6\n"
                                "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

static void a_cube_stays_a_cube(void **state) {
    (void)state;
    scene_mesh *mesh;
    assert_int_equal(read_text(".obj", cube, strlen(cube), false, &mesh, NULL), GONIO_OK);
    assert_int_equal(mesh->triangles, 12);
    assert_null(mesh->tangents);
    for (size_t i = 0; i < 3 * mesh->vertices; i++) {
        assert_near(fabs((double)mesh->positions[i]), 1 / sqrt(3), 1e-6); // into the unit sphere
    }
    for (size_t v = 0; v < mesh->vertices; v++) {
        double largest = 0;
        for (size_t k = 0; k < 3; k++) {
            const double n = (double)mesh->normals[3 * v + k], p = (double)mesh->positions[3 * v + k];
            largest = fmax(largest, n * p > 0 ? fabs(n) : 0);
        }
        assert_near(largest, 1, 1e-6); // along an axis, outward
    }
    gonio_scene_mesh_free(mesh);
}

// Two large faces in the plane z = 0 and a sliver that sticks up between them: its direction must not count as much as
// theirs. A roof of 90 deg keeps its ridge, one of 40 deg loses it.
static void normals_weigh_faces_by_area(void **state) {
    (void)state;
    const char *const sliver = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 1 0.01\nf 1 2 3\nf 1 3 4\nf 1 5 3\n";
    scene_mesh *mesh;
    assert_int_equal(read_text(".obj", sliver, strlen(sliver), false, &mesh, NULL), GONIO_OK);
    for (size_t v = 0; v < 6; v++) {
        assert_true((double)mesh->normals[3 * mesh->indices[v] + 2] > 0.999);
    }
    gonio_scene_mesh_free(mesh);
    for (int steep = 0; steep < 2; steep++) {
        char roof[200];
        snprintf(roof, sizeof roof,
                 "v 0 -1 0\nv 0 1 0\nv 1 -1 %g\nv 1 1 %g\nv -1 -1 %g\nv -1 1 %g\nf 1 3 4 2\nf 1 2 6 5\n",
                 steep ? -1.0 : -0.36, steep ? -1.0 : -0.36, steep ? -1.0 : -0.36, steep ? -1.0 : -0.36);
        assert_int_equal(read_text(".obj", roof, strlen(roof), false, &mesh, NULL), GONIO_OK);
        int ridge = 0;
        for (size_t v = 0; v < mesh->vertices; v++) {
            if (fabs((double)mesh->positions[3 * v]) < 1e-6) {
                assert_near((double)mesh->normals[3 * v + 2], steep ? sqrt(0.5) : 1, 1e-6);
                ridge++;
            }
        }
        assert_int_equal(ridge, 4);
        gonio_scene_mesh_free(mesh);
    }
}

static void ply_and_upward_axis(void **state) {
    (void)state;
    const char *const triangle =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 0 2\n3 0 1 2\n";
    scene_mesh *mesh;
    assert_int_equal(read_text(".ply", triangle, strlen(triangle), true, &mesh, NULL), GONIO_OK);
    assert_int_equal(mesh->triangles, 1);
    // z has become y: the third corner is the highest.
    const unsigned *i = mesh->indices;
    assert_true(mesh->positions[3 * i[2] + 1] > mesh->positions[3 * i[0] + 1]);
    assert_near((double)mesh->positions[3 * i[2] + 2], (double)mesh->positions[3 * i[0] + 2], 1e-7);
    gonio_scene_mesh_free(mesh);
}

static void texture_coordinates_give_tangents(void **state) {
    (void)state;
    const char *const obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 0 1\nvt 1 0\nf 1/1 2/2 3/3\n"; // u runs along +y
    scene_mesh *mesh;
    assert_int_equal(read_text(".obj", obj, strlen(obj), false, &mesh, NULL), GONIO_OK);
    assert_non_null(mesh->tangents);
    assert_near(fabs((double)mesh->tangents[1]), 1, 1e-5);
    gonio_scene_mesh_free(mesh);
}

static void bad_files_are_refused(void **state) {
    (void)state;
    const struct {
        const char *suffix, *text;
    } bad[] = {
        {".obj", ""},
        {".ply", ""},
        {".obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"},             // no faces
        {".obj", "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n"},    // no extent
        {".obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"},    // a face that points nowhere
        {".obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n"},  // no number
        {".obj", "v 0 0 0\nv 1e99 0 0\nv 0 1 0\nf 1 2 3\n"}, // beyond float
        {".ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                 "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n"}, // cut off
        {".ply", "solid thing\n"},
        {".txt", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        scene_mesh *mesh;
        gonio_error error = {0};
        if (read_text(bad[k].suffix, bad[k].text, strlen(bad[k].text), false, &mesh, &error) != GONIO_E_INPUT) {
            fail_msg("case %zu was not refused", k);
        }
    }
    scene_mesh *mesh;
    gonio_error error = {0};
    assert_int_equal(gonio_scene_mesh_read("/nonexistent/a.ply", false, &mesh, &error), GONIO_E_INPUT);
    assert_non_null(strstr(error.message, "No such file"));
}

// Seeds that this test found dangerous once: an endless header and a face of 785652 corners kept the reader for ever; a
// vertex list that ends early failed an assertion in it; a step that failed freed the scene twice.
static const char *const ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
                               "property float z\nelement face 2\nproperty list uchar int vertex_indices\n"
                               "end_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 2 3\n";

static void files_that_were_dangerous(void **state) {
    (void)state;
    const char *const header_only = "ply\nformat ascii 1.0\nelement vertex 9\n";
    const char *const glued = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header40 0 0\n";
    const char *const many = "ply\nformat ascii 1.0\nelement vertex 4294967295\nproperty float x\nend_header\n0\n";
    const char *const all[] = {header_only, glued, many};
    scene_mesh *mesh;
    gonio_error error = {0};
    for (int k = 0; k < 3; k++) {
        assert_int_equal(read_text(".ply", all[k], strlen(all[k]), false, &mesh, &error), GONIO_E_INPUT);
    }
    assert_int_equal(error.line, 3);
    for (size_t cut = 0; cut < strlen(ply); cut++) {
        if (read_text(".ply", ply, cut, false, &mesh, &error) == GONIO_OK) {
            gonio_scene_mesh_free(mesh);
        }
    }
}

// Files with bytes changed, lost and put in (splitmix-like, fixed seed) end in a mesh or an error, never in a crash.
static void damaged_files_do_no_harm(void **state) {
    (void)state;
    static const char pool[] = "0123456789-. \n/eafv";
    const struct { const char *suffix, *text; } files[] = {{".obj", cube}, {".ply", ply}};
    uint64_t random = 1;
    for (int k = 0; k < 200; k++) {
        char text[1000];
        size_t size = strlen(files[k % 2].text);
        memcpy(text, files[k % 2].text, size + 1);
        for (int change = 0; change < 2; change++) {
            random = random * 6364136223846793005u + 1442695040888963407u;
            const size_t at = (random >> 33) % size, kind = (random >> 60) % 4;
            if (kind < 2) {
                text[at] = pool[(random >> 20) % (sizeof pool - 1)];
            } else if (kind == 2 && at + 8 < size) {
                memmove(text + at, text + at + 7, size - at - 7);
                size -= 7;
            } else {
                memmove(text + at + 1, text + at, size - at);
                text[at] = pool[(random >> 20) % (sizeof pool - 1)];
                size++;
            }
        }
        scene_mesh *mesh;
        gonio_error error = {0};
        if (read_text(files[k % 2].suffix, text, size, false, &mesh, &error) == GONIO_OK) {
            gonio_scene_mesh_free(mesh);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cube_stays_a_cube),      cmocka_unit_test(normals_weigh_faces_by_area),
        cmocka_unit_test(ply_and_upward_axis),      cmocka_unit_test(texture_coordinates_give_tangents),
        cmocka_unit_test(bad_files_are_refused),    cmocka_unit_test(files_that_were_dangerous),
        cmocka_unit_test(damaged_files_do_no_harm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
