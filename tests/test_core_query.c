/* test_core_query.c - what the blocks hold is what the oracle says, and a query over them is the global mesh.
 *
 * For one raster the whole pyramid of each legal block size is stored as bytes; windows of every kind at eps on and
 * beside stored errors are answered from it, with each way of selecting. The oracle walks the whole terrain, keeps
 * the leaves that meet the window, and the two multisets of triangles must be equal. */
#include "test_core_walk.h"

/* ------------------------------------------------------------------------------------------ blocks -- */

/* Has one of the triangles that have this vertex for a corner an area? All lie within 2^scale of it. */
static bool has_area(const model *m, int x, int y) {
    int reach = 1;
    while (x % (2 * reach) == 0 && y % (2 * reach) == 0 && reach < 1 << m->grid.lattice.K) reach *= 2;
    return reach == 1 << m->grid.lattice.K || (x - reach < m->r.width - 1 && y - reach < m->r.height - 1);
}

/* A vertex without area, past the raster, may err anything up to its true number: nobody asks. */
static void check_vertex(const model *m, int x, int y, int32_t q, rqt_code error, uint8_t flags, const char *what) {
    const oracle_point at = {x, y}, sample = oracle_clamp(&m->o, at);
    const oracle_node *n = oracle_at(&m->o, x, y);
    int valid = oracle_is_valid(&m->o, at), counts = has_area(m, x, y);
    int right = (valid ? RQT_VALID : 0) | (n->outline ? RQT_OUTLINE : 0),
        least = counts ? right : right & RQT_VALID;
    if (error > n->code || (counts && error != n->code)) raster_print(&m->r);
    CHECK((flags & ~right) == 0 && (flags & least) == least, "%s (%d,%d): flags %d, should be %d", what, x, y,
          flags, right);
    CHECK(error <= n->code && (!counts || error == n->code), "%s (%d,%d): error %u, should be %u", what, x, y,
          error, n->code);
    if (valid) CHECK(q == m->r.q[sample.y * m->r.width + sample.x], "%s (%d,%d): height %d", what, x, y, (int)q);
}

/* em of a cell, by looking at every vertex in it. */
static rqt_interval interval_of(const model *m, int k, int level, int i, int j, bool exact) {
    unsigned em[2] = {0, ORACLE_INFINITY};
    for (int up = 0; up < 2 && level - up >= 0; up++) {
        int side = 1 << (m->o.K - level + up), stride = side >> k;
        em[up] = 0;
        for (int y = (j >> up) * side; y <= (j >> up) * side + side; y++) {
            for (int x = (i >> up) * side; x <= (i >> up) * side + side; x++) {
                const oracle_node *n = oracle_at(&m->o, x, y);
                if (x % stride == 0 && y % stride == 0) continue;
                if (exact && n->outline) em[up] = ORACLE_INFINITY;
                if (n->code > em[up]) em[up] = n->code;
            }
        }
    }
    return (rqt_interval){(rqt_code)em[0], (rqt_code)em[1]};
}

