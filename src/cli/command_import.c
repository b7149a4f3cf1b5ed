/* command_import.c - rqt import: options, progress and the report around import_run. */
#include "command_sources.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char HELP[] =
    "rqt import: a raster, or several on one grid, becomes a terrain of a database\n"
    "\n"
    "Usage: rqt import [OPTION...] SOURCE... DATABASE\n"
    "\n"
    "SOURCE is whatever GDAL reads: GeoTIFF, .hgt (zipped too), VRT, ESRI ASCII grid, USGS DEM ...; or a folder, "
    "of\n"
    "which all rasters are taken, those in its folders too, in the order of their paths; or @FILE, a list of "
    "them,\n"
    "one a line, as seen from the list. They are put together on one grid; where they overlap and differ, the "
    "later\n"
    "one wins, and gaps, overlaps and differences are told, with places. DATABASE is an SQLite file, made as a\n"
    "GeoPackage when it does not exist. An import that fails or is stopped leaves it as it was.\n"
    "\n"
    "What does not fit in memory is kept while it is read, in DATABASE.NAME.rqt-import: after a kill or Ctrl-C "
    "the\n"
    "same command goes on where reading was, and reads no tile again. With success the file goes.\n"
    "\n"
    "Options:\n"
    "  --name N        name of the terrain (default: the first source's file name, up to its first dot)\n"
    "  --replace       replace the terrain of this name\n"
    "  --nodata V      samples of this value are voids, too\n"
    "  --unit U        unit of the heights: m, ft, us-ft or a number of metres (default: what the raster says)\n"
    "  --quantum Q     height step for rasters of floating-point numbers (default: chosen from the samples)\n"
    "  --void-tol R    c: with the option outline tol, an outline of voids moves by at most c * eps metres on the\n"
    "                  ground (default 1). Stored with the errors; outline exact does not depend on it\n"
    "  --fill R        voids (samples that touch by sides or corners) which a square of 2R + 1 samples holds, and\n"
    "                  which do not reach two opposite edges, become heights: of their neighbours west, east, "
    "north\n"
    "                  and south, by inverse distance. R is 1 to 255. Noted in the table rqt_fill_N, kind 1\n"
    "  --sea Z         every void that is left, missing tiles too, becomes Z metres. Noted likewise, kind 2\n"
    "  --report FILE   gaps, overlaps and differences of the sources as GeoJSON, which QGIS opens\n"
    "  --resumable     keep what is read for resuming even where it fits in memory\n"
    "  --minimal       store minimal errors, too, so that the option metric minimal need not compute them; "
    "doubles\n"
    "                  the database, and takes about 12 bytes of memory a sample, 512 MiB at most\n"
    "  --block K       blocks of 2^K + 1 samples a side, K 1 to 8 (default %d)\n"
    "  --jobs J        threads (default: one for each processor)\n"
    "  --memory MiB    memory that the import may take, all told (default: half of the machine's, at most 4096).\n"
    "                  Rasters that fit (about 5 bytes a sample, 9 where heights are 64-bit numbers or in mixed\n"
    "                  units) are kept there, larger ones in the file for resuming; the terrain is the same\n"
    "  --help          this text\n"
    "\n"
    "Examples:\n"
    "  rqt import N44W072.hgt.zip washington.gpkg\n"
    "  rqt import --name pyrenees N42E001.hgt.zip N41E001.hgt.zip mountains.gpkg\n"
    "  rqt import --nodata -9999 --unit ft --replace survey.tif county.gpkg\n"
    "  rqt import --fill 3 --report faults.geojson tiles/ country.gpkg\n";

enum {
    NAME = 1000,
    BLOCK,
    NODATA,
    UNIT,
    QUANTUM,
    VOID_TOL,
    FILL,
    SEA,
    REPORT,
    RESUMABLE,
    MINIMAL,
    JOBS,
    MEMORY,
    REPLACE
};

