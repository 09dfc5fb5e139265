// wave_kernels.c - buffers of a wave, the uniform block of its kernels, and dispatch.
#include <math.h>
#include <string.h>

#include "renderer/pathtrace/filter.h"
#include "renderer/pathtrace/path_state.h"
#include "shaders/shared/features.h"

// --- memory --------------------------------------------------------------------------------------

void hg_path_wave_destroy(struct hg_path_wave *w, struct hg_gpu *gpu)
{
    struct hg_path_wave_buffers *b = &w->buffers;
    struct hg_path_wave_lists *l = &w->lists;
    struct hg_gpu_buffer *all[] = {&b->block, &b->rays, &b->shadow_rays, &b->hits, &b->shadow_hits,
        &b->blocked, &b->status, &b->state, &b->tiles, &b->tile_samples, &l->live.buffer,
        &l->waiting.buffer, &l->shadows.buffer, &l->suns.buffer, &l->primary.buffer};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        hg_gpu_buffer_destroy(gpu, all[i]);
}

enum hg_status hg_path_wave_create(struct hg_path *p, struct hg_error *err)
{
    struct hg_path_wave_buffers *b = &p->wave.buffers;
    struct hg_path_wave_lists *l = &p->wave.lists;
    const uint64_t n = HG_PATH_WAVE_PX,
                   words =
                       HG_PATH_WORDS + p->film.sampled_channels - 1 +
                       (p->options & (HG_PATH_SPLIT | HG_PATH_GROUPS) ? HG_PATH_SPLIT_WORDS : 0) +
                       (p->options & HG_PATH_FOLLOWS ? HG_PATH_SEEN_WORDS : 0);
    const bool shared = hg_trace_backend(hg_rays_trace(p->scene.rays)) == HG_TRACE_EMBREE;
    const enum hg_gpu_buffer_kind kind = shared ? HG_GPU_BUFFER_READBACK : HG_GPU_BUFFER_DEVICE;
    const struct {
        struct hg_gpu_buffer *buffer;
        uint64_t bytes;
        enum hg_gpu_buffer_kind kind;
        const char *name;
    } all[] = {{&b->rays, n * sizeof(struct hg_gpu_ray), kind, "rays"},
        {&b->shadow_rays, 2 * n * sizeof(struct hg_gpu_ray), kind, "shadow rays"},
        {&b->hits, n * sizeof(struct hg_gpu_hit), kind, "hits"},
        {&b->shadow_hits, n * sizeof(struct hg_gpu_hit), kind, "shadow hits"},
        {&b->blocked, n * 4, kind, "blocked"},
        {&b->status, n * 4, HG_GPU_BUFFER_READBACK, "path status"},
        {&b->state, n * 4 * words, HG_GPU_BUFFER_DEVICE, "path state"},
        {&l->live.buffer, n * 4, HG_GPU_BUFFER_UPLOAD, "live paths"},
        {&l->waiting.buffer, n * 4, HG_GPU_BUFFER_UPLOAD, "waiting paths"},
        {&l->shadows.buffer, n * 4, HG_GPU_BUFFER_UPLOAD, "shadow paths"},
        {&l->suns.buffer, n * 4, HG_GPU_BUFFER_UPLOAD, "sun paths"},
        {&l->primary.buffer, n * 4, HG_GPU_BUFFER_UPLOAD, "seen paths"},
        {&b->tiles, HG_PATH_WAVE_TILES * 4, HG_GPU_BUFFER_UPLOAD, "wave tiles"},
        {&b->tile_samples, HG_PATH_WAVE_TILES * 4, HG_GPU_BUFFER_UPLOAD, "wave samples"},
        {&b->block, (2 * sizeof p->wave.block + 255) / 256 * 256, HG_GPU_BUFFER_UPLOAD, "path"}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof all / sizeof *all && status == HG_OK; i++)
        status = hg_gpu_buffer_reserve(
            p->context->gpu, all[i].kind, all[i].bytes, all[i].name, all[i].buffer, err);
    p->wave.host_hits = shared;
    return status;
}

// --- kernels -------------------------------------------------------------------------------------

static void fill_lens(const struct hg_path *p, struct hg_gpu_path *block)
{
    const struct hg_gpu_camera *c = p->host.camera;
    const struct hg_view_camera_state *s = &p->request.camera;
    const bool sharp = c->orthographic != 0 || p->request.surfaces || p->request.gather.on;
    const float radius = sharp ? 0.0f : s->lens_radius;
    const float *inverse = c->inv_view.m;
    double distance = s->focus_distance;
    if (!(distance > 0.0)) {
        distance = 0.0;
        for (int i = 0; i < 3; i++)
            distance += (s->target[i] - s->eye[i]) * (double)(&c->forward_ws.x)[i];
    }
    block->lens_x_ws =
        (struct hg_vec3){inverse[0] * radius, inverse[1] * radius, inverse[2] * radius};
    block->lens_y_ws =
        (struct hg_vec3){inverse[4] * radius, inverse[5] * radius, inverse[6] * radius};
    block->focus_distance = distance > 1e-6 ? (float)distance : 1e-6f;
}

