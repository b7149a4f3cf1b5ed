/* fuzz_codes.c - numbers that come in: sides, vertices, block numbers, units, heights, errors, tolerances. */
#include "fuzz.h"

static void numbers_of_a_lattice(input *in) {
    rqt_lattice l;
    const int64_t width = take_between(in, 0, 3) ? take_between(in, -1, 300) : (int64_t)take_bits(in, 8),
                  height = take_between(in, 0, 3) ? take_between(in, -1, 300) : (int64_t)take_bits(in, 3);
    const rqt_status status = rqt_lattice_init(&l, width, height);
    const int64_t most = ((int64_t)1 << RQT_MAX_K) + 1;
    HOLD((status == RQT_OK) == (width >= 1 && width <= most && height >= 1 && height <= most), "%lld x %lld",
         (long long)width, (long long)height);
    if (status != RQT_OK) return;
    const int32_t side = 1 << l.K;
    HOLD(side + 1 >= width && side + 1 >= height && (l.K == 0 || side / 2 + 1 < (width > height ? width : height)),
         "K %d", l.K);
    const rqt_vertex v = {take_between(in, 0, side), take_between(in, 0, side)};
    rqt_vertex parent[2], child[4], back[4];
    const int parents = rqt_vertex_parents(&l, v, parent), scale = rqt_vertex_scale(&l, v);
    HOLD(rqt_vertex_level(&l, v) == l.K - scale && scale >= 0 && scale <= l.K, "scale %d", scale);
    for (int p = 0; p < parents; p++) {
        bool found = false;
        const int n = rqt_vertex_children(&l, parent[p], back);
        for (int c = 0; c < n; c++) found |= back[c].x == v.x && back[c].y == v.y;
        HOLD(found, "(%d,%d) is no child of its parent", v.x, v.y);
    }
    const int rank = rqt_vertex_rank(&l, v);
    HOLD(rank / 2 == scale && rank < RQT_RANKS, "rank %d, scale %d", rank, scale);
    for (int p = 0; p < parents; p++)
        HOLD(rqt_vertex_rank(&l, parent[p]) > rank, "(%d,%d) ranks no lower than its parent", v.x, v.y);
    const int children = rqt_vertex_children(&l, v, child);
    for (int c = 0; c < children; c++) {
        bool found = false;
        const int n = rqt_vertex_parents(&l, child[c], back);
        for (int p = 0; p < n; p++) found |= back[p].x == v.x && back[p].y == v.y;
        HOLD(found, "(%d,%d) is no parent of its child", v.x, v.y);
    }
    rqt_vertex end[2];
    const int ends = rqt_vertex_ends(&l, v, end);
    HOLD(ends == (scale < l.K ? 2 : 0), "%d ends", ends);
    for (int e = 0; e < ends; e++)
        HOLD(end[e].x >= 0 && end[e].y >= 0 && end[e].x <= side && end[e].y <= side &&
                 rqt_vertex_scale(&l, end[e]) > scale && end[0].x + end[1].x == 2 * v.x &&
                 end[0].y + end[1].y == 2 * v.y,
             "an end of (%d,%d)", v.x, v.y);
    const rqt_vertex s = rqt_vertex_clamp(&l, v);
    HOLD(s.x >= 0 && s.x < width && s.y >= 0 && s.y < height, "(%d,%d) is no sample", s.x, s.y);

    const int k = take_between(in, -1, 9);
    const rqt_block_number number = take_between(in, 0, 1) ? take_bits(in, 2) : take_bits(in, 8);
    rqt_block_place p;
    if (rqt_block_locate(&l, k, number, &p) != RQT_OK) return;
    HOLD(rqt_block_number_of(p.level, p.i, p.j) == number, "block %llu", (unsigned long long)number);
    HOLD(p.level >= 0 && p.level < rqt_block_levels(&l, k) && p.stride << k == p.side && p.width >= 1 &&
             p.width <= (1 << k) + 1 && p.height >= 1 && p.height <= (1 << k) + 1,
         "block %llu", (unsigned long long)number);
}

static void numbers_of_a_unit(input *in) {
    rqt_unit raw = {.z0 = (int64_t)take_bits(in, 8),
                    .d = (int32_t)take_bits(in, 4),
                    .numerator = (int32_t)take_bits(in, 4),
                    .denominator = (int32_t)take_bits(in, 4),
                    .scale = take_double(in),
                    .offset = take_double(in)};
    (void)rqt_unit_is_valid(&raw);
    const rqt_unit unit = rqt_unit_is_valid(&raw) ? raw : take_unit(in);
    const double quantum = fabs(rqt_unit_factor(&unit)) / unit.d;
    HOLD(quantum > 0 && isfinite(quantum), "quantum %g", quantum);
    const int32_t q = take_between(in, -RQT_HEIGHT_LIMIT + 1, RQT_HEIGHT_LIMIT - 1);
    HOLD(isfinite(rqt_unit_metres(&unit, q)), "%d", q);

    const uint64_t high = take_between(in, 0, 3) ? 0 : take_bits(in, 1),
                   low = take_bits(in, 1 + (int)(take_bits(in, 1) % 8));
    const uint64_t denominator = 1 + take_bits(in, 6) % ((uint64_t)1 << 42);
    const rqt_code code = rqt_code_from_quanta(&unit, high, low, denominator);
    const double metres = ((double)high * 0x1p64 + (double)low) / (double)denominator * quantum;
    /* Doubles are near enough to see a code that is off by one. */
    if (code < RQT_CODE_LARGEST) HOLD(rqt_code_metres(code) >= metres * (1 - 1e-12), "%g", metres);
    if (code > 0 && code < RQT_CODE_LARGEST)
        HOLD(rqt_code_metres((rqt_code)(code - 1)) <= metres * (1 + 1e-12), "%g", metres);
    if (low < UINT64_MAX) HOLD(rqt_code_from_quanta(&unit, high, low + 1, denominator) >= code, "order");

    const double cell = fabs(take_double(in)), c = fabs(take_double(in));
    if (cell > 0 && c > 0 && isfinite(cell) && isfinite(c)) {
        const int64_t extent = take_between(in, 0, 1 << RQT_MAX_K);
        const rqt_code ground = rqt_code_from_ground(extent, cell, c);
        HOLD(extent > 0 || ground == 0, "nothing costs %u", ground);
        HOLD(rqt_code_from_ground(extent + 1, cell, c) >= ground, "order");
    }
}

static void numbers_of_a_tolerance(input *in) {
    const rqt_code any = (rqt_code)take_bits(in, 2);
    if (any <= RQT_CODE_LARGEST) HOLD(rqt_code_floor(rqt_code_metres(any)) == any, "code %u", any);
    double eps = fabs(take_double(in)), lost = fabs(take_double(in));
    if (isnan(eps)) return;
    const rqt_code code = rqt_code_floor(eps);
    HOLD(rqt_code_metres(code) <= eps && code <= RQT_CODE_LARGEST, "%g", eps);
    if (code < RQT_CODE_LARGEST) HOLD(rqt_code_metres((rqt_code)(code + 1)) > eps, "%g", eps);
    if (!isfinite(lost)) lost = 0;
    const rqt_code less = rqt_code_eps(eps, lost);
    HOLD(less <= code, "eps %g, quantum error %g", eps, lost);
    if (isfinite(eps)) HOLD(rqt_code_metres(less) <= fmax(0, eps - lost), "eps %g, quantum error %g", eps, lost);
}

const long fuzz_runs = 20000;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size};
    numbers_of_a_lattice(&in);
    numbers_of_a_unit(&in);
    numbers_of_a_tolerance(&in);
    return 0;
}
