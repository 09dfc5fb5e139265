// render_surfaces.c - picks and surface queries against rays of Embree through the same pixels:
// every pixel away from silhouettes has the ray's node, and its place. Also what a look takes in
// memory, and that a view without one shows the same bytes after another has had its own.
#include "render_rig.h"

#include "renderer/internal.h"
#include "renderer/trace/rays.h"
#include "renderer/view_look.h"

enum { SIDE = 160, BLOCKS = 48, PIXELS = SIDE * SIDE };

static const uint32_t faces[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3,
    6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};

static float random_float(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (float)(*seed >> 8) / 16777216.0f;
}

// Blocks with both sides, here and there, some inside of others.
static struct hg_scene *make_scene(void)
{
    struct hg_scene *scene = rig_new_scene();
    uint32_t seed = 7;
    struct hg_material *material = rig_add(scene, HG_OBJECT_MATERIAL, 1);
    material->double_sided = true;
    for (uint64_t id = 1; id <= BLOCKS; id++) {
        float corners[24], normals[24];
        float at[3], half[3];
        for (int c = 0; c < 3; c++) {
            at[c] = 2.0f * random_float(&seed) - 1.0f;
            half[c] = 0.05f + 0.3f * random_float(&seed);
        }
        for (int i = 0; i < 8; i++)
            for (int c = 0; c < 3; c++) {
                corners[i * 3 + c] = at[c] + (i >> c & 1 ? half[c] : -half[c]);
                normals[i * 3 + c] = i >> c & 1 ? 0.57735f : -0.57735f;
            }
        struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, id);
        rig_part(mesh, 8, corners, normals, 36, faces)->material = material;
        struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
        node->mesh = mesh;
    }
    rig_environment(scene, 0.5f, 0.5f, 0.5f);
    hg_scene_publish(scene);
    return scene;
}

static const struct hg_view_params params = {
    .width = SIDE, .height = SIDE, .samples = 1, .gi = HG_GI_NONE};

static const struct hg_view_camera camera = {
    .eye = {1.5f, 1.2f, 3.5f}, .target = {0, 0, 0}, .vfov_rad = 0.8f};

static void open_scene(struct rig *rig)
{
    rig_open(rig, false);
    rig_use_scene(rig, make_scene(), &params);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
    rig_settle(rig, 1);
}

// --- rays ----------------------------------------------------------------------------------------

static void normalise(float v[3])
{
    const float length = sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int c = 0; c < 3; c++)
        v[c] /= length;
}

static void cross(const float a[3], const float b[3], float out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = a[(c + 1) % 3] * b[(c + 2) % 3] - a[(c + 2) % 3] * b[(c + 1) % 3];
}

static void fill_rays(struct hg_gpu_ray *rays, const struct hg_clip *clip)
{
    const float up[3] = {0, 1, 0};
    float forward[3], right[3], above[3];
    for (int c = 0; c < 3; c++)
        forward[c] = camera.target[c] - camera.eye[c];
    normalise(forward);
    cross(forward, up, right);
    normalise(right);
    cross(right, forward, above);
    const float reach = tanf(0.5f * camera.vfov_rad);
    for (int i = 0; i < PIXELS; i++) {
        const float x = (2.0f * ((float)(i % SIDE) + 0.5f) / SIDE - 1.0f) * reach;
        const float y = (1.0f - 2.0f * ((float)(i / SIDE) + 0.5f) / SIDE) * reach;
        float d[3], first = 0.0f, last = 1e30f;
        for (int c = 0; c < 3; c++)
            d[c] = forward[c] + x * right[c] + y * above[c];
        for (uint32_t p = 0; p < clip->count; p++) {
            const float *n = clip->planes[p];
            const float along = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
            const float at =
                n[0] * camera.eye[0] + n[1] * camera.eye[1] + n[2] * camera.eye[2] - n[3];
            if (along > 0.0f)
                first = fmaxf(first, -at / along);
            else
                last = fminf(last, -at / along);
        }
        rays[i] = (struct hg_gpu_ray){.origin_ws = {camera.eye[0], camera.eye[1], camera.eye[2]},
            .direction_ws = {d[0], d[1], d[2]},
            .t_min = first,
            .t_max = last,
            .mask = HG_RAY_ALL};
    }
}

