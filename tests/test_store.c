/* test_store.c - promises of the store: what is written is what is read, what is read is never old, and check finds
 * what is wrong. Damage, faults and hostile rows are test_store_faults.c's.
 *
 * The terrain of most damage is 40 x 33 samples in blocks of k = 2: levels 0 to 4. Block 268 is cell (2,2) of the
 * finest level, samples 8 to 12 both ways; 67 is its parent, 269 and 270 its eastern and southern neighbours. */
#include "test_store_support.h"

enum { K = 2, CENTER = 12, FINE = 6, EAST = 9, SOUTH = 21 }; /* places in a grid of 5 x 5 */

/* ------------------------------------------------------------------------------------------------- check */

static void sound_terrains_have_no_findings(void **state) {
    (void)state;
    static const struct {
        int width, height, k;
    } sizes[] = {{1, 1, 0},   {2, 2, 0},    {1, 5, 1},    {5, 1, 2},   {18, 7, 1},  {18, 7, 3}, {65, 65, 4},
                 {65, 65, 6}, {100, 40, 3}, {33, 129, 2}, {40, 33, 2}, {17, 66, 1}, {3, 64, 2}};
    for (size_t n = 0; n < sizeof sizes / sizeof *sizes; n++)
        for (int voids = 0; voids < 2; voids++) {
            sqlite3 *db = memory_terrain(sizes[n].width, sizes[n].height, sizes[n].k, voids);
            findings f;
            assert_int_equal(check_terrain(db, &f), SQLITE_OK);
            if (f.count) print_findings(&f);
            CHECK(f.count == 0, "%d x %d, k %d, voids %d: %d findings", sizes[n].width, sizes[n].height, sizes[n].k,
                  voids, f.count);
            assert_int_equal(sqlite3_close(db), SQLITE_OK);
        }
}

static void height_of_parent(rqt_block *b) {
    b->q[CENTER]++;
}
static void height_of_east(rqt_block *b) {
    b->q[EAST]++;
}
static void height_of_south(rqt_block *b) {
    b->q[SOUTH]++;
}
static void height_inside(rqt_block *b) {
    b->q[FINE] += 1000;
}
static void error_of_parent(rqt_block *b) {
    b->error[CENTER]++;
}
static void error_of_east(rqt_block *b) {
    b->error[EAST]++;
}
static void error_too_small(rqt_block *b) {
    b->error[FINE] = 0;
}
static void error_unsaturated(rqt_block *b) {
    b->error[CENTER] = 1;
}
static void error_too_large(rqt_block *b) {
    b->error[FINE] = 60000;
}
static void error_infinite(rqt_block *b) {
    b->error[FINE] = RQT_CODE_INFINITY;
}
static void vertex_dropped(rqt_block *b) {
    assert_true(b->error[EAST] > b->floor);
    b->error[EAST] = 0;
    b->flags[EAST] = RQT_VALID;
}
static void floor_lower(rqt_block *b) {
    b->floor--;
}
static void not_sparse(rqt_block *b) {
    b->sparse = false;
    b->floor = 0;
}
static void error_of_root_corner(rqt_summary *s) {
    s->corner[0].error = RQT_CODE_LARGEST;
}
static void outline_of_parent(rqt_block *b) {
    b->flags[CENTER] ^= RQT_OUTLINE;
}
static void outline_of_east(rqt_block *b) {
    b->flags[EAST] ^= RQT_OUTLINE;
}
static void outline_unsaturated(rqt_block *b) {
    b->flags[FINE] |= RQT_OUTLINE;
}
static void void_without_outline(rqt_block *b) {
    b->flags[FINE] = 0;
}
static void outline_of_root_corner(rqt_summary *s) {
    s->corner[1].flags ^= RQT_OUTLINE;
}
static void narrower(rqt_block *b) {
    b->width = 3;
}

static void em_tol(rqt_summary *s) {
    s->tol.em++;
}
static void em_exact(rqt_summary *s) {
    s->exact.em++;
}
static void em_parent_tol(rqt_summary *s) {
    s->tol.em_parent--;
}
static void em_parent_exact(rqt_summary *s) {
    s->exact.em_parent--;
}
static void center_error(rqt_summary *s) {
    s->center_error ^= 1;
}
static void center_flags(rqt_summary *s) {
    s->center_flags ^= RQT_OUTLINE;
}
static void corner_height(rqt_summary *s) {
    s->corner[1].q++;
}
static void corner_error(rqt_summary *s) {
    s->corner[2].error++;
}
static void corner_flags(rqt_summary *s) {
    s->corner[3].flags ^= RQT_OUTLINE;
}
static void far_height(rqt_summary *s) {
    s->far[0].q++;
}
static void far_error(rqt_summary *s) {
    s->far[1].error ^= 1;
}
static void far_flags(rqt_summary *s) {
    s->far[1].flags ^= RQT_OUTLINE;
}

typedef struct damage {
    rqt_block_number number; /* which block is damaged; 0 with SQL */
    void (*block)(rqt_block *);
    void (*summary)(rqt_summary *);
    const char *sql;
    rqt_block_number told; /* which block the finding names */
    const char *says;
    double quantum; /* 0: the terrain's */
} damage;

#define BLOCK(number, edit, told, says) \
    { number, edit, NULL, NULL, told, says, 0 }
#define SUMMARY(number, edit, told, says) \
    { number, NULL, edit, NULL, told, says, 0 }
#define SQL(statement, told, says) \
    { 0, NULL, NULL, statement, told, says, 0 }

