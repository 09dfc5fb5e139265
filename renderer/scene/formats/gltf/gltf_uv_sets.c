// Which UV sets of a primitive are read: two for each material, those that its textures name.
#include "renderer/scene/formats/gltf/gltf.h"

static uint32_t find(const struct hg_gltf_uv_sets *sets, uint32_t set)
{
    return sets->set[0] == set ? 0 : sets->set[1] == set ? 1 : HG_GLTF_NO_UV_SET;
}

// Slots name sets of the file before, and 0 or 1 of the two after it.
static void choose(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_material *material,
    struct hg_gltf_uv_sets *out)
{
    bool further = false;
    for (int i = 0; i < HG_SLOT_COUNT; i++)
        further |= material->slots[i].texture && material->slots[i].uv_set > 1;
    *out = (struct hg_gltf_uv_sets){{0, 1}};
    if (!further)
        return;
    *out = (struct hg_gltf_uv_sets){{HG_GLTF_NO_UV_SET, HG_GLTF_NO_UV_SET}};
    for (int i = 0; i < HG_SLOT_COUNT; i++) {
        struct hg_texture_ref *slot = &material->slots[i];
        if (!slot->texture)
            continue;
        if (find(out, slot->uv_set) == HG_GLTF_NO_UV_SET) {
            uint32_t *place = out->set[0] == HG_GLTF_NO_UV_SET ? &out->set[0] : &out->set[1];
            if (*place == HG_GLTF_NO_UV_SET)
                *place = slot->uv_set;
        }
        const uint32_t found = find(out, slot->uv_set);
        if (found == HG_GLTF_NO_UV_SET)
            hg_gltf_warn(g, at,
                "texCoord %u: two UV sets of a material are read, %u and %u; %u is used",
                slot->uv_set, out->set[0], out->set[1], out->set[0]);
        slot->uv_set = found == HG_GLTF_NO_UV_SET ? 0 : found;
    }
}

enum hg_status hg_gltf_choose_uv_sets(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "materials");
    g->uv_sets = hg_gltf_alloc(g, &list, g->asset->material_count, sizeof *g->uv_sets);
    if (!g->uv_sets)
        return g->err->status;
    for (uint32_t i = 0; i < g->asset->material_count; i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        choose(g, &at, g->asset->materials[i], &g->uv_sets[i]);
    }
    return HG_OK;
}

struct hg_gltf_uv_sets hg_gltf_uv_sets_of(const struct hg_gltf *g, int64_t material)
{
    return material >= 0 && material < g->asset->material_count ? g->uv_sets[material]
                                                                : (struct hg_gltf_uv_sets){{0, 1}};
}
