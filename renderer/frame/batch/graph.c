// graph.c - the passes of a view, declared for the frame graph: what each reads and writes,
// and how it is recorded. See batch.h.
#include <string.h>

#include "base/clock.h"
#include "renderer/frame/batch/recording.h"
#include "renderer/passes/checkerboard.h"
#include "renderer/passes/debug.h"
#include "renderer/passes/pick.h"
#include "renderer/passes/probe_light.h"
#include "renderer/passes/resolve.h"
#include "renderer/passes/shade.h"
#include "renderer/passes/skin.h"
#include "renderer/passes/triangle_cache.h"
#include "shaders/shared/debug.h"
#include "shaders/shared/features.h"
#include "shaders/shared/unlit_tiles.h"

// --- what does not depend on the sample ----------------------------------------------------------

static enum hg_status record_skin(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    (void)user;
    return hg_skin_record(run->cmd, hg_batch_of(run)->draw->scene_gpu->geometry, err);
}

static enum hg_status record_cache(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)user;
    return hg_triangle_cache_record(&f->pass, f->draw->scene_gpu->geometry, err);
}

static enum hg_status record_shadow(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const struct hg_tiled_shadows *s = &f->draw->accumulation->shadows;
    const bool coarse = hg_draw_is(f->draw, HG_DRAW_COARSE_SHADOWS);
    struct hg_pass pass = f->pass;
    (void)user;
    hg_frame_pass_use_scene(f->draw, &pass);
    pass.area = s->areas.count > 0 ? s->areas.items[s->areas.count - 1].rect : (VkRect2D){0};
    pass.adds = s->areas.count > 0 && s->begun;
    return hg_shadow_record(
        &pass, f->draw->lighting, coarse, f->draw->culling, f->first_shadow_set, err);
}

static void declare_geometry(struct hg_batch *f)
{
    const struct hg_geometry *geometry = f->draw->scene_gpu->geometry;
    const struct hg_triangle_cache_job *jobs;
    if (hg_geometry_deform_count(geometry) > 0) {
        f->deformed = hg_graph_buffer(f->graph, "deformed vertices");
        hg_batch_add(f, &(struct hg_graph_pass){.name = "skin",
                            .record = record_skin,
                            .accesses = {{f->deformed, HG_GRAPH_WRITE, 0}},
                            .keep = true, // the next frame may need what it writes
                            .once = true});
    }
    if (hg_geometry_facet_jobs(geometry, &jobs) > 0) {
        f->cache = hg_graph_buffer(f->graph, "triangle cache");
        hg_batch_add(
            f, &(struct hg_graph_pass){.name = "triangle cache fill",
                   .record = record_cache,
                   .accesses = {{f->deformed, HG_GRAPH_READ, 0}, {f->cache, HG_GRAPH_WRITE, 0}},
                   .keep = true,
                   .once = true});
    }
}

// first_set: of the maps that are due.
static void declare_shadows(struct hg_batch *f, uint32_t first_set)
{
    struct hg_lighting_stats stats;
    hg_lighting_stats(f->draw->lighting, &stats);
    f->draw->stats->stale_shadows =
        first_set < hg_culling_count(f->draw->culling) ? stats.shadow_maps_stale : 0;
    f->atlas =
        hg_graph_import(f->graph, "shadow atlas", hg_lighting_image_shadow(f->draw->lighting));
    f->first_shadow_set = first_set;
    hg_graph_want(f->graph, f->atlas);
    if (first_set < hg_culling_count(f->draw->culling))
        hg_batch_add(f,
            &(struct hg_graph_pass){.name = "shadow",
                .record = record_shadow,
                .accesses = {{f->deformed, HG_GRAPH_READ, 0}, {f->atlas, HG_GRAPH_DEPTH_KEEP, 0}},
                .once = true});
}

// --- visibility ----------------------------------------------------------------------------------

