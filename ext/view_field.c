/* view_field.c - what a camera allows each square of a terrain: the field, and what of the ground may be seen.
 *
 * From the root down, a square's heights come from the summaries of the store, as far as there are blocks of its
 * size, and from the square around it below. Its piece of the scene and the test give its eps: for all of it, that
 * of its worst point. It is cut into quarters while that pays: not where its parts would be allowed little more,
 * nor where there is little to select at such an eps, nor where everything is selected anyway.
 *
 * The squares that may be seen, grown a little so that their rim is simple, are the region of the query. What is
 * elsewhere cannot be drawn. With option cover the region may be all of the terrain instead: of the same field, so
 * that the mesh of the picture is in it, and beside the picture as coarse as the gap to the frustum lets it be. */
#include "view.h"

#include <math.h>
#include <string.h>

/* Vertices. A square costs as much time as three or four of them. In one megapixel views of 4097^2 samples meshes
 * have 3 to 10 % more vertices with 4 than with 1, for a third of the squares; 8 adds 2 to 9 % more, and 1 has 1 to
 * 4 % more than a quarter. 2 is between speed and size. */
#define WORTH_CUTTING 2.0

#define BAND_PRICE 1.2 /* what a band takes of the best anyway, and cutting does not give back */

/* What may be seen grows to squares of a side of at least half a 32nd of their distance: 2 % more vertices, but a
 * rim of half as many pieces, and the walk asks it at every step along it. */
#define RIM_STEPS 32

#define ASKED_AT_A_TIME 16384 /* squares between two questions whether to go on: a few milliseconds */

typedef struct square_list {
    rqt_square *items;
    size_t count, capacity;
} square_list;

typedef struct builder {
    const view *view;
    store *store;
    const store_terrain *terrain;
    store_relief relief[RQT_MAX_K + 1]; /* of the square at hand and of those around it, by level */
    bool whole;                         /* the region will be all of the terrain; else it is of these: */
    square_list shown;
    uint32_t asked;     /* squares */
    rqt_camera cutting; /* the camera that says which squares are cut */
    double nearest;     /* so far */
    int code;
    char **error;
} builder;

/* --------------------------------------------------------------------------------------------- what is seen -- */

static bool is_in(rqt_square inner, rqt_square outer) {
    return inner.side <= outer.side && inner.x >= outer.x && inner.y >= outer.y && inner.x < outer.x + outer.side &&
           inner.y < outer.y + outer.side;
}

/* As large as the detail of the region's rim is to be, at its distance. */
static rqt_square grow_square(rqt_square square, const rqt_view_piece *piece, double distance,
                              const rqt_lattice *lattice) {
    const double cell = 2 * piece->half_east / piece->side;
    while (2 * square.side * cell * RIM_STEPS < distance && 2 * square.side <= 1 << lattice->K) square.side *= 2;
    square.x &= -square.side;
    square.y &= -square.side;
    return square;
}

static bool add_square(square_list *list, rqt_square square) {
    if (list->count > 0 && is_in(square, list->items[list->count - 1])) return true;
    if (list->count == list->capacity) {
        const size_t more = list->capacity ? 2 * list->capacity : 256;
        rqt_square *items = sqlite3_realloc64(list->items, more * sizeof *items);
        if (!items) return false;
        list->items = items;
        list->capacity = more;
    }
    list->items[list->count++] = square;
    return true;
}

/* --------------------------------------------------------------------------------------------------- field -- */

static int find_relief(builder *b, rqt_square square, int level) {
    const store_terrain *t = b->terrain;
    rqt_block_place place;
    b->relief[level] = level == 0 ? store_relief_of_all(t) : b->relief[level - 1];
    if (level > t->lattice.K - t->k) return SQLITE_OK;
    const rqt_block_number number = rqt_block_number_of(level, square.x / square.side, square.y / square.side);
    if (rqt_block_locate(&t->lattice, t->k, number, &place) != RQT_OK) return SQLITE_OK;
    return store_find_relief(b->store, t, number, &b->relief[level], b->error);
}

/* How many vertices could be saved by cutting the square? A guess: errors fall by half from level to level, so with
 * the largest error e there are about (e/eps)^2, but not more than samples; with the best eps that a part could
 * have fewer. Share 0: the eye may be in the square, or the test wants smaller ones. */
static double worth_of(const builder *b, rqt_square square, int level, const rqt_view_bound *bound) {
    if (bound->share == 0) return INFINITY;
    const int beneath = level - (b->terrain->lattice.K - b->terrain->k);
    const double error = rqt_code_metres(b->relief[level].error) * b->view->scene.exaggeration;
    const double all = square.side, ratio = ldexp(error, beneath > 0 ? -beneath : 0) / bound->eps;
    const double now = fmin(ratio, all), then = fmin(ratio * bound->share, all);
    return now * now - then * then;
}

