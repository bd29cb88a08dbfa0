// SPDX-License-Identifier: BSD-3-Clause
// Parametric materials: glTF 2.0, OpenPBR in MaterialX, and Blender's Principled BSDF. Written alone; each with its own
// definition of anisotropy, converted from the lobe's two widths:
//   glTF:      alpha_t = alpha + (1 - alpha) s^2 along the tangent, alpha_b = alpha, roughness^2 = alpha;
//   OpenPBR:   alpha_x = r^2 sqrt(2 / (1 + (1 - a)^2)), alpha_y = (1 - a) alpha_x;
//   Blender:   alpha_x = r^2 / q, alpha_y = r^2 q, q = sqrt(1 - 0.9 a).
// The wider axis is the tangent, turned by 90 deg where that is the sample's y.
#include <math.h>
#include <string.h>

#include "io/parametric/principled.h"

static double wide(const gonio_principled *p) { return fmax(p->alpha_x, p->alpha_y); }
static double narrow(const gonio_principled *p) { return fmin(p->alpha_x, p->alpha_y); }
static bool turned(const gonio_principled *p) { return p->alpha_y > p->alpha_x; }
static double largest(const double v[3]) { return fmax(v[0], fmax(v[1], v[2])); }
static const double *base_of(const gonio_principled *p) { return p->metal ? p->f0 : p->diffuse; }

static bool recognise(const gonio_source *source) {
    (void)source;
    return false;
}

static gonio_status fitted(const gonio_model *model, const gonio_format_values *values, gonio_principled_rule rule,
                           gonio_principled *p, gonio_write_report *told, gonio_error *error) {
    const gonio_status status = gonio_principled_fit(model, rule, values->threads, p, error);
    if (status == GONIO_OK) {
        gonio_principled_tell(model, p, told);
    }
    return status;
}

static gonio_status meant(const gonio_model *model, gonio_principled_rule rule, int threads, gonio_model **out,
                          gonio_error *error) {
    gonio_principled p;
    const gonio_status status = gonio_principled_fit(model, rule, threads, &p, error);
    return status == GONIO_OK ? gonio_principled_model(&p, rule, out, error) : status;
}

// ---- glTF 2.0 ----

// A square with normals and tangents along +x, so that the file shows something: 4 positions, normals, tangents, 6
// indices, as base64.
static void put_base64(FILE *stream, const unsigned char *bytes, size_t n) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t k = 0; k < n; k += 3) {
        const unsigned v = (unsigned)bytes[k] << 16 | (k + 1 < n ? (unsigned)bytes[k + 1] << 8 : 0) |
                           (k + 2 < n ? (unsigned)bytes[k + 2] : 0);
        fputc(digits[v >> 18], stream);
        fputc(digits[v >> 12 & 63], stream);
        fputc(k + 1 < n ? digits[v >> 6 & 63] : '=', stream);
        fputc(k + 2 < n ? digits[v & 63] : '=', stream);
    }
}

enum { SQUARE_BYTES = 4 * (12 + 12 + 16) + 12 };

static void put_square(FILE *stream) {
    static const float corners[4][3] = {{-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}}; // y is up in glTF
    unsigned char bytes[SQUARE_BYTES];
    size_t at = 0;
    const uint16_t indices[6] = {0, 1, 2, 0, 2, 3};
    float all[4 * (3 + 3 + 4)];
    for (int k = 0; k < 4; k++) {
        memcpy(all + 3 * k, corners[k], sizeof corners[k]);
        memcpy(all + 12 + 3 * k, (float[3]){0, 1, 0}, 12);
        memcpy(all + 24 + 4 * k, (float[4]){1, 0, 0, 1}, 16);
    }
    for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
        uint32_t bits;
        memcpy(&bits, &all[k], 4);
        for (int b = 0; b < 4; b++) {
            bytes[at++] = (unsigned char)(bits >> (8 * b));
        }
    }
    for (size_t k = 0; k < 6; k++) {
        bytes[at++] = (unsigned char)indices[k];
        bytes[at++] = 0;
    }
    put_base64(stream, bytes, at);
}

