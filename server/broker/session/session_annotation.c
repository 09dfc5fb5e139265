#include "server/broker/session/session_annotation.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "server/broker/session/session_allow.h"
#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_record.h"
#include "server/broker/session/session_rules.h"

enum { VIEWER_SHARE = 10 }; // a token that may only look has at most this part of a scene's

// The same token; of a join ticket, which many may have, the same session.
static bool is_own(const struct hg_session *s, const struct hg_annotation *it)
{
    static const uint8_t local[32];
    const uint8_t *key = s->resume.has_token ? s->resume.token : local;
    return memcmp(key, it->author_key, sizeof it->author_key) == 0 &&
           it->author_session == (s->scope.is_ticket ? s->number : 0);
}

static bool may_change(const struct hg_session *s, const struct hg_annotation *it)
{
    return s->role >= HGP_role_EDIT || is_own(s, it);
}

static struct hgp_annotation_entry entry_of(
    const struct hg_session *reader, const struct hg_annotation *it)
{
    struct hgp_annotation_entry out = {.annotation = it->number,
        .kind = it->kind,
        .node = it->node,
        .color = it->color,
        .text = hgp_str_make(it->text),
        .author = hgp_str_make(it->author),
        .label = hgp_str_make(it->label),
        .own = is_own(reader, it),
        .time_ms = it->time_ms,
        .changed_ms = it->changed_ms};
    memcpy(out.position, it->position, sizeof out.position);
    memcpy(out.normal, it->normal, sizeof out.normal);
    return out;
}

static void send_one(struct hg_session *s, uint32_t request, const struct hg_annotation *it)
{
    struct hgp_annotation_entry entry = entry_of(s, it);
    hg_conn_send(
        s->conn, request, HGP_T_annotation, &(struct hgp_annotation){.annotation = {&entry, 1}});
}

// ---- rules --------------------------------------------------------------------------------------

static bool may_begin(struct hg_session *s, const char *what, struct hg_error *err)
{
    if (!s->scene) {
        hg_error_set(err, HG_E_STATE, what, NULL, "open a scene first (scene_open)");
        return false;
    }
    return !hg_session_allow_act(s, what, err) && !hg_session_rules_may_change(s->table, what, err);
}

static uint32_t count_of_token(const struct hg_session *s)
{
    static const uint8_t local[32];
    const struct hg_annotations *all = &s->scene->people.annotations;
    const uint8_t *key = s->resume.has_token ? s->resume.token : local;
    uint32_t count = 0;
    for (uint32_t i = 0; i < all->count; i++)
        count += memcmp(all->items[i].author_key, key, 32) == 0;
    return count;
}

static enum hg_status check_room(const struct hg_session *s, struct hg_error *err)
{
    const uint32_t most = s->table->options->max_annotations;
    const uint32_t viewers = most / VIEWER_SHARE ? most / VIEWER_SHARE : 1;
    if (s->scene->people.annotations.count >= most)
        hg_error_set(err, HG_E_LIMIT, "annotation_set", NULL,
            "the scene has %u annotations, as many as it may (max-annotations)", most);
    else if (s->role < HGP_role_EDIT && count_of_token(s) >= viewers)
        hg_error_set(err, HG_E_LIMIT, "annotation_set", NULL,
            "this token or join ticket has %u annotations in the scene, as many as those that may "
            "not edit may have (a tenth of max-annotations)",
            viewers);
    else
        return HG_OK;
    return hg_error_limit(err, "max-annotations", 0);
}

// The one that is to be changed, or a new one. NULL: err says why.
static const struct hg_annotation *find_base(struct hg_session *s,
    const struct hgp_annotation_set *m, struct hg_annotation *fresh, struct hg_error *err)
{
    const struct hg_annotation *old =
        m->annotation ? hg_annotation_find(&s->scene->people.annotations, m->annotation) : NULL;
    if (old && may_change(s, old))
        return old;
    if (old)
        hg_error_set(err, HG_E_PERM, "annotation_set", "annotation",
            "it is of %s; others change it with the role EDIT", old->author);
    else if (m->annotation)
        hg_error_set(err, HG_E_NOTFOUND, "annotation_set", "annotation",
            "the scene has no annotation %llu", (unsigned long long)m->annotation);
    else if (!m->has_position)
        hg_error_set(err, HG_E_INVAL, "annotation_set", "position", "a new one needs a place");
    else
        check_room(s, err);
    if (err->status)
        return NULL;
    *fresh = (struct hg_annotation){.color = hg_session_record_color(s),
        .text = "",
        .author_session = s->scope.is_ticket ? s->number : 0,
        .time_ms = hg_clock_wall_ns() / 1000000};
    if (s->resume.has_token)
        memcpy(fresh->author_key, s->resume.token, sizeof fresh->author_key);
    snprintf(fresh->author, sizeof fresh->author, "%s", s->name);
    snprintf(fresh->label, sizeof fresh->label, "%s", s->share.label);
    fresh->changed_ms = fresh->time_ms;
    return fresh;
}

// ---- messages -----------------------------------------------------------------------------------

