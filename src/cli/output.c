/* output.c - files that are whole or not there: written under a temporary name beside their own, then renamed.
 *
 * A signal that would end the process removes the temporary file first (SIGKILL cannot be caught; what it leaves is
 * named FILE.part-PID and is never mistaken for the file).
 */
#include "cli.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* What the signal handler removes: only unlink and raise, which are safe there. An SQLite file may have a journal.
 */
static char signal_file[4096], signal_journal[4112];

static void remove_and_die(int number) {
    unlink(signal_file);
    unlink(signal_journal);
    raise(number); /* SA_RESETHAND has put the default back */
}

/* What is ignored stays ignored: nohup, and shells that run a job in the background, mean it. */
static void watch_signals(bool on) {
    static const int numbers[] = {SIGINT, SIGTERM, SIGHUP, SIGPIPE};
    static struct sigaction before[sizeof numbers / sizeof *numbers];
    const struct sigaction action = {.sa_handler = remove_and_die, .sa_flags = (int)(SA_RESETHAND | SA_NODEFER)};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        if (!on) {
            sigaction(numbers[i], &before[i], NULL);
            continue;
        }
        sigaction(numbers[i], NULL, &before[i]);
        if (before[i].sa_handler != SIG_IGN) sigaction(numbers[i], &action, NULL);
    }
}

int cli_output_begin(cli_output *output, const char *path, const char *forbidden) {
    struct stat file, other;
    *output = (cli_output){.path = path};
    if (stat(path, &file) == 0) {
        if (S_ISDIR(file.st_mode)) {
            return cli_usage("%s is a folder; -o names a file", path);
        }
        if (!S_ISREG(file.st_mode)) { /* the file would take the place of the device */
            return cli_usage("%s is a device; -o names a file", path);
        }
        if (stat(forbidden, &other) == 0 && file.st_dev == other.st_dev && file.st_ino == other.st_ino) {
            return cli_usage("%s is the database itself; -o names another file", path);
        }
    }
    const int length = snprintf(output->temporary, sizeof output->temporary, "%s.part-%ld", path, (long)getpid());
    if (length < 0 || (size_t)length >= sizeof output->temporary) {
        return cli_fail("the file name is too long");
    }
    memcpy(signal_file, output->temporary, sizeof signal_file);
    snprintf(signal_journal, sizeof signal_journal, "%s-journal", output->temporary);
    watch_signals(true); /* before the first file that it would have to remove */
    /* Where it cannot be written is said before the mesh is made, not after. */
    FILE *probe = fopen(output->temporary, "wxe");
    if (!probe) {
        cli_fail("%s cannot be written: %s", path, strerror(errno));
        watch_signals(false);
        return CLI_FAILED;
    }
    fclose(probe);
    unlink(output->temporary);
    return CLI_OK;
}

bool cli_output_write(const cli_output *output, const void *bytes, size_t size) {
    FILE *file = fopen(output->temporary, "wxe");
    bool ok = file && (!size || fwrite(bytes, 1, size, file) == size);
    int reason = errno;
    if (file && fclose(file)) {
        if (ok) reason = errno;
        ok = false;
    }
    if (!ok) cli_fail("%s cannot be written: %s", output->path, strerror(reason));
    return ok;
}

bool cli_output_finish(cli_output *output) {
    const bool ok = rename(output->temporary, output->path) == 0;
    if (!ok) {
        cli_fail("%s cannot be written: %s", output->path, strerror(errno));
        unlink(output->temporary);
    }
    watch_signals(false);
    return ok;
}

void cli_output_discard(cli_output *output) {
    unlink(signal_journal);
    unlink(output->temporary);
    watch_signals(false);
}

static bool put(void *context, const void *bytes, size_t size) {
    return fwrite(bytes, 1, size, context) == size;
}

int cli_write_picture(sqlite3 *db, const picture_request *request, const cli_output *output) {
    FILE *file = fopen(output->temporary, "wxe");
    if (!file) return cli_fail("%s cannot be written: %s", output->path, strerror(errno));
    char *sentence = NULL;
    const int code = picture_write(db, request, put, file, &sentence);
    const bool is_written = !ferror(file);
    if (fclose(file) == 0 && is_written) return code == SQLITE_OK ? CLI_OK : cli_fail_store(code, sentence);
    sqlite3_free(sentence);
    return cli_fail("%s cannot be written: %s", output->path, strerror(errno));
}
