/* test_core_cut.c - mode `cut`: patches clipped to regions, against an oracle that integrates.
 *
 * The oracle knows no clipping: the area that a leaf and a region have in common is the sum, over the strips
 * between all heights at which anything begins, ends or crosses, of strip height times the length, in the middle of
 * the strip, of what is in the leaf and in some member by the even-odd rule. Long doubles hold that to 1e-15. What
 * must be so exactly (triangles have an area and turn one way, no two overlap, no vertex lies inside an edge,
 * places are one vertex each) is looked at one by one, pair by pair, in integers. */
#include "cut.h"
#include "test_core_database.h"

#define MOST_MEMBERS 3
#define MOST_RINGS 3
#define MOST_SPOTS 40

/* Polygons in units of 2^-20 sample, rings not closed, and the same as text. */
typedef struct shape {
    int members, rings[MOST_MEMBERS], spots[MOST_MEMBERS][MOST_RINGS];
    int64_t x[MOST_MEMBERS][MOST_RINGS][MOST_SPOTS], y[MOST_MEMBERS][MOST_RINGS][MOST_SPOTS];
    char text[32768];
} shape;

static void shape_say(shape *s) {
    size_t n = (size_t)snprintf(s->text, sizeof s->text, "MULTIPOLYGON(");
    for (int m = 0; m < s->members; m++) {
        n += (size_t)snprintf(s->text + n, sizeof s->text - n, m ? ",(" : "(");
        for (int r = 0; r < s->rings[m]; r++) {
            n += (size_t)snprintf(s->text + n, sizeof s->text - n, r ? ",(" : "(");
            for (int i = 0; i <= s->spots[m][r]; i++) {
                const int at = i % s->spots[m][r];
                n += (size_t)snprintf(s->text + n, sizeof s->text - n, "%s%.17g %.17g", i ? "," : "",
                                      (double)s->x[m][r][at] / ORACLE_UNITS, (double)s->y[m][r][at] / ORACLE_UNITS);
            }
            n += (size_t)snprintf(s->text + n, sizeof s->text - n, ")");
        }
        n += (size_t)snprintf(s->text + n, sizeof s->text - n, ")");
    }
    snprintf(s->text + n, sizeof s->text - n, ")");
}

enum { SHAPE_KINDS = 6 };
static const char *const shape_kinds[SHAPE_KINDS] = {
    "scribble", "rectangle", "star", "nested", "along lines and diagonals", "comb"};

static void shape_ring(shape *s, int m, int kind, int width, int height) {
    static const long grains[] = {ORACLE_UNITS, ORACLE_UNITS / 2, ORACLE_UNITS / 4, 1, 1};
    const long grain = grains[random_between(0, 4)];
    const int r = s->rings[m]++;
    int64_t *x = s->x[m][r], *y = s->y[m][r];
    int n = random_between(3, 9);
    if (kind == 1 || kind == 3) {
        long box[4];
        random_rectangle(width, height, grain, box);
        const int64_t bx[4] = {box[0], box[2], box[2], box[0]}, by[4] = {box[1], box[1], box[3], box[3]};
        const bool back = random_between(0, 1);
        for (int i = 0; i < 4; i++) {
            x[i] = bx[back ? 3 - i : i];
            y[i] = by[back ? 3 - i : i];
        }
        n = 4;
    } else if (kind == 2) { /* a star with long thin rays, often through one point */
        const double cx = random_unit() * width, cy = random_unit() * height;
        n = 2 * random_between(3, 15);
        for (int i = 0; i < n; i++) {
            const double angle = 6.283185307179586 * i / n,
                         far = i % 2 ? 0.02 + random_unit() : width * random_unit();
            x[i] = (int64_t)((cx + far * cos(angle)) * ORACLE_UNITS / (double)grain) * grain;
            y[i] = (int64_t)((cy + far * sin(angle)) * ORACLE_UNITS / (double)grain) * grain;
        }
    } else if (kind == 5) { /* a comb: its teeth pass through one leaf after the other, close together */
        n = 4 * random_between(2, 9);
        const int64_t x0 = random_coordinate(width, grain), y0 = random_coordinate(height, grain),
                      y1 = random_coordinate(height, grain), gap = grain * random_between(1, 2);
        for (int i = 0; i < n; i++) {
            x[i] = x0 + (i / 2) * gap;
            y[i] = i % 4 == 0 || i % 4 == 3 ? y0 : y1;
        }
    } else {
        for (int i = 0; i < n; i++) {
            x[i] = random_coordinate(width, grain);
            y[i] = random_coordinate(height, grain);
            if (i > 0 && kind == 4) {
                const int way = random_between(0, 3);
                if (way == 0) x[i] = x[i - 1];
                if (way == 1) y[i] = y[i - 1];
                if (way > 1) y[i] = y[i - 1] + (x[i] - x[i - 1]) * (way == 2 ? 1 : -1);
            }
        }
    }
    s->spots[m][r] = n;
}

/* ------------------------------------------------------------------------------------------ oracle -- */
typedef struct line {
    long double ax, ay, bx, by;
    int of; /* member; -1: the leaf */
} line;

