// file.h - whole-file reads with a limit, and outputs that appear complete or not at all.
// Floor 0. Thread-safe (each object belongs to one thread).
#ifndef HG_BASE_FILE_H
#define HG_BASE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

// Reads a regular file of at most limit_bytes. *data is freed with hg_free and has one extra
// zero byte behind `*size`. HG_E_NOTFOUND, HG_E_PERM, HG_E_LIMIT, HG_E_NOMEM, HG_E_IO.
enum hg_status hg_file_read(const char *path, uint64_t limit_bytes, uint8_t **data, size_t *size,
    struct hg_error *err) HG_MUST_CHECK;

// An output beside its final name: without a name where the file system knows such files, so that
// nothing is left of a process that is killed, else under a temporary one, which is locked
// as long as its writer lives. The next writer of the same name removes what others left.
// A name of something other than a regular file (a pipe, a device, an open descriptor as in
// /dev/stdout) is a stream: it is written through, and there is nothing to replace or to undo.
struct hg_file_out {
    int fd;                 // open for writing and reading; -1 when not begun
    char *path, *temp_path; // the former: symbolic links followed; the latter "": has no name
    bool stream;
};

// The open descriptor that a name stands for (/dev/stdout, /dev/fd/3, ...); -1 = none.
int hg_file_descriptor(const char *path);

// Where an output of that name goes: symbolic links are followed to the file that they mean, which
// need not exist. *target is freed with hg_free. HG_E_PERM, HG_E_NOMEM, HG_E_IO (links in a
// circle).
enum hg_status hg_file_target(
    const char *path, char **target, bool *stream, struct hg_error *err) HG_MUST_CHECK;

// Creates the file in the folder of `path`, or opens the stream. Statuses: hg_status_from_errno.
enum hg_status hg_file_begin(
    struct hg_file_out *out, const char *path, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_file_write(
    struct hg_file_out *out, const void *data, size_t size, struct hg_error *err) HG_MUST_CHECK;
// fsync, the final name in place of who had it, fsync of the folder; on failure the temporary is
// removed and an older file at the final name is untouched. Finishes *out either way.
enum hg_status hg_file_commit(struct hg_file_out *out, struct hg_error *err) HG_MUST_CHECK;
// Removes the temporary. Accepts a zeroed, begun or finished object (fd -1 or both names NULL).
void hg_file_abort(struct hg_file_out *out);

// begin + write + commit: the file at `path` has the new content in full, or its old one.
enum hg_status hg_file_write_atomic(
    const char *path, const void *data, size_t size, struct hg_error *err) HG_MUST_CHECK;
// Maps errno to a status (ENOENT -> NOTFOUND, EACCES/EPERM/EROFS -> PERM, ENOSPC/EDQUOT -> NOSPACE,
// ENOMEM and no more descriptors -> NOMEM, else IO).
enum hg_status hg_status_from_errno(int error_number);

#endif
