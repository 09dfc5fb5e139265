// The demo scene: the same bytes every time, sound geometry, quick to make.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/sha256.h"
#include "renderer/scene/asset.h"

static struct hg_asset *make(struct hg_jobs *jobs)
{
    struct hg_asset *asset;
    struct hg_error err = {0};
    struct hg_load_params params = {.path = "demo:", .asset_number = 1, .jobs = jobs};
    assert_int_equal(hg_load_asset(&params, &asset, &err), HG_OK);
    return asset;
}

static void digest(const struct hg_asset *asset, uint8_t out[32])
{
    struct hg_sha256 *h = hg_sha256_create();
    for (uint32_t m = 0; m < asset->mesh_count; m++) {
        const struct hg_mesh_part *p = asset->meshes[m]->parts;
        hg_sha256_update(h, p->positions, (size_t)p->vertex_count * 12);
        hg_sha256_update(h, p->normals, (size_t)p->vertex_count * 12);
        hg_sha256_update(h, p->indices, (size_t)p->index_count * 4);
    }
    for (uint32_t t = 0; t < asset->texture_count; t++)
        hg_sha256_update(h, asset->textures[t]->image->pixels.pixels,
            asset->textures[t]->image->pixels.size_bytes);
    hg_sha256_end(h, out);
}

static void test_same_bytes(void **state)
{
    (void)state;
    uint8_t a[32], b[32];
    struct hg_jobs *jobs = hg_jobs_create(3);
    uint64_t start = hg_clock_now_ns();
    struct hg_asset *first = make(NULL);
    printf("made in %.0f ms\n", (double)(hg_clock_now_ns() - start) / 1e6);
    struct hg_asset *second = make(jobs);
    digest(first, a);
    digest(second, b);
    assert_memory_equal(a, b, 32);
    hg_asset_destroy(first);
    hg_asset_destroy(second);
    hg_jobs_destroy(jobs);
}

// Faces look where their vertex normals point, or holes would show.
static void check_winding(const struct hg_mesh *mesh)
{
    const struct hg_mesh_part *p = mesh->parts;
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < p->index_count; i += 3) {
        float d[2][3], n[3] = {0};
        const float *a = p->positions + (size_t)p->indices[i] * 3;
        for (int k = 0; k < 3; k++) {
            d[0][k] = p->positions[(size_t)p->indices[i + 1] * 3 + k] - a[k];
            d[1][k] = p->positions[(size_t)p->indices[i + 2] * 3 + k] - a[k];
            for (int c = 0; c < 3; c++)
                n[k] += p->normals[(size_t)p->indices[i + c] * 3 + k];
        }
        float cross[3] = {d[0][1] * d[1][2] - d[0][2] * d[1][1],
            d[0][2] * d[1][0] - d[0][0] * d[1][2], d[0][0] * d[1][1] - d[0][1] * d[1][0]};
        float dot = cross[0] * n[0] + cross[1] * n[1] + cross[2] * n[2];
        float area = sqrtf(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
        wrong += dot < -0.2f * area && area > 1e-9f;
    }
    if (wrong * 200 > p->index_count / 3) // folds of the cloth have a few
        fail_msg("%s: %u of %u faces look inwards", mesh->head.name, wrong, p->index_count / 3);
}

static void test_geometry(void **state)
{
    (void)state;
    struct hg_asset *asset = make(NULL);
    uint64_t unique = 0, drawn = 0;
    for (uint32_t m = 0; m < asset->mesh_count; m++) {
        check_winding(asset->meshes[m]);
        unique += asset->meshes[m]->parts->index_count / 3;
        printf("%-16s %u\n", asset->meshes[m]->head.name, asset->meshes[m]->parts->index_count / 3);
    }
    for (uint32_t n = 0; n < asset->node_count; n++)
        if (asset->nodes[n]->mesh)
            drawn += asset->nodes[n]->mesh->parts->index_count / 3;
    printf("%u nodes, %llu triangles, %llu as placed\n", asset->node_count,
        (unsigned long long)unique, (unsigned long long)drawn);
    assert_in_range(drawn, 50000, 400000);
    hg_asset_destroy(asset);
}

static void test_turning(void **state)
{
    (void)state;
    struct hg_asset *asset = make(NULL);
    assert_int_equal(asset->animation_count, 1);
    struct hg_node *node = asset->animations[0].channels[0].node;
    float before[4], after[4];
    assert_int_equal(hg_asset_pose(asset, 0, 0), HG_OK);
    memcpy(before, node->rotation, sizeof before);
    assert_int_equal(hg_asset_pose(asset, 0, 5), HG_OK);
    assert_memory_not_equal(before, node->rotation, sizeof before);
    assert_int_equal(hg_asset_pose(asset, 0, 24), HG_OK);
    memcpy(after, node->rotation, sizeof after);
    float dot = 0;
    for (int i = 0; i < 4; i++)
        dot += before[i] * after[i];
    assert_true(fabsf(dot) > 0.99999f); // the loop closes
    hg_asset_destroy(asset);
}

static void test_no_memory(void **state)
{
    (void)state;
    struct hg_load_params params = {.path = "demo:", .asset_number = 1};
    for (uint64_t n = 1; n < 400; n = n * 3 + 1) {
        struct hg_asset *asset;
        struct hg_error err = {0};
        hg_alloc_fail_at(n);
        enum hg_status status = hg_load_asset(&params, &asset, &err);
        hg_alloc_fail_at(0);
        assert_true(status == HG_OK || status == HG_E_NOMEM);
        assert_true((status == HG_OK) == (asset != NULL));
        hg_asset_destroy(asset);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_geometry), cmocka_unit_test(test_turning),
        cmocka_unit_test(test_no_memory)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
