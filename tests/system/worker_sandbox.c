// worker_sandbox.c - what a process can still do after hg_sandbox_enter: each attempt in a child of
// its own. What the running kernel cannot restrict is expected to be possible.
#include <errno.h>
#include <fcntl.h>
#include <linux/landlock.h>
#include <pthread.h>
#include <sched.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "server/worker/sandbox.h"
#include "server/worker/shader_seed.h"
#include "tests/support/folder.h"

// The sanitizers' own memory passes any limit.
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
#define MEMORY_LIMIT 0
#else
#define MEMORY_LIMIT 268435456u
#endif

static char folder[TEST_FOLDER_MAX], cache[80], shader_cache[80], root[80], secret[80], asset[80],
    uploads[80];

static long landlock_abi(void)
{
    long abi = syscall(SYS_landlock_create_ruleset, NULL, 0, LANDLOCK_CREATE_RULESET_VERSION);
    return abi < 0 ? 0 : abi;
}

static int make_files(void **state)
{
    (void)state;
    assert_true(test_folder_make(folder, "sandbox"));
    snprintf(cache, sizeof cache, "%s/cache", folder);
    snprintf(shader_cache, sizeof shader_cache, "%s/compiled", folder);
    snprintf(root, sizeof root, "%s/root", folder);
    snprintf(secret, sizeof secret, "%s/secret", folder);
    snprintf(asset, sizeof asset, "%s/root/asset", folder);
    assert_int_equal(mkdir(cache, 0700), 0);
    assert_int_equal(mkdir(shader_cache, 0700), 0);
    assert_int_equal(mkdir(root, 0700), 0);
    snprintf(uploads, sizeof uploads, "%s/uploads", folder);
    assert_int_equal(mkdir(uploads, 0700), 0);
    test_text_write(uploads, "content", "text");
    test_file_write(secret, "text", 4);
    test_file_write(asset, "text", 4);
    return 0;
}

static int remove_files(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

// errno of `attempt` inside the sandbox, 0 = it was possible.
static int inside(int (*attempt)(void))
{
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        char *roots[] = {root};
        const struct worker_options options = {.asset_roots = roots,
            .asset_root_count = 1,
            .cache_dir = cache,
            .upload_dir = uploads,
            .memory_limit_bytes = MEMORY_LIMIT};
        struct hg_error err = {0};
        if (hg_sandbox_enter(&options, &err))
            _exit(255);
        errno = 0;
        _exit(attempt() < 0 ? errno : 0);
    }
    int status = 0;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) != 255);
    return WEXITSTATUS(status);
}

// Where the kernel lacks something a worker that must be confined does not start.
static void test_require(void **state)
{
    (void)state;
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        const struct worker_options options = {.sandbox = HG_SANDBOX_REQUIRE, .cache_dir = cache};
        struct hg_error err = {0};
        enum hg_status status = hg_sandbox_enter(&options, &err);
        bool says = err.reason[0] != 0;
        _exit(status == HG_OK ? 0 : status == HG_E_UNSUPPORTED && says ? 1 : 255);
    }
    int status = 0;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), landlock_abi() ? 0 : 1);
}

static int open_read(const char *path)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    char c;
    return fd < 0 ? -1 : (int)read(fd, &c, 1);
}

static int read_asset(void)
{
    return open_read(asset);
}

static int read_secret(void)
{
    return open_read(secret);
}

static int write_asset(void)
{
    return open(asset, O_WRONLY | O_CLOEXEC);
}

static int read_upload(void)
{
    char path[96];
    snprintf(path, sizeof path, "%s/content", uploads);
    return open_read(path);
}

static int write_entry(const char *where)
{
    char path[96];
    snprintf(path, sizeof path, "%s/entry", where);
    int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    return fd < 0 ? -1 : (int)write(fd, "x", 1);
}

static int write_cache(void)
{
    return write_entry(cache);
}

static int write_shader_cache(void)
{
    return write_entry(shader_cache);
}

// As the daemon does when a worker gets a tenant: another folder in place of an empty one.
static int read_moved_upload(void)
{
    char path[112];
    snprintf(path, sizeof path, "%s/uploads/moved", uploads);
    for (int i = 0; i < 1000 && access(path, F_OK) != 0; i++)
        nanosleep(&(struct timespec){.tv_nsec = 10000000}, NULL);
    return open_read(path);
}

