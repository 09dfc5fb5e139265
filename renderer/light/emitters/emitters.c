// Emitters on the device. See emitters.h.
#include "renderer/light/emitters/emitters.h"

#include <math.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/hash.h"
#include "renderer/light/emitters/emitter_leaves.h"
#include "renderer/light/emitters/emitter_lights.h"
#include "renderer/light/emitters/emitter_sources.h"
#include "renderer/light/env/env_warp.h"
#include "renderer/light/emitters/light_tree.h"
#include "renderer/light/env/sky_cache.h"
#include "renderer/math/vec.h"

// Of the disc in the image of a sky: its own radius, a texel of soft edge, and the diagonal of a
// texel that bilinear lookups spread it over.
#define SKY_SUN_RAD 0.0195f

#define BUDGET     (96ull << 20)
#define LEAF_BYTES (2 * sizeof(struct hg_gpu_light_node) + sizeof(struct hg_gpu_emitter_leaf) + 4)

struct hg_emitters {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    uint64_t budget_bytes;
    struct hg_sky_cache *sky;
    struct hg_emitter_lights lights;
    struct hg_emitter_sources sources;
    uint64_t signature; // of what the tables show; 0: nothing
    uint64_t env_signature;
    uint32_t environment_levels;
    float environment_mean; // 0: black
    struct hg_gpu_buffer nodes, leaves, trails, weights, pieces, draw_pieces, light_table,
        directional, environment, lamp_nodes;
    struct hg_gpu_emitters block;
    struct hg_emitters_stats stats;
};

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "emitters", NULL, "no memory for tables of lights");
}

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_emitters_create(struct hg_gpu *gpu, struct hg_jobs *jobs,
    const struct hg_emitters_params *params, struct hg_emitters **out, struct hg_error *err)
{
    *out = hg_calloc(1, sizeof **out);
    if (!*out)
        return no_memory(err);
    (*out)->gpu = gpu;
    (*out)->jobs = jobs;
    (*out)->budget_bytes = params && params->budget_bytes ? params->budget_bytes : BUDGET;
    (*out)->sky = params ? params->sky : NULL;
    return HG_OK;
}

#define BUFFERS 10
static void list_buffers(struct hg_emitters *e, struct hg_gpu_buffer *out[BUFFERS])
{
    struct hg_gpu_buffer *all[BUFFERS] = {&e->nodes, &e->leaves, &e->trails, &e->weights,
        &e->pieces, &e->draw_pieces, &e->light_table, &e->directional, &e->environment,
        &e->lamp_nodes};
    memcpy(out, all, sizeof all);
}

void hg_emitters_destroy(struct hg_emitters *e)
{
    if (!e)
        return;
    struct hg_gpu_buffer *buffers[BUFFERS];
    list_buffers(e, buffers);
    for (int i = 0; i < BUFFERS; i++)
        hg_gpu_buffer_destroy(e->gpu, buffers[i]);
    hg_emitter_sources_finish(&e->sources);
    hg_emitter_lights_finish(&e->lights);
    hg_free(e);
}

static enum hg_status put(struct hg_emitters *e, struct hg_gpu_buffer *buffer, const char *name,
    const void *data, uint64_t bytes, struct hg_error *err)
{
    if (!bytes)
        return HG_OK;
    enum hg_status status =
        hg_gpu_buffer_reserve(e->gpu, HG_GPU_BUFFER_DEVICE, bytes, name, buffer, err);
    return status ? status : hg_gpu_buffer_upload(e->gpu, buffer, 0, data, bytes, err);
}

// --- upload --------------------------------------------------------------------------------------

