#include "server/broker/state/state.h"

#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "server/broker/session/session.h"
#include "server/broker/session/session_look.h"
#include "server/broker/session/session_record.h"
#include "server/broker/session/session_share.h"
#include "server/broker/session/session_view.h"

// ---- reading ------------------------------------------------------------------------------------

static struct hg_packet *make_packet(const struct hg_state_edit *edit)
{
    struct hg_packet *packet =
        hg_packet_create(&(struct hgp_header){.type = edit->type, .length = edit->payload.size});
    if (packet && edit->payload.size)
        memcpy(packet->payload, edit->payload.data, edit->payload.size);
    return packet;
}

static enum hg_status take_edit(struct hg_session_table *table, const struct hg_state_edit *edit)
{
    struct hg_shared_scene *scene = hg_shared_scene_by_number(&table->scenes, edit->scene);
    if (!scene || !hg_journal_wants(edit->type))
        return HG_E_FORMAT;
    struct hg_packet *packet = make_packet(edit);
    enum hg_status status = packet ? hg_journal_accept(scene->journal, packet) : HG_E_NOMEM;
    hg_packet_unref(packet);
    if (scene->revision < edit->revision)
        scene->revision = edit->revision;
    return status;
}

// ---- sessions -----------------------------------------------------------------------------------

static void leave_scene(struct hg_session *s)
{
    while (s->views)
        hg_session_view_remove(s, s->views);
    if (s->scene)
        s->scene->sessions--;
    hg_session_share_unlink(s);
}

static enum hg_status enter_scene(struct hg_session *s, uint32_t number, uint32_t first_id)
{
    const uint64_t range = (uint64_t)(first_id - 1) / HG_SCENE_ID_RANGE;
    if (s->scene && s->scene->number == number && s->first_id == first_id)
        return HG_OK;
    leave_scene(s);
    if (!number)
        return HG_OK;
    struct hg_shared_scene *scene = hg_shared_scene_by_number(&s->table->scenes, number);
    if (!scene || !first_id || range >= HG_SCENE_RANGES)
        return HG_E_FORMAT;
    s->first_id = first_id;
    hg_session_share_link(s, scene);
    s->scene->sessions++;
    s->scene->ranges[range / 64] |= UINT64_C(1) << range % 64;
    return HG_OK;
}

static enum hg_status take_session(struct hg_session_table *table, const struct hg_state_session *m)
{
    struct hg_session *s = hg_session_find(table, m->number);
    if (m->role < HGP_role_VIEW || m->role > HGP_role_ADMIN)
        return HG_E_FORMAT;
    if (!s)
        s = hg_session_create(table, m->number, (enum hgp_role)m->role, m->name);
    if (!s)
        return HG_E_NOMEM;
    if (table->last_number < s->number)
        table->last_number = s->number;
    snprintf(s->tenant, sizeof s->tenant, "%.*s", (int)m->tenant.size, m->tenant.data);
    hg_session_record_take_share(s, m);
    s->batch_open = m->batch_open;
    s->resume = (struct hg_session_resume){
        .has_token = m->has_token, .has_ticket = true, .parked_ns = table->loop->now_ns};
    memcpy(s->resume.token, m->token, sizeof s->resume.token);
    memcpy(s->resume.ticket, m->ticket, sizeof s->resume.ticket);
    return enter_scene(s, m->scene, m->first_id);
}

static void end_session(struct hg_session_table *table, uint32_t number)
{
    struct hg_session *s = hg_session_find(table, number);
    if (!s)
        return;
    leave_scene(s);
    hg_session_destroy(s);
}

static struct hg_packet *packet_of(enum hgp_type type, const struct hgp_bytes *payload)
{
    union hgp_any any;
    if (hgp_decode(HGP_VERSION_MAX, (uint16_t)type, hg_reader_make(payload->data, payload->size),
            NULL, &any, NULL))
        return NULL;
    return make_packet(&(struct hg_state_edit){.type = (uint16_t)type, .payload = *payload});
}

// Frames of earlier daemons had smaller numbers: fewer than microseconds have passed since 1970.
static void number_frames(struct hg_session_view *view)
{
    view->last_number = view->number_base = hg_clock_wall_ns() / 1000;
}

