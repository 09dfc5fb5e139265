// shares.c - cores and memory are shared out by the weights of tenants: in control groups (a plain
// folder stands in for a hierarchy), or with limits of memory and nice.
#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/attack/tenant_rig.h"

static void begin(struct daemon *d, const char *group)
{
    char path[TEST_FOLDER_MAX + 8];
    tenant_rig_init(d);
    daemon_write(d, "tokens",
        "anna-token-1 edit anna\nbert-token-1 edit bert weight=300\n"
        "carl-token-1 edit carl weight=10\nadmin-token-1 admin\n");
    daemon_option(d, "sandbox", "best-effort"); // off takes limits away as well
    daemon_option(d, "worker-nice", "2");
    if (group) {
        snprintf(path, sizeof path, "%s/%s", d->folder, group);
        assert_int_equal(mkdir(path, 0700), 0);
        daemon_option(d, "cgroup", path);
    }
    daemon_start(d);
}

// ---- control groups -----------------------------------------------------------------------------

static unsigned long long number_in(struct daemon *d, const char *folder, const char *name)
{
    char path[200];
    snprintf(path, sizeof path, "group/%s/%s", folder, name);
    if (!daemon_has_file(d, path))
        return 0;
    char *text = daemon_read(d, path);
    unsigned long long value = strtoull(text, NULL, 10);
    free(text);
    return value;
}

// A plain file keeps what was written last: the process that made the worker, which is in the group
// from its first moment on.
static void assert_was_entered(struct daemon *d, const char *name)
{
    const unsigned long long pid = number_in(d, name, "cgroup.procs");
    assert_true(pid != 0 && pid != (unsigned long long)d->pid);
}

static void await_number(
    struct daemon *d, const char *folder, const char *name, unsigned long long value)
{
    uint64_t deadline_ns = hg_clock_now_ns() + 20000000000u;
    while (number_in(d, folder, name) != value) {
        assert_true(hg_clock_now_ns() < deadline_ns);
        usleep(20000);
    }
}

static void groups_have_weights(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna, bert;
    const char *const annas = "worker-0", *const berts = "worker-1"; // by their places
    begin(&d, "group");
    await_number(&d, "daemon", "cgroup.procs", (unsigned long long)d.pid);
    tenant_enter(&anna, &d, "anna-token-1", "hall");
    tenant_await_worker(&d, "anna", 0);
    assert_was_entered(&d, annas);
    await_number(&d, annas, "cpu.weight", 100);
    char *enabled = daemon_read(&d, "group/cgroup.subtree_control");
    assert_string_equal(enabled, "+pids"); // the last one; a plain file keeps no others
    free(enabled);
    unsigned long long alone = number_in(&d, annas, "memory.max");
    assert_true(alone > UINT64_C(100) << 20);
    tenant_enter(&bert, &d, "bert-token-1", "hall");
    tenant_await_worker(&d, "bert", 0);
    assert_was_entered(&d, berts);
    await_number(&d, berts, "cpu.weight", 300);
    await_number(&d, annas, "memory.max", alone / 4);
    assert_int_equal(number_in(&d, berts, "memory.max") / 4096, alone / 4 * 3 / 4096);
    assert_int_equal(number_in(&d, annas, "pids.max"), 1024);
    peer_close(&bert);
    peer_close(&anna);
    daemon_finish(&d);
}

static void a_group_that_was_named_must_be_there(void **state)
{
    (void)state;
    struct daemon d;
    tenant_rig_init(&d);
    daemon_option(&d, "cgroup", "/nowhere/at/all");
    assert_int_not_equal(daemon_run(&d), 0);
    char *log = daemon_read(&d, "log");
    assert_non_null(strstr(log, "--cgroup"));
    free(log);
    daemon_finish(&d);
}

// ---- without ------------------------------------------------------------------------------------

static uint64_t limit_of(pid_t pid)
{
    struct rlimit limit;
    assert_int_equal(prlimit(pid, RLIMIT_DATA, NULL, &limit), 0);
    return limit.rlim_cur;
}

static uint64_t await_limit(pid_t pid, uint64_t other_than)
{
    uint64_t deadline_ns = hg_clock_now_ns() + 20000000000u, bytes;
    while ((bytes = limit_of(pid)) == other_than || bytes == RLIM_INFINITY) {
        assert_true(hg_clock_now_ns() < deadline_ns);
        usleep(20000);
    }
    return bytes;
}

static bool all_threads_have(pid_t pid, int nice)
{
    char path[64];
    bool all = true;
    snprintf(path, sizeof path, "/proc/%d/task", (int)pid);
    DIR *dir = opendir(path);
    assert_non_null(dir);
    for (struct dirent *it; (it = readdir(dir));)
        if (it->d_name[0] != '.')
            all &= getpriority(PRIO_PROCESS, (id_t)atoi(it->d_name)) == nice;
    closedir(dir);
    return all;
}

static void await_nice(pid_t pid, int nice)
{
    const uint64_t deadline_ns = hg_clock_now_ns() + 20000000000u;
    while (!all_threads_have(pid, nice > 19 ? 19 : nice)) {
        assert_true(hg_clock_now_ns() < deadline_ns);
        usleep(20000);
    }
}

static void limits_have_weights(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna, bert, carl;
    begin(&d, NULL);
    tenant_enter(&anna, &d, "anna-token-1", "hall");
    pid_t annas = tenant_await_worker(&d, "anna", 0);
    // Alone it may have all that workers may have: three quarters of the machine.
    uint64_t all = (uint64_t)sysconf(_SC_PHYS_PAGES) * (uint64_t)sysconf(_SC_PAGESIZE) / 4 * 3;
    uint64_t deadline_ns = hg_clock_now_ns() + 20000000000u;
    while (limit_of(annas) != all) {
        assert_true(hg_clock_now_ns() < deadline_ns);
        usleep(20000);
    }
    tenant_enter(&bert, &d, "bert-token-1", "hall");
    pid_t berts = tenant_await_worker(&d, "bert", 0);
    assert_true(await_limit(annas, all) == all / 4);
    deadline_ns = hg_clock_now_ns() + 20000000000u;
    while (limit_of(berts) / 4096 != all / 4 * 3 / 4096) {
        assert_true(hg_clock_now_ns() < deadline_ns);
        usleep(20000);
    }
    tenant_enter(&carl, &d, "carl-token-1", "hall");
    pid_t carls = tenant_await_worker(&d, "carl", 0);
    const int base = getpriority(PRIO_PROCESS, (id_t)d.pid) + 2; // the heaviest, bert, keeps it
    await_nice(annas, base + 5);                                 // 1.25^5 = 3.05
    await_nice(carls, base + 15);
    await_nice(berts, base);
    peer_close(&carl);
    peer_close(&bert);
    peer_close(&anna);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(groups_have_weights),
        cmocka_unit_test(a_group_that_was_named_must_be_there),
        cmocka_unit_test(limits_have_weights),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
