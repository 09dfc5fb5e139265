// terrain.c - terrain and statues: many triangles, few of them on the screen.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/bench/mesh.h"
#include "renderer/bench/bench.h"

#define SIDE_M   900.0f // of the terrain without copies, however many tiles it has
#define RELIEF_M 40.0f
#define STATUE_M 5.0f
#define DETAIL_M 0.15f

struct heights {
    const struct hg_image *image;
    float low, scale;     // of the image's red: metres = (red - low) * scale
    uint32_t x, z, tiles; // of this tile
};

static float image_height(const struct heights *h, float u, float v)
{
    const struct hg_image *image = h->image;
    const float x = u * (float)(image->width - 1), y = v * (float)(image->height - 1);
    const uint32_t ix = (uint32_t)x, iy = (uint32_t)y;
    const uint32_t jx = ix + 1 < image->width ? ix + 1 : ix;
    const uint32_t jy = iy + 1 < image->height ? iy + 1 : iy;
    const uint16_t *texels = image->pixels;
    const float fx = x - (float)ix, fy = y - (float)iy;
    const float a = texels[4 * ((size_t)iy * image->width + ix)];
    const float b = texels[4 * ((size_t)iy * image->width + jx)];
    const float c = texels[4 * ((size_t)jy * image->width + ix)];
    const float d = texels[4 * ((size_t)jy * image->width + jx)];
    const float red = (a + (b - a) * fx) * (1.0f - fy) + (c + (d - c) * fx) * fy;
    return (red - h->low) * h->scale;
}

static float made_height(float u, float v)
{
    float sum = 0.0f, weight = 0.6f, scale = 4.0f;
    for (uint32_t o = 0; o < 8; o++, weight *= 0.45f, scale *= 2.0f)
        sum += weight * hg_bench_noise(100 + o, u * scale, v * scale);
    return RELIEF_M * sum;
}

// Every second tile is mirrored, so that neighbours meet; detail fades out towards the borders.
static float tile_height(const void *user, float u, float v)
{
    const struct heights *h = user;
    const float mu = h->x % 2 == 0 ? u : 1.0f - u, mv = h->z % 2 == 0 ? v : 1.0f - v;
    const float fade = 16.0f * u * (1.0f - u) * v * (1.0f - v);
    const float detail = hg_bench_noise(1000 + h->z * h->tiles + h->x, 300.0f * u, 300.0f * v);
    const float base = h->image != NULL ? image_height(h, mu, mv) : made_height(mu, mv);
    return base / (float)h->tiles + DETAIL_M * fade * detail;
}

static void measure(struct heights *h)
{
    const uint16_t *texels = h->image->pixels;
    const size_t count = (size_t)h->image->width * h->image->height;
    float low = texels[0], high = low;
    for (size_t i = 1; i < count; i++) {
        low = fminf(low, texels[4 * i]);
        high = fmaxf(high, texels[4 * i]);
    }
    h->low = low;
    h->scale = high > low ? RELIEF_M / (high - low) : 0.0f;
}

static enum hg_status add_material(
    struct hg_bench_scene *s, float r, float g, float b, struct hg_material **out)
{
    enum hg_status status = hg_bench_scene_add(s, HG_OBJECT_MATERIAL, out);
    if (status != HG_OK)
        return status;
    (*out)->base_color[0] = r;
    (*out)->base_color[1] = g;
    (*out)->base_color[2] = b;
    (*out)->metallic = 0.0f;
    (*out)->roughness = 0.8f;
    return HG_OK;
}

// Which of the terrain's meshes is the tile at a place of the grid: neighbours meet where one is
// mirrored and the other is not.
static uint32_t mesh_at(const struct hg_bench_terrain *terrain, uint32_t at)
{
    const uint32_t fitting = (terrain->tiles + 1 - at % 2) / 2;
    return terrain->copies < 2 ? at : fitting > 0 ? at % 2 + 2 * (at / 2 % fitting) : 0;
}

static uint32_t tiles_per_side(const struct hg_bench_terrain *terrain)
{
    return terrain->tiles * (terrain->copies > 1 ? terrain->copies : 1);
}

