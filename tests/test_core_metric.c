/* test_core_metric.c - the other metrics are what METHODS.md defines, computed here the slow way.
 *
 * Every triangle of the bintree is enumerated with its number, an exact rational, rounded up once. Minimal errors
 * are held against their meaning, not against their equations: the least closed set without a bad leaf, found by
 * splitting one bad leaf after the other, and on 5 x 5 samples against all closed sets there are. */
#include "test_core_database.h"

#include <math.h>

/* ------------------------------------------------------------------------------------- all triangles -- */
typedef struct piece {
    oracle_triangle t;
    oracle_point split;
    int has_split, mixed, first, second; /* halves, by number */
    unsigned code;                       /* of the exact error */
} piece;

typedef struct pieces {
    const oracle *o;
    piece *p;
    int count, capacity;
} pieces;

static oracle_point halfway(oracle_point a, oracle_point b) {
    return (oracle_point){(a.x + b.x) / 2, (a.y + b.y) / 2};
}

/* Returns its number. */
static int enumerate(pieces *all, oracle_triangle t) {
    if (all->count == all->capacity) {
        all->capacity = all->capacity ? 2 * all->capacity : 1024;
        all->p = realloc(all->p, (size_t)all->capacity * sizeof *all->p);
        if (!all->p) abort();
    }
    const int me = all->count++;
    piece p = {.t = t, .first = -1, .second = -1};
    p.has_split = abs(t.corner[1].x - t.corner[2].x) > 1 || abs(t.corner[1].y - t.corner[2].y) > 1;
    if (p.has_split) {
        mpq_t metres;
        mpq_init(metres);
        p.split = halfway(t.corner[1], t.corner[2]);
        oracle_triangle_error(all->o, &t, metres, &p.mixed);
        p.code = oracle_code_up(metres);
        mpq_clear(metres);
        p.first = enumerate(all, (oracle_triangle){{p.split, t.corner[1], t.corner[0]}, t.depth + 1});
        p.second = enumerate(all, (oracle_triangle){{p.split, t.corner[0], t.corner[2]}, t.depth + 1});
    }
    all->p[me] = p;
    return me;
}

static pieces pieces_of(const oracle *o) {
    pieces all = {.o = o};
    const int s = o->side - 1;
    (void)enumerate(&all, (oracle_triangle){{{s, 0}, {0, 0}, {s, s}}, 0});
    (void)enumerate(&all, (oracle_triangle){{{0, s}, {s, s}, {0, 0}}, 0});
    return all;
}

/* ---------------------------------------------------------------------------------------- numbers, exact -- */

static void quanta(const oracle *o, oracle_point p, mpq_t z) {
    mpq_set_si(z, o->terrain.q[p.y * o->terrain.width + p.x], 1);
}

/* Plane through the clamped corners: z = c + gx*x + gy*y in quanta. False: no area, or a void corner. */
static int plane_of(const oracle *o, const oracle_triangle *t, mpq_t c, mpq_t gx, mpq_t gy) {
    oracle_point v[3];
    for (int n = 0; n < 3; n++) {
        v[n] = oracle_clamp(o, t->corner[n]);
        if (!oracle_is_valid(o, t->corner[n])) return 0;
    }
    const long ax = v[1].x - v[0].x, ay = v[1].y - v[0].y, bx = v[2].x - v[0].x, by = v[2].y - v[0].y,
               area = ax * by - bx * ay;
    if (area == 0) return 0;
    mpq_t z[3], part;
    mpq_inits(z[0], z[1], z[2], part, NULL);
    for (int n = 0; n < 3; n++) quanta(o, v[n], z[n]);
    mpq_sub(z[1], z[1], z[0]);
    mpq_sub(z[2], z[2], z[0]);
    const long weight[2][2] = {{by, -ay}, {-bx, ax}};
    mpq_t *const gradient[2] = {(mpq_t *)gx, (mpq_t *)gy};
    mpq_set(c, z[0]);
    for (int n = 0; n < 2; n++) {
        mpq_set_si(part, weight[n][0], 1);
        mpq_mul(*gradient[n], z[1], part);
        mpq_set_si(part, weight[n][1], 1);
        mpq_mul(part, part, z[2]);
        mpq_add(*gradient[n], *gradient[n], part);
        mpq_set_si(part, area, 1);
        mpq_div(*gradient[n], *gradient[n], part);
        mpq_set_si(part, n ? v[0].y : v[0].x, 1);
        mpq_mul(part, part, *gradient[n]);
        mpq_sub(c, c, part);
    }
    mpq_clears(z[0], z[1], z[2], part, NULL);
    return 1;
}

