#include "renderer/denoise/history.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"

#define NORMAL_LEAST 0.9f  // cosine between normals of the same surface
#define DEPTH_REACH  0.02f // difference of depths of the same place, relative
#define CHANGE_REACH 2.0f  // standard deviations of a patch that are no change
#define STILL_PX     0.02  // px that count as none
#define MOVED_PX     0.25  // px
#define ALBEDO_REACH 4.0f  // standard deviations of an albedo that are no change
#define PATCH        3     // px: radius of what is compared

enum { KEPT = HG_DN_KINDS * 5 + HG_DN_LOBES * 3 + 5 }; // planes of a picture

// A picture that was made: [height][width] of each plane.
struct past {
    uint32_t width, height; // 0 = none
    struct hg_denoise_camera camera;
    float *rgb[HG_DN_KINDS][3], *variance[HG_DN_KINDS], *length[HG_DN_KINDS];
    float *albedo[HG_DN_LOBES][3], *normal[3], *disparity, *seen;
    float *memory;
};

struct hg_denoise {
    struct past before, now; // now: the newest, of the picture that is being made
};

// --- life ----------------------------------------------------------------------------------------

struct hg_denoise *hg_denoise_create(void)
{
    return hg_calloc(1, sizeof(struct hg_denoise));
}

static void past_finish(struct past *past)
{
    hg_free(past->memory);
    *past = (struct past){0};
}

void hg_denoise_destroy(struct hg_denoise *d)
{
    if (d == NULL)
        return;
    past_finish(&d->before);
    past_finish(&d->now);
    hg_free(d);
}

void hg_denoise_next(struct hg_denoise *d)
{
    if (d->now.width == 0)
        return;
    past_finish(&d->before);
    d->before = d->now;
    d->now = (struct past){0};
}

static enum hg_status past_init(struct past *past, uint32_t width, uint32_t height)
{
    const size_t pixels = (size_t)width * height;
    past_finish(past);
    past->memory = hg_calloc(KEPT * pixels, sizeof(float));
    if (past->memory == NULL)
        return HG_E_NOMEM;
    float *at = past->memory;
    float **single[] = {
        &past->normal[0], &past->normal[1], &past->normal[2], &past->disparity, &past->seen};
    for (size_t i = 0; i < sizeof single / sizeof *single; i++, at += pixels)
        *single[i] = at;
    for (int i = 0; i < HG_DN_LOBES * 3; i++, at += pixels)
        past->albedo[i / 3][i % 3] = at;
    for (int k = 0; k < HG_DN_KINDS; k++) {
        float **each[] = {&past->variance[k], &past->length[k], &past->rgb[k][0], &past->rgb[k][1],
            &past->rgb[k][2]};
        for (size_t i = 0; i < sizeof each / sizeof *each; i++, at += pixels)
            *each[i] = at;
    }
    past->width = width;
    past->height = height;
    return HG_OK;
}

// --- where it was --------------------------------------------------------------------------------

struct work {
    struct hg_dn_planes *p;
    const struct hg_denoise_camera *camera;
    const struct hg_denoise_input *input;
    struct hg_dn_clean *clean;
    const struct past *before;
    struct past *now;
    struct hg_dn_clean old; // of before, where the pixels of now were; its luma: trust
    float *length[HG_DN_KINDS];
    float *still; // 1 where a pixel showed the same then, to a part of a pixel
};

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void place_of(
    const struct hg_denoise_camera *c, double x, double y, double depth, double out[3])
{
    for (int i = 0; i < 3; i++) {
        const double across = c->across[i] + x * c->x[i] + y * c->y[i];
        out[i] = c->orthographic ? across + depth * c->forward[i] : c->eye[i] + depth * across;
    }
}