static enum hg_status upload_lights(struct hg_emitters *e, struct hg_error *err)
{
    const struct hg_emitter_lights *l = &e->lights;
    float *shares = hg_calloc((size_t)l->directional_count + 1, sizeof *shares);
    if (!shares)
        return no_memory(err);
    hg_emitter_lights_shares(l, shares);
    struct hg_light_tree tree;
    enum hg_status status = hg_emitter_lights_tree(l, e->jobs, &tree) ? no_memory(err) : HG_OK;
    if (!status)
        status = put(e, &e->lamp_nodes, "emitters: lamps", tree.nodes,
            tree.node_count * sizeof *tree.nodes, err);
    e->block.lamp_node_count = tree.node_count;
    hg_light_tree_finish(&tree);
    if (!status)
        status = put(e, &e->light_table, "emitters: lights", l->items,
            (l->move ? 2 : 1) * l->count * sizeof *l->items, err);
    if (!status)
        status = put(e, &e->directional, "emitters: directional", shares,
            l->directional_count * sizeof *shares, err);
    hg_free(shares);
    return status;
}

static enum hg_status upload_pieces(
    struct hg_emitters *e, uint32_t shift, uint32_t draw_count, struct hg_error *err)
{
    const struct hg_emitter_sources *s = &e->sources;
    struct hg_gpu_emitter_piece *pieces = hg_calloc((size_t)s->count + 1, sizeof *pieces);
    uint32_t *first = hg_calloc((size_t)draw_count + 1, sizeof *first), draw = 0;
    enum hg_status status = pieces && first ? HG_OK : no_memory(err);
    for (uint32_t i = 0; i < s->count && !status; i++) {
        const struct hg_ray_geometry_piece *p = s->items[i].part->piece;
        pieces[i] = (struct hg_gpu_emitter_piece){
            p->first_primitive, p->triangle_count, s->items[i].first_leaf, shift};
        while (draw <= p->draw && draw < draw_count)
            first[draw++] = i;
    }
    while (draw <= draw_count && !status)
        first[draw++] = s->count;
    if (!status)
        status = put(e, &e->pieces, "emitters: pieces", pieces, s->count * sizeof *pieces, err);
    if (!status)
        status = put(e, &e->draw_pieces, "emitters: draws", first,
            ((uint64_t)draw_count + 1) * sizeof *first, err);
    hg_free(pieces);
    hg_free(first);
    return status;
}

static enum hg_status upload_tree(struct hg_emitters *e, const struct hg_emitter_leaves *l,
    const struct hg_light_tree *tree, uint32_t leaves, uint32_t weights, struct hg_error *err)
{
    enum hg_status status =
        put(e, &e->nodes, "light tree", tree->nodes, tree->node_count * sizeof *tree->nodes, err);
    if (!status)
        status = put(e, &e->leaves, "emitters: leaves", l->leaves, leaves * sizeof *l->leaves, err);
    if (!status)
        status = put(
            e, &e->trails, "emitters: trails", tree->trails, leaves * sizeof *tree->trails, err);
    if (!status)
        status = put(
            e, &e->weights, "emitters: weights", l->weights, ((uint64_t)weights + 1) / 2 * 4, err);
    e->block.node_count = tree->node_count;
    e->block.leaf_count = leaves;
    e->stats.leaves = tree->leaf_count;
    e->stats.depth = tree->depth;
    return status;
}

// --- the tree ------------------------------------------------------------------------------------

static struct hg_emitter_plan plan_leaves(struct hg_emitters *e, uint32_t light_leaves)
{
    const uint64_t lights = (uint64_t)light_leaves * LEAF_BYTES;
    const uint64_t room = e->budget_bytes > lights ? e->budget_bytes - lights : 0;
    const struct hg_emitter_plan plan = hg_emitter_sources_plan(&e->sources, room, LEAF_BYTES);
    if (plan.left_out && plan.left_out != e->stats.left_out)
        hg_warn(LIGHT,
            "%llu emissive triangles do not fit %llu MiB: only rays that meet them see their light",
            (unsigned long long)plan.left_out, (unsigned long long)(e->budget_bytes >> 20));
    e->stats.left_out = plan.left_out;
    return plan;
}

// After the leaves of triangles.
static void fill_lights(const struct hg_emitter_lights *lights, const struct hg_emitter_leaves *out,
    uint32_t first_leaf)
{
    for (uint32_t i = lights->directional_count; i < lights->count; i++) {
        const uint32_t leaf = first_leaf + i - lights->directional_count;
        out->items[leaf] = hg_emitter_lights_leaf(lights, i);
        out->leaves[leaf] = (struct hg_gpu_emitter_leaf){.draw = i, .count = HG_EMITTER_IS_LIGHT};
    }
}