/* |z - plane| at the clamped split vertex in quanta; 0 where a corner or it is void. */
static void local_distance(const oracle *o, const piece *p, mpq_t out) {
    mpq_t c, gx, gy, z;
    mpq_inits(c, gx, gy, z, NULL);
    mpq_set_ui(out, 0, 1);
    const oracle_point m = oracle_clamp(o, p->split);
    if (plane_of(o, &p->t, c, gx, gy) && oracle_is_valid(o, p->split)) {
        mpq_set_si(z, m.x, 1);
        mpq_mul(gx, gx, z);
        mpq_set_si(z, m.y, 1);
        mpq_mul(gy, gy, z);
        quanta(o, m, out);
        mpq_sub(out, out, c);
        mpq_sub(out, out, gx);
        mpq_sub(out, out, gy);
        mpq_abs(out, out);
    }
    mpq_clears(c, gx, gy, z, NULL);
}

/* The largest deviation of the valid samples in quanta; 0 where there is no plane. */
static void deviation(const oracle *o, const piece *p, mpq_t out) {
    mpq_t c, gx, gy;
    mpq_inits(c, gx, gy, NULL);
    mpq_set_ui(out, 0, 1);
    if (plane_of(o, &p->t, c, gx, gy)) {
        oracle_deviation(o, &p->t, out);
        mpq_div(out, out, o->quantum);
    }
    mpq_clears(c, gx, gy, NULL);
}

/* The outline's cost in metres. */
static void ground(const oracle *o, const piece *p, mpq_t out) {
    mpq_set_ui(out, 0, 1);
    if (!p->mixed) return;
    int low[2] = {1 << 30, 1 << 30}, high[2] = {0, 0};
    for (int n = 0; n < 3; n++) {
        const oracle_point v = oracle_clamp(o, p->t.corner[n]);
        const int at[2] = {v.x, v.y};
        for (int d = 0; d < 2; d++) {
            if (at[d] < low[d]) low[d] = at[d];
            if (at[d] > high[d]) high[d] = at[d];
        }
    }
    const int across = high[0] - low[0], down = high[1] - low[1];
    mpq_t part;
    mpq_init(part);
    mpq_set_si(out, across > down ? across : down, 1);
    mpq_set_d(part, o->terrain.cell);
    mpq_mul(out, out, part);
    mpq_set_d(part, o->terrain.c);
    mpq_div(out, out, part);
    mpq_clear(part);
}

/* Rounded up to a multiple of 1/2. */
static void ceil_half(mpq_t v) {
    mpz_t n;
    mpz_init(n);
    mpq_mul_2exp(v, v, 1);
    mpz_cdiv_q(n, mpq_numref(v), mpq_denref(v));
    mpq_set_z(v, n);
    mpq_div_2exp(v, v, 1);
    mpz_clear(n);
}

/* Is the triangle clamped, or are there voids in it? */
static int is_irregular(const oracle *o, const piece *p) {
    for (int n = 0; n < 3; n++) {
        const oracle_point v = p->t.corner[n];
        if (v.x >= o->terrain.width || v.y >= o->terrain.height) return 1;
        if (!oracle_is_valid(o, v)) return 1;
    }
    return p->mixed;
}

/* ROAM's nested sum in quanta, children first. */
static void wedgie(const pieces *all, int n, mpq_t out) {
    const piece *p = &all->p[n];
    mpq_set_ui(out, 0, 1);
    if (!p->has_split || oracle_area(all->o, &p->t) == 0) return;
    mpq_t child, own;
    mpq_inits(child, own, NULL);
    for (int half = 0; half < 2; half++) {
        wedgie(all, half ? p->second : p->first, child);
        if (mpq_cmp(child, out) > 0) mpq_set(out, child);
    }
    local_distance(all->o, p, own);
    if (is_irregular(all->o, p)) {
        ceil_half(own);
        deviation(all->o, p, child);
        ceil_half(child);
        mpq_add(out, out, own);
        if (mpq_cmp(child, out) > 0) mpq_set(out, child);
    } else {
        mpq_add(out, out, own);
    }
    mpq_clears(child, own, NULL);
}

