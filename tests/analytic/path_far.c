// path_far.c - path-traced pictures of what lies far from the origin of the world, or of its own
// mesh: they are those of the same thing near by. Corners are rounded there by more than a ray is
// lifted off a surface near by, so rays, surfaces and lights have to round them alike.
#include <math.h>
#include <string.h>

#include "renderer/internal.h"
#include "shaders/shared/path.h"
#include "tests/analytic/path_rig.h"

enum { SIDE = 32 };

static const struct hg_view_params defaults = {.width = SIDE,
    .height = SIDE,
    .tonemap = HG_TONEMAP_LINEAR,
    .mode = HG_MODE_PATH,
    .filter = HG_FILTER_BOX,
    .samples = 32,
    .seed = 7};

static double mean_of(struct rig *rig, const struct hg_view_params *params, const float eye[3],
    const float target[3], float vfov_rad)
{
    struct hg_view *view = path_rig_view(rig, params);
    path_rig_look(view, eye, target, vfov_rad);
    path_rig_settle(view);
    struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR);
    const float *at = (const float *)(const void *)color->data;
    double sum = 0;
    for (int i = 0; i < SIDE * SIDE; i++)
        sum += (double)at[i * 4] / (SIDE * SIDE);
    hg_refbuf_unref(color);
    hg_view_destroy(view);
    return sum;
}

// --- places --------------------------------------------------------------------------------------

static const float turn[4] = {0.3f, 0.2f, 0.1f, 0.9273618f};

static void turned(const double v[3], double out[3])
{
    double t[3];
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        t[i] = 2 * ((double)turn[j] * v[k] - (double)turn[k] * v[j]);
    }
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i] = v[i] + (double)turn[3] * t[i] + (double)turn[j] * t[k] - (double)turn[k] * t[j];
    }
}

// Who brings things to where they are.
enum way {
    BY_CORNERS,
    BY_NODE,
    TURNED,       // corners are far, and the node turns them about the origin
    SCALED,       // millimetres
    BROUGHT_BACK, // corners are far, the node brings them to the origin
    TURNED_BACK,
    WAYS,
};

// Moves a node whose corners lie about `corners`, which is filled in, as the things' middle then.
static void place(struct hg_node *node, enum way way, const double corners[3], double middle[3])
{
    memcpy(middle, corners, 3 * sizeof *middle);
    if (way == TURNED || way == TURNED_BACK) {
        memcpy(node->rotation, turn, sizeof turn);
        turned(corners, middle);
    }
    for (int i = 0; i < 3 && way == SCALED; i++) {
        node->scale[i] = 1e-3f;
        middle[i] *= 1e-3;
    }
    for (int i = 0; i < 3 && (way == BROUGHT_BACK || way == TURNED_BACK); i++) {
        node->translation[i] = -(float)middle[i];
        middle[i] += (double)node->translation[i];
    }
}

// A sphere of radius 1, grey, in a white furnace: rays that leave it meet nothing, it looks 0.5.
// copies: of the node, in the same place; of several rays are brought to the mesh.
static double furnace(struct rig *rig, enum way way, double far, int copies)
{
    static const double direction[3] = {0.9, 0.35, -0.7};
    const double size = way == SCALED ? 1000 : 1;
    double corners[3], middle[3];
    float center[3], eye[3], target[3];
    rig_scene(rig);
    path_rig_environment(rig, 1.0f);
    for (int i = 0; i < 3; i++) {
        corners[i] = round(far * direction[i]) * size;
        center[i] = way == BY_NODE ? 0.0f : (float)corners[i];
    }
    struct hg_node *node =
        rig_sphere(rig, path_rig_lambert(rig, 0.5f), center, (float)size, copies > 1 ? 64 : 16);
    place(node, way, corners, middle);
    for (int k = 1; k < copies; k++) {
        struct hg_object *copy;
        assert_int_equal(hg_scene_add(rig->scene, HG_OBJECT_NODE, rig->next_id++, &copy), HG_OK);
        ((struct hg_node *)copy)->mesh = node->mesh;
        place((struct hg_node *)copy, way, corners, middle);
    }
    for (int i = 0; i < 3; i++) {
        if (way == BY_NODE)
            node->translation[i] = (float)corners[i];
        target[i] = (float)middle[i];
        eye[i] = target[i] + (i == 2 ? 4.0f : 0.0f);
    }
    return mean_of(rig, &defaults, eye, target, 0.2f);
}

static void check_ways(struct rig *rig, int copies, double farthest, double most)
{
    for (enum way way = 0; way < WAYS; way++) {
        if (way == BY_NODE && copies > 1) // nothing else than near by
            continue;
        const double near = furnace(rig, way, 0, copies);
        const double farther[2] = {
            furnace(rig, way, 1e3, copies), furnace(rig, way, farthest, copies)};
        print_message("%d copies, way %d: %.5f near by, %.5f 1 km and %.5f %g km away\n", copies,
            (int)way, near, farther[0], farther[1], farthest / 1e3);
        assert_true(fabs(near - 0.5) < 0.002);
        assert_true(fabs(farther[0] - near) < most && fabs(farther[1] - near) < most);
    }
}

static void test_far(void **state)
{
    check_ways(*state, 1, 1e5, 1e-3);
}

// 16,384 triangles each, so that they are not made flat.
static void test_far_instances(void **state)
{
    check_ways(*state, 5, 1e4, 1e-3);
}

// --- lamps ---------------------------------------------------------------------------------------

