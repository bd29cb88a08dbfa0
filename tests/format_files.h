// SPDX-License-Identifier: BSD-3-Clause
// Small sound files of the formats, made byte by byte from the formats' descriptions: for tests and fuzzing.
#ifndef GONIO_TESTS_FORMAT_FILES_H
#define GONIO_TESTS_FORMAT_FILES_H

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct format_file {
    const char *name, *format; // of the file; that reads it
    const void *data;
    size_t size;
} format_file;

typedef struct format_bytes {
    unsigned char data[8192];
    size_t size;
} format_bytes;

static inline void format_number(format_bytes *b, unsigned long long value, int size) {
    for (int k = 0; k < size; k++) {
        b->data[b->size++] = (unsigned char)(value >> (8 * k));
    }
}

// An RGL file of two incident angles and 3 x 3 tables, all ones.
static inline void format_rgl(format_bytes *b) {
    static const struct {
        const char *name;
        int ndim;
        unsigned shape[5], count;
    } fields[] = {{"phi_i", 1, {1}, 1},  {"theta_i", 1, {2}, 2},        {"sigma", 2, {3, 3}, 9},
                  {"ndf", 2, {3, 3}, 9}, {"vndf", 4, {1, 2, 3, 3}, 18}, {"rgb", 5, {1, 2, 3, 3, 3}, 54}};
    memset(b, 0, sizeof *b);
    memcpy(b->data, "tensor_file\0\1\0", 14);
    b->size = 14;
    format_number(b, 6, 4);
    size_t offset = 1024;
    for (int k = 0; k < 6; k++) {
        format_number(b, strlen(fields[k].name), 2);
        memcpy(b->data + b->size, fields[k].name, strlen(fields[k].name));
        b->size += strlen(fields[k].name);
        format_number(b, (unsigned)fields[k].ndim, 2);
        format_number(b, 10, 1);
        format_number(b, offset, 8);
        for (int d = 0; d < fields[k].ndim; d++) {
            format_number(b, fields[k].shape[d], 8);
        }
        for (unsigned i = 0; i < fields[k].count; i++) {
            const float value = k == 1 ? (float)i : 1;
            memcpy(b->data + offset, &value, 4);
            offset += 4;
        }
    }
    b->size = offset;
}

#define RADIANCE_BEGIN "<WindowElement><Optical><Layer><DataDefinition><IncidentDataStructure>"
#define RADIANCE_VISIBLE(basis)                                                                                        \
    "</DataDefinition><WavelengthData><Wavelength unit=\"Integral\">Visible</Wavelength><WavelengthDataBlock>"         \
    "<WavelengthDataDirection>Reflection Back</WavelengthDataDirection>" basis "<ScatteringData>\n"
#define RADIANCE_END                                                                                                   \
    "</ScatteringData></WavelengthDataBlock></WavelengthData></Layer></Optical></WindowElement>" // no line end: every
                                                                                                 // cut shows
#define RADIANCE_RING(low, high, n)                                                                                    \
    "<AngleBasisBlock><nPhis>" n "</nPhis><ThetaBounds><LowerTheta>" low "</LowerTheta><UpperTheta>" high              \
    "</UpperTheta></ThetaBounds></AngleBasisBlock>"

#define FORMAT_TABLE_COLUMNS "theta_i=theta_i,theta_o=theta_o,phi=phi,value=BRF" // of the file "table"

enum { FORMAT_FILES = 22, FORMAT_TEXTS = 18 };

enum { FORMAT_CURET = 205 };

// The table of directions that "curet" needs, in radians. The caller frees it.
static inline char *format_directions(void) {
    char *text = (char *)malloc(64 * FORMAT_CURET), *at = text;
    for (int m = 0; text != NULL && m < FORMAT_CURET; m++) {
        at += sprintf(at, "%d %.3f %.3f %.3f 0\n", m + 1, 0.007 * m, 0.03 * m - 3, 1.5 - 0.007 * m);
    }
    return text;
}

