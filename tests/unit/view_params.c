// The table of view parameters from one end to the other: command line and script, wire, renderer,
// key of a frame, attributes of its file.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/sha256.h"
#include "client/cli/render/render.h"
#include "client/cli/run/script.h"
#include "server/worker/view/view_params.h"

// Where the renderer has a parameter.
static const struct member {
    enum hgp_view_param_index param;
    size_t offset;
} members[] = {
#define HGP_VIEW_PARAM(kind, field, ...) {HGP_VIEW_##field, offsetof(struct hg_view_params, field)},
#include "protocol/view_params.def"
};

enum { MEMBERS = sizeof members / sizeof *members };

static void *member_of(struct hg_view_params *params, enum hgp_view_param_index param)
{
    for (size_t i = 0; i < MEMBERS; i++)
        if (members[i].param == param)
            return (char *)params + members[i].offset;
    fail_msg("%s is no parameter of the renderer", hgp_view_params[param].name);
    return NULL;
}

// ---- key ---------------------------------------------------------------------------------------

static uint8_t after[32];

static void key_of(const struct hg_view_params *params, char hex[HG_SHA256_HEX])
{
    struct hg_writer w = {0};
    uint8_t hash[32];
    hg_view_params_write_key(&w, params, after);
    assert_false(w.failed);
    assert_int_equal(hg_sha256(w.data, w.size, hash), HG_OK);
    hg_sha256_hex(hash, hex);
    hg_writer_finish(&w);
}

// Keys as they were written by hand, before there was a table.
static void test_keys_stored(void **state)
{
    (void)state;
    static const struct {
        struct hg_view_params params;
        const char *key;
    } rows[] = {
        {{0}, "d27414de69b93578440f28994b2a3669255035cd2d37ecdeef25b76b57246057"},
        {{.width = 640,
             .height = 360,
             .samples = 8,
             .seed = UINT32_MAX,
             .error_px = 2.5f,
             .exposure_ev = -1.25f},
            "b02189b7a2bbe12862befdfb694b125075cd86366447936db279218ed626a639"},
        {{.tonemap = HG_TONEMAP_PBR_NEUTRAL,
             .background = HG_BACKGROUND_COLOR,
             .background_color = {0.25f, 0.5f, 4},
             .debug_view = HG_DEBUG_LOD,
             .target_ms = 16,
             .time_limit_s = 2.5f},
            "d0b4e6f90a534d7b843d5f19e2bf62916b9cebd9d6e753bd861499993477dbc5"},
        {{.mode = HG_MODE_PATH,
             .trace = HG_VIEW_TRACE_COMPUTE,
             .max_bounces = 16,
             .noise = 0.01f,
             .filter = HG_FILTER_GAUSSIAN,
             .filter_radius_px = 2,
             .clamp_indirect = 10,
             .planes = 5},
            "0d23cea7355776fd8a3b3d510e24ab7353e2728118350c139bf1efd5ff232375"},
        {{.mode = HG_MODE_PATH,
             .denoise = HG_DENOISE_STILL,
             .frame_s = 0.04f,
             .shutter_open = -0.25f,
             .shutter_close = 0.25f,
             .series_s = 3},
            "229e57cb181519982349d63d4874697485031f91e165a21dcac5b241a60110f4"},
        {{.mode = HG_MODE_PATH,
             .denoise = HG_DENOISE_ANIMATION,
             .frame_s = 0.04f,
             .series_s = 0.08f,
             .seed = 7,
             .mattes = 3},
            "403c2693bd0c623438a4cb512020e75ac077e11e050319e14611732edbd701c3"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char key[HG_SHA256_HEX];
        key_of(&rows[i].params, key);
        assert_string_equal(key, rows[i].key);
    }
}

static void change(void *value, enum hgp_kind kind, size_t component)
{
    if (kind == HGP_K_U32 || kind == HGP_K_ENUM)
        ++*(uint32_t *)value;
    else
        ((float *)value)[component] += 0.25f;
}

// Whatever the table has in the key changes it, and nothing else does.
static void test_key_follows_table(void **state)
{
    (void)state;
    const struct hg_view_params base = {
        .mode = HG_MODE_PATH, .denoise = HG_DENOISE_ANIMATION, .shutter_close = 0.5f};
    char before[HG_SHA256_HEX], key[HG_SHA256_HEX];
    uint32_t in = 0, out = 0;
    key_of(&base, before);
    for (size_t i = 0; i < MEMBERS; i++) {
        const struct hgp_view_param *param = &hgp_view_params[members[i].param];
        for (size_t k = 0; k < (param->kind == HGP_K_VEC4      ? 4
                                   : param->kind == HGP_K_VEC3 ? 3
                                                               : 1);
             k++) {
            struct hg_view_params p = base;
            change((char *)&p + members[i].offset, param->kind, k);
            key_of(&p, key);
            if ((strcmp(key, before) != 0) != (param->key != HGP_VIEW_KEY_NONE))
                fail_msg("%s: in the key or not", param->name);
        }
        in += param->key != HGP_VIEW_KEY_NONE;
        out += param->key == HGP_VIEW_KEY_NONE;
    }
    assert_true(in >= 24 && out >= 1);
    struct hg_view_params left = base, low = base; // which words are 0 counts
    left.region[0] = low.region[1] = 8;
    char other[HG_SHA256_HEX];
    key_of(&left, key);
    key_of(&low, other);
    assert_string_not_equal(key, other);
    after[0]++;
    key_of(&base, key);
    assert_string_not_equal(key, before);
    after[0]--;
}

// ---- ranges and defaults -----------------------------------------------------------------------

static void put_number(void *value, enum hgp_kind kind, double number)
{
    if (kind == HGP_K_F32)
        *(float *)value = (float)number;
    else
        *(uint32_t *)value = (uint32_t)number;
}

static double get_number(const void *value, enum hgp_kind kind)
{
    return kind == HGP_K_F32 ? (double)*(const float *)value : (double)*(const uint32_t *)value;
}

// Where view_set holds a parameter: the view's number comes first, then the table in its order.
static const struct hgp_field *field_of(const struct hgp_view_param *param)
{
    return &hgp_layout_find(HGP_T_view_set)->fields[1 + (param - hgp_view_params)];
}

// A message with one parameter: what the codec says of it, and the renderer.
static void check_number(const struct member *m, double number, bool good)
{
    const struct hgp_view_param *param = &hgp_view_params[m->param];
    const struct hgp_field *field = field_of(param);
    struct hgp_view_set view = {.view = 1};
    struct hg_view_params p = {.mode = HG_MODE_PATH};
    struct hgp_fault fault;
    struct hg_error err = {0};
    struct hg_writer w = {0};
    *(bool *)((char *)&view + field->has_offset) = true;
    put_number((char *)&view + field->offset, param->kind, number);
    const enum hg_status wire =
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_view_set, 0, 0}, &view, &fault);
    hg_writer_finish(&w);
    p.shutter_open = m->param == HGP_VIEW_shutter_close ? (float)param->least : 0;
    p.shutter_close = m->param == HGP_VIEW_shutter_open ? (float)param->most : 0;
    put_number((char *)&p + m->offset, param->kind, number);
    const enum hg_status renderer = hg_view_params_check(&p, &err);
    if (wire != (good ? HG_OK : HG_E_INVAL) || renderer != wire)
        fail_msg(
            "%s = %g: %d on the wire, %d in the renderer", param->name, number, wire, renderer);
    if (!good) {
        assert_string_equal(fault.field, param->name);
        assert_string_equal(err.where, param->name);
    }
}

