#include "server/worker/checkpoint.h"

#include "base/alloc.h"
#include "renderer/image/zstd.h"
#include "server/worker/encode/frame_key.h"

#define FILM_LIMIT_BYTES (UINT64_C(16) << 30) // of a checkpoint when unpacked

enum {
    ANSWER_LIMIT_BYTES = 320 << 20,
    PART_BYTES = 256 << 10, // of what is sent in parts
};

// A checkpoint: u64 size, then the film or the history packed by zstd.
static enum hg_status pack(
    const struct hg_refbuf *film, struct hg_writer *out, struct hg_error *err)
{
    hg_write_u64(out, film->size);
    return hg_zstd_encode(film->data, film->size, 1, out, err);
}

// What is to be sent, to view->checkpoint.sending.
static enum hg_status make_checkpoint(const struct request *r, struct view_slot *view,
    enum hgp_checkpoint_kind kind, struct hg_error *err)
{
    const bool history = kind == HGP_checkpoint_kind_HISTORY;
    struct hg_refbuf *film = NULL;
    hg_writer_finish(&view->checkpoint.sending);
    view->checkpoint.sending_notes =
        (struct hgp_checkpoint){.samples = view->progress.info.samples};
    enum hg_status status = history ? hg_view_save_history(view->view, &film, err)
                                    : hg_view_save(view->view, &film, err);
    if (status)
        return status;
    status = hg_frame_key_make(
        r->s, r->session, view, hg_frame_key_format(view), view->checkpoint.sending_notes.job, err);
    if (status)
        goto done;
    status = pack(film, &view->checkpoint.sending, err);
done:
    hg_refbuf_unref(film);
    return status;
}

// From `offset` on as much as goes into an answer.
static enum hg_status answer_part(struct view_slot *view, bool part, uint64_t offset,
    struct hgp_checkpoint *answer, struct hg_error *err)
{
    const struct hg_writer *w = &view->checkpoint.sending;
    *answer = view->checkpoint.sending_notes;
    if (offset >= w->size)
        return hg_error_set(
            err, HG_E_STATE, "checkpoint_query", "offset", "nothing is left to send");
    if (!part && w->size > ANSWER_LIMIT_BYTES)
        return hg_error_set(err, HG_E_LIMIT, "checkpoint", NULL,
            "%zu bytes are more than a message holds (%d): ask for parts, with offset", w->size,
            ANSWER_LIMIT_BYTES);
    const uint64_t left = w->size - offset;
    const uint64_t bytes = part && left > PART_BYTES ? PART_BYTES : left;
    answer->data = (struct hgp_bytes){w->data + offset, (uint32_t)bytes};
    answer->has_size = part;
    answer->size = w->size;
    return HG_OK;
}

// From offset 0 on the checkpoint is made; later parts are of the same one.
static enum hg_status make_answer(const struct request *r, struct view_slot *view,
    struct hgp_checkpoint *answer, struct hg_error *err)
{
    const struct hgp_checkpoint_query *m = &r->message->checkpoint_query;
    const enum hgp_checkpoint_kind kind = m->has_kind ? m->kind : HGP_checkpoint_kind_FILM;
    const uint64_t offset = m->has_offset ? m->offset : 0;
    enum hg_status status = offset == 0 ? make_checkpoint(r, view, kind, err) : HG_OK;
    return status ? status : answer_part(view, m->has_offset, offset, answer, err);
}

void hg_handle_checkpoint_query(const struct request *r)
{
    const struct hgp_checkpoint_query *m = &r->message->checkpoint_query;
    struct view_slot *view = hg_request_view(r, m->view);
    struct hg_error err = {0};
    struct hgp_checkpoint answer;
    if (!view)
        return;
    if (make_answer(r, view, &answer, &err)) {
        hg_reply_error(r->to, &err);
        hg_writer_finish(&view->checkpoint.sending);
        return;
    }
    hg_reply_send(r->to, HGP_T_checkpoint, &answer);
    const uint64_t offset = m->has_offset ? m->offset : 0;
    if (offset + answer.data.size == view->checkpoint.sending.size)
        hg_writer_finish(&view->checkpoint.sending);
}

