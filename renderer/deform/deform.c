// deform.c - poses of skinned and morphed parts. See deform.h; the work is done by
// passes/skin.comp.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/deform/deform.h"
#include "renderer/math/matrix.h"

static const float *weights_of(const struct hg_node *node)
{
    return node->weights != NULL ? node->weights : node->mesh->weights;
}

bool hg_deform_is_needed(const struct hg_node *node)
{
    if (node->skin != NULL)
        return true;
    const float *weights = weights_of(node);
    for (uint32_t i = 0; weights != NULL && i < node->mesh->target_count; i++)
        if (weights[i] != 0.0f)
            return true;
    return false;
}

static uint64_t align256(uint64_t v)
{
    return (v + 255) & ~255ull;
}

void hg_deform_init(struct hg_deform_entry *e, const struct hg_node *node, uint32_t part,
    const struct hg_mesh_entry *mesh)
{
    memset(e, 0, sizeof *e);
    e->node = node->head.id;
    e->mesh = mesh->id;
    e->mesh_revision = mesh->revision;
    e->part = part;
    e->source = &mesh->parts[part];
    e->vertex_count = e->source->vertex_count;
    e->joint_count = node->skin != NULL && e->source->joint_sets > 0 ? node->skin->joint_count : 0;
    e->target_count = e->source->morphs != NULL ? mesh->target_count : 0;
    e->matrices_offset = align256(sizeof(struct hg_gpu_deform));
    e->morphs_offset =
        align256(e->matrices_offset + (uint64_t)e->joint_count * sizeof(struct hg_mat4x3));
    e->params_bytes =
        align256(e->morphs_offset + (uint64_t)e->target_count * sizeof(struct hg_gpu_morph));
    e->vertices_offset = align256((uint64_t)e->vertex_count * 12);
    e->output_bytes =
        e->vertices_offset + align256((uint64_t)e->vertex_count * sizeof(struct hg_gpu_vertex));
}

uint64_t hg_deform_bytes(const struct hg_deform_entry *e)
{
    return e->params_bytes + e->output_bytes;
}

// Joint matrices relative to the anchor, the boxes that they move, and the side to which most
// joints turn the triangles: the transform of the skinned node itself does not count.
static struct hg_box pose_joints(struct hg_deform_entry *e, const struct hg_skin *skin,
    const struct hg_box *delta, struct hg_mat4x3 *matrices)
{
    struct hg_box bounds = hg_box_empty();
    uint32_t mirrored = 0, kept = 0;
    for (int i = 0; i < 3; i++)
        e->anchor[i] = skin->joint_count > 0 ? skin->joints[0]->world[12 + i] : 0.0;
    for (uint32_t j = 0; j < e->joint_count; j++) {
        double world[16], bind[16];
        hg_matrix_from_float(skin->joints[j]->world, world);
        for (int i = 0; i < 3; i++)
            world[12 + i] -= e->anchor[i];
        if (skin->inverse_bind != NULL) {
            hg_matrix_from_float(skin->inverse_bind[j], bind);
            hg_matrix_multiply(world, bind, world);
        }
        hg_matrix_store4x3(world, &matrices[j]);
        if (j >= e->source->joint_box_count || hg_box_is_empty(&e->source->joint_boxes[j]))
            continue;
        struct hg_box moved = e->source->joint_boxes[j];
        for (int i = 0; i < 3; i++) {
            moved.min[i] += delta->min[i];
            moved.max[i] += delta->max[i];
        }
        moved = hg_box_transform(&moved, world);
        hg_box_add(&bounds, &moved);
        const double determinant = hg_matrix_determinant3(world);
        mirrored += determinant < 0.0;
        kept += determinant > 0.0;
    }
    e->mirrored = mirrored > kept;
    return bounds;
}

// Targets with weight, in order, and the largest move that they make together.
static uint32_t pose_morphs(const struct hg_deform_entry *e, const float *weights,
    struct hg_gpu_morph *morphs, struct hg_box *delta)
{
    uint32_t count = 0;
    *delta = (struct hg_box){{0}, {0}};
    for (uint32_t i = 0; weights != NULL && i < e->target_count; i++) {
        const float w = weights[i];
        if (w == 0.0f)
            continue;
        morphs[count] = e->source->morphs[i];
        morphs[count++].weight = w;
        const struct hg_box *box = &e->source->morph_boxes[i];
        for (int k = 0; k < 3; k++) {
            const float a = w * box->min[k], b = w * box->max[k];
            delta->min[k] += a < b ? a : b;
            delta->max[k] += a > b ? a : b;
        }
    }
    return count;
}

