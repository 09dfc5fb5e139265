// mesh_entry.c - parts of meshes on the device. See mesh_entry.h.
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/mesh/mesh_entry.h"

#define PROXY_DISCS 8192u // of a cloud until it has levels

static int compare_meshes(const void *a, const void *b)
{
    const struct hg_mesh_entry *x = a, *y = b;
    return x->id < y->id ? -1 : x->id > y->id;
}

void hg_mesh_entry_sort(struct hg_mesh_entry *list, uint32_t count)
{
    if (count > 0)
        qsort(list, count, sizeof *list, compare_meshes);
}

struct hg_mesh_entry *hg_mesh_entry_find(struct hg_mesh_entry *list, uint32_t count, uint64_t id)
{
    const struct hg_mesh_entry key = {.id = id};
    return count > 0 ? bsearch(&key, list, count, sizeof key, compare_meshes) : NULL;
}

static struct hg_box bounds_of(const float *positions, uint32_t count)
{
    struct hg_box box = hg_box_empty();
    for (size_t i = 0; i < count; i++)
        hg_box_add_point(&box, positions + i * 3);
    return box;
}

// Box of the rest positions that each joint moves: a skinned vertex is a mean of its positions
// under its joints, so it lies in the union of the boxes under theirs.
static enum hg_status init_joint_boxes(struct hg_part_entry *e, const struct hg_mesh_part *part)
{
    const size_t per_vertex = (size_t)part->joint_sets * 4;
    uint32_t count = 0;
    for (size_t i = 0; i < part->vertex_count * per_vertex; i++)
        if (part->weights[i] != 0.0f && part->joints[i] >= count)
            count = part->joints[i] + 1u;
    e->joint_boxes = hg_calloc(count, sizeof *e->joint_boxes);
    if (e->joint_boxes == NULL)
        return HG_E_NOMEM;
    e->joint_box_count = count;
    for (uint32_t i = 0; i < count; i++)
        e->joint_boxes[i] = hg_box_empty();
    for (size_t v = 0; v < part->vertex_count; v++)
        for (size_t k = v * per_vertex; k < (v + 1) * per_vertex; k++)
            if (part->weights[k] != 0.0f)
                hg_box_add_point(&e->joint_boxes[part->joints[k]], part->positions + v * 3);
    return HG_OK;
}

static enum hg_status init_morphs(
    struct hg_part_entry *e, const struct hg_mesh_part *part, uint32_t target_count)
{
    e->morphs = hg_calloc(target_count, sizeof *e->morphs);
    e->morph_boxes = hg_calloc(target_count, sizeof *e->morph_boxes);
    if (e->morphs == NULL || e->morph_boxes == NULL)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < target_count; i++) {
        e->morphs[i] = hg_pack_morph(part, i);
        if (part->targets[i].positions != NULL)
            e->morph_boxes[i] = bounds_of(part->targets[i].positions, part->vertex_count);
    }
    return HG_OK;
}

static uint64_t rounded(uint64_t bytes)
{
    return (bytes + 255) & ~255ull;
}

// Levels of detail come right behind the indices of the part, and all else behind them.
static void make_room(struct hg_pack_layout *l, uint64_t bytes)
{
    uint64_t *streams[] = {&l->positions, &l->vertices, &l->extra, &l->joints, &l->weights,
        &l->targets, &l->total_bytes};
    for (size_t i = 0; i < sizeof streams / sizeof *streams; i++)
        *streams[i] += bytes;
}

uint64_t hg_part_whole_bytes(const struct hg_mesh_part *part)
{
    struct hg_pack_layout whole;
    if (hg_discs_can_build(part, 0))
        return hg_discs_bytes(part);
    return hg_pack_layout_of(part, 0, &whole) == HG_OK ? whole.total_bytes : 0;
}

// What the streams hold.
static const struct hg_mesh_part *shown_part(
    const struct hg_part_entry *e, const struct hg_mesh_part *part)
{
    return e->proxy != NULL ? e->proxy : e->discs != NULL ? e->discs : part;
}

