/* format.h - a mesh as bytes that other programs read: obj, ply, wkb, gpkg, spatialite, glb. (strip and indexed,
 * rqt's own, are the core's.) Knows the core's public header; prints into memory only. */
#ifndef RQT_FORMAT_H
#define RQT_FORMAT_H

#include "rqt.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum format_kind {
    FORMAT_OBJ,
    FORMAT_PLY,
    FORMAT_WKB,
    FORMAT_GPKG,
    FORMAT_SPATIALITE,
    FORMAT_GLB
} format_kind;

/* "obj" -> FORMAT_OBJ ...; false when it is none of these. */
bool format_from_name(const char *name, format_kind *kind);

/* What only a glb wants to know: it is a model, in metres, about an origin. */
typedef struct format_model {
    const char *frame;   /* "crs": coordinates are the terrain's; "enu", "ecef": metres, in space */
    const double *place; /* of "enu": longitude, latitude and height above the ellipsoid of 0,0,0; else NULL */
    bool is_about_place; /* 0,0,0 is the model's origin; else a place in the middle of the mesh is */
    double metre;        /* metres in a unit of x and y, > 0 */
    double step[3];      /* values of x, of y, of z are whole numbers of these apart; 0: they need not be */
    double quantum;      /* metres: a step of the terrain's heights */
    double tau;          /* of a view: pixels, achieved; else 0 */
    bool tau_is_guaranteed;
    bool quantized; /* positions in 16 bits (KHR_mesh_quantization) */
} format_model;

/* What turns a patch's integers into coordinates. */
typedef struct format_frame {
    rqt_placement placement;
    rqt_unit unit;
    int32_t srid;      /* 0: none */
    const char *title; /* terrain's name, for the formats that carry comments */
    double eps;
    const float *normals; /* as in format_mesh */
} format_frame;

/* x,y,z of a vertex: the one expression of the contract, in double, not fused. */
void format_coordinates(const format_frame *frame, const rqt_patch_vertex *vertex, double xyz[3]);

/* The shortest decimal text that reads back as exactly this double ("1", "-0.25", "1e+300"). text holds 32 bytes.
 * Returns its length. Independent of the locale. */
int format_double(double value, char text[32]);

/* A mesh whose corners have coordinates of any kind: samples of a patch, places between samples, metres about the
 * Earth's centre. This is the door for all of them; who has a patch takes format_patch below. */
typedef struct format_mesh {
    size_t vertex_count, triangle_count;
    const uint32_t *triangles; /* 3 * triangle_count numbers of vertices, counter-clockwise */
    /* x,y,z of vertex 0 .. vertex_count-1: the same each time it is asked, and it is asked more than once. */
    void (*coordinates)(const void *context, size_t vertex, double xyz[3]);
    const void *context;
    const float *normals; /* NULL, or three a vertex: properties nx ny nz of a ply, attribute NORMAL of a glb */
    const format_model *model; /* NULL, or of a glb, which needs it */
    int32_t srid;              /* of x and y; 0: none */
    const char *title;         /* NULL, or the terrain's name, for the formats that carry comments */
    double eps;
} format_mesh;

/* obj: text, "v x y z" with the shortest digits and "f a b c" (1-based). ply: binary little-endian, double x,y,z,
 * float nx,ny,nz where there are normals, int list of three. wkb: ISO MULTIPOLYGON Z (type 1006), every triangle a
 * closed ring of 4 points; gpkg: the same behind a GeoPackage header with an xy envelope (empty flag when empty);
 * spatialite: the same geometry as a SpatiaLite BLOB. glb: glTF 2.0, binary (FORMAT.md, "glb"). An empty mesh gives
 * a valid empty file. *bytes is released with allocator->resize(context, bytes, 0). RQT_INVALID when the result
 * would exceed 2^31-1 bytes (what SQLite can return), for an index that is no vertex's, and for a coordinate that
 * is not finite (one that is written). */
rqt_status format_write(const format_mesh *mesh, format_kind kind, const rqt_allocator *allocator, uint8_t **bytes,
                        size_t *size);
/* A patch as a mesh, as long as the source lives. */
typedef struct format_source {
    const rqt_patch *patch;
    const format_frame *frame;
} format_source;
format_mesh format_mesh_of(const format_source *source);
/* The same for a patch; no glb. */
rqt_status format_patch(const rqt_patch *patch, const format_frame *frame, format_kind kind,
                        const rqt_allocator *allocator, uint8_t **bytes, size_t *size);

/* A triangle as a GeoPackage POLYGON Z, with an xy envelope, and a point as a GeoPackage POINT Z: for rows with a
 * geometry each. They return the size, at most FORMAT_TRIANGLE_BYTES and FORMAT_POINT_BYTES. */
#define FORMAT_TRIANGLE_BYTES 160
#define FORMAT_POINT_BYTES 40
size_t format_triangle_gpkg(const double xyz[3][3], int32_t srid, uint8_t bytes[FORMAT_TRIANGLE_BYTES]);
size_t format_point_gpkg(const double xyz[3], int32_t srid, uint8_t bytes[FORMAT_POINT_BYTES]);

/* Polygons as a GeoPackage geometry with an xy envelope, a POLYGON or a MULTIPOLYGON: rings one after the other in
 * xy (two doubles a point, not closed), one with ring_is_shell begins a polygon. What rqt_corridor returns. */
rqt_status format_polygons_gpkg(const double *xy, const size_t *ring_points, const unsigned char *ring_is_shell,
                                size_t rings, int32_t srid, const rqt_allocator *allocator, uint8_t **bytes,
                                size_t *size);
/* The same of one ring. */
rqt_status format_ring_gpkg(const double *xy, int n, int32_t srid, const rqt_allocator *allocator, uint8_t **bytes,
                            size_t *size);

#ifdef __cplusplus
}
#endif
#endif
