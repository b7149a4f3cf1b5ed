/* globe.c - tiles for globes, as the room tiles makes them: their description, and one at a time. The same bytes as
 * `rqt tiles` writes, all extensions in them: clients pass over what they have not asked for.
 */
#include "internal.h"

#include <stdlib.h>

/* What the room tiles was asked for, as the answer; code is its own. */
static void finish(request *r, const terrain *t, int code, char *sentence, tile_bytes *bytes) {
    if (code != SQLITE_OK)
        database_failed(t->database, r, code, sentence ? sentence : sqlite3_errstr(code));
    else if (bytes->size == 0)
        answer_problem(r, MHD_HTTP_NOT_FOUND,
                       "the terrain has no such tile; layer.json lists those that there are");
    else
        buffer_add(&r->answer.body, bytes->bytes, bytes->size);
    sqlite3_free(bytes->bytes);
    sqlite3_free(sentence);
}

typedef int make(tiles *t, const request *r, tile_bytes *out, char **error);

static void answer_bytes(worker *w, request *r, const char *type, make *bytes_of) {
    terrain t;
    if (!terrain_begin(w, r, &t)) return;
    tiles *all = endpoint_represent(r, t.state, type, false, false) ? database_tiles(t.database, r) : NULL;
    if (all) {
        tile_bytes bytes = {0};
        char *sentence = NULL;
        int code = tiles_begin(all, r->terrain, &sentence);
        if (code == SQLITE_OK) {
            code = bytes_of(all, r, &bytes, &sentence);
            tiles_end(all);
        }
        finish(r, &t, code, sentence, &bytes);
    }
    terrain_end(&t);
}

static int make_layer(tiles *t, const request *r, tile_bytes *out, char **error) {
    (void)r;
    return tiles_layer(t, 0, tiles_finest(t), out, error);
}

/* .../tiles/quantized-mesh/{z}/{x}/{y}.terrain: numbers, as the table says. */
static int make_tile(tiles *t, const request *r, tile_bytes *out, char **error) {
    return tiles_make(t, atoi(r->segments[4]), atoi(r->segments[5]), atoi(r->segments[6]), out, error);
}

void answer_layer(worker *w, request *r) {
    answer_bytes(w, r, "application/json", make_layer);
}

void answer_tile(worker *w, request *r) {
    answer_bytes(w, r, TILES_MEDIA_TYPE, make_tile);
}
