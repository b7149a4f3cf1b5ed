/* border.c - mode `border`: the vertices that make a region's border a union of edges ([RQT] figure 11).
 *
 * R' is the union of the unit half cells whose interior meets that of R. A triangle of the bintree is *mixed* when
 * some of the unit half cells in it belong to R' and some do not. Split every mixed one, with all that its split
 * vertex depends on, and no leaf is mixed: each lies in R' or beside it. A leaf's interior meets R's iff that of
 * one of its half cells does, so the leaves that mode `cover` takes tile R'.
 *
 * Triangles that the raster's edge clamps do not nest: such a one is taken for mixed unless its clamped box is
 * inside R, or outside of it. A box holds those of the children, so below either there is nothing to force; half
 * cells of the lattice are before the last sample or have no area, so one that straddles can always be split.
 *
 * A half cell at R's border costs a question to the region, and the triangles around it a constant number: the work
 * is in step with the length of the border in samples, whatever the region's area. */
#include "region_edges.h"
#include "rule.h"

/* How much of a triangle is R'; WHOLE and NONE also say that nothing was forced in it. */
typedef enum amount { NONE, WHOLE, MIXED } amount;

typedef struct forcing {
    rqt_rule *rule;
    const rqt_lattice *lattice;
    const rqt_region *region;
    bool (*is_interrupted)(void *context);
    void *context;
    unsigned visited;
    rqt_status status;
} forcing;

#define PATIENCE 4096 /* triangles between two looks whether somebody wants to stop: about a millisecond */

static int32_t least_of(int32_t a, int32_t b, int32_t c) {
    const int32_t d = a < b ? a : b;
    return c < d ? c : d;
}
static int32_t most_of(int32_t a, int32_t b, int32_t c) {
    return -least_of(-a, -b, -c);
}

static amount visit(forcing *f, rqt_vertex a, rqt_vertex l, rqt_vertex r) {
    if (++f->visited % PATIENCE == 0 && f->is_interrupted && f->is_interrupted(f->context)) {
        f->status = RQT_INTERRUPTED;
        return NONE;
    }
    const rqt_vertex ca = rqt_vertex_clamp(f->lattice, a), cl = rqt_vertex_clamp(f->lattice, l),
                     cr = rqt_vertex_clamp(f->lattice, r);
    const rqt_relation relation =
        region_area_relation(f->region, least_of(ca.x, cl.x, cr.x), least_of(ca.y, cl.y, cr.y),
                             most_of(ca.x, cl.x, cr.x), most_of(ca.y, cl.y, cr.y));
    if (relation == RQT_OUTSIDE) return NONE; /* so are triangles without an area */
    if (relation == RQT_INSIDE) return WHOLE;
    const bool straddles =
        most_of(a.x, l.x, r.x) >= f->lattice->width || most_of(a.y, l.y, r.y) >= f->lattice->height;
    if (!straddles && !region_area_meets(f->region, a, l, r)) return NONE;
    if ((l.x + r.x) % 2 != 0) return WHOLE; /* a half cell of the lattice */
    const rqt_vertex m = {(l.x + r.x) / 2, (l.y + r.y) / 2};
    const amount first = visit(f, m, l, a), second = f->status == RQT_OK ? visit(f, m, a, r) : NONE;
    if (!straddles && first == WHOLE && second == WHOLE) return WHOLE;
    if (f->status == RQT_OK) f->status = rqt_rule_force(f->rule, m);
    return MIXED;
}

rqt_status rqt_rule_force_border(rqt_rule *rule, const rqt_region *region, bool (*is_interrupted)(void *context),
                                 void *context) {
    const rqt_lattice *lattice = rule_lattice(rule);
    const int32_t s = 1 << lattice->K;
    forcing f = {
        .rule = rule, .lattice = lattice, .region = region, .is_interrupted = is_interrupted, .context = context};
    (void)visit(&f, (rqt_vertex){s, 0}, (rqt_vertex){0, 0}, (rqt_vertex){s, s});
    if (f.status == RQT_OK) (void)visit(&f, (rqt_vertex){0, s}, (rqt_vertex){s, s}, (rqt_vertex){0, 0});
    return f.status;
}
