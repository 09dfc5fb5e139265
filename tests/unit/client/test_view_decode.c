// test_view_decode.c - frames to pixels: each encoding, and data that is not what the frame says.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <turbojpeg.h>
#include <zstd.h>

#include "client/view/decode.h"
#include "client/view/session.h"
#include "client/view/warp.h"

enum { WIDTH = 24, HEIGHT = 16, BYTES = WIDTH * HEIGHT * 4 };

static void paint(uint8_t pixels[BYTES])
{
    for (int i = 0; i < BYTES; i++)
        pixels[i] = (uint8_t)(i % 4 == 3 ? 255 : i / 4 % WIDTH * 8);
}

static struct hgp_frame frame_of(enum hgp_encoding encoding, const void *data, size_t size)
{
    return (struct hgp_frame){
        .width = WIDTH, .height = HEIGHT, .encoding = encoding, .data = {data, (uint32_t)size}};
}

static void test_raw(void **state)
{
    (void)state;
    uint8_t pixels[BYTES];
    struct hg_view_decoder d = {0};
    struct hg_view_pixels out = {0};
    struct hg_error err;
    paint(pixels);
    struct hgp_frame frame = frame_of(HGP_encoding_RAW_RGBA8, pixels, BYTES);
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_OK);
    assert_int_equal(out.width, WIDTH);
    assert_memory_equal(out.data, pixels, BYTES);
    frame.data.size--;
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    assert_int_equal(out.width, 0);
    hg_view_pixels_finish(&out);
    hg_view_decoder_finish(&d);
}

static void test_zstd(void **state)
{
    (void)state;
    uint8_t pixels[BYTES], packed[2 * BYTES];
    struct hg_view_decoder d = {0};
    struct hg_view_pixels out = {0};
    struct hg_error err;
    paint(pixels);
    const size_t size = ZSTD_compress(packed, sizeof packed, pixels, BYTES, 1);
    struct hgp_frame frame = frame_of(HGP_encoding_ZSTD_RGBA8, packed, size);
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_OK);
    assert_memory_equal(out.data, pixels, BYTES);
    frame.width *= 2; // more pixels than there are
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    frame.width /= 4; // fewer: what is too much is not written anywhere
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    for (uint32_t cut = 0; cut < size; cut++) {
        frame = frame_of(HGP_encoding_ZSTD_RGBA8, packed, cut);
        assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    }
    hg_view_pixels_finish(&out);
    hg_view_decoder_finish(&d);
}

static void test_jpeg(void **state)
{
    (void)state;
    uint8_t pixels[BYTES];
    unsigned char *file = NULL;
    unsigned long size = 0;
    struct hg_view_decoder d = {0};
    struct hg_view_pixels out = {0};
    struct hg_error err;
    paint(pixels);
    tjhandle jpeg = tjInitCompress();
    assert_int_equal(
        tjCompress2(jpeg, pixels, WIDTH, 0, HEIGHT, TJPF_RGBA, &file, &size, TJSAMP_444, 95, 0), 0);
    struct hgp_frame frame = frame_of(HGP_encoding_JPEG, file, size);
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_OK);
    for (int i = 0; i < BYTES; i++)
        assert_true(abs(out.data[i] - pixels[i]) <= 6);
    frame.height--; // the file is larger than the frame says: no room is written past
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    frame = frame_of(HGP_encoding_JPEG, "no JPEG", 7);
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    tjFree(file);
    tjDestroy(jpeg);
    hg_view_pixels_finish(&out);
    hg_view_decoder_finish(&d);
}

static void test_others(void **state)
{
    (void)state;
    struct hg_view_decoder d = {0};
    struct hg_view_pixels out = {0};
    struct hg_error err;
    const struct hgp_frame frame = frame_of(HGP_encoding_EXR_HALF, "", 0);
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_UNSUPPORTED);
    hg_view_pixels_finish(&out);
    hg_view_decoder_finish(&d);
}