/* The squared distance in space, in metres. */
static void euclid_squared(const oracle *o, const piece *p, mpq_t out) {
    mpq_t c, gx, gy, one;
    mpq_inits(c, gx, gy, one, NULL);
    mpq_set_ui(out, 0, 1);
    if (plane_of(o, &p->t, c, gx, gy)) {
        mpq_set_d(c, o->terrain.cell);
        mpq_div(c, o->quantum, c);
        mpq_mul(gx, gx, c);
        mpq_mul(gy, gy, c);
        mpq_mul(gx, gx, gx);
        mpq_mul(gy, gy, gy);
        mpq_set_ui(one, 1, 1);
        mpq_add(gx, gx, gy);
        mpq_add(gx, gx, one);
        deviation(o, p, out);
        mpq_mul(out, out, o->quantum);
        mpq_mul(out, out, out);
        mpq_div(out, out, gx);
    }
    mpq_clears(c, gx, gy, one, NULL);
}

/* Solves three normal equations a x = b; what they leave open is 0. */
static void solve(mpq_t a[3][4], mpq_t x[3]) {
    int row = 0, pivot_of[3] = {-1, -1, -1};
    mpq_t factor;
    mpq_init(factor);
    for (int column = 0; column < 3; column++) {
        int pivot = row;
        while (pivot < 3 && mpq_sgn(a[pivot][column]) == 0) pivot++;
        if (pivot == 3) continue;
        for (int k = 0; k < 4; k++) mpq_swap(a[row][k], a[pivot][k]);
        for (int other = 0; other < 3; other++) {
            if (other == row) continue;
            mpq_div(factor, a[other][column], a[row][column]);
            for (int k = 0; k < 4; k++) {
                mpq_t part;
                mpq_init(part);
                mpq_mul(part, factor, a[row][k]);
                mpq_sub(a[other][k], a[other][k], part);
                mpq_clear(part);
            }
        }
        pivot_of[column] = row++;
    }
    for (int column = 0; column < 3; column++) {
        mpq_set_ui(x[column], 0, 1);
        if (pivot_of[column] >= 0) mpq_div(x[column], a[pivot_of[column]][3], a[pivot_of[column]][column]);
    }
    mpq_clear(factor);
}

static int is_in(const oracle_point v[3], long x, long y) {
    int left = 0, right = 0;
    for (int n = 0; n < 3; n++) {
        const oracle_point a = v[n], b = v[(n + 1) % 3];
        const long side = (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
        left |= side > 0;
        right |= side < 0;
    }
    return !(left && right);
}

/* The mean distance of the valid samples from the plane fitted to them, in quanta. */
static void fitted_distance(const oracle *o, const piece *p, mpq_t out) {
    oracle_point v[3];
    for (int n = 0; n < 3; n++) v[n] = oracle_clamp(o, p->t.corner[n]);
    mpq_t a[3][4], plane[3], part, off;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 4; k++) mpq_init(a[i][k]);
        mpq_init(plane[i]);
    }
    mpq_inits(part, off, NULL);
    mpq_set_ui(out, 0, 1);
    unsigned long count = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int y = 0; y < o->terrain.height; y++)
            for (int x = 0; x < o->terrain.width; x++) {
                if (!is_in(v, x, y) || !oracle_is_valid(o, (oracle_point){x, y})) continue;
                const long term[4] = {1, x, y, o->terrain.q[y * o->terrain.width + x]};
                if (pass == 0) {
                    count++;
                    for (int i = 0; i < 3; i++)
                        for (int k = 0; k < 4; k++) {
                            mpq_set_si(part, term[i], 1);
                            mpq_set_si(off, term[k], 1);
                            mpq_mul(part, part, off);
                            mpq_add(a[i][k], a[i][k], part);
                        }
                } else {
                    mpq_set_si(off, term[3], 1);
                    for (int i = 0; i < 3; i++) {
                        mpq_set_si(part, term[i], 1);
                        mpq_mul(part, part, plane[i]);
                        mpq_sub(off, off, part);
                    }
                    mpq_abs(off, off);
                    mpq_add(out, out, off);
                }
            }
        if (pass == 0) solve(a, plane);
    }
    if (count) {
        mpq_set_ui(part, count, 1);
        mpq_div(out, out, part);
    }
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 4; k++) mpq_clear(a[i][k]);
        mpq_clear(plane[i]);
    }
    mpq_clears(part, off, NULL);
}

