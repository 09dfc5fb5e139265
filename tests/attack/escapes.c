// escapes.c - a program in the worker's place that has been taken over: it confines itself as a
// worker does, then tries all it can think of. One line of stderr for each attempt:
//   escape: NAME refused|POSSIBLE (errno)
// then "escapes: N tried, M possible". Where things are comes from HELIO_ESCAPE_FOLDER (of the
// test) and HELIO_ESCAPE_PID (a process of the same user outside).
#include <errno.h>
#include <fcntl.h>
#include <linux/keyctl.h>
#include <linux/perf_event.h>
#include <mqueue.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/timex.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <sys/xattr.h>
#include <unistd.h>

#include "server/worker/sandbox.h"

static const char *folder, *cache, *uploads;
static pid_t outside;
static int tried, possible;

static void report(const char *name, bool worked)
{
    const int e = errno;
    tried++;
    possible += worked;
    fprintf(stderr, "escape: %s %s (%s)\n", name, worked ? "POSSIBLE" : "refused", strerror(e));
}

// The attempt worked when it is not negative.
#define TRY(name, attempt)                                                                         \
    do {                                                                                           \
        errno = 0;                                                                                 \
        report(name, (long)(attempt) >= 0);                                                        \
    } while (0)

static const char *at(const char *above, const char *name)
{
    static char paths[4][600];
    static int next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", above, name);
    return path;
}

static const char *of_process(const char *name)
{
    char text[64];
    snprintf(text, sizeof text, "%d/%s", (int)outside, name);
    return at("/proc", text);
}

static int reads(const char *path)
{
    return open(path, O_RDONLY | O_CLOEXEC);
}

static int writes(const char *path)
{
    return open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
}

static void try_files(void)
{
    TRY("read /etc/passwd", reads("/etc/passwd"));
    TRY("read /etc/shadow", reads("/etc/shadow"));
    TRY("list /root", reads("/root"));
    TRY("list /home", reads("/home"));
    TRY("read the tokens", reads(at(folder, "tokens")));
    TRY("change the mode of the tokens", chmod(at(folder, "tokens"), 0666));
    TRY("change the owner of the tokens", chown(at(folder, "tokens"), getuid(), getgid()));
    TRY("attributes of the tokens", setxattr(at(folder, "tokens"), "user.x", "1", 1, 0));
    TRY("remove the tokens", unlink(at(folder, "tokens")));
    TRY("truncate the log", truncate(at(folder, "log"), 0));
    TRY("list homes of others", reads(at(folder, "cache/workers")));
    TRY("read tenants at rest", reads(at(folder, "cache/tenants")));
    TRY("read all uploads", reads(at(folder, "cache/uploads")));
    TRY("write where shaders come from", writes(at(folder, "cache/seed/shaders/planted")));
    TRY("write beside its cache", writes(at(cache, "../owner")));
    TRY("rename out of its cache", rename(at(cache, "store"), at(cache, "../store")));
    TRY("write among its uploads", writes(at(uploads, "planted")));
    TRY("write a library", writes("/usr/lib/planted.so"));
    TRY("write /tmp", writes("/tmp/planted"));
    TRY("symbolic link in its cache", symlink("/etc", at(cache, "link")));
    TRY("hard link into its cache", link("/usr/bin/env", at(cache, "program")));
    TRY("device in its cache", mknod(at(cache, "device"), S_IFBLK | 0600, 0x800));
    TRY("pipe in its cache", mkfifo(at(cache, "pipe"), 0600));
    TRY("program with the owner's rights", chmod(at(cache, "store"), 04755));
    struct {
        unsigned bytes;
        int type;
        unsigned char handle[128];
    } handle = {.bytes = 8};
    TRY("open by handle", syscall(SYS_open_by_handle_at, AT_FDCWD, &handle, O_RDONLY));
    TRY("read a disk", reads("/dev/vda"));
    TRY("read memory", reads("/dev/mem"));
    TRY("open a terminal", open("/dev/tty", O_RDWR | O_CLOEXEC));
    TRY("open the kernel's log", reads("/dev/kmsg"));
    TRY("make a fuse", open("/dev/fuse", O_RDWR | O_CLOEXEC));
    TRY("open a tunnel", open("/dev/net/tun", O_RDWR | O_CLOEXEC));
}

