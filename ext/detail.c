/* detail.c - the options detail and mode border: places with an eps of their own, and the rule that they make. The
 * option frame has such a rule, too; what it takes from eps is frame.c's.
 *
 * detail is a list, [[geometry as text, eps], ...], or the name of a table or view of this connection with a
 * geometry and an eps in each row: roads with half a metre, say, in a terrain at ten. All of it is read: how coarse
 * the mesh may be here depends on places far away (rqt_rule), and so all answers are parts of one mesh.
 *
 * Reading takes longer than most queries. So the connection keeps what the last table said while that is sure to be
 * what it says: no database has changed (store_state), the name means the same table, and it is a table with rows
 * of its own. Views may say something else each time, what temp holds changes unseen, and transformations go by
 * tables and functions that may be anywhere: those are read for each query. */
#include "view.h"

#include <cjson/cJSON.h>
#include <string.h>

#define KEPT_BYTES ((size_t)64 << 20) /* of places that are kept; with more, they are not */

struct places {
    int holders;
    rqt_region **regions; /* as many as places */
    rqt_rule_place *items;
    size_t count, capacity;
    /* what they are true for, when they may be kept */
    char *schema, *table; /* as the request had them */
    uint64_t state;
    const store_terrain *terrain; /* never read, only compared */
    bool transformed;
};

void places_release(places *p) {
    if (!p || --p->holders > 0) return;
    for (size_t i = 0; i < p->count; i++) rqt_region_free(p->regions[i]);
    sqlite3_free(p->regions);
    sqlite3_free(p->items);
    sqlite3_free(p->schema);
    sqlite3_free(p->table);
    sqlite3_free(p);
}

static int places_create(places **p) {
    *p = sqlite3_malloc(sizeof **p);
    if (*p) **p = (places){.holders = 1};
    return *p ? SQLITE_OK : SQLITE_NOMEM;
}

static int grow(places *p) {
    if (p->count < p->capacity) return SQLITE_OK;
    const size_t more = p->capacity ? 2 * p->capacity : 64;
    /* Pointers. NOLINTNEXTLINE(bugprone-sizeof-expression) */
    rqt_region **regions = sqlite3_realloc64(p->regions, more * sizeof *regions);
    if (regions) p->regions = regions;
    rqt_rule_place *items = sqlite3_realloc64(p->items, more * sizeof *items);
    if (items) p->items = items;
    if (!regions || !items) return SQLITE_NOMEM;
    p->capacity = more;
    return SQLITE_OK;
}

/* One more place; `what` it is, for sentences. */
static int add_place(request *r, const void *bytes, size_t n, bool text, double eps, const char *what,
                     char **error) {
    places *p = r->places;
    rqt_geometry *geometry = NULL;
    if (!(eps >= 0)) return fail(error, "%s: eps must be 0 or more; it is %!.15g", what, eps);
    int code = grow(p);
    if (code == SQLITE_OK)
        code = request_geometry_bytes(r->connection, r->terrain, bytes, n, text, what, &geometry, &p->transformed,
                                      error);
    if (code == SQLITE_OK) code = request_region(r, geometry, what, &p->regions[p->count], error);
    rqt_geometry_free(geometry);
    if (code != SQLITE_OK) return code;
    p->items[p->count] = (rqt_rule_place){p->regions[p->count], eps};
    p->count++;
    return SQLITE_OK;
}

static int read_list(request *r, const cJSON *list, char **error) {
    int n = 0, code = SQLITE_OK;
    for (const cJSON *pair = list->child; pair && code == SQLITE_OK; pair = pair->next) {
        char what[32];
        sqlite3_snprintf(sizeof what, what, "detail %d", ++n);
        const cJSON *geometry = cJSON_IsArray(pair) ? pair->child : NULL, *eps = geometry ? geometry->next : NULL;
        /* What is not there is no number. NOLINTNEXTLINE(clang-analyzer-core.NullDereference) */
        if (!cJSON_IsString(geometry) || !cJSON_IsNumber(eps) || eps->next)
            return fail(error, "%s must be [geometry as text, eps]", what);
        code =
            add_place(r, geometry->valuestring, strlen(geometry->valuestring), true, eps->valuedouble, what, error);
    }
    return code;
}

/* ------------------------------------------------------------------------------------------------- tables -- */

typedef struct source {
    sqlite3 *db;
    const char *schema;   /* of the connection */
    const char *table;    /* its name there */
    char *geometry, *eps; /* columns; to be released */
} source;

static int prepare(sqlite3 *db, char *sql, sqlite3_stmt **row) {
    if (!sql) return SQLITE_NOMEM;
    const int code = sqlite3_prepare_v2(db, sql, -1, row, NULL);
    sqlite3_free(sql);
    return code;
}

