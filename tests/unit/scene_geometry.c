// What loaders make of accessors, primitives and the extensions that describe geometry: against
// the equations of glTF 2.0, and one encoding of a model against another.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <meshoptimizer.h>
#include <unistd.h>

#include "base/alloc.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/formats/gltf/spec_gloss.h"
#include "renderer/scene/xform.h"
#include "scene_corpus.h"
#include "scene_memory.h"
#include "tests/support/folder.h"

static struct memory_gltf file;

static void begin(void)
{
    memset(&file, 0, sizeof file);
}

static const struct hg_mesh_part *first_part(const struct hg_asset *asset)
{
    assert_true(asset->mesh_count > 0 && asset->meshes[0]->part_count > 0);
    return &asset->meshes[0]->parts[0];
}

// ---- accessors ---------------------------------------------------------------------------------

static const float triangle[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};

struct component_case {
    int type;
    bool normalized;
    uint32_t bytes;
    int32_t raw[6];
    double want[6];
};

// glTF 2.0, 3.11 (normalized integers): c / 255, c / 65535, max(c / 127, -1), max(c / 32767, -1).
static const struct component_case component_cases[] = {
    {BYTE, false, 1, {-128, -1, 0, 1, 64, 127}, {-128, -1, 0, 1, 64, 127}},
    {BYTE, true, 1, {-128, -127, -1, 0, 64, 127}, {-1, -1, -1 / 127.0, 0, 64 / 127.0, 1}},
    {UBYTE, false, 1, {0, 1, 2, 128, 254, 255}, {0, 1, 2, 128, 254, 255}},
    {UBYTE, true, 1, {0, 1, 51, 128, 204, 255}, {0, 1 / 255.0, 0.2, 128 / 255.0, 0.8, 1}},
    {SHORT, false, 2, {-32768, -1, 0, 1, 300, 32767}, {-32768, -1, 0, 1, 300, 32767}},
    {SHORT, true, 2, {-32768, -32767, -1, 0, 300, 32767},
        {-1, -1, -1 / 32767.0, 0, 300 / 32767.0, 1}},
    {USHORT, false, 2, {0, 1, 256, 4097, 65534, 65535}, {0, 1, 256, 4097, 65534, 65535}},
    {USHORT, true, 2, {0, 1, 13107, 256, 52428, 65535},
        {0, 1 / 65535.0, 0.2, 256 / 65535.0, 0.8, 1}},
    {FLOAT, false, 4, {-3, 0, 1, 7, 1024, 16777216}, {-3, 0, 1, 7, 1024, 16777216}}};

// Little-endian raw components; `stride` bytes between pairs, the gaps filled with 0xEE.
static size_t pack(const struct component_case *c, uint32_t stride, uint8_t *out)
{
    memset(out, 0xEE, 3 * (size_t)stride);
    for (uint32_t i = 0; i < 6; i++) {
        uint8_t *p = out + (i / 2) * stride + (i % 2) * c->bytes;
        float f = (float)c->raw[i];
        uint32_t u = (uint32_t)c->raw[i];
        if (c->type == FLOAT)
            memcpy(&u, &f, 4);
        for (uint32_t b = 0; b < c->bytes; b++)
            p[b] = (uint8_t)(u >> (8 * b));
    }
    return 2 * (size_t)stride + 2 * c->bytes;
}

static void check_components(const struct component_case *c, uint32_t stride, uint32_t skip)
{
    begin();
    memory_floats(&file, "VEC3", 3, triangle, sizeof triangle);
    uint8_t raw[128] = {0};
    size_t bytes = pack(c, stride, raw + skip);
    uint32_t view = memory_view(&file, raw, bytes + skip, stride);
    char more[64];
    snprintf(more, sizeof more, ",\"byteOffset\":%u%s", skip,
        c->normalized ? ",\"normalized\":true" : "");
    memory_accessor(&file, (int)view, c->type, "VEC2", 3, more);
    struct hg_asset *asset = memory_load_ok(&file,
        "\"extensionsUsed\":[\"KHR_mesh_quantization\"],\"extensionsRequired\":["
        "\"KHR_mesh_quantization\"],\"meshes\":[{\"primitives\":[{\"mode\":0,"
        "\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1}}]}]");
    const float *uv = first_part(asset)->uv[0];
    assert_non_null(uv);
    for (int i = 0; i < 6; i++)
        if (fabs((double)uv[i] - c->want[i]) > 1e-7 * fmax(1, fabs(c->want[i])))
            fail_msg("type %d%s, stride %u: %d became %.9g, expected %.9g", c->type,
                c->normalized ? " normalized" : "", stride, c->raw[i], (double)uv[i], c->want[i]);
    hg_asset_destroy(asset);
}

