#include "server/broker/workers/trial.h"

#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "server/broker/session/session_view.h"
#include "server/broker/workers/suspect.h"

static const uint64_t least_patience_ns = 250000000u, most_patience_ns = 3000000000u;
static const uint64_t slow_patience_ns = 10000000000u; // of what takes that long to end the worker
static const uint64_t left_ns = 120000000000u;         // after its session a load may still run

static uint64_t now_of(const struct hg_session *s)
{
    return s->table->loop->now_ns;
}

// ---- what is known ------------------------------------------------------------------------------

// What the quarantine says of the things that a request is known by.
struct inquiry {
    const struct hg_session *session;
    const struct hg_quarantine_entry *known;   // one of them is there
    const struct hg_quarantine_entry *refused; // and may not be tried
};

static bool inquire(void *user, const struct hg_quarantine_entry *entry)
{
    struct inquiry *q = user;
    const uint64_t now_ns = now_of(q->session);
    const struct hg_quarantine_entry *known =
        hg_quarantine_find(q->session->table->quarantine, entry->tenant, entry->key, now_ns);
    if (!known)
        return true;
    q->known = known;
    q->refused = hg_quarantine_refuses(known, now_ns) ? known : NULL;
    return !q->refused;
}

enum hg_status hg_trial_check(
    const struct hg_session *s, const struct hg_packet *packet, struct hg_error *err)
{
    struct inquiry q = {.session = s};
    hg_suspect_each(s, packet, true, inquire, &q);
    if (!q.refused)
        return HG_OK;
    return hg_error_set(err, HG_E_WORKER, hgp_find(packet->header.type)->name, NULL,
        "at this (%s) a worker ended %u times; it is in quarantine for %.0f s more",
        q.refused->what, q.refused->deaths, (double)(q.refused->until_ns - now_of(s)) * 1e-9);
}

static bool forget(void *user, const struct hg_quarantine_entry *entry)
{
    const struct hg_session *s = user;
    hg_quarantine_forget(s->table->quarantine, entry->tenant, entry->key);
    return true;
}

void hg_trial_passed(struct hg_session *s, const struct hg_packet *packet)
{
    hg_suspect_each(s, packet, true, forget, s);
}

// ---- suspects -----------------------------------------------------------------------------------

static void suspect(struct hg_session *s, struct hg_request *request)
{
    if (!request->suspect)
        s->scene->link->trial.waiting++;
    request->suspect = true;
}

void hg_trial_meet(struct hg_session *s, struct hg_request *request)
{
    struct inquiry q = {.session = s};
    hg_suspect_each(s, request->packet, true, inquire, &q);
    if (q.known)
        suspect(s, request);
}

static bool is_tried(const struct hg_session *s, const struct hg_request *request)
{
    const struct hg_link_trial *trial = &s->scene->link->trial;
    return trial->session == s && trial->id && trial->id == request->link_id;
}

static bool is_tried_view(const struct hg_session *s, const struct hg_session_view *view)
{
    const struct hg_link_trial *trial = &s->scene->link->trial;
    return trial->session == s && !trial->id && trial->view == view->number;
}

// Scenes come before suspects, so that a death while a scene is built again is that scene's.
static bool is_rebuilding(const struct hg_link *link)
{
    return link->replay.scene || link->feed.rebuild;
}

bool hg_trial_holds_all(const struct hg_link *link)
{
    return link->trial.waiting && (link->trial.session || is_rebuilding(link));
}

// Order within a session stays: cameras before a suspect go with it.
static bool leads_to_suspect(const struct hg_request *request)
{
    while (request && !request->suspect)
        request = request->next;
    return request != NULL;
}

bool hg_trial_must_wait(const struct hg_session *s, const struct hg_request *request)
{
    const struct hg_link *link = s->scene->link;
    return link->trial.waiting && (hg_trial_holds_all(link) || !leads_to_suspect(request));
}

static uint64_t least(uint64_t a_ns, uint64_t b_ns)
{
    return a_ns < b_ns ? a_ns : b_ns;
}

// Twice as long as it ran, but others wait meanwhile; less than it ran would clear it each time.
static uint64_t patience_ns(uint64_t ran_ns)
{
    const uint64_t ns = least(2 * ran_ns, most_patience_ns);
    const uint64_t again_ns = least(ran_ns + ran_ns / 2, slow_patience_ns);
    const uint64_t longer_ns = ns > again_ns ? ns : again_ns;
    return longer_ns > least_patience_ns ? longer_ns : least_patience_ns;
}

void hg_trial_begin(struct hg_session *s, const struct hg_request *request)
{
    struct hg_link_trial *trial = &s->scene->link->trial;
    trial->session = s;
    trial->id = request->link_id;
    trial->sent_ns = now_of(s);
    trial->patience_ns = request->ran_ns ? patience_ns(request->ran_ns) : most_patience_ns;
}

