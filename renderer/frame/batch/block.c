// block.c - the frame block of one sample, tables and feature bits. See batch.h.
#include <math.h>
#include <string.h>

#include "renderer/frame/batch/batch.h"
#include "shaders/shared/features.h"

// Pictures in motion of a view at rest: what a pixel shows is made of several of them, so that each
// is filtered over its share of it.
#define STILL_MIPS 1.0f

_Static_assert(sizeof(struct hg_gpu_frame) <= HG_FRAME_BLOCK_BYTES, "frame block");
_Static_assert(sizeof(struct hg_gpu_history) <= HG_FRAME_HISTORY_BYTES, "history");

VkExtent2D hg_frame_size(const struct hg_draw *draw)
{
    const uint32_t less = draw->request->smaller > 0 ? draw->request->smaller : 1;
    const float wider = draw->request->wider > 0.0f ? draw->request->wider : 1.0f;
    const VkExtent2D whole = hg_draw_size(draw->request);
    const uint32_t width = (uint32_t)((float)whole.width * wider) / less;
    const uint32_t height = (uint32_t)((float)whole.height * wider) / less;
    return (VkExtent2D){width > 0 ? width : 1, height > 0 ? height : 1};
}

struct hg_camera_setup hg_frame_setup(const struct hg_draw *draw)
{
    const struct hg_view_settings *s = draw->request->settings;
    const VkExtent2D size = hg_frame_size(draw);
    struct hg_camera_setup setup =
        hg_scene_gpu_camera(draw->scene_gpu, draw->request->camera, size.width, size.height);
    if (draw->request->drawn.width > 0) // the sides of whole pixels are not in that ratio
        setup.aspect = (double)s->width / (double)s->height;
    return setup;
}

float hg_frame_scale(const struct hg_draw *draw)
{
    return (float)hg_draw_size(draw->request).height / (float)draw->request->settings->height;
}

static void fill_textures(struct hg_draw *draw, struct hg_gpu_textures *out)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    const uint32_t mode = hg_draw_is(draw, HG_DRAW_EXACT) ? HG_TEXTURES_EXACT : HG_TEXTURES_SHOW;
    hg_textures_fill(draw->scene_gpu->textures, mode, out);
    s->pages.run = s->pages.run % HG_PROGRESS_RUNS + 1;
    if (draw->request->smaller > 0) // a smaller picture with the texels of the whole one
        out->bias -= log2f((float)draw->request->smaller);
    if (draw->request->drawn.width > 0)
        out->bias += log2f(hg_frame_scale(draw));
    if (hg_draw_is(draw, HG_DRAW_STILL) && hg_draw_is(draw, HG_DRAW_MOTION))
        out->bias -= STILL_MIPS;
    out->mode = mode;
    out->run = s->pages.run;
    out->progress = hg_draw_is(draw, HG_DRAW_BEHIND)  ? s->behind.progress.address
                    : hg_draw_is(draw, HG_DRAW_EXACT) ? s->progress.address
                                                      : out->feedback; // read in no other mode
}

// A texel of mip l is pi / height * 2^l high.
static void fill_background(const struct hg_draw *draw, struct hg_gpu_frame *f)
{
    const struct hg_gpu_texture background = hg_textures_background(draw->scene_gpu->textures);
    const struct hg_environment *env = &draw->scene_gpu->scene->environment;
    if (env->kind != HG_ENV_IMAGE || background.bits == 0)
        return;
    const uint32_t height =
        (background.size >> 16 | (background.bits & HG_TEX_HEIGHT_17 ? 0x10000u : 0)) + 1;
    const float angle = f->camera.orthographic != 0 ? 0.0f : f->camera.pixel_angle;
    f->textures.background = background;
    f->textures.background_lod = log2f(fmaxf(angle * (float)height / (float)M_PI, 1e-20f));
}

static void fill_ground(const struct hg_draw *draw, struct hg_gpu_frame *f)
{
    float up[3], height;
    if (!hg_draw_ground(draw, up, &height))
        return;
    f->ground_up = (struct hg_vec3){up[0], up[1], up[2]};
    f->ground_height = height;
}

