// lod_error.c - the error that a hierarchy states against distances measured between surfaces, and
// attributes against those of the source, at points sampled on both.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <float.h>
#include <stdio.h>

#include "renderer/lod/lod.h"
#include "renderer/lod/vertex_pack.h"
#include "tests/unit/lod_meshes.h"

#define SAMPLES 700u

struct surface { // triangles with attributes: position 3, normal 3, uv 2
    float (*corners)[3][8];
    size_t capacity;
    uint32_t count;
    double area;
};

static void add_corner(
    struct surface *s, uint32_t k, const float *p, const float *n, const float *uv)
{
    assert_int_equal(
        hg_grow(&s->corners, &s->capacity, s->count + 1ull, sizeof *s->corners), HG_OK);
    float *c = s->corners[s->count][k];
    memcpy(c, p, 12);
    memcpy(c + 3, n, 12);
    memcpy(c + 6, uv, 8);
}

static struct surface source_of(const struct hg_mesh_part *part)
{
    struct surface s = {0};
    for (uint32_t i = 0; i < part->index_count; i += 3, s.count++)
        for (uint32_t k = 0; k < 3; k++) {
            const size_t v = part->indices[i + k];
            add_corner(&s, k, part->positions + v * 3, part->normals + v * 3, part->uv[0] + v * 2);
        }
    return s;
}

static void add_cluster(
    struct surface *s, const struct hg_lod *lod, uint32_t cluster, uint8_t *chunk)
{
    const struct hg_lod_cluster *c = &lod->clusters[cluster];
    struct hg_lod_layout l;
    hg_lod_chunk_layout(lod, lod->groups[c->group].chunk, &l);
    const uint32_t *indices = (const uint32_t *)(const void *)(chunk + l.indices);
    const float *positions = (const float *)(const void *)(chunk + l.positions);
    const struct hg_gpu_vertex *vertices =
        (const struct hg_gpu_vertex *)(const void *)(chunk + l.vertices);
    for (uint32_t t = 0; t < c->triangle_count; t++, s->count++) {
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t v = indices[c->first_index + t * 3 + k];
            float n[3];
            hg_unpack_normal(vertices[v].normal, n);
            add_corner(s, k, positions + (size_t)v * 3, n, &vertices[v].uv.x);
        }
    }
}

// Everything whose error is at most `error`, as coarse as that allows.
static struct surface cut_of(const struct hg_lod *lod, float error)
{
    struct surface s = {0};
    struct hg_error err = {0};
    uint8_t *slot = hg_calloc_aligned(16, HG_LOD_CHUNK_BYTES);
    assert_non_null(slot);
    for (uint32_t i = 0; i < lod->chunk_count; i++) {
        const struct hg_lod_chunk *chunk = &lod->chunks[i];
        assert_int_equal(
            hg_lod_decode(lod, i, lod->data + chunk->offset, chunk->bytes, slot, &err), HG_OK);
        for (uint32_t g = chunk->first_group; g < chunk->first_group + chunk->group_count; g++) {
            const struct hg_lod_group *group = &lod->groups[g];
            for (uint32_t c = group->first_cluster;
                 group->error > error && c < group->first_cluster + group->cluster_count; c++) {
                const uint32_t from = lod->clusters[c].made_from;
                if (from == HG_LOD_NONE || lod->groups[from].error <= error)
                    add_cluster(&s, lod, c, slot);
            }
        }
    }
    hg_free(slot);
    return s;
}

static float dot(const float *a, const float *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Squared distance of p to a triangle by its plane and edges; weights of the nearest point.
static float distance2(const float p[3], float (*t)[8], float w[3])
{
    float best = INFINITY, e1[3], e2[3], ap[3], n[3];
    for (int k = 0; k < 3; k++) {
        e1[k] = t[1][k] - t[0][k];
        e2[k] = t[2][k] - t[0][k];
        ap[k] = p[k] - t[0][k];
    }
    n[0] = e1[1] * e2[2] - e1[2] * e2[1];
    n[1] = e1[2] * e2[0] - e1[0] * e2[2];
    n[2] = e1[0] * e2[1] - e1[1] * e2[0];
    const float d11 = dot(e1, e1), d12 = dot(e1, e2), d22 = dot(e2, e2);
    const float det = d11 * d22 - d12 * d12, p1 = dot(ap, e1), p2 = dot(ap, e2);
    if (det > 0.0f) {
        const float b = (d22 * p1 - d12 * p2) / det, c = (d11 * p2 - d12 * p1) / det;
        if (b >= 0.0f && c >= 0.0f && b + c <= 1.0f) {
            const float h = dot(ap, n);
            w[0] = 1.0f - b - c;
            w[1] = b;
            w[2] = c;
            return h * h / dot(n, n);
        }
    }
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3;
        float e[3], q[3];
        for (int k = 0; k < 3; k++) {
            e[k] = t[j][k] - t[i][k];
            q[k] = p[k] - t[i][k];
        }
        const float l = dot(e, e);
        float at = l > 0.0f ? dot(q, e) / l : 0.0f;
        at = at < 0.0f ? 0.0f : at > 1.0f ? 1.0f : at;
        for (int k = 0; k < 3; k++)
            q[k] -= at * e[k];
        const float d = dot(q, q);
        if (d < best) {
            best = d;
            memset(w, 0, 12);
            w[i] = 1.0f - at;
            w[j] = at;
        }
    }
    return best;
}

