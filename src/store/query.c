/* query.c - region + eps -> patch: the index says which blocks answer, the core walks them.
 *
 * The R-tree holds, per block, its extent and the closed interval of error codes in which it answers. Nothing is
 * taken on trust: every summary is checked, and areas are summed to prove that the answers tile the region's box.
 *
 * A rule (rqt_rule) never takes a block above the one that answers its own eps. So the index finds where to begin,
 * with the same proof, and blocks that do not hold all that the rule selects give way to their children, by number:
 * those tile them.
 */
#include "internal.h"

#include <stdlib.h>
#include <string.h>

static int answers_statement(store *s, const store_terrain *t, rqt_outline outline, sqlite3_stmt **out,
                             char **error) {
    sqlite3_stmt **kept = &store_statements(s, t)->answers[outline == RQT_OUTLINE_TOL];
    int code = SQLITE_OK;
    if (!*kept) {
        const char *column = outline == RQT_OUTLINE_TOL ? "tol" : "exact";
        code = store_prepare(
            s, t, kept,
            sqlite3_mprintf("SELECT b.id, b.summary FROM \"%w\".rqt_index_%lld%s i "
                            "CROSS JOIN \"%w\".rqt_block_%lld%s b ON b.id = i.id WHERE i.x1 >= ?1 AND i.x0 <= ?2 "
                            "AND i.y1 >= ?3 AND i.y0 <= ?4 AND i.%s0 <= ?5 AND i.%s1 >= ?5",
                            t->schema, t->id, t->suffix, t->schema, t->id, t->suffix, column, column),
            error);
    }
    *out = *kept;
    return code;
}

typedef struct answer_list {
    rqt_answer *rows;
    size_t count, capacity;
} answer_list;

static rqt_answer *add_answer(answer_list *list) {
    if (list->count == list->capacity) {
        const size_t more = list->capacity ? 2 * list->capacity : 64;
        rqt_answer *rows = sqlite3_realloc64(list->rows, more * sizeof *rows);
        if (!rows) return NULL;
        list->rows = rows;
        list->capacity = more;
    }
    return &list->rows[list->count++];
}

/* The answering blocks that meet the box; and a proof that the index is whole: their cells tile the box. */
static int find_answers(store *s, const store_terrain *t, const int32_t box[4], rqt_outline outline, rqt_code eps,
                        answer_list *list, char **error) {
    sqlite3_stmt *row;
    int code = answers_statement(s, t, outline, &row, error);
    if (code != SQLITE_OK) return code;
    for (int i = 0; i < 4; i++) sqlite3_bind_int(row, i + 1, box[i]);
    sqlite3_bind_int(row, 5, eps);
    int64_t covered = 0;
    int32_t proof[4] = {box[0], box[1], box[2], box[3]};
    for (int a = 0; a < 4; a += 2) {
        const int32_t samples = a ? t->lattice.height : t->lattice.width;
        if (proof[a] != proof[a + 1]) continue;
        if (proof[a + 1] < samples - 1 || samples == 1)
            proof[a + 1]++;
        else
            proof[a]--;
    }
    const int64_t wanted = (int64_t)(proof[1] - proof[0]) * (proof[3] - proof[2]);
    while ((code = sqlite3_step(row)) == SQLITE_ROW) {
        rqt_answer *answer = add_answer(list);
        if (!answer) {
            code = SQLITE_NOMEM;
            break;
        }
        answer->number = (rqt_block_number)sqlite3_column_int64(row, 0);
        const void *bytes = sqlite3_column_blob(row, 1);
        const int size = sqlite3_column_bytes(row, 1);
        rqt_block_place p;
        if (!bytes || rqt_summary_decode(bytes, (size_t)size, &answer->summary) != RQT_OK ||
            !rqt_summary_answers(&answer->summary, outline, eps) ||
            rqt_block_locate(&t->lattice, t->k, answer->number, &p) != RQT_OK) {
            code = store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: the summary of block %lld",
                              t->name, (sqlite3_int64)answer->number);
            break;
        }
        const int64_t x0 = p.x > proof[0] ? p.x : proof[0], x1 = p.x + p.side < proof[1] ? p.x + p.side : proof[1];
        const int64_t y0 = p.y > proof[2] ? p.y : proof[2], y1 = p.y + p.side < proof[3] ? p.y + p.side : proof[3];
        if (x1 > x0 && y1 > y0) covered += (x1 - x0) * (y1 - y0);
        if (covered > wanted) break; /* blocks over one another */
    }
    sqlite3_reset(row);
    if (code == SQLITE_DONE || (code == SQLITE_ROW && covered > wanted)) {
        if (covered == wanted) return SQLITE_OK; /* and the query sees that they are disjoint */
        return store_fail(error, SQLITE_CORRUPT_VTAB,
                          "terrain %s is damaged: its index does not cover the region; see rqt_check", t->name);
    }
    if (!*error && code != SQLITE_NOMEM) code = store_fail_db(error, s->db, code, "reading the index");
    return code;
}

