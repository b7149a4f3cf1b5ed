/* bench_flight.c - fly-overs of 1000 frames, each a view of its own through SQL, beside the papers' figures.
 *
 * line: [RQT] section 11, tables 2 and 3: 1000 m/s, 60 degrees of view, 38 frames a second, 13 x 13 patches of 4 km
 * in sight (so nothing is drawn beyond 26 km). Picture, height and pixel tolerance are not printed and ours.
 * circle: HyperBlock-QuadTIN, section 5: 2049 x 2049 samples, 45 degrees, 1024 x 768 pixels, around the terrain's
 * centre. Radius and height are ours.
 */
#include "bench_views.h"

#include <math.h>
#include <sqlite3.h>
#include <stdlib.h>
#include <string.h>

enum { FRAMES = 1000, PAPER_SECONDS = 10 };
#define PAPER_RATE 38.0 /* frames a second: table 2, adaptive triangulation */
#define SPEED 1000.0    /* metres a second */
#define SIGHT 26000.0   /* metres: half of 13 patches of 4 km */
#define ALTITUDE 5000.0 /* metres above the sea; the generated terrain's highest sample is at 4000 */

static const bench_aim NO_AIM = {BENCH_NO_AIM, 0};
static const double TURN = 6.283185307179586;

static int frames_flown(void) {
    const char *text = getenv("BENCH_FRAMES");
    const int n = text ? atoi(text) : FRAMES;
    return n > 0 && n < FRAMES ? n : FRAMES;
}

typedef struct extent {
    double x0, y0, x1, y1; /* west, south, east, north */
} extent;

static view_camera camera_on_line(const extent *e, int frame) {
    return (view_camera){.x = e->x0 + 20000 + SPEED * frame / PAPER_RATE,
                         .y = (e->y0 + e->y1) / 2,
                         .z = ALTITUDE,
                         .yaw = 90,
                         .pitch = -10,
                         .fovy = view_fovy(60, 1280, 1024),
                         .width = 1280,
                         .height = 1024,
                         .tau = 1,
                         .far = SIGHT,
                         .exaggeration = 1};
}

static view_camera camera_on_circle(const extent *e, int frame) {
    const double radius = (e->x1 - e->x0) / 4, turn = TURN * frame / FRAMES;
    return (view_camera){.x = (e->x0 + e->x1) / 2 + radius * sin(turn),
                         .y = (e->y0 + e->y1) / 2 + radius * cos(turn),
                         .z = ALTITUDE,
                         .yaw = fmod(turn / TURN * 360 + 180, 360), /* to the centre, 3 km below */
                         .pitch = -atan(3000 / radius) / TURN * 360,
                         .fovy = 45,
                         .width = 1024,
                         .height = 768,
                         .tau = 1,
                         .exaggeration = 1};
}

/* ------------------------------------------------------------------------------------------ new vertices -- */
typedef struct places {
    uint64_t *at; /* row and column, ascending */
    size_t count, room;
} places;

