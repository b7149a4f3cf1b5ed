/* fuzz_geometry.c - regions: any text, any bytes, words of WKT in any order, geometries of every kind with numbers
 * from anywhere, unions of squares; and what a region then says of boxes, triangles and samples, which must agree.
 */
#include "fuzz.h"

static const char *const words[] = {"POLYGON",
                                    "MULTIPOLYGON",
                                    "LINESTRING",
                                    "MULTILINESTRING",
                                    "POINT",
                                    "MULTIPOINT",
                                    "GEOMETRYCOLLECTION",
                                    "EMPTY",
                                    "(",
                                    ")",
                                    "((",
                                    "))",
                                    ",",
                                    " ",
                                    "Z",
                                    "M",
                                    "ZM",
                                    "SRID=4326;",
                                    "SRID=-1;",
                                    "CIRCULARSTRING",
                                    "TIN",
                                    "1 2",
                                    "3 4",
                                    "0 0",
                                    "1e999",
                                    "nan",
                                    "-",
                                    ".5",
                                    "7"};

static size_t write_words(input *in, char *text, size_t room) {
    size_t n = 0;
    while (in->size > 0 && n + 64 < room)
        n += (size_t)(take_between(in, 0, 3)
                          ? snprintf(text + n, room - n, "%s",
                                     words[take_bits(in, 1) % (sizeof words / sizeof *words)])
                          : snprintf(text + n, room - n, "%.17g %.17g", take_double(in), take_double(in)));
    return n;
}

static void put(uint8_t **p, const void *value, size_t n) {
    memcpy(*p, value, n);
    *p += n;
}

/* WKB of a polygon, line or point, in a GeoPackage or SpatiaLite envelope or plain, with counts that may lie. */
static size_t write_bytes(input *in, uint8_t *bytes) {
    uint8_t *p = bytes;
    const int coat = take_between(in, 0, 2), count = take_between(in, 1, 8);
    const int32_t srid = take_between(in, 0, 1) ? 0 : take_between(in, -2, 5000);
    const uint32_t dimension[] = {0, 1000, 2000, 3000, 0x80000000u, 0x20000000u};
    const uint32_t type = (uint32_t)take_between(in, 1, 3);
    const uint32_t kind = type + (take_between(in, 0, 3) ? 0 : dimension[take_between(in, 0, 5)]);
    const uint32_t one = 1, n = take_between(in, 0, 15) ? (uint32_t)count : (uint32_t)take_bits(in, 4);
    const double box[4] = {0, 0, 0, 0};
    if (coat == 1) {
        const uint8_t head[4] = {
            'G', 'P', 0, (uint8_t)(1 | (take_between(in, 0, 1) ? 2 : 0) | (take_between(in, 0, 15) == 0 ? 16 : 0))};
        put(&p, head, 4), put(&p, &srid, 4);
        if (head[3] & 2) put(&p, box, sizeof box);
    } else if (coat == 2) {
        const uint8_t head[2] = {0, 1}, mark = 0x7C;
        put(&p, head, 2), put(&p, &srid, 4), put(&p, box, sizeof box), put(&p, &mark, 1);
    }
    const uint8_t order = 1;
    if (coat != 2) put(&p, &order, 1);
    put(&p, &kind, 4);
    if (type == 3) put(&p, &one, 4);
    if (type != 1) put(&p, &n, 4);
    double first[2] = {take_double(in), take_double(in)};
    for (int i = 0; i < (type == 1 ? 1 : count); i++) {
        double at[2] = {i ? take_double(in) : first[0], i ? take_double(in) : first[1]};
        if (type == 3 && i == count - 1) memcpy(at, first, sizeof at);
        put(&p, at, sizeof at);
    }
    const uint8_t end = 0xFE;
    if (coat == 2) put(&p, &end, 1);
    size_t size = (size_t)(p - bytes);
    take_damage(in, bytes, size);
    return take_between(in, 0, 7) ? size : (size_t)take_bits(in, 2) % (size + 1);
}

