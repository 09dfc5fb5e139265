// emitters.c - next-event sampling (lib/emitters.glsl, renderer/light/emitters.h) against closed
// forms and sums over all lights, on the device. Scenes have nothing that could be in the way.
#include "tests/analytic/probe.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/light/emitters.h"
#include "renderer/light/light_tree.h"
#include "renderer/light/lights.h"
#include "shaders/shared/features.h"
#include "tests/support/check.h"

#define PI    3.14159265358979323846
#define GROUP 32
#define PICKS 64 // per invocation

enum op { OP_ESTIMATE, OP_ONE, OP_UNIFORM, OP_CHANCE, OP_ENVIRONMENT };

// One emissive mesh, by hand: a draw, an instance, a part and a material each.
struct mesh {
    uint32_t vertices, triangles;
    float *positions;
    uint32_t *indices;
    struct hg_material material;
    struct hg_cut_piece piece;
    struct hg_gpu_buffer buffers[3]; // positions, vertices, indices
};

#define MOST_MESHES 4
struct rig {
    struct probe probe;
    struct hg_emitters *emitters;
    struct mesh meshes[MOST_MESHES];
    uint32_t mesh_count;
    struct hg_gpu_buffer draws, instances, parts, materials;
    struct hg_gpu_emitters block;
    uint64_t next_id, budget_bytes;
    struct hg_geometry *geometry; // of test_textured alone, in place of tables by hand
    struct hg_textures *textures;
};

// --- the scene -----------------------------------------------------------------------------------

// One device for all tests, a new scene for each.
static struct probe device;

static void rig_open(struct rig *r)
{
    memset(r, 0, sizeof *r);
    hg_scene_destroy(device.scene);
    test_ok(hg_scene_create(&device.scene), NULL);
    device.view.scene = device.scene;
    device.scene->environment.intensity = 1;
    r->probe = device;
    r->next_id = 1;
}

static void rig_close(struct rig *r)
{
    struct hg_gpu *gpu = r->probe.gpu;
    hg_emitters_destroy(r->emitters);
    hg_geometry_destroy(r->geometry);
    hg_textures_destroy(r->textures);
    for (uint32_t i = 0; i < r->mesh_count; i++) {
        struct mesh *m = &r->meshes[i];
        hg_free(m->positions);
        hg_free(m->indices);
        for (int k = 0; k < 3; k++)
            hg_gpu_buffer_destroy(gpu, &m->buffers[k]);
    }
    struct hg_gpu_buffer *tables[] = {&r->draws, &r->instances, &r->parts, &r->materials};
    for (int i = 0; i < 4; i++)
        hg_gpu_buffer_destroy(gpu, tables[i]);
}

static int setup(void **state)
{
    (void)state;
    probe_init(&device, NULL);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    probe_finish(&device);
    return 0;
}

static void *add(struct rig *r, enum hg_object_kind kind)
{
    struct hg_object *object;
    test_ok(hg_scene_add(r->probe.scene, kind, r->next_id++, &object), NULL);
    return object;
}

static struct hg_light *add_light(
    struct rig *r, unsigned kind, float x, float y, float z, float intensity)
{
    struct hg_light *light = add(r, HG_OBJECT_LIGHT);
    struct hg_node *node = add(r, HG_OBJECT_NODE);
    const float at[3] = {x, y, z};
    light->kind = kind;
    light->intensity = intensity;
    light->inner_cone_rad = 0.3f;
    light->outer_cone_rad = 0.6f;
    node->light = light;
    for (int a = 0; a < 3; a++) {
        light->color[a] = 1;
        node->translation[a] = at[a];
    }
    // Straight down: -z becomes -y.
    node->rotation[0] = -sqrtf(0.5f);
    node->rotation[3] = sqrtf(0.5f);
    return light;
}

static struct mesh *add_mesh(struct rig *r, uint32_t vertices, uint32_t triangles, float radiance)
{
    assert_true(r->mesh_count < MOST_MESHES);
    struct mesh *m = &r->meshes[r->mesh_count];
    m->vertices = vertices;
    m->triangles = triangles;
    m->positions = hg_calloc((size_t)vertices + 1, 3 * sizeof *m->positions);
    m->indices = hg_calloc(triangles, 3 * sizeof *m->indices);
    assert_true(m->positions && m->indices);
    hg_material_set_defaults(&m->material);
    for (int c = 0; c < 3; c++)
        m->material.emissive[c] = radiance;
    m->piece = (struct hg_cut_piece){.key = r->mesh_count + 1,
        .draw = r->mesh_count,
        .triangle_count = triangles,
        .vertex_count = vertices,
        .positions = m->positions,
        .indices = m->indices};
    for (int a = 0; a < 3; a++)
        m->piece.world[a * 4] = m->piece.previous[a * 4] = 1;
    r->mesh_count++;
    return m;
}

// Faces down (-y) at a height over the origin; so many squares a side.
static struct mesh *add_ceiling(struct rig *r, const float center[3], float half_x, float half_z,
    uint32_t squares, float radiance)
{
    const uint32_t pitch = squares + 1;
    struct mesh *m = add_mesh(r, pitch * pitch, 2 * squares * squares, radiance);
    for (uint32_t i = 0; i < m->vertices; i++) {
        const float u = (float)(i % pitch) / (float)squares,
                    v = (float)(i / pitch) / (float)squares;
        m->positions[i * 3] = center[0] + half_x * (2 * u - 1);
        m->positions[i * 3 + 1] = center[1];
        m->positions[i * 3 + 2] = center[2] + half_z * (2 * v - 1);
    }
    for (uint32_t i = 0; i < squares * squares; i++) {
        const uint32_t a = i / squares * pitch + i % squares, b = a + 1, c = a + pitch, d = c + 1;
        const uint32_t two[6] = {a, b, d, a, d, c};
        memcpy(m->indices + (size_t)i * 6, two, sizeof two);
    }
    return m;
}

static struct mesh *add_sphere(
    struct rig *r, const float center[3], float radius, uint32_t rings, float radiance)
{
    const uint32_t columns = 2 * rings, pitch = columns + 1;
    struct mesh *m = add_mesh(r, (rings + 1) * pitch, 2 * rings * columns, radiance);
    for (uint32_t i = 0; i < m->vertices; i++) {
        const double theta = PI * (i / pitch) / rings, phi = 2 * PI * (i % pitch) / columns;
        const double sine = i / pitch == rings ? 0 : sin(theta); // poles are points
        const double n[3] = {sine * cos(phi), cos(theta), -sine * sin(phi)};
        for (int a = 0; a < 3; a++)
            m->positions[i * 3 + (uint32_t)a] = (float)((double)center[a] + (double)radius * n[a]);
    }
    for (uint32_t i = 0; i < rings * columns; i++) {
        const uint32_t a = i / columns * pitch + i % columns, b = a + pitch;
        const uint32_t two[6] = {a, b, a + 1, a + 1, b, b + 1};
        memcpy(m->indices + (size_t)i * 6, two, sizeof two);
    }
    return m;
}

