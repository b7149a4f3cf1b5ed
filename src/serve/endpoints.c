/* endpoints.c - the paths of the service, in one table, and what they have in common: which parameters they take,
 * which terrain they are about, and how an answer is known again (ETag).
 *
 * openapi.json describes the same table for clients; the tests hold the two together.
 */
#include "internal.h"

#include "rqt.h"

#include <stdio.h>
#include <string.h>

#define REGION " bbox wkt "
#define TERRAIN "/collections/{terrain}"

enum { MOST_DIGITS = 8 }; /* of a number in a path: it fits an int */

const endpoint endpoints[] = {
    {"landing", "/", " f ", answer_landing, false},
    {"openapi", "/openapi.json", " ", answer_openapi, false},
    {"conformance", "/conformance", " ", answer_conformance, false},
    {"collections", "/collections", " ", answer_collections, false},
    {"collection", TERRAIN, " ", answer_collection, false},
    {"range", TERRAIN "/range", REGION "eps! f " OPTION_NAMES, answer_range, false},
    {"view", TERRAIN "/view", " camera! f " VIEW_OPTION_NAMES, answer_view, false},
    {"delta", TERRAIN "/delta", REGION "eps_from! eps_to! ", answer_delta, false},
    {"height", TERRAIN "/height", " x! y! eps ", answer_height, false},
    {"profile", TERRAIN "/profile", " line! eps ", answer_profile, false},
    {"verify", TERRAIN "/verify", REGION "eps! " OPTION_NAMES, answer_verify, false},
    {"explain", TERRAIN "/explain", REGION "eps! " OPTION_NAMES, answer_explain, false},
    {"area", TERRAIN "/area", REGION "eps! " OPTION_NAMES, answer_area, false},
    {"layer", TERRAIN "/tiles/quantized-mesh/layer.json", " ", answer_tile_document, false},
    {"tile", TERRAIN "/tiles/quantized-mesh/{z}/{x}/{y}.terrain", " extensions v ", answer_tile, false},
    {"tileset", TERRAIN "/tiles/3d-tiles/tileset.json", " ", answer_tile_document, false},
    {"content", TERRAIN "/tiles/3d-tiles/content/{z}/{x}/{y}.glb", " v ", answer_tile, false},
    {"subtree", TERRAIN "/tiles/3d-tiles/subtrees/{z}/{x}/{y}.subtree", " v ", answer_tile, false},
    {"cesium", "/cesium", " terrain tiles ", answer_cesium, false},
    {"terrarium", TERRAIN "/tiles/terrarium/tile.json", " ", answer_tile_document, false},
    {"terrarium_tile", TERRAIN "/tiles/terrarium/{z}/{x}/{y}.png", " v ", answer_tile, false},
    {"health", "/healthz", " ", answer_health, true},
    {"metrics", "/metrics", " ", answer_metrics, true},
    {"page", "/{file}", " ", NULL, false},
};
const int endpoint_count = sizeof endpoints / sizeof *endpoints;

/* Is a segment what a part of n bytes of a path in the table stands for? "{z}": a number, "{y}.terrain": one with
 * that behind it, anything else itself. The terrain of the path goes into the request. */
static bool is_segment(request *r, const char *segment, const char *part, size_t n) {
    if (strncmp(part, "{file}", n) == 0) return page_is(r);
    if (strncmp(part, "{terrain}", n) == 0) {
        r->terrain = segment;
        return true;
    }
    if (*part == '{') {
        const char *close = memchr(part, '}', n);
        const size_t digits = strspn(segment, "0123456789"), rest = n - (size_t)(close + 1 - part);
        if (digits == 0 || digits > MOST_DIGITS || (digits > 1 && *segment == '0')) return false;
        return strlen(segment + digits) == rest && memcmp(segment + digits, close + 1, rest) == 0;
    }
    return strlen(segment) == n && memcmp(segment, part, n) == 0;
}

static bool is_path(request *r, const char *path) {
    int i = 0;
    for (const char *p = path + 1; *p; i++) {
        const size_t n = strcspn(p, "/");
        if (i == r->segment_count || !is_segment(r, r->segments[i], p, n)) return false;
        p += n + (p[n] == '/');
    }
    return i == r->segment_count;
}

/* 0: the endpoint does not take it; 1: it may be given; 2: it must be. */
static int takes(const endpoint *e, const char *name) {
    const size_t n = strlen(name);
    if (n == 0 || strpbrk(name, " !")) return 0;
    for (const char *p = e->parameters; (p = strstr(p, name)) != NULL; p += n)
        if (p[-1] == ' ' && (p[n] == ' ' || p[n] == '!')) return p[n] == '!' ? 2 : 1;
    return 0;
}

/* " bbox wkt eps", or " none". */
static void say_parameters(const endpoint *e, char *text, size_t room) {
    size_t n = 0;
    for (const char *p = e->parameters; *p && n + 1 < room; p++)
        if (*p != '!' && (*p != ' ' || p[1])) text[n++] = *p;
    text[n] = '\0';
    if (n == 0) snprintf(text, room, " none");
}

