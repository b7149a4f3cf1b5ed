/* wire_steps.h - a block of the wire format, for one direction. Included by wire_encode.c and wire_decode.c after
 * they have defined
 *
 *   uint64_t step_splits(w, stream, candidates, first, gap)  which of the candidates are vertices; the place of bit
 * i is first + i * gap void step_heights(w, stream, from)                       heights of the places in w->list,
 * each from the mean of four others int32_t step_height(w, stream, p, guess)                 the height of the
 * vertex at place p int step_some(w)                                         the children of a triangle in part: 3
 * * first + second
 *
 * Scale by scale, from the coarse to the fine, which places are vertices, as bitmaps: a vertex needs the four
 * around it, so what may be one at all is the conjunction of four rows, a word at a time. Then the heights of that
 * scale, in one loop over a list of places. When all are there, the walk, which has nothing left to decode but what
 * is outside the region.
 */

/* A row of places of one class, and what it is written with. */
typedef struct wire_line {
    uint32_t place, gap; /* of bit 0; between bits */
    int bits;            /* stream */
    int from[4];         /* where the heights are that predict one */
    bool looks_up;       /* other blocks may have had them */
} wire_line;

/* Where the height and the index of a place at or past the last sample are kept: with its sample. */
static inline wire_slot *slot_of(const wire_walk *w, uint32_t p) {
    const int32_t u = w->column[p], v = w->row[p];
    return &w->slot[u >= w->u_rim ? (v < w->v_rim ? v : w->v_rim) : w->n + u];
}

/* The first place of the block with the same sample. */
static inline uint32_t canonical(const wire_walk *w, uint32_t p) {
    const int32_t u = w->column[p], v = w->row[p];
    return (uint32_t)((v < w->v_rim ? v : w->v_rim) * w->n + (u < w->u_rim ? u : w->u_rim));
}

static inline int32_t mean_of(const int32_t *q, const int from[4]) {
    return (int32_t)(((int64_t)q[from[0]] + q[from[1]] + q[from[2]] + q[from[3]]) >> 2);
}

/* The height of a vertex that may have it from elsewhere: its sample, another block, the mesh before. */
static void take_height(wire_walk *w, uint32_t p, int32_t guess, int stream, bool looks_up) {
    const bool rim = w->kind[p] & WIRE_RIM;
    wire_slot *slot = rim ? slot_of(w, p) : NULL;
    w->memo[p] = WIRE_CHOSEN;
    if (rim && slot->has) {
        w->q[p] = slot->q;
        return;
    }
    const wire_entry *e = NULL, *before = NULL;
    if (looks_up || (w->kind[rim ? canonical(w, p) : p] & WIRE_NORTH_WEST))
        e = wire_table_find(&w->table, wire_sample(w, wire_at(w, p)));
    if (!e && w->prior.size) before = wire_table_find(&w->prior, wire_sample(w, wire_at(w, p)));
    w->q[p] = e ? e->q : before ? before->q : step_height(w, stream, p, guess);
    if (rim)
        *slot = (wire_slot){w->q[p], e ? e->index : WIRE_CHOSEN, true};
    else if (e)
        w->memo[p] = e->index;
}

/* Which of them are vertices because another block, or the mesh before, has them? They get their heights too. */
static uint64_t known_among(wire_walk *w, const wire_line *d, uint64_t candidates, uint32_t first) {
    uint64_t known = 0;
    for (uint64_t left = candidates; left; left &= left - 1) {
        const int i = __builtin_ctzll(left);
        const uint32_t p = first + (uint32_t)i * d->gap;
        const bool rim = w->kind[p] & WIRE_RIM;
        const wire_entry *e = d->looks_up && !rim ? wire_table_find(&w->table, wire_at(w, p)) : NULL;
        const wire_entry *before = w->prior.size ? wire_table_find(&w->prior, wire_at(w, p)) : NULL;
        if (!e && !(before && before->index == WIRE_CHOSEN)) continue;
        known |= UINT64_C(1) << i;
        if (e) {
            w->q[p] = e->q;
            w->memo[p] = e->index;
            continue;
        }
        take_height(w, p, mean_of(w->q + p, d->from), WIRE_EDGES, d->looks_up);
    }
    return known;
}

/* How many of the places from `first` on come before the last sample. */
static int count_inside(const wire_walk *w, uint32_t first, uint32_t gap, uint64_t places) {
    if (w->kind[first] & WIRE_RIM) return 0;
    if (gap >= (uint32_t)w->n) return 1; /* a single one */
    const int last = 63 - __builtin_clzll(places);
    const int64_t inside = ((int64_t)w->u_rim - w->column[first] + gap - 1) / gap;
    return inside > last ? 64 : (int)inside;
}

