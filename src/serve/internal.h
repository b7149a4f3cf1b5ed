/* internal.h - what the files of the query service share.
 *
 *   serve.c      its life: socket, signals, the end
 *   http.c       libmicrohttpd's callbacks: a request is read, handed to a worker, its answer sent; slow clients
 *   target.c     the request's target, strictly read: path, parameters
 *   pool.c       the workers and their queue
 *   database.c   a worker's connection to a database: opened anew when the file is another, its state, its limits
 *   endpoints.c  the table of paths, and what they have in common
 *   query.c      parameters as what SQL statements are bound to
 *   meshes.c     range, view, delta
 *   tables.c     height, profile, verify, explain, area
 *   tiles.c      tiles for globes and maps
 *   documents.c  landing page, conformance, collections
 *   page.c       the files of web/, compiled in, gzipped
 *   answer.c     bytes, problems (RFC 9457), rows as JSON
 *   negotiate.c  Accept, Accept-Encoding, If-None-Match; compression
 *   metrics.c    what /metrics tells
 *
 * Everything from outside is text with a length until target.c has read it, and is only ever bound to statements.
 */
#ifndef RQT_SERVE_INTERNAL_H
#define RQT_SERVE_INTERNAL_H

#include "serve.h"
#include "tiles.h"

#include <cjson/cJSON.h>
#include <microhttpd.h>
#include <sqlite3.h>
#include <sys/stat.h>

/* ------------------------------------------------------------------------------------------ bytes (answer.c) -- */
/* Grows as it is added to, up to `most`; beyond, and without memory, it says so and takes no more. */
typedef struct buffer {
    char *bytes; /* malloc */
    size_t size, capacity, most;
    bool is_over, no_memory;
} buffer;