static const damage damages[] = {
    BLOCK(268, height_of_parent, 268, "its parent, block 67, about the height at (10,10)"),
    BLOCK(268, height_of_east, 268, "its eastern neighbour, block 269, about the height at (12,9)"),
    BLOCK(268, height_of_south, 268, "its southern neighbour, block 270, about the height at (9,12)"),
    BLOCK(268, height_inside, 268, "an error smaller than what its vertex itself is off: at (9,9)"),
    BLOCK(268, error_of_parent, 268, "its parent, block 67, about the error"),
    BLOCK(268, error_of_east, 268, "its eastern neighbour, block 269, about the error"),
    BLOCK(268, error_too_small, 268, "an error smaller than what its vertex itself is off: at (9,9)"),
    BLOCK(268, error_unsaturated, 268,
          "a vertex with less error or outline than one that depends on it: at (10,10)"),
    BLOCK(268, error_too_large, 268, "a vertex with less error or outline"),
    BLOCK(268, error_too_large, 67, "has em "),
    BLOCK(268, error_too_large, 0, "has max_error "),
    BLOCK(268, error_infinite, 268, "infinite"),
    BLOCK(67, vertex_dropped, 269, "its parent, block 67, about the error at (16,10)"),
    BLOCK(67, floor_lower, 67, "has the floor "),
    BLOCK(67, not_sparse, 67, "does not fit its place: it keeps all vertices"),
    SUMMARY(1, error_of_root_corner, 1, "infinite"),
    BLOCK(268, outline_of_parent, 268, "its parent, block 67, about the flags"),
    BLOCK(268, outline_of_east, 268, "its eastern neighbour, block 269, about the flags"),
    BLOCK(268, outline_unsaturated, 268, "a vertex with less error or outline than one that depends on it"),
    BLOCK(268, outline_unsaturated, 67, "for outline exact"),
    BLOCK(268, void_without_outline, 268, "between data and void without outline bit"),
    BLOCK(268, void_without_outline, 0, "has voids 0 in its row; its blocks say 1"),
    BLOCK(268, narrower, 268, "does not fit its place: k 2, 3 x 5 heights"),
    {268, NULL, NULL, NULL, 268, "has the height quantum 0.5, the terrain has 0.25", 0.5},

    SUMMARY(67, em_tol, 67, "for outline tol"),
    SUMMARY(67, em_exact, 67, "for outline exact"),
    SUMMARY(67, em_tol, 268, "another em_parent than its parent has em"),
    SUMMARY(67, em_tol, 67, "interval of outline tol in the index"),
    SUMMARY(268, em_parent_tol, 268, "another em_parent than its parent has em"),
    SUMMARY(268, em_parent_exact, 268, "another em_parent than its parent has em"),
    SUMMARY(1, em_parent_tol, 1, "another em_parent"),
    SUMMARY(268, em_tol, 268, "for outline tol"),
    SUMMARY(268, center_error, 268, "another centre"),
    SUMMARY(67, center_flags, 67, "another centre"),
    SUMMARY(268, corner_height, 268, "another north-east corner"),
    SUMMARY(67, corner_error, 67, "its southern neighbour, block 73, about the error"),
    SUMMARY(67, corner_flags, 67, "its southern neighbour, block 73, about the flags"),
    SUMMARY(268, far_height, 268, "another far vertex 0 in its summary than the data of block 67"),
    SUMMARY(268, far_error, 268, "another far vertex 1"),
    SUMMARY(268, far_flags, 268, "another far vertex 1"),
    SUMMARY(1, far_flags, 1, "is the root, yet has far vertex 1"),

    SQL("DELETE FROM rqt_block_1 WHERE id = 268", 268, "is missing: it has no row"),
    SQL("DELETE FROM rqt_block_1 WHERE id = 1", 1, "is missing: it has no row"),
    SQL("DELETE FROM rqt_block_1 WHERE id = 268", 0, "has blocks "),
    SQL("DELETE FROM rqt_block_1 WHERE id = 268", 0, "has bytes "),
    SQL("UPDATE rqt_block_1 SET data = x'00' WHERE id = 268", 268, "does not decode: not a block"),
    SQL("UPDATE rqt_block_1 SET data = substr(data, 1, length(data) - 1) WHERE id = 67", 67, "does not decode: "),
    SQL("UPDATE rqt_block_1 SET data = 'text' WHERE id = 268", 268, "does not decode: "),
    SQL("UPDATE rqt_block_1 SET data = x'' WHERE id = 268", 268, "does not decode: "),
    SQL("UPDATE rqt_block_1 SET summary = x'' WHERE id = 268", 268, "damaged summary"),
    SQL("UPDATE rqt_block_1 SET summary = zeroblob(80) WHERE id = 268", 268, "damaged summary"),
    SQL("INSERT INTO rqt_block_1 SELECT 100000, summary, data FROM rqt_block_1 WHERE id = 268", 100000,
        "has a row in the block table, but the terrain has no such block"),
    SQL("INSERT INTO rqt_block_1 SELECT 17 * 16 + 240, summary, data FROM rqt_block_1 WHERE id = 268", 512,
        "the terrain has no such block"),
    SQL("UPDATE rqt_block_1 SET data = (SELECT data FROM rqt_block_1 WHERE id = 269) WHERE id = 268", 268,
        "about the height"),
    SQL("CREATE TEMP TABLE two AS SELECT id, data FROM rqt_block_1 WHERE id IN (268, 290);"
        "UPDATE rqt_block_1 SET data = (SELECT data FROM two WHERE two.id != rqt_block_1.id)"
        " WHERE id IN (268, 290); DROP TABLE two",
        290, "about the height"),
    SQL("DELETE FROM rqt_index_1 WHERE id = 268", 268, "is missing in the index"),
    SQL("UPDATE rqt_index_1 SET x1 = x1 + 1 WHERE id = 268", 268, "another extent in the index"),
    SQL("UPDATE rqt_index_1 SET y0 = y0 - 1 WHERE id = 67", 67, "another extent in the index"),
    SQL("UPDATE rqt_index_1 SET tol1 = tol1 + 1 WHERE id = 268", 268,
        "another interval of outline tol in the index"),
    SQL("UPDATE rqt_index_1 SET exact0 = exact0 - 1 WHERE id = 67", 67,
        "another interval of outline exact in the index"),
    SQL("INSERT INTO rqt_index_1 VALUES(5000, 0, 4, 0, 4, 0, 1, 0, 1)", 5000, "has a row in the index, but"),
    SQL("DELETE FROM rqt_index_1_rowid WHERE rowid = 268", 0, "has a damaged index: "),
    SQL("DROP TABLE rqt_index_1", 0, "cannot be read: its index: no such table"),
    SQL("DROP TABLE rqt_block_1", 0, "cannot be read: its block table: no such table"),
    SQL("UPDATE rqt_terrain SET blocks = blocks + 1", 0, "has blocks "),
    SQL("UPDATE rqt_terrain SET bytes = bytes - 1", 0, "has bytes "),
    SQL("UPDATE rqt_terrain SET voids = 7", 0, "has voids 7 in its row; its blocks say 0"),
    SQL("UPDATE rqt_terrain SET min_q = min_q - 1", 0, "has min_q "),
    SQL("UPDATE rqt_terrain SET max_q = max_q + 1", 0, "has max_q "),
    SQL("UPDATE rqt_terrain SET max_error = max_error - 1", 0, "has max_error "),
    SQL("UPDATE rqt_terrain SET d = 8", 268, "has the height quantum 0.25, the terrain has 0.125"),
    SQL("UPDATE rqt_terrain SET complete = 0", 0, "is incomplete"),
};

