/* token.c - what an answer to a view is known by (option previous): its anchor, which holds all of a camera,
 * exactly, so that any connection can make the answer again; what else it was made of, as numbers to compare; and a
 * fingerprint of what came out, by which another state of the database is noticed.
 *
 * As text: "rqtv1-" and the bytes in hexadecimal digits, numbers as they are in memory of the machine that made it,
 * lowest byte first on all that there are; the last 8 bytes are a checksum of the others. It is no secret and no
 * signature: who makes one up gets an answer that is right for the camera in it. */
#include "view.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <string.h>

static const char PREFIX[] = "rqtv1-";

enum { NUMBERS = 3, DOUBLES = 22, BYTES = 8 * (NUMBERS + DOUBLES + 1) };

/* ------------------------------------------------------------------------------------------------- numbers -- */

#define FIRST UINT64_C(0x9E3779B97F4A7C15)

static uint64_t fold(uint64_t h, uint64_t w) {
    const uint64_t v = (h ^ w) * UINT64_C(0xC2B2AE3D27D4EB4F);
    return v << 29 | v >> 35;
}

static uint64_t finish(uint64_t h) {
    h = (h ^ h >> 32) * UINT64_C(0xFF51AFD7ED558CCD);
    return h ^ h >> 29;
}

static uint64_t fold_double(uint64_t h, double d) {
    uint64_t bits;
    memcpy(&bits, &d, sizeof bits);
    return fold(h, bits);
}

static uint64_t fold_text(uint64_t h, const char *text) {
    for (; *text; text++) h = fold(h, (unsigned char)*text);
    return fold(h, 256);
}

uint64_t view_terrain_number(const store_terrain *t) {
    uint64_t h = fold_text(FIRST, t->name);
    h = fold_text(h, t->created);
    h = fold(h, (uint64_t)(uint32_t)t->lattice.width << 32 | (uint32_t)t->lattice.height);
    h = fold(h, (uint64_t)t->k << 32 | (uint32_t)t->unit.d);
    const double frame[] = {t->placement.x0,    t->placement.y0, t->placement.dx, t->placement.dy,
                            (double)t->unit.z0, t->unit.scale,   t->unit.offset,  t->quantum_error};
    for (size_t i = 0; i < sizeof frame / sizeof *frame; i++) h = fold_double(h, frame[i]);
    return finish(fold(h, (uint64_t)t->unit.numerator << 32 | (uint32_t)t->unit.denominator));
}

int view_options_number(const request *r, uint64_t *number) {
    uint64_t h = fold(FIRST, (uint64_t)r->options.select << 32 | r->options.outline);
    h = fold(h, (uint64_t)r->options.metric << 32 | r->frame_kind);
    h = fold(fold(h, (uint64_t)r->max_triangles), r->cover);
    if (r->detail) {
        char *text = cJSON_PrintUnformatted(r->detail);
        if (!text) return SQLITE_NOMEM;
        h = fold_text(h, text);
        cJSON_free(text);
    }
    *number = finish(h);
    return SQLITE_OK;
}

uint64_t view_fingerprint(const rqt_patch *patch) {
    uint64_t sum = patch->vertex_count;
    for (size_t i = 0; i < patch->vertex_count; i++) {
        const rqt_patch_vertex *v = &patch->vertices[i];
        sum += finish(fold(fold(FIRST, (uint64_t)(uint32_t)v->row << 32 | (uint32_t)v->col), (uint32_t)v->q));
    }
    return sum;
}

/* ---------------------------------------------------------------------------------------------------- text -- */

/* The doubles of a token, in the order of its bytes. */
static void doubles_of(view_token *t, double *all[DOUBLES]) {
    rqt_camera *c = &t->camera;
    double *const vectors[] = {c->eye, c->forward, c->right, c->up};
    double *const rest[] = {&c->width, &c->height,       &c->focal, &c->near, &c->far,
                            &c->tau,   &t->exaggeration, &t->tau,   &t->move, &t->turn};
    for (int i = 0; i < 12; i++) all[i] = &vectors[i / 3][i % 3];
    for (int i = 0; i < 10; i++) all[12 + i] = rest[i];
}

