/* stability.c - `make stability`: what published methods give on the catalogue's inputs, beside what rqt gives.
 *
 * Each row is one input, one eps, one method: its mesh is rasterised over the samples by src/verify, and so is
 * rqt's of the same input and eps. A method fails when its mesh is further than eps from a sample, has T-junctions
 * or overlaps, has another outline than the valid half-cells, or takes more than half as many vertices again as
 * rqt. The inputs are those of test_failures_*.c. The output is the same on every machine: Markdown rows, or with
 * an argument the bars of the picture.
 *
 * The methods:
 *   local         distance of a vertex from the edge it splits, saturated (most papers; RTIN, Martini)
 *   one level     the same without saturation: refine where the vertex at hand errs more than eps
 *   euclid        distance at right angles to the triangle, saturated
 *   wedgie        ROAM's nested sums
 *   error >= eps  [RQT] theorem 7.2 takes a vertex whose error equals eps
 *   one step      [RQT] section 9: patches of different eps exchange the vertices of their borders, and what these
 *                 depend on directly, not transitively
 *   helpers       the same with all dependencies, whose heights are interpolated, as section 9 allows
 *   tile alone    errors of each tile from its own samples, nothing exchanged (RTIN tile by tile)
 *   float32       heights or coordinates in single precision
 *   padded        the raster filled up to 2^k + 1 with zeros
 *   voids ignored errors of valid samples alone, leaves with a void corner dropped
 *
 * A second table is of views: each named test's mesh, and rqt's guaranteed one, in the picture of a camera.
 * It exits with 1 should rqt itself fail a row. */
#include "test_failures_support.h"

typedef struct outcome {
    double ratio; /* true error over eps */
    uint64_t cracks, overlaps, outline;
    size_t vertices;
} outcome;

typedef struct table {
    bool bars;  /* print those of the picture instead of rows */
    int broken; /* rows that rqt itself fails */
} table;

static outcome outcome_of(const verify_report *v, double eps, const raster *r) {
    const uint64_t halves = halves_of(r);
    return (outcome){eps > 0            ? v->max_error / eps
                     : v->max_error > 0 ? INFINITY
                                        : 0,
                     v->t_junctions, v->overlaps,
                     v->uncovered + (v->twice_area > halves ? v->twice_area - halves : halves - v->twice_area),
                     v->vertices};
}

static void put_outcome(const outcome *o) {
    printf(" %.2f | %llu | %llu | %zu |", o->ratio, (unsigned long long)o->cracks,
           (unsigned long long)(o->overlaps + o->outline), o->vertices);
}

/* What the method breaks, one word after the other. */
static void put_fault(bool is_so, const char *fault, int *count) {
    if (is_so) printf("%s%s", (*count)++ ? ", " : " **fails:** ", fault);
}

static void put_times(double times, int *count) {
    char many[60];
    (void)snprintf(many, sizeof many, "%.*f times the vertices", times < 10 ? 1 : 0, times);
    put_fault(times > 1.5, many, count);
}

static void put_row(table *t, const char *number, const char *input, const char *eps, const char *method,
                    const outcome *theirs, const outcome *ours) {
    if (ours->ratio > 1 || ours->cracks || ours->overlaps || ours->outline) t->broken++;
    if (t->bars) {
        if (theirs->ratio > 1) printf("\"%s %s\" %.4f %.4f\n", number, method, theirs->ratio, ours->ratio);
        return;
    }
    printf("| %s | %s | %s | %s |", number, input, eps, method);
    put_outcome(theirs);
    put_outcome(ours);
    int faults = 0;
    put_fault(theirs->ratio > 1, "bound", &faults);
    put_fault(theirs->cracks, "cracks", &faults);
    put_fault(theirs->overlaps, "overlaps", &faults);
    put_fault(theirs->outline, "outline", &faults);
    put_times(ours->vertices ? (double)theirs->vertices / (double)ours->vertices : 0, &faults);
    printf("%s |\n", faults ? "" : " holds");
}

/* --------------------------------------------------------------------------------- metrics of the core -- */
static raster copy_of(const raster *r) {
    raster c = raster_from_memory(r->width, r->height, r->q, r->valid, &r->unit, r->name);
    c.cost = r->cost;
    return c;
}

static outcome by_metric(const raster *r, rqt_metric metric, double eps) {
    terrain t = terrain_create_as(copy_of(r), 4, metric, RQT_OUTLINE_EXACT);
    rqt_patch patch = terrain_ask(&t, eps, RQT_OUTLINE_EXACT, NULL);
    const verify_report v = prove(r, &patch);
    rqt_patch_free(&patch);
    terrain_free(&t);
    return outcome_of(&v, eps, r);
}

