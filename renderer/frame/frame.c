// frame.c - the order of one batch: bring the device in line, then draw samples.
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/cond.h"
#include "base/log.h"
#include "renderer/frame/view.h"
#include "renderer/passes/debug.h"
#include "renderer/passes/facet.h"
#include "renderer/passes/layers.h"
#include "renderer/passes/shade.h"
#include "renderer/passes/shadow.h"
#include "renderer/passes/skin.h"
#include "renderer/passes/visibility.h"
#include "shaders/shared/dark.h"
#include "shaders/shared/debug.h"
#include "shaders/shared/features.h"

#define MARGIN_PX      2.0f               // jitter and rounding
#define BAKE_WAIT_NS   UINT64_C(20000000) // of a step, for levels that are being made
#define MOST_HOSTED_PX 2000000            // of a batch that the host draws, 12 bytes each

_Static_assert(sizeof(struct hg_gpu_frame) <= HG_FRAME_BLOCK_BYTES, "frame block");

// Of the picture that is drawn now: only to find out what is needed, a smaller one does.
static VkExtent2D size_of(const struct hg_view_state *view)
{
    const uint32_t less = view->stream.finding > 0 ? view->stream.finding : 1;
    const float wider = view->stream.wider > 0.0f ? view->stream.wider : 1.0f;
    const uint32_t width = (uint32_t)((float)view->settings.width * wider) / less;
    const uint32_t height = (uint32_t)((float)view->settings.height * wider) / less;
    return (VkExtent2D){width > 0 ? width : 1, height > 0 ? height : 1};
}

static struct hg_camera_setup setup_of(
    const struct hg_view_state *view, const struct hg_view_camera_state *c)
{
    struct hg_camera_setup setup = {.orthographic = c->orthographic,
        .vfov_rad = c->vfov_rad,
        .half_height = c->half_height,
        .near = c->near,
        .far = c->far,
        .width = size_of(view).width,
        .height = size_of(view).height};
    double origin[3];
    float min[3] = {0}, max[3] = {0};
    hg_geometry_origin(view->rooms->geometry, origin);
    for (int i = 0; i < 3; i++) {
        setup.eye[i] = c->eye[i] - origin[i];
        setup.target[i] = c->target[i] - origin[i];
        setup.up[i] = c->up[i];
    }
    const bool has_bounds = hg_geometry_bounds(view->rooms->geometry, min, max);
    hg_camera_fit_depth(&setup, has_bounds, min, max);
    return setup;
}

static struct hg_camera_setup camera_setup(const struct hg_view_state *view)
{
    return setup_of(view, &view->camera);
}

void hg_frame_camera(const struct hg_view_state *view, const struct hg_view_camera_state *camera,
    struct hg_gpu_camera *out)
{
    const struct hg_camera_setup setup = setup_of(view, camera);
    hg_camera_fill(&setup, out);
}

static void fill_textures(struct hg_view_state *view, struct hg_gpu_textures *out)
{
    struct hg_stream *s = &view->stream;
    const uint32_t mode = s->exact ? HG_TEXTURES_EXACT : HG_TEXTURES_SHOW;
    hg_textures_fill(view->rooms->textures, mode, out);
    s->run = s->run % HG_PROGRESS_RUNS + 1;
    if (s->finding > 0) // a smaller picture with the texels of the whole one
        out->bias -= log2f((float)s->finding);
    out->mode = mode;
    out->run = s->run;
    out->progress = s->behind  ? s->behind_progress.address
                    : s->exact ? s->progress.address
                               : out->feedback; // read in no other mode
}

// A texel of mip l is pi / height * 2^l high.
static void fill_background(const struct hg_view_state *view, struct hg_gpu_frame *f)
{
    const struct hg_gpu_texture background = hg_textures_background(view->rooms->textures);
    const struct hg_environment *env = &view->rooms->scene->environment;
    if (env->kind != HG_ENV_IMAGE || background.bits == 0)
        return;
    const uint32_t height =
        (background.size >> 16 | (background.bits & HG_TEX_HEIGHT_17 ? 0x10000u : 0)) + 1;
    const float angle = f->camera.orthographic != 0 ? 0.0f : f->camera.pixel_angle;
    f->textures.background = background;
    f->textures.background_lod = log2f(fmaxf(angle * (float)height / (float)M_PI, 1e-20f));
}