static void try_processes(void)
{
    char byte;
    struct iovec here = {&byte, 1}, there = {&byte, 1};
    struct rlimit limit = {8, 8};
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(0, &cpus);
    TRY("environment of another", reads(of_process("environ")));
    TRY("memory of another", reads(of_process("mem")));
    TRY("descriptors of another", readlink(of_process("fd/0"), &byte, 1));
    TRY("files of another", reads(of_process("root/etc/passwd")));
    TRY("write a sysctl", open("/proc/sys/kernel/core_pattern", O_WRONLY | O_CLOEXEC));
    TRY("sysrq", open("/proc/sysrq-trigger", O_WRONLY | O_CLOEXEC));
    TRY("trace another", ptrace(PTRACE_ATTACH, outside, NULL, NULL));
    TRY("read memory of another", process_vm_readv(outside, &here, 1, &there, 1, 0));
    TRY("write memory of another", process_vm_writev(outside, &here, 1, &there, 1, 0));
    TRY("descriptor of a process", syscall(SYS_pidfd_open, outside, 0));
    TRY("compare processes", syscall(SYS_kcmp, outside, outside, 0, 0, 0));
    TRY("signal another", kill(outside, 0));
    TRY("signal all", kill(-1, 0));
    TRY("signal a thread", syscall(SYS_tgkill, outside, outside, 0));
    TRY("limit another", prlimit(outside, RLIMIT_NOFILE, &limit, NULL));
    TRY("slow another", setpriority(PRIO_PROCESS, (id_t)outside, 19));
    TRY("bind another to a core", sched_setaffinity(outside, sizeof cpus, &cpus));
    // A slice of 0.1 ms, which the broker has; struct sched_attr, version 0.
    TRY("run before others", syscall(SYS_sched_setattr, 0, &(uint64_t[6]){48, 0, 0, 100000}, 0));
    TRY("a process", syscall(SYS_clone, SIGCHLD, NULL, NULL, NULL, NULL));
    TRY("a process by vfork", syscall(SYS_vfork));
    TRY("a process by clone3", syscall(SYS_clone3, &(uint64_t[11]){0}, sizeof(uint64_t[11])));
    char *arguments[] = {(char *)"true", NULL};
    TRY("a program", execve("/usr/bin/true", arguments, arguments + 1));
    int memory = memfd_create("program", MFD_CLOEXEC);
    TRY("a program from memory",
        syscall(SYS_execveat, memory, "", arguments, arguments + 1, 0x1000));
}

static void try_sockets(void)
{
    static const struct {
        const char *name;
        int family, type;
    } kinds[] = {{"internet", AF_INET, SOCK_STREAM}, {"internet 6", AF_INET6, SOCK_DGRAM},
        {"unix", AF_UNIX, SOCK_STREAM}, {"netlink", AF_NETLINK, SOCK_RAW},
        {"packet", AF_PACKET, SOCK_RAW}, {"vsock", 40, SOCK_STREAM}, {"crypto", 38, 5}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        char name[64];
        snprintf(name, sizeof name, "a socket: %s", kinds[i].name);
        TRY(name, socket(kinds[i].family, kinds[i].type, 0));
    }
}

static void try_namespaces(void)
{
    TRY("a namespace of users", unshare(CLONE_NEWUSER));
    TRY("a namespace of mounts", unshare(CLONE_NEWNS));
    TRY("a namespace of networks", unshare(CLONE_NEWNET));
    TRY("clone into namespaces",
        syscall(SYS_clone, CLONE_NEWUSER | CLONE_NEWNS | SIGCHLD, NULL, NULL, NULL, NULL));
    TRY("enter a namespace", setns(0, 0));
    TRY("mount", mount("tmpfs", cache, "tmpfs", 0, NULL));
    TRY("unmount", umount2("/proc", MNT_DETACH));
    TRY("mount by descriptor", syscall(SYS_fsopen, "tmpfs", 0));
    TRY("clone a tree", syscall(SYS_open_tree, AT_FDCWD, "/", 1));
    TRY("attributes of a mount", syscall(SYS_mount_setattr, AT_FDCWD, "/", 0, NULL, 0));
    TRY("another root", chroot(cache));
    TRY("turn the root", syscall(SYS_pivot_root, cache, cache));
}