/* The places of a word's bits go to the list, four at a time: how many there are is a matter of chance. */
static inline void list_places(wire_walk *w, uint64_t places, uint32_t first, uint32_t gap, int count) {
    uint32_t *out = w->list + w->listed;
    w->listed += (size_t)count;
    for (; count > 0; count -= 4)
        for (int i = 0; i < 4; i++, places &= places - 1)
            *out++ = first + (uint32_t)__builtin_ctzll(places | UINT64_C(1) << 63) * gap;
}

static int count_bits(uint64_t v) {
    v -= v >> 1 & UINT64_C(0x5555555555555555);
    v = (v & UINT64_C(0x3333333333333333)) + (v >> 2 & UINT64_C(0x3333333333333333));
    return (int)(((v + (v >> 4)) & UINT64_C(0x0F0F0F0F0F0F0F0F)) * UINT64_C(0x0101010101010101) >> 56);
}

/* A word of a row inside the block: which of the candidates are vertices. Those before the last sample wait for
 * their heights. */
static inline uint64_t take_word(wire_walk *w, const wire_line *d, uint32_t word, uint64_t candidates) {
    if (!candidates) return 0;
    const uint32_t first = d->place + 64 * word * d->gap;
    const uint64_t known = w->prior.size ? known_among(w, d, candidates, first) : 0;
    const uint64_t fresh = step_splits(w, d->bits, candidates & ~known, first, d->gap);
    uint64_t outside = 0;
    if (w->clamped && fresh) {
        const int inside = count_inside(w, first, d->gap, fresh);
        outside = inside < 64 ? fresh >> inside << inside : 0;
    }
    list_places(w, fresh & ~outside, first, d->gap, count_bits(fresh & ~outside));
    for (; outside; outside &= outside - 1) {
        const uint32_t p = first + (uint32_t)__builtin_ctzll(outside) * d->gap;
        take_height(w, p, mean_of(w->q + p, d->from), WIRE_EDGES, false);
    }
    return fresh | known;
}

/* The same on a side of the block. */
static uint64_t take_side(wire_walk *w, const wire_line *d, uint32_t word, uint64_t candidates) {
    if (!candidates) return 0;
    const uint32_t first = d->place + 64 * word * d->gap;
    const uint64_t known = d->looks_up || w->prior.size ? known_among(w, d, candidates, first) : 0;
    const uint64_t fresh = step_splits(w, d->bits, candidates & ~known, first, d->gap);
    for (uint64_t left = fresh; left; left &= left - 1) {
        const uint32_t p = first + (uint32_t)__builtin_ctzll(left) * d->gap;
        take_height(w, p, mean_of(w->q + p, d->from), WIRE_EDGES, false);
    }
    return fresh | known;
}

/* The bits of the low half, two apart. */
static inline uint64_t spread(uint64_t v) {
    v &= UINT32_MAX;
    v = (v | v << 16) & UINT64_C(0x0000FFFF0000FFFF);
    v = (v | v << 8) & UINT64_C(0x00FF00FF00FF00FF);
    v = (v | v << 4) & UINT64_C(0x0F0F0F0F0F0F0F0F);
    v = (v | v << 2) & UINT64_C(0x3333333333333333);
    return (v | v << 1) & UINT64_C(0x5555555555555555);
}

/* A row of the grid at half the step: what was in it, and what is between. */
static inline void interleave(const wire_row *even, const wire_row *odd, wire_row *out, int words) {
    for (int j = 0; j < words; j++) {
        const int shift = 32 * (j & 1);
        out->word[j] = spread(even->word[j / 2] >> shift) | spread(odd->word[j / 2] >> shift) << 1;
    }
}

/* Both ends of each interval of a row. */
static inline uint64_t pairs(const wire_row *row, int j, int words) {
    return row->word[j] & (row->word[j] >> 1 | (j + 1 < words ? row->word[j + 1] << 63 : 0));
}

/* The row of sides that run across, between squares r - 1 and r. */
static uint64_t take_across(wire_walk *w, wire_line line, uint32_t m, uint32_t s, uint32_t r) {
    const int words = (int)m / 64 + 1;
    const bool is_side = r == 0 || r == m;
    uint64_t any = 0;
    line.place = 2 * r * s * (uint32_t)w->n + s;
    if (is_side) {
        line.bits = r == 0 ? WIRE_BITS_KNOWN : WIRE_BITS_SIDE;
        line.looks_up = r == 0;
        line.from[2] = line.from[0], line.from[3] = line.from[1];
    }
    for (int j = 0; j < words; j++) {
        uint64_t candidates = pairs(&w->grid[r], j, words);
        if (r > 0) candidates &= w->centres[r - 1].word[j];
        if (r < m) candidates &= w->centres[r].word[j];
        const uint64_t taken = (is_side ? take_side : take_word)(w, &line, (uint32_t)j, candidates);
        w->across[r].word[j] = taken;
        any |= taken;
    }
    return any;
}

