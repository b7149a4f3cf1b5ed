/* field.c - an eps for every place: rqt.h, "rules". A quadtree of squares.
 *
 * Nodes lie in one array, children after their parent, the four of a square side by side: north-west, north-east,
 * south-west, south-east. A node is 12 bytes, and there is a third more of them than squares. Each has the least
 * code in it, so that a search stops at what cannot be less than what it knows, or lies within what it was asked
 * for.
 *
 * Which squares exist. Those that blocks exist for: the north-west corner is before the last column and the last
 * row (in a raster of one column or row: the first). Every sample lies in the closed square of one: what a square
 * further out has in common with the raster is on its west or north side, and so on a side of the one before it.
 * What does not exist asks for nothing. */
#include "field.h"

#include <math.h>

enum { ABSENT, LEAF, SPLIT };

#define NOWHERE 1 /* the node of all that is outside the root */

typedef struct node {
    uint32_t first;   /* SPLIT: of four */
    uint32_t squares; /* that are left in it */
    rqt_code least;   /* of their codes; RQT_CODE_INFINITY: nothing is asked for */
    uint8_t kind;
} node;

struct rqt_field {
    rqt_lattice lattice;
    rqt_allocator allocator;
    node *nodes; /* the root, NOWHERE, families */
    size_t count, capacity;
};

static rqt_square root_of(const rqt_field *field) {
    return (rqt_square){0, 0, 1 << field->lattice.K};
}

static rqt_square quarter(rqt_square s, int c) {
    const int32_t half = s.side / 2;
    return (rqt_square){s.x + (c & 1 ? half : 0), s.y + (c & 2 ? half : 0), half};
}

/* ----------------------------------------------------------------------------------------------- making -- */

typedef struct making {
    rqt_field *field;
    rqt_field_decide *decide;
    void *context;
} making;

static bool exists(const rqt_lattice *lattice, rqt_square s) {
    return (s.x == 0 || s.x < lattice->width - 1) && (s.y == 0 || s.y < lattice->height - 1);
}

static rqt_status make_node(making *m, size_t at, rqt_square s) {
    rqt_field *field = m->field;
    double eps = NAN;
    const rqt_field_step step = m->decide(m->context, s, &eps);
    if (step == RQT_FIELD_FAIL) return RQT_READ_FAILED;
    if (step == RQT_FIELD_LEAF) {
        if (!(eps >= 0)) return RQT_INVALID;
        const rqt_code code = isinf(eps) ? RQT_CODE_INFINITY : rqt_code_floor(eps);
        field->nodes[at] = (node){.squares = 1, .least = code, .kind = LEAF};
        return RQT_OK;
    }
    if (step != RQT_FIELD_SPLIT || s.side == 1) return RQT_INVALID;
    const size_t first = field->count;
    if (first > UINT32_MAX - 4 ||
        !memory_grow(&field->allocator, (void **)&field->nodes, &field->capacity, first + 4, sizeof *field->nodes))
        return RQT_NO_MEMORY;
    field->count += 4;
    for (size_t c = 0; c < 4; c++) field->nodes[first + c] = (node){.least = RQT_CODE_INFINITY, .kind = ABSENT};
    node whole = {.first = (uint32_t)first, .least = RQT_CODE_INFINITY, .kind = SPLIT};
    for (int c = 0; c < 4; c++) {
        const rqt_square part = quarter(s, c);
        if (!exists(&field->lattice, part)) continue;
        const rqt_status status = make_node(m, first + (size_t)c, part);
        if (status != RQT_OK) return status;
        const node *made = &field->nodes[first + (size_t)c];
        whole.squares += made->squares;
        if (made->least < whole.least) whole.least = made->least;
    }
    field->nodes[at] = whole;
    return RQT_OK;
}

rqt_status rqt_field_create(const rqt_lattice *lattice, const rqt_allocator *allocator, rqt_field_decide *decide,
                            void *context, rqt_field **field) {
    *field = NULL;
    rqt_field *f = memory_take(allocator, sizeof *f);
    if (!f) return RQT_NO_MEMORY;
    *f = (rqt_field){.lattice = *lattice, .allocator = *allocator, .count = 2};
    making m = {f, decide, context};
    rqt_status status = RQT_NO_MEMORY;
    if (memory_grow(allocator, (void **)&f->nodes, &f->capacity, f->count, sizeof *f->nodes)) {
        f->nodes[NOWHERE] = (node){.least = RQT_CODE_INFINITY, .kind = ABSENT};
        status = make_node(&m, 0, root_of(f));
    }
    if (status == RQT_OK)
        *field = f;
    else
        rqt_field_free(f);
    return status;
}

void rqt_field_free(rqt_field *field) {
    if (!field) return;
    const rqt_allocator allocator = field->allocator;
    memory_drop(&allocator, field->nodes);
    memory_drop(&allocator, field);
}