static void table(struct rig *r, struct hg_gpu_buffer *buffer, const void *data, uint64_t bytes)
{
    struct hg_error err = {0};
    hg_gpu_buffer_destroy(r->probe.gpu, buffer);
    test_ok(hg_gpu_buffer_create(
                r->probe.gpu, HG_GPU_BUFFER_DEVICE, bytes > 0 ? bytes : 256, "test", buffer, &err),
        &err);
    test_ok(hg_gpu_buffer_upload(r->probe.gpu, buffer, 0, data, bytes, &err), &err);
}

static void upload_meshes(struct rig *r)
{
    struct hg_gpu_draw draws[MOST_MESHES] = {0};
    struct hg_gpu_instance instances[MOST_MESHES] = {0};
    struct hg_gpu_part parts[MOST_MESHES] = {0};
    static struct hg_gpu_material materials[MOST_MESHES];
    memset(materials, 0, sizeof materials);
    for (uint32_t i = 0; i < r->mesh_count; i++) {
        struct mesh *m = &r->meshes[i];
        struct hg_gpu_vertex *vertices = hg_calloc(m->vertices, sizeof *vertices);
        assert_non_null(vertices);
        table(r, &m->buffers[0], m->positions, m->vertices * 12ull);
        table(r, &m->buffers[1], vertices, m->vertices * sizeof *vertices);
        table(r, &m->buffers[2], m->indices, m->triangles * 12ull);
        hg_free(vertices);
        draws[i] = (struct hg_gpu_draw){i, i, i, m->piece.flags};
        memcpy(instances[i].world.m, m->piece.world, sizeof m->piece.world);
        memcpy(instances[i].previous.m, m->piece.previous, sizeof m->piece.previous);
        parts[i] = (struct hg_gpu_part){m->buffers[2].address, m->buffers[0].address,
            m->buffers[1].address, m->buffers[1].address};
        memcpy(&materials[i].emissive, m->material.emissive, sizeof m->material.emissive);
    }
    table(r, &r->draws, draws, sizeof draws);
    table(r, &r->instances, instances, sizeof instances);
    table(r, &r->parts, parts, sizeof parts);
    table(r, &r->materials, materials, sizeof materials);
}

static struct hg_emitters_stats sync(struct rig *r)
{
    struct hg_error err = {0};
    struct hg_emitter_part parts[MOST_MESHES];
    struct hg_emitters_stats stats;
    const struct hg_emitters_params params = {.budget_bytes = r->budget_bytes};
    probe_sync(&r->probe);
    if (!r->emitters)
        test_ok(hg_emitters_create(r->probe.gpu, r->probe.jobs, &params, &r->emitters, &err), &err);
    for (uint32_t i = 0; i < r->mesh_count; i++)
        parts[i] = (struct hg_emitter_part){&r->meshes[i].piece, &r->meshes[i].material, NULL, 0};
    const struct hg_emitter_input in = {.scene = r->probe.scene,
        .parts = parts,
        .part_count = r->mesh_count,
        .draw_count = r->mesh_count};
    upload_meshes(r);
    test_ok(hg_emitters_update(r->emitters, &in, &err), &err);
    hg_emitters_fill(r->emitters, &r->block);
    hg_emitters_stats(r->emitters, &stats);
    return stats;
}

// --- running -------------------------------------------------------------------------------------

struct push {
    uint64_t in, out, emitters;
    uint32_t count, picks, seed;
};

static void record(struct rig *r, enum op op, struct hg_gpu_cmd *cmd,
    const struct hg_gpu_buffer *frame, const struct push *push)
{
    struct hg_error err = {0};
    struct hg_gpu_bindings bindings = {.uniforms = {{frame->address, sizeof(struct hg_gpu_frame)}}};
    bindings.images[HG_BIND_ENV_SPECULAR] = hg_lighting_image_specular(r->probe.lighting);
    bindings.images[HG_BIND_ENV_RADIANCE] = hg_lighting_image_radiance(r->probe.lighting);
    bindings.images[HG_BIND_SHADOW] = hg_lighting_image_shadow(r->probe.lighting);
    for (uint32_t i = 0; i < HG_POOL_COUNT && r->textures; i++)
        bindings.images[HG_BIND_PAGES_SRGB + i] = hg_textures_pool(r->textures, i);
    test_ok(hg_gpu_cmd_bind(cmd, &bindings, &err), &err);
    const uint32_t without = HG_FEATURE_TEXTURES | HG_FEATURE_OCCLUSION | HG_FEATURE_SKY_PAGES |
                             (r->textures ? 0 : HG_FEATURE_EMISSIVE | HG_FEATURE_LOD);
    struct hg_gpu_pipeline_params pipeline = {.compute = "emitters.comp",
        .spec = {(uint32_t)op, 0, HG_FEATURE_ALL & ~without},
        .spec_count = 3};
    test_ok(hg_gpu_cmd_pipeline(cmd, &pipeline, &err), &err);
    hg_gpu_cmd_push(cmd, push, sizeof *push);
    vkCmdDispatch(hg_gpu_cmd_handle(cmd), (push->count + GROUP - 1) / GROUP, 1, 1);
    hg_gpu_memory_barrier(cmd);
}

// out: one vec4 per invocation, two of OP_ONE.
static void run(
    struct rig *r, enum op op, uint32_t count, const struct hg_vec4 *in, struct hg_vec4 *out)
{
    struct hg_error err = {0};
    struct hg_gpu_buffer frame = {0}, input = {0}, output = {0}, emitters = {0};
    static struct hg_gpu_frame block;
    const uint64_t out_bytes = (uint64_t)count * (op == OP_ONE ? 2 : 1) * sizeof *out;
    block.camera = r->probe.camera;
    block.lighting = r->probe.block;
    block.geometry = (struct hg_gpu_geometry){.draws = r->draws.address,
        .instances = r->instances.address,
        .parts = r->parts.address,
        .materials = r->materials.address,
        .draw_count = r->mesh_count,
        .instance_count = r->mesh_count,
        .part_count = r->mesh_count,
        .material_count = r->mesh_count};
    if (r->geometry)
        hg_geometry_fill(r->geometry, &block.geometry);
    if (r->textures)
        hg_textures_fill(r->textures, HG_TEXTURES_SHOW, &block.textures);
    table(r, &frame, &block, sizeof block);
    table(r, &input, in, (uint64_t)count * 2 * sizeof *in);
    table(r, &emitters, &r->block, sizeof r->block);
    test_ok(
        hg_gpu_buffer_create(r->probe.gpu, HG_GPU_BUFFER_READBACK, out_bytes, "out", &output, &err),
        &err);
    const struct push push = {input.address, output.address, emitters.address, count, PICKS, 12345};
    struct hg_gpu_cmd *cmd;
    uint64_t value;
    test_ok(hg_gpu_begin(r->probe.gpu, &cmd, &err), &err);
    record(r, op, cmd, &frame, &push);
    test_ok(hg_gpu_submit(r->probe.gpu, cmd, &value, &err), &err);
    test_ok(hg_gpu_wait(r->probe.gpu, value, &err), &err);
    memcpy(out, output.mapped, out_bytes);
    struct hg_gpu_buffer *buffers[] = {&frame, &input, &output, &emitters};
    for (int i = 0; i < 4; i++)
        hg_gpu_buffer_destroy(r->probe.gpu, buffers[i]);
}

