#!/usr/bin/env bash
# stability.sh [PICTURE] - `make stability`: the page examples/STABILITY.md on stdout, and its picture.
#
# All figures are computed: meshes of published methods and of rqt on the catalogue's inputs, rasterised by the verifier
# (stability.c), and the list of cases with their tests and mutants (check_catalogue.sh). No clock and no chance: the same
# page every time, so `make check-docs` compares it.
set -euo pipefail
cd "$(dirname "$0")/../.."
BUILD=${BUILD:-build}
picture=${1:-}
rows=$("$BUILD/tests/stability")
table=$(mktemp)
trap 'rm -f "$table"' EXIT
echo "$rows" >"$table"
cat <<'TEXT'
# Stability: where methods fail

A terrain mesh with a stated accuracy is easy to get nearly right: on smooth hills most ways of choosing vertices give nearly the same. This page is about the rest.
It holds inputs on which published methods break what their meshes are said to keep, small ones, made for the purpose, and what rqt gives on the same. Each
mesh is rasterised over every sample by the verifier of `rqt_verify`, which knows nothing of how meshes are made; so no figure here is a method's own
opinion of itself. The page is the output of `make stability`, and `make check-docs` compares it with what the code gives today.

![How far meshes are from the data, as a multiple of the tolerance asked for: rqt never above one](charts/stability.png)

## Methods on inputs made for them
*error / eps*: the largest vertical distance of a sample from the mesh, over the tolerance eps; above 1 the tolerance was no promise. Where patches have
an eps each, the worst patch counts. *cracks*: T-junctions, where the surface can open. *misfits*: triangles that overlap or have no area, and half-cells of the
grid that are covered though a corner is void, or the other way round. *vertices*: of the mesh. A method fails when it breaks the bound, cracks, misfits, or takes
more than half as many vertices again as rqt.

| method | what it does | from |
|---|---|---|
| local | the error of a vertex is its distance from the edge that it splits, saturated over descendants | most papers; RTIN, Martini |
| one level | the same without saturation: refine where the vertex at hand errs more than eps | view-dependent quadtrees |
| euclid | distance at right angles to the triangle | error measures for rendering |
| wedgie | sums of local errors down the tree | ROAM |
| error >= eps | a vertex whose error equals eps is taken | Pajarola 1998, theorem 7.2 |
| one step | patches of different eps take over the vertices of each other's borders and what these depend on directly | Pajarola 1998, section 9 |
| helpers | the same with all that they depend on, at interpolated heights | Pajarola 1998, section 9 |
| tile alone | errors of each tile from its own samples, borders not exchanged | RTIN, tile by tile |
| float32 | heights, or coordinates, in single precision | renderers, SQLite's R-tree |
| padded | the raster is filled up to 2^k + 1 samples with zeros | whatever takes 2^k + 1 only |
| voids ignored | errors of valid samples alone; leaves with a void corner are left out | |

A second table is of views, hills of 129 x 129 samples 30 m apart seen by a camera of 1600 x 900 pixels. *displacement / tau*: how far a sample is from the mesh at its place in the
picture when either is drawn, over the tolerance in pixels, the worst of all samples. `ulrich`, `node`, `sphere`, `lindstrom`, `lodmap`: the tests of the literature, each with its own metric
(METHODS.md, "Views"), stitched by rqt; float32: rqt's mesh by coordinates in single precision. rqt: the guaranteed test.

TEXT
cat "$table"
cat <<'TEXT'

The numbers are those of the list below. `local` and `euclid` are metrics of rqt, too (`options.metric`), for comparing; what they are is in
[METHODS.md](../src/core/METHODS.md).

## Every case
Each case is a test, named after its number. It is known to be able to fail: either a published method fails it above, or a *mutant* does, the program with one line
broken on purpose, which that very test has to notice (`make mutants`).

TEXT
STABILITY=$table tests/check_catalogue.sh list || true
[[ -n $picture ]] || exit 0
bars=$(mktemp)
trap 'rm -f "$table" "$bars"' EXIT
"$BUILD/tests/stability" bars >"$bars"
count=$(wc -l <"$bars")
gnuplot <<PLOT
set encoding utf8
set terminal pngcairo size 900,$((150 + 30 * count)) font 'DejaVu Sans,12' background '#ffffff'
set output '$picture'
set border 3 lc rgb '#444444'
set tics nomirror
set grid xtics lt 1 dt 1 lc rgb '#e4e4e4' lw 0.7
set title 'True maximum error over the tolerance asked for' font ',14'
set xlabel 'error / eps; left of the line the tolerance is a promise'
set key bottom right noenhanced
set lmargin 18
set xrange [0:*]
set yrange [$count.5:0.5]
set arrow 1 from 1,graph 0 to 1,graph 1 nohead lc rgb '#444444' lw 1.5 front
set style fill solid 0.9 noborder
plot '$bars' using (\$2/2):(\$0+0.85):(\$2/2):(0.16):ytic(stringcolumn(1)) with boxxyerror lc rgb '#d1495b' title 'published method', \\
     '' using (\$3/2):(\$0+1.19):(\$3/2):(0.16) with boxxyerror lc rgb '#21918c' title 'rqt', \\
     '' using 2:(\$0+0.85):(sprintf('  %.2f', \$2)) with labels left font ',10' textcolor rgb '#444444' notitle
PLOT
