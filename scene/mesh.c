// SPDX-License-Identifier: BSD-3-Clause
#include "scene/mesh.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include <assimp/cimport.h>
#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "scene/normals.h"

// Cutting a face into triangles takes the square of its corners.
#define CORNERS_MAX 1024
// Neither JoinIdenticalVertices nor FindDegenerates: their thresholds are absolute and eat meshes in metres or smaller.
#define STEPS                                                                                                          \
    (aiProcess_Triangulate | aiProcess_PreTransformVertices | aiProcess_GenSmoothNormals |                             \
     aiProcess_CalcTangentSpace | aiProcess_SortByPType)

void gonio_scene_mesh_free(scene_mesh *mesh) {
    if (mesh != NULL) {
        free(mesh->positions);
        free(mesh->normals);
        free(mesh->tangents);
        free(mesh->uvs);
        free(mesh->indices);
        free(mesh->materials);
        free(mesh->material_names);
        free(mesh);
    }
}

// Assimp 5.2 never comes back from a PLY header that does not end, and allocates whatever count it names. So the header
// is walked first: it ends, and the file is long enough for what it promises (an element takes two bytes at least).
static gonio_status check_ply_header(FILE *file, const char *path, gonio_error *error) {
    struct stat facts;
    char line[1024];
    if (fstat(fileno(file), &facts) != 0 || fgets(line, sizeof line, file) == NULL || strncmp(line, "ply", 3) != 0) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, 1, "not a PLY file: it does not begin with 'ply'");
    }
    for (long long number = 2; fgets(line, sizeof line, file) != NULL; number++) {
        double count;
        if (strchr(line, '\n') == NULL && strchr(line, '\r') == NULL) {
            break;
        }
        if (strncmp(line, "end_header", 10) == 0 && strspn(line + 10, " \t\r\n") == strlen(line + 10)) {
            return GONIO_OK;
        }
        if (sscanf(line, "element %*63s %lf", &count) == 1 && !(2 * count <= (double)facts.st_size)) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, number, "%g elements in a file of %lld bytes", count,
                                   (long long)facts.st_size);
        }
    }
    return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "its header has no end: 'end_header' is missing");
}

static gonio_status check_file(const char *path, gonio_error *error) {
    const char *dot = strrchr(path, '.');
    const bool is_ply = dot != NULL && strcasecmp(dot, ".ply") == 0;
    if (dot == NULL ||
        (!is_ply && strcasecmp(dot, ".obj") != 0 && strcasecmp(dot, ".gltf") != 0 && strcasecmp(dot, ".glb") != 0)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "a mesh is a .ply, .obj, .gltf or .glb file");
    }
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(errno));
    }
    const gonio_status status = is_ply ? check_ply_header(file, path, error) : GONIO_OK;
    fclose(file);
    return status;
}

// Assimp's later steps assert what its readers do not check, and where one fails the scene is released twice; so what
// they need is checked in between.
static gonio_status check_scene(const struct aiScene *scene, const char *path, gonio_error *error) {
    size_t polygons = 0;
    for (unsigned m = 0; m < scene->mNumMeshes; m++) {
        const struct aiMesh *part = scene->mMeshes[m];
        for (unsigned v = 0; v < part->mNumVertices; v++) {
            const struct aiVector3D p = part->mVertices[v];
            if (!isfinite(p.x) || !isfinite(p.y) || !isfinite(p.z)) {
                return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "vertex %u is not finite", v);
            }
        }
        for (unsigned f = 0; f < part->mNumFaces; f++) {
            for (unsigned k = 0; k < part->mFaces[f].mNumIndices; k++) {
                if (part->mFaces[f].mIndices[k] >= part->mNumVertices) {
                    return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "face %u points outside the %u vertices", f,
                                           part->mNumVertices);
                }
            }
            const unsigned corners = part->mFaces[f].mNumIndices;
            if (corners == 0 || corners > CORNERS_MAX) {
                return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "face %u has %u corners; 1 to %d are possible",
                                       f, corners, CORNERS_MAX);
            }
            polygons += corners >= 3;
        }
    }
    return polygons > 0 ? GONIO_OK : gonio_fail_line(error, GONIO_E_INPUT, path, -1, "it has no faces");
}

