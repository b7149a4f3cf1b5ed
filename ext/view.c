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
    rqt_patch_free(&v->last_mesh);
    scene_free(&v->scene);
    sqlite3_free(v);
}

/* What the options may say of a view. */
static int check_options(request *r, char **error) {
    const char *test = rqt_view_test_name(r->test);
    if (r->mode != REQUEST_COVER) return fail(error, "option \"mode\" of a view must be cover");
    if (r->max_vertices > 0) return fail(error, "option \"max_vertices\" does not go with a view");
    if (r->test == RQT_VIEW_GUARANTEED) return SQLITE_OK;
    if (r->previous)
        return fail(
            error, "option \"previous\" does not go with \"test\":\"%s\": it promises nothing near a camera", test);
    if (r->has_metric)
        return fail(error, "option \"metric\" does not go with \"test\":\"%s\", which is about the metric %s", test,
                    rqt_metric_name(rqt_view_test_metric(r->test)));
    r->options.metric = rqt_view_test_metric(r->test);
    return SQLITE_OK;
}

int view_place(request *r, char **error) {
    view *v = r->view;
    int code = check_options(r, error);
    const bool geoid = r->frame_kind != FRAME_CRS && terrain_is_above_geoid(r->terrain);
    v->test = r->test;
    if (code == SQLITE_OK) code = scene_create(&v->scene, r->terrain, v->words.exaggeration, geoid, error);
    if (code == SQLITE_OK) code = camera_make(r->connection, &v->scene, &v->words, &v->camera, error);
    return code;
}
