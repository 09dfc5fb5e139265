// scene_tangents.c - tangents against a reference that applies MikkTSpace's rules by brute force,
// and against meshes whose tangents are known: a plane, a cube, a cylinder with a seam, a wave
// whose image is mirrored in stripes.
//
// The rules (Mikkelsen 2008, chapter 2 and appendix): corners with equal position, normal and uv
// are one vertex; triangles around a vertex that are joined by edges and keep the same orientation
// in uv form a group; the group's tangent is the mean of its triangles' unit du/dposition, each
// projected onto the plane of the normal, weighted by the triangle's angle at the vertex.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/xform.h"

enum { MAX_CORNERS = 3 * 2048 };

struct corner {
    double p[3], n[3], uv[2];
};

static struct corner corners[MAX_CORNERS];
static uint32_t corner_count;

// --- the reference -------------------------------------------------------------------------------

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void unit(double v[3])
{
    double l = sqrt(dot(v, v));
    for (int i = 0; i < 3 && l > 0; i++)
        v[i] /= l;
}

static void project(const double v[3], const double n[3], double out[3])
{
    double d = dot(v, n);
    for (int i = 0; i < 3; i++)
        out[i] = v[i] - n[i] * d;
    unit(out);
}

static bool one_vertex(uint32_t a, uint32_t b)
{
    return memcmp(&corners[a], &corners[b], sizeof *corners) == 0;
}

// Twice the area in uv; the unit direction of growing u.
static double frame_of(uint32_t triangle, double s[3])
{
    const struct corner *c = &corners[3 * triangle];
    double u1 = c[1].uv[0] - c[0].uv[0], v1 = c[1].uv[1] - c[0].uv[1];
    double u2 = c[2].uv[0] - c[0].uv[0], v2 = c[2].uv[1] - c[0].uv[1], area = u1 * v2 - u2 * v1;
    for (int i = 0; i < 3; i++)
        s[i] = (v2 * (c[1].p[i] - c[0].p[i]) - v1 * (c[2].p[i] - c[0].p[i])) / area;
    unit(s);
    return area;
}

static double angle_at(uint32_t corner)
{
    const struct corner *c = corners + corner - corner % 3, *at = &corners[corner];
    const struct corner *next = &c[(corner + 1) % 3], *last = &c[(corner + 2) % 3];
    double a[3], b[3], pa[3], pb[3];
    for (int i = 0; i < 3; i++) {
        a[i] = next->p[i] - at->p[i];
        b[i] = last->p[i] - at->p[i];
    }
    project(a, at->n, pa);
    project(b, at->n, pb);
    return acos(fmin(fmax(dot(pa, pb), -1), 1));
}

// Two corners of one vertex whose triangles have an edge in common.
static bool share_edge(uint32_t a, uint32_t b)
{
    const uint32_t ta = a - a % 3, tb = b - b % 3;
    for (uint32_t i = 1; i < 3; i++)
        for (uint32_t k = 1; k < 3; k++)
            if (one_vertex(ta + (a + i) % 3, tb + (b + k) % 3))
                return true;
    return false;
}

static double reference(uint32_t corner, double out[3])
{
    static uint32_t group[MAX_CORNERS];
    uint32_t count = 1;
    double s[3], orient = frame_of(corner / 3, s);
    group[0] = corner;
    for (uint32_t done = 0; done < count; done++)
        for (uint32_t c = 0; c < corner_count; c++) {
            bool is_new = one_vertex(c, corner) && share_edge(group[done], c) &&
                          frame_of(c / 3, s) * orient > 0;
            for (uint32_t i = 0; i < count && is_new; i++)
                is_new = group[i] != c;
            if (is_new)
                group[count++] = c;
        }
    memset(out, 0, 3 * sizeof *out);
    for (uint32_t i = 0; i < count; i++) {
        double flat[3], angle = angle_at(group[i]);
        frame_of(group[i] / 3, s);
        project(s, corners[corner].n, flat);
        for (int k = 0; k < 3; k++)
            out[k] += flat[k] * angle;
    }
    unit(out);
    return orient;
}

// --- what the loader makes -----------------------------------------------------------------------

