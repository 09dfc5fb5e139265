// shadow.c - whole frames: shadows of a thin wall on a floor against ray casting, for every kind of
// light, several angles, and scenes from a centimetre to a kilometre. A lit pixel that is darkened
// is acne, a pixel at the wall's foot that is lit is detachment.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/renderer.h"
#include "tests/support/check.h"

#define SIDE 192

struct setting {
    int kind;               // of struct hg_light
    double scale, light[3]; // of the light: where it stands, towards the sun; times scale
};

// --- the scene: a floor and a box, by corner tables ----------------------------------------------

static const double box_half[3] = {0.01, 0.6, 0.5}; // the box stands on y = 0

static void put_quad(struct hg_mesh_part *part, uint32_t quad, const double corner[4][3],
    const double normal[3], double scale)
{
    static const uint32_t order[6] = {0, 1, 2, 0, 2, 3};
    for (uint32_t i = 0; i < 4; i++)
        for (int a = 0; a < 3; a++) {
            part->positions[(quad * 4 + i) * 3 + a] = (float)(corner[i][a] * scale);
            part->normals[(quad * 4 + i) * 3 + a] = (float)normal[a];
        }
    for (uint32_t i = 0; i < 6; i++)
        part->indices[quad * 6 + i] = quad * 4 + order[i];
}