static bool check_parameters(request *r) {
    for (int i = 0; i < r->parameter_count; i++)
        if (!takes(r->endpoint, r->parameters[i].name)) {
            char known[256];
            say_parameters(r->endpoint, known, sizeof known);
            answer_problem(r, MHD_HTTP_BAD_REQUEST, "%s takes no parameter \"%s\"; it takes%s", r->endpoint->path,
                           r->parameters[i].name, known);
            return false;
        }
    for (const char *p = r->endpoint->parameters; (p = strchr(p, '!')) != NULL; p++) {
        const char *start = p;
        while (start[-1] != ' ') start--;
        char name[32];
        snprintf(name, sizeof name, "%.*s", (int)(p - start), start);
        if (request_parameter(r, name)) continue;
        answer_problem(r, MHD_HTTP_BAD_REQUEST, "the parameter %s of %s is missing", name, r->endpoint->path);
        return false;
    }
    return true;
}

bool endpoint_find(request *r) {
    for (int i = 0; i < endpoint_count && !r->endpoint; i++)
        if (is_path(r, endpoints[i].path)) r->endpoint = &endpoints[i];
    if (r->endpoint) return check_parameters(r);
    answer_problem(r, MHD_HTTP_NOT_FOUND, "there is nothing at this path; /openapi.json tells what there is");
    return false;
}

void endpoint_answer(worker *w, request *r) {
    if (r->endpoint->answer)
        r->endpoint->answer(w, r);
    else
        page_answer(r, r->segments[0]);
    if (r->answer.body.is_over)
        answer_problem(r, MHD_HTTP_CONTENT_TOO_LARGE,
                       "the answer is larger than %lld bytes: ask for a smaller region or a larger tolerance",
                       (long long)r->service->options.max_bytes);
    if (r->answer.body.no_memory) answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "out of memory");
}

/* FNV-1a, on from hash. */
static uint64_t add_text(uint64_t hash, const char *text) {
    for (; *text; text++) hash = (hash ^ (unsigned char)*text) * 0x100000001B3u;
    return (hash ^ 0xFF) * 0x100000001B3u;
}

bool endpoint_represent(request *r, uint64_t state, const char *type, bool packed, bool by_accept) {
    answer *a = &r->answer;
    if (packed) a->coding = CODING_IDENTITY;
    /* zstd is quicker and smaller, unless gzip is at hand. */
    else if (!negotiate_coding(r->accept_encoding, a->is_gzipped ? CODING_GZIP : CODING_ZSTD, &a->coding)) {
        answer_problem(r, MHD_HTTP_NOT_ACCEPTABLE,
                       "answers are zstd, gzip, or as they are: Accept-Encoding takes none");
        return false;
    }
    a->status = MHD_HTTP_OK;
    a->type = type;
    a->varies = by_accept ? (packed ? "Accept" : "Accept, Accept-Encoding") : packed ? NULL : "Accept-Encoding";
    if (r->root) a->varies = "Accept-Encoding, Host, X-Forwarded-Host, X-Forwarded-Prefix, X-Forwarded-Proto";
    a->is_lasting = state != 0;
    if (!state) return true;
    /* What the answer is a function of: the program, the database, the request, and how it is packed. */
    uint64_t asked = add_text(add_text(add_text(0xCBF29CE484222325u, RQT_VERSION), r->target), type);
    if (r->root) asked = add_text(asked, r->root);
    snprintf(a->etag, sizeof a->etag, "\"%016llx-%016llx%s%s\"", (unsigned long long)state,
             (unsigned long long)asked, a->coding == CODING_IDENTITY ? "" : "-",
             a->coding == CODING_IDENTITY ? "" : coding_name(a->coding));
    if (!etag_matches(r->if_none_match, a->etag)) return true;
    a->status = MHD_HTTP_NOT_MODIFIED;
    a->coding = CODING_IDENTITY;
    return false;
}

/* ----------------------------------------------------------------------------------------------- the terrain -- */

typedef enum found { FOUND, NOT_HERE, FAILED } found;

/* FAILED: why is the answer. */
static found find_terrain(database *d, request *r, terrain *t) {
    sqlite3_stmt *row = database_prepare(
        d, r, "SELECT srid, width IS NULL, complete FROM rqt_terrains WHERE name = ?1 AND +schema = 'main'");
    if (!row) return FAILED;
    sqlite3_bind_text(row, 1, r->terrain, -1, SQLITE_STATIC);
    const int code = sqlite3_step(row);
    if (code == SQLITE_DONE) return NOT_HERE;
    if (code != SQLITE_ROW) {
        database_failed(d, r, code, NULL);
        return FAILED;
    }
    t->srid = sqlite3_column_int(row, 0);
    const bool is_damaged = sqlite3_column_int(row, 1) != 0, is_complete = sqlite3_column_int(row, 2) != 0;
    sqlite3_reset(row);
    if (is_damaged)
        answer_problem(r, MHD_HTTP_INTERNAL_SERVER_ERROR, "the terrain %s is damaged: see rqt check", r->terrain);
    else if (!is_complete)
        answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "the import of terrain %s has not finished", r->terrain);
    return is_complete && !is_damaged ? FOUND : FAILED;
}

/* The first database that has it; one that cannot be asked is in nobody's way who asks for another's terrain. */
bool terrain_begin(worker *w, request *r, terrain *t) {
    for (int i = 0; i < w->database_count; i++) {
        *t = (terrain){.database = databases_at(w->databases, i)};
        if (!database_begin(t->database, r, &t->state)) continue;
        const found what = find_terrain(t->database, r, t);
        if (what == FOUND) {
            answer_clear(r);
            return true;
        }
        database_end(t->database);
    }
    if (!r->answer.status)
        answer_problem(r, MHD_HTTP_NOT_FOUND, "there is no terrain of this name; /collections lists them");
    return false;
}

void terrain_end(terrain *t) {
    database_end(t->database);
}
