// caps.c - see caps.h.
#include "renderer/frame/look/caps.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/passes/visibility.h"

#define FIRST_PER_PX 4u         // fragments that there is room for at first
#define MOST         (1u << 24) // in one rectangle
#define FRONT        0x80000000u
#define SAME         1e-5f // of a depth: on the plane itself

struct fragment { // as cut_collect.frag writes it
    uint32_t pixel, draw, depth, reserved;
};

// --- lines of sight ------------------------------------------------------------------------------

static float dot3(const struct hg_vec3 *a, const struct hg_vec3 *b)
{
    return a->x * b->x + a->y * b->y + a->z * b->z;
}

// Starts at the eye, or with it at the plane through it, and is one metre deep.
static void line_of(const struct hg_gpu_camera *c, uint32_t x, uint32_t y, struct hg_vec3 *start,
    struct hg_vec3 *way)
{
    const float px = (float)x + 0.5f, py = (float)y + 0.5f;
    const struct hg_vec3 across = {c->ray_origin_ws.x + px * c->ray_x_ws.x + py * c->ray_y_ws.x,
        c->ray_origin_ws.y + px * c->ray_x_ws.y + py * c->ray_y_ws.y,
        c->ray_origin_ws.z + px * c->ray_x_ws.z + py * c->ray_y_ws.z};
    *start = c->orthographic != 0 ? across : c->eye_ws;
    *way = c->orthographic != 0 ? c->forward_ws : across;
}

// Where the line enters what the planes let through. False: it begins inside, or never does.
static bool enters(const struct hg_gpu_frame *f, uint32_t x, uint32_t y, struct hg_cap *out)
{
    struct hg_vec3 start, way;
    float far = INFINITY;
    bool found = false;
    line_of(&f->camera, x, y, &start, &way);
    out->depth = f->camera.near;
    for (uint32_t i = 0; i < f->clip_count; i++) {
        const struct hg_vec4 *p = &f->clip_planes[i];
        const struct hg_vec3 normal = {p->x, p->y, p->z};
        const float at = dot3(&normal, &start) + p->w, along = dot3(&normal, &way);
        if (along == 0.0f && at < 0.0f)
            return false;
        if (along > 0.0f && -at / along > out->depth) {
            out->depth = -at / along;
            out->plane = i;
            found = true;
        } else if (along < 0.0f) {
            far = fminf(far, -at / along);
        }
    }
    return found && out->depth < far;
}

// --- solids --------------------------------------------------------------------------------------

struct crossing {
    const struct hg_node *node;
    uint32_t draw_plus_one;
    float depth;
    bool front;
};

struct walking {
    const struct hg_geometry *geometry;
    struct crossing *line; // of one pixel
    size_t capacity;
};

static enum hg_status read_line(
    struct walking *w, const struct fragment *all, const uint32_t *order, uint32_t count)
{
    const enum hg_status status =
        hg_grow(&w->line, &w->capacity, (size_t)count + 1, sizeof *w->line);
    for (uint32_t i = 0; i < count && status == HG_OK; i++) {
        const struct fragment *f = &all[order[i]];
        struct crossing c = {.draw_plus_one = f->draw & ~FRONT, .front = (f->draw & FRONT) != 0};
        struct hg_draw_info info;
        memcpy(&c.depth, &f->depth, sizeof c.depth);
        if (hg_geometry_draw_info(w->geometry, c.draw_plus_one - 1, &info))
            c.node = info.node;
        uint32_t at = i; // insertion sort: lines are short
        for (; at > 0 && w->line[at - 1].depth > c.depth; at--)
            w->line[at] = w->line[at - 1];
        w->line[at] = c;
    }
    return status;
}

// As many fronts as backs of the node.
static bool closes(const struct crossing *line, uint32_t count, const struct hg_node *node)
{
    int sum = 0;
    for (uint32_t i = 0; i < count; i++)
        sum += line[i].node == node ? (line[i].front ? 1 : -1) : 0;
    return sum == 0;
}