static int write_uploads(void)
{
    return write_entry(uploads);
}

// As Mesa does with the index of its shader cache.
static int size_cache(void)
{
    char path[96];
    snprintf(path, sizeof path, "%s/index", cache);
    int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    return fd < 0 ? -1 : ftruncate(fd, 4096);
}

static int signal_parent(void)
{
    return kill(getppid(), 0);
}

static int signal_oneself(void)
{
    return kill(getpid(), 0);
}

static int make_socket(void)
{
    return socket(AF_UNIX, SOCK_STREAM, 0);
}

static int start_program(void)
{
    char *arguments[] = {"true", NULL}, *none[] = {NULL};
    return execve("/bin/true", arguments, none);
}

static int take_memory(void)
{
    return mmap(NULL, 512u << 20, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) ==
                   MAP_FAILED
               ? -1
               : 0;
}

static int limit_parent(void)
{
    struct rlimit limit;
    return prlimit(getppid(), RLIMIT_NOFILE, NULL, &limit);
}

static int limit_oneself(void)
{
    struct rlimit limit;
    return prlimit(0, RLIMIT_NOFILE, NULL, &limit);
}

static int make_namespace(void)
{
    return unshare(CLONE_NEWUSER);
}

static int clone_namespace(void)
{
    return (int)syscall(SYS_clone, CLONE_NEWUSER | SIGCHLD, NULL, NULL, NULL, NULL);
}

static int make_process(void)
{
    return (int)syscall(SYS_clone, SIGCHLD, NULL, NULL, NULL, NULL);
}

static int clone_by_memory(void)
{
    return (int)syscall(SYS_clone3, NULL, 0);
}

static void *nothing(void *argument)
{
    return argument;
}

static int make_thread(void)
{
    pthread_t thread;
    return pthread_create(&thread, NULL, nothing, NULL) || pthread_join(thread, NULL) ? -1 : 0;
}

static int open_mount(void)
{
    return (int)syscall(SYS_fsopen, "tmpfs", 0);
}

