/* page.c - the picture on its page: title, legend, a panel for each eps with its caption, scale bar, region.
 *
 * All sizes are for a page 1800 wide and grow with it. The same calls draw on an image (PNG) and on paper (SVG);
 * only the edges differ: as lines where there are few enough, so that they stay sharp in an SVG, else as an image.
 */
#include "internal.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PAGE 1800.0
#define MARGIN 44
#define GAP 30
#define HEADER 104       /* title and what belongs to it, above the panels */
#define CAPTION 106      /* below each panel */
#define MOST_LINES 60000 /* edges of an SVG that are drawn as lines, some 42 bytes each */
#define MOST_PIXELS 3e6  /* of the images in an SVG: viewers refuse 10 MB, and a pixel takes up to 2 bytes */
#define ONE_HEIGHT 0.8   /* a panel is not higher than this share of the page's width */

static const double INK[3] = {0.114, 0.149, 0.192}, SOFT[3] = {0.341, 0.392, 0.451};
static const double EDGE[3] = {0.063, 0.110, 0.188}, REGION[3] = {0.80, 0.24, 0.03};
static const double ALARM[3] = {0.72, 0.05, 0.05};

static int columns_of(int count) {
    return count <= 4 ? count : count <= 6 ? 3 : 4;
}

/* In an SVG the panels with the fewest edges have lines, as long as there are not too many in all. */
static bool has_lines(const picture_page *page, const picture_mesh *mesh) {
    size_t sum = 0;
    for (int i = 0; i < page->count; i++)
        if (page->meshes[i].count <= mesh->count) sum += page->meshes[i].count;
    return sum <= MOST_LINES;
}

void picture_layout(picture_page *page, double width, bool lines) {
    picture_window *w = &page->window;
    const double unit = width / PAGE, ground = picture_span(w->cols) * w->across;
    /* Of a strip of land a thumb's width is shown, however long it is. */
    const double aspect = fmin(fmax(ground / (picture_span(w->rows) * w->down), 1 / 12.0), 12);
    const int columns = columns_of(page->count), rows = (page->count + columns - 1) / columns;
    const double slot = (width - 2 * MARGIN * unit - (columns - 1) * GAP * unit) / columns;
    double panel_width = slot, panel_height = slot / aspect;
    if (panel_height > ONE_HEIGHT * width) {
        panel_height = ONE_HEIGHT * width;
        panel_width = panel_height * aspect;
    }
    w->panel_width = fmax(floor(panel_width), 1);
    w->panel_height = fmax(floor(panel_height), 1);
    int images = 1;
    for (int i = 0; i < page->count; i++) images += !has_lines(page, &page->meshes[i]);
    const double pixels = images * w->panel_width * w->panel_height;
    w->density = lines && pixels > MOST_PIXELS ? sqrt(MOST_PIXELS / pixels) : 1;
    w->pixel_width = (int)fmax(round(w->panel_width * w->density), 1);
    w->pixel_height = (int)fmax(round(w->panel_height * w->density), 1);
    page->width = width;
    page->height = ceil((MARGIN + HEADER + MARGIN / 2.0) * unit + rows * (w->panel_height + CAPTION * unit));
}

double picture_line_width(const picture_page *page) {
    return 1.0 * page->width / PAGE;
}

static void ink(cairo_t *cr, const double rgb[3]) {
    cairo_set_source_rgb(cr, rgb[0], rgb[1], rgb[2]);
}

static void font(cairo_t *cr, double size, bool bold) {
    cairo_select_font_face(cr, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cr, size);
}

static double text_width(cairo_t *cr, const char *text) {
    cairo_text_extents_t e;
    cairo_text_extents(cr, text, &e);
    return e.x_advance;
}

/* align: 0 left, 0.5 middle, 1 right of x. Made smaller when it is wider than `room`. */
static void write_text(cairo_t *cr, double x, double y, double align, double room, double size, bool bold,
                       const char *text) {
    font(cr, size, bold);
    const double width = text_width(cr, text);
    if (width > room) font(cr, size * room / width, bold);
    cairo_move_to(cr, x - align * fmin(width, room), y);
    cairo_show_text(cr, text);
    cairo_new_path(cr);
}

