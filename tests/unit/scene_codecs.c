// scene_codecs.c - what loaders decode, against values that the test packs by the letter of the
// extensions: the filters of EXT_meshopt_compression, the textures of specular-glossiness
// materials. And which image files a glTF may name, itself or through extensions.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <meshoptimizer.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"
#include "renderer/image/image.h"
#include "scene_corpus.h"
#include "scene_memory.h"
#include "tests/support/folder.h"

static struct memory_gltf file;

static void begin(void)
{
    memset(&file, 0, sizeof file);
}

// 0..1, the same on every run.
static double fraction(uint32_t i)
{
    return fmod(0.5 + i * 0.6180339887498949, 1);
}

// ---- filters of EXT_meshopt_compression ---------------------------------------------------------

enum { COUNT = 200 };

static uint32_t add_filtered(const void *raw, uint32_t stride, const char *filter)
{
    static uint8_t packed[8192];
    static const uint8_t fallback[COUNT * 16];
    size_t size = meshopt_encodeVertexBuffer(packed, sizeof packed, raw, COUNT, stride);
    assert_true(size > 0);
    if (!file.size)
        memory_bytes(&file, fallback, sizeof fallback); // what the plain views point to
    size_t at = memory_bytes(&file, packed, size);
    memory_append(file.views, sizeof file.views,
        "%s{\"buffer\":0,\"byteLength\":%u,\"byteStride\":%u,\"extensions\":"
        "{\"EXT_meshopt_compression\":{\"buffer\":0,\"byteOffset\":%zu,\"byteLength\":%zu,"
        "\"byteStride\":%u,\"count\":%d,\"mode\":\"ATTRIBUTES\",\"filter\":\"%s\"}}}",
        file.view_count ? "," : "", COUNT * stride, stride, at, size, stride, COUNT, filter);
    return file.view_count++;
}

#define EXTENSIONS                                                                                 \
    "\"extensionsUsed\":[\"EXT_meshopt_compression\",\"KHR_mesh_quantization\"],"                  \
    "\"extensionsRequired\":[\"EXT_meshopt_compression\",\"KHR_mesh_quantization\"],"

static void random_direction(uint32_t i, double out[3])
{
    double z = 2 * fraction(i) - 1, phi = 2 * M_PI * fraction(7 * i + 3), r = sqrt(1 - z * z);
    out[0] = r * cos(phi);
    out[1] = r * sin(phi);
    out[2] = z;
}

// Onto the octahedron |x| + |y| + |z| = 1; the lower half is folded outwards. `one` is its scale.
static void pack_octahedral(const double n[3], int one, int out[2])
{
    double l = fabs(n[0]) + fabs(n[1]) + fabs(n[2]), x = n[0] / l, y = n[1] / l;
    double u = n[2] >= 0 ? x : (1 - fabs(y)) * (x >= 0 ? 1 : -1);
    double v = n[2] >= 0 ? y : (1 - fabs(x)) * (y >= 0 ? 1 : -1);
    out[0] = (int)lround(u * one);
    out[1] = (int)lround(v * one);
}