static int map(int protection)
{
    void *page = mmap(NULL, 4096, protection, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return page == MAP_FAILED ? -1 : 0;
}

static int map_code(void)
{
    return map(PROT_READ | PROT_WRITE | PROT_EXEC);
}

// As compilers of drivers do.
static int write_then_run(void)
{
    void *page = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return page == MAP_FAILED ? -1 : mprotect(page, 4096, PROT_READ | PROT_EXEC);
}

static int make_code_writable(void)
{
    void *page = mmap(NULL, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return page == MAP_FAILED ? -1 : mprotect(page, 4096, PROT_READ | PROT_WRITE | PROT_EXEC);
}

static int trace_parent(void)
{
    return (int)syscall(SYS_ptrace, 16 /* PTRACE_ATTACH */, getppid(), NULL, NULL);
}

static int open_process(void)
{
    return (int)syscall(SYS_pidfd_open, getppid(), 0);
}

static void test_processes(void **state)
{
    (void)state;
    static int (*const refused[])(void) = {limit_parent, make_namespace, clone_namespace,
        make_process, open_mount, map_code, make_code_writable, trace_parent, open_process};
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++) {
        int error = inside(refused[i]);
        if (error != EPERM)
            fail_msg("attempt %zu gave %d (%s)", i, error, strerror(error));
    }
    assert_int_equal(inside(clone_by_memory), ENOSYS);
    assert_int_equal(inside(limit_oneself), 0);
    assert_int_equal(inside(make_thread), 0);
    assert_int_equal(inside(write_then_run), 0);
}

static void test_files(void **state)
{
    (void)state;
    int denied = landlock_abi() ? EACCES : 0;
    assert_int_equal(inside(read_asset), 0);
    assert_int_equal(inside(write_cache), 0);
    assert_int_equal(inside(size_cache), 0);
    assert_int_equal(inside(read_secret), denied);
    assert_int_equal(inside(read_upload), 0);
    assert_int_equal(inside(write_uploads), denied);
    assert_int_equal(inside(write_asset), denied);
}

// A folder for compiled shaders which the environment names lies outside of the cache folder.
static void test_shader_cache(void **state)
{
    (void)state;
    assert_int_equal(unsetenv("MESA_SHADER_CACHE_DIR"), 0);
    assert_int_equal(inside(write_shader_cache), landlock_abi() ? EACCES : 0);
    assert_int_equal(setenv("MESA_SHADER_CACHE_DIR", shader_cache, 1), 0);
    assert_int_equal(inside(write_shader_cache), 0);
}

static bool is_text(const char *where, const char *name, const char *text)
{
    char path[128], found[16] = "";
    snprintf(path, sizeof path, "%s/shaders/%s", where, name);
    FILE *file = fopen(path, "r");
    if (!file)
        return false;
    const size_t size = fread(found, 1, sizeof found - 1, file);
    fclose(file);
    return size == strlen(text) && memcmp(found, text, size) == 0;
}

static void *move_uploads(void *result)
{
    char from[112], to[112];
    snprintf(from, sizeof from, "%s/incoming", folder);
    snprintf(to, sizeof to, "%s/uploads", uploads);
    nanosleep(&(struct timespec){.tv_nsec = 200000000}, NULL);
    return rename(from, to) == 0 ? result : NULL;
}

static void test_moved_uploads(void **state)
{
    pthread_t thread;
    void *moved = NULL;
    char path[112];
    (void)state;
    snprintf(path, sizeof path, "%s/uploads", uploads);
    assert_int_equal(mkdir(path, 0700), 0);
    snprintf(path, sizeof path, "%s/incoming", folder);
    assert_int_equal(mkdir(path, 0700), 0);
    test_text_write(path, "moved", "text");
    assert_int_equal(pthread_create(&thread, NULL, move_uploads, &moved), 0);
    assert_int_equal(inside(read_moved_upload), 0);
    assert_int_equal(pthread_join(thread, &moved), 0);
    assert_non_null(moved);
}

// What the worker has stays; links are not followed; each copy is a file of its own.
static void test_shader_seed(void **state)
{
    (void)state;
    char seed[80], path[160];
    snprintf(seed, sizeof seed, "%s/seed", folder);
    snprintf(path, sizeof path, "%s/deep", seed);
    assert_int_equal(mkdir(seed, 0700), 0);
    assert_int_equal(mkdir(path, 0700), 0);
    test_text_write(seed, "a", "first");
    test_text_write(seed, "b", "second");
    test_text_write(seed, "deep/c", "third");
    snprintf(path, sizeof path, "%s/deep/d", seed);
    assert_int_equal(symlink(secret, path), 0);
    snprintf(path, sizeof path, "%s/shaders", cache);
    assert_true(mkdir(path, 0700) == 0 || errno == EEXIST);
    test_text_write(path, "b", "mine");
    hg_shader_seed_copy(seed, cache);
    assert_true(is_text(cache, "a", "first"));
    assert_true(is_text(cache, "b", "mine"));
    assert_true(is_text(cache, "deep/c", "third"));
    snprintf(path, sizeof path, "%s/shaders/deep/d", cache);
    assert_int_equal(access(path, F_OK), -1);
    snprintf(path, sizeof path, "%s/shaders", cache);
    test_text_write(path, "a", "changed");
    hg_shader_seed_copy(seed, folder);
    assert_true(is_text(folder, "a", "first"));
    hg_shader_seed_copy("/nowhere", cache); // nothing to begin with is no error
}

static void test_signals(void **state)
{
    (void)state;
    assert_int_equal(inside(signal_oneself), 0);
    assert_int_equal(inside(signal_parent), EPERM);
}

static void test_programs_sockets_and_memory(void **state)
{
    (void)state;
    assert_int_equal(inside(make_socket), EPERM);
    assert_int_equal(inside(start_program), EPERM);
    assert_int_equal(inside(take_memory), MEMORY_LIMIT ? ENOMEM : 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_files),
        cmocka_unit_test(test_shader_cache), cmocka_unit_test(test_shader_seed),
        cmocka_unit_test(test_moved_uploads), cmocka_unit_test(test_signals),
        cmocka_unit_test(test_processes), cmocka_unit_test(test_require),
        cmocka_unit_test(test_programs_sockets_and_memory)};
    return cmocka_run_group_tests_name("worker_sandbox", tests, make_files, remove_files);
}