static int ordered_numbers(const void *a, const void *b) {
    const long double x = *(const long double *)a, y = *(const long double *)b;
    return (x > y) - (x < y);
}

typedef struct span {
    long double from, to;
} span;

#define MOST_LINES (3 + MOST_MEMBERS * MOST_RINGS * MOST_SPOTS)

static int ordered_spans(const void *a, const void *b) {
    const span *x = a, *y = b;
    return (x->from > y->from) - (x->from < y->from);
}

/* Length of what lies, at height y, in the leaf and in some member. */
static long double common_length(const line *lines, size_t n, int members, long double y) {
    static long double x[MOST_LINES];
    static span spans[MOST_LINES];
    long double low = 0, high = 0;
    size_t spans_n = 0;
    for (int m = -1; m < members; m++) {
        size_t k = 0;
        for (size_t i = 0; i < n; i++) {
            const line *l = &lines[i];
            if (l->of == m && (l->ay < y) != (l->by < y))
                x[k++] = l->ax + (l->bx - l->ax) * (y - l->ay) / (l->by - l->ay);
        }
        qsort(x, k, sizeof *x, ordered_numbers);
        if (m < 0) {
            if (k < 2) return 0;
            low = x[0];
            high = x[1];
            continue;
        }
        for (size_t i = 0; i + 1 < k; i += 2) {
            const long double from = x[i] > low ? x[i] : low, to = x[i + 1] < high ? x[i + 1] : high;
            if (from < to) spans[spans_n++] = (span){from, to};
        }
    }
    qsort(spans, spans_n, sizeof *spans, ordered_spans);
    long double length = 0, done = low;
    for (size_t i = 0; i < spans_n; i++) {
        const long double from = spans[i].from > done ? spans[i].from : done;
        if (spans[i].to > from) length += spans[i].to - from;
        if (spans[i].to > done) done = spans[i].to;
    }
    return length;
}

static long double common_area(const oracle_point t[3], const shape *s) {
    static line lines[MOST_LINES];
    static long double cuts[MOST_LINES * (MOST_LINES + 2)];
    size_t n = 0, k = 0;
    long double top = 1e30L, bottom = -1e30L;
    for (int i = 0; i < 3; i++) {
        lines[n++] = (line){t[i].x, t[i].y, t[(i + 1) % 3].x, t[(i + 1) % 3].y, -1};
        top = t[i].y < top ? t[i].y : top;
        bottom = t[i].y > bottom ? t[i].y : bottom;
    }
    for (int m = 0; m < s->members; m++)
        for (int r = 0; r < s->rings[m]; r++)
            for (int i = 0; i < s->spots[m][r]; i++) {
                const int j = (i + 1) % s->spots[m][r];
                const long double u = ORACLE_UNITS;
                lines[n++] = (line){s->x[m][r][i] / u, s->y[m][r][i] / u, s->x[m][r][j] / u, s->y[m][r][j] / u, m};
            }
    for (size_t i = 0; i < n; i++) {
        const line *a = &lines[i];
        cuts[k++] = a->ay;
        cuts[k++] = a->by;
        for (size_t j = 0; j < i; j++) {
            const line *b = &lines[j];
            const long double rx = a->bx - a->ax, ry = a->by - a->ay, sx = b->bx - b->ax, sy = b->by - b->ay;
            const long double below = rx * sy - ry * sx;
            if (below == 0) continue;
            const long double share = ((b->ax - a->ax) * sy - (b->ay - a->ay) * sx) / below;
            if (share > -0.01L && share < 1.01L) cuts[k++] = a->ay + share * ry;
        }
    }
    qsort(cuts, k, sizeof *cuts, ordered_numbers);
    long double area = 0;
    for (size_t i = 0; i + 1 < k; i++) {
        if (cuts[i] >= bottom || cuts[i + 1] <= top || cuts[i] == cuts[i + 1]) continue;
        area += (cuts[i + 1] - cuts[i]) * common_length(lines, n, s->members, (cuts[i] + cuts[i + 1]) / 2);
    }
    return area;
}

/* A shell without an area is a line: another matter. */
static bool has_shells(const shape *s) {
    static shape one;
    const oracle_point all[3] = {{-1000, -1000}, {3000, -1000}, {-1000, 3000}};
    for (int m = 0; m < s->members; m++) {
        one.members = one.rings[0] = 1;
        one.spots[0][0] = s->spots[m][0];
        memcpy(one.x[0][0], s->x[m][0], sizeof one.x[0][0]);
        memcpy(one.y[0][0], s->y[m][0], sizeof one.y[0][0]);
        if (common_area(all, &one) < 1e-9L) return false; /* nothing but rounding */
    }
    return true;
}

