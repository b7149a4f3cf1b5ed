/* oracle.c - see oracle.h. In the order of the definitions: triangles, errors, saturation, codes, sets, leaves,
 * windows. */
#include "oracle.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *take(size_t count, size_t size) {
    void *p = calloc(count ? count : 1, size);
    if (!p) {
        fputs("oracle: out of memory\n", stderr);
        abort();
    }
    return p;
}

static oracle_node *node_at(const oracle *o, oracle_point p) {
    return &o->node[p.y * o->side + p.x];
}

const oracle_node *oracle_at(const oracle *o, int x, int y) {
    oracle_point p = {x, y};
    return node_at(o, p);
}

oracle_point oracle_clamp(const oracle *o, oracle_point p) {
    if (p.x > o->terrain.width - 1) p.x = o->terrain.width - 1;
    if (p.y > o->terrain.height - 1) p.y = o->terrain.height - 1;
    return p;
}

static int sample_is_valid(const oracle *o, int x, int y) {
    return !o->terrain.valid || o->terrain.valid[y * o->terrain.width + x] != 0;
}

static int sample_height(const oracle *o, int x, int y) {
    return o->terrain.q[y * o->terrain.width + x];
}

int oracle_is_valid(const oracle *o, oracle_point lattice) {
    oracle_point p = oracle_clamp(o, lattice);
    return sample_is_valid(o, p.x, p.y);
}

/* ------------------------------------------------------------------------------------------- triangles -- */

/* The two halves of the root square; the hypotenuse is the diagonal from the north-west to the south-east. */
oracle_triangle oracle_root_half(const oracle *o, int which) {
    int s = o->side - 1;
    oracle_triangle t = {{{s, 0}, {0, 0}, {s, s}}, 0};
    oracle_triangle u = {{{0, s}, {s, s}, {0, 0}}, 0};
    return which == 0 ? t : u;
}

static int has_split(const oracle_triangle *t) {
    return (t->corner[1].x + t->corner[2].x) % 2 == 0 && (t->corner[1].y + t->corner[2].y) % 2 == 0 &&
           (t->corner[1].x != t->corner[2].x || t->corner[1].y != t->corner[2].y);
}

static oracle_point split_of(const oracle_triangle *t) {
    oracle_point m = {(t->corner[1].x + t->corner[2].x) / 2, (t->corner[1].y + t->corner[2].y) / 2};
    return m;
}

static oracle_triangle child_of(const oracle_triangle *t, int which) {
    oracle_triangle c;
    c.corner[0] = split_of(t);
    c.corner[1] = which == 0 ? t->corner[0] : t->corner[2];
    c.corner[2] = which == 0 ? t->corner[1] : t->corner[0];
    c.depth = t->depth + 1;
    return c;
}

int oracle_children(const oracle_triangle *t, oracle_triangle child[2]) {
    if (!has_split(t)) return 0;
    for (int which = 0; which < 2; which++) child[which] = child_of(t, which);
    return 1;
}

/* Twice the signed area of (a,b,c). */
static long cross(oracle_point a, oracle_point b, oracle_point c) {
    return (long)(b.x - a.x) * (c.y - a.y) - (long)(c.x - a.x) * (b.y - a.y);
}

static void clamp_corners(const oracle *o, const oracle_triangle *t, oracle_point p[3]) {
    for (int n = 0; n < 3; n++) p[n] = oracle_clamp(o, t->corner[n]);
}

long oracle_area(const oracle *o, const oracle_triangle *t) {
    oracle_point p[3];
    clamp_corners(o, t, p);
    return labs(cross(p[0], p[1], p[2]));
}

static void box_of(const oracle_point p[3], oracle_point *low, oracle_point *high) {
    *low = *high = p[0];
    for (int n = 1; n < 3; n++) {
        if (p[n].x < low->x) low->x = p[n].x;
        if (p[n].y < low->y) low->y = p[n].y;
        if (p[n].x > high->x) high->x = p[n].x;
        if (p[n].y > high->y) high->y = p[n].y;
    }
}