static void check_octahedral(bool wide)
{
    int8_t narrow_raw[COUNT][4];
    int16_t wide_raw[COUNT][4];
    const int one = wide ? 2047 : 127; // 12 bits and 8 bits
    begin();
    for (uint32_t i = 0; i < COUNT; i++) {
        double n[3];
        int p[2];
        random_direction(i, n);
        pack_octahedral(n, one, p);
        const int raw[4] = {p[0], p[1], one, 0};
        for (int c = 0; c < 4; c++) {
            narrow_raw[i][c] = (int8_t)raw[c];
            wide_raw[i][c] = (int16_t)raw[c];
        }
    }
    static float points[COUNT * 3];
    uint32_t view =
        wide ? add_filtered(wide_raw, 8, "OCTAHEDRAL") : add_filtered(narrow_raw, 4, "OCTAHEDRAL");
    memory_accessor(&file, (int)view, wide ? SHORT : BYTE, "VEC3", COUNT, ",\"normalized\":true");
    memory_floats(&file, "VEC3", COUNT, points, sizeof points);
    struct hg_asset *asset =
        memory_load_ok(&file, EXTENSIONS "\"meshes\":[{\"primitives\":[{\"mode\":0,"
                                         "\"attributes\":{\"POSITION\":1,\"NORMAL\":0}}]}]");
    const float *normals = asset->meshes[0]->parts[0].normals;
    assert_non_null(normals);
    double worst = 0;
    for (uint32_t i = 0; i < COUNT; i++) {
        double n[3], dot = 0;
        random_direction(i, n);
        for (int c = 0; c < 3; c++)
            dot += n[c] * (double)normals[i * 3 + (uint32_t)c];
        worst = fmax(worst, acos(fmin(dot, 1)));
    }
    print_message("octahedral, %d bits: worst angle %.5f\n", wide ? 12 : 8, worst);
    assert_true(worst < 3.0 / one); // half a step going in and coming out, stretched
    hg_asset_destroy(asset);
}

static void test_octahedral(void **state)
{
    (void)state;
    check_octahedral(false);
    check_octahedral(true);
}

// The largest component is left out; the others follow it in order, times sqrt(2). The fourth
// number says which one it was (two lowest bits) and, those bits set, the scale.
static void pack_quaternion(const double q[4], int16_t out[4])
{
    const int one = 8191; // 14 bits
    int largest = 0;
    for (int i = 1; i < 4; i++)
        largest = fabs(q[i]) > fabs(q[largest]) ? i : largest;
    double sign = q[largest] < 0 ? -1 : 1;
    for (int i = 0; i < 3; i++)
        out[i] = (int16_t)lround(q[(largest + 1 + i) % 4] * sign * sqrt(2) * one);
    out[3] = (int16_t)((one & ~3) | largest);
}

static void random_rotation(uint32_t i, double q[4])
{
    double l = 0;
    for (uint32_t c = 0; c < 4; c++) {
        q[c] = 2 * fraction(11 * i + 5 * c * c + c) - 1;
        l += q[c] * q[c];
    }
    for (int c = 0; c < 4; c++)
        q[c] /= sqrt(l);
}

static void test_quaternions(void **state)
{
    (void)state;
    int16_t raw[COUNT][4];
    float seconds[COUNT];
    begin();
    for (uint32_t i = 0; i < COUNT; i++) {
        double q[4];
        random_rotation(i, q);
        pack_quaternion(q, raw[i]);
        seconds[i] = (float)i;
    }
    uint32_t view = add_filtered(raw, 8, "QUATERNION");
    memory_accessor(&file, (int)view, SHORT, "VEC4", COUNT, ",\"normalized\":true");
    memory_floats(&file, "SCALAR", COUNT, seconds, sizeof seconds);
    struct hg_asset *asset = memory_load_ok(&file, EXTENSIONS
        "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{}],"
        "\"animations\":[{\"samplers\":[{\"input\":1,\"output\":0}],"
        "\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"rotation\"}}]}]");
    double worst = 0;
    for (uint32_t i = 0; i < COUNT; i++) {
        double q[4], dot = 0;
        random_rotation(i, q);
        assert_int_equal(hg_asset_pose(asset, 0, i), HG_OK);
        for (int c = 0; c < 4; c++)
            dot += q[c] * (double)asset->nodes[0]->rotation[c];
        worst = fmax(worst, 2 * acos(fmin(fabs(dot), 1))); // q and -q turn alike
    }
    print_message("quaternions, 14 bits: worst angle %.6f\n", worst);
    assert_true(worst < 6.0 / 8191);
    hg_asset_destroy(asset);
}

