/* methods.c - queries by a metric that is not stored: its errors are computed from the heights of the whole
 * terrain.
 *
 * What a connection computes it keeps while the databases stay as they are (store.c forgets it with everything
 * else): the heights of one terrain, and per metric the errors, closed, and the pyramid's summaries. A query over
 * them finds its answers by looking at every summary, makes the blocks that it walks (they go through the cache of
 * decoded blocks under keys of their own), and is otherwise the same as one over stored blocks.
 *
 * Memory is bounded: heights and all metrics of a connection together by STORE_METHOD_MEMORY. Where another metric
 * does not fit beside those that are there, they go first; where it does not fit alone, the answer is an error that
 * says how much it takes. Metrics of another terrain take the place of all.
 */
#include "internal.h"

#include <string.h>

typedef struct method {
    rqt_errors errors;
    rqt_pyramid *pyramid;
    rqt_answer *answers; /* of every block, by number */
    size_t count;
    rqt_code largest; /* finite code */
    size_t bytes;
} method;

struct method_cache {
    int terrain; /* index among the store's */
    int32_t *q;
    uint8_t *valid; /* NULL: no voids */
    rqt_grid grid;
    size_t grid_bytes;
    method *methods[RQT_METRICS][2]; /* by outline, which only minimal looks at */
};

static void method_free(method *m) {
    if (!m) return;
    rqt_pyramid_free(m->pyramid);
    rqt_errors_free(&m->errors, store_allocator());
    sqlite3_free(m->answers);
    sqlite3_free(m);
}

static void drop_methods(struct method_cache *c) {
    for (int m = 0; m < RQT_METRICS; m++)
        for (int o = 0; o < 2; o++) {
            method_free(c->methods[m][o]);
            c->methods[m][o] = NULL;
        }
}

void store_methods_free(store *s) {
    struct method_cache *c = s->methods;
    if (!c) return;
    drop_methods(c);
    sqlite3_free(c->q);
    sqlite3_free(c->valid);
    sqlite3_free(c);
    s->methods = NULL;
}

void store_limit_methods(store *s, size_t bytes) {
    s->method_memory = bytes;
    store_methods_free(s);
}

/* ------------------------------------------------------------------------------------------ memory, heights */

static size_t grid_bytes(const store_terrain *t) {
    const size_t n = (size_t)t->lattice.width * (size_t)t->lattice.height;
    return n * sizeof(int32_t) + (t->voids ? n : 0);
}

/* Summaries and the pyramid's nodes. */
static size_t pyramid_bytes(const store_terrain *t) {
    size_t blocks = 0;
    for (int level = 0; level < rqt_block_levels(&t->lattice, t->k); level++) {
        const int shift = t->lattice.K - level;
        const size_t across = ((size_t)t->lattice.width >> shift) + 1,
                     down = ((size_t)t->lattice.height >> shift) + 1;
        blocks += across * down;
    }
    return blocks * (sizeof(rqt_answer) + 16);
}

static size_t kept_bytes(const struct method_cache *c) {
    size_t bytes = c->grid_bytes;
    for (int m = 0; m < RQT_METRICS; m++)
        for (int o = 0; o < 2; o++)
            if (c->methods[m][o]) bytes += c->methods[m][o]->bytes;
    return bytes;
}

static size_t method_bytes(const store_terrain *t, rqt_metric metric) {
    return grid_bytes(t) + pyramid_bytes(t) + rqt_metric_bytes(&t->lattice, metric);
}

size_t store_minimal_bytes(const rqt_lattice *lattice, int k, bool has_voids) {
    const store_terrain t = {.lattice = *lattice, .k = k, .voids = has_voids};
    return method_bytes(&t, RQT_METRIC_MINIMAL);
}

/* All samples, by rows of blocks. */
static int read_grid(store *s, const store_terrain *t, int32_t **q, uint8_t **valid, rqt_grid *grid, char **error) {
    const int32_t width = t->lattice.width, height = t->lattice.height, rows = 1 << t->k;
    const size_t n = (size_t)width * (size_t)height;
    *q = sqlite3_malloc64(n * sizeof **q);
    /* Without voids the mask of one row of blocks is enough, to see that it is true. */
    *valid = sqlite3_malloc64(t->voids ? n : (size_t)width * (size_t)rows);
    int code = *q && *valid ? SQLITE_OK : SQLITE_NOMEM;
    for (int32_t y = 0; y < height && code == SQLITE_OK; y += rows) {
        const int32_t here = height - y < rows ? height - y : rows;
        const size_t at = (size_t)y * (size_t)width, count = (size_t)here * (size_t)width;
        uint8_t *mask = t->voids ? *valid + at : *valid;
        if (store_is_interrupted(s, &code)) break;
        code = store_window(s, t, 0, y, width, here, *q + at, mask, error);
        if (code == SQLITE_OK && !t->voids && memchr(mask, 0, count))
            code = store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: it has voids, its row says none",
                              t->name);
    }
    if (code == SQLITE_OK && !t->voids) {
        sqlite3_free(*valid);
        *valid = NULL;
    }
    *grid = (rqt_grid){.lattice = t->lattice, .q = *q, .valid = *valid};
    if (code != SQLITE_OK) {
        sqlite3_free(*q);
        sqlite3_free(*valid);
        *q = NULL;
        *valid = NULL;
    }
    return code;
}

