// file.h: reads with a limit, outputs that appear complete or not at all.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"
#include "tests/support/folder.h"

static char folder[TEST_FOLDER_MAX], target[80];

// What a file system cannot do, and where a process is killed.
static bool no_unnamed, no_links, killed_at_rename;

// In place of the library's, which goes through these calls as well.
int open(const char *path, int flags, ...)
{
    va_list list;
    va_start(list, flags);
    const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(list, mode_t) : 0;
    va_end(list);
    if (no_unnamed && (flags & O_TMPFILE) == O_TMPFILE) {
        errno = EOPNOTSUPP;
        return -1;
    }
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}

int linkat(int from_folder, const char *from, int to_folder, const char *to, int flags)
{
    if (no_links) {
        errno = EPERM;
        return -1;
    }
    return (int)syscall(SYS_linkat, from_folder, from, to_folder, to, flags);
}

int rename(const char *from, const char *to)
{
    if (killed_at_rename)
        raise(SIGKILL);
    return (int)syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0);
}

static int make_folder(void **state)
{
    (void)state;
    if (!test_folder_make(folder, "file"))
        return -1;
    snprintf(target, sizeof target, "%s/out", folder);
    return 0;
}

// Counts the files in the folder and removes them.
static int empty_folder(void)
{
    int count = 0;
    DIR *dir = opendir(folder);
    assert_non_null(dir);
    for (struct dirent *e; (e = readdir(dir));) {
        char path[400];
        if (strcmp(e->d_name, ".") == 0 || strcmp(e->d_name, "..") == 0)
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        assert_int_equal(remove(path), 0);
        count++;
    }
    closedir(dir);
    return count;
}

