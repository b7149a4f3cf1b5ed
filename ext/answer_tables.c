/* answer_tables.c - rqt_answer and rqt_view_answer: a mesh as the bytes that rqt_mesh and rqt_view_mesh give, and
 * beside it, in the same row, what rows of a mesh tell of the whole of it. So a caller who wants bytes has to ask
 * only once.
 */
#include "view.h"

int request_tell(request *r, const rqt_patch *patch, mesh_told *told, char **error) {
    const view *v = r->view;
    *told = (mesh_told){
        .is_view = v != NULL, .achieved = v ? v->achieved_tau : r->achieved_eps, .guaranteed = v && v->guaranteed};
    if (patch) told->vertices = patch->vertex_count, told->triangles = patch->triangle_count;
    return v ? view_token_of(r, patch, &told->token, error) : SQLITE_OK;
}

int told_columns(bool is_view) {
    return is_view ? 5 : 3;
}

void put_told(const mesh_told *told, int column, sqlite3_context *result) {
    switch (column) {
    case 0:
        sqlite3_result_int64(result, (sqlite3_int64)told->vertices);
        break;
    case 1:
        sqlite3_result_int64(result, (sqlite3_int64)told->triangles);
        break;
    case 2:
        sqlite3_result_double(result, told->achieved);
        break;
    case 3:
        sqlite3_result_int(result, told->guaranteed);
        break;
    default:
        sqlite3_result_text(result, told->token, -1, SQLITE_TRANSIENT); /* NULL for NULL */
        break;
    }
}

static void column(void *data, size_t row, int n, sqlite3_context *result) {
    const mesh_bytes *mesh = data;
    (void)row;
    if (n > 0)
        put_told(&mesh->told, n - 1, result);
    else if (mesh->is_text)
        sqlite3_result_text64(result, (const char *)mesh->bytes, mesh->size, SQLITE_TRANSIENT, SQLITE_UTF8);
    else
        sqlite3_result_blob64(result, mesh->bytes, mesh->size, SQLITE_TRANSIENT);
}

static void release(void *data) {
    mesh_bytes *mesh = data;
    sqlite3_free(mesh->bytes);
    sqlite3_free(mesh->told.token);
    sqlite3_free(mesh);
}

static int fill(connection *c, bool is_view, sqlite3_value **arguments, row_set *rows, char **error) {
    mesh_bytes *mesh = sqlite3_malloc(sizeof *mesh);
    if (!mesh) return SQLITE_NOMEM;
    const int code = mesh_bytes_make(c, is_view, arguments, mesh, error);
    if (code != SQLITE_OK) {
        sqlite3_free(mesh);
        return code;
    }
    *rows = (row_set){.count = 1, .data = mesh, .column = column, .release = release};
    return SQLITE_OK;
}

int fill_answer(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    return fill(c, false, arguments, rows, error);
}

int fill_view_answer(connection *c, sqlite3_value **arguments, row_set *rows, char **error) {
    return fill(c, true, arguments, rows, error);
}