static void compare_metric(table *t, const char *number, const char *input, const raster *r, double eps,
                           rqt_metric metric) {
    char text[30];
    (void)snprintf(text, sizeof text, "%g", eps);
    const outcome theirs = by_metric(r, metric, eps), ours = by_metric(r, RQT_METRIC_EXACT, eps);
    put_row(t, number, input, text, rqt_metric_name(metric), &theirs, &ours);
}

/* Errors of valid samples alone: an outline costs nothing, and no vertex is needed for its sake. */
static outcome without_outline(const raster *r, double eps) {
    raster c = copy_of(r);
    c.cost.c = 1e12;
    terrain t = terrain_create_as(c, 4, RQT_METRIC_EXACT, RQT_OUTLINE_TOL);
    rqt_patch patch = terrain_ask(&t, eps, RQT_OUTLINE_TOL, NULL);
    const verify_report v = prove(r, &patch);
    rqt_patch_free(&patch);
    terrain_free(&t);
    return outcome_of(&v, eps, r);
}

/* --------------------------------------------------------------------------------- sets of vertices -- */
/* A square of 2^K cells at (x0,y0) of a raster, the set of its vertices, and the triangles that it gives: a
 * triangle is halved where its split vertex is in the set, whether the set is closed or not. */
typedef struct square {
    const raster *r;
    int x0, y0, side;
    rqt_lattice lattice;
    rqt_errors errors; /* saturated */
    uint8_t *set;      /* (side + 1)^2: 1 as selected, 2 a helper whose height is interpolated */
    verify_triangle *triangles;
    size_t count, room;
} square;

static square square_create(const raster *r, int x0, int y0, int side) {
    square s = {.r = r, .x0 = x0, .y0 = y0, .side = side};
    const size_t n = (size_t)(side + 1) * (size_t)(side + 1);
    int32_t *q = malloc(n * sizeof *q);
    s.set = calloc(n, 1);
    if (!q || !s.set) abort();
    for (size_t i = 0; i < n; i++) q[i] = r->q[(y0 + (int)i / (side + 1)) * r->width + x0 + (int)i % (side + 1)];
    assert_int_equal(rqt_lattice_init(&s.lattice, side + 1, side + 1), RQT_OK);
    const rqt_grid grid = {.lattice = s.lattice, .q = q};
    assert_int_equal(rqt_errors_compute(&grid, &r->unit, &r->cost, &test_allocator, NULL, NULL, &s.errors), RQT_OK);
    rqt_errors_saturate(&s.errors);
    free(q);
    return s;
}

static void square_free(square *s) {
    rqt_errors_free(&s->errors, &test_allocator);
    free(s->set);
    free(s->triangles);
}

static uint8_t *in_set(const square *s, rqt_vertex v) {
    return &s->set[(size_t)v.y * (size_t)(s->side + 1) + (size_t)v.x];
}

static void square_select(square *s, double eps) {
    for (int y = 0; y <= s->side; y++)
        for (int x = 0; x <= s->side; x++)
            if (rqt_errors_at(&s->errors, (rqt_vertex){x, y}, &(bool){false}) > rqt_code_eps(eps, 0))
                *in_set(s, (rqt_vertex){x, y}) = 1;
}

/* What v depends on, marked with `mark` where it is new: one step, or all. */
static void square_add(square *s, rqt_vertex v, uint8_t mark, bool all) {
    rqt_vertex parent[2];
    const int parents = rqt_vertex_parents(&s->lattice, v, parent);
    for (int i = 0; i < parents; i++) {
        if (!*in_set(s, parent[i])) *in_set(s, parent[i]) = mark;
        if (all) square_add(s, parent[i], mark, true);
    }
}