/* "71.5° W"; outside of what degrees usually are, the bare number. */
static const char *degrees(double value, bool is_x, char text[48]) {
    const char *number = text_place(fabs(value), true);
    if (fabs(value) > (is_x ? 180 : 90))
        snprintf(text, 48, "%s°", text_place(value, true));
    else
        snprintf(text, 48, "%s° %s", number, is_x ? (value < 0 ? "W" : "E") : (value < 0 ? "S" : "N"));
    return text;
}

/* The next place of a WKT that SQL has accepted, its first two numbers, and whether its list ends there (a ring, a
 * line, a place alone). NULL: there is none. */
static const char *next_place(const char *at, double xy[2], bool *last) {
    int number = 0;
    for (; *at; at++) {
        char *end;
        const double value = strtod(at, &end);
        if (end != at && !strchr("iInN", *at)) {
            if (number < 2) xy[number] = value;
            number++;
            at = end - 1;
        } else if (strchr("(),", *at)) {
            *last = *at != ',';
            if (number >= 2) return at;
            number = 0;
        }
    }
    return NULL;
}

/* Least and largest x, least and largest y of a region as it was given. */
static bool region_extent(const char *region, double box[4]) {
    const char *at = region ? strchr(region, '(') : NULL;
    double xy[2];
    bool last, any = false;
    for (; at && (at = next_place(at, xy, &last)); any = true)
        for (int i = 0; i < 2; i++) {
            box[2 * i] = any ? fmin(box[2 * i], xy[i]) : xy[i];
            box[2 * i + 1] = any ? fmax(box[2 * i + 1], xy[i]) : xy[i];
        }
    return any;
}

/* Of the region when there is one, else of the window. */
static void extent_text(const picture_page *page, char *text, size_t size) {
    const picture_window *w = &page->window;
    const store_terrain *t = page->terrain;
    const rqt_placement *p = &t->placement;
    double x0 = p->x0 + w->col * p->dx, x1 = p->x0 + (w->col + w->cols - 1) * p->dx;
    double y0 = p->y0 + w->row * p->dy, y1 = p->y0 + (w->row + w->rows - 1) * p->dy;
    double box[4];
    if (region_extent(page->region, box)) x0 = box[0], x1 = box[1], y0 = box[3], y1 = box[2];
    const double width = fabs((x1 - x0) / p->dx) * w->across, height = fabs((y1 - y0) / p->dy) * w->down;
    char a[48], b[48], c[48], d[48], ground[120] = "";
    if (*t->crs && (width > 0 || height > 0))
        snprintf(ground, sizeof ground, "   ·   %s × %s", text_length(width), text_length(height));
    if (t->lonlat)
        snprintf(text, size, "%s – %s,  %s – %s%s", degrees(x0, true, a), degrees(x1, true, b),
                 degrees(y1, false, c), degrees(y0, false, d), ground);
    else
        snprintf(text, size, "x %s – %s,  y %s – %s%s", text_place(x0, false), text_place(x1, false),
                 text_place(y1, false), text_place(y0, false), ground);
}

