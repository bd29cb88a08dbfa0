// SPDX-License-Identifier: BSD-3-Clause
// README.md of a bundle: what each file is, how it is used, how far it lies from the model, and the frame.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "gonio/version.h"
#include "host/cli/bundle/bundle.h"

// For whom a file is.
static const struct {
    const char *format, *name, *use;
} uses[] = {
    {"rgl", "rgl-rgb.bsdf", "Mitsuba 3, `measured` in rgb variants"},
    {"rgl", "rgl-spectra.bsdf", "pbrt-v4, `measured`; Mitsuba 3 in spectral variants"},
    {"radiance", "radiance-tree.xml", "Radiance, `BSDF`"},
    {"radiance", "radiance-klems.xml", "LBNL WINDOW, Radiance's matrix methods"},
    {"merl", NULL, "programs that read MERL tables (Disney BRDF Explorer, ...)"},
    {"mbsdf", NULL, "NVIDIA MDL: Iray, Omniverse, V-Ray, Substance"},
    {"zemax", NULL, "Ansys Zemax OpticStudio"},
    {"lighttools", NULL, "LightTools"},
    {"ssdd", NULL, "BSDFProcessor, libbsdf"},
    {"astm", NULL, "programs that read ASTM E1392 and E2387"},
    {"speos", NULL, "Ansys Speos"},
    {"openmaterial", NULL, "ASAM OpenMATERIAL 3D: driving simulators"},
    {"gltf", NULL, "three.js and everything that reads glTF 2.0"},
    {"openpbr", NULL, "MaterialX: Arnold, Maya, Houdini ..."},
    {"principled", NULL, "Blender: Cycles and Eevee"},
};

static const char *use_of(const cli_bundle_file *file) {
    for (size_t k = 0; k < sizeof uses / sizeof *uses; k++) {
        if (strcmp(uses[k].format, file->format) == 0 &&
            (uses[k].name == NULL || strcmp(uses[k].name, file->name) == 0)) {
            return uses[k].use;
        }
    }
    return "";
}

static void put_number(FILE *out, const char *format, double value) {
    if (isfinite(value)) {
        fprintf(out, format, value);
    }
    fputs(" | ", out);
}

static void put_table(const cli_bundle *b, FILE *out) {
    fputs("## formats/\n\nEach file beside its `.report.json`: quantity, convention, range, what the format does not "
          "hold. Errors are relative, of the file as Gonio reads it back against the model, at 20,000 pairs up to "
          "80 deg (*: at the file's own nodes); the picture's is the mean difference of a sphere, of 255.\n\n"
          "| file | for | MB | median | p95 | albedo at 45 deg | picture |\n|---|---|---|---|---|---|---|\n",
          out);
    for (int k = 0; k < b->n; k++) {
        const cli_bundle_file *f = &b->files[k];
        const gonio_write_report *r = &f->result.report;
        if (!f->written) {
            continue;
        }
        fprintf(out, "| `%s` | %s | %.3g | ", f->name, use_of(f), (double)r->bytes / 1e6);
        fprintf(out, "%.2g%s | %.2g | ", r->median, r->at_its_nodes ? "*" : "", r->p95);
        put_number(out, "%+.2g %%", r->at_its_nodes ? NAN : 100 * r->albedo_error[2]);
        put_number(out, "%.2g", f->result.image);
        fputc('\n', out);
    }
    for (int k = 0; k < b->n; k++) {
        if (!b->files[k].written) {
            fprintf(out, "\nNot written: `%s`: %s.\n", b->files[k].name, b->files[k].refused);
        }
    }
}

static const char frame[] =
    "\n## The frame\n\n![Directions](frame.svg)\n\n- z is the sample's normal, x its mark. theta is measured from z, "
    "phi from x toward y. Light (`_i`) and camera (`_o`) directions point away from the sample; with phi_i = 0 the "
    "mirror direction is at phi_o = 180 deg.\n- Values are f_r in 1/sr: radiance over irradiance, without a cosine.\n- "
    "On a surface with texture coordinates x is the direction in which u grows: `dp/du` of Mitsuba and pbrt, the "
    "tangent of glTF and Blender. Radiance takes the `up` of its BSDF primitive for y.\n";

