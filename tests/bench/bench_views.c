/* bench_views.c - what a view costs: a camera and a tolerance in pixels, answered through SQL.
 *
 *     bench_views FOLDER EXTENSION IMPORT_SECONDS MACHINE DATA
 *
 * FOLDER holds fbm_4097.gpkg and the same raster as fbm_4097.tif, fbm_2049.gpkg, whose import took so many seconds,
 * and, where it could be had, etopo5.gpkg; figures go to FOLDER/views.csv. bench_views.sh makes them all.
 *
 * Peers: of one megapixel view, what a program without views would do: ask for the ground in sight (the convex hull
 * of what is drawn) with one eps that keeps the nearest ground within the tolerance, or read its heights with GDAL.
 * Of the fly-overs and of the view over a network, the figures that the papers print.
 */
#include "bench_views.h"

#include <gdal.h>
#include <math.h>
#include <sqlite3.h>
#include <stdlib.h>
#include <string.h>

enum { BURSTS = 5, BURST = 3, FRESH = 9, SLOW = 3, MOST_HULL = 4096 };

static const bench_aim NO_AIM = {BENCH_NO_AIM, 0}, WITHIN = {BENCH_AT_MOST, 1};
static const char STRIP[] = "SELECT rqt_view_mesh(?1, 'strip')";
static const char *extension_path;

/* ---------------------------------------------------------------------------------------------- cameras -- */
void view_write(const view_camera *c, char text[VIEW_TEXT]) {
    char far[48] = "";
    if (c->far > 0) snprintf(far, sizeof far, ",\"far\":%.17g", c->far);
    snprintf(text, VIEW_TEXT,
             "{\"eye\":[%.17g,%.17g,%.17g],\"yaw\":%.17g,\"pitch\":%.17g,\"fovy\":%.17g,\"width\":%d,\"height\":%d,"
             "\"tau\":%.17g,\"exaggeration\":%.17g%s}",
             c->x, c->y, c->z, c->yaw, c->pitch, c->fovy, c->width, c->height, c->tau, c->exaggeration, far);
}

void view_bind(sqlite3_stmt *statement, const view_camera *camera) {
    char text[VIEW_TEXT];
    view_write(camera, text);
    sqlite3_bind_text(statement, 1, text, -1, SQLITE_TRANSIENT);
}

static const double RADIANS = 0.017453292519943295;

double view_fovy(double degrees, int width, int height) {
    return 2 * atan(tan(degrees * RADIANS / 2) * height / width) / RADIANS;
}

double view_single(sqlite3 *db, const char *sql, const view_camera *camera) {
    sqlite3_stmt *s = bench_prepare(db, sql);
    view_bind(s, camera);
    if (sqlite3_step(s) != SQLITE_ROW) bench_stop(sql, sqlite3_errmsg(db));
    const double value = sqlite3_column_double(s, 0);
    sqlite3_finalize(s);
    return value;
}

/* Little endian, as the format has it and the machines of the benches, too. FORMAT.md, "strip". */
enum { STRIP_VERTICES = 16, STRIP_INDICES = 24, STRIP_HEADER = 128, STRIP_VERTEX = 12 };

view_strip view_strip_read(sqlite3_stmt *statement) {
    const unsigned char *blob = sqlite3_column_blob(statement, 0);
    view_strip strip = {.bytes = (size_t)sqlite3_column_bytes(statement, 0)};
    if (!blob || strip.bytes < STRIP_HEADER) bench_stop(sqlite3_sql(statement), "no strip");
    uint64_t vertices, indices;
    memcpy(&vertices, blob + STRIP_VERTICES, 8);
    memcpy(&indices, blob + STRIP_INDICES, 8);
    strip.vertices = vertices;
    const unsigned char *at = blob + STRIP_HEADER + STRIP_VERTEX * vertices;
    uint32_t i[3];
    for (uint64_t n = 0; n + 2 < indices; n++) {
        memcpy(i, at + 4 * n, sizeof i);
        strip.triangles += i[0] != i[1] && i[1] != i[2] && i[0] != i[2];
    }
    return strip;
}

/* FORMAT.md, "View increment". */
enum { NOTE_FLAGS = 5, NOTE_SIZE = 40, NOTE_PAYLOAD = 44, NOTE_HEADER = 48, NOTE_FRAME = 80 };