/* -------------------------------------------------------------------------------------------- errors --
 * A sample s of the closed triangle (a,b,c) has three weights, w_a = cross(s,b,c) and so on: none has the other
 * sign, and they add up to the doubled area D. The plane at s is (w_a z_a + w_b z_b + w_c z_c) / D, hence
 *     deviation = |w_a z_a + w_b z_b + w_c z_c - D z| / |D|     quanta, a rational with one denominator. */
typedef struct survey {
    int has_valid, has_void, corners_valid;
    mpz_t largest; /* numerator of the largest deviation over the valid samples; 0 unless the corners are valid */
} survey;

static void survey_triangle(const oracle *o, const oracle_point p[3], survey *s) {
    long D = cross(p[0], p[1], p[2]);
    oracle_point low, high;
    box_of(p, &low, &high);
    mpz_t z[3], sum, part;
    mpz_inits(sum, part, NULL);
    s->has_valid = s->has_void = 0;
    s->corners_valid = 1;
    mpz_set_ui(s->largest, 0);
    for (int n = 0; n < 3; n++) {
        mpz_init_set_si(z[n], sample_height(o, p[n].x, p[n].y));
        if (!sample_is_valid(o, p[n].x, p[n].y)) s->corners_valid = 0;
    }
    for (int y = low.y; y <= high.y; y++) {
        for (int x = low.x; x <= high.x; x++) {
            oracle_point at = {x, y};
            long w[3] = {cross(at, p[1], p[2]), cross(p[0], at, p[2]), cross(p[0], p[1], at)};
            int outside = 0;
            for (int n = 0; n < 3; n++) outside |= (D > 0 && w[n] < 0) || (D < 0 && w[n] > 0);
            if (outside) continue;
            if (!sample_is_valid(o, x, y)) {
                s->has_void = 1;
                continue;
            }
            s->has_valid = 1;
            if (!s->corners_valid) continue;
            mpz_set_si(sum, D);
            mpz_mul_si(sum, sum, -(long)sample_height(o, x, y));
            for (int n = 0; n < 3; n++) {
                mpz_mul_si(part, z[n], w[n]);
                mpz_add(sum, sum, part);
            }
            if (mpz_cmpabs(sum, s->largest) > 0) mpz_abs(s->largest, sum);
        }
    }
    for (int n = 0; n < 3; n++) mpz_clear(z[n]);
    mpz_clears(sum, part, NULL);
}

static void metres_of(const oracle *o, const mpz_t numerator, long area, mpq_t metres) {
    mpq_set_ui(metres, 0, 1);
    mpz_set(mpq_numref(metres), numerator);
    mpz_set_si(mpq_denref(metres), area);
    mpq_canonicalize(metres);
    mpq_mul(metres, metres, o->quantum);
}

void oracle_deviation(const oracle *o, const oracle_triangle *t, mpq_t metres) {
    oracle_point p[3];
    survey s;
    clamp_corners(o, t, p);
    mpz_init(s.largest);
    survey_triangle(o, p, &s);
    metres_of(o, s.largest, labs(cross(p[0], p[1], p[2])), metres);
    mpz_clear(s.largest);
}

/* What one triangle adds to its split vertex: its error in metres, and whether it is mixed. */
void oracle_triangle_error(const oracle *o, const oracle_triangle *t, mpq_t metres, int *mixed) {
    oracle_point p[3], low, high;
    clamp_corners(o, t, p);
    long area = labs(cross(p[0], p[1], p[2]));
    mpq_set_ui(metres, 0, 1);
    *mixed = 0;
    if (area == 0) return;
    survey s;
    mpz_init(s.largest);
    survey_triangle(o, p, &s);
    metres_of(o, s.largest, area, metres);
    if (s.has_valid && s.has_void) {
        *mixed = 1;
        box_of(p, &low, &high);
        long extent = high.x - low.x > high.y - low.y ? high.x - low.x : high.y - low.y;
        mpq_t cost, c;
        mpq_inits(cost, c, NULL);
        mpq_set_d(cost, o->terrain.cell);
        mpq_set_si(c, extent, 1);
        mpq_mul(cost, cost, c);
        mpq_set_d(c, o->terrain.c);
        mpq_div(cost, cost, c);
        if (mpq_cmp(cost, metres) > 0) mpq_set(metres, cost);
        mpq_clears(cost, c, NULL);
    }
    mpz_clear(s.largest);
}