/* The cache for this terrain, with its heights. */
static int take_grid(store *s, const store_terrain *t, char **error) {
    const int terrain = (int)(t - s->terrains);
    if (s->methods && s->methods->terrain == terrain) return SQLITE_OK;
    store_methods_free(s);
    struct method_cache *c = sqlite3_malloc(sizeof *c);
    if (!c) return SQLITE_NOMEM;
    memset(c, 0, sizeof *c);
    c->terrain = terrain;
    const int code = read_grid(s, t, &c->q, &c->valid, &c->grid, error);
    if (code != SQLITE_OK) {
        sqlite3_free(c);
        return code;
    }
    c->grid_bytes = grid_bytes(t);
    s->methods = c;
    return SQLITE_OK;
}

/* ----------------------------------------------------------------------------------------------- computing */

typedef struct progress {
    store *store;
    int code;
} progress;

static bool goes_on(void *context, double done) {
    (void)done;
    progress *p = context;
    return !store_is_interrupted(p->store, &p->code);
}

static int compute(store *s, const store_terrain *t, const rqt_grid *grid, rqt_metric metric, rqt_outline outline,
                   method **out, char **error) {
    method *m = sqlite3_malloc(sizeof *m);
    if (!m) return SQLITE_NOMEM;
    memset(m, 0, sizeof *m);
    progress p = {s, SQLITE_OK};
    rqt_status status =
        rqt_metric_compute(grid, &t->unit, &t->cost, metric, outline, store_allocator(), goes_on, &p, &m->errors);
    if (status == RQT_OK) status = rqt_pyramid_create(grid, &m->errors, t->k, store_allocator(), &m->pyramid);
    if (status == RQT_OK) {
        m->count = rqt_pyramid_count(m->pyramid);
        m->answers = sqlite3_malloc64(m->count * sizeof *m->answers);
        if (!m->answers) status = RQT_NO_MEMORY;
    }
    if (status != RQT_OK) {
        method_free(m);
        return status == RQT_INTERRUPTED ? p.code : store_fail_core(error, status, "computing a metric");
    }
    for (size_t n = 0; n < m->count; n++)
        rqt_pyramid_block(m->pyramid, n, &m->answers[n].number, &m->answers[n].summary, NULL);
    const size_t places = (size_t)m->errors.columns * (size_t)m->errors.rows;
    for (size_t i = 0; i < places; i++)
        if (m->errors.code[i] < RQT_CODE_LARGEST && m->errors.code[i] > m->largest) m->largest = m->errors.code[i];
    m->bytes = rqt_metric_bytes(&t->lattice, RQT_METRIC_EXACT) + pyramid_bytes(t);
    *out = m;
    return SQLITE_OK;
}

/* The errors of a metric, from the cache or computed now. */
static int take_method(store *s, const store_terrain *t, rqt_metric metric, rqt_outline outline, method **out,
                       char **error) {
    const int which = metric == RQT_METRIC_MINIMAL && outline == RQT_OUTLINE_TOL;
    const size_t need = method_bytes(t, metric);
    if (need > s->method_memory)
        return store_fail(error, SQLITE_ERROR,
                          "metric \"%s\" of terrain %s is not stored, and computing it takes %llu MiB of memory; "
                          "%llu are allowed",
                          rqt_metric_name(metric), t->name, (sqlite3_uint64)(need >> 20) + 1,
                          (sqlite3_uint64)(s->method_memory >> 20));
    int code = take_grid(s, t, error);
    if (code != SQLITE_OK) return code;
    method **kept = &s->methods->methods[metric][which];
    if (!*kept) {
        if (kept_bytes(s->methods) + (need - s->methods->grid_bytes) > s->method_memory) drop_methods(s->methods);
        code = compute(s, t, &s->methods->grid, metric, outline, kept, error);
    }
    *out = *kept;
    return code;
}

int store_take_pyramid(store *s, const store_terrain *t, rqt_metric metric, rqt_outline outline,
                       const rqt_pyramid **pyramid, char **error) {
    method *m = NULL;
    const int code = take_method(s, t, metric, outline, &m, error);
    /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): set when the code says so */
    if (code == SQLITE_OK) *pyramid = m->pyramid;
    return code;
}

/* ------------------------------------------------------------------------------------------------- queries */

typedef struct computed {
    store *store;
    const method *method;
    const rqt_query *query;
    const rqt_patch *patch;
    store_question *question;
    store_reads *reads;
    uint64_t key; /* of its blocks in the cache */
    size_t next;
    int code;
} computed;

