#include "renderer/bench/scene.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/bench/mesh.h"
#include "renderer/bench/bench.h"

#define PANEL_M    4.0f
#define CORRIDOR_M 8.0f
#define OCTAVES    5

// --- the pattern ---------------------------------------------------------------------------------

// Wellons 2018, "lowbias32".
static uint32_t mix_bits(uint32_t n)
{
    n ^= n >> 16;
    n *= 0x7feb352du;
    n ^= n >> 15;
    n *= 0x846ca68bu;
    return n ^ n >> 16;
}

static float lattice(uint32_t seed, uint32_t x, uint32_t y)
{
    return (float)(mix_bits(seed ^ mix_bits(x ^ mix_bits(y))) >> 8) * (1.0f / 16777216.0f);
}

float hg_bench_noise(uint32_t seed, float x, float y)
{
    const float fx = floorf(x), fy = floorf(y);
    const uint32_t ix = (uint32_t)(int32_t)fx, iy = (uint32_t)(int32_t)fy;
    const float tx = x - fx, ty = y - fy;
    const float sx = tx * tx * (3.0f - 2.0f * tx), sy = ty * ty * (3.0f - 2.0f * ty);
    const float a = lattice(seed, ix, iy), b = lattice(seed, ix + 1, iy);
    const float c = lattice(seed, ix, iy + 1), d = lattice(seed, ix + 1, iy + 1);
    return (a + (b - a) * sx) * (1.0f - sy) + (c + (d - c) * sx) * sy;
}

static uint8_t to_byte(float v)
{
    return (uint8_t)(v <= 0.0f ? 0 : v >= 1.0f ? 255 : (int)(v * 255.0f + 0.5f));
}

// One octave along a row of texels: the corners of a cell are made once.
struct octave {
    uint32_t seed, cell, corner_y;
    float f, sy, corners[4];
};

static struct octave octave_of(uint32_t seed, uint32_t period_log2, float ty)
{
    const float f = ldexpf(1.0f, -(int)period_log2), y = ty * f, fy = floorf(y), t = y - fy;
    return (struct octave){.seed = seed,
        .cell = UINT32_MAX,
        .corner_y = (uint32_t)(int32_t)fy,
        .f = f,
        .sy = t * t * (3.0f - 2.0f * t)};
}

static float octave_at(struct octave *o, float tx)
{
    const float x = tx * o->f, fx = floorf(x), t = x - fx;
    const uint32_t cell = (uint32_t)(int32_t)fx;
    float *c = o->corners;
    for (uint32_t i = 0; cell != o->cell && i < 4; i++)
        c[i] = lattice(o->seed, cell + (i & 1), o->corner_y + (i >> 1));
    o->cell = cell;
    const float sx = t * t * (3.0f - 2.0f * t);
    return (c[0] + (c[1] - c[0]) * sx) * (1.0f - o->sy) + (c[2] + (c[3] - c[2]) * sx) * o->sy;
}

// The octaves have periods of 2^2, 2^5, 2^8, ... texels of mip 0. One whose period is less than
// four texels of the mip is grey there.
void hg_bench_pattern_row(const struct hg_bench_pattern *pattern, uint32_t mip, uint32_t x,
    uint32_t y, uint32_t width, uint8_t *rgba)
{
    const float scale = ldexpf(1.0f, (int)mip), ty = ((float)y + 0.5f) * scale;
    const float hue = (float)(mix_bits(pattern->seed) & 255u) * (6.2832f / 256.0f);
    const float tints[3] = {0.25f * cosf(hue), 0.25f * cosf(hue + 2.1f), 0.25f * cosf(hue + 4.2f)};
    struct octave octaves[OCTAVES];
    for (uint32_t o = 0; o < OCTAVES; o++)
        octaves[o] = octave_of(pattern->seed * 31u + o, 2 + 3 * o, ty);
    for (uint32_t i = 0; i < width; i++, rgba += 4) {
        const float tx = ((float)(x + i) + 0.5f) * scale;
        float sum = 0.0f, tint = 0.5f;
        for (uint32_t o = mip > 0 ? (mip + 2) / 3 : 0; o < OCTAVES; o++) {
            const float n = octave_at(&octaves[o], tx) - 0.5f;
            sum += n * 0.4f;
            tint = o == OCTAVES - 1 ? n + 0.5f : tint;
        }
        for (int c = 0; c < 3; c++)
            rgba[c] = to_byte(0.5f + sum + tints[c] * tint);
        rgba[3] = 255;
    }
}

