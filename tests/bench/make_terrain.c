/* make_terrain.c - terrain for the benches: fractional Brownian motion, the same bytes on every machine.
 *
 *     make_terrain K OUTPUT.bin [SEED [NOISE [TOP]]]
 *
 * A square of (2^K + 1)^2 samples by midpoint displacement with successive random additions (every point of a
 * lattice is displaced again at every scale, which spares the creases of plain midpoint displacement), H = 0.9,
 * stretched to 0..4000 m (or TOP) and rounded to whole metres. Written as ENVI: raw little-endian int16 and a
 * header beside it; 30 m cells, UTM zone 32 north (EPSG:32632). With NOISE, in metres, every sample is moved by a
 * random height of at most that much, each by its own (white noise, all heights equally likely), and heights are
 * int32 centimetres.
 *
 * The same bytes everywhere: additions and multiplications of doubles in a fixed order (compile without fused
 * ones), no function of libm, noise from an integer hash of place and scale.
 */
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define HALF_STEP 0.7320428479728127 /* 2^(-H/2): what a scale finer by sqrt(2) is weaker by */
#define USUAL_TOP 4000.0
#define CELL 30.0
#define WEST 400000.0
#define NORTH 5250000.0

typedef struct field {
    size_t n;  /* samples a side */
    double *z; /* n * n */
    uint64_t seed;
    double noise; /* metres; less than 0: none, and whole metres */
    double top;   /* metres of the highest sample; the lowest is at 0 */
} field;

