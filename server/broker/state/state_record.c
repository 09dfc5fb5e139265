#include "server/broker/state/state_record.h"

#include <math.h>
#include <string.h>

enum { TEXT_LIMIT = 4096 };
#define FOLLOWS (UINT32_C(1) << 31) // beside a credit, which has at most 1024

// ---- encoding -----------------------------------------------------------------------------------

static void put_text(struct hg_writer *w, struct hgp_str text)
{
    hg_write_u16(w, (uint16_t)text.size);
    hg_write_bytes(w, text.size ? text.data : "", text.size);
}

static struct hg_writer begin(enum hg_state_kind kind)
{
    struct hg_writer w = {0};
    hg_write_u16(&w, (uint16_t)kind);
    return w;
}

static uint64_t put_numbers(
    struct hg_state_log *log, enum hg_state_kind kind, const uint32_t *numbers, int count)
{
    if (!log)
        return 0;
    struct hg_writer w = begin(kind);
    for (int i = 0; i < count; i++)
        hg_write_u32(&w, numbers[i]);
    return hg_state_log_append(log, &w, NULL);
}

uint64_t hg_state_put_scene(struct hg_state_log *log, const struct hg_state_scene *scene)
{
    if (!log)
        return 0;
    struct hg_writer w = begin(HG_STATE_SCENE);
    hg_write_u32(&w, scene->number);
    put_text(&w, scene->tenant);
    put_text(&w, scene->name);
    return hg_state_log_append(log, &w, NULL);
}

uint64_t hg_state_put_scene_end(struct hg_state_log *log, uint32_t number)
{
    return put_numbers(log, HG_STATE_SCENE_END, &number, 1);
}

uint64_t hg_state_put_edit(
    struct hg_state_log *log, uint32_t scene, uint64_t revision, struct hg_packet *packet)
{
    if (!log)
        return 0;
    struct hg_writer w = begin(HG_STATE_EDIT);
    hg_write_u32(&w, scene);
    hg_write_u64(&w, revision);
    hg_write_u16(&w, packet->header.type);
    return hg_state_log_append(log, &w, packet);
}

uint64_t hg_state_put_suspect(struct hg_state_log *log, const struct hg_state_suspect *suspect)
{
    if (!log)
        return 0;
    struct hg_writer w = begin(HG_STATE_QUARANTINE);
    put_text(&w, suspect->tenant);
    hg_write_bytes(&w, suspect->key, sizeof suspect->key);
    put_text(&w, suspect->what);
    hg_write_u32(&w, suspect->deaths);
    hg_write_u64(&w, suspect->seen_s);
    hg_write_u64(&w, suspect->until_s);
    return hg_state_log_append(log, &w, NULL);
}

uint64_t hg_state_put_suspect_end(
    struct hg_state_log *log, const char *tenant, const uint8_t key[32])
{
    if (!log)
        return 0;
    struct hg_writer w = begin(HG_STATE_QUARANTINE_END);
    put_text(&w, hgp_str_make(tenant));
    hg_write_bytes(&w, key, 32);
    return hg_state_log_append(log, &w, NULL);
}

uint64_t hg_state_put_session(struct hg_state_log *log, const struct hg_state_session *session)
{
    if (!log)
        return 0;
    struct hg_writer w = begin(HG_STATE_SESSION);
    hg_write_u32(&w, session->number);
    hg_write_u32(&w, session->scene);
    hg_write_u32(&w, session->first_id);
    hg_write_u8(&w, session->role);
    hg_write_u8(&w, session->has_token);
    hg_write_u8(&w, session->batch_open);
    hg_write_bytes(&w, session->token, sizeof session->token);
    hg_write_bytes(&w, session->ticket, sizeof session->ticket);
    put_text(&w, session->name);
    put_text(&w, session->tenant);
    hg_write_u8(&w, session->watch);
    hg_write_u8(&w, session->has_color);
    hg_write_u32(&w, session->color);
    put_text(&w, session->label);
    return hg_state_log_append(log, &w, NULL);
}