static bool make_rectangle(void *user, const struct hg_image_rect *rect, void *pixels)
{
    const uint32_t mip = rect->mip, x = rect->at[0], y = rect->at[1];
    const uint32_t width = rect->size[0], height = rect->size[1];
    for (uint32_t j = 0; j < height; j++)
        hg_bench_pattern_row(user, mip, x, y + j, width, (uint8_t *)pixels + (size_t)j * width * 4);
    return true;
}

// --- objects -------------------------------------------------------------------------------------

enum hg_status hg_bench_scene_add(struct hg_bench_scene *s, enum hg_object_kind kind, void *out_ptr)
{
    struct hg_object *object = NULL;
    const enum hg_status status = hg_scene_add(s->scene, kind, ++s->next_id, &object);
    *(void **)out_ptr = object;
    return status;
}

enum hg_status hg_bench_scene_begin(struct hg_bench_scene *s, uint32_t tiles)
{
    *s = (struct hg_bench_scene){0};
    s->patterns = hg_calloc(tiles, sizeof *s->patterns);
    s->tiles = hg_calloc(tiles, sizeof *s->tiles);
    s->tile_count = tiles;
    enum hg_status status = s->patterns != NULL && s->tiles != NULL ? HG_OK : HG_E_NOMEM;
    return status == HG_OK ? hg_scene_create(&s->scene) : status;
}

void hg_bench_scene_finish(struct hg_bench_scene *s)
{
    hg_scene_destroy(s->scene);
    hg_free(s->tiles);
    hg_free(s->patterns);
    *s = (struct hg_bench_scene){0};
}

void hg_bench_scene_sky(struct hg_bench_scene *s)
{
    struct hg_environment *e = &s->scene->environment;
    hg_demo_environment(e);
    e->revision = s->scene->revision + 1;
    hg_scene_publish(s->scene);
}

static enum hg_status add_texture(
    struct hg_bench_scene *s, const char *label, struct hg_texture **out)
{
    enum hg_status status = hg_bench_scene_add(s, HG_OBJECT_TEXTURE, out);
    if (status != HG_OK)
        return status;
    struct hg_image_source *source = hg_calloc(1, sizeof *source);
    if (source == NULL)
        return HG_E_NOMEM;
    source->refs = 1;
    (*out)->image = source; // owned by the scene from here on
    source->label = hg_strdup(label);
    return source->label != NULL ? HG_OK : HG_E_NOMEM;
}

static uint64_t bytes_with_mips(uint64_t texels)
{
    return texels * 4 * 4 / 3;
}

// Texture number `index` of made ones.
static enum hg_status add_made(
    struct hg_bench_scene *s, uint32_t index, uint32_t side_px, struct hg_texture **out)
{
    char label[32];
    snprintf(label, sizeof label, "made %u", index);
    enum hg_status status = add_texture(s, label, out);
    if (status != HG_OK)
        return status;
    s->patterns[index].seed = index + 1;
    struct hg_image_tiles *tiles = &s->tiles[index];
    *tiles = (struct hg_image_tiles){.width = side_px,
        .height = side_px,
        .format = HG_PIXEL_RGBA8,
        .make = make_rectangle,
        .user = &s->patterns[index]};
    snprintf((char *)tiles->id, sizeof tiles->id, "bench pattern 1 %u %u", index, side_px);
    (*out)->image->tiles = tiles;
    (*out)->image->pixels_srgb = true;
    s->texture_bytes += bytes_with_mips((uint64_t)side_px * side_px);
    return HG_OK;
}

static enum hg_status add_file(struct hg_bench_scene *s, const char *path, struct hg_texture **out)
{
    enum hg_status status = add_texture(s, path, out);
    if (status != HG_OK)
        return status;
    (*out)->image->path = hg_strdup(path);
    return (*out)->image->path != NULL ? HG_OK : HG_E_NOMEM;
}

// A quad around the origin in the plane z = 0, facing +z.
static enum hg_status add_quad(struct hg_bench_scene *s, float side_m, struct hg_texture *texture,
    bool unlit, struct hg_mesh **out)
{
    struct hg_material *material;
    enum hg_status status = hg_bench_scene_add(s, HG_OBJECT_MATERIAL, &material);
    if (status != HG_OK)
        return status;
    material->metallic = 0.0f;
    material->roughness = 0.7f;
    material->unlit = unlit;
    material->slots[HG_SLOT_BASE_COLOR].texture = texture;
    return hg_bench_mesh_quad(s, side_m, material, out);
}

// --- the gallery ---------------------------------------------------------------------------------

