// SPDX-License-Identifier: BSD-3-Clause
// A scene's file as text: sections and their settings, before any file that they name is read.
#ifndef GONIO_SCENE_WORLD_SETTINGS_H
#define GONIO_SCENE_WORLD_SETTINGS_H

#include <stdbool.h>

#include "gonio/status.h"

#define SCENE_NAME_MAX 64
#define SCENE_TEXT_MAX 512
#define SCENE_SECTIONS_MAX 256 // of one kind

typedef enum scene_light_kind { SCENE_LIGHT_POINT, SCENE_LIGHT_DIRECTIONAL, SCENE_LIGHT_ENVIRONMENT } scene_light_kind;
typedef enum scene_up { SCENE_UP_Y, SCENE_UP_Z } scene_up;

typedef struct scene_image_settings {
    int width, height;
    int samples; // paths a pixel
    bool interreflection;
} scene_image_settings;

typedef struct scene_camera_settings {
    char name[SCENE_NAME_MAX];
    long long line; // of the section, for messages
    double eye[3], target[3], up[3];
    double fov; // of the picture's height, deg
} scene_camera_settings;

typedef struct scene_material_settings {
    char name[SCENE_NAME_MAX];
    long long line;
    char model[SCENE_TEXT_MAX]; // "spec:..." or a path
    double albedo[3];           // by which the model is multiplied
    char albedo_map[SCENE_TEXT_MAX];
} scene_material_settings;

typedef struct scene_mesh_settings {
    char name[SCENE_NAME_MAX];
    long long line;
    char file[SCENE_TEXT_MAX];
    char material[SCENE_TEXT_MAX]; // a name, or several with commas between them, which the map counts
    char material_map[SCENE_TEXT_MAX];
    int up; // scene_up: the axis of the file that is the scene's y
    double scale, rotate[3], move[3];
    bool smooth; // normals of the file, or smoothed ones; else facets are flat
} scene_mesh_settings;

typedef struct scene_light_settings {
    char name[SCENE_NAME_MAX];
    long long line;
    int kind; // scene_light_kind
    double position[3], toward[3];
    double intensity[3];
    char file[SCENE_TEXT_MAX];
    int up;      // scene_up
    double turn; // about the vertical, deg
    bool visible;
} scene_light_settings;

typedef struct scene_settings {
    scene_image_settings image;
    int cameras, materials, meshes, lights;
    scene_camera_settings camera[SCENE_SECTIONS_MAX];
    scene_material_settings material[SCENE_SECTIONS_MAX];
    scene_mesh_settings mesh[SCENE_SECTIONS_MAX];
    scene_light_settings light[SCENE_SECTIONS_MAX];
} scene_settings;

// GONIO_E_INPUT with file and line. Paths become relative to where the program runs. The caller frees it with free().
gonio_status gonio_scene_settings_read(const char *path, scene_settings **out, gonio_error *error);

#endif
