// sandbox.c - what a worker can no longer do once it may meet hostile files: gain privileges, start
// programs, open sockets, read outside its folders, write outside its cache, take all the memory.
#include "server/worker/sandbox.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/landlock.h>
#include <sched.h>
#include <seccomp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/log.h"
#include "renderer/image/image.h"

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
        "/dev/nvidia0", "/dev/nvidiactl", "/dev/nvidia-modeset", "/dev/nvidia-uvm",
        "/dev/nvidia-uvm-tools", "/dev/kfd"};
    for (size_t i = 0; i < sizeof libraries / sizeof *libraries; i++)
        allow(ruleset, libraries[i], library_access);
    for (size_t i = 0; i < sizeof readable / sizeof *readable; i++)
        allow(ruleset, readable[i], read_access);
    for (size_t i = 0; i < sizeof devices / sizeof *devices; i++)
        allow(ruleset, devices[i], device_access);
    allow(ruleset, hg_image_module_path(), library_access);
    for (uint32_t i = 0; i < o->asset_root_count; i++)
        allow(ruleset, o->asset_roots[i], read_access);
    if (o->upload_dir)
        allow(ruleset, o->upload_dir, read_access);
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

// All that workers, Vulkan drivers and the C library need; what is not there is refused with EPERM
// rather than killed, because drivers probe, and a refused probe is a fallback. Names that an
// architecture lacks are skipped. Paths are Landlock's, so calls that take one may be here.
static const int allowed_calls[] = {
#define HG_CALL(name) SCMP_SYS(name),
#include "server/calls.def"
};

static bool allow_call(scmp_filter_ctx filter, int call)
{
    return call < 0 || seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 0) == 0;
}

// What could be done to a terminal whose descriptor the worker has: stderr. A filter of its own, as
// a call that is allowed whatever its arguments are cannot be refused for some of them.
static bool refuse_terminals(void)
{
    static const int commands[] = {TIOCSTI, TIOCLINUX, TIOCSCTTY, TIOCSETD};
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
    bool ok = filter != NULL;
    for (size_t i = 0; ok && i < sizeof commands / sizeof *commands; i++) {
        const struct scmp_arg_cmp is_it = {.arg = 1,
            .op = SCMP_CMP_MASKED_EQ,
            .datum_a = UINT32_MAX,
            .datum_b = (scmp_datum_t)commands[i]};
        ok = seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(ioctl), 1, is_it) == 0;
    }
    ok = ok && seccomp_load(filter) == 0;
    if (filter)
        seccomp_release(filter);
    return ok;
}

// Threads, no processes and no namespaces; signals and limits of this process only; memory is never
// writable and executable at once (compilers of drivers write first, and make it executable then).
static bool allow_some(scmp_filter_ctx filter)
{
    const int own[] = {SCMP_SYS(kill), SCMP_SYS(tgkill), SCMP_SYS(rt_sigqueueinfo),
        SCMP_SYS(rt_tgsigqueueinfo), SCMP_SYS(prlimit64)};
    const int mappings[] = {SCMP_SYS(mmap), SCMP_SYS(mprotect)};
    const struct scmp_arg_cmp is_zero = {.arg = 0, .op = SCMP_CMP_EQ, .datum_a = 0};
    const struct scmp_arg_cmp is_own = {
        .arg = 0, .op = SCMP_CMP_EQ, .datum_a = (scmp_datum_t)getpid()};
    const struct scmp_arg_cmp who_is_caller = {.arg = 1, .op = SCMP_CMP_EQ, .datum_a = 0};
    const scmp_datum_t both = PROT_WRITE | PROT_EXEC;
    const scmp_datum_t protections[] = {0, PROT_WRITE, PROT_EXEC};
    bool ok = true;
    for (size_t i = 0; i < sizeof own / sizeof *own; i++)
        ok &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, own[i], 1, is_own) == 0;
    const int of_caller[] = {SCMP_SYS(prlimit64), SCMP_SYS(sched_setaffinity),
        SCMP_SYS(sched_setparam), SCMP_SYS(sched_setscheduler)};
    for (size_t i = 0; i < sizeof of_caller / sizeof *of_caller; i++)
        ok &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, of_caller[i], 1, is_zero) == 0;
    ok &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(setpriority), 1, who_is_caller) == 0;
    for (size_t i = 0; i < sizeof mappings / sizeof *mappings; i++)
        for (size_t k = 0; k < sizeof protections / sizeof *protections; k++)
            ok &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, mappings[i], 1,
                      SCMP_A2(SCMP_CMP_MASKED_EQ, both, protections[k])) == 0;
    ok &= seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(clone), 1,
              SCMP_A0(SCMP_CMP_MASKED_EQ, CLONE_THREAD, CLONE_THREAD)) == 0;
    // Its flags lie in memory, where a filter cannot look; without it the C library takes clone.
    ok &= seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3), 0) == 0;
    return ok;
}

