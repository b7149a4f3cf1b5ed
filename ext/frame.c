/* frame.c - the option frame: meshes as points in space, geocentric (ecef) or east, north, up about the terrain's
 * centre (enu). Where the Earth closes on itself, so does the mesh. Views of terrains in degrees are in space,
 * whatever becomes of the answer: their rules have the same needs.
 *
 * Curvature. eps is lowered by what flat triangles of each size are off (geo_frame_sag): then no sample is further
 * than eps from its triangle in space.
 *
 * Seam. On a terrain whose first and last columns are the same meridian both copies of a place are one vertex, with
 * the height of the first column. So that the two rims fit, they must have the same vertices: whatever the mesh has
 * on one is forced on the other, again and again until nothing is new; forced vertices bring their ancestors. All
 * of the seam is looked at for every query, whatever its region, for all answers are parts of one mesh: that reads
 * the blocks along both columns.
 *
 * Poles. The samples of a row at latitude 90 are one vertex, with the height of the first that is valid; triangles
 * that lose their area by it are left out.
 *
 * Where samples that become one have different heights, vertices move by as much as that, and a plane no more than
 * its corners: so eps is lowered by the largest difference too, and an eps below it is refused.
 */
#include "view.h"

#include <math.h>
#include <string.h>

struct space_frame {
    const store_terrain *terrain;
    geo_frame *geo;
    double zero[3];        /* of enu: longitude, latitude and height of 0,0,0 */
    bool seam, pole[2];    /* first and last column are one; first, last row are a pole */
    rqt_vertex pole_at[2]; /* the first valid sample of a pole's row */
    int32_t pole_q[2];
    bool pole_known[2];
    int32_t *q; /* of the first column, then of the last one */
    uint8_t *valid;
    double merging; /* metres: the largest difference of heights that become one */
    char title[160];
};

static double latitude(const store_terrain *t, int32_t row) {
    return t->placement.y0 + row * t->placement.dy;
}

/* ------------------------------------------------------------------------------------------- what is one */

static void note_difference(space_frame *f, int32_t a, int32_t b) {
    const double d = fabs(rqt_unit_metres(&f->terrain->unit, a) - rqt_unit_metres(&f->terrain->unit, b));
    if (d > f->merging) f->merging = d;
}

static int read_seam(request *r, space_frame *f, char **error) {
    const store_terrain *t = f->terrain;
    const int32_t h = t->lattice.height;
    f->q = sqlite3_malloc64(2 * (sqlite3_uint64)h * sizeof *f->q);
    f->valid = sqlite3_malloc64(2 * (sqlite3_uint64)h);
    int code = f->q && f->valid ? SQLITE_OK : SQLITE_NOMEM;
    for (int c = 0; c < 2 && code == SQLITE_OK; c++)
        code =
            store_window(r->store, t, c ? t->lattice.width - 1 : 0, 0, 1, h, f->q + c * h, f->valid + c * h, error);
    for (int32_t y = 0; y < h && code == SQLITE_OK; y++)
        if (f->valid[y] && f->valid[h + y]) note_difference(f, f->q[y], f->q[h + y]);
    return code;
}

static int read_pole(request *r, space_frame *f, int p, char **error) {
    const store_terrain *t = f->terrain;
    const int32_t w = t->lattice.width, row = p ? t->lattice.height - 1 : 0;
    int32_t *q = sqlite3_malloc64((sqlite3_uint64)w * sizeof *q);
    uint8_t *valid = sqlite3_malloc64((sqlite3_uint64)w);
    int code = q && valid ? store_window(r->store, t, 0, row, w, 1, q, valid, error) : SQLITE_NOMEM;
    for (int32_t x = 0; x < w && code == SQLITE_OK; x++) {
        if (!valid[x]) continue;
        if (!f->pole_known[p]) f->pole_q[p] = q[x], f->pole_at[p] = (rqt_vertex){x, row};
        f->pole_known[p] = true;
        note_difference(f, f->pole_q[p], q[x]);
    }
    sqlite3_free(q);
    sqlite3_free(valid);
    return code;
}

/* The sample whose place and height a vertex has in space; *q its height. */
static rqt_vertex stand_in(const space_frame *f, rqt_vertex v, int32_t *q) {
    const store_terrain *t = f->terrain;
    const int32_t last = t->lattice.height - 1;
    for (int p = 0; p < 2; p++)
        if (f->pole[p] && f->pole_known[p] && v.y == (p ? last : 0)) {
            *q = f->pole_q[p];
            return f->pole_at[p];
        }
    if (f->seam && v.x == t->lattice.width - 1 && f->valid[v.y]) {
        *q = f->q[v.y];
        return (rqt_vertex){0, v.y};
    }
    return v;
}

