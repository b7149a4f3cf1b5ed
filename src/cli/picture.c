/* picture.c - a picture of a terrain and its meshes: gathers what is shown and writes the file.
 *
 * The window is the region's box and a margin, so that its outline and the triangles that reach over it are seen,
 * the whole raster without a region. Numbers in the captions are the verifier's, not the mesh's own.
 */
#include "picture.h"

#include <cairo-svg.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define AROUND 0.07      /* margin of a region, of its longer side */
#define MOST_AROUND 0.25 /* of each side: as far as the coarsest mesh is followed over the rim */
#define LEAST_MARGIN 3   /* samples */
#define SMALL 8          /* a box of fewer samples a side is shown with the triangles around it */

/* The box of the region in samples. False after a sentence, also when it misses the raster. */
static bool region_box(const store_terrain *t, const char *wkt, int32_t box[4]) {
    rqt_geometry *geometry = NULL;
    rqt_region *region = NULL;
    rqt_message message = {""};
    rqt_status status = RQT_OK;
    if (wkt) status = rqt_geometry_parse(wkt, strlen(wkt), true, store_allocator(), &geometry, &message);
    if (status == RQT_OK)
        status = rqt_region_create(geometry, &t->placement, &t->lattice, store_allocator(), &region);
    const bool meets = status == RQT_OK && rqt_region_box(region, &box[0], &box[2], &box[1], &box[3]);
    if (status != RQT_OK)
        cli_fail("the region cannot be read%s%s", *message.text ? ": " : "", message.text);
    else if (!meets)
        cli_fail("the region does not meet terrain %s: there is nothing to draw", t->name);
    rqt_region_free(region);
    rqt_geometry_free(geometry);
    return meets;
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

static bool choose_window(picture_page *page) {
    const store_terrain *t = page->terrain;
    int32_t box[4];
    if (!region_box(t, page->region, box)) return false;
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
    cli_ground(t, w->row, w->rows, &w->across, &w->down);
    return true;
}

static bool gather(sqlite3 *db, store *s, picture_page *page, const double *eps, const char *terrain,
                   const char *options, double width, bool svg) {
    for (int i = 0; i < page->count; i++)
        if (!picture_mesh_read(db, page->terrain, page->region, eps[i], terrain, options, &page->meshes[i]))
            return false;
    if (!choose_window(page)) return false;
    picture_layout(page, width, svg);
    if (!picture_relief_make(s, page->terrain, &page->window, &page->relief)) return false;
    const double line = picture_line_width(page) * page->window.density;
    for (int i = 0; i < page->count; i++)
        if (!picture_mesh_cover(&page->meshes[i], &page->window, line)) return false;
    return true;
}

static int write_file(const picture_page *page, bool svg, const cli_output *output) {
    cairo_surface_t *paper =
        svg ? cairo_svg_surface_create(output->temporary, page->width, page->height)
            : cairo_image_surface_create(CAIRO_FORMAT_RGB24, (int)page->width, (int)page->height);
    if (svg) cairo_svg_surface_set_document_unit(paper, CAIRO_SVG_UNIT_PX);
    cairo_t *cr = cairo_create(paper);
    picture_draw(page, cr, svg);
    cairo_status_t status = cairo_status(cr);
    cairo_destroy(cr);
    if (status == CAIRO_STATUS_SUCCESS && !svg) status = cairo_surface_write_to_png(paper, output->temporary);
    cairo_surface_finish(paper);
    if (status == CAIRO_STATUS_SUCCESS) status = cairo_surface_status(paper);
    cairo_surface_destroy(paper);
    if (status == CAIRO_STATUS_SUCCESS) return CLI_OK;
    return cli_fail("%s cannot be written: %s", output->path, cairo_status_to_string(status));
}

int cli_write_picture(sqlite3 *db, const char *region, const double *eps, int count, const char *terrain,
                      const char *options, int width, bool svg, const cli_output *output) {
    store *s;
    picture_page page = {.region = region, .count = count};
    if (!cli_find_terrain(db, terrain, &s, &page.terrain)) return CLI_FAILED;
    int status = CLI_FAILED;
    page.meshes = calloc((size_t)count, sizeof *page.meshes);
    if (!page.meshes)
        cli_fail("out of memory");
    else if (gather(db, s, &page, eps, terrain, options, width, svg))
        status = write_file(&page, svg, output);
    for (int i = 0; page.meshes && i < count; i++) {
        free(page.meshes[i].edges);
        cairo_surface_destroy(page.meshes[i].cover);
    }
    cairo_surface_destroy(page.relief.image);
    free(page.meshes);
    store_close(s);
    return status;
}
