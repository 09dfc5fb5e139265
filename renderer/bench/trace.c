// trace.c - rays per second of each backend, on the same rays (helio bench trace).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/bench.h"
#include "renderer/camera/camera.h"
#include "renderer/internal.h"
#include "renderer/passes/skin.h"
#include "renderer/trace/trace.h"

#define DEFAULT_WIDTH  1280
#define DEFAULT_HEIGHT 720
#define DEFAULT_ROUNDS 5
#define WAVE           (1u << 18) // rays
#define TILE           4u         // pixels: 16 neighbours follow each other

enum kind { PRIMARY, DIFFUSE, SHADOW, KINDS };
static const char *const kind_names[KINDS] = {"primary", "diffuse", "shadow"};

struct result {
    bool refused;
    char reason[512];
    uint64_t ns[KINDS], raw_ns[KINDS], build_ns; // the least of all rounds
    uint64_t cpu_ns[KINDS];
    uint64_t bytes, peak_bytes, triangles;
    uint32_t differ; // rays
};

struct run {
    struct hg_renderer *renderer;
    const struct hg_bench_settings *bench;
    struct hg_geometry *geometry;
    struct hg_ray_geometry *ray_geometry;
    struct hg_trace *traces[HG_TRACE_KHR + 1];
    struct result results[HG_TRACE_KHR + 1];
    uint32_t width, height, rounds, rays;
    struct hg_bench_pose pose;
    struct hg_gpu_buffer ray_buffer[KINDS], hits, blocked;
    struct hg_gpu_hit *first_hits; // of Embree's primary rays
};

// --- scene ---------------------------------------------------------------------------------------

static void choose_pose(struct run *run, const struct hg_scene *scene)
{
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1};
    if (run->bench->path_count > 0) {
        run->pose = run->bench->path[0];
        return;
    }
    if (!hg_scene_bounds(scene, NULL, min, max))
        return;
    const float size =
        sqrtf((max[0] - min[0]) * (max[0] - min[0]) + (max[1] - min[1]) * (max[1] - min[1]) +
              (max[2] - min[2]) * (max[2] - min[2]));
    for (int i = 0; i < 3; i++) {
        run->pose.target[i] = 0.5f * (min[i] + max[i]);
        run->pose.eye[i] = run->pose.target[i];
    }
    run->pose.eye[1] += 0.3f * size;
    run->pose.eye[2] += 0.75f * size;
}

// All triangles as they are, posed.
static enum hg_status open_scene(struct run *run, struct hg_scene *scene, struct hg_error *err)
{
    struct hg_gpu *gpu = run->renderer->gpu;
    const struct hg_geometry_params params = {.bake_from = HG_GEOMETRY_BAKE_NONE};
    const struct hg_ray_geometry_lens lens = {.px_scale = 1.0f, .near = 1.0f};
    hg_scene_update(scene);
    choose_pose(run, scene);
    enum hg_status status = hg_geometry_create(gpu, &params, &run->geometry, err);
    if (status == HG_OK)
        status = hg_geometry_sync(run->geometry, scene, NULL, err);
    if (status == HG_OK)
        status = hg_skin_run(gpu, run->geometry, err);
    return status == HG_OK ? hg_ray_geometry_make(
                                 run->geometry, &lens, run->renderer->jobs, &run->ray_geometry, err)
                           : status;
}

// Each backend's structures, rebuilt in every round: the fastest counts.
static enum hg_status build(struct run *run, enum hg_trace_backend b, struct hg_error *err)
{
    struct result *r = &run->results[b];
    const struct hg_trace_params params = {.backend = b, .jobs = run->renderer->jobs};
    hg_trace_destroy(run->traces[b]);
    enum hg_status status = hg_trace_create(run->renderer->gpu, &params, &run->traces[b], err);
    if (status == HG_E_DEVICE) {
        r->refused = true;
        hg_error_format(err, r->reason, sizeof r->reason);
        return HG_OK;
    }
    const uint64_t start = hg_clock_now_ns();
    if (status == HG_OK)
        status = hg_trace_sync(run->traces[b], run->ray_geometry, err);
    const uint64_t ns = hg_clock_now_ns() - start;
    if (status != HG_OK)
        return status;
    struct hg_trace_stats stats;
    hg_trace_stats(run->traces[b], &stats);
    r->build_ns = r->build_ns == 0 || ns < r->build_ns ? ns : r->build_ns;
    r->bytes = stats.bytes;
    r->peak_bytes = stats.peak_bytes;
    r->triangles = stats.triangles;
    return HG_OK;
}

