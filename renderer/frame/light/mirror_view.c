// mirror_view.c - see mirror_view.h.
#include "renderer/frame/light/mirror_view.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/frame/batch/recording.h"
#include "renderer/host_shading/caster.h"
#include "renderer/math/matrix.h"
#include "renderer/math/vec.h"
#include "renderer/passes/probe_light.h"
#include "renderer/passes/shade.h"
#include "shaders/shared/features.h"
#include "shaders/shared/unlit_tiles.h"

#define SHARP_PX    200000u  // of pictures whose mirrors have a ray for each pixel
#define HALF_PX     1600000u // for one of 2 x 2; larger ones for one of 4 x 4
#define WAVE        32768u   // rays
#define BLOCK       512u     // rays of one job
#define ID_BYTES    8u
#define DEPTH_BYTES 4u
#define LIFT        2e-4f // of the depth, that rays begin off the plane
#define MOST_LIGHTS 32u   // that are looked at one by one: clusters are those of the camera

void hg_mirror_view_finish(struct hg_gpu *gpu, struct hg_mirror_view *m)
{
    hg_gpu_buffer_destroy(gpu, &m->rays);
    hg_gpu_buffer_destroy(gpu, &m->hits);
    hg_gpu_buffer_destroy(gpu, &m->pixels);
    hg_mirror_points_finish(&m->points);
    hg_free(m->of);
    hg_free(m->masks);
    hg_free(m->list);
    *m = (struct hg_mirror_view){0};
}

// Whether the next picture looks for mirrors: only one with reflections does.
static bool is_on(const struct hg_draw *draw)
{
    return draw->request->settings->mirrors != HG_VIEW_MIRRORS_NONE &&
           hg_reflect_view_is_on(draw) && !draw->request->camera->orthographic;
}

// --- memory --------------------------------------------------------------------------------------

static uint32_t over(uint32_t px, uint32_t step)
{
    return (px + step - 1) / step;
}

uint32_t hg_mirror_view_step(VkExtent2D size)
{
    const uint64_t px = (uint64_t)size.width * size.height;
    return px <= SHARP_PX ? 1 : px <= HALF_PX ? 2 : 4;
}

static uint64_t pixels_of(const struct hg_mirror_view *m)
{
    return ((uint64_t)m->width * m->height + 3) & ~UINT64_C(3); // texels of 8 bytes start aligned
}

static uint64_t ids_at(const struct hg_mirror_view *m, uint32_t plane)
{
    return plane * pixels_of(m) * (ID_BYTES + DEPTH_BYTES);
}

static uint64_t depth_at(const struct hg_mirror_view *m, uint32_t plane)
{
    return ids_at(m, plane) + pixels_of(m) * ID_BYTES;
}

static enum hg_status reserve_host(struct hg_mirror_view *m, uint32_t texels)
{
    const bool same = m->texels == texels && m->list;
    if (same)
        return HG_OK;
    hg_free(m->of);
    hg_free(m->masks);
    hg_free(m->list);
    m->of = hg_calloc(texels, 1);
    m->masks = hg_calloc(texels, 1);
    m->list = hg_calloc(texels, HG_PROBE_LIGHT_PX * HG_PROBE_LIGHT_PX * sizeof *m->list);
    m->texels = m->of && m->masks && m->list ? texels : 0;
    return m->texels > 0 ? HG_OK : HG_E_NOMEM;
}

static enum hg_status reserve(
    struct hg_mirror_view *m, struct hg_gpu *gpu, uint32_t texels, struct hg_error *err)
{
    const struct {
        struct hg_gpu_buffer *buffer;
        enum hg_gpu_buffer_kind kind;
        uint64_t bytes;
        const char *name;
    } rows[] = {{&m->rays, HG_GPU_BUFFER_READBACK, WAVE * sizeof(struct hg_gpu_ray), "mirror rays"},
        {&m->hits, HG_GPU_BUFFER_READBACK, WAVE * sizeof(struct hg_gpu_hit), "mirror hits"},
        {&m->pixels, HG_GPU_BUFFER_UPLOAD, ids_at(m, HG_MIRROR_PLANES), "mirrored pixels"}};
    enum hg_status status = reserve_host(m, texels);
    if (status != HG_OK)
        return hg_error_set(err, status, "mirrors", NULL, "out of host memory");
    for (size_t i = 0; i < sizeof rows / sizeof *rows && status == HG_OK; i++)
        status = hg_gpu_buffer_reserve(
            gpu, rows[i].kind, rows[i].bytes, rows[i].name, rows[i].buffer, err);
    return status;
}

