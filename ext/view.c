/* view.c - a view as a request: what may be seen is its region, the camera's field its rule, eps infinite. So every
 * answer to a view is an answer like any other, in rows, strips and files. Outlines of voids are `tol`: they may
 * move by as much as heights may. */
#include "view.h"

int view_create(sqlite3_value *camera, view **out, char **error) {
    view *v = sqlite3_malloc(sizeof *v);
    *out = v;
    if (!v) return SQLITE_NOMEM;
    *v = (view){.test = RQT_VIEW_GUARANTEED};
    const int code = camera_read(camera, &v->words, error);
    v->achieved_tau = v->words.tau;
    return code;
}

void view_free(view *v) {
    if (!v) return;
    rqt_field_free(v->field);
    scene_free(&v->scene);
    sqlite3_free(v);
}

int view_place(request *r, char **error) {
    view *v = r->view;
    if (r->mode != REQUEST_COVER) return fail(error, "option \"mode\" of a view must be cover");
    if (r->max_vertices > 0) return fail(error, "option \"max_vertices\" does not go with a view");
    int code = scene_create(&v->scene, r->terrain, v->words.exaggeration, error);
    if (code == SQLITE_OK) code = camera_make(r->connection, &v->scene, &v->words, &v->camera, error);
    if (code == SQLITE_OK) code = view_field(r, v, &r->region, error);
    v->guaranteed = v->test == RQT_VIEW_GUARANTEED;
    return code;
}
