/* block_flags.c - validity and outline bits of a block that keeps all of its vertices (FORMAT.md, "Outline").
 *
 * A vertex has the outline bit when a triangle of its diamond is mixed, or when a child has it. The children are
 * known, going from fine to coarse, and whether the corners of a diamond agree says nearly always the rest. What is
 * stored is where this is wrong. Rows are words of 64 bits, so that a vertex costs less than an instruction. */
#include "block_predict.h"

/* Word w of a row whose bits are moved by s columns: to the right (bit x becomes bit x + s), or to the left. */
INLINE uint64_t moved(const uint64_t *row, int32_t words, int32_t w, int32_t s) {
    const int32_t size = s < 0 ? -s : s, bits = size % 64;
    const int32_t near = s < 0 ? w + size / 64 : w - size / 64, far = s < 0 ? near + 1 : near - 1;
    const uint64_t a = near >= 0 && near < words ? row[near] : 0, b = far >= 0 && far < words ? row[far] : 0;
    if (bits == 0) return a;
    return s < 0 ? a >> bits | b << (64 - bits) : a << bits | b >> (64 - bits);
}

typedef uint64_t bit_row[ROW_WORDS];

/* Bits first, first + step ... below end. */
static void mark(uint64_t *row, int32_t first, int32_t step, int32_t end) {
    memset(row, 0, sizeof(bit_row));
    for (int32_t x = first; x < end; x += step) row[x / 64] |= UINT64_C(1) << x % 64;
}

static bool bit_at(const bit_grid *grid, int32_t x, int32_t y) {
    return grid->row[y][x / 64] >> x % 64 & 1;
}

static void drop_bit(uint64_t *row, int32_t x) {
    row[x / 64] &= ~(UINT64_C(1) << x % 64);
}

/* One scale q. The vertices of a row are a mask: odd multiples of q in an H row and of centres, even ones in a V
 * row; and those that are not beyond the last sample, with a neighbour on the left, on the right. */
typedef struct outline_pass {
    flag_scratch *s;
    int32_t n, words, height, q;
    bit_row mask[2], before_last[2], left[2], right[2];
} outline_pass;

static void begin_scale(outline_pass *p, int32_t width, int32_t q) {
    const int32_t n = p->n, end = width - 1 + q < n ? width - 1 + q : n;
    p->q = q;
    for (int even = 0; even < 2; even++) {
        mark(p->mask[even], even ? 0 : q, 2 * q, n);
        mark(p->before_last[even], even ? 0 : q, 2 * q, end);
        memcpy(p->left[even], p->before_last[even], sizeof(bit_row));
        memcpy(p->right[even], p->before_last[even], sizeof(bit_row));
        drop_bit(p->left[even], 0);
        drop_bit(p->right[even], n - 1);
    }
}

/* The sides or centres of row y, at even or odd multiples of q. */
INLINE void code_row(bool restoring, const outline_pass *p, int32_t y, bool even, bool centre) {
    const int32_t q = p->q, h = q / 2, words = p->words;
    const bit_grid *valid = &p->s->valid, *known = &p->s->outline;
    static const bit_row nothing = {0};
    const bool over = y - q >= 0, under = y + q < p->n, looks = y - q < p->height - 1;
    uint64_t *outline = p->s->outline.row[y], *residual = p->s->residual.row[y];
    for (int32_t w = 0; w < words; w++) {
        const uint64_t own = valid->row[y][w];
        uint64_t expected = 0;
        if (looks && centre) {
            for (int dy = -q; dy <= q; dy += 2 * q)
                expected |= (moved(valid->row[y + dy], words, w, q) ^ own) |
                            (moved(valid->row[y + dy], words, w, -q) ^ own);
            expected &= p->before_last[even][w];
        } else if (looks) {
            expected = ((over ? valid->row[y - q][w] ^ own : 0) | (under ? valid->row[y + q][w] ^ own : 0)) &
                       p->before_last[even][w];
            expected |= (moved(valid->row[y], words, w, q) ^ own) & p->left[even][w];
            expected |= (moved(valid->row[y], words, w, -q) ^ own) & p->right[even][w];
        }
        if (centre) {
            expected |= known->row[y - q][w] | known->row[y + q][w];
            expected |= moved(known->row[y], words, w, q) | moved(known->row[y], words, w, -q);
        } else if (h > 0) {
            const uint64_t *above = over ? known->row[y - h] : nothing,
                           *below = under ? known->row[y + h] : nothing;
            expected |= moved(above, words, w, h) | moved(above, words, w, -h);
            expected |= moved(below, words, w, h) | moved(below, words, w, -h);
        }
        const uint64_t mask = p->mask[even][w];
        if (restoring)
            outline[w] |= (residual[w] ^ expected) & mask;
        else
            residual[w] |= (outline[w] ^ expected) & mask;
    }
}

INLINE void code_outline(bool restoring, flag_scratch *s, int k, int32_t width, int32_t height) {
    const int32_t n = (1 << k) + 1;
    outline_pass p = {.s = s, .n = n, .words = (n + 63) / 64, .height = height};
    for (int32_t q = 1; q < n - 1; q *= 2) {
        begin_scale(&p, width, q);
        for (int32_t y = 0; y < n; y += 2 * q) code_row(restoring, &p, y, false, false);
        for (int32_t y = q; y < n; y += 2 * q) code_row(restoring, &p, y, true, false);
        for (int32_t y = q; y < n; y += 2 * q) code_row(restoring, &p, y, false, true);
    }
}