uint64_t hg_state_put_session_end(struct hg_state_log *log, uint32_t number)
{
    return put_numbers(log, HG_STATE_SESSION_END, &number, 1);
}

uint64_t hg_state_put_view(struct hg_state_log *log, const struct hg_state_view *view)
{
    if (!log)
        return 0;
    struct hg_writer w = begin(HG_STATE_VIEW);
    hg_write_u32(&w, view->session);
    hg_write_u32(&w, view->number);
    hg_write_u32(&w, view->credit | (view->follows ? FOLLOWS : 0));
    hg_write_u32(&w, view->params.size);
    hg_write_bytes(&w, view->params.data, view->params.size);
    hg_write_bytes(
        &w, view->camera.data ? view->camera.data : (const uint8_t *)"", view->camera.size);
    return hg_state_log_append(log, &w, NULL);
}

uint64_t hg_state_put_view_end(struct hg_state_log *log, uint32_t session, uint32_t number)
{
    return put_numbers(log, HG_STATE_VIEW_END, (uint32_t[]){session, number}, 2);
}

uint64_t hg_state_put_look(
    struct hg_state_log *log, uint32_t session, uint32_t view, struct hg_packet *packet)
{
    if (!log)
        return 0;
    struct hg_writer w = begin(HG_STATE_LOOK);
    hg_write_u32(&w, session);
    hg_write_u32(&w, view);
    hg_write_u16(&w, packet->header.type);
    return hg_state_log_append(log, &w, packet);
}

uint64_t hg_state_put_annotation(struct hg_state_log *log, const struct hg_state_annotation *it)
{
    if (!log)
        return 0;
    struct hg_writer w = begin(HG_STATE_ANNOTATION);
    hg_write_u32(&w, it->scene);
    hg_write_u32(&w, it->number);
    hg_write_u8(&w, it->kind);
    for (int i = 0; i < 3; i++)
        hg_write_f32(&w, it->position[i]);
    for (int i = 0; i < 3; i++)
        hg_write_f32(&w, it->normal[i]);
    hg_write_u64(&w, it->node);
    hg_write_u32(&w, it->color);
    put_text(&w, it->text);
    put_text(&w, it->author);
    put_text(&w, it->label);
    hg_write_bytes(&w, it->author_key, sizeof it->author_key);
    hg_write_u32(&w, it->author_session);
    hg_write_u64(&w, it->time_ms);
    hg_write_u64(&w, it->changed_ms);
    return hg_state_log_append(log, &w, NULL);
}

uint64_t hg_state_put_annotation_end(struct hg_state_log *log, uint32_t scene, uint32_t number)
{
    return put_numbers(log, HG_STATE_ANNOTATION_END, (uint32_t[]){scene, number}, 2);
}

uint64_t hg_state_put_ticket(struct hg_state_log *log, const struct hg_state_ticket *ticket)
{
    if (!log)
        return 0;
    struct hg_writer w = begin(HG_STATE_TICKET);
    hg_write_u32(&w, ticket->number);
    hg_write_bytes(&w, ticket->hash, sizeof ticket->hash);
    hg_write_bytes(&w, ticket->issuer_key, sizeof ticket->issuer_key);
    hg_write_u8(&w, ticket->has_issuer_key);
    hg_write_u8(&w, ticket->role);
    hg_write_u32(&w, ticket->uses);
    hg_write_u32(&w, ticket->used);
    hg_write_u32(&w, ticket->weight);
    hg_write_u32(&w, ticket->max_rate);
    hg_write_u32(&w, ticket->max_pixels);
    hg_write_u64(&w, ticket->until_s);
    put_text(&w, ticket->tenant);
    put_text(&w, ticket->issuer);
    put_text(&w, ticket->scene);
    put_text(&w, ticket->label);
    put_text(&w, ticket->roots);
    return hg_state_log_append(log, &w, NULL);
}