static void square_halve(square *s, const rqt_vertex v[3], const int32_t q[3]) {
    const rqt_vertex m = {(v[1].x + v[2].x) / 2, (v[1].y + v[2].y) / 2};
    if ((v[1].x + v[2].x) % 2 == 0 && (v[1].y + v[2].y) % 2 == 0 && *in_set(s, m)) {
        const int32_t mq =
            *in_set(s, m) == 2 ? (q[1] + q[2]) >> 1 : s->r->q[(s->y0 + m.y) * s->r->width + s->x0 + m.x];
        square_halve(s, (const rqt_vertex[]){m, v[0], v[1]}, (const int32_t[]){mq, q[0], q[1]});
        square_halve(s, (const rqt_vertex[]){m, v[2], v[0]}, (const int32_t[]){mq, q[2], q[0]});
        return;
    }
    if (s->count == s->room) {
        s->room = s->room ? 2 * s->room : 1024;
        s->triangles = realloc(s->triangles, s->room * sizeof *s->triangles);
        if (!s->triangles) abort();
    }
    const int64_t turn =
        (int64_t)(v[1].x - v[0].x) * (v[2].y - v[0].y) - (int64_t)(v[2].x - v[0].x) * (v[1].y - v[0].y);
    for (int c = 0; c < 3; c++) {
        const int from = turn < 0 || c == 0 ? c : 3 - c;
        s->triangles[s->count].corner[c] =
            (verify_corner){.col = s->x0 + v[from].x, .row = s->y0 + v[from].y, .q = q[from]};
    }
    s->count++;
}

static void square_mesh(square *s) {
    const int32_t *q = s->r->q + s->y0 * s->r->width + s->x0, w = s->r->width, n = s->side;
    s->count = 0;
    square_halve(s, (const rqt_vertex[]){{n, 0}, {0, 0}, {n, n}}, (const int32_t[]){q[n], q[0], q[n * w + n]});
    square_halve(s, (const rqt_vertex[]){{0, n}, {n, n}, {0, 0}}, (const int32_t[]){q[n * w], q[n * w + n], q[0]});
}

/* The largest error over eps of squares that each have their own, and the faults of all together. */
static outcome squares_outcome(square *s, const double *eps, int n) {
    const raster *r = s[0].r;
    verify_triangle *all = NULL;
    size_t count = 0;
    double ratio = 0;
    for (int i = 0; i < n; i++) {
        const verify_report own = prove_triangles(r, s[i].triangles, s[i].count);
        if (own.max_error / eps[i] > ratio) ratio = own.max_error / eps[i];
        all = realloc(all, (count + s[i].count) * sizeof *all);
        if (!all) abort();
        memcpy(all + count, s[i].triangles, s[i].count * sizeof *all);
        count += s[i].count;
    }
    const verify_report v = prove_triangles(r, all, count);
    free(all);
    outcome o = outcome_of(&v, 1, r);
    o.ratio = ratio;
    return o;
}

enum exchange { ALONE, ONE_STEP, HELPERS };

/* Four patches of a raster of (2n + 1)^2 samples with an eps each, which exchange the vertices of their common
 * sides. */
static outcome patches(const raster *r, const double eps[4], enum exchange how) {
    const int n = (r->width - 1) / 2;
    square s[4];
    for (int i = 0; i < 4; i++) {
        s[i] = square_create(r, (i & 1) * n, (i >> 1) * n, n);
        square_select(&s[i], eps[i]);
    }
    uint8_t *line = calloc((size_t)(4 * n + 2), 1); /* the middle column, then the middle row */
    if (!line) abort();
    for (int round = 0; round < 2 && how != ALONE; round++)
        for (int i = 0; i < 4; i++)
            for (int at = 0; at <= n; at++)
                for (int row = 0; row < 2; row++) {
                    const int common = n - (row ? i >> 1 : i & 1) * n;
                    const rqt_vertex v = row ? (rqt_vertex){at, common} : (rqt_vertex){common, at};
                    uint8_t *known = &line[row * (2 * n + 1) + (row ? i & 1 : i >> 1) * n + at];
                    if (round == 0 && *in_set(&s[i], v)) *known = 1;
                    if (round == 1 && *known) *in_set(&s[i], v) = 1;
                }
    for (int i = 0; i < 4 && how != ALONE; i++)
        for (int at = 0; at <= n; at++)
            for (int row = 0; row < 2; row++) {
                const int common = n - (row ? i >> 1 : i & 1) * n;
                const rqt_vertex v = row ? (rqt_vertex){at, common} : (rqt_vertex){common, at};
                if (*in_set(&s[i], v)) square_add(&s[i], v, how == HELPERS ? 2 : 1, how == HELPERS);
            }
    free(line);
    for (int i = 0; i < 4; i++) square_mesh(&s[i]);
    const outcome o = squares_outcome(s, eps, 4);
    for (int i = 0; i < 4; i++) square_free(&s[i]);
    return o;
}