void hg_trial_subscribe(struct hg_session *s)
{
    struct hg_link_trial *trial = &s->scene->link->trial;
    struct hg_session_view *view = s->views;
    while (view && !(view->held && view->accepted && view->subscribed))
        view = view->next;
    if (!view || trial->session || is_rebuilding(s->scene->link))
        return;
    view->held = false;
    trial->session = s;
    trial->id = 0;
    trial->view = view->number;
    trial->sent_ns = now_of(s);
    trial->patience_ns = patience_ns(view->ran_ns);
    hg_session_view_subscribe(s, view);
}

// Others may have waited for it.
void hg_trial_clear(struct hg_session *s, struct hg_request *request)
{
    struct hg_link *link = s->scene ? s->scene->link : NULL;
    if (!link || !request->suspect)
        return;
    request->suspect = false;
    link->trial.waiting--;
    link->feed.pump = true;
    if (request->sent && is_tried(s, request))
        link->trial.session = NULL;
}

void hg_trial_check_time(struct hg_link *link)
{
    const struct hg_link_trial *trial = &link->trial;
    struct hg_session *s = trial->session;
    if (!s || link->loop->now_ns - trial->sent_ns < trial->patience_ns)
        return;
    if (!trial->id) {
        hg_session_view_clear(s, hg_session_view_find(s, trial->view));
        return;
    }
    for (struct hg_request *it = s->first; it; it = it->next)
        if (it->link_id == trial->id) {
            hg_trial_clear(s, it);
            return;
        }
}

// ---- a death ------------------------------------------------------------------------------------

static bool find_hang(const struct hg_session *s, const struct hg_link_hang *hang)
{
    for (const struct hg_request *it = s->first; it && hang->request; it = it->next)
        if (it->sent && it->link_id == hang->request)
            return true;
    for (const struct hg_session_view *it = s->views; it && !hang->request; it = it->next)
        if (it->subscribed && it->granted && it->number == hang->view)
            return true;
    return false;
}

void hg_trial_accuse(struct hg_link *link)
{
    const struct hg_session_table *table = link->owner;
    const struct hg_link_hang *hang = &link->hang;
    link->trial.accused = false;
    for (struct hg_session *it = table->first; it && hang->fatal; it = it->next) {
        if (it->number != hang->channel || !it->scene || it->scene->link != link ||
            !find_hang(it, hang))
            continue;
        link->trial.session = it;
        link->trial.id = hang->request;
        link->trial.view = hang->view;
        link->trial.accused = true;
    }
}

struct charge {
    struct hg_session *session;
    bool alone;
};

static bool note(void *user, const struct hg_quarantine_entry *entry)
{
    const struct charge *c = user;
    hg_quarantine_note(c->session->table->quarantine, entry, c->alone, now_of(c->session));
    return true;
}

bool hg_trial_blames(struct hg_session *s, struct hg_request *request)
{
    if (!request->sent || !request->link_id)
        return false;
    const bool alone = is_tried(s, request);
    if (s->scene->link->trial.accused && !alone)
        return false;
    hg_suspect_each(s, request->packet, false, note, &(struct charge){s, alone});
    request->ran_ns = now_of(s) - request->sent_ns;
    request->deaths++;
    suspect(s, request);
    return alone || request->deaths >= HG_SESSION_TRIES;
}

bool hg_trial_blames_view(struct hg_session *s, struct hg_session_view *view)
{
    if (!view->subscribed || !view->granted)
        return false;
    if (is_tried_view(s, view))
        return true;
    if (s->scene->link->trial.accused)
        return false;
    view->ran_ns = now_of(s) - view->credit_ns;
    if (!view->suspect)
        s->scene->link->trial.waiting++;
    view->suspect = view->held = true;
    return false;
}

static bool leave(void *user, const struct hg_quarantine_entry *entry)
{
    const struct hg_session *s = user;
    struct hg_link_left *left = &s->scene->link->trial.left;
    struct hg_quarantine_entry *place = &left->files[left->count++ % HG_LINK_LEFT];
    *place = *entry;
    place->seen_ns = now_of(s);
    return true;
}

void hg_trial_leave(struct hg_session *s, const struct hg_request *request)
{
    if (s->scene && request->sent && !request->answered)
        hg_suspect_each(s, request->packet, false, leave, s);
}

void hg_trial_end(struct hg_session_table *table, struct hg_link *link)
{
    const uint64_t now_ns = link->loop->now_ns;
    for (uint32_t i = 0; i < link->trial.left.count && i < HG_LINK_LEFT; i++)
        if (now_ns - link->trial.left.files[i].seen_ns < left_ns)
            hg_quarantine_note(table->quarantine, &link->trial.left.files[i], false, now_ns);
    link->trial.left.count = 0;
    link->trial.accused = false;
    link->trial.session = NULL;
}