static void test_ranges(void **state)
{
    (void)state;
    uint32_t checked = 0;
    for (size_t i = 0; i < MEMBERS; i++) {
        const struct hgp_view_param *param = &hgp_view_params[members[i].param];
        // Planes have other bits in the renderer; vectors have no range on the wire.
        if (members[i].param == HGP_VIEW_planes || param->kind == HGP_K_VEC3 ||
            param->kind == HGP_K_VEC4)
            continue;
        check_number(&members[i], param->least, true);
        check_number(&members[i], param->most, true);
        if (param->most < UINT32_MAX)
            check_number(&members[i], param->most * 2 + 1, false);
        if (param->kind == HGP_K_F32)
            check_number(&members[i], param->least - 1, false);
        if (param->kind == HGP_K_F32)
            check_number(&members[i], NAN, false);
        checked++;
    }
    assert_true(checked >= 22);
}

static void test_defaults(void **state)
{
    (void)state;
    struct hg_view_params p = hg_view_params_filled(&(struct hg_view_params){0});
    for (size_t i = 0; i < MEMBERS; i++) {
        const struct hgp_view_param *param = &hgp_view_params[members[i].param];
        uint32_t value = 0;
        if (hgp_view_param_unset(param) || param->kind == HGP_K_VEC3 || param->kind == HGP_K_VEC4)
            continue;
        const double is = get_number((char *)&p + members[i].offset, param->kind);
        if (param->kind == HGP_K_ENUM) {
            assert_true(hgp_enum_value(param->values, param->standard, &value));
            assert_true(is == value);
        } else {
            assert_true(is == strtod(param->standard, NULL));
        }
    }
    assert_int_equal(p.width, 1280);
    assert_int_equal(p.max_bounces, 16);
    assert_true(p.frame_s == 1.0f / 24 && p.series_s == p.frame_s && p.filter_radius_px == 1.5f);
    assert_true(p.noise == 0 && p.clamp_indirect == 0 && p.mattes == 7);
    p = hg_view_params_filled(
        &(struct hg_view_params){.filter = HG_FILTER_BOX, .frame_s = 2, .width = 8});
    assert_true(p.filter_radius_px == 0.5f && p.series_s == 2 && p.width == 8);
}

