/* error_kernels_rows.h - large triangles, row by row. Included by error_kernels.c once for each processor. */

static inline int32_t NAME(span_left)(const row_spans *s, int32_t k) {
    const int32_t x = s->left + k * s->left_step;
    return x > s->low ? x : s->low;
}

static inline int32_t NAME(span_right)(const row_spans *s, int32_t k) {
    const int32_t x = s->right + k * s->right_step;
    return x < s->high ? x : s->high;
}

static uint32_t NAME(rows_32)(const int32_t *z, size_t stride, const row_spans *spans, int m, uint32_t start,
                              uint32_t gx, uint32_t gy) {
    static const int32_t count[LANES] = {0, 1, 2, 3, 4, 5, 6, 7};
    lanes_i index;
    memcpy(&index, count, sizeof index);
    const lanes_u ramp = (lanes_u)index * gx;
    const uint32_t step = LANES * gx;
    lanes_u most = {0}, also = {0};
    for (int32_t k = 0; k < spans->rows; k++, z += stride) {
        int32_t x = NAME(span_left)(spans, k);
        const int32_t end = NAME(span_right)(spans, k) + 1;
        if (x >= end) continue;
        lanes_u plane = ramp + (start + (uint32_t)k * gy + (uint32_t)x * gx);
        for (; x + 2 * LANES <= end; x += 2 * LANES) {
            lanes_u one, two;
            memcpy(&one, z + x, sizeof one);
            memcpy(&two, z + x + LANES, sizeof two);
            const lanes_u next = plane + step;
            one = LANES_ABS((lanes_i)((one << m) - plane));
            two = LANES_ABS((lanes_i)((two << m) - next));
            most = LANES_MAX(most, one);
            also = LANES_MAX(also, two);
            plane = next + step;
        }
        if (x + LANES <= end) {
            lanes_u one;
            memcpy(&one, z + x, sizeof one);
            most = LANES_MAX(most, LANES_ABS((lanes_i)((one << m) - plane)));
            plane += step;
            x += LANES;
        }
        if (x < end) {
            const lanes_i wanted = index < end - x;
            lanes_u one = {0};
#ifdef LANES_AVX2
            one = (lanes_u)_mm256_maskload_epi32(z + x, (__m256i)wanted);
#else
            for (int i = 0; i < end - x; i++) one[i] = (uint32_t)z[x + i];
#endif
            also = LANES_MAX(also, LANES_ABS((lanes_i)((one << m) - plane)) & (lanes_u)wanted);
        }
    }
    most = LANES_MAX(most, also);
    uint32_t out = 0;
    for (int i = 0; i < LANES; i++) out = most[i] > out ? most[i] : out;
    return out;
}

/* In doubles, whose sums are exact here: heights have 31 bits, planes m <= 20 more behind the point. */
static uint64_t NAME(rows_64)(const int32_t *z, size_t stride, const row_spans *spans, int m, int64_t start,
                              int64_t gx, int64_t gy) {
    const double scale = bits_double((uint64_t)(1023 - m) << 52);
    const double slope = (double)gx * scale;
    const lanes_d ramp = (lanes_d){0, 1, 2, 3} * slope;
    lanes_d most = {0}, also = {0};
    double rest = 0;
    for (int32_t k = 0; k < spans->rows; k++, z += stride) {
        int32_t x = NAME(span_left)(spans, k);
        const int32_t end = NAME(span_right)(spans, k) + 1;
        double plane = (double)(start + k * gy + x * gx) * scale;
        lanes_d planes = ramp + plane;
        for (; x + 8 <= end; x += 8, plane += 8 * slope, planes += 8 * slope) {
            lanes_q one, two;
            memcpy(&one, z + x, sizeof one);
            memcpy(&two, z + x + 4, sizeof two);
            const lanes_d d = __builtin_convertvector(one, lanes_d) - planes;
            const lanes_d e = __builtin_convertvector(two, lanes_d) - (planes + 4 * slope);
            RAISE_DOUBLES(most, d);
            RAISE_DOUBLES(also, e);
        }
        for (; x < end; x++, plane += slope) {
            const double d = z[x] - plane, size = d < 0 ? -d : d;
            rest = size > rest ? size : rest;
        }
    }
    for (int i = 0; i < 4; i++) {
        rest = most[i] > rest ? most[i] : rest;
        rest = also[i] > rest ? also[i] : rest;
    }
    return (uint64_t)(rest * bits_double((uint64_t)(1023 + m) << 52));
}

/* max over n samples of |(z[i] - base) * area - (start + i * slope)|; see error_kernels.h. */
static double NAME(row_double)(const int32_t *z, int32_t n, int32_t base, double area, double start, double slope) {
    lanes_d most = {0}, plane = (lanes_d){0, 1, 2, 3} * slope + start;
    double rest = 0;
    int32_t i = 0;
    for (; i + 4 <= n; i += 4, plane += 4 * slope) {
        lanes_q four;
        memcpy(&four, z + i, sizeof four);
        const lanes_d d = (__builtin_convertvector(four, lanes_d) - base) * area - plane;
        RAISE_DOUBLES(most, d);
    }
    for (; i < n; i++) {
        const double d = ((double)z[i] - base) * area - (start + i * slope), size = d < 0 ? -d : d;
        rest = size > rest ? size : rest;
    }
    for (int lane = 0; lane < 4; lane++) rest = most[lane] > rest ? most[lane] : rest;
    return rest;
}
