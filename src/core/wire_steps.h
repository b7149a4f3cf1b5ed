/* wire_steps.h - the walk of wire_walk.h, for one direction. Included by wire_encode.c and wire_decode.c after they
 * have defined
 *
 *   bool step_split(w, stream, a, l, r)     the bit: is the triangle split?
 *   bool step_expects(w, a, l, r, split)    coding: is it so? decoding: true
 *   int32_t step_height(w, stream, p, guess) the height of the vertex at place p
 *   int step_some(w)                        the children of a triangle in part: 3 * first + second
 *   void step_leaf(w, a, l, r)              a leaf was met
 */

static inline int32_t guess_of(const wire_walk *w, uint32_t l, uint32_t r) {
    return (int32_t)(((int64_t)w->q[l] + w->q[r]) >> 1);
}

static inline void remember(wire_walk *w, uint32_t p) {
    if (w->kind[p]) wire_table_insert(&w->table, wire_sample(w, wire_at(w, p)), w->q[p]);
}

/* Is the vertex at p, on a side or the rim, known from another block? Then take its height and index. */
static bool recall(wire_walk *w, uint32_t p) {
    const wire_entry *e = wire_table_find(&w->table, wire_sample(w, wire_at(w, p)));
    if (!e) return false;
    w->q[p] = e->q;
    w->memo[p] = e->index;
    w->state[p] = WIRE_VERTEX;
    return true;
}

static bool recall_prior(wire_walk *w, uint32_t p) {
    if (w->prior.size == 0) return false;
    const wire_entry *e = wire_table_find(&w->prior, wire_at(w, p));
    if (!e) return false;
    w->q[p] = e->q;
    w->state[p] = WIRE_VERTEX;
    return true;
}

/* The height of a corner that no hypotenuse predicts. */
static void settle(wire_walk *w, uint32_t p, bool even_rim) {
    if (w->state[p] == WIRE_VERTEX) return;
    if ((w->kind[p] & WIRE_RIM) && !even_rim) return;
    if (w->kind[p] && recall(w, p)) return;
    if (!recall_prior(w, p)) {
        w->q[p] = step_height(w, WIRE_LOOSE, p, w->q[p]);
        w->state[p] = WIRE_VERTEX;
        w->last_q = w->q[p];
    }
    remember(w, p);
}

/* The height of a split vertex inside the raster: from its diamond when the apex across is a vertex with a height.
 * Which it is is a matter of chance, so no branch. */
static inline void predict(wire_walk *w, uint32_t l, uint32_t r, uint32_t m, uint32_t a, uint32_t across, bool pair,
                           int stream) {
    const int64_t ends = (int64_t)w->q[l] + w->q[r], apexes = (int64_t)w->q[a] + w->q[across];
    const int64_t four = pair ? ends + apexes : 2 * ends;
    w->q[m] = step_height(w, stream + WIRE_TOKEN_LONE + pair, m, (int32_t)(four >> 2));
    w->state[m] = WIRE_VERTEX;
}

/* Is the split vertex m, on a side, on the rim or perhaps known beforehand, a vertex? */
static int decide_slowly(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, uint32_t m, int stream) {
    const uint8_t kind = w->kind[m];
    const bool inside = !(kind & WIRE_EDGE);
    const uint32_t across = inside ? l + r - a : 0;
    bool known = w->state[m] == WIRE_FORCED;
    if (recall_prior(w, m)) {
        known = true;
        if (kind && !recall(w, m)) remember(w, m);
    } else if (kind && !(kind & WIRE_RIM) && recall(w, m)) {
        known = true;
    }
    if (!known) {
        if (inside && w->state[across] == WIRE_NOT) {
            w->state[m] = WIRE_NOT;
        } else {
            int bits = stream + (inside && w->state[across] > WIRE_NOT ? WIRE_BITS_PAIR : WIRE_BITS_LONE);
            if (kind) bits = (kind & WIRE_NORTH_WEST) ? WIRE_BITS_KNOWN : WIRE_BITS_SIDE;
            if (!step_split(w, bits, a, l, r)) w->state[m] = WIRE_NOT;
        }
        if (w->state[m] == WIRE_NOT) return WIRE_NOT;
    }
    if (inside && w->state[across] == WIRE_UNKNOWN) w->state[across] = WIRE_FORCED;
    if (w->state[m] >= WIRE_VERTEX) return w->state[m];
    if (kind & WIRE_RIM) {
        w->q[m] = guess_of(w, l, r);
        w->state[m] = WIRE_GUESS;
    } else {
        predict(w, l, r, m, a, across, inside && w->state[across] > WIRE_NOT, stream);
        remember(w, m);
    }
    return w->state[m];
}

