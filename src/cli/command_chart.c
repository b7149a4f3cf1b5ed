/* command_chart.c - rqt chart: what each method costs and gives, over tolerances, as CSV and pictures.
 *
 * Charts 1 to 4 are of one terrain: true error, vertices and time of every method, and of peers whose meshes were
 * measured elsewhere. Charts 5 and 6 are of families: terrains that differ in one thing only and say it in their
 * names, STEM_noise_AMPLITUDE and STEM_size_SIDE. Members of a family are not asked for when charts 1 to 4 look for
 * the only terrain.
 */
#include "chart.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char HELP[] =
    "rqt chart: speed against accuracy, method by method\n"
    "\n"
    "Usage: rqt chart DATABASE -o DIR [OPTION...]\n"
    "\n"
    "Makes the mesh of a terrain with every method at every tolerance, has each verified against all samples,\n"
    "takes the time, and writes into DIR, as CSV, SVG and PNG (pictures need gnuplot):\n"
    "  1-error-vertices   true error against vertices\n"
    "  2-error-eps        true error over the tolerance that was asked for\n"
    "  3-time-error       time against true error\n"
    "  4-front            time, error and vertices: what nothing else beats in all three\n"
    "  5-noise            vertices over the noise of terrains named STEM_noise_AMPLITUDE\n"
    "  6-size             time and bytes read over the size of terrains named STEM_size_SIDE\n"
    "  rows.csv           everything measured for 1 to 4\n"
    "Each NAME.gp is the gnuplot script of a picture. Charts without data are left out, and the command says so.\n"
    "\n"
    "Options:\n"
    "  -o DIR          the folder to write into; it is made when it is missing\n"
    "  --eps E         tolerances in metres (default: 1,2,5,10,20,50,100)\n"
    "  --methods M     a list of exact, minimal, local, wedgie, euclid, each alone or followed by /topdown or\n"
    "                  /bottomup (default: the five, exact/topdown and exact/bottomup)\n"
    "  --region R      x0,y0,x1,y1 or WKT, in the terrain's coordinates (default: all)\n"
    "  --terrain T     which terrain (default: the only one outside families)\n"
    "  --runs N        times that a query is run for its median, 1 to 99 (default: 5; fewer when it is slow)\n"
    "  --peers FILE    rows of other programs' meshes of the same samples (see make chart); may be repeated\n"
    "  --at E          tolerance of charts 5 and 6 in metres (default: 5)\n"
    "  --help          this text\n"
    "\n"
    "Examples:\n"
    "  rqt chart washington.gpkg -o charts\n"
    "  rqt chart washington.gpkg -o charts --eps 1,10,100 --methods exact,local --region -71.4,44.2,-71.2,44.4\n"
    "  rqt chart crop.gpkg -o charts --peers crop-peers.csv\n";

static const struct option OPTIONS[] = {
    {"eps", required_argument, NULL, 'e'},    {"methods", required_argument, NULL, 'm'},
    {"region", required_argument, NULL, 'r'}, {"terrain", required_argument, NULL, 't'},
    {"runs", required_argument, NULL, 'n'},   {"peers", required_argument, NULL, 'p'},
    {"at", required_argument, NULL, 'a'},     {"output", required_argument, NULL, 'o'},
    {"help", no_argument, NULL, 'h'},         {NULL, 0, NULL, 0}};

enum { MOST_PEERS = 8 };

typedef struct job {
    const char *path, *folder, *terrain;
    char *region;
    double eps[CLI_MAX_EPS], at;
    int eps_count, runs, peer_count, method_count;
    const char *peers[MOST_PEERS];
    chart_method methods[CHART_MAX_METHODS];
    sqlite3 *db;
    chart_sheet sheet;
    bool has_sheet; /* one chart or more was written */
} job;