/* The same by the rule of rqt: one lattice, true heights, the transitive closure. */
static outcome one_mesh(const raster *r, const double eps[4]) {
    const int n = (r->width - 1) / 2;
    square whole = square_create(r, 0, 0, 2 * n), part[4];
    rqt_selection *selection;
    assert_int_equal(rqt_selection_create(&whole.lattice, &test_allocator, &selection), RQT_OK);
    for (int y = 0; y <= 2 * n; y++)
        for (int x = 0; x <= 2 * n; x++)
            for (int i = 0; i < 4; i++) /* a vertex on a side belongs to both */
                if (x >= (i & 1) * n && x <= n + (i & 1) * n && y >= (i >> 1) * n && y <= n + (i >> 1) * n &&
                    rqt_errors_at(&whole.errors, (rqt_vertex){x, y}, &(bool){false}) > rqt_code_eps(eps[i], 0))
                    assert_int_equal(rqt_selection_add_resolved(selection, (rqt_vertex){x, y}), RQT_OK);
    for (int i = 0; i < 4; i++) {
        part[i] = square_create(r, (i & 1) * n, (i >> 1) * n, n);
        for (int at = 0; at < (n + 1) * (n + 1); at++)
            part[i].set[at] =
                rqt_selection_has(selection, (rqt_vertex){part[i].x0 + at % (n + 1), part[i].y0 + at / (n + 1)});
        square_mesh(&part[i]);
    }
    const outcome o = squares_outcome(part, eps, 4);
    for (int i = 0; i < 4; i++) square_free(&part[i]);
    square_free(&whole);
    rqt_selection_free(selection);
    return o;
}

static void compare_patches(table *t, const char *number, const char *input, const raster *r, const double eps[4],
                            const char *text, enum exchange how) {
    static const char *const names[] = {"tile alone", "one step", "helpers"};
    const outcome theirs = patches(r, eps, how), ours = one_mesh(r, eps);
    put_row(t, number, input, text, names[how], &theirs, &ours);
}

/* Refine where the vertex at hand errs more than eps, and close the set: what lies under a vertex that fits is
 * not looked at. */
static void look_one_level(const square *s, rqt_selection *selection, const rqt_vertex v[3], double eps) {
    if ((v[1].x + v[2].x) % 2 || (v[1].y + v[2].y) % 2) return;
    const rqt_vertex m = {(v[1].x + v[2].x) / 2, (v[1].y + v[2].y) / 2};
    const int32_t *q = s->r->q, w = s->r->width;
    if (!(fabs(q[m.y * w + m.x] - (q[v[1].y * w + v[1].x] + q[v[2].y * w + v[2].x]) / 2.0) > eps)) return;
    assert_int_equal(rqt_selection_add_resolved(selection, m), RQT_OK);
    look_one_level(s, selection, (const rqt_vertex[]){m, v[0], v[1]}, eps);
    look_one_level(s, selection, (const rqt_vertex[]){m, v[2], v[0]}, eps);
}

static outcome one_level(const raster *r, double eps) {
    const int n = r->width - 1;
    square s = square_create(r, 0, 0, n);
    rqt_selection *selection;
    assert_int_equal(rqt_selection_create(&s.lattice, &test_allocator, &selection), RQT_OK);
    look_one_level(&s, selection, (const rqt_vertex[]){{n, 0}, {0, 0}, {n, n}}, eps);
    look_one_level(&s, selection, (const rqt_vertex[]){{0, n}, {n, n}, {0, 0}}, eps);
    for (int i = 0; i < (n + 1) * (n + 1); i++)
        s.set[i] = rqt_selection_has(selection, (rqt_vertex){i % (n + 1), i / (n + 1)});
    square_mesh(&s);
    const outcome o = squares_outcome(&s, &eps, 1);
    rqt_selection_free(selection);
    square_free(&s);
    return o;
}

/* The set {error >= eps}. */
static outcome at_least(const raster *r, double eps) {
    const int n = r->width - 1;
    square s = square_create(r, 0, 0, n);
    for (int i = 0; i < (n + 1) * (n + 1); i++)
        s.set[i] = rqt_code_metres(
                       rqt_errors_at(&s.errors, (rqt_vertex){i % (n + 1), i / (n + 1)}, &(bool){false})) >= eps;
    square_mesh(&s);
    const outcome o = squares_outcome(&s, &eps, 1);
    square_free(&s);
    return o;
}

/* ------------------------------------------------------------------------------------- single precision -- */
/* Heights of 10^7 m and millimetres, kept as floats: the mesh of these, against the samples. q: millimetres. */
static outcome float_heights(const raster *r, double offset, double eps) {
    raster rounded = copy_of(r);
    for (int i = 0; i < r->width * r->height; i++)
        rounded.q[i] = (int32_t)lrint(((double)(float)(offset + r->q[i] / 1000.0) - offset) * 1000);
    terrain t = terrain_create(rounded, 4);
    rqt_patch patch = terrain_ask(&t, eps, RQT_OUTLINE_EXACT, NULL);
    const verify_report v = prove(r, &patch);
    rqt_patch_free(&patch);
    terrain_free(&t);
    return outcome_of(&v, eps, r);
}