// Nodes, 0 = none, and depths along the rays, which are a metre deep.
static void trace(struct rig *rig, const struct hg_clip *clip, uint64_t *nodes, float *depths)
{
    struct hg_gpu *gpu = rig->renderer->gpu;
    struct hg_gpu_buffer rays = {0}, hits = {0};
    struct hg_rays_scene *scene = NULL;
    const struct hg_rays_key key =
        hg_rays_default_key(hg_view_rays(rig->view), HG_TRACE_EMBREE, true);
    test_ok(hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK, PIXELS * sizeof(struct hg_gpu_ray),
                "rays", &rays, &rig->err),
        &rig->err);
    test_ok(hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK, PIXELS * sizeof(struct hg_gpu_hit),
                "hits", &hits, &rig->err),
        &rig->err);
    fill_rays(rays.mapped, clip);
    test_ok(hg_rays_ref(hg_view_rays(rig->view), &key, &scene, &rig->err), &rig->err);
    test_ok(hg_rays_sync(scene, &rig->err), &rig->err);
    const struct hg_trace_wave wave = {.rays = &rays, .hits = &hits, .count = PIXELS};
    test_ok(hg_trace_closest(hg_rays_trace(scene), &wave, &rig->err), &rig->err);
    const struct hg_gpu_hit *found = hits.mapped;
    for (int i = 0; i < PIXELS; i++) {
        struct hg_draw_info draw;
        nodes[i] = 0;
        depths[i] = found[i].t;
        if (found[i].draw != HG_HIT_NONE) {
            assert_true(
                hg_geometry_draw_info(rig->view->state.scene_gpu->geometry, found[i].draw, &draw));
            nodes[i] = draw.node->head.id;
        }
    }
    hg_rays_unref(scene);
    hg_gpu_buffer_destroy(gpu, &rays);
    hg_gpu_buffer_destroy(gpu, &hits);
}

static bool is_inner(const uint64_t *nodes, int i)
{
    const int x = i % SIDE, y = i / SIDE;
    if (x == 0 || y == 0 || x + 1 == SIDE || y + 1 == SIDE)
        return false;
    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++)
            if (nodes[i + dy * SIDE + dx] != nodes[i])
                return false;
    return true;
}

// --- comparison ----------------------------------------------------------------------------------

struct seen {
    struct hg_surface_point points[PIXELS];
};

static void keep_row(void *user, uint32_t y, const struct hg_surface_point *points)
{
    struct seen *seen = user;
    memcpy(seen->points + (size_t)y * SIDE, points, SIDE * sizeof *points);
}

static void compare(struct rig *rig, const struct hg_clip *clip)
{
    static struct seen seen;
    static uint64_t nodes[PIXELS];
    static float depths[PIXELS];
    const struct hg_surface_rect all = {
        .width = SIDE, .height = SIDE, .row = keep_row, .user = &seen};
    uint32_t compared = 0, hit = 0, seed = 3;
    test_ok(hg_view_surfaces(rig->view, &all, &rig->err), &rig->err);
    trace(rig, clip, nodes, depths);
    for (int i = 0; i < PIXELS; i++) {
        if (!is_inner(nodes, i))
            continue;
        compared++;
        hit += nodes[i] != 0;
        assert_int_equal(seen.points[i].node, nodes[i]);
        if (nodes[i] != 0)
            assert_float_equal(seen.points[i].depth, depths[i], 1e-3f * depths[i]);
    }
    assert_true(compared > PIXELS / 2 && hit > PIXELS / 8); // thousands
    for (int k = 0; k < 50; k++) {                          // a pick says what the rectangle says
        struct hg_pick pick;
        const uint32_t x = (uint32_t)(random_float(&seed) * SIDE),
                       y = (uint32_t)(random_float(&seed) * SIDE);
        test_ok(hg_view_pick(rig->view, x, y, &pick, &rig->err), &rig->err);
        const struct hg_surface_point *p = &seen.points[y * SIDE + x];
        assert_int_equal(pick.hit ? pick.node : 0, p->node);
        assert_memory_equal(pick.position, p->position, sizeof p->position);
    }
}

