/* internal.h - what the files of this room share and nobody else sees.
 *
 * format.c decides and allocates, text.c writes numbers, geometry.c writes polygons, glb.c models. Each format
 * knows its size before it writes; `put` functions take the place to write at and return the place after. */
#ifndef RQT_FORMAT_INTERNAL_H
#define RQT_FORMAT_INTERNAL_H

#include "format.h"

#include <string.h>

#define FORMAT_LIMIT 2147483647u /* bytes that SQLite can return */

/* The box of a geometry; of an empty one it does not matter. */
typedef struct format_box {
    double min_x, min_y, max_x, max_y;
} format_box;

static inline uint8_t *put_byte(uint8_t *p, unsigned v) {
    *p = (uint8_t)v;
    return p + 1;
}
static inline uint8_t *put_u16(uint8_t *p, unsigned v) {
    p[0] = (uint8_t)v;
    p[1] = (uint8_t)(v >> 8);
    return p + 2;
}
static inline uint8_t *put_u32(uint8_t *p, uint32_t v) {
    for (int i = 0; i < 4; i++) p[i] = (uint8_t)(v >> 8 * i);
    return p + 4;
}
static inline uint8_t *put_float(uint8_t *p, float v) {
    uint32_t bits;
    memcpy(&bits, &v, 4);
    return put_u32(p, bits);
}
static inline uint8_t *put_double(uint8_t *p, double v) {
    uint64_t bits;
    memcpy(&bits, &v, 8);
    for (int i = 0; i < 8; i++) p[i] = (uint8_t)(bits >> 8 * i);
    return p + 8;
}

/* Text that is counted, and written too when there are bytes to write to. text.c */
typedef struct sink {
    uint8_t *bytes; /* NULL: count only */
    uint64_t size;
} sink;
void add_bytes(sink *s, const char *text, size_t n);
void add_text(sink *s, const char *text);
void add_count(sink *s, uint64_t v);
void add_integer(sink *s, int64_t v);
void add_double(sink *s, double v);

/* Decimal digits of v, without end mark; returns their number, at most 20. text.c */
int format_digits(uint64_t v, char *text);

/* Bytes of the multipolygon of that many triangles: kind is wkb, gpkg or spatialite. At most 109 per triangle + 52;
 * triangles is at most FORMAT_LIMIT. geometry.c */
uint64_t geometry_size(format_kind kind, uint64_t triangles);
/* Writes exactly that many. False when a coordinate is not finite; the bytes are then no geometry. */
bool geometry_write(format_kind kind, const format_mesh *mesh, uint8_t *bytes);

/* What is known of a glb before its bytes. Arrays of three: along the model's X, Y, Z. glb.c */
typedef struct glb_layout {
    double origin[3];                     /* x,y,z of the model's 0,0,0 */
    double low[3], high[3];               /* metres about it */
    double step[3];                       /* quantized: metres of a unit */
    double deviation[3];                  /* metres: the largest distance of a vertex as kept from where it is */
    bool normals_are_short;               /* else float */
    uint64_t positions, normals, indices; /* bytes of each part, multiples of 4 but for the last */
    uint64_t text;                        /* of JSON, without padding */
    uint64_t total;                       /* of the file */
} glb_layout;

/* At least so many bytes does a glb have: known from the counts alone. */
uint64_t glb_size_from_counts(const format_mesh *mesh);
/* False when a coordinate is not finite, or no float. Counts and indices are sound. */
bool glb_plan(const format_mesh *mesh, glb_layout *layout);
/* Writes layout->total bytes. */
void glb_write(const format_mesh *mesh, const glb_layout *layout, uint8_t *bytes);
/* x,y,z of a vertex; are all three finite? */
bool mesh_coordinates(const format_mesh *mesh, size_t vertex, double xyz[3]);

#endif
