// trace_hits.c - what rays hit, against trying every triangle, for each backend.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "trace_rig.h"

#include "base/alloc.h"
#include "base/clock.h"

static enum hg_trace_backend backend;

static const float MIRRORED[16] = {
    -0.5f, 0, 0, 0, 0, 1.2f, 0.3f, 0, 0, 0, 0.7f, 0, 0.4f, -0.3f, 0.2f, 1};
static const float SHEARED[16] = {
    0.6f, 0.2f, 0, 0, -0.3f, 0.4f, 0, 0, 0.1f, 0, 1.4f, 0, -0.5f, 0.5f, 0, 1};

static void soup(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    rig_node(r, rig_soup(r, 600, 0.3), NULL);
    rig_sync(r);
    rig_fill_rays(r, 4000);
    assert_in_range(rig_compare(r, 4000, false), 0, 4);
    assert_in_range(rig_compare(r, 4000, true), 0, 4);
    rig_close(r);
}

// Few triangles are flattened; many that are placed twice are instances.
static void instances(void **state)
{
    (void)state;
    for (uint32_t many = 0; many < 2; many++) {
        struct rig *r = rig_open(backend);
        struct hg_mesh *mesh = rig_soup(r, many ? 40000 : 300, many ? 0.02 : 0.3);
        rig_node(r, mesh, NULL);
        rig_node(r, mesh, MIRRORED);
        rig_node(r, mesh, SHEARED);
        rig_node(r, rig_soup(r, 100, 0.3), SHEARED);
        rig_sync(r);
        struct hg_trace_stats stats;
        hg_trace_stats(r->trace, &stats);
        assert_int_equal(stats.instances, many ? 3 : 0);
        const uint32_t rays = many ? 300 : 3000;
        rig_fill_rays(r, rays);
        assert_in_range(rig_compare(r, rays, false), 0, 6);
        assert_in_range(rig_compare(r, rays, true), 0, 6);
        rig_close(r);
    }
}

