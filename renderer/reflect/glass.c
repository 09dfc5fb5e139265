// glass.c - see glass.h.
#include "renderer/reflect/glass.h"

#include <float.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/gi/patches.h"
#include "renderer/host_shading/caster.h"
#include "renderer/math/rgb9e5.h"
#include "renderer/math/vec.h"

#define TEXELS     8192u // at once, of two rays each
#define AT_ONCE    128u  // rays of one job
#define SCOUT      4u    // texels along a side of what one ray looks at first
#define MOST_STEPS 12u   // surfaces that a ray meets
#define MOST_LIT   8192u // ends of rays that are lit for one picture
#define LIFT       1e-4f // of the distance, that rays begin off a surface
#define APART      0.02f // of its depth, that a point may be off what the picture shows there

enum end { NOWHERE, ON_SURFACE, SKY };

// A ray on its way.
struct way {
    float origin[3], direction[3], t_min;
    float left[3];                // of the light that comes along it
    const struct hg_host_glass *in; // the medium around; NULL: air
    float travelled;              // metres
    struct hg_gi_patch met;       // ON_SURFACE
    float radiance[3];            // from there
    bool goes_on, waits;          // waits: to be lit
    uint8_t end;                  // enum end
    uint8_t steps, passed;        // surfaces of clear glass, of other layers
};

struct hg_glass {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    uint32_t number;                              // of the picture
    struct hg_gpu_buffer rays, hits, list;
    struct way *ways;           // [2 * TEXELS] of a texel: on through the glass, mirrored
    uint8_t *blocks, *near;     // [rows][columns] of SCOUT x SCOUT texels: show glass; or beside
    uint32_t *texels, *waiting; // [texel_room]; [2 * TEXELS]
    uint32_t block_room, texel_room;
    struct hg_gi_patches light;
    struct hg_glass_stats stats;
};

struct work {
    struct hg_glass *g;
    const struct hg_glass_picture *p;
    uint32_t *out;
    uint32_t across, down;           // blocks
    const uint32_t *texels;          // of this wave
    uint32_t count, ray_count, step; // of the wave; of the list; every step-th end is lit
};

// --- life ----------------------------------------------------------------------------------------

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "glass", NULL, "out of host memory");
}

enum hg_status hg_glass_create(
    struct hg_gpu *gpu, struct hg_jobs *jobs, struct hg_glass **out, struct hg_error *err)
{
    struct hg_glass *g = hg_calloc(1, sizeof *g);
    *out = g;
    if (!g)
        return no_memory(err);
    g->gpu = gpu;
    g->jobs = jobs;
    return HG_OK;
}

static void free_texels(struct hg_glass *g)
{
    hg_free(g->blocks);
    hg_free(g->near);
    hg_free(g->texels);
    g->blocks = g->near = NULL;
    g->texels = NULL;
    g->block_room = g->texel_room = 0;
}

void hg_glass_destroy(struct hg_glass *g)
{
    if (!g)
        return;
    hg_gpu_buffer_destroy(g->gpu, &g->rays);
    hg_gpu_buffer_destroy(g->gpu, &g->hits);
    hg_gpu_buffer_destroy(g->gpu, &g->list);
    hg_gi_patches_finish(&g->light, g->gpu);
    free_texels(g);
    hg_free(g->ways);
    hg_free(g->waiting);
    hg_free(g);
}

void hg_glass_stats(const struct hg_glass *g, struct hg_glass_stats *out)
{
    *out = g ? g->stats : (struct hg_glass_stats){0};
}

static enum hg_status reserve_texels(
    struct hg_glass *g, uint32_t blocks, uint32_t texels, struct hg_error *err)
{
    if (blocks <= g->block_room && texels <= g->texel_room)
        return HG_OK;
    free_texels(g);
    g->blocks = hg_calloc(blocks, 1);
    g->near = hg_calloc(blocks, 1);
    g->texels = hg_calloc(texels, sizeof *g->texels);
    if (!g->blocks || !g->near || !g->texels)
        return no_memory(err);
    g->block_room = blocks;
    g->texel_room = texels;
    return HG_OK;
}

