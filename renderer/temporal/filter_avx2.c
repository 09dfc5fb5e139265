// filter_avx2.c - see look_up.h and rows.h. The same operations as there, in the same order:
// compilers turn words to floats four at a time where eight would do, and look values up one by
// one.
#include "renderer/temporal/look_up.h"

#if defined(__x86_64__)

#include <immintrin.h>

#define TARGET __attribute__((target("avx2")))

bool hg_temporal_has_avx2(void)
{
    return __builtin_cpu_supports("avx2");
}

TARGET static inline __m256 load_two(const uint16_t *texels)
{
    const __m128i words = _mm_loadu_si128((const __m128i *)(const void *)texels);
    return _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(words));
}

// Catmull-Rom weights of four texels at x between the second and the third.
TARGET static inline __m128 weights(float x)
{
    const __m128 at = _mm_set1_ps(x);
    __m128 w = _mm_mul_ps(_mm_setr_ps(-0.5f, 1.5f, -1.5f, 0.5f), at);
    w = _mm_mul_ps(_mm_add_ps(w, _mm_setr_ps(1.0f, -2.5f, 2.0f, -0.5f)), at);
    w = _mm_mul_ps(_mm_add_ps(w, _mm_setr_ps(-0.5f, 0.0f, 0.5f, 0.0f)), at);
    return _mm_add_ps(w, _mm_setr_ps(0.0f, 1.0f, 0.0f, 0.0f));
}

TARGET void hg_temporal_filter_avx2(const struct hg_temporal_past *past, size_t pitch,
    uint32_t width, const struct hg_temporal_found *out)
{
    const __m256i pairs[2] = {
        _mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1), _mm256_setr_epi32(2, 2, 2, 2, 3, 3, 3, 3)};
    const __m128 unit = _mm_set1_ps(1.0f / 65535.0f);
    for (uint32_t i = 0; i < width; i++) {
        if (!(out->weight[i] > 0.0f))
            continue;
        const __m256 wx = _mm256_castps128_ps256(_mm_mul_ps(weights(out->part_x[i]), unit));
        const __m128 down = weights(out->part_y[i]);
        const __m256 wy = _mm256_set_m128(down, down);
        const uint16_t *at = past->color + 4 * (size_t)out->texel[i];
        const uint16_t *second = at + 4 * pitch, *third = second + 4 * pitch;
        const uint16_t *fourth = third + 4 * pitch;
        const __m256 w0 = _mm256_permute_ps(wy, 0x00), w1 = _mm256_permute_ps(wy, 0x55);
        const __m256 w2 = _mm256_permute_ps(wy, 0xaa), w3 = _mm256_permute_ps(wy, 0xff);
        __m256 first = _mm256_mul_ps(load_two(at), w0);
        __m256 last = _mm256_mul_ps(load_two(at + 8), w0);
        first = _mm256_add_ps(first, _mm256_mul_ps(load_two(second), w1));
        last = _mm256_add_ps(last, _mm256_mul_ps(load_two(second + 8), w1));
        first = _mm256_add_ps(first, _mm256_mul_ps(load_two(third), w2));
        last = _mm256_add_ps(last, _mm256_mul_ps(load_two(third + 8), w2));
        first = _mm256_add_ps(first, _mm256_mul_ps(load_two(fourth), w3));
        last = _mm256_add_ps(last, _mm256_mul_ps(load_two(fourth + 8), w3));
        const __m256 sum =
            _mm256_add_ps(_mm256_mul_ps(first, _mm256_permutevar8x32_ps(wx, pairs[0])),
                _mm256_mul_ps(last, _mm256_permutevar8x32_ps(wx, pairs[1])));
        _mm_storeu_ps(out->color + 4 * (size_t)i,
            _mm_add_ps(_mm256_castps256_ps128(sum), _mm256_extractf128_ps(sum, 1)));
    }
}