// The view's LOD error in metres: pixels per metre are half the height times the second diagonal
// element of the projection, divided by depth in perspective.
static void fill_slack(const struct hg_draw *draw, struct hg_gpu_lighting *lighting)
{
    const struct hg_gpu_camera *camera = &draw->frame->camera;
    if (!hg_geometry_is_simplified(draw->scene_gpu->geometry))
        return;
    const float px_scale = 0.5f * (float)draw->request->settings->height * fabsf(camera->proj.m[5]);
    const float error_px = hg_culling_count(draw->culling) > 0
                               ? hg_culling_set(draw->culling, 0)->error_px
                               : draw->request->settings->error_px;
    const float slack = error_px / px_scale;
    *(camera->orthographic != 0 ? &lighting->shadow_slack_m : &lighting->shadow_slack_per_m) =
        slack;
}

// Planes relative to the geometry's origin, and the tables that the view has of its own.
static void fill_look(const struct hg_draw *draw, struct hg_gpu_frame *f)
{
    const struct hg_look *look = draw->request->settings->look;
    double origin[3];
    if (look == NULL)
        return;
    hg_view_tables_fill(&look->tables, &f->geometry);
    hg_geometry_origin(draw->scene_gpu->geometry, origin);
    f->clip_count = look->clip.count;
    for (uint32_t i = 0; i < look->clip.count; i++) {
        const float *p = look->clip.planes[i];
        const double at = (double)p[0] * origin[0] + (double)p[1] * origin[1] +
                          (double)p[2] * origin[2] - (double)p[3];
        f->clip_planes[i] = (struct hg_vec4){p[0], p[1], p[2], (float)at};
    }
}

// Views share shadow maps, so these are drawn with the scene's draws and materials, whatever the
// view shows: in a block of their own behind those of samples.
#define CASTERS_SLOT HG_VIEW_MAX_SAMPLES_PER_STEP

static void fill_casters(struct hg_draw *draw)
{
    struct hg_gpu_frame casters = *draw->frame;
    hg_geometry_fill(draw->scene_gpu->geometry, &casters.geometry);
    memcpy((uint8_t *)draw->buffers->blocks.mapped + CASTERS_SLOT * HG_FRAME_SLOT_BYTES, &casters,
        sizeof casters);
}

void hg_frame_fill(struct hg_draw *draw, uint32_t sample, bool jitter, uint32_t slot)
{
    struct hg_gpu_frame *f = draw->frame;
    const struct hg_view_settings *s = draw->request->settings;
    struct hg_camera_setup setup = hg_frame_setup(draw);
    memset(f, 0, sizeof *f);
    if (jitter)
        hg_camera_jitter(sample, s->seed, setup.jitter_px);
    if (draw->request->moment > 0) {
        sample = draw->request->moment;
        memcpy(setup.jitter_px, draw->request->jitter_px, sizeof setup.jitter_px);
    }
    hg_camera_fill(&setup, &f->camera);
    f->width = setup.width;
    f->height = setup.height;
    f->inv_size = (struct hg_vec2){1.0f / (float)setup.width, 1.0f / (float)setup.height};
    f->jitter_px = (struct hg_vec2){setup.jitter_px[0], setup.jitter_px[1]};
    f->sample_index = sample;
    f->sample_count = draw->blocks != NULL && sample < draw->blocks->least
                          ? draw->blocks->least // the first ones make up a picture of their own
                          : draw->request->samples;
    f->seed = s->seed;
    f->background_mode = s->background;
    f->background_color =
        (struct hg_vec3){s->background_color[0], s->background_color[1], s->background_color[2]};
    f->exposure = s->exposure;
    f->tonemap = s->tonemap;
    f->flags = hg_draw_is(draw, HG_DRAW_COARSE_SHADOWS) ? HG_FRAME_COARSE_SHADOWS : 0;
    f->flags |=
        draw->gathered != NULL && hg_lighting_has_sky_sun(draw->lighting) ? HG_FRAME_SUN_DISC : 0;
    f->flags |= hg_draw_is(draw, HG_DRAW_CHECKERBOARD) ? HG_FRAME_CHECKERBOARD : 0;
    f->flags |= draw->request->moment > 0 ? HG_FRAME_MOTION : 0;
    f->flags |= s->ao != HG_VIEW_AO_NONE ? HG_FRAME_OCCLUSION : 0;
    f->flags |= draw->gathered != NULL ? HG_FRAME_FINE : 0;
    hg_lighting_fill(draw->lighting, sample, &f->lighting);
    f->lighting.cluster_scale_x *= (float)s->width / (float)hg_draw_size(draw->request).width;
    f->lighting.cluster_scale_y *= (float)s->height / (float)hg_draw_size(draw->request).height;
    fill_slack(draw, &f->lighting);
    fill_textures(draw, &f->textures);
    fill_background(draw, f);
    fill_ground(draw, f);
    hg_geometry_fill(draw->scene_gpu->geometry, &f->geometry);
    fill_look(draw, f);
    hg_gi_fill(draw->scene_gpu->gi, draw->probes.kind, draw->probes.view, &f->probes);
    const struct hg_blend_lists *lists = &draw->blend->lists;
    f->blend = (struct hg_gpu_blend_lists){.heads = lists->heads.address,
        .nodes = lists->nodes.address,
        .capacity = (uint32_t)(lists->nodes.size_bytes / sizeof(struct hg_gpu_blend_node))};
    uint8_t *to = (uint8_t *)draw->buffers->blocks.mapped + (size_t)slot * HG_FRAME_SLOT_BYTES;
    memcpy(to, f, sizeof *f);
    if (s->look != NULL)
        fill_casters(draw);
    if (draw->history->wanted) {
        struct hg_gpu_history history;
        hg_frame_history_fill(draw, &history);
        memcpy(to + HG_FRAME_BLOCK_BYTES, &history, sizeof history);
    }
}