uint32_t hg_path_sample_bits(uint32_t samples)
{
    uint32_t bits = 0;
    while (bits < 16 && (1u << bits) < samples)
        bits++;
    return bits;
}

uint32_t hg_path_lamps_from(const struct hg_path *p)
{
    const bool suns = p->wave.block.emitters.directional_count > 0;
    return p->request.gather.on && !suns ? p->request.gather.full : p->request.samples;
}

// Fewer pipeline variants on devices for which branches are cheap.
static uint32_t may_of(const struct hg_path *p, const struct hg_gpu_emitters *e)
{
    uint32_t may = p->film.channels > HG_PATH_FILM_WORDS ? HG_PATH_PLANES : 0;
    const bool others = e->node_count > 0 || e->environment_kind != HG_ENV_KIND_NONE;
    const bool aside = others || p->request.gather.on;
    const uint32_t apart = e->directional_count > 0 && aside ? HG_PATH_SUNS_APART : 0;
    if (!hg_gpu_strategy(p->context->gpu)->exact_pipelines)
        return HG_PATH_PLANES | HG_EMITTER_KIND_ALL | apart;
    may |= e->node_count > 0 ? HG_EMITTER_KIND_TREE : 0;
    may |= e->directional_count > 0 ? HG_EMITTER_KIND_SUN : 0;
    may |= e->directional_count > 1 ? HG_EMITTER_KIND_SUNS : 0;
    if (e->environment_kind == HG_ENV_KIND_IMAGE)
        may |= HG_EMITTER_KIND_IMAGE;
    else if (e->environment_kind != HG_ENV_KIND_NONE)
        may |= HG_EMITTER_KIND_PLAIN;
    may |= e->lamp_node_count > 0 || e->sized_suns > 0 ? HG_EMITTER_KIND_SIZED : 0;
    return may | apart;
}

// Scale of ray differentials by the number of samples. The mean of samples is filtered by the pixel
// filter, so that coarser mips would only blur it. Source: Pharr,
// Jakob and Humphreys, "Physically Based Rendering", 4th ed., section 10.1.3.
static float footprint_of(const struct hg_path *p)
{
    if (p->request.surfaces)
        return 1;
    return fmaxf(1 / sqrtf((float)p->request.samples), 0.125f);
}

void hg_path_wave_fill(struct hg_path *p)
{
    const struct hg_path_settings *s = &p->request.settings;
    const uint32_t estimators = p->context->overrides.path_estimators;
    p->wave.block = (struct hg_gpu_path){.rays = p->wave.buffers.rays.address,
        .shadow_rays = p->wave.buffers.shadow_rays.address,
        .hits = p->wave.buffers.hits.address,
        .shadow_hits = p->wave.buffers.shadow_hits.address,
        .blocked = p->wave.buffers.blocked.address,
        .status = p->wave.buffers.status.address,
        .state = p->wave.buffers.state.address,
        .tiles = p->wave.buffers.tiles.address,
        .tile_samples = p->wave.buffers.tile_samples.address,
        .film = p->film.sums.address,
        .ring = p->film.ring.address,
        .traced = p->film.traced.address,
        .columns = p->film.columns,
        .ring_rows = p->film.ring_rows,
        .draw_marks = p->scene.groups.draw_marks.address,
        .light_groups = p->scene.groups.of_lights.address,
        .names = p->scene.ids.names.address,
        .lists = p->film.lists,
        .list_count = p->scene.ids.list_count,
        .name_draws = p->scene.ids.draws,
        .split = HG_PATH_WORDS + p->film.sampled_channels - 1,
        .capacity = HG_PATH_WAVE_PX,
        .channels = p->film.sampled_channels,
        .sample_bits = hg_path_sample_bits(p->request.samples),
        .gather = {.reach = p->request.gather.reach},
        .branch_bits = p->branch_bits,
        .footprint = footprint_of(p),
        .max_bounces = s->max_bounces,
        .clamp_indirect = s->clamp_indirect,
        .has_alpha_mask = p->scene.has_alpha_mask,
        .estimators = estimators != 0 ? estimators : HG_PATH_USE_EMITTERS | HG_PATH_USE_SURFACES};
    hg_emitters_fill(p->scene.emitters, &p->wave.block.emitters);
    p->wave.block.gather.lamps_from = hg_path_lamps_from(p);
    memcpy(p->wave.block.moments, p->scene.blur.moments, sizeof p->scene.blur.moments);
    p->wave.may = may_of(p, &p->wave.block.emitters) | (p->film.splats ? HG_PATH_SPLATS : 0);
    memcpy(p->wave.block.planes, p->film.planes, sizeof p->film.planes);
    fill_lens(p, &p->wave.block);
    if (p->film.splats)
        hg_path_splat_fill(s, p->progress.pass, p->request.seed, &p->wave.block);
    else
        hg_path_filter_fill(s->filter, s->filter_radius_px, p->wave.block.filter_px);
    memcpy(p->wave.buffers.block.mapped, &p->wave.block, sizeof p->wave.block);
}

