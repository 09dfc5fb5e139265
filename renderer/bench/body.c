#include "renderer/bench/body.h"

#include <string.h>

#include "base/alloc.h"

#define BODY_ID 1 // client-made objects have ids of their own, from 1
#define CORNERS 24

// Four corners of each side, with its normal.
static void fill_corners(float half, float *positions, float *normals)
{
    for (int i = 0; i < CORNERS; i++) {
        const int side = i / 4, axis = side / 2, corner = i % 4;
        const float sign = side % 2 == 0 ? -1.0f : 1.0f;
        // Counter-clockwise as seen from outside.
        const float u = corner == 1 || corner == 2 ? 1.0f : -1.0f, v = corner >= 2 ? 1.0f : -1.0f;
        positions[3 * i + axis] = sign * half;
        positions[3 * i + (axis + 1) % 3] = u * half * sign;
        positions[3 * i + (axis + 2) % 3] = v * half;
        normals[3 * i + axis] = sign;
    }
}

static bool make_part(struct hg_mesh *mesh, struct hg_material *material, float half)
{
    struct hg_mesh_part *part = hg_calloc(1, sizeof *part);
    static const uint32_t pattern[6] = {0, 1, 2, 0, 2, 3};
    mesh->parts = part;
    if (part == NULL)
        return false;
    mesh->part_count = 1;
    part->topology = HG_TOPOLOGY_TRIANGLES;
    part->material = material;
    part->positions = hg_calloc(CORNERS * 3, sizeof *part->positions);
    part->normals = hg_calloc(CORNERS * 3, sizeof *part->normals);
    part->indices = hg_calloc(CORNERS / 4 * 6, sizeof *part->indices);
    if (part->positions == NULL || part->normals == NULL || part->indices == NULL)
        return false;
    part->vertex_count = CORNERS;
    part->index_count = CORNERS / 4 * 6;
    fill_corners(half, part->positions, part->normals);
    for (uint32_t i = 0; i < part->index_count; i++)
        part->indices[i] = i / 6 * 4 + pattern[i % 6];
    for (int k = 0; k < 3; k++) {
        part->bounds_min[k] = -half;
        part->bounds_max[k] = half;
    }
    return true;
}

enum hg_status hg_bench_body_add(struct hg_scene *scene, float half, struct hg_node **out)
{
    struct hg_object *objects[3] = {NULL, NULL, NULL};
    static const enum hg_object_kind kinds[3] = {
        HG_OBJECT_MATERIAL, HG_OBJECT_MESH, HG_OBJECT_NODE};
    *out = NULL;
    for (int i = 0; i < 3; i++) {
        const enum hg_status status = hg_scene_add(scene, kinds[i], BODY_ID, &objects[i]);
        if (status != HG_OK)
            return status;
    }
    struct hg_material *material = (struct hg_material *)objects[0];
    struct hg_mesh *mesh = (struct hg_mesh *)objects[1];
    struct hg_node *node = (struct hg_node *)objects[2];
    material->unlit = true;
    if (!make_part(mesh, material, half))
        return HG_E_NOMEM;
    node->mesh = mesh;
    node->visible = false;
    hg_scene_publish(scene);
    *out = node;
    return HG_OK;
}

void hg_bench_body_place(struct hg_scene *scene, struct hg_node *body, const float at[3])
{
    body->visible = at != NULL;
    if (at != NULL)
        memcpy(body->translation, at, sizeof body->translation);
    hg_scene_touch(scene, &body->head);
    hg_scene_publish(scene);
}
