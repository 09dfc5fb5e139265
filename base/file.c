#include "base/file.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"

enum hg_status hg_status_from_errno(int e)
{
    switch (e) {
    case ENOENT:
    case ENOTDIR:
        return HG_E_NOTFOUND;
    case EACCES:
    case EPERM:
    case EROFS:
        return HG_E_PERM;
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
        return HG_E_NOSPACE;
    case ENOMEM:
    case EMFILE:
    case ENFILE:
        return HG_E_NOMEM;
    default:
        return HG_E_IO;
    }
}

static enum hg_status fail_errno(struct hg_error *err, const char *path, const char *action)
{
    int e = errno;
    return hg_error_set(err, hg_status_from_errno(e), path, NULL, "%s: %s", action, strerror(e));
}

static enum hg_status read_all(
    int fd, const char *path, uint8_t *data, size_t size, struct hg_error *err)
{
    for (size_t done = 0; done < size;) {
        ssize_t n = read(fd, data + done, size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return fail_errno(err, path, "cannot read");
        if (n == 0)
            return hg_error_set(err, HG_E_IO, path, NULL, "the file became shorter while read");
        done += (size_t)n;
    }
    return HG_OK;
}

enum hg_status hg_file_read(
    const char *path, uint64_t limit_bytes, uint8_t **data, size_t *size, struct hg_error *err)
{
    *data = NULL;
    *size = 0;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return fail_errno(err, path, "cannot open");
    struct stat st;
    enum hg_status status = HG_OK;
    uint8_t *bytes = NULL;
    if (fstat(fd, &st) != 0)
        status = fail_errno(err, path, "cannot stat");
    else if (!S_ISREG(st.st_mode))
        status = hg_error_set(err, HG_E_IO, path, NULL, "not a regular file");
    else if ((uint64_t)st.st_size > limit_bytes)
        status =
            hg_error_set(err, HG_E_LIMIT, path, NULL, "%llu bytes are more than the limit of %llu",
                (unsigned long long)st.st_size, (unsigned long long)limit_bytes);
    else if (!(bytes = hg_calloc((size_t)st.st_size + 1, 1)))
        status = hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory for the file");
    else
        status = read_all(fd, path, bytes, (size_t)st.st_size, err);
    close(fd);
    if (status) {
        hg_free(bytes);
        return status;
    }
    *data = bytes;
    *size = (size_t)st.st_size;
    return HG_OK;
}

// ---- where an output goes -----------------------------------------------------------------------

enum { LINKS_MAX = 40 }; // as the kernel follows

int hg_file_descriptor(const char *path)
{
    static const char *const folders[] = {"/dev/fd/", "/proc/self/fd/"};
    if (strcmp(path, "/dev/stdout") == 0)
        return STDOUT_FILENO;
    if (strcmp(path, "/dev/stderr") == 0)
        return STDERR_FILENO;
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        const size_t length = strlen(folders[i]);
        const char *digits = path + length;
        if (strncmp(path, folders[i], length) == 0 && *digits && strlen(digits) < 9 &&
            strspn(digits, "0123456789") == strlen(digits))
            return atoi(digits);
    }
    return -1;
}

// One symbolic link further. *path is the new name, or unchanged where it is no link (*more false).
static enum hg_status follow_link(char **path, bool *more, struct hg_error *err)
{
    char text[PATH_MAX];
    struct stat st;
    *more = false;
    if (hg_file_descriptor(*path) >= 0 || lstat(*path, &st) != 0 || !S_ISLNK(st.st_mode))
        return HG_OK;
    const ssize_t n = readlink(*path, text, sizeof text - 1);
    if (n < 0)
        return fail_errno(err, *path, "cannot follow the link");
    text[n] = 0;
    const char *slash = text[0] == '/' ? NULL : strrchr(*path, '/');
    const size_t folder = slash ? (size_t)(slash + 1 - *path) : 0;
    char *next = hg_calloc(folder + (size_t)n + 1, 1);
    if (!next)
        return hg_error_set(err, HG_E_NOMEM, *path, NULL, "no memory for the name");
    memcpy(next, *path, folder);
    memcpy(next + folder, text, (size_t)n);
    hg_free(*path);
    *path = next;
    *more = true;
    return HG_OK;
}

static bool is_stream(const char *path)
{
    struct stat st;
    return hg_file_descriptor(path) >= 0 ||
           (stat(path, &st) == 0 && !S_ISREG(st.st_mode) && !S_ISDIR(st.st_mode));
}

