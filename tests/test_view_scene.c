/* test_view_scene.c - what a view knows of a terrain before it reads a block: the heights of cells from summaries
 * alone, and pieces of space that hold squares. Both against every sample, looked at one by one. (Cameras, fields
 * and answers are tests/test_sql_view.py's.) RQT_SEED: the terrains and squares. */
#include "test_store_support.h"

#pragma push_macro("fail") /* cmocka's; ext has a function of that name */
#undef fail
#include "view.h"
#pragma pop_macro("fail")

static uint64_t seed = 5, dice_state;

static double dice(double low, double high) {
    dice_state = dice_state * 6364136223846793005u + 1442695040888963407u;
    return low + (high - low) * ((double)(dice_state >> 11) * 0x1p-53);
}

static int dice_int(int low, int high) {
    return low + (int)dice(0, high - low + 0.999999);
}

static void start_dice(uint64_t test) {
    dice_state = seed * 0x9E3779B97F4A7C15u + test;
    for (int i = 0; i < 4; i++) (void)dice(0, 1);
}

/* ---------------------------------------------------------------------------------------------- relief -- */

/* Waves, and noise of any strength; voids in places. */
static raster make_hills(int width, int height, bool voids) {
    raster r = make_raster(width, height, (uint32_t)dice(0, 4e9), voids);
    const double a = dice(0, 300), b = dice(0.02, 1), c = dice(0.02, 1), rough = dice(0, 1) < 0.5 ? 0 : dice(0, 60);
    for (int i = 0; i < width * height; i++)
        r.q[i] = (int32_t)lrint(a * sin(b * (i % width)) * cos(c * (i / width)) + rough * dice(-1, 1));
    return r;
}

typedef struct extremes {
    double lowest, highest;
    bool any;
} extremes;

static extremes look(const raster *r, int x0, int y0, int x1, int y1) {
    extremes e = {INFINITY, -INFINITY, false};
    for (int y = y0; y <= y1 && y < r->height; y++)
        for (int x = x0; x <= x1 && x < r->width; x++) {
            if (r->valid && !r->valid[y * r->width + x]) continue;
            const double z = 100 + r->q[y * r->width + x] / 4.0;
            e = (extremes){fmin(e.lowest, z), fmax(e.highest, z), true};
        }
    return e;
}

typedef struct relief_walk {
    store *s;
    const store_terrain *t;
    const raster *r;
    double wider; /* sum of how much wider than the truth */
    long cells, idle;
} relief_walk;

/* The cell and all below it. */
static void walk_cells(relief_walk *w, int level, int i, int j, store_relief above) {
    rqt_block_place p;
    const rqt_block_number number = rqt_block_number_of(level, i, j);
    if (level > w->t->lattice.K - w->t->k || rqt_block_locate(&w->t->lattice, w->t->k, number, &p) != RQT_OK)
        return;
    char *error = NULL;
    store_relief relief = above;
    const int code = store_find_relief(w->s, w->t, number, &relief, &error);
    CHECK(code == SQLITE_OK, "block %llu: %s", (unsigned long long)number, error ? error : "");
    assert_true(relief.lowest >= above.lowest && relief.highest <= above.highest && relief.error <= above.error);
    const extremes seen = look(w->r, p.x, p.y, p.x + p.side, p.y + p.side);
    if (seen.any) {
        CHECK(relief.lowest <= seen.lowest && relief.highest >= seen.highest,
              "block %llu: heights are %.17g .. %.17g, said to be %.17g .. %.17g", (unsigned long long)number,
              seen.lowest, seen.highest, relief.lowest, relief.highest);
        w->cells++;
        w->idle += relief.lowest == above.lowest && relief.highest == above.highest;
        if (seen.highest > seen.lowest)
            w->wider += (relief.highest - relief.lowest) / (seen.highest - seen.lowest) - 1;
    }
    for (int c = 0; c < 4; c++) walk_cells(w, level + 1, 2 * i + (c & 1), 2 * j + (c >> 1), relief);
}