/* The mesh with its vertices where single precision puts them, in cells of 0.25 m at a northing of 10^7 m. */
static outcome float_places(const raster *r, double eps) {
    terrain t = terrain_create(copy_of(r), 4);
    rqt_patch patch = terrain_ask(&t, eps, RQT_OUTLINE_EXACT, NULL);
    for (size_t v = 0; v < patch.vertex_count; v++) {
        const float north = (float)(1e7 - 0.25 * patch.vertices[v].row);
        const int32_t row = (int32_t)lrint((1e7 - (double)north) / 0.25);
        patch.vertices[v].row = row < r->height - 1 ? row : r->height - 1;
    }
    const verify_report v = prove(r, &patch);
    rqt_patch_free(&patch);
    terrain_free(&t);
    return outcome_of(&v, eps, r);
}

static outcome padded(const raster *r, double eps) {
    int side = 2;
    while (side + 1 < r->width || side + 1 < r->height) side *= 2;
    raster big = raster_from_memory(side + 1, side + 1, NULL, NULL, &r->unit, r->name);
    for (int y = 0; y < r->height; y++)
        memcpy(big.q + y * big.width, r->q + y * r->width, (size_t)r->width * sizeof *r->q);
    const outcome o = by_metric(&big, RQT_METRIC_EXACT, eps);
    raster_free(&big);
    return o;
}

/* ---------------------------------------------------------------------------------------------- views -- */
/* A scene in metres: east, north and up from the first sample. Every unit square of ground is a piece, but for the
 * LOD map, whose patch is the whole raster. */
enum { CELL = 30 };

typedef struct view {
    const raster *r;
    rqt_camera camera;
    double offset; /* of the origin of float32's coordinates; 0: doubles */
} view;

static void place_of(double x, double y, double z, double out[3]) {
    out[0] = CELL * x, out[1] = -CELL * y, out[2] = z;
}

static double eps_of_square(const view *v, rqt_view_test test, int x, int y, int side) {
    int32_t low = INT32_MAX, high = INT32_MIN;
    for (int j = y; j <= y + side; j++)
        for (int i = x; i <= x + side; i++) {
            const int32_t q = v->r->q[j * v->r->width + i];
            if (q < low) low = q;
            if (q > high) high = q;
        }
    rqt_view_piece p = {
        .prism = {.up = {0, 0, 1}, .radius = CELL * side * 0.7072, .half_height = (high - low) / 2.0},
        .east = {1, 0, 0},
        .half_east = CELL * side / 2.0,
        .half_north = CELL * side / 2.0,
        .side = side};
    place_of(x + side / 2.0, y + side / 2.0, (low + high) / 2.0, p.prism.centre);
    rqt_view_bound b;
    rqt_view_test_bound(test, &v->camera, &p, &b);
    return b.eps;
}

/* The vertices whose number is above the least eps in their box: rqt.h, "rules". */
static square select_by(const view *v, rqt_view_test test) {
    const int n = v->r->width - 1;
    square s = square_create(v->r, 0, 0, n);
    rqt_errors_free(&s.errors, &test_allocator);
    const rqt_grid grid = {.lattice = s.lattice, .q = v->r->q};
    assert_int_equal(rqt_metric_compute(&grid, &v->r->unit, &v->r->cost, rqt_view_test_metric(test),
                                        RQT_OUTLINE_EXACT, &test_allocator, NULL, NULL, &s.errors),
                     RQT_OK);
    double *eps = malloc((size_t)(n * n) * sizeof *eps);
    if (!eps) abort();
    for (int i = 0; i < n * n; i++)
        eps[i] = test == RQT_VIEW_LODMAP ? (i ? eps[0] : eps_of_square(v, test, 0, 0, n))
                                         : eps_of_square(v, test, i % n, i / n, 1);
    for (int y = 0; y <= n; y++)
        for (int x = 0; x <= n; x++) {
            const int rank = rqt_vertex_rank(&s.lattice, (rqt_vertex){x, y}), half = (rank & 1 ? 3 : 2) << rank / 2;
            double least = INFINITY;
            for (int j = y - half > 0 ? y - half : 0; j < y + half && j < n; j++)
                for (int i = x - half > 0 ? x - half : 0; i < x + half && i < n; i++)
                    least = fmin(least, eps[j * n + i]);
            *in_set(&s, (rqt_vertex){x, y}) =
                rqt_errors_at(&s.errors, (rqt_vertex){x, y}, &(bool){false}) > rqt_code_eps(least, 0);
        }
    free(eps);
    square_mesh(&s);
    return s;
}

