// sobol.glsl - random numbers of paths: Owen-scrambled Sobol points whose error is blue noise.
//
// One sequence serves all pixels of a square of 256: point numbers are those of its pixels along the
// Morton curve, then of the samples of each pixel, and are shuffled from the top bit down, so that
// every power-of-two block of pixels holds a well distributed set and the error of neighbours is
// different. Pairs of dimensions are independent of each other (padded), each with a shuffle and a
// scramble of its own. Sources: Ahmed and Wonka 2020, "Screen-Space Blue-Noise Diffusion of Monte
// Carlo Sampling Error via Hierarchical Ordering of Pixels"; Burley 2020, "Practical Hash-based Owen
// Scrambling"; the hash: Laine and Karras 2011 with the constants of Vegdahl 2021.
#ifndef HG_LIB_SOBOL_GLSL
#define HG_LIB_SOBOL_GLSL

struct hg_sampler {
    uint index;     // of the point
    uint seed;      // of the view and the square of pixels
    uint dimension; // next pair
};

uint hg_morton(uvec2 p) // 16 bits of each
{
    p = (p | (p << 8u)) & 0x00ff00ffu;
    p = (p | (p << 4u)) & 0x0f0f0f0fu;
    p = (p | (p << 2u)) & 0x33333333u;
    p = (p | (p << 1u)) & 0x55555555u;
    return p.x | (p.y << 1u);
}

uint hg_hash_mix_bits(uint x)
{
    x ^= x >> 16u;
    x *= 0x21f0aaadu;
    x ^= x >> 15u;
    x *= 0x735a2d97u;
    return x ^ (x >> 15u);
}

// Each bit is flipped depending on the bits below it.
uint hg_scramble_up(uint x, uint seed)
{
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

// sample_bits: all pixels of the view have up to 2^sample_bits samples, at most 16.
hg_sampler hg_sampler_make(uvec2 pixel, uint number, uint sample_bits, uint seed)
{
    hg_sampler s;
    s.index = (hg_morton(pixel & 255u) << sample_bits) | number;
    s.seed = hg_hash_mix_bits(seed ^ hg_hash_mix_bits((pixel.x >> 8u) | ((pixel.y >> 8u) << 16u)));
    s.dimension = 0u;
    return s;
}

// The next two dimensions, in [0, 1).
vec2 hg_sobol2(inout hg_sampler s)
{
    uint h = hg_hash_mix_bits(s.seed + s.dimension * 0x9e3779b9u);
    s.dimension++;
    uint i = bitfieldReverse(hg_scramble_up(bitfieldReverse(s.index), h));
    // The second dimension's generator matrix is Pascal's triangle modulo 2.
    uint p = i ^ ((i >> 1u) & 0x55555555u);
    p ^= (p >> 2u) & 0x33333333u;
    p ^= (p >> 4u) & 0x0f0f0f0fu;
    p ^= (p >> 8u) & 0x00ff00ffu;
    p ^= p >> 16u;
    uint x = bitfieldReverse(hg_scramble_up(i, hg_hash_mix_bits(h ^ 0x68bc21ebu)));
    uint y = bitfieldReverse(hg_scramble_up(p, hg_hash_mix_bits(h ^ 0x02e5be93u)));
    return vec2(x >> 8u, y >> 8u) * (1.0 / 16777216.0);
}

vec4 hg_sobol4(inout hg_sampler s)
{
    vec2 a = hg_sobol2(s);
    vec2 b = hg_sobol2(s);
    return vec4(a, b);
}

#endif