static struct hg_visibility_scene scene_of(const struct hg_batch *f)
{
    return (struct hg_visibility_scene){f->draw->culling, 0, f->slot};
}

static struct hg_visibility_target target_of(const struct hg_graph_run *run)
{
    const struct hg_batch *f = hg_batch_of(run);
    return (struct hg_visibility_target){
        hg_graph_run_image(run, f->visibility), hg_graph_run_image(run, f->depth)};
}

static enum hg_status record_visibility(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const struct hg_visibility_scene scene = scene_of(f);
    const struct hg_visibility_target target = target_of(run);
    (void)user;
    return hg_visibility_record(&f->pass, &scene, &target, err);
}

static enum hg_status record_occlusion(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const struct hg_visibility_scene scene = scene_of(f);
    const struct hg_visibility_target target = target_of(run);
    (void)user;
    return hg_visibility_test(&f->pass, &scene, &target, err);
}

static enum hg_status record_late(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const struct hg_visibility_scene scene = scene_of(f);
    const struct hg_visibility_target target = target_of(run);
    (void)user;
    return hg_visibility_record_late(&f->pass, &scene, &target, err);
}

// Two phases when there is much to draw (renderer/cull/culling.h).
static void declare_visibility(struct hg_batch *f)
{
    const struct hg_culling_set *set = hg_culling_set(f->draw->culling, 0);
    hg_batch_add(f, &(struct hg_graph_pass){.name = "visibility",
                        .record = record_visibility,
                        .accesses = {{f->deformed, HG_GRAPH_READ, 0}, {f->cache, HG_GRAPH_READ, 0},
                            {f->progress, HG_GRAPH_READ_WRITE, 0},
                            {f->visibility, HG_GRAPH_COLOR, 0}, {f->depth, HG_GRAPH_DEPTH, 0}}});
    if (set->candidate_count == 0)
        return;
    f->late_draws = hg_graph_buffer(f->graph, "late draws");
    hg_batch_add(
        f, &(struct hg_graph_pass){.name = "occlusion",
               .record = record_occlusion,
               .accesses = {{f->depth, HG_GRAPH_COPY_FROM, 0},
                   {f->visibility, HG_GRAPH_COPY_FROM, 0}, {f->late_draws, HG_GRAPH_WRITE, 0}},
               .keep = true}); // the host counts what it hid
    if (set->late_count > 0)
        hg_batch_add(f,
            &(struct hg_graph_pass){.name = "visibility",
                .record = record_late,
                .accesses = {{f->deformed, HG_GRAPH_READ, 0}, {f->cache, HG_GRAPH_READ, 0},
                    {f->late_draws, HG_GRAPH_READ, 0}, {f->progress, HG_GRAPH_READ_WRITE, 0},
                    {f->visibility, HG_GRAPH_COLOR_KEEP, 0}, {f->depth, HG_GRAPH_DEPTH_KEEP, 0}}});
}

// --- light from probes ---------------------------------------------------------------------------

static enum hg_status record_probe_light(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)user;
    const struct hg_probe_light light = {.visibility = hg_graph_run_image(run, f->visibility),
        .depth = hg_graph_run_image(run, f->depth),
        .target = hg_graph_run_image(
            run, f->mirrors.surfaces > 0 ? f->mirrors.looked_up : f->probe_light),
        .surfaces = f->mirrors.surfaces > 0 ? hg_graph_run_image(run, f->mirrors.surfaces) : NULL};
    return hg_probe_light_record(&f->pass, &light, err);
}

