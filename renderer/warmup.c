// warmup.c - compile what common frames need before the first one is asked for.
//
// Creating pipelines is not enough on drivers that compile at the first draw (lavapipe): a small
// scene made here, which has every common kind of surface, is drawn through the ordinary path.
#include <string.h>

#include "base/alloc.h"
#include "renderer/internal.h"
#include "renderer/passes/blend.h"
#include "renderer/passes/resolve.h"
#include "renderer/passes/shade.h"
#include "renderer/passes/shadow.h"
#include "renderer/passes/visibility.h"

#define SIDE_PX 16

typedef enum hg_status warm_up_fn(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err);

static warm_up_fn *const passes[] = {hg_visibility_warm_up, hg_shadow_warm_up, hg_shade_warm_up,
    hg_resolve_warm_up, hg_blend_warm_up};

#define PASSES (sizeof passes / sizeof passes[0])

// --- the scene -----------------------------------------------------------------------------------

static enum hg_status add(struct hg_scene *scene, enum hg_object_kind kind, uint64_t id, void *out)
{
    struct hg_object *object;
    const enum hg_status status = hg_scene_add(scene, kind, id, &object);
    *(void **)out = object;
    return status;
}

static enum hg_status add_texture(struct hg_scene *scene, uint64_t id, struct hg_texture **out)
{
    enum hg_status status = add(scene, HG_OBJECT_TEXTURE, id, out);
    if (status != HG_OK)
        return status;
    struct hg_image_source *source = hg_calloc(1, sizeof *source);
    if (source == NULL)
        return HG_E_NOMEM;
    source->refs = 1;
    source->label = hg_strdup("warm-up");
    (*out)->image = source; // owned by the scene from here on
    if (source->label == NULL)
        return HG_E_NOMEM;
    status = hg_image_create(8, 8, HG_PIXEL_RGBA8, NULL, &source->pixels);
    if (status == HG_OK)
        memset(source->pixels.pixels, 0x80, source->pixels.size_bytes);
    return status;
}

static void *array(const void *values, size_t size)
{
    void *copy = hg_calloc(1, size);
    if (copy != NULL)
        memcpy(copy, values, size);
    return copy;
}

static enum hg_status add_mesh(
    struct hg_scene *scene, uint64_t id, struct hg_material *material, struct hg_mesh **out)
{
    static const uint32_t indices[3] = {0, 1, 2};
    static const float positions[9] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
    static const float normals[9] = {0, 0, 1, 0, 0, 1, 0, 0, 1};
    static const float tangents[12] = {1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1};
    static const float uv[6] = {0, 0, 1, 0, 0.5f, 1};
    enum hg_status status = add(scene, HG_OBJECT_MESH, id, out);
    if (status != HG_OK)
        return status;
    struct hg_mesh_part *part = hg_calloc(1, sizeof *part);
    if (part == NULL)
        return HG_E_NOMEM;
    (*out)->parts = part;
    (*out)->part_count = 1;
    part->topology = HG_TOPOLOGY_TRIANGLES;
    part->vertex_count = part->index_count = 3;
    part->material = material;
    part->indices = array(indices, sizeof indices);
    part->positions = array(positions, sizeof positions);
    part->normals = array(normals, sizeof normals);
    part->tangents = array(tangents, sizeof tangents);
    part->uv[0] = array(uv, sizeof uv);
    memcpy(part->bounds_min, (float[3]){-1, -1, 0}, sizeof part->bounds_min);
    memcpy(part->bounds_max, (float[3]){1, 1, 0}, sizeof part->bounds_max);
    const bool whole = part->indices != NULL && part->positions != NULL && part->normals != NULL &&
                       part->tangents != NULL && part->uv[0] != NULL;
    return whole ? HG_OK : HG_E_NOMEM;
}

static enum hg_status add_surface(
    struct hg_scene *scene, uint64_t id, enum hg_alpha_mode mode, struct hg_texture *textures[2])
{
    struct hg_material *material;
    struct hg_mesh *mesh;
    struct hg_node *node;
    enum hg_status status = add(scene, HG_OBJECT_MATERIAL, id, &material);
    if (status != HG_OK)
        return status;
    material->alpha_mode = mode;
    material->base_color[3] = 0.7f;
    const int last = textures[1] != NULL ? HG_SLOT_EMISSIVE : HG_SLOT_NORMAL;
    for (int slot = HG_SLOT_BASE_COLOR; slot <= last; slot++)
        material->slots[slot].texture = textures[slot >= HG_SLOT_OCCLUSION];
    status = add_mesh(scene, id, material, &mesh);
    if (status == HG_OK)
        status = add(scene, HG_OBJECT_NODE, id, &node);
    if (status != HG_OK)
        return status;
    node->mesh = mesh;
    node->translation[2] = 0.1f * (float)id;
    return HG_OK;
}

