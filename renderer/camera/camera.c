#include "renderer/camera/camera.h"

#include <math.h>
#include <string.h>

#include "base/vec3d.h"

// right, up, forward: unit. Degenerate input falls back to looking along -z with +y up.
static void basis(const struct hg_camera_setup *s, double right[3], double up[3], double forward[3])
{
    for (int i = 0; i < 3; i++)
        forward[i] = s->target[i] - s->eye[i];
    if (!hg_normalize3d(forward))
        memcpy(forward, (double[3]){0, 0, -1}, 3 * sizeof(double));
    memcpy(up, s->up, 3 * sizeof(double));
    if (!hg_normalize3d(up))
        memcpy(up, (double[3]){0, 1, 0}, 3 * sizeof(double));
    hg_cross3d(forward, up, right);
    if (sqrt(hg_dot3d(right, right)) < 1e-6) { // looking along up
        const double other[3] = {
            0, fabs(forward[1]) > 0.9 ? 0 : 1, fabs(forward[1]) > 0.9 ? -1 : 0};
        hg_cross3d(forward, other, right);
    }
    if (!hg_normalize3d(right))
        memcpy(right, (double[3]){1, 0, 0}, 3 * sizeof(double));
    hg_cross3d(right, forward, up);
}

static void store(const double m[16], struct hg_mat4 *out)
{
    for (int i = 0; i < 16; i++)
        out->m[i] = (float)m[i];
}

static struct hg_vec3 vec3(const double v[3])
{
    return (struct hg_vec3){(float)v[0], (float)v[1], (float)v[2]};
}

static void multiply(const double a[16], const double b[16], double out[16])
{
    for (int c = 0; c < 4; c++) {
        for (int r = 0; r < 4; r++) {
            out[c * 4 + r] = 0;
            for (int k = 0; k < 4; k++)
                out[c * 4 + r] += a[k * 4 + r] * b[c * 4 + k];
        }
    }
}

static double aspect_of(const struct hg_camera_setup *s)
{
    return s->aspect > 0.0 ? s->aspect : (double)s->width / (double)s->height;
}

// Depth rows: reversed, 1 at near, 0 at far or infinity.
static void projection(const struct hg_camera_setup *s, double p[16])
{
    const double aspect = aspect_of(s);
    const double n = s->near, f = s->far;
    const double jx = 2.0 * s->jitter_px[0] / s->width, jy = 2.0 * s->jitter_px[1] / s->height;
    memset(p, 0, 16 * sizeof *p);
    if (s->orthographic) {
        p[0] = 1.0 / (s->half_height * aspect);
        p[5] = -1.0 / s->half_height;
        p[10] = 1.0 / (f - n); // depth = (far - distance) / (far - near), distance = -z
        p[12] = -jx;
        p[13] = -jy;
        p[14] = f / (f - n);
        p[15] = 1.0;
        return;
    }
    const double cot = 1.0 / tan(0.5 * s->vfov_rad);
    p[0] = cot / aspect;
    p[5] = -cot;
    p[8] = jx; // times -z / w = 1: shifts against the sample
    p[9] = jy;
    p[10] = f > 0 ? n / (f - n) : 0.0;
    p[11] = -1.0;
    p[14] = f > 0 ? n * f / (f - n) : n;
}

static void look(const double right[3], const double up[3], const double forward[3],
    const double eye[3], double view[16], double inverse[16])
{
    const double axes[3][3] = {{right[0], right[1], right[2]}, {up[0], up[1], up[2]},
        {-forward[0], -forward[1], -forward[2]}};
    memset(view, 0, 16 * sizeof *view);
    memset(inverse, 0, 16 * sizeof *inverse);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            view[c * 4 + r] = axes[r][c];
            inverse[r * 4 + c] = axes[r][c];
        }
        view[12 + r] = -hg_dot3d(axes[r], eye);
        inverse[12 + r] = eye[r];
    }
    view[15] = inverse[15] = 1.0;
}

// Inverse of the projection, written out: it has five non-zero kinds of entries.
static void inverse_projection(const double p[16], bool orthographic, double out[16])
{
    memset(out, 0, 16 * sizeof *out);
    out[0] = 1.0 / p[0];
    out[5] = 1.0 / p[5];
    if (orthographic) {
        out[10] = 1.0 / p[10];
        out[12] = -p[12] / p[0];
        out[13] = -p[13] / p[5];
        out[14] = -p[14] / p[10];
        out[15] = 1.0;
        return;
    }
    // x = (cx - p8 z) / p0 with z = -cw; z_view = -cw; w_view = (cz + p10 cw) / p14
    out[12] = p[8] / p[0];
    out[13] = p[9] / p[5];
    out[14] = -1.0;
    out[11] = 1.0 / p[14];
    out[15] = p[10] / p[14];
}

static void fill_rays(const struct hg_camera_setup *s, const double right[3], const double up[3],
    const double forward[3], struct hg_gpu_camera *out)
{
    const double half = s->orthographic ? s->half_height : tan(0.5 * s->vfov_rad);
    const double step = 2.0 * half / s->height; // per pixel
    const double across = s->aspect > 0.0 ? 2.0 * half * s->aspect / s->width : step;
    double origin[3], x[3], y[3];
    for (int i = 0; i < 3; i++) {
        x[i] = right[i] * across;
        y[i] = -up[i] * step;
        origin[i] = (s->orthographic ? s->eye[i] : forward[i]) +
                    x[i] * (s->jitter_px[0] - 0.5 * s->width) +
                    y[i] * (s->jitter_px[1] - 0.5 * s->height);
    }
    out->ray_origin_ws = vec3(origin);
    out->ray_x_ws = vec3(x);
    out->ray_y_ws = vec3(y);
    out->pixel_angle = s->orthographic ? 0.0f : (float)step;
    out->pixel_size = s->orthographic ? (float)step : 0.0f;
}

