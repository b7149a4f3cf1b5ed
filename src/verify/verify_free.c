/* verify_free.c - the verifier for meshes whose vertices lie between samples.
 *
 * Places are doubles. Multiplied by the least power of two that makes all of them whole they are int64, and every
 * question of place is answered in integers of 128 bits: areas, which side, which samples of a row lie in a closed
 * triangle. Heights are doubles as they come: the plane's height at a sample is the mean of the corners' heights
 * with the areas as weights, which rounding moves by a few units in the last place of the largest height, less than
 * VERIFY_FREE_ROUNDING quanta for heights below 2^30.
 *
 * T-junctions: vertices are sorted by the unit square they lie in, row by row of squares, so that those near an
 * edge are a run in each row that the edge passes.
 */
#include "verify_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_BITS = 52, PLACE_BITS = 53 };

typedef struct place {
    int64_t x, y;
} place;

typedef struct free_vertex {
    place at;
    double q;
    int32_t square_x, square_y;
} free_vertex;

typedef struct free_edge {
    size_t low, high; /* vertices */
    size_t third;     /* the triangle's other corner, which is no junction in a triangle of no area; else NONE */
} free_edge;

#define NONE SIZE_MAX

typedef struct free_mesh {
    const verify_samples *samples;
    const verify_free_triangle *triangles;
    size_t n;
    int bits; /* a sample is 2^bits */
    place (*corner)[3];
} free_mesh;

static verify_wide cross(place a, place b, place c) {
    return (verify_wide)(b.x - a.x) * (c.y - a.y) - (verify_wide)(c.x - a.x) * (b.y - a.y);
}

static int32_t floor_sample(int64_t v, int bits) {
    return (int32_t)(v >> bits);
}
static int32_t ceil_sample(int64_t v, int bits) {
    return (int32_t)(-(-v >> bits));
}

/* ------------------------------------------------------------------------------------------------ input */

static bool corner_is_sound(const verify_samples *s, const verify_free_corner *c) {
    const double first_col = s->col0, last_col = first_col + s->width - 1, first_row = s->row0,
                 last_row = first_row + s->height - 1;
    return fabs(c->col) < VERIFY_CORNER_LIMIT && fabs(c->row) < VERIFY_CORNER_LIMIT &&
           fabs(c->q) < VERIFY_HEIGHT_LIMIT && c->col >= first_col && c->col <= last_col && c->row >= first_row &&
           c->row <= last_row;
}

static bool take_place(const verify_free_corner *c, int bits, place *at) {
    const double x = ldexp(c->col, bits), y = ldexp(c->row, bits);
    if (x != floor(x) || y != floor(y)) return false;
    *at = (place){(int64_t)x, (int64_t)y};
    return true;
}

static bool take_places(free_mesh *m) {
    double largest = 0;
    for (size_t t = 0; t < m->n; t++)
        for (int k = 0; k < 3; k++) {
            const verify_free_corner *c = &m->triangles[t].corner[k];
            if (!corner_is_sound(m->samples, c)) return false;
            largest = fmax(largest, fmax(fabs(c->col), fabs(c->row)));
            place unused;
            while (!take_place(c, m->bits, &unused))
                if (++m->bits > MOST_BITS) return false;
        }
    if (ldexp(largest, m->bits) >= ldexp(1, PLACE_BITS)) return false;
    for (size_t t = 0; t < m->n; t++)
        for (int k = 0; k < 3; k++) (void)take_place(&m->triangles[t].corner[k], m->bits, &m->corner[t][k]);
    return true;
}

/* --------------------------------------------------------------------------------------- area, overlaps */

