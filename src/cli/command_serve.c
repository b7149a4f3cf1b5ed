/* command_serve.c - rqt serve: the query service of the room serve, as a command. */
#include "cli.h"
#include "serve.h"

#include <stdio.h>
#include <string.h>

static const char HELP[] =
    "rqt serve: answers over HTTP what SQL answers, and shows terrain in a browser\n"
    "\n"
    "Usage: rqt serve [OPTION...] DATABASE...\n"
    "\n"
    "Databases are opened read-only, and opened anew when they are replaced. Of a terrain's name that several "
    "have,\n"
    "the first one's is meant. /openapi.json tells what can be asked. SIGINT and SIGTERM end the service when "
    "what\n"
    "is under way is answered.\n"
    "\n"
    "Options:\n"
    "  --port P            0: one that is free (default 8080)\n"
    "  --bind ADDRESS      numeric (default 127.0.0.1: this machine alone; 0.0.0.0 or ::, all of the network)\n"
    "  --workers N         answers made at a time, each with connections of its own (default 2)\n"
    "  --connections N     open at a time (default 512)\n"
    "  --max-triangles N   of an answer, and vertices; more is refused with 413 (default 2000000)\n"
    "  --max-samples N     under a mesh that is verified; more is refused with 413 (default 20000000)\n"
    "  --max-bytes N       of an answer before compression; more is refused with 413 (default 268435456)\n"
    "  --max-seconds S     that an answer may take; longer is refused with 503 (default 10)\n"
    "  --memory MiB        for all blocks and answers being made; beyond, 503 (default 2048)\n"
    "  --header-seconds S  that a client may take to send a request (default 10)\n"
    "  --max-age S         that caches may answer without asking whether it is still true (default 0)\n"
    "  --help              this text\n"
    "\n"
    "Examples:\n"
    "  rqt serve washington.gpkg\n"
    "  rqt serve --port 0 --workers 4 alps.gpkg pyrenees.gpkg\n"
    "  curl 'http://127.0.0.1:8080/collections/washington/range?bbox=-71.4,44.2,-71.2,44.4&eps=10&f=obj'\n";

enum { PORT = 'p', BIND, WORKERS, CONNECTIONS, TRIANGLES, SAMPLES, BYTES, SECONDS, MEMORY, HEADERS, AGE };

static const struct option OPTIONS[] = {{"port", required_argument, NULL, PORT},
                                        {"bind", required_argument, NULL, BIND},
                                        {"workers", required_argument, NULL, WORKERS},
                                        {"connections", required_argument, NULL, CONNECTIONS},
                                        {"max-triangles", required_argument, NULL, TRIANGLES},
                                        {"max-samples", required_argument, NULL, SAMPLES},
                                        {"max-bytes", required_argument, NULL, BYTES},
                                        {"max-seconds", required_argument, NULL, SECONDS},
                                        {"memory", required_argument, NULL, MEMORY},
                                        {"header-seconds", required_argument, NULL, HEADERS},
                                        {"max-age", required_argument, NULL, AGE},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

/* Options that are whole numbers: from, to. */
static const struct {
    int option;
    const char *name;
    int64_t low, high;
} NUMBERS[] = {{PORT, "port", 0, 65535},
               {WORKERS, "workers", 1, 256},
               {CONNECTIONS, "connections", 1, 65536},
               {TRIANGLES, "max-triangles", 1, 1000000000},
               {SAMPLES, "max-samples", 1, 1000000000},
               {BYTES, "max-bytes", 1000, 2147483647},
               {MEMORY, "memory", 16, 1048576},
               {AGE, "max-age", 0, 31536000}};

static void set_number(serve_options *options, int option, int64_t n) {
    switch (option) {
    case PORT:
        options->port = (int)n;
        break;
    case WORKERS:
        options->workers = (int)n;
        break;
    case CONNECTIONS:
        options->connections = (int)n;
        break;
    case TRIANGLES:
        options->max_triangles = n;
        break;
    case SAMPLES:
        options->max_samples = n;
        break;
    case BYTES:
        options->max_bytes = n;
        break;
    case MEMORY:
        options->memory = n << 20;
        break;
    default:
        options->max_age = (int)n;
    }
}

static int set_option(serve_options *options, int option) {
    double *seconds = option == SECONDS ? &options->max_seconds : &options->header_seconds;
    if (option == '?') return CLI_USAGE; /* cli_option has said why */
    if (option == BIND) {
        options->address = optarg;
        return CLI_OK;
    }
    for (size_t i = 0; i < sizeof NUMBERS / sizeof *NUMBERS; i++) {
        int64_t n;
        if (NUMBERS[i].option != option) continue;
        if (!cli_integer(optarg, NUMBERS[i].low, NUMBERS[i].high, &n))
            return cli_usage("--%s %s: a whole number from %lld to %lld", NUMBERS[i].name, optarg,
                             (long long)NUMBERS[i].low, (long long)NUMBERS[i].high);
        set_number(options, option, n);
        return CLI_OK;
    }
    if (cli_number(optarg, seconds) && *seconds >= 0.01 && *seconds <= 86400) return CLI_OK;
    return cli_usage("%s: seconds from 0.01 to 86400", optarg);
}

static void tell(void *context, const char *url) {
    (void)context;
    printf("%s\n", url);
    fflush(stdout);
}

/* What cannot be served is said now, and not to the first who asks. */
static int check_databases(const serve_options *options) {
    for (int i = 0; i < options->database_count; i++) {
        sqlite3 *db = cli_open(options->databases[i]);
        if (!db) return CLI_FAILED;
        sqlite3_stmt *terrains = cli_prepare(db, "SELECT count(*) FROM rqt_terrains");
        const int code = terrains ? sqlite3_step(terrains) : SQLITE_ERROR;
        const bool any = code == SQLITE_ROW && sqlite3_column_int(terrains, 0) > 0;
        if (terrains && code != SQLITE_ROW) cli_fail_database(db);
        sqlite3_finalize(terrains);
        sqlite3_close(db);
        if (code != SQLITE_ROW) return CLI_FAILED;
        if (!any) cli_say("%s has no terrain yet", options->databases[i]);
    }
    return CLI_OK;
}

static int run(int argc, char **argv) {
    serve_options options = {.address = "127.0.0.1",
                             .port = 8080,
                             .workers = 2,
                             .connections = 512,
                             .max_triangles = 2000000,
                             .max_samples = 20000000,
                             .max_bytes = 268435456,
                             .memory = (int64_t)2048 << 20,
                             .max_seconds = 10,
                             .header_seconds = 10};
    char why[256];
    for (int option; (option = cli_option(argc, argv, "h", OPTIONS)) != -1;) {
        if (option == 'h') return cli_help(HELP);
        const int status = set_option(&options, option);
        if (status != CLI_OK) return status;
    }
    options.databases = (const char *const *)argv + optind;
    options.database_count = argc - optind;
    if (!options.database_count) return cli_usage("a database is missing");
    sqlite3_config(SQLITE_CONFIG_MEMSTATUS, 1); /* --memory is of what is counted */
    const int status = check_databases(&options);
    if (status != CLI_OK) return status;
    return serve_run(&options, tell, NULL, why, sizeof why) ? CLI_OK : cli_fail("%s", why);
}

const cli_command command_serve = {"serve", "answers over HTTP, and a page that shows terrain", run};
