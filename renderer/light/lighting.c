#include "renderer/light/lighting.h"

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/light/cluster.h"
#include "renderer/light/light_cut.h"
#include "renderer/light/light_shared.h"
#include "renderer/light/env/sky.h"
#include "renderer/light/shadow/shadow_pages.h"
#include "renderer/light/shadow/shadow_sight.h"
#include "renderer/math/vec.h"

// While a view moves: the first maps of a plan, by the weight of their lights, are always drawn, of
// the others so many in a picture.
#define ALWAYS_DRAWN 48
#define MOST_FRESH   12
// Share of a picture where texels of the sun's whole map are coarse, from which on pages come, and
// below which they go.
#define PAGES_FROM  0.25f
#define PAGES_LEAST 0.1f

struct hg_lighting {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    struct hg_lighting_params params;
    struct hg_light_shared *own; // NULL: params.shared is another's
    struct hg_gpu_buffer lights, shadows, clusters, entries;
    struct {
        struct hg_gpu_buffer buffer;
        uint32_t *words; // what it holds
        uint64_t hash;
    } tabled;
    struct {
        struct hg_shadow_atlas *in; // of the newest sync; NULL: no maps
        uint64_t seen;              // its revision, as of the newest sync or what was drawn since
        uint64_t revision;          // of what the maps of the plan show, here
        bool lost;
    } atlas;
    struct hg_light_set set;
    struct hg_clusters cells;
    struct hg_light_cuts cuts;
    struct hg_sky_disc sun;
    struct hg_shadow_plan plan, before; // of the newest sync, and of the one before
    struct {
        struct hg_shadow_pages *table; // NULL until a picture has some
        uint32_t due;                  // maps of the plan behind `count`
        bool pay;                      // the newest picture in motion gains by them
    } pages;
    struct {
        uint32_t deferred; // maps that this picture does without
        uint32_t unseen;   // maps that it has no use for
    } left_out;
    bool moves; // as the newest view said
    bool unshadowed_told;
    struct hg_gpu_lighting block; // without what changes from sample to sample
};

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_lighting_create(struct hg_gpu *gpu, struct hg_jobs *jobs,
    const struct hg_lighting_params *params, struct hg_lighting **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_lighting *l = hg_calloc(1, sizeof *l);
    if (!l)
        return hg_error_set(err, HG_E_NOMEM, "lighting", NULL, "no memory");
    l->gpu = gpu;
    l->jobs = jobs;
    if (params)
        l->params = *params;
    if (!l->params.shadow_atlas_px)
        l->params.shadow_atlas_px = 4096;
    uint32_t limit = hg_gpu_get_caps(gpu)->max_image_side_px;
    while (l->params.shadow_atlas_px > limit)
        l->params.shadow_atlas_px /= 2;
    enum hg_status status =
        l->params.shared ? HG_OK : hg_light_shared_create(gpu, NULL, &l->own, err);
    if (l->own)
        l->params.shared = l->own;
    if (status)
        hg_lighting_destroy(l);
    else
        *out = l;
    return status;
}

void hg_lighting_destroy(struct hg_lighting *l)
{
    if (!l)
        return;
    if (l->params.shared)
        hg_shadow_atlases_leave(&l->params.shared->atlases, l);
    hg_light_shared_destroy(l->own);
    struct hg_gpu_buffer *buffers[] = {
        &l->lights, &l->shadows, &l->clusters, &l->entries, &l->tabled.buffer};
    for (size_t i = 0; i < sizeof buffers / sizeof buffers[0]; i++)
        hg_gpu_buffer_destroy(l->gpu, buffers[i]);
    hg_free(l->tabled.words);
    hg_light_set_finish(&l->set);
    hg_clusters_finish(&l->cells);
    hg_light_cuts_finish(&l->cuts);
    hg_shadow_plan_finish(&l->plan);
    hg_shadow_plan_finish(&l->before);
    hg_free(l->pages.table);
    hg_free(l);
}

// --- shadow maps ---------------------------------------------------------------------------------

