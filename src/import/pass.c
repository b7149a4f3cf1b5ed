/* pass.c - one look at all samples, by all threads: a strip at a time, while the reader fetches the next ones. */
#include "parts.h"

#include <stdlib.h>

#define ROWS_PER_ITEM 16

typedef struct looker {
    import_look look;
    double *row;
} looker;

typedef struct looking {
    const import_strip *strip;
    looker *looker; /* of each thread */
} looking;

static void look_at_rows(void *context, int worker, int32_t item) {
    const looking *l = context;
    const int32_t first = item * ROWS_PER_ITEM, rest = l->strip->rows - first;
    import_look_rows(&l->looker[worker].look, l->strip, first, rest < ROWS_PER_ITEM ? rest : ROWS_PER_ITEM,
                     l->looker[worker].row);
}

static void look_at_strip(import_pool *pool, looking *l, const import_strip *strip) {
    l->strip = strip;
    import_pool_run(pool, look_at_rows, l, (strip->rows + ROWS_PER_ITEM - 1) / ROWS_PER_ITEM);
}

static bool look_at_strips(const import_job *job, const import_pass *pass, looking *l) {
    const import_strip *strip;
    int32_t height = 1, width = 1;
    if (pass->all) {
        look_at_strip(pass->pool, l, pass->all);
        return true;
    }
    import_reader_extent(pass->reader, &width, &height);
    const int64_t samples = (int64_t)width * height;
    for (int32_t end = 0; end < height; end = strip->first_row + strip->rows) {
        if (!(strip = import_reader_next(pass->reader))) return false;
        look_at_strip(pass->pool, l, strip);
        if (pass->coarse) import_coarse_keep(pass->coarse, strip);
        const double done = (double)(strip->first_row + strip->rows) / height;
        if (!pass->keep) import_reader_release(pass->reader);
        if (!import_progress(job, "reading", done, samples)) return false;
    }
    return true;
}

bool import_look_at_all(const import_job *job, const import_pass *pass, import_look *look) {
    const int workers = import_pool_workers(pass->pool);
    int32_t width, height;
    if (pass->all)
        width = pass->all->width;
    else
        import_reader_extent(pass->reader, &width, &height);
    looking l = {.looker = calloc((size_t)workers, sizeof *l.looker)};
    bool ok = l.looker != NULL;
    for (int i = 0; ok && i < workers; i++) {
        l.looker[i].look = import_look_empty(look);
        l.looker[i].row = malloc((size_t)width * sizeof(double));
        ok = l.looker[i].row != NULL;
    }
    if (!ok)
        import_no_memory(job, "looking at the samples");
    else
        ok = look_at_strips(job, pass, &l);
    for (int i = 0; l.looker && i < workers; i++) {
        if (ok) import_look_merge(look, &l.looker[i].look);
        free(l.looker[i].row);
    }
    free(l.looker);
    return ok;
}
