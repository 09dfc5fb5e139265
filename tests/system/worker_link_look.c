// worker_link_look.c - what one view of a real helio-worker shows of a scene: clipping planes with
// caps, overrides and layers, and questions about what is seen. All answers are known in closed
// form. Needs a device; lavapipe will do.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "tests/system/worker_link_rig.h"

// A cube of 2 m with one of 1 m in its middle, seen along -Z from 5 m: 16 px to the metre.
enum { VIEW = 3, OTHER = 4, SIDE = 64, PX_PER_M = 16, OUTER = FIRST_ID, INNER = FIRST_ID + 1 };
enum { GROUP = FIRST_ID + 2, OUTER_PX = 32 * 32, INNER_PX = 16 * 16 };

static void make_cube(struct rig *rig, uint64_t id, float half)
{
    static const uint32_t faces[] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3,
        3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    float corners[8][3];
    for (int i = 0; i < 8; i++)
        for (int c = 0; c < 3; c++)
            corners[i][c] = i >> c & 1 ? half : -half;
    struct hgp_mesh_part part = {.mode = HGP_primitive_mode_TRIANGLES,
        .material = id,
        .positions = {(const uint8_t *)corners, sizeof corners},
        .indices = {(const uint8_t *)faces, sizeof faces}};
    struct hgp_mesh_set mesh = {.mesh = id};
    mesh.parts.items = &part;
    mesh.parts.count = 1;
    struct hgp_material_set material = {.material = id,
        .has_base_color = true,
        .base_color = {id == OUTER ? 0.8f : 0.1f, 0.3f, id == OUTER ? 0.1f : 0.9f, 1}};
    link_expect(rig, link_ask(rig, 1, HGP_T_material_set, &material), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_mesh_set, &mesh), HGP_T_ok);
    struct hgp_node_set node = {
        .node = id, .has_mesh = true, .mesh = id, .has_parent = true, .parent = GROUP};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
}

static void make_view(struct rig *rig, uint32_t number)
{
    struct hgp_view_set view = {.view = number,
        .has_width = true,
        .width = SIDE,
        .has_height = true,
        .height = SIDE,
        .has_samples = true,
        .samples = 4,
        .has_background = true,
        .background = HGP_background_NONE,
        .has_exposure_ev = true,
        .has_gi = true,
        .gi = HGP_gi_NONE};
    struct hgp_view_camera camera = {.view = number,
        .has_eye = true,
        .eye = {0, 0, 5},
        .has_target = true,
        .has_kind = true,
        .kind = HGP_camera_kind_ORTHOGRAPHIC,
        .has_half_height = true,
        .half_height = 0.5f * SIDE / PX_PER_M};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &view), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_view_camera, &camera), HGP_T_ok);
}

static void make_scene(struct rig *rig)
{
    link_attach(rig, 1, "a");
    struct hgp_environment_set sky = {.has_kind = true,
        .kind = HGP_environment_kind_COLOR,
        .has_color = true,
        .color = {1, 1, 1}};
    link_expect(rig, link_ask(rig, 1, HGP_T_environment_set, &sky), HGP_T_ok);
    struct hgp_node_set group = {.node = GROUP};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &group), HGP_T_ok);
    make_cube(rig, OUTER, 1);
    make_cube(rig, INNER, 0.5f);
    make_view(rig, VIEW);
}

static void clip(struct rig *rig, uint32_t view, const float plane[4])
{
    struct hgp_clip_plane p = {.normal = {plane[0], plane[1], plane[2]}, .distance = plane[3]};
    struct hgp_view_clip m = {.view = view};
    m.planes.items = &p;
    m.planes.count = 1;
    link_expect(rig, link_ask(rig, 1, HGP_T_view_clip, &m), HGP_T_ok);
}

static uint32_t send_override(struct rig *rig, struct hgp_node_override o, bool clear)
{
    struct hgp_view_overrides m = {.view = VIEW, .has_clear = true, .clear = clear};
    m.overrides.items = &o;
    m.overrides.count = 1;
    return link_ask(rig, 1, HGP_T_view_overrides, &m);
}

static void override_node(struct rig *rig, struct hgp_node_override o)
{
    link_expect(rig, send_override(rig, o, false), HGP_T_ok);
}

