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
 * What does not exist asks for nothing.
 *
 * An eps is kept as a float, rounded down, which is more than a code can tell apart. */
#include "field.h"

#include <math.h>

enum { ABSENT, LEAF, SPLIT };

typedef struct node {
    union {
        float eps;      /* LEAF: as it was told */
        uint32_t first; /* SPLIT: of four */
    };
    uint32_t squares; /* that are left in it */
    rqt_code least;   /* of their codes; RQT_CODE_INFINITY: nothing is asked for */
    uint8_t kind;
} node;

struct rqt_field {
    rqt_lattice lattice;
    rqt_allocator allocator;
    node *nodes; /* the root first */
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

/* The largest float that is not above eps >= 0. */
static float float_below(double eps) {
    float f = (float)eps;
    if ((double)f > eps) { /* so it is above 0: the float before has the bits before */
        uint32_t bits;
        memcpy(&bits, &f, sizeof bits);
        bits--;
        memcpy(&f, &bits, sizeof f);
    }
    return f;
}

static rqt_status make_node(making *m, size_t at, rqt_square s) {
    rqt_field *field = m->field;
    double eps = NAN;
    const rqt_field_step step = m->decide(m->context, s, &eps);
    if (step == RQT_FIELD_FAIL) return RQT_READ_FAILED;
    if (step == RQT_FIELD_LEAF) {
        if (!(eps >= 0)) return RQT_INVALID;
        field->nodes[at] = (node){.eps = float_below(eps), .squares = 1, .kind = LEAF};
        return RQT_OK;
    }
    if (step != RQT_FIELD_SPLIT || s.side == 1) return RQT_INVALID;
    const size_t first = field->count;
    if (first > UINT32_MAX - 4 ||
        !memory_grow(&field->allocator, (void **)&field->nodes, &field->capacity, first + 4, sizeof *field->nodes))
        return RQT_NO_MEMORY;
    field->count += 4;
    memset(&field->nodes[first], 0, 4 * sizeof *field->nodes);
    uint32_t squares = 0;
    for (int c = 0; c < 4; c++) {
        const rqt_square part = quarter(s, c);
        if (!exists(&field->lattice, part)) continue;
        const rqt_status status = make_node(m, first + (size_t)c, part);
        if (status != RQT_OK) return status;
        squares += field->nodes[first + (size_t)c].squares;
    }
    field->nodes[at] = (node){.first = (uint32_t)first, .squares = squares, .kind = SPLIT};
    return RQT_OK;
}

rqt_status rqt_field_create(const rqt_lattice *lattice, const rqt_allocator *allocator, rqt_field_decide *decide,
                            void *context, rqt_field **field) {
    *field = NULL;
    rqt_field *f = memory_take(allocator, sizeof *f);
    if (!f) return RQT_NO_MEMORY;
    *f = (rqt_field){.lattice = *lattice, .allocator = *allocator, .count = 1};
    making m = {f, decide, context};
    rqt_status status = RQT_NO_MEMORY;
    if (memory_grow(allocator, (void **)&f->nodes, &f->capacity, 1, sizeof *f->nodes))
        status = make_node(&m, 0, root_of(f));
    if (status == RQT_OK) status = rqt_field_scale(f, 1);
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

/* A float times a double, rounded down: by 26 bits of the factor and the other 27, which are exact each. What the
 * sum of the two rounds away is recovered. */
static double product_below(float eps, double factor) {
    uint64_t bits;
    memcpy(&bits, &factor, sizeof bits);
    const double high = bits_double(bits & ~((UINT64_C(1) << 27) - 1)), low = factor - high;
    const double one = (double)eps * high, other = (double)eps * low, sum = one + other;
    return (one - sum) + other < 0 ? nextafter(sum, 0) : sum;
}

rqt_status rqt_field_scale(rqt_field *field, double factor) {
    if (!(factor > 0) || !isfinite(factor)) return RQT_INVALID;
    for (size_t at = field->count; at-- > 0;) {
        node *n = &field->nodes[at];
        n->least = RQT_CODE_INFINITY;
        if (n->kind == LEAF && !isinf(n->eps)) n->least = rqt_code_floor(product_below(n->eps, factor));
        for (int c = 0; n->kind == SPLIT && c < 4; c++) {
            const rqt_code code = field->nodes[n->first + (uint32_t)c].least;
            if (code < n->least) n->least = code;
        }
    }
    return RQT_OK;
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

typedef struct painting {
    const rqt_field *field;
    const field_cells *cells;
    uint16_t (*value)(const void *context, rqt_code code);
    const void *context;
    uint16_t *painted;
    open_box box; /* of all cells */
} painting;

/* n values of the same, row by row. The rows are short: two cells, or a power of two. */
static inline __attribute__((always_inline)) void fill(uint16_t *row, int32_t n, uint16_t value) {
    const uint64_t four = value * UINT64_C(0x0001000100010001);
    const uint64_t many[4] = {four, four, four, four};
    for (; n >= 16; n -= 16, row += 16) memcpy(row, many, sizeof many);
    for (; n >= 4; n -= 4, row += 4) memcpy(row, &four, sizeof four);
    for (; n > 0; n--) *row++ = value;
}

static void paint_node(const painting *p, const node *n, rqt_square s) {
    const open_box *box = &p->box;
    const int scale = p->cells->scale;
    if (n->kind == SPLIT && s.side >> scale > 1) {
        for (int c = 0; c < 4; c++) {
            const node *child = &p->field->nodes[n->first + (uint32_t)c];
            const rqt_square part = quarter(s, c);
            if (child->least != RQT_CODE_INFINITY && square_meets(part, box)) paint_node(p, child, part);
        }
        return;
    }
    /* Whole cells: all sides are powers of two, and what is smaller than a cell is not come to. */
    const int32_t left = s.x > box->x0 ? (s.x - box->x0) >> scale : 0,
                  top = s.y > box->y0 ? (s.y - box->y0) >> scale : 0;
    const int32_t right = s.x + s.side < box->x1 ? (s.x + s.side - box->x0) >> scale : p->cells->n,
                  bottom = s.y + s.side < box->y1 ? (s.y + s.side - box->y0) >> scale : p->cells->n;
    const uint16_t value = p->value(p->context, n->least);
    for (int32_t y = top; y < bottom; y++)
        fill(p->painted + (size_t)y * (size_t)p->cells->n + left, right - left, value);
}

void field_paint(const rqt_field *field, const field_cells *cells,
                 uint16_t (*value)(const void *context, rqt_code code), const void *context, uint16_t *painted) {
    const int32_t across = cells->n << cells->scale;
    const painting p = {field,   cells,   value,
                        context, painted, {cells->x, cells->y, cells->x + across, cells->y + across}};
    const uint16_t nothing = value(context, RQT_CODE_INFINITY);
    fill(painted, cells->n * cells->n, nothing);
    if (field->nodes[0].least != RQT_CODE_INFINITY) paint_node(&p, &field->nodes[0], root_of(field));
}