/* Polygons near the terrain, so that something is met. */
static size_t write_polygon(input *in, char *text, size_t room) {
    size_t n = (size_t)snprintf(text, room, "POLYGON(");
    for (int ring = take_between(in, 1, 2); ring > 0; ring--) {
        const double x = take_between(in, -16, 200) / 8.0, y = take_between(in, -16, 200) / 8.0;
        n += (size_t)snprintf(text + n, room - n, "(%.17g %.17g", x, y);
        for (int i = take_between(in, 2, 6); i > 0; i--)
            n += (size_t)snprintf(text + n, room - n, ", %.17g %.17g", take_between(in, -16, 200) / 8.0,
                                  take_between(in, -16, 200) / 8.0);
        n += (size_t)snprintf(text + n, room - n, ", %.17g %.17g)%s", x, y, ring > 1 ? "," : ")");
    }
    return n;
}

static void look(input *in, const rqt_region *region, const rqt_lattice *l) {
    int32_t x0, y0, x1, y1;
    const bool empty = rqt_region_is_empty(region), all = rqt_region_is_all(region);
    const bool meets = rqt_region_box(region, &x0, &y0, &x1, &y1);
    HOLD(!meets || (x0 >= 0 && x0 <= x1 && x1 < l->width && y0 >= 0 && y0 <= y1 && y1 < l->height), "box");
    HOLD(!empty || !meets, "an empty region has a box");
    for (int n = 0; n < 12; n++) {
        const int32_t x = take_between(in, 0, l->width - 1), y = take_between(in, 0, l->height - 1);
        const int32_t w = take_between(in, 1, 4), h = take_between(in, 1, 4);
        const rqt_relation relation = rqt_region_box_relation(region, x, y, x + w, y + h);
        const rqt_vertex a = {x, y}, b = {x + w, y}, c = {x, y + h}, d = {x + w, y + h};
        const bool one = rqt_region_meets(region, a, b, c), other = rqt_region_meets(region, d, b, c);
        HOLD(one == rqt_region_meets(region, c, a, b) && one == rqt_region_meets(region, c, b, a),
             "order of corners");
        HOLD(relation != RQT_OUTSIDE || (!one && !other), "outside, and yet it meets");
        HOLD(relation != RQT_INSIDE || (one && other), "inside, and yet it does not meet");
        HOLD(!empty || (!one && relation != RQT_INSIDE), "empty, and yet it meets");
        HOLD(!all || (one && other), "all, and yet it does not meet");
        HOLD(!one || !meets || (x <= x1 && x + w >= x0 && y <= y1 && y + h >= y0), "it meets outside its box");
        if (rqt_region_contains(region, a)) HOLD(one && meets, "it contains a corner, and yet it does not meet");
    }
}

/* ------------------------------------------------------------------------------------ grown and snapped */
static void snap(input *in, rqt_region *region, const rqt_lattice *l, const rqt_allocator *a, fuzz_heap *h) {
    rqt_region *snapped = NULL;
    const int32_t side = rqt_region_snap_side(region);
    HOLD(side >= 1 && (side & (side - 1)) == 0, "a side of %d", side);
    if (!went_well(rqt_region_snap(region, l, a, &snapped), h)) return;
    HOLD(rqt_region_is_all(snapped) == rqt_region_is_all(region), "everything stays everything");
    for (int grown = 0; grown < 2; grown++) {
        for (int n = 0; n < 12 && l->width > 1 && l->height > 1; n++) {
            const int32_t x = take_between(in, 0, l->width - 2), y = take_between(in, 0, l->height - 2);
            const rqt_vertex nw = {x, y}, ne = {x + 1, y}, sw = {x, y + 1}, se = {x + 1, y + 1};
            const bool meets = rqt_region_meets(region, nw, sw, se) || rqt_region_meets(region, nw, ne, se);
            const bool one = rqt_region_meets(snapped, nw, sw, se), other = rqt_region_meets(snapped, nw, ne, se);
            HOLD(!meets || (one && other), "cell (%d,%d) is lost", x, y);
            HOLD(one == other, "half of cell (%d,%d)", x, y);
        }
        if (grown || !went_well(RQT_OK, h)) break;
        rqt_region_grow_rectangle(region);
        rqt_region_free(snapped);
        if (!went_well(rqt_region_snap(region, l, a, &snapped), h)) return;
        look(in, region, l);
    }
    rqt_region_free(snapped);
}

