-- layer.sql: a layer of triangles that stays in the GeoPackage, for QGIS, OGR and everybody without rqt.so.
--
-- What to change: the layer's name (terrain_mesh, everywhere), the region (NULL is all), eps. Run again, it replaces the layer. The terrain has to be in
-- a GeoPackage (what rqt import makes); elsewhere use `rqt mesh -o x.gpkg`, or ogr2ogr. QGIS makes a spatial index with a click (Layer properties,
-- Source); it needs none to draw some ten thousand triangles.
--
--   sqlite3 build/terrain.gpkg -cmd '.load build/rqt.so' < sql/layer.sql
--
-- Lines that begin with --> are the rows that the demo's terrain gives; the tests compare them.
--# database demo

BEGIN;
DROP TABLE IF EXISTS terrain_mesh;
DELETE FROM gpkg_geometry_columns WHERE table_name = 'terrain_mesh';
DELETE FROM gpkg_contents WHERE table_name = 'terrain_mesh';
CREATE TABLE terrain_mesh(fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom POLYGON, low REAL, high REAL);
CREATE TEMP TABLE mesh AS SELECT *, gpkg FROM rqt_triangles(rqt_bbox(-71.40, 44.20, -71.20, 44.34), 20);
INSERT INTO terrain_mesh(geom, low, high) SELECT gpkg, min(z0, z1, z2), max(z0, z1, z2) FROM mesh;
-- The terrain's CRS, where the GeoPackage does not have it yet; 100000 for one without a code, -1 for none.
INSERT OR IGNORE INTO gpkg_spatial_ref_sys(srs_name, srs_id, organization, organization_coordsys_id, definition)
  SELECT substr(crs, instr(crs, '"') + 1, instr(substr(crs, instr(crs, '"') + 1), '"') - 1), srid, 'EPSG', srid, crs FROM rqt_terrains WHERE srid > 0 AND crs <> '';
INSERT INTO gpkg_contents(table_name, data_type, identifier, description, min_x, min_y, max_x, max_y, srs_id)
  SELECT 'terrain_mesh', 'features', 'terrain_mesh', 'triangles of ' || t.name || ', eps 20 m', min(min(m.x0, m.x1, m.x2)), min(min(m.y0, m.y1, m.y2)), max(max(m.x0, m.x1, m.x2)), max(max(m.y0, m.y1, m.y2)),
         iif(t.srid > 0, t.srid, -1) FROM mesh m, rqt_terrains t;
INSERT INTO gpkg_geometry_columns SELECT 'terrain_mesh', 'geom', 'POLYGON', iif(srid > 0, srid, -1), 1, 0 FROM rqt_terrains;
DROP TABLE mesh;
COMMIT;

SELECT count(*), min(low), max(high) FROM terrain_mesh;
--> 8741|353.0|1906.0
SELECT round(min_x, 4), round(min_y, 4), round(max_x, 4), round(max_y, 4), srs_id FROM gpkg_contents WHERE table_name = 'terrain_mesh';
--> -71.4|44.2|-71.2|44.3467|4326
