// lights.c - punctual lights against hand-computed illuminance, clusters against plain loops, the
// plan of shadow maps.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/light/cluster.h"
#include "renderer/light/light_cut.h"
#include "renderer/light/shadow/shadow_plan.h"
#include "renderer/light/shadow/shadow_sight.h"
#include "tests/analytic/probe.h"

static struct hg_light *add_light(struct probe *probe, uint64_t id, const float at[3])
{
    struct hg_object *light, *node;
    assert_int_equal(hg_scene_add(probe->scene, HG_OBJECT_LIGHT, id, &light), HG_OK);
    assert_int_equal(hg_scene_add(probe->scene, HG_OBJECT_NODE, id, &node), HG_OK);
    struct hg_node *n = (struct hg_node *)node;
    n->light = (struct hg_light *)light;
    memcpy(n->translation, at, sizeof n->translation);
    n->light->color[0] = n->light->color[1] = n->light->color[2] = 1;
    return n->light;
}

static void clear(struct probe *probe, uint64_t count)
{
    struct hg_error err = {0};
    for (uint64_t id = 1; id <= count; id++) {
        assert_int_equal(hg_scene_remove(probe->scene, HG_OBJECT_NODE, id, &err), HG_OK);
        assert_int_equal(hg_scene_remove(probe->scene, HG_OBJECT_LIGHT, id, &err), HG_OK);
    }
}

// Lights shine along -z of their node: the directional and the spot light here look from (0, 0, 2)
// towards the origin.
static void test_illuminance(void **state)
{
    struct probe *probe = *state;
    const float at[3] = {0, 0, 2};
    struct hg_light *sun = add_light(probe, 1, at);
    sun->kind = HG_LIGHT_DIRECTIONAL;
    sun->intensity = 3;
    struct hg_light *point = add_light(probe, 2, at);
    point->kind = HG_LIGHT_POINT;
    point->intensity = 8;
    struct hg_light *ranged = add_light(probe, 3, at);
    ranged->kind = HG_LIGHT_POINT;
    ranged->intensity = 8;
    ranged->range = 4;
    struct hg_light *spot = add_light(probe, 4, at);
    spot->kind = HG_LIGHT_SPOT;
    spot->intensity = 8;
    spot->inner_cone_rad = 0.3f;
    spot->outer_cone_rad = 0.6f;
    probe_sync(probe);
    assert_int_equal(probe->block.light_count, 4);
    assert_int_equal(probe->block.global_count, 3); // sun, point and spot without range

    struct hg_vec4 in[20] = {{0, 0, 0, 0}}, out[10];
    // Order on the device: sun, point, spot, ranged.
    const struct hg_vec4 at_light[10] = {{5, 3, -7, 0}, {0, 0, 0, 1}, {0, 0, -4, 1}, {3, 0, 2, 1},
        {0, 0, 0, 3}, {0, 0, -2, 3}, {0, 0, 0, 2}, {0.4f, 0, 0, 2}, {2, 0, 0, 2}, {0, 0, 4, 2}};
    for (int i = 0; i < 10; i++)
        in[2 * i] = at_light[i];
    probe_run(probe, PROBE_ILLUMINANCE, 10, in, out);
    probe_near(out[0].x, 3, 0);          // lux, everywhere
    probe_near(out[1].x, 8.0 / 4, 1e-5); // candela / d^2
    probe_near(out[2].x, 8.0 / 36, 1e-6);
    probe_near(out[3].x, 8.0 / 9, 1e-6);
    probe_near(out[4].x, 8.0 / 4 * (1 - 1.0 / 16), 1e-5); // window 1 - (d / range)^4
    probe_near(out[5].x, 0, 0);                           // at the range: nothing
    probe_near(out[6].x, 8.0 / 4, 1e-5);                  // on the axis: the full intensity
    double d2 = 4.16, c = 2 / sqrt(d2), scale = 1 / (cos(0.3) - cos(0.6));
    probe_near(out[7].x, 8 / d2 * pow(fmin((c - cos(0.6)) * scale, 1), 2), 1e-4);
    probe_near(out[8].x, 0, 0); // 45 degrees off the axis: outside the cone
    probe_near(out[9].x, 0, 0); // behind
    clear(probe, 4);
}

