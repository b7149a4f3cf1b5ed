/* proof.c - the verifier's words on a mesh, and whether they keep what was promised; sentences. */
#include "internal.h"

#include <math.h>
#include <stdarg.h>

int picture_fail(char **error, const char *format, ...) {
    va_list list;
    va_start(list, format);
    char *sentence = sqlite3_vmprintf(format, list);
    va_end(list);
    sqlite3_free(*error);
    *error = sentence;
    return sentence ? SQLITE_ERROR : SQLITE_NOMEM;
}

int picture_fail_database(char **error, sqlite3 *db) {
    const int code = sqlite3_errcode(db);
    return picture_fail(error, "%s", sqlite3_errmsg(db)) == SQLITE_NOMEM ? SQLITE_NOMEM : code;
}

int picture_proof_read(sqlite3 *db, const char *region, double eps, const char *terrain, const char *options,
                       picture_proof *proof, char **error) {
    sqlite3_stmt *row = NULL;
    if (sqlite3_prepare_v2(
            db,
            "SELECT samples, vertices, triangles, max_error, rms_error, x, y, t_junctions, overlaps, "
            "uncovered FROM rqt_verify(?1, ?2, ?3, ?4)",
            -1, &row, NULL) != SQLITE_OK)
        return picture_fail_database(error, db);
    sqlite3_bind_text(row, 1, region, -1, SQLITE_STATIC);
    sqlite3_bind_double(row, 2, eps);
    sqlite3_bind_text(row, 3, terrain, -1, SQLITE_STATIC);
    sqlite3_bind_text(row, 4, options, -1, SQLITE_STATIC);
    int code = sqlite3_step(row);
    if (code == SQLITE_ROW) {
        *proof = (picture_proof){.samples = sqlite3_column_int64(row, 0),
                                 .vertices = sqlite3_column_int64(row, 1),
                                 .triangles = sqlite3_column_int64(row, 2),
                                 .max_error = sqlite3_column_double(row, 3),
                                 .rms_error = sqlite3_column_double(row, 4),
                                 .has_worst = sqlite3_column_type(row, 5) != SQLITE_NULL,
                                 .x = sqlite3_column_double(row, 5),
                                 .y = sqlite3_column_double(row, 6),
                                 .t_junctions = sqlite3_column_int64(row, 7),
                                 .overlaps = sqlite3_column_int64(row, 8),
                                 .uncovered = sqlite3_column_int64(row, 9)};
        code = SQLITE_OK;
    } else {
        code = code == SQLITE_DONE ? picture_fail(error, "rqt_verify() gave no row")
                                   : picture_fail_database(error, db);
    }
    sqlite3_finalize(row);
    return code;
}

/* The promise: nowhere further than max(eps, quantum_error) from a sample of the source. The stored heights are
 * within quantum_error of the source's, and the mesh within eps - quantum_error of them, or exactly on them. The
 * verifier multiplies by a quantum that is itself rounded: an equality may be two units of the last place off. */
bool picture_proof_holds(const picture_proof *proof, double eps, double quantum_error) {
    const double allowed = fmax(eps - quantum_error, 0) * (1 + 0x1p-51);
    return proof->max_error <= allowed && !proof->t_junctions && !proof->overlaps && !proof->uncovered;
}