static int random_shape(shape *s, int width, int height) {
    const int kind = random_between(0, SHAPE_KINDS - 1);
    memset(s, 0, sizeof *s);
    s->members = random_between(1, MOST_MEMBERS);
    for (int m = 0; m < s->members; m++) {
        const int rings = random_between(1, kind == 3 ? MOST_RINGS : 2);
        for (int r = 0; r < rings; r++) shape_ring(s, m, kind, width, height);
        if (m > 0 && random_between(0, 2) == 0) { /* a side of the member before, the other way round */
            s->x[m][0][0] = s->x[m - 1][0][1];
            s->y[m][0][0] = s->y[m - 1][0][1];
            s->x[m][0][1] = s->x[m - 1][0][0];
            s->y[m][0][1] = s->y[m - 1][0][0];
        }
    }
    if (!has_shells(s)) return random_shape(s, width, height);
    shape_say(s);
    return kind;
}

/* ------------------------------------------------------------------------------------------- checks -- */
typedef struct place {
    int64_t x, y;
} place;

static __int128 turn(place a, place b, place c) {
    return (__int128)(b.x - a.x) * (c.y - a.y) - (__int128)(b.y - a.y) * (c.x - a.x);
}

static int ordered_places(const void *a, const void *b) {
    const place *p = a, *q = b;
    return p->x != q->x ? (p->x < q->x ? -1 : 1) : (p->y > q->y) - (p->y < q->y);
}

/* Positions as integers; that they are some is part of the promise. */
static place *places_of(const rqt_cut *cut, int K) {
    place *p = calloc(cut->vertex_count + 1, sizeof *p);
    if (!p) abort();
    const double scale = ldexp(1, 52 - K);
    for (size_t i = 0; i < cut->vertex_count; i++) {
        const rqt_cut_vertex *v = &cut->vertices[i];
        p[i] = (place){(int64_t)(v->col * scale), (int64_t)(v->row * scale)};
        CHECK((double)p[i].x == v->col * scale && (double)p[i].y == v->row * scale, "vertex %zu is off the grid",
              i);
    }
    return p;
}

static bool apart(const place *s, const place *t) {
    for (int k = 0; k < 3; k++) {
        bool outside = true;
        for (int j = 0; j < 3; j++) outside = outside && turn(s[k], s[(k + 1) % 3], t[j]) >= 0;
        if (outside) return true;
    }
    return false;
}

/* Everything that must hold exactly; returns the area in samples. */
static long double check_mesh(const rqt_cut *cut, int K, const char *what) {
    place *at = places_of(cut, K), *sorted = places_of(cut, K);
    qsort(sorted, cut->vertex_count, sizeof *sorted, ordered_places);
    for (size_t i = 1; i < cut->vertex_count; i++)
        CHECK(ordered_places(&sorted[i - 1], &sorted[i]) != 0, "%s: a place is two vertices", what);
    long double area = 0;
    uint8_t *used = calloc(cut->vertex_count + 1, 1);
    place(*corner)[3] = calloc(cut->triangle_count + 1, sizeof *corner);
    if (!used || !corner) abort();
    for (size_t t = 0; t < cut->triangle_count; t++) {
        for (int k = 0; k < 3; k++) {
            const uint32_t v = cut->triangles[3 * t + (size_t)k];
            CHECK(v < cut->vertex_count, "%s: index", what);
            used[v] = 1;
            corner[t][k] = at[v];
        }
        const __int128 twice = turn(corner[t][0], corner[t][1], corner[t][2]);
        CHECK(twice < 0, "%s: triangle %zu is clockwise or has no area", what, t);
        area -= ldexpl((long double)twice, -1 - 2 * (52 - K));
    }
    for (size_t v = 0; v < cut->vertex_count; v++) CHECK(used[v], "%s: vertex %zu is in no triangle", what, v);
    for (size_t t = 0; t < cut->triangle_count; t++) {
        for (size_t u = 0; u < t; u++)
            CHECK(apart(corner[t], corner[u]) || apart(corner[u], corner[t]), "%s: triangles %zu, %zu overlap",
                  what, u, t);
        for (int k = 0; k < 3; k++) {
            const place a = corner[t][k], b = corner[t][(k + 1) % 3];
            for (size_t v = 0; v < cut->vertex_count; v++)
                if (turn(a, b, at[v]) == 0)
                    CHECK((__int128)(at[v].x - a.x) * (at[v].x - b.x) +
                                  (__int128)(at[v].y - a.y) * (at[v].y - b.y) >=
                              0,
                          "%s: vertex %zu lies inside an edge of triangle %zu", what, v, t);
        }
    }
    free(at);
    free(sorted);
    free(used);
    free(corner);
    return area;
}