// A signed 24-bit mantissa times a power of two: exact.
static void test_exponential(void **state)
{
    (void)state;
    int32_t raw[COUNT][3];
    float want[COUNT][3];
    begin();
    for (uint32_t i = 0; i < COUNT; i++)
        for (uint32_t c = 0; c < 3; c++) {
            int32_t mantissa = (int32_t)((fraction(13 * i + c) - 0.5) * 16777215);
            int exponent = (int)((7 * i + 5 * c) % 60) - 40;
            raw[i][c] = (int32_t)((uint32_t)exponent << 24 | ((uint32_t)mantissa & 0xffffff));
            want[i][c] = (float)ldexp(mantissa, exponent);
        }
    uint32_t view = add_filtered(raw, 12, "EXPONENTIAL");
    memory_accessor(&file, (int)view, FLOAT, "VEC3", COUNT, "");
    struct hg_asset *asset = memory_load_ok(&file,
        EXTENSIONS "\"meshes\":[{\"primitives\":[{\"mode\":0,\"attributes\":{\"POSITION\":0}}]}]");
    assert_memory_equal(asset->meshes[0]->parts[0].positions, want, sizeof want);
    hg_asset_destroy(asset);
}

static void test_filters_that_do_not_fit(void **state)
{
    (void)state;
    static const struct {
        uint32_t stride;
        const char *filter;
    } cases[] = {{12, "OCTAHEDRAL"}, {4, "QUATERNION"}, {8, "ZIGZAG"}};
    static const uint8_t raw[COUNT * 12];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct hg_asset *asset;
        struct hg_error err;
        begin();
        uint32_t view = add_filtered(raw, cases[i].stride, cases[i].filter);
        memory_accessor(&file, (int)view, FLOAT, "SCALAR", COUNT, "");
        assert_int_equal(
            memory_load(&file,
                EXTENSIONS "\"meshes\":[{\"primitives\":[{\"mode\":0,\"attributes\":{\"_X\":0,"
                           "\"POSITION\":0}}]}]",
                &asset, &err),
            HG_E_FORMAT);
        assert_non_null(strstr(err.where, "EXT_meshopt_compression"));
    }
}

// ---- KHR_materials_pbrSpecularGlossiness --------------------------------------------------------

static double to_linear(uint8_t v)
{
    double s = v / 255.0;
    return s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
}

static uint8_t to_srgb(double v)
{
    double s = v <= 0.0031308 ? v * 12.92 : 1.055 * pow(v, 1 / 2.4) - 0.055;
    return (uint8_t)lround(fmin(fmax(s, 0), 1) * 255);
}

static uint32_t add_png(const uint8_t *rgba, uint32_t side)
{
    struct hg_image image;
    struct hg_error err = {0};
    struct hg_writer out = {0};
    const struct hg_image_encode params = {.file = HG_IMAGE_PNG8};
    assert_int_equal(hg_image_create(side, side, HG_PIXEL_RGBA8, NULL, &image), HG_OK);
    memcpy(image.pixels, rgba, image.size_bytes);
    image.has_alpha = true;
    assert_int_equal(hg_image_encode(&image, &params, &out, &err), HG_OK);
    uint32_t view = memory_view(&file, out.data, out.size, 0);
    hg_writer_finish(&out);
    hg_image_finish(&image);
    return view;
}

enum { SIDE = 8 };

// Greys of metallic-roughness, written as specular-glossiness: with (1) and (2) of spec_gloss.h.
// Column: metalness 0..1; row: base colour; glossiness by 2 x 2 blocks.
static double metal_of(uint32_t i)
{
    return (i % SIDE) / (SIDE - 1.0);
}

static double base_of(uint32_t i)
{
    return 0.2 + 0.7 * (i / SIDE) / (SIDE - 1.0);
}

static uint8_t gloss_of(uint32_t i)
{
    return (uint8_t)(20 + 15 * (i % SIDE / 2) + 45 * (i / SIDE / 2));
}

