/* chart_draw.c - points as CSV, and as pictures by gnuplot.
 *
 * For each chart there are a CSV file for programs and a gnuplot script that carries its own data: `gnuplot
 * NAME.gp` in the folder draws NAME.svg and NAME.png again, in whatever style the reader changes it to. gnuplot is
 * run as a program; where it is missing, CSV files and scripts are all there is.
 */
#include "chart.h"
#include "format.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum { MISSING_PROGRAM = 127, MOST_SERIES = 32 };

typedef enum cell {
    END,
    SERIES,
    TERRAIN,
    EPS,
    MAX_ERROR,
    RMS_ERROR,
    RATIO, /* max_error over eps */
    SAMPLES,
    VERTICES,
    OVER_MINIMAL, /* vertices over those of `minimal` */
    TRIANGLES,
    BLOCKS,
    BYTES,
    MS,
    FRESH_MS,
    FRESH_BYTES,
    RUNS,
    IS_FRONT,
    AMPLITUDE,
    SIDE
} cell;

static const char *const CELL_NAMES[] = {[SERIES] = "series",
                                         [TERRAIN] = "terrain",
                                         [EPS] = "eps",
                                         [MAX_ERROR] = "max_error",
                                         [RMS_ERROR] = "rms_error",
                                         [RATIO] = "max_error_over_eps",
                                         [SAMPLES] = "samples",
                                         [VERTICES] = "vertices",
                                         [OVER_MINIMAL] = "vertices_over_minimal",
                                         [TRIANGLES] = "triangles",
                                         [BLOCKS] = "blocks",
                                         [BYTES] = "bytes",
                                         [MS] = "ms",
                                         [FRESH_MS] = "fresh_ms",
                                         [FRESH_BYTES] = "fresh_bytes",
                                         [RUNS] = "runs",
                                         [IS_FRONT] = "front",
                                         [AMPLITUDE] = "noise",
                                         [SIDE] = "side"};

typedef struct chart_plan {
    const char *name, *heading;
    bool draws_all; /* also methods whose mesh is another's, and only the time differs */
    cell cells[16];
    cell x, y;            /* of logarithmic axes; FRESH_MS: of both kinds of times */
    const char *settings; /* gnuplot: axes; a second panel is set where it is drawn */
} chart_plan;

#define ERROR_AXIS(axis) \
    "set logscale " axis "\nset " axis "label 'true maximum error, metres'\nset format " axis " '%g'\n"

static const chart_plan PLANS[] = {
    [CHART_ERROR_VERTICES] = {"1-error-vertices",
                              "True error against vertices",
                              false,
                              {SERIES, EPS, MAX_ERROR, RMS_ERROR, VERTICES, TRIANGLES},
                              VERTICES,
                              MAX_ERROR,
                              ERROR_AXIS("y") "set logscale x\nset xlabel 'vertices'\nset format x '%.0s%c'\n"
                                              "set key top right\n"},
    [CHART_ERROR_EPS] = {"2-error-eps",
                         "True error over the tolerance that was asked for",
                         false,
                         {SERIES, EPS, MAX_ERROR, RATIO, RMS_ERROR},
                         EPS,
                         MAX_ERROR,
                         ERROR_AXIS("y") "set logscale x\nset xlabel 'tolerance asked for, metres'\n"
                                         "set format x '%g'\nset key top left\n"},
    [CHART_TIME_ERROR] = {"3-time-error",
                          "Time against true error",
                          true,
                          {SERIES, EPS, MAX_ERROR, MS, FRESH_MS, RUNS, BLOCKS, BYTES, FRESH_BYTES},
                          MAX_ERROR,
                          FRESH_MS,
                          ERROR_AXIS("x") "set logscale y\nset ylabel 'milliseconds'\nset format y '%g'\n"
                                          "set key outside right\n"},
    [CHART_FRONT] = {"4-front",
                     "Time, true error and vertices: what nothing else beats in all three is ringed",
                     true,
                     {SERIES, EPS, MS, MAX_ERROR, VERTICES, IS_FRONT},
                     MS,
                     MAX_ERROR,
                     ERROR_AXIS(
                         "y") "set logscale x\nset xlabel 'milliseconds'\nset format x '%g'\nset logscale cb\n"
                              "set cblabel 'vertices' offset 1.5\nset format cb '%.0s%c'\n"
                              "set palette defined (0 '#fde725', 1 '#5ec962', 2 '#21918c', 3 '#3b528b', 4 "
                              "'#440154')\nset key bottom left\n"},
    [CHART_NOISE] = {"5-noise",
                     "White noise on top of the terrain",
                     false,
                     {SERIES, TERRAIN, AMPLITUDE, EPS, MAX_ERROR, VERTICES, OVER_MINIMAL},
                     END,
                     END,
                     "set xlabel 'largest noise, metres'\nset format x '%g'\n"},
    [CHART_SIZE] = {"6-size",
                    "The same window out of ever larger terrains",
                    false,
                    {SERIES, TERRAIN, SIDE, EPS, VERTICES, MS, FRESH_MS, RUNS, BLOCKS, BYTES, FRESH_BYTES},
                    SIDE,
                    END,
                    "set logscale x 2\nset xlabel 'samples along a side of the terrain'\nset format x '%.0f'\n"},
    [CHART_ALL] = {"rows",
                   "",
                   true,
                   {SERIES, TERRAIN, EPS, MAX_ERROR, RMS_ERROR, SAMPLES, VERTICES, TRIANGLES, BLOCKS, BYTES, MS,
                    FRESH_MS, FRESH_BYTES, RUNS, IS_FRONT},
                   END,
                   END,
                   NULL}};

