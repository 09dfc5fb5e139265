// render_path_memory.c - path-traced pictures of scenes that are much larger than what they are
// given: geometry, structures for rays and textures stay within their budgets, and the pictures are
// those without limits, byte for byte; so are the planes of real-time pictures.
//
//     test_render_path_memory [CELLS TILES SIDE_PX BUDGET_MIB]
//
// The scene: terrain of TILES^2 meshes of 2 CELLS^2 triangles, and a wall of 400 posters over it,
// each with a picture of its own of SIDE_PX^2. Seen from two places in turn. Without arguments it
// takes seconds; with 1200 3 1024 64 it has 26 million triangles and 2.2 GB of texels.

#include "base/alloc.h"
#include "base/log.h"
#include "base/spill.h"
#include "renderer/bench/common.h"
#include "renderer/bench/mesh.h"
#include "renderer/internal.h"
#include "tests/support/folder.h"
#include "tests/unit/render_rig.h"

#define MIB           (1ull << 20)
#define WIDTH         160
#define HEIGHT        90
#define VFOV_RAD      0.8f
#define ROW           20 // posters in one
#define POSTERS       (ROW * ROW)
#define POSTER_M      2.0f
#define APART_M       4.0f
#define TEXTURE_BYTES (16 * MIB)
#define PLACES        2

static uint32_t cells = 300, tiles = 2, side_px = 512;
static uint64_t budget_bytes = 12 * MIB;
static char cache_dir[TEST_FOLDER_MAX];

static struct hg_image_tiles pictures[POSTERS];

// --- the scene -----------------------------------------------------------------------------------

// Squares of 8 texels in two colours of the picture's own, in every mip.
static bool make_picture(void *user, const struct hg_image_rect *rect, void *pixels)
{
    const uint32_t mip = rect->mip, x = rect->at[0], y = rect->at[1];
    const uint32_t width = rect->size[0], height = rect->size[1];
    const uint32_t seed = ((uint32_t)((struct hg_image_tiles *)user - pictures) + 1) * 2654435761u;
    for (uint32_t j = 0; j < height; j++) {
        uint8_t *row = (uint8_t *)pixels + (size_t)j * width * 4;
        for (uint32_t i = 0; i < width; i++) {
            const uint32_t square = ((x + i) >> 3) + ((y + j) >> 3) + mip;
            for (uint32_t c = 0; c < 3; c++)
                row[i * 4 + c] = (uint8_t)(seed >> (8 * c + square % 2));
            row[i * 4 + 3] = 255;
        }
    }
    return true;
}

static struct hg_texture *add_picture(struct hg_bench_scene *s, uint32_t index)
{
    struct hg_texture *texture;
    assert_int_equal(hg_bench_scene_add(s, HG_OBJECT_TEXTURE, &texture), HG_OK);
    texture->image = hg_calloc(1, sizeof *texture->image);
    assert_non_null(texture->image);
    texture->image->refs = 1;
    texture->image->label = rig_copy("poster", sizeof "poster");
    texture->image->pixels_srgb = true;
    texture->image->tiles = &pictures[index];
    pictures[index] = (struct hg_image_tiles){.width = side_px,
        .height = side_px,
        .format = HG_PIXEL_RGBA8,
        .make = make_picture,
        .user = &pictures[index]};
    snprintf((char *)pictures[index].id, sizeof pictures[index].id, "poster %u %u", index, side_px);
    return texture;
}

static void add_posters(struct hg_bench_scene *s, const struct hg_bench_pose *pose)
{
    for (uint32_t i = 0; i < POSTERS; i++) {
        struct hg_material *material;
        struct hg_mesh *mesh;
        struct hg_node *node;
        struct hg_texture *texture = add_picture(s, i);
        assert_int_equal(hg_bench_scene_add(s, HG_OBJECT_MATERIAL, &material), HG_OK);
        material->metallic = 0.0f;
        material->slots[HG_SLOT_BASE_COLOR].texture = texture;
        assert_int_equal(hg_bench_mesh_quad(s, POSTER_M, material, &mesh), HG_OK);
        assert_int_equal(hg_bench_scene_add(s, HG_OBJECT_NODE, &node), HG_OK);
        node->mesh = mesh;
        node->translation[0] = pose->eye[0] + APART_M * ((float)(i % ROW) - 0.5f * (ROW - 1));
        node->translation[1] = pose->eye[1] + APART_M * ((float)i / ROW - 0.75f * ROW);
        node->translation[2] = pose->eye[2] - 60.0f;
    }
}

static void pose_of(int place, struct hg_bench_pose *pose)
{
    hg_bench_terrain_pose(place == 0 ? 1 : 3, 4, pose);
}

static struct hg_bench_scene make_scene(struct hg_jobs *jobs)
{
    const struct hg_bench_terrain terrain = {.tiles = tiles, .cells = cells};
    struct hg_bench_scene s = {0};
    struct hg_bench_pose pose;
    struct hg_error err = {0};
    test_ok(hg_bench_terrain_make(&terrain, jobs, &s, &err), &err);
    pose_of(0, &pose);
    add_posters(&s, &pose);
    hg_scene_publish(s.scene);
    return s;
}

// --- pictures ------------------------------------------------------------------------------------

struct run {
    enum hg_render_mode mode; // in real time albedo is kept in place of the picture
    struct hg_refbuf *pictures[PLACES];
    struct hg_geometry_stats geometry;
    struct hg_textures_stats textures;
    uint64_t structure_bytes, structure_triangles; // the most
};

