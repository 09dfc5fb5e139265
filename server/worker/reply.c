#include "server/worker/reply.h"

#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"

enum { FRAME_PART_BYTES = 16 << 20, OUTBOX_WAIT_NS = 1000000 };

// An answer that breaks a rule of the protocol is our bug, but the asker must not wait for ever:
// an error takes its place.
static struct hg_refbuf *encode_message(
    uint32_t channel, uint32_t request, enum hgp_type type, const void *message)
{
    struct hg_writer writer = {0};
    struct hgp_fault fault = {0};
    enum hg_status status = hgp_encode(
        &writer, HGP_VERSION_MAX, (struct hgp_envelope){type, request, channel}, message, &fault);
    struct hg_refbuf *buf = status ? NULL : hg_refbuf_create(writer.size);
    if (buf)
        memcpy(buf->data, writer.data, writer.size);
    else
        hg_fault(WORKER, status ? status : HG_E_NOMEM,
            "cannot encode message 0x%04x: field '%s': %s", type, fault.field,
            fault.reason[0] ? fault.reason : "no memory");
    hg_writer_finish(&writer);
    if (buf || !request || type == HGP_T_error)
        return buf;
    struct hgp_error error = {.code = status == HG_E_INVAL ? HG_E_INTERNAL : HG_E_NOMEM,
        .what = hgp_str_make(hgp_find((uint16_t)type)->name),
        .where = hgp_str_make(fault.field),
        .reason = hgp_str_make("the answer cannot be sent")};
    return encode_message(channel, request, HGP_T_error, &error);
}

static void send_message(struct reply_to to, bool lossy, enum hgp_type type, const void *message)
{
    struct hg_refbuf *buf = encode_message(to.channel, to.request, type, message);
    if (!buf)
        return;
    for (;;) {
        enum hg_status status = hg_queue_push(&to.w->outbox, buf);
        if (!status)
            return;
        if (status != HG_E_AGAIN || lossy || atomic_load(&to.w->stop))
            break;
        hg_clock_sleep_ns(OUTBOX_WAIT_NS); // the peer is slow: the sender waits, the I/O thread not
    }
    hg_refbuf_unref(buf);
}

void hg_reply_send(struct reply_to to, enum hgp_type type, const void *message)
{
    send_message(to, false, type, message);
}

void hg_reply_send_lossy(struct reply_to to, enum hgp_type type, const void *message)
{
    send_message(to, true, type, message);
}

void hg_reply_ok(struct reply_to to, uint64_t revision)
{
    if (to.request)
        hg_reply_send(to, HGP_T_ok, &(struct hgp_ok){.revision = revision});
}

void hg_reply_error(struct reply_to to, const struct hg_error *err)
{
    if (err->status == HG_E_DEVICE_LOST) {
        hg_worker_lose_device(to.w, err);
        return;
    }
    struct hgp_error message = {
        .code = (uint16_t)(err->status ? err->status : HG_E_INTERNAL),
        .what = hgp_str_make(err->what),
        .where = hgp_str_make(err->where),
        .reason = hgp_str_make(err->reason[0] ? err->reason : hg_status_text(err->status)),
    };
    if (err->limit[0])
        hg_reply_send((struct reply_to){.w = to.w, .channel = to.channel}, HGP_T_limited,
            &(struct hgp_limited){.request = to.request,
                .limit = hgp_str_make(err->limit),
                .retry_after_ms = err->retry_after_ms});
    hg_reply_send(to, HGP_T_error, &message);
}

void hg_reply_progress(struct reply_to to, const char *stage, uint64_t done, uint64_t total)
{
    hg_reply_send_lossy(to, HGP_T_progress,
        &(struct hgp_progress){.stage = hgp_str_make(stage), .done = done, .total = total});
}

void hg_reply_notice(struct reply_to to, const struct hgp_notice *notice)
{
    hg_reply_send(to, HGP_T_notice, notice);
}

void hg_reply_frame(
    struct reply_to to, struct hgp_frame *frame, bool parts, const uint8_t *data, size_t size)
{
    size_t at = 0;
    for (; parts && size - at > FRAME_PART_BYTES; at += FRAME_PART_BYTES)
        hg_reply_send(to, HGP_T_frame_part,
            &(struct hgp_frame_part){.offset = at, .data = {data + at, FRAME_PART_BYTES}});
    frame->data = (struct hgp_bytes){data + at, (uint32_t)(size - at)};
    frame->has_size = at > 0;
    frame->size = size;
    hg_reply_send(to, HGP_T_frame, frame);
}