// Points become discs; clouds that get levels are shown by some of theirs until then.
static enum hg_status make_discs(struct hg_part_entry *e, const struct hg_mesh_part *part,
    uint32_t target_count, uint32_t whole_below)
{
    if (!hg_discs_can_build(part, target_count))
        return HG_OK;
    const bool whole = part->index_count < whole_below;
    return hg_discs_build(part, whole ? UINT32_MAX : PROXY_DISCS, whole ? &e->discs : &e->proxy);
}

static uint32_t disc_flags(const struct hg_mesh_part *part)
{
    return HG_DRAW_DISCS | (hg_discs_are_lit(part) ? HG_DRAW_NORMALS : 0u);
}

static enum hg_status init_part(struct hg_part_entry *e, const struct hg_mesh_part *source,
    uint32_t target_count, uint32_t whole_below)
{
    static const uint32_t corners[] = {
        [HG_TOPOLOGY_TRIANGLES] = 3, [HG_TOPOLOGY_LINES] = 2, [HG_TOPOLOGY_POINTS] = 1};
    enum hg_status status = make_discs(e, source, target_count, whole_below);
    const struct hg_mesh_part *part = shown_part(e, source);
    if (status == HG_OK)
        status = hg_pack_layout_of(part, target_count, &e->layout);
    if (status != HG_OK)
        return status;
    if (part != source)
        e->layout.flags = (e->layout.flags & ~HG_DRAW_NORMALS) | disc_flags(source);
    e->vertex_count = part->vertex_count;
    e->index_count = part->index_count;
    e->primitive_count = part->index_count / corners[part->topology];
    e->joint_sets = part->joints != NULL ? part->joint_sets : 0;
    e->bounds = e->own_bounds = bounds_of(part->positions, part->vertex_count);
    if (e->proxy != NULL)
        e->own_bounds = bounds_of(source->positions, source->vertex_count);
    hg_box_add(&e->bounds, &e->own_bounds);
    if (e->joint_sets > 0)
        status = init_joint_boxes(e, part);
    if (status == HG_OK && part->targets != NULL && target_count > 0)
        status = init_morphs(e, part, target_count);
    if (status == HG_OK)
        status = hg_skinned_lod_build(part, target_count, &e->posed);
    if (status == HG_OK)
        make_room(&e->layout, rounded(e->posed.index_count * 4ull));
    return status;
}

enum hg_status hg_mesh_entry_set_proxy(
    struct hg_mesh_entry *entry, uint32_t index, uint32_t triangles)
{
    struct hg_part_entry *e = &entry->parts[index];
    struct hg_mesh_part *proxy;
    struct hg_pack_layout layout = {0};
    enum hg_status status = hg_proxy_build(&entry->mesh->parts[index], triangles, &proxy);
    if (status == HG_OK)
        status = hg_pack_layout_of(proxy, 0, &layout);
    if (status != HG_OK) {
        hg_proxy_free(proxy);
        return status;
    }
    e->proxy = proxy;
    e->vertex_count = proxy->vertex_count;
    e->index_count = proxy->index_count;
    e->primitive_count = proxy->index_count / 3;
    const struct hg_box grown = bounds_of(proxy->positions, proxy->vertex_count);
    hg_box_add(&e->bounds, &grown);
    entry->bytes += layout.total_bytes - e->layout.total_bytes;
    e->layout = layout;
    return HG_OK;
}

// The numbered list comes behind the other streams.
static enum hg_status number_part(struct hg_part_entry *e, const struct hg_mesh_part *part)
{
    const enum hg_status status = hg_provoking_build(part, e->meshlets.order, &e->numbered);
    if (status != HG_OK)
        return status == HG_E_LIMIT ? HG_OK : status; // drawn as it is
    e->numbered_at.indices = e->layout.total_bytes;
    e->numbered_at.positions = e->numbered_at.indices + rounded(e->index_count * 4ull);
    e->layout.total_bytes = e->numbered_at.positions + rounded(e->numbered.vertex_count * 12ull);
    return HG_OK;
}

static bool can_number(const struct hg_mesh_part *part, uint32_t target_count, uint32_t below)
{
    return part->topology == HG_TOPOLOGY_TRIANGLES && part->index_count > 0 &&
           part->index_count / 3 < below && part->joints == NULL && target_count == 0;
}