/* Where a point of a mesh is drawn: as it is, or by coordinates in single precision. */
static bool draw(const view *v, const double at[3], double xy[2]) {
    double there[3];
    for (int i = 0; i < 3; i++)
        there[i] = v->offset > 0 ? v->camera.eye[i] +
                                       (double)((float)(v->offset + at[i]) - (float)(v->offset + v->camera.eye[i]))
                                 : at[i];
    return rqt_camera_project(&v->camera, there, xy);
}

/* The farthest that a sample is from the mesh at its place in the picture, pixels, when one of them is drawn. */
static double picture_error(const view *v, const square *s) {
    double worst = 0;
    for (size_t n = 0; n < s->count; n++) {
        const verify_corner *const c = s->triangles[n].corner;
        int low[2] = {c[0].col, c[0].row}, high[2] = {c[0].col, c[0].row};
        for (int k = 1; k < 3; k++) {
            const int at[2] = {c[k].col, c[k].row};
            for (int d = 0; d < 2; d++) {
                if (at[d] < low[d]) low[d] = at[d];
                if (at[d] > high[d]) high[d] = at[d];
            }
        }
        const double area = (double)(c[1].col - c[0].col) * (c[2].row - c[0].row) -
                            (double)(c[2].col - c[0].col) * (c[1].row - c[0].row);
        for (int y = low[1]; y <= high[1]; y++)
            for (int x = low[0]; x <= high[0]; x++) {
                const double one = ((double)(x - c[0].col) * (c[2].row - c[0].row) -
                                    (double)(c[2].col - c[0].col) * (y - c[0].row)) /
                                   area,
                             two = ((double)(c[1].col - c[0].col) * (y - c[0].row) -
                                    (double)(x - c[0].col) * (c[1].row - c[0].row)) /
                                   area;
                if (one < 0 || two < 0 || one + two > 1) continue;
                const double z = c[0].q + one * (c[1].q - c[0].q) + two * (c[2].q - c[0].q);
                double sample[3], mesh[3], a[2], b[2];
                place_of(x, y, v->r->q[y * v->r->width + x], sample);
                place_of(x, y, z, mesh);
                const bool drawn = rqt_camera_project(&v->camera, sample, a);
                if (!(draw(v, mesh, b) || drawn)) continue;
                const double moved = sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]));
                worst = moved <= worst ? worst : moved >= 0 ? moved : INFINITY; /* one of them behind the eye */
            }
    }
    return worst;
}

/* method NULL: the test by its name. */
static void compare_views(table *t, const char *number, const char *input, const view *v, rqt_view_test test,
                          const char *method) {
    view own = *v;
    own.offset = 0;
    square theirs = select_by(v, test), ours = select_by(v, RQT_VIEW_GUARANTEED);
    const double tau = v->camera.tau, wrong = picture_error(v, &theirs) / tau,
                 right = picture_error(&own, &ours) / tau;
    const verify_report a = prove_triangles(v->r, theirs.triangles, theirs.count),
                        b = prove_triangles(v->r, ours.triangles, ours.count);
    if (right > 1 || b.t_junctions) t->broken++;
    if (!t->bars) {
        printf("| %s | %s | %g | %s | %.2f | %llu | %llu | %.2f | %llu | %llu |", number, input, tau,
               method ? method : rqt_view_test_name(test), wrong, (unsigned long long)a.t_junctions,
               (unsigned long long)a.vertices, right, (unsigned long long)b.t_junctions,
               (unsigned long long)b.vertices);
        int faults = 0;
        put_fault(wrong > 1, "tolerance", &faults);
        put_fault(a.t_junctions, "cracks", &faults);
        put_times((double)a.vertices / (double)b.vertices, &faults);
        printf("%s |\n", faults ? "" : " holds");
    }
    square_free(&theirs);
    square_free(&ours);
}

static view view_of(const raster *r, double x, double y, double z, const double direction[3], double fovy,
                    double tau) {
    const double up[3] = {0, 0, 1}, north[3] = {0, 1, 0};
    view v = {.r = r, .camera = {.width = 1600, .height = 900, .far = INFINITY, .tau = tau}};
    double eye[3];
    rqt_message message;
    place_of(x, y, z, eye);
    if (rqt_camera_look(&v.camera, eye, direction, up, north, fovy, &message) != RQT_OK) abort();
    return v;
}

