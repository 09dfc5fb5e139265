// render_hostile.c - path-traced pictures of hostile scenes: what is not finite or
// has no size is not seen and lights nothing, a heap of triangles in one place is one surface, and
// no picture has anything in it that is not a number. All of it in bounded time, on all backends.
//
// A grey floor below a sky, with a lamp above it; what is hostile comes on top.

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

#define VIEW_PX 48
#define SAMPLES 16
#define MOST_NS 120000000000u // of processor time, for one picture
// Triangles in one place: were they all tested against each ray, a picture would take longer than
// MOST_NS.
#define HEAP 250000u
#define PLANES                                                                                     \
    ((1u << HG_PLANE_ALBEDO) | (1u << HG_PLANE_NORMAL) | (1u << HG_PLANE_GEOMETRIC_NORMAL) |       \
        (1u << HG_PLANE_DEPTH) | (1u << HG_PLANE_POSITION) | (1u << HG_PLANE_EMISSION) |           \
        (1u << HG_PLANE_DIRECT_DIFFUSE) | (1u << HG_PLANE_INDIRECT_DIFFUSE))

static const enum hg_view_trace backends[] = {
    HG_VIEW_TRACE_EMBREE, HG_VIEW_TRACE_COMPUTE, HG_VIEW_TRACE_KHR};
static size_t backend_count; // that the device has
static struct hg_renderer *renderer; // of all pictures
static struct hg_refbuf *cleans[3];  // the scene as make_scene gives it, by backend; made once

// --- the scene -----------------------------------------------------------------------------------

static struct hg_material *add_material(
    struct hg_scene *scene, uint64_t id, float albedo, float emission)
{
    struct hg_material *m = rig_add(scene, HG_OBJECT_MATERIAL, id);
    hg_material_set_defaults(m);
    m->metallic = 0.0f;
    m->double_sided = true;
    for (int i = 0; i < 3; i++) {
        m->base_color[i] = albedo;
        m->emissive[i] = emission;
    }
    return m;
}

// A square of 2 * half metres that looks up (or down).
static struct hg_node *add_square(
    struct hg_scene *scene, uint64_t id, float half, float y, struct hg_material *material)
{
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    static const float normals[12] = {0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0};
    const float positions[12] = {-half, y, half, half, y, half, half, y, -half, -half, y, -half};
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, id);
    rig_part(mesh, 4, positions, normals, 6, indices)->material = material;
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
    node->mesh = mesh;
    return node;
}

static struct hg_scene *make_scene(void)
{
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    add_square(scene, 1, 2.0f, 0.0f, add_material(scene, 1, 0.5f, 0.0f));
    add_square(scene, 2, 0.25f, 1.5f, add_material(scene, 2, 0.0f, 8.0f));
    rig_environment(scene, 0.2f, 0.3f, 0.4f);
    return scene;
}

// Triangles of the corners given, all of one mesh in front of the floor.
static struct hg_node *add_triangles(
    struct hg_scene *scene, uint32_t count, const float (*corners)[3], struct hg_material *material)
{
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, 10);
    float *normals = hg_calloc(count * 9ull, sizeof *normals);
    uint32_t *indices = hg_calloc(count * 3ull, sizeof *indices);
    assert_non_null(normals);
    assert_non_null(indices);
    for (uint32_t i = 0; i < count * 3; i++) {
        normals[i * 3 + 1] = 1.0f;
        indices[i] = i;
    }
    rig_part(mesh, count * 3, &corners[0][0], normals, count * 3, indices)->material = material;
    hg_free(normals);
    hg_free(indices);
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, 10);
    node->mesh = mesh;
    return node;
}

// --- pictures ------------------------------------------------------------------------------------

static void assert_finite(struct rig *rig, enum hg_plane plane)
{
    struct hg_refbuf *data;
    test_ok(hg_view_read_plane(rig->view, plane, &data, &rig->err), &rig->err);
    const float *at = (const float *)(const void *)data->data;
    size_t bad = 0;
    for (size_t i = 0; i < data->size / 4; i++)
        bad += !isfinite(at[i]);
    if (bad > 0)
        fail_msg("%zu numbers of plane %s are none", bad, hg_plane_name(plane));
    hg_refbuf_unref(data);
}

