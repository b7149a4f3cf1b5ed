/* command_update.c - rqt update: options, progress and the report around import_update. */
#include "command_sources.h"

#include <stdio.h>
#include <string.h>

static const char HELP[] =
    "rqt update: rasters replace a part of a terrain\n"
    "\n"
    "Usage: rqt update [OPTION...] SOURCE... DATABASE\n"
    "\n"
    "SOURCE is whatever GDAL reads; or a folder, of which all rasters are taken that meet the terrain, those in "
    "its\n"
    "folders too, in the order of their paths; or @FILE, a list of them, one a line, as seen from the list. Each "
    "has "
    "the\n"
    "terrain's CRS and lies on its grid: the same cells, a whole number of them away. What lies outside the "
    "terrain "
    "is\n"
    "left out. Where samples are void the terrain keeps what it has. Several sources are put in one after the "
    "other: a\n"
    "later one wins.\n"
    "\n"
    "Heights are kept in the terrain's unit and steps. Where the terrain holds its heights without rounding, one "
    "that\n"
    "would have to be rounded is refused.\n"
    "\n"
    "Everything is one transaction: others see the terrain as it was or as it is then, and an update that fails or "
    "is\n"
    "stopped leaves it as it was. The result is that of an import of the changed raster, in every block; only "
    "what\n"
    "changes is written. To undo an update, update from the old raster (with --voids, if voids have been filled).\n"
    "For more than about a tenth of a terrain, rqt import --replace of the whole is faster.\n"
    "\n"
    "Options:\n"
    "  --terrain T     the terrain (default: the only one)\n"
    "  --voids         void samples of a source make voids\n"
    "  --nodata V      samples of this value are voids, too\n"
    "  --unit U        unit of the heights: m, ft, us-ft or a number of metres (default: what the raster says)\n"
    "  --help          this text\n"
    "\n"
    "Examples:\n"
    "  rqt update landslide.tif county.gpkg\n"
    "  rqt update delivery-2024/ country.gpkg\n"
    "  rqt update --terrain lidar --nodata -9999 flight-17.tif flight-18.tif county.gpkg\n"
    "  gdal_translate -srcwin 100 200 64 64 county.tif old.tif && rqt update --voids old.tif county.gpkg\n";

enum { TERRAIN = 1000, VOIDS, NODATA, UNIT };

static const struct option OPTIONS[] = {{"terrain", required_argument, NULL, TERRAIN},
                                        {"voids", no_argument, NULL, VOIDS},
                                        {"nodata", required_argument, NULL, NODATA},
                                        {"unit", required_argument, NULL, UNIT},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

/* CLI_OK, or CLI_USAGE after a sentence. */
static int set_option(import_options *o, bool *voids, int option) {
    switch (option) {
    case TERRAIN:
        o->name = optarg;
        return CLI_OK;
    case VOIDS:
        *voids = true;
        return CLI_OK;
    case NODATA:
        return sources_set_nodata(o);
    case UNIT:
        return sources_set_unit(o);
    default:
        return CLI_USAGE; /* cli_option has said why */
    }
}

static void print_report(const import_update_report *r, double seconds) {
    printf("%s: %s samples put in, %s of them differ\n", r->name, text_count(r->samples), text_count(r->changed));
    if (r->changed == 0) {
        puts("  nothing written");
        return;
    }
    printf("  %s block%s and %s more summar%s written, %s bytes; %s block%s read, %s bytes\n",
           text_count(r->blocks), r->blocks == 1 ? "" : "s", text_count(r->summaries),
           r->summaries == 1 ? "y" : "ies", text_count(r->bytes), text_count(r->blocks_read),
           r->blocks_read == 1 ? "" : "s", text_count(r->bytes_read));
    printf("  %.3f s (reading %.3f, updating %.3f)\n", seconds, r->seconds_read, r->seconds_update);
}

static int run(int argc, char **argv) {
    import_options options;
    bool voids = false;
    import_options_init(&options);
    for (int option; (option = cli_option(argc, argv, "h", OPTIONS)) != -1;) {
        if (option == 'h') return cli_help(HELP);
        const int status = set_option(&options, &voids, option);
        if (status != CLI_OK) return status;
    }
    if (argc - optind < 2)
        return cli_usage(argc == optind ? "a source and a database are missing"
                                        : "the database is missing: rqt update SOURCE... DATABASE");
    cli_progress progress;
    sources_watch(&options, &progress);

    import_update_report report;
    char message[2048];
    const double start = cli_seconds();
    const int failed = import_update((const char *const *)argv + optind, argc - optind - 1, argv[argc - 1],
                                     &options, voids, &report, message, sizeof message);
    cli_progress_wipe(&progress);
    if (failed) return cli_fail("%s", message);
    print_report(&report, cli_seconds() - start);
    return CLI_OK;
}

const cli_command command_update = {"update", "rasters replace a part of a terrain", run};
