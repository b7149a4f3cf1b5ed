/* mosaic.c - several sources on one grid.
 *
 * The first source's grid is the grid: every other one must have its CRS, its cell size and a whole number of cells
 * between the two, each within a thousandth of a cell over the whole source. What the union holds and no source
 * covers is void. Where sources overlap, the later one wins; read.c counts. Sources of which that is nowhere the
 * case make the same terrain in any order: its coordinates are those of the source that its corner is nearest to,
 * not of the one that was named first.
 */
#include "source.h"

#include <math.h>
#include <stdlib.h>

#define SLACK 1e-3 /* cells */

/* One axis of source s against the first: the cell at which s begins. */
bool import_mosaic_align(const import_job *job, const import_source *first, const import_source *s, bool rows,
                         int64_t *cell) {
    double from = rows ? first->placement.y0 : first->placement.x0, to = rows ? s->placement.y0 : s->placement.x0;
    double step = rows ? first->placement.dy : first->placement.dx, own = rows ? s->placement.dy : s->placement.dx;
    int32_t n = rows ? s->height : s->width;
    double drift = fabs(own - step) / fabs(step) * (n > 1 ? n - 1 : 1);
    if (!(drift <= SLACK))
        return import_refuse(job,
                             "%s has cells of %.12g in %s, %s of %.12g: the sources of a terrain share one grid",
                             s->path, fabs(own), rows ? "y" : "x", first->path, fabs(step));
    double offset = (to - from) / step;
    if (!(fabs(offset) < 1e9))
        return import_refuse(job, "%s lies %.10g cells from %s in %s: too far for one terrain", s->path,
                             fabs(offset), first->path, rows ? "y" : "x");
    double off = fabs(offset - rint(offset));
    if (!(off <= SLACK))
        return import_refuse(job,
                             "%s lies %.6f cells from %s in %s, which is no whole number: the sources of a terrain "
                             "share one grid",
                             s->path, offset, first->path, rows ? "y" : "x");
    *cell = (int64_t)rint(offset);
    return true;
}

/* Coordinates come from sources that touch the edge in question, so that they carry no rounding of ours: x from the
 * northernmost of the west, y from the westernmost of the north, and the cells from the one that is first by row.
 * Among those of one place, where files differ in the last digit, the smallest value. */
static rqt_placement placement_of(const import_source *sources, int count, const import_mosaic *m) {
    int x = -1, y = -1, cell = 0;
    for (int i = 0; i < count; i++) {
        const rqt_placement *p = &sources[i].placement;
        if (m->column[i] == 0 &&
            (x < 0 || m->row[i] < m->row[x] || (m->row[i] == m->row[x] && p->x0 < sources[x].placement.x0)))
            x = i;
        if (m->row[i] == 0 && (y < 0 || m->column[i] < m->column[y] ||
                               (m->column[i] == m->column[y] && p->y0 < sources[y].placement.y0)))
            y = i;
        const rqt_placement *c = &sources[cell].placement;
        const int64_t own = ((int64_t)m->row[i] << 32) + m->column[i],
                      other = ((int64_t)m->row[cell] << 32) + m->column[cell];
        if (own < other || (own == other && (p->dx < c->dx || (p->dx == c->dx && p->dy < c->dy)))) cell = i;
    }
    return (rqt_placement){sources[x].placement.x0, sources[y].placement.y0, sources[cell].placement.dx,
                           sources[cell].placement.dy};
}

static bool place(const import_job *job, const import_source *sources, int count, import_mosaic *m) {
    const import_source *first = &sources[0];
    int64_t west = 0, north = 0, east = first->width, south = first->height;
    for (int i = 1; i < count; i++) {
        const import_source *s = &sources[i];
        if (!import_crs_is_same(first->crs, s->crs))
            return import_refuse(job, "%s has the CRS %s, %s has %s: the sources of a terrain share one", s->path,
                                 import_crs_name(s->crs), first->path, import_crs_name(first->crs));
        if (!s->placed || !first->placed)
            return import_refuse(job, "%s has no geotransform: it cannot be placed beside %s",
                                 s->placed ? first->path : s->path, s->placed ? s->path : first->path);
        int64_t x = 0, y = 0;
        if (!import_mosaic_align(job, first, s, false, &x) || !import_mosaic_align(job, first, s, true, &y))
            return false;
        m->column[i] = (int32_t)x;
        m->row[i] = (int32_t)y;
        if (x < west) west = x;
        if (y < north) north = y;
        if (x + s->width > east) east = x + s->width;
        if (y + s->height > south) south = y + s->height;
    }
    if (rqt_lattice_init(&m->lattice, east - west, south - north) != RQT_OK)
        return import_refuse(job, "%s%s: %lld x %lld samples; a terrain has at most %d a side", first->path,
                             count > 1 ? " and the other sources together" : "", (long long)(east - west),
                             (long long)(south - north), (1 << RQT_MAX_K) + 1);
    for (int i = 0; i < count; i++) {
        m->column[i] = (int32_t)(m->column[i] - west);
        m->row[i] = (int32_t)(m->row[i] - north);
    }
    m->placement = placement_of(sources, count, m);
    return true;
}

static bool unit_is_same(const rqt_unit *a, const rqt_unit *b) {
    return a->scale == b->scale && a->offset == b->offset && a->numerator == b->numerator &&
           a->denominator == b->denominator;
}

/* The kind of number that holds every source, and what becomes of it. */
static void choose_kind(const import_job *job, const import_source *sources, int count, import_mosaic *m) {
    const rqt_unit metre = {.d = 1, .numerator = 1, .denominator = 1, .scale = 1};
    rqt_unit unit = import_source_unit(&sources[0]);
    bool floats = false, wide = false, single = true, alike = true, metres = true;
    for (int i = 0; i < count; i++) {
        rqt_unit own = import_source_unit(&sources[i]);
        floats = floats || sources[i].is_float;
        wide = wide || sources[i].is_wide;
        single = single && sources[i].is_single;
        alike = alike && unit_is_same(&own, &unit);
        metres = metres && unit_is_same(&own, &metre);
    }
    const import_unit *own = &sources[0].unit;
    double quantum = job->options->quantum;
    m->is_metres = floats || !alike;
    if (!m->is_metres) {
        m->kind = wide ? IMPORT_I64 : IMPORT_I32;
        m->scheme = (import_scheme){.unit = unit};
        if (quantum > 0)
            import_notice(job, "--quantum has no effect: %s has whole numbers, which are kept as they are",
                          sources[0].path);
        return;
    }
    if (!floats)
        import_notice(job, "the sources differ in unit, scale or offset: their heights are kept in metres");
    m->kind = single && metres ? IMPORT_F32 : IMPORT_F64;
    /* Without a float among the sources there is no float type to be met. */
    m->scheme = (import_scheme){.unit = metre,
                                .single = single && floats,
                                .quantum = quantum * fabs(own->plain) * own->numerator / own->denominator};
}

bool import_mosaic_plan(const import_job *job, const import_source *sources, int count, import_mosaic *m) {
    *m = (import_mosaic){0};
    m->column = calloc((size_t)count, sizeof *m->column);
    m->row = calloc((size_t)count, sizeof *m->row);
    if (!m->column || !m->row) return import_no_memory(job, "placing the sources");
    if (!place(job, sources, count, m)) return false;
    choose_kind(job, sources, count, m);
    return true;
}

void import_mosaic_free(import_mosaic *m) {
    free(m->column);
    free(m->row);
    *m = (import_mosaic){0};
}
