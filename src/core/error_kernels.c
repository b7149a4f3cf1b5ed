/* error_kernels.c - the inner loops of exact errors.
 *
 * One text, compiled for the plain processor and for AVX2. Every operation is one on integers, or on doubles that
 * are integers below 2^53, so both give the same results.
 */
#include "error_kernels.h"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(RQT_SCALAR)
#define HAVE_AVX2_KERNELS 1
#endif

#define NAME(x) x##_plain
#define ATTRIBUTES
#include "error_kernels_rows.h"
#undef NAME
#undef ATTRIBUTES

#ifdef HAVE_AVX2_KERNELS
#define NAME(x) x##_avx2
#define ATTRIBUTES __attribute__((target("avx2")))
#include "error_kernels_rows.h"
#undef NAME
#undef ATTRIBUTES
#endif

const error_kernels *error_kernels_plain(void) {
    static const error_kernels plain = {row_32_plain, row_64_plain, row_double_plain};
    return &plain;
}

const error_kernels *error_kernels_best(void) {
#ifdef HAVE_AVX2_KERNELS
    static const error_kernels avx2 = {row_32_avx2, row_64_avx2, row_double_avx2};
    if (__builtin_cpu_supports("avx2")) return &avx2;
#endif
    return error_kernels_plain();
}
