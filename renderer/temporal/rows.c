// rows.c - see rows.h.
#include "renderer/temporal/rows.h"

#include <math.h>
#include <string.h>

#include "renderer/temporal/lanes.h"

// --- one row of samples --------------------------------------------------------------------------

HG_SIMD_LOOP
bool hg_temporal_decode(const uint8_t *rgba, uint32_t count, float *const color[4])
{
    uint32_t all = UINT32_MAX;
    float *restrict luma = color[0], *restrict orange = color[1], *restrict green = color[2];
    float *restrict alpha = color[3];
    for (uint32_t i = 0; i < count; i++) {
        uint32_t texel;
        memcpy(&texel, rgba + 4 * (size_t)i, sizeof texel);
        all &= texel;
        const float r0 = (float)(int32_t)(texel & 255), g0 = (float)(int32_t)(texel >> 8 & 255);
        const float b0 = (float)(int32_t)(texel >> 16 & 255);
        const float a = (float)(int32_t)(texel >> 24) * (1.0f / 255.0f), s = a * (1.0f / 65025.0f);
        const float r = r0 * r0 * s, g = g0 * g0 * s, b = b0 * b0 * s;
        luma[i] = 0.25f * (r + b) + 0.5f * g;
        orange[i] = 0.5f * (r - b);
        green[i] = 0.5f * g - 0.25f * (r + b);
        alpha[i] = a;
    }
    return all >> 24 == 255;
}

static void repeat_ends(float *row, uint32_t count)
{
    row[-1] = row[0];
    row[count] = row[count - 1];
}

void hg_temporal_line_repeat(uint32_t samples, struct hg_temporal_line *line)
{
    float *const motion[4] = {
        line->motion.x, line->motion.y, line->motion.expect, line->motion.depth};
    for (int c = 0; c < HG_TEMPORAL_CHANNELS; c++)
        repeat_ends(line->color[c], samples);
    for (int k = 0; k < 4; k++)
        repeat_ends(motion[k], samples);
}

void hg_temporal_line_fill(
    const struct hg_temporal_picture *p, uint32_t y, struct hg_temporal_line *line)
{
    line->opaque = hg_temporal_decode(p->rgba + 4 * (size_t)y * p->width, p->width, line->color);
    hg_temporal_line_repeat(p->width, line);
}

// --- three rows ----------------------------------------------------------------------------------

// Sums over the columns, and weighed ones, from -1 to samples.
HG_SIMD_LOOP
static void sum_columns(const float *const row[3], const float weight[3], uint32_t samples,
    float *restrict color, float *restrict sum, float *restrict squares)
{
    const float *restrict a = row[0] - 1, *restrict b = row[1] - 1, *restrict c = row[2] - 1;
    const float wa = weight[0], wb = weight[1], wc = weight[2];
    float *restrict to = color - 1, *restrict s = sum - 1, *restrict q = squares - 1;
    for (uint32_t i = 0; i < samples + 2; i++) {
        to[i] = wa * a[i] + wb * b[i] + wc * c[i];
        s[i] = a[i] + b[i] + c[i];
        q[i] = a[i] * a[i] + b[i] * b[i] + c[i] * c[i];
    }
}

// Sums along the row to mean and deviation, in place but for `mean_out` and `deviation_out`.
HG_SIMD_LOOP
static void sum_along(const float *restrict sum, const float *restrict squares, uint32_t samples,
    float *restrict mean_out, float *restrict deviation_out)
{
    for (uint32_t i = 0; i < samples; i++) {
        const float mean = (sum[i] + sum[(int64_t)i - 1] + sum[i + 1]) * (1.0f / 9.0f);
        const float square =
            (squares[i] + squares[(int64_t)i - 1] + squares[i + 1]) * (1.0f / 9.0f);
        const float variance = square - mean * mean;
        mean_out[i] = mean;
        deviation_out[i] = sqrtf(variance > 0.0f ? variance : 0.0f);
    }
}

// The nearest of three per sample, the middle one first among equals; `from`, of count.
HG_SIMD_LOOP
static void take_nearest(const struct hg_temporal_motion_row from[3], uint32_t count,
    const struct hg_temporal_motion_row *to)
{
    for (uint32_t i = 0; i < count; i += HG_LANES) {
        const hg_lanes a = HG_LANES_AT(from[0].depth, i), b = HG_LANES_AT(from[2].depth, i);
        const hg_lanes middle = HG_LANES_AT(from[1].depth, i);
        const hg_lanes_int first = a > middle;
        const hg_lanes nearer = HG_LANES_PICK(first, a, middle);
        const hg_lanes_int last = b > nearer;
        const float *const rows[3][3] = {{from[0].x, from[1].x, from[2].x},
            {from[0].y, from[1].y, from[2].y}, {from[0].expect, from[1].expect, from[2].expect}};
        float *const out[3] = {to->x, to->y, to->expect};
        for (int k = 0; k < 3; k++) {
            const hg_lanes two =
                HG_LANES_PICK(first, HG_LANES_AT(rows[k][0], i), HG_LANES_AT(rows[k][1], i));
            HG_LANES_PUT(out[k], i, HG_LANES_PICK(last, HG_LANES_AT(rows[k][2], i), two));
        }
        HG_LANES_PUT(to->depth, i, HG_LANES_PICK(last, b, nearer));
    }
}

static struct hg_temporal_motion_row shifted(const struct hg_temporal_motion_row *row, int by)
{
    return (struct hg_temporal_motion_row){
        row->x + by, row->y + by, row->expect + by, row->depth + by};
}