/* Heights: each triangle lies on the plane of a leaf; vertices of the patch are as they were. */
static void check_heights(const rqt_cut *cut, const rqt_patch *patch, const char *what) {
    for (size_t t = 0; t < cut->triangle_count; t++) {
        const rqt_cut_vertex *c[3];
        double x = 0, y = 0;
        for (int k = 0; k < 3; k++) {
            c[k] = &cut->vertices[cut->triangles[3 * t + (size_t)k]];
            x += c[k]->col / 3;
            y += c[k]->row / 3;
        }
        bool found = false;
        for (size_t l = 0; l < patch->triangle_count && !found; l++) {
            const rqt_patch_vertex *p = &patch->vertices[patch->triangles[3 * l]],
                                   *q = &patch->vertices[patch->triangles[3 * l + 1]],
                                   *r = &patch->vertices[patch->triangles[3 * l + 2]];
            const double d =
                (double)(q->col - p->col) * (r->row - p->row) - (double)(r->col - p->col) * (q->row - p->row);
            const double b = ((x - p->col) * (r->row - p->row) - (r->col - p->col) * (y - p->row)) / d,
                         a = ((q->col - p->col) * (y - p->row) - (x - p->col) * (q->row - p->row)) / d;
            if (a < -1e-9 || b < -1e-9 || a + b > 1 + 1e-9) continue;
            found = true;
            for (int k = 0; k < 3; k++) {
                const double u = c[k]->col - p->col, v = c[k]->row - p->row;
                const double e = (u * (r->row - p->row) - (r->col - p->col) * v) / d,
                             f = ((q->col - p->col) * v - u * (q->row - p->row)) / d;
                const double plane = p->q + e * ((double)q->q - p->q) + f * ((double)r->q - p->q);
                found = found && fabs(plane - c[k]->q) < 1e-5 && e > -1e-9 && f > -1e-9 && e + f < 1 + 1e-9;
            }
        }
        CHECK(found, "%s: triangle %zu lies on no leaf", what, t);
    }
    for (size_t i = 0; i < cut->vertex_count; i++) {
        const rqt_cut_vertex *v = &cut->vertices[i];
        if (v->level < 0) {
            assert_int_equal(v->error, 0);
            continue;
        }
        bool same = false;
        for (size_t j = 0; j < patch->vertex_count && !same; j++) {
            const rqt_patch_vertex *p = &patch->vertices[j];
            same = v->col == p->col && v->row == p->row && v->q == p->q && v->error == p->error &&
                   v->level == p->level;
        }
        CHECK(same, "%s: vertex %zu is none of the patch's", what, i);
    }
}

static rqt_region *region_of_shape(const char *text, const rqt_lattice *lattice) {
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_message message = {""};
    CHECK(rqt_geometry_parse(text, strlen(text), true, &test_allocator, &geometry, &message) == RQT_OK, "%s: %s",
          text, message.text);
    assert_int_equal(rqt_region_create(geometry, &AT_ORIGIN, lattice, &test_allocator, &region), RQT_OK);
    rqt_geometry_free(geometry);
    return region;
}

static void check_cut(database *d, const shape *s, rqt_code eps, long double tolerance, const char *what) {
    rqt_region *region = region_of_shape(s->text, &d->lattice);
    rqt_patch patch;
    rqt_cut cut;
    assert_int_equal(
        database_query(d, region, eps, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT, &test_allocator, &patch), RQT_OK);
    assert_int_equal(rqt_cut_make(&patch, region, &d->lattice, &test_allocator, NULL, NULL, &cut), RQT_OK);
    long double wanted = 0;
    for (size_t t = 0; t < patch.triangle_count; t++) {
        oracle_point leaf[3];
        for (int k = 0; k < 3; k++) {
            const rqt_patch_vertex *v = &patch.vertices[patch.triangles[3 * t + (size_t)k]];
            leaf[k] = (oracle_point){v->col, v->row};
        }
        wanted += common_area(leaf, s);
    }
    const long double area = check_mesh(&cut, d->lattice.K, what);
    if (fabsl(area - wanted) > tolerance) print_error("%s\n", s->text);
    CHECK(fabsl(area - wanted) <= tolerance, "%s: area %.15Lg, should be %.15Lg", what, area, wanted);
    check_heights(&cut, &patch, what);
    rqt_patch_free(&patch);
    rqt_cut_free(&cut);
    rqt_region_free(region);
}

/* ------------------------------------------------------------------------------------------- tests -- */
static void F26_polygons_of_all_kinds_are_cut_to_their_area(void **state) {
    (void)state;
    random_begin(__func__);
    const surface surfaces[] = {SURFACE_HILLS, SURFACE_NOISE, SURFACE_PLANE, SURFACE_CLIFF_SLANTED};
    for (int n = 0; n < 60; n++) {
        raster r = raster_make(surfaces[n % 4], random_between(2, 21), random_between(2, 21), n % 3 ? -1 : 10);
        if (n % 3 == 1) raster_add_lake(&r);
        model m;
        database d;
        model_create(&m, r);
        const int k = random_between(smallest_k(&m.grid.lattice),
                                     largest_k(&m.grid.lattice) < 4 ? largest_k(&m.grid.lattice) : 4);
        assert_int_equal(database_create(&d, &m, k, &test_allocator), RQT_OK);
        for (int i = 0; i < 12; i++) {
            static shape s;
            const int kind = random_shape(&s, m.r.width, m.r.height);
            const rqt_code eps = i % 3 == 0
                                     ? RQT_CODE_LARGEST
                                     : rqt_code_floor(fabs(rqt_unit_factor(&m.r.unit)) * random_between(0, 50));
            check_cut(&d, &s, eps, 1e-9L, shape_kinds[kind]);
        }
        database_free(&d, &test_allocator);
        model_free(&m);
    }
}

/* Does a closed triangle meet a segment? A line parallel to a side of either, with them strictly on its two sides,
 * says no. */