static void test_components(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof component_cases / sizeof *component_cases; i++)
        for (uint32_t stride = 8; stride <= 28; stride += 4)
            for (uint32_t skip = 0; skip <= 12; skip += 12)
                check_components(&component_cases[i], stride, skip);
}

static void test_indices(void **state)
{
    (void)state;
    static const uint8_t bytes[] = {2, 0, 1};
    static const uint16_t shorts[] = {2, 0, 1};
    static const uint32_t words[] = {2, 0, 1};
    const struct {
        int type;
        const void *data;
        size_t size;
    } cases[] = {{UBYTE, bytes, 3}, {USHORT, shorts, 6}, {UINT, words, 12}};
    for (int i = 0; i < 3; i++) {
        begin();
        memory_floats(&file, "VEC3", 3, triangle, sizeof triangle);
        memory_floats(&file, "VEC3", 3, (const float[]){0, 0, 1, 0, 0, 1, 0, 0, 1}, 36);
        uint32_t view = memory_view(&file, cases[i].data, cases[i].size, 0);
        memory_accessor(&file, (int)view, cases[i].type, "SCALAR", 3, "");
        struct hg_asset *asset =
            memory_load_ok(&file, "\"meshes\":[{\"primitives\":[{\"indices\":2,"
                                  "\"attributes\":{\"POSITION\":0,\"NORMAL\":1}}]}]");
        assert_int_equal(first_part(asset)->index_count, 3);
        assert_memory_equal(first_part(asset)->indices, words, sizeof words);
        hg_asset_destroy(asset);
    }
}

static void test_sparse(void **state)
{
    (void)state;
    static const uint8_t where[] = {0, 2};
    static const float values[] = {9, 8, 7, -1, -2, -3};
    for (int with_base = 0; with_base < 2; with_base++) {
        begin();
        uint32_t base = memory_view(&file, triangle, sizeof triangle, 0);
        uint32_t indices = memory_view(&file, where, sizeof where, 0);
        uint32_t deltas = memory_view(&file, values, sizeof values, 0);
        char more[256];
        snprintf(more, sizeof more,
            ",\"sparse\":{\"count\":2,\"indices\":{\"bufferView\":%u,\"componentType\":5121},"
            "\"values\":{\"bufferView\":%u}}",
            indices, deltas);
        memory_accessor(&file, with_base ? (int)base : -1, FLOAT, "VEC3", 3, more);
        struct hg_asset *asset = memory_load_ok(
            &file, "\"meshes\":[{\"primitives\":[{\"mode\":0,\"attributes\":{\"POSITION\":0}}]}]");
        const float *p = first_part(asset)->positions;
        const float want[] = {9, 8, 7, with_base ? 1.0f : 0.0f, 0, 0, -1, -2, -3};
        assert_memory_equal(p, want, sizeof want);
        hg_asset_destroy(asset);
    }
}

// ---- primitive modes ---------------------------------------------------------------------------

static void check_expand(
    enum hg_primitive_mode mode, uint32_t count, const uint32_t *want, uint32_t n)
{
    static const uint32_t in[] = {10, 11, 12, 13, 14, 15, 16};
    uint32_t out[32];
    assert_int_equal(hg_mode_list_count(mode, count), n);
    hg_mode_expand(mode, in, count, out);
    for (uint32_t i = 0; i < n; i++)
        assert_int_equal(out[i], want[i] + 10);
    hg_mode_expand(mode, NULL, count, out);
    for (uint32_t i = 0; i < n; i++)
        assert_int_equal(out[i], want[i]);
}