// All places of one mesh.
static enum hg_status place_tiles(
    const struct hg_bench_terrain *terrain, const struct heights *h, struct hg_node *node)
{
    const uint32_t side = tiles_per_side(terrain);
    const float side_m = SIDE_M / (float)terrain->tiles, corner_m = -0.5f * side_m * (float)side;
    node->instances = hg_calloc((size_t)side * side, sizeof *node->instances);
    if (node->instances == NULL)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < side * side; i++) {
        const uint32_t x = i % side, z = i / side;
        if (mesh_at(terrain, x) != h->x || mesh_at(terrain, z) != h->z)
            continue;
        float *m = node->instances[node->instance_count++];
        memset(m, 0, 16 * sizeof *m);
        m[0] = m[5] = m[10] = 1.0f;
        m[12] = corner_m + side_m * (float)x;
        m[14] = corner_m + side_m * (float)z;
        m[15] = 1.0f;
    }
    return HG_OK;
}

static enum hg_status add_tiles(const struct hg_bench_terrain *terrain, struct heights *h,
    struct hg_jobs *jobs, struct hg_bench_scene *s)
{
    struct hg_material *material;
    const float side_m = SIDE_M / (float)terrain->tiles;
    enum hg_status status = add_material(s, 0.30f, 0.33f, 0.22f, &material);
    for (uint32_t i = 0; i < terrain->tiles * terrain->tiles && status == HG_OK; i++) {
        struct hg_mesh *mesh;
        struct hg_node *node;
        h->x = i % terrain->tiles;
        h->z = i / terrain->tiles;
        const struct hg_bench_grid grid = {
            .cells = terrain->cells, .side_m = side_m, .height = tile_height, .user = h};
        status = hg_bench_mesh_grid(s, &grid, material, jobs, &mesh);
        if (status == HG_OK)
            status = hg_bench_scene_add(s, HG_OBJECT_NODE, &node);
        if (status != HG_OK)
            break;
        node->mesh = mesh;
        if (terrain->copies > 1) {
            status = place_tiles(terrain, h, node);
            continue;
        }
        node->translation[0] = side_m * (float)h->x - 0.5f * SIDE_M;
        node->translation[2] = side_m * (float)h->z - 0.5f * SIDE_M;
    }
    return status;
}

// Height of the terrain at a place of the whole, 0..1.
static float ground(const struct hg_bench_terrain *terrain, struct heights *h, float u, float v)
{
    const uint32_t side = tiles_per_side(terrain);
    const float tu = u * (float)side, tv = v * (float)side;
    const uint32_t x = (uint32_t)tu < side ? (uint32_t)tu : side - 1;
    const uint32_t z = (uint32_t)tv < side ? (uint32_t)tv : side - 1;
    h->x = mesh_at(terrain, x);
    h->z = mesh_at(terrain, z);
    return tile_height(h, tu - (float)x, tv - (float)z);
}

// A row of `columns` squares; statue number `i` stands in its square, turned its own way.
static void place_statue(const struct hg_bench_terrain *terrain, struct heights *h,
    const float size[2], uint32_t i, float m[16])
{
    const uint32_t columns = (uint32_t)ceilf(sqrtf((float)terrain->statues));
    const float jx = hg_bench_noise(50, (float)i * 1.7f, 0.5f) - 0.5f;
    const float jz = hg_bench_noise(51, (float)i * 1.3f, 0.5f) - 0.5f;
    const float u = ((float)(i % columns) + 0.5f + 0.5f * jx) / (float)columns;
    const float v = ((float)(i / columns) + 0.5f + 0.5f * jz) / (float)columns;
    const float scale = STATUE_M / size[1], turn = 2.4f * (float)i;
    const float side_m = SIDE_M * (float)tiles_per_side(terrain) / (float)terrain->tiles;
    memset(m, 0, 16 * sizeof *m);
    m[0] = m[10] = scale * cosf(turn);
    m[8] = scale * sinf(turn);
    m[2] = -m[8];
    m[5] = scale;
    m[12] = (u - 0.5f) * side_m;
    m[13] = ground(terrain, h, u, v) - scale * size[0];
    m[14] = (v - 0.5f) * side_m;
    m[15] = 1.0f;
}

