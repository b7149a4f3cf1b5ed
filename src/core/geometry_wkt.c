/* geometry_wkt.c - the reader of WKT and EWKT.
 *
 *     text    = [ "SRID" "=" integer ";" ] tagged
 *     tagged  = name [ "Z" | "M" | "ZM" ] ( "EMPTY" | body )      the suffix may touch the name: POLYGONZ
 *     body    = "(" tuple ")"                                     POINT
 *             | "(" tuple { "," tuple } ")"                       LINESTRING
 *             | "(" points { "," points } ")"                     POLYGON, points = LINESTRING's body or EMPTY
 *             | "(" member { "," member } ")"                     MULTI..., member = the body of its type or EMPTY;
 *                                                                 MULTIPOINT's members may go without parentheses
 *             | "(" tagged { "," tagged } ")"                     GEOMETRYCOLLECTION
 *     tuple   = number number [ number [ number ] ]
 *
 * Upper or lower case, white space anywhere between tokens. A suffix fixes how many numbers a tuple has; without
 * one the first tuple of each tagged geometry does, since EWKT writes POINT(1 2 3). One look-ahead character, no
 * copy of the text, recursion only into collections. Sentences count characters from 1. */
#include "geometry.h"

#include <math.h>
#include <stdlib.h>

typedef struct wkt {
    const char *text;
    size_t n, at;
    rqt_geometry *geometry;
    rqt_message *message;
} wkt;

#define TRY(step)                                    \
    do {                                             \
        rqt_status try_status = (step);              \
        if (try_status != RQT_OK) return try_status; \
    } while (0)

static rqt_status fail_at(const wkt *w, const char *what, size_t at) {
    sentence_begin(w->message, what);
    sentence_add(w->message, " at character ");
    sentence_add_integer(w->message, (int64_t)at + 1);
    return RQT_INVALID;
}

/* ------------------------------------------------------------------------------------------- tokens -- */
/* Not the functions of ctype.h: those follow the locale. */
static bool is_space(char c) {
    return c == ' ' || (c >= '\t' && c <= '\r');
}
static bool is_digit(char c) {
    return c >= '0' && c <= '9';
}
static char upper(char c) {
    return c >= 'a' && c <= 'z' ? (char)(c - 'a' + 'A') : c;
}
static bool is_letter(char c) {
    return upper(c) >= 'A' && upper(c) <= 'Z';
}

/* The character at the cursor; 0, which no token contains, past the end. */
static char peek(const wkt *w) {
    return w->at < w->n ? w->text[w->at] : '\0';
}

static void skip_space(wkt *w) {
    while (w->at < w->n && is_space(w->text[w->at])) w->at++;
}

static bool take(wkt *w, char c) {
    skip_space(w);
    if (w->at == w->n || w->text[w->at] != c) return false;
    w->at++;
    return true;
}

/* How many letters stand at `at`. */
static size_t letters(const wkt *w, size_t at) {
    size_t n = 0;
    while (at + n < w->n && is_letter(w->text[at + n])) n++;
    return n;
}

static bool is_word(const wkt *w, size_t at, size_t n, const char *word) {
    size_t i = 0;
    while (i < n && word[i] && upper(w->text[at + i]) == word[i]) i++;
    return i == n && !word[i];
}

static bool take_word(wkt *w, const char *word) {
    skip_space(w);
    size_t n = letters(w, w->at);
    if (n == 0 || !is_word(w, w->at, n, word)) return false;
    w->at += n;
    return true;
}

/* ------------------------------------------------------------------------------------------ numbers -- */
/* strtod reads the decimal point of the locale, whatever that is today. So it never sees one: 12.5e3 is handed to
 * it as 125e2. 768 digits decide how a decimal rounds to a double; of what follows only matters whether it is zero,
 * so one last digit stands for it, and a number of any length is read exactly. */
#define NUMBER_DIGITS 800
#define NUMBER_EXPONENT 99999999 /* beyond it everything is 0 or infinite, however many digits there are */