// Of pictures in motion. Samples that are added up look up the field themselves, at random texels;
// so do surfaces that need the light behind them as well.
static void declare_probe_light(struct hg_batch *f)
{
    const bool apart = f->gathered > 0 || (f->pass.features & HG_FEATURE_DIFFUSE_TRANSMISSION) != 0;
    if (!hg_draw_is(f->draw, HG_DRAW_DIRECT) || apart ||
        (f->pass.features2 & HG_FEATURE2_PROBES) == 0)
        return;
    f->probe_light = hg_graph_image(f->graph,
        &(struct hg_graph_image_params){
            .name = "probe light", .format = HG_PROBE_LIGHT_FORMAT, .size = HG_GRAPH_QUARTER});
    const bool reflects = hg_reflect_view_is_on(f->draw);
    if (reflects)
        f->mirrors.surfaces = hg_graph_image(f->graph,
            &(struct hg_graph_image_params){
                .name = "mirrors", .format = HG_MIRRORS_FORMAT, .size = HG_GRAPH_QUARTER});
    hg_batch_add(
        f, &(struct hg_graph_pass){.name = "probe light",
               .record = record_probe_light,
               .accesses = {{f->deformed, HG_GRAPH_READ, 0}, {f->cache, HG_GRAPH_READ, 0},
                   {f->visibility, HG_GRAPH_SAMPLE, 0}, {f->depth, HG_GRAPH_SAMPLE, 0},
                   {f->probe_light, HG_GRAPH_COLOR, 0}, {f->mirrors.surfaces, HG_GRAPH_COLOR, 0}}});
    if (reflects)
        hg_batch_declare_reflections(f);
    if (reflects)
        hg_batch_declare_mirrors(f);
}

// --- the scene behind glass ----------------------------------------------------------------------

// The opaque scene that transmissive layers refract.
static enum hg_status record_behind(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)user;
    const struct hg_shade shade = {.visibility = hg_graph_run_image(run, f->visibility),
        .depth = hg_graph_run_image(run, f->depth),
        .target = hg_graph_run_image(run, f->behind),
        .gathered = f->gathered > 0 ? hg_graph_run_image(run, f->gathered) : NULL,
        .probe_light = f->probe_light > 0 ? hg_graph_run_image(run, f->probe_light) : NULL,
        .mirrored = hg_batch_mirrored(run),
        .clear = true,
        .alone = true};
    return hg_shade_record(&f->pass, &shade, err);
}

static void declare_behind(struct hg_batch *f)
{
    hg_batch_add(
        f, &(struct hg_graph_pass){.name = "shading",
               .record = record_behind,
               .accesses = {{f->visibility, HG_GRAPH_SAMPLE, 0}, {f->depth, HG_GRAPH_DEPTH_TEST, 0},
                   {f->atlas, HG_GRAPH_SAMPLE, 0}, {f->cache, HG_GRAPH_READ, 0},
                   {f->gathered, HG_GRAPH_SAMPLE, 0}, {f->probe_light, HG_GRAPH_SAMPLE, 0},
                   {f->mirrors.mirrored, HG_GRAPH_SAMPLE, 0}, {f->progress, HG_GRAPH_READ_WRITE, 0},
                   {f->behind, HG_GRAPH_COLOR_KEEP, 0}}}); // of an area perhaps
}

// --- shading -------------------------------------------------------------------------------------

static enum hg_status find_unlit(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)user;
    return hg_unlit_tiles_find(&f->pass, &f->draw->unlit->tiles, f->draw->lighting,
        hg_draw_is(f->draw, HG_DRAW_COARSE_SHADOWS), hg_graph_run_image(run, f->depth), err);
}

static enum hg_status mark_unlit(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)user;
    return hg_unlit_tiles_mark(
        &f->pass, &f->draw->unlit->tiles, hg_graph_run_image(run, f->depth), err);
}

static void declare_unlit(struct hg_batch *f)
{
    f->unlit.tiles = hg_graph_buffer(f->graph, "unlit tiles");
    hg_batch_add(f, &(struct hg_graph_pass){.name = "unlit tiles",
                        .record = find_unlit,
                        .accesses = {{f->depth, HG_GRAPH_SAMPLE, 0}, {f->atlas, HG_GRAPH_SAMPLE, 0},
                            {f->unlit.tiles, HG_GRAPH_WRITE, 0}}});
    hg_batch_add(f,
        &(struct hg_graph_pass){.name = "unlit marks",
            .record = mark_unlit,
            .accesses = {{f->unlit.tiles, HG_GRAPH_READ, 0}, {f->depth, HG_GRAPH_DEPTH_KEEP, 0}}});
}

