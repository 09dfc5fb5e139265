// reader.c - see reader.h: files are opened and checked here, decoded in row_reader.c or ktx2/.
#include "renderer/image/reader.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/sha256.h"
#include "renderer/image/check.h"
#include "renderer/image/ktx2/ktx2.h"
#include "renderer/image/row_reader.h"

enum { HEAD_BYTES = 1 << 20 }; // of a file, in which its header has to lie

struct hg_image_reader {
    char *path; // NULL: bytes
    FILE *file; // NULL: bytes, or it sleeps
    struct stat stat;
    uint32_t max_side_px;
    struct hg_image_bytes bytes; // name: for messages while the reader is opened
    struct hg_row_reader *inner; // one of two; none while it sleeps
    struct hg_ktx2_reader *ktx2;
    struct hg_image_reader_info info;
};

static enum hg_status fail_errno(const char *path, const char *action, struct hg_error *err)
{
    const int e = errno;
    return hg_error_set(err, hg_status_from_errno(e), path, NULL, "%s: %s", action, strerror(e));
}

static size_t read_at(int fd, uint64_t offset, void *dst, size_t size)
{
    size_t done = 0;
    while (done < size) {
        const ssize_t n = pread(fd, (uint8_t *)dst + done, size - done, (off_t)(offset + done));
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            break;
        done += (size_t)n;
    }
    return done;
}

// As hg_check_png, without holding the file.
static enum hg_status check_png_file(int fd, uint64_t size, const char *path, struct hg_error *err)
{
    for (uint64_t at = 8; at < size;) {
        uint8_t chunk[8];
        if (size - at < 12 || read_at(fd, at, chunk, 8) != 8)
            return hg_error_set(err, HG_E_FORMAT, path, NULL, "the PNG ends inside a chunk");
        const uint32_t length = (uint32_t)chunk[0] << 24 | (uint32_t)chunk[1] << 16 |
                                (uint32_t)chunk[2] << 8 | chunk[3];
        if (length > size - at - 12)
            return hg_error_set(
                err, HG_E_FORMAT, path, NULL, "a PNG chunk runs past the end of the file");
        if (memcmp(chunk + 4, "IEND", 4) == 0)
            return HG_OK;
        at += 12 + (uint64_t)length;
    }
    return hg_error_set(err, HG_E_FORMAT, path, NULL, "the PNG has no end chunk");
}

static enum hg_status check_head(struct hg_image_reader *r, const char *path, uint8_t *head,
    const char **format, struct hg_error *err)
{
    const int fd = fileno(r->file);
    const size_t size = read_at(fd, 0, head, HEAD_BYTES);
    enum hg_status status = hg_image_sniff(head, size, path, format, err);
    if (status != HG_OK)
        return status;
    return strcmp(*format, "png") == 0 ? check_png_file(fd, (uint64_t)r->stat.st_size, path, err)
                                       : hg_check_bytes(*format, head, size, path, err);
}

static enum hg_status open_file(
    const char *path, FILE **file, struct stat *st, struct hg_error *err)
{
    *file = NULL;
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return fail_errno(path, "cannot open", err);
    if (fstat(fd, st) != 0 || !S_ISREG(st->st_mode)) {
        close(fd);
        return hg_error_set(err, HG_E_IO, path, NULL, "not a regular file");
    }
    *file = fdopen(fd, "rb");
    if (*file != NULL)
        return HG_OK;
    close(fd);
    return hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory for the file");
}

static enum hg_status open_decoder(
    struct hg_image_reader *r, const char *format, struct hg_error *err)
{
    if (strcmp(format, "ktx2") == 0)
        return hg_ktx2_reader_open(r->file, &r->bytes, r->max_side_px, &r->ktx2, err);
    return hg_row_reader_open(r->file, &r->bytes, format, r->max_side_px, &r->inner, err);
}

static void close_decoder(struct hg_image_reader *r)
{
    hg_row_reader_close(r->inner);
    hg_ktx2_reader_close(r->ktx2);
    r->inner = NULL;
    r->ktx2 = NULL;
}

static enum hg_status open_first(
    struct hg_image_reader *r, const char *format, struct hg_error *err)
{
    const enum hg_status status = open_decoder(r, format, err);
    if (status != HG_OK)
        return status;
    r->info = r->ktx2 != NULL ? *hg_ktx2_reader_info(r->ktx2) : *hg_row_reader_info(r->inner);
    r->info.file_bytes = r->bytes.size;
    if (r->file != NULL) {
        r->info.file_bytes = (uint64_t)r->stat.st_size;
        r->info.file_time_ns =
            (uint64_t)r->stat.st_mtim.tv_sec * 1000000000u + (uint64_t)r->stat.st_mtim.tv_nsec;
        r->info.file_id = r->stat.st_ino;
        r->info.device_id = r->stat.st_dev;
    }
    return HG_OK;
}

enum hg_status hg_image_reader_open(
    const char *path, uint32_t max_side_px, struct hg_image_reader **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_image_reader *r = hg_calloc(1, sizeof *r);
    uint8_t *head = hg_calloc(HEAD_BYTES, 1);
    const char *format;
    enum hg_status status = HG_OK;
    if (r == NULL || head == NULL || (r->path = hg_strdup(path)) == NULL) {
        status = hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory for the file");
    } else {
        r->max_side_px = max_side_px;
        r->bytes.name = r->path;
        status = open_file(path, &r->file, &r->stat, err);
    }
    if (status == HG_OK)
        status = check_head(r, path, head, &format, err);
    if (status == HG_OK)
        status = open_first(r, format, err);
    hg_free(head);
    if (status == HG_OK)
        *out = r;
    else
        hg_image_reader_close(r);
    return status;
}