// The mesh of the asset that has the most triangles; its own nodes are hidden.
static struct hg_mesh *statue_of(struct hg_asset *asset)
{
    struct hg_mesh *best = NULL;
    uint32_t most = 0;
    for (uint32_t i = 0; i < asset->mesh_count; i++) {
        const struct hg_mesh *mesh = asset->meshes[i];
        for (uint32_t p = 0; p < mesh->part_count; p++) {
            if (mesh->parts[p].index_count > most) {
                most = mesh->parts[p].index_count;
                best = asset->meshes[i];
            }
        }
    }
    for (uint32_t i = 0; i < asset->node_count; i++)
        asset->nodes[i]->visible = false;
    return best;
}

static enum hg_status statue_mesh(
    struct hg_bench_terrain *terrain, struct hg_bench_scene *s, struct hg_mesh **out)
{
    struct hg_material *material;
    struct hg_asset *asset = terrain->statue;
    enum hg_status status = add_material(s, 0.55f, 0.5f, 0.42f, &material);
    if (status != HG_OK)
        return status;
    if (asset == NULL)
        return hg_bench_mesh_ball(s, terrain->cells * 3 / 16 + 2, material, out);
    *out = statue_of(asset);
    if (*out == NULL)
        return HG_E_INVAL;
    if (terrain->thin > 1)
        status = hg_bench_mesh_decimate(*out, terrain->thin);
    for (uint32_t p = 0; p < (*out)->part_count; p++)
        s->unique_triangles += (*out)->parts[p].index_count / 3;
    if (status != HG_OK)
        return status;
    status = hg_scene_add_asset(s->scene, asset, NULL);
    if (status == HG_OK)
        terrain->statue = NULL; // the scene's
    return status;
}

static enum hg_status add_statues(
    struct hg_bench_terrain *terrain, struct heights *h, struct hg_bench_scene *s)
{
    struct hg_mesh *mesh;
    struct hg_node *node;
    enum hg_status status = statue_mesh(terrain, s, &mesh);
    if (status == HG_OK)
        status = hg_bench_scene_add(s, HG_OBJECT_NODE, &node);
    if (status != HG_OK)
        return status;
    float size[2] = {mesh->parts[0].bounds_min[1], mesh->parts[0].bounds_max[1]};
    size[1] = fmaxf(size[1] - size[0], 1e-6f);
    node->mesh = mesh;
    node->instances = hg_calloc(terrain->statues, sizeof *node->instances);
    if (node->instances == NULL)
        return HG_E_NOMEM;
    node->instance_count = terrain->statues;
    for (uint32_t i = 0; i < terrain->statues; i++)
        place_statue(terrain, h, size, i, node->instances[i]);
    return HG_OK;
}

enum hg_status hg_bench_terrain_make(const struct hg_bench_terrain *params, struct hg_jobs *jobs,
    struct hg_bench_scene *s, struct hg_error *err)
{
    struct hg_bench_terrain terrain = *params;
    if (terrain.thin > 1)
        terrain.cells = (uint32_t)fmaxf((float)terrain.cells / sqrtf((float)terrain.thin), 1.0f);
    struct heights h = {.image = terrain.heights, .tiles = terrain.tiles};
    if (h.image != NULL)
        measure(&h);
    hg_spill_begin(NULL);
    enum hg_status status = hg_bench_scene_begin(s, 0);
    if (status == HG_OK)
        status = add_tiles(&terrain, &h, jobs, s);
    if (status == HG_OK && terrain.statues > 0)
        status = add_statues(&terrain, &h, s);
    hg_asset_destroy(terrain.statue);
    hg_spill_end();
    if (status != HG_OK) {
        hg_bench_scene_finish(s);
        return hg_error_set(err, status, "bench", NULL,
            status == HG_E_INVAL ? "the statue's file has no mesh" : "no memory for the terrain");
    }
    hg_bench_scene_sky(s);
    return HG_OK;
}

void hg_bench_terrain_pose(uint32_t at, uint32_t count, struct hg_bench_pose *pose)
{
    const float t = (float)at / (float)count;
    pose->eye[0] = 60.0f * sinf(2.0f * (float)M_PI * t);
    pose->eye[1] = RELIEF_M + 25.0f;
    pose->eye[2] = SIDE_M * (0.45f - 0.4f * t);
    pose->target[0] = pose->eye[0] + 0.2f * sinf(4.0f * (float)M_PI * t);
    pose->target[1] = pose->eye[1] - 0.45f;
    pose->target[2] = pose->eye[2] - 1.0f;
}
