// SPDX-License-Identifier: BSD-3-Clause
// A scene from its file.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "base/vector.h"
#include "gonio/sample.h"
#include "scene/world/camera.h"
#include "scene/world/geometry.h"

// Rays that find out whether a place is enclosed.
#define PROBES 256

void gonio_scene_free(gonio_scene *scene) {
    if (scene == NULL) {
        return;
    }
    for (int i = 0; scene->materials != NULL && i < scene->settings->materials; i++) {
        gonio_model_free(scene->materials[i].model);
        gonio_colour_free(&scene->materials[i].colour);
        gonio_picture_free(scene->materials[i].map);
    }
    for (int i = 0; scene->meshes != NULL && i < scene->settings->meshes; i++) {
        free(scene->meshes[i].map.materials);
    }
    free(scene->materials);
    free(scene->meshes);
    free(scene->triangle_material);
    free(scene->triangle_mesh);
    gonio_scene_caster_free(scene->caster);
    gonio_scene_mesh_free(scene->mesh);
    gonio_world_environment_free(scene->environment);
    free(scene->settings);
    free(scene);
}

// ---- materials ----

// What a file that the scene names fails with stays; else the scene's line fails.
static gonio_status fail_at(const char *path, long long line, const char *what, const gonio_error *why,
                            gonio_error *error) {
    if (why->status == GONIO_E_MEMORY) {
        return gonio_fail(error, GONIO_E_MEMORY, "%s", why->message);
    }
    return why->file[0] != 0 ? gonio_fail_line(error, GONIO_E_INPUT, why->file, why->line, "%s", why->message)
                             : gonio_fail_line(error, GONIO_E_INPUT, path, line, "%s: %s", what, why->message);
}

// Takes what the model shows; m->model stays as it is.
static gonio_status prepare_model(gonio_model *model, const char *name, bool sampled, world_material *m,
                                  gonio_error *error) {
    gonio_status status = model->channels > GONIO_CHANNELS_MAX
                              ? gonio_fail(error, GONIO_E_INPUT, "a model of more than %d channels", GONIO_CHANNELS_MAX)
                              : gonio_colour_new(model->channels, model->channel_names, &m->colour, error);
    // Kinds that draw from their own lobes do well without a table.
    sampled = sampled && status == GONIO_OK && model->ops->sample == NULL;
    status = status == GONIO_OK && sampled ? gonio_model_prepare_sampling(model, error) : status;
    m->constant = false;
    if (status == GONIO_OK && strncmp(name, "spec:lambert:", 13) == 0 && strpbrk(name, "+|") == NULL) {
        const gonio_vec3 up = {0, 0, 1};
        double values[GONIO_CHANNELS_MAX];
        gonio_model_eval(model, up, up, values);
        gonio_colour_rgb(&m->colour, values, m->f);
        m->constant = true;
    }
    return status;
}

static gonio_status open_material(const char *path, const scene_material_settings *s, bool sampled, world_material *m,
                                  gonio_error *error) {
    gonio_error why = {.line = -1, .byte = -1};
    char what[SCENE_NAME_MAX + 16];
    snprintf(what, sizeof what, "[material %s]", s->name);
    gonio_status status = gonio_model_resolve(s->model, &m->model, &why);
    status = status == GONIO_OK ? prepare_model(m->model, s->model, sampled, m, &why) : status;
    status = status == GONIO_OK && s->albedo_map[0] != 0 ? gonio_picture_read(s->albedo_map, &m->map, &why) : status;
    if (status != GONIO_OK) {
        why.status = status;
        return fail_at(path, s->line, what, &why, error);
    }
    memcpy(m->albedo, s->albedo, sizeof m->albedo);
    return GONIO_OK;
}

// Are directions drawn from the models?
static bool draws(const scene_settings *s) {
    bool drawn = s->image.interreflection;
    for (int i = 0; i < s->lights; i++) {
        drawn = drawn || s->light[i].kind == SCENE_LIGHT_ENVIRONMENT;
    }
    return drawn;
}