static void masks(void **state)
{
    (void)state;
    static const enum hg_alpha_mode modes[] = {HG_ALPHA_OPAQUE, HG_ALPHA_MASK, HG_ALPHA_BLEND};
    const float quad[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
    const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    struct rig *r = rig_open(backend);
    for (int i = 0; i < 3; i++) {
        const float at[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, (float)-i, 1};
        struct hg_mesh *mesh = rig_mesh(r, quad, 4, indices, 6);
        mesh->parts->material = rig_material(r, modes[i]);
        rig_node(r, mesh, at);
    }
    rig_sync(r);
    struct hg_gpu_ray *rays = rig_rays(r, 8);
    for (uint32_t i = 0; i < 8; i++)
        rays[i] = (struct hg_gpu_ray){.origin_ws = {0.25f, 0.5f, 1.0f},
            .direction_ws = {0, 0, -1},
            .t_max = 1e30f,
            .mask = i};
    static const float first[8] = {0, 1, 2, 1, 3, 1, 2, 1};
    for (int coherent = 0; coherent < 2; coherent++) {
        const struct hg_gpu_hit *hits = rig_closest(r, 8, coherent != 0);
        const uint32_t *blocked = rig_blocked(r, 8, coherent != 0);
        for (uint32_t i = 0; i < 8; i++) {
            assert_int_equal(hits[i].draw != HG_HIT_NONE, i != 0);
            assert_int_equal(blocked[i], i != 0);
            if (i != 0)
                assert_true(fabsf(hits[i].t - first[i]) < 1e-6f);
        }
    }
    rig_close(r);
}

static void interval(void **state)
{
    (void)state;
    const float triangle[] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
    const uint32_t indices[] = {0, 1, 2};
    struct rig *r = rig_open(backend);
    rig_node(r, rig_mesh(r, triangle, 3, indices, 3), NULL);
    rig_sync(r);
    static const struct {
        float t_min, t_max, direction;
        bool hit;
        // Bounds lie beside the hit, not at it: its distance is rounded as the processor's units
        // do.
    } cases[] = {{0, 1e30f, -1, true}, {0, 0.9999f, -1, false}, {1.0001f, 2, -1, false},
        {0.99f, 1.01f, -1, true}, {0, 0.4999f, -2, false}, {0, 0.51f, -2, true}, {0, 2, 1, false},
        {2, 1, -1, false}, {NAN, 2, -1, false}, {0, NAN, -1, false}, {0, 2, NAN, false},
        {0, 2, 0, false}, {0, INFINITY, -1, true}, {0, 1e30f, -1e-20f, true}};
    enum { COUNT = sizeof cases / sizeof cases[0] };
    struct hg_gpu_ray *rays = rig_rays(r, COUNT);
    for (uint32_t i = 0; i < COUNT; i++)
        rays[i] = (struct hg_gpu_ray){.origin_ws = {0.1f, 0, 1},
            .direction_ws = {0, 0, cases[i].direction},
            .t_min = cases[i].t_min,
            .t_max = cases[i].t_max,
            .mask = HG_RAY_ALL};
    for (int coherent = 0; coherent < 2; coherent++) {
        const struct hg_gpu_hit *hits = rig_closest(r, COUNT, coherent != 0);
        const uint32_t *blocked = rig_blocked(r, COUNT, coherent != 0);
        for (uint32_t i = 0; i < COUNT; i++)
            if ((hits[i].draw != HG_HIT_NONE) != cases[i].hit || (blocked[i] != 0) != cases[i].hit)
                fail_msg("case %u: %s, blocked %u", i, hits[i].draw != HG_HIT_NONE ? "hit" : "none",
                    blocked[i]);
    }
    rig_close(r);
}

static void hostile(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    struct hg_mesh *mesh = rig_soup(r, 400, 0.3);
    float *p = mesh->parts->positions;
    for (uint32_t i = 0; i < 400; i += 10) { // of ten triangles three are no triangles
        p[i * 9] = NAN;
        p[(i + 1) * 9 + 4] = INFINITY;
        memcpy(p + (i + 2) * 9 + 3, p + (i + 2) * 9, 12);
    }
    rig_node(r, mesh, NULL);
    const float flat[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0.1f, 1};
    rig_node(r, rig_soup(r, 50, 0.3), flat); // a matrix without inverse: shadows of themselves
    const float broken[16] = {1, 0, 0, 0, 0, NAN, 0, 0, 0, 0, 1, 0, 0, 0, 0.1f, 1};
    rig_node(r, rig_soup(r, 50, 0.3), broken);
    const float huge[16] = {1e30f, 0, 0, 0, 0, 1e30f, 0, 0, 0, 0, 1e30f, 0, 0, 1e35f, 0, 1};
    rig_node(r, rig_soup(r, 50, 0.3), huge);
    rig_sync(r);
    rig_fill_rays(r, 3000);
    assert_in_range(rig_compare(r, 3000, false), 0, 6);
    assert_in_range(rig_compare(r, 3000, true), 0, 6);
    rig_close(r);
}

// Rays and places that are farther away, or smaller, than anything is: rays miss, and nothing else
// happens (Embree ends the program where a ray's numbers are too large).
static void wild(void **state)
{
    (void)state;
    enum { PLACES = 34, COUNT = 96, AIMED = 1000 };
    struct rig *r = rig_open(backend);
    struct hg_mesh *mesh = rig_soup(r, 2048, 0.3); // with so many places not made flat
    for (int i = 0; i < PLACES; i++) {
        const float size = i == 0 ? 3e-18f : i == 1 ? 1e-9f : 1;
        const float x = i < 2 ? 0 : i == 2 ? 1e14f : 5;
        const float at[16] = {size, 0, 0, 0, 0, size, 0, 0, 0, 0, size, 0, x, 0, 0, 1};
        rig_node(r, mesh, at);
    }
    rig_sync(r);
    struct hg_gpu_ray *rays = rig_rays(r, COUNT);
    for (uint32_t i = 0; i < COUNT; i++) {
        const float far = powf(10, (float)(i / 2) / 47 * 25 + 12.5f);
        const float at = i % 2 ? 2 : far, along = i % 2 ? -far : -1;
        rays[i] = (struct hg_gpu_ray){.origin_ws = {at + 5, at, at},
            .direction_ws = {along, along, along},
            .t_max = 1e30f,
            .mask = HG_RAY_ALL};
    }
    for (int coherent = 0; coherent < 2; coherent++) {
        const struct hg_gpu_hit *hits = rig_closest(r, COUNT, coherent != 0);
        const uint32_t *blocked = rig_blocked(r, COUNT, coherent != 0);
        for (uint32_t i = 0; i < COUNT; i++)
            assert_true(hits[i].draw == HG_HIT_NONE && blocked[i] == 0);
    }
    rays = rig_rays(r, AIMED); // at the smallest, from as far as they may be
    for (uint32_t i = 0; i < AIMED; i++) {
        const float far = powf(10, (float)i / AIMED * 11);
        rays[i] = (struct hg_gpu_ray){.origin_ws = {-far, far, far},
            .direction_ws = {far, -far, -far},
            .t_max = 1e30f,
            .mask = HG_RAY_ALL};
    }
    for (int coherent = 0; coherent < 2; coherent++) {
        (void)rig_closest(r, AIMED, coherent != 0);
        (void)rig_blocked(r, AIMED, coherent != 0);
    }
    rig_close(r);
}

static void empty(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    rig_sync(r);
    rig_fill_rays(r, 100);
    assert_int_equal(rig_compare(r, 100, false), 0);
    assert_int_equal(rig_compare(r, 100, true), 0);
    const float dot[] = {0, 0, 0};
    const uint32_t indices[] = {0, 0, 0};
    rig_node(r, rig_mesh(r, dot, 1, indices, 3), NULL);
    struct hg_mesh *lines = rig_soup(r, 20, 1.0);
    lines->parts->topology = HG_TOPOLOGY_LINES;
    rig_node(r, lines, NULL);
    rig_sync(r);
    assert_int_equal(rig_compare(r, 100, false), 0);
    rig_close(r);
}

// A closed surface has no gaps: rays from inside that aim at edges and corners stay inside.
static void closed(void **state)
{
    (void)state;
    enum { SIDE = 24, ROUND = 48, COUNT = (SIDE - 1) * ROUND + 2 };
    struct rig *r = rig_open(backend);
    float positions[COUNT * 3];
    uint32_t indices[SIDE * ROUND * 6], n = 0;
    for (int i = 1; i < SIDE; i++)
        for (int k = 0; k < ROUND; k++) {
            const double a = M_PI * i / SIDE, b = 2.0 * M_PI * k / ROUND;
            float *p = positions + ((i - 1) * ROUND + k) * 3;
            p[0] = (float)(sin(a) * cos(b));
            p[1] = (float)cos(a);
            p[2] = (float)(sin(a) * sin(b));
        }
    const float poles[6] = {0, 1, 0, 0, -1, 0};
    memcpy(positions + (COUNT - 2) * 3, poles, sizeof poles);
    for (uint32_t i = 0; i < SIDE; i++)
        for (uint32_t k = 0; k < ROUND; k++) {
            const uint32_t next = (k + 1) % ROUND;
            const uint32_t a = i == 0 ? COUNT - 2 : (i - 1) * ROUND + k;
            const uint32_t b = i == 0 ? COUNT - 2 : (i - 1) * ROUND + next;
            const uint32_t c = i == SIDE - 1 ? COUNT - 1 : i * ROUND + k;
            const uint32_t d = i == SIDE - 1 ? COUNT - 1 : i * ROUND + next;
            const uint32_t two[6] = {a, c, d, a, d, b};
            memcpy(indices + n, two, sizeof two);
            n += 6;
        }
    rig_node(r, rig_mesh(r, positions, COUNT, indices, n), SHEARED);
    rig_sync(r);
    const float *m = SHEARED;
    const uint32_t count = 60000;
    struct hg_gpu_ray *rays = rig_rays(r, count);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t triangle = (uint32_t)rig_random(r, 0, n / 3 - 0.01) * 3;
        const float *a = positions + indices[triangle + i % 3] * 3;
        const float *b = positions + indices[triangle + (i + 1) % 3] * 3;
        const double s = i % 2 ? rig_random(r, 0.0, 1.0) : 0.0;
        double local[3], to[3];
        for (int c = 0; c < 3; c++)
            local[c] = a[c] + s * ((double)b[c] - a[c]);
        for (int c = 0; c < 3; c++)
            to[c] = m[c] * local[0] + m[4 + c] * local[1] + m[8 + c] * local[2];
        rays[i] = (struct hg_gpu_ray){.t_max = 1e30f, .mask = HG_RAY_ALL};
        for (int c = 0; c < 3; c++) {
            (&rays[i].origin_ws.x)[c] = m[12 + c] + 0.02f * (float)(c + 1);
            (&rays[i].direction_ws.x)[c] =
                (float)(to[c] + m[12 + c] - (double)(&rays[i].origin_ws.x)[c]);
        }
    }
    for (int coherent = 0; coherent < 2; coherent++) {
        const struct hg_gpu_hit *hits = rig_closest(r, count, coherent != 0);
        const uint32_t *blocked = rig_blocked(r, count, coherent != 0);
        uint32_t out = 0;
        for (uint32_t i = 0; i < count; i++)
            out += hits[i].draw == HG_HIT_NONE || blocked[i] == 0;
        // Whether edges are tight is the driver's matter there.
        assert_in_range(out, 0, backend == HG_TRACE_KHR ? count / 100 : 0);
    }
    rig_close(r);
}