static void do_damage(sqlite3 *db, const damage *d) {
    if (d->sql)
        run(db, "%s", d->sql);
    else if (d->summary)
        edit_summary(db, d->number, d->summary);
    else
        edit_block(db, d->number, K, d->block, d->quantum > 0 ? d->quantum : test_quantum);
}

static void every_damage_is_found_where_it_is(void **state) {
    (void)state;
    for (size_t n = 0; n < sizeof damages / sizeof *damages; n++) {
        sqlite3 *db = memory_terrain(40, 33, K, false);
        do_damage(db, &damages[n]);
        findings f;
        assert_int_equal(check_terrain(db, &f), SQLITE_OK);
        if (!has_finding(&f, damages[n].told, damages[n].says)) print_findings(&f);
        CHECK(has_finding(&f, damages[n].told, damages[n].says), "damage %zu: no finding at block %llu says: %s", n,
              (unsigned long long)damages[n].told, damages[n].says);
        assert_int_equal(sqlite3_close(db), SQLITE_OK);
    }
}

static void incomplete_is_the_only_finding_of_an_incomplete_terrain(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(40, 33, K, false);
    findings f;
    run(db, "UPDATE rqt_terrain SET voids = 1");
    assert_int_equal(check_terrain(db, &f), SQLITE_OK);
    assert_int_equal(f.count, 1);
    assert_string_equal(f.list[0].severity, "error");
    run(db, "UPDATE rqt_terrain SET complete = 0");
    assert_int_equal(check_terrain(db, &f), SQLITE_OK);
    assert_int_equal(f.count, 1);
    assert_string_equal(f.list[0].severity, "error");
    assert_true(has_finding(&f, 0, "is incomplete"));
    sqlite3_close(db);
}

static void an_outline_bit_that_is_lost_beside_a_void_is_found(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(40, 33, K, true);
    findings f;
    /* the void around (13,11) begins with (10,11), in the middle of block 268 */
    edit_block(db, 268, K, outline_of_parent, test_quantum);
    assert_int_equal(check_terrain(db, &f), SQLITE_OK);
    assert_true(has_finding(&f, 268, "its parent, block 67, about the flags"));
    assert_true(has_finding(&f, 268, "less error or outline"));
    sqlite3_close(db);

    db = memory_terrain(40, 33, K, true); /* the root's centre has one, and its north-east corner must */
    edit_summary(db, 1, outline_of_root_corner);
    assert_int_equal(check_terrain(db, &f), SQLITE_OK);
    assert_true(has_finding(&f, 1, "less error or outline than one that depends on it: at (64,0)"));
    sqlite3_close(db);
}

static void a_block_that_answers_nothing_must_not_be_indexed(void **state) {
    (void)state;
    sqlite3 *db = open_database(":memory:");
    raster r = make_raster(40, 33, 1, false);
    char *error = NULL;
    findings f;
    memset(r.q, 0, sizeof *r.q * 40 * 33);
    run(db, "BEGIN IMMEDIATE");
    assert_int_equal(write_terrain(db, &r, "t", K, false, true, &error), SQLITE_OK);
    run(db, "COMMIT");
    assert_string_equal(ask(db, "SELECT group_concat(id) FROM rqt_index_1"), "1");
    assert_int_equal(check_terrain(db, &f), SQLITE_OK);
    assert_int_equal(f.count, 0);
    run(db, "INSERT INTO rqt_index_1 VALUES(268, 8, 12, 8, 12, 0, 1, 65536, 65536)");
    assert_int_equal(check_terrain(db, &f), SQLITE_OK);
    assert_true(has_finding(&f, 268, "answers nothing, yet has a row in the index"));
    raster_free(&r);
    sqlite3_close(db);
}

