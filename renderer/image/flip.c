#include "renderer/image/flip.h"

#include <math.h>

#include "base/alloc.h"
#include "renderer/image/planes.h"

// Section numbers are those of the paper (see flip.h).

struct vec3 {
    float x, y, z;
};

// Linear Rec.709 to CIE XYZ, D65 (IEC 61966-2-1, with the sums that give the white point).
static const float xyz_of_rgb[3][3] = {
    {0.41238656f, 0.35759149f, 0.18045049f},
    {0.21263682f, 0.71518298f, 0.07218020f},
    {0.01933062f, 0.11919716f, 0.95037259f},
};

static struct vec3 multiply(const float m[3][3], struct vec3 v)
{
    return (struct vec3){m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z,
        m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
        m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
}

static struct vec3 white_xyz(void)
{
    return multiply(xyz_of_rgb, (struct vec3){1, 1, 1});
}

// Inverse of xyz_of_rgb by cofactors.
static void invert(float out[3][3])
{
    const float(*m)[3] = xyz_of_rgb;
    double det = 0;
    for (int i = 0; i < 3; i++)
        det += (double)m[0][i] * ((double)m[1][(i + 1) % 3] * m[2][(i + 2) % 3] -
                                     (double)m[1][(i + 2) % 3] * m[2][(i + 1) % 3]);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            double cofactor = (double)m[(c + 1) % 3][(r + 1) % 3] * m[(c + 2) % 3][(r + 2) % 3] -
                              (double)m[(c + 1) % 3][(r + 2) % 3] * m[(c + 2) % 3][(r + 1) % 3];
            out[r][c] = (float)(cofactor / det);
        }
}

static float linear_of_srgb(float v)
{
    return v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
}

// XYZ to the opponent space of section 4.1.1 (linear CIELAB).
static struct vec3 ycxcz_of_xyz(struct vec3 c, struct vec3 white)
{
    float x = c.x / white.x, y = c.y / white.y, z = c.z / white.z;
    return (struct vec3){116.0f * y - 16.0f, 500.0f * (x - y), 200.0f * (y - z)};
}

static struct vec3 xyz_of_ycxcz(struct vec3 c, struct vec3 white)
{
    float y = (c.x + 16.0f) / 116.0f;
    return (struct vec3){(c.y / 500.0f + y) * white.x, y * white.y, (y - c.z / 200.0f) * white.z};
}

static float lab_curve(float t)
{
    const float delta = 6.0f / 29.0f;
    return t > delta * delta * delta ? cbrtf(t) : t / (3.0f * delta * delta) + 4.0f / 29.0f;
}

// CIELAB with the Hunt effect (section 4.1.2): chroma grows with lightness.
static struct vec3 hunt_lab_of_xyz(struct vec3 c, struct vec3 white)
{
    float x = lab_curve(c.x / white.x), y = lab_curve(c.y / white.y), z = lab_curve(c.z / white.z);
    float l = 116.0f * y - 16.0f;
    return (struct vec3){l, 0.01f * l * 500.0f * (x - y), 0.01f * l * 200.0f * (y - z)};
}

static float hyab(struct vec3 a, struct vec3 b)
{
    return fabsf(a.x - b.x) + sqrtf((a.y - b.y) * (a.y - b.y) + (a.z - b.z) * (a.z - b.z));
}

static const float color_exponent = 0.7f, feature_exponent = 0.5f;

static float max_color_error(void)
{
    struct vec3 white = white_xyz();
    struct vec3 green = multiply(xyz_of_rgb, (struct vec3){0, 1, 0});
    struct vec3 blue = multiply(xyz_of_rgb, (struct vec3){0, 0, 1});
    return powf(hyab(hunt_lab_of_xyz(green, white), hunt_lab_of_xyz(blue, white)), color_exponent);
}

// Section 4.1.3: errors up to pc of the largest fill 0..pt, the rest is squeezed above.
static float redistribute(float error, float largest)
{
    const float pc = 0.4f, pt = 0.95f, knee = pc * largest;
    if (error < knee)
        return pt / knee * error;
    return pt + (error - knee) / (largest - knee) * (1.0f - pt);
}