/* ------------------------------------------------------------------------------------ members, lines, bytes */
/* As bytes and back: the same members, and as many points. */
static void there_and_back(const rqt_geometry *geometry, const rqt_allocator *a, fuzz_heap *h) {
    uint8_t *wkb = NULL;
    size_t n = 0;
    if (!went_well(rqt_geometry_wkb(geometry, a, &wkb, &n), h)) return;
    uint8_t *exact = exact_copy(wkb, n);
    (void)a->resize(a->context, wkb, 0);
    rqt_geometry *back = NULL;
    rqt_message why = {""};
    const rqt_status status = rqt_geometry_parse(exact, n, false, a, &back, &why);
    free(exact);
    HOLD(status == RQT_OK || status == RQT_NO_MEMORY, "%s", why.text);
    if (!went_well(status, h)) return;
    HOLD(rqt_geometry_members(back) == rqt_geometry_members(geometry) &&
             rqt_geometry_is_empty(back) == rqt_geometry_is_empty(geometry),
         "%zu members, %zu", rqt_geometry_members(geometry), rqt_geometry_members(back));
    for (size_t i = 0; i < rqt_geometry_members(back); i++) {
        size_t points, others;
        const double *one = rqt_geometry_line(geometry, i, &points), *other = rqt_geometry_line(back, i, &others);
        HOLD(points == others && (one == NULL) == (other == NULL), "member %zu", i);
        HOLD(points == 0 || memcmp(one, other, 2 * points * sizeof *one) == 0, "points of member %zu", i);
    }
    rqt_geometry_free(back);
}

static void repeat(input *in, rqt_geometry *geometry, const rqt_allocator *a, fuzz_heap *h) {
    const size_t before = rqt_geometry_members(geometry);
    const double period = take_between(in, 1, 720), low = take_between(in, -720, 720),
                 high = low + take_between(in, 0, 720);
    HOLD(rqt_geometry_is_empty(geometry) == (before == 0), "%zu members", before);
    there_and_back(geometry, a, h);
    if (!went_well(rqt_geometry_repeat(geometry, period, low, high), h)) return;
    const size_t after = rqt_geometry_members(geometry);
    HOLD(after >= before && (before > 0 || after == 0), "%zu members, then %zu", before, after);
    for (size_t i = before; i < after; i++) {
        size_t points;
        const double *line = rqt_geometry_line(geometry, i, &points);
        double least = INFINITY, most = -INFINITY;
        for (size_t p = 0; p < points; p++) least = fmin(least, line[2 * p]), most = fmax(most, line[2 * p]);
        HOLD(!line || (least <= high + 1e-6 && most >= low - 1e-6), "a copy from %g to %g", least, most);
    }
    there_and_back(geometry, a, h);
}

static void lines(input *in, const rqt_allocator *a, fuzz_heap *h) {
    double xy[24];
    size_t counts[5];
    size_t used = 0, wanted = 0;
    bool finite = true;
    const size_t n = (size_t)take_between(in, 0, 5);
    for (size_t i = 0; i < n; i++) {
        counts[i] = (size_t)take_between(in, 0, 4);
        wanted += counts[i] > 0;
        for (size_t p = 0; p < 2 * counts[i]; p++, used++) {
            xy[used % 24] = take_between(in, 0, 7) ? take_between(in, -99, 99) / 8.0 : take_double(in);
            finite &= isfinite(xy[used % 24]);
        }
        if (used > 24) return;
    }
    rqt_geometry *geometry = NULL;
    const rqt_status status = rqt_geometry_of_lines(xy, counts, n, 4326, a, &geometry);
    HOLD(finite || status == RQT_INVALID || status == RQT_NO_MEMORY, "status %d", (int)status);
    if (!finite || !went_well(status, h)) return;
    HOLD(rqt_geometry_members(geometry) == wanted && rqt_geometry_srid(geometry) == 4326, "%zu lines", wanted);
    there_and_back(geometry, a, h);
    rqt_geometry_free(geometry);
}

/* ------------------------------------------------------------------------------------ unions of squares */
enum { SQUARES = 64 };

