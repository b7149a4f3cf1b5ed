/* cut.c - mode `cut`: the triangles of a patch clipped to a region.
 *
 * Leaf by leaf. One that no piece of the region's border touches stays whole: it lies inside, or it would not be in
 * the patch. Any other becomes a small triangulation of its own (cut_faces.c) in which the pieces that pass through
 * it are unions of edges. Faces that no border parts are held by the region together or not at all: an inner point
 * of the largest of them is asked. That is all: faces never overlap and share whole edges, so whichever of them are
 * taken, the mesh has neither overlaps nor T-junctions, and a region's holes, bow-ties and overlapping members need
 * no thought.
 *
 * Between leaves. A point on a leaf's side belongs to the neighbour too, which may not be crossed otherwise. So the
 * place where a piece meets a side depends on the piece and the side alone, the side taken from its lesser end:
 * both leaves compute it, touched by the same piece, and get the same; equal places are one vertex. The place is
 * rounded once, along the side, to where it lies on the side exactly and on the grid (cut.h): on sides along an
 * axis or a diagonal to the nearest unit, on the oblique ones that exist where the raster's end clamps leaves to
 * the nearest 2^-G of the side. A piece's end is on the grid as it is. Heights on a side come from its two ends,
 * lesser first; inside, from the leaf's plane.
 *
 * The area is the region's within the leaves, up to that rounding: half a unit per place, where a unit is the
 * spacing of doubles at the far end of the terrain.
 *
 * Many leaves in a row are far from any border. So a square without border is remembered while leaves stay in it,
 * as large as it can be found by doubling.
 */
#include "cut.h"

#define NO_VERTEX UINT32_MAX
#define INSIDE 3

typedef struct kept_place {
    region_point place;
    uint32_t vertex; /* NO_VERTEX: free */
} kept_place;

/* The ends of what the leaf has of a piece; count < 2: nothing that could divide it. */
typedef struct passage {
    uint32_t point[8];
    int count;
} passage;

typedef struct cutting {
    const rqt_patch *patch;
    const rqt_region *region;
    const rqt_allocator *allocator;
    rqt_cut *cut;
    int grid;         /* bits of the grid below a sample */
    uint32_t *vertex; /* by vertex of the patch: its number in the cut, or NO_VERTEX */
    region_box clear; /* no border touches it */
    cut_faces faces;
    uint8_t *sides;    /* by point: the side of the leaf that it lies on; INSIDE: none */
    uint32_t *numbers; /* by point: its vertex, NO_VERTEX: not yet asked for */
    size_t side_count, side_capacity, number_capacity;
    bool *held;     /* by face: the region holds it */
    uint32_t *part; /* faces that no border parts */
    size_t held_capacity, part_capacity;
    region_pieces near; /* pieces that touch the leaf */
    passage *ways;      /* of each of them through the leaf */
    size_t way_capacity;
    bool (*is_interrupted)(void *context);
    void *context;
    bool stopped;
    kept_place *places;
    size_t place_count, place_size; /* a power of two */
} cutting;

/* The leaf at hand. */
typedef struct leaf {
    uint32_t corner[3]; /* of the patch, so that region_side is above 0: clockwise from above */
    region_triangle shape;
    region_point at[3]; /* on the grid */
} leaf;

/* --------------------------------------------------------------------------------------------- vertices */

static bool add_vertex(cutting *c, rqt_cut_vertex vertex, uint32_t *number) {
    rqt_cut *cut = c->cut;
    if (cut->vertex_count >= INT32_MAX || !memory_grow(c->allocator, (void **)&cut->vertices, &cut->vertex_capacity,
                                                       cut->vertex_count + 1, sizeof vertex))
        return false;
    *number = (uint32_t)cut->vertex_count;
    cut->vertices[cut->vertex_count++] = vertex;
    return true;
}

static bool take_corner(cutting *c, uint32_t corner, uint32_t *number) {
    if (c->vertex[corner] == NO_VERTEX) {
        const rqt_patch_vertex *v = &c->patch->vertices[corner];
        const rqt_cut_vertex copy = {v->col, v->row, v->q, v->error, v->level};
        if (!add_vertex(c, copy, &c->vertex[corner])) return false;
    }
    *number = c->vertex[corner];
    return true;
}