static void put_scenes(const cli_bundle *b, FILE *out) {
    fprintf(out,
            "\n## scenes/\n\nThe same sphere, light and eye as `pictures/sphere.png` (exposure %+.2f EV: a white "
            "diffuser that faces the light has the linear value %.4g), so that pictures can be compared. Run them in "
            "that folder.\n\n",
            b->exposure_ev, exp2(b->exposure_ev));
    if (cli_bundle_find(b, "rgl", "rgl-rgb.bsdf") != NULL) {
        fputs("- **Mitsuba 3**: `mitsuba -m scalar_rgb mitsuba.xml`\n- **pbrt-v4**: `pbrt pbrt.pbrt`. It refuses the "
              "rgb file.\n",
              out);
    }
    if (cli_bundle_find(b, "radiance", NULL) != NULL) {
        fputs("- **Radiance**: `sh radiance.sh`. The numbers at the end of `void BSDF` are a diffuse part that is not "
              "in the XML: Radiance loses the colour of a tree that holds one.\n",
              out);
    }
    if (cli_bundle_find(b, "principled", NULL) != NULL) {
        fputs("- **Blender**: `blender -b -P blender.py`; `formats/principled.py` alone makes the material.\n", out);
    }
    if (cli_bundle_find(b, "gltf", NULL) != NULL) {
        fputs("- **three.js**: `npm install three` there, `python3 -m http.server` in the folder above, then "
              "<http://localhost:8000/scenes/three.html>.\n",
              out);
    }
}

static void put_head(const cli_bundle *b, FILE *out) {
    fprintf(out, "# A measured BRDF, for every program\n\nWritten by Gonio %s from `%s`: %s, %s, %d channel%s.\n\n",
            GONIO_VERSION, b->source, b->model->ops->kind, b->model->isotropic ? "isotropic" : "anisotropic",
            b->model->channels, b->model->channels == 1 ? "" : "s");
    if (b->fitted != NULL) {
        const json_t *held = json_object_get(b->fitted, "held_out");
        fprintf(out,
                "The model was fitted to %" JSON_INTEGER_FORMAT " samples by the default method (%s %s); median error "
                "on samples that it had not seen: %.3g %%.\n\n",
                json_integer_value(json_object_get(b->fitted, "samples")),
                json_string_value(json_object_get(b->fitted, "method")),
                json_string_value(json_object_get(b->fitted, "options")),
                100 * json_number_value(json_object_get(held, "median_rel")));
    }
    fputs("| | |\n|---|---|\n", out);
    if (b->has_model) {
        fputs("| `model.gonio` | the model itself: `gonio eval`, `render`, `convert`; in C libgonio-eval |\n", out);
    }
    fprintf(out, "| `samples.csv` | %zu samples%s, degrees and 1/sr |\n", b->sampled,
            b->samples != NULL ? " that it was fitted to" : " of it");
    fputs(
        "| `formats/` | the same for other programs |\n| `scenes/` | a ready scene for each renderer |\n| `pictures/` "
        "| what they should look like |\n| `report.json` | all of this for programs |\n\n![A lit sphere]"
        "(pictures/sphere.png)\n\n",
        out);
    if (b->strip[0] != 0) {
        fprintf(out, "![The same from the files](pictures/formats.png)\n\n*From the left: %s.*\n\n", b->strip);
    }
}

static void put_about(const cli_bundle *b, FILE *out) {
    if (b->model->about != NULL && b->model->about[0] != 0) {
        fputs("\n## What is known of the measurement\n\n```\n", out);
        for (const char *c = b->model->about; *c != 0; c++) {
            fputc(*c == '`' ? '\'' : *c, out);
        }
        fputs("```\n", out);
    }
}

gonio_status cli_bundle_readme(const cli_bundle *bundle, gonio_error *error) {
    gonio_output *output;
    const gonio_status status = cli_bundle_open(bundle, "README.md", &output, error);
    if (status != GONIO_OK) {
        return status;
    }
    FILE *out = gonio_output_stream(output);
    put_head(bundle, out);
    put_table(bundle, out);
    fputs(frame, out);
    put_scenes(bundle, out);
    put_about(bundle, out);
    return cli_bundle_close(output, "README.md", error);
}