static enum hg_status reserve(struct work *w, struct hg_error *err)
{
    struct hg_glass *g = w->g;
    const uint32_t slots = w->across * w->down > 2 * TEXELS ? w->across * w->down : 2 * TEXELS;
    const struct {
        struct hg_gpu_buffer *buffer;
        uint64_t bytes;
        const char *name;
    } rows[] = {{&g->rays, slots * sizeof(struct hg_gpu_ray), "glass rays"},
        {&g->hits, slots * sizeof(struct hg_gpu_hit), "glass hits"},
        {&g->list, 2 * TEXELS * sizeof(uint32_t), "glass list"}};
    enum hg_status status = reserve_texels(g, w->across * w->down, w->p->columns * w->p->rows, err);
    for (size_t i = 0; i < sizeof rows / sizeof *rows && status == HG_OK; i++)
        status = hg_gpu_buffer_reserve(
            g->gpu, HG_GPU_BUFFER_READBACK, rows[i].bytes, rows[i].name, rows[i].buffer, err);
    if (status == HG_OK)
        status = hg_gi_patches_reserve(&g->light, g->gpu, MOST_LIT, err);
    if (!g->ways)
        g->ways = hg_calloc(2 * TEXELS, sizeof *g->ways);
    if (!g->waiting)
        g->waiting = hg_calloc(2 * TEXELS, sizeof *g->waiting);
    if (status == HG_OK && (!g->ways || !g->waiting))
        status = no_memory(err);
    return status;
}

static uint64_t bytes_of(const struct hg_glass *g)
{
    const uint64_t lit = sizeof *g->light.points + sizeof *g->light.direct + sizeof *g->light.lit +
                         sizeof *g->light.radiance;
    return g->rays.size_bytes + g->hits.size_bytes + g->list.size_bytes + g->light.rays.size_bytes +
           g->light.blocked.size_bytes + MOST_LIT * lit +
           2 * TEXELS * (sizeof *g->ways + sizeof *g->waiting) + 2ull * g->block_room +
           g->texel_room * sizeof *g->texels;
}

// --- where there is glass ------------------------------------------------------------------------

static const float *axes(const struct hg_vec3 *v)
{
    return (const float *)(const void *)v;
}

// The view ray through a place in texels, 1 deep.
static void view_ray(const struct hg_glass_picture *p, float x, float y, float out[3])
{
    const struct hg_gpu_camera *c = p->camera;
    const float at[2] = {
        x * (float)p->width / (float)p->columns, y * (float)p->height / (float)p->rows};
    for (int a = 0; a < 3; a++)
        out[a] = axes(&c->ray_origin_ws)[a] + at[0] * axes(&c->ray_x_ws)[a] +
                 at[1] * axes(&c->ray_y_ws)[a];
}

static void put_ray(
    const struct hg_glass *g, size_t slot, const float from[3], const float d[3], float t_min)
{
    ((struct hg_gpu_ray *)g->rays.mapped)[slot] =
        (struct hg_gpu_ray){.origin_ws = {from[0], from[1], from[2]},
            .t_min = t_min,
            .direction_ws = {d[0], d[1], d[2]},
            .t_max = FLT_MAX,
            .mask = HG_RAY_ALL};
}

static void scout_row(void *user, size_t y)
{
    const struct work *w = user;
    for (uint32_t x = 0; x < w->across; x++) {
        float d[3];
        view_ray(w->p, ((float)x + 0.5f) * SCOUT, ((float)y + 0.5f) * SCOUT, d);
        put_ray(w->g, y * w->across + x, axes(&w->p->camera->eye_ws), d, 0);
    }
}