static void views(table *t) {
    random_begin("views");
    raster r = raster_of(relief_hills, 129, 129, 40, 0, 0, 0, "hills");
    const int32_t foot = r.q[64 * 129 + 64];
    const double north[3] = {0, 1, 0}, down[3] = {0, 0, -1}, steep[3] = {0.3, 1, 0.5}, slanted[3] = {0, 1, -0.5};
    const view below = view_of(&r, 64.3, 90.6, foot - 900, steep, 60, 4),
               on = view_of(&r, 64, 64, foot, slanted, 60, 4),
               wide = view_of(&r, 64.3, 120.2, foot + 900, slanted, 120, 4),
               far_down = view_of(&r, 64.3, 60.4, foot + 1500, down, 90, 4);
    for (int test = RQT_VIEW_ULRICH; test < RQT_VIEW_TESTS; test++)
        compare_views(t, "F31", test == RQT_VIEW_ULRICH ? "hills 129 x 129, from below ground" : "the same", &below,
                      (rqt_view_test)test, NULL);
    for (int test = RQT_VIEW_ULRICH; test < RQT_VIEW_TESTS; test++)
        compare_views(t, "F31", test == RQT_VIEW_ULRICH ? "hills 129 x 129, from a vertex" : "the same", &on,
                      (rqt_view_test)test, NULL);
    for (int test = RQT_VIEW_ULRICH; test < RQT_VIEW_TESTS; test++)
        compare_views(t, "F32", test == RQT_VIEW_ULRICH ? "hills 129 x 129, 120 degrees" : "the same", &wide,
                      (rqt_view_test)test, NULL);
    for (int test = RQT_VIEW_ULRICH; test < RQT_VIEW_TESTS; test++)
        compare_views(t, "F33", test == RQT_VIEW_ULRICH ? "hills 129 x 129, straight down, 90 degrees" : "the same",
                      &far_down, (rqt_view_test)test, NULL);
    view far_off = view_of(&r, 64.31, 64.42, foot + 1.7, north, 60, 1);
    far_off.offset = 1e7;
    compare_views(t, "F34", "hills 129 x 129 at northing 10^7 m, from a man's height", &far_off,
                  RQT_VIEW_GUARANTEED, "float32");
    raster_free(&r);
}

/* ----------------------------------------------------------------------------------------------- rows -- */
static void heights(table *t) {
    raster r = raster_of(relief_plane, 33, 33, 3, -5, 7, 0, "plane");
    outcome ours = by_metric(&r, RQT_METRIC_EXACT, 0), theirs = at_least(&r, 0);
    put_row(t, "F1", "plane, 33 x 33", "0", "error >= eps", &theirs, &ours);
    raster_free(&r);

    r = raster_of(relief_takagi, 2049, 2049, 2048, 2048, 0, 0, "takagi");
    compare_metric(t, "F3", "Takagi surface, 2049 x 2049", &r, 4096, RQT_METRIC_LOCAL);
    raster_free(&r);

    random_begin("F4");
    r = raster_of(relief_noise, 129, 129, 100, 0, 0, 0, "noise");
    compare_metric(t, "F4", "white noise within 100 m, 129 x 129", &r, 150, RQT_METRIC_LOCAL);
    compare_metric(t, "F4", "the same", &r, 150, RQT_METRIC_EUCLID);
    compare_metric(t, "F4", "the same", &r, 199, RQT_METRIC_WEDGIE);
    raster_free(&r);

    r = raster_of(relief_spike, 65, 65, 32, 32, 1000, 0, "spike");
    compare_metric(t, "F5", "spike of 1000 m at a block corner, 65 x 65", &r, 600, RQT_METRIC_LOCAL);
    raster_free(&r);

    r = raster_of(relief_spike, 65, 65, 21, 38, -50, 0, "pit");
    ours = by_metric(&r, RQT_METRIC_EXACT, 10), theirs = one_level(&r, 10);
    put_row(t, "F6", "pit of 50 m in a plain, 65 x 65", "10", "one level", &theirs, &ours);
    raster_free(&r);

    r = raster_of(relief_cliff, 65, 65, 13, 1, 300, 500, "cliff");
    compare_metric(t, "F7", "cliff of 500 m at a slant, 65 x 65", &r, 250, RQT_METRIC_LOCAL);
    compare_metric(t, "F7", "the same", &r, 100, RQT_METRIC_EUCLID);
    raster_free(&r);

    r = raster_of(relief_ridge, 65, 65, 0, 13, 58, 0, "ridge");
    raster turned = raster_turned(&r);
    compare_metric(t, "F9", "ridge beside a diagonal, 65 x 65", &r, 80, RQT_METRIC_LOCAL);
    compare_metric(t, "F9", "the same, turned by 90 degrees", &turned, 80, RQT_METRIC_LOCAL);
    raster_free(&r);
    raster_free(&turned);

    random_begin("F10");
    r = raster_of(relief_hills, 65, 65, 4, 0, 0, 0, "millimetres");
    r.unit = (rqt_unit){.d = 1000, .numerator = 1, .denominator = 1, .scale = 1};
    ours = by_metric(&r, RQT_METRIC_EXACT, 0.01), theirs = float_heights(&r, 1e7, 0.01);
    put_row(t, "F10", "relief of millimetres 10^7 m up, 65 x 65", "0.01", "float32", &theirs, &ours);
    raster_free(&r);
}

