-- What a region may be, and which leaves answer it. The mesh of `tent` at eps 1 is its four faces; in `ramp` it is two triangles.
--# database tent
SELECT count(*) FROM rqt_triangles(NULL, 1);
--> 4
SELECT id, x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_triangles('POINT(2 -0.5)', 1);
--> 1|2.0|-2.0|8.0|4.0|0.0|0.0|0.0|0.0|0.0
SELECT x, y, z, error, level FROM rqt_range(NULL, 1) ORDER BY y DESC, x;
--> 0.0|0.0|0.0|inf|0
--> 4.0|0.0|0.0|inf|0
--> 2.0|-2.0|8.0|8.0|1
--> 0.0|-4.0|0.0|inf|0
--> 4.0|-4.0|0.0|inf|0
-- Columns that do not show unless they are asked for.
SELECT col, row, q FROM rqt_range('POINT(2 -2)', 9e999) ORDER BY row, col;
--> 0|0|0
--> 4|0|0
--> 0|4|0
--> 4|4|0
SELECT samples, vertices, triangles, max_error, rms_error, t_junctions, overlaps, uncovered, area FROM rqt_verify(NULL, 1);
--> 25|5|4|0.0|0.0|0|0|0|16.0
SELECT samples, vertices, triangles, max_error, x, y, t_junctions, overlaps, uncovered, area FROM rqt_verify(NULL, 9e999);
--> 25|4|2|8.0|2.0|-2.0|0|0|0|16.0

-- polygons: the interior of a leaf must meet the interior of the region
SELECT count(*) FROM rqt_triangles('POLYGON((1.5 -0.25, 2.5 -0.25, 2.5 -0.75, 1.5 -0.75, 1.5 -0.25))', 1);
--> 1
SELECT count(*) FROM rqt_triangles('POLYGON((1.5 -0.25, 1.5 -0.75, 2.5 -0.75, 2.5 -0.25, 1.5 -0.25))', 1);
--> 1
-- The region's side lies on the edge of a leaf: touching is not meeting.
SELECT count(*) FROM rqt_triangles('POLYGON((0 0, 4 0, 2 -2, 0 0))', 1);
--> 1
SELECT count(*) FROM rqt_triangles('POLYGON((4 0, 8 0, 8 -4, 4 -4, 4 0))', 1);
--> 0
SELECT count(*) FROM rqt_triangles('POLYGON((3.75 0, 8 0, 8 -4, 3.75 -4, 3.75 0))', 1);
--> 3
SELECT count(*) FROM rqt_triangles('POLYGON((1.75 -1.75, 2.25 -1.75, 2.25 -2.25, 1.75 -2.25, 1.75 -1.75))', 1);
--> 4
SELECT count(*) FROM rqt_triangles(rqt_bbox(1.75, -2.25, 2.25, -1.75), 1);
--> 4
-- a hole that holds all but the east
SELECT count(*) FROM rqt_triangles('POLYGON((-1 1, 5 1, 5 -5, -1 -5, -1 1), (-0.5 0.5, -0.5 -4.5, 2 -4.5, 2 0.5, -0.5 0.5))', 1);
--> 3
SELECT count(*) FROM rqt_triangles('POLYGON((-1 1, 5 1, 5 -5, -1 -5, -1 1), (-0.5 0.5, -0.5 -4.5, 4.5 -4.5, 4.5 0.5, -0.5 0.5))', 1);
--> 0
SELECT count(*) FROM rqt_triangles('MULTIPOLYGON(((1.5 -0.25, 2.5 -0.25, 2 -0.5, 1.5 -0.25)), ((1.5 -3.75, 2.5 -3.75, 2 -3.5, 1.5 -3.75)))', 1);
--> 2

-- points and lines: every closed leaf that they touch
SELECT count(*) FROM rqt_triangles('POINT(2 -2)', 1);
--> 4
SELECT count(*) FROM rqt_triangles('POINT(1 -1)', 1);
--> 2
SELECT count(*) FROM rqt_triangles('POINT(4 0)', 1);
--> 2
SELECT count(*) FROM rqt_triangles('POINT(4.001 0)', 1);
--> 0
SELECT count(*) FROM rqt_triangles('MULTIPOINT(2 -0.5, 2 -3.5)', 1);
--> 2
SELECT count(*) FROM rqt_triangles('LINESTRING(0 0, 4 0)', 1);
--> 3
SELECT count(*) FROM rqt_triangles('LINESTRING(1 0, 3 0)', 1);
--> 1
SELECT count(*) FROM rqt_triangles('LINESTRING(0.5 -2, 1.5 -2)', 1);
--> 1
SELECT count(*) FROM rqt_triangles('LINESTRING(-5 -2, 5 -2)', 1);
--> 4
SELECT count(*) FROM rqt_triangles('MULTILINESTRING((1 0, 3 0), (1 -4, 3 -4))', 1);
--> 2
SELECT count(*) FROM rqt_triangles('GEOMETRYCOLLECTION(POINT(2 -0.5), LINESTRING(1 -4, 3 -4))', 1);
--> 2
-- a box without an interior is a line, or a point
SELECT count(*) FROM rqt_triangles(rqt_bbox(1, 0, 3, 0), 1);
--> 1
SELECT count(*) FROM rqt_triangles(rqt_bbox(2, -2, 2, -2), 1);
--> 4