// Pixels of a node in the whole picture.
static uint32_t count_pixels(struct rig *rig, uint64_t node)
{
    struct hgp_pixel_rect all = {0, 0, SIDE, SIDE};
    struct hgp_box_select m = {.view = VIEW};
    m.rects.items = &all;
    m.rects.count = 1;
    link_expect(rig, link_ask(rig, 1, HGP_T_box_select, &m), HGP_T_box_selected);
    const struct hgp_box_selected *a = &rig->message.box_selected;
    assert_int_equal(a->total, a->nodes.count);
    for (uint32_t i = 0; i < a->nodes.count; i++)
        if (a->nodes.items[i].node == node)
            return a->nodes.items[i].pixels;
    return 0;
}

static uint64_t picked_node(struct rig *rig, uint32_t x, uint32_t y)
{
    struct hgp_pick pick = {.view = VIEW, .x = x, .y = y};
    link_expect(rig, link_ask(rig, 1, HGP_T_pick, &pick), HGP_T_picked);
    return rig->message.picked.hit ? rig->message.picked.node : 0;
}

// The settled frame, RGBA8; freed with free.
static uint8_t *take_pixels(struct rig *rig, uint32_t view)
{
    struct hgp_frame_request m = {
        .view = view, .settled = true, .has_encoding = true, .encoding = HGP_encoding_RAW_RGBA8};
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_request, &m), HGP_T_frame);
    const struct hgp_bytes *data = &rig->message.frame.data;
    assert_int_equal(data->size, SIDE * SIDE * 4);
    uint8_t *copy = malloc(data->size);
    assert_non_null(copy);
    memcpy(copy, data->data, data->size);
    return copy;
}

static float read_f32(const uint8_t *at)
{
    float value;
    memcpy(&value, at, sizeof value);
    return value;
}

// ---- caps ---------------------------------------------------------------------------------------

// Half of the cubes is cut away: their cross-sections are squares, the inner one lies in the outer.
static void test_caps_of_nested_cubes(void **state)
{
    struct rig *rig = *state;
    make_scene(rig);
    assert_int_equal(count_pixels(rig, OUTER), OUTER_PX);
    assert_int_equal(count_pixels(rig, INNER), 0);
    clip(rig, VIEW, (float[]){0, 0, -2, 0.25f}); // of any length: what is below z = -0.25
    assert_int_equal(count_pixels(rig, INNER), INNER_PX);
    assert_int_equal(count_pixels(rig, OUTER), OUTER_PX - INNER_PX);
    struct hgp_surface_query m = {
        .view = VIEW, .x = 16, .y = 16, .width = 32, .height = 32, .what = 1 | 2 | 8};
    link_expect(rig, link_ask(rig, 1, HGP_T_surface_query, &m), HGP_T_surfaces);
    const uint8_t *depth = rig->message.surfaces.data.data, *normal = depth + OUTER_PX * 4;
    assert_int_equal(rig->message.surfaces.data.size, OUTER_PX * (4 + 12 + 8));
    for (int i = 0; i < OUTER_PX; i++) {
        assert_float_equal(read_f32(depth + i * 4), 5.25f, 1e-4f);
        assert_float_equal(read_f32(normal + i * 12 + 8), 1.0f, 1e-6f);
    }
    assert_int_equal(picked_node(rig, 32, 32), INNER);
    assert_float_equal(rig->message.picked.position[2], -0.25f, 1e-4f);
    assert_int_equal(picked_node(rig, 20, 20), OUTER);
    // Behind both cubes nothing is left.
    clip(rig, VIEW, (float[]){0, 0, -1, 2});
    assert_int_equal(count_pixels(rig, OUTER) + count_pixels(rig, INNER), 0);
}

// A plane at 45 degrees through the middle: the cross-section of the cube is 2 x 2.83 m and covers
// all of its picture; its depth grows downwards by a metre per metre.
static void test_a_slanted_cap(void **state)
{
    struct rig *rig = *state;
    make_scene(rig);
    clip(rig, VIEW, (float[]){0, -1, -1, 0});
    assert_int_equal(count_pixels(rig, INNER), INNER_PX);
    assert_int_equal(count_pixels(rig, OUTER), OUTER_PX - INNER_PX);
    struct hgp_surface_query m = {
        .view = VIEW, .x = 32, .y = 16, .width = 1, .height = 32, .what = 1};
    link_expect(rig, link_ask(rig, 1, HGP_T_surface_query, &m), HGP_T_surfaces);
    for (int i = 0; i < 32; i++) {
        const float y = 1 - ((float)i + 0.5f) / PX_PER_M;
        assert_float_equal(read_f32(rig->message.surfaces.data.data + i * 4), 5 + y, 1e-4f);
    }
}

