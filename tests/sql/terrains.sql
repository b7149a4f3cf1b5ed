-- What is known of a terrain, and heights at places. In `spike` the void makes the root's triangles mixed: 8 samples of 10 m.
--# database spike
SELECT name, srid, width, height, cell_x, cell_y, min_z, max_z, quantum, voids, max_error FROM rqt_terrains;
--> spike|NULL|9|7|10.0|10.0|0.0|10.0|1.0|1|80.0
SELECT schema, complete, x0, y0, dx, dy, quantum_error, crs, vertical FROM rqt_terrains;
--> main|1|1000.0|2060.0|10.0|-10.0|0.0||
SELECT blocks = (SELECT count(*) FROM rqt_block_1), bytes = (SELECT sum(length(data) + length(summary)) FROM rqt_block_1) FROM rqt_terrains;
--> 1|1
-- the spike, its slope, the void corner, outside
SELECT rqt_height(1030, 2040), rqt_height(1030, 2045), rqt_height(1000, 2060), rqt_height(1000, 2000);
--> 10.0|5.0|0.0|0.0
SELECT rqt_height(1080, 2000), rqt_height(1079, 2001), rqt_height(1080, 2010), rqt_height(1070, 2000), rqt_height(999.9, 2060), rqt_height(1000, 2060.1);
--> NULL|NULL|0.0|0.0|NULL|NULL
SELECT rqt_height(1030, 2040, 9.96875), rqt_height(1030, 2040, 10), rqt_height(1030, 2040, 0, 'spike');
--> 10.0|0.0|10.0
SELECT rqt_height(1e300, -1e300);
--> NULL
SELECT rqt_height(9e999, 0);
--! rqt_height(): x and y must be finite
-- The void takes both halves of its cell out, at every eps; the spike is an error of 10 m once it is not selected.
SELECT samples, max_error, x, y, t_junctions, overlaps, uncovered, area FROM rqt_verify(NULL, 10);
--> 62|10.0|1030.0|2040.0|0|0|0|4700.0
SELECT max_error, t_junctions, overlaps, uncovered, area, void_touched FROM rqt_verify(NULL, 0);
--> 0.0|0|0|0|4700.0|0
SELECT area FROM rqt_verify(NULL, 9e999);
--> 4700.0
SELECT count(*) FROM rqt_range(NULL, 9.96875) WHERE z = 10 AND error = 10.0;
--> 1
SELECT count(*) FROM rqt_range(NULL, 10) WHERE z <> 0;
--> 0
-- Every sample is within the bound by rqt_height, too.
WITH RECURSIVE c(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM c WHERE i < 8)
SELECT a.i, b.i FROM c a, c b, json_each('[0,1,2,5,9.96875]') e WHERE b.i <= 6 AND NOT (a.i = 8 AND b.i = 6)
  AND abs(coalesce(rqt_height(1000 + 10 * a.i, 2060 - 10 * b.i, e.value), 1e9) - (a.i = 3 AND b.i = 2) * 10) > e.value;

--# database two
SELECT name, width, height, min_z, max_z, max_error FROM rqt_terrains;
--> ramp|9|9|0.0|16.0|0.0
--> tent|5|5|0.0|8.0|8.0
SELECT level, bytes, selected FROM rqt_explain(NULL, 0, 'ramp');
--> 0|0|4