static void check_summary(const model *m, int k, const rqt_block_place *p, const rqt_summary *s) {
    const rqt_interval tol = interval_of(m, k, p->level, p->i, p->j, false);
    const rqt_interval exact = interval_of(m, k, p->level, p->i, p->j, true);
    CHECK(s->tol.em == tol.em && s->tol.em_parent == tol.em_parent, "k=%d level %d cell (%d,%d): tol [%u,%u)", k,
          p->level, p->i, p->j, s->tol.em, s->tol.em_parent);
    CHECK(s->exact.em == exact.em && s->exact.em_parent == exact.em_parent,
          "k=%d level %d cell (%d,%d): exact [%u,%u), should be [%u,%u)", k, p->level, p->i, p->j, s->exact.em,
          s->exact.em_parent, exact.em, exact.em_parent);
    for (int n = 0; n < 4; n++)
        check_vertex(m, p->x + (n & 1) * p->side, p->y + (n >> 1) * p->side, s->corner[n].q, s->corner[n].error,
                     s->corner[n].flags, "corner");
    if (k > 0) {
        const oracle_node *c = oracle_at(&m->o, p->x + p->side / 2, p->y + p->side / 2);
        const oracle_point at = {p->x + p->side / 2, p->y + p->side / 2};
        CHECK(s->center_error == c->code, "centre error");
        CHECK(s->center_flags == ((oracle_is_valid(&m->o, at) ? RQT_VALID : 0) | (c->outline ? RQT_OUTLINE : 0)),
              "centre flags");
    } else {
        assert_int_equal(s->center_error, 0);
    }
    if (p->level == 0) {
        const rqt_summary_vertex none = {0, 0, 0};
        for (int n = 0; n < 2; n++)
            assert_true(s->far[n].q == none.q && s->far[n].error == none.error && s->far[n].flags == none.flags);
        return;
    }
    /* the parent's own corner in this cell, and the parent's corners beside it */
    int x = p->x + (p->i & 1) * p->side, y = p->y + (p->j & 1) * p->side;
    check_vertex(m, p->i & 1 ? x - 2 * p->side : x + 2 * p->side, y, s->far[0].q, s->far[0].error, s->far[0].flags,
                 "far 0");
    check_vertex(m, x, p->j & 1 ? y - 2 * p->side : y + 2 * p->side, s->far[1].q, s->far[1].error, s->far[1].flags,
                 "far 1");
}

/* The whole block as it comes from the pyramid; a decoded one where it is kept: where the block can be asked about.
 */
static void check_block(const model *m, int k, const rqt_block_place *p, const rqt_block *b, bool decoded,
                        const char *what) {
    int n = (1 << k) + 1, last = n - 1;
    const rqt_interval tol = interval_of(m, k, p->level, p->i, p->j, false);
    CHECK(b->sparse == (p->stride > 1) && b->floor == (p->stride > 1 ? tol.em : 0), "%s: floor %u, em %u", what,
          b->floor, tol.em);
    assert_int_equal(b->k, k);
    assert_int_equal(b->width, p->width);
    assert_int_equal(b->height, p->height);
    for (int v = 0; v < n; v++)
        for (int u = 0; u < n; u++) {
            const int x = p->x + u * p->stride, y = p->y + v * p->stride, at = v * n + u;
            const oracle_node *node = oracle_at(&m->o, x, y);
            const bool corner = u % last == 0 && v % last == 0;
            if (decoded && p->stride > 1 && !corner && !has_area(m, x, y)) continue;
            if (!decoded || p->stride == 1 || corner || node->outline || node->code > tol.em)
                check_vertex(m, x, y, b->q[at], b->error[at], b->flags[at], what);
            else
                CHECK(b->q[at] == 0 && b->error[at] == 0 && b->flags[at] == RQT_VALID, "%s (%d,%d): is kept", what,
                      x, y);
        }
}

