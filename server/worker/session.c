// session.c - sessions come, share scenes and go.
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/scene/fingerprint.h"
#include "server/worker/serve.h"

struct session *session_find(struct serve *s, uint32_t channel)
{
    for (struct session *it = s->sessions; it; it = it->next)
        if (it->channel == channel)
            return it;
    return NULL;
}

struct view_slot *session_find_view(struct session *session, uint32_t number)
{
    for (struct view_slot *it = session->views; it; it = it->next)
        if (it->number == number)
            return it;
    return NULL;
}

struct view_slot *session_need_view(const struct request *r, uint32_t number)
{
    struct view_slot *view = session_find_view(r->session, number);
    if (!view) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_NOTFOUND, "view", NULL, "this session has no view %u", number);
        serve_fail(r, &err);
    }
    return view;
}

// ---- scenes -------------------------------------------------------------------------------------

static struct scene_slot *scene_hold(struct serve *s, struct hgp_str key)
{
    for (struct scene_slot *it = s->scenes; it; it = it->next)
        if (strlen(it->key) == key.size && memcmp(it->key, key.data, key.size) == 0) {
            it->sessions++;
            return it;
        }
    struct scene_slot *slot = hg_calloc(1, sizeof *slot);
    if (slot)
        slot->key = hg_strndup(key.data ? key.data : "", key.size);
    if (!slot || !slot->key || hg_scene_create(&slot->scene) != HG_OK) {
        if (slot)
            hg_free(slot->key);
        hg_free(slot);
        return NULL;
    }
    slot->sessions = 1;
    slot->next = s->scenes;
    s->scenes = slot;
    return slot;
}

static void scene_release(struct serve *s, struct scene_slot *slot)
{
    if (--slot->sessions)
        return;
    struct scene_slot **link = &s->scenes;
    while (*link != slot)
        link = &(*link)->next;
    *link = slot->next;
    hg_fingerprint_destroy(slot->fingerprint);
    hg_scene_destroy(slot->scene);
    hg_free(slot->key);
    hg_free(slot);
}

// ---- sessions -----------------------------------------------------------------------------------

void session_attach(
    struct serve *s, uint32_t channel, uint32_t request, const struct hgp_session_attach *m)
{
    struct hg_error err = {0};
    struct session *session = session_find(s, channel) ? NULL : hg_calloc(1, sizeof *session);
    if (!session) {
        hg_error_set(&err, session_find(s, channel) ? HG_E_EXISTS : HG_E_NOMEM, "session_attach",
            "channel", "cannot attach the session");
        link_send_error(s->w, channel, request, &err);
        return;
    }
    session->scene = scene_hold(s, m->scene);
    if (!session->scene) {
        hg_free(session);
        hg_error_set(&err, HG_E_NOMEM, "session_attach", NULL, "no memory for a scene");
        link_send_error(s->w, channel, request, &err);
        return;
    }
    session->channel = channel;
    session->number = m->session;
    session->role = m->role;
    session->first_id = m->first_id;
    session->id_count = m->id_count;
    session->max_pixels = m->max_pixels;
    session->restoring = m->replay;
    session->waiting_end = &session->waiting;
    session->next = s->sessions;
    s->sessions = session;
    hg_log_write(HG_LOG_INFO, HG_LOG_SESSION, HG_OK, m->session, "attached to scene '%s'%s",
        session->scene->key, m->replay ? " for replay" : "");
    if (request)
        link_send(s->w, channel, request, HGP_T_ok,
            &(struct hgp_ok){.revision = session->scene->scene->revision});
}

void view_slot_destroy(struct serve *s, struct session *session, struct view_slot *view)
{
    struct view_slot **link = &session->views;
    while (*link != view)
        link = &(*link)->next;
    *link = view->next;
    if (s->turn == view)
        s->turn = NULL;
    for (struct frame_wait *wait = view->waits, *next; wait; wait = next) {
        next = wait->next;
        hg_free(wait);
    }
    hg_view_destroy(view->view);
    hg_writer_finish(&view->sending);
    hg_writer_finish(&view->receiving);
    hg_free(view);
    atomic_fetch_sub(&s->w->view_count, 1);
}

void session_publish(struct session *session)
{
    struct scene_slot *slot = session->scene;
    if (slot->dirty)
        hg_scene_publish(slot->scene);
    slot->dirty = false;
}

void session_close_batch(struct session *session)
{
    if (!session->batch_depth)
        return;
    session->batch_depth = 0;
    session->scene->open_batches--;
    session_publish(session);
}

void session_detach(struct serve *s, struct session *session)
{
    session_close_batch(session);
    while (session->views)
        view_slot_destroy(s, session, session->views);
    if (session->task)
        atomic_store(&session->task->cancel, true); // comes back later and finds no session
    for (struct command *c = session->waiting, *next; c; c = next) {
        next = c->next;
        hg_refbuf_unref(c->payload);
        hg_free(c);
    }
    struct session **link = &s->sessions;
    while (*link != session)
        link = &(*link)->next;
    *link = session->next;
    scene_release(s, session->scene);
    hg_writer_finish(&session->file);
    hg_free(session);
}