// The error of levels of detail that the view allows, as metres: pixels per metre are half the
// height times the second diagonal element of the projection, over the depth in perspective.
static void fill_slack(const struct hg_view_state *view, struct hg_gpu_lighting *lighting)
{
    const struct hg_gpu_camera *camera = &view->frame.camera;
    if (!hg_geometry_is_simplified(view->rooms->geometry))
        return;
    const float px_scale = 0.5f * (float)view->settings.height * fabsf(camera->proj.m[5]);
    const float error_px = hg_visible_count(view->visible) > 0
                               ? hg_visible_set(view->visible, 0)->error_px
                               : view->settings.error_px;
    const float slack = error_px / px_scale;
    *(camera->orthographic != 0 ? &lighting->shadow_slack_m : &lighting->shadow_slack_per_m) =
        slack;
}

void hg_frame_fill(struct hg_view_state *view, uint32_t sample, bool jitter, uint32_t slot)
{
    struct hg_gpu_frame *f = &view->frame;
    const struct hg_view_settings *s = &view->settings;
    struct hg_camera_setup setup = camera_setup(view);
    memset(f, 0, sizeof *f);
    if (jitter)
        hg_camera_jitter(sample, s->seed, setup.jitter_px);
    hg_camera_fill(&setup, &f->camera);
    f->width = setup.width;
    f->height = setup.height;
    f->inv_size = (struct hg_vec2){1.0f / (float)setup.width, 1.0f / (float)setup.height};
    f->jitter_px = (struct hg_vec2){setup.jitter_px[0], setup.jitter_px[1]};
    f->sample_index = sample;
    f->sample_count = s->samples;
    f->seed = s->seed;
    f->background_mode = s->background;
    f->background_color =
        (struct hg_vec3){s->background_color[0], s->background_color[1], s->background_color[2]};
    f->exposure = s->exposure;
    f->tonemap = s->tonemap;
    f->flags = view->coarse ? HG_FRAME_COARSE_SHADOWS : 0;
    hg_lighting_fill(view->lighting, sample, &f->lighting);
    fill_slack(view, &f->lighting);
    fill_textures(view, &f->textures);
    fill_background(view, f);
    hg_geometry_fill(view->rooms->geometry, &f->geometry);
    memcpy((uint8_t *)view->blocks.mapped + (size_t)slot * HG_FRAME_BLOCK_BYTES, f, sizeof *f);
}

void hg_frame_fill_path(struct hg_view_state *view)
{
    hg_frame_fill(view, 0, false, 0);
    struct hg_gpu_frame *f = &view->frame;
    hg_textures_fill(view->rooms->textures, HG_TEXTURES_EXACT, &f->textures);
    f->textures.mode = HG_TEXTURES_EXACT;
    fill_background(view, f);
    memcpy(view->blocks.mapped, f, sizeof *f);
}

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
static void bind_tables(struct hg_view_state *view, uint32_t slot, struct hg_pass *pass)
{
    const struct hg_gpu_frame *f = &view->frame;
    pass->bindings.uniforms[0] = (struct hg_gpu_uniform){
        view->blocks.address + (uint64_t)slot * HG_FRAME_BLOCK_BYTES, HG_FRAME_BLOCK_BYTES};
    if (!hg_gpu_get_caps(pass->gpu)->is_cpu || view->context->no_tables)
        return;
    struct hg_page_cache_stats textures;
    uint32_t shadows;
    hg_page_cache_stats(hg_textures_cache(view->rooms->textures), &textures);
    hg_lighting_shadow_maps(view->lighting, &shadows);
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
    bind_table(pass, HG_BIND_SHADOWS, l->shadows, shadows, sizeof(struct hg_gpu_shadow));
    bind_table(pass, HG_BIND_DFG_TABLE, l->dfg, HG_DFG_WORDS, 4);
    bind_table(pass, HG_BIND_IRRADIANCE, l->irradiance, pitch * pitch, 16);
    struct hg_gpu_uniform first;
    if (hg_geometry_facets(view->rooms->geometry, &first, &pass->bindings.texels))
        bind_table(pass, HG_BIND_FACETS, first.address, first.size_bytes, 1);
}