// --- rays ----------------------------------------------------------------------------------------

static uint32_t hash(uint32_t x)
{
    x = (x ^ x >> 16) * 0x7feb352du;
    x = (x ^ x >> 15) * 0x846ca68bu;
    return x ^ x >> 16;
}

static float random01(uint32_t ray, uint32_t salt)
{
    return (float)(hash(ray * 8 + salt) >> 8) * 0x1p-24f;
}

// Pixel of ray i: tiles of 4 x 4, so that packets are square.
static void pixel_of(const struct run *run, uint32_t i, uint32_t *x, uint32_t *y)
{
    const uint32_t tile = i / (TILE * TILE), in = i % (TILE * TILE), across = run->width / TILE;
    *x = tile % across * TILE + in % TILE;
    *y = tile / across * TILE + in / TILE;
}

static void fill_primary(struct run *run)
{
    struct hg_camera_setup setup = {.up = {0, 1, 0},
        .vfov_rad = run->bench->vfov_rad > 0 ? run->bench->vfov_rad : HG_CAMERA_DEFAULT_VFOV_RAD,
        .near = 0.01f,
        .width = run->width,
        .height = run->height};
    struct hg_gpu_camera camera;
    struct hg_gpu_ray *rays = run->ray_buffer[PRIMARY].mapped;
    for (int i = 0; i < 3; i++) {
        setup.eye[i] = (double)run->pose.eye[i];
        setup.target[i] = (double)run->pose.target[i];
    }
    hg_camera_fill(&setup, &camera);
    for (uint32_t i = 0; i < run->rays; i++) {
        uint32_t x, y;
        pixel_of(run, i, &x, &y);
        const float px = (float)x + 0.5f, py = (float)y + 0.5f;
        rays[i] = (struct hg_gpu_ray){.origin_ws = camera.eye_ws,
            .direction_ws = {camera.ray_origin_ws.x + px * camera.ray_x_ws.x +
                                 py * camera.ray_y_ws.x,
                camera.ray_origin_ws.y + px * camera.ray_x_ws.y + py * camera.ray_y_ws.y,
                camera.ray_origin_ws.z + px * camera.ray_x_ws.z + py * camera.ray_y_ws.z},
            .t_max = 1e30f,
            .time = 1.0f,
            .mask = HG_RAY_ALL};
    }
}

static const struct hg_ray_geometry_piece *piece_of(
    const struct run *run, const struct hg_gpu_hit *hit)
{
    const struct hg_ray_geometry_piece *pieces = hg_ray_geometry_pieces(run->ray_geometry);
    uint32_t low = 0, high = hg_ray_geometry_count(run->ray_geometry);
    while (high - low > 1) {
        const uint32_t i = low + (high - low) / 2;
        if (pieces[i].draw < hit->draw ||
            (pieces[i].draw == hit->draw && pieces[i].first_primitive <= hit->primitive))
            low = i;
        else
            high = i;
    }
    return &pieces[low];
}

// Unit normal of the triangle, towards the ray's origin.
static void normal_of(
    const struct run *run, const struct hg_gpu_hit *hit, const float towards[3], float n[3])
{
    const struct hg_ray_geometry_piece *p = piece_of(run, hit);
    const uint32_t *index = p->indices + (size_t)(hit->primitive - p->first_primitive) * 3;
    float v[3][3], length2 = 0.0f, along = 0.0f;
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 3; c++) {
            const float *q = p->positions + (size_t)index[i] * 3;
            v[i][c] = p->world[c] * q[0] + p->world[3 + c] * q[1] + p->world[6 + c] * q[2];
        }
    for (int c = 0; c < 3; c++) {
        const int a = (c + 1) % 3, b = (c + 2) % 3;
        n[c] =
            (v[1][a] - v[0][a]) * (v[2][b] - v[0][b]) - (v[1][b] - v[0][b]) * (v[2][a] - v[0][a]);
        length2 += n[c] * n[c];
        along += n[c] * towards[c];
    }
    const float scale = (along > 0.0f ? -1.0f : 1.0f) / sqrtf(fmaxf(length2, 1e-30f));
    for (int c = 0; c < 3; c++)
        n[c] *= scale;
}