static void test_spec_gloss_textures(void **state)
{
    (void)state;
    uint8_t diffuse[SIDE * SIDE][4], specular[SIDE * SIDE][4];
    begin();
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        double m = metal_of(i), c = base_of(i), s = 0.04 * (1 - m) + c * m;
        double d = s < 1 ? c * 0.96 * (1 - m) / (1 - s) : 0;
        for (int a = 0; a < 3; a++) {
            diffuse[i][a] = to_srgb(d / 0.9); // diffuseFactor
            specular[i][a] = to_srgb(s);
        }
        diffuse[i][3] = (uint8_t)(255 - 3 * i);
        specular[i][3] = gloss_of(i);
    }
    uint32_t views[2] = {add_png(&diffuse[0][0], SIDE), add_png(&specular[0][0], SIDE)};
    char rest[1024];
    snprintf(rest, sizeof rest,
        "\"extensionsUsed\":[\"KHR_materials_pbrSpecularGlossiness\"],"
        "\"images\":[{\"bufferView\":%u,\"mimeType\":\"image/png\"},"
        "{\"bufferView\":%u,\"mimeType\":\"image/png\"}],\"samplers\":[{\"wrapS\":33071}],"
        "\"textures\":[{\"source\":0,\"sampler\":0},{\"source\":1,\"sampler\":0}],"
        "\"materials\":[{\"extensions\":{\"KHR_materials_pbrSpecularGlossiness\":"
        "{\"diffuseTexture\":{\"index\":0},\"diffuseFactor\":[0.9,0.9,0.9,0.5],"
        "\"specularGlossinessTexture\":{\"index\":1},\"glossinessFactor\":0.8}}}]",
        views[0], views[1]);
    struct hg_asset *asset = memory_load_ok(&file, rest);
    const struct hg_material *m = asset->materials[0];
    const struct hg_texture *base = m->slots[HG_SLOT_BASE_COLOR].texture;
    const struct hg_texture *rough = m->slots[HG_SLOT_METALLIC_ROUGHNESS].texture;
    assert_true(base && rough && base->image && rough->image);
    assert_int_equal(base->wrap_s, HG_WRAP_CLAMP);
    assert_true(base->image->pixels_srgb && !rough->image->pixels_srgb);
    assert_int_equal(base->image->pixels.width, SIDE);
    assert_float_equal(m->metallic, 1, 0);
    assert_float_equal(m->roughness, 1, 0);
    const uint8_t *b = base->image->pixels.pixels, *r = rough->image->pixels.pixels;
    double worst_metal = 0, worst_base = 0;
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        double metal = r[i * 4 + 2] / 255.0, color = to_linear(b[i * 4]);
        worst_metal = fmax(worst_metal, fabs(metal - metal_of(i)));
        worst_base = fmax(worst_base, fabs(color - base_of(i)));
        assert_int_equal(b[i * 4 + 3], lround((255 - 3 * (int)i) * 0.5));
        assert_int_equal(r[i * 4 + 1], lround(255 * (1 - gloss_of(i) / 255.0 * 0.8)));
    }
    print_message("specular-glossiness: metalness off by %.4f, base colour by %.4f at most\n",
        worst_metal, worst_base);
    assert_true(worst_metal < 0.02 && worst_base < 0.03);
    hg_asset_destroy(asset);
}

// ---- image files --------------------------------------------------------------------------------

static void write_png(const char *path)
{
    static const uint8_t grey[4] = {128, 128, 128, 255};
    begin();
    add_png(grey, 1);
    test_file_write(path, file.bytes, file.size);
}

// Whether the image was taken: HG_OK with *read false is a warning and white.
static enum hg_status load_with_image(const char *path, const char *uri, bool *read)
{
    char json[1024];
    snprintf(json, sizeof json,
        "{\"asset\":{\"version\":\"2.0\"},\"images\":[{\"uri\":\"%s\"}],"
        "\"textures\":[{\"source\":0}],\"materials\":[{\"pbrMetallicRoughness\":"
        "{\"baseColorTexture\":{\"index\":0}}}]}",
        uri);
    test_file_write(path, json, strlen(json));
    struct hg_asset *asset;
    struct hg_error err;
    enum hg_status status = corpus_load(path, &asset, &err);
    *read = !status && asset->textures[0]->image != NULL;
    if (!status)
        assert_true(*read || asset->warning_count > 0);
    else
        assert_true(asset == NULL && err.reason[0]);
    hg_asset_destroy(asset);
    return status;
}