// Pixels come out the same, bit for bit, with lists and with a loop over all lights.
static void test_clusters_change_nothing(void **state)
{
    enum { LIGHTS = 400, POINTS = 4096 };
    static struct hg_vec4 in[2 * POINTS], with[POINTS], without[POINTS];
    struct probe *probe = *state;
    srand(7);
    for (uint64_t id = 1; id <= LIGHTS; id++) {
        const float at[3] = {(float)(rand() % 2001 - 1000) * 0.02f,
            (float)(rand() % 2001 - 1000) * 0.02f, (float)(rand() % 1000) * -0.05f + 5};
        struct hg_light *light = add_light(probe, id, at);
        light->kind = id % 3 ? HG_LIGHT_POINT : HG_LIGHT_SPOT;
        light->inner_cone_rad = 0.2f;
        light->outer_cone_rad = 0.9f;
        light->intensity = 1 + (float)(id % 5);
        light->range = 1 + (float)(id % 40) * 0.2f;
        light->casts_shadow = false;
    }
    probe_sync(probe);
    assert_int_equal(probe->block.clustered, 1);
    for (int i = 0; i < POINTS; i++) {
        float px = (float)(rand() % 5120) * 0.1f, py = (float)(rand() % 5120) * 0.1f;
        float depth = exp2f((float)(rand() % 800) * 0.01f - 3.5f);
        in[2 * i] = (struct hg_vec4){(px / 256 - 1) * depth, (1 - py / 256) * depth, -depth, 0};
        in[2 * i + 1] = (struct hg_vec4){px, py, depth, 0};
    }
    probe_run(probe, PROBE_LIGHTS, POINTS, in, with);
    probe->block.clustered = 0;
    probe_run(probe, PROBE_LIGHTS, POINTS, in, without);
    int lit = 0;
    for (int i = 0; i < POINTS; i++)
        lit += without[i].x > 0;
    print_message("clusters: %d of %d points are lit\n", lit, POINTS);
    assert_true(lit > POINTS / 10);
    assert_memory_equal(with, without, sizeof with);
    clear(probe, LIGHTS);
}

// --- many lamps ----------------------------------------------------------------------------------

// Lamps without a range, of all kinds that have a place, in a box of 8 x 6 x 8 m before the camera.
static void add_lamps(struct probe *probe, uint32_t count)
{
    static const uint32_t kinds[] = {
        HG_LIGHT_POINT, HG_LIGHT_POINT, HG_LIGHT_SPOT, HG_LIGHT_RECTANGLE, HG_LIGHT_TUBE};
    srand(11);
    for (uint64_t id = 1; id <= count; id++) {
        const float at[3] = {(float)(rand() % 8001 - 4000) * 0.001f,
            (float)(rand() % 6001 - 3000) * 0.001f, -1 - (float)(rand() % 8000) * 0.001f};
        struct hg_light *light = add_light(probe, id, at);
        light->kind = kinds[rand() % 5]; // HG_LIGHT_*
        light->intensity = (float)(1 + rand() % 5) / (float)count;
        light->outer_cone_rad = 0.8f;
        light->inner_cone_rad = 0.3f;
        light->width = light->height = 0.05f;
        light->radius = light->kind == HG_LIGHT_TUBE ? 0.02f : 0;
        light->casts_shadow = false;
    }
}