static bool samples_textures(enum hg_path_kernel kernel)
{
    return kernel != HG_PATH_BEGIN && kernel != HG_PATH_ARRIVE && kernel != HG_PATH_CLEAR &&
           kernel != HG_PATH_KEEP && kernel != HG_PATH_ADD;
}

// Compiling kernels of surfaces takes a second each, so they are made side by side: those of first
// and of later hits, with these those of ends and of rays that leave the scene.
static enum hg_status make_ahead(struct hg_path *p, struct hg_pass *pass, struct hg_error *err)
{
    const uint32_t options = p->options | p->wave.may;
    const enum hg_path_kernel surface = p->wave.host_hits ? HG_PATH_SURFACE : HG_PATH_SHADE;
    struct hg_path_variant list[4] = {{surface, options | HG_PATH_FIRST}, {surface, options}};
    uint32_t count = 2;
    if ((p->options & HG_PATH_SURFACES) != 0)
        return HG_OK; // there are no later hits
    if ((p->options & (HG_PATH_GATHERS | HG_PATH_GLASS)) == HG_PATH_GATHERS)
        list[count++] = (struct hg_path_variant){HG_PATH_END, options};
    if (p->wave.host_hits && p->wave.block.emitters.environment_kind != HG_ENV_KIND_NONE)
        list[count++] = (struct hg_path_variant){HG_PATH_MISS, options};
    return hg_path_make(pass, list, count, err);
}

// What the film will add up begins at 0: a kernel would write these words one by one.
static void clear_out(const struct hg_path *p, struct hg_gpu_cmd *cmd)
{
    for (uint64_t k = HG_PATH_OUT; k < HG_PATH_OUT + p->film.sampled_channels - 1; k++)
        vkCmdFillBuffer(hg_gpu_cmd_handle(cmd), p->wave.buffers.state.handle,
            k * HG_PATH_WAVE_PX * 4, (uint64_t)p->wave.slots * 4, 0);
}

static enum hg_status record(
    struct hg_path *p, const struct hg_path_run *r, struct hg_pass *pass, struct hg_error *err)
{
    const struct hg_gpu_uniform block = {
        p->wave.buffers.block.address, p->wave.buffers.block.size_bytes};
    const struct hg_gpu_path_push push = {r->list->buffer.address + (uint64_t)r->first * 4,
        r->count, 0, p->wave.second, p->wave.branch};
    const bool shades =
        r->kernel >= HG_PATH_SHADE && r->kernel <= HG_PATH_SUNLIT; // END is never first
    const uint32_t first = shades && p->wave.bounce == 0 ? HG_PATH_FIRST : 0;
    const enum hg_status status =
        first != 0 && r->kernel <= HG_PATH_SURFACE ? make_ahead(p, pass, err) : HG_OK;
    if (status != HG_OK)
        return status;
    return hg_path_record(pass, r->kernel, p->options | p->wave.may | first, &block, &push, err);
}

enum hg_status hg_path_wave_run(struct hg_path *p, const struct hg_path_run *r,
    struct hg_page_demand *demand, struct hg_error *err)
{
    struct hg_gpu *gpu = p->context->gpu;
    struct hg_page_cache *pages = hg_path_pages(p);
    const bool streams = samples_textures(r->kernel) && !hg_page_cache_is_complete(pages);
    struct hg_gpu_cmd *cmd;
    *demand = (struct hg_page_demand){.fits = true};
    enum hg_status status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    struct hg_pass pass = p->host.begin(p->host.user, cmd, streams);
    if (streams)
        hg_page_cache_begin(pages, cmd);
    if (r->kernel == HG_PATH_BEGIN && p->wave.branch == 0)
        clear_out(p, cmd);
    status = record(p, r, &pass, err);
    if (status != HG_OK) {
        hg_gpu_discard(gpu, cmd);
        return status;
    }
    if (streams)
        hg_page_cache_end(pages, cmd);
    status = hg_gpu_submit_and_wait(gpu, cmd, err);
    if (status == HG_OK && streams)
        hg_page_cache_collect(pages, HG_PAGES_EXACT, demand);
    p->wave.missing = demand->missing;
    return status;
}