static void check_stops_when_told_to_and_lets_the_connection_close(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(40, 33, K, false);
    findings f = {.most = 2};
    store *s;
    const store_terrain *t;
    char *error = NULL;
    run(db, "DELETE FROM rqt_index_1");
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    assert_int_equal(store_find(s, "t", &t, &error), SQLITE_OK);
    assert_int_equal(store_check(s, t, add_finding, &f, &error), SQLITE_OK);
    assert_int_equal(f.count, 2);
    run(db, "VACUUM");
    store_close(s);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
}

/* ---------------------------------------------------------------------------------------- finding terrains */

static void expect_find(store *s, const char *name, const char *schema, const char *found, const char *sentence) {
    const store_terrain *t = NULL;
    char *error = NULL;
    const int code = store_find(s, name, &t, &error);
    if (found) {
        CHECK(code == SQLITE_OK, "%s: %s", name ? name : "NULL", error ? error : "no sentence");
        assert_string_equal(t->name, found);
        assert_string_equal(t->schema, schema);
    } else {
        assert_int_equal(code, SQLITE_ERROR);
        assert_null(t);
        assert_non_null(error);
        CHECK(strcmp(error, sentence) == 0, "it says: %s", error);
    }
    sqlite3_free(error);
}

static void a_terrain_is_found_by_name_or_the_sentence_says_what_there_is(void **state) {
    (void)state;
    sqlite3 *db = open_database(":memory:");
    store *s;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    expect_find(s, NULL, NULL, NULL, "this database holds no terrain; rqt import makes one");
    expect_find(s, "a", NULL, NULL, "this database holds no terrain; rqt import makes one");
    put_terrain(db, "a", 5, 5, 2, 1, false);
    expect_find(s, NULL, "main", "a", NULL);
    expect_find(s, "a", "main", "a", NULL);
    expect_find(s, "main.a", "main", "a", NULL);
    expect_find(s, "b", NULL, NULL, "there is no terrain b; there is a");
    put_terrain(db, "b.c", 5, 5, 2, 1, false);
    expect_find(s, NULL, NULL, NULL, "which terrain? There are 2: a, b.c");
    expect_find(s, "b.c", "main", "b.c", NULL);
    expect_find(s, "A", NULL, NULL, "there is no terrain A; there is a, b.c");
    expect_find(s, "", NULL, NULL, "there is no terrain ; there is a, b.c");

    /* an attached database, its schema, and main before all others */
    char path[128];
    sqlite3 *other = open_database(scratch_file(path, "attached.db"));
    put_terrain(other, "a", 5, 5, 2, 2, false);
    put_terrain(other, "d", 5, 5, 2, 2, false);
    sqlite3_close(other);
    run(db, "ATTACH %Q AS north", path);
    run(db, "ATTACH %Q AS \"so\"\"uth\"", path);
    expect_find(s, "a", "main", "a", NULL);
    expect_find(s, "north.a", "north", "a", NULL);
    expect_find(s, "so\"uth.d", "so\"uth", "d", NULL);
    expect_find(s, "d", NULL, NULL, "terrain d is in 2 databases; say which as database.d");
    run(db, "DETACH \"so\"\"uth\"");
    expect_find(s, "d", "north", "d", NULL);
    const answer near = query_store(s, "a", 0, by_threshold, NULL),
                 far = query_store(s, "north.a", 0, by_threshold, NULL);
    assert_int_equal(near.code, SQLITE_OK);
    assert_int_equal(far.code, SQLITE_OK);
    assert_true(near.hash != far.hash);
    run(db, "DETACH north");
    expect_find(s, "d", NULL, NULL, "there is no terrain d; there is a, b.c");

    run(db, "UPDATE rqt_terrain SET complete = 0 WHERE name = 'a'");
    expect_find(s, "a", NULL, NULL, "terrain a is incomplete: its import did not finish");
    store_terrain *all;
    int count;
    assert_int_equal(store_terrains(s, &all, &count, NULL), SQLITE_OK);
    assert_int_equal(count, 2);
    assert_string_equal(all[0].name, "a");
    assert_false(all[0].complete);
    assert_true(all[1].complete);
    store_terrains_free(all, count);
    store_close(s);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
    remove_database(path);
}

/* --------------------------------------------------------------------------------------- windows and heights */

static void a_window_is_the_raster(void **state) {
    (void)state;
    static const struct {
        int width, height, k;
    } sizes[] = {{2, 2, 0}, {1, 5, 1}, {5, 1, 2}, {1, 1, 0}, {18, 7, 2}, {40, 33, 3}};
    for (size_t n = 0; n < sizeof sizes / sizeof *sizes; n++) {
        const int w = sizes[n].width, h = sizes[n].height;
        sqlite3 *db = memory_terrain(w, h, sizes[n].k, true);
        raster r = make_raster(w, h, 1, true);
        store *s;
        const store_terrain *t;
        int32_t *q = malloc(sizeof *q * (size_t)(w * h));
        uint8_t *valid = malloc((size_t)(w * h));
        assert_true(q && valid);
        assert_int_equal(store_open(db, &s), SQLITE_OK);
        assert_int_equal(store_find(s, "t", &t, NULL), SQLITE_OK);
        for (int col = 0; col < w; col += 1 + w / 7)
            for (int row = 0; row < h; row += 1 + h / 7)
                for (int across = 1; across <= w - col; across += 1 + w / 5) {
                    const int down = h - row > 3 && across % 2 ? 3 : h - row;
                    assert_int_equal(store_window(s, t, col, row, across, down, q, valid, NULL), SQLITE_OK);
                    for (int i = 0; i < across * down; i++) {
                        const int at = (row + i / across) * w + col + i % across;
                        assert_int_equal(valid[i], r.valid[at]);
                        if (valid[i]) assert_int_equal(q[i], r.q[at]);
                    }
                }
        static const int wrong[][4] = {{-1, 0, 1, 1},
                                       {0, -1, 1, 1},
                                       {0, 0, 0, 1},
                                       {0, 0, 1, 0},
                                       {0, 0, 41, 1},
                                       {0, 0, 1, 34},
                                       {40, 0, 1, 1},
                                       {0, 33, 1, 1},
                                       {1, 1, INT32_MAX, INT32_MAX},
                                       {INT32_MAX, INT32_MAX, 1, 1},
                                       {INT32_MIN, 0, 1, 1}};
        for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
            char *error = NULL;
            assert_int_equal(
                store_window(s, t, wrong[i][0], wrong[i][1], wrong[i][2], wrong[i][3], q, valid, &error),
                SQLITE_ERROR);
            assert_non_null(error);
            sqlite3_free(error);
        }
        free(q);
        free(valid);
        raster_free(&r);
        store_close(s);
        sqlite3_close(db);
    }
}

