// SPDX-License-Identifier: BSD-3-Clause
// DeYoung 4.2.2: scattered reflected directions are triangulated, and each triangle's share of the integral is its form
// factor (Nusselt's analog), in closed form.
//
// The Delaunay triangulation on the sphere is that of the stereographic projection, which keeps circles. It is built
// point by point (Bowyer 1981, Watson 1981). Grids have four and more points on a circle, so the plane's coordinates
// are moved by up to 1e-7 first; areas are those of the directions themselves. Ghosts along the horizon close the
// hemisphere: great circles between them are the horizon, so the weights add up to pi exactly.
#include "fit/check/triangles.h"

#include <math.h>
#include <stdlib.h>

#include "base/random.h"
#include "base/vector.h"

enum { GHOSTS = 36, CORNERS = 3 };

typedef struct triangle {
    int v[3], next[3]; // next[k]: across the edge opposite v[k]; -1: none
    bool dead;
} triangle;

typedef struct mesh {
    double (*at)[2];
    gonio_vec3 *direction;
    size_t *owner; // of a point: the direction that stands for it
    int points, triangles, last;
    triangle *t;
    int *stack, *cavity, *edge; // work; edge[vertex]: the new triangle whose outer edge starts there
} mesh;

double gonio_projected_solid_angle(gonio_vec3 a, gonio_vec3 b, gonio_vec3 c) {
    const gonio_vec3 v[4] = {a, b, c, a};
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        const gonio_vec3 n = cross(v[k], v[k + 1]);
        const double length = sqrt(dot(n, n));
        sum += length > 0 ? atan2(length, dot(v[k], v[k + 1])) * n.z / length : 0;
    }
    return sum / 2;
}

// ---- the triangulation ----

static double orientation(const double *a, const double *b, const double *p) {
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
}

static bool in_circle(const mesh *m, const triangle *t, const double *p) {
    double d[3][3];
    for (int k = 0; k < 3; k++) {
        d[k][0] = m->at[t->v[k]][0] - p[0];
        d[k][1] = m->at[t->v[k]][1] - p[1];
        d[k][2] = d[k][0] * d[k][0] + d[k][1] * d[k][1];
    }
    return d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) - d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
               d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]) >
           0;
}

static int locate(const mesh *m, const double *p) {
    int at = m->last;
    for (int step = 0; step < m->triangles + 16; step++) {
        const triangle *t = &m->t[at];
        int go = -1;
        for (int k = 0; k < 3 && go < 0; k++) {
            const int e = (k + step) % 3; // the order turns, so that no walk goes in a circle
            if (t->next[e] >= 0 && orientation(m->at[t->v[(e + 1) % 3]], m->at[t->v[(e + 2) % 3]], p) < 0) {
                go = t->next[e];
            }
        }
        if (go < 0) {
            return at;
        }
        at = go;
    }
    return at;
}

// Everything whose circle holds the point, connected to where it lies.
static int find_cavity(mesh *m, int from, const double *p) {
    int count = 0, depth = 0;
    m->stack[depth++] = from;
    m->t[from].dead = true;
    while (depth > 0) {
        const int at = m->stack[--depth];
        m->cavity[count++] = at;
        for (int k = 0; k < 3; k++) {
            const int next = m->t[at].next[k];
            if (next >= 0 && !m->t[next].dead && in_circle(m, &m->t[next], p)) {
                m->t[next].dead = true;
                m->stack[depth++] = next;
            }
        }
    }
    return count;
}

static void insert(mesh *m, int point) {
    const int count = find_cavity(m, locate(m, m->at[point]), m->at[point]), first = m->triangles;
    for (int c = 0; c < count; c++) {
        const triangle t = m->t[m->cavity[c]];
        for (int k = 0; k < 3; k++) {
            const int outer = t.next[k], a = t.v[(k + 1) % 3], b = t.v[(k + 2) % 3];
            if (outer >= 0 && m->t[outer].dead) {
                continue;
            }
            m->t[m->triangles] = (triangle){{a, b, point}, {-1, -1, outer}, false};
            for (int j = 0; j < 3 && outer >= 0; j++) {
                if (m->t[outer].next[j] == m->cavity[c]) {
                    m->t[outer].next[j] = m->triangles;
                }
            }
            m->edge[a] = m->triangles++;
        }
    }
    for (int k = first; k < m->triangles; k++) {
        const int next = m->edge[m->t[k].v[1]];
        m->t[k].next[0] = next;
        m->t[next].next[1] = k;
    }
    m->last = m->triangles - 1;
    // The last new triangles move into the dead ones' places, so that the array stays as long as the mesh.
    for (int c = 0; c < count && m->triangles > first; c++) {
        const int from = --m->triangles, to = m->cavity[c];
        m->t[to] = m->t[from];
        for (int k = 0; k < 3; k++) {
            const int next = m->t[to].next[k];
            for (int j = 0; j < 3 && next >= 0; j++) {
                m->t[next].next[j] = m->t[next].next[j] == from ? to : m->t[next].next[j];
            }
        }
        m->last = m->last == from ? to : m->last;
    }
}

