#include "server/broker/state.h"

#include <string.h>

#include "base/log.h"

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

static enum hg_status end_scene(struct hg_session_table *table, uint32_t number)
{
    struct hg_shared_scene *scene = hg_shared_scene_by_number(&table->scenes, number);
    if (!scene)
        return HG_E_FORMAT;
    hg_shared_scene_drop(&table->scenes, scene);
    return HG_OK;
}

static enum hg_status take_record(void *user, const uint8_t *body, size_t size)
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
    default:
        hg_quarantine_restore_end(table->quarantine, &record.of.suspect);
        return HG_OK;
    }
}

enum hg_status hg_state_open(
    struct hg_session_table *table, struct hg_state_log **out, struct hg_error *err)
{
    const struct hg_options *o = table->options;
    *out = NULL;
    if (!o->state_dir)
        return HG_OK;
    const struct hg_state_log_options options = {.folder = o->state_dir,
        .wait_for_sync = strcmp(o->durability, "synced") == 0,
        .go_on = strcmp(o->state_failure, "continue") == 0,
        .sync_interval_ns = o->sync_interval_ns};
    enum hg_status status = hg_state_log_open(&options, take_record, table, out, err);
    table->scenes.log = table->quarantine->log = *out;
    return status;
}

void hg_state_place(struct hg_session_table *table)
{
    uint64_t until_ns = table->loop->now_ns + table->options->resume_timeout_ns;
    for (struct hg_shared_scene *it = table->scenes.first, *next; it; it = next) {
        next = it->next;
        if (!it->name[0]) {
            hg_shared_scene_drop(&table->scenes, it); // was of a session that is gone
        } else if (!hg_shared_scene_place(&table->scenes, it, until_ns)) {
            hg_warn(JOURNAL, "scene '%s' of %s is given up: max-workers tenants have scenes",
                it->key, it->tenant);
            hg_shared_scene_drop(&table->scenes, it);
        } else {
            hg_info(JOURNAL, "scene '%s' of %s was restored: %llu edits, revision %llu", it->key,
                it->tenant, (unsigned long long)hg_journal_get_stats(it->journal).entries,
                (unsigned long long)it->revision);
        }
    }
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
}

void hg_state_tend(struct hg_session_table *table)
{
    struct hg_state_log *log = table->scenes.log;
    uint64_t now_ns = table->loop->now_ns;
    if (!log || !hg_state_log_wants_snapshot(log, now_ns))
        return;
    hg_state_log_begin_snapshot(log, now_ns);
    for (const struct hg_shared_scene *it = table->scenes.first; it; it = it->next)
        put_scene(log, it);
    hg_quarantine_write(table->quarantine, now_ns);
    hg_state_log_end_snapshot(log);
}
