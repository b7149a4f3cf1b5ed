#!/bin/bash
# sql_reference.sh BUILD - the SQL reference as Markdown, from rqt_help.
cat <<'HEAD'
# SQL reference

Written by `make docs` from the table in `ext/functions.c`; the same rows as `SELECT * FROM rqt_help`. Every example runs in the
database that `make demo` makes, and in the tests.

**Region**: NULL (all), WKT or EWKT text, a GeoPackage or SpatiaLite geometry. Without an SRID it is in the terrain's CRS. **eps**:
metres, 0 or more; 0 is lossless, 9e999 the coarsest. **terrain**: a name; NULL or left out: the only one. **options**: a JSON
object; this version knows `mode` cover, snap, border or cut, `detail`, `outline` exact or tol, `metric` exact, minimal, local, wedgie or euclid
(src/core/METHODS.md: what they are, and which are bounds), `select` threshold, topdown or bottomup (the same mesh three ways), `strip` bintree or
fan (the same triangles), and `max_vertices`, a number: then eps is the least, and the mesh that of the smallest eps within that many vertices
(hidden column achieved_eps). Metrics but exact, unless stored by `rqt import --minimal`, are computed from all heights at their first use, in
at most 512 MiB.

`mode` cover takes every triangle whose interior meets that of the region, whole (lines and points: every triangle that they touch); border
splits triangles along the region's border until the mesh is exactly the half cells of the samples that meet the region, a rectangle grown
outward to samples first. Lines and points have no border: they are covered.

`detail` gives places an eps of their own: `[[geometry as text, eps], ...]`, or the name of a table or view (`table` or `schema.table`) of the
connection with a column `eps` and one geometry column: the one registered for GeoPackage or SpatiaLite, else the one declared as a geometry,
else one named geom, geometry, shape or the_geom; text or BLOB. No valid sample under the mesh is further off than the least eps of all places that
hold it, nor than the mesh's own. Wherever one asks, with the same detail all answers are parts of one mesh. Detail and mode border go with the
metrics exact and wedgie:
`rqt_range('POINT(-71.3 44.27)', 20, NULL, '{"detail":[["LINESTRING(-71.4 44.2, -71.2 44.3)", 0.5]]}')`.

Options come after the terrain, which may be NULL: `rqt_range('SRID=4326;POINT(-71.3 44.27)', 10, NULL, '{"select":"bottomup"}')`.

Columns called *hidden* do not show in `SELECT *`, but can be selected by name.

A query answers with every triangle of the terrain's mesh at eps whose interior meets the interior of the region; for lines
and points, every triangle that they touch. Triangles of any two answers at one eps are equal or disjoint (given the metric).
HEAD
sqlite3 :memory: -cmd ".load $1/rqt.so" "
SELECT char(10) || '## ' || name || '(' || arguments || ')' || char(10) || char(10) ||
       CASE kind WHEN 'table' THEN 'Columns: ' ELSE 'Gives: ' END || returns || '. ' || purpose || CASE WHEN hidden <> '' THEN ' Hidden: ' || hidden || '.' ELSE '' END || char(10) || char(10) ||
       '    ' || example || ';'
FROM rqt_help"