static struct hg_refbuf *render(struct hg_scene *scene, enum hg_view_trace trace)
{
    const struct hg_view_params view = {.width = VIEW_PX,
        .height = VIEW_PX,
        .samples = SAMPLES,
        .seed = 5,
        .mode = HG_MODE_PATH,
        .trace = trace,
        .planes = PLANES};
    const struct hg_view_camera camera = {.eye = {0, 1, 3}, .target = {0, 0.5f, 0}};
    struct rig rig = {.renderer = renderer, .scene = scene};
    struct hg_frame_info info = {0};
    hg_scene_publish(scene);
    rig_view(&rig, &view);
    hg_view_set_final(rig.view, true);
    test_ok(hg_view_set_camera(rig.view, &camera, &rig.err), &rig.err);
    const uint64_t start = hg_clock_cpu_ns();
    while (!info.settled && hg_clock_cpu_ns() - start < MOST_NS)
        info = rig_step(&rig, SAMPLES);
    const uint64_t spent = hg_clock_cpu_ns() - start;
    print_message("backend %d: %.1f s of processor time\n", (int)trace, (double)spent * 1e-9);
    assert_true(info.settled);
    for (enum hg_plane plane = 0; plane < HG_PLANE_DRAWS; plane++)
        if (plane == HG_PLANE_COLOR || (PLANES >> plane & 1u) != 0)
            assert_finite(&rig, plane);
    struct hg_refbuf *out;
    test_ok(hg_view_read_plane(rig.view, HG_PLANE_COLOR, &out, &rig.err), &rig.err);
    rig_close_scene(&rig);
    return out;
}

static double mean_of(const struct hg_refbuf *picture)
{
    const float *p = (const float *)(const void *)picture->data;
    double sum = 0.0;
    for (size_t i = 0; i < picture->size / 16; i++)
        sum += (double)p[i * 4 + 1];
    return sum / ((double)picture->size / 16.0);
}

// The picture is that of the scene without what `spoil` adds to it.
static void assert_unseen(void (*spoil)(struct hg_scene *scene))
{
    for (size_t i = 0; i < backend_count; i++) {
        if (cleans[i] == NULL)
            cleans[i] = render(make_scene(), backends[i]);
        struct hg_scene *scene = make_scene();
        spoil(scene);
        struct hg_refbuf *spoilt = render(scene, backends[i]);
        assert_true(mean_of(cleans[i]) > 0.1);
        rig_assert_same(cleans[i], spoilt);
        hg_refbuf_unref(spoilt);
    }
}

// --- what is not finite --------------------------------------------------------------------------

// Every corner and coordinate in turn, of triangles that would hide the floor.
static void add_not_finite(struct hg_scene *scene)
{
    static const float values[] = {NAN, INFINITY, -INFINITY};
    static float corners[3 * 9 * 3][3];
    for (uint32_t i = 0; i < 27; i++) {
        const float triangle[3][3] = {{-2, 0.5f, 1}, {2, 0.5f, 1}, {0, 0.5f, -2}};
        memcpy(corners[i * 3], triangle, sizeof triangle);
        corners[i * 3 + i % 9 / 3][i % 3] = values[i / 9];
    }
    add_triangles(scene, 27, (const float(*)[3])corners, add_material(scene, 10, 0.9f, 0.0f));
}

static void test_not_finite(void **state)
{
    (void)state;
    assert_unseen(add_not_finite);
}

// The same as lamps: they have no area that light could come from.
static void add_lamps_not_finite(struct hg_scene *scene)
{
    add_not_finite(scene);
    struct hg_mesh *mesh = (struct hg_mesh *)hg_scene_find(scene, HG_OBJECT_MESH, 10);
    mesh->parts[0].material->emissive[0] = 5.0f;
}

static void test_lamps_not_finite(void **state)
{
    (void)state;
    assert_unseen(add_lamps_not_finite);
}

// Normals, tangents and uvs of a surface that is seen: it looks like anything, but like something.
static void test_attributes_not_finite(void **state)
{
    (void)state;
    for (size_t i = 0; i < backend_count; i++) {
        struct hg_scene *scene = make_scene();
        struct hg_mesh *mesh = (struct hg_mesh *)hg_scene_find(scene, HG_OBJECT_MESH, 1);
        struct hg_mesh_part *part = &mesh->parts[0];
        part->uv[0] = hg_calloc(8, sizeof(float));
        part->tangents = hg_calloc(16, sizeof(float));
        assert_non_null(part->uv[0]);
        assert_non_null(part->tangents);
        for (int k = 0; k < 3; k++)
            part->normals[k] = part->tangents[4 + k] = NAN;
        part->normals[7] = INFINITY;
        part->normals[10] = 0.0f; // of no length
        part->uv[0][3] = NAN;
        part->uv[0][4] = INFINITY;
        hg_refbuf_unref(render(scene, backends[i]));
    }
}

// --- what has no size ----------------------------------------------------------------------------