/* The children of a block that are there and whose extents meet the box, to the list. */
static int add_children(store *s, const store_terrain *t, const rqt_block_place *p, const int32_t box[4],
                        answer_list *list, char **error) {
    for (int c = 0; c < 4; c++) {
        const rqt_block_number number = rqt_block_number_of(p->level + 1, 2 * p->i + (c & 1), 2 * p->j + (c >> 1));
        rqt_block_place child;
        if (rqt_block_locate(&t->lattice, t->k, number, &child) != RQT_OK) continue;
        const rqt_vertex end =
            rqt_vertex_clamp(&t->lattice, (rqt_vertex){child.x + child.side, child.y + child.side});
        if (end.x < box[0] || child.x > box[1] || end.y < box[2] || child.y > box[3]) continue;
        const rqt_summary *summary;
        const int code = store_get_summary(s, t, number, &summary, error);
        if (code != SQLITE_OK) return code;
        rqt_answer *answer = add_answer(list);
        if (!answer) return SQLITE_NOMEM;
        *answer = (rqt_answer){number, *summary};
    }
    return SQLITE_OK;
}

/* From the blocks that answer the rule's eps to those that answer the rule. */
static int refine_answers(store *s, const store_terrain *t, const int32_t box[4], rqt_outline outline,
                          const rqt_rule *rule, answer_list *list, char **error) {
    size_t kept = 0;
    for (size_t i = 0; i < list->count; i++) {
        const rqt_answer answer = list->rows[i];
        rqt_block_place p;
        (void)rqt_block_locate(&t->lattice, t->k, answer.number, &p);
        if (rqt_rule_is_answered(rule, &p, &answer.summary, outline)) {
            list->rows[kept++] = answer;
            continue;
        }
        const int code = add_children(s, t, &p, box, list, error);
        if (code != SQLITE_OK) return code;
    }
    list->count = kept;
    return SQLITE_OK;
}

typedef struct reading {
    store *store;
    const store_terrain *terrain;
    const rqt_query *query;
    store_reads *reads; /* to be told what each read was; NULL: not */
    const rqt_patch *patch;
    store_question *question;
    size_t next;
    char **error;
    int code;
} reading;

int64_t store_count_selected(const rqt_query *query, rqt_block_number number, const rqt_block *block) {
    const int32_t n = (1 << block->k) + 1;
    rqt_block_place p;
    int64_t count = 0;
    if (rqt_block_locate(&query->lattice, query->k, number, &p) != RQT_OK) return 0;
    for (int32_t i = 0; i < n * n; i++) {
        const rqt_vertex at = {p.x + i % n * p.stride, p.y + i / n * p.stride};
        count += rqt_query_selects(query, at, block->error[i], block->flags[i]);
    }
    return count;
}

static int64_t count_corners(const rqt_query *query, const rqt_answer *answer) {
    rqt_block_place p;
    int64_t count = 0;
    if (rqt_block_locate(&query->lattice, query->k, answer->number, &p) != RQT_OK) return 0;
    for (int c = 0; c < 4; c++) {
        const rqt_vertex at = {p.x + (c & 1 ? p.side : 0), p.y + (c & 2 ? p.side : 0)};
        const rqt_summary_vertex *v = &answer->summary.corner[c];
        count += rqt_query_selects(query, at, v->error, v->flags);
    }
    return count;
}

/* A row per answer, as answered from its index row; the query has sorted them. */
int store_begin_reads(const rqt_query *query, bool only_numbers, store_reads *reads) {
    reads->rows = sqlite3_malloc64((query->answer_count + 1) * sizeof *reads->rows);
    if (!reads->rows) return SQLITE_NOMEM;
    reads->count = query->answer_count;
    for (size_t i = 0; i < reads->count; i++) {
        const rqt_answer *answer = &query->answers[i];
        reads->rows[i] = (store_read){.number = answer->number};
        if (only_numbers) continue;
        const bool outside = !rqt_query_needs_block(query, answer) && rqt_query_selects_inside(query, answer);
        reads->rows[i] =
            (store_read){.number = answer->number, .outside = outside, .selected = count_corners(query, answer)};
    }
    return SQLITE_OK;
}

