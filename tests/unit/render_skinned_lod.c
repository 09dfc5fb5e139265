// render_skinned_lod.c - discrete levels of detail of skinned and morphed parts: how far they are
// off in poses, which one a view shows, and that pictures and picks do not tell.

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/geometry/geometry_state.h"
#include "renderer/lod/internal.h"
#include "renderer/image/metrics.h"
#include "renderer/internal.h"
#include "renderer/scene/load.h"
#include "tests/unit/lod_meshes.h"
#include "tests/unit/render_rig.h"

#define VIEW_PX 160

// --- errors --------------------------------------------------------------------------------------

// A torus of two joints, the second one moves its right half, and a target that squeezes it.
static struct hg_mesh_part make_posed_of(uint32_t around, uint32_t across)
{
    struct hg_mesh_part p = lod_torus(around, across, 1.0f);
    p.joint_sets = 1;
    p.joints = hg_calloc(p.vertex_count * 4ul, sizeof *p.joints);
    p.weights = hg_calloc(p.vertex_count * 4ul, sizeof *p.weights);
    p.targets = hg_calloc(1, sizeof *p.targets);
    assert_non_null(p.targets);
    p.targets[0].positions = hg_calloc(p.vertex_count * 3ul, sizeof(float));
    for (size_t v = 0; v < p.vertex_count; v++) {
        const float *at = p.positions + v * 3;
        const float right = fminf(fmaxf(0.5f + at[0], 0.0f), 1.0f);
        p.joints[v * 4 + 1] = 1;
        p.weights[v * 4] = 1.0f - right;
        p.weights[v * 4 + 1] = right;
        p.targets[0].positions[v * 3 + 1] = 0.4f * sinf(4.0f * at[0]) * at[1];
    }
    return p;
}

static struct hg_mesh_part make_posed(void)
{
    return make_posed_of(90, 44);
}

static void finish_posed(struct hg_mesh_part *p)
{
    hg_free(p->joints);
    hg_free(p->weights);
    hg_free(p->targets[0].positions);
    hg_free(p->targets);
    p->joints = NULL;
    lod_part_finish(p);
}

// Joint 0 stays; joint 1 turns about z and grows.
static void set_joints(float turn, float scale, struct hg_mat4x3 m[2])
{
    memset(m, 0, 2 * sizeof *m);
    m[0].m[0] = m[0].m[4] = m[0].m[8] = 1.0f;
    m[1].m[0] = m[1].m[4] = scale * cosf(turn);
    m[1].m[1] = scale * sinf(turn);
    m[1].m[3] = -m[1].m[1];
    m[1].m[8] = scale;
}

static void pose_all(
    const struct hg_mesh_part *p, const struct hg_mat4x3 m[2], float weight, float (*out)[3])
{
    for (size_t v = 0; v < p->vertex_count; v++)
        for (size_t c = 0; c < 3; c++) {
            out[v][c] = 0.0f;
            for (size_t j = 0; j < 2; j++) {
                float sum = m[j].m[9 + c];
                for (size_t k = 0; k < 3; k++)
                    sum += m[j].m[k * 3 + c] *
                           (p->positions[v * 3 + k] + weight * p->targets[0].positions[v * 3 + k]);
                out[v][c] += p->weights[v * 4 + j] * sum;
            }
        }
}

// The farthest that a vertex of the part is from a level, all of them posed.
static float distance_to(const struct hg_mesh_part *p, const struct hg_skinned_lod_levels *levels,
    uint32_t level, const float (*posed)[3])
{
    const struct hg_skinned_lod_level *l = &levels->items[level];
    const uint32_t *triangles = levels->indices + (l->first - p->index_count / 3) * 3;
    float worst = 0.0f;
    for (uint32_t v = 0; v < p->vertex_count; v += 5) {
        const float at[4] = {posed[v][0], posed[v][1], posed[v][2], 0.0f};
        float best = INFINITY, w[3];
        for (uint32_t t = 0; t < l->count; t++)
            best = fminf(best, hg_lod_closest(at, posed[triangles[t * 3]],
                                   posed[triangles[t * 3 + 1]], posed[triangles[t * 3 + 2]], w));
        worst = fmaxf(worst, sqrtf(best));
    }
    return worst;
}

