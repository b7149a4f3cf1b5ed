/* cover.c - what the places of the sources tell, without a sample: gaps that no source covers, and pairs that
 * overlap by more than a border.
 *
 * A sweep from north to south over the rows at which a source begins or ends. Between two of them the sources that
 * are there do not change: their union along the row leaves gaps, and a gap with the same columns as one of the
 * rows above goes on. Gaps that touch make one hole; a hole that reaches the edge of the terrain is not inside it.
 */
#include "source.h"

#include <stdlib.h>
#include <string.h>

typedef struct event {
    int32_t row;
    int32_t source;
} event;

typedef struct span { /* of columns, first .. last */
    int32_t first, last;
} span;

typedef struct sweep {
    const import_source *sources;
    const import_mosaic *mosaic;
    import_cover *cover;
    int32_t *active; /* sources that meet the rows of the moment */
    int actives;
    span *spans;
    size_t above, above_end; /* gaps that reach the row above, among cover->gap */
    size_t room_gaps, room_overlaps;
} sweep;

static int by_row(const void *a, const void *b) {
    const event *x = a, *y = b;
    return x->row != y->row ? (x->row < y->row ? -1 : 1) : (x->source > y->source) - (x->source < y->source);
}

static int by_first(const void *a, const void *b) {
    const span *x = a, *y = b;
    return (x->first > y->first) - (x->first < y->first);
}

static void *grown(void *array, size_t count, size_t *room, size_t size) {
    if (count < *room) return array;
    const size_t more = *room ? 2 * *room : 64;
    void *larger = realloc(array, more * size);
    if (larger) *room = more;
    return larger;
}

/* ------------------------------------------------------------------------------------------------- overlaps -- */
static bool add_overlap(sweep *w, int32_t a, int32_t b) {
    const import_mosaic *m = w->mosaic;
    const import_source *s = &w->sources[a], *t = &w->sources[b];
    import_window o = {.column0 = m->column[a] > m->column[b] ? m->column[a] : m->column[b],
                       .row0 = m->row[a] > m->row[b] ? m->row[a] : m->row[b]};
    const int32_t right = m->column[a] + s->width - 1, other = m->column[b] + t->width - 1;
    const int32_t bottom = m->row[a] + s->height - 1, below = m->row[b] + t->height - 1;
    o.column1 = right < other ? right : other;
    o.row1 = bottom < below ? bottom : below;
    if (o.column1 <= o.column0 || o.row1 <= o.row0) return true; /* nothing, or a border */
    import_overlap *list =
        grown(w->cover->overlap, w->cover->overlaps, &w->room_overlaps, sizeof *w->cover->overlap);
    if (!list) return false;
    w->cover->overlap = list;
    list[w->cover->overlaps++] = (import_overlap){.a = a < b ? a : b, .b = a < b ? b : a, .window = o};
    return true;
}

/* A source begins: those that are there already may share more than a border with it. */
static bool begin_source(sweep *w, int32_t source) {
    for (int i = 0; i < w->actives; i++)
        if (!add_overlap(w, w->active[i], source)) return false;
    w->active[w->actives++] = source;
    return true;
}

/* ----------------------------------------------------------------------------------------------------- gaps -- */
static size_t root_of(import_gap *gap, size_t i) {
    while (gap[i].hole != i) i = gap[i].hole = gap[gap[i].hole].hole;
    return i;
}

/* Two gaps touch: one hole, which is inside if both were. */
static void join(import_gap *gap, size_t a, size_t b) {
    a = root_of(gap, a);
    b = root_of(gap, b);
    if (a == b) return;
    const size_t first = a < b ? a : b, second = a < b ? b : a;
    gap[second].hole = first;
    gap[first].inside = gap[first].inside && gap[second].inside;
}

/* The columns between the spans, from row `top` to `bottom`. *count: how many gaps the cover has afterwards. */
static bool add_gap(sweep *w, span columns, int32_t top, int32_t bottom) {
    import_cover *c = w->cover;
    const rqt_lattice *l = &w->mosaic->lattice;
    import_gap *list = grown(c->gap, c->gaps, &w->room_gaps, sizeof *c->gap);
    if (!list) return false;
    c->gap = list;
    const bool edge = columns.first == 0 || top == 0 || columns.last == l->width - 1 || bottom == l->height - 1;
    list[c->gaps] =
        (import_gap){.window = {columns.first, top, columns.last, bottom}, .hole = c->gaps, .inside = !edge};
    for (size_t i = w->above; i < w->above_end; i++)
        if (list[i].window.row1 == top - 1 && list[i].window.column0 <= columns.last &&
            columns.first <= list[i].window.column1)
            join(list, i, c->gaps);
    c->gaps++;
    return true;
}

