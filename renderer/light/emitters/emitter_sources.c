// Emissive parts of ray geometry. See emitter_sources.h.
#include "renderer/light/emitters/emitter_sources.h"

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/light/emitters/emitter_lights.h"
#include "renderer/texture/cache/page_cache.h"

#define MOST_LEAVES (1u << 29)

static float luminance(const struct hg_material *m)
{
    return hg_emitter_luminance(m->emissive[0], m->emissive[1], m->emissive[2]);
}

static bool emits(const struct hg_emitter_part *part)
{
    const struct hg_material *m = part->material;
    return m && !m->unlit && part->piece->triangle_count > 0 && part->piece->positions &&
           part->piece->indices && !(part->piece->flags & (HG_DRAW_LINES | HG_DRAW_POINTS)) &&
           luminance(m) > 0;
}

static enum hg_status find_glow(struct hg_emitter_sources *s, struct hg_textures *textures,
    const struct hg_material *m, uint32_t *index)
{
    const struct hg_texture *texture = m->slots[HG_SLOT_EMISSIVE].texture;
    const enum hg_texture_use use = hg_texture_slot_use(m, HG_SLOT_EMISSIVE);
    *index = UINT32_MAX;
    if (!texture || !textures)
        return HG_OK;
    for (uint32_t i = 0; i < s->glow_count; i++) {
        struct hg_emitter_glow *g = &s->glows[i];
        if (g->texture == texture->head.id && g->revision == texture->head.revision &&
            g->use == use) {
            g->used = true;
            *index = i;
            return HG_OK;
        }
    }
    if (hg_grow(&s->glows, &s->glow_capacity, s->glow_count + 1, sizeof *s->glows))
        return HG_E_NOMEM;
    struct hg_emitter_glow entry = {texture->head.id, texture->head.revision, use, {0}, true};
    if (hg_emissive_mips_make(
            hg_page_cache_sources(hg_textures_cache(textures)), texture, use, 0, &entry.glow))
        return HG_E_NOMEM;
    *index = s->glow_count;
    s->glows[s->glow_count++] = entry;
    return HG_OK;
}

// Drops unused textures; converts indices to pointers.
static void keep_used_glows(struct hg_emitter_sources *s)
{
    uint32_t *moved = NULL, kept = 0;
    bool all = true;
    for (uint32_t i = 0; i < s->glow_count; i++)
        all = all && s->glows[i].used;
    if (!all)
        moved = hg_calloc(s->glow_count, sizeof *moved);
    for (uint32_t i = 0; i < s->glow_count && moved; i++) {
        moved[i] = kept;
        if (s->glows[i].used)
            s->glows[kept++] = s->glows[i];
        else
            hg_emissive_mips_finish(&s->glows[i].glow);
    }
    if (moved)
        s->glow_count = kept;
    for (uint32_t i = 0; i < s->count; i++) {
        struct hg_emitter_source *source = &s->items[i];
        if (source->glow_index != UINT32_MAX)
            source->glow = &s->glows[moved ? moved[source->glow_index] : source->glow_index].glow;
    }
    hg_free(moved);
}

static uint64_t mix_part(uint64_t h, const struct hg_emitter_part *part, uint64_t poses)
{
    const struct hg_ray_geometry_piece *p = part->piece;
    const struct hg_material *m = part->material;
    const struct hg_texture_ref *ref = &m->slots[HG_SLOT_EMISSIVE];
    h = hg_hash_mix(hg_hash_mix(h, p->key), (uint64_t)p->draw << 32 | p->first_primitive);
    h = hg_hash_mix(hg_hash_mix(h, p->triangle_count), p->flags);
    h = hg_hash_mix_bytes(h, p->world, sizeof p->world);
    h = hg_hash_mix_bytes(h, p->previous, sizeof p->previous);
    h = hg_hash_mix_bytes(h, m->emissive, sizeof m->emissive);
    if (ref->texture) {
        h = hg_hash_mix(hg_hash_mix(h, ref->texture->head.id), ref->texture->head.revision);
        h = hg_hash_mix_bytes(
            hg_hash_mix(h, ref->uv_set), ref->uv_transform, sizeof ref->uv_transform);
        h = hg_hash_mix(h, part->uv != NULL);
    }
    return p->deforms ? hg_hash_mix(h, poses) : h;
}