static gonio_status open_materials(const char *path, gonio_scene *scene, gonio_error *error) {
    scene_settings *s = scene->settings;
    if (s->materials == 0) {
        s->materials = 1;
        s->material[0] = (scene_material_settings){.model = "spec:lambert:rho=0.5", .albedo = {1, 1, 1}};
    }
    const bool sampled = draws(s);
    scene->materials = calloc((size_t)s->materials, sizeof *scene->materials);
    gonio_status status =
        scene->materials != NULL ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "no memory for a scene");
    for (int i = 0; i < s->materials && status == GONIO_OK; i++) {
        status = open_material(path, &s->material[i], sampled, &scene->materials[i], error);
    }
    return status;
}

// A map needs to know where on the surface it lies.
static gonio_status check_maps(const gonio_scene *scene, gonio_error *error) {
    for (size_t t = 0; t < scene->mesh->triangles; t++) {
        const int material = scene->triangle_material[t], mesh = scene->triangle_mesh[t];
        if (scene->materials[material].map != NULL && !scene->meshes[mesh].has_uv) {
            return gonio_fail_line(error, GONIO_E_INPUT, scene->settings->mesh[mesh].file, -1,
                                   "it has no texture coordinates, which the albedo_map of [material %s] needs",
                                   scene->settings->material[material].name);
        }
    }
    return GONIO_OK;
}

// ---- lights ----

static gonio_status open_lights(const char *path, gonio_scene *scene, gonio_error *error) {
    for (int i = 0; i < scene->settings->lights; i++) {
        scene_light_settings *light = &scene->settings->light[i];
        const double *w = light->toward, length = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
        if (light->kind != SCENE_LIGHT_ENVIRONMENT && light->file[0] != 0) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, light->line,
                                   "only a light of kind environment has a file");
        }
        if (light->kind == SCENE_LIGHT_DIRECTIONAL && !(length > 0)) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, light->line, "toward = 0/0/0 is no direction");
        }
        for (int k = 0; k < 3 && length > 0; k++) {
            light->toward[k] /= length;
        }
        if (light->kind == SCENE_LIGHT_ENVIRONMENT) {
            if (scene->environment != NULL) {
                return gonio_fail_line(error, GONIO_E_INPUT, path, light->line,
                                       "a second environment; one is possible");
            }
            gonio_error why = {.line = -1, .byte = -1};
            if (gonio_world_environment_new(light, &scene->environment, &why) != GONIO_OK) {
                return fail_at(path, light->line, "[light]", &why, error);
            }
        }
    }
    return GONIO_OK;
}

// No ray leads from it out of the scene.
static bool is_enclosed(const gonio_scene *scene, gonio_vec3 point) {
    for (int k = 0; k < PROBES; k++) {
        const double z = 1 - (2 * k + 1.0) / PROBES, sine = sqrt(1 - z * z), angle = 2.399963229728653 * k; // golden
        scene_hit hit;
        if (!gonio_scene_caster_hit(scene->caster, point, (gonio_vec3){sine * cos(angle), sine * sin(angle), z},
                                    &hit)) {
            return false;
        }
    }
    return true;
}

static gonio_status check_lights(const char *path, const gonio_scene *scene, gonio_error *error) {
    bool indoors = false;
    for (int i = 0; i < scene->settings->cameras; i++) {
        const double *e = scene->settings->camera[i].eye;
        indoors = indoors || is_enclosed(scene, (gonio_vec3){e[0], e[1], e[2]});
    }
    for (int i = 0; i < scene->settings->lights && !indoors; i++) {
        const scene_light_settings *light = &scene->settings->light[i];
        const double *p = light->position;
        if (light->kind == SCENE_LIGHT_POINT && is_enclosed(scene, (gonio_vec3){p[0], p[1], p[2]})) {
            return gonio_fail_line(
                error, GONIO_E_INPUT, path, light->line,
                "[light %s] lies inside a closed mesh at %g/%g/%g; nothing that a camera sees is lit "
                "by it",
                light->name, p[0], p[1], p[2]);
        }
    }
    return GONIO_OK;
}

