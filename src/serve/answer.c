/* answer.c - what an answer is made of: bytes that grow up to a limit, numbers and texts of JSON, problems.
 *
 * Small documents go through cJSON; the rows of a query, which may be millions, are written as they come.
 */
#include "internal.h"

#include "format.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FIRST_CAPACITY = 4096 };

/* ------------------------------------------------------------------------------------------------- bytes -- */

static bool buffer_reserve(buffer *b, size_t more) {
    if (b->is_over || b->no_memory) return false;
    if (more > b->most - b->size) {
        b->is_over = true;
        return false;
    }
    if (b->size + more <= b->capacity) return true;
    size_t capacity = b->capacity ? b->capacity : FIRST_CAPACITY;
    while (capacity < b->size + more) capacity *= 2;
    if (capacity > b->most) capacity = b->most;
    char *bytes = realloc(b->bytes, capacity);
    b->no_memory = !bytes;
    if (!bytes) return false;
    b->bytes = bytes;
    b->capacity = capacity;
    return true;
}

void buffer_add(buffer *b, const void *bytes, size_t size) {
    if (!size || !buffer_reserve(b, size)) return;
    memcpy(b->bytes + b->size, bytes, size);
    b->size += size;
}

void buffer_text(buffer *b, const char *text) {
    buffer_add(b, text, strlen(text));
}

void buffer_format(buffer *b, const char *format, ...) {
    char text[512];
    va_list list;
    va_start(list, format);
    const int n = vsnprintf(text, sizeof text, format, list);
    va_end(list);
    if (n > 0) buffer_add(b, text, (size_t)n < sizeof text ? (size_t)n : sizeof text - 1);
}

void buffer_number(buffer *b, double value) {
    char text[32];
    if (isfinite(value))
        buffer_add(b, text, (size_t)format_double(value, text));
    else
        buffer_text(b, "null");
}

/* The character at p; returns where the next one is. */
static const char *add_character(buffer *b, const char *p) {
    const int n = utf8_bytes((const unsigned char *)p);
    if (n)
        buffer_add(b, p, (size_t)n);
    else
        buffer_text(b, "\uFFFD");
    return p + (n ? n : 1);
}

void buffer_utf8(buffer *b, const char *text) {
    for (const char *p = text; *p;) p = add_character(b, p);
}

void buffer_string(buffer *b, const char *text) {
    buffer_text(b, "\"");
    for (const char *p = text; *p;) {
        const unsigned char c = (unsigned char)*p;
        if (c >= 0x20 && c != '"' && c != '\\') {
            p = add_character(b, p);
            continue;
        }
        if (c < 0x20)
            buffer_format(b, "\\u%04x", c);
        else
            buffer_add(b, (const char[]){'\\', *p}, 2);
        p++;
    }
    buffer_text(b, "\"");
}

void buffer_free(buffer *b) {
    free(b->bytes);
    *b = (buffer){0};
}

/* ---------------------------------------------------------------------------------------------- problems -- */

const char *status_title(unsigned status) {
    const char *title = MHD_get_reason_phrase_for(status);
    return title ? title : "Problem";
}

void answer_clear(request *r) {
    buffer_free(&r->answer.body);
    r->answer = (answer){.body = {.most = (size_t)r->service->options.max_bytes}};
}

void answer_problem(request *r, unsigned status, const char *format, ...) {
    va_list list;
    va_start(list, format);
    char *detail = sqlite3_vmprintf(format, list); /* before what it may speak of goes */
    va_end(list);
    answer *a = &r->answer;
    buffer_free(&a->body);
    *a = (answer){.status = status, .type = "application/problem+json", .body = {.most = SIZE_MAX}};
    if (status == MHD_HTTP_SERVICE_UNAVAILABLE) a->retry = "1";
    buffer_format(&a->body,
                  "{\"type\":\"about:blank\",\"title\":\"%s\",\"status\":%u,\"detail\":", status_title(status),
                  status);
    buffer_string(&a->body, detail ? detail : "out of memory");
    buffer_text(&a->body, "}\n");
    sqlite3_free(detail);
}