static enum hg_status take_view(struct hg_session_table *table, const struct hg_state_view *m)
{
    struct hg_session *s = hg_session_find(table, m->session);
    struct hg_error err = {0};
    if (!s || !s->scene)
        return HG_OK; // it has left the scene since
    struct hg_packet *params = packet_of(HGP_T_view_set, &m->params);
    struct hg_packet *camera = m->camera.size ? packet_of(HGP_T_view_camera, &m->camera) : NULL;
    enum hg_status status = !params || (m->camera.size && !camera) ? HG_E_FORMAT : HG_OK;
    struct hg_session_view *view = status ? NULL : hg_session_view_take(s, m->number, params, &err);
    if (!status && !view)
        status = err.status;
    if (!status) {
        view->subscribed = m->credit > 0;
        view->credit = view->first_credit = m->credit;
        view->follow.on = m->follows;
        hg_packet_unref(view->camera);
        view->camera = camera ? hg_packet_ref(camera) : NULL;
        number_frames(view);
    }
    hg_packet_unref(params);
    hg_packet_unref(camera);
    if (status == HG_E_LIMIT) // of a quota that is smaller now
        hg_warn(SESSION, "view %u of session %u is not restored: %s", m->number, m->session,
            err.reason);
    return status == HG_E_LIMIT ? HG_OK : status;
}

static void end_view(struct hg_session_table *table, const struct hg_state_view *m)
{
    struct hg_session *s = hg_session_find(table, m->session);
    struct hg_session_view *view = s && s->scene ? hg_session_view_find(s, m->number) : NULL;
    if (view)
        hg_session_view_remove(s, view);
}

// ---- the log ------------------------------------------------------------------------------------

static enum hg_status end_scene(struct hg_session_table *table, uint32_t number)
{
    struct hg_shared_scene *scene = hg_shared_scene_by_number(&table->scenes, number);
    if (!scene)
        return HG_E_FORMAT;
    for (struct hg_session *it = table->first; it; it = it->next)
        if (it->scene == scene)
            leave_scene(it);
    hg_shared_scene_drop(&table->scenes, scene);
    return HG_OK;
}

static enum hg_status take_annotation(
    struct hg_session_table *table, const struct hg_state_record *record)
{
    const struct hg_state_annotation *m = &record->of.annotation;
    struct hg_shared_scene *scene = hg_shared_scene_by_number(&table->scenes, m->scene);
    if (!scene)
        return HG_E_FORMAT;
    struct hg_annotations *all = &scene->people.annotations;
    if (record->kind == HG_STATE_ANNOTATION)
        return hg_annotation_restore(all, m);
    hg_annotation_remove(all, m->number);
    all->gone_count = 0; // nothing was told yet
    all->all_due = all->due = false;
    if (all->last_number < m->number)
        all->last_number = m->number;
    return HG_OK;
}

static enum hg_status take_look(struct hg_session_table *table, const struct hg_state_look *m)
{
    struct hg_session *s = hg_session_find(table, m->session);
    return s && s->scene ? hg_session_look_take(s, m) : HG_OK; // it has left the scene since
}

// Of people in scenes and of what their views show.
static enum hg_status take_later(
    struct hg_session_table *table, const struct hg_state_record *record)
{
    struct hg_join_tickets *tickets = table->tickets;
    switch (record->kind) {
    case HG_STATE_ANNOTATION:
    case HG_STATE_ANNOTATION_END:
        return take_annotation(table, record);
    case HG_STATE_TICKET:
        return hg_join_ticket_restore(tickets, &record->of.ticket);
    case HG_STATE_TICKET_END:
        hg_join_ticket_remove(tickets, NULL, record->of.ticket.number);
        if (tickets->last_number < record->of.ticket.number)
            tickets->last_number = record->of.ticket.number;
        return HG_OK;
    case HG_STATE_LOOK:
        return take_look(table, &record->of.look);
    default:
        hg_block_add(table->blocks, NULL, record->of.block.hash, record->of.block.until_s);
        return HG_OK;
    }
}

enum hg_status hg_state_take_record(void *user, const uint8_t *body, size_t size)
{
    struct hg_session_table *table = user;
    struct hg_state_record record;
    enum hg_status status = hg_state_record_decode(body, size, &record);
    if (status)
        return status;
    switch (record.kind) {
    case HG_STATE_SCENE:
        return hg_shared_scene_restore(&table->scenes, &record.of.scene) ? HG_OK : HG_E_FORMAT;
    case HG_STATE_EDIT:
        return take_edit(table, &record.of.edit);
    case HG_STATE_SCENE_END:
        return end_scene(table, record.of.scene.number);
    case HG_STATE_QUARANTINE:
        hg_quarantine_restore(table->quarantine, &record.of.suspect, table->loop->now_ns);
        return HG_OK;
    case HG_STATE_SESSION:
        return take_session(table, &record.of.session);
    case HG_STATE_SESSION_END:
        end_session(table, record.of.session.number);
        return HG_OK;
    case HG_STATE_VIEW:
        return take_view(table, &record.of.view);
    case HG_STATE_VIEW_END:
        end_view(table, &record.of.view);
        return HG_OK;
    case HG_STATE_QUARANTINE_END:
        hg_quarantine_restore_end(table->quarantine, &record.of.suspect);
        return HG_OK;
    default:
        return take_later(table, &record);
    }
}