// Pixel coordinates and depth of a place; false: behind the camera.
static bool find(
    const struct hg_denoise_camera *c, const double place[3], double *x, double *y, double *depth)
{
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = place[i] - (c->orthographic ? c->across[i] : c->eye[i]);
    *depth = dot(d, c->forward);
    if (!c->orthographic) {
        if (!(*depth > 1e-9))
            return false;
        for (int i = 0; i < 3; i++)
            d[i] = d[i] / *depth - c->across[i];
    }
    *x = dot(d, c->x) / dot(c->x, c->x);
    *y = dot(d, c->y) / dot(c->y, c->y);
    return true;
}

static bool is_same(
    const struct hg_dn_planes *p, const struct past *past, size_t at, size_t old, double depth)
{
    const double there = (double)past->disparity[old] * depth; // 1: as deep as expected
    float cosine = 0.0f, length = 0.0f, length_old = 0.0f;
    for (int c = 0; c < 3; c++) {
        cosine += p->normal[c][at] * past->normal[c][old];
        length += p->normal[c][at] * p->normal[c][at];
        length_old += past->normal[c][old] * past->normal[c][old];
    }
    const float slope =
        (fabsf(p->disparity_dx[at]) + fabsf(p->disparity_dy[at])) / p->disparity[at];
    return past->seen[old] > 0.0f && cosine > NORMAL_LEAST * sqrtf(length * length_old) &&
           fabs(there - 1.0) < (double)(DEPTH_REACH + 2.0f * slope);
}

static void take(struct work *w, size_t at, size_t old, float weight)
{
    for (int k = 0; k < HG_DN_KINDS; k++) {
        for (int c = 0; c < 3; c++)
            w->old.rgb[k][c][at] += weight * w->before->rgb[k][c][old];
        w->old.variance[k][at] += weight * w->before->variance[k][old];
        w->length[k][at] += weight * w->before->length[k][old];
    }
}

static void scale(struct work *w, size_t at, float factor)
{
    for (int k = 0; k < HG_DN_KINDS; k++) {
        for (int c = 0; c < 3; c++)
            w->old.rgb[k][c][at] *= factor;
        w->old.variance[k][at] *= factor;
        w->length[k][at] *= factor;
    }
}

