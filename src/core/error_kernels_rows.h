/* error_kernels_rows.h - one row of one plane; compilers turn these loops into vector code. */

ATTRIBUTES static uint32_t NAME(row_32)(const int32_t *z, int32_t n, uint32_t base, int m, uint32_t start,
                                        uint32_t slope) {
    uint32_t most = 0;
    for (int32_t i = 0; i < n; i++) {
        const int32_t d = (int32_t)((((uint32_t)z[i] - base) << m) - start - (uint32_t)i * slope);
        const uint32_t size = d < 0 ? 0u - (uint32_t)d : (uint32_t)d;
        most = size > most ? size : most;
    }
    return most;
}

ATTRIBUTES static uint64_t NAME(row_64)(const int32_t *z, int32_t n, int64_t base, int m, int64_t start,
                                        int64_t slope) {
    int64_t most = 0;
    for (int32_t i = 0; i < n; i++) {
        const int64_t d = (z[i] - base) * ((int64_t)1 << m) - start - i * slope;
        const int64_t size = d < 0 ? -d : d;
        most = size > most ? size : most;
    }
    return (uint64_t)most;
}

ATTRIBUTES static double NAME(row_double)(const int32_t *z, int32_t n, int32_t base, double area, double start,
                                          double slope) {
    /* Four sums side by side: a maximum of doubles is not reordered by the compiler. */
    double most[4] = {0, 0, 0, 0};
    int32_t i = 0;
    for (; i + 4 <= n; i += 4)
        for (int lane = 0; lane < 4; lane++) {
            const double d = ((double)z[i + lane] - base) * area - (start + (double)(i + lane) * slope);
            const double size = d < 0 ? -d : d;
            most[lane] = size > most[lane] ? size : most[lane];
        }
    for (; i < n; i++) {
        const double d = ((double)z[i] - base) * area - (start + (double)i * slope);
        const double size = d < 0 ? -d : d;
        most[0] = size > most[0] ? size : most[0];
    }
    for (int lane = 1; lane < 4; lane++) most[0] = most[lane] > most[0] ? most[lane] : most[0];
    return most[0];
}
