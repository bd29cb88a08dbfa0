// SPDX-License-Identifier: BSD-3-Clause
#include "scene/patch/patch.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/vector.h"
#include "scene/names.h"
#include "scene/patch/geometry.h"

// Vertical rays on a side of the tile, that find out whether it is closed.
#define PROBES 64

// ---- what a facet reflects ----

gonio_vec3 gonio_patch_tangent(gonio_vec3 normal) {
    const gonio_vec3 axis = fabs(normal.x) < 0.999 ? (gonio_vec3){1, 0, 0} : (gonio_vec3){0, 1, 0};
    return normalised(sum(axis, scaled(normal, -dot(axis, normal))));
}

static gonio_vec3 into(gonio_vec3 normal, gonio_vec3 w) {
    const gonio_vec3 t = gonio_patch_tangent(normal);
    return normalised((gonio_vec3){dot(t, w), dot(cross(normal, t), w), fmax(dot(normal, w), 1e-9)});
}

static void eval_model(const gonio_patch *patch, const gonio_model *model, gonio_vec3 wi, gonio_vec3 wo,
                       double *values) {
    gonio_model_eval(model, wi, wo, values);
    for (int c = model->channels; c < patch->channels; c++) {
        values[c] = values[0];
    }
}

void gonio_patch_material_eval(const gonio_patch *patch, int material, gonio_vec3 normal, gonio_vec3 wi, gonio_vec3 wo,
                               double *values) {
    const patch_material *m = &patch->materials[material];
    if (m->constant != NULL) {
        memcpy(values, m->constant, (size_t)patch->channels * sizeof *values);
    } else {
        eval_model(patch, m->model, into(normal, wi), into(normal, wo), values);
    }
}

// ---- materials ----

// The material's own text; else its albedo; else those of the first material.
static void name_material(const patch_settings *s, int number, char *name, size_t size) {
    const char *rho = number == 1 && s->rho_2[0] != 0 ? s->rho_2 : "", *text = s->material[number];
    if (text[0] == 0 && rho[0] == 0) {
        text = s->material[0];
        rho = s->rho[0] != 0 ? s->rho : "0.5";
    }
    if (text[0] != 0) {
        snprintf(name, size, "%s%s", gonio_scene_is_spec(text) ? "spec:" : "", text);
    } else {
        snprintf(name, size, "spec:lambert:rho=%s", rho);
    }
}

static gonio_status open_material(gonio_patch *patch, const patch_settings *s, int number, gonio_error *error) {
    char name[PATCH_TEXT_MAX + 32];
    patch_material *material = &patch->materials[number];
    name_material(s, number, name, sizeof name);
    const gonio_status status = gonio_model_resolve(name, &material->model, error);
    if (status != GONIO_OK) {
        return status;
    }
    material->lambert = strncmp(name, "spec:lambert:", 13) == 0 && strchr(name, '+') == NULL;
    if (material->model->channels > patch->channels) {
        patch->channels = material->model->channels;
        patch->channel_names = material->model->channel_names;
    }
    return GONIO_OK;
}

static gonio_status keep_constants(gonio_patch *patch, gonio_error *error) {
    const gonio_vec3 up = {0, 0, 1};
    for (int k = 0; k < PATCH_MATERIALS_MAX; k++) {
        patch_material *m = &patch->materials[k];
        if (m->lambert) {
            m->constant = malloc((size_t)patch->channels * sizeof *m->constant);
            if (m->constant == NULL) {
                return gonio_fail(error, GONIO_E_MEMORY, "no memory for the patch's materials");
            }
            eval_model(patch, m->model, up, up, m->constant);
        }
    }
    return GONIO_OK;
}