typedef struct probe {
    store *s;
    const store_terrain *t;
    const raster *r;
} probe;

static bool height_at(const probe *p, double col, double row, double eps, double *metres) {
    bool found = false;
    char *error = NULL;
    const int code = store_height(p->s, p->t, 1000 + 10 * col, 2000 - 10 * row, eps, metres, &found, &error);
    CHECK(code == SQLITE_OK, "(%g,%g): %s", col, row, error ? error : "");
    return found;
}

static double metres_of(const probe *p, int col, int row) {
    return rqt_unit_metres(&test_unit, p->r->q[row * p->r->width + col]);
}

static bool is_valid(const probe *p, int col, int row) {
    return !p->r->valid || p->r->valid[row * p->r->width + col];
}

/* Of the four corners of a half cell's square, in the plane that the lattice gives: written out here again. */
static void check_half_cells(const probe *p, double fx, double fy) {
    for (int y = 0; y + 1 < p->r->height; y++) {
        for (int x = 0; x + 1 < p->r->width; x++) {
            int corners[3][2]; /* of the triangle, apex first; a = apex's opposite offsets */
            const bool main_diagonal = (x + y) % 2 == 0;
            const bool upper = main_diagonal ? fx > fy : fx + fy < 1;
            const int ax = main_diagonal ? x + upper : x + !upper, ay = main_diagonal ? y + !upper : y + !upper;
            const int px = main_diagonal ? ax : 2 * x + 1 - ax, qy = main_diagonal ? ay : 2 * y + 1 - ay;
            const int across[2] = {main_diagonal ? 2 * x + 1 - ax : px, ay},
                      down[2] = {ax, main_diagonal ? 2 * y + 1 - ay : qy};
            memcpy(corners, (int[3][2]){{ax, ay}, {across[0], across[1]}, {down[0], down[1]}}, sizeof corners);
            double got, wanted = 0;
            const bool found = height_at(p, x + fx, y + fy, -1, &got);
            bool valid = true;
            for (int c = 0; c < 3; c++) valid = valid && is_valid(p, corners[c][0], corners[c][1]);
            assert_int_equal(found, valid);
            if (!valid) continue;
            const double z = metres_of(p, ax, ay);
            wanted = z + fabs(x + fx - ax) * (metres_of(p, across[0], across[1]) - z) +
                     fabs(y + fy - ay) * (metres_of(p, down[0], down[1]) - z);
            CHECK(fabs(got - wanted) < 1e-5, "(%g,%g): %.9g instead of %.9g", x + fx, y + fy, got, wanted);
        }
    }
}

static void heights_are_the_planes_of_the_full_raster_or_of_the_mesh(void **state) {
    (void)state;
    for (int voids = 0; voids < 2; voids++) {
        sqlite3 *db = memory_terrain(18, 11, 2, voids);
        raster r = make_raster(18, 11, 1, voids);
        probe p = {NULL, NULL, &r};
        double metres, mesh;
        assert_int_equal(store_open(db, &p.s), SQLITE_OK);
        assert_int_equal(store_find(p.s, "t", &p.t, NULL), SQLITE_OK);
        for (int y = 0; y < 11; y++) /* at samples, borders included */
            for (int x = 0; x < 18; x++) {
                assert_int_equal(height_at(&p, x, y, -1, &metres), is_valid(&p, x, y));
                if (is_valid(&p, x, y)) assert_true(fabs(metres - metres_of(&p, x, y)) < 1e-9);
            }
        check_half_cells(&p, 0.25, 0.5);
        check_half_cells(&p, 0.5, 0.375);
        check_half_cells(&p, 0.75, 0.875);
        for (int i = 0; i < 400; i++) { /* by eps: the mesh is never further off than eps */
            const int x = (int)(noise((uint32_t)i, 1, 9) % 18), y = (int)(noise((uint32_t)i, 2, 9) % 11);
            const double eps[] = {0, 1, 4, 100};
            for (int n = 0; n < 4; n++) {
                if (!height_at(&p, x, y, eps[n], &mesh)) {
                    assert_true(voids); /* samples that are in no half cell are in no mesh */
                    continue;
                }
                assert_true(is_valid(&p, x, y));
                CHECK(fabs(mesh - metres_of(&p, x, y)) <= eps[n] + 1e-9, "(%d,%d) at %g: %g off", x, y, eps[n],
                      mesh - metres_of(&p, x, y));
            }
            if (height_at(&p, x, y, 0, &mesh)) assert_true(fabs(mesh - metres_of(&p, x, y)) < 1e-9);
        }
        static const double outside[][2] = {{-0.01, 5}, {17.01, 5}, {5, -0.01},
                                            {5, 10.01}, {1e300, 0}, {0, -1e300}};
        for (int i = 0; i < 6; i++) {
            assert_false(height_at(&p, outside[i][0], outside[i][1], -1, &metres));
            assert_false(height_at(&p, outside[i][0], outside[i][1], 1, &metres));
        }
        bool found;
        char *error = NULL;
        assert_int_equal(store_height(p.s, p.t, NAN, 0, -1, &metres, &found, &error), SQLITE_ERROR);
        assert_int_equal(store_height(p.s, p.t, 0, INFINITY, 1, &metres, &found, &error), SQLITE_ERROR);
        assert_int_equal(store_height(p.s, p.t, 1000, 2000, NAN, &metres, &found, &error), SQLITE_ERROR);
        sqlite3_free(error);
        raster_free(&r);
        store_close(p.s);
        sqlite3_close(db);
    }
}

