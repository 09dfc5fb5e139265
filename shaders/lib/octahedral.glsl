// octahedral.glsl - unit vectors in 32 bits, as renderer/lod/vertex_pack.h writes them.
// Source: Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit Vectors".
#ifndef HG_LIB_OCTAHEDRAL_GLSL
#define HG_LIB_OCTAHEDRAL_GLSL

// Unit vector of octahedral coordinates in -1..1.
vec3 hg_oct_decode(vec2 e)
{
    vec3 v = vec3(e, 1.0 - abs(e.x) - abs(e.y));
    float fold = max(-v.z, 0.0);
    v.xy += mix(vec2(fold), vec2(-fold), greaterThanEqual(v.xy, vec2(0.0)));
    return normalize(v);
}

vec2 hg_oct_encode(vec3 v)
{
    v *= 1.0 / max(abs(v.x) + abs(v.y) + abs(v.z), 1e-30);
    vec2 folded = (1.0 - abs(v.yx)) * mix(vec2(-1.0), vec2(1.0), greaterThanEqual(v.xy, vec2(0.0)));
    return v.z >= 0.0 ? v.xy : folded;
}

vec3 hg_decode_normal(uint word)
{
    return hg_oct_decode(unpackSnorm2x16(word));
}

uint hg_encode_normal(vec3 normal)
{
    return packSnorm2x16(hg_oct_encode(normal));
}

// xyz and the sign of the bitangent.
vec4 hg_decode_tangent(uint word)
{
    vec2 e = vec2(float(bitfieldExtract(int(word), 0, 16)) / 32767.0,
        float(bitfieldExtract(int(word), 16, 15)) / 16383.0);
    return vec4(hg_oct_decode(max(e, -1.0)), (word >> 31) != 0u ? -1.0 : 1.0);
}

uint hg_encode_tangent(vec4 tangent)
{
    vec2 e = hg_oct_encode(tangent.xyz);
    ivec2 q = ivec2(round(e * vec2(32767.0, 16383.0)));
    return (uint(q.x) & 0xffffu) | ((uint(q.y) & 0x7fffu) << 16) |
        (tangent.w < 0.0 ? 0x80000000u : 0u);
}

#endif
