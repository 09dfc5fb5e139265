// Where shadows change: draws are compared with those of the sync before.
#include "base/hash.h"
#include "renderer/geometry/sync.h"

static uint64_t caster_of(const struct hg_sync *s, const struct hg_draw_entry *d)
{
    const struct hg_gpu_instance *instance = &s->instances[d->gpu.instance];
    uint64_t h = hg_hash_mix_bytes(1, &instance->world, sizeof instance->world);
    h = hg_hash_mix(h, d->node->mesh->head.id);
    h = hg_hash_mix(h, d->node->mesh->head.revision);
    h = hg_hash_mix(h, (uint64_t)d->mesh_part << 32 | d->gpu.flags);
    if ((d->gpu.flags & (HG_DRAW_MASK | HG_DRAW_BLEND)) != 0)
        h = hg_hash_mix(h, s->material);
    if (d->deform != NULL && d->deform->changed) // its pose: another one with every change
        h = hg_hash_mix(h, s->g->shape_revision + 1);
    return h | 1;
}

static void add(struct hg_moved_casters *m, const struct hg_box *box)
{
    if (m->count < HG_MOVED_MOST)
        m->boxes[m->count] = *box;
    m->count += m->count <= HG_MOVED_MOST;
}

void hg_moved_casters_note(struct hg_sync *s)
{
    struct hg_geometry *g = s->g;
    struct hg_moved_casters *m = &g->moved;
    const bool same = g->draw_count == s->draw_count;
    m->since = g->shape_revision;
    m->revision = g->shape_revision + 1;
    m->count = same ? 0 : HG_MOVED_MOST + 1;
    for (uint32_t i = 0; i < s->draw_count; i++) {
        struct hg_draw_entry *now = &s->draws[i];
        now->caster = caster_of(s, now);
        if (!same || now->caster == g->draws[i].caster)
            continue;
        if (g->draws[i].caster != 0)
            add(m, &g->draws[i].bounds);
        if (now->caster != 0)
            add(m, &now->bounds);
    }
}

bool hg_geometry_moved_casters(
    const struct hg_geometry *g, uint64_t since, const struct hg_box **boxes, uint32_t *count)
{
    const struct hg_moved_casters *m = &g->moved;
    *boxes = m->boxes;
    *count = m->count;
    return m->count <= HG_MOVED_MOST && m->since == since && m->revision == g->shape_revision;
}
