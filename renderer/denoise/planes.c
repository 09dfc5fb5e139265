// planes.c - converts film channels to the planes of the filter.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/denoise/internal.h"

#define SEEN_REACH 3u // px: where to look for what is seen in a surface

enum {
    FACE = 13, // planes of hg_dn_face
    SINGLE = 10,
    PLANES = SINGLE + HG_DN_LOBES * FACE + HG_DN_KINDS * (1 + 2 * 4),
};

// --- memory --------------------------------------------------------------------------------------

static void place(struct hg_dn_planes *p, float **at, float **plane)
{
    *plane = *at;
    *at += p->count;
}

static void place_light(struct hg_dn_planes *p, float **at, struct hg_dn_light *light)
{
    for (int c = 0; c < 3; c++)
        place(p, at, &light->rgb[c]);
    place(p, at, &light->luma);
}

static void place_face(struct hg_dn_planes *p, float **at, struct hg_dn_face *face)
{
    float **all[FACE] = {&face->normal[0], &face->normal[1], &face->normal[2], &face->normal_var,
        &face->disparity, &face->disparity_dx, &face->disparity_dy, &face->disparity_var,
        &face->albedo[0], &face->albedo[1], &face->albedo[2], &face->tone, &face->tone_var};
    for (size_t i = 0; i < FACE; i++)
        place(p, at, all[i]);
}

static void place_all(struct hg_dn_planes *p, float *at)
{
    float **single[SINGLE] = {&p->seen, &p->share, &p->roughness, &p->scratch[0], &p->scratch[1],
        &p->scratch[2], &p->highlight[0], &p->highlight[1], &p->highlight[2], &p->highlight_var};
    for (size_t i = 0; i < SINGLE; i++)
        place(p, &at, single[i]);
    for (int i = 0; i < HG_DN_LOBES; i++)
        place_face(p, &at, &p->face[i]);
    for (int k = 0; k < HG_DN_KINDS; k++) {
        place(p, &at, &p->variance[k]);
        for (int j = 0; j < 2; j++)
            place_light(p, &at, &p->light[k][j]);
    }
}

// --- one row -------------------------------------------------------------------------------------

struct work {
    struct hg_dn_planes *p;
    const struct hg_denoise_input *input;
};

// Samples of the first half among the first n.
static uint32_t first_half(uint32_t n)
{
    const uint32_t rest = n > 8 ? (n - 8) % 8 : 0;
    return n <= 8 ? (n + 1) / 2 : 4 + (n - 8) / 8 * 4 + (rest < 4 ? rest : 4);
}

// Means of all channels of a pixel: of all samples, and of both halves.
struct pixel {
    float whole[HG_PATH_GUIDE_CHANNELS], half[2][HG_PATH_GUIDE_CHANNELS];
};

static void load(const struct hg_denoise_input *in, size_t at, uint32_t n, struct pixel *out)
{
    const size_t pixels = (size_t)in->width * in->height;
    const uint32_t n0 = first_half(n), n1 = n - n0;
    for (size_t c = 0; c < HG_PATH_GUIDE_CHANNELS; c++) {
        const float all = in->sums[c * pixels + at], first = in->halves[c * pixels + at];
        out->whole[c] = n > 0 ? all / (float)n : 0.0f;
        out->half[0][c] = n0 > 0 ? first / (float)n0 : 0.0f;
        out->half[1][c] = n1 > 0 ? (all - first) / (float)n1 : out->half[0][c];
    }
}

// Of samples that came to a smooth surface by a lobe that is not, none may know what is seen in it:
// then those around tell, as far as they hit something.
static void look_around(
    const struct hg_denoise_input *in, uint32_t x, uint32_t y, struct pixel *out)
{
    const size_t pixels = (size_t)in->width * in->height;
    for (uint32_t reach = 1; reach <= SEEN_REACH && !(out->whole[HG_PATH_GUIDE_SEEN] > 0.0f);
         reach++) {
        for (uint32_t j = y > reach ? y - reach : 0; j <= y + reach && j < in->height; j++) {
            for (uint32_t i = x > reach ? x - reach : 0; i <= x + reach && i < in->width; i++) {
                for (size_t c = HG_PATH_GUIDE_SEEN_ALBEDO; c <= HG_PATH_GUIDE_SEEN; c++) {
                    const size_t at = c * pixels + (size_t)j * in->width + i;
                    out->whole[c] += in->sums[at];
                    out->half[0][c] += in->halves[at];
                    out->half[1][c] += in->sums[at] - in->halves[at];
                }
            }
        }
    }
}

