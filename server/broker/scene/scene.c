#include "server/broker/scene/scene.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "server/broker/list.h"

enum { RETRY_WORKER_MS = 10000 };

struct hg_shared_scene *hg_shared_scene_find(
    struct hg_scene_table *table, const char *tenant, struct hgp_str name)
{
    for (struct hg_shared_scene *it = table->first; it && name.size; it = it->next)
        if (strlen(it->name) == name.size && memcmp(it->name, name.data, name.size) == 0 &&
            (table->pool->is_shared || strcmp(it->tenant, tenant) == 0))
            return it;
    return NULL;
}

// The number keeps a scene apart from an earlier one of the same name.
static void name_scene(struct hg_shared_scene *scene, struct hgp_str name, uint64_t session)
{
    snprintf(scene->name, sizeof scene->name, "%.*s", (int)name.size, name.data ? name.data : "");
    if (name.size)
        snprintf(scene->key, sizeof scene->key, "%u:%s", scene->number, scene->name);
    else
        snprintf(scene->key, sizeof scene->key, "%u:private of session %llu", scene->number,
            (unsigned long long)session);
}

static struct hg_shared_scene *allocate(struct hg_scene_table *table)
{
    struct hg_shared_scene *scene = hg_calloc(1, sizeof *scene);
    if (scene)
        scene->journal = hg_journal_create(table->store);
    if (scene && scene->journal)
        return scene;
    hg_free(scene);
    return NULL;
}

static void give_worker(struct hg_shared_scene *scene, struct hg_link *link)
{
    scene->link = link;
    link->feed.rebuild = true;
    link->whose.scene_count++;
}

static struct hg_shared_scene *create(
    struct hg_scene_table *table, const struct hg_scene_wish *wish, struct hg_link *link)
{
    struct hg_shared_scene *scene = allocate(table);
    if (!scene)
        return NULL;
    scene->number = ++table->last_number & (HG_SCENE_REPLAY_CHANNEL - 1);
    snprintf(scene->tenant, sizeof scene->tenant, "%s", wish->tenant);
    give_worker(scene, link);
    scene->in_worker = link->state == HG_LINK_UP; // nothing to replay
    name_scene(scene, wish->name, wish->session);
    scene->logged = hg_state_put_scene(table->log,
        &(struct hg_state_scene){scene->number, hgp_str_make(scene->tenant), wish->name});
    HG_LIST_ADD(table->first, scene);
    hg_debug(JOURNAL, "scene '%s' made", scene->key);
    return scene;
}

enum hg_status hg_shared_scene_join(struct hg_scene_table *table, const struct hg_scene_wish *wish,
    struct hg_shared_scene **out, bool *existed, struct hg_error *err)
{
    const struct hgp_str name = wish->name;
    struct hg_shared_scene *scene = hg_shared_scene_find(table, wish->tenant, name);
    *existed = scene != NULL;
    *out = scene;
    if (scene) {
        scene->sessions++;
        hg_worker_pool_weigh(table->pool, scene->link, wish->weight);
        return HG_OK;
    }
    struct hg_link *link = hg_worker_pool_route(table->pool, wish->tenant, wish->weight);
    if (!link)
        hg_error_set(err, HG_E_LIMIT, "scene_open", NULL,
            "as many tenants have scenes open as may (max-workers); try again later");
    if (!link)
        return hg_error_limit(err, "max-workers", RETRY_WORKER_MS);
    scene = create(table, wish, link);
    if (!scene)
        return hg_error_set(err, HG_E_NOMEM, "scene_open", NULL, "no memory for a scene");
    scene->sessions = 1;
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

void hg_shared_scene_leave_channel(struct hg_shared_scene *scene)
{
    struct hg_link *link = scene->link;
    if (scene->on_channel)
        hg_link_send(link, hg_shared_scene_channel(scene), 0, HGP_T_session_detach,
            &(struct hgp_session_detach){0});
    scene->on_channel = false;
    if (link->replay.scene == scene)
        link->replay.scene = NULL;
}

void hg_shared_scene_drop(struct hg_scene_table *table, struct hg_shared_scene *scene)
{
    hg_debug(JOURNAL, "scene '%s' dropped", scene->key);
    if (!table->ending)
        hg_state_put_scene_end(table->log, scene->number);
    if (scene->link) {
        hg_shared_scene_leave_channel(scene);
        scene->link->whose.scene_count--;
    }
    HG_LIST_REMOVE(table->first, scene);
    hg_journal_destroy(scene->journal);
    hg_annotations_finish(&scene->people.annotations);
    hg_packet_unref(scene->people.camera.pose);
    hg_free(scene);
}

void hg_shared_scene_leave(struct hg_scene_table *table, struct hg_shared_scene *scene)
{
    if (--scene->sessions == 0)
        hg_shared_scene_drop(table, scene);
}

// ---- after a restart of the daemon --------------------------------------------------------------

struct hg_shared_scene *hg_shared_scene_by_number(struct hg_scene_table *table, uint32_t number)
{
    struct hg_shared_scene *it = table->first;
    while (it && it->number != number)
        it = it->next;
    return it;
}

struct hg_shared_scene *hg_shared_scene_restore(
    struct hg_scene_table *table, const struct hg_state_scene *like)
{
    if (hg_shared_scene_by_number(table, like->number))
        return NULL;
    struct hg_shared_scene *scene = allocate(table);
    if (!scene)
        return NULL;
    scene->number = like->number;
    scene->sessions = 1;
    if (table->last_number < like->number)
        table->last_number = like->number;
    snprintf(scene->tenant, sizeof scene->tenant, "%.*s", (int)like->tenant.size,
        like->tenant.size ? like->tenant.data : "");
    name_scene(scene, like->name, 0);
    HG_LIST_ADD(table->first, scene);
    return scene;
}

void hg_shared_scene_settle(struct hg_shared_scene *scene, const struct hg_scene_place *place)
{
    give_worker(scene, place->link);
    hg_journal_mark_ids(scene->journal, HG_SCENE_ID_RANGE, scene->ranges, HG_SCENE_RANGES);
    scene->in_worker = place->in_worker;
    scene->on_channel = place->on_channel;
    scene->revision = place->revision;
    scene->kept_until_ns = place->kept_until_ns;
    if (!place->kept_until_ns)
        scene->sessions--;
}

bool hg_shared_scene_place(
    struct hg_scene_table *table, struct hg_shared_scene *scene, uint64_t until_ns)
{
    struct hg_link *link = hg_worker_pool_route(table->pool, scene->tenant, 0);
    if (!link)
        return false;
    give_worker(scene, link);
    hg_journal_mark_ids(scene->journal, HG_SCENE_ID_RANGE, scene->ranges, HG_SCENE_RANGES);
    scene->kept_until_ns = until_ns;
    if (!until_ns)
        scene->sessions--;
    return true;
}

void hg_shared_scene_check_times(struct hg_scene_table *table, uint64_t now_ns)
{
    for (struct hg_shared_scene *it = table->first, *next; it; it = next) {
        next = it->next;
        if (!it->kept_until_ns || now_ns < it->kept_until_ns)
            continue;
        it->kept_until_ns = 0;
        if (it->in_worker) // else its replay ends first
            hg_shared_scene_leave_channel(it);
        hg_shared_scene_leave(table, it);
    }
}
