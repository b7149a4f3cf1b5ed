/* command_tiles.c - rqt tiles: the tiles of a terrain as files, by the room tiles. */
#include "cli.h"
#include "tiles.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const char HELP[] =
    "rqt tiles: a terrain as tiles for globes and maps, each with a proven error\n"
    "\n"
    "Usage: rqt tiles DATABASE -o FOLDER [OPTION...]\n"
    "\n"
    "Writes the tiles into FOLDER, and at last the document that describes them: the same bytes that rqt serve\n"
    "answers with. For terrains in longitude and latitude on WGS 84. What is in the folder already is not made\n"
    "again: after a kill the same command goes on there.\n"
    "\n"
    "Kinds:\n"
    "  quantized-mesh       z/x/y.terrain, layer.json: Cesium and other globes\n"
    "  3d-tiles             content/level/x/y.glb, subtrees/level/x/y.subtree, tileset.json: 3D Tiles 1.1\n"
    "  terrarium            z/x/y.png, tile.json: MapLibre, deck.gl and other maps; heights as they are\n"
    "\n"
    "Options:\n"
    "  -o, --output FOLDER  made if it is not there\n"
    "  --kind K             of the kinds above (default: quantized-mesh)\n"
    "  --terrain T          of several terrains\n"
    "  --levels A-B         levels A to B, or one (default: all, to the first with the resolution of the raster;\n"
    "                       Cesium wants quantized-mesh from level 0 on)\n"
    "  --url URL            where FOLDER will be served: MapLibre wants whole addresses in tile.json\n"
    "  --gzip               tiles compressed, to be served with Content-Encoding: gzip; PNG stay as they are\n"
    "  --jobs J             workers, 1 to 64 (default: one for each processor)\n"
    "  --help               this text\n"
    "\n"
    "Examples:\n"
    "  rqt tiles washington.gpkg -o tiles\n"
    "  rqt tiles alps.gpkg --terrain swiss --levels 0-12 --gzip -o /srv/www/tiles\n"
    "  rqt tiles alps.gpkg --kind terrarium --url https://example.org/alps/ -o /srv/www/alps\n";

static const struct option OPTIONS[] = {{"output", required_argument, NULL, 'o'},
                                        {"kind", required_argument, NULL, 'k'},
                                        {"terrain", required_argument, NULL, 't'},
                                        {"levels", required_argument, NULL, 'l'},
                                        {"url", required_argument, NULL, 'u'},
                                        {"gzip", no_argument, NULL, 'g'},
                                        {"jobs", required_argument, NULL, 'j'},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

/* "3-7" or "5". */
static bool read_levels(const char *text, tiles_job *job) {
    char from[16];
    int64_t first, last;
    const char *minus = strchr(text, '-');
    if (minus && (minus == text || (size_t)(minus - text) >= sizeof from)) return false;
    snprintf(from, sizeof from, "%.*s", minus ? (int)(minus - text) : 15, text);
    if (!cli_integer(from, 0, TILES_LEVELS - 1, &first)) return false;
    if (!cli_integer(minus ? minus + 1 : text, first, TILES_LEVELS - 1, &last)) return false;
    job->first = (int)first;
    job->last = (int)last;
    return true;
}

/* With a slash at its end. */
static bool read_url(const char *text, char *url, size_t room) {
    const size_t n = strlen(text), scheme = strncmp(text, "https://", 8) == 0 ? 8 : 7;
    if (strncmp(text, "http://", 7) != 0 && scheme == 7) return false;
    if (!text[scheme] || text[scheme] == '/' || n + 2 > room) return false;
    for (const char *p = text; *p; p++)
        if (*p <= ' ' || *p >= 0x7F || strchr("\"<>\\^`{|}?#", *p)) return false;
    snprintf(url, room, "%s%s", text, text[n - 1] == '/' ? "" : "/");
    return true;
}

static int say_kinds(const char *unknown) {
    char known[256] = "";
    for (const tile_kind *const *kind = tile_kinds; *kind; kind++)
        snprintf(known + strlen(known), sizeof known - strlen(known), "%s%s", kind == tile_kinds ? "" : ", ",
                 (*kind)->name);
    return cli_usage("--kind %s: there is no such kind of tiles, but %s", unknown, known);
}

static sqlite3 *connect(void *context) {
    return cli_open(context);
}

static cli_progress progress;

static bool show(void *context, int64_t done, int64_t all) {
    (void)context;
    cli_progress_show(&progress, "tiles", all ? (double)done / (double)all : 1, all);
    return true;
}

static int write_tiles(tiles_job *job) {
    char *error = NULL;
    tiles_report report;
    const double start = cli_seconds();
    cli_progress_begin(&progress);
    progress.unit = "tiles";
    const int code = tiles_write(job, &report, &error);
    cli_progress_wipe(&progress);
    if (code == SQLITE_CANTOPEN && !error) return CLI_FAILED; /* cli_open has said why */
    if (code != SQLITE_OK) return cli_fail_store(code, error);
    const double seconds = cli_seconds() - start;
    if (isatty(STDERR_FILENO))
        cli_say("levels %d to %d: %lld tiles, %lld written, %lld bytes, %.2f s", job->first, report.finest,
                (long long)report.tiles, (long long)report.written, (long long)report.bytes, seconds);
    return CLI_OK;
}

static int run(int argc, char **argv) {
    char url[512];
    const long processors = sysconf(_SC_NPROCESSORS_ONLN);
    tiles_job job = {.kind = tile_kinds[0],
                     .last = TILES_LEVELS - 1,
                     .workers = processors < 1              ? 1
                                : processors > MOST_WORKERS ? MOST_WORKERS
                                                            : (int)processors,
                     .connect = connect,
                     .progress = show};
    for (int option; (option = cli_option(argc, argv, "o:h", OPTIONS)) != -1;) {
        int64_t n;
        switch (option) {
        case 'o':
            job.folder = optarg;
            break;
        case 'k':
            job.kind = tiles_kind(optarg);
            if (!job.kind) return say_kinds(optarg);
            break;
        case 't':
            job.terrain = optarg;
            break;
        case 'l':
            if (!read_levels(optarg, &job))
                return cli_usage("--levels %s: two levels like 0-12, or one, of 0 to %d", optarg, TILES_LEVELS - 1);
            break;
        case 'u':
            if (!read_url(optarg, url, sizeof url))
                return cli_usage("--url %s: an address like https://example.org/tiles/", optarg);
            job.url = url;
            break;
        case 'g':
            job.gzip = true;
            break;
        case 'j':
            if (!cli_integer(optarg, 1, MOST_WORKERS, &n))
                return cli_usage("--jobs %s: a whole number from 1 to %d", optarg, MOST_WORKERS);
            job.workers = (int)n;
            break;
        case 'h':
            return cli_help(HELP);
        default:
            return CLI_USAGE; /* cli_option has said why */
        }
    }
    if (argc - optind != 1) return cli_usage(argc == optind ? "a database is missing" : "one database at a time");
    if (!job.folder) return cli_usage("-o FOLDER is missing: where the tiles go");
    job.database = argv[optind];
    job.context = argv[optind];
    return write_tiles(&job);
}

const cli_command command_tiles = {"tiles", "a terrain as tiles for globes and maps", run};
