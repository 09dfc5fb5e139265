// path_same.c - path-traced pictures and all their planes are the same bits when they are
// interrupted and gone on with elsewhere, on any number of threads, and whether the host or the
// device adds samples to the film.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/sha256.h"
#include "renderer/internal.h"
#include "tests/analytic/path_rig.h"

enum { MOST_PARTS = HG_PLANE_COUNT + 16 };

#define BIT(plane) (1u << HG_PLANE_##plane)
#define ALL        ((1u << HG_PLANE_COUNT) - 1u - BIT(COLOR) - BIT(SAMPLES) - BIT(VARIANCE) - BIT(NOISY))

// --- pictures ------------------------------------------------------------------------------------

struct option_set {
    const char *name;
    bool moves, catches;
    bool host_only; // test_device_film: another set has all that the film holds
    uint32_t branches;
    uint32_t save_at; // samples; 0 = 3
    struct hg_view_params params;
};

#define COMMON                                                                                     \
    .width = 112, .height = 40, .tonemap = HG_TONEMAP_LINEAR, .mode = HG_MODE_PATH, .seed = 7,     \
    .frame_s = 0.5f, .max_bounces = 4

static const struct option_set sets[] = {
    {"planes", .params = {COMMON, .samples = 8, .planes = ALL}},
    {"wide filter", .params = {COMMON, .samples = 8, .planes = ALL, .filter = HG_FILTER_GAUSSIAN,
                        .filter_radius_px = 2.5f}},
    {"shutter", .moves = true, .host_only = true,
        .params = {COMMON, .samples = 8, .planes = ALL, .shutter_open = -0.5f,
            .shutter_close = 0.5f}},
    {"denoise", .host_only = true,
        .params = {COMMON, .samples = 8, .planes = ALL, .denoise = HG_DENOISE_STILL}},
    {"series, shutter", .moves = true,
        .params = {COMMON, .samples = 8, .planes = ALL, .denoise = HG_DENOISE_ANIMATION,
            .shutter_close = 0.5f}},
    {"catcher", .catches = true,
        .params = {COMMON, .samples = 8, .planes = BIT(LIGHT_GROUPS) | BIT(DEPTH),
            .background = HG_BACKGROUND_NONE}},
    {"noise", .host_only = true, .save_at = 18,
        .params = {COMMON, .samples = 32, .noise = 0.04f, .planes = BIT(ALBEDO) | BIT(DRAWS)}},
    {"noise, branches, denoise", .branches = 2, .save_at = 18,
        .params = {COMMON, .samples = 32, .noise = 0.04f, .denoise = HG_DENOISE_STILL}},
};
enum { SETS = sizeof sets / sizeof *sets };

static void name(struct hg_object *object, const char *text)
{
    hg_free(object->name);
    object->name = hg_strdup(text);
    assert_non_null(object->name);
}

static struct hg_node *node_at(const struct rig *rig, uint32_t index)
{
    return (struct hg_node *)rig->scene->objects[HG_OBJECT_NODE].items[index];
}

// The room of path_rig.h: floor, wall, ball, lamp; a sun besides. What moves: the ball slides, the
// wall turns. Half of the floor's light comes through a leaf that is half there.
static void open_scene(struct rig *rig, const struct option_set *set)
{
    static const double high[3] = {1, 3, 1}, down[3] = {-0.3, -1, -0.2};
    static const float leaf[4][3] = {
        {-1, 0.6f, 0.6f}, {0, 0.6f, 0.6f}, {0, 1.2f, 0.6f}, {-1, 1.2f, 0.6f}};
    static const float slide[9] = {-0.3f, 0, 0, 0, 0, 0, 0.3f, 0.1f, 0};
    static const float turn[12] = {0, -0.5f, 0, 0.8660254f, 0, 0, 0, 1, 0, 0.5f, 0, 0.8660254f};
    path_rig_room(rig);
    name(&node_at(rig, 3)->head, "Lamp.001");
    rig_light(rig, HG_LIGHT_DIRECTIONAL, high, down)->casts_shadow = true;
    struct hg_material *half = path_rig_lambert(rig, 0.8f);
    half->alpha_mode = HG_ALPHA_BLEND;
    half->base_color[3] = 0.5f;
    rig_quad(rig, half, leaf);
    node_at(rig, 0)->catches_shadows = set->catches;
    if (!set->moves)
        return;
    path_rig_animate(rig, node_at(rig, 2), HG_ANIM_TRANSLATION, 3, slide);
    path_rig_animate(rig, node_at(rig, 1), HG_ANIM_ROTATION, 3, turn);
    path_rig_pose(rig, 1.0);
}

