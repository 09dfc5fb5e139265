// lod_proxy_mesh.c - coarse stand-ins of large parts: how many triangles, where, what they look
// like.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/lod/proxy_mesh.h"
#include "tests/unit/lod_meshes.h"

static struct hg_mesh_part *build(const struct hg_mesh_part *part, uint32_t triangles)
{
    struct hg_mesh_part *proxy;
    assert_int_equal(hg_proxy_build(part, triangles, &proxy), HG_OK);
    assert_in_range(proxy->index_count, 0, triangles * 3);
    for (uint32_t i = 0; i < proxy->index_count; i++)
        assert_true(proxy->indices[i] < proxy->vertex_count);
    return proxy;
}

static double area_of(const struct hg_mesh_part *p)
{
    double sum = 0.0;
    for (uint32_t t = 0; t < p->index_count; t += 3) {
        const float *a = p->positions + (size_t)p->indices[t] * 3,
                    *b = p->positions + (size_t)p->indices[t + 1] * 3,
                    *c = p->positions + (size_t)p->indices[t + 2] * 3;
        double e[2][3], n[3];
        for (int k = 0; k < 3; k++) {
            e[0][k] = (double)b[k] - (double)a[k];
            e[1][k] = (double)c[k] - (double)a[k];
        }
        for (int k = 0; k < 3; k++)
            n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
        sum += 0.5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    }
    return sum;
}

// Its points lie on the surface to within a cell, its normals turn the same way, its area is alike.
static void test_surface(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(400, 200, 1.0f);
    static const uint32_t counts[] = {200, 2000, 16384};
    for (int i = 0; i < 3; i++) {
        struct hg_mesh_part *proxy = build(&part, counts[i]);
        assert_true(proxy->index_count / 3 > counts[i] / 4);
        double worst = 0.0;
        for (uint32_t v = 0; v < proxy->vertex_count; v += 1 + proxy->vertex_count / 500) {
            double least = INFINITY, along = -1.0;
            for (uint32_t s = 0; s < part.vertex_count; s++) {
                double d = 0.0, dot = 0.0;
                for (uint32_t k = 0; k < 3; k++) {
                    const double to =
                        (double)proxy->positions[v * 3 + k] - (double)part.positions[s * 3 + k];
                    d += to * to;
                    dot += (double)proxy->normals[v * 3 + k] * (double)part.normals[s * 3 + k];
                }
                if (d < least) {
                    least = d;
                    along = dot;
                }
            }
            worst = fmax(worst, sqrt(least));
            assert_true(i == 0 || along > 0.7);
        }
        assert_true(worst < 2.0 / sqrt((double)counts[i])); // a cell of a torus 2.8 m wide
        assert_true(fabs(area_of(proxy) / area_of(&part) - 1.0) < (i == 0 ? 0.25 : 0.06));
        struct hg_mesh_part *again = build(&part, counts[i]);
        assert_int_equal(again->index_count, proxy->index_count);
        assert_memory_equal(again->indices, proxy->indices, proxy->index_count * 4);
        assert_memory_equal(again->positions, proxy->positions, proxy->vertex_count * 12);
        hg_proxy_free(again);
        hg_proxy_free(proxy);
    }
    lod_part_finish(&part);
}

// Triangles that are small and have no neighbours would all fall to points: some of them grow.
static void test_soup(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_soup(100000);
    for (uint32_t t = 0; t < part.index_count; t += 3) { // far smaller than a cell
        const float *origin = part.positions + (size_t)part.indices[t] * 3;
        float place[3];
        memcpy(place, origin, sizeof place);
        for (uint32_t k = 0; k < 3; k++) {
            float *p = part.positions + (size_t)part.indices[t + k] * 3;
            for (int a = 0; a < 3; a++)
                p[a] = place[a] + (p[a] - place[a]) * 1e-3f;
        }
    }
    struct hg_mesh_part *proxy = build(&part, 1000);
    assert_int_equal(proxy->index_count, 3000);
    const double ratio = area_of(proxy) / area_of(&part);
    assert_true(ratio > 0.8 && ratio < 1.25);
    hg_proxy_free(proxy);
    lod_part_finish(&part);
}

static void test_odd_parts(void **state)
{
    (void)state;
    struct hg_mesh_part none = {0};
    struct hg_mesh_part *proxy = build(&none, 100);
    assert_int_equal(proxy->index_count, 0);
    hg_proxy_free(proxy);
    struct hg_mesh_part part = lod_terrain(40);
    for (int way = 0; way < 3; way++) {
        for (uint32_t i = 0; i < part.vertex_count * 3; i++) // all in one place, or hardly anywhere
            part.positions[i] = way == 0 ? 5.0f : way == 1 ? (float)(i % 7) * 1e37f : 1e-42f;
        proxy = build(&part, 300);
        for (uint32_t i = 0; i < proxy->vertex_count * 3; i++)
            assert_true(isfinite(proxy->positions[i]) && isfinite(proxy->normals[i]));
        hg_proxy_free(proxy);
    }
    lod_part_finish(&part);
}

static void test_no_memory(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(60, 40, 1.0f);
    struct hg_mesh_part *proxy;
    enum hg_status status = HG_E_NOMEM;
    uint32_t failures = 0;
    for (uint64_t n = 1; status != HG_OK && n < 400; n++) {
        hg_alloc_fail_at(n);
        status = hg_proxy_build(&part, 500, &proxy);
        hg_alloc_fail_at(0);
        failures += status != HG_OK;
        assert_true(status == HG_OK || (status == HG_E_NOMEM && proxy == NULL));
    }
    assert_int_equal(status, HG_OK);
    assert_true(failures > 10);
    hg_proxy_free(proxy);
    lod_part_finish(&part);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_surface), cmocka_unit_test(test_soup),
        cmocka_unit_test(test_odd_parts), cmocka_unit_test(test_no_memory)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
