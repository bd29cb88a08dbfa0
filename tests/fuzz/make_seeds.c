// SPDX-License-Identifier: BSD-3-Clause
// Small sound files to begin fuzzing from. usage: make_seeds read|model|spec|plan FOLDER
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/conformance/make_kind.h"
#include "gonio/fit.h"
#include "gonio/io.h"
#include "tests/format_files.h"

static void put(const char *folder, const char *name, const void *data, size_t size) {
    char path[600];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "wb");
    if (file == NULL || fwrite(data, 1, size, file) != size || fclose(file) != 0) {
        fprintf(stderr, "cannot write %s\n", path);
        exit(1);
    }
}

static void put_text(const char *folder, const char *name, const char *text) { put(folder, name, text, strlen(text)); }

static void put_readable(const char *folder) {
    format_file files[FORMAT_FILES];
    format_bytes rgl;
    format_files(files, &rgl);
    for (int k = 0; k < FORMAT_FILES; k++) {
        put(folder, files[k].name, files[k].data, files[k].size);
    }
    put(folder, "merl", "\x5a\0\0\0\x5a\0\0\0\xb4\0\0\0\0\0\0\0\0\0\0\0", 20);
}

// A model of every kind in every form that its file takes.
static void put_model(const char *folder) {
    kind_maker maker;
    for (size_t m = 0; kind_maker_at(m, &maker); m++) {
        gonio_model *model = kind_make(&maker, true, 1);
        gonio_error error = {0};
        char path[600];
        snprintf(path, sizeof path, "%s/%s-%zu", folder, maker.kind, m);
        if (gonio_model_save(model, path, &error) != GONIO_OK) {
            simulate_die(&error);
        }
        gonio_model_free(model);
    }
}

int main(int argc, char **argv) {
    if (argc != 3) {
        return 2;
    }
    const char *what = argv[1], *folder = argv[2];
    if (strcmp(what, "read") == 0) {
        put_readable(folder);
    } else if (strcmp(what, "model") == 0) {
        put_model(folder);
    } else if (strcmp(what, "spec") == 0) {
        put_text(folder, "a", "ward:rho_d=0.3/0.2/0.1,rho_s=0.2,alpha=0.15,shape=sphere,radius_mm=20");
        put_text(folder, "b", "lambert:rho=0.5+ggx:rho_s=1e-3,alpha_x=0.1,alpha_y=0.3,f0=0.04");
        put_text(folder, "c", "cook-torrance:rho_s=1,m=0.3+blinn-phong:rho_s=0.1,n=100+oren-nayar:rho=1,sigma_deg=20");
    } else {
        put_text(folder, "a", "theta_i,phi_i,theta_o,phi_o\n1,2,3,4\n# c\n10.5,-180,89.9,360\n");
        put_text(folder, "b", "10,theta_max=75,anisotropic=1");
    }
    return 0;
}
