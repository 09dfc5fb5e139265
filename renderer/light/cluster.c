#include "renderer/light/cluster.h"

#include "base/alloc.h"
#include "renderer/math/vec.h"

// A light's sphere as the camera sees it.
struct sphere {
    float x, y, depth, radius; // x right, y down, metres
};

struct cluster_view {
    const struct hg_gpu_camera *camera;
    float scale_x, scale_y;   // view x / depth (or x) to -1..1
    float margin_x, margin_y; // one pixel and a half
    struct hg_cluster_slices slices;
};

struct cell_range {
    int x0, x1, y0, y1; // inclusive; empty when x1 < x0
};

static struct sphere view_sphere(
    const struct hg_gpu_camera *camera, const struct hg_gpu_light *light)
{
    const float *m = camera->view.m, *p = (const float *)&light->position_ws;
    float y = m[1] * p[0] + m[5] * p[1] + m[9] * p[2] + m[13];
    return (struct sphere){m[0] * p[0] + m[4] * p[1] + m[8] * p[2] + m[12],
        camera->proj.m[5] < 0 ? -y : y, -(m[2] * p[0] + m[6] * p[1] + m[10] * p[2] + m[14]),
        hg_gpu_light_range(light)};
}

// Depth at which slice k begins. The first begins at the eye, the last never ends.
static float slice_depth(const struct cluster_view *view, int k)
{
    if (k <= 0)
        return view->camera->orthographic ? -INFINITY : 0;
    return k >= HG_CLUSTER_Z ? INFINITY : hg_cluster_slice_depth(&view->slices, k);
}

struct tile_axis {
    bool orthographic;
    float scale, margin; // as in cluster_view
    int tiles;
};

// Tiles of [low, high] seen at depths [z0, z1], on one axis.
static void tile_range(
    const struct tile_axis *axis, float low, float high, float z0, float z1, int out[2])
{
    if (!axis->orthographic) {
        if (z0 <= 1e-6f) {
            out[0] = 0;
            out[1] = axis->tiles - 1;
            return;
        }
        low /= low < 0 ? z0 : z1;
        high /= high < 0 ? z1 : z0;
    }
    const float tiles = (float)axis->tiles;
    float a = ((low * axis->scale - axis->margin) * 0.5f + 0.5f) * tiles;
    float b = ((high * axis->scale + axis->margin) * 0.5f + 0.5f) * tiles;
    out[0] = (int)hg_clampf(floorf(a), 0, tiles);
    out[1] = (int)hg_clampf(floorf(b), -1, tiles - 1);
}

static struct cell_range slice_cells(const struct cluster_view *view, const struct sphere *s, int k)
{
    // Slack for rounding: the shader's log2 may put a depth into the neighbouring slice.
    float z0 = fmaxf(slice_depth(view, k) * 0.9999f, s->depth - s->radius);
    float z1 = fminf(slice_depth(view, k + 1) * 1.0001f, s->depth + s->radius);
    float dz = fmaxf(0, fmaxf(z0 - s->depth, s->depth - z1));
    if (z1 < z0 || dz > s->radius || (z1 <= 0 && !view->camera->orthographic))
        return (struct cell_range){0, -1, 0, -1};
    float r = sqrtf(fmaxf(0, s->radius * s->radius - dz * dz)) * 1.0001f;
    int x[2], y[2];
    const bool orthographic = view->camera->orthographic;
    const struct tile_axis across = {orthographic, view->scale_x, view->margin_x, HG_CLUSTER_X};
    const struct tile_axis down = {orthographic, view->scale_y, view->margin_y, HG_CLUSTER_Y};
    tile_range(&across, s->x - r, s->x + r, z0, z1, x);
    tile_range(&down, s->y - r, s->y + r, z0, z1, y);
    return (struct cell_range){x[0], x[1], y[0], y[1]};
}

