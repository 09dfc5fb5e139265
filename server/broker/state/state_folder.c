#include "server/broker/state/state_folder.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "server/broker/storage/folder_lock.h"
#include "server/broker/state/state_file.h"

static const char log_name[] = "state.log", new_name[] = "state.log.new",
                  damaged_name[] = "state.log.damaged";

static enum hg_status fail_errno(
    const struct hg_state_folder *f, const char *action, struct hg_error *err)
{
    int e = errno;
    return hg_error_set(err, hg_status_from_errno(e), f->path, NULL, "--state-dir: cannot %s: %s",
        action, strerror(e));
}

// ---- a new log ----------------------------------------------------------------------------------

enum hg_status hg_state_folder_begin(struct hg_state_folder *f, int *fd)
{
    uint8_t header[HG_STATE_HEADER_BYTES];
    hg_state_header_encode(header);
    *fd = openat(f->folder_fd, new_name, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (*fd < 0)
        return hg_status_from_errno(errno);
    ssize_t n = write(*fd, header, sizeof header);
    if (n == (ssize_t)sizeof header)
        return HG_OK;
    enum hg_status status = n < 0 ? hg_status_from_errno(errno) : HG_E_NOSPACE;
    hg_state_folder_abort(f, *fd);
    *fd = -1;
    return status;
}

enum hg_status hg_state_folder_replace(struct hg_state_folder *f, int fd, uint64_t bytes)
{
    if (fsync(fd) != 0 || renameat(f->folder_fd, new_name, f->folder_fd, log_name) != 0) {
        enum hg_status status = hg_status_from_errno(errno);
        hg_state_folder_abort(f, fd);
        return status;
    }
    if (f->log_fd >= 0)
        close(f->log_fd);
    f->log_fd = fd;
    f->bytes = bytes;
    return fsync(f->folder_fd) == 0 ? HG_OK : hg_status_from_errno(errno);
}

void hg_state_folder_abort(struct hg_state_folder *f, int fd)
{
    if (fd < 0)
        return;
    close(fd);
    unlinkat(f->folder_fd, new_name, 0);
}

// ---- opening ------------------------------------------------------------------------------------

static enum hg_status lock_folder(struct hg_state_folder *f, struct hg_error *err)
{
    if (mkdir(f->path, 0700) != 0 && errno != EEXIST)
        return fail_errno(f, "make the folder", err);
    f->folder_fd = open(f->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (f->folder_fd < 0)
        return fail_errno(f, "open the folder", err);
    return hg_folder_lock(f->path, "--state-dir", true, &f->lock_fd, err);
}

static enum hg_status make_log(struct hg_state_folder *f, struct hg_error *err)
{
    int fd;
    enum hg_status status = hg_state_folder_begin(f, &fd);
    if (!status)
        status = hg_state_folder_replace(f, fd, HG_STATE_HEADER_BYTES);
    return status ? fail_errno(f, "make the log", err) : HG_OK;
}

// What stands behind a damaged record was durable once: the file is kept as it is, beside the log.
static enum hg_status keep_damaged(
    const struct hg_state_folder *f, const struct hg_reader *r, struct hg_error *err)
{
    char path[PATH_MAX];
    if (snprintf(path, sizeof path, "%s/%s", f->path, damaged_name) >= (int)sizeof path)
        return hg_error_set(err, HG_E_LIMIT, f->path, NULL, "--state-dir: the path is too long");
    enum hg_status status = hg_file_write_atomic(path, r->data, r->size, err);
    if (!status)
        hg_fault(JOURNAL, HG_E_HASH,
            "%s/%s is damaged: the record at byte %zu does not match its checksum, and whole ones "
            "stand behind it; what was accepted from there on, %zu bytes, is lost; the file as it "
            "was is kept as %s",
            f->path, log_name, r->pos, r->size - r->pos, damaged_name);
    return status;
}

static enum hg_status cut_tail(
    struct hg_state_folder *f, const struct hg_reader *r, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (hg_state_record_is_followed(*r))
        status = keep_damaged(f, r, err);
    else
        hg_warn(JOURNAL,
            "%s/%s: its last %zu bytes were not written completely and are cut off at %zu", f->path,
            log_name, r->size - r->pos, r->pos);
    if (status)
        return status;
    if (ftruncate(f->log_fd, (off_t)r->pos) != 0 || fsync(f->log_fd) != 0)
        return fail_errno(f, "cut the log", err);
    return HG_OK;
}

static enum hg_status read_records(struct hg_state_folder *f, struct hg_reader *r,
    hg_state_take *take, void *user, struct hg_error *err)
{
    const uint8_t *body;
    size_t size, at = r->pos;
    enum hg_status status;
    while ((status = hg_state_record_next(r, &body, &size)) == HG_OK) {
        status = take(user, body, size);
        if (status)
            return hg_error_set(err, status, f->path, NULL,
                "--state-dir: the record at byte %zu of %s: %s", at, log_name,
                hg_status_text(status));
        at = r->pos;
    }
    f->bytes = r->pos;
    return status == HG_E_AGAIN ? HG_OK : cut_tail(f, r, err);
}

static enum hg_status read_bytes(struct hg_state_folder *f, struct hg_reader *r,
    hg_state_take *take, void *user, struct hg_error *err)
{
    enum hg_status status = hg_state_header_decode(r);
    if (status == HG_E_TRUNCATED) { // not even the header
        status = cut_tail(f, r, err);
        return status ? status : make_log(f, err);
    }
    if (status)
        return hg_error_set(err, status, f->path, NULL,
            "--state-dir: %s is %s; move it away to begin with nothing", log_name,
            status == HG_E_VERSION ? "of another version of heliod" : "no state log");
    return read_records(f, r, take, user, err);
}

static enum hg_status read_log(
    struct hg_state_folder *f, hg_state_take *take, void *user, struct hg_error *err)
{
    struct stat st;
    unlinkat(f->folder_fd, new_name, 0); // of a rewrite that did not end
    f->log_fd = openat(f->folder_fd, log_name, O_RDWR | O_CLOEXEC | O_NOFOLLOW);
    if (f->log_fd < 0)
        return errno == ENOENT ? make_log(f, err) : fail_errno(f, "open the log", err);
    if (fstat(f->log_fd, &st) != 0)
        return fail_errno(f, "look at the log", err);
    size_t size = (size_t)st.st_size;
    void *data = size ? mmap(NULL, size, PROT_READ, MAP_PRIVATE, f->log_fd, 0) : NULL;
    if (data == MAP_FAILED)
        return fail_errno(f, "read the log", err);
    struct hg_reader r = hg_reader_make(data ? data : log_name, size);
    enum hg_status status = read_bytes(f, &r, take, user, err);
    if (data)
        munmap(data, size);
    if (!status && lseek(f->log_fd, 0, SEEK_END) < 0)
        status = fail_errno(f, "read the log", err);
    return status;
}

enum hg_status hg_state_folder_open(const char *path, hg_state_take *take, void *user,
    struct hg_state_folder *out, struct hg_error *err)
{
    *out = (struct hg_state_folder){.path = path, .folder_fd = -1, .lock_fd = -1, .log_fd = -1};
    enum hg_status status = lock_folder(out, err);
    if (!status)
        status = read_log(out, take, user, err);
    if (status)
        hg_state_folder_close(out);
    return status;
}

void hg_state_folder_close(struct hg_state_folder *f)
{
    int *fds[] = {&f->log_fd, &f->folder_fd, &f->lock_fd};
    for (size_t i = 0; i < sizeof fds / sizeof *fds; i++) {
        if (*fds[i] >= 0)
            close(*fds[i]);
        *fds[i] = -1;
    }
}
