#include "renderer/light/shadow/shadow_plan.h"

#include <stdlib.h>

#include "base/alloc.h"
#include "renderer/light/shadow/shadow_sight.h"
#include "renderer/math/vec.h"

// --- sizes and places ----------------------------------------------------------------------------

// Most shadowed lights that a plan considers.
#define MAX_CANDIDATES 256
#define FADE_RATIO     1.5f // of weights, from no shadow to all of it
#define TOUCH_PX       4.0f // about boxes of casters, for lines, points and rounding
#define GRID           (16384 / HG_SHADOW_MIN_SIDE_PX)

struct candidate {
    uint32_t light, maps, side_px;
    uint32_t whole_px; // of a sun's map of the whole scene, the last; 0: all maps are side_px
    float weight;      // decides who goes without
    bool seen;         // before weight: its light reaches what the camera sees
    bool paged;        // pages in place of finer cascades
};

struct draft {
    struct candidate items[MAX_CANDIDATES];
    uint32_t count;
};

static float cone_half_angle(const struct hg_gpu_light *light)
{
    return acosf(hg_clampf(-light->spot_offset / light->spot_scale, -1, 1));
}

static bool needs_cube(const struct hg_gpu_light *light)
{
    return light->kind != HG_LIGHT_KIND_SPOT || cone_half_angle(light) > 1.3f;
}

static float light_weight(const struct hg_gpu_light *light, const struct hg_lighting_view *view)
{
    float color = light->color.x + light->color.y + light->color.z, d[3];
    if (light->kind == HG_LIGHT_KIND_DIRECTIONAL)
        return color * 1e12f;
    hg_sub3((float *)&light->position_ws, (float *)&view->camera->eye_ws, d);
    return color / fmaxf(hg_dot3(d, d), 1e-4f);
}

static int compare_weight(const void *a, const void *b)
{
    const struct candidate *x = a, *y = b;
    if (x->seen != y->seen)
        return x->seen ? -1 : 1;
    if (x->weight != y->weight)
        return x->weight > y->weight ? -1 : 1;
    return x->light < y->light ? -1 : 1;
}

// How often sides are halved: those of a sun's finer cascades, and all others.
struct halvings {
    uint32_t fine, rest;
};

static uint32_t halved(uint32_t side_px, uint32_t halvings)
{
    const uint32_t side = side_px >> halvings;
    return side < HG_SHADOW_MIN_SIDE_PX ? HG_SHADOW_MIN_SIDE_PX : side;
}

static struct candidate candidate_halved(struct candidate c, struct halvings h)
{
    c.side_px = halved(c.side_px, c.whole_px > 0 ? h.fine : h.rest);
    c.whole_px = c.whole_px > 0 ? halved(c.whole_px, h.rest) : 0;
    return c;
}

static uint64_t draft_area(const struct draft *draft, uint32_t count, struct halvings h)
{
    uint64_t area = 0;
    for (uint32_t i = 0; i < count; i++) {
        const struct candidate c = candidate_halved(draft->items[i], h);
        const uint64_t side = c.side_px, whole = c.whole_px;
        area += side * side * (c.maps - (whole > 0)) + whole * whole;
    }
    return area;
}

// Fits the wishes into the atlas; returns how many lights keep their maps. A sun that fills the
// atlas by itself leaves no room for a single lamp: its cascades are the last to get coarser.
static uint32_t draft_fit(struct draft *draft, uint32_t max_atlas_px)
{
    static const struct halvings steps[] = {{0, 0}, {0, 1}, {1, 1}, {2, 2}, {3, 3}, {4, 4}};
    const uint64_t room = (uint64_t)max_atlas_px * max_atlas_px;
    uint32_t step = 0, count = draft->count;
    while (step + 1 < sizeof steps / sizeof *steps && draft_area(draft, count, steps[step]) > room)
        step++;
    while (count && draft_area(draft, count, steps[step]) > room)
        count--;
    for (uint32_t i = 0; i < count; i++) {
        struct candidate *c = &draft->items[i];
        *c = candidate_halved(*c, steps[step]);
        c->side_px = c->side_px < max_atlas_px ? c->side_px : max_atlas_px;
        c->whole_px = c->whole_px < max_atlas_px ? c->whole_px : max_atlas_px;
    }
    return count;
}

