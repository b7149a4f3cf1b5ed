/* insight_tables.c - tables about the terrains themselves: rqt_terrains, rqt_explain, rqt_check, rqt_help. */
#include "view.h"

#include "format.h"
#include "geo.h"

#include <math.h>
#include <string.h>

/* ----------------------------------------------------------------------------------------- rqt_terrains */
typedef struct terrain_list {
    store_terrain *rows;
    int count;
} terrain_list;

static void release_terrains(void *data) {
    terrain_list *list = data;
    store_terrains_free(list->rows, list->count);
    sqlite3_free(list);
}

static void text(sqlite3_context *result, const char *value) {
    sqlite3_result_text(result, value, -1, SQLITE_TRANSIENT);
}

/* What the first quotation marks of a CRS in WKT hold. */
static void put_crs_name(const char *wkt, sqlite3_context *result) {
    const char *start = strchr(wkt, '"'), *end = start ? strchr(start + 1, '"') : NULL;
    if (end) sqlite3_result_text(result, start + 1, (int)(end - start - 1), SQLITE_TRANSIENT);
}

/* crs_name, lonlat, metre, semi_major, inverse_flattening: what makes places in space of x, y and height. */
static void put_space(const store_terrain *t, int column, sqlite3_context *result) {
    geo_ellipsoid earth = GEO_WGS84;
    if (column == 0)
        put_crs_name(t->crs, result);
    else if (column == 1)
        sqlite3_result_int(result, t->lonlat);
    else if (column == 2 && !t->lonlat)
        sqlite3_result_double(result, terrain_metre(t));
    else if (column > 2 && t->lonlat && (t->wgs84 || geo_ellipsoid_of_wkt(t->crs, &earth)))
        sqlite3_result_double(result, column == 3 ? earth.a : earth.f != 0 ? 1 / earth.f : 0);
}

static void terrains_column(void *data, size_t row, int column, sqlite3_context *result) {
    const store_terrain *t = &((terrain_list *)data)->rows[row];
    if (t->problem && column > 0 && column != 13) {
        if (column == 14) sqlite3_result_int(result, 0);
        return; /* nothing else is known */
    }
    const double a = rqt_unit_metres(&t->unit, t->min_q), b = rqt_unit_metres(&t->unit, t->max_q);
    const bool has_heights = t->voids < (int64_t)t->lattice.width * t->lattice.height;
    switch (column) {
    case 0:
        text(result, t->name);
        break;
    case 1:
        if (t->srid) sqlite3_result_int(result, t->srid);
        break;
    case 2:
        sqlite3_result_int(result, t->lattice.width);
        break;
    case 3:
        sqlite3_result_int(result, t->lattice.height);
        break;
    case 4:
        sqlite3_result_double(result, fabs(t->placement.dx));
        break;
    case 5:
        sqlite3_result_double(result, fabs(t->placement.dy));
        break;
    case 6:
        if (has_heights) sqlite3_result_double(result, a < b ? a : b);
        break;
    case 7:
        if (has_heights) sqlite3_result_double(result, a < b ? b : a);
        break;
    case 8:
        sqlite3_result_double(result, fabs(rqt_unit_factor(&t->unit)) / (double)t->unit.d);
        break;
    case 9:
        sqlite3_result_int64(result, t->voids);
        break;
    case 10:
        sqlite3_result_int64(result, t->blocks);
        break;
    case 11:
        sqlite3_result_int64(result, t->bytes);
        break;
    case 12:
        sqlite3_result_double(result, rqt_code_metres(t->max_error));
        break;
    case 13:
        text(result, t->schema);
        break;
    case 14:
        sqlite3_result_int(result, t->complete);
        break;
    case 15:
        sqlite3_result_double(result, t->placement.x0);
        break;
    case 16:
        sqlite3_result_double(result, t->placement.y0);
        break;
    case 17:
        sqlite3_result_double(result, t->placement.dx);
        break;
    case 18:
        sqlite3_result_double(result, t->placement.dy);
        break;
    case 19:
        sqlite3_result_int(result, t->k);
        break;
    case 20:
        sqlite3_result_double(result, t->quantum_error);
        break;
    case 21:
        text(result, t->crs);
        break;
    case 22:
        text(result, t->vertical);
        break;
    case 23:
        text(result, t->source);
        break;
    case 24:
        text(result, t->created);
        break;
    default:
        put_space(t, column - 25, result);
        break;
    }
}

/* All terrains, for as long as the list lives. */
static int list_terrains(store *s, terrain_list **list, char **error) {
    *list = sqlite3_malloc(sizeof **list);
    if (!*list) return SQLITE_NOMEM;
    **list = (terrain_list){0};
    const int code = store_terrains(s, &(*list)->rows, &(*list)->count, error);
    if (code != SQLITE_OK) {
        sqlite3_free(*list);
        *list = NULL;
    }
    return code;
}

int fill_terrains(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    (void)arguments;
    store *s;
    int code = connection_store(c, &s, error);
    if (code != SQLITE_OK) return code;
    terrain_list *list;
    code = list_terrains(s, &list, error);
    if (code == SQLITE_OK) *rows = (row_set){(size_t)list->count, list, terrains_column, release_terrains, 0};
    connection_done(c);
    return code;
}