// glTF 2.0, 3.7.2.1.
static void test_modes(void **state)
{
    (void)state;
    check_expand(HG_MODE_POINTS, 3, (const uint32_t[]){0, 1, 2}, 3);
    check_expand(HG_MODE_LINES, 5, (const uint32_t[]){0, 1, 2, 3}, 4);
    check_expand(HG_MODE_LINE_STRIP, 4, (const uint32_t[]){0, 1, 1, 2, 2, 3}, 6);
    check_expand(HG_MODE_LINE_LOOP, 4, (const uint32_t[]){0, 1, 1, 2, 2, 3, 3, 0}, 8);
    check_expand(HG_MODE_TRIANGLES, 7, (const uint32_t[]){0, 1, 2, 3, 4, 5}, 6);
    check_expand(HG_MODE_TRIANGLE_STRIP, 5, (const uint32_t[]){0, 1, 2, 1, 3, 2, 2, 3, 4}, 9);
    check_expand(HG_MODE_TRIANGLE_FAN, 5, (const uint32_t[]){1, 2, 0, 2, 3, 0, 3, 4, 0}, 9);
    for (uint32_t count = 0; count < 3; count++) {
        assert_int_equal(hg_mode_list_count(HG_MODE_TRIANGLE_STRIP, count), 0);
        assert_int_equal(hg_mode_list_count(HG_MODE_TRIANGLE_FAN, count), 0);
    }
    for (uint32_t count = 0; count < 2; count++) {
        assert_int_equal(hg_mode_list_count(HG_MODE_LINE_STRIP, count), 0);
        assert_int_equal(hg_mode_list_count(HG_MODE_LINE_LOOP, count), 0);
    }
}

// ---- normals and tangents ----------------------------------------------------------------------

// Two triangles folded along x = 0 without normals.
static void test_flat_normals(void **state)
{
    (void)state;
    static const float roof[] = {0, 0, 1, 0, 1, 1, -1, 0, 0, 1, 0, 0};
    static const uint16_t faces[] = {0, 1, 2, 1, 0, 3};
    begin();
    memory_floats(&file, "VEC3", 4, roof, sizeof roof);
    uint32_t view = memory_view(&file, faces, sizeof faces, 0);
    memory_accessor(&file, (int)view, USHORT, "SCALAR", 6, "");
    struct hg_asset *asset = memory_load_ok(
        &file, "\"meshes\":[{\"primitives\":[{\"indices\":1,\"attributes\":{\"POSITION\":0}}]}]");
    const struct hg_mesh_part *part = first_part(asset);
    assert_int_equal(part->index_count, 6);
    const float r = sqrtf(0.5f);
    for (uint32_t i = 0; i < 6; i++) {
        const float *n = part->normals + (size_t)part->indices[i] * 3;
        assert_float_equal(n[0], i < 3 ? -r : r, 1e-6f);
        assert_float_equal(n[1], 0, 1e-6f);
        assert_float_equal(n[2], r, 1e-6f);
    }
    hg_asset_destroy(asset);
}

// ---- one model, two encodings ------------------------------------------------------------------

struct measure {
    uint64_t triangles;
    double area;
    float min[3], max[3];
};

static struct hg_asset *load_file(const char *relative)
{
    struct hg_asset *asset;
    struct hg_error err;
    const char *path = test_data(relative);
    if (access(path, R_OK) != 0)
        fail_msg("the test data has no %s", path);
    if (corpus_load(path, &asset, &err) != HG_OK)
        fail_msg("%s: %s at '%s'", relative, err.reason, err.where);
    return asset;
}

static void measure_node(const struct hg_node *node, struct measure *out)
{
    for (uint32_t i = 0; node->mesh && i < node->mesh->part_count; i++) {
        const struct hg_mesh_part *part = &node->mesh->parts[i];
        out->triangles += part->index_count / 3;
        for (uint32_t k = 0; k + 2 < part->index_count; k += 3) {
            float p[3][3], a[3], b[3], n[3];
            for (int c = 0; c < 3; c++)
                hg_mat4_point(node->world,
                    part->positions + (size_t)part->indices[k + (uint32_t)c] * 3, p[c]);
            for (int c = 0; c < 3; c++) {
                a[c] = p[1][c] - p[0][c];
                b[c] = p[2][c] - p[0][c];
            }
            hg_cross3(a, b, n);
            out->area += 0.5 * (double)sqrtf(hg_dot3(n, n));
        }
    }
}

static struct measure measure_file(const char *relative)
{
    struct hg_asset *asset = load_file(relative);
    struct measure out = {0};
    assert_true(hg_asset_bounds(asset, out.min, out.max));
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    hg_scene_update(scene);
    for (uint32_t i = 0; i < asset->node_count; i++)
        measure_node(asset->nodes[i], &out);
    hg_scene_destroy(scene);
    return out;
}

