// sandbox.c - what a worker can no longer do once it may meet hostile files: gain privileges, start
// programs, open sockets, read outside its folders, write outside its cache, take all the memory.
#include "server/worker/sandbox.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/landlock.h>
#include <seccomp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/log.h"

// ---- Landlock -----------------------------------------------------------------------------------

// Rights of later kernels than the headers at hand may know
// (Documentation/userspace-api/landlock.rst). The thirteen lowest bits are those of the first ABI.
enum { HANDLED_ABI1 = (1 << 13) - 1, ACCESS_TRUNCATE = 1 << 14, TRUNCATE_ABI = 3 };
enum { NET_BIND_TCP = 1 << 0, NET_CONNECT_TCP = 1 << 1, NET_ABI = 4 };
enum { SCOPE_ABSTRACT_UNIX_SOCKET = 1 << 0, SCOPE_SIGNAL = 1 << 1, SCOPE_ABI = 6 };

// struct landlock_ruleset_attr of ABI 6; a kernel that knows less takes it while the rest is 0.
struct ruleset_attr {
    uint64_t handled_access_fs, handled_access_net, scoped;
};

static const uint64_t read_access = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR;
static const uint64_t library_access =
    LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR | LANDLOCK_ACCESS_FS_EXECUTE;
static const uint64_t cache_access =
    LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR | LANDLOCK_ACCESS_FS_WRITE_FILE |
    LANDLOCK_ACCESS_FS_REMOVE_FILE | LANDLOCK_ACCESS_FS_REMOVE_DIR | LANDLOCK_ACCESS_FS_MAKE_REG |
    LANDLOCK_ACCESS_FS_MAKE_DIR | ACCESS_TRUNCATE; // the last for Mesa's index of shaders
static const uint64_t device_access = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_WRITE_FILE |
                                      LANDLOCK_ACCESS_FS_READ_DIR | ACCESS_TRUNCATE;

struct ruleset {
    int fd;
    uint64_t handled; // rights that this kernel restricts
};

static void allow(const struct ruleset *ruleset, const char *path, uint64_t access)
{
    struct landlock_path_beneath_attr rule = {.allowed_access = access & ruleset->handled};
    rule.parent_fd = open(path, O_PATH | O_CLOEXEC);
    if (rule.parent_fd < 0)
        return; // what does not exist needs no permission
    struct stat st;
    if (fstat(rule.parent_fd, &st) == 0 && !S_ISDIR(st.st_mode))
        rule.allowed_access &= LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_WRITE_FILE |
                               LANDLOCK_ACCESS_FS_EXECUTE | ACCESS_TRUNCATE;
    if (syscall(SYS_landlock_add_rule, ruleset->fd, LANDLOCK_RULE_PATH_BENEATH, &rule, 0) != 0)
        hg_warn(WORKER, "landlock: %s: %s", path, strerror(errno));
    close(rule.parent_fd);
}

static void allow_folders(const struct ruleset *ruleset, const struct worker_options *o)
{
    static const char *const libraries[] = {"/usr", "/lib", "/lib64", "/opt"};
    // Of /etc only what the loader and drivers read: tokens and keys of others may lie there.
    static const char *const readable[] = {"/proc", "/sys", "/run/nvidia-persistenced",
        "/etc/ld.so.cache", "/etc/alternatives", "/etc/vulkan", "/etc/glvnd", "/etc/xdg",
        "/etc/drirc", "/etc/nvidia", "/etc/localtime"};
    static const char *const devices[] = {"/dev/dri", "/dev/null", "/dev/zero", "/dev/urandom",
        "/dev/shm", "/dev/nvidia0", "/dev/nvidiactl", "/dev/nvidia-modeset", "/dev/nvidia-uvm",
        "/dev/nvidia-uvm-tools", "/dev/kfd"};
    for (size_t i = 0; i < sizeof libraries / sizeof *libraries; i++)
        allow(ruleset, libraries[i], library_access);
    for (size_t i = 0; i < sizeof readable / sizeof *readable; i++)
        allow(ruleset, readable[i], read_access);
    for (size_t i = 0; i < sizeof devices / sizeof *devices; i++)
        allow(ruleset, devices[i], device_access);
    for (uint32_t i = 0; i < o->asset_root_count; i++)
        allow(ruleset, o->asset_roots[i], read_access);
    if (o->shader_dir)
        allow(ruleset, o->shader_dir, read_access);
    if (o->cache_dir)
        allow(ruleset, o->cache_dir, cache_access);
    // Below the cache folder unless the environment names another one
    // (hg_renderer_prepare_process).
    const char *shader_cache = getenv("MESA_SHADER_CACHE_DIR");
    if (shader_cache)
        allow(ruleset, shader_cache, cache_access);
}