static bool enter_seccomp(void)
{
    scmp_filter_ctx filter = refuse_terminals() ? seccomp_init(SCMP_ACT_ERRNO(EPERM)) : NULL;
    if (!filter)
        return false;
    bool ok = allow_some(filter);
    for (size_t i = 0; i < sizeof allowed_calls / sizeof *allowed_calls; i++)
        ok &= allow_call(filter, allowed_calls[i]);
    ok = ok && seccomp_load(filter) == 0;
    seccomp_release(filter);
    return ok;
}

// ---- self-test ----------------------------------------------------------------------------------

static bool opens(const char *path)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd >= 0)
        close(fd);
    return fd >= 0;
}

static bool makes_socket(void)
{
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd >= 0)
        close(fd);
    return fd >= 0;
}

static bool limits_parent(void)
{
    struct rlimit limit;
    return getppid() && prlimit(getppid(), RLIMIT_NOFILE, NULL, &limit) == 0; // 0: it sees none
}

static bool maps_code(void)
{
    void *page =
        mmap(NULL, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (page != MAP_FAILED)
        munmap(page, 4096);
    return page != MAP_FAILED;
}

// What is possible and must not be; NULL: nothing of what was tried.
static const char *find_escape(void)
{
    if (opens("/etc/passwd") || opens("/root"))
        return "files outside its folders can be read";
    if (makes_socket())
        return "sockets can be made";
    if (limits_parent())
        return "limits of other processes can be read";
    if (maps_code())
        return "memory can be writable and executable";
    if (unshare(CLONE_NEWUSER) == 0)
        return "namespaces can be made";
    return NULL;
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
    if (o->sandbox == HG_SANDBOX_OFF) {
        hg_warn(WORKER, "sandbox switched off");
        return HG_OK;
    }
    long landlock = enter_landlock(o);
    bool seccomp = enter_seccomp();
    const char *escape = landlock && seccomp ? find_escape() : NULL;
    const char *lack = !landlock  ? "this kernel has no Landlock"
                       : !seccomp ? "this kernel has no seccomp filters"
                                  : escape;
    if (lack && o->sandbox == HG_SANDBOX_REQUIRE)
        return hg_error_set(
            err, HG_E_UNSUPPORTED, "sandbox", NULL, "%s; --sandbox best-effort goes without", lack);
    if (lack)
        hg_warn(WORKER, "sandbox: %s", lack);
    hg_info(WORKER, "sandbox: landlock %s%s, seccomp %s", landlock ? "on" : "off",
        landlock >= SCOPE_ABI ? " with scoped signals" : "", seccomp ? "on" : "off");
    return HG_OK;
}

bool hg_sandbox_parse(const char *text, enum hg_sandbox_mode *out)
{
    static const char *const names[] = {[HG_SANDBOX_BEST_EFFORT] = "best-effort",
        [HG_SANDBOX_REQUIRE] = "require",
        [HG_SANDBOX_OFF] = "off"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(text, names[i]) == 0) {
            *out = (enum hg_sandbox_mode)i;
            return true;
        }
    return false;
}