// Points, needles whose corners lie on a line, and triangles too small for their area to be a
// number.
static void add_degenerate(struct hg_scene *scene)
{
    static float corners[48 * 3][3];
    for (uint32_t i = 0; i < 48; i++) {
        const float x = -1.0f + (float)i / 24.0f;
        const float size = i % 3 == 0 ? 0.0f : i % 3 == 1 ? 1.0f : 1e-25f;
        for (uint32_t k = 0; k < 3; k++) {
            corners[i * 3 + k][0] = x + (i % 3 == 2 && k == 1 ? size : 0.0f);
            corners[i * 3 + k][1] = 0.5f + (i % 3 == 2 && k == 2 ? size : 0.0f);
            corners[i * 3 + k][2] = i % 3 == 1 ? -0.5f * (float)k : 0.0f;
        }
    }
    add_triangles(scene, 48, (const float(*)[3])corners, add_material(scene, 10, 0.9f, 0.0f));
}

static void test_degenerate(void **state)
{
    (void)state;
    assert_unseen(add_degenerate);
}

static void add_lamps_without_area(struct hg_scene *scene)
{
    add_degenerate(scene);
    struct hg_mesh *mesh = (struct hg_mesh *)hg_scene_find(scene, HG_OBJECT_MESH, 10);
    for (int k = 0; k < 3; k++)
        mesh->parts[0].material->emissive[k] = 1e6f;
}

static void test_lamps_without_area(void **state)
{
    (void)state;
    assert_unseen(add_lamps_without_area);
}

// --- matrices ------------------------------------------------------------------------------------

// Squares that the camera would see, under matrices without inverse that leave nothing of them:
// pressed to a point or a line, or with an entry that is not finite.
static void add_singular(struct hg_scene *scene)
{
    static const float diagonals[][3] = {
        {0, 0, 0}, {1, 0, 0}, {0, 0, 1}, {NAN, 1, 1}, {1, INFINITY, 1}, {1e-30f, 1e-30f, 1e-30f}};
    struct hg_material *material = add_material(scene, 10, 0.9f, 3.0f);
    for (uint64_t i = 0; i < 6; i++) {
        struct hg_node *node = add_square(scene, 10 + i, 0.5f, 0.7f, material);
        node->has_matrix = true;
        memset(node->matrix, 0, sizeof node->matrix);
        for (int k = 0; k < 3; k++)
            node->matrix[k * 5] = diagonals[i][k];
        node->matrix[15] = 1.0f;
        node->matrix[12] = 0.01f; // not in the plane of the axes
        node->matrix[13] = 0.3f;
    }
    struct hg_node *moved = add_square(scene, 20, 0.5f, 0.7f, material);
    moved->translation[1] = NAN;
    moved = add_square(scene, 21, 0.5f, 0.7f, material);
    memset(moved->rotation, 0, sizeof moved->rotation);
    memset(moved->scale, 0, sizeof moved->scale);
}

static void test_singular(void **state)
{
    (void)state;
    assert_unseen(add_singular);
}

// --- many triangles in one place
// --------------------------------------------------------------------

static float heap_corners[HEAP * 3][3];

static void add_heap(struct hg_scene *scene, uint32_t count, enum hg_alpha_mode mode, float alpha)
{
    static const float triangle[3][3] = {{-1, 0.4f, 1}, {1, 0.4f, 1}, {0, 0.6f, -1}};
    for (uint32_t i = 0; i < count; i++)
        memcpy(heap_corners[i * 3], triangle, sizeof triangle);
    struct hg_material *material = add_material(scene, 10, 0.9f, 0.0f);
    material->alpha_mode = mode;
    material->base_color[3] = alpha;
    add_triangles(scene, count, (const float(*)[3])heap_corners, material);
}

// They hide as one does.
static void test_heap(void **state)
{
    (void)state;
    for (size_t i = 0; i < backend_count; i++) {
        struct hg_scene *scenes[2] = {make_scene(), make_scene()};
        add_heap(scenes[0], 1, HG_ALPHA_OPAQUE, 1.0f);
        add_heap(scenes[1], HEAP, HG_ALPHA_OPAQUE, 1.0f);
        struct hg_refbuf *one = render(scenes[0], backends[i]);
        struct hg_refbuf *heap = render(scenes[1], backends[i]);
        const double apart =
            rig_difference(one, heap); // corners and normals are rounded when baked
        print_message("a heap of triangles differs from one by %.6f\n", apart);
        assert_true(apart < 0.005);
        hg_refbuf_unref(one);
        hg_refbuf_unref(heap);
    }
}

