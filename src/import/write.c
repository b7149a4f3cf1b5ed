/* write.c - every block into the store, in ascending order of number: level by level, and in Morton order within.
 */
#include "parts.h"

#include <stdlib.h>

typedef struct writing {
    const import_job *job;
    const import_stream *stream;
    store_writer *writer;
    import_report *report;
    uint8_t *bytes; /* room for one block */
    size_t count, written;
    int64_t samples;
} writing;

static bool write_block(writing *w, rqt_block_number number) {
    const import_stream *s = w->stream;
    rqt_summary summary;
    size_t size;
    char *detail = NULL;
    if (!import_stage_take(s->stage, number, &summary, w->bytes, &size))
        return import_scratch_refuse(w->job, import_stage_scratch(s->stage));
    if (s->build) rqt_build_summary(s->build, s->sweep, number, &summary);
    const int code = store_writer_block(w->writer, number, &summary, w->bytes, size, &detail);
    if (code != SQLITE_OK) return import_database_refuse(w->job, code, detail);
    w->report->blocks++;
    w->report->bytes += (int64_t)size + RQT_SUMMARY_BYTES;
    w->written++;
    return w->written % 64 || import_progress(w->job, "blocks", (double)w->written / (double)w->count, w->samples);
}

/* Depth first through the cells of one level in Morton order; cells that do not exist have nothing below. */
static bool write_level(writing *w, int level, int depth, int32_t i, int32_t j) {
    const rqt_block_number number = rqt_block_number_of(depth, i, j);
    rqt_block_place place;
    if (rqt_block_locate(&w->stream->lattice, w->stream->k, number, &place) != RQT_OK) return true;
    if (depth == level) return write_block(w, number);
    for (int child = 0; child < 4; child++)
        if (!write_level(w, level, depth + 1, 2 * i + (child & 1), 2 * j + (child >> 1))) return false;
    return true;
}

bool import_write(const import_job *job, const import_stream *stream, store_writer *writer, import_report *report) {
    writing w = {.job = job, .stream = stream, .writer = writer, .report = report};
    w.samples = (int64_t)stream->lattice.width * stream->lattice.height;
    w.count = stream->build ? rqt_build_count(stream->build) : 1;
    w.bytes = malloc(rqt_block_bound(stream->k));
    bool ok = w.bytes || import_no_memory(job, "writing blocks");
    const int levels = rqt_block_levels(&stream->lattice, stream->k);
    for (int level = 0; ok && level < levels; level++) ok = write_level(&w, level, 0, 0, 0);
    free(w.bytes);
    return ok && import_progress(job, "blocks", 1, w.samples);
}
