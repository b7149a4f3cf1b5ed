/* target.c - the target of a request: "/collections/alps/range?bbox=6,45,7,46&eps=10", read strictly.
 *
 * The bytes as they were received, not what libmicrohttpd makes of them: what is not well formed (a raw byte that
 * is not ASCII, a stray %, a NUL, text that is no UTF-8, a parameter that is given twice) is an error with a
 * sentence, so that no two readers can take one target for two things. Nothing here names a file: a path is
 * compared with the table of endpoints, and with the page's files, which are in the program.
 */
#include "internal.h"

#include <stdlib.h>
#include <string.h>

static int hex_digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return -1;
}

int utf8_bytes(const unsigned char *p) {
    if (p[0] < 0x80) return 1;
    const int n = p[0] >= 0xC2 && p[0] < 0xE0 ? 2 : (p[0] & 0xF0) == 0xE0 ? 3 : p[0] >= 0xF0 && p[0] < 0xF5 ? 4 : 0;
    for (int i = 1; i < n; i++)
        if ((p[i] & 0xC0) != 0x80) return 0;
    if (n == 3 && ((p[0] == 0xE0 && p[1] < 0xA0) || (p[0] == 0xED && p[1] >= 0xA0))) return 0;
    if (n == 4 && ((p[0] == 0xF0 && p[1] < 0x90) || (p[0] == 0xF4 && p[1] >= 0x90))) return 0;
    return n;
}

static bool is_utf8(const char *text) {
    for (const unsigned char *p = (const unsigned char *)text; *p;) {
        const int n = utf8_bytes(p);
        if (n == 0) return false;
        p += n;
    }
    return true;
}

/* from..end-1 without its escapes, at `to`, which has room for it and an end mark. NULL: what is wrong with it. */
static const char *decode(const char *from, const char *end, bool is_query, char *to) {
    char *const start = to;
    for (; from < end; from++) {
        const unsigned char c = (unsigned char)*from;
        if (c <= 0x20 || c >= 0x7F) return "holds a byte that has to be written as %XX";
        if (c == '#') return "holds a fragment";
        if (c != '%') {
            *to++ = c == '+' && is_query ? ' ' : (char)c;
            continue;
        }
        const int high = end - from > 2 ? hex_digit(from[1]) : -1, low = high >= 0 ? hex_digit(from[2]) : -1;
        if (low < 0) return "holds a % that two hexadecimal digits do not follow";
        if (high == 0 && low == 0) return "holds a NUL";
        *to++ = (char)(high << 4 | low);
        from += 2;
    }
    *to = 0;
    return is_utf8(start) ? NULL : "is no UTF-8";
}

static bool refuse(request *r, const char *what, const char *why) {
    answer_problem(r, MHD_HTTP_BAD_REQUEST, "the %s %s", what, why);
    return false;
}

static bool read_path(request *r, const char *p, const char *end, char **room) {
    for (r->segment_count = 0; p < end;) {
        const char *stop = memchr(p + 1, '/', (size_t)(end - p - 1));
        if (!stop) stop = end;
        if (r->segment_count == MOST_SEGMENTS) {
            answer_problem(r, MHD_HTTP_NOT_FOUND, "there is nothing at a path of so many parts");
            return false;
        }
        const char *wrong = decode(p + 1, stop, false, *room);
        if (wrong) return refuse(r, "path", wrong);
        r->segments[r->segment_count++] = *room;
        *room += strlen(*room) + 1;
        p = stop;
    }
    return true;
}

static bool read_parameter(request *r, const char *p, const char *end, char **room) {
    const char *equals = memchr(p, '=', (size_t)(end - p)), *name_end = equals ? equals : end;
    const char *wrong = decode(p, name_end, true, *room);
    if (wrong) return refuse(r, "query", wrong);
    parameter *next = &r->parameters[r->parameter_count];
    next->name = *room;
    *room += strlen(*room) + 1;
    wrong = decode(equals ? equals + 1 : end, end, true, *room);
    if (wrong) return refuse(r, "query", wrong);
    next->value = *room;
    *room += strlen(*room) + 1;
    if (request_parameter(r, next->name)) {
        answer_problem(r, MHD_HTTP_BAD_REQUEST, "the parameter %s is given twice", next->name);
        return false;
    }
    r->parameter_count++;
    return true;
}

static bool read_query(request *r, const char *p, const char *end, char **room) {
    while (p < end) {
        const char *stop = memchr(p, '&', (size_t)(end - p));
        if (!stop) stop = end;
        if (stop > p) {
            if (r->parameter_count == MOST_PARAMETERS) {
                answer_problem(r, MHD_HTTP_BAD_REQUEST, "there are more than %d parameters", MOST_PARAMETERS);
                return false;
            }
            if (!read_parameter(r, p, stop, room)) return false;
        }
        p = stop + 1;
    }
    return true;
}

bool target_read(request *r) {
    const char *p = r->target;
    const size_t length = strlen(p);
    if (length > MOST_TARGET) {
        answer_problem(r, MHD_HTTP_URI_TOO_LONG, "the request's target is longer than %d bytes", MOST_TARGET);
        return false;
    }
    if (strncmp(p, "http://", 7) == 0) { /* as proxies write it */
        p = strpbrk(p + 7, "/?");
        if (!p) return refuse(r, "path", "is missing");
    }
    if (*p != '/') return refuse(r, "path", "does not begin with /");
    const char *end = r->target + length, *question = strchr(p, '?');
    /* A segment is as long as its slash and itself; a parameter may gain an end mark for an = that it has not. */
    char *room = r->decoded = malloc(length + 2 * MOST_PARAMETERS + 2);
    if (!room) {
        answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "out of memory");
        return false;
    }
    const char *path_end = question ? question : end;
    if (path_end - p > 1 && !read_path(r, p, path_end, &room)) return false;
    return !question || read_query(r, question + 1, end, &room);
}

const char *request_parameter(const request *r, const char *name) {
    for (int i = 0; i < r->parameter_count; i++)
        if (strcmp(r->parameters[i].name, name) == 0) return r->parameters[i].value;
    return NULL;
}
