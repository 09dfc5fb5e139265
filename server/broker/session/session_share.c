#include "server/broker/session/session_share.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "server/broker/session/session_allow.h"
#include "server/broker/session/session_annotation.h"
#include "server/broker/session/session_camera.h"
#include "server/broker/session/session_record.h"

enum { PARTICIPANTS = 4096 };
// Everything but messages that may be missed; those, unless the client is slow.
static bool may_miss(const struct hg_session *s)
{
    return !s->conn || hg_conn_is_slow(s->conn);
}

// ---- participants -------------------------------------------------------------------------------

static int compare_sessions(const void *a, const void *b)
{
    const struct hgp_participant *x = a, *y = b;
    return x->session < y->session ? -1 : x->session > y->session;
}

static uint32_t list_participants(const struct hg_shared_scene *scene, struct hgp_participant *out)
{
    uint32_t count = 0;
    for (struct hg_session *it = scene->people.first; it; it = it->share.next) {
        if ((!it->conn && !it->resume.parked_ns) || count == PARTICIPANTS)
            continue;
        out[count++] = (struct hgp_participant){.session = it->number,
            .role = it->role,
            .name = hgp_str_make(it->name),
            .label = hgp_str_make(it->share.label),
            .color = hg_session_record_color(it),
            .away = !it->conn};
    }
    qsort(out, count, sizeof *out, compare_sessions);
    return count;
}

static struct hg_packet *encode_participants(const struct hg_shared_scene *scene)
{
    struct hgp_participant *list = hg_calloc(PARTICIPANTS, sizeof *list);
    if (!list)
        return NULL;
    uint32_t count = list_participants(scene, list);
    struct hg_packet *packet =
        hg_packet_encode(HGP_T_participants, &(struct hgp_participants){.sessions = {list, count}});
    hg_free(list);
    return packet;
}

// The list is encoded only when a client watches it.
static void tell_participants(struct hg_shared_scene *scene)
{
    struct hg_session *it = scene->people.first;
    while (it && !(it->conn && it->share.watch.participants))
        it = it->share.next;
    struct hg_packet *packet = it ? encode_participants(scene) : NULL;
    scene->people.participants_due = it && !packet; // no memory: the next tick
    for (; it && packet; it = it->share.next)
        if (it->conn && it->share.watch.participants)
            hg_conn_send_packet(it->conn, 0, hg_packet_ref(packet));
    hg_packet_unref(packet);
}

void hg_session_share_participant(
    struct hg_session *s, uint32_t request, const struct hgp_participant_set *m)
{
    struct hg_error err = {0};
    if (hg_session_allow_act(s, "participant_set", &err)) {
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    if (m->has_label)
        snprintf(s->share.label, sizeof s->share.label, "%.*s", (int)m->label.size,
            m->label.size ? m->label.data : "");
    if (m->has_color) {
        s->share.has_color = true;
        s->share.color = m->color;
    }
    if (s->scene)
        s->scene->people.participants_due = true;
    hg_session_record(s);
    if (request)
        hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){0});
}

// ---- cursors ------------------------------------------------------------------------------------

void hg_session_share_cursor(struct hg_session *s, uint32_t request, const struct hgp_cursor_set *m)
{
    struct hg_error err = {0};
    if (!s->scene) {
        hg_error_set(&err, HG_E_STATE, "cursor_set", NULL, "open a scene first (scene_open)");
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    s->share.cursor = (struct hgp_cursor){.session = s->number, .shown = m->shown, .node = m->node};
    memcpy(s->share.cursor.position, m->position, sizeof m->position);
    memcpy(s->share.cursor.normal, m->normal, sizeof m->normal);
    s->share.cursor_due = true;
    if (request)
        hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){0});
}

static void tell_cursor(struct hg_session *s)
{
    struct hg_packet *packet = hg_packet_encode(HGP_T_cursor, &s->share.cursor);
    s->share.cursor_due = false;
    for (struct hg_session *it = s->scene->people.first; it && packet; it = it->share.next)
        if (it != s && it->share.watch.cursors && !may_miss(it))
            hg_conn_send_packet(it->conn, 0, hg_packet_ref(packet));
    hg_packet_unref(packet);
}

// ---- edits --------------------------------------------------------------------------------------

