// culling.c - see culling.h.
#include "renderer/cull/culling.h"

#include <math.h>

#include "base/alloc.h"
#include "renderer/cull/cpu_visibility.h"
#include "renderer/cull/draw_list.h"
#include "renderer/cull/occlusion.h"
#include "renderer/cull/select.h"

// Triangles. The test takes 3.5 ms at 1280x720 on two cores, a hidden triangle saves 0.2 us, and a
// walk through Sponza hides 4 of 100: it pays from 400 thousand.
#define OCCLUSION_FROM 400000u
#define ERROR_STEP     1.25f
#define MOST_ERROR_PX  1e6f
#define CALM           6 // frames that fit before the error is lowered
#define MOST_ROUNDS    4 // of loading before chunks must be driving each other out

struct hg_culling {
    struct hg_gpu *gpu;
    uint64_t occlusion_from;
    struct hg_selection runs; // of the set that is being added
    struct hg_culling_set *sets;
    size_t set_capacity;
    uint32_t set_count;
    struct hg_draw_list items;
    struct hg_occlusion occlusion;
    struct hg_cpu_visibility hosted;
    struct hg_gpu_buffer indices, ids, vertices; // of this frame
    float bias;                                  // on the error of views that do not wait; 0 = 1
    uint32_t calm; // frames since they wanted more than the budget holds
    bool crowded;  // the newest views wanted more than the budget holds
};

enum hg_status hg_culling_create(struct hg_gpu *gpu, struct hg_culling **out, struct hg_error *err)
{
    *out = hg_calloc(1, sizeof **out);
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "draw lists", NULL, "no memory");
    (*out)->gpu = gpu;
    (*out)->occlusion_from = OCCLUSION_FROM;
    return HG_OK;
}

void hg_culling_destroy(struct hg_culling *v)
{
    if (v == NULL)
        return;
    hg_gpu_buffer_destroy(v->gpu, &v->indices);
    hg_gpu_buffer_destroy(v->gpu, &v->ids);
    hg_gpu_buffer_destroy(v->gpu, &v->vertices);
    hg_free(v->runs.items);
    hg_free(v->runs.wants);
    hg_free(v->sets);
    hg_draw_list_finish(&v->items);
    hg_occlusion_finish(v->gpu, &v->occlusion);
    hg_cpu_visibility_finish(v->gpu, &v->hosted);
    hg_free(v);
}

void hg_culling_relax(struct hg_culling *v)
{
    if (v->calm < CALM)
        return;
    v->bias = fmaxf(v->bias / ERROR_STEP, 1.0f);
    v->calm = 0;
}

void hg_culling_set_occlusion_from(struct hg_culling *v, uint64_t triangles)
{
    v->occlusion_from = triangles > 0 ? triangles : OCCLUSION_FROM;
}

static struct hg_cpu_visibility_history history_of(const struct hg_culling *v, bool known)
{
    return (struct hg_cpu_visibility_history){
        known ? v->occlusion.history : NULL, known ? v->occlusion.history_bits : 0};
}

void hg_culling_reset(struct hg_culling *v)
{
    const struct hg_cpu_visibility_history history = history_of(v, true);
    if (v->occlusion.tested && v->set_count > 0)
        hg_occlusion_learn(&v->occlusion, &v->sets[0]);
    hg_cpu_visibility_reset(&v->hosted, &history);
    // Evenly coarser while not all fits; finer again, slowly, when it does.
    if (v->crowded)
        v->bias = fminf(fmaxf(v->bias, 1.0f) * ERROR_STEP, MOST_ERROR_PX);
    v->calm = v->crowded ? 0 : v->calm < CALM ? v->calm + 1 : CALM;
    v->crowded = false;
    hg_occlusion_reset(&v->occlusion);
    hg_draw_list_reset(&v->items);
    v->set_count = 0;
}

// --- sets ----------------------------------------------------------------------------------------

static uint64_t triangles_of(const struct hg_selection *runs)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < runs->count; i++)
        sum += runs->items[i].count;
    return sum;
}

static enum hg_status select_once(struct hg_culling *v, const struct hg_geometry *g,
    const struct hg_culling_view *view, struct hg_jobs *jobs, struct hg_error *err)
{
    v->runs.count = v->runs.want_count = 0;
    const enum hg_status status = hg_select(g, view, jobs, &v->runs);
    if (status != HG_OK)
        return hg_error_set(err, status, "draw lists", NULL, "no memory");
    if (hg_select_wants(g, view, &v->runs) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "draw lists", NULL, "no memory");
    return HG_OK;
}

// A new frame for the pool: what earlier frames used may go, what the sets before use may not.
static void tick(const struct hg_culling *v, const struct hg_geometry *g)
{
    hg_cluster_pool_tick(g->pool);
    for (uint32_t i = 0; i < v->items.count; i++) {
        const struct hg_culling_item *item = &v->items.list[i];
        if (item->chunk != HG_LOD_NONE)
            hg_cluster_pool_use(g->pool, g->draws[item->first_draw].part->clusters, item->chunk);
    }
    hg_cpu_visibility_use(&v->hosted, g);
}