static const rqt_block *read_block(void *context, rqt_block_number number) {
    reading *r = context;
    const rqt_block *block;
    int read;
    r->code = store_get_block(r->store, r->terrain, number, &block, &read, r->error);
    if (r->code != SQLITE_OK) return NULL;
    if (r->reads) {
        /* Blocks come in the order of the answers, once, or twice when a selection is closed first. */
        if (!r->reads->rows && (r->code = store_begin_reads(r->query, false, r->reads)) != SQLITE_OK) return NULL;
        while (r->reads->rows[r->next].number != number) r->next = (r->next + 1) % r->reads->count;
        store_read *row = &r->reads->rows[r->next];
        if (!row->needs_bytes) {
            const uint8_t *bytes;
            int size = read;
            if (!read) {
                r->code = store_block_bytes(r->store, r->terrain, number, &bytes, &size, r->error);
                sqlite3_reset(store_statements(r->store, r->terrain)->bytes);
                if (r->code != SQLITE_OK) return NULL;
            }
            *row = (store_read){.number = number,
                                .needs_bytes = true,
                                .cached = read == 0,
                                .bytes = size,
                                .selected = store_count_selected(r->query, number, block)};
        }
    }
    return block;
}

bool store_is_interrupted(store *s, int *why) {
    /* SQLite 3.40 tells nobody that sqlite3_interrupt was called but a statement that runs: so run one. */
    int code = SQLITE_OK;
    if (!s->probe) code = sqlite3_prepare_v3(s->db, "SELECT 1", -1, SQLITE_PREPARE_PERSISTENT, &s->probe, NULL);
    if (code == SQLITE_OK) code = sqlite3_step(s->probe);
    sqlite3_reset(s->probe);
    if (code == SQLITE_ROW) return false;
    *why = code & 0xFF;
    return true;
}

bool store_wait_is_over(void *wait) {
    store_wait *w = wait;
    return store_is_interrupted(w->store, &w->code);
}

bool store_is_enough(const store *s, store_question *question, const rqt_patch *patch) {
    const int64_t most = s->limits.triangles;
    question->over = question->most > 0 && patch->vertex_count > question->most;
    /* A strip has an index or two a triangle, and its triangles are not counted. */
    question->too_large =
        most > 0 && ((int64_t)patch->vertex_count > most || (int64_t)patch->triangle_count > most ||
                     (int64_t)patch->strip_count / 3 > most);
    return question->over || question->too_large;
}

static bool is_interrupted(void *context) {
    reading *r = context;
    /* More than is wanted already: the rest need not be walked. */
    return store_is_enough(r->store, r->question, r->patch) || store_is_interrupted(r->store, &r->code);
}

void store_reads_free(store_reads *reads) {
    sqlite3_free(reads->rows);
    memset(reads, 0, sizeof *reads);
}

int store_query_tables(store *s, const store_terrain *t, store_question *question, rqt_patch *patch,
                       store_reads *reads, char **error) {
    const store_query_options *options = question->options;
    const rqt_code code_eps = question->eps;
    question->over = question->too_large = false;
    memset(patch, 0, sizeof *patch);
    if (reads) memset(reads, 0, sizeof *reads);
    int32_t box[4];
    if (!rqt_region_box(question->region, &box[0], &box[2], &box[1], &box[3])) return SQLITE_OK;
    answer_list list = {0};
    char *sentence = NULL;
    int code = find_answers(s, t, box, options->outline, code_eps, &list, &sentence);
    if (code == SQLITE_OK && options->rule)
        code = refine_answers(s, t, box, options->outline, options->rule, &list, &sentence);
    if (code == SQLITE_OK) {
        rqt_query query = {.lattice = t->lattice,
                           .k = t->k,
                           .region = question->region,
                           .eps = code_eps,
                           .rule = options->rule,
                           .select = options->select,
                           .outline = options->outline,
                           .wants_leaves = options->wants_leaves,
                           .product = options->product,
                           .scratch = s->scratch,
                           .answers = list.rows,
                           .answer_count = list.count,
                           .read_block = read_block,
                           .is_interrupted = is_interrupted};
        reading r = {.store = s,
                     .terrain = t,
                     .query = &query,
                     .reads = options->only_numbers ? NULL : reads,
                     .patch = patch,
                     .question = question,
                     .error = &sentence,
                     .code = SQLITE_OK};
        query.context = &r;
        const rqt_status status = rqt_query_run(&query, store_allocator(), patch);
        code = status == RQT_READ_FAILED || status == RQT_INTERRUPTED ? r.code
                                                                      : store_fail_core(&sentence, status, "query");
        if (code == SQLITE_OK && reads && !reads->rows && !question->over && !question->too_large)
            code = store_begin_reads(&query, options->only_numbers, reads);
    }
    sqlite3_free(list.rows);
    if (code != SQLITE_OK && reads) store_reads_free(reads);
    if (error && sentence) {
        *error = sentence;
        sentence = NULL;
    }
    sqlite3_free(sentence);
    return code;
}

