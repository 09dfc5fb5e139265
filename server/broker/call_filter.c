#include "server/broker/call_filter.h"

#include <errno.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#if defined(__x86_64__)
#define NATIVE_ARCH AUDIT_ARCH_X86_64
#elif defined(__aarch64__)
#define NATIVE_ARCH AUDIT_ARCH_AARCH64
#endif

// Those of workers, whom a successor of this process starts, and what only a daemon needs.
static const uint32_t allowed[] = {
#define HG_CALL(name) __NR_##name,
#include "server/calls.def"
    // files: uploads, homes, state
    __NR_openat2,
    __NR_linkat,
    __NR_symlinkat,
    __NR_fchmodat,
    __NR_fchown,
    __NR_fchownat,
    __NR_getxattr,
    __NR_fgetxattr,
    __NR_sync,
    __NR_syncfs,
    __NR_chdir,
    // memory and limits, its own and those of workers
    __NR_mmap,
    __NR_mprotect,
    __NR_prlimit64,
    __NR_setpriority,
    __NR_sched_setaffinity,
    __NR_sched_setparam,
    __NR_sched_setscheduler,
    __NR_sched_setattr,
    // clients
    __NR_socket,
    __NR_socketpair,
    __NR_bind,
    __NR_listen,
    __NR_accept,
    __NR_accept4,
    __NR_connect,
    __NR_sendmmsg,
    __NR_recvmmsg,
    // processes: the successor, its launcher, workers and loaders
    __NR_clone,
    __NR_clone3,
    __NR_execve,
    __NR_kill,
    __NR_tgkill,
    __NR_tkill,
    __NR_setpgid,
    __NR_setsid,
    __NR_setuid,
    __NR_setgid,
    __NR_setgroups,
    __NR_setresuid,
    __NR_setresgid,
    __NR_capset,
    __NR_seccomp,
    __NR_landlock_create_ruleset,
    __NR_landlock_add_rule,
    __NR_landlock_restrict_self,
    __NR_mount,
    __NR_umount2,
    __NR_pivot_root,
    __NR_mount_setattr,
    __NR_rt_sigqueueinfo,
    __NR_rt_tgsigqueueinfo,
#ifdef __x86_64__
    __NR_link,
    __NR_symlink,
    __NR_chmod,
    __NR_chown,
    __NR_lchown,
    __NR_fork,
    __NR_vfork,
    __NR_signalfd,
    __NR_inotify_init1,
#endif
};

enum { CALLS = sizeof allowed / sizeof allowed[0], HEAD = 4, LENGTH = HEAD + 2 * CALLS + 1 };

#if !defined(NATIVE_ARCH)
bool hg_call_filter_enter(void)
{
    return false;
}
#elif defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
bool hg_call_filter_enter(void)
{
    return true; // they trace the process when it ends
}
#else
static void order(struct sock_filter *at, uint32_t number)
{
    at[0] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, number, 0, 1);
    at[1] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
}

bool hg_call_filter_enter(void)
{
    struct sock_filter code[LENGTH] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, arch)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, NATIVE_ARCH, 1, 0),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
    };
    for (int i = 0; i < CALLS; i++)
        order(&code[HEAD + 2 * i], allowed[i]);
    code[LENGTH - 1] = (struct sock_filter)BPF_STMT(
        BPF_RET | BPF_K, SECCOMP_RET_ERRNO | (EPERM & SECCOMP_RET_DATA));
    const struct sock_fprog program = {.len = LENGTH, .filter = code};
    return prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) == 0;
}
#endif
