#include "server/broker/trial.h"

#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "base/sha256.h"
#include "server/broker/session_view.h"

static const uint64_t least_patience_ns = 250000000u, most_patience_ns = 3000000000u;
static const uint64_t left_ns = 120000000000u; // after its session a load may still run

static uint64_t now_of(const struct hg_session *s)
{
    return s->table->loop->now_ns;
}

// ---- files --------------------------------------------------------------------------------------

static void name(struct hg_quarantine_entry *file, struct hgp_str text)
{
    snprintf(file->what, sizeof file->what, "%.*s", (int)text.size, text.size ? text.data : "");
}

static bool hash_load(const struct hgp_asset_load *m, struct hg_quarantine_entry *file)
{
    struct hg_sha256 *hasher = m->files.count ? hg_sha256_create() : NULL;
    name(file, m->files.count ? m->files.items[0].uri : m->path);
    if (!m->files.count)
        return hg_sha256(m->path.size ? m->path.data : "", m->path.size, file->key) == HG_OK;
    if (!hasher)
        return false;
    for (uint32_t i = 0; i < m->files.count; i++)
        hg_sha256_update(hasher, m->files.items[i].hash, 32);
    hg_sha256_end(hasher, file->key);
    return true;
}

static bool hash_environment(const struct hgp_environment_set *m, struct hg_quarantine_entry *file)
{
    if (m->has_hash) {
        memcpy(file->key, m->hash, 32);
        name(file, hgp_str_make("an environment"));
        return true;
    }
    if (m->has_path)
        name(file, m->path);
    return m->has_path && hg_sha256(m->path.data, m->path.size, file->key) == HG_OK;
}

// What a request loads. False: nothing.
static bool find_file(
    const struct hg_session *s, const struct hg_packet *packet, struct hg_quarantine_entry *file)
{
    const uint16_t type = packet->header.type;
    struct hg_arena arena = {0};
    union hgp_any any;
    bool found = false;
    if (type != HGP_T_asset_load && type != HGP_T_environment_set)
        return false;
    *file = (struct hg_quarantine_entry){0};
    snprintf(file->tenant, sizeof file->tenant, "%s", s->tenant);
    if (hgp_decode(HGP_VERSION_MAX, type, hg_reader_make(packet->payload, packet->header.length),
            &arena, &any, NULL) == HG_OK)
        found = type == HGP_T_asset_load ? hash_load(&any.asset_load, file)
                                         : hash_environment(&any.environment_set, file);
    hg_arena_finish(&arena);
    return found;
}

enum hg_status hg_trial_check(
    const struct hg_session *s, const struct hg_packet *packet, struct hg_error *err)
{
    struct hg_quarantine_entry file;
    if (!find_file(s, packet, &file))
        return HG_OK;
    const struct hg_quarantine_entry *known =
        hg_quarantine_find(s->table->quarantine, file.tenant, file.key, now_of(s));
    if (!known || !hg_quarantine_refuses(known, now_of(s)))
        return HG_OK;
    return hg_error_set(err, HG_E_WORKER, hgp_find(packet->header.type)->name, NULL,
        "this file ended a worker %u times; it is in quarantine for %.0f s more", known->deaths,
        (double)(known->until_ns - now_of(s)) * 1e-9);
}

void hg_trial_passed(struct hg_session *s, const struct hg_packet *packet)
{
    struct hg_quarantine_entry file;
    if (find_file(s, packet, &file))
        hg_quarantine_forget(s->table->quarantine, file.tenant, file.key);
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
    struct hg_quarantine_entry file;
    if (find_file(s, request->packet, &file) &&
        hg_quarantine_find(s->table->quarantine, file.tenant, file.key, now_of(s)))
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
static bool is_rebuilding(const struct hg_session *s)
{
    const struct hg_link *link = s->scene->link;
    if (link->replay.scene)
        return true;
    for (const struct hg_shared_scene *it = s->table->scenes.first; it; it = it->next)
        if (it->link == link && !it->in_worker)
            return true;
    return false;
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
    const struct hg_link_trial *trial = &s->scene->link->trial;
    if (!trial->waiting)
        return false;
    return trial->session || !leads_to_suspect(request) || is_rebuilding(s);
}

static uint64_t patience_ns(uint64_t ran_ns)
{
    uint64_t ns = 2 * ran_ns;
    return ns < least_patience_ns  ? least_patience_ns
           : ns > most_patience_ns ? most_patience_ns
                                   : ns;
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
    if (!view || trial->session || is_rebuilding(s))
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

bool hg_trial_blames(struct hg_session *s, struct hg_request *request)
{
    struct hg_quarantine_entry file;
    if (!request->sent || !request->link_id)
        return false;
    const bool alone = is_tried(s, request);
    if (s->scene->link->trial.accused && !alone)
        return false;
    if (find_file(s, request->packet, &file))
        hg_quarantine_note(s->table->quarantine, &file, alone, now_of(s));
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

void hg_trial_leave(struct hg_session *s, const struct hg_request *request)
{
    struct hg_quarantine_entry file;
    if (!s->scene || !request->sent || request->answered || !find_file(s, request->packet, &file))
        return;
    struct hg_link_left *left = &s->scene->link->trial.left;
    file.seen_ns = now_of(s);
    left->files[left->count++ % HG_LINK_LEFT] = file;
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
