/* error_kernels.c - the inner loops of exact errors, twice: for AVX2, and for any processor.
 *
 * One text, in the vector types of the compiler; what they have no operator for is a macro here. All of it is
 * arithmetic on integers, on doubles that are integers below 2^53, and on floats whose error is allowed for: both
 * versions give the same bytes.
 */
#include "error_kernels.h"

#include <math.h>

#define LANES 8
typedef int32_t lanes_i __attribute__((vector_size(4 * LANES)));
typedef uint32_t lanes_u __attribute__((vector_size(4 * LANES)));
typedef float lanes_f __attribute__((vector_size(4 * LANES)));
typedef int32_t lanes_q __attribute__((vector_size(16))); /* four, to be made doubles */
typedef double lanes_d __attribute__((vector_size(32)));
typedef int64_t lanes_l __attribute__((vector_size(32)));

#define NAME(x) x##_plain
#define LANES_ABS(a) ((lanes_u)(((a) ^ ((a) >> 31)) - ((a) >> 31)))
#define LANES_MAX(a, b) max_plain(a, b)
static inline __attribute__((always_inline)) lanes_u max_plain(lanes_u a, lanes_u b) {
    const lanes_u greater = (lanes_u)((lanes_i)a > (lanes_i)b); /* both below 2^31 */
    return (a & greater) | (b & ~greater);
}
static inline __attribute__((always_inline)) bool any_plain(lanes_u a) {
    uint32_t any = 0;
    for (int i = 0; i < LANES; i++) any |= a[i];
    return any != 0;
}
#define LANES_ANY(a) any_plain(a)
#define RAISE_DOUBLES(most, d)                                               \
    do {                                                                     \
        const lanes_l size = (lanes_l)(d)&INT64_MAX;                         \
        const lanes_l greater = (lanes_d)size > (most);                      \
        (most) = (lanes_d)((size & greater) | ((lanes_l)(most) & ~greater)); \
    } while (0)
#include "error_kernels_rows.h"

#include "error_kernels_cells.h"
#undef NAME
#undef LANES_ABS
#undef LANES_MAX
#undef LANES_ANY
#undef RAISE_DOUBLES

#if defined(__x86_64__) && defined(__GNUC__) && !defined(RQT_SCALAR)
#include <immintrin.h>
#define HAVE_AVX2_KERNELS 1
#ifdef __clang__ /* builds the fuzzers */
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif
#define NAME(x) x##_avx2
#define LANES_ABS(a) ((lanes_u)_mm256_abs_epi32((__m256i)(a)))
#define LANES_MAX(a, b) ((lanes_u)_mm256_max_epi32((__m256i)(a), (__m256i)(b)))
#define LANES_ANY(a) (!_mm256_testz_si256((__m256i)(a), (__m256i)(a)))
#define RAISE_DOUBLES(most, d) \
    (most) = (lanes_d)_mm256_max_pd((__m256d)(lanes_d)((lanes_l)(d)&INT64_MAX), (__m256d)(most))
#define LANES_AVX2 1
#include "error_kernels_rows.h"

#include "error_kernels_cells.h"
#ifdef __clang__
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif

const error_kernels *error_kernels_plain(void) {
    static const error_kernels plain = {rows_32_plain, rows_64_plain, row_double_plain, cells_plain};
    return &plain;
}

const error_kernels *error_kernels_best(void) {
#ifdef HAVE_AVX2_KERNELS
    static const error_kernels avx2 = {rows_32_avx2, rows_64_avx2, row_double_avx2, cells_avx2};
    if (__builtin_cpu_supports("avx2")) return &avx2;
#endif
    return error_kernels_plain();
}