static void sample(const struct surface *s, uint32_t *state, float out[8])
{
    const uint32_t t = lod_random(state) % s->count;
    float a = lod_random_unit(state), b = lod_random_unit(state);
    if (a + b > 1.0f) {
        a = 1.0f - a;
        b = 1.0f - b;
    }
    for (int k = 0; k < 8; k++)
        out[k] = (1.0f - a - b) * s->corners[t][0][k] + a * s->corners[t][1][k] +
                 b * s->corners[t][2][k];
}

struct gap {
    double distance, normal, uv; // largest distance; root mean squares of the others
};

// From `count` points of one surface to the other.
static struct gap measure(const struct surface *from, const struct surface *to, uint32_t count)
{
    struct gap g = {0};
    uint32_t state = 5, compared = 0;
    for (uint32_t i = 0; i < count; i++) {
        float p[8], best = INFINITY, at[3] = {0}, w[3] = {0};
        uint32_t nearest = 0;
        sample(from, &state, p);
        for (uint32_t t = 0; t < to->count; t++) {
            const float d = distance2(p, to->corners[t], w);
            if (d < best) {
                best = d;
                nearest = t;
                memcpy(at, w, sizeof at);
            }
        }
        double normal = 0.0, uv = 0.0;
        for (int k = 3; k < 8; k++) {
            double v = -(double)p[k];
            for (int c = 0; c < 3; c++)
                v += (double)(at[c] * to->corners[nearest][c][k]);
            *(k < 6 ? &normal : &uv) += v * v;
        }
        g.distance = fmax(g.distance, sqrt((double)best));
        g.normal += normal;
        g.uv += uv;
        compared++;
    }
    g.normal = sqrt(g.normal / compared);
    g.uv = sqrt(g.uv / compared);
    return g;
}

// Cuts at every few errors; metres_per_uv and edge say what the stated error means for attributes.
static void check_errors(struct hg_mesh_part *part, double metres_per_uv, double edge, bool verbose)
{
    const struct hg_lod_params params = {0};
    struct hg_lod_report report;
    struct hg_error err = {0};
    struct hg_lod *lod = NULL;
    uint8_t *data;
    size_t size;
    assert_int_equal(hg_lod_bake(part, &params, &data, &size, &report, &err), HG_OK);
    assert_int_equal(hg_lod_open(data, size, &lod, &err), HG_OK);
    struct surface source = source_of(part);
    uint32_t last = 0;
    for (float error = lod->source_error; error <= report.root_error; error *= 2.0f) {
        struct surface cut = cut_of(lod, error);
        if (cut.count != last && cut.count > 0) {
            const struct gap to = measure(&source, &cut, SAMPLES),
                             back = measure(&cut, &source, SAMPLES);
            if (verbose)
                print_message("%6u triangles, stated %.6f: source to cut %.6f, back %.6f, normals "
                              "%.4f, uv %.6f\n",
                    cut.count, (double)error, to.distance, back.distance, to.normal, to.uv);
            assert_true(to.distance <= (double)error);
            assert_true(back.distance <= (double)error * 1.5);
            assert_true(to.normal * 0.25 * edge <= (double)error);
            assert_true(to.uv * 0.5 * metres_per_uv <= (double)error);
        }
        last = cut.count;
        hg_free(cut.corners);
    }
    hg_free(source.corners);
    hg_lod_close(lod);
    hg_free(data);
}

static void test_terrain(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_terrain(64);
    check_errors(&part, 64.0, 1.0, true);
    lod_part_finish(&part);
}

static void test_sphere_like(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(90, 44, 1.0f);
    // The seam's uv jumps, so uv is not compared here.
    check_errors(&part, 0.0, 0.05, true);
    lod_part_finish(&part);
}

// --- what a surface may do without ---------------------------------------------------------------

static void add_triangle(struct hg_mesh_part *p, const float (*corners)[3])
{
    float e[2][3], n[3];
    for (int k = 0; k < 3; k++) {
        e[0][k] = corners[1][k] - corners[0][k];
        e[1][k] = corners[2][k] - corners[0][k];
    }
    for (int k = 0; k < 3; k++)
        n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
    const float length = sqrtf(dot(n, n));
    for (uint32_t k = 0; k < 3; k++) {
        const uint32_t v = p->vertex_count++;
        p->indices[p->index_count++] = v;
        memcpy(p->positions + (size_t)v * 3, corners[k], 12);
        for (int c = 0; c < 3; c++)
            p->normals[v * 3 + (uint32_t)c] = n[c] / length;
    }
}

