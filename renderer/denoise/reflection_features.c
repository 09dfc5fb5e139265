// reflection_features.c - features seen in smooth surfaces: their variance, and denoised albedo.
#include "renderer/denoise/internal.h"

static float square(float x)
{
    return x * x;
}

// Where not both halves know what is seen in a smooth surface: its noise, by what is seen at the
// pixels around. Of textures and edges at least three of them show the same as the pixel does.
#define AROUND_SCALE 1.5f // what the third least of 8 squared differences is multiplied by

struct around {
    float tone[8], disparity[8];
    int count;
};

static float third_least(float values[8], int count)
{
    for (int i = 0; i < 3 && i < count; i++) {
        int least = i;
        for (int k = i + 1; k < count; k++)
            least = values[k] < values[least] ? k : least;
        const float value = values[least];
        values[least] = values[i];
        values[i] = value;
    }
    return count > 0 ? values[count < 3 ? count - 1 : 2] : 0.0f;
}

static struct around around_of(const struct hg_dn_planes *p, size_t at)
{
    const struct hg_dn_face *face = &p->face[HG_DN_MIRRORS];
    struct around out = {0};
    for (int i = 0; i < 9; i++) {
        const size_t q = at + (size_t)((i / 3 - 1) * (ptrdiff_t)p->stride + i % 3 - 1);
        if (i == 4 || !(p->seen[q] > 0.0f))
            continue;
        out.tone[out.count] = square(face->tone[at] - face->tone[q]);
        out.disparity[out.count++] = square(face->disparity[at] - face->disparity[q]);
    }
    return out;
}

static void guess_row(void *user, size_t y)
{
    struct hg_dn_planes *p = user;
    struct hg_dn_face *face = &p->face[HG_DN_MIRRORS];
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        if (!(p->seen[at] > 0.0f) || p->scratch[0][at] == 0.0f)
            continue;
        struct around a = around_of(p, at);
        face->tone_var[at] = AROUND_SCALE * third_least(a.tone, a.count);
        face->disparity_var[at] = AROUND_SCALE * third_least(a.disparity, a.count);
    }
}

void hg_dn_seen_guess(struct hg_dn_planes *p, struct hg_jobs *jobs)
{
    hg_jobs_for(jobs, p->height, guess_row, p);
}

// What is seen in curved glass is noisy itself, and light is multiplied by its albedo in the end:
// that becomes a mean over pixels that are alike within their noise.
#define CALM_REACH    3     // px
#define CALM_LEAST    0.03f // difference that counts where there is no noise, relative
#define CALM_STRENGTH 1.0f  // standard deviations
#define CALM_FROM     0.01f // noise that is worth it, relative

// Mean over 3x3 px of squared differences less what noise explains, in units of it.
static float calm_distance(const struct hg_dn_planes *p, size_t at, size_t q)
{
    const struct hg_dn_face *face = &p->face[HG_DN_MIRRORS];
    float sum = 0.0f; // of 3x3 px
    for (int i = 0; i < 9; i++) {
        const size_t step = (size_t)((i / 3 - 1) * (ptrdiff_t)p->stride + i % 3 - 1);
        const float va = face->tone_var[at + step], vb = face->tone_var[q + step];
        float off = 0.0f, size = 0.0f;
        for (int c = 0; c < 3; c++) {
            const float a = face->albedo[c][at + step], b = face->albedo[c][q + step];
            off += square(a - b);
            size += a * a + b * b;
        }
        sum += (off - 3.0f * (va + (va < vb ? va : vb))) /
               (3.0f * square(CALM_STRENGTH) * (va + vb) + square(CALM_LEAST) * size + 1e-12f);
    }
    return sum > 0.0f ? sum / 9.0f : 0.0f;
}

static void calm_pixel(const struct hg_dn_planes *p, size_t at, float out[3])
{
    const struct hg_dn_face *face = &p->face[HG_DN_MIRRORS];
    float weights = 0.0f;
    for (int dy = -CALM_REACH; dy <= CALM_REACH; dy++) {
        for (int dx = -CALM_REACH; dx <= CALM_REACH; dx++) {
            const size_t q = at + (size_t)(dy * (ptrdiff_t)p->stride + dx);
            if (!(p->seen[q] > 0.0f))
                continue;
            const float w = p->seen[q] / (1.0f + square(3.0f * calm_distance(p, at, q)));
            for (int c = 0; c < 3; c++)
                out[c] += w * face->albedo[c][q];
            weights += w;
        }
    }
    for (int c = 0; c < 3; c++)
        out[c] /= weights;
}

static void calm_row(void *user, size_t y)
{
    struct hg_dn_planes *p = user;
    const struct hg_dn_face *face = &p->face[HG_DN_MIRRORS];
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        float albedo[3] = {0};
        const bool noisy =
            p->seen[at] > 0.0f && face->tone_var[at] > square(CALM_FROM * face->tone[at]);
        if (noisy)
            calm_pixel(p, at, albedo);
        for (int c = 0; c < 3; c++)
            p->scratch[c][at] = noisy ? albedo[c] : face->albedo[c][at];
    }
}

void hg_dn_seen_calm(struct hg_dn_planes *p, struct hg_jobs *jobs)
{
    float **albedo = p->face[HG_DN_MIRRORS].albedo;
    hg_jobs_for(jobs, p->height, calm_row, p);
    for (int c = 0; c < 3; c++) {
        float *raw = albedo[c];
        albedo[c] = p->scratch[c];
        p->scratch[c] = raw;
    }
}