static bool is_damage(int code) {
    switch (code & 0xFF) {
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
    case SQLITE_IOERR:
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY: /* a killed writer's journal is to be rolled back first */
    case SQLITE_PERM:
    case SQLITE_INTERNAL:
    case SQLITE_FORMAT:
        return true;
    default:
        return false;
    }
}

void answer_failure(request *r, int code, const char *sentence) {
    switch (code & 0xFF) {
    case SQLITE_INTERRUPT:
        if (pool_is_hurried(r->service->pool))
            answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "the service is shutting down");
        else
            answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE,
                           "the answer takes longer than %g s: ask for a smaller region or a larger tolerance",
                           r->service->options.max_seconds);
        return;
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
        answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "the database is being written: %s", sentence);
        return;
    case SQLITE_NOMEM:
        answer_problem(r, MHD_HTTP_SERVICE_UNAVAILABLE, "out of memory");
        return;
    case SQLITE_TOOBIG:
        answer_problem(r, MHD_HTTP_CONTENT_TOO_LARGE, "%s", sentence);
        return;
    default:
        answer_problem(r, is_damage(code) ? MHD_HTTP_INTERNAL_SERVER_ERROR : MHD_HTTP_BAD_REQUEST, "%s", sentence);
    }
}

/* -------------------------------------------------------------------------------------------------- JSON -- */

void answer_json(request *r, const char *type, cJSON *json) {
    char *text = cJSON_Print(json);
    cJSON_Delete(json);
    answer *a = &r->answer;
    if (!a->type) a->type = type;
    if (!a->status) a->status = MHD_HTTP_OK;
    if (text) {
        buffer_utf8(&a->body, text);
        buffer_text(&a->body, "\n");
    } else {
        a->body.no_memory = true;
    }
    cJSON_free(text);
}

void answer_value(buffer *b, sqlite3_stmt *row, int column) {
    switch (sqlite3_column_type(row, column)) {
    case SQLITE_INTEGER:
        buffer_format(b, "%lld", sqlite3_column_int64(row, column));
        break;
    case SQLITE_FLOAT:
        buffer_number(b, sqlite3_column_double(row, column));
        break;
    case SQLITE_TEXT: {
        const char *text = (const char *)sqlite3_column_text(row, column);
        buffer_string(b, text ? text : "");
        break;
    }
    default:
        buffer_text(b, "null");
    }
}

/* In the order of told_headers. */
static const char *const told_columns[TOLD_HEADERS] = {"vertices",     "triangles",  "achieved_eps",
                                                       "achieved_tau", "guaranteed", "token"};
const char *const told_headers[TOLD_HEADERS] = {"RQT-Vertices",     "RQT-Triangles",  "RQT-Achieved-Eps",
                                                "RQT-Achieved-Tau", "RQT-Guaranteed", "RQT-Token"};

/* Numbers as JSON has them, infinity as parameters do: 9e999. */
void answer_tell(request *r, sqlite3_stmt *row, int from) {
    for (int i = from; i < sqlite3_column_count(row); i++)
        for (int k = 0; k < TOLD_HEADERS; k++) {
            if (strcmp(sqlite3_column_name(row, i), told_columns[k]) != 0) continue;
            const double value = sqlite3_column_double(row, i);
            buffer text = {.most = TOLD_BYTES - 1};
            if (sqlite3_column_type(row, i) == SQLITE_TEXT)
                buffer_text(&text, (const char *)sqlite3_column_text(row, i));
            else if (isinf(value))
                buffer_text(&text, "9e999");
            else if (sqlite3_column_type(row, i) != SQLITE_NULL)
                buffer_number(&text, value);
            snprintf(r->answer.told[k], TOLD_BYTES, "%.*s", (int)text.size, text.bytes ? text.bytes : "");
            r->answer.body.no_memory |= text.no_memory;
            buffer_free(&text);
        }
}

void answer_row(buffer *b, sqlite3_stmt *row, int from, int to) {
    buffer_text(b, "[");
    for (int i = from; i < to; i++) {
        if (i > from) buffer_text(b, ",");
        answer_value(b, row, i);
    }
    buffer_text(b, "]");
}