static void see(struct rig *rig, int place, struct run *run)
{
    struct hg_bench_pose pose;
    struct hg_view_camera camera = {.vfov_rad = VFOV_RAD};
    pose_of(place, &pose);
    memcpy(camera.eye, pose.eye, sizeof camera.eye);
    memcpy(camera.target, pose.target, sizeof camera.target);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
    struct hg_frame_info info = {0};
    while (!info.settled)
        info = rig_step(rig, 16);
    assert_int_equal(info.missing_pages, 0);
    assert_int_equal(info.missing_clusters, 0);
    const enum hg_plane plane = run->mode == HG_MODE_PATH ? HG_PLANE_COLOR : HG_PLANE_ALBEDO;
    test_ok(hg_view_read_plane(rig->view, plane, &run->pictures[place], &rig->err), &rig->err);
    const struct hg_trace_stats stats = rig_report(rig).path.structures;
    if (stats.peak_bytes > run->structure_bytes) {
        run->structure_bytes = stats.peak_bytes;
        run->structure_triangles = stats.triangles;
    }
}

static void render(bool limited, struct run *run)
{
    const struct hg_renderer_params params = {.cache_dir = cache_dir,
        .threads = 2,
        .geometry_budget_bytes = limited ? budget_bytes : 0,
        .texture_budget_bytes = limited ? TEXTURE_BYTES : 1024 * MIB};
    const struct hg_view_params view = {.width = WIDTH,
        .height = HEIGHT,
        .samples = 4,
        .seed = 5,
        .mode = run->mode,
        .planes = run->mode == HG_MODE_PATH ? 0 : 1u << HG_PLANE_ALBEDO,
        .trace = HG_VIEW_TRACE_EMBREE};
    struct rig rig = {0};
    test_ok(hg_renderer_create(&params, &rig.renderer, &rig.err), &rig.err);
    struct hg_bench_scene scene = make_scene(hg_renderer_jobs(rig.renderer));
    rig.scene = scene.scene;
    rig_view(&rig, &view);
    hg_view_set_final(rig.view, true);
    for (int place = 0; place < PLACES; place++)
        see(&rig, place, run);
    struct hg_view_report report;
    hg_view_get_report(rig.view, &report);
    run->geometry = report.geometry;
    run->textures = report.textures;
    print_message(
        "%s: %.2f million triangles, %.0f MB of texels; rays meet %.0f thousand, "
        "%.1f MB (%.0f bytes each); geometry %.1f MB, %llu chunks and %llu pages evicted, "
        "pages %.1f MB; process %.0f MB\n",
        limited ? "limited" : "unlimited", (double)scene.unique_triangles * 1e-6,
        (double)run->textures.source_bytes * 1e-6, (double)run->structure_triangles * 1e-3,
        (double)run->structure_bytes * 1e-6,
        (double)run->structure_bytes / (double)run->structure_triangles,
        (double)run->geometry.peak_bytes * 1e-6, (unsigned long long)run->geometry.chunks.evicted,
        (unsigned long long)run->textures.evicted, (double)run->textures.peak_bytes * 1e-6,
        (double)hg_renderer_peak_rss_bytes() * 1e-6);
    hg_view_destroy(rig.view);
    hg_bench_scene_finish(&scene);
    hg_renderer_destroy(rig.renderer);
}

static void compare(enum hg_render_mode mode)
{
    struct run runs[2];
    memset(runs, 0, sizeof runs);
    runs[0].mode = runs[1].mode = mode;
    render(true, &runs[0]);
    render(false, &runs[1]);
    const struct run *limited = &runs[0];
    const uint64_t triangles = 2ull * cells * cells * tiles * tiles;
    assert_true(limited->geometry.peak_bytes <= budget_bytes);
    assert_true(limited->structure_bytes <= budget_bytes);
    assert_true(limited->textures.peak_bytes <= TEXTURE_BYTES);
    // Little of the scene fits: neither its triangles nor its textures, and not both views at once.
    assert_true(36 * triangles > budget_bytes);
    assert_true(limited->textures.source_bytes >= 10 * TEXTURE_BYTES);
    assert_true(limited->textures.evicted > 0);
    for (int place = 0; place < PLACES; place++) {
        rig_assert_same(runs[1].pictures[place], limited->pictures[place]);
        hg_refbuf_unref(runs[0].pictures[place]);
        hg_refbuf_unref(runs[1].pictures[place]);
    }
}

static void test_memory(void **state)
{
    (void)state;
    compare(HG_MODE_PATH);
}

static void test_planes(void **state)
{
    (void)state;
    compare(HG_MODE_REALTIME);
}

static int setup(void **state)
{
    (void)state;
    if (!test_folder_make(cache_dir, "path-memory"))
        return -1;
    hg_spill_set_folder(cache_dir);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    hg_spill_set_folder(NULL);
    return test_folder_remove(cache_dir) ? 0 : -1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_memory), cmocka_unit_test(test_planes)};
    if (argc == 5) {
        cells = (uint32_t)strtoul(argv[1], NULL, 10);
        tiles = (uint32_t)strtoul(argv[2], NULL, 10);
        side_px = (uint32_t)strtoul(argv[3], NULL, 10);
        budget_bytes = strtoul(argv[4], NULL, 10) * MIB;
    }
    return cmocka_run_group_tests(tests, setup, teardown);
}
