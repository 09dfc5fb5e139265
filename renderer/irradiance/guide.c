// guide.c - see guide.h.
#include "renderer/irradiance/guide.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "base/simd.h"
#include "renderer/math/vec.h"

#define SLOTS   8u      // that a key may be in
#define UNUSED  64u     // pictures after which a guide may make room
#define MOST    1024.0f // rays; older ones fade
#define OLD     32.0f   // that those of another light count as
#define PRIOR   1.0f    // rays of the mean luminance that a bin has before its own
#define HORIZON 0.15f   // sine below the horizon of the middle of a bin that reaches above it

static const float bin_area = 4.0f / HG_GUIDE_BINS; // of the map, which is 2 wide

// --- life ----------------------------------------------------------------------------------------

uint64_t hg_irradiance_guides_bytes(void)
{
    return HG_GUIDES * sizeof(struct hg_irradiance_guide);
}

static float bin_edge(uint32_t index)
{
    return (float)index * (2.0f / HG_GUIDE_SIDE) - 1;
}

// Solid angle over area of the map is the cube of the sum of a unit vector's magnitudes.
static float stretch(const float way[3])
{
    const float sum = fabsf(way[0]) + fabsf(way[1]) + fabsf(way[2]);
    return sum * sum * sum;
}

enum hg_status hg_irradiance_guides_init(struct hg_irradiance_guides *guides)
{
    const float half = 1.0f / HG_GUIDE_SIDE;
    *guides = (struct hg_irradiance_guides){0};
    for (uint32_t i = 0; i < HG_GUIDE_BINS; i++) {
        float middle[3];
        hg_octahedral3(
            bin_edge(i % HG_GUIDE_SIDE) + half, bin_edge(i / HG_GUIDE_SIDE) + half, middle);
        for (int a = 0; a < 3; a++)
            guides->middle[a][i] = middle[a];
        guides->solid[i] = stretch(middle);
    }
    guides->guides = hg_calloc(HG_GUIDES, sizeof *guides->guides);
    return guides->guides ? HG_OK : HG_E_NOMEM;
}

void hg_irradiance_guides_finish(struct hg_irradiance_guides *guides)
{
    hg_free(guides->guides);
    *guides = (struct hg_irradiance_guides){0};
}

void hg_irradiance_guides_clear(struct hg_irradiance_guides *guides)
{
    memset(guides->guides, 0, HG_GUIDES * sizeof *guides->guides);
}

// --- learning ------------------------------------------------------------------------------------

static void fade(struct hg_irradiance_guide *g, float most)
{
    if (g->all <= most)
        return;
    const float scale = most / g->all;
    for (int i = 0; i < HG_GUIDE_BINS; i++) {
        g->luminance[i] *= scale;
        g->rays[i] *= scale;
    }
    g->all = most;
}

// That of the key, else an empty one, else that which was not asked for longest.
static struct hg_irradiance_guide *find(
    const struct hg_irradiance_guides *guides, uint64_t key, uint32_t picture)
{
    const uint64_t slot = (hg_hash_mix(1, key) >> 32) % (HG_GUIDES / SLOTS) * SLOTS;
    struct hg_irradiance_guide *first = &guides->guides[slot], *best = first;
    for (struct hg_irradiance_guide *g = first; g < first + SLOTS; g++) {
        if (g->key == key)
            return g;
        const bool older = picture - g->used > picture - best->used;
        if (best->key != 0 && (g->key == 0 || older))
            best = g;
    }
    return best;
}

struct hg_irradiance_guide *hg_irradiance_guide_ask(
    struct hg_irradiance_guides *guides, uint64_t key, uint32_t picture, uint32_t light)
{
    struct hg_irradiance_guide *g = guides->last;
    if (g && g->key == key && g->used == picture && g->light == light)
        return g; // texels beside each other mostly have one
    g = find(guides, key, picture);
    if (g->key != key && g->key != 0 && picture - g->used <= UNUSED)
        return NULL;
    if (g->key != key)
        *g = (struct hg_irradiance_guide){.key = key, .light = light};
    else if (g->used != picture || g->light != light)
        fade(g, g->light != light ? OLD : MOST);
    g->used = picture;
    g->light = light;
    guides->last = g;
    return g;
}