static void draw_legend(const picture_page *page, cairo_t *cr, double unit, double right) {
    if (!page->relief.any) return;
    const double width = 300 * unit, height = 13 * unit, x = right - width, y = (MARGIN + 22) * unit;
    const bool voids = page->terrain->voids > 0;
    char low[48], high[48];
    snprintf(low, sizeof low, "%.0f m", page->relief.low);
    snprintf(high, sizeof high, "%.0f m", page->relief.high);
    if (page->relief.high - page->relief.low < 20) {
        snprintf(low, sizeof low, "%.4g m", page->relief.low);
        snprintf(high, sizeof high, "%.4g m", page->relief.high);
    }
    cairo_pattern_t *ramp = cairo_pattern_create_linear(x, 0, x + width, 0);
    for (int i = 0; i <= 10; i++) {
        double rgb[3];
        picture_tint(i / 10.0, rgb);
        cairo_pattern_add_color_stop_rgb(ramp, i / 10.0, rgb[0], rgb[1], rgb[2]);
    }
    cairo_rectangle(cr, x, y, width, height);
    cairo_set_source(cr, ramp);
    cairo_fill_preserve(cr);
    cairo_pattern_destroy(ramp);
    ink(cr, SOFT);
    cairo_set_line_width(cr, 0.8 * unit);
    cairo_stroke(cr);
    write_text(cr, x, y - 8 * unit, 0, width / 2, 15 * unit, false, low);
    write_text(cr, right, y - 8 * unit, 1, width / 2, 15 * unit, false, high);
    if (!voids) return;
    cairo_rectangle(cr, x, y + 24 * unit, 26 * unit, height);
    ink(cr, picture_void_rgb);
    cairo_fill_preserve(cr);
    ink(cr, SOFT);
    cairo_stroke(cr);
    write_text(cr, x + 34 * unit, y + 35.5 * unit, 0, width, 15 * unit, false, "no data");
}

static void draw_header(const picture_page *page, cairo_t *cr, double unit) {
    const store_terrain *t = page->terrain;
    char text[400], extent[300];
    const double left = MARGIN * unit, right = page->width - left, room = right - left - 340 * unit;
    ink(cr, INK);
    write_text(cr, left, (MARGIN + 26) * unit, 0, room, 36 * unit, true, t->name);
    extent_text(page, extent, sizeof extent);
    ink(cr, SOFT);
    write_text(cr, left, (MARGIN + 57) * unit, 0, room, 17 * unit, false, extent);
    const bool part = page->window.cols < t->lattice.width || page->window.rows < t->lattice.height;
    if (part)
        snprintf(text, sizeof text, "%s%d × %d of %d × %d samples", page->region ? "shown: " : "",
                 page->window.cols, page->window.rows, t->lattice.width, t->lattice.height);
    else
        snprintf(text, sizeof text, "%d × %d samples", t->lattice.width, t->lattice.height);
    if (*t->crs) {
        const size_t n = strlen(text);
        snprintf(text + n, sizeof text - n, "   ·   %.80s", text_crs_label(t));
    }
    write_text(cr, left, (MARGIN + 82) * unit, 0, room, 17 * unit, false, text);
    draw_legend(page, cr, unit, right);
}

/* ------------------------------------------------------------------------------------------------- panel -- */
static void trace_edges(const picture_page *page, cairo_t *cr, const picture_mesh *mesh) {
    const picture_window *w = &page->window;
    const double sx = w->panel_width / picture_span(w->cols), sy = w->panel_height / picture_span(w->rows);
    for (size_t i = 0; i < mesh->count; i++) {
        const picture_edge *e = &mesh->edges[i];
        const int32_t right = w->col + w->cols, bottom = w->row + w->rows;
        if ((e->x0 < w->col && e->x1 < w->col) || (e->x0 > right && e->x1 > right) ||
            (e->y0 < w->row && e->y1 < w->row) || (e->y0 > bottom && e->y1 > bottom))
            continue;
        cairo_move_to(cr, (e->x0 - w->col) * sx, (e->y0 - w->row) * sy);
        cairo_line_to(cr, (e->x1 - w->col) * sx, (e->y1 - w->row) * sy);
    }
}

static void paint_image(cairo_t *cr, cairo_surface_t *image, const picture_window *w) {
    cairo_save(cr);
    cairo_scale(cr, w->panel_width / w->pixel_width, w->panel_height / w->pixel_height);
    cairo_set_source_surface(cr, image, 0, 0);
    if (cairo_surface_get_type(cairo_get_target(cr)) == CAIRO_SURFACE_TYPE_IMAGE)
        cairo_pattern_set_filter(cairo_get_source(cr), CAIRO_FILTER_NEAREST);
    cairo_paint(cr);
    cairo_restore(cr);
}