// ---- from the command line to the file ---------------------------------------------------------

// A value that is not the default, as options and scripts have it.
static void sample(const struct hgp_view_param *param, char text[HGP_WORD_BYTES], double *number)
{
    *number = param->most;
    if (param->kind == HGP_K_F32)
        *number = (double)(float)(param->least + (param->most - param->least) * 0.625);
    if (param->kind == HGP_K_ENUM)
        hgp_enum_word(param->values, (uint32_t)*number, text);
    else
        snprintf(text, HGP_WORD_BYTES, "%.10g", *number);
}

// The parameters that a worker has of a message.
static struct hg_view_params receive(const struct hgp_view_set *view)
{
    struct hg_writer w = {0};
    struct hgp_view_set back;
    struct hg_view_params params = {0};
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_view_set, 0, 0}, view, NULL), HG_OK);
    assert_int_equal(hgp_decode(1, HGP_T_view_set,
                         hg_reader_make(w.data + HGP_HEADER_BYTES, w.size - HGP_HEADER_BYTES), NULL,
                         &back, NULL),
        HG_OK);
    hg_writer_finish(&w);
    hg_view_params_apply(&params, &back);
    return params;
}

static const struct hg_image_attribute *find_attribute(
    const struct hg_view_attributes *a, const char *name)
{
    for (uint32_t i = 0; i < a->count; i++)
        if (strcmp(a->items[i].name, name) == 0)
            return &a->items[i];
    return NULL;
}

// The file of a picture with these parameters says it, if files say it at all.
static void check_attribute(const struct hgp_view_param *param, const struct hg_view_params *params,
    const char *text, double number)
{
    static struct hg_view_attributes told;
    const char *name = hgp_view_param_attribute(param);
    if (!name)
        return;
    hg_view_params_attributes(params, &told);
    const struct hg_image_attribute *a = find_attribute(&told, name);
    assert_non_null(a);
    if (param - hgp_view_params == HGP_VIEW_exposure_ev)
        number = exp2(number);
    if (param->kind == HGP_K_ENUM)
        assert_string_equal(a->string, text);
    else if (a->type == HG_ATTR_FLOAT)
        assert_true(fabs((double)a->floats[0] - number) <= 1e-6 * fabs(number));
    else
        assert_true((a->type == HG_ATTR_COUNT ? a->count : (double)a->integer) == number);
}

static void check_received(
    const struct hgp_view_param *param, const struct hgp_view_set *view, const char *text, double n)
{
    struct hg_view_params p = receive(view);
    const double is = get_number(
        member_of(&p, (enum hgp_view_param_index)(param - hgp_view_params)), param->kind);
    if (is != n)
        fail_msg("%s: %s came as %.9g", param->name, text, is);
    p.mode = HG_MODE_PATH;
    check_attribute(param, &p, text, n);
}

static void test_options(void **state)
{
    (void)state;
    uint32_t checked = 0;
    for (uint32_t i = 0; i < hg_cli_option_count; i++) {
        const struct hgp_view_param *param = hg_cli_option_rows[i].param;
        char option[64], text[HGP_WORD_BYTES];
        double number;
        if (!param)
            continue;
        snprintf(option, sizeof option, "--%s", hg_cli_option_rows[i].name);
        sample(param, text, &number);
        const char *argv[] = {"helio", "render", "a.glb", "--mode", "path", option, text};
        struct hg_cli_options o;
        struct hg_error err = {0};
        if (hg_cli_parse(7, argv, &o, &err))
            fail_msg("%s %s: %s", option, text, err.reason);
        struct hg_cli_render r = {.o = &o, .size = {1, 1}, .format = {.quality = 90}};
        struct hgp_view_set view;
        hg_cli_render_view(&r, &view);
        check_received(param, &view, text, number);
        checked++;
    }
    assert_true(checked >= 14);
}

static void test_words(void **state)
{
    (void)state;
    uint32_t checked = 0;
    for (size_t i = 0; i < MEMBERS; i++) {
        const struct hgp_view_param *param = &hgp_view_params[members[i].param];
        const char *word = hgp_view_param_word(param);
        char line[128], text[HGP_WORD_BYTES];
        struct hg_cli_script script;
        struct hg_error err = {0};
        double number;
        if (!word || hgp_view_param_find_word(word) != param)
            continue;
        sample(param, text, &number);
        snprintf(line, sizeof line, "set %s %s", word, text);
        if (hg_cli_script_parse("test", line, &(struct hg_cli_script_source){0}, &script, &err))
            fail_msg("%s: %s", line, err.reason);
        script.steps[0].view.view = 1;
        check_received(param, &script.steps[0].view, text, number);
        hg_cli_script_finish(&script);
        checked++;
    }
    assert_true(checked >= 15);
}

