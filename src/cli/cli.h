/* cli.h - what the commands share: sentences, options, databases, tables, progress, output files.
 *
 * A command is a function of argc and argv that returns the exit status. It asks the database through the SQL
 * functions, as any other program would, so that what the command shows is what SQL says. Two places go past SQL:
 * import, which is a room of its own, and the picture, which needs the samples under a window.
 *
 * Data goes to stdout, everything else to stderr. Exit status: 0 done, 1 the operation or the check failed, 2 the
 * command line is wrong or asks for something that is not in this version.
 */
#ifndef RQT_CLI_H
#define RQT_CLI_H

#include "picture.h"
#include "store.h"
#include "text.h"

#include <getopt.h>
#include <signal.h>

enum { CLI_OK = 0, CLI_FAILED = 1, CLI_USAGE = 2 };

typedef struct cli_command {
    const char *name;
    const char *summary; /* one line of rqt --help */
    int (*run)(int argc, char **argv);
} cli_command;

extern const cli_command command_import, command_update, command_info, command_check, command_verify, command_mesh,
    command_serve, command_tiles, command_chart;

/* ------------------------------------------------------------------------------------ sentences (main.c) -- */
/* The command whose name goes before every sentence. */
extern const cli_command *cli_current;

/* "rqt NAME: sentence" on stderr; _usage adds where help is found. They return their exit status. */
int cli_fail(const char *format, ...) __attribute__((format(printf, 1, 2)));
int cli_usage(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* The same without being a failure. */
void cli_say(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* A help text on stdout. */
int cli_help(const char *text);

/* -------------------------------------------------------------------------------------- options (options.c) -- */
#define CLI_MAX_EPS 12

/* getopt_long with sentences of our own. Returns the option's value, -1 after the last one, '?' when a sentence has
 * been said and CLI_USAGE is due. */
int cli_option(int argc, char **argv, const char *shorts, const struct option *longs);
/* The whole text as a finite number; as an integer of low..high. */
bool cli_number(const char *text, double *value);
bool cli_integer(const char *text, int64_t low, int64_t high, int64_t *value);
/* "5" or "1,2,5": numbers >= 0, their count; 0 after a sentence. */
int cli_eps(const char *text, double eps[CLI_MAX_EPS]);
/* --mode and --outline, as the SQL functions name them. */
typedef struct cli_answer_options {
    const char *mode, *outline; /* NULL: the default */
    char json[80];
} cli_answer_options;
/* CLI_OK, or the exit status after a sentence. */
int cli_set_mode(cli_answer_options *options, const char *mode);
int cli_set_outline(cli_answer_options *options, const char *outline);
/* For the SQL functions; good as long as options are. */
const char *cli_options_json(cli_answer_options *options);
/* A region as WKT: four numbers x0,y0,x1,y1 become a polygon, everything else is passed on as it is. NULL after a
 * sentence. Released with free. */
char *cli_region(const char *text);

/* ------------------------------------------------------------------------------------ databases (database.c) -- */
/* Read-only, with the SQL functions. NULL after a sentence. */
sqlite3 *cli_open(const char *path);
/* A statement, to be finalized; NULL after a sentence. */
sqlite3_stmt *cli_prepare(sqlite3 *db, const char *sql);
/* Says what SQLite has to say about the connection's last failure, as a sentence; returns CLI_FAILED. */
int cli_fail_database(sqlite3 *db);
/* The same for a code and a sentence from the store, which it releases. */
int cli_fail_store(int code, char *sentence);
/* Several statements; false after a sentence. */
bool cli_execute(sqlite3 *db, const char *sql);
/* Binds region (WKT or NULL), eps and terrain (or NULL) to ?1, ?2, ?3. */
void cli_bind_query(sqlite3_stmt *statement, const char *region, double eps, const char *terrain);
/* The terrain of this name, or the only one; with the store that it lives in. false after a sentence. */
bool cli_find_terrain(sqlite3 *db, const char *name, store **s, const store_terrain **terrain);

/* picture_proof_read, with a sentence. */
bool cli_verify(sqlite3 *db, const char *region, double eps, const char *terrain, const char *options,
                picture_proof *proof);

/* ------------------------------------------------------------------------------------------ tables (table.c) -- */
/* A table of texts, columns aligned by what they hold. Memory that is missing makes it incomplete and
 * cli_table_print say so. */
typedef struct cli_table {
    int columns, rows;
    const char *left; /* 'l' or 'r' per column */
    char **cells;     /* rows * columns */
    bool incomplete;
} cli_table;
void cli_table_begin(cli_table *table, int columns, const char *align);
void cli_table_add(cli_table *table, const char *const *cells);
void cli_table_print(cli_table *table); /* and release */

/* ------------------------------------------------------------------------------------ progress (progress.c) -- */
typedef struct cli_progress {
    bool shown; /* stderr is a terminal */
    bool dirty; /* there is a line to wipe */
    char stage[32];
    const char *unit;   /* of what is counted; NULL: millions of samples */
    double start, last; /* seconds */
} cli_progress;
void cli_progress_begin(cli_progress *progress);
/* done: the share of `count` samples, or units. */
void cli_progress_show(cli_progress *progress, const char *stage, double done, int64_t count);
void cli_progress_wipe(cli_progress *progress);
double cli_seconds(void); /* of a clock that only goes forward */

/* --------------------------------------------------------------------------------- output files (output.c) -- */
/* A file under a temporary name beside its own, renamed when it is whole. A signal that ends the process removes
 * it, and a failure does when _discard is called. One at a time. */
typedef struct cli_output {
    const char *path;
    char temporary[4096];
} cli_output;
/* CLI_OK, or the exit status after a sentence: folders and the file `forbidden` are refused. The temporary file
 * does not exist yet. */
int cli_output_begin(cli_output *output, const char *path, const char *forbidden);
bool cli_output_write(const cli_output *output, const void *bytes, size_t size);
bool cli_output_finish(cli_output *output); /* renames; discards when that fails */
void cli_output_discard(cli_output *output);

/* ------------------------------------------------------------------------------------------ what mesh writes -- */
/* One layer, a row per triangle (layer.c). */
int cli_write_layer(sqlite3 *db, const char *region, double eps, const char *terrain, const char *options,
                    const cli_output *output);
/* A picture, of the room picture. */
int cli_write_picture(sqlite3 *db, const picture_request *request, const cli_output *output);

#endif