// Nothing around either: the surface itself.
static void take_surface(float *mean)
{
    const float hits = mean[HG_PATH_GUIDE_HITS];
    for (int c = 0; c < 3; c++)
        mean[HG_PATH_GUIDE_SEEN_ALBEDO + c] = hits;
    mean[HG_PATH_GUIDE_SEEN_OWN] = hits;
    mean[HG_PATH_GUIDE_SEEN_DEPTH] = mean[HG_PATH_GUIDE_DEPTH];
    mean[HG_PATH_GUIDE_SEEN] = hits;
}

// Channels of what a lobe shows: samples that it is known of, and a sum over them.
static const struct channels {
    int known, depth;
} channels[HG_DN_LOBES] = {
    {HG_PATH_GUIDE_HITS, HG_PATH_GUIDE_DEPTH}, {HG_PATH_GUIDE_SEEN, HG_PATH_GUIDE_SEEN_DEPTH}};

// Those of a half, or of all where the half has none.
static const float *known(const struct pixel *pixel, int half, int lobe)
{
    const float *from = pixel->half[half];
    return from[channels[lobe].known] > 0.0f ? from : pixel->whole;
}

static bool halves_know(const struct pixel *pixel)
{
    return known(pixel, 0, HG_DN_MIRRORS) != pixel->whole &&
           known(pixel, 1, HG_DN_MIRRORS) != pixel->whole;
}

static float of_known(const float *from, int lobe, int channel)
{
    return from[channel] / from[channels[lobe].known];
}

// What light of a lobe was multiplied by, mean over all samples. seen: where what is seen is known.
static float albedo_of(const float *from, const float *seen, int lobe, int c)
{
    if (lobe == HG_DN_SCATTERS)
        return from[HG_PATH_GUIDE_ALBEDO + c];
    return from[HG_PATH_GUIDE_REFLECTION + c] * of_known(seen, lobe, HG_PATH_GUIDE_SEEN_ALBEDO + c);
}

// The normal of what is seen in a surface says little of its light; it would have to be mirrored to
// be like those around, and is noisy behind glass. Smooth lobes have none.
static float normal_of(const float *from, const float *seen, int lobe, int c)
{
    const float own = lobe == HG_DN_SCATTERS ? 1.0f : of_known(seen, lobe, HG_PATH_GUIDE_SEEN_OWN);
    return own * from[HG_PATH_GUIDE_NORMAL + c] / from[HG_PATH_GUIDE_HITS];
}

static void load_light(
    struct hg_dn_planes *p, size_t at, int kind, int half, const struct pixel *pixel)
{
    const int light = HG_PATH_GUIDE_DIRECT + 3 * kind, lobe = hg_dn_lobe(kind);
    const float *from = known(pixel, half, HG_DN_SCATTERS), *seen = known(pixel, half, lobe);
    const float least = HG_DN_LEAST_ALBEDO * from[HG_PATH_GUIDE_HITS];
    struct hg_dn_light *to = &p->light[kind][half];
    for (int c = 0; c < 3; c++) {
        const float divisor = albedo_of(from, seen, lobe, c) + least;
        to->rgb[c][at] = divisor > 0.0f ? from[light + c] / divisor : 0.0f;
    }
    to->luma[at] = hg_dn_luma(to->rgb[0][at], to->rgb[1][at], to->rgb[2][at]);
}

// Of what is hit.
static float tone_of(const float *from, const float *seen, int lobe)
{
    return hg_dn_luma(albedo_of(from, seen, lobe, 0), albedo_of(from, seen, lobe, 1),
               albedo_of(from, seen, lobe, 2)) /
           from[HG_PATH_GUIDE_HITS];
}

static float square(float x)
{
    return x * x;
}

static void load_face(struct hg_dn_planes *p, size_t at, int lobe, const struct pixel *pixel)
{
    struct hg_dn_face *face = &p->face[lobe];
    const int depth = channels[lobe].depth;
    const float *w = pixel->whole;
    const float *a = known(pixel, 0, HG_DN_SCATTERS), *b = known(pixel, 1, HG_DN_SCATTERS);
    const float *seen_a = known(pixel, 0, lobe), *seen_b = known(pixel, 1, lobe);
    float var = 0.0f;
    for (int c = 0; c < 3; c++) {
        face->normal[c][at] = normal_of(w, w, lobe, c);
        var += square(normal_of(a, seen_a, lobe, c) - normal_of(b, seen_b, lobe, c));
        face->albedo[c][at] = albedo_of(w, w, lobe, c) + HG_DN_LEAST_ALBEDO * w[HG_PATH_GUIDE_HITS];
    }
    face->normal_var[at] = 0.25f * var;
    face->disparity[at] = expf(-of_known(w, lobe, depth));
    face->disparity_var[at] =
        0.25f * square(expf(-of_known(seen_a, lobe, depth)) - expf(-of_known(seen_b, lobe, depth)));
    face->tone[at] = tone_of(w, w, lobe);
    face->tone_var[at] = 0.25f * square(tone_of(a, seen_a, lobe) - tone_of(b, seen_b, lobe));
}