static double decimal_value(char *digits, size_t n, int64_t exponent) {
    if (n == 0) return 0;
    if (exponent > NUMBER_EXPONENT) exponent = NUMBER_EXPONENT;
    if (exponent < -NUMBER_EXPONENT) exponent = -NUMBER_EXPONENT;
    digits[n++] = 'e';
    digits[n++] = exponent < 0 ? '-' : '+';
    uint32_t rest = (uint32_t)(exponent < 0 ? -exponent : exponent);
    for (uint32_t power = 10000000; power > 0; power /= 10) digits[n++] = (char)('0' + rest / power % 10);
    digits[n] = '\0';
    return strtod(digits, NULL);
}

static rqt_status read_number(wkt *w, double *value) {
    char digits[NUMBER_DIGITS + 16];
    size_t kept = 0;
    int64_t exponent = 0;
    bool any = false, point = false, cut = false;
    skip_space(w);
    size_t start = w->at;
    bool negative = peek(w) == '-';
    if (negative || peek(w) == '+') w->at++;
    size_t n = letters(w, w->at);
    if (is_word(w, w->at, n, "NAN") || is_word(w, w->at, n, "INF") || is_word(w, w->at, n, "INFINITY"))
        return fail_at(w, "a number is not finite", start);
    for (;; w->at++) {
        char c = peek(w);
        if (c == '.' && !point) {
            point = true;
            continue;
        }
        if (!is_digit(c)) break;
        any = true;
        if (kept < NUMBER_DIGITS && (kept > 0 || c != '0'))
            digits[kept++] = c;
        else if (kept > 0) {
            cut |= c != '0';
            exponent++;
        }
        if (point) exponent--;
    }
    if (!any) return fail_at(w, "a number is expected", start);
    if (cut) {
        digits[kept++] = '1';
        exponent--;
    }
    if (upper(peek(w)) == 'E') {
        w->at++;
        bool down = peek(w) == '-';
        if (down || peek(w) == '+') w->at++;
        if (!is_digit(peek(w))) return fail_at(w, "a number is malformed", start);
        int64_t e = 0;
        for (; is_digit(peek(w)); w->at++)
            if (e < INT64_MAX / 32) e = 10 * e + (peek(w) - '0');
        exponent += down ? -e : e;
    }
    char next = peek(w);
    if (w->at < w->n && !is_space(next) && next != ',' && next != ')')
        return fail_at(w, "a number is malformed", start);
    *value = decimal_value(digits, kept, exponent);
    if (!isfinite(*value)) return fail_at(w, "a number is too large", start);
    if (negative) *value = -*value;
    return RQT_OK;
}

/* *ordinates: how many numbers a tuple has; 0 while no one knows. */
static rqt_status read_tuple(wkt *w, int *ordinates) {
    double v[4] = {0};
    int n = 0;
    skip_space(w);
    size_t start = w->at;
    for (;;) {
        skip_space(w);
        if (n >= 2 && (w->at == w->n || peek(w) == ',' || peek(w) == ')')) break;
        if (n == 4) return fail_at(w, "a point has more than 4 numbers", start);
        TRY(read_number(w, &v[n++]));
    }
    if (*ordinates == 0) *ordinates = n;
    if (n != *ordinates) return fail_at(w, "a point has the wrong number of ordinates", start);
    return geometry_add_point(w->geometry, v[0], v[1], w->message);
}

/* ------------------------------------------------------------------------------------------- bodies -- */
static rqt_status expect(wkt *w, char c) {
    if (take(w, c)) return RQT_OK;
    char what[] = "'?' is expected";
    what[1] = c;
    return fail_at(w, what, w->at);
}

/* What stands between the items of a list: true after a comma, false after the closing parenthesis. */
static rqt_status next_item(wkt *w, bool *more) {
    *more = take(w, ',');
    if (*more || take(w, ')')) return RQT_OK;
    return fail_at(w, "',' or ')' is expected", w->at);
}

static rqt_status read_ring(wkt *w, int *ordinates) {
    TRY(geometry_open_ring(w->geometry, w->message));
    if (take_word(w, "EMPTY")) return geometry_close_ring(w->geometry, w->message);
    TRY(expect(w, '('));
    for (bool more = true; more;) {
        TRY(read_tuple(w, ordinates));
        TRY(next_item(w, &more));
    }
    return geometry_close_ring(w->geometry, w->message);
}

