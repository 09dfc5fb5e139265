// glass.c - light by way of frosted glass; see gather.h.
#include <math.h>

#include "renderer/gather/film.h"
#include "shaders/shared/path.h"

// Roughness up to which glass is clear: neighbours see other things, and what each shows has hardly
// any noise; and from which on it is frosted.
#define CLEAR   0.05f
#define FROSTED 0.1f
#define FINEST  16    // the widest step is at most this part of the picture's height
#define LOBE    1.85f // heights of the picture that light may come from, times alpha

struct job {
    struct hg_gather *gather;
    const struct hg_gather_input *in;
    float *colors;
};

static size_t pixels_of(const struct hg_gather_input *in)
{
    return (size_t)in->width * in->height;
}

static float frosted(float roughness)
{
    return fminf(fmaxf((roughness - CLEAR) / (FROSTED - CLEAR), 0), 1);
}

// Whether a pixel shows frosted glass.
static bool is_any_frosted(const struct hg_gather_input *in)
{
    const size_t pixels = pixels_of(in);
    const float *hits = in->sums + HG_PATH_GUIDE_HITS * pixels;
    const float *roughness = in->sums + HG_PATH_GUIDE_ROUGHNESS * pixels;
    for (size_t at = 0; at < pixels; at++)
        if (hits[at] > 0 && fmodf(roughness[at], HG_PATH_GUIDE_CLOTH) > CLEAR * hits[at])
            return true;
    return false;
}

// Filtered light in place of what samples brought, of a pixel that is frosted by `share`. Specks
// are not held back: glass shows lamps, whose light counts.
static void mix(const struct job *job, int kind, size_t at, float share)
{
    const struct hg_gather_input *in = job->in;
    const size_t lobe = kind == SCATTERED ? HG_PATH_GUIDE_DIRECT : HG_PATH_GUIDE_SPECULAR;
    const size_t albedo_at = kind == SCATTERED ? HG_PATH_GUIDE_ALBEDO : HG_PATH_GUIDE_REFLECTION;
    const float samples = (float)in->samples;
    for (size_t c = 0; c < 3; c++) {
        const float own = in->sums[(lobe + c) * pixels_of(in) + at];
        const float albedo =
            fmaxf(in->sums[(albedo_at + c) * pixels_of(in) + at], LEAST_ALBEDO * samples);
        const float light = job->gather->from[kind][RED + c][at];
        float *color = &job->colors[4 * at + c];
        *color = fmaxf(*color + share * (light * albedo - own) / samples, 0);
    }
}

static void mix_row(void *user, size_t y)
{
    const struct job *job = user;
    const struct hg_gather *w = job->gather;
    for (size_t at = y * w->in.width; at < (y + 1) * (size_t)w->in.width; at++) {
        const float share = w->guides[DEPTH][at] > 0 ? frosted(w->guides[ROUGHNESS][at]) : 0;
        for (int kind = SCATTERED; kind <= MIRRORED && share > 0; kind++)
            mix(job, kind, at, share);
    }
}

enum hg_status hg_gather_glass(struct hg_jobs *jobs, const struct hg_gather_input *input,
    uint32_t height, float *colors, struct hg_error *err)
{
    struct job job = {.in = input, .colors = colors};
    const uint32_t most = height > FINEST ? height / FINEST : 1;
    if (!is_any_frosted(input))
        return HG_OK;
    enum hg_status status = hg_gather_load(jobs, input, &job.gather, err);
    if (status == HG_OK)
        status = hg_gather_prepare(job.gather, jobs, err);
    if (status == HG_OK) {
        job.gather->widest = most;
        job.gather->glass_px = LOBE * (float)height;
        for (int kind = SCATTERED; kind <= MIRRORED; kind++)
            hg_gather_filter_kind(job.gather, jobs, kind, most);
        hg_jobs_for(jobs, input->height, mix_row, &job);
    }
    hg_gather_free(job.gather);
    return status;
}
