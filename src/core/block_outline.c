/* block_outline.c - the outline bits of a block that keeps all of its vertices (FORMAT.md, "Outline").
 *
 * A vertex has the bit when a triangle of its diamond is mixed, or when a child has it. The children are known,
 * going from fine to coarse, and whether the corners of a diamond agree says nearly always the rest. What is stored
 * is where this is wrong. Rows are words of 64 bits, so that a vertex costs less than an instruction. */
#include "block_predict.h"

/* out |= row moved by s columns, to the right (s > 0: bit x becomes bit x + s) or to the left. */
static inline void or_shifted(uint64_t *out, const uint64_t *row, int32_t s) {
    const int32_t size = s < 0 ? -s : s, words = size / 64, bits = size % 64;
    for (int32_t w = 0; w < ROW_WORDS; w++) {
        const int32_t near = s < 0 ? w + words : w - words, far = s < 0 ? near + 1 : near - 1;
        const uint64_t a = near >= 0 && near < ROW_WORDS ? row[near] : 0;
        const uint64_t b = bits && far >= 0 && far < ROW_WORDS ? row[far] : 0;
        out[w] |= s < 0 ? a >> bits | (bits ? b << (64 - bits) : 0) : a << bits | (bits ? b >> (64 - bits) : 0);
    }
}

/* Bits first, first + step ... below end. */
static inline void mask_of(uint64_t *mask, int32_t first, int32_t step, int32_t end) {
    memset(mask, 0, ROW_WORDS * sizeof *mask);
    for (int32_t x = first; x < end; x += step) mask[x / 64] |= UINT64_C(1) << x % 64;
}

static inline bool bit_at(const bit_grid *grid, int32_t x, int32_t y) {
    return grid->row[y][x / 64] >> x % 64 & 1;
}

typedef struct outline_pass {
    outline_scratch *s;
    int32_t n, width, height, q;
    bool restoring;
} outline_pass;

/* Where row y differs in validity from what stands dx, dy beside. */
static inline void or_difference(const outline_pass *p, uint64_t *out, int32_t y, int32_t dx, int32_t dy) {
    if (y + dy < 0 || y + dy >= p->n) return;
    uint64_t beside[ROW_WORDS] = {0};
    or_shifted(beside, p->s->valid.row[y + dy], -dx);
    for (int w = 0; w < ROW_WORDS; w++) out[w] |= beside[w] ^ p->s->valid.row[y][w];
}

static inline void or_children(const outline_pass *p, uint64_t *out, int32_t y, int32_t dx, int32_t dy) {
    if (y + dy >= 0 && y + dy < p->n) or_shifted(out, p->s->outline.row[y + dy], -dx);
}

/* The vertices first, first + 2q .. of row y: sides (of an H row or a V row) or centres. */
static inline void code_row(const outline_pass *p, int32_t y, int32_t first, bool centre) {
    const int32_t q = p->q, h = q / 2;
    uint64_t mask[ROW_WORDS], mixed[ROW_WORDS] = {0}, expected[ROW_WORDS] = {0}, inner[ROW_WORDS];
    mask_of(mask, first, 2 * q, p->n);
    if (y - q < p->height - 1) {
        const int32_t end = p->width - 1 + q < p->n ? p->width - 1 + q : p->n;
        if (centre) {
            for (int c = 0; c < 4; c++) or_difference(p, mixed, y, c & 1 ? q : -q, c & 2 ? q : -q);
            mask_of(inner, first, 2 * q, end);
        } else {
            or_difference(p, mixed, y, 0, -q);
            or_difference(p, mixed, y, 0, q);
            mask_of(inner, first, 2 * q, end);
            for (int w = 0; w < ROW_WORDS; w++) expected[w] = mixed[w] & inner[w];
            memset(mixed, 0, sizeof mixed);
            /* Beyond the block stands nothing. */
            or_difference(p, mixed, y, -q, 0);
            mask_of(inner, first ? first : 2 * q, 2 * q, end);
            for (int w = 0; w < ROW_WORDS; w++) expected[w] |= mixed[w] & inner[w];
            memset(mixed, 0, sizeof mixed);
            or_difference(p, mixed, y, q, 0);
            mask_of(inner, first, 2 * q, end < p->n - q ? end : p->n - q);
        }
        for (int w = 0; w < ROW_WORDS; w++) expected[w] |= mixed[w] & inner[w];
    }
    if (centre) {
        or_children(p, expected, y, -q, 0);
        or_children(p, expected, y, q, 0);
        or_children(p, expected, y, 0, -q);
        or_children(p, expected, y, 0, q);
    } else if (h > 0) {
        for (int c = 0; c < 4; c++) or_children(p, expected, y, c & 1 ? h : -h, c & 2 ? h : -h);
    }
    uint64_t *outline = p->s->outline.row[y], *residual = p->s->residual.row[y];
    for (int w = 0; w < ROW_WORDS; w++) {
        if (p->restoring)
            outline[w] |= (residual[w] ^ expected[w]) & mask[w];
        else
            residual[w] |= (outline[w] ^ expected[w]) & mask[w];
    }
}

