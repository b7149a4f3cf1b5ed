/* region.c - regions: a geometry in sample coordinates, and mode `cover`.
 *
 * Coordinates are rounded once, to the nearest 2^-20 sample. Without that, tiles that share a border in the
 * terrain's coordinates would overlap or part by one ulp after the division by the cell; after it, everything is
 * integer and exact, and whether a triangle belongs to a region depends on the two alone. So a region that is cut
 * into parts selects exactly what its parts do.
 *
 * A region is a union of two kinds of members. Thin ones are points and segments, all in one list: a closed
 * triangle belongs when it meets one. Polygons have the odd pieces of their border (region_edges.c): a triangle
 * belongs when a piece passes through its interior, or when none does and an inner point of it is inside. A polygon
 * that is an axis-parallel rectangle, what most queries ask for, is answered from its box.
 *
 * A polygon whose shell has no odd piece, rounded to a line or drawn back and forth, is thin. One whose shell is
 * sound but whose rings cancel altogether (a hole that covers all) is empty.
 *
 * Views make regions of squares instead (region_squares.c): the same questions without a border. Mode `cut` needs
 * one, and refuses them.
 *
 * Lists of more than a few pieces, and the list of polygons, have a tree over their boxes, all in one array. Pieces
 * keep the order of their rings, whose neighbours are near. A question costs O(log n + hits) for borders that do
 * not fold to and fro; nothing is written after rqt_region_create, so any number of threads may ask. */
#include "cut.h"
#include "geometry.h"
#include "region_squares.h"

#include <math.h>

typedef struct region_polygon {
    region_box box;
    bool is_box;         /* the polygon is its box; it has no pieces then */
    size_t first, count; /* pieces */
    size_t tree;         /* first node */
} region_polygon;

struct rqt_region {
    rqt_allocator allocator;
    bool all;
    int32_t width, height; /* of the raster */
    bool has_box;          /* anything is there */
    region_box box;
    region_pieces thin, border;
    region_polygon *polygons;
    size_t polygon_count, polygon_capacity;
    region_box *nodes; /* trees: of the polygons at 0, of the thin pieces at thin_tree, then of each polygon */
    size_t thin_tree;
    region_squares squares; /* then there is nothing else */
};

/* --------------------------------------------------------------------------------------------- compile -- */
/* What compiling one part after the other needs. */
typedef struct compiler {
    const rqt_geometry *geometry;
    rqt_placement placement;
    rqt_region *region;
    region_pieces edges; /* of the part at hand */
    region_work work;
} compiler;

static region_point place_point(const compiler *c, size_t point) {
    geometry_point p = c->geometry->points[point];
    const rqt_placement *at = &c->placement;
    return (region_point){region_units(p.x, at->x0, at->dx), region_units(p.y, at->y0, at->dy)};
}

/* The edges of a part's rings, from the first to before ring `end`. A lone point is an edge to itself. */
static bool take_edges(compiler *c, const geometry_part *part, size_t end) {
    c->edges.count = 0;
    for (size_t r = 0; r < end; r++) {
        const geometry_ring *ring = &c->geometry->rings[part->first + r];
        region_point last = place_point(c, ring->first);
        for (size_t i = ring->count > 1 ? 1 : 0; i < ring->count; i++) {
            region_point next = place_point(c, ring->first + i);
            if (!region_pieces_add(&c->edges, (region_piece){last, next}, &c->region->allocator)) return false;
            last = next;
        }
    }
    return true;
}

static bool add_thin(compiler *c) {
    rqt_region *region = c->region;
    size_t before = region->thin.count;
    for (size_t i = 0; i < c->edges.count; i++) {
        const region_piece *e = &c->edges.items[i];
        bool is_point = e->a.x == e->b.x && e->a.y == e->b.y;
        bool is_last = i + 1 == c->edges.count && region->thin.count == before; /* nothing but points: keep one */
        if ((!is_point || is_last) && !region_pieces_add(&region->thin, *e, &region->allocator)) return false;
    }
    return true;
}

static bool pieces_are_box(const region_piece *pieces, size_t count, const region_box *box) {
    if (count != 4) return false; /* pieces are as long as can be and all different: a rectangle has four */
    for (size_t i = 0; i < 4; i++) {
        region_box p = region_piece_box(&pieces[i]);
        bool across = p.y0 == p.y1 && p.x0 == box->x0 && p.x1 == box->x1 && (p.y0 == box->y0 || p.y0 == box->y1);
        bool down = p.x0 == p.x1 && p.y0 == box->y0 && p.y1 == box->y1 && (p.x0 == box->x0 || p.x0 == box->x1);
        if (!across && !down) return false;
    }
    return true;
}

