/* report.c - what the sources are like together: a few sentences for people, and all of it as GeoJSON, which QGIS
 * opens as it is.
 *
 * Each finding is a feature with a rectangle in the terrain's coordinates, half a cell around its samples, so that
 * a border of one row can be seen: gap (no source covers it), overlap (two sources share more than a border),
 * conflict (two sources differ; the rectangle is what they share). RFC 7946 wants WGS 84; a member "crs" as in the
 * older GeoJSON names any other system, and GDAL and QGIS follow it.
 */
#include "source.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define MOST_TOLD 3 /* of a kind, in sentences */

static double x_of(const import_findings *f, double column) {
    return f->mosaic->placement.x0 + column * f->mosaic->placement.dx;
}

static double y_of(const import_findings *f, double row) {
    return f->mosaic->placement.y0 + row * f->mosaic->placement.dy;
}

/* Metres of a difference of values. */
static double metres_of(const import_findings *f, double difference) {
    return difference * fabs(rqt_unit_factor(&f->mosaic->scheme.unit));
}

static const char *name_of(const import_findings *f, int32_t source) {
    return f->sources[source].path;
}

static int by_worst_conflict(const void *a, const void *b) {
    const import_conflict *x = a, *y = b;
    if (x->largest != y->largest) return x->largest > y->largest ? -1 : 1;
    if (x->differ != y->differ) return x->differ > y->differ ? -1 : 1;
    return x->a != y->a ? (x->a < y->a ? -1 : 1) : (x->b > y->b) - (x->b < y->b);
}

/* What two sources share. */
static import_window shared_window(const import_findings *f, int32_t a, int32_t b) {
    const import_mosaic *m = f->mosaic;
    const int32_t *column = m->column, *row = m->row;
    import_window w = {column[a] > column[b] ? column[a] : column[b], row[a] > row[b] ? row[a] : row[b], 0, 0};
    const int32_t right[2] = {column[a] + f->sources[a].width - 1, column[b] + f->sources[b].width - 1};
    const int32_t bottom[2] = {row[a] + f->sources[a].height - 1, row[b] + f->sources[b].height - 1};
    w.column1 = right[0] < right[1] ? right[0] : right[1];
    w.row1 = bottom[0] < bottom[1] ? bottom[0] : bottom[1];
    return w;
}

/* ------------------------------------------------------------------------------------------------- sentences -- */
/* "and 12 more", once, behind those that were told. */
static const char *more(char out[40], size_t all, size_t told) {
    if (all > told)
        snprintf(out, 40, "; and %zu more", all - told);
    else
        out[0] = 0;
    return out;
}

static void tell_gaps(const import_job *job, const import_findings *f) {
    const import_cover *c = f->cover;
    size_t inside = 0;
    int64_t samples = 0, all = 0;
    for (size_t i = 0; i < c->gaps; i++) {
        const int64_t n = import_window_samples(&c->gap[i].window);
        all += n;
        if (!c->gap[i].inside) continue;
        inside++;
        samples += n;
    }
    if (c->gaps > inside)
        import_notice(job, "no source covers %lld samples at the edge of the terrain (%zu rectangle%s): voids",
                      (long long)(all - samples), c->gaps - inside, c->gaps - inside == 1 ? "" : "s");
    for (size_t i = 0; i < inside && i < MOST_TOLD; i++) {
        const import_window *w = &c->gap[i].window;
        char rest[40];
        import_notice(
            job,
            "a gap inside the terrain: no source covers columns %d to %d, rows %d to %d (x %.10g to %.10g, "
            "y %.10g to %.10g)%s",
            w->column0, w->column1, w->row0, w->row1, x_of(f, w->column0), x_of(f, w->column1), y_of(f, w->row1),
            y_of(f, w->row0), i + 1 == MOST_TOLD ? more(rest, inside, MOST_TOLD) : "");
    }
}