static void note_row(void *user, size_t y)
{
    const struct work *w = user;
    for (uint32_t x = 0; x < w->across; x++) {
        const size_t i = y * w->across + x;
        const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)w->g->hits.mapped + i;
        const struct hg_gpu_ray *ray = (const struct hg_gpu_ray *)w->g->rays.mapped + i;
        struct hg_host_surface s;
        w->g->blocks[i] = 0;
        if (hit->draw == HG_HIT_NONE)
            continue;
        hg_host_surface_at(w->p->world.surfaces, hit, axes(&ray->direction_ws), &s);
        w->g->blocks[i] = s.layers; // clear glass may be behind a blended surface
    }
}

static void widen_row(void *user, size_t y)
{
    const struct work *w = user;
    for (uint32_t x = 0; x < w->across; x++) {
        uint8_t any = 0;
        for (uint32_t k = 0; k < 9; k++) {
            const uint32_t bx = x + k % 3 - 1, by = (uint32_t)y + k / 3 - 1;
            if (bx < w->across && by < w->down)
                any |= w->g->blocks[by * w->across + bx];
        }
        w->g->near[y * w->across + x] = any;
    }
}

static uint32_t list_texels(const struct work *w)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < w->across * w->down; i++) {
        const uint32_t x0 = i % w->across * SCOUT, y0 = i / w->across * SCOUT;
        for (uint32_t k = 0; k < SCOUT * SCOUT && w->g->near[i] != 0; k++) {
            const uint32_t x = x0 + k % SCOUT, y = y0 + k / SCOUT;
            if (x < w->p->columns && y < w->p->rows)
                w->g->texels[count++] = y * w->p->columns + x;
        }
    }
    return count;
}

static enum hg_status scout(struct work *w, uint32_t *count, struct hg_error *err)
{
    const struct hg_trace_wave wave = {
        .rays = &w->g->rays, .hits = &w->g->hits, .count = w->across * w->down, .coherent = true};
    hg_jobs_for(w->g->jobs, w->down, scout_row, w);
    const enum hg_status status = hg_trace_closest(w->p->world.caster->trace, &wave, err);
    if (status != HG_OK)
        return status;
    w->g->stats.rays += wave.count;
    hg_jobs_for(w->g->jobs, w->down, note_row, w);
    hg_jobs_for(w->g->jobs, w->down, widen_row, w);
    *count = list_texels(w);
    return HG_OK;
}

// --- rays ----------------------------------------------------------------------------------------

static void begin_texels(void *user, size_t block)
{
    const struct work *w = user;
    for (uint32_t i = (uint32_t)block * AT_ONCE; i < (block + 1) * AT_ONCE && i < w->count; i++) {
        const uint32_t texel = w->texels[i];
        struct way *on = &w->g->ways[2 * i];
        *on = (struct way){.left = {1, 1, 1}, .goes_on = true};
        w->g->ways[2 * i + 1] = *on;
        w->g->ways[2 * i + 1].goes_on = false; // it begins where the other one meets glass
        view_ray(w->p, (float)(texel % w->p->columns) + 0.5f, (float)(texel / w->p->columns) + 0.5f,
            on->direction);
        hg_normalize3(on->direction);
        hg_copy3(axes(&w->p->camera->eye_ws), on->origin);
    }
}

// Ratio of indices of refraction in front of and behind a surface: the refracted direction, or
// false where all is mirrored. n: on the side that d comes from. Snell's law.
static bool refract(const float d[3], const float n[3], float ratio, float out[3])
{
    const float cosine = -hg_dot3(d, n), k = 1 - ratio * ratio * (1 - cosine * cosine);
    if (k < 0)
        return false;
    for (int a = 0; a < 3; a++)
        out[a] = ratio * d[a] + (ratio * cosine - sqrtf(k)) * n[a];
    hg_normalize3(out);
    return true;
}