// Fronts less backs of a node from `first` up to `end`.
static int inside_of(
    const struct crossing *line, uint32_t first, uint32_t end, const struct hg_node *node)
{
    int sum = 0;
    for (uint32_t i = first; i < end; i++)
        sum += line[i].node == node ? (line[i].front ? 1 : -1) : 0;
    return sum;
}

// Draw of the first way out that leads out of a solid around the point; 0: there is none.
static uint32_t owner_of(const struct crossing *line, uint32_t count, float depth)
{
    uint32_t first = 0;
    while (first < count && line[first].depth < depth * (1.0f - SAME))
        first++;
    for (uint32_t i = first; i < count; i++)
        if (!line[i].front && inside_of(line, first, i + 1, line[i].node) < 0 &&
            closes(line, count, line[i].node))
            return line[i].draw_plus_one;
    return 0;
}

// --- one rectangle -------------------------------------------------------------------------------

static enum hg_status record(struct hg_draw *draw, struct hg_gpu_cmd *cmd,
    const struct hg_visibility_cuts *cuts, struct hg_error *err)
{
    struct hg_pass pass = hg_frame_pass(draw, cmd, 0);
    const struct hg_visibility_scene scene = {draw->culling, 0, 0};
    const enum hg_status status = hg_visibility_collect_cuts(&pass, &scene, cuts, err);
    hg_gpu_memory_barrier(cmd);
    return status;
}

// All fragments, in buffers.pick. *count: how many there are.
static enum hg_status collect(
    struct hg_draw *draw, VkRect2D pixels, uint32_t *count, struct hg_error *err)
{
    struct hg_gpu *gpu = draw->context->gpu;
    struct hg_gpu_buffer *to = &draw->buffers->pick;
    uint32_t capacity = pixels.extent.width * pixels.extent.height * FIRST_PER_PX + 1024;
    enum hg_status status = HG_OK;
    for (*count = UINT32_MAX; status == HG_OK && *count > capacity;) {
        if (*count != UINT32_MAX)
            capacity = *count;
        if (capacity > MOST)
            return hg_error_set(err, HG_E_LIMIT, "caps", NULL,
                "%u fragments of what is cut, of at most %u", capacity, MOST);
        struct hg_gpu_cmd *cmd;
        status = hg_gpu_buffer_reserve(gpu, HG_GPU_BUFFER_READBACK,
            ((uint64_t)capacity + 1) * sizeof(struct fragment), "cut surfaces", to, err);
        if (status == HG_OK)
            status = hg_gpu_begin(gpu, &cmd, err);
        if (status != HG_OK)
            return status;
        memset(to->mapped, 0, sizeof(struct fragment));
        const struct hg_visibility_cuts cuts = {
            .list = to->address, .capacity = capacity, .size = hg_frame_size(draw), .area = pixels};
        status = record(draw, cmd, &cuts, err);
        if (status != HG_OK)
            hg_gpu_discard(gpu, cmd);
        else
            status = hg_gpu_submit_and_wait(gpu, cmd, err);
        memcpy(count, to->mapped, sizeof *count);
    }
    return status;
}

static uint32_t place_of(const struct fragment *f, VkRect2D pixels)
{
    return ((f->pixel >> 16) - (uint32_t)pixels.offset.y) * pixels.extent.width +
           (f->pixel & 0xffffu) - (uint32_t)pixels.offset.x;
}

// Fragments by pixel: those of pixel i are order[first[i] .. first[i + 1]).
static void sort_by_pixel(
    const struct fragment *all, uint32_t count, VkRect2D pixels, uint32_t *first, uint32_t *order)
{
    const uint32_t area = pixels.extent.width * pixels.extent.height;
    for (uint32_t i = 0; i < count; i++)
        first[place_of(&all[i], pixels) + 1]++;
    for (uint32_t i = 0; i < area; i++)
        first[i + 1] += first[i];
    for (uint32_t i = count; i > 0; i--)
        order[first[place_of(&all[i - 1], pixels)]++] = i - 1;
    for (uint32_t i = area; i > 0; i--)
        first[i] = first[i - 1];
    first[0] = 0;
}