// Caps are laid over the pictures of both modes alike, and settled frames are the same again.
static void test_caps_agree_in_both_modes(void **state)
{
    struct rig *rig = *state;
    make_scene(rig);
    clip(rig, VIEW, (float[]){0, 0, -1, 0});
    uint8_t *drawn = take_pixels(rig, VIEW);
    struct hgp_view_set path = {.view = VIEW, .has_mode = true, .mode = HGP_render_mode_PATH};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &path), HGP_T_ok);
    uint8_t *traced = take_pixels(rig, VIEW);
    for (int y = 17; y < 47; y++)
        assert_memory_equal(drawn + (y * SIDE + 17) * 4, traced + (y * SIDE + 17) * 4, 30 * 4);
    const uint8_t *outer = drawn + (20 * SIDE + 20) * 4, *inner = drawn + (32 * SIDE + 32) * 4;
    assert_true(outer[0] > outer[2] && inner[2] > inner[0]); // their materials' colours
    assert_int_equal(drawn[(2 * SIDE + 2) * 4 + 3], 0);      // beside them there is nothing
    free(drawn);
    free(traced);
}

static void test_planes_that_are_refused(void **state)
{
    struct rig *rig = *state;
    make_scene(rig);
    struct hgp_clip_plane none = {.distance = 1};
    struct hgp_view_clip m = {.view = VIEW};
    m.planes.items = &none;
    m.planes.count = 1;
    link_expect_error(rig, link_ask(rig, 1, HGP_T_view_clip, &m), HG_E_INVAL, "planes");
    none.normal[0] = 1;
    m.has_cap_color = true;
    m.cap_color[1] = 7;
    link_expect_error(rig, link_ask(rig, 1, HGP_T_view_clip, &m), HG_E_INVAL, "caps");
    m.view = OTHER;
    link_expect_error(rig, link_ask(rig, 1, HGP_T_view_clip, &m), HG_E_NOTFOUND, NULL);
    assert_int_equal(count_pixels(rig, OUTER), OUTER_PX); // nothing was cut
}

// ---- overrides ----------------------------------------------------------------------------------

static void test_hiding_by_hierarchy_in_one_view_alone(void **state)
{
    struct rig *rig = *state;
    make_scene(rig);
    make_view(rig, OTHER);
    uint8_t *before = take_pixels(rig, OTHER);
    override_node(rig, (struct hgp_node_override){.node = OUTER, .set = 1, .hidden = true});
    assert_int_equal(count_pixels(rig, OUTER), 0);
    assert_int_equal(count_pixels(rig, INNER), INNER_PX);
    // The group hides both, but for the one that says otherwise.
    override_node(rig, (struct hgp_node_override){.node = GROUP, .set = 1, .hidden = true});
    override_node(rig, (struct hgp_node_override){.node = OUTER, .set = 1});
    assert_int_equal(count_pixels(rig, OUTER), OUTER_PX);
    override_node(rig, (struct hgp_node_override){.node = OUTER, .set = 0});
    assert_int_equal(count_pixels(rig, OUTER), 0);
    uint8_t *other = take_pixels(rig, OTHER);
    assert_memory_equal(before, other, SIDE * SIDE * 4);
    // And with all of them gone the picture is the other view's.
    struct hgp_view_overrides clear = {.view = VIEW, .has_clear = true, .clear = true};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_overrides, &clear), HGP_T_ok);
    uint8_t *again = take_pixels(rig, VIEW);
    assert_memory_equal(before, again, SIDE * SIDE * 4);
    free(before);
    free(other);
    free(again);
}