/* -------------------------------------------------------------------------------------- which cells it meets -- */

typedef struct covered {
    bool all, nothing;
} covered;

/* Where a vertex inside the cell of a block is selected its centre is, and both corners in the middle of sides of
 * its parent, on which the centre depends: so all leaves over the cell have vertices of the block for their corners
 * (core/query.c). When none of them is void all leaves are kept, and the mesh has no gap there as far as there are
 * samples; when all are no leaf is. */
static int cover_of(store *s, const store_terrain *t, rqt_block_number number, covered *cover, char **error) {
    const uint8_t *bytes;
    int size;
    rqt_block_header header = {0};
    int code = store_block_bytes(s, t, number, &bytes, &size, error);
    if (code == SQLITE_OK && rqt_block_info(bytes, (size_t)size, &header, NULL) != RQT_OK)
        code = store_fail(error, SQLITE_CORRUPT_VTAB, "terrain %s is damaged: block %llu", t->name, number);
    sqlite3_reset(store_statements(s, t)->bytes);
    *cover = (covered){.all = !header.has_voids && !header.all_void, .nothing = header.all_void};
    return code;
}

static int mark_answer(store *s, const store_terrain *t, const rqt_query *query, const rqt_answer *answer,
                       rqt_cells *cells, char **error) {
    rqt_block_place place;
    const rqt_block *block = NULL;
    covered cover = {false, false};
    int code = SQLITE_OK, read;
    (void)rqt_block_locate(&t->lattice, t->k, answer->number, &place);
    if (!rqt_cells_lack(cells, &t->lattice, &place)) return SQLITE_OK;
    if (rqt_query_selects_inside(query, answer)) {
        if (store_is_interrupted(s, &code)) return code;
        code = cover_of(s, t, answer->number, &cover, error);
        if (code == SQLITE_OK && !cover.all && !cover.nothing)
            code = store_get_block(s, t, answer->number, &block, &read, error);
    }
    if (code != SQLITE_OK) return code;
    if (cover.all)
        rqt_cells_fill(cells, &t->lattice, &place);
    else if (!cover.nothing)
        rqt_query_mark(query, answer, block, cells);
    return SQLITE_OK;
}

static int by_number(const void *a, const void *b) {
    const rqt_answer *p = a, *q = b;
    return (p->number > q->number) - (p->number < q->number);
}

/* The box of all cells, grown outward to whole samples. */
static void box_of(const rqt_cells *cells, int32_t box[4]) {
    const int64_t unit = INT64_C(1) << 20;
    box[0] = (int32_t)(cells->x[0] / unit);
    box[1] = (int32_t)((cells->x[cells->columns] + unit - 1) / unit);
    box[2] = (int32_t)(cells->y[0] / unit);
    box[3] = (int32_t)((cells->y[cells->rows] + unit - 1) / unit);
}

int store_mark(store *s, const store_terrain *t, double eps, const store_query_options *options, rqt_cells *cells,
               rqt_block_number *last, char **error) {
    rqt_query query = {.lattice = t->lattice,
                       .k = t->k,
                       .eps = rqt_code_eps(eps, t->quantum_error),
                       .rule = options->rule,
                       .select = RQT_SELECT_THRESHOLD,
                       .outline = options->outline};
    answer_list list = {0};
    int32_t box[4];
    char *sentence = NULL;
    int code = store_begin_on(s, t, error);
    if (code != SQLITE_OK) return code;
    box_of(cells, box);
    code = find_answers(s, t, box, options->outline, query.eps, &list, &sentence);
    if (code == SQLITE_OK && options->rule && rqt_rule_set_eps(options->rule, eps) == RQT_OK)
        code = refine_answers(s, t, box, options->outline, options->rule, &list, &sentence);
    if (list.count > 0) qsort(list.rows, list.count, sizeof *list.rows, by_number);
    for (size_t i = 0; i < list.count && code == SQLITE_OK; i++) {
        if (list.rows[i].number <= *last) continue;
        code = mark_answer(s, t, &query, &list.rows[i], cells, &sentence);
        if (code == SQLITE_OK) *last = list.rows[i].number;
    }
    sqlite3_free(list.rows);
    store_end(s);
    if (code != SQLITE_OK && error && sentence) {
        *error = sentence;
        sentence = NULL;
    }
    sqlite3_free(sentence);
    return code;
}
