/* Stand-in until the sweep is there: one band only (b = K). */
#include "internal.h"
const rqt_grid *standin_grid;
#include <assert.h>
struct rqt_sweep {
    rqt_allocator a;
    rqt_sweep_plan plan;
    int32_t *q;
    uint8_t *valid;
    rqt_errors e;
};
size_t rqt_sweep_bytes(const rqt_sweep_plan *p) { 
    size_t rows = (((size_t)2<<p->b)+2); if (rows>(size_t)p->lattice.height) rows=(size_t)p->lattice.height;
    return (size_t)p->lattice.width * rows*8; }
rqt_status rqt_sweep_create(const rqt_sweep_plan *p, const rqt_allocator *a, rqt_sweep **s) {
    *s = memory_take(a, sizeof **s);
    memset(*s, 0, sizeof **s);
    (*s)->a = *a;
    (*s)->plan = *p;
    size_t n = (size_t)p->lattice.width * (size_t)p->lattice.height;
    (*s)->q = memory_take(a, n * 4);
    if (p->has_voids) (*s)->valid = memory_take(a, n);
    return RQT_OK;
}
void rqt_sweep_free(rqt_sweep *s) {
    if (!s) return;
    rqt_allocator a = s->a;
    rqt_errors_free(&s->e, &a);
    memory_drop(&a, s->q);
    memory_drop(&a, s->valid);
    memory_drop(&a, s);
}
static int32_t along(int32_t n, int b) { return n > 1 ? ((n - 2) >> b) + 1 : 1; }
int32_t rqt_sweep_bands(const rqt_sweep *s) { return along(s->plan.lattice.height, s->plan.b); }
int32_t rqt_sweep_tiles(const rqt_sweep *s) { return along(s->plan.lattice.width, s->plan.b); }
static int32_t clampy(int64_t y, int32_t n) { return y < n ? (int32_t)y : n - 1; }
static void expect(bool ok) { if (!ok) __builtin_trap(); }
bool rqt_sweep_wants(const rqt_sweep *s, int32_t y) { return y % (1 << s->plan.b) == 0 || y == s->plan.lattice.height - 1; }
void rqt_sweep_first(rqt_sweep *s, int32_t y, const int32_t *q, const uint8_t *v) {
    int32_t w = s->plan.lattice.width;
    expect(rqt_sweep_wants(s, y) && (v != NULL) == s->plan.has_voids);
    if (!standin_grid) return;
    for (int32_t x = 0; x < w; x++) if (x % (1 << s->plan.b) == 0 || x == w - 1) {
        size_t at = (size_t)y * (size_t)w + (size_t)x;
        bool valid = !standin_grid->valid || standin_grid->valid[at];
        expect(valid == (!v || v[x]));
        if (valid) expect(q[x] == standin_grid->q[at]);
    } }
void rqt_sweep_begin(rqt_sweep *s, int32_t band, int32_t *first, int32_t *count, int32_t **q, uint8_t **valid) {
    int32_t h = s->plan.lattice.height, from = band ? (band << s->plan.b) + 1 : 0, last = clampy((int64_t)(band + 1) << s->plan.b, h);
    *first = from; *count = last - from + 1;
    *q = s->q + (size_t)from * (size_t)s->plan.lattice.width;
    *valid = s->plan.has_voids ? s->valid + (size_t)from * (size_t)s->plan.lattice.width : NULL; }
void rqt_sweep_tile(rqt_sweep *s, int w, int32_t t) { (void)s; (void)w; (void)t; }
void rqt_sweep_end(rqt_sweep *s) {
    if (s->e.code) return;
    rqt_grid g = {s->plan.lattice, s->q, s->valid};
    if (standin_grid) g = *standin_grid;
    (void)rqt_errors_compute(&g, &s->plan.unit, &s->plan.cost, &s->a, NULL, NULL, &s->e);
    rqt_errors_saturate(&s->e); }
rqt_band rqt_sweep_band(const rqt_sweep *s, int32_t b) {
    int32_t h = s->plan.lattice.height, from = b << s->plan.b, last = clampy((int64_t)(b + 1) << s->plan.b, h);
    size_t at = (size_t)from * (size_t)s->plan.lattice.width;
    return (rqt_band){from, last - from + 1, s->q + at, s->valid ? s->valid + at : NULL, s, b}; }
rqt_code rqt_band_error(const rqt_band *b, rqt_vertex v, bool *o) {
    *o = false; if (rqt_vertex_scale(&b->sweep->plan.lattice, v) >= b->sweep->plan.b) return 0;
    return rqt_errors_at(&b->sweep->e, v, o); }
void rqt_band_errors(const rqt_band *b, int32_t x, int32_t y, int32_t step, int32_t n, rqt_code *c, uint8_t *o) {
    for (int32_t i = 0; i < n; i++) { bool bit; c[i] = rqt_band_error(b, (rqt_vertex){x + i * step, y}, &bit); if (o) o[i] = bit; } }
void rqt_sweep_finish(rqt_sweep *s) { (void)s; }
rqt_code rqt_sweep_coarse(const rqt_sweep *s, rqt_vertex v, int32_t *q, uint8_t *flags) {
    rqt_vertex c = rqt_vertex_clamp(&s->plan.lattice, v); size_t at = (size_t)c.y * (size_t)s->plan.lattice.width + (size_t)c.x;
    bool o; rqt_code code = rqt_errors_at(&s->e, v, &o); *q = s->q[at];
    *flags = (uint8_t)((!s->valid || s->valid[at] ? RQT_VALID : 0) | (o ? RQT_OUTLINE : 0)); return code; }