// ---- all ----

static gonio_status open_all(const char *path, gonio_scene *scene, gonio_error *error) {
    gonio_status status = gonio_scene_settings_read(path, &scene->settings, error);
    if (status != GONIO_OK) {
        return status;
    }
    scene->meshes = calloc((size_t)scene->settings->meshes, sizeof *scene->meshes);
    if (scene->meshes == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a scene");
    }
    status = open_materials(path, scene, error);
    status = status == GONIO_OK ? open_lights(path, scene, error) : status;
    status = status == GONIO_OK ? gonio_world_geometry_read(path, scene, error) : status;
    status = status == GONIO_OK ? check_maps(scene, error) : status;
    status = status == GONIO_OK ? gonio_scene_caster_new(scene->mesh, &scene->caster, error) : status;
    status = status == GONIO_OK ? gonio_world_cameras_check(path, scene, error) : status;
    return status == GONIO_OK ? check_lights(path, scene, error) : status;
}

gonio_status gonio_scene_open(const char *path, gonio_scene **out, gonio_error *error) {
    *out = NULL;
    gonio_scene *scene = calloc(1, sizeof *scene);
    if (scene == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a scene");
    }
    const gonio_status status = open_all(path, scene, error);
    if (status != GONIO_OK) {
        gonio_scene_free(scene);
        return status;
    }
    const scene_settings *s = scene->settings;
    gonio_scene_facts *f = &scene->facts;
    f->meshes = s->meshes;
    f->materials = s->materials;
    f->lights = s->lights;
    f->cameras = s->cameras;
    f->width = s->image.width;
    f->height = s->image.height;
    f->samples = s->image.samples;
    f->interreflection = s->image.interreflection;
    *out = scene;
    return GONIO_OK;
}

void gonio_scene_describe(const gonio_scene *scene, gonio_scene_facts *facts) { *facts = scene->facts; }

const char *gonio_scene_material_name(const gonio_scene *scene, int material) {
    return material >= 0 && material < scene->settings->materials ? scene->settings->material[material].name : NULL;
}

const char *gonio_scene_camera_name(const gonio_scene *scene, int camera) {
    return camera >= 0 && camera < scene->settings->cameras ? scene->settings->camera[camera].name : NULL;
}

const char *gonio_scene_light_name(const gonio_scene *scene, int light) {
    return light >= 0 && light < scene->settings->lights ? scene->settings->light[light].name : NULL;
}

const gonio_model *gonio_scene_material_model(const gonio_scene *scene, int material) {
    return material >= 0 && material < scene->settings->materials ? scene->materials[material].model : NULL;
}

gonio_status gonio_scene_material_find(const gonio_scene *scene, const char *name, int *material, gonio_error *error) {
    char list[1000] = "";
    for (int i = 0; i < scene->settings->materials; i++) {
        if (strcmp(scene->settings->material[i].name, name) == 0) {
            *material = i;
            return GONIO_OK;
        }
        gonio_text_append(list, sizeof list, "%s%s", i > 0 ? ", " : "", scene->settings->material[i].name);
    }
    return gonio_fail(error, GONIO_E_USAGE, "the scene has no material '%.80s'; it has %s", name, list);
}

gonio_status gonio_scene_exchange_model(gonio_scene *scene, int material, gonio_model **model, gonio_error *error) {
    world_material *m = &scene->materials[material], changed = *m;
    changed.colour = (gonio_colour_weights){0};
    const gonio_status status = prepare_model(*model, "", draws(scene->settings), &changed, error);
    if (status != GONIO_OK) {
        gonio_colour_free(&changed.colour);
        return status;
    }
    gonio_colour_free(&m->colour);
    changed.model = *model;
    *model = m->model;
    *m = changed;
    return GONIO_OK;
}