static enum hg_status record_checkerboard(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)user;
    return hg_checkerboard_record(&f->pass, hg_graph_run_image(run, f->depth),
        hg_graph_run_image(run, f->shaded_depth), f->draw->frame->sample_index, err);
}

static void declare_checkerboard(struct hg_batch *f)
{
    const VkExtent2D size = hg_draw_size(f->draw->request);
    f->shaded_depth =
        hg_graph_image(f->graph, &(struct hg_graph_image_params){.name = "shaded depth",
                                     .format = HG_DEPTH_FORMAT,
                                     .size = HG_GRAPH_ABSOLUTE,
                                     .width = (size.width + 1) / 2,
                                     .height = size.height});
    hg_batch_add(
        f, &(struct hg_graph_pass){.name = "checkerboard",
               .record = record_checkerboard,
               .accesses = {{f->depth, HG_GRAPH_SAMPLE, 0}, {f->shaded_depth, HG_GRAPH_DEPTH, 0}}});
}

static enum hg_status record_shading(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)user;
    const struct hg_shade shade = {.visibility = hg_graph_run_image(run, f->visibility),
        .depth = hg_graph_run_image(run, f->shaded_depth),
        .checkerboard = f->shaded_depth != f->depth,
        .target = f->accumulated > 0 ? hg_graph_run_image(run, f->accumulated) : NULL,
        .picture = f->picture > 0 ? hg_graph_run_image(run, f->picture) : NULL,
        .tonemap = f->draw->request->settings->tonemap,
        .clear = f->alone || (f->sample == 0 && !hg_draw_is(f->draw, HG_DRAW_EXACT)),
        .unlit = f->unlit.skips,
        .masked = hg_batch_has_enough(f),
        .front = f->blend.color > 0 ? hg_graph_run_image(run, f->blend.color) : NULL,
        .gathered = f->gathered > 0 ? hg_graph_run_image(run, f->gathered) : NULL,
        .probe_light = f->probe_light > 0 ? hg_graph_run_image(run, f->probe_light) : NULL,
        .mirrored = hg_batch_mirrored(run)};
    return hg_shade_record(&f->pass, &shade, err);
}

// keep: its texture requests are counted, even if its colours are discarded.
static void declare_shading(struct hg_batch *f, bool keep)
{
    hg_batch_add(
        f, &(struct hg_graph_pass){.name = "shading",
               .record = record_shading,
               .accesses = {{f->visibility, HG_GRAPH_SAMPLE, 0},
                   {f->shaded_depth, HG_GRAPH_DEPTH_TEST, 0}, {f->blend.color, HG_GRAPH_SAMPLE, 0},
                   {f->atlas, HG_GRAPH_SAMPLE, 0}, {f->cache, HG_GRAPH_READ, 0},
                   {f->gathered, HG_GRAPH_SAMPLE, 0}, {f->probe_light, HG_GRAPH_SAMPLE, 0},
                   {f->mirrors.mirrored, HG_GRAPH_SAMPLE, 0}, {f->progress, HG_GRAPH_READ_WRITE, 0},
                   {f->accumulated, HG_GRAPH_COLOR_KEEP, 0}, // sums of samples
                   {f->picture, HG_GRAPH_COLOR, 0}},
               .keep = keep});
    hg_graph_want(f->graph, f->accumulated);
    hg_graph_want(f->graph, f->picture);
}

// --- debug views ---------------------------------------------------------------------------------