struct estimate {
    double mean, sigma; // of one sample
    double error;       // one standard deviation of the mean
    double bad, work;   // samples that are no numbers; nodes looked at per sample
};

static const float up[3] = {0, 1, 0}, everywhere[3] = {0, 0, 0};

static struct estimate estimate_as(
    struct rig *r, enum op op, const float p[3], const float n[3], uint32_t threads)
{
    struct hg_vec4 *in = hg_calloc(threads, 2 * sizeof *in), *out = hg_calloc(threads, sizeof *out);
    assert_true(in && out);
    for (uint32_t i = 0; i < threads; i++) {
        in[2 * i] = (struct hg_vec4){p[0], p[1], p[2], 0};
        in[2 * i + 1] = (struct hg_vec4){n[0], n[1], n[2], 0};
    }
    run(r, op, threads, in, out);
    struct estimate e = {0};
    double squares = 0;
    const double samples = (double)threads * PICKS;
    for (uint32_t i = 0; i < threads; i++) {
        e.mean += (double)out[i].x / samples;
        squares += (double)out[i].y / samples;
        e.bad += (double)out[i].z;
        e.work += (double)out[i].w / samples;
    }
    e.sigma = sqrt(fmax(0, squares - e.mean * e.mean));
    e.error = e.sigma / sqrt(samples);
    hg_free(in);
    hg_free(out);
    return e;
}

static struct estimate estimate(struct rig *r, const float p[3], const float n[3])
{
    return estimate_as(r, OP_ESTIMATE, p, n, 4096);
}

// Within four standard deviations, which must be small, and a share for rounding.
static void expect(const char *what, struct estimate e, double expected, double most_noise)
{
    print_message(
        "%s: %.6g, expected %.6g, noise of the mean %.2g, sigma / mean %.3g, %.3g nodes\n", what,
        e.mean, expected, e.error / expected, e.sigma / expected, e.work);
    assert_true(e.bad == 0.0);
    assert_true(e.error <= most_noise * expected);
    probe_near(e.mean, expected, 4 * e.error + 5e-4 * expected);
}

// --- closed forms --------------------------------------------------------------------------------

// Irradiance from a polygon of radiance 1 that lies above the receiver's plane.
// Source: Lambert 1760; Arvo 1995, "Analytic Methods for Simulated Light Transport", eq. 2.12.
static double polygon(const double (*v)[3], int count, const float p[3], const float n[3])
{
    double sum = 0;
    for (int i = 0; i < count; i++) {
        double a[3], b[3], c[3], la = 0, lb = 0, lc = 0, dot = 0, facing = 0;
        for (int k = 0; k < 3; k++) {
            a[k] = v[i][k] - (double)p[k];
            b[k] = v[(i + 1) % count][k] - (double)p[k];
            la += a[k] * a[k];
            lb += b[k] * b[k];
            dot += a[k] * b[k];
        }
        for (int k = 0; k < 3; k++) {
            c[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
            lc += c[k] * c[k];
            facing += c[k] * (double)n[k];
        }
        if (lc > 0)
            sum += acos(fmax(-1, fmin(1, dot / sqrt(la * lb)))) * facing / sqrt(lc);
    }
    return fabs(sum) / 2;
}

// Sum over the triangles of all meshes that face the point.
static double all_triangles(const struct rig *r, const float p[3], const float n[3])
{
    double sum = 0;
    for (uint32_t i = 0; i < r->mesh_count; i++) {
        const struct mesh *m = &r->meshes[i];
        for (uint32_t t = 0; t < m->triangles; t++) {
            double v[3][3], e1[3], e2[3], side = 0;
            for (int c = 0; c < 3; c++) {
                const float *at = m->positions + (size_t)m->indices[t * 3 + (uint32_t)c] * 3;
                for (int a = 0; a < 3; a++)
                    v[c][a] = (double)(m->piece.world[a] * at[0] + m->piece.world[3 + a] * at[1] +
                                       m->piece.world[6 + a] * at[2] + m->piece.world[9 + a]);
            }
            for (int a = 0; a < 3; a++) {
                e1[a] = v[1][a] - v[0][a];
                e2[a] = v[2][a] - v[0][a];
            }
            for (int a = 0; a < 3; a++)
                side += (e1[(a + 1) % 3] * e2[(a + 2) % 3] - e1[(a + 2) % 3] * e2[(a + 1) % 3]) *
                        ((double)p[a] - v[0][a]);
            if (m->piece.flags & HG_DRAW_MIRRORED)
                side = -side;
            if (side > 0 || m->piece.flags & HG_DRAW_DOUBLE_SIDED)
                sum += polygon((const double(*)[3])v, 3, p, n) * (double)m->material.emissive[1];
        }
    }
    return sum;
}

static double all_lights(struct rig *r, const float p[3], const float n[3])
{
    struct hg_light_set set = {0};
    double sum = 0;
    test_ok(hg_light_set_collect(&set, r->probe.scene, r->probe.view.origin), NULL);
    for (uint32_t i = 0; i < set.count; i++) {
        const struct hg_gpu_light *l = &set.items[i];
        const double at[3] = {
            (double)l->position_ws.x, (double)l->position_ws.y, (double)l->position_ws.z};
        const double way[3] = {
            (double)l->direction_ws.x, (double)l->direction_ws.y, (double)l->direction_ws.z};
        double d[3], d2 = 0, facing = 0, axis = 0;
        for (int a = 0; a < 3; a++) {
            d[a] = l->kind == HG_LIGHT_KIND_DIRECTIONAL ? -way[a] : at[a] - (double)p[a];
            d2 += d[a] * d[a];
            facing += d[a] * (double)n[a];
            axis -= d[a] * way[a];
        }
        double e = (double)l->color.y * fmax(0, facing / sqrt(d2));
        if (l->kind != HG_LIGHT_KIND_DIRECTIONAL) {
            const double q = d2 * (double)l->inv_range_sq;
            e *= fmax(0, fmin(1, 1 - q * q)) / d2;
        }
        if (l->kind == HG_LIGHT_KIND_SPOT) {
            const double cone =
                fmax(0, fmin(1, axis / sqrt(d2) * (double)l->spot_scale + (double)l->spot_offset));
            e *= cone * cone;
        }
        sum += e;
    }
    hg_light_set_finish(&set);
    return sum;
}

// --- estimates -----------------------------------------------------------------------------------

// One light alone is exact: every sample has the same value.
static void test_one_light(void **state)
{
    (void)state;
    static struct rig r;
    const float p[3] = {0.3f, 0, 0.2f};
    for (unsigned kind = 0; kind < 3; kind++) {
        rig_open(&r);
        struct hg_light *light = add_light(&r, kind, 0, 2, 0, 5);
        light->range = kind == HG_LIGHT_SPOT ? 10 : 0;
        sync(&r);
        const struct estimate e = estimate(&r, p, up);
        expect(kind == 0   ? "directional"
               : kind == 1 ? "point"
                           : "spot",
            e, all_lights(&r, p, up), 1e-3);
        // Beside the cone of a spot, and below the horizon, nothing is chosen.
        const float aside[3] = {30, 0, 0}, down[3] = {0, -1, 0};
        if (kind == HG_LIGHT_SPOT)
            assert_true(estimate(&r, aside, up).mean == 0.0);
        assert_true(estimate(&r, p, down).mean == 0.0);
        rig_close(&r);
    }
}

static float random_float(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (float)(*state >> 8) * 0x1p-24f;
}

static void add_lights(struct rig *r, uint32_t count, float side, float range)
{
    uint32_t random = 7;
    for (uint32_t i = 0; i < count; i++) {
        const float x = side * (random_float(&random) - 0.5f);
        const float z = side * (random_float(&random) - 0.5f);
        const float y = 0.5f + 3 * random_float(&random), power = random_float(&random);
        struct hg_light *light = add_light(
            r, i % 3 == 2 ? HG_LIGHT_SPOT : HG_LIGHT_POINT, x, y, z, 1 + 20 * power * power);
        light->range = range;
        light->inner_cone_rad = 0.2f;
        light->outer_cone_rad = 0.4f + random_float(&random);
    }
}

static void test_many_lights(void **state)
{
    (void)state;
    static struct rig r;
    rig_open(&r);
    add_lights(&r, 300, 20, 0);
    add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 0, 0, 0.5f);
    add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 0, 0, 1);
    sync(&r);
    const float places[3][3] = {{0, 0, 0}, {9, 0.2f, -4}, {60, 0, 60}};
    for (int i = 0; i < 3; i++)
        expect("302 lights", estimate(&r, places[i], up), all_lights(&r, places[i], up), 0.005);
    rig_close(&r);

    rig_open(&r); // more than are weighed one by one
    for (int i = 0; i < 40; i++)
        add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 0, 0, 0.1f * (float)(i + 1));
    sync(&r);
    expect("40 suns", estimate(&r, places[0], up), all_lights(&r, places[0], up), 1e-3);
    rig_close(&r);
}

