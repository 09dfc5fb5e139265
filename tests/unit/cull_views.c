// cull_views.c - culling changes the cost of a picture and nothing else: visibility buffers and
// depth of random views of many scenes, with culling, occlusion and sieves for single triangles and
// without, byte for byte.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/cond.h"
#include "base/log.h"
#include "renderer/math/frustum.h"
#include "renderer/camera/camera.h"
#include "renderer/geometry/geometry.h"
#include "renderer/cull/culling.h"
#include "renderer/passes/skin.h"
#include "renderer/passes/visibility.h"
#include "renderer/scene/load.h"
#include "shaders/shared/features.h"
#include "tests/support/check.h"
#include "tests/support/test_data.h"

#define WIDTH       200
#define HEIGHT      160
#define PIXELS      (WIDTH * HEIGHT)
#define BLOCK_BYTES 4096
#define SAME_DEPTH  1e-5f // relative

struct fixture {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    struct hg_culling *visible;
    struct hg_gpu_buffer block, ids, depth;
    struct hg_gpu_image image_ids, image_depth;
    struct hg_error err;
    uint32_t random;
    uint64_t drawn_off, drawn_on, drawn_sieved, hidden; // triangles, and runs behind others
    uint32_t views, spoiled;                            // spoiled: by a sieve of another view
    uint32_t hosted_views;                              // drawn by the host, at least in parts
    uint64_t hosted_px, other_ids, other_depth;         // of them
    float off_depth;                                    // most, of the depth
};

struct world {
    struct hg_scene *scene;
    struct hg_asset *asset;
    struct hg_node *root;
    struct hg_geometry *geometry;
    float min[3], max[3];
};

static void check(struct fixture *f, enum hg_status status)
{
    test_ok(status, &f->err);
}

static double random_in(struct fixture *f, double low, double high)
{
    f->random = f->random * 1664525u + 1013904223u;
    return low + (high - low) * (double)(f->random >> 8) * 0x1p-24;
}

static void make_image(
    struct fixture *f, VkFormat format, const char *name, struct hg_gpu_image *image)
{
    const struct hg_gpu_image_params params = {
        .format = format, .width = WIDTH, .height = HEIGHT, .attachment = true, .name = name};
    check(f, hg_gpu_image_create(f->gpu, &params, image, &f->err));
}

static int setup(void **state)
{
    struct fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    const struct hg_gpu_params params = {.validation_try = true};
    check(f, hg_gpu_create(&params, &f->gpu, &f->err));
    f->jobs = hg_jobs_create(2);
    assert_non_null(f->jobs);
    check(f, hg_culling_create(f->gpu, &f->visible, &f->err));
    check(f, hg_gpu_buffer_create(
                 f->gpu, HG_GPU_BUFFER_UPLOAD, BLOCK_BYTES, "frame", &f->block, &f->err));
    check(f,
        hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_READBACK, PIXELS * 8, "ids", &f->ids, &f->err));
    check(f, hg_gpu_buffer_create(
                 f->gpu, HG_GPU_BUFFER_READBACK, PIXELS * 4, "depth", &f->depth, &f->err));
    make_image(f, HG_VISIBILITY_FORMAT, "visibility", &f->image_ids);
    make_image(f, HG_DEPTH_FORMAT, "depth", &f->image_depth);
    f->random = 11;
    *state = f;
    return 0;
}

static int teardown(void **state)
{
    struct fixture *f = *state;
    hg_culling_destroy(f->visible);
    hg_gpu_image_destroy(f->gpu, &f->image_ids);
    hg_gpu_image_destroy(f->gpu, &f->image_depth);
    hg_gpu_buffer_destroy(f->gpu, &f->block);
    hg_gpu_buffer_destroy(f->gpu, &f->ids);
    hg_gpu_buffer_destroy(f->gpu, &f->depth);
    hg_jobs_destroy(f->jobs);
    const uint32_t messages = hg_gpu_validation_messages(f->gpu);
    hg_gpu_destroy(f->gpu);
    free(f);
    return messages == 0 ? 0 : -1;
}

// --- scenes --------------------------------------------------------------------------------------

static void submit(struct fixture *f, struct hg_gpu_cmd *cmd)
{
    check(f, hg_gpu_submit_and_wait(f->gpu, cmd, &f->err));
}

