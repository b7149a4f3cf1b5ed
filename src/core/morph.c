/* morph.c - heights of one mesh's vertices on another mesh of the same terrain: what a geomorph needs.
 *
 * Let A and B be closed sets, U a closed set that holds both (their union, or B itself where A is part of it). Each
 * vertex of U has a height on the surface of A and one on that of B. Every leaf of U lies in a leaf of A and in one
 * of B: over it both surfaces are planes, and so is any mixture. So U's mesh with the heights (1-t) zA + t zB is,
 * at every place, (1-t) times A's surface plus t times B's: A at t = 0, B at t = 1, and no sample is further off
 * than (1-t) times what A allows plus t times what B does.
 *
 * A vertex P that is not in A lies in an edge of A's bintree, or in the middle of a triangle of it, halved again
 * and again; P itself halves an edge L-R, whose ends have a higher scale than P and are vertices of U. Over L-R A
 * is straight: zA(P) = (zA(L) + zA(R)) / 2. (Not the mean of P's parents in the dependency graph, which are the
 * apexes across the edge.) Scales rise from P to the ends, so at most K halvings: zA is a multiple of 2^-K quantum
 * below 2^30, which 50 bits hold. Doubles are exact here.
 *
 * Where the raster ends. Of a triangle that reaches past the last column or row the corners are clamped, and the
 * clamped children do not lie in the clamped parent (the middle of its hypotenuse is elsewhere): leaves of U are
 * not in leaves of A. So instead of A take A' = A and all vertices of U whose box (rule.c) reaches past the last
 * sample. Boxes lie in those of the parents, so with a vertex all of U that it depends on is in A', which is
 * closed. It holds A: what A allows holds for A'. And a triangle of A' that U splits further has its corners on the
 * raster, for its split vertex's box holds them. So there all is well again; near those ends, and there alone,
 * vertices do not move but are where they belong at once.
 *
 * Where A has no mesh. Leaves with a void corner are not kept, and a patch ends with its region. A vertex P that
 * is not in A has a height there iff it lies in a kept leaf of A: then one of the two triangles that P splits is in
 * that leaf. Upwards from such a triangle: if its apex is in A it is A's leaf, or there is none; else it lies in
 * the triangle that the apex splits, on the side of the end of L-R that is that triangle's apex. */
#include "internal.h"

#include <math.h>

enum {
    HEIGHT = 1,  /* height is known */
    FROM = 2,    /* a corner of a leaf of A */
    LEAF = 4,    /* and 8: the triangle of its diamond with its first (second) parent for an apex is a leaf of A */
    ASKED = 16,  /* and 32: is that triangle in a leaf of A? it is known */
    COVERED = 64 /* and 128: it is */
};

typedef struct node {
    uint64_t key; /* of the lattice vertex; 0: free */
    double height;
    uint32_t index; /* in the patch; RQT_NO_VERTEX */
    uint32_t flags;
} node;

typedef struct morph {
    const rqt_lattice *lattice;
    const rqt_patch *patch;
    const rqt_allocator *allocator;
    node *nodes;
    size_t size, count; /* size: a power of two, at least twice the count */
    bool failed;        /* no memory */
} morph;

static uint64_t key_of(rqt_vertex v) {
    return ((uint64_t)(uint32_t)v.y << 32 | (uint32_t)v.x) + 1;
}

/* The node of a vertex, or the free one where it belongs. */
static node *find(const morph *m, rqt_vertex v) {
    const uint64_t key = key_of(v);
    uint64_t h = key * UINT64_C(0x9E3779B97F4A7C15);
    h ^= h >> 32;
    for (size_t at = (size_t)h & (m->size - 1);; at = (at + 1) & (m->size - 1))
        if (m->nodes[at].key == key || m->nodes[at].key == 0) return &m->nodes[at];
}

static bool make_room(morph *m, size_t count) {
    size_t size = m->size ? m->size : 256;
    while (size < 2 * count) size *= 2;
    if (size == m->size) return true;
    morph larger = *m;
    larger.nodes = memory_take(m->allocator, size * sizeof *larger.nodes);
    if (!larger.nodes) return false;
    larger.size = size;
    memset(larger.nodes, 0, size * sizeof *larger.nodes);
    for (size_t i = 0; i < m->size; i++) {
        const uint64_t key = m->nodes[i].key - 1;
        if (m->nodes[i].key)
            *find(&larger, (rqt_vertex){(int32_t)(uint32_t)key, (int32_t)(key >> 32)}) = m->nodes[i];
    }
    memory_drop(m->allocator, m->nodes);
    *m = larger;
    return true;
}

/* The node of a vertex, made when there is none; NULL: no memory. Nodes move when one is made. */
static node *enter(morph *m, rqt_vertex v) {
    if (m->failed || !make_room(m, m->count + 1)) {
        m->failed = true;
        return NULL;
    }
    node *n = find(m, v);
    if (n->key == 0) {
        *n = (node){.key = key_of(v), .height = NAN, .index = RQT_NO_VERTEX};
        m->count++;
    }
    return n;
}

static bool is_same(rqt_vertex a, rqt_vertex b) {
    return a.x == b.x && a.y == b.y;
}

/* Does box(v) reach past the last column or row, where lattice and raster part? */
static bool is_near_end(const rqt_lattice *l, rqt_vertex v) {
    const int rank = rqt_vertex_rank(l, v);
    const int32_t half = (rank & 1 ? 3 : 2) << rank / 2, side = 1 << l->K;
    return (l->width - 1 < side && v.x + half > l->width - 1) ||
           (l->height - 1 < side && v.y + half > l->height - 1);
}