static void add_edge(oracle *o, oracle_point parent, oracle_point child) {
    oracle_node *p = node_at(o, parent), *c = node_at(o, child);
    if (p->child_count == 4 || c->parent_count == 2) {
        fputs("oracle: a vertex has more than four children or two parents\n", stderr);
        abort();
    }
    p->child[p->child_count++] = child;
    c->parent[c->parent_count++] = parent;
}

/* Every triangle with a split vertex, once: an edge of the dependency graph, and a share of the vertex' error. */
static void visit(oracle *o, const oracle_triangle *t) {
    if (!has_split(t)) return;
    oracle_point m = split_of(t);
    oracle_node *n = node_at(o, m);
    n->level = t->depth / 2 + 1;
    add_edge(o, t->corner[0], m);
    mpq_t metres;
    int mixed;
    mpq_init(metres);
    oracle_triangle_error(o, t, metres, &mixed);
    if (mpq_cmp(metres, n->raw) > 0) mpq_set(n->raw, metres);
    n->raw_outline |= mixed;
    mpq_clear(metres);
    for (int which = 0; which < 2; which++) {
        oracle_triangle c = child_of(t, which);
        visit(o, &c);
    }
}

static int is_root_corner(const oracle *o, int x, int y) {
    return (x == 0 || x == o->side - 1) && (y == 0 || y == o->side - 1);
}

static void saturate(oracle *o) {
    int changed = 1;
    while (changed) {
        changed = 0;
        for (int n = 0; n < o->side * o->side; n++) {
            oracle_node *v = &o->node[n];
            for (int m = 0; m < v->parent_count; m++) {
                oracle_node *p = node_at(o, v->parent[m]);
                if (mpq_cmp(v->saturated, p->saturated) > 0) {
                    mpq_set(p->saturated, v->saturated);
                    changed = 1;
                }
                if (v->outline && !p->outline) {
                    p->outline = 1;
                    changed = 1;
                }
            }
        }
    }
}

void oracle_create_bare(oracle *o, const oracle_terrain *terrain) {
    o->terrain = *terrain;
    o->K = 0;
    while ((1 << o->K) + 1 < terrain->width || (1 << o->K) + 1 < terrain->height) o->K++;
    o->side = (1 << o->K) + 1;
    o->node = NULL;
    mpq_t other;
    mpq_inits(o->quantum, other, NULL);
    mpq_set_d(o->quantum, terrain->scale);
    mpq_abs(o->quantum, o->quantum);
    mpq_set_si(other, terrain->numerator, 1);
    mpq_mul(o->quantum, o->quantum, other);
    mpq_set_si(other, terrain->denominator, 1);
    mpq_div(o->quantum, o->quantum, other);
    mpq_set_si(other, terrain->d, 1);
    mpq_div(o->quantum, o->quantum, other);
    mpq_clear(other);
}

void oracle_create(oracle *o, const oracle_terrain *terrain) {
    oracle_create_bare(o, terrain);
    o->node = take((size_t)(o->side * o->side), sizeof *o->node);
    for (int n = 0; n < o->side * o->side; n++) mpq_inits(o->node[n].raw, o->node[n].saturated, NULL);
    for (int which = 0; which < 2; which++) {
        oracle_triangle t = oracle_root_half(o, which);
        visit(o, &t);
    }
    for (int n = 0; n < o->side * o->side; n++) {
        mpq_set(o->node[n].saturated, o->node[n].raw);
        o->node[n].outline = o->node[n].raw_outline;
    }
    saturate(o);
    for (int y = 0; y < o->side; y++) {
        for (int x = 0; x < o->side; x++) {
            oracle_node *v = &o->node[y * o->side + x];
            v->raw_code = oracle_code_up(v->raw);
            v->code = is_root_corner(o, x, y) ? ORACLE_INFINITY : oracle_code_up(v->saturated);
        }
    }
}

void oracle_free(oracle *o) {
    for (int n = 0; o->node && n < o->side * o->side; n++) mpq_clears(o->node[n].raw, o->node[n].saturated, NULL);
    mpq_clear(o->quantum);
    free(o->node);
    o->node = NULL;
}