/* --------------------------------------------------------------------------------------- the command line -- */
static int compare_eps(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Lines go from one tolerance to the next larger one. */
static void sort_eps(job *j) {
    qsort(j->eps, (size_t)j->eps_count, sizeof *j->eps, compare_eps);
    int count = 1;
    for (int i = 1; i < j->eps_count; i++)
        if (j->eps[i] > j->eps[count - 1]) j->eps[count++] = j->eps[i];
    j->eps_count = count;
}

static bool read_option(job *j, int option) {
    int64_t runs = 0;
    double at[CLI_MAX_EPS];
    switch (option) {
    case 'o':
        j->folder = optarg;
        if (!*optarg) cli_usage("-o names no folder");
        return *optarg;
    case 't':
        j->terrain = optarg;
        return true;
    case 'r':
        free(j->region);
        return (j->region = cli_region(optarg)) != NULL;
    case 'e':
        return (j->eps_count = cli_eps(optarg, j->eps)) > 0;
    case 'm':
        return (j->method_count = chart_methods(optarg, j->methods)) > 0;
    case 'p':
        if (j->peer_count == MOST_PEERS) cli_usage("--peers: at most %d files", MOST_PEERS);
        if (j->peer_count == MOST_PEERS) return false;
        j->peers[j->peer_count++] = optarg;
        return true;
    case 'a':
        if (!cli_number(optarg, at) || *at < 0) cli_usage("--at %s is no tolerance in metres", optarg);
        j->at = at[0];
        return cli_number(optarg, at) && *at >= 0;
    default:
        if (!cli_integer(optarg, 1, 99, &runs)) cli_usage("--runs %s is no number from 1 to 99", optarg);
        j->runs = (int)runs;
        return runs >= 1 && runs <= 99;
    }
}

/* CLI_OK, or the exit status after a sentence. A folder is made only where its parent is. */
static int make_folder(const char *folder) {
    struct stat there;
    if (stat(folder, &there) == 0)
        return S_ISDIR(there.st_mode) ? CLI_OK : cli_usage("%s is not a folder; -o names one", folder);
    if (mkdir(folder, 0777)) return cli_fail("%s cannot be made: %s", folder, strerror(errno));
    return CLI_OK;
}

/* ------------------------------------------------------------------------------------------------ headings -- */
static void find_machine(char text[CHART_TEXT]) {
    char model[160] = "", line[256];
    FILE *file = fopen("/proc/cpuinfo", "re");
    while (file && !*model && fgets(line, sizeof line, file)) {
        const char *colon = strchr(line, ':');
        if (colon && !strncmp(line, "model name", 10)) snprintf(model, sizeof model, "%s", colon + 1);
    }
    if (file) fclose(file);
    model[strcspn(model, "\n")] = 0;
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    snprintf(text, CHART_TEXT, "rqt %s;%s%s, %ld core%s", RQT_VERSION, *model ? "" : " unknown processor", model,
             cores, cores == 1 ? "" : "s");
}

static void describe_terrain(const job *j, const store_terrain *t, char text[CHART_TEXT]) {
    char cell[64];
    if (t->lonlat)
        snprintf(cell, sizeof cell, "%.4g arc seconds", fabs(t->placement.dx) * 3600);
    else
        snprintf(cell, sizeof cell, "%s m", text_real(t->cost.cell));
    snprintf(text, CHART_TEXT, "%s, %d x %d samples of %s, heights in steps of %s m%s", t->name, t->lattice.width,
             t->lattice.height, cell, text_real(fabs(rqt_unit_factor(&t->unit)) / (double)t->unit.d),
             j->region ? ", a region of it" : "");
}

static bool draw(job *j, chart_kind kind, const chart_points *points) {
    j->has_sheet = true;
    return chart_draw(&j->sheet, kind, points);
}

/* --------------------------------------------------------------------------------------------- charts 1 to 4 -- */
/* The points of all methods; a method that SQL refuses once is not asked again. */
static bool measure_methods(const job *j, const char *terrain, chart_points *points) {
    const chart_query query = {j->db, j->path, j->region, terrain, j->runs};
    cli_progress progress;
    cli_progress_begin(&progress);
    const int all = j->method_count * j->eps_count;
    bool ok = true;
    for (int m = 0; m < j->method_count && ok; m++) {
        for (int e = 0; e < j->eps_count && ok; e++) {
            chart_point point;
            const chart_answer answer = chart_measure(&query, &j->methods[m], j->eps[e], &point);
            ok = answer != CHART_BROKEN;
            if (answer != CHART_MEASURED) break;
            ok = chart_points_add(points, &point);
            cli_progress_show(&progress, "chart", (double)(m * j->eps_count + e + 1) / all, point.samples * all);
        }
    }
    cli_progress_wipe(&progress);
    if (ok && !points->count) ok = cli_fail("no method could be measured") == CLI_OK;
    return ok;
}

static bool add_peers(job *j, chart_points *points) {
    const int own = points->count;
    for (int i = 0; i < j->peer_count; i++)
        if (!chart_read_peers(j->peers[i], points->rows[0].samples, points)) return false;
    if (points->count > own) return true;
    cli_say("no meshes of peers: greedy TIN and RTIN are left out");
    const size_t length = strlen(j->sheet.title);
    snprintf(j->sheet.title + length, sizeof j->sheet.title - length, "; without peers");
    return true;
}

static bool chart_terrain(job *j) {
    store *s;
    const store_terrain *t;
    if (!cli_find_terrain(j->db, j->terrain, &s, &t)) return false;
    char name[64];
    snprintf(name, sizeof name, "%s", t->name);
    describe_terrain(j, t, j->sheet.title);
    store_close(s);
    chart_points points = {0};
    bool ok = measure_methods(j, name, &points);
    /* There is a row: of `exact`. NOLINTNEXTLINE(clang-analyzer-core.NullDereference) */
    if (ok && !points.rows[0].samples) ok = cli_fail("the region holds no sample of %s", name) == CLI_OK;
    if (ok) ok = add_peers(j, &points);
    if (ok) {
        chart_mark_front(&points);
        for (int kind = CHART_ERROR_VERTICES; kind <= CHART_FRONT && ok; kind++)
            ok = draw(j, (chart_kind)kind, &points);
        ok = ok && draw(j, CHART_ALL, &points);
    }
    chart_points_free(&points);
    return ok;
}

/* ------------------------------------------------------------------------------------------------- families -- */
typedef struct member {
    char name[64];
    double value;
    int64_t side;
    double box[4]; /* west, south, east, north sample */
} member;

enum { MOST_MEMBERS = 32 };
typedef struct family {
    char stem[64];
    member members[MOST_MEMBERS]; /* by value */
    int count;
} family;

/* The number after STEM and the mark, and the stem's length; false when the name is no member's. */
static bool read_member(const char *name, const char *mark, double *value, size_t *stem) {
    const char *found = NULL;
    for (const char *at = name; (at = strstr(at, mark)) != NULL; at++) found = at;
    if (!found || found == name) return false;
    *stem = (size_t)(found - name);
    return cli_number(found + strlen(mark), value) && *value >= 0;
}

static bool is_member(const char *name) {
    double value;
    size_t stem;
    return read_member(name, "_noise_", &value, &stem) || read_member(name, "_size_", &value, &stem);
}

static int compare_members(const void *a, const void *b) {
    const double x = ((const member *)a)->value, y = ((const member *)b)->value;
    return (x > y) - (x < y);
}

/* Terrains in no family. */
typedef struct loners {
    int count;
    char name[64]; /* of the last one */
} loners;

/* The first family in order of names; a sentence when there are more. */
static bool find_family(sqlite3 *db, const char *mark, family *f, loners *others) {
    sqlite3_stmt *row = cli_prepare(db, "SELECT name, width, height, x0, y0, x0 + (width - 1) * dx, "
                                        "y0 + (height - 1) * dy FROM rqt_terrains ORDER BY name");
    *f = (family){.count = 0};
    *others = (loners){.count = 0};
    if (!row) return false;
    bool said = false;
    int code;
    while ((code = sqlite3_step(row)) == SQLITE_ROW) {
        const char *name = (const char *)sqlite3_column_text(row, 0);
        member next = {.side = sqlite3_column_int64(row, 1)};
        size_t stem;
        if (!name) continue;
        if (!is_member(name)) {
            others->count++;
            snprintf(others->name, sizeof others->name, "%s", name);
        }
        if (!read_member(name, mark, &next.value, &stem) || stem >= sizeof f->stem || f->count == MOST_MEMBERS)
            continue;
        if (f->count && (strlen(f->stem) != stem || strncmp(f->stem, name, stem))) {
            if (!said) cli_say("there is more than one family *%s*: that of %s is drawn", mark, f->stem);
            said = true;
            continue;
        }
        snprintf(f->stem, sizeof f->stem, "%.*s", (int)stem, name);
        snprintf(next.name, sizeof next.name, "%s", name);
        if (sqlite3_column_int64(row, 2) > next.side) next.side = sqlite3_column_int64(row, 2);
        const double x0 = sqlite3_column_double(row, 3), y0 = sqlite3_column_double(row, 4),
                     x1 = sqlite3_column_double(row, 5), y1 = sqlite3_column_double(row, 6);
        next.box[0] = fmin(x0, x1), next.box[1] = fmin(y0, y1);
        next.box[2] = fmax(x0, x1), next.box[3] = fmax(y0, y1);
        f->members[f->count++] = next;
    }
    if (code != SQLITE_DONE) cli_fail_database(db);
    sqlite3_finalize(row);
    qsort(f->members, (size_t)f->count, sizeof *f->members, compare_members);
    return code == SQLITE_DONE;
}

/* The middle of what all members have in common, half as wide and high, so that the smallest goes on around it too;
 * --region has the last word. NULL after a sentence. */
static char *common_window(const job *j, const family *f) {
    if (j->region) return strdup(j->region);
    double box[4];
    memcpy(box, f->members[0].box, sizeof box);
    for (int i = 1; i < f->count; i++) {
        const double *b = f->members[i].box;
        box[0] = fmax(box[0], b[0]), box[1] = fmax(box[1], b[1]);
        box[2] = fmin(box[2], b[2]), box[3] = fmin(box[3], b[3]);
    }
    if (!(box[0] < box[2] && box[1] < box[3])) {
        cli_say("the terrains %s_size_* have no place in common: chart 6 is left out", f->stem);
        return NULL;
    }
    const double x = (box[2] - box[0]) / 4, y = (box[3] - box[1]) / 4;
    char text[160];
    snprintf(text, sizeof text, "%.17g,%.17g,%.17g,%.17g", box[0] + x, box[1] + y, box[2] - x, box[3] - y);
    return cli_region(text);
}

/* All members with a method; a method that SQL refuses is left out. */
static bool measure_family(const job *j, const family *f, const chart_method *method, const char *region,
                           chart_points *points) {
    for (int i = 0; i < f->count; i++) {
        const chart_query query = {j->db, j->path, region, f->members[i].name, j->runs};
        chart_point point;
        const chart_answer answer = chart_measure(&query, method, j->at, &point);
        if (answer != CHART_MEASURED) return answer == CHART_REFUSED;
        point.amplitude = f->members[i].value;
        point.side = f->members[i].side;
        if (!chart_points_add(points, &point)) return false;
    }
    return true;
}

static bool chart_family(job *j, const family *f, chart_kind kind) {
    const bool is_size = kind == CHART_SIZE;
    char *window = is_size ? common_window(j, f) : j->region ? strdup(j->region) : NULL;
    if (is_size && !window) return true;
    chart_points points = {0};
    bool ok = true;
    /* Only stored errors read bytes as the answer grows: the other methods look at the whole terrain first. */
    for (int m = 0; m < j->method_count && ok; m++)
        if (!j->methods[m].is_selected_otherwise && (!is_size || !strcmp(j->methods[m].name, "exact")))
            ok = measure_family(j, f, &j->methods[m], window, &points);
    free(window);
    snprintf(j->sheet.title, sizeof j->sheet.title, "%d terrains %s_%s_*, tolerance %s m", f->count, f->stem,
             is_size ? "size" : "noise", text_real(j->at));
    if (ok && points.count)
        ok = draw(j, kind, &points);
    else if (ok)
        cli_say("no method for chart %d: it is left out", is_size ? 6 : 5);
    chart_points_free(&points);
    return ok;
}

/* ------------------------------------------------------------------------------------------------ the whole -- */
static bool chart(job *j) {
    family noise, size;
    loners others;
    if (!find_family(j->db, "_noise_", &noise, &others) || !find_family(j->db, "_size_", &size, &others))
        return false;
    find_machine(j->sheet.note);
    const bool only_families = !j->terrain && !others.count && (noise.count || size.count);
    if (!j->terrain && others.count == 1) j->terrain = others.name;
    if (only_families)
        cli_say("there are families of terrains only, and no --terrain: charts 1 to 4 are left out");
    else if (!chart_terrain(j))
        return false;
    if (noise.count > 1 && !chart_family(j, &noise, CHART_NOISE)) return false;
    if (size.count > 1 && !chart_family(j, &size, CHART_SIZE)) return false;
    if (noise.count <= 1) cli_say("no terrains named STEM_noise_AMPLITUDE: chart 5 is left out");
    if (size.count <= 1) cli_say("no terrains named STEM_size_SIDE: chart 6 is left out");
    return true;
}

static int run_job(job *j) {
    if (!j->method_count)
        j->method_count =
            chart_methods("exact,exact/topdown,exact/bottomup,minimal,wedgie,local,euclid", j->methods);
    if (!j->eps_count) j->eps_count = cli_eps("1,2,5,10,20,50,100", j->eps);
    sort_eps(j);
    j->sheet = (chart_sheet){.folder = j->folder, .has_gnuplot = true};
    j->db = cli_open(j->path);
    int status = j->db ? make_folder(j->folder) : CLI_FAILED;
    if (status == CLI_OK && !chart(j)) status = CLI_FAILED;
    sqlite3_close(j->db);
    return status;
}

static int run(int argc, char **argv) {
    job j = {.runs = 5, .at = 5};
    int status = CLI_OK;
    for (int option; status == CLI_OK && (option = cli_option(argc, argv, "ho:", OPTIONS)) != -1;) {
        if (option == 'h') {
            free(j.region);
            return cli_help(HELP);
        }
        if (option == '?' || !read_option(&j, option)) status = CLI_USAGE;
    }
    if (status == CLI_OK && argc - optind != 1)
        status = argc == optind ? cli_usage("a database is missing") : cli_usage("one database at a time");
    if (status == CLI_OK && !j.folder) status = cli_usage("-o is missing: the folder to write into");
    j.path = argv[optind];
    if (status == CLI_OK) status = run_job(&j);
    free(j.region);
    return status;
}

const cli_command command_chart = {"chart", "speed against accuracy, method by method", run};
