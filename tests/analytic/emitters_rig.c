// emitters_rig.c - see emitters_rig.h.
#include "tests/analytic/emitters_rig.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "shaders/shared/features.h"
#include "renderer/light/lights.h"
#include "tests/support/check.h"

#define GROUP 32

// --- the scene -----------------------------------------------------------------------------------

// One device for all tests, a new scene for each.
static struct probe device;

void rig_open(struct rig *r)
{
    memset(r, 0, sizeof *r);
    hg_scene_destroy(device.scene);
    test_ok(hg_scene_create(&device.scene), NULL);
    device.view.scene = device.scene;
    device.scene->environment.intensity = 1;
    r->probe = device;
    r->next_id = 1;
}

void rig_close(struct rig *r)
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

int rig_setup(void **state)
{
    (void)state;
    probe_init(&device, NULL);
    return 0;
}

int rig_teardown(void **state)
{
    (void)state;
    probe_finish(&device);
    return 0;
}

void *rig_add(struct rig *r, enum hg_object_kind kind)
{
    struct hg_object *object;
    test_ok(hg_scene_add(r->probe.scene, kind, r->next_id++, &object), NULL);
    return object;
}

struct hg_light *rig_add_light(
    struct rig *r, unsigned kind, float x, float y, float z, float intensity)
{
    struct hg_light *light = rig_add(r, HG_OBJECT_LIGHT);
    struct hg_node *node = rig_add(r, HG_OBJECT_NODE);
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

struct mesh *rig_add_mesh(struct rig *r, uint32_t vertices, uint32_t triangles, float radiance)
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
    m->piece = (struct hg_ray_geometry_piece){.key = r->mesh_count + 1,
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
struct mesh *rig_add_ceiling(struct rig *r, const float center[3], float half_x, float half_z,
    uint32_t squares, float radiance)
{
    const uint32_t pitch = squares + 1;
    struct mesh *m = rig_add_mesh(r, pitch * pitch, 2 * squares * squares, radiance);
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

struct mesh *rig_add_sphere(
    struct rig *r, const float center[3], float radius, uint32_t rings, float radiance)
{
    const uint32_t columns = 2 * rings, pitch = columns + 1;
    struct mesh *m = rig_add_mesh(r, (rings + 1) * pitch, 2 * rings * columns, radiance);
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

struct hg_emitters_stats rig_sync(struct rig *r)
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
void rig_run(
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
    test_ok(hg_gpu_begin(r->probe.gpu, &cmd, &err), &err);
    record(r, op, cmd, &frame, &push);
    test_ok(hg_gpu_submit_and_wait(r->probe.gpu, cmd, &err), &err);
    memcpy(out, output.mapped, out_bytes);
    struct hg_gpu_buffer *buffers[] = {&frame, &input, &output, &emitters};
    for (int i = 0; i < 4; i++)
        hg_gpu_buffer_destroy(r->probe.gpu, buffers[i]);
}

const float up[3] = {0, 1, 0}, everywhere[3] = {0, 0, 0};

struct estimate rig_estimate_as(
    struct rig *r, enum op op, const float p[3], const float n[3], uint32_t threads)
{
    struct hg_vec4 *in = hg_calloc(threads, 2 * sizeof *in), *out = hg_calloc(threads, sizeof *out);
    assert_true(in && out);
    for (uint32_t i = 0; i < threads; i++) {
        in[2 * i] = (struct hg_vec4){p[0], p[1], p[2], 0};
        in[2 * i + 1] = (struct hg_vec4){n[0], n[1], n[2], 0};
    }
    rig_run(r, op, threads, in, out);
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

struct estimate rig_estimate(struct rig *r, const float p[3], const float n[3])
{
    return rig_estimate_as(r, OP_ESTIMATE, p, n, 4096);
}

// Within four standard deviations, which must be small, and a share for rounding.
void rig_expect(const char *what, struct estimate e, double expected, double most_noise)
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
double rig_polygon(const double (*v)[3], int count, const float p[3], const float n[3])
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
double rig_all_triangles(const struct rig *r, const float p[3], const float n[3])
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
                sum +=
                    rig_polygon((const double(*)[3])v, 3, p, n) * (double)m->material.emissive[1];
        }
    }
    return sum;
}

double rig_all_lights(struct rig *r, const float p[3], const float n[3])
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

float rig_random(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (float)(*state >> 8) * 0x1p-24f;
}

void rig_add_lights(struct rig *r, uint32_t count, float side, float range)
{
    uint32_t random = 7;
    for (uint32_t i = 0; i < count; i++) {
        const float x = side * (rig_random(&random) - 0.5f);
        const float z = side * (rig_random(&random) - 0.5f);
        const float y = 0.5f + 3 * rig_random(&random), power = rig_random(&random);
        struct hg_light *light = rig_add_light(
            r, i % 3 == 2 ? HG_LIGHT_SPOT : HG_LIGHT_POINT, x, y, z, 1 + 20 * power * power);
        light->range = range;
        light->inner_cone_rad = 0.2f;
        light->outer_cone_rad = 0.4f + rig_random(&random);
    }
}

void rig_set_image(struct rig *r, uint32_t width, float sun, float sky)
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