// Path kernels use the whole picture, and no shadow maps.
static struct hg_draw_request request_of_path(const struct hg_view_state *view)
{
    const struct hg_view_settings *metering = view->exposure.metering;
    const struct hg_view_settings *s = metering != NULL ? metering : &view->settings;
    return (struct hg_draw_request){.settings = s,
        .camera = &view->camera,
        .samples = s->samples,
        .max_samples = 1,
        .error_px = s->error_px};
}

void hg_frame_fill_path(struct hg_view_state *view)
{
    const struct hg_draw_request request = request_of_path(view);
    struct hg_draw draw = hg_view_draw(view, &request);
    draw.blocks = NULL;
    hg_frame_fill(&draw, 0, false, 0);
    struct hg_gpu_frame *f = draw.frame;
    hg_textures_fill(draw.scene_gpu->textures, HG_TEXTURES_EXACT, &f->textures);
    f->textures.mode = HG_TEXTURES_EXACT;
    fill_background(&draw, f);
    memcpy(draw.buffers->blocks.mapped, f, sizeof *f);
}

// --- the pass ------------------------------------------------------------------------------------

static void bind_table(struct hg_pass *pass, uint32_t binding, VkDeviceAddress address,
    uint64_t count, uint64_t element_bytes)
{
    const struct hg_gpu_uniform table = {address, count * element_bytes};
    if (!hg_gpu_can_bind_uniform(pass->gpu, &table))
        return;
    pass->bindings.uniforms[binding - HG_BIND_UNIFORM_FIRST] = table;
    pass->tables |= HG_TABLE_BIT(binding);
}

// The frame block, and on CPU devices every table that fits a uniform block.
static void bind_tables(struct hg_draw *draw, uint32_t slot, struct hg_pass *pass)
{
    const struct hg_gpu_frame *f = draw->frame;
    const VkDeviceAddress block =
        draw->buffers->blocks.address + (uint64_t)slot * HG_FRAME_SLOT_BYTES;
    struct hg_gpu_uniform *uniforms = pass->bindings.uniforms;
    uniforms[0] = (struct hg_gpu_uniform){block, HG_FRAME_BLOCK_BYTES};
    if (draw->history->wanted)
        uniforms[HG_BIND_HISTORY - HG_BIND_UNIFORM_FIRST] =
            (struct hg_gpu_uniform){block + HG_FRAME_BLOCK_BYTES, HG_FRAME_HISTORY_BYTES};
    if (!hg_gpu_strategy(pass->gpu)->uniform_tables)
        return;
    struct hg_page_cache_stats textures;
    hg_page_cache_stats(hg_textures_cache(draw->scene_gpu->textures), &textures);
    const struct hg_gpu_geometry *g = &f->geometry;
    const struct hg_gpu_lighting *l = &f->lighting;
    const uint32_t pitch = HG_IRRADIANCE_SIZE + 2;
    bind_table(pass, HG_BIND_DRAWS, g->draws, g->draw_count, sizeof(struct hg_gpu_draw));
    bind_table(
        pass, HG_BIND_INSTANCES, g->instances, g->instance_count, sizeof(struct hg_gpu_instance));
    bind_table(pass, HG_BIND_PARTS, g->parts, g->part_count, sizeof(struct hg_gpu_part));
    bind_table(
        pass, HG_BIND_MATERIALS, g->materials, g->material_count, sizeof(struct hg_gpu_material));
    bind_table(pass, HG_BIND_PAGE_TABLE, f->textures.table, textures.table_bytes, 1);
    bind_table(pass, HG_BIND_LIGHTS, l->lights, l->light_count, sizeof(struct hg_gpu_light));
    bind_table(pass, HG_BIND_SHADOWS, l->shadows,
        (uint32_t)hg_lighting_shadow_table_bytes(draw->lighting), 1);
    bind_table(pass, HG_BIND_DFG_TABLE, l->dfg, HG_DFG_BLOCK_WORDS, 4);
    bind_table(pass, HG_BIND_IRRADIANCE, l->irradiance, pitch * pitch, 16);
    struct hg_gpu_uniform first;
    if (hg_geometry_triangle_cache(draw->scene_gpu->geometry, &first, &pass->bindings.texels))
        bind_table(pass, HG_BIND_TRIANGLE_CACHE, first.address, first.size_bytes, 1);
}