/* --------------------------------------------------------------------------------------------- codes --
 * 0 is 0; c > 0 is (128 + (c & 127)) * 2^((c >> 7) - 263). */
void oracle_code_value(mpq_t value, unsigned code) {
    mpq_set_ui(value, code == 0 ? 0 : 128 + (code & 127), 1);
    if ((code >> 7) >= 263)
        mpq_mul_2exp(value, value, (code >> 7) - 263);
    else
        mpq_div_2exp(value, value, 263 - (code >> 7));
}

static int compare_code(unsigned code, const mpq_t m) {
    mpq_t value;
    mpq_init(value);
    oracle_code_value(value, code);
    int order = mpq_cmp(value, m);
    mpq_clear(value);
    return order;
}

/* A code near m, from a double: only where the exact search begins. */
static unsigned guess_code(const mpq_t m) {
    double d = mpq_get_d(m);
    int exponent;
    if (!(d > 0)) return 0;
    if (isinf(d)) return ORACLE_LARGEST;
    (void)frexp(d, &exponent);
    long code = (long)(exponent - 8 + 263) * 128;
    return code < 0 ? 0 : code > (long)ORACLE_LARGEST ? ORACLE_LARGEST : (unsigned)code;
}

unsigned oracle_code_up(const mpq_t m) {
    unsigned code = guess_code(m);
    while (code < ORACLE_LARGEST && compare_code(code, m) < 0) code++;
    while (code > 0 && compare_code(code - 1, m) >= 0) code--;
    return code;
}

unsigned oracle_code_down(const mpq_t m) {
    unsigned code = guess_code(m);
    while (code > 0 && compare_code(code, m) > 0) code--;
    while (code < ORACLE_LARGEST && compare_code(code + 1, m) <= 0) code++;
    return code;
}

/* ---------------------------------------------------------------------------------------------- sets -- */

unsigned char *oracle_set_create(const oracle *o) {
    return take((size_t)(o->side * o->side), 1);
}

static void add_corners(const oracle *o, unsigned char *set) {
    int s = o->side - 1;
    set[0] = set[s] = set[s * o->side] = set[s * o->side + s] = 1;
}

void oracle_select(const oracle *o, unsigned eps, int exact, unsigned char *set) {
    for (int n = 0; n < o->side * o->side; n++) set[n] = o->node[n].code > eps || (exact && o->node[n].outline);
    add_corners(o, set);
}

void oracle_close(const oracle *o, unsigned char *set) {
    int changed = 1;
    add_corners(o, set);
    while (changed) {
        changed = 0;
        for (int n = 0; n < o->side * o->side; n++) {
            const oracle_node *v = &o->node[n];
            for (int m = 0; set[n] && m < v->parent_count; m++) {
                unsigned char *p = &set[v->parent[m].y * o->side + v->parent[m].x];
                if (!*p) *p = 1, changed = 1;
            }
        }
    }
}

void oracle_select_raw(const oracle *o, unsigned eps, int exact, unsigned char *set) {
    for (int n = 0; n < o->side * o->side; n++)
        set[n] = o->node[n].raw_code > eps || (exact && o->node[n].raw_outline);
    oracle_close(o, set);
}

/* -------------------------------------------------------------------------------------------- leaves -- */

static void append(oracle_list *list, const oracle_triangle *t) {
    if (list->count == list->capacity) {
        list->capacity = list->capacity ? 2 * list->capacity : 256;
        oracle_triangle *bigger = take(list->capacity, sizeof *bigger);
        if (list->count) memcpy(bigger, list->triangle, list->count * sizeof *bigger);
        free(list->triangle);
        list->triangle = bigger;
    }
    list->triangle[list->count++] = *t;
}

void oracle_list_free(oracle_list *list) {
    free(list->triangle);
    memset(list, 0, sizeof *list);
}

static void leaves_below(const oracle *o, const unsigned char *set, const oracle_triangle *t, oracle_list *list) {
    if (has_split(t)) {
        oracle_point m = split_of(t);
        if (set[m.y * o->side + m.x]) {
            for (int which = 0; which < 2; which++) {
                oracle_triangle c = child_of(t, which);
                leaves_below(o, set, &c, list);
            }
            return;
        }
    }
    int kept = oracle_area(o, t) != 0;
    for (int n = 0; n < 3; n++) kept = kept && oracle_is_valid(o, t->corner[n]);
    if (kept) append(list, t);
}

