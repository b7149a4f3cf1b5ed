/* tiles.c - a connection's tiles: the terrain that is meant, its plan, one tile at a time. */
#include "internal.h"

#include <string.h>

int tiles_open(sqlite3 *db, tiles **out) {
    tiles *t = sqlite3_malloc(sizeof *t);
    *out = NULL;
    if (!t) return SQLITE_NOMEM;
    *t = (tiles){.db = db};
    const int code = store_open(db, &t->store);
    if (code == SQLITE_OK)
        *out = t;
    else
        sqlite3_free(t);
    return code;
}

void tiles_close(tiles *t) {
    if (!t) return;
    for (int i = 0; i < KEPT_PLANS; i++) plan_free(t->kept[i]);
    store_close(t->store);
    sqlite3_free(t);
}

void tiles_limit(tiles *t, int64_t triangles) {
    store_limits_of(t->store)->triangles = triangles;
}

/* The plan that was made of this terrain as it is now, or a new one in the place of the oldest. */
static int find_plan(tiles *t, char **error) {
    const uint64_t state = store_state(t->store);
    for (int i = 0; i < KEPT_PLANS; i++) {
        tile_plan *plan = t->kept[i];
        if (!plan || !state || plan->state != state || strcmp(plan->name, t->terrain->name) != 0) continue;
        t->plan = plan;
        return SQLITE_OK;
    }
    plan_free(t->kept[t->next]);
    t->kept[t->next] = NULL;
    const int code = plan_create(t, state, &t->kept[t->next], error);
    t->plan = t->kept[t->next];
    if (code == SQLITE_OK) t->next = (t->next + 1) % KEPT_PLANS;
    return code;
}

int tiles_begin(tiles *t, const char *terrain, char **error) {
    int code = store_begin(t->store, error);
    if (code != SQLITE_OK) return code;
    code = store_find(t->store, terrain, &t->terrain, error);
    if (code == SQLITE_OK) code = find_plan(t, error);
    if (code != SQLITE_OK) tiles_end(t);
    return code;
}

void tiles_end(tiles *t) {
    t->terrain = NULL;
    t->plan = NULL;
    store_end(t->store);
}

int tiles_finest(const tiles *t) {
    return t->plan->finest;
}

int tiles_make(tiles *t, int z, int32_t x, int32_t y, tile_bytes *out, char **error) {
    tile_place place;
    tile_mesh mesh;
    *out = (tile_bytes){0};
    if (!plan_place(t, z, x, y, &place) || place.turns == 0) return SQLITE_OK;
    int code = mesh_make(t, &place, &mesh, error);
    if (code == SQLITE_OK && mesh.cut.triangle_count > 0) code = encode_tile(t, &place, &mesh, out, error);
    mesh_free(&mesh);
    return code;
}