/* The blocks of the pyramid, in order and complete; each as it comes and after a round trip through its bytes. */
static void check_pyramid(const model *m, int k) {
    rqt_pyramid *pyramid;
    rqt_block block;
    database d;
    const rqt_lattice *l = &m->grid.lattice;
    assert_int_equal(rqt_pyramid_create(&m->grid, &m->saturated, k, &test_allocator, &pyramid), RQT_OK);
    assert_int_equal(rqt_block_create(k, &test_allocator, &block), RQT_OK);
    assert_int_equal(database_create(&d, m, k, &test_allocator), RQT_OK);
    size_t at = 0;
    assert_int_equal(rqt_block_levels(l, k), l->K - k + 1);
    for (int level = 0; level <= l->K - k; level++) {
        int side = 1 << (l->K - level);
        for (int code = 0; code < 1 << 2 * level; code++) {
            int i = 0, j = 0;
            for (int bit = 0; bit < level; bit++)
                i |= (code >> 2 * bit & 1) << bit, j |= (code >> (2 * bit + 1) & 1) << bit;
            const rqt_block_number number = ((rqt_block_number)1 << 2 * level) + (rqt_block_number)code;
            rqt_block_place place;
            assert_true(rqt_block_number_of(level, i, j) == number);
            bool exists = (i == 0 || i * side < m->r.width - 1) && (j == 0 || j * side < m->r.height - 1);
            CHECK((rqt_block_locate(l, k, number, &place) == RQT_OK) == exists, "k=%d, %dx%d: block %llu", k,
                  m->r.width, m->r.height, (unsigned long long)number);
            if (!exists) continue;
            int stride = side >> k;
            /* up to the first vertex that is not before the last sample: its height is the last sample's */
            int right = (m->r.width - 1 - i * side + stride - 1) / stride + 1;
            int bottom = (m->r.height - 1 - j * side + stride - 1) / stride + 1;
            assert_true(place.level == level && place.i == i && place.j == j && place.x == i * side &&
                        place.y == j * side && place.side == side && place.stride == stride);
            assert_int_equal(place.width, right < (1 << k) + 1 ? right : (1 << k) + 1);
            assert_int_equal(place.height, bottom < (1 << k) + 1 ? bottom : (1 << k) + 1);
            assert_true(at < rqt_pyramid_count(pyramid) && at < d.count);
            rqt_block_number told;
            rqt_summary summary, alone;
            rqt_pyramid_block(pyramid, at, &told, &summary, &block);
            CHECK(told == number, "block %zu is %llu, not %llu", at, (unsigned long long)told,
                  (unsigned long long)number);
            rqt_pyramid_block(pyramid, at, &told, &alone, NULL);
            check_summary(m, k, &place, &summary);
            check_summary(m, k, &place, &alone);
            check_summary(m, k, &place, &d.block[at].summary);
            check_block(m, k, &place, &block, false, "block");
            assert_int_equal(rqt_block_decode(d.codec, d.block[at].bytes, d.block[at].size, &d.scratch), RQT_OK);
            rqt_block_set_corners(&d.scratch, &d.block[at].summary);
            check_block(m, k, &place, &d.scratch, true, "decoded block");
            at++;
        }
    }
    assert_int_equal(at, rqt_pyramid_count(pyramid));
    rqt_block_place place;
    assert_int_equal(rqt_block_locate(l, k, 0, &place), RQT_INVALID);
    assert_int_equal(rqt_block_locate(l, k, (rqt_block_number)1 << 2 * (l->K - k + 1), &place), RQT_INVALID);
    database_free(&d, &test_allocator);
    rqt_block_free(&block, &test_allocator);
    rqt_pyramid_free(pyramid);
}

static void blocks_and_summaries_hold_what_the_oracle_says(void **state) {
    (void)state;
    random_begin("blocks");
    for (int n = 0; n < 60; n++) {
        model m;
        int most = n % 12 == 0 ? 40 : 20;
        raster r = raster_make((surface)random_between(0, SURFACE_COUNT - 1), random_between(1, most),
                               random_between(1, most), random_between(-1, 3));
        if (n % 3 == 0) raster_add_lake(&r);
        model_create(&m, r);
        for (int k = smallest_k(&m.grid.lattice); k <= largest_k(&m.grid.lattice); k++) check_pyramid(&m, k);
        model_free(&m);
    }
}

static void every_place_has_exactly_one_answering_block(void **state) {
    (void)state;
    random_begin("partition");
    for (int n = 0; n < 40; n++) {
        model m;
        raster r =
            raster_make(n % 2 ? SURFACE_HILLS : SURFACE_NOISE, random_between(2, 36), random_between(2, 36), -1);
        if (n % 3) raster_add_lake(&r);
        model_create(&m, r);
        int width = m.r.width - 1, height = m.r.height - 1;
        int *seen = calloc((size_t)(width * height), sizeof *seen);
        for (int k = smallest_k(&m.grid.lattice); k <= largest_k(&m.grid.lattice); k++) {
            database d;
            assert_int_equal(database_create(&d, &m, k, &test_allocator), RQT_OK);
            for (int e = 0; e < 8; e++) {
                rqt_code eps = (rqt_code)random_eps(&m);
                rqt_outline outline = e % 2 ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL;
                memset(seen, 0, (size_t)(width * height) * sizeof *seen);
                for (size_t b = 0; b < d.count; b++) {
                    const stored *s = &d.block[b];
                    const rqt_interval *i = outline == RQT_OUTLINE_EXACT ? &s->summary.exact : &s->summary.tol;
                    bool answers = rqt_summary_answers(&s->summary, outline, eps);
                    assert_true(answers == (i->em <= eps && eps < i->em_parent));
                    for (int y = s->place.y; answers && y < s->place.y + s->place.side && y < height; y++)
                        for (int x = s->place.x; x < s->place.x + s->place.side && x < width; x++)
                            seen[y * width + x]++;
                }
                for (int c = 0; c < width * height; c++)
                    CHECK(seen[c] == 1, "k=%d, eps code %d: cell (%d,%d) has %d answers", k, (int)eps, c % width,
                          c / width, seen[c]);
            }
            database_free(&d, &test_allocator);
        }
        free(seen);
        model_free(&m);
    }
}