// Features that the scene and its lights use. Devices with cheap branches get one pipeline for all.
// streams: pages may be missing.
static uint32_t features_of(const struct hg_draw *draw, uint32_t tables, bool streams)
{
    const uint32_t sampled =
        HG_FEATURE_TEXTURES | HG_FEATURE_OCCLUSION | HG_FEATURE_EMISSIVE | HG_FEATURE_LOBE_TEXTURES;
    const struct hg_gpu_lighting *l = &draw->frame->lighting;
    uint32_t features = draw->scene_gpu->features;
    struct hg_lighting_stats stats;
    hg_lighting_stats(draw->lighting, &stats);
    if (!hg_gpu_strategy(draw->context->gpu)->uniform_tables) {
        // A table that is not there is not read.
        const uint32_t absent = (sampled | HG_FEATURE_LOBES) & ~features;
        return HG_FEATURE_ALL & ~absent;
    }
    features |= streams ? HG_FEATURE_STREAM : 0;
    features |= draw->frame->textures.pool_scale > 1.0f ? HG_FEATURE_SMALL_LAYERS : 0;
    features |= hg_geometry_has_levels(draw->scene_gpu->geometry) ? HG_FEATURE_LOD : 0;
    features |= l->light_count > 0 ? HG_FEATURE_LIGHTS : 0;
    features |= l->clustered != 0 ? HG_FEATURE_CLUSTERS : 0;
    features |= stats.local_lights > 0 ? HG_FEATURE_LOCAL : 0;
    const bool one_sun = l->light_count == 1 && stats.local_lights == 0 &&
                         stats.sized_lights == 0 && stats.tabled_lights == 0;
    features |= !one_sun ? HG_FEATURE_NO_SUN : 0;
    features |= !hg_draw_is(draw, HG_DRAW_COARSE_SHADOWS) ? HG_FEATURE_REST : 0;
    features |= stats.shadow_maps > 0 ? HG_FEATURE_SHADOWS : 0;
    features |=
        (tables & HG_TABLE_BIT(HG_BIND_TRIANGLE_CACHE)) == 0 ? HG_FEATURE_NO_TRIANGLE_CACHE : 0;
    const uint32_t apart = HG_FEATURE_SAMPLERS | HG_FEATURE_FLOAT;
    if ((features & apart) != 0 || !hg_geometry_one_shape(draw->scene_gpu->geometry))
        features |= HG_FEATURE_SHAPES;
    return features;
}

static uint32_t mixes_of(const struct hg_draw *draw, uint32_t features)
{
    if ((features & HG_FEATURE_LOBES) == 0)
        return 0;
    if (hg_gpu_strategy(draw->context->gpu)->uniform_tables)
        return draw->scene_gpu->mixes;
    return HG_MIX_ALL & ~((features & HG_FEATURE_TRANSMISSION) == 0 ? HG_MIX_OF_GLASS : 0u);
}

