/* coarse.c - the coarse lattice, kept during the first reading.
 *
 * The sweep wants it before the first band, as heights; but of rasters of floating-point numbers the quantum is
 * only known when all samples have been seen. So values are kept as they are, and become heights afterwards.
 */
#include "parts.h"

#include <stdlib.h>
#include <string.h>

/* Kept places along an axis: multiples of 2^b, and the last sample. */
static int32_t kept_along(int32_t samples, int b) {
    const int32_t last = samples - 1;
    return (last >> b) + 1 + ((last & ((1 << b) - 1)) != 0);
}

static int32_t place(int32_t n, int32_t samples, int b) {
    const int64_t at = (int64_t)n << b;
    return at < samples ? (int32_t)at : samples - 1;
}

size_t import_coarse_bytes(const rqt_lattice *lattice, import_kind kind, int b) {
    return (size_t)kept_along(lattice->width, b) * (size_t)kept_along(lattice->height, b) *
               (import_kind_bytes(kind) + 1) +
           (size_t)lattice->width * (sizeof(int32_t) + 1 + sizeof(double));
}

bool import_coarse_create(const import_job *job, const rqt_lattice *lattice, import_kind kind, int b,
                          import_coarse *c) {
    *c = (import_coarse){.b = b, .width = lattice->width, .height = lattice->height};
    c->columns = kept_along(lattice->width, b);
    c->rows = kept_along(lattice->height, b);
    c->kept = (import_strip){.kind = kind, .width = c->columns, .rows = c->rows};
    const size_t n = (size_t)c->columns * (size_t)c->rows;
    c->kept.values = malloc(n * import_kind_bytes(kind));
    c->kept.valid = malloc(n);
    return (c->kept.values && c->kept.valid) || import_no_memory(job, "keeping the coarse samples");
}

void import_coarse_free(import_coarse *c) {
    free(c->kept.values);
    free(c->kept.valid);
    *c = (import_coarse){0};
}

void import_coarse_keep(import_coarse *c, const import_strip *strip) {
    const size_t bytes = import_kind_bytes(strip->kind);
    for (int32_t row = strip->first_row >> c->b; row < c->rows; row++) {
        const int32_t y = place(row, c->height, c->b) - strip->first_row;
        if (y < 0) continue;
        if (y >= strip->rows) return;
        for (int32_t i = 0; i < c->columns; i++) {
            const size_t from = (size_t)y * (size_t)strip->width + (size_t)place(i, c->width, c->b);
            const size_t to = (size_t)row * (size_t)c->columns + (size_t)i;
            memcpy((char *)c->kept.values + to * bytes, (const char *)strip->values + from * bytes, bytes);
            c->kept.valid[to] = strip->valid[from];
        }
    }
}

bool import_coarse_give(const import_job *job, const import_coarse *c, const import_steps *steps, bool has_voids,
                        import_fill *fill, rqt_sweep *sweep) {
    const size_t width = (size_t)c->width, columns = (size_t)c->columns;
    int32_t *q = calloc(width, sizeof *q), *heights = malloc(columns * sizeof *heights);
    uint8_t *valid = calloc(width, 1);
    double *values = malloc(columns * sizeof *values);
    import_fill_reader *filled = NULL;
    const bool there = q && heights && valid && values;
    bool ok = there || import_no_memory(job, "keeping the coarse samples");
    if (ok && fill) ok = import_fill_reader_create(job, fill, &filled);
    for (int32_t row = 0; ok && row < c->rows; row++) {
        const int32_t y = place(row, c->height, c->b);
        if (!rqt_sweep_wants(sweep, y)) continue;
        const size_t at = (size_t)row * columns;
        import_quantise(&c->kept, at, columns, steps, values, heights);
        for (int32_t i = 0; i < c->columns; i++) {
            const int32_t x = place(i, c->width, c->b);
            /* ok: they are there. NOLINTBEGIN(clang-analyzer-core.NullDereference) */
            q[x] = heights[i];
            valid[x] = c->kept.valid[at + (size_t)i];
            /* NOLINTEND(clang-analyzer-core.NullDereference) */
        }
        if (fill) ok = import_fill_apply(job, filled, y, q, valid);
        rqt_sweep_first(sweep, y, q, has_voids ? valid : NULL);
    }
    import_fill_reader_free(filled);
    free(q);
    free(heights);
    free(valid);
    free(values);
    return ok;
}