/* ----------------------------------------------------------------------------------------------- closure */

/* The rows in which the mesh has vertices on the first and on the last column. */
static int seam_rows(request *r, space_frame *f, uint8_t *on, char **error) {
    const store_terrain *t = f->terrain;
    const int32_t w = t->lattice.width, h = t->lattice.height;
    const double west = t->placement.x0, east = west + (w - 1) * t->placement.dx, first = t->placement.y0,
                 last = first + (h - 1) * t->placement.dy;
    const double rims[8] = {west, first, west, last, east, first, east, last};
    const size_t two[2] = {2, 2};
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_patch patch = {0};
    rqt_status status = rqt_geometry_of_lines(rims, two, 2, 0, store_allocator(), &geometry);
    if (status == RQT_OK)
        status = rqt_region_create(geometry, &t->placement, &t->lattice, store_allocator(), &region);
    int code = status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
    store_query_options options = r->options;
    options.product = RQT_PRODUCT_TRIANGLES;
    options.wants_leaves = false;
    if (code == SQLITE_OK) code = store_query(r->store, t, region, r->eps, &options, &patch, NULL, error);
    memset(on, 0, 2 * (size_t)h);
    for (size_t i = 0; i < patch.vertex_count && code == SQLITE_OK; i++) {
        const rqt_patch_vertex *v = &patch.vertices[i];
        if (v->col == 0) on[v->row] = 1;
        if (v->col == w - 1) on[h + v->row] = 1;
    }
    store_keep(r->store, &patch);
    rqt_region_free(region);
    rqt_geometry_free(geometry);
    return code;
}

static int close_seam(request *r, space_frame *f, char **error) {
    const int32_t w = f->terrain->lattice.width, h = f->terrain->lattice.height;
    uint8_t *on = sqlite3_malloc64(4 * (sqlite3_uint64)h), *forced = on ? on + 2 * h : NULL;
    int code = on ? SQLITE_OK : SQLITE_NOMEM;
    if (on) memset(on, 0, 4 * (size_t)h);
    for (bool more = true; more && code == SQLITE_OK;) {
        code = seam_rows(r, f, on, error);
        more = false;
        for (int32_t y = 0; y < h && code == SQLITE_OK; y++) {
            const int32_t lacks = on[y] ? 1 : 0; /* the rim that has no vertex there */
            if (on[y] == on[h + y] || !f->valid[y] || !f->valid[h + y] || forced[lacks * h + y]) continue;
            forced[lacks * h + y] = 1;
            more = true;
            if (rqt_rule_force(r->options.rule, (rqt_vertex){lacks ? w - 1 : 0, y}) != RQT_OK) code = SQLITE_NOMEM;
        }
    }
    sqlite3_free(on);
    return code;
}

/* ----------------------------------------------------------------------------------------------- request */

static bool holds_word(const char *text, const char *word) {
    const size_t n = strlen(word);
    for (; *text; text++)
        if (sqlite3_strnicmp(text, word, (int)n) == 0) return true;
    return false;
}

bool terrain_is_above_geoid(const store_terrain *t) {
    return holds_word(t->vertical, "EGM96");
}

static int lower_eps(request *r, space_frame *f, char **error) {
    const store_terrain *t = f->terrain;
    const rqt_placement *at = &t->placement;
    const double x = at->x0 + (t->lattice.width - 1) * at->dx, y = at->y0 + (t->lattice.height - 1) * at->dy;
    const double exaggeration = r->view ? r->view->scene.exaggeration : 1;
    const double low = rqt_unit_metres(&t->unit, t->min_q), high = rqt_unit_metres(&t->unit, t->max_q);
    const geo_extent extent = {.west = fmin(at->x0, x),
                               .east = fmax(at->x0, x),
                               .south = fmin(at->y0, y),
                               .north = fmax(at->y0, y),
                               .lon_step = fabs(at->dx),
                               .lat_step = fabs(at->dy),
                               .lowest = fmin(low, high) * exaggeration,
                               .highest = fmax(low, high) * exaggeration};
    double lowering[RQT_RANKS];
    geo_frame_sag(f->geo, &extent, RQT_RANKS, lowering);
    for (int i = 0; i < RQT_RANKS; i++) lowering[i] = lowering[i] / exaggeration + f->merging;
    return rqt_rule_set_lowering(r->options.rule, lowering) == RQT_OK
               ? SQLITE_OK
               : fail(error, "terrain %s is too large for option \"frame\"", t->name);
}