static void queries_equal_the_global_walk_on_small_rasters(void **state) {
    (void)state;
    random_begin("small queries");
    for (int n = 0; n < 120; n++) {
        raster r = raster_make((surface)random_between(0, SURFACE_COUNT - 1), random_between(1, 12),
                               random_between(1, 12), random_between(-1, 6));
        if (n % 4 == 0) raster_add_lake(&r);
        check_queries(r, 5, 5);
    }
}

static void queries_equal_the_global_walk_on_larger_rasters(void **state) {
    (void)state;
    random_begin("larger queries");
    const int sides[][2] = {{33, 33}, {34, 20}, {17, 36}, {24, 30}, {33, 18}, {19, 19}};
    for (size_t n = 0; n < sizeof sides / sizeof *sides; n++) {
        raster r = raster_make(n % 2 ? SURFACE_HILLS : SURFACE_TAKAGI, sides[n][0], sides[n][1], -1);
        if (n % 3 != 1) raster_add_lake(&r);
        check_queries(r, 5, 4);
    }
    check_queries(raster_make(SURFACE_HILLS, 65, 65, -1), 4, 1);
    check_queries(raster_make(SURFACE_HILLS, 70, 61, 1), 4, 1);
    raster r = raster_make(SURFACE_HILLS, 140, 131, -1); /* K = 8: blocks of every size there is */
    raster_add_lake(&r);
    check_queries(r, 3, 1);
}

/* Unit half-cells against the mask: those with three valid corners are in the patch, all of each, once; of the
 * others nothing is. Triangles at the end of a raster cut half-cells anywhere, so areas are compared, not points.
 */
static void check_cover(const model *m, const rqt_patch *p, long patch_area, rqt_code eps) {
    oracle_list units = {0};
    mpq_t covered, part;
    long right = 0;
    mpq_inits(covered, part, NULL);
    oracle_unit_triangles(&m->o, &units);
    assert_int_equal(units.count, 2 * (m->r.width - 1) * (m->r.height - 1));
    for (size_t u = 0; u < units.count; u++) {
        const oracle_point *corner = units.triangle[u].corner;
        int valid = 1, x0 = m->r.width, y0 = m->r.height, x1 = 0, y1 = 0;
        for (int c = 0; c < 3; c++) {
            valid = valid && oracle_is_valid(&m->o, corner[c]);
            x0 = corner[c].x < x0 ? corner[c].x : x0, x1 = corner[c].x > x1 ? corner[c].x : x1;
            y0 = corner[c].y < y0 ? corner[c].y : y0, y1 = corner[c].y > y1 ? corner[c].y : y1;
        }
        mpq_set_ui(covered, 0, 1);
        for (size_t t = 0; t < p->triangle_count; t++) {
            oracle_point v[3];
            int apart[4] = {1, 1, 1, 1};
            for (size_t c = 0; c < 3; c++) {
                const rqt_patch_vertex *at = &p->vertices[p->triangles[3 * t + c]];
                v[c] = (oracle_point){at->col, at->row};
                apart[0] &= at->col <= x0, apart[1] &= at->col >= x1;
                apart[2] &= at->row <= y0, apart[3] &= at->row >= y1;
            }
            if (apart[0] || apart[1] || apart[2] || apart[3]) continue;
            oracle_common_area(corner, v, part);
            mpq_add(covered, covered, part);
        }
        right += valid;
        if (mpq_cmp_si(covered, valid, 1) == 0) continue;
        raster_print(&m->r);
        fail_msg("eps code %u: of the half-cell (%d,%d) (%d,%d) (%d,%d) with %s, %.9g is covered", eps, corner[0].x,
                 corner[0].y, corner[1].x, corner[1].y, corner[2].x, corner[2].y,
                 valid ? "three valid corners" : "a void corner", mpq_get_d(covered));
    }
    assert_int_equal(patch_area, right);
    oracle_list_free(&units);
    mpq_clears(covered, part, NULL);
}