// A million triangles in one place: no tree can part them.
static void coincident(void **state)
{
    (void)state;
    const uint32_t count = 1000000;
    const float triangle[] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
    uint32_t *indices = hg_calloc(count * 3ull, sizeof *indices);
    assert_non_null(indices);
    for (uint32_t i = 0; i < count * 3; i++)
        indices[i] = i % 3;
    struct rig *r = rig_open(backend);
    rig_node(r, rig_mesh(r, triangle, 3, indices, count * 3), NULL);
    hg_free(indices);
    const uint64_t start = hg_clock_now_ns();
    rig_sync(r);
    struct hg_gpu_ray *rays = rig_rays(r, 64);
    for (uint32_t i = 0; i < 64; i++)
        rays[i] = (struct hg_gpu_ray){.origin_ws = {0.01f * (float)i - 0.3f, -0.5f, 1},
            .direction_ws = {0, 0, -1},
            .t_max = 1e30f,
            .mask = HG_RAY_ALL};
    const struct hg_gpu_hit *hits = rig_closest(r, 64, false);
    for (uint32_t i = 0; i < 64; i++)
        assert_true(hits[i].draw != HG_HIT_NONE && fabsf(hits[i].t - 1.0f) < 1e-6f);
    assert_true(hg_clock_now_ns() - start < 120ull * 1000000000);
    rig_close(r);
}