// Up to HG_CLUSTER_MOST_MEAN lamps are looped over: the sum of all is that of its parts.
static void sum_of_parts(struct probe *probe, uint32_t count, uint32_t points,
    const struct hg_vec4 *in, struct hg_vec4 *sum)
{
    float *intensity = hg_calloc(count + 1, sizeof *intensity);
    struct hg_vec4 *part = hg_calloc(points, sizeof *part);
    assert_true(intensity && part);
    for (uint64_t id = 1; id <= count; id++) {
        struct hg_light *light =
            (struct hg_light *)hg_scene_find(probe->scene, HG_OBJECT_LIGHT, id);
        intensity[id] = light->intensity;
        light->intensity = 0;
    }
    for (uint32_t first = 1; first <= count; first += HG_CLUSTER_MOST_MEAN) {
        for (uint32_t pass = 0; pass < 2; pass++) {
            for (uint32_t id = first; id < first + HG_CLUSTER_MOST_MEAN && id <= count; id++) {
                struct hg_object *light = hg_scene_find(probe->scene, HG_OBJECT_LIGHT, id);
                ((struct hg_light *)light)->intensity = pass == 0 ? intensity[id] : 0;
            }
            if (pass > 0)
                continue;
            probe_sync(probe);
            assert_int_equal(probe->block.clustered, 0);
            probe_run(probe, PROBE_LIGHTS, points, in, part);
            for (uint32_t i = 0; i < points; i++)
                sum[i].x += part[i].x;
        }
    }
    for (uint64_t id = 1; id <= count; id++)
        ((struct hg_light *)hg_scene_find(probe->scene, HG_OBJECT_LIGHT, id))->intensity =
            intensity[id];
    hg_free(intensity);
    hg_free(part);
}

// A cut has the light of all lamps to within its error, in lists that are bounded.
static void test_cuts(void **state)
{
    enum { LAMPS = 1000, POINTS = 2048 };
    static struct hg_vec4 in[2 * POINTS], cut[POINTS], exact[POINTS];
    struct probe *probe = *state;
    const struct hg_lighting_view before = probe->view;
    memcpy(probe->view.bounds_min, (float[3]){-5, -4, -10}, sizeof(float[3]));
    memcpy(probe->view.bounds_max, (float[3]){5, 4, -0.5f}, sizeof(float[3]));
    add_lamps(probe, LAMPS);
    for (int i = 0; i < POINTS; i++) {
        const float depth = 1 + (float)(rand() % 8000) * 0.001f;
        const float px = (float)(rand() % 5120) * 0.1f, py = (float)(rand() % 5120) * 0.1f;
        in[2 * i] = (struct hg_vec4){(px / 256 - 1) * depth, (1 - py / 256) * depth, -depth, 0};
        in[2 * i + 1] = (struct hg_vec4){px, py, depth, 0};
    }
    probe_sync(probe);
    struct hg_lighting_stats stats;
    hg_lighting_stats(probe->lighting, &stats);
    assert_int_equal(probe->block.clustered, 1);
    assert_int_equal(stats.lights, LAMPS);
    assert_true(stats.cluster_entries <= HG_CLUSTER_COUNT * HG_LIGHT_CUT_MOST);
    probe_run(probe, PROBE_LIGHTS, POINTS, in, cut);
    sum_of_parts(probe, LAMPS, POINTS, in, exact);
    double of_cut = 0, of_all = 0, apart = 0, worst = 0;
    for (int i = 0; i < POINTS; i++) {
        const double error = fabs((double)(cut[i].x - exact[i].x));
        of_cut += (double)cut[i].x;
        of_all += (double)exact[i].x;
        apart += error;
        worst = fmax(worst, error / (double)exact[i].x);
    }
    print_message(
        "cuts: %.1f lights a cell, %u of %u; sum %+.2f %%, mean error %.2f %%, worst of a point "
        "%.0f %%\n",
        (double)stats.cluster_entries / HG_CLUSTER_COUNT, stats.lights_in_lists, LAMPS,
        100 * (of_cut / of_all - 1), 100 * apart / of_all, 100 * worst);
    assert_true(fabs(of_cut / of_all - 1) < 0.01);
    assert_true(apart / of_all < 0.05);
    clear(probe, LAMPS);
    probe->view = before;
}

// --- shadow maps ---------------------------------------------------------------------------------