static void test_picks_are_what_rays_meet(void **state)
{
    struct rig rig;
    (void)state;
    open_scene(&rig);
    compare(&rig, &(struct hg_clip){0});
    rig_close(&rig);
}

static void test_picks_behind_planes_are_what_rays_meet(void **state)
{
    struct rig rig;
    const struct hg_clip clip = {.count = 2,
        .planes = {{-0.6f, 0, -0.8f, -0.3f}, {0, -1, 0, -0.6f}},
        .caps = HG_CAPS_NONE,
        .hatch_px = 8};
    (void)state;
    open_scene(&rig);
    test_ok(hg_view_set_clip(rig.view, &clip, &rig.err), &rig.err);
    rig_settle(&rig, 1);
    compare(&rig, &clip);
    rig_close(&rig);
}

// --- grids ---------------------------------------------------------------------------------------

struct cells {
    uint32_t columns;
    struct hg_surface_point points[PIXELS];
};

static void keep_cells(void *user, uint32_t y, const struct hg_surface_point *points)
{
    struct cells *cells = user;
    memcpy(cells->points + (size_t)y * cells->columns, points, cells->columns * sizeof *points);
}

static void read_grid(struct rig *rig, struct cells *cells, uint32_t columns, uint32_t rows)
{
    const struct hg_surface_grid grid = {columns, rows, keep_cells, cells};
    cells->columns = columns;
    test_ok(hg_view_surface_grid(rig->view, &grid, &rig->err), &rig->err);
}

// The surfaces of cells are those of the pixels that their centres lie in, or between. Returns how
// many could be compared.
static uint32_t compare_cells(
    const struct cells *cells, uint32_t rows, const struct seen *seen, const uint64_t *nodes)
{
    uint32_t compared = 0;
    for (uint32_t i = 0; i < cells->columns * rows; i++) {
        const uint32_t x = (2 * (i % cells->columns) + 1) * SIDE / (2 * cells->columns),
                       y = (2 * (i / cells->columns) + 1) * SIDE / (2 * rows);
        const struct hg_surface_point *c = &cells->points[i], *p = &seen->points[y * SIDE + x];
        if (!is_inner(nodes, (int)(y * SIDE + x)))
            continue;
        compared++;
        assert_int_equal(c->node, p->node);
        assert_int_equal(c->material, p->material);
        // A corner of the blocks may lie between the two: half a pixel of a face at an angle.
        if (p->node != 0)
            assert_float_equal(c->depth, p->depth, 0.05f * p->depth);
        else
            assert_true(isinf(c->depth));
    }
    return compared;
}

static void test_cells_show_what_their_centres_do(void **state)
{
    static struct seen seen;
    static struct cells cells;
    static uint64_t nodes[PIXELS];
    struct rig rig;
    const struct hg_clip clip = {
        .count = 1, .planes = {{0, -1, 0, -0.6f}}, .caps = HG_CAPS_COLOR, .hatch_px = 8};
    const struct hg_surface_rect all = {
        .width = SIDE, .height = SIDE, .row = keep_row, .user = &seen};
    (void)state;
    open_scene(&rig);
    for (int cut = 0; cut < 2; cut++) {
        test_ok(hg_view_surfaces(rig.view, &all, &rig.err), &rig.err);
        for (int i = 0; i < PIXELS; i++)
            nodes[i] = seen.points[i].node;
        read_grid(&rig, &cells, SIDE, SIDE); // a cell is a pixel: the same, corners included
        for (int i = 0; i < PIXELS; i++) {
            assert_int_equal(cells.points[i].node, nodes[i]);
            assert_true(cells.points[i].depth == seen.points[i].depth);
        }
        read_grid(&rig, &cells, SIDE / 4, SIDE / 4);
        assert_true(compare_cells(&cells, SIDE / 4, &seen, nodes) > 600); // of 1600
        read_grid(&rig, &cells, 53, 31);
        assert_true(compare_cells(&cells, 31, &seen, nodes) > 600); // of 1643
        test_ok(hg_view_set_clip(rig.view, &clip, &rig.err), &rig.err);
        rig_settle(&rig, 1);
    }
    const struct hg_surface_grid wrong[] = {{SIDE + 1, 1, keep_cells, &cells},
        {1, SIDE + 1, keep_cells, &cells}, {0, 1, keep_cells, &cells}, {1, 0, keep_cells, &cells}};
    for (int i = 0; i < 4; i++)
        assert_int_equal(hg_view_surface_grid(rig.view, &wrong[i], &rig.err), HG_E_INVAL);
    rig_close(&rig);
}