// One attempt to have all that is missing. *fits: all of it found room. What earlier frames left
// must not decide that: when there is no room, their chunks go, and what these are parts of as
// well.
static enum hg_status load_wanted(struct hg_culling *v, const struct hg_geometry *g,
    const struct hg_culling_view *view, struct hg_jobs *jobs, bool *fits, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    uint32_t before = UINT32_MAX; // at first only what was not used in this frame goes
    *fits = false;
    while (status == HG_OK && !*fits && v->runs.want_count < before) {
        before = before == UINT32_MAX ? before - 1 : v->runs.want_count;
        status = hg_cluster_pool_load(g->pool, v->runs.wants, v->runs.want_count, view->whole, err);
        *fits = status == HG_OK;
        if (status == HG_E_AGAIN) {
            hg_cluster_pool_loosen(g->pool);
            tick(v, g);
            status = HG_OK;
        }
        if (status == HG_OK)
            status = select_once(v, g, view, jobs, err);
    }
    *fits = *fits || v->runs.want_count == 0;
    return status;
}

// Selects what the view shows. A view that waits loads what is missing; when the budget does not
// hold all of it, the error is raised for all parts alike until it does.
static enum hg_status select_runs(struct hg_culling *v, const struct hg_geometry *g,
    struct hg_culling_view *view, struct hg_jobs *jobs, bool *crowded, struct hg_error *err)
{
    *crowded = false;
    enum hg_status status = select_once(v, g, view, jobs, err);
    if (status == HG_OK && v->runs.want_count > 0 && !view->wait)
        *crowded = hg_cluster_pool_request(g->pool, v->runs.wants, v->runs.want_count);
    for (uint32_t round = 1; status == HG_OK && v->runs.want_count > 0 && view->wait; round++) {
        bool fits;
        status = load_wanted(v, g, view, jobs, &fits, err);
        if (status != HG_OK || (fits && round < MOST_ROUNDS))
            continue;
        round = 0;
        *crowded = v->runs.want_count > 0;
        if (view->whole || view->error_px >= MOST_ERROR_PX)
            break;
        view->error_px *= ERROR_STEP;
        status = select_once(v, g, view, jobs, err);
    }
    return status;
}

enum hg_status hg_culling_add(struct hg_culling *v, const struct hg_geometry *geometry,
    const struct hg_culling_view *wanted, struct hg_jobs *jobs, struct hg_error *err)
{
    struct hg_culling_view view = *wanted;
    struct hg_culling_set set = {.numbered = wanted->numbered};
    if (!view.wait && v->bias > 1.0f)
        view.error_px *= v->bias;
    bool crowded;
    enum hg_status status = select_runs(v, geometry, &view, jobs, &crowded, err);
    if (status != HG_OK)
        return status;
    v->crowded |= crowded && !view.wait;
    set.missing = v->runs.want_count;
    set.error_px = view.error_px;
    set.crowded = crowded || view.error_px > wanted->error_px;
    if (view.history)
        status = hg_occlusion_keep_history(&v->occlusion, geometry);
    const struct hg_cpu_visibility_set source = {
        geometry, &view, history_of(v, view.history), v->set_count};
    if (status == HG_OK && view.host != NULL)
        status = hg_cpu_visibility_take(&v->hosted, &source, jobs, &v->runs);
    set.hosted = v->hosted.count > 0 && v->hosted.set == v->set_count;
    // What is in front of the host's pixels at the same depth must not depend on phases.
    const bool occlusion =
        view.history && !set.hosted && triangles_of(&v->runs) >= v->occlusion_from;
    const struct hg_draw_list_run adding = {
        geometry, &view, &set, occlusion ? &v->occlusion : NULL};
    if (status == HG_OK)
        status = hg_draw_list_add(&v->items, &adding, &v->runs);
    if (status == HG_OK)
        status = hg_grow(&v->sets, &v->set_capacity, v->set_count + 1, sizeof *v->sets);
    if (status != HG_OK)
        return hg_error_set(err, status, "draw lists", NULL, "no memory");
    v->sets[v->set_count++] = set;
    return HG_OK;
}

uint32_t hg_culling_count(const struct hg_culling *v)
{
    return v->set_count;
}

const struct hg_culling_set *hg_culling_set(const struct hg_culling *v, uint32_t set)
{
    return &v->sets[set];
}

const struct hg_culling_item *hg_culling_item(const struct hg_culling *v, uint32_t index)
{
    return &v->items.list[index];
}

// --- device --------------------------------------------------------------------------------------