// *normals: whether the file has them; the tangents' step needs some, ours replace them (normals.c).
static gonio_status import(const char *path, const struct aiScene **out, bool *normals, gonio_error *error) {
    struct aiPropertyStore *properties = aiCreatePropertyStore();
    if (properties == NULL) {
        return gonio_fail(error, GONIO_E_MEMORY, "no memory to read a mesh");
    }
    aiSetImportPropertyInteger(properties, AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
    const struct aiScene *scene = aiImportFileExWithProperties(path, 0, NULL, properties);
    aiReleasePropertyStore(properties);
    gonio_status status = scene != NULL ? check_scene(scene, path, error) : GONIO_OK;
    if (status != GONIO_OK) {
        aiReleaseImport(scene);
        return status;
    }
    *normals = true;
    for (unsigned m = 0; scene != NULL && m < scene->mNumMeshes; m++) {
        *normals = *normals && scene->mMeshes[m]->mNormals != NULL;
    }
    *out = scene != NULL ? aiApplyPostProcessing(scene, STEPS) : NULL;
    if (*out == NULL) {
        status =
            gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a mesh that can be read: %.300s", aiGetErrorString());
    }
    return status;
}

static bool reserve(const struct aiScene *scene, scene_mesh *mesh, bool textured) {
    const size_t vertices = mesh->vertices, triangles = mesh->triangles;
    mesh->material_count = scene->mNumMaterials > 0 ? (int)scene->mNumMaterials : 1;
    mesh->positions = malloc(vertices * 3 * sizeof(float));
    mesh->normals = malloc(vertices * 3 * sizeof(float));
    mesh->indices = malloc(triangles * 3 * sizeof(unsigned));
    mesh->materials = calloc(triangles, sizeof *mesh->materials);
    mesh->material_names = calloc((size_t)mesh->material_count, sizeof *mesh->material_names);
    mesh->tangents = textured ? malloc(vertices * 3 * sizeof(float)) : NULL;
    mesh->uvs = textured ? malloc(vertices * 2 * sizeof(float)) : NULL;
    return mesh->positions != NULL && mesh->normals != NULL && mesh->indices != NULL && mesh->materials != NULL &&
           mesh->material_names != NULL && (!textured || (mesh->tangents != NULL && mesh->uvs != NULL));
}

static gonio_status allocate(const struct aiScene *scene, const char *path, scene_mesh **out, gonio_error *error) {
    size_t vertices = 0, triangles = 0;
    bool textured = true;
    for (unsigned m = 0; m < scene->mNumMeshes; m++) {
        const struct aiMesh *part = scene->mMeshes[m];
        vertices += part->mNumVertices;
        triangles += part->mNumFaces;
        textured = textured && part->mTangents != NULL && part->mTextureCoords[0] != NULL;
        if (part->mNormals == NULL) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "its faces have no area");
        }
    }
    if (triangles == 0 || vertices > UINT32_MAX) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "%zu triangles in it; at least one is needed",
                               triangles);
    }
    if (scene->mNumMaterials > UINT16_MAX) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "%u materials in it; at most %d are possible",
                               scene->mNumMaterials, UINT16_MAX);
    }
    scene_mesh *mesh = calloc(1, sizeof *mesh);
    if (mesh != NULL) {
        *mesh = (scene_mesh){.vertices = vertices, .triangles = triangles};
    }
    if (mesh == NULL || !reserve(scene, mesh, textured)) {
        gonio_scene_mesh_free(mesh);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a mesh of %zu vertices", vertices);
    }
    *out = mesh;
    return GONIO_OK;
}

static void copy_names(const struct aiScene *scene, scene_mesh *mesh) {
    for (unsigned m = 0; m < scene->mNumMaterials; m++) {
        struct aiString name;
        if (aiGetMaterialString(scene->mMaterials[m], AI_MATKEY_NAME, &name) == aiReturn_SUCCESS) {
            snprintf(mesh->material_names[m], SCENE_MATERIAL_NAME_MAX, "%.63s", name.data);
        }
    }
}

// z up becomes y up by a quarter turn about x.
static void put(float *to, struct aiVector3D v, bool z_up) {
    to[0] = v.x;
    to[1] = z_up ? v.z : v.y;
    to[2] = z_up ? -v.y : v.z;
}

