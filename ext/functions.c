/* functions.c - the table of all SQL functions. What stands here is registered, helped with, documented and tested.
 *
 * Purity. Functions of their arguments alone are deterministic; those that read terrains are not, for terrains
 * change. All are innocuous: they read this connection's own databases, never a file of their own, and write
 * nothing; so views on them work with trusted_schema off. The examples run in the demo database.
 */
#include "functions.h"

#define PURE (SQLITE_DETERMINISTIC | SQLITE_INNOCUOUS)
#define READS SQLITE_INNOCUOUS

#define MESH "region, eps [, terrain [, options]]"
#define VIEW "camera [, terrain [, options]]"
#define CAMERA                                                                                              \
    "'{\"eye\":[-71.5,44.1,2500],\"at\":[-71.3033,44.2705,1500],\"fovy\":45,\"width\":1024,\"height\":768," \
    "\"tau\":2}'"
#define SUMMIT "rqt_circle(-71.3033, 44.2705, 5000)"

const function rqt_functions[] = {
    {.name = "rqt_version",
     .arguments = "",
     .returns = "TEXT",
     .purpose = "The version of rqt.",
     .example = "SELECT rqt_version()",
     .call = call_version,
     .flags = PURE},
    {.name = "rqt_build_info",
     .arguments = "",
     .returns = "TEXT",
     .purpose = "Version, stored format, compiler and libraries.",
     .example = "SELECT rqt_build_info()",
     .call = call_build_info,
     .flags = SQLITE_INNOCUOUS},
    {.name = "rqt_limit",
     .arguments = "name [, most]",
     .returns = "INTEGER",
     .purpose =
         "What one answer of this connection may be at most, for services: name triangles: of a mesh, and its "
         "vertices; samples: under the mesh of a proof. More is refused, with SQLITE_TOOBIG. 0, the default: any "
         "number. Gives the limit that held before.",
     .example = "SELECT rqt_limit('triangles')",
     .call = call_limit,
     .least = 1,
     .most = 2,
     .flags = SQLITE_DIRECTONLY}, /* changes the connection: not for views */
    {.name = "rqt_help",
     .arguments = "",
     .returns = "name, kind, arguments, returns, purpose, example",
     .hidden = "hidden",
     .purpose = "This reference, a row per function.",
     .example = "SELECT name, purpose FROM rqt_help",
     .fill = fill_help},
    {.name = "rqt_terrains",
     .arguments = "",
     .returns = "name, srid, width, height, cell_x, cell_y, min_z, max_z, quantum, voids, blocks, bytes, max_error",
     .purpose = "The terrains of this connection's databases. Heights, quantum and max_error in metres, cells in "
                "CRS units. lonlat: x and y are degrees, on the ellipsoid of semi_major (metres) and "
                "inverse_flattening (0: a sphere); else metre: metres in a unit of them.",
     .example = "SELECT name, width, height, min_z, max_z FROM rqt_terrains",
     .fill = fill_terrains,
     .hidden =
         "schema, complete, x0, y0, dx, dy, k, quantum_error, crs, vertical, source, created, crs_name, lonlat, "
         "metre, semi_major, inverse_flattening",
     .keeps_statements = true},
    {.name = "rqt_range",
     .arguments = MESH,
     .returns = "x, y, z, error, level",
     .purpose =
         "The vertices of the mesh of a region, each once. error: the stored saturated error in metres, "
         "infinite at the "
         "root's corners; level 0 is the coarsest. Mode cut: vertices between samples have error 0 and no level. "
         "gpkg: the vertex as a GeoPackage POINT Z.",
     .example = "SELECT count(*) FROM rqt_range(" SUMMIT ", 10)",
     .fill = fill_range,
     .hidden = "col, row, q, vertices, triangles, achieved_eps, gpkg"},
    {.name = "rqt_triangles",
     .arguments = MESH,
     .returns = "id, x0, y0, z0, x1, y1, z1, x2, y2, z2",
     .purpose = "The triangles of the mesh of a region, counter-clockwise seen from above. gpkg: the triangle as a "
                "GeoPackage POLYGON Z, for layers; as a result of OGR write +gpkg AS geom.",
     .example = "SELECT count(*), max(z0) FROM rqt_triangles(" SUMMIT ", 10, NULL, '{\"mode\":\"cut\"}')",
     .fill = fill_triangles,
     .hidden = "vertices, triangles, achieved_eps, gpkg"},
    {.name = "rqt_strip",
     .arguments = MESH,
     .returns = "seq, x, y, z",
     .purpose = "The same triangles as one generalized strip: triangle i is rows i, i+1, i+2, its last two swapped "
                "for odd i; a "
                "triangle with two equal vertices is a join.",
     .example = "SELECT count(*) FROM rqt_strip(" SUMMIT ", 10)",
     .fill = fill_strip,
     .hidden = "vertices, triangles, achieved_eps"},
    {.name = "rqt_mesh",
     .arguments = "region, eps, format [, terrain [, options]]",
     .returns = "BLOB, TEXT for obj",
     .purpose =
         "The mesh of a region as a file's bytes; format: strip, indexed, rqt (src/core/FORMAT.md; rqt "
         "takes about a byte a vertex), obj, ply, wkb, gpkg, spatialite, glb (glTF 2.0: metres about an "
         "origin, y up); glb+quantized: in 16 bits; ply+normals, glb+normals, glb+quantized+normals, "
         "rqt+normals: with the terrain's normal at every vertex, from the full-resolution samples around it; "
         "rqt+errors, rqt+normals+errors: with what rqt_range has in its column error. Of mode cut and "
         "frames only obj, ply, wkb, gpkg, spatialite, glb.",
     .example = "SELECT length(rqt_mesh(" SUMMIT ", 10, 'ply'))",
     .call = call_mesh,
     .least = 3,
     .most = 5,
     .flags = READS},
    {.name = "rqt_answer",
     .arguments = "region, eps, format [, terrain [, options]]",
     .returns = "mesh, vertices, triangles, achieved_eps",
     .purpose = "One row: the bytes that rqt_mesh gives, and beside them what they are the mesh of.",
     .example = "SELECT length(mesh), vertices, achieved_eps FROM rqt_answer(" SUMMIT
                ", 1, 'rqt', NULL, '{\"max_vertices\":500}')",
     .fill = fill_answer},
    {.name = "rqt_delta",
     .arguments = "region, eps_from, eps_to [, terrain]",
     .returns = "BLOB",
     .purpose =
         "What makes the mesh of a region finer: the vertices with error in (eps_to, eps_from], for a holder of "
         "rqt_mesh(region, eps_from, 'rqt'). Applied step by step (rqt_wire_apply of rqt.h) it ends in the "
         "mesh of eps_to, bit for bit.",
     .example = "SELECT length(rqt_delta(" SUMMIT ", 20, 10))",
     .call = call_delta,
     .least = 3,
     .most = 4,
     .flags = READS},
    {.name = "rqt_verify",
     .arguments = MESH,
     .returns = "samples, vertices, triangles, max_error, rms_error, x, y, t_junctions, overlaps, uncovered, area",
     .purpose =
         "Proves the mesh of a region: rasterises its triangles over the full-resolution samples. max_error "
         "in metres, at "
         "x, y; uncovered: samples inside the region that the outline promises and no triangle covers; area "
         "in CRS units "
         "squared. Mode cut: heights between samples are doubles, so deviations count less 2^-20 of a height step.",
     .example = "SELECT max_error <= 10, t_junctions, overlaps, uncovered FROM rqt_verify(" SUMMIT ", 10)",
     .fill = fill_verify,
     .hidden = "void_touched, twice_area_in_cells, half_cells, achieved_eps"},
    {.name = "rqt_view_verify",
     .arguments = "camera [, terrain [, options]]",
     .returns = "samples, drawn, vertices, triangles, max_pixels, rms_pixels, x, y, z, t_junctions, overlaps",
     .purpose =
         "Proves the mesh of a view: projects every full-resolution sample of the terrain and the mesh's place "
         "that "
         "belongs to it. max_pixels: the largest distance of the two in the picture where one of them is drawn, at "
         "x, y, z; infinite where the other is behind the eye. uncovered: samples that are drawn, in no triangle, "
         "and further from voids than what achieved_tau pixels are there.",
     .example =
         "SELECT max_pixels <= 1, t_junctions, overlaps, uncovered, guaranteed FROM rqt_view_verify("
         "'{\"eye\": [-71.33, 44.22, 2500], \"at\": [-71.3033, 44.2705, 1900], \"fovy\": 40, \"width\": 1280, "
         "\"height\": 800}')",
     .fill = fill_view_verify,
     .hidden = "achieved_tau, guaranteed, uncovered"},
    {.name = "rqt_explain",
     .arguments = MESH,
     .returns = "level, extent, why, bytes, cached, selected",
     .purpose = "What a query reads: one row per block that answers, in the order of the walk. bytes is 0 where "
                "the index row "
                "alone was enough.",
     .example = "SELECT level, count(*), sum(bytes) FROM rqt_explain(" SUMMIT ", 10) GROUP BY level",
     .fill = fill_explain,
     .hidden = "block, achieved_eps"},
    {.name = "rqt_view",
     .arguments = VIEW,
     .returns = "x, y, z, error, level",
     .purpose =
         "The vertices of the mesh that a view needs, columns as of rqt_range. camera: JSON with eye [x,y,z]; at "
         "[x,y,z], or yaw (degrees clockwise from north) and pitch (degrees upward); roll (0); fovy (degrees); "
         "width, height and tau (1): pixels; near (0) and far in metres; exaggeration (1) of the ground's heights; "
         "position of eye and at: crs, lonlat or ecef. No sample that is drawn is more than tau pixels from its "
         "place in the mesh, its height as it is kept (float rasters: within quantum_error of rqt_terrains). "
         "Terrains in degrees are in space; terrain hides nothing, "
         "not even the Earth what is behind it: give far. Outlines of voids are tol "
         "unless options say exact. "
         "cover: picture, what may be seen; terrain: all of the terrain, as coarse as may be beside the picture. "
         "max_triangles: the smallest achieved_tau >= tau that takes no more. previous: \"\" or the token of the "
         "last "
         "answer, which stays while the camera moves little. To move vertices without a jump: z_from, the height "
         "on the "
         "mesh of the last answer (without previous: of twice the tau); weight, 0 for those that move; parent_a, "
         "parent_b, the rowids of the ends of the edge that a vertex halves.",
     .example = "SELECT count(*) FROM rqt_view(" CAMERA ")",
     .fill = fill_view,
     .hidden = "col, row, q, vertices, triangles, achieved_tau, guaranteed, token, gpkg, parent_a, parent_b, "
               "z_from, weight"},
    {.name = "rqt_view_triangles",
     .arguments = VIEW,
     .returns = "id, x0, y0, z0, x1, y1, z1, x2, y2, z2",
     .purpose =
         "The triangles of the mesh that a view needs, columns as of rqt_triangles. Heights are those of the "
         "terrain, not exaggerated.",
     .example = "SELECT count(*), max(guaranteed) FROM rqt_view_triangles(" CAMERA ")",
     .fill = fill_view_triangles,
     .hidden = "vertices, triangles, achieved_tau, guaranteed, token, gpkg"},
    {.name = "rqt_view_strip",
     .arguments = VIEW,
     .returns = "seq, x, y, z",
     .purpose = "The same triangles as one generalized strip, as of rqt_strip.",
     .example = "SELECT count(*) FROM rqt_view_strip(" CAMERA ")",
     .fill = fill_view_strip,
     .hidden = "vertices, triangles, achieved_tau, guaranteed, token"},
    {.name = "rqt_view_mesh",
     .arguments = "camera, format [, terrain [, options]]",
     .returns = "BLOB, TEXT for obj",
     .purpose =
         "The mesh that a view needs as a file's bytes; formats as of rqt_mesh, and increment: what turns the mesh "
         "of "
         "option previous into this one, with the next token (src/core/FORMAT.md). The eps that a format has is "
         "infinite: a view promises pixels.",
     .example = "SELECT length(rqt_view_mesh(" CAMERA ", 'rqt'))",
     .call = call_view_mesh,
     .least = 2,
     .most = 4,
     .flags = READS},
    {.name = "rqt_view_answer",
     .arguments = "camera, format [, terrain [, options]]",
     .returns = "mesh, vertices, triangles, achieved_tau, guaranteed, token",
     .purpose =
         "One row: the bytes that rqt_view_mesh gives, and beside them what they promise; vertices and triangles "
         "of the whole mesh, also where the bytes are an increment.",
     .example = "SELECT length(mesh), triangles, achieved_tau, guaranteed FROM rqt_view_answer(" CAMERA ", 'rqt')",
     .fill = fill_view_answer},
    {.name = "rqt_view_explain",
     .arguments = VIEW,
     .returns = "level, extent, why, bytes, cached, selected",
     .purpose = "What the query of a view reads, as rqt_explain.",
     .example = "SELECT level, count(*), sum(bytes) FROM rqt_view_explain(" CAMERA ") GROUP BY level",
     .fill = fill_view_explain,
     .hidden = "block, achieved_tau, guaranteed, token"},
    {.name = "rqt_height",
     .arguments = "x, y [, eps [, terrain]]",
     .returns = "REAL",
     .purpose = "The height in metres at a place of the terrain's CRS (rounded to 2^-20 sample, as regions are): "
                "without eps "
                "of the full-resolution samples, also where a lone sample bears no triangle; with eps on that "
                "mesh. NULL over "
                "void or outside.",
     .example = "SELECT rqt_height(-71.3033, 44.2705)",
     .call = call_height,
     .least = 2,
     .most = 4,
     .flags = READS},
    {.name = "rqt_profile",
     .arguments = "line, eps [, terrain]",
     .returns = "distance, x, y, z",
     .purpose =
         "The heights of the mesh along a line: a row for its own points and for every edge of the mesh that it "
         "crosses, in its order; between two rows the mesh is a plane. In degrees the line follows geodesics "
         "and distance, from its start, is geodesic; else both are straight. Metres. Where there is no mesh, "
         "rows with z NULL say where the gap begins and ends; before the first place on the mesh and after the "
         "last there are none.",
     .example = "SELECT count(*), max(z) FROM rqt_profile('LINESTRING(-71.4 44.2, -71.3033 44.2705)', 10)",
     .fill = fill_profile},
    {.name = "rqt_area",
     .arguments = MESH,
     .returns = "planimetric, surface, volume",
     .purpose =
         "How large a region is on the mesh, voids left out: its area at height 0, the area of its surface, and "
         "the volume above height 0 (less what is below), in metres. The mesh is cut at the region's border, "
         "unless options name another mode. In degrees everything is on the terrain's ellipsoid, with heights "
         "taken as above it; else plane.",
     .example = "SELECT round(planimetric), surface > planimetric FROM rqt_area(" SUMMIT ", 10)",
     .fill = fill_area,
     .hidden = "achieved_eps"},
    {.name = "rqt_bbox",
     .arguments = "x0, y0, x1, y1 [, srid]",
     .returns = "GeoPackage geometry",
     .purpose = "A rectangle as a region. With SRID 4326, x0 greater than x1 means across the antimeridian: two "
                "rectangles.",
     .example = "SELECT count(*) FROM rqt_range(rqt_bbox(-71.4, 44.2, -71.2, 44.3), 20)",
     .call = call_bbox,
     .least = 4,
     .most = 5,
     .flags = PURE},
    {.name = "rqt_circle",
     .arguments = "lon, lat, metres",
     .returns = "GeoPackage geometry, SRID 4326",
     .purpose = "A geodesic circle on WGS 84 as a polygon: its sides are off by at most 0.01 % of the radius. "
                "Longitudes go on beyond 180; over a pole it is the band between its rim and the pole.",
     .example = "SELECT length(" SUMMIT ")",
     .call = call_circle,
     .least = 3,
     .most = 3,
     .flags = PURE},
    {.name = "rqt_corridor",
     .arguments = "line, metres",
     .returns = "GeoPackage geometry, SRID 4326",
     .purpose =
         "All that is within so many metres of a line (lon, lat; its points joined by geodesics) on WGS 84, as "
         "polygons whose sides are off by at most 0.01 % of that.",
     .example = "SELECT count(*) FROM rqt_range(rqt_corridor('LINESTRING(-71.4 44.2, -71.3 44.27)', 300), 10)",
     .call = call_corridor,
     .least = 2,
     .most = 2,
     .flags = PURE},
    {.name = "rqt_check",
     .arguments = "[terrain]",
     .returns = "severity, block, message",
     .purpose = "Checks all that is stored of a terrain, or of all: no row when sound.",
     .example = "SELECT count(*) FROM rqt_check()",
     .fill = fill_check},
    {.name = "rqt_block_info",
     .arguments = "blob",
     .returns = "TEXT, JSON",
     .purpose = "The header of a block's bytes.",
     .example = "SELECT rqt_block_info(data) FROM rqt_block_1 WHERE id = 1",
     .call = call_block_info,
     .least = 1,
     .most = 1,
     .flags = PURE},
    {.name = "rqt_block_check",
     .arguments = "blob",
     .returns = "TEXT",
     .purpose = "'ok', or what is wrong with a block's bytes.",
     .example = "SELECT rqt_block_check(data), count(*) FROM rqt_block_1 GROUP BY 1",
     .call = call_block_check,
     .least = 1,
     .most = 1,
     .flags = PURE},
    {.name = "rqt_block_dump",
     .arguments = "blob",
     .returns = "TEXT",
     .purpose = "A block's header, heights, error codes and outline bits as text for people.",
     .example = "SELECT substr(rqt_block_dump(data), 1, 60) FROM rqt_block_1 WHERE id = 1",
     .call = call_block_dump,
     .least = 1,
     .most = 1,
     .flags = PURE},
};

const int rqt_function_count = (int)(sizeof rqt_functions / sizeof *rqt_functions);