// Nothing can be set that no option and no word sets; what is told of files exists.
static void test_reached(void **state)
{
    (void)state;
    for (size_t i = 0; i < MEMBERS; i++) {
        const struct hgp_view_param *param = &hgp_view_params[members[i].param];
        const char *name = hgp_view_param_option(param);
        bool found = false;
        for (uint32_t k = 0; name && k < hg_cli_option_count; k++)
            found |= strcmp(hg_cli_option_rows[k].name, name) == 0;
        assert_true(found || (!name && hgp_view_param_word(param)));
        assert_string_equal(field_of(param)->name, param->name);
    }
}

// Where a picture does not have something its file does not say it.
static void test_untold(void **state)
{
    (void)state;
    static const struct hg_view_params still = {
        .clamp_indirect = 1, .denoise = HG_DENOISE_STILL, .max_bounces = 3};
    static const char *const names[] = {"heliograph:clampIndirect", "heliograph:denoise",
        "heliograph:maxBounces", "heliograph:filter", "heliograph:shutterOpen",
        "heliograph:frameTime"};
    static struct hg_view_attributes told;
    hg_view_params_attributes(&still, &told); // in real time
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        assert_null(find_attribute(&told, names[i]));
    assert_non_null(find_attribute(&told, "heliograph:seed"));
    hg_view_params_attributes(&(struct hg_view_params){.mode = HG_MODE_PATH}, &told);
    assert_null(find_attribute(&told, "heliograph:clampIndirect"));
    assert_int_equal(find_attribute(&told, "heliograph:maxBounces")->integer, 16);
    assert_string_equal(find_attribute(&told, "heliograph:filter")->string, "blackman-harris");
}

// Pictures are metered unless an exposure is asked for, files for compositing are not.
static void test_default_exposure(void **state)
{
    (void)state;
    static const struct {
        enum hgp_encoding encoding;
        const char *text; // NULL: no option
        enum hgp_exposure_mode mode;
        float ev;
        const char *camera; // one of its options; NULL: none
    } rows[] = {{HGP_encoding_PNG8, NULL, HGP_exposure_mode_AUTO, 0, NULL},
        {HGP_encoding_PNG8, NULL, HGP_exposure_mode_CAMERA, 0, "--iso=200"},
        {HGP_encoding_EXR_HALF, NULL, HGP_exposure_mode_CAMERA, 0, "--f-number=4"},
        {HGP_encoding_PNG8, "auto", HGP_exposure_mode_AUTO, 0, "--shutter-time=1"},
        {HGP_encoding_PNG8, "camera+2", HGP_exposure_mode_CAMERA, 2, NULL},
        {HGP_encoding_JPEG, NULL, HGP_exposure_mode_AUTO, 0, NULL},
        {HGP_encoding_EXR_HALF, NULL, HGP_exposure_mode_FIXED, 0, NULL},
        {HGP_encoding_EXR_FLOAT, NULL, HGP_exposure_mode_FIXED, 0, NULL},
        {HGP_encoding_EXR_HALF, "auto", HGP_exposure_mode_AUTO, 0, NULL},
        {HGP_encoding_PNG8, "-3", HGP_exposure_mode_FIXED, -3, NULL},
        {HGP_encoding_PNG8, "auto+1", HGP_exposure_mode_AUTO, 1, NULL}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct hg_cli_options o;
        const char *argv[8] = {"helio", "render", "s", "-o", "o"};
        int count = 5;
        if (rows[i].camera)
            argv[count++] = rows[i].camera;
        if (rows[i].text) {
            argv[count++] = "--exposure";
            argv[count++] = rows[i].text;
        }
        assert_int_equal(hg_cli_parse(count, argv, &o, NULL), HG_OK);
        const struct hg_cli_render r = {.o = &o, .size = {1, 1}, .format = {rows[i].encoding, 90}};
        struct hgp_view_set view;
        hg_cli_render_view(&r, &view);
        assert_true(view.has_exposure_mode && view.has_exposure_ev);
        assert_int_equal(view.exposure_mode, rows[i].mode);
        assert_true(view.exposure_ev == rows[i].ev);
    }
}

int main(void)
{
    for (size_t i = 0; i < sizeof after; i++)
        after[i] = (uint8_t)(i * 7 + 1);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_keys_stored),
        cmocka_unit_test(test_key_follows_table), cmocka_unit_test(test_ranges),
        cmocka_unit_test(test_defaults), cmocka_unit_test(test_default_exposure),
        cmocka_unit_test(test_options), cmocka_unit_test(test_words),
        cmocka_unit_test(test_reached), cmocka_unit_test(test_untold)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