static void sync(struct fixture *f, struct world *w)
{
    hg_scene_publish(w->scene);
    hg_scene_update(w->scene);
    do
        check(f, hg_geometry_sync(w->geometry, w->scene, NULL, &f->err));
    while (hg_geometry_poll(w->geometry, HG_COND_FOREVER));
    struct hg_gpu_cmd *cmd;
    check(f, hg_gpu_begin(f->gpu, &cmd, &f->err));
    check(f, hg_skin_record(cmd, w->geometry, &f->err));
    submit(f, cmd);
    hg_geometry_deforms_done(w->geometry);
    assert_true(hg_geometry_bounds(w->geometry, w->min, w->max));
}

// Every triangle twice, so that each surface has a rival at the same depth.
static void double_triangles(struct hg_asset *asset)
{
    for (uint32_t m = 0; m < asset->mesh_count; m++)
        for (uint32_t p = 0; p < asset->meshes[m]->part_count; p++) {
            struct hg_mesh_part *part = &asset->meshes[m]->parts[p];
            const size_t bytes = part->index_count * sizeof *part->indices;
            uint32_t *twice = hg_calloc(2, bytes);
            assert_non_null(twice);
            memcpy(twice, part->indices, bytes);
            memcpy(twice + part->index_count, part->indices, bytes);
            hg_free(part->indices);
            part->indices = twice;
            part->index_count *= 2;
        }
}

// Triangles between far vertices, across the eye too, and slivers; what they show is no matter.
static void scramble(struct fixture *f, struct hg_asset *asset)
{
    for (uint32_t m = 0; m < asset->mesh_count; m++)
        for (uint32_t p = 0; p < asset->meshes[m]->part_count; p++) {
            struct hg_mesh_part *part = &asset->meshes[m]->parts[p];
            for (uint32_t i = 0; i + 2 < part->index_count; i += 3) {
                const int kind = (int)random_in(f, 0.0, 8.0);
                if (kind > 1)
                    continue;
                part->indices[i] = (uint32_t)random_in(f, 0.0, part->vertex_count);
                if (kind == 1)
                    continue;
                float *sharp = part->positions + (size_t)part->indices[i + 1] * 3;
                const float *at = part->positions + (size_t)part->indices[i + 2] * 3;
                for (int d = 0; d < 3; d++) // beside the corner
                    sharp[d] = at[d] * (1.0f + (float)random_in(f, -1e-5, 1e-5));
            }
        }
}

static void show_both_sides(struct hg_asset *asset)
{
    for (uint32_t i = 0; i < asset->material_count; i++)
        asset->materials[i]->double_sided = true;
}

enum shape { AS_MADE, TWICE, SCRAMBLED, BOTH_SIDES };

struct subject {
    const char *path;   // absolute, of the test data, or "demo:"
    uint32_t bake_from; // triangles from which parts have levels of detail
    enum shape shape;
    int views; // of each variant
};

static struct world open_world(struct fixture *f, const struct subject *subject)
{
    const char *path = subject->path;
    if (path[0] != '/' && strcmp(path, "demo:") != 0)
        path = test_data(path);
    const struct hg_load_params load = {
        .path = path, .asset_number = 1, .scene_index = -1, .jobs = f->jobs};
    const struct hg_geometry_params params = {.jobs = f->jobs, .bake_from = subject->bake_from};
    struct world w = {0};
    struct hg_object *root_object;
    check(f, hg_load_asset(&load, &w.asset, &f->err));
    if (subject->shape == TWICE)
        double_triangles(w.asset);
    else if (subject->shape == SCRAMBLED)
        scramble(f, w.asset);
    else if (subject->shape == BOTH_SIDES)
        show_both_sides(w.asset);
    check(f, hg_scene_create(&w.scene));
    check(f, hg_scene_add(w.scene, HG_OBJECT_NODE, 1, &root_object));
    w.root = (struct hg_node *)root_object;
    w.root->visible = true;
    check(f, hg_scene_add_asset(w.scene, w.asset, w.root));
    check(f, hg_geometry_create(f->gpu, &params, &w.geometry, &f->err));
    return w;
}

static void close_world(struct world *w)
{
    hg_geometry_destroy(w->geometry);
    hg_scene_destroy(w->scene);
}