/* What the option wants of the terrain. */
static int check_option(const request *r, const char *name, char **error) {
    const store_terrain *t = r->terrain;
    if (!t->lonlat || !t->wgs84)
        return fail(error, "option \"frame\":\"%s\" is for terrains in longitude and latitude on WGS 84; %s is not",
                    name, t->name);
    if (!terrain_is_above_geoid(t) && t->vertical[0] && !holds_word(t->vertical, "ellipsoid"))
        return fail(
            error,
            "option \"frame\":\"%s\": the heights of terrain %s are \"%s\"; only heights above the ellipsoid and "
            "above EGM96 can be placed in space",
            name, t->name, t->vertical);
    return SQLITE_OK;
}

/* name: of the option; NULL: a view alone needs it. */
static int create(const request *r, const char *name, space_frame **out, char **error) {
    const store_terrain *t = r->terrain;
    space_frame *f = sqlite3_malloc(sizeof *f);
    *out = f;
    if (!f) return SQLITE_NOMEM;
    memset(f, 0, sizeof *f);
    f->terrain = t;
    const double lon = t->placement.x0 + (t->lattice.width - 1) / 2.0 * t->placement.dx,
                 lat = t->placement.y0 + (t->lattice.height - 1) / 2.0 * t->placement.dy;
    f->zero[0] = lon, f->zero[1] = lat;
    if (r->frame_kind == FRAME_ENU)
        sqlite3_snprintf(sizeof f->title, f->title, "%s, frame enu about longitude %!.15g latitude %!.15g height 0",
                         t->name, lon, lat);
    else
        sqlite3_snprintf(sizeof f->title, f->title, "%s, frame ecef", t->name);
    char why[256] = "";
    const geo_ellipsoid ellipsoid = r->view ? r->view->scene.ellipsoid : GEO_WGS84;
    const int status = geo_frame_create(r->frame_kind == FRAME_ENU ? GEO_ENU : GEO_ECEF, &ellipsoid, lon, lat,
                                        name && terrain_is_above_geoid(t), &f->geo, why, sizeof why);
    if (status != GEO_OK)
        return status == GEO_NO_MEMORY ? SQLITE_NOMEM : fail(error, "option \"frame\":\"%s\": %s", name, why);
    f->seam = fabs(fabs((t->lattice.width - 1) * t->placement.dx) - 360) < 1e-9 * 360;
    for (int p = 0; p < 2; p++)
        f->pole[p] = fabs(fabs(latitude(t, p ? t->lattice.height - 1 : 0)) - 90) < 1e-9 * 90;
    return SQLITE_OK;
}

/* Heights that are one place in space: what is left of the promise. */
static int check_merging(request *r, const space_frame *f, const char *name, char **error) {
    if (rule_least_eps(r) < f->merging)
        return fail(
            error,
            "option \"frame\":\"%s\": heights of terrain %s that are one place in space differ by up to %!.15g "
            "metres; eps must be at least that",
            name, f->terrain->name, f->merging);
    const int32_t side = 1 << f->terrain->lattice.K;
    if (r->view && rqt_field_least(r->view->field, 0, 0, side, side) < f->merging) r->view->guaranteed = false;
    return SQLITE_OK;
}

/* The rule is given what the frame takes. */
static int close_up(request *r, space_frame *f, const char *name, char **error) {
    if (f->seam && r->max_vertices > 0)
        return fail(
            error,
            "option \"max_vertices\" does not go with option \"frame\":\"%s\" on terrain %s, which closes on "
            "itself: what its two rims need depends on eps",
            name, f->terrain->name);
    int code = f->seam ? read_seam(r, f, error) : SQLITE_OK;
    for (int p = 0; p < 2 && code == SQLITE_OK && name; p++)
        if (f->pole[p]) code = read_pole(r, f, p, error);
    if (!name) f->merging = 0; /* nothing is merged */
    if (code == SQLITE_OK && name) code = check_merging(r, f, name, error);
    if (code == SQLITE_OK) code = lower_eps(r, f, error);
    return code == SQLITE_OK && f->seam ? close_seam(r, f, error) : code;
}

int frame_read(request *r, char **error) {
    static const char *const names[] = {NULL, "ecef", "enu"};
    const char *name = names[r->frame_kind];
    if (!name && !(r->view && r->terrain->lonlat)) return SQLITE_OK;
    int code = name ? check_option(r, name, error) : SQLITE_OK;
    if (code != SQLITE_OK) return code;
    space_frame *f = NULL;
    code = create(r, name, &f, error);
    if (code == SQLITE_OK) code = close_up(r, f, name, error);
    if (name)
        r->frame = f;
    else
        frame_free(f);
    return code;
}