static void mirror(const float d[3], const float n[3], const float side[3], float out[3])
{
    hg_mad3(d, n, -2 * hg_dot3(d, n), out);
    const float below = hg_dot3(out, side);
    if (below < 0) // interpolated normals bend rays into the surface
        hg_mad3(out, side, -2 * below, out);
}

// The way goes on from a point of a surface; side: its geometric normal where the way goes.
static void leave(struct way *way, const float at[3], const float side[3], float sign)
{
    hg_mad3(at, side, sign * LIFT * fmaxf(way->travelled, 1e-2f), way->origin);
    way->t_min = 0;
}

// What is met at the first surface by the mirrored ray's way.
static void split(const struct way *on, const float at[3], const float normal[3],
    const struct hg_host_surface *s, const struct hg_host_glass *glass, struct way *mirrored)
{
    mirrored->goes_on = true;
    mirrored->travelled = on->travelled;
    mirrored->in = s->inner && !glass->thin ? glass : NULL;
    mirror(on->direction, normal, s->normal, mirrored->direction);
    leave(mirrored, at, s->normal, 1);
}

// first: shading has this surface itself.
static void pass_glass(struct way *way, const float at[3], const float normal[3],
    const struct hg_host_surface *s, bool first)
{
    const struct hg_host_glass *glass = &s->material->glass;
    float bent[3];
    hg_copy3(way->direction, bent);
    const float ratio = s->inner ? glass->ior : 1 / glass->ior;
    if (!glass->thin && !refract(way->direction, normal, ratio, bent)) {
        mirror(way->direction, normal, s->normal, way->direction);
        way->in = s->inner ? glass : NULL;
        leave(way, at, s->normal, 1);
        return;
    }
    for (int c = 0; c < 3 && !first; c++)
        way->left[c] *= glass->tint[c];
    if (!glass->thin)
        way->in = s->inner ? NULL : glass;
    hg_copy3(bent, way->direction);
    leave(way, at, s->normal, -1);
}

static void end_on(struct way *way, const float at[3], const float normal[3])
{
    way->end = ON_SURFACE;
    way->goes_on = false;
    hg_copy3(at, way->met.position);
    hg_copy3(normal, way->met.normal);
    for (int c = 0; c < 3; c++) {
        way->met.albedo[c] = 1; // in the midst of glass: what there is about it
        way->met.emission[c] = 0;
    }
}

static void meet(const struct work *w, uint32_t slot)
{
    struct way *way = &w->g->ways[slot];
    const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)w->g->hits.mapped + slot;
    const bool primary = slot % 2 == 0 && way->steps == 0;
    struct hg_host_surface s;
    float at[3], normal[3];
    if (hit->draw == HG_HIT_NONE) {
        way->end = primary ? NOWHERE : SKY;
        way->goes_on = false;
        return;
    }
    hg_host_surface_at(w->p->world.surfaces, hit, way->direction, &s);
    const bool clear = s.material->glass.clear && s.layers;
    if (s.layers && !clear) { // blended, or rough glass
        way->t_min = hit->t * (1 + 1e-6f);
        way->goes_on = ++way->passed < MOST_STEPS;
        way->end = primary || way->goes_on ? NOWHERE : SKY;
        return;
    }
    if (primary && !clear) {
        way->goes_on = false;
        return;
    }
    hg_mad3(way->origin, way->direction, hit->t, at);
    way->travelled += hit->t;
    for (int c = 0; c < 3 && way->in; c++)
        way->left[c] *= expf(-way->in->absorption[c] * hit->t);
    if (!clear || way->steps >= MOST_STEPS) {
        end_on(way, at, s.normal);
        if (!clear) {
            hg_copy3(s.material->albedo, way->met.albedo);
            hg_copy3(s.material->emission, way->met.emission);
        }
        return;
    }
    hg_host_surface_normal(w->p->world.surfaces, hit, way->direction, &s, normal);
    if (primary)
        split(way, at, normal, &s, &s.material->glass, way + 1);
    pass_glass(way, at, normal, &s, primary);
    way->steps++;
}

