/* mirror_terrain.c - a large raster out of a small one, without a crease of its own: copies side by side, every
 * second one mirrored, sharing their border rows and columns.
 *
 *     mirror_terrain INPUT.bin SIDE ACROSS DOWN OUTPUT.bin
 *
 * INPUT.bin holds SIDE * SIDE little-endian int16, as make_terrain writes them. OUTPUT.bin gets
 * (ACROSS * (SIDE-1) + 1) * (DOWN * (SIDE-1) + 1), its north-west corner is INPUT's, and an ENVI header beside it.
 */
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void stop(const char *path) {
    fprintf(stderr, "mirror_terrain: %s: %s\n", path, strerror(errno));
    exit(1);
}

/* Place n of a line of mirrored copies, in the one copy. */
static size_t mirrored(size_t n, size_t side) {
    const size_t copy = n / (side - 1), rest = n % (side - 1);
    return copy % 2 ? side - 1 - rest : rest;
}

static void write_header(const char *path, size_t width, size_t height) {
    const size_t length = strlen(path) + 5;
    char *name = malloc(length);
    if (!name) stop(path);
    snprintf(name, length, "%s", path);
    char *dot = strrchr(name, '.');
    if (dot && !strchr(dot, '/')) *dot = 0;
    strcat(name, ".hdr");
    FILE *out = fopen(name, "w");
    if (!out) stop(name);
    fprintf(out,
            "ENVI\nsamples = %zu\nlines = %zu\nbands = 1\nheader offset = 0\nfile type = ENVI Standard\n"
            "data type = 2\ninterleave = bsq\nbyte order = 0\n"
            "map info = {UTM, 1, 1, 400000, 5250000, 30, 30, 32, North, WGS-84, units=Meters}\n",
            width, height);
    if (fclose(out)) stop(name);
    free(name);
}

int main(int argc, char **argv) {
    if (argc != 6) {
        fprintf(stderr, "Usage: mirror_terrain INPUT.bin SIDE ACROSS DOWN OUTPUT.bin\n");
        return 2;
    }
    const size_t side = strtoul(argv[2], NULL, 10), across = strtoul(argv[3], NULL, 10),
                 down = strtoul(argv[4], NULL, 10);
    const size_t width = across * (side - 1) + 1, height = down * (side - 1) + 1;
    int16_t *from = malloc(side * side * sizeof *from), *row = malloc(width * sizeof *row);
    FILE *in = fopen(argv[1], "rb"), *out = fopen(argv[5], "wb");
    if (!from || !row || !in || fread(from, sizeof *from, side * side, in) != side * side) stop(argv[1]);
    if (!out) stop(argv[5]);
    for (size_t y = 0; y < height; y++) {
        const int16_t *line = from + mirrored(y, side) * side;
        for (size_t x = 0; x < width; x++) row[x] = line[mirrored(x, side)];
        if (fwrite(row, sizeof *row, width, out) != width) stop(argv[5]);
    }
    if (fclose(out)) stop(argv[5]);
    write_header(argv[5], width, height);
    fclose(in);
    free(from);
    free(row);
    return 0;
}