static kept_place *find_place(kept_place *places, size_t size, region_point p) {
    uint64_t h = ((uint64_t)p.x * UINT64_C(0x9E3779B97F4A7C15)) ^ (uint64_t)p.y;
    h *= UINT64_C(0xBF58476D1CE4E5B9);
    h >>= __builtin_clzll(size) + 1; /* the topmost bits: those below know nothing of whole samples */
    for (size_t slot = (size_t)h;; slot = (slot + 1) & (size - 1)) {
        kept_place *k = &places[slot];
        if (k->vertex == NO_VERTEX || (k->place.x == p.x && k->place.y == p.y)) return k;
    }
}

static bool grow_places(cutting *c) {
    const size_t size = c->place_size ? 2 * c->place_size : 1024;
    kept_place *places = memory_take(c->allocator, size * sizeof *places);
    if (!places) return false;
    for (size_t i = 0; i < size; i++) places[i].vertex = NO_VERTEX;
    for (size_t i = 0; i < c->place_size; i++)
        if (c->places[i].vertex != NO_VERTEX) *find_place(places, size, c->places[i].place) = c->places[i];
    memory_drop(c->allocator, c->places);
    c->places = places;
    c->place_size = size;
    return true;
}

static double samples_of(const cutting *c, int64_t units) {
    return (double)units / (double)(INT64_C(1) << c->grid);
}

static bool comes_before(const rqt_patch_vertex *a, const rqt_patch_vertex *b) {
    return a->row != b->row ? a->row < b->row : a->col < b->col;
}

/* The height of a place on the side between two samples. */
static double height_on_side(const rqt_patch_vertex *u, const rqt_patch_vertex *v, double col, double row) {
    if (comes_before(v, u)) {
        const rqt_patch_vertex *swap = u;
        u = v;
        v = swap;
    }
    const double across = v->col - u->col, down = v->row - u->row;
    const bool level = (across < 0 ? -across : across) > down;
    const double share = level ? (col - u->col) / across : (row - u->row) / down;
    return u->q + share * ((double)v->q - u->q);
}

/* ... and in the leaf, by areas. */
static double height_inside(const cutting *c, const leaf *l, region_point p) {
    const rqt_patch_vertex *v[3];
    for (int i = 0; i < 3; i++) v[i] = &c->patch->vertices[l->corner[i]];
    const double whole = (double)region_side(l->at[0], l->at[1], l->at[2]);
    const double one = (double)region_side(l->at[0], p, l->at[2]), two = (double)region_side(l->at[0], l->at[1], p);
    return v[0]->q + (one * ((double)v[1]->q - v[0]->q) + two * ((double)v[2]->q - v[0]->q)) / whole;
}

/* The vertex of a point of the leaf at hand. */
static bool take_point(cutting *c, const leaf *l, uint32_t point, uint32_t *number) {
    if (point < 3) return take_corner(c, l->corner[point], number);
    if (c->numbers[point] != NO_VERTEX) {
        *number = c->numbers[point];
        return true;
    }
    const region_point p = c->faces.points[point];
    const int side = c->sides[point];
    if (2 * (c->place_count + 1) > c->place_size && !grow_places(c)) return false;
    kept_place *kept = find_place(c->places, c->place_size, p);
    if (kept->vertex == NO_VERTEX) {
        rqt_cut_vertex vertex = {.col = samples_of(c, p.x), .row = samples_of(c, p.y), .level = -1};
        vertex.q = side == INSIDE
                       ? height_inside(c, l, p)
                       : height_on_side(&c->patch->vertices[l->corner[side]],
                                        &c->patch->vertices[l->corner[(side + 1) % 3]], vertex.col, vertex.row);
        if (!add_vertex(c, vertex, &kept->vertex)) return false;
        kept->place = p;
        c->place_count++;
    }
    *number = c->numbers[point] = kept->vertex;
    return true;
}