// What the scene and its lights make use of. Devices that branch get one pipeline for all.
static uint32_t features_of(const struct hg_view_state *view, uint32_t tables)
{
    const uint32_t sampled =
        HG_FEATURE_TEXTURES | HG_FEATURE_OCCLUSION | HG_FEATURE_EMISSIVE | HG_FEATURE_LOBE_TEXTURES;
    const struct hg_gpu_lighting *l = &view->frame.lighting;
    uint32_t features = view->rooms->features;
    struct hg_lighting_stats stats;
    hg_lighting_stats(view->lighting, &stats);
    if (!hg_gpu_get_caps(view->context->gpu)->is_cpu || view->context->no_tables) {
        // A table that is not there is not read.
        const uint32_t absent = (sampled | HG_FEATURE_LOBES) & ~features;
        return HG_FEATURE_ALL & ~absent;
    }
    features |= view->stream.on ? HG_FEATURE_STREAM : 0;
    features |= view->frame.textures.pool_scale > 1.0f ? HG_FEATURE_SMALL_LAYERS : 0;
    features |= hg_geometry_has_levels(view->rooms->geometry) ? HG_FEATURE_LOD : 0;
    features |= l->light_count > 0 ? HG_FEATURE_LIGHTS : 0;
    features |= l->clustered != 0 ? HG_FEATURE_CLUSTERS : 0;
    features |= stats.local_lights > 0 ? HG_FEATURE_LOCAL : 0;
    features |= l->light_count != 1 || stats.local_lights > 0 ? HG_FEATURE_NO_SUN : 0;
    features |= !view->coarse || view->stream.exact ? HG_FEATURE_REST : 0;
    features |= stats.shadow_maps > 0 ? HG_FEATURE_SHADOWS : 0;
    features |= (tables & HG_TABLE_BIT(HG_BIND_FACETS)) == 0 ? HG_FEATURE_NO_FACETS : 0;
    const uint32_t apart = HG_FEATURE_SAMPLERS | HG_FEATURE_FLOAT;
    if ((features & apart) != 0 || !hg_geometry_one_shape(view->rooms->geometry))
        features |= HG_FEATURE_SHAPES;
    return features;
}

static uint32_t background_features(const struct hg_view_state *view)
{
    const bool pages = view->frame.textures.background.bits != 0;
    if (!hg_gpu_get_caps(view->context->gpu)->is_cpu)
        return HG_FEATURE_SKY_PAGES | HG_FEATURE_SKY_PLAIN | HG_FEATURE_SKY_MIPS;
    const struct hg_gpu_textures *t = &view->frame.textures;
    const bool mips = t->background_lod + t->bias > 0.0f;
    return !pages ? HG_FEATURE_SKY_PLAIN : HG_FEATURE_SKY_PAGES | (mips ? HG_FEATURE_SKY_MIPS : 0);
}

struct hg_pass hg_frame_pass(struct hg_view_state *view, struct hg_gpu_cmd *cmd, uint32_t slot)
{
    struct hg_pass pass = {.gpu = view->context->gpu, .cmd = cmd, .jobs = view->context->jobs};
    struct hg_gpu_image **images = pass.bindings.images;
    images[HG_BIND_PAGES_SRGB] = hg_textures_pool(view->rooms->textures, HG_POOL_SRGB);
    images[HG_BIND_PAGES_LINEAR] = hg_textures_pool(view->rooms->textures, HG_POOL_LINEAR);
    images[HG_BIND_PAGES_FLOAT] = hg_textures_pool(view->rooms->textures, HG_POOL_FLOAT);
    images[HG_BIND_ENV_SPECULAR] = hg_lighting_image_specular(view->lighting);
    images[HG_BIND_ENV_RADIANCE] = hg_lighting_image_radiance(view->lighting);
    images[HG_BIND_SHADOW] = hg_lighting_image_shadow(view->lighting);
    bind_tables(view, slot, &pass);
    pass.features = features_of(view, pass.tables);
    pass.background = background_features(view);
    pass.find = view->stream.finding > 0;
    if (pass.find)
        pass.area.extent = size_of(view);
    else if (hg_stream_area(view) != NULL)
        pass.area = hg_stream_area(view)->rect;
    return pass;
}

// --- sync ----------------------------------------------------------------------------------------

static enum hg_status sync_lighting(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_lighting_view look = {.scene = view->rooms->scene,
        .camera = &view->frame.camera,
        .width = view->settings.width,
        .height = view->settings.height,
        .shape_revision = hg_geometry_shape_revision(view->rooms->geometry)};
    hg_geometry_origin(view->rooms->geometry, look.origin);
    look.has_bounds = hg_geometry_bounds(view->rooms->geometry, look.bounds_min, look.bounds_max);
    return hg_lighting_sync(view->lighting, &look, err);
}

