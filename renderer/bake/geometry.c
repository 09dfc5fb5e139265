// geometry.c - the cluster files of a scene's meshes, one part after the other on all threads.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "base/log.h"
#include "renderer/bake/internal.h"
#include "renderer/lod/store.h"
#include "renderer/scene/scene.h"

struct geometry {
    const struct hg_bake *bake;
    struct hg_store *store;
    struct hg_bake_entries *entries;
    uint64_t before, total; // source triangles of parts that are done; of all that can be baked
    uint32_t files, found, skipped, failed;
    uint64_t triangles, made_triangles, file_bytes, ns;
    struct hg_writer failures;
};

typedef enum hg_status part_fn(struct geometry *g, const struct hg_mesh *mesh,
    const struct hg_mesh_part *part, struct hg_error *err);

static enum hg_status each_part(struct geometry *g, part_fn *fn, struct hg_error *err)
{
    const struct hg_object_list *list = &g->bake->scene->objects[HG_OBJECT_MESH];
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < list->count && status == HG_OK; i++) {
        const struct hg_mesh *mesh = (const struct hg_mesh *)list->items[i];
        for (uint32_t p = 0; p < mesh->part_count && status == HG_OK; p++)
            status = fn(g, mesh, &mesh->parts[p], err);
    }
    return status;
}

static enum hg_status count_part(struct geometry *g, const struct hg_mesh *mesh,
    const struct hg_mesh_part *part, struct hg_error *err)
{
    (void)err;
    if (hg_lod_can_bake(part, mesh->target_count))
        g->total += part->index_count / 3;
    else
        g->skipped++;
    return HG_OK;
}

static bool tell(void *user, uint64_t done, uint64_t total)
{
    const struct geometry *g = user;
    (void)total;
    const uint64_t at = g->before + done;
    return hg_bake_tell(g->bake, "geometry", at < g->total ? at : g->total, g->total);
}

static enum hg_status make_file(struct geometry *g, const char *name,
    const struct hg_mesh_part *part, const struct hg_store_key *key, uint64_t *file_bytes,
    struct hg_error *err)
{
    const struct hg_lod_params params = {
        .jobs = g->bake->jobs, .progress = tell, .progress_user = g};
    uint8_t *data = NULL;
    size_t size = 0;
    enum hg_status status = hg_lod_bake(part, &params, &data, &size, NULL, err);
    if (status == HG_OK)
        status = hg_lod_stored_write(g->store, key, name, data, size, err);
    if (status == HG_E_BUSY) // another process makes the same
        status = HG_OK;
    *file_bytes = size;
    hg_free(data);
    return status;
}

static bool find_file(struct geometry *g, const struct hg_store_key *key, uint64_t *file_bytes)
{
    struct hg_lod_stored stored;
    struct hg_error ignored;
    if (hg_lod_stored_find(g->store, key, &stored, &ignored) != HG_OK)
        return false;
    *file_bytes = hg_store_entry_bytes(stored.entry);
    hg_lod_stored_close(&stored);
    return true;
}

static void note_failure(struct geometry *g, const char *name, const struct hg_error *err)
{
    g->failed++;
    hg_json_put(&g->failures, "%s{\"what\":", g->failures.size > 0 ? "," : "");
    hg_json_string(&g->failures, name[0] != '\0' ? name : "mesh");
    hg_json_put(&g->failures, ",\"reason\":");
    hg_json_string(&g->failures, err->reason);
    hg_json_put(&g->failures, "}");
}

static bool ends_all(enum hg_status status)
{
    return status == HG_E_CANCELLED || status == HG_E_NOMEM || status == HG_E_NOSPACE ||
           status == HG_E_IO || status == HG_E_PERM;
}

static enum hg_status bake_part(struct geometry *g, const struct hg_mesh *mesh,
    const struct hg_mesh_part *part, struct hg_error *err)
{
    struct hg_store_key key;
    const uint64_t triangles = part->index_count / 3, start = hg_clock_now_ns();
    uint64_t file_bytes = 0;
    if (!hg_lod_can_bake(part, mesh->target_count))
        return HG_OK;
    enum hg_status status = hg_lod_stored_key(part, &(struct hg_lod_params){0}, &key);
    const bool found = status == HG_OK && find_file(g, &key, &file_bytes);
    if (status != HG_OK)
        hg_error_set(err, status, "bake", NULL, "no memory for a key");
    else if (!found)
        status = make_file(g, mesh->head.name, part, &key, &file_bytes, err);
    g->before += triangles;
    if (status != HG_OK && ends_all(status))
        return status;
    if (status != HG_OK) {
        note_failure(g, mesh->head.name, err);
        return HG_OK;
    }
    status = hg_bake_note(g->entries, &key, err);
    if (status != HG_OK)
        return status;
    g->files++;
    g->found += found;
    g->triangles += triangles;
    g->file_bytes += file_bytes;
    if (!found) {
        g->made_triangles += triangles;
        g->ns += hg_clock_now_ns() - start;
    }
    return HG_OK;
}

static void put_report(struct hg_writer *w, const struct geometry *g)
{
    const double seconds = (double)g->ns * 1e-9;
    hg_json_put(w,
        "\"geometry\":{\"files\":%u,\"found\":%u,\"skipped\":%u,\"failed\":%u,\"triangles\":%llu,"
        "\"file_bytes\":%llu,\"bytes_per_triangle\":%.4f,\"triangles_per_s\":%.0f,\"ms\":%.3f,"
        "\"failures\":[",
        g->files, g->found, g->skipped, g->failed, (unsigned long long)g->triangles,
        (unsigned long long)g->file_bytes,
        g->triangles > 0 ? (double)g->file_bytes / (double)g->triangles : 0,
        seconds > 0 ? (double)g->made_triangles / seconds : 0, seconds * 1e3);
    hg_write_bytes(w, g->failures.data, g->failures.size);
    hg_json_put(w, "]}");
}

enum hg_status hg_bake_geometry(const struct hg_bake *bake, struct hg_store *store,
    struct hg_bake_entries *entries, struct hg_writer *report, struct hg_error *err)
{
    struct geometry g = {.bake = bake, .store = store, .entries = entries};
    enum hg_status status = each_part(&g, count_part, err);
    if (status == HG_OK)
        status = each_part(&g, bake_part, err);
    if (status == HG_OK)
        put_report(report, &g);
    hg_writer_finish(&g.failures);
    return status;
}