static bool add_triangle(cutting *c, uint32_t p, uint32_t q, uint32_t r) {
    rqt_cut *cut = c->cut;
    if (!memory_grow(c->allocator, (void **)&cut->triangles, &cut->triangle_capacity, cut->triangle_count + 1,
                     3 * sizeof *cut->triangles))
        return false;
    const uint32_t triangle[3] = {p, q, r};
    memcpy(cut->triangles + 3 * cut->triangle_count++, triangle, sizeof triangle);
    return true;
}

static bool keep_whole(cutting *c, const uint32_t triangle[3]) {
    uint32_t number[3];
    for (int i = 0; i < 3; i++)
        if (!take_corner(c, triangle[i], &number[i])) return false;
    return add_triangle(c, number[0], number[1], number[2]);
}

/* ------------------------------------------------------------------------------------- border and leaf */

static bool is_touched_by_border(const cutting *c, const region_box *box) {
    region_border_search s;
    region_piece piece;
    region_border_begin(&s, c->region, box);
    while (region_border_next(&s, &piece))
        if (region_box_is_touched(box, &piece)) return true;
    return false;
}

/* The aligned square of that many samples that holds the box; false when there is none. */
static bool square_around(const region_box *box, int bits, region_box *square) {
    const int64_t side = REGION_UNIT << bits;
    square->x0 = box->x0 / side * side; /* boxes of leaves have no negative coordinates */
    square->y0 = box->y0 / side * side;
    square->x1 = square->x0 + side;
    square->y1 = square->y0 + side;
    return box->x1 <= square->x1 && box->y1 <= square->y1;
}

/* Is the box free of borders? Remembers the largest square around it that is. */
static bool is_clear(cutting *c, const region_box *box) {
    if (region_box_is_within(box, &c->clear)) return true;
    bool found = false;
    for (int bits = 0; bits <= RQT_MAX_K; bits++) {
        region_box square;
        if (!square_around(box, bits, &square)) continue;
        if (is_touched_by_border(c, &square)) break;
        c->clear = square;
        found = true;
    }
    return found;
}

static region_point grid_point(const cutting *c, region_point p) {
    const int64_t scale = INT64_C(1) << (c->grid - 20);
    return (region_point){p.x * scale, p.y * scale};
}

/* Where a piece meets the side between two samples, u the lesser: at most two points (when it runs along the side,
 * its ends; ends of the side are corners and need no mention). */
static int meet_side(const cutting *c, const region_piece *piece, rqt_vertex u, rqt_vertex v, region_point at[2]) {
    const region_point p = {u.x * REGION_UNIT, u.y * REGION_UNIT}, q = {v.x * REGION_UNIT, v.y * REGION_UNIT};
    const __int128 a = region_side(p, q, piece->a), b = region_side(p, q, piece->b);
    if ((a > 0 && b > 0) || (a < 0 && b < 0)) return 0;
    const region_piece edge = {p, q};
    const region_box box = region_piece_box(&edge);
    int n = 0;
    if (a == 0 || b == 0) { /* ends on the side's line are on the grid as they are */
        const region_point *end[2] = {&piece->a, &piece->b};
        for (int i = 0; i < 2; i++) {
            if ((i ? b : a) != 0) continue;
            if (end[i]->x < box.x0 || end[i]->x > box.x1 || end[i]->y < box.y0 || end[i]->y > box.y1) continue;
            at[n++] = grid_point(c, *end[i]);
        }
        return n;
    }
    __int128 from = region_side(piece->a, piece->b, p), to = region_side(piece->a, piece->b, q);
    if ((from > 0 && to > 0) || (from < 0 && to < 0)) return 0;
    if (from < 0) from = -from;
    if (to < 0) to = -to;
    const int64_t across = v.x - u.x, down = v.y - u.y, wide = across < 0 ? -across : across,
                  high = down < 0 ? -down : down;
    const int64_t longer = wide > high ? wide : high, step = wide == 0 || high == 0 || wide == high ? longer : 1;
    /* `step` is how much finer than 2^-G of the side the grid is along it */
    const int64_t share = (int64_t)cut_share((uint64_t)step << c->grid, from, from + to);
    /* A side has a length. NOLINTNEXTLINE(clang-analyzer-core.DivideZero) */
    at[0] = (region_point){((int64_t)u.x << c->grid) + across / step * share,
                           ((int64_t)u.y << c->grid) + down / step * share};
    return 1;
}

