#include "server/broker/session_record.h"

#include <string.h>

static struct hg_state_log *log_of(const struct hg_session *s)
{
    return s->resume.has_ticket && !s->table->scenes.ending ? s->table->scenes.log : NULL;
}

static void hold(struct hg_session *s, uint64_t position)
{
    if (s->conn)
        hg_outq_hold(&s->conn->out, position);
}

void hg_session_record(struct hg_session *s)
{
    struct hg_state_session m = {.number = s->number,
        .scene = s->scene ? s->scene->number : 0,
        .first_id = s->first_id,
        .role = (uint8_t)s->role,
        .has_token = s->resume.has_token,
        .batch_open = s->batch_open,
        .name = hgp_str_make(s->name),
        .tenant = hgp_str_make(s->tenant)};
    memcpy(m.token, s->resume.token, sizeof m.token);
    memcpy(m.ticket, s->resume.ticket, sizeof m.ticket);
    hold(s, hg_state_put_session(log_of(s), &m));
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

void hg_session_record_view(struct hg_session *s, struct hg_session_view *view)
{
    view->unrecorded = false;
    if (view->accepted)
        hold(
            s, hg_state_put_view(log_of(s), &(struct hg_state_view){.session = s->number,
                                                .number = view->number,
                                                .credit = view->subscribed ? view->first_credit : 0,
                                                .params = payload_of(view->params),
                                                .camera = payload_of(view->camera)}));
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
                hg_session_record_view(s, it);
}

void hg_session_record_all(struct hg_session *s)
{
    if (s->resume.has_ticket)
        hg_session_record(s);
    for (struct hg_session_view *it = s->views; it; it = it->next)
        hg_session_record_view(s, it);
}