static const struct option OPTIONS[] = {{"name", required_argument, NULL, NAME},
                                        {"block", required_argument, NULL, BLOCK},
                                        {"nodata", required_argument, NULL, NODATA},
                                        {"unit", required_argument, NULL, UNIT},
                                        {"quantum", required_argument, NULL, QUANTUM},
                                        {"void-tol", required_argument, NULL, VOID_TOL},
                                        {"fill", required_argument, NULL, FILL},
                                        {"sea", required_argument, NULL, SEA},
                                        {"report", required_argument, NULL, REPORT},
                                        {"resumable", no_argument, NULL, RESUMABLE},
                                        {"minimal", no_argument, NULL, MINIMAL},
                                        {"jobs", required_argument, NULL, JOBS},
                                        {"memory", required_argument, NULL, MEMORY},
                                        {"replace", no_argument, NULL, REPLACE},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

/* CLI_OK, or CLI_USAGE after a sentence. */
static int set_option(import_options *o, int option) {
    int64_t n;
    double number;
    switch (option) {
    case NAME:
        if (!store_name_is_valid(optarg))
            return cli_usage("--name %s: a name has 1 to 63 letters, digits, _ . or -, and is not . or ..", optarg);
        o->name = optarg;
        return CLI_OK;
    case BLOCK:
        if (!cli_integer(optarg, 1, RQT_MAX_BLOCK_K, &n))
            return cli_usage("--block %s: K is a whole number from 1 to %d; blocks have 2^K + 1 samples a side",
                             optarg, RQT_MAX_BLOCK_K);
        o->k = (int)n;
        return CLI_OK;
    case NODATA:
        return sources_set_nodata(o);
    case UNIT:
        return sources_set_unit(o);
    case QUANTUM:
        if (!cli_number(optarg, &number) || number <= 0)
            return cli_usage("--quantum %s is no height step: a number above 0", optarg);
        o->quantum = number;
        return CLI_OK;
    case VOID_TOL:
        if (!cli_number(optarg, &number) || number <= 0)
            return cli_usage("--void-tol %s: metres of outline for each metre of eps, a number above 0", optarg);
        o->void_tol = number;
        return CLI_OK;
    case FILL:
        if (!cli_integer(optarg, 1, IMPORT_MOST_FILL, &n))
            return cli_usage("--fill %s: a radius in samples, a whole number from 1 to %d", optarg,
                             IMPORT_MOST_FILL);
        o->fill = (int)n;
        return CLI_OK;
    case SEA:
        if (!cli_number(optarg, &number) || !isfinite(number))
            return cli_usage("--sea %s is no height in metres", optarg);
        o->has_sea = true;
        o->sea = number;
        return CLI_OK;
    case REPORT:
        if (!*optarg) return cli_usage("--report needs the name of a file");
        o->report = optarg;
        return CLI_OK;
    case RESUMABLE:
        o->resumable = true;
        return CLI_OK;
    case JOBS:
        if (!cli_integer(optarg, 1, 1024, &n)) return cli_usage("--jobs %s: a whole number from 1 to 1024", optarg);
        o->jobs = (int)n;
        return CLI_OK;
    case MEMORY:
        if (!cli_integer(optarg, 1, (int64_t)1 << 30, &n))
            return cli_usage("--memory %s: a whole number of MiB, 1 or more", optarg);
        o->memory = n << 20;
        return CLI_OK;
    case REPLACE:
        o->replace = true;
        return CLI_OK;
    case MINIMAL:
        o->minimal = true;
        return CLI_OK;
    default:
        return CLI_USAGE; /* cli_option has said why */
    }
}

static void print_report(const import_report *r, double seconds) {
    const double samples = (double)r->samples;
    printf("%s: %s samples, ", r->name, text_count(r->samples));
    if (r->voids)
        printf("%s void (%.3g %%)\n", text_count(r->voids), 100.0 * (double)r->voids / samples);
    else
        puts("none void");
    printf("  %s block%s, %s bytes, %.2f bits per sample\n", text_count(r->blocks), r->blocks == 1 ? "" : "s",
           text_count(r->bytes), 8.0 * (double)r->bytes / samples);
    printf("  %.2f s (reading %.2f, errors and blocks %.2f, writing %.2f), %.1f Msamples/s\n", seconds,
           r->seconds_read, r->seconds_errors, r->seconds_blocks,
           samples / (seconds > 1e-9 ? seconds : 1e-9) / 1e6);
    if (r->sources > 1 || r->samples_resumed) {
        printf("  %s samples read from %s source%s", text_count(r->samples_read), text_count(r->sources),
               r->sources == 1 ? "" : "s");
        if (r->samples_resumed) printf("; %s from an earlier run", text_count(r->samples_resumed));
        putchar('\n');
    }
    if (r->filled) printf("  %s void samples filled\n", text_count(r->filled));
    if (r->sea) printf("  %s void samples made sea\n", text_count(r->sea));
    if (r->overlap)
        printf("  %s samples in more than one source, %s of them differ\n", text_count(r->overlap),
               text_count(r->overlap_differs));
}

static int run(int argc, char **argv) {
    import_options options;
    import_options_init(&options);
    for (int option; (option = cli_option(argc, argv, "h", OPTIONS)) != -1;) {
        if (option == 'h') {
            printf(HELP, options.k);
            return CLI_OK;
        }
        const int status = set_option(&options, option);
        if (status != CLI_OK) return status;
    }
    if (argc - optind < 2)
        return cli_usage(argc == optind ? "a source and a database are missing"
                                        : "the database is missing: rqt import SOURCE... DATABASE");
    cli_progress progress;
    sources_watch(&options, &progress);

    import_report report;
    char message[2048];
    const double start = cli_seconds();
    const int failed = import_run((const char *const *)argv + optind, argc - optind - 1, argv[argc - 1], &options,
                                  &report, message, sizeof message);
    cli_progress_wipe(&progress);
    if (failed) return cli_fail("%s", message);
    print_report(&report, cli_seconds() - start);
    return CLI_OK;
}

const cli_command command_import = {"import", "a raster becomes a terrain of a database", run};