static bool add_polygon(compiler *c, const geometry_part *part) {
    rqt_region *region = c->region;
    const rqt_allocator *a = &region->allocator;
    region_pieces *border = &region->border;
    region_polygon polygon = {.first = border->count};
    if (!take_edges(c, part, 1)) return false;
    if (!region_odd_pieces(c->edges.items, c->edges.count, &c->work, border, a)) return false;
    if (border->count == polygon.first) return add_thin(c);
    if (part->count > 1) { /* the shell has an area; now with its holes */
        border->count = polygon.first;
        if (!take_edges(c, part, part->count)) return false;
        if (!region_odd_pieces(c->edges.items, c->edges.count, &c->work, border, a)) return false;
        if (border->count == polygon.first) return true;
    }
    const region_piece *pieces = border->items + polygon.first;
    polygon.count = border->count - polygon.first;
    polygon.box = region_piece_box(&pieces[0]);
    for (size_t i = 1; i < polygon.count; i++) {
        region_box box = region_piece_box(&pieces[i]);
        region_box_add(&polygon.box, &box);
    }
    polygon.is_box = pieces_are_box(pieces, polygon.count, &polygon.box);
    if (polygon.is_box) {
        border->count = polygon.first;
        polygon.count = 0;
    }
    void *p = region->polygons;
    if (!memory_grow(a, &p, &region->polygon_capacity, region->polygon_count + 1, sizeof polygon)) return false;
    region->polygons = p;
    region->polygons[region->polygon_count++] = polygon;
    return true;
}

static void grow_region_box(rqt_region *region, const region_box *box) {
    if (!region->has_box) region->box = *box;
    region->has_box = true;
    region_box_add(&region->box, box);
}

/* A tree over pieces at a place of `nodes`. Returns the place behind it. */
static size_t build_tree(rqt_region *region, const region_piece *pieces, size_t count, size_t place) {
    region_box *nodes = region->nodes + place;
    for (size_t i = 0; i < count; i++) nodes[i] = region_piece_box(&pieces[i]);
    region_tree_build(nodes, count);
    return place + region_tree_size(count);
}

static bool build_trees(rqt_region *region) {
    size_t size = region_tree_size(region->polygon_count) + region_tree_size(region->thin.count);
    for (size_t i = 0; i < region->polygon_count; i++) size += region_tree_size(region->polygons[i].count);
    if (size > SIZE_MAX / sizeof *region->nodes) return false;
    region->nodes = memory_take(&region->allocator, size * sizeof *region->nodes);
    if (!region->nodes) return false;
    for (size_t i = 0; i < region->polygon_count; i++) {
        region->nodes[i] = region->polygons[i].box;
        grow_region_box(region, &region->polygons[i].box);
    }
    region_tree_build(region->nodes, region->polygon_count);
    region->thin_tree = region_tree_size(region->polygon_count);
    for (size_t i = 0; i < region->thin.count; i++) {
        region_box box = region_piece_box(&region->thin.items[i]);
        grow_region_box(region, &box);
    }
    size_t place = build_tree(region, region->thin.items, region->thin.count, region->thin_tree);
    for (size_t i = 0; i < region->polygon_count; i++) {
        region_polygon *p = &region->polygons[i];
        p->tree = place;
        if (p->count > 0) place = build_tree(region, region->border.items + p->first, p->count, place);
    }
    return true;
}

static bool compile(compiler *c) {
    for (size_t i = 0; i < c->geometry->part_count; i++) {
        const geometry_part *part = &c->geometry->parts[i];
        if (part->type == GEOMETRY_POLYGON) {
            if (!add_polygon(c, part)) return false;
        } else if (!take_edges(c, part, 1) || !add_thin(c)) {
            return false;
        }
    }
    return build_trees(c->region);
}

static bool is_step(double v) {
    return isfinite(v) && v != 0;
}

