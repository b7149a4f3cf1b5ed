/* functions.h - how an SQL function is described, and what all of them share.
 *
 * functions.c holds the table: name, arguments, purity with its reason, one line of documentation, an example. The
 * registration, rqt_help and the reference (ext/SQL.md) come from it, and the tests run every example.
 */
#ifndef RQT_FUNCTIONS_H
#define RQT_FUNCTIONS_H

#include "store.h"

/* -------------------------------------------------------------------------------------- one connection */
typedef struct connection connection;

sqlite3 *connection_db(const connection *c);
/* The store, ready for use. Pair with connection_done, which lets go of what could keep the database from closing.
 */
int connection_store(connection *c, store **s, char **error);
void connection_done(connection *c);
/* Places of a table that the connection keeps for the next request, NULL: none. Counted; detail.c knows what they
 * hold and how long they are true. */
typedef struct places places;
places **connection_places(connection *c);
void places_release(places *p); /* NULL is fine */
/* The last views that this connection has answered; follow.c. NULL: none. */
typedef struct known_views known_views;
known_views **connection_views(connection *c);
void known_views_free(known_views *views); /* NULL is fine */

/* ------------------------------------------------------------------------------------------- functions */
/* The rows of one call of a table-valued function. */
typedef struct row_set {
    size_t count;
    void *data;
    void (*column)(void *data, size_t row, int column, sqlite3_context *result);
    void (*release)(void *data); /* may be NULL */
    uint32_t used;               /* told to fill: bit n, the query uses the nth of the further hidden columns */
} row_set;

/* Fill rows from the arguments (missing optional ones are NULL pointers); on failure *error is a sentence without
 * the function's name. */
typedef int fill_rows(connection *c, sqlite3_value **arguments, row_set *rows, char **error);

typedef void scalar_call(sqlite3_context *result, int count, sqlite3_value **arguments);

typedef struct function {
    const char *name;
    const char *arguments; /* "region, eps [, terrain [, options]]" */
    const char *returns;   /* what a scalar gives; the columns of a table */
    const char *purpose;   /* one line */
    const char *example;   /* SQL that runs in the demo database */
    /* scalars */
    scalar_call *call;
    int least, most; /* arguments */
    int flags;       /* SQLITE_DETERMINISTIC, SQLITE_INNOCUOUS, SQLITE_DIRECTONLY */
    /* tables */
    fill_rows *fill;
    const char *hidden;    /* further columns that exist but do not show in SELECT * */
    bool keeps_statements; /* the table that owns the connection's prepared statements */
} function;

extern const function rqt_functions[];
extern const int rqt_function_count;

/* Register a table-valued function. table.c */
int table_register(connection *c, const function *f);
/* Put "name(): sentence" (or what code says) as the result of a scalar, and release the sentence. scalar.c */
void scalar_error(sqlite3_context *result, const char *name, int code, char *sentence);
/* connection.c */
connection *connection_create(sqlite3 *db);
void connection_hold(connection *c);
void connection_release(void *c);
void connection_owner(connection *c, bool owned);

/* -------------------------------------------------------------------------------- requests for a patch */
/* What happens at the region's border, as DESIGN has it. */
typedef enum request_mode { REQUEST_COVER, REQUEST_SNAP, REQUEST_BORDER, REQUEST_CUT } request_mode;

/* region, eps, terrain, options, as every mesh function takes them. request.c */
typedef enum frame_kind { FRAME_CRS, FRAME_ECEF, FRAME_ENU } frame_kind; /* in the order of options.c */
typedef struct space_frame space_frame;
typedef struct view view;                                          /* view.h */
typedef enum view_cover { VIEW_PICTURE, VIEW_TERRAIN } view_cover; /* in the order of options.c */
typedef struct request {
    connection *connection; /* held while the request lives */
    store *store;
    const store_terrain *terrain;
    rqt_geometry *geometry;
    rqt_region *region; /* mode snap: grown to its squares */
    request_mode mode;
    double eps;
    store_query_options options;
    struct cJSON *detail;  /* the option, as it came; NULL: none */
    places *places;        /* what it says; detail.c */
    frame_kind frame_kind; /* where the mesh is drawn */
    space_frame *frame;    /* NULL for FRAME_CRS; frame.c */
    bool fans;             /* the strip goes round the centres of blocks */
    int64_t max_vertices;  /* 0: any number */
    int64_t max_triangles; /* of a view; 0: any number */
    char *previous;        /* of a view: "", or the token of the last answer; NULL: there is no next one */
    rqt_view_test test;    /* of a view */
    view_cover cover;      /* of a view: what the answer covers */
    bool has_test, has_cover, has_metric; /* the options name one */
    double achieved_eps; /* of the mesh: eps, or more to keep within max_vertices; known after request_patch */
    view *
        view; /* NULL, or the view that is asked for: then the region is what its cover says, and eps is infinite */
} request;