// A floor below a square lamp whose corners are far away.
static double lamp(struct rig *rig, double far, uint32_t estimators)
{
    static const double sides[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    static const float eye[3] = {0, 0.5f, 2.5f}, target[3] = {0, 0, 0};
    const double corners[3] = {far, 0, far};
    double middle[3];
    float square[4][3];
    rig_scene(rig);
    path_rig_floor(rig, path_rig_lambert(rig, 1.0f), 3);
    struct hg_material *m = path_rig_lambert(rig, 0.0f);
    m->emissive[0] = m->emissive[1] = m->emissive[2] = 1.0f;
    m->double_sided = true;
    for (int i = 0; i < 4; i++) {
        square[i][0] = (float)(far + sides[i][0]);
        square[i][1] = 1.5f;
        square[i][2] = (float)(far + sides[i][1]);
    }
    place(rig_quad(rig, m, square), TURNED_BACK, corners, middle);
    struct hg_view_params params = defaults;
    params.max_bounces = 1;
    params.samples = estimators == HG_PATH_USE_SURFACES ? 512 : 128;
    rig->renderer->context.overrides.path_estimators = estimators;
    const double mean = mean_of(rig, &params, eye, target, 0.3f);
    rig->renderer->context.overrides.path_estimators = 0;
    return mean;
}

static void test_far_lamp(void **state)
{
    struct rig *rig = *state;
    for (uint32_t use = 1; use <= 3; use++) {
        const double near = lamp(rig, 0, use);
        const double farther = lamp(rig, 1e4, use);
        print_message("estimators %u: %.5f, %.5f when corners are far\n", use, near, farther);
        assert_true(fabs(farther / near - 1) < 0.003);
    }
}

// Five spheres in a row, of one mesh whose corners are far away, that shine on a floor: rays to
// lights alone.
static double lamps(struct rig *rig, double far)
{
    static const float eye[3] = {0, 0.5f, 2.5f}, target[3] = {0, 0, 0};
    const double corners[3] = {far, 0, -far};
    const float center[3] = {(float)far, 0, -(float)far};
    double middle[3];
    struct hg_node *node = NULL;
    rig_scene(rig);
    path_rig_floor(rig, path_rig_lambert(rig, 1.0f), 3);
    struct hg_material *m = path_rig_lambert(rig, 0.0f);
    m->emissive[0] = m->emissive[1] = m->emissive[2] = 1.0f;
    for (int k = 0; k < 5; k++) {
        struct hg_object *copy = NULL;
        if (k > 0)
            assert_int_equal(
                hg_scene_add(rig->scene, HG_OBJECT_NODE, rig->next_id++, &copy), HG_OK);
        struct hg_node *next =
            k == 0 ? rig_sphere(rig, m, center, 0.5f, 64) : (struct hg_node *)copy;
        next->mesh = k == 0 ? next->mesh : node->mesh;
        node = next;
        place(node, TURNED_BACK, corners, middle);
        node->translation[0] += (float)(k - 2) * 1.25f;
        node->translation[1] += 2.0f;
    }
    struct hg_view_params params = defaults;
    params.max_bounces = 1;
    params.samples = 64;
    rig->renderer->context.overrides.path_estimators = HG_PATH_USE_EMITTERS;
    const double mean = mean_of(rig, &params, eye, target, 0.3f);
    rig->renderer->context.overrides.path_estimators = 0;
    return mean;
}

static void test_far_lamps(void **state)
{
    const double near = lamps(*state, 0), farther = lamps(*state, 3e3);
    print_message("five lamps: %.5f, %.5f when corners are far\n", near, farther);
    assert_true(fabs(farther / near - 1) < 0.005);
}

// --- strays --------------------------------------------------------------------------------------

// A floor below a light, and something so far away that it is not seen: a light, or a square that
// emits.
static double strayed(struct rig *rig, float far, bool emits)
{
    static const float eye[3] = {0, 0.5f, 2.5f}, target[3] = {0, 0, 0};
    static const float square[4][3] = {{-1, 0, -1}, {1, 0, -1}, {1, 0, 1}, {-1, 0, 1}};
    static const double down[3] = {0, -1, 0}, near[3] = {0.3, 1, 0.2};
    const double away[3] = {(double)far, (double)far, 0};
    rig_scene(rig);
    path_rig_floor(rig, path_rig_lambert(rig, 1.0f), 3);
    (void)rig_light(rig, HG_LIGHT_POINT, near, down);
    if (far > 0.0f && !emits)
        (void)rig_light(rig, HG_LIGHT_POINT, away, down);
    if (far > 0.0f && emits) {
        struct hg_material *m = path_rig_lambert(rig, 0.0f);
        m->emissive[0] = m->emissive[1] = m->emissive[2] = 1.0f;
        rig_quad(rig, m, square)->translation[1] = far;
    }
    return mean_of(rig, &defaults, eye, target, 0.3f);
}

static void test_strays(void **state)
{
    struct rig *rig = *state;
    const double alone = strayed(rig, 0, false);
    for (int i = 0; i < 2; i++)
        for (float far = 1e3f; far < 1e32f; far *= 1e4f) {
            const double mean = strayed(rig, far, i == 1);
            print_message("a stray %g m away: %.5f, %.5f alone\n", (double)far, mean, alone);
            assert_true(fabs(mean / alone - 1) < 1e-3);
        }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_far),
        cmocka_unit_test(test_far_instances),
        cmocka_unit_test(test_far_lamp),
        cmocka_unit_test(test_far_lamps),
        cmocka_unit_test(test_strays),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