// What statistics say of the server's controller.
static void test_flow_is_read(void **state)
{
    (void)state;
    static const char text[] =
        "{\"frame\":{},\"flow\":{\"target_fps\":30.0,\"target_ms\":28.5,\"rate_mbit_s\":4.5,"
        "\"rtt_ms\":20.25,\"delay_ms\":61.0,\"quality\":71,\"bitrate\":4200000,\"under_way\":2,"
        "\"bytes_under_way\":5000000000,\"held\":7}} behind";
    struct hg_view_flow flow;
    assert_true(hg_view_read_flow(text, sizeof text - 1 - strlen(" behind"), &flow));
    assert_true(flow.is_known && flow.target_fps == 30 && flow.target_ms == 28.5);
    assert_true(flow.rate_mbit_s == 4.5 && flow.rtt_ms == 20.25 && flow.delay_ms == 61);
    assert_int_equal(flow.quality, 71);
    assert_int_equal(flow.bitrate, 4200000);
    assert_int_equal(flow.under_way, 2);
    assert_true(flow.bytes_under_way == UINT64_C(5000000000));
    assert_int_equal(flow.held, 7);
    static const char *const others[] = {"{}", "{\"flow\":3}", "[", ""};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        assert_false(hg_view_read_flow(others[i], strlen(others[i]), &flow));
        assert_false(flow.is_known);
    }
}

// ---- depth, and the picture as another camera sees it ------------------------------------------

enum { COLUMNS = 6, ROWS = 4, CELLS = COLUMNS * ROWS, DEPTH_BYTES = 12 + 11 + 2 * CELLS };
static const struct hg_projection_rect window = {40, 30, 240, 160};

static void put_u16(uint8_t *to, unsigned v)
{
    to[0] = (uint8_t)v;
    to[1] = (uint8_t)(v >> 8);
}

// Cells q: 0 = nothing, else 1 / depth from 0 to 1 in 4094 steps. A zlib stream of one stored
// block.
static void pack_depth(const uint16_t q[CELLS], uint8_t out[DEPTH_BYTES])
{
    const float range[2] = {0, 1};
    uint8_t *planes = out + 19;
    uint32_t a = 1, b = 0;
    put_u16(out, COLUMNS);
    put_u16(out + 2, ROWS);
    memcpy(out + 4, range, sizeof range); // little-endian, as all that this runs on
    memcpy(out + 12, (const uint8_t[]){0x78, 0x01, 0x01}, 3);
    put_u16(out + 15, 2 * CELLS);
    put_u16(out + 17, ~(2u * CELLS));
    for (int i = 0; i < CELLS; i++) {
        const int left = i % COLUMNS ? q[i - 1] : 0, above = i >= COLUMNS ? q[i - COLUMNS] : 0;
        const int between = i % COLUMNS && i >= COLUMNS ? q[i - COLUMNS - 1] : 0;
        const int16_t rest = (int16_t)(q[i] - (left + above - between));
        const uint16_t folded = (uint16_t)(rest < 0 ? -2 * rest - 1 : 2 * rest);
        planes[i] = (uint8_t)folded;
        planes[CELLS + i] = (uint8_t)(folded >> 8);
    }
    for (int i = 0; i < 2 * CELLS; i++) {
        a = (a + planes[i]) % 65521;
        b = (b + a) % 65521;
    }
    for (int i = 0; i < 4; i++)
        out[DEPTH_BYTES - 4 + i] = (uint8_t)((b << 16 | a) >> (24 - 8 * i));
}

