/* layer.c - a mesh as a GeoPackage: one layer, one POLYGON Z for each triangle.
 *
 * The triangles are the rows of rqt_triangles, in its order; fid is the row's id + 1. The layer has the terrain's
 * name, and the CRS as the terrain keeps it, under its SRID (100000 when it has none; -1, undefined, without a
 * CRS).
 */
#include "cli.h"
#include "format.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define OWN_SRS 100000 /* for a CRS without a code; EPSG ends below 33000, ESRI's begin at 37000 and 102000 */

typedef struct layer {
    sqlite3 *out;
    char table[80];
    int32_t srs;
    double box[4];
    int64_t count;
} layer;

/* Names beginning like these belong to SQLite and GeoPackage. */
static void name_table(const char *terrain, char table[80]) {
    static const char *const taken[] = {"sqlite_", "gpkg_", "rtree_"};
    const char *prefix = "";
    for (size_t i = 0; i < sizeof taken / sizeof *taken; i++)
        if (!sqlite3_strnicmp(terrain, taken[i], (int)strlen(taken[i]))) prefix = "mesh_";
    snprintf(table, 80, "%s%s", prefix, terrain);
}

/* Runs a text made by sqlite3_mprintf, and releases it. */
static bool execute_made(sqlite3 *db, char *sql) {
    if (!sql) {
        cli_fail("out of memory");
        return false;
    }
    const bool ok = cli_execute(db, sql);
    sqlite3_free(sql);
    return ok;
}

static bool write_srs(layer *l, const store_terrain *t) {
    const bool known = t->srid > 0;
    l->srs = !*t->crs && !known ? -1 : known ? t->srid : OWN_SRS;
    if (!*t->crs || l->srs < 0) return true;
    return execute_made(l->out,
                        sqlite3_mprintf("INSERT OR IGNORE INTO gpkg_spatial_ref_sys(srs_name, srs_id, "
                                        "organization, organization_coordsys_id, definition) "
                                        "VALUES(%Q, %d, %Q, %d, %Q)",
                                        text_crs_label(t), l->srs, known ? "EPSG" : "NONE", l->srs, t->crs));
}

static bool begin(layer *l, const store_terrain *t, const char *path) {
    char *sentence = NULL;
    name_table(t->name, l->table);
    if (sqlite3_open_v2(path, &l->out, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, NULL) != SQLITE_OK) {
        cli_fail_database(l->out);
        return false;
    }
    /* Until it is renamed the file is nobody's, so a crash needs no way back. */
    if (!cli_execute(l->out, "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN")) return false;
    const int code = store_make_geopackage(l->out, &sentence);
    if (code != SQLITE_OK) {
        cli_fail_store(code, sentence);
        return false;
    }
    return write_srs(l, t) &&
           execute_made(l->out,
                        sqlite3_mprintf("CREATE TABLE \"%w\" (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, "
                                        "geom POLYGON)",
                                        l->table));
}

static bool copy_triangles(layer *l, sqlite3_stmt *from, sqlite3_stmt *to) {
    int code;
    while ((code = sqlite3_step(from)) == SQLITE_ROW) {
        double xyz[3][3];
        uint8_t bytes[FORMAT_TRIANGLE_BYTES];
        for (int i = 0; i < 9; i++) xyz[i / 3][i % 3] = sqlite3_column_double(from, i);
        for (int i = 0; i < 3; i++) {
            l->box[0] = fmin(l->box[0], xyz[i][0]);
            l->box[1] = fmin(l->box[1], xyz[i][1]);
            l->box[2] = fmax(l->box[2], xyz[i][0]);
            l->box[3] = fmax(l->box[3], xyz[i][1]);
        }
        const size_t size = format_triangle_gpkg((const double(*)[3])xyz, l->srs, bytes);
        sqlite3_bind_blob(to, 1, bytes, (int)size, SQLITE_STATIC);
        sqlite3_step(to);
        if (sqlite3_reset(to) != SQLITE_OK) {
            cli_fail_database(l->out);
            return false;
        }
        l->count++;
    }
    if (code != SQLITE_DONE) cli_fail_database(sqlite3_db_handle(from));
    return code == SQLITE_DONE;
}

static bool write_triangles(layer *l, sqlite3 *db, const char *region, double eps, const char *terrain,
                            const char *options) {
    sqlite3_stmt *from =
        cli_prepare(db, "SELECT x0, y0, z0, x1, y1, z1, x2, y2, z2 FROM rqt_triangles(?1, ?2, ?3, ?4)");
    sqlite3_stmt *to = NULL;
    char *sql = sqlite3_mprintf("INSERT INTO \"%w\"(geom) VALUES(?1)", l->table);
    if (from && sql) to = cli_prepare(l->out, sql);
    if (!sql) cli_fail("out of memory");
    sqlite3_free(sql);
    bool ok = false;
    if (to) {
        cli_bind_query(from, region, eps, terrain);
        sqlite3_bind_text(from, 4, options, -1, SQLITE_STATIC);
        ok = copy_triangles(l, from, to);
    }
    sqlite3_finalize(from);
    sqlite3_finalize(to);
    return ok;
}

static bool finish(layer *l, const store_terrain *t, double eps) {
    char number[32], extent[200] = "NULL, NULL, NULL, NULL";
    format_double(eps, number);
    if (l->count)
        sqlite3_snprintf(sizeof extent, extent, "%!.17g, %!.17g, %!.17g, %!.17g", l->box[0], l->box[1], l->box[2],
                         l->box[3]);
    return execute_made(l->out, sqlite3_mprintf("INSERT INTO gpkg_contents(table_name, data_type, identifier, "
                                                "description, min_x, min_y, max_x, max_y, srs_id) VALUES(%Q, "
                                                "'features', %Q, 'rqt: mesh of %q, eps %s m', %s, %d)",
                                                l->table, l->table, t->name, number, extent, l->srs)) &&
           execute_made(l->out, sqlite3_mprintf("INSERT INTO gpkg_geometry_columns VALUES(%Q, 'geom', 'POLYGON', "
                                                "%d, 1, 0)",
                                                l->table, l->srs)) &&
           cli_execute(l->out, "COMMIT");
}

int cli_write_layer(sqlite3 *db, const char *region, double eps, const char *terrain, const char *options,
                    const cli_output *output) {
    store *s;
    const store_terrain *t;
    if (!cli_find_terrain(db, terrain, &s, &t)) return CLI_FAILED;
    layer l = {.box = {DBL_MAX, DBL_MAX, -DBL_MAX, -DBL_MAX}};
    const bool ok = begin(&l, t, output->temporary) && write_triangles(&l, db, region, eps, terrain, options) &&
                    finish(&l, t, eps);
    sqlite3_close(l.out);
    store_close(s);
    return ok ? CLI_OK : CLI_FAILED;
}