enum hg_status hg_frame_sync(struct hg_view_state *view, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    const uint64_t until_ns = view->wait ? hg_cond_after(BAKE_WAIT_NS) : 0;
    enum hg_status status =
        hg_rooms_sync(view->context, view->rooms, view->camera.eye, until_ns, err);
    if (status != HG_OK)
        return status;
    const bool facets = hg_gpu_get_caps(view->context->gpu)->is_cpu && !view->context->no_tables &&
                        !hg_geometry_has_levels(view->rooms->geometry) &&
                        (view->rooms->features & HG_FEATURE_VERTICES) == 0;
    status = hg_geometry_sync_facets(view->rooms->geometry, facets, err);
    if (status != HG_OK)
        return status;
    const uint64_t middle = hg_clock_now_ns();
    hg_view_add_stage(view, "scene sync", middle - start);
    status = hg_stream_sync(view, err);
    if (status != HG_OK)
        return status;
    const struct hg_camera_setup setup = camera_setup(view);
    hg_camera_fill(&setup, &view->frame.camera);
    status = sync_lighting(view, err);
    hg_view_add_stage(view, "light sync", hg_clock_now_ns() - middle);
    return status;
}

// --- draw ----------------------------------------------------------------------------------------

// Clip space of a part of the image, a few pixels wider so that it holds every jittered sample.
static void narrow(const struct hg_view_state *view, VkRect2D part, float m[16])
{
    const float px[2] = {(float)view->settings.width, (float)view->settings.height};
    const float first[2] = {(float)part.offset.x - MARGIN_PX, (float)part.offset.y - MARGIN_PX};
    const float size[2] = {
        (float)part.extent.width + 2.0f * MARGIN_PX, (float)part.extent.height + 2.0f * MARGIN_PX};
    for (int r = 0; r < 2; r++) {
        const float centre = (2.0f * first[r] + size[r]) / px[r] - 1.0f;
        for (int c = 0; c < 4; c++)
            m[c * 4 + r] = (m[c * 4 + r] - centre * m[c * 4 + 3]) * (px[r] / size[r]);
    }
}

static bool is_exact(const struct hg_view_state *view)
{
    return view->stream.exact && view->settings.debug == 0;
}

// What does not fit the budget is drawn in parts, not coarser.
static bool is_whole(const struct hg_view_state *view)
{
    return is_exact(view) && !view->stream.forced && !view->stream.finding;
}

// What the camera sees of `part`.
static struct hg_visible_view camera_view(const struct hg_view_state *view, VkRect2D part)
{
    // Not the newest sample's: that may have been of a smaller picture, for which less would do.
    struct hg_gpu_camera camera;
    const struct hg_camera_setup setup = camera_setup(view);
    hg_camera_fill(&setup, &camera);
    const bool off = view->context->no_culling;
    struct hg_visible_view look = {.eye = {camera.eye_ws.x, camera.eye_ws.y, camera.eye_ws.z},
        .forward = {camera.forward_ws.x, camera.forward_ws.y, camera.forward_ws.z},
        .orthographic = camera.orthographic != 0,
        .error_px = view->error_px,
        .near = fmaxf(camera.near, 1e-6f),
        .wait = view->wait || is_exact(view),
        .whole = is_whole(view),
        .both_sides = off,
        .numbered = true,
        .history = !off && view->settings.debug == 0 && view->stream.finding == 0};
    look.px_scale = 1.0f / (look.orthographic ? camera.pixel_size : camera.pixel_angle);
    float m[16];
    memcpy(m, camera.view_proj.m, sizeof m);
    narrow(view, part, m);
    if (!off)
        look.plane_count = hg_cull_planes(m, look.planes);
    return look;
}

static uint32_t first_sample(const struct hg_view_state *view)
{
    const struct hg_stream_area *area = hg_stream_area(view);
    return area != NULL ? area->samples : view->samples;
}

// Where the samples of the next batch lie. One sample is known to lie there, several only nearly.
static struct hg_visible_lens lens_of(const struct hg_view_state *view, uint32_t samples)
{
    struct hg_gpu_camera camera;
    struct hg_camera_setup setup = camera_setup(view);
    const bool known = samples == 1 && view->settings.debug == 0;
    if (known)
        hg_camera_jitter(first_sample(view), view->settings.seed, setup.jitter_px);
    hg_camera_fill(&setup, &camera);
    struct hg_visible_lens lens = {.width = setup.width,
        .height = setup.height,
        .shift_px = known || view->settings.debug != 0 ? 0.0f : MARGIN_PX};
    memcpy(lens.view_proj, camera.view_proj.m, sizeof lens.view_proj);
    memcpy(lens.clip, camera.proj.m + 12, sizeof lens.clip);
    return lens;
}

