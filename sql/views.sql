-- views.sql: views over the terrain for one session: triangles and vertices with their geometry, the terrain's frame.
--
-- They are TEMP views: they live in this connection only. Views over rqt's functions must not stay in a file: programs without rqt.so fail on
-- it (ALTER TABLE reads every view). For a layer that stays, see layer.sql. What to change: eps and, where there are several, the terrain.
--
--   sqlite3 build/terrain.gpkg -cmd '.load build/rqt.so' -cmd '.read sql/views.sql'
--# database demo

CREATE TEMP VIEW terrain_triangles AS
SELECT id, min(z0, z1, z2) AS low, max(z0, z1, z2) AS high, gpkg AS geom FROM rqt_triangles(NULL, 20);
CREATE TEMP VIEW terrain_vertices AS SELECT x, y, z, error, level, gpkg AS geom FROM rqt_range(NULL, 20);
CREATE TEMP VIEW terrain_frames AS
SELECT name, rqt_bbox(min(x0, x0 + (width - 1) * dx), min(y0, y0 + (height - 1) * dy), max(x0, x0 + (width - 1) * dx), max(y0, y0 + (height - 1) * dy), srid) AS geom
FROM rqt_terrains WHERE width > 1 AND height > 1;

SELECT count(*), min(low), max(high) FROM terrain_triangles;
--> 177300|116.0|1906.0
SELECT count(*), max(level) FROM terrain_vertices;
--> 89046|11
SELECT name, length(geom) FROM terrain_frames;
--> white_mountains|133