static void sum_areas(const free_mesh *m, verify_report *report) {
    /* Whole cells and the rest apart: each is exact, together they could outgrow 128 bits. */
    const int bits = 2 * m->bits;
    verify_uwide cells = 0, rest = 0;
    for (size_t t = 0; t < m->n; t++) {
        const verify_wide twice = cross(m->corner[t][0], m->corner[t][1], m->corner[t][2]);
        const verify_uwide size = (verify_uwide)(twice < 0 ? -twice : twice);
        cells += size >> bits;
        rest += size & (((verify_uwide)1 << bits) - 1);
        cells += rest >> bits;
        rest &= ((verify_uwide)1 << bits) - 1;
    }
    const double sum = (double)cells + ldexp((double)rest, -bits);
    report->twice_area = (uint64_t)(sum + 0.5);
    report->area = sum / 2 * fabs(m->samples->cell_x * m->samples->cell_y);
}

/* Is the whole of t on or outside the line of one of s's edges? */
static bool edge_separates(const place s[3], const place t[3]) {
    const bool turned = cross(s[0], s[1], s[2]) < 0;
    for (int k = 0; k < 3; k++) {
        bool outside = true;
        for (int j = 0; j < 3 && outside; j++) {
            const verify_wide side = cross(s[k], s[(k + 1) % 3], t[j]);
            outside = turned ? side >= 0 : side <= 0;
        }
        if (outside) return true;
    }
    return false;
}

static bool triangles_meet(const void *context, size_t a, size_t b) {
    const free_mesh *m = context;
    return !edge_separates(m->corner[a], m->corner[b]) && !edge_separates(m->corner[b], m->corner[a]);
}

static int64_t least(const int64_t a, int64_t b, int64_t c) {
    return a < b ? (a < c ? a : c) : (b < c ? b : c);
}
static int64_t most(int64_t a, int64_t b, int64_t c) {
    return -least(-a, -b, -c);
}

static verify_status measure_overlaps(const free_mesh *m, verify_report *report) {
    verify_box *boxes = malloc((m->n + 1) * sizeof *boxes);
    if (boxes == NULL) return VERIFY_NO_MEMORY;
    uint64_t turned = 0, pairs = 0;
    for (size_t t = 0; t < m->n; t++) {
        const place *c = m->corner[t];
        const verify_wide twice = cross(c[0], c[1], c[2]);
        turned += twice >= 0;
        boxes[t] = (verify_box){.west = 1};
        if (twice == 0) continue;
        boxes[t] = (verify_box){
            .west = (uint32_t)(floor_sample(least(c[0].x, c[1].x, c[2].x), m->bits) - VERIFY_GRID_ORIGIN),
            .north = (uint32_t)(floor_sample(least(c[0].y, c[1].y, c[2].y), m->bits) - VERIFY_GRID_ORIGIN),
            .east = (uint32_t)(ceil_sample(most(c[0].x, c[1].x, c[2].x), m->bits) - VERIFY_GRID_ORIGIN - 1),
            .south = (uint32_t)(ceil_sample(most(c[0].y, c[1].y, c[2].y), m->bits) - VERIFY_GRID_ORIGIN - 1)};
    }
    const verify_status status = verify_count_pairs(boxes, m->n, triangles_meet, m, &pairs);
    free(boxes);
    report->overlaps = turned + pairs;
    return status;
}

/* ----------------------------------------------------------------------------------------------- cracks */

static int compare_int64(int64_t a, int64_t b) {
    return (a > b) - (a < b);
}

static int compare_vertices(const void *left, const void *right) {
    const free_vertex *a = left, *b = right;
    int order = compare_int64(a->square_y, b->square_y);
    if (order == 0) order = compare_int64(a->square_x, b->square_x);
    if (order == 0) order = compare_int64(a->at.y, b->at.y);
    if (order == 0) order = compare_int64(a->at.x, b->at.x);
    return order != 0 ? order : (a->q > b->q) - (a->q < b->q);
}

static int compare_edges(const void *left, const void *right) {
    const free_edge *a = left, *b = right;
    int order = (a->low > b->low) - (a->low < b->low);
    if (order == 0) order = (a->high > b->high) - (a->high < b->high);
    return order != 0 ? order : (a->third > b->third) - (a->third < b->third);
}

