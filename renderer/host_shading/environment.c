#include "renderer/host_shading/environment.h"

#include "base/alloc.h"
#include "renderer/math/sums.h"
#include "renderer/math/vec.h"

#define FACES      6
#define PEAK_LIMIT 4.0f // of the mean luminance, from which on light is part of a peak

// --- texels --------------------------------------------------------------------------------------

// Face and place after the Vulkan specification, "Cube Map Face Selection".
static uint32_t cube_texel(const float d[3], uint32_t side)
{
    const float x = fabsf(d[0]), y = fabsf(d[1]), z = fabsf(d[2]);
    const int axis = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
    const float major = fmaxf(fabsf(d[axis]), 1e-20f);
    const bool minus = d[axis] < 0;
    const float s = axis == 0 ? (minus ? d[2] : -d[2]) : axis == 1 ? d[0] : minus ? -d[0] : d[0];
    const float t = axis == 1 ? (minus ? -d[2] : d[2]) : -d[1];
    const float u = (s / major * 0.5f + 0.5f) * (float)side;
    const float v = (t / major * 0.5f + 0.5f) * (float)side;
    const uint32_t column = (uint32_t)hg_clampf(u, 0, (float)side - 1);
    const uint32_t row = (uint32_t)hg_clampf(v, 0, (float)side - 1);
    return (((uint32_t)axis * 2 + minus) * side + row) * side + column;
}

// The inverse; x and y in [0, 1) are a place in the texel. Of no particular length.
static void cube_direction(uint32_t texel, uint32_t side, const float at[2], float out[3])
{
    const uint32_t face = texel / (side * side), axis = face / 2;
    const bool minus = face % 2 != 0;
    const float s = 2 * ((float)(texel % side) + at[0]) / (float)side - 1;
    const float t = 2 * ((float)(texel / side % side) + at[1]) / (float)side - 1;
    out[axis] = minus ? -1 : 1;
    if (axis == 0) {
        out[2] = minus ? s : -s;
        out[1] = -t;
    } else if (axis == 1) {
        out[0] = s;
        out[2] = minus ? -t : t;
    } else {
        out[0] = minus ? -s : s;
        out[1] = -t;
    }
}

static float solid_angle(uint32_t texel, uint32_t side)
{
    static const float middle[2] = {0.5f, 0.5f};
    float d[3];
    cube_direction(texel, side, middle, d);
    const float r2 = hg_dot3(d, d);
    return 4 / ((float)side * (float)side * r2 * sqrtf(r2));
}

// The share of a texel's light that is even.
static float even_share(const struct hg_host_environment *e, const float texel[3])
{
    const float l = hg_luminance(texel);
    return l > e->limit ? e->limit / l : 1;
}

// --- peaks ---------------------------------------------------------------------------------------

static float mean_luminance(const struct hg_lighting_sources *from, uint32_t count)
{
    double sum = 0, whole = 0;
    for (uint32_t i = 0; i < count; i++) {
        const float w = solid_angle(i, from->env_side);
        sum += (double)(w * hg_luminance(from->env_faces + (size_t)i * 3));
        whole += (double)w;
    }
    return (float)(sum / whole);
}

enum hg_status hg_host_environment_sync(
    struct hg_host_environment *e, const struct hg_lighting_sources *from, uint64_t revision)
{
    const bool image = from->env_kind == HG_ENV_KIND_IMAGE && from->env_faces;
    const uint32_t count = image ? FACES * from->env_side * from->env_side : 0;
    if (e->is_known && e->revision == revision && e->count == count)
        return HG_OK;
    hg_free(e->sums);
    *e = (struct hg_host_environment){.revision = revision, .count = count, .is_known = true};
    e->limit = image ? PEAK_LIMIT * mean_luminance(from, count) : 0;
    if (!(e->limit > 0))
        return HG_OK;
    e->sums = hg_calloc(count, sizeof *e->sums);
    if (!e->sums) {
        e->is_known = false;
        return HG_E_NOMEM;
    }
    double sum = 0;
    for (uint32_t i = 0; i < count; i++) {
        const float *texel = from->env_faces + (size_t)i * 3;
        sum += (double)(hg_luminance(texel) * (1 - even_share(e, texel)) *
                        solid_angle(i, from->env_side));
        e->sums[i] = (float)sum;
    }
    e->has_peaks = e->sums[count - 1] > 0;
    return HG_OK;
}

