// SPDX-License-Identifier: BSD-3-Clause
#include <ctype.h>
#include <stdbool.h>
#include <string.h>

#include "io/fold.h"

static const char *const spellings[][2] = {
    {"ä", "ae"},    {"ö", "oe"},       {"ü", "ue"},     {"Ä", "ae"},       {"Ö", "oe"},          {"Ü", "ue"},
    {"ß", "ss"},    {"á", "a"},        {"à", "a"},      {"â", "a"},        {"ã", "a"},           {"é", "e"},
    {"è", "e"},     {"ê", "e"},        {"É", "e"},      {"í", "i"},        {"ì", "i"},           {"ó", "o"},
    {"ò", "o"},     {"ô", "o"},        {"ú", "u"},      {"ù", "u"},        {"ñ", "n"},           {"ç", "c"},
    {"θ", "theta"}, {"Θ", "theta"},    {"ϑ", "theta"},  {"φ", "phi"},      {"ϕ", "phi"},         {"Φ", "phi"},
    {"ψ", "psi"},   {"Δ", "delta"},    {"λ", "lambda"}, {"Λ", "lambda"},   {"π", "pi"},          {"σ", "sigma"},
    {"µ", "u"},     {"μ", "u"},        {"°", "deg"},    {"Å", "angstrom"}, {"±", "uncertainty"}, {"⁻", "-"},
    {"¹", "1"},     {"²", "2"},        {"−", "-"},      {"–", "-"},        {"—", "-"},           {"·", " "},
    {"×", "x"},     {"\xc2\xa0", " "}, {"₀", "0"},      {"ᵢ", "i"},        {"ᵣ", "r"},           {"ₒ", "o"}};

// How many bytes of the text the spelling stands for; 0: it has none.
static size_t spelling_of(const char *text, const char **to) {
    for (size_t k = 0; k < sizeof spellings / sizeof *spellings; k++) {
        const size_t n = strlen(spellings[k][0]);
        if (strncmp(text, spellings[k][0], n) == 0) {
            *to = spellings[k][1];
            return n;
        }
    }
    return 0;
}

void gonio_fold(const char *text, bool split, char *to, size_t size) {
    size_t n = 0;
    for (const char *c = text; *c != 0 && n + 1 < size;) {
        const char *spelling = NULL;
        const size_t bytes = (unsigned char)*c >= 128 ? spelling_of(c, &spelling) : 0;
        if (bytes > 0) {
            for (; *spelling != 0 && n + 1 < size; spelling++) {
                to[n++] = *spelling;
            }
            c += bytes;
            continue;
        }
        if (split && c > text && isupper((unsigned char)*c) && islower((unsigned char)c[-1]) && n + 2 < size) {
            to[n++] = ' ';
        }
        to[n++] = (char)tolower((unsigned char)*c++);
    }
    to[n] = 0;
}
