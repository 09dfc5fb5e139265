#include "renderer/scene/demo/demo_shapes.h"

#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/xform.h"

void hg_shape_finish(struct hg_shape *shape)
{
    hg_free(shape->positions);
    hg_free(shape->normals);
    hg_free(shape->uv);
    hg_free(shape->indices);
    memset(shape, 0, sizeof *shape);
}

enum hg_status hg_shape_to_part(struct hg_shape *shape, struct hg_mesh_part *part)
{
    if (shape->failed) {
        hg_shape_finish(shape);
        return HG_E_NOMEM;
    }
    part->topology = HG_TOPOLOGY_TRIANGLES;
    part->positions = shape->positions;
    part->normals = shape->normals;
    part->uv[0] = shape->uv;
    part->indices = shape->indices;
    part->vertex_count = shape->vertex_count;
    part->index_count = shape->index_count;
    memset(shape, 0, sizeof *shape);
    return HG_OK;
}

// Room for more; false once memory has run out.
static bool reserve(struct hg_shape *s, uint32_t vertices, uint32_t indices)
{
    size_t v = (size_t)s->vertex_count + vertices, i = (size_t)s->index_count + indices;
    if (s->failed || hg_grow(&s->positions, &s->position_capacity, v * 3, sizeof(float)) ||
        hg_grow(&s->normals, &s->normal_capacity, v * 3, sizeof(float)) ||
        hg_grow(&s->uv, &s->uv_capacity, v * 2, sizeof(float)) ||
        hg_grow(&s->indices, &s->index_capacity, i, sizeof(uint32_t)))
        s->failed = true;
    return !s->failed;
}

static void add_vertex(
    struct hg_shape *s, const float position[3], const float normal[3], const float uv[2])
{
    memcpy(s->positions + (size_t)s->vertex_count * 3, position, 3 * sizeof(float));
    memcpy(s->normals + (size_t)s->vertex_count * 3, normal, 3 * sizeof(float));
    memcpy(s->uv + (size_t)s->vertex_count * 2, uv, 2 * sizeof(float));
    s->vertex_count++;
}

static void add_quads(struct hg_shape *s, uint32_t first, uint32_t columns, uint32_t rows)
{
    for (uint32_t r = 0; r < rows; r++)
        for (uint32_t c = 0; c < columns; c++) {
            uint32_t a = first + r * (columns + 1) + c, b = a + columns + 1;
            const uint32_t quad[6] = {a, a + 1, b + 1, a, b + 1, b};
            memcpy(s->indices + s->index_count, quad, sizeof quad);
            s->index_count += 6;
        }
}

static void surface_normal(hg_surface_fn *surface, const void *user, float s, float t, float n[3])
{
    const float e = 1e-3f;
    float a[3], b[3], c[3], d[3], uv[2], ds[3], dt[3];
    surface(user, s - e, t, a, uv);
    surface(user, s + e, t, b, uv);
    surface(user, s, t - e, c, uv);
    surface(user, s, t + e, d, uv);
    for (int i = 0; i < 3; i++) {
        ds[i] = b[i] - a[i];
        dt[i] = d[i] - c[i];
    }
    hg_cross3(ds, dt, n);
}

void hg_shape_add_grid(struct hg_shape *shape, uint32_t columns, uint32_t rows,
    hg_surface_fn *surface, const void *user)
{
    if (!reserve(shape, (columns + 1) * (rows + 1), columns * rows * 6))
        return;
    uint32_t first = shape->vertex_count;
    for (uint32_t r = 0; r <= rows; r++)
        for (uint32_t c = 0; c <= columns; c++) {
            float s = (float)c / (float)columns, t = (float)r / (float)rows;
            float p[3], n[3], uv[2];
            surface(user, s, t, p, uv);
            surface_normal(surface, user, s, t, n);
            if (!hg_normalize3(n)) { // a pole: look from a little way off
                surface_normal(surface, user, s, t + (t < 0.5f ? 4e-3f : -4e-3f), n);
                if (!hg_normalize3(n))
                    n[1] = 1;
            }
            add_vertex(shape, p, n, uv);
        }
    add_quads(shape, first, columns, rows);
}

// ---- box ---------------------------------------------------------------------------------------

enum { BEVEL_STEPS = 3, BOX_LINES = 2 * BEVEL_STEPS + 2 };

