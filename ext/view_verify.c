/* view_verify.c - rqt_view_verify: hands the triangles of a view, the stored samples and the camera to the
 * independent verifier, which projects them with code of its own.
 *
 * All samples of the terrain are looked at, for one that is drawn and in no triangle is a hole in the picture,
 * wherever the view thinks that there is nothing to be seen. They come in bands of rows, so that a terrain of any
 * size needs the memory of a band. Where a sample is in the scene only the scene can say; that is all that the
 * proof takes from it. */
#include "promise.h"
#include "view.h"

#include "verify.h"

#include <math.h>
#include <string.h>

#define BAND_SAMPLES (1 << 20)

typedef struct proof {
    verify_view_report seen;
    verify_report mesh; /* of the triangles alone */
    double x, y, z;     /* of the worst sample */
    double achieved_tau;
    bool guaranteed;
} proof;

static void column(void *data, size_t row, int n, sqlite3_context *result) {
    (void)row;
    const proof *p = data;
    const uint64_t counts[] = {p->seen.samples, p->seen.drawn, p->mesh.vertices, p->mesh.triangles};
    const double pixels[] = {p->seen.max_pixels, p->seen.rms_pixels}, place[] = {p->x, p->y, p->z};
    if (n < 4)
        sqlite3_result_int64(result, (sqlite3_int64)counts[n]);
    else if (n < 6)
        sqlite3_result_double(result, pixels[n - 4]);
    else if (n < 9) {
        if (p->seen.drawn) sqlite3_result_double(result, place[n - 6]);
    } else if (n == 9)
        sqlite3_result_int64(result, (sqlite3_int64)p->mesh.t_junctions);
    else if (n == 10)
        sqlite3_result_int64(result, (sqlite3_int64)p->mesh.overlaps);
    else if (n == 11)
        sqlite3_result_double(result, p->achieved_tau);
    else if (n == 12)
        sqlite3_result_int(result, p->guaranteed);
    else
        sqlite3_result_int64(result, (sqlite3_int64)p->seen.uncovered);
}

/* ----------------------------------------------------------------------------------- what the verifier asks -- */
typedef struct ground {
    const scene *scene;
    promise rows;
} ground;

static void place_sample(void *context, const verify_corner *c, double xyz[3]) {
    const scene *s = ((const ground *)context)->scene;
    const rqt_placement *at = &s->terrain->placement;
    const double place[3] = {at->x0 + c->col * at->dx, at->y0 + c->row * at->dy,
                             rqt_unit_metres(&s->terrain->unit, c->q)};
    scene_place(s, place, s->exaggeration, xyz);
}

static bool has_to_cover(void *context, int32_t col, int32_t row, double slack) {
    const ground *g = context;
    return promise_holds_within(&g->rows, col, row, slack / g->scene->exaggeration);
}

/* ------------------------------------------------------------------------------------------------- judging -- */
typedef struct evidence {
    verify_triangle *triangles;
    size_t count;
} evidence;

static int take_triangles(request *r, evidence *e, char **error) {
    rqt_patch patch;
    int code = request_patch(r, RQT_PRODUCT_TRIANGLES, &patch, NULL, error);
    if (code != SQLITE_OK) return code;
    e->count = patch.triangle_count;
    e->triangles = sqlite3_malloc64((e->count + 1) * sizeof *e->triangles);
    if (!e->triangles) code = SQLITE_NOMEM;
    for (size_t i = 0; code == SQLITE_OK && i < 3 * e->count; i++) {
        const rqt_patch_vertex *v = &patch.vertices[patch.triangles[i]];
        e->triangles[i / 3].corner[i % 3] = (verify_corner){v->col, v->row, v->q};
    }
    store_keep(r->store, &patch);
    return code;
}

static int code_of(verify_status status, char **error) {
    if (status == VERIFY_NO_MEMORY) return SQLITE_NOMEM;
    return status == VERIFY_INVALID ? fail(error, "camera and terrain have no picture in finite numbers")
                                    : SQLITE_OK;
}

static int judge_rows(const request *r, const evidence *e, int32_t first, int32_t last, proof *p, char **error) {
    const view *v = r->view;
    const rqt_camera *c = &v->camera;
    const rqt_unit *unit = &r->terrain->unit;
    ground g = {.scene = &v->scene};
    int code = promise_begin_rows(&g.rows, r, first, last, error);
    if (code == SQLITE_OK) {
        const size_t before = (size_t)(first - g.rows.row) * (size_t)g.rows.width;
        const verify_samples samples = {.row0 = first,
                                        .width = g.rows.width,
                                        .height = last - first + 1,
                                        .q = g.rows.q + before,
                                        .valid = g.rows.valid + before};
        const verify_scene where = {
            .place = place_sample,
            .rise = v->scene.space ? 0 : rqt_unit_factor(unit) / (double)unit->d * v->scene.exaggeration,
            .is_promised = has_to_cover,
            .slack = r->options.outline == RQT_OUTLINE_TOL ? v->achieved_tau : 0,
            .context = &g};
        verify_camera camera = {
            .focal = c->focal, .width = c->width, .height = c->height, .near = c->near, .far = c->far};
        memcpy(camera.eye, c->eye, sizeof camera.eye);
        memcpy(camera.forward, c->forward, sizeof camera.forward);
        memcpy(camera.right, c->right, sizeof camera.right);
        memcpy(camera.up, c->up, sizeof camera.up);
        code = code_of(verify_view(&samples, &where, &camera, e->triangles, e->count, &p->seen), error);
    }
    promise_free(&g.rows);
    return code;
}

static int find_worst(const request *r, proof *p, char **error) {
    const store_terrain *t = r->terrain;
    int32_t q = 0;
    uint8_t valid = 0;
    const int code = store_window(r->store, t, p->seen.worst_col, p->seen.worst_row, 1, 1, &q, &valid, error);
    p->x = t->placement.x0 + p->seen.worst_col * t->placement.dx;
    p->y = t->placement.y0 + p->seen.worst_row * t->placement.dy;
    p->z = rqt_unit_metres(&t->unit, q);
    return code;
}

static int prove(request *r, proof *p, char **error) {
    const int32_t width = r->terrain->lattice.width, height = r->terrain->lattice.height;
    const int32_t band = width < BAND_SAMPLES ? BAND_SAMPLES / width : 1;
    evidence e = {0};
    int code = take_triangles(r, &e, error);
    if (code == SQLITE_OK) code = code_of(verify_topology(e.triangles, e.count, &p->mesh), error);
    for (int32_t row = 0; row < height && code == SQLITE_OK; row += band) {
        const int32_t last = height - row > band ? row + band - 1 : height - 1;
        if (!store_is_interrupted(r->store, &code)) code = judge_rows(r, &e, row, last, p, error);
    }
    if (code == SQLITE_OK && p->seen.drawn) code = find_worst(r, p, error);
    p->achieved_tau = r->view->achieved_tau;
    p->guaranteed = r->view->guaranteed;
    sqlite3_free(e.triangles);
    return code;
}

int fill_view_verify(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    request r;
    int code = request_read_view(c, arguments[0], arguments[1], arguments[2], &r, error);
    if (code != SQLITE_OK) return code;
    proof *p = sqlite3_malloc(sizeof *p);
    code = p ? SQLITE_OK : SQLITE_NOMEM;
    if (p) {
        memset(p, 0, sizeof *p);
        code = prove(&r, p, error);
    }
    request_free(&r);
    if (code != SQLITE_OK) {
        sqlite3_free(p);
        return code;
    }
    *rows = (row_set){.count = 1, .data = p, .column = column, .release = sqlite3_free};
    return SQLITE_OK;
}