static void add_quad(struct hg_mesh_part *p, const float (*c)[3])
{
    const float corners[2][3][3] = {
        {{c[0][0], c[0][1], c[0][2]}, {c[1][0], c[1][1], c[1][2]}, {c[2][0], c[2][1], c[2][2]}},
        {{c[0][0], c[0][1], c[0][2]}, {c[2][0], c[2][1], c[2][2]}, {c[3][0], c[3][1], c[3][2]}}};
    add_triangle(p, corners[0]);
    add_triangle(p, corners[1]);
}

// A plate of side x side cells, each 1 x 1 m, 0.3 m thick: every ninth cell is a hole through it.
static struct hg_mesh_part make_sieve(int side)
{
    struct hg_mesh_part p = lod_part((uint32_t)(side * side * 36), (uint32_t)(side * side * 36));
    const float low = 0.0f, high = 0.3f;
    p.vertex_count = p.index_count = 0;
    for (int i = 0; i < side * side; i++) {
        const float x = (float)(i % side), z = (float)(i / side), u = x + 1.0f, w = z + 1.0f;
        const bool hole = i % side % 3 == 1 && i / side % 3 == 1;
        if (!hole) {
            add_quad(
                &p, (const float[4][3]){{x, high, z}, {x, high, w}, {u, high, w}, {u, high, z}});
            add_quad(&p, (const float[4][3]){{x, low, z}, {u, low, z}, {u, low, w}, {x, low, w}});
        }
        // Walls: of the hole inwards, of the plate outwards.
        if (hole || i % side == 0)
            add_quad(&p, (const float[4][3]){{x, low, z}, {x, low, w}, {x, high, w}, {x, high, z}});
        if (hole || i % side == side - 1)
            add_quad(&p, (const float[4][3]){{u, low, z}, {u, high, z}, {u, high, w}, {u, low, w}});
        if (hole || i / side == 0)
            add_quad(&p, (const float[4][3]){{x, low, z}, {x, high, z}, {u, high, z}, {u, low, z}});
        if (hole || i / side == side - 1)
            add_quad(&p, (const float[4][3]){{x, low, w}, {u, low, w}, {u, high, w}, {x, high, w}});
    }
    return p;
}

// Least error that a cut of at most `most` triangles states.
static float error_of_cut(const struct hg_mesh_part *part, uint32_t most)
{
    const struct hg_lod_params params = {0};
    struct hg_error err = {0};
    struct hg_lod *lod = NULL;
    uint8_t *data;
    size_t size;
    float error;
    assert_int_equal(hg_lod_bake(part, &params, &data, &size, NULL, &err), HG_OK);
    assert_int_equal(hg_lod_open(data, size, &lod, &err), HG_OK);
    for (error = lod->source_error; error < 1e6f; error *= 1.1f) {
        struct surface cut = cut_of(lod, error);
        const uint32_t count = cut.count;
        hg_free(cut.corners);
        if (count <= most)
            break;
    }
    hg_lod_close(lod);
    hg_free(data);
    return error;
}

// Specks that float far from a surface go when they are small, not when their distance is.
static void test_specks(void **state)
{
    (void)state;
    enum { SPECKS = 300, MOST = 200 };
    uint32_t seed = 3;
    struct hg_mesh_part torus = lod_torus(90, 44, 1.0f);
    const float alone = error_of_cut(&torus, MOST);
    struct hg_mesh_part p =
        lod_part(torus.vertex_count + 3 * SPECKS, torus.index_count + 3 * SPECKS);
    memcpy(p.indices, torus.indices, torus.index_count * sizeof *p.indices);
    memcpy(p.positions, torus.positions, torus.vertex_count * sizeof(float[3]));
    memcpy(p.normals, torus.normals, torus.vertex_count * sizeof(float[3]));
    p.vertex_count = torus.vertex_count;
    p.index_count = torus.index_count;
    for (int i = 0; i < SPECKS; i++) {
        const float x = 0.5f * lod_random_unit(&seed), y = 3.0f * lod_random_unit(&seed);
        add_triangle(&p, (const float[3][3]){{x, y, 0}, {x + 0.01f, y, 0}, {x, y + 0.01f, 0}});
    }
    const float with = error_of_cut(&p, MOST);
    print_message(
        "200 triangles of a torus: %.4f m, with 300 specks %.4f m\n", (double)alone, (double)with);
    assert_true(with < 1.3f * alone);
    lod_part_finish(&p);
    lod_part_finish(&torus);
}

// A surface of a hundred tunnels gives up tunnels, not its corners.
static void test_tunnels(void **state)
{
    (void)state;
    struct hg_mesh_part p = make_sieve(30);
    const float error = error_of_cut(&p, 400);
    print_message("400 triangles of a plate with 100 holes: %.3f m\n", (double)error);
    assert_true(error < 1.0f);
    lod_part_finish(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_terrain),
        cmocka_unit_test(test_sphere_like),
        cmocka_unit_test(test_specks),
        cmocka_unit_test(test_tunnels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
