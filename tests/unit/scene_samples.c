// Every sample model loads, with sound geometry.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/scene/asset.h"
#include "scene_corpus.h"

static struct corpus corpus;

static void check_part(const char *path, const struct hg_mesh_part *part)
{
    for (uint32_t i = 0; i < part->index_count; i++)
        if (part->indices[i] >= part->vertex_count)
            fail_msg("%s: index %u", path, part->indices[i]);
    for (size_t i = 0; i < (size_t)part->vertex_count * 3; i++)
        if (!isfinite(part->positions[i]))
            fail_msg("%s: position", path);
    if (part->topology != HG_TOPOLOGY_TRIANGLES)
        return;
    assert_non_null(part->normals);
    for (size_t v = 0; v < part->vertex_count; v++) {
        const float *n = part->normals + v * 3;
        float length = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        if (fabsf(length - 1) > 1e-4f)
            fail_msg("%s: normal of length^2 %g", path, (double)length);
        const float *t = part->tangents ? part->tangents + v * 4 : NULL;
        if (t && (fabsf(t[0] * t[0] + t[1] * t[1] + t[2] * t[2] - 1) > 1e-3f || fabsf(t[3]) != 1))
            fail_msg("%s: tangent %g %g %g %g", path, (double)t[0], (double)t[1], (double)t[2],
                (double)t[3]);
    }
}

// The description says which variant is chosen.
static void check_variants(struct hg_asset *asset)
{
    for (int32_t v = (int32_t)asset->variants.count - 1; v >= -1; v--) {
        char *text = NULL;
        asset->variants.chosen = v;
        assert_int_equal(hg_asset_describe(asset, &text), HG_OK);
        const char *chosen = strstr(text, "\"variant\":");
        assert_int_equal(chosen != NULL, v >= 0);
        assert_true(v < 0 || strstr(chosen, asset->variants.names[v]) != NULL);
        hg_free(text);
    }
}

static void check_asset(const char *path, struct hg_asset *asset)
{
    if (asset->variants.count)
        check_variants(asset);
    for (uint32_t m = 0; m < asset->mesh_count; m++)
        for (uint32_t p = 0; p < asset->meshes[m]->part_count; p++)
            check_part(path, &asset->meshes[m]->parts[p]);
    for (int32_t a = -1; a < (int32_t)asset->animation_count; a++)
        for (int i = 0; i < 5; i++)
            assert_int_equal(hg_asset_pose(asset, a, i * 0.3), HG_OK);
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    hg_scene_update(scene);
    float min[3], max[3];
    if (hg_scene_bounds(scene, NULL, min, max))
        for (int i = 0; i < 3; i++)
            assert_true(isfinite(min[i]) && isfinite(max[i]) && min[i] <= max[i]);
    hg_scene_destroy(scene);
}

// Loads all files below a folder; `refused` names those that must not load.
static void load_all(const char *folder, const char *const *refused)
{
    corpus_collect(&corpus, folder);
    assert_true(corpus.count > 0);
    for (size_t i = 0; i < corpus.count; i++) {
        struct hg_asset *asset;
        struct hg_error err;
        bool bad = false;
        for (const char *const *r = refused; r && *r; r++)
            bad |= strstr(corpus.files[i], *r) != NULL;
        uint64_t start = hg_clock_now_ns();
        enum hg_status status = corpus_load(corpus.files[i], &asset, &err);
        double ms = (double)(hg_clock_now_ns() - start) / 1e6;
        if ((status != HG_OK) != bad)
            fail_msg("%s: %s at '%s': %s", corpus.files[i], hg_status_name(status), err.where,
                err.reason);
        if (status)
            continue;
        if (ms > 300 || asset->warning_count)
            printf("%-60.60s %6.1f ms  %u warnings%s%s\n", strstr(corpus.files[i], folder), ms,
                asset->warning_count, asset->warning_count ? ": " : "",
                asset->warning_count ? asset->warnings[0].reason : "");
        check_asset(corpus.files[i], asset);
    }
    printf("%s: %zu files\n", folder, corpus.count);
    corpus_finish(&corpus);
}

static void test_khronos(void **state)
{
    (void)state;
    load_all("khronos", NULL);
}

static void test_generator(void **state)
{
    (void)state;
    static const char *const refused[] = {"Negative", "Compatibility_04", "Compatibility_05", NULL};
    load_all("asset-generator", refused);
}

static void test_scenes(void **state)
{
    (void)state;
    load_all("scenes", NULL);
    load_all("extra-gltf", NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_khronos),
        cmocka_unit_test(test_generator), cmocka_unit_test(test_scenes)};
    return test_run_group(tests, NULL, NULL);
}
