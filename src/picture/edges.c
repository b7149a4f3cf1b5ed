/* edges.c - the edges of a mesh, each once, and the part of each pixel that their lines cover.
 *
 * The mesh comes from SQL as PLY, which holds meshes of every mode. An edge inside the mesh belongs to two
 * triangles; sorting finds the pairs. Coverage is worked out here and not by cairo: a mesh may have millions of
 * edges shorter than a pixel, and a pixel's coverage is the largest that any one line gives it, so that nothing
 * builds up to dots where edges meet.
 */
#define _GNU_SOURCE /* memmem */
#include "internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MEAN_DARKNESS 0.20 /* of the part of the picture that a mesh covers, by its lines */
#define MOST_OPACITY 0.75
#define LEAST_OPACITY 0.24
#define WIDTH_OF_LENGTH 0.10 /* lines are a tenth as wide as the mean edge is long, between */
#define LEAST_WIDTH 0.5      /* and 1 of the width asked for */

static int compare_keys(const void *a, const void *b) {
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* A mesh as PLY, of which only what rqt itself writes is read. */
typedef struct model {
    const uint8_t *vertices; /* double x, y, z: 24 bytes each */
    const uint8_t *faces;    /* 3, and three int: 13 bytes each */
    uint64_t vertex_count, face_count;
} model;

static bool read_ply(const char *bytes, size_t size, model *m) {
    static const char vertex[] = "\nelement vertex ", face[] = "\nelement face ", end[] = "\nend_header\n";
    const char *body = bytes ? memmem(bytes, size, end, sizeof end - 1) : NULL;
    if (!body) return false;
    const size_t head = (size_t)(body - bytes);
    const char *v = memmem(bytes, head, vertex, sizeof vertex - 1), *f = memmem(bytes, head, face, sizeof face - 1);
    if (!v || !f) return false;
    m->vertex_count = strtoull(v + sizeof vertex - 1, NULL, 10); /* lines end before the header does */
    m->face_count = strtoull(f + sizeof face - 1, NULL, 10);
    m->vertices = (const uint8_t *)body + sizeof end - 1;
    m->faces = m->vertices + 24 * m->vertex_count;
    return m->vertex_count <= INT32_MAX && m->face_count <= INT32_MAX &&
           head + sizeof end - 1 + 24 * m->vertex_count + 13 * m->face_count == size;
}

/* In samples. What lies on one is not to be beside it by a rounding: lines would be drawn otherwise. */
static void place_of(const model *m, const store_terrain *t, uint64_t vertex, double place[2]) {
    double xy[2];
    memcpy(xy, m->vertices + 24 * vertex, sizeof xy);
    place[0] = rint((xy[0] - t->placement.x0) / t->placement.dx * 0x1p20) * 0x1p-20;
    place[1] = rint((xy[1] - t->placement.y0) / t->placement.dy * 0x1p20) * 0x1p-20;
}

static void add_edge(picture_mesh *mesh, const double a[2], const double b[2]) {
    for (int c = 0; c < 2; c++) {
        const int32_t low = (int32_t)floor(fmin(a[c], b[c])), high = (int32_t)ceil(fmax(a[c], b[c]));
        if (!mesh->count || low < mesh->box[2 * c]) mesh->box[2 * c] = low;
        if (!mesh->count || high > mesh->box[2 * c + 1]) mesh->box[2 * c + 1] = high;
    }
    mesh->edges[mesh->count++] = (picture_edge){a[0], a[1], b[0], b[1]};
}

static bool collect(const model *m, const store_terrain *t, picture_mesh *mesh) {
    const size_t n = 3 * (size_t)m->face_count;
    uint64_t *keys = malloc((n + 1) * sizeof *keys);
    if (!keys) return false;
    for (size_t i = 0; i < n; i++) {
        uint32_t corner[3];
        memcpy(corner, m->faces + 13 * (i / 3) + 1, sizeof corner);
        const uint32_t a = corner[i % 3], b = corner[(i + 1) % 3];
        keys[i] = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
    }
    qsort(keys, n, sizeof *keys, compare_keys);
    size_t count = 0;
    for (size_t i = 0; i < n; i++)
        if (!i || keys[i] != keys[i - 1]) keys[count++] = keys[i];
    mesh->edges = malloc((count + 1) * sizeof *mesh->edges);
    for (size_t i = 0; mesh->edges && i < count; i++) {
        double a[2], b[2];
        place_of(m, t, keys[i] >> 32, a);
        place_of(m, t, keys[i] & 0xFFFFFFFF, b);
        add_edge(mesh, a, b);
    }
    free(keys);
    return mesh->edges != NULL;
}

int picture_mesh_read(sqlite3 *db, const store_terrain *t, const picture_request *r, double eps, picture_mesh *mesh,
                      char **error) {
    *mesh = (picture_mesh){.eps = eps};
    int code = picture_proof_read(db, r->region, eps, r->terrain, r->options, &mesh->proof, error);
    if (code != SQLITE_OK) return code;
    sqlite3_stmt *row = NULL;
    if (sqlite3_prepare_v2(db, "SELECT rqt_mesh(?1, ?2, 'ply', ?3, ?4)", -1, &row, NULL) != SQLITE_OK)
        return picture_fail_database(error, db);
    sqlite3_bind_text(row, 1, r->region, -1, SQLITE_STATIC);
    sqlite3_bind_double(row, 2, eps);
    sqlite3_bind_text(row, 3, r->terrain, -1, SQLITE_STATIC);
    sqlite3_bind_text(row, 4, r->options, -1, SQLITE_STATIC);
    if (sqlite3_step(row) == SQLITE_ROW) {
        model m;
        const char *bytes = sqlite3_column_blob(row, 0);
        if (!read_ply(bytes, (size_t)sqlite3_column_bytes(row, 0), &m))
            code = picture_fail(error, "the mesh cannot be read");
        else if (!collect(&m, t, mesh))
            code = SQLITE_NOMEM;
    } else {
        code = picture_fail_database(error, db);
    }
    sqlite3_finalize(row);
    return code;
}

typedef struct canvas {
    uint8_t *bytes;
    int width, height, stride;
    double reach; /* half a line and half a pixel: coverage falls to 0 over a pixel's width */
} canvas;

/* One line, by the distance of each pixel's middle near it. Walks the longer direction, so that work goes with the
 * length; `far` pixels to either side. */
static void draw_line(const canvas *c, double x0, double y0, double x1, double y1) {
    const double dx = x1 - x0, dy = y1 - y0, length2 = dx * dx + dy * dy;
    const bool steep = fabs(dy) > fabs(dx);
    const double a0 = steep ? fmin(y0, y1) : fmin(x0, x1), a1 = steep ? fmax(y0, y1) : fmax(x0, x1);
    const int along = steep ? c->height : c->width, aside = steep ? c->width : c->height;
    int first = (int)floor(fmax(a0 - c->reach, 0)), last = (int)fmin(floor(a1 + c->reach), along - 1);
    const double far = c->reach * 1.4143;
    for (int a = first; a <= last; a++) {
        const double middle = fmin(fmax(a + 0.5, a0), a1);
        const double part = steep ? (middle - y0) / (dy == 0 ? 1 : dy) : (middle - x0) / (dx == 0 ? 1 : dx);
        const double b = steep ? x0 + part * dx : y0 + part * dy;
        const int low = (int)floor(fmax(b - far, 0)), high = (int)fmin(floor(b + far), aside - 1);
        for (int other = low; other <= high; other++) {
            const int x = steep ? other : a, y = steep ? a : other;
            double t = length2 > 0 ? ((x + 0.5 - x0) * dx + (y + 0.5 - y0) * dy) / length2 : 0;
            t = t < 0 ? 0 : t > 1 ? 1 : t;
            const double distance = hypot(x + 0.5 - x0 - t * dx, y + 0.5 - y0 - t * dy);
            const double cover = fmin(c->reach - distance, 1);
            uint8_t *at = c->bytes + (size_t)y * (size_t)c->stride + (size_t)x;
            if (cover > 0 && cover * 255 > *at) *at = (uint8_t)(cover * 255);
        }
    }
}

/* The share of the page that the mesh's own area has is near enough its box's. */
static double opacity_of(const canvas *c, const picture_mesh *mesh, const picture_window *w, double sx, double sy) {
    double sum = 0;
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) sum += c->bytes[(size_t)y * (size_t)c->stride + (size_t)x];
    const double left = fmax((mesh->box[0] - w->col) * sx, 0), right = fmin((mesh->box[1] - w->col) * sx, c->width);
    const double top = fmax((mesh->box[2] - w->row) * sy, 0),
                 bottom = fmin((mesh->box[3] - w->row) * sy, c->height);
    const double area = fmax(right - left, 1) * fmax(bottom - top, 1);
    const double mean = sum / 255 / area;
    return fmin(fmax(mean > 0 ? MEAN_DARKNESS / mean : 1, LEAST_OPACITY), MOST_OPACITY);
}