/* The name of the only column that a query gives; several: *several. */
static int take_column(sqlite3_stmt *row, char **column, bool *several) {
    int code;
    while ((code = sqlite3_step(row)) == SQLITE_ROW) {
        *several = *column != NULL;
        if (*several) break;
        const char *name = (const char *)sqlite3_column_text(row, 0);
        *column = name ? sqlite3_mprintf("%s", name) : NULL;
        if (!*column) return SQLITE_NOMEM;
    }
    return code == SQLITE_ROW || code == SQLITE_DONE ? SQLITE_OK : code;
}

/* Ways to find the column, the surest first: the registers of GeoPackage and SpatiaLite, the declared type, the
 * name. ?1: the table, ?2: its schema. */
static const struct way {
    const char *needs; /* a table of the schema; NULL: none */
    const char *sql;   /* %w: the schema */
} ways[] = {
    {"gpkg_geometry_columns", "SELECT c.name FROM \"%w\".gpkg_geometry_columns g, pragma_table_info(?1, ?2) c "
                              "WHERE g.table_name = ?1 COLLATE "
                              "nocase AND c.name = g.column_name COLLATE nocase"},
    {"geometry_columns",
     "SELECT c.name FROM \"%w\".geometry_columns g, pragma_table_info(?1, ?2) c WHERE g.f_table_name = ?1 COLLATE "
     "nocase AND c.name = g.f_geometry_column COLLATE nocase"},
    {NULL, "SELECT name FROM pragma_table_info(?1, ?2) WHERE rtrim(upper(type), ' ZM') IN ('GEOMETRY', 'POINT', "
           "'LINESTRING', "
           "'POLYGON', 'MULTIPOINT', 'MULTILINESTRING', 'MULTIPOLYGON', 'GEOMETRYCOLLECTION')"},
    {NULL, "SELECT name FROM pragma_table_info(?1, ?2) WHERE lower(name) IN ('geom', 'geometry', 'shape', "
           "'the_geom')"},
};

static int has_table(const source *s, const char *name, bool *has) {
    sqlite3_stmt *row = NULL;
    int code = prepare(
        s->db, sqlite3_mprintf("SELECT 1 FROM \"%w\".sqlite_schema WHERE name = %Q", s->schema, name), &row);
    if (code == SQLITE_OK) code = sqlite3_step(row);
    *has = code == SQLITE_ROW;
    sqlite3_finalize(row);
    return code == SQLITE_ROW || code == SQLITE_DONE ? SQLITE_OK : code;
}

static int find_geometry(source *s, bool *several) {
    int code = SQLITE_OK;
    for (size_t i = 0; i < sizeof ways / sizeof *ways && code == SQLITE_OK && !s->geometry; i++) {
        bool has = true;
        if (ways[i].needs) code = has_table(s, ways[i].needs, &has);
        if (code != SQLITE_OK || !has) continue;
        sqlite3_stmt *row = NULL;
        code = prepare(s->db, sqlite3_mprintf(ways[i].sql, s->schema), &row);
        if (code == SQLITE_OK) code = sqlite3_bind_text(row, 1, s->table, -1, SQLITE_STATIC);
        if (code == SQLITE_OK) code = sqlite3_bind_text(row, 2, s->schema, -1, SQLITE_STATIC);
        if (code == SQLITE_OK) code = take_column(row, &s->geometry, several);
        sqlite3_finalize(row);
    }
    return code;
}

/* Has the schema a table of this name? Its column eps, too. */
static int find_columns(source *s, bool *exists) {
    sqlite3_stmt *row = NULL;
    int code =
        prepare(s->db, sqlite3_mprintf("SELECT name FROM pragma_table_info(%Q, %Q)", s->table, s->schema), &row);
    *exists = false;
    if (code == SQLITE_OK)
        while ((code = sqlite3_step(row)) == SQLITE_ROW) {
            const char *name = (const char *)sqlite3_column_text(row, 0);
            *exists = true;
            if (name && (s->eps || sqlite3_stricmp(name, "eps") != 0)) continue;
            s->eps = name ? sqlite3_mprintf("%s", name) : NULL;
            if (!s->eps) {
                code = SQLITE_NOMEM;
                break;
            }
        }
    sqlite3_finalize(row);
    return code == SQLITE_DONE ? SQLITE_OK : code;
}