static void send_some(void *user, size_t block)
{
    const struct work *w = user;
    const uint32_t *list = w->g->list.mapped;
    for (uint32_t i = (uint32_t)block * AT_ONCE; i < (block + 1) * AT_ONCE && i < w->ray_count;
         i++) {
        const struct way *way = &w->g->ways[list[i]];
        put_ray(w->g, list[i], way->origin, way->direction, way->t_min);
    }
}

static void meet_some(void *user, size_t block)
{
    const struct work *w = user;
    const uint32_t *list = w->g->list.mapped;
    for (uint32_t i = (uint32_t)block * AT_ONCE; i < (block + 1) * AT_ONCE && i < w->ray_count; i++)
        meet(w, list[i]);
}

static uint32_t list_rays(const struct work *w)
{
    uint32_t *list = w->g->list.mapped, count = 0;
    for (uint32_t i = 0; i < 2 * w->count; i++)
        if (w->g->ways[i].goes_on)
            list[count++] = i;
    return count;
}

static uint32_t jobs_of(uint32_t count)
{
    return (count + AT_ONCE - 1) / AT_ONCE;
}

static enum hg_status send_all(struct work *w, struct hg_error *err)
{
    struct hg_glass *g = w->g;
    enum hg_status status = HG_OK;
    bool coherent = true;
    uint32_t more;
    hg_jobs_for(g->jobs, jobs_of(w->count), begin_texels, w);
    while (status == HG_OK && (w->ray_count = list_rays(w)) > 0) {
        const struct hg_trace_wave wave = {.rays = &g->rays,
            .hits = &g->hits,
            .list = &g->list,
            .count = w->ray_count,
            .coherent = coherent};
        hg_jobs_for(g->jobs, jobs_of(w->ray_count), send_some, w);
        status = hg_host_cast(w->p->world.caster, &wave, &more, err);
        if (status == HG_OK)
            hg_jobs_for(g->jobs, jobs_of(w->ray_count), meet_some, w);
        g->stats.rays += w->ray_count + more;
        coherent = false;
    }
    return status;
}

// --- light ---------------------------------------------------------------------------------------

// Where the picture shows a point, or what lies far away in a direction (far); px. False: nowhere.
static bool place_of(
    const struct hg_glass_picture *p, const float point[3], bool far, float px[2], float *depth)
{
    const struct hg_gpu_camera *c = p->camera;
    const float *m = c->view_proj.m;
    float to[3], clip[4];
    hg_copy3(point, to);
    if (!far)
        hg_sub3(point, axes(&c->eye_ws), to);
    for (int r = 0; r < 4; r++)
        clip[r] =
            m[r] * to[0] + m[4 + r] * to[1] + m[8 + r] * to[2] + (far ? 0 : c->proj.m[12 + r]);
    *depth = hg_dot3(to, axes(&c->forward_ws));
    if (!(clip[3] > 0))
        return false;
    px[0] = (clip[0] / clip[3] * 0.5f + 0.5f) * (float)p->width - 0.5f;
    px[1] = (clip[1] / clip[3] * 0.5f + 0.5f) * (float)p->height - 0.5f;
    return px[0] > -0.5f && px[1] > -0.5f && px[0] < (float)p->width - 0.5f &&
           px[1] < (float)p->height - 0.5f;
}

// Whether a pixel of the opaque scene shows what lies so deep; INFINITY: the environment.
static bool shows(float deep, float depth)
{
    deep = fabsf(deep);
    return isinf(depth) ? deep >= HG_GLASS_FAR_M : fabsf(deep - depth) < APART * depth;
}

