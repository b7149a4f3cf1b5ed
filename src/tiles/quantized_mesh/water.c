/* water.c - the water mask: which pixels of a tile are sea, as `rqt import --sea` has noted it in rqt_fill_N (kind
 * 2). A pixel is what the sample nearest to its centre is; beyond the raster it is land, for nothing is drawn
 * there.
 *
 * The runs are read once for all tiles, 12 bytes each.
 */
#include "quantized_mesh.h"

#include <math.h>
#include <string.h>

enum { WATER = 255, KIND_SEA = STORE_SEA };

static int read_runs(sqlite3_stmt *rows, const store_terrain *terrain, tile_plan *plan, char **error) {
    size_t capacity = 0;
    int code;
    while ((code = sqlite3_step(rows)) == SQLITE_ROW) {
        const sea_run run = {sqlite3_column_int(rows, 0), sqlite3_column_int(rows, 1), sqlite3_column_int(rows, 2)};
        const sea_run *before = plan->sea_count ? &plan->sea[plan->sea_count - 1] : NULL;
        if (run.first < 0 || run.last < run.first || run.last >= terrain->lattice.width || run.row < 0 ||
            run.row >= terrain->lattice.height ||
            (before && (run.row < before->row || (run.row == before->row && run.first <= before->last))))
            return tiles_fail(error, "terrain %s is damaged: its filled samples; see rqt check", terrain->name);
        if (!plan->sea || plan->sea_count == capacity) {
            capacity = capacity ? 2 * capacity : 256;
            sea_run *more = sqlite3_realloc64(plan->sea, capacity * sizeof *more);
            if (!more) return SQLITE_NOMEM;
            plan->sea = more;
        }
        plan->sea[plan->sea_count++] = run;
    }
    return code == SQLITE_DONE ? SQLITE_OK : code;
}

int water_read(tiles *t, tile_plan *plan, char **error) {
    const store_terrain *terrain = t->terrain;
    int64_t counts[2];
    int code = store_fill_counts(t->store, terrain, counts, error);
    if (code != SQLITE_OK || counts[STORE_SEA - 1] == 0) return code;
    plan->has_sea = true;
    char *sql = sqlite3_mprintf("SELECT row, col0, col1 FROM \"%w\".rqt_fill_%lld WHERE kind = %d ORDER BY id",
                                terrain->schema, terrain->id, KIND_SEA);
    sqlite3_stmt *rows = NULL;
    code = sql ? sqlite3_prepare_v2(t->db, sql, -1, &rows, NULL) : SQLITE_NOMEM;
    if (code == SQLITE_OK) code = read_runs(rows, terrain, plan, error);
    if (code != SQLITE_OK && code != SQLITE_NOMEM && !*error) code = tiles_fail_database(error, t->db, code);
    sqlite3_finalize(rows);
    sqlite3_free(sql);
    return code;
}

/* The first run that ends at or beyond a sample, in the order of the runs. */
static const sea_run *find_run(const tile_plan *plan, int32_t row, int32_t col) {
    size_t low = 0, high = plan->sea_count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        const sea_run *run = &plan->sea[middle];
        if (run->row < row || (run->row == row && run->last < col))
            low = middle + 1;
        else
            high = middle;
    }
    return plan->sea + low;
}

static void mask_row(const tile_plan *plan, const store_terrain *terrain, const tile_turn *turn, int32_t row,
                     uint8_t *pixels) {
    const sea_run *run = NULL, *end = plan->sea + plan->sea_count;
    for (int i = 0; i < WATER_SIDE; i++) {
        const double col = floor(turn->west + (turn->east - turn->west) * (i + 0.5) / WATER_SIDE + 0.5);
        if (col < 0 || col >= terrain->lattice.width) continue;
        if (!run) run = find_run(plan, row, (int32_t)col);
        while (run < end && run->row == row && run->last < col) run++;
        if (run < end && run->row == row && run->first <= col) pixels[i] = WATER;
    }
}

size_t water_mask(const tiles *t, const tile_place *place, uint8_t mask[WATER_SIDE * WATER_SIDE]) {
    memset(mask, 0, WATER_SIDE * WATER_SIDE);
    for (int i = 0; i < place->turns; i++) {
        const tile_turn *turn = &place->turn[i];
        for (int j = 0; j < WATER_SIDE; j++) {
            const double row = floor(turn->north + (turn->south - turn->north) * (j + 0.5) / WATER_SIDE + 0.5);
            if (row < 0 || row >= t->terrain->lattice.height) continue;
            mask_row(plan_of(t), t->terrain, turn, (int32_t)row, mask + j * WATER_SIDE);
        }
    }
    return memcmp(mask, mask + 1, WATER_SIDE * WATER_SIDE - 1) == 0 ? 1 : WATER_SIDE * WATER_SIDE;
}