// A rectangle overhead, near and far, whole and in many pieces, from in front and from the side.
static void test_rectangle(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0};
    const float places[4][3] = {{0, 0, 0}, {0.9f, 0, 0.4f}, {5, 0, 2}, {0.2f, 0.7f, 0}};
    const double corners[4][3] = {{-1, 1, -0.5}, {1, 1, -0.5}, {1, 1, 0.5}, {-1, 1, 0.5}};
    for (uint32_t squares = 1; squares <= 32; squares *= 32) {
        rig_open(&r);
        add_ceiling(&r, center, 1, 0.5f, squares, 3);
        sync(&r);
        for (int i = 0; i < 4; i++)
            expect("rectangle", estimate(&r, places[i], up), 3 * polygon(corners, 4, places[i], up),
                0.01);
        const float side[3] = {1, 0, 0}, left[3] = {-3, 0, 0}, above[3] = {0, 2, 0};
        expect("rectangle, from the side", estimate(&r, left, side),
            3 * polygon(corners, 4, left, side), 0.01);
        const float down[3] = {0, -1, 0};
        assert_true(estimate(&r, above, down).mean == 0.0); // its back
        rig_close(&r);
    }
}

static void test_both_sides(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0}, above[3] = {0.3f, 2, 0}, below[3] = {0.3f, 0, 0};
    const float down[3] = {0, -1, 0};
    const double corners[4][3] = {{-1, 1, -0.5}, {1, 1, -0.5}, {1, 1, 0.5}, {-1, 1, 0.5}};
    rig_open(&r);
    struct mesh *m = add_ceiling(&r, center, 1, 0.5f, 4, 3);
    m->piece.flags = HG_DRAW_DOUBLE_SIDED;
    sync(&r);
    expect("double-sided, above", estimate(&r, above, down), 3 * polygon(corners, 4, above, down),
        0.01);
    expect(
        "double-sided, below", estimate(&r, below, up), 3 * polygon(corners, 4, below, up), 0.01);
    m->piece.flags = HG_DRAW_MIRRORED; // turned round: what was the back
    sync(&r);
    expect("mirrored", estimate(&r, above, down), 3 * polygon(corners, 4, above, down), 0.01);
    assert_true(estimate(&r, below, up).mean == 0.0);
    rig_close(&r);
}

// A sphere's light is that of a point (E = L pi r^2 / d^2), but for the corners of the mesh.
static void test_sphere(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 2, 0}, places[2][3] = {{0, 0, 0}, {1.5f, 0, 0}};
    rig_open(&r);
    add_sphere(&r, center, 0.5f, 48, 2);
    const struct hg_emitters_stats stats = sync(&r);
    assert_int_equal(stats.leaves, 2 * 48 * 96 - 2 * 96); // less the degenerate ones at the poles
    for (int i = 0; i < 2; i++) {
        const struct estimate e = estimate(&r, places[i], up);
        const double dx = (double)places[i][0], d2 = dx * dx + 4;
        expect("sphere", e, all_triangles(&r, places[i], up), 0.005);
        probe_near(e.mean, 2 * PI * 0.25 / d2 * 2 / sqrt(d2), 0.01 * e.mean);
    }
    rig_close(&r);
}

// Leaves of many triangles, when the budget is small, give the same light.
static void test_runs(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 2, 0}, p[3] = {0.5f, 0, 0};
    const uint64_t budgets[3] = {400000, 100000, 24000};
    for (int i = 0; i < 3; i++) {
        rig_open(&r);
        r.budget_bytes = budgets[i];
        add_sphere(&r, center, 0.5f, 48, 2);
        add_light(&r, HG_LIGHT_POINT, 1, 1, 1, 1);
        const struct hg_emitters_stats stats = sync(&r);
        print_message("%u triangles per leaf, %u leaves, %llu of %llu bytes\n", stats.run,
            stats.leaves, (unsigned long long)stats.bytes, (unsigned long long)budgets[i]);
        assert_true(stats.run > 1 && stats.left_out == 0);
        expect("runs", estimate(&r, p, up), all_triangles(&r, p, up) + all_lights(&r, p, up), 0.01);
        rig_close(&r);
    }
}

// What does not fit at all is left out, never in part: its density is 0.
static void test_left_out(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 2, 0}, p[3] = {0.5f, 0, 0};
    rig_open(&r);
    r.budget_bytes = 1;
    add_sphere(&r, center, 0.5f, 48, 2);
    const struct hg_emitters_stats stats = sync(&r);
    assert_int_equal(stats.left_out, 2 * 48 * 96);
    assert_int_equal(stats.leaves, 0);
    assert_true(estimate(&r, p, up).mean == 0.0);
    rig_close(&r);
}