static struct hg_shadow_atlases *atlases_of(const struct hg_lighting *l)
{
    return &l->params.shared->atlases;
}

static bool same_maps(const struct hg_shadow_plan *a, const struct hg_shadow_plan *b)
{
    bool same = a->count == b->count;
    for (uint32_t i = 0; i < a->count && same; i++)
        same = memcmp(&a->maps[i].gpu, &b->maps[i].gpu, sizeof a->maps[i].gpu) == 0;
    return same;
}

static enum hg_shadow_keeping keeping_of(const struct hg_lighting_view *view)
{
    if (view->keeps)
        return HG_SHADOW_KEEPS;
    return view->moves || view->once ? HG_SHADOW_SHARES : HG_SHADOW_REFINES;
}

// The atlas of the plan; among many lamps, and in motion, maps stay where it has them.
static enum hg_status place_maps(
    struct hg_lighting *l, const struct hg_lighting_view *view, bool many, struct hg_error *err)
{
    const struct hg_shadow_user user = {l, keeping_of(view), view, &l->plan};
    struct hg_shadow_atlas *a, *was = l->atlas.in;
    const bool had = was && was->owner == l;
    l->atlas.in = NULL;
    l->atlas.lost = false;
    if (!l->plan.atlas_px)
        return HG_OK;
    enum hg_status status = hg_shadow_atlases_take(atlases_of(l), &user, &a, err);
    if (status)
        return status;
    if (many || view->moves) // at rest places are those of the plan, but among many
        status = hg_shadow_plan_keep(&l->plan, &a->held, a->image.width);
    if (status)
        return hg_error_set(err, status, "shadow maps", NULL, "no memory for their plan");
    if (hg_shadow_atlas_plan(a, &user))
        return hg_error_set(err, HG_E_NOMEM, "shadow maps", NULL, "no memory for what is held");
    l->atlas.in = a;
    l->atlas.lost = a != was || (view->keeps && !had);
    if (l->atlas.lost || a->revision != l->atlas.seen || !same_maps(&l->plan, &l->before))
        l->atlas.revision++;
    l->atlas.seen = a->revision;
    return HG_OK;
}

// Which pages are held and which are drawn in this picture.
static enum hg_status sync_pages(
    struct hg_lighting *l, const struct hg_lighting_view *view, struct hg_error *err)
{
    struct hg_shadow_plan *plan = &l->plan;
    if (plan->paged && !l->pages.table)
        l->pages.table = hg_calloc(1, sizeof *l->pages.table);
    if (plan->paged &&
        (!l->pages.table || hg_grow(&plan->maps, &plan->capacity,
                                (size_t)plan->count + HG_SHADOW_FRESH_PAGES, sizeof *plan->maps)))
        return hg_error_set(err, HG_E_NOMEM, "shadow pages", NULL, "no memory for their table");
    if (!l->pages.table)
        return HG_OK;
    l->pages.table->view = l;
    struct hg_shadow_pool *pool = plan->paged ? l->atlas.in->pool : NULL;
    if (pool)
        hg_shadow_pool_begin(pool, &plan->maps[plan->pool].gpu, &plan->maps[plan->pool + 1].gpu);
    hg_shadow_pages_begin(l->pages.table, pool, view->camera);
    l->pages.due = hg_shadow_pages_plan(l->pages.table, plan->maps + plan->count);
    return HG_OK;
}

