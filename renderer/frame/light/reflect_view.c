// reflect_view.c - see reflect_view.h.
#include "renderer/frame/light/reflect_view.h"

#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/hash.h"
#include "base/log.h"
#include "renderer/frame/batch/recording.h"
#include "renderer/frame/light/gi_view.h"
#include "renderer/frame/quality/governor.h"
#include "renderer/passes/probe_light.h"
#include "shaders/shared/gi.h"

#define LIGHT_BYTES  16u
#define MIRROR_BYTES 8u
#define LAMPS_ENOUGH 8 // times that what is lit by one light of many is lit

void hg_reflect_view_finish(struct hg_gpu *gpu, struct hg_reflect_view *r)
{
    hg_reflect_destroy(r->reflect);
    hg_gpu_image_destroy(gpu, &r->light);
    hg_gpu_buffer_destroy(gpu, &r->back);
    hg_free(r->words);
    *r = (struct hg_reflect_view){0};
}

// --- before --------------------------------------------------------------------------------------

static bool chooses_lights(const struct hg_lighting_sources *s)
{
    const uint32_t suns = s->directional_count < 2 ? s->directional_count : 2;
    bool sized = false;
    for (uint32_t i = 0; i < s->count; i++)
        sized |= s->lights[i].radiance > 0;
    return s->count > suns + 1 || sized;
}

// Revision of the scene and its lights.
static uint64_t light_of(const struct hg_view_state *view)
{
    const struct hg_scene_gpu *s = view->scene_gpu;
    const uint64_t light = hg_hash_mix(s->scene->revision, s->scene->environment.revision);
    return hg_hash_mix(light, s->geometry_revision);
}

static enum hg_status sync_cache(struct hg_view_state *view)
{
    struct hg_scene_gpu *s = view->scene_gpu;
    struct hg_reflect_view *r = &view->motion.reflections;
    const uint64_t field = hg_hash_mix(view->gi.field, r->world.rounds);
    struct hg_cache_key key = {.light = hg_hash_mix(light_of(view), field),
        .side = view->context->overrides.cache_side > 0 ? view->context->overrides.cache_side
                                                        : HG_CACHE_SIDE,
        .lit_enough = chooses_lights(&r->sources) ? LAMPS_ENOUGH : 1,
        .budget_bytes = view->context->geometry_budget_bytes};
    hg_geometry_origin(s->geometry, key.origin);
    enum hg_status status = HG_OK;
    if (!s->radiance)
        status = hg_radiance_cache_create(&s->radiance);
    return status == HG_OK ? hg_radiance_cache_sync(s->radiance, &key, r->world.whole) : status;
}

// Without room or memory for it surfaces have the light of probes.
static bool make_irradiance(struct hg_view_state *view)
{
    struct hg_scene_gpu *s = view->scene_gpu;
    const uint64_t budget = view->context->geometry_budget_bytes;
    struct hg_error err = {0};
    if (view->context->overrides.no_irradiance_rays ||
        (budget > 0 && hg_irradiance_bytes() > budget))
        return false;
    return s->irradiance != NULL || hg_irradiance_create(view->context->gpu, view->context->jobs,
                                        &s->irradiance, &err) == HG_OK;
}

// Without memory surfaces mirror what the field says.
static enum hg_status go_without(
    struct hg_reflect_view *r, enum hg_status status, struct hg_error *err)
{
    r->world = (struct hg_gi_world){0};
    if (status != HG_E_LIMIT && status != HG_E_NOMEM && status != HG_E_UNSUPPORTED)
        return status;
    hg_debug(FRAME, "no reflections: %s: %s", err->what, err->reason);
    *err = (struct hg_error){0};
    return HG_OK;
}

enum hg_status hg_reflect_view_step(struct hg_view_state *view, bool moves, struct hg_error *err)
{
    struct hg_reflect_view *r = &view->motion.reflections;
    r->world = (struct hg_gi_world){0};
    if (!moves || view->gi.field == HG_GI_NO_FIELD ||
        view->settings.reflections == HG_VIEW_REFLECTIONS_ENVIRONMENT)
        return HG_OK;
    enum hg_status status =
        hg_gi_world(view->scene_gpu->gi, view->gi.field, hg_gi_view_id(view), &r->world, err);
    if (status != HG_OK)
        return go_without(r, status, err);
    if (r->world.caster == NULL)
        return HG_OK;
    hg_lighting_sources(view->lighting, &r->sources);
    r->share = hg_governor_choice(view).rays;
    r->light_of = light_of(view);
    r->gathers =
        (view->settings.gi == HG_VIEW_GI_RAYS || !view->context->overrides.reflect_dense) &&
        make_irradiance(view);
    // Without a cache all that rays meet is shaded.
    r->caches =
        view->settings.reflections == HG_VIEW_REFLECTIONS_CACHE && sync_cache(view) == HG_OK;
    return HG_OK;
}