// `tolerance` is a share of the longest side for bounds, of the whole for the area.
static void compare_files(const char *raw, const char *coded, double tolerance)
{
    struct measure a = measure_file(raw), b = measure_file(coded);
    double side = 0;
    for (int i = 0; i < 3; i++)
        side = fmax(side, (double)(a.max[i] - a.min[i]));
    assert_true(a.triangles > 0 && a.area > 0 && side > 0);
    double worst = 0;
    for (int i = 0; i < 3; i++) {
        worst = fmax(worst, fabs((double)(a.min[i] - b.min[i])) / side);
        worst = fmax(worst, fabs((double)(a.max[i] - b.max[i])) / side);
    }
    double area = fabs(a.area - b.area) / a.area;
    printf("%s: %llu triangles, bounds differ by %.2g, area by %.2g\n", coded,
        (unsigned long long)a.triangles, worst, area);
    if (a.triangles != b.triangles || worst > tolerance || area > tolerance)
        fail_msg("%s: %llu triangles for %llu, bounds %g, area %g", coded,
            (unsigned long long)b.triangles, (unsigned long long)a.triangles, worst, area);
}

static void test_quantized(void **state)
{
    (void)state;
    compare_files("khronos/AnimatedMorphCube/glTF/AnimatedMorphCube.gltf",
        "khronos/AnimatedMorphCube/glTF-Quantized/AnimatedMorphCube.gltf", 1e-3);
    compare_files("khronos/Duck/glTF/Duck.gltf", "khronos/Duck/glTF-Quantized/Duck.gltf", 1e-3);
}

static void test_draco(void **state)
{
    (void)state;
    compare_files("khronos/Box/glTF/Box.gltf", "khronos/Box/glTF-Draco/Box.gltf", 1e-3);
    compare_files("khronos/Duck/glTF/Duck.gltf", "khronos/Duck/glTF-Draco/Duck.gltf", 1e-3);
    compare_files("khronos/CesiumMan/glTF-Binary/CesiumMan.glb",
        "khronos/CesiumMan/glTF-Draco/CesiumMan.gltf", 1e-3);
}

// ---- EXT_meshopt_compression -------------------------------------------------------------------

static void add_meshopt_view(const char *mode, const uint8_t *packed, size_t size, uint32_t count,
    uint32_t stride, bool write_stride)
{
    size_t at = memory_bytes(&file, packed, size);
    memory_append(file.views, sizeof file.views, "%s{\"buffer\":0,\"byteLength\":%u",
        file.view_count ? "," : "", count * stride);
    if (write_stride)
        memory_append(file.views, sizeof file.views, ",\"byteStride\":%u", stride);
    memory_append(file.views, sizeof file.views,
        ",\"extensions\":{\"EXT_meshopt_compression\":{\"buffer\":0,\"byteOffset\":%zu,"
        "\"byteLength\":%zu,\"byteStride\":%u,\"count\":%u,\"mode\":\"%s\"}}}",
        at, size, stride, count, mode);
    file.view_count++;
}

// What the encoder of meshoptimizer packs comes out of the loader bit for bit.
static void test_meshopt(void **state)
{
    (void)state;
    enum { SIDE = 9, VERTICES = SIDE * SIDE, INDICES = (SIDE - 1) * (SIDE - 1) * 6 };
    static float positions[VERTICES * 3];
    static unsigned indices[INDICES];
    static uint8_t packed[8192];
    uint32_t n = 0;
    for (uint32_t v = 0; v < VERTICES; v++) {
        positions[v * 3] = (float)(v % SIDE);
        positions[v * 3 + 1] = (float)(v / SIDE) * 0.5f;
        positions[v * 3 + 2] = sinf((float)v);
    }
    for (unsigned y = 0; y + 1 < SIDE; y++)
        for (unsigned x = 0; x + 1 < SIDE; x++) {
            unsigned a = y * SIDE + x, b = a + SIDE;
            const unsigned quad[] = {a, a + 1, b, b, a + 1, b + 1};
            memcpy(indices + n, quad, sizeof quad);
            n += 6;
        }
    begin();
    static const uint8_t fallback[VERTICES * 12];
    memory_bytes(&file, fallback, sizeof fallback); // what the plain views point to
    size_t size = meshopt_encodeVertexBuffer(packed, sizeof packed, positions, VERTICES, 12);
    assert_true(size > 0);
    add_meshopt_view("ATTRIBUTES", packed, size, VERTICES, 12, true);
    meshopt_encodeIndexVersion(1);
    size = meshopt_encodeIndexBuffer(packed, sizeof packed, indices, INDICES);
    assert_true(size > 0);
    add_meshopt_view("TRIANGLES", packed, size, INDICES, 2, false);
    memory_accessor(&file, 0, FLOAT, "VEC3", VERTICES, "");
    memory_accessor(&file, 1, USHORT, "SCALAR", INDICES, "");
    struct hg_asset *asset = memory_load_ok(&file,
        "\"extensionsUsed\":[\"EXT_meshopt_compression\"],\"extensionsRequired\":["
        "\"EXT_meshopt_compression\"],\"meshes\":[{\"primitives\":[{\"indices\":1,"
        "\"attributes\":{\"POSITION\":0}}]}]");
    const struct hg_mesh_part *part = first_part(asset);
    assert_int_equal(part->index_count, INDICES);
    // The codec may turn a triangle's corners; which triangles there are is kept.
    for (uint32_t f = 0; f < INDICES; f += 3) {
        const float *got[3];
        int start = -1;
        for (uint32_t c = 0; c < 3; c++)
            got[c] = part->positions + (size_t)part->indices[f + c] * 3;
        for (int turn = 0; turn < 3; turn++)
            if (memcmp(got[turn], positions + (size_t)indices[f] * 3, 12) == 0)
                start = turn;
        assert_true(start >= 0);
        for (int c = 1; c < 3; c++)
            assert_memory_equal(
                got[(start + c) % 3], positions + (size_t)indices[f + (uint32_t)c] * 3, 12);
    }
    hg_asset_destroy(asset);
}

