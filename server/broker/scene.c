// scene.c - scenes by name, for as long as a session holds them.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "server/broker/broker.h"

static struct hg_shared_scene *find(struct hg_broker *b, struct hgp_str name)
{
    for (struct hg_shared_scene *it = b->scenes; it && name.size; it = it->next)
        if (strlen(it->name) == name.size && memcmp(it->name, name.data, name.size) == 0)
            return it;
    return NULL;
}

struct hg_shared_scene *hg_shared_scene_join(
    struct hg_broker *b, struct hgp_str name, uint64_t session, bool *existed)
{
    struct hg_shared_scene *scene = find(b, name);
    *existed = scene != NULL;
    if (scene) {
        scene->sessions++;
        return scene;
    }
    scene = hg_calloc(1, sizeof *scene);
    if (scene)
        scene->journal = hg_journal_create(b->store);
    if (!scene || !scene->journal) {
        hg_free(scene);
        return NULL;
    }
    scene->number = ++b->last_scene & (HG_REPLAY_CHANNEL - 1);
    scene->sessions = 1;
    scene->in_worker = b->link.state == HG_LINK_UP; // nothing to replay
    snprintf(scene->name, sizeof scene->name, "%.*s", (int)name.size, name.data ? name.data : "");
    // The number keeps a scene apart from an earlier one of the same name.
    if (name.size)
        snprintf(scene->key, sizeof scene->key, "%u:%s", scene->number, scene->name);
    else
        snprintf(scene->key, sizeof scene->key, "%u:private of session %llu", scene->number,
            (unsigned long long)session);
    HG_LIST_ADD(b->scenes, scene);
    hg_debug(JOURNAL, "scene '%s' made", scene->key);
    return scene;
}

void hg_shared_scene_leave(struct hg_broker *b, struct hg_shared_scene *scene)
{
    if (--scene->sessions)
        return;
    hg_debug(JOURNAL, "scene '%s' dropped", scene->key);
    hg_recovery_scene_gone(b, scene);
    HG_LIST_REMOVE(b->scenes, scene);
    hg_journal_destroy(scene->journal);
    hg_free(scene);
}
