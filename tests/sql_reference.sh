#!/bin/bash
# sql_reference.sh BUILD - the SQL reference as Markdown, from rqt_help.
cat <<'HEAD'
# SQL reference

Written by `make docs` from the table in `ext/functions.c`; the same rows as `SELECT * FROM rqt_help`. Every example runs in the
database that `make demo` makes, and in the tests.

**Region**: NULL (all), WKT or EWKT text, a GeoPackage or SpatiaLite geometry. Without an SRID it is in the terrain's CRS; with another
SRID than the terrain's its vertices are transformed by SpatiaLite's ST_Transform, if mod_spatialite is loaded in the connection (in any
database: plain, GeoPackage or SpatiaLite), else it is refused. On a terrain
in degrees longitudes count modulo 360: a region meets the terrain on every turn, and answers are in the terrain's own coordinates, never
wrapped; a terrain that has a meridian twice answers both. Longitudes beyond 1080 are taken as they are. **eps**: metres, 0 or more; 0 is lossless, 9e999 the coarsest.
**terrain**: a name; NULL or left out: the only one. **options**: a JSON object or NULL, after the terrain, which may be NULL:
`rqt_range('SRID=4326;POINT(-71.3 44.27)', 10, NULL, '{"mode":"snap"}')`.

| option | values, the first is the default |
|---|---|
| `mode` | what happens at the region's border. `cover`: every triangle of the terrain's mesh at eps whose interior meets the interior of the region; for lines and points, every triangle that they touch. `snap`: cover of the region grown to whole squares of a grid, those whose interior meets the region's interior (for lines and points: that they touch), clipped to the terrain. The grid is anchored at sample (0,0); its side is the largest power of two, in samples, that is not above an eighth of the longer side of the region's box in whole samples, at least 1. `border`: triangles are split along the region's border until the mesh is exactly the half cells of the samples whose interior meets the region's interior, a rectangle grown outward to sample lines first; lines and points have no border, and answer as with cover. `cut`: the triangles of cover clipped to the region, so that the mesh has the region's area; new vertices lie on the leaf's plane; lines and points cannot be cut out, and answer as with cover |
| `detail` | places with an eps of their own: `[[geometry as text, eps], ...]`, or the name of a table or view (`table` or `schema.table`) of the connection with a column `eps` and one geometry column, text or BLOB: the one registered for GeoPackage or SpatiaLite, else the one declared as a geometry, else one named geom, geometry, shape or the_geom. No valid sample under the mesh is further off than the least eps of all places that hold it, nor than the mesh's own. With the same detail all answers are parts of one mesh: `'{"detail":[["LINESTRING(-71.4 44.2, -71.2 44.3)", 0.5]]}'`. Detail, mode border and frames go with the metrics exact and wedgie |
| `outline` | of voids. `exact`: exactly the half cells of the grid with three valid samples. `tol`: moved by at most eps * c metres of ground along rows and columns, c = `--void-tol` of the import: for overviews, which then read and hold less |
| `metric` | `exact`, `minimal`, `local`, `wedgie`, `euclid`, `plane`: src/core/METHODS.md says what they are, and which are bounds. All but exact, unless stored by `rqt import --minimal`, are computed from all heights at their first use, in at most 512 MiB |
| `select` | `threshold`, `topdown`, `bottomup`: the same mesh three ways |
| `strip` | `bintree`, `fan`: the same triangles. Not fan with mode cut |
| `max_vertices` | a number of 4 or more: then eps is the least, and the mesh that of the smallest eps within that many vertices (hidden column achieved_eps). Not with mode cut, nor with a frame on a terrain that goes round the Earth |
| `max_triangles` | of a view, 1 or more: the mesh of the smallest tolerance, tau or tau times a power of 2^(1/128), that has at most so many triangles; hidden column achieved_tau. What may be seen, and how finely tolerances differ, stay those of tau |
| `previous` | of a view: `""` begins a sequence, then the hidden column `token` of the last answer (format `increment` brings it along). An answer is then right for all cameras near its own: while the next one is, it is the same, else a new one, that of `""`. So it takes about 1.3 times the vertices. A token means the same to every connection; one that another terrain has given, or whose text has changed, is refused; with other options, or when the terrain has changed since, the answer is a new one. Only with the test guaranteed |
| `frame` | what the coordinates of a mesh are. `crs`: the terrain's x and y, and metres of height. `ecef`: metres about the Earth's centre (EPSG:4978). `enu`: metres east, north and up of the terrain's centre at height 0, whose place files tell in a comment. The last two are for terrains in longitude and latitude on WGS 84, not for mode cut, nor for the formats that hold samples, nor for rqt_area; rqt_verify proves such a mesh as it lies in the terrain's CRS. Heights are taken as above the ellipsoid when the vertical datum says so or is not known; above EGM96 they are converted by PROJ's grid egm96_15.gtx (Debian: proj-data); other datums are refused. No valid sample is further than eps from the flat triangle over it, in space: triangles are as small as the Earth's curvature asks. Both copies of a meridian, and the row of a pole, are one vertex, and the surface is closed there; where their heights differ, eps must be at least the difference |

Columns called *hidden* do not show in `SELECT *`, but can be selected by name.

Triangles of any two answers by cover or snap at one eps are equal or disjoint (given metric, outline, detail and frame).
HEAD
sqlite3 :memory: -cmd ".load $1/rqt.so" "
SELECT char(10) || '## ' || name || '(' || arguments || ')' || char(10) || char(10) ||
       CASE kind WHEN 'table' THEN 'Columns: ' ELSE 'Gives: ' END || returns || '. ' || purpose || CASE WHEN hidden <> '' THEN ' Hidden: ' || hidden || '.' ELSE '' END || char(10) || char(10) ||
       '    ' || example || ';'
FROM rqt_help"