static bool overlap(const struct hg_gpu_shadow *a, const struct hg_gpu_shadow *b)
{
    return a->rect_px.x < b->rect_px.x + b->size_px && b->rect_px.x < a->rect_px.x + a->size_px &&
           a->rect_px.y < b->rect_px.y + b->size_px && b->rect_px.y < a->rect_px.y + a->size_px;
}

// Squares of the atlas never overlap nor leave it; what has no room is counted.
static void test_atlas(void **state)
{
    struct probe *probe = *state;
    for (uint64_t id = 1; id <= 90; id++) {
        const float at[3] = {(float)id * 0.1f, 1, 0};
        struct hg_light *light = add_light(probe, id, at);
        light->kind = id == 1 ? HG_LIGHT_DIRECTIONAL : id % 2 ? HG_LIGHT_SPOT : HG_LIGHT_POINT;
        light->outer_cone_rad = 0.7f;
        light->intensity = 10;
        light->casts_shadow = true;
    }
    uint32_t last = 0;
    for (uint32_t limit = 8192; limit >= 512; limit /= 2) {
        struct hg_light_set lights = {0};
        struct hg_shadow_plan plan = {0};
        hg_scene_update(probe->scene);
        assert_int_equal(hg_light_set_collect(&lights, probe->scene, (double[3]){0, 0, 0}), HG_OK);
        assert_int_equal(hg_shadow_plan_make(&plan, &lights, &probe->view, limit), HG_OK);
        assert_int_equal(plan.shadowed_lights + plan.unshadowed_lights, 90);
        assert_true(plan.count > 0 && plan.atlas_px <= limit);
        assert_true(!last || plan.shadowed_lights <= last);
        assert_true(lights.items[0].shadow != HG_SHADOW_NONE); // the sun goes first
        last = plan.shadowed_lights;
        for (uint32_t i = 0; i < plan.count; i++) {
            const struct hg_gpu_shadow *s = &plan.maps[i].gpu;
            assert_true(s->rect_px.x + s->size_px <= (float)plan.atlas_px);
            assert_true(s->rect_px.y + s->size_px <= (float)plan.atlas_px);
            for (uint32_t k = 0; k < i; k++)
                assert_false(overlap(s, &plan.maps[k].gpu));
        }
        hg_shadow_plan_finish(&plan);
        hg_light_set_finish(&lights);
    }
    clear(probe, 90);
}

// Lamps beside a sun take nothing of its finer cascades while there is room for smaller lamps.
static void test_lamps_leave_cascades(void **state)
{
    struct probe *probe = *state;
    const float far_max[3] = {300, 30, 300}, far_min[3] = {-300, 0, -300};
    const struct hg_lighting_view before = probe->view;
    float finest[2] = {0};
    memcpy(probe->view.bounds_min, far_min, sizeof far_min);
    memcpy(probe->view.bounds_max, far_max, sizeof far_max);
    for (uint32_t lamps = 0; lamps <= 6; lamps += 6) {
        for (uint64_t id = 1; id <= 1 + lamps; id++) {
            struct hg_light *light = add_light(probe, id, (float[3]){(float)id, 1, 0});
            light->kind = id == 1 ? HG_LIGHT_DIRECTIONAL : HG_LIGHT_POINT;
            light->intensity = 10;
            light->casts_shadow = true;
        }
        struct hg_light_set lights = {0};
        struct hg_shadow_plan plan = {0};
        hg_scene_update(probe->scene);
        assert_int_equal(hg_light_set_collect(&lights, probe->scene, (double[3]){0, 0, 0}), HG_OK);
        assert_int_equal(hg_shadow_plan_make(&plan, &lights, &probe->view, 4096), HG_OK);
        assert_int_equal(plan.shadowed_lights, 1 + lamps);
        const struct hg_shadow_map *maps = plan.maps + lights.items[0].shadow;
        const uint32_t count = lights.items[0].shadow_count;
        assert_true(count > 2 && maps[0].refines && !maps[count - 1].refines);
        finest[lamps > 0] = maps[0].gpu.size_px;
        assert_true(maps[count - 1].gpu.size_px >= 1024.0f);
        hg_shadow_plan_finish(&plan);
        hg_light_set_finish(&lights);
        clear(probe, 1 + lamps);
    }
    assert_float_equal(finest[0], HG_SHADOW_SUN_SIDE_PX, 0);
    assert_float_equal(finest[1], finest[0], 0);
    probe->view = before;
}