static uint32_t even_bits(uint32_t v)
{
    v &= 0x55555555;
    v = (v | v >> 1) & 0x33333333;
    v = (v | v >> 2) & 0x0f0f0f0f;
    v = (v | v >> 4) & 0x00ff00ff;
    return (v | v >> 8) & 0x0000ffff;
}

static int compare_side(const void *a, const void *b)
{
    const struct hg_shadow_map *const *x = a, *const *y = b;
    if ((*x)->gpu.size_px != (*y)->gpu.size_px)
        return (*x)->gpu.size_px > (*y)->gpu.size_px ? -1 : 1;
    return *x < *y ? -1 : 1; // places in one array
}

// Squares of powers of two, largest first, along a Morton curve: they never overlap and leave no
// holes.
static enum hg_status place_maps(struct hg_shadow_plan *plan)
{
    struct hg_shadow_map **order = hg_calloc(plan->count + 1, sizeof *order);
    if (!order)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < plan->count; i++)
        order[i] = &plan->maps[i];
    qsort(order, plan->count, sizeof *order, compare_side);
    uint32_t next = 0; // in units of the smallest square
    uint32_t side = HG_SHADOW_MIN_SIDE_PX;
    for (uint32_t i = 0; i < plan->count; i++) {
        struct hg_gpu_shadow *s = &order[i]->gpu;
        uint32_t units = (uint32_t)s->size_px / HG_SHADOW_MIN_SIDE_PX;
        s->rect_px.x = (float)(even_bits(next) * HG_SHADOW_MIN_SIDE_PX);
        s->rect_px.y = (float)(even_bits(next >> 1) * HG_SHADOW_MIN_SIDE_PX);
        next += units * units;
    }
    while (plan->count &&
           (uint64_t)side * side < (uint64_t)next * HG_SHADOW_MIN_SIDE_PX * HG_SHADOW_MIN_SIDE_PX)
        side *= 2;
    plan->atlas_px = plan->count ? side : 0;
    hg_free(order);
    return HG_OK;
}

// --- places that are kept ------------------------------------------------------------------------

struct places {
    uint32_t side; // of the atlas, in units of the smallest square
    bool taken[GRID * GRID];
    bool placed[MAX_CANDIDATES * 6]; // by map of the plan
};

static bool is_free(const struct places *p, uint32_t x, uint32_t y, uint32_t units)
{
    for (uint32_t v = y; v < y + units; v++)
        for (uint32_t u = x; u < x + units; u++)
            if (p->taken[v * GRID + u])
                return false;
    return true;
}

static void take(struct places *p, struct hg_gpu_shadow *s, uint32_t x, uint32_t y)
{
    const uint32_t units = (uint32_t)s->size_px / HG_SHADOW_MIN_SIDE_PX;
    for (uint32_t v = y; v < y + units; v++)
        for (uint32_t u = x; u < x + units; u++)
            p->taken[v * GRID + u] = true;
    s->rect_px.x = (float)(x * HG_SHADOW_MIN_SIDE_PX);
    s->rect_px.y = (float)(y * HG_SHADOW_MIN_SIDE_PX);
}

static bool find_place(struct places *p, struct hg_gpu_shadow *s)
{
    const uint32_t units = (uint32_t)s->size_px / HG_SHADOW_MIN_SIDE_PX;
    for (uint32_t y = 0; y + units <= p->side; y += units)
        for (uint32_t x = 0; x + units <= p->side; x += units)
            if (is_free(p, x, y, units)) {
                take(p, s, x, y);
                return true;
            }
    return false;
}

// Maps of the same projection stay where they are.
static void keep_places(
    struct hg_shadow_plan *plan, const struct hg_shadow_plan *before, struct places *p)
{
    for (uint32_t i = 0; i < plan->count; i++) {
        struct hg_gpu_shadow *s = &plan->maps[i].gpu;
        for (uint32_t k = 0; k < before->count && !p->placed[i]; k++) {
            const struct hg_gpu_shadow *was = &before->maps[k].gpu;
            struct hg_gpu_shadow moved = *s;
            moved.rect_px = was->rect_px;
            if ((before->maps[k].stale && !before->maps[k].partly) ||
                was->origin_ws.x != s->origin_ws.x || memcmp(&moved, was, sizeof moved) != 0)
                continue;
            take(p, s, (uint32_t)was->rect_px.x / HG_SHADOW_MIN_SIDE_PX,
                (uint32_t)was->rect_px.y / HG_SHADOW_MIN_SIDE_PX);
            p->placed[i] = true;
        }
    }
}

