/* strip_fans.c - one generalized strip round the centres of quadtree blocks ([RQT] section 7, figures 6 and 7).
 *
 * The walk of the paper circles round the centre c of each block, in by one corner (the inlet) and out by another
 * (the outlet), and into those blocks around c that have a centre of their own. That visits the triangles in the
 * order in which a bintree walk visits them, along the same space-filling curve: a block entered twice (two-pass)
 * is a block at which the bintree has the two halves apart. So the order is the patch's; what differs is how it is
 * said. Here a strip is a sequence of fans, each a run of triangles that share the centre of their block, whose rim
 * is 0 .. n: { 0, 1, c, [i, c for 1 < i < n-1], n-1, n } Each triangle of a run but its first and last takes two
 * indices, because c is repeated; in return every run begins and ends on the rim of its block, and the last index
 * of one is the first of the next where the curve goes on there.
 *
 * A patch whose order is another one (blocks walked by twos, clockwise runs, voids) costs more joins, nothing else.
 */
#include "internal.h"

typedef struct strip {
    uint32_t *index;
    size_t count, capacity;
} strip;

static bool is_join(uint32_t a, uint32_t b, uint32_t c) {
    return a == b || b == c || c == a;
}

/* Indices to put before `second` so that `first` ends up at an even or odd place with `second` after it, and no
 * triangle but joins. out has room for 4. */
static int find_join(const strip *s, uint32_t first, uint32_t second, bool odd, uint32_t out[4]) {
    int n = 0;
    const bool has_one = s->count > 0, has_two = s->count > 1;
    uint32_t before = has_two ? s->index[s->count - 2] : 0, last = has_one ? s->index[s->count - 1] : 0;
    bool pair = has_two; /* before and last are both there */
    if (has_one && last != first) {
        if (pair && !is_join(before, last, first)) out[n++] = last;
        out[n++] = first;
        before = last;
        last = first;
        pair = true;
    } else if (!has_one) {
        out[n++] = first;
        last = first;
    }
    for (;;) {
        const size_t place = s->count + (size_t)n - 1;
        if ((place & 1) == (odd ? 1u : 0u) && (!pair || is_join(before, last, second))) return n;
        out[n++] = first;
        before = last;
        pair = true;
    }
}

static void append(strip *s, const uint32_t *v, int n) {
    for (int i = 0; i < n; i++) s->index[s->count++] = v[i];
}

/* One triangle, counter-clockwise: begun at the corner and in the direction that join at the least cost. */
static void append_single(strip *s, const uint32_t t[3]) {
    uint32_t best[4], order[3] = {0};
    int least = 5;
    for (int way = 0; way < 6; way++) {
        const bool odd = way >= 3;
        const uint32_t a = t[way % 3], b = t[(way + (odd ? 2 : 1)) % 3], c = t[(way + (odd ? 1 : 2)) % 3];
        uint32_t join[4];
        const int n = find_join(s, a, b, odd, join);
        if (n >= least) continue;
        least = n;
        memcpy(best, join, sizeof best);
        order[0] = a, order[1] = b, order[2] = c;
    }
    append(s, best, least);
    append(s, order + 1, 2);
}

/* Where the block's centre is among the three corners of a leaf: the one corner both of whose coordinates are odd
 * multiples of the leaf's smallest power of two. (Of the two halves of the root it is the south-east corner.) */
static rqt_vertex center_of(const rqt_triangle *leaf) {
    const rqt_vertex v[3] = {leaf->apex, leaf->left, leaf->right};
    const uint32_t all = (uint32_t)(v[0].x | v[0].y | v[1].x | v[1].y | v[2].x | v[2].y), q = all & (0 - all);
    for (int i = 0; i < 2; i++)
        if ((uint32_t)v[i].x & (uint32_t)v[i].y & q) return v[i];
    return v[2];
}

/* Triangle t as its centre and the two corners of its rim, counter-clockwise. */
typedef struct slice {
    uint32_t center, from, to;
} slice;

static slice slice_of(const rqt_patch *patch, size_t t, int32_t last_col, int32_t last_row) {
    const uint32_t *const i = patch->triangles + 3 * t;
    rqt_vertex c = center_of(&patch->leaves[t]);
    if (c.x > last_col) c.x = last_col;
    if (c.y > last_row) c.y = last_row;
    for (int n = 0; n < 2; n++) {
        const rqt_patch_vertex *v = &patch->vertices[i[n]];
        if (v->col == c.x && v->row == c.y) return (slice){i[n], i[n + 1], i[(n + 2) % 3]};
    }
    return (slice){i[2], i[0], i[1]};
}

/* How many triangles from t on are a fan round one centre, at most 8; *odd: it turns clockwise. */
static int run_length(const slice *s, int most, bool *odd) {
    int n = 1;
    *odd = false;
    while (n < most && s[n].center == s[0].center) {
        if (n == 1) *odd = s[1].from != s[0].to;
        if (*odd ? s[n].to != s[n - 1].from : s[n].from != s[n - 1].to) break;
        n++;
    }
    return n;
}

static void append_run(strip *s, const slice *run, int n, bool odd) {
    if (n == 1) {
        append_single(s, (const uint32_t[3]){run->center, run->from, run->to});
        return;
    }
    uint32_t rim[9], join[4];
    rim[0] = odd ? run[0].to : run[0].from;
    for (int i = 0; i < n; i++) rim[i + 1] = odd ? run[i].from : run[i].to;
    append(s, join, find_join(s, rim[0], rim[1], odd, join));
    const uint32_t center = run->center;
    append(s, (const uint32_t[2]){rim[1], center}, 2);
    for (int i = 2; i < n - 1; i++) append(s, (const uint32_t[2]){rim[i], center}, 2);
    append(s, rim + n - 1, 2);
}

/* Clamped vertices lie on the last column or row, which the patch may not reach: then nothing is clamped. */
static void find_last(const rqt_patch *patch, int32_t *last_col, int32_t *last_row) {
    *last_col = *last_row = 0;
    for (size_t v = 0; v < patch->vertex_count; v++) {
        if (patch->vertices[v].col > *last_col) *last_col = patch->vertices[v].col;
        if (patch->vertices[v].row > *last_row) *last_row = patch->vertices[v].row;
    }
}

rqt_status rqt_strip_build_fans(const rqt_patch *patch, const rqt_allocator *allocator, uint32_t **out, size_t *n) {
    *out = NULL;
    *n = 0;
    if (patch->triangle_count == 0) return RQT_OK;
    if (!patch->leaves) return RQT_INVALID;
    int32_t last_col, last_row;
    find_last(patch, &last_col, &last_row);
    strip s = {0};
    for (size_t t = 0; t < patch->triangle_count;) {
        slice run[8];
        const size_t left = patch->triangle_count - t;
        const int most = left < 8 ? (int)left : 8;
        for (int i = 0; i < most; i++) run[i] = slice_of(patch, t + (size_t)i, last_col, last_row);
        bool odd;
        const int length = run_length(run, most, &odd);
        if (!memory_grow(allocator, (void **)&s.index, &s.capacity, s.count + 4 + 2 * 9, sizeof *s.index)) {
            memory_drop(allocator, s.index);
            return RQT_NO_MEMORY;
        }
        append_run(&s, run, length, odd);
        t += (size_t)length;
    }
    *out = s.index;
    *n = s.count;
    return RQT_OK;
}