// --- what a look costs ---------------------------------------------------------------------------

static void test_a_look_takes_two_small_tables(void **state)
{
    struct rig rig;
    struct hg_node_look items[2] = {{.node = 1, .set = HG_LOOK_TINT, .tint = {1, 0, 0, 1}},
        {.node = 2, .set = HG_LOOK_ALPHA, .alpha = 0.5f}};
    struct hg_view_overrides overrides = {.items = items, .count = 2};
    (void)state;
    open_scene(&rig);
    struct hg_refbuf *before = rig_pixels(&rig, HG_PIXEL_RGBA8);
    assert_null(rig.view->look);
    struct hg_pick pick; // a node that is seen
    test_ok(hg_view_pick(rig.view, SIDE / 2, SIDE / 2, &pick, &rig.err), &rig.err);
    assert_true(pick.hit);
    items[0].node = pick.node;
    items[1].node = pick.node == 2 ? 3 : 2;
    test_ok(hg_view_set_overrides(rig.view, &overrides, &rig.err), &rig.err);
    rig_settle(&rig, 1);
    struct hg_refbuf *with = rig_pixels(&rig, HG_PIXEL_RGBA8);
    assert_memory_not_equal(before->data, with->data, PIXELS * 4);
    const uint64_t bytes = hg_view_tables_bytes(&rig.view->look->tables);
    assert_true(bytes >= BLOCKS * 16 + 4 * 240 && bytes <= 65536 * 2);
    overrides.clear = true;
    overrides.count = 0;
    test_ok(hg_view_set_overrides(rig.view, &overrides, &rig.err), &rig.err);
    rig_settle(&rig, 1);
    struct hg_refbuf *after = rig_pixels(&rig, HG_PIXEL_RGBA8);
    assert_memory_equal(before->data, after->data, PIXELS * 4);
    hg_refbuf_unref(before);
    hg_refbuf_unref(with);
    hg_refbuf_unref(after);
    rig_close(&rig);
}

static void test_more_overrides_than_there_may_be(void **state)
{
    struct rig rig;
    const uint32_t count = HG_LOOK_MOST_NODES + 1;
    (void)state;
    open_scene(&rig);
    struct hg_node_look *items = calloc(count, sizeof *items);
    assert_non_null(items);
    for (uint32_t i = 0; i < count; i++)
        items[i] = (struct hg_node_look){.node = i + 1, .set = HG_LOOK_HIDDEN, .hidden = true};
    struct hg_view_overrides overrides = {.items = items, .count = count};
    assert_int_equal(hg_view_set_overrides(rig.view, &overrides, &rig.err), HG_E_LIMIT);
    overrides.count--;
    test_ok(hg_view_set_overrides(rig.view, &overrides, &rig.err), &rig.err);
    items[0].node = count; // one more than there are
    overrides.count = 1;
    assert_int_equal(hg_view_set_overrides(rig.view, &overrides, &rig.err), HG_E_LIMIT);
    items[0] = (struct hg_node_look){.node = 1}; // one that goes
    test_ok(hg_view_set_overrides(rig.view, &overrides, &rig.err), &rig.err);
    free(items);
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_picks_are_what_rays_meet),
        cmocka_unit_test(test_picks_behind_planes_are_what_rays_meet),
        cmocka_unit_test(test_cells_show_what_their_centres_do),
        cmocka_unit_test(test_a_look_takes_two_small_tables),
        cmocka_unit_test(test_more_overrides_than_there_may_be),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
