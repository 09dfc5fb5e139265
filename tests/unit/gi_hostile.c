// gi_hostile.c - global illumination in hostile scenes, in motion and at rest: bounded time
// and memory, and no number in a picture that is none.
#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

#define WIDTH       48
#define HEIGHT      32
#define MOVES       2
#define MOST_NS     240000000000u // of processor time, for all pictures of a scene
#define MOST_BYTES  (168u << 20)  // of both fields
#define MOST_PROBES (2048u + 2560 + 5 * 512)

static struct hg_renderer *renderer; // of all scenes

// --- scenes --------------------------------------------------------------------------------------

static struct hg_material *add_material(
    struct hg_scene *scene, uint64_t id, float albedo, float emission)
{
    struct hg_material *m = rig_add(scene, HG_OBJECT_MATERIAL, id);
    hg_material_set_defaults(m);
    m->metallic = 0.0f;
    for (int i = 0; i < 3; i++) {
        m->base_color[i] = albedo;
        m->emissive[i] = emission;
    }
    return m;
}

struct triangles {
    uint32_t count;
    const float *positions, *normals; // [count * 9]
};

static struct hg_mesh_part *add_triangles(
    struct hg_scene *scene, uint64_t id, const struct triangles *t, struct hg_material *material)
{
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, id);
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
    uint32_t *indices = hg_calloc(t->count * 3ull, sizeof *indices);
    assert_non_null(indices);
    for (uint32_t i = 0; i < t->count * 3; i++)
        indices[i] = i;
    struct hg_mesh_part *part =
        rig_part(mesh, t->count * 3, t->positions, t->normals, t->count * 3, indices);
    hg_free(indices);
    part->material = material;
    node->mesh = mesh;
    return part;
}

// A box seen from outside, or with `turned` from inside. normal: of all its vertices, NULL: right.
static void add_box(struct hg_scene *scene, uint64_t id, float half, bool turned,
    const float normal[3], struct hg_material *material)
{
    float positions[36 * 3], normals[36 * 3];
    uint32_t n = 0;
    for (uint32_t which = 0; which < 6; which++) {
        const uint32_t axis = which / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
        const float high = which % 2 ? 1.0f : -1.0f;
        const bool flip = (which % 2 == 0) != turned;
        static const float corners[6][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, -1}, {1, 1}, {-1, 1}};
        for (uint32_t i = 0; i < 6; i++, n += 3) {
            const float *c = corners[flip ? 5 - i : i];
            positions[n + axis] = half * high;
            positions[n + u] = half * c[0];
            positions[n + v] = half * c[1];
            normals[n + axis] = turned ? -high : high;
            normals[n + u] = normals[n + v] = 0;
            for (uint32_t k = 0; k < 3 && normal != NULL; k++)
                normals[n + k] = normal[k];
        }
    }
    const struct triangles t = {12, positions, normals};
    add_triangles(scene, id, &t, material);
}

static void add_lamp(struct hg_scene *scene, uint64_t id, const float at[3], float candela)
{
    struct hg_light *light = rig_add(scene, HG_OBJECT_LIGHT, id);
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
    light->kind = HG_LIGHT_POINT;
    light->intensity = candela;
    memcpy(node->translation, at, 3 * sizeof *at);
    node->light = light;
}

// A room of 4 m with a box in it.
static struct hg_scene *make_room(float albedo, float emission)
{
    struct hg_scene *scene = rig_new_scene();
    add_box(scene, 1, 2, true, NULL, add_material(scene, 1, albedo, emission));
    add_box(scene, 2, 0.5f, false, NULL, add_material(scene, 2, albedo, emission));
    return scene;
}

// --- pictures ------------------------------------------------------------------------------------

