#include "server/broker/scene.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "server/broker/list.h"

static struct hg_shared_scene *find(
    struct hg_scene_table *table, const char *tenant, struct hgp_str name)
{
    for (struct hg_shared_scene *it = table->first; it && name.size; it = it->next)
        if (strlen(it->name) == name.size && memcmp(it->name, name.data, name.size) == 0 &&
            (table->pool->is_shared || strcmp(it->tenant, tenant) == 0))
            return it;
    return NULL;
}

enum hg_status hg_shared_scene_join(struct hg_scene_table *table, const struct hg_scene_wish *wish,
    struct hg_shared_scene **out, bool *existed, struct hg_error *err)
{
    const struct hgp_str name = wish->name;
    struct hg_shared_scene *scene = find(table, wish->tenant, name);
    *existed = scene != NULL;
    *out = scene;
    if (scene) {
        scene->sessions++;
        return HG_OK;
    }
    struct hg_link *link = hg_worker_pool_route(table->pool, wish->tenant, wish->weight);
    if (!link)
        return hg_error_set(err, HG_E_LIMIT, "scene_open", NULL,
            "as many tenants have scenes open as may (max-workers); try again later");
    scene = hg_calloc(1, sizeof *scene);
    if (scene)
        scene->journal = hg_journal_create(table->store);
    if (!scene || !scene->journal) {
        hg_free(scene);
        return hg_error_set(err, HG_E_NOMEM, "scene_open", NULL, "no memory for a scene");
    }
    scene->number = ++table->last_number & (HG_SCENE_REPLAY_CHANNEL - 1);
    scene->sessions = 1;
    scene->link = link;
    snprintf(scene->tenant, sizeof scene->tenant, "%s", wish->tenant);
    scene->link->whose.scene_count++;
    scene->in_worker = scene->link->state == HG_LINK_UP; // nothing to replay
    snprintf(scene->name, sizeof scene->name, "%.*s", (int)name.size, name.data ? name.data : "");
    // The number keeps a scene apart from an earlier one of the same name.
    if (name.size)
        snprintf(scene->key, sizeof scene->key, "%u:%s", scene->number, scene->name);
    else
        snprintf(scene->key, sizeof scene->key, "%u:private of session %llu", scene->number,
            (unsigned long long)wish->session);
    HG_LIST_ADD(table->first, scene);
    hg_debug(JOURNAL, "scene '%s' made", scene->key);
    *out = scene;
    return HG_OK;
}

uint32_t hg_shared_scene_channel(const struct hg_shared_scene *scene)
{
    return HG_SCENE_REPLAY_CHANNEL | scene->number;
}

uint32_t hg_shared_scene_claim_ids(struct hg_shared_scene *scene)
{
    for (uint32_t i = 0; i < HG_SCENE_RANGES; i++)
        if (!(scene->ranges[i / 64] >> i % 64 & 1)) {
            scene->ranges[i / 64] |= UINT64_C(1) << i % 64;
            return 1 + i * HG_SCENE_ID_RANGE;
        }
    return 0;
}

void hg_shared_scene_release_ids(struct hg_shared_scene *scene, uint32_t first_id)
{
    uint32_t i = (first_id - 1) / HG_SCENE_ID_RANGE;
    if (!hg_journal_uses_ids(scene->journal, first_id, HG_SCENE_ID_RANGE))
        scene->ranges[i / 64] &= ~(UINT64_C(1) << i % 64);
}

static void end_replay(struct hg_shared_scene *scene)
{
    struct hg_link *link = scene->link;
    if (link->replay.scene != scene)
        return;
    hg_link_send(link, hg_shared_scene_channel(scene), 0, HGP_T_session_detach,
        &(struct hgp_session_detach){0});
    link->replay.scene = NULL;
}

void hg_shared_scene_leave(struct hg_scene_table *table, struct hg_shared_scene *scene)
{
    if (--scene->sessions)
        return;
    hg_debug(JOURNAL, "scene '%s' dropped", scene->key);
    end_replay(scene);
    scene->link->whose.scene_count--;
    HG_LIST_REMOVE(table->first, scene);
    hg_journal_destroy(scene->journal);
    hg_free(scene);
}