// Of a camera at (1, 2, 5) that looks along -z.
static struct hgp_frame depth_frame(const uint8_t data[DEPTH_BYTES], uint64_t seq)
{
    struct hgp_frame frame = frame_of(HGP_encoding_RAW_RGBA8, NULL, 0);
    frame.input_seq = seq;
    frame.has_depth = frame.has_eye = frame.has_forward = frame.has_up = frame.has_kind = true;
    frame.depth = (struct hgp_bytes){data, DEPTH_BYTES};
    memcpy(frame.eye, (const float[]){1, 2, 5}, sizeof frame.eye);
    memcpy(frame.forward, (const float[]){0, 0, -1}, sizeof frame.forward);
    memcpy(frame.up, (const float[]){0, 1, 0}, sizeof frame.up);
    frame.kind = HGP_camera_kind_PERSPECTIVE;
    frame.has_vfov_rad = true;
    frame.vfov_rad = 0.9f;
    return frame;
}

static void take(struct hg_warp_depth *depth, const uint16_t q[CELLS])
{
    uint8_t data[DEPTH_BYTES];
    struct hg_error err;
    pack_depth(q, data);
    const struct hgp_frame frame = depth_frame(data, 7);
    assert_int_equal(hg_warp_take(depth, &frame, &err), HG_OK);
    assert_true(depth->is_known);
}

static void test_depth(void **state)
{
    (void)state;
    uint16_t q[CELLS];
    uint8_t data[DEPTH_BYTES];
    struct hg_warp_depth depth = {0}, copy = {0};
    struct hg_error err;
    for (int i = 0; i < CELLS; i++)
        q[i] = (uint16_t)(i % 5 == 3 ? 0 : 1 + 4094 * ((i * 7) % CELLS) / CELLS);
    take(&depth, q);
    for (int i = 0; i < CELLS; i++)
        assert_float_equal(depth.values[i], q[i] ? (q[i] - 1) / 4094.0 : 0, 1e-6);
    struct hgp_frame frame = depth_frame(data, 7);
    frame.has_depth = false; // one more of the state
    assert_int_equal(hg_warp_take(&depth, &frame, &err), HG_OK);
    assert_true(depth.is_known);
    assert_int_equal(hg_warp_copy(&depth, &copy, &err), HG_OK);
    assert_memory_equal(copy.values, depth.values, CELLS * sizeof *depth.values);
    frame.input_seq = 8; // of another, without
    assert_int_equal(hg_warp_take(&depth, &frame, &err), HG_OK);
    assert_false(depth.is_known);
    assert_true(copy.is_known);
    pack_depth(q, data);
    for (uint32_t size = 0; size < DEPTH_BYTES; size++) {
        frame = depth_frame(data, 9);
        frame.depth.size = size;
        assert_int_equal(hg_warp_take(&depth, &frame, &err), HG_E_FORMAT);
        assert_false(depth.is_known);
    }
    frame = depth_frame(data, 9);
    frame.width = COLUMNS - 1; // of fewer pixels than cells
    assert_int_equal(hg_warp_take(&depth, &frame, &err), HG_E_FORMAT);
    hg_warp_depth_finish(&depth);
    hg_warp_depth_finish(&copy);
}

static const struct hgp_view_camera straight = {.has_eye = true,
    .has_target = true,
    .has_vfov_rad = true,
    .eye = {1, 2, 5},
    .target = {1, 2, 0},
    .vfov_rad = 0.9f};

// Where `camera` sees what lies 4 m deep at a place of the picture, px of the window.
static void expected_place(
    const struct hgp_view_camera *camera, const struct hg_warp_vertex *v, double at[3])
{
    struct hg_projection_view from, to;
    double point[3];
    assert_true(hg_projection_look(&from, &straight, &window));
    assert_true(hg_projection_look(&to, camera, &window));
    for (int i = 0; i < 3; i++)
        point[i] = from.eye[i] +
                   4 * (from.forward[i] + from.tangent * ((2 * v->u - 1) * 1.5 * from.right[i] +
                                                             (1 - 2 * v->v) * from.up[i]));
    assert_true(hg_projection_point(&to, point, at));
}