static struct hg_view *open_view(struct rig *rig, const struct option_set *set)
{
    static const float eye[3] = {0.5f, 1.2f, 3.5f}, target[3] = {0, 0.5f, 0};
    rig->renderer->context.overrides.path_branches = set->branches;
    struct hg_view *view = path_rig_view(rig, &set->params);
    path_rig_look(view, eye, target, 0.8f);
    return view;
}

// Everything that can be read of a view.
struct picture {
    struct hg_refbuf *parts[MOST_PARTS];
    uint32_t count, samples; // which one holds samples
};

static bool has_plane(const struct hg_view_params *params, uint32_t plane)
{
    const uint32_t always = BIT(COLOR) | BIT(SAMPLES) | BIT(VARIANCE);
    const bool noisy = params->denoise != HG_DENOISE_OFF && plane == HG_PLANE_NOISY;
    return plane != HG_PLANE_LIGHT_GROUPS &&
           (noisy || ((params->planes | always) >> plane & 1u) != 0);
}

static void read_all(struct hg_view *view, const struct hg_view_params *params, struct picture *out)
{
    struct hg_error err = {0};
    *out = (struct picture){0};
    for (uint32_t i = 0; i < HG_PLANE_COUNT; i++) {
        if (i == HG_PLANE_SAMPLES)
            out->samples = out->count;
        if (has_plane(params, i))
            out->parts[out->count++] = path_rig_plane(view, (enum hg_plane)i);
    }
    for (uint32_t i = 0; i < hg_view_light_groups(view); i++)
        test_ok(hg_view_read_light_group(view, i, &out->parts[out->count++], &err), &err);
    for (int i = 0; i < 3 && (params->planes & BIT(DRAWS)) != 0; i++) {
        struct hg_matte matte;
        test_ok(hg_view_read_matte(view, (enum hg_matte_kind)i, &matte, &err), &err);
        out->parts[out->count++] = hg_refbuf_ref(matte.ranks);
        hg_cryptomatte_view_finish(&matte);
    }
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &out->parts[out->count++], &err), &err);
}

static void drop(struct picture *p)
{
    for (uint32_t i = 0; i < p->count; i++)
        hg_refbuf_unref(p->parts[i]);
}

// In a scene of its own. from: a checkpoint; NULL = from the start.
static void render(struct rig *rig, const struct option_set *set, const struct hg_refbuf *from,
    struct picture *out)
{
    struct hg_error err = {0};
    open_scene(rig, set);
    struct hg_view *view = open_view(rig, set);
    if (from != NULL)
        test_ok(hg_view_load(view, from->data, from->size, &err), &err);
    path_rig_settle(view);
    read_all(view, &set->params, out);
    hg_view_destroy(view);
}

static void assert_same(
    const char *set, const char *how, const struct picture *a, const struct picture *b)
{
    assert_int_equal(a->count, b->count);
    for (uint32_t i = 0; i < a->count; i++) {
        const size_t size = a->parts[i]->size;
        assert_int_equal(size, b->parts[i]->size);
        if (memcmp(a->parts[i]->data, b->parts[i]->data, size) == 0)
            continue;
        const float *x = (const float *)(const void *)a->parts[i]->data;
        const float *y = (const float *)(const void *)b->parts[i]->data;
        double most = 0;
        uint32_t differ = 0;
        for (size_t k = 0; k < size / sizeof *x; k++) {
            most = fmax(most, fabs((double)x[k] - (double)y[k]));
            differ += memcmp(&x[k], &y[k], sizeof *x) != 0;
        }
        fail_msg("%s, %s: part %u of %u differs in %u of %zu numbers, by %g at most", set, how, i,
            a->count, differ, size / sizeof *x, most);
    }
}

// --- interrupted ---------------------------------------------------------------------------------