static enum hg_status record_overdraw(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const struct hg_visibility_scene scene = scene_of(f);
    (void)user;
    return hg_visibility_record_overdraw(&f->pass, &scene, hg_graph_run_image(run, f->counts), err);
}

static enum hg_status record_debug_view(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)user;
    const struct hg_debug debug = {.view = f->draw->request->settings->debug,
        .visibility = hg_graph_run_image(run, f->visibility),
        .counts = f->counts > 0 ? hg_graph_run_image(run, f->counts) : NULL,
        .target = hg_graph_run_image(run, f->accumulated)};
    return hg_debug_record(&f->pass, &debug, err);
}

static void declare_debug(struct hg_batch *f)
{
    f->accumulated = hg_graph_import(f->graph, "accumulated", &f->draw->targets->accumulated);
    f->atlas =
        hg_graph_import(f->graph, "shadow atlas", hg_lighting_image_shadow(f->draw->lighting));
    f->alone = true;
    declare_visibility(f);
    if (f->draw->request->settings->debug == HG_DEBUG_VIEW_OVERDRAW) {
        f->counts = hg_batch_image(f, "surface counts", HG_COLOR_FORMAT);
        hg_batch_add(
            f, &(struct hg_graph_pass){.name = "overdraw",
                   .record = record_overdraw,
                   .accesses = {{f->cache, HG_GRAPH_READ, 0}, {f->counts, HG_GRAPH_COLOR, 0}}});
    }
    // The picture itself, overwritten below: requests the pages that it would show.
    if (f->draw->request->settings->debug <= HG_DEBUG_VIEW_MISSING)
        declare_shading(f, true);
    hg_batch_add(
        f, &(struct hg_graph_pass){.name = "debug view",
               .record = record_debug_view,
               .accesses = {{f->visibility, HG_GRAPH_SAMPLE, 0}, {f->counts, HG_GRAPH_SAMPLE, 0},
                   {f->cache, HG_GRAPH_READ, 0}, {f->accumulated, HG_GRAPH_COLOR, 0}}});
    hg_graph_want(f->graph, f->accumulated);
}

// --- one batch -----------------------------------------------------------------------------------

static enum hg_status open_graph(struct hg_batch *f, struct hg_draw *draw, struct hg_error *err)
{
    struct hg_view_targets *t = draw->targets;
    *f = (struct hg_batch){.draw = draw, .slots = 1};
    if (t->graph == NULL) {
        const enum hg_status status = hg_graph_create(draw->context->gpu, &t->graph, err);
        if (status != HG_OK)
            return status;
    }
    f->graph = t->graph;
    const VkExtent2D size = hg_draw_size(draw->request);
    hg_graph_begin(f->graph, size.width, size.height);
    f->visibility = hg_graph_import(f->graph, "visibility", &t->visibility);
    f->depth = f->shaded_depth = hg_graph_import(f->graph, "depth", &t->depth);
    if (draw->gathered != NULL)
        f->gathered = hg_graph_import(f->graph, "gathered light", draw->gathered);
    f->progress = hg_draw_is(draw, HG_DRAW_EXACT) ? hg_graph_buffer(f->graph, "pixel progress") : 0;
    return HG_OK;
}

// The frame block is filled.
static enum hg_status begin(
    struct hg_batch *f, struct hg_draw *draw, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    const enum hg_status status = open_graph(f, draw, err);
    if (status == HG_OK)
        f->pass = hg_frame_pass(draw, cmd, 0);
    return status;
}

static enum hg_status run(struct hg_batch *f, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    const enum hg_status status = hg_graph_compile(f->graph, err);
    return status == HG_OK ? hg_graph_execute(f->graph, cmd, f, f->slot, err) : status;
}

static bool has_blend(const struct hg_draw *draw)
{
    const struct hg_culling_set *set = hg_culling_set(draw->culling, 0);
    return set->class_first[HG_DRAW_CLASS_BLEND + 1] > set->class_first[HG_DRAW_CLASS_BLEND];
}