/* --------------------------------------------------------------------------------------------- numbers -- */
static void write_double(FILE *file, double value, const char *missing) {
    char text[32];
    if (value < 0)
        fputs(missing, file);
    else if (format_double(value, text) > 0)
        fputs(text, file);
}

/* Of what is not negative. */
static void write_count(FILE *file, int64_t count, const char *missing) {
    if (count < 0)
        fputs(missing, file);
    else
        fprintf(file, "%lld", (long long)count);
}

/* Times are not worth more than a microsecond. */
static void write_time(FILE *file, double ms, const char *missing) {
    if (ms < 0)
        fputs(missing, file);
    else
        fprintf(file, "%.3f", ms);
}

/* Vertices over those of `minimal` on the same terrain at the same tolerance; -1 when it was not measured. */
static double over_minimal(const chart_points *points, const chart_point *p) {
    for (int i = 0; i < points->count; i++) {
        const chart_point *m = &points->rows[i];
        if (!strcmp(m->series, "minimal") && m->eps == p->eps && !strcmp(m->terrain, p->terrain) && m->vertices)
            return (double)p->vertices / (double)m->vertices;
    }
    return -1;
}

static void write_cell(FILE *file, cell which, const chart_points *points, const chart_point *p,
                       const char *missing) {
    switch (which) {
    case SERIES:
        fputs(p->series, file);
        break;
    case TERRAIN:
        fputs(p->terrain, file);
        break;
    case EPS:
        write_double(file, p->eps, missing);
        break;
    case MAX_ERROR:
        write_double(file, p->max_error, missing);
        break;
    case RMS_ERROR:
        write_double(file, p->rms_error, missing);
        break;
    case RATIO:
        if (p->eps > 0)
            fprintf(file, "%.4f", p->max_error / p->eps);
        else
            fputs(missing, file);
        break;
    case SAMPLES:
        write_count(file, p->samples, missing);
        break;
    case VERTICES:
        write_count(file, p->vertices, missing);
        break;
    case OVER_MINIMAL: {
        const double ratio = over_minimal(points, p);
        if (ratio < 0)
            fputs(missing, file);
        else
            fprintf(file, "%.4f", ratio);
        break;
    }
    case TRIANGLES:
        write_count(file, p->triangles, missing);
        break;
    case BLOCKS:
        write_count(file, p->blocks, missing);
        break;
    case BYTES:
        write_count(file, p->bytes, missing);
        break;
    case MS:
        write_time(file, p->ms, missing);
        break;
    case FRESH_MS:
        write_time(file, p->fresh_ms, missing);
        break;
    case FRESH_BYTES:
        write_count(file, p->fresh_bytes, missing);
        break;
    case RUNS:
        write_count(file, p->runs, missing);
        break;
    case IS_FRONT:
        fputc(p->is_front ? '1' : '0', file);
        break;
    case AMPLITUDE:
        write_double(file, p->amplitude, missing);
        break;
    case SIDE:
        write_count(file, p->side, missing);
        break;
    case END:
        break;
    }
}