static void take_bits(bit_grid *grid, int32_t n, const uint8_t *flags, int flag) {
    memset(grid, 0, (size_t)n * sizeof grid->row[0]);
    for (int32_t y = 0; y < n; y++)
        for (int32_t x = 0; x < n; x++)
            grid->row[y][x / 64] |= (uint64_t)((flags[y * n + x] & flag) != 0) << x % 64;
}

void predict_outline(flag_scratch *s, int k, int32_t width, int32_t height, const uint8_t *flags, uint8_t *bits) {
    const int32_t n = (1 << k) + 1;
    take_bits(&s->valid, n, flags, RQT_VALID);
    take_bits(&s->outline, n, flags, RQT_OUTLINE);
    memset(&s->residual, 0, (size_t)n * sizeof s->residual.row[0]);
    code_outline(false, s, k, width, height);
    memset(bits, 0, (size_t)(n * n + 7) / 8);
    for (int32_t i = 0; i < n * n; i++)
        bits[i / 8] = (uint8_t)(bits[i / 8] | bit_at(&s->residual, i % n, i / n) << i % 8);
}

/* ------------------------------------------------------------------------------------------ restoring */

/* What a run of bits holds. */
typedef struct bits_seen {
    bool ones, zeros;
} bits_seen;

/* n bits from bit `at` on. */
static void read_row(uint64_t *row, const uint8_t *bits, size_t at, int32_t n, bits_seen *seen) {
    memset(row, 0, sizeof(bit_row));
    for (int32_t x = 0; x < n; x += 64, at += 64) {
        const uint64_t low = get64(bits + at / 8) >> at % 8, all = ~UINT64_C(0);
        const uint64_t word = at % 8 ? low | (uint64_t)bits[at / 8 + 8] << (64 - at % 8) : low;
        const uint64_t mask = n - x >= 64 ? all : (UINT64_C(1) << (n - x)) - 1;
        row[x / 64] = word & mask;
        seen->ones |= (word & mask) != 0;
        seen->zeros |= (~word & mask) != 0;
    }
}

/* Past the last sample stands the last sample again. */
static void repeat_bits(bit_grid *grid, int32_t n, int32_t width, int32_t height) {
    for (int32_t y = 0; y < n; y++) {
        if (y >= height)
            memcpy(grid->row[y], grid->row[height - 1], sizeof(bit_row));
        else if (bit_at(grid, width - 1, y))
            for (int32_t x = width; x < n; x++) grid->row[y][x / 64] |= UINT64_C(1) << x % 64;
    }
}

/* 8 bits -> 8 bytes, each 0 or 1, the first in the lowest. */
INLINE uint64_t spread(uint64_t bits) {
    const uint64_t each = (bits & 255) * UINT64_C(0x0101010101010101) & UINT64_C(0x8040201008040201);
    return (each + UINT64_C(0x7F7F7F7F7F7F7F7F)) >> 7 & UINT64_C(0x0101010101010101);
}

static void put_flags(const uint64_t *valid, const uint64_t *outline, int32_t n, uint8_t *flags) {
    int32_t x = 0;
    for (; x + 8 <= n; x += 8)
        put64(flags + x,
              spread(valid[x / 64] >> x % 64) * RQT_VALID | spread(outline[x / 64] >> x % 64) * RQT_OUTLINE);
    for (; x < n; x++)
        flags[x] =
            (uint8_t)((valid[x / 64] >> x % 64 & 1) * RQT_VALID | (outline[x / 64] >> x % 64 & 1) * RQT_OUTLINE);
}

bool restore_flags(flag_scratch *s, const flag_source *from, uint8_t *flags) {
    const int32_t n = (1 << from->k) + 1, last = n - 1;
    if (!from->validity && !from->outline) {
        memset(flags, from->all_void ? 0 : RQT_VALID, (size_t)n * (size_t)n);
        return true;
    }
    bits_seen seen = {false, false}, ignored = seen;
    if (from->validity) {
        for (int32_t y = 0; y < from->height; y++)
            read_row(s->valid.row[y], from->validity, (size_t)y * (size_t)from->width, from->width, &seen);
        if (!seen.ones || !seen.zeros) return false;
        repeat_bits(&s->valid, n, from->width, from->height);
    } else {
        memset(&s->valid, from->all_void ? 0 : 255, (size_t)n * sizeof s->valid.row[0]);
    }
    memset(&s->outline, 0, (size_t)n * sizeof s->outline.row[0]);
    if (from->outline) {
        for (int32_t y = 0; y < n; y++)
            read_row(s->residual.row[y], from->outline, (size_t)y * (size_t)n, n, &ignored);
        for (int c = 0; c < 4; c++)
            if (bit_at(&s->residual, c & 1 ? last : 0, c & 2 ? last : 0)) return false;
        code_outline(true, s, from->k, from->width, from->height);
        uint64_t any = 0;
        for (int32_t y = 0; y < n; y++)
            for (int w = 0; w < ROW_WORDS; w++) any |= s->outline.row[y][w];
        if (!any) return false;
    }
    for (int32_t y = 0; y < n; y++) put_flags(s->valid.row[y], s->outline.row[y], n, flags + (ptrdiff_t)y * n);
    return true;
}
