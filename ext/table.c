/* table.c - table-valued functions: one virtual table module for all of them.
 *
 * A function's columns come first, its arguments follow as hidden columns in order, then further hidden columns.
 * The planner must be able to give every argument that the call has: where it offers a plan in which one is not
 * known yet (the other table of a join comes later), that plan is refused and it finds another. A call without a
 * required argument is an error with a sentence.
 */
#include "functions.h"

#include <string.h>

#define MOST_ARGUMENTS 5

typedef struct table {
    sqlite3_vtab base;
    connection *connection;
    const function *function;
    int columns; /* visible ones: arguments start here */
    int least, arguments;
} table;

typedef struct cursor {
    sqlite3_vtab_cursor base;
    sqlite3_value *argument[MOST_ARGUMENTS];
    row_set rows;
    size_t row;
} cursor;

typedef struct module_client {
    connection *connection;
    const function *function;
} module_client;

static int count_names(const char *list) {
    if (!list || !*list) return 0;
    int n = 1;
    for (; *list; list++) n += *list == ',';
    return n;
}

/* "region, eps [, terrain]" -> required 2, all 3, and plain "region, eps , terrain" into text. */
static char *plain_arguments(const function *f, int *least, int *most) {
    char *text = sqlite3_mprintf("%s", f->arguments);
    if (!text) return NULL;
    const char *bracket = strchr(text, '[');
    *most = count_names(text);
    *least = *most;
    if (bracket) {
        *least = bracket == text ? 0 : 1;
        for (const char *p = text; p < bracket; p++) *least += *p == ',';
    }
    for (char *p = text; *p; p++)
        if (*p == '[' || *p == ']') *p = ' ';
    return text;
}

/* The name of argument n, as a sentence wants it. */
static char *argument_name(const function *f, int n) {
    int least, most;
    char *text = plain_arguments(f, &least, &most);
    if (!text) return NULL;
    char *start = text;
    while (n-- > 0) start = strchr(start, ',') + 1;
    while (*start == ' ') start++;
    char *name = sqlite3_mprintf("%.*s", (int)strcspn(start, ", "), start);
    sqlite3_free(text);
    return name;
}

static int connect(sqlite3 *db, void *client, int argc, const char *const *argv, sqlite3_vtab **out, char **error) {
    (void)argc, (void)argv, (void)error;
    const module_client *m = client;
    table *t = sqlite3_malloc(sizeof *t);
    if (!t) return SQLITE_NOMEM;
    memset(t, 0, sizeof *t);
    t->connection = m->connection;
    t->function = m->function;
    t->columns = count_names(m->function->returns);
    char *arguments = plain_arguments(m->function, &t->least, &t->arguments);
    sqlite3_str *sql = sqlite3_str_new(db);
    sqlite3_str_appendf(sql, "CREATE TABLE x(%s", m->function->returns);
    const char *lists[2] = {arguments, m->function->hidden};
    for (int l = 0; l < 2; l++)
        for (const char *p = lists[l]; p && *p;) {
            while (*p == ',' || *p == ' ') p++;
            const int n = (int)strcspn(p, ", ");
            if (n > 0) sqlite3_str_appendf(sql, ", %.*s HIDDEN", n, p);
            p += n;
        }
    sqlite3_str_appendall(sql, ")");
    sqlite3_free(arguments);
    char *text = sqlite3_str_finish(sql);
    int code = text && arguments ? sqlite3_declare_vtab(db, text) : SQLITE_NOMEM;
    sqlite3_free(text);
    /* Reads terrains of this database and nothing else, so views on it may be trusted. */
    if (code == SQLITE_OK) code = sqlite3_vtab_config(db, SQLITE_VTAB_INNOCUOUS);
    if (code != SQLITE_OK) {
        sqlite3_free(t);
        return code;
    }
    connection_hold(t->connection); /* the module may go before its tables */
    if (m->function->keeps_statements) connection_owner(t->connection, true);
    *out = &t->base;
    return SQLITE_OK;
}

static int disconnect(sqlite3_vtab *base) {
    table *t = (table *)base;
    if (t->function->keeps_statements) connection_owner(t->connection, false);
    connection_release(t->connection);
    sqlite3_free(t);
    return SQLITE_OK;
}