/* Points that are there and that nobody has placed: crossings, which are inside. */
static bool note_points(cutting *c) {
    const size_t n = c->faces.point_count;
    if (!memory_grow(c->allocator, (void **)&c->sides, &c->side_capacity, n, sizeof *c->sides)) return false;
    while (c->side_count < n) c->sides[c->side_count++] = INSIDE;
    return true;
}

/* A new point of the leaf, or the one that is there. */
static bool add_point(cutting *c, region_point place, int side, uint32_t *point) {
    const size_t before = c->faces.point_count;
    if (!cut_faces_add(&c->faces, place, point)) return false;
    if (c->faces.point_count == before) return true;
    if (!note_points(c)) return false;
    c->sides[*point] = (uint8_t)side;
    return true;
}

static bool add_side_points(cutting *c, const leaf *l, const region_piece *piece, passage *way) {
    for (int i = 0; i < 3; i++) {
        const rqt_patch_vertex *from = &c->patch->vertices[l->corner[i]],
                               *to = &c->patch->vertices[l->corner[(i + 1) % 3]];
        if (comes_before(to, from)) {
            const rqt_patch_vertex *swap = from;
            from = to;
            to = swap;
        }
        region_point at[2];
        const int n = meet_side(c, piece, (rqt_vertex){from->col, from->row}, (rqt_vertex){to->col, to->row}, at);
        for (int k = 0; k < n; k++)
            if (!add_point(c, at[k], i, &way->point[way->count++])) return false;
    }
    return true;
}

static bool is_inside_leaf(const leaf *l, region_point p) {
    for (int i = 0; i < 3; i++)
        if (region_side(l->shape.corner[i], l->shape.corner[(i + 1) % 3], p) <= 0) return false;
    return true;
}

static bool add_inner_end(cutting *c, const leaf *l, region_point end, passage *way) {
    return !is_inside_leaf(l, end) || add_point(c, grid_point(c, end), INSIDE, &way->point[way->count++]);
}

/* The first and the last of the points along a piece. */
static void order_passage(const cutting *c, const region_piece *piece, passage *way) {
    const int64_t dx = piece->b.x - piece->a.x, dy = piece->b.y - piece->a.y;
    const bool by_x = (dx < 0 ? -dx : dx) > (dy < 0 ? -dy : dy);
    for (int i = 1; i < way->count; i++) {
        const uint32_t point = way->point[i];
        const region_point *p = &c->faces.points[point];
        int k = i;
        for (; k > 0; k--) {
            const region_point *q = &c->faces.points[way->point[k - 1]];
            if (by_x ? q->x <= p->x : q->y <= p->y) break;
            way->point[k] = way->point[k - 1];
        }
        way->point[k] = point;
    }
}

/* Now and then, where a leaf takes long. */
static bool goes_on(cutting *c, size_t step) {
    if (step % 1024 == 1023 && c->is_interrupted && c->is_interrupted(c->context)) c->stopped = true;
    return !c->stopped;
}

/* Points first, of all pieces, then the edges between them: a side of the leaf is whole while it gets its points.
 */
static bool divide(cutting *c, const leaf *l) {
    if (!cut_faces_begin(&c->faces, l->at) ||
        !memory_grow(c->allocator, (void **)&c->ways, &c->way_capacity, c->near.count, sizeof *c->ways))
        return false;
    c->side_count = 0;
    for (size_t i = 0; i < c->near.count; i++) {
        c->ways[i].count = 0;
        if (!goes_on(c, i) || !add_side_points(c, l, &c->near.items[i], &c->ways[i])) return false;
    }
    for (size_t i = 0; i < c->near.count; i++) {
        const region_piece *piece = &c->near.items[i];
        passage *way = &c->ways[i];
        if (!goes_on(c, i) || !add_inner_end(c, l, piece->a, way) || !add_inner_end(c, l, piece->b, way))
            return false;
        order_passage(c, piece, way);
        if (way->count >= 2 && !cut_faces_fix(&c->faces, way->point[0], way->point[way->count - 1])) return false;
    }
    return note_points(c);
}