static void test_image_paths(void **state)
{
    (void)state;
    char root[TEST_FOLDER_MAX], path[256], gltf[256];
    bool read;
    assert_true(test_folder_make(root, "codecs"));
#define AT(name) (snprintf(path, sizeof path, "%s/%s", root, name), path)
    assert_int_equal(mkdir(AT("asset"), 0700), 0);
    assert_int_equal(mkdir(AT("asset/C:"), 0700), 0);
    write_png(AT("asset/in side.png"));
    write_png(AT("asset/C:/x.png"));
    write_png(AT("outside.png"));
    assert_int_equal(symlink("in side.png", AT("asset/good.png")), 0);
    assert_int_equal(symlink("../outside.png", AT("asset/bad.png")), 0);
    assert_int_equal(symlink("..", AT("asset/up")), 0);
    snprintf(gltf, sizeof gltf, "%s/asset/a.gltf", root);
    static const struct {
        const char *uri;
        enum hg_status status;
        bool read;
    } cases[] = {{"in%20side.png", HG_OK, true}, {"good.png", HG_OK, true},
        {"../asset/good.png", HG_OK, true}, {"missing.png", HG_OK, false},
        {"good.png%00.png", HG_OK, false}, {"%zz.png", HG_OK, false},
        {"..\\\\outside.png", HG_OK, false}, // one name, not a path
        {"../outside.png", HG_E_PERM, false}, {"%2e%2e/outside.png", HG_E_PERM, false},
        {"..%2foutside.png", HG_E_PERM, false}, {"bad.png", HG_E_PERM, false},
        {"up/outside.png", HG_E_PERM, false}, {"/etc/hostname", HG_E_UNSUPPORTED, false},
        {"C:/x.png", HG_E_UNSUPPORTED, false}, {"c:\\\\x.png", HG_E_UNSUPPORTED, false},
        {"file:///etc/hostname", HG_E_UNSUPPORTED, false},
        {"file:/etc/hostname", HG_E_UNSUPPORTED, false},
        {"https://example.org/x.png", HG_E_UNSUPPORTED, false}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        enum hg_status status = load_with_image(gltf, cases[i].uri, &read);
        if (status != cases[i].status || read != cases[i].read)
            fail_msg(
                "%s: %s, %s", cases[i].uri, hg_status_name(status), read ? "read" : "not read");
    }
    snprintf(path, sizeof path, "%s/asset/in side.png", root); // absolute, though inside
    assert_int_equal(load_with_image(gltf, path, &read), HG_E_UNSUPPORTED);
    assert_true(test_folder_remove(root));
}

// Adds a file of 37 x 23 texels of UASTC under Zstandard, or what `size` keeps of it.
static uint32_t add_ktx2(size_t size)
{
    char path[512];
    uint8_t *data;
    size_t whole;
    struct hg_error err = {0};
    snprintf(path, sizeof path, "%s/tests/unit/ktx2/uastc_zstd.ktx2", getenv("HELIO_SOURCE_DIR"));
    test_ok(hg_file_read(path, 1 << 16, &data, &whole, &err), &err);
    const uint32_t view = memory_view(&file, data, size < whole ? size : whole, 0);
    hg_free(data);
    return view;
}