static void put_gltf_scene(FILE *stream) {
    fprintf(stream,
            "  \"scene\": 0,\n  \"scenes\": [{\"nodes\": [0]}],\n  \"nodes\": [{\"mesh\": 0}],\n"
            "  \"meshes\": [{\"primitives\": [{\"attributes\": {\"POSITION\": 0, \"NORMAL\": 1, \"TANGENT\": 2}, "
            "\"indices\": 3, \"material\": 0}]}],\n"
            "  \"accessors\": [\n"
            "    {\"bufferView\": 0, \"componentType\": 5126, \"count\": 4, \"type\": \"VEC3\", \"min\": [-1, 0, -1], "
            "\"max\": [1, 0, 1]},\n"
            "    {\"bufferView\": 1, \"componentType\": 5126, \"count\": 4, \"type\": \"VEC3\"},\n"
            "    {\"bufferView\": 2, \"componentType\": 5126, \"count\": 4, \"type\": \"VEC4\"},\n"
            "    {\"bufferView\": 3, \"componentType\": 5123, \"count\": 6, \"type\": \"SCALAR\"}],\n"
            "  \"bufferViews\": [\n"
            "    {\"buffer\": 0, \"byteOffset\": 0, \"byteLength\": 48, \"target\": 34962},\n"
            "    {\"buffer\": 0, \"byteOffset\": 48, \"byteLength\": 48, \"target\": 34962},\n"
            "    {\"buffer\": 0, \"byteOffset\": 96, \"byteLength\": 64, \"target\": 34962},\n"
            "    {\"buffer\": 0, \"byteOffset\": 160, \"byteLength\": 12, \"target\": 34963}],\n"
            "  \"buffers\": [{\"byteLength\": %d, \"uri\": \"data:application/octet-stream;base64,",
            SQUARE_BYTES);
    put_square(stream);
    fputs("\"}]\n}\n", stream);
}

static gonio_status write_gltf(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                               gonio_write_report *told, gonio_error *error) {
    gonio_principled p;
    const gonio_status status = fitted(model, values, GONIO_PRINCIPLED_GLTF, &p, told, error);
    if (status != GONIO_OK) {
        return status;
    }
    const double *base = base_of(&p), f0 = fmax(largest(p.f0), 1e-6);
    const bool anisotropic = p.alpha_x != p.alpha_y, any = !p.metal || anisotropic; // an empty list is an error
    fprintf(stream, "{\n  \"asset\": {\"version\": \"2.0\", \"generator\": \"Gonio\"},\n%s%s%s%s%s",
            any ? "  \"extensionsUsed\": [" : "", p.metal ? "" : "\"KHR_materials_ior\", \"KHR_materials_specular\"",
            !p.metal && anisotropic ? ", " : "", anisotropic ? "\"KHR_materials_anisotropy\"" : "", any ? "],\n" : "");
    fprintf(stream,
            "  \"materials\": [{\"name\": \"Gonio\", \"pbrMetallicRoughness\": {\"baseColorFactor\": [%.6g, %.6g, "
            "%.6g, 1], "
            "\"metallicFactor\": %d, \"roughnessFactor\": %.6g}",
            base[0], base[1], base[2], p.metal, sqrt(narrow(&p)));
    if (any) {
        fputs(", \"extensions\": {", stream);
    }
    if (!p.metal) {
        fprintf(stream,
                "\"KHR_materials_ior\": {\"ior\": %.6g}, \"KHR_materials_specular\": {\"specularFactor\": 1, "
                "\"specularColorFactor\": [%.6g, %.6g, %.6g]}%s",
                gonio_principled_ior(f0), fmin(p.f0[0] / f0, 1), fmin(p.f0[1] / f0, 1), fmin(p.f0[2] / f0, 1),
                anisotropic ? ", " : "");
    }
    if (anisotropic) {
        fprintf(stream, "\"KHR_materials_anisotropy\": {\"anisotropyStrength\": %.6g, \"anisotropyRotation\": %.6g}",
                sqrt((wide(&p) - narrow(&p)) / (1 - narrow(&p))), turned(&p) ? GONIO_PI / 2 : 0);
    }
    fputs(any ? "}}],\n" : "}],\n", stream);
    put_gltf_scene(stream);
    return GONIO_OK;
}