static uint64_t bytes_of(const struct hg_mirror_view *m)
{
    const uint64_t images = (uint64_t)m->width * m->height *
                            (HG_MIRROR_PLANES * (ID_BYTES + DEPTH_BYTES + 1) + 16); // and light
    const uint64_t texel = 2 + HG_PROBE_LIGHT_PX * HG_PROBE_LIGHT_PX * sizeof *m->list;
    return images + m->texels * texel + m->rays.size_bytes + m->hits.size_bytes +
           m->pixels.size_bytes + hg_mirror_points_bytes(&m->points);
}

// --- rays ----------------------------------------------------------------------------------------

struct work {
    const struct hg_batch *f;
    struct hg_mirror_view *m;
    const struct hg_mirror_plane *plane;
    uint32_t number;       // of the plane
    uint32_t first, count; // of the list
};

// The view ray of a pixel of the mirrored picture, 1 deep.
static void ray_of(const struct work *w, uint32_t pixel, float out[3])
{
    const struct hg_gpu_camera *c = &w->f->draw->frame->camera;
    const VkExtent2D size = hg_draw_size(w->f->draw->request);
    const float x = ((float)(pixel % w->m->width) + 0.5f) * (float)size.width / (float)w->m->width;
    const float y =
        ((float)(pixel / w->m->width) + 0.5f) * (float)size.height / (float)w->m->height;
    for (int a = 0; a < 3; a++)
        out[a] = hg_mirror_axes(&c->ray_origin_ws)[a] + x * hg_mirror_axes(&c->ray_x_ws)[a] +
                 y * hg_mirror_axes(&c->ray_y_ws)[a];
}

// How deep the plane lies along a view ray; <= 0: behind the eye.
static float depth_of(
    const struct hg_gpu_camera *c, const struct hg_mirror_plane *p, const float d[3])
{
    const float facing = hg_dot3(p->normal, d);
    return facing < -1e-6f ? (p->offset - hg_dot3(p->normal, hg_mirror_axes(&c->eye_ws))) / facing
                           : 0;
}

static void send(const struct work *w, uint32_t i)
{
    const struct hg_gpu_camera *c = &w->f->draw->frame->camera;
    float d[3], from[3];
    ray_of(w, w->m->list[w->first + i], d);
    const float depth = depth_of(c, w->plane, d);
    hg_mad3(hg_mirror_axes(&c->eye_ws), d, depth, from);
    hg_mad3(from, w->plane->normal, LIFT * depth, from);
    hg_mad3(d, w->plane->normal, -2 * hg_dot3(d, w->plane->normal), d);
    ((struct hg_gpu_ray *)w->m->rays.mapped)[i] =
        (struct hg_gpu_ray){.origin_ws = {from[0], from[1], from[2]},
            .direction_ws = {d[0], d[1], d[2]},
            .t_max = depth > 0 ? FLT_MAX : -1,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
}

static void send_block(void *user, size_t block)
{
    const struct work *w = user;
    for (uint32_t i = (uint32_t)block * BLOCK; i < (block + 1) * BLOCK && i < w->count; i++)
        send(w, i);
}

// Reversed depth of what is so deep; that of the background where it is too far.
static float reversed(const struct hg_gpu_camera *c, float deep)
{
    const float depth = c->proj.m[14] / deep - c->proj.m[10];
    return depth > HG_UNLIT_TILES_DEPTH ? depth : 0;
}

static void receive_block(void *user, size_t block)
{
    const struct work *w = user;
    const struct hg_gpu_camera *c = &w->f->draw->frame->camera;
    uint8_t *to = w->m->pixels.mapped;
    uint32_t *ids = (uint32_t *)(void *)(to + ids_at(w->m, w->number));
    float *depths = (float *)(void *)(to + depth_at(w->m, w->number));
    for (uint32_t i = (uint32_t)block * BLOCK; i < (block + 1) * BLOCK && i < w->count; i++) {
        const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)w->m->hits.mapped + i;
        const uint32_t pixel = w->m->list[w->first + i];
        float d[3];
        depths[pixel] = 0;
        if (hit->draw == HG_HIT_NONE)
            continue;
        ray_of(w, pixel, d);
        depths[pixel] = reversed(c, depth_of(c, w->plane, d) + hit->t);
        ids[2 * (size_t)pixel] = hit->draw + 1;
        ids[2 * (size_t)pixel + 1] = hit->primitive;
    }
}