static void look(struct rig *rig, float distance, int at)
{
    const float turn = 0.05f * (float)at;
    const struct hg_view_camera camera = {
        .eye = {distance * sinf(turn), 0.3f * distance, distance * cosf(turn)}, .vfov_rad = 1};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

static void assert_finite(struct rig *rig, const char *name, const char *when)
{
    struct hg_refbuf *pixels = rig_pixels(rig, HG_PIXEL_RGBA32F);
    const float *p = (const float *)(const void *)pixels->data;
    uint32_t bad = 0;
    for (uint32_t i = 0; i < WIDTH * HEIGHT * 4; i++)
        bad += !isfinite(p[i]);
    hg_refbuf_unref(pixels);
    if (bad > 0)
        fail_msg("%s: %u numbers of a picture %s are none", name, bad, when);
}

static void assert_bounded(struct rig *rig, const char *name, uint64_t begin)
{
    struct hg_gi_stats stats;
    const uint64_t spent = hg_clock_cpu_ns() - begin;
    hg_gi_stats(rig->view->state.scene_gpu->gi, &stats);
    print_message("%s: %u probes, %.1f MiB, %.1f s\n", name, stats.probes,
        (double)stats.bytes / (1 << 20), (double)spent * 1e-9);
    assert_true(stats.probes <= MOST_PROBES);
    assert_true(stats.bytes <= MOST_BYTES);
    assert_true(spent < MOST_NS);
}

// What is seen, and for how many pictures in motion and as many while the scene changes.
struct walk {
    float distance;
    int moves;
    enum hg_debug_view as;
};

// In motion, then in motion while the scene changes, and at rest. Takes the scene.
static void show_as(const char *name, struct hg_scene *scene, const struct walk *walk)
{
    const struct hg_view_params params = {
        .width = WIDTH, .height = HEIGHT, .samples = 2, .gi = HG_GI_RAYS, .debug_view = walk->as};
    const uint64_t begin = hg_clock_cpu_ns();
    struct rig rig = {.renderer = renderer};
    hg_scene_publish(scene);
    rig_use_scene(&rig, scene, &params);
    hg_view_set_formats(rig.view, 1u << HG_PIXEL_RGBA32F);
    for (int i = 0; i < 2 * walk->moves; i++) {
        look(&rig, walk->distance, i);
        if (i >= walk->moves)
            hg_scene_publish(scene);
        rig_step(&rig, 1);
        assert_finite(&rig, name, "in motion");
    }
    rig_settle(&rig, 8);
    assert_finite(&rig, name, "at rest");
    assert_bounded(&rig, name, begin);
    rig_close_scene(&rig);
}

static void show(const char *name, struct hg_scene *scene, float distance)
{
    const struct walk walk = {distance, MOVES, HG_DEBUG_OFF};
    show_as(name, scene, &walk);
}

// --- tests ---------------------------------------------------------------------------------------

static struct hg_scene *make_lamps(uint32_t side)
{
    struct hg_scene *scene = make_room(0.5f, 0);
    const float step = 3.9f / (float)side;
    for (uint32_t i = 0; i < side * side * side; i++) {
        const uint32_t cell[3] = {i % side, i / side % side, i / (side * side)};
        float at[3];
        for (int a = 0; a < 3; a++)
            at[a] = ((float)cell[a] + 0.5f) * step - 1.95f;
        add_lamp(scene, 100 + i, at, 1e-4f);
    }
    return scene;
}

// Surfaces of a picture are lit by all lamps without a range, so that of a million is what probes
// bring alone. Each picture after a change gathers the light of all of them anew: one will do.
static void test_lamps(void **state)
{
    const struct walk walk = {1.5f, 1, HG_DEBUG_IRRADIANCE};
    (void)state;
    show("a thousand lamps", make_lamps(10), 1.5f);
    show_as("a million lamps", make_lamps(100), &walk);
}

static void test_emission(void **state)
{
    (void)state;
    show("all emissive", make_room(0.9f, 1e4f), 1.5f);
    show("all emissive, and white", make_room(1, 100), 1.5f);
    show("all emissive beyond measure", make_room(1, 3e38f), 1.5f);
    struct hg_scene *scene = make_room(0.5f, 0);
    add_lamp(scene, 100, (const float[3]){1, 1, 1}, 3e38f);
    show("a lamp beyond measure", scene, 1.5f);
}

static void test_normals(void **state)
{
    (void)state;
    static const float bad[3][3] = {{NAN, NAN, NAN}, {0, 0, 0}, {INFINITY, 0, 0}};
    static const char *const names[3] = {
        "normals that are none", "normals of no length", "infinite normals"};
    for (int i = 0; i < 3; i++) {
        struct hg_scene *scene = rig_new_scene();
        add_box(scene, 1, 2, true, bad[i], add_material(scene, 1, 0.5f, 0.1f));
        add_box(scene, 2, 0.5f, false, bad[i], add_material(scene, 2, 0.5f, 0));
        add_lamp(scene, 100, (const float[3]){1, 1, 1}, 5);
        show(names[i], scene, 1.5f);
    }
}

static void test_sizes(void **state)
{
    (void)state;
    struct hg_scene *scene = make_room(0.5f, 0.2f);
    const float wide[9] = {-1e6f, -2, -1e6f, 0, -2, 1e6f, 1e6f, -2, -1e6f};
    const float up[9] = {0, 1, 0, 0, 1, 0, 0, 1, 0};
    const struct triangles t = {1, wide, up};
    rig_environment(scene, 1, 1, 1);
    add_triangles(scene, 3, &t, add_material(scene, 3, 0.5f, 0));
    show("2,000 km wide", scene, 1.5f);

    scene = rig_new_scene();
    rig_environment(scene, 1, 1, 1);
    add_box(scene, 1, 1e-4f, false, NULL, add_material(scene, 1, 0.5f, 0));
    show("a tenth of a millimetre", scene, 4e-4f);
}

static void test_shapes(void **state)
{
    (void)state;
    struct hg_scene *scene = rig_new_scene();
    rig_environment(scene, 1, 1, 1);
    show("empty", scene, 3);

    scene = rig_new_scene();
    rig_environment(scene, 1, 1, 1);
    add_box(scene, 1, 2, false, NULL, add_material(scene, 1, 0.5f, 0.1f));
    add_box(scene, 2, 0.5f, true, NULL, add_material(scene, 2, 0.5f, 0));
    show("inside out", scene, 1.5f);

    const float one[9] = {-1, 0, 0, 1, 0, 0, 0, 1, 0}, same[9] = {0};
    const float front[9] = {0, 0, 1, 0, 0, 1, 0, 0, 1};
    const struct triangles triangle = {1, one, front}, point = {1, same, front};
    scene = rig_new_scene();
    rig_environment(scene, 1, 1, 1);
    add_triangles(scene, 1, &triangle, add_material(scene, 1, 0.5f, 0));
    show("one triangle", scene, 3);

    scene = rig_new_scene();
    rig_environment(scene, 1, 1, 1);
    add_triangles(scene, 1, &point, add_material(scene, 1, 0.5f, 0));
    show("a triangle of no size", scene, 3);

    scene = rig_new_scene();
    rig_environment(scene, 1, 1, 1);
    struct hg_mesh_part *part = add_triangles(scene, 1, &point, add_material(scene, 1, 0.5f, 0));
    part->topology = HG_TOPOLOGY_POINTS;
    part->vertex_count = part->index_count = 1;
    show("one point", scene, 3);
}

// --- the budget ----------------------------------------------------------------------------------

static void open_under(struct rig *rig, struct hg_scene *scene, uint32_t budget_kib,
    const struct hg_view_params *params)
{
    const struct hg_renderer_params small = {
        .geometry_budget_bytes = (uint64_t)budget_kib << 10, .threads = 2};
    rig_open_with(rig, &small);
    hg_scene_publish(scene);
    rig_use_scene(rig, scene, params);
    look(rig, 1.5f, 0);
}

static struct hg_refbuf *settle_under(uint32_t budget_mib, enum hg_view_gi gi)
{
    const struct hg_view_params params = {.width = WIDTH, .height = HEIGHT, .samples = 2, .gi = gi};
    struct rig rig = {0};
    open_under(&rig, make_room(0.5f, 0.2f), budget_mib << 10, &params);
    rig_settle(&rig, 8);
    struct hg_refbuf *out = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_close_scene(&rig);
    rig_close(&rig);
    return out;
}

// Steps until one fails.
static enum hg_status settle_final(struct rig *rig)
{
    struct hg_frame_info info = {0};
    enum hg_status status = HG_OK;
    hg_view_set_final(rig->view, true);
    for (int i = 0; i < 4000 && !info.settled && status == HG_OK; i++)
        status = hg_view_step(rig->view, 8, &info, &rig->err);
    return status;
}

// What is asked for settled does not depend on budgets: it is as it is with memory, or there is
// none, also where a picture in motion was without that light before.
static void test_budget_of_settled(void **state)
{
    struct hg_view_params params = {
        .width = WIDTH, .height = HEIGHT, .samples = 2, .gi = HG_GI_RAYS};
    struct rig rig = {0};
    (void)state;
    open_under(&rig, make_room(0.5f, 0.2f), 8 << 10, &params);
    rig_step(&rig, 1);
    assert_int_equal(settle_final(&rig), HG_E_LIMIT);
    assert_non_null(strstr(rig.err.reason, "gi none"));
    assert_int_equal(settle_final(&rig), HG_E_LIMIT);
    params.gi = HG_GI_NONE;
    test_ok(hg_view_set_params(rig.view, &params, &rig.err), &rig.err);
    assert_int_equal(settle_final(&rig), HG_OK);
    rig_close_scene(&rig);
    rig_close(&rig);
}

// Probes that do not fit are none, and a picture that is displayed is that without them.
static void test_budget(void **state)
{
    (void)state;
    struct hg_refbuf *none = settle_under(8, HG_GI_NONE), *small = settle_under(8, HG_GI_RAYS),
                     *large = settle_under(64, HG_GI_RAYS);
    rig_assert_same(none, small);
    assert_true(rig_difference(none, large) > 0.01);
    hg_refbuf_unref(none);
    hg_refbuf_unref(small);
    hg_refbuf_unref(large);
}

static int set_up(void **state)
{
    struct rig rig = {0};
    (void)state;
    rig_open(&rig, false);
    renderer = rig.renderer;
    return 0;
}

static int tear_down(void **state)
{
    struct rig rig = {.renderer = renderer};
    (void)state;
    rig_close(&rig);
    return 0;
}

int main(int argc, char **argv) // argv[1]: only tests of this name
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_budget),
        cmocka_unit_test(test_budget_of_settled),
        cmocka_unit_test(test_shapes),
        cmocka_unit_test(test_normals),
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_emission),
        cmocka_unit_test(test_lamps),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