/* ------------------------------------------------------------------------------------------ rqt_explain */
typedef struct explanation {
    store_reads reads;
    rqt_lattice lattice;
    int k;
    rqt_placement placement;
    double achieved_eps;
    enum {
        BY_EPS,
        BY_RULE,
        BY_VIEW
    } by;                /* rule: detail, mode border, frame: where em is too large, or a vertex is
                            forced, children answer. The same in a view */
    double achieved_tau; /* of a view */
    bool guaranteed;
    char *token; /* NULL: none */
} explanation;

/* Why this block was taken, and how much of it was read. */
static const char *reason_of(const explanation *e, const store_read *read) {
    static const char *const reasons[3][5] = {
        {"answers eps; its centre is selected, so its bytes are walked",
         "answers eps; it only touches the region, so its index row is enough",
         "answers eps; nothing is selected inside, so its index row is enough",
         "answers eps; made in memory, for the metric is not stored, and walked",
         "answers eps; made in memory, for the metric is not stored; nothing is selected inside"},
        {"answers every eps and border in its reach; its centre is selected, so its bytes are walked",
         "answers every eps and border in its reach; it only touches the region, so its index row is enough",
         "answers every eps and border in its reach; nothing is selected inside, so its index row is enough",
         "answers every eps and border in its reach; made in memory, for the metric is not stored, and walked",
         /* One sentence. NOLINTNEXTLINE(bugprone-suspicious-missing-comma) */
         "answers every eps and border in its reach; made in memory, for the metric is not stored; nothing is "
         "selected inside"},
        {"answers what the view asks for in its reach; its centre is selected, so its bytes are walked",
         "answers what the view asks for in its reach; it is out of sight, so its index row is enough",
         "answers what the view asks for in its reach; nothing is selected inside, so its index row is enough",
         "answers what the view asks for in its reach; made in memory, for the metric is not stored, and walked",
         /* One sentence. NOLINTNEXTLINE(bugprone-suspicious-missing-comma) */
         "answers what the view asks for in its reach; made in memory, for the metric is not stored; nothing is "
         "selected inside"}};
    const int which = read->computed ? (read->needs_bytes ? 3 : 4) : read->needs_bytes ? 0 : read->outside ? 1 : 2;
    return reasons[e->by][which];
}

static void release_explanation(void *data) {
    store_reads_free(&((explanation *)data)->reads);
    sqlite3_free(((explanation *)data)->token);
    sqlite3_free(data);
}

static void explain_column(void *data, size_t row, int column, sqlite3_context *result) {
    const explanation *e = data;
    const store_read *read = &e->reads.rows[row];
    rqt_block_place p;
    if (rqt_block_locate(&e->lattice, e->k, read->number, &p) != RQT_OK) return;
    switch (column) {
    case 0:
        sqlite3_result_int(result, p.level);
        break;
    case 1: {
        const rqt_vertex far_corner = rqt_vertex_clamp(&e->lattice, (rqt_vertex){p.x + p.side, p.y + p.side});
        const rqt_placement *at = &e->placement;
        char x0[32], y0[32], x1[32], y1[32];
        (void)format_double(at->x0 + p.x * at->dx, x0);
        (void)format_double(at->x0 + far_corner.x * at->dx, x1);
        (void)format_double(at->y0 + far_corner.y * at->dy, y0);
        (void)format_double(at->y0 + p.y * at->dy, y1);
        char *wkt =
            sqlite3_mprintf("POLYGON((%s %s, %s %s, %s %s, %s %s, %s %s))", x0, y0, x1, y0, x1, y1, x0, y1, x0, y0);
        if (wkt)
            sqlite3_result_text(result, wkt, -1, sqlite3_free);
        else
            sqlite3_result_error_nomem(result);
        break;
    }
    case 2:
        text(result, reason_of(e, read));
        break;
    case 3:
        sqlite3_result_int64(result, read->bytes);
        break;
    case 4:
        sqlite3_result_int(result, read->cached);
        break;
    case 5:
        sqlite3_result_int64(result, read->selected);
        break;
    case 7:
        sqlite3_result_double(result, e->by == BY_VIEW ? e->achieved_tau : e->achieved_eps);
        break;
    case 8:
        sqlite3_result_int(result, e->guaranteed);
        break;
    case 9:
        sqlite3_result_text(result, e->token, -1, SQLITE_TRANSIENT);
        break;
    default:
        sqlite3_result_int64(result, (sqlite3_int64)read->number);
        break;
    }
}

