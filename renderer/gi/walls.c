// walls.c - see walls.h.
#include "renderer/gi/walls.h"

#include <math.h>

#include "renderer/math/vec.h"

#define GRAZING 0.15f // cosine of rays to a plane from which on they tell of it
#define DEPTH   0.05f // spacings behind the plane that are it as well
#define REACH   1.8f  // spacings: no point whose lookup reads a probe is farther from it

static uint32_t code_of(float share)
{
    return (uint32_t)rintf(hg_clampf(share, 0, 1) * HG_PROBE_WALL_STEPS);
}

static float share_of(uint32_t code)
{
    return (float)code / HG_PROBE_WALL_STEPS;
}

void hg_gi_wall_find(const struct hg_gi_ray *nearest, const struct hg_gi_ray *rays, uint32_t count,
    float spacing, struct hg_gi_wall *out)
{
    *out = (struct hg_gi_wall){.code = HG_GI_NO_WALL};
    if (nearest == NULL)
        return;
    const float *n = nearest->normal;
    const float far = -nearest->distance * hg_dot3(nearest->direction, n);
    for (uint32_t i = 0; i < count; i++) {
        const float towards = -hg_dot3(rays[i].direction, n);
        if (rays[i].distance < REACH * spacing && towards > GRAZING &&
            rays[i].distance * towards > far + DEPTH * spacing)
            return;
    }
    float e[2];
    hg_octahedral2(n, e);
    const uint32_t x = code_of(e[0] * 0.5f + 0.5f), y = code_of(e[1] * 0.5f + 0.5f);
    const uint32_t z = code_of(far / spacing);
    if (z >= HG_PROBE_WALL_STEPS)
        return;
    out->code = x | y << HG_PROBE_BITS | z << (2 * HG_PROBE_BITS);
    hg_octahedral3(share_of(x) * 2 - 1, share_of(y) * 2 - 1, out->normal);
    out->distance = share_of(z);
}

bool hg_gi_wall_hides(const struct hg_gi_wall *wall, const float from[3], float spacing)
{
    return wall->code != HG_GI_NO_WALL &&
           hg_dot3(wall->normal, from) < -(wall->distance + HG_PROBE_WALL_SLACK) * spacing;
}