// Grid lines across one side: dense over the bevels.
static float box_line(int i, float half, float bevel)
{
    if (i <= BEVEL_STEPS)
        return -half + bevel * (float)i / BEVEL_STEPS;
    return half - bevel * (float)(BOX_LINES - 1 - i) / BEVEL_STEPS;
}

static void box_vertex(struct hg_shape *shape, const float center[3], const float p[3],
    const float half[3], float bevel, int axis)
{
    float position[3], n[3], uv[2];
    for (int i = 0; i < 3; i++) {
        float inner = half[i] - bevel;
        float core = p[i] < -inner ? -inner : p[i] > inner ? inner : p[i];
        n[i] = p[i] - core;
        position[i] = core;
    }
    hg_normalize3(n);
    for (int i = 0; i < 3; i++)
        position[i] += n[i] * bevel + center[i];
    uv[0] = axis == 0 ? position[2] : position[0];
    uv[1] = axis == 1 ? position[2] : -position[1];
    add_vertex(shape, position, n, uv);
}

static void box_side(
    struct hg_shape *shape, const float center[3], const float half[3], float bevel, int side)
{
    int axis = side / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
    uint32_t first = shape->vertex_count;
    for (int r = 0; r < BOX_LINES; r++)
        for (int c = 0; c < BOX_LINES; c++) {
            float p[3];
            p[axis] = side % 2 ? half[axis] : -half[axis];
            p[u] = box_line(side % 2 ? c : BOX_LINES - 1 - c, half[u], bevel);
            p[v] = box_line(r, half[v], bevel);
            box_vertex(shape, center, p, half, bevel, axis);
        }
    add_quads(shape, first, BOX_LINES - 1, BOX_LINES - 1);
}

void hg_shape_add_box(
    struct hg_shape *shape, const float center[3], const float size[3], float bevel)
{
    const float half[3] = {size[0] / 2, size[1] / 2, size[2] / 2};
    if (!reserve(shape, 6 * BOX_LINES * BOX_LINES, 6 * 6 * (BOX_LINES - 1) * (BOX_LINES - 1)))
        return;
    for (int side = 0; side < 6; side++)
        box_side(shape, center, half, bevel, side);
}

// ---- lathe -------------------------------------------------------------------------------------

struct lathe_span {
    const struct hg_lathe *lathe;
    const float (*points)[2];
    uint32_t count;
    float length, offset; // metres along the profile: of the span, before it
    float widest;
};

// Catmull-Rom through the points of a span keeps turned profiles smooth.
static void profile_at(const struct lathe_span *span, float t, float out[2])
{
    float x = t * (float)(span->count - 1);
    int last = (int)span->count - 1, i = (int)floorf(x);
    i = i < 0 ? 0 : i > last - 1 ? last - 1 : i;
    float f = x - (float)i;
    const float *p0 = span->points[i > 0 ? i - 1 : 0], *p1 = span->points[i];
    const float *p2 = span->points[i + 1], *p3 = span->points[i + 2 > last ? last : i + 2];
    for (int k = 0; k < 2; k++) {
        if (span->count == 2) {
            out[k] = p1[k] + (p2[k] - p1[k]) * f;
            continue;
        }
        float m1 = (p2[k] - p0[k]) / 2, m2 = (p3[k] - p1[k]) / 2, f2 = f * f, f3 = f2 * f;
        out[k] = (2 * f3 - 3 * f2 + 1) * p1[k] + (f3 - 2 * f2 + f) * m1 +
                 (3 * f2 - 2 * f3) * p2[k] + (f3 - f2) * m2;
    }
}

static void lathe_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    const struct lathe_span *span = user;
    const struct hg_lathe *l = span->lathe;
    float point[2], angle = s * 2 * (float)M_PI;
    profile_at(span, t, point);
    float radius = point[0];
    if (l->flutes) {
        float wave = fabsf(sinf(angle * (float)l->flutes / 2));
        radius *= 1 - l->flute_depth * wave;
    }
    position[0] = l->center[0] + radius * sinf(angle);
    position[1] = l->center[1] + point[1];
    position[2] = l->center[2] + radius * cosf(angle);
    uv[0] = s * span->widest * 2 * (float)M_PI;
    uv[1] = span->offset + t * span->length;
}

static float span_length(const struct lathe_span *span)
{
    float length = 0;
    for (uint32_t i = 1; i < span->count; i++)
        length += hypotf(span->points[i][0] - span->points[i - 1][0],
            span->points[i][1] - span->points[i - 1][1]);
    return length;
}