static enum hg_status build(
    struct hg_emitters *e, const struct hg_emitter_input *in, struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns();
    const uint32_t light_leaves = e->lights.count - e->lights.directional_count;
    const struct hg_emitter_plan plan = plan_leaves(e, light_leaves);
    const uint32_t leaves = plan.leaf_count + light_leaves;
    struct hg_light_tree tree = {0};
    const struct hg_emitter_leaves l = {.items = hg_calloc((size_t)leaves + 1, sizeof *l.items),
        .leaves = hg_calloc((size_t)leaves + 1, sizeof *l.leaves),
        .weights = hg_calloc((size_t)plan.weight_count + 2, sizeof *l.weights)};
    enum hg_status status = l.items && l.leaves && l.weights ? HG_OK : no_memory(err);
    if (!status) {
        hg_emitter_leaves_fill(&l, &e->sources, &plan, e->jobs);
        fill_lights(&e->lights, &l, plan.leaf_count);
        if (hg_light_tree_build(l.items, leaves, e->jobs, &tree))
            status = no_memory(err);
    }
    if (!status)
        status = upload_tree(e, &l, &tree, leaves, plan.weight_count, err);
    if (!status)
        status = upload_pieces(e, plan.shift, in->draw_count, err);
    if (!status)
        status = upload_lights(e, err);
    e->block.draw_count = in->draw_count;
    e->block.first_lamp_leaf = plan.leaf_count;
    e->stats.run = 1u << plan.shift;
    e->stats.builds++;
    e->stats.build_ns = hg_clock_now_ns() - begin;
    hg_light_tree_finish(&tree);
    hg_free(l.items);
    hg_free(l.leaves);
    hg_free(l.weights);
    return status;
}

// --- environment ---------------------------------------------------------------------------------

// What the image shows; 0: there is none.
static uint64_t environment_signature(const struct hg_environment *env)
{
    uint64_t h = hg_hash_mix(1, env->kind);
    if (env->kind == HG_ENV_SKY) {
        h = hg_hash_mix_bytes(h, env->sun_direction, sizeof env->sun_direction);
        return hg_hash_mix_bytes(h, &env->turbidity, sizeof env->turbidity) | 1;
    }
    if (env->kind != HG_ENV_IMAGE || !env->image.pixels)
        return 0;
    h = hg_hash_mix_bytes(h, env->image_hash, sizeof env->image_hash);
    h = hg_hash_mix(h, (uint64_t)(uintptr_t)env->image.pixels);
    return hg_hash_mix(hg_hash_mix(h, env->revision),
               (uint64_t)env->image.width << 32 | env->image.height) |
           1;
}

static enum hg_status make_warp(
    struct hg_emitters *e, const struct hg_environment *env, struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns();
    const struct hg_image *image = &env->image;
    struct hg_sky_cache own = {0};
    struct hg_env_warp warp = {0};
    enum hg_status status = HG_OK;
    const struct hg_sky sky = hg_sky_of(env, true); // its disc is a light (emitter_lights.c)
    if (env->kind == HG_ENV_SKY)
        status = hg_sky_cache_render(e->sky ? e->sky : &own, &sky, e->jobs, &image);
    if (!status)
        status = hg_env_warp_make(image, e->jobs, &warp);
    hg_sky_cache_finish(&own);
    status = status ? no_memory(err)
                    : put(e, &e->environment, "emitters: environment", warp.quads,
                          (uint64_t)warp.quad_count * sizeof *warp.quads, err);
    e->environment_levels = warp.levels;
    e->environment_mean = warp.mean;
    hg_env_warp_finish(&warp);
    e->stats.warps++;
    e->stats.warp_ns = hg_clock_now_ns() - begin;
    return status;
}

