// test_disk_watch.c - what workers have on the disk is counted and limited; what is discarded goes.
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "server/broker/workers/confine.h"
#include "server/broker/storage/disk_watch.h"
#include "tests/support/folder.h"

enum { PLACES = 3, KIB = 1 << 10 };

static char folder[TEST_FOLDER_MAX];

static void make(const char *name)
{
    char path[TEST_FOLDER_MAX + 300];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    assert_true(mkdir(path, 0700) == 0 || errno == EEXIST);
}

static void fill(const char *name, off_t bytes)
{
    char path[TEST_FOLDER_MAX + 300];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    const int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    assert_true(fd >= 0);
    assert_int_equal(posix_fallocate(fd, 0, bytes), 0);
    close(fd);
}

static bool has(const char *name)
{
    char path[TEST_FOLDER_MAX + 300];
    struct stat st;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return lstat(path, &st) == 0;
}

static void await_gone(const char *name)
{
    for (int i = 0; has(name); i++) {
        assert_true(i < 5000);
        hg_clock_sleep_ns(2000000);
    }
}

static void await_fault(struct hg_disk_watch *w, uint32_t place, pid_t pid, enum hg_disk_fault what)
{
    for (int i = 0; hg_disk_watch_fault(w, place, pid) != what; i++) {
        if (i >= 5000)
            fail_msg("place %u: fault %d", place, hg_disk_watch_fault(w, place, pid));
        hg_clock_sleep_ns(2000000);
    }
}

// A pass over all places that have been set has begun and ended.
static void await_counted(struct hg_disk_watch *w, uint32_t place, pid_t pid)
{
    char name[40], path[TEST_FOLDER_MAX + 300];
    snprintf(name, sizeof name, "workers/%u/cache/counted", place);
    snprintf(path, sizeof path, "%s/%s", folder, name);
    fill(name, 1024 * KIB);
    await_fault(w, place, pid, HG_DISK_NAMED);
    assert_int_equal(unlink(path), 0);
    await_fault(w, place, pid, HG_DISK_FINE);
}

static struct hg_disk_watch *start(const struct hg_disk_limits *limits)
{
    struct hg_disk_watch *w;
    assert_int_equal(hg_disk_watch_start(folder, PLACES, limits, &w), HG_OK);
    return w;
}

// A child process: a byte written to `go` starts it; a byte read from `holds` says that its file
// is open.
struct child {
    pid_t pid;
    int go, holds;
};

enum deed { HOLD_FILE, HIDE };