/* ---------------------------------------------------------------------------------------------- squares -- */

size_t rqt_field_count(const rqt_field *field) {
    return field->nodes[0].squares;
}

bool rqt_field_square(const rqt_field *field, size_t n, rqt_square *square, double *eps) {
    const node *at = &field->nodes[0];
    rqt_square s = root_of(field);
    if (n >= at->squares) return false;
    while (at->kind == SPLIT) {
        int c = 0;
        const node *child = &field->nodes[at->first];
        for (; n >= child->squares; c++, child++) n -= child->squares;
        at = child;
        s = quarter(s, c);
    }
    *square = s;
    *eps = rqt_code_metres(at->least);
    return true;
}

/* ---------------------------------------------------------------------------------------------- asking -- */

bool field_is_over(const rqt_field *field, const rqt_lattice *lattice) {
    return field->lattice.width == lattice->width && field->lattice.height == lattice->height;
}

typedef struct open_box {
    int32_t x0, y0, x1, y1;
} open_box;

static inline bool square_meets(rqt_square s, const open_box *box) {
    return s.x < box->x1 && s.x + s.side > box->x0 && s.y < box->y1 && s.y + s.side > box->y0;
}

static rqt_code least_in(const rqt_field *field, const node *n, rqt_square s, const open_box *box, rqt_code least) {
    if (n->least >= least || !square_meets(s, box)) return least;
    if (n->kind == LEAF || (s.x >= box->x0 && s.x + s.side <= box->x1 && s.y >= box->y0 && s.y + s.side <= box->y1))
        return n->least;
    for (int c = 0; c < 4; c++)
        least = least_in(field, &field->nodes[n->first + (uint32_t)c], quarter(s, c), box, least);
    return least;
}

rqt_code field_least(const rqt_field *field, int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
    if (x0 >= x1 || y0 >= y1) return RQT_CODE_INFINITY;
    const open_box box = {x0, y0, x1, y1};
    return least_in(field, &field->nodes[0], root_of(field), &box, RQT_CODE_INFINITY);
}

double rqt_field_least(const rqt_field *field, int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
    return rqt_code_metres(field_least(field, x0, y0, x1, y1));
}

rqt_code field_holding(const rqt_field *field, int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
    const node *n = &field->nodes[0];
    rqt_square s = root_of(field);
    for (;;) {
        if (x0 < s.x || y0 < s.y || x1 > s.x + s.side || y1 > s.y + s.side) return RQT_CODE_INFINITY;
        if (n->kind != SPLIT) return n->least;
        const int c = (x0 >= s.x + s.side / 2) | (y0 >= s.y + s.side / 2) << 1;
        n = &field->nodes[n->first + (uint32_t)c];
        s = quarter(s, c);
    }
}

/* ---------------------------------------------------------------------------------------------- looking -- */

field_node field_node_at(const rqt_field *field, int32_t x, int32_t y, int32_t side) {
    const int32_t end = 1 << field->lattice.K;
    if (x < 0 || y < 0 || x >= end || y >= end) return NOWHERE;
    field_node at = 0;
    for (int32_t half = end / 2; half >= side && field->nodes[at].kind == SPLIT; half /= 2)
        at = field->nodes[at].first + (uint32_t)((x & half) != 0) + 2 * (uint32_t)((y & half) != 0);
    return at;
}

rqt_code field_node_least(const rqt_field *field, field_node at) {
    return field->nodes[at].least;
}

bool field_are_leaves(const rqt_field *field, const field_node nine[9], rqt_code codes[9]) {
    bool cut = false;
    for (int i = 0; i < 9; i++) {
        const node *n = &field->nodes[nine[i]];
        cut |= n->kind == SPLIT;
        codes[i] = n->least;
    }
    return !cut;
}

/* The quarter c of a square that is cut, else the square. */
static inline field_node part_of(const node *nodes, field_node at, int c) {
    return nodes[at].kind == SPLIT ? nodes[at].first + (uint32_t)c : at;
}

void field_halve(const rqt_field *field, const field_node nine[9], rqt_code least[6][6]) {
    const node *const nodes = field->nodes;
    for (int v = 0; v < 3; v++)
        for (int u = 0; u < 3; u++) {
            const field_node at = nine[3 * v + u];
            for (int c = 0; c < 4; c++)
                least[2 * u + (c & 1)][2 * v + (c >> 1)] = nodes[part_of(nodes, at, c)].least;
        }
}

void field_around_quarter(const rqt_field *field, const field_node nine[9], int c, field_node around[9]) {
    for (int j = 0; j < 9; j++) {
        const int v = 1 + (c >> 1) + j / 3, u = 1 + (c & 1) + j % 3; /* of the six by six */
        around[j] = part_of(field->nodes, nine[v / 2 * 3 + u / 2], (u & 1) + 2 * (v & 1));
    }
}