static int explain(request *r, row_set *rows, char **error) {
    explanation *e = sqlite3_malloc(sizeof *e);
    int code = e ? SQLITE_OK : SQLITE_NOMEM;
    rqt_patch patch = {0};
    if (e) {
        *e = (explanation){.lattice = r->terrain->lattice,
                           .k = r->terrain->k,
                           .placement = r->terrain->placement,
                           .by = r->view           ? BY_VIEW
                                 : r->options.rule ? BY_RULE
                                                   : BY_EPS};
        code = request_patch(r, RQT_PRODUCT_VERTICES, &patch, &e->reads, error);
        e->achieved_eps = r->achieved_eps;
        if (r->view) e->achieved_tau = r->view->achieved_tau, e->guaranteed = r->view->guaranteed;
        if (code == SQLITE_OK && r->view) code = view_token_of(r, &patch, &e->token, error);
    }
    store_keep(r->store, &patch);
    request_free(r);
    if (code != SQLITE_OK) {
        if (e) release_explanation(e);
        return code;
    }
    *rows = (row_set){e->reads.count, e, explain_column, release_explanation, 0};
    return SQLITE_OK;
}

int fill_explain(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    request r;
    const int code =
        request_read(c, arguments[0], arguments[1], arguments[2], arguments[3], REQUEST_COVER, &r, error);
    return code == SQLITE_OK ? explain(&r, rows, error) : code;
}

int fill_view_explain(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    request r;
    const int code = request_read_view(c, arguments[0], arguments[1], arguments[2], &r, error);
    return code == SQLITE_OK ? explain(&r, rows, error) : code;
}

/* -------------------------------------------------------------------------------------------- rqt_check */
typedef struct finding {
    char *severity, *message;
    rqt_block_number block;
} finding;
typedef struct finding_list {
    finding *rows;
    size_t count;
    bool out_of_memory;
} finding_list;

#define MOST_FINDINGS 10000 /* a thoroughly broken terrain need not fill the memory */

static void release_findings(void *data) {
    finding_list *list = data;
    for (size_t i = 0; i < list->count; i++) {
        sqlite3_free(list->rows[i].severity);
        sqlite3_free(list->rows[i].message);
    }
    sqlite3_free(list->rows);
    sqlite3_free(list);
}

static bool add_finding(void *context, const store_finding *found) {
    finding_list *list = context;
    finding *rows = sqlite3_realloc64(list->rows, (list->count + 1) * sizeof *rows);
    if (!rows) {
        list->out_of_memory = true;
        return false;
    }
    list->rows = rows;
    rows[list->count++] =
        (finding){sqlite3_mprintf("%s", found->severity), sqlite3_mprintf("%s", found->message), found->block};
    return list->count < MOST_FINDINGS;
}

static void check_column(void *data, size_t row, int column, sqlite3_context *result) {
    const finding *f = &((finding_list *)data)->rows[row];
    if (column == 0)
        text(result, f->severity);
    else if (column == 2)
        text(result, f->message);
    else if (f->block)
        sqlite3_result_int64(result, (sqlite3_int64)f->block);
}

static int check_terrains(store *s, const char *name, finding_list *findings, char **error) {
    terrain_list *terrains;
    int code = list_terrains(s, &terrains, error);
    if (code != SQLITE_OK) return code;
    int checked = 0;
    for (int i = 0; i < terrains->count && code == SQLITE_OK; i++) {
        if (name && !store_name_means(&terrains->rows[i], name)) continue;
        checked++;
        code = store_check(s, &terrains->rows[i], add_finding, findings, error);
    }
    release_terrains(terrains);
    const store_terrain *none;
    if (code == SQLITE_OK && name && checked == 0)
        code = store_find(s, name, &none, error); /* says which there are */
    return code == SQLITE_OK && findings->out_of_memory ? SQLITE_NOMEM : code;
}

int fill_check(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    const char *name = NULL;
    if (arguments[0] && sqlite3_value_type(arguments[0]) != SQLITE_NULL) {
        name = (const char *)sqlite3_value_text(arguments[0]);
        if (!name) return SQLITE_NOMEM;
    }
    store *s;
    int code = connection_store(c, &s, error);
    if (code != SQLITE_OK) return code;
    finding_list *list = sqlite3_malloc(sizeof *list);
    code = list ? SQLITE_OK : SQLITE_NOMEM;
    if (list) {
        *list = (finding_list){0};
        code = check_terrains(s, name, list, error);
    }
    connection_done(c);
    if (code == SQLITE_OK)
        *rows = (row_set){list->count, list, check_column, release_findings, 0};
    else if (list)
        release_findings(list);
    return code;
}

/* --------------------------------------------------------------------------------------------- rqt_help */
static void help_column(void *data, size_t row, int column, sqlite3_context *result) {
    (void)data;
    const function *f = &rqt_functions[row];
    switch (column) {
    case 0:
        text(result, f->name);
        break;
    case 1:
        text(result, f->call ? "scalar" : "table");
        break;
    case 2:
        text(result, f->arguments);
        break;
    case 3:
        text(result, f->returns);
        break;
    case 4:
        text(result, f->purpose);
        break;
    case 5:
        text(result, f->example);
        break;
    default:
        text(result, f->hidden ? f->hidden : "");
        break;
    }
}

int fill_help(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    (void)c, (void)arguments, (void)error;
    *rows = (row_set){(size_t)rqt_function_count, NULL, help_column, NULL, 0};
    return SQLITE_OK;
}