enum hg_status hg_image_reader_open_memory(const struct hg_image_bytes *file, uint32_t max_side_px,
    struct hg_image_reader **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_image_reader *r = hg_calloc(1, sizeof *r);
    if (r == NULL)
        return hg_error_set(err, HG_E_NOMEM, file->name, NULL, "no memory for the file");
    r->bytes = *file;
    r->max_side_px = max_side_px;
    const char *format;
    enum hg_status status = hg_image_sniff(file->data, file->size, file->name, &format, err);
    if (status == HG_OK)
        status = hg_check_bytes(format, file->data, file->size, file->name, err);
    if (status == HG_OK)
        status = open_first(r, format, err);
    if (status == HG_OK)
        *out = r;
    else
        hg_image_reader_close(r);
    return status;
}

void hg_image_reader_close(struct hg_image_reader *reader)
{
    if (reader == NULL)
        return;
    hg_image_reader_sleep(reader);
    close_decoder(reader);
    hg_free(reader->path);
    hg_free(reader);
}

const struct hg_image_reader_info *hg_image_reader_info(const struct hg_image_reader *reader)
{
    return &reader->info;
}

static bool same_stat(const struct stat *a, const struct stat *b)
{
    return a->st_size == b->st_size && a->st_mtim.tv_sec == b->st_mtim.tv_sec &&
           a->st_mtim.tv_nsec == b->st_mtim.tv_nsec && a->st_ino == b->st_ino &&
           a->st_dev == b->st_dev;
}

bool hg_image_reader_is_unchanged(const struct hg_image_reader *r)
{
    struct stat now;
    if (r->path == NULL)
        return true;
    const int failed = r->file != NULL ? fstat(fileno(r->file), &now) : stat(r->path, &now);
    return failed == 0 && same_stat(&now, &r->stat);
}

bool hg_image_reader_can_sleep(const struct hg_image_reader *r)
{
    return r->path != NULL;
}

void hg_image_reader_sleep(struct hg_image_reader *r)
{
    if (r->path == NULL || r->file == NULL)
        return;
    close_decoder(r);
    fclose(r->file);
    r->file = NULL;
}

enum hg_status hg_image_reader_wake(struct hg_image_reader *r, struct hg_error *err)
{
    struct stat now;
    if (r->path == NULL || r->file != NULL)
        return HG_OK;
    enum hg_status status = open_file(r->path, &r->file, &now, err);
    if (status == HG_OK && !same_stat(&now, &r->stat))
        status =
            hg_error_set(err, HG_E_HASH, r->path, NULL, "the file is not the one that was opened");
    if (status == HG_OK)
        status = open_decoder(r, r->info.file_format, err);
    if (status != HG_OK && r->file != NULL) {
        fclose(r->file);
        r->file = NULL;
    }
    return status;
}

static enum hg_status hash_file(
    const struct hg_image_reader *r, struct hg_sha256 *h, struct hg_error *err)
{
    uint8_t *block = hg_calloc(HEAD_BYTES, 1);
    if (block == NULL)
        return hg_error_set(err, HG_E_NOMEM, "image", NULL, "no memory to hash the file");
    uint64_t at = 0;
    for (size_t n; (n = read_at(fileno(r->file), at, block, HEAD_BYTES)) > 0; at += n)
        hg_sha256_update(h, block, n);
    hg_free(block);
    return at == r->info.file_bytes
               ? HG_OK
               : hg_error_set(err, HG_E_IO, "image", NULL, "the file changed while it was read");
}

enum hg_status hg_image_reader_hash(
    struct hg_image_reader *reader, uint8_t digest[HG_SHA256_BYTES], struct hg_error *err)
{
    memset(digest, 0, HG_SHA256_BYTES);
    struct hg_sha256 *h = hg_sha256_create();
    if (h == NULL)
        return hg_error_set(err, HG_E_NOMEM, "image", NULL, "no memory to hash the file");
    enum hg_status status = HG_OK;
    if (reader->file != NULL)
        status = hash_file(reader, h, err);
    else
        hg_sha256_update(h, reader->bytes.data, reader->bytes.size);
    uint8_t result[HG_SHA256_BYTES];
    hg_sha256_end(h, result);
    if (status == HG_OK)
        memcpy(digest, result, sizeof result);
    return status;
}

enum hg_status hg_image_reader_rows(struct hg_image_reader *reader, enum hg_pixel_format format,
    uint32_t count, void *pixels, struct hg_error *err)
{
    return reader->ktx2 != NULL ? hg_ktx2_reader_rows(reader->ktx2, format, count, pixels, err)
                                : hg_row_reader_rows(reader->inner, format, count, pixels, err);
}

void hg_image_reader_skip(struct hg_image_reader *reader, uint32_t count)
{
    if (reader->ktx2 != NULL)
        hg_ktx2_reader_skip(reader->ktx2, count);
    else
        hg_row_reader_skip(reader->inner, count);
}

enum hg_status hg_image_reader_rect(struct hg_image_reader *reader,
    const struct hg_image_rect *rect, enum hg_pixel_format format, void *pixels, uint64_t *bytes,
    struct hg_error *err)
{
    if (reader->ktx2 != NULL)
        return hg_error_set(err, HG_E_INVAL, "image", NULL, "the file has no tiles");
    return hg_row_reader_rect(reader->inner, rect, format, pixels, bytes, err);
}
