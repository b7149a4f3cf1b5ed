/* tiles.c - tiles for globes and maps, as the room tiles makes them: the document of a kind, and one tile at a
 * time. The same bytes as `rqt tiles` writes, all extensions in them: clients pass over what they have not asked
 * for.
 *
 * Paths are /collections/{terrain}/tiles/KIND/DOCUMENT and /collections/{terrain}/tiles/KIND/FOLDER z/x/y SUFFIX;
 * the table of endpoints has one row for each, whose words stand here for what they name.
 */
#include "internal.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_HEADER = 256 };
enum { KIND = 3, TILE_SEGMENTS = 7 }; /* a path with a folder has one more */

/* What the room tiles was asked for, as the answer; code is its own. */
static void finish(request *r, const terrain *t, const tile_kind *kind, const tiles *all, int code, char *sentence,
                   tile_bytes *bytes) {
    if ((code & 0xFF) == SQLITE_INTERRUPT && tiles_goes_on(all) && !pool_is_hurried(r->service->pool))
        answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE,
                       "which tiles the terrain has takes longer than %g s to find: ask again, and it goes on from "
                       "here",
                       r->service->options.max_seconds);
    else if (code != SQLITE_OK)
        database_failed(t->database, r, code, sentence ? sentence : sqlite3_errstr(code));
    else if (bytes->size == 0)
        answer_problem(r, MHD_HTTP_NOT_FOUND, "the terrain has no such tile; %s tells which there are",
                       kind->document);
    else
        buffer_add(&r->answer.body, bytes->bytes, bytes->size);
    sqlite3_free(bytes->bytes);
    sqlite3_free(sentence);
}

/* "content/" of .../tiles/KIND/content/{z}/{x}/{y}. */
static int series_of(const request *r, const tile_kind *kind) {
    for (int i = 0; i < kind->series_count; i++) {
        const char *folder = kind->series[i].folder, *segment = r->segments[KIND + 1];
        const size_t n = strlen(folder);
        if (r->segment_count == TILE_SEGMENTS ? n == 0
                                              : n > 0 && strncmp(folder, segment, n - 1) == 0 && !segment[n - 1])
            return i;
    }
    return 0;
}

/* The first of a list that a header holds, if it is made of nothing but letters, digits and `others`. "" if not. */
static void read_header(const request *r, const char *name, const char *others, char value[MOST_HEADER]) {
    const char *given = MHD_lookup_connection_value(r->connection, MHD_HEADER_KIND, name);
    const size_t n = given ? strcspn(given, ", ") : 0;
    value[0] = '\0';
    if (n >= MOST_HEADER) return;
    for (size_t i = 0; i < n; i++)
        if (!isalnum((unsigned char)given[i]) && !strchr(others, given[i])) return;
    memcpy(value, n ? given : "", n);
    value[n] = '\0';
}

/* What the client has asked for, without the document's name: "https://example.org/terrain/collections/.../". There
 * are clients that need whole addresses. Servers before us say what they were asked for in X-Forwarded-Proto, -Host
 * and -Prefix. "", which stands for the document's own folder, where nobody says. */
static char *find_root(const request *r) {
    char host[MOST_HEADER], proto[MOST_HEADER], prefix[MOST_HEADER];
    read_header(r, "X-Forwarded-Host", "-._:[]", host);
    if (!host[0]) read_header(r, MHD_HTTP_HEADER_HOST, "-._:[]", host);
    read_header(r, "X-Forwarded-Proto", "", proto);
    read_header(r, "X-Forwarded-Prefix", "-._~/", prefix);
    size_t n = strlen(prefix);
    while (n > 0 && prefix[n - 1] == '/') prefix[--n] = '\0';
    if (!host[0]) return sqlite3_mprintf("");
    return sqlite3_mprintf("%s://%s%s%s/collections/%s/tiles/%s/", strcmp(proto, "https") ? "http" : "https", host,
                           n > 0 && prefix[0] != '/' ? "/" : "", prefix, r->terrain, r->segments[KIND]);
}

/* A number of a path, which has few digits (endpoints.c). */
static int number_of(const char *segment) {
    return (int)strtol(segment, NULL, 10);
}

static int make(tiles *t, const request *r, int series, tile_bytes *out, char **error) {
    const char *const *place = r->segments + r->segment_count - 3;
    if (series < 0) return tiles_document(t, r->root, 0, tiles_finest(t), out, error);
    return tiles_make(t, series, number_of(place[0]), number_of(place[1]), number_of(place[2]), out, error);
}

/* series < 0: the document. */
static void answer_series(worker *w, request *r, const tile_kind *kind, int series) {
    const char *type = series < 0 ? "application/json" : kind->series[series].media_type;
    const bool is_packed = series >= 0 && kind->series[series].is_packed;
    terrain t;
    if (!terrain_begin(w, r, &t)) return;
    tiles *all = endpoint_represent(r, t.state, type, is_packed, false) ? database_tiles(t.database, r) : NULL;
    if (all) {
        tile_bytes bytes = {0};
        char *sentence = NULL;
        int code = tiles_begin(all, kind, r->terrain, &sentence);
        if (code == SQLITE_OK) {
            code = make(all, r, series, &bytes, &sentence);
            tiles_end(all);
        }
        finish(r, &t, kind, all, code, sentence, &bytes);
    }
    terrain_end(&t);
}

/* Two clients that reach us by different names get different addresses: what one has is not told to be what the
 * other would get (endpoint_represent). */
void answer_tile_document(worker *w, request *r) {
    char *root = find_root(r);
    r->root = root;
    if (root)
        answer_series(w, r, tiles_kind(r->segments[KIND]), -1);
    else
        r->answer.body.no_memory = true;
    r->root = NULL;
    sqlite3_free(root);
}

void answer_tile(worker *w, request *r) {
    const tile_kind *kind = tiles_kind(r->segments[KIND]);
    answer_series(w, r, kind, series_of(r, kind));
}
