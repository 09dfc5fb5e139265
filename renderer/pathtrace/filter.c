// filter.c - see filter.h.
#include "renderer/pathtrace/filter.h"

#include <math.h>
#include <string.h>

// --- filters -------------------------------------------------------------------------------------

enum filter { FILTER_BLACKMAN_HARRIS, FILTER_BOX, FILTER_TENT, FILTER_GAUSSIAN };

// Height at x in -1..1.
static double filter_at(uint32_t filter, double x)
{
    switch (filter) {
    case FILTER_BOX:
        return 1.0;
    case FILTER_TENT:
        return 1.0 - fabs(x);
    case FILTER_GAUSSIAN: // less its height at the end
        return exp(-4.5 * x * x) - exp(-4.5);
    default: // window of Harris 1978, four terms
        return 0.35875 + 0.48829 * cos(M_PI * x) + 0.14128 * cos(2.0 * M_PI * x) +
               0.01168 * cos(3.0 * M_PI * x);
    }
}

// Inverse CDF: entry i is where the filter's integral from its left end reaches i / steps.
void hg_path_filter_fill(uint32_t filter, float radius_px, float out[HG_PATH_FILTER_STEPS + 1])
{
    enum { FINE = 8192 };
    double total = 0.0, sum = 0.0;
    uint32_t next = 1;
    for (int i = 0; i < FINE; i++)
        total += filter_at(filter, (i + 0.5) * 2.0 / FINE - 1.0);
    for (int i = 0; i < FINE && next < HG_PATH_FILTER_STEPS; i++) {
        const double h = filter_at(filter, (i + 0.5) * 2.0 / FINE - 1.0) / total;
        double want = (double)next / HG_PATH_FILTER_STEPS;
        while (next < HG_PATH_FILTER_STEPS && want <= sum + h) {
            const double part = h > 0.0 ? (want - sum) / h : 0.5;
            out[next++] = radius_px * (float)((i + part) * 2.0 / FINE - 1.0);
            want = (double)next / HG_PATH_FILTER_STEPS;
        }
        sum += h;
    }
    while (next < HG_PATH_FILTER_STEPS)
        out[next++] = radius_px;
    out[0] = -radius_px;
    out[HG_PATH_FILTER_STEPS] = radius_px;
}

// --- splatting -----------------------------------------------------------------------------------

#define SPLAT_RADIUS_PX 1.5f // of the widest filter that does not reach farther than the next pixel

bool hg_path_filter_splats(const struct hg_path_settings *s)
{
    return s->filter_radius_px <= SPLAT_RADIUS_PX;
}

static uint32_t mix_bits(uint32_t x)
{
    x ^= x >> 16;
    x *= 0x21f0aaadu;
    x ^= x >> 15;
    x *= 0x735a2d97u;
    return x ^ (x >> 15);
}

// Owen scrambling: each bit is flipped depending on the bits above it.
static uint32_t scramble(uint32_t x, uint32_t seed)
{
    uint32_t out = 0, above = seed;
    for (int bit = 31; bit >= 0; bit--) {
        const uint32_t b = x >> bit & 1u;
        out |= (b ^ (mix_bits(above) & 1u)) << bit;
        above = mix_bits(above * 2u + b + 0x9e3779b9u);
    }
    return out;
}

// Scrambled points of Sobol dimensions 2 and 3, -0.5..0.5. Dimension 1 orders the shutter
// intervals (motion_blur.c), so that time and place together are well distributed. Source of the
// direction numbers: Joe and Kuo 2008, "Constructing Sobol Sequences
// with Better Two-Dimensional Projections".
static void splat_offset(uint32_t number, uint32_t seed, float out[2])
{
    uint32_t v[2] = {1u << 31, 1u << 31}, before = 0, x = 0, y = 0;
    for (uint32_t i = number, bit = 0; i != 0; i >>= 1, bit++) {
        x ^= (i & 1u) != 0 ? v[0] : 0;
        y ^= (i & 1u) != 0 ? v[1] : 0;
        v[0] ^= v[0] >> 1;
        const uint32_t next = bit == 0 ? 3u << 30 : v[1] ^ before ^ before >> 2;
        before = v[1];
        v[1] = next;
    }
    const uint32_t salt = mix_bits(seed ^ 0xb5297a4du);
    x = scramble(x, mix_bits(salt ^ 0x68bc21ebu));
    y = scramble(y, mix_bits(salt ^ 0x02e5be93u));
    out[0] = ((float)(x >> 8) + 0.5f) / 16777216.0f - 0.5f;
    out[1] = ((float)(y >> 8) + 0.5f) / 16777216.0f - 0.5f;
}