static enum hg_status add_sun(struct hg_scene *scene)
{
    struct hg_light *light;
    struct hg_node *node;
    enum hg_status status = add(scene, HG_OBJECT_LIGHT, 10, &light);
    if (status == HG_OK)
        status = add(scene, HG_OBJECT_NODE, 10, &node);
    if (status != HG_OK)
        return status;
    light->intensity = 1.0f;
    light->casts_shadow = true;
    node->light = light;
    return HG_OK;
}

// The common kinds of scenes (HG_FEATURE_*): with and without occlusion and emission of their own,
// with and without a shadowed sun.
#define SCENES 4

static enum hg_status build(struct hg_scene *scene, uint32_t kind)
{
    struct hg_texture *textures[2] = {NULL, NULL};
    enum hg_status status = add_texture(scene, 1, &textures[0]);
    if (status == HG_OK && (kind & 1) != 0)
        status = add_texture(scene, 2, &textures[1]);
    for (uint64_t id = 1; id <= 3 && status == HG_OK; id++)
        status = add_surface(scene, id, (enum hg_alpha_mode)(id - 1), textures);
    if (status == HG_OK && (kind & 2) == 0)
        status = add_sun(scene);
    scene->environment.kind = HG_ENV_COLOR;
    scene->environment.intensity = 1.0f;
    scene->environment.color[0] = 1.0f;
    hg_scene_publish(scene);
    return status;
}

static enum hg_status draw_scene(
    struct hg_renderer *renderer, struct hg_scene *scene, struct hg_error *err)
{
    struct hg_view *view;
    struct hg_frame_info info;
    const struct hg_view_params params = {.width = SIDE_PX, .height = SIDE_PX, .samples = 1};
    enum hg_status status = hg_view_create(renderer, scene, &view, err);
    if (status != HG_OK)
        return status;
    status = hg_view_set_params(view, &params, err);
    if (status == HG_OK)
        status = hg_view_step(view, 1, &info, err);
    if (status == HG_OK)
        status = hg_view_step(view, 1, &info, err); // after motion
    for (int format = HG_PIXEL_RGBA8; format <= HG_PIXEL_RGBA32F && status == HG_OK; format++) {
        struct hg_refbuf *pixels = NULL;
        status = hg_view_read_pixels(view, (enum hg_pixel_format)format, &pixels, err);
        hg_refbuf_unref(pixels);
    }
    struct hg_pick pick;
    if (status == HG_OK)
        status = hg_view_pick(view, SIDE_PX / 2, SIDE_PX / 2, &pick, err);
    hg_view_destroy(view);
    return status;
}

// --- all of it -----------------------------------------------------------------------------------

static enum hg_status warm_scene(struct hg_renderer *renderer, uint32_t kind, struct hg_error *err)
{
    struct hg_scene *scene = NULL;
    enum hg_status status = hg_scene_create(&scene);
    if (status == HG_OK)
        status = build(scene, kind);
    if (status == HG_OK)
        status = draw_scene(renderer, scene, err);
    else
        hg_error_set(err, status, "warm-up", NULL, "out of host memory");
    hg_scene_destroy(scene);
    return status;
}

// Pipelines by name: what GPUs use, which compile when a pipeline is created.
static enum hg_status count_pipelines(
    struct hg_renderer *renderer, uint32_t counts[], uint32_t *total, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    *total = 0;
    for (size_t p = 0; p < PASSES && status == HG_OK; p++) {
        counts[p] = 0;
        if (!hg_gpu_strategy(renderer->gpu)->lazy_pipelines)
            status = passes[p](renderer->gpu, 0, &counts[p], err);
        *total += counts[p];
    }
    return status;
}

enum hg_status hg_renderer_warm_up(struct hg_renderer *renderer,
    void (*progress)(void *user, uint32_t done, uint32_t total), void *user, struct hg_error *err)
{
    uint32_t counts[PASSES] = {0}, pipelines, done = 0;
    enum hg_status status = count_pipelines(renderer, counts, &pipelines, err);
    for (size_t p = 0; p < PASSES; p++) {
        for (uint32_t i = 0; status == HG_OK && i < counts[p]; i++) {
            status = passes[p](renderer->gpu, i, &counts[p], err);
            if (progress != NULL)
                progress(user, ++done, pipelines + SCENES);
        }
    }
    for (uint32_t kind = 0; status == HG_OK && kind < SCENES; kind++) {
        status = warm_scene(renderer, kind, err);
        if (progress != NULL)
            progress(user, ++done, pipelines + SCENES);
    }
    return status == HG_OK ? hg_gpu_save_pipeline_cache(renderer->gpu, err) : status;
}
