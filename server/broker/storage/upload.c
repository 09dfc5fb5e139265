#include "server/broker/storage/upload.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/sha256.h"

// Of the thread, until the last job of the upload is done.
struct disk {
    int fd, folder_fd; // -1: not open
    bool made;         // there is a file that is still to be named or removed
    struct hg_sha256 *hasher;
    struct hg_error err; // the first
};

struct hg_upload {
    struct hg_disk_job end; // the last one of it
    struct hg_upload_store *store;
    struct hg_upload_file file;
    uint8_t hash[32];
    uint64_t total, offset, unwritten;
    uint64_t progress_ns; // when it began, or the last piece was stored
    uint32_t session, request;
    bool ends, committed, synced;
    struct disk disk;
};

struct piece {
    struct hg_disk_job job;
    struct hg_upload *upload;
    struct hg_upload_piece data;
    enum hg_status status; // of this one, if none before it failed
};

// ---- in the thread ------------------------------------------------------------------------------

static void fail_errno(struct hg_upload *u, const char *action)
{
    const int e = errno;
    hg_error_set(&u->disk.err, hg_status_from_errno(e), "upload", NULL, "cannot %s: %s", action,
        strerror(e));
}

static void open_file(struct hg_upload *u)
{
    char path[HG_UPLOAD_PATH];
    hg_upload_folder_incoming(hg_upload_store_folder(u->store), u->file.number, path);
    u->disk.fd = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
    u->disk.made = u->disk.fd >= 0;
    if (u->disk.fd < 0)
        fail_errno(u, "create the file");
}

static void write_piece(struct hg_upload *u, const struct hg_upload_piece *piece)
{
    const uint8_t *data = piece->data;
    for (size_t done = 0; done < piece->size;) {
        const ssize_t n = write(u->disk.fd, data + done, piece->size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0) {
            fail_errno(u, "store the content");
            return;
        }
        done += (size_t)n;
    }
    hg_sha256_update(u->disk.hasher, data, piece->size);
}

static void run_piece(struct hg_disk_job *job)
{
    struct piece *piece = (struct piece *)job;
    struct hg_upload *u = piece->upload;
    if (u->disk.err.status)
        return;
    if (u->disk.fd < 0)
        open_file(u);
    if (!u->disk.err.status)
        write_piece(u, &piece->data);
    piece->status = u->disk.err.status;
}

static void verify(struct hg_upload *u)
{
    uint8_t digest[32];
    char hex[HG_SHA256_HEX];
    hg_sha256_end(u->disk.hasher, digest);
    u->disk.hasher = NULL;
    if (memcmp(digest, u->hash, 32) == 0)
        return;
    hg_sha256_hex(digest, hex);
    hg_error_set(
        &u->disk.err, HG_E_HASH, "upload", "hash", "the bytes that came have the hash %s", hex);
}