static void test_warp_of_a_wall(void **state)
{
    (void)state;
    uint16_t q[CELLS];
    struct hg_warp_depth depth = {0};
    struct hg_warp_mesh mesh = {0};
    struct hgp_view_camera cameras[3] = {straight, straight, straight};
    cameras[1].target[0] = 2; // turned
    cameras[2].eye[0] = 1.5f; // moved aside and ahead, with another lens
    cameras[2].eye[2] = 4;
    cameras[2].vfov_rad = 1.1f;
    for (int i = 0; i < CELLS; i++)
        q[i] = 1 + 4094 / 4;
    take(&depth, q);
    for (int i = 0; i < 3; i++) {
        assert_true(hg_warp_build(&mesh, &depth, &cameras[i], &window));
        assert_int_equal(mesh.quad_count, (COLUMNS + 1) * (ROWS + 1));
        uint32_t inside = 0;
        for (uint32_t n = 0; n < 4 * mesh.quad_count; n++) {
            const struct hg_warp_vertex *v = &mesh.vertices[n];
            double at[3];
            if (!(v->u > 0 && v->u < 1 && v->v > 0 && v->v < 1))
                continue; // of the ring
            inside++;
            expected_place(&cameras[i], v, at);
            assert_float_equal(v->x, at[0], 0.05);
            assert_float_equal(v->y, at[1], 0.05);
        }
        assert_int_equal(inside, 4 * CELLS); // each cell belongs to four quads
    }
    cameras[0].has_kind = true;
    cameras[0].kind = HGP_camera_kind_ORTHOGRAPHIC;
    assert_false(hg_warp_build(&mesh, &depth, &cameras[0], &window));
    hg_warp_depth_finish(&depth);
    hg_warp_mesh_finish(&mesh);
}

// What is near is drawn last; the gap that opens beside it has the colours from behind.
static void test_warp_of_a_step(void **state)
{
    (void)state;
    uint16_t q[CELLS];
    struct hg_warp_depth depth = {0};
    struct hg_warp_mesh mesh = {0};
    struct hgp_view_camera aside = straight;
    aside.eye[0] = aside.target[0] = -1; // to the left: what is near moves to the right
    for (int i = 0; i < CELLS; i++)
        q[i] = i % COLUMNS < 3 ? 1 + 4094 / 2 : 1; // left half 2 m deep, the other infinitely
    take(&depth, q);
    assert_true(hg_warp_build(&mesh, &depth, &aside, &window));
    assert_true(mesh.quad_count > 0);
    const struct hg_warp_vertex *last = mesh.vertices + mesh.indices[6 * mesh.quad_count - 1];
    assert_true(last->u < 0.5f);
    bool near = false;
    for (uint32_t i = 0; i < mesh.quad_count; i++) { // none that is far behind one that is near
        const struct hg_warp_vertex *v = mesh.vertices + 4 * i;
        const bool is_near = v[0].u < 0.5f && v[1].u < 0.5f && v[2].u < 0.5f && v[3].u < 0.5f;
        assert_true(is_near || !near);
        near |= is_near;
    }
    // Between the two columns of cells the near one has moved over the far one or away from it.
    aside.eye[0] = aside.target[0] = 3;
    assert_true(hg_warp_build(&mesh, &depth, &aside, &window));
    uint32_t filled = 0;
    for (uint32_t i = 0; i < mesh.quad_count; i++) {
        const struct hg_warp_vertex *v = mesh.vertices + 4 * i;
        filled += v[1].x - v[0].x > (float)window.width / 2 && v[0].u == v[1].u && v[0].u > 0.5f;
    }
    assert_int_equal(filled, ROWS - 1);
    hg_warp_depth_finish(&depth);
    hg_warp_mesh_finish(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_flow_is_read),
        cmocka_unit_test(test_raw), cmocka_unit_test(test_zstd), cmocka_unit_test(test_jpeg),
        cmocka_unit_test(test_others), cmocka_unit_test(test_depth),
        cmocka_unit_test(test_warp_of_a_wall), cmocka_unit_test(test_warp_of_a_step)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
