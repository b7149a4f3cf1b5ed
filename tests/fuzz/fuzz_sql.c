/* fuzz_sql.c - every function of the table of ext/functions.c with any arguments: an answer, or an error that says
 * which function it is of. A new function is called as soon as it stands in the table. */
#include "fuzz_store.h"

/* What the argument of this name wants, mostly; sometimes anything. */
static void take_argument(input *in, const char *name, size_t n, char *text, size_t room) {
    if (n == strlen("options") && strncmp(name, "options", n) == 0 && take_between(in, 0, 3)) {
        take_options(in, text, room);
        return;
    }
    static const struct {
        const char *name, *values[8];
    } fitting[] = {
        {"region",
         {"NULL", "'POLYGON((-71.4 44.2, -71.25 44.2, -71.3 44.4, -71.4 44.2))'",
          "rqt_bbox(-71.4, 44.2, -71.3, 44.3)", "'POLYGON((1.5 -2.5, 14 -3, 9 -19.25, 1.5 -2.5))'",
          "'LINESTRING(2 -2, 9 -9)'", "'POINT(-71.3 44.3)'", "rqt_circle(-71.3, 44.3, 2000)",
          "'MULTIPOLYGON(((1 -1,9 -1,9 -9,1 -1),(2 -2,4 -2,4 -3,2 -2)))'"}},
        {"camera",
         {"'{\"eye\":[-71.4,44.2,3000],\"yaw\":30,\"pitch\":-20,\"fovy\":60,\"width\":64,\"height\":48,\"tau\":4}'",
          "'{\"eye\":[5,-5,90],\"at\":[9,-9,0],\"fovy\":60,\"width\":64,\"height\":48,\"roll\":-7,\"near\":1}'",
          "'{\"eye\":[5,-5,1],\"at\":[5,-5,-1e9],\"fovy\":170,\"width\":1,\"height\":9,\"exaggeration\":3}'",
          "'{\"eye\":[-71.3,44.3,1e9],\"yaw\":0,\"pitch\":-90,\"fovy\":0.01,\"width\":9,\"height\":9,\"tau\":0.1}'",
          "'{\"eye\":[1,2,3],\"at\":[1,2,3],\"fovy\":60,\"width\":64,\"height\":48}'",
          "'{\"eye\":[1e15,-1e15,1e15],\"at\":[0,0,0],\"fovy\":60,\"width\":1e15,\"height\":1,\"far\":2}'",
          "'{\"eye\":[1500000,-4300000,4400000],\"at\":[0,0,0],\"position\":\"ecef\",\"fovy\":1,\"width\":64,"
          "\"height\":48}'",
          "'{\"eye\":[-71.3,44.3,5000],\"yaw\":0,\"pitch\":-89,\"position\":\"lonlat\",\"fovy\":45,\"width\":640,"
          "\"height\":480,\"tau\":3}'"}},
        {"line",
         {"'LINESTRING(2 -2, 9 -9)'", "'LINESTRING(-71.4 44.2, -71.25 44.3, -71.3 44.4)'", "NULL", "'POINT(3 -3)'",
          "'MULTILINESTRING((1 -1, 3 -3), (4 -4, 9 -2))'", "'LINESTRING EMPTY'", "'LINESTRING(3 -3, 3 -3)'",
          "'SRID=4326;LINESTRING(170 0, -170 80)'"}},
        {"eps", {"0", "0.5", "3", "20", "1000", "1e9", "9e999", "1e-3"}},
        {"terrain", {"'hills'", "'plain'", "'hills'", "'plain'", "'main.hills'", "NULL", "'hills'", "'plain'"}},
        {"options",
         {"NULL", "'{\"max_triangles\":30,\"previous\":\"\",\"cover\":\"terrain\"}'", "'{\"metric\":\"minimal\"}'",
          "'{\"select\":\"bottomup\"}'", "'{\"outline\":\"tol\"}'", "'{\"max_vertices\":60}'",
          "'{\"mode\":\"border\"}'", "'{\"mode\":\"cut\",\"strip\":\"fan\"}'"}},
        {"format",
         {"'strip'", "'rqt+normals+errors'", "'rqt'", "'obj'", "'ply+normals'", "'increment'", "'gpkg'",
          "'spatialite'"}},
        {"blob",
         {"(SELECT data FROM rqt_block_1 LIMIT 1)", "(SELECT data FROM rqt_block_2 ORDER BY id DESC LIMIT 1)",
          "zeroblob(41)", "(SELECT data FROM rqt_block_1 LIMIT 1 OFFSET 9)",
          "(SELECT data FROM rqt_block_2 LIMIT 1 OFFSET 3)", "NULL",
          "(SELECT substr(data, 1, length(data) - 1) FROM rqt_block_1 LIMIT 1)",
          "(SELECT data || x'00' FROM rqt_block_1 LIMIT 1)"}},
        {"", {"0", "1.5", "-71.3", "44.3", "2000", "4326", "-8.25", "10"}},
    };
    if (take_between(in, 0, 5) == 0) {
        take_value(in, text, room);
        return;
    }
    size_t i = 0; /* eps_from and eps_to want what eps wants; what has no name here, a number */
    while (fitting[i].name[0] &&
           strncmp(name, fitting[i].name, n < strlen(fitting[i].name) ? n : strlen(fitting[i].name)) != 0)
        i++;
    (void)snprintf(text, room, "%s", fitting[i].values[take_between(in, 0, 7)]);
}