// A texture whose extension names an image: 0 is a PNG, 1 a KTX2, 2 a damaged KTX2.
static enum hg_status load_extended(
    const char *extension, bool required, const char *texture, struct hg_asset **asset)
{
    static const uint8_t grey[4] = {128, 128, 128, 255};
    char rest[1024];
    struct hg_error err;
    begin();
    const uint32_t png = add_png(grey, 1), ktx2 = add_ktx2(SIZE_MAX), damaged = add_ktx2(90);
    snprintf(rest, sizeof rest,
        "\"extensionsUsed\":[\"%s\"],%s%s%s"
        "\"images\":[{\"bufferView\":%u,\"mimeType\":\"image/png\"},"
        "{\"bufferView\":%u,\"mimeType\":\"image/ktx2\"},"
        "{\"bufferView\":%u,\"mimeType\":\"image/ktx2\"}],\"textures\":[{%s}]",
        extension, required ? "\"extensionsRequired\":[\"" : "", required ? extension : "",
        required ? "\"]," : "", png, ktx2, damaged, texture);
    const enum hg_status status = memory_load(&file, rest, asset, &err);
    assert_true((status == HG_OK) == (*asset != NULL));
    return status;
}

static void check_width(const struct hg_image_source *image, uint32_t width)
{
    struct hg_image pixels;
    struct hg_error err = {0};
    test_ok(hg_image_read_memory(
                &(struct hg_image_bytes){image->encoded->data, image->encoded->size, image->label},
                HG_PIXEL_RGBA8, NULL, &pixels, &err),
        &err);
    assert_int_equal(pixels.width, width);
    hg_image_finish(&pixels);
}

static void test_texture_extensions(void **state)
{
    (void)state;
#define SOURCE(extension, n) "\"extensions\":{\"" extension "\":{\"source\":" n "}}"
#define BASISU(n)            SOURCE("KHR_texture_basisu", n)
#define WEBP(n)              SOURCE("EXT_texture_webp", n)
    static const struct {
        const char *texture;
        bool required;
        uint32_t width; // of what is shown; 0: white
        enum hg_status status;
    } cases[] = {
        {BASISU("1") ",\"source\":0", false, 37, HG_OK},
        {BASISU("1") ",\"source\":0", true, 37, HG_OK},
        {BASISU("1"), false, 37, HG_OK},
        {BASISU("1"), true, 37, HG_OK},
        {BASISU("2") ",\"source\":0", false, 1, HG_OK}, // damaged
        {BASISU("2"), true, 0, HG_OK},
        {"\"extensions\":{\"KHR_texture_basisu\":{}},\"source\":0", false, 1, HG_OK},
        {WEBP("1") ",\"source\":0", true, 37, HG_OK},
        {WEBP("2") ",\"source\":0", true, 1, HG_OK},
        {BASISU("3") ",\"source\":0", false, 0, HG_E_FORMAT},
        {BASISU("-1") ",\"source\":0", true, 0, HG_E_FORMAT},
        {BASISU("\"1\""), true, 0, HG_E_FORMAT},
        {WEBP("3") ",\"source\":0", false, 0, HG_E_FORMAT},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct hg_asset *asset;
        const char *extension =
            strstr(cases[i].texture, "webp") ? "EXT_texture_webp" : "KHR_texture_basisu";
        const enum hg_status status =
            load_extended(extension, cases[i].required, cases[i].texture, &asset);
        if (status != cases[i].status)
            fail_msg("case %zu: %s", i, hg_status_name(status));
        if (status != HG_OK)
            continue;
        const struct hg_image_source *image = asset->textures[0]->image;
        assert_true((image != NULL) == (cases[i].width > 0));
        if (image != NULL)
            check_width(image, cases[i].width);
        assert_int_equal(asset->warning_count, 1); // images[2]
        assert_non_null(strstr(asset->warnings[0].reason, "IMAGE_UNRECOGNIZED_FORMAT"));
        hg_asset_destroy(asset);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_octahedral),
        cmocka_unit_test(test_quaternions), cmocka_unit_test(test_exponential),
        cmocka_unit_test(test_filters_that_do_not_fit), cmocka_unit_test(test_spec_gloss_textures),
        cmocka_unit_test(test_image_paths), cmocka_unit_test(test_texture_extensions)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