rqt_status rqt_region_create(const rqt_geometry *geometry, const rqt_placement *placement,
                             const rqt_lattice *lattice, const rqt_allocator *allocator, rqt_region **region) {
    *region = NULL;
    if (lattice->width < 1 || lattice->height < 1) return RQT_INVALID;
    if (!is_step(placement->dx) || !is_step(placement->dy)) return RQT_INVALID;
    if (!isfinite(placement->x0) || !isfinite(placement->y0)) return RQT_INVALID;
    rqt_region *r = memory_take(allocator, sizeof *r);
    if (!r) return RQT_NO_MEMORY;
    *r =
        (rqt_region){.allocator = *allocator, .all = !geometry, .width = lattice->width, .height = lattice->height};
    if (geometry) {
        compiler c = {.geometry = geometry, .placement = *placement, .region = r};
        bool done = compile(&c);
        memory_drop(allocator, c.edges.items);
        memory_drop(allocator, c.work.bytes);
        if (!done) {
            rqt_region_free(r);
            return RQT_NO_MEMORY;
        }
    }
    *region = r;
    return RQT_OK;
}

rqt_status rqt_region_of_squares(const rqt_square *squares, size_t n, const rqt_lattice *lattice,
                                 const rqt_allocator *allocator, rqt_region **region) {
    static const rqt_geometry nothing = {0};
    static const rqt_placement samples = {0, 0, 1, 1};
    rqt_region *r;
    rqt_status status = rqt_region_create(&nothing, &samples, lattice, allocator, &r);
    *region = r;
    for (size_t i = 0; i < n && status == RQT_OK; i++) {
        const rqt_square s = squares[i];
        if (s.x < lattice->width - 1 && s.y < lattice->height - 1) /* else there is no area */
            status = region_squares_add(&r->squares, s, allocator);
    }
    if (status != RQT_OK) {
        rqt_region_free(r);
        *region = NULL;
        return status;
    }
    for (size_t i = 0; i < r->squares.count; i++) {
        const rqt_square s = region_squares_at(&r->squares, i);
        const region_box box = {s.x * REGION_UNIT, s.y * REGION_UNIT, (s.x + s.side) * REGION_UNIT,
                                (s.y + s.side) * REGION_UNIT};
        grow_region_box(r, &box);
    }
    return RQT_OK;
}

void rqt_region_free(rqt_region *region) {
    if (!region) return;
    rqt_allocator a = region->allocator;
    memory_drop(&a, region->thin.items);
    memory_drop(&a, region->border.items);
    memory_drop(&a, region->polygons);
    memory_drop(&a, region->nodes);
    memory_drop(&a, region->squares.keys);
    memory_drop(&a, region);
}

size_t rqt_region_bytes(const rqt_region *region) {
    size_t nodes = region_tree_size(region->polygon_count) + region_tree_size(region->thin.count);
    for (size_t i = 0; i < region->polygon_count; i++) nodes += region_tree_size(region->polygons[i].count);
    return sizeof *region + (region->thin.capacity + region->border.capacity) * sizeof *region->border.items +
           region->polygon_capacity * sizeof *region->polygons + nodes * sizeof *region->nodes +
           region->squares.capacity * sizeof *region->squares.keys;
}

/* ------------------------------------------------------------------------------------------- questions -- */
bool rqt_region_is_all(const rqt_region *region) {
    return region->all;
}
bool rqt_region_is_empty(const rqt_region *region) {
    return !region->all && !region->has_box;
}

static int64_t floor_sample(int64_t units) {
    return (units < 0 ? units - (REGION_UNIT - 1) : units) / REGION_UNIT;
}

static int32_t clamp_sample(int64_t v, int32_t last) {
    return v < 0 ? 0 : v > last ? last : (int32_t)v;
}

bool rqt_region_box(const rqt_region *region, int32_t *x0, int32_t *y0, int32_t *x1, int32_t *y1) {
    int32_t right = region->width - 1, bottom = region->height - 1;
    *x0 = *y0 = 0;
    *x1 = *y1 = -1; /* nothing, for who does not look at the answer */
    region_box raster = {0, 0, right * REGION_UNIT, bottom * REGION_UNIT};
    if (!region->all && (!region->has_box || !region_boxes_touch(&region->box, &raster))) return false;
    *x1 = right;
    *y1 = bottom;
    if (region->all) return true;
    *x0 = clamp_sample(floor_sample(region->box.x0), right);
    *y0 = clamp_sample(floor_sample(region->box.y0), bottom);
    *x1 = clamp_sample(-floor_sample(-region->box.x1), right);
    *y1 = clamp_sample(-floor_sample(-region->box.y1), bottom);
    return true;
}