void hg_shape_add_lathe(struct hg_shape *shape, const struct hg_lathe *lathe)
{
    float widest = 0, offset = 0;
    for (uint32_t i = 0; i < lathe->count; i++)
        widest = fmaxf(widest, lathe->profile[i][0]);
    for (uint32_t begin = 0, i = 1; i <= lathe->count; i++) {
        bool crease = i == lathe->count ||
                      memcmp(lathe->profile[i], lathe->profile[i - 1], 2 * sizeof(float)) == 0;
        if (!crease)
            continue;
        struct lathe_span span = {.lathe = lathe,
            .points = lathe->profile + begin,
            .count = i - begin,
            .offset = offset,
            .widest = widest};
        span.length = span_length(&span);
        offset += span.length;
        begin = i;
        if (span.count < 2)
            continue;
        uint32_t rows = span.count == 2 ? 1 : (span.count - 1) * 3;
        hg_shape_add_grid(shape, lathe->segments, rows, lathe_surface, &span);
    }
}

// ---- round things ------------------------------------------------------------------------------

struct ball {
    float center[3], radius, tube;
};

static void sphere_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    const struct ball *b = user;
    float theta = -s * 2 * (float)M_PI, phi = t * (float)M_PI;
    position[0] = b->center[0] + b->radius * sinf(phi) * sinf(theta);
    position[1] = b->center[1] + b->radius * cosf(phi);
    position[2] = b->center[2] + b->radius * sinf(phi) * cosf(theta);
    uv[0] = s * 2;
    uv[1] = t;
}

void hg_shape_add_sphere(
    struct hg_shape *shape, const float center[3], float radius, uint32_t segments)
{
    struct ball b = {.radius = radius};
    memcpy(b.center, center, sizeof b.center);
    uint32_t first = shape->vertex_count;
    hg_shape_add_grid(shape, segments, segments / 2, sphere_surface, &b);
    for (uint32_t v = first; !shape->failed && v < shape->vertex_count; v++)
        for (int i = 0; i < 3; i++) // exact normals, poles too
            shape->normals[v * 3 + i] = (shape->positions[v * 3 + i] - center[i]) / radius;
}

static void torus_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    const struct ball *b = user;
    float theta = s * 2 * (float)M_PI, phi = t * 2 * (float)M_PI;
    float r = b->radius + b->tube * cosf(phi);
    position[0] = b->center[0] + r * sinf(theta);
    position[1] = b->center[1] + b->tube * sinf(phi);
    position[2] = b->center[2] + r * cosf(theta);
    uv[0] = s * 2 * (float)M_PI * b->radius;
    uv[1] = t * 2 * (float)M_PI * b->tube;
}

void hg_shape_add_torus(
    struct hg_shape *shape, const float center[3], float radius, float tube, uint32_t segments)
{
    struct ball b = {.radius = radius, .tube = tube};
    memcpy(b.center, center, sizeof b.center);
    hg_shape_add_grid(shape, segments, 14, torus_surface, &b);
}

struct rod {
    float a[3], axis[3], x[3], z[3], length, radius;
};

// t runs over a round cap, the side and the other cap.
static void rod_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    const struct rod *r = user;
    float theta = -s * 2 * (float)M_PI, along, radius;
    if (t < 0.25f) {
        along = r->length + r->radius * cosf(t * 2 * (float)M_PI);
        radius = r->radius * sinf(t * 2 * (float)M_PI);
    } else if (t > 0.75f) {
        along = -r->radius * cosf((1 - t) * 2 * (float)M_PI);
        radius = r->radius * sinf((1 - t) * 2 * (float)M_PI);
    } else {
        along = r->length * (1 - (t - 0.25f) * 2);
        radius = r->radius;
    }
    for (int i = 0; i < 3; i++)
        position[i] =
            r->a[i] + r->axis[i] * along + radius * (r->x[i] * sinf(theta) + r->z[i] * cosf(theta));
    uv[0] = s * 2 * (float)M_PI * r->radius;
    uv[1] = -along;
}