static void place_panel(struct hg_node *node, uint32_t index)
{
    const float turn = (float)M_PI_2, row = (float)(index / 2);
    const bool left = index % 2 == 0;
    node->translation[0] = (left ? -0.5f : 0.5f) * CORRIDOR_M;
    node->translation[1] = 0.5f * PANEL_M;
    node->translation[2] = -PANEL_M * (row + 0.5f);
    node->rotation[1] = sinf((left ? 0.5f : -0.5f) * turn); // faces the other wall
    node->rotation[3] = cosf(0.5f * turn);
}

static enum hg_status add_panels(const struct hg_bench_gallery *g, struct hg_bench_scene *s)
{
    const uint32_t count = g->made + g->image_count;
    struct hg_mesh **meshes = hg_calloc(count, sizeof *meshes);
    enum hg_status status = meshes != NULL ? HG_OK : HG_E_NOMEM;
    for (uint32_t i = 0; i < count && status == HG_OK; i++) {
        struct hg_texture *texture;
        status = i < g->made ? add_made(s, i, g->side_px, &texture)
                             : add_file(s, g->images[i - g->made], &texture);
        if (status == HG_OK)
            status = add_quad(s, PANEL_M, texture, false, &meshes[i]);
    }
    for (uint32_t i = 0; i < g->panels && status == HG_OK; i++) {
        struct hg_node *node;
        status = hg_bench_scene_add(s, HG_OBJECT_NODE, &node);
        if (status != HG_OK)
            break;
        node->mesh = meshes[i % count];
        place_panel(node, i);
    }
    hg_free(meshes);
    return status;
}

enum hg_status hg_bench_gallery_make(
    const struct hg_bench_gallery *g, struct hg_bench_scene *s, struct hg_error *err)
{
    enum hg_status status = hg_bench_scene_begin(s, g->made);
    if (status == HG_OK)
        status = add_panels(g, s);
    if (status != HG_OK) {
        hg_bench_scene_finish(s);
        return hg_error_set(err, status, "bench", NULL, "no memory for the gallery");
    }
    s->texture_bytes += bytes_with_mips(g->image_texels);
    hg_bench_scene_sky(s);
    return HG_OK;
}

void hg_bench_gallery_pose(
    const struct hg_bench_gallery *g, uint32_t at, uint32_t count, struct hg_bench_pose *pose)
{
    const float length = PANEL_M * (float)((g->panels + 1) / 2);
    const float t = (float)at / (float)count, turn = 2.0f * (float)M_PI * t;
    const float swing = 0.9f * sinf(5.0f * turn), heading = t < 0.5f ? 0.0f : (float)M_PI;
    const float along = t < 0.5f ? 2.0f * t : 2.0f - 2.0f * t;
    pose->eye[0] = 1.5f * sinf(3.0f * turn);
    pose->eye[1] = 0.45f * PANEL_M + 0.5f * sinf(7.0f * turn);
    pose->eye[2] = -length * along;
    pose->target[0] = pose->eye[0] + sinf(heading + swing);
    pose->target[1] = pose->eye[1];
    pose->target[2] = pose->eye[2] - cosf(heading + swing);
}

void hg_bench_gallery_walk(uint32_t at, struct hg_bench_pose *pose)
{
    const float heading = 0.5f * sinf((float)at * (2.0f * (float)M_PI / 60.0f));
    pose->eye[0] = 0.0f;
    pose->eye[1] = 0.45f * PANEL_M;
    pose->eye[2] = -0.2f * (float)at;
    pose->target[0] = sinf(heading);
    pose->target[1] = pose->eye[1];
    pose->target[2] = pose->eye[2] - cosf(heading);
}

// --- the sheet -----------------------------------------------------------------------------------

enum hg_status hg_bench_sheet_make(uint32_t side_px, struct hg_bench_scene *s, struct hg_error *err)
{
    struct hg_texture *texture;
    struct hg_mesh *mesh;
    struct hg_node *node;
    enum hg_status status = hg_bench_scene_begin(s, 1);
    if (status == HG_OK)
        status = add_made(s, 0, side_px, &texture);
    if (status == HG_OK)
        status = add_quad(s, 0.001f * (float)side_px, texture, true, &mesh);
    if (status == HG_OK)
        status = hg_bench_scene_add(s, HG_OBJECT_NODE, &node);
    if (status != HG_OK) {
        hg_bench_scene_finish(s);
        return hg_error_set(err, status, "bench", NULL, "no memory for the sheet");
    }
    node->mesh = mesh;
    s->scene->environment.kind = HG_ENV_NONE;
    hg_scene_publish(s->scene);
    return HG_OK;
}