bool hg_reflect_view_is_on(const struct hg_draw *draw)
{
    return draw->reflections->world.caster != NULL && hg_draw_is(draw, HG_DRAW_DIRECT);
}

// --- in the middle of a picture ------------------------------------------------------------------

static VkExtent2D texels_of(const struct hg_draw *draw)
{
    const VkExtent2D size = hg_draw_size(draw->request);
    return (VkExtent2D){(size.width + HG_PROBE_LIGHT_PX - 1) / HG_PROBE_LIGHT_PX,
        (size.height + HG_PROBE_LIGHT_PX - 1) / HG_PROBE_LIGHT_PX};
}

enum hg_status hg_batch_reserve_reflections(struct hg_draw *draw, struct hg_error *err)
{
    struct hg_reflect_view *r = draw->reflections;
    struct hg_gpu *gpu = draw->context->gpu;
    const VkExtent2D size = texels_of(draw);
    const uint64_t count = (uint64_t)size.width * size.height;
    if (!hg_reflect_view_is_on(draw))
        return HG_OK;
    const bool same = r->light.width == size.width && r->light.height == size.height;
    enum hg_status status = hg_gpu_buffer_reserve(gpu, HG_GPU_BUFFER_READBACK,
        count * (LIGHT_BYTES + MIRROR_BYTES), "probe light", &r->back, err);
    if (status == HG_OK && !same) {
        const struct hg_gpu_image_params params = {.format = HG_PROBE_LIGHT_FORMAT,
            .width = size.width,
            .height = size.height,
            .name = "reflected light"};
        hg_gpu_image_destroy(gpu, &r->light);
        hg_free(r->words);
        r->words = hg_calloc(count, LIGHT_BYTES);
        status = r->words
                     ? hg_gpu_image_create(gpu, &params, &r->light, err)
                     : hg_error_set(err, HG_E_NOMEM, "reflections", NULL, "out of host memory");
    }
    if (status == HG_OK && !r->reflect)
        status = hg_reflect_create(gpu, draw->context->jobs, &r->reflect, err);
    return status == HG_OK ? HG_OK : go_without(r, status, err);
}

// Diffuse light of the same texels.
static enum hg_status gather(struct hg_batch *f, struct hg_error *err)
{
    struct hg_draw *draw = f->draw;
    struct hg_reflect_view *r = draw->reflections;
    const VkExtent2D size = texels_of(draw);
    const uint32_t *back = r->back.mapped;
    uint32_t doublings = 0; // means are not of the first updates of the field for long
    while (r->world.rounds >> doublings > 0)
        doublings++;
    struct hg_irradiance_picture picture = {
        .texels = {&draw->frame->camera, draw->frame->width, draw->frame->height},
        .light = r->light_of,
        .doublings = doublings,
        .looked_up = back,
        .mirrors = back + (size_t)size.width * size.height * (LIGHT_BYTES / 4),
        .sources = &r->sources,
        .world = r->world,
        .share = r->share,
        .diffuse = draw->request->settings->gi == HG_VIEW_GI_RAYS,
        .lobes = !draw->context->overrides.reflect_dense};
    hg_geometry_origin(draw->scene_gpu->geometry, picture.origin);
    return hg_irradiance_run(draw->scene_gpu->irradiance, &picture, r->words, err);
}

static enum hg_status reflect(struct hg_batch *f, struct hg_error *err)
{
    struct hg_draw *draw = f->draw;
    struct hg_reflect_view *r = draw->reflections;
    const VkExtent2D size = texels_of(draw);
    const struct hg_gpu_region all = {.width = size.width, .height = size.height};
    const uint32_t *back = r->back.mapped;
    struct hg_reflect_picture picture = {.camera = &draw->frame->camera,
        .width = draw->frame->width,
        .height = draw->frame->height,
        .light = back,
        .mirrors = back + (size_t)size.width * size.height * (LIGHT_BYTES / 4),
        .sources = &r->sources,
        .world = r->world,
        .cache = r->caches ? draw->scene_gpu->radiance : NULL,
        .continues = r->settings == draw->settings_revision,
        .share = r->share,
        .samples = draw->context->overrides.reflect_samples,
        .dense = draw->context->overrides.reflect_dense};
    hg_geometry_origin(draw->scene_gpu->geometry, picture.origin);
    r->settings = draw->settings_revision;
    enum hg_status status = hg_reflect_run(r->reflect, &picture, r->words, err);
    const bool without = status == HG_E_NOMEM;
    if (without)
        status = go_without(r, status, err);
    else if (status == HG_OK && r->gathers)
        status = gather(f, err);
    return status == HG_OK ? hg_gpu_image_upload(draw->context->gpu, &r->light, &all,
                                 without ? back : r->words, 0, err)
                           : status;
}