enum variant { AS_IT_IS, TURNED, MIRRORED, STRETCHED, TINY, HUGE_ONE, VARIANTS };

static void place(struct fixture *f, struct world *w, enum variant variant)
{
    struct hg_node *n = w->root;
    float length = 0.0f;
    for (int i = 0; i < 4; i++) {
        n->rotation[i] = (float)random_in(f, -1.0, 1.0);
        length += n->rotation[i] * n->rotation[i];
    }
    for (int i = 0; i < 4; i++)
        n->rotation[i] = variant == AS_IT_IS ? (float)(i == 3) : n->rotation[i] / sqrtf(length);
    for (int i = 0; i < 3; i++) {
        n->translation[i] = variant == AS_IT_IS ? 0.0f : (float)random_in(f, -3.0, 3.0);
        n->scale[i] = variant == STRETCHED  ? (float)random_in(f, 0.1, 4.0)
                      : variant == MIRRORED ? (float)random_in(f, 0.5, 1.0)
                      : variant == TINY     ? 1e-4f
                      : variant == HUGE_ONE ? 300.0f
                                            : 1.0f;
    }
    if (variant == MIRRORED)
        n->scale[0] *= -1.0f;
    hg_scene_touch(w->scene, &n->head);
    sync(f, w);
}

// --- views ---------------------------------------------------------------------------------------

// Cameras around the scene, near parts of it and inside of it.
static struct hg_camera_setup random_camera(struct fixture *f, const struct world *w, int index)
{
    struct hg_camera_setup s = {.orthographic = index % 4 == 3,
        .vfov_rad = (float)random_in(f, 0.2, 1.6),
        .width = WIDTH,
        .height = HEIGHT,
        .up = {0.1, 1.0, 0.05}};
    double size = 0.0;
    for (int i = 0; i < 3; i++)
        size = fmax(size, (double)w->max[i] - w->min[i]);
    const double reach = index % 4 == 0 ? 1.5 : index % 4 == 1 ? 0.7 : 0.4;
    for (int i = 0; i < 3; i++) {
        const double middle = 0.5 * ((double)w->min[i] + w->max[i]);
        s.eye[i] = middle + size * random_in(f, -reach, reach);
        s.target[i] = middle + size * random_in(f, -0.3, 0.3);
    }
    s.half_height = (float)(size * random_in(f, 0.05, 0.7));
    hg_camera_fit_depth(&s, true, w->min, w->max);
    hg_camera_jitter((uint32_t)index, 3, s.jitter_px);
    return s;
}

// What the frame asks for; see camera_view of renderer/frame/batch/batch.c.
static struct hg_culling_view view_of(const struct hg_gpu_camera *camera, bool culled)
{
    struct hg_culling_view look = {.eye = {camera->eye_ws.x, camera->eye_ws.y, camera->eye_ws.z},
        .forward = {camera->forward_ws.x, camera->forward_ws.y, camera->forward_ws.z},
        .orthographic = camera->orthographic != 0,
        .px_scale = 1.0f / (camera->orthographic != 0 ? camera->pixel_size : camera->pixel_angle),
        .error_px = 1.0f,
        .near = fmaxf(camera->near, 1e-6f),
        .wait = true,
        .both_sides = !culled,
        .numbered = true,
        .history = culled};
    if (culled)
        look.plane_count = hg_frustum_planes(camera->view_proj.m, look.planes);
    return look;
}

struct picture {
    uint32_t ids[PIXELS * 2];
    float depth[PIXELS];
};