static gonio_status copy(const struct aiScene *scene, const char *path, bool z_up, scene_mesh *mesh,
                         gonio_error *error) {
    size_t vertex = 0, triangle = 0;
    copy_names(scene, mesh);
    for (unsigned m = 0; m < scene->mNumMeshes; m++) {
        const struct aiMesh *part = scene->mMeshes[m];
        for (unsigned f = 0; f < part->mNumFaces; f++, triangle++) {
            for (unsigned k = 0; k < 3; k++) {
                const unsigned index = part->mFaces[f].mNumIndices == 3 ? part->mFaces[f].mIndices[k] : UINT32_MAX;
                if (index >= part->mNumVertices) {
                    return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "face %u points outside the %u vertices", f,
                                           part->mNumVertices);
                }
                mesh->indices[3 * triangle + k] = (unsigned)vertex + index;
            }
            mesh->materials[triangle] =
                (uint16_t)(part->mMaterialIndex < (unsigned)mesh->material_count ? part->mMaterialIndex : 0);
        }
        for (unsigned v = 0; v < part->mNumVertices; v++, vertex++) {
            const struct aiVector3D *p = &part->mVertices[v];
            if (!isfinite(p->x) || !isfinite(p->y) || !isfinite(p->z)) {
                return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "vertex %zu is not finite", vertex);
            }
            put(mesh->positions + 3 * vertex, part->mVertices[v], z_up);
            put(mesh->normals + 3 * vertex, part->mNormals[v], z_up);
            if (mesh->tangents != NULL) {
                put(mesh->tangents + 3 * vertex, part->mTangents[v], z_up);
                const struct aiVector3D *uv = &part->mTextureCoords[0][v];
                if (!isfinite(uv->x) || !isfinite(uv->y)) {
                    return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "vt of vertex %zu is not finite", vertex);
                }
                mesh->uvs[2 * vertex] = uv->x;
                mesh->uvs[2 * vertex + 1] = uv->y;
            }
        }
    }
    return GONIO_OK;
}

// About the middle of its box, to the radius of its farthest vertex.
static gonio_status normalise(scene_mesh *mesh, const char *path, gonio_error *error) {
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, radius2 = 0;
    for (size_t i = 0; i < 3 * mesh->vertices; i++) {
        const double p = (double)mesh->positions[i];
        if (!isfinite(p)) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "vertex %zu is not finite", i / 3);
        }
        low[i % 3] = fmin(low[i % 3], p);
        high[i % 3] = fmax(high[i % 3], p);
    }
    for (size_t v = 0; v < mesh->vertices; v++) {
        double r2 = 0;
        for (size_t k = 0; k < 3; k++) {
            const double d = (double)mesh->positions[3 * v + k] - (low[k] + high[k]) / 2;
            r2 += d * d;
        }
        radius2 = fmax(radius2, r2);
    }
    if (!(radius2 > 0 && isfinite(radius2))) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "it has no extent");
    }
    for (size_t i = 0; i < 3 * mesh->vertices; i++) {
        const double middle = (low[i % 3] + high[i % 3]) / 2;
        mesh->positions[i] = (float)(((double)mesh->positions[i] - middle) / sqrt(radius2));
    }
    return GONIO_OK;
}

gonio_status gonio_scene_mesh_load(const char *path, bool z_up, scene_mesh **out, gonio_error *error) {
    *out = NULL;
    gonio_status status = check_file(path, error);
    if (status != GONIO_OK) {
        return status;
    }
    const struct aiScene *scene;
    bool normals = false;
    status = import(path, &scene, &normals, error);
    if (status != GONIO_OK) {
        return status;
    }
    scene_mesh *mesh = NULL;
    status = allocate(scene, path, &mesh, error);
    status = status == GONIO_OK ? copy(scene, path, z_up, mesh, error) : status;
    aiReleaseImport(scene);
    status = status == GONIO_OK && !normals ? gonio_scene_normals_smooth(mesh, error) : status;
    if (status != GONIO_OK) {
        gonio_scene_mesh_free(mesh);
        return status;
    }
    *out = mesh;
    return GONIO_OK;
}

gonio_status gonio_scene_mesh_read(const char *path, bool z_up, scene_mesh **out, gonio_error *error) {
    gonio_status status = gonio_scene_mesh_load(path, z_up, out, error);
    status = status == GONIO_OK ? normalise(*out, path, error) : status;
    if (status != GONIO_OK) {
        gonio_scene_mesh_free(*out);
        *out = NULL;
    }
    return status;
}