// Steps of one piece of work each, so that waves are interrupted in their middle: `pieces` behind
// the beginning of a pass.
static struct hg_refbuf *save_after(struct rig *rig, const struct option_set *set, int pieces)
{
    const uint32_t samples = set->save_at > 0 ? set->save_at : 3;
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    struct hg_refbuf *saved;
    open_scene(rig, set);
    struct hg_view *view = open_view(rig, set);
    rig->renderer->context.overrides.path_slice_ns = 1;
    while (info.samples < samples || pieces-- > 0) {
        test_ok(hg_view_step(view, 1, &info, &err), &err);
        assert_false(info.settled);
    }
    rig->renderer->context.overrides.path_slice_ns = 0;
    test_ok(hg_view_save(view, &saved, &err), &err);
    hg_view_destroy(view);
    return saved;
}

static struct picture wholes[SETS]; // made once for all tests, on the host, without a pause

// With a limit of noise some tiles have more samples than others.
static void expect_some_done(int set)
{
    const struct hg_refbuf *samples = wholes[set].parts[wholes[set].samples];
    const float *at = (const float *)(const void *)samples->data;
    float least = at[0], most = at[0];
    for (size_t i = 0; i < samples->size / sizeof *at; i++) {
        least = fminf(least, at[i]);
        most = fmaxf(most, at[i]);
    }
    print_message("%s: %g to %g samples\n", sets[set].name, (double)least, (double)most);
    assert_true(most > (float)sets[set].save_at);
    assert_true(sets[set].params.noise > 0 ? least < (float)sets[set].save_at : least == most);
}

static const struct picture *whole(struct rig *rig, int set)
{
    if (wholes[set].count == 0)
        render(rig, &sets[set], NULL, &wholes[set]);
    expect_some_done(set);
    return &wholes[set];
}

static int drop_all(void **state)
{
    for (int i = 0; i < SETS; i++)
        drop(&wholes[i]);
    return rig_tear_down(state);
}

static void test_resumed(void **state)
{
    struct rig *rig = *state;
    for (int i = 0; i < SETS; i++) {
        struct hg_refbuf *saved = save_after(rig, &sets[i], 2 + 3 * i);
        struct picture resumed;
        render(rig, &sets[i], saved, &resumed);
        assert_same(sets[i].name, "gone on with", whole(rig, i), &resumed);
        hg_refbuf_unref(saved);
        drop(&resumed);
    }
}

// A checkpoint takes the place of what a settled view holds, at once; one of a scene that is edited
// before it counts is in no picture.
static void test_resumed_late(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    const struct option_set *set = &sets[0];
    struct hg_refbuf *saved = save_after(rig, set, 5);
    struct picture pictures[2];
    open_scene(rig, set);
    struct hg_view *view = open_view(rig, set);
    path_rig_settle(view);
    test_ok(hg_view_load(view, saved->data, saved->size, &err), &err);
    struct hg_frame_info info;
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    assert_true(info.samples >= 3 && !info.settled);
    path_rig_settle(view);
    read_all(view, &set->params, &pictures[0]);
    hg_view_destroy(view);
    assert_same(set->name, "gone on with late", whole(rig, 0), &pictures[0]);
    drop(&pictures[0]);
    for (int fresh = 0; fresh < 2; fresh++) {
        open_scene(rig, set);
        view = open_view(rig, set);
        if (!fresh)
            test_ok(hg_view_load(view, saved->data, saved->size, &err), &err);
        node_at(rig, 2)->translation[0] += 0.3f;
        hg_scene_touch(rig->scene, &node_at(rig, 2)->head);
        hg_scene_publish(rig->scene);
        path_rig_settle(view);
        read_all(view, &set->params, &pictures[fresh]);
        hg_view_destroy(view);
    }
    assert_same(set->name, "edited before it counts", &pictures[1], &pictures[0]);
    for (int i = 0; i < 2; i++)
        drop(&pictures[i]);
    hg_refbuf_unref(saved);
}

// What is damaged, cut off or of other parameters is refused.
static void test_refused(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct option_set set = sets[0];
    struct hg_refbuf *saved = save_after(rig, &set, 5);
    struct hg_view *view = open_view(rig, &set);
    saved->data[saved->size - 1] ^= 1;
    assert_int_equal(hg_view_load(view, saved->data, saved->size, &err), HG_E_INVAL);
    saved->data[saved->size - 1] ^= 1;
    assert_int_equal(hg_view_load(view, saved->data, saved->size - 1, &err), HG_E_INVAL);
    test_ok(hg_view_load(view, saved->data, saved->size, &err), &err);
    set.params.seed++;
    test_ok(hg_view_set_params(view, &set.params, &err), &err);
    assert_int_equal(hg_view_load(view, saved->data, saved->size, &err), HG_E_INVAL);
    hg_view_destroy(view);
    hg_refbuf_unref(saved);
}