enum hg_status hg_shadow_plan_keep(
    struct hg_shadow_plan *plan, const struct hg_shadow_plan *before, uint32_t atlas_px)
{
    if (plan->atlas_px == 0 || plan->atlas_px > atlas_px || plan->count > MAX_CANDIDATES * 6 ||
        atlas_px > GRID * HG_SHADOW_MIN_SIDE_PX)
        return HG_OK;
    struct places *p = hg_calloc(1, sizeof *p);
    struct hg_shadow_map *maps = hg_calloc((size_t)plan->count + 1, sizeof *maps);
    enum hg_status status = p && maps ? HG_OK : HG_E_NOMEM;
    bool fits = !status;
    if (!status) {
        memcpy(maps, plan->maps, plan->count * sizeof *maps);
        p->side = atlas_px / HG_SHADOW_MIN_SIDE_PX;
        keep_places(plan, before, p);
    }
    for (uint32_t side = atlas_px; side >= HG_SHADOW_MIN_SIDE_PX && fits; side /= 2)
        for (uint32_t i = 0; i < plan->count && fits; i++) // largest first
            if (!p->placed[i] && (uint32_t)plan->maps[i].gpu.size_px == side)
                fits = find_place(p, &plan->maps[i].gpu);
    if (fits)
        plan->atlas_px = atlas_px;
    else if (!status) // as they were placed without the maps before
        memcpy(plan->maps, maps, plan->count * sizeof *maps);
    hg_free(maps);
    hg_free(p);
    return status;
}

// --- projections ---------------------------------------------------------------------------------

static float map_extent(uint32_t side_px)
{
    return 1 - 2 * HG_SHADOW_REACH_PX / (float)side_px;
}

// Column-major matrix of the mapping that struct hg_gpu_shadow describes.
void hg_shadow_map_project(struct hg_shadow_map *map)
{
    const struct hg_gpu_shadow *s = &map->gpu;
    const float *origin = (const float *)&s->origin_ws;
    const float *axes[3] = {
        (const float *)&s->right_ws, (float *)&s->up_ws, (float *)&s->forward_ws};
    float q[3][4]; // q = (right, up, forward) . (p - origin)
    for (int i = 0; i < 3; i++) {
        hg_copy3(axes[i], q[i]);
        q[i][3] = -hg_dot3(axes[i], origin);
    }
    for (int c = 0; c < 4; c++) {
        float one = c == 3 ? 1.0f : 0.0f;
        map->view_proj[c * 4 + 0] = q[0][c] * s->scale;
        map->view_proj[c * 4 + 1] = -q[1][c] * s->scale;
        map->view_proj[c * 4 + 2] =
            s->perspective ? one * s->depth_scale : one - q[2][c] * s->depth_scale;
        map->view_proj[c * 4 + 3] = s->perspective ? q[2][c] : one;
    }
}

static void set_axes(
    struct hg_gpu_shadow *s, const float right[3], const float up[3], const float forward[3])
{
    hg_copy3(right, (float *)&s->right_ws);
    hg_copy3(up, (float *)&s->up_ws);
    hg_copy3(forward, (float *)&s->forward_ws);
}

static void perspective_map(struct hg_shadow_map *map, const struct hg_gpu_light *light,
    float tan_half, float near, uint32_t side_px)
{
    struct hg_gpu_shadow *s = &map->gpu;
    s->origin_ws = light->position_ws;
    s->perspective = 1;
    s->extent = map_extent(side_px);
    s->scale = s->extent / tan_half;
    s->depth_scale = near;
    s->size_px = (float)side_px;
    s->texel_size = 2 / (s->scale * (float)side_px);
    hg_shadow_map_project(map);
}

static void cube_maps(
    struct hg_shadow_map *maps, const struct hg_gpu_light *light, float near, uint32_t side_px)
{
    // Right x up = -forward for a right-handed look along forward is not needed: any orthonormal
    // triple will do, the shader uses the same one.
    static const float axes[6][2][3] = {// forward, up
        {{1, 0, 0}, {0, 1, 0}}, {{-1, 0, 0}, {0, 1, 0}}, {{0, 1, 0}, {0, 0, 1}},
        {{0, -1, 0}, {0, 0, 1}}, {{0, 0, 1}, {0, 1, 0}}, {{0, 0, -1}, {0, 1, 0}}};
    for (int f = 0; f < 6; f++) {
        float right[3];
        hg_cross3(axes[f][0], axes[f][1], right);
        set_axes(&maps[f].gpu, right, axes[f][1], axes[f][0]);
        perspective_map(&maps[f], light, 1, near, side_px);
    }
}

