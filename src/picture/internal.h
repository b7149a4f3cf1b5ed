/* internal.h - the parts of a picture: window, relief, mesh, page.
 *
 *   picture.c  gathers: the window, the heights, a mesh and its proof for each eps; and writes the bytes
 *   proof.c    what rqt_verify says
 *   relief.c   heights -> tinted, shaded pixels
 *   edges.c    mesh -> its edges, each once, and their coverage of pixels
 *   page.c     draws it all with cairo, the same for PNG and SVG
 */
#ifndef RQT_PICTURE_INTERNAL_H
#define RQT_PICTURE_INTERNAL_H

#include "picture.h"
#include "store.h"
#include "text.h"

#include <cairo.h>

/* A sentence into *error; returns SQLITE_ERROR, or SQLITE_NOMEM. proof.c */
int picture_fail(char **error, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* The same out of the connection's last failure; returns its code. */
int picture_fail_database(char **error, sqlite3 *db);

/* The window of the raster that a panel shows, from the first sample's centre to the last one's, and its size on
 * the page (panel units) and in pixels (of images: relief and coverage). */
typedef struct picture_window {
    int32_t col, row, cols, rows;
    double across, down; /* metres of ground of one column, one row */
    double panel_width, panel_height;
    int pixel_width, pixel_height; /* round(panel * density) */
    double density;
} picture_window;

/* Samples from the window's first to its last; 1 for a window of one column, so that nothing divides by 0. */
static inline double picture_span(int32_t n) {
    return n > 1 ? n - 1 : 1;
}

typedef struct picture_relief {
    cairo_surface_t *image; /* pixel_width x pixel_height */
    bool any;               /* false: all void, low and high mean nothing */
    double low, high;       /* metres: the samples shown */
} picture_relief;

/* Reads the samples of the window and paints them. */
int picture_relief_make(store *s, const store_terrain *t, const picture_window *window, picture_relief *relief,
                        char **error);
/* The tint of a share 0..1 between low and high, as red, green, blue 0..1. */
void picture_tint(double share, double rgb[3]);
extern const double picture_void_rgb[3];

typedef struct picture_edge {
    double x0, y0, x1, y1; /* samples from the raster's (0,0) */
} picture_edge;

typedef struct picture_mesh {
    double eps;
    picture_proof proof;
    picture_edge *edges;
    size_t count;
    int32_t box[4];         /* samples: first and last column, first and last row; only when there are edges */
    cairo_surface_t *cover; /* A8, pixel_width x pixel_height: how much of each pixel lines cover */
    double opacity;         /* of the lines, less for dense meshes */
    double line_share;      /* of the full line width, less for dense meshes */
} picture_mesh;

/* The edges of the answer of rqt_mesh() over terrain t, and their proof. */
int picture_mesh_read(sqlite3 *db, const store_terrain *t, const picture_request *r, double eps, picture_mesh *mesh,
                      char **error);
/* Their coverage with lines of `width` pixels, and the opacity that goes with it; false without memory. */
bool picture_mesh_cover(picture_mesh *mesh, const picture_window *window, double width);

typedef struct picture_page {
    const store_terrain *terrain;
    const char *region; /* WKT or NULL */
    picture_window window;
    picture_relief relief;
    picture_mesh *meshes;
    int count;
    double width, height; /* of the page */
} picture_page;

/* Page size, panel size and density for a page width: window.col .. down and the meshes' edges are set before.
 * Images have the page's own pixels; in an SVG (lines) fewer when they would be too much for viewers. */
void picture_layout(picture_page *page, double width, bool lines);
/* lines: draw edges as lines where there are few enough, not as an image (for SVG), as in picture_layout. */
void picture_draw(const picture_page *page, cairo_t *cr, bool lines);
double picture_line_width(const picture_page *page); /* of an edge, in panel units */

#endif