/* "table", or "schema.table". */
static int find_source(source *s, const char *name, bool *exists) {
    int code = SQLITE_OK;
    *exists = false;
    for (int qualified = 0; qualified < 2; qualified++)
        for (int i = 0; code == SQLITE_OK; i++) {
            s->schema = sqlite3_db_name(s->db, i < 2 ? 1 - i : i); /* temp before main, as SQLite itself has it */
            if (!s->schema) break;
            const size_t n = strlen(s->schema);
            if (qualified && (sqlite3_strnicmp(name, s->schema, (int)n) != 0 || name[n] != '.')) continue;
            s->table = qualified ? name + n + 1 : name;
            code = find_columns(s, exists);
            if (code != SQLITE_OK || *exists) return code;
        }
    return code;
}

static int read_row(request *r, sqlite3_stmt *row, const char *what, char **error) {
    const int type = sqlite3_column_type(row, 0), eps_type = sqlite3_column_type(row, 1);
    if (type != SQLITE_TEXT && type != SQLITE_BLOB)
        return fail(error, "%s: the geometry is %s", what, type == SQLITE_NULL ? "NULL" : "a number");
    if (eps_type != SQLITE_INTEGER && eps_type != SQLITE_FLOAT)
        return fail(error, "%s: eps must be a number; it is %s", what,
                    eps_type == SQLITE_NULL ? "NULL" : (eps_type == SQLITE_BLOB ? "a BLOB" : "text"));
    const void *bytes =
        type == SQLITE_TEXT ? (const void *)sqlite3_column_text(row, 0) : sqlite3_column_blob(row, 0);
    const size_t n = (size_t)sqlite3_column_bytes(row, 0);
    if (!bytes && n > 0) return SQLITE_NOMEM;
    return add_place(r, bytes, n, type == SQLITE_TEXT, sqlite3_column_double(row, 1), what, error);
}

static int read_rows(request *r, const source *s, const char *name, char **error) {
    sqlite3_stmt *row = NULL;
    int64_t n = 0;
    int code = prepare(
        s->db,
        sqlite3_mprintf("SELECT \"%w\", \"%w\" FROM \"%w\".\"%w\"", s->geometry, s->eps, s->schema, s->table),
        &row);
    if (code == SQLITE_OK)
        while ((code = sqlite3_step(row)) == SQLITE_ROW) {
            char what[160];
            sqlite3_snprintf(sizeof what, what, "detail: row %lld of %.100s", (sqlite3_int64)++n, name);
            code = read_row(r, row, what, error);
            if (code != SQLITE_OK) break;
        }
    sqlite3_finalize(row);
    return code == SQLITE_DONE ? SQLITE_OK : code;
}

/* ------------------------------------------------------------------------------------------------ keeping -- */

/* What the connection keeps is what the table says now. */
static bool is_kept(const request *r, const source *s) {
    const places *p = *connection_places(r->connection);
    return p && p->state == store_state(r->store) && p->terrain == r->terrain &&
           strcmp(p->schema, s->schema) == 0 && strcmp(p->table, s->table) == 0;
}

/* A table with rows of its own, of a database whose changes are seen? Views and virtual tables have no root page.
 */
static int has_rows(const source *s, bool *has) {
    sqlite3_stmt *row = NULL;
    *has = false;
    if (sqlite3_stricmp(s->schema, "temp") == 0) return SQLITE_OK;
    int code = prepare(s->db,
                       sqlite3_mprintf("SELECT 1 FROM \"%w\".sqlite_schema WHERE type = 'table' AND rootpage > 0 "
                                       "AND name = %Q COLLATE nocase",
                                       s->schema, s->table),
                       &row);
    if (code == SQLITE_OK) code = sqlite3_step(row);
    *has = code == SQLITE_ROW;
    sqlite3_finalize(row);
    return code == SQLITE_ROW || code == SQLITE_DONE ? SQLITE_OK : code;
}

/* Keep what was read, if it will be true while nothing changes. */
static int keep(request *r, const source *s) {
    places *p = r->places;
    const uint64_t state = store_state(r->store);
    /* Pointers among them. NOLINTNEXTLINE(bugprone-sizeof-expression) */
    size_t bytes = sizeof *p + p->capacity * (sizeof *p->regions + sizeof *p->items);
    bool own;
    int code = SQLITE_OK;
    for (size_t i = 0; i < p->count && bytes <= KEPT_BYTES; i++) bytes += rqt_region_bytes(p->regions[i]);
    if (state == 0 || p->transformed || bytes > KEPT_BYTES) return SQLITE_OK;
    if ((code = has_rows(s, &own)) != SQLITE_OK || !own) return code;
    p->state = state;
    p->terrain = r->terrain;
    p->schema = sqlite3_mprintf("%s", s->schema);
    p->table = sqlite3_mprintf("%s", s->table);
    if (!p->schema || !p->table) return SQLITE_NOMEM;
    places **kept = connection_places(r->connection);
    places_release(*kept);
    *kept = p;
    p->holders++;
    return SQLITE_OK;
}