static int remove_folder(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

static void assert_content(const char *want)
{
    uint8_t *data;
    size_t size;
    assert_int_equal(hg_file_read(target, 1000, &data, &size, NULL), HG_OK);
    assert_int_equal(size, strlen(want));
    assert_string_equal((char *)data, want); // there is a zero byte behind
    hg_free(data);
}

static void test_commit_replaces(void **state)
{
    (void)state;
    struct hg_error err = {0};
    assert_int_equal(hg_file_write_atomic(target, "old", 3, &err), HG_OK);
    assert_content("old");
    struct hg_file_out out;
    assert_int_equal(hg_file_begin(&out, target, &err), HG_OK);
    assert_int_equal(hg_file_write(&out, "ne", 2, &err), HG_OK);
    assert_int_equal(hg_file_write(&out, "wer", 3, &err), HG_OK);
    assert_content("old"); // until the commit
    assert_int_equal(hg_file_commit(&out, &err), HG_OK);
    assert_content("newer");
    assert_int_equal(out.fd, -1);
    hg_file_abort(&out); // a finished object
    assert_content("newer");
    assert_int_equal(empty_folder(), 1);
}

static void test_abort_leaves_the_old_file(void **state)
{
    (void)state;
    struct hg_file_out out;
    assert_int_equal(hg_file_write_atomic(target, "old", 3, NULL), HG_OK);
    assert_int_equal(hg_file_begin(&out, target, NULL), HG_OK);
    assert_int_equal(hg_file_write(&out, "half", 4, NULL), HG_OK);
    hg_file_abort(&out);
    hg_file_abort(&out);
    assert_content("old");
    assert_int_equal(empty_folder(), 1); // no temporary is left
    struct hg_file_out zeroed = {0};
    hg_file_abort(&zeroed); // must not close descriptor 0
    assert_int_equal(zeroed.fd, -1);
}

// Files in the folder, without removing them.
static int count_files(void)
{
    int count = 0;
    DIR *dir = opendir(folder);
    assert_non_null(dir);
    for (struct dirent *e; (e = readdir(dir));)
        count += strcmp(e->d_name, ".") != 0 && strcmp(e->d_name, "..") != 0;
    closedir(dir);
    return count;
}

// A writer that is killed before its commit, or in it before the file takes the old one's place.
static void kill_a_writer(bool in_commit)
{
    int how;
    const pid_t child = fork();
    if (child == 0) {
        struct hg_file_out out;
        killed_at_rename = true;
        if (hg_file_begin(&out, target, NULL) == HG_OK &&
            hg_file_write(&out, "half", 4, NULL) == HG_OK && in_commit)
            (void)!hg_file_commit(&out, NULL);
        raise(SIGKILL);
    }
    assert_int_equal(waitpid(child, &how, 0), child);
    assert_true(WIFSIGNALED(how) && WTERMSIG(how) == SIGKILL);
}

static void test_killed_writers_leave_nothing(void **state)
{
    (void)state;
    kill_a_writer(false);
    assert_int_equal(count_files(), 0);
    assert_int_equal(hg_file_write_atomic(target, "old", 3, NULL), HG_OK);
    kill_a_writer(true); // it has a name for a moment
    assert_int_equal(count_files(), 2);
    assert_content("old");
    assert_int_equal(hg_file_write_atomic(target, "new", 3, NULL), HG_OK);
    assert_content("new");
    assert_int_equal(empty_folder(), 1);
}

// On file systems whose files have names at once the next writer of that name cleans up, and
// touches nothing else.
static void test_dead_writers_are_cleaned_up_after(void **state)
{
    (void)state;
    char other[100];
    struct hg_file_out alive;
    no_unnamed = true;
    kill_a_writer(false);
    kill_a_writer(true);
    assert_int_equal(count_files(), 1);
    assert_int_equal(hg_file_begin(&alive, target, NULL), HG_OK);
    assert_int_equal(hg_file_write(&alive, "alive", 5, NULL), HG_OK);
    snprintf(other, sizeof other, "%s/.out.2.0123456789ab", folder); // of "out.2"
    fclose(fopen(other, "w"));
    assert_int_equal(count_files(), 2);
    assert_int_equal(hg_file_write_atomic(target, "new", 3, NULL), HG_OK);
    assert_content("new");
    assert_int_equal(count_files(), 3);
    assert_int_equal(hg_file_commit(&alive, NULL), HG_OK);
    assert_content("alive");
    assert_int_equal(empty_folder(), 2);
    no_unnamed = false;
}

static void test_files_that_get_no_name(void **state)
{
    (void)state;
    char *data = malloc(200000), *back;
    size_t size;
    assert_non_null(data);
    memset(data, 'x', 200000);
    data[199999] = 'y';
    no_links = true;
    assert_int_equal(hg_file_write_atomic(target, "old", 3, NULL), HG_OK);
    assert_content("old");
    assert_int_equal(hg_file_write_atomic(target, data, 200000, NULL), HG_OK);
    no_links = false;
    assert_int_equal(hg_file_read(target, 200000, (uint8_t **)&back, &size, NULL), HG_OK);
    assert_int_equal(size, 200000);
    assert_memory_equal(data, back, 200000);
    assert_int_equal(empty_folder(), 1);
    hg_free(back);
    free(data);
}

static void test_mode_follows_the_umask(void **state)
{
    (void)state;
    struct stat st;
    mode_t old = umask(027);
    assert_int_equal(hg_file_write_atomic(target, "x", 1, NULL), HG_OK);
    assert_int_equal(umask(old), 027); // and the umask is as it was
    assert_int_equal(stat(target, &st), 0);
    assert_int_equal(st.st_mode & 0777, 0640);
    assert_int_equal(empty_folder(), 1);
}

static void test_bad_places(void **state)
{
    (void)state;
    struct hg_error err = {0};
    char path[200];
    snprintf(path, sizeof path, "%s/missing/out", folder);
    assert_int_equal(hg_file_write_atomic(path, "x", 1, &err), HG_E_NOTFOUND);
    assert_string_equal(err.what, path);
    assert_true(err.reason[0]);
    assert_int_equal(hg_file_write_atomic(target, "x", 1, NULL), HG_OK);
    snprintf(path, sizeof path, "%s/out/below", folder); // below a file
    assert_int_equal(hg_file_write_atomic(path, "x", 1, &err), HG_E_NOTFOUND);
    snprintf(path, sizeof path, "%s/", folder);
    assert_int_equal(hg_file_write_atomic(path, "x", 1, &err), HG_E_INVAL);
    assert_int_equal(hg_file_write_atomic("", "x", 1, &err), HG_E_INVAL);
    // A folder in the way: the rename fails, the temporary goes.
    snprintf(path, sizeof path, "%s/sub", folder);
    assert_int_equal(mkdir(path, 0755), 0);
    assert_int_not_equal(hg_file_write_atomic(path, "x", 1, &err), HG_OK);
    assert_int_equal(empty_folder(), 2);
}

static void test_unwritable_folder(void **state)
{
    (void)state;
    struct hg_error err = {0};
    uid_t user = geteuid();
    assert_int_equal(chmod(folder, 0555), 0);
    if (user == 0) // root may write everywhere, so be another user for a moment
        assert_int_equal(seteuid(65534), 0);
    enum hg_status status = hg_file_write_atomic(target, "x", 1, &err);
    if (user == 0)
        assert_int_equal(seteuid(0), 0);
    assert_int_equal(chmod(folder, 0755), 0);
    assert_int_equal(status, HG_E_PERM);
    assert_string_equal(err.what, target);
    assert_int_equal(empty_folder(), 0);
}

// A file that may not grow, like a full disk: what was there stays.
static void test_no_space(void **state)
{
    (void)state;
    struct rlimit old, small;
    struct hg_error err = {0};
    uint8_t *data = hg_calloc(1, 100000);
    assert_non_null(data);
    assert_int_equal(hg_file_write_atomic(target, "old", 3, NULL), HG_OK);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    small = (struct rlimit){4096, old.rlim_max};
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    enum hg_status status = hg_file_write_atomic(target, data, 100000, &err);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    signal(SIGXFSZ, SIG_DFL);
    assert_int_equal(status, HG_E_NOSPACE);
    assert_string_equal(err.what, target);
    assert_content("old");
    assert_int_equal(empty_folder(), 1);
    hg_free(data);
}

static void test_no_memory(void **state)
{
    (void)state;
    assert_int_equal(hg_file_write_atomic(target, "old", 3, NULL), HG_OK);
    for (uint64_t n = 1;; n++) {
        hg_alloc_fail_at(n);
        enum hg_status status = hg_file_write_atomic(target, "new", 3, NULL);
        bool struck = hg_alloc_count() >= n;
        hg_alloc_fail_at(0);
        if (status == HG_OK) // syncing the folder is tried, not promised
            break;
        assert_true(struck);
        assert_int_equal(status, HG_E_NOMEM);
        assert_content("old");
        assert_true(n < 10);
    }
    assert_content("new");
    assert_int_equal(empty_folder(), 1);
}

// ---- streams and links --------------------------------------------------------------------------

static void test_pipes_and_devices_are_written_through(void **state)
{
    (void)state;
    char text[8] = "";
    struct stat st;
    assert_int_equal(mkfifo(target, 0600), 0);
    const int reader = open(target, O_RDWR | O_NONBLOCK); // so that nothing waits for one
    assert_true(reader >= 0);
    assert_int_equal(hg_file_write_atomic(target, "one", 3, NULL), HG_OK);
    struct hg_file_out out;
    assert_int_equal(hg_file_begin(&out, target, NULL), HG_OK);
    hg_file_abort(&out);
    assert_int_equal(read(reader, text, sizeof text), 3);
    assert_string_equal(text, "one");
    close(reader);
    assert_int_equal(lstat(target, &st), 0);
    assert_true(S_ISFIFO(st.st_mode));
    assert_int_equal(empty_folder(), 1);
    if (mknod(target, S_IFCHR | 0600, 1 << 8 | 3) != 0) // as /dev/null; root alone may
        return;
    enum hg_status status = hg_file_write_atomic(target, "one", 3, NULL);
    assert_true(status == HG_OK || status == HG_E_PERM); // the latter: mounted without devices
    assert_int_equal(lstat(target, &st), 0);
    assert_true(S_ISCHR(st.st_mode));
    assert_int_equal(empty_folder(), 1);
}

static void test_open_descriptors_are_written_through(void **state)
{
    (void)state;
    char name[40], text[8] = "";
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    snprintf(name, sizeof name, "/dev/fd/%d", ends[1]);
    assert_int_equal(hg_file_write_atomic(name, "one", 3, NULL), HG_OK);
    snprintf(name, sizeof name, "/proc/self/fd/%d", ends[1]);
    assert_int_equal(symlink(name, target), 0); // as /dev/stdout is one
    assert_int_equal(hg_file_write_atomic(target, "two", 3, NULL), HG_OK);
    assert_int_equal(read(ends[0], text, sizeof text), 6);
    assert_string_equal(text, "onetwo");
    close(ends[0]);
    close(ends[1]);
    assert_int_equal(hg_file_write_atomic(target, "two", 3, NULL), HG_E_IO); // closed
    assert_int_equal(empty_folder(), 1);
}

static void test_links_are_followed(void **state)
{
    (void)state;
    char name[100], sub[100];
    struct stat st;
    snprintf(name, sizeof name, "%s/link", folder);
    snprintf(sub, sizeof sub, "%s/sub", folder);
    assert_int_equal(mkdir(sub, 0755), 0);
    assert_int_equal(symlink("sub/next", name), 0); // of the folder, to a link, to no file yet
    snprintf(sub, sizeof sub, "%s/sub/next", folder);
    assert_int_equal(symlink(target, sub), 0);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(hg_file_write_atomic(name, i ? "new" : "old", 3, NULL), HG_OK);
        assert_content(i ? "new" : "old");
        assert_int_equal(lstat(name, &st), 0);
        assert_true(S_ISLNK(st.st_mode));
        assert_int_equal(lstat(target, &st), 0);
        assert_true(S_ISREG(st.st_mode));
    }
    unlink(sub);
    assert_int_equal(symlink(name, sub), 0);
    assert_int_equal(hg_file_write_atomic(name, "new", 3, NULL), HG_E_IO); // a circle
    unlink(sub);
    assert_int_equal(empty_folder(), 3);
}