-- outside, or empty: an answer without rows
SELECT * FROM rqt_range('POINT(10 10)', 1);
SELECT * FROM rqt_triangles('POLYGON((10 10, 11 10, 11 11, 10 10))', 1);
SELECT * FROM rqt_strip('LINESTRING(10 10, 11 11)', 1);
SELECT * FROM rqt_explain(rqt_bbox(1e300, 1e300, 1e301, 1e301), 1);
SELECT * FROM rqt_range('POLYGON EMPTY', 1);
SELECT * FROM rqt_triangles('GEOMETRYCOLLECTION EMPTY', 0);
SELECT samples, vertices, triangles, max_error, t_junctions, overlaps, uncovered, area FROM rqt_verify('POINT(10 10)', 1);
--> 0|0|0|0.0|0|0|0|0.0
-- A mesh of nothing is a file of nothing, not NULL.
SELECT length(rqt_mesh('POINT(10 10)', 1, 'strip')), length(rqt_mesh('POINT(10 10)', 1, 'indexed'));
--> 128|128
SELECT hex(rqt_mesh('POINT(10 10)', 1, 'wkb'));
--> 01EE03000000000000
SELECT typeof(rqt_mesh('POINT(10 10)', 1, f.value)) FROM json_each('["strip","indexed","obj","ply","wkb","gpkg","spatialite"]') AS f;
--> blob
--> blob
--> text
--> blob
--> blob
--> blob
--> blob

-- forms of one region
SELECT count(*) FROM rqt_triangles('point ( 2   -0.5 )', 1);
--> 1
SELECT count(*) FROM rqt_triangles('POINT Z (2 -0.5 100)', 1);
--> 1
SELECT count(*) FROM rqt_triangles('POINT(2e0 -5E-1)', 1);
--> 1
-- SpatiaLite's point, written by hand, SRID 0
SELECT count(*) FROM rqt_triangles(x'0001000000000000000000000040000000000000E0BF0000000000000040000000000000E0BF7C010000000000000000000040000000000000E0BFFE', 1);
--> 1
-- GeoPackage's point: without an envelope, srs_id 0
SELECT count(*) FROM rqt_triangles(x'4750000100000000' || x'01010000000000000000000040000000000000E0BF', 1);
--! rqt_triangles(): region
SELECT count(*) FROM rqt_triangles(x'475000010000000001010000000000000000000040000000000000E0BF', 1);
--> 1

-- rqt_bbox
SELECT hex(rqt_bbox(1, 2, 3, 4, 4326));
--> 47500003E6100000000000000000F03F00000000000008400000000000000040000000000000104001030000000100000005000000000000000000F03F00000000000000400000000000000840000000000000004000000000000008400000000000001040000000000000F03F0000000000001040000000000000F03F0000000000000040
SELECT rqt_bbox(3, 2, 1, 4);
--! rqt_bbox(): x0 is greater than x1
SELECT rqt_bbox(1, 4, 3, 2);
--! rqt_bbox(): y0 is greater than y1
SELECT rqt_bbox(NULL, 2, 3, 4);
--! rqt_bbox(): x0 must be a number
SELECT rqt_bbox(1, 'two', 3, 4);
--! rqt_bbox(): y0 must be a number
SELECT rqt_bbox(1, 2, 9e999, 4);
--! rqt_bbox(): x1 must be finite
SELECT rqt_bbox(1, 2, 3, 9e999 - 9e999);
--! rqt_bbox(): y1 must be a number
SELECT rqt_bbox(1, 2, 3, 4, 0.5);
--! rqt_bbox(): srid must be an integer
SELECT rqt_bbox(1, 2, 3, 4, 1e10);
--! rqt_bbox(): srid must be an integer
SELECT rqt_bbox(1, 2, 3, 4, 'x');
--! rqt_bbox(): srid must be a number
SELECT rqt_bbox(1, 2, 3);
--! wrong number of arguments

-- rqt_circle
SELECT rqt_circle(7, 46, NULL);
--! rqt_circle(): metres must be a number
SELECT rqt_circle(NULL, 46, 1);
--! rqt_circle(): lon must be a number
SELECT rqt_circle(7, 'x', 1);
--! rqt_circle(): lat must be a number
SELECT rqt_circle(7, 91, 1);
--! rqt_circle(): 
SELECT rqt_circle(7, 46, -1);
--! rqt_circle(): 
SELECT rqt_circle(7, 46, 0);
--! rqt_circle(): 
SELECT rqt_circle(7, 46, 9e999);
--! rqt_circle(): 
SELECT rqt_circle(9e999, 46, 1);
--! rqt_circle(): 
SELECT typeof(rqt_circle(7, 46, 1000));
--> blob

-- degrees on WGS 84 meet regions of SRID 4326
--# database degrees
SELECT srid FROM rqt_terrains;
--> 4326
SELECT count(*) FROM rqt_triangles('SRID=4326;POINT(11 47.8)', 1);
--> 1
SELECT count(*) FROM rqt_triangles(rqt_circle(11, 47.8, 1000), 1);
--> 1
SELECT count(*) FROM rqt_triangles(rqt_bbox(10, 46, 12, 48, 4326), 1);
--> 4
SELECT count(*) FROM rqt_triangles('POINT(11 47.8)', 1);
--> 1
SELECT count(*) FROM rqt_triangles('SRID=2056;POINT(11 47.8)', 1);
--! region has SRID 2056, terrain degrees has SRID 4326
SELECT count(*) FROM rqt_triangles(rqt_bbox(10, 46, 12, 48, 4258), 1);
--! region has SRID 4258, terrain degrees has SRID 4326