static bool finds_unlit(struct hg_draw *draw, const struct hg_pass *pass)
{
    const enum hg_override wish = draw->context->overrides.unlit_tiles;
    const uint32_t lights = draw->frame->lighting.light_count;
    if (wish == HG_OVERRIDE_OFF || lights == 0 || lights > HG_UNLIT_TILES_MOST_LIGHTS ||
        pass->area.extent.width > 0 || hg_lighting_has_pages(draw->lighting) ||
        draw->gathered != NULL) // rays see what maps do not
        return false;
    if (wish == HG_OVERRIDE_ON)
        return true;
    if (!hg_draw_is(draw, HG_DRAW_DIRECT) || !hg_gpu_strategy(pass->gpu)->unlit_tiles)
        return false;
    if (draw->unlit->wait > 0)
        draw->unlit->wait--;
    return draw->unlit->wait == 0;
}

static enum hg_status declare_sample(struct hg_batch *f, struct hg_error *err)
{
    struct hg_draw *draw = f->draw;
    const bool only_behind = hg_draw_is(draw, HG_DRAW_BEHIND),
               blend = has_blend(draw) || only_behind;
    const bool seen_through = only_behind || (blend && hg_frame_transmits(draw));
    declare_visibility(f);
    declare_probe_light(f);
    if (seen_through) {
        const enum hg_status status =
            hg_draw_make_image(draw, HG_COLOR_FORMAT, "scene behind", &draw->targets->behind, err);
        if (status != HG_OK)
            return status;
        f->behind = hg_graph_import(f->graph, "scene behind", &draw->targets->behind);
        hg_graph_want(f->graph, f->behind);
    }
    if (seen_through && (only_behind || !draw->accumulation->behind.there))
        declare_behind(f);
    if (seen_through)
        hg_batch_declare_glass(f);
    if (only_behind)
        return HG_OK;
    if (blend)
        hg_batch_declare_blend(f);
    hg_batch_declare_motion(f);
    draw->unlit->found = f->unlit.skips = finds_unlit(draw, &f->pass);
    if (f->unlit.skips)
        declare_unlit(f);
    if (hg_draw_is(draw, HG_DRAW_CHECKERBOARD))
        declare_checkerboard(f);
    hg_batch_declare_blocks(f);
    if (hg_draw_is(draw, HG_DRAW_DIRECT))
        f->picture = hg_graph_import(f->graph, "picture", hg_draw_picture(draw));
    else
        f->accumulated = hg_graph_import(f->graph, "accumulated", &draw->targets->accumulated);
    declare_shading(f, f->pass.find);
    return HG_OK;
}

// What the host draws of a sample; the frame block is that of the sample.
static enum hg_status draw_hosted(const struct hg_batch *f, struct hg_error *err)
{
    struct hg_draw *draw = f->draw;
    if (!hg_culling_set(draw->culling, 0)->hosted)
        return HG_OK;
    const uint64_t start = hg_clock_now_ns();
    const struct hg_culling_lens lens = hg_frame_lens(&draw->frame->camera, hg_frame_size(draw));
    const struct hg_culling_sample sample = {&lens, f->slot, f->slots};
    const enum hg_status status =
        hg_culling_draw_cpu(draw->culling, &sample, draw->context->jobs, err);
    hg_view_stats_add_stage(draw->stats, "host raster", hg_clock_now_ns() - start);
    return status;
}

static enum hg_status record_samples(
    struct hg_batch *f, struct hg_gpu_cmd *cmd, uint32_t first, struct hg_error *err)
{
    enum hg_status status = hg_graph_compile(f->graph, err);
    for (uint32_t i = 0; i < f->slots && status == HG_OK; i++) {
        f->sample = first + i;
        f->slot = i;
        hg_frame_fill(f->draw, f->sample, true, i);
        f->pass = hg_frame_pass(f->draw, cmd, i);
        status = draw_hosted(f, err);
        if (status == HG_OK)
            status = hg_graph_execute(f->graph, cmd, f, i, err);
    }
    return status;
}

