// cluster_mesh.c - see cluster_mesh.h: opening a baked part.
#include <string.h>

#include "base/alloc.h"
#include "renderer/cluster/cluster_pool.h"

// Chunks that must be resident with chunk c, without itself; `mark` keeps each once.
static uint32_t parents_of(
    const struct hg_lod *lod, uint32_t c, uint32_t *mark, uint32_t *out, uint32_t capacity)
{
    const struct hg_lod_chunk *chunk = &lod->chunks[c];
    uint32_t count = 0;
    for (uint32_t g = chunk->first_group; g < chunk->first_group + chunk->group_count; g++) {
        const struct hg_lod_group *group = &lod->groups[g];
        for (uint32_t i = 0; i < group->parent_count; i++) {
            const uint32_t parent = lod->groups[lod->parents[group->first_parent + i]].chunk;
            if (parent == c || mark[parent] == c + 1)
                continue;
            mark[parent] = c + 1;
            if (count < capacity)
                out[count] = parent;
            count++;
        }
    }
    return count;
}

static enum hg_status link_chunks(struct hg_cluster_mesh *mesh)
{
    const struct hg_lod *lod = mesh->lod;
    uint32_t *mark = hg_calloc(lod->chunk_count, sizeof *mark);
    mesh->parent_first = hg_calloc((size_t)lod->chunk_count + 1, sizeof *mesh->parent_first);
    mesh->chunks = hg_calloc(lod->chunk_count, sizeof *mesh->chunks);
    enum hg_status status =
        mark != NULL && mesh->parent_first != NULL && mesh->chunks != NULL ? HG_OK : HG_E_NOMEM;
    size_t capacity = 0;
    for (uint32_t c = 0; c < lod->chunk_count && mesh->chunks != NULL; c++)
        mesh->chunks[c].slot = HG_RESIDENCY_NONE;
    for (uint32_t c = 0; c < lod->chunk_count && status == HG_OK; c++) {
        const uint32_t first = mesh->parent_first[c];
        uint64_t most = 0;
        for (uint32_t g = 0; g < lod->chunks[c].group_count; g++)
            most += lod->groups[lod->chunks[c].first_group + g].parent_count;
        most = most < lod->chunk_count ? most : lod->chunk_count;
        status = hg_grow(&mesh->parents, &capacity, first + most + 1, sizeof *mesh->parents);
        if (status != HG_OK)
            break;
        mesh->parent_first[c + 1] =
            first + parents_of(lod, c, mark, mesh->parents + first, (uint32_t)most);
    }
    hg_free(mark);
    return status;
}

VkDeviceAddress hg_cluster_mesh_levels(const struct hg_cluster_mesh *mesh)
{
    return mesh->table.address + mesh->lod->chunk_count * (uint64_t)sizeof(struct hg_gpu_part);
}

static uint32_t group_triangles(const struct hg_lod *lod, const struct hg_lod_group *group)
{
    uint32_t triangles = 0;
    for (uint32_t i = 0; i < group->cluster_count; i++)
        triangles += lod->clusters[group->first_cluster + i].triangle_count;
    return triangles;
}

// Where each chunk's records begin, then the records: level and end of the triangles that have it.
static uint32_t list_levels(const struct hg_lod *lod, uint32_t *out)
{
    uint32_t n = lod->chunk_count;
    for (uint32_t c = 0; c < lod->chunk_count; c++) {
        const struct hg_lod_chunk *chunk = &lod->chunks[c];
        uint32_t triangles = 0;
        out[c] = n;
        for (uint32_t g = chunk->first_group; g < chunk->first_group + chunk->group_count; g++) {
            const uint32_t level = lod->groups[g].level;
            if (n > out[c] && (out[n - 1] & 255u) == level)
                n--;
            triangles += group_triangles(lod, &lod->groups[g]);
            out[n++] = level | triangles << 8;
        }
    }
    return n;
}

// The levels of all triangles, behind the table of the chunks' streams.
static enum hg_status upload_tables(
    struct hg_gpu *gpu, struct hg_cluster_mesh *mesh, struct hg_error *err)
{
    const struct hg_lod *lod = mesh->lod;
    const uint64_t parts = lod->chunk_count * (uint64_t)sizeof(struct hg_gpu_part);
    uint32_t *levels = hg_calloc((size_t)lod->chunk_count + lod->group_count, sizeof *levels);
    if (levels == NULL)
        return hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no memory");
    const uint64_t bytes = list_levels(lod, levels) * (uint64_t)sizeof *levels;
    enum hg_status status =
        hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_DEVICE, parts + bytes, "chunks", &mesh->table, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_upload(gpu, &mesh->table, parts, levels, bytes, err);
    hg_free(levels);
    return status;
}

static enum hg_status load_roots(
    struct hg_cluster_pool *pool, struct hg_cluster_mesh *mesh, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    hg_cluster_pool_make_room(pool, mesh->lod->root_chunk_count);
    for (uint32_t c = 0; c < mesh->lod->root_chunk_count && status == HG_OK; c++) {
        const struct hg_chunk_want want = {mesh, c, 0.0f};
        status = hg_cluster_pool_load(pool, &want, 1, false, err);
        if (status == HG_OK)
            hg_cluster_pool_pin(pool, mesh, c);
    }
    if (status == HG_E_AGAIN)
        return hg_error_set(
            err, HG_E_LIMIT, "geometry budget", NULL, "the coarsest level of a mesh does not fit");
    return status;
}

enum hg_status hg_cluster_mesh_open(struct hg_cluster_pool *pool, struct hg_lod_stored *stored,
    uint8_t *data, size_t size, struct hg_cluster_mesh **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_cluster_mesh *mesh = hg_calloc(1, sizeof *mesh);
    if (mesh == NULL) {
        hg_free(data);
        hg_lod_stored_close(stored);
        return hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no memory");
    }
    mesh->number = hg_cluster_pool_next_number(pool);
    mesh->data = data;
    mesh->size = size;
    enum hg_status status = HG_OK;
    if (data == NULL) {
        mesh->stored = *stored;
        *stored = (struct hg_lod_stored){0};
        mesh->lod = mesh->stored.lod;
    } else {
        status = hg_lod_open(data, size, &mesh->lod, err);
    }
    if (status == HG_OK && link_chunks(mesh) != HG_OK)
        status = hg_error_set(err, HG_E_NOMEM, "clusters", NULL, "no memory");
    if (status == HG_OK && mesh->lod->chunk_count > 0)
        status = upload_tables(hg_cluster_pool_gpu(pool), mesh, err);
    if (status == HG_OK)
        status = load_roots(pool, mesh, err);
    if (status != HG_OK) {
        hg_cluster_mesh_close(pool, mesh);
        return status;
    }
    *out = mesh;
    return HG_OK;
}

void hg_cluster_mesh_close(struct hg_cluster_pool *pool, struct hg_cluster_mesh *mesh)
{
    if (mesh == NULL)
        return;
    hg_cluster_pool_forget(pool, mesh);
    hg_gpu_buffer_destroy(hg_cluster_pool_gpu(pool), &mesh->table);
    if (mesh->data != NULL)
        hg_lod_close(mesh->lod);
    hg_lod_stored_close(&mesh->stored);
    hg_free(mesh->data);
    hg_free(mesh->parent_first);
    hg_free(mesh->parents);
    hg_free(mesh->chunks);
    hg_free(mesh);
}
