#include "server/broker/session/session_rules.h"

#include <stdio.h>
#include <string.h>

#include "server/broker/session/session_look.h"
#include "server/broker/session/session_upload.h"
#include "server/broker/session/session_view.h"
#include "server/broker/workers/trial.h"

enum hg_status hg_session_rules_may_change(
    const struct hg_session_table *table, const char *what, struct hg_error *err)
{
    enum hg_status status = hg_state_log_refusal(table->scenes.log);
    return status ? hg_error_set(err, status, what, NULL,
                        "scenes cannot be changed now: the daemon's state cannot be written "
                        "(state-dir): %s; try again later",
                        hg_status_text(status))
                  : HG_OK;
}

static enum hg_status check_load(
    struct hg_session *s, const struct hgp_asset_load *m, struct hg_error *err)
{
    if (m->asset < s->first_id || m->asset - s->first_id >= HG_SCENE_ID_RANGE)
        return hg_error_set(err, HG_E_INVAL, "asset_load", "asset",
            "%u is outside this session's range %u to %u", m->asset, s->first_id,
            s->first_id + HG_SCENE_ID_RANGE - 1);
    for (uint32_t i = 0; i < m->files.count; i++)
        if (!hg_session_upload_has(s, m->files.items[i].hash)) {
            char place[128];
            snprintf(place, sizeof place, "files[%u].hash", i);
            return hg_error_set(err, HG_E_NOTFOUND, "asset_load", place,
                "this content has not been uploaded: %.*s", (int)m->files.items[i].uri.size,
                m->files.items[i].uri.data);
        }
    return hg_session_upload_may_keep(s, "asset_load", m->files.items, m->files.count, err);
}

static enum hg_status check_environment(
    struct hg_session *s, const struct hgp_environment_set *m, struct hg_error *err)
{
    struct hgp_asset_file file = {0};
    if (!m->has_hash)
        return HG_OK;
    if (!hg_session_upload_has(s, m->hash))
        return hg_error_set(
            err, HG_E_NOTFOUND, "environment_set", "hash", "this content has not been uploaded");
    memcpy(file.hash, m->hash, sizeof file.hash);
    return hg_session_upload_may_keep(s, "environment_set", &file, 1, err);
}

// Journals up to here are not added up: their number is limited by that of sessions.
enum { LITTLE_JOURNAL = 1 << 20, RETRY_JOURNAL_MS = 10000 };

struct journals {
    uint64_t all, own; // bytes of all scenes, of those of one tenant
};

static struct journals sum_journals(const struct hg_session *s)
{
    struct journals sum = {0};
    for (const struct hg_shared_scene *it = s->table->scenes.first; it; it = it->next) {
        uint64_t bytes = hg_journal_get_stats(it->journal).bytes;
        sum.all += bytes;
        sum.own += strcmp(it->tenant, s->tenant) == 0 ? bytes : 0;
    }
    return sum;
}

// While journals take more than half of journal-total, no tenant may have more than half of that.
static bool exceeds_total(const struct hg_session *s, uint64_t more)
{
    const uint64_t most = s->table->options->journal_total_bytes;
    const struct journals sum = sum_journals(s);
    return sum.all + more > most || (sum.all + more > most / 2 && sum.own + more > most / 4);
}

static enum hg_status check_journal(
    const struct hg_session *s, const struct hg_packet *packet, struct hg_error *err)
{
    const struct hg_options *o = s->table->options;
    const uint16_t type = packet->header.type;
    const uint64_t more = s->load.bytes + packet->header.length;
    const uint64_t need = hg_journal_get_stats(s->scene->journal).bytes + more;
    if (!hg_journal_wants(type) || type == HGP_T_object_remove || type == HGP_T_asset_unload)
        return HG_OK;
    if (need > o->journal_limit_bytes) {
        hg_error_set(err, HG_E_LIMIT, hgp_find(type)->name, NULL,
            "the scene would keep %llu MiB of edits, more than journal-limit allows (%llu MiB); "
            "remove objects or upload assets instead",
            (unsigned long long)(need >> 20), (unsigned long long)(o->journal_limit_bytes >> 20));
        return hg_error_limit(err, "journal-limit", 0);
    }
    if (need > LITTLE_JOURNAL && exceeds_total(s, more)) {
        hg_error_set(err, HG_E_LIMIT, hgp_find(type)->name, NULL,
            "the edits of all scenes take what journal-total allows (%llu MiB), or this tenant's "
            "its share",
            (unsigned long long)(o->journal_total_bytes >> 20));
        return hg_error_limit(err, "journal-total", RETRY_JOURNAL_MS);
    }
    return HG_OK;
}