static int best_index(sqlite3_vtab *base, sqlite3_index_info *info) {
    const table *t = (const table *)base;
    int constraint[MOST_ARGUMENTS], present = 0;
    for (int a = 0; a < MOST_ARGUMENTS; a++) constraint[a] = -1;
    bool unusable = false;
    for (int i = 0; i < info->nConstraint; i++) {
        const int a = info->aConstraint[i].iColumn - t->columns;
        if (a >= t->arguments && info->aConstraint[i].op == SQLITE_INDEX_CONSTRAINT_EQ) {
            /* SQLite hands an argument too many to the next hidden column: without this it would filter rows away.
             */
            sqlite3_free(base->zErrMsg);
            base->zErrMsg =
                sqlite3_mprintf("%s(): too many arguments; use %s(%s). To compare a further hidden column, "
                                "write a + before it",
                                t->function->name, t->function->name, t->function->arguments);
            return SQLITE_ERROR;
        }
        if (a < 0 || a >= t->arguments || info->aConstraint[i].op != SQLITE_INDEX_CONSTRAINT_EQ) continue;
        present |= 1 << a;
        if (!info->aConstraint[i].usable)
            unusable = true;
        else if (constraint[a] < 0)
            constraint[a] = i;
    }
    for (int a = 0; a < t->least; a++) {
        if (present & 1 << a) continue;
        char *name = argument_name(t->function, a);
        sqlite3_free(base->zErrMsg);
        base->zErrMsg = sqlite3_mprintf("%s(): %s is missing; use %s(%s)", t->function->name, name,
                                        t->function->name, t->function->arguments);
        sqlite3_free(name);
        return SQLITE_ERROR;
    }
    if (unusable) return SQLITE_CONSTRAINT;
    /* Which of the hidden columns behind the arguments are asked for, above the bits of the arguments. */
    info->idxNum |= (int)(info->colUsed >> (t->columns + t->arguments) & 0x7FFFFF) << MOST_ARGUMENTS;
    int next = 1;
    for (int a = 0; a < t->arguments; a++) {
        if (constraint[a] < 0) continue;
        info->aConstraintUsage[constraint[a]].argvIndex = next++;
        info->aConstraintUsage[constraint[a]].omit = 1;
        info->idxNum |= 1 << a;
    }
    info->estimatedCost = 1e5;
    info->estimatedRows = t->arguments > 0 ? 10000 : 10;
    return SQLITE_OK;
}

static int open_cursor(sqlite3_vtab *base, sqlite3_vtab_cursor **out) {
    (void)base;
    cursor *c = sqlite3_malloc(sizeof *c);
    if (!c) return SQLITE_NOMEM;
    memset(c, 0, sizeof *c);
    *out = &c->base;
    return SQLITE_OK;
}

static void reset(cursor *c) {
    if (c->rows.release) c->rows.release(c->rows.data);
    memset(&c->rows, 0, sizeof c->rows);
    for (int a = 0; a < MOST_ARGUMENTS; a++) {
        sqlite3_value_free(c->argument[a]);
        c->argument[a] = NULL;
    }
    c->row = 0;
}

static int close_cursor(sqlite3_vtab_cursor *base) {
    reset((cursor *)base);
    sqlite3_free(base);
    return SQLITE_OK;
}

static int filter(sqlite3_vtab_cursor *base, int index, const char *text, int argc, sqlite3_value **argv) {
    (void)text, (void)argc;
    cursor *c = (cursor *)base;
    table *t = (table *)base->pVtab;
    reset(c);
    for (int a = 0, next = 0; a < t->arguments; a++) {
        if (!(index & 1 << a)) continue;
        c->argument[a] = sqlite3_value_dup(argv[next++]);
        if (!c->argument[a]) return SQLITE_NOMEM;
    }
    char *sentence = NULL;
    c->rows.used = (uint32_t)index >> MOST_ARGUMENTS;
    const int code = t->function->fill(t->connection, c->argument, &c->rows, &sentence);
    if (code != SQLITE_OK && sentence) {
        sqlite3_free(base->pVtab->zErrMsg);
        base->pVtab->zErrMsg = sqlite3_mprintf("%s(): %s", t->function->name, sentence);
    }
    sqlite3_free(sentence);
    return code;
}

static int next_row(sqlite3_vtab_cursor *base) {
    ((cursor *)base)->row++;
    return SQLITE_OK;
}

static int at_end(sqlite3_vtab_cursor *base) {
    const cursor *c = (const cursor *)base;
    return c->row >= c->rows.count;
}

static int column(sqlite3_vtab_cursor *base, sqlite3_context *result, int n) {
    cursor *c = (cursor *)base;
    const table *t = (const table *)base->pVtab;
    const int a = n - t->columns;
    if (a < 0)
        c->rows.column(c->rows.data, c->row, n, result);
    else if (a < t->arguments) {
        if (c->argument[a]) sqlite3_result_value(result, c->argument[a]);
    } else {
        c->rows.column(c->rows.data, c->row, n - t->arguments, result);
    }
    return SQLITE_OK;
}

static int row_id(sqlite3_vtab_cursor *base, sqlite3_int64 *id) {
    *id = (sqlite3_int64)((cursor *)base)->row + 1;
    return SQLITE_OK;
}

static void release_client(void *p) {
    module_client *m = p;
    connection_release(m->connection);
    sqlite3_free(m);
}

int table_register(connection *c, const function *f) {
    /* No xCreate: eponymous only, SELECT ... FROM name(arguments). */
    static const sqlite3_module module = {.iVersion = 2,
                                          .xConnect = connect,
                                          .xBestIndex = best_index,
                                          .xDisconnect = disconnect,
                                          .xOpen = open_cursor,
                                          .xClose = close_cursor,
                                          .xFilter = filter,
                                          .xNext = next_row,
                                          .xEof = at_end,
                                          .xColumn = column,
                                          .xRowid = row_id};
    module_client *m = sqlite3_malloc(sizeof *m);
    if (!m) return SQLITE_NOMEM;
    connection_hold(c);
    *m = (module_client){c, f};
    return sqlite3_create_module_v2(connection_db(c), f->name, &module, m, release_client);
}