static void fill_part(struct hg_mesh_part *part, double s)
{
    const double floor[4][3] = {{-2, 0, 2}, {2, 0, 2}, {2, 0, -2}, {-2, 0, -2}};
    put_quad(part, 0, floor, (double[3]){0, 1, 0}, s);
    for (uint32_t f = 0; f < 6; f++) { // faces of the box, counter-clockwise from outside
        int axis = (int)f / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
        double sign = f % 2 ? -1 : 1, normal[3] = {0, 0, 0}, corner[4][3];
        const double turn[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
        normal[axis] = sign;
        for (int i = 0; i < 4; i++) {
            corner[i][axis] = sign * box_half[axis];
            corner[i][u] = turn[i][0] * sign * box_half[u];
            corner[i][v] = turn[i][1] * box_half[v];
            corner[i][1] = corner[i][1] > 0 ? box_half[1] : 0;
        }
        put_quad(part, f + 1, corner, normal, s);
    }
}

static void add_geometry(struct hg_scene *scene, double s)
{
    struct hg_object *mesh, *node, *material;
    test_ok(hg_scene_add(scene, HG_OBJECT_MATERIAL, 1, &material), NULL);
    test_ok(hg_scene_add(scene, HG_OBJECT_MESH, 1, &mesh), NULL);
    test_ok(hg_scene_add(scene, HG_OBJECT_NODE, 1, &node), NULL);
    struct hg_material *white = (struct hg_material *)material;
    white->metallic = 0;
    white->roughness = 1;
    struct hg_mesh_part *part = hg_calloc(1, sizeof *part);
    ((struct hg_mesh *)mesh)->parts = part;
    ((struct hg_mesh *)mesh)->part_count = 1;
    part->topology = HG_TOPOLOGY_TRIANGLES;
    part->vertex_count = 28;
    part->index_count = 42;
    part->material = white;
    part->indices = hg_calloc(42, sizeof *part->indices);
    part->positions = hg_calloc(28 * 3, sizeof *part->positions);
    part->normals = hg_calloc(28 * 3, sizeof *part->normals);
    fill_part(part, s);
    for (int a = 0; a < 3; a++) {
        part->bounds_min[a] = (float)(a == 1 ? 0 : -2 * s);
        part->bounds_max[a] = (float)(a == 1 ? box_half[1] * s : 2 * s);
    }
    ((struct hg_node *)node)->mesh = (struct hg_mesh *)mesh;
}

// Turns -z towards the origin, as seen from `from`.
static void aim(struct hg_node *node, const double from[3])
{
    double l = sqrt(from[0] * from[0] + from[1] * from[1] + from[2] * from[2]);
    double d[3] = {-from[0] / l, -from[1] / l, -from[2] / l};
    double q[4] = {d[1], -d[0], 0, 1 - d[2]}; // half way: cross((0, 0, -1), d), 1 + dot
    double n = sqrt(q[0] * q[0] + q[1] * q[1] + q[3] * q[3]);
    for (int i = 0; i < 4; i++)
        node->rotation[i] = (float)(q[i] / n);
}

static struct hg_light *add_light(struct hg_scene *scene, const struct setting *s)
{
    struct hg_object *object, *node;
    test_ok(hg_scene_add(scene, HG_OBJECT_LIGHT, 2, &object), NULL);
    test_ok(hg_scene_add(scene, HG_OBJECT_NODE, 2, &node), NULL);
    struct hg_light *light = (struct hg_light *)object;
    struct hg_node *n = (struct hg_node *)node;
    n->light = light;
    for (int a = 0; a < 3; a++) {
        n->translation[a] = (float)(s->light[a] * s->scale);
        light->color[a] = 1;
    }
    aim(n, s->light);
    light->kind = (unsigned)s->kind;
    light->intensity = (float)(s->kind == HG_LIGHT_DIRECTIONAL ? 3 : 10 * s->scale * s->scale);
    light->outer_cone_rad = 0.9f;
    light->inner_cone_rad = 0.8f;
    return light;
}

// --- the expectation: rays in double precision, in units of the scale ----------------------------

static bool hit_box(const double o[3], const double d[3], double far, double *at, int *axis)
{
    double t0 = -1e30, t1 = 1e30;
    for (int a = 0; a < 3; a++) {
        double low = a == 1 ? 0 : -box_half[a], high = box_half[a];
        double p = (low - o[a]) / d[a], q = (high - o[a]) / d[a];
        if (fmin(p, q) > t0) {
            t0 = fmin(p, q);
            *axis = a;
        }
        t1 = fmin(t1, fmax(p, q));
    }
    *at = t0;
    return t0 < t1 && t1 > 1e-6 && t0 < far;
}

enum seen { NOTHING, FLOOR_LIT, FLOOR_DARK, WALL_LIT, WALL_OTHER };

// Class of what a pixel centre shows. Camera: from (0.9, 2.6, 1.9) to the origin, 45 degrees.
static enum seen classify(const struct setting *s, double px, double py)
{
    const double eye[3] = {0.9, 2.6, 1.9};
    double f[3], r[3], u[3], d[3], l, t = 1e30;
    l = sqrt(eye[0] * eye[0] + eye[1] * eye[1] + eye[2] * eye[2]);
    for (int a = 0; a < 3; a++)
        f[a] = -eye[a] / l;
    l = sqrt(f[0] * f[0] + f[2] * f[2]); // right = f x up
    r[0] = -f[2] / l;
    r[1] = 0;
    r[2] = f[0] / l;
    u[0] = r[1] * f[2] - r[2] * f[1];
    u[1] = r[2] * f[0] - r[0] * f[2];
    u[2] = r[0] * f[1] - r[1] * f[0];
    double k = tan(3.14159265358979 / 8), x = (2 * px / SIDE - 1) * k, y = (1 - 2 * py / SIDE) * k;
    for (int a = 0; a < 3; a++)
        d[a] = f[a] + r[a] * x + u[a] * y;
    int axis = 0, unused;
    double floor = d[1] < 0 ? -eye[1] / d[1] : 1e30, p[3], to[3];
    bool box = hit_box(eye, d, 1e30, &t, &axis) && t < floor;
    double at = box ? t : floor;
    for (int a = 0; a < 3; a++) {
        p[a] = eye[a] + d[a] * at;
        to[a] = s->light[a] - (s->kind == HG_LIGHT_DIRECTIONAL ? 0 : p[a]);
    }
    double n_dot = (box ? (d[axis] < 0 ? to[axis] : -to[axis]) : to[1]) /
                   sqrt(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]);
    if (box)
        return n_dot > 0.1 ? WALL_LIT : WALL_OTHER;
    if (at > 1e29 || fabs(p[0]) > 2 || fabs(p[2]) > 2)
        return NOTHING;
    return hit_box(p, to, s->kind == HG_LIGHT_DIRECTIONAL ? 1e30 : 1, &t, &unused) && t > 1e-9
               ? FLOOR_DARK
               : FLOOR_LIT;
}

// The class of all pixels within `margin`, or NOTHING; walls beside the floor do not count. The
// margin is the reach of the filter: 3 texels, seen askew.
static enum seen settled_class(const enum seen *map, int x, int y, int margin)
{
    enum seen c = map[y * SIDE + x];
    for (int j = y - margin; j <= y + margin; j++)
        for (int i = x - margin; i <= x + margin; i++) {
            if (i < 0 || j < 0 || i >= SIDE || j >= SIDE)
                return NOTHING;
            enum seen o = map[j * SIDE + i];
            bool near = abs(i - x) <= 1 && abs(j - y) <= 1;
            bool wall = o == WALL_LIT || o == WALL_OTHER;
            if (o != c && (near || c == WALL_LIT || !wall))
                return NOTHING;
        }
    return c;
}

