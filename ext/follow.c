/* follow.c - views that follow a camera: option previous, and increments.
 *
 * An answer to option previous is made for a band of cameras around its own, the *anchor* (rqt_view.h, "bands").
 * While the camera stays in it the next answer is the last one, to the bit; beyond it comes a new anchor, and what
 * was before counts no more: a sequence of answers depends on its cameras alone, and one to a camera that has
 * jumped is that of previous "".
 *
 * The token holds the anchor, so nothing has to be kept. But the connection keeps a few answers as long as no
 * database changes (store_state): then it knows without a query that the last answer is still true, and has the
 * mesh that an increment begins from. A connection that does not know an answer makes it again, once, and looks at
 * its fingerprint: if it is another one, the token is one of another state of the database, and the answer is a new
 * one, from nothing. */
#include "view.h"

#include <string.h>

#define KNOWN 4
#define KEPT_BYTES ((size_t)64 << 20) /* of a mesh; larger ones are made again */

typedef struct known_view {
    uint64_t state; /* of the databases; 0: nothing is known */
    uint64_t used;  /* when it was asked for last */
    view_token token;
    bool has_unchanged;
    uint8_t unchanged[RQT_INCREMENT_HEADER_BYTES]; /* the increment that says so */
    rqt_patch mesh;                                /* sorted, with leaves; vertices NULL: it is not kept */
} known_view;

struct known_views {
    known_view view[KNOWN];
    uint64_t clock;
};

void known_views_free(known_views *views) {
    if (!views) return;
    for (int i = 0; i < KNOWN; i++) rqt_patch_free(&views->view[i].mesh);
    sqlite3_free(views);
}

/* ------------------------------------------------------------------------------------------------- knowing -- */

static known_view *find_known(const request *r, const view_token *token) {
    known_views *views = *connection_views(r->connection);
    const uint64_t state = store_state(r->store);
    for (int i = 0; views && state != 0 && i < KNOWN; i++) {
        known_view *k = &views->view[i];
        if (k->state != state || memcmp(&k->token, token, sizeof *token) != 0) continue;
        k->used = ++views->clock;
        return k;
    }
    return NULL;
}

/* That the token's answer is true; NULL: nothing can be kept. */
static known_view *know(const request *r, const view_token *token) {
    known_view *k = find_known(r, token);
    const uint64_t state = store_state(r->store);
    if (k || state == 0) return k;
    known_views **views = connection_views(r->connection);
    if (!*views) {
        *views = sqlite3_malloc(sizeof **views);
        if (!*views) return NULL;
        memset(*views, 0, sizeof **views);
    }
    k = &(*views)->view[0];
    for (int i = 1; i < KNOWN; i++)
        if ((*views)->view[i].used < k->used) k = &(*views)->view[i];
    rqt_patch_free(&k->mesh);
    *k = (known_view){.state = state, .used = ++(*views)->clock, .token = *token};
    return k;
}

/* ------------------------------------------------------------------------------------------------- answers -- */

static int query(request *r, rqt_product product, rqt_patch *patch, char **error) {
    store_query_options options = r->options;
    options.product = product;
    options.wants_leaves = product == RQT_PRODUCT_TRIANGLES;
    return store_query(r->store, r->terrain, r->region, r->eps, &options, patch, NULL, error);
}