// Nothing is shaded where no ray is sent.
static void clear(const struct work *w)
{
    uint8_t *to = w->m->pixels.mapped;
    float *depths = (float *)(void *)(to + depth_at(w->m, w->number));
    memset(to + ids_at(w->m, w->number), 0, pixels_of(w->m) * ID_BYTES);
    for (uint64_t i = 0; i < pixels_of(w->m); i++)
        depths[i] = HG_UNLIT_TILES_DEPTH;
}

static void list_texel(
    struct hg_mirror_view *m, uint32_t x, uint32_t y, uint32_t side, uint32_t *count)
{
    for (uint32_t py = y * side; py < (y + 1) * side && py < m->height; py++)
        for (uint32_t px = x * side; px < (x + 1) * side && px < m->width; px++)
            m->list[(*count)++] = py * m->width + px;
}

static uint32_t list_pixels(const struct work *w, uint32_t columns, uint32_t rows, uint32_t side)
{
    uint32_t count = 0;
    for (uint32_t y = 0; y < rows; y++)
        for (uint32_t x = 0; x < columns; x++)
            if ((w->m->masks[y * columns + x] >> w->number & 1) != 0)
                list_texel(w->m, x, y, side, &count);
    return count;
}

static enum hg_status trace(struct work *w, uint32_t count, struct hg_error *err)
{
    struct hg_host_caster *caster = w->f->draw->reflections->world.caster;
    struct hg_jobs *jobs = w->f->draw->context->jobs;
    enum hg_status status = HG_OK;
    uint32_t more;
    for (w->first = 0; w->first < count && status == HG_OK; w->first += WAVE) {
        w->count = count - w->first < WAVE ? count - w->first : WAVE;
        const struct hg_trace_wave wave = {
            .rays = &w->m->rays, .hits = &w->m->hits, .count = w->count, .coherent = true};
        hg_jobs_for(jobs, over(w->count, BLOCK), send_block, w);
        status = hg_host_cast(caster, &wave, &more, err);
        w->m->stats.rays += more;
        if (status == HG_OK)
            hg_jobs_for(jobs, over(w->count, BLOCK), receive_block, w);
    }
    w->m->stats.rays += count;
    return status;
}

// Texels of a plane and those beside them, whose pixels may be of it as well.
static void make_masks(struct hg_mirror_view *m, uint32_t columns, uint32_t rows)
{
    memset(m->masks, 0, (size_t)columns * rows);
    for (uint32_t i = 0; i < columns * rows; i++) {
        const uint32_t x = i % columns, y = i / columns;
        for (uint32_t k = 0; k < 9 && m->of[i] > 0; k++) {
            const uint32_t px = x + k % 3 - 1, py = y + k / 3 - 1;
            if (px < columns && py < rows)
                m->masks[py * columns + px] |= (uint8_t)(1u << (m->of[i] - 1));
        }
    }
}

// --- the mirrored camera -------------------------------------------------------------------------

static void reflect_vector(const struct hg_mirror_plane *p, struct hg_vec3 *v, float scale)
{
    const float *a = hg_mirror_axes(v), d = 2 * hg_dot3(p->normal, a);
    *v = (struct hg_vec3){(a[0] - d * p->normal[0]) * scale, (a[1] - d * p->normal[1]) * scale,
        (a[2] - d * p->normal[2]) * scale};
}

// m times the reflection about the plane.
static void reflect_matrix(const struct hg_mirror_plane *p, struct hg_mat4 *m)
{
    double about[16] = {0}, from[16], product[16];
    for (int c = 0; c < 3; c++) {
        for (int r = 0; r < 3; r++)
            about[c * 4 + r] = (c == r) - 2 * (double)p->normal[c] * (double)p->normal[r];
        about[12 + c] = 2 * (double)p->offset * (double)p->normal[c];
    }
    about[15] = 1;
    hg_matrix_from_float(m->m, from);
    hg_matrix_multiply(from, about, product);
    for (int i = 0; i < 16; i++)
        m->m[i] = (float)product[i];
}