// sample: where the host draws what it takes; NULL: the device draws all.
static void draw(struct fixture *f, const struct world *w, const struct hg_culling_view *view,
    const struct hg_culling_lens *sample, struct picture *out, struct hg_culling_stats *stats)
{
    const struct hg_gpu_region all = {.width = WIDTH, .height = HEIGHT};
    hg_culling_reset(f->visible);
    check(f, hg_culling_add(f->visible, w->geometry, view, f->jobs, &f->err));
    check(f, hg_culling_upload(f->visible, f->jobs, &f->err));
    const struct hg_culling_sample slot = {sample, 0, 1};
    if (hg_culling_set(f->visible, 0)->hosted)
        check(f, hg_culling_draw_cpu(f->visible, &slot, f->jobs, &f->err));
    hg_geometry_fill(w->geometry, &((struct hg_gpu_frame *)f->block.mapped)->geometry);
    struct hg_pass pass = {.gpu = f->gpu, .features = HG_FEATURE_ALL};
    pass.bindings.uniforms[0] = (struct hg_gpu_uniform){f->block.address, BLOCK_BYTES};
    check(f, hg_gpu_begin(f->gpu, &pass.cmd, &f->err));
    const struct hg_visibility_scene scene = {f->visible, 0, 0};
    const struct hg_visibility_target target = {&f->image_ids, &f->image_depth};
    const struct hg_culling_set *set = hg_culling_set(f->visible, 0);
    check(f, hg_visibility_record(&pass, &scene, &target, &f->err));
    if (set->candidate_count > 0)
        check(f, hg_visibility_test(&pass, &scene, &target, &f->err));
    if (set->late_count > 0)
        check(f, hg_visibility_record_late(&pass, &scene, &target, &f->err));
    hg_gpu_image_read(pass.cmd, &f->image_ids, &all, &f->ids, 0);
    hg_gpu_image_read(pass.cmd, &f->image_depth, &all, &f->depth, 0);
    hg_gpu_memory_barrier(pass.cmd);
    submit(f, pass.cmd);
    memcpy(out->ids, f->ids.mapped, sizeof out->ids);
    memcpy(out->depth, f->depth.mapped, sizeof out->depth);
    hg_culling_stats(f->visible, stats);
}

static void assert_same(const struct picture *a, const struct picture *b, const char *what)
{
    uint32_t other = 0, first = 0;
    for (uint32_t i = PIXELS; i-- > 0;)
        if (memcmp(&a->ids[i * 2], &b->ids[i * 2], 8) != 0 || a->depth[i] != b->depth[i]) {
            first = i;
            other++;
        }
    if (other > 0)
        fail_msg("%s: %u pixels differ, the first is %u, %u: draw %u primitive %u depth %a, not %u "
                 "%u %a",
            what, other, first % WIDTH, first / WIDTH, b->ids[first * 2], b->ids[first * 2 + 1],
            (double)b->depth[first], a->ids[first * 2], a->ids[first * 2 + 1],
            (double)a->depth[first]);
}

// Drivers cut triangles at the border of the image, which rounds corners once more; twins: of
// surfaces that lie in one place another one may be seen then.
static void compare(
    struct fixture *f, const struct picture *device, const struct picture *host, bool twins)
{
    for (uint32_t i = 0; i < PIXELS; i++) {
        const float a = device->depth[i], b = host->depth[i];
        const bool other = memcmp(&device->ids[i * 2], &host->ids[i * 2], 8) != 0;
        if (other && !(twins && fabsf(a - b) <= SAME_DEPTH * a))
            f->other_ids++;
        else if (a != b)
            f->off_depth = fmaxf(f->off_depth, fabsf(a - b) / a);
        f->other_depth += a != b;
        f->hosted_px += host->ids[i * 2] != 0;
    }
}

// known: where the samples lie; else only that they are near the centres of pixels.
static struct hg_culling_lens lens_of(const struct hg_camera_setup *setup, bool known)
{
    struct hg_camera_setup s = *setup;
    struct hg_gpu_camera camera;
    if (!known)
        s.jitter_px[0] = s.jitter_px[1] = 0.0f;
    hg_camera_fill(&s, &camera);
    struct hg_culling_lens lens = {
        .width = WIDTH, .height = HEIGHT, .shift_px = known ? 0.0f : 2.0f};
    memcpy(lens.view_proj, camera.view_proj.m, sizeof lens.view_proj);
    memcpy(lens.clip, camera.proj.m + 12, sizeof lens.clip);
    return lens;
}

// A sieve for samples that lie half a pixel aside loses what it must not lose.
static void check_control(struct fixture *f, const struct world *w,
    const struct hg_camera_setup *setup, struct hg_culling_view view, const struct picture *off)
{
    static struct picture on;
    struct hg_culling_stats stats;
    struct hg_camera_setup aside = *setup;
    aside.jitter_px[0] += 0.5f;
    const struct hg_culling_lens lens = lens_of(&aside, true);
    view.lens = &lens;
    draw(f, w, &view, NULL, &on, &stats);
    f->spoiled += memcmp(off, &on, sizeof on) != 0;
}

