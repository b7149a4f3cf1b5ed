/* fuzz_store.h - a database in memory with two terrains, as the store writes them, and hostile values as SQL. */
#ifndef FUZZ_STORE_H
#define FUZZ_STORE_H

#include "functions.h"
#include "rqt_extension.h"

#include "fuzz_terrain.h"

static inline void fuzz_run(sqlite3 *db, const char *sql) {
    char *error = NULL;
    HOLD(sqlite3_exec(db, sql, NULL, NULL, &error) == SQLITE_OK, "%s: %s", sql, error);
}

static inline void fuzz_write_terrain(sqlite3 *db, const char *name, uint8_t seed, bool wgs84) {
    static fuzz_terrain t;
    uint8_t decisions[64];
    for (size_t i = 0; i < sizeof decisions; i++) decisions[i] = (uint8_t)(seed + 41 * i);
    decisions[0] = 2; /* any shape */
    decisions[1] = decisions[2] = FUZZ_SIDE - 2;
    decisions[3] = 1; /* k 2 */
    input in = {decisions, sizeof decisions};
    take_terrain(&in, &t);
    const rqt_allocator *a = store_allocator();
    rqt_errors e;
    pyramid p;
    rqt_codec *codec;
    store_writer *writer = NULL;
    char *error = NULL;
    store_terrain info = {.lattice = t.grid.lattice,
                          .k = t.k,
                          .placement =
                              wgs84 ? (rqt_placement){-71.45, 44.4, 0.01, -0.01} : (rqt_placement){0, 0, 1, -1},
                          .unit = t.unit,
                          .cost = t.cost,
                          .srid = wgs84 ? 4326 : 0,
                          .lonlat = wgs84,
                          .wgs84 = wgs84,
                          .crs = "",
                          .vertical = "",
                          .source = "fuzz",
                          .created = "2000-01-01T00:00:00Z",
                          .min_q = -RQT_HEIGHT_LIMIT + 1,
                          .max_q = RQT_HEIGHT_LIMIT - 1};
    for (int i = 0; i < t.grid.lattice.width * t.grid.lattice.height; i++)
        info.voids += t.grid.valid && !t.valid[i];
    (void)snprintf(info.name, sizeof info.name, "%s", name);
    const int code = store_writer_begin(db, &info, true, &writer, &error);
    HOLD(code == SQLITE_OK, "%s", error);
    HOLD(rqt_errors_compute(&t.grid, &t.unit, &t.cost, a, NULL, NULL, &e) == RQT_OK, "errors");
    rqt_errors_saturate(&e);
    HOLD(pyramid_make(&t, &e, a, &p) == RQT_OK && rqt_codec_create(a, &codec) == RQT_OK, "blocks");
    uint8_t *bytes = malloc(rqt_block_bound(t.k));
    if (!bytes) abort();
    for (size_t i = 0; i < p.count; i++) {
        size_t size;
        HOLD(rqt_block_encode(codec, &p.block[i], fabs(rqt_unit_factor(&t.unit)) / t.unit.d, bytes, &size) ==
                 RQT_OK,
             "encode");
        HOLD(store_writer_block(writer, p.number[i], &p.summary[i], bytes, size, &error) == SQLITE_OK, "%s", error);
    }
    HOLD(store_writer_finish(writer, RQT_CODE_LARGEST, &error) == SQLITE_OK, "%s", error);
    store_writer_free(writer);
    free(bytes);
    rqt_codec_free(codec);
    pyramid_free(&p, a);
    rqt_errors_free(&e, a);
}

static inline sqlite3 *fuzz_connect(void) {
    sqlite3 *db = NULL;
    HOLD(sqlite3_open(":memory:", &db) == SQLITE_OK && sqlite3_rqt_init(db, NULL, NULL) == SQLITE_OK, "open");
    return db;
}

static inline sqlite3 *fuzz_database(void) {
    sqlite3 *db = fuzz_connect();
    char *error = NULL;
    fuzz_run(db, "BEGIN IMMEDIATE");
    HOLD(store_make_geopackage(db, &error) == SQLITE_OK, "%s", error);
    fuzz_write_terrain(db, "hills", 1, true);
    fuzz_write_terrain(db, "plain", 5, false);
    fuzz_run(db, "CREATE TABLE places(geom, eps);"
                 "INSERT INTO places VALUES ('POINT(-71.3 44.3)', 1), ('LINESTRING(2 -2, 9 -9)', 0.5);"
                 "CREATE TABLE odd(shape BLOB, eps);"
                 "INSERT INTO odd VALUES ('POLYGON((1 -1,9 -1,9 -9,1 -1))', 2), (x'47500001', 1);"
                 "CREATE TABLE wrong(geometry TEXT, eps);"
                 "INSERT INTO wrong VALUES ('POINT(3 -3)', 9e999), ('POINT(3 -3)', 'deep'), (NULL, 1);"
                 "CREATE TABLE bare(x);"
                 "CREATE VIEW several AS SELECT geom, geom AS shape, eps FROM places;"
                 "CREATE VIEW broken AS SELECT geom, nosuch(eps) AS eps FROM places;"
                 "CREATE VIEW round AS SELECT 'POINT(3 -3)' AS geom, error AS eps FROM "
                 "rqt_range('POINT(3 -3)', 3, 'plain', '{\"detail\":\"round\"}');"
                 "CREATE VIEW many AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 300) "
                 "SELECT 'POINT(' || i % 20 || ' ' || -i / 15 || ')' AS geom, i / 9.0 AS eps FROM n");
    fuzz_run(db, "COMMIT");
    return db;
}

