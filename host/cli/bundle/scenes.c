// SPDX-License-Identifier: BSD-3-Clause
// scenes/: the picture of pictures/sphere.png (a sphere under one distant light) for each renderer that a file of
// formats/ is for, with the same eye, light and exposure, so that the pictures can be compared.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "host/cli/bundle/bundle.h"

gonio_vec3 cli_bundle_light(void) {
    gonio_render_options options;
    gonio_render_options_default(&options);
    return gonio_direction(gonio_radians(options.light_theta_deg), gonio_radians(options.light_phi_deg));
}

// A white diffuser that faces the light is 2^ev, which is its E / pi.
double cli_bundle_irradiance(const cli_bundle *bundle) { return GONIO_PI * exp2(bundle->exposure_ev); }

typedef void put_fn(const cli_bundle *b, const cli_bundle_file *file, FILE *out);

static void put_mitsuba(const cli_bundle *b, const cli_bundle_file *file, FILE *out) {
    const gonio_vec3 l = cli_bundle_light();
    const double e = cli_bundle_irradiance(b);
    fprintf(out,
            "<!-- Mitsuba 3: mitsuba -m scalar_rgb mitsuba.xml. A spectral variant takes\n     "
            "../formats/rgl-spectra.bsdf instead. Written by Gonio. -->\n<scene version=\"3.0.0\">\n"
            "  <integrator type=\"direct\"/>\n  <sensor type=\"perspective\">\n    <float name=\"fov\" "
            "value=\"%.6g\"/>\n    <transform name=\"to_world\"><lookat origin=\"0, 0, %g\" target=\"0, 0, 0\" "
            "up=\"0, 1, 0\"/></transform>\n    <sampler type=\"independent\"><integer name=\"sample_count\" "
            "value=\"16\"/></sampler>\n    <film type=\"hdrfilm\"><integer name=\"width\" value=\"%d\"/><integer "
            "name=\"height\" value=\"%d\"/><rfilter type=\"box\"/></film>\n  </sensor>\n  <emitter "
            "type=\"directional\">\n    <vector name=\"direction\" x=\"%.9g\" y=\"%.9g\" z=\"%.9g\"/>\n    <rgb "
            "name=\"irradiance\" value=\"%.9g, %.9g, %.9g\"/>\n  </emitter>\n  <shape type=\"sphere\">\n    <!-- its "
            "poles up, so that the sample's x runs about the y axis -->\n    <transform name=\"to_world\"><rotate "
            "x=\"1\" angle=\"-90\"/></transform>\n    <bsdf type=\"measured\"><string name=\"filename\" "
            "value=\"../formats/%s\"/></bsdf>\n  </shape>\n</scene>\n",
            CLI_BUNDLE_FOV_DEG, CLI_BUNDLE_EYE, b->side, b->side, -l.x, -l.y, -l.z, e, e, e, file->name);
}

static void put_pbrt(const cli_bundle *b, const cli_bundle_file *file, FILE *out) {
    const gonio_vec3 l = cli_bundle_light();
    const double e = cli_bundle_irradiance(b);
    fprintf(out,
            "# pbrt-v4: pbrt pbrt.pbrt. Written by Gonio.\nScale -1 1 1 # x to the right\nLookAt 0 0 %g  0 0 0  0 1 "
            "0\nCamera \"perspective\" \"float fov\" %.6g\nSampler \"halton\" \"integer pixelsamples\" 64\n"
            "PixelFilter \"box\"\nIntegrator \"path\" \"integer maxdepth\" 1\nFilm \"rgb\" \"string filename\" "
            "\"pbrt.exr\" \"integer xresolution\" %d \"integer yresolution\" %d\nWorldBegin\nLightSource \"distant\" "
            "\"point3 from\" [%.9g %.9g %.9g] \"point3 to\" [0 0 0] \"rgb L\" [%.9g %.9g %.9g]\nAttributeBegin\n"
            "Rotate -90 1 0 0 # the sphere's poles up, so that the sample's x runs about the y axis\nMaterial "
            "\"measured\" \"string filename\" \"../formats/%s\"\nShape \"sphere\"\nAttributeEnd\n",
            CLI_BUNDLE_EYE, CLI_BUNDLE_FOV_DEG, b->side, b->side, l.x, l.y, l.z, e, e, e, file->name);
}