static void every_sample_of_a_cell_is_within_its_relief(void **state) {
    (void)state;
    start_dice(1);
    relief_walk all = {.s = NULL};
    for (int n = 0; n < 120; n++) {
        const bool thin = n % 12 == 11;
        const int width = thin ? 1 : dice_int(2, 70), height = dice_int(2, 70), k = dice_int(1, 3);
        raster r = make_hills(width, height, n % 3 == 2);
        rqt_lattice lattice;
        assert_int_equal(rqt_lattice_init(&lattice, width, height), RQT_OK);
        sqlite3 *db = open_database(":memory:");
        char *error = NULL;
        run(db, "BEGIN IMMEDIATE");
        const int code = write_terrain(db, &r, "t", k < lattice.K ? k : lattice.K, false, true, &error);
        CHECK(code == SQLITE_OK, "%d: %s", code, error ? error : "");
        run(db, "COMMIT");
        relief_walk w = {.r = &r};
        assert_int_equal(store_open(db, &w.s), SQLITE_OK);
        assert_int_equal(store_begin(w.s, NULL), SQLITE_OK);
        assert_int_equal(store_find(w.s, "t", &w.t, NULL), SQLITE_OK);
        walk_cells(&w, 0, 0, 0, store_relief_of_all(w.t));
        all.cells += w.cells, all.wider += w.wider, all.idle += w.idle;
        store_end(w.s);
        store_close(w.s);
        sqlite3_close(db);
        raster_free(&r);
    }
    printf(
        "%ld cells, on the average %.2f times wider than the truth, %ld of them not narrower than those around\n",
        all.cells, all.wider / (double)all.cells, all.idle);
    assert_true(all.cells > 4000 && all.idle < all.cells / 2);
}

static void lift(rqt_summary *summary) {
    for (int c = 0; c < 4; c++) summary->corner[c].q = 100000;
}

static void relief_that_cannot_be_is_damage(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(33, 33, 3, false);
    const rqt_block_number number = rqt_block_number_of(1, 1, 0);
    edit_summary(db, number, lift);
    store *s;
    const store_terrain *t;
    char *error = NULL;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    assert_int_equal(store_begin(s, NULL), SQLITE_OK);
    assert_int_equal(store_find(s, "t", &t, NULL), SQLITE_OK);
    store_relief relief = store_relief_of_all(t);
    assert_int_equal(store_find_relief(s, t, number, &relief, &error), SQLITE_CORRUPT_VTAB);
    CHECK(error && strstr(error, "terrain t is damaged: the heights of block 5"), "%s", error ? error : "");
    sqlite3_free(error);
    store_end(s);
    store_close(s);
    sqlite3_close(db);
}

/* ---------------------------------------------------------------------------------------------- prisms -- */

static void textbook_ecef(double a, double f, const double p[3], double xyz[3]) {
    const double e2 = f * (2 - f), degree = 0.017453292519943295;
    const double sine = sin(p[1] * degree), cosine = cos(p[1] * degree), n = a / sqrt(1 - e2 * sine * sine);
    xyz[0] = (n + p[2]) * cosine * cos(p[0] * degree);
    xyz[1] = (n + p[2]) * cosine * sin(p[0] * degree);
    xyz[2] = (n * (1 - e2) + p[2]) * sine;
}

/* How far a point is out of the prism, and what there was to spare. */
static void check_point(const rqt_prism *prism, const double p[3], double *spare_radius, double *spare_height) {
    double along = 0, square = 0;
    for (int i = 0; i < 3; i++) along += (p[i] - prism->centre[i]) * prism->up[i];
    for (int i = 0; i < 3; i++) {
        const double d = p[i] - prism->centre[i] - along * prism->up[i];
        square += d * d;
    }
    CHECK(fabs(along) <= prism->half_height && sqrt(square) <= prism->radius,
          "a sample is %.9g along and %.9g across, the prism %.9g and %.9g", along, sqrt(square),
          prism->half_height, prism->radius);
    *spare_radius = fmin(*spare_radius, prism->radius - sqrt(square));
    *spare_height = fmin(*spare_height, prism->half_height - fabs(along));
}

/* Is it in the box? */
static void check_box(const rqt_view_piece *piece, const double p[3]) {
    const double *const up = piece->prism.up, *const e = piece->east;
    const double north[3] = {up[1] * e[2] - up[2] * e[1], up[2] * e[0] - up[0] * e[2], up[0] * e[1] - up[1] * e[0]};
    double east_by = 0, north_by = 0;
    for (int i = 0; i < 3; i++) {
        east_by += (p[i] - piece->prism.centre[i]) * e[i];
        north_by += (p[i] - piece->prism.centre[i]) * north[i];
    }
    CHECK(fabs(east_by) <= piece->half_east && fabs(north_by) <= piece->half_north,
          "a sample is %.9g east and %.9g north, the box %.9g and %.9g", east_by, north_by, piece->half_east,
          piece->half_north);
}

