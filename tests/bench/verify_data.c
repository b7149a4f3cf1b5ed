/* verify_data.c - the promises of one terrain at several tolerances, and that all forms of an answer are one mesh.
 *
 *     verify_data DATABASE EXTENSION EPS...
 *
 * Asks through SQL only and shares no code with rqt; the bytes of a mesh are read as src/core/FORMAT.md describes
 * them. Prints a row per eps, a line per check that fails, and as its last line the counts "passed failed". Exit
 * status 1 when one failed.
 *
 * Meshes are compared as multisets of triangles: two sums of 64-bit hashes, over all triangles, of the corners'
 * column, row and height, with the least first and the winding kept.
 */
#include <math.h>
#include <sqlite3.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static int passed, failed;
static const char *database;
static double now_eps;

static void check(bool holds, const char *what) {
    if (holds) {
        passed++;
        return;
    }
    failed++;
    printf("  FAILED at eps %g: %s\n", now_eps, what);
}

static void stop(sqlite3 *db, const char *doing) {
    printf("  FAILED at eps %g: %s: %s\n%d %d\n", now_eps, doing, sqlite3_errmsg(db), passed, failed + 1);
    exit(1);
}

static double seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* -------------------------------------------------------------------------------- triangles, in any order -- */
typedef struct corner {
    int32_t col, row, q;
    uint64_t hash;
} corner;

/* What is compared of a mesh, or of a set of vertices. */
typedef struct multiset {
    int64_t count;
    uint64_t sum[2];
    uint64_t twice_area; /* in cells */
    int64_t bad;         /* triangles that are not counter-clockwise, seen from above */
} multiset;

