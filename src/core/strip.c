/* strip.c - one generalized triangle strip through a patch.
 *
 * The patch lists its triangles along a space-filling curve, so a triangle nearly always shares an edge with the
 * one before and the one after. Of a triangle whose first two vertices the strip ends in, the edge that the next
 * one shares says what to append: the third vertex alone, or one vertex again to turn the corner. Where the curve
 * jumps (another block, the region's rim, a void) repeated vertices make triangles without area. The parity is kept
 * throughout: triangle i is counter-clockwise as (i, i+1, i+2) for even i and as (i, i+2, i+1) for odd i.
 *
 * 1.5 to 1.65 indices a triangle on terrain; never more than 5. The walk (walk.c) says most triangles itself, for
 * it knows the edges from where it stands in the bintree, and gives the others to strip_put; the strip is the same.
 */
#include "walk.h"

#define CHUNK 1024 /* triangles between two looks at the memory */

static bool holds(const uint32_t *triangle, uint32_t vertex) {
    return triangle[0] == vertex || triangle[1] == vertex || triangle[2] == vertex;
}

void strip_say(strip_writer *w, const uint32_t now[3], const uint32_t *next) {
    uint32_t *s = w->s;
    size_t count = w->count;
    if (count >= 2) {
        const uint32_t u = s[count - 2], v = s[count - 1];
        const int at = now[0] == u ? 0 : now[1] == u ? 1 : now[2] == u ? 2 : -1;
        if (at >= 0) {
            /* Counter-clockwise the triangle at an even place is u, v, third; at an odd one u, third, v. */
            const uint32_t after = now[at == 2 ? 0 : at + 1], before = now[at == 0 ? 2 : at - 1];
            const bool even = (count & 1) == 0;
            if ((even ? after : before) == v) {
                const uint32_t third = even ? before : after;
                if (next && holds(next, u) && holds(next, third)) s[count++] = u;
                s[count++] = third;
                w->count = count;
                return;
            }
        }
    }
    /* A start: first the vertex that the next triangle does not have. */
    int first = 0;
    if (next)
        while (first < 2 && holds(next, now[first])) first++;
    const uint32_t a = now[first], b = now[(first + 1) % 3], c = now[(first + 2) % 3];
    if (count > 0) {
        s[count] = s[count - 1];
        s[count + 1] = a;
        count += 2;
    }
    const bool even = (count & 1) == 0;
    s[count++] = a;
    s[count++] = even ? b : c;
    s[count++] = even ? c : b;
    w->count = count;
}

void strip_put(strip_writer *w, const uint32_t triangle[3]) {
    if (w->waits) strip_say(w, w->waiting, triangle);
    memcpy(w->waiting, triangle, sizeof w->waiting);
    w->waits = true;
}

void strip_finish(strip_writer *w) {
    if (w->waits) strip_say(w, w->waiting, NULL);
    w->waits = false;
}

rqt_status rqt_strip_build(const rqt_patch *patch, const rqt_allocator *allocator, uint32_t **strip, size_t *n) {
    *strip = NULL;
    *n = 0;
    strip_writer w = {0};
    size_t capacity = 0;
    for (size_t t = 0; t < patch->triangle_count; t++) {
        if (t % CHUNK == 0 && !memory_grow(allocator, (void **)&w.s, &capacity,
                                           w.count + STRIP_MOST_PER_TRIANGLE * (CHUNK + 1), sizeof *w.s)) {
            memory_drop(allocator, w.s);
            return RQT_NO_MEMORY;
        }
        strip_put(&w, patch->triangles + 3 * t);
    }
    strip_finish(&w);
    *strip = w.s;
    *n = w.count;
    return RQT_OK;
}