static uint32_t background_features(const struct hg_draw *draw)
{
    const bool pages = draw->frame->textures.background.bits != 0;
    if (!hg_gpu_strategy(draw->context->gpu)->exact_pipelines)
        return HG_FEATURE_SKY_PAGES | HG_FEATURE_SKY_PLAIN | HG_FEATURE_SKY_MIPS;
    const struct hg_gpu_textures *t = &draw->frame->textures;
    const bool mips = t->background_lod + t->bias > 0.0f;
    return !pages ? HG_FEATURE_SKY_PLAIN : HG_FEATURE_SKY_PAGES | (mips ? HG_FEATURE_SKY_MIPS : 0);
}

static struct hg_pass make_pass(
    struct hg_draw *draw, struct hg_gpu_cmd *cmd, uint32_t slot, bool streams)
{
    struct hg_pass pass = {.gpu = draw->context->gpu, .cmd = cmd, .jobs = draw->context->jobs};
    struct hg_gpu_image **images = pass.bindings.images;
    images[HG_BIND_PAGES_SRGB] = hg_textures_pool(draw->scene_gpu->textures, HG_POOL_SRGB);
    images[HG_BIND_PAGES_LINEAR] = hg_textures_pool(draw->scene_gpu->textures, HG_POOL_LINEAR);
    images[HG_BIND_PAGES_FLOAT] = hg_textures_pool(draw->scene_gpu->textures, HG_POOL_FLOAT);
    images[HG_BIND_ENV_SPECULAR] = hg_lighting_image_specular(draw->lighting);
    images[HG_BIND_ENV_RADIANCE] = hg_lighting_image_radiance(draw->lighting);
    images[HG_BIND_SHADOW] = hg_lighting_image_shadow(draw->lighting);
    bind_tables(draw, slot, &pass);
    pass.features = features_of(draw, pass.tables, streams);
    pass.features2 = mixes_of(draw, pass.features);
    struct hg_gpu_probes probes;
    hg_gi_fill(draw->scene_gpu->gi, draw->probes.kind, draw->probes.view, &probes);
    pass.features2 |= probes.count > 0 ? HG_FEATURE2_PROBES : 0;
    struct hg_lighting_stats lights;
    hg_lighting_stats(draw->lighting, &lights);
    pass.features2 |= lights.sized_lights > 0 ? HG_FEATURE2_SIZED : 0;
    pass.features2 |= lights.tabled_lights > 0 ? HG_FEATURE2_LIGHT_TABLES : 0;
    pass.features2 |= hg_lighting_has_pages(draw->lighting) ? HG_FEATURE2_SHADOW_PAGES : 0;
    pass.features2 |= draw->request->settings->ground != 0 ? HG_FEATURE2_GROUND : 0;
    pass.clips = hg_look_clips(draw->request->settings->look);
    pass.background = background_features(draw);
    pass.find = draw->request->smaller > 0;
    if (pass.find)
        pass.area.extent = hg_frame_size(draw);
    else if (hg_draw_area(draw) != NULL)
        pass.area = hg_draw_area(draw)->rect;
    return pass;
}

struct hg_pass hg_frame_pass(struct hg_draw *draw, struct hg_gpu_cmd *cmd, uint32_t slot)
{
    return make_pass(draw, cmd, slot, draw->accumulation->pages.on);
}

void hg_frame_pass_use_scene(const struct hg_draw *draw, struct hg_pass *pass)
{
    if (draw->request->settings->look == NULL)
        return;
    struct hg_gpu_geometry g;
    hg_geometry_fill(draw->scene_gpu->geometry, &g);
    pass->bindings.uniforms[0].address =
        draw->buffers->blocks.address + CASTERS_SLOT * HG_FRAME_SLOT_BYTES;
    pass->tables &= ~(HG_TABLE_BIT(HG_BIND_DRAWS) | HG_TABLE_BIT(HG_BIND_MATERIALS));
    if (!hg_gpu_strategy(pass->gpu)->uniform_tables)
        return;
    bind_table(pass, HG_BIND_DRAWS, g.draws, g.draw_count, sizeof(struct hg_gpu_draw));
    bind_table(
        pass, HG_BIND_MATERIALS, g.materials, g.material_count, sizeof(struct hg_gpu_material));
}

struct hg_pass hg_frame_pass_path(struct hg_view_state *view, struct hg_gpu_cmd *cmd, bool streams)
{
    const struct hg_draw_request request = request_of_path(view);
    struct hg_draw draw = hg_view_draw(view, &request);
    return make_pass(&draw, cmd, 0, streams);
}
