// worker.c - what a worker is given by the daemon: no secrets, no descriptors of others, and the
// first place when the kernel runs out of memory.
#include <dirent.h>
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/system/daemon.h"

static size_t read_of(pid_t pid, const char *name, char *out, size_t size)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/%s", (int)pid, name);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    size_t got = fread(out, 1, size - 1, file);
    fclose(file);
    out[got] = 0;
    return got;
}

static bool has_file(pid_t pid, const char *text)
{
    char folder[64], path[320], target[512];
    snprintf(folder, sizeof folder, "/proc/%d/fd", (int)pid);
    DIR *dir = opendir(folder);
    assert_non_null(dir);
    bool found = false;
    for (struct dirent *entry; (entry = readdir(dir));) {
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        ssize_t length = readlink(path, target, sizeof target - 1);
        target[length > 0 ? length : 0] = 0;
        found |= strstr(target, text) != NULL;
    }
    closedir(dir);
    return found;
}

static void worker_gets_what_it_needs(void **state)
{
    (void)state;
    struct daemon d;
    static char text[65536];
    daemon_init(&d);
    daemon_write(&d, "secret", "of the daemon");
    char path[TEST_FOLDER_MAX + 8];
    snprintf(path, sizeof path, "%s/secret", d.folder);
    int fd = open(path, O_RDONLY); // inherited by the daemon
    assert_true(fd >= 0);
    setenv("DATABASE_PASSWORD", "do not tell", 1);
    daemon_start(&d);
    pid_t worker = daemon_worker(&d, 0);
    assert_true(has_file(d.pid, "/secret"));
    assert_false(has_file(worker, "/secret"));
    size_t size = read_of(d.pid, "environ", text, sizeof text);
    assert_non_null(memmem(text, size, "DATABASE_PASSWORD", 17));
    size = read_of(worker, "environ", text, sizeof text);
    assert_null(memmem(text, size, "DATABASE_PASSWORD", 17));
    assert_non_null(memmem(text, size, "HELIO_FAKE_DIR", 14));
    uint64_t deadline_ns = hg_clock_now_ns() + 20000000000u;
    do { // written just after it was started
        assert_true(hg_clock_now_ns() < deadline_ns);
        read_of(worker, "oom_score_adj", text, sizeof text);
    } while (atoi(text) < 500);
    read_of(d.pid, "oom_score_adj", text, sizeof text);
    assert_true(atoi(text) < 500);
    unsetenv("DATABASE_PASSWORD");
    close(fd);
    daemon_finish(&d);
}

// A number of /proc/PID/status, in hexadecimal.
static unsigned long long status_of(pid_t pid, const char *name)
{
    static char text[8192];
    read_of(pid, "status", text, sizeof text);
    const char *line = strstr(text, name);
    assert_non_null(line);
    return strtoull(line + strlen(name), NULL, 16);
}

// Once it listens it has no capabilities, cannot get any, and makes the calls of its list only.
static void daemon_gives_up_its_rights(void **state)
{
    (void)state;
    struct daemon d;
    daemon_begin(&d);
    pid_t worker = daemon_worker(&d, 0);
    const pid_t pids[] = {d.pid, worker};
    for (int i = 0; i < 2; i++) {
        assert_true(status_of(pids[i], "CapPrm:") == 0 && status_of(pids[i], "CapEff:") == 0);
        assert_true(geteuid() != 0 || status_of(pids[i], "CapBnd:") == 0);
        assert_int_equal(status_of(pids[i], "NoNewPrivs:"), 1);
    }
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    assert_int_equal(status_of(d.pid, "Seccomp:"), 2);
#endif
    assert_int_equal(status_of(worker, "Seccomp:"), 0); // its own, were it a real one
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(worker_gets_what_it_needs), cmocka_unit_test(daemon_gives_up_its_rights)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