/* Squares in Morton order, from the root square down: some taken, some divided, some left out. */
static size_t take_squares(input *in, rqt_square square, rqt_square *taken, size_t n) {
    const int what = take_between(in, 0, 5);
    if (what == 0 || n == SQUARES) return n;
    if (what == 1 || square.side == 1) {
        taken[n] = square;
        return n + 1;
    }
    const int32_t half = square.side / 2;
    for (int i = 0; i < 4; i++)
        n = take_squares(in, (rqt_square){square.x + i % 2 * half, square.y + i / 2 * half, half}, taken, n);
    return n;
}

static void squares(input *in, const rqt_lattice *l, const rqt_allocator *a, fuzz_heap *h) {
    rqt_square taken[SQUARES];
    size_t n = take_squares(in, (rqt_square){0, 0, 1 << l->K}, taken, 0);
    const bool wild = n > 0 && take_between(in, 0, 3) == 0;
    if (wild) {
        const size_t i = (size_t)take_between(in, 0, (int)n - 1);
        taken[i] = (rqt_square){take_between(in, -9, 40), take_between(in, -9, 40), (int32_t)take_bits(in, 4)};
    }
    rqt_region *region = NULL;
    const rqt_status status = rqt_region_of_squares(taken, n, l, a, &region);
    HOLD(status == RQT_OK || !region, "a region in spite of status %d", (int)status);
    if ((wild && status == RQT_INVALID) || !went_well(status, h)) return;
    look(in, region, l);
    for (size_t i = 0; i < n && !wild; i++) {
        const rqt_square s = taken[i];
        const bool is_there = s.x < l->width - 1 && s.y < l->height - 1;
        const rqt_relation relation = rqt_region_box_relation(region, s.x, s.y, s.x + s.side, s.y + s.side);
        HOLD(!is_there || relation == RQT_INSIDE, "square %zu is not all inside", i);
    }
    rqt_region_free(region);
}

const long fuzz_runs = 8000;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size};
    fuzz_heap heap;
    const rqt_allocator a = fuzz_allocator(&heap, &in);
    static char text[4096];
    static uint8_t bytes[4096];
    const int way = take_between(&in, 0, 4);
    const rqt_placement placement =
        take_between(&in, 0, 3) ? (rqt_placement){0, 0, 1, 1}
                                : (rqt_placement){take_between(&in, -99, 99), take_between(&in, -99, 99),
                                                  take_between(&in, 1, 50) / 8.0, -take_between(&in, 1, 50) / 8.0};
    rqt_lattice l;
    (void)rqt_lattice_init(&l, take_between(&in, 1, 30), take_between(&in, 1, 30));
    const input rest = in;
    const void *door = in.bytes;
    size_t n = in.size;
    if (way == 2) n = write_words(&in, text, sizeof text), door = text;
    if (way == 3) n = write_bytes(&in, bytes), door = bytes;
    if (way == 4) n = write_polygon(&in, text, sizeof text), door = text;
    uint8_t *exact = exact_copy(n ? door : "", n);
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_message why = {""};
    const rqt_status status = rqt_geometry_parse(exact, n, way != 0 && way != 3, &a, &geometry, &why);
    HOLD(status == RQT_OK || geometry == NULL, "a geometry in spite of status %d", (int)status);
    HOLD(status == RQT_OK || status == RQT_NO_MEMORY ||
             ((status == RQT_INVALID || status == RQT_UNSUPPORTED) && why.text[0]),
         "status %d", (int)status);
    free(exact);
    if (status == RQT_OK) {
        HOLD(rqt_geometry_srid(geometry) > 0 || rqt_geometry_srid(geometry) <= 0, "srid");
        if (went_well(rqt_region_create(take_between(&in, 0, 31) ? geometry : NULL, &placement, &l, &a, &region),
                      &heap)) {
            in = rest;
            HOLD(rqt_region_bytes(region) <= heap.live, "%zu bytes of %zu", rqt_region_bytes(region), heap.live);
            look(&in, region, &l);
            snap(&in, region, &l, &a, &heap);
        }
        in = rest;
        repeat(&in, geometry, &a, &heap);
    }
    rqt_region_free(region);
    rqt_geometry_free(geometry);
    in = rest;
    lines(&in, &a, &heap);
    in = rest;
    squares(&in, &l, &a, &heap);
    HOLD(heap.live == 0, "%zu bytes leaked", heap.live);
    return 0;
}
