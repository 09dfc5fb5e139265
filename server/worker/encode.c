// encode.c - the encoder thread: pixels of a step to the data of a frame message.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/sha256.h"
#include "renderer/image/zstd.h"
#include "server/worker/task.h"

enum {
    FRAME_DATA_LIMIT = 512 << 20, // of frame.data
    PART_BYTES = 16 << 20,        // of what is sent in parts
};

enum hg_pixel_format encode_pixel_format(enum hgp_encoding encoding)
{
    switch (encoding) {
    case HGP_encoding_RAW_RGBA32F:
    case HGP_encoding_EXR_HALF:
    case HGP_encoding_EXR_FLOAT:
        return HG_PIXEL_RGBA32F;
    case HGP_encoding_PNG16:
        return HG_PIXEL_RGBA16;
    default:
        return HG_PIXEL_RGBA8;
    }
}

static bool is_lossless(enum hgp_encoding encoding)
{
    return encoding != HGP_encoding_JPEG && encoding != HGP_encoding_EXR_HALF;
}

static enum hg_image_file file_kind(enum hgp_encoding encoding)
{
    switch (encoding) {
    case HGP_encoding_PNG16:
        return HG_IMAGE_PNG16;
    case HGP_encoding_JPEG:
        return HG_IMAGE_JPEG;
    default:
        return HG_IMAGE_PNG8;
    }
}

static enum hg_status encode_file(
    const struct encode_job *job, struct hg_writer *out, struct hg_error *err)
{
    const struct hgp_frame *f = &job->frame;
    const struct hg_image_attribute made_from = {
        .name = ENCODE_JOB_KEY, .type = HG_ATTR_STRING, .string = job->notes.job};
    struct hg_image image = {
        .width = f->width,
        .height = f->height,
        .format = encode_pixel_format(f->encoding),
        .has_alpha = !job->opaque,
        .size_bytes = job->pixels->size,
        .pixels = job->pixels->data,
    };
    return hg_image_encode(&image,
        &(struct hg_image_encode){.file = file_kind(f->encoding),
            .quality = job->quality,
            .opaque = job->opaque,
            .attributes = &made_from,
            .attribute_count = job->notes.job[0] != 0},
        out, err);
}

static enum hg_status encode_pixels(
    const struct encode_job *job, struct hg_writer *out, struct hg_error *err)
{
    switch (job->frame.encoding) {
    case HGP_encoding_RAW_RGBA8:
    case HGP_encoding_RAW_RGBA32F:
        return HG_OK; // sent as they are
    case HGP_encoding_ZSTD_RGBA8:
        return hg_zstd_encode(job->pixels->data, job->pixels->size, 1, out, err);
    case HGP_encoding_EXR_HALF:
    case HGP_encoding_EXR_FLOAT:
        return encode_exr(job, out, err);
    default:
        return encode_file(job, out, err);
    }
}

static uint32_t list_stages(
    const struct encode_job *job, uint64_t encode_ns, struct hgp_stage_time stages[64])
{
    uint32_t n = 0;
    for (; n < job->info.stage_count && n < 62; n++)
        stages[n] =
            (struct hgp_stage_time){hgp_str_make(job->info.stages[n].name), job->info.stages[n].ns};
    stages[n++] = (struct hgp_stage_time){hgp_str_make("read"), job->read_ns};
    stages[n++] = (struct hgp_stage_time){hgp_str_make("encode"), encode_ns};
    return n;
}

// The picture must fit the data of a frame message.
static enum hg_status check_size(
    const struct encode_job *job, const struct hg_writer *data, struct hg_error *err)
{
    size_t size = data->size ? data->size : job->pixels->size;
    if (job->parts || size <= FRAME_DATA_LIMIT)
        return HG_OK;
    return hg_error_set(err, HG_E_LIMIT, "frame", "data",
        "%zu bytes are more than a message holds (%d); choose another encoding or size", size,
        FRAME_DATA_LIMIT);
}

// The frame with its data, of which all but the end may go ahead.
static void send_frame(struct worker *w, const struct encode_job *job, struct hgp_frame *frame,
    const uint8_t *data, size_t size)
{
    size_t at = 0;
    for (; job->parts && size - at > PART_BYTES; at += PART_BYTES)
        link_send(w, job->channel, job->request, HGP_T_frame_part,
            &(struct hgp_frame_part){.offset = at, .data = {data + at, PART_BYTES}});
    frame->data = (struct hgp_bytes){data + at, (uint32_t)(size - at)};
    frame->has_size = at > 0;
    frame->size = size;
    link_send(w, job->channel, job->request, HGP_T_frame, frame);
}

static void run_job(struct worker *w, struct encode_job *job)
{
    struct hg_writer data = {0};
    struct hg_error err = {0};
    uint64_t start = hg_clock_now_ns();
    struct hgp_frame frame = job->frame;
    frame.lossless = is_lossless(frame.encoding);
    enum hg_status status = encode_pixels(job, &data, &err);
    if (!status)
        status = check_size(job, &data, &err);
    if (!status && frame.settled && frame.lossless) {
        status = hg_sha256(job->pixels->data, job->pixels->size, frame.hash);
        frame.has_hash = true;
    }
    if (status) {
        if (!err.status)
            hg_error_set(&err, status, "frame", NULL, "cannot be encoded");
        link_send_error(w, job->channel, job->request, &err);
    } else {
        struct hgp_stage_time stages[64];
        frame.stages.items = stages;
        frame.stages.count = list_stages(job, hg_clock_now_ns() - start, stages);
        if (data.size)
            send_frame(w, job, &frame, data.data, data.size);
        else
            send_frame(w, job, &frame, job->pixels->data, job->pixels->size);
        atomic_store(&w->encode_ns, hg_clock_now_ns() - start);
    }
    hg_writer_finish(&data);
}

void encode_job_destroy(struct encode_job *job)
{
    if (!job)
        return;
    for (uint32_t i = 0; i < job->plane_count; i++)
        hg_refbuf_unref(job->planes[i].values);
    for (uint32_t i = 0; i < ENCODE_MATTES; i++)
        hg_cryptomatte_view_finish(&job->mattes[i]);
    hg_refbuf_unref(job->pixels);
    hg_free(job);
}

void *encode_main(void *arg)
{
    struct worker *w = arg;
    for (struct encode_job *job; (job = hg_queue_pop(&w->encode, UINT64_MAX));) {
        run_job(w, job);
        encode_job_destroy(job);
    }
    return NULL;
}
