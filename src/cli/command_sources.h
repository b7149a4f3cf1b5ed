/* command_sources.h - what `rqt import` and `rqt update` share: options about sources, and how work is watched. */
#ifndef RQT_CLI_COMMAND_SOURCES_H
#define RQT_CLI_COMMAND_SOURCES_H

#include "cli.h"
#include "import.h"

/* The option's value, optarg, into the options: CLI_OK, or CLI_USAGE after a sentence. */
int sources_set_nodata(import_options *options);
int sources_set_unit(import_options *options);

/* Shows progress and notices. Ctrl-C and a polite kill stop the work, which leaves the database as it was; the
 * second one ends the process as usual, and SQLite rolls back when the database is next opened. progress lives as
 * long as the work does. */
void sources_watch(import_options *options, cli_progress *progress);

#endif
