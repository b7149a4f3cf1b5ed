-- Options: what works gives the same mesh; all else is refused with its name.
--# database tent
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, ' { "mode" : "cover" } ');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"mode":"border"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 9, NULL, '{"detail":[]}');
--> 2
SELECT count(*) FROM rqt_triangles(NULL, 9, NULL, '{"detail":[["POINT(0 0)", 1]]}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"outline":"exact"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"outline":"tol"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"mode":"snap"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"mode":"cut"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"metric":"exact"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"select":"threshold"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"select":"topdown"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"select":"bottomup"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"strip":"bintree"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"mode":"cover","outline":"exact","metric":"exact","select":"topdown","strip":"bintree"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"metric":"minimal"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"metric":"local"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"metric":"wedgie"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"metric":"euclid"}');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"metric":"minimal","select":"topdown"}');
--> 4
SELECT count(*) FROM rqt_strip(NULL, 1, NULL, '{"strip":"fan"}');
--> 8
SELECT max_error <= 1, t_junctions, overlaps, uncovered FROM rqt_verify(NULL, 1, NULL, '{"metric":"wedgie"}');
--> 1|0|0|0
SELECT why LIKE '%made in memory%', bytes FROM rqt_explain(NULL, 1, NULL, '{"metric":"local"}') LIMIT 1;
--> 1|0
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, NULL);
--> 4

-- a budget: the smallest eps that keeps it
SELECT count(*), max(achieved_eps) FROM rqt_range(NULL, 1, NULL, '{"max_vertices":5}');
--> 5|1.0
SELECT count(*), max(achieved_eps) FROM rqt_range(NULL, 1, NULL, '{"max_vertices":4}');
--> 4|8.0
SELECT count(*), max(achieved_eps) FROM rqt_triangles(NULL, 0.3, NULL, '{"max_vertices":4,"metric":"minimal"}');
--> 2|8.0
SELECT max(achieved_eps) FROM rqt_strip(NULL, 0.3, NULL, '{"max_vertices":1000}');
--> 0.3
SELECT max_error, vertices, achieved_eps FROM rqt_verify(NULL, 2, NULL, '{"max_vertices":4}');
--> 8.0|4|8.0
SELECT max(achieved_eps) FROM rqt_explain(NULL, 1, NULL, '{"max_vertices":4}');
--> 8.0
SELECT rqt_mesh(NULL, 0, 'indexed', NULL, '{"max_vertices":4}') = rqt_mesh(NULL, 8, 'indexed');
--> 1

-- mode cut: vertices between samples, heights on the leaf's plane; the faces of the tent rise by 4 a sample
SELECT x, y, z, error, level FROM rqt_range('POLYGON((1 -1.5, 1.5 -1.5, 1.5 -2.5, 1 -2.5, 1 -1.5))', 1, NULL, '{"mode":"cut"}') ORDER BY x, y;
--> 1.0|-2.5|4.0|0.0|NULL
--> 1.0|-1.5|4.0|0.0|NULL
--> 1.5|-2.5|6.0|0.0|NULL
--> 1.5|-1.5|6.0|0.0|NULL
SELECT samples, vertices, triangles, max_error, t_junctions, overlaps, uncovered, area FROM rqt_verify('POLYGON((1 -1, 3 -1, 3 -3, 1 -3, 1 -1))', 1, NULL, '{"mode":"cut"}');
--> 9|5|4|0.0|0|0|0|4.0
SELECT col, row, q FROM rqt_range('POLYGON((2 -2, 0.5 -2, 2 -0.5, 2 -2))', 1, NULL, '{"mode":"cut"}') ORDER BY col, row;
--> 0.5|2.0|2.0
--> 1.25|1.25|5.0
--> 2.0|0.5|2.0
--> 2|2|8
SELECT count(*) FROM rqt_strip('POLYGON((2 -2, 0.5 -2, 2 -0.5, 2 -2))', 1, NULL, '{"mode":"cut"}');
--> 4
-- lines and points cannot be cut out: whole leaves
SELECT area FROM rqt_verify('LINESTRING(1 -1.5, 1 -2.5)', 1, NULL, '{"mode":"cut"}');
--> 4.0
SELECT rqt_mesh(NULL, 1, 'strip', NULL, '{"mode":"cut"}');
--! rqt_mesh(): format "strip" holds whole samples, and mode "cut" has vertices between them
SELECT rqt_mesh(NULL, 1, 'indexed', NULL, '{"mode":"cut"}');
--! rqt_mesh(): format "indexed" holds whole samples
SELECT rqt_mesh(NULL, 1, 'rqt', NULL, '{"mode":"cut"}');
--! rqt_mesh(): format "rqt" holds whole samples
SELECT * FROM rqt_range(NULL, 1, NULL, '{"mode":"cut","max_vertices":5}');
--! rqt_range(): option "max_vertices" does not go with mode "cut"
SELECT * FROM rqt_strip(NULL, 1, NULL, '{"mode":"cut","strip":"fan"}');
--! rqt_strip(): option "strip":"fan" does not go with mode "cut"
SELECT * FROM rqt_range(NULL, 1, NULL, '{"max_vertices":3}');
--! rqt_range(): option "max_vertices" must be an integer of 4 or more
SELECT * FROM rqt_range(NULL, 1, NULL, '{"max_vertices":4.5}');
--! rqt_range(): option "max_vertices" must be an integer of 4 or more
SELECT * FROM rqt_range(NULL, 1, NULL, '{"max_vertices":"5"}');
--! rqt_range(): option "max_vertices" must be an integer of 4 or more