// Radiance's light has a size: as the sun's.
static void put_radiance(const cli_bundle *b, const cli_bundle_file *file, FILE *out) {
    const gonio_vec3 l = cli_bundle_light();
    const double angle_deg = 0.5, half = sin(gonio_radians(angle_deg) / 2);
    const double radiance = cli_bundle_irradiance(b) / (GONIO_PI * half * half);
    const char *arguments = strstr(file->result.report.about, "FILE.xml ");
    char reals[80] = "0";
    if (arguments != NULL && strstr(arguments, ". 0 ") != NULL) {
        snprintf(reals, sizeof reals, "%s", strstr(arguments, ". 0 ") + 4);
    }
    fprintf(out,
            "# Radiance: sh radiance.sh, in this folder. Written by Gonio.\nvoid light sun\n0\n0\n3 %.9g %.9g %.9g\n\n"
            "sun source light\n0\n0\n4 %.9g %.9g %.9g %g\n\n# +y of the sample is as far up as it can be\nvoid BSDF "
            "material\n6 0 ../formats/%s 0 1 0 .\n0\n%s\n\nmaterial sphere ball\n0\n0\n4 0 0 0 1\n",
            radiance, radiance, radiance, l.x, l.y, l.z, angle_deg, file->name, reals);
}

static void put_radiance_script(const cli_bundle *b, const cli_bundle_file *file, FILE *out) {
    (void)file;
    fprintf(out,
            "#!/bin/sh\n# Radiance's picture of radiance.rad: radiance.hdr. Written by Gonio.\nset -e\ncd \"$(dirname "
            "\"$0\")\"\noconv radiance.rad >radiance.oct\nrpict -ab 0 -av 0 0 0 -ps 1 -vtv -vp 0 0 %g -vd 0 0 -1 -vu 0 "
            "1 0 -vh %.6g -vv %.6g -x %d -y %d radiance.oct >radiance.hdr\n",
            CLI_BUNDLE_EYE, CLI_BUNDLE_FOV_DEG, CLI_BUNDLE_FOV_DEG, b->side, b->side);
}

static void put_blender(const cli_bundle *b, const cli_bundle_file *file, FILE *out) {
    const gonio_vec3 l = cli_bundle_light();
    fprintf(out,
            "# Blender: blender -b -P blender.py makes blender.png. Written by Gonio.\n"
            "import math\nimport os\n\nimport bpy\nimport mathutils\n\n"
            "here = os.path.dirname(os.path.abspath(__file__))\nbpy.ops.wm.read_factory_settings(use_empty=True)\n"
            "with open(os.path.join(here, \"../formats/%s\")) as script:  # makes `material`\n"
            "    exec(compile(script.read(), script.name, \"exec\"))\n\n"
            "# Blender's z is up: (x, y, z) of the picture is (x, -z, y) here.\n"
            "bpy.ops.mesh.primitive_uv_sphere_add(segments=256, ring_count=128, radius=1)\n"
            "bpy.ops.object.shade_smooth()\nbpy.context.object.data.materials.append(material)\n"
            "sun = bpy.data.lights.new(\"sun\", \"SUN\")\nsun.energy = %.9g\nsun.angle = 0\n"
            "lamp = bpy.data.objects.new(\"sun\", sun)\nlamp.rotation_mode = \"QUATERNION\"\n"
            "lamp.rotation_quaternion = mathutils.Vector((%.9g, %.9g, %.9g)).to_track_quat(\"Z\", \"Y\")\n"
            "view = bpy.data.cameras.new(\"eye\")\nview.angle = math.radians(%.6g)\n"
            "eye = bpy.data.objects.new(\"eye\", view)\neye.location = (0, -%g, 0)\n"
            "eye.rotation_euler = (math.radians(90), 0, 0)\n"
            "scene = bpy.context.scene\nscene.collection.objects.link(lamp)\nscene.collection.objects.link(eye)\n"
            "scene.camera = eye\nscene.render.engine = \"CYCLES\"\nscene.cycles.samples = 16\n"
            "scene.cycles.max_bounces = 0\nscene.cycles.use_denoising = False\n"
            "scene.render.resolution_x = scene.render.resolution_y = %d\n"
            "scene.view_settings.view_transform = \"Standard\"\n"
            "scene.render.filepath = os.path.join(here, \"blender.png\")\n"
            "bpy.ops.render.render(write_still=True)\n",
            file->name, cli_bundle_irradiance(b), l.x, -l.z, l.y, CLI_BUNDLE_FOV_DEG, CLI_BUNDLE_EYE, b->side);
}