// The surface was not where the camera's move alone leads to: x, y.
static bool moves_itself(const struct work *w, uint32_t column, uint32_t row, double x, double y)
{
    const struct hg_denoise_input *in = w->input;
    const size_t pixel = (size_t)row * in->width + column, pixels = (size_t)in->width * in->height;
    const uint32_t columns = (in->width + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE;
    const uint32_t n = in->samples[row / HG_PATH_TILE_SIDE * columns + column / HG_PATH_TILE_SIDE];
    if (in->motion == NULL || n == 0)
        return false;
    const double mx = (double)in->motion[pixel] / n, my = (double)in->motion[pixels + pixel] / n;
    return (mx != 0.0 || my != 0.0) &&
           !(fabs(column + mx - x) < MOVED_PX && fabs(row + my - y) < MOVED_PX);
}

// Nothing has moved: what edges of pixels show is noisy and may be averaged, albedo and all.
static bool take_still(struct work *w, uint32_t column, uint32_t row, double x, double y)
{
    const size_t pixel = (size_t)row * w->p->width + column;
    const size_t pixels = (size_t)w->p->width * w->p->height;
    const float *motion = w->input->motion;
    if (motion == NULL || motion[pixel] != 0.0f || motion[pixels + pixel] != 0.0f)
        return false;
    const struct past *past = w->before;
    const size_t at = hg_dn_at(w->p, column, row), old = (size_t)row * past->width + column;
    if (!(fabs(x - column) < STILL_PX && fabs(y - row) < STILL_PX) || column >= past->width ||
        row >= past->height)
        return false;
    if (!(past->seen[old] > 0.0f))
        return false;
    take(w, at, old, 1.0f);
    w->still[at] = 1.0f;
    return true;
}

// What the four pixels around the place showed then, of those that showed the same surface.
static void find_row(void *user, size_t row)
{
    struct work *w = user;
    const struct hg_dn_planes *p = w->p;
    const struct past *past = w->before;
    double place[3], x, y, depth;
    for (uint32_t column = 0; column < p->width; column++) {
        const size_t at = hg_dn_at(p, column, (uint32_t)row);
        if (!(p->seen[at] > 0.0f) || !(p->disparity[at] > 0.0f))
            continue;
        place_of(w->camera, column + 0.5, (double)row + 0.5, 1.0 / (double)p->disparity[at], place);
        if (!find(&past->camera, place, &x, &y, &depth))
            continue;
        x -= 0.5;
        y -= 0.5;
        if (!(x > -1.0 && y > -1.0 && x < past->width && y < past->height))
            continue;
        if (moves_itself(w, column, (uint32_t)row, x, y) ||
            take_still(w, column, (uint32_t)row, x, y))
            continue;
        const int x0 = (int)floor(x), y0 = (int)floor(y);
        float sum = 0.0f;
        for (int i = 0; i < 4; i++) {
            const int px = x0 + i % 2, py = y0 + i / 2;
            const float weight = (float)((1.0 - fabs(x - px)) * (1.0 - fabs(y - py)));
            if (px < 0 || py < 0 || px >= (int)past->width || py >= (int)past->height)
                continue;
            const size_t old = (size_t)py * past->width + (size_t)px;
            if (!is_same(p, past, at, old, depth))
                continue;
            take(w, at, old, weight);
            sum += weight;
        }
        scale(w, at, sum > 0.1f ? 1.0f / sum : 0.0f);
    }
}

// --- how much it counts --------------------------------------------------------------------------

static float luma_at(float *const rgb[3], size_t at)
{
    return hg_dn_luma(rgb[0][at], rgb[1][at], rgb[2][at]);
}

// 1 where both agree, in the mean of a patch, within what noise explains; 0 where they do not.
static float trust(const struct work *w, int kind, size_t at)
{
    const struct hg_dn_planes *p = w->p;
    float difference = 0.0f, variance = 0.0f, brightness = 0.0f, count = 0.0f;
    for (int dy = -PATCH; dy <= PATCH; dy++) {
        for (int dx = -PATCH; dx <= PATCH; dx++) {
            const size_t q = at + (size_t)(dy * (ptrdiff_t)p->stride + dx);
            if (!(w->length[kind][q] > 0.0f))
                continue;
            const float now = w->clean->luma[kind][q], then = luma_at(w->old.rgb[kind], q);
            difference += now - then;
            variance += w->clean->variance[kind][q] + w->old.variance[kind][q];
            brightness += now + then;
            count += 1.0f;
        }
    }
    if (count == 0.0f)
        return 0.0f;
    // Noise that is left is alike over many pixels: the patch is not much better than one of them.
    const float off = difference * difference / (count * count);
    const float least = 1e-6f * brightness * brightness / (count * count) + 1e-20f;
    const float x = off / (CHANGE_REACH * CHANGE_REACH * variance / count + least) - 1.0f;
    return x <= 0.0f ? 1.0f : x >= 3.0f ? 0.0f : 1.0f - x / 3.0f;
}

static void trust_row(void *user, size_t y)
{
    struct work *w = user;
    for (uint32_t x = 0; x < w->p->width; x++) {
        const size_t at = hg_dn_at(w->p, x, (uint32_t)y);
        for (int k = 0; k < HG_DN_KINDS; k++)
            w->old.luma[k][at] = w->length[k][at] > 0.0f ? trust(w, k, at) : 0.0f;
    }
}

static void blend_row(void *user, size_t y)
{
    struct work *w = user;
    for (uint32_t x = 0; x < w->p->width; x++) {
        const size_t at = hg_dn_at(w->p, x, (uint32_t)y);
        for (int k = 0; k < HG_DN_KINDS; k++) {
            const float length = w->length[k][at] * w->old.luma[k][at];
            const float old = length / (length + 1.0f), own = 1.0f - old;
            for (int c = 0; c < 3; c++)
                w->clean->rgb[k][c][at] =
                    own * w->clean->rgb[k][c][at] + old * w->old.rgb[k][c][at];
            w->clean->variance[k][at] =
                own * own * w->clean->variance[k][at] + old * old * w->old.variance[k][at];
            w->length[k][at] = fminf(length + 1.0f, HG_DN_MOST_HISTORY);
        }
    }
}

// Albedos at the edges of what stands still, which are noisy as well: the old one of the same pixel
// counts where both agree.
static void blend_albedo(const struct work *w, size_t at, size_t pixel)
{
    const struct hg_dn_planes *p = w->p;
    for (int l = 0; l < HG_DN_LOBES; l++) {
        const int kind = l == HG_DN_SCATTERS ? HG_DN_INDIRECT : HG_DN_SPECULAR;
        const float off = luma_at(p->albedo[l], at) - luma_at(w->before->albedo[l], pixel);
        const float reach = ALBEDO_REACH * ALBEDO_REACH * p->tone_var[l][at];
        const float length = off * off < reach ? w->length[kind][at] - 1.0f : 0.0f;
        const float old = length / (length + 1.0f);
        for (int c = 0; c < 3; c++)
            p->albedo[l][c][at] =
                (1.0f - old) * p->albedo[l][c][at] + old * w->before->albedo[l][c][pixel];
    }
}

static void keep_row(void *user, size_t y)
{
    const struct work *w = user;
    const struct hg_dn_planes *p = w->p;
    struct past *now = w->now;
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y), to = y * p->width + x;
        for (int k = 0; k < HG_DN_KINDS; k++) {
            for (int c = 0; c < 3; c++)
                now->rgb[k][c][to] = w->clean->rgb[k][c][at];
            now->variance[k][to] = w->clean->variance[k][at];
            now->length[k][to] = w->length[k][at] > 0.0f ? w->length[k][at] : 1.0f;
        }
        if (w->still[at] > 0.0f)
            blend_albedo(w, at, to);
        for (int i = 0; i < HG_DN_LOBES * 3; i++)
            now->albedo[i / 3][i % 3][to] = p->albedo[i / 3][i % 3][at];
        for (int c = 0; c < 3; c++)
            now->normal[c][to] = p->normal[c][at];
        now->disparity[to] = p->disparity[at];
        now->seen[to] = p->seen[at];
    }
}