static void fill_params(struct hg_deform_entry *e, uint32_t morph_count, struct hg_gpu_deform *p)
{
    const struct hg_part_entry *s = e->source;
    *p = (struct hg_gpu_deform){
        .positions = s->buffer.address + s->layout.positions,
        .vertices = s->buffer.address + s->layout.vertices,
        .joints = s->buffer.address + s->layout.joints,
        .weights = s->buffer.address + s->layout.weights,
        .matrices = e->params.address + e->matrices_offset,
        .targets = s->buffer.address + s->layout.targets,
        .morphs = e->params.address + e->morphs_offset,
        .out_positions = e->output.address,
        .out_vertices = e->output.address + e->vertices_offset,
        .vertex_count = e->vertex_count,
        .joint_sets = e->joint_count > 0 ? s->joint_sets : 0,
        .morph_count = morph_count,
        .flags = (s->layout.flags & HG_DRAW_NORMALS ? HG_DEFORM_NORMALS : 0u) |
                 (s->layout.flags & HG_DRAW_TANGENTS ? HG_DEFORM_TANGENTS : 0u) |
                 (e->mirrored ? HG_DEFORM_MIRRORED : 0u),
    };
}

static enum hg_status allocate(struct hg_gpu *gpu, struct hg_deform_entry *e, struct hg_error *err)
{
    if (e->pose != NULL)
        return HG_OK;
    enum hg_status status = hg_gpu_buffer_create(
        gpu, HG_GPU_BUFFER_DEVICE, e->output_bytes, "deformed", &e->output, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_create(
            gpu, HG_GPU_BUFFER_DEVICE, e->params_bytes, "pose", &e->params, err);
    if (status == HG_OK) {
        e->pose = hg_calloc(1, e->params_bytes);
        if (e->pose == NULL)
            status = hg_error_set(err, HG_E_NOMEM, "deformation", NULL, "no memory");
    }
    return status;
}

// What the levels of the part are off by in this pose.
static void measure_levels(
    struct hg_deform_entry *e, const struct hg_node *node, const uint8_t *pose)
{
    struct hg_skinned_lod_pose p = {
        .weights = weights_of(node), .target_count = e->target_count, .stretch = 1.0f};
    if (e->source->posed.count == 0)
        return;
    if (e->joint_count > 0) {
        p.matrices = (const struct hg_mat4x3 *)(const void *)(pose + e->matrices_offset);
        p.joint_count = e->joint_count;
        p.stretch = 0.0f;
        for (uint32_t j = 0; j < e->joint_count && j < e->source->joint_box_count; j++)
            if (!hg_box_is_empty(&e->source->joint_boxes[j]))
                p.stretch = fmaxf(p.stretch, hg_matrix_max_stretch(&p.matrices[j]));
    }
    hg_skinned_lod_errors(&e->source->posed, &node->mesh->parts[e->part], &p, e->level_errors);
}

enum hg_status hg_deform_update(struct hg_gpu *gpu, struct hg_deform_entry *e,
    const struct hg_node *node, uint64_t *written, struct hg_error *err)
{
    if (e->vertex_count == 0)
        return HG_OK;
    enum hg_status status = allocate(gpu, e, err);
    if (status != HG_OK)
        return status;
    uint8_t *pose = hg_calloc(1, e->params_bytes);
    if (pose == NULL)
        return hg_error_set(err, HG_E_NOMEM, "deformation", NULL, "no memory");
    struct hg_box delta;
    const uint32_t morph_count = pose_morphs(
        e, weights_of(node), (struct hg_gpu_morph *)(void *)(pose + e->morphs_offset), &delta);
    if (e->joint_count > 0) {
        e->bounds = pose_joints(
            e, node->skin, &delta, (struct hg_mat4x3 *)(void *)(pose + e->matrices_offset));
    } else {
        e->bounds = e->source->bounds;
        for (int i = 0; i < 3; i++) {
            e->bounds.min[i] += delta.min[i];
            e->bounds.max[i] += delta.max[i];
        }
    }
    fill_params(e, morph_count, (struct hg_gpu_deform *)(void *)pose);
    if (memcmp(pose, e->pose, e->params_bytes) != 0) {
        status = hg_gpu_buffer_upload(gpu, &e->params, 0, pose, e->params_bytes, err);
        *written += e->params_bytes;
        e->changed = true;
        measure_levels(e, node, pose);
    }
    if (status == HG_OK)
        memcpy(e->pose, pose, e->params_bytes);
    hg_free(pose);
    return status;
}

void hg_deform_finish(struct hg_gpu *gpu, struct hg_deform_entry *e)
{
    hg_gpu_buffer_destroy(gpu, &e->output);
    hg_gpu_buffer_destroy(gpu, &e->params);
    hg_free(e->pose);
    memset(e, 0, sizeof *e);
}