// ---- materials, instances, lights, variants ----------------------------------------------------

// Greys of a metallic-roughness surface, turned into specular-glossiness, must come back.
static void test_spec_gloss_equation(void **state)
{
    (void)state;
    const float f0 = 0.04f;
    for (int i = 2; i <= 10; i++)
        for (int j = 0; j <= 4; j++) {
            float c = (float)i * 0.1f, m = (float)j * 0.25f, base[3];
            float s = f0 * (1 - m) + c * m;
            float d = s < 1 ? c * (1 - f0) * (1 - m) / (1 - s) : 0;
            float metallic =
                hg_spec_gloss_convert((const float[]){d, d, d}, (const float[]){s, s, s}, base);
            assert_float_equal(metallic, m, 2e-4f);
            for (int a = 0; a < 3; a++)
                assert_float_equal(base[a], c, 1e-3f);
        }
}

static void test_spec_gloss_material(void **state)
{
    (void)state;
    begin();
    struct hg_asset *asset = memory_load_ok(&file,
        "\"extensionsUsed\":[\"KHR_materials_pbrSpecularGlossiness\"],\"materials\":["
        "{\"extensions\":{\"KHR_materials_pbrSpecularGlossiness\":{\"diffuseFactor\":"
        "[0.2,0.4,0.6,0.5],\"specularFactor\":[0.04,0.04,0.04],\"glossinessFactor\":0.7}}},"
        "{\"extensions\":{\"KHR_materials_pbrSpecularGlossiness\":{\"diffuseFactor\":"
        "[0,0,0,1],\"specularFactor\":[1,0.8,0.3],\"glossinessFactor\":1}}}]");
    assert_int_equal(asset->material_count, 2);
    const struct hg_material *paint = asset->materials[0], *gold = asset->materials[1];
    const float want_paint[] = {0.2f, 0.4f, 0.6f, 0.5f}, want_gold[] = {1, 0.8f, 0.3f, 1};
    for (int i = 0; i < 4; i++) {
        assert_float_equal(paint->base_color[i], want_paint[i], 1e-5f);
        assert_float_equal(gold->base_color[i], want_gold[i], 1e-5f);
    }
    assert_float_equal(paint->metallic, 0, 1e-5f);
    assert_float_equal(paint->roughness, 0.3f, 1e-6f);
    assert_float_equal(gold->metallic, 1, 1e-5f);
    assert_float_equal(gold->roughness, 0, 1e-6f);
    hg_asset_destroy(asset);
}

// What an extension leaves out keeps the value that its specification gives: a volume that states
// no colour is clear and not black.
static void test_lobe_defaults(void **state)
{
    (void)state;
    begin();
    struct hg_asset *asset = memory_load_ok(&file,
        "\"extensionsUsed\":[\"KHR_materials_volume\"],\"materials\":[{\"extensions\":"
        "{\"KHR_materials_volume\":{\"attenuationDistance\":2,\"thicknessFactor\":1}}}]");
    const struct hg_material *m = asset->materials[0];
    assert_float_equal(m->volume.attenuation_distance, 2, 0);
    for (int i = 0; i < 3; i++) {
        assert_float_equal(m->volume.attenuation_color[i], 1, 0);
        assert_float_equal(m->specular.color[i], 1, 0);
        assert_float_equal(m->diffuse_transmission.color[i], 1, 0);
        assert_float_equal(m->sheen.color[i], 0, 0);
    }
    assert_float_equal(m->ior, 1.5f, 0);
    assert_float_equal(m->specular.factor, 1, 0);
    assert_float_equal(m->iridescence.ior, 1.3f, 0);
    hg_asset_destroy(asset);
}