TARGET void hg_temporal_weigh_avx2(const struct hg_temporal_past *past,
    const struct hg_temporal_about *about, uint32_t width, const struct hg_temporal_found *out)
{
    const __m256 reach = _mm256_set1_ps(1.0f + HG_TEMPORAL_DEPTH_REACH);
    const __m256 slopes = _mm256_set1_ps(HG_TEMPORAL_SLOPE_REACH), one = _mm256_set1_ps(1.0f);
    const __m256 unit = _mm256_set1_ps(1.0f / 16.0f);
    const __m256i zero = _mm256_setzero_si256(), byte = _mm256_set1_epi32(255);
    for (uint32_t i = 0; i < width; i += 8) {
        const __m256i at = _mm256_loadu_si256((const __m256i *)(const void *)(out->nearest + i));
        const __m256i from = _mm256_max_epi32(at, zero);
        const __m256 was = _mm256_i32gather_ps(past->depth, from, 4);
        const __m256i weight = _mm256_and_si256(
            _mm256_i32gather_epi32((const int *)(const void *)past->weight, from, 1), byte);
        const __m256 expect = _mm256_loadu_ps(about->motion.expect + i);
        const __m256 now = _mm256_loadu_ps(about->motion.depth + i);
        const __m256 most = _mm256_add_ps(
            _mm256_mul_ps(expect, reach), _mm256_mul_ps(slopes, _mm256_loadu_ps(about->slope + i)));
        const __m256 outside = _mm256_castsi256_ps(_mm256_cmpgt_epi32(zero, at));
        const __m256 same = _mm256_andnot_ps(outside, _mm256_cmp_ps(was, most, _CMP_LE_OQ));
        const __m256 farther = _mm256_blendv_ps(
            one, _mm256_div_ps(expect, now), _mm256_cmp_ps(expect, now, _CMP_LT_OQ));
        const __m256 share = _mm256_mul_ps(_mm256_mul_ps(farther, farther), unit);
        const __m256 had = _mm256_mul_ps(_mm256_cvtepi32_ps(weight), share);
        _mm256_storeu_ps(out->weight + i, _mm256_and_ps(had, same));
    }
}

// Pixels are no farther apart than samples, so eight of them look at eight samples in a row at
// most.
TARGET static inline __m256 spread_eight(const float *from, __m256i which)
{
    return _mm256_permutevar8x32_ps(_mm256_loadu_ps(from), which);
}

TARGET static inline __m256i which_of(const uint32_t *first)
{
    return _mm256_sub_epi32(
        _mm256_loadu_si256((const __m256i *)(const void *)first), _mm256_set1_epi32((int)*first));
}

TARGET void hg_temporal_expand_avx2(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to)
{
    for (uint32_t i = 0; i < pixels; i += 8)
        _mm256_storeu_ps(to + i, spread_eight(from + taps->first[i], which_of(taps->first + i)));
}

TARGET void hg_temporal_expand_weighed_avx2(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to)
{
    const float *a = taps->weight, *b = a + pixels, *c = b + pixels;
    for (uint32_t i = 0; i < pixels; i += 8) {
        const float *at = from + taps->first[i];
        const __m256i which = which_of(taps->first + i);
        const __m256 left = _mm256_mul_ps(_mm256_loadu_ps(a + i), spread_eight(at - 1, which));
        const __m256 middle = _mm256_mul_ps(_mm256_loadu_ps(b + i), spread_eight(at, which));
        const __m256 right = _mm256_mul_ps(_mm256_loadu_ps(c + i), spread_eight(at + 1, which));
        _mm256_storeu_ps(to + i, _mm256_add_ps(_mm256_add_ps(left, middle), right));
    }
}

#else

bool hg_temporal_has_avx2(void)
{
    return false;
}

void hg_temporal_filter_avx2(const struct hg_temporal_past *past, size_t pitch, uint32_t width,
    const struct hg_temporal_found *out)
{
    (void)past;
    (void)pitch;
    (void)width;
    (void)out;
}

void hg_temporal_weigh_avx2(const struct hg_temporal_past *past,
    const struct hg_temporal_about *about, uint32_t width, const struct hg_temporal_found *out)
{
    (void)past;
    (void)about;
    (void)width;
    (void)out;
}

void hg_temporal_expand_avx2(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to)
{
    (void)from;
    (void)taps;
    (void)pixels;
    (void)to;
}

void hg_temporal_expand_weighed_avx2(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to)
{
    (void)from;
    (void)taps;
    (void)pixels;
    (void)to;
}

#endif
