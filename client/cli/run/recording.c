// recording.c - recordings of what a client sends.
#include "client/cli/run/recording.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/clock.h"
#include "base/file.h"

static const uint8_t magic[8] = {'H', 'G', 'P', 'R', 'E', 'C', 0x1a, 1};

enum {
    RECORD_BYTES = 13, // kind, time, size
    FLUSH_BYTES = 65536,
};
#define RECORDING_BYTES (UINT64_C(1) << 30)

struct hg_cli_recorder {
    struct hg_file_out file;
    struct hg_writer buffer;
    uint64_t begin_ns;     // 0: nothing was recorded
    enum hg_status status; // of the first write that failed
    struct hg_error error;
};

// ---- writing -----------------------------------------------------------------------------------

enum hg_status hg_cli_recorder_create(
    const char *path, struct hg_cli_recorder **out, struct hg_error *err)
{
    struct hg_cli_recorder *r = hg_calloc(1, sizeof *r);
    *out = NULL;
    if (!r)
        return hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory");
    enum hg_status status = hg_file_begin(&r->file, path, err);
    if (status) {
        hg_free(r);
        return status;
    }
    hg_write_bytes(&r->buffer, magic, sizeof magic);
    *out = r;
    return HG_OK;
}

static void flush(struct hg_cli_recorder *r)
{
    if (!r->status && r->buffer.failed)
        r->status = hg_error_set(&r->error, HG_E_NOMEM, "--record", NULL, "no memory");
    if (!r->status)
        r->status = hg_file_write(&r->file, r->buffer.data, r->buffer.size, &r->error);
    r->buffer.size = 0;
}

static void begin_record(struct hg_cli_recorder *r, enum hg_record_kind kind, size_t size)
{
    const uint64_t now_ns = hg_clock_now_ns();
    if (!r->begin_ns)
        r->begin_ns = now_ns;
    if (r->buffer.size > FLUSH_BYTES)
        flush(r);
    hg_write_u8(&r->buffer, (uint8_t)kind);
    hg_write_u64(&r->buffer, now_ns - r->begin_ns);
    hg_write_u32(&r->buffer, (uint32_t)size);
}

static void on_sent(void *user, const uint8_t *message, size_t size)
{
    struct hg_cli_recorder *r = user;
    struct hgp_header header;
    uint8_t bytes[HGP_HEADER_BYTES];
    if (hgp_header_decode(message, size, UINT32_MAX, &header))
        return; // the library's own bytes are well formed
    header.channel = 0;
    hgp_header_encode(&header, bytes);
    begin_record(r, HG_RECORD_SENT, size);
    hg_write_bytes(&r->buffer, bytes, sizeof bytes);
    hg_write_bytes(&r->buffer, message + sizeof bytes, size - sizeof bytes);
}

static void on_received(void *user, const struct helio_message *message)
{
    struct hg_cli_recorder *r = user;
    const struct hgp_frame *frame = &message->body->frame;
    if (message->type != HGP_T_frame || !frame->settled || !frame->has_hash)
        return;
    begin_record(r, HG_RECORD_SETTLED, 4 + 8 + 8 + sizeof frame->hash);
    hg_write_u32(&r->buffer, frame->view);
    hg_write_u64(&r->buffer, frame->input_seq);
    hg_write_u64(&r->buffer, frame->scene_revision);
    hg_write_bytes(&r->buffer, frame->hash, sizeof frame->hash);
}

enum hg_status hg_cli_recorder_attach(struct hg_cli_recorder *r, struct helio *h,
    const struct hgp_scene_opened *scene, const char *name, struct hg_error *err)
{
    const size_t length = strlen(name);
    begin_record(r, HG_RECORD_SCENE, 8 + length);
    hg_write_u32(&r->buffer, scene->first_id);
    hg_write_u32(&r->buffer, scene->id_count);
    hg_write_bytes(&r->buffer, name, length);
    helio_set_tap(h, &(struct helio_tap){r, on_sent, on_received});
    if (r->status && err)
        *err = r->error;
    return r->status;
}