// --- all -----------------------------------------------------------------------------------------

static float *make_work(struct work *w, const struct hg_dn_planes *p)
{
    float *memory = hg_calloc((HG_DN_KINDS * 6 + 1) * p->count, sizeof(float));
    float *at = memory;
    w->still = at;
    at += memory != NULL ? p->count : 0;
    for (int k = 0; k < HG_DN_KINDS && memory != NULL; k++) {
        float **single[] = {&w->old.rgb[k][0], &w->old.rgb[k][1], &w->old.rgb[k][2],
            &w->old.luma[k], &w->old.variance[k], &w->length[k]};
        for (size_t i = 0; i < sizeof single / sizeof *single; i++, at += p->count)
            *single[i] = at;
    }
    return memory;
}

enum hg_status hg_dn_history_blend(struct hg_denoise *history, struct hg_dn_planes *p,
    const struct hg_denoise_input *input, struct hg_dn_clean *clean, struct hg_jobs *jobs)
{
    struct work w = {.p = p,
        .camera = &input->camera,
        .input = input,
        .clean = clean,
        .before = &history->before,
        .now = &history->now};
    float *memory = make_work(&w, p);
    enum hg_status status = memory != NULL ? HG_OK : HG_E_NOMEM;
    if (status == HG_OK)
        status = past_init(&history->now, p->width, p->height);
    if (status == HG_OK) {
        history->now.camera = input->camera;
        if (history->before.width > 0) {
            hg_jobs_for(jobs, p->height, find_row, &w);
            hg_jobs_for(jobs, p->height, trust_row, &w);
        }
        hg_jobs_for(jobs, p->height, blend_row, &w);
        hg_jobs_for(jobs, p->height, keep_row, &w);
    }
    hg_free(memory);
    return status;
}