// --- textures ------------------------------------------------------------------------------------

// A square of the texture shines, the rest is black: u 1/4 .. 1/2, v 1/2 .. 3/4.
static struct hg_texture *add_texture(struct rig *r, uint32_t side)
{
    struct hg_texture *t = add(r, HG_OBJECT_TEXTURE);
    t->image = hg_calloc(1, sizeof *t->image);
    assert_non_null(t->image);
    t->image->refs = 1;
    t->image->label = hg_strdup("square");
    t->image->pixels_srgb = true;
    test_ok(hg_image_create(side, side, HG_PIXEL_RGBA8, NULL, &t->image->pixels), NULL);
    for (uint32_t i = 0; i < side * side; i++) {
        const uint32_t x = 4 * (i % side) / side, y = 4 * (i / side) / side;
        memset((uint8_t *)t->image->pixels.pixels + (size_t)i * 4, x == 1 && y == 2 ? 255 : 0, 4);
    }
    return t;
}

static void *copy(const void *data, size_t bytes)
{
    void *out = hg_calloc(1, bytes);
    assert_non_null(out);
    return memcpy(out, data, bytes);
}

// The ceiling as an object of the scene.
static void add_textured_node(struct rig *r, const struct mesh *m, uint32_t squares, uint32_t side)
{
    struct hg_mesh *mesh = add(r, HG_OBJECT_MESH);
    struct hg_node *node = add(r, HG_OBJECT_NODE);
    struct hg_material *material = add(r, HG_OBJECT_MATERIAL);
    struct hg_mesh_part *part = hg_calloc(1, sizeof *part);
    assert_non_null(part);
    *part = (struct hg_mesh_part){.topology = HG_TOPOLOGY_TRIANGLES,
        .vertex_count = m->vertices,
        .index_count = m->triangles * 3,
        .indices = copy(m->indices, m->triangles * 12),
        .positions = copy(m->positions, m->vertices * 12),
        .normals = hg_calloc(m->vertices, 12),
        .uv = {hg_calloc(m->vertices, 8), NULL},
        .material = material,
        .bounds_min = {-1, 1, -0.5f},
        .bounds_max = {1, 1, 0.5f}};
    assert_true(part->normals && part->uv[0]);
    for (uint32_t i = 0; i < m->vertices; i++) {
        part->normals[i * 3 + 1] = -1;
        part->uv[0][i * 2] = (float)(i % (squares + 1)) / (float)squares;
        part->uv[0][i * 2 + 1] = (float)(i / (squares + 1)) / (float)squares;
    }
    for (int c = 0; c < 3; c++)
        material->emissive[c] = 3;
    material->slots[HG_SLOT_EMISSIVE].texture = add_texture(r, side);
    mesh->parts = part;
    mesh->part_count = 1;
    node->mesh = mesh;
}

static struct hg_emitters_stats sync_rooms(struct rig *r)
{
    struct hg_error err = {0};
    struct hg_emitters_stats stats;
    struct hg_cut *cut = NULL;
    const struct hg_textures_params textures = {.budget_bytes = 64 << 20};
    const struct hg_geometry_params geometry = {0};
    const struct hg_cut_lens lens = {.px_scale = 500, .near = 0.1f};
    probe_sync(&r->probe);
    hg_scene_publish(r->probe.scene);
    test_ok(hg_textures_create(r->probe.gpu, &textures, &r->textures, &err), &err);
    test_ok(hg_textures_sync(r->textures, r->probe.scene, r->probe.jobs, &err), &err);
    test_ok(hg_textures_load_all(r->textures, &err), &err);
    test_ok(hg_geometry_create(r->probe.gpu, &geometry, &r->geometry, &err), &err);
    test_ok(hg_geometry_sync(r->geometry, r->probe.scene, r->textures, &err), &err);
    test_ok(hg_cut_make(r->geometry, &lens, r->probe.jobs, &cut, &err), &err);
    test_ok(hg_emitters_create(r->probe.gpu, r->probe.jobs, NULL, &r->emitters, &err), &err);
    test_ok(
        hg_emitters_sync(r->emitters, r->geometry, cut, r->probe.scene, r->textures, &err), &err);
    hg_emitters_fill(r->emitters, &r->block);
    hg_emitters_stats(r->emitters, &stats);
    hg_cut_free(cut);
    return stats;
}

// What a texture leaves black is hardly ever chosen, and the light is that of what shines.
static void test_textured(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0}, p[3] = {0.3f, 0, 0.1f};
    const double lit[4][3] = {{-0.5, 1, 0}, {0, 1, 0}, {0, 1, 0.25}, {-0.5, 1, 0.25}};
    const uint32_t squares[2] = {1, 32}, sides[2] = {64, 1024};
    for (int i = 0; i < 2; i++) {
        rig_open(&r);
        struct mesh *m = add_ceiling(&r, center, 1, 0.5f, squares[i], 3);
        add_textured_node(&r, m, squares[i], sides[i]);
        const struct hg_emitters_stats stats = sync_rooms(&r);
        const struct estimate e = estimate(&r, p, up);
        print_message("%u of %llu triangles\n", stats.leaves, (unsigned long long)stats.triangles);
        expect("textured", e, 3 * polygon(lit, 4, p, up), 0.01);
        // A sixteenth of them shines, and their neighbours may.
        assert_true(i == 0 || (stats.leaves >= 128 && stats.leaves < 256));
        assert_true(i == 0 || e.sigma < 0.7 * e.mean);
        rig_close(&r);
    }
}

// --- environments --------------------------------------------------------------------------------

static void set_image(struct rig *r, uint32_t width, float sun, float sky)
{
    struct hg_environment *env = &r->probe.scene->environment;
    hg_image_finish(&env->image);
    test_ok(hg_image_create(width, width / 2, HG_PIXEL_RGBA32F, NULL, &env->image), NULL);
    float *p = (float *)env->image.pixels;
    for (uint32_t i = 0; i < width * width / 2; i++) {
        const uint32_t x = i % width, y = i / width;
        const bool bright =
            x >= width / 3 && x < width / 3 + 3 && y >= width / 9 && y < width / 9 + 3;
        for (uint32_t c = 0; c < 4; c++)
            p[i * 4 + c] =
                bright ? sun : sky * (1 + 0.5f * sinf(0.05f * (float)x) * (float)y / (float)width);
    }
    env->kind = HG_ENV_IMAGE;
    env->intensity = 0.7f;
    env->rotation_rad = 0.4f;
    env->revision++;
}