static void put64(uint8_t *p, uint64_t v) {
    for (int i = 0; i < 8; i++) p[i] = (uint8_t)(v >> 8 * i);
}

static uint64_t get64(const uint8_t *p) {
    uint64_t v = 0;
    for (int i = 0; i < 8; i++) v |= (uint64_t)p[i] << 8 * i;
    return v;
}

static uint64_t sum_of(const uint8_t *bytes) {
    uint64_t h = FIRST;
    for (int i = 0; i < BYTES - 8; i += 8) h = fold(h, get64(bytes + i));
    return finish(h);
}

char *token_write(const view_token *token) {
    static const char digits[] = "0123456789abcdef";
    view_token t = *token;
    double *all[DOUBLES];
    uint8_t bytes[BYTES];
    doubles_of(&t, all);
    put64(bytes, t.terrain);
    put64(bytes + 8, t.options);
    put64(bytes + 16, t.fingerprint);
    for (int i = 0; i < DOUBLES; i++) {
        uint64_t bits;
        memcpy(&bits, all[i], sizeof bits);
        put64(bytes + 8 * (NUMBERS + i), bits);
    }
    put64(bytes + BYTES - 8, sum_of(bytes));
    char *text = sqlite3_malloc64(sizeof PREFIX + 2 * BYTES), *p = text;
    if (!text) return NULL;
    memcpy(p, PREFIX, sizeof PREFIX - 1);
    p += sizeof PREFIX - 1;
    for (int i = 0; i < BYTES; i++) {
        *p++ = digits[bytes[i] >> 4];
        *p++ = digits[bytes[i] & 15];
    }
    *p = 0;
    return text;
}

static int digit_of(char c) {
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

static bool get_bytes(const char *text, uint8_t bytes[BYTES]) {
    if (strncmp(text, PREFIX, sizeof PREFIX - 1) != 0 || strlen(text) != sizeof PREFIX - 1 + 2 * BYTES)
        return false;
    text += sizeof PREFIX - 1;
    for (int i = 0; i < BYTES; i++) {
        const int high = digit_of(text[2 * i]), low = digit_of(text[2 * i + 1]);
        if (high < 0 || low < 0) return false;
        bytes[i] = (uint8_t)(high << 4 | low);
    }
    return get64(bytes + BYTES - 8) == sum_of(bytes);
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Could a camera of ours be this one? */
static bool camera_is_sound(const rqt_camera *c) {
    static const double nearly = 1e-9;
    const double *const axis[] = {c->forward, c->right, c->up};
    for (int i = 0; i < 3; i++)
        if (!isfinite(c->eye[i]) || !(fabs(dot(axis[i], axis[i]) - 1) < nearly) ||
            !(fabs(dot(axis[i], axis[(i + 1) % 3])) < nearly))
            return false;
    return c->width > 0 && isfinite(c->width) && c->height > 0 && isfinite(c->height) && c->focal > 0 &&
           isfinite(c->focal) && c->near >= 0 && c->near < c->far && c->tau > 0 && isfinite(c->tau);
}

int token_read(const char *text, view_token *token, char **error) {
    uint8_t bytes[BYTES];
    double *all[DOUBLES];
    if (!get_bytes(text, bytes))
        return fail(error, "option \"previous\" is neither \"\" nor a token that a view has given: its text has "
                           "changed, or is none");
    *token = (view_token){.terrain = get64(bytes), .options = get64(bytes + 8), .fingerprint = get64(bytes + 16)};
    doubles_of(token, all);
    for (int i = 0; i < DOUBLES; i++) {
        const uint64_t bits = get64(bytes + 8 * (NUMBERS + i));
        memcpy(all[i], &bits, sizeof bits);
    }
    if (!camera_is_sound(&token->camera) || !(token->exaggeration > 0) || !isfinite(token->exaggeration) ||
        !(token->tau >= token->camera.tau) || !isfinite(token->tau) || !(token->move >= 0) ||
        !isfinite(token->move) || !(token->turn >= 0) || !(token->turn <= 1))
        return fail(error, "option \"previous\": the token holds a camera that is none");
    return SQLITE_OK;
}