static void tell_overlaps(const import_job *job, const import_findings *f) {
    const import_cover *c = f->cover;
    for (size_t i = 0; i < c->overlaps && i < MOST_TOLD; i++) {
        const import_overlap *o = &c->overlap[i];
        char rest[40];
        import_notice(job, "%s and %s overlap by %d x %d samples, from (%.10g, %.10g)%s", name_of(f, o->a),
                      name_of(f, o->b), o->window.column1 - o->window.column0 + 1,
                      o->window.row1 - o->window.row0 + 1, x_of(f, o->window.column0), y_of(f, o->window.row0),
                      i + 1 == MOST_TOLD ? more(rest, c->overlaps, MOST_TOLD) : "");
    }
}

static void tell_conflicts(const import_job *job, const import_findings *f) {
    const import_conflicts *c = f->conflicts;
    if (f->report->overlap_differs > 0)
        import_notice(job, "%lld of %lld samples that several sources have differ: the later source won",
                      (long long)f->report->overlap_differs, (long long)f->report->overlap);
    for (size_t i = 0; i < c->count && i < MOST_TOLD; i++) {
        const import_conflict *p = &c->pair[i];
        const import_window w = shared_window(f, p->a, p->b);
        char rest[40];
        import_notice(
            job, "%s and %s differ in %lld of the %lld samples that they share, most by %.6g m at (%.10g, %.10g)%s",
            name_of(f, p->a), name_of(f, p->b), (long long)p->differ, (long long)import_window_samples(&w),
            metres_of(f, p->largest), x_of(f, p->column), y_of(f, p->row),
            i + 1 == MOST_TOLD ? more(rest, c->count, MOST_TOLD) : "");
    }
}

void import_findings_tell(const import_job *job, const import_findings *f) {
    if (f->conflicts->count)
        qsort(f->conflicts->pair, f->conflicts->count, sizeof *f->conflicts->pair, by_worst_conflict);
    if (f->conflicts->slots) memset(f->conflicts->slot, 0, f->conflicts->slots * sizeof *f->conflicts->slot);
    tell_gaps(job, f);
    tell_overlaps(job, f);
    tell_conflicts(job, f);
}

/* --------------------------------------------------------------------------------------------------- GeoJSON -- */
/* A string of JSON. Bytes that are no UTF-8 are left to the reader, as file names are bytes. */
static void put_text(FILE *file, const char *text) {
    putc('"', file);
    for (const char *c = text; *c; c++) {
        if (*c == '"' || *c == '\\')
            fprintf(file, "\\%c", *c);
        else if ((unsigned char)*c < 0x20)
            fprintf(file, "\\u%04x", (unsigned)*c);
        else
            putc(*c, file);
    }
    putc('"', file);
}

static void put_key(FILE *file, const char *key, const char *text) {
    fprintf(file, ",\"%s\":", key);
    put_text(file, text);
}

static void begin_feature(FILE *file, const import_findings *f, bool *first, const char *kind,
                          const import_window *w) {
    const double x[2] = {x_of(f, w->column0 - 0.5), x_of(f, w->column1 + 0.5)},
                 y[2] = {y_of(f, w->row0 - 0.5), y_of(f, w->row1 + 0.5)};
    fprintf(file,
            "%s\n{\"type\":\"Feature\",\"geometry\":{\"type\":\"Polygon\",\"coordinates\":[[[%.17g,%.17g],[%.17g,%."
            "17g],"
            "[%.17g,%.17g],[%.17g,%.17g],[%.17g,%.17g]]]},\n "
            "\"properties\":{\"kind\":\"%s\",\"column0\":%d,\"row0\":%d,"
            "\"column1\":%d,\"row1\":%d,\"samples\":%lld",
            *first ? "" : ",", x[0], y[1], x[1], y[1], x[1], y[0], x[0], y[0], x[0], y[1], kind, w->column0,
            w->row0, w->column1, w->row1, (long long)import_window_samples(w));
    *first = false;
}

