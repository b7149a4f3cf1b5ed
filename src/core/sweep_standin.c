/* Stand-in until the sweep is there: one band only (b = K). */
#include "internal.h"
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
int32_t rqt_sweep_bands(const rqt_sweep *s) { (void)s; return 1; }
int32_t rqt_sweep_tiles(const rqt_sweep *s) { (void)s; return 1; }
bool rqt_sweep_wants(const rqt_sweep *s, int32_t y) { (void)s; (void)y; return true; }
void rqt_sweep_first(rqt_sweep *s, int32_t y, const int32_t *q, const uint8_t *v) { (void)s; (void)y; (void)q; (void)v; }
void rqt_sweep_begin(rqt_sweep *s, int32_t band, int32_t *first, int32_t *count, int32_t **q, uint8_t **valid) {
    (void)band; *first = 0; *count = s->plan.lattice.height; *q = s->q; *valid = s->valid; }
void rqt_sweep_tile(rqt_sweep *s, int w, int32_t t) { (void)w; (void)t;
    rqt_grid g = {s->plan.lattice, s->q, s->valid};
    (void)rqt_errors_compute(&g, &s->plan.unit, &s->plan.cost, &s->a, NULL, NULL, &s->e);
    rqt_errors_saturate(&s->e); }
void rqt_sweep_end(rqt_sweep *s) { (void)s; }
rqt_band rqt_sweep_band(const rqt_sweep *s, int32_t b) { return (rqt_band){0, s->plan.lattice.height, s->q, s->valid, s, b}; }
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
