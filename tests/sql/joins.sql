-- The table-valued functions in joins, views, triggers and indexes.
--# database tent
CREATE TABLE places(id INTEGER PRIMARY KEY, name TEXT, eps REAL, geom);
INSERT INTO places VALUES (1, 'north', 1, 'POINT(2 -0.5)'), (2, 'summit', 2, 'POINT(2 -2)'), (3, 'beyond', 1, 'POINT(9 9)'),
                          (4, 'root', 9e999, rqt_bbox(1.5, -2.5, 2.5, -1.5));

-- the place first, or last: the planner finds the only order that works
SELECT p.name, count(*) FROM places p, rqt_range(p.geom, 1) GROUP BY p.id;
--> north|3
--> summit|5
--> root|5
SELECT p.name, count(*) FROM rqt_range(p.geom, 1), places p GROUP BY p.id;
--> north|3
--> summit|5
--> root|5
SELECT p.name, count(*) FROM rqt_triangles(p.geom, 1) JOIN places p GROUP BY p.id;
--> north|1
--> summit|4
--> root|4
SELECT p.name, r.x, r.y FROM places p LEFT JOIN rqt_range(p.geom, 1) r WHERE p.id IN (1, 3) ORDER BY p.id, r.x, r.y;
--> north|0.0|0.0
--> north|2.0|-2.0
--> north|4.0|0.0
--> beyond|NULL|NULL
SELECT p.name, count(t.id) FROM places p LEFT JOIN rqt_triangles(p.geom, p.eps) t ON t.z0 >= 0 GROUP BY p.id;
--> north|1
--> summit|4
--> beyond|0
--> root|2
-- eps of each row; arguments out of a CTE; a subquery that depends on the row
SELECT p.name, v.triangles, v.max_error FROM places p, rqt_verify(p.geom, p.eps) v;
--> north|1|0.0
--> summit|4|0.0
--> beyond|0|0.0
--> root|2|8.0
WITH asked(region, eps) AS (VALUES ('POINT(2 -0.5)', 1), (NULL, 1), (NULL, 100))
SELECT asked.eps, count(*) FROM asked, rqt_triangles(asked.region, asked.eps) GROUP BY asked.region, asked.eps ORDER BY 2;
--> 1|1
--> 100|2
--> 1|4
SELECT name, (SELECT count(*) FROM rqt_triangles(places.geom, places.eps)) FROM places;
--> north|1
--> summit|4
--> beyond|0
--> root|2
SELECT name, length(rqt_mesh(geom, eps, 'indexed')) FROM places;
--> north|176
--> summit|236
--> beyond|128
--> root|200
-- A table of two calls, and a call for each row of a call.
SELECT count(*) FROM rqt_triangles(NULL, 1) a, rqt_triangles(NULL, 9e999) b;
--> 8
SELECT r.x, r.y, count(t.id) FROM rqt_range(NULL, 1) r, rqt_triangles('POINT(' || r.x || ' ' || r.y || ')', 1) t
GROUP BY 1, 2;
--> 0.0|-4.0|2
--> 0.0|0.0|2
--> 2.0|-2.0|4
--> 4.0|-4.0|2
--> 4.0|0.0|2
SELECT count(*) FROM rqt_range(NULL, 1) WHERE (x, y) IN (SELECT x, y FROM rqt_range(NULL, 100));
--> 4

-- Arguments as constraints. Those that are left out are NULL; those that are there are there in the row.
SELECT count(*) FROM rqt_range WHERE region = 'POINT(2 -0.5)' AND eps = 1;
--> 3
SELECT count(*) FROM rqt_range WHERE eps = 1 AND region IS NULL;
--! rqt_range(): region is missing
SELECT count(*) FROM rqt_range(NULL) WHERE eps = 1;
--> 5
SELECT DISTINCT region, eps, terrain, options FROM rqt_triangles('POINT(2 -0.5)', 1, 'tent');
--> POINT(2 -0.5)|1|tent|NULL
SELECT count(*) FROM rqt_triangles WHERE terrain = 'tent' AND options = '{"select":"topdown"}' AND eps = 1 AND region = 'POINT(2 -2)';
--> 4
SELECT eps, count(*) FROM rqt_triangles(NULL) WHERE eps IN (1, 9) GROUP BY eps;
--> 1|4
--> 9|2
SELECT count(*) FROM rqt_triangles(NULL, 1) WHERE eps = 2;
--> 0
SELECT p.name FROM places p, rqt_triangles t WHERE t.region = p.geom AND t.eps = p.eps AND t.id = 2 ORDER BY 1;
--> root
--> summit
-- two arguments that need each other
SELECT 1 FROM rqt_range(b.z, 1) a, rqt_range(a.z, 1) b;
--! no query solution