// Unindexed on the way in: welding is part of the job.
static void make_part(struct hg_mesh_part *part)
{
    *part = (struct hg_mesh_part){.vertex_count = corner_count, .index_count = corner_count};
    part->indices = hg_calloc(corner_count, sizeof(uint32_t));
    part->positions = hg_calloc(corner_count, 3 * sizeof(float));
    part->normals = hg_calloc(corner_count, 3 * sizeof(float));
    part->uv[0] = hg_calloc(corner_count, 2 * sizeof(float));
    assert_true(part->indices && part->positions && part->normals && part->uv[0]);
    for (uint32_t c = 0; c < corner_count; c++) {
        part->indices[c] = c;
        for (int i = 0; i < 3; i++) {
            part->positions[c * 3 + (uint32_t)i] = (float)corners[c].p[i];
            part->normals[c * 3 + (uint32_t)i] = (float)corners[c].n[i];
        }
        for (int i = 0; i < 2; i++)
            part->uv[0][c * 2 + (uint32_t)i] = (float)corners[c].uv[i];
    }
    assert_int_equal(hg_part_make_tangents(part, 0, 0), HG_OK);
}

static void check(const char *name, double tolerance)
{
    struct hg_mesh_part part;
    double worst = 0;
    make_part(&part);
    for (uint32_t c = 0; c < corner_count; c++) {
        const float *t = part.tangents + (size_t)part.indices[c] * 4;
        double want[3], orient = reference(c, want), off = 0;
        for (int i = 0; i < 3; i++)
            off = fmax(off, fabs(want[i] - (double)t[i]));
        worst = fmax(worst, off);
        if (off > tolerance || t[3] != (orient > 0 ? -1 : 1)) // v runs down, green points up
            fail_msg("%s, corner %u: %g %g %g w %g, expected %g %g %g w %d", name, c, (double)t[0],
                (double)t[1], (double)t[2], (double)t[3], want[0], want[1], want[2],
                orient > 0 ? -1 : 1);
    }
    print_message("%s: %u corners, worst component off by %.1e\n", name, corner_count, worst);
    hg_mesh_part_finish(&part, 0);
}

// --- meshes --------------------------------------------------------------------------------------

// Rounded to floats, so that the reference sees what the loader sees.
static void add_corner(const double p[3], const double n[3], double u, double v)
{
    assert_true(corner_count < MAX_CORNERS);
    struct corner *c = &corners[corner_count++];
    double m[3] = {n[0], n[1], n[2]};
    unit(m);
    for (int i = 0; i < 3; i++) {
        c->p[i] = (double)(float)p[i] + 0.0;
        c->n[i] = (double)(float)m[i] + 0.0;
    }
    c->uv[0] = (double)(float)u;
    c->uv[1] = (double)(float)v;
}

static void add_quad(double p[4][3], double n[4][3], double uv[4][2])
{
    static const int order[6] = {0, 1, 2, 0, 2, 3};
    for (int i = 0; i < 6; i++)
        add_corner(p[order[i]], n[order[i]], uv[order[i]][0], uv[order[i]][1]);
}

// Tangent of every corner of the part is `t` with sign `w`.
static void expect_all(const double t[3], float w)
{
    struct hg_mesh_part part;
    make_part(&part);
    for (uint32_t v = 0; v < corner_count; v++) {
        const float *got = part.tangents + (size_t)part.indices[v] * 4;
        for (int i = 0; i < 3; i++)
            assert_float_equal(got[i], t[i], 1e-6f);
        assert_true(got[3] == w);
    }
    hg_mesh_part_finish(&part, 0);
}

// u along +x and v along -y, then turned by 90 degrees, then mirrored.
static void test_plane(void **state)
{
    (void)state;
    double p[4][3] = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}};
    double n[4][3] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
    double upright[4][2] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    double turned[4][2] = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
    double mirrored[4][2] = {{1, 1}, {0, 1}, {0, 0}, {1, 0}};
    corner_count = 0;
    add_quad(p, n, upright);
    expect_all((const double[]){1, 0, 0}, 1);
    corner_count = 0;
    add_quad(p, n, turned);
    expect_all((const double[]){0, 1, 0}, 1);
    corner_count = 0;
    add_quad(p, n, mirrored);
    expect_all((const double[]){-1, 0, 0}, -1);
}