// Shading knows the camera by its rays, its eye and the way to its clip space.
static void reflect_camera(
    const struct hg_mirror_plane *p, float step_x, float step_y, struct hg_gpu_camera *c)
{
    const float *eye = hg_mirror_axes(&c->eye_ws);
    const float above = 2 * (hg_dot3(p->normal, eye) - p->offset);
    c->eye_ws = (struct hg_vec3){eye[0] - above * p->normal[0], eye[1] - above * p->normal[1],
        eye[2] - above * p->normal[2]};
    reflect_vector(p, &c->forward_ws, 1);
    reflect_vector(p, &c->ray_origin_ws, 1);
    reflect_vector(p, &c->ray_x_ws, step_x);
    reflect_vector(p, &c->ray_y_ws, step_y);
    reflect_matrix(p, &c->view);
    reflect_matrix(p, &c->view_proj);
    c->pixel_angle *= step_y;
}

static void write_block(const struct hg_batch *f, const struct hg_gpu_frame *frame, uint32_t slot)
{
    uint8_t *to = (uint8_t *)f->draw->buffers->blocks.mapped + (size_t)slot * HG_FRAME_SLOT_BYTES;
    memcpy(to, frame, sizeof *frame);
}

static uint32_t slot_of(const struct hg_batch *f, uint32_t plane)
{
    return f->slots + plane;
}

// What the mirrored camera sees is lit as the picture is, but for what is made for its own camera:
// cells of lights, and cascades of shadow maps but the one of the whole scene.
static void fill_blocks(const struct hg_batch *f, const struct hg_mirror_view *m)
{
    struct hg_gpu_frame *frame = f->draw->frame;
    for (uint32_t k = 0; k < m->count; k++) {
        const struct hg_mirror_plane *p = &m->planes[k];
        struct hg_gpu_frame mirrored = *frame;
        reflect_camera(p, (float)frame->width / (float)m->width,
            (float)frame->height / (float)m->height, &mirrored.camera);
        mirrored.width = m->width;
        mirrored.height = m->height;
        mirrored.inv_size = (struct hg_vec2){1.0f / (float)m->width, 1.0f / (float)m->height};
        mirrored.background_mode = HG_BACKGROUND_MODE_ENV;
        mirrored.flags |= HG_FRAME_COARSE_SHADOWS;
        mirrored.lighting.clustered = 0;
        write_block(f, &mirrored, slot_of(f, k));
    }
    for (uint32_t k = 0; k < m->count; k++) {
        const struct hg_mirror_plane *p = &m->planes[k];
        frame->mirrors[k] = (struct hg_vec4){p->normal[0], p->normal[1], p->normal[2], p->offset};
    }
    write_block(f, frame, f->slot);
}

// --- in the middle of a picture ------------------------------------------------------------------

static enum hg_status look(
    struct hg_batch *f, const uint32_t *light, const uint32_t *surfaces, struct hg_error *err)
{
    struct hg_mirror_view *m = f->draw->mirrors;
    const VkExtent2D size = hg_draw_size(f->draw->request);
    const struct hg_mirror_texels texels = {.camera = &f->draw->frame->camera,
        .columns = over(size.width, HG_PROBE_LIGHT_PX),
        .rows = over(size.height, HG_PROBE_LIGHT_PX),
        .width = size.width,
        .height = size.height,
        .light = light,
        .surfaces = surfaces};
    const uint32_t side = HG_PROBE_LIGHT_PX / hg_mirror_view_step(size);
    enum hg_status status = reserve(m, f->draw->context->gpu, texels.columns * texels.rows, err);
    if (status == HG_OK)
        status = hg_mirror_planes_find(&texels, &m->points, m->of, m->planes, &m->count);
    if (status != HG_OK || m->count == 0)
        return status;
    make_masks(m, texels.columns, texels.rows);
    for (uint32_t k = 0; k < m->count && status == HG_OK; k++) {
        struct work w = {.f = f, .m = m, .plane = &m->planes[k], .number = k};
        clear(&w);
        status = trace(&w, list_pixels(&w, texels.columns, texels.rows, side), err);
    }
    return status;
}

enum hg_status hg_batch_look_into_mirrors(
    struct hg_batch *f, const uint32_t *light, const uint32_t *surfaces, struct hg_error *err)
{
    struct hg_mirror_view *m = f->draw->mirrors;
    const struct hg_gpu_lighting *l = &f->draw->frame->lighting;
    const uint64_t begin = hg_clock_now_ns();
    m->count = 0;
    m->stats = (struct hg_mirror_stats){0};
    if (f->mirrors.mirrored == 0 || f->draw->reflections->world.caster == NULL ||
        (l->clustered != 0 && l->light_count > MOST_LIGHTS))
        return HG_OK;
    const enum hg_status status = look(f, light, surfaces, err);
    if (status != HG_OK)
        m->count = 0;
    fill_blocks(f, m);
    m->stats.planes = m->count;
    m->stats.bytes = bytes_of(m);
    m->stats.ns = hg_clock_now_ns() - begin;
    if (status == HG_E_NOMEM || status == HG_E_LIMIT) { // planes mirror as other surfaces do
        *err = (struct hg_error){0};
        return HG_OK;
    }
    return status;
}