/* ------------------------------------------------------------------------------------------------- a table -- */

/* When it is known that the table is there, with a column eps. */
static int read_source(request *r, source *s, const char *name, char **error) {
    bool several = false;
    int code = find_geometry(s, &several);
    if (code == SQLITE_OK && several)
        code = fail(error, "detail: %s has several geometry columns; make a view with one", name);
    else if (code == SQLITE_OK && !s->geometry)
        code =
            fail(error,
                 "detail: %s has no geometry column: none is registered, declared as one, or named geom, geometry, "
                 "shape or the_geom",
                 name);
    if (code == SQLITE_OK) code = places_create(&r->places);
    if (code == SQLITE_OK) code = read_rows(r, s, name, error);
    return code == SQLITE_OK ? keep(r, s) : code;
}

static int read_table(request *r, const char *name, char **error) {
    source s = {.db = connection_db(r->connection)};
    bool exists = false;
    int code = find_source(&s, name, &exists);
    if (code == SQLITE_OK && !exists)
        code = fail(error, "detail: this connection has no table or view %s", name);
    else if (code == SQLITE_OK && !s.eps)
        code = fail(error, "detail: %s has no column eps", name);
    else if (code == SQLITE_OK && is_kept(r, &s)) {
        r->places = *connection_places(r->connection);
        r->places->holders++;
    } else if (code == SQLITE_OK)
        code = read_source(r, &s, name, error);
    /* what SQLite says of a view that does not work */
    if (code != SQLITE_OK && !*error && (code & 0xFF) != SQLITE_NOMEM && (code & 0xFF) != SQLITE_INTERRUPT) {
        (void)fail(error, "detail: reading %s: %s", name, sqlite3_errmsg(s.db));
        code = *error ? code : SQLITE_NOMEM;
    }
    sqlite3_free(s.geometry);
    sqlite3_free(s.eps);
    return code;
}

/* --------------------------------------------------------------------------------------------------- rule -- */

static int read_detail(request *r, char **error) {
    if (cJSON_IsString(r->detail)) return read_table(r, r->detail->valuestring, error);
    if (cJSON_IsArray(r->detail)) {
        const int code = places_create(&r->places);
        return code == SQLITE_OK ? read_list(r, r->detail, error) : code;
    }
    return fail(error, "option \"detail\" must be a list of [geometry as text, eps], or the name of a table");
}

int rule_read(request *r, char **error) {
    const bool border = r->mode == REQUEST_BORDER;
    if (!r->detail && !border && r->frame_kind == FRAME_CRS && !r->view) return SQLITE_OK;
    const char *option = r->view     ? "a view"
                         : r->detail ? "option \"detail\""
                         : border    ? "mode \"border\""
                                     : "option \"frame\"";
    const bool may_add = r->options.metric == RQT_METRIC_EXACT || r->options.metric == RQT_METRIC_WEDGIE;
    if (!may_add && !(r->view && r->test != RQT_VIEW_GUARANTEED))
        return fail(error,
                    "%s needs the metric exact or wedgie: it adds vertices, and with metric \"%s\" nothing is "
                    "proved of a mesh with more of them",
                    option, rqt_metric_name(r->options.metric));
    int code = r->detail ? read_detail(r, error) : SQLITE_OK;
    if (code != SQLITE_OK) return code;
    store_wait w = {r->store, SQLITE_INTERRUPT};
    rqt_status status =
        rqt_rule_create(&r->terrain->lattice, r->terrain->quantum_error, store_allocator(), &r->options.rule);
    if (status == RQT_OK && r->places)
        status = rqt_rule_set_places(r->options.rule, r->places->items, r->places->count);
    if (status == RQT_OK && r->view) status = rqt_rule_set_field(r->options.rule, r->view->field);
    if (status == RQT_OK && border) {
        rqt_region_grow_rectangle(r->region);
        status = rqt_rule_force_border(r->options.rule, r->region, store_wait_is_over, &w);
    }
    return status == RQT_OK ? SQLITE_OK : status == RQT_INTERRUPTED ? w.code : SQLITE_NOMEM;
}

double rule_least_eps(const request *r) {
    double least = r->eps;
    for (size_t i = 0; r->places && i < r->places->count; i++)
        if (r->places->items[i].eps < least) least = r->places->items[i].eps;
    return least;
}

void rule_free(request *r) {
    rqt_rule_free(r->options.rule);
    places_release(r->places);
    r->options.rule = NULL;
    r->places = NULL;
}
