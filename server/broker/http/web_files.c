#include "server/broker/http/web_files.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/sha256.h"

enum { MOST_BYTES = 64 << 20, MOST_FILES = 4096, MOST_DEPTH = 8, PATH_BYTES = 1024 };

static const char *type_of(const char *path)
{
    static const struct {
        const char *suffix, *type;
    } types[] = {
        {".html", "text/html; charset=utf-8"},
        {".js", "text/javascript; charset=utf-8"},
        {".mjs", "text/javascript; charset=utf-8"},
        {".css", "text/css; charset=utf-8"},
        {".json", "application/json"},
        {".map", "application/json"},
        {".webmanifest", "application/manifest+json"},
        {".svg", "image/svg+xml"},
        {".png", "image/png"},
        {".jpg", "image/jpeg"},
        {".webp", "image/webp"},
        {".ico", "image/x-icon"},
        {".woff2", "font/woff2"},
        {".wasm", "application/wasm"},
        {".txt", "text/plain; charset=utf-8"},
        {".gz", "application/gzip"},
    };
    const char *dot = strrchr(path, '.');
    for (size_t i = 0; dot && i < sizeof types / sizeof *types; i++)
        if (strcmp(dot, types[i].suffix) == 0)
            return types[i].type;
    return "application/octet-stream";
}

// Takes over `data`.
static enum hg_status add(struct hg_web_files *files, const char *path, uint8_t *data, size_t size)
{
    uint8_t hash[32];
    char hex[HG_SHA256_HEX];
    if (hg_grow(&files->items, &files->capacity, files->count + 1, sizeof *files->items) ||
        hg_sha256(data, size, hash)) {
        hg_free(data);
        return HG_E_NOMEM;
    }
    struct hg_web_file *file = &files->items[files->count];
    *file = (struct hg_web_file){
        .path = hg_strdup(path), .type = type_of(path), .data = data, .size = size};
    if (!file->path) {
        hg_free(data);
        return HG_E_NOMEM;
    }
    hg_sha256_hex(hash, hex);
    snprintf(file->etag, sizeof file->etag, "\"%.32s\"", hex);
    files->count++;
    files->bytes += size;
    return HG_OK;
}

static enum hg_status read_folder(struct hg_web_files *files, char path[PATH_BYTES],
    size_t root_length, int depth, struct hg_error *err);

static enum hg_status read_entry(struct hg_web_files *files, char path[PATH_BYTES],
    size_t root_length, int depth, struct hg_error *err)
{
    struct stat st;
    uint8_t *data;
    size_t size;
    if (stat(path, &st) != 0)
        return hg_error_set(err, hg_status_from_errno(errno), path, NULL, "%s", strerror(errno));
    if (S_ISDIR(st.st_mode))
        return read_folder(files, path, root_length, depth + 1, err);
    if (!S_ISREG(st.st_mode))
        return HG_OK;
    if (files->count >= MOST_FILES)
        return hg_error_set(err, HG_E_LIMIT, path, NULL, "more than %d files", MOST_FILES);
    enum hg_status status = hg_file_read(path, MOST_BYTES - files->bytes, &data, &size, err);
    if (status)
        return status;
    return add(files, path + root_length, data, size)
               ? hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory")
               : HG_OK;
}

static enum hg_status read_folder(struct hg_web_files *files, char path[PATH_BYTES],
    size_t root_length, int depth, struct hg_error *err)
{
    const size_t length = strlen(path);
    enum hg_status status = HG_OK;
    if (depth > MOST_DEPTH)
        return hg_error_set(err, HG_E_LIMIT, path, NULL, "more than %d folders deep", MOST_DEPTH);
    DIR *dir = opendir(path);
    if (!dir)
        return hg_error_set(err, hg_status_from_errno(errno), path, NULL, "%s", strerror(errno));
    for (struct dirent *entry; !status && (entry = readdir(dir));) {
        if (entry->d_name[0] == '.')
            continue;
        int n = snprintf(path + length, PATH_BYTES - length, "/%s", entry->d_name);
        status = n < (int)(PATH_BYTES - length)
                     ? read_entry(files, path, root_length, depth, err)
                     : hg_error_set(err, HG_E_LIMIT, path, NULL, "the path is too long");
        path[length] = 0;
    }
    closedir(dir);
    return status;
}

static int by_path(const void *a, const void *b)
{
    return strcmp(((const struct hg_web_file *)a)->path, ((const struct hg_web_file *)b)->path);
}

enum hg_status hg_web_files_read(const char *folder, struct hg_web_files *out, struct hg_error *err)
{
    char path[PATH_BYTES];
    *out = (struct hg_web_files){0};
    if (snprintf(path, sizeof path, "%s", folder) >= (int)sizeof path)
        return hg_error_set(err, HG_E_LIMIT, folder, NULL, "the path is too long");
    enum hg_status status = read_folder(out, path, strlen(path), 0, err);
    if (status)
        hg_web_files_finish(out);
    else if (out->count)
        qsort(out->items, out->count, sizeof *out->items, by_path);
    return status;
}

const struct hg_web_file *hg_web_files_find(const struct hg_web_files *files, const char *path)
{
    char index[PATH_BYTES];
    const size_t length = strlen(path);
    if (length && path[length - 1] == '/' &&
        snprintf(index, sizeof index, "%sindex.html", path) < (int)sizeof index)
        path = index;
    const struct hg_web_file key = {.path = (char *)path};
    return files->count ? bsearch(&key, files->items, files->count, sizeof key, by_path) : NULL;
}

const struct hg_web_file *hg_web_files_find_gzip(
    const struct hg_web_files *files, const struct hg_web_file *file)
{
    char path[PATH_BYTES];
    return snprintf(path, sizeof path, "%s.gz", file->path) < (int)sizeof path
               ? hg_web_files_find(files, path)
               : NULL;
}

void hg_web_files_finish(struct hg_web_files *files)
{
    for (size_t i = 0; i < files->count; i++) {
        hg_free(files->items[i].path);
        hg_free(files->items[i].data);
    }
    hg_free(files->items);
    *files = (struct hg_web_files){0};
}