// A direction about n whose density is the cosine: a point of the unit sphere about its tip.
static void bounce(uint32_t ray, const float n[3], float out[3])
{
    const float z = 2.0f * random01(ray, 0) - 1.0f, turn = 6.2831853f * random01(ray, 1);
    const float r = sqrtf(fmaxf(0.0f, 1.0f - z * z));
    const float at[3] = {r * cosf(turn), r * sinf(turn), z};
    for (int c = 0; c < 3; c++)
        out[c] = n[c] * 1.0001f + at[c];
}

static void fill_secondary(struct run *run, const struct hg_scene *scene)
{
    const struct hg_gpu_ray *from = run->ray_buffer[PRIMARY].mapped;
    struct hg_gpu_ray *diffuse = run->ray_buffer[DIFFUSE].mapped;
    struct hg_gpu_ray *shadow = run->ray_buffer[SHADOW].mapped;
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1};
    if (!hg_scene_bounds(scene, NULL, min, max))
        return;
    for (uint32_t i = 0; i < run->rays; i++) {
        const struct hg_gpu_hit *hit = &run->first_hits[i];
        diffuse[i] = shadow[i] = (struct hg_gpu_ray){.t_max = -1.0f};
        if (hit->draw == HG_HIT_NONE)
            continue;
        float o[3], d[3];
        memcpy(o, &from[i].origin_ws, sizeof o);
        memcpy(d, &from[i].direction_ws, sizeof d);
        float n[3], at[3], light[3], out[3];
        normal_of(run, hit, d, n);
        bounce(i, n, out);
        for (int c = 0; c < 3; c++) {
            at[c] = o[c] + hit->t * d[c] + n[c] * 1e-4f * (1.0f + hit->t);
            light[c] = 0.5f * (min[c] + max[c]) +
                       (c == 1 ? 0.45f : 0.1f * (random01(i, 2u + (uint32_t)c) - 0.5f)) *
                           (max[c] - min[c]);
        }
        const struct hg_gpu_ray ray = {
            .origin_ws = {at[0], at[1], at[2]}, .t_max = 1e30f, .time = 1.0f, .mask = HG_RAY_ALL};
        diffuse[i] = shadow[i] = ray;
        diffuse[i].direction_ws = (struct hg_vec3){out[0], out[1], out[2]};
        shadow[i].direction_ws =
            (struct hg_vec3){light[0] - at[0], light[1] - at[1], light[2] - at[2]};
        shadow[i].t_max = 1.0f;
    }
}

// --- measuring -----------------------------------------------------------------------------------

static enum hg_status trace_all(struct run *run, enum hg_trace_backend b, enum kind kind, bool raw,
    uint64_t *ns, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    *ns = 0;
    for (uint32_t at = 0; at < run->rays && status == HG_OK; at += WAVE) {
        const struct hg_trace_wave wave = {.rays = &run->ray_buffer[kind],
            .hits = &run->hits,
            .blocked = &run->blocked,
            .first_ray = at,
            .first_hit = at,
            .count = run->rays - at < WAVE ? run->rays - at : WAVE,
            .coherent = kind != DIFFUSE};
        uint64_t alone = 0;
        const uint64_t start = hg_clock_now_ns();
        if (raw)
            status = hg_trace_raw(run->traces[b], &wave, kind == SHADOW, &alone, err);
        else if (kind == SHADOW)
            status = hg_trace_blocked(run->traces[b], &wave, err);
        else
            status = hg_trace_closest(run->traces[b], &wave, err);
        *ns += raw ? alone : hg_clock_now_ns() - start;
    }
    return status;
}