void frame_free(space_frame *f) {
    if (!f) return;
    geo_frame_free(f->geo);
    sqlite3_free(f->q);
    sqlite3_free(f->valid);
    sqlite3_free(f);
}

/* ------------------------------------------------------------------------------------------------- patch */

typedef struct sample_place {
    rqt_vertex at;
    uint32_t vertex, used;
} sample_place;

/* The number of a sample that several vertices may have become; `vertex` when it is the first. */
static uint32_t find_place(sample_place *table, size_t size, rqt_vertex at, uint32_t vertex) {
    size_t slot = ((uint32_t)at.x * 2654435761u ^ (uint32_t)at.y * 2246822519u) & (size - 1);
    while (table[slot].used && (table[slot].at.x != at.x || table[slot].at.y != at.y))
        slot = (slot + 1) & (size - 1);
    if (!table[slot].used) table[slot] = (sample_place){at, vertex, 1};
    return table[slot].vertex;
}

int frame_merge(const space_frame *f, rqt_patch *patch) {
    if (!f || !(f->seam || f->pole[0] || f->pole[1])) return SQLITE_OK;
    size_t size = 64;
    while (size < 2 * patch->vertex_count) size *= 2;
    sample_place *table = sqlite3_malloc64(size * sizeof *table);
    uint32_t *now = sqlite3_malloc64((patch->vertex_count + 1) * sizeof *now);
    const int code = table && now ? SQLITE_OK : SQLITE_NOMEM;
    if (code == SQLITE_OK) {
        memset(table, 0, size * sizeof *table);
        uint32_t kept = 0;
        for (size_t i = 0; i < patch->vertex_count; i++) {
            rqt_patch_vertex v = patch->vertices[i];
            const rqt_vertex at = stand_in(f, (rqt_vertex){v.col, v.row}, &v.q);
            v.col = at.x, v.row = at.y;
            now[i] = find_place(table, size, at, kept);
            rqt_patch_vertex *there = &patch->vertices[now[i]];
            if (now[i] == kept) {
                *there = v;
                kept++;
            } else {
                if (v.error > there->error) there->error = v.error;
                if (v.level < there->level) there->level = v.level;
            }
        }
        patch->vertex_count = kept;
        for (size_t i = 0; i < patch->strip_count; i++) patch->strip[i] = now[patch->strip[i]];
        size_t triangles = 0;
        for (size_t t = 0; patch->triangles && t < patch->triangle_count; t++) {
            const uint32_t *c = patch->triangles + 3 * t;
            const uint32_t a = now[c[0]], b = now[c[1]], d = now[c[2]];
            if (a == b || b == d || d == a) continue; /* at a pole */
            uint32_t *to = patch->triangles + 3 * triangles++;
            to[0] = a, to[1] = b, to[2] = d;
        }
        for (size_t i = 2; i < patch->strip_count; i++) {
            const uint32_t *c = patch->strip + i - 2;
            triangles += c[0] != c[1] && c[1] != c[2] && c[2] != c[0];
        }
        if (patch->triangles || patch->strip) patch->triangle_count = triangles;
    }
    sqlite3_free(table);
    sqlite3_free(now);
    return code;
}

int frame_places(const space_frame *f, const rqt_patch *patch, double **xyz, char **error) {
    const rqt_placement *at = &f->terrain->placement;
    *xyz = sqlite3_malloc64((3 * patch->vertex_count + 1) * sizeof **xyz);
    if (!*xyz) return SQLITE_NOMEM;
    for (size_t i = 0; i < patch->vertex_count; i++) {
        const rqt_patch_vertex *v = &patch->vertices[i];
        double lonlath[3] = {at->x0 + v->col * at->dx, latitude(f->terrain, v->row),
                             rqt_unit_metres(&f->terrain->unit, v->q)};
        /* A row of cells ends at the pole, and its last place beyond it, by a rounding. */
        if ((f->pole[0] && v->row == 0) || (f->pole[1] && v->row == f->terrain->lattice.height - 1))
            lonlath[1] = copysign(90, lonlath[1]);
        double *p = *xyz + 3 * i;
        geo_frame_place(f->geo, lonlath, p);
        if (!isfinite(p[0]) || !isfinite(p[1]) || !isfinite(p[2]))
            return fail(error, "option \"frame\": no place in space at %!.15g, %!.15g", lonlath[0], lonlath[1]);
    }
    return SQLITE_OK;
}

const double *frame_zero(const space_frame *f) {
    return f->zero;
}

const char *frame_title(const space_frame *f) {
    return f->title;
}