static void plan_at(struct probe *probe, const float eye[3], struct hg_light_set *lights,
    struct hg_shadow_plan *plan)
{
    memcpy(&probe->camera.eye_ws, eye, sizeof(float[3]));
    assert_int_equal(hg_light_set_collect(lights, probe->scene, (double[3]){0, 0, 0}), HG_OK);
    assert_int_equal(hg_shadow_plan_make(plan, lights, &probe->view, 4096), HG_OK);
}

// Of many lamps those next to the eye have maps, whichever they are in the scene, and the last ones
// are faint; what a step of the camera leaves in the plan stays in its place.
static void test_shadows_among_many(void **state)
{
    enum { LAMPS = 1200 };
    struct probe *probe = *state;
    const struct hg_vec3 eye = probe->camera.eye_ws;
    for (uint64_t id = 1; id <= LAMPS; id++) { // on a line, the nearest one last
        struct hg_light *light = add_light(probe, id, (float[3]){0.2f * (float)(LAMPS - id), 1, 0});
        light->kind = HG_LIGHT_POINT;
        light->intensity = 10;
        light->casts_shadow = true;
    }
    hg_scene_update(probe->scene);
    struct hg_light_set lights = {0}, after = {0};
    struct hg_shadow_plan plan = {0}, next = {0};
    plan_at(probe, (float[3]){0, 0, 0}, &lights, &plan);
    assert_true(plan.shadowed_lights > 100 && plan.unshadowed_lights > 0);
    assert_int_equal(plan.shadowed_lights + plan.unshadowed_lights, LAMPS);
    for (uint32_t i = 0; i < LAMPS; i++) {
        const struct hg_gpu_light *light = &lights.items[i];
        assert_int_equal(light->shadow != HG_SHADOW_NONE, i >= LAMPS - plan.shadowed_lights);
        if (i > LAMPS - plan.shadowed_lights)
            assert_true(light->shadow_fade <= lights.items[i - 1].shadow_fade ||
                        lights.items[i - 1].shadow == HG_SHADOW_NONE);
    }
    assert_true(lights.items[LAMPS - plan.shadowed_lights].shadow_fade > 0.9f);
    assert_float_equal(lights.items[LAMPS - 1].shadow_fade, 0, 0);

    plan_at(probe, (float[3]){20, 0, 0}, &after, &next);
    assert_int_equal(hg_shadow_plan_keep(&next, &plan, 4096), HG_OK);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < next.count; i++) {
        for (uint32_t k = 0; k < plan.count; k++)
            kept += memcmp(&next.maps[i].gpu, &plan.maps[k].gpu, sizeof plan.maps[k].gpu) == 0;
        for (uint32_t k = 0; k < i; k++)
            assert_false(overlap(&next.maps[i].gpu, &next.maps[k].gpu));
    }
    print_message("of %u maps %u stay after a step past some of 170 lamps\n", next.count, kept);
    assert_true(kept >= next.count - 6 * 26 && kept < next.count);
    hg_shadow_plan_finish(&plan);
    hg_shadow_plan_finish(&next);
    hg_light_set_finish(&lights);
    hg_light_set_finish(&after);
    probe->camera.eye_ws = eye;
    clear(probe, LAMPS);
}