/* Steps through all rows, reading every value; the result code. */
static inline int fuzz_ask(sqlite3 *db, const char *sql, sqlite3_stmt *s) {
    int code;
    long rows = 0;
    while ((code = sqlite3_step(s)) == SQLITE_ROW && rows++ < 20000)
        for (int i = 0; i < sqlite3_column_count(s); i++) {
            (void)sqlite3_column_double(s, i);
            (void)sqlite3_column_text(s, i);
            (void)sqlite3_column_bytes(s, i);
        }
    HOLD(code == SQLITE_DONE || code == SQLITE_ROW || sqlite3_errmsg(db)[0], "%s: an error without a sentence",
         sql);
    return code == SQLITE_ROW ? SQLITE_DONE : code;
}

/* A statement may take long, an enemy's view for ever: interrupted, it must end. */
static inline int fuzz_patience(void *context) {
    long *left = context;
    return --*left < 0;
}

/* ---------------------------------------------------------------------------------------- hostile values */
/* Options that mostly fit: a few keys, each with a value of its own kind; of detail, lists and tables. */
static inline void take_options(input *in, char *text, size_t room) {
    static const struct {
        const char *key, *values[8];
    } options[] = {
        {"mode", {"\"cover\"", "\"snap\"", "\"border\"", "\"cut\"", "\"cut\"", "\"border\"", "\"snap\"", "[]"}},
        {"detail",
         {"\"places\"", "\"odd\"", "\"wrong\"", "\"bare\"", "\"several\"", "\"broken\"", "\"round\"", "\"many\""}},
        {"detail",
         {"\"main.places\"", "\"temp.places\"", "\"rqt_terrain\"", "\"sqlite_schema\"", "\"\"", "\"places\\\" x\"",
          "\"rqt_help\"", "{\"places\":1}"}},
        {"outline", {"\"exact\"", "\"tol\"", "\"tol\"", "\"tol\"", "\"exact\"", "\"\"", "null", "3"}},
        {"frame", {"\"ecef\"", "\"enu\"", "\"crs\"", "\"ecef\"", "\"enu\"", "\"ECEF\"", "true", "\"enu \""}},
        {"select",
         {"\"topdown\"", "\"bottomup\"", "\"threshold\"", "\"topdown\"", "\"bottomup\"", "1", "\"\"", "\"top\""}},
        {"metric",
         {"\"minimal\"", "\"wedgie\"", "\"exact\"", "\"local\"", "\"euclid\"", "\"wedgie\"", "\"exact\"", "0"}},
        {"max_vertices", {"4", "40", "400", "1e15", "3.5", "-9e99", "9007199254740993", "\"40\""}},
    };
    static const char *const geometries[] = {
        "\"POINT(-71.3 44.3)\"",
        "\"POINT(3 -3)\"",
        "\"POLYGON((1 -1,9 -1,9 -9,1 -1))\"",
        "\"POLYGON((-71.4 44.2, -71.2 44.2, -71.3 44.4, -71.4 44.2))\"",
        "\"LINESTRING(0 0, 1e300 -1e300)\"",
        "\"POLYGON EMPTY\"",
        "\"SRID=31287;POINT(1 1)\"",
        "\"POINT(nan 1)\"",
        "\"GEOMETRYCOLLECTION(POINT(2 -2),LINESTRING(0 0,20 -20),POLYGON((0 0,9 0,9 -9,0 0)))\"",
        "7",
        "\"\\u0000\""};
    static const char *const tolerances[] = {"0",     "0.5", "3",     "40",     "1e308",
                                             "9e999", "-1",  "\"3\"", "1e-320", "3,4"};
    size_t n = (size_t)snprintf(text, room, "'{");
    for (int i = take_between(in, 1, 3); i > 0; i--) {
        const int which = take_between(in, 0, (int)(sizeof options / sizeof *options));
        if (which < (int)(sizeof options / sizeof *options)) {
            n += (size_t)snprintf(text + n, room - n, "\"%s\":%s", options[which].key,
                                  options[which].values[take_between(in, 0, 7)]);
        } else {
            n += (size_t)snprintf(text + n, room - n, "\"detail\":[");
            for (int more = take_between(in, 0, 3); more > 0; more--)
                n += (size_t)snprintf(text + n, room - n, "[%s,%s]%s",
                                      geometries[take_bits(in, 1) % (sizeof geometries / sizeof *geometries)],
                                      tolerances[take_bits(in, 1) % (sizeof tolerances / sizeof *tolerances)],
                                      more > 1 ? "," : "");
            n += (size_t)snprintf(text + n, room - n, "]");
        }
        n += (size_t)snprintf(text + n, room - n, i > 1 ? "," : "}'");
    }
}

