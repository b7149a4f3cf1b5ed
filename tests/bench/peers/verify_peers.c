/* verify_peers.c - the true error of other programs' meshes, by the verifier of rqt_verify().
 *
 *     verify_peers HEIGHTS.bin SIDE MESHES...   > peers.csv
 *
 * HEIGHTS.bin: SIDE * SIDE little-endian int32, whole metres, row by row. MESHES: records of a line
 * "series,asked,ms,vertices,triangles" and then that many pairs of int32 (column, row) and triples of uint32
 * (vertices of a triangle, in either winding). Every vertex has the height of its sample. Writes the rows that
 * `rqt chart --peers` reads; says on stderr when a mesh has a crack, an overlap or a hole.
 */
#include "verify.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int32_t *heights;
static int side;

static void stop(const char *what, const char *why) {
    fprintf(stderr, "verify_peers: %s: %s\n", what, why);
    exit(1);
}

static void *take(size_t size) {
    void *memory = malloc(size ? size : 1);
    if (!memory) stop("memory", "there is not enough");
    return memory;
}

static void read_heights(const char *path) {
    const size_t count = (size_t)side * (size_t)side;
    heights = take(count * sizeof *heights);
    FILE *file = fopen(path, "rb");
    if (!file || fread(heights, sizeof *heights, count, file) != count) stop(path, "it is too short, or not there");
    fclose(file);
}

/* The whole square is promised. */
static bool is_promised(void *context, int32_t col, int32_t row) {
    (void)context;
    return col >= 0 && row >= 0;
}

static verify_corner corner_of(const int32_t *vertices, uint32_t count, uint32_t index, const char *path) {
    if (index >= count) stop(path, "a triangle has a vertex that is not there");
    const int32_t col = vertices[2 * index], row = vertices[2 * index + 1];
    if (col < 0 || row < 0 || col >= side || row >= side) stop(path, "a vertex lies outside the raster");
    return (verify_corner){col, row, heights[row * side + col]};
}

/* Peers wind as they like; a triangle without area (on the hull of a TIN) covers nothing and is not counted. */
static bool turn(verify_triangle *t) {
    const verify_corner *c = t->corner;
    const int64_t area = (int64_t)(c[1].col - c[0].col) * (c[2].row - c[0].row) -
                         (int64_t)(c[2].col - c[0].col) * (c[1].row - c[0].row);
    if (area > 0) {
        const verify_corner second = t->corner[1];
        t->corner[1] = t->corner[2];
        t->corner[2] = second;
    }
    return area != 0;
}

static void prove(const char *series, double asked, double ms, const verify_triangle *triangles, size_t count) {
    const verify_samples samples = {.width = side,
                                    .height = side,
                                    .q = heights,
                                    .quantum = 1,
                                    .cell_x = 1,
                                    .cell_y = 1,
                                    .is_promised = is_promised};
    verify_report r;
    if (verify_mesh(&samples, triangles, count, &r) != VERIFY_OK) stop(series, "the verifier refuses the mesh");
    if (r.t_junctions || r.overlaps || r.uncovered)
        fprintf(stderr, "verify_peers: %s at %g: %llu T-junctions, %llu overlaps, %llu uncovered samples\n", series,
                asked, (unsigned long long)r.t_junctions, (unsigned long long)r.overlaps,
                (unsigned long long)r.uncovered);
    printf("%s,%.17g,%.17g,%.17g,%llu,%llu,%llu,%.3f\n", series, asked, r.max_error, r.rms_error,
           (unsigned long long)r.samples, (unsigned long long)r.vertices, (unsigned long long)r.triangles, ms);
}

static void read_meshes(const char *path) {
    FILE *file = fopen(path, "rb");
    if (!file) stop(path, "it is not there");
    char line[256], series[64];
    double asked, ms;
    uint32_t vertex_count, triangle_count;
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, "%63[^,],%lf,%lf,%u,%u", series, &asked, &ms, &vertex_count, &triangle_count) != 5)
            stop(path, "a record does not begin as it should");
        int32_t *vertices = take(8 * (size_t)vertex_count);
        uint32_t *indices = take(12 * (size_t)triangle_count);
        verify_triangle *triangles = take((size_t)triangle_count * sizeof *triangles);
        if (fread(vertices, 8, vertex_count, file) != vertex_count ||
            fread(indices, 12, triangle_count, file) != triangle_count)
            stop(path, "it ends within a mesh");
        size_t count = 0;
        for (size_t i = 0; i < triangle_count; i++) {
            for (size_t j = 0; j < 3; j++)
                triangles[count].corner[j] = corner_of(vertices, vertex_count, indices[3 * i + j], path);
            count += turn(&triangles[count]);
        }
        prove(series, asked, ms, triangles, count);
        free(vertices);
        free(indices);
        free(triangles);
    }
    fclose(file);
}

int main(int argc, char **argv) {
    side = argc > 3 ? atoi(argv[2]) : 0;
    if (side < 2 || side > 16385) {
        fprintf(stderr, "Usage: verify_peers HEIGHTS.bin SIDE MESHES...\n");
        return 2;
    }
    read_heights(argv[1]);
    printf("series,asked,max_error,rms_error,samples,vertices,triangles,ms\n");
    for (int i = 3; i < argc; i++) read_meshes(argv[i]);
    free(heights);
    return fflush(stdout) || ferror(stdout);
}
