/* cut.c - mode `cut`: the patch of a request clipped to its region, for rows, files and the proof. */
#include "functions.h"

int request_cut(request *r, rqt_cut *cut, char **error) {
    rqt_patch patch;
    *cut = (rqt_cut){0};
    int code = request_patch(r, RQT_PRODUCT_TRIANGLES, &patch, NULL, error);
    if (code != SQLITE_OK) return code;
    store_wait w = {r->store, SQLITE_INTERRUPT};
    const rqt_status status =
        rqt_cut_make(&patch, r->region, &r->terrain->lattice, store_allocator(), store_wait_is_over, &w, cut);
    store_keep(r->store, &patch);
    return status == RQT_OK ? SQLITE_OK : status == RQT_INTERRUPTED ? w.code : SQLITE_NOMEM;
}

int request_refuse_cut(const request *r, const char *what, char **error) {
    if (r->mode != REQUEST_CUT) return SQLITE_OK;
    return fail(error, "%s holds whole samples, and mode \"cut\" has vertices between them", what);
}