// ---- reading -----------------------------------------------------------------------------------

static void test_read_limits(void **state)
{
    (void)state;
    uint8_t *data = (uint8_t *)1;
    size_t size = 9;
    struct hg_error err = {0};
    assert_int_equal(hg_file_write_atomic(target, "12345", 5, NULL), HG_OK);
    assert_int_equal(hg_file_read(target, 4, &data, &size, &err), HG_E_LIMIT);
    assert_null(data);
    assert_int_equal(size, 0);
    assert_int_equal(hg_file_read(target, 5, &data, &size, &err), HG_OK);
    assert_int_equal(size, 5);
    hg_free(data);
    hg_alloc_fail_at(1);
    assert_int_equal(hg_file_read(target, 5, &data, &size, &err), HG_E_NOMEM);
    hg_alloc_fail_at(0);
    assert_int_equal(empty_folder(), 1);
}

static void test_read_refusals(void **state)
{
    (void)state;
    uint8_t *data;
    size_t size;
    struct hg_error err = {0};
    assert_int_equal(hg_file_read(target, 100, &data, &size, &err), HG_E_NOTFOUND);
    assert_string_equal(err.what, target);
    assert_int_equal(hg_file_read(folder, 100, &data, &size, &err), HG_E_IO);
    assert_int_equal(hg_file_read("/dev/zero", 100, &data, &size, &err), HG_E_IO);
    assert_int_equal(mkfifo(target, 0600), 0);
    assert_int_equal(hg_file_read(target, 100, &data, &size, &err), HG_E_IO); // must not wait
    assert_int_equal(empty_folder(), 1);
    assert_int_equal(hg_file_write_atomic(target, NULL, 0, NULL), HG_OK);
    assert_int_equal(hg_file_read(target, 0, &data, &size, &err), HG_OK);
    assert_int_equal(size, 0);
    assert_int_equal(data[0], 0);
    hg_free(data);
    assert_int_equal(empty_folder(), 1);
}