void hg_shape_add_rod(struct hg_shape *shape, const float a[3], const float b[3], float radius)
{
    struct rod r = {.radius = radius};
    memcpy(r.a, a, sizeof r.a);
    for (int i = 0; i < 3; i++)
        r.axis[i] = b[i] - a[i];
    r.length = sqrtf(hg_dot3(r.axis, r.axis));
    hg_normalize3(r.axis);
    const float helper[3] = {fabsf(r.axis[0]) < 0.9f, fabsf(r.axis[0]) >= 0.9f, 0};
    hg_cross3(r.axis, helper, r.z);
    hg_normalize3(r.z);
    hg_cross3(r.axis, r.z, r.x);
    hg_shape_add_grid(shape, 12, 16, rod_surface, &r);
}

// ---- arch --------------------------------------------------------------------------------------

struct arch_face {
    const struct hg_arch *arch;
    float z;    // plane of the face
    float sign; // +1: seen from +z
};

static float arch_height(const struct hg_arch *a, float x)
{
    float inside = a->radius * a->radius - x * x;
    return a->spring + (inside > 0 ? sqrtf(inside) : 0);
}

// Between the opening and the top, denser towards the springing where the curve is steep.
static void face_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    const struct arch_face *f = user;
    float side = (s * 2 - 1) * f->sign;
    float x = side < -1 || side > 1 ? side : sinf(side * (float)M_PI / 2);
    x *= f->arch->radius;
    float low = arch_height(f->arch, x);
    position[0] = x;
    position[1] = low + (f->arch->top - low) * t;
    position[2] = f->z;
    uv[0] = x;
    uv[1] = -position[1];
}

static void pier_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    const struct arch_face *f = user;
    float from = f->arch->radius, to = f->arch->bay / 2;
    position[0] = f->sign > 0 ? from + (to - from) * s : to + (from - to) * s;
    position[1] = f->arch->spring + (f->arch->top - f->arch->spring) * t;
    position[2] = f->z;
    uv[0] = position[0];
    uv[1] = -position[1];
}

static void intrados_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    const struct arch_face *f = user;
    float angle = (1 - t) * (float)M_PI;
    position[0] = f->arch->radius * cosf(angle);
    position[1] = f->arch->spring + f->arch->radius * sinf(angle);
    position[2] = (0.5f - s) * f->arch->depth;
    uv[0] = position[2];
    uv[1] = angle * f->arch->radius;
}

// A rounded band that stands out around the opening.
static void band_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    const struct arch_face *f = user;
    float angle = (1 - t) * (float)M_PI, around = s * (float)M_PI;
    float out = f->arch->band * 0.5f;
    float r = f->arch->radius + f->arch->band * 0.55f + out * cosf(around);
    position[0] = r * cosf(angle) * f->sign;
    position[1] = f->arch->spring + r * sinf(angle);
    position[2] = f->z + f->sign * out * 0.8f * sinf(around);
    uv[0] = around * out;
    uv[1] = angle * r;
}

static void sole_surface(const void *user, float s, float t, float position[3], float uv[2])
{
    const struct arch_face *f = user;
    float from = f->arch->radius, to = f->arch->bay / 2;
    position[0] = f->sign * (from + (to - from) * s);
    position[1] = f->arch->spring;
    position[2] = (t - 0.5f) * f->arch->depth * f->sign;
    uv[0] = position[0];
    uv[1] = position[2];
}

void hg_shape_add_arch(struct hg_shape *shape, const struct hg_arch *arch)
{
    for (int side = -1; side <= 1; side += 2) {
        struct arch_face face = {
            .arch = arch, .z = (float)side * arch->depth / 2, .sign = (float)side};
        hg_shape_add_grid(shape, 48, 2, face_surface, &face);
        hg_shape_add_grid(shape, 8, 48, band_surface, &face);
        uint32_t first = shape->vertex_count;
        hg_shape_add_grid(shape, 1, 1, pier_surface, &face);
        hg_shape_add_grid(shape, 1, 1, pier_surface, &face);
        for (uint32_t v = first + 4; !shape->failed && v < first + 8; v++)
            shape->positions[v * 3] *= -1; // the pier of the other side...
        for (uint32_t i = shape->index_count - 6; !shape->failed && i < shape->index_count;
             i += 3) {
            uint32_t swap = shape->indices[i + 1]; // ...wound the other way round
            shape->indices[i + 1] = shape->indices[i + 2];
            shape->indices[i + 2] = swap;
        }
        hg_shape_add_grid(shape, 1, 1, sole_surface, &face);
    }
    struct arch_face inner = {.arch = arch, .sign = 1};
    hg_shape_add_grid(shape, 1, 48, intrados_surface, &inner);
}