// A debug view takes one sample through the pixels' centres and needs no light.
static enum hg_status record_debug(
    struct hg_draw *draw, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    struct hg_batch f;
    hg_frame_fill(draw, 0, false, 0);
    enum hg_status status = begin(&f, draw, cmd, err);
    if (status != HG_OK)
        return status;
    declare_geometry(&f);
    declare_debug(&f);
    return run(&f, cmd, err);
}

enum hg_status hg_frame_record(
    struct hg_draw *draw, struct hg_gpu_cmd *cmd, uint32_t samples, struct hg_error *err)
{
    struct hg_batch f;
    const uint32_t first = hg_draw_first_sample(draw);
    if (draw->request->settings->debug != 0 && !hg_draw_is(draw, HG_DRAW_DIRECT))
        return record_debug(draw, cmd, err);
    enum hg_status status = hg_batch_reserve_blend(draw, err);
    if (status == HG_OK)
        status = hg_batch_reserve_motion(draw, err);
    if (status == HG_OK)
        status = hg_batch_reserve_reflections(draw, err);
    if (status == HG_OK)
        status = hg_batch_reserve_glass(draw, err);
    if (status != HG_OK)
        return status;
    hg_frame_fill(draw, first, true, 0);
    status = begin(&f, draw, cmd, err);
    if (status != HG_OK)
        return status;
    f.slots = samples;
    declare_geometry(&f);
    declare_shadows(&f, 1);
    status = declare_sample(&f, err);
    return status == HG_OK ? record_samples(&f, cmd, first, err) : status;
}

enum hg_status hg_frame_record_shadows(
    struct hg_draw *draw, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    struct hg_batch f;
    hg_frame_fill(draw, draw->accumulation->samples, true, 0); // where the geometry is
    const enum hg_status status = begin(&f, draw, cmd, err);
    if (status != HG_OK)
        return status;
    declare_geometry(&f);
    declare_shadows(&f, 0);
    return run(&f, cmd, err);
}

// Opaque surfaces with the texture pages that the camera requests; those of casters are few.
enum hg_status hg_frame_record_prefetch(
    struct hg_draw *draw, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    struct hg_batch f;
    hg_frame_fill(draw, 0, true, 0);
    enum hg_status status = hg_frame_cull_prefetch(draw, err);
    if (status == HG_OK)
        status = begin(&f, draw, cmd, err);
    if (status != HG_OK)
        return status;
    f.alone = true;
    f.accumulated = hg_graph_import(f.graph, "accumulated", &draw->targets->accumulated);
    declare_visibility(&f);
    declare_shading(&f, true);
    return run(&f, cmd, err);
}

// --- reading and picking -------------------------------------------------------------------------

struct read {
    struct hg_draw *draw;
    uint32_t accumulated, fallback, pixels;
    uint32_t shown; // what becomes the picture
};

static enum hg_status record_resolve(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    const struct read *r = user;
    const struct hg_draw *draw = r->draw;
    struct hg_pass pass = {.gpu = run->gpu, .cmd = run->cmd};
    const struct hg_view_settings *settings = draw->request->settings;
    const bool sums = draw->accumulation->samples > 0 && settings->mode != HG_VIEW_MODE_PATH;
    const struct hg_resolve resolve = {.accumulated = hg_graph_run_image(run, r->accumulated),
        .target = hg_graph_run_image(run, r->pixels),
        .samples = sums ? draw->accumulation->samples : 1,
        .progress = draw->accumulation->uneven ? draw->accumulation->progress.address : 0,
        .fallback = r->fallback > 0 ? hg_graph_run_image(run, r->fallback) : NULL,
        .blocks = sums && draw->blocks != NULL ? draw->blocks->buffer.address : 0,
        .block_columns = draw->blocks != NULL ? draw->blocks->columns : 0,
        .exposure = settings->exposure,
        .tonemap = settings->tonemap,
        .backdrop =
            settings->background == HG_BACKGROUND_MODE_DISPLAY ? settings->background_color : NULL};
    return hg_resolve_record(&pass, &resolve, err);
}