static uint64_t mix(uint64_t h) {
    h = (h ^ (h >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    h = (h ^ (h >> 27)) * UINT64_C(0x94D049BB133111EB);
    return h ^ (h >> 31);
}

static corner make_corner(int32_t col, int32_t row, int32_t q) {
    const uint64_t place = (uint64_t)(uint32_t)col << 32 | (uint32_t)row;
    return (corner){col, row, q, mix(mix(place + 1) + (uint32_t)q)};
}

static void add_hash(multiset *set, uint64_t h) {
    set->count++;
    set->sum[0] += mix(h);
    set->sum[1] += mix(h ^ UINT64_C(0x5DEECE66D1234567));
}

/* mirrored: rows grow to the south, as they do where dx and dy differ in sign. */
static void add_triangle(multiset *set, const corner *a, const corner *b, const corner *c, bool mirrored) {
    const int64_t turn =
        (int64_t)(b->col - a->col) * (c->row - a->row) - (int64_t)(b->row - a->row) * (c->col - a->col);
    if (mirrored ? turn >= 0 : turn <= 0) set->bad++;
    set->twice_area += (uint64_t)(turn < 0 ? -turn : turn);
    while (a->hash > b->hash || a->hash > c->hash) {
        const corner *first = a;
        a = b;
        b = c;
        c = first;
    }
    add_hash(set, a->hash + mix(b->hash + mix(c->hash)));
}

static bool is_same(const multiset *a, const multiset *b) {
    return a->count == b->count && a->sum[0] == b->sum[0] && a->sum[1] == b->sum[1];
}

/* ------------------------------------------------------------------------------------------------ the BLOB -- */
static uint32_t read32(const uint8_t *p) {
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}
static uint64_t read64(const uint8_t *p) {
    return read32(p) | (uint64_t)read32(p + 4) << 32;
}
static double read_double(const uint8_t *p) {
    const uint64_t bits = read64(p);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint64_t checksum(const uint8_t *bytes, size_t size) {
    uint64_t h = UINT64_C(0x9E3779B97F4A7C15) ^ (size * UINT64_C(0xFF51AFD7ED558CCD));
    for (size_t at = 0; at < size; at += 8) {
        uint8_t word[8] = {0};
        if (at != 8) memcpy(word, bytes + at, size - at < 8 ? size - at : 8);
        h = (h ^ read64(word)) * UINT64_C(0xC2B2AE3D27D4EB4F);
        h = h << 29 | h >> 35;
    }
    h = (h ^ (h >> 32)) * UINT64_C(0xFF51AFD7ED558CCD);
    return h ^ (h >> 29);
}

typedef struct frame {
    double x0, y0, dx, dy, f, o;
    int64_t z0;
    int32_t d;
    int32_t srid;
} frame;

/* The multisets of vertices and triangles in a mesh BLOB, and its frame. false: its bytes are not as described. */
static bool read_mesh(const uint8_t *bytes, size_t size, int kind, frame *at, multiset *vertices,
                      multiset *triangles) {
    *vertices = *triangles = (multiset){0};
    if (!bytes || size < 128 || memcmp(bytes, "RQTM", 4) || bytes[4] != 1 || bytes[5] != kind) return false;
    if (read64(bytes + 8) != checksum(bytes, size)) return false;
    const uint64_t n = read64(bytes + 16), indices = read64(bytes + 24);
    if (n > size || indices > size || size != 128 + 12 * n + 4 * indices) return false;
    *at = (frame){.x0 = read_double(bytes + 32),
                  .y0 = read_double(bytes + 40),
                  .dx = read_double(bytes + 48),
                  .dy = read_double(bytes + 56),
                  .z0 = (int64_t)read64(bytes + 64),
                  .d = (int32_t)read32(bytes + 72),
                  .f = read_double(bytes + 88) *
                       ((double)(int32_t)read32(bytes + 76) / (double)(int32_t)read32(bytes + 80)),
                  .o = read_double(bytes + 96),
                  .srid = (int32_t)read32(bytes + 84)};
    const bool mirrored = at->dx * at->dy < 0;
    corner *v = malloc((n + 1) * sizeof *v);
    if (!v) return false;
    for (uint64_t i = 0; i < n; i++) {
        const uint8_t *p = bytes + 128 + 12 * i;
        v[i] = make_corner((int32_t)read32(p), (int32_t)read32(p + 4), (int32_t)read32(p + 8));
        add_hash(vertices, v[i].hash);
    }
    const uint8_t *index = bytes + 128 + 12 * n;
    const uint64_t step = kind == 1 ? 1 : 3;
    bool fine = kind == 1 || indices % 3 == 0;
    for (uint64_t i = 0; i + 2 < indices && fine; i += step) {
        uint32_t a = read32(index + 4 * i), b = read32(index + 4 * i + 4), c = read32(index + 4 * i + 8);
        fine = a < n && b < n && c < n;
        if (!fine || (kind == 1 && (a == b || b == c || c == a))) continue; /* a join */
        if (kind == 1 && i % 2 == 1) {
            const uint32_t swapped = b;
            b = c;
            c = swapped;
        }
        add_triangle(triangles, &v[a], &v[b], &v[c], mirrored);
    }
    free(v);
    return fine;
}

/* --------------------------------------------------------------------------------------------------- rows -- */
/* The corner at three columns of a row; false: no sample is exactly there. */
static bool read_corner(sqlite3_stmt *s, int column, const frame *at, corner *out) {
    const double x = sqlite3_column_double(s, column), y = sqlite3_column_double(s, column + 1),
                 z = sqlite3_column_double(s, column + 2);
    const double col = nearbyint((x - at->x0) / at->dx), row = nearbyint((y - at->y0) / at->dy),
                 q = nearbyint(((z - at->o) / at->f - (double)at->z0) * at->d);
    if (!(fabs(col) < 0x1p30 && fabs(row) < 0x1p30 && fabs(q) < 0x1p30)) return false;
    *out = make_corner((int32_t)col, (int32_t)row, (int32_t)q);
    return x == at->x0 + col * at->dx && y == at->y0 + row * at->dy &&
           z == ((double)at->z0 + q / (double)at->d) * at->f + at->o;
}

static sqlite3_stmt *ask(sqlite3 *db, const char *sql, double eps) {
    sqlite3_stmt *s = NULL;
    if (sqlite3_prepare_v2(db, sql, -1, &s, NULL) != SQLITE_OK) stop(db, sql);
    sqlite3_bind_double(s, 1, eps);
    return s;
}

/* Does the BLOB of this kind hold what is described? */
static bool ask_mesh(sqlite3 *db, double eps, int kind, frame *at, multiset *vertices, multiset *triangles) {
    const char *sql = kind == 1 ? "SELECT rqt_mesh(NULL, ?1, 'strip')" : "SELECT rqt_mesh(NULL, ?1, 'indexed')";
    sqlite3_stmt *s = ask(db, sql, eps);
    if (sqlite3_step(s) != SQLITE_ROW) stop(db, sql);
    const uint8_t *bytes = sqlite3_column_blob(s, 0);
    const bool fine = read_mesh(bytes, (size_t)sqlite3_column_bytes(s, 0), kind, at, vertices, triangles);
    sqlite3_finalize(s);
    return fine;
}

static bool ask_rows(sqlite3 *db, const char *sql, double eps, int corners, const frame *at, multiset *set) {
    *set = (multiset){0};
    sqlite3_stmt *s = ask(db, sql, eps);
    bool fine = true;
    int code;
    while ((code = sqlite3_step(s)) == SQLITE_ROW) {
        corner c[3];
        for (int i = 0; i < corners; i++) fine = read_corner(s, 3 * i, at, &c[i]) && fine;
        if (!fine) break;
        if (corners == 3)
            add_triangle(set, &c[0], &c[1], &c[2], at->dx * at->dy < 0);
        else
            add_hash(set, c[0].hash);
    }
    if (code != SQLITE_ROW && code != SQLITE_DONE) stop(db, sql);
    sqlite3_finalize(s);
    return fine;
}

/* --------------------------------------------------------------------------------------------- one terrain -- */
typedef struct terrain {
    int64_t width, height, voids;
    double quantum_error;
    bool has_area;
    int64_t twice_area; /* at the first eps */
} terrain;

static void check_proof(sqlite3 *db, terrain *t, double eps, int64_t *vertices, int64_t *triangles, int64_t *area) {
    static const char sql[] = "SELECT vertices, triangles, max_error, rms_error, t_junctions, overlaps, uncovered, "
                              "void_touched, twice_area_in_cells, half_cells FROM rqt_verify(NULL, ?1)";
    sqlite3_stmt *s = ask(db, sql, eps);
    if (sqlite3_step(s) != SQLITE_ROW) stop(db, sql);
    *vertices = sqlite3_column_int64(s, 0);
    *triangles = sqlite3_column_int64(s, 1);
    *area = sqlite3_column_int64(s, 8);
    const int64_t half_cells = sqlite3_column_int64(s, 9);
    const double max_error = sqlite3_column_double(s, 2);
    printf("  %6g %10lld %10lld %10.4g %10.4g %5lld %5lld %5lld %5lld\n", eps, (long long)*vertices,
           (long long)*triangles, max_error, sqlite3_column_double(s, 3), sqlite3_column_int64(s, 4),
           sqlite3_column_int64(s, 5), sqlite3_column_int64(s, 6), sqlite3_column_int64(s, 7));
    const int64_t faults[] = {sqlite3_column_int64(s, 4), sqlite3_column_int64(s, 5), sqlite3_column_int64(s, 6),
                              sqlite3_column_int64(s, 7)};
    sqlite3_finalize(s);
    static const char *const names[] = {"T-junctions", "overlaps", "promised samples in no triangle",
                                        "voids touched"};
    check(max_error <= (eps > t->quantum_error ? eps : t->quantum_error), "the true error is larger than eps");
    for (int i = 0; i < 4; i++) check(faults[i] == 0, names[i]);
    if (!t->has_area) t->twice_area = *area;
    t->has_area = true;
    check(*area == t->twice_area, "the covered area is not that of the first eps");
    check(*area == half_cells, "the covered area is not that of the half cells with three valid corners");
    if (t->voids == 0)
        check(*area == 2 * (t->width - 1) * (t->height - 1), "the covered area is not that of the whole raster");
}

static void check_forms(sqlite3 *db, double eps, int64_t vertices, int64_t triangles, int64_t area) {
    frame at = {0}, strip_at = {0};
    multiset v, t, strip_v, strip_t, rows;
    const bool indexed = ask_mesh(db, eps, 2, &at, &v, &t),
               strip = ask_mesh(db, eps, 1, &strip_at, &strip_v, &strip_t);
    check(indexed, "the bytes of 'indexed' are not as described");
    check(strip, "the bytes of 'strip' are not as described");
    check(v.count == vertices && t.count == triangles && (int64_t)t.twice_area == area,
          "'indexed' is not the mesh that was verified");
    check(t.bad == 0 && strip_t.bad == 0, "a triangle is not counter-clockwise");
    check(!memcmp(&at, &strip_at, sizeof at) && is_same(&v, &strip_v) && is_same(&t, &strip_t),
          "'strip' and 'indexed' differ");
    check(ask_rows(db, "SELECT x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_triangles(NULL, ?1)", eps, 3, &at,
                   &rows) &&
              is_same(&rows, &t) && rows.bad == 0,
          "rqt_triangles and 'indexed' differ");
    check(ask_rows(db, "SELECT x, y, z FROM rqt_range(NULL, ?1)", eps, 1, &at, &rows) && is_same(&rows, &v),
          "rqt_range and 'indexed' differ");
}

static sqlite3 *open_database(const char *extension, terrain *t) {
    sqlite3 *db = NULL;
    if (sqlite3_open_v2(database, &db, SQLITE_OPEN_READONLY, NULL) != SQLITE_OK) stop(db, database);
    char *why = NULL;
    sqlite3_db_config(db, SQLITE_DBCONFIG_ENABLE_LOAD_EXTENSION, 1, NULL);
    if (sqlite3_load_extension(db, extension, NULL, &why) != SQLITE_OK) {
        fprintf(stderr, "verify_data: %s: %s\n", extension, why);
        exit(2);
    }
    sqlite3_stmt *s = ask(
        db, "SELECT width, height, voids, quantum_error, quantum, min_z, max_z, blocks, bytes FROM rqt_terrains",
        0);
    if (sqlite3_step(s) != SQLITE_ROW) stop(db, "rqt_terrains");
    *t = (terrain){.width = sqlite3_column_int64(s, 0),
                   .height = sqlite3_column_int64(s, 1),
                   .voids = sqlite3_column_int64(s, 2),
                   .quantum_error = sqlite3_column_double(s, 3)};
    printf("  %lld x %lld samples, %.1f %% void, %g to %g m, quantum %g m, quantum_error %g m, %lld blocks, %.2f "
           "bytes a sample\n",
           (long long)t->width, (long long)t->height, 100.0 * (double)t->voids / (double)(t->width * t->height),
           sqlite3_column_double(s, 5), sqlite3_column_double(s, 6), sqlite3_column_double(s, 4), t->quantum_error,
           sqlite3_column_int64(s, 7), sqlite3_column_double(s, 8) / (double)(t->width * t->height));
    sqlite3_finalize(s);
    return db;
}

int main(int argc, char **argv) {
    if (argc < 4) {
        fprintf(stderr, "Usage: verify_data DATABASE EXTENSION EPS...\n");
        return 2;
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    database = argv[1];
    terrain t;
    sqlite3 *db = open_database(argv[2], &t);
    printf("  %6s %10s %10s %10s %10s %5s %5s %5s %5s\n", "eps", "vertices", "triangles", "max_error", "rms_error",
           "T", "over", "bare", "void");
    double proofs = 0, forms = 0;
    for (int i = 3; i < argc; i++) {
        now_eps = strtod(argv[i], NULL);
        int64_t vertices, triangles, area;
        const double begin = seconds();
        check_proof(db, &t, now_eps, &vertices, &triangles, &area);
        const double middle = seconds();
        check_forms(db, now_eps, vertices, triangles, area);
        forms += seconds() - middle;
        proofs += middle - begin;
    }
    sqlite3_close(db);
    printf("  verified in %.1f s, forms compared in %.1f s\n%d %d\n", proofs, forms, passed, failed);
    return failed > 0;
}
