// dfg_facets.h - integrals over the facets of a GGX surface that a direction sees.
// Floor 2 (light), private to dfg*.c. Pure.
#ifndef HG_RENDERER_LIGHT_DFG_FACETS_H
#define HG_RENDERER_LIGHT_DFG_FACETS_H

#include <stdbool.h>
#include <stdint.h>

#define HG_FACETS_POINTS 128 // most of a ring
#define HG_FACETS_ETAS   32  // most indices at once

// Visible normals as rings of points on a spherical cap.
// Source: Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps".
struct hg_facets {
    float v[3], alpha[2];
    float stretched[3];
    float one_and_lambda_v;
    uint32_t rings, points;
    float span; // azimuths 0..span; half of the circle where both halves are alike
    float circle[HG_FACETS_POINTS][2];
};

// n rings of n points, n / 2 with half. v: unit, in the surface's frame, v[2] > 0; alpha: its
// widths along x and y.
void hg_facets_init(
    struct hg_facets *facets, const float v[3], const float alpha[2], uint32_t n, bool half);

// Unit vector at this cosine to the normal and this cosine of its azimuth, v[1] >= 0.
void hg_facets_direction(float cosine, float azimuth_cosine, float v[3]);

// Scale a and bias b with E(v) = f0 a + b for height-correlated Smith and Schlick. kept: what
// counts of light reflected to this cosine; NULL: all. Source: Karis 2013, "Real Shading in Unreal
// Engine 4", eq. 8; Heitz 2014, eq. 85 and 99.
void hg_facets_reflect(const struct hg_facets *facets,
    float (*kept)(const void *user, float cosine), const void *user, float ab[2]);

// Share of light that an interface of glass neither reflects nor lets through when every ray meets
// one facet only: 1 - E, by Fresnel's equations and Walter's refraction. eta: index of refraction
// behind over that in front, `count` of them, at most HG_FACETS_ETAS.
// Source: Walter et al. 2007, eq. 21 and 22; what is missing: Kulla and Conty 2017.
void hg_facets_glass_miss(
    const struct hg_facets *facets, uint32_t count, const float *eta, float *miss);

// Three cosines v.h and their weights that have the first six moments of the cosines at the facets
// that reflect light of all directions to v, or of what else v sees (lost): a function of the angle
// at the facet has the mean sum of out[i][1] f(out[i][0]). Gauss's quadrature.
// Source: Golub and Welsch 1969; Stieltjes's procedure in Gautschi 2004, section 2.2.3.1.
void hg_facets_angles(const struct hg_facets *facets, bool lost, float out[3][2]);

#endif
