// frame_existing.c - helio render: the job of a frame, and files that hold it already.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/sha256.h"
#include "client/cli/render/frames.h"

enum { PART_BYTES = 16 << 20 }; // of a file that is sent to be verified

#define EXISTING_BYTES (UINT64_C(4) << 30) // a larger file is not verified, but made again

// Only files that may be met again are worth looking at the whole scene for.
static bool wants_job(const struct hg_cli_render *r)
{
    return hg_cli_is_path(r->o) || r->list.count > 0 || r->o->skip_existing;
}

static enum hg_status ask_once(
    struct hg_cli_render *r, const uint8_t *after, uint8_t job[32], struct hg_error *err)
{
    struct helio_message *answer;
    struct hgp_job_query query = {
        .view = HG_CLI_VIEW,
        .has_encoding = true,
        .encoding = r->format.encoding,
        .has_quality = true,
        .quality = r->format.quality,
        .has_after = after != NULL,
    };
    if (after)
        memcpy(query.after, after, 32);
    memset(job, 0, 32);
    if (!wants_job(r))
        return HG_OK;
    enum hg_status status =
        helio_call_for(r->cli.h, HGP_T_job_query, &query, HGP_T_job, &answer, err);
    if (status)
        return status;
    memcpy(job, answer->body->job.hash, 32);
    helio_message_free(answer);
    return HG_OK;
}

// after: job of the picture that this one depends on, or NULL.
enum hg_status hg_cli_frame_ask_job(
    struct hg_cli_render *r, const uint8_t *after, uint8_t job[32], struct hg_error *err)
{
    enum hg_status status;
    do {
        r->daemon.losses = hg_cli_frame_losses(r);
        status = hg_cli_frame_keep_camera(r, err);
        if (!status)
            status = ask_once(r, after, job, err);
    } while (!status && r->daemon.losses != hg_cli_frame_losses(r));
    return status;
}

// NULL: the file is whole and of this job. Else why it is made again; "" when there is none.
static const char *why_not(const char *json, const uint8_t job[32])
{
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(job, hex);
    json_t *told = json_loads(json, 0, NULL);
    const char *of = json_string_value(json_object_get(told, "job"));
    const char *why = !of                    ? "does not say what it was made from"
                      : strcmp(of, hex) != 0 ? "was made from something else"
                                             : NULL;
    json_decref(told);
    return why;
}

// What the worker finds in a file, all of which is sent to it.
static enum hg_status examine(struct hg_cli_render *r, const uint8_t *data, size_t size,
    struct helio_message **answer, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    size_t at = 0;
    for (; !status && size - at > PART_BYTES; at += PART_BYTES) {
        const struct hgp_image_query part = {.data = {data + at, PART_BYTES},
            .has_offset = true,
            .offset = at,
            .has_size = true,
            .size = size};
        status = helio_call_for(r->cli.h, HGP_T_image_query, &part, HGP_T_ok, NULL, err);
    }
    const struct hgp_image_query last = {.data = {data + at, (uint32_t)(size - at)},
        .has_offset = at > 0,
        .offset = at,
        .has_size = at > 0,
        .size = size};
    return status ? status
                  : helio_call_for(r->cli.h, HGP_T_image_query, &last, HGP_T_json, answer, err);
}

// As why_not, of the worker's answer about a file that is whole.
static const char *judge(const struct helio_message *answer, const uint8_t job[32])
{
    const struct hgp_str *json = &answer->body->json.text;
    char *text = hg_strndup(json->data ? json->data : "", json->size);
    const char *why = text ? why_not(text, job) : "no memory to look at it";
    hg_free(text);
    return why;
}

// Does `name` hold what this command would write? The worker decodes all of it.
enum hg_status hg_cli_frame_check_existing(struct hg_cli_render *r, const char *name,
    const uint8_t job[32], bool *good, struct hg_error *err)
{
    uint8_t *data;
    size_t size;
    struct helio_message *answer = NULL;
    struct hg_error wrong = {0};
    *good = false;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = hg_cli_check_no_folder(name, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_RENDER;
    status = hg_file_read(name, EXISTING_BYTES, &data, &size, &wrong);
    if (status == HG_E_NOTFOUND)
        return HG_OK;
    if (!status) {
        status = examine(r, data, size, &answer, &wrong);
        hg_free(data);
    }
    const bool damaged = status == HG_E_FORMAT || status == HG_E_TRUNCATED ||
                         status == HG_E_LIMIT || status == HG_E_UNSUPPORTED;
    if (status && !damaged) {
        *err = wrong;
        return status;
    }
    const char *why = damaged ? wrong.reason : judge(answer, job);
    helio_message_free(answer);
    *good = why == NULL;
    if (*good)
        return HG_OK;
    char clean[300];
    hg_cli_clean(clean, sizeof clean, why, strlen(why));
    hg_cli_progress_say(&r->cli.progress, "%s: %s; it is made again", name, clean);
    return HG_OK;
}
