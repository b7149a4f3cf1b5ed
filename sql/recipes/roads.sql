-- roads.sql: the terrain under a table of roads: length, heights, climb, the steepest stretch of each.
--
-- For road and path networks in the same database as the terrain. What to change: the table: any layer with lines in the terrain's CRS
-- (a GeoPackage's geometry column as it is), here two made on the spot; eps; the length of a stretch.
--
--   sqlite3 build/terrain.gpkg -cmd '.load build/rqt.so' < sql/recipes/roads.sql
--
-- Lines that begin with --> are the rows that the demo's terrain gives; the tests compare them.
--# database demo

CREATE TEMP TABLE roads(id INTEGER PRIMARY KEY, name TEXT, geom);
INSERT INTO roads VALUES
  (1, 'Pinkham Notch to the summit', 'LINESTRING(-71.2530 44.2573, -71.2700 44.2630, -71.2900 44.2640, -71.3033 44.2705)'),
  (2, 'Bretton Woods to the summit', 'LINESTRING(-71.4412 44.2583, -71.3900 44.2690, -71.3500 44.2710, -71.3033 44.2705)');

-- The mesh along every road; z is NULL where there is no terrain.
CREATE TEMP TABLE along AS
  SELECT r.id, r.name, p.distance, p.x, p.y, p.z, lead(p.distance) OVER road AS next_distance, lead(p.z) OVER road AS next_z
  FROM roads r, rqt_profile(r.geom, 5) p WINDOW road AS (PARTITION BY r.id ORDER BY p.distance);

-- Length in kilometres, lowest and highest, metres up and down.
SELECT name, round(max(distance) / 1000, 2), round(min(z)), round(max(z)), round(sum(max(next_z - z, 0))), round(sum(max(z - next_z, 0))) FROM along GROUP BY id;
--> Pinkham Notch to the summit|4.38|619.0|1907.0|1288.0|0.0
--> Bretton Woods to the summit|11.19|493.0|1907.0|1465.0|63.0

-- The steepest 200 metres of each: gradient in per cent, and where it begins. Heights at every 50 metres.
WITH RECURSIVE step(metres) AS (SELECT 0 UNION ALL SELECT metres + 50 FROM step WHERE metres < 20000),
post AS (SELECT id, name, metres, max(z + (next_z - z) * (metres - distance) / (next_distance - distance)) AS height
  FROM along, step WHERE distance <= metres AND next_distance >= metres AND next_distance > distance GROUP BY id, metres)
SELECT a.name, round(max(abs(b.height - a.height)) / 2, 1) AS per_cent, a.metres AS at FROM post a JOIN post b ON b.id = a.id AND b.metres = a.metres + 200 GROUP BY a.id;
--> Pinkham Notch to the summit|70.8|2550
--> Bretton Woods to the summit|64.8|9850
