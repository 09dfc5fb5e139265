// filter_avx2.c - see look_up.h. The same operations as there, in the same order: compilers turn
// words to floats four at a time where eight would do.
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

#endif