static gonio_status meant_gltf(const gonio_model *model, int threads, gonio_model **out, gonio_error *error) {
    return meant(model, GONIO_PRINCIPLED_GLTF, threads, out, error);
}

static const gonio_format_alias gltf_aliases[] = {{"threejs", NULL, NULL}, {0}};

const gonio_format gonio_format_gltf = {
    .name = "gltf",
    .summary = "glTF 2.0 material",
    .extensions = ".gltf",
    .recognise = recognise,
    .write_table = write_gltf,
    .aliases = gltf_aliases,
    .meant = meant_gltf,
    .quantity = "metallic-roughness parameters with KHR_materials_ior, _specular, _anisotropy; linear sRGB",
    .convention = "the tangent is the sample's x",
};

// ---- OpenPBR in MaterialX ----

static void put_input(FILE *stream, const char *name, double value) {
    fprintf(stream, "    <input name=\"%s\" type=\"float\" value=\"%.6g\" />\n", name, value);
}

static void put_colour(FILE *stream, const char *name, const double v[3]) {
    fprintf(stream, "    <input name=\"%s\" type=\"color3\" value=\"%.6g, %.6g, %.6g\" colorspace=\"lin_rec709\" />\n",
            name, v[0], v[1], v[2]);
}

static gonio_status write_openpbr(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                  gonio_write_report *told, gonio_error *error) {
    gonio_principled p;
    const gonio_status status = fitted(model, values, GONIO_PRINCIPLED_OPENPBR, &p, told, error);
    if (status != GONIO_OK) {
        return status;
    }
    const double f0 = fmax(largest(p.f0), 1e-6), a = 1 - narrow(&p) / wide(&p);
    const double r2 = wide(&p) / sqrt(2 / (1 + (1 - a) * (1 - a)));
    fputs("<?xml version=\"1.0\"?>\n<materialx version=\"1.39\" colorspace=\"lin_rec709\">\n", stream);
    if (turned(&p)) {
        fputs("  <tangent name=\"tangent\" type=\"vector3\" />\n  <normal name=\"normal\" type=\"vector3\" />\n"
              "  <rotate3d name=\"turned\" type=\"vector3\">\n    <input name=\"in\" type=\"vector3\" "
              "nodename=\"tangent\" />\n"
              "    <input name=\"amount\" type=\"float\" value=\"90\" />\n"
              "    <input name=\"axis\" type=\"vector3\" nodename=\"normal\" />\n  </rotate3d>\n",
              stream);
    }
    fputs("  <open_pbr_surface name=\"gonio_surface\" type=\"surfaceshader\">\n", stream);
    put_colour(stream, "base_color", base_of(&p));
    put_input(stream, "base_metalness", p.metal);
    if (!p.metal) {
        const double colour[3] = {fmin(p.f0[0] / f0, 1), fmin(p.f0[1] / f0, 1), fmin(p.f0[2] / f0, 1)};
        put_colour(stream, "specular_color", colour);
        put_input(stream, "specular_ior", gonio_principled_ior(f0));
    }
    put_input(stream, "specular_roughness", sqrt(fmin(r2, 1)));
    put_input(stream, "specular_roughness_anisotropy", a);
    if (turned(&p)) {
        fputs("    <input name=\"geometry_tangent\" type=\"vector3\" nodename=\"turned\" />\n", stream);
    }
    fputs("  </open_pbr_surface>\n  <surfacematerial name=\"gonio\" type=\"material\">\n    <input "
          "name=\"surfaceshader\" "
          "type=\"surfaceshader\" nodename=\"gonio_surface\" />\n  </surfacematerial>\n</materialx>\n",
          stream);
    return GONIO_OK;
}

