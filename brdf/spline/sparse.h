// SPDX-License-Identifier: BSD-3-Clause
// A control lattice of which most points are zero: the specular part of a CBMBA model.
//
// Two forms. Bricks: 4^3 control points behind a table of brick numbers, number 0 being the empty brick; a cell's 4^3
// points lie in at most 8 bricks, and a cell whose bricks are all empty costs the look at the table alone. Hash (Kameya
// 2002, chapter 6): a table of (key, values) behind a minimal perfect hash, with the key compared; a probe a control
// point.
#ifndef GONIO_BRDF_SPLINE_SPARSE_H
#define GONIO_BRDF_SPLINE_SPARSE_H

#include "brdf/spline/lattice_eval.h"
#include "brdf/spline/perfect_hash.h"

// X(identifier, number in model files, name, what it is).
#define GONIO_STORAGE_TABLE(X)                                                                                         \
    X(FLOAT, 0, "float", "bricks of float32")                                                                          \
    X(HALF, 1, "half", "bricks of IEEE half floats")                                                                   \
    X(BYTE, 2, "byte", "bricks of signed bytes with a float scale a brick and channel")                                \
    X(HASH, 3, "hash", "the thesis' hash of single control points, minimal (BDZ)")                                     \
    X(JENKINS, 4, "jenkins", "the same by Jenkins' one table, which is quicker; of anisotropic models too")

#define GONIO_STORAGE_ENUM(id, number, name, summary) GONIO_STORAGE_##id = number,
typedef enum gonio_storage { GONIO_STORAGE_TABLE(GONIO_STORAGE_ENUM) } gonio_storage;
#undef GONIO_STORAGE_ENUM
#define GONIO_STORAGE_COUNT(id, number, name, summary) +1
#define GONIO_STORAGES (0 GONIO_STORAGE_TABLE(GONIO_STORAGE_COUNT)) // how many there are

#define GONIO_BRICK_POINTS 64

// All arrays are borrowed or owned by whoever fills it.
typedef struct gonio_sparse {
    int dims, level, channels; // bricks: of 3 dimensions
    gonio_storage storage;
    size_t side;              // bricks a dimension
    size_t bricks;            // with the empty one
    const uint16_t *table;    // side^3 brick numbers
    const void *data;         // bricks x channels x 64 elements
    const float *scales;      // BYTE: bricks x channels
    size_t keys;              // HASH, JENKINS: control points kept
    size_t slots;             // of the two arrays below: keys, or more of JENKINS
    int key_bytes;            // 3 or 4
    const unsigned char *key; // slots x key_bytes, padded; all ones in an empty slot
    const float *values;      // slots x channels
    const void *packed;       // cmph_pack's block, or Jenkins' moves; its length
    size_t packed_length;
    gonio_perfect_hash hash; // read from packed
    gonio_jenkins_hash jenkins;
} gonio_sparse;

// Bytes of `slots` keys: those of 3 are read as 4, so there is more behind the last one.
static inline size_t gonio_sparse_key_array(int key_bytes, size_t slots) {
    return slots * (size_t)key_bytes + (key_bytes == 3 ? 4 : 0);
}

// Bytes that a key of this lattice needs; all ones stay free.
static inline int gonio_sparse_key_bytes(int dims, int level) {
    return gonio_lattice_count(dims, level) < 0xffffff ? 3 : 4;
}
static inline bool gonio_sparse_hashed(gonio_storage storage) { return storage >= GONIO_STORAGE_HASH; }
uint32_t gonio_sparse_key(const gonio_sparse *sparse, size_t slot);

static inline size_t gonio_sparse_side(int level) { return ((((size_t)1 << level) - 1) >> 2) + 2; }
size_t gonio_sparse_element(gonio_storage storage); // bytes of one control point in a brick
// Bytes that evaluation needs.
size_t gonio_sparse_bytes(const gonio_sparse *sparse);

// The sparse lattice at the position, added to values[channels].
void gonio_sparse_add(const gonio_sparse *sparse, const gonio_position *position, float *values);
// The share, 0 to 1, of what would be added that stands on control points which are there.
double gonio_sparse_covered(const gonio_sparse *sparse, const gonio_position *position);
uint16_t gonio_half_encode(float value); // round to nearest even; beyond the range: the largest
float gonio_half_decode(uint16_t half);

#endif