-- LIMIT, ORDER BY, rowid
SELECT seq FROM rqt_strip(NULL, 1) LIMIT 2 OFFSET 1;
--> 1
--> 2
SELECT id FROM rqt_triangles(NULL, 1) ORDER BY id DESC LIMIT 1;
--> 4
SELECT rowid FROM rqt_triangles(NULL, 1);
--> 1
--> 2
--> 3
--> 4

-- views, which a distrustful schema lets through
CREATE VIEW coarse AS SELECT * FROM rqt_triangles(NULL, 100);
SELECT count(*) FROM coarse;
--> 2
CREATE VIEW per_place AS SELECT p.name, t.id, t.z0 FROM places p, rqt_triangles(p.geom, p.eps) t;
SELECT name, count(*) FROM per_place GROUP BY name;
--> north|1
--> root|2
--> summit|4
CREATE VIEW everything AS
  SELECT (SELECT count(*) FROM rqt_range(NULL, 1)), (SELECT count(*) FROM rqt_strip(NULL, 1)) > 0,
         (SELECT triangles FROM rqt_verify(NULL, 1)), (SELECT count(*) > 0 FROM rqt_explain(NULL, 1)),
         (SELECT count(*) FROM rqt_check), (SELECT count(*) > 9 FROM rqt_help), (SELECT name FROM rqt_terrains),
         rqt_height(2, -2), length(rqt_mesh(NULL, 1, 'strip')) > 128, length(rqt_bbox(0, 0, 1, 1)), rqt_version() <> '';
SELECT * FROM everything;
--> 5|1|4|1|0|1|tent|8.0|1|133|1

-- triggers
CREATE TABLE visits(x, y, z);
CREATE TRIGGER heights AFTER INSERT ON visits BEGIN
  UPDATE visits SET z = rqt_height(NEW.x, NEW.y) WHERE rowid = NEW.rowid;
END;
INSERT INTO visits(x, y) VALUES (2, -2), (1, -1), (9, 9);
SELECT * FROM visits;
--> 2|-2|8.0
--> 1|-1|4.0
--> 9|9|NULL
CREATE TABLE meshes(place, x, y, z);
CREATE TRIGGER mesh AFTER UPDATE ON places BEGIN
  INSERT INTO meshes SELECT NEW.id, x, y, z FROM rqt_range(NEW.geom, NEW.eps);
END;
UPDATE places SET eps = 1 WHERE id <= 2;
SELECT place, count(*) FROM meshes GROUP BY place;
--> 1|3
--> 2|5
-- and what a statement makes of an answer
CREATE TABLE kept AS SELECT * FROM rqt_triangles(NULL, 1);
SELECT count(*), sum(z0 + z1 + z2) FROM kept;
--> 4|32.0

-- Deterministic functions may stand in indexes, generated columns and checks, the others may not.
CREATE TABLE boxes(x REAL, y REAL, box AS (rqt_bbox(x, y, x + 1, y + 1)) VIRTUAL, CHECK (length(rqt_circle(x, y, 1)) > 0));
CREATE INDEX boxes_box ON boxes(rqt_bbox(x, y, x + 1, y + 1));
INSERT INTO boxes VALUES (1, -2);
SELECT count(*) FROM boxes b, rqt_triangles(b.box, 1);
--> 2
SELECT count(*) FROM boxes WHERE rqt_bbox(x, y, x + 1, y + 1) = rqt_bbox(1, -2, 2, -1);
--> 1
CREATE INDEX block_state ON rqt_block_1(rqt_block_check(data));
SELECT DISTINCT rqt_block_check(data) FROM rqt_block_1;
--> ok
CREATE INDEX not_deterministic ON places(rqt_mesh(geom, eps, 'strip'));
--! non-deterministic
CREATE INDEX not_deterministic ON boxes(rqt_height(x, y));
--! non-deterministic