void buffer_add(buffer *b, const void *bytes, size_t size);
void buffer_text(buffer *b, const char *text);
void buffer_format(buffer *b, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* A number of JSON, the shortest that reads back equal; null for what is not finite. */
void buffer_number(buffer *b, double value);
/* A text; bytes that are no UTF-8, as a damaged database may have them, become U+FFFD. */
void buffer_utf8(buffer *b, const char *text);
/* A text of JSON. */
void buffer_string(buffer *b, const char *text);
void buffer_free(buffer *b);

/* ------------------------------------------------------------------------------------------------- requests -- */
enum { MOST_SEGMENTS = 8, MOST_PARAMETERS = 32, MOST_TARGET = 32768 };
/* For MHD: a connection's memory holds target and headers twice over. */
enum { CONNECTION_MEMORY = 131072 };

typedef struct parameter {
    const char *name, *value; /* UTF-8 without NUL */
} parameter;

/* What is told of a mesh in headers, beside its bytes. answer.c */
enum { TOLD_HEADERS = 6, TOLD_BYTES = 448 /* a token has 422 */ };
extern const char *const told_headers[TOLD_HEADERS];

typedef enum coding { CODING_IDENTITY, CODING_GZIP, CODING_ZSTD } coding;

typedef struct answer {
    unsigned status;
    const char *type; /* of the content, static */
    buffer body;
    char etag[80];      /* quoted; "": none */
    const char *varies; /* header Vary, static; NULL: on nothing */
    coding coding;
    bool is_gzipped;                     /* of gzip the body is there already, compressed */
    const char *retry;                   /* Retry-After; NULL: none */
    bool is_page;                        /* HTML: tell the browser what it may load */
    bool is_lasting;                     /* may be kept as --max-age says; else by nobody */
    char told[TOLD_HEADERS][TOLD_BYTES]; /* "": not told */
} answer;

typedef struct endpoint endpoint;
typedef struct service service;

typedef struct request {
    service *service;
    struct MHD_Connection *connection;
    struct request *next; /* in the queue */
    char *target;         /* as received */
    char *decoded;        /* what segments and parameters point into */
    const char *segments[MOST_SEGMENTS];
    int segment_count;
    parameter parameters[MOST_PARAMETERS];
    int parameter_count;
    const char *method, *accept, *accept_encoding, *if_none_match; /* NULL: none */
    const endpoint *endpoint;                                      /* NULL: no such path */
    const char *terrain;                                           /* of the path */
    double received;                                               /* seconds, monotonic */
    bool has_body;
    bool is_asked; /* counted as such */
    size_t held;   /* bytes of its answer on their way, counted too */
    answer answer;
    enum { REQUEST_NEW, REQUEST_READ, REQUEST_ASKED, REQUEST_ANSWERED, REQUEST_SENT } phase;
} request;

/* The value of a parameter, NULL when it is not given. */
const char *request_parameter(const request *r, const char *name);

/* Bytes of the UTF-8 character at p, before an end mark; 0: it is overlong, a surrogate or cut off. target.c */
int utf8_bytes(const unsigned char *p);

/* Path and parameters out of r->target. False: what is wrong is the answer. target.c */
bool target_read(request *r);

/* ------------------------------------------------------------------------------------- answers (answer.c) -- */
/* No answer yet. */
void answer_clear(request *r);
/* Instead of what the answer has so far: application/problem+json, with a sentence. */
void answer_problem(request *r, unsigned status, const char *format, ...) __attribute__((format(printf, 3, 4)));
/* The same for a code of SQLite and what it says. */
void answer_failure(request *r, int code, const char *sentence);
/* A cJSON object, which it releases, as the whole answer. NULL: no memory. */
void answer_json(request *r, const char *type, cJSON *json);
/* A column as a value of JSON; the row's columns from..to-1 as members of a JSON array: numbers and texts. */
void answer_value(buffer *b, sqlite3_stmt *row, int column);
void answer_row(buffer *b, sqlite3_stmt *row, int from, int to);
/* The row's columns from .. that tell of a mesh, into headers. */
void answer_tell(request *r, sqlite3_stmt *row, int from);
const char *status_title(unsigned status);

/* ---------------------------------------------------------------------------------- negotiation (negotiate.c) --
 */
/* Which of `count` media types the client likes best, the first when it does not say; -1: none. */
int negotiate_type(const char *accept, const char *const *types, int count);
/* Of equal ones the one that is liked: gzip or zstd. False: the client takes none of ours. */
bool negotiate_coding(const char *accept_encoding, coding liked, coding *coding);
const char *coding_name(coding c);
bool etag_matches(const char *if_none_match, const char *etag);
/* The answer's body as its coding says; small ones are left as they are. */
void answer_compress(request *r);

/* ---------------------------------------------------------------------------------- databases (database.c) -- */
typedef struct database database;
typedef struct worker worker;

/* A read transaction on the file that is there now. False: why is the request's answer. *state is another one after
 * every commit and for every other file, and the same for all workers; 0: not known. */
bool database_begin(database *d, request *r, uint64_t *state);
void database_end(database *d);
/* A statement of this text (static), ready to be bound; kept for the next time. NULL: the answer says why. */
sqlite3_stmt *database_prepare(database *d, request *r, const char *sql);
sqlite3 *database_handle(database *d);
/* Its tiles; NULL: the answer says why. */
tiles *database_tiles(database *d, request *r);
/* Something has failed with this code; sentence NULL: what the connection says of it. It becomes the answer. A
 * connection that met damage is closed with database_end, and so is one without memory, whose blocks then go. */
void database_failed(database *d, request *r, int code, const char *sentence);
/* The file's name without its folder. */
const char *database_label(const database *d);
/* count connections, none open yet. */
database *databases_create(const service *s);
database *databases_at(database *all, int i);
void databases_free(database *all, int count);
/* Until when the statements of these may run. */
void databases_deadline(database *all, int count, double deadline);

/* ------------------------------------------------------------------------------------------ workers (pool.c) -- */
struct worker {
    service *service;
    database *databases;
    int database_count;
};
typedef struct pool pool;
pool *pool_create(service *s, int workers, int queue);
/* False when the queue is full. Resumes the request's connection when it is answered. */
bool pool_ask(pool *p, request *r);
void pool_load(pool *p, int *waiting, int *working);
/* What still runs is told to stop (503). */
void pool_hurry(pool *p);
bool pool_is_hurried(const pool *p);
/* When nothing waits or works any more. */
void pool_free(pool *p);

/* --------------------------------------------------------------------------------------------------- endpoints --
 */
struct endpoint {
    const char *name; /* for /metrics */
    const char *path; /* "/collections/{terrain}/range" */
    /* What may be given, between blanks; "!" behind a name: must be. */
    const char *parameters;
    void (*answer)(worker *w, request *r);
    bool is_direct; /* asks no database: answered at once */
};
extern const endpoint endpoints[];
extern const int endpoint_count;
/* The endpoint of the path, which is checked with its parameters; false: what is wrong is the answer. */
bool endpoint_find(request *r);
/* What a worker does. */
void endpoint_answer(worker *w, request *r);
/* Sets type, coding, Vary and ETag. `packed`: not to be compressed. False: it is answered already, 304 or 406. */
bool endpoint_represent(request *r, uint64_t state, const char *type, bool packed, bool by_accept);

/* The terrain of the path, in the transaction of its database that it begins. False: why is the answer. */
typedef struct terrain {
    database *database;
    uint64_t state;
    int32_t srid;
} terrain;
bool terrain_begin(worker *w, request *r, terrain *t);
void terrain_end(terrain *t);

/* Parameters, ready to be bound by name to a statement. query.c */
typedef struct query {
    const request *request;
    char *options;      /* JSON; NULL: none */
    const char *region; /* as text; NULL: everything */
    void *box;          /* of a box: the geometry; NULL: none. Its text is outline */
    int size;           /* bytes of box */
    char outline[288];  /* ten numbers of 24 characters */
    const char *format; /* as SQL has it */
} query;
/* False: what is wrong is the answer. */
bool query_read(request *r, const terrain *t, query *q);
/* :region :eps :eps_from :eps_to :x :y :line :camera :format :terrain :options, those that the statement has. */
void query_bind(const query *q, sqlite3_stmt *statement);
void query_free(query *q);
/* The whole text as a number of JSON, or 9e999 and the like. */
bool number_read(const char *text, double *value);
/* Names of options that may be given on their own, between blanks: of regions, and those that views have besides.
 */
#define OPTION_NAMES "options mode outline metric select strip detail max_vertices frame "
#define VIEW_OPTION_NAMES OPTION_NAMES "max_triangles test cover previous "

void answer_landing(worker *w, request *r);
void answer_openapi(worker *w, request *r);
void answer_conformance(worker *w, request *r);
void answer_collections(worker *w, request *r);
void answer_collection(worker *w, request *r);
void answer_range(worker *w, request *r);
void answer_view(worker *w, request *r);
void answer_delta(worker *w, request *r);
void answer_height(worker *w, request *r);
void answer_profile(worker *w, request *r);
void answer_verify(worker *w, request *r);
void answer_explain(worker *w, request *r);
void answer_area(worker *w, request *r);
void answer_tile_document(worker *w, request *r);
void answer_tile(worker *w, request *r);
void answer_cesium(worker *w, request *r);
void answer_health(worker *w, request *r);
void answer_metrics(worker *w, request *r);

/* ------------------------------------------------------------------------------------------------- page.c -- */
/* Is the path one of the page's files? And the file of this name, which is one, as the answer. */
bool page_is(const request *r);
void page_answer(request *r, const char *name);

/* ---------------------------------------------------------------------------------------------- metrics.c -- */
typedef struct metrics metrics;
metrics *metrics_create(void);
void metrics_free(metrics *m);
void metrics_count(metrics *m, const request *r, double seconds, uint64_t bytes);

/* ------------------------------------------------------------------------------------------------ the whole -- */
typedef struct peers peers;
struct service {
    serve_options options;
    pool *pool;
    metrics *metrics;
    peers *peers;
    struct MHD_Daemon *daemon;
};
double now_seconds(void);
/* http.c */
bool http_begin(service *s, int listening, char *why, size_t size);
/* How many connections there are, and requests under way. */
void http_count(service *s, int *connections, int *requests);
/* Closes what has been slow for too long. */
void http_sweep(service *s);
/* No new connections, and the ones there are end with their next answer. */
void http_quiesce(service *s);
/* True when no request is under way (late: none whose connection is suspended, with which the library cannot stop),
 * and from then on none is asked. */
bool http_shut(service *s, bool late);
void http_end(service *s);

#endif