static enum hg_status pass_over(void *user, const uint8_t *body, size_t size)
{
    (void)user;
    (void)body;
    (void)size;
    return HG_OK;
}

enum hg_status hg_state_open(
    struct hg_session_table *table, bool is_known, struct hg_state_log **out, struct hg_error *err)
{
    const struct hg_options *o = table->options;
    *out = NULL;
    if (!o->state_dir)
        return HG_OK;
    const struct hg_state_log_options options = {.folder = o->state_dir,
        .wait_for_sync = strcmp(o->durability, "synced") == 0,
        .go_on = strcmp(o->state_failure, "continue") == 0,
        .is_known = is_known,
        .sync_interval_ns = o->sync_interval_ns};
    enum hg_status status =
        hg_state_log_open(&options, is_known ? pass_over : hg_state_take_record, table, out, err);
    table->scenes.log = table->quarantine->log = *out;
    return status;
}

static void give_up(struct hg_session_table *table, struct hg_shared_scene *scene)
{
    for (struct hg_session *it = table->first, *next; it; it = next) {
        next = it->next;
        if (it->scene != scene)
            continue;
        leave_scene(it);
        hg_session_destroy(it);
    }
    hg_shared_scene_drop(&table->scenes, scene);
}

// Scenes without a name can be opened by the sessions that have them only.
static void place(struct hg_session_table *table, struct hg_shared_scene *scene)
{
    uint64_t until_ns = table->loop->now_ns + table->options->resume_timeout_ns;
    if (!scene->name[0] && scene->sessions == 1) {
        give_up(table, scene);
    } else if (!hg_shared_scene_place(&table->scenes, scene, scene->name[0] ? until_ns : 0)) {
        hg_warn(JOURNAL, "scene '%s' of %s is given up: max-workers tenants have scenes",
            scene->key, scene->tenant);
        give_up(table, scene);
    } else {
        hg_info(JOURNAL, "scene '%s' of %s was restored: %llu edits, revision %llu", scene->key,
            scene->tenant, (unsigned long long)hg_journal_get_stats(scene->journal).entries,
            (unsigned long long)scene->revision);
    }
}

void hg_state_place(struct hg_session_table *table)
{
    for (struct hg_shared_scene *it = table->scenes.first, *next; it; it = next) {
        next = it->next;
        place(table, it);
    }
    for (struct hg_session *it = table->first; it; it = it->next)
        it->resume.parked_ns = table->loop->now_ns;
}

// ---- snapshots ----------------------------------------------------------------------------------

struct target {
    struct hg_state_log *log;
    const struct hg_shared_scene *scene;
};

static void put_entry(void *user, struct hg_packet *packet)
{
    const struct target *t = user;
    hg_state_put_edit(t->log, t->scene->number, t->scene->revision, packet);
}

static void put_scene(struct hg_state_log *log, const struct hg_shared_scene *scene)
{
    hg_state_put_scene(log, &(struct hg_state_scene){scene->number, hgp_str_make(scene->tenant),
                                hgp_str_make(scene->name)});
    hg_journal_each(scene->journal, put_entry, &(struct target){log, scene});
    hg_annotations_record_all(log, scene->number, &scene->people.annotations);
}

void hg_state_put_all(struct hg_session_table *table)
{
    for (const struct hg_shared_scene *it = table->scenes.first; it; it = it->next)
        put_scene(table->scenes.log, it);
    for (struct hg_session *it = table->first; it; it = it->next)
        hg_session_record_all(it);
    hg_quarantine_write(table->quarantine, table->loop->now_ns);
    hg_join_tickets_record_all(table->tickets, table->scenes.log);
    hg_block_record_all(table->blocks, table->scenes.log);
}

void hg_state_tend(struct hg_session_table *table)
{
    struct hg_state_log *log = table->scenes.log;
    uint64_t now_ns = table->loop->now_ns;
    if (!log || !hg_state_log_wants_snapshot(log, now_ns))
        return;
    hg_state_log_begin_snapshot(log, now_ns);
    hg_state_put_all(table);
    hg_state_log_end_snapshot(log);
}
