#include "server/broker/session/session_look.h"

#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "server/broker/session/session_record.h"
#include "server/broker/session/session_view.h"

// What a message of a view's look says, as far as the broker needs it.
struct look {
    uint32_t view;
    uint32_t asset; // view_variant
    bool clear;     // view_overrides: none before counts any more
};

static struct look look_of(enum hgp_type type, const union hgp_any *m)
{
    switch (type) {
    case HGP_T_view_clip:
        return (struct look){.view = m->view_clip.view};
    case HGP_T_view_variant:
        return (struct look){.view = m->view_variant.view, .asset = m->view_variant.asset};
    default:
        return (struct look){.view = m->view_overrides.view,
            .clear = m->view_overrides.has_clear && m->view_overrides.clear};
    }
}

static bool decode(const struct hg_packet *packet, struct look *out)
{
    struct hg_arena arena = {0};
    union hgp_any any;
    const bool done =
        hgp_decode(HGP_VERSION_MAX, packet->header.type,
            hg_reader_make(packet->payload, packet->header.length), &arena, &any, NULL) == HG_OK;
    if (done)
        *out = look_of((enum hgp_type)packet->header.type, &any);
    hg_arena_finish(&arena);
    return done;
}

static uint64_t bytes_of(const struct hg_session_view *view)
{
    uint64_t bytes = 0;
    for (uint32_t i = 0; i < view->looks.count; i++)
        bytes += view->looks.items[i]->header.length;
    return bytes;
}

enum hg_status hg_session_look_check(struct hg_session *s, const struct hg_packet *packet,
    const union hgp_any *m, struct hg_error *err)
{
    const char *name = hgp_find(packet->header.type)->name;
    const struct look look = look_of((enum hgp_type)packet->header.type, m);
    const struct hg_session_view *view = hg_session_view_find(s, look.view);
    if (!view)
        return hg_error_set(
            err, HG_E_NOTFOUND, name, "view", "this session has no view %u", look.view);
    if (look.clear || bytes_of(view) + packet->header.length <= HG_SESSION_LOOK_BYTES)
        return HG_OK;
    return hg_error_set(err, HG_E_LIMIT, name, "overrides",
        "overrides of view %u came in more than %u bytes: send all that count once more, with "
        "clear",
        look.view, HG_SESSION_LOOK_BYTES);
}

// Whether a newer message leaves nothing of an older one.
static bool is_replaced(
    const struct hg_packet *old, const struct hg_packet *packet, const struct look *look)
{
    struct look was;
    if (old->header.type != packet->header.type)
        return false;
    if (packet->header.type == HGP_T_view_overrides)
        return look->clear;
    return packet->header.type == HGP_T_view_clip || !decode(old, &was) || was.asset == look->asset;
}

static enum hg_status add(
    struct hg_session_looks *l, struct hg_packet *packet, const struct look *look)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < l->count; i++) {
        if (is_replaced(l->items[i], packet, look))
            hg_packet_unref(l->items[i]);
        else
            l->items[kept++] = l->items[i];
    }
    l->count = kept;
    enum hg_status status = hg_grow(&l->items, &l->capacity, l->count + 1, sizeof *l->items);
    if (!status)
        l->items[l->count++] = hg_packet_ref(packet);
    return status;
}

void hg_session_look_note(struct hg_session *s, struct hg_packet *packet)
{
    struct look look;
    if (!decode(packet, &look))
        return;
    struct hg_session_view *view = hg_session_view_find(s, look.view);
    if (!view)
        return;
    if (add(&view->looks, packet, &look))
        hg_warn(SESSION, "no memory to remember how a view shows the scene");
    else
        hg_session_record_look(s, view, packet);
}

static bool is_look(uint16_t type)
{
    return type == HGP_T_view_clip || type == HGP_T_view_overrides || type == HGP_T_view_variant;
}

enum hg_status hg_session_look_take(struct hg_session *s, const struct hg_state_look *m)
{
    struct look look;
    struct hg_session_view *view = hg_session_view_find(s, m->view);
    if (!is_look(m->type))
        return HG_E_FORMAT;
    if (!view) // of a quota that is smaller now
        return HG_OK;
    struct hg_packet *packet =
        hg_packet_create(&(struct hgp_header){.type = m->type, .length = m->payload.size});
    if (!packet)
        return HG_E_NOMEM;
    if (m->payload.size)
        memcpy(packet->payload, m->payload.data, m->payload.size);
    const bool known = decode(packet, &look) && look.view == m->view;
    enum hg_status status = known ? add(&view->looks, packet, &look) : HG_E_FORMAT;
    hg_packet_unref(packet);
    return status;
}

void hg_session_look_restore(struct hg_session *s, const struct hg_session_view *view)
{
    struct hg_link *link = s->scene->link;
    for (uint32_t i = 0; i < view->looks.count; i++)
        hg_link_send_packet(
            link, s->number, hg_link_next_id(link), hg_packet_ref(view->looks.items[i]));
}

// ---- numbers of frames --------------------------------------------------------------------------

// The number that a query names. NULL: none.
static uint64_t *frame_in(enum hgp_type type, union hgp_any *m, uint32_t *view)
{
    switch (type) {
    case HGP_T_box_select:
        *view = m->box_select.view;
        return m->box_select.has_frame ? &m->box_select.frame : NULL;
    case HGP_T_surface_query:
        *view = m->surface_query.view;
        return m->surface_query.has_frame ? &m->surface_query.frame : NULL;
    case HGP_T_measure:
        *view = m->measure.view;
        return m->measure.has_frame ? &m->measure.frame : NULL;
    default:
        return NULL;
    }
}

struct hg_packet *hg_session_look_translate(
    struct hg_session *s, struct hg_packet *packet, const union hgp_any *message)
{
    union hgp_any m = *message;
    uint32_t number = 0;
    uint64_t *frame = frame_in((enum hgp_type)packet->header.type, &m, &number);
    const struct hg_session_view *view = frame ? hg_session_view_find(s, number) : NULL;
    if (!view || !view->number_base)
        return hg_packet_ref(packet);
    // Frames of an earlier worker are none of this one's: 0 is the number of no frame.
    *frame = *frame > view->number_base ? *frame - view->number_base : 0;
    struct hg_packet *translated = hg_packet_encode((enum hgp_type)packet->header.type, &m);
    if (translated)
        translated->header.request = packet->header.request;
    return translated;
}

void hg_session_look_renumber(
    struct hg_session *s, const struct hg_packet *query, struct hg_packet *answer)
{
    uint16_t type = answer->header.type;
    if ((type != HGP_T_box_selected && type != HGP_T_surfaces && type != HGP_T_measured) ||
        query->header.length < 8)
        return;
    struct hg_reader r = hg_reader_make(query->payload, query->header.length);
    hg_read_u32(&r); // bitmap
    const struct hg_session_view *view = hg_session_view_find(s, hg_read_u32(&r));
    if (!view || !view->number_base)
        return;
    // Layout: revision, frame.
    struct hg_reader at = hg_reader_make(answer->payload, answer->header.length);
    hg_read_u64(&at);
    const uint64_t number = hg_read_u64(&at) + view->number_base;
    for (int i = 0; !at.failed && i < 8; i++)
        answer->payload[8 + i] = (uint8_t)(number >> (8 * i));
}
