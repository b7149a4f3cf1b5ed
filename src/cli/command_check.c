/* command_check.c - rqt check: is what is stored what was written? The rows of rqt_check(), terrain by terrain. */
#include "cli.h"

#include <stdio.h>
#include <string.h>

static const char HELP[] =
    "rqt check: is the database sound?\n"
    "\n"
    "Usage: rqt check [--terrain T] DATABASE\n"
    "\n"
    "Looks at every block, its checksum and its place in the index, and says what is wrong. Exit status 1 when a\n"
    "terrain is damaged, or its import did not finish.\n"
    "\n"
    "Options:\n"
    "  --terrain T     this terrain only (default: all)\n"
    "  --help          this text\n"
    "\n"
    "Examples:\n"
    "  rqt check washington.gpkg\n"
    "  rqt check --terrain washington mountains.gpkg && cp mountains.gpkg /backup/\n";

static const struct option OPTIONS[] = {
    {"terrain", required_argument, NULL, 't'}, {"help", no_argument, NULL, 'h'}, {NULL, 0, NULL, 0}};

static bool check(sqlite3 *db, const char *name) {
    sqlite3_stmt *rows = cli_prepare(db, "SELECT severity, block, message FROM rqt_check(?1)");
    if (!rows) return false;
    sqlite3_bind_text(rows, 1, name, -1, SQLITE_STATIC);
    bool sound = true, any = false;
    int code;
    while ((code = sqlite3_step(rows)) == SQLITE_ROW) {
        const char *severity = (const char *)sqlite3_column_text(rows, 0);
        const char *message = (const char *)sqlite3_column_text(rows, 2);
        const sqlite3_int64 block = sqlite3_column_int64(rows, 1);
        any = true;
        sound = sound && severity && strcmp(severity, "error");
        printf("%s: %s: ", name, severity ? severity : "error");
        if (block) printf("block %lld: ", block);
        puts(message ? message : "no message");
    }
    sqlite3_finalize(rows);
    if (code != SQLITE_DONE) {
        cli_fail_database(db);
        return false;
    }
    if (!any) printf("%s: sound\n", name);
    return sound;
}

static bool check_all(sqlite3 *db, const char *path) {
    store *s = NULL;
    store_terrain *terrains = NULL;
    int count = 0;
    char *sentence = NULL;
    int code = store_open(db, &s);
    if (code == SQLITE_OK) code = store_terrains(s, &terrains, &count, &sentence);
    if (s) store_close(s);
    if (code != SQLITE_OK) return cli_fail_store(code, sentence) == CLI_OK;
    if (!count) cli_say("%s has no terrain", path);
    bool sound = true;
    for (int i = 0; i < count; i++) sound = check(db, terrains[i].name) && sound;
    store_terrains_free(terrains, count);
    return sound;
}

static int run(int argc, char **argv) {
    const char *terrain = NULL;
    for (int option; (option = cli_option(argc, argv, "h", OPTIONS)) != -1;) {
        if (option == 'h') return cli_help(HELP);
        if (option == '?') return CLI_USAGE;
        terrain = optarg;
    }
    if (argc - optind != 1)
        return argc == optind ? cli_usage("a database is missing") : cli_usage("one database at a time");
    sqlite3 *db = cli_open(argv[optind]);
    if (!db) return CLI_FAILED;
    const bool sound = terrain ? check(db, terrain) : check_all(db, argv[optind]);
    sqlite3_close(db);
    return sound ? CLI_OK : CLI_FAILED;
}

const cli_command command_check = {"check", "is what is stored undamaged and complete?", run};