/* The samples of a square that can be furthest out: its sides and some inside, at both ends of the heights. */
static void check_square(const scene *s, rqt_square square, double lowest, double highest) {
    const store_terrain *t = s->terrain;
    rqt_view_piece piece;
    const rqt_prism *const prism = &piece.prism;
    scene_piece(s, square, lowest, highest, &piece);
    assert_int_equal(piece.side, square.side);
    assert_true(fabs(prism->up[0] * prism->up[0] + prism->up[1] * prism->up[1] + prism->up[2] * prism->up[2] - 1) <
                1e-12);
    const int x0 = square.x, y0 = square.y, last = t->lattice.width - 1;
    const int x1 = x0 + square.side < last ? x0 + square.side : last,
              y1 = y0 + square.side < last ? y0 + square.side : last;
    double spare[2] = {INFINITY, INFINITY};
    for (int n = 0; n < 400; n++) {
        const int x = n < 4 ? (n & 1 ? x1 : x0) : n % 3 == 0 ? x0 : n % 3 == 1 ? x1 : dice_int(x0, x1);
        const int y = n < 4 ? (n & 2 ? y1 : y0) : n % 5 == 0 ? y0 : n % 5 == 1 ? y1 : dice_int(y0, y1);
        const double z = n % 2 ? lowest : n % 7 ? highest : dice(lowest, highest);
        double p[3] = {t->placement.x0 + x * t->placement.dx, t->placement.y0 + y * t->placement.dy,
                       z * s->exaggeration};
        if (s->geoid.most > 0) {
            geo_frame_place(s->space, p, p); /* what a geoid is, is test_geo.c's */
        } else if (s->space) {
            double q[3];
            textbook_ecef(s->ellipsoid.a, s->ellipsoid.f, p, q);
            memcpy(p, q, sizeof q);
        }
        check_point(prism, p, &spare[0], &spare[1]);
        check_box(&piece, p);
    }
    /* Not idle where the Earth is nearly flat: a few corners all but touch it. */
    const double degrees = fmax(fabs(t->placement.dx) * (x1 - x0), fabs(t->placement.dy) * (y1 - y0));
    if (s->geoid.most > 0 || (s->space && (degrees > 0.2 || fabs(t->placement.y0 + y0 * t->placement.dy) > 60)))
        return;
    CHECK(spare[0] <= 0.08 * prism->radius && spare[1] <= 0.02 * prism->half_height + 40,
          "a radius of %.9g has %.9g to spare, a height of %.9g %.9g", prism->radius, spare[0], prism->half_height,
          spare[1]);
}

static void samples_of_a_square_are_in_its_prism(void **state) {
    (void)state;
    start_dice(2);
    for (int n = 0; n < 300; n++) {
        const int kind = n % 4; /* planar, geocentric, another ellipsoid, with a geoid */
        store_terrain t = {
            .name = "t",
            .k = 3,
            .crs = kind == 2 ? "GEOGCS[\"ED50\",DATUM[\"x\",SPHEROID[\"International\",6378388,297]]]" : "",
            .vertical = "",
            .lonlat = kind > 0,
            .wgs84 = kind == 1 || kind == 3};
        const int size = dice_int(3, 400);
        assert_int_equal(rqt_lattice_init(&t.lattice, size, size), RQT_OK);
        const double wide = kind ? fmin(359, pow(10, dice(-3, 2.56))) : pow(10, dice(1, 6));
        const double tall = kind ? fmin(179, wide * dice(0.3, 1)) : wide * dice(0.3, 1);
        t.placement =
            (rqt_placement){kind ? dice(-180, 180) : dice(-1e6, 1e6), kind ? dice(-90 + tall, 90) : dice(-1e7, 1e7),
                            wide / (size - 1), -tall / (size - 1)};
        t.cost.cell = fmax(t.placement.dx, -t.placement.dy);
        scene s;
        char *error = NULL;
        const double exaggeration = n % 3 ? 1 : dice(0.1, 20);
        const int code = scene_create(&s, &t, exaggeration, kind == 3, &error);
        CHECK(code == SQLITE_OK, "%s", error ? error : "");
        assert_true(kind != 2 || s.ellipsoid.a == 6378388);
        for (int square = 0; square < 12; square++) {
            const int side = 1 << dice_int(0, 8), x0 = dice_int(0, size - 2), y0 = dice_int(0, size - 2);
            const double lowest = dice(-11000, 9000);
            check_square(&s, (rqt_square){x0, y0, side}, lowest, lowest + dice(0, 6000));
        }
        scene_free(&s);
    }
}

int main(void) {
    if (getenv("RQT_SEED")) seed = strtoull(getenv("RQT_SEED"), NULL, 0);
    printf("RQT_SEED=%llu\n", (unsigned long long)seed);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_sample_of_a_cell_is_within_its_relief),
        cmocka_unit_test(relief_that_cannot_be_is_damage),
        cmocka_unit_test(samples_of_a_square_are_in_its_prism),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