static bool holds_face(const cutting *c, const cut_face *face) {
    const region_point *p = &c->faces.points[face->corner[0]], *q = &c->faces.points[face->corner[1]],
                       *r = &c->faces.points[face->corner[2]];
    const int64_t x = 2 * p->x + q->x + r->x, y = 2 * p->y + q->y + r->y; /* of a quarter of a unit */
    const int bits = c->grid + 2 - 20;
    const int64_t mask = (INT64_C(1) << bits) - 1;
    const region_fine_point inner = {{x >> bits, y >> bits}, x & mask, y & mask, bits};
    return region_holds(c->region, &inner);
}

static double area_of(const cutting *c, uint32_t face) {
    const uint32_t *corner = c->faces.faces[face].corner;
    const region_point *p = c->faces.points;
    return (double)region_side(p[corner[0]], p[corner[1]], p[corner[2]]);
}

/* From one face over edges without a border to all that are held together. Rounding has moved borders by a unit or
 * so: the largest face knows best. */
static void ask_part(cutting *c, uint32_t first) {
    const uint32_t stamp = c->faces.mark;
    cut_face *faces = c->faces.faces;
    size_t count = 0;
    uint32_t largest = first;
    double most = area_of(c, first);
    faces[first].mark = stamp;
    c->part[count++] = first;
    for (size_t n = 0; n < count; n++) {
        const cut_face *t = &faces[c->part[n]];
        const double area = area_of(c, c->part[n]);
        if (area > most) {
            most = area;
            largest = c->part[n];
        }
        if (!c->faces.is_sound) break; /* a border is not an edge everywhere: each face for itself */
        for (int i = 0; i < 3; i++) {
            const uint32_t next = t->next[i];
            if (t->fixed[i] || next == CUT_NO_FACE || faces[next].mark == stamp) continue;
            faces[next].mark = stamp;
            c->part[count++] = next;
        }
    }
    const bool held = holds_face(c, &faces[largest]);
    for (size_t n = 0; n < count; n++) c->held[c->part[n]] = held;
}

/* Which faces the region holds. */
static bool ask_faces(cutting *c, const leaf *l) {
    const size_t n = c->faces.face_count;
    if (!memory_grow(c->allocator, (void **)&c->held, &c->held_capacity, n, sizeof *c->held) ||
        !memory_grow(c->allocator, (void **)&c->part, &c->part_capacity, n, sizeof *c->part))
        return false;
    const bool all = region_thin_touches(c->region, &l->shape);
    c->faces.mark++;
    for (uint32_t i = 0; i < n; i++) {
        if (!goes_on(c, i)) return false;
        if (all)
            c->held[i] = true;
        else if (c->faces.faces[i].mark != c->faces.mark)
            ask_part(c, i);
    }
    return true;
}

static bool cut_leaf(cutting *c, const leaf *l) {
    if (!divide(c, l) || !ask_faces(c, l)) return false;
    const size_t n = c->faces.point_count;
    if (!memory_grow(c->allocator, (void **)&c->numbers, &c->number_capacity, n, sizeof *c->numbers)) return false;
    for (size_t i = 0; i < n; i++) c->numbers[i] = NO_VERTEX;
    for (size_t i = 0; i < c->faces.face_count; i++) {
        const cut_face *face = &c->faces.faces[i];
        if (!c->held[i]) continue;
        uint32_t p, q, r; /* in the order of their use: so vertices are numbered */
        if (!take_point(c, l, face->corner[0], &p) || !take_point(c, l, face->corner[2], &q) ||
            !take_point(c, l, face->corner[1], &r) || !add_triangle(c, p, q, r))
            return false;
    }
    return true;
}

/* The pieces that touch the closed leaf. */
static bool find_pieces(cutting *c, const region_triangle *shape) {
    region_border_search s;
    region_piece piece;
    c->near.count = 0;
    region_border_begin(&s, c->region, &shape->box);
    while (region_border_next(&s, &piece))
        if (region_triangle_is_touched(shape, &piece) && !region_pieces_add(&c->near, piece, c->allocator))
            return false;
    return true;
}