// A plan follows from its inputs alone and is made again only when they change.
static void test_maps_are_kept(void **state)
{
    struct probe *probe = *state;
    const float at[3] = {0, 0, 0};
    struct hg_light *sun = add_light(probe, 1, at);
    struct hg_lighting_stats stats;
    sun->kind = HG_LIGHT_DIRECTIONAL;
    sun->intensity = 1;
    sun->casts_shadow = true;
    probe->view.shape_revision = 5;
    probe_sync(probe);
    hg_lighting_stats(probe->lighting, &stats);
    assert_true(stats.shadow_maps > 0);
    assert_int_equal(stats.shadow_maps_stale, stats.shadow_maps);
    uint32_t count;
    struct hg_shadow_map *maps = hg_lighting_shadow_maps(probe->lighting, &count);
    for (uint32_t i = 0; i < count; i++)
        maps[i].stale = false; // as passes/shadow.c does
    probe_sync(probe);
    hg_lighting_stats(probe->lighting, &stats);
    assert_int_equal(stats.shadow_maps_stale, 0);
    probe->view.shape_revision = 6;
    probe_sync(probe);
    hg_lighting_stats(probe->lighting, &stats);
    assert_int_equal(stats.shadow_maps_stale, stats.shadow_maps);
    clear(probe, 1);
}

// Where not all lamps have room, those whose light the camera sees come first, whatever they are
// next to; maps that shadow nothing in sight are not drawn.
static void test_shadows_in_sight(void **state)
{
    enum { LAMPS = 300 };
    struct probe *probe = *state;
    for (uint64_t id = 1; id <= LAMPS; id++) { // every third before the camera, farther away
        const float z = id % 3 == 0 ? -6 - 0.01f * (float)id : 1.5f + 0.001f * (float)id;
        struct hg_light *light = add_light(probe, id, (float[3]){0.01f * (float)id - 1, 0, z});
        light->kind = HG_LIGHT_POINT;
        light->intensity = 10;
        light->range = 1;
        light->casts_shadow = true;
    }
    hg_scene_update(probe->scene);
    struct hg_light_set lights = {0};
    struct hg_shadow_plan plan = {0};
    plan_at(probe, (float[3]){0, 0, 0}, &lights, &plan);
    assert_true(plan.unshadowed_lights > 0);
    for (uint32_t i = 0; i < LAMPS; i++)
        if (lights.items[i].position_ws.z < 0) {
            assert_int_not_equal(lights.items[i].shadow, HG_SHADOW_NONE);
            assert_float_equal(lights.items[i].shadow_fade, 0, 0);
        }
    hg_shadow_plan_finish(&plan);
    hg_light_set_finish(&lights);

    struct hg_lighting_stats stats;
    probe_sync(probe);
    hg_lighting_stats(probe->lighting, &stats);
    print_message(
        "in sight: %u of %u maps are drawn\n", stats.shadow_maps_stale, stats.shadow_maps);
    assert_true(stats.shadow_maps_unseen > stats.shadow_maps / 3);
    assert_int_equal(stats.shadow_maps_stale + stats.shadow_maps_unseen, stats.shadow_maps);
    assert_true(stats.shadow_maps_stale >= LAMPS / 3); // a face of each, at least
    clear(probe, LAMPS);
}