static const rqt_block *make_block(void *context, rqt_block_number number) {
    computed *c = context;
    const rqt_block *block = block_cache_find(c->store->cache, c->key, number);
    const bool cached = block != NULL;
    if (!block) {
        size_t low = 0, high = c->method->count;
        while (low < high) {
            const size_t middle = low + (high - low) / 2;
            if (c->method->answers[middle].number < number)
                low = middle + 1;
            else
                high = middle;
        }
        rqt_summary summary;
        rqt_block *fresh = block_cache_add(c->store->cache, c->key, number, c->query->k);
        if (!fresh) {
            c->code = SQLITE_NOMEM;
            return NULL;
        }
        rqt_pyramid_block(c->method->pyramid, low, &number, &summary, fresh);
        block = fresh;
    }
    if (!c->reads) return block;
    if (!c->reads->rows && (c->code = store_begin_reads(c->query, false, c->reads)) != SQLITE_OK) return NULL;
    while (c->reads->rows[c->next].number != number) c->next = (c->next + 1) % c->reads->count;
    store_read *row = &c->reads->rows[c->next];
    if (!row->needs_bytes)
        *row = (store_read){.number = number,
                            .needs_bytes = true,
                            .cached = cached,
                            .selected = store_count_selected(c->query, number, block)};
    return block;
}

static bool is_interrupted(void *context) {
    computed *c = context;
    return store_is_enough(c->store, c->question, c->patch) || store_is_interrupted(c->store, &c->code);
}

/* The blocks that meet the box and answer, as the index would find them. */
static size_t find_answers(const method *m, const store_terrain *t, const int32_t box[4],
                           const store_question *question, rqt_answer *answers) {
    const rqt_outline outline = question->options->outline;
    const rqt_rule *rule = question->options->rule;
    const int32_t last_x = t->lattice.width - 1, last_y = t->lattice.height - 1;
    size_t count = 0;
    for (size_t n = 0; n < m->count; n++) {
        rqt_block_place p;
        const rqt_summary *summary = &m->answers[n].summary;
        (void)rqt_block_locate(&t->lattice, t->k, m->answers[n].number, &p);
        if (rule ? !rqt_rule_is_answered(rule, &p, summary, outline) ||
                       rqt_rule_is_answered_above(rule, &p, summary, outline)
                 : !rqt_summary_answers(summary, outline, question->eps))
            continue;
        const int32_t x1 = p.x + p.side < last_x ? p.x + p.side : last_x,
                      y1 = p.y + p.side < last_y ? p.y + p.side : last_y;
        if (x1 < box[0] || p.x > box[1] || y1 < box[2] || p.y > box[3]) continue;
        answers[count++] = m->answers[n];
    }
    return count;
}

int store_query_computed(store *s, const store_terrain *t, store_question *question, rqt_patch *patch,
                         store_reads *reads, rqt_code *largest, char **error) {
    const store_query_options *options = question->options;
    question->over = question->too_large = false;
    memset(patch, 0, sizeof *patch);
    if (reads) memset(reads, 0, sizeof *reads);
    method *m = NULL;
    int code = take_method(s, t, options->metric, options->outline, &m, error);
    if (code != SQLITE_OK) return code;
    /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): set when the code says so */
    if (largest) *largest = m->largest;
    int32_t box[4];
    if (!rqt_region_box(question->region, &box[0], &box[2], &box[1], &box[3])) return SQLITE_OK;
    /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): set when the code says so */
    rqt_answer *answers = sqlite3_malloc64(m->count * sizeof *answers);
    if (!answers) return SQLITE_NOMEM;
    rqt_query query = {.lattice = t->lattice,
                       .k = t->k,
                       .region = question->region,
                       .eps = question->eps,
                       .rule = options->rule,
                       .select = options->select,
                       .outline = options->outline,
                       .wants_leaves = options->wants_leaves,
                       .product = options->product,
                       .scratch = s->scratch,
                       .answers = answers,
                       .answer_count = find_answers(m, t, box, question, answers),
                       .read_block = make_block,
                       .is_interrupted = is_interrupted};
    const uint64_t field = 2 * (uint64_t)options->metric + (options->outline == RQT_OUTLINE_TOL) + 1;
    computed c = {.store = s,
                  .method = m,
                  .query = &query,
                  .patch = patch,
                  .question = question,
                  .reads = question->options->only_numbers ? NULL : reads,
                  .key = field << 32 | (uint64_t)(t - s->terrains)};
    query.context = &c;
    const rqt_status status = rqt_query_run(&query, store_allocator(), patch);
    code =
        status == RQT_READ_FAILED || status == RQT_INTERRUPTED ? c.code : store_fail_core(error, status, "query");
    if (code == SQLITE_OK && reads && !reads->rows && !question->over && !question->too_large)
        code = store_begin_reads(&query, question->options->only_numbers, reads);
    if (code == SQLITE_OK && reads)
        /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): as many rows as are counted */
        for (size_t i = 0; i < reads->count; i++) reads->rows[i].computed = true;
    if (code != SQLITE_OK && reads) store_reads_free(reads);
    sqlite3_free(answers);
    return code;
}
