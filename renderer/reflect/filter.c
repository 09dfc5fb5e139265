// filter.c - see filter.h.
#include "renderer/reflect/filter.h"

#include "shaders/shared/gi.h"

#define NEAR_PX      10.0f // of roughness: how wide neighbours count fully,
#define FAR_PX       70.0f // and not at all
#define FAR_METRES   10.0f // of roughness: difference between the lengths of rays
#define CALM_FROM    0.2f  // roughness from which single bright rays are held back
#define CALM_REACH   2     // texels around that tell,
#define CALM_LEAST   3     // if there are so many rays among them,
#define CALM_MOST    2.0f  // how much brighter than their mean a ray may be
#define MOST_HISTORY 0.92f
#define SMOOTH       0.1f // roughness below which history counts less: there is little noise
#define CLIP         1.5f // standard deviations of neighbours that history may be off
#define MOST_BENT    4.0f // of a mirror image's size, near the pole of the lens

// --- neighbours ----------------------------------------------------------------------------------

struct spatial {
    const struct hg_reflect_image *image;
    const hg_reflect_sums *from;
    hg_reflect_sums *to;
    int step;
};

// wide: what distance on the screen leaves of it.
static float weight_of(
    const struct hg_reflect_texel *p, const struct hg_reflect_texel *q, float wide)
{
    const float same = q->mirrors ? hg_reflect_same(p, q->position, q->normal, q->roughness) : 0;
    if (same <= 0)
        return 0;
    const float far = FAR_METRES * p->roughness + 1e-3f, off = fabsf(p->length - q->length);
    return same * wide * (0.1f + 0.9f * hg_reflect_fall(0, far, off));
}

static void filter_texel(const struct spatial *s, int x, int y)
{
    static const float kernel[2] = {0.5f, 0.25f};
    const int columns = (int)s->image->columns, rows = (int)s->image->rows;
    const size_t i = (size_t)y * s->image->columns + (size_t)x;
    const struct hg_reflect_texel *p = &s->image->texels[i];
    s->to[i] = s->from[i];
    const float nearest_px = (float)(s->step * HG_PROBE_LIGHT_PX);
    if (!p->mirrors || nearest_px >= FAR_PX * p->roughness)
        return;
    const float near = NEAR_PX * p->roughness, far = FAR_PX * p->roughness;
    const float wide[3] = {1, kernel[0] * kernel[1] * hg_reflect_fall(near, far, nearest_px),
        kernel[1] * kernel[1] * hg_reflect_fall(near, far, 1.41421356f * nearest_px)};
    hg_reflect_sums sum = s->from[i] * (kernel[0] * kernel[0]);
    float total = kernel[0] * kernel[0];
    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            const int qx = x + dx * s->step, qy = y + dy * s->step;
            if ((dx == 0 && dy == 0) || qx < 0 || qy < 0 || qx >= columns || qy >= rows)
                continue;
            const size_t k = (size_t)qy * s->image->columns + (size_t)qx;
            const float w = weight_of(p, &s->image->texels[k], wide[(dx != 0) + (dy != 0)]);
            sum += s->from[k] * w;
            total += w;
        }
    s->to[i] = sum / total;
}

static bool is_empty(const struct hg_reflect_image *image, size_t y)
{
    return image->counts[y] == 0;
}

static void filter_row(void *user, size_t y)
{
    const struct spatial *s = user;
    if (is_empty(s->image, y))
        return;
    for (uint32_t x = 0; x < s->image->columns; x++)
        filter_texel(s, (int)x, (int)y);
}

static float light_of(const hg_reflect_sums *s)
{
    return 0.2126f * (*s)[HG_REFLECT_RED] + 0.7152f * (*s)[HG_REFLECT_GREEN] +
           0.0722f * (*s)[HG_REFLECT_BLUE];
}

// A ray of a rough lobe that met something far brighter than those of its neighbours would be a
// spot as wide as the filters, and another one in the next picture. So would one of few that sees
// the environment; as it sees all of it or nothing, its own belongs to the mean there.
static void calm_texel(const struct spatial *s, int x, int y)
{
    const int columns = (int)s->image->columns, rows = (int)s->image->rows;
    const size_t i = (size_t)y * s->image->columns + (size_t)x;
    const struct hg_reflect_texel *p = &s->image->texels[i];
    const float own = light_of(&s->from[i]), weight = s->from[i][HG_REFLECT_WEIGHT];
    hg_reflect_sums sum = {0};
    int count = 0;
    s->to[i] = s->from[i];
    if (!p->mirrors || !(weight > 0) || p->roughness < CALM_FROM)
        return;
    for (int qy = y - CALM_REACH; qy <= y + CALM_REACH; qy++)
        for (int qx = x - CALM_REACH; qx <= x + CALM_REACH; qx++) {
            if (qx < 0 || qy < 0 || qx >= columns || qy >= rows || (qx == x && qy == y))
                continue;
            const size_t k = (size_t)qy * s->image->columns + (size_t)qx;
            const struct hg_reflect_texel *q = &s->image->texels[k];
            if (!q->mirrors || q->roughness < CALM_FROM || !(s->from[k][HG_REFLECT_WEIGHT] > 0))
                continue;
            sum += s->from[k];
            count++;
        }
    if (count < CALM_LEAST)
        return;
    const float most = CALM_MOST * light_of(&sum) * weight / sum[HG_REFLECT_WEIGHT];
    for (int c = HG_REFLECT_RED; c <= HG_REFLECT_BLUE && own > most; c++)
        s->to[i][c] *= most / own;
    sum += s->from[i];
    const float most_open = CALM_MOST * sum[HG_REFLECT_OPEN] * weight / sum[HG_REFLECT_WEIGHT];
    s->to[i][HG_REFLECT_OPEN] = fminf(s->to[i][HG_REFLECT_OPEN], most_open);
}