// Of the picture without its jitter, or of its newest sample.
static struct hg_visible_lens host_lens(const struct hg_gpu_camera *camera, VkExtent2D size)
{
    struct hg_visible_lens lens = {.width = size.width, .height = size.height};
    memcpy(lens.view_proj, camera->view_proj.m, sizeof lens.view_proj);
    memcpy(lens.clip, camera->proj.m + 12, sizeof lens.clip);
    return lens;
}

static VkRect2D area_of(const struct hg_view_state *view)
{
    const struct hg_stream_area *area = hg_stream_area(view);
    return area != NULL ? area->rect
                        : (VkRect2D){{0, 0}, {view->settings.width, view->settings.height}};
}

static enum hg_status select_sets(
    struct hg_view_state *view, enum hg_frame_part part, uint32_t samples, struct hg_error *err)
{
    const struct hg_stream *s = &view->stream;
    struct hg_jobs *jobs = view->context->jobs;
    struct hg_visible_view look = camera_view(view, area_of(view));
    const struct hg_visible_lens lens = lens_of(view, samples);
    const bool is_cpu = hg_gpu_get_caps(view->context->gpu)->is_cpu;
    if (is_cpu && !view->context->no_culling)
        look.lens = &lens;
    struct hg_gpu_camera camera;
    const struct hg_camera_setup setup = camera_setup(view);
    hg_camera_fill(&setup, &camera);
    const struct hg_visible_lens host = host_lens(&camera, size_of(view));
    if (is_cpu && !view->context->no_host && view->settings.debug == 0)
        look.host = &host;
    struct hg_shadow_choice choice = {
        .coarse = view->coarse, .wait = look.wait, .whole = look.whole};
    enum hg_status status = HG_OK;
    if (part == HG_FRAME_PICTURE)
        status = hg_visible_add(view->visible, view->rooms->geometry, &look, jobs, err);
    else if (s->shadow_count > 0) {
        const struct hg_stream_area *top = &s->shadow_areas[s->shadow_count - 1];
        choice.area = top->rect;
        choice.share = top->share;
        choice.shares = s->forced ? 0 : top->shares; // a coarser cut is another, and drawn whole
    }
    return status == HG_OK && view->settings.debug == 0
               ? hg_shadow_select(
                     view->rooms->geometry, view->lighting, &choice, jobs, view->visible, err)
               : status;
}

static void note_sets(struct hg_view_state *view, enum hg_frame_part part)
{
    view->missing_clusters = 0;
    view->crowded = false;
    for (uint32_t i = 0; i < hg_visible_count(view->visible); i++) {
        const struct hg_visible_set *set = hg_visible_set(view->visible, i);
        view->missing_clusters += set->missing;
        view->crowded |= set->crowded;
    }
    if (part == HG_FRAME_SHADOWS) { // those that are coarser than a texel make the picture so
        for (uint32_t i = 0; i < hg_visible_count(view->visible); i++) {
            const float texels = hg_visible_set(view->visible, i)->error_px;
            float *most_px = &view->stream.shadow_error_px;
            *most_px = texels > 1.0f ? fmaxf(*most_px, view->error_px * texels) : *most_px;
        }
        return;
    }
    const float error_px = hg_visible_set(view->visible, 0)->error_px;
    view->shown_error_px = view->stream.exact ? fmaxf(view->shown_error_px, error_px) : error_px;
}

enum hg_status hg_frame_cull(
    struct hg_view_state *view, enum hg_frame_part part, uint32_t samples, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    hg_visible_reset(view->visible);
    enum hg_status status = select_sets(view, part, samples, err);
    if (status == HG_OK)
        note_sets(view, part);
    if (status == HG_OK && !(view->crowded && is_whole(view)))
        status = hg_visible_upload(view->visible, view->context->jobs, err);
    hg_view_add_stage(view, "cull", hg_clock_now_ns() - start);
    return status;
}