-- of views
SELECT * FROM rqt_triangles(NULL, 1, NULL, '{"max_triangles":100}');
--! rqt_triangles(): option "max_triangles" is for views
SELECT * FROM rqt_range(NULL, 1, NULL, '{"previous":"x"}');
--! rqt_range(): option "previous" is for views
SELECT * FROM rqt_range(NULL, 1, NULL, '{"max_triangles":0}');
--! rqt_range(): option "max_triangles" must be an integer of 1 or more
SELECT * FROM rqt_verify(NULL, 1, NULL, '{"test":{}}');
--! rqt_verify(): option "test" must be a text: one of guaranteed ulrich node sphere lindstrom lodmap

-- unknown keys and values
SELECT rqt_mesh(NULL, 1, 'obj', NULL, '{"modus":"cover"}');
--! rqt_mesh(): unknown option "modus"
SELECT * FROM rqt_explain(NULL, 1, NULL, '{"Mode":"cover"}');
--! rqt_explain(): unknown option "Mode"
SELECT * FROM rqt_triangles(NULL, 1, NULL, '{"":"cover"}');
--! rqt_triangles(): unknown option ""
SELECT * FROM rqt_range(NULL, 1, NULL, '{"mode":"clip"}');
--! rqt_range(): option "mode"
SELECT * FROM rqt_strip(NULL, 1, NULL, '{"mode":"COVER"}');
--! rqt_strip(): option "mode"
SELECT * FROM rqt_verify(NULL, 1, NULL, '{"mode":""}');
--! rqt_verify(): option "mode"
SELECT rqt_mesh(NULL, 1, 'obj', NULL, '{"mode":"cover snap"}');
--! rqt_mesh(): option "mode"
SELECT * FROM rqt_explain(NULL, 1, NULL, '{"outline":"loose"}');
--! rqt_explain(): option "outline"
SELECT * FROM rqt_triangles(NULL, 1, NULL, '{"metric":"l2"}');
--! rqt_triangles(): option "metric"
SELECT * FROM rqt_range(NULL, 1, NULL, '{"select":"best"}');
--! rqt_range(): option "select"
SELECT * FROM rqt_strip(NULL, 1, NULL, '{"strip":"long"}');
--! rqt_strip(): option "strip"
SELECT * FROM rqt_verify(NULL, 1, NULL, '{"mode":1}');
--! rqt_verify(): option "mode"
SELECT rqt_mesh(NULL, 1, 'obj', NULL, '{"mode":null}');
--! rqt_mesh(): option "mode"
SELECT * FROM rqt_explain(NULL, 1, NULL, '{"select":["topdown"]}');
--! rqt_explain(): option "select"
SELECT * FROM rqt_triangles(NULL, 1, NULL, '{"mode":"cover","eps":1}');
--! rqt_triangles(): unknown option "eps"
SELECT * FROM rqt_range(NULL, 1, NULL, '{"select":"topdown","select":"topdown"}');
--! rqt_range(): option "select" is given twice
SELECT * FROM rqt_strip(NULL, 1, NULL, '{"mode":"cover","select":"topdown","mode":"cover"}');
--! rqt_strip(): option "mode" is given twice

-- not JSON, not an object
SELECT * FROM rqt_verify(NULL, 1, NULL, '');
--! rqt_verify(): options are not JSON
SELECT rqt_mesh(NULL, 1, 'obj', NULL, 'mode=cover');
--! rqt_mesh(): options are not JSON
SELECT * FROM rqt_explain(NULL, 1, NULL, '{"mode":"cover"');
--! rqt_explain(): options are not JSON
SELECT * FROM rqt_triangles(NULL, 1, NULL, '{"mode":"cover"} x');
--! rqt_triangles(): options are not JSON
SELECT * FROM rqt_range(NULL, 1, NULL, '{mode:"cover"}');
--! rqt_range(): options are not JSON
SELECT * FROM rqt_strip(NULL, 1, NULL, '[]');
--! rqt_strip(): options must be a JSON object
SELECT * FROM rqt_verify(NULL, 1, NULL, '["cover"]');
--! rqt_verify(): options must be a JSON object
SELECT rqt_mesh(NULL, 1, 'obj', NULL, '"cover"');
--! rqt_mesh(): options must be a JSON object
SELECT * FROM rqt_explain(NULL, 1, NULL, 'null');
--! rqt_explain(): options must be a JSON object
SELECT * FROM rqt_triangles(NULL, 1, NULL, '5');
--! rqt_triangles(): options must be a JSON object
SELECT * FROM rqt_range(NULL, 1, NULL, 5);
--! rqt_range(): options must be a JSON object
SELECT * FROM rqt_range(NULL, 1, NULL, x'00');
--! rqt_range(): options
