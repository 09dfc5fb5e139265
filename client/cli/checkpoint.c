// checkpoint.c - films on the way to a picture, kept beside it.
//
// The file: "HGCK", u32 version, the job's hash, the SHA-256 of the data, u64 size, the data.
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/file.h"
#include "base/sha256.h"
#include "client/cli/render.h"

enum { VERSION = 1, HEADER_BYTES = 4 + 4 + 32 + 32 + 4 + 8 };

#define DATA_LIMIT_BYTES (UINT64_C(512) << 20) // of a message

static const char magic[4] = {'H', 'G', 'C', 'K'};

static bool name_of(const char *output, char *dst, size_t size)
{
    return (size_t)snprintf(dst, size, "%s.checkpoint", output) < size;
}

static enum hg_status write_file(
    const char *path, const struct hgp_checkpoint *c, const uint8_t job[32], struct hg_error *err)
{
    struct hg_writer head = {0};
    struct hg_file_out out;
    uint8_t hash[32];
    enum hg_status status = hg_sha256(c->data.data, c->data.size, hash);
    if (status)
        return hg_error_set(err, status, path, NULL, "no memory");
    hg_write_bytes(&head, magic, sizeof magic);
    hg_write_u32(&head, VERSION);
    hg_write_bytes(&head, job, 32);
    hg_write_bytes(&head, hash, sizeof hash);
    hg_write_u32(&head, c->samples);
    hg_write_u64(&head, c->data.size);
    status = head.failed ? hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory")
                         : hg_file_begin(&out, path, err);
    if (!status) {
        status = hg_file_write(&out, head.data, head.size, err);
        if (!status)
            status = hg_file_write(&out, c->data.data, c->data.size, err);
        if (status)
            hg_file_abort(&out);
        else
            status = hg_file_commit(&out, err);
    }
    hg_writer_finish(&head);
    return status;
}

enum hg_status hg_cli_checkpoint_save(struct hg_cli *cli, const char *output, const uint8_t job[32],
    double seconds, struct hg_error *err)
{
    char path[4200];
    struct helio_message *answer;
    struct hgp_checkpoint_query query = {.view = HG_CLI_VIEW};
    if (!name_of(output, path, sizeof path))
        return hg_error_set(err, HG_E_INVAL, output, NULL, "the name is too long");
    uint64_t usual =
        cli->options->has_timeout ? (uint64_t)(cli->options->timeout * 1e9) : HELIO_NO_TIMEOUT;
    helio_set_timeout(cli->h, (uint64_t)(seconds * 1e9));
    enum hg_status status =
        helio_call_for(cli->h, HGP_T_checkpoint_query, &query, HGP_T_checkpoint, &answer, err);
    helio_set_timeout(cli->h, usual);
    if (status)
        return status;
    // A film of another state than the one whose hash was told: nothing to keep.
    if (memcmp(answer->body->checkpoint.job, job, 32) != 0)
        status = hg_error_set(err, HG_E_STATE, path, NULL, "the view has changed meanwhile");
    else
        status = write_file(path, &answer->body->checkpoint, job, err);
    helio_message_free(answer);
    return status;
}

// What is wrong with a file, or NULL. *data points into it.
static const char *check_file(const uint8_t *file, size_t size, const uint8_t job[32],
    struct hgp_bytes *data, uint32_t *samples)
{
    struct hg_reader r = hg_reader_make(file, size);
    const uint8_t *start = hg_read_bytes(&r, sizeof magic);
    uint32_t version = hg_read_u32(&r);
    const uint8_t *of = hg_read_bytes(&r, 32), *hash = hg_read_bytes(&r, 32);
    *samples = hg_read_u32(&r);
    uint64_t bytes = hg_read_u64(&r);
    if (r.failed || memcmp(start, magic, sizeof magic) != 0)
        return "is not a checkpoint";
    if (version != VERSION)
        return "is of another version";
    if (memcmp(of, job, 32) != 0)
        return "is of another picture";
    uint8_t seen[32];
    if (bytes != size - HEADER_BYTES)
        return "is cut short";
    *data = (struct hgp_bytes){file + HEADER_BYTES, (uint32_t)bytes};
    if (hg_sha256(data->data, data->size, seen) || memcmp(seen, hash, 32) != 0)
        return "is damaged";
    return NULL;
}

enum hg_status hg_cli_checkpoint_load(struct hg_cli *cli, const char *output, const uint8_t job[32],
    uint32_t *samples, struct hg_error *err)
{
    char path[4200];
    uint8_t *file;
    size_t size;
    *samples = 0;
    if (!name_of(output, path, sizeof path))
        return HG_OK; // no file of that name
    enum hg_status status = hg_file_read(path, DATA_LIMIT_BYTES + HEADER_BYTES, &file, &size, err);
    if (status == HG_E_NOTFOUND)
        return HG_OK;
    if (status)
        return status;
    struct hgp_checkpoint_set set = {.view = HG_CLI_VIEW};
    const char *wrong = check_file(file, size, job, &set.data, samples);
    struct hg_error refused = {0};
    if (!wrong) {
        status = helio_call_for(cli->h, HGP_T_checkpoint_set, &set, HGP_T_ok, NULL, &refused);
        if (status == HG_E_INVAL || status == HG_E_FORMAT) {
            wrong = refused.reason;
            status = HG_OK;
        } else if (status && err) {
            *err = refused;
        }
    }
    if (wrong) {
        *samples = 0;
        hg_cli_progress_clear(&cli->progress);
        fprintf(stderr, "helio: %s: %s; the picture begins anew\n", path, wrong);
    }
    hg_free(file);
    return status;
}

void hg_cli_checkpoint_remove(const char *output)
{
    char path[4200];
    if (name_of(output, path, sizeof path))
        unlink(path);
}