// Calls for every cell of one light: counts when `entries` is NULL, else writes at `next`.
static void visit_cells(const struct cluster_view *view, const struct sphere *s, uint32_t number,
    uint32_t *next, uint32_t *entries)
{
    for (int k = 0; k < HG_CLUSTER_Z; k++) {
        struct cell_range c = slice_cells(view, s, k);
        for (int y = c.y0; c.x1 >= c.x0 && y <= c.y1; y++)
            for (int x = c.x0; x <= c.x1; x++) {
                uint32_t *cell = &next[(k * HG_CLUSTER_Y + y) * HG_CLUSTER_X + x];
                if (entries)
                    entries[*cell] = number;
                ++*cell;
            }
    }
}

struct hg_cluster_slices hg_cluster_slices_make(const struct hg_gpu_camera *camera, float far)
{
    far = fmaxf(far, camera->near * 2);
    far = far > 0 ? far : 1;
    const float near = fmaxf(camera->near, far * 0.001f);
    struct hg_cluster_slices s = {.z_scale = HG_CLUSTER_Z / log2f(far / fminf(near, far * 0.5f))};
    s.z_bias = HG_CLUSTER_Z - log2f(far) * s.z_scale;
    return s;
}

float hg_cluster_slice_depth(const struct hg_cluster_slices *slices, int k)
{
    return exp2f(((float)k - slices->z_bias) / slices->z_scale);
}

// Slices up to the farthest reach.
static struct cluster_view make_view(const struct hg_light_set *lights,
    const struct hg_gpu_camera *camera, uint32_t width, uint32_t height)
{
    float far = 0;
    for (uint32_t i = lights->global_count; i < lights->count; i++) {
        struct sphere s = view_sphere(camera, &lights->items[i]);
        far = fmaxf(far, s.depth + s.radius);
    }
    return (struct cluster_view){.camera = camera,
        .scale_x = fabsf(camera->proj.m[0]),
        .scale_y = fabsf(camera->proj.m[5]),
        .margin_x = 3.0f / (float)width,
        .margin_y = 3.0f / (float)height,
        .slices = hg_cluster_slices_make(camera, far)};
}

enum hg_status hg_clusters_build(struct hg_clusters *clusters, const struct hg_light_set *lights,
    const struct hg_gpu_camera *camera, uint32_t width, uint32_t height)
{
    static const uint32_t empty[HG_CLUSTER_COUNT + 1];
    uint32_t next[HG_CLUSTER_COUNT + 1];
    clusters->used = false;
    clusters->entry_count = 0;
    clusters->overflow = lights->global_count - lights->directional_count > HG_CLUSTER_MOST_MEAN;
    if (clusters->overflow)
        return HG_OK;
    if (lights->count - lights->global_count < HG_CLUSTER_MIN_LIGHTS)
        return HG_OK;
    struct cluster_view view = make_view(lights, camera, width, height);
    memcpy(next, empty, sizeof next);
    for (uint32_t i = lights->global_count; i < lights->count; i++) {
        struct sphere s = view_sphere(camera, &lights->items[i]);
        visit_cells(&view, &s, i, next, NULL);
    }
    uint64_t total = 0;
    for (uint32_t c = 0; c < HG_CLUSTER_COUNT; c++) {
        clusters->first[c] = (uint32_t)total;
        total += next[c];
        if (total > HG_CLUSTER_MOST_ENTRIES) {
            clusters->overflow = true;
            return HG_OK;
        }
    }
    clusters->first[HG_CLUSTER_COUNT] = (uint32_t)total;
    if (hg_grow(&clusters->entries, &clusters->capacity, total + 1, sizeof *clusters->entries))
        return HG_E_NOMEM;
    memcpy(next, clusters->first, sizeof next);
    for (uint32_t i = lights->global_count; i < lights->count; i++) {
        struct sphere s = view_sphere(camera, &lights->items[i]);
        visit_cells(&view, &s, i, next, clusters->entries);
    }
    clusters->entry_count = (uint32_t)total;
    clusters->z_scale = view.slices.z_scale;
    clusters->z_bias = view.slices.z_bias;
    clusters->used = true;
    return HG_OK;
}

void hg_clusters_finish(struct hg_clusters *clusters)
{
    hg_free(clusters->entries);
    *clusters = (struct hg_clusters){0};
}