static void put_three(const cli_bundle *b, const cli_bundle_file *file, FILE *out) {
    const gonio_vec3 l = cli_bundle_light();
    fprintf(out,
            "<!doctype html>\n<meta charset=\"utf-8\">\n<title>Gonio: glTF material in three.js</title>\n"
            "<!-- npm install three, in this folder; python3 -m http.server in the one above; then\n"
            "     http://localhost:8000/scenes/three.html. Written by Gonio. -->\n"
            "<script type=\"importmap\">\n{\"imports\": {\"three\": \"./node_modules/three/build/three.module.js\",\n"
            "  \"three/addons/\": \"./node_modules/three/examples/jsm/\"}}\n</script>\n<script type=\"module\">\n"
            "import * as THREE from \"three\";\nimport { GLTFLoader } from \"three/addons/loaders/GLTFLoader.js\";\n"
            "const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });\n"
            "renderer.setSize(%d, %d);\ndocument.body.append(renderer.domElement);\n"
            "const scene = new THREE.Scene();\nconst eye = new THREE.PerspectiveCamera(%.6g, 1, 0.1, 10);\n"
            "eye.position.z = %g;\nconst light = new THREE.DirectionalLight(0xffffff, %.9g);\n"
            "light.position.set(%.9g, %.9g, %.9g);\nscene.add(light);\n"
            "const gltf = await new GLTFLoader().loadAsync(\"../formats/%s\");\nlet material;\n"
            "gltf.scene.traverse((node) => { material = node.material ?? material; });\n"
            "scene.add(new THREE.Mesh(new THREE.SphereGeometry(1, 256, 128), material));\n"
            "renderer.render(scene, eye);\nwindow.rendered = true;\n</script>\n",
            b->side, b->side, CLI_BUNDLE_FOV_DEG, CLI_BUNDLE_EYE, cli_bundle_irradiance(b), l.x, l.y, l.z, file->name);
}

static const struct {
    const char *name, *format, *file; // of the scene; the table it shows
    put_fn *put;
} scenes[] = {{"scenes/mitsuba.xml", "rgl", "rgl-rgb.bsdf", put_mitsuba},
              {"scenes/pbrt.pbrt", "rgl", "rgl-spectra.bsdf", put_pbrt},
              {"scenes/radiance.rad", "radiance", "radiance-tree.xml", put_radiance},
              {"scenes/radiance.sh", "radiance", "radiance-tree.xml", put_radiance_script},
              {"scenes/blender.py", "principled", NULL, put_blender},
              {"scenes/three.html", "gltf", NULL, put_three}};

gonio_status cli_bundle_scenes(const cli_bundle *bundle, gonio_error *error) {
    gonio_status status = GONIO_OK;
    for (size_t k = 0; k < sizeof scenes / sizeof *scenes && status == GONIO_OK; k++) {
        const cli_bundle_file *file = cli_bundle_find(bundle, scenes[k].format, scenes[k].file);
        gonio_output *output;
        if (file == NULL) {
            continue;
        }
        status = cli_bundle_open(bundle, scenes[k].name, &output, error);
        if (status == GONIO_OK) {
            scenes[k].put(bundle, file, gonio_output_stream(output));
            status = cli_bundle_close(output, scenes[k].name, error);
        }
    }
    return status;
}