static void test_errno_map(void **state)
{
    (void)state;
    assert_int_equal(hg_status_from_errno(ENOENT), HG_E_NOTFOUND);
    assert_int_equal(hg_status_from_errno(EACCES), HG_E_PERM);
    assert_int_equal(hg_status_from_errno(EROFS), HG_E_PERM);
    assert_int_equal(hg_status_from_errno(ENOSPC), HG_E_NOSPACE);
    assert_int_equal(hg_status_from_errno(EDQUOT), HG_E_NOSPACE);
    assert_int_equal(hg_status_from_errno(ENOMEM), HG_E_NOMEM);
    assert_int_equal(hg_status_from_errno(EIO), HG_E_IO);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_commit_replaces),
        cmocka_unit_test(test_abort_leaves_the_old_file),
        cmocka_unit_test(test_killed_writers_leave_nothing),
        cmocka_unit_test(test_dead_writers_are_cleaned_up_after),
        cmocka_unit_test(test_files_that_get_no_name),
        cmocka_unit_test(test_mode_follows_the_umask),
        cmocka_unit_test(test_bad_places),
        cmocka_unit_test(test_unwritable_folder),
        cmocka_unit_test(test_no_space),
        cmocka_unit_test(test_no_memory),
        cmocka_unit_test(test_pipes_and_devices_are_written_through),
        cmocka_unit_test(test_open_descriptors_are_written_through),
        cmocka_unit_test(test_links_are_followed),
        cmocka_unit_test(test_read_limits),
        cmocka_unit_test(test_read_refusals),
        cmocka_unit_test(test_errno_map),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