// What the host draws is what the device draws: the same bytes where nothing is cut (by the driver
// whose arithmetic the host repeats), and nearly the same at the border of the image; with the
// history of the device, and with its own.
static void check_host(struct fixture *f, const struct world *w,
    const struct hg_camera_setup *setup, struct hg_culling_view view, const struct picture *off,
    const char *name)
{
    static struct picture on;
    struct hg_culling_stats stats;
    struct hg_camera_setup still = *setup;
    view.host_parts = f->views % 2 == 1; // clusters of baked parts alone, and meshlets of others
    still.jitter_px[0] = still.jitter_px[1] = 0.0f;
    const struct hg_culling_lens sample = lens_of(setup, true), whole = lens_of(&still, true);
    struct hg_culling_lens inner = whole; // the border of this lies inside of the image
    for (int c = 0; c < 4; c++) {
        inner.view_proj[c * 4] *= 2.0f;
        inner.view_proj[c * 4 + 1] *= 2.0f;
    }
    inner.clip[0] *= 2.0f;
    inner.clip[1] *= 2.0f;
    for (int pass = 0; pass < 4; pass++) {
        view.host = pass < 2 ? &inner : &whole;
        draw(f, w, &view, &sample, &on, &stats);
        f->hosted_views += pass >= 2 && hg_culling_set(f->visible, 0)->hosted;
        if (pass < 2 && strstr(hg_gpu_get_caps(f->gpu)->driver, "Mesa 22.3.") != NULL)
            assert_same(off, &on, name);
        else
            compare(f, off, &on, view.host_parts);
    }
}

static void check_view(struct fixture *f, const struct world *w, int index, const char *name)
{
    static struct picture off, on;
    struct hg_gpu_frame *frame = f->block.mapped;
    struct hg_culling_stats stats;
    char what[256];
    memset(frame, 0, sizeof *frame);
    struct hg_camera_setup camera = random_camera(f, w, index);
    hg_camera_fill(&camera, &frame->camera);
    frame->width = WIDTH;
    frame->height = HEIGHT;
    frame->inv_size = (struct hg_vec2){1.0f / WIDTH, 1.0f / HEIGHT};
    const struct hg_culling_view all = view_of(&frame->camera, false);
    struct hg_culling_view some = view_of(&frame->camera, true);
    const struct hg_culling_lens known = lens_of(&camera, true), near = lens_of(&camera, false);
    draw(f, w, &all, NULL, &off, &stats);
    f->drawn_off += stats.triangles;
    // No occlusion; occlusion, unknown and known; sieves with it and without.
    for (int pass = 0; pass < 5; pass++) {
        hg_culling_set_occlusion_from(f->visible, pass % 4 > 0 ? 1 : UINT64_MAX);
        some.lens = pass < 3 ? NULL : pass == 3 && index % 2 == 0 ? &near : &known;
        draw(f, w, &some, NULL, &on, &stats);
        snprintf(what, sizeof what, "%s, view %d, pass %d", name, index, pass);
        assert_same(&off, &on, what);
        f->drawn_on += pass == 0 ? stats.triangles : 0;
        f->drawn_sieved += pass == 4 ? stats.triangles : 0;
        f->hidden += pass == 2 ? stats.hidden : 0;
    }
    if (index % 3 == 0)
        check_control(f, w, &camera, some, &off);
    if (hg_gpu_get_caps(f->gpu)->is_cpu)
        check_host(f, w, &camera, some, &off, name);
    f->views++;
}

static void check_subject(struct fixture *f, const struct subject *subject)
{
    struct world w = open_world(f, subject);
    f->drawn_off = f->drawn_on = f->drawn_sieved = f->views = 0;
    const uint64_t before = f->hidden;
    for (int v = 0; v < VARIANTS; v++) {
        char what[128];
        snprintf(what, sizeof what, "%s as %d", subject->path, v);
        place(f, &w, (enum variant)v);
        for (int i = 0; i < subject->views; i++)
            check_view(f, &w, i, what);
    }
    print_message(
        "%s: %u views, %.0f thousand triangles of %.0f drawn, %.0f with sieves, %llu runs "
        "hidden\n",
        subject->path, f->views, (double)f->drawn_on * 1e-3, (double)f->drawn_off * 1e-3,
        (double)f->drawn_sieved * 1e-3, (unsigned long long)(f->hidden - before));
    assert_true(f->drawn_on < f->drawn_off);
    assert_true(f->drawn_sieved <= f->drawn_on);
    close_world(&w);
}