// Of an octahedral coordinate, -1 .. 1; what is no number is in the first.
static uint32_t row_of(float coordinate)
{
    const float row = (coordinate + 1) * (0.5f * HG_GUIDE_SIDE), last = HG_GUIDE_SIDE - 1;
    return row > 0 ? (uint32_t)(row < last ? row : last) : 0;
}

// The bin that a unit vector is in.
static uint32_t bin_of(const float way[3])
{
    const float scale = 1 / (fabsf(way[0]) + fabsf(way[1]) + fabsf(way[2]));
    float u = way[0] * scale, v = way[1] * scale;
    if (way[2] < 0) {
        const float folded = copysignf(1 - fabsf(v), u);
        v = copysignf(1 - fabsf(u), v);
        u = folded;
    }
    return row_of(v) * HG_GUIDE_SIDE + row_of(u);
}

void hg_irradiance_guide_add(struct hg_irradiance_guide *g, const float way[3], float luminance)
{
    const uint32_t bin = bin_of(way);
    if (!(luminance >= 0 && luminance < FLT_MAX))
        return;
    g->luminance[bin] += luminance;
    g->rays[bin] += 1;
    g->all += 1;
}

// --- following -----------------------------------------------------------------------------------

// Of directions, not of rays, of which bright ones have more.
static float mean_luminance(const struct hg_irradiance_guide *g)
{
    float sum = 0, known = 0;
    for (int i = 0; i < HG_GUIDE_BINS; i++) {
        const float rays = g->rays[i];
        sum += rays > 0 ? g->luminance[i] / rays : 0;
        known += rays > 0 ? 1.0f : 0.0f;
    }
    return sum / fmaxf(known, 1);
}

HG_SIMD_LOOP
static void weigh(const struct hg_irradiance_guides *guides, const struct hg_irradiance_guide *g,
    const float normal[3], float mean, float weights[HG_GUIDE_BINS])
{
    const float x = normal[0], y = normal[1], z = normal[2];
    for (int i = 0; i < HG_GUIDE_BINS; i++) {
        const float cosine =
            x * guides->middle[0][i] + y * guides->middle[1][i] + z * guides->middle[2][i];
        const float light = (g->luminance[i] + PRIOR * mean) / (g->rays[i] + PRIOR);
        const float above = cosine + HORIZON;
        weights[i] = (above > 0 ? above : 0) * light * guides->solid[i];
    }
}

bool hg_irradiance_guide_distribution(const struct hg_irradiance_guides *guides,
    const struct hg_irradiance_guide *g, const float normal[3],
    struct hg_irradiance_distribution *out)
{
    float weights[HG_GUIDE_BINS], sum = 0;
    if (g->all < HG_GUIDE_FEW)
        return false;
    weigh(guides, g, normal, mean_luminance(g), weights);
    for (int i = 0; i < HG_GUIDE_BINS; i++) {
        out->sums[i] = sum;
        sum += weights[i];
    }
    if (!(sum > 0 && sum < FLT_MAX))
        return false;
    for (int i = 0; i < HG_GUIDE_BINS; i++)
        out->sums[i] /= sum;
    out->sums[HG_GUIDE_BINS] = 1;
    return true;
}

void hg_irradiance_distribution_take(
    const struct hg_irradiance_distribution *d, const float xi[2], float way[3])
{
    uint32_t low = 0, high = HG_GUIDE_BINS - 1; // the last bin that begins at or below xi
    while (low < high) {
        const uint32_t middle = (low + high + 1) / 2;
        if (d->sums[middle] <= xi[0])
            low = middle;
        else
            high = middle - 1;
    }
    const float share = d->sums[low + 1] - d->sums[low], side = 2.0f / HG_GUIDE_SIDE;
    const float across = share > 0 ? hg_clampf((xi[0] - d->sums[low]) / share, 0, 1) : 0.5f;
    hg_octahedral3(bin_edge(low % HG_GUIDE_SIDE) + across * side,
        bin_edge(low / HG_GUIDE_SIDE) + xi[1] * side, way);
}

float hg_irradiance_distribution_density(
    const struct hg_irradiance_distribution *d, const float way[3])
{
    const uint32_t bin = bin_of(way);
    return (d->sums[bin + 1] - d->sums[bin]) / (bin_area * stretch(way));
}
