// vndf_quadrature.h - quadrature over the visible normals (VNDF) of a GGX surface.
// Floor 2 (light), private to this folder. Pure.
#ifndef HG_RENDERER_LIGHT_ALBEDO_VNDF_QUADRATURE_H
#define HG_RENDERER_LIGHT_ALBEDO_VNDF_QUADRATURE_H

#include <stdbool.h>
#include <stdint.h>

#include "shaders/shared/light.h"

#define HG_VNDF_MOST 2592 // 72 rings of 36 points
#define HG_VNDF_RING 128

// Visible normals as rings of points on a spherical cap, element by element.
// Source: Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps".
struct hg_vndf_quadrature {
    float v[3], alpha[2];
    float one_and_lambda_v;
    uint32_t count;
    float h[3][HG_VNDF_MOST], v_dot_h[HG_VNDF_MOST];
    float weight[HG_VNDF_MOST];     // share of all
    float mirrored[HG_VNDF_MOST];   // that share, of it what arrives mirrored, G2 / G1(v)
    float mirror_cos[HG_VNDF_MOST]; // cosine at which it does, below 0: into the surface
};

// n rings of n points, n / 2 with half, where both halves are alike; at most HG_VNDF_MOST. v:
// unit, in the surface's frame, v[2] > 0; alpha: its widths along x and y.
void hg_vndf_init(struct hg_vndf_quadrature *facets, const float v[3], const float alpha[2],
    uint32_t n, bool half);

// Unit vector at this cosine to the normal and this cosine of its azimuth, v[1] >= 0.
void hg_vndf_direction(float cosine, float azimuth_cosine, float v[3]);

// Scale a and bias b with E(v) = f0 a + b for height-correlated Smith and Schlick. kept: what
// counts of light reflected to this cosine; NULL: all. Source: Karis 2013, "Real Shading in Unreal
// Engine 4", eq. 8; Heitz 2014, eq. 85 and 99.
void hg_vndf_reflect(const struct hg_vndf_quadrature *facets,
    float (*kept)(const void *user, float cosine), const void *user, float ab[2]);

// Single-scattering albedo of a rough dielectric interface, by Fresnel's equations and Walter's
// refraction. eta: index of refraction behind over that in front, `count` of them.
// out[count]: x the share of light that is neither reflected nor transmitted, 1 - E;
// y the share that is reflected.
// Source: Walter et al. 2007, eq. 21 and 22; what is missing: Kulla and Conty 2017.
void hg_vndf_glass(
    const struct hg_vndf_quadrature *facets, uint32_t count, const float *eta, struct hg_vec2 *out);

// Light transmitted by such an interface: `each` gets shares of the incident light and the cosine
// to the normal of their exit directions.
void hg_vndf_let_through(const struct hg_vndf_quadrature *facets, float eta,
    void (*each)(void *user, float share, float cosine), void *user);

// One facet that stands for others: v.h, and weights of its mirrored and of its refracted light;
// smooth: of what the whole surface would mirror if it were smooth.
struct hg_vndf_node {
    float cosine, mirrored, refracted, smooth;
};

// Facets for integrals of a function f of the angle at the facet over those whose mirrored light
// arrives, or those whose refracted light would if they let all of it through, but for those where
// eta means total reflection: sum of weight f(cosine). eta 0: of mirrored light alone.
// Gauss's nodes of both kinds together, so that what differs between the two comes of how they
// differ, not of where f is read. Polynomials in the cosine, or where there is total reflection
// below a cosine c in sqrt(cosine - c), as Fresnel's equations bend there: of degree 7 for both
// together, of degree 3 for each. Source: Golub and Welsch 1969; Stieltjes's procedure in Gautschi
// 2004, section 2.2.3.1.
// out: [nodes], 2 to HG_MEAN_NODES; above is of 4, n nodes have degrees 2n - 1 and n - 1.
void hg_vndf_rule(
    const struct hg_vndf_quadrature *facets, float eta, uint32_t nodes, struct hg_vndf_node *out);

// Likewise for sums over `count` nodes, at most HG_VNDF_MOST, none with total reflection.
void hg_vndf_rule_of_nodes(const struct hg_vndf_node *many, uint32_t count, float eta,
    uint32_t nodes, struct hg_vndf_node *out);

#endif
