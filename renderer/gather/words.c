// words.c - what filtered light is for shading (shaders/shared/gi.h); see film.h.
#include <math.h>
#include <string.h>

#include "renderer/gather/film.h"
#include "renderer/lod/vertex_pack.h"
#include "renderer/math/rgb9e5.h"
#include "renderer/math/vec.h"
#include "shaders/shared/gi.h"

#define GIVEN_BACK 8.0f // times what is left of a speck, at most, to the pixels around it
#define SHARP      0.1f // roughness below which neighbours see other things

// What is left of a pixel that no neighbour was like (edges within it): its luminance is at most
// the third largest of those around it. Returns the share that stays.
static float despeckle(const struct hg_gather *w, int kind, size_t at)
{
    float *const *light = w->from[kind];
    const size_t width = w->in.width, x = at % width, y = at / width;
    float most[3] = {0}; // the largest first
    if (x == 0 || y == 0 || x + 1 == width || y + 1 == w->in.height)
        return 1;
    if (kind == MIRRORED && w->guides[ROUGHNESS][at] < SHARP) // thin things are seen in mirrors
        return 1;
    for (size_t v = y - 1; v <= y + 1; v++)
        for (size_t u = x - 1; u <= x + 1; u++) {
            const size_t q = v * width + u;
            const float c[3] = {light[RED][q], light[GREEN][q], light[BLUE][q]};
            float l = q == at ? 0 : hg_luminance(c);
            for (int i = 0; i < 3; i++)
                if (l > most[i]) {
                    const float less = most[i];
                    most[i] = l;
                    l = less;
                }
        }
    const float own[3] = {light[RED][at], light[GREEN][at], light[BLUE][at]};
    const float l = hg_luminance(own);
    return l > most[2] ? most[2] / l : 1;
}

void hg_gather_despeckle_row(void *user, size_t y)
{
    struct hg_gather *w = user;
    for (size_t at = y * w->in.width; at < (y + 1) * (size_t)w->in.width; at++)
        for (int kind = SCATTERED; kind <= MIRRORED; kind++)
            w->to[kind][RED][at] = despeckle(w, kind, at);
}

// Light of a pixel without its speck and with its part of those beside it, which are light that
// arrives: an eighth of each, of as much of it as is not beyond all measure.
static void despeckled(const struct hg_gather *w, int kind, size_t at, float out[3])
{
    float *const *light = w->from[kind];
    const float *stays = w->to[kind][RED], *depth = w->guides[DEPTH];
    const size_t width = w->in.width, x = at % width, y = at / width;
    for (int c = RED; c <= BLUE; c++)
        out[c] = light[c][at] * stays[at];
    if (x == 0 || y == 0 || x + 1 == width || y + 1 == w->in.height)
        return;
    for (size_t v = y - 1; v <= y + 1; v++)
        for (size_t q = v * width + x - 1; q <= v * width + x + 1; q++) {
            const float given = fminf(1 - stays[q], GIVEN_BACK * stays[q]) * 0.125f;
            if (q == at || !(given > 0) || fabsf(depth[q] - depth[at]) > ALIKE_DEPTH * depth[at])
                continue;
            for (int c = RED; c <= BLUE; c++)
                out[c] += given * light[c][q];
        }
}

// The environment's part of what scatters is what an open surface would have, times the share of it
// that came: both are estimated from the same directions, so that their ratio has little noise,
// none where all came (Heitz, Hill and McGuire 2018, "Combining Analytic Direct Illumination and
// Stochastic Shadows"). What is left of the light is the rest.
void hg_gather_part_row(void *user, size_t y)
{
    struct hg_gather *w = user;
    float *const *s = w->from[SCATTERED];
    for (size_t at = y * w->in.width; at < (y + 1) * (size_t)w->in.width; at++) {
        const float open[3] = {s[OPEN_RED][at], s[OPEN_GREEN][at], s[OPEN_BLUE][at]};
        const float all = hg_luminance(open), share = all > 0 ? fminf(s[SKY][at] / all, 1) : 0;
        for (int c = 0; c < 3; c++)
            s[RED + c][at] = fmaxf(s[RED + c][at] - share * open[c], 0);
        s[SKY][at] = share;
    }
}

void hg_gather_pack_lamp_row(void *user, size_t y)
{
    struct hg_gather *w = user;
    for (size_t at = y * w->in.width; at < (y + 1) * (size_t)w->in.width; at++) {
        const float share = w->lamp_asked > 0 ? w->from[LAMPLIT][RED][at] : LAMP_UNKNOWN;
        uint32_t *word = &w->out[4 * (hg_gather_pixels(w) + at) + w->lamp / 4];
        *word |= (uint32_t)(sqrtf(share) * 255 + 0.5f) << (8 * (w->lamp % 4));
    }
}

static uint32_t pack_sides(const float normal[3], float sunlit)
{
    const uint32_t fine = hg_pack_normal(normal);
    uint32_t word = (uint32_t)(sqrtf(sunlit) * 255 + 0.5f) << 16;
    for (int i = 0; i < 2; i++) {
        const float along = (float)(int16_t)(fine >> (16 * i)) * (127.0f / 32767);
        word |= (uint32_t)((int)rintf(along) & 0xff) << (8 * i);
    }
    return word;
}

void hg_gather_pack_row(void *user, size_t y)
{
    struct hg_gather *w = user;
    for (size_t at = y * w->in.width; at < (y + 1) * (size_t)w->in.width; at++) {
        uint32_t *out = w->out + 4 * at;
        const float depth = w->guides[DEPTH][at];
        uint32_t bits;
        float *const *s = w->from[SCATTERED];
        float n[3] = {w->guides[NORMAL_X][at], w->guides[NORMAL_Y][at], w->guides[NORMAL_Z][at]};
        hg_normalize3(n);
        float scattered[3], mirrored[3];
        despeckled(w, SCATTERED, at, scattered);
        despeckled(w, MIRRORED, at, mirrored);
        // Of metals nothing scatters but what facets send on to each other: about what they mirror.
        const float scatters = s[WORTH][at];
        float irradiance[3], radiance[3];
        for (int c = RED; c <= BLUE; c++) {
            radiance[c] = mirrored[c];
            irradiance[c] = scatters * scattered[c] + (1 - scatters) * radiance[c];
        }
        out[0] = hg_rgb9e5_pack(irradiance[0], irradiance[1], irradiance[2]);
        out[1] = hg_rgb9e5_pack(radiance[0], radiance[1], radiance[2]);
        out[2] = pack_sides(n, w->from[SUNLIT][RED][at]);
        memcpy(&bits, &depth, sizeof bits);
        out[3] = (bits & ~HG_GATHERED_SHARE_MASK) |
                 (uint32_t)(sqrtf(s[SKY][at] * scatters) * HG_GATHERED_SHARE_MASK + 0.5f);
    }
}