void oracle_leaves(const oracle *o, const unsigned char *set, oracle_list *list) {
    for (int which = 0; which < 2; which++) {
        oracle_triangle t = oracle_root_half(o, which);
        leaves_below(o, set, &t, list);
    }
}

static void units_below(const oracle *o, const oracle_triangle *t, oracle_list *list) {
    if (!has_split(t)) {
        if (oracle_area(o, t) != 0) append(list, t);
        return;
    }
    for (int which = 0; which < 2; which++) {
        oracle_triangle c = child_of(t, which);
        units_below(o, &c, list);
    }
}

void oracle_unit_triangles(const oracle *o, oracle_list *list) {
    for (int which = 0; which < 2; which++) {
        oracle_triangle t = oracle_root_half(o, which);
        units_below(o, &t, list);
    }
}

/* ------------------------------------------------------------------------------------------- windows --
 * A half-plane is {(x,y) : a x + b y + c >= 0}; a convex polygon is a list of rational points. Clipping a triangle
 * by the four sides of a rectangle leaves their intersection; interiors meet iff it has an area. */
typedef struct rational_point {
    mpq_t x, y;
} rational_point;

#define MOST_CORNERS 8 /* a triangle gains at most one corner from each of four half-planes */

typedef struct polygon {
    rational_point point[MOST_CORNERS];
    int count;
} polygon;

static void polygon_init(polygon *p) {
    p->count = 0;
    for (int n = 0; n < MOST_CORNERS; n++) mpq_inits(p->point[n].x, p->point[n].y, NULL);
}

static void polygon_clear(polygon *p) {
    for (int n = 0; n < MOST_CORNERS; n++) mpq_clears(p->point[n].x, p->point[n].y, NULL);
}

static void polygon_push(polygon *p, const rational_point *at) {
    mpq_set(p->point[p->count].x, at->x);
    mpq_set(p->point[p->count].y, at->y);
    p->count++;
}

/* value = a x + b y + c */
static void evaluate(mpq_t value, const long plane[3], const rational_point *at) {
    mpq_t part;
    mpq_init(part);
    mpq_set_si(value, plane[2], 1);
    mpq_set_si(part, plane[0], 1);
    mpq_mul(part, part, at->x);
    mpq_add(value, value, part);
    mpq_set_si(part, plane[1], 1);
    mpq_mul(part, part, at->y);
    mpq_add(value, value, part);
    mpq_clear(part);
}

static void polygon_clip(const polygon *in, const long plane[3], polygon *out) {
    mpq_t here, there, share;
    rational_point at;
    mpq_inits(here, there, share, at.x, at.y, NULL);
    out->count = 0;
    for (int n = 0; n < in->count; n++) {
        const rational_point *a = &in->point[n], *b = &in->point[(n + 1) % in->count];
        evaluate(here, plane, a);
        evaluate(there, plane, b);
        if (mpq_sgn(here) >= 0) polygon_push(out, a);
        if (mpq_sgn(here) * mpq_sgn(there) < 0) { /* the side crosses the line at a + share * (b - a) */
            mpq_sub(share, here, there);
            mpq_div(share, here, share);
            mpq_sub(at.x, b->x, a->x);
            mpq_mul(at.x, at.x, share);
            mpq_add(at.x, at.x, a->x);
            mpq_sub(at.y, b->y, a->y);
            mpq_mul(at.y, at.y, share);
            mpq_add(at.y, at.y, a->y);
            polygon_push(out, &at);
        }
    }
    mpq_clears(here, there, share, at.x, at.y, NULL);
}

/* Twice the area, without sign. */
static void polygon_area(const polygon *p, mpq_t area) {
    mpq_t part;
    mpq_init(part);
    mpq_set_ui(area, 0, 1);
    for (int n = 0; n < p->count; n++) {
        const rational_point *a = &p->point[n], *b = &p->point[(n + 1) % p->count];
        mpq_mul(part, a->x, b->y);
        mpq_add(area, area, part);
        mpq_mul(part, a->y, b->x);
        mpq_sub(area, area, part);
    }
    mpq_abs(area, area);
    mpq_clear(part);
}