/* The sign of region_side of a finer point. With b - a = d it is that of floor's side * 2^bits + d x (x, y), whose
 * last term is split at 2^bits too: so no number is larger than the first. */
static int side_of_fine(const region_piece *piece, const region_fine_point *p) {
    const __int128 below = (__int128)(piece->b.x - piece->a.x) * p->y - (__int128)(piece->b.y - piece->a.y) * p->x;
    const __int128 carry = below >> p->bits; /* rounded down */
    const __int128 whole = region_side(piece->a, piece->b, p->floor) + carry;
    if (whole != 0) return whole > 0 ? 1 : -1;
    return below - carry * ((__int128)1 << p->bits) > 0;
}

/* The parity of a point that lies on no piece: how many pieces a ray to the left or right crosses, whichever side
 * of the polygon is nearer. A piece counts from its upper end, with, to its lower end, without; so the ray may pass
 * through corners. */
static bool is_inside_fine(const rqt_region *region, const region_polygon *polygon, const region_fine_point *fine) {
    const region_box *box = &polygon->box;
    const region_point p = fine->floor; /* what is below its unit changes nothing but the side of a piece */
    if (p.x < box->x0 || p.x > box->x1 || p.y < box->y0 || p.y > box->y1) return false;
    if (polygon->is_box) return (p.x < box->x1 || fine->x == 0) && (p.y < box->y1 || fine->y == 0);
    bool left = p.x - box->x0 < box->x1 - p.x, odd = false;
    region_box ray = {left ? box->x0 : p.x, p.y, left ? p.x : box->x1, p.y};
    region_search s;
    region_search_begin(&s, region->nodes + polygon->tree, polygon->count, &ray);
    for (size_t i; region_search_next(&s, &i);) {
        const region_piece *piece = &region->border.items[polygon->first + i];
        bool a_above = piece->a.y <= p.y, b_above = piece->b.y <= p.y;
        if (a_above == b_above) continue;
        const int side = side_of_fine(piece, fine);
        bool is_right = a_above ? side > 0 : side < 0; /* of p is the piece */
        if (is_right != left) odd = !odd;
    }
    return odd;
}

static bool is_inside(const rqt_region *region, const region_polygon *polygon, region_point p) {
    const region_fine_point fine = {.floor = p};
    return is_inside_fine(region, polygon, &fine);
}

static bool polygon_meets(const rqt_region *region, const region_polygon *polygon, const region_triangle *t) {
    if (polygon->is_box)
        return region_box_is_within(&t->box, &polygon->box) || region_triangle_overlaps(t, &polygon->box);
    if (!region_boxes_overlap(&t->box, &polygon->box)) return false;
    region_search s;
    region_search_begin(&s, region->nodes + polygon->tree, polygon->count, &t->box);
    for (size_t i; region_search_next(&s, &i);)
        if (region_triangle_is_crossed(t, &region->border.items[polygon->first + i])) return true;
    return is_inside(region, polygon, t->inner);
}

static bool areas_meet(const rqt_region *region, const region_triangle *t) {
    if (region->squares.count > 0) return region_squares_meet(&region->squares, t);
    region_search s;
    region_search_begin(&s, region->nodes, region->polygon_count, &t->box);
    for (size_t i; region_search_next(&s, &i);)
        if (polygon_meets(region, &region->polygons[i], t)) return true;
    return false;
}

bool region_area_meets(const rqt_region *region, rqt_vertex a, rqt_vertex b, rqt_vertex c) {
    if (region->all) return true;
    region_triangle t;
    return region_triangle_init(&t, a, b, c) && areas_meet(region, &t);
}

bool region_thin_touches(const rqt_region *region, const region_triangle *t) {
    region_search s;
    region_search_begin(&s, region->nodes + region->thin_tree, region->thin.count, &t->box);
    for (size_t i; region_search_next(&s, &i);)
        if (region_triangle_is_touched(t, &region->thin.items[i])) return true;
    return false;
}

bool rqt_region_meets(const rqt_region *region, rqt_vertex a, rqt_vertex b, rqt_vertex c) {
    if (region->all) return true;
    region_triangle t;
    if (!region_triangle_init(&t, a, b, c)) return false;
    if (!region->has_box || !region_boxes_touch(&t.box, &region->box)) return false;
    return areas_meet(region, &t) || region_thin_touches(region, &t);
}

