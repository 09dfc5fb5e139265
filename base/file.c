#include "base/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
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

static enum hg_status read_all(int fd, const char *path, uint8_t *data, size_t size,
    struct hg_error *err)
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

enum hg_status hg_file_read(const char *path, uint64_t limit_bytes, uint8_t **data, size_t *size,
    struct hg_error *err)
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
        status = hg_error_set(err, HG_E_LIMIT, path, NULL, "%llu bytes are more than the limit of %llu",
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

// Writes 12 random digits to `suffix`, the end of `path`, and creates the file. Not mkstemp, whose
// mode 0600 could only be widened by reading the umask, which is not thread-safe.
static int create_temp(char *suffix, const char *path)
{
    for (int tries = 0; tries < 100; tries++) {
        uint64_t random;
        if (getrandom(&random, sizeof random, 0) != (ssize_t)sizeof random)
            return -1;
        snprintf(suffix, 13, "%012llx", (unsigned long long)(random & 0xffffffffffff));
        int fd = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (fd >= 0 || errno != EEXIST)
            return fd;
    }
    return -1;
}

enum hg_status hg_file_begin(struct hg_file_out *out, const char *path, struct hg_error *err)
{
    *out = (struct hg_file_out){.fd = -1};
    size_t room = strlen(path) + 16;
    const char *slash = strrchr(path, '/'), *base = slash ? slash + 1 : path;
    if (!*base)
        return hg_error_set(err, HG_E_INVAL, path, NULL, "names a folder, not a file");
    out->path = hg_strdup(path);
    out->temp_path = hg_calloc(room, 1);
    if (!out->path || !out->temp_path) {
        hg_file_abort(out);
        return hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory for the name");
    }
    int stem = snprintf(out->temp_path, room, "%.*s.%s.", (int)(base - path), path, base);
    out->fd = create_temp(out->temp_path + stem, out->temp_path);
    if (out->fd < 0) {
        enum hg_status status = fail_errno(err, path, "cannot create");
        out->temp_path[0] = 0;
        hg_file_abort(out);
        return status;
    }
    return HG_OK;
}

enum hg_status hg_file_write(struct hg_file_out *out, const void *data, size_t size,
    struct hg_error *err)
{
    for (size_t done = 0; done < size;) {
        ssize_t n = write(out->fd, (const uint8_t *)data + done, size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return fail_errno(err, out->path, "cannot write");
        done += (size_t)n;
    }
    return HG_OK;
}

static void sync_folder(const char *path)
{
    char *folder = hg_strdup(path);
    if (!folder)
        return;
    char *slash = strrchr(folder, '/');
    if (slash)
        slash[slash == folder] = 0;
    int fd = open(slash ? folder : ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd >= 0) {
        fsync(fd);
        close(fd);
    }
    hg_free(folder);
}

enum hg_status hg_file_commit(struct hg_file_out *out, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (fsync(out->fd) != 0)
        status = fail_errno(err, out->path, "cannot sync");
    int closed = close(out->fd);
    out->fd = -1;
    if (!status && closed != 0)
        status = fail_errno(err, out->path, "cannot close");
    if (!status && rename(out->temp_path, out->path) != 0)
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
    if (out->temp_path && out->fd >= 0)
        close(out->fd);
    if (out->temp_path && out->temp_path[0])
        unlink(out->temp_path);
    hg_free(out->path);
    hg_free(out->temp_path);
    *out = (struct hg_file_out){.fd = -1};
}

enum hg_status hg_file_write_atomic(const char *path, const void *data, size_t size,
    struct hg_error *err)
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