static enum hg_status check_view(
    struct hg_session *s, const struct hg_packet *packet, uint32_t number, struct hg_error *err)
{
    if (hg_session_view_find(s, number))
        return HG_OK;
    return hg_error_set(err, HG_E_NOTFOUND, hgp_find(packet->header.type)->name, "view",
        "this session has no view %u", number);
}

enum { RETRY_FRAME_MS = 100 };

static enum hg_status busy(
    const struct hg_session *s, const struct hg_packet *packet, struct hg_error *err)
{
    hg_error_set(err, HG_E_BUSY, hgp_find(packet->header.type)->name, NULL,
        "%u frame requests of this session are under way already (max-frame-requests)",
        s->load.frames);
    return hg_error_limit(err, "max-frame-requests", RETRY_FRAME_MS);
}

static enum hg_status check_frame_request(
    struct hg_session *s, const struct hg_packet *packet, uint32_t view, struct hg_error *err)
{
    if (s->load.frames >= s->table->options->max_frame_requests)
        return busy(s, packet, err);
    if (check_view(s, packet, view, err))
        return err->status;
    const char *limit;
    const uint64_t wait_ns = hg_session_view_wait_ns(s, &limit);
    if (!wait_ns)
        return HG_OK;
    hg_error_set(err, HG_E_LIMIT, hgp_find(packet->header.type)->name, NULL,
        "frames have taken the pixels that they may in this second (%s)", limit);
    return hg_error_limit(err, limit, (uint32_t)(wait_ns / 1000000) + 1);
}

enum hg_status hg_session_rules_check(struct hg_session *s, const struct hg_packet *packet,
    const union hgp_any *m, struct hg_error *err)
{
    const char *name = hgp_find(packet->header.type)->name;
    if (!s->scene)
        return hg_error_set(err, HG_E_STATE, name, NULL, "open a scene first (scene_open)");
    if (hg_journal_wants(packet->header.type) && hg_session_rules_may_change(s->table, name, err))
        return err->status;
    if (hg_trial_check(s, packet, err))
        return err->status;
    switch (packet->header.type) {
    case HGP_T_bake:
        return hg_error_set(
            err, HG_E_UNSUPPORTED, name, NULL, "runs in a private worker only, not in a daemon");
    case HGP_T_asset_load:
        if (check_load(s, &m->asset_load, err))
            return err->status;
        return check_journal(s, packet, err);
    case HGP_T_environment_set:
        return check_environment(s, &m->environment_set, err);
    case HGP_T_image_query:
        return hg_session_upload_verify(s, &m->image_query, err);
    case HGP_T_view_set:
        return hg_session_view_ask(s, &m->view_set, err);
    case HGP_T_frame_request:
        return check_frame_request(s, packet, m->frame_request.view, err);
    case HGP_T_exposure_query:
        return check_frame_request(s, packet, m->exposure_query.view, err);
    case HGP_T_frame_cancel:
        return check_view(s, packet, m->frame_cancel.view, err);
    case HGP_T_view_camera:
        return check_view(s, packet, m->view_camera.view, err);
    case HGP_T_view_close:
        return check_view(s, packet, m->view_close.view, err);
    case HGP_T_view_clip:
    case HGP_T_view_overrides:
    case HGP_T_view_variant:
        return hg_session_look_check(s, packet, m, err);
    case HGP_T_subscribe:
        return check_view(s, packet, m->subscribe.view, err);
    case HGP_T_credit:
        return check_view(s, packet, m->credit.view, err);
    case HGP_T_taken:
        return check_view(s, packet, m->taken.view, err);
    case HGP_T_key_frame:
        return check_view(s, packet, m->key_frame.view, err);
    default:
        return check_journal(s, packet, err);
    }
}