static enum hg_status write_listing(
    struct hg_culling *v, struct hg_jobs *jobs, struct hg_error *err)
{
    struct hg_index_lists *l = &v->items.listing;
    if (l->index_count == 0)
        return HG_OK;
    enum hg_status status = hg_gpu_buffer_reserve(
        v->gpu, HG_GPU_BUFFER_UPLOAD, l->index_count * 4, "listed indices", &v->indices, err);
    if (status == HG_OK && l->id_count > 0)
        status = hg_gpu_buffer_reserve(
            v->gpu, HG_GPU_BUFFER_UPLOAD, l->id_count * 4ull, "listed primitives", &v->ids, err);
    if (status == HG_OK && l->vertex_count > 0)
        status = hg_gpu_buffer_reserve(v->gpu, HG_GPU_BUFFER_UPLOAD,
            l->vertex_count * sizeof(struct hg_index_list_vertex), "listed vertices", &v->vertices,
            err);
    if (status != HG_OK)
        return status;
    const struct hg_index_lists_memory memory = {
        v->indices.mapped, v->ids.mapped, v->vertices.mapped};
    hg_index_lists_write(l, jobs, &memory);
    return HG_OK;
}

enum hg_status hg_culling_upload(struct hg_culling *v, struct hg_jobs *jobs, struct hg_error *err)
{
    const enum hg_status status = write_listing(v, jobs, err);
    if (status != HG_OK)
        return status;
    for (uint32_t i = 0; i < v->set_count; i++)
        hg_draw_list_narrow(&v->items, &v->occlusion, &v->sets[i]);
    return hg_occlusion_upload(v->gpu, &v->occlusion, err);
}

void hg_culling_draw(
    const struct hg_culling *v, struct hg_gpu_cmd *cmd, const struct hg_culling_item *item)
{
    const VkCommandBuffer handle = hg_gpu_cmd_handle(cmd);
    const VkBuffer indices =
        item->index_buffer != VK_NULL_HANDLE ? item->index_buffer : v->indices.handle;
    vkCmdBindIndexBuffer(handle, indices, item->command == HG_CLUSTER_NONE ? item->index_offset : 0,
        VK_INDEX_TYPE_UINT32);
    const VkBuffer vertices = item->listed ? v->vertices.handle : item->position_buffer;
    if (item->numbered)
        vkCmdBindVertexBuffers(handle, 0, 1, &vertices, &item->position_offset);
    if (item->command == HG_CLUSTER_NONE)
        vkCmdDrawIndexed(handle, item->index_count, item->draw_count, 0, 0, item->first_draw);
    else
        vkCmdDrawIndexedIndirect(handle, v->occlusion.command_buffer.handle,
            item->command * sizeof(struct hg_gpu_draw_command), 1,
            sizeof(struct hg_gpu_draw_command));
}

void hg_culling_fill(
    const struct hg_culling *v, const struct hg_culling_item *item, struct hg_gpu_item *out)
{
    *out = (struct hg_gpu_item){.positions = item->positions,
        .vertices = item->vertices,
        .extra = item->extra,
        .depth = v->occlusion.depth.address,
        .seen = v->occlusion.seen.address};
    if (item->first_primitive != HG_CLUSTER_NONE)
        out->primitives = v->ids.address + item->first_primitive * 4ull;
}

// --- what the host draws -------------------------------------------------------------------------

enum hg_status hg_culling_draw_cpu(struct hg_culling *v, const struct hg_culling_sample *sample,
    struct hg_jobs *jobs, struct hg_error *err)
{
    return hg_cpu_visibility_draw(&v->hosted, v->gpu, sample, jobs, err);
}

void hg_culling_copy_cpu(const struct hg_culling *v, struct hg_gpu_cmd *cmd, uint32_t slot,
    struct hg_gpu_image *visibility, struct hg_gpu_image *depth, VkRect2D area)
{
    hg_cpu_visibility_copy(&v->hosted, cmd, slot, visibility, depth, area);
}

// --- occlusion -----------------------------------------------------------------------------------

enum hg_status hg_culling_test(struct hg_culling *v, struct hg_gpu_cmd *cmd,
    const struct hg_culling_test *test, struct hg_error *err)
{
    const enum hg_status status =
        hg_occlusion_test(v->gpu, &v->occlusion, cmd, &v->sets[test->set], test, err);
    v->occlusion.tested |= status == HG_OK && test->set == 0;
    return status;
}

void hg_culling_stats(const struct hg_culling *v, struct hg_culling_stats *out)
{
    *out = (struct hg_culling_stats){.bytes = v->indices.size_bytes + v->ids.size_bytes +
                                              v->vertices.size_bytes + v->hosted.pixels.size_bytes +
                                              hg_occlusion_bytes(&v->occlusion)};
    if (v->set_count == 0)
        return;
    const struct hg_culling_set *set = &v->sets[0];
    out->hosted = set->hosted ? hg_cpu_visibility_triangles(&v->hosted) : 0;
    out->triangles = set->triangles + out->hosted;
    out->late = set->late_count;
    for (uint32_t i = 0; i < set->item_count; i++)
        out->draws += v->items.list[set->first_item + i].draw_count;
    if (v->occlusion.tested)
        hg_occlusion_count(&v->occlusion, set, &out->hidden, &out->triangles);
}