static enum hg_status record_copy(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    const struct read *r = user;
    struct hg_gpu_image *shown = hg_graph_run_image(run, r->shown);
    const struct hg_gpu_region all = {.width = shown->width, .height = shown->height};
    (void)err;
    hg_gpu_image_read(run->cmd, shown, &all, &r->draw->buffers->readback.buffer, 0);
    return HG_OK;
}

enum hg_status hg_frame_record_read(
    struct hg_draw *draw, struct hg_gpu_cmd *cmd, uint32_t format, struct hg_error *err)
{
    struct hg_batch f;
    const enum hg_status status = open_graph(&f, draw, err);
    if (status != HG_OK)
        return status;
    struct read r = {.draw = draw,
        .accumulated = hg_graph_import(f.graph, "accumulated", &draw->targets->accumulated),
        .pixels = hg_graph_import(f.graph, "pixels", &draw->targets->pixels[format])};
    if (draw->accumulation->has_fallback)
        r.fallback = hg_graph_import(f.graph, "fallback", &draw->accumulation->fallback);
    const uint32_t readback = hg_graph_buffer(f.graph, "readback");
    hg_batch_add(&f, &(struct hg_graph_pass){.name = "resolve",
                         .record = record_resolve,
                         .user = &r,
                         .accesses = {{r.accumulated, HG_GRAPH_SAMPLE, 0},
                             {r.fallback, HG_GRAPH_SAMPLE, 0}, {r.pixels, HG_GRAPH_COLOR, 0}}});
    r.shown = r.pixels;
    hg_batch_add(
        &f, &(struct hg_graph_pass){.name = "copy",
                .record = record_copy,
                .user = &r,
                .accesses = {{r.shown, HG_GRAPH_COPY_FROM, 0}, {readback, HG_GRAPH_WRITE, 0}}});
    hg_graph_want(f.graph, readback);
    return run(&f, cmd, err);
}

static enum hg_status record_pick_visibility(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const struct hg_visibility_scene scene = {f->draw->culling, 0, 0};
    const struct hg_visibility_target target = target_of(run);
    return hg_visibility_record_pick(&f->pass, &scene, &target, *(VkRect2D *)user, err);
}

static enum hg_status record_pick(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const VkRect2D *pixels = user;
    return hg_pick_record(
        &f->pass, hg_graph_run_image(run, f->visibility), *pixels, &f->draw->buffers->pick, err);
}

enum hg_status hg_frame_record_pick(
    struct hg_draw *draw, struct hg_gpu_cmd *cmd, VkRect2D pixels, struct hg_error *err)
{
    struct hg_batch f;
    hg_frame_fill(draw, 0, false, 0);
    const enum hg_status status = begin(&f, draw, cmd, err);
    if (status != HG_OK)
        return status;
    const uint32_t result = hg_graph_buffer(f.graph, "pick");
    hg_batch_add(
        &f, &(struct hg_graph_pass){.name = "pick visibility",
                .record = record_pick_visibility,
                .user = &pixels,
                .accesses = {{f.visibility, HG_GRAPH_COLOR, 0}, {f.depth, HG_GRAPH_DEPTH, 0}}});
    hg_batch_add(
        &f, &(struct hg_graph_pass){.name = "pick",
                .record = record_pick,
                .user = &pixels,
                .accesses = {{f.visibility, HG_GRAPH_SAMPLE, 0}, {result, HG_GRAPH_WRITE, 0}}});
    hg_graph_want(f.graph, result);
    return run(&f, cmd, err);
}