static void add_point(mesh *m, gonio_vec3 d, size_t owner) {
    const int k = m->points++;
    const uint64_t seed = 2 * (uint64_t)k;
    m->direction[k] = d;
    m->owner[k] = owner;
    m->at[k][0] = d.x / (1 + d.z) + 1e-7 * (gonio_random_uniform(seed) - 0.5);
    m->at[k][1] = d.y / (1 + d.z) + 1e-7 * (gonio_random_uniform(seed + 1) - 0.5);
}

static size_t nearest(const gonio_vec3 *directions, size_t n, gonio_vec3 d, bool mirror) {
    size_t best = 0;
    double most = -2;
    for (size_t i = 0; i < n; i++) {
        const gonio_vec3 image = {directions[i].x, -directions[i].y, directions[i].z};
        const double cosine = mirror ? fmax(dot(directions[i], d), dot(image, d)) : dot(directions[i], d);
        best = cosine > most ? i : best;
        most = fmax(most, cosine);
    }
    return best;
}

static void fill(mesh *m, const gonio_vec3 *directions, size_t n, bool mirror) {
    for (int k = 0; k < CORNERS; k++) { // far outside the disc
        add_point(m, (gonio_vec3){30 * cos(2.1 * k), 30 * sin(2.1 * k), 0}, SIZE_MAX);
    }
    m->t[m->triangles++] = (triangle){{0, 1, 2}, {-1, -1, -1}, false};
    for (int k = 0; k < GHOSTS; k++) {
        const gonio_vec3 d = gonio_direction(GONIO_PI / 2, 2 * GONIO_PI * (k + 0.382) / GHOSTS);
        add_point(m, (gonio_vec3){d.x, d.y, 0}, nearest(directions, n, d, mirror));
    }
    for (size_t i = 0; i < n; i++) {
        const gonio_vec3 d = directions[i];
        add_point(m, d, i);
        if (mirror && fabs(d.y) > 1e-6) {
            add_point(m, (gonio_vec3){d.x, -d.y, d.z}, i);
        }
    }
    for (int k = CORNERS; k < m->points; k++) {
        insert(m, k);
    }
}

static double weigh(const mesh *m, double *weight) {
    double inside = 0;
    for (int k = 0; k < m->triangles; k++) {
        const int *v = m->t[k].v;
        if (v[0] < CORNERS || v[1] < CORNERS || v[2] < CORNERS) {
            continue;
        }
        const double share = gonio_projected_solid_angle(m->direction[v[0]], m->direction[v[1]], m->direction[v[2]]);
        const int ghosts = CORNERS + GHOSTS;
        inside += v[0] >= ghosts && v[1] >= ghosts && v[2] >= ghosts ? share : 0;
        for (int j = 0; j < 3; j++) {
            weight[m->owner[v[j]]] += share / 3;
        }
    }
    return inside;
}

gonio_status gonio_triangles_weigh(const gonio_vec3 *directions, size_t n, bool mirror, double *weight, double *covered,
                                   gonio_error *error) {
    const size_t points = 2 * n + GHOSTS + CORNERS;
    mesh m = {.at = malloc(points * sizeof *m.at), .direction = malloc(points * sizeof *m.direction)};
    m.owner = malloc(points * sizeof *m.owner);
    m.t = malloc(4 * points * sizeof *m.t); // 2 a point, and those of one cavity before they move
    m.stack = malloc(4 * points * sizeof *m.stack);
    m.cavity = malloc(4 * points * sizeof *m.cavity);
    m.edge = malloc(points * sizeof *m.edge);
    gonio_status status = GONIO_OK;
    *covered = 0;
    if (n == 0 || n > 100000000 || m.at == NULL || m.direction == NULL || m.owner == NULL || m.t == NULL ||
        m.stack == NULL || m.cavity == NULL || m.edge == NULL) {
        status = gonio_fail(error, GONIO_E_MEMORY, "no memory to triangulate %zu directions", n);
    } else {
        for (size_t i = 0; i < n; i++) {
            weight[i] = 0;
        }
        fill(&m, directions, n, mirror);
        *covered = weigh(&m, weight) / GONIO_PI;
    }
    free(m.edge);
    free(m.cavity);
    free(m.stack);
    free(m.t);
    free(m.owner);
    free(m.direction);
    free(m.at);
    return status;
}
