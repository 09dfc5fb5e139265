#include "server/loader/confine.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/landlock.h>
#include <seccomp.h>
#include <sched.h>
#include <signal.h>
#include <stddef.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { SANITIZED = true }; // their shadows are private memory, too
#else
enum { SANITIZED = false };
#endif

// ---- the spawner -------------------------------------------------------------------------------

// All rights of the first ABI; none is given to any path
// (Documentation/userspace-api/landlock.rst).
static bool close_files(void)
{
    const struct landlock_ruleset_attr all = {.handled_access_fs = (1 << 13) - 1};
    const int fd = (int)syscall(SYS_landlock_create_ruleset, &all, sizeof all, 0);
    if (fd < 0)
        return false;
    const bool entered = syscall(SYS_landlock_restrict_self, fd, 0) == 0;
    close(fd);
    return entered;
}

bool hg_confine_spawner(const struct confinement *c)
{
    const struct rlimit no_core = {0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0)
        return false;
    return c->off || close_files() || !c->required;
}

// ---- one loader --------------------------------------------------------------------------------

static const int allowed_calls[] = {SCMP_SYS(read), SCMP_SYS(write), SCMP_SYS(readv),
    SCMP_SYS(writev), SCMP_SYS(pread64), SCMP_SYS(lseek), SCMP_SYS(close), SCMP_SYS(fstat),
    SCMP_SYS(fcntl), SCMP_SYS(recvmsg), SCMP_SYS(sendto), SCMP_SYS(munmap), SCMP_SYS(mremap),
    SCMP_SYS(madvise), SCMP_SYS(brk), SCMP_SYS(futex), SCMP_SYS(set_robust_list), SCMP_SYS(rseq),
    SCMP_SYS(exit), SCMP_SYS(exit_group), SCMP_SYS(sched_yield), SCMP_SYS(sched_getaffinity),
    SCMP_SYS(getpid), SCMP_SYS(gettid), SCMP_SYS(rt_sigaction), SCMP_SYS(rt_sigprocmask),
    SCMP_SYS(rt_sigreturn), SCMP_SYS(sigaltstack), SCMP_SYS(clock_gettime), SCMP_SYS(gettimeofday),
    SCMP_SYS(time), SCMP_SYS(getrusage), SCMP_SYS(getrandom), SCMP_SYS(restart_syscall)};

// Memory is private: what is shared would not count as memory of the process (RLIMIT_DATA). It is
// never writable and executable at once, and, as no compiler runs here, not executable at all.
static bool allow_memory(scmp_filter_ctx filter)
{
    const scmp_datum_t no_code = 0, code = PROT_EXEC;
    return seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(mmap), 2,
               SCMP_A2(SCMP_CMP_MASKED_EQ, code, no_code),
               SCMP_A3(SCMP_CMP_MASKED_EQ, MAP_SHARED | MAP_PRIVATE, MAP_PRIVATE)) == 0 &&
           seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(mprotect), 1,
               SCMP_A2(SCMP_CMP_MASKED_EQ, code, no_code)) == 0;
}

// Image libraries have pools of threads; there are no processes.
static bool allow_threads(scmp_filter_ctx filter)
{
    return seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(clone), 1,
               SCMP_A0(SCMP_CMP_MASKED_EQ, CLONE_THREAD, CLONE_THREAD)) == 0 &&
           // Its flags lie in memory, where a filter cannot look; the C library takes clone then.
           seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3), 0) == 0;
}

static bool enter_seccomp(void)
{
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
    if (!filter)
        return false;
    bool ok = allow_memory(filter) && allow_threads(filter);
    for (size_t i = 0; i < sizeof allowed_calls / sizeof *allowed_calls; i++)
        ok &= allowed_calls[i] < 0 ||
              seccomp_rule_add(filter, SCMP_ACT_ALLOW, allowed_calls[i], 0) == 0;
    ok = ok && seccomp_load(filter) == 0;
    seccomp_release(filter);
    return ok;
}

static void set_limit(int which, uint64_t soft, uint64_t hard)
{
    setrlimit((__rlimit_resource_t)which, &(struct rlimit){soft, hard});
}

static bool can_escape(void)
{
    return open("/etc/passwd", O_RDONLY | O_CLOEXEC) >= 0 ||
           socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0) >= 0 || fork() >= 0 ||
           memfd_create("escape", MFD_CLOEXEC) >= 0;
}

bool hg_confine_loader(const struct confinement *c)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    set_limit(RLIMIT_CPU, c->cpu_s, c->cpu_s + 1);             // SIGXCPU, then SIGKILL
    set_limit(RLIMIT_FSIZE, c->memory_bytes, c->memory_bytes); // of the result, which is a file
    signal(SIGXFSZ, SIG_IGN);                                  // an error of write
    if (!SANITIZED)
        set_limit(RLIMIT_DATA, c->memory_bytes, c->memory_bytes);
    if (c->off)
        return true;
    const bool entered = enter_seccomp();
    return !c->required || (entered && !can_escape());
}