/* An SQL expression, in a buffer of at least 400 characters. */
static inline void take_value(input *in, char *text, size_t room) {
    static const char *const regions[] = {"NULL",
                                          "''",
                                          "'POINT(-71.3 44.3)'",
                                          "'POLYGON((-71.4 44.2, -71.2 44.2, -71.3 44.4, -71.4 44.2))'",
                                          "'LINESTRING(2 -2, 9 -9)'",
                                          "'POLYGON EMPTY'",
                                          "rqt_bbox(-71.4, 44.2, -71.3, 44.3)",
                                          "rqt_bbox(2, -9, 9, -2, 0)",
                                          "rqt_bbox(1, 1, 0, 0)",
                                          "rqt_circle(-71.3, 44.3, 2000)",
                                          "'SRID=4326;POINT(-71.3 44.3)'",
                                          "'SRID=31287;POINT(1 1)'",
                                          "x'4750000100000000'",
                                          "zeroblob(100)",
                                          "'GEOMETRYCOLLECTION(POINT(1 -1),POLYGON((0 0,9 0,9 -9,0 0)))'"};
    static const char *const others[] = {
        "'hills'",
        "'plain'",
        "'main.plain'",
        "'nosuch'",
        "'strip'",
        "'indexed'",
        "'rqt'",
        "'obj'",
        "'ply'",
        "'wkb'",
        "'gpkg'",
        "'spatialite'",
        "'glb'",
        "'glb+normals'",
        "'glb+quantized+normals'",
        "'{}'",
        "'[]'",
        "'{'",
        "'null'",
        "x''",
        "9e999",
        "-9e999",
        "9223372036854775807",
        "-9223372036854775808",
        "1e-320",
        "0.5",
        "0",
        "1",
        "3",
        "20",
        "1000",
        "-1",
        "(SELECT data FROM rqt_block_1 LIMIT 1)",
        "(SELECT data FROM rqt_block_2 ORDER BY id DESC LIMIT 1)",
        "(SELECT summary FROM rqt_block_1 LIMIT 1)",
        "randomblob(60)",
        "(SELECT substr(data, 2) FROM rqt_block_1)",
        "(SELECT substr(data, 1, 30) || x'ff' || substr(data, 32) FROM rqt_block_1 LIMIT 1)",
        "printf('%.*c', 5000, 'a')",
        "char(0, 65)",
        "CAST(x'ff41' AS TEXT)"};
    static const char *const keys[] = {"mode",         "outline",       "metric",   "select", "strip", "detail",
                                       "max_vertices", "max_triangles", "previous", "frame",  "test",  "unknown"};
    static const char *const values[] = {"\"cover\"",
                                         "\"snap\"",
                                         "\"border\"",
                                         "\"cut\"",
                                         "\"exact\"",
                                         "\"tol\"",
                                         "\"minimal\"",
                                         "\"local\"",
                                         "\"wedgie\"",
                                         "\"euclid\"",
                                         "\"threshold\"",
                                         "\"topdown\"",
                                         "\"bottomup\"",
                                         "\"fan\"",
                                         "\"bintree\"",
                                         "\"crs\"",
                                         "\"ecef\"",
                                         "\"enu\"",
                                         "3",
                                         "4",
                                         "40",
                                         "1e99",
                                         "-1",
                                         "null",
                                         "[]",
                                         "[[null,3]]",
                                         "{}",
                                         "\"\"",
                                         "true",
                                         "[[\"POINT(-71.3 44.3)\",1]]",
                                         "\"rqt_terrain\""};
    switch (take_between(in, 0, 5)) {
    case 0:
    case 1:
        (void)snprintf(text, room, "%s", regions[take_bits(in, 1) % (sizeof regions / sizeof *regions)]);
        break;
    case 2: {
        size_t n = (size_t)snprintf(text, room, "'{");
        for (int i = take_between(in, 1, 3); i > 0; i--)
            n += (size_t)snprintf(text + n, room - n, "\"%s\":%s%s",
                                  keys[take_bits(in, 1) % (sizeof keys / sizeof *keys)],
                                  values[take_bits(in, 1) % (sizeof values / sizeof *values)], i > 1 ? "," : "}'");
        break;
    }
    case 3: {
        const double v = take_double(in);
        if (isfinite(v))
            (void)snprintf(text, room, "%.17g", v);
        else
            (void)snprintf(text, room, isnan(v) ? "NULL" : v > 0 ? "9e999" : "-9e999");
        break;
    }
    default:
        (void)snprintf(text, room, "%s", others[take_bits(in, 1) % (sizeof others / sizeof *others)]);
    }
}

#endif