// The light that falls on a surface is white: its colour is that of its material.
static void test_tint_alpha_and_selection(void **state)
{
    struct rig *rig = *state;
    const size_t middle = (32 * SIDE + 32) * 4, beside = (32 * SIDE + 15) * 4;
    make_scene(rig);
    uint8_t *plain = take_pixels(rig, VIEW);
    override_node(
        rig, (struct hgp_node_override){.node = GROUP, .set = 2, .tint = {0.1f, 0.9f, 0.1f, 1}});
    uint8_t *tinted = take_pixels(rig, VIEW);
    assert_true(plain[middle] > plain[middle + 1] && tinted[middle] < tinted[middle + 1]);
    override_node(rig, (struct hgp_node_override){.node = GROUP, .set = 0});
    override_node(rig, (struct hgp_node_override){.node = OUTER, .set = 8, .alpha = 0.25f});
    uint8_t *through = take_pixels(rig, VIEW);
    assert_true(through[middle + 2] > plain[middle + 2] + 40);   // the blue cube inside
    assert_in_range(through[(20 * SIDE + 20) * 4 + 3], 40, 150); // two walls of a quarter each
    link_expect(rig,
        send_override(
            rig, (struct hgp_node_override){.node = OUTER, .set = 4, .selected = true}, true),
        HGP_T_ok);
    uint8_t *selected = take_pixels(rig, VIEW);
    assert_int_equal(plain[beside + 3], 0); // where the outline lies there was nothing
    assert_int_equal(selected[beside + 3], 255);
    assert_int_equal(selected[beside], 255); // 1 0.45 0.05 in sRGB
    assert_in_range(selected[beside + 1], 175, 185);
    assert_memory_not_equal(selected + middle, plain + middle, 4);
    free(plain);
    free(tinted);
    free(through);
    free(selected);
}

static void test_overrides_that_are_refused(void **state)
{
    struct rig *rig = *state;
    make_scene(rig);
    const struct hgp_node_override unknown = {.node = 77, .set = 1, .hidden = true};
    link_expect_error(rig, send_override(rig, unknown, false), HG_E_NOTFOUND, "overrides");
    const struct hgp_node_override wrong = {.node = OUTER, .set = 2, .tint = {2, 0, 0, 1}};
    link_expect_error(rig, send_override(rig, wrong, false), HG_E_INVAL, "tint");
    assert_int_equal(count_pixels(rig, OUTER), OUTER_PX);
    struct hgp_view_variant variant = {.view = VIEW, .asset = 9};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_view_variant, &variant), HG_E_NOTFOUND, "asset");
}

static void test_layers(void **state)
{
    struct rig *rig = *state;
    make_scene(rig);
    struct hgp_node_set second = {.node = OUTER, .has_layers = true, .layers = 2};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &second), HGP_T_ok);
    assert_int_equal(count_pixels(rig, OUTER), OUTER_PX); // a view shows all of them
    struct hgp_view_set layers = {.view = VIEW, .has_layers = true, .layers = 1};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &layers), HGP_T_ok);
    assert_int_equal(count_pixels(rig, OUTER), 0);
    assert_int_equal(count_pixels(rig, INNER), INNER_PX);
    layers.layers = 2;
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &layers), HGP_T_ok);
    assert_int_equal(count_pixels(rig, OUTER), OUTER_PX);
}

// ---- questions ----------------------------------------------------------------------------------

static void test_boxes_and_measures(void **state)
{
    struct rig *rig = *state;
    make_scene(rig);
    struct hgp_pixel_rect half[2] = {{0, 0, 32, 32}, {20, 20, 4, 4}}; // overlap counts once
    struct hgp_box_select m = {.view = VIEW};
    m.rects.items = half;
    m.rects.count = 2;
    link_expect(rig, link_ask(rig, 1, HGP_T_box_select, &m), HGP_T_box_selected);
    assert_int_equal(rig->message.box_selected.total, 1);
    assert_int_equal(rig->message.box_selected.nodes.items[0].pixels, 16 * 16);
    assert_int_equal(rig->message.box_selected.nodes.items[0].outside, OUTER_PX - 16 * 16);
    m.has_inside = m.inside = true;
    link_expect(rig, link_ask(rig, 1, HGP_T_box_select, &m), HGP_T_box_selected);
    assert_int_equal(rig->message.box_selected.total, 0);
    half[0] = (struct hgp_pixel_rect){10, 10, 44, 44};
    link_expect(rig, link_ask(rig, 1, HGP_T_box_select, &m), HGP_T_box_selected);
    assert_int_equal(rig->message.box_selected.total, 1);
    half[0].width = 60;
    link_expect_error(rig, link_ask(rig, 1, HGP_T_box_select, &m), HG_E_INVAL, NULL);
    struct hgp_measure two = {.view = VIEW, .x0 = 20, .y0 = 30, .x1 = 36, .y1 = 30};
    link_expect(rig, link_ask(rig, 1, HGP_T_measure, &two), HGP_T_measured);
    assert_true(rig->message.measured.hit);
    assert_float_equal(rig->message.measured.distance, 1, 1e-4f);
    assert_float_equal(rig->message.measured.along_normal, 0, 1e-4f);
    assert_float_equal(rig->message.measured.angle_rad, 0, 1e-3f);
    two.x1 = 1;
    link_expect(rig, link_ask(rig, 1, HGP_T_measure, &two), HGP_T_measured);
    assert_false(rig->message.measured.hit);
}