static void write_csv(FILE *file, const chart_plan *plan, const chart_points *points) {
    for (const cell *c = plan->cells; *c; c++) fprintf(file, "%s%s", c == plan->cells ? "" : ",", CELL_NAMES[*c]);
    fputc('\n', file);
    for (int i = 0; i < points->count; i++) {
        for (const cell *c = plan->cells; *c; c++) {
            if (c != plan->cells) fputc(',', file);
            write_cell(file, *c, points, &points->rows[i], "");
        }
        fputc('\n', file);
    }
}

/* ----------------------------------------------------------------------------------------------- series -- */
typedef struct series_list {
    const char *names[MOST_SERIES];
    int count;
} series_list;

static bool is_listed(const series_list *list, const char *name, size_t length) {
    for (int i = 0; i < list->count; i++)
        if (strlen(list->names[i]) == length && !strncmp(list->names[i], name, length)) return true;
    return false;
}

/* In the order of their first points. local/topdown is the mesh of local: drawn where that is not, or where times
 * are. */
static void list_series(const chart_plan *plan, const chart_points *points, series_list *list) {
    series_list metrics = {.count = 0};
    for (int i = 0; i < points->count && metrics.count < MOST_SERIES; i++)
        if (!is_listed(&metrics, points->rows[i].series, strlen(points->rows[i].series)))
            metrics.names[metrics.count++] = points->rows[i].series;
    *list = (series_list){.count = 0};
    for (int i = 0; i < metrics.count; i++) {
        const char *name = metrics.names[i], *slash = strchr(name, '/');
        if (plan->draws_all || !slash || !is_listed(&metrics, name, (size_t)(slash - name)))
            list->names[list->count++] = name;
    }
}

typedef struct look {
    const char *begins; /* names of series begin so */
    const char *colour; /* safe for eyes that confuse red and green (Okabe and Ito) */
    int point;          /* gnuplot's number of a point type */
} look;

static const look LOOKS[] = {{"exact", "#0072b2", 7},   {"minimal", "#000000", 5}, {"local", "#e69f00", 9},
                             {"wedgie", "#d55e00", 11}, {"euclid", "#cc79a7", 13}, {"greedy TIN", "#009e73", 15},
                             {"RTIN", "#56b4e9", 3},    {"", "#777777", 2}};

static const look *look_of(const char *name) {
    const look *l = LOOKS;
    while (strncmp(name, l->begins, strlen(l->begins))) l++;
    return l;
}

/* How the line of a series is drawn: the look of its metric, dashed for other ways to select. */
static void write_line(FILE *file, const char *name) {
    const look *l = look_of(name);
    const char *slash = strchr(name, '/');
    const int dash = !slash ? 1 : slash[1] == 't' ? 2 : 3;
    fprintf(file, "with linespoints lc rgb '%s' lw %s pt %d ps %s dt %d", l->colour,
            !strcmp(name, "exact") ? "4" : "1.6", slash ? l->point - 1 : l->point,
            !strcmp(name, "exact") ? "1.2" : "0.8", dash);
}

/* ---------------------------------------------------------------------------------------------- scripts -- */
/* Columns of every data block. */
#define X_EPS "1"
#define X_ERROR "($2>0?$2:NaN)"
#define X_VERTICES "($3>0?$3:NaN)"
#define X_MS "($4>0?$4:NaN)"
#define X_FRESH "($5>0?$5:NaN)"
#define X_BYTES "6"
#define X_AMPLITUDE "7"
#define X_SIDE "8"
#define X_RATIO "9"
#define X_FRESH_BYTES "11"
static const cell BLOCK[] = {EPS,       MAX_ERROR, VERTICES,     MS,       FRESH_MS,    BYTES,
                             AMPLITUDE, SIDE,      OVER_MINIMAL, IS_FRONT, FRESH_BYTES, END};