// Maps that nothing in the picture is shadowed by are not drawn. While a view moves and no other
// map is due, one of them is, so that a turn does not find all of them stale.
static void defer_unseen(struct hg_lighting *l, const struct hg_lighting_view *view)
{
    const struct hg_shadow_sight sight = hg_shadow_sight_make(view->camera);
    struct hg_shadow_map *ahead = NULL;
    uint32_t due = l->pages.due;
    l->left_out.unseen = 0;
    for (uint32_t i = 0; i < l->set.count; i++) {
        struct hg_gpu_light *light = &l->set.items[i];
        if (light->shadow == HG_SHADOW_NONE || light->kind == HG_LIGHT_KIND_DIRECTIONAL)
            continue;
        const bool seen = hg_shadow_sight_has_light(&sight, light);
        for (uint32_t k = 0; k < light->shadow_count; k++) {
            struct hg_shadow_map *map = &l->plan.maps[light->shadow + k];
            map->deferred = !seen || !hg_shadow_sight_has_map(&sight, light, map);
            l->left_out.unseen += map->deferred;
            due += map->stale && !map->deferred;
            if (map->stale && map->deferred && !ahead)
                ahead = map;
        }
        if (!seen)
            light->shadow = HG_SHADOW_NONE;
    }
    if (view->moves && due == 0 && ahead)
        ahead->deferred = false;
}

// Leaves maps of lamps for later while the view moves. Lights of a plan are in the order of their
// weight; those without a map have no shadow in this picture.
static void defer_maps(struct hg_lighting *l, bool moves)
{
    uint32_t fresh = 0;
    l->left_out.deferred = 0;
    for (uint32_t i = 0; i < l->set.count && moves; i++) {
        struct hg_gpu_light *light = &l->set.items[i];
        if (light->shadow == HG_SHADOW_NONE || light->kind == HG_LIGHT_KIND_DIRECTIONAL ||
            light->shadow < ALWAYS_DRAWN)
            continue;
        struct hg_shadow_map *maps = &l->plan.maps[light->shadow];
        uint32_t stale = 0;
        for (uint32_t k = 0; k < light->shadow_count; k++)
            stale += maps[k].stale && !maps[k].deferred;
        fresh += stale;
        if (stale == 0 || fresh <= MOST_FRESH)
            continue;
        for (uint32_t k = 0; k < light->shadow_count; k++)
            maps[k].deferred = true;
        l->left_out.deferred += light->shadow_count;
        light->shadow = HG_SHADOW_NONE;
    }
}

struct hg_shadow_map *hg_lighting_shadow_maps(struct hg_lighting *l, uint32_t *count)
{
    *count = l->plan.count + l->pages.due;
    return l->plan.maps;
}

// Where something moved a small part of a cascade is drawn again, which takes little.
static bool is_costly(const struct hg_shadow_map *map)
{
    const uint64_t area =
        (uint64_t)(map->dirty.x1 - map->dirty.x0) * (map->dirty.y1 - map->dirty.y0);
    return !map->partly || (float)area * 16 > map->gpu.size_px * map->gpu.size_px;
}

bool hg_lighting_needs_cascades(struct hg_lighting *lighting)
{
    uint32_t count;
    const struct hg_shadow_map *maps = hg_lighting_shadow_maps(lighting, &count);
    for (uint32_t i = 0; i < count; i++) {
        if (maps[i].stale && maps[i].refines && is_costly(&maps[i]))
            return true;
    }
    return false;
}

bool hg_lighting_has_pages(const struct hg_lighting *l)
{
    return l->plan.paged;
}

void hg_lighting_forget_pages(struct hg_lighting *l)
{
    if (l->atlas.in && l->atlas.in->pool)
        hg_shadow_pool_forget(l->atlas.in->pool);
}

void hg_lighting_see(
    struct hg_lighting *l, const struct hg_gpu_camera *camera, const struct hg_shadow_depth *depth)
{
    const struct hg_gpu_light *sun = l->set.count > 0 ? &l->set.items[0] : NULL;
    if (l->plan.paged)
        hg_shadow_pages_see(l->pages.table, camera, depth);
    if (!l->moves || !sun || sun->kind != HG_LIGHT_KIND_DIRECTIONAL ||
        sun->shadow == HG_SHADOW_NONE)
        return;
    const float texel = l->plan.maps[sun->shadow + sun->shadow_count - 1].gpu.texel_size;
    const float share = hg_shadow_pages_share(texel, camera, depth);
    l->pages.pay = share > (l->pages.pay ? PAGES_LEAST : PAGES_FROM);
}