static uint64_t mix(uint64_t h) {
    h = (h ^ (h >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    h = (h ^ (h >> 27)) * UINT64_C(0x94D049BB133111EB);
    return h ^ (h >> 31);
}

/* Nearly normal, variance 1: the sum of four uniform numbers of 16 bits. */
static double noise(const field *f, size_t place, uint64_t scale) {
    const uint64_t h = mix(mix(f->seed + scale) + (uint64_t)place * UINT64_C(0x9E3779B97F4A7C15));
    const int64_t sum = (int64_t)((h & 0xFFFF) + (h >> 16 & 0xFFFF) + (h >> 32 & 0xFFFF) + (h >> 48));
    return (double)(sum - 2 * 65535) * (1.7320508075688772 / 65536);
}

/* The points (x0 + i*step, y0 + j*step), each displaced. */
static void displace(field *f, size_t x0, size_t y0, size_t step, double delta, uint64_t scale) {
    for (size_t y = y0; y < f->n; y += step)
        for (size_t x = x0; x < f->n; x += step) f->z[y * f->n + x] += delta * noise(f, y * f->n + x, scale);
}

/* The centres of the cells of side 2q. */
static void interpolate_centres(field *f, size_t q) {
    double *z = f->z;
    for (size_t y = q; y < f->n; y += 2 * q)
        for (size_t x = q; x < f->n; x += 2 * q) {
            const size_t at = y * f->n + x, up = at - q * f->n, down = at + q * f->n;
            z[at] = ((z[up - q] + z[up + q]) + (z[down - q] + z[down + q])) * 0.25;
        }
}

/* The middles of their sides: of four neighbours, three on the rim. */
static void interpolate_sides(field *f, size_t q) {
    double *z = f->z;
    const size_t last = f->n - 1;
    for (size_t y = 0; y <= last; y += q)
        for (size_t x = (y / q) % 2 == 0 ? q : 0; x <= last; x += 2 * q) {
            const size_t at = y * f->n + x;
            double sum = 0;
            int neighbours = 0;
            if (x > 0) sum += z[at - q], neighbours++;
            if (x < last) sum += z[at + q], neighbours++;
            if (y > 0) sum += z[at - q * f->n], neighbours++;
            if (y < last) sum += z[at + q * f->n], neighbours++;
            z[at] = neighbours == 4 ? sum * 0.25 : sum / 3;
        }
}

static void make(field *f) {
    double delta = 1;
    uint64_t scale = 0;
    displace(f, 0, 0, f->n - 1, delta, scale);
    for (size_t q = (f->n - 1) / 2; q > 0; q /= 2) {
        delta *= HALF_STEP;
        scale++;
        interpolate_centres(f, q);
        displace(f, 0, 0, 2 * q, delta, scale);
        displace(f, q, q, 2 * q, delta, scale);
        delta *= HALF_STEP;
        scale++;
        interpolate_sides(f, q);
        displace(f, 0, 0, q, delta, scale);
    }
}

/* Centimetres of a height, with noise: between -noise and +noise from another hash than the terrain's. */
static int32_t centimetres(const field *f, size_t place, double metres) {
    const uint64_t h = mix(mix(f->seed + 1000) + (uint64_t)place * UINT64_C(0x9E3779B97F4A7C15));
    const double random = (double)(h >> 11) * 0x1p-52 - 1;
    return (int32_t)((metres + f->noise * random) * 100 + 100000.5) - 100000; /* noise goes below 0 */
}

static int write_samples(const field *f, const char *path) {
    const size_t count = f->n * f->n;
    double low = f->z[0], high = f->z[0];
    for (size_t i = 1; i < count; i++) {
        if (f->z[i] < low) low = f->z[i];
        if (f->z[i] > high) high = f->z[i];
    }
    const double stretch = f->top / (high - low);
    const size_t size = f->noise < 0 ? 2 : 4;
    unsigned char *row = malloc(size * f->n);
    FILE *out = row ? fopen(path, "wb") : NULL;
    int failed = !out;
    for (size_t y = 0; y < f->n && !failed; y++) {
        for (size_t x = 0; x < f->n; x++) {
            const double metres = (f->z[y * f->n + x] - low) * stretch;
            const uint32_t value =
                f->noise < 0 ? (uint32_t)(metres + 0.5) : (uint32_t)centimetres(f, y * f->n + x, metres);
            for (size_t i = 0; i < size; i++) row[size * x + i] = (unsigned char)(value >> 8 * i & 255);
        }
        failed = fwrite(row, size, f->n, out) != f->n;
    }
    if (out && fclose(out)) failed = 1;
    free(row);
    return failed;
}

static int write_header(const field *f, const char *path) {
    char name[4096];
    const char *dot = strrchr(path, '.');
    if (!dot || strchr(dot, '/') || strlen(path) + 5 > sizeof name) {
        errno = EINVAL;
        return 1;
    }
    snprintf(name, sizeof name, "%.*s.hdr", (int)(dot - path), path);
    FILE *out = fopen(name, "w");
    if (!out) return 1;
    fprintf(out,
            "ENVI\ndescription = {fractional Brownian motion, H 0.9, seed %llu}\nsamples = %zu\nlines = %zu\n"
            "bands = 1\nheader offset = 0\nfile type = ENVI Standard\ndata type = %d\ninterleave = bsq\nbyte order "
            "= 0\n"
            "%smap info = {UTM, 1, 1, %.0f, %.0f, %.0f, %.0f, 32, North, WGS-84, units=Meters}\n",
            (unsigned long long)f->seed, f->n, f->n, f->noise < 0 ? 2 : 3,
            f->noise < 0 ? "" : "data gain values = {0.01}\n", WEST, NORTH, CELL, CELL);
    const int failed = ferror(out);
    return fclose(out) || failed;
}

int main(int argc, char **argv) {
    const int k = argc >= 3 && argc <= 6 ? atoi(argv[1]) : 0;
    if (k < 1 || k > 15) {
        fprintf(stderr,
                "Usage: make_terrain K OUTPUT.bin [SEED [NOISE [TOP]]]; (2^K + 1)^2 samples, K from 1 to 15\n");
        return 2;
    }
    field f = {.n = ((size_t)1 << k) + 1,
               .seed = argc >= 4 ? strtoull(argv[3], NULL, 10) : 1,
               .noise = argc >= 5 ? strtod(argv[4], NULL) : -1,
               .top = argc == 6 ? strtod(argv[5], NULL) : USUAL_TOP};
    f.z = calloc(f.n * f.n, sizeof *f.z);
    if (!f.z) {
        fprintf(stderr, "make_terrain: out of memory\n");
        return 1;
    }
    make(&f);
    const int failed = write_samples(&f, argv[2]) || write_header(&f, argv[2]);
    if (failed) fprintf(stderr, "make_terrain: %s: %s\n", argv[2], strerror(errno));
    free(f.z);
    return failed;
}