/* The piece of the scene that holds a square's samples. */
static int find_piece(builder *b, rqt_square square, int *level, rqt_view_piece *piece) {
    if (++b->asked % ASKED_AT_A_TIME == 0 && store_is_interrupted(b->store, &b->code)) return b->code;
    *level = b->terrain->lattice.K - __builtin_ctz((unsigned)square.side);
    b->code = find_relief(b, square, *level);
    if (b->code != SQLITE_OK) return b->code;
    const store_relief *relief = &b->relief[*level];
    scene_piece(&b->view->scene, square, relief->lowest, relief->highest, piece);
    return SQLITE_OK;
}

/* How squares are cut does not depend on achieved_tau: so with more of it no square gets less, and what is not
 * shown stays so. In a band it goes by a camera that sees what all of them see: the piece's share of what it could
 * have tells nothing there, for no part of it could have that. */
static rqt_field_step decide(void *context, rqt_square square, double *eps) {
    builder *b = context;
    const view *v = b->view;
    rqt_view_piece piece;
    rqt_view_bound bound;
    int level = 0;
    if (find_piece(b, square, &level, &piece) != SQLITE_OK) return RQT_FIELD_FAIL;
    rqt_view_test_bound(v->test, &b->cutting, &piece, &bound);
    if (v->has_band) {
        const double best = bound.share > 0 ? bound.eps / bound.share : INFINITY;
        rqt_view_tolerance_in_band(&v->camera, &v->band, &piece.prism, &bound);
        bound.share = best > 0 ? fmin(bound.eps / best * BAND_PRICE, 1) : 1;
    }
    if (square.side > 1 && worth_of(b, square, level, &bound) > WORTH_CUTTING) return RQT_FIELD_SPLIT;
    const bool shown = bound.shown;
    if (v->achieved_tau != v->camera.tau) {
        rqt_camera coarse = v->camera;
        coarse.tau = v->achieved_tau;
        if (v->has_band)
            rqt_view_tolerance_in_band(&coarse, &v->band, &piece.prism, &bound);
        else
            rqt_view_test_bound(v->test, &coarse, &piece, &bound);
    }
    *eps = bound.eps / v->scene.exaggeration;
    if (!shown || b->whole ||
        add_square(&b->shown, grow_square(square, &piece, bound.distance, &b->terrain->lattice)))
        return RQT_FIELD_LEAF;
    b->code = SQLITE_NOMEM;
    return RQT_FIELD_FAIL;
}

static int ended(const builder *b, rqt_status status, char **error) {
    if (status == RQT_INVALID) return fail(error, "camera: what it sees cannot be worked out");
    return status == RQT_READ_FAILED ? b->code : status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
}

int view_field(request *r, char **error) {
    view *v = r->view;
    builder b = {
        .view = v, .store = r->store, .terrain = r->terrain, .whole = r->cover == VIEW_TERRAIN, .error = error};
    b.cutting = v->has_band ? rqt_camera_widen(&v->camera, &v->band) : v->camera;
    rqt_field_free(v->field);
    const rqt_status status = rqt_field_create(&r->terrain->lattice, store_allocator(), decide, &b, &v->field);
    int code = ended(&b, status, error);
    v->guaranteed = v->test == RQT_VIEW_GUARANTEED;
    if (code == SQLITE_OK && b.whole)
        code = request_region(r, NULL, "view", &r->region, error);
    else if (code == SQLITE_OK)
        code = ended(&b,
                     rqt_region_of_squares(b.shown.items, b.shown.count, &r->terrain->lattice, store_allocator(),
                                           &r->region),
                     error);
    sqlite3_free(b.shown.items);
    return code;
}

/* ------------------------------------------------------------------------------------------------- nearest -- */

#define NEAR_ENOUGH 0.75 /* of what the best part of a square gets */

/* As a field that is thrown away: squares that cannot be nearer than what is known are not cut. */
static rqt_field_step look_nearer(void *context, rqt_square square, double *eps) {
    builder *b = context;
    const view *v = b->view;
    rqt_view_piece piece;
    rqt_view_bound bound;
    int level = 0;
    if (find_piece(b, square, &level, &piece) != SQLITE_OK) return RQT_FIELD_FAIL;
    rqt_view_test_bound(v->test, &v->camera, &piece, &bound);
    *eps = 0;
    if (!bound.shown || bound.distance >= b->nearest) return RQT_FIELD_LEAF;
    if (square.side > 1 && bound.share < NEAR_ENOUGH) return RQT_FIELD_SPLIT;
    b->nearest = bound.distance;
    return RQT_FIELD_LEAF;
}

int view_nearest(request *r, double *nearest, char **error) {
    builder b = {.view = r->view, .store = r->store, .terrain = r->terrain, .nearest = INFINITY, .error = error};
    rqt_field *field = NULL;
    const rqt_status status = rqt_field_create(&r->terrain->lattice, store_allocator(), look_nearer, &b, &field);
    rqt_field_free(field);
    *nearest = isinf(b.nearest) ? 0 : b.nearest;
    return ended(&b, status, error);
}