static void write_blocks(FILE *file, const series_list *list, const chart_points *points) {
    for (int s = 0; s < list->count; s++) {
        fprintf(file, "\n# %s:", list->names[s]);
        for (const cell *c = BLOCK; *c; c++) fprintf(file, " %s", CELL_NAMES[*c]);
        fprintf(file, "\n$series%d << EOD\n", s);
        for (int i = 0; i < points->count; i++) {
            const chart_point *p = &points->rows[i];
            if (strcmp(p->series, list->names[s])) continue;
            for (const cell *c = BLOCK; *c; c++) {
                if (c != BLOCK) fputc(' ', file);
                write_cell(file, *c, points, p, "NaN");
            }
            fputc('\n', file);
        }
        fputs("EOD\n", file);
    }
}

/* A text in gnuplot's single quotes. */
static void write_text(FILE *file, const char *text) {
    fputc('\'', file);
    for (; *text; text++) {
        if (*text == '\'') fputc('\'', file);
        if (*text != '\n') fputc(*text, file);
    }
    fputc('\'', file);
}

static void write_head(FILE *file, const chart_plan *plan) {
    fprintf(file,
            "# %s - gnuplot %s.gp draws %s.svg and %s.png\nset encoding utf8\nset tmargin 4.5\nset bmargin 5\n"
            "set border 3 lc rgb '#444444'\nset tics nomirror\nset grid lt 1 dt 1 lc rgb '#e4e4e4' lw 0.7\n"
            "set key noenhanced samplen 2.5 spacing 1.15\n",
            plan->name, plan->name, plan->name, plan->name);
    fputs(plan->settings, file);
}

/* Above the panel, or above both. The second of a pair takes them away, so that they are drawn once. */
static void write_headings(FILE *file, const chart_sheet *sheet, const chart_plan *plan, bool is_pair) {
    const char *where = is_pair ? "screen 0.5" : "graph 0.5";
    fputs("  set label 1 ", file);
    write_text(file, plan->heading);
    fprintf(file, " at %s,screen 0.96 center noenhanced font ',14'\n  set label 2 ", where);
    write_text(file, sheet->title);
    fprintf(file, " at %s,screen 0.915 center noenhanced font ',10' textcolor rgb '#444444'\n  set label 3 ",
            where);
    write_text(file, sheet->note);
    fputs(" at screen 0.99,0.015 right noenhanced font ',8' textcolor rgb '#777777'\n", file);
}

/* Metrics whose first query on a new connection is drawn: what is stored, and the best of what is computed. */
static bool shows_fresh(const char *series) {
    return !strcmp(series, "exact") || !strcmp(series, "minimal");
}

/* Of a logarithmic axis: what the series have, and a little more. */
static void write_range(FILE *file, const char *axis, cell which, const series_list *list,
                        const chart_points *points) {
    double low = INFINITY, high = 0;
    for (int i = 0; i < points->count; i++) {
        const chart_point *p = &points->rows[i];
        if (!is_listed(list, p->series, strlen(p->series))) continue;
        const bool is_fresh = which == FRESH_MS && shows_fresh(p->series);
        const double value = which == EPS         ? p->eps
                             : which == MAX_ERROR ? p->max_error
                             : which == VERTICES  ? (double)p->vertices
                             : which == SIDE      ? (double)p->side
                             : is_fresh           ? fmax(p->ms, p->fresh_ms)
                                                  : p->ms;
        if (value > 0) high = fmax(high, value);
        if (value > 0) low = fmin(low, which == FRESH_MS ? p->ms : value);
    }
    if (low > 0 && low <= high) fprintf(file, "set %srange [%.6g:%.6g]\n", axis, low / 1.25, high * 1.25);
}

static const char EACH_FORM[] =
    "\ndo for [form in 'svg png'] {\n"
    "  if (form eq 'svg') { set terminal svg size %d,640 dynamic font 'DejaVu Sans,12' background '#ffffff' }\n"
    "  else { set terminal pngcairo size %d,704 font 'DejaVu Sans,12' fontscale 1.02 linewidth 1.15 pointscale "
    "1.15 "
    "}\n"
    "  set output '%s.'.form\n";

/* plot of all series, x and y being gnuplot's expressions of columns. `more` goes before the first. */
static void write_plot(FILE *file, const series_list *list, const char *x, const char *y, const char *more) {
    fprintf(file, "  plot %s", more);
    for (int s = 0; s < list->count; s++) {
        fprintf(file, "%s$series%d using %s:%s ", s || *more ? ", \\\n    " : "", s, x, y);
        write_line(file, list->names[s]);
        fputs(" title ", file);
        write_text(file, list->names[s]);
    }
    fputc('\n', file);
}

