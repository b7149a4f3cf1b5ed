/* fill.c - voids that become heights: small ones between their neighbours, the rest as sea, all of it noted down.
 *
 * A void is a component of void samples that touch by sides or corners. One that a square of 2R + 1 samples a side
 * holds, and that does not reach two opposite edges of the raster, is filled: each sample becomes the mean of the
 * nearest valid samples west, east, north and south of it, weighted by the inverse of their distance, in heights q,
 * the exact quotient rounded to the nearest, halves up. Between two of them that is the straight line, so a plane
 * is continued as it is. One of a row's two and one of a column's two are always there, as the opposite edges are
 * not both reached, and all are right beside the component. With sea, every other void sample becomes sea_q.
 *
 * Rows pass from north to south; 2R + 3 of them are in memory. The runs of voids of a row are joined with those of
 * the row before (union-find over what is alive: at most two components a sample of a row). A component without a
 * run in the newest row is complete; if it is small all of it and its neighbours are still there, and it is filled.
 * When a row leaves, what was done to it is written down. So the result depends on the samples alone.
 *
 * Notes, one a row that has any: int32 row, runs, heights; then for each run int32 first, last, sea (0 or 1); then
 * the heights of those that are not sea.
 */
#include "parts.h"

#include <stdlib.h>
#include <string.h>

#define FILLED 2 /* in a row's validity, beside 0 and 1 */

typedef struct cell {
    int32_t x, y;
} cell;

typedef struct component {
    int32_t parent; /* itself: a root */
    int32_t x0, x1, y0, y1;
    cell some;    /* a sample of it */
    int32_t next; /* its number among those that go on */
    bool large;
} component;

typedef struct run {
    int32_t first, last, component;
} run;

struct import_fill {
    import_fill_options o;
    import_scratch *notes;
    uint64_t end; /* of the notes */
    int32_t rows, ring;
    int32_t *q; /* of the rows that are there, row y at y % ring */
    uint8_t *valid;
    component *components; /* those of the row before, then the new ones */
    component *kept;
    int32_t count;
    run *above, *runs;
    int32_t above_count, run_count;
    cell *cells; /* of one component */
    int32_t *note;
    int64_t filled, sea;
};

struct import_fill_reader {
    import_fill *fill;
    uint64_t at;
    int32_t *note; /* of one row */
    int32_t row, runs, next, heights;
    bool has_run;
    import_fill_run run;
};

static size_t side_of(int radius) {
    return 2 * (size_t)radius + 1;
}

/* Numbers of a row's note at most: every other sample a run, or all of them heights. */
static size_t note_length(int32_t width) {
    return 3 + 3 * ((size_t)width / 2 + 1) + (size_t)width;
}

size_t import_fill_bytes(int32_t width, int radius) {
    const size_t w = (size_t)width, side = side_of(radius);
    return (side + 2) * w * 5 + (w + 4) * 2 * sizeof(component) + (w + 4) * sizeof(run) +
           side * side * sizeof(cell) + 3 * note_length(width) * sizeof(int32_t);
}

bool import_fill_create(const import_job *job, const import_fill_options *options, import_fill **fill) {
    import_fill *f = *fill = calloc(1, sizeof *f);
    if (!f) return import_no_memory(job, "filling voids");
    const size_t w = (size_t)options->width, side = side_of(options->radius);
    f->o = *options;
    f->ring = (int32_t)side + 2;
    f->q = malloc((size_t)f->ring * w * sizeof *f->q);
    f->valid = malloc((size_t)f->ring * w);
    f->components = malloc((w + 4) * sizeof *f->components);
    f->kept = malloc((w + 4) * sizeof *f->kept);
    f->above = malloc((w / 2 + 2) * sizeof *f->above);
    f->runs = malloc((w / 2 + 2) * sizeof *f->runs);
    f->cells = malloc(side * side * sizeof *f->cells);
    f->note = malloc(note_length(options->width) * sizeof *f->note);
    if (!f->q || !f->valid || !f->components || !f->kept || !f->above || !f->runs || !f->cells || !f->note)
        return import_no_memory(job, "filling voids");
    return import_scratch_create(job, options->memory, &f->notes);
}