// One Gaussian exp(-pi^2 d^2 / b) of the contrast sensitivity filters (section 4.1.1), d in
// degrees; the taps sum to 1 and the sum before is returned.
static float sensitivity_taps(struct hg_taps *taps, float b, int radius, float pixels_per_degree)
{
    const float pi = 3.14159265f;
    float sum = 0;
    taps->radius = radius;
    for (int i = -radius; i <= radius; i++) {
        float d = (float)i / pixels_per_degree;
        sum += taps->x[i + radius] = expf(-pi * pi * d * d / b);
    }
    for (int i = 0; i <= 2 * radius; i++)
        taps->y[i] = taps->x[i] /= sum;
    return sum;
}

struct sensitivity {
    float a1, b1, a2, b2;
};

static const struct sensitivity sensitivities[3] = {
    {1.0f, 0.0047f, 0.0f, 1e-5f},
    {1.0f, 0.0053f, 0.0f, 1e-5f},
    {34.1f, 0.04f, 13.5f, 0.025f},
};

static int clamp_radius(float radius)
{
    return radius < 1 ? 1 : radius > hg_max_filter_radius ? hg_max_filter_radius : (int)radius;
}

static void filter_sensitivity(float *dst, const float *src, float *scratch,
    const struct hg_image *size, int channel, float pixels_per_degree)
{
    const float pi = 3.14159265f, widest = 0.04f;
    const struct sensitivity *s = &sensitivities[channel];
    int radius = clamp_radius(ceilf(3.0f * sqrtf(widest / (2.0f * pi * pi)) * pixels_per_degree));
    struct hg_taps first, second;
    float sum1 = sensitivity_taps(&first, s->b1, radius, pixels_per_degree);
    float sum2 = sensitivity_taps(&second, s->b2, radius, pixels_per_degree);
    float w1 = s->a1 * sqrtf(pi / s->b1) * sum1 * sum1;
    float w2 = s->a2 * sqrtf(pi / s->b2) * sum2 * sum2;
    hg_plane_filter_add(
        dst, src, scratch, (const uint32_t[2]){size->width, size->height}, &first, w1 / (w1 + w2));
    if (w2 > 0)
        hg_plane_filter_add(dst, src, scratch, (const uint32_t[2]){size->width, size->height},
            &second, w2 / (w1 + w2));
}

// Planes of one picture: opponent colours, then the same filtered.
struct opponent {
    float *color[3], *seen[3];
};

static void to_opponent(const struct hg_image *image, struct opponent *o)
{
    struct vec3 white = white_xyz();
    for (size_t i = 0; i < (size_t)image->width * image->height; i++) {
        float rgb[3];
        hg_display_pixel(image, i, rgb);
        struct vec3 linear = {
            linear_of_srgb(rgb[0]), linear_of_srgb(rgb[1]), linear_of_srgb(rgb[2])};
        struct vec3 c = ycxcz_of_xyz(multiply(xyz_of_rgb, linear), white);
        o->color[0][i] = c.x;
        o->color[1][i] = c.y;
        o->color[2][i] = c.z;
    }
}

static float clamp01(float v)
{
    return fminf(fmaxf(v, 0.0f), 1.0f);
}

static struct vec3 seen_lab(
    const struct opponent *o, size_t i, const float rgb_of_xyz[3][3], struct vec3 white)
{
    struct vec3 c = {o->seen[0][i], o->seen[1][i], o->seen[2][i]};
    struct vec3 rgb = multiply(rgb_of_xyz, xyz_of_ycxcz(c, white));
    struct vec3 inside = {clamp01(rgb.x), clamp01(rgb.y), clamp01(rgb.z)};
    return hunt_lab_of_xyz(multiply(xyz_of_rgb, inside), white);
}

static void color_errors(
    const struct opponent *a, const struct opponent *b, size_t count, float *error)
{
    float rgb_of_xyz[3][3], largest = max_color_error();
    struct vec3 white = white_xyz();
    invert(rgb_of_xyz);
    for (size_t i = 0; i < count; i++) {
        float d = hyab(seen_lab(a, i, rgb_of_xyz, white), seen_lab(b, i, rgb_of_xyz, white));
        error[i] = redistribute(powf(d, color_exponent), largest);
    }
}