static bool meets_segment(const place t[3], place a, place b) {
    bool left = false, right = false;
    for (int i = 0; i < 3; i++) {
        const place p = t[i], q = t[(i + 1) % 3], r = t[(i + 2) % 3];
        const bool up = turn(p, q, r) > 0;
        const __int128 of_a = turn(p, q, a), of_b = turn(p, q, b);
        if (up ? of_a < 0 && of_b < 0 : of_a > 0 && of_b > 0) return false;
        left |= turn(a, b, p) >= 0;
        right |= turn(a, b, p) <= 0;
    }
    return left && right;
}

/* A line cannot be cut out: beside polygons that are, it takes the leaves that it meets as they are. */
static void a_line_beside_polygons_takes_whole_leaves(void **state) {
    (void)state;
    random_begin(__func__);
    for (int n = 0; n < 20; n++) {
        model m;
        database d;
        model_create(&m, raster_make(SURFACE_HILLS, random_between(12, 30), random_between(12, 30), -1));
        assert_int_equal(database_create(&d, &m, 2, &test_allocator), RQT_OK);
        static shape s;
        while (random_shape(&s, m.r.width, m.r.height) != 1) {
        } /* rectangles */
        const place a = {random_between(0, 11), random_between(0, 11)}, b = {random_between(0, 11), 11 - a.y};
        char text[sizeof s.text + 100];
        (void)snprintf(text, sizeof text, "GEOMETRYCOLLECTION(LINESTRING(%d %d,%d %d),%s)", (int)a.x, (int)a.y,
                       (int)b.x, (int)b.y, s.text);
        rqt_region *region = region_of_shape(text, &d.lattice);
        rqt_patch patch;
        rqt_cut cut;
        assert_int_equal(database_query(&d, region, rqt_code_floor(5), RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT,
                                        &test_allocator, &patch),
                         RQT_OK);
        assert_int_equal(rqt_cut_make(&patch, region, &d.lattice, &test_allocator, NULL, NULL, &cut), RQT_OK);
        long double wanted = 0;
        for (size_t t = 0; t < patch.triangle_count; t++) {
            oracle_point leaf[3];
            place corner[3];
            for (int k = 0; k < 3; k++) {
                const rqt_patch_vertex *v = &patch.vertices[patch.triangles[3 * t + (size_t)k]];
                leaf[k] = (oracle_point){v->col, v->row};
                corner[k] = (place){v->col, v->row};
            }
            const __int128 twice = turn(corner[0], corner[1], corner[2]);
            wanted +=
                meets_segment(corner, a, b) ? (long double)(twice < 0 ? -twice : twice) / 2 : common_area(leaf, &s);
        }
        const long double area = check_mesh(&cut, d.lattice.K, "line");
        CHECK(fabsl(area - wanted) <= 1e-9L, "%s: area %.15Lg, should be %.15Lg", text, area, wanted);
        rqt_cut_free(&cut);
        rqt_patch_free(&patch);
        rqt_region_free(region);
        database_free(&d, &test_allocator);
        model_free(&m);
    }
}

/* The faces tile the leaf, have areas, and neighbours know each other. */
static void check_faces(const cut_faces *f) {
    const region_point *corner = f->points;
    __int128 sum = 0;
    for (size_t t = 0; t < f->face_count; t++) {
        const cut_face *face = &f->faces[t];
        const __int128 twice =
            region_side(f->points[face->corner[0]], f->points[face->corner[1]], f->points[face->corner[2]]);
        CHECK(twice > 0, "face %zu has no area", t);
        sum += twice;
        for (int i = 0; i < 3; i++) {
            const uint32_t from = face->corner[i], to = face->corner[(i + 1) % 3];
            if (face->next[i] != CUT_NO_FACE) { /* both say so of the same edge */
                const cut_face *o = &f->faces[face->next[i]];
                bool back = false;
                for (int k = 0; k < 3; k++)
                    back |= o->next[k] == t && o->corner[k] == to && o->corner[(k + 1) % 3] == from &&
                            o->fixed[k] == face->fixed[i];
                CHECK(back, "faces %zu and %u are neighbours one way", t, face->next[i]);
                continue;
            }
            bool on_side = false; /* nothing beyond: it lies on a side of the leaf */
            for (int k = 0; k < 3; k++)
                on_side |= region_side(corner[k], corner[(k + 1) % 3], f->points[from]) == 0 &&
                           region_side(corner[k], corner[(k + 1) % 3], f->points[to]) == 0;
            CHECK(on_side, "face %zu has no neighbour inside the leaf", t);
        }
    }
    CHECK(sum == region_side(corner[0], corner[1], corner[2]), "the faces do not tile the leaf");
}