static void test_frames_that_are_too_old(void **state)
{
    struct rig *rig = *state;
    make_scene(rig);
    free(take_pixels(rig, VIEW));
    struct hgp_measure m = {.view = VIEW,
        .x0 = 30,
        .y0 = 30,
        .x1 = 33,
        .y1 = 33,
        .has_frame = true,
        .frame = rig->message.frame.number};
    link_expect(rig, link_ask(rig, 1, HGP_T_measure, &m), HGP_T_measured);
    assert_int_equal(rig->message.measured.frame, m.frame);
    struct hgp_view_camera move = {.view = VIEW, .has_eye = true, .eye = {0.5f, 0, 5}};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_camera, &move), HGP_T_ok);
    link_expect_error(rig, link_ask(rig, 1, HGP_T_measure, &m), HG_E_STATE, "frame");
    m.frame = 1u << 30;
    link_expect_error(rig, link_ask(rig, 1, HGP_T_measure, &m), HG_E_STATE, "frame");
}

// ---- depth of frames ----------------------------------------------------------------------------

enum { CELLS = SIDE / 4, DEPTH_HEAD = 12 };

// The subscription's next frame of a camera. Frames of others may be under way.
static const struct hgp_frame *next_frame(struct rig *rig, uint64_t seq)
{
    do {
        link_read(rig);
        assert_int_not_equal(rig->header.type, HGP_T_error);
    } while (rig->header.type != HGP_T_frame || rig->header.request != 0 ||
             rig->message.frame.input_seq != seq);
    return &rig->message.frame;
}

// To the values of the cells, in what the frame has them in; NAN where nothing is. Returns how far
// apart two neighbouring steps are.
static float read_cells(const struct hgp_bytes *depth, float cells[CELLS * CELLS])
{
    uint8_t planes[2 * CELLS * CELLS];
    uLongf size = sizeof planes;
    assert_true(depth->size > DEPTH_HEAD);
    assert_memory_equal(depth->data, ((uint8_t[]){CELLS, 0, CELLS, 0}), 4);
    const float low = read_f32(depth->data + 4), high = read_f32(depth->data + 8);
    assert_int_equal(
        uncompress(planes, &size, depth->data + DEPTH_HEAD, depth->size - DEPTH_HEAD), Z_OK);
    assert_int_equal(size, sizeof planes);
    uint16_t values[CELLS * CELLS];
    for (int i = 0; i < CELLS * CELLS; i++) {
        const int x = i % CELLS, y = i / CELLS;
        const unsigned folded = planes[i] | (unsigned)planes[CELLS * CELLS + i] << 8;
        const int rest = (int)(folded >> 1) ^ -(int)(folded & 1);
        const int left = x ? values[i - 1] : 0, above = y ? values[i - CELLS] : 0;
        const int guess = x && y ? left + above - values[i - CELLS - 1] : left + above;
        values[i] = (uint16_t)(guess + rest);
        cells[i] = values[i] ? low + (float)(values[i] - 1) / 4094.0f * (high - low) : NAN;
    }
    return (high - low) / 4094.0f;
}

// What a cell is to hold, by what surface_query says of the four pixels around its centre. False:
// they show no one plane.
static bool expected_cell(const uint8_t *depths, int x, int y, bool flat, float *wanted)
{
    float near = INFINITY, far = 0, sum = 0;
    for (int i = 0; i < 4; i++) {
        const float d = read_f32(depths + 4 * ((4 * y + 1 + i / 2) * SIDE + 4 * x + 1 + i % 2));
        near = fminf(near, d);
        far = fmaxf(far, d);
        sum += flat ? d : 1 / d;
    }
    *wanted = isfinite(near) ? sum / 4 : NAN;
    return !isfinite(near) || far - near <= 0.05f * near;
}