static enum hg_status sync_environment(
    struct hg_emitters *e, const struct hg_environment *env, struct hg_error *err)
{
    const uint64_t signature = environment_signature(env);
    enum hg_status status = HG_OK;
    if (signature && signature != e->env_signature)
        status = make_warp(e, env, err);
    if (status)
        e->env_signature = 0;
    else if (signature)
        e->env_signature = signature;
    struct hg_gpu_emitters *b = &e->block;
    const bool image = signature && e->environment_mean > 0;
    b->environment_kind = image ? HG_ENV_KIND_IMAGE : HG_ENV_KIND_NONE;
    if (env->kind == HG_ENV_COLOR &&
        hg_emitter_luminance(env->color[0], env->color[1], env->color[2]) > 0)
        b->environment_kind = HG_ENV_KIND_COLOR;
    if (!(env->intensity > 0) || !isfinite(env->intensity))
        b->environment_kind = HG_ENV_KIND_NONE;
    b->environment_levels = e->environment_levels;
    b->environment_mean = image ? e->environment_mean : 1;
    return status;
}

// --- the whole -----------------------------------------------------------------------------------

static void count_bytes(struct hg_emitters *e)
{
    struct hg_gpu_buffer *buffers[BUFFERS];
    list_buffers(e, buffers);
    e->stats.bytes = 0;
    for (int i = 0; i < BUFFERS; i++)
        e->stats.bytes += buffers[i]->memory.size_bytes;
    if (e->stats.bytes > e->stats.peak_bytes)
        e->stats.peak_bytes = e->stats.bytes;
}

static void fill_addresses(struct hg_emitters *e)
{
    struct hg_gpu_emitters *b = &e->block;
    b->nodes = e->nodes.address;
    b->leaves = e->leaves.address;
    b->trails = e->trails.address;
    b->weights = e->weights.address;
    b->pieces = e->pieces.address;
    b->draw_pieces = e->draw_pieces.address;
    b->lights = b->lights_before = e->light_table.address;
    if (e->lights.move)
        b->lights_before += e->lights.count * sizeof *e->lights.items;
    b->directional = e->directional.address;
    b->environment = e->environment.address;
    b->lamp_nodes = e->lamp_nodes.address;
    b->sized_suns = e->lights.sized_suns;
    b->directional_count = e->lights.directional_count;
    b->directional_lux = e->lights.directional_lux;
    const float *sun = e->lights.sun.towards_ws;
    b->sky_sun_ws = (struct hg_vec3){sun[0], sun[1], sun[2]};
    b->sky_sun_cos = hg_sky_disc_is_there(&e->lights.sun) ? cosf(SKY_SUN_RAD) : 2;
}

enum hg_status hg_emitters_update(
    struct hg_emitters *e, const struct hg_emitter_input *in, struct hg_error *err)
{
    uint64_t signature = hg_hash_mix(1, e->budget_bytes);
    enum hg_status status = HG_OK;
    if (hg_emitter_lights_collect(&e->lights, in->scene, in->origin, &signature) ||
        hg_emitter_sources_collect(&e->sources, in, &signature))
        status = no_memory(err);
    e->stats.triangles = e->sources.triangles;
    signature |= 1;
    if (!status && signature != e->signature)
        status = build(e, in, err);
    if (!status) {
        e->signature = signature;
        status = sync_environment(e, &in->scene->environment, err);
    }
    count_bytes(e);
    if (status) {
        e->signature = 0;
        e->block = (struct hg_gpu_emitters){0};
        return status;
    }
    fill_addresses(e);
    e->stats.directional = e->lights.directional_count;
    e->stats.punctual = e->lights.count - e->lights.directional_count;
    return HG_OK;
}

void hg_emitters_move_lights(
    struct hg_emitters *e, const struct hg_light_set *opening, const struct hg_light_set *closing)
{
    e->lights.opening = opening;
    e->lights.closing = closing;
}

void hg_emitters_fill(const struct hg_emitters *e, struct hg_gpu_emitters *out)
{
    *out = e->block;
}

void hg_emitters_stats(const struct hg_emitters *e, struct hg_emitters_stats *out)
{
    *out = e->stats;
}