enum hg_status hg_emitter_sources_collect(
    struct hg_emitter_sources *s, const struct hg_emitter_input *in, uint64_t *signature)
{
    s->count = 0;
    s->triangles = 0;
    for (uint32_t i = 0; i < s->glow_count; i++)
        s->glows[i].used = false;
    for (uint32_t i = 0; i < in->part_count; i++) {
        const struct hg_emitter_part *part = &in->parts[i];
        if (!emits(part))
            continue;
        if (hg_grow(&s->items, &s->capacity, s->count + 1, sizeof *s->items))
            return HG_E_NOMEM;
        struct hg_emitter_source source = {.part = part, .luminance = luminance(part->material)};
        if (find_glow(s, in->textures, part->material, &source.glow_index))
            return HG_E_NOMEM;
        s->items[s->count++] = source;
        s->triangles += part->piece->triangle_count;
        *signature = mix_part(*signature, part, in->poses);
    }
    keep_used_glows(s);
    *signature = hg_hash_mix(hg_hash_mix(*signature, in->draw_count), s->count);
    return HG_OK;
}

void hg_emitter_sources_finish(struct hg_emitter_sources *s)
{
    for (uint32_t i = 0; i < s->glow_count; i++)
        hg_emissive_mips_finish(&s->glows[i].glow);
    hg_free(s->glows);
    hg_free(s->items);
}

static uint64_t runs_of(const struct hg_emitter_source *source, uint32_t shift)
{
    return (((uint64_t)source->part->piece->triangle_count - 1) >> shift) + 1;
}

// The least shift with which all sources fit; the greatest if none does.
static uint32_t choose_shift(
    const struct hg_emitter_sources *s, uint64_t room_bytes, uint64_t leaf_bytes)
{
    for (uint32_t shift = 0; shift < HG_EMITTER_MOST_SHIFT; shift++) {
        uint64_t leaves = 0;
        for (uint32_t i = 0; i < s->count; i++)
            leaves += runs_of(&s->items[i], shift);
        const uint64_t bytes = leaves * leaf_bytes + (shift > 0 ? s->triangles * 2 : 0);
        if (bytes <= room_bytes && leaves < MOST_LEAVES)
            return shift;
    }
    return HG_EMITTER_MOST_SHIFT;
}

struct hg_emitter_plan hg_emitter_sources_plan(
    struct hg_emitter_sources *s, uint64_t room_bytes, uint64_t leaf_bytes)
{
    struct hg_emitter_plan plan = {.shift = choose_shift(s, room_bytes, leaf_bytes)};
    uint64_t used = 0, weights = 0, leaves = 0;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < s->count; i++) {
        struct hg_emitter_source *source = &s->items[i];
        const uint64_t triangles = source->part->piece->triangle_count;
        const uint64_t n = runs_of(source, plan.shift);
        const uint64_t bytes = n * leaf_bytes + (plan.shift > 0 ? triangles * 2 : 0);
        if (used + bytes > room_bytes || leaves + n >= MOST_LEAVES ||
            weights + triangles > UINT32_MAX) {
            plan.left_out += triangles;
            continue;
        }
        source->first_leaf = (uint32_t)leaves;
        source->leaf_count = (uint32_t)n;
        source->first_weight = (uint32_t)weights;
        leaves += n;
        weights += plan.shift > 0 ? triangles : 0;
        used += bytes;
        s->items[kept++] = *source;
    }
    s->count = kept;
    plan.leaf_count = (uint32_t)leaves;
    plan.weight_count = (uint32_t)weights;
    return plan;
}