/* One point, line or polygon after its name; bare: a point that may go without parentheses. */
static rqt_status read_simple(wkt *w, geometry_type type, bool bare, int *ordinates) {
    TRY(geometry_open_part(w->geometry, type, w->message));
    if (take_word(w, "EMPTY")) return geometry_close_part(w->geometry, w->message);
    skip_space(w);
    if (type == GEOMETRY_POINT) {
        bool parentheses = !bare || peek(w) == '(';
        TRY(geometry_open_ring(w->geometry, w->message));
        if (parentheses) TRY(expect(w, '('));
        TRY(read_tuple(w, ordinates));
        if (parentheses) TRY(expect(w, ')'));
        TRY(geometry_close_ring(w->geometry, w->message));
    } else if (type == GEOMETRY_LINE) {
        TRY(read_ring(w, ordinates));
    } else {
        TRY(expect(w, '('));
        for (bool more = true; more;) {
            TRY(read_ring(w, ordinates));
            TRY(next_item(w, &more));
        }
    }
    return geometry_close_part(w->geometry, w->message);
}

/* The name with its suffix. *ordinates: 3 or 4 where a suffix says so, else 0. */
static rqt_status read_name(wkt *w, uint32_t *type, int *ordinates) {
    static const struct {
        const char *suffix;
        size_t n;
        int ordinates;
    } suffixes[] = {{"", 0, 0}, {"Z", 1, 3}, {"M", 1, 3}, {"ZM", 2, 4}};
    skip_space(w);
    size_t start = w->at, n = letters(w, start);
    for (uint32_t t = 1; t < GEOMETRY_TYPES; t++) {
        for (size_t s = 0; s < 4; s++) {
            if (n <= suffixes[s].n) continue;
            size_t name = n - suffixes[s].n;
            if (!is_word(w, start, name, geometry_type_name(t)) ||
                !is_word(w, start + name, suffixes[s].n, suffixes[s].suffix))
                continue;
            w->at += n;
            *type = t;
            *ordinates = suffixes[s].ordinates;
            for (size_t i = 1; i < 4 && *ordinates == 0; i++)
                if (take_word(w, suffixes[i].suffix)) *ordinates = suffixes[i].ordinates;
            return RQT_OK;
        }
    }
    return fail_at(w, "the name of a geometry type is expected", start);
}

static rqt_status read_tagged(wkt *w, int depth) {
    uint32_t type;
    int ordinates;
    TRY(read_name(w, &type, &ordinates));
    if (type > GEOMETRY_COLLECTION) return geometry_refuse_type(type, w->message);
    if (type <= GEOMETRY_POLYGON) return read_simple(w, (geometry_type)type, false, &ordinates);
    if (take_word(w, "EMPTY")) return RQT_OK;
    if (depth == GEOMETRY_MAX_DEPTH) return fail_at(w, "collections are nested too deep", w->at);
    TRY(expect(w, '('));
    geometry_type member = geometry_member_type(type);
    for (bool more = true; more;) {
        if (member == GEOMETRY_ANY)
            TRY(read_tagged(w, depth + 1));
        else
            TRY(read_simple(w, member, true, &ordinates));
        TRY(next_item(w, &more));
    }
    return RQT_OK;
}

static rqt_status read_srid(wkt *w) {
    TRY(expect(w, '='));
    skip_space(w);
    size_t start = w->at;
    bool negative = peek(w) == '-', any = false;
    if (negative || peek(w) == '+') w->at++;
    int64_t srid = 0;
    for (; is_digit(peek(w)); w->at++) {
        any = true;
        srid = 10 * srid + (peek(w) - '0');
        if (srid > INT32_MAX) return fail_at(w, "the SRID is too large", start);
    }
    if (!any) return fail_at(w, "the SRID is not a number", start);
    w->geometry->srid = (int32_t)(negative ? -srid : srid);
    return expect(w, ';');
}

rqt_status geometry_read_text(rqt_geometry *g, const char *text, size_t n, rqt_message *message) {
    wkt w = {text, n, 0, g, message};
    if (take_word(&w, "SRID")) TRY(read_srid(&w));
    TRY(read_tagged(&w, 0));
    skip_space(&w);
    return w.at == n ? RQT_OK : fail_at(&w, "the geometry has ended, but the text goes on", w.at);
}