/* `usual` is the mode when the options name none. */
int request_read(connection *c, sqlite3_value *region, sqlite3_value *eps, sqlite3_value *terrain,
                 sqlite3_value *options, request_mode usual, request *out, char **error);
/* The same from a camera: a view. */
int request_read_view(connection *c, sqlite3_value *camera, sqlite3_value *terrain, sqlite3_value *options,
                      request *out, char **error);
/* The same for what wants more of the last answer (option previous) than that it may be this one: an increment from
 * it, when what selects is not needed where nothing changes, or its mesh. follow.c */
typedef enum view_wants { VIEW_ANSWER, VIEW_INCREMENT, VIEW_MORPH } view_wants;
int request_follow_view(connection *c, sqlite3_value *camera, sqlite3_value *terrain, sqlite3_value *options,
                        view_wants wants, request *out, char **error);
/* What selects for the view as it is now: field, region, rule, frame; instead of what did. */
int request_select_view(request *r, char **error);
/* A patch with what the product needs; of strips, the one that the options want. Give it back with store_keep. */
int request_patch(request *r, rqt_product product, rqt_patch *patch, store_reads *reads, char **error);
/* Mode cut: that patch clipped to the region, instead. Release with rqt_cut_free. cut.c */
int request_cut(request *r, rqt_cut *cut, char **error);
/* SQLITE_OK in any other mode; else a sentence that what is asked for cannot hold the answer. cut.c */
int request_refuse_cut(const request *r, const char *what, char **error);
/* What is told of a mesh as a whole, whatever it comes as: columns vertices, triangles, achieved_eps; of a view
 * vertices, triangles, achieved_tau, guaranteed, token. answer_tables.c */
typedef struct mesh_told {
    bool is_view;
    uint64_t vertices, triangles;
    double achieved; /* eps, or a view's tau */
    bool guaranteed; /* of a view */
    char *token;     /* of a view with option previous, to be released with sqlite3_free; else NULL */
} mesh_told;
/* Of the answer whose patch this is, before its places become one in a frame. NULL, of a cut and of a view that is
 * unchanged: the counts are the caller's. */
int request_tell(request *r, const rqt_patch *patch, mesh_told *told, char **error);
int told_columns(bool is_view);
void put_told(const mesh_told *told, int column, sqlite3_context *result);
/* The patch in wire format, with normals and errors or without. delta.c */
int wire_mesh(request *r, bool normals, bool errors, mesh_told *told, uint8_t **bytes, size_t *size, char **error);
/* A mesh as the bytes of a file. */
typedef struct mesh_bytes {
    uint8_t *bytes; /* to be released with sqlite3_free */
    size_t size;
    bool is_text; /* UTF-8 */
    mesh_told told;
} mesh_bytes;
/* Of region, eps or camera; format; terrain and options, NULL where they are missing: what rqt_mesh and
 * rqt_view_mesh answer. On failure there is nothing to be released. scalar.c */
int mesh_bytes_make(connection *c, bool is_view, sqlite3_value **arguments, mesh_bytes *out, char **error);
void request_free(request *r);
/* A geometry of the request as a region; `what` it is, for sentences. On a terrain in degrees it is one on every
 * turn that meets the terrain, for longitudes are the same modulo 360: the geometry gets more members. */