// The first id behind the bitmap of those messages that have optional fields.
static uint64_t object_of(const struct hg_packet *packet)
{
    struct hg_reader r = hg_reader_make(packet->payload, packet->header.length);
    switch (packet->header.type) {
    case HGP_T_mesh_set:
    case HGP_T_texture_set:
        return hg_read_u64(&r);
    case HGP_T_material_set:
    case HGP_T_node_set:
    case HGP_T_light_set:
    case HGP_T_camera_set:
        hg_read_u32(&r);
        return hg_read_u64(&r);
    case HGP_T_object_remove:
        hg_read_u16(&r);
        return hg_read_u64(&r);
    case HGP_T_asset_load:
        hg_read_u32(&r);
        return hg_read_u32(&r);
    case HGP_T_asset_unload:
    case HGP_T_animation_set:
    case HGP_T_variant_set:
        return hg_read_u32(&r);
    default:
        return 0;
    }
}

void hg_session_share_edited(struct hg_session *s, const struct hg_packet *packet)
{
    struct hg_packet *told = NULL;
    const uint64_t number = ++s->scene->people.edits;
    for (struct hg_session *it = s->scene->people.first; it; it = it->share.next) {
        if (!it->share.watch.edits || may_miss(it))
            continue;
        if (!told)
            told = hg_packet_encode(HGP_T_edited, &(struct hgp_edited){.number = number,
                                                      .revision = s->scene->revision,
                                                      .session = s->number,
                                                      .message = packet->header.type,
                                                      .object = object_of(packet)});
        if (!told)
            return; // no memory: the gap in the numbers says so
        hg_conn_send_packet(it->conn, 0, hg_packet_ref(told));
    }
    hg_packet_unref(told);
}

// ---- watching -----------------------------------------------------------------------------------

static void tell_state(struct hg_session *s, const struct hg_session_watch *what)
{
    struct hg_packet *packet = what->participants ? encode_participants(s->scene) : NULL;
    if (packet)
        hg_conn_send_packet(s->conn, 0, packet);
    else
        s->scene->people.participants_due |= what->participants;
    if (what->camera)
        hg_session_camera_tell(s);
    if (what->annotations)
        hg_session_annotation_tell(s, 0);
}

void hg_session_share_watch(struct hg_session *s, uint32_t request, const struct hgp_scene_watch *m)
{
    struct hg_error err = {0};
    struct hg_session_watch *w = &s->share.watch, before = *w;
    if (!s->scene)
        hg_error_set(&err, HG_E_STATE, "scene_watch", NULL, "open a scene first (scene_open)");
    if (err.status || hg_session_allow_act(s, "scene_watch", &err)) {
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    w->participants = m->has_participants ? m->participants : w->participants;
    w->cursors = m->has_cursors ? m->cursors : w->cursors;
    w->camera = m->has_camera ? m->camera : w->camera;
    w->annotations = m->has_annotations ? m->annotations : w->annotations;
    w->edits = m->has_edits ? m->edits : w->edits;
    tell_state(
        s, &(struct hg_session_watch){.participants = w->participants && !before.participants,
               .camera = w->camera && !before.camera,
               .annotations = w->annotations && !before.annotations});
    hg_session_record(s);
    if (request)
        hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){.revision = s->scene->revision});
}

void hg_session_share_link(struct hg_session *s, struct hg_shared_scene *scene)
{
    s->scene = scene;
    s->share.prev = NULL;
    s->share.next = scene->people.first;
    if (s->share.next)
        s->share.next->share.prev = s;
    scene->people.first = s;
}

void hg_session_share_unlink(struct hg_session *s)
{
    if (!s->scene)
        return;
    *(s->share.prev ? &s->share.prev->share.next : &s->scene->people.first) = s->share.next;
    if (s->share.next)
        s->share.next->share.prev = s->share.prev;
    s->share.prev = s->share.next = NULL;
    s->scene = NULL;
}

void hg_session_share_enter(struct hg_session *s, struct hg_shared_scene *scene)
{
    hg_session_share_link(s, scene);
    s->scene->people.participants_due = true;
}

void hg_session_share_leave(struct hg_session *s, bool away)
{
    s->scene->people.participants_due = true;
    hg_session_camera_leave(s);
    if (s->share.cursor.shown) {
        s->share.cursor = (struct hgp_cursor){.session = s->number};
        tell_cursor(s);
    }
    if (!away)
        s->share.watch = (struct hg_session_watch){0};
}

void hg_session_share_resume(struct hg_session *s)
{
    if (!s->scene)
        return;
    s->scene->people.participants_due = true;
    tell_state(s, &s->share.watch);
}

void hg_session_share_tick(struct hg_session_table *table)
{
    for (struct hg_session *it = table->first; it; it = it->next)
        if (it->scene && it->share.cursor_due)
            tell_cursor(it);
    for (struct hg_shared_scene *it = table->scenes.first; it; it = it->next) {
        if (it->people.participants_due)
            tell_participants(it);
        hg_session_camera_tick(table, it);
        hg_session_annotation_tick(it);
    }
}