// Both ways of drawing agree, and there was something to be different.
static void assert_enough(struct fixture *f)
{
    print_message("%u views drawn by the host: of %.0f thousand pixels %llu show another triangle, "
                  "%llu another depth (by %.1e of it)\n",
        f->hosted_views, (double)f->hosted_px * 1e-3, (unsigned long long)f->other_ids,
        (unsigned long long)f->other_depth, (double)f->off_depth);
    if (hg_gpu_get_caps(f->gpu)->is_cpu) {
        assert_true(f->hosted_views > 100);
        assert_true((double)f->other_ids < 1e-5 * (double)f->hosted_px);
        assert_true(f->off_depth < 1e-4f);
    }
    assert_true(f->hidden > 100);
    assert_true(!hg_gpu_get_caps(f->gpu)->is_cpu || f->spoiled > 20);
    f->hosted_views = f->spoiled = 0;
    f->hosted_px = f->other_ids = f->other_depth = f->hidden = 0;
    f->off_depth = 0.0f;
}

#define KNOT TEST_MODELS "/knot/knot.gltf"

static void test_views(void **state)
{
    static const struct subject subjects[] = {
        {KNOT, HG_GEOMETRY_BAKE_NONE, TWICE, 4},
        {KNOT, HG_GEOMETRY_BAKE_NONE, SCRAMBLED, 4},
        {KNOT, HG_GEOMETRY_BAKE_NONE, BOTH_SIDES, 4},
        {KNOT, 500, AS_MADE, 8},
        {KNOT, 500, BOTH_SIDES, 4},
        {TEST_MODELS "/statue.ply.gz", HG_GEOMETRY_BAKE_NONE, AS_MADE, 2},
        {"demo:", HG_GEOMETRY_BAKE_NONE, AS_MADE, 4},
    };
    for (size_t i = 0; i < sizeof subjects / sizeof subjects[0]; i++)
        check_subject(*state, &subjects[i]);
    assert_enough(*state);
}

#define SUZANNE "khronos/IridescenceSuzanne/glTF-Binary/IridescenceSuzanne.glb"

static void test_views_of_samples(void **state)
{
    static const struct subject subjects[] = {
        {"khronos/MetalRoughSpheresNoTextures/glTF-Binary/MetalRoughSpheresNoTextures.glb",
            HG_GEOMETRY_BAKE_NONE, AS_MADE, 2},
        {SUZANNE, HG_GEOMETRY_BAKE_NONE, AS_MADE, 8},
        {SUZANNE, HG_GEOMETRY_BAKE_NONE, TWICE, 4},
        {SUZANNE, HG_GEOMETRY_BAKE_NONE, SCRAMBLED, 4},
        {SUZANNE, HG_GEOMETRY_BAKE_NONE, BOTH_SIDES, 4},
        {SUZANNE, 500, AS_MADE, 8},
        {SUZANNE, 500, BOTH_SIDES, 4},
        {"khronos/NegativeScaleTest/glTF-Binary/NegativeScaleTest.glb", HG_GEOMETRY_BAKE_NONE,
            AS_MADE, 4},
        {"khronos/LightsPunctualLamp/glTF/LightsPunctualLamp.gltf", HG_GEOMETRY_BAKE_NONE, AS_MADE,
            8},
        {"khronos/SheenChair/glTF/SheenChair.gltf", HG_GEOMETRY_BAKE_NONE, AS_MADE, 4},
    };
    for (size_t i = 0; i < sizeof subjects / sizeof subjects[0]; i++)
        check_subject(*state, &subjects[i]);
    assert_enough(*state);
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)2);
    hg_log_set_level(HG_LOG_WARN);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_views), cmocka_unit_test(test_views_of_samples)};
    return test_run_group(tests, setup, teardown);
}