static bool cut_triangle(cutting *c, const uint32_t triangle[3]) {
    leaf l = {.corner = {triangle[0], triangle[2], triangle[1]}};
    rqt_vertex at[3];
    region_box box = {INT64_MAX, INT64_MAX, 0, 0};
    for (int i = 0; i < 3; i++) {
        const rqt_patch_vertex *v = &c->patch->vertices[l.corner[i]];
        const region_point p = {v->col * REGION_UNIT, v->row * REGION_UNIT};
        at[i] = (rqt_vertex){v->col, v->row};
        region_box_add(&box, &(region_box){p.x, p.y, p.x, p.y});
    }
    if (is_clear(c, &box)) return keep_whole(c, triangle);
    if (!region_triangle_init(&l.shape, at[0], at[1], at[2])) return true; /* leaves have an area */
    if (!find_pieces(c, &l.shape)) return false;
    if (c->near.count == 0) return keep_whole(c, triangle);
    for (int i = 0; i < 3; i++) l.at[i] = (region_point){(int64_t)at[i].x << c->grid, (int64_t)at[i].y << c->grid};
    return cut_leaf(c, &l);
}

/* ------------------------------------------------------------------------------------------------ whole */

void rqt_cut_free(rqt_cut *cut) {
    if (!cut->allocator.resize) return;
    const rqt_allocator a = cut->allocator;
    memory_drop(&a, cut->vertices);
    memory_drop(&a, cut->triangles);
    memset(cut, 0, sizeof *cut);
}

rqt_status rqt_cut_make(const rqt_patch *patch, const rqt_region *region, const rqt_lattice *lattice,
                        const rqt_allocator *allocator, bool (*is_interrupted)(void *context), void *context,
                        rqt_cut *cut) {
    *cut = (rqt_cut){.allocator = *allocator};
    if (!region_has_border(region)) return RQT_INVALID;
    if (patch->triangle_count == 0) return RQT_OK;
    cutting c = {.patch = patch,
                 .region = region,
                 .allocator = allocator,
                 .cut = cut,
                 .grid = CUT_GRID_BITS(lattice->K),
                 .vertex = memory_take(allocator, patch->vertex_count * sizeof *c.vertex),
                 .clear = {1, 1, 0, 0},
                 .faces = {.allocator = *allocator},
                 .is_interrupted = is_interrupted,
                 .context = context};
    /* Most leaves stay as they are: room for all of them at once. */
    const bool room = c.vertex &&
                      memory_grow(allocator, (void **)&cut->vertices, &cut->vertex_capacity, patch->vertex_count,
                                  sizeof *cut->vertices) &&
                      memory_grow(allocator, (void **)&cut->triangles, &cut->triangle_capacity,
                                  patch->triangle_count, 3 * sizeof *cut->triangles);
    rqt_status status = room ? RQT_OK : RQT_NO_MEMORY;
    for (size_t i = 0; c.vertex && i < patch->vertex_count; i++) c.vertex[i] = NO_VERTEX;
    for (size_t t = 0; t < patch->triangle_count && status == RQT_OK; t++) {
        const uint32_t *triangle = patch->triangles + 3 * t;
        if (is_interrupted && t % 4096 == 0 && is_interrupted(context))
            status = RQT_INTERRUPTED;
        else if (!(rqt_region_is_all(region) ? keep_whole(&c, triangle) : cut_triangle(&c, triangle)))
            status = c.stopped ? RQT_INTERRUPTED : RQT_NO_MEMORY;
    }
    memory_drop(allocator, c.vertex);
    memory_drop(allocator, c.sides);
    memory_drop(allocator, c.numbers);
    memory_drop(allocator, c.held);
    memory_drop(allocator, c.part);
    memory_drop(allocator, c.near.items);
    memory_drop(allocator, c.ways);
    memory_drop(allocator, c.places);
    cut_faces_free(&c.faces);
    if (status != RQT_OK) rqt_cut_free(cut);
    return status;
}