// What is synced is what bears the name, which may be what another session has sent meanwhile.
static void open_synced(struct hg_upload *u, const char *path)
{
    struct hg_upload_folder *folder = hg_upload_store_folder(u->store);
    close(u->disk.fd);
    u->disk.fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    u->disk.folder_fd = open(folder->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (u->disk.fd < 0 || u->disk.folder_fd < 0)
        fail_errno(u, "open the content to sync it");
}

// A link, which unlike a rename leaves a content that is there already as it is: others have links
// to it. On failure there is what was there before.
static void name_content(struct hg_upload *u)
{
    struct hg_upload_folder *folder = hg_upload_store_folder(u->store);
    char from[HG_UPLOAD_PATH], to[HG_UPLOAD_PATH];
    hg_upload_folder_incoming(folder, u->file.number, from);
    hg_upload_folder_content(folder, u->hash, to);
    const bool named = fchmod(u->disk.fd, 0400) == 0 && link(from, to) == 0;
    if (!named && errno != EEXIST) {
        fail_errno(u, "name the content");
        return;
    }
    const enum hg_status status =
        hg_upload_folder_link(folder, hg_upload_owner_place(u->file.owner), u->hash);
    if (status)
        hg_error_set(&u->disk.err, status, "upload", NULL,
            "the content cannot be kept for its tenant: %s", hg_status_text(status));
    else if (u->synced)
        open_synced(u, to);
    if (u->disk.err.status && named) {
        if (!status)
            hg_upload_folder_unlink(folder, hg_upload_owner_place(u->file.owner), u->hash);
        unlink(to);
    }
}

static void run_end(struct hg_disk_job *job)
{
    struct hg_upload *u = (struct hg_upload *)job;
    char path[HG_UPLOAD_PATH];
    uint8_t digest[32];
    if (u->committed && !u->disk.err.status)
        verify(u);
    if (u->committed && !u->disk.err.status)
        name_content(u);
    if (u->disk.hasher)
        hg_sha256_end(u->disk.hasher, digest);
    if (u->disk.made) {
        hg_upload_folder_incoming(hg_upload_store_folder(u->store), u->file.number, path);
        unlink(path);
    }
    if (u->disk.fd >= 0 && (!u->synced || u->disk.err.status)) {
        close(u->disk.fd);
        u->disk.fd = -1;
    }
}

// ---- in the loop --------------------------------------------------------------------------------

static void end_piece(struct hg_disk_job *job)
{
    struct piece *piece = (struct piece *)job;
    struct hg_upload *u = piece->upload;
    const struct hg_upload_news *news = hg_upload_store_news(u->store);
    u->unwritten -= piece->data.size;
    u->progress_ns = hg_clock_now_ns();
    if (news->written)
        news->written(news->user, piece->data.size);
    if (piece->status && !u->ends) { // else it is told at the end, or its session has ended
        const struct hg_error err = u->disk.err;
        if (news->failed)
            news->failed(news->user, u, piece->data.request, &err);
    }
    hg_packet_unref(piece->data.packet);
    hg_free(piece);
}

static void end_upload(struct hg_disk_job *job)
{
    struct hg_upload *u = (struct hg_upload *)job;
    const struct hg_upload_news *news = hg_upload_store_news(u->store);
    struct hg_error err = u->disk.err;
    if (u->committed)
        hg_upload_store_adopt(u->store, &u->file, u->hash, &err);
    hg_upload_store_close(u->store, &u->file);
    if (u->committed && news->ended)
        news->ended(news->user, u, &err);
    if (u->disk.fd >= 0)
        close(u->disk.fd);
    if (u->disk.folder_fd >= 0)
        close(u->disk.folder_fd);
    hg_free(u);
}

enum hg_status hg_upload_begin(struct hg_upload_store *store, struct hg_upload_owner *owner,
    const uint8_t hash[32], uint64_t total_bytes, struct hg_upload **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_upload *upload = hg_calloc(1, sizeof *upload);
    struct hg_sha256 *hasher = upload ? hg_sha256_create() : NULL;
    enum hg_status status =
        hasher ? hg_upload_store_open(store, owner, total_bytes, &upload->file, err)
               : hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory");
    if (status) {
        uint8_t digest[32];
        if (hasher)
            hg_sha256_end(hasher, digest);
        hg_free(upload);
        return status;
    }
    upload->end = (struct hg_disk_job){.run = run_end, .done = end_upload};
    upload->store = store;
    upload->disk = (struct disk){.fd = -1, .folder_fd = -1, .hasher = hasher};
    upload->total = total_bytes;
    upload->progress_ns = hg_clock_now_ns();
    memcpy(upload->hash, hash, 32);
    *out = upload;
    return HG_OK;
}

uint64_t hg_upload_progress_ns(const struct hg_upload *upload)
{
    return upload->progress_ns;
}

const uint8_t *hg_upload_hash(const struct hg_upload *upload)
{
    return upload->hash;
}

uint64_t hg_upload_offset(const struct hg_upload *upload)
{
    return upload->offset;
}

uint64_t hg_upload_total(const struct hg_upload *upload)
{
    return upload->total;
}

uint64_t hg_upload_unwritten(const struct hg_upload *upload)
{
    return upload->unwritten;
}

enum hg_status hg_upload_append(
    struct hg_upload *upload, const struct hg_upload_piece *data, struct hg_error *err)
{
    if (!hg_range_ok(upload->offset, data->size, upload->total))
        return hg_error_set(
            err, HG_E_LIMIT, "upload", "data", "more bytes than the announced total");
    enum hg_status status = hg_upload_store_grow(upload->store, &upload->file, data->size, err);
    struct piece *piece = status ? NULL : hg_calloc(1, sizeof *piece);
    if (!piece)
        return status ? status : hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory");
    *piece = (struct piece){{.run = run_piece, .done = end_piece}, upload, *data, HG_OK};
    if (data->packet)
        hg_packet_ref(data->packet);
    upload->offset += data->size;
    upload->unwritten += data->size;
    upload->progress_ns = hg_clock_now_ns();
    hg_disk_queue_push(hg_upload_store_queue(upload->store), &piece->job);
    return HG_OK;
}

enum hg_status hg_upload_commit(
    struct hg_upload *upload, uint32_t request, bool synced, struct hg_error *err)
{
    if (hg_upload_store_expect(upload->store, &upload->file, upload->hash)) {
        hg_upload_abort(upload);
        return hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory");
    }
    upload->ends = upload->committed = true;
    upload->synced = synced;
    upload->request = request;
    hg_disk_queue_push(hg_upload_store_queue(upload->store), &upload->end);
    return HG_OK;
}

bool hg_upload_is_committed(const struct hg_upload *upload)
{
    return upload->committed;
}

void hg_upload_set_session(struct hg_upload *upload, uint32_t session)
{
    upload->session = session;
}

uint32_t hg_upload_session(const struct hg_upload *upload)
{
    return upload->session;
}

uint32_t hg_upload_request(const struct hg_upload *upload)
{
    return upload->request;
}

void hg_upload_take_files(struct hg_upload *upload, int *content_fd, int *folder_fd)
{
    *content_fd = upload->disk.fd;
    *folder_fd = upload->disk.folder_fd;
    upload->disk.fd = upload->disk.folder_fd = -1;
}

void hg_upload_abort(struct hg_upload *upload)
{
    if (!upload)
        return;
    upload->ends = true;
    hg_disk_queue_push(hg_upload_store_queue(upload->store), &upload->end);
}
