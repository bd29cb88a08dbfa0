#include "sim/mesh.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include <assimp/cimport.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

// Edges sharper than this stay edges.
#define SMOOTHING_DEG 60
// Neither JoinIdenticalVertices nor FindDegenerates: their thresholds are absolute and eat meshes in metres or smaller.
#define STEPS                                                                                                          \
    (aiProcess_Triangulate | aiProcess_PreTransformVertices | aiProcess_GenSmoothNormals |                             \
     aiProcess_CalcTangentSpace | aiProcess_SortByPType | aiProcess_ValidateDataStructure)

void sim_mesh_free(sim_mesh *mesh) {
    if (mesh != NULL) {
        free(mesh->positions);
        free(mesh->normals);
        free(mesh->tangents);
        free(mesh->indices);
        free(mesh);
    }
}

static gonio_status check_file(const char *path, gonio_error *error) {
    const char *dot = strrchr(path, '.');
    if (dot == NULL || (strcasecmp(dot, ".ply") != 0 && strcasecmp(dot, ".obj") != 0)) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "a mesh is a .ply or an .obj file");
    }
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "cannot read it: %s", strerror(errno));
    }
    fclose(file);
    return GONIO_OK;
}

static const struct aiScene *import(const char *path) {
    struct aiPropertyStore *properties = aiCreatePropertyStore();
    if (properties == NULL) {
        return NULL;
    }
    aiSetImportPropertyFloat(properties, AI_CONFIG_PP_GSN_MAX_SMOOTHING_ANGLE, SMOOTHING_DEG);
    aiSetImportPropertyInteger(properties, AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
    const struct aiScene *scene = aiImportFileExWithProperties(path, STEPS, NULL, properties);
    aiReleasePropertyStore(properties);
    return scene;
}

static gonio_status allocate(const struct aiScene *scene, const char *path, sim_mesh **out, gonio_error *error) {
    size_t vertices = 0, triangles = 0;
    bool tangents = true;
    for (unsigned m = 0; m < scene->mNumMeshes; m++) {
        const struct aiMesh *part = scene->mMeshes[m];
        vertices += part->mNumVertices;
        triangles += part->mNumFaces;
        tangents = tangents && part->mTangents != NULL;
        if (part->mNormals == NULL) {
            return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "its faces have no area");
        }
    }
    if (triangles == 0 || vertices > UINT32_MAX) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "%zu triangles in it; at least one is needed",
                               triangles);
    }
    sim_mesh *mesh = calloc(1, sizeof *mesh);
    if (mesh != NULL) {
        *mesh = (sim_mesh){.vertices = vertices,
                           .triangles = triangles,
                           .positions = malloc(vertices * 3 * sizeof(float)),
                           .normals = malloc(vertices * 3 * sizeof(float)),
                           .tangents = tangents ? malloc(vertices * 3 * sizeof(float)) : NULL,
                           .indices = malloc(triangles * 3 * sizeof(unsigned))};
    }
    if (mesh == NULL || mesh->positions == NULL || mesh->normals == NULL || mesh->indices == NULL ||
        (tangents && mesh->tangents == NULL)) {
        sim_mesh_free(mesh);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a mesh of %zu vertices", vertices);
    }
    *out = mesh;
    return GONIO_OK;
}

// z up becomes y up by a quarter turn about x.
static void put(float *to, struct aiVector3D v, bool z_up) {
    to[0] = v.x;
    to[1] = z_up ? v.z : v.y;
    to[2] = z_up ? -v.y : v.z;
}

static gonio_status copy(const struct aiScene *scene, const char *path, bool z_up, sim_mesh *mesh, gonio_error *error) {
    size_t vertex = 0, triangle = 0;
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
        }
        for (unsigned v = 0; v < part->mNumVertices; v++, vertex++) {
            put(mesh->positions + 3 * vertex, part->mVertices[v], z_up);
            put(mesh->normals + 3 * vertex, part->mNormals[v], z_up);
            if (mesh->tangents != NULL) {
                put(mesh->tangents + 3 * vertex, part->mTangents[v], z_up);
            }
        }
    }
    return GONIO_OK;
}

// About the middle of its box, to the radius of its farthest vertex.
static gonio_status normalise(sim_mesh *mesh, const char *path, gonio_error *error) {
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

gonio_status sim_mesh_read(const char *path, bool z_up, sim_mesh **out, gonio_error *error) {
    *out = NULL;
    gonio_status status = check_file(path, error);
    if (status != GONIO_OK) {
        return status;
    }
    const struct aiScene *scene = import(path);
    if (scene == NULL) {
        return gonio_fail_line(error, GONIO_E_INPUT, path, -1, "not a mesh that can be read: %.300s",
                               aiGetErrorString());
    }
    sim_mesh *mesh = NULL;
    status = allocate(scene, path, &mesh, error);
    if (status == GONIO_OK) {
        status = copy(scene, path, z_up, mesh, error);
    }
    aiReleaseImport(scene);
    if (status == GONIO_OK) {
        status = normalise(mesh, path, error);
    }
    if (status != GONIO_OK) {
        sim_mesh_free(mesh);
        return status;
    }
    *out = mesh;
    return GONIO_OK;
}