static enum hg_status unpack(
    const uint8_t *data, size_t bytes, void **film, uint64_t *size, struct hg_error *err)
{
    struct hg_reader r = hg_reader_make(data, bytes);
    *film = NULL;
    *size = hg_read_u64(&r);
    if (r.failed || *size < 1)
        return hg_error_set(err, HG_E_FORMAT, "checkpoint_set", "data", "not a checkpoint");
    if (*size > FILM_LIMIT_BYTES)
        return hg_error_set(err, HG_E_LIMIT, "checkpoint_set", "data",
            "%llu bytes of film, of at most %llu", (unsigned long long)*size,
            (unsigned long long)FILM_LIMIT_BYTES);
    *film = hg_calloc(1, (size_t)*size);
    if (!*film)
        return hg_error_set(err, HG_E_NOMEM, "checkpoint_set", NULL, "no memory for the film");
    return hg_zstd_decode(r.data + r.pos, r.size - r.pos, *film, (size_t)*size, err);
}

static enum hg_status load_checkpoint(struct view_slot *view, enum hgp_checkpoint_kind kind,
    const uint8_t *data, size_t bytes, struct hg_error *err)
{
    void *film;
    uint64_t size;
    enum hg_status status = unpack(data, bytes, &film, &size, err);
    if (status)
        goto done;
    status = kind == HGP_checkpoint_kind_HISTORY ? hg_view_load_history(view->view, film, size, err)
                                                 : hg_view_load(view->view, film, size, err);
    view->settings.changed |= !status && kind == HGP_checkpoint_kind_FILM; // settled as it may be
done:
    hg_free(film);
    return status;
}

static enum hg_status bad_part(struct view_slot *view, struct hg_error *err, const char *why)
{
    hg_writer_finish(&view->checkpoint.receiving);
    return hg_error_set(err, HG_E_INVAL, "checkpoint_set", "offset", "%s", why);
}

// One more part; *all: it was the last.
static enum hg_status take_part(struct view_slot *view, const struct hgp_checkpoint_set *m,
    enum hgp_checkpoint_kind kind, bool *all, struct hg_error *err)
{
    struct hg_writer *w = &view->checkpoint.receiving;
    *all = false;
    if (!m->has_size || m->size > FILM_LIMIT_BYTES)
        return bad_part(view, err, "needs the size of the whole, 16 GiB at most");
    if (m->offset == 0) {
        hg_writer_finish(w);
        view->checkpoint.receiving_kind = kind;
        view->checkpoint.receive_bytes = m->size;
    }
    if (m->offset != w->size || kind != view->checkpoint.receiving_kind ||
        m->size != view->checkpoint.receive_bytes || m->data.size > m->size - w->size)
        return bad_part(view, err, "is not where the part before has ended");
    hg_write_bytes(w, m->data.data, m->data.size);
    if (w->failed) {
        hg_writer_finish(w);
        return hg_error_set(err, HG_E_NOMEM, "checkpoint_set", NULL, "no memory for its parts");
    }
    *all = w->size == view->checkpoint.receive_bytes;
    return HG_OK;
}

// All of a checkpoint at once, or one of its parts; the last one loads it.
static enum hg_status take_message(struct view_slot *view, const struct hgp_checkpoint_set *m,
    enum hgp_checkpoint_kind kind, bool *all, struct hg_error *err)
{
    const struct hg_writer *w = &view->checkpoint.receiving;
    *all = true;
    if (!m->has_offset)
        return load_checkpoint(view, kind, m->data.data, m->data.size, err);
    enum hg_status status = take_part(view, m, kind, all, err);
    if (status || !*all)
        return status;
    status = load_checkpoint(view, kind, w->data, w->size, err);
    hg_writer_finish(&view->checkpoint.receiving);
    return status;
}

void hg_handle_checkpoint_set(const struct request *r)
{
    const struct hgp_checkpoint_set *m = &r->message->checkpoint_set;
    const enum hgp_checkpoint_kind kind = m->has_kind ? m->kind : HGP_checkpoint_kind_FILM;
    struct view_slot *view = hg_request_view(r, m->view);
    struct hg_error err = {0};
    bool all;
    if (!view)
        return;
    if (take_message(view, m, kind, &all, &err)) {
        hg_reply_error(r->to, &err);
        return;
    }
    view->progress.failed = view->progress.failed && !all;
    hg_request_ok(r);
}