static void test_instancing(void **state)
{
    (void)state;
    struct hg_asset *asset = load_file("khronos/SimpleInstancing/glTF/SimpleInstancing.gltf");
    const struct hg_node *node = asset->nodes[0];
    assert_int_equal(node->instance_count, 125);
    float min[3], max[3];
    hg_bounds_clear(min, max);
    for (uint32_t i = 0; i < node->instance_count; i++)
        hg_bounds_add(min, max, node->instances[i] + 12);
    for (int i = 0; i < 3; i++) { // min and max of the TRANSLATION accessor
        assert_float_equal(min[i], 0, 0);
        assert_float_equal(max[i], 10, 0);
    }
    hg_asset_destroy(asset);
}

static void test_lights(void **state)
{
    (void)state;
    begin();
    struct hg_asset *asset = memory_load_ok(&file,
        "\"extensionsUsed\":[\"KHR_lights_punctual\"],\"extensions\":{\"KHR_lights_punctual\":"
        "{\"lights\":[{\"type\":\"directional\",\"color\":[1,0.5,0.25],\"intensity\":3},"
        "{\"type\":\"point\",\"range\":12.5},"
        "{\"type\":\"spot\",\"intensity\":40,\"spot\":{\"innerConeAngle\":0.25,"
        "\"outerConeAngle\":0.5}},{\"type\":\"spot\",\"spot\":{}}]}},"
        "\"nodes\":[{\"extensions\":{\"KHR_lights_punctual\":{\"light\":2}}}]");
    assert_int_equal(asset->light_count, 4);
    struct hg_light *const *l = asset->lights;
    assert_int_equal(l[0]->kind, HG_LIGHT_DIRECTIONAL);
    assert_true(l[0]->color[0] == 1 && l[0]->color[1] == 0.5f && l[0]->color[2] == 0.25f);
    assert_float_equal(l[0]->intensity, 3, 0);
    assert_int_equal(l[1]->kind, HG_LIGHT_POINT);
    assert_float_equal(l[1]->range, 12.5f, 0);
    assert_float_equal(l[1]->intensity, 1, 0);
    assert_float_equal(l[1]->color[2], 1, 0);
    assert_int_equal(l[2]->kind, HG_LIGHT_SPOT);
    assert_float_equal(l[2]->intensity, 40, 0);
    assert_float_equal(l[2]->inner_cone_rad, 0.25f, 0);
    assert_float_equal(l[2]->outer_cone_rad, 0.5f, 0);
    assert_float_equal(l[2]->range, 0, 0);
    assert_float_equal(l[3]->inner_cone_rad, 0, 0);
    assert_float_equal(l[3]->outer_cone_rad, 0.78539816f, 1e-7f);
    assert_ptr_equal(asset->nodes[0]->light, l[2]);
    hg_asset_destroy(asset);

    asset = load_file("khronos/LightsPunctualLamp/glTF/LightsPunctualLamp.gltf");
    static const float intensity[] = {15, 1.5f, 80, 80, 180};
    assert_int_equal(asset->light_count, 5);
    for (int i = 0; i < 5; i++) {
        assert_int_equal(asset->lights[i]->kind, HG_LIGHT_POINT);
        assert_float_equal(asset->lights[i]->intensity, intensity[i], 0);
    }
    assert_float_equal(asset->lights[0]->color[1], 0.63187498f, 1e-7f);
    hg_asset_destroy(asset);
}

static void expect_material(const struct hg_asset *asset, uint32_t mesh, const char *name)
{
    const struct hg_material *m = hg_asset_part_material(asset, &asset->meshes[mesh]->parts[0]);
    assert_non_null(m);
    assert_string_equal(m->head.name, name);
}

