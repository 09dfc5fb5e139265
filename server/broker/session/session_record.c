#include "server/broker/session/session_record.h"

#include <stdio.h>
#include <string.h>

static struct hg_state_log *log_of(const struct hg_session *s)
{
    const struct hg_session_table *table = s->table;
    bool recorded = table->records_all || (s->resume.has_ticket && !table->scenes.ending);
    return recorded ? table->scenes.log : NULL;
}

static void hold(struct hg_session *s, uint64_t position)
{
    if (s->conn)
        hg_outq_hold_kept(&s->conn->out, position);
}

uint32_t hg_session_record_color(const struct hg_session *s)
{
    // Well apart from each other and from grey (ColorBrewer's Set1 and Dark2).
    static const uint32_t colors[] = {0xe41a1c, 0x377eb8, 0x4daf4a, 0x984ea3, 0xff7f00, 0xa65628,
        0xf781bf, 0x1b9e77, 0xd95f02, 0x7570b3, 0xe7298a, 0x66a61e};
    return s->share.has_color ? s->share.color
                              : colors[s->number % (sizeof colors / sizeof *colors)];
}

static uint8_t watch_bits(const struct hg_session_watch *watch)
{
    return (uint8_t)(watch->participants | watch->cursors << 1 | watch->camera << 2 |
                     watch->annotations << 3 | watch->edits << 4);
}

void hg_session_record_take_share(struct hg_session *s, const struct hg_state_session *m)
{
    s->share.watch = (struct hg_session_watch){.participants = m->watch & 1,
        .cursors = m->watch >> 1 & 1,
        .camera = m->watch >> 2 & 1,
        .annotations = m->watch >> 3 & 1,
        .edits = m->watch >> 4 & 1};
    s->share.has_color = m->has_color;
    s->share.color = m->color & 0xffffff;
    snprintf(s->share.label, sizeof s->share.label, "%.*s", (int)m->label.size,
        m->label.size ? m->label.data : "");
}

static uint64_t put_session(struct hg_session *s)
{
    struct hg_state_session m = {.number = s->number,
        .scene = s->scene ? s->scene->number : 0,
        .first_id = s->first_id,
        .role = (uint8_t)s->role,
        .has_token = s->resume.has_token,
        .batch_open = s->batch_open,
        .name = hgp_str_make(s->name),
        .tenant = hgp_str_make(s->tenant),
        .watch = watch_bits(&s->share.watch),
        .has_color = s->share.has_color,
        .color = s->share.color,
        .label = hgp_str_make(s->share.label)};
    memcpy(m.token, s->resume.token, sizeof m.token);
    memcpy(m.ticket, s->resume.ticket, sizeof m.ticket);
    return hg_state_put_session(log_of(s), &m);
}

void hg_session_record(struct hg_session *s)
{
    hold(s, put_session(s));
}

void hg_session_record_end(struct hg_session *s)
{
    hg_state_put_session_end(log_of(s), s->number);
}

static struct hgp_bytes payload_of(const struct hg_packet *packet)
{
    return packet ? (struct hgp_bytes){packet->payload, packet->header.length}
                  : (struct hgp_bytes){0};
}

static uint64_t put_view(struct hg_session *s, struct hg_session_view *view)
{
    view->unrecorded = false;
    if (!view->accepted)
        return 0;
    return hg_state_put_view(log_of(s), &(struct hg_state_view){.session = s->number,
                                            .number = view->number,
                                            .credit = view->subscribed ? view->first_credit : 0,
                                            .follows = view->follow.on,
                                            .params = payload_of(view->params),
                                            .camera = payload_of(view->camera)});
}

void hg_session_record_view(struct hg_session *s, struct hg_session_view *view)
{
    hold(s, put_view(s, view));
}

static uint64_t put_look(
    struct hg_session *s, const struct hg_session_view *view, struct hg_packet *packet)
{
    return view->accepted ? hg_state_put_look(log_of(s), s->number, view->number, packet) : 0;
}

void hg_session_record_look(
    struct hg_session *s, const struct hg_session_view *view, struct hg_packet *packet)
{
    hold(s, put_look(s, view, packet));
}

void hg_session_record_view_end(struct hg_session *s, const struct hg_session_view *view)
{
    if (view->accepted)
        hg_state_put_view_end(log_of(s), s->number, view->number);
}

void hg_session_record_cameras(struct hg_session_table *table)
{
    for (struct hg_session *s = table->first; s && table->scenes.log; s = s->next)
        for (struct hg_session_view *it = s->views; it; it = it->next)
            if (it->unrecorded)
                put_view(s, it);
}

void hg_session_record_all(struct hg_session *s)
{
    put_session(s);
    for (struct hg_session_view *it = s->views; it; it = it->next) {
        put_view(s, it);
        for (uint32_t i = 0; i < it->looks.count; i++)
            put_look(s, it, it->looks.items[i]);
    }
}
