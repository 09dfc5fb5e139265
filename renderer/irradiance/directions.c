// directions.c - see directions.h.
#include "renderer/irradiance/directions.h"

#include "base/hash.h"
#include "renderer/math/sequence.h"

#define LOBES  (1 / 3.0f) // share of a rough surface's rays that go by its lobe,
#define GUIDED 0.5f       // and of all others that go where light came from

void hg_irradiance_surface_at(const struct hg_host_texels *texels, const uint32_t at[2],
    const uint32_t light[4], const uint32_t mirror[2], struct hg_irradiance_surface *out)
{
    struct hg_host_texel_mirror m;
    float depth, position[3];
    memcpy(&depth, &light[3], sizeof depth);
    hg_host_texel_mirror(mirror, &m);
    hg_host_texel_place(texels, at, depth, position, out->view);
    hg_host_texel_normal(light[2], out->normal);
    hg_host_texel_mirror_normal(&m, out->view, out->mirror);
    hg_copy3(m.facet, out->facet);
    out->roughness = m.roughness;
    out->f0 = m.f0;
    out->rough = hg_irradiance_is_rough(mirror);
}

// Halton points, turned (Cranley and Patterson 1976).
static void point_of(const struct hg_irradiance_turn *turn, float xi[3])
{
    static const uint32_t bases[3] = {2, 3, 5};
    const uint64_t bits = hg_hash_mix(0x6972u, turn->key);
    for (int a = 0; a < 3; a++) {
        xi[a] = hg_radical_inverse(turn->number + 1, bases[a]) +
                (float)(bits >> (20 * a) & 0xfffff) * (1.0f / 0x100000);
        xi[a] -= floorf(xi[a]);
    }
}

static void over_cosine(const float normal[3], const float xi[3], float out[3])
{
    float t[3], b[3];
    const float radius = sqrtf(xi[0]), angle = 2 * (float)HG_PI * xi[1];
    const float x = radius * cosf(angle), y = radius * sinf(angle), z = sqrtf(fmaxf(1 - xi[0], 0));
    hg_basis3(normal, t, b);
    for (int a = 0; a < 3; a++)
        out[a] = x * t[a] + y * b[a] + z * normal[a];
}

void hg_irradiance_choose(const struct hg_irradiance_turn *turn,
    const struct hg_irradiance_surface *s, const struct hg_irradiance_distribution *guided,
    struct hg_irradiance_direction *out)
{
    const float lobe = s->rough ? LOBES : 0, guide = guided ? GUIDED * (1 - lobe) : 0;
    float density = 0, value = 0;
    point_of(turn, out->xi);
    if (out->xi[2] < lobe) {
        const struct hg_lobe_sample l =
            hg_lobe_take(s->roughness, s->f0, s->mirror, s->view, out->xi);
        hg_copy3(l.direction, out->way);
    } else if (out->xi[2] < lobe + guide) {
        hg_irradiance_distribution_take(guided, out->xi, out->way);
    } else {
        over_cosine(s->normal, out->xi, out->way);
    }
    if (s->rough)
        value = hg_lobe_value(s->roughness, s->f0, s->mirror, s->view, out->way, &density);
    const float cosine = fmaxf(hg_dot3(out->way, s->normal), 0) * (1 / (float)HG_PI);
    float all = lobe * density + (1 - lobe - guide) * cosine;
    if (guided)
        all += guide * hg_irradiance_distribution_density(guided, out->way);
    const float scale = 1 / fmaxf(all, 1e-12f);
    out->diffuse = cosine * scale;
    out->mirrored = value * scale;
}