static int ascending(const void *a, const void *b) {
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Of a strip BLOB, behind its header: int32 column, row, height. */
static void read_places(const unsigned char *vertices, size_t count, places *p) {
    if (count > p->room) {
        p->at = realloc(p->at, count * sizeof *p->at);
        if (!p->at) bench_stop("fly-over", "out of memory");
        p->room = count;
    }
    for (size_t i = 0; i < count; i++) {
        uint32_t v[2];
        memcpy(v, vertices + 12 * i, sizeof v);
        p->at[i] = (uint64_t)v[1] << 32 | v[0];
    }
    p->count = count;
    qsort(p->at, count, sizeof *p->at, ascending);
}

static size_t count_new(const places *old, const places *now) {
    size_t new = 0;
    for (size_t i = 0, j = 0; i < now->count; i++) {
        while (j < old->count && old->at[j] < now->at[i]) j++;
        new += j == old->count || old->at[j] != now->at[i];
    }
    return new;
}

/* ------------------------------------------------------------------------------------------------ flying -- */
typedef struct flight {
    bench_times triangles, vertices, new_vertices, select, strip, wire, follow, strip_bytes, wire_bytes,
        increment_bytes;
    int unchanged; /* frames that were the one before */
} flight;

static void fly(const char *database, const char *extension, const char *csv_path,
                view_camera (*camera_at)(const extent *, int), flight *f) {
    sqlite3 *db = bench_open(database, extension, false);
    sqlite3_stmt *place = bench_prepare(db, "SELECT x0, y0 + (height - 1) * dy, x0 + (width - 1) * dx, y0 "
                                            "FROM rqt_terrains");
    if (sqlite3_step(place) != SQLITE_ROW) bench_stop(database, "no terrain");
    const extent e = {sqlite3_column_double(place, 0), sqlite3_column_double(place, 1),
                      sqlite3_column_double(place, 2), sqlite3_column_double(place, 3)};
    sqlite3_finalize(place);
    FILE *csv = fopen(csv_path, "w");
    if (!csv) bench_stop(csv_path, "cannot be written");
    fprintf(csv,
            "frame,triangles,vertices,new_vertices,select_ms,strip_ms,wire_ms,increment_ms,strip_bytes,wire_bytes,"
            "increment_bytes\n");
    sqlite3_stmt *rows = bench_prepare(db, "SELECT x FROM rqt_view(?1)"),
                 *strip = bench_prepare(db, "SELECT rqt_view_mesh(?1, 'strip')"),
                 *wire = bench_prepare(db, "SELECT rqt_view_mesh(?1, 'rqt')");
    places old = {0}, now = {0};
    view_follower follower = {0};
    for (int frame = -1; frame < frames_flown();
         frame++) { /* -1: frame 0 on the ground, with nothing in the cache */
        const view_camera c = camera_at(&e, frame < 0 ? 0 : frame);
        view_bind(rows, &c);
        view_bind(strip, &c);
        view_bind(wire, &c);
        double t[8];
        t[0] = bench_now();
        if (sqlite3_step(strip) != SQLITE_ROW) bench_stop("rqt_view_mesh", sqlite3_errmsg(db));
        t[1] = bench_now();
        const view_strip s = view_strip_read(strip);
        const places swap = old;
        old = now;
        now = swap;
        read_places((const unsigned char *)sqlite3_column_blob(strip, 0) + 128, s.vertices, &now);
        sqlite3_reset(strip);
        t[2] = bench_now();
        if (sqlite3_step(rows) != SQLITE_ROW) bench_stop("rqt_view", sqlite3_errmsg(db));
        t[3] = bench_now();
        sqlite3_reset(rows);
        t[4] = bench_now();
        int64_t wire_bytes = 0;
        bench_run(wire, &wire_bytes);
        t[5] = bench_now();
        view_follow(db, &follower, &c);
        t[6] = bench_now();
        if (frame < 0) continue;
        const size_t fresh = count_new(&old, &now);
        bench_add(&f->strip, t[1] - t[0]);
        bench_add(&f->select, t[3] - t[2]);
        bench_add(&f->wire, t[5] - t[4]);
        bench_add(&f->follow, t[6] - t[5]);
        bench_add(&f->increment_bytes, (double)follower.bytes);
        f->unchanged += follower.is_unchanged;
        bench_add(&f->triangles, (double)s.triangles);
        bench_add(&f->vertices, (double)s.vertices);
        bench_add(&f->new_vertices, (double)fresh);
        bench_add(&f->strip_bytes, (double)s.bytes);
        bench_add(&f->wire_bytes, (double)wire_bytes);
        fprintf(csv, "%d,%zu,%zu,%zu,%.3f,%.3f,%.3f,%.3f,%zu,%lld,%zu\n", frame, s.triangles, s.vertices, fresh,
                1e3 * (t[3] - t[2]), 1e3 * (t[1] - t[0]), 1e3 * (t[5] - t[4]), 1e3 * (t[6] - t[5]), s.bytes,
                (long long)wire_bytes, follower.bytes);
    }
    const bool failed = ferror(csv) || fflush(csv);
    if (fclose(csv) || failed) bench_stop(csv_path, "cannot be written");
    free(old.at);
    free(now.at);
    sqlite3_finalize(rows);
    sqlite3_finalize(strip);
    sqlite3_finalize(wire);
    sqlite3_finalize(follower.statement);
    sqlite3_close(db);
}

static double sum(const bench_times *times, int frames) {
    double total = 0;
    for (int i = 0; i < frames && i < times->runs; i++) total += times->value[i];
    return total;
}

static void show(bench_table *table, const flight *f) {
    const int frames = f->strip.runs;
    const bench_times mean_strip = {1, {sum(&f->strip, frames) / frames}},
                      mean_follow = {1, {sum(&f->follow, frames) / frames}};
    bench_table_row(table, "triangles", &f->triangles, "k", 1e-3, false, NULL, NULL, NO_AIM);
    bench_table_row(table, "vertices", &f->vertices, "k", 1e-3, false, NULL, NULL, NO_AIM);
    bench_table_row(table, "vertices that the frame before had not", &f->new_vertices, "k", 1e-3, false, NULL, NULL,
                    NO_AIM);
    bench_table_row(table, "vertices selected (first row of rqt_view)", &f->select, "ms", 1e3, false, NULL, NULL,
                    NO_AIM);
    bench_table_row(table, "all: strip BLOB", &f->strip, "ms", 1e3, false, "select", &f->select, NO_AIM);
    bench_table_row(table, "all: wire format", &f->wire, "ms", 1e3, false, "select", &f->select, NO_AIM);
    bench_table_row(table, "all: increment against the last answer", &f->follow, "ms", 1e3, false, "strip",
                    &f->strip, NO_AIM);
    bench_table_row(table, "... mean of all frames", &mean_follow, "ms", 1e3, false, "strip", &mean_strip, NO_AIM);
    bench_table_count(table, "... frames in which nothing changes", f->unchanged, "", "frames", frames, NO_AIM);
    bench_table_row(table, "strip BLOB", &f->strip_bytes, "kB", 1e-3, false, NULL, NULL, NO_AIM);
    bench_table_row(table, "wire format", &f->wire_bytes, "kB", 1e-3, false, "strip", &f->strip_bytes, NO_AIM);
    bench_table_row(table, "increment", &f->increment_bytes, "kB", 1e-3, false, "strip", &f->strip_bytes, NO_AIM);
    bench_table_count(table, "... mean of all frames", sum(&f->increment_bytes, frames) / frames / 1e3, "kB",
                      "strip", sum(&f->strip_bytes, frames) / frames / 1e3, NO_AIM);
}

void bench_flight(bench_table *table, const char *folder, const char *extension, double import_seconds) {
    static flight line, circle;
    char database[4096], csv[4096], title[256];
    snprintf(database, sizeof database, "%s/fbm_4097.gpkg", folder);
    snprintf(csv, sizeof csv, "%s/flight-line.csv", folder);
    fly(database, extension, csv, camera_on_line, &line);
    snprintf(
        title, sizeof title,
        "Fly-over, %d frames: 1000 m/s at %.0f m, 38 frames/s, 1280 x 1024 pixels, 60 degrees across, tau 1 px,\n"
        "ground to 26 km (RQT, table 3: 52 km x 52 km of 25 m, 65 patches of 4 km in 10 s)",
        FRAMES, ALTITUDE);
    bench_table_section(table, "line", title, "of other");
    show(table, &line);
    const int frames = (int)(PAPER_RATE * PAPER_SECONDS);
    bench_table_count(table, "10 s of flight: strips of 380 frames", 1e3 * sum(&line.strip, frames), "ms", "paper",
                      1570, NO_AIM);
    bench_table_count(table, "10 s of flight: increments of 380 frames", 1e3 * sum(&line.follow, frames), "ms",
                      "paper", 1570, NO_AIM);
    bench_table_count(table, "10 s of flight: bytes of the increments (paper: at 4 bytes a vertex)",
                      sum(&line.increment_bytes, frames) / 1e3, "kB", "paper", 9922 * 4 / 1e3, NO_AIM);
    bench_table_count(table, "10 s of flight: new vertices", sum(&line.new_vertices, frames), "", "paper", 9922,
                      NO_AIM);
    bench_table_count(table, "triangles of a frame (paper: table 2)", bench_summarise(&line.triangles).median, "",
                      "paper", 8000, NO_AIM);

    snprintf(database, sizeof database, "%s/fbm_2049.gpkg", folder);
    snprintf(csv, sizeof csv, "%s/flight-circle.csv", folder);
    fly(database, extension, csv, camera_on_circle, &circle);
    snprintf(title, sizeof title,
             "Fly-over, %d frames: a circle around the centre of 2049 x 2049 samples, 1024 x 768 pixels, fovy 45,\n"
             "tau 1 px (HyperBlock-QuadTIN, section 5: Puget Sound)",
             FRAMES);
    bench_table_section(table, "circle", title, "of other");
    show(table, &circle);
    bench_table_count(table, "import (paper: preprocessing, less than 15 s)", import_seconds, "s", "paper", 15,
                      NO_AIM);
}