// --- the device's film ---------------------------------------------------------------------------

// Without mapped memory the device adds samples to the film (path_add.comp), as GPUs do.
static void test_device_film(void **state)
{
    struct rig *rig = *state, staged;
    setenv("HELIO_GPU_FORCE_STAGING", "1", 1);
    rig_init(&staged);
    unsetenv("HELIO_GPU_FORCE_STAGING");
    assert_true(hg_gpu_get_caps(staged.renderer->context.gpu)->is_cpu);
    for (int i = 0; i < SETS; i++) {
        struct picture device;
        if (sets[i].host_only)
            continue;
        render(&staged, &sets[i], NULL, &device);
        assert_same(sets[i].name, "added by the device", whole(rig, i), &device);
        drop(&device);
    }
    rig_finish(&staged);
}

// --- beside other users of the scene's rays ------------------------------------------------------

enum { ASKED_ROW = 80, ASKED_ROWS = 50, ASKED = ASKED_ROW * ASKED_ROWS };

// What a pass of a real-time view does: rays at the default level of detail.
struct pass {
    struct hg_rays_scene *rays;
    struct hg_gpu_buffer wave[2], once; // rays and hits; hits before the step of the other view
};

static void open_pass(struct pass *pass, struct hg_view *beside)
{
    struct hg_gpu *gpu = beside->renderer->context.gpu;
    struct hg_rays *rays = hg_view_rays(beside);
    const struct hg_rays_key key = hg_rays_default_key(rays, HG_TRACE_AUTO, true);
    struct hg_gpu_buffer *all[3] = {&pass->wave[0], &pass->wave[1], &pass->once};
    struct hg_error err = {0};
    *pass = (struct pass){0};
    test_ok(hg_rays_ref(rays, &key, &pass->rays, &err), &err);
    for (int i = 0; i < 3; i++)
        test_ok(hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK,
                    ASKED * (i == 0 ? sizeof(struct hg_gpu_ray) : sizeof(struct hg_gpu_hit)),
                    "rays of a pass", all[i], &err),
            &err);
    struct hg_gpu_ray *to = pass->wave[0].mapped;
    for (int i = 0; i < ASKED; i++)
        to[i] = (struct hg_gpu_ray){.origin_ws = {0.5f, 1.2f, 3.5f},
            .direction_ws = {2.0f * (float)(i % ASKED_ROW) / ASKED_ROW - 1,
                (float)(i / ASKED_ROW) / ASKED_ROWS - 1, -3},
            .t_max = 1e30f,
            .mask = HG_RAY_ALL};
}

static void close_pass(struct pass *pass, struct hg_view *beside)
{
    struct hg_gpu *gpu = beside->renderer->context.gpu;
    hg_rays_unref(pass->rays);
    hg_gpu_buffer_destroy(gpu, &pass->wave[0]);
    hg_gpu_buffer_destroy(gpu, &pass->wave[1]);
    hg_gpu_buffer_destroy(gpu, &pass->once);
}

// Traces before a step of the path-traced view, and the same rays after it.
static void ask(struct pass *pass)
{
    struct hg_error err = {0};
    const struct hg_trace_wave wave = {.rays = &pass->wave[0], .hits = &pass->once, .count = ASKED};
    memset(pass->once.mapped, 0x55, ASKED * sizeof(struct hg_gpu_hit)); // misses leave some
    memset(pass->wave[1].mapped, 0x55, ASKED * sizeof(struct hg_gpu_hit));
    test_ok(hg_rays_sync(pass->rays, &err), &err);
    test_ok(hg_trace_closest(hg_rays_trace(pass->rays), &wave, &err), &err);
}

static void hear(struct pass *pass)
{
    struct hg_error err = {0};
    const struct hg_trace_wave wave = {
        .rays = &pass->wave[0], .hits = &pass->wave[1], .count = ASKED};
    test_ok(hg_trace_closest(hg_rays_trace(pass->rays), &wave, &err), &err);
    assert_memory_equal(pass->wave[1].mapped, pass->once.mapped, ASKED * sizeof(struct hg_gpu_hit));
    const struct hg_gpu_hit *hits = pass->wave[1].mapped;
    uint32_t found = 0;
    for (uint32_t i = 0; i < ASKED; i++)
        found += hits[i].draw != HG_HIT_NONE;
    assert_in_range(found, ASKED / 4, ASKED);
}

