#include "server/worker/scene_slot.h"

#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/scene/default_light.h"

// A batch left open does not hold up the frames of other sessions for longer than this.
static const uint64_t batch_patience_ns = 2000000000u;

struct scene_slot *hg_scene_slot_hold(struct render_state *s, struct hgp_str key)
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
    slot->scene->environment.automatic = true;
    slot->sessions = 1;
    slot->next = s->scenes;
    s->scenes = slot;
    return slot;
}

void hg_scene_slot_release(struct render_state *s, struct scene_slot *slot)
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

void hg_scene_slot_light(struct scene_slot *slot)
{
    if (slot->lit_revision == slot->scene->revision)
        return;
    slot->lit_revision = slot->scene->revision;
    hg_default_light_update(slot->scene);
}

void hg_scene_slot_publish(struct scene_slot *slot)
{
    if (slot->dirty)
        hg_scene_publish(slot->scene);
    slot->dirty = false;
    hg_scene_slot_light(slot);
}

bool hg_scene_slot_in_batch(const struct scene_slot *slot, uint64_t *wait_ns)
{
    if (!slot->open_batches || hg_clock_now_ns() - slot->batch_started_ns >= batch_patience_ns)
        return false;
    *wait_ns = *wait_ns < batch_patience_ns ? *wait_ns : batch_patience_ns;
    return true;
}
