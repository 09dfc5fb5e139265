// reconstruct.c - applies the pixel filter to denoised light.
//
// The denoiser needs unsplatted samples, whose noise is independent between pixels; edges would
// then have only as many levels as there are samples per pixel. Coverage and albedo of surfaces are
// known without noise from camera rays, and are splatted (HG_PATH_SHOWN_*) as in undenoised
// pictures. Demodulated light is averaged over neighbouring pixels, weighted by albedo, and
// multiplied by the splatted albedo.
#include "renderer/denoise/internal.h"

struct work {
    struct hg_dn_planes *p;
    const struct hg_denoise_input *input;
    const struct hg_dn_rect *rect;
    const struct hg_dn_clean *clean;
    float *(*light)[3], *albedo[HG_DN_LOBES][3]; // out
};

// Sums over the pixels around, of one lobe and colour.
struct sum {
    float light[HG_DN_KINDS]; // times the albedo
    float albedo, reflected;  // reflected: without what is seen in a mirror
};

// What the first surface of a pixel does to a lobe's light, of all its samples.
static float reflected(const struct work *w, size_t at, uint32_t x, uint32_t y, int lobe, int c)
{
    const struct hg_denoise_input *in = w->input;
    const size_t pixels = (size_t)in->width * in->height, px = (size_t)y * in->width + x;
    if (lobe == HG_DN_SCATTERS)
        return w->p->face[lobe].albedo[c][at];
    const uint32_t n = hg_dn_samples(in, x, y);
    const float sum = in->sums[(size_t)(HG_PATH_GUIDE_REFLECTION + c) * pixels + px];
    return n > 0 ? sum / (float)n + HG_DN_LEAST_ALBEDO * w->p->seen[at] : 0.0f;
}

// The same as shown.
static float shown(const struct work *w, uint32_t x, uint32_t y, int lobe, int c)
{
    const struct hg_denoise_input *in = w->input;
    const size_t pixels = (size_t)in->width * in->height, px = (size_t)y * in->width + x;
    const int first = lobe == HG_DN_SCATTERS ? HG_PATH_SHOWN_ALBEDO : HG_PATH_SHOWN_REFLECTION;
    const uint32_t n = hg_dn_samples(in, x, y);
    const float sum = in->shown[(size_t)(first + c) * pixels + px];
    const float hits = in->shown[HG_PATH_SHOWN_HITS * pixels + px];
    return n > 0 ? (sum + HG_DN_LEAST_ALBEDO * hits) / (float)n : 0.0f;
}

static const struct hg_denoise_taps *taps_of(
    const struct hg_denoise_input *in, uint32_t x, uint32_t y)
{
    const uint32_t n = hg_dn_samples(in, x, y);
    const uint32_t index = n < 1 ? 0 : n - 1;
    return &in->taps[index < in->taps_count ? index : in->taps_count - 1];
}

// Pixels beyond the picture have no albedo.
static struct sum sum_around(const struct work *w, uint32_t x, uint32_t y, int lobe, int c)
{
    const struct hg_dn_planes *p = w->p;
    const struct hg_denoise_taps *taps = taps_of(w->input, p->x + x, p->y + y);
    struct sum s = {0};
    for (int i = 0; i < 9; i++) {
        const int dx = i % 3 - 1, dy = i / 3 - 1;
        const size_t q = hg_dn_at(p, x, y) + (size_t)(dy * (ptrdiff_t)p->stride + dx);
        const float weight = taps->x[i % 3] * taps->y[i / 3];
        if (!(weight > 0.0f && p->seen[q] > 0.0f))
            continue;
        const float albedo = weight * p->face[lobe].albedo[c][q];
        s.albedo += albedo;
        s.reflected +=
            weight * reflected(w, q, p->x + x + (uint32_t)dx, p->y + y + (uint32_t)dy, lobe, c);
        for (int k = 0; k < HG_DN_KINDS; k++) {
            if (hg_dn_lobe(k) == lobe)
                s.light[k] += albedo * w->clean->rgb[k][c][q];
        }
    }
    return s;
}

static void show_row(void *user, size_t row)
{
    const struct work *w = user;
    const struct hg_dn_planes *p = w->p;
    const uint32_t y = w->rect->y + (uint32_t)row;
    for (uint32_t x = w->rect->x; x < w->rect->x + w->rect->width; x++) {
        const size_t at = hg_dn_at(p, x, y);
        for (int i = 0; i < HG_DN_LOBES * 3; i++) {
            const int lobe = i / 3, c = i % 3;
            const struct sum s = sum_around(w, x, y, lobe, c);
            const float seen = s.reflected > 0.0f ? s.albedo / s.reflected : 0.0f;
            w->albedo[lobe][c][at] = seen * shown(w, p->x + x, p->y + y, lobe, c);
            for (int k = 0; k < HG_DN_KINDS; k++) {
                if (hg_dn_lobe(k) == lobe)
                    w->light[k][c][at] = s.albedo > 0.0f ? s.light[k] / s.albedo : 0.0f;
            }
        }
    }
}

void hg_dn_show(struct hg_dn_planes *p, struct hg_jobs *jobs, const struct hg_denoise_input *input,
    const struct hg_dn_rect *rect, struct hg_dn_clean *clean, float *to[HG_DN_KINDS][3])
{
    struct work work = {.p = p, .input = input, .rect = rect, .clean = clean, .light = to};
    for (int i = 0; i < HG_DN_LOBES * 3; i++)
        work.albedo[i / 3][i % 3] = p->light[i / 3][0].rgb[i % 3];
    hg_jobs_for(jobs, rect->height, show_row, &work);
    for (int i = 0; i < HG_DN_LOBES * 3; i++) {
        p->light[i / 3][0].rgb[i % 3] = p->face[i / 3].albedo[i % 3];
        p->face[i / 3].albedo[i % 3] = work.albedo[i / 3][i % 3];
    }
    for (int i = 0; i < HG_DN_KINDS * 3; i++)
        clean->rgb[i / 3][i % 3] = to[i / 3][i % 3];
}