// Sum over texels of what is shown, four places in each.
static double brute_environment(const struct rig *r, const float n[3])
{
    const struct hg_environment *env = &r->probe.scene->environment;
    const uint32_t width = env->image.width, height = env->image.height;
    double sum = 0;
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            const double theta = PI * (y + 0.5) / height, phi = 2 * PI * ((x + 0.5) / width - 0.5);
            const double d[3] = {sin(theta) * cos(phi), cos(theta), sin(theta) * sin(phi)};
            const double turn = (double)env->rotation_rad;
            const double w[3] = {
                d[0] * cos(turn) + d[2] * sin(turn), d[1], d[2] * cos(turn) - d[0] * sin(turn)};
            const double facing = w[0] * (double)n[0] + w[1] * (double)n[1] + w[2] * (double)n[2];
            const double angle =
                2 * PI / width * (cos(PI * y / height) - cos(PI * (y + 1) / height));
            sum += fmax(0, facing) * angle *
                   (double)((const float *)env->image.pixels)[((size_t)y * width + x) * 4 + 1];
        }
    return sum * (double)env->intensity;
}

// A sun of a few texels that is half of the light; grids as fine as the image, finer and coarser.
static void test_environment(void **state)
{
    (void)state;
    static struct rig r;
    const float origin[3] = {0, 0, 0}, aslant[3] = {0.6f, 0, -0.8f};
    const uint32_t widths[4] = {1024, 600, 4096, 64};
    const float suns[4] = {20000, 4000, 60000, 0};
    for (int i = 0; i < 4; i++) {
        rig_open(&r);
        set_image(&r, widths[i], suns[i], 0.3f);
        const struct hg_emitters_stats stats = sync(&r);
        print_message(
            "environment of %u texels: %.1f ms\n", widths[i], (double)stats.warp_ns * 1e-6);
        expect("environment", estimate(&r, origin, up), brute_environment(&r, up), 0.005);
        expect("environment, aslant", estimate(&r, origin, aslant), brute_environment(&r, aslant),
            0.02);
        rig_close(&r);
    }
}

static void test_constant_environment(void **state)
{
    (void)state;
    static struct rig r;
    const float p[3] = {1, 2, 3};
    rig_open(&r);
    struct hg_environment *env = &r.probe.scene->environment;
    env->kind = HG_ENV_COLOR;
    env->intensity = 2;
    for (int c = 0; c < 3; c++)
        env->color[c] = 0.25f;
    sync(&r);
    expect("constant environment", estimate(&r, p, up), 0.5 * PI, 1e-3);
    expect("constant environment, both sides", estimate(&r, p, everywhere), 0.5 * 4 * PI, 1e-3);
    rig_close(&r);
}

static void test_sky(void **state)
{
    (void)state;
    static struct rig r;
    const float p[3] = {0, 0, 0};
    rig_open(&r);
    struct hg_environment *env = &r.probe.scene->environment;
    env->kind = HG_ENV_SKY;
    env->intensity = 1;
    env->turbidity = 2;
    env->sun_direction[0] = 0.6f;
    env->sun_direction[1] = 0.8f;
    sync(&r);
    const struct estimate with_disc = estimate(&r, p, up);
    assert_true(with_disc.bad == 0.0 && with_disc.error < 0.005 * with_disc.mean);
    assert_true(with_disc.mean > 2 && with_disc.mean < 4); // about 0.8 * 3.2 lux and the sky's half
    // A directional light stands for the disc.
    struct hg_light *sun = add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 0, 0, 1);
    sync(&r);
    const struct estimate without = estimate(&r, p, up);
    assert_true(without.mean - 1 < 0.5 * with_disc.mean);
    sun->intensity = 0;
    rig_close(&r);
}

// Everything at once.
static void test_all_kinds(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0}, p[3] = {0.3f, 0, 0.1f};
    rig_open(&r);
    add_ceiling(&r, center, 0.2f, 0.2f, 4, 5);
    add_lights(&r, 50, 6, 3);
    add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 0, 0, 0.5f);
    set_image(&r, 512, 3000, 0.2f);
    sync(&r);
    const double expected =
        all_triangles(&r, p, up) + all_lights(&r, p, up) + brute_environment(&r, up);
    expect("all kinds", estimate(&r, p, up), expected, 0.01);
    rig_close(&r);
}

// --- densities -----------------------------------------------------------------------------------

#define ONES 65536

static void take_ones(struct rig *r, const float p[3], const float n[3], struct hg_vec4 *out)
{
    struct hg_vec4 *in = hg_calloc(ONES, 2 * sizeof *in);
    assert_non_null(in);
    for (uint32_t i = 0; i < ONES; i++) {
        in[2 * i] = (struct hg_vec4){p[0], p[1], p[2], 0};
        in[2 * i + 1] = (struct hg_vec4){n[0], n[1], n[2], 0};
    }
    run(r, OP_ONE, ONES, in, out);
    hg_free(in);
}

// The density that comes with a sample is that of the pdf functions.
static void test_pdf_is_that_of_pick(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0}, ball[3] = {2, 1, 1}, p[3] = {0.3f, 0, 0.1f};
    struct hg_vec4 *out = hg_calloc(ONES, 2 * sizeof *out);
    assert_non_null(out);
    for (int budget = 0; budget < 2; budget++) {
        rig_open(&r);
        r.budget_bytes = budget ? 60000 : 0;
        add_ceiling(&r, center, 0.2f, 0.2f, 4, 5);
        add_sphere(&r, ball, 0.3f, 24, 2);
        add_lights(&r, 50, 6, 3);
        set_image(&r, 512, 3000, 0.2f);
        const struct hg_emitters_stats stats = sync(&r);
        assert_true(budget == 0 ? stats.run == 1 : stats.run > 1);
        take_ones(&r, p, up, out);
        uint32_t differ = 0, kinds[8] = {0};
        double worst = 0;
        for (uint32_t i = 0; i < ONES; i++) {
            const double pdf = (double)out[2 * i].w, again = (double)out[2 * i + 1].w;
            kinds[(uint32_t)out[2 * i + 1].z & 7]++;
            if (!(pdf > 0))
                continue;
            const double off = fabs(again / pdf - 1);
            differ += off > 1e-3; // directions within rounding of the border of a cell
            worst = off < 1e-3 ? fmax(worst, off) : worst;
        }
        print_message("densities agree within %.1e, %u of %d on borders; environment %u, delta %u, "
                      "triangles %u\n",
            worst, differ, ONES, kinds[2], kinds[1], kinds[4]);
        assert_true(differ * 1000 < ONES);
        assert_true(kinds[2] > 1000 && kinds[1] > 1000 && kinds[4] > 1000);
        rig_close(&r);
    }
    hg_free(out);
}

// Chi-square of counts against expected ones; bins of few are put together. Wilson and Hilferty
// 1931 for the limit: one chance in 10^5.
static void expect_chi_square(
    const char *what, const double *counts, const double *expected, uint32_t n)
{
    double sum = 0, rest_count = 0, rest = 0;
    uint32_t bins = 0;
    for (uint32_t i = 0; i < n; i++) {
        rest_count += counts[i];
        rest += expected[i];
        if (rest < 10)
            continue;
        sum += (rest_count - rest) * (rest_count - rest) / rest;
        rest_count = rest = 0;
        bins++;
    }
    const double k = bins - 1, z = 4.265, t = 1 - 2 / (9 * k) + z * sqrt(2 / (9 * k));
    print_message("%s: chi-square %.1f of %u bins, limit %.1f\n", what, sum, bins, k * t * t * t);
    assert_true(bins > 10 && sum < k * t * t * t);
}