// The kernel is asked to follow the links first: it may refuse those of others in a shared folder.
enum hg_status hg_file_target(const char *path, char **target, bool *stream, struct hg_error *err)
{
    struct stat st;
    *target = NULL;
    *stream = false;
    if (stat(path, &st) != 0 && errno != ENOENT && errno != ENOTDIR)
        return fail_errno(err, path, "cannot create");
    char *at = hg_strdup(path);
    if (!at)
        return hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory for the name");
    bool more = true;
    for (int links = 0; more; links++) {
        enum hg_status status = links < LINKS_MAX ? follow_link(&at, &more, err)
                                                  : hg_error_set(err, HG_E_IO, path, NULL,
                                                        "symbolic links in a circle");
        if (status) {
            hg_free(at);
            return status;
        }
    }
    *stream = is_stream(at);
    *target = at;
    return HG_OK;
}

// ---- names while a file is written --------------------------------------------------------------

#define DIGITS 12 // of a temporary name: .NAME.0123456789ab

// Where the folder's name ends in `path`: behind the last slash, 0 = there is none.
static size_t folder_length(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? (size_t)(slash + 1 - path) : 0;
}

static int open_folder(const char *path, int flags)
{
    const size_t length = folder_length(path);
    char *folder = hg_strndup(length ? path : ".", length ? length : 1);
    if (!folder) {
        errno = ENOMEM;
        return -1;
    }
    const int fd = open(folder, flags | O_CLOEXEC, 0666);
    hg_free(folder);
    return fd;
}

static bool is_temp_of(const char *name, const char *base)
{
    const size_t length = strlen(base);
    return name[0] == '.' && strncmp(name + 1, base, length) == 0 && name[1 + length] == '.' &&
           strlen(name) == length + 2 + DIGITS &&
           strspn(name + length + 2, "0123456789abcdef") == DIGITS;
}

// A living owner holds its lock.
static void remove_if_dead(int folder, const char *name)
{
    struct stat st;
    const int fd = openat(folder, name, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0)
        return;
    if (fstat(fd, &st) == 0 && S_ISREG(st.st_mode) && flock(fd, LOCK_EX | LOCK_NB) == 0)
        unlinkat(folder, name, 0);
    close(fd);
}

// What writers of the same output left that were killed.
static void remove_dead(const char *path)
{
    const int fd = open_folder(path, O_RDONLY | O_DIRECTORY);
    DIR *dir = fd >= 0 ? fdopendir(fd) : NULL;
    if (!dir && fd >= 0)
        close(fd);
    for (struct dirent *e; dir && (e = readdir(dir));)
        if (is_temp_of(e->d_name, path + folder_length(path)))
            remove_if_dead(fd, e->d_name);
    if (dir)
        closedir(dir);
}

// A name that is probably unused.
static bool choose_temp(struct hg_file_out *out)
{
    uint64_t random;
    const size_t folder = folder_length(out->path);
    if (getrandom(&random, sizeof random, 0) != (ssize_t)sizeof random)
        return false;
    snprintf(out->temp_path, strlen(out->path) + DIGITS + 3, "%.*s.%s.%012llx", (int)folder,
        out->path, out->path + folder, (unsigned long long)(random & 0xffffffffffff));
    return true;
}

