#include "renderer/scene/fetch.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"

static enum hg_status resolve(const char *path, char **out, struct hg_error *err)
{
    char real[PATH_MAX];
    *out = NULL;
    if (!realpath(path, real))
        return hg_error_set(err, hg_status_from_errno(errno), path, NULL, "%s", strerror(errno));
    *out = hg_strdup(real);
    return *out ? HG_OK : hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory");
}

static bool lies_under(const char *path, const char *root)
{
    size_t n = strlen(root);
    while (n > 1 && root[n - 1] == '/')
        n--;
    if (n == 1 && root[0] == '/')
        return true;
    return strncmp(path, root, n) == 0 && path[n] == '/';
}

static bool is_allowed(const struct hg_fetch *fetch, const char *path)
{
    for (uint32_t i = 0; i < fetch->root_count; i++)
        if (lies_under(path, fetch->roots[i]))
            return true;
    return false;
}

static enum hg_status add_roots(
    struct hg_fetch *fetch, const struct hg_load_params *params, struct hg_error *err)
{
    uint32_t count = params->root_count ? params->root_count : 1;
    fetch->roots = hg_calloc(count, sizeof *fetch->roots);
    if (!fetch->roots)
        return hg_error_set(err, HG_E_NOMEM, params->path, NULL, "no memory");
    for (uint32_t i = 0; i < count; i++) {
        const char *root = params->root_count ? params->roots[i] : fetch->folder;
        enum hg_status status = resolve(root, &fetch->roots[i], err);
        if (status)
            return status;
        fetch->root_count++;
    }
    return HG_OK;
}

enum hg_status hg_fetch_init(
    struct hg_fetch *fetch, const struct hg_load_params *params, struct hg_error *err)
{
    memset(fetch, 0, sizeof *fetch);
    char *main = NULL;
    enum hg_status status = resolve(params->path, &main, err);
    if (status)
        return status;
    char *slash = strrchr(main, '/');
    fetch->folder = hg_strndup(main, slash == main ? 1 : (size_t)(slash - main));
    status = fetch->folder ? add_roots(fetch, params, err)
                           : hg_error_set(err, HG_E_NOMEM, params->path, NULL, "no memory");
    if (!status && !is_allowed(fetch, main))
        status = hg_error_set(
            err, HG_E_PERM, params->path, NULL, "the file lies outside of the asset roots");
    hg_free(main);
    if (status)
        hg_fetch_finish(fetch);
    return status;
}

void hg_fetch_finish(struct hg_fetch *fetch)
{
    for (uint32_t i = 0; i < fetch->root_count; i++)
        hg_free(fetch->roots[i]);
    hg_free(fetch->roots);
    hg_free(fetch->folder);
    memset(fetch, 0, sizeof *fetch);
}

enum hg_status hg_fetch_resolve(
    const struct hg_fetch *fetch, const char *relative, char **out, struct hg_error *err)
{
    char path[PATH_MAX];
    *out = NULL;
    int n = snprintf(path, sizeof path, "%s/%s", fetch->folder, relative);
    if (n < 0 || (size_t)n >= sizeof path)
        return hg_error_set(err, HG_E_NOTFOUND, relative, NULL, "the path is too long");
    enum hg_status status = resolve(path, out, err);
    if (status)
        return status;
    struct stat info;
    if (!is_allowed(fetch, *out))
        status =
            hg_error_set(err, HG_E_PERM, relative, NULL, "the path leaves the permitted folders");
    else if (stat(*out, &info) != 0 || !S_ISREG(info.st_mode))
        status = hg_error_set(err, HG_E_IO, relative, NULL, "not a regular file");
    if (status) {
        hg_free(*out);
        *out = NULL;
    }
    return status;
}

static enum hg_status read_all(
    int fd, struct hg_refbuf *buf, const char *path, struct hg_error *err)
{
    size_t done = 0;
    while (done < buf->size) {
        ssize_t n = read(fd, buf->data + done, buf->size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return hg_error_set(err, HG_E_IO, path, NULL, "%s",
                n ? strerror(errno) : "the file shrank while it was read");
        done += (size_t)n;
    }
    return HG_OK;
}

enum hg_status hg_fetch_read(
    const char *path, uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return hg_error_set(err, hg_status_from_errno(errno), path, NULL, "%s", strerror(errno));
    struct stat info;
    enum hg_status status = HG_OK;
    if (fstat(fd, &info) != 0 || !S_ISREG(info.st_mode))
        status = hg_error_set(err, HG_E_IO, path, NULL, "not a regular file");
    else if ((uint64_t)info.st_size > limit_bytes)
        status = hg_error_set(err, HG_E_LIMIT, path, NULL, "%llu bytes pass the limit of %llu",
            (unsigned long long)info.st_size, (unsigned long long)limit_bytes);
    struct hg_refbuf *buf = status ? NULL : hg_refbuf_create_spilled((size_t)info.st_size);
    if (!status && !buf)
        status = hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory for the file");
    if (!status)
        status = read_all(fd, buf, path, err);
    close(fd);
    if (status)
        hg_refbuf_unref(buf);
    else
        *out = buf;
    return status;
}

enum hg_status hg_fetch_file(
    void *user, const char *uri, uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    const struct hg_fetch *fetch = user;
    char *path;
    *out = NULL;
    enum hg_status status = hg_fetch_resolve(fetch, uri, &path, err);
    if (!status)
        status = hg_fetch_read(path, limit_bytes, out, err);
    hg_free(path);
    return status;
}
