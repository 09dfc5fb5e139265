#include "server/worker/session.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "server/worker/task.h"

// What may wait for a session's turn, or behind its running task.
enum { WAITING_LIMIT = 65536, WAITING_LIMIT_BYTES = 512 * 1024 * 1024 };

// ---- tenants ------------------------------------------------------------------------------------

static struct tenant *hold_tenant(struct render_state *s, struct hgp_str name)
{
    for (struct tenant *it = s->tenants; it; it = it->next)
        if (strlen(it->name) == name.size && memcmp(it->name, name.data, name.size) == 0) {
            it->sessions++;
            return it;
        }
    struct tenant *tenant = hg_calloc(1, sizeof *tenant);
    if (!tenant)
        return NULL;
    snprintf(tenant->name, sizeof tenant->name, "%.*s", (int)name.size, name.data);
    tenant->sessions = 1;
    tenant->weight = HG_TURN_WEIGHT;
    tenant->next = s->tenants;
    s->tenants = tenant;
    return tenant;
}

static void release_tenant(struct render_state *s, struct tenant *tenant)
{
    struct tenant **link = &s->tenants;
    if (!tenant || --tenant->sessions)
        return;
    while (*link != tenant)
        link = &(*link)->next;
    *link = tenant->next;
    hg_free(tenant);
}

enum hg_status hg_worker_session_set_tenant(
    struct render_state *s, struct session *session, const struct hgp_session_tenant *m)
{
    struct hg_refbuf *roots = m->has_roots ? hg_refbuf_create((size_t)m->roots.size + 1) : NULL;
    struct tenant *tenant = roots || !m->has_roots ? hold_tenant(s, m->tenant) : NULL;
    if (!tenant) {
        hg_refbuf_unref(roots);
        return HG_E_NOMEM;
    }
    if (roots && m->roots.size)
        memcpy(roots->data, m->roots.data, m->roots.size);
    hg_refbuf_unref(session->roots);
    session->roots = roots;
    tenant->weight = m->weight;
    release_tenant(s, session->tenant);
    session->tenant = tenant;
    session->turn = (struct turn){0};
    return HG_OK;
}

// ---- sessions -----------------------------------------------------------------------------------

struct session *hg_worker_session_find(struct render_state *s, uint32_t channel)
{
    for (struct session *it = s->sessions; it; it = it->next)
        if (it->channel == channel)
            return it;
    return NULL;
}

enum hg_status hg_worker_session_create(struct render_state *s, uint32_t channel,
    const struct hgp_session_attach *m, struct session **out, struct hg_error *err)
{
    *out = NULL;
    if (hg_worker_session_find(s, channel))
        return hg_error_set(
            err, HG_E_EXISTS, "session_attach", "channel", "cannot attach the session");
    struct session *session = hg_calloc(1, sizeof *session);
    if (!session)
        return hg_error_set(
            err, HG_E_NOMEM, "session_attach", "channel", "cannot attach the session");
    session->tenant = hold_tenant(s, hgp_str_make(""));
    session->scene = session->tenant ? hg_scene_slot_hold(s, m->scene) : NULL;
    if (!session->scene) {
        release_tenant(s, session->tenant);
        hg_free(session);
        return hg_error_set(err, HG_E_NOMEM, "session_attach", NULL, "no memory for a scene");
    }
    session->channel = channel;
    session->number = m->session;
    session->role = m->role;
    session->first_id = m->first_id;
    session->id_count = m->id_count;
    session->restoring = m->replay;
    session->waiting_end = &session->waiting;
    session->next = s->sessions;
    s->sessions = session;
    *out = session;
    return HG_OK;
}

void hg_worker_session_destroy(struct render_state *s, struct session *session)
{
    if (session->task)
        atomic_store(&session->task->cancel, true); // comes back later and finds no session
    for (struct command *c = session->waiting, *next; c; c = next) {
        next = c->next;
        hg_worker_free_command(s->w, c);
    }
    struct session **link = &s->sessions;
    while (*link != session)
        link = &(*link)->next;
    *link = session->next;
    hg_refbuf_unref(session->roots);
    hg_scene_slot_release(s, session->scene);
    release_tenant(s, session->tenant);
    hg_writer_finish(&session->file);
    hg_free(session);
}

void hg_worker_session_edited(struct session *session)
{
    session->scene->dirty = true;
    if (!session->batch_depth)
        hg_scene_slot_publish(session->scene);
}

void hg_worker_session_close_batch(struct session *session)
{
    if (!session->batch_depth)
        return;
    session->batch_depth = 0;
    session->scene->open_batches--;
    hg_scene_slot_publish(session->scene);
}

// ---- messages that wait -------------------------------------------------------------------------

enum hg_status hg_worker_session_hold(
    struct session *session, struct command *c, struct hg_error *err)
{
    const uint64_t bytes = session->waiting_bytes + c->header.length;
    if (session->waiting_count >= WAITING_LIMIT || bytes > WAITING_LIMIT_BYTES)
        return hg_error_set(err, HG_E_BUSY, "session", NULL,
            "%u messages of %llu bytes wait already", session->waiting_count,
            (unsigned long long)session->waiting_bytes);
    session->waiting_count++;
    session->waiting_bytes = bytes;
    c->next = NULL;
    *session->waiting_end = c;
    session->waiting_end = &c->next;
    return HG_OK;
}

bool hg_worker_session_is_waiting(const struct session *session)
{
    return session->waiting && !session->task;
}

struct command *hg_worker_session_resume(struct session *session)
{
    struct command *c = session->task ? NULL : session->waiting;
    if (!c)
        return NULL;
    session->waiting = c->next;
    session->waiting_count--;
    session->waiting_bytes -= c->header.length;
    if (!session->waiting)
        session->waiting_end = &session->waiting;
    return c;
}
