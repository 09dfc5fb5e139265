#include "server/broker/upload.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/sha256.h"

struct hg_upload {
    struct hg_upload_store *store;
    struct hg_upload_file file;
    struct hg_sha256 *hasher;
    uint8_t hash[32];
    uint64_t total, offset;
    uint64_t progress_ns; // when it began, or the last piece came
};

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
    upload->store = store;
    upload->hasher = hasher;
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

enum hg_status hg_upload_append(
    struct hg_upload *upload, const void *data, size_t size, struct hg_error *err)
{
    if (!hg_range_ok(upload->offset, size, upload->total))
        return hg_error_set(
            err, HG_E_LIMIT, "upload", "data", "more bytes than the announced total");
    enum hg_status status = hg_upload_store_grow(upload->store, &upload->file, size, err);
    if (status)
        return status;
    upload->progress_ns = hg_clock_now_ns();
    for (size_t done = 0; done < size;) {
        ssize_t n = write(upload->file.fd, (const uint8_t *)data + done, size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0) {
            int e = errno;
            return hg_error_set(err, hg_status_from_errno(e), "upload", NULL,
                "cannot store the content: %s", strerror(e));
        }
        done += (size_t)n;
    }
    hg_sha256_update(upload->hasher, data, size);
    upload->offset += size;
    return HG_OK;
}

int hg_upload_dup(const struct hg_upload *upload)
{
    return fcntl(upload->file.fd, F_DUPFD_CLOEXEC, 0);
}

static enum hg_status verify(struct hg_upload *upload, struct hg_error *err)
{
    uint8_t digest[32];
    hg_sha256_end(upload->hasher, digest);
    upload->hasher = NULL;
    if (memcmp(digest, upload->hash, 32) == 0)
        return HG_OK;
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(digest, hex);
    return hg_error_set(
        err, HG_E_HASH, "upload", "hash", "the bytes that came have the hash %s", hex);
}

enum hg_status hg_upload_commit(struct hg_upload *upload, struct hg_error *err)
{
    enum hg_status status = verify(upload, err);
    if (!status)
        status = hg_upload_store_adopt(upload->store, &upload->file, upload->hash, err);
    hg_upload_abort(upload);
    return status;
}

void hg_upload_abort(struct hg_upload *upload)
{
    if (!upload)
        return;
    uint8_t digest[32];
    if (upload->hasher)
        hg_sha256_end(upload->hasher, digest);
    hg_upload_store_close(upload->store, &upload->file);
    hg_free(upload);
}