static void spot_map(
    struct hg_shadow_map *map, const struct hg_gpu_light *light, float near, uint32_t side_px)
{
    float right[3], up[3];
    hg_basis3((float *)&light->direction_ws, up, right);
    hg_cross3((float *)&light->direction_ws, up, right);
    set_axes(&map->gpu, right, up, (float *)&light->direction_ws);
    perspective_map(map, light, tanf(cone_half_angle(light)), near, side_px);
}

// --- the sun -------------------------------------------------------------------------------------

// The scene in the light's frame.
struct sun_frame {
    float right[3], up[3], forward[3];
    float low[3], high[3]; // bounds along the three
};

// Shadows reach over the ground to where the light's rays through the scene meet it; of a light
// within 3 degrees of the horizon a part of the way.
static void reach_ground(struct sun_frame *f, const struct hg_lighting_view *view)
{
    const float down = fmaxf(-hg_dot3(f->forward, view->ground_up), 0.05f);
    for (int c = 0; c < 8; c++) {
        float p[3];
        for (int a = 0; a < 3; a++)
            p[a] = c >> a & 1 ? view->bounds_max[a] : view->bounds_min[a];
        const float above = hg_dot3(p, view->ground_up) - view->ground_height;
        f->high[2] = fmaxf(f->high[2], hg_dot3(p, f->forward) + above / down);
    }
}

static struct sun_frame sun_frame_make(
    const struct hg_gpu_light *light, const struct hg_lighting_view *view)
{
    struct sun_frame f = {
        .low = {INFINITY, INFINITY, INFINITY}, .high = {-INFINITY, -INFINITY, -INFINITY}};
    hg_copy3((float *)&light->direction_ws, f.forward);
    hg_basis3(f.forward, f.up, f.right);
    hg_cross3(f.forward, f.up, f.right);
    const float *axes[3] = {f.right, f.up, f.forward};
    for (int c = 0; c < 8; c++) {
        float p[3];
        for (int a = 0; a < 3; a++)
            p[a] = c >> a & 1 ? view->bounds_max[a] : view->bounds_min[a];
        for (int a = 0; a < 3; a++) {
            float v = hg_dot3(p, axes[a]);
            f.low[a] = fminf(f.low[a], v);
            f.high[a] = fmaxf(f.high[a], v);
        }
    }
    if (view->has_ground)
        reach_ground(&f, view);
    return f;
}

// An orthographic map about a point of the light's plane, deep enough for the whole scene.
static void sun_map(struct hg_shadow_map *map, const struct sun_frame *f, const float center[2],
    float half, uint32_t side_px)
{
    struct hg_gpu_shadow *s = &map->gpu;
    float pad = 1e-3f * (f->high[2] - f->low[2]) + 1e-4f * half;
    float range = f->high[2] - f->low[2] + 2 * pad;
    float origin[3] = {0, 0, 0};
    hg_mad3(origin, f->right, center[0], origin);
    hg_mad3(origin, f->up, center[1], origin);
    hg_mad3(origin, f->forward, f->low[2] - pad, origin);
    hg_copy3(origin, (float *)&s->origin_ws);
    set_axes(s, f->right, f->up, f->forward);
    s->perspective = 0;
    s->extent = map_extent(side_px);
    s->scale = s->extent / half;
    s->depth_scale = 1 / range;
    s->size_px = (float)side_px;
    s->texel_size = 2 / (s->scale * (float)side_px);
    hg_shadow_map_project(map);
}

static float scene_half(const struct sun_frame *f)
{
    float half = 0.5f * fmaxf(f->high[0] - f->low[0], f->high[1] - f->low[1]);
    return fmaxf(half * 1.001f, 1e-6f);
}

// Depths of the scene along the view.
static void view_depths(const struct hg_lighting_view *view, float *near, float *far)
{
    *near = INFINITY;
    *far = -INFINITY;
    for (int c = 0; c < 8; c++) {
        float p[3];
        for (int a = 0; a < 3; a++)
            p[a] = c >> a & 1 ? view->bounds_max[a] : view->bounds_min[a];
        hg_sub3(p, (float *)&view->camera->eye_ws, p);
        float z = hg_dot3(p, (float *)&view->camera->forward_ws);
        *near = fminf(*near, z);
        *far = fmaxf(*far, z);
    }
}