// Bilinear, of the pixels that show it.
static bool look_at(
    const struct hg_glass_picture *p, const float px[2], float depth, float radiance[3])
{
    float sum[3] = {0}, weights = 0;
    const float low[2] = {floorf(px[0]), floorf(px[1])};
    for (int k = 0; k < 4; k++) {
        const int x = (int)low[0] + (k & 1), y = (int)low[1] + (k >> 1);
        if (x < 0 || y < 0 || x >= (int)p->width || y >= (int)p->height)
            continue;
        const float *pixel = p->behind + ((size_t)y * p->width + (size_t)x) * 4;
        const float f[2] = {px[0] - low[0], px[1] - low[1]};
        const float weight = (k & 1 ? f[0] : 1 - f[0]) * (k >> 1 ? f[1] : 1 - f[1]) + 1e-3f;
        if (!shows(pixel[3], depth) || !(pixel[0] + pixel[1] + pixel[2] < FLT_MAX))
            continue;
        hg_mad3(sum, pixel, weight, sum);
        weights += weight;
    }
    for (int c = 0; c < 3 && weights > 0; c++)
        radiance[c] = sum[c] / weights;
    return weights > 0;
}

// The opaque scene shows the end of the way, from its side.
static bool find_on_screen(const struct hg_glass_picture *p, struct way *way)
{
    const bool sky = way->end == SKY;
    float px[2], depth, to_eye[3];
    if (p->behind == NULL || (sky && !p->shows_sky))
        return false;
    if (!place_of(p, sky ? way->direction : way->met.position, sky, px, &depth))
        return false;
    hg_sub3(axes(&p->camera->eye_ws), way->met.position, to_eye);
    if (!sky && hg_dot3(way->met.normal, to_eye) <= 0)
        return false;
    return look_at(p, px, sky ? INFINITY : depth, way->radiance);
}

static void look_up_some(void *user, size_t block)
{
    const struct work *w = user;
    for (uint32_t i = (uint32_t)block * AT_ONCE; i < (block + 1) * AT_ONCE && i < 2 * w->count;
         i++) {
        struct way *way = &w->g->ways[i];
        const bool on_through = i % 2 == 0; // the mirrored environment is blurred as the lobe is
        way->waits = way->end == ON_SURFACE;
        if (way->end != NOWHERE && (way->waits || on_through) && find_on_screen(w->p, way)) {
            way->end = ON_SURFACE;
            way->waits = false;
        }
    }
}

// Those through the glass before those mirrored, as neighbours share light.
static uint32_t list_waiting(const struct work *w)
{
    struct hg_glass *g = w->g;
    uint32_t count = 0;
    for (uint32_t k = 0; k < 2 * w->count; k++) {
        const uint32_t i = k < w->count ? 2 * k : 2 * (k - w->count) + 1;
        const struct way *way = &g->ways[i];
        if (way->waits)
            g->waiting[count++] = i;
        g->stats.sky += way->end == SKY;
        g->stats.on_screen += way->end == ON_SURFACE && !way->waits;
    }
    return count;
}

// Every step-th of them is lit; the others have the light of the one before, which is beside.
static enum hg_status light_waiting(const struct work *w, struct hg_error *err)
{
    struct hg_glass *g = w->g;
    const uint32_t count = list_waiting(w);
    const struct hg_gi_patch_lighting with = {g->jobs, w->p->sources, &w->p->world, g->number};
    g->light.count = 0;
    for (uint32_t k = 0; k < count && g->light.count < MOST_LIT; k += w->step)
        g->light.points[g->light.count++] = g->ways[g->waiting[k]].met;
    g->stats.lit += g->light.count;
    if (count == 0)
        return HG_OK;
    const enum hg_status status = hg_gi_patches_light(&g->light, &with, &g->stats.shadow_rays, err);
    for (uint32_t k = 0; k < count && status == HG_OK; k++) {
        struct way *way = &g->ways[g->waiting[k]];
        const float *light = g->light.lit[k / w->step].light;
        for (int c = 0; c < 3; c++)
            way->radiance[c] = way->met.emission[c] + way->met.albedo[c] * light[c];
    }
    return status;
}

// --- words ---------------------------------------------------------------------------------------