/* Samples in each triangle of the patch against its plane. The patch alone is looked at: neither leaves nor errors
 * of the oracle. */
static void check_bound_and_cover(const model *m, const rqt_patch *p, rqt_code eps, bool exact) {
    mpq_t off, most;
    mpq_inits(off, most, NULL);
    oracle_code_value(most, eps);
    int width = m->r.width, height = m->r.height;
    long area = 0;
    for (size_t t = 0; t < p->triangle_count; t++) {
        long x[3], y[3], z[3], worst = 0;
        for (size_t c = 0; c < 3; c++) {
            const rqt_patch_vertex *v = &p->vertices[p->triangles[3 * t + c]];
            x[c] = v->col, y[c] = v->row, z[c] = v->q;
        }
        long D = labs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]));
        area += D;
        for (int n = 0; n < width * height; n++) {
            long w[3], sum = 0;
            for (int c = 0; c < 3; c++) { /* counter-clockwise: inside is <= 0 */
                int a = (c + 1) % 3, b = (c + 2) % 3;
                w[c] = -((x[b] - x[a]) * (n / width - y[a]) - (n % width - x[a]) * (y[b] - y[a]));
                sum += w[c] * z[c];
            }
            if (w[0] < 0 || w[1] < 0 || w[2] < 0) continue;
            if (m->r.valid && !m->r.valid[n]) {
                CHECK(!exact, "void sample (%d,%d) is covered", n % width, n / width);
                continue;
            }
            long deviation = labs(sum - D * m->r.q[n]);
            worst = deviation > worst ? deviation : worst;
        }
        CHECK(eps > 0 || worst == 0, "eps 0 is not lossless in triangle %zu", t);
        mpq_set_si(off, worst, (unsigned long)D);
        mpq_canonicalize(off);
        mpq_mul(off, off, m->o.quantum);
        CHECK(mpq_cmp(off, most) <= 0, "triangle %zu is further off than eps code %u", t, eps);
    }
    if (exact) check_cover(m, p, area, eps);
    mpq_clears(off, most, NULL);
}

static void no_valid_sample_is_further_than_eps_and_exact_outlines_are_exact(void **state) {
    (void)state;
    random_begin("bound");
    for (int n = 0; n < 60; n++) {
        model m;
        database d;
        raster r = raster_make((surface)random_between(0, SURFACE_COUNT - 1), random_between(2, 22),
                               random_between(2, 22), random_between(-1, 8));
        if (n % 2) raster_add_lake(&r);
        model_create(&m, r);
        int k = random_between(smallest_k(&m.grid.lattice), largest_k(&m.grid.lattice));
        assert_int_equal(database_create(&d, &m, k, &test_allocator), RQT_OK);
        window all = window_all();
        rqt_region *region = region_of(&all, &m.grid.lattice);
        for (int e = 0; e < 12; e++) {
            rqt_code eps = e < 2 ? 0 : e < 4 ? RQT_CODE_LARGEST : (rqt_code)random_eps(&m);
            rqt_patch patch;
            assert_int_equal(database_query(&d, region, eps, RQT_SELECT_THRESHOLD,
                                            e % 2 ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL, &test_allocator, &patch),
                             RQT_OK);
            check_bound_and_cover(&m, &patch, eps, e % 2);
            rqt_patch_free(&patch);
        }
        rqt_region_free(region);
        database_free(&d, &test_allocator);
        model_free(&m);
    }
}

static size_t unite(key *keys, size_t count, const rqt_patch *p, int width) {
    key *more = keys_of_patch(p, width);
    memcpy(keys + count, more, p->triangle_count * sizeof *keys);
    free(more);
    count += p->triangle_count;
    if (count) qsort(keys, count, sizeof *keys, ordered_keys);
    size_t kept = 0;
    for (size_t n = 0; n < count; n++)
        if (n == 0 || ordered_keys(&keys[n], &keys[kept - 1]) != 0) keys[kept++] = keys[n];
    return kept;
}

