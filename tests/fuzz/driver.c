/* driver.c - runs a fuzzer without libFuzzer: over files, then over RQT_FUZZ_RUNS inputs (by default as many as
 * the fuzzer says) made from RQT_SEED, the same on every machine. Ends with `N passed, 0 failed`; a finding aborts,
 * after its input was kept in the file RQT_FUZZ_KEEP, when that is set. */
#include "fuzz.h"

static uint64_t state;

static uint64_t bits(void) {
    uint64_t z = state += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static void run(const uint8_t *bytes, size_t size) {
    const char *path = getenv("RQT_FUZZ_KEEP");
    FILE *keep = path ? fopen(path, "wb") : NULL;
    if (keep) {
        (void)fwrite(bytes, 1, size, keep);
        (void)fclose(keep);
    }
    /* An allocation of exactly this size. */
    uint8_t *copy = malloc(size ? size : 1);
    if (!copy) abort();
    memcpy(copy, bytes, size);
    (void)LLVMFuzzerTestOneInput(copy, size);
    free(copy);
}

int main(int argc, char **argv) {
    static uint8_t bytes[1 << 16];
    const char *wanted = getenv("RQT_FUZZ_RUNS"), *seed = getenv("RQT_SEED");
    const long runs = wanted ? strtol(wanted, NULL, 10) : fuzz_runs;
    state = seed ? strtoull(seed, NULL, 0) : 1;
    printf("RQT_SEED=%llu RQT_FUZZ_RUNS=%ld\n", (unsigned long long)state, runs);
    (void)fflush(stdout);
    for (int i = 1; i < argc; i++) {
        FILE *f = fopen(argv[i], "rb");
        if (!f) {
            perror(argv[i]);
            return 1;
        }
        const size_t n = fread(bytes, 1, sizeof bytes, f);
        (void)fclose(f);
        run(bytes, n);
    }
    for (long n = 0; n < runs; n++) {
        const size_t size = (size_t)(bits() % (n % 16 == 0 ? 2000 : 200));
        for (size_t i = 0; i < size; i++) bytes[i] = (uint8_t)bits();
        run(bytes, size);
    }
    printf("%ld passed, 0 failed\n", argc - 1 + runs);
    return 0;
}