// rgl holds the bytes of the last file.
static inline void format_files(format_file files[FORMAT_FILES], format_bytes *rgl) {
    static const struct {
        const char *name, *format, *text;
    } texts[FORMAT_TEXTS] = {
        {"samples", "samples",
         "# anisotropic\ntheta_i,phi_i,theta_o,phi_o,r,g,sigma_r,sigma_g,sigma_random_r,"
         "sigma_random_g,sigma_systematic_r,sigma_systematic_g\n"
         "10,0,20.5,180,1,2,5,5,3,3,4,4\n0,0,90,-90,1e-3,-2,0,0,0,0,0,0\n"},
        {"plain", "samples", "theta_i,phi_i,theta_o,phi_o,550nm\n10,0,20.5,180,1\n# b\n\n12.5,0,30,180,0.25\n"},
        {"cornell", "cornell", "# a\n2\n400 500\n0.1 0 0.2 3.141593 1 2\n1.570796 0 0.3 0 0 0.5\n"},
        {"nist", "nist",
         "lambda,thetai,phii,thetar,phir,f_r11,a,b,c,d,e,f,g,h,i,j,k,l,m,n,o\n"
         "0.5,-10,0,20,30,1,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n"
         "0.5,-20,0,20,30,3,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n"
         "0.6,-10,0,20,30,2,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n"
         "0.6,-20,0,20,30,4,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n"},
        {"retro", "retro", "#SAMPLE\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n0.26 0.26 0 72.5\n0.26 -1.57 0 1e-3\n"},
        {"klems", "radiance",
         RADIANCE_BEGIN
         "Columns</IncidentDataStructure><AngleBasis><AngleBasisName>Own</AngleBasisName>" RADIANCE_RING("0", "30", "1")
             RADIANCE_RING("30", "90", "2") "</AngleBasis>" RADIANCE_VISIBLE(
                 "<ColumnAngleBasis>Own</ColumnAngleBasis><RowAngleBasis>Own</RowAngleBasis>") "1, 2, 3, \n4, 5, 6, "
                                                                                               "\n7, 8, "
                                                                                               "9\n" RADIANCE_END},
        {"zemax", "zemax",
         "# a\nSource Measured\nSymmetry PlaneSymmetrical\nSpectralContent Monochrome\nScatterType "
         "BRDF\nSampleRotation 1\n"
         "0\nAngleOfIncidence 2\n0 30\nScatterAzimuth 2\n0 180\nScatterRadial 2\n0 10\n\nMonochrome\nDataBegin\nTIS 0\n"
         "1 2\n3 4\nTIS 0\n5 6\n7 8\nDataEnd\n"},
        {"lighttools", "lighttools",
         "Symmetry PlaneSymmetrical\nSpectralContent Monochrome\nScatterAzimuth 2\n90 270\nScatterRadial 2\n0 30\n"
         "DataBegin\nAOI 30\nPOI 0\nSide Front\nWavelength 550\nScatterType BRDF\nTIS 0\n1 2\n3 4\nAOI 0\nSide Back\n"
         "ScatterType BTDF\nTIS 0\n0 0 0 0\nDataEnd\n"},
        {"ssdd", "ssdd",
         "VERSION 0.3\nSOFTWARE a\nDATA_TYPE brdf\nCOLOR_MODEL spectrum\nWAVELENGTH_LIST 450 550\nPARAM_TYPE "
         "specular_coordinate_system\nREDUCTION_TYPE bilateral_symmetry\nPARAM0_LIST 0 30\nPARAM2_LIST 0 10 # "
         "b\nPARAM3_LIST "
         "0 180\nDATA ascii\n1 2\n# c\n3 4\n5 6\n7 8\n9 10\n11 12\n13 14\n15 16\n"},
        {"ddr", "ddr",
         ";; a\nSource Measured\nTypeSym PlaneSymmetrical\nTypeColorModel BW\nTypeData Luminance Absolute\nsigma 2\n0 "
         "30\n"
         "phi 2\n0 180\ntheta 2\n0 10\nbw\nkbdf 0.5 0.25\ndef\n;; b\n1 2\n3 4\n5 6\n7 8\nenddef\n"},
        {"sdr", "sdr",
         ";; a\nSource Measured\nTypeColorModel RGB\nsigma 4\n0 30 60 90\nred\n def\n 0.04 0.05 0.1 1\n "
         "enddef\ngreen\n def\n"
         " 0.04 0.06 0.2 1\n enddef\nblue\n def\n 0.04 0.07 0.3 1\n enddef\n"},
        {"speos", "speos",
         "OPTIS - brdf surface file v8.0\n0\na comment\n8\ntwo\nbit\n1\t0\n1\n1\t2\n30\n450 550\n50\n2 2\n\t0\t180\n0 "
         "1 1\n90 1 1\n"
         "25\n2 2\n\t0\t180\n0 2 2\n90 2 2\n"},
        {"pab", "pab",
         "#sample_name \"a\"\n#format: theta phi DSF\n#intheta 30\n#inphi 180\n#colorimetry: CIE-Y\n60 0 0.5\n10.5 12 "
         "0.25\n"
         "120 0 3\n20 300 0.125\n"},
        {"astm", "astm",
         "a line\nNUM_POINTS 2\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B\n0.1,0,0.2,3,1,2,3\n0.5,0,0.2,3,4,5,6\n"},
        {"tree", "radiance",
         RADIANCE_BEGIN "TensorTree3</IncidentDataStructure>" RADIANCE_VISIBLE(
             "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>") "{{1}{2}{3}{4}{5 6 7 8 9 10 11 "
                                                           "12}{0.5}{0.25}{0.125}}\n" RADIANCE_END},
        {"alta", "alta",
         "# a note of nobody's\n#ALTA HEADER\n#DIM 3 3\n#PARAM_IN  RUSIN_TH_TD_PD\n#PARAM_OUT RGB_COLOR\n#VS 1 0 "
         "0\n#ALTA END HEADER\n"
         "0.1 0.2 0.3 1 2 3 0.5\n# b\n0.2\t0\t0\t4\t5\t6\t0.5\t\n1.5 1.2 0 7 8 9 0.5\n"},
        {"tracepro", "tracepro",
         "TracePro Surface Property Data\nFile Name\ta.txt\nTracePro Release: 7 0 0\nDatabase Version: 3 3 0\nData "
         "generated at "
         "12:00:00 May 1, 2020\n\nName\ta b\nCatalog\tc\nDescription\nCoating    1\nScatter    5\nInteraction    0\n"
         "Polarization   0\nUser_Data  1\nSolve\tBRDF\n\nTemperature\tWavelength\n300\t0.55\nTable_BSDF_Data\n"
         "Temperature\tWavelength\tIncAngle\tAziAngle\tScatterBeta\tScatterAzimuth\tBRDF\tBTDF\n"
         "300\t0.55\t30\t0\t0\t0\t2\t0\t\n300\t0.55\t30\t0\t0.25\t180\t1\t0\n300\t0.55\t30\t0\t0.75\t0\t1\t0\n"
         "300\t0.65\t30\t0\t0\t0\t3\t0\n300\t0.65\t30\t0\t0.25\t180\t1.5\t0\n300\t0.65\t30\t0\t0.75\t0\t1\t0\n"},
        {"table", "table",
         "Measured by hand\n\ntheta_i;theta_o;phi;BRF\n10;20,5;180;1,25\n10;30;180;0,5\n# b\n20;30;180;0,25\n"}};
    static const char mbsdf[] = "NVIDIA ARC MBSDF V1\nname=\"a\"\nMBSDF_DATA=\n"
                                "\0\0\0\0\1\0\0\0\2\0\0\0\0\0\x80\x3f\0\0\0\x3f";
    static const char stream[] = "#DIM 2 1\n#PARAM_IN COS_TH_TD\n#PARAM_OUT INV_STERADIAN\n#FORMAT binary\n#VERSION 0\n"
                                 "#PRECISION ieee754-double\n#SAMPLE_COUNT 1\n#VS 0\n#ENDIAN little\n#BEGIN_STREAM\n"
                                 "\0\0\0\0\0\0\xf0\x3f\0\0\0\0\0\0\xf0\x3f\0\0\0\0\0\0\xe0\x3f\n#END_STREAM";
    static char curet[8 * (FORMAT_CURET + 1)];
    int k = 0;
    for (; k < FORMAT_TEXTS; k++) {
        files[k] = (format_file){texts[k].name, texts[k].format, texts[k].text, strlen(texts[k].text)};
    }
    char *at = curet + sprintf(curet, "7");
    for (int m = 0; m < FORMAT_CURET; m++) {
        at += sprintf(at, " 0.%03d", m + 1);
    }
    at += sprintf(at, "\n");
    files[k++] = (format_file){"curet", "curet", curet, (size_t)(at - curet)};
    files[k++] = (format_file){"alta-stream", "alta", stream, sizeof stream - 1};
    files[FORMAT_FILES - 2] = (format_file){"mbsdf", "mbsdf", mbsdf, sizeof mbsdf - 1};
    format_rgl(rgl);
    files[FORMAT_FILES - 1] = (format_file){"rgl", "rgl", rgl->data, rgl->size};
}

// A UTIA table, which has one size only: number k is k / NUMBERS. The caller frees it.
enum { FORMAT_UTIA_NUMBERS = 3 * 288 * 288 };
static inline unsigned char *format_utia(void) {
    unsigned char *data = malloc(FORMAT_UTIA_NUMBERS * 8);
    for (int k = 0; data != NULL && k < FORMAT_UTIA_NUMBERS; k++) {
        const double value = (double)k / FORMAT_UTIA_NUMBERS;
        memcpy(data + 8 * k, &value, 8);
    }
    return data;
}

#endif