static void parts_of_a_split_window_make_exactly_the_whole(void **state) {
    (void)state;
    random_begin("split");
    for (int n = 0; n < 40; n++) {
        model m;
        database d;
        raster r = raster_make(SURFACE_HILLS, random_between(10, 66), random_between(10, 66), -1);
        if (n % 2) raster_add_lake(&r);
        model_create(&m, r);
        int k = random_between(1, m.grid.lattice.K);
        assert_int_equal(database_create(&d, &m, k, &test_allocator), RQT_OK);
        for (int w = 0; w < 6; w++) {
            const long grain = w % 3 == 0 ? ORACLE_UNITS : w % 3 == 1 ? ORACLE_UNITS / 2 : 1;
            rqt_code eps = (rqt_code)random_eps(&m);
            rqt_outline outline = w % 2 ? RQT_OUTLINE_EXACT : RQT_OUTLINE_TOL;
            long whole[4];
            random_rectangle(m.r.width, m.r.height, grain, whole);
            long across[3] = {whole[0], (whole[0] + whole[2]) / 2 / grain * grain, whole[2]};
            long down[3] = {whole[1], (whole[1] + whole[3]) / 2 / grain * grain, whole[3]};
            size_t room = (size_t)(8 * m.r.width * m.r.height), parts = 0;
            key *keys = calloc(2 * room, sizeof *keys);
            if (!keys) abort();
            for (int part = 0; part < 5; part++) { /* four quarters, then the whole */
                int i = part & 1, j = part >> 1 & 1;
                const long quarter[4] = {across[i], down[j], across[i + 1], down[j + 1]};
                if (part < 4 && (quarter[0] >= quarter[2] || quarter[1] >= quarter[3])) continue;
                window one = window_of(part < 4 ? quarter : whole);
                rqt_region *region = region_of(&one, &m.grid.lattice);
                rqt_patch patch;
                assert_int_equal(
                    database_query(&d, region, eps, RQT_SELECT_THRESHOLD, outline, &test_allocator, &patch),
                    RQT_OK);
                assert_true(parts + patch.triangle_count <= room);
                if (part < 4) {
                    parts = unite(keys, parts, &patch, m.r.width);
                } else {
                    key *all = keys_of_patch(&patch, m.r.width);
                    CHECK(patch.triangle_count == parts, "%s: the parts have %zu triangles, the whole has %zu",
                          one.text, parts, patch.triangle_count);
                    if (parts) assert_memory_equal(all, keys, parts * sizeof *keys);
                    free(all);
                }
                rqt_patch_free(&patch);
                rqt_region_free(region);
            }
            free(keys);
        }
        database_free(&d, &test_allocator);
        model_free(&m);
    }
}