enum hg_status hg_frame_cull_part(
    struct hg_view_state *view, VkRect2D part, struct hg_visible *visible, struct hg_error *err)
{
    struct hg_visible_view look = camera_view(view, part);
    look.error_px = view->shown_error_px; // as the picture shows it
    look.wait = look.whole = true;
    look.history = false;
    hg_visible_reset(visible);
    struct hg_jobs *jobs = view->context->jobs;
    enum hg_status status = hg_visible_add(visible, view->rooms->geometry, &look, jobs, err);
    if (status == HG_OK && hg_visible_set(visible, 0)->crowded) { // then as fine as can be
        look.whole = false;
        hg_visible_reset(visible);
        status = hg_visible_add(visible, view->rooms->geometry, &look, jobs, err);
    }
    return status == HG_OK ? hg_visible_upload(visible, jobs, err) : status;
}

static bool has_blend(const struct hg_view_state *view)
{
    const struct hg_visible_set *set = hg_visible_set(view->visible, 0);
    return set->class_first[HG_DRAW_CLASS_BLEND + 1] > set->class_first[HG_DRAW_CLASS_BLEND];
}

// Cells without light pay for their own pipeline and the search in pictures that follow each other.
#define DARK_LEAST 0.25f // share of cells; with less the search rests for DARK_REST pictures
#define DARK_REST  15

static enum hg_status make(struct hg_view_state *view, VkFormat format, const char *name,
    struct hg_gpu_image *image, struct hg_error *err)
{
    const struct hg_gpu_image_params params = {.format = format,
        .width = view->settings.width,
        .height = view->settings.height,
        .attachment = true,
        .name = name};
    return image->handle != VK_NULL_HANDLE
               ? HG_OK
               : hg_gpu_image_create(view->context->gpu, &params, image, err);
}

static enum hg_status make_layers(struct hg_view_state *view, struct hg_error *err)
{
    enum hg_status status =
        make(view, HG_VISIBILITY_FORMAT, "layer visibility", &view->layer_visibility, err);
    if (status == HG_OK)
        status = make(view, HG_COLOR_FORMAT, "layer colour", &view->layer_color, err);
    for (int i = 0; i < 2 && status == HG_OK; i++)
        status = make(view, HG_DEPTH_FORMAT, "layer depth", &view->layers[i], err);
    return status;
}

bool hg_frame_transmits(const struct hg_view_state *view)
{
    return (view->rooms->features & HG_FEATURE_TRANSMISSION) != 0;
}

// The opaque scene as it is seen through layers.
static enum hg_status record_behind(
    struct hg_view_state *view, struct hg_pass *pass, struct hg_error *err)
{
    enum hg_status status = make(view, HG_COLOR_FORMAT, "scene behind", &view->behind, err);
    const struct hg_shade shade = {.visibility = &view->visibility,
        .depth = &view->depth,
        .target = &view->behind,
        .clear = true,
        .counted = view->stream.exact,
        .alone = true};
    return status == HG_OK ? hg_shade_record(pass, &shade, err) : status;
}

static enum hg_status record_layers(
    struct hg_view_state *view, struct hg_pass *pass, uint32_t slot, struct hg_error *err)
{
    const struct hg_visibility_scene scene = {view->visible, 0, 0};
    enum hg_status status = HG_OK;
    // What lets light through shows what is behind it by itself: it hides further layers.
    const bool holes = view->rooms->has_holes;
    for (uint32_t i = 0; i < (holes ? view->layer_limit : 1) && status == HG_OK; i++) {
        const struct hg_visibility_target target = {&view->layer_visibility, &view->layers[i % 2]};
        status = hg_visibility_record_layer(
            pass, &scene, &target, &view->depth, i > 0 ? &view->layers[(i + 1) % 2] : NULL, err);
        const struct hg_shade shade = {.visibility = &view->layer_visibility,
            .depth = target.depth,
            .target = &view->layer_color,
            .clear = i == 0,
            .counted = view->stream.exact,
            .layer = true,
            .behind = hg_frame_transmits(view) ? &view->behind : NULL};
        if (status == HG_OK)
            status = hg_shade_record(pass, &shade, err);
    }
    struct hg_gpu_image *last = &view->layers[(view->layer_limit - 1) % 2];
    return status == HG_OK && holes ? hg_layer_any_record(pass, last, &view->layers_full, slot, err)
                                    : status;
}