static void try_kernel(void)
{
    struct perf_event_attr counter = {.type = PERF_TYPE_SOFTWARE, .size = sizeof counter};
    unsigned char ring[256] = {0}, nothing[128] = {0};
    TRY("io_uring", syscall(SYS_io_uring_setup, 4, ring));
    TRY("userfaultfd", syscall(SYS_userfaultfd, O_CLOEXEC));
    TRY("bpf", syscall(SYS_bpf, 0, nothing, sizeof nothing));
    TRY("perf", syscall(SYS_perf_event_open, &counter, 0, -1, -1, 0));
    TRY("a keyring", syscall(SYS_keyctl, KEYCTL_GET_KEYRING_ID, KEY_SPEC_SESSION_KEYRING, 1));
    TRY("a key", syscall(SYS_add_key, "user", "planted", "x", 1, KEY_SPEC_PROCESS_KEYRING));
    TRY("ask for a key", syscall(SYS_request_key, "user", "planted", NULL, 0));
    TRY("a module", syscall(SYS_init_module, nothing, sizeof nothing, ""));
    TRY("a kernel", syscall(SYS_kexec_load, 0, 0, NULL, 0));
    TRY("reboot", syscall(SYS_reboot, 0, 0, 0, NULL));
    TRY("watch all files", syscall(SYS_fanotify_init, 0, O_RDONLY));
    TRY("the kernel's messages", syscall(SYS_syslog, 3, nothing, sizeof nothing));
    TRY("set the clock", clock_settime(CLOCK_REALTIME, &(struct timespec){0}));
    TRY("adjust the clock", adjtimex(&(struct timex){0}));
    TRY("name the host", sethostname("planted", 7));
    TRY("accounting", acct(NULL));
    TRY("swap", syscall(SYS_swapoff, "/nowhere"));
    TRY("personality", syscall(SYS_personality, 0x0040000));
    TRY("memory by key", shmget(0x4865, 4096, IPC_CREAT | 0600));
    TRY("shared memory by name", shm_open("/planted", O_RDWR | O_CREAT, 0600));
    TRY("a queue by name", mq_open("/planted", O_RDWR | O_CREAT, 0600, NULL));
#ifdef SYS_modify_ldt
    TRY("segments", syscall(SYS_modify_ldt, 0, nothing, sizeof nothing));
#endif
    TRY("type into the terminal", ioctl(STDERR_FILENO, TIOCSTI, "x"));
}

static long maps(int protection)
{
    return mmap(NULL, 4096, protection, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED ? -1 : 0;
}

static void try_rights(void)
{
    TRY("become root", setuid(0));
    TRY("become another user", setresuid(1, 1, 1));
    TRY("another group", syscall(SYS_setgid, 1));
    TRY("other groups", syscall(SYS_setgroups, 0, NULL));
    struct {
        uint32_t version;
        int pid;
    } header = {0x20080522, 0};
    struct {
        uint32_t effective, permitted, inheritable;
    } all[2] = {{~0u, ~0u, 0}, {~0u, ~0u, 0}}, held[2] = {{0}};
    TRY("all capabilities", syscall(SYS_capset, &header, all));
    errno = 0;
    report("a capability that is left",
        syscall(SYS_capget, &header, held) != 0 || held[0].permitted || held[1].permitted);
    TRY("a capability within reach", prctl(PR_CAPBSET_READ, 21, 0, 0, 0) - 1);
    TRY("new privileges", 0 - (prctl(PR_GET_NO_NEW_PRIVS, 0, 0, 0, 0) == 1));
    TRY("code that can be written", maps(PROT_READ | PROT_WRITE | PROT_EXEC));
    void *code = mmap(NULL, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    TRY("write to code", mprotect(code, 4096, PROT_READ | PROT_WRITE | PROT_EXEC));
}

int main(int argc, char **argv)
{
    struct worker_options o = {.sandbox = HG_SANDBOX_REQUIRE};
    struct hg_error err = {0};
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--compile-shaders") == 0)
            return 0;
        if (i + 1 < argc && strcmp(argv[i], "--cache-dir") == 0)
            o.cache_dir = cache = argv[i + 1];
        if (i + 1 < argc && strcmp(argv[i], "--upload-dir") == 0)
            o.upload_dir = uploads = argv[i + 1];
        if (i + 1 < argc && strcmp(argv[i], "--sandbox") == 0 &&
            !hg_sandbox_parse(argv[i + 1], &o.sandbox))
            return 2;
    }
    folder = getenv("HELIO_ESCAPE_FOLDER");
    const char *pid = getenv("HELIO_ESCAPE_PID");
    if (!folder || !pid || !cache || !uploads)
        return 2;
    outside = (pid_t)atoi(pid);
    if (hg_sandbox_enter(&o, &err)) {
        fprintf(stderr, "escapes: not confined: %s\n", err.reason);
        return 3;
    }
    try_files();
    try_processes();
    try_sockets();
    try_namespaces();
    try_kernel();
    try_rights();
    fprintf(stderr, "escapes: %d tried, %d possible\n", tried, possible);
    return 0;
}
