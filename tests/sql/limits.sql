-- rqt_limit: what one answer of a connection may be at most. The tent's mesh at eps 1 has 4 triangles and 5 vertices.
--# database tent
SELECT rqt_limit('triangles'), rqt_limit('samples');
--> 0|0
SELECT rqt_limit('triangles', 5), rqt_limit('triangles', 4), rqt_limit('triangles');
--> 0|5|4
SELECT count(*) FROM rqt_triangles(NULL, 1);
--! rqt_triangles(): the mesh has more than 4 triangles or vertices, the limit here
SELECT count(*) FROM rqt_range(NULL, 1);
--! rqt_range(): the mesh has more than 4 triangles or vertices, the limit here
SELECT length(rqt_mesh(NULL, 1, 'rqt'));
--! rqt_mesh(): the mesh has more than 4 triangles or vertices, the limit here
SELECT count(*) FROM rqt_explain(NULL, 1);
--! rqt_explain(): the mesh has more than 4 triangles or vertices, the limit here
SELECT count(*) FROM rqt_triangles(NULL, 9);
--> 2
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"max_vertices": 4}');
--> 2
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"max_vertices": 5}');
--! rqt_triangles(): the mesh has more than 4 triangles or vertices, the limit here
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL, '{"metric": "local"}');
--! rqt_triangles(): the mesh has more than 4 triangles or vertices, the limit here
SELECT rqt_limit('triangles', 5);
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1);
--> 4
SELECT count(*) FROM rqt_strip(NULL, 1);
--> *
SELECT rqt_limit('samples', 24);
--> 0
SELECT samples FROM rqt_verify(NULL, 1);
--! rqt_verify(): there are more than 24 samples under the mesh, the limit here
SELECT rqt_limit('samples', 25);
--> 24
SELECT samples FROM rqt_verify(NULL, 1);
--> 25
SELECT rqt_limit('triangles', 0), rqt_limit('samples', 0);
--> 5|25
SELECT rqt_limit('squares');
--! rqt_limit(): name must be triangles or samples
SELECT rqt_limit(NULL);
--! rqt_limit(): name must be triangles or samples
SELECT rqt_limit('triangles', -1);
--! rqt_limit(): most must be an integer of 0 or more
SELECT rqt_limit('triangles', 1.5);
--! rqt_limit(): most must be an integer of 0 or more
SELECT rqt_limit('triangles', NULL);
--! rqt_limit(): most must be an integer of 0 or more
CREATE VIEW lifts AS SELECT rqt_limit('triangles', 0) AS before;
SELECT before FROM lifts;
--! unsafe use of rqt_limit()