/* 2^-39 of the largest difference of two valid heights, in quanta. */
static void rounding(const oracle *o, mpq_t out) {
    long low = 0, high = 0;
    int any = 0;
    for (int n = 0; n < o->terrain.width * o->terrain.height; n++) {
        const long q = o->terrain.q[n];
        if (o->terrain.valid && !o->terrain.valid[n]) continue;
        if (!any || q < low) low = q;
        if (!any || q > high) high = q;
        any = 1;
    }
    mpq_set_si(out, high - low, 1);
    mpq_div_2exp(out, out, 39);
}

/* The smallest code whose square is not below v. */
static unsigned root_up(const mpq_t v) {
    mpq_t value;
    mpq_init(value);
    unsigned low = 0, high = ORACLE_LARGEST;
    while (low < high) {
        const unsigned middle = (low + high) / 2;
        oracle_code_value(value, middle);
        mpq_mul(value, value, value);
        if (mpq_cmp(value, v) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    mpq_clear(value);
    return low;
}

/* What a triangle has by a metric: the least and the largest code that the contract allows. */
static void number_of(const pieces *all, int n, rqt_metric metric, unsigned code[2]) {
    const piece *p = &all->p[n];
    mpq_t value, cost;
    mpq_inits(value, cost, NULL);
    if (metric == RQT_METRIC_EUCLID) {
        euclid_squared(all->o, p, value);
        code[0] = root_up(value);
        mpq_set_d(cost, 1 + 0x1p-40);
        mpq_mul(value, value, cost);
        code[1] = root_up(value);
    } else if (metric == RQT_METRIC_PLANE) {
        fitted_distance(all->o, p, value);
        rounding(all->o, cost);
        mpq_mul(value, value, all->o->quantum);
        mpq_mul(cost, cost, all->o->quantum);
        mpq_sub(value, value, cost);
        code[0] = mpq_sgn(value) > 0 ? oracle_code_up(value) : 0;
        mpq_add(value, value, cost);
        mpq_add(value, value, cost);
        code[1] = oracle_code_up(value);
        mpq_sub(value, value, cost);
        if (mpq_sgn(value) == 0) code[1] = 0; /* a plane is one */
    } else {
        if (metric == RQT_METRIC_LOCAL)
            local_distance(all->o, p, value);
        else
            wedgie(all, n, value);
        mpq_mul(value, value, all->o->quantum);
        code[0] = code[1] = oracle_code_up(value);
    }
    ground(all->o, p, cost);
    for (int i = 0; i < 2; i++)
        if (oracle_code_up(cost) > code[i]) code[i] = oracle_code_up(cost);
    mpq_clears(value, cost, NULL);
}

static void raise_parents(const oracle *o, unsigned *code) {
    for (int changed = 1; changed;) {
        changed = 0;
        for (int n = 0; n < o->side * o->side; n++)
            for (int m = 0; m < o->node[n].parent_count; m++) {
                unsigned *p = &code[o->node[n].parent[m].y * o->side + o->node[n].parent[m].x];
                if (code[n] > *p) *p = code[n], changed = 1;
            }
    }
}

static rqt_errors metric_of(const model *m, rqt_metric metric, rqt_outline outline) {
    rqt_errors e;
    assert_int_equal(
        rqt_metric_compute(&m->grid, &m->r.unit, &m->r.cost, metric, outline, &test_allocator, NULL, NULL, &e),
        RQT_OK);
    return e;
}

static int is_corner(const oracle *o, int x, int y) {
    return (x == 0 || x == o->side - 1) && (y == 0 || y == o->side - 1);
}

static raster random_raster(int round, int most) {
    raster r = raster_make((surface)(round % SURFACE_COUNT), random_between(1, most), random_between(1, most),
                           round % 3 == 0 ? random_between(0, 12) : -1);
    if (round % 5 == 1) raster_add_lake(&r);
    return r;
}

static void hold_to_definitions(const rqt_metric *metrics, int count, int rounds) {
    for (int round = 0; round < rounds; round++) {
        model m;
        model_create(&m, random_raster(round, 14));
        pieces all = pieces_of(&m.o);
        const size_t n = (size_t)(m.o.side * m.o.side);
        for (int which = 0; which < count; which++) {
            unsigned *code[2] = {calloc(n, sizeof **code), calloc(n, sizeof **code)};
            if (!code[0] || !code[1]) abort();
            for (int p = 0; p < all.count; p++) {
                unsigned both[2];
                if (!all.p[p].has_split || oracle_area(&m.o, &all.p[p].t) == 0) continue;
                number_of(&all, p, metrics[which], both);
                for (int i = 0; i < 2; i++) {
                    unsigned *to = &code[i][all.p[p].split.y * m.o.side + all.p[p].split.x];
                    if (both[i] > *to) *to = both[i];
                }
            }
            raise_parents(&m.o, code[0]);
            raise_parents(&m.o, code[1]);
            rqt_errors e = metric_of(&m, metrics[which], RQT_OUTLINE_EXACT);
            for (int y = 0; y < m.o.side; y++)
                for (int x = 0; x < m.o.side; x++) {
                    bool outline;
                    const unsigned got = rqt_errors_at(&e, (rqt_vertex){x, y}, &outline);
                    const unsigned low = is_corner(&m.o, x, y) ? ORACLE_INFINITY : code[0][y * m.o.side + x],
                                   high = is_corner(&m.o, x, y) ? ORACLE_INFINITY : code[1][y * m.o.side + x];
                    if (got >= low && got <= high && outline == (oracle_at(&m.o, x, y)->outline != 0)) continue;
                    raster_print(&m.r);
                    fail_msg("%s at (%d,%d): %u outline %d, should be %u to %u outline %d",
                             rqt_metric_name(metrics[which]), x, y, got, outline, low, high,
                             oracle_at(&m.o, x, y)->outline);
                }
            rqt_errors_free(&e, &test_allocator);
            free(code[0]);
            free(code[1]);
        }
        free(all.p);
        model_free(&m);
    }
}

static void local_wedgie_and_euclid_are_their_definitions(void **state) {
    (void)state;
    random_begin("definitions");
    static const rqt_metric metrics[] = {RQT_METRIC_LOCAL, RQT_METRIC_WEDGIE, RQT_METRIC_EUCLID};
    hold_to_definitions(metrics, 3, 90);
}

static void a_fitted_plane_is_its_definition(void **state) {
    (void)state;
    random_begin("fitted planes");
    const rqt_metric plane = RQT_METRIC_PLANE;
    hold_to_definitions(&plane, 1, 90);
}

/* ------------------------------------------------------------------------------------------- minimal -- */

/* Does a mesh of eps have to do without this leaf? */
static int is_bad(const piece *p, unsigned eps, int exact) {
    return p->has_split && (p->code > eps || (exact && p->mixed));
}

static int has(const oracle *o, const unsigned char *set, oracle_point p) {
    return set[p.y * o->side + p.x];
}

/* Number of a leaf of the set below n that has to go; -1: none. */
static int find_bad(const pieces *all, int n, const unsigned char *set, unsigned eps, int exact) {
    const piece *p = &all->p[n];
    if (p->has_split && has(all->o, set, p->split)) {
        const int bad = find_bad(all, p->first, set, eps, exact);
        return bad >= 0 ? bad : find_bad(all, p->second, set, eps, exact);
    }
    return is_bad(p, eps, exact) ? n : -1;
}

static int second_root(const pieces *all) {
    for (int n = 1; n < all->count; n++)
        if (all->p[n].t.depth == 0) return n;
    return 0;
}

/* M(eps): corners, and every bad leaf split, with all that this forces. */
static void refine(const pieces *all, unsigned eps, int exact, unsigned char *set) {
    memset(set, 0, (size_t)(all->o->side * all->o->side));
    oracle_close(all->o, set);
    const int root = second_root(all);
    for (;;) {
        int bad = find_bad(all, 0, set, eps, exact);
        if (bad < 0) bad = find_bad(all, root, set, eps, exact);
        if (bad < 0) return;
        set[all->p[bad].split.y * all->o->side + all->p[bad].split.x] = 1;
        oracle_close(all->o, set);
    }
}

static int is_selected(const rqt_errors *e, int x, int y, unsigned eps, int exact) {
    bool outline;
    return rqt_errors_at(e, (rqt_vertex){x, y}, &outline) > eps || (exact && outline);
}

static void minimal_errors_select_what_splitting_bad_leaves_gives(void **state) {
    (void)state;
    random_begin("refinement");
    for (int round = 0; round < 150; round++) {
        model m;
        model_create(&m, random_raster(round, round % 10 == 0 ? 30 : 15));
        pieces all = pieces_of(&m.o);
        unsigned char *set = oracle_set_create(&m.o);
        for (int exact = 0; exact < 2; exact++) {
            rqt_errors e = metric_of(&m, RQT_METRIC_MINIMAL, exact ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL);
            for (int step = 0; step < 12; step++) {
                const piece *p = &all.p[random_between(0, all.count - 1)];
                unsigned eps = step == 0 ? 0 : step == 1 ? ORACLE_LARGEST : p->code;
                if (step > 5 && eps > 0) eps -= 1;
                refine(&all, eps, exact, set);
                for (int y = 0; y < m.o.side; y++)
                    for (int x = 0; x < m.o.side; x++) {
                        if (is_selected(&e, x, y, eps, exact) == set[y * m.o.side + x]) continue;
                        raster_print(&m.r);
                        fail_msg("outline %s, eps code %u, (%d,%d): selected %d, should be %d",
                                 exact ? "exact" : "tol", eps, x, y, !set[y * m.o.side + x], set[y * m.o.side + x]);
                    }
            }
            /* closed, and inside the exact set */
            for (int n = 0; n < m.o.side * m.o.side; n++) {
                const int x = n % m.o.side, y = n / m.o.side;
                bool outline, exact_outline;
                const rqt_code code = rqt_errors_at(&e, (rqt_vertex){x, y}, &outline);
                const rqt_code largest = rqt_errors_at(&m.saturated, (rqt_vertex){x, y}, &exact_outline);
                CHECK(outline ? exact_outline : exact_outline || code <= largest, "(%d,%d): not in the exact set",
                      x, y);
                for (int c = 0; c < m.o.node[n].parent_count; c++) {
                    bool above;
                    const oracle_point at = m.o.node[n].parent[c];
                    CHECK(rqt_errors_at(&e, (rqt_vertex){at.x, at.y}, &above) >= code &&
                              (above || !outline || is_corner(&m.o, at.x, at.y)),
                          "(%d,%d) is more than its parent", x, y);
                }
            }
            rqt_errors_free(&e, &test_allocator);
        }
        free(set);
        free(all.p);
        model_free(&m);
    }
}

/* -------------------------------------------------------------------------------- all meshes of 5 x 5 -- */
typedef struct search {
    const pieces *all;
    const rqt_errors *minimal;
    int order[25], count; /* vertices but the corners, parents first */
    unsigned char set[25];
    unsigned best[26]; /* the smallest error of a set of so many vertices */
    long sets;
} search;

static unsigned largest_leaf(const search *s, int n) {
    const piece *p = &s->all->p[n];
    if (!p->has_split) return 0;
    if (!has(s->all->o, s->set, p->split)) return p->code;
    const unsigned a = largest_leaf(s, p->first), b = largest_leaf(s, p->second);
    return a > b ? a : b;
}

static void try_all(search *s, int at, int chosen) {
    const oracle *o = s->all->o;
    if (at == s->count) {
        const unsigned a = largest_leaf(s, 0), b = largest_leaf(s, second_root(s->all)), error = a > b ? a : b;
        s->sets++;
        if (error < s->best[chosen]) s->best[chosen] = error;
        for (int n = 0; n < 25; n++)
            CHECK(s->set[n] || !is_selected(s->minimal, n % 5, n / 5, error, 0),
                  "a mesh of error code %u does without (%d,%d)", error, n % 5, n / 5);
        return;
    }
    try_all(s, at + 1, chosen);
    const oracle_node *node = &o->node[s->order[at]];
    for (int p = 0; p < node->parent_count; p++)
        if (!has(o, s->set, node->parent[p])) return;
    s->set[s->order[at]] = 1;
    try_all(s, at + 1, chosen + 1);
    s->set[s->order[at]] = 0;
}

static void no_mesh_of_5_by_5_is_smaller_or_nearer_within_its_size(void **state) {
    (void)state;
    random_begin("all meshes");
    for (int round = 0; round < 12; round++) {
        model m;
        model_create(&m, raster_make(round == 0 ? SURFACE_TAKAGI : SURFACE_NOISE, 5, 5, -1));
        pieces all = pieces_of(&m.o);
        rqt_errors e = metric_of(&m, RQT_METRIC_MINIMAL, RQT_OUTLINE_EXACT);
        search s = {.all = &all, .minimal = &e};
        oracle_close(&m.o, s.set);
        /* Depths of the bintree come in the order of dependence. */
        for (int depth = 0; depth < 4; depth++)
            for (int n = 0; n < all.count; n++) {
                const int v = all.p[n].split.y * 5 + all.p[n].split.x;
                int known = !all.p[n].has_split || all.p[n].t.depth != depth;
                for (int k = 0; k < s.count; k++) known = known || s.order[k] == v;
                if (!known) s.order[s.count++] = v;
            }
        assert_int_equal(s.count, 21);
        for (int n = 0; n <= 25; n++) s.best[n] = ORACLE_INFINITY;
        try_all(&s, 0, 4);
        if (round == 0) printf("%ld closed sets\n", s.sets);
        assert_true(s.sets > 1000);
        for (int budget = 4; budget <= 25; budget++) {
            unsigned best = ORACLE_INFINITY, found = ORACLE_LARGEST;
            for (int n = 4; n <= budget; n++)
                if (s.best[n] < best) best = s.best[n];
            for (int t = ORACLE_LARGEST; t >= 0; t--) { /* the smallest t whose set keeps within the budget */
                int count = 0;
                for (int n = 0; n < 25; n++) count += is_selected(&e, n % 5, n / 5, (unsigned)t, 0);
                if (count > budget) break;
                found = (unsigned)t;
            }
            CHECK(found == best, "within %d vertices: error code %u, and %u is possible", budget, found, best);
        }
        rqt_errors_free(&e, &test_allocator);
        free(all.p);
        model_free(&m);
    }
}

/* --------------------------------------------------------------------------------- bounds, and no bounds -- */

/* The largest code of a kept leaf's deviation at eps. */
static unsigned true_error(const model *m, const pieces *all, int n, const rqt_errors *e, unsigned eps) {
    const piece *p = &all->p[n];
    if (!p->has_split) return 0;
    if (!is_selected(e, p->split.x, p->split.y, eps, 1)) return p->code;
    const unsigned a = true_error(m, all, p->first, e, eps), b = true_error(m, all, p->second, e, eps);
    return a > b ? a : b;
}

static void what_is_called_a_bound_is_one(void **state) {
    (void)state;
    random_begin("bounds");
    double worst[RQT_METRICS] = {0};
    for (int round = 0; round < 60; round++) {
        model m;
        raster r = round % 2 ? random_raster(round, 33) : raster_make(SURFACE_TAKAGI, 33, 33, -1);
        model_create(&m, r);
        pieces all = pieces_of(&m.o);
        for (int metric = 0; metric < RQT_METRICS; metric++) {
            rqt_errors e = metric_of(&m, (rqt_metric)metric, RQT_OUTLINE_EXACT);
            for (int step = 0; step < 8; step++) {
                const unsigned eps = all.p[random_between(0, all.count - 1)].code;
                const unsigned a = true_error(&m, &all, 0, &e, eps),
                               b = true_error(&m, &all, second_root(&all), &e, eps), most = a > b ? a : b;
                const double ratio = eps ? rqt_code_metres((rqt_code)most) / rqt_code_metres((rqt_code)eps) : 0;
                if (ratio > worst[metric] && !m.r.valid) worst[metric] = ratio;
                CHECK(most <= eps || !rqt_metric_is_bound((rqt_metric)metric), "%s: error code %u at eps %u",
                      rqt_metric_name((rqt_metric)metric), most, eps);
            }
            if (metric == RQT_METRIC_WEDGIE) /* never below the exact error: a superset */
                for (int n = 0; n < m.o.side * m.o.side; n++) {
                    bool outline;
                    const rqt_vertex v = {n % m.o.side, n / m.o.side};
                    CHECK(rqt_errors_at(&e, v, &outline) >= rqt_errors_at(&m.saturated, v, &outline),
                          "wedgie < exact");
                }
            rqt_errors_free(&e, &test_allocator);
        }
        free(all.p);
        model_free(&m);
    }
    for (int metric = 0; metric < RQT_METRICS; metric++)
        printf("%s: true error up to %.3f eps\n", rqt_metric_name((rqt_metric)metric), worst[metric]);
}

/* --------------------------------------------------------------------------------------------- memory -- */
static void metrics_give_back_memory_and_stop_when_told(void **state) {
    (void)state;
    random_begin("memory");
    raster r = raster_make(SURFACE_HILLS, 40, 33, 3);
    rqt_grid grid = {.q = r.q, .valid = r.valid};
    rqt_errors e;
    assert_int_equal(rqt_lattice_init(&grid.lattice, r.width, r.height), RQT_OK);
    for (int metric = 0; metric < RQT_METRICS; metric++) {
        for (size_t fail = 1; fail <= 3; fail++) {
            memset(&test_heap, 0, sizeof test_heap);
            test_heap.fail_from = test_heap.fail_to = fail;
            const rqt_status status = rqt_metric_compute(&grid, &r.unit, &r.cost, (rqt_metric)metric,
                                                         RQT_OUTLINE_EXACT, &test_allocator, NULL, NULL, &e);
            assert_int_equal(status, test_heap.failures ? RQT_NO_MEMORY : RQT_OK);
            rqt_errors_free(&e, &test_allocator);
            assert_int_equal(test_heap.live, 0);
        }
    }
    assert_int_equal(rqt_metric_compute(&grid, &r.unit, &r.cost, (rqt_metric)RQT_METRICS, RQT_OUTLINE_EXACT,
                                        &test_allocator, NULL, NULL, &e),
                     RQT_INVALID);
    assert_null(rqt_metric_name((rqt_metric)RQT_METRICS));
    raster_free(&r);
}

static bool refuse(void *context, double done) {
    (void)done;
    ++*(int *)context;
    return false;
}

static void a_metric_can_be_interrupted(void **state) {
    (void)state;
    random_begin("interrupt");
    raster r = raster_make(SURFACE_HILLS, 80, 80, -1);
    rqt_grid grid = {.q = r.q};
    rqt_errors e;
    assert_int_equal(rqt_lattice_init(&grid.lattice, r.width, r.height), RQT_OK);
    for (int metric = RQT_METRIC_MINIMAL; metric < RQT_METRICS; metric++) {
        int calls = 0;
        assert_int_equal(rqt_metric_compute(&grid, &r.unit, &r.cost, (rqt_metric)metric, RQT_OUTLINE_EXACT,
                                            &test_allocator, refuse, &calls, &e),
                         RQT_INTERRUPTED);
        assert_int_equal(calls, 1);
        assert_null(e.code);
    }
    raster_free(&r);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(local_wedgie_and_euclid_are_their_definitions),
        TEST(a_fitted_plane_is_its_definition),
        TEST(minimal_errors_select_what_splitting_bad_leaves_gives),
        TEST(no_mesh_of_5_by_5_is_smaller_or_nearer_within_its_size),
        TEST(what_is_called_a_bound_is_one),
        TEST(metrics_give_back_memory_and_stop_when_told),
        TEST(a_metric_can_be_interrupted),
    };
    return cmocka_run_group_tests_name("metrics", tests, NULL, NULL);
}