static uint32_t plane_of(const void *user)
{
    return (uint32_t)(uintptr_t)user;
}

static enum hg_status record_copy(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const struct hg_mirror_view *m = f->draw->mirrors;
    const struct hg_gpu_region all = {.width = m->width, .height = m->height};
    const uint32_t k = plane_of(user);
    (void)err;
    if (k >= m->count)
        return HG_OK;
    hg_gpu_image_write(run->cmd, hg_graph_run_image(run, f->mirrors.planes[k].visibility), &all,
        &m->pixels, ids_at(m, k), 0);
    hg_gpu_image_write(run->cmd, hg_graph_run_image(run, f->mirrors.planes[k].depth), &all,
        &m->pixels, depth_at(m, k), 0);
    return HG_OK;
}

// The pass of a sample with the block of a mirrored camera.
static struct hg_pass pass_of(const struct hg_graph_run *run, uint32_t plane)
{
    struct hg_batch *f = hg_batch_of(run);
    struct hg_pass pass = hg_frame_pass(f->draw, run->cmd, slot_of(f, plane));
    pass.features &= ~HG_FEATURE_REST;
    return pass;
}

static enum hg_status record_light(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const uint32_t k = plane_of(user);
    if (k >= f->draw->mirrors->count)
        return HG_OK;
    struct hg_pass pass = pass_of(run, k);
    const struct hg_probe_light light = {
        .visibility = hg_graph_run_image(run, f->mirrors.planes[k].visibility),
        .depth = hg_graph_run_image(run, f->mirrors.planes[k].depth),
        .target = hg_graph_run_image(run, f->mirrors.planes[k].light)};
    return hg_probe_light_record(&pass, &light, err);
}

static enum hg_status record_shading(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const uint32_t k = plane_of(user);
    if (k >= f->draw->mirrors->count)
        return HG_OK;
    struct hg_pass pass = pass_of(run, k);
    const struct hg_shade shade = {
        .visibility = hg_graph_run_image(run, f->mirrors.planes[k].visibility),
        .depth = hg_graph_run_image(run, f->mirrors.planes[k].depth),
        .target = hg_graph_run_image(run, f->mirrors.mirrored),
        .probe_light = hg_graph_run_image(run, f->mirrors.planes[k].light),
        .clear = k == 0,
        .masked = true};
    return hg_shade_record(&pass, &shade, err);
}

static uint32_t image(struct hg_batch *f, const char *name, VkFormat format, uint32_t less)
{
    const struct hg_mirror_view *m = f->draw->mirrors;
    return hg_graph_image(f->graph, &(struct hg_graph_image_params){.name = name,
                                        .format = format,
                                        .size = HG_GRAPH_ABSOLUTE,
                                        .width = over(m->width, less),
                                        .height = over(m->height, less)});
}

static void declare_plane(struct hg_batch *f, uintptr_t k)
{
    static const char *const names[HG_MIRROR_PLANES][3] = {
        {"mirrored visibility", "mirrored depth", "mirrored probe light"},
        {"second mirrored visibility", "second mirrored depth", "second mirrored probe light"}};
    const uint32_t visibility = image(f, names[k][0], HG_VISIBILITY_FORMAT, 1),
                   depth = image(f, names[k][1], HG_DEPTH_FORMAT, 1),
                   light = image(f, names[k][2], HG_PROBE_LIGHT_FORMAT, HG_PROBE_LIGHT_PX);
    f->mirrors.planes[k].visibility = visibility;
    f->mirrors.planes[k].depth = depth;
    f->mirrors.planes[k].light = light;
    // In the pause for reflections it becomes known what is copied.
    hg_batch_add(f, &(struct hg_graph_pass){.name = "mirrors",
                        .record = record_copy,
                        .user = (void *)k,
                        .accesses = {{f->probe_light, HG_GRAPH_SAMPLE, 0},
                            {visibility, HG_GRAPH_COPY_TO, 0}, {depth, HG_GRAPH_COPY_TO, 0}}});
    hg_batch_add(f, &(struct hg_graph_pass){.name = "mirrors",
                        .record = record_light,
                        .user = (void *)k,
                        .accesses = {{f->deformed, HG_GRAPH_READ, 0}, {f->cache, HG_GRAPH_READ, 0},
                            {visibility, HG_GRAPH_SAMPLE, 0}, {depth, HG_GRAPH_SAMPLE, 0},
                            {light, HG_GRAPH_COLOR, 0}}});
    hg_batch_add(
        f, &(struct hg_graph_pass){.name = "mirrors",
               .record = record_shading,
               .user = (void *)k,
               .accesses = {{f->deformed, HG_GRAPH_READ, 0}, {f->cache, HG_GRAPH_READ, 0},
                   {visibility, HG_GRAPH_SAMPLE, 0}, {depth, HG_GRAPH_DEPTH_TEST, 0},
                   {light, HG_GRAPH_SAMPLE, 0}, {f->atlas, HG_GRAPH_SAMPLE, 0},
                   {f->mirrors.mirrored, k == 0 ? HG_GRAPH_COLOR : HG_GRAPH_COLOR_KEEP, 0}}});
}