static void test_beside_rays(void **state)
{
    static const float eye[3] = {-1.5f, 1.0f, 2.0f}, target[3] = {0, 0.5f, 0};
    struct rig *rig = *state;
    const struct hg_view_params realtime = {.width = 64, .height = 32, .samples = 4};
    struct hg_error err = {0};
    for (int i = 0; i < 3; i++) { // planes, a wide filter, a shutter that poses the scene
        struct hg_frame_info info = {0}, other;
        struct picture beside;
        struct pass pass;
        open_scene(rig, &sets[i]);
        struct hg_view *view = open_view(rig, &sets[i]);
        struct hg_view *second = path_rig_view(rig, &realtime);
        path_rig_look(second, eye, target, 0.8f);
        path_rig_steps(second, 1);
        open_pass(&pass, second);
        rig->renderer->context.overrides.path_slice_ns = 1;
        while (!info.settled) {
            path_rig_look(second, (float[3]){eye[0], eye[1], eye[2] + 0.01f * (float)info.samples},
                target, 0.8f);
            test_ok(hg_view_step(second, 1, &other, &err), &err);
            ask(&pass);
            if (sets[i].moves) // answers are of the pose that was asked about
                hear(&pass);
            test_ok(hg_view_step(view, 1, &info, &err), &err);
            if (!sets[i].moves)
                hear(&pass);
        }
        rig->renderer->context.overrides.path_slice_ns = 0;
        read_all(view, &sets[i].params, &beside);
        close_pass(&pass, second);
        hg_view_destroy(second);
        hg_view_destroy(view);
        assert_same(sets[i].name, "beside a pass that asks", whole(rig, i), &beside);
        drop(&beside);
    }
}

// --- threads -------------------------------------------------------------------------------------

static const char *self;

// More tiles than a wave has, some of them done before others.
static const struct option_set many = {"threads", .moves = true,
    .params = {.width = 384,
        .height = 352,
        .tonemap = HG_TONEMAP_LINEAR,
        .mode = HG_MODE_PATH,
        .seed = 7,
        .frame_s = 0.5f,
        .samples = 2,
        .max_bounces = 4,
        .shutter_close = 0.5f,
        .planes = ALL,
        .denoise = HG_DENOISE_STILL}};

static int print_hash(unsigned threads)
{
    struct hg_error err = {0};
    struct hg_renderer_params params = {.threads = threads};
    struct rig rig = {0};
    struct picture p;
    uint8_t hash[HG_SHA256_BYTES];
    test_ok(hg_renderer_create(&params, &rig.renderer, &err), &err);
    render(&rig, &many, NULL, &p);
    for (uint32_t i = 0; i < p.count; i++) {
        if (hg_sha256(p.parts[i]->data, p.parts[i]->size, hash) != HG_OK)
            return 1;
        for (int k = 0; k < 8; k++)
            printf("%02x", hash[k]);
    }
    drop(&p);
    rig_finish(&rig);
    return 0;
}

static void hash_in_child(unsigned threads, char hex[MOST_PARTS * 16 + 1])
{
    char command[1200], line[MOST_PARTS * 16 + 1];
    snprintf(command, sizeof command, "LP_NUM_THREADS=%u '%s' --hash %u", threads, self, threads);
    FILE *pipe = popen(command, "r");
    assert_non_null(pipe);
    assert_non_null(fgets(line, sizeof line, pipe));
    assert_int_equal(pclose(pipe), 0);
    assert_true(strlen(line) >= 16 * 20);
    memcpy(hex, line, sizeof line);
}

static void test_thread_count_changes_nothing(void **state)
{
    (void)state;
    char one[MOST_PARTS * 16 + 1], three[MOST_PARTS * 16 + 1];
    hash_in_child(1, one);
    hash_in_child(3, three);
    assert_string_equal(one, three);
}

int main(int argc, char **argv)
{
    self = argv[0];
    if (argc == 3 && strcmp(argv[1], "--hash") == 0)
        return print_hash((unsigned)atoi(argv[2]));
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_resumed),
        cmocka_unit_test(test_resumed_late), cmocka_unit_test(test_refused),
        cmocka_unit_test(test_beside_rays), cmocka_unit_test(test_device_film),
        cmocka_unit_test(test_thread_count_changes_nothing)};
    return cmocka_run_group_tests(tests, rig_set_up, drop_all);
}