void hg_lighting_page_color(const struct hg_lighting *l, const struct hg_gpu_camera *camera,
    const struct hg_shadow_depth *depth, const uint32_t pixel[2], uint8_t out[4])
{
    if (l->plan.paged)
        hg_shadow_pages_color(l->pages.table, camera, depth, pixel, out);
}

uint64_t hg_lighting_shadow_table_bytes(const struct hg_lighting *l)
{
    return l->plan.count * sizeof(struct hg_gpu_shadow) +
           (l->plan.paged ? sizeof l->pages.table->table : 0);
}

uint64_t hg_lighting_atlas_revision(const struct hg_lighting *l)
{
    return l->atlas.revision;
}

void hg_lighting_note_drawn(struct hg_lighting *l)
{
    l->atlas.revision++;
    if (!l->atlas.in)
        return;
    hg_shadow_atlases_note_drawn(atlases_of(l), l->atlas.in);
    l->atlas.seen = l->atlas.in->revision;
}

void hg_lighting_rest(struct hg_lighting *l)
{
    hg_shadow_atlases_release(atlases_of(l), l);
}

bool hg_lighting_is_lost(const struct hg_lighting *l)
{
    return l->atlas.lost;
}

// --- sync ----------------------------------------------------------------------------------------

static enum hg_status put(struct hg_lighting *l, struct hg_gpu_buffer *buffer, const char *name,
    const void *data, uint64_t bytes, struct hg_error *err)
{
    if (!bytes)
        return HG_OK;
    enum hg_status status =
        hg_gpu_buffer_reserve(l->gpu, HG_GPU_BUFFER_DEVICE, bytes, name, buffer, err);
    return status ? status : hg_gpu_buffer_upload(l->gpu, buffer, 0, data, bytes, err);
}

static enum hg_status upload_shadows(struct hg_lighting *l, struct hg_error *err)
{
    const uint64_t bytes = hg_lighting_shadow_table_bytes(l);
    struct hg_gpu_shadow *shadows = hg_calloc(1, bytes + sizeof *shadows);
    if (!shadows)
        return hg_error_set(err, HG_E_NOMEM, "shadow maps", NULL, "no memory");
    for (uint32_t i = 0; i < l->plan.count; i++)
        shadows[i] = l->plan.maps[i].gpu;
    if (l->plan.paged)
        memcpy(shadows + l->plan.count, l->pages.table->table, sizeof l->pages.table->table);
    enum hg_status status = put(l, &l->shadows, "shadow maps", shadows, bytes, err);
    hg_free(shadows);
    return status;
}

// Profiles and images, when they are others than before.
static enum hg_status upload_tables(struct hg_lighting *l, struct hg_error *err)
{
    const uint64_t hash = hg_light_set_table_hash(&l->set);
    const uint64_t bytes = (uint64_t)l->set.word_count * sizeof *l->tabled.words;
    if (hash == l->tabled.hash)
        return HG_OK;
    hg_free(l->tabled.words);
    l->tabled.hash = 0;
    l->tabled.words = hg_calloc((size_t)l->set.word_count + 1, sizeof *l->tabled.words);
    if (!l->tabled.words)
        return hg_error_set(err, HG_E_NOMEM, "light tables", NULL, "no memory");
    hg_light_set_tables(&l->set, l->tabled.words);
    if (l->set.left_out > 0)
        hg_warn(LIGHT, "profiles or images of %u lights have no room", l->set.left_out);
    enum hg_status status = put(l, &l->tabled.buffer, "light tables", l->tabled.words, bytes, err);
    if (!status)
        l->tabled.hash = hash;
    return status;
}