/* The first query of a connection beside the warm ones. */
static void write_times(FILE *file, const series_list *list, const char *x) {
    char more[1000] = "";
    for (int s = 0; s < list->count; s++) {
        const size_t length = strlen(more);
        if (shows_fresh(list->names[s]))
            snprintf(more + length, sizeof more - length,
                     "%s$series%d using %s:" X_FRESH " with linespoints lc rgb '%s' lw 1.2 pt %d ps 0.8 dt (6,4) "
                     "title '%s, new connection'",
                     length ? ", \\\n    " : "", s, x, look_of(list->names[s])->colour,
                     look_of(list->names[s])->point - 1, list->names[s]);
    }
    write_plot(file, list, x, X_MS, more);
}

static void write_front(FILE *file, const series_list *list) {
    fputs("  plot ", file);
    for (int s = 0; s < list->count; s++)
        fprintf(file,
                "$series%d using ($10>0?$4:NaN):" X_ERROR
                " with points pt 6 ps 2.2 lw 1.5 lc rgb '#cc0000' notitle, \\\n    ",
                s);
    for (int s = 0; s < list->count; s++) {
        const look *l = look_of(list->names[s]);
        const int point = strchr(list->names[s], '/') ? l->point - 1 : l->point;
        fprintf(file,
                "%s$series%d using " X_MS ":" X_ERROR ":" X_VERTICES " with points pt %d ps 1.1 lc palette notitle",
                s ? ", \\\n    " : "", s, point);
        fprintf(file, ", \\\n    NaN with points pt %d ps 1.1 lc rgb '#444444' title ", point);
        write_text(file, list->names[s]);
    }
    fputc('\n', file);
}

/* Two panels side by side; the headings are drawn with the first. */
static void write_left(FILE *file) {
    fputs("  set multiplot\n  set origin 0,0\n  set size 0.5,1\n", file);
}
static void write_right(FILE *file) {
    fputs("  set origin 0.5,0\n  unset label\n", file);
}

static void write_noise(FILE *file, const series_list *list, const chart_points *points) {
    const bool has_minimal = is_listed(list, "minimal", strlen("minimal"));
    if (has_minimal) write_left(file);
    fputs("  set logscale y\n  set ylabel 'vertices'\n  set format y '%.0s%c'\n  set key bottom right\n", file);
    write_range(file, "y", VERTICES, list, points); /* the panel on the right has another, from the form before */
    write_plot(file, list, X_AMPLITUDE, X_VERTICES, "");
    if (!has_minimal) return;
    write_right(file);
    fputs("  set ylabel 'vertices over those of minimal'\n  set format y '%g'\n  set yrange [0.7:*]\n  set key top "
          "right\n",
          file);
    write_plot(file, list, X_AMPLITUDE, X_RATIO, "");
    fputs("  unset multiplot\n", file);
}

static void write_size(FILE *file, const series_list *list) {
    write_left(file);
    fputs("  set yrange [0:*]\n  set ylabel 'milliseconds'\n  set format y '%g'\n  set key center right\n", file);
    write_times(file, list, X_SIDE);
    write_right(file);
    fputs("  set ylabel 'bytes'\n  set format y '%.0s %cB'\n", file);
    fputs(
        "  plot $series0 using " X_SIDE ":" X_FRESH_BYTES
        " with linespoints lc rgb '#0072b2' lw 1.2 pt 6 ps 0.8 dt (6,4) title 'pages of the file, new connection', "
        "\\\n    $series0 using " X_SIDE ":" X_BYTES
        " with linespoints lc rgb '#0072b2' lw 2.5 pt 7 ps 0.8 title 'blocks of the answer'\n",
        file);
    fputs("  unset multiplot\n", file);
}