static int polygon_has_area(const polygon *p) {
    mpq_t area;
    mpq_init(area);
    polygon_area(p, area);
    int has = mpq_sgn(area) != 0;
    mpq_clear(area);
    return has;
}

/* Keeps what lies in the n half-planes. */
static void polygon_keep(polygon *p, const long plane[][3], int n) {
    polygon rest;
    polygon_init(&rest);
    for (int m = 0; m < n && p->count > 0; m++) {
        polygon_clip(p, plane[m], &rest);
        p->count = 0;
        for (int c = 0; c < rest.count; c++) polygon_push(p, &rest.point[c]);
    }
    polygon_clear(&rest);
}

/* The three half-planes whose intersection is the closed triangle with an area, its coordinates in `units`. */
static void half_planes(const oracle_point corner[3], long units, long plane[3][3]) {
    oracle_point p[3] = {corner[0], corner[1], corner[2]};
    if (cross(p[0], p[1], p[2]) < 0) {
        p[1] = corner[2];
        p[2] = corner[1];
    }
    for (int n = 0; n < 3; n++) {
        oracle_point a = p[n], b = p[(n + 1) % 3];
        plane[n][0] = -(long)(b.y - a.y);
        plane[n][1] = (long)(b.x - a.x);
        plane[n][2] = -(plane[n][0] * a.x + plane[n][1] * a.y) * units;
    }
}

static void polygon_of(polygon *p, const oracle_point corner[3], long units) {
    polygon_init(p);
    for (int n = 0; n < 3; n++) {
        mpq_set_si(p->point[n].x, corner[n].x * units, 1);
        mpq_set_si(p->point[n].y, corner[n].y * units, 1);
    }
    p->count = 3;
}

void oracle_common_area(const oracle_point a[3], const oracle_point b[3], mpq_t area) {
    long plane[3][3];
    polygon p;
    polygon_of(&p, a, 1);
    half_planes(b, 1, plane);
    polygon_keep(&p, (const long(*)[3])plane, 3);
    polygon_area(&p, area);
    polygon_clear(&p);
}

long oracle_round(double samples) {
    mpq_t value, half;
    mpz_t down;
    mpq_inits(value, half, NULL);
    mpz_init(down);
    mpq_set_d(value, samples);
    mpq_mul_2exp(value, value, 20);
    mpq_set_si(half, 1, 2);
    mpq_add(value, value, half);
    mpz_fdiv_q(down, mpq_numref(value), mpq_denref(value));
    long result = mpz_get_si(down);
    mpq_clears(value, half, NULL);
    mpz_clear(down);
    return result;
}

int oracle_meets_rectangle(const oracle *o, const oracle_triangle *t, const long rectangle[4]) {
    const long side[4][3] = {
        {1, 0, -rectangle[0]}, {0, 1, -rectangle[1]}, {-1, 0, rectangle[2]}, {0, -1, rectangle[3]}};
    oracle_point corner[3];
    polygon p;
    clamp_corners(o, t, corner);
    polygon_of(&p, corner, ORACLE_UNITS);
    polygon_keep(&p, side, 4);
    int meets = p.count > 0 && polygon_has_area(&p);
    polygon_clear(&p);
    return meets;
}

/* The segment is a polygon of two corners; what the triangle's three closed half-planes leave of it is not empty.
 */
int oracle_meets_segment(const oracle *o, const oracle_triangle *t, const long segment[4]) {
    long plane[3][3];
    oracle_point corner[3];
    polygon p;
    clamp_corners(o, t, corner);
    half_planes(corner, ORACLE_UNITS, plane);
    polygon_init(&p);
    for (int n = 0; n < 2; n++) {
        mpq_set_si(p.point[n].x, segment[2 * n], 1);
        mpq_set_si(p.point[n].y, segment[2 * n + 1], 1);
    }
    p.count = 2;
    polygon_keep(&p, (const long(*)[3])plane, 3);
    int meets = p.count > 0;
    polygon_clear(&p);
    return meets;
}