/* Points nearer to a border than its grid is fine: on which side of y = 0.3 x? */
static void the_region_holds_points_finer_than_its_grid(void **state) {
    (void)state;
    random_begin(__func__);
    rqt_lattice lattice;
    assert_int_equal(rqt_lattice_init(&lattice, 17, 17), RQT_OK);
    rqt_region *region = region_of_shape("POLYGON((0 0, 10 3, 0 3, 0 0))", &lattice);
    int inside = 0;
    for (int n = 0; n < 2000; n++) {
        const int bits = random_between(1, 34);
        const int64_t unit = (int64_t)1 << bits,
                      x = 1 + (int64_t)(random_bits() % (uint64_t)(9 * ORACLE_UNITS * unit)),
                      y = 3 * (x / 10) + random_between(-3, 5);
        if (10 * y == 3 * x || y <= 0) continue; /* on it: either */
        const region_fine_point p = {{x >> bits, y >> bits}, x & (unit - 1), y & (unit - 1), bits};
        CHECK(region_holds(region, &p) == (10 * y > 3 * x), "(%lld, %lld) / 2^%d", (long long)x, (long long)y,
              bits);
        inside += 10 * y > 3 * x;
    }
    assert_true(inside > 200 && inside < 1800);
    rqt_region_free(region);
}

/* A segment that passes below the end of an edge which hangs between two of the faces it takes out: x-y here. */
static void a_segment_passes_below_a_hanging_edge(void **state) {
    (void)state;
    const region_point corner[3] = {{-1000, -1000}, {1000, -1000}, {0, 3000}};
    const region_point at[6] = {{0, 20}, {0, 10}, {-10, 0}, {10, 0}, {-400, 5}, {400, 5}};
    cut_faces f = {.allocator = test_allocator};
    uint32_t point[6];
    assert_true(cut_faces_begin(&f, corner));
    for (int i = 0; i < 6; i++) assert_true(cut_faces_add(&f, at[i], &point[i]));
    assert_true(cut_faces_fix(&f, point[0], point[1]));
    check_faces(&f);
    assert_true(cut_faces_fix(&f, point[4], point[5]));
    check_faces(&f);
    int fixed = 0;
    for (size_t t = 0; t < f.face_count; t++)
        for (int i = 0; i < 3; i++) fixed += f.faces[t].fixed[i];
    assert_int_equal(fixed, 4); /* both edges, from both sides */
    cut_faces_free(&f);
}

/* Rounding at its worst: leaves of a few units, so that every crossing moves far, and hundreds of segments.
 * Whatever becomes of the segments, the faces tile the leaf. */
static void faces_tile_the_leaf_whatever_rounding_does(void **state) {
    (void)state;
    random_begin(__func__);
    for (int n = 0; n < 400; n++) {
        const int side = 3 << random_between(0, 7);
        region_point corner[3];
        do
            for (int i = 0; i < 3; i++)
                corner[i] = (region_point){random_between(0, side), random_between(0, n % 2 ? side : 2)};
        while (region_side(corner[0], corner[1], corner[2]) <= 0);
        cut_faces f = {.allocator = test_allocator};
        assert_true(cut_faces_begin(&f, corner));
        const int segments = random_between(1, n % 8 ? 12 : 120);
        for (int s = 0; s < segments; s++) {
            uint32_t end[2];
            for (int e = 0; e < 2; e++) {
                region_point p;
                bool inside;
                do {
                    p = (region_point){random_between(0, side), random_between(0, side)};
                    if (random_between(0, 3) == 0) p = f.points[random_bits() % f.point_count];
                    inside = true;
                    for (int i = 0; i < 3; i++)
                        inside = inside && region_side(corner[i], corner[(i + 1) % 3], p) >= 0;
                } while (!inside);
                assert_true(cut_faces_add(&f, p, &end[e]));
                CHECK(f.points[end[e]].x == p.x && f.points[end[e]].y == p.y, "point %u is elsewhere", end[e]);
            }
            const size_t before = f.point_count;
            assert_true(cut_faces_fix(&f, end[0], end[1]));
            for (size_t i = before; i < f.point_count; i++) /* the sides are the neighbours' too */
                for (int k = 0; k < 3; k++)
                    CHECK(region_side(corner[k], corner[(k + 1) % 3], f.points[i]) > 0, "a crossing is on a side");
        }
        check_faces(&f);
        cut_faces_free(&f);
    }
}

/* Shares are rounded once. */
static void shares_are_the_nearest(void **state) {
    (void)state;
    random_begin(__func__);
    mpz_t n, part, whole, q;
    mpz_inits(n, part, whole, q, NULL);
    for (int i = 0; i < 20000; i++) {
        const uint64_t way = random_bits() >> random_between(0, 63);
        __int128 w = ((__int128)(random_bits() >> 2) << 64 | (__int128)random_bits()) >> random_between(0, 120);
        if (w == 0) w = 1;
        const __int128 p =
            i % 5 == 0 ? w / (i % 3 + 1) : (__int128)((unsigned __int128)(random_bits() >> 2) << 64) % (w + 1);
        mpz_set_ui(n, way);
        mpz_set_ui(part, (unsigned long)(p >> 64));
        mpz_mul_2exp(part, part, 64);
        mpz_add_ui(part, part, (unsigned long)p);
        mpz_set_ui(whole, (unsigned long)(w >> 64));
        mpz_mul_2exp(whole, whole, 64);
        mpz_add_ui(whole, whole, (unsigned long)w);
        mpz_mul(q, n, part);
        mpz_mul_2exp(q, q, 1);
        mpz_add(q, q, whole);
        mpz_mul_2exp(whole, whole, 1);
        mpz_fdiv_q(q, q, whole);
        assert_true(cut_share(way, p, w) == mpz_get_ui(q));
    }
    mpz_clears(n, part, whole, q, NULL);
}