/* The row of sides that run down, of the squares r: the first and the last are on sides of the block. */
static uint64_t take_down(wire_walk *w, wire_line line, uint32_t m, uint32_t s, uint32_t r) {
    const wire_row *const upper = &w->grid[r], *const lower = upper + 1, *const centre = &w->centres[r];
    wire_row *const down = &w->down[r];
    const int words = (int)m / 64 + 1;
    uint64_t any = 0;
    uint64_t some = 0;
    for (int j = 0; j < words; j++) {
        some |= centre->word[j];
        down->word[j] = 0;
    }
    if (!some) return 0;
    line.place = (2 * r + 1) * s * (uint32_t)w->n;
    wire_line side = line;
    side.from[0] = line.from[2], side.from[1] = line.from[3];
    side.bits = WIRE_BITS_KNOWN;
    side.looks_up = true;
    const uint64_t west = take_side(w, &side, 0, upper->word[0] & lower->word[0] & centre->word[0] & 1);
    for (int j = 0; j < words; j++) {
        const uint64_t carry = j > 0 ? centre->word[j - 1] >> 63 : 0;
        down->word[j] =
            take_word(w, &line, (uint32_t)j,
                      upper->word[j] & lower->word[j] & centre->word[j] & (centre->word[j] << 1 | carry));
        any |= down->word[j];
    }
    side.place += m * 2 * s;
    side.bits = WIRE_BITS_SIDE;
    side.looks_up = false;
    const uint64_t ends = upper->word[m / 64] & lower->word[m / 64];
    const uint64_t east =
        take_side(w, &side, 0, centre->word[(m - 1) / 64] >> ((m - 1) & 63) & ends >> (m & 63) & 1);
    down->word[m / 64] |= east << (m & 63);
    down->word[0] |= west;
    return any | west | east;
}

/* Vertices and heights of one scale. m: squares a side; s: half of theirs. False: there are none. */
static bool take_scale(wire_walk *w, uint32_t m, uint32_t s) {
    const int in = (int)s, is = in * w->n, words = (int)m / 64 + 1;
    const int sides = WIRE_BY_CLASS + WIRE_PER_CLASS * 2 * (w->shift + __builtin_ctz(s)),
              centres = sides + WIRE_PER_CLASS;
    uint64_t any = 0;
    wire_line line = {
        s * (uint32_t)w->n + s, 2 * s, centres + WIRE_BITS, {-is - in, -is + in, is - in, is + in}, false};
    w->listed = 0;
    for (uint32_t r = 0; r < m; r++, line.place += 2 * s * (uint32_t)w->n)
        for (int j = 0; j < words; j++) {
            const uint64_t candidates = pairs(&w->grid[r], j, words) & pairs(&w->grid[r + 1], j, words);
            w->centres[r].word[j] = take_word(w, &line, (uint32_t)j, candidates);
            any |= w->centres[r].word[j];
        }
    step_heights(w, centres + WIRE_TOKENS, line.from);
    if (!any) return false;
    line = (wire_line){0, 2 * s, sides + WIRE_BITS, {-in, in, -is, is}, false};
    w->listed = 0;
    any = 0;
    for (uint32_t r = 0; r <= m; r++) {
        any |= take_across(w, line, m, s, r);
        if (r < m) any |= take_down(w, line, m, s, r);
    }
    step_heights(w, sides + WIRE_TOKENS, line.from);
    return any;
}

/* Which places of the block are vertices, and their heights. */
static void take_vertices(wire_walk *w) {
    const uint32_t n = (uint32_t)w->n, last = n - 1, corner[4] = {0, last, last * n, last * n + last};
    for (int i = 0; i < 4; i++) {
        take_height(w, corner[i], w->last_q, WIRE_LOOSE, true);
        w->last_q = w->q[corner[i]];
    }
    w->grid[0] = w->grid[1] = (wire_row){{3}};
    for (uint32_t m = 1, s = last / 2; s > 0; m *= 2, s /= 2) {
        if (!take_scale(w, m, s) || s == 1) break;
        const int words = (int)(2 * m) / 64 + 1;
        for (uint32_t r = m + 1; r-- > 0;) { /* in place, from the end */
            const wire_row row = w->grid[r];
            if (r < m) interleave(&w->down[r], &w->centres[r], &w->grid[2 * r + 1], words);
            interleave(&row, &w->across[r], &w->grid[2 * r], words);
        }
    }
}