bool picture_mesh_cover(picture_mesh *mesh, const picture_window *w, double width) {
    mesh->cover = cairo_image_surface_create(CAIRO_FORMAT_A8, w->pixel_width, w->pixel_height);
    if (cairo_surface_status(mesh->cover) != CAIRO_STATUS_SUCCESS) return false;
    const double sx = w->pixel_width / picture_span(w->cols), sy = w->pixel_height / picture_span(w->rows);
    double sum = 0;
    for (size_t i = 0; i < mesh->count; i++) {
        const picture_edge *e = &mesh->edges[i];
        sum += hypot((e->x1 - e->x0) * sx, (e->y1 - e->y0) * sy);
    }
    const double share = mesh->count ? sum / (double)mesh->count / width * WIDTH_OF_LENGTH : 1;
    mesh->line_share = fmin(fmax(share, LEAST_WIDTH), 1);
    width *= mesh->line_share;
    const canvas c = {cairo_image_surface_get_data(mesh->cover), w->pixel_width, w->pixel_height,
                      cairo_image_surface_get_stride(mesh->cover), width / 2 + 0.5};
    cairo_surface_flush(mesh->cover);
    for (size_t i = 0; i < mesh->count; i++) {
        const picture_edge *e = &mesh->edges[i];
        draw_line(&c, (e->x0 - w->col) * sx, (e->y0 - w->row) * sy, (e->x1 - w->col) * sx, (e->y1 - w->row) * sy);
    }
    mesh->opacity = opacity_of(&c, mesh, w, sx, sy);
    cairo_surface_mark_dirty(mesh->cover);
    return true;
}
