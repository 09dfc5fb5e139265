// upload.c - contents by hash: ask what the server has, send the rest in pieces.
#include <string.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/sha256.h"
#include "client/lib/conn.h"

#define FILE_BYTES_MAX (UINT64_C(1) << 32)

enum { PIECE_BYTES = 1024 * 1024, QUERY_CONTENTS = 1024 };

static enum hg_status hash_file(struct helio_file *file, struct hg_error *err)
{
    uint8_t *data;
    size_t size;
    enum hg_status status = hg_file_read(file->path, FILE_BYTES_MAX, &data, &size, err);
    if (status)
        return status;
    status = hg_sha256(data, size, file->hash);
    hg_free(data);
    return status ? hg_error_set(err, status, file->path, NULL, "no memory to hash it") : HG_OK;
}

// have[i] for files[first .. first + count).
static enum hg_status query(struct helio *h, const struct helio_file *files, uint32_t count,
    bool *have, struct hg_error *err)
{
    struct hgp_content *contents = hg_calloc(count, sizeof *contents);
    if (!contents)
        return hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory for the list of files");
    for (uint32_t i = 0; i < count; i++)
        memcpy(contents[i].hash, files[i].hash, sizeof contents[i].hash);
    struct hgp_upload_query ask = {.contents = {contents, count}};
    struct helio_message *answer;
    enum hg_status status =
        helio_call_for(h, HGP_T_upload_query, &ask, HGP_T_upload_have, &answer, err);
    hg_free(contents);
    if (status)
        return status;
    const struct hgp_upload_have *got = &answer->body->upload_have;
    if (got->have.count != count)
        status = hg_error_set(err, HG_E_FORMAT, "upload_have", "have", "%u answers for %u contents",
            got->have.count, count);
    for (uint32_t i = 0; !status && i < count; i++)
        have[i] = got->have.items[i].value;
    helio_message_free(answer);
    return status;
}

// Queues one piece, waiting while too much is in flight. The last piece requests an answer.
static enum hg_status send_piece(
    struct helio *h, const struct hgp_upload *piece, struct hg_error *err)
{
    if (piece->offset + piece->data.size == piece->total)
        return helio_call_for(h, HGP_T_upload, piece, HGP_T_ok, NULL, err);
    enum hg_status status;
    while ((status = helio_send(h, HGP_T_upload, piece, NULL, err)) == HG_E_AGAIN) {
        status = helio_wait(h, h->timeout_ns, err);
        if (status)
            return status;
    }
    return status;
}

static enum hg_status send_file(
    struct helio *h, const struct helio_file *file, uint64_t *sent, struct hg_error *err)
{
    uint8_t *data, digest[HG_SHA256_BYTES];
    size_t size;
    enum hg_status status = hg_file_read(file->path, FILE_BYTES_MAX, &data, &size, err);
    if (status)
        return status;
    status = hg_sha256(data, size, digest);
    if (!status && memcmp(digest, file->hash, sizeof digest) != 0)
        status =
            hg_error_set(err, HG_E_HASH, file->path, NULL, "the file changed while it was sent");
    // A message must stay below what the server takes, header fields included.
    uint32_t limit =
        h->server.send_limit > 2048 ? h->server.send_limit - 1024 : h->server.send_limit / 2;
    uint32_t piece_bytes = limit < PIECE_BYTES ? limit : PIECE_BYTES;
    size_t at = 0;
    do {
        size_t left = size - at, n = left < piece_bytes ? left : piece_bytes;
        struct hgp_upload piece = {.total = size, .offset = at, .data = {data + at, (uint32_t)n}};
        memcpy(piece.hash, file->hash, sizeof piece.hash);
        if (!status)
            status = send_piece(h, &piece, err);
        at += n;
    } while (!status && at < size);
    *sent += status ? 0 : size;
    hg_free(data);
    return status;
}

enum hg_status helio_upload(struct helio *h, struct helio_file *files, uint32_t count,
    uint64_t *sent_bytes, struct hg_error *err)
{
    uint64_t sent = 0;
    enum hg_status status = HG_OK;
    bool *have = hg_calloc(count, sizeof *have);
    if (sent_bytes)
        *sent_bytes = 0;
    if (!have)
        return hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory for the list of files");
    for (uint32_t i = 0; !status && i < count; i++)
        status = hash_file(&files[i], err);
    for (uint32_t i = 0; !status && i < count; i += QUERY_CONTENTS)
        status = query(
            h, files + i, count - i < QUERY_CONTENTS ? count - i : QUERY_CONTENTS, have + i, err);
    for (uint32_t i = 0; !status && i < count; i++) {
        bool again = have[i];
        for (uint32_t k = 0; k < i && !again; k++) // two names for one content
            again = memcmp(files[k].hash, files[i].hash, sizeof files[i].hash) == 0;
        if (!again)
            status = send_file(h, &files[i], &sent, err);
    }
    if (sent_bytes)
        *sent_bytes = sent;
    hg_free(have);
    return status;
}
