/* test_fault_kill.c - F49: kill -9 at random moments of an import and of what else writes leaves the database as it
 * was or done, sound, and in nobody's way.
 *
 * A child writes; its parent kills it after a random time between nothing and a little more than the whole takes,
 * and looks. RQT_KILLS: how often in all (200; fewer under sanitizers). RQT_SEED: the moments. */
#include "test_fault_support.h"

#include <signal.h>
#include <sys/wait.h>
#include <time.h>

static long kills = 200;
static uint64_t seed = 1;

static uint64_t random_below(uint64_t n) {
    uint64_t z = seed += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return (z ^ (z >> 31)) % n;
}

static int64_t microseconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

static pid_t start(const writer *w, const char *database) {
    (void)fflush(stdout);
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) _exit(w->run(database));
    return child;
}

static void wait_for(pid_t child, bool *killed) {
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    *killed = WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
    CHECK(*killed || (WIFEXITED(status) && WEXITSTATUS(status) == 0), "the child ended with status %x",
          (unsigned)status);
}

static void kill_often(const writer *w, const char *origin, long times) {
    const file_path work = path_of("work.gpkg");
    const char *const path = work.text;
    bool killed;
    int64_t whole = 0;
    uint64_t before = 0, after = 0;
    for (int n = 0; n < 3; n++) { /* how long the whole takes, at most */
        writer_prepare(w, origin, path);
        before = database_state(path);
        const int64_t began = microseconds();
        wait_for(start(w, path), &killed);
        const int64_t took = microseconds() - began;
        if (took > whole) whole = took;
        after = database_state(path);
    }
    expect_sound(path);
    assert_true(before != after);
    long caught = 0, old = 0, hot = 0;
    for (long n = 0; n < times; n++) {
        writer_prepare(w, origin, path);
        const int64_t moment = (int64_t)random_below((uint64_t)(whole + whole / 10));
        const int64_t began = microseconds();
        const pid_t child = start(w, path);
        const int64_t rest = moment - (microseconds() - began);
        if (rest > 0) usleep((useconds_t)rest);
        kill(child, SIGKILL);
        wait_for(child, &killed);
        char journal[300];
        snprintf(journal, sizeof journal, "%s-journal", path);
        struct stat left;
        hot += stat(journal, &left) == 0 && left.st_size > 0;
        /* An empty new file, or one with nothing in it but a rolled back beginning, is as good as none. */
        uint64_t now = database_state(path);
        if (!w->before && now != after && exists(path)) {
            char *tables = dump(path, "SELECT count(*) FROM sqlite_schema");
            CHECK(strcmp(tables, "30 \n") == 0, "%s, killed after %lld us: something is in the new file", w->name,
                  (long long)moment);
            sqlite3_free(tables);
            now = before;
        }
        CHECK(now == before || now == after, "%s, killed after %lld of %lld us: neither as before nor done",
              w->name, (long long)moment, (long long)whole);
        caught += killed;
        old += now == before;
        if (n % 16 == 0 && now == before) { /* and nothing stands in the way of the next one */
            CHECK(w->run(path) == 0, "%s, after a kill: %s", w->name, message);
            assert_true(database_state(path) == after);
        }
    }
    printf("%s: %ld kills within %lld us, %ld in time, %ld with a journal left; %ld times as before, %ld done\n",
           w->name, times, (long long)whole, caught, hot, old, times - old);
    assert_true(caught > 0);
    remove_file_and_company(path);
}

static void F49_a_kill_leaves_the_database_as_it_was_or_done(void **unused) {
    (void)unused;
    for (size_t n = 0; n < LENGTH(writers); n++) {
        const file_path origin = writer_origin(&writers[n]);
        kill_often(&writers[n], origin.text, kills / (long)LENGTH(writers) + 1);
        remove_file_and_company(origin.text);
    }
}

int main(void) {
#ifdef __SANITIZE_ADDRESS__
    kills = 30;
#endif
    if (getenv("RQT_KILLS")) kills = strtol(getenv("RQT_KILLS"), NULL, 10);
    if (getenv("RQT_SEED")) seed = strtoull(getenv("RQT_SEED"), NULL, 0);
    printf("RQT_SEED=%llu RQT_KILLS=%ld\n", (unsigned long long)seed, kills);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(F49_a_kill_leaves_the_database_as_it_was_or_done, begin),
    };
    alarm(600);
    return cmocka_run_group_tests_name("kills", tests, begin_all, end_all);
}
