/* picture.c - a picture of a terrain and its meshes: gathers what is shown and writes the bytes.
 *
 * The window is the region's box and a margin, so that its outline and the triangles that reach over it are seen,
 * the whole raster without a region. Numbers in the captions are the verifier's, not the mesh's own.
 */
#include "internal.h"

#include <cairo-svg.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define AROUND 0.07      /* margin of a region, of its longer side */
#define MOST_AROUND 0.25 /* of each side: as far as the coarsest mesh is followed over the rim */
#define LEAST_MARGIN 3   /* samples */
#define SMALL 8          /* a box of fewer samples a side is shown with the triangles around it */

/* The box of the region in samples; a sentence also when it misses the raster. */
static int region_box(const store_terrain *t, const char *wkt, int32_t box[4], char **error) {
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_message message = {""};
    rqt_status status = RQT_OK;
    if (wkt) status = rqt_geometry_parse(wkt, strlen(wkt), true, store_allocator(), &geometry, &message);
    if (status == RQT_OK)
        status = rqt_region_create(geometry, &t->placement, &t->lattice, store_allocator(), &region);
    const bool meets = status == RQT_OK && rqt_region_box(region, &box[0], &box[2], &box[1], &box[3]);
    int code = SQLITE_OK;
    if (status != RQT_OK)
        code = picture_fail(error, "the region cannot be read%s%s", *message.text ? ": " : "", message.text);
    else if (!meets)
        code = picture_fail(error, "the region does not meet terrain %s: there is nothing to draw", t->name);
    rqt_region_free(region);
    rqt_geometry_free(geometry);
    return code;
}

static int32_t clamp(double value, int32_t low, int32_t high) {
    return value < low ? low : value > high ? high : (int32_t)value;
}

/* Room for the outline, and for the coarsest mesh's triangles that reach over it. */
static void add_margin(const picture_page *page, int32_t box[4]) {
    const rqt_lattice *lattice = &page->terrain->lattice;
    const int32_t width = box[1] - box[0], height = box[3] - box[2];
    const double margin = fmax(ceil((width > height ? width : height) * AROUND), LEAST_MARGIN);
    const picture_mesh *coarsest = &page->meshes[0];
    for (int i = 1; i < page->count; i++)
        if (page->meshes[i].eps > coarsest->eps) coarsest = &page->meshes[i];
    for (int i = 0; i < 4; i++) {
        const double most = floor((i < 2 ? width : height) * MOST_AROUND);
        const int32_t over = !coarsest->count ? 0 : i % 2 ? coarsest->box[i] - box[i] : box[i] - coarsest->box[i];
        const double around = fmax(margin, fmin(over + 1, most));
        box[i] =
            clamp(i % 2 ? box[i] + around : box[i] - around, 0, (i < 2 ? lattice->width : lattice->height) - 1);
    }
}

static int choose_window(picture_page *page, char **error) {
    const store_terrain *t = page->terrain;
    int32_t box[4] = {0};
    const int code = region_box(t, page->region, box, error);
    if (code != SQLITE_OK) return code;
    if (page->region) {
        /* A place or a thin line says little about the size of what is worth seeing; the finest mesh does. */
        const picture_mesh *finest = &page->meshes[0];
        for (int i = 1; i < page->count; i++)
            if (page->meshes[i].eps < finest->eps) finest = &page->meshes[i];
        if ((box[1] - box[0] < SMALL || box[3] - box[2] < SMALL) && finest->count)
            for (int i = 0; i < 4; i++)
                box[i] = i % 2 ? (box[i] > finest->box[i] ? box[i] : finest->box[i])
                               : (box[i] < finest->box[i] ? box[i] : finest->box[i]);
        add_margin(page, box);
    }
    picture_window *w = &page->window;
    *w = (picture_window){.col = box[0], .row = box[2], .cols = box[1] - box[0] + 1, .rows = box[3] - box[2] + 1};
    text_ground(t, w->row, w->rows, &w->across, &w->down);
    return SQLITE_OK;
}

static int gather(sqlite3 *db, store *s, picture_page *page, const picture_request *r, char **error) {
    int code = SQLITE_OK;
    for (int i = 0; i < page->count && code == SQLITE_OK; i++)
        code = picture_mesh_read(db, page->terrain, r, r->eps[i], &page->meshes[i], error);
    if (code == SQLITE_OK) code = choose_window(page, error);
    if (code != SQLITE_OK) return code;
    picture_layout(page, r->width, r->svg);
    code = picture_relief_make(s, page->terrain, &page->window, &page->relief, error);
    const double line = picture_line_width(page) * page->window.density;
    for (int i = 0; i < page->count && code == SQLITE_OK; i++)
        if (!picture_mesh_cover(&page->meshes[i], &page->window, line)) code = SQLITE_NOMEM;
    return code;
}

typedef struct sink {
    picture_put *put;
    void *context;
} sink;

static cairo_status_t take(void *context, const unsigned char *bytes, unsigned size) {
    const sink *s = context;
    return s->put(s->context, bytes, size) ? CAIRO_STATUS_SUCCESS : CAIRO_STATUS_WRITE_ERROR;
}

static int write_page(const picture_page *page, bool svg, sink *out, char **error) {
    cairo_surface_t *paper =
        svg ? cairo_svg_surface_create_for_stream(take, out, page->width, page->height)
            : cairo_image_surface_create(CAIRO_FORMAT_RGB24, (int)page->width, (int)page->height);
    if (svg) cairo_svg_surface_set_document_unit(paper, CAIRO_SVG_UNIT_PX);
    cairo_t *cr = cairo_create(paper);
    picture_draw(page, cr, svg);
    cairo_status_t status = cairo_status(cr);
    cairo_destroy(cr);
    if (status == CAIRO_STATUS_SUCCESS && !svg) status = cairo_surface_write_to_png_stream(paper, take, out);
    cairo_surface_finish(paper);
    if (status == CAIRO_STATUS_SUCCESS) status = cairo_surface_status(paper);
    cairo_surface_destroy(paper);
    if (status == CAIRO_STATUS_SUCCESS) return SQLITE_OK;
    if (status == CAIRO_STATUS_NO_MEMORY) return SQLITE_NOMEM;
    return picture_fail(error, "the picture cannot be written: %s", cairo_status_to_string(status));
}

int picture_write(sqlite3 *db, const picture_request *r, picture_put *put, void *context, char **error) {
    store *s = NULL;
    sink out = {put, context};
    picture_page page = {.region = r->region, .count = r->count};
    int code = store_open(db, &s);
    if (code == SQLITE_OK) code = store_find(s, r->terrain, &page.terrain, error);
    if (code == SQLITE_OK) {
        page.meshes = calloc((size_t)r->count, sizeof *page.meshes);
        if (!page.meshes) code = SQLITE_NOMEM;
    }
    if (code == SQLITE_OK) code = gather(db, s, &page, r, error);
    if (code == SQLITE_OK) code = write_page(&page, r->svg, &out, error);
    for (int i = 0; page.meshes && i < r->count; i++) {
        free(page.meshes[i].edges);
        cairo_surface_destroy(page.meshes[i].cover);
    }
    cairo_surface_destroy(page.relief.image);
    free(page.meshes);
    if (s) store_close(s);
    return code;
}