static rqt_relation polygon_relation(const rqt_region *region, const region_polygon *polygon,
                                     const region_box *box) {
    if (!region_boxes_overlap(box, &polygon->box)) return RQT_OUTSIDE;
    if (polygon->is_box) return region_box_is_within(box, &polygon->box) ? RQT_INSIDE : RQT_ACROSS;
    region_search s;
    region_search_begin(&s, region->nodes + polygon->tree, polygon->count, box);
    for (size_t i; region_search_next(&s, &i);)
        if (region_box_is_crossed(box, &region->border.items[polygon->first + i])) return RQT_ACROSS;
    region_point centre = {(box->x0 + box->x1) / 2, (box->y0 + box->y1) / 2}; /* exact: both are whole samples */
    return is_inside(region, polygon, centre) ? RQT_INSIDE : RQT_OUTSIDE;
}

static bool box_of_samples(const rqt_region *region, int32_t x0, int32_t y0, int32_t x1, int32_t y1,
                           region_box *box) {
    *box = (region_box){x0 * REGION_UNIT, y0 * REGION_UNIT, x1 * REGION_UNIT, y1 * REGION_UNIT};
    return region->has_box && region_boxes_touch(box, &region->box);
}

static rqt_relation area_relation(const rqt_region *region, const region_box *box) {
    rqt_relation relation = RQT_OUTSIDE;
    if (region->squares.count > 0)
        return region_squares_relation(&region->squares, (int32_t)(box->x0 / REGION_UNIT),
                                       (int32_t)(box->y0 / REGION_UNIT), (int32_t)(box->x1 / REGION_UNIT),
                                       (int32_t)(box->y1 / REGION_UNIT));
    region_search s;
    region_search_begin(&s, region->nodes, region->polygon_count, box);
    for (size_t i; region_search_next(&s, &i);) {
        rqt_relation one = polygon_relation(region, &region->polygons[i], box);
        if (one == RQT_INSIDE) return RQT_INSIDE;
        if (one == RQT_ACROSS) relation = RQT_ACROSS;
    }
    return relation;
}

static bool thin_touches(const rqt_region *region, const region_box *box) {
    region_search s;
    region_search_begin(&s, region->nodes + region->thin_tree, region->thin.count, box);
    for (size_t i; region_search_next(&s, &i);)
        if (region_box_is_touched(box, &region->thin.items[i])) return true;
    return false;
}

rqt_relation region_area_relation(const rqt_region *region, int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
    region_box box;
    if (region->all) return RQT_INSIDE;
    if (x0 >= x1 || y0 >= y1 || !box_of_samples(region, x0, y0, x1, y1, &box)) return RQT_OUTSIDE;
    return area_relation(region, &box);
}

rqt_relation rqt_region_box_relation(const rqt_region *region, int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
    region_box box;
    if (region->all) return RQT_INSIDE;
    if (x0 >= x1 || y0 >= y1) return RQT_OUTSIDE; /* no triangle in it has an area */
    if (!box_of_samples(region, x0, y0, x1, y1, &box)) return RQT_OUTSIDE;
    const rqt_relation relation = area_relation(region, &box);
    return relation == RQT_OUTSIDE && thin_touches(region, &box) ? RQT_ACROSS : relation;
}

static bool polygon_touches(const rqt_region *region, const region_polygon *polygon, const region_box *box) {
    if (polygon->is_box) return true; /* found by its box */
    region_search s;
    region_search_begin(&s, region->nodes + polygon->tree, polygon->count, box);
    for (size_t i; region_search_next(&s, &i);)
        if (region_box_is_touched(box, &region->border.items[polygon->first + i])) return true;
    const region_point any = {box->x0,
                              box->y0}; /* there is no border in the box: all of it is inside, or nothing */
    return is_inside(region, polygon, any);
}

bool region_touches(const rqt_region *region, const region_box *box) {
    if (region->all) return true;
    if (!region->has_box || !region_boxes_touch(box, &region->box)) return false;
    if (region->squares.count > 0) { /* a side that is touched has the sample behind it in the open box */
        const int32_t end = 1 << RQT_MAX_K;
        return region_squares_relation(&region->squares, clamp_sample(-floor_sample(-box->x0) - 1, end),
                                       clamp_sample(-floor_sample(-box->y0) - 1, end),
                                       clamp_sample(floor_sample(box->x1) + 1, end),
                                       clamp_sample(floor_sample(box->y1) + 1, end)) != RQT_OUTSIDE;
    }
    region_search s;
    region_search_begin(&s, region->nodes, region->polygon_count, box);
    for (size_t i; region_search_next(&s, &i);)
        if (polygon_touches(region, &region->polygons[i], box)) return true;
    return thin_touches(region, box);
}

