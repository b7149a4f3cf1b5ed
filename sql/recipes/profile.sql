-- profile.sql: the terrain between two towns, as a profile: length, ups and downs, a table, what stands in the way.
--
-- For whoever plans a path, a line or a radio link. What to change: the line (its ends, or all its points) and eps, the largest
-- error in metres of height. In degrees the line is a geodesic and distances are geodesic.
--
--   sqlite3 build/terrain.gpkg -cmd '.load build/rqt.so' < sql/recipes/profile.sql
--
-- Lines that begin with --> are the rows that the demo's terrain gives; the tests compare them.
--# database demo

-- Gorham to Bretton Woods, over the Presidential Range. A row for every edge of the mesh that the line crosses.
CREATE TEMP TABLE profile AS
  SELECT distance, x, y, z, lead(distance) OVER (ORDER BY distance) AS next_distance, lead(z) OVER (ORDER BY distance) AS next_z
  FROM rqt_profile('LINESTRING(-71.1731 44.3878, -71.4412 44.2583)', 5);

-- Kilometres, rows, lowest and highest place, metres up and metres down.
SELECT round(max(distance) / 1000, 2), count(*), round(min(z)), round(max(z)), round(sum(max(next_z - z, 0))), round(sum(max(z - next_z, 0))) FROM profile;
--> 25.78|453|243.0|1596.0|2459.0|2197.0

-- The height every two kilometres: between two rows the mesh is a plane.
WITH RECURSIVE step(metres) AS (SELECT 0 UNION ALL SELECT metres + 2000 FROM step WHERE metres + 2000 <= (SELECT max(distance) FROM profile))
SELECT metres / 1000 AS km, round(max(z + (next_z - z) * (metres - distance) / (next_distance - distance)), 1) AS height
FROM step, profile WHERE distance <= metres AND next_distance >= metres AND next_distance > distance GROUP BY metres;
--> 0|243.7
--> 2|451.3
--> 4|709.8
--> 6|480.6
--> 8|930.3
--> 10|1288.0
--> 12|1496.0
--> 14|1078.0
--> 16|972.4
--> 18|915.6
--> 20|755.9
--> 22|628.8
--> 24|532.2

-- A link between masts of 30 m at both ends: by how much, and where, the terrain rises most above the straight line between their
-- tops, with the Earth's curvature at a radius of 8495 km (4/3 of the Earth's, for the refraction of radio waves).
WITH mast(length, low, high) AS (SELECT max(distance), min(z) FILTER (WHERE distance = 0) + 30, (SELECT z FROM profile ORDER BY distance DESC LIMIT 1) + 30 FROM profile)
SELECT round(max(z + distance * (length - distance) / (2 * 8495e3) - (low + (high - low) * distance / length))) AS above_the_line, round(distance / 1000, 2) AS at_km
FROM profile, mast;
--> 1208.0|12.29
