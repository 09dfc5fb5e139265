// asset_pack_mesh.c - meshes of packed assets. See asset_pack.c.
#include "renderer/scene/asset_pack_io.h"

enum arrays {
    NORMALS = 1,
    TANGENTS = 2,
    UV0 = 4,
    UV1 = 8,
    COLORS = 16,
    JOINTS = 32,
    TARGETS = 64,
    ARRAYS = 128
};

enum { MOST_TARGETS = 4096 };

static uint32_t arrays_of(const struct hg_mesh_part *part)
{
    return (part->normals ? NORMALS : 0) | (part->tangents ? TANGENTS : 0) |
           (part->uv[0] ? UV0 : 0) | (part->uv[1] ? UV1 : 0) | (part->colors ? COLORS : 0) |
           (part->joints ? JOINTS : 0) | (part->targets ? TARGETS : 0);
}

static void pack_indices(struct hg_pack *p, struct hg_mesh_part *part)
{
    static const uint32_t corners[] = {
        [HG_TOPOLOGY_TRIANGLES] = 3, [HG_TOPOLOGY_LINES] = 2, [HG_TOPOLOGY_POINTS] = 1};
    void *memory = part->indices;
    pack_bytes(p, &memory, part->index_count, sizeof *part->indices);
    part->indices = memory;
    bool sound = part->index_count % corners[part->topology] == 0;
    for (uint32_t i = 0; reads(p) && goes_on(p) && i < part->index_count; i++)
        sound &= part->indices[i] < part->vertex_count;
    require(p, sound, "an index");
}

static void pack_joints(struct hg_pack *p, struct hg_mesh_part *part)
{
    void *memory = part->joints;
    pack_bytes(p, &memory, (uint64_t)part->vertex_count * 4, sizeof *part->joints);
    part->joints = memory;
    pack_vertices(p, &part->weights, part->vertex_count, 4, 0, 1.001f);
    part->joint_sets = 1;
}

static void pack_target(struct hg_pack *p, struct hg_mesh_part *part, struct hg_morph_target *t)
{
    const uint64_t count = part->vertex_count;
    const uint32_t arrays = pack_choice(p,
        (t->positions ? 1 : 0) | (t->normals ? NORMALS << 1 : 0) |
            (t->tangents ? TANGENTS << 1 : 0),
        8);
    if (arrays & 1)
        pack_vertices(p, &t->positions, count, 3, -FLT_MAX, FLT_MAX);
    if (arrays & NORMALS << 1)
        pack_vertices(p, &t->normals, count, 3, -FLT_MAX, FLT_MAX);
    if (arrays & TANGENTS << 1)
        pack_vertices(p, &t->tangents, count, 3, -FLT_MAX, FLT_MAX);
}

// Targets of a mesh with one part, and its weights.
static void pack_targets(struct hg_pack *p, struct hg_mesh *mesh, struct hg_mesh_part *part)
{
    uint32_t count = mesh->target_count;
    require(p, mesh->part_count == 1, "targets");
    pack_count(p, &count, 8, sizeof *part->targets);
    require(p, count > 0 && count <= MOST_TARGETS, "a count");
    pack_vertices(p, &mesh->weights, count, 1, -FLT_MAX, FLT_MAX);
    if (reads(p)) {
        part->targets = take(p, count, sizeof *part->targets);
        mesh->target_count = part->targets ? count : 0;
    }
    for (uint32_t i = 0; i < mesh->target_count && goes_on(p); i++)
        pack_target(p, part, &part->targets[i]);
}

static void pack_part(struct hg_pack *p, struct hg_mesh *mesh, struct hg_mesh_part *part)
{
    struct hg_asset *a = p->asset;
    part->topology = pack_choice(p, part->topology, HG_TOPOLOGY_POINTS + 1);
    pack_u32(p, &part->vertex_count);
    pack_u32(p, &part->index_count);
    require(p, part->vertex_count <= INT32_MAX && part->index_count <= INT32_MAX, "a count");
    part->material = REFERENCE(p, part->material, a->materials, a->material_count);
    const uint32_t arrays = pack_choice(p, arrays_of(part), ARRAYS);
    require(p, part->topology != HG_TOPOLOGY_TRIANGLES || arrays & NORMALS, "no normals");
    const uint64_t count = part->vertex_count;
    pack_vertices(p, &part->positions, count, 3, -FLT_MAX, FLT_MAX);
    if (arrays & NORMALS)
        pack_vertices(p, &part->normals, count, 3, -1.001f, 1.001f);
    if (arrays & TANGENTS)
        pack_vertices(p, &part->tangents, count, 4, -1.001f, 1.001f);
    for (uint32_t i = 0; i < 2; i++)
        if (arrays & (UV0 << i))
            pack_vertices(p, &part->uv[i], count, 2, -FLT_MAX, FLT_MAX);
    if (arrays & COLORS)
        pack_vertices(p, &part->colors, count, 4, 0, FLT_MAX);
    if (arrays & JOINTS)
        pack_joints(p, part);
    if (arrays & TARGETS)
        pack_targets(p, mesh, part);
    pack_indices(p, part);
    if (reads(p) && goes_on(p))
        hg_mesh_part_update_bounds(part, mesh->target_count);
}

void hg_asset_pack_mesh(struct hg_pack *p, struct hg_mesh *mesh)
{
    pack_name(p, &mesh->head.name);
    uint32_t count = mesh->part_count;
    pack_count(p, &count, 20, sizeof *mesh->parts);
    if (reads(p)) {
        mesh->parts = take(p, count, sizeof *mesh->parts);
        mesh->part_count = mesh->parts ? count : 0;
    }
    for (uint32_t i = 0; i < mesh->part_count && goes_on(p); i++)
        pack_part(p, mesh, &mesh->parts[i]);
}