static void keep_least(uint64_t *least, uint64_t ns)
{
    *least = *least == 0 || ns < *least ? ns : *least;
}

static void count_differences(struct run *run, enum hg_trace_backend b)
{
    const struct hg_gpu_hit *hits = run->hits.mapped, *first = run->first_hits;
    run->results[b].differ = 0;
    for (uint32_t i = 0; i < run->rays; i++) {
        const bool hit = hits[i].draw != HG_HIT_NONE, other = first[i].draw != HG_HIT_NONE;
        run->results[b].differ +=
            hit != other || (hit && fabsf(hits[i].t - first[i].t) > 1e-4f * first[i].t);
    }
}

static enum hg_status measure(
    struct run *run, const struct hg_scene *scene, enum hg_trace_backend b, struct hg_error *err)
{
    struct result *r = &run->results[b];
    enum hg_status status = build(run, b, err);
    for (int kind = 0; kind < KINDS && status == HG_OK && !r->refused; kind++) {
        uint64_t ns;
        const uint64_t cpu = hg_clock_cpu_ns();
        status = trace_all(run, b, (enum kind)kind, false, &ns, err);
        keep_least(&r->ns[kind], ns);
        keep_least(&r->cpu_ns[kind], hg_clock_cpu_ns() - cpu);
        if (kind == PRIMARY && b == HG_TRACE_EMBREE && status == HG_OK) {
            memcpy(run->first_hits, run->hits.mapped, run->rays * sizeof *run->first_hits);
            fill_secondary(run, scene);
        }
        if (kind == PRIMARY && status == HG_OK)
            count_differences(run, b);
        if (b == HG_TRACE_EMBREE && status == HG_OK) {
            status = trace_all(run, b, (enum kind)kind, true, &ns, err);
            keep_least(&r->raw_ns[kind], ns);
        }
    }
    return status;
}

static enum hg_status measure_all(
    struct run *run, const struct hg_scene *scene, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t round = 0; round < run->rounds && status == HG_OK; round++) {
        for (int b = HG_TRACE_EMBREE; b <= HG_TRACE_KHR && status == HG_OK; b++)
            if (!run->results[b].refused)
                status = measure(run, scene, (enum hg_trace_backend)b, err);
        if (status == HG_OK && run->bench->progress != NULL &&
            !run->bench->progress(run->bench->progress_user, round + 1, run->rounds))
            status = hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
    }
    return status;
}

// --- report --------------------------------------------------------------------------------------

static double mrays(const struct run *run, uint64_t ns)
{
    return ns > 0 ? (double)run->rays * 1e3 / (double)ns : 0.0;
}

static void put_backend(struct hg_writer *w, const struct run *run, enum hg_trace_backend b)
{
    const struct result *r = &run->results[b];
    hg_json_put(w, ",\"%s\":{", hg_trace_backend_name(b));
    if (r->refused) {
        hg_json_put(w, "\"refused\":");
        hg_json_string(w, r->reason);
        hg_json_put(w, "}");
        return;
    }
    for (int kind = 0; kind < KINDS; kind++)
        hg_json_put(w, "\"%s\":%.3f,", kind_names[kind], mrays(run, r->ns[kind]));
    hg_json_put(w, "\"cpu_ns_per_ray\":{");
    for (int kind = 0; kind < KINDS; kind++)
        hg_json_put(w, "%s\"%s\":%.1f", kind > 0 ? "," : "", kind_names[kind],
            (double)r->cpu_ns[kind] / run->rays);
    hg_json_put(w,
        "},\"build_ms\":%.3f,\"bytes\":%llu,\"bytes_per_triangle\":%.1f,\"peak_bytes\":%llu,"
        "\"differ_per_million\":%.1f}",
        (double)r->build_ns * 1e-6, (unsigned long long)r->bytes,
        r->triangles > 0 ? (double)r->bytes / (double)r->triangles : 0.0,
        (unsigned long long)r->peak_bytes, (double)r->differ * 1e6 / (double)run->rays);
}