// Which rays share a packet decides nothing but the time, up to the last bits of hits.
static void packets(void **state)
{
    (void)state;
    enum { COUNT = 30000 };
    struct rig *r = rig_open(backend);
    rig_node(r, rig_soup(r, 30000, 0.05), SHEARED);
    rig_sync(r);
    struct hg_gpu_ray *rays = rig_rays(r, COUNT);
    for (uint32_t i = 0; i < COUNT; i++)
        rays[i] = (struct hg_gpu_ray){.origin_ws = {0.1f, 0.2f, 3.0f},
            .direction_ws = {(float)(i % 200) * 0.006f - 0.6f, (float)(i / 200) * 0.008f - 0.6f,
                -2.5f},
            .t_max = 1e30f,
            .time = 1.0f,
            .mask = HG_RAY_ALL};
    struct hg_gpu_hit *alone = hg_calloc(COUNT, sizeof *alone);
    assert_non_null(alone);
    memcpy(alone, rig_closest(r, COUNT, false), COUNT * sizeof *alone);
    const struct hg_gpu_hit *hits = rig_closest(r, COUNT, true);
    const uint32_t *blocked = rig_blocked(r, COUNT, true);
    uint32_t others = 0, found = 0;
    for (uint32_t i = 0; i < COUNT; i++) {
        const bool hit = alone[i].draw != HG_HIT_NONE;
        found += hit;
        others += hit != (hits[i].draw != HG_HIT_NONE) || hit != (blocked[i] != 0) ||
                  (hit && (fabsf(hits[i].t - alone[i].t) > 1e-5f * alone[i].t ||
                              hits[i].primitive != alone[i].primitive));
    }
    assert_in_range(found, COUNT / 4, COUNT);
    assert_in_range(others, 0, 3);
    hg_free(alone);
    rig_close(r);
}