static void expect_depth(struct rig *rig, uint64_t seq, bool flat)
{
    float cells[CELLS * CELLS];
    const struct hgp_frame *frame = next_frame(rig, seq);
    assert_true(frame->has_depth && frame->has_eye && frame->has_forward && frame->has_up);
    assert_int_equal(
        frame->kind, flat ? HGP_camera_kind_ORTHOGRAPHIC : HGP_camera_kind_PERSPECTIVE);
    assert_float_equal(flat ? frame->half_height : frame->vfov_rad, flat ? 2 : 0.9f, 1e-4f);
    const float eye[] = {0.5f, 0.25f, 5}, forward[] = {0, 0, -1}, up[] = {0, 1, 0};
    for (int i = 0; i < 3; i++) {
        assert_float_equal(frame->eye[i], eye[i], 1e-4f);
        assert_float_equal(frame->forward[i], forward[i], 1e-5f);
        assert_float_equal(frame->up[i], up[i], 1e-5f);
    }
    const float step = read_cells(&frame->depth, cells);
    struct hgp_surface_query all = {.view = VIEW, .width = SIDE, .height = SIDE, .what = 1};
    link_expect(rig, link_ask(rig, 1, HGP_T_surface_query, &all), HGP_T_surfaces);
    int there = 0, planes = 0;
    for (int i = 0; i < CELLS * CELLS; i++) {
        const uint8_t *depths = rig->message.surfaces.data.data;
        float wanted;
        there += !isnan(cells[i]);
        if (!expected_cell(depths, i % CELLS, i / CELLS, flat, &wanted))
            continue;
        planes++;
        if (isnan(wanted) || isnan(cells[i]))
            assert_true(isnan(wanted) && isnan(cells[i]));
        else
            assert_float_equal(cells[i], wanted, 0.51f * step + 1e-6f);
    }
    assert_in_range(there, 32, CELLS * CELLS - 32);
    assert_true(planes > CELLS * CELLS * 3 / 4);
}

static void send_camera(struct rig *rig, uint64_t seq, float x, bool flat)
{
    struct hgp_view_camera camera = {.view = VIEW,
        .input_seq = seq,
        .has_eye = true,
        .eye = {x, 0.25f, 5},
        .has_target = true,
        .target = {x, 0.25f, 0},
        .has_kind = true,
        .kind = flat ? HGP_camera_kind_ORTHOGRAPHIC : HGP_camera_kind_PERSPECTIVE,
        .has_vfov_rad = true,
        .vfov_rad = 0.9f,
        .has_half_height = true,
        .half_height = 2};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_camera, &camera), HGP_T_ok);
}

// It comes with the first frame of each state and is what surface_query says, for views that want
// it; frames that a request asks for have none.
static void test_depth_of_frames(void **state)
{
    struct rig *rig = *state;
    make_scene(rig);
    clip(rig, VIEW, (float[]){0, -1, -1, 0}); // a slope of 1
    send_camera(rig, 7, 0.5f, true);
    struct hgp_view_set set = {.view = VIEW, .has_depth = true, .depth = 1};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &set), HGP_T_ok);
    struct hgp_subscribe subscribe = {.view = VIEW, .credit_frames = 1000};
    link_expect(rig, link_ask(rig, 1, HGP_T_subscribe, &subscribe), HGP_T_ok);
    expect_depth(rig, 7, true);
    send_camera(rig, 8, 0.5f, false);
    expect_depth(rig, 8, false);
    send_camera(rig, 9, 0, false);
    const struct hgp_frame *frame = next_frame(rig, 9);
    for (assert_true(frame->has_depth); !frame->settled;) {
        frame = next_frame(rig, 9);
        assert_false(frame->has_depth || frame->has_eye); // of the same state
    }
    struct hgp_frame_request now = {.view = VIEW};
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_request, &now), HGP_T_frame);
    assert_false(rig->message.frame.has_depth);
    set.depth = 0;
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &set), HGP_T_ok);
    send_camera(rig, 10, 0.5f, false);
    assert_false(next_frame(rig, 10)->has_depth);
}

#define TEST(function) cmocka_unit_test_teardown(function, link_detach)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_caps_of_nested_cubes),
        TEST(test_a_slanted_cap),
        TEST(test_caps_agree_in_both_modes),
        TEST(test_planes_that_are_refused),
        TEST(test_hiding_by_hierarchy_in_one_view_alone),
        TEST(test_tint_alpha_and_selection),
        TEST(test_overrides_that_are_refused),
        TEST(test_layers),
        TEST(test_boxes_and_measures),
        TEST(test_frames_that_are_too_old),
        TEST(test_depth_of_frames),
    };
    return cmocka_run_group_tests(tests, link_start, link_stop);
}