uint64_t hg_state_put_ticket_end(struct hg_state_log *log, uint32_t number)
{
    return put_numbers(log, HG_STATE_TICKET_END, &number, 1);
}

uint64_t hg_state_put_block(struct hg_state_log *log, const struct hg_state_block *block)
{
    if (!log)
        return 0;
    struct hg_writer w = begin(HG_STATE_BLOCK);
    hg_write_bytes(&w, block->hash, sizeof block->hash);
    hg_write_u64(&w, block->until_s);
    return hg_state_log_append(log, &w, NULL);
}

// ---- decoding -----------------------------------------------------------------------------------

static struct hgp_str take_text(struct hg_reader *r)
{
    uint16_t size = hg_read_u16(r);
    const uint8_t *data = hg_read_bytes(r, size);
    r->failed |= size > TEXT_LIMIT;
    return (struct hgp_str){(const char *)data, r->failed ? 0 : size};
}

static void take_key(struct hg_reader *r, uint8_t key[32])
{
    const uint8_t *data = hg_read_bytes(r, 32);
    if (data)
        memcpy(key, data, 32);
}

static struct hgp_bytes take_rest(struct hg_reader *r)
{
    size_t size = r->failed ? 0 : r->size - r->pos;
    return (struct hgp_bytes){hg_read_bytes(r, size), (uint32_t)size};
}

static void take_edit(struct hg_reader *r, struct hg_state_edit *out)
{
    out->scene = hg_read_u32(r);
    out->revision = hg_read_u64(r);
    out->type = hg_read_u16(r);
    out->payload = take_rest(r);
}

static void take_look(struct hg_reader *r, struct hg_state_look *out)
{
    out->session = hg_read_u32(r);
    out->view = hg_read_u32(r);
    out->type = hg_read_u16(r);
    out->payload = take_rest(r);
}

static void take_suspect(struct hg_reader *r, bool ends, struct hg_state_suspect *out)
{
    out->tenant = take_text(r);
    take_key(r, out->key);
    if (ends)
        return;
    out->what = take_text(r);
    out->deaths = hg_read_u32(r);
    out->seen_s = hg_read_u64(r);
    out->until_s = hg_read_u64(r);
}

static struct hgp_bytes take_bytes(struct hg_reader *r, size_t size)
{
    const uint8_t *data = hg_read_bytes(r, size);
    return (struct hgp_bytes){data, data ? (uint32_t)size : 0};
}

static void take_session(struct hg_reader *r, struct hg_state_session *out)
{
    out->number = hg_read_u32(r);
    out->scene = hg_read_u32(r);
    out->first_id = hg_read_u32(r);
    out->role = hg_read_u8(r);
    out->has_token = hg_read_u8(r) != 0;
    out->batch_open = hg_read_u8(r) != 0;
    take_key(r, out->token);
    take_key(r, out->ticket);
    out->name = take_text(r);
    out->tenant = take_text(r);
    if (r->failed || r->pos == r->size) // of an earlier version
        return;
    out->watch = hg_read_u8(r);
    out->has_color = hg_read_u8(r) != 0;
    out->color = hg_read_u32(r);
    out->label = take_text(r);
}

static void take_view(struct hg_reader *r, struct hg_state_view *out)
{
    out->session = hg_read_u32(r);
    out->number = hg_read_u32(r);
    out->credit = hg_read_u32(r);
    out->follows = (out->credit & FOLLOWS) != 0;
    out->credit &= ~FOLLOWS;
    out->params = take_bytes(r, hg_read_u32(r));
    out->camera = take_bytes(r, r->failed ? 0 : r->size - r->pos);
}

static void take_vector(struct hg_reader *r, float out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = hg_read_f32(r);
        r->failed |= !isfinite(out[i]); // clients are told it, and messages have no others
    }
}