static void calm_row(void *user, size_t y)
{
    const struct spatial *s = user;
    if (is_empty(s->image, y))
        return;
    for (uint32_t x = 0; x < s->image->columns; x++)
        calm_texel(s, (int)x, (int)y);
}

static void swap(hg_reflect_sums **a, hg_reflect_sums **b)
{
    hg_reflect_sums *kept = *a;
    *a = *b;
    *b = kept;
}

void hg_reflect_filter_spatial(
    const struct hg_reflect_image *image, hg_reflect_sums **sums, hg_reflect_sums **spare)
{
    static const int steps[] = {1, 3};
    struct spatial calm = {image, *sums, *spare, 0};
    hg_jobs_for(image->jobs, image->rows, calm_row, &calm);
    swap(sums, spare);
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        struct spatial s = {image, *sums, *spare, steps[i]};
        hg_jobs_for(image->jobs, image->rows, filter_row, &s);
        swap(sums, spare);
    }
}

// --- pictures before -----------------------------------------------------------------------------

// Source: Hirvonen et al. 2019, section 4.3: 1 / z_o + 1 / z_i = 2 / R, with the frame of the
// surface; m is how large the image is.
void hg_reflect_image_position(const struct hg_reflect_texel *t, float curvature, float out[3])
{
    float r[3], flat[3];
    const float cosine = hg_dot3(t->view, t->normal);
    for (int a = 0; a < 3; a++)
        r[a] = t->length * (2 * cosine * t->normal[a] - t->view[a]);
    const float z = hg_dot3(r, t->normal), bend = 1 + 2 * z * curvature;
    const float m = bend > 1 / MOST_BENT ? 1 / bend : MOST_BENT;
    hg_mad3(r, t->normal, -z, flat);
    for (int a = 0; a < 3; a++)
        out[a] = t->position[a] + m * flat[a] - m * z * t->normal[a];
}

struct temporal {
    const struct hg_reflect_image *image;
    const struct hg_reflect_history *before;
    const hg_reflect_sums *from;
    hg_reflect_sums *to;
};

// Of the directions to the neighbours the one in which the surface is most convex, whose image is
// nearest to the eye.
static float curvature_at(const struct hg_reflect_image *image, uint32_t x, uint32_t y)
{
    const size_t i = (size_t)y * image->columns + x;
    const struct hg_reflect_texel *p = &image->texels[i];
    float most = 0;
    bool known = false;
    for (int k = 0; k < 2; k++) {
        const bool there = k == 0 ? x + 1 < image->columns : y + 1 < image->rows;
        const struct hg_reflect_texel *q = &image->texels[i + (k == 0 ? 1 : image->columns)];
        float d[3], n[3];
        if (!there || !q->mirrors || hg_dot3(p->normal, q->normal) < 0.9f)
            continue;
        hg_sub3(q->position, p->position, d);
        hg_sub3(q->normal, p->normal, n);
        if (fabsf(hg_dot3(d, p->normal)) > 0.5f * hg_length3(d))
            continue;
        const float c = hg_dot3(n, d) / fmaxf(hg_dot3(d, d), 1e-12f);
        most = known ? fmaxf(most, c) : c;
        known = true;
    }
    return most;
}

// Texel of the picture before where a point was; false: it was not in it.
static bool find_before(const struct hg_reflect_history *h, const float p[3], float out[2])
{
    const struct hg_gpu_camera *c = &h->camera;
    const float *m = c->view_proj.m, *last = c->proj.m + 12;
    const float d[3] = {p[0] - c->eye_ws.x, p[1] - c->eye_ws.y, p[2] - c->eye_ws.z};
    float clip[4];
    for (int r = 0; r < 4; r++)
        clip[r] = m[r] * d[0] + m[4 + r] * d[1] + m[8 + r] * d[2] + last[r];
    if (!(clip[3] > 1e-6f))
        return false;
    const float size[2] = {(float)h->width, (float)h->height};
    for (int a = 0; a < 2; a++) {
        const float px = (clip[a] / clip[3] * 0.5f + 0.5f) * size[a];
        out[a] = (px - 0.5f) * (1.0f / HG_PROBE_LIGHT_PX) -
                 0.5f; // a texel is of the pixel in its middle
    }
    return out[0] > -1 && out[1] > -1 && out[0] < (float)h->columns && out[1] < (float)h->rows;
}

