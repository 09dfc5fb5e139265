// confinement.c - a worker that was taken over tries to get out (escapes.c): as root, as a plain
// user, and where the system allows no namespaces, as in many containers.
#include <errno.h>
#include <pwd.h>
#include <sched.h>
#include <seccomp.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "tests/attack/tenant_rig.h"

static const char plain_user[] = "nobody";
static char program[512];

static bool has_landlock(void)
{
    return syscall(SYS_landlock_create_ruleset, NULL, 0, 1 /* its version */) > 0;
}

// A process that the worker is to leave alone, of the same user.
static pid_t start_outside(const struct passwd *user)
{
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (user && (setgid(user->pw_gid) != 0 || setuid(user->pw_uid) != 0))
            _exit(1);
        for (;;)
            pause();
    }
    return pid;
}

static bool may_run(const struct passwd *user)
{
    int status = 1;
    pid_t pid = fork();
    if (pid == 0)
        _exit(setgid(user->pw_gid) != 0 || setuid(user->pw_uid) != 0 || access(program, X_OK) != 0);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    return status == 0;
}

static void check_log(struct daemon *d)
{
    int tried = 0, possible = -1;
    daemon_wait_log(d, "possible\n");
    char *log = daemon_read(d, "log");
    for (const char *line = log; (line = strstr(line, "escape: ")); line++)
        if (memmem(line, strcspn(line, "\n"), " POSSIBLE ", 10))
            print_message("%.*s\n", (int)strcspn(line, "\n"), line);
    const char *sum = strstr(log, "escapes: ");
    assert_non_null(sum);
    assert_int_equal(sscanf(sum, "escapes: %d tried, %d possible", &tried, &possible), 2);
    free(log);
    assert_true(tried >= 60);
    assert_int_equal(possible, 0);
}

// `namespaces`: what the daemon says of them.
static void attack(const struct passwd *user, const char *namespaces)
{
    struct daemon d;
    char text[32];
    tenant_rig_init(&d);
    assert_int_equal(chmod(d.folder, 0777), 0); // only the sandbox is in the way
    daemon_option(&d, "worker", program);
    daemon_option(&d, "sandbox", "require");
    daemon_option(&d, "restart-delay", "60"); // it ends when it has tried all
    if (user)
        daemon_option(&d, "user", user->pw_name);
    pid_t outside = start_outside(user);
    snprintf(text, sizeof text, "%d", (int)outside);
    setenv("HELIO_ESCAPE_PID", text, 1);
    setenv("HELIO_ESCAPE_FOLDER", d.folder, 1);
    daemon_start(&d);
    if (has_landlock())
        check_log(&d);
    else // refused, as nothing else keeps files apart everywhere
        daemon_wait_log(&d, "not confined");
    if (namespaces)
        daemon_wait_log(&d, namespaces);
    assert_int_equal(kill(outside, 0), 0);
    kill(outside, SIGKILL);
    waitpid(outside, NULL, 0);
    daemon_finish(&d);
}

static void nothing_is_possible(void **state)
{
    (void)state;
    attack(NULL, NULL);
}

static void nothing_is_possible_for_a_plain_user(void **state)
{
    (void)state;
    const struct passwd *user = getpwnam(plain_user);
    if (geteuid() != 0 || !user || !may_run(user)) {
        skip(); // it has been shown as a plain user already, or that one cannot reach the programs
        return;
    }
    attack(user, "runs as nobody");
}

// What keeps unprivileged containers from making namespaces. Stays for the rest of the program.
static void refuse_namespaces(void)
{
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
    const struct scmp_arg_cmp user = {
        .arg = 0, .op = SCMP_CMP_MASKED_EQ, .datum_a = CLONE_NEWUSER, .datum_b = CLONE_NEWUSER};
    assert_non_null(filter);
    assert_int_equal(seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(clone), 1, user), 0);
    assert_int_equal(seccomp_load(filter), 0);
    seccomp_release(filter);
}

static void nothing_is_possible_without_namespaces(void **state)
{
    (void)state;
    refuse_namespaces();
    attack(NULL, "workers have no namespaces: the system does not allow more");
}

int main(void)
{
    const char *build = getenv("HELIO_BUILD_DIR");
    snprintf(program, sizeof program, "%s/tests/escapes", build ? build : ".");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_is_possible),
        cmocka_unit_test(nothing_is_possible_for_a_plain_user),
        cmocka_unit_test(nothing_is_possible_without_namespaces),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