// Surfaces that let a little through each, and surfaces whose holes all rays go through.
static void test_heap_with_holes(void **state)
{
    (void)state;
    for (size_t i = 0; i < backend_count; i++) {
        struct hg_scene *scene = make_scene();
        add_heap(scene, HEAP, HG_ALPHA_BLEND, 1e-4f);
        hg_refbuf_unref(render(scene, backends[i]));
        scene = make_scene();
        add_heap(scene, HEAP, HG_ALPHA_MASK, 0.25f);
        hg_refbuf_unref(render(scene, backends[i]));
    }
}

// Lamps in one place.
static void test_heap_of_lamps(void **state)
{
    (void)state;
    for (size_t i = 0; i < backend_count; i++) {
        struct hg_scene *scene = make_scene();
        add_heap(scene, HEAP, HG_ALPHA_OPAQUE, 1.0f);
        struct hg_mesh *mesh = (struct hg_mesh *)hg_scene_find(scene, HG_OBJECT_MESH, 10);
        mesh->parts[0].material->emissive[1] = 2.0f;
        struct hg_refbuf *picture = render(scene, backends[i]);
        print_message("mean %.3f\n", mean_of(picture));
        hg_refbuf_unref(picture);
    }
}

// --- lights --------------------------------------------------------------------------------------

// Lights whose numbers leave them nothing to give.
static void add_dark_lights(struct hg_scene *scene)
{
    static const struct {
        int kind;
        float color, intensity, range, inner_rad, outer_rad;
    } lights[] = {{HG_LIGHT_POINT, 1, 0, 0, 0, 0}, {HG_LIGHT_POINT, 0, 5, 0, 0, 0},
        {HG_LIGHT_SPOT, 1, 5, 1e-30f, 0, 0.5f}, {HG_LIGHT_DIRECTIONAL, 1, 0, 0, 0, 0}};
    for (uint64_t i = 0; i < sizeof lights / sizeof lights[0]; i++) {
        struct hg_light *light = rig_add(scene, HG_OBJECT_LIGHT, 30 + i);
        light->kind = lights[i].kind;
        light->intensity = lights[i].intensity;
        light->range = lights[i].range;
        light->inner_cone_rad = lights[i].inner_rad;
        light->outer_cone_rad = lights[i].outer_rad;
        light->color[0] = light->color[1] = light->color[2] = lights[i].color;
        struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, 30 + i);
        node->light = light;
        node->translation[1] = 1.0f;
    }
}

static void test_dark_lights(void **state)
{
    (void)state;
    assert_unseen(add_dark_lights);
}

// A light on a surface, one of enormous strength, cones of no width, a place that is no number.
static void add_wild_lights(struct hg_scene *scene)
{
    for (uint64_t i = 0; i < 5; i++) {
        struct hg_light *light = rig_add(scene, HG_OBJECT_LIGHT, 30 + i);
        light->kind = i < 2 ? HG_LIGHT_POINT : HG_LIGHT_SPOT;
        light->intensity = i == 1 ? 1e30f : 1.0f;
        light->color[0] = light->color[1] = light->color[2] = 1.0f;
        struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, 30 + i);
        node->light = light;
        node->translation[1] = i == 0 ? 0.0f : 1.0f;
        node->scale[1] = i == 3 ? 0.0f : 1.0f;
        node->translation[0] = i == 4 ? NAN : 0.0f;
    }
}

static void test_wild_lights(void **state)
{
    (void)state;
    for (size_t i = 0; i < backend_count; i++) {
        struct hg_scene *scene = make_scene();
        add_wild_lights(scene);
        hg_refbuf_unref(render(scene, backends[i]));
    }
}

static int set_up(void **state)
{
    (void)state;
    struct rig rig;
    rig_open(&rig, false);
    renderer = rig.renderer;
    backend_count = hg_gpu_get_caps(renderer->context.gpu)->ray_query ? 3 : 2;
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    for (size_t i = 0; i < backend_count; i++)
        hg_refbuf_unref(cleans[i]);
    rig_close(&(struct rig){.renderer = renderer});
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_not_finite),
        cmocka_unit_test(test_lamps_not_finite), cmocka_unit_test(test_attributes_not_finite),
        cmocka_unit_test(test_degenerate), cmocka_unit_test(test_lamps_without_area),
        cmocka_unit_test(test_singular), cmocka_unit_test(test_heap),
        cmocka_unit_test(test_heap_with_holes), cmocka_unit_test(test_heap_of_lamps),
        cmocka_unit_test(test_dark_lights), cmocka_unit_test(test_wild_lights)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
