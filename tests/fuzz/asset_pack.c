// Assets as a process in hostile hands might pack them.
#include <math.h>

#include "renderer/scene/asset_pack.h"
#include "tests/fuzz/fuzz.h"

static void check_part(const struct hg_mesh_part *part)
{
    for (uint32_t i = 0; i < part->index_count; i++)
        FUZZ_CHECK(part->indices[i] < part->vertex_count);
    for (uint64_t i = 0; i < (uint64_t)part->vertex_count * 3; i++)
        FUZZ_CHECK(isfinite(part->positions[i]));
    FUZZ_CHECK(part->normals || part->topology != HG_TOPOLOGY_TRIANGLES);
}

static void check_node(const struct hg_asset *asset, const struct hg_node *node)
{
    unsigned depth = 0;
    for (const struct hg_node *n = node; n; n = n->parent)
        FUZZ_CHECK(depth++ < 2000);
    for (const struct hg_node *n = node->first_child; n; n = n->next_sibling)
        FUZZ_CHECK(n->parent == node && n->head.id > node->head.id);
    for (uint32_t k = 0; node->skin && k < node->skin->joint_count; k++)
        FUZZ_CHECK(node->skin->joints[k] && node->skin->joints[k]->asset == asset);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const struct hg_asset_unpack params = {.data = data,
        .size = size,
        .asset_number = 1,
        .memory_limit_bytes = 64 << 20,
        .label = "fuzz.dae"};
    struct hg_asset *asset;
    struct hg_error err = {0};
    if (hg_asset_unpack(&params, &asset, &err) != HG_OK) {
        FUZZ_CHECK(!asset && err.reason[0]);
        return 0;
    }
    for (uint32_t i = 0; i < asset->mesh_count; i++)
        for (uint32_t k = 0; k < asset->meshes[i]->part_count; k++)
            check_part(&asset->meshes[i]->parts[k]);
    for (uint32_t i = 0; i < asset->node_count; i++)
        check_node(asset, asset->nodes[i]);
    struct hg_writer again = {0}; // what was read can be written
    hg_asset_pack(asset, &again);
    FUZZ_CHECK(again.failed || again.size <= size);
    hg_writer_finish(&again);
    hg_asset_destroy(asset);
    return 0;
}