bool region_extent(const rqt_region *region, region_box *box) {
    *box = region->all ? (region_box){-REGION_LIMIT, -REGION_LIMIT, REGION_LIMIT, REGION_LIMIT} : region->box;
    return region->all || region->has_box;
}

void rqt_region_grow_rectangle(rqt_region *region) {
    if (region->all || region->polygon_count != 1 || region->thin.count > 0 || !region->polygons[0].is_box) return;
    region_box *box = &region->polygons[0].box;
    box->x0 = floor_sample(box->x0) * REGION_UNIT;
    box->y0 = floor_sample(box->y0) * REGION_UNIT;
    box->x1 = -floor_sample(-box->x1) * REGION_UNIT;
    box->y1 = -floor_sample(-box->y1) * REGION_UNIT;
    region->nodes[0] = region->box = *box;
}

bool rqt_region_contains(const rqt_region *region, rqt_vertex sample) {
    if (region->all) return true;
    if (region->squares.count > 0)
        return region_squares_relation(&region->squares, sample.x - 1, sample.y - 1, sample.x + 1, sample.y + 1) ==
               RQT_INSIDE;
    region_point p = {sample.x * REGION_UNIT, sample.y * REGION_UNIT};
    region_box place = {p.x, p.y, p.x, p.y};
    region_search polygons, pieces;
    region_search_begin(&polygons, region->nodes, region->polygon_count, &place);
    for (size_t i; region_search_next(&polygons, &i);) {
        const region_polygon *polygon = &region->polygons[i];
        if (!region_boxes_overlap(&place, &polygon->box)) continue;
        bool on_border = false;
        region_search_begin(&pieces, region->nodes + polygon->tree, polygon->count, &place);
        for (size_t j; !on_border && region_search_next(&pieces, &j);) {
            const region_piece *piece = &region->border.items[polygon->first + j];
            on_border = region_side(piece->a, piece->b, p) == 0; /* and it is in the piece's box */
        }
        if (!on_border && is_inside(region, polygon, p)) return true;
    }
    return false;
}

/* ------------------------------------------------------------------------------------- what mode `cut` asks -- */
bool region_has_border(const rqt_region *region) {
    return region->squares.count == 0;
}

bool region_holds(const rqt_region *region, const region_fine_point *p) {
    const region_box place = {p->floor.x, p->floor.y, p->floor.x, p->floor.y};
    region_search s;
    region_search_begin(&s, region->nodes, region->polygon_count, &place);
    for (size_t i; region_search_next(&s, &i);)
        if (is_inside_fine(region, &region->polygons[i], p)) return true;
    return false;
}

void region_border_begin(region_border_search *s, const rqt_region *region, const region_box *box) {
    *s = (region_border_search){.region = region, .box = *box, .side = 4};
    region_search_begin(&s->polygons, region->nodes, region->polygon_count, box);
}

bool region_border_next(region_border_search *s, region_piece *piece) {
    for (;;) {
        size_t i;
        if (s->is_open && region_search_next(&s->pieces, &i)) {
            *piece = s->region->border.items[s->first + i];
            return true;
        }
        s->is_open = false;
        while (s->side < 4) { /* of a rectangle, which keeps no pieces; ends as odd pieces have them */
            const region_box *r = &s->rectangle;
            const int n = s->side++;
            *piece = (region_piece){{n == 3 ? r->x1 : r->x0, n == 1 ? r->y1 : r->y0},
                                    {n == 2 ? r->x0 : r->x1, n == 0 ? r->y0 : r->y1}};
            const region_box box = region_piece_box(piece);
            if (region_boxes_touch(&box, &s->box)) return true;
        }
        if (!region_search_next(&s->polygons, &i)) return false;
        const region_polygon *polygon = &s->region->polygons[i];
        if (polygon->is_box) {
            s->rectangle = polygon->box;
            s->side = 0;
        } else {
            s->first = polygon->first;
            region_search_begin(&s->pieces, s->region->nodes + polygon->tree, polygon->count, &s->box);
            s->is_open = true;
        }
    }
}
