/* internal.h - what the files of the store share: the connection's state, sentences, rows of rqt_terrain, blocks.
 */
#ifndef RQT_STORE_INTERNAL_H
#define RQT_STORE_INTERNAL_H

#include "cache.h"
#include "store.h"

#include <stdarg.h>

#define MOST_DATABASES 127 /* of a connection: main, temp, and SQLite's limit of 125 attached ones */

typedef struct statements {
    sqlite3_stmt *answers[2]; /* by rqt_outline */
    sqlite3_stmt *bytes, *summary;
} statements;

/* Summaries by block number, as many as a terrain of 8193 x 8193 has at k = 6; what hits the same place goes. */
#define SUMMARY_PLACES 16384
typedef struct kept_summary {
    uint64_t terrain; /* + 1; 0: nothing is here */
    rqt_block_number number;
    rqt_summary summary;
} kept_summary;

struct store {
    sqlite3 *db;
    store_terrain *terrains; /* count as they are; then each again, as its minimal errors' tables have it */
    statements *statements;  /* one for each of both */
    int count;
    bool known;                         /* terrains are read, and the cache holds only what is theirs */
    uint64_t version;                   /* of all databases, when they were read */
    uint64_t state;                     /* how often that was; store_state */
    sqlite3_stmt *held[MOST_DATABASES]; /* statements that hold a database as it is */
    sqlite3_stmt *probe;                /* asks whether we are interrupted */
    int holders;                        /* calls of store_begin that have not ended */
    block_cache *cache;
    rqt_scratch *scratch;    /* memory that queries hand on */
    kept_summary *summaries; /* SUMMARY_PLACES, from the first use on */
    bool has_summaries;      /* there is something in them */
    rqt_codec *codec;
    struct method_cache *methods; /* what was computed, for one terrain; NULL: nothing */
    size_t method_memory;
    store_limits limits;
};

/* Set *error to a sentence and return code (SQLITE_NOMEM when there is no memory for the sentence). terrain.c */
int store_fail(char **error, int code, const char *format, ...);
/* The same out of the connection's last error: "doing: what SQLite says". */
int store_fail_db(char **error, sqlite3 *db, int code, const char *doing);
/* A sentence for a status of the core. store.c */
int store_fail_core(char **error, rqt_status status, const char *doing);

/* All terrains of all databases of the connection. terrain.c */
int store_read_terrains(sqlite3 *db, store_terrain **terrains, int *count, char **error);
/* A new row with complete = 0. terrain.c */
int store_insert_terrain(sqlite3 *db, const store_terrain *t, int64_t *id, char **error);

#define STORE_NEVER 65536 /* FORMAT.md, "Tables": both ends of an index row's interval that no eps meets */

/* store_begin, and the state is still the one in which store_find found the terrain. store.c */
int store_begin_on(store *s, const store_terrain *t, char **error);
sqlite3 *store_connection(const store *s);
/* The prepared statements of a terrain that store_find found. store.c */
statements *store_statements(store *s, const store_terrain *t);
/* Prepare sql (released here; NULL is out of memory) to be kept in *out. store.c */
int store_prepare(store *s, const store_terrain *t, sqlite3_stmt **out, char *sql, char **error);

/* The bytes of a block; valid until its statement is reset. blocks.c */
int store_block_bytes(store *s, const store_terrain *t, rqt_block_number number, const uint8_t **bytes, int *size,
                      char **error);
/* The summary of one block, kept. Valid until the next call. blocks.c */
int store_get_summary(store *s, const store_terrain *t, rqt_block_number number, const rqt_summary **summary,
                      char **error);
/* The decoded block, from the cache or the database. *read: bytes read now, 0 when it was cached. blocks.c */
int store_get_block(store *s, const store_terrain *t, rqt_block_number number, const rqt_block **block, int *read,
                    char **error);