// Sphere about the part of the view between two depths: distance of its centre and radius.
static void slice_sphere(
    const struct hg_lighting_view *view, float a, float b, float *center, float *radius)
{
    const float *proj = view->camera->proj.m;
    float tx = 1 / fabsf(proj[0]), ty = 1 / fabsf(proj[5]), k2 = tx * tx + ty * ty;
    if (view->camera->orthographic) {
        *center = 0.5f * (a + b);
        *radius = sqrtf(0.25f * (b - a) * (b - a) + k2);
        return;
    }
    *center = fminf(b, 0.5f * (a + b) * (1 + k2));
    *radius = sqrtf((b - *center) * (b - *center) + b * b * k2);
}

// Half the side of a map for the part of the scene between two depths. Radius in steps of 2^(1/4),
// centre in steps of a quarter radius: the map holds the sphere wherever in its step the centre is.
static float cascade_half(
    const struct hg_lighting_view *view, const float depths[2], float *distance, float *grid)
{
    float radius;
    slice_sphere(view, depths[0], depths[1], distance, &radius);
    const float step_radius = exp2f(ceilf(log2f(radius) * 4) * 0.25f);
    *grid = step_radius * 0.25f;
    return step_radius + 0.5f * *grid;
}

// Whether a cascade is finer than the map of the whole scene by enough to be worth drawing.
static bool is_finer(float half, const struct sun_frame *f, const struct candidate *c)
{
    return half / (float)c->side_px <= 0.7f * scene_half(f) / (float)c->whole_px;
}

static bool cascade_map(struct hg_shadow_map *map, const struct sun_frame *f,
    const struct hg_lighting_view *view, const float depths[2], const struct candidate *c)
{
    float distance, grid, center[3];
    const float half = cascade_half(view, depths, &distance, &grid);
    if (!is_finer(half, f, c))
        return false;
    hg_mad3((float *)&view->camera->eye_ws, (float *)&view->camera->forward_ws, distance, center);
    float plane[2] = {hg_dot3(center, f->right), hg_dot3(center, f->up)};
    for (int i = 0; i < 2; i++)
        plane[i] = roundf(plane[i] / grid) * grid;
    sun_map(map, f, plane, half, c->side_px);
    return true;
}

// Ends of the depths that finer maps cover: where a texel of the whole map would look larger than a
// pixel. Even in the logarithm, so that texels look alike at all depths; with even splits mixed in,
// hills 2 km away took the first map from the court in front of them. False: there are none.
// Source: Zhang et al. 2006, "Parallel-Split Shadow Maps", eq. 1.
static bool split_depths(const struct sun_frame *f, const struct hg_lighting_view *view,
    const struct candidate *c, float ends[HG_CASCADE_COUNT])
{
    const int splits = HG_CASCADE_COUNT - 1;
    const float texel = 2 * scene_half(f) / (float)c->whole_px;
    float near, far;
    view_depths(view, &near, &far);
    if (!view->camera->orthographic) {
        far = fminf(far, texel / fmaxf(view->camera->pixel_angle, 1e-9f));
        near = fmaxf(near, fmaxf(view->camera->near, far * 0.005f));
    } else if (texel <= view->camera->pixel_size) {
        return false;
    }
    for (int i = 0; i <= splits; i++) {
        const float t = (float)i / (float)splits;
        ends[i] = near > 0 ? near * powf(far / near, t) : near + (far - near) * t;
    }
    ends[splits] = far;
    return far > near;
}

// Finest first; the last map holds the whole scene.
static uint32_t sun_maps(struct hg_shadow_map *maps, const struct hg_gpu_light *light,
    const struct hg_lighting_view *view, const struct candidate *c)
{
    const struct sun_frame f = sun_frame_make(light, view);
    float ends[HG_CASCADE_COUNT];
    uint32_t count = 0;
    const bool finer = split_depths(&f, view, c, ends);
    if (finer && c->paged) // a pool, which holds no point itself
        maps[count++] = (struct hg_shadow_map){
            .refines = true, .gpu = {.size_px = (float)c->side_px, .extent = -1}};
    if (finer && !c->paged)
        for (int i = 0; i + 1 < HG_CASCADE_COUNT; i++)
            if (cascade_map(&maps[count], &f, view, ends + i, c))
                maps[count++].refines = true;
    const float center[2] = {0.5f * (f.low[0] + f.high[0]), 0.5f * (f.low[1] + f.high[1])};
    maps[count].refines = false;
    sun_map(&maps[count++], &f, center, scene_half(&f), c->whole_px);
    return count;
}