static void put_features(FILE *file, const import_findings *f) {
    bool first = true;
    for (size_t i = 0; i < f->cover->gaps; i++) {
        begin_feature(file, f, &first, "gap", &f->cover->gap[i].window);
        fprintf(file, ",\"inside\":%s}}", f->cover->gap[i].inside ? "true" : "false");
    }
    for (size_t i = 0; i < f->cover->overlaps; i++) {
        const import_overlap *o = &f->cover->overlap[i];
        begin_feature(file, f, &first, "overlap", &o->window);
        put_key(file, "source_a", name_of(f, o->a));
        put_key(file, "source_b", name_of(f, o->b));
        fputs("}}", file);
    }
    for (size_t i = 0; i < f->conflicts->count; i++) {
        const import_conflict *c = &f->conflicts->pair[i];
        const import_window w = shared_window(f, c->a, c->b);
        begin_feature(file, f, &first, "conflict", &w);
        put_key(file, "source_a", name_of(f, c->a));
        put_key(file, "source_b", name_of(f, c->b));
        fprintf(file,
                ",\"differ\":%lld,\"largest\":%.17g,\"worst_x\":%.17g,\"worst_y\":%.17g,\"worst_column\":%d,"
                "\"worst_row\":%d,\"first_column\":%d,\"first_row\":%d}}",
                (long long)c->differ, metres_of(f, c->largest), x_of(f, c->column), y_of(f, c->row), c->column,
                c->row, c->first_column, c->first_row);
    }
}

static void put_all(FILE *file, const import_findings *f) {
    const import_report *r = f->report;
    fputs("{\"type\":\"FeatureCollection\",\n\"name\":", file);
    put_text(file, r->name);
    if (f->crs->srid && f->crs->srid != 4326)
        fprintf(file, ",\n\"crs\":{\"type\":\"name\",\"properties\":{\"name\":\"urn:ogc:def:crs:EPSG::%d\"}}",
                f->crs->srid);
    fprintf(file,
            ",\n\"import\":{\"sources\":%lld,\"width\":%d,\"height\":%d,\"samples\":%lld,\"voids\":%lld,"
            "\"overlap\":%lld,\"overlap_differs\":%lld,\"samples_read\":%lld,\"samples_resumed\":%lld},",
            (long long)r->sources, f->mosaic->lattice.width, f->mosaic->lattice.height, (long long)r->samples,
            (long long)r->voids, (long long)r->overlap, (long long)r->overlap_differs, (long long)r->samples_read,
            (long long)r->samples_resumed);
    fputs("\n\"features\":[", file);
    put_features(file, f);
    fputs("\n]}\n", file);
}

/* It is written beside its place, and then put there. NULL after a sentence. */
static char *part_of(const import_job *job) {
    const char *path = job->options->report;
    static const char ending[] = ".part";
    const size_t length = strlen(path);
    char *part = malloc(length + sizeof ending);
    if (!part) {
        import_no_memory(job, "writing the report");
        return NULL;
    }
    memcpy(part, path, length);
    memcpy(part + length, ending, sizeof ending);
    return part;
}

static bool refuse_report(const import_job *job, const char *why) {
    return import_refuse(job, "the report %s cannot be written: %s", job->options->report, why);
}

bool import_findings_probe(const import_job *job) {
    struct stat there;
    if (!stat(job->options->report, &there) && !S_ISREG(there.st_mode))
        return refuse_report(job, S_ISDIR(there.st_mode) ? "it is a folder" : "it is a device, and not a file");
    char *part = part_of(job);
    if (!part) return false;
    FILE *file = fopen(part, "w");
    const int why = errno;
    if (file) {
        fclose(file);
        unlink(part);
    }
    free(part);
    return file || refuse_report(job, strerror(why));
}

bool import_findings_write(const import_job *job, const import_findings *f) {
    const char *path = job->options->report;
    if (!path) return true;
    char *part = part_of(job);
    if (!part) return false;
    FILE *file = fopen(part, "w");
    bool ok = file != NULL;
    if (ok) {
        put_all(file, f);
        ok = !ferror(file) & (fclose(file) == 0);
        ok = ok && rename(part, path) == 0;
        const int why = errno;
        if (!ok) unlink(part);
        errno = why;
    }
    free(part);
    return ok || refuse_report(job, strerror(errno));
}