void hg_host_environment_finish(struct hg_host_environment *e)
{
    hg_free(e->sums);
    *e = (struct hg_host_environment){0};
}

void hg_host_environment_peak(const struct hg_host_environment *e,
    const struct hg_lighting_sources *from, const float xi[3], float direction[3], float light[3])
{
    const uint32_t i = hg_sums_find(e->sums, e->count, xi[0] * e->sums[e->count - 1]);
    const float *texel = from->env_faces + (size_t)i * 3;
    const float mine = e->sums[i] - (i > 0 ? e->sums[i - 1] : 0);
    const float chance = mine / e->sums[e->count - 1];
    const float c = from->env_rotation_cos, s = from->env_rotation_sin;
    const float all = (1 - even_share(e, texel)) * solid_angle(i, from->env_side);
    float d[3];
    cube_direction(i, from->env_side, xi + 1, d);
    hg_normalize3(d);
    direction[0] = c * d[0] + s * d[2]; // the inverse of the rotation of lookups
    direction[1] = d[1];
    direction[2] = c * d[2] - s * d[0];
    for (int k = 0; k < 3; k++)
        light[k] = chance > 0 ? from->env_color[k] * texel[k] * all / chance : 0;
}

// --- lookup --------------------------------------------------------------------------------------

static void to_environment(
    const struct hg_lighting_sources *from, const float direction[3], float out[3])
{
    const float c = from->env_rotation_cos, s = from->env_rotation_sin;
    out[0] = c * direction[0] - s * direction[2];
    out[1] = direction[1];
    out[2] = s * direction[0] + c * direction[2];
}

void hg_host_environment_even(const struct hg_host_environment *e,
    const struct hg_lighting_sources *from, const float direction[3], float out[3])
{
    float d[3];
    to_environment(from, direction, d);
    const bool image = from->env_kind == HG_ENV_KIND_IMAGE && from->env_faces;
    const float *texel = image ? from->env_faces + (size_t)cube_texel(d, from->env_side) * 3 : NULL;
    const float share = image && e->has_peaks ? even_share(e, texel) : 1;
    for (int k = 0; k < 3; k++)
        out[k] = from->env_kind == HG_ENV_KIND_NONE
                     ? 0
                     : from->env_color[k] * (image ? texel[k] * share : 1);
}

void hg_host_environment_irradiance(
    const struct hg_lighting_sources *from, const float normal[3], float out[3])
{
    const bool image = from->env_kind == HG_ENV_KIND_IMAGE && from->env_irradiance;
    const uint32_t pitch = HG_IRRADIANCE_SIZE + 2;
    float d[3], at[2];
    to_environment(from, normal, d);
    hg_octahedral2((const float[3]){d[0], d[2], d[1]}, at); // up is in the middle
    const float x = (at[0] * 0.5f + 0.5f) * HG_IRRADIANCE_SIZE + 0.5f;
    const float y = (at[1] * 0.5f + 0.5f) * HG_IRRADIANCE_SIZE + 0.5f;
    const uint32_t column = (uint32_t)hg_clampf(x, 0, HG_IRRADIANCE_SIZE);
    const uint32_t row = (uint32_t)hg_clampf(y, 0, HG_IRRADIANCE_SIZE);
    const float fx = x - (float)column, fy = y - (float)row;
    for (int k = 0; k < 3; k++)
        out[k] = from->env_kind == HG_ENV_KIND_NONE ? 0 : from->env_color[k];
    if (!image)
        return;
    const float *texel = &from->env_irradiance[row * pitch + column].x;
    for (int k = 0; k < 3; k++) {
        const float low = texel[k] + fx * (texel[k + 4] - texel[k]);
        const float *above = texel + pitch * 4;
        out[k] *= low + fy * (above[k] + fx * (above[k + 4] - above[k]) - low);
    }
}
