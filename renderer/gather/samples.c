// samples.c - how many samples the picture takes where; see gather.h.
#include <math.h>

#include "renderer/gather/gather.h"
#include "shaders/shared/path.h"
#include "shaders/shared/sample_blocks.h"

#define LEAST_SAMPLES HG_GATHER_LEAST_SAMPLES
// Contrast of neighbours up to which 2, 3, ... eighths of the samples leave no more error than all
// of them do at an edge of contrast 1: that falls with the number of samples to the power of 3/4,
// as they are spread evenly over a pixel (Mitchell 1996).
#define FIRST_EIGHTHS 2
static const float plain[] = {0.35f, 0.47f, 0.60f, 0.70f, 0.80f, 0.90f};

#define FACING 0.5f  // of the light on a surface, per unit that its normal changes by
#define DARK   0.04f // albedo that differences are held against, at least
#define SLOPES 3.0f  // depth that changes by so many times as much on one side is an edge
#define STEP   0.01f // of the depth, which is none
// A block with the pixels beside it.
#define WIDTH  (HG_SAMPLE_BLOCK_WIDTH + 2)
#define HEIGHT (HG_SAMPLE_BLOCK_HEIGHT + 2)

struct job {
    const struct hg_gather_input *in;
    uint32_t samples, *out;
};

// What a pixel shows, means of its samples.
struct seen {
    float albedo[3], normal[3];
    float nearness; // 1 / depth, which is linear in the picture
    bool whole;     // all samples met a surface
};

static struct seen seen_at(const struct hg_gather_input *in, size_t at)
{
    const size_t pixels = (size_t)in->width * in->height;
    const float *sums = in->sums, hits = sums[HG_PATH_GUIDE_HITS * pixels + at];
    struct seen s = {.whole = hits >= (float)in->samples};
    if (!s.whole)
        return s;
    for (size_t c = 0; c < 3; c++) {
        s.albedo[c] = (sums[(HG_PATH_GUIDE_ALBEDO + c) * pixels + at] +
                          sums[(HG_PATH_GUIDE_REFLECTION + c) * pixels + at]) /
                      hits;
        s.normal[c] = sums[(HG_PATH_GUIDE_NORMAL + c) * pixels + at] / hits;
    }
    s.nearness = expf(-sums[HG_PATH_GUIDE_DEPTH * pixels + at] / hits);
    return s;
}

// How much two pixels beside each other differ: about as much as samples of one of them do.
static float contrast_of(const struct seen *a, const struct seen *b)
{
    float most = 0, apart2 = 0, level = DARK;
    if (!a->whole || !b->whole)
        return 1;
    for (int c = 0; c < 3; c++) {
        const float turn = a->normal[c] - b->normal[c];
        apart2 += turn * turn;
        level = fmaxf(level, fmaxf(a->albedo[c], b->albedo[c]));
        most = fmaxf(most, fabsf(a->albedo[c] - b->albedo[c]));
    }
    return fmaxf(most / level, FACING * sqrtf(apart2));
}

static bool is_step(const struct seen *before, const struct seen *at, const struct seen *after)
{
    const float back = fabsf(at->nearness - before->nearness);
    const float on = fabsf(after->nearness - at->nearness);
    return fmaxf(back, on) > SLOPES * fminf(back, on) + STEP * at->nearness;
}

// Of a window of pixels, those beyond the picture's edge being those at it.
static float contrast_in(const struct seen s[HEIGHT][WIDTH])
{
    float most = 0;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            if (x > 0)
                most = fmaxf(most, contrast_of(&s[y][x], &s[y][x - 1]));
            if (y > 0)
                most = fmaxf(most, contrast_of(&s[y][x], &s[y - 1][x]));
            if ((x > 0 && x + 1 < WIDTH && is_step(&s[y][x - 1], &s[y][x], &s[y][x + 1])) ||
                (y > 0 && y + 1 < HEIGHT && is_step(&s[y - 1][x], &s[y][x], &s[y + 1][x])))
                return 1;
        }
    return most;
}

static uint32_t within(int64_t at, uint32_t count)
{
    return at < 0 ? 0 : at >= count ? count - 1 : (uint32_t)at;
}

static uint32_t enough(float contrast, uint32_t samples)
{
    uint32_t eighths = FIRST_EIGHTHS;
    while (eighths < 8 && contrast > plain[eighths - FIRST_EIGHTHS])
        eighths++;
    const uint32_t share = (samples * eighths + 7) / 8;
    const uint32_t least = samples < LEAST_SAMPLES ? samples : LEAST_SAMPLES;
    return share > least ? share : least;
}

static void block_row(void *user, size_t row)
{
    const struct job *job = user;
    const struct hg_gather_input *in = job->in;
    const uint32_t columns = HG_SAMPLE_BLOCK_COLUMNS(in->width);
    for (uint32_t column = 0; column < columns; column++) {
        struct seen window[HEIGHT][WIDTH];
        for (int y = 0; y < HEIGHT; y++)
            for (int x = 0; x < WIDTH; x++) {
                const int64_t left = (int64_t)column * HG_SAMPLE_BLOCK_WIDTH - 1 + x;
                const int64_t top = (int64_t)row * HG_SAMPLE_BLOCK_HEIGHT - 1 + y;
                window[y][x] = seen_at(
                    in, (size_t)within(top, in->height) * in->width + within(left, in->width));
            }
        job->out[row * columns + column] = enough(contrast_in(window), job->samples);
    }
}

void hg_gather_samples(
    struct hg_jobs *jobs, const struct hg_gather_input *input, uint32_t samples, uint32_t *counts)
{
    struct job job = {input, samples, counts};
    hg_jobs_for(jobs, HG_SAMPLE_BLOCK_ROWS(input->height), block_row, &job);
}