// First (edges) or second (points) derivative of a Gaussian along x (section 4.2); positive and
// negative weights sum to +1 and -1.
static void feature_taps(struct hg_taps *taps, float pixels_per_degree, bool points)
{
    const float feature_width_deg = 0.082f, sigma = 0.5f * feature_width_deg * pixels_per_degree;
    int radius = clamp_radius(ceilf(3.0f * sigma));
    float positive = 0, negative = 0, sum = 0;
    taps->radius = radius;
    for (int i = -radius; i <= radius; i++) {
        float x = (float)i, g = expf(-x * x / (2.0f * sigma * sigma));
        float v = points ? (x * x / (sigma * sigma) - 1.0f) * g : -x * g;
        taps->x[i + radius] = v;
        taps->y[i + radius] = g;
        sum += g;
        *(v > 0 ? &positive : &negative) += v;
    }
    for (int i = 0; i <= 2 * radius; i++) {
        taps->x[i] /= taps->x[i] > 0 ? positive : -negative;
        taps->y[i] /= sum;
    }
}

static struct hg_taps turned(const struct hg_taps *taps)
{
    struct hg_taps t = {.radius = taps->radius};
    for (int i = 0; i <= 2 * taps->radius; i++) {
        t.x[i] = taps->y[i];
        t.y[i] = taps->x[i];
    }
    return t;
}

struct feature_planes {
    float *luma, *scratch, *dx, *dy, *magnitude;
};

// |gradient| of the luma of `o` for one kind of feature.
static void feature_magnitude(const struct opponent *o, const struct hg_image *size,
    const struct hg_taps *taps, struct feature_planes *p)
{
    size_t count = (size_t)size->width * size->height;
    struct hg_taps other = turned(taps);
    for (size_t i = 0; i < count; i++) {
        p->luma[i] = (o->color[0][i] + 16.0f) / 116.0f;
        p->dx[i] = p->dy[i] = 0;
    }
    hg_plane_filter_add(
        p->dx, p->luma, p->scratch, (const uint32_t[2]){size->width, size->height}, taps, 1);
    hg_plane_filter_add(
        p->dy, p->luma, p->scratch, (const uint32_t[2]){size->width, size->height}, &other, 1);
    for (size_t i = 0; i < count; i++)
        p->magnitude[i] = sqrtf(p->dx[i] * p->dx[i] + p->dy[i] * p->dy[i]);
}

// Raises `largest` to the difference of one kind of feature.
static void feature_errors(const struct opponent o[2], const struct hg_image *size,
    const struct hg_taps *taps, struct feature_planes *p, float *largest)
{
    float *first = p->magnitude;
    feature_magnitude(&o[0], size, taps, p);
    p->magnitude = o[0].seen[0]; // free by now
    feature_magnitude(&o[1], size, taps, p);
    for (size_t i = 0; i < (size_t)size->width * size->height; i++)
        largest[i] = fmaxf(largest[i], fabsf(first[i] - p->magnitude[i]));
    p->magnitude = first;
}

enum { plane_count = 18 };

enum hg_status hg_flip_map(const struct hg_image *reference, const struct hg_image *test,
    float pixels_per_degree, float *error)
{
    size_t count = (size_t)reference->width * reference->height, next = 0;
    float *block = hg_planes_create(reference->width, reference->height, plane_count);
    if (!block)
        return HG_E_NOMEM;
    struct opponent o[2];
    for (int k = 0; k < 2; k++)
        for (int c = 0; c < 3; c++) {
            o[k].color[c] = block + count * next++;
            o[k].seen[c] = block + count * next++;
        }
    struct feature_planes p = {.luma = block + count * next};
    p.scratch = p.luma + count;
    p.dx = p.scratch + count;
    p.dy = p.dx + count;
    p.magnitude = p.dy + count;
    float *feature = p.magnitude + count;

    to_opponent(reference, &o[0]);
    to_opponent(test, &o[1]);
    for (int k = 0; k < 2; k++)
        for (int c = 0; c < 3; c++)
            filter_sensitivity(
                o[k].seen[c], o[k].color[c], p.scratch, reference, c, pixels_per_degree);
    color_errors(&o[0], &o[1], count, error);
    for (int points = 0; points < 2; points++) {
        struct hg_taps taps;
        feature_taps(&taps, pixels_per_degree, points);
        feature_errors(o, reference, &taps, &p, feature);
    }
    for (size_t i = 0; i < count; i++) {
        float f = powf(feature[i] * 0.70710678f, feature_exponent);
        error[i] = powf(error[i], 1.0f - fminf(f, 1.0f)); // section 4.3
    }
    hg_free(block);
    return HG_OK;
}