// --- the plan ------------------------------------------------------------------------------------

// The first sun without a size.
static bool is_paged(
    const struct hg_light_set *lights, uint32_t i, const struct hg_lighting_view *view)
{
    if (view->paging != HG_PAGING_ON || lights->items[i].radiance > 0)
        return false;
    for (uint32_t k = 0; k < i; k++)
        if (lights->casts[k] && !(lights->items[k].radiance > 0))
            return false;
    return true;
}

static struct candidate candidate_make(const struct hg_light_set *lights, uint32_t i,
    const struct hg_lighting_view *view, const struct hg_shadow_sight *sight)
{
    const struct hg_gpu_light *light = &lights->items[i];
    struct candidate c = {.light = i,
        .maps = 1,
        .side_px = HG_SHADOW_SPOT_SIDE_PX,
        .weight = light_weight(light, view),
        .seen = hg_shadow_sight_has_light(sight, light)};
    if (light->kind == HG_LIGHT_KIND_DIRECTIONAL) {
        struct hg_shadow_map scratch[HG_CASCADE_COUNT];
        c.side_px = c.whole_px = HG_SHADOW_SUN_SIDE_PX;
        c.maps = sun_maps(scratch, light, view, &c); // as at rest, so that lamps keep their sizes
        c.paged = is_paged(lights, i, view);
    } else if (needs_cube(light)) {
        c.side_px = HG_SHADOW_POINT_SIDE_PX;
        c.maps = 6;
    }
    return c;
}

// The lights that matter most, those in sight first. Beyond MAX_CANDIDATES the least of those found
// so far makes room.
static void draft_make(
    struct draft *draft, const struct hg_light_set *lights, const struct hg_lighting_view *view)
{
    struct candidate *items = draft->items;
    const struct hg_shadow_sight sight = hg_shadow_sight_make(view->camera);
    draft->count = 0;
    for (uint32_t i = 0; i < lights->count; i++) {
        if (!lights->casts[i])
            continue;
        if (draft->count < MAX_CANDIDATES) {
            items[draft->count++] = candidate_make(lights, i, view, &sight);
            if (draft->count == MAX_CANDIDATES)
                qsort(items, draft->count, sizeof items[0], compare_weight);
            continue;
        }
        uint32_t at = MAX_CANDIDATES - 1;
        if (items[at].seen && !(light_weight(&lights->items[i], view) > items[at].weight))
            continue;
        const struct candidate c = candidate_make(lights, i, view, &sight);
        if (compare_weight(&c, &items[at]) >= 0)
            continue;
        for (; at > 0 && compare_weight(&c, &items[at - 1]) < 0; at--)
            items[at] = items[at - 1];
        items[at] = c;
    }
    qsort(items, draft->count, sizeof items[0], compare_weight);
}

// Shadows of the lamps that had the least right to a map are faint, so that none appears at once
// when the camera moves: by the weight over that of the first lamp that goes without. None of those
// in sight is where all of them have a map.
static float fade_of(const struct draft *draft, uint32_t kept, uint32_t which)
{
    if (kept >= draft->count || draft->items[which].seen != draft->items[kept].seen)
        return 0;
    const float least = draft->items[kept].weight, ratio = draft->items[which].weight / least;
    return 1 - hg_clampf((ratio - 1) / (FADE_RATIO - 1), 0, 1);
}