static void write_script(FILE *file, const chart_sheet *sheet, chart_kind kind, const chart_plan *plan,
                         const chart_points *points) {
    series_list list;
    list_series(plan, points, &list);
    const bool is_pair = kind == CHART_NOISE || kind == CHART_SIZE;
    write_head(file, plan);
    if (plan->x) write_range(file, "x", plan->x, &list, points);
    if (plan->y) write_range(file, "y", plan->y, &list, points);
    if (kind == CHART_FRONT) write_range(file, "cb", VERTICES, &list, points);
    write_blocks(file, &list, points);
    fprintf(file, EACH_FORM, is_pair ? 1200 : 1000, is_pair ? 1320 : 1100, plan->name);
    write_headings(file, sheet, plan, is_pair);
    switch (kind) {
    case CHART_ERROR_VERTICES:
        write_plot(file, &list, X_VERTICES, X_ERROR, "");
        break;
    case CHART_ERROR_EPS:
        write_plot(file, &list, "($1>0?$1:NaN)", X_ERROR, "x with lines lc rgb '#999999' dt 2 title 'y = x'");
        break;
    case CHART_TIME_ERROR:
        write_times(file, &list, X_ERROR);
        break;
    case CHART_FRONT:
        write_front(file, &list);
        break;
    case CHART_NOISE:
        write_noise(file, &list, points);
        break;
    case CHART_SIZE:
        write_size(file, &list);
        break;
    case CHART_ALL:
        break;
    }
    fputs("  unset output\n}\n", file);
}

/* ------------------------------------------------------------------------------------------------ files -- */
static bool path_of(const chart_sheet *sheet, const chart_plan *plan, const char *ending, char path[4096]) {
    const int length = snprintf(path, 4096, "%s/%s.%s", sheet->folder, plan->name, ending);
    return length > 0 && length < 4096;
}

/* CSV or script; false after a sentence. */
static bool write_file(const chart_sheet *sheet, chart_kind kind, bool is_csv, const chart_points *points) {
    const chart_plan *plan = &PLANS[kind];
    char path[4096];
    if (!path_of(sheet, plan, is_csv ? "csv" : "gp", path)) {
        cli_fail("the folder's name is too long");
        return false;
    }
    FILE *file = fopen(path, "we");
    if (file && is_csv) write_csv(file, plan, points);
    if (file && !is_csv) write_script(file, sheet, kind, plan, points);
    bool ok = file && !ferror(file);
    if (file && fclose(file)) ok = false;
    if (!ok) cli_fail("%s cannot be written: %s", path, strerror(errno));
    return ok;
}

/* gnuplot NAME.gp in the folder; what it has to say goes to stderr. Its exit status, MISSING_PROGRAM when there is
 * no gnuplot, -1 when it was killed. */
static int run_gnuplot(const char *folder, const char *script) {
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        if (chdir(folder)) _exit(1);
        execlp("gnuplot", "gnuplot", script, (char *)NULL);
        _exit(errno == ENOENT || errno == EACCES ? MISSING_PROGRAM : 1);
    }
    int status = -1;
    if (child > 0)
        while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
        }
    return child > 0 && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static bool draw_pictures(chart_sheet *sheet, const chart_plan *plan) {
    char script[64], path[4096];
    snprintf(script, sizeof script, "%s.gp", plan->name);
    const int status = run_gnuplot(sheet->folder, script);
    if (status == 0) {
        sheet->pictures += 2;
        return true;
    }
    if (status == MISSING_PROGRAM) {
        cli_say("gnuplot is not installed: the figures are in %s as CSV, pictures need gnuplot", sheet->folder);
        sheet->has_gnuplot = false;
        return true;
    }
    /* Half a picture is none. */
    static const char *const endings[] = {"svg", "png"};
    for (int i = 0; i < 2; i++)
        if (path_of(sheet, plan, endings[i], path)) unlink(path);
    cli_fail("gnuplot could not draw %s/%s", sheet->folder, script);
    return false;
}

/* Axes are logarithmic: meshes without any error are in the CSV alone. */
static bool has_something_to_draw(chart_kind kind, const chart_points *points) {
    for (int i = 0; i < points->count; i++)
        if (points->rows[i].vertices > 0 && (points->rows[i].max_error > 0 || kind >= CHART_NOISE)) return true;
    return false;
}

bool chart_draw(chart_sheet *sheet, chart_kind kind, const chart_points *points) {
    const chart_plan *plan = &PLANS[kind];
    if (!write_file(sheet, kind, true, points)) return false;
    if (kind == CHART_ALL) return true;
    if (!has_something_to_draw(kind, points)) {
        cli_say("no mesh has an error: %s is not drawn", plan->name);
        return true;
    }
    if (!write_file(sheet, kind, false, points)) return false;
    return !sheet->has_gnuplot || draw_pictures(sheet, plan);
}