// A million lamps: a bounded number of maps, which go to lamps before the
// eye, and lists of bounded length.
static void test_million(void **state)
{
    enum { LAMPS = 1000000 };
    struct probe *probe = *state;
    struct hg_light_set lights = {.count = LAMPS, .global_count = LAMPS};
    struct hg_shadow_plan plan = {0};
    struct hg_clusters cells = {0};
    struct hg_light_cuts cuts = {0};
    lights.items = hg_calloc(LAMPS, sizeof *lights.items);
    lights.casts = hg_calloc(LAMPS, sizeof *lights.casts);
    assert_true(lights.items && lights.casts);
    for (uint32_t i = 0; i < LAMPS; i++) { // behind the eye, but for every hundredth
        const float far = 1 + (float)(i % 997) * 0.1f, z = i % 100 == 0 ? -far : 0.1f * far;
        lights.casts[i] = true;
        lights.items[i] = (struct hg_gpu_light){.kind = HG_LIGHT_KIND_POINT,
            .position_ws = {(float)(i % 101) * 0.01f, 0, z},
            .direction_ws = {0, 0, -1},
            .inv_range_sq = i % 100 == 0 ? 1 : 1e4f, // 1 m; 1 cm, which does not get to the eye
            .color = {1, 1, 1},
            .shadow = HG_SHADOW_NONE};
    }
    assert_int_equal(hg_shadow_plan_make(&plan, &lights, &probe->view, 4096), HG_OK);
    print_message("of a million lamps %u have %u maps\n", plan.shadowed_lights, plan.count);
    assert_true(plan.shadowed_lights > 100 && plan.count <= 256 * 6 && plan.atlas_px <= 4096);
    assert_int_equal(plan.shadowed_lights + plan.unshadowed_lights, LAMPS);
    for (uint32_t i = 0; i < LAMPS; i++)
        assert_true(lights.items[i].shadow == HG_SHADOW_NONE || i % 100 == 0);
    lights.global_count = 0; // all have a range
    assert_int_equal(
        hg_clusters_build(&cells, &lights, &probe->camera, probe->view.width, probe->view.height),
        HG_OK);
    assert_true(cells.overflow || cells.entry_count <= HG_CLUSTER_MOST_ENTRIES);
    for (uint32_t i = 0; i < LAMPS; i++) // now all reach everything
        lights.items[i].inv_range_sq = 0;
    lights.global_count = LAMPS;
    assert_int_equal(
        hg_clusters_build(&cells, &lights, &probe->camera, probe->view.width, probe->view.height),
        HG_OK);
    assert_true(cells.overflow);
    assert_int_equal(hg_light_cuts_build(&cuts, &cells, &lights, &probe->view, probe->jobs), HG_OK);
    assert_true(cells.entry_count <= HG_CLUSTER_COUNT * HG_LIGHT_CUT_MOST);
    assert_true(cuts.count <= cells.entry_count);
    hg_light_cuts_finish(&cuts);
    hg_clusters_finish(&cells);
    hg_shadow_plan_finish(&plan);
    hg_light_set_finish(&lights);
}

// Lamps without a place light nothing, have no map, and no cell is looked for them.
static void test_nowhere(void **state)
{
    enum { LAMPS = 24 };
    struct probe *probe = *state;
    for (uint64_t id = 1; id <= LAMPS; id++) {
        const float places[3] = {id % 4 == 1   ? NAN
                                 : id % 4 == 2 ? INFINITY
                                               : 0,
            0, id % 4 == 3 ? 3e38f : -3};
        struct hg_light *light = add_light(probe, id, places);
        light->kind = id == 24      ? HG_LIGHT_DIRECTIONAL
                      : id % 3 == 0 ? HG_LIGHT_SPOT
                                    : HG_LIGHT_POINT;
        light->outer_cone_rad = 0.5f;
        light->intensity = id % 8 == 0 ? INFINITY : 10;
        light->range = 2;
        light->casts_shadow = true;
    }
    probe_sync(probe);
    struct hg_lighting_stats stats;
    hg_lighting_stats(probe->lighting, &stats);
    assert_int_equal(stats.lights, LAMPS);
    const struct hg_vec4 in[2] = {{0, -1, -3, 0}, {256, 384, 3, 0}};
    struct hg_vec4 out;
    probe_run(probe, PROBE_LIGHTS, 1, in, &out);
    assert_true(isfinite(out.x) && out.x > 0);
    clear(probe, LAMPS);
}

