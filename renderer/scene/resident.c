// What an asset takes in memory.
#include "base/alloc.h"
#include "renderer/scene/asset.h"

static uint64_t of_head(const struct hg_object *head)
{
    return hg_alloc_resident_bytes(head) + hg_alloc_resident_bytes(head->name);
}

static uint64_t of_part(const struct hg_mesh_part *part, uint32_t target_count)
{
    const void *const arrays[] = {part->indices, part->positions, part->normals, part->tangents,
        part->uv[0], part->uv[1], part->colors, part->joints, part->weights, part->targets,
        part->variants};
    uint64_t bytes = 0;
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        bytes += hg_alloc_resident_bytes(arrays[i]);
    for (uint32_t t = 0; part->targets && t < target_count; t++)
        bytes += hg_alloc_resident_bytes(part->targets[t].positions) +
                 hg_alloc_resident_bytes(part->targets[t].normals) +
                 hg_alloc_resident_bytes(part->targets[t].tangents);
    return bytes;
}

static uint64_t of_mesh(const struct hg_mesh *mesh)
{
    uint64_t bytes = of_head(&mesh->head) + hg_alloc_resident_bytes(mesh->parts) +
                     hg_alloc_resident_bytes(mesh->weights);
    for (uint32_t i = 0; i < mesh->part_count; i++)
        bytes += of_part(&mesh->parts[i], mesh->target_count);
    return bytes;
}

// An image that several textures have is counted in parts.
static uint64_t of_texture(const struct hg_texture *texture)
{
    const struct hg_image_source *image = texture->image;
    const uint64_t bytes = image ? hg_alloc_resident_bytes(image->encoded) +
                                       hg_alloc_resident_bytes(image->pixels.pixels)
                                 : 0;
    return of_head(&texture->head) + (bytes ? bytes / image->refs : 0);
}

static uint64_t of_animation(const struct hg_animation *animation)
{
    uint64_t bytes = hg_alloc_resident_bytes(animation->channels);
    for (uint32_t i = 0; i < animation->channel_count; i++)
        bytes += hg_alloc_resident_bytes(animation->channels[i].times) +
                 hg_alloc_resident_bytes(animation->channels[i].values) +
                 hg_alloc_resident_bytes(animation->channels[i].rest);
    return bytes;
}

uint64_t hg_asset_resident_bytes(const struct hg_asset *asset)
{
    uint64_t bytes = hg_alloc_resident_bytes(asset) + hg_alloc_resident_bytes(asset->nodes);
    for (uint32_t i = 0; i < asset->node_count; i++)
        bytes += of_head(&asset->nodes[i]->head) +
                 hg_alloc_resident_bytes(asset->nodes[i]->instances) +
                 hg_alloc_resident_bytes(asset->nodes[i]->weights);
    for (uint32_t i = 0; i < asset->mesh_count; i++)
        bytes += of_mesh(asset->meshes[i]);
    for (uint32_t i = 0; i < asset->material_count; i++)
        bytes += of_head(&asset->materials[i]->head);
    for (uint32_t i = 0; i < asset->texture_count; i++)
        bytes += of_texture(asset->textures[i]);
    for (uint32_t i = 0; i < asset->light_count; i++)
        bytes += of_head(&asset->lights[i]->head);
    for (uint32_t i = 0; i < asset->camera_count; i++)
        bytes += of_head(&asset->cameras[i]->head);
    for (uint32_t i = 0; i < asset->skin_count; i++)
        bytes += hg_alloc_resident_bytes(asset->skins[i]) +
                 hg_alloc_resident_bytes(asset->skins[i]->joints) +
                 hg_alloc_resident_bytes(asset->skins[i]->inverse_bind);
    for (uint32_t i = 0; i < asset->animation_count; i++)
        bytes += of_animation(&asset->animations[i]);
    return bytes;
}