// Fragments of one pixel come in any order: equal depths must not depend on it.
static void walk_all(struct hg_draw *draw, VkRect2D pixels, uint32_t count, struct hg_cap *out,
    enum hg_status *status)
{
    const struct fragment *all = (const struct fragment *)draw->buffers->pick.mapped + 1;
    const uint32_t area = pixels.extent.width * pixels.extent.height;
    struct walking w = {.geometry = draw->scene_gpu->geometry};
    uint32_t *first = hg_calloc((size_t)area + 1, sizeof *first);
    uint32_t *order = hg_calloc((size_t)count + 1, sizeof *order);
    *status = first != NULL && order != NULL ? HG_OK : HG_E_NOMEM;
    if (*status == HG_OK)
        sort_by_pixel(all, count, pixels, first, order);
    for (uint32_t i = 0; i < area && *status == HG_OK; i++) {
        const uint32_t n = first[i + 1] - first[i];
        const uint32_t x = (uint32_t)pixels.offset.x + i % pixels.extent.width,
                       y = (uint32_t)pixels.offset.y + i / pixels.extent.width;
        if (n == 0 || !enters(draw->frame, x, y, &out[i]))
            continue;
        *status = read_line(&w, all, order + first[i], n);
        if (*status == HG_OK)
            out[i].draw_plus_one = owner_of(w.line, n, out[i].depth);
    }
    hg_free(w.line);
    hg_free(first);
    hg_free(order);
}

enum hg_status hg_caps_find(
    struct hg_draw *draw, VkRect2D pixels, struct hg_cap *out, struct hg_error *err)
{
    const uint32_t area = pixels.extent.width * pixels.extent.height;
    uint32_t count = 0;
    memset(out, 0, area * sizeof *out);
    hg_frame_fill(draw, 0, false, 0);
    enum hg_status status = hg_frame_cull_cuts(draw, pixels, err);
    if (status == HG_OK)
        status = collect(draw, pixels, &count, err);
    if (status != HG_OK || count == 0)
        return status;
    walk_all(draw, pixels, count, out, &status);
    return status == HG_OK ? HG_OK : hg_error_set(err, status, "caps", NULL, "no memory");
}

// --- what caps look like -------------------------------------------------------------------------

static struct hg_vec3 normal_of(const struct hg_draw *draw, const struct hg_cap *cap)
{
    const struct hg_vec4 *p = &draw->frame->clip_planes[cap->plane];
    return (struct hg_vec3){-p->x, -p->y, -p->z};
}

void hg_caps_place(const struct hg_draw *draw, const struct hg_cap *cap, uint32_t x, uint32_t y,
    float position[3], float normal[3])
{
    struct hg_vec3 start, way;
    const struct hg_vec3 n = normal_of(draw, cap);
    line_of(&draw->frame->camera, x, y, &start, &way);
    const float at[3] = {
        start.x + cap->depth * way.x, start.y + cap->depth * way.y, start.z + cap->depth * way.z};
    memcpy(position, at, sizeof at);
    memcpy(normal, &n, sizeof n);
}

// Lit from the eye, so that caps of several planes differ.
static float shade_of(const struct hg_draw *draw, const struct hg_cap *cap)
{
    const struct hg_vec3 n = normal_of(draw, cap);
    return 0.5f + 0.5f * fabsf(dot3(&n, &draw->frame->camera.forward_ws));
}

void hg_caps_color(
    const struct hg_draw *draw, const struct hg_cap *cap, uint32_t x, uint32_t y, float color[3])
{
    const struct hg_look *look = draw->request->settings->look;
    const struct hg_clip *clip = &look->clip;
    const float shade = shade_of(draw, cap), width = 0.25f * clip->hatch_px;
    const bool line = fmodf((float)x + (float)y, clip->hatch_px) < fmaxf(width, 1.0f);
    const bool constant = clip->caps == HG_CAPS_COLOR || (clip->caps == HG_CAPS_HATCH && line);
    hg_view_tables_base_color(
        &look->tables, draw->scene_gpu->geometry, cap->draw_plus_one - 1, color);
    for (int i = 0; i < 3; i++)
        color[i] = shade * (constant ? clip->cap_color[i] : fminf(fmaxf(color[i], 0.0f), 1.0f));
}