static free_vertex vertex_of(const free_mesh *m, size_t t, int k) {
    const place at = m->corner[t][k];
    return (free_vertex){at, m->triangles[t].corner[k].q, floor_sample(at.x, m->bits), floor_sample(at.y, m->bits)};
}

static bool is_same_place(const free_vertex *a, const free_vertex *b) {
    return a->at.x == b->at.x && a->at.y == b->at.y;
}

/* Keeps one vertex a place; of k different heights at one place any two make a crack. */
static size_t merge_vertices(free_vertex *v, size_t count, uint64_t *height_pairs) {
    size_t kept = 0;
    uint64_t different = 0;
    for (size_t i = 0; i < count; i++) {
        if (i > 0 && is_same_place(&v[i], &v[kept - 1])) {
            if (v[i].q > v[kept - 1].q) { /* heights come in order; the place keeps the latest */
                *height_pairs += ++different;
                v[kept - 1].q = v[i].q;
            }
            continue;
        }
        different = 0;
        v[kept++] = v[i];
    }
    return kept;
}

/* The first vertex that is not before (square_x, square_y) and, there, not before the place. */
static size_t lower_bound(const free_vertex *v, size_t count, const free_vertex *wanted) {
    size_t low = 0, high = count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (compare_vertices(&v[middle], wanted) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static size_t index_of(const free_vertex *v, size_t count, free_vertex wanted) {
    wanted.q = -INFINITY;
    return lower_bound(v, count, &wanted);
}

/* Strictly inside the edge? */
static bool is_inside_edge(place a, place b, place p) {
    if (cross(a, b, p) != 0) return false;
    return (verify_wide)(p.x - a.x) * (p.x - b.x) + (verify_wide)(p.y - a.y) * (p.y - b.y) < 0;
}

/* Vertices inside one edge, from the squares around it. */
static uint64_t count_inside(const free_mesh *m, const free_vertex *v, size_t count, const free_edge *e) {
    place a = v[e->low].at, b = v[e->high].at;
    if (a.y > b.y) {
        const place swap = a;
        a = b;
        b = swap;
    }
    const double unit = ldexp(1, -m->bits), ax = (double)a.x * unit, ay = (double)a.y * unit,
                 bx = (double)b.x * unit, by = (double)b.y * unit;
    uint64_t found = 0;
    for (int32_t row = floor_sample(a.y, m->bits); row <= floor_sample(b.y, m->bits); row++) {
        /* the edge's columns in this row of squares, and one more on both sides for the rounding */
        double from = ax, to = bx;
        if (by > ay) {
            from = ax + (bx - ax) * (fmax(row, ay) - ay) / (by - ay);
            to = ax + (bx - ax) * (fmin(row + 1.0, by) - ay) / (by - ay);
        }
        const free_vertex first = {.at = {INT64_MIN, INT64_MIN},
                                   .q = -INFINITY,
                                   .square_x = (int32_t)floor(fmin(from, to)) - 1,
                                   .square_y = row};
        const int32_t last = (int32_t)floor(fmax(from, to)) + 1;
        for (size_t i = lower_bound(v, count, &first); i < count && v[i].square_y == row && v[i].square_x <= last;
             i++)
            found += i != e->third && is_inside_edge(a, b, v[i].at);
    }
    return found;
}

static void measure_vertices(const free_mesh *m, free_vertex *v, size_t count, free_edge *edges,
                             verify_report *report) {
    const verify_samples *s = m->samples;
    const int64_t sample = (int64_t)1 << m->bits;
    uint64_t height_pairs = 0, inside = 0;
    qsort(v, count, sizeof *v, compare_vertices);
    const size_t kept = merge_vertices(v, count, &height_pairs);
    report->vertices = kept;
    for (size_t i = 0; i < kept; i++)
        if (v[i].at.x % sample == 0 && v[i].at.y % sample == 0 && s->valid != NULL)
            report->void_touched += !s->valid[verify_index(s, v[i].square_x, v[i].square_y)];
    size_t edge_count = 0;
    for (size_t t = 0; t < m->n; t++) {
        const bool flat = cross(m->corner[t][0], m->corner[t][1], m->corner[t][2]) == 0;
        size_t at[3];
        for (int k = 0; k < 3; k++) at[k] = index_of(v, kept, vertex_of(m, t, k));
        for (int k = 0; k < 3; k++) {
            const size_t from = at[k], to = at[(k + 1) % 3], third = flat ? at[(k + 2) % 3] : NONE;
            edges[edge_count++] = from < to ? (free_edge){from, to, third} : (free_edge){to, from, third};
        }
    }
    qsort(edges, edge_count, sizeof *edges, compare_edges);
    for (size_t e = 0, next; e < edge_count && inside < VERIFY_COUNT_CAP; e = next) {
        /* What one triangle leaves out another may not: only what all leave out is left out. */
        free_edge edge = edges[e];
        for (next = e + 1; next < edge_count && edges[next].low == edge.low && edges[next].high == edge.high;
             next++)
            if (edges[next].third != edge.third) edge.third = NONE;
        inside += count_inside(m, v, kept, &edge);
    }
    report->t_junctions = (inside < VERIFY_COUNT_CAP ? inside : VERIFY_COUNT_CAP) + height_pairs;
}

static verify_status measure_cracks(const free_mesh *m, verify_report *report) {
    const size_t count = 3 * m->n;
    free_vertex *v = malloc((count + 1) * sizeof *v);
    free_edge *edges = malloc((count + 1) * sizeof *edges);
    const verify_status status = v != NULL && edges != NULL ? VERIFY_OK : VERIFY_NO_MEMORY;
    if (status == VERIFY_OK) {
        for (size_t t = 0; t < m->n; t++)
            for (int k = 0; k < 3; k++) v[3 * t + (size_t)k] = vertex_of(m, t, k);
        measure_vertices(m, v, count, edges, report);
    }
    free(v);
    free(edges);
    return status;
}

/* ------------------------------------------------------------------------------------------------ error */

/* A triangle turned so that cross is above 0, with heights; and the largest deviation so far. */
typedef struct free_plane {
    place corner[3];
    double q[3], whole;
} free_plane;

/* The samples of a row in the closed triangle: from..to, none when from > to. */
static void row_interval(const free_plane *p, int bits, int32_t row, int64_t *from, int64_t *to) {
    const int64_t y = (int64_t)row << bits;
    *from = INT64_MIN;
    *to = INT64_MAX;
    for (int k = 0; k < 3; k++) {
        const place a = p->corner[k], b = p->corner[(k + 1) % 3];
        const verify_wide dy = b.y - a.y, reach = (verify_wide)(b.x - a.x) * (y - a.y);
        if (dy == 0) continue; /* a level edge bounds the rows, and the rows are already the triangle's */
        /* x - a.x = reach / dy on the edge; samples are multiples of 2^bits, so the end is rounded to those */
        const verify_wide step = (dy > 0 ? dy : -dy) * ((verify_wide)1 << bits);
        verify_wide at = (dy > 0 ? reach : -reach) + (verify_wide)a.x * (dy > 0 ? dy : -dy);
        if (dy < 0) at = -at; /* rounded up is minus what the negative is rounded down to */
        verify_wide end = at / step;
        if (at % step < 0) end--;
        if (dy > 0 && end < *to) *to = (int64_t)end;
        if (dy < 0 && -end > *from) *from = (int64_t)-end;
    }
}

static double plane_at(const free_plane *p, place at) {
    const double one = (double)cross(p->corner[0], at, p->corner[2]),
                 two = (double)cross(p->corner[0], p->corner[1], at);
    return p->q[0] + (one / p->whole) * (p->q[1] - p->q[0]) + (two / p->whole) * (p->q[2] - p->q[0]);
}

static void measure_triangle(const free_mesh *m, size_t t, double *deviation) {
    const place *c = m->corner[t];
    const verify_wide twice = cross(c[0], c[1], c[2]);
    if (twice == 0) return;
    const int second = twice > 0 ? 1 : 2, third = 3 - second;
    const verify_free_corner *corner = m->triangles[t].corner;
    const free_plane p = {{c[0], c[second], c[third]},
                          {corner[0].q, corner[second].q, corner[third].q},
                          (double)(twice > 0 ? twice : -twice)};
    const int32_t first_row = ceil_sample(least(c[0].y, c[1].y, c[2].y), m->bits),
                  last_row = floor_sample(most(c[0].y, c[1].y, c[2].y), m->bits);
    const int64_t first_col = ceil_sample(least(c[0].x, c[1].x, c[2].x), m->bits),
                  last_col = floor_sample(most(c[0].x, c[1].x, c[2].x), m->bits);
    for (int32_t row = first_row; row <= last_row; row++) {
        int64_t from, to;
        row_interval(&p, m->bits, row, &from, &to);
        if (from < first_col) from = first_col;
        if (to > last_col) to = last_col;
        for (int64_t col = from; col <= to; col++) {
            const size_t index = verify_index(m->samples, (int32_t)col, row);
            double off = 0;
            if (m->samples->valid == NULL || m->samples->valid[index]) {
                const place at = {col * ((int64_t)1 << m->bits), (int64_t)row << m->bits};
                off = fmax(fabs(m->samples->q[index] - plane_at(&p, at)) - VERIFY_FREE_ROUNDING, 0);
            }
            deviation[index] = fmax(deviation[index], off);
        }
    }
}

static verify_status measure_error(const free_mesh *m, verify_report *report) {
    const verify_samples *s = m->samples;
    const size_t count = (size_t)s->width * (size_t)s->height;
    if (count == 0) return VERIFY_OK;
    if (count > SIZE_MAX / sizeof(double)) return VERIFY_NO_MEMORY;
    double *deviation = malloc(count * sizeof *deviation);
    if (deviation == NULL) return VERIFY_NO_MEMORY;
    for (size_t i = 0; i < count; i++) deviation[i] = -1;
    for (size_t t = 0; t < m->n; t++) measure_triangle(m, t, deviation);
    verify_sum_deviations(s, deviation, report);
    double largest = -1;
    for (size_t i = 0; i < count && report->samples > 0; i++) {
        if (deviation[i] <= largest || (s->valid != NULL && !s->valid[i])) continue;
        largest = deviation[i];
        report->worst_col = (int32_t)(s->col0 + (int64_t)(i % (size_t)s->width));
        report->worst_row = (int32_t)(s->row0 + (int64_t)(i / (size_t)s->width));
    }
    if (largest > 0) report->max_error = largest * s->quantum;
    free(deviation);
    return VERIFY_OK;
}

verify_status verify_free_mesh(const verify_samples *samples, const verify_free_triangle *triangles, size_t n,
                               verify_report *report) {
    if (samples == NULL || report == NULL) return VERIFY_INVALID;
    memset(report, 0, sizeof *report);
    if (!verify_samples_are_sound(samples) || (triangles == NULL && n > 0)) return VERIFY_INVALID;
    free_mesh m = {
        .samples = samples, .triangles = triangles, .n = n, .corner = malloc((n + 1) * sizeof *m.corner)};
    if (m.corner == NULL) return VERIFY_NO_MEMORY;
    verify_report found = {.triangles = n};
    verify_status status = take_places(&m) ? VERIFY_OK : VERIFY_INVALID;
    if (status == VERIFY_OK) {
        sum_areas(&m, &found);
        status = measure_cracks(&m, &found);
    }
    if (status == VERIFY_OK) status = measure_overlaps(&m, &found);
    if (status == VERIFY_OK) status = measure_error(&m, &found);
    if (status == VERIFY_OK) *report = found;
    free(m.corner);
    return status;
}