// Spots: by the cone of their light. A map looks one way.
static void test_sight_of_cones(void **state)
{
    struct probe *probe = *state;
    const struct hg_shadow_sight sight = hg_shadow_sight_make(&probe->camera);
    struct hg_gpu_light spot = {.kind = HG_LIGHT_KIND_SPOT,
        .position_ws = {0, 0, 3},
        .direction_ws = {0, 0, 1},
        .spot_scale = 10,
        .spot_offset = -9};                                 // 26 degrees about its axis
    assert_false(hg_shadow_sight_has_light(&sight, &spot)); // behind, and looks away
    spot.direction_ws.z = -1;
    assert_true(hg_shadow_sight_has_light(&sight, &spot));
    spot.inv_range_sq = 1.0f / 4; // 2 m do not get to the eye
    assert_false(hg_shadow_sight_has_light(&sight, &spot));
    spot.position_ws.z = 1.9f;
    assert_true(hg_shadow_sight_has_light(&sight, &spot));
    struct hg_gpu_light panel = {.kind = HG_LIGHT_KIND_RECTANGLE,
        .position_ws = {0, 0, 1},
        .direction_ws = {0, 0, 1},
        .bound = 0.5f};
    assert_false(hg_shadow_sight_has_light(&sight, &panel)); // behind, and shines away
    panel.direction_ws = (struct hg_vec3){1, 0, 0};
    assert_true(hg_shadow_sight_has_light(&sight, &panel)); // half of its light goes forward
    const struct hg_gpu_light lamp = {.kind = HG_LIGHT_KIND_POINT, .position_ws = {0, 0, 3}};
    struct hg_shadow_map away = {.gpu = {.right_ws = {1, 0, 0},
                                     .up_ws = {0, 1, 0},
                                     .forward_ws = {0, 0, 1},
                                     .extent = 1,
                                     .scale = 1}},
                         towards = away;
    towards.gpu.forward_ws.z = -1;
    assert_false(hg_shadow_sight_has_map(&sight, &lamp, &away));
    assert_true(hg_shadow_sight_has_map(&sight, &lamp, &towards));
}

// With pages a sun has one map and a pool, lamps beside it what they have at rest.
static void test_pool(void **state)
{
    struct probe *probe = *state;
    const struct hg_lighting_view before = probe->view;
    float lamp_px[2] = {0};
    memcpy(probe->view.bounds_min, (float[3]){-300, 0, -300}, sizeof(float[3]));
    memcpy(probe->view.bounds_max, (float[3]){300, 30, 300}, sizeof(float[3]));
    for (uint64_t id = 1; id <= 3; id++) {
        struct hg_light *light = add_light(probe, id, (float[3]){(float)id, 1, -3});
        light->kind = id == 3 ? HG_LIGHT_POINT : HG_LIGHT_DIRECTIONAL;
        light->intensity = 10;
        light->casts_shadow = true;
    }
    hg_scene_update(probe->scene);
    for (uint32_t paged = 0; paged < 2; paged++) {
        struct hg_light_set lights = {0};
        struct hg_shadow_plan plan = {0};
        probe->view.paging = paged ? HG_PAGING_ON : HG_PAGING_OFF;
        plan_at(probe, (float[3]){0, 1, 0}, &lights, &plan);
        assert_int_equal(plan.paged, paged);
        assert_int_equal(plan.shadowed_lights, 3);
        lamp_px[paged] = plan.maps[lights.items[2].shadow].gpu.size_px;
        if (paged) {
            assert_int_equal(lights.items[0].shadow, plan.pool);
            assert_int_equal(lights.items[0].shadow_count, 2);
            assert_true(plan.maps[plan.pool].gpu.size_px >= 1024.0f);
            assert_true(lights.items[1].shadow_count > 2); // one sun alone
        }
        for (uint32_t i = 0; i < plan.count; i++)
            for (uint32_t k = 0; k < i; k++)
                assert_false(overlap(&plan.maps[i].gpu, &plan.maps[k].gpu));
        hg_shadow_plan_finish(&plan);
        hg_light_set_finish(&lights);
    }
    assert_float_equal(lamp_px[0], lamp_px[1], 0);
    clear(probe, 3);
    probe->view = before;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_illuminance),
        cmocka_unit_test(test_clusters_change_nothing),
        cmocka_unit_test(test_cuts),
        cmocka_unit_test(test_atlas),
        cmocka_unit_test(test_lamps_leave_cascades),
        cmocka_unit_test(test_shadows_among_many),
        cmocka_unit_test(test_maps_are_kept),
        cmocka_unit_test(test_shadows_in_sight),
        cmocka_unit_test(test_million),
        cmocka_unit_test(test_nowhere),
        cmocka_unit_test(test_sight_of_cones),
        cmocka_unit_test(test_pool),
    };
    return cmocka_run_group_tests(tests, probe_setup, probe_teardown);
}