/* The height that the patch of the point gives: in its first triangle. */
static bool height_by_patch(const probe *p, double x, double y, double eps, double *metres) {
    char text[128];
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_message why;
    rqt_patch patch;
    (void)snprintf(text, sizeof text, "POINT(%.17g %.17g)", x, y);
    assert_int_equal(rqt_geometry_parse(text, strlen(text), true, store_allocator(), &geometry, &why), RQT_OK);
    assert_int_equal(rqt_region_create(geometry, &p->t->placement, &p->t->lattice, store_allocator(), &region),
                     RQT_OK);
    assert_int_equal(store_query(p->s, p->t, region, eps, &by_threshold, &patch, NULL, NULL), SQLITE_OK);
    const bool found = patch.triangle_count > 0;
    if (found) {
        const rqt_patch_vertex *a = &patch.vertices[patch.triangles[0]], *b = &patch.vertices[patch.triangles[1]],
                               *c = &patch.vertices[patch.triangles[2]];
        const double col = nearbyint((x - p->t->placement.x0) / p->t->placement.dx * 0x1p20) * 0x1p-20,
                     row = nearbyint((y - p->t->placement.y0) / p->t->placement.dy * 0x1p20) * 0x1p-20;
        const double area =
            (double)(b->col - a->col) * (c->row - a->row) - (double)(c->col - a->col) * (b->row - a->row);
        const double wb = ((col - a->col) * (c->row - a->row) - (c->col - a->col) * (row - a->row)) / area;
        const double wc = ((b->col - a->col) * (row - a->row) - (col - a->col) * (b->row - a->row)) / area;
        const double q = a->q + wb * ((double)b->q - a->q) + wc * ((double)c->q - a->q);
        *metres = ((double)test_unit.z0 + q / (double)test_unit.d) * rqt_unit_factor(&test_unit) + test_unit.offset;
    }
    rqt_patch_free(&patch);
    rqt_region_free(region);
    rqt_geometry_free(geometry);
    return found;
}

/* Straight down to the leaf or through the patch of the point: the same bits. */
static void a_height_is_the_one_of_the_patch_of_the_point(void **state) {
    (void)state;
    static const struct {
        int width, height, k;
    } sizes[] = {{33, 33, 2}, {65, 65, 3}, {40, 29, 3}, {18, 33, 1}, {9, 9, 3}, {2, 2, 0}};
    static const double eps[] = {0, 1, 4, 6, 8, 10, 12, 16, 100, INFINITY};
    for (size_t n = 0; n < 2 * sizeof sizes / sizeof *sizes; n++) {
        const int w = sizes[n / 2].width, h = sizes[n / 2].height;
        sqlite3 *db = memory_terrain(w, h, sizes[n / 2].k, n % 2);
        probe p = {0};
        assert_int_equal(store_open(db, &p.s), SQLITE_OK);
        assert_int_equal(store_find(p.s, "t", &p.t, NULL), SQLITE_OK);
        for (uint32_t i = 0; i < 4000; i++) {
            /* anywhere, on halves and on eighths of a sample, where edges are, and a hair beside them */
            double col = noise(i, 1, 5) * 0x1p-32 * (w - 1), row = noise(i, 2, 5) * 0x1p-32 * (h - 1);
            const double grain = i % 4 == 1 ? 2 : i % 4 == 2 ? 8 : 1;
            if (i % 4) col = floor(col * grain + 0.5) / grain, row = floor(row * grain + 0.5) / grain;
            if (i % 8 == 3) col += (noise(i, 3, 5) % 3 - 1.0) * 0x1p-20;
            const double x = 1000 + 10 * col, y = 2000 - 10 * row, e = eps[noise(i, 4, 5) % 10];
            double got = 0, wanted = 0;
            bool found = false;
            assert_int_equal(store_height(p.s, p.t, x, y, e, &got, &found, NULL), SQLITE_OK);
            const bool right = height_by_patch(&p, x, y, e, &wanted);
            CHECK(found == right && (!found || memcmp(&got, &wanted, sizeof got) == 0),
                  "%d x %d, k %d, (%.9g,%.9g) at %g: %d %.17g, not %d %.17g", w, h, sizes[n / 2].k, col, row, e,
                  found, got, right, wanted);
        }
        store_close(p.s);
        sqlite3_close(db);
    }
}

static void rasters_of_one_row_or_column_have_heights_and_no_mesh(void **state) {
    (void)state;
    for (int tall = 0; tall < 2; tall++) {
        const int w = tall ? 1 : 5, h = tall ? 5 : 1;
        sqlite3 *db = memory_terrain(w, h, 1, false);
        raster r = make_raster(w, h, 1, false);
        probe p = {NULL, NULL, &r};
        double metres;
        assert_int_equal(store_open(db, &p.s), SQLITE_OK);
        assert_int_equal(store_find(p.s, "t", &p.t, NULL), SQLITE_OK);
        for (int i = 0; i < 9; i++) {
            const double at = 0.5 * i;
            assert_true(height_at(&p, tall ? 0 : at, tall ? at : 0, -1, &metres));
            const double wanted =
                (rqt_unit_metres(&test_unit, r.q[i / 2]) + rqt_unit_metres(&test_unit, r.q[(i + 1) / 2])) / 2;
            CHECK(fabs(metres - wanted) < 1e-9, "%d x %d at %g: %g instead of %g", w, h, at, metres, wanted);
            assert_false(height_at(&p, tall ? 0 : at, tall ? at : 0, 0, &metres));
        }
        const answer a = query_store(p.s, "t", 0, by_threshold, NULL);
        assert_int_equal(a.code, SQLITE_OK);
        assert_int_equal(a.triangles, 0);
        raster_free(&r);
        store_close(p.s);
        sqlite3_close(db);
    }
}