void import_fill_free(import_fill *f) {
    if (!f) return;
    import_scratch_free(f->notes);
    free(f->q);
    free(f->valid);
    free(f->components);
    free(f->kept);
    free(f->above);
    free(f->runs);
    free(f->cells);
    free(f->note);
    free(f);
}

static size_t at(const import_fill *f, int32_t x, int32_t y) {
    return (size_t)(y % f->ring) * (size_t)f->o.width + (size_t)x;
}

/* ------------------------------------------------------------------------------------------------- one void -- */
/* Halves up, of a negative quotient too. */
static int64_t quotient(int64_t a, int64_t b) {
    const int64_t n = 2 * a + b, d = 2 * b;
    return n >= 0 ? n / d : -((-n + d - 1) / d);
}

/* Distances are at most 2R + 1 = 511 and heights below 2^30: 4 * 511^3 * 2^30, doubled, is below 2^63. */
static int32_t height_of(const import_fill *f, int32_t x, int32_t y) {
    static const int way[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    int64_t distance[4], height[4], sum = 0, weights = 0;
    int n = 0;
    for (int i = 0; i < 4; i++) {
        int32_t u = x, v = y;
        do {
            u += way[i][0];
            v += way[i][1];
        } while (u >= 0 && u < f->o.width && v >= 0 && v < f->rows && f->valid[at(f, u, v)] != 1);
        if (u < 0 || u >= f->o.width || v < 0 || v >= f->rows) continue;
        distance[n] = abs(u - x) + abs(v - y);
        height[n++] = f->q[at(f, u, v)];
    }
    for (int i = 0; i < n; i++) {
        int64_t weight = 1;
        for (int j = 0; j < n; j++) weight *= j == i ? 1 : distance[j];
        sum += weight * height[i];
        weights += weight;
    }
    return (int32_t)quotient(sum, weights);
}

/* All samples of the component: they are FILLED from here on, and their heights follow. */
static void fill_component(import_fill *f, const component *c) {
    size_t count = 0;
    f->cells[count++] = c->some;
    f->valid[at(f, c->some.x, c->some.y)] = FILLED;
    for (size_t i = 0; i < count; i++) {
        const cell from = f->cells[i];
        for (int32_t v = from.y > c->y0 ? from.y - 1 : c->y0; v <= from.y + 1 && v <= c->y1; v++)
            for (int32_t u = from.x > c->x0 ? from.x - 1 : c->x0; u <= from.x + 1 && u <= c->x1; u++)
                if (!f->valid[at(f, u, v)]) {
                    f->valid[at(f, u, v)] = FILLED;
                    f->cells[count++] = (cell){u, v};
                }
    }
    for (size_t i = 0; i < count; i++) {
        const cell to = f->cells[i];
        f->q[at(f, to.x, to.y)] = height_of(f, to.x, to.y);
    }
    f->filled += (int64_t)count;
}

/* ------------------------------------------------------------------------------------------------ components -- */
static int32_t root_of(import_fill *f, int32_t i) {
    component *c = f->components;
    while (c[i].parent != i) i = c[i].parent = c[c[i].parent].parent;
    return i;
}

static void settle_size(const import_fill *f, component *c) {
    const int32_t most = 2 * f->o.radius, right = f->o.width - 1, bottom = f->o.height - 1;
    c->large = c->large || c->x1 - c->x0 > most || c->y1 - c->y0 > most || (c->x0 == 0 && c->x1 == right) ||
               (c->y0 == 0 && c->y1 == bottom);
}

static void join(import_fill *f, int32_t a, int32_t b) {
    component *c = f->components;
    a = root_of(f, a);
    b = root_of(f, b);
    if (a == b) return;
    c[b].parent = a;
    c[a].x0 = c[b].x0 < c[a].x0 ? c[b].x0 : c[a].x0;
    c[a].x1 = c[b].x1 > c[a].x1 ? c[b].x1 : c[a].x1;
    c[a].y0 = c[b].y0 < c[a].y0 ? c[b].y0 : c[a].y0;
    c[a].y1 = c[b].y1 > c[a].y1 ? c[b].y1 : c[a].y1;
    c[a].large = c[a].large || c[b].large;
}

/* The runs of the newest row, and what they join. */
static void find_runs(import_fill *f, int32_t y) {
    const uint8_t *valid = f->valid + at(f, 0, y);
    const int32_t width = f->o.width;
    int32_t over = 0; /* the first run above that may touch */
    f->run_count = 0;
    for (int32_t x = 0; x < width;) {
        const uint8_t *found = memchr(valid + x, 0, (size_t)(width - x));
        if (!found) break;
        run *r = &f->runs[f->run_count++];
        r->first = (int32_t)(found - valid);
        for (x = r->first; x < width && !valid[x]; x++) {
        }
        r->last = x - 1;
        r->component = f->count;
        f->components[f->count] = (component){.parent = f->count,
                                              .x0 = r->first,
                                              .x1 = r->last,
                                              .y0 = y,
                                              .y1 = y,
                                              .some = {r->first, y},
                                              .large = f->o.radius == 0};
        f->count++;
        while (over < f->above_count && f->above[over].last < r->first - 1) over++;
        for (int32_t i = over; i < f->above_count && f->above[i].first <= r->last + 1; i++)
            join(f, r->component, f->above[i].component);
    }
    for (int32_t i = 0; i < f->run_count; i++) settle_size(f, &f->components[root_of(f, f->runs[i].component)]);
}

/* Components that have no run in row y, the one after their last, are complete; the others go on. */
static void close_components(import_fill *f, int32_t y) {
    for (int32_t i = 0; i < f->count; i++) {
        component *c = &f->components[i];
        c->next = -1;
        if (c->parent != i || c->y1 >= y || c->large) continue;
        fill_component(f, c);
    }
    int32_t kept = 0;
    for (int32_t i = 0; i < f->run_count; i++) {
        component *c = &f->components[root_of(f, f->runs[i].component)];
        if (c->next < 0) {
            c->next = kept;
            f->kept[kept] = *c;
            f->kept[kept].parent = kept;
            kept++;
        }
        f->runs[i].component = c->next;
    }
    component *swap = f->components;
    f->components = f->kept;
    f->kept = swap;
    f->count = kept;
    run *runs = f->above;
    f->above = f->runs;
    f->above_count = f->run_count;
    f->runs = runs;
}

/* ----------------------------------------------------------------------------------------------------- notes -- */
/* Row y leaves: nothing can change it any more. */
static bool note_row(const import_job *job, import_fill *f, int32_t y) {
    const uint8_t *valid = f->valid + at(f, 0, y);
    const int32_t *q = f->q + at(f, 0, y), width = f->o.width;
    if (!memchr(valid, 0, (size_t)width) && !memchr(valid, FILLED, (size_t)width)) return true;
    int32_t runs = 0, heights = 0, *note = f->note;
    for (int32_t x = 0; x < width; x++) {
        const uint8_t kind = valid[x];
        if (kind == 1 || (kind == 0 && !f->o.sea)) continue;
        const int32_t first = x;
        while (x + 1 < width && valid[x + 1] == kind) x++;
        int32_t *r = note + 3 + 3 * runs++;
        r[0] = first;
        r[1] = x;
        r[2] = kind == 0;
        if (kind == FILLED)
            heights += x - first + 1;
        else
            f->sea += x - first + 1;
    }
    if (!runs) return true;
    int32_t *h = note + 3 + 3 * runs;
    for (int32_t i = 0; i < runs; i++) {
        const int32_t *r = note + 3 + 3 * i, n = r[1] - r[0] + 1;
        if (r[2]) continue;
        memcpy(h, q + r[0], (size_t)n * sizeof *h);
        h += n;
    }
    note[0] = y;
    note[1] = runs;
    note[2] = heights;
    const size_t size = (size_t)(h - note) * sizeof *note;
    if (!import_scratch_write(f->notes, f->end, note, size)) return import_scratch_refuse(job, f->notes);
    f->end += size;
    return true;
}

bool import_fill_row(const import_job *job, import_fill *f, const int32_t *q, const uint8_t *valid) {
    const int32_t y = f->rows;
    if (y >= f->ring && !note_row(job, f, y - f->ring)) return false;
    memcpy(f->q + at(f, 0, y), q, (size_t)f->o.width * sizeof *q);
    memcpy(f->valid + at(f, 0, y), valid, (size_t)f->o.width);
    f->rows++;
    find_runs(f, y);
    close_components(f, y);
    return true;
}

bool import_fill_end(const import_job *job, import_fill *f) {
    f->run_count = 0;
    close_components(f, f->rows);
    for (int32_t y = f->rows > f->ring ? f->rows - f->ring : 0; y < f->rows; y++)
        if (!note_row(job, f, y)) return false;
    return true;
}

int64_t import_fill_filled(const import_fill *f) {
    return f->filled;
}

int64_t import_fill_sea(const import_fill *f) {
    return f->sea;
}

/* --------------------------------------------------------------------------------------------------- reading -- */
bool import_fill_reader_create(const import_job *job, import_fill *fill, import_fill_reader **reader) {
    import_fill_reader *r = *reader = calloc(1, sizeof *r);
    if (!r) return import_no_memory(job, "filling voids");
    r->fill = fill;
    r->note = malloc(note_length(fill->o.width) * sizeof *r->note);
    return r->note || import_no_memory(job, "filling voids");
}

void import_fill_reader_free(import_fill_reader *r) {
    if (!r) return;
    free(r->note);
    free(r);
}

bool import_fill_next(const import_job *job, import_fill_reader *r, import_fill_run *out, bool *failed) {
    import_fill *f = r->fill;
    *failed = false;
    if (r->next == r->runs) {
        int32_t head[3];
        if (r->at >= f->end) return false;
        size_t size = sizeof head;
        bool ok = import_scratch_read(f->notes, r->at, head, size);
        r->at += size;
        size = ((size_t)head[1] * 3 + (size_t)head[2]) * sizeof *r->note;
        ok = ok && import_scratch_read(f->notes, r->at, r->note, size);
        r->at += size;
        *failed = !ok;
        if (!ok) return import_scratch_refuse(job, f->notes);
        r->row = head[0];
        r->runs = head[1];
        r->next = r->heights = 0;
    }
    const int32_t *n = r->note + (size_t)3 * (size_t)r->next++;
    *out = (import_fill_run){.row = r->row, .first = n[0], .last = n[1], .sea = n[2] != 0};
    if (!out->sea) {
        out->q = r->note + (size_t)3 * (size_t)r->runs + r->heights;
        r->heights += out->last - out->first + 1;
    }
    return true;
}

bool import_fill_apply(const import_job *job, import_fill_reader *r, int32_t row, int32_t *q, uint8_t *valid) {
    bool failed = false;
    while (r->has_run || (r->has_run = import_fill_next(job, r, &r->run, &failed))) {
        const import_fill_run *u = &r->run;
        if (u->row > row) return true;
        const size_t n = (size_t)(u->last - u->first + 1);
        if (u->row == row) {
            if (u->sea)
                for (size_t i = 0; i < n; i++) q[(size_t)u->first + i] = r->fill->o.sea_q;
            else
                memcpy(q + u->first, u->q, n * sizeof *q);
            if (valid) memset(valid + u->first, 1, n);
        }
        r->has_run = false;
    }
    return !failed;
}