// Large parts get their meshlets when they are uploaded: there may be levels by then.
static enum hg_status order_part(struct hg_part_entry *e, const struct hg_mesh_part *part,
    uint32_t target_count, const struct hg_mesh_entry_limits *limits)
{
    if (e->primitive_count >= limits->meshlets_below)
        return HG_OK;
    const enum hg_status status = hg_meshlets_build(part, &e->meshlets);
    return status == HG_OK && can_number(part, target_count, limits->number_below)
               ? number_part(e, part)
               : status;
}

// Such meshes have no levels.
static bool is_posed(const struct hg_mesh *mesh)
{
    bool posed = mesh->target_count > 0;
    for (uint32_t i = 0; i < mesh->part_count; i++)
        posed = posed || mesh->parts[i].joints != NULL;
    return posed;
}

enum hg_status hg_mesh_entry_init(struct hg_mesh_entry *entry, const struct hg_mesh *mesh,
    const struct hg_mesh_entry_limits *limits, struct hg_error *err)
{
    memset(entry, 0, sizeof *entry);
    entry->id = mesh->head.id;
    entry->revision = mesh->head.revision;
    entry->target_count = mesh->target_count;
    entry->parts = hg_calloc(mesh->part_count, sizeof *entry->parts);
    enum hg_status status = entry->parts != NULL ? HG_OK : HG_E_NOMEM;
    entry->part_count = entry->parts != NULL ? mesh->part_count : 0;
    const uint32_t whole_below = is_posed(mesh) ? UINT32_MAX : limits->meshlets_below;
    for (uint32_t i = 0; i < entry->part_count && status == HG_OK; i++) {
        struct hg_part_entry *e = &entry->parts[i];
        status = init_part(e, &mesh->parts[i], mesh->target_count, whole_below);
        if (status == HG_OK)
            status = order_part(e, shown_part(e, &mesh->parts[i]), mesh->target_count, limits);
        entry->bytes += e->layout.total_bytes;
    }
    if (status == HG_OK)
        return HG_OK;
    hg_mesh_entry_finish(NULL, NULL, entry);
    return hg_error_set(err, status, "mesh", mesh->head.name,
        status == HG_E_NOMEM ? "no memory" : "too many vertices or morph targets");
}

// Draw lists copy indices: reading them back over a bus would be slow.
static enum hg_status keep_indices(
    struct hg_part_entry *e, const uint32_t *indices, struct hg_error *err)
{
    const size_t count = (size_t)e->index_count + e->posed.index_count;
    e->host_indices = hg_calloc(count, sizeof *e->host_indices);
    if (e->host_indices == NULL)
        return hg_error_set(err, HG_E_NOMEM, "mesh", NULL, "no memory");
    memcpy(e->host_indices, indices, count * sizeof *e->host_indices);
    e->indices = e->host_indices;
    return HG_OK;
}

static void write_levels(const struct hg_part_entry *e, uint8_t *to)
{
    if (e->posed.index_count > 0)
        memcpy(to + e->layout.indices + e->index_count * 4ull, e->posed.indices,
            e->posed.index_count * 4ull);
}

static void write_numbered(struct hg_part_entry *e, const struct hg_mesh_part *part, uint8_t *to)
{
    if (e->numbered.indices == NULL)
        return;
    memcpy(to + e->numbered_at.indices, e->numbered.indices, e->index_count * sizeof(uint32_t));
    float *positions = (float *)(void *)(to + e->numbered_at.positions);
    for (size_t i = 0; i < e->numbered.vertex_count; i++)
        memcpy(positions + i * 3, part->positions + (size_t)e->numbered.sources[i] * 3, 12);
    e->numbered_indices = e->numbered.indices;
    hg_free(e->numbered.sources);
    e->numbered.sources = NULL;
}