/* ------------------------------------------------------------------------------------------------- queries */

static void every_way_of_selecting_gives_one_mesh_and_reads_tell_which_blocks(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(65, 40, 3, true);
    store *s;
    assert_int_equal(store_open(db, &s), SQLITE_OK);
    static const double eps[] = {0, 0.5, 3, 20, INFINITY};
    size_t before = SIZE_MAX;
    for (int n = 0; n < 5; n++) {
        for (int outline = 0; outline < 2; outline++) {
            store_reads reads;
            store_query_options options = {.select = RQT_SELECT_THRESHOLD,
                                           .outline = outline ? RQT_OUTLINE_TOL : RQT_OUTLINE_EXACT};
            const answer a = query_store(s, "t", eps[n], options, &reads);
            CHECK(a.code == SQLITE_OK, "eps %g: %s", eps[n], a.error);
            assert_true(reads.count > 0);
            if (!outline) {
                assert_true(a.triangles > 0 && a.triangles <= before);
                before = a.triangles;
            }
            for (size_t i = 0; i < reads.count; i++) {
                assert_int_equal(reads.rows[i].needs_bytes, reads.rows[i].bytes > 0);
                char *sql =
                    sqlite3_mprintf("SELECT length(data) FROM rqt_block_1 WHERE id = %llu", reads.rows[i].number);
                if (reads.rows[i].needs_bytes) assert_int_equal(reads.rows[i].bytes, atoll(ask(db, sql)));
                sqlite3_free(sql);
            }
            for (options.select = RQT_SELECT_TOP_DOWN; options.select <= RQT_SELECT_BOTTOM_UP; options.select++) {
                store_reads again;
                const answer b = query_store(s, "t", eps[n], options, &again);
                assert_true(same_answer(&a, &b));
                assert_int_equal(again.count, reads.count);
                for (size_t i = 0; i < reads.count; i++) {
                    assert_int_equal(again.rows[i].number, reads.rows[i].number);
                    assert_int_equal(again.rows[i].bytes, reads.rows[i].bytes);
                    assert_int_equal(again.rows[i].selected, reads.rows[i].selected);
                    assert_int_equal(again.rows[i].cached, reads.rows[i].needs_bytes);
                }
                store_reads_free(&again);
            }
            store_reads_free(&reads);
        }
    }
    char *error = NULL;
    answer bad = query_store(s, "t", -1, by_threshold, NULL);
    assert_int_equal(bad.code, SQLITE_ERROR);
    bad = query_store(s, "t", NAN, by_threshold, NULL);
    assert_int_equal(bad.code, SQLITE_ERROR);
    sqlite3_free(error);
    store_close(s);
    sqlite3_close(db);
}

static void a_block_answered_by_its_index_row_is_not_read(void **state) {
    (void)state;
    sqlite3 *db = memory_terrain(65, 40, 3, false);
    const answer right = query_database(db, 1e6, by_threshold);
    assert_int_equal(right.code, SQLITE_OK);
    assert_true(right.triangles > 0);
    run(db, "UPDATE rqt_block_1 SET data = x''");
    const answer blind = query_database(db, 1e6, by_threshold);
    assert_true(same_answer(&right, &blind));
    const answer fine = query_database(db, 0, by_threshold);
    assert_int_equal(fine.code, SQLITE_CORRUPT_VTAB);
    assert_int_equal(fine.triangles, 0);
    sqlite3_close(db);
}

/* ------------------------------------------------------------------------------------------------- writing */

static void names_are_plain(void **state) {
    (void)state;
    static const char *const good[] = {"a", "A-b_c.9",
                                       "123456789012345678901234567890123456789012345678901234567890123"};
    static const char *const bad[] = {"",
                                      "a b",
                                      "a/b",
                                      "\xc3\xa4",
                                      "a'b",
                                      "a\nb",
                                      "1234567890123456789012345678901234567890123456789012345678901234"};
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) assert_true(store_name_is_valid(good[i]));
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) assert_false(store_name_is_valid(bad[i]));
    sqlite3 *db = open_database(":memory:");
    raster r = make_raster(5, 5, 1, false);
    char *error = NULL;
    assert_int_equal(write_terrain(db, &r, "a b", 2, false, true, &error), SQLITE_ERROR);
    assert_string_equal(error, "a b is no name for a terrain: use 1 to 63 of A-Z a-z 0-9 _ . -");
    sqlite3_free(error);
    raster_free(&r);
    sqlite3_close(db);
}

