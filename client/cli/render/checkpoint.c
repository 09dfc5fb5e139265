// checkpoint.c - films on the way to a picture, and what the next one needs, kept beside it.
//
// The file: "HGCK", u32 version, u32 kind, the job's hash, the SHA-256 of the data, u32 samples,
// u32 samples of the whole picture, u64 size, the data. It goes over the wire in parts, so no
// message limits how large it is.
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/file.h"
#include "base/sha256.h"
#include "client/cli/render/render.h"

enum { VERSION = 3, HEADER_BYTES = 4 + 4 + 4 + 32 + 32 + 4 + 4 + 8, PART_BYTES = 256 << 10 };

#define DATA_LIMIT_BYTES (UINT64_C(16) << 30)

static const char magic[4] = {'H', 'G', 'C', 'K'};

static bool name_of(enum hgp_checkpoint_kind kind, const char *output, char *dst, size_t size)
{
    const char *end = kind == HGP_checkpoint_kind_HISTORY ? "history" : "checkpoint";
    return (size_t)snprintf(dst, size, "%s.%s", output, end) < size;
}

// ---- saving ------------------------------------------------------------------------------------

// Header and data, all or nothing.
static enum hg_status write_both(const char *path, const struct hg_writer *head,
    const struct hg_writer *data, struct hg_error *err)
{
    struct hg_file_out out;
    enum hg_status status = hg_file_begin(&out, path, err);
    if (status)
        return status;
    status = hg_file_write(&out, head->data, head->size, err);
    if (status)
        goto fail;
    status = hg_file_write(&out, data->data, data->size, err);
    if (status)
        goto fail;
    return hg_file_commit(&out, err);
fail:
    hg_file_abort(&out);
    return status;
}

static enum hg_status write_file(const char *path, const struct hg_cli_kept *kept, uint32_t samples,
    const struct hg_writer *data, struct hg_error *err)
{
    struct hg_writer head = {0};
    uint8_t hash[32];
    enum hg_status status = hg_sha256(data->data, data->size, hash);
    if (status)
        return hg_error_set(err, status, path, NULL, "no memory");
    hg_write_bytes(&head, magic, sizeof magic);
    hg_write_u32(&head, VERSION);
    hg_write_u32(&head, (uint32_t)kept->kind);
    hg_write_bytes(&head, kept->job, 32);
    hg_write_bytes(&head, hash, sizeof hash);
    hg_write_u32(&head, samples);
    hg_write_u32(&head, kept->total);
    hg_write_u64(&head, data->size);
    status = head.failed ? hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory")
                         : write_both(path, &head, data, err);
    hg_writer_finish(&head);
    return status;
}

// One more part of the data; *size: of all of it.
static enum hg_status fetch_part(const struct hg_cli_kept *kept, struct hg_writer *data,
    uint32_t *samples, uint64_t *size, struct hg_error *err)
{
    struct helio_message *answer;
    const struct hgp_checkpoint_query query = {.view = HG_CLI_VIEW,
        .has_kind = true,
        .kind = kept->kind,
        .has_offset = true,
        .offset = data->size};
    enum hg_status status = helio_call_for(
        kept->cli->h, HGP_T_checkpoint_query, &query, HGP_T_checkpoint, &answer, err);
    if (status)
        return status;
    const struct hgp_checkpoint *c = &answer->body->checkpoint;
    *samples = c->samples;
    *size = c->has_size ? c->size : c->data.size;
    // Of another state than the reported frame key: not kept.
    if (memcmp(c->job, kept->job, 32) != 0)
        status =
            hg_error_set(err, HG_E_STATE, kept->output, NULL, "the view has changed meanwhile");
    else if (!c->data.size || *size > DATA_LIMIT_BYTES || c->data.size > *size - data->size)
        status = hg_error_set(err, HG_E_FORMAT, "checkpoint", "size", "parts do not fit together");
    if (!status) {
        hg_write_bytes(data, c->data.data, c->data.size);
        if (data->failed)
            status = hg_error_set(err, HG_E_NOMEM, kept->output, NULL, "no memory to keep it");
    }
    helio_message_free(answer);
    return status;
}

enum hg_status hg_cli_checkpoint_save(
    const struct hg_cli_kept *kept, double seconds, uint32_t *samples, struct hg_error *err)
{
    char path[4200];
    struct hg_writer data = {0};
    struct hg_cli *cli = kept->cli;
    uint64_t size = 1;
    *samples = 0;
    if (!name_of(kept->kind, kept->output, path, sizeof path))
        return hg_error_set(err, HG_E_INVAL, kept->output, NULL, "the name is too long");
    uint64_t usual =
        cli->options->has_timeout ? (uint64_t)(cli->options->timeout * 1e9) : HELIO_NO_TIMEOUT;
    helio_set_timeout(cli->h, (uint64_t)(seconds * 1e9));
    enum hg_status status = HG_OK;
    while (!status && data.size < size)
        status = fetch_part(kept, &data, samples, &size, err);
    helio_set_timeout(cli->h, usual);
    if (status)
        goto done;
    status = *samples < kept->least ? hg_error_set(err, HG_E_STATE, kept->output, NULL,
                                          "no more samples than in the file")
                                    : write_file(path, kept, *samples, &data, err);
done:
    hg_writer_finish(&data);
    return status;
}

