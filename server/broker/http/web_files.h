// web_files.h - the files that HTTP serves: one folder, read once.
// Floor 6 (broker). Thread: the loop. Requests are looked up among the names that were found then,
// so no path of a client ever reaches the file system.
#ifndef HG_BROKER_WEB_FILES_H
#define HG_BROKER_WEB_FILES_H

#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

enum { HG_WEB_ETAG_BYTES = 35 }; // with quotes and terminator

struct hg_web_file {
    char *path; // from the root, with '/' at its start
    const char *type;
    uint8_t *data;
    size_t size;
    char etag[HG_WEB_ETAG_BYTES]; // of the content
};

// Zero-initialised = none.
struct hg_web_files {
    struct hg_web_file *items; // by path
    size_t count, capacity;
    uint64_t bytes;
};

// Reads all regular files below `folder`; names that begin with '.' are left out. HG_E_NOTFOUND,
// HG_E_PERM, HG_E_IO, HG_E_NOMEM, HG_E_LIMIT (more than 64 MiB, 4096 files or 8 folders deep). On
// failure *out is empty.
enum hg_status hg_web_files_read(
    const char *folder, struct hg_web_files *out, struct hg_error *err) HG_MUST_CHECK;
// NULL: there is none. A folder means its index.html.
const struct hg_web_file *hg_web_files_find(const struct hg_web_files *files, const char *path);
// The file's content as gzip (its name and .gz), or NULL.
const struct hg_web_file *hg_web_files_find_gzip(
    const struct hg_web_files *files, const struct hg_web_file *file);
void hg_web_files_finish(struct hg_web_files *files);

#endif