// --- frames --------------------------------------------------------------------------------------

static struct hg_refbuf *render(
    struct hg_renderer *renderer, struct hg_scene *scene, const struct setting *s)
{
    struct hg_error err = {0};
    struct hg_view *view;
    struct hg_frame_info info = {0};
    struct hg_refbuf *pixels;
    struct hg_view_params params = {.width = SIDE,
        .height = SIDE,
        .tonemap = HG_TONEMAP_LINEAR,
        .background = HG_BACKGROUND_NONE,
        .samples = 8};
    struct hg_view_camera camera = {
        .eye = {(float)(0.9 * s->scale), (float)(2.6 * s->scale), (float)(1.9 * s->scale)}};
    hg_scene_publish(scene);
    test_ok(hg_view_create(renderer, scene, &view, &err), &err);
    test_ok(hg_view_set_params(view, &params, &err), &err);
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
    for (int i = 0; i < 64 && !info.settled; i++)
        test_ok(hg_view_step(view, 8, &info, &err), &err);
    assert_true(info.settled);
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &pixels, &err), &err);
    hg_view_destroy(view);
    return pixels;
}

static void check(struct hg_renderer *renderer, const struct setting *s)
{
    static enum seen map[SIDE * SIDE];
    struct hg_scene *scene;
    test_ok(hg_scene_create(&scene), NULL);
    add_geometry(scene, s->scale);
    struct hg_light *light = add_light(scene, s);
    light->casts_shadow = true;
    struct hg_refbuf *with = render(renderer, scene, s);
    light->casts_shadow = false;
    hg_scene_touch(scene, &light->head);
    struct hg_refbuf *without = render(renderer, scene, s);
    const float *a = (const float *)with->data, *b = (const float *)without->data;
    int acne = 0, detached = 0, lit = 0, dark = 0;
    for (int i = 0; i < SIDE * SIDE; i++)
        map[i] = classify(s, i % SIDE + 0.5, i / SIDE + 0.5);
    for (int i = 0; i < SIDE * SIDE; i++) {
        enum seen c = settled_class(map, i % SIDE, i / SIDE, s->kind == HG_LIGHT_POINT ? 4 : 2);
        double share = b[i * 4 + 1] > 0 ? (double)(a[i * 4 + 1] / b[i * 4 + 1]) : 1;
        if (!(b[i * 4 + 1] > 1e-3f))
            continue; // outside the cone
        if (c == FLOOR_DARK) {
            dark++;
            detached += share > 0.05;
        } else if (c == FLOOR_LIT || c == WALL_LIT) {
            lit++;
            acne += share < 0.95;
        }
    }
    print_message("kind %d scale %g from (%g %g %g): %d lit, %d acne; %d dark, %d detached\n",
        s->kind, s->scale, s->light[0], s->light[1], s->light[2], lit, acne, dark, detached);
    assert_true(lit > 1000 && dark > 100);
    assert_int_equal(acne, 0);
    assert_int_equal(detached, 0);
    hg_refbuf_unref(with);
    hg_refbuf_unref(without);
    hg_scene_destroy(scene);
}

static void test_shadows(void **state)
{
    (void)state;
    struct hg_renderer *renderer;
    struct hg_error err = {0};
    struct hg_renderer_params params = {0};
    const struct setting settings[] = {
        {HG_LIGHT_DIRECTIONAL, 1, {1, 1, 0.3}},
        {HG_LIGHT_DIRECTIONAL, 0.01, {1, 1, 0.3}},
        {HG_LIGHT_DIRECTIONAL, 500, {1, 1, 0.3}},
        {HG_LIGHT_DIRECTIONAL, 1, {-1, 0.5, 0.2}},
        {HG_LIGHT_DIRECTIONAL, 1, {0.4, 1, -0.7}},
        {HG_LIGHT_SPOT, 1, {1.5, 1.8, 0.4}},
        {HG_LIGHT_SPOT, 0.01, {-1.2, 1.5, 0.2}},
        {HG_LIGHT_POINT, 1, {1.0, 1.2, 0.3}},
        {HG_LIGHT_POINT, 500, {-1.1, 1.3, -0.2}},
    };
    test_ok(hg_renderer_create(&params, &renderer, &err), &err);
    for (size_t i = 0; i < sizeof settings / sizeof settings[0]; i++)
        check(renderer, &settings[i]);
    hg_renderer_destroy(renderer);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_shadows)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