static void test_leaves_by_their_chance(void **state)
{
    (void)state;
    static struct rig r;
    const float ball[3] = {2, 1, 1}, p[3] = {0.3f, 0, 0.1f};
    rig_open(&r);
    add_sphere(&r, ball, 0.6f, 12, 2);
    const struct hg_emitters_stats stats = sync(&r);
    const uint32_t leaves = r.block.leaf_count;
    assert_int_equal(stats.run, 1);
    struct hg_vec4 *in = hg_calloc(leaves, 2 * sizeof *in),
                   *chances = hg_calloc(leaves, sizeof *in);
    struct hg_vec4 *out = hg_calloc(ONES, 2 * sizeof *out);
    double *counts = hg_calloc(leaves, sizeof *counts),
           *expected = hg_calloc(leaves, sizeof *counts);
    assert_true(in && chances && out && counts && expected);
    for (uint32_t i = 0; i < leaves; i++) {
        in[2 * i] = (struct hg_vec4){p[0], p[1], p[2], (float)i};
        in[2 * i + 1] = (struct hg_vec4){up[0], up[1], up[2], 0};
    }
    run(&r, OP_CHANCE, leaves, in, chances);
    take_ones(&r, p, up, out);
    double total = 0, missed = 0, rare = 0;
    for (uint32_t i = 0; i < leaves; i++) {
        expected[i] = (double)chances[i].x * ONES;
        total += (double)chances[i].x;
    }
    for (uint32_t i = 0; i < ONES; i++) {
        const uint32_t triangle = (uint32_t)out[2 * i + 1].y;
        if ((double)out[2 * i + 1].x > 1e6) // nothing was chosen
            missed++;
        else
            counts[triangle]++;
    }
    for (uint32_t i = 0; i < leaves; i++)
        rare += expected[i] == 0.0 ? counts[i] : 0;
    assert_true(rare == 0.0);
    assert_true(total <= 1 + 1e-4);
    probe_near(missed / ONES, 1 - total, 0.01);
    expect_chi_square("leaves", counts, expected, leaves);
    hg_free(in);
    hg_free(chances);
    hg_free(out);
    hg_free(counts);
    hg_free(expected);
    rig_close(&r);
}

// Directions over the sphere as often as the density says; the density integrates to 1.
static void test_environment_histogram(void **state)
{
    (void)state;
    enum {
        COLUMNS = 48,
        ROWS = 24,
        FINE = 16,
        CELLS = COLUMNS * ROWS,
        PLACES = CELLS * FINE * FINE
    };
    static struct rig r;
    static double counts[CELLS], expected[CELLS];
    const float p[3] = {0, 0, 0};
    rig_open(&r);
    set_image(&r, 256, 50, 0.3f);
    r.probe.scene->environment.rotation_rad = 0;
    sync(&r);
    struct hg_vec4 *in = hg_calloc(PLACES, 2 * sizeof *in),
                   *densities = hg_calloc(PLACES, sizeof *in);
    struct hg_vec4 *out = hg_calloc(ONES, 2 * sizeof *out);
    assert_true(in && densities && out);
    for (uint32_t i = 0; i < PLACES; i++) {
        const double u = (i % (COLUMNS * FINE) + 0.5) / (COLUMNS * FINE);
        const double v = (i / (COLUMNS * FINE) + 0.5) / (ROWS * FINE);
        const double theta = PI * v, phi = 2 * PI * (u - 0.5);
        in[2 * i] = (struct hg_vec4){
            (float)(sin(theta) * cos(phi)), (float)cos(theta), (float)(sin(theta) * sin(phi)), 0};
    }
    run(&r, OP_ENVIRONMENT, PLACES, in, densities);
    double total = 0;
    memset(counts, 0, sizeof counts);
    memset(expected, 0, sizeof expected);
    for (uint32_t i = 0; i < PLACES; i++) {
        const uint32_t x = i % (COLUMNS * FINE) / FINE, row = i / (COLUMNS * FINE);
        const double angle = 2 * PI / (COLUMNS * FINE) *
                             (cos(PI * row / (ROWS * FINE)) - cos(PI * (row + 1) / (ROWS * FINE)));
        expected[row / FINE * COLUMNS + x] += (double)densities[i].y * angle * ONES;
        total += (double)densities[i].y * angle;
    }
    probe_near(total, 1, 0.002);
    take_ones(&r, p, everywhere, out);
    for (uint32_t i = 0; i < ONES; i++) {
        const struct hg_vec4 d = out[2 * i];
        const double u = atan2((double)d.z, (double)d.x) / (2 * PI) + 0.5;
        const double v = acos(fmax(-1, fmin(1, (double)d.y))) / PI;
        counts[(uint32_t)fmin(ROWS - 1, v * ROWS) * COLUMNS +
               (uint32_t)fmin(COLUMNS - 1, u * COLUMNS)]++;
    }
    expect_chi_square("directions", counts, expected, CELLS);
    hg_free(in);
    hg_free(densities);
    hg_free(out);
    rig_close(&r);
}

// --- many lights ---------------------------------------------------------------------------------

// Ten thousand lights: far less noise than a light at random, for little more work than ten need.
static void test_ten_thousand(void **state)
{
    (void)state;
    static struct rig r;
    const float p[3] = {3, 0, -2};
    struct estimate few, many, uniform;
    rig_open(&r);
    add_lights(&r, 10, 20, 0);
    sync(&r);
    few = estimate(&r, p, up);
    expect("10 lights", few, all_lights(&r, p, up), 0.01);
    rig_close(&r);
    rig_open(&r);
    add_lights(&r, 10000, 200, 0);
    const struct hg_emitters_stats stats = sync(&r);
    many = estimate(&r, p, up);
    uniform = estimate_as(&r, OP_UNIFORM, p, up, 4096);
    expect("10000 lights", many, all_lights(&r, p, up), 0.01);
    print_message(
        "10000 lights: tree of depth %u built in %.1f ms; variance %.4g, of uniform choice "
        "%.4g (%.0f times); %.1f nodes per sample, %.1f for ten lights\n",
        stats.depth, (double)stats.build_ns * 1e-6, many.sigma * many.sigma,
        uniform.sigma * uniform.sigma, pow(uniform.sigma / many.sigma, 2), many.work, few.work);
    assert_true(uniform.sigma * uniform.sigma > 50 * many.sigma * many.sigma);
    assert_true(many.work < 5 * few.work);
    rig_close(&r);
}

// --- hostile scenes ------------------------------------------------------------------------------

