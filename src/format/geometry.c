/* geometry.c - triangles and rings as WKB, as GeoPackage geometries and as SpatiaLite BLOBs. All little-endian.
 *
 *   wkb         01, u32 1006 (ISO MULTIPOLYGON Z), u32 count, and for each triangle a POLYGON Z:
 *               01, u32 1003, u32 1 ring, u32 4 points, 4 times x,y,z; a POINT Z: 01, u32 1001, x,y,z
 *   gpkg        'GP', version 0, flags, i32 srs_id, [min x, max x, min y, max y], then the same WKB. Flags: 1
 *               little-endian, 2 envelope of x and y, 0x10 empty, which has no envelope; nor has a point
 *   spatialite  00 01, i32 srid, min x, min y, max x, max y, 7C, u32 1006, u32 count, and for each triangle an
 * entity: 69, u32 1003, u32 1 ring, u32 4 points, 4 times x,y,z; at the end FE
 *
 * Rings keep the order of the triangle, counter-clockwise. Triangles that share an edge make a multipolygon that is
 * not "valid" in the sense of the standard: it carries a surface here, and is read as that.
 *
 * No SRID is -1 (undefined) in a GeoPackage, where 0 would mean degrees, and 0 (unknown) in SpatiaLite, its own
 * default.
 *
 * Empty in SpatiaLite: the format knows no empty geometry, its functions return NULL instead. mod_spatialite 5.0
 * does read a count of 0, keeps its SRID, lets it into a MULTIPOLYGON XYZ column and says ST_IsEmpty 1,
 * ST_NumGeometries 0, AsText 'GEOMETRYCOLLECTION Z()' and ST_IsValid 0; OGR reads MULTIPOLYGON EMPTY. Its box is
 * four NaN: with numbers the spatial index would hold a row where nothing is (and CheckSpatialIndex complain), with
 * NaN it holds none.
 */
#include "internal.h"

#include <math.h>

enum { POLYGON = 3, MULTIPOLYGON = 6, POINT_Z = 1001, POLYGON_Z = 1003, MULTIPOLYGON_Z = 1006 };
enum {
    WKB_HEAD = 9,       /* byte order, type, count */
    TRIANGLE = 13 + 96, /* head, ring count, point count; four points */
    GPKG_HEAD = 8,
    ENVELOPE = 32,
    SPATIALITE_HEAD = 2 + 4 + ENVELOPE + 1 + 8
};

uint64_t geometry_size(format_kind kind, uint64_t triangles) {
    if (kind == FORMAT_SPATIALITE) return SPATIALITE_HEAD + TRIANGLE * triangles + 1;
    uint64_t head = kind == FORMAT_WKB ? 0 : triangles ? GPKG_HEAD + ENVELOPE : GPKG_HEAD;
    return head + WKB_HEAD + TRIANGLE * triangles;
}

static uint8_t *put_xyz(uint8_t *p, const double xyz[3]) {
    for (int i = 0; i < 3; i++) p = put_double(p, xyz[i]);
    return p;
}

/* mark: WKB's byte order, or SpatiaLite's mark of an entity; the rest is the same. */
static uint8_t *put_triangle(uint8_t *p, unsigned mark, const double xyz[3][3]) {
    p = put_byte(p, mark);
    p = put_u32(p, POLYGON_Z);
    p = put_u32(p, 1);
    p = put_u32(p, 4);
    for (int i = 0; i < 4; i++) p = put_xyz(p, xyz[i % 3]);
    return p;
}

enum { GPKG_PLAIN = 0x01, GPKG_BOXED = 0x03, GPKG_EMPTY = 0x11 };

/* box: with GPKG_BOXED only. */
static uint8_t *put_gpkg_head(uint8_t *p, unsigned flags, int32_t srid, const format_box *box) {
    p = put_byte(p, 'G');
    p = put_byte(p, 'P');
    p = put_byte(p, 0);
    p = put_byte(p, flags);
    p = put_u32(p, (uint32_t)(srid ? srid : -1));
    if (flags != GPKG_BOXED) return p;
    p = put_double(p, box->min_x);
    p = put_double(p, box->max_x);
    p = put_double(p, box->min_y);
    return put_double(p, box->max_y);
}

/* NaN with the same bits on every machine. */
static uint8_t *put_nan(uint8_t *p) {
    p = put_u32(p, 0);
    return put_u32(p, 0x7FF80000u);
}

static uint8_t *put_spatialite_head(uint8_t *p, int32_t srid, const format_box *box) {
    p = put_byte(p, 0x00);
    p = put_byte(p, 0x01);
    p = put_u32(p, (uint32_t)srid);
    if (box) {
        p = put_double(p, box->min_x);
        p = put_double(p, box->min_y);
        p = put_double(p, box->max_x);
        p = put_double(p, box->max_y);
    } else {
        for (int i = 0; i < 4; i++) p = put_nan(p);
    }
    return put_byte(p, 0x7C);
}

static void box_begin(format_box *box, double x, double y) {
    box->min_x = box->max_x = x;
    box->min_y = box->max_y = y;
}

static void box_add(format_box *box, double x, double y) {
    if (x < box->min_x) box->min_x = x;
    if (x > box->max_x) box->max_x = x;
    if (y < box->min_y) box->min_y = y;
    if (y > box->max_y) box->max_y = y;
}