static void replacing_leaves_nothing_of_the_old_terrain(void **state) {
    (void)state;
    sqlite3 *db = open_database(":memory:");
    char *error = NULL;
    assert_int_equal(store_make_geopackage(db, &error), SQLITE_OK);
    put_terrain(db, "other", 5, 5, 2, 3, false);
    put_terrain(db, "t", 40, 33, 2, 1, false);
    raster r = make_raster(18, 7, 2, false);
    assert_int_equal(write_terrain(db, &r, "t", 2, false, true, &error), SQLITE_ERROR);
    assert_string_equal(error, "terrain t exists already; use --replace to replace it");
    sqlite3_free(error);
    raster_free(&r);
    put_terrain(db, "t", 18, 7, 2, 2, false);
    assert_string_equal(ask(db, "SELECT group_concat(name || ' ' || width, ', ') FROM rqt_terrain"),
                        "other 5, t 18");
    /* ids are not used again: what was kept for the old one cannot meet the new one */
    assert_string_equal(ask(db, "SELECT group_concat(name, ' ') FROM (SELECT name FROM sqlite_schema "
                                "WHERE name GLOB 'rqt_block_*' OR name GLOB 'rqt_index_*' ORDER BY name)"),
                        "rqt_block_1 rqt_block_3 rqt_index_1 rqt_index_1_node rqt_index_1_parent rqt_index_1_rowid "
                        "rqt_index_3 rqt_index_3_node rqt_index_3_parent rqt_index_3_rowid");
    assert_string_equal(ask(db, "SELECT group_concat(table_name, ' ') FROM (SELECT table_name FROM gpkg_contents "
                                "ORDER BY table_name)"),
                        "rqt_block_1 rqt_block_3 rqt_terrain");
    assert_string_equal(ask(db, "PRAGMA integrity_check"), "ok");
    sqlite3_close(db);
}

static void a_geopackage_has_its_tables_and_lists_ours(void **state) {
    (void)state;
    char path[128], *error = NULL;
    sqlite3 *db = open_database(scratch_file(path, "new.gpkg"));
    assert_int_equal(store_make_geopackage(db, &error), SQLITE_OK);
    assert_int_equal(store_make_geopackage(db, &error), SQLITE_OK); /* harmless */
    put_terrain(db, "alps", 18, 7, 2, 1, false);
    assert_string_equal(ask(db, "PRAGMA application_id"), "1196444487");
    assert_string_equal(ask(db, "PRAGMA user_version"), "10300");
    assert_string_equal(
        ask(db, "SELECT group_concat(srs_id) FROM (SELECT srs_id FROM gpkg_spatial_ref_sys ORDER BY 1)"),
        "-1,0,4326");
    assert_string_equal(
        ask(db, "SELECT data_type || ': ' || description FROM gpkg_contents WHERE table_name = 'rqt_block_1'"),
        "attributes: rqt: blocks of terrain alps, 18 x 7 samples");
    assert_string_equal(ask(db, "SELECT data_type FROM gpkg_contents WHERE table_name = 'rqt_terrain'"),
                        "attributes");
    assert_string_equal(ask(db, "PRAGMA integrity_check"), "ok");
    assert_string_equal(ask(db, "PRAGMA foreign_key_check"), "");
    sqlite3_close(db);
    remove_database(path);

    db = open_database(":memory:"); /* what is there already stays what it is */
    run(db, "CREATE TABLE mine(x)");
    assert_int_equal(store_make_geopackage(db, &error), SQLITE_OK);
    put_terrain(db, "alps", 18, 7, 2, 1, false);
    assert_string_equal(ask(db, "PRAGMA application_id"), "0");
    assert_string_equal(ask(db, "SELECT count(*) FROM sqlite_schema WHERE name GLOB 'gpkg*'"), "0");
    sqlite3_close(db);
}

static void an_unfinished_terrain_is_there_but_refused(void **state) {
    (void)state;
    sqlite3 *db = open_database(":memory:");
    raster r = make_raster(18, 7, 1, false);
    char *error = NULL;
    findings f;
    assert_int_equal(write_terrain(db, &r, "t", 2, false, false, &error), SQLITE_OK);
    const answer a = query_database(db, 0, by_threshold);
    assert_int_equal(a.code, SQLITE_ERROR);
    assert_string_equal(a.error, "terrain t is incomplete: its import did not finish");
    assert_int_equal(check_terrain(db, &f), SQLITE_OK);
    assert_int_equal(f.count, 1);
    assert_true(has_finding(&f, 0, "is incomplete"));
    put_terrain(db, "u", 18, 7, 2, 1, false);
    assert_string_equal(ask(db, "SELECT count(*) FROM rqt_terrain WHERE complete"), "1");
    raster_free(&r);
    sqlite3_close(db);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sound_terrains_have_no_findings),
        cmocka_unit_test(every_damage_is_found_where_it_is),
        cmocka_unit_test(incomplete_is_the_only_finding_of_an_incomplete_terrain),
        cmocka_unit_test(an_outline_bit_that_is_lost_beside_a_void_is_found),
        cmocka_unit_test(a_block_that_answers_nothing_must_not_be_indexed),
        cmocka_unit_test(check_stops_when_told_to_and_lets_the_connection_close),
        cmocka_unit_test(a_terrain_is_found_by_name_or_the_sentence_says_what_there_is),
        cmocka_unit_test(a_window_is_the_raster),
        cmocka_unit_test(heights_are_the_planes_of_the_full_raster_or_of_the_mesh),
        cmocka_unit_test(a_height_is_the_one_of_the_patch_of_the_point),
        cmocka_unit_test(rasters_of_one_row_or_column_have_heights_and_no_mesh),
        cmocka_unit_test(every_way_of_selecting_gives_one_mesh_and_reads_tell_which_blocks),
        cmocka_unit_test(a_block_answered_by_its_index_row_is_not_read),
        cmocka_unit_test(names_are_plain),
        cmocka_unit_test(replacing_leaves_nothing_of_the_old_terrain),
        cmocka_unit_test(a_geopackage_has_its_tables_and_lists_ours),
        cmocka_unit_test(an_unfinished_terrain_is_there_but_refused),
    };
    return cmocka_run_group_tests_name("store", tests, make_scratch, drop_scratch);
}