static void test_variants(void **state)
{
    (void)state;
    struct hg_asset *asset = load_file("khronos/SheenChair/glTF/SheenChair.gltf");
    assert_int_equal(asset->variants.count, 2);
    assert_string_equal(asset->variants.names[0], "Mango Velvet");
    assert_string_equal(asset->variants.names[1], "Peacock Velvet");
    assert_int_equal(asset->variants.chosen, -1);
    for (int32_t v = -1; v < 2; v++) {
        asset->variants.chosen = v;
        bool second = v == 1;
        expect_material(
            asset, 0, second ? "fabric Mystere Peacock Velvet" : "fabric Mystere Mango Velvet");
        expect_material(asset, 1, second ? "wood Black" : "wood Brown");
        expect_material(asset, 2, "metal"); // no mapping
        expect_material(asset, 3, "label");
    }
    hg_asset_destroy(asset);
}

// A vertex without a normal gets that of its triangles; a part without any is flat, as one that has
// no NORMAL.
static void test_normals_without_length(void **state)
{
    (void)state;
    static const float corners[] = {0, 0, 0, 1, 0, 1, 1, 1, 1, 0, 1, 0};
    static const float some[] = {0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0}, none[12] = {0};
    static const uint16_t indices[] = {0, 1, 2, 0, 2, 3};
    const float half = 0.70710678f;
    begin();
    memory_floats(&file, "VEC3", 4, corners, sizeof corners);
    memory_floats(&file, "VEC3", 4, some, sizeof some);
    memory_floats(&file, "VEC3", 4, none, sizeof none);
    const uint32_t view = memory_view(&file, indices, sizeof indices, 0);
    memory_accessor(&file, (int)view, USHORT, "SCALAR", 6, "");
    struct hg_asset *asset =
        memory_load_ok(&file, "\"meshes\":[{\"primitives\":["
                              "{\"attributes\":{\"POSITION\":0,\"NORMAL\":1},\"indices\":3},"
                              "{\"attributes\":{\"POSITION\":0,\"NORMAL\":2},\"indices\":3}]}]");
    const struct hg_mesh_part *first = &asset->meshes[0]->parts[0];
    const struct hg_mesh_part *second = &asset->meshes[0]->parts[1];
    assert_int_equal(first->vertex_count, 4);
    assert_float_equal(first->normals[1], 1, 0);
    assert_float_equal(first->normals[3], -half, 1e-6f);
    assert_float_equal(first->normals[4], 0, 1e-6f);
    assert_float_equal(first->normals[5], half, 1e-6f);
    assert_int_equal(second->vertex_count, 6);
    for (uint32_t v = 0; v < 6; v++)
        assert_float_equal(second->normals[v * 3 + 2], half, 1e-6f);
    hg_asset_destroy(asset);
}

// A material may use any two UV sets; a third one is warned of.
static void test_uv_sets(void **state)
{
    (void)state;
    static const float uv[4][6] = {
        {0, 0, 0, 0, 0, 0}, {1, 1, 1, 1, 1, 1}, {2, 2, 2, 2, 2, 2}, {3, 3, 3, 3, 3, 3}};
    begin();
    memory_floats(&file, "VEC3", 3, triangle, sizeof triangle);
    for (int i = 0; i < 4; i++)
        memory_floats(&file, "VEC2", 3, uv[i], sizeof uv[i]);
#define PRIMITIVE(material)                                                                        \
    "{\"material\":" #material                                                                     \
    ",\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1,\"TEXCOORD_1\":2,"                           \
    "\"TEXCOORD_2\":3,\"TEXCOORD_3\":4}}"
#define BASE(set)                                                                                  \
    "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0,\"texCoord\":" #set "}}"
#define OTHER(kind, set) "\"" kind "Texture\":{\"index\":0,\"texCoord\":" #set "}"
    struct hg_asset *asset = memory_load_ok(&file,
        "\"images\":[{\"uri\":\"none.png\"}],\"textures\":[{\"source\":0}],\"materials\":["
        "{" BASE(0) "," OTHER("emissive", 1) "},{" BASE(2) "," OTHER("emissive", 3) "},{" BASE(
            3) "},"
               "{" BASE(3) "," OTHER("emissive", 0) "," OTHER(
                   "occlusion", 1) "}],\"meshes\":["
                                   "{\"primitives\":[" PRIMITIVE(0) "," PRIMITIVE(1) "," PRIMITIVE(
                                       2) "," PRIMITIVE(3) "]}]");
    static const struct {
        float uv[2]; // of the part; -1: none
        uint32_t base, emissive;
    } want[] = {{{0, 1}, 0, 1}, {{2, 3}, 0, 1}, {{3, -1}, 0, 0}, {{3, 1}, 0, 0}};
    for (uint32_t i = 0; i < 4; i++) {
        const struct hg_mesh_part *part = &asset->meshes[0]->parts[i];
        assert_int_equal(part->material->slots[HG_SLOT_BASE_COLOR].uv_set, want[i].base);
        assert_int_equal(part->material->slots[HG_SLOT_EMISSIVE].uv_set, want[i].emissive);
        for (int k = 0; k < 2; k++)
            assert_true(want[i].uv[k] < 0 ? part->uv[k] == NULL : part->uv[k][3] == want[i].uv[k]);
    }
    bool told = false;
    for (uint32_t i = 0; i < asset->warning_count; i++)
        told |= strstr(asset->warnings[i].reason, "two UV sets of a material are read") != NULL;
    assert_true(told);
    hg_asset_destroy(asset);
}