static enum hg_status upload_part(struct hg_gpu *gpu, struct hg_part_entry *e,
    const struct hg_mesh_part *part, uint32_t target_count, struct hg_error *err)
{
    const uint64_t bytes = e->layout.total_bytes;
    if (bytes == 0)
        return HG_OK;
    if (e->meshlets.items == NULL && hg_meshlets_build(part, &e->meshlets) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "mesh", NULL, "no memory");
    enum hg_status status =
        hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_DEVICE, bytes, "mesh", &e->buffer, err);
    if (status != HG_OK)
        return status;
    if (e->buffer.mapped != NULL) {
        hg_pack_part(part, target_count, e->meshlets.order, &e->layout, e->buffer.mapped);
        write_levels(e, e->buffer.mapped);
        write_numbered(e, part, e->buffer.mapped);
        e->indices = (const uint32_t *)e->buffer.mapped + e->layout.indices / 4;
        return hg_gpu_strategy(gpu)->host_reads ? HG_OK : keep_indices(e, e->indices, err);
    }
    uint8_t *packed = hg_calloc(bytes, 1);
    if (packed == NULL)
        return hg_error_set(err, HG_E_NOMEM, "mesh", NULL, "no memory");
    hg_pack_part(part, target_count, e->meshlets.order, &e->layout, packed);
    write_levels(e, packed);
    write_numbered(e, part, packed);
    status = hg_gpu_buffer_upload(gpu, &e->buffer, 0, packed, bytes, err);
    if (status == HG_OK)
        status = keep_indices(e, (const uint32_t *)(void *)(packed + e->layout.indices), err);
    hg_free(packed);
    return status;
}

static void finish_part(struct hg_gpu *gpu, struct hg_cluster_pool *pool, struct hg_part_entry *e)
{
    if (gpu != NULL)
        hg_gpu_buffer_destroy(gpu, &e->buffer);
    if (e->clusters != NULL)
        hg_cluster_mesh_close(pool, e->clusters);
    hg_meshlets_finish(&e->meshlets);
    hg_provoking_finish(&e->numbered);
    hg_skinned_lod_finish(&e->posed);
    hg_free(e->host_indices);
    hg_proxy_free(e->proxy);
    hg_discs_free(e->discs);
    hg_free(e->joint_boxes);
    hg_free(e->morph_boxes);
    hg_free(e->morphs);
}

enum hg_status hg_mesh_entry_drop_proxy(struct hg_gpu *gpu, struct hg_mesh_entry *entry,
    uint32_t index, uint64_t *written, struct hg_error *err)
{
    struct hg_part_entry *e = &entry->parts[index], whole = {.baking = e->baking};
    const struct hg_mesh_part *part = &entry->mesh->parts[index];
    enum hg_status status = init_part(&whole, part, entry->target_count, UINT32_MAX);
    if (status != HG_OK)
        hg_error_set(err, status, "mesh", entry->mesh->head.name, "no memory");
    else
        status = upload_part(gpu, &whole, shown_part(&whole, part), entry->target_count, err);
    if (status != HG_OK) {
        finish_part(gpu, NULL, &whole);
        return status;
    }
    *written += entry->is_new ? 0 : whole.layout.total_bytes;
    entry->bytes += whole.layout.total_bytes - e->layout.total_bytes;
    finish_part(gpu, NULL, e);
    *e = whole;
    return HG_OK;
}

enum hg_status hg_mesh_entry_upload(struct hg_gpu *gpu, struct hg_mesh_entry *entry,
    const struct hg_mesh *mesh, uint64_t *written, struct hg_error *err)
{
    for (uint32_t i = 0; i < entry->part_count; i++) {
        struct hg_part_entry *e = &entry->parts[i];
        if (e->buffer.size_bytes > 0)
            continue;
        const enum hg_status status =
            upload_part(gpu, e, shown_part(e, &mesh->parts[i]), mesh->target_count, err);
        if (status != HG_OK)
            return status;
    }
    *written += entry->bytes;
    return HG_OK;
}

void hg_mesh_entry_finish(
    struct hg_gpu *gpu, struct hg_cluster_pool *pool, struct hg_mesh_entry *entry)
{
    for (uint32_t i = 0; i < entry->part_count; i++)
        finish_part(gpu, pool, &entry->parts[i]);
    hg_free(entry->parts);
    memset(entry, 0, sizeof *entry);
}