static void voids(table *t) {
    random_begin("voids");
    for (int which = 0; which < 3; which++) {
        static const char *const number[] = {"F16", "F17", "F18"},
                                 *const input[] = {"a void at a block corner, hills, 65 x 65",
                                                   "checkerboard of void blocks, hills, 65 x 65",
                                                   "strips of one valid row, hills, 65 x 65"};
        raster r = raster_of(relief_hills, 65, 65, 40, 0, 0, 0, "hills");
        for (int y = 0; y < 65; y++)
            for (int x = 0; x < 65; x++)
                if (which == 0 ? x == 32 && y == 32 : which == 1 ? (((x >> 3) ^ (y >> 3)) & 1) != 0 : y % 16 != 0)
                    raster_void(&r, x, y);
        const outcome ours = by_metric(&r, RQT_METRIC_EXACT, 100), theirs = without_outline(&r, 100);
        put_row(t, number[which], input[which], "100", "voids ignored", &theirs, &ours);
        raster_free(&r);
    }
}

static void meshes(table *t) {
    random_begin("patches");
    raster r = raster_of(relief_hills, 129, 129, 40, 7, 3, 0, "hills");
    /* finer steps than metres, so that interpolated heights are not rounded to them */
    for (int i = 0; i < 129 * 129; i++) r.q[i] *= 1024;
    r.unit.d = 1024;
    const double four[] = {2, 40, 150, 600}, alike[] = {40, 40, 40, 40};
    compare_patches(t, "F19", "hills, four patches, 129 x 129", &r, four, "2, 40, 150, 600", ALONE);
    compare_patches(t, "F20", "the same", &r, four, "2, 40, 150, 600", ONE_STEP);
    compare_patches(t, "F20", "the same", &r, four, "2, 40, 150, 600", HELPERS);
    compare_patches(t, "F21", "hills, four tiles, 129 x 129", &r, alike, "40", ALONE);
    raster_free(&r);

    random_begin("extents");
    r = raster_of(relief_hills, 67, 66, 40, 0, 0, 0, "hills");
    for (int i = 0; i < r.width * r.height; i++) r.q[i] += 3000;
    outcome ours = by_metric(&r, RQT_METRIC_EXACT, 100), theirs = padded(&r, 100);
    put_row(t, "F40", "hills at 3000 m, 67 x 66", "100", "padded", &theirs, &ours);
    ours = by_metric(&r, RQT_METRIC_EXACT, 20), theirs = float_places(&r, 20);
    put_row(t, "F41", "the same, cells of 0.25 m at northing 10^7 m", "20", "float32", &theirs, &ours);
    raster_free(&r);
}

int main(int argc, char **argv) {
    (void)argv;
    table t = {.bars = argc > 1};
    random_seed = 1;
    if (!t.bars)
        printf("| case | input | eps, m | method | error / eps | cracks | misfits | vertices | rqt: error / eps | "
               "cracks "
               "| misfits | vertices | the method |\n"
               "|---|---|---:|---|---:|---:|---:|---:|---:|---:|---:|---:|---|\n");
    heights(&t);
    voids(&t);
    meshes(&t);
    if (!t.bars)
        printf("\n| case | input | tau, px | method | displacement / tau | cracks | vertices | rqt: displacement / "
               "tau | "
               "cracks | vertices | the method |\n|---|---|---:|---|---:|---:|---:|---:|---:|---:|---|\n");
    views(&t);
    if (test_heap.live) fprintf(stderr, "stability: %zu bytes were never released\n", test_heap.live);
    if (t.broken) fprintf(stderr, "stability: rqt itself fails %d rows\n", t.broken);
    return t.broken || test_heap.live;
}