/* The triangles come first, behind room for the head, which needs their box. */
bool geometry_write(format_kind kind, const format_mesh *mesh, uint8_t *bytes) {
    const bool spatialite = kind == FORMAT_SPATIALITE;
    const size_t count = mesh->triangle_count;
    uint8_t *p = bytes + geometry_size(kind, count) - TRIANGLE * count - (spatialite ? 1 : 0);
    format_box box = {0, 0, 0, 0};
    for (size_t t = 0; t < count; t++) {
        double xyz[3][3];
        for (size_t i = 0; i < 3; i++) {
            if (!mesh_coordinates(mesh, mesh->triangles[3 * t + i], xyz[i])) return false;
            if (t == 0 && i == 0) box_begin(&box, xyz[i][0], xyz[i][1]);
            box_add(&box, xyz[i][0], xyz[i][1]);
        }
        p = put_triangle(p, spatialite ? 0x69 : 1, xyz);
    }
    if (spatialite) (void)put_byte(p, 0xFE);
    p = bytes;
    if (spatialite)
        p = put_spatialite_head(p, mesh->srid, count ? &box : NULL);
    else {
        if (kind == FORMAT_GPKG) p = put_gpkg_head(p, count ? GPKG_BOXED : GPKG_EMPTY, mesh->srid, &box);
        p = put_byte(p, 1);
    }
    p = put_u32(p, MULTIPOLYGON_Z);
    (void)put_u32(p, (uint32_t)count);
    return true;
}

size_t format_triangle_gpkg(const double xyz[3][3], int32_t srid, uint8_t bytes[FORMAT_TRIANGLE_BYTES]) {
    format_box box;
    box_begin(&box, xyz[0][0], xyz[0][1]);
    for (int i = 1; i < 3; i++) box_add(&box, xyz[i][0], xyz[i][1]);
    return (size_t)(put_triangle(put_gpkg_head(bytes, GPKG_BOXED, srid, &box), 1, xyz) - bytes);
}

size_t format_point_gpkg(const double xyz[3], int32_t srid, uint8_t bytes[FORMAT_POINT_BYTES]) {
    uint8_t *p = put_gpkg_head(bytes, GPKG_PLAIN, srid, NULL);
    p = put_byte(p, 1);
    p = put_u32(p, POINT_Z);
    return (size_t)(put_xyz(p, xyz) - bytes);
}

rqt_status format_polygons_gpkg(const double *xy, const size_t *ring_points, const unsigned char *ring_is_shell,
                                size_t rings, int32_t srid, const rqt_allocator *allocator, uint8_t **bytes,
                                size_t *size) {
    *bytes = NULL;
    *size = 0;
    uint64_t polygons = 0, total = GPKG_HEAD + ENVELOPE;
    if (rings < 1 || !ring_is_shell[0]) return RQT_INVALID;
    for (size_t r = 0; r < rings; r++) {
        if (ring_points[r] < 3 || ring_points[r] > FORMAT_LIMIT) return RQT_INVALID;
        if (ring_is_shell[r]) polygons++;
        total += (uint64_t)(ring_is_shell[r] ? WKB_HEAD + 4 : 4) + 16 * ((uint64_t)ring_points[r] + 1);
        if (total > FORMAT_LIMIT) return RQT_INVALID;
    }
    if (polygons > 1) total += (uint64_t)WKB_HEAD;
    if (total > FORMAT_LIMIT) return RQT_INVALID;

    format_box box;
    box_begin(&box, xy[0], xy[1]);
    const double *at = xy;
    for (size_t r = 0; r < rings; r++)
        for (size_t i = 0; i < ring_points[r]; i++, at += 2) {
            if (!isfinite(at[0]) || !isfinite(at[1])) return RQT_INVALID;
            box_add(&box, at[0], at[1]);
        }

    uint8_t *p = allocator->resize(allocator->context, NULL, (size_t)total);
    if (!p) return RQT_NO_MEMORY;
    *bytes = p;
    *size = (size_t)total;
    p = put_gpkg_head(p, GPKG_BOXED, srid, &box);
    if (polygons > 1) {
        p = put_byte(p, 1);
        p = put_u32(p, MULTIPOLYGON);
        p = put_u32(p, (uint32_t)polygons);
    }
    at = xy;
    for (size_t r = 0; r < rings; r++) {
        const size_t n = ring_points[r];
        if (ring_is_shell[r]) {
            uint32_t own = 1;
            while (r + own < rings && !ring_is_shell[r + own]) own++;
            p = put_byte(p, 1);
            p = put_u32(p, POLYGON);
            p = put_u32(p, own);
        }
        p = put_u32(p, (uint32_t)n + 1);
        for (size_t i = 0; i <= n; i++) { /* closed */
            p = put_double(p, at[2 * (i % n)]);
            p = put_double(p, at[2 * (i % n) + 1]);
        }
        at += 2 * n;
    }
    return RQT_OK;
}

rqt_status format_ring_gpkg(const double *xy, int n, int32_t srid, const rqt_allocator *allocator, uint8_t **bytes,
                            size_t *size) {
    const size_t points = n > 0 ? (size_t)n : 0;
    const unsigned char shell = 1;
    return format_polygons_gpkg(xy, &points, &shell, 1, srid, allocator, bytes, size);
}
