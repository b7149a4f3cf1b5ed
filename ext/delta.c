/* delta.c - meshes in wire format: rqt_mesh(..., 'rqt'), normals and errors beside them, and rqt_delta. The bytes
 * are src/core/FORMAT.md, "Wire". */
#include "functions.h"

#include <string.h>

/* A patch with leaves and the blocks that it came from. */
typedef struct answer {
    rqt_patch patch;
    store_reads reads;
} answer;

static int answer_read(request *r, double eps, answer *out, char **error) {
    memset(out, 0, sizeof *out);
    r->options.product = RQT_PRODUCT_TRIANGLES;
    r->options.wants_leaves = true;
    r->options.only_numbers = true;
    if (r->max_vertices == 0)
        return store_query(r->store, r->terrain, r->region, eps, &r->options, &out->patch, &out->reads, error);
    return store_query_within(r->store, r->terrain, r->region, eps, &r->options, r->max_vertices, &r->achieved_eps,
                              &out->patch, &out->reads, error);
}

static void answer_free(answer *a) {
    rqt_patch_free(&a->patch);
    store_reads_free(&a->reads);
}

static int too_large(char **error) {
    return fail(error, "the mesh is larger than 2 GiB; ask for less or a larger eps");
}

/* state NULL: the mesh; else the increment from it. */
static int encode(const request *r, double eps, double eps_from, const answer *a, const rqt_patch *state,
                  uint8_t **bytes, size_t *size, char **error) {
    const store_terrain *t = r->terrain;
    const rqt_wire_header header = {.lattice = t->lattice,
                                    .k = t->k,
                                    .placement = t->placement,
                                    .unit = t->unit,
                                    .eps = eps,
                                    .srid = t->srid,
                                    .eps_from = eps_from};
    const size_t count = a->reads.count;
    rqt_block_number *numbers = sqlite3_malloc64((count + 1) * sizeof *numbers);
    *bytes = sqlite3_malloc64(rqt_wire_bound(a->patch.vertex_count, a->patch.triangle_count, count));
    rqt_status status = RQT_NO_MEMORY;
    if (numbers && *bytes) {
        for (size_t i = 0; i < count; i++) numbers[i] = a->reads.rows[i].number;
        status = rqt_wire_encode(&header, numbers, count, &a->patch, state, store_allocator(), *bytes, size);
    }
    sqlite3_free(numbers);
    int code = status == RQT_OK ? SQLITE_OK : SQLITE_NOMEM;
    if (status == RQT_INVALID)
        code = fail(error, "terrain %s is damaged: its blocks do not agree on one mesh; see rqt_check", t->name);
    else if (status == RQT_OK && *size > INT32_MAX)
        code = too_large(error);
    if (code == SQLITE_OK) {
        uint8_t *fitting = sqlite3_realloc64(*bytes, *size);
        if (fitting) *bytes = fitting;
    } else {
        sqlite3_free(*bytes);
        *bytes = NULL;
    }
    return code;
}

/* The normals of the patch behind its mesh. */
static int add_normals(const request *r, const rqt_patch *patch, uint8_t **bytes, size_t *size, char **error) {
    const size_t count = patch->vertex_count;
    float *normals;
    const int code = store_normals(r->store, r->terrain, patch, &normals, error);
    if (code != SQLITE_OK) return code;
    uint8_t *longer = sqlite3_realloc64(*bytes, *size + rqt_wire_normals_bound(count));
    if (longer) *bytes = longer;
    const rqt_status status =
        longer ? rqt_wire_add_normals(normals, count, store_allocator(), *bytes, size) : RQT_NO_MEMORY;
    sqlite3_free(normals);
    if (status != RQT_OK) return SQLITE_NOMEM;
    return *size > INT32_MAX ? too_large(error) : SQLITE_OK;
}

/* The errors of the patch behind its mesh, and behind its normals if these are there. */
static int add_errors(const rqt_patch *patch, uint8_t **bytes, size_t *size, char **error) {
    uint8_t *longer = sqlite3_realloc64(*bytes, *size + rqt_wire_errors_bound(patch->vertex_count));
    if (longer) *bytes = longer;
    if (!longer || rqt_wire_add_errors(patch, store_allocator(), *bytes, size) != RQT_OK) return SQLITE_NOMEM;
    return *size > INT32_MAX ? too_large(error) : SQLITE_OK;
}

int wire_mesh(request *r, bool normals, bool errors, mesh_told *told, uint8_t **bytes, size_t *size, char **error) {
    answer a = {{0}, {0}};
    int code = store_begin(r->store, error); /* mesh and normals of one state of the database */
    if (code != SQLITE_OK) return code;
    code = answer_read(r, r->eps, &a, error);
    if (code == SQLITE_OK) code = encode(r, r->achieved_eps, 0, &a, NULL, bytes, size, error);
    if (code == SQLITE_OK) code = request_tell(r, &a.patch, told, error);
    if (code == SQLITE_OK && normals) code = add_normals(r, &a.patch, bytes, size, error);
    if (code == SQLITE_OK && errors) code = add_errors(&a.patch, bytes, size, error);
    store_end(r->store);
    if (code != SQLITE_OK) {
        sqlite3_free(*bytes);
        *bytes = NULL;
    }
    answer_free(&a);
    return code;
}

static int increment(request *r, double from, uint8_t **bytes, size_t *size, char **error) {
    answer before = {{0}, {0}}, after = {{0}, {0}};
    int code = store_begin(r->store, error); /* both meshes of one state of the database */
    if (code != SQLITE_OK) return code;
    code = answer_read(r, from, &before, error);
    store_reads_free(&before.reads);
    if (code == SQLITE_OK) code = answer_read(r, r->eps, &after, error);
    store_end(r->store);
    if (code == SQLITE_OK) code = encode(r, r->eps, from, &after, &before.patch, bytes, size, error);
    answer_free(&before);
    answer_free(&after);
    return code;
}

void call_delta(sqlite3_context *result, int count, sqlite3_value **arguments) {
    connection *c = sqlite3_user_data(result);
    char *error = NULL;
    double from = 0, to = 0;
    request r = {0};
    uint8_t *bytes = NULL;
    size_t size = 0;
    int code = SQLITE_OK;
    if (!request_number(arguments[1], "eps_from", &from, &error) ||
        !request_number(arguments[2], "eps_to", &to, &error))
        code = error ? SQLITE_ERROR : SQLITE_NOMEM;
    else if (to < 0)
        code = fail(&error, "eps_to must be 0 or more; it is %!.15g", to);
    else if (from < to)
        code = fail(&error, "eps_from must not be less than eps_to; it is %!.15g", from);
    if (code == SQLITE_OK)
        code = request_read(c, arguments[0], arguments[2], count > 3 ? arguments[3] : NULL, NULL, REQUEST_COVER, &r,
                            &error);
    if (code == SQLITE_OK) code = increment(&r, from, &bytes, &size, &error);
    request_free(&r);
    if (code != SQLITE_OK)
        scalar_error(result, "rqt_delta", code, error);
    else
        sqlite3_result_blob64(result, bytes, size, sqlite3_free);
}