static struct hg_annotation *put(
    struct hg_session *s, const struct hgp_annotation_set *m, const struct hg_annotation *base)
{
    struct hg_annotation next = *base;
    if (m->has_kind)
        next.kind = (uint8_t)m->kind;
    if (m->has_position)
        memcpy(next.position, m->position, sizeof next.position);
    if (m->has_normal)
        memcpy(next.normal, m->normal, sizeof next.normal);
    if (m->has_node)
        next.node = m->node;
    if (m->has_color)
        next.color = m->color;
    if (next.number)
        next.changed_ms = hg_clock_wall_ns() / 1000000;
    return hg_annotation_put(
        &s->scene->people.annotations, &next, m->has_text ? m->text : hgp_str_make(base->text));
}

static void audit(struct hg_session *s, const char *event, uint32_t number, enum hg_status status)
{
    char detail[200];
    snprintf(detail, sizeof detail, "%u in '%s'", number, s->scene->name);
    hg_session_audit(s, event, status, detail);
}

void hg_session_annotation_set(
    struct hg_session *s, uint32_t request, const struct hgp_annotation_set *m)
{
    struct hg_error err = {0};
    struct hg_annotation fresh, *made = NULL;
    const struct hg_annotation *base =
        may_begin(s, "annotation_set", &err) ? find_base(s, m, &fresh, &err) : NULL;
    if (base && !(made = put(s, m, base)))
        hg_error_set(&err, HG_E_NOMEM, "annotation_set", NULL, "no memory for an annotation");
    if (!made) {
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    audit(s, "annotation_set", made->number, HG_OK);
    hg_outq_hold(&s->conn->out, hg_annotation_record(s->table->scenes.log, s->scene->number, made));
    if (request)
        send_one(s, request, made);
}

void hg_session_annotation_remove(
    struct hg_session *s, uint32_t request, const struct hgp_annotation_remove *m)
{
    struct hg_error err = {0};
    const struct hg_annotation *it = NULL;
    const bool may = may_begin(s, "annotation_remove", &err);
    if (may && !(it = hg_annotation_find(&s->scene->people.annotations, m->annotation)))
        hg_error_set(&err, HG_E_NOTFOUND, "annotation_remove", "annotation",
            "the scene has no annotation %llu", (unsigned long long)m->annotation);
    else if (may && !may_change(s, it))
        hg_error_set(&err, HG_E_PERM, "annotation_remove", "annotation",
            "it is of %s; others remove it with the role EDIT", it->author);
    if (err.status) {
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    const uint32_t number = it->number;
    hg_annotation_remove(&s->scene->people.annotations, number);
    audit(s, "annotation_remove", number, HG_OK);
    hg_outq_hold(
        &s->conn->out, hg_state_put_annotation_end(s->table->scenes.log, s->scene->number, number));
    if (request)
        hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){.revision = s->scene->revision});
}

// ---- telling ------------------------------------------------------------------------------------

void hg_session_annotation_tell(struct hg_session *s, uint32_t request)
{
    struct hg_error err = {0};
    const struct hg_annotations *all = s->scene ? &s->scene->people.annotations : NULL;
    struct hgp_annotation_entry *list =
        all && all->count ? hg_calloc(all->count, sizeof *list) : NULL;
    if (!all)
        hg_error_set(
            &err, HG_E_STATE, "annotations_query", NULL, "open a scene first (scene_open)");
    else if (all->count && !list)
        hg_error_set(&err, HG_E_NOMEM, "annotations_query", NULL, "no memory for the answer");
    for (uint32_t i = 0; list && i < all->count; i++)
        list[i] = entry_of(s, &all->items[i]);
    if (err.status)
        hg_conn_fail(s->conn, request, &err);
    else
        hg_conn_send(s->conn, request, HGP_T_annotations,
            &(struct hgp_annotations){.annotations = {list, all->count}});
    hg_free(list);
}

static void tell_changes(struct hg_session *s, const struct hg_annotations *all)
{
    for (uint32_t i = 0; i < all->gone_count; i++)
        hg_conn_send(s->conn, 0, HGP_T_annotation_removed,
            &(struct hgp_annotation_removed){.annotation = all->gone[i]});
    for (uint32_t i = 0; i < all->count; i++)
        if (all->items[i].due)
            send_one(s, 0, &all->items[i]);
}

static void tell_watcher(struct hg_session *s, const struct hg_annotations *all)
{
    if (hg_conn_is_slow(s->conn)) {
        s->share.behind |= all->due;
        return;
    }
    if (s->share.behind || all->all_due)
        hg_session_annotation_tell(s, 0);
    else if (all->due)
        tell_changes(s, all);
    s->share.behind = false;
}

void hg_session_annotation_tick(struct hg_shared_scene *scene)
{
    struct hg_annotations *all = &scene->people.annotations;
    for (struct hg_session *it = scene->people.first; it; it = it->share.next)
        if (it->conn && it->share.watch.annotations)
            tell_watcher(it, all);
    for (uint32_t i = 0; i < all->count && all->due; i++)
        all->items[i].due = false;
    all->due = all->all_due = false;
    all->gone_count = 0;
}