void hg_camera_fill(const struct hg_camera_setup *s, struct hg_gpu_camera *out)
{
    double right[3], up[3], forward[3];
    double view[16], inv_view[16], proj[16], inv_proj[16], product[16];
    memset(out, 0, sizeof *out);
    basis(s, right, up, forward);
    look(right, up, forward, s->eye, view, inv_view);
    projection(s, proj);
    inverse_projection(proj, s->orthographic, inv_proj);
    store(view, &out->view);
    store(inv_view, &out->inv_view);
    store(proj, &out->proj);
    multiply(proj, view, product);
    store(product, &out->view_proj);
    multiply(inv_view, inv_proj, product);
    store(product, &out->inv_view_proj);
    out->eye_ws = vec3(s->eye);
    out->forward_ws = vec3(forward);
    out->orthographic = s->orthographic;
    out->near = s->near;
    out->far = s->far;
    fill_rays(s, right, up, forward, out);
}

// Relative to the eye of `from`, so that what is near keeps its digits far from the origin.
void hg_camera_reproject(const struct hg_camera_setup *from, const struct hg_camera_setup *to,
    const double moved[16], double out[16])
{
    double right[3], up[3], forward[3], view[16], inverse[16], product[16];
    double between[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    const double here[3] = {0};
    double eye[3];
    basis(from, right, up, forward);
    look(right, up, forward, here, view, inverse);
    projection(from, view);
    inverse_projection(view, from->orthographic, product);
    multiply(inverse, product, out); // clip to place - eye of `from`
    if (moved != NULL) {
        memcpy(between, moved, sizeof between);
        for (int r = 0; r < 3; r++) { // moved(eye + d) - eye
            between[12 + r] -= from->eye[r];
            for (int c = 0; c < 3; c++)
                between[12 + r] += moved[c * 4 + r] * from->eye[c];
        }
    }
    multiply(between, out, product);
    for (int i = 0; i < 3; i++)
        eye[i] = to->eye[i] - from->eye[i];
    basis(to, right, up, forward);
    look(right, up, forward, eye, view, inverse);
    multiply(view, product, inverse);
    projection(to, view);
    multiply(view, inverse, out);
}

// Distances along forward of the nearest and the farthest corner of a box.
static void depth_range(const struct hg_camera_setup *s, const float min[3], const float max[3],
    double *nearest, double *farthest)
{
    double right[3], up[3], forward[3], centre = 0, reach = 0;
    basis(s, right, up, forward);
    for (int i = 0; i < 3; i++) {
        centre += forward[i] * (0.5 * ((double)min[i] + max[i]) - s->eye[i]);
        reach += fabs(forward[i]) * 0.5 * ((double)max[i] - min[i]);
    }
    *nearest = centre - reach;
    *farthest = centre + reach;
}

// Nothing that is nearer to an eye amid a scene is left out because of what lies far away, metres.
#define MOST_NEAR 0.01

void hg_camera_fit_depth(
    struct hg_camera_setup *s, bool has_bounds, const float min[3], const float max[3])
{
    double nearest = 0, farthest = 1, diagonal = 0;
    if (has_bounds) {
        depth_range(s, min, max, &nearest, &farthest);
        for (int i = 0; i < 3; i++)
            diagonal += ((double)max[i] - min[i]) * ((double)max[i] - min[i]);
        diagonal = sqrt(diagonal);
    }
    const double margin = 1e-3 * diagonal + 1e-4;
    if (s->orthographic) {
        // A given plane is kept; an absent one moves out of the way of the scene.
        const bool fit_near = s->near == 0;
        if (fit_near)
            s->near = (float)(nearest - margin);
        if (s->far == 0 || s->far <= s->near)
            s->far = (float)fmax(farthest + margin, s->near + margin);
        return;
    }
    if (s->near <= 0) {
        const double least = fmin(1e-4 * diagonal, MOST_NEAR) + 1e-6;
        s->near = (float)fmax(0.5 * nearest, least);
    }
    if (s->far != 0 && s->far <= s->near)
        s->far = 0;
}

// Share of the Blackman-Harris window of radius 1 left of x in -1..1 (closed form of its integral).
static double window_cdf(double x)
{
    const double a0 = 0.35875, a1 = 0.48829, a2 = 0.14128, a3 = 0.01168;
    const double area = 2.0 * a0;
    const double integral = a0 * (x + 1.0) + a1 * sin(M_PI * x) / M_PI +
                            a2 * sin(2.0 * M_PI * x) / (2.0 * M_PI) +
                            a3 * sin(3.0 * M_PI * x) / (3.0 * M_PI);
    return integral / area;
}

static double window_inverse(double u)
{
    double low = -1.0, high = 1.0;
    for (int i = 0; i < 40; i++) {
        const double middle = 0.5 * (low + high);
        if (window_cdf(middle) < u)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

// Samples come in mirrored pairs after the first: the mean offset is 0 after every odd count and
// close to it after even ones, so a picture of few samples is not shifted.
void hg_camera_jitter(uint32_t index, uint32_t seed, float out_px[2])
{
    const double g = 1.32471795724474602596; // plastic number
    const double step[2] = {1.0 / g, 1.0 / (g * g)};
    const uint32_t pair = index / 2 + index % 2;
    const double n = (double)pair + (pair > 0 ? (double)(seed % 65536u) * 97.0 : 0.0);
    const double side = index % 2 ? 1.5 : -1.5;
    for (int i = 0; i < 2; i++) {
        const double u = 0.5 + n * step[i];
        out_px[i] = pair == 0 ? 0.0f : (float)(side * window_inverse(u - floor(u)));
    }
}