/* With leaves, in the order of increments. */
static int sorted_mesh(request *r, rqt_patch *mesh, char **error) {
    const int code = query(r, RQT_PRODUCT_TRIANGLES, mesh, error);
    if (code != SQLITE_OK) return code;
    return rqt_patch_sort(mesh) == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

/* That nothing has changed since this mesh; and the mesh, which is no longer the caller's, for what comes next. */
static int keep_mesh(request *r, const view_token *token, rqt_patch *mesh,
                     uint8_t unchanged[RQT_INCREMENT_HEADER_BYTES]) {
    size_t size;
    const rqt_increment_header header = {.note_size = 0};
    const size_t bytes = mesh->vertex_count * sizeof *mesh->vertices +
                         mesh->triangle_count * (3 * sizeof *mesh->triangles + sizeof *mesh->leaves);
    const rqt_status status = rqt_increment_encode(&header, mesh, mesh, store_allocator(), unchanged, &size);
    known_view *k = status == RQT_OK ? know(r, token) : NULL;
    if (k) {
        memcpy(k->unchanged, unchanged, sizeof k->unchanged);
        k->has_unchanged = true;
    }
    if (k && bytes <= KEPT_BYTES) {
        rqt_patch_free(&k->mesh);
        k->mesh = *mesh;
    } else {
        rqt_patch_free(mesh);
    }
    memset(mesh, 0, sizeof *mesh);
    return status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

/* The view becomes that of its token. */
static void become_last(view *v) {
    v->camera = v->last.camera;
    v->scene.exaggeration = v->last.exaggeration;
    v->achieved_tau = v->last.tau;
    v->has_band = true;
    v->band = (rqt_view_band){v->last.move, v->last.turn};
}

static int read_token(request *r, char **error) {
    view *v = r->view;
    uint64_t options = 0;
    if (!r->previous[0]) return SQLITE_OK;
    int code = token_read(r->previous, &v->last, error);
    if (code == SQLITE_OK && v->last.terrain != view_terrain_number(r->terrain))
        code = fail(error, "option \"previous\": the token is one of another terrain than %s", r->terrain->name);
    if (code == SQLITE_OK) code = view_options_number(r, &options);
    v->has_token = code == SQLITE_OK && options == v->last.options;
    return code;
}

/* The last answer, made again; *mesh is it when that is wanted. *is_true: it is what the token's was. */
static int make_last(request *r, bool wants_mesh, rqt_patch *mesh, bool *is_true, char **error) {
    int code = request_select_view(r, error);
    if (code == SQLITE_OK)
        code = wants_mesh ? sorted_mesh(r, mesh, error) : query(r, RQT_PRODUCT_VERTICES, mesh, error);
    *is_true = code == SQLITE_OK && view_fingerprint(mesh) == r->view->last.fingerprint;
    if (*is_true) (void)know(r, &r->view->last);
    if (*is_true && wants_mesh) return code;
    store_keep(r->store, mesh);
    memset(mesh, 0, sizeof *mesh);
    return code;
}

/* The last answer is this one's, too. Without an increment, what selects is its. */
static int stay(request *r, bool wants_increment, char **error) {
    view *v = r->view;
    known_view *known = find_known(r, &v->last);
    rqt_patch mesh = {0};
    become_last(v);
    v->is_unchanged = known != NULL;
    if (known && wants_increment && known->has_unchanged) {
        memcpy(v->unchanged, known->unchanged, sizeof v->unchanged);
        return SQLITE_OK;
    }
    if (known && !wants_increment) return request_select_view(r, error);
    const int code = make_last(r, wants_increment, &mesh, &v->is_unchanged, error);
    return v->is_unchanged && wants_increment ? keep_mesh(r, &v->last, &mesh, v->unchanged) : code;
}

/* The mesh that an increment begins from. */
static int find_last_mesh(request *r, char **error) {
    view *v = r->view;
    known_view *known = find_known(r, &v->last);
    if (known && known->mesh.vertices) { /* an answer is rarely gone back to */
        v->last_mesh = known->mesh;
        v->has_last_mesh = true;
        memset(&known->mesh, 0, sizeof known->mesh);
        return SQLITE_OK;
    }
    become_last(v);
    return make_last(r, true, &v->last_mesh, &v->has_last_mesh, error);
}

static int begin_anew(request *r, char **error) {
    view *v = r->view;
    double nearest = 0;
    v->has_band = false;
    v->achieved_tau = v->camera.tau;
    int code = r->previous ? view_nearest(r, &nearest, error) : SQLITE_OK;
    if (code == SQLITE_OK && r->previous) {
        v->has_band = true;
        v->band = rqt_camera_band(&v->camera, nearest);
    }
    if (code != SQLITE_OK) return code;
    return r->max_triangles > 0 ? view_keep_within(r, error) : request_select_view(r, error);
}

int view_settle(request *r, view_wants wants, char **error) {
    view *v = r->view;
    const rqt_camera camera = v->camera;
    const double exaggeration = v->scene.exaggeration;
    int code = r->previous ? read_token(r, error) : SQLITE_OK;
    if (code != SQLITE_OK) return code;
    if (v->has_token) {
        const rqt_view_band band = {v->last.move, v->last.turn};
        if (exaggeration == v->last.exaggeration && rqt_camera_holds(&v->last.camera, &band, &camera)) {
            code = stay(r, wants == VIEW_INCREMENT, error);
            if (code != SQLITE_OK || v->is_unchanged) return code;
        } else if (wants != VIEW_ANSWER) {
            code = find_last_mesh(r, error);
            if (code != SQLITE_OK) return code;
        }
        v->camera = camera;
        v->scene.exaggeration = exaggeration;
    }
    return begin_anew(r, error);
}

/* ------------------------------------------------------------------------------------------- what is told -- */

int view_token_of(request *r, const rqt_patch *patch, char **text, char **error) {
    view *v = r->view;
    *text = NULL;
    if (!r->previous) return SQLITE_OK;
    if (v->is_unchanged) {
        *text = sqlite3_mprintf("%s", r->previous);
        return *text ? SQLITE_OK : SQLITE_NOMEM;
    }
    (void)error;
    int code = view_options_number(r, &v->last.options);
    v->last.terrain = view_terrain_number(r->terrain);
    v->last.fingerprint = view_fingerprint(patch);
    v->last.camera = v->camera;
    v->last.exaggeration = v->scene.exaggeration;
    v->last.tau = v->achieved_tau;
    v->last.move = v->band.move;
    v->last.turn = v->band.turn;
    if (code != SQLITE_OK) return code;
    *text = token_write(&v->last);
    if (!*text) return SQLITE_NOMEM;
    (void)know(r, &v->last);
    return SQLITE_OK;
}

static int encode(request *r, const rqt_patch *mesh, const char *token, uint8_t **bytes, size_t *size,
                  char **error) {
    const view *v = r->view;
    const rqt_patch *old = v->has_last_mesh ? &v->last_mesh : NULL;
    const rqt_increment_header header = {.note = token,
                                         .note_size = token ? strlen(token) : 0,
                                         .placement = r->terrain->placement,
                                         .unit = r->terrain->unit,
                                         .eps = r->achieved_eps,
                                         .srid = r->terrain->srid};
    *bytes = sqlite3_malloc64(rqt_increment_bound(old, mesh, header.note_size));
    if (!*bytes) return SQLITE_NOMEM;
    const rqt_status status = rqt_increment_encode(&header, old, mesh, store_allocator(), *bytes, size);
    if (status == RQT_INVALID || (status == RQT_OK && *size > INT32_MAX))
        return fail(error, "the increment is larger than 2 GiB; ask for less or a larger tau");
    if (status != RQT_OK) return SQLITE_NOMEM;
    uint8_t *fitting = sqlite3_realloc64(*bytes, *size);
    if (fitting) *bytes = fitting;
    return SQLITE_OK;
}

int view_increment(request *r, mesh_told *told, uint8_t **bytes, size_t *size, char **error) {
    view *v = r->view;
    rqt_patch mesh = {0};
    *bytes = NULL;
    if (v->is_unchanged) {
        rqt_increment_header header;
        rqt_message why;
        *size = sizeof v->unchanged;
        *bytes = sqlite3_malloc64(*size);
        if (!*bytes) return SQLITE_NOMEM;
        memcpy(*bytes, v->unchanged, *size);
        const int code = request_tell(r, NULL, told, error);
        if (code == SQLITE_OK && rqt_increment_info(*bytes, *size, &header, &why) == RQT_OK) {
            told->vertices = header.vertex_count;
            told->triangles = header.triangle_count;
        }
        return code;
    }
    int code = sorted_mesh(r, &mesh, error);
    if (code == SQLITE_OK) code = request_tell(r, &mesh, told, error);
    if (code == SQLITE_OK) code = encode(r, &mesh, told->token, bytes, size, error);
    if (code == SQLITE_OK) code = keep_mesh(r, &v->last, &mesh, v->unchanged);
    rqt_patch_free(&mesh);
    return code;
}

int view_morph(request *r, const rqt_patch *patch, double **heights, uint32_t **ends, char **error) {
    view *v = r->view;
    const size_t n = patch->vertex_count;
    rqt_patch coarse = {0};
    int code = SQLITE_OK;
    *heights = sqlite3_malloc64((n + 1) * sizeof **heights);
    *ends = sqlite3_malloc64((2 * n + 1) * sizeof **ends);
    if (!*heights || !*ends) return SQLITE_NOMEM;
    if (!r->previous) {
        const double tau = v->achieved_tau;
        v->achieved_tau = 2 * tau;
        code = request_select_view(r, error);
        if (code == SQLITE_OK) code = query(r, RQT_PRODUCT_TRIANGLES, &coarse, error);
        v->achieved_tau = tau;
    }
    const rqt_patch *from = r->previous ? &v->last_mesh : &coarse;
    if (code == SQLITE_OK &&
        rqt_morph_heights(&r->terrain->lattice, from, patch, store_allocator(), *heights, *ends) != RQT_OK)
        code = SQLITE_NOMEM;
    rqt_patch_free(&coarse);
    return code;
}