static struct hg_vec3 splat_weights(const struct hg_path_settings *s, float offset)
{
    float w[3], sum = 0.0f;
    for (int i = 0; i < 3; i++) {
        const double x = ((double)offset + i - 1) / (double)s->filter_radius_px;
        w[i] = fabs(x) < 1.0 ? fmaxf((float)filter_at(s->filter, x), 0.0f) : 0.0f;
        sum += w[i];
    }
    if (!(sum > 0.0f)) // between filters that are narrower than pixels
        return (struct hg_vec3){0.0f, 1.0f, 0.0f};
    return (struct hg_vec3){w[0] / sum, w[1] / sum, w[2] / sum};
}

void hg_path_splat_fill(
    const struct hg_path_settings *s, uint32_t pass, uint32_t seed, struct hg_gpu_path *out)
{
    splat_offset(pass, seed, out->splat_offset);
    for (int i = 0; i < 2 && s->filter_radius_px < 0.5f; i++)
        out->splat_offset[i] *= 2.0f * s->filter_radius_px;
    out->splat_x = splat_weights(s, out->splat_offset[0]);
    out->splat_y = splat_weights(s, out->splat_offset[1]);
}

// A pixel's own samples cover only the pixel, but the filter is wider: three splat weights per axis
// are chosen so that samples and weights together have the filter's mean and variance.
struct spread {
    double own, own2, all,
        all2;     // sums of offsets and their squares: own samples; all splatted ones
    bool reaches; // the filter is wider than a pixel
};

#define SPREAD_LEAST 0.002 // variance: where a pixel's own samples see nothing, those around tell

static void spread_add(struct spread *s, float offset, struct hg_vec3 weights)
{
    const float w[3] = {weights.x, weights.y, weights.z};
    s->own += (double)offset;
    s->own2 += (double)offset * (double)offset;
    for (int i = 0; i < 3; i++) {
        const double place = (double)offset + i - 1;
        s->all += (double)w[i] * place;
        s->all2 += (double)w[i] * place * place;
        s->reaches = s->reaches || (i != 1 && w[i] > 0.0f);
    }
}

static void spread_weights(const struct spread *s, double n, float out[3])
{
    const double own = s->own / n, all = s->all / n, off = all - own;
    const double wanted = s->all2 / n - all * all - (s->own2 / n - own * own);
    const double least = fmax(fabs(off) * (1.0 - fabs(off)), s->reaches ? SPREAD_LEAST : 0.0);
    const double second = fmax(wanted, least) + off * off;
    out[0] = (float)(0.5 * (second - off));
    out[1] = (float)(1.0 - second);
    out[2] = (float)(0.5 * (second + off));
}

void hg_path_splat_rest(const struct hg_path_settings *s, bool splats, uint32_t seed,
    struct hg_denoise_taps out[HG_PATH_RESTS])
{
    struct spread x = {0}, y = {0};
    for (uint32_t i = 0; i < HG_PATH_RESTS; i++) {
        struct hg_gpu_path pass = {.splat_x = {0.0f, 1.0f, 0.0f}, .splat_y = {0.0f, 1.0f, 0.0f}};
        if (splats)
            hg_path_splat_fill(s, i, seed, &pass);
        spread_add(&x, pass.splat_offset[0], pass.splat_x);
        spread_add(&y, pass.splat_offset[1], pass.splat_y);
        spread_weights(&x, i + 1, out[i].x);
        spread_weights(&y, i + 1, out[i].y);
    }
}