static enum hg_status write_report(const struct run *run, char **text)
{
    struct hg_writer w = {0};
    const struct result *embree = &run->results[HG_TRACE_EMBREE];
    hg_json_put(&w,
        "{\"width\":%u,\"height\":%u,\"rays\":%u,\"triangles\":%llu,\"device\":", run->width,
        run->height, run->rays, (unsigned long long)embree->triangles);
    hg_json_string(&w, hg_gpu_get_caps(run->renderer->gpu)->device_name);
    for (int b = HG_TRACE_EMBREE; b <= HG_TRACE_KHR; b++)
        put_backend(&w, run, (enum hg_trace_backend)b);
    hg_json_put(&w, ",\"raw\":{");
    for (int kind = 0; kind < KINDS; kind++)
        hg_json_put(&w, "%s\"%s\":%.3f", kind > 0 ? "," : "", kind_names[kind],
            mrays(run, embree->raw_ns[kind]));
    hg_json_put(&w, "},\"ratio\":{");
    for (int kind = 0; kind < KINDS; kind++)
        hg_json_put(&w, "%s\"%s\":%.3f", kind > 0 ? "," : "", kind_names[kind],
            embree->ns[kind] > 0 ? (double)embree->raw_ns[kind] / (double)embree->ns[kind] : 0.0);
    hg_json_put(&w, "}}");
    return hg_json_take(&w, text);
}

// --- run -----------------------------------------------------------------------------------------

static enum hg_status prepare(struct run *run, struct hg_scene *scene, struct hg_error *err)
{
    const struct hg_bench_settings *b = run->bench;
    struct hg_gpu *gpu = run->renderer->gpu;
    run->width = (b->width > 0 ? b->width : DEFAULT_WIDTH) / TILE * TILE;
    run->height = (b->height > 0 ? b->height : DEFAULT_HEIGHT) / TILE * TILE;
    run->rounds = b->rounds > 0 ? b->rounds : DEFAULT_ROUNDS;
    const uint64_t rays = (uint64_t)run->width * run->height;
    if (rays == 0 || rays > 1u << 26)
        return hg_error_set(err, HG_E_INVAL, "bench", "width", "not 16 to 2^26 pixels");
    run->rays = (uint32_t)rays;
    run->first_hits = hg_calloc(run->rays, sizeof *run->first_hits);
    enum hg_status status = run->first_hits != NULL
                                ? open_scene(run, scene, err)
                                : hg_error_set(err, HG_E_NOMEM, "bench", NULL, "no memory");
    for (int k = 0; k < KINDS && status == HG_OK; k++)
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK, rays * sizeof(struct hg_gpu_ray),
            "rays", &run->ray_buffer[k], err);
    if (status == HG_OK)
        status = hg_gpu_buffer_create(
            gpu, HG_GPU_BUFFER_READBACK, rays * sizeof(struct hg_gpu_hit), "hits", &run->hits, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_create(
            gpu, HG_GPU_BUFFER_READBACK, rays * 4, "blocked", &run->blocked, err);
    if (status == HG_OK)
        fill_primary(run);
    return status;
}

static void finish(struct run *run)
{
    struct hg_gpu *gpu = run->renderer->gpu;
    for (int b = 0; b <= HG_TRACE_KHR; b++)
        hg_trace_destroy(run->traces[b]);
    hg_ray_geometry_free(run->ray_geometry);
    hg_geometry_destroy(run->geometry);
    for (int k = 0; k < KINDS; k++)
        hg_gpu_buffer_destroy(gpu, &run->ray_buffer[k]);
    hg_gpu_buffer_destroy(gpu, &run->hits);
    hg_gpu_buffer_destroy(gpu, &run->blocked);
    hg_free(run->first_hits);
    hg_free(run);
}

enum hg_status hg_bench_trace_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err)
{
    *text = NULL;
    struct run *run = hg_calloc(1, sizeof *run);
    if (run == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "no memory");
    run->renderer = renderer;
    run->bench = bench;
    enum hg_status status = prepare(run, scene, err);
    if (status == HG_OK)
        status = measure_all(run, scene, err);
    if (status == HG_OK)
        status = write_report(run, text);
    finish(run);
    return status;
}