static void take_annotation(struct hg_reader *r, bool ends, struct hg_state_annotation *out)
{
    out->scene = hg_read_u32(r);
    out->number = hg_read_u32(r);
    r->failed |= out->number == 0;
    if (ends)
        return;
    out->kind = hg_read_u8(r);
    r->failed |= out->kind > HGP_annotation_kind_TEXT;
    take_vector(r, out->position);
    take_vector(r, out->normal);
    out->node = hg_read_u64(r);
    out->color = hg_read_u32(r);
    out->text = take_text(r);
    out->author = take_text(r);
    out->label = take_text(r);
    take_key(r, out->author_key);
    out->author_session = hg_read_u32(r);
    out->time_ms = hg_read_u64(r);
    out->changed_ms = hg_read_u64(r);
}

static void take_ticket(struct hg_reader *r, bool ends, struct hg_state_ticket *out)
{
    out->number = hg_read_u32(r);
    if (ends)
        return;
    take_key(r, out->hash);
    take_key(r, out->issuer_key);
    out->has_issuer_key = hg_read_u8(r) != 0;
    out->role = hg_read_u8(r);
    r->failed |= out->role != HGP_role_VIEW && out->role != HGP_role_EDIT;
    out->uses = hg_read_u32(r);
    out->used = hg_read_u32(r);
    out->weight = hg_read_u32(r);
    out->max_rate = hg_read_u32(r);
    out->max_pixels = hg_read_u32(r);
    out->until_s = hg_read_u64(r);
    out->tenant = take_text(r);
    out->issuer = take_text(r);
    out->scene = take_text(r);
    out->label = take_text(r);
    if (!r->failed && r->pos < r->size) // else of a program before
        out->roots = take_text(r);
}

// Of people in scenes and of what their views show.
static bool take_later(struct hg_reader *r, struct hg_state_record *out)
{
    switch (out->kind) {
    case HG_STATE_ANNOTATION:
    case HG_STATE_ANNOTATION_END:
        take_annotation(r, out->kind == HG_STATE_ANNOTATION_END, &out->of.annotation);
        return true;
    case HG_STATE_TICKET:
    case HG_STATE_TICKET_END:
        take_ticket(r, out->kind == HG_STATE_TICKET_END, &out->of.ticket);
        return true;
    case HG_STATE_BLOCK:
        take_key(r, out->of.block.hash);
        out->of.block.until_s = hg_read_u64(r);
        return true;
    case HG_STATE_LOOK:
        take_look(r, &out->of.look);
        return true;
    default:
        return false;
    }
}

enum hg_status hg_state_record_decode(const uint8_t *body, size_t size, struct hg_state_record *out)
{
    struct hg_reader r = hg_reader_make(body, size);
    *out = (struct hg_state_record){.kind = (enum hg_state_kind)hg_read_u16(&r)};
    switch (out->kind) {
    case HG_STATE_SCENE:
    case HG_STATE_SCENE_END:
        out->of.scene.number = hg_read_u32(&r);
        if (out->kind == HG_STATE_SCENE_END)
            break;
        out->of.scene.tenant = take_text(&r);
        out->of.scene.name = take_text(&r);
        break;
    case HG_STATE_EDIT:
        take_edit(&r, &out->of.edit);
        break;
    case HG_STATE_QUARANTINE:
    case HG_STATE_QUARANTINE_END:
        take_suspect(&r, out->kind == HG_STATE_QUARANTINE_END, &out->of.suspect);
        break;
    case HG_STATE_SESSION:
        take_session(&r, &out->of.session);
        break;
    case HG_STATE_SESSION_END:
        out->of.session.number = hg_read_u32(&r);
        break;
    case HG_STATE_VIEW:
        take_view(&r, &out->of.view);
        break;
    case HG_STATE_VIEW_END:
        out->of.view.session = hg_read_u32(&r);
        out->of.view.number = hg_read_u32(&r);
        break;
    default:
        if (!take_later(&r, out))
            return HG_E_FORMAT;
    }
    return r.failed || r.pos != r.size ? HG_E_FORMAT : HG_OK;
}