// Six faces, each with the whole image; hard normals: every face has its own frame. Round normals:
// corners still differ in uv, so that each keeps its face's direction, laid into its own plane.
static void make_cube(bool round)
{
    corner_count = 0;
    for (int f = 0; f < 6; f++) {
        const int axis = f / 2, a = (axis + 1) % 3, b = (axis + 2) % 3, side = f % 2 ? -1 : 1;
        const int turn[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
        double p[4][3], n[4][3] = {{0}}, uv[4][2];
        for (int i = 0; i < 4; i++) {
            p[i][axis] = side;
            p[i][a] = turn[i][0] * side; // counter-clockwise from outside
            p[i][b] = turn[i][1];
            n[i][axis] = side;
            uv[i][0] = (turn[i][0] + 1) / 2;
            uv[i][1] = (1 - turn[i][1]) / 2;
        }
        add_quad(p, round ? p : n, uv);
    }
}

static void test_cube(void **state)
{
    (void)state;
    make_cube(false);
    check("cube, hard edges", 1e-6);
    struct hg_mesh_part part;
    make_part(&part);
    for (uint32_t c = 0; c < corner_count; c++) { // u runs along axis a of each face
        const int face = (int)c / 6, a = (face / 2 + 1) % 3;
        const float *t = part.tangents + (size_t)part.indices[c] * 4;
        const float along = face % 2 ? -1 : 1;
        assert_float_equal(t[a], along, 1e-6f);
        assert_true(t[3] == 1);
    }
    hg_mesh_part_finish(&part, 0);
    make_cube(true);
    check("cube, round normals", 1e-6);
}

// A cone: its angles differ around a vertex. u goes once round and jumps from 1 to 0 at the seam.
static void test_seam(void **state)
{
    (void)state;
    enum { AROUND = 12, UP = 4 };
    corner_count = 0;
    for (int y = 0; y < UP; y++)
        for (int x = 0; x < AROUND; x++) {
            double p[4][3], n[4][3], uv[4][2];
            for (int i = 0; i < 4; i++) {
                int column = x + (i == 1 || i == 2), row = y + (i >= 2);
                double phi = 2 * M_PI * (column % AROUND) / AROUND, r = 2 - 0.3 * row;
                const double at[3] = {r * cos(phi), row, -r * sin(phi)};
                const double out[3] = {cos(phi), 0.3, -sin(phi)};
                memcpy(p[i], at, sizeof at);
                memcpy(n[i], out, sizeof out);
                uv[i][0] = (double)column / AROUND;
                uv[i][1] = 1 - (double)row / UP;
            }
            add_quad(p, n, uv);
        }
    check("cone with a seam", 1e-6);
}

// Hills, with the image mirrored at every third column and uv that are sheared.
static void test_mirrored_stripes(void **state)
{
    (void)state;
    enum { SIDE = 13 };
    corner_count = 0;
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            double p[4][3], n[4][3], uv[4][2];
            for (int i = 0; i < 4; i++) {
                int c = x + (i == 1 || i == 2), r = y + (i >= 2), k = c % 6;
                const double at[3] = {c, r, sin(0.9 * c) * cos(0.7 * r)};
                const double up[3] = {
                    -0.9 * cos(0.9 * c) * cos(0.7 * r), 0.7 * sin(0.9 * c) * sin(0.7 * r), 1};
                memcpy(p[i], at, sizeof at);
                memcpy(n[i], up, sizeof up);
                uv[i][0] = (k <= 3 ? k : 6 - k) / 3.0 + 0.0625 * r;
                uv[i][1] = 1 - r * 0.125;
            }
            add_quad(p, n, uv);
        }
    check("hills, mirrored stripes", 1e-6);
}

// --- closed forms --------------------------------------------------------------------------------

static void *copy(const void *data, size_t bytes)
{
    void *out = hg_calloc(1, bytes);
    assert_non_null(out);
    return memcpy(out, data, bytes);
}