static void test_hostile(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0}, p[3] = {0.3f, 0, 0.1f};
    rig_open(&r);
    struct mesh *good = add_ceiling(&r, center, 1, 0.5f, 4, 3);
    // No area, NaN, infinite, too large, and an index that is out of range.
    struct mesh *bad = add_mesh(&r, 8, 6, 3);
    const float wild[8][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {NAN, 0, 0}, {INFINITY, 1, 0},
        {3e38f, 3e38f, 0}, {-3e38f, 3e38f, 3e38f}, {1e-30f, 1e-30f, 0}};
    const uint32_t index[18] = {0, 1, 2, 0, 1, 3, 0, 1, 4, 0, 5, 6, 0, 0, 0, 0, 7, 7};
    memcpy(bad->positions, wild, sizeof wild);
    memcpy(bad->indices, index, sizeof index);
    struct mesh *flat = add_ceiling(&r, center, 1, 0.5f, 2, 3); // a singular matrix
    flat->piece.world[0] = flat->piece.world[4] = flat->piece.world[8] = 0;
    struct mesh *black = add_ceiling(&r, center, 1, 0.5f, 2, 0);
    black->material.emissive[0] = NAN;
    struct hg_light *light = add_light(&r, HG_LIGHT_POINT, 0, 2, 0, 0);
    light = add_light(&r, HG_LIGHT_POINT, NAN, 2, 0, 1);
    light = add_light(&r, HG_LIGHT_SPOT, 0, 2, 0, INFINITY);
    light = add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 2, 0, NAN);
    light->color[0] = NAN;
    struct hg_emitters_stats stats = sync(&r);
    assert_int_equal(stats.leaves, 32);
    const struct estimate e = estimate(&r, p, up);
    const double corners[4][3] = {{-1, 1, -0.5}, {1, 1, -0.5}, {1, 1, 0.5}, {-1, 1, 0.5}};
    expect("hostile", e, 3 * polygon(corners, 4, p, up), 0.01);
    // On the light, in its plane, far away.
    const float places[4][3] = {{0, 1, 0}, {5, 1, 0}, {1e20f, 0, 0}, {-1, 1, -0.5f}};
    for (int i = 0; i < 4; i++)
        assert_true(estimate_as(&r, OP_ESTIMATE, places[i], up, 64).bad == 0.0);
    assert_non_null(good);

    // Nothing that shines.
    rig_close(&r);
    rig_open(&r);
    stats = sync(&r);
    assert_int_equal(stats.leaves, 0);
    assert_true(estimate_as(&r, OP_ESTIMATE, p, up, 64).mean == 0.0);
    rig_close(&r);
}

// --- the tree ------------------------------------------------------------------------------------

static struct hg_light_item random_item(uint32_t *random)
{
    struct hg_light_item item = {.cos_o = 1, .power = 1 + random_float(random)};
    float length = 0;
    for (int a = 0; a < 3; a++) {
        item.min[a] = 10 * random_float(random);
        item.max[a] = item.min[a] + 0.1f * random_float(random);
        item.axis[a] = random_float(random) - 0.5f;
        length += item.axis[a] * item.axis[a];
    }
    for (int a = 0; a < 3; a++)
        item.axis[a] /= sqrtf(length);
    return item;
}

static void expect_same_tree(const struct hg_light_item *items, uint32_t count)
{
    struct hg_light_tree trees[2];
    for (unsigned i = 0; i < 2; i++) {
        struct hg_jobs *jobs = hg_jobs_create(i == 0 ? 1 : 4);
        assert_non_null(jobs);
        test_ok(hg_light_tree_build(items, count, jobs, &trees[i]), NULL);
        hg_jobs_destroy(jobs);
    }
    assert_int_equal(trees[0].leaf_count, count);
    assert_int_equal(trees[0].node_count, 2 * count - 1);
    assert_true(trees[0].depth <= HG_EMITTER_MAX_DEPTH);
    assert_memory_equal(
        trees[0].nodes, trees[1].nodes, trees[0].node_count * sizeof *trees[0].nodes);
    assert_memory_equal(trees[0].trails, trees[1].trails, count * sizeof *trees[0].trails);
    // Every trail leads to its leaf.
    for (uint32_t i = 0; i < count; i++) {
        uint32_t at = 0, step = 0;
        for (; (trees[0].nodes[at].child & HG_EMITTER_IS_LEAF) == 0; step++)
            at = trees[0].nodes[at].child + (trees[0].trails[i] >> step & 1);
        assert_int_equal(trees[0].nodes[at].child & ~HG_EMITTER_IS_LEAF, i);
    }
    hg_light_tree_finish(&trees[0]);
    hg_light_tree_finish(&trees[1]);
}

// The same bytes for any number of threads; bounded depth where all lights lie in one place, or
// each twice as far away as the one before.
static void test_tree(void **state)
{
    (void)state;
    const uint32_t count = 50000;
    uint32_t random = 3;
    struct hg_light_item *items = hg_calloc(count, sizeof *items);
    assert_non_null(items);
    for (uint32_t i = 0; i < count; i++)
        items[i] = random_item(&random);
    expect_same_tree(items, count);
    for (uint32_t i = 0; i < count; i++)
        items[i] = items[0];
    expect_same_tree(items, count);
    for (uint32_t i = 0; i < count; i++) {
        items[i] = items[0];
        items[i].min[0] = items[i].max[0] = ldexpf(1, (int)(i % 120));
    }
    expect_same_tree(items, count);
    hg_free(items);
}

// Nothing is built while nothing changes.
static void test_kept(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0};
    rig_open(&r);
    struct mesh *m = add_ceiling(&r, center, 1, 0.5f, 4, 3);
    struct hg_light *light = add_light(&r, HG_LIGHT_POINT, 0, 2, 0, 1);
    set_image(&r, 64, 0, 1);
    struct hg_emitters_stats stats = sync(&r);
    assert_true(stats.builds == 1 && stats.warps == 1);
    stats = sync(&r);
    assert_true(stats.builds == 1 && stats.warps == 1);
    light->intensity = 2;
    stats = sync(&r);
    assert_true(stats.builds == 2 && stats.warps == 1);
    m->material.emissive[1] = 4;
    stats = sync(&r);
    assert_true(stats.builds == 3 && stats.warps == 1);
    m->piece.world[9] = 1;
    stats = sync(&r);
    assert_true(stats.builds == 4 && stats.warps == 1);
    set_image(&r, 64, 0, 2);
    stats = sync(&r);
    assert_true(stats.builds == 4 && stats.warps == 2);
    rig_close(&r);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_one_light),
        cmocka_unit_test(test_many_lights),
        cmocka_unit_test(test_rectangle),
        cmocka_unit_test(test_both_sides),
        cmocka_unit_test(test_sphere),
        cmocka_unit_test(test_runs),
        cmocka_unit_test(test_left_out),
        cmocka_unit_test(test_textured),
        cmocka_unit_test(test_environment),
        cmocka_unit_test(test_constant_environment),
        cmocka_unit_test(test_sky),
        cmocka_unit_test(test_all_kinds),
        cmocka_unit_test(test_pdf_is_that_of_pick),
        cmocka_unit_test(test_leaves_by_their_chance),
        cmocka_unit_test(test_environment_histogram),
        cmocka_unit_test(test_ten_thousand),
        cmocka_unit_test(test_hostile),
        cmocka_unit_test(test_tree),
        cmocka_unit_test(test_kept),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, setup, teardown);
}