static void windows_are_rounded_to_units_wherever_the_terrain_lies(void **state) {
    (void)state;
    random_begin("placement");
    const rqt_placement placement = {4096, 1024, 0.5, -2};
    for (int n = 0; n < 40; n++) {
        rqt_lattice l;
        int32_t at[4], moved_at[4];
        long r[4];
        assert_int_equal(rqt_lattice_init(&l, 30, 20), RQT_OK);
        random_rectangle(30, 20, n % 2 ? 1 : ORACLE_UNITS, r);
        window w = window_of(r), moved = {.kind = "moved"};
        window_append(&moved, "POLYGON");
        window_append_ring(&moved, 4096 + samples_of(r[0]) / 2, 1024 - 2 * samples_of(r[1]),
                           4096 + samples_of(r[2]) / 2, 1024 - 2 * samples_of(r[3]));
        rqt_region *region = region_of(&w, &l), *other;
        rqt_geometry *geometry;
        rqt_message message;
        assert_int_equal(
            rqt_geometry_parse(moved.text, strlen(moved.text), true, &test_allocator, &geometry, &message), RQT_OK);
        assert_int_equal(rqt_region_create(geometry, &placement, &l, &test_allocator, &other), RQT_OK);
        rqt_geometry_free(geometry);
        bool meets = rqt_region_box(region, at, at + 1, at + 2, at + 3);
        assert_true(meets == rqt_region_box(other, moved_at, moved_at + 1, moved_at + 2, moved_at + 3));
        if (meets) assert_memory_equal(at, moved_at, sizeof at);
        /* grown outward to whole samples, clamped to the raster, which it touches or misses */
        const long last[2] = {29, 19};
        int32_t box[4];
        bool touches = true;
        for (int c = 0; c < 4; c++) {
            long out = (r[c] + 4 * ORACLE_UNITS + (c < 2 ? 0 : ORACLE_UNITS - 1)) / ORACLE_UNITS - 4;
            box[c] = (int32_t)(out < 0 ? 0 : out > last[c % 2] ? last[c % 2] : out);
            touches = touches && (c < 2 ? r[c] <= last[c] * ORACLE_UNITS : r[c] >= 0);
        }
        assert_int_equal(meets, touches);
        if (meets) assert_memory_equal(at, box, sizeof at);
        for (int t = 0; t < 200; t++) {
            rqt_vertex v[3];
            for (int c = 0; c < 3; c++) v[c] = (rqt_vertex){random_between(0, 29), random_between(0, 19)};
            oracle o = {.terrain = {.width = 30, .height = 20}};
            const oracle_triangle triangle = {{{v[0].x, v[0].y}, {v[1].x, v[1].y}, {v[2].x, v[2].y}}, 0};
            if (oracle_area(&o, &triangle) == 0) continue;
            bool right = oracle_meets_rectangle(&o, &triangle, r);
            assert_true(rqt_region_meets(region, v[0], v[1], v[2]) == right);
            assert_true(rqt_region_meets(other, v[0], v[1], v[2]) == right);
        }
        rqt_region_free(region);
        rqt_region_free(other);
    }
}

static bool interrupt(void *context) {
    (void)context;
    return true;
}

static void unreadable_blocks_and_interrupts_stop_a_query(void **state) {
    (void)state;
    random_begin("stopped queries");
    model m;
    database d;
    rqt_patch patch;
    model_create(&m, raster_make(SURFACE_NOISE, 30, 30, -1));
    assert_int_equal(database_create(&d, &m, 2, &test_allocator), RQT_OK);
    window all = window_all();
    rqt_region *region = region_of(&all, &m.grid.lattice);
    size_t before = test_heap.live;
    d.corrupt = 1;
    assert_int_equal(
        database_query(&d, region, 0, RQT_SELECT_THRESHOLD, RQT_OUTLINE_EXACT, &test_allocator, &patch),
        RQT_READ_FAILED);
    rqt_patch_free(&patch);
    assert_int_equal(test_heap.live, before);
    d.corrupt = 0;
    rqt_answer *answers = calloc(d.count, sizeof *answers);
    rqt_query query = {.lattice = d.lattice,
                       .k = d.k,
                       .region = region,
                       .answers = answers,
                       .answer_count = database_answers(&d, region, 0, RQT_OUTLINE_EXACT, answers),
                       .read_block = database_read,
                       .is_interrupted = interrupt,
                       .context = &d};
    assert_true(query.answer_count > 0);
    d.asking = &query;
    assert_int_equal(rqt_query_run(&query, &test_allocator, &patch), RQT_INTERRUPTED);
    rqt_patch_free(&patch);
    assert_int_equal(test_heap.live, before);
    free(answers);
    rqt_region_free(region);
    database_free(&d, &test_allocator);
    model_free(&m);
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(blocks_and_summaries_hold_what_the_oracle_says),
        TEST(every_place_has_exactly_one_answering_block),
        TEST(queries_equal_the_global_walk_on_small_rasters),
        TEST(queries_equal_the_global_walk_on_larger_rasters),
        TEST(no_valid_sample_is_further_than_eps_and_exact_outlines_are_exact),
        TEST(parts_of_a_split_window_make_exactly_the_whole),
        TEST(windows_are_rounded_to_units_wherever_the_terrain_lies),
        TEST(unreadable_blocks_and_interrupts_stop_a_query),
    };
    return cmocka_run_group_tests_name("blocks and queries", tests, NULL, NULL);
}