/* Is the triangle, whose split vertex is m, split? state: of m. */
static inline bool decide(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, uint32_t m, int splits, int state) {
    const int stream = w->streams + WIRE_PER_CLASS * splits;
    if (state == WIRE_GUESS) { /* split by a triangle that is in the patch in part */
        settle(w, m, false);
        return true;
    }
    if (w->kind[m] || w->prior.size) return decide_slowly(w, a, l, r, m, stream) > WIRE_NOT;
    const uint32_t across = l + r - a;
    const int other = w->state[across];
    const bool pair = other > WIRE_NOT;
    if (state == WIRE_UNKNOWN) {
        if (other == WIRE_NOT || !step_split(w, stream + WIRE_BITS_LONE + pair, a, l, r)) {
            w->state[m] = WIRE_NOT;
            return false;
        }
    } else if (other == WIRE_NOT) {
        w->bad = true; /* what depends on m is a vertex, and what m depends on is not */
    }
    w->state[across] = (uint16_t)(other | (other == WIRE_UNKNOWN)); /* WIRE_FORCED */
    predict(w, l, r, m, a, across, pair, stream);
    return true;
}

static inline bool is_split(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, uint32_t m, int splits) {
    const int state = w->state[m];
    if (state == WIRE_VERTEX) return true;
    return state != WIRE_NOT && decide(w, a, l, r, m, splits, state);
}

static inline void push_leaf(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, uint32_t clockwise) {
    step_leaf(w, a, l, r);
    uint32_t *out = w->triangles + 3 * w->triangle_count++;
    out[0] = a | clockwise;
    out[1] = l;
    out[2] = r;
}

/* A triangle that is in the patch as a whole. splits: how often it can be split on the block's grid. */
static void walk_full(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, int splits, uint32_t clockwise) {
    while (splits > 0) {
        const uint32_t m = (l + r) / 2;
        const bool split = is_split(w, a, l, r, m, splits);
        if (!step_expects(w, a, l, r, split)) return;
        if (!split) break;
        clockwise ^= WIRE_CLOCKWISE;
        if (--splits == 0)
            push_leaf(w, m, l, a, clockwise);
        else
            walk_full(w, m, l, a, splits, clockwise);
        l = a; /* and on with the second child */
        a = m;
    }
    push_leaf(w, a, l, r, clockwise);
}

/* Has the clamped triangle no area? */
static inline bool is_flat(const wire_walk *w, uint32_t a, uint32_t l, uint32_t r) {
    if (w->column[a] >= w->u_rim && w->column[l] >= w->u_rim && w->column[r] >= w->u_rim) return true;
    return w->row[a] >= w->v_rim && w->row[l] >= w->v_rim && w->row[r] >= w->v_rim;
}

/* The same in a block that reaches past the last sample. */
static void walk_clamped(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, int splits, uint32_t clockwise) {
    if (is_flat(w, a, l, r)) return;
    if (splits > 0) {
        const uint32_t m = (l + r) / 2;
        const bool split = is_split(w, a, l, r, m, splits);
        if (!step_expects(w, a, l, r, split)) return;
        if (split) {
            walk_clamped(w, m, l, a, splits - 1, clockwise ^ WIRE_CLOCKWISE);
            walk_clamped(w, m, a, r, splits - 1, clockwise ^ WIRE_CLOCKWISE);
            return;
        }
    }
    push_leaf(w, a, l, r, clockwise);
}

static void walk_some(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, int splits, uint32_t clockwise);

static void walk_child(wire_walk *w, int amount, uint32_t a, uint32_t l, uint32_t r, int splits,
                       uint32_t clockwise) {
    if (amount == WIRE_EMPTY || w->bad) return;
    if (w->clamped && is_flat(w, a, l, r)) {
        w->bad = true;
    } else if (amount == WIRE_SOME) {
        walk_some(w, a, l, r, splits, clockwise);
    } else {
        settle(w, a, false);
        settle(w, l, false);
        settle(w, r, false);
        (w->clamped ? walk_clamped : walk_full)(w, a, l, r, splits, clockwise);
    }
}

/* A triangle of which some leaves are in the patch and some are not: it is split. */
static void walk_some(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, int splits, uint32_t clockwise) {
    const uint32_t m = (l + r) / 2;
    const int amounts = splits > 0 && w->state[m] != WIRE_NOT ? step_some(w) : -1;
    if (amounts < 1 || amounts > 8 || amounts == 3 * WIRE_FULL + WIRE_FULL) {
        w->bad = true;
        return;
    }
    if (w->state[m] < WIRE_VERTEX) {
        w->q[m] = guess_of(w, l, r);
        w->state[m] = WIRE_GUESS;
        if (!(w->kind[m] & WIRE_EDGE) && w->state[l + r - a] == WIRE_UNKNOWN) w->state[l + r - a] = WIRE_FORCED;
        if (w->kind[m] && !(w->kind[m] & WIRE_RIM)) (void)recall(w, m);
    }
    walk_child(w, amounts / 3, m, l, a, splits - 1, clockwise ^ WIRE_CLOCKWISE);
    walk_child(w, amounts % 3, m, a, r, splits - 1, clockwise ^ WIRE_CLOCKWISE);
}