static gonio_status open_materials(gonio_patch *patch, const patch_settings *s, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (size_t t = 0; t < patch->mesh.triangles && status == GONIO_OK; t++) {
        const int number = patch->mesh.materials[t];
        if (patch->materials[number].model == NULL) {
            status = number > 1 && s->material[number][0] == 0
                         ? gonio_fail(error, GONIO_E_INPUT,
                                      "the patch has triangles of material_%d, which is not given", number + 1)
                         : open_material(patch, s, number, error);
        }
    }
    for (int k = 0; k < PATCH_MATERIALS_MAX && status == GONIO_OK; k++) {
        const gonio_model *model = patch->materials[k].model;
        if (model != NULL && model->channels != 1 && model->channels != patch->channels) {
            status = gonio_fail(error, GONIO_E_INPUT, "material %d has %d channels, another has %d; 1 goes with any",
                                k + 1, model->channels, patch->channels);
        }
    }
    return status == GONIO_OK ? keep_constants(patch, error) : status;
}

// ---- holes ----

static gonio_status check_closed(const gonio_patch *patch, gonio_error *error) {
    double low, high;
    size_t fell = 0;
    gonio_patch_tile_heights(patch->tile, &low, &high);
    for (int start = 0; start < PROBES * PROBES; start += PATCH_PACKET) {
        patch_packet p = {.coherent = true};
        for (int k = 0; k < PATCH_PACKET; k++) {
            const double x = ((start + k) % PROBES + 0.37) / PROBES, y = ((start + k) / PROBES + 0.61) / PROBES;
            p.origin[k] =
                (gonio_vec3){x * patch->mesh.width, y * patch->mesh.height, high + gonio_patch_tile_lift(patch->tile)};
            p.direction[k] = (gonio_vec3){0, 0, -1};
        }
        gonio_patch_tile_hit(patch->tile, &p, (1u << PATCH_PACKET) - 1);
        for (int k = 0; k < PATCH_PACKET; k++) {
            fell += p.triangle[k] == PATCH_FELL;
        }
    }
    return fell == 0
               ? GONIO_OK
               : gonio_fail(error, GONIO_E_INPUT,
                            "the patch has holes: %.3g %% of vertical rays fall through; a tile must cover all of "
                            "its rectangle seen from +z",
                            100.0 * (double)fell / (PROBES * PROBES));
}

gonio_status gonio_patch_open(const char *text, gonio_patch **out, gonio_error *error) {
    *out = NULL;
    patch_settings *settings = malloc(sizeof *settings);
    gonio_patch *patch = calloc(1, sizeof *patch);
    gonio_status status = settings == NULL || patch == NULL ? gonio_fail(error, GONIO_E_MEMORY, "no memory for a patch")
                                                            : gonio_patch_settings_read(text, settings, error);
    status = status == GONIO_OK ? gonio_patch_mesh_make(settings, &patch->mesh, error) : status;
    status = status == GONIO_OK ? gonio_patch_tile_new(&patch->mesh, &patch->tile, error) : status;
    status = status == GONIO_OK ? open_materials(patch, settings, error) : status;
    status = status == GONIO_OK ? check_closed(patch, error) : status;
    free(settings);
    if (status != GONIO_OK) {
        gonio_patch_free(patch);
        return status;
    }
    *out = patch;
    return GONIO_OK;
}

void gonio_patch_free(gonio_patch *patch) {
    if (patch != NULL) {
        for (int k = 0; k < PATCH_MATERIALS_MAX; k++) {
            gonio_model_free(patch->materials[k].model);
            free(patch->materials[k].constant);
        }
        gonio_patch_tile_free(patch->tile);
        gonio_patch_mesh_free(&patch->mesh);
        free(patch);
    }
}

void gonio_patch_describe(const gonio_patch *patch, gonio_patch_facts *facts) {
    *facts = (gonio_patch_facts){.triangles = patch->mesh.triangles,
                                 .channels = patch->channels,
                                 .width = patch->mesh.width,
                                 .height = patch->mesh.height};
    gonio_patch_tile_heights(patch->tile, &facts->low, &facts->high);
    for (int k = 0; k < PATCH_MATERIALS_MAX; k++) {
        facts->materials += patch->materials[k].model != NULL;
    }
}