enum hg_status hg_cli_recorder_finish(struct hg_cli_recorder *r, struct hg_error *err)
{
    if (!r)
        return HG_OK;
    flush(r);
    enum hg_status status = r->status;
    if (status && err)
        *err = r->error;
    if (status)
        hg_file_abort(&r->file);
    else
        status = hg_file_commit(&r->file, err);
    hg_writer_finish(&r->buffer);
    hg_free(r);
    return status;
}

// ---- reading -----------------------------------------------------------------------------------

enum hg_status hg_recording_open(const char *path, struct hg_recording *out, struct hg_error *err)
{
    *out = (struct hg_recording){.path = path};
    enum hg_status status = hg_file_read(path, RECORDING_BYTES, &out->data, &out->size, err);
    if (status)
        return status;
    if (out->size < sizeof magic || memcmp(out->data, magic, sizeof magic) != 0) {
        hg_recording_close(out);
        return hg_error_set(
            err, HG_E_FORMAT, path, "byte 0", "is no recording of this version of helio --record");
    }
    hg_recording_rewind(out);
    return HG_OK;
}

void hg_recording_rewind(struct hg_recording *r)
{
    r->at = sizeof magic;
}

static bool read_sent(struct hg_reader *in, struct hg_record *out)
{
    const uint8_t *bytes = hg_read_bytes(in, HGP_HEADER_BYTES);
    if (!bytes || hgp_header_decode(bytes, HGP_HEADER_BYTES, UINT32_MAX, &out->sent.header) ||
        out->sent.header.length != in->size - in->pos)
        return false;
    out->sent.payload = hg_read_bytes(in, out->sent.header.length);
    return true;
}

static bool read_body(struct hg_reader *in, struct hg_record *out)
{
    const uint8_t *hash;
    switch (out->kind) {
    case HG_RECORD_SCENE:
        out->scene.first_id = hg_read_u32(in);
        out->scene.id_count = hg_read_u32(in);
        out->scene.name.size = in->failed ? 0 : (uint32_t)(in->size - in->pos);
        out->scene.name.data = (const char *)hg_read_bytes(in, out->scene.name.size);
        break;
    case HG_RECORD_SENT:
        return read_sent(in, out);
    case HG_RECORD_SETTLED:
        out->settled.view = hg_read_u32(in);
        out->settled.input_seq = hg_read_u64(in);
        out->settled.revision = hg_read_u64(in);
        hash = hg_read_bytes(in, sizeof out->settled.hash);
        if (hash)
            memcpy(out->settled.hash, hash, sizeof out->settled.hash);
        break;
    default:
        return false;
    }
    return !in->failed && in->pos == in->size;
}

enum hg_status hg_recording_next(
    struct hg_recording *r, struct hg_record *out, struct hg_error *err)
{
    char place[40];
    *out = (struct hg_record){0};
    if (r->at == r->size)
        return HG_E_CLOSED;
    struct hg_reader in = hg_reader_make(r->data + r->at, r->size - r->at);
    out->kind = (enum hg_record_kind)hg_read_u8(&in);
    out->time_ns = hg_read_u64(&in);
    const uint32_t size = hg_read_u32(&in);
    const uint8_t *body = hg_read_bytes(&in, size);
    struct hg_reader inner = hg_reader_make(body, size);
    if (body && read_body(&inner, out)) {
        r->at += RECORD_BYTES + (size_t)size;
        return HG_OK;
    }
    snprintf(place, sizeof place, "byte %zu", r->at);
    *out = (struct hg_record){0};
    return hg_error_set(err, HG_E_FORMAT, r->path, place, "the recording is damaged or cut short");
}

void hg_recording_close(struct hg_recording *r)
{
    hg_free(r->data);
    *r = (struct hg_recording){0};
}