/* -------------------------------------------------------------------------------------------- the mesh A -- */

static void enter_corner(morph *m, rqt_vertex at, int32_t q) {
    node *n = enter(m, at);
    if (!n) return;
    n->flags |= FROM | HEIGHT;
    n->height = q;
}

static void enter_mesh(morph *m, const rqt_patch *from) {
    for (size_t t = 0; t < from->triangle_count; t++) {
        const rqt_triangle *leaf = &from->leaves[t];
        const uint32_t *corner = &from->triangles[3 * t];
        const rqt_vertex left = rqt_vertex_clamp(m->lattice, leaf->left);
        const rqt_patch_vertex *v = from->vertices;
        const bool in_order = v[corner[1]].col == left.x && v[corner[1]].row == left.y;
        enter_corner(m, leaf->apex, v[corner[0]].q);
        enter_corner(m, leaf->left, v[corner[in_order ? 1 : 2]].q);
        enter_corner(m, leaf->right, v[corner[in_order ? 2 : 1]].q);
        const int32_t x = leaf->left.x + leaf->right.x, y = leaf->left.y + leaf->right.y;
        if ((x | y) & 1) continue; /* it cannot be split */
        const rqt_vertex split = {x / 2, y / 2};
        rqt_vertex parents[2];
        const int n = rqt_vertex_parents(m->lattice, split, parents);
        node *at = enter(m, split);
        if (!at) return;
        for (int i = 0; i < n; i++)
            if (is_same(parents[i], leaf->apex)) at->flags |= (uint32_t)LEAF << i;
    }
}

/* ----------------------------------------------------------------------------------------------- questions -- */

static bool is_from(const morph *m, rqt_vertex v) {
    return find(m, v)->flags & FROM;
}

/* Is the triangle of v's diamond that has the side'th parent for an apex in a leaf of A? v is not in A. */
static bool is_covered(morph *m, rqt_vertex v, int side) {
    const uint32_t asked = (uint32_t)ASKED << side, covered = (uint32_t)COVERED << side;
    node *n = enter(m, v);
    if (!n) return false;
    if (n->flags & asked) return n->flags & covered;
    rqt_vertex parents[2], ends[2], apexes[2];
    (void)rqt_vertex_parents(m->lattice, v, parents);
    (void)rqt_vertex_ends(m->lattice, v, ends);
    const rqt_vertex apex = parents[side];
    bool yes = n->flags & (uint32_t)LEAF << side;
    if (!is_from(m, apex)) {
        const int count = rqt_vertex_parents(m->lattice, apex, apexes);
        for (int i = 0; i < count; i++)
            if (is_same(apexes[i], ends[0]) || is_same(apexes[i], ends[1])) yes = is_covered(m, apex, i);
    }
    find(m, v)->flags |= asked | (yes ? covered : 0);
    return yes;
}

/* Of a vertex in a leaf of A. NaN: it hangs on one near the raster's end that is in neither patch. */
static double height_of(morph *m, rqt_vertex v) {
    const node *n = enter(m, v);
    if (!n) return NAN;
    if (n->flags & HEIGHT) return n->height;
    double height = NAN;
    rqt_vertex ends[2];
    if (is_near_end(m->lattice, v)) {
        if (n->index != RQT_NO_VERTEX) height = m->patch->vertices[n->index].q;
    } else if (rqt_vertex_ends(m->lattice, v, ends) > 0) {
        const double one = height_of(m, ends[0]), other = height_of(m, ends[1]);
        height = (one + other) / 2;
    }
    node *known = find(m, v);
    known->height = height;
    known->flags |= HEIGHT;
    return height;
}

static double ask(morph *m, rqt_vertex v) {
    if (is_near_end(m->lattice, v) || is_from(m, v)) return height_of(m, v);
    rqt_vertex parents[2];
    const int sides = rqt_vertex_parents(m->lattice, v, parents);
    for (int side = 0; side < sides; side++)
        if (is_covered(m, v, side)) return height_of(m, v);
    return NAN;
}

static uint32_t index_of(const morph *m, rqt_vertex v) {
    const node *n = find(m, v);
    return n->key ? n->index : RQT_NO_VERTEX;
}

rqt_status rqt_morph_heights(const rqt_lattice *lattice, const rqt_patch *from, const rqt_patch *patch,
                             const rqt_allocator *allocator, double *heights, uint32_t *ends) {
    if ((from->triangle_count && !from->leaves) || patch->vertex_count >= RQT_NO_VERTEX) return RQT_INVALID;
    morph m = {.lattice = lattice, .patch = patch, .allocator = allocator};
    m.failed = !make_room(&m, from->vertex_count + from->triangle_count + patch->vertex_count + 1);
    enter_mesh(&m, from);
    for (size_t i = 0; i < patch->vertex_count; i++) {
        node *n = enter(&m, (rqt_vertex){patch->vertices[i].col, patch->vertices[i].row});
        if (n) n->index = (uint32_t)i;
    }
    for (size_t i = 0; i < patch->vertex_count && !m.failed; i++) {
        const rqt_vertex v = {patch->vertices[i].col, patch->vertices[i].row};
        heights[i] = ask(&m, v);
        if (!ends) continue;
        rqt_vertex at[2];
        const int n = is_near_end(lattice, v) ? 0 : rqt_vertex_ends(lattice, v, at);
        for (int e = 0; e < 2; e++) ends[2 * i + (size_t)e] = e < n ? index_of(&m, at[e]) : RQT_NO_VERTEX;
    }
    memory_drop(allocator, m.nodes);
    return m.failed ? RQT_NO_MEMORY : RQT_OK;
}