static enum hg_status add_light(struct hg_shadow_plan *plan, struct hg_gpu_light *light,
    const struct hg_lighting_view *view, const struct candidate *c)
{
    if (hg_grow(&plan->maps, &plan->capacity, (size_t)plan->count + 6, sizeof *plan->maps))
        return HG_E_NOMEM;
    struct hg_shadow_map *maps = plan->maps + plan->count;
    float d[3], near;
    memset(maps, 0, 6 * sizeof *maps);
    hg_sub3(view->bounds_max, view->bounds_min, d);
    near = fmaxf(hg_length3(d) * 5e-4f, 1e-7f);
    uint32_t count = c->maps;
    if (light->kind == HG_LIGHT_KIND_DIRECTIONAL) {
        // Smaller maps may ask for more cascades than the draft counted; it holds room for those
        // it counted.
        struct hg_shadow_map all[HG_CASCADE_COUNT] = {0};
        uint32_t wanted = sun_maps(all, light, view, c);
        count = wanted < count ? wanted : count;
        memcpy(maps, all + (wanted - count), count * sizeof *maps);
        if (c->paged && count > 1) {
            plan->paged = true;
            plan->pool = plan->count;
        }
    } else if (count == 6) {
        cube_maps(maps, light, near, c->side_px);
    } else {
        spot_map(maps, light, near, c->side_px);
    }
    light->shadow = plan->count;
    light->shadow_count = count;
    plan->count += count;
    plan->shadowed_lights++;
    return HG_OK;
}

enum hg_status hg_shadow_plan_make(struct hg_shadow_plan *plan, struct hg_light_set *lights,
    const struct hg_lighting_view *view, uint32_t max_atlas_px)
{
    plan->count = plan->shadowed_lights = plan->unshadowed_lights = plan->atlas_px = 0;
    plan->paged = false;
    if (!view->has_bounds)
        return HG_OK;
    struct draft *draft = hg_calloc(1, sizeof *draft);
    if (!draft)
        return HG_E_NOMEM;
    draft_make(draft, lights, view);
    uint32_t kept = draft_fit(draft, max_atlas_px);
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < kept && !status; i++) {
        struct hg_gpu_light *light = &lights->items[draft->items[i].light];
        light->shadow_fade = fade_of(draft, kept, i);
        status = add_light(plan, light, view, &draft->items[i]);
    }
    for (uint32_t i = 0; i < lights->count; i++)
        plan->unshadowed_lights += lights->casts[i];
    plan->unshadowed_lights -= plan->shadowed_lights;
    hg_free(draft);
    return status ? status : place_maps(plan);
}

static uint32_t texel(float ndc, float side_px, float margin_px)
{
    return (uint32_t)hg_clampf((ndc * 0.5f + 0.5f) * side_px + margin_px, 0, side_px);
}

void hg_shadow_map_touch(struct hg_shadow_map *map, const struct hg_box *casters)
{
    const struct hg_gpu_shadow *s = &map->gpu;
    float low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    uint32_t behind = 0;
    for (int c = 0; c < 8; c++) {
        float clip[4];
        for (int r = 0; r < 4; r++) {
            clip[r] = map->view_proj[12 + r];
            for (int a = 0; a < 3; a++)
                clip[r] +=
                    map->view_proj[a * 4 + r] * (c >> a & 1 ? casters->max[a] : casters->min[a]);
        }
        behind += !(clip[3] > s->depth_scale * 0.5f * (float)s->perspective);
        for (int i = 0; i < 2; i++) {
            low[i] = fminf(low[i], clip[i] / clip[3]);
            high[i] = fmaxf(high[i], clip[i] / clip[3]);
        }
    }
    if (behind == 8)
        return;
    for (int i = 0; i < 2 && behind > 0; i++) { // across the light's plane
        low[i] = -1;
        high[i] = 1;
    }
    if (low[0] > 1.1f || low[1] > 1.1f || high[0] < -1.1f || high[1] < -1.1f)
        return;
    const uint32_t x = (uint32_t)s->rect_px.x, y = (uint32_t)s->rect_px.y;
    const struct hg_shadow_rect r = {x + texel(low[0], s->size_px, -TOUCH_PX),
        y + texel(low[1], s->size_px, -TOUCH_PX), x + texel(high[0], s->size_px, TOUCH_PX),
        y + texel(high[1], s->size_px, TOUCH_PX)};
    struct hg_shadow_rect *d = &map->dirty;
    const bool none = d->x0 >= d->x1 || d->y0 >= d->y1;
    d->x0 = none || r.x0 < d->x0 ? r.x0 : d->x0;
    d->y0 = none || r.y0 < d->y0 ? r.y0 : d->y0;
    d->x1 = none || r.x1 > d->x1 ? r.x1 : d->x1;
    d->y1 = none || r.y1 > d->y1 ? r.y1 : d->y1;
}

void hg_shadow_plan_finish(struct hg_shadow_plan *plan)
{
    hg_free(plan->maps);
    *plan = (struct hg_shadow_plan){0};
}