// Created, locked, and not removed in between by a process that found it without a lock. Not
// mkstemp, whose mode 0600 could only be widened by reading the umask, which is not thread-safe.
static int create_temp(struct hg_file_out *out)
{
    remove_dead(out->path);
    for (int tries = 0; tries < 100 && choose_temp(out); tries++) {
        struct stat st;
        const int fd = open(out->temp_path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (fd >= 0 && (flock(fd, LOCK_EX) != 0 || fstat(fd, &st) != 0 || st.st_nlink > 0))
            return fd;
        if (fd >= 0)
            close(fd);
        else if (errno != EEXIST)
            break;
    }
    out->temp_path[0] = 0;
    return -1;
}

// It gets its name through /proc.
static int create_unnamed(const char *path)
{
    const int fd = open_folder(path, O_TMPFILE | O_RDWR);
    if (fd < 0 || (access("/proc/self/fd", X_OK) == 0 && flock(fd, LOCK_EX) == 0))
        return fd;
    close(fd);
    return -1;
}

static bool link_fd(int fd, const char *name)
{
    char self[32];
    snprintf(self, sizeof self, "/proc/self/fd/%d", fd);
    return linkat(AT_FDCWD, self, AT_FDCWD, name, AT_SYMLINK_FOLLOW) == 0;
}

// Its own name at once, when it is free; else one to be renamed.
static bool name_unnamed(struct hg_file_out *out)
{
    if (link_fd(out->fd, out->path))
        return true;
    if (errno != EEXIST)
        return false;
    remove_dead(out->path);
    for (int tries = 0; tries < 100 && choose_temp(out); tries++)
        if (link_fd(out->fd, out->temp_path))
            return true;
        else if (errno != EEXIST)
            break;
    out->temp_path[0] = 0;
    return false;
}

static bool copy_bytes(int to, int from)
{
    uint8_t bytes[65536];
    ssize_t n = 0;
    for (off_t at = 0; (n = pread(from, bytes, sizeof bytes, at)) != 0;) {
        if (n > 0)
            n = pwrite(to, bytes, (size_t)n, at);
        if (n < 0 && errno != EINTR)
            return false;
        at += n > 0 ? n : 0;
    }
    return fsync(to) == 0;
}

// For file systems that make files without names and give them none.
static bool name_copy(struct hg_file_out *out)
{
    const int fd = create_temp(out);
    if (fd < 0)
        return false;
    const bool whole = copy_bytes(fd, out->fd);
    const int problem = errno;
    close(out->fd);
    out->fd = fd;
    errno = problem;
    return whole;
}

// ---- writing ------------------------------------------------------------------------------------

// Waits for a reader of a named pipe.
static int open_stream(const char *path)
{
    const int fd = hg_file_descriptor(path);
    return fd >= 0 ? fcntl(fd, F_DUPFD_CLOEXEC, 3) : open(path, O_WRONLY | O_NOCTTY | O_CLOEXEC);
}

enum hg_status hg_file_begin(struct hg_file_out *out, const char *path, struct hg_error *err)
{
    *out = (struct hg_file_out){.fd = -1};
    if (!path[folder_length(path)])
        return hg_error_set(err, HG_E_INVAL, path, NULL, "names a folder, not a file");
    enum hg_status target = hg_file_target(path, &out->path, &out->stream, err);
    if (target)
        return target;
    out->temp_path = hg_calloc(strlen(out->path) + DIGITS + 3, 1);
    if (!out->temp_path) {
        hg_file_abort(out);
        return hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory for the name");
    }
    out->fd = out->stream ? open_stream(out->path) : create_unnamed(out->path);
    if (out->fd < 0 && !out->stream)
        out->fd = create_temp(out);
    if (out->fd < 0) {
        enum hg_status status = fail_errno(err, path, "cannot create");
        hg_file_abort(out);
        return status;
    }
    return HG_OK;
}

enum hg_status hg_file_write(
    struct hg_file_out *out, const void *data, size_t size, struct hg_error *err)
{
    for (size_t done = 0; done < size;) {
        ssize_t n = write(out->fd, (const uint8_t *)data + done, size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0 && errno == EAGAIN && out->stream) { // shared with a program that does not block
            poll(&(struct pollfd){.fd = out->fd, .events = POLLOUT}, 1, -1);
            continue;
        }
        if (n < 0)
            return fail_errno(err, out->path, "cannot write");
        done += (size_t)n;
    }
    return HG_OK;
}

static void sync_folder(const char *path)
{
    const int fd = open_folder(path, O_RDONLY | O_DIRECTORY);
    if (fd >= 0) {
        fsync(fd);
        close(fd);
    }
}

// The lock stays until nothing has the temporary name any more.
enum hg_status hg_file_commit(struct hg_file_out *out, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (out->stream) {
        hg_file_abort(out);
        return HG_OK;
    }
    if (fsync(out->fd) != 0)
        status = fail_errno(err, out->path, "cannot sync");
    if (!status && !out->temp_path[0] && !name_unnamed(out) && !name_copy(out))
        status = fail_errno(err, out->path, "cannot give it its name");
    if (!status && out->temp_path[0] && rename(out->temp_path, out->path) != 0)
        status = fail_errno(err, out->path, "cannot rename into place");
    if (!status) {
        sync_folder(out->path);
        out->temp_path[0] = 0;
    }
    hg_file_abort(out);
    return status;
}

void hg_file_abort(struct hg_file_out *out)
{
    if (out->temp_path && out->temp_path[0])
        unlink(out->temp_path);
    if (out->temp_path && out->fd >= 0)
        close(out->fd);
    hg_free(out->path);
    hg_free(out->temp_path);
    *out = (struct hg_file_out){.fd = -1};
}

enum hg_status hg_file_write_atomic(
    const char *path, const void *data, size_t size, struct hg_error *err)
{
    struct hg_file_out out;
    enum hg_status status = hg_file_begin(&out, path, err);
    if (status)
        return status;
    status = hg_file_write(&out, data, size, err);
    if (status) {
        hg_file_abort(&out);
        return status;
    }
    return hg_file_commit(&out, err);
}