void hg_batch_declare_mirrors(struct hg_batch *f)
{
    struct hg_mirror_view *m = f->draw->mirrors;
    const VkExtent2D size = hg_draw_size(f->draw->request);
    if (!is_on(f->draw))
        return;
    m->width = over(size.width, hg_mirror_view_step(size));
    m->height = over(size.height, hg_mirror_view_step(size));
    f->mirrors.mirrored = image(f, "mirrored scene", HG_COLOR_FORMAT, 1);
    for (uintptr_t k = 0; k < HG_MIRROR_PLANES; k++)
        declare_plane(f, k);
}

struct hg_gpu_image *hg_batch_mirrored(const struct hg_graph_run *run)
{
    const struct hg_batch *f = hg_batch_of(run);
    return f->mirrors.mirrored > 0 && f->draw->mirrors->count > 0
               ? hg_graph_run_image(run, f->mirrors.mirrored)
               : NULL;
}

// --- after ---------------------------------------------------------------------------------------

// A pixel of a plane is where its mirror image is, behind the plane, which stands still.
static void move_pixel(const struct work *w, uint32_t x, uint32_t y, float *depth, uint32_t *ids)
{
    const struct hg_gpu_camera *c = &w->f->draw->frame->camera;
    const VkExtent2D size = hg_draw_size(w->f->draw->request);
    const uint8_t *pixels = w->m->pixels.mapped;
    const float *depths = (const float *)(const void *)(pixels + depth_at(w->m, w->number));
    const uint32_t pixel =
        y * w->m->height / size.height * w->m->width + x * w->m->width / size.width;
    const size_t i = (size_t)y * size.width + x;
    const float deep = depth[i] > 0 ? c->proj.m[14] / (depth[i] + c->proj.m[10]) : 0;
    float d[3];
    for (int a = 0; a < 3; a++)
        d[a] = hg_mirror_axes(&c->ray_origin_ws)[a] +
               ((float)x + 0.5f) * hg_mirror_axes(&c->ray_x_ws)[a] +
               ((float)y + 0.5f) * hg_mirror_axes(&c->ray_y_ws)[a];
    const float off = (deep - depth_of(c, w->plane, d)) * hg_dot3(w->plane->normal, d);
    if (!(deep > 0) || fabsf(off) > HG_MIRROR_APART * deep || depths[pixel] == HG_UNLIT_TILES_DEPTH)
        return;
    depth[i] = depths[pixel];
    if (ids)
        ids[2 * i] = 0;
}

void hg_mirror_view_move(struct hg_draw *draw, float *depth, uint32_t *ids)
{
    struct hg_mirror_view *m = draw->mirrors;
    const VkExtent2D size = hg_draw_size(draw->request);
    const uint32_t columns = over(size.width, HG_PROBE_LIGHT_PX);
    const struct hg_batch f = {.draw = draw};
    for (uint32_t k = 0; k < m->count && is_on(draw); k++) {
        const struct work w = {.f = &f, .m = m, .plane = &m->planes[k], .number = k};
        for (uint32_t y = 0; y < size.height; y++)
            for (uint32_t x = 0; x < size.width; x++) {
                const uint32_t texel = y / HG_PROBE_LIGHT_PX * columns + x / HG_PROBE_LIGHT_PX;
                if ((m->masks[texel] >> k & 1) != 0)
                    move_pixel(&w, x, y, depth, ids);
            }
    }
}