static float read_before(const struct hg_reflect_history *h, const struct hg_reflect_texel *p,
    const float at[2], hg_reflect_sums *out)
{
    const int x = (int)floorf(at[0]), y = (int)floorf(at[1]);
    const float f[2] = {at[0] - (float)x, at[1] - (float)y};
    float total = 0;
    *out = (hg_reflect_sums){0};
    for (int i = 0; i < 4; i++) {
        const int qx = x + (i & 1), qy = y + (i >> 1);
        if (qx < 0 || qy < 0 || qx >= (int)h->columns || qy >= (int)h->rows)
            continue;
        const size_t k = (size_t)qy * h->columns + (size_t)qx;
        const struct hg_reflect_texel *q = &h->texels[k];
        if (!q->mirrors || h->sums[k][HG_REFLECT_WEIGHT] <= 0)
            continue;
        const float w = ((i & 1) != 0 ? f[0] : 1 - f[0]) * (i >> 1 != 0 ? f[1] : 1 - f[1]) *
                        hg_reflect_same(p, q->position, q->normal, q->roughness);
        *out += h->sums[k] * w;
        total += w;
    }
    if (total > 0)
        *out /= total;
    return fminf(total, 1);
}

// History within what the neighbours of now allow (Salvi 2016, "An Excursion in Temporal
// Supersampling": variance clipping), by the ratios, weighted as sums are.
static void clip_to_neighbours(
    const struct temporal *t, uint32_t x, uint32_t y, hg_reflect_sums *history)
{
    hg_reflect_sums sum = {0}, square = {0};
    const struct hg_reflect_texel *p = &t->image->texels[(size_t)y * t->image->columns + x];
    int count = 0;
    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            const int qx = (int)x + dx, qy = (int)y + dy;
            if (qx < 0 || qy < 0 || qx >= (int)t->image->columns || qy >= (int)t->image->rows)
                continue;
            const size_t k = (size_t)qy * t->image->columns + (size_t)qx;
            const struct hg_reflect_texel *q = &t->image->texels[k];
            if (!q->mirrors || t->from[k][HG_REFLECT_WEIGHT] <= 0 ||
                hg_dot3(p->normal, q->normal) < 0.8f)
                continue;
            sum += t->from[k];
            square += t->from[k] * t->from[k] / t->from[k][HG_REFLECT_WEIGHT];
            count++;
        }
    if (count < 2)
        return;
    const float weight = (*history)[HG_REFLECT_WEIGHT];
    square /= sum[HG_REFLECT_WEIGHT];
    sum /= sum[HG_REFLECT_WEIGHT];
    for (int c = 0; c < HG_REFLECT_WEIGHT; c++) {
        const float deviation = sqrtf(fmaxf(square[c] - sum[c] * sum[c], 0));
        const float room = CLIP * deviation + 0.05f * fabsf(sum[c]);
        (*history)[c] = weight * hg_clampf((*history)[c] / weight, sum[c] - room, sum[c] + room);
    }
}

static void blend_texel(const struct temporal *t, uint32_t x, uint32_t y)
{
    const size_t i = (size_t)y * t->image->columns + x;
    const struct hg_reflect_texel *p = &t->image->texels[i];
    float at[2], image[3];
    hg_reflect_sums history;
    t->to[i] = t->from[i];
    if (!p->mirrors)
        return;
    hg_reflect_image_position(p, curvature_at(t->image, x, y), image);
    if (!find_before(t->before, image, at))
        return;
    float share = read_before(t->before, p, at, &history);
    if (!(share > 0))
        return;
    if (t->from[i][HG_REFLECT_WEIGHT] <= 0) { // nothing came in time
        t->to[i] = history;
        return;
    }
    clip_to_neighbours(t, x, y, &history);
    share *= MOST_HISTORY * (1 - hg_reflect_fall(0, SMOOTH, p->roughness));
    t->to[i] = t->from[i] + history * share; // rays of all pictures count alike at first
}

static void blend_row(void *user, size_t y)
{
    const struct temporal *t = user;
    if (is_empty(t->image, y))
        return;
    for (uint32_t x = 0; x < t->image->columns; x++)
        blend_texel(t, x, (uint32_t)y);
}

void hg_reflect_filter_temporal(const struct hg_reflect_image *image,
    const struct hg_reflect_history *before, hg_reflect_sums **sums, hg_reflect_sums **spare)
{
    struct temporal t = {image, before, *sums, *spare};
    if (before->texels == NULL)
        return;
    hg_jobs_for(image->jobs, image->rows, blend_row, &t);
    swap(sums, spare);
}
