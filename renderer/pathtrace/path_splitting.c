// path_splitting.c - chooses the number of branches per camera hit.
//
// Where most camera rays leave the scene, most of a sample's time goes into pixels with hardly any
// noise. There several paths of equal weight start at each camera hit: splitting, Arvo and Kirk
// 1990, "Particle Transport and Image Synthesis". With r the cost of a camera ray relative to a
// path and h the hit rate of camera rays, a sample of b branches costs r + h b, and its variance
// falls as 1 / b until that of edges and textures dominates. So b h is bounded, which also bounds
// the time of a pass. h is measured with a grid of rays (with motion blur in the first shutter
// interval): it depends only on scene and camera, and is the same after a checkpoint.
#include <math.h>

#include "renderer/pathtrace/path_state.h"

#define GRID_X    64u
#define GRID_Y    64u
#define MOST_MET  1.25 // b h
#define MOST_BITS 3u   // 8 branches
#define POINTS    16u  // bits: of a pixel in the sequence of random numbers

static struct hg_vec3 vec3_of(const double v[3])
{
    return (struct hg_vec3){(float)v[0], (float)v[1], (float)v[2]};
}

// Camera ray through a point of the picture, px; no lens. Orthographic rays start at the near
// plane, which may lie behind the eye.
static struct hg_gpu_ray ray_at(const struct hg_gpu_camera *c, float x, float y)
{
    const float *o = &c->ray_origin_ws.x, *right = &c->ray_x_ws.x, *down = &c->ray_y_ws.x;
    const float *eye = &c->eye_ws.x, *forward = &c->forward_ws.x;
    const bool flat = c->orthographic != 0;
    const double near = (double)c->near, far = (double)c->far;
    double from[3], to[3], length2 = 0.0, along = 0.0;
    for (int i = 0; i < 3; i++) {
        const double at = (double)o[i] + (double)x * (double)right[i] + (double)y * (double)down[i];
        from[i] = flat ? at + near * (double)forward[i] : (double)eye[i];
        to[i] = flat ? (double)forward[i] : at;
        length2 += to[i] * to[i];
    }
    for (int i = 0; i < 3; i++) {
        to[i] /= sqrt(length2);
        along += to[i] * (double)forward[i];
    }
    along = along > 1e-6 ? along : 1e-6;
    return (struct hg_gpu_ray){.origin_ws = vec3_of(from),
        .direction_ws = vec3_of(to),
        .t_min = flat || near < 0.0 ? 0.0f : (float)(near / along),
        .t_max = flat        ? (float)(far - near)
                 : far > 0.0 ? (float)(far / along)
                             : 1e30f,
        .time = 0.5f,
        .mask = HG_RAY_ALL};
}

struct probe {
    struct hg_gpu_buffer rays, hits;
};

static enum hg_status reserve(struct hg_gpu *gpu, struct probe *probe, struct hg_error *err)
{
    const uint64_t n = (uint64_t)GRID_X * GRID_Y;
    enum hg_status status = hg_gpu_buffer_reserve(gpu, HG_GPU_BUFFER_READBACK,
        n * sizeof(struct hg_gpu_ray), "grid of rays", &probe->rays, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(gpu, HG_GPU_BUFFER_READBACK, n * sizeof(struct hg_gpu_hit),
            "hits of the grid", &probe->hits, err);
    return status;
}

// Hit rate of a grid of camera rays.
static enum hg_status count_hits(
    const struct hg_path *p, const struct probe *probe, double *share, struct hg_error *err)
{
    const uint32_t n = GRID_X * GRID_Y;
    struct hg_gpu_ray *rays = probe->rays.mapped;
    const struct hg_gpu_hit *hits = probe->hits.mapped;
    const float width = (float)p->request.width, height = (float)p->request.height;
    for (uint32_t i = 0; i < n; i++)
        rays[i] = ray_at(p->host.camera, ((float)(i % GRID_X) + 0.5f) * width / GRID_X,
            ((float)(i / GRID_X) + 0.5f) * height / GRID_Y);
    const struct hg_trace_wave wave = {.rays = &probe->rays, .hits = &probe->hits, .count = n};
    const enum hg_status status = hg_trace_closest(hg_rays_trace(p->scene.rays), &wave, err);
    uint32_t met = 0;
    for (uint32_t i = 0; i < n && status == HG_OK; i++)
        met += hits[i].draw != HG_HIT_NONE;
    *share = (double)met / n;
    return status;
}

enum hg_status hg_path_splitting_choose(struct hg_path *p, struct hg_error *err)
{
    struct probe probe = {0};
    double share = 1.0;
    p->branch_bits = 0;
    const uint32_t wanted = p->context->overrides.path_branches;
    if (wanted != 0) {
        while (2u << p->branch_bits <= wanted && p->branch_bits < MOST_BITS)
            p->branch_bits++;
        return HG_OK;
    }
    if ((p->options & HG_PATH_CATCHER) != 0) // catchers count their light themselves
        return HG_OK;
    p->host.fill(p->host.user);
    enum hg_status status = reserve(p->context->gpu, &probe, err);
    if (status == HG_OK)
        status = count_hits(p, &probe, &share, err);
    hg_gpu_buffer_destroy(p->context->gpu, &probe.rays);
    hg_gpu_buffer_destroy(p->context->gpu, &probe.hits);
    const uint32_t room = POINTS - hg_path_sample_bits(p->request.samples);
    while (status == HG_OK && p->branch_bits < MOST_BITS && p->branch_bits < room &&
           share * (double)(2u << p->branch_bits) <= MOST_MET)
        p->branch_bits++;
    return status;
}
