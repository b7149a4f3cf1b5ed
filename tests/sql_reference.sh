#!/bin/bash
# sql_reference.sh BUILD - the SQL reference as Markdown, from rqt_help.
cat <<'HEAD'
# SQL reference

Written by `make docs` from the table in `ext/functions.c`; the same rows as `SELECT * FROM rqt_help`. Every example runs in the
database that `make demo` makes, and in the tests.

**Region**: NULL (all), WKT or EWKT text, a GeoPackage or SpatiaLite geometry. Without an SRID it is in the terrain's CRS. **eps**:
metres, 0 or more; 0 is lossless, 9e999 the coarsest. **terrain**: a name; NULL or left out: the only one. **options**: a JSON
object; this version knows `mode` cover, `outline` exact, `metric` exact, minimal, local, wedgie or euclid (src/core/METHODS.md: what
they are, and which are bounds), `select` threshold, topdown or bottomup (the same mesh three ways), `strip` bintree or fan (the same
triangles), and `max_vertices`, a number: then eps is the least, and the mesh that of the smallest eps within that many vertices
(hidden column achieved_eps). Metrics but exact, unless stored by `rqt import --minimal`, are computed from all heights at their first use, in
at most 512 MiB.

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