static enum hg_status upload_lists(struct hg_lighting *l, struct hg_error *err)
{
    const bool cut = l->cells.overflow;
    const struct hg_gpu_light *lights = cut ? l->cuts.lights : l->set.items;
    const uint64_t count = cut ? l->cuts.count : l->set.count;
    enum hg_status status = put(l, &l->lights, "lights", lights, count * sizeof *lights, err);
    if (!status)
        status = upload_tables(l, err);
    if (!status)
        status = upload_shadows(l, err);
    if (!status && l->cells.used)
        status = put(l, &l->clusters, "light clusters", l->cells.first, sizeof l->cells.first, err);
    if (!status && l->cells.used)
        status = put(l, &l->entries, "light lists", l->cells.entries,
            (uint64_t)l->cells.entry_count * sizeof *l->cells.entries, err);
    return status;
}

// Says once when something could not be done as asked.
static void report(struct hg_lighting *l)
{
    if (l->plan.unshadowed_lights && !l->unshadowed_told)
        hg_warn(LIGHT, "%u of %u shadow-casting lights have no room in the shadow atlas",
            l->plan.unshadowed_lights, l->plan.unshadowed_lights + l->plan.shadowed_lights);
    l->unshadowed_told = l->plan.unshadowed_lights != 0;
}

static void fill_environment(struct hg_lighting *l, const struct hg_environment *env)
{
    struct hg_gpu_lighting *b = &l->block;
    const struct hg_env_device *made = &l->params.shared->env;
    const float white[3] = {1, 1, 1}, black[3] = {0, 0, 0};
    const float *color = made->kind == HG_ENV_KIND_COLOR   ? env->color
                         : made->kind == HG_ENV_KIND_IMAGE ? white
                                                           : black;
    b->env_kind = made->kind;
    b->env_specular_lods = (float)made->specular_lods;
    b->env_color = (struct hg_vec3){
        color[0] * env->intensity, color[1] * env->intensity, color[2] * env->intensity};
    b->env_rotation_cos = cosf(env->rotation_rad);
    b->env_rotation_sin = sinf(env->rotation_rad);
}

static void fill_block(struct hg_lighting *l, const struct hg_lighting_view *view)
{
    struct hg_gpu_lighting *b = &l->block;
    const bool cut = l->cells.overflow;
    *b = (struct hg_gpu_lighting){.lights = l->lights.address,
        .shadows = l->shadows.address,
        .clusters = l->clusters.address,
        .cluster_lights = l->entries.address,
        .irradiance = l->params.shared->env.irradiance.address,
        .dfg = l->params.shared->dfg.address,
        .tables = l->tabled.buffer.address,
        .light_count = cut ? l->cuts.count : l->set.count,
        .global_count = cut ? l->set.directional_count : l->set.global_count,
        .clustered = l->cells.used,
        .cluster_x = HG_CLUSTER_X,
        .cluster_y = HG_CLUSTER_Y,
        .cluster_z = HG_CLUSTER_Z,
        .cluster_scale_x = (float)HG_CLUSTER_X / (float)view->width,
        .cluster_scale_y = (float)HG_CLUSTER_Y / (float)view->height,
        .cluster_z_scale = l->cells.z_scale,
        .cluster_z_bias = l->cells.z_bias,
        .shadow_inv_size = 1 / (float)hg_lighting_image_shadow(l)->width};
    fill_environment(l, &view->scene->environment);
    b->pages.shadow = HG_SHADOW_NONE;
    if (l->plan.paged) {
        const uint64_t maps_bytes = l->plan.count * sizeof(struct hg_gpu_shadow);
        hg_shadow_pages_fill(l->pages.table, &b->pages);
        b->pages.table = l->shadows.address + maps_bytes;
        b->pages.first = (uint32_t)(maps_bytes / 4);
        b->pages.shadow = l->plan.pool;
    }
}

// The disc of a sky is a directional light with a shadow, as it is for paths (emitter_lights.c).
static enum hg_status add_sky_sun(struct hg_lighting *l, const struct hg_environment *env)
{
    hg_sky_disc_update(&l->sun, env, l->set.directional_count > 0);
    return hg_sky_disc_is_there(&l->sun)
               ? hg_light_set_add_sun(&l->set, l->sun.lux, l->sun.towards_ws)
               : HG_OK;
}