static void test_errors_hold_in_poses(void **state)
{
    (void)state;
    struct hg_mesh_part p = make_posed();
    struct hg_skinned_lod_levels levels;
    assert_int_equal(hg_skinned_lod_build(&p, 1, &levels), HG_OK);
    assert_true(levels.count >= 4);
    float(*posed)[3] = hg_calloc(p.vertex_count, sizeof *posed);
    // Turn, scale and weight; then as they come: what is stated is sampled, pose by pose.
    enum { POSES = 20 };
    float poses[POSES][3] = {{0, 1, 0}, {1.2f, 1, 0}, {0, 1, 1}, {-0.8f, 1.5f, -0.7f}},
          tight = 0.0f;
    uint32_t seed = 11;
    for (int i = 4; i < POSES; i++) {
        poses[i][0] = 3.2f * lod_random_unit(&seed) - 1.6f;
        poses[i][1] = 0.7f + lod_random_unit(&seed);
        poses[i][2] = 2.0f * lod_random_unit(&seed) - 1.0f;
    }
    for (int i = 0; i < POSES; i++) {
        struct hg_mat4x3 joints[2];
        set_joints(poses[i][0], poses[i][1], joints);
        const struct hg_skinned_lod_pose pose = {.matrices = joints,
            .joint_count = 2,
            .weights = &poses[i][2],
            .target_count = 1,
            .stretch = fmaxf(1.0f, poses[i][1])};
        float errors[HG_SKINNED_LOD_LEVELS];
        hg_skinned_lod_errors(&levels, &p, &pose, errors);
        pose_all(&p, joints, poses[i][2], posed);
        for (uint32_t l = 0; l < levels.count; l++) {
            const float d = distance_to(&p, &levels, l, (const float(*)[3])posed);
            print_message("pose %d level %u: %u triangles, %.4f, stated %.4f\n", i, l,
                levels.items[l].count, (double)d, (double)errors[l]);
            assert_true(
                d <= errors[l] * (i < 4 ? 1.001f : 1.15f)); // between samples it may be more
            assert_true(l == 0 || errors[l] >= errors[l - 1]);
            tight = fmaxf(tight, d / errors[l]);
        }
    }
    assert_true(tight > 0.3f); // what is stated is not far from what is there
    hg_free(posed);
    hg_skinned_lod_finish(&levels);
    finish_posed(&p);
}

static void test_lists_are_sound(void **state)
{
    (void)state;
    struct hg_mesh_part p = make_posed();
    struct hg_skinned_lod_levels levels, again;
    assert_int_equal(hg_skinned_lod_build(&p, 1, &levels), HG_OK);
    assert_int_equal(hg_skinned_lod_build(&p, 1, &again), HG_OK);
    uint32_t next = p.index_count / 3, before = next;
    for (uint32_t l = 0; l < levels.count; l++) {
        assert_int_equal(levels.items[l].first, next);
        assert_true(levels.items[l].count * 20 <= before * 17);
        next += before = levels.items[l].count;
    }
    assert_int_equal(levels.index_count, next * 3 - p.index_count);
    for (uint32_t i = 0; i < levels.index_count; i++)
        assert_true(levels.indices[i] < p.vertex_count);
    for (uint32_t i = 0; i < levels.index_count / 3; i++)
        assert_true(levels.sources[i] < p.index_count / 3);
    assert_int_equal(again.index_count, levels.index_count);
    assert_memory_equal(again.indices, levels.indices, levels.index_count * 4);
    hg_skinned_lod_finish(&levels);
    hg_skinned_lod_finish(&again);
    uint16_t *joints = p.joints; // neither skinned nor morphed: none
    p.joints = NULL;
    assert_int_equal(hg_skinned_lod_build(&p, 0, &levels), HG_OK);
    assert_int_equal(levels.count, 0);
    p.joints = joints;
    finish_posed(&p);
}

// Vertices need not come in threes.
static void test_any_number_of_vertices(void **state)
{
    (void)state;
    uint32_t remainders = 0;
    for (uint32_t i = 0; i < 3; i++) {
        struct hg_mesh_part p = make_posed_of(60 + i, 42 + i);
        struct hg_skinned_lod_levels levels;
        remainders |= 1u << p.vertex_count % 3;
        assert_int_equal(hg_skinned_lod_build(&p, 1, &levels), HG_OK);
        assert_true(levels.count > 0);
        hg_skinned_lod_finish(&levels);
        finish_posed(&p);
    }
    assert_true((remainders & 6) != 0); // not all of them were multiples
}

// --- pictures ------------------------------------------------------------------------------------

static struct hg_asset *open_worm(struct rig *rig, float error_px)
{
    const struct hg_renderer_params params = {.threads = 2};
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(&params, &rig->renderer, &rig->err), &rig->err);
    struct hg_asset *asset;
    const struct hg_load_params load = {.path = TEST_MODELS "/worm.glb",
        .asset_number = 1,
        .scene_index = -1,
        .jobs = hg_renderer_jobs(rig->renderer)};
    test_ok(hg_load_asset(&load, &asset, &rig->err), &rig->err);
    assert_int_equal(hg_scene_create(&rig->scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(rig->scene, asset, NULL), HG_OK);
    assert_int_equal(hg_asset_pose(asset, -1, 0.7), HG_OK);
    rig_sun(rig->scene, 900001, -0.5f, 0.8660254f);
    rig_environment(rig->scene, 0.5f, 0.5f, 0.5f);
    hg_scene_publish(rig->scene);
    const struct hg_view_params view = {
        .width = VIEW_PX, .height = VIEW_PX, .samples = 8, .seed = 5, .error_px = error_px};
    rig_view(rig, &view);
    return asset;
}

static struct hg_frame_info look(struct rig *rig, float distance)
{
    const struct hg_view_camera camera = {
        .eye = {0.4f * distance, 0.9f + 0.2f * distance, 0.9f * distance}, .target = {0, 0.8f, 0}};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
    return rig_settle(rig, 16);
}