/* Coverage as an image of ink: an SVG then needs no masks, which viewers draw in different ways. */
static void paint_cover(cairo_t *cr, const picture_mesh *mesh, const picture_window *w) {
    cairo_surface_t *image = cairo_image_surface_create(CAIRO_FORMAT_ARGB32, w->pixel_width, w->pixel_height);
    if (cairo_surface_status(image) == CAIRO_STATUS_SUCCESS) {
        cairo_t *on_image = cairo_create(image);
        cairo_set_source_rgba(on_image, EDGE[0], EDGE[1], EDGE[2], mesh->opacity);
        cairo_mask_surface(on_image, mesh->cover, 0, 0);
        cairo_destroy(on_image);
        paint_image(cr, image, w);
    }
    cairo_surface_destroy(image);
}

static void draw_edges(const picture_page *page, cairo_t *cr, const picture_mesh *mesh, bool lines) {
    if (!lines || !has_lines(page, mesh)) {
        paint_cover(cr, mesh, &page->window);
        return;
    }
    trace_edges(page, cr, mesh);
    cairo_set_line_width(cr, picture_line_width(page) * mesh->line_share);
    cairo_set_line_cap(cr, CAIRO_LINE_CAP_ROUND);
    cairo_set_source_rgba(cr, EDGE[0], EDGE[1], EDGE[2], mesh->opacity);
    cairo_stroke(cr);
}

/* The rings and lines of a region. A place alone becomes a ring of its own (a circle on the page). */
static void trace_region(const picture_page *page, cairo_t *cr, double unit) {
    const picture_window *w = &page->window;
    const rqt_placement *p = &page->terrain->placement;
    const double sx = w->panel_width / picture_span(w->cols), sy = w->panel_height / picture_span(w->rows);
    const char *at = strchr(page->region, '(');
    int places = 0;
    double xy[2];
    bool last;
    while (at && (at = next_place(at, xy, &last))) {
        const double x = ((xy[0] - p->x0) / p->dx - w->col) * sx, y = ((xy[1] - p->y0) / p->dy - w->row) * sy;
        if (places++)
            cairo_line_to(cr, x, y);
        else
            cairo_move_to(cr, x, y);
        if (last && places == 1) {
            cairo_new_sub_path(cr);
            cairo_arc(cr, x, y, 7 * unit, 0, 2 * M_PI);
        }
        if (last) places = 0;
    }
}

static void draw_region(const picture_page *page, cairo_t *cr, double unit) {
    if (!page->region) return;
    trace_region(page, cr, unit);
    cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
    cairo_set_line_width(cr, 5 * unit);
    cairo_set_source_rgba(cr, 1, 1, 1, 0.75);
    cairo_stroke_preserve(cr);
    cairo_set_line_width(cr, 2.4 * unit);
    ink(cr, REGION);
    cairo_stroke(cr);
}

/* A round length of at most a third of the panel. */
static double round_length(double most) {
    double length = pow(10, floor(log10(most)));
    if (length * 5 <= most) return length * 5;
    return length * 2 <= most ? length * 2 : length;
}

static void draw_scale(const picture_page *page, cairo_t *cr, double unit) {
    const picture_window *w = &page->window;
    const double metres = picture_span(w->cols) * w->across, per_metre = w->panel_width / metres;
    const double length = round_length(metres * 0.3), width = length * per_metre;
    char text[64];
    if (!*page->terrain->crs)
        snprintf(text, sizeof text, "%g units", length);
    else if (length < 1000)
        snprintf(text, sizeof text, "%g m", length);
    else
        snprintf(text, sizeof text, "%g km", length / 1000);
    font(cr, 15 * unit, false);
    const double label = text_width(cr, text), room = width + label + 36 * unit;
    if (room > w->panel_width || w->panel_height < 60 * unit) return;
    const double x = 12 * unit, y = w->panel_height - 42 * unit, bar = y + 15 * unit;
    cairo_rectangle(cr, x, y, room, 30 * unit);
    cairo_set_source_rgba(cr, 1, 1, 1, 0.86);
    cairo_fill(cr);
    ink(cr, INK);
    cairo_set_line_cap(cr, CAIRO_LINE_CAP_BUTT);
    cairo_set_line_width(cr, 2 * unit);
    cairo_move_to(cr, x + 12 * unit, bar - 5 * unit);
    cairo_rel_line_to(cr, 0, 10 * unit);
    cairo_rel_move_to(cr, 0, -5 * unit);
    cairo_rel_line_to(cr, width, 0);
    cairo_rel_move_to(cr, 0, -5 * unit);
    cairo_rel_line_to(cr, 0, 10 * unit);
    cairo_stroke(cr);
    write_text(cr, x + 22 * unit + width, bar + 5.5 * unit, 0, label, 15 * unit, false, text);
}