// ---- files outside of the asset's folder -------------------------------------------------------

static enum hg_status load_with_buffer(const char *path, const char *uri)
{
    char json[2048];
    snprintf(json, sizeof json,
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"%s\"}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],\"accessors\":[{\"bufferView\":0,"
        "\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\"min\":[0,0,0],\"max\":[1,1,0]}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}]}",
        uri);
    test_file_write(path, json, strlen(json));
    struct hg_asset *asset;
    struct hg_error err;
    enum hg_status status = corpus_load(path, &asset, &err);
    if (status)
        assert_null(asset);
    hg_asset_destroy(asset);
    return status;
}

static void test_paths(void **state)
{
    (void)state;
    char root[TEST_FOLDER_MAX], gltf[256], name[256], inner[256], outer[256];
    assert_true(test_folder_make(root, "geometry"));
    snprintf(name, sizeof name, "%s/asset", root);
    assert_int_equal(mkdir(name, 0700), 0);
    snprintf(gltf, sizeof gltf, "%s/asset/a.gltf", root);
    snprintf(inner, sizeof inner, "%s/asset/in side.bin", root);
    snprintf(outer, sizeof outer, "%s/outside.bin", root);
    test_file_write(inner, triangle, sizeof triangle);
    test_file_write(outer, triangle, sizeof triangle);
    char links[2][256], folder[256];
    snprintf(links[0], sizeof links[0], "%s/asset/good.bin", root);
    snprintf(links[1], sizeof links[1], "%s/asset/bad.bin", root);
    snprintf(folder, sizeof folder, "%s/asset/up", root);
    assert_int_equal(symlink("in side.bin", links[0]), 0);
    assert_int_equal(symlink("../outside.bin", links[1]), 0);
    assert_int_equal(symlink("..", folder), 0);

    assert_int_equal(load_with_buffer(gltf, "in%20side.bin"), HG_OK);
    assert_int_equal(load_with_buffer(gltf, "good.bin"), HG_OK);
    assert_int_equal(load_with_buffer(gltf, "../asset/good.bin"), HG_OK);
    assert_int_equal(load_with_buffer(gltf, "../outside.bin"), HG_E_PERM);
    assert_int_equal(load_with_buffer(gltf, "%2e%2e/outside.bin"), HG_E_PERM);
    assert_int_equal(load_with_buffer(gltf, "bad.bin"), HG_E_PERM);
    assert_int_equal(load_with_buffer(gltf, "up/outside.bin"), HG_E_PERM);
    assert_int_equal(load_with_buffer(gltf, "missing.bin"), HG_E_NOTFOUND);
    assert_int_equal(load_with_buffer(gltf, outer), HG_E_UNSUPPORTED);
    snprintf(name, sizeof name, "file://%.200s", inner);
    assert_int_equal(load_with_buffer(gltf, name), HG_E_UNSUPPORTED);
    snprintf(name, sizeof name, "%%2f%.200s", outer + 1); // a slash in disguise
    assert_int_not_equal(load_with_buffer(gltf, name), HG_OK);

    assert_true(test_folder_remove(root));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_components),
        cmocka_unit_test(test_indices), cmocka_unit_test(test_sparse), cmocka_unit_test(test_modes),
        cmocka_unit_test(test_flat_normals), cmocka_unit_test(test_quantized),
        cmocka_unit_test(test_draco), cmocka_unit_test(test_meshopt),
        cmocka_unit_test(test_spec_gloss_equation), cmocka_unit_test(test_spec_gloss_material),
        cmocka_unit_test(test_lobe_defaults), cmocka_unit_test(test_instancing),
        cmocka_unit_test(test_lights), cmocka_unit_test(test_variants),
        cmocka_unit_test(test_uv_sets), cmocka_unit_test(test_normals_without_length),
        cmocka_unit_test(test_paths)};
    return test_run_group(tests, NULL, NULL);
}