static void act(enum deed deed, int holds)
{
    if (deed == HIDE)
        _exit(prctl(PR_SET_DUMPABLE, 0, 0, 0, 0) == 0 ? (pause(), 0) : 1);
    const int fd = open(folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (fd < 0 || posix_fallocate(fd, 0, 1024 * KIB) != 0)
        _exit(1);
    (void)!write(holds, "", 1);
    pause();
}

static struct child begin_child(enum deed deed)
{
    int pipe_fds[2], back[2];
    char byte;
    assert_int_equal(pipe(pipe_fds), 0);
    assert_int_equal(pipe(back), 0);
    const struct child child = {.pid = fork(), .go = pipe_fds[1], .holds = back[0]};
    assert_true(child.pid >= 0);
    if (child.pid == 0) {
        close(pipe_fds[1]);
        if (read(pipe_fds[0], &byte, 1) == 1)
            act(deed, back[1]);
        _exit(0);
    }
    close(pipe_fds[0]);
    close(back[1]);
    return child;
}

static void end_child(const struct child *child)
{
    kill(child->pid, SIGKILL);
    waitpid(child->pid, NULL, 0);
    close(child->go);
    close(child->holds);
}

static void files_with_names_are_limited(void **state)
{
    (void)state;
    struct hg_disk_watch *w = start(&(struct hg_disk_limits){
        .named_bytes = 512 * KIB, .named_files = 8, .interval_ns = 1000000});
    const pid_t self = getpid();
    for (uint32_t i = 0; i < PLACES; i++)
        hg_disk_watch_set(w, i, self, true);
    fill("workers/0/cache/a/small", 4 * KIB);
    fill("workers/1/cache/a/large", 1024 * KIB);
    await_fault(w, 1, self, HG_DISK_NAMED);
    for (char name[] = "workers/2/cache/0"; name[16] < '9'; name[16]++)
        fill(name, 1);
    await_fault(w, 2, self, HG_DISK_NAMED);
    assert_int_equal(hg_disk_watch_fault(w, 0, self), HG_DISK_FINE);
    assert_int_equal(hg_disk_watch_fault(w, 1, self + 1), HG_DISK_FINE); // another process
    assert_true(hg_disk_discard(w, folder, "workers/none"));
    char path[TEST_FOLDER_MAX + 40];
    for (int i = 1; i < PLACES; i++) {
        snprintf(path, sizeof path, "%s/workers/%d/cache", folder, i);
        assert_true(hg_disk_discard(w, folder, path));
        await_fault(w, (uint32_t)i, self, HG_DISK_FINE);
    }
    hg_disk_watch_stop(w);
}

// However deep, and nothing that links lead to.
static void what_is_discarded_goes(void **state)
{
    (void)state;
    char path[TEST_FOLDER_MAX + 40], link[TEST_FOLDER_MAX + 40];
    const int here = open(".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    make("deep");
    make("kept");
    fill("kept/file", 1);
    snprintf(path, sizeof path, "%s/kept", folder);
    snprintf(link, sizeof link, "%s/deep/link", folder);
    assert_int_equal(symlink(path, link), 0);
    snprintf(path, sizeof path, "%s/deep", folder);
    assert_int_equal(chdir(path), 0);
    for (int i = 0; i < 200; i++) {
        assert_int_equal(mkdir("d", 0700), 0);
        assert_int_equal(chdir("d"), 0);
    }
    assert_int_equal(fchdir(here), 0);
    close(here);
    struct hg_disk_watch *w = start(&(struct hg_disk_limits){.interval_ns = 1000000000000});
    assert_true(hg_disk_discard(w, folder, path));
    assert_false(has("deep"));
    hg_disk_watch_stop(w);
    snprintf(path, sizeof path, "%s/discarded", folder);
    assert_true(rmdir(path) == 0 || errno == ENOENT);
    assert_true(has("kept/file"));
}

static void tenants_at_rest_are_limited(void **state)
{
    (void)state;
    static const char *const old[] = {"tenants/a", "tenants/b"};
    for (int i = 0; i < 2; i++) {
        char name[64];
        make(old[i]);
        snprintf(name, sizeof name, "%s/store", old[i]);
        make(name);
        snprintf(name, sizeof name, "%s/store/pack", old[i]);
        fill(name, 512 * KIB);
        if (i == 0) {
            char path[TEST_FOLDER_MAX + 64];
            const struct timespec times[2] = {{.tv_sec = 1000}, {.tv_sec = 1000}};
            snprintf(path, sizeof path, "%s/%s", folder, name);
            assert_int_equal(utimensat(AT_FDCWD, path, times, 0), 0);
            snprintf(path, sizeof path, "%s/%s/store", folder, old[i]);
            assert_int_equal(utimensat(AT_FDCWD, path, times, 0), 0);
        }
    }
    struct hg_disk_watch *w =
        start(&(struct hg_disk_limits){.rest_bytes = 700 * KIB, .interval_ns = 1000000});
    await_gone(old[0]);
    hg_disk_watch_stop(w);
    assert_true(has("tenants/b/store/pack"));
}

static void files_without_names_are_limited(void **state)
{
    (void)state;
    const struct hg_disk_limits limits = {.named_bytes = 512 * KIB,
        .named_files = 64,
        .unnamed_bytes = 512 * KIB,
        .interval_ns = 1000000};
    struct hg_disk_watch *w = start(&limits);
    const struct child child = begin_child(HOLD_FILE), other = begin_child(HOLD_FILE);
    hg_disk_watch_set(w, 1, other.pid, true);
    hg_disk_watch_set(w, 0, child.pid, true);
    await_counted(w, 0, child.pid); // both, without it
    assert_int_equal(write(child.go, "", 1), 1);
    await_fault(w, 0, child.pid, HG_DISK_UNNAMED);
    assert_int_equal(hg_disk_watch_fault(w, 1, other.pid), HG_DISK_FINE);
    end_child(&child);
    end_child(&other);
    hg_disk_watch_stop(w);
    // One that had it before there was a limit keeps it.
    const struct child early = begin_child(HOLD_FILE);
    char byte;
    assert_int_equal(write(early.go, "", 1), 1);
    assert_int_equal(read(early.holds, &byte, 1), 1);
    w = start(&limits);
    hg_disk_watch_set(w, 0, early.pid, true);
    await_counted(w, 0, early.pid);
    assert_int_equal(hg_disk_watch_fault(w, 0, early.pid), HG_DISK_FINE);
    end_child(&early);
    hg_disk_watch_stop(w);
}

// The last test: without capabilities, as the daemon is.
static void who_hides_is_found(void **state)
{
    (void)state;
    assert_int_equal(hg_confine_drop_capabilities(), 0);
    struct hg_disk_watch *w = start(&(struct hg_disk_limits){
        .named_bytes = 512 * KIB, .named_files = 64, .interval_ns = 1000000});
    const struct child child = begin_child(HIDE), other = begin_child(HOLD_FILE);
    hg_disk_watch_set(w, 1, other.pid, true);
    hg_disk_watch_set(w, 0, child.pid, true);
    await_counted(w, 0, child.pid);
    assert_int_equal(write(child.go, "", 1), 1);
    await_fault(w, 0, child.pid, HG_DISK_HIDDEN);
    assert_int_equal(hg_disk_watch_fault(w, 1, other.pid), HG_DISK_FINE);
    end_child(&child);
    end_child(&other);
    hg_disk_watch_stop(w);
}

static int setup(void **state)
{
    (void)state;
    assert_true(test_folder_make(folder, "disk"));
    make("workers");
    make("tenants");
    for (int i = 0; i < PLACES; i++) {
        char name[40];
        snprintf(name, sizeof name, "workers/%d", i);
        make(name);
        strcat(name, "/cache");
        make(name);
        strcat(name, "/a");
        make(name);
    }
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    assert_true(test_folder_remove(folder));
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(files_with_names_are_limited, setup, teardown),
        cmocka_unit_test_setup_teardown(what_is_discarded_goes, setup, teardown),
        cmocka_unit_test_setup_teardown(tenants_at_rest_are_limited, setup, teardown),
        cmocka_unit_test_setup_teardown(files_without_names_are_limited, setup, teardown),
        cmocka_unit_test_setup_teardown(who_hides_is_found, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