static void draw_caption(const picture_page *page, cairo_t *cr, const picture_mesh *mesh, double room,
                         double unit) {
    const picture_proof *proof = &mesh->proof;
    const bool holds = picture_proof_holds(proof, mesh->eps, page->terrain->quantum_error);
    const double middle = page->window.panel_width / 2, y = page->window.panel_height;
    char text[200];
    snprintf(text, sizeof text, "eps %s m", text_real(mesh->eps));
    ink(cr, INK);
    write_text(cr, middle, y + 34 * unit, 0.5, room, 24 * unit, true, text);
    snprintf(text, sizeof text, "%s %s   ·   %s %s", text_count(proof->vertices),
             proof->vertices == 1 ? "vertex" : "vertices", text_count(proof->triangles),
             proof->triangles == 1 ? "triangle" : "triangles");
    write_text(cr, middle, y + 60 * unit, 0.5, room, 16.5 * unit, false, text);
    const double share = proof->samples ? 100.0 * (double)proof->vertices / (double)proof->samples : 0;
    snprintf(text, sizeof text, "%.3g %% of %s samples   ·   %s %s m", share, text_count(proof->samples),
             holds ? "true error" : "BROKEN: true error", text_metres(proof->max_error));
    ink(cr, holds ? SOFT : ALARM);
    write_text(cr, middle, y + 83 * unit, 0.5, room, 16.5 * unit, false, text);
}

static void draw_panel(const picture_page *page, cairo_t *cr, const picture_mesh *mesh, bool lines, bool first,
                       double room, double unit) {
    const picture_window *w = &page->window;
    cairo_save(cr);
    cairo_rectangle(cr, 0, 0, w->panel_width, w->panel_height);
    cairo_clip(cr);
    paint_image(cr, page->relief.image, w);
    draw_edges(page, cr, mesh, lines);
    draw_region(page, cr, unit);
    if (first) draw_scale(page, cr, unit);
    cairo_restore(cr);
    cairo_rectangle(cr, 0, 0, w->panel_width, w->panel_height);
    cairo_set_line_width(cr, unit);
    ink(cr, SOFT);
    cairo_stroke(cr);
    draw_caption(page, cr, mesh, room, unit);
}

void picture_draw(const picture_page *page, cairo_t *cr, bool lines) {
    const double unit = page->width / PAGE;
    const picture_window *w = &page->window;
    const int columns = columns_of(page->count);
    const double slot = (page->width - 2 * MARGIN * unit - (columns - 1) * GAP * unit) / columns;
    cairo_set_source_rgb(cr, 1, 1, 1);
    cairo_paint(cr);
    draw_header(page, cr, unit);
    for (int i = 0; i < page->count; i++) {
        const double x = MARGIN * unit + (i % columns) * (slot + GAP * unit) + (slot - w->panel_width) / 2;
        const int row = i / columns;
        const double y = (MARGIN + HEADER) * unit + row * (w->panel_height + CAPTION * unit);
        cairo_save(cr);
        cairo_translate(cr, floor(x), floor(y)); /* images then lie on the page's pixels */
        draw_panel(page, cr, &page->meshes[i], lines, i == 0, slot, unit);
        cairo_restore(cr);
    }
}