static void code_outline(bool restoring, outline_scratch *s, int k, int32_t width, int32_t height) {
    outline_pass p = {s, (1 << k) + 1, width, height, 1, restoring};
    for (; p.q < p.n - 1; p.q *= 2) {
        for (int32_t y = 0; y < p.n; y += p.q) code_row(&p, y, y / p.q % 2 ? 0 : p.q, false);
        for (int32_t y = p.q; y < p.n; y += 2 * p.q) code_row(&p, y, p.q, true);
    }
}

static void take_bits(bit_grid *grid, int32_t n, const uint8_t *flags, int flag) {
    memset(grid, 0, (size_t)n * sizeof grid->row[0]);
    for (int32_t y = 0; y < n; y++)
        for (int32_t x = 0; x < n; x++)
            grid->row[y][x / 64] |= (uint64_t)((flags[y * n + x] & flag) != 0) << x % 64;
}

static void drop_corners(bit_grid *grid, int32_t n) {
    const int32_t last = n - 1;
    for (int32_t y = 0; y < n; y += last) {
        grid->row[y][0] &= ~UINT64_C(1);
        grid->row[y][last / 64] &= ~(UINT64_C(1) << last % 64);
    }
}

bool predict_outline(outline_scratch *s, int k, int32_t width, int32_t height, const uint8_t *flags,
                     uint8_t *bits) {
    const int32_t n = (1 << k) + 1;
    take_bits(&s->valid, n, flags, RQT_VALID);
    take_bits(&s->outline, n, flags, RQT_OUTLINE);
    drop_corners(&s->outline, n);
    uint64_t any = 0;
    for (int32_t y = 0; y < n; y++)
        for (int w = 0; w < ROW_WORDS; w++) any |= s->outline.row[y][w];
    if (!any) return false;
    memset(&s->residual, 0, (size_t)n * sizeof s->residual.row[0]);
    code_outline(false, s, k, width, height);
    memset(bits, 0, (size_t)(n * n + 7) / 8);
    for (int32_t i = 0; i < n * n; i++)
        bits[i / 8] = (uint8_t)(bits[i / 8] | bit_at(&s->residual, i % n, i / n) << i % 8);
    return true;
}

/* 8 bits -> 8 bytes, each 0 or 1. */
static inline uint64_t spread(uint64_t bits) {
    const uint64_t each = (bits & 255) * UINT64_C(0x0101010101010101) & UINT64_C(0x8040201008040201);
    return (each + UINT64_C(0x7F7F7F7F7F7F7F7F)) >> 7 & UINT64_C(0x0101010101010101);
}

static void add_bits(const uint64_t *row, int32_t n, uint8_t *flags) {
    int32_t x = 0;
    for (; x + 8 <= n; x += 8) put64(flags + x, get64(flags + x) | spread(row[x / 64] >> x % 64) * RQT_OUTLINE);
    for (; x < n; x++) flags[x] = (uint8_t)(flags[x] | (row[x / 64] >> x % 64 & 1) * RQT_OUTLINE);
}

/* n bits from bit `at` on. */
static void read_row(uint64_t *row, const uint8_t *bits, size_t at, int32_t n) {
    memset(row, 0, ROW_WORDS * sizeof *row);
    for (int32_t x = 0; x < n; x += 64, at += 64) {
        const uint64_t low = get64(bits + at / 8) >> at % 8;
        const uint64_t word = at % 8 ? low | (uint64_t)bits[at / 8 + 8] << (64 - at % 8) : low;
        row[x / 64] = n - x >= 64 ? word : word & ((UINT64_C(1) << (n - x)) - 1);
    }
}

bool restore_outline(outline_scratch *s, int k, int32_t width, int32_t height, const uint8_t *bits,
                     uint8_t *flags) {
    const int32_t n = (1 << k) + 1, last = n - 1;
    take_bits(&s->valid, n, flags, RQT_VALID);
    for (int32_t y = 0; y < n; y++) read_row(s->residual.row[y], bits, (size_t)y * (size_t)n, n);
    for (int c = 0; c < 4; c++)
        if (bit_at(&s->residual, c & 1 ? last : 0, c & 2 ? last : 0)) return false;
    memset(&s->outline, 0, (size_t)n * sizeof s->outline.row[0]);
    code_outline(true, s, k, width, height);
    uint64_t any = 0;
    for (int32_t y = 0; y < n; y++) {
        for (int w = 0; w < ROW_WORDS; w++) any |= s->outline.row[y][w];
        add_bits(s->outline.row[y], n, flags + (ptrdiff_t)y * n);
    }
    return any != 0;
}
