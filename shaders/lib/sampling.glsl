// sampling.glsl - point sets, warps and direction mappings.
#ifndef HG_LIB_SAMPLING_GLSL
#define HG_LIB_SAMPLING_GLSL

#define HG_PI     3.14159265358979
#define HG_INV_PI 0.318309886183791

// Point i of n of the Hammersley set, in [0,1)^2.
// Source: Niederreiter 1992; Dammertz 2012, "Hammersley Points on the Hemisphere".
vec2 hg_hammersley(uint i, uint n)
{
    return vec2((float(i) + 0.5) / float(n), float(bitfieldReverse(i)) * 2.3283064365386963e-10);
}

// Cosine-distributed direction about +z; pdf = z / pi.
// Source: Malley's method, Pharr, Jakob and Humphreys, PBRT 3rd ed., 13.6.2.
vec3 hg_sample_cosine(vec2 u)
{
    float r = sqrt(u.x), phi = 2.0 * HG_PI * u.y;
    return vec3(r * cos(phi), r * sin(phi), sqrt(max(0.0, 1.0 - u.x)));
}

// Microfacet normal visible from `v` (tangent space, v.z > 0), GGX of width alpha.
// Its density is G1(v) D(h) max(0, v.h) / v.z.
// Source: Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps", listing 3.
vec3 hg_sample_ggx_vndf(vec3 v, float alpha, vec2 u)
{
    vec3 stretched = normalize(vec3(v.xy * alpha, v.z));
    float phi = 2.0 * HG_PI * u.x;
    float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    float r = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    vec3 h = vec3(r * cos(phi), r * sin(phi), z) + stretched;
    return normalize(vec3(h.xy * alpha, max(h.z, 1e-9)));
}

// Orthonormal tangents of a unit vector.
// Source: Duff et al. 2017, "Building an Orthonormal Basis, Revisited", listing 3.
void hg_basis(vec3 n, out vec3 t, out vec3 b)
{
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float c = n.x * n.y * a;
    t = vec3(1.0 + s * n.x * n.x * a, s * c, -s * n.x);
    b = vec3(c, s + n.y * n.y * a, -n.y);
}

// Unit vector to the octahedral square [-1,1]^2 (y is the axis of the pyramid).
// Source: Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit Vectors".
vec2 hg_octahedral_encode(vec3 d)
{
    vec2 p = d.xz / (abs(d.x) + abs(d.y) + abs(d.z));
    vec2 folded = (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
    return d.y >= 0.0 ? p : folded;
}

#endif