// A plane z = 0 whose u is |x|: mirrored at x = 0. The image stands upright (v = 1 - y).
static void test_mirrored_tangents(void **state)
{
    (void)state;
    static const float positions[] = {-1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 1, 0, 0, 1, 0, 1, 1, 0};
    static const float uv[] = {1, 1, 0, 1, 1, 1, 1, 0, 0, 0, 1, 0};
    static const float normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    static const uint32_t faces[] = {0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4};
    struct hg_mesh_part part = {.vertex_count = 6,
        .index_count = 12,
        .indices = copy(faces, sizeof faces),
        .positions = copy(positions, sizeof positions),
        .normals = copy(normals, sizeof normals),
        .uv = {copy(uv, sizeof uv), NULL}};
    assert_int_equal(hg_part_make_tangents(&part, 0, 0), HG_OK);
    assert_int_equal(part.vertex_count, 8); // the two on the seam are split
    for (uint32_t i = 0; i < part.index_count; i++) {
        const float *t = part.tangents + (size_t)part.indices[i] * 4;
        float side = i < 6 ? -1.0f : 1.0f;
        assert_float_equal(t[0], side, 1e-5f);
        assert_float_equal(t[1], 0, 1e-5f);
        assert_float_equal(t[2], 0, 1e-5f);
        assert_float_equal(t[3], side, 0); // cross(z, t) w = +y, up in the image, on both
        const float *p = part.positions + (size_t)part.indices[i] * 3;
        assert_memory_equal(p, positions + (size_t)faces[i] * 3, 3 * sizeof(float));
    }
    hg_mesh_part_finish(&part, 0);
}

enum { RINGS = 24, SEGMENTS = 48, SPHERE_VERTICES = (RINGS + 1) * (SEGMENTS + 1) };

static void make_sphere(struct hg_mesh_part *part)
{
    part->positions = hg_calloc(SPHERE_VERTICES, 3 * sizeof(float));
    part->normals = hg_calloc(SPHERE_VERTICES, 3 * sizeof(float));
    part->uv[0] = hg_calloc(SPHERE_VERTICES, 2 * sizeof(float));
    part->indices = hg_calloc((size_t)RINGS * SEGMENTS * 6, sizeof(uint32_t));
    assert_true(part->positions && part->normals && part->uv[0] && part->indices);
    for (uint32_t y = 0; y <= RINGS; y++)
        for (uint32_t x = 0; x <= SEGMENTS; x++) {
            uint32_t v = part->vertex_count++;
            float theta = (float)y / RINGS * 3.14159265f, phi = (float)x / SEGMENTS * 6.2831853f;
            float n[3] = {sinf(theta) * cosf(phi), cosf(theta), -sinf(theta) * sinf(phi)};
            memcpy(part->positions + (size_t)v * 3, n, sizeof n);
            memcpy(part->normals + (size_t)v * 3, n, sizeof n);
            part->uv[0][v * 2] = (float)x / SEGMENTS;
            part->uv[0][v * 2 + 1] = (float)y / RINGS;
        }
    for (uint32_t y = 0; y < RINGS; y++)
        for (uint32_t x = 0; x < SEGMENTS; x++) {
            uint32_t a = y * (SEGMENTS + 1) + x, b = a + SEGMENTS + 1;
            const uint32_t quad[] = {a, b, a + 1, a + 1, b, b + 1};
            memcpy(part->indices + part->index_count, quad, sizeof quad);
            part->index_count += 6;
        }
}

// Along +u, which is d/dphi of the position; only the poles, where u has no direction, differ.
static void test_sphere_tangents(void **state)
{
    (void)state;
    struct hg_mesh_part part = {0};
    make_sphere(&part);
    assert_int_equal(hg_part_make_tangents(&part, 0, 0), HG_OK);
    uint32_t checked = 0;
    for (uint32_t v = 0; v < part.vertex_count; v++) {
        const float *t = part.tangents + (size_t)v * 4, *n = part.normals + (size_t)v * 3;
        assert_float_equal(hg_dot3(t, t), 1, 1e-5f);
        assert_float_equal(hg_dot3(t, n), 0, 1e-5f);
        float y = part.uv[0][v * 2 + 1] * RINGS, phi = part.uv[0][v * 2] * 6.2831853f;
        if (y < 1.5f || y > RINGS - 1.5f)
            continue;
        const float u[3] = {-sinf(phi), 0, -cosf(phi)};
        if (hg_dot3(t, u) < 0.996f || t[3] != 1)
            fail_msg("ring %g, phi %g: cosine %g, w %g", (double)y, (double)phi,
                (double)hg_dot3(t, u), (double)t[3]);
        checked++;
    }
    assert_true(checked >= (RINGS - 3) * (SEGMENTS + 1));
    hg_mesh_part_finish(&part, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_plane), cmocka_unit_test(test_cube),
        cmocka_unit_test(test_seam), cmocka_unit_test(test_mirrored_stripes),
        cmocka_unit_test(test_mirrored_tangents), cmocka_unit_test(test_sphere_tangents)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