/* A query when its eps is a code. */
typedef struct store_question {
    const rqt_region *region;
    rqt_code eps;
    const store_query_options *options;
    size_t most; /* vertices: with more, stop and say over; 0: any number */
    bool over;
    bool too_large; /* more than the store's limits allow: stopped likewise */
} store_question;
/* Is the patch more than the question wants, or than the store's limits allow? It is noted which. query.c */
bool store_is_enough(const store *s, store_question *question, const rqt_patch *patch);
/* From the tables of t (metric is not looked at). query.c */
int store_query_tables(store *s, const store_terrain *t, store_question *question, rqt_patch *patch,
                       store_reads *reads, char **error);
/* From errors in memory, computed first if need be. *largest, when not NULL: the largest finite code. methods.c */
int store_query_computed(store *s, const store_terrain *t, store_question *question, rqt_patch *patch,
                         store_reads *reads, rqt_code *largest, char **error);
void store_methods_free(store *s);
/* A row per answer of a query, as its summary has it, or its number alone. query.c */
int store_begin_reads(const rqt_query *query, bool only_numbers, store_reads *reads);
int64_t store_count_selected(const rqt_query *query, rqt_block_number number, const rqt_block *block);

#define STORE_MINIMAL "_minimal" /* suffix of the tables that hold minimal errors */
/* A writer of those tables, beside a terrain of main that is complete. writer.c */
int store_writer_beside(sqlite3 *db, const store_terrain *t, store_writer **writer, char **error);
/* The row of a block in the index, bound to ?1 .. ?9. Does it answer anything? Else it has no row. writer.c */
bool store_bind_index(sqlite3_stmt *s, const rqt_lattice *lattice, const rqt_block_place *place,
                      rqt_block_number number, const rqt_summary *summary);
/* Changes to a terrain of main that is there. amend.c */
typedef struct store_amender store_amender;
int store_amend_begin(sqlite3 *db, const store_terrain *t, store_amender **amender, char **error);
/* Another summary, and other bytes unless NULL, for a block; its row in the index likewise. */
int store_amend_block(store_amender *a, rqt_block_number number, const rqt_summary *before,
                      const rqt_summary *after, const uint8_t *bytes, size_t size, char **error);
/* Samples of a window that are not kept are no longer filled ones (rqt_fill_N, where there is one). */
int store_amend_filled(store_amender *a, int32_t col, int32_t row, int32_t width, int32_t height,
                       const uint8_t *state, char **error);
/* The terrain's row, when all changes are made. */
int store_amend_terrain(store_amender *a, const rqt_statistics *statistics, const char *source, char **error);
void store_amend_free(store_amender *a);
/* The tables of its minimal errors, which are there. */
int store_drop_minimal(sqlite3 *db, int64_t id, char **error);
/* |f|/d: metres of a height quantum. terrain.c */
double store_quantum(const store_terrain *t);
/* Forget what is kept of a block that has changed. blocks.c */
void store_forget_block(store *s, const store_terrain *t, rqt_block_number number);
/* The pyramid over a metric's errors, computed now if need be; valid until the store forgets. methods.c */
int store_take_pyramid(store *s, const store_terrain *t, rqt_metric metric, rqt_outline outline,
                       const rqt_pyramid **pyramid, char **error);
/* What rqt_check finds of the minimal errors of a terrain, as store_check. minimal.c */
int store_check_minimal(store *s, const store_terrain *t, bool (*tell)(void *context, const store_finding *finding),
                        void *context, char **error);
/* Does it have the table of what was filled? The same check of that. fill.c */
bool store_has_fill(sqlite3 *db, const store_terrain *t);
int store_check_fill(store *s, const store_terrain *t, bool (*tell)(void *context, const store_finding *finding),
                     void *context, char **error);
/* The terrain as the tables of its minimal errors have it; NULL when it has none. minimal.c */
const store_terrain *store_minimal(store *s, const store_terrain *t);

#endif
