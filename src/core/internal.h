/* internal.h - what the files of the core share and nobody else sees: memory, byte order, checksum, sentences. */
#ifndef RQT_INTERNAL_H
#define RQT_INTERNAL_H

#include "rqt.h"

#include <string.h>

/* One binary for every machine: loops that compilers vectorise, for wide instructions and for any processor, with
 * the same results (no operation is fused). All that such a function calls must be compiled into it. Sanitizers
 * cannot follow the choice at load time: their build runs the plain loops. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__) && !defined(RQT_SCALAR)
#define VECTOR_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define VECTOR_CLONES
#endif

static inline void *memory_take(const rqt_allocator *a, size_t bytes) {
    return a->resize(a->context, NULL, bytes ? bytes : 1);
}
static inline void memory_drop(const rqt_allocator *a, void *p) {
    if (p) (void)a->resize(a->context, p, 0);
}
/* Grow an array to hold at least `need` elements of `size` bytes; doubles. False: no memory, nothing changed. */
static inline bool memory_grow(const rqt_allocator *a, void **array, size_t *capacity, size_t need, size_t size) {
    if (need <= *capacity) return true;
    size_t wanted = *capacity ? *capacity : 64;
    while (wanted < need) {
        if (wanted > SIZE_MAX / 2) return false;
        wanted *= 2;
    }
    if (wanted > SIZE_MAX / size) return false;
    void *p = a->resize(a->context, *array, wanted * size);
    if (!p) return false;
    *array = p;
    *capacity = wanted;
    return true;
}

/* Little-endian bytes; the only place that knows the byte order. */
static inline void put16(uint8_t *p, uint16_t v) {
    p[0] = (uint8_t)v;
    p[1] = (uint8_t)(v >> 8);
}
static inline void put32(uint8_t *p, uint32_t v) {
    put16(p, (uint16_t)v);
    put16(p + 2, (uint16_t)(v >> 16));
}
static inline void put64(uint8_t *p, uint64_t v) {
    put32(p, (uint32_t)v);
    put32(p + 4, (uint32_t)(v >> 32));
}
static inline void put_double(uint8_t *p, double v) {
    uint64_t bits;
    memcpy(&bits, &v, 8);
    put64(p, bits);
}
static inline uint16_t get16(const uint8_t *p) {
    return (uint16_t)(p[0] | p[1] << 8);
}
static inline uint32_t get32(const uint8_t *p) {
    return (uint32_t)get16(p) | (uint32_t)get16(p + 2) << 16;
}
static inline uint64_t get64(const uint8_t *p) {
    return (uint64_t)get32(p) | (uint64_t)get32(p + 4) << 32;
}
static inline double get_double(const uint8_t *p) {
    uint64_t bits = get64(p);
    double v;
    memcpy(&v, &bits, 8);
    return v;
}

/* FORMAT.md, "Checksum", with the 8 bytes at `field` taken as zero (field is a multiple of 8). checksum.c */
uint64_t checksum64(const uint8_t *bytes, size_t size, size_t field);

/* What the header of every mesh format says alike, at offsets 32 to 111 (FORMAT.md, "Mesh"). mesh_format.c */
typedef struct mesh_frame {
    rqt_placement placement;
    rqt_unit unit;
    int32_t srid;
    double eps;
} mesh_frame;
void mesh_frame_put(const mesh_frame *frame, uint8_t *bytes);
mesh_frame mesh_frame_get(const uint8_t *bytes);
bool placement_is_valid(const rqt_placement *placement);

/* Put a sentence together; cuts what does not fit. message may be NULL. sentence.c */
void sentence_begin(rqt_message *message, const char *text);
void sentence_add(rqt_message *message, const char *text);
void sentence_add_integer(rqt_message *message, int64_t value);

/* The smallest code not below a double, taken at its word (0 for anything not above 0). code.c */
rqt_code code_above(double metres);

/* Codes of many errors of one terrain: numerator / 2^shift quanta, exactly as rqt_code_from_quanta, in the common
 * case with one multiplication. shift 0 .. 42. code.c */
typedef struct code_scale {
    rqt_unit unit;
    double factor; /* metres per quantum, as near as a double comes */
    bool exact;    /* it is a power of two */
} code_scale;
void code_scale_init(code_scale *scale, const rqt_unit *unit);
rqt_code code_of_binary(const code_scale *scale, uint64_t numerator, int shift);

static inline double bits_double(uint64_t bits) {
    double v;
    memcpy(&v, &bits, 8);
    return v;
}

/* One of the root's four corners? */
static inline bool lattice_is_corner(const rqt_lattice *lattice, rqt_vertex v) {
    const int32_t side = 1 << lattice->K;
    return (v.x == 0 || v.x == side) && (v.y == 0 || v.y == side);
}

/* Does the diamond of a vertex have an area on the raster? Without one, past the last column or row, no triangle of
 * a mesh has it for a corner; its error is not looked at when blocks are made (block_settle_past), so that what is
 * stored does not depend on how far past the raster somebody looked. The root's corners always count. */
static inline bool lattice_has_area(const rqt_lattice *lattice, rqt_vertex v) {
    if (lattice_is_corner(lattice, v)) return true;
    const int32_t q = (v.x | v.y) & -(v.x | v.y);
    return v.x - q < lattice->width - 1 && v.y - q < lattice->height - 1;
}

/* The errors of a block's vertices whose diamonds have no area, which are 0 on entry: from those that depend on
 * them in the block. block.c */
void block_settle_past(rqt_block *block);

/* Bits of x in the even places, of y in the odd ones; and back: y is morton_x(code >> 1). lattice.c */
uint64_t morton_code(uint32_t x, uint32_t y);
uint32_t morton_x(uint64_t code);

/* Where column x (0 .. 2^K) of the lattice sits in the arrays of rqt_errors; -1 when it is past the last sample and
 * no error can reach it. lattice.c */
int32_t lattice_slot(int32_t x, int32_t samples);
int32_t lattice_slots(const rqt_lattice *lattice, int32_t samples); /* how many there are */

#endif