// A debug view takes one sample through the pixels' centres and needs no light.
static enum hg_status record_debug(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    hg_frame_fill(view, 0, false, 0);
    struct hg_pass pass = hg_frame_pass(view, cmd, 0);
    const struct hg_visibility_target target = {&view->visibility, &view->depth};
    const bool counts = view->settings.debug == HG_DEBUG_VIEW_OVERDRAW;
    const bool sampled = view->settings.debug <= HG_DEBUG_VIEW_MISSING;
    const struct hg_visibility_scene scene = {view->visible, 0, 0};
    enum hg_status status = hg_visibility_record(&pass, &scene, &target, err);
    if (status == HG_OK && counts)
        status = make(view, HG_COLOR_FORMAT, "layer colour", &view->layer_color, err);
    if (status == HG_OK && counts)
        status = hg_visibility_record_overdraw(&pass, &scene, &view->layer_color, err);
    // The picture itself, drawn over below: it asks for the pages that it would show.
    const struct hg_shade shade = {.visibility = &view->visibility,
        .depth = &view->depth,
        .target = &view->accumulated,
        .clear = true};
    if (status == HG_OK && sampled)
        status = hg_shade_record(&pass, &shade, err);
    const struct hg_debug debug = {.view = view->settings.debug,
        .visibility = &view->visibility,
        .counts = counts ? &view->layer_color : NULL,
        .target = &view->accumulated};
    return status == HG_OK ? hg_debug_record(&pass, &debug, err) : status;
}

static bool tells_dark(struct hg_view_state *view, const struct hg_pass *pass)
{
    const enum hg_frame_dark wish = view->context->dark;
    const uint32_t lights = view->frame.lighting.light_count;
    if (wish == HG_FRAME_DARK_OFF || lights == 0 || lights > HG_DARK_MOST_LIGHTS ||
        pass->area.extent.width > 0)
        return false;
    if (wish == HG_FRAME_DARK_ON)
        return true;
    if (!view->direct || !hg_gpu_get_caps(pass->gpu)->is_cpu)
        return false;
    if (view->dark_wait > 0)
        view->dark_wait--;
    return view->dark_wait == 0;
}

// What the host draws of a sample; the frame block is that of the sample.
static enum hg_status draw_hosted(
    struct hg_view_state *view, uint32_t slot, uint32_t slots, struct hg_error *err)
{
    if (!hg_visible_set(view->visible, 0)->hosted)
        return HG_OK;
    const uint64_t start = hg_clock_now_ns();
    const struct hg_visible_lens lens = host_lens(&view->frame.camera, size_of(view));
    const enum hg_status status =
        hg_visible_host(view->visible, &lens, slot, slots, view->context->jobs, err);
    hg_view_add_stage(view, "host raster", hg_clock_now_ns() - start);
    return status;
}

// slot: of the sample in this batch, of `slots`.
static enum hg_status record_sample(struct hg_view_state *view, struct hg_gpu_cmd *cmd,
    uint32_t sample, uint32_t slot, uint32_t slots, struct hg_error *err)
{
    hg_frame_fill(view, sample, true, slot);
    struct hg_pass pass = hg_frame_pass(view, cmd, slot);
    const struct hg_visibility_target target = {&view->visibility, &view->depth};
    const bool blend = has_blend(view);
    const struct hg_visibility_scene scene = {view->visible, 0, slot};
    enum hg_status status = draw_hosted(view, slot, slots, err);
    if (status == HG_OK)
        status = hg_visibility_record(&pass, &scene, &target, err);
    if (status == HG_OK && view->stream.behind)
        return record_behind(view, &pass, err);
    if (status == HG_OK && blend)
        status = make_layers(view, err);
    if (status == HG_OK && blend && hg_frame_transmits(view) && !view->stream.behind_there)
        status = record_behind(view, &pass, err);
    if (status == HG_OK && blend)
        status = record_layers(view, &pass, slot, err);
    const bool dark = tells_dark(view, &pass);
    view->dark_told = dark;
    if (status == HG_OK && dark)
        status = hg_dark_find(&pass, &view->dark, view->lighting, view->coarse, &view->depth, err);
    if (status == HG_OK && dark)
        status = hg_dark_mark(&pass, &view->dark, &view->depth, err);
    const struct hg_shade shade = {.visibility = &view->visibility,
        .depth = &view->depth,
        .target = &view->accumulated,
        .picture = view->direct && view->stream.finding == 0 ? &view->pixels[0] : NULL,
        .tonemap = view->settings.tonemap,
        .clear = sample == 0 && !view->stream.exact,
        .counted = view->stream.exact,
        .dark = dark,
        .front = blend ? &view->layer_color : NULL};
    return status == HG_OK ? hg_shade_record(&pass, &shade, err) : status;
}