static void load_row(void *user, size_t y)
{
    const struct work *work = user;
    struct hg_dn_planes *p = work->p;
    const struct hg_denoise_input *in = work->input;
    const uint32_t from = p->y + (uint32_t)y;
    struct pixel pixel;
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        const uint32_t n = hg_dn_samples(in, p->x + x, from);
        load(in, (size_t)from * in->width + p->x + x, n, &pixel);
        const float hits = pixel.whole[HG_PATH_GUIDE_HITS];
        p->seen[at] = hits;
        p->share[at] = n > 0 ? (float)first_half(n) / (float)n : 0.5f;
        if (!(hits > 0.0f))
            continue;
        if (!(pixel.whole[HG_PATH_GUIDE_SEEN] > 0.0f))
            look_around(in, p->x + x, from, &pixel);
        if (!(pixel.whole[HG_PATH_GUIDE_SEEN] > 0.0f))
            take_surface(pixel.whole);
        p->roughness[at] = pixel.whole[HG_PATH_GUIDE_ROUGHNESS] / hits;
        for (int i = 0; i < HG_DN_LOBES; i++)
            load_face(p, at, i, &pixel);
        p->scratch[0][at] = n > 1 && halves_know(&pixel) ? 0.0f : 1.0f;
        for (int i = 0; i < HG_DN_KINDS * 2; i++)
            load_light(p, at, i / 2, i % 2, &pixel);
    }
}

// --- gradients -----------------------------------------------------------------------------------

// The smaller of the one-sided slopes: the one that crosses no edge.
static float slope(const float *f, const float *seen, size_t at, size_t step)
{
    const bool left = seen[at - step] > 0.0f, right = seen[at + step] > 0.0f;
    const float l = f[at] - f[at - step], r = f[at + step] - f[at];
    if (left && right)
        return fabsf(l) < fabsf(r) ? l : r;
    return left ? l : right ? r : 0.0f;
}

static void slope_row(void *user, size_t y)
{
    struct hg_dn_planes *p = ((const struct work *)user)->p;
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        for (int i = 0; i < HG_DN_LOBES; i++) {
            struct hg_dn_face *face = &p->face[i];
            face->disparity_dx[at] = slope(face->disparity, p->seen, at, 1);
            face->disparity_dy[at] = slope(face->disparity, p->seen, at, p->stride);
        }
    }
}

// --- fireflies -----------------------------------------------------------------------------------

// Firefly clamp: a half of a pixel is limited relative to its surroundings, unless the other half
// agrees: a rare very bright sample would become a spot as wide as the filter. Frequent bright
// samples are signal and stay.
#define FIREFLY_REACH  8     // px
#define FIREFLY_SHARE  0.25f // of the sum around
#define FIREFLY_AGREES 4.0f  // times the other half

struct firefly {
    struct hg_dn_planes *p;
    struct hg_dn_light *light;
    const float *other; // luma, as it was; NULL = there is none
    float *sums;        // of rows
    float *luma;        // out
};

static void sum_row(void *user, size_t y)
{
    const struct firefly *f = user;
    const struct hg_dn_planes *p = f->p;
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        float sum = 0.0f;
        for (int dx = -FIREFLY_REACH; dx <= FIREFLY_REACH; dx++)
            sum += f->light->luma[at + (size_t)dx];
        f->sums[at] = sum;
    }
}

static void firefly_row(void *user, size_t y)
{
    const struct firefly *f = user;
    const struct hg_dn_planes *p = f->p;
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        const float own = f->light->luma[at];
        float sum = -own;
        for (int dy = -FIREFLY_REACH; dy <= FIREFLY_REACH; dy++)
            sum += f->sums[at + (size_t)(dy * (ptrdiff_t)p->stride)];
        float limit = FIREFLY_SHARE * (sum > 0.0f ? sum : 0.0f);
        if (f->other != NULL && FIREFLY_AGREES * f->other[at] > limit)
            limit = FIREFLY_AGREES * f->other[at];
        const float scale = own > limit ? limit / own : 1.0f;
        f->luma[at] = own * scale;
        for (int c = 0; c < 3; c++)
            f->light->rgb[c][at] *= scale;
    }
}

static void limit_fireflies(struct hg_dn_planes *p, struct hg_jobs *jobs)
{
    for (int k = 0; k < HG_DN_KINDS; k++) {
        struct hg_dn_light *light = p->light[k];
        for (int j = 0; j < (p->halves ? 2 : 1); j++) {
            struct firefly f = {.p = p,
                .light = &light[j],
                .other = p->halves ? light[1 - j].luma : NULL,
                .sums = p->scratch[0],
                .luma = p->scratch[1 + j]};
            hg_jobs_for(jobs, p->height, sum_row, &f);
            hg_jobs_for(jobs, p->height, firefly_row, &f);
        }
        for (int j = 0; j < (p->halves ? 2 : 1); j++) {
            float *luma = p->scratch[1 + j];
            p->scratch[1 + j] = light[j].luma;
            light[j].luma = luma;
        }
    }
}