static struct hg_image picture(struct rig *rig)
{
    struct hg_refbuf *pixels = rig_pixels(rig, HG_PIXEL_RGBA8);
    struct hg_image image;
    assert_int_equal(hg_image_create(VIEW_PX, VIEW_PX, HG_PIXEL_RGBA8, NULL, &image), HG_OK);
    memcpy(image.pixels, pixels->data, image.size_bytes);
    hg_refbuf_unref(pixels);
    return image;
}

// What it shows gets less with the distance, and the picture is that of the whole mesh.
static void test_views_choose(void **state)
{
    (void)state;
    static const float distances[] = {2.0f, 6.0f, 15.0f, 40.0f};
    struct rig levels, whole;
    uint64_t last = UINT64_MAX, drawn = 0, all = 0;
    open_worm(&levels, 1.0f);
    open_worm(&whole, 0.01f);
    for (int i = 0; i < 4; i++) {
        struct hg_error err = {0};
        const struct hg_frame_info info = look(&levels, distances[i]);
        drawn = info.triangles_drawn;
        all = look(&whole, distances[i]).triangles_drawn;
        struct hg_image a = picture(&levels), b = picture(&whole);
        double psnr_db = 0, flip = 1;
        test_ok(hg_image_compare(
                    &(struct hg_image_pair){&a, &b, NULL}, HG_METRIC_PSNR, &psnr_db, NULL, &err),
            &err);
        test_ok(hg_image_compare(
                    &(struct hg_image_pair){&a, &b, NULL}, HG_METRIC_FLIP, &flip, NULL, &err),
            &err);
        print_message("at %.0f m: %llu of %llu triangles, %.1f dB, FLIP %.4f\n",
            (double)distances[i], (unsigned long long)drawn, (unsigned long long)all, psnr_db,
            flip);
        assert_true(drawn <= last && drawn <= all);
        assert_true(psnr_db >= 38 && flip <= 0.02);
        last = drawn;
        hg_image_finish(&a);
        hg_image_finish(&b);
    }
    assert_true(drawn * 4 <= all);
    rig_close(&levels);
    rig_close(&whole);
}

// Picks on a coarse level name the source's triangle near to the place.
static void test_picks_name_the_source(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_asset *asset = open_worm(&rig, 4.0f);
    const struct hg_frame_info info = look(&rig, 12.0f);
    const struct hg_mesh_part *part = &asset->meshes[0]->parts[0];
    uint32_t hits = 0;
    assert_true(info.triangles_drawn * 3 <= part->index_count / 3);
    for (uint32_t i = 0; i < 64; i++) {
        struct hg_pick pick;
        test_ok(hg_view_pick(rig.view, VIEW_PX / 2 - 8 + i % 8 * 2, VIEW_PX / 2 - 16 + i / 8 * 4,
                    &pick, &rig.err),
            &rig.err);
        if (!pick.hit)
            continue;
        assert_true(pick.triangle < part->index_count / 3);
        hits++;
    }
    assert_true(hits >= 8);
    rig_close(&rig);
}

// --- zoom ----------------------------------------------------------------------------------------

// A zoom by three percent at a time changes levels, and no picture by much more than the whole
// mesh changes it.
static void test_zoom_does_not_pop(void **state)
{
    (void)state;
    enum { STEPS = 60 }; // from 4 m to 23 m: where levels begin depends on how they were simplified
    struct rig rigs[2];
    struct hg_refbuf *last[2] = {NULL, NULL};
    uint64_t counts = 0, before = 0;
    double worst = 0.0;
    open_worm(&rigs[0], 1.0f);
    open_worm(&rigs[1], 0.01f);
    for (int i = 0; i < STEPS; i++) {
        double changes[2] = {0};
        for (int side = 0; side < 2; side++) {
            const uint64_t drawn = look(&rigs[side], 4.0f * powf(1.03f, (float)i)).triangles_drawn;
            struct hg_refbuf *now = rig_pixels(&rigs[side], HG_PIXEL_RGBA32F);
            changes[side] = last[side] != NULL ? rig_difference(last[side], now) : 0.0;
            hg_refbuf_unref(last[side]);
            last[side] = now;
            counts += side == 0 && drawn != before;
            before = side == 0 ? drawn : before;
        }
        worst = i > 0 ? fmax(worst, changes[0] / changes[1]) : worst;
    }
    print_message("%llu levels, at most %.3f times the change of the whole mesh\n",
        (unsigned long long)counts, worst);
    assert_true(counts >= 2);  // the first picture's counts
    assert_true(worst <= 2.0); // a level changes all at once
    for (int side = 0; side < 2; side++) {
        hg_refbuf_unref(last[side]);
        rig_close(&rigs[side]);
    }
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)2);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_errors_hold_in_poses),
        cmocka_unit_test(test_lists_are_sound), cmocka_unit_test(test_any_number_of_vertices),
        cmocka_unit_test(test_views_choose), cmocka_unit_test(test_picks_name_the_source),
        cmocka_unit_test(test_zoom_does_not_pop)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
