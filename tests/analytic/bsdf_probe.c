#include "tests/analytic/bsdf_probe.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"

#define HEAD (sizeof(struct bsdf_material) / sizeof(struct hg_vec4))

const struct bsdf_material bsdf_white = {.base = {1, 1, 1},
    .roughness = 0.5f,
    .ior = 1.5f,
    .specular = 1,
    .specular_color = {1, 1, 1},
    .film_ior = 1.3f,
    .behind = {1, 1, 1},
    .ior_outside = 1};

bool bsdf_goes_through(const struct bsdf_material *m)
{
    return m->transmission > 0 || m->diffuse_transmission > 0;
}

void bsdf_run(struct probe *probe, enum bsdf_op op, const struct bsdf_material *m, uint32_t count,
    const struct hg_vec4 *pairs, struct hg_vec4 *out)
{
    struct hg_vec4 *in = hg_calloc(HEAD + 2 * count, sizeof *in);
    assert_non_null(in);
    memcpy(in, m, sizeof *m);
    memcpy(in + HEAD, pairs, 2 * count * sizeof *pairs);
    const struct probe_dispatch dispatch = {"bsdf.comp", op, count};
    probe_run_shader(probe, &dispatch, in, (uint32_t)HEAD + 2 * count, out, 2 * count);
    hg_free(in);
}

enum { PARTS = 50, SHIFTED = 5, SHIFTS = PARTS / SHIFTED }; // of bsdf.comp

// Of SHIFTS sums of samples: deviation of their mean.
static float noise_of(const struct hg_vec4 *sums, int channel)
{
    double sum = 0, squares = 0;
    for (int i = 0; i < SHIFTS; i++) {
        double one = 0;
        for (int k = 0; k < SHIFTED; k++)
            one += (double)(&sums[2 * (i * SHIFTED + k)].x)[channel] * SHIFTS;
        sum += one / SHIFTS;
        squares += one * one / SHIFTS;
    }
    return (float)sqrt(fmax(squares - sum * sum, 0) / (SHIFTS - 1));
}

void bsdf_albedo(struct probe *probe, const struct bsdf_material *m, uint32_t samples,
    uint32_t count, const struct hg_vec4 *directions, struct hg_vec4 (*albedo_noise)[2])
{
    struct hg_vec4 *in = hg_calloc((size_t)2 * PARTS * count, 2 * sizeof *in);
    assert_non_null(in);
    struct hg_vec4 *sums = in + (size_t)2 * PARTS * count;
    for (uint32_t i = 0; i < PARTS * count; i++) {
        in[2 * i] = directions[i / PARTS];
        in[2 * i + 1] = (struct hg_vec4){(float)(i % PARTS), 0, 0, (float)samples};
    }
    bsdf_run(probe, BSDF_SAMPLE, m, PARTS * count, in, sums);
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_vec4 *parts = &sums[2 * i * PARTS];
        float *sum = &albedo_noise[i][0].x, *noise = &albedo_noise[i][1].x;
        for (int c = 0; c < 4; c++) {
            double all = 0;
            for (uint32_t k = 0; k < PARTS; k++)
                all += (double)(&parts[2 * k].x)[c];
            sum[c] = (float)all;
            noise[c] = noise_of(parts, c);
        }
    }
    hg_free(in);
}

struct hg_vec4 bsdf_direction(float cosine, float phi, bool front)
{
    const float s = sqrtf(fmaxf(0, 1 - cosine * cosine));
    return (struct hg_vec4){s * cosf(phi), s * sinf(phi), cosine, front ? 1 : 0};
}