// --- variance ------------------------------------------------------------------------------------

static const float binomial[5] = {1.0f, 4.0f, 6.0f, 4.0f, 1.0f};

struct smooth {
    const struct hg_dn_planes *p;
    float *plane, *to;
    bool spatial; // of what is in the plane: its variance over space
};

// Mean of 5x5 px, or variance.
static void smooth_row(void *user, size_t y)
{
    const struct smooth *s = user;
    const struct hg_dn_planes *p = s->p;
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        float sum = 0.0f, squares = 0.0f, weights = 0.0f;
        for (int dy = -2; dy <= 2; dy++) {
            for (int dx = -2; dx <= 2; dx++) {
                const size_t q = at + (size_t)(dy * (ptrdiff_t)p->stride + dx);
                const float w = binomial[dy + 2] * binomial[dx + 2] * p->seen[q];
                sum += w * s->plane[q];
                squares += w * s->plane[q] * s->plane[q];
                weights += w;
            }
        }
        const float mean = weights > 0.0f ? sum / weights : 0.0f;
        const float spread = weights > 0.0f ? squares / weights - mean * mean : 0.0f;
        s->to[at] = !s->spatial ? mean : spread > 0.0f ? spread : 0.0f;
    }
}

void hg_dn_smooth(struct hg_dn_planes *p, struct hg_jobs *jobs, float **plane)
{
    struct smooth s = {.p = p, .plane = *plane, .to = p->scratch[0]};
    hg_jobs_for(jobs, p->height, smooth_row, &s);
    p->scratch[0] = *plane;
    *plane = s.to;
}

static void difference_row(void *user, size_t y)
{
    struct hg_dn_planes *p = ((const struct work *)user)->p;
    for (int k = 0; k < HG_DN_KINDS; k++) {
        for (uint32_t x = 0; x < p->width; x++) {
            const size_t at = hg_dn_at(p, x, (uint32_t)y);
            p->variance[k][at] = 0.5f * square(p->light[k][0].luma[at] - p->light[k][1].luma[at]);
        }
    }
}

static void find_variance(struct hg_dn_planes *p, struct hg_jobs *jobs, struct work *work)
{
    if (p->halves)
        hg_jobs_for(jobs, p->height, difference_row, work);
    for (int k = 0; k < HG_DN_KINDS; k++) {
        struct smooth s = {
            .p = p, .plane = p->light[k][0].luma, .to = p->variance[k], .spatial = true};
        if (!p->halves)
            hg_jobs_for(jobs, p->height, smooth_row, &s);
        hg_dn_smooth(p, jobs, &p->variance[k]);
    }
    for (int i = 0; i < HG_DN_LOBES; i++) {
        hg_dn_smooth(p, jobs, &p->face[i].tone_var);
        hg_dn_smooth(p, jobs, &p->face[i].normal_var);
        hg_dn_smooth(p, jobs, &p->face[i].disparity_var);
    }
}

// --- all -----------------------------------------------------------------------------------------

static bool has_halves(const struct hg_denoise_input *in)
{
    const uint32_t side = HG_PATH_TILE_SIDE;
    const size_t tiles = (size_t)((in->width + side - 1) / side) * ((in->height + side - 1) / side);
    for (size_t i = 0; i < tiles; i++) {
        if (in->samples[i] >= 2)
            return true;
    }
    return false;
}

enum hg_status hg_dn_planes_init(struct hg_dn_planes *p, struct hg_jobs *jobs,
    const struct hg_denoise_input *input, const struct hg_dn_rect *part)
{
    const size_t border = 2 * HG_DN_BORDER;
    *p = (struct hg_dn_planes){.x = part->x,
        .y = part->y,
        .width = part->width,
        .height = part->height,
        .stride = (part->width + border + 7) & ~(size_t)7,
        .halves = has_halves(input)};
    p->count = p->stride * (part->height + border);
    p->memory = hg_calloc(PLANES * p->count, sizeof *p->memory);
    if (p->memory == NULL)
        return HG_E_NOMEM;
    place_all(p, p->memory);
    struct work work = {p, input};
    hg_jobs_for(jobs, p->height, load_row, &work);
    hg_jobs_for(jobs, p->height, slope_row, &work);
    hg_dn_seen_guess(p, jobs);
    hg_dn_split_highlights(p, jobs);
    limit_fireflies(p, jobs);
    find_variance(p, jobs, &work);
    hg_dn_seen_calm(p, jobs);
    return HG_OK;
}

void hg_dn_planes_finish(struct hg_dn_planes *p)
{
    hg_free(p->memory);
    *p = (struct hg_dn_planes){0};
}
