/* seam.c - a terrain that goes once around the Earth closes: what is the west side of its first tiles is the east
 * side of its last ones, and both have the same vertices, heights and normals.
 *
 * The first and the last column are one meridian. Two parts of a mesh differ there all the same, for it knows
 * nothing of what lies beyond its border. So whatever vertices one column has are forced on the other, again and
 * again until nothing is new; forced vertices bring their ancestors (ext/frame.c does so for meshes in space). That
 * depends on eps, hence each level has a rule of its own, and all of its tiles are parts of one mesh as ever. Reads
 * the blocks along both columns, once a level.
 *
 * Both have the heights of the first column. By as much as the last one's differ (rasters made by resampling differ
 * by a rounding) vertices are moved, and what tiles on both sides state has it. Columns that contradict each other,
 * in voids or by more than levels can bear, are two: no mesh is true to both.
 */
#include "earth.h"
#include "kind.h"

#include <math.h>
#include <string.h>

/* Of a sample's width on the ground. The last level of quantized-mesh has a geometric error of four times that, or
 * more: it has 32 samples a side at least. */
#define MOST_MERGED (1.0 / 32)

static void compare_columns(const store_terrain *t, const int32_t *q, const uint8_t *valid, double *most) {
    const int32_t h = t->lattice.height;
    for (int32_t y = 0; y < h; y++) {
        if (valid[y] != valid[h + y]) *most = HUGE_VAL;
        if (!valid[y] || !valid[h + y]) continue;
        *most = fmax(*most, fabs(rqt_unit_metres(&t->unit, q[y]) - rqt_unit_metres(&t->unit, q[h + y])));
    }
}

int seam_read(tiles *t, tile_seam *seam, char **error) {
    const store_terrain *terrain = t->terrain;
    const int32_t w = terrain->lattice.width, h = terrain->lattice.height;
    if (fabs((w - 1) * terrain->placement.dx - 360) > 1e-9 * 360) return SQLITE_OK;
    seam->q = sqlite3_malloc64(2 * (sqlite3_uint64)h * sizeof *seam->q);
    uint8_t *valid = sqlite3_malloc64(2 * (sqlite3_uint64)h);
    int code = seam->q && valid ? SQLITE_OK : SQLITE_NOMEM;
    for (int c = 0; c < 2 && code == SQLITE_OK; c++)
        code = store_window(t->store, terrain, c ? w - 1 : 0, 0, 1, h, seam->q + c * h, valid + c * h, error);
    if (code == SQLITE_OK) compare_columns(terrain, seam->q, valid, &seam->merging);
    if (code != SQLITE_OK || seam->merging > terrain->placement.dx * DEGREE * EARTH_A * MOST_MERGED)
        seam_free(seam);
    sqlite3_free(valid);
    return code;
}

void seam_free(tile_seam *seam) {
    sqlite3_free(seam->q);
    *seam = (tile_seam){0};
}

double seam_merge(const tiles *t, const tile_seam *seam, rqt_patch *patch) {
    const int32_t last = t->terrain->lattice.width - 1;
    double most = 0;
    for (size_t i = 0; seam->q && i < patch->vertex_count; i++) {
        rqt_patch_vertex *v = &patch->vertices[i];
        if (v->col != 0 && v->col != last) continue;
        v->q = seam->q[v->row];
        most = seam->merging; /* of the first column too, where samples of the last one are as well */
    }
    return most;
}

/* Both columns as lines. */
static int make_rims(const store_terrain *t, rqt_region **region) {
    const rqt_placement as_it_is = {0, 0, 1, 1};
    const double last = t->lattice.height - 1, east = t->lattice.width - 1;
    const double rims[8] = {0, 0, 0, last, east, 0, east, last};
    const size_t two[2] = {2, 2};
    rqt_geometry *geometry = NULL;
    rqt_status status = rqt_geometry_of_lines(rims, two, 2, 0, store_allocator(), &geometry);
    if (status == RQT_OK) status = rqt_region_create(geometry, &as_it_is, &t->lattice, store_allocator(), region);
    rqt_geometry_free(geometry);
    return status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

/* The rows in which the level's mesh has vertices on the first column, and on the last one. */
static int read_rows(tiles *t, const rqt_region *rims, double eps, const store_query_options *options, uint8_t *on,
                     char **error) {
    const int32_t w = t->terrain->lattice.width, h = t->terrain->lattice.height;
    rqt_patch patch = {0};
    const int code = store_query(t->store, t->terrain, rims, eps, options, &patch, NULL, error);
    memset(on, 0, 2 * (size_t)h);
    for (size_t i = 0; i < patch.vertex_count && code == SQLITE_OK; i++) {
        const rqt_patch_vertex *v = &patch.vertices[i];
        if (v->col == 0) on[v->row] = 1;
        if (v->col == w - 1) on[h + v->row] = 1;
    }
    store_keep(t->store, &patch);
    return code;
}

/* on: room for four columns. */
static int force_rows(tiles *t, const rqt_region *rims, double eps, const store_query_options *options, uint8_t *on,
                      char **error) {
    const int32_t w = t->terrain->lattice.width, h = t->terrain->lattice.height;
    uint8_t *forced = on + 2 * (size_t)h;
    int code = SQLITE_OK;
    memset(forced, 0, 2 * (size_t)h);
    for (bool more = true; more && code == SQLITE_OK;) {
        code = read_rows(t, rims, eps, options, on, error);
        more = false;
        for (int32_t y = 0; y < h && code == SQLITE_OK; y++) {
            const int lacks = on[y] ? 1 : 0; /* the column that has no vertex there */
            if (on[y] == on[h + y] || forced[lacks * h + y]) continue;
            forced[lacks * h + y] = 1;
            more = true;
            if (rqt_rule_force(options->rule, (rqt_vertex){lacks ? w - 1 : 0, y}) != RQT_OK) code = SQLITE_NOMEM;
        }
    }
    return code;
}

int seam_close(tiles *t, double eps, const store_query_options *options, char **error) {
    rqt_region *rims = NULL;
    uint8_t *on = sqlite3_malloc64(4 * (sqlite3_uint64)t->terrain->lattice.height);
    store_limits *limits = store_limits_of(t->store), of_answers = *limits;
    int code = on ? make_rims(t->terrain, &rims) : SQLITE_NOMEM;
    limits->triangles = 0; /* both columns are in no answer */
    if (code == SQLITE_OK) code = force_rows(t, rims, eps, options, on, error);
    *limits = of_answers;
    rqt_region_free(rims);
    sqlite3_free(on);
    return code;
}