static gonio_status meant_openpbr(const gonio_model *model, int threads, gonio_model **out, gonio_error *error) {
    return meant(model, GONIO_PRINCIPLED_OPENPBR, threads, out, error);
}

static const gonio_format_alias openpbr_aliases[] = {{"materialx", NULL, NULL}, {0}};

const gonio_format gonio_format_openpbr = {
    .name = "openpbr",
    .summary = "OpenPBR material in MaterialX",
    .extensions = ".mtlx",
    .recognise = recognise,
    .write_table = write_openpbr,
    .aliases = openpbr_aliases,
    .meant = meant_openpbr,
    .quantity = "OpenPBR parameters; linear Rec. 709",
    .convention = "the tangent is the sample's x",
};

// ---- Blender's Principled BSDF ----

static gonio_status write_principled(const gonio_model *model, const gonio_format_values *values, FILE *stream,
                                     gonio_write_report *told, gonio_error *error) {
    gonio_principled p;
    const gonio_status status = fitted(model, values, GONIO_PRINCIPLED_BLENDER, &p, told, error);
    if (status != GONIO_OK) {
        return status;
    }
    const double *base = base_of(&p), f0 = largest(p.f0);
    const double ratio = narrow(&p) / wide(&p), a = fmin((1 - ratio * 1) / 0.9, 1); // q^2 = narrow / wide
    if (a == 1 && 1 - ratio > 0.9) {
        gonio_write_lost(told, "an anisotropy beyond Blender's largest");
    }
    if (!p.metal && fmin(p.f0[0], fmin(p.f0[1], p.f0[2])) < 0.98 * f0) {
        gonio_write_lost(told, "the lobe's colour");
    }
    fprintf(stream,
            "# Blender: run it in the Scripting tab, or blender -P FILE. Written by Gonio.\nimport bpy\n\n"
            "material = bpy.data.materials.new(\"Gonio\")\nmaterial.use_nodes = True\n"
            "bsdf = material.node_tree.nodes[\"Principled BSDF\"]\n"
            "for name, value in {\n    \"Base Color\": (%.6g, %.6g, %.6g, 1),\n    \"Metallic\": %d,\n"
            "    \"Specular\": %.6g,  # f0 over 0.08; Blender 4: \"Specular IOR Level\"\n    \"Roughness\": %.6g,\n"
            "    \"Anisotropic\": %.6g,\n    \"Anisotropic Rotation\": %g,\n}.items():\n"
            "    if name == \"Specular\" and name not in bsdf.inputs:\n        name = \"Specular IOR Level\"\n"
            "    bsdf.inputs[name].default_value = value\n"
            "tangent = material.node_tree.nodes.new(\"ShaderNodeTangent\")\ntangent.direction_type = \"UV_MAP\"\n"
            "material.node_tree.links.new(tangent.outputs[0], bsdf.inputs[\"Tangent\"])\n",
            base[0], base[1], base[2], p.metal, p.metal ? 0.5 : fmin(f0 / 0.08, 1), sqrt(sqrt(p.alpha_x * p.alpha_y)),
            a, turned(&p) ? 0.25 : 0.0);
    return GONIO_OK;
}

static gonio_status meant_principled(const gonio_model *model, int threads, gonio_model **out, gonio_error *error) {
    return meant(model, GONIO_PRINCIPLED_BLENDER, threads, out, error);
}

static const gonio_format_alias principled_aliases[] = {{"blender", NULL, NULL}, {0}};

const gonio_format gonio_format_principled = {
    .name = "principled",
    .summary = "Blender Principled BSDF script",
    .extensions = ".py",
    .recognise = recognise,
    .write_table = write_principled,
    .aliases = principled_aliases,
    .meant = meant_principled,
    .quantity = "parameters of the Principled BSDF; linear sRGB",
    .convention = "the UV map's tangent is the sample's x",
};