const long fuzz_runs = 1500;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static sqlite3 *db;
    static unsigned calls;
    input in = {data, size};
    if (!db || ++calls % 500 == 0) { /* a leak is one of few inputs */
        if (db) HOLD(sqlite3_close(db) == SQLITE_OK, "the connection does not close");
        db = fuzz_database();
    }
    const function *f = &rqt_functions[take_between(&in, 0, rqt_function_count - 1)];
    char sql[8000], value[2000];
    size_t n = (size_t)snprintf(sql, sizeof sql, "SELECT %s%s(", f->fill ? "* FROM " : "", f->name);
    /* Arguments by their names in "region, eps [, terrain [, options]]", all or the first few, or one too many. */
    int most = take_between(&in, 0, 3) ? 100 : take_between(&in, 0, 6), count = 0;
    for (const char *p = f->arguments; count < most; count++) {
        p += strspn(p, " ,[]");
        if (!*p && (most == 100 || count > 6)) break;
        const size_t length = strcspn(p, " ,[]");
        take_argument(&in, p, length, value, sizeof value);
        p += length;
        n += (size_t)snprintf(sql + n, sizeof sql - n, "%s%s", count ? ", " : "", value);
    }
    (void)snprintf(sql + n, sizeof sql - n, ")");
    sqlite3_stmt *s = NULL;
    long patience = 200;
    sqlite3_progress_handler(db, 10000, fuzz_patience, &patience);
    int code = sqlite3_prepare_v2(db, sql, -1, &s, NULL);
    if (code == SQLITE_OK) code = fuzz_ask(db, sql, s);
    if (code == SQLITE_ERROR) {
        const char *said = sqlite3_errmsg(db);
        HOLD(strstr(said, f->name) || strncmp(said, "rqt_", 4) == 0, "%s: %s", sql, said);
    } else {
        HOLD(code == SQLITE_DONE || code == SQLITE_INTERRUPT || code == SQLITE_TOOBIG, "%s: %d %s", sql, code,
             sqlite3_errmsg(db));
    }
    sqlite3_finalize(s);
    sqlite3_progress_handler(db, 0, NULL, NULL);
    HOLD(sqlite3_total_changes(db) == 0 || sqlite3_get_autocommit(db), "%s: a transaction is open", sql);
    return 0;
}