static enum hg_status make_plan(
    struct hg_lighting *l, struct hg_lighting_view *view, struct hg_error *err)
{
    const struct hg_shadow_plan before = l->before;
    l->before = l->plan;
    l->plan = before;
    if (view->paging == HG_PAGING_AUTO)
        view->paging = l->pages.pay ? HG_PAGING_ON : HG_PAGING_OFF;
    const enum hg_status status =
        hg_shadow_plan_make(&l->plan, &l->set, view, l->params.shadow_atlas_px);
    return status ? hg_error_set(err, status, "shadow maps", NULL, "no memory for their plan")
                  : HG_OK;
}

// Lights, the plan of their maps, and which of these are drawn.
static enum hg_status sync_lights(
    struct hg_lighting *l, struct hg_lighting_view *view, bool *has_sun, struct hg_error *err)
{
    enum hg_status status = hg_light_set_collect(&l->set, view->scene, view->origin);
    *has_sun = l->set.directional_count > 0;
    if (!status)
        status = add_sky_sun(l, &view->scene->environment);
    if (!status)
        status = hg_clusters_build(&l->cells, &l->set, view->camera, view->width, view->height);
    if (status)
        return hg_error_set(err, status, "lights", NULL, "no memory for their lists");
    status = make_plan(l, view, err);
    const bool many = l->cells.used || l->cells.overflow;
    if (!status)
        status = place_maps(l, view, many, err);
    if (!status)
        status = sync_pages(l, view, err);
    if (status)
        return status;
    l->moves = view->moves;
    defer_unseen(l, view);
    defer_maps(l, many && view->moves);
    if (l->cells.overflow)
        status = hg_light_cuts_build(&l->cuts, &l->cells, &l->set, view, l->jobs);
    return status ? hg_error_set(
                        err, status, "lights", NULL, "no memory for a tree of %u", l->set.count)
                  : HG_OK;
}

enum hg_status hg_lighting_sync(
    struct hg_lighting *l, const struct hg_lighting_view *asked, struct hg_error *err)
{
    struct hg_lighting_view view = *asked;
    struct hg_light_shared *shared = l->params.shared;
    const struct hg_env_maker maker = {l->gpu, l->jobs, l->params.store, shared->sky};
    bool has_sun;
    hg_shadow_atlases_note(atlases_of(l), l); // before the plan changes, from which it is read
    l->pages.due = 0;
    enum hg_status status = sync_lights(l, &view, &has_sun, err);
    if (!status)
        status = hg_env_device_sync(&shared->env, &maker, &view.scene->environment, has_sun, err);
    if (!status)
        status = upload_lists(l, err);
    if (status)
        return status;
    fill_block(l, &view);
    report(l);
    return HG_OK;
}

// A sunflower in the unit disk: equal areas. Source: Vogel 1979, "A better way to construct the
// sunflower head".
static struct hg_vec2 vogel_disk(uint32_t i, uint32_t n, double rotation)
{
    const double r = sqrt((i + 0.5) / n), phi = i * 2.399963229728653 + rotation;
    return (struct hg_vec2){(float)(r * cos(phi)), (float)(r * sin(phi))};
}

void hg_lighting_fill(
    const struct hg_lighting *l, uint32_t sample_index, struct hg_gpu_lighting *out)
{
    // Weyl sequences: evenly spread over any number of samples; sample 0 blends half way.
    double turn = fmod(0.6180339887498949 * sample_index, 1);
    double hand_over = fmod(0.5 + 0.7548776662466927 * sample_index, 1);
    *out = l->block;
    for (uint32_t i = 0; i < HG_SHADOW_TAPS; i++) {
        const struct hg_vec2 at = vogel_disk(i, HG_SHADOW_TAPS, turn * 2 * HG_PI);
        out->shadow_taps_px[i] =
            (struct hg_vec2){at.x * HG_SHADOW_RADIUS_PX, at.y * HG_SHADOW_RADIUS_PX};
    }
    out->shadow_dither = (float)hand_over;
}

struct hg_gpu_image *hg_lighting_image_specular(struct hg_lighting *l)
{
    return &l->params.shared->env.specular;
}