// Octahedral coordinates of a unit vector, the inverse of hg_octahedral3.
static uint32_t direction_word(const float d[3])
{
    const float scale = 1 / (fabsf(d[0]) + fabsf(d[1]) + fabsf(d[2]));
    float x = d[0] * scale, y = d[1] * scale;
    if (d[2] < 0) {
        const float fold = (1 - fabsf(y)) * (x >= 0 ? 1.0f : -1.0f);
        y = (1 - fabsf(x)) * (y >= 0 ? 1.0f : -1.0f);
        x = fold;
    }
    const uint32_t a = (uint32_t)lrintf((hg_clampf(x, -1, 1) * 0.5f + 0.5f) * 65535);
    const uint32_t b = (uint32_t)lrintf((hg_clampf(y, -1, 1) * 0.5f + 0.5f) * 32767);
    return a << 16 | b << 1 | HG_GLASS_THERE;
}

static void write_some(void *user, size_t block)
{
    const struct work *w = user;
    for (uint32_t i = (uint32_t)block * AT_ONCE; i < (block + 1) * AT_ONCE && i < w->count; i++) {
        const struct way *on = &w->g->ways[2 * i], *mirrored = on + 1;
        uint32_t *out = w->out + 4 * (size_t)w->texels[i];
        const float *left = on->left, *r = on->radiance, *m = mirrored->radiance;
        if (on->end == NOWHERE)
            continue;
        out[0] =
            on->end == SKY ? 0 : hg_rgb9e5_pack(r[0] * left[0], r[1] * left[1], r[2] * left[2]);
        out[1] = direction_word(on->direction);
        out[2] = on->end == SKY ? hg_rgb9e5_pack(left[0], left[1], left[2]) : 0;
        out[3] = mirrored->end == SKY ? HG_GLASS_SKY
                                      : hg_rgb9e5_pack(m[0] * mirrored->left[0],
                                            m[1] * mirrored->left[1], m[2] * mirrored->left[2]);
    }
}

// --- the picture ---------------------------------------------------------------------------------

static void count_texels(const struct work *w)
{
    for (uint32_t i = 0; i < w->count; i++)
        w->g->stats.texels += w->g->ways[2 * i].end != NOWHERE;
}

static enum hg_status run(struct work *w, struct hg_error *err)
{
    struct hg_glass *g = w->g;
    uint32_t count = 0;
    enum hg_status status = reserve(w, err);
    if (status == HG_OK)
        status = scout(w, &count, err);
    w->step = (2 * count + MOST_LIT - 1) / MOST_LIT;
    for (uint32_t first = 0; first < count && status == HG_OK; first += TEXELS) {
        w->texels = g->texels + first;
        w->count = count - first < TEXELS ? count - first : TEXELS;
        status = send_all(w, err);
        if (status != HG_OK)
            return status;
        hg_jobs_for(g->jobs, jobs_of(2 * w->count), look_up_some, w);
        status = light_waiting(w, err);
        hg_jobs_for(g->jobs, jobs_of(w->count), write_some, w);
        count_texels(w);
    }
    return status;
}

enum hg_status hg_glass_run(
    struct hg_glass *g, const struct hg_glass_picture *picture, uint32_t *out, struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns(), cpu = hg_clock_cpu_ns();
    struct work w = {.g = g,
        .p = picture,
        .out = out,
        .across = (picture->columns + SCOUT - 1) / SCOUT,
        .down = (picture->rows + SCOUT - 1) / SCOUT};
    g->stats = (struct hg_glass_stats){0};
    g->number++;
    memset(out, 0, (size_t)picture->columns * picture->rows * 4 * sizeof *out);
    const enum hg_status status = run(&w, err);
    g->stats.ns = hg_clock_now_ns() - begin;
    g->stats.cpu_ns = hg_clock_cpu_ns() - cpu;
    g->stats.bytes = bytes_of(g);
    return status;
}