/* Bit for bit, but for the padding. */
static bool is_same_vertex(const rqt_cut_vertex *a, const rqt_cut_vertex *b) {
    return memcmp(&a->col, &b->col, sizeof a->col) == 0 && memcmp(&a->row, &b->row, sizeof a->row) == 0 &&
           memcmp(&a->q, &b->q, sizeof a->q) == 0 && a->error == b->error && a->level == b->level;
}

/* Two regions with a common border: along it both cuts have the same vertices, heights bit for bit. And one region
 * in two parts has the area of the whole. */
static void neighbours_share_the_vertices_of_their_border(void **state) {
    (void)state;
    random_begin(__func__);
    for (int n = 0; n < 20; n++) {
        model m;
        database d;
        model_create(&m, raster_make(SURFACE_HILLS, random_between(9, 40), random_between(9, 40), -1));
        assert_int_equal(database_create(&d, &m, 2, &test_allocator), RQT_OK);
        const double w = m.r.width, h = m.r.height, x0 = random_between(0, 64) / 64.0 * w,
                     x1 = random_between(0, 64) / 64.0 * w;
        char text[2][400];
        snprintf(text[0], sizeof text[0], "POLYGON((-1 -1,%.17g -1,%.17g %.17g,-1 %.17g,-1 -1))", x0, x1, h, h);
        snprintf(text[1], sizeof text[1], "POLYGON((%.17g -1,%.17g %.17g,%.17g %.17g,%.17g -1,%.17g -1))", x0, x1,
                 h, w, h, w, x0);
        rqt_cut cut[2];
        long double area = 0;
        for (int i = 0; i < 2; i++) {
            rqt_region *region = region_of_shape(text[i], &d.lattice);
            rqt_patch patch;
            assert_int_equal(database_query(&d, region, rqt_code_floor(5), RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT,
                                            &test_allocator, &patch),
                             RQT_OK);
            assert_int_equal(rqt_cut_make(&patch, region, &d.lattice, &test_allocator, NULL, NULL, &cut[i]),
                             RQT_OK);
            area += check_mesh(&cut[i], d.lattice.K, "half");
            rqt_patch_free(&patch);
            rqt_region_free(region);
        }
        CHECK(fabsl(area - (long double)(m.r.width - 1) * (m.r.height - 1)) < 1e-9L, "area %.15Lg", area);
        size_t shared = 0;
        for (size_t i = 0; i < cut[0].vertex_count; i++) {
            const rqt_cut_vertex *v = &cut[0].vertices[i];
            const double off = (x1 - x0) * (v->row + 1) - (h + 1) * (v->col - x0);
            if (fabs(off) > 1e-7) continue;
            bool found = false;
            for (size_t j = 0; j < cut[1].vertex_count && !found; j++)
                found = is_same_vertex(v, &cut[1].vertices[j]);
            CHECK(found, "(%.17g, %.17g) is one side's alone", v->col, v->row);
            shared++;
        }
        if (fmin(x0, x1) > 1 && fmax(x0, x1) < w - 2) CHECK(shared >= 2, "%zu vertices on the border", shared);
        rqt_cut_free(&cut[0]);
        rqt_cut_free(&cut[1]);
        database_free(&d, &test_allocator);
        model_free(&m);
    }
}

/* The largest lattice, whose root's diagonal is oblique where the raster ends; and regions whose corners are as far
 * away as corners may be. */