struct hg_gpu_image *hg_lighting_image_radiance(struct hg_lighting *l)
{
    return &l->params.shared->env.radiance;
}

struct hg_gpu_image *hg_lighting_image_shadow(struct hg_lighting *l)
{
    struct hg_shadow_atlas *a = l->atlas.in;
    return a && a->image.width > 0 ? &a->image : &atlases_of(l)->none;
}

uint32_t hg_lighting_shadowed_lamps(const struct hg_lighting *l)
{
    uint32_t count = 0;
    for (uint32_t i = l->set.directional_count; i < l->set.count; i++)
        count += l->set.casts[i] && !(l->set.items[i].radiance > 0);
    return count;
}

bool hg_lighting_has_sky_sun(const struct hg_lighting *l)
{
    return hg_sky_disc_is_there(&l->sun);
}

void hg_lighting_sources(const struct hg_lighting *l, struct hg_lighting_sources *out)
{
    const struct hg_gpu_lighting *b = &l->block;
    *out = (struct hg_lighting_sources){.lights = l->set.items,
        .tables = l->tabled.words,
        .casts = l->set.casts,
        .count = l->set.count,
        .directional_count = l->set.directional_count,
        .env_kind = b->env_kind,
        .env_color = {b->env_color.x, b->env_color.y, b->env_color.z},
        .env_rotation_cos = b->env_rotation_cos,
        .env_rotation_sin = b->env_rotation_sin,
        .env_faces = l->params.shared->env.coarse,
        .env_side = HG_ENV_COARSE_SIDE,
        .env_irradiance = l->params.shared->env.host_irradiance};
}

void hg_lighting_stats(const struct hg_lighting *l, struct hg_lighting_stats *out)
{
    *out = (struct hg_lighting_stats){.lights = l->set.count,
        .local_lights = l->set.count - l->set.directional_count,
        .shadowed_lights = l->plan.shadowed_lights,
        .unshadowed_lights = l->plan.unshadowed_lights,
        .shadow_maps = l->plan.count,
        .shadow_maps_deferred = l->left_out.deferred,
        .shadow_maps_unseen = l->left_out.unseen,
        .clusters = l->cells.used ? HG_CLUSTER_COUNT : 0,
        .cluster_entries = l->cells.entry_count,
        .hasty = l->left_out.deferred > 0 || (l->cells.overflow && l->moves),
        .lights_in_lists = l->cells.overflow ? l->cuts.count : l->set.count,
        .environment_ns = l->params.shared->env.prefilter_ns,
        .environment_cached = l->params.shared->env.from_cache};
    for (uint32_t i = 0; i < l->set.count; i++) {
        const struct hg_gpu_light *light = &l->set.items[i];
        out->sized_lights += light->radiance > 0;
        out->tabled_lights +=
            light->profile != HG_LIGHT_NO_TABLE || light->image != HG_LIGHT_NO_TABLE;
    }
    for (uint32_t i = 0; i < l->plan.count; i++)
        out->shadow_maps_stale += l->plan.maps[i].stale && !l->plan.maps[i].deferred;
    if (l->plan.paged)
        out->pages = l->pages.table->stats;
    for (uint32_t i = 0; i < l->plan.count; i++)
        out->shadow_maps_partly += l->plan.maps[i].stale && l->plan.maps[i].partly;
    const struct hg_env_device *env = &l->params.shared->env;
    out->device_bytes = env->specular.memory.size_bytes + env->radiance.memory.size_bytes +
                        env->irradiance.memory.size_bytes +
                        l->params.shared->dfg.memory.size_bytes + l->lights.memory.size_bytes +
                        l->shadows.memory.size_bytes + l->clusters.memory.size_bytes +
                        l->entries.memory.size_bytes + l->tabled.buffer.memory.size_bytes;
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++)
        out->atlas_bytes += atlases_of(l)->items[i].image.memory.size_bytes;
    out->device_bytes += out->atlas_bytes;
}
