/* main.c - the rqt command: which command is meant, and how it speaks.
 *
 * Every sentence on stderr begins with the command that says it ("rqt mesh: ..."), so that it can be placed in the
 * log of a script that calls several.
 */
#include "cli.h"
#include "import.h"

#include <errno.h>
#include <malloc.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static const cli_command *const COMMANDS[] = {&command_import, &command_update, &command_info,
                                              &command_check,  &command_verify, &command_mesh,
                                              &command_serve,  &command_tiles,  &command_chart};
enum { COMMAND_COUNT = sizeof COMMANDS / sizeof *COMMANDS };

const cli_command *cli_current;

static void speak(const char *format, va_list list) {
    fflush(stdout); /* so that a terminal shows both streams in the order of events */
    fprintf(stderr, "rqt%s%s: ", cli_current ? " " : "", cli_current ? cli_current->name : "");
    vfprintf(stderr, format, list);
    fputc('\n', stderr);
}

void cli_say(const char *format, ...) {
    va_list list;
    va_start(list, format);
    speak(format, list);
    va_end(list);
}

int cli_fail(const char *format, ...) {
    va_list list;
    va_start(list, format);
    speak(format, list);
    va_end(list);
    return CLI_FAILED;
}

int cli_usage(const char *format, ...) {
    va_list list;
    va_start(list, format);
    speak(format, list);
    va_end(list);
    fprintf(stderr, "Try: rqt %s%s--help\n", cli_current ? cli_current->name : "", cli_current ? " " : "");
    return CLI_USAGE;
}

int cli_help(const char *text) {
    fputs(text, stdout);
    return CLI_OK;
}

static int help_of_all(void) {
    puts("rqt: terrain inside a database, and meshes of it with a proven error\n"
         "\n"
         "Usage: rqt COMMAND [OPTION...] ARGUMENT...\n"
         "\n"
         "Commands:");
    for (int i = 0; i < COMMAND_COUNT; i++) printf("  %-8s %s\n", COMMANDS[i]->name, COMMANDS[i]->summary);
    puts(
        "\n"
        "rqt COMMAND --help tells its options. rqt --version tells the version.\n"
        "\n"
        "Examples:\n"
        "  rqt import N44W072.hgt.zip washington.gpkg                  a raster becomes a terrain of a database\n"
        "  rqt info washington.gpkg                                    what is in the database\n"
        "  rqt mesh washington.gpkg --eps 5,20,80 -o washington.png    its mesh at three tolerances, as a picture\n"
        "\n"
        "Exit status: 0 done, 1 failed or a check that did not hold, 2 bad usage.\n"
        "Data goes to stdout, messages to stderr.");
    return CLI_OK;
}

static int version(void) {
    printf("rqt %s (SQLite %s, GDAL %s)\n", RQT_VERSION, sqlite3_libversion(), import_gdal_version());
    return CLI_OK;
}

static const cli_command *find(const char *name) {
    for (int i = 0; i < COMMAND_COUNT; i++)
        if (!strcmp(COMMANDS[i]->name, name)) return COMMANDS[i];
    return NULL;
}

static int dispatch(int argc, char **argv) {
    if (argc < 2)
        return cli_usage("a command is missing: import, update, info, check, verify, mesh, serve, tiles or chart");
    const char *name = argv[1];
    if (!strcmp(name, "--help") || !strcmp(name, "-h") || (!strcmp(name, "help") && argc == 2))
        return help_of_all();
    if (!strcmp(name, "--version") || !strcmp(name, "-V") || !strcmp(name, "version")) return version();
    const bool help = !strcmp(name, "help");
    if (help) name = argv[2];
    const cli_command *command = find(name);
    if (!command)
        return cli_usage(
            "there is no %s %s: the commands are import, update, info, check, verify, mesh, serve, tiles and chart",
            name[0] == '-' ? "option" : "command", name);
    cli_current = command;
    char ask[] = "--help", *const asking[] = {argv[1], ask, NULL};
    return help ? command->run(2, (char **)asking) : command->run(argc - 1, argv + 1);
}

/* Answers take and release the same hundreds of kilobytes one after the other. Left to itself malloc gives them
 * back to the system each time, which has to clear them before we get them again: a tenth of the time of a tile. */
static void keep_memory(void) {
    mallopt(M_MMAP_THRESHOLD, 1 << 20);
    mallopt(M_TRIM_THRESHOLD, 8 << 20);
    /* Nobody asks how much SQLite has, but for the service, which has a limit to keep: workers would wait for each
     * other at every request, to count. */
    sqlite3_config(SQLITE_CONFIG_MEMSTATUS, 0);
}

int main(int argc, char **argv) {
    keep_memory();
    int status = dispatch(argc, argv);
    /* What was printed is only done when it is out: a full disk shows here. */
    if ((fflush(stdout) || ferror(stdout)) && status == CLI_OK) status = cli_fail("stdout: %s", strerror(errno));
    return status;
}