// Returns the kernel's Landlock ABI, 0 where there is none.
static long enter_landlock(const struct worker_options *o)
{
    long abi = syscall(SYS_landlock_create_ruleset, NULL, 0, LANDLOCK_CREATE_RULESET_VERSION);
    struct ruleset ruleset = {.handled = HANDLED_ABI1};
    if (abi >= TRUNCATE_ABI)
        ruleset.handled |= ACCESS_TRUNCATE;
    struct ruleset_attr attr = {.handled_access_fs = ruleset.handled};
    if (abi >= NET_ABI)
        attr.handled_access_net = NET_BIND_TCP | NET_CONNECT_TCP;
    if (abi >= SCOPE_ABI) // no signals to, and no abstract sockets of, processes outside
        attr.scoped = SCOPE_ABSTRACT_UNIX_SOCKET | SCOPE_SIGNAL;
    ruleset.fd = (int)syscall(SYS_landlock_create_ruleset, &attr, sizeof attr, 0);
    if (ruleset.fd < 0)
        return 0;
    allow_folders(&ruleset, o);
    bool entered = syscall(SYS_landlock_restrict_self, ruleset.fd, 0) == 0;
    close(ruleset.fd);
    return entered ? abi : 0;
}

// ---- seccomp ------------------------------------------------------------------------------------

// Refused with EPERM rather than killed: drivers probe, and a refused probe is a fallback.
static const int refused_calls[] = {
    SCMP_SYS(execve),
    SCMP_SYS(execveat),
    SCMP_SYS(fork),
    SCMP_SYS(vfork),
    SCMP_SYS(socket),
    SCMP_SYS(connect),
    SCMP_SYS(bind),
    SCMP_SYS(listen),
    SCMP_SYS(accept),
    SCMP_SYS(accept4),
    SCMP_SYS(ptrace),
    SCMP_SYS(process_vm_readv),
    SCMP_SYS(process_vm_writev),
    SCMP_SYS(mount),
    SCMP_SYS(umount2),
    SCMP_SYS(pivot_root),
    SCMP_SYS(chroot),
    SCMP_SYS(unshare),
    SCMP_SYS(setns),
    SCMP_SYS(bpf),
    SCMP_SYS(perf_event_open),
    SCMP_SYS(keyctl),
    SCMP_SYS(add_key),
    SCMP_SYS(request_key),
    SCMP_SYS(kexec_load),
    SCMP_SYS(init_module),
    SCMP_SYS(finit_module),
    SCMP_SYS(delete_module),
    SCMP_SYS(reboot),
    SCMP_SYS(swapon),
    SCMP_SYS(swapoff),
    SCMP_SYS(open_by_handle_at),
    SCMP_SYS(userfaultfd),
    SCMP_SYS(io_uring_setup),
    SCMP_SYS(personality),
    SCMP_SYS(setuid),
    SCMP_SYS(setgid),
    SCMP_SYS(setreuid),
    SCMP_SYS(setregid),
    SCMP_SYS(setresuid),
    SCMP_SYS(setresgid),
    SCMP_SYS(chown),
    SCMP_SYS(fchown),
    SCMP_SYS(lchown),
    SCMP_SYS(fchownat),
    SCMP_SYS(mknod),
    SCMP_SYS(mknodat),
};

static bool enter_seccomp(void)
{
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
    if (!filter)
        return false;
    bool ok = true;
    for (size_t i = 0; i < sizeof refused_calls / sizeof *refused_calls; i++)
        ok &= seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), refused_calls[i], 0) == 0;
    ok = ok && seccomp_load(filter) == 0;
    seccomp_release(filter);
    return ok;
}

// ---- together -----------------------------------------------------------------------------------

enum hg_status hg_sandbox_enter(const struct worker_options *o, struct hg_error *err)
{
    if (o->memory_limit_bytes) {
        // Private writable memory; address space as such is free (drivers map a lot of it).
        struct rlimit limit = {o->memory_limit_bytes, o->memory_limit_bytes};
        if (setrlimit(RLIMIT_DATA, &limit) != 0)
            return hg_error_set(err, HG_E_INVAL, "--memory-limit", NULL, "%s", strerror(errno));
    }
    struct rlimit no_core = {0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0)
        return hg_error_set(
            err, HG_E_INTERNAL, "sandbox", NULL, "no_new_privs: %s", strerror(errno));
    if (o->no_sandbox) {
        hg_warn(WORKER, "sandbox switched off");
        return HG_OK;
    }
    long landlock = enter_landlock(o);
    bool seccomp = enter_seccomp();
    hg_info(WORKER, "sandbox: landlock %s%s, seccomp %s", landlock ? "on" : "not in this kernel",
        landlock >= SCOPE_ABI ? " with scoped signals" : "", seccomp ? "on" : "not in this kernel");
    return HG_OK;
}
