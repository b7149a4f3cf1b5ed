/* region_snap.c - mode `snap`: a region grown to a grid of squares.
 *
 * The squares that the region meets become the rings of one polygon. Sides that two of them share are there twice
 * and cancel (region_edges.c), so what is left is the outline of their union, and for most regions a rectangle or
 * little more. Squares that follow each other in a row are one ring to begin with. */
#include "geometry.h"
#include "region_edges.h"

int32_t rqt_region_snap_side(const rqt_region *region) {
    int32_t x0, y0, x1, y1;
    if (!rqt_region_box(region, &x0, &y0, &x1, &y1)) return 1;
    const int32_t longer = x1 - x0 > y1 - y0 ? x1 - x0 : y1 - y0;
    int32_t side = 1;
    while (side <= longer / 16) side *= 2;
    return side;
}

static int32_t least(int32_t a, int32_t b) {
    return a < b ? a : b;
}

/* Interior meets interior; of lines and points: touched. The two halves of the square are what can be asked. */
static bool meets_square(const rqt_region *region, int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
    const rqt_relation relation = rqt_region_box_relation(region, x0, y0, x1, y1);
    if (relation != RQT_ACROSS) return relation == RQT_INSIDE;
    const rqt_vertex nw = {x0, y0}, ne = {x1, y0}, sw = {x0, y1}, se = {x1, y1};
    return rqt_region_meets(region, nw, se, ne) || rqt_region_meets(region, nw, sw, se);
}

static rqt_status add_rectangle(rqt_geometry *g, int32_t x0, int32_t y0, int32_t x1, int32_t y1) {
    const int32_t x[5] = {x0, x1, x1, x0, x0}, y[5] = {y0, y0, y1, y1, y0};
    rqt_status status = geometry_open_ring(g, NULL);
    for (int i = 0; i < 5 && status == RQT_OK; i++) status = geometry_add_point(g, x[i], y[i], NULL);
    return status;
}

/* One row of squares. */
static rqt_status add_row(rqt_geometry *g, const rqt_region *region, const rqt_lattice *lattice, int32_t side,
                          const int32_t box[4], int32_t y) {
    const int32_t bottom = least(y + side, lattice->height - 1);
    rqt_status status = RQT_OK;
    int32_t start = -1;
    for (int32_t x = box[0] / side * side; status == RQT_OK; x += side) {
        const int32_t right = least(x + side, lattice->width - 1);
        const bool meets = x < right && x <= box[2] && meets_square(region, x, y, right, bottom);
        if (meets && start < 0) start = x;
        if (meets) continue;
        if (start >= 0) status = add_rectangle(g, start, y, least(x, lattice->width - 1), bottom);
        start = -1;
        if (x > box[2] || x >= right) break;
    }
    return status;
}

static rqt_status collect(rqt_geometry *g, const rqt_region *region, const rqt_lattice *lattice) {
    const int32_t side = rqt_region_snap_side(region);
    int32_t box[4];
    if (!rqt_region_box(region, &box[0], &box[1], &box[2], &box[3])) return RQT_OK;
    /* a square that ends where the box begins may be touched by a line there */
    for (int i = 0; i < 2; i++) box[i] -= box[i] > 0;
    rqt_status status = geometry_open_part(g, GEOMETRY_POLYGON, NULL);
    for (int32_t y = box[1] / side * side; y <= box[3] && y < lattice->height - 1 && status == RQT_OK; y += side)
        status = add_row(g, region, lattice, side, box, y);
    return status == RQT_OK ? geometry_close_part(g, NULL) : status;
}

rqt_status rqt_region_snap(const rqt_region *region, const rqt_lattice *lattice, const rqt_allocator *allocator,
                           rqt_region **snapped) {
    static const rqt_placement samples = {0, 0, 1, 1};
    *snapped = NULL;
    if (rqt_region_is_all(region)) return rqt_region_create(NULL, &samples, lattice, allocator, snapped);
    rqt_geometry *g = memory_take(allocator, sizeof *g);
    if (!g) return RQT_NO_MEMORY;
    *g = (rqt_geometry){.allocator = *allocator};
    rqt_status status = collect(g, region, lattice);
    if (status == RQT_OK) status = rqt_region_create(g, &samples, lattice, allocator, snapped);
    rqt_geometry_free(g);
    return status;
}
