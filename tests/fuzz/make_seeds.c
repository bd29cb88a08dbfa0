// Small sound files to begin fuzzing from. usage: make_seeds read|model|spec|plan FOLDER
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/conformance/make_kind.h"

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

typedef struct bytes {
    unsigned char data[8192];
    size_t size;
} bytes;

static void number(bytes *b, unsigned long long value, int size) {
    for (int k = 0; k < size; k++) {
        b->data[b->size++] = (unsigned char)(value >> (8 * k));
    }
}

// An RGL file of two incident angles and 3 x 3 tables, all ones.
static void put_rgl(const char *folder) {
    static const struct {
        const char *name;
        int ndim;
        unsigned shape[5], count;
    } fields[] = {{"phi_i", 1, {1}, 1},  {"theta_i", 1, {2}, 2},        {"sigma", 2, {3, 3}, 9},
                  {"ndf", 2, {3, 3}, 9}, {"vndf", 4, {1, 2, 3, 3}, 18}, {"rgb", 5, {1, 2, 3, 3, 3}, 54}};
    bytes b = {.size = 0};
    memcpy(b.data, "tensor_file\0\1\0", 14);
    b.size = 14;
    number(&b, 6, 4);
    size_t offset = 1024;
    for (int k = 0; k < 6; k++) {
        number(&b, strlen(fields[k].name), 2);
        memcpy(b.data + b.size, fields[k].name, strlen(fields[k].name));
        b.size += strlen(fields[k].name);
        number(&b, (unsigned)fields[k].ndim, 2);
        number(&b, 10, 1);
        number(&b, offset, 8);
        for (int d = 0; d < fields[k].ndim; d++) {
            number(&b, fields[k].shape[d], 8);
        }
        for (unsigned i = 0; i < fields[k].count; i++) {
            const float value = k == 1 ? (float)i : 1;
            memcpy(b.data + offset, &value, 4);
            offset += 4;
        }
    }
    put(folder, "rgl", b.data, offset);
}

static void put_readable(const char *folder) {
    put_text(folder, "samples",
             "# anisotropic\ntheta_i,phi_i,theta_o,phi_o,r,g,sigma_r,sigma_g,sigma_random_r,"
             "sigma_random_g,sigma_systematic_r,sigma_systematic_g\n"
             "10,0,20.5,180,1,2,5,5,3,3,4,4\n0,0,90,-90,1e-3,-2,0,0,0,0,0,0\n");
    put_text(folder, "plain", "theta_i,phi_i,theta_o,phi_o,550nm\n10,0,20.5,180,1\n");
    put_text(folder, "cornell", "# a\n2\n400 500\n0.1 0 0.2 3.141593 1 2\n1.570796 0 0.3 0 0 0.5\n");
    put_text(folder, "nist",
             "lambda,thetai,phi,thetar,phir,f,a,b,c,d,e,f,g,h,i,j,k,l,m,n,o\n"
             "0.5,-10,0,20,30,1,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n"
             "0.6,-10,0,20,30,2,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n");
    put_text(folder, "retro", "#SAMPLE\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n0.26 0.26 0 72.5\n0.26 -1.57 0 1e-3\n");
    put(folder, "merl", "\x5a\0\0\0\x5a\0\0\0\xb4\0\0\0\0\0\0\0\0\0\0\0", 20);
    put_rgl(folder);
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
