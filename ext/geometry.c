/* geometry.c - a geometry out of an SQL value, in a terrain's coordinates: one reading for every argument that is a
 * place.
 *
 * Another SRID than the terrain's goes through SpatiaLite's ST_Transform, by a statement of our own on the same
 * connection. It is asked in its form with both systems spelled out, which looks nothing up: so it works in a plain
 * database and in a GeoPackage, which have no spatial_ref_sys, and for terrains whose system has no code. The
 * terrain's system is the WKT that it came with. That of the geometry is EPSG's of its number, unless the database
 * says otherwise of that number.
 */
#include "functions.h"

#include <string.h>

static int parse(const void *bytes, size_t n, bool text, const char *what, rqt_geometry **geometry, char **error) {
    rqt_message why = {""};
    const rqt_status status = rqt_geometry_parse(bytes ? bytes : "", n, text, store_allocator(), geometry, &why);
    if (status == RQT_OK) return SQLITE_OK;
    return status == RQT_NO_MEMORY ? SQLITE_NOMEM : fail(error, "%s: %s", what, why.text);
}

/* What the database has for a number that is not EPSG's: a WKT, to be released; NULL: nothing. */
static char *own_system(sqlite3 *db, int32_t srid) {
    static const char *const queries[] = {"SELECT definition FROM gpkg_spatial_ref_sys WHERE srs_id = ?1 AND "
                                          "upper(organization) <> 'EPSG' AND srs_id > 0",
                                          "SELECT srtext FROM spatial_ref_sys WHERE srid = ?1 AND "
                                          "upper(auth_name) <> 'EPSG' AND srid > 0"};
    char *found = NULL;
    for (size_t i = 0; i < 2 && !found; i++) {
        sqlite3_stmt *row = NULL;
        if (sqlite3_prepare_v2(db, queries[i], -1, &row, NULL) == SQLITE_OK) {
            sqlite3_bind_int(row, 1, srid);
            if (sqlite3_step(row) == SQLITE_ROW) found = sqlite3_mprintf("%s", sqlite3_column_text(row, 0));
        }
        sqlite3_finalize(row);
    }
    return found;
}

/* Why there is no transformed geometry. */
static int refuse(sqlite3 *db, int code, const char *what, int32_t srid, const store_terrain *t, char **error) {
    if ((code & 0xFF) == SQLITE_NOMEM) return SQLITE_NOMEM;
    char *terrain = t->srid ? sqlite3_mprintf("SRID %d", t->srid) : sqlite3_mprintf("a system without SRID");
    if (!terrain) return SQLITE_NOMEM;
    const char *says = code == SQLITE_OK ? "it gives NULL" : sqlite3_errmsg(db);
    if (code != SQLITE_OK && strstr(says, "no such function"))
        code = fail(error,
                    "%s has SRID %d, terrain %s has %s; load mod_spatialite in this connection, then it is "
                    "transformed",
                    what, srid, t->name, terrain);
    else
        code = fail(error, "%s has SRID %d, terrain %s has %s, and SpatiaLite's ST_Transform fails: %s", what, srid,
                    t->name, terrain, says);
    sqlite3_free(terrain);
    return code;
}

static int run_transform(sqlite3 *db, sqlite3_stmt *row, const char *what, int32_t srid, const store_terrain *t,
                         rqt_geometry **geometry, char **error) {
    int code = sqlite3_step(row);
    if (code != SQLITE_ROW) return refuse(db, code, what, srid, t, error);
    if (sqlite3_column_type(row, 0) != SQLITE_BLOB) return refuse(db, SQLITE_OK, what, srid, t, error);
    const void *bytes = sqlite3_column_blob(row, 0);
    const size_t n = (size_t)sqlite3_column_bytes(row, 0);
    if (!bytes && n > 0) return SQLITE_NOMEM;
    rqt_geometry *transformed = NULL;
    code = parse(bytes, n, false, what, &transformed, error);
    if (code != SQLITE_OK) return code;
    rqt_geometry_free(*geometry);
    *geometry = transformed;
    return SQLITE_OK;
}

static int transform(sqlite3 *db, const store_terrain *t, const char *what, rqt_geometry **geometry, char **error) {
    const int32_t srid = rqt_geometry_srid(*geometry);
    if (!*t->crs && t->srid <= 0)
        return fail(error, "%s has SRID %d, terrain %s has no coordinate system to transform it to", what, srid,
                    t->name);
    sqlite3_stmt *row = NULL;
    int code = sqlite3_prepare_v2(db, "SELECT ST_Transform(GeomFromWKB(?1, ?2), ?3, NULL, ?4, ?5)", -1, &row, NULL);
    if (code != SQLITE_OK) return refuse(db, code, what, srid, t, error);
    uint8_t *wkb = NULL;
    size_t size = 0;
    char *from = own_system(db, srid);
    if (!from) from = sqlite3_mprintf("EPSG:%d", srid);
    char *to = *t->crs ? sqlite3_mprintf("%s", t->crs) : sqlite3_mprintf("EPSG:%d", t->srid);
    code = from && to && rqt_geometry_wkb(*geometry, store_allocator(), &wkb, &size) == RQT_OK ? SQLITE_OK
                                                                                               : SQLITE_NOMEM;
    if (code == SQLITE_OK) {
        sqlite3_bind_blob64(row, 1, wkb, size, SQLITE_STATIC);
        sqlite3_bind_int(row, 2, srid);
        sqlite3_bind_int(row, 3, t->srid > 0 ? t->srid : 0);
        sqlite3_bind_text(row, 4, from, -1, SQLITE_STATIC);
        sqlite3_bind_text(row, 5, to, -1, SQLITE_STATIC);
        code = run_transform(db, row, what, srid, t, geometry, error);
    }
    sqlite3_finalize(row);
    sqlite3_free(from);
    sqlite3_free(to);
    sqlite3_free(wkb);
    return code;
}

int request_geometry_bytes(connection *c, const store_terrain *t, const void *bytes, size_t n, bool text,
                           const char *what, rqt_geometry **geometry, bool *transformed, char **error) {
    *geometry = NULL;
    int code = parse(bytes, n, text, what, geometry, error);
    if (code != SQLITE_OK) return code;
    const int32_t srid = rqt_geometry_srid(*geometry);
    if (srid == 0 || srid == t->srid || (srid == 4326 && t->wgs84) || rqt_geometry_is_empty(*geometry))
        return SQLITE_OK;
    code = transform(connection_db(c), t, what, geometry, error);
    if (transformed) *transformed = true;
    if (code != SQLITE_OK) {
        rqt_geometry_free(*geometry);
        *geometry = NULL;
    }
    return code;
}

int request_geometry(connection *c, const store_terrain *t, sqlite3_value *value, const char *what,
                     rqt_geometry **geometry, char **error) {
    *geometry = NULL;
    const int type = value ? sqlite3_value_type(value) : SQLITE_NULL;
    if (type == SQLITE_NULL) return SQLITE_OK;
    if (type == SQLITE_INTEGER || type == SQLITE_FLOAT)
        return fail(error, "%s must be WKT text, a geometry or NULL; it is a number", what);
    const void *bytes = type == SQLITE_TEXT ? (const void *)sqlite3_value_text(value) : sqlite3_value_blob(value);
    const size_t n = (size_t)sqlite3_value_bytes(value);
    if (!bytes && n > 0) return SQLITE_NOMEM;
    return request_geometry_bytes(c, t, bytes, n, type == SQLITE_TEXT, what, geometry, NULL, error);
}
