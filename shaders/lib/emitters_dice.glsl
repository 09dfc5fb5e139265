// emitters_dice.glsl - one random number for many choices. Part of lib/emitters.glsl.
#ifndef HG_LIB_EMITTERS_DICE_GLSL
#define HG_LIB_EMITTERS_DICE_GLSL

// A random number in [0, 1) that choices are made with, one after the other, and how far apart its
// values are: after each choice they spread over [0, 1) again. Noise fills the gaps before they are
// wide enough to matter, so that even rare choices come about as often as they should.
struct hg_emitter_dice {
    float u, gap;
    uint seed;
};

hg_emitter_dice hg_emitter_dice_of(float u, vec3 salt)
{
    uvec3 h = hg_hash3(floatBitsToUint(salt));
    return hg_emitter_dice(min(u, 0.99999994), 1.0 / 16777216.0, h.x);
}

// True with chance p, 0 < p < 1.
bool hg_emitter_throw(inout hg_emitter_dice d, float p)
{
    if (d.gap > 1.0 / 65536.0) {
        d.seed = d.seed * 747796405u + 2891336453u;
        uint h = ((d.seed >> ((d.seed >> 28u) + 4u)) ^ d.seed) * 277803737u; // PCG, RXS-M-XS
        d.u = min(d.u + d.gap * (float((h ^ (h >> 22u)) >> 8u) * (1.0 / 16777216.0)), 0.99999994);
        d.gap = 1.0 / 16777216.0;
    }
    bool yes = d.u < p;
    float share = max(yes ? p : 1.0 - p, 1e-12);
    d.u = clamp((yes ? d.u : d.u - p) / share, 0.0, 0.99999994);
    d.gap /= share;
    return yes;
}

#endif