// The nearest of 3x3, the middle one first among equals. `spare`: the nearest of columns.
static void find_nearest(const struct hg_temporal_line *const lines[3], uint32_t samples,
    const struct hg_temporal_motion_row *spare, const struct hg_temporal_motion_row *out)
{
    const struct hg_temporal_motion_row wide = shifted(spare, -1);
    const struct hg_temporal_motion_row columns[3] = {shifted(&lines[0]->motion, -1),
        shifted(&lines[1]->motion, -1), shifted(&lines[2]->motion, -1)};
    const struct hg_temporal_motion_row along[3] = {wide, *spare, shifted(spare, 1)};
    take_nearest(columns, samples + 2, &wide);
    take_nearest(along, samples, out);
}

HG_SIMD_LOOP
static void subtract(
    const float *restrict a, const float *restrict b, uint32_t count, float *restrict out)
{
    for (uint32_t i = 0; i < count; i++)
        out[i] = a[i] - b[i];
}

void hg_temporal_about_fill(const struct hg_temporal_line *const lines[3], const float weight[3],
    uint32_t samples, struct hg_temporal_about *s)
{
    // The rows of the motion are not filled yet: room for the sums.
    float *const sum = s->motion.x, *const squares = s->motion.y;
    const bool opaque = lines[0]->opaque && lines[1]->opaque && lines[2]->opaque;
    s->channels = opaque ? HG_TEMPORAL_CHANNELS - 1 : HG_TEMPORAL_CHANNELS;
    for (int c = 0; c < s->channels; c++) {
        const float *const rows[3] = {lines[0]->color[c], lines[1]->color[c], lines[2]->color[c]};
        sum_columns(rows, weight, samples, s->color[c], sum, squares);
        sum_along(sum, squares, samples, s->mean[c], s->deviation[c]);
    }
    const struct hg_temporal_motion_row spare = {
        s->spare[0], s->spare[1], s->spare[2], s->spare[3]};
    find_nearest(lines, samples, &spare, &s->motion);
    subtract(s->motion.depth, lines[1]->motion.depth, samples, s->slope);
}

HG_SIMD_LOOP
static void weigh_columns(
    const float *const row[3], const float weight[3], uint32_t samples, float *restrict color)
{
    const float *restrict a = row[0], *restrict b = row[1], *restrict c = row[2];
    const float wa = weight[0], wb = weight[1], wc = weight[2];
    for (uint32_t i = 0; i < samples; i++)
        color[i] = wa * a[i] + wb * b[i] + wc * c[i];
}

void hg_temporal_about_weigh(const struct hg_temporal_line *const lines[3], const float weight[3],
    uint32_t samples, struct hg_temporal_about *about)
{
    for (int c = 0; c < about->channels; c++) {
        const float *const rows[3] = {lines[0]->color[c], lines[1]->color[c], lines[2]->color[c]};
        weigh_columns(rows, weight, samples, about->color[c]);
    }
}

// --- along the row -------------------------------------------------------------------------------

HG_SIMD_LOOP
static void blur(
    const float *restrict from, const float weight[3], uint32_t count, float *restrict to)
{
    const float a = weight[0], b = weight[1], c = weight[2];
    for (uint32_t i = 0; i < count; i++)
        to[i] = a * from[(int64_t)i - 1] + b * from[i] + c * from[i + 1];
}

void hg_temporal_about_blur(
    struct hg_temporal_about *about, const float weight[3], uint32_t samples)
{
    for (int c = 0; c < about->channels; c++) {
        blur(about->color[c], weight, samples, about->spare[0]);
        memcpy(about->color[c], about->spare[0], samples * sizeof(float));
    }
}

void hg_temporal_expand_plain(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to)
{
    for (uint32_t i = 0; i < pixels; i++)
        to[i] = from[taps->first[i]];
}

void hg_temporal_expand_weighed_plain(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to)
{
    const float *a = taps->weight, *b = a + pixels, *c = b + pixels;
    for (uint32_t i = 0; i < pixels; i++) {
        const float *at = from + taps->first[i];
        to[i] = a[i] * at[-1] + b[i] * at[0] + c[i] * at[1];
    }
}

typedef void expand_fn(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to);

void hg_temporal_about_expand(const struct hg_temporal_about *s,
    const struct hg_temporal_taps *columns, uint32_t pixels, bool all,
    struct hg_temporal_about *out)
{
    const bool avx2 = hg_temporal_has_avx2();
    expand_fn *const expand = avx2 ? hg_temporal_expand_avx2 : hg_temporal_expand_plain;
    expand_fn *const weighed =
        avx2 ? hg_temporal_expand_weighed_avx2 : hg_temporal_expand_weighed_plain;
    out->channels = s->channels;
    for (int c = 0; c < s->channels; c++)
        weighed(s->color[c], columns, pixels, out->color[c]);
    if (!all)
        return;
    for (int c = 0; c < s->channels; c++) {
        expand(s->mean[c], columns, pixels, out->mean[c]);
        expand(s->deviation[c], columns, pixels, out->deviation[c]);
    }
    const float *const from[5] = {
        s->motion.x, s->motion.y, s->motion.expect, s->motion.depth, s->slope};
    float *const to[5] = {
        out->motion.x, out->motion.y, out->motion.expect, out->motion.depth, out->slope};
    for (int k = 0; k < 5; k++)
        expand(from[k], columns, pixels, to[k]);
}
