-- lod_ladder.sql: what a mesh costs at each tolerance: vertices, triangles, bytes to send and to draw, milliseconds.
--
-- For whoever chooses levels of detail. What to change: the region (here all: NULL) and the rungs. Every rung is proven: no sample is
-- further than eps from the mesh; add rqt_verify(NULL, eps) to see it.
--
--   sqlite3 build/terrain.gpkg -cmd '.load build/rqt.so' < sql/recipes/lod_ladder.sql
--
-- Lines that begin with --> are the rows that the demo's terrain gives (* is any value); the tests compare them.
--# database demo

-- 'now' is the moment at which a row is made, when its vertices are counted: so a rung's time is what lies between the row before and its own.
CREATE TEMP TABLE ladder(rung INTEGER PRIMARY KEY, eps REAL, vertices INTEGER, ended REAL);
INSERT INTO ladder SELECT 0, NULL, 0, julianday('now');
INSERT INTO ladder SELECT 1, 100, count(*), julianday('now') FROM rqt_range(NULL, 100);
INSERT INTO ladder SELECT 2, 50, count(*), julianday('now') FROM rqt_range(NULL, 50);
INSERT INTO ladder SELECT 3, 20, count(*), julianday('now') FROM rqt_range(NULL, 20);
INSERT INTO ladder SELECT 4, 10, count(*), julianday('now') FROM rqt_range(NULL, 10);
INSERT INTO ladder SELECT 5, 5, count(*), julianday('now') FROM rqt_range(NULL, 5);
INSERT INTO ladder SELECT 6, 2, count(*), julianday('now') FROM rqt_range(NULL, 2);
INSERT INTO ladder SELECT 7, 1, count(*), julianday('now') FROM rqt_range(NULL, 1);

-- eps, vertices, share of all samples in per cent, triangles, bytes on the wire, bytes as a strip, milliseconds of the query.
SELECT l.eps, l.vertices, round(100.0 * l.vertices / (t.width * t.height - t.voids), 2), (SELECT count(*) FROM rqt_triangles(NULL, l.eps)),
       length(rqt_mesh(NULL, l.eps, 'rqt')), length(rqt_mesh(NULL, l.eps, 'strip')), round(86400000 * (l.ended - before.ended))
FROM ladder l JOIN ladder before ON before.rung = l.rung - 1, rqt_terrains t ORDER BY l.rung;
--> 100.0|8454|0.59|16669|11336|206428|*
--> 50.0|25476|1.77|50547|29754|623996|*
--> 20.0|89046|6.17|177300|89977|2181532|*
--> 10.0|211712|14.68|422158|190126|5192676|*
--> 5.0|449663|31.17|897345|359325|11050380|*
--> 2.0|876481|60.77|1749889|605388|21682324|*
--> 1.0|1106806|76.73|2209909|706382|27546128|*

-- The other way round: the best mesh within a budget of vertices, and the eps that it has.
SELECT count(*), max(achieved_eps) FROM rqt_range(NULL, 0, NULL, '{"max_vertices": 10000}');
--> 9987|90.5