static enum hg_status record_shadows(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, uint32_t first_set, struct hg_error *err)
{
    struct hg_lighting_stats stats;
    hg_lighting_stats(view->lighting, &stats);
    view->stale_shadows = stats.shadow_maps_stale;
    hg_frame_fill(view, view->samples, true, 0); // where the geometry is
    struct hg_pass pass = hg_frame_pass(view, cmd, 0);
    const struct hg_stream *s = &view->stream;
    pass.area = s->shadow_count > 0 ? s->shadow_areas[s->shadow_count - 1].rect : (VkRect2D){0};
    pass.adds = s->shadow_count > 0 && s->shadow_begun;
    return hg_shadow_record(&pass, view->lighting, view->coarse, view->visible, first_set, err);
}

static enum hg_status record_facets(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    hg_frame_fill(view, view->samples, true, 0);
    struct hg_pass pass = hg_frame_pass(view, cmd, 0);
    return hg_facet_record(&pass, view->rooms->geometry, err);
}

static void adapt_layers(struct hg_view_state *view, uint32_t samples)
{
    bool full = false;
    for (uint32_t i = 0; i < samples; i++)
        full |= ((const uint32_t *)view->layers_full.mapped)[i] != 0;
    view->shallow = full && view->layer_limit < HG_VIEW_MAX_LAYERS;
    if (view->shallow)
        view->layer_limit *= 2;
    else if (full && !view->too_deep_told)
        hg_warn(FRAME, "%u layers of blended surfaces or more: what lies deeper is not seen",
            (unsigned)HG_VIEW_MAX_LAYERS);
    view->too_deep_told = full && !view->shallow;
}

void hg_frame_note_drawn(struct hg_view_state *view, uint32_t samples)
{
    struct hg_visible_stats drawn;
    hg_visible_stats(view->visible, &drawn);
    view->draws_drawn = drawn.draws;
    view->triangles_drawn = drawn.triangles;
    adapt_layers(view, samples);
    if (view->dark_told && hg_dark_share(&view->dark, &view->depth) < DARK_LEAST)
        view->dark_wait = DARK_REST;
}

uint32_t hg_frame_batch(const struct hg_view_state *view, uint32_t samples)
{
    const VkExtent2D size = size_of(view);
    const uint64_t most = MOST_HOSTED_PX / ((uint64_t)size.width * size.height);
    if (!hg_visible_set(view->visible, 0)->hosted || samples <= most)
        return samples;
    return most > 0 ? (uint32_t)most : 1;
}

enum hg_status hg_frame_record(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, uint32_t samples, struct hg_error *err)
{
    enum hg_status status = hg_skin_record(cmd, view->rooms->geometry, err);
    if (status == HG_OK)
        status = record_facets(view, cmd, err);
    if (status == HG_OK && view->settings.debug != 0)
        return record_debug(view, cmd, err);
    if (status == HG_OK)
        status = record_shadows(view, cmd, 1, err);
    const uint32_t first = first_sample(view);
    for (uint32_t i = 0; i < samples && status == HG_OK; i++)
        status = record_sample(view, cmd, first + i, i, samples, err);
    return status;
}

enum hg_status hg_frame_record_shadows(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    const enum hg_status status = hg_skin_record(cmd, view->rooms->geometry, err);
    return status == HG_OK ? record_shadows(view, cmd, 0, err) : status;
}

// Opaque surfaces in the textures that the camera asks for; casters' own demands are small.
enum hg_status hg_frame_record_ahead(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    hg_frame_fill(view, 0, true, 0);
    const VkRect2D all = {{0, 0}, {view->settings.width, view->settings.height}};
    const struct hg_visible_view look = camera_view(view, all);
    hg_visible_reset(view->visible);
    enum hg_status status =
        hg_visible_add(view->visible, view->rooms->geometry, &look, view->context->jobs, err);
    if (status == HG_OK)
        status = hg_visible_upload(view->visible, view->context->jobs, err);
    if (status != HG_OK)
        return status;
    struct hg_pass pass = hg_frame_pass(view, cmd, 0);
    const struct hg_visibility_target target = {&view->visibility, &view->depth};
    const struct hg_visibility_scene scene = {view->visible, 0, 0};
    status = hg_visibility_record(&pass, &scene, &target, err);
    const struct hg_shade shade = {.visibility = &view->visibility,
        .depth = &view->depth,
        .target = &view->accumulated,
        .clear = true};
    return status == HG_OK ? hg_shade_record(&pass, &shade, err) : status;
}