/* Indices for the leaves that wait, where several lattice vertices may be one sample. */
static void settle_slowly(wire_walk *w) {
    for (size_t t = w->settled; t < w->triangle_count; t++) {
        uint32_t *out = w->triangles + 3 * t, index[3];
        const uint32_t clockwise = out[0] & WIRE_CLOCKWISE, place[3] = {out[0] ^ clockwise, out[1], out[2]};
        if (w->leaves)
            w->leaves[t] = (rqt_triangle){wire_at(w, place[0]), wire_at(w, place[1]), wire_at(w, place[2])};
        for (int c = 0; c < 3; c++) {
            const uint32_t p = place[c];
            if (w->memo[p] == WIRE_NONE) {
                settle(w, p, true);
                wire_vertex_append(w, p);
            } else if (w->kind[p]) {
                wire_vertex_append(w, p); /* its level may be less than that of the vertex there */
            }
            index[c] = w->memo[p];
        }
        out[0] = index[0];
        out[1] = index[clockwise ? 1 : 2];
        out[2] = index[clockwise ? 2 : 1];
    }
    w->settled = w->triangle_count;
}

/* The block at hand: amount of its two halves. */
static void walk_block(wire_walk *w, const int amount[2]) {
    const rqt_block_place *p = &w->place;
    const uint32_t n = (uint32_t)w->n, last = n - 1, corner[4] = {0, last, last * n, last * n + last};
    /* As query.c walks them: apex, from, to of the two halves. */
    int half[2][3] = {{1, 0, 3}, {2, 3, 0}};
    const int c = (p->i & 1) | (p->j & 1) << 1, center = 3 - c;
    if (p->level > 0) {
        const int other[2][3] = {{c ^ 1, center, c}, {c ^ 2, c, center}};
        memcpy(half, other, sizeof half);
    }
    for (int i = 0; i < 4; i++) {
        w->q[corner[i]] = w->last_q;
        w->state[corner[i]] = WIRE_GUESS;
        if (!(w->kind[corner[i]] & WIRE_RIM) && recall(w, corner[i])) w->last_q = w->q[corner[i]];
    }
    for (int h = 0; h < 2 && !w->bad; h++) {
        const int *t = half[h];
        const uint32_t apex = corner[t[0]];
        if (amount[h] == WIRE_EMPTY) continue;
        if (amount[h] == WIRE_QUARTER) {
            const uint32_t far = n * n + (uint32_t)h, near = corner[c];
            const rqt_vertex a = wire_at(w, apex), b = wire_at(w, near);
            w->far[h] = (rqt_vertex){2 * a.x - b.x, 2 * a.y - b.y};
            const rqt_vertex f = w->far[h];
            if (p->level == 0 || f.x < 0 || f.y < 0 || f.x > 1 << w->lattice.K || f.y > 1 << w->lattice.K) {
                w->bad = true;
                return;
            }
            w->kind[far] =
                (uint8_t)(WIRE_EDGE | (f.x >= w->lattice.width - 1 || f.y >= w->lattice.height - 1 ? WIRE_RIM : 0));
            w->memo[far] = WIRE_NONE;
            w->state[far] = WIRE_GUESS;
            settle(w, near, true);
            w->q[far] = w->q[near];
            push_leaf(w, corner[center], near, far, 0);
            uint32_t *out = w->triangles + 3 * (w->triangle_count - 1);
            const rqt_vertex top = wire_at(w, corner[center]);
            const int64_t cross = (int64_t)(b.x - top.x) * (f.y - top.y) - (int64_t)(f.x - top.x) * (b.y - top.y);
            if (cross < 0) out[0] |= WIRE_CLOCKWISE;
            settle_slowly(w);
            continue;
        }
        const int ax = t[0] & 1, ay = t[0] >> 1, fx = t[1] & 1, fy = t[1] >> 1, tx = t[2] & 1, ty = t[2] >> 1;
        const bool clockwise = (fx - ax) * (ty - ay) - (tx - ax) * (fy - ay) < 0;
        walk_child(w, amount[h], apex, corner[t[1]], corner[t[2]], 2 * w->k, clockwise ? WIRE_CLOCKWISE : 0);
        if (w->bad) return;
        if (w->clamped)
            settle_slowly(w);
        else
            wire_settle_plain(w);
    }
}