void view_follow(sqlite3 *db, view_follower *f, const view_camera *camera) {
    if (!f->statement)
        f->statement =
            bench_prepare(db, "SELECT rqt_view_mesh(?1, 'increment', NULL, json_object('previous', ?2))");
    view_bind(f->statement, camera);
    sqlite3_bind_text(f->statement, 2, f->token, -1, SQLITE_TRANSIENT);
    if (sqlite3_step(f->statement) != SQLITE_ROW) bench_stop("increment", sqlite3_errmsg(db));
    const unsigned char *blob = sqlite3_column_blob(f->statement, 0);
    f->bytes = (size_t)sqlite3_column_bytes(f->statement, 0);
    if (f->bytes < NOTE_HEADER) bench_stop("increment", "no increment");
    uint32_t note, payload;
    memcpy(&note, blob + NOTE_SIZE, 4);
    memcpy(&payload, blob + NOTE_PAYLOAD, 4);
    const size_t at = NOTE_HEADER + (blob[NOTE_FLAGS] & 1 ? NOTE_FRAME : 0);
    if (note >= sizeof f->token || at + note > f->bytes) bench_stop("increment", "no token");
    f->is_unchanged = payload == 0 && f->token[0]; /* then the last token holds on */
    if (!f->is_unchanged) {
        memcpy(f->token, blob + at, note);
        f->token[note] = 0;
    }
    sqlite3_reset(f->statement);
}

/* -------------------------------------------------------------------------------------------- in sight -- */
typedef struct point {
    double x, y;
} point;

static int west_to_east(const void *a, const void *b) {
    const point *p = a, *q = b;
    return p->x != q->x ? (p->x > q->x) - (p->x < q->x) : (p->y > q->y) - (p->y < q->y);
}