static void the_largest_terrains_and_regions(void **state) {
    (void)state;
    random_begin(__func__);
    int meeting = 0;
    for (int n = 0; n < 60; n++) {
        const bool far = n % 2;
        const int32_t w = far ? 17 : (1 << 20) + 1 - random_between(0, 1000),
                      h = far ? 11 : random_between(300000, 1 << 20);
        rqt_lattice lattice;
        assert_int_equal(rqt_lattice_init(&lattice, w, h), RQT_OK);
        rqt_patch_vertex v[4];
        for (int i = 0; i < 4; i++)
            v[i] = (rqt_patch_vertex){
                .col = i & 1 ? w - 1 : 0, .row = i & 2 ? h - 1 : 0, .q = random_between(-1000000, 1000000)};
        static const uint32_t root[6] = {0, 3, 1, 0, 2, 3};
        uint32_t triangle[6];
        static shape s;
        memset(&s, 0, sizeof s);
        s.members = s.rings[0] = 1;
        s.spots[0][0] = random_between(3, 12);
        for (int i = 0; i < s.spots[0][0]; i++) {
            const int64_t reach = far ? (int64_t)1 << 59 : (int64_t)h * ORACLE_UNITS;
            s.x[0][0][i] = (int64_t)(random_bits() % (uint64_t)(2 * reach)) - (far ? reach : reach / 2);
            s.y[0][0][i] = (int64_t)(random_bits() % (uint64_t)(2 * reach)) - (far ? reach : reach / 2);
            if (far) { /* what the text says is what doubles hold */
                s.x[0][0][i] &= ~INT64_C(0xFFFF);
                s.y[0][0][i] &= ~INT64_C(0xFFFF);
            }
        }
        shape_say(&s);
        rqt_region *region = region_of_shape(s.text, &lattice);
        rqt_patch patch = {.vertices = v, .vertex_count = 4, .triangles = triangle};
        for (int t = 0; t < 2; t++) { /* as a query would */
            rqt_vertex at[3];
            uint32_t *to = triangle + 3 * patch.triangle_count;
            for (int k = 0; k < 3; k++) at[k] = (rqt_vertex){v[root[3 * t + k]].col, v[root[3 * t + k]].row};
            if (!rqt_region_meets(region, at[0], at[1], at[2])) continue;
            memcpy(to, root + 3 * (size_t)t, 3 * sizeof *to);
            patch.triangle_count++;
        }
        meeting += patch.triangle_count > 0;
        rqt_cut cut;
        assert_int_equal(rqt_cut_make(&patch, region, &lattice, &test_allocator, NULL, NULL, &cut), RQT_OK);
        long double wanted = 0;
        for (int t = 0; t < 2; t++) {
            oracle_point leaf[3];
            for (int k = 0; k < 3; k++) leaf[k] = (oracle_point){v[root[3 * t + k]].col, v[root[3 * t + k]].row};
            wanted += common_area(leaf, &s);
        }
        const long double area = check_mesh(&cut, lattice.K, "large");
        CHECK(fabsl(area - wanted) <= (far ? 1e-5L : 1e-9L * w * h), "%s: area %.18Lg, should be %.18Lg", s.text,
              area, wanted);
        rqt_cut_free(&cut);
        rqt_region_free(region);
    }
    CHECK(meeting > 20, "%d regions met the terrain", meeting);
}

static int looks;
static bool stops(void *context) {
    return ++looks >= *(const int *)context;
}

/* Each allocation fails once: no memory, nothing kept, nothing leaked. So does a caller who has had enough. */
static void F48_no_memory_and_interrupt_leave_nothing(void **state) {
    (void)state;
    random_begin(__func__);
    model m;
    database d;
    static shape s;
    model_create(&m, raster_make(SURFACE_HILLS, 33, 29, 5));
    assert_int_equal(database_create(&d, &m, 3, &test_allocator), RQT_OK);
    do (void)random_shape(&s, 33, 29);
    while (s.members < 2);
    rqt_region *region = region_of_shape(s.text, &d.lattice);
    rqt_patch patch;
    rqt_cut cut;
    assert_int_equal(
        database_query(&d, region, 0, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT, &test_allocator, &patch), RQT_OK);
    const size_t live = test_heap.live;
    test_heap.calls = 0;
    assert_int_equal(rqt_cut_make(&patch, region, &d.lattice, &test_allocator, NULL, NULL, &cut), RQT_OK);
    const size_t calls = test_heap.calls;
    rqt_cut_free(&cut);
    CHECK(calls > 8, "%zu allocations", calls);
    for (size_t n = 1; n <= calls; n++) {
        test_heap.calls = 0;
        test_heap.fail_from = test_heap.fail_to = n;
        assert_int_equal(rqt_cut_make(&patch, region, &d.lattice, &test_allocator, NULL, NULL, &cut),
                         RQT_NO_MEMORY);
        assert_true(!cut.vertices && !cut.triangles && cut.triangle_count == 0);
        assert_int_equal(test_heap.live, live);
    }
    for (size_t n = 1; n < 40; n++) { /* and snapping */
        rqt_region *snapped;
        test_heap.calls = 0;
        test_heap.fail_from = test_heap.fail_to = n;
        const rqt_status status = rqt_region_snap(region, &d.lattice, &test_allocator, &snapped);
        assert_int_equal(status, test_heap.calls >= n ? RQT_NO_MEMORY : RQT_OK);
        rqt_region_free(snapped);
        assert_int_equal(test_heap.live, live);
    }
    test_heap.fail_from = test_heap.fail_to = 0;
    int most = 1;
    assert_int_equal(rqt_cut_make(&patch, region, &d.lattice, &test_allocator, stops, &most, &cut),
                     RQT_INTERRUPTED);
    assert_true(looks == 1 && !cut.vertices);
    rqt_patch_free(&patch);
    rqt_region_free(region);
    database_free(&d, &test_allocator);
    model_free(&m);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(shares_are_the_nearest),
        TEST(the_region_holds_points_finer_than_its_grid),
        TEST(a_segment_passes_below_a_hanging_edge),
        TEST(faces_tile_the_leaf_whatever_rounding_does),
        TEST(neighbours_share_the_vertices_of_their_border),
        TEST(a_line_beside_polygons_takes_whole_leaves),
        TEST(the_largest_terrains_and_regions),
        TEST(F48_no_memory_and_interrupt_leave_nothing),
        TEST(F26_polygons_of_all_kinds_are_cut_to_their_area),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
