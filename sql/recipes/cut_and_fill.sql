-- cut_and_fill.sql: earthworks: how much to dig away and how much to heap up to make a polygon level.
--
-- For building sites, ponds, landfills. What to change: the polygon (in the terrain's CRS), the design height, eps.
--
--   sqlite3 build/terrain.gpkg -cmd '.load build/rqt.so' < sql/recipes/cut_and_fill.sql
--
-- What is computed, exactly: the terrain is its mesh at eps, cut at the polygon's border. A triangle of area A whose corners are a, b, c
-- metres above the design height holds, above it,
--     A (a+b+c)/3                                         when none is below,
--     A a^3 / (3 (a-b) (a-c))                             when only a is above,
--     A (a+b+c)/3 - A c^3 / (3 (c-a) (c-b))               when only c is below (the last term is what is below, negative),
--     nothing                                             when none is above;
-- what is below it is that less A (a+b+c)/3. The volumes are sums of these: cut above, fill below. So both are as exact as the mesh: at eps 0
-- they are the volumes of the samples' own surface; else each is within eps times the area of that.
-- Areas in degrees become square metres on WGS 84 by metres in a degree of longitude and latitude at each triangle's middle.
--
-- Lines that begin with --> are the rows that the demo's terrain gives; the tests compare them.
--# database demo

CREATE TEMP TABLE site AS SELECT 'POLYGON((-71.4480 44.2560, -71.4400 44.2560, -71.4400 44.2620, -71.4450 44.2640, -71.4480 44.2560))' AS area, 506.0 AS design, 0 AS eps;

-- Triangles with heights above the design height in order, a >= b >= c, and their areas in square metres.
CREATE TEMP TABLE part AS
WITH corner AS (
  SELECT abs((x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0)) / 2 AS area_in_units, (y0 + y1 + y2) / 3 AS middle,
         max(z0, z1, z2) - design AS a, z0 + z1 + z2 - max(z0, z1, z2) - min(z0, z1, z2) - design AS b, min(z0, z1, z2) - design AS c
  FROM site, rqt_triangles(site.area, site.eps, NULL, '{"mode": "cut"}')),
curve AS (SELECT *, radians(middle) AS phi, 1 - 0.00669437999014132 * sin(radians(middle)) * sin(radians(middle)) AS w FROM corner)
SELECT a, b, c, area_in_units * CASE WHEN (SELECT crs LIKE 'GEOGCS%' FROM rqt_terrains)
  THEN radians(1) * radians(1) * cos(phi) / sqrt(w) * (1 - 0.00669437999014132) / (w * sqrt(w)) * 6378137.0 * 6378137.0 ELSE 1 END AS area FROM curve;

CREATE TEMP VIEW volumes AS SELECT *, area * (a + b + c) / 3 AS net,
  CASE WHEN c >= 0 THEN area * (a + b + c) / 3
       WHEN a <= 0 THEN 0
       WHEN b <= 0 THEN area * a * a * a / (3 * (a - b) * (a - c))
       ELSE area * (a + b + c) / 3 - area * c * c * c / (3 * (c - a) * (c - b)) END AS above FROM part;

-- Hectares, cubic metres to cut, to fill, and what is left over.
SELECT round(sum(area) / 1e4, 3), round(sum(above)), round(sum(above - net)), round(sum(net)) FROM volumes;
--> 41.705|2071568.0|1980345.0|91223.0

-- The height at which cut and fill balance: the mean of the mesh.
SELECT round(design + sum(net) / sum(volumes.area), 2) FROM volumes, site;
--> 506.22