static bool is_untouched(const void *at, size_t size)
{
    const uint8_t *bytes = at;
    for (size_t i = 0; i < size; i++)
        if (bytes[i] != 0x55)
            return false;
    return true;
}

// A wave that names its rays: they hit what they hit in the whole, nothing is written for others.
static void lists(void **state)
{
    (void)state;
    enum { COUNT = 6000, FIRST = 7 };
    struct rig *r = rig_open(backend);
    rig_node(r, rig_soup(r, 2000, 0.4), NULL);
    rig_sync(r);
    rig_fill_rays(r, COUNT + FIRST);
    struct hg_gpu_hit *whole = hg_calloc(COUNT + FIRST, sizeof *whole);
    assert_non_null(whole);
    memcpy(whole, rig_closest(r, COUNT + FIRST, false), (COUNT + FIRST) * sizeof *whole);
    struct hg_gpu_buffer list = {0};
    rig_check(
        r, hg_gpu_buffer_create(r->gpu, HG_GPU_BUFFER_UPLOAD, COUNT * 4, "list", &list, &r->err));
    uint32_t *slots = list.mapped, count = 0, others[2] = {0};
    for (uint32_t i = 0; i < COUNT; i++) {
        slots[count] = i;
        count += i % 7 == 1 || i % 5 == 0;
    }
    for (int coherent = 0; coherent < 2; coherent++) {
        const struct hg_trace_wave wave = {.rays = &r->rays,
            .hits = &r->hits,
            .blocked = &r->blocked,
            .first_ray = FIRST,
            .first_hit = FIRST,
            .list = &list,
            .count = count,
            .coherent = coherent != 0};
        memset(r->hits.mapped, 0x55, (COUNT + FIRST) * sizeof *whole);
        memset(r->blocked.mapped, 0x55, (COUNT + FIRST) * 4);
        rig_check(r, hg_trace_closest(r->trace, &wave, &r->err));
        rig_check(r, hg_trace_blocked(r->trace, &wave, &r->err));
        const struct hg_gpu_hit *hits = (const struct hg_gpu_hit *)r->hits.mapped + FIRST;
        const uint32_t *blocked = (const uint32_t *)r->blocked.mapped + FIRST;
        for (uint32_t i = 0, at = 0; i < COUNT; i++) {
            if (at == count || slots[at] != i) {
                assert_true(is_untouched(&hits[i], sizeof *hits));
                assert_true(is_untouched(&blocked[i], sizeof *blocked));
                continue;
            }
            at++;
            const struct hg_gpu_hit *in = &whole[i + FIRST];
            const bool hit = in->draw != HG_HIT_NONE;
            others[coherent] += hit != (hits[i].draw != HG_HIT_NONE) || hit != (blocked[i] != 0) ||
                                (hit && hits[i].primitive != in->primitive);
        }
    }
    assert_int_equal(others[0], 0);
    assert_in_range(others[1], 0, 3);
    hg_gpu_buffer_destroy(r->gpu, &list);
    hg_free(whole);
    rig_close(r);
}

// The same bytes for any number of threads, of the jobs that trace.
static void threads(void **state)
{
    (void)state;
    enum { COUNT = 20000 };
    struct rig *r = rig_open(backend);
    struct hg_mesh *mesh = rig_soup(r, 40000, 0.05);
    rig_node(r, mesh, NULL);
    rig_node(r, mesh, MIRRORED);
    rig_node(r, rig_soup(r, 5000, 0.05), NULL);
    rig_sync(r);
    rig_fill_rays(r, COUNT);
    struct hg_gpu_hit *first = hg_calloc(COUNT, sizeof *first);
    assert_non_null(first);
    memcpy(first, rig_closest(r, COUNT, false), COUNT * sizeof *first);
    for (unsigned n = 1; n <= 5; n += 2) {
        hg_trace_destroy(r->trace);
        hg_jobs_destroy(r->jobs);
        r->trace = NULL;
        r->jobs = hg_jobs_create(n);
        assert_non_null(r->jobs);
        rig_sync(r);
        const struct hg_gpu_hit *hits = rig_closest(r, COUNT, false);
        for (uint32_t i = 0; i < COUNT; i++) {
            assert_int_equal(hits[i].draw, first[i].draw);
            if (hits[i].draw != HG_HIT_NONE)
                assert_memory_equal(&hits[i], &first[i], sizeof *first);
        }
    }
    hg_free(first);
    rig_close(r);
}