/* --------------------------------------------------------------------------------------------- the walk */

/* Has the clamped triangle no area? */
static inline bool is_flat(const wire_walk *w, uint32_t a, uint32_t l, uint32_t r) {
    if (w->column[a] >= w->u_rim && w->column[l] >= w->u_rim && w->column[r] >= w->u_rim) return true;
    return w->row[a] >= w->v_rim && w->row[l] >= w->v_rim && w->row[r] >= w->v_rim;
}

static inline bool is_inside(const wire_walk *w, uint32_t a, uint32_t l, uint32_t r) {
    return !((w->kind[a] | w->kind[l] | w->kind[r]) & WIRE_RIM);
}

static void walk_some(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, int splits, uint32_t clockwise);

/* A triangle that is in the patch as a whole. */
static void walk_full(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, int splits, uint32_t clockwise) {
    if (w->clamped && is_flat(w, a, l, r)) return;
    if (!w->leaves && (!w->clamped || is_inside(w, a, l, r))) {
        wire_list(w, a, l, r, splits, clockwise);
        return;
    }
    const uint32_t m = (l + r) / 2;
    if (splits > 0 && w->memo[m] != WIRE_NONE) {
        walk_full(w, m, l, a, splits - 1, !clockwise);
        walk_full(w, m, a, r, splits - 1, !clockwise);
    } else {
        wire_leaf(w, a, l, r, clockwise);
    }
}

static void walk_child(wire_walk *w, int amount, uint32_t a, uint32_t l, uint32_t r, int splits,
                       uint32_t clockwise) {
    if (amount == WIRE_EMPTY || w->bad) return;
    if (w->clamped && is_flat(w, a, l, r))
        w->bad = true;
    else
        (amount == WIRE_SOME ? walk_some : walk_full)(w, a, l, r, splits, clockwise);
}

/* A triangle of which some leaves are in the patch and some are not: it is split. */
static void walk_some(wire_walk *w, uint32_t a, uint32_t l, uint32_t r, int splits, uint32_t clockwise) {
    const uint32_t m = (l + r) / 2;
    const int amounts = splits > 0 && w->memo[m] != WIRE_NONE ? step_some(w) : -1;
    if (amounts < 1 || amounts > 8 || amounts == 3 * WIRE_FULL + WIRE_FULL) {
        w->bad = true;
        return;
    }
    walk_child(w, amounts / 3, m, l, a, splits - 1, !clockwise);
    walk_child(w, amounts % 3, m, a, r, splits - 1, !clockwise);
}

/* The parent's quarter: its far vertex is none of the block's. */
static void walk_quarter(wire_walk *w, int h, uint32_t apex, uint32_t center, uint32_t near) {
    const uint32_t far = (uint32_t)(w->n * w->n + h);
    const rqt_vertex a = wire_at(w, apex), b = wire_at(w, near), top = wire_at(w, center);
    const rqt_vertex f = w->far[h] = (rqt_vertex){2 * a.x - b.x, 2 * a.y - b.y};
    if (w->place.level == 0 || f.x < 0 || f.y < 0 || f.x > 1 << w->lattice.K || f.y > 1 << w->lattice.K) {
        w->bad = true;
        return;
    }
    const wire_entry *e = wire_table_find(&w->table, wire_sample(w, f)),
                     *before = w->prior.size ? wire_table_find(&w->prior, wire_sample(w, f)) : NULL;
    w->q[far] = e ? e->q : before ? before->q : step_height(w, WIRE_LOOSE, far, w->q[near]);
    const int64_t cross = (int64_t)(b.x - top.x) * (f.y - top.y) - (int64_t)(f.x - top.x) * (b.y - top.y);
    wire_leaf(w, center, near, far, cross < 0);
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
    take_vertices(w);
    for (int h = 0; h < 2 && !w->bad; h++) {
        const int *t = half[h];
        if (amount[h] == WIRE_QUARTER) {
            walk_quarter(w, h, corner[t[0]], corner[center], corner[c]);
            continue;
        }
        const int ax = t[0] & 1, ay = t[0] >> 1, fx = t[1] & 1, fy = t[1] >> 1, tx = t[2] & 1, ty = t[2] >> 1;
        const bool clockwise = (fx - ax) * (ty - ay) - (tx - ax) * (fy - ay) < 0;
        walk_child(w, amount[h], corner[t[0]], corner[t[1]], corner[t[2]], 2 * w->k, clockwise);
    }
    wire_block_end(w);
}
