/* test_tiles_search.c - which tiles of quantized-mesh a terrain with voids has takes time to find. A search that is
 * interrupted goes on when it is asked again, and its end is what it would have been, byte for byte; the tiles
 * below the first level do not wait for it. */
#include "test_store_support.h"

#include "../src/tiles/tiles.h"

enum { SIDE = 300, BLOCK = 4 };
typedef enum pattern { SCATTERED, CHECKERED, DISCS, STRIPES, PATTERNS } pattern;
static const char *const names[PATTERNS] = {"scattered", "checkered", "discs", "stripes"};

static bool is_void(pattern p, int x, int y) {
    switch (p) {
    case SCATTERED:
        return (x * 7919 + y * 104729) % 997 % 40 == 0;
    case CHECKERED:
        return (x + y) % 2 == 0;
    case DISCS:
        return (x % 90 - 45) * (x % 90 - 45) + (y % 70 - 35) * (y % 70 - 35) < 900;
    default:
        return (x + 2 * y) % 37 < 30;
    }
}

/* 1/8 of a degree a sample: it crosses the antimeridian, so that searches have more than one range. */
static sqlite3 *make_terrain(pattern p) {
    raster r = make_raster(SIDE, SIDE, 3, false);
    free(r.valid);
    r.valid = malloc(SIDE * SIDE);
    assert_non_null(r.valid);
    for (int i = 0; i < SIDE * SIDE; i++) r.valid[i] = !is_void(p, i % SIDE, i / SIDE);
    sqlite3 *db = open_database(":memory:");
    run(db, "BEGIN IMMEDIATE");
    assert_int_equal(write_terrain(db, &r, "t", BLOCK, false, true, NULL), SQLITE_OK);
    run(db, "UPDATE rqt_terrain SET srid = 4326, lonlat = 1, wgs84 = 1, x0 = 160.03, y0 = 40.02, dx = 0.125, "
            "dy = -0.125");
    run(db, "COMMIT");
    raster_free(&r);
    return db;
}

static int budget, asked;
static int is_over(void *unused) {
    (void)unused;
    return ++asked > budget;
}

enum { QUESTIONS = 3 };
/* layer.json and both tiles of level 0, which have all others in them. */
static int ask_tiles(tiles *t, int question, tile_bytes *out) {
    char *error = NULL;
    int code = tiles_begin(t, tile_kinds[0], "t", &error);
    if (code == SQLITE_OK) {
        code = question == 0 ? tiles_document(t, "", 0, tiles_finest(t), out, &error)
                             : tiles_make(t, 0, 0, question - 1, 0, out, &error);
        tiles_end(t);
    }
    CHECK(code == SQLITE_OK || code == SQLITE_INTERRUPT, "%d: %s", code, error ? error : "");
    sqlite3_free(error);
    return code;
}

static void ask_all(sqlite3 *db, tile_bytes out[QUESTIONS]) {
    tiles *t;
    assert_int_equal(tiles_open(db, &t), SQLITE_OK);
    for (int q = 0; q < QUESTIONS; q++) {
        assert_int_equal(ask_tiles(t, q, &out[q]), SQLITE_OK);
        assert_true(out[q].size > 0);
    }
    tiles_close(t);
}

static void check_equal(const tile_bytes *a, const tile_bytes *b, pattern p, int question, int steps) {
    CHECK(a->size == b->size && memcmp(a->bytes, b->bytes, a->size) == 0,
          "%s: answer %d is another after %d interruptions", names[p], question, steps);
}

