/* relief.c - between which heights the samples of a block's cell lie, and how large errors are in it, from what its
 * summary says: no block is read.
 *
 * The cell of a block of k > 0 is cut by its main or its other diagonal into two halves, and both have the cell's
 * centre C for their split vertex: they are the diamond of C. So the error of C is at least the distance of any
 * valid sample of a half from the plane of its corners, if those are valid; the saturated error, which is stored
 * and rounded up, is not less. A plane over a triangle lies between the least and the greatest of its corners. So
 * with e = center_error and all four corners valid,
 *
 *     least corner - e  <=  z  <=  greatest corner + e          for every valid sample z of the closed cell.
 *
 * That holds at the raster's end too, where corners are clamped: the clamped halves that have an area tile the
 * clamped cell, so each of its samples is in one, which was measured; a cell that exists has an area. All but those
 * of a raster of one row or column, of which no triangle was measured: nothing is said of them here. Nor where a
 * corner is void: a mixed triangle's plane is not looked at. There, for k = 0, and beneath the finest blocks, a
 * cell lies where the one around it does; the root lies between the extremes of the terrain.
 *
 * And every vertex of the closed cell but its corners descends from C (core/summary.c): none has an error above e.
 *
 * Nor, without the centre's outline bit, is either half mixed, or any triangle in it: all of their samples are
 * valid or all are void, and as the halves have two corners in common, all of the cell's are alike.
 *
 * Heights are widened by half a quantum, where samples were rounded to them, and by what doubles round away.
 *
 * Summaries are hostile. Whatever they say, a range lies in the one above and is not empty: where the two have
 * nothing in common one of them lies, and the terrain is damaged. */
#include "internal.h"

#include <math.h>

/* From one height to another, and what the stored ones are off. */
static void set_range(const store_terrain *t, double a, double b, double by, store_relief *relief) {
    const double size =
        fabs((double)t->unit.z0 * rqt_unit_factor(&t->unit)) + fabs(t->unit.offset) + fabs(a) + fabs(b) + by;
    const double slack = by + t->quantum_error + size * 0x1p-48;
    relief->lowest = fmin(a, b) - slack;
    relief->highest = fmax(a, b) + slack;
}

store_relief store_relief_of_all(const store_terrain *t) {
    store_relief all = {.error = t->max_error, .is_mixed = t->voids > 0, .is_valid = t->voids == 0};
    set_range(t, rqt_unit_metres(&t->unit, t->min_q), rqt_unit_metres(&t->unit, t->max_q), 0, &all);
    return all;
}

int store_find_relief(store *s, const store_terrain *t, rqt_block_number number, store_relief *relief,
                      char **error) {
    if (t->k == 0 || t->lattice.width == 1 || t->lattice.height == 1) return SQLITE_OK;
    const rqt_summary *summary;
    const int code = store_get_summary(s, t, number, &summary, error);
    if (code != SQLITE_OK) return code;
    if (summary->center_error < relief->error) relief->error = summary->center_error;
    if (relief->is_mixed && !(summary->center_flags & RQT_OUTLINE)) {
        relief->is_mixed = false;
        relief->is_valid = summary->corner[0].flags & RQT_VALID;
    }
    double low = INFINITY, high = -INFINITY;
    for (int c = 0; c < 4; c++) {
        if (!(summary->corner[c].flags & RQT_VALID)) return SQLITE_OK;
        const double z = rqt_unit_metres(&t->unit, summary->corner[c].q);
        low = fmin(low, z);
        high = fmax(high, z);
    }
    store_relief own;
    set_range(t, low, high, rqt_code_metres(summary->center_error), &own);
    if (own.lowest > relief->highest || own.highest < relief->lowest)
        return store_fail(error, SQLITE_CORRUPT_VTAB,
                          "terrain %s is damaged: the heights of block %llu are not within those around it",
                          t->name, (sqlite3_uint64)number);
    relief->lowest = fmax(relief->lowest, own.lowest);
    relief->highest = fmin(relief->highest, own.highest);
    return SQLITE_OK;
}

/* Let X be the largest error finer than the grids of level l, and b a block of that level with em(b) = X > 0. Going
 * down from b to children with the same em as long as there are any, one comes to a block with em = X whose
 * children all have less, for at stride 1 em is 0: each of these answers from its own em up to below X. And no
 * block below level l has a larger em_parent. So X is the largest end of an interval below level l: those that
 * never answer need not be known. */
int store_level_errors(store *s, const store_terrain *t, rqt_code *largest, char **error) {
    const int levels = rqt_block_levels(&t->lattice, t->k);
    sqlite3_stmt *row = NULL;
    int64_t end[RQT_MAX_K + 2] = {0};
    int code = store_begin_on(s, t, error);
    if (code != SQLITE_OK) return code;
    char *sql = sqlite3_mprintf("SELECT id, tol1 FROM \"%w\".rqt_index_%lld%s", t->schema, t->id, t->suffix);
    code = sql ? sqlite3_prepare_v2(s->db, sql, -1, &row, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    while (code == SQLITE_OK && (code = sqlite3_step(row)) == SQLITE_ROW) {
        const uint64_t number = (uint64_t)sqlite3_column_int64(row, 0);
        const int level = number ? (63 - __builtin_clzll(number)) / 2 : 0;
        const int64_t above = sqlite3_column_int64(row, 1) + 1;
        code = SQLITE_OK;
        if (level > 0 && level < levels && above <= RQT_CODE_LARGEST && above > end[level]) end[level] = above;
    }
    if (code == SQLITE_DONE)
        code = SQLITE_OK;
    else if (code != SQLITE_NOMEM)
        code = store_fail_db(error, s->db, code, "reading the index");
    sqlite3_finalize(row);
    for (int l = levels - 1; l >= 0; l--) {
        if (end[l + 1] > end[l]) end[l] = end[l + 1];
        largest[l] = (rqt_code)end[l + 1];
    }
    store_end(s);
    return code;
}