/* Rows top .. bottom, between which no source begins or ends. */
static bool sweep_rows(sweep *w, int32_t top, int32_t bottom) {
    import_cover *c = w->cover;
    for (int i = 0; i < w->actives; i++) {
        const int32_t s = w->active[i];
        w->spans[i] = (span){w->mosaic->column[s], w->mosaic->column[s] + w->sources[s].width - 1};
    }
    qsort(w->spans, (size_t)w->actives, sizeof *w->spans, by_first);
    const size_t first = c->gaps;
    int32_t next = 0; /* column that is not known to be covered */
    for (int i = 0; i <= w->actives; i++) {
        const int32_t begin = i < w->actives ? w->spans[i].first : w->mosaic->lattice.width;
        if (begin > next && !add_gap(w, (span){next, begin - 1}, top, bottom)) return false;
        if (i < w->actives && w->spans[i].last >= next) next = w->spans[i].last + 1;
    }
    w->above = first;
    w->above_end = c->gaps;
    return true;
}

/* Gaps of the same columns, one right below the other, are one. They come in the order of rows. */
static void merge_gaps(import_cover *c) {
    for (size_t i = 0; i < c->gaps; i++) {
        const size_t root = root_of(c->gap, i);
        c->gap[i].inside = c->gap[root].inside;
    }
    size_t kept = 0;
    for (size_t i = 0; i < c->gaps; i++) {
        const import_gap g = c->gap[i];
        size_t j = kept;
        while (j > 0 && !(c->gap[j - 1].window.row1 == g.window.row0 - 1 &&
                          c->gap[j - 1].window.column0 == g.window.column0 &&
                          c->gap[j - 1].window.column1 == g.window.column1))
            j--;
        if (j > 0)
            c->gap[j - 1].window.row1 = g.window.row1;
        else
            c->gap[kept++] = g;
    }
    c->gaps = kept;
}

int64_t import_window_samples(const import_window *w) {
    return (int64_t)(w->column1 - w->column0 + 1) * (w->row1 - w->row0 + 1);
}

static int compare_windows(const import_window *a, const import_window *b) {
    const int64_t x = import_window_samples(a), y = import_window_samples(b);
    if (x != y) return x > y ? -1 : 1;
    if (a->row0 != b->row0) return a->row0 < b->row0 ? -1 : 1;
    return (a->column0 > b->column0) - (a->column0 < b->column0);
}

/* Holes inside first: they are where a tile is missing; the others may be the shape of a country. */
static int by_worst_gap(const void *a, const void *b) {
    const import_gap *x = a, *y = b;
    return x->inside != y->inside ? (x->inside ? -1 : 1) : compare_windows(&x->window, &y->window);
}

static int by_worst_overlap(const void *a, const void *b) {
    const import_overlap *x = a, *y = b;
    const int order = compare_windows(&x->window, &y->window);
    return order ? order : x->a != y->a ? (x->a < y->a ? -1 : 1) : (x->b > y->b) - (x->b < y->b);
}

static bool sweep_all(sweep *w, int count, event *begins, event *ends) {
    int b = 0, e = 0;
    for (int i = 0; i < count; i++) {
        begins[i] = (event){w->mosaic->row[i], i};
        ends[i] = (event){w->mosaic->row[i] + w->sources[i].height, i};
    }
    qsort(begins, (size_t)count, sizeof *begins, by_row);
    qsort(ends, (size_t)count, sizeof *ends, by_row);
    for (int32_t row = 0; row < w->mosaic->lattice.height;) {
        for (; e < count && ends[e].row <= row; e++)
            for (int i = 0; i < w->actives; i++)
                if (w->active[i] == ends[e].source) {
                    w->active[i] = w->active[--w->actives];
                    break;
                }
        for (; b < count && begins[b].row <= row; b++)
            if (!begin_source(w, begins[b].source)) return false;
        int32_t next = w->mosaic->lattice.height;
        if (b < count && begins[b].row < next) next = begins[b].row;
        if (e < count && ends[e].row < next) next = ends[e].row;
        if (!sweep_rows(w, row, next - 1)) return false;
        row = next;
    }
    return true;
}

bool import_cover_find(const import_job *job, const import_source *sources, int count, const import_mosaic *mosaic,
                       import_cover *cover) {
    *cover = (import_cover){0};
    const size_t n = (size_t)count;
    sweep w = {.sources = sources, .mosaic = mosaic, .cover = cover};
    event *begins = malloc(n * sizeof *begins), *ends = malloc(n * sizeof *ends);
    w.active = malloc(n * sizeof *w.active);
    w.spans = malloc(n * sizeof *w.spans);
    bool ok = begins && ends && w.active && w.spans && sweep_all(&w, count, begins, ends);
    if (ok) {
        merge_gaps(cover);
        if (cover->gaps) qsort(cover->gap, cover->gaps, sizeof *cover->gap, by_worst_gap);
        if (cover->overlaps) qsort(cover->overlap, cover->overlaps, sizeof *cover->overlap, by_worst_overlap);
    }
    free(begins);
    free(ends);
    free(w.active);
    free(w.spans);
    return ok || import_no_memory(job, "looking for gaps between the sources");
}

void import_cover_free(import_cover *cover) {
    free(cover->gap);
    free(cover->overlap);
    *cover = (import_cover){0};
}
