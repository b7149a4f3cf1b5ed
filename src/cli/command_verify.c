/* command_verify.c - rqt verify: the proof, tolerance by tolerance. The rows of rqt_verify() and a verdict. */
#include "cli.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const char HELP[] =
    "rqt verify: proves the meshes of a terrain against its samples\n"
    "\n"
    "Usage: rqt verify DATABASE --eps E [--region R] [--terrain T] [--mode M] [--outline O]\n"
    "\n"
    "Makes the mesh, lays its triangles over all full-resolution samples with code that knows nothing of how the\n"
    "mesh was made, and reports the true error and every crack. Exit status 1 when a mesh is further than eps "
    "from\n"
    "a sample, has a T-junction or an overlap, or leaves a sample uncovered.\n"
    "\n"
    "Options:\n"
    "  --eps E         tolerance in metres of height, or a list of them: 1,2,5\n"
    "  --region R      x0,y0,x1,y1 or WKT, in the terrain's coordinates (default: all)\n"
    "  --terrain T     which terrain (default: the only one)\n"
    "  --mode M        at the region's border: cover (default), snap, border or cut, as rqt mesh has it\n"
    "  --outline O     of voids: exact (default) or tol; uncovered samples are those that it promises to cover\n"
    "  --help          this text\n"
    "\n"
    "Columns: samples covered, vertices and triangles of the mesh, largest and root mean square error in metres,\n"
    "place of the largest, T-junctions, overlaps, uncovered samples.\n"
    "\n"
    "Examples:\n"
    "  rqt verify washington.gpkg --eps 0,1,5,20\n"
    "  rqt verify washington.gpkg --eps 5 --region -71.4,44.2,-71.2,44.4\n"
    "  rqt verify mountains.gpkg --terrain pyrenees --eps 10 --region 'POLYGON((1 42,2 42,1.5 43,1 42))'\n";

static const struct option OPTIONS[] = {{"eps", required_argument, NULL, 'e'},
                                        {"region", required_argument, NULL, 'r'},
                                        {"terrain", required_argument, NULL, 't'},
                                        {"mode", required_argument, NULL, 'm'},
                                        {"outline", required_argument, NULL, 'O'},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

/* The rows are printed when all are there, so that their columns line up. False when a verdict is bad or a query
 * failed. */
static bool verify(sqlite3 *db, const char *region, const double *eps, int count, const char *name,
                   const char *options, const store_terrain *t) {
    static const char *const heads[] = {"eps",       "samples",   "vertices", "triangles", "share",
                                        "max error", "rms error", "at x",     "at y",      "T-junctions",
                                        "overlaps",  "uncovered", "verdict"};
    bool all_hold = true, answered = true;
    cli_table table;
    cli_table_begin(&table, 13, "rrrrrrrrrrrrl");
    for (int i = 0; i < count; i++) {
        picture_proof proof;
        answered = cli_verify(db, region, eps[i], name, options, &proof);
        if (!answered) break;
        if (!i) cli_table_add(&table, heads);
        const bool holds = picture_proof_holds(&proof, eps[i], t->quantum_error);
        char share[32] = "-";
        if (proof.samples)
            snprintf(share, sizeof share, "%.2f %%", 100.0 * (double)proof.vertices / (double)proof.samples);
        const char *cells[] = {text_real(eps[i]),
                               text_count(proof.samples),
                               text_count(proof.vertices),
                               text_count(proof.triangles),
                               share,
                               text_metres(proof.max_error),
                               text_metres(proof.rms_error),
                               proof.has_worst ? text_place(proof.x, t->lonlat) : "-",
                               proof.has_worst ? text_place(proof.y, t->lonlat) : "-",
                               text_count(proof.t_junctions),
                               text_count(proof.overlaps),
                               text_count(proof.uncovered),
                               !holds                                 ? "FAILED"
                               : proof.triangles || proof.samples > 0 ? "holds"
                                                                      : "empty"};
        cli_table_add(&table, cells);
        all_hold = all_hold && holds;
    }
    cli_table_print(&table);
    if (answered && !all_hold) cli_say("a mesh of %s breaks its promise", t->name);
    if (answered && t->quantum_error > 0)
        cli_say("heights of %s were rounded when it was imported: the source is within %s m of them, which the "
                "verdict takes into account",
                t->name, text_real(t->quantum_error));
    return answered && all_hold;
}

static int run(int argc, char **argv) {
    const char *terrain = NULL, *region = NULL;
    double eps[CLI_MAX_EPS];
    cli_answer_options answer = {0};
    int count = 0;
    for (int option; (option = cli_option(argc, argv, "h", OPTIONS)) != -1;) {
        if (option == 'h') return cli_help(HELP);
        if (option == '?') return CLI_USAGE;
        if (option == 'm' && cli_set_mode(&answer, optarg) != CLI_OK) return CLI_USAGE;
        if (option == 'O' && cli_set_outline(&answer, optarg) != CLI_OK) return CLI_USAGE;
        if (option == 't') terrain = optarg;
        if (option == 'r') region = optarg;
        if (option == 'e' && !(count = cli_eps(optarg, eps))) return CLI_USAGE;
    }
    if (argc - optind != 1)
        return argc == optind ? cli_usage("a database is missing") : cli_usage("one database at a time");
    if (!count) return cli_usage("--eps is missing: the tolerance in metres, or a list like 1,2,5");
    char *wkt = NULL;
    if (region && !(wkt = cli_region(region))) return CLI_USAGE;
    bool ok = false;
    store *s;
    const store_terrain *t;
    sqlite3 *db = cli_open(argv[optind]);
    if (db && cli_find_terrain(db, terrain, &s, &t)) {
        ok = verify(db, wkt, eps, count, terrain, cli_options_json(&answer), t);
        store_close(s);
    }
    sqlite3_close(db);
    free(wkt);
    return ok ? CLI_OK : CLI_FAILED;
}

const cli_command command_verify = {"verify", "the true error of meshes, from all samples", run};
