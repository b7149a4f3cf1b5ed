/* tables.c - what SQL tells in rows: heights, profiles, proofs, areas, what a query reads. Each endpoint is a
 * statement and a way to write its rows.
 */
#include "internal.h"

#include <string.h>

/* {"name":value,...} */
static int write_object(request *r, sqlite3_stmt *row) {
    buffer *b = &r->answer.body;
    const int code = sqlite3_step(row);
    if (code != SQLITE_ROW) return code;
    for (int i = 0; i < sqlite3_column_count(row); i++) {
        buffer_format(b, "%s\"%s\":", i ? "," : "{", sqlite3_column_name(row, i));
        answer_value(b, row, i);
    }
    buffer_text(b, "}\n");
    return SQLITE_DONE;
}

/* {"columns":[...],"rows":[[...],...]} */
static int write_table(request *r, sqlite3_stmt *rows) {
    buffer *b = &r->answer.body;
    const int columns = sqlite3_column_count(rows);
    int code, count = 0;
    buffer_text(b, "{\"columns\":[");
    for (int i = 0; i < columns; i++) buffer_format(b, "%s\"%s\"", i ? "," : "", sqlite3_column_name(rows, i));
    buffer_text(b, "],\"rows\":[");
    while ((code = sqlite3_step(rows)) == SQLITE_ROW && !b->is_over) {
        buffer_text(b, count++ ? ",\n" : "\n");
        answer_row(b, rows, 0, columns);
    }
    buffer_text(b, "]}\n");
    return code;
}

static void answer_with(worker *w, request *r, const char *sql, int (*write)(request *r, sqlite3_stmt *rows)) {
    terrain t;
    query q;
    if (!terrain_begin(w, r, &t)) return;
    sqlite3_stmt *statement = NULL;
    if (query_read(r, &t, &q)) {
        if (endpoint_represent(r, t.state, "application/json", false, false) &&
            (statement = database_prepare(t.database, r, sql)) != NULL) {
            query_bind(&q, statement);
            const int code = write(r, statement);
            if (code != SQLITE_DONE && code != SQLITE_ROW) database_failed(t.database, r, code, NULL);
        }
        query_free(&q);
    }
    terrain_end(&t);
}

void answer_height(worker *w, request *r) {
    answer_with(w, r, "SELECT :x AS x, :y AS y, :eps AS eps, rqt_height(:x, :y, :eps, :terrain) AS z",
                write_object);
}

void answer_profile(worker *w, request *r) {
    answer_with(w, r, "SELECT * FROM rqt_profile(:line, :eps, :terrain)", write_table);
}

void answer_verify(worker *w, request *r) {
    answer_with(w, r, "SELECT * FROM rqt_verify(:region, :eps, :terrain, :options)", write_object);
}

void answer_explain(worker *w, request *r) {
    answer_with(w, r, "SELECT * FROM rqt_explain(:region, :eps, :terrain, :options)", write_table);
}

void answer_area(worker *w, request *r) {
    answer_with(w, r, "SELECT * FROM rqt_area(:region, :eps, :terrain, :options)", write_object);
}