// What moves is brought up to date, what stays is kept.
static void changes(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    struct hg_mesh *mesh = rig_soup(r, 30000, 0.03);
    struct hg_node *still = rig_node(r, mesh, NULL);
    struct hg_node *node = rig_node(r, rig_soup(r, 300, 0.3), NULL);
    rig_node(r, mesh, SHEARED);
    rig_node(r, mesh, MIRRORED);
    rig_sync(r);
    for (int i = 0; i < 4; i++) {
        node->translation[0] += 0.2f;
        hg_scene_touch(r->scene, &node->head);
        if (i == 2)
            still->visible = false;
        hg_scene_touch(r->scene, &still->head);
        rig_sync(r);
        rig_fill_rays(r, 200);
        if (i == 2)
            continue; // the reference knows nothing of what is not visible
        if (i == 3) {
            still->visible = true;
            hg_scene_touch(r->scene, &still->head);
            rig_sync(r);
        }
        assert_in_range(rig_compare(r, 200, i % 2 == 0), 0, 3);
    }
    rig_close(r);
}

static void budget(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    rig_node(r, rig_soup(r, 100000, 0.1), NULL);
    assert_int_equal(rig_try(r, 1 << 20), HG_E_LIMIT);
    assert_int_equal(r->err.status, HG_E_LIMIT);
    struct hg_trace_wave wave = {.rays = &r->rays, .hits = &r->hits, .count = 1};
    rig_fill_rays(r, 10);
    assert_int_equal(hg_trace_closest(r->trace, &wave, &r->err), HG_E_STATE);
    hg_trace_destroy(r->trace);
    r->trace = NULL;
    rig_check(r, rig_try(r, 64 << 20));
    struct hg_trace_stats stats;
    hg_trace_stats(r->trace, &stats);
    assert_int_equal(stats.triangles, 100000);
    assert_in_range(stats.peak_bytes, stats.bytes, 64 << 20);
    assert_in_range(stats.bytes, 100000 * 12, 64 << 20);
    assert_in_range(rig_compare(r, 10, false), 0, 1);
    rig_close(r);
}

// Where the device has no ray queries the backend says so, and the automatic choice goes by it.
static void refused(void **state)
{
    (void)state;
    struct rig *r = rig_open(HG_TRACE_AUTO);
    const struct hg_trace_params params = {.backend = HG_TRACE_KHR, .jobs = r->jobs};
    assert_int_equal(hg_trace_create(r->gpu, &params, &r->trace, &r->err), HG_E_DEVICE);
    assert_null(r->trace);
    assert_non_null(strstr(r->err.reason, "VK_KHR_ray_query"));
    rig_node(r, rig_soup(r, 600, 0.3), NULL);
    rig_sync(r);
    assert_true(hg_trace_backend(r->trace) != HG_TRACE_KHR);
    rig_fill_rays(r, 100);
    assert_in_range(rig_compare(r, 100, false), 0, 1);
    rig_close(r);
}

int main(int argc, char **argv)
{
    backend = rig_backend(argc, argv);
    if (backend == HG_TRACE_AUTO)
        return 2;
    const struct CMUnitTest refusal[] = {cmocka_unit_test(refused)};
    if (backend == HG_TRACE_KHR && !rig_has_ray_query()) {
        printf("no ray queries on this device: only that they are refused is tested\n");
        return cmocka_run_group_tests(refusal, NULL, NULL);
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(soup),
        cmocka_unit_test(instances),
        cmocka_unit_test(masks),
        cmocka_unit_test(interval),
        cmocka_unit_test(hostile),
        cmocka_unit_test(wild),
        cmocka_unit_test(empty),
        cmocka_unit_test(closed),
        cmocka_unit_test(coincident),
        cmocka_unit_test(packets),
        cmocka_unit_test(lists),
        cmocka_unit_test(threads),
        cmocka_unit_test(changes),
        cmocka_unit_test(budget),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