/* What any search can be interrupted at, from the first instruction on, and with too little for anything. */
static void a_search_goes_on_where_it_was_interrupted(void **unused) {
    (void)unused;
    int kept = 0;
    for (pattern p = 0; p < PATTERNS; p++) {
        sqlite3 *db = make_terrain(p);
        tile_bytes whole[QUESTIONS], parts;
        ask_all(db, whole);
        for (int first = 0; first < QUESTIONS; first++) {
            tiles *t;
            int code, steps = 0;
            assert_int_equal(tiles_open(db, &t), SQLITE_OK);
            sqlite3_progress_handler(db, 4, is_over, NULL);
            budget = 30 * first;
            do { /* it grows slowly, so that all is interrupted many times */
                asked = 0;
                code = ask_tiles(t, first, &parts);
                if (code == SQLITE_OK) break;
                kept += tiles_goes_on(t);
                budget += 1 + (int)(steps % 50 == 49) * 25;
                assert_true(++steps < 20000);
            } while (true);
            sqlite3_progress_handler(db, 0, NULL, NULL);
            assert_true(steps > 10);
            check_equal(&parts, &whole[first], p, first, steps);
            sqlite3_free(parts.bytes);
            for (int q = 0; q < QUESTIONS; q++) { /* and what is kept is right for the others too */
                assert_int_equal(ask_tiles(t, q, &parts), SQLITE_OK);
                check_equal(&parts, &whole[q], p, q, steps);
                sqlite3_free(parts.bytes);
            }
            tiles_close(t);
        }
        for (int q = 0; q < QUESTIONS; q++) sqlite3_free(whole[q].bytes);
        sqlite3_close(db);
    }
    print_message("%d times gone on with\n", kept);
    assert_true(kept > 500);
}

/* With a budget, the same each time, that a whole search takes many times over. */
static void the_same_time_again_and_again_is_enough(void **unused) {
    (void)unused;
    for (pattern p = 0; p < PATTERNS; p++) {
        sqlite3 *db = make_terrain(p);
        tile_bytes whole[QUESTIONS], parts;
        tiles *t;
        ask_all(db, whole);
        assert_int_equal(tiles_open(db, &t), SQLITE_OK);
        sqlite3_progress_handler(db, 1, is_over, NULL);
        budget = INT32_MAX;
        asked = 0;
        assert_int_equal(ask_tiles(t, 0, &parts), SQLITE_OK);
        sqlite3_free(parts.bytes);
        tiles_close(t);
        const int all = asked;
        budget = all / 4;
        assert_int_equal(tiles_open(db, &t), SQLITE_OK);
        int steps = 0, code;
        do {
            asked = 0;
            code = ask_tiles(t, 0, &parts);
            if (code != SQLITE_OK) assert_true(tiles_goes_on(t));
            assert_true(++steps < 100);
        } while (code != SQLITE_OK);
        sqlite3_progress_handler(db, 0, NULL, NULL);
        assert_true(steps > 3);
        check_equal(&parts, &whole[0], p, 0, steps);
        sqlite3_free(parts.bytes);
        for (int q = 0; q < QUESTIONS; q++) sqlite3_free(whole[q].bytes);
        tiles_close(t);
        sqlite3_close(db);
    }
}

/* The first question for a tile below the first level takes a small part of what the search does, after it. */
static void other_tiles_do_not_wait_for_it(void **unused) {
    (void)unused;
    sqlite3 *db = make_terrain(SCATTERED);
    tile_bytes bytes;
    tiles *t;
    char *error = NULL;
    assert_int_equal(tiles_open(db, &t), SQLITE_OK);
    sqlite3_progress_handler(db, 1, is_over, NULL);
    budget = INT32_MAX;
    assert_int_equal(tiles_begin(t, tile_kinds[0], "t", &error), SQLITE_OK);
    asked = 0;
    assert_int_equal(tiles_make(t, 0, 5, 62, 19, &bytes, &error), SQLITE_OK);
    const int of_tile = asked;
    assert_true(bytes.size > 0);
    sqlite3_free(bytes.bytes);
    tiles_end(t);
    asked = 0;
    assert_int_equal(ask_tiles(t, 0, &bytes), SQLITE_OK);
    const int of_search = asked;
    sqlite3_free(bytes.bytes);
    sqlite3_progress_handler(db, 0, NULL, NULL);
    print_message("instructions of a tile %d, of the search %d\n", of_tile, of_search);
    assert_true(of_tile < of_search / 4);
    tiles_close(t);
    sqlite3_close(db);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_search_goes_on_where_it_was_interrupted),
        cmocka_unit_test(the_same_time_again_and_again_is_enough),
        cmocka_unit_test(other_tiles_do_not_wait_for_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
