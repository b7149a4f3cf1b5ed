/* negotiate.c - what a client asks for in headers: media types and codings with their weights (RFC 9110, 12.5),
 * entity tags (13.1.2). And compression itself.
 */
#include "internal.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <zlib.h>
#include <zstd.h>

/* An element of a list: "gzip;q=0.5" is name "gzip" of 4 bytes, weight 500. */
typedef struct element {
    const char *name;
    size_t size;
    int weight; /* thousandths */
} element;

/* "0", "0.25", "1.000" -> thousandths; what is none of these counts as 1, as if it were not there. */
static int read_weight(const char *p) {
    if (*p != '0' && *p != '1') return 1000;
    int weight = (*p - '0') * 1000, place = 100;
    if (p[1] == '.')
        for (p += 2; isdigit((unsigned char)*p) && place > 0; p++, place /= 10) weight += (*p - '0') * place;
    return weight > 1000 ? 1000 : weight;
}

/* The next element of a comma-separated list; its other parameters are passed over. */
static bool next_element(const char **list, element *e) {
    const char *p = *list + strspn(*list, ", \t");
    if (!*p) return false;
    *e = (element){p, strcspn(p, ",; \t"), 1000};
    p += e->size;
    while (*(p += strspn(p, " \t")) == ';') {
        p += 1 + strspn(p + 1, " \t");
        if ((*p == 'q' || *p == 'Q') && p[1] == '=') e->weight = read_weight(p + 2);
        p += strcspn(p, ",;");
    }
    *list = p + strcspn(p, ",");
    return true;
}

static bool is_name(const element *e, const char *name) {
    return strlen(name) == e->size && strncasecmp(e->name, name, e->size) == 0;
}

/* How well "text/html" matches: 3 itself, 2 its kind, 1 anything, 0 not. */
static int match_of(const element *e, const char *type) {
    const size_t plain = strcspn(type, ";"), kind = strcspn(type, "/") + 1;
    if (e->size == plain && strncasecmp(e->name, type, plain) == 0) return 3;
    if (e->size == kind + 1 && e->name[kind] == '*' && strncasecmp(e->name, type, kind) == 0) return 2;
    return is_name(e, "*/*") ? 1 : 0;
}

int negotiate_type(const char *accept, const char *const *types, int count) {
    if (!accept || !accept[strspn(accept, ", \t")]) return 0;
    int best = -1, best_weight = 0;
    for (int i = 0; i < count; i++) {
        int weight = 0, match = 0;
        element e;
        for (const char *list = accept; next_element(&list, &e);) {
            const int m = match_of(&e, types[i]);
            if (m > match) match = m, weight = e.weight;
        }
        if (weight > best_weight) best = i, best_weight = weight;
    }
    return best;
}

const char *coding_name(coding c) {
    static const char *const names[] = {"identity", "gzip", "zstd"};
    return names[c];
}

bool negotiate_coding(const char *accept_encoding, coding liked, coding *c) {
    *c = CODING_IDENTITY;
    if (!accept_encoding) return true;
    int weight[3] = {-1, -1, -1}, any = -1; /* -1: not named */
    element e;
    for (const char *list = accept_encoding; next_element(&list, &e);) {
        for (int i = 0; i < 3; i++)
            if (is_name(&e, coding_name((coding)i))) weight[i] = e.weight;
        if (is_name(&e, "*")) any = e.weight;
    }
    for (int i = 0; i < 3; i++)
        if (weight[i] < 0) weight[i] = any;
    if (weight[CODING_IDENTITY] < 0) weight[CODING_IDENTITY] = 1; /* acceptable when nothing is said of it */
    const coding other = liked == CODING_ZSTD ? CODING_GZIP : CODING_ZSTD;
    const coding packed = weight[liked] >= weight[other] ? liked : other;
    if (weight[packed] >= weight[CODING_IDENTITY]) *c = packed;
    return weight[*c] > 0;
}

/* Weak comparison: what a cache holds may be shown again even if it is only equivalent. */
bool etag_matches(const char *if_none_match, const char *etag) {
    if (!if_none_match || !*etag) return false;
    const size_t length = strlen(etag);
    for (const char *p = if_none_match; *(p += strspn(p, ", \t"));) {
        if (*p == '*') return true;
        if (strncmp(p, "W/", 2) == 0) p += 2;
        if (*p != '"') return false; /* no list of tags */
        const char *end = strchr(p + 1, '"');
        if (!end) return false;
        if ((size_t)(end + 1 - p) == length && memcmp(p, etag, length) == 0) return true;
        p = end + 1;
    }
    return false;
}

/* ----------------------------------------------------------------------------------------------- compression -- */

enum { WORTHWHILE = 256, GZIP_LEVEL = 5, ZSTD_LEVEL = 3, GZIP_WINDOW = 15 + 16, GZIP_MEMORY = 8 };

static char *gzip(const buffer *b, size_t *size) {
    z_stream z = {0};
    if (b->size > 0x7FFFFFFF ||
        deflateInit2(&z, GZIP_LEVEL, Z_DEFLATED, GZIP_WINDOW, GZIP_MEMORY, Z_DEFAULT_STRATEGY) != Z_OK)
        return NULL;
    const uLong bound = deflateBound(&z, (uLong)b->size);
    char *packed = bound <= 0xFFFFFFFF ? malloc(bound) : NULL;
    z.next_in = (Bytef *)b->bytes;
    z.avail_in = (uInt)b->size;
    z.next_out = (Bytef *)packed;
    z.avail_out = (uInt)bound;
    const bool ok = packed && deflate(&z, Z_FINISH) == Z_STREAM_END;
    *size = z.total_out;
    deflateEnd(&z);
    if (ok) return packed;
    free(packed);
    return NULL;
}

static char *zstd(const buffer *b, size_t *size) {
    const size_t bound = ZSTD_compressBound(b->size);
    char *packed = malloc(bound);
    if (!packed) return NULL;
    *size = ZSTD_compress(packed, bound, b->bytes, b->size, ZSTD_LEVEL);
    if (!ZSTD_isError(*size)) return packed;
    free(packed);
    return NULL;
}

void answer_compress(request *r) {
    answer *a = &r->answer;
    if (a->coding == CODING_GZIP && a->is_gzipped) return;
    if (a->coding == CODING_IDENTITY || a->body.size < WORTHWHILE) {
        a->coding = CODING_IDENTITY;
        return;
    }
    size_t size = 0;
    char *packed = a->coding == CODING_GZIP ? gzip(&a->body, &size) : zstd(&a->body, &size);
    if (!packed) { /* larger than it can be, or no memory: as it is */
        a->coding = CODING_IDENTITY;
        return;
    }
    free(a->body.bytes);
    a->body.bytes = packed;
    a->body.size = a->body.capacity = size;
}