// ---- loading -----------------------------------------------------------------------------------

// What is wrong with the header, or NULL.
static const char *read_head(const uint8_t *file, size_t size, enum hgp_checkpoint_kind kind,
    struct hg_cli_checkpoint_head *out)
{
    struct hg_reader r = hg_reader_make(file, size);
    const uint8_t *start = hg_read_bytes(&r, sizeof magic);
    const uint32_t version = hg_read_u32(&r);
    out->kind = (enum hgp_checkpoint_kind)hg_read_u32(&r);
    const uint8_t *job = hg_read_bytes(&r, 32), *hash = hg_read_bytes(&r, 32);
    out->samples = hg_read_u32(&r);
    out->total = hg_read_u32(&r);
    out->bytes = hg_read_u64(&r);
    if (r.failed || memcmp(start, magic, sizeof magic) != 0)
        return "is not a checkpoint";
    memcpy(out->job, job, sizeof out->job);
    memcpy(out->hash, hash, sizeof out->hash);
    return version != VERSION || out->kind != kind ? "is of another version" : NULL;
}

// What is wrong with a file, or NULL. Its data follow the header.
static const char *check_file(
    const uint8_t *file, size_t size, const struct hg_cli_kept *kept, uint32_t *samples)
{
    struct hg_cli_checkpoint_head head;
    uint8_t seen[32];
    const char *wrong = read_head(file, size, kept->kind, &head);
    if (wrong)
        return wrong;
    *samples = head.samples;
    if (memcmp(head.job, kept->job, 32) != 0)
        return "is of another picture";
    if (!head.bytes || head.bytes != size - HEADER_BYTES)
        return "is cut short";
    if (hg_sha256(file + HEADER_BYTES, (size_t)head.bytes, seen) ||
        memcmp(seen, head.hash, sizeof seen) != 0)
        return "is damaged";
    return NULL;
}

bool hg_cli_checkpoint_look(
    enum hgp_checkpoint_kind kind, const char *output, struct hg_cli_checkpoint_head *out)
{
    char path[4200];
    uint8_t head[HEADER_BYTES];
    FILE *file = name_of(kind, output, path, sizeof path) ? fopen(path, "rb") : NULL;
    const size_t size = file ? fread(head, 1, sizeof head, file) : 0;
    if (file)
        fclose(file);
    return size == sizeof head && read_head(head, size, kind, out) == NULL;
}

static enum hg_status send_parts(
    const struct hg_cli_kept *kept, const uint8_t *data, size_t size, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (size_t at = 0; !status && at < size; at += PART_BYTES) {
        const size_t bytes = size - at < PART_BYTES ? size - at : PART_BYTES;
        const struct hgp_checkpoint_set set = {.view = HG_CLI_VIEW,
            .data = {data + at, (uint32_t)bytes},
            .has_kind = true,
            .kind = kept->kind,
            .has_offset = true,
            .offset = at,
            .has_size = true,
            .size = size};
        status = helio_call_for(kept->cli->h, HGP_T_checkpoint_set, &set, HGP_T_ok, NULL, err);
    }
    return status;
}

enum hg_status hg_cli_checkpoint_load(
    const struct hg_cli_kept *kept, uint32_t *samples, struct hg_error *err)
{
    char path[4200];
    uint8_t *file;
    size_t size;
    *samples = 0;
    if (!name_of(kept->kind, kept->output, path, sizeof path))
        return HG_OK; // no file of that name
    enum hg_status status = hg_file_read(path, DATA_LIMIT_BYTES + HEADER_BYTES, &file, &size, err);
    if (status == HG_E_NOTFOUND)
        return HG_OK;
    if (status)
        return status;
    const char *wrong = check_file(file, size, kept, samples);
    struct hg_error refused = {0};
    if (!wrong) {
        status = send_parts(kept, file + HEADER_BYTES, size - HEADER_BYTES, &refused);
        if (status == HG_E_INVAL || status == HG_E_FORMAT) {
            wrong = refused.reason;
            status = HG_OK;
        } else if (status && err) {
            *err = refused;
        }
    }
    if (wrong) {
        *samples = 0;
        hg_cli_progress_say(
            &kept->cli->progress, "%s: %s; the film starts at sample 0", path, wrong);
    }
    hg_free(file);
    return status;
}

void hg_cli_checkpoint_remove(enum hgp_checkpoint_kind kind, const char *output)
{
    char path[4200];
    if (name_of(kind, output, path, sizeof path))
        unlink(path);
}