static enum hg_status record(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    struct hg_draw *draw = f->draw;
    const struct hg_gpu_buffer *back = &draw->reflections->back;
    const VkExtent2D size = texels_of(draw);
    const struct hg_gpu_region all = {.width = size.width, .height = size.height};
    const uint64_t light_bytes = (uint64_t)size.width * size.height * LIGHT_BYTES;
    (void)user;
    hg_gpu_image_read(run->cmd, hg_graph_run_image(run, f->mirrors.looked_up), &all, back, 0);
    hg_gpu_image_read(
        run->cmd, hg_graph_run_image(run, f->mirrors.surfaces), &all, back, light_bytes);
    enum hg_status status = hg_gpu_pause(run->gpu, run->cmd, err);
    if (status != HG_OK)
        return status;
    hg_view_stats_add_device(draw->stats, run->gpu);
    const uint64_t begin = hg_clock_now_ns();
    struct hg_reflect_stats stats;
    struct hg_irradiance_stats gathered = {0};
    status = reflect(f, err);
    hg_reflect_stats(draw->reflections->reflect, &stats);
    if (draw->reflections->gathers)
        hg_irradiance_stats(draw->scene_gpu->irradiance, &gathered);
    hg_view_stats_add_stage(draw->stats, "irradiance rays", gathered.ns);
    hg_view_stats_add_stage(draw->stats, "reflection rays", stats.ray_ns);
    hg_view_stats_add_stage(
        draw->stats, "reflections", hg_clock_now_ns() - begin - stats.ray_ns - gathered.ns);
    const uint32_t *words = back->mapped;
    if (status == HG_OK)
        status = hg_batch_look_into_mirrors(f, words, words + light_bytes / 4, err);
    return status == HG_OK ? hg_gpu_resume(run->gpu, run->cmd, err) : status;
}

void hg_batch_declare_reflections(struct hg_batch *f)
{
    f->mirrors.looked_up = f->probe_light;
    f->probe_light = hg_graph_import(f->graph, "reflected light", &f->draw->reflections->light);
    hg_batch_add(f, &(struct hg_graph_pass){.name = "reflections",
                        .record = record,
                        .accesses = {{f->mirrors.looked_up, HG_GRAPH_COPY_FROM, 0},
                            {f->mirrors.surfaces, HG_GRAPH_COPY_FROM, 0},
                            {f->probe_light, HG_GRAPH_COPY_TO, 0}},
                        .untimed = true});
}

// --- to see what happens -------------------------------------------------------------------------

void hg_reflect_view_show(struct hg_view_state *view, const struct hg_draw *draw)
{
    static const uint8_t colors[HG_REFLECT_SOURCES][4] = {[HG_REFLECT_NOTHING] = {32, 32, 32, 255},
        [HG_REFLECT_ROUGH] = {96, 32, 128, 255},
        [HG_REFLECT_SKY] = {64, 128, 255, 255},
        [HG_REFLECT_CACHED] = {128, 224, 96, 255},
        [HG_REFLECT_SHADED] = {255, 144, 32, 255},
        [HG_REFLECT_LATE] = {224, 32, 32, 255}};
    const struct hg_view_settings *s = &view->settings;
    const VkExtent2D size = hg_draw_size(draw->request), texels = texels_of(draw);
    uint8_t *pixels = view->buffers.readback.buffer.mapped;
    for (uint32_t y = 0; y < s->height && hg_reflect_view_is_on(draw); y++)
        for (uint32_t x = 0; x < s->width; x++, pixels += 4) {
            const uint32_t column = x * size.width / s->width / HG_PROBE_LIGHT_PX;
            const uint32_t row = y * size.height / s->height / HG_PROBE_LIGHT_PX;
            memcpy(pixels,
                colors[hg_reflect_sources(
                    view->motion.reflections.reflect)[row * texels.width + column]],
                4);
        }
}