int request_region(const request *r, rqt_geometry *geometry, const char *what, rqt_region **region, char **error);
/* The rule of what the options detail and mode want, when terrain and region are known. detail.c */
int rule_read(request *r, char **error);
void rule_free(request *r);
/* The request's eps, or the least of its places' when that is less. */
double rule_least_eps(const request *r);
/* Of the coordinates that the answer has: the terrain's, 4978 for geocentric ones, 0 for local ones. */
int32_t request_srid(const request *r);
/* What the option frame wants, when all else is known: the rule is given what curvature takes. frame.c */
int frame_read(request *r, char **error);
void frame_free(space_frame *f);
/* Vertices of the patch that are one in space become one; without a frame, or where there are none, nothing
 * changes.
 */
int frame_merge(const space_frame *f, rqt_patch *patch);
/* x,y,z of each vertex of the patch, to be released with sqlite3_free, also when it fails. */
int frame_places(const space_frame *f, const rqt_patch *patch, double **xyz, char **error);
/* Longitude, latitude and height of 0,0,0 of frame enu. */
const double *frame_zero(const space_frame *f);
/* The terrain's name and what the coordinates are, a line. */
const char *frame_title(const space_frame *f);
/* The terrain that a value names; NULL value: the only one. */
int request_terrain(store *s, sqlite3_value *name, const store_terrain **terrain, char **error);
/* A geometry (NULL value: none) in the terrain's coordinates, transformed if need be; `what` names it in sentences.
 * Release with rqt_geometry_free. geometry.c */
int request_geometry(connection *c, const store_terrain *t, sqlite3_value *value, const char *what,
                     rqt_geometry **geometry, char **error);
/* The same of n bytes of text or of a BLOB. *transformed (may be NULL) becomes true when it was, else stays. */
int request_geometry_bytes(connection *c, const store_terrain *t, const void *bytes, size_t n, bool text,
                           const char *what, rqt_geometry **geometry, bool *transformed, char **error);
/* "what must be a number ...": false and a sentence when the value is none, or NaN. */
bool request_number(sqlite3_value *value, const char *what, double *number, char **error);
/* The lines of a geometry (points are lines of one point), for functions that want a line: line i has counts[i]
 * points of x,y, one line after the other. SQLITE_ERROR for NULL, an empty geometry and polygons. */
typedef struct line_set {
    double *xy;
    size_t *counts;
    size_t count, points;
    int32_t srid;
} line_set;
/* t: the terrain whose coordinates they are to have; NULL: as they come. lines.c */
int lines_read(connection *c, const store_terrain *t, sqlite3_value *value, line_set *lines, char **error);
void lines_free(line_set *lines);
/* Metres in a unit of a terrain's x and y, where they are no angles; 1 when its CRS does not say. */
double terrain_metre(const store_terrain *t);
/* Are its heights above EGM96, as far as its source says? frame.c */
bool terrain_is_above_geoid(const store_terrain *t);
/* Options of the contract; sentences name what is unknown and what is not in this version. options.c */
int options_read(const char *json, request *r, char **error);

/* A sentence into *error; returns SQLITE_ERROR, or SQLITE_NOMEM. */
int fail(char **error, const char *format, ...);

/* The functions themselves, by file. */
fill_rows fill_range, fill_triangles, fill_strip;                          /* mesh_tables.c */
fill_rows fill_view, fill_view_triangles, fill_view_strip;                 /* mesh_tables.c */
fill_rows fill_answer, fill_view_answer;                                   /* answer_tables.c */
fill_rows fill_profile, fill_area;                                         /* profile.c, area.c */
fill_rows fill_view_explain;                                               /* insight_tables.c */
fill_rows fill_terrains, fill_explain, fill_verify, fill_check, fill_help; /* insight_tables.c, verify_table.c */
fill_rows fill_view_verify;                                                /* view_verify.c */
scalar_call call_version, call_build_info, call_mesh, call_view_mesh, call_height; /* scalar.c */
scalar_call call_block_info, call_block_check, call_block_dump;                    /* block_functions.c */
scalar_call call_bbox, call_circle, call_corridor;                                 /* shapes.c */
scalar_call call_delta;                                                            /* delta.c */
scalar_call call_limit;                                                            /* limit.c */

#endif
