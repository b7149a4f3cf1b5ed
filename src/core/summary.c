/* summary.c - block summaries: 80 bytes that say what a query must know of a block before reading it.
 *
 * A summary is small enough to travel in the row of an index, and for coarse answers it is all that is read. Its
 * decoder trusts nothing. The height of a void vertex is stored as 0, so that equal summaries have equal bytes. */
#include "internal.h"

enum {
    AT_VERSION = 4,
    AT_CENTER_FLAGS = 5,
    AT_CENTER_ERROR = 6,
    AT_CHECKSUM = 8,
    AT_INTERVALS = 16,
    AT_VERTICES = 24,
    VERTEX_BYTES = 8,
    AT_ZERO = 72,
    KNOWN_FLAGS = RQT_VALID | RQT_OUTLINE
};

static void put_vertex(uint8_t *p, const rqt_summary_vertex *v) {
    put32(p, v->flags & RQT_VALID ? (uint32_t)v->q : 0);
    put16(p + 4, v->error);
    p[6] = v->flags;
}

static bool get_vertex(const uint8_t *p, rqt_summary_vertex *v) {
    v->q = (int32_t)get32(p);
    v->error = get16(p + 4);
    v->flags = p[6];
    return v->q > -RQT_HEIGHT_LIMIT && v->q < RQT_HEIGHT_LIMIT && v->flags <= KNOWN_FLAGS && p[7] == 0 &&
           (v->flags & RQT_VALID || v->q == 0);
}

void rqt_summary_encode(const rqt_summary *summary, uint8_t bytes[RQT_SUMMARY_BYTES]) {
    memset(bytes, 0, RQT_SUMMARY_BYTES);
    memcpy(bytes, "RQTS", 4);
    bytes[AT_VERSION] = RQT_FORMAT_VERSION;
    bytes[AT_CENTER_FLAGS] = summary->center_flags;
    put16(bytes + AT_CENTER_ERROR, summary->center_error);
    put16(bytes + AT_INTERVALS, summary->tol.em);
    put16(bytes + AT_INTERVALS + 2, summary->tol.em_parent);
    put16(bytes + AT_INTERVALS + 4, summary->exact.em);
    put16(bytes + AT_INTERVALS + 6, summary->exact.em_parent);
    for (int n = 0; n < 4; n++) put_vertex(bytes + AT_VERTICES + n * VERTEX_BYTES, &summary->corner[n]);
    for (int n = 0; n < 2; n++) put_vertex(bytes + AT_VERTICES + (4 + n) * VERTEX_BYTES, &summary->far[n]);
    put64(bytes + AT_CHECKSUM, checksum64(bytes, RQT_SUMMARY_BYTES, AT_CHECKSUM));
}

rqt_status rqt_summary_decode(const uint8_t *bytes, size_t size, rqt_summary *summary) {
    memset(summary, 0, sizeof *summary);
    if (size != RQT_SUMMARY_BYTES || memcmp(bytes, "RQTS", 4) != 0 || bytes[AT_VERSION] != RQT_FORMAT_VERSION ||
        bytes[AT_CENTER_FLAGS] > KNOWN_FLAGS || get64(bytes + AT_ZERO) != 0 ||
        get64(bytes + AT_CHECKSUM) != checksum64(bytes, size, AT_CHECKSUM))
        return RQT_CORRUPT;
    rqt_summary s = {
        .tol = {get16(bytes + AT_INTERVALS), get16(bytes + AT_INTERVALS + 2)},
        .exact = {get16(bytes + AT_INTERVALS + 4), get16(bytes + AT_INTERVALS + 6)},
        .center_error = get16(bytes + AT_CENTER_ERROR),
        .center_flags = bytes[AT_CENTER_FLAGS],
    };
    for (int n = 0; n < 6; n++) {
        rqt_summary_vertex *v = n < 4 ? &s.corner[n] : &s.far[n - 4];
        if (!get_vertex(bytes + AT_VERTICES + n * VERTEX_BYTES, v)) return RQT_CORRUPT;
    }
    *summary = s;
    return RQT_OK;
}

bool rqt_summary_answers(const rqt_summary *summary, rqt_outline outline, rqt_code eps) {
    const rqt_interval *interval = outline == RQT_OUTLINE_EXACT ? &summary->exact : &summary->tol;
    return interval->em <= eps && eps < interval->em_parent;
}

/* Every vertex of a block except its corners descends from its centre, also the vertices on its sides: they depend
 * on the centre and on the neighbour's. So in a closed set none of them is selected when the centre is not, and the
 * corners, which the summary holds, are all there is. The same at every level: the root has four corners as well.
 * Blocks of k = 0 have no centre; their summary says error 0 and no flags. */
bool rqt_summary_needs_block(const rqt_summary *summary, rqt_outline outline, rqt_code eps) {
    if (outline == RQT_OUTLINE_EXACT && summary->center_flags & RQT_OUTLINE) return true;
    return summary->center_error > eps;
}