static double turn(point a, point b, point c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/* Andrew's monotone chain; sorts the points. hull has room for n + 1. */
static size_t convex_hull(point *points, size_t n, point *hull) {
    size_t count = 0;
    qsort(points, n, sizeof *points, west_to_east);
    for (int side = 0; side < 2; side++) {
        const size_t begin = count;
        for (size_t i = 0; i < n; i++) {
            const point p = points[side ? n - 1 - i : i];
            while (count >= begin + 2 && turn(hull[count - 2], hull[count - 1], p) <= 0) count--;
            hull[count++] = p;
        }
        count--; /* the other side begins with it */
    }
    return count;
}

/* The ground that is drawn: its hull and box, and the depth of the nearest vertex. */
typedef struct sight {
    double box[4]; /* x0, y0, x1, y1 */
    double nearest;
    char *polygon; /* sqlite3_free */
} sight;

static sight find_sight(sqlite3 *db, const view_camera *c) {
    const double p = c->pitch * RADIANS, w = c->yaw * RADIANS;
    const double forward[3] = {sin(w) * cos(p), cos(w) * cos(p), sin(p)}, right[3] = {cos(w), -sin(w), 0},
                 up[3] = {-sin(w) * sin(p), -cos(w) * sin(p), cos(p)};
    const double tangent = tan(c->fovy * RADIANS / 2);
    sight s = {{INFINITY, INFINITY, -INFINITY, -INFINITY}, INFINITY, NULL};
    size_t n = 0, room = 0;
    point *drawn = NULL;
    sqlite3_stmt *rows = bench_prepare(db, "SELECT x, y, z FROM rqt_view(?1)");
    view_bind(rows, c);
    while (sqlite3_step(rows) == SQLITE_ROW) {
        const point at = {sqlite3_column_double(rows, 0), sqlite3_column_double(rows, 1)};
        const double v[3] = {at.x - c->x, at.y - c->y, sqlite3_column_double(rows, 2) - c->z};
        double depth = 0, across = 0, upward = 0;
        for (int i = 0; i < 3; i++) depth += v[i] * forward[i], across += v[i] * right[i], upward += v[i] * up[i];
        if (!(depth > 0) || fabs(upward) > tangent * depth || fabs(across) > tangent * depth * c->width / c->height)
            continue;
        if (n == room) {
            room = 2 * room + 1024;
            drawn = realloc(drawn, room * sizeof *drawn);
            if (!drawn) bench_stop("sight", "out of memory");
        }
        drawn[n++] = at;
        s.nearest = fmin(s.nearest, depth);
        s.box[0] = fmin(s.box[0], at.x), s.box[1] = fmin(s.box[1], at.y);
        s.box[2] = fmax(s.box[2], at.x), s.box[3] = fmax(s.box[3], at.y);
    }
    sqlite3_finalize(rows);
    if (n < 3) bench_stop("sight", "no ground is drawn");
    point *hull = malloc((n + 1) * sizeof *hull);
    if (!hull) bench_stop("sight", "out of memory");
    const size_t corners = convex_hull(drawn, n, hull);
    sqlite3_str *text = sqlite3_str_new(NULL);
    for (size_t i = 0; i <= corners; i++)
        sqlite3_str_appendf(text, "%s%.3f %.3f", i ? "," : "POLYGON((", hull[i % corners].x, hull[i % corners].y);
    sqlite3_str_appendall(text, "))");
    s.polygon = sqlite3_str_finish(text);
    free(hull);
    free(drawn);
    return s;
}

/* ------------------------------------------------------------------------------------- one megapixel view -- */
static void read_box(const char *path, const double box[4], bench_times *times) {
    GDALDatasetH raster = GDALOpen(path, GA_ReadOnly);
    double t[6];
    if (!raster || GDALGetGeoTransform(raster, t) != CE_None) bench_stop(path, "GDAL cannot open it");
    const int col = (int)((box[0] - t[0]) / t[1]), row = (int)((box[3] - t[3]) / t[5]),
              width = (int)((box[2] - t[0]) / t[1]) - col + 1, height = (int)((box[1] - t[3]) / t[5]) - row + 1;
    int16_t *heights = malloc(sizeof *heights * (size_t)width * (size_t)height);
    if (!heights) bench_stop(path, "out of memory");
    const double begin = bench_now();
    if (GDALRasterIO(GDALGetRasterBand(raster, 1), GF_Read, col, row, width, height, heights, width, height,
                     GDT_Int16, 0, 0) != CE_None)
        bench_stop(path, "GDAL cannot read it");
    bench_add(times, bench_now() - begin);
    free(heights);
    GDALClose(raster);
}

static void ask(sqlite3_stmt *s, bench_times *times) {
    const double begin = bench_now();
    bench_run(s, NULL);
    if (times) bench_add(times, bench_now() - begin);
}

static void ask_fresh(const char *path, const view_camera *camera, bench_times *times) {
    sqlite3 *db = bench_open(path, extension_path, false);
    const double begin = bench_now();
    sqlite3_stmt *s = bench_prepare(db, STRIP);
    view_bind(s, camera);
    bench_run(s, NULL);
    bench_add(times, bench_now() - begin);
    sqlite3_finalize(s);
    sqlite3_close(db);
}

static view_strip strip_of(sqlite3_stmt *s) {
    if (sqlite3_step(s) != SQLITE_ROW) bench_stop(sqlite3_sql(s), sqlite3_errmsg(sqlite3_db_handle(s)));
    const view_strip strip = view_strip_read(s);
    sqlite3_reset(s);
    return strip;
}

static void bench_view(bench_table *table, const char *database, const char *tiff, const char *name,
                       const view_camera *camera) {
    sqlite3 *db = bench_open(database, extension_path, false);
    sqlite3_stmt *view = bench_prepare(db, STRIP), *plain = bench_prepare(db, "SELECT rqt_mesh(?1, ?2, 'strip')");
    view_bind(view, camera);
    const view_strip strip = strip_of(view);
    sight s = find_sight(db, camera);
    const double focal = camera->height / (2 * tan(camera->fovy * RADIANS / 2)),
                 eps = camera->tau * s.nearest / focal;
    sqlite3_bind_text(plain, 1, s.polygon, -1, SQLITE_STATIC);
    sqlite3_bind_double(plain, 2, eps);
    const view_strip plain_strip = strip_of(plain);
    bench_times warm = {0}, per_50000 = {0}, fresh = {0}, one_eps = {0}, gdal = {0};
    for (int burst = 0; burst < BURSTS; burst++) {
        ask(view, NULL); /* the others have had the processor's caches */
        for (int i = 0; i < BURST; i++) ask(view, &warm);
    }
    for (int i = 0; i < SLOW; i++) {
        ask(plain, &one_eps);
        read_box(tiff, s.box, &gdal);
    }
    for (int i = 0; i < FRESH; i++) ask_fresh(database, camera, &fresh);
    for (int i = 0; i < warm.runs; i++) bench_add(&per_50000, warm.value[i] * 50000 / (double)strip.vertices);

    const bench_times aim_warm = {1, {3e-3}}, aim_fresh = {1, {50e-3}};
    char title[256], what[80];
    snprintf(title, sizeof title, "%s: %d x %d pixels, fovy %g, tau %g px, yaw %g, pitch %g, eye at %.0f m", name,
             camera->width, camera->height, camera->fovy, camera->tau, camera->yaw, camera->pitch, camera->z);
    bench_table_section(table, name, title, "of other");
    bench_table_count(table, "vertices", (double)strip.vertices, "", "one eps", (double)plain_strip.vertices,
                      NO_AIM);
    bench_table_count(table, "triangles", (double)strip.triangles, "", "one eps", (double)plain_strip.triangles,
                      NO_AIM);
    bench_table_row(table, "rqt_view_mesh, strip BLOB, warm", &warm, "ms", 1e3, false, "one eps", &one_eps, NO_AIM);
    bench_table_row(table, "... per 50,000 vertices, beside 3 ms", &per_50000, "ms", 1e3, false, "3 ms", &aim_warm,
                    WITHIN);
    bench_table_row(table, "... first query of a connection, beside 50 ms", &fresh, "ms", 1e3, false, "50 ms",
                    &aim_fresh, WITHIN);
    snprintf(what, sizeof what, "the ground in sight at one eps, %.2g m, warm", eps);
    bench_table_row(table, what, &one_eps, "ms", 1e3, false, NULL, NULL, NO_AIM);
    bench_table_row(table, "GDAL: read of the box of that ground", &gdal, "ms", 1e3, false, "one eps", &one_eps,
                    NO_AIM);
    sqlite3_free(s.polygon);
    sqlite3_finalize(view);
    sqlite3_finalize(plain);
    sqlite3_close(db);
}

/* The camera moves by 1 % (and, to see what comes then, by 10 %): its eye to the side by that share of the distance
 * to the nearest ground drawn, its direction by that share of fovy. */
static void bench_motion(bench_table *table, const char *database, const char *name, const view_camera *camera) {
    static const double shares[] = {0.01, 0.1};
    sqlite3 *db = bench_open(database, extension_path, false);
    sqlite3_stmt *view = bench_prepare(db, STRIP);
    sight s = find_sight(db, camera);
    sqlite3_free(s.polygon);
    for (size_t i = 0; i < sizeof shares / sizeof *shares; i++) {
        view_camera moved = *camera;
        moved.x += shares[i] * s.nearest * cos(camera->yaw * RADIANS);
        moved.y -= shares[i] * s.nearest * sin(camera->yaw * RADIANS);
        moved.yaw += shares[i] * camera->fovy;
        view_bind(view, &moved);
        const view_strip strip = strip_of(view);
        bench_times fresh = {0}, followed = {0};
        view_follower f = {0};
        for (int n = 0; n < BURSTS; n++) {
            ask(view, NULL);
            for (int j = 0; j < BURST; j++) ask(view, &fresh);
            f.token[0] = 0;
            view_follow(db, &f, camera);
            for (int j = 0; j < BURST; j++) {
                view_follower then = f; /* the same step again and again */
                const double begin = bench_now();
                view_follow(db, &then, &moved);
                bench_add(&followed, bench_now() - begin);
                if (n + 1 == BURSTS && j + 1 == BURST) f = then;
            }
        }
        char what[96];
        snprintf(what, sizeof what, "%s, %g %%: fresh strip", name, 100 * shares[i]);
        bench_table_row(table, what, &fresh, "ms", 1e3, false, NULL, NULL, NO_AIM);
        snprintf(what, sizeof what, "%s, %g %%: increment%s", name, 100 * shares[i],
                 f.is_unchanged ? ", nothing changes" : "");
        bench_table_row(table, what, &followed, "ms", 1e3, false, "fresh", &fresh,
                        i == 0 ? (bench_aim){BENCH_AT_MOST, 0.1} : NO_AIM);
        snprintf(what, sizeof what, "%s, %g %%: bytes of the increment", name, 100 * shares[i]);
        bench_table_count(table, what, (double)f.bytes / 1e3, "kB", "strip", (double)strip.bytes / 1e3, NO_AIM);
        sqlite3_finalize(f.statement);
    }
    sqlite3_finalize(view);
    sqlite3_close(db);
}

static void bench_megapixel(bench_table *table, const char *folder) {
    char database[4096], tiff[4096];
    snprintf(database, sizeof database, "%s/fbm_4097.gpkg", folder);
    snprintf(tiff, sizeof tiff, "%s/fbm_4097.tif", folder);
    sqlite3 *db = bench_open(database, extension_path, false);
    view_camera c = {.yaw = 30, .fovy = 45, .width = 1280, .height = 800, .tau = 1, .exaggeration = 1};
    c.x = view_single(db, "SELECT x0 + width * dx * 0.4 FROM rqt_terrains", &c);
    c.y = view_single(db, "SELECT y0 + height * dy * 0.7 FROM rqt_terrains", &c);
    char sql[128];
    snprintf(sql, sizeof sql, "SELECT rqt_height(%.17g, %.17g)", c.x, c.y);
    const double ground = view_single(db, sql, &c);
    sqlite3_close(db);
    static const struct {
        const char *name;
        double above, pitch, tau;
    } cameras[] = {{"low flight", 300, -5, 1},
                   {"high", 8000, -30, 1},
                   {"straight down", 20000, -90, 1},
                   {"low flight, a quarter of a pixel", 300, -5, 0.25}};
    for (int motion = 0; motion < 2; motion++)
        for (size_t i = 0; i < sizeof cameras / sizeof *cameras; i++) {
            if (motion && i == 0)
                bench_table_section(table, "motion", "The camera has moved: what option previous saves",
                                    "of fresh");
            c.z = ground + cameras[i].above;
            c.pitch = cameras[i].pitch;
            c.tau = cameras[i].tau;
            if (motion)
                bench_motion(table, database, cameras[i].name, &c);
            else
                bench_view(table, database, tiff, cameras[i].name, &c);
        }
}

/* -------------------------------------------------------------------------------- a view over a network -- */
/* Client/server binary triangle trees, section 5, tests 1 and 2. What the paper does not say (picture, field of
 * view, pitch) is ours: 1024 x 768, 45 degrees across as is Java3D's default, horizontal. */
static void bench_network(bench_table *table, const char *folder) {
    static const struct {
        double height;
        int queries;
    } tests[] = {{50000, 1977}, {100000, 882}};
    static const char *const names[] = {"guaranteed", "sphere"};
    enum { QUERY_BYTES = 18 }; /* 8 up, 10 down */
    char path[4096];
    snprintf(path, sizeof path, "%s/etopo5.gpkg", folder);
    FILE *file = fopen(path, "rb");
    if (!file) {
        printf("\n(ETOPO5 is not there: no view over a network)\n");
        return;
    }
    fclose(file);
    sqlite3 *db = bench_open(path, extension_path, false);
    bench_table_section(
        table, "network",
        "ETOPO5, land and sea floor, eye at 58 N 10.5 E, looking north, exaggeration 5, 5 px\n"
        "(1024 x 768, 45 degrees across, pitch 0: ours), beside client/server binary triangle trees",
        "of paper");
    for (size_t t = 0; t < sizeof tests / sizeof *tests; t++)
        for (size_t n = 0; n < sizeof names / sizeof *names; n++) {
            const view_camera c = {.x = 10.5,
                                   .y = 58,
                                   .z = tests[t].height,
                                   .fovy = view_fovy(45, 1024, 768),
                                   .width = 1024,
                                   .height = 768,
                                   .tau = 5,
                                   .exaggeration = 5};
            char sql[128], what[80];
            snprintf(sql, sizeof sql, "SELECT count(*) FROM rqt_view(?1, NULL, '{\"test\":\"%s\"}')", names[n]);
            snprintf(what, sizeof what, "%.0f km, %s: vertices", tests[t].height / 1000, names[n]);
            bench_table_count(table, what, view_single(db, sql, &c), "", "queries", tests[t].queries, NO_AIM);
            snprintf(sql, sizeof sql, "SELECT length(rqt_view_mesh(?1, 'rqt', NULL, '{\"test\":\"%s\"}'))",
                     names[n]);
            snprintf(what, sizeof what, "%.0f km, %s: bytes of the wire format", tests[t].height / 1000, names[n]);
            bench_table_count(table, what, view_single(db, sql, &c), "", "bytes", tests[t].queries * QUERY_BYTES,
                              NO_AIM);
        }
    sqlite3_close(db);
}

int main(int argc, char **argv) {
    if (argc != 6) {
        fprintf(stderr, "Usage: bench_views FOLDER EXTENSION IMPORT_SECONDS MACHINE DATA\n");
        return 2;
    }
    extension_path = argv[2];
    char csv[4096];
    snprintf(csv, sizeof csv, "%s/views.csv", argv[1]);
    bench_table table;
    if (!bench_table_open(&table, csv, argv[4], argv[5])) bench_stop(csv, "cannot be written");
    setvbuf(stdout, NULL, _IOLBF, 0);
    printf("Machine: %s\nData: %s\nMedians%s; a ratio is of medians.\n", argv[4], argv[5],
           getenv("BENCH_CPU") ? " of processor time" : "");
    GDALAllRegister();
    bench_megapixel(&table, argv[1]);
    bench_flight(&table, argv[1], extension_path, atof(argv[3]));
    bench_network(&table, argv[1]);
    if (!bench_table_close(&table)) bench_stop(csv, "cannot be written");
    return 0;
}
