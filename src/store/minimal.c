#include "internal.h"
const store_terrain *store_minimal(store *s, const store_terrain *t) {
    const int n = (int)(t - s->terrains);
    if (n >= s->count) return NULL;
    char table[64];
    sqlite3_snprintf(sizeof table, table, "rqt_block_%lld%s", t->id, STORE_MINIMAL);
    if (sqlite3_table_column_metadata(s->db, t->schema, table, "data", NULL, NULL, NULL, NULL, NULL) != SQLITE_OK)
        return NULL;
    return &s->terrains[s->count + n];
}
