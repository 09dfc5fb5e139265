// dfg.h - tables of directional albedo of the specular BRDF and of other lobes.
// Floor 2 (light). Pure; same result on every run. The tables are made once, while building
// (make.c), and are part of the program (words.h).
#ifndef HG_RENDERER_LIGHT_ALBEDO_DFG_H
#define HG_RENDERER_LIGHT_ALBEDO_DFG_H

#include "shaders/shared/light.h"

// Scale a and bias b with E(v) = f0 a + b for GGX, height-correlated Smith and Schlick, by
// numerical integration over the visible normals with n x n points.
// n_dot_v in (0, 1], alpha in [0, 1].
// Source: Karis 2013, "Real Shading in Unreal Engine 4", eq. 8; Heitz 2018 (visible normals).
void hg_dfg_integrate(float n_dot_v, float alpha, uint32_t n, float ab[2]);

// Directional albedo of the sheen of lib/lobes.glsl, likewise over n x n directions.
// Source: Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF".
float hg_sheen_integrate(float n_dot_v, float roughness, uint32_t n);

// The albedo that hg_bsdf_evaluate_sheen has, where f is divided by the largest of the albedos of
// both directions and 1, likewise; of it what is kept of light to each cosine, all with NULL.
// table: of hg_dfg_fill, with x from HG_SHEEN_FIRST on.
float hg_sheen_kept(const struct hg_vec2 *table, float n_dot_v, float roughness, uint32_t n,
    float (*kept)(const void *user, float cosine), const void *user);

// The tables of lib/brdf.glsl and lib/lobes.glsl, 16 bits a number. s_i = i / (size - 1);
// cosines are s^2, roughness is s and perceptual, the first coordinate changes fastest. Up to
// HG_DFG_BLOCK_WORDS they are in a uniform block (HG_BIND_DFG_TABLE).
//   hg_dfg              cosine, roughness; behind it one row of cosine-weighted means
//   HG_SHEEN_FIRST      x: the sheen's albedo / HG_SHEEN_MOST, likewise; y: its albedo where f is
//                       divided by the largest of x at both directions and 1
//   HG_ANGLES_FIRST     hg_vndf_rule of mirrored light: HG_ANGLE_NODES words (root of the cosine,
//                       weight) for each cosine, roughness
//   HG_COAT_FIRST       what a and b lose below a coat to light that it lets through less than that
//                       of v: weighted with max(0, E(l) - E(v)), E the coat's albedo; cosine,
//                       roughness, the coat's roughness
//   HG_CLOTH_FIRST      likewise below sheen
//   HG_COATED_FIRST     x: what sheen loses below a coat, likewise: cosine, its roughness, the
//                       coat's roughness
// Of glass, layer k is that of index (ior - 1) / (ior + 1) = HG_GLASS_FAR s^2. From inside cosines
// are those of hg_glass_cosine (table.h), at whose s = HG_GLASS_EDGE total reflection begins.
//   HG_GLASS_FIRST      hg_vndf_glass: x the share lost, y the share reflected; cosine,
//                       roughness, layer, first from outside and then from inside
//   HG_GLASS_MEANS      their cosine-weighted means: roughness, layer, side
//   HG_FILM_FIRST       hg_vndf_rule: cosine, roughness, layer, side, two words of each node:
//                       the root of its cosine (0 where total reflection ends, 1 along the
//                       normal) and the weight m of mirrored light as 0.5 + m / 2; then m less
//                       that of refracted light likewise
//   HG_FILM_MEANS       hg_vndf_rule_of_nodes, the mean over all light of one side: roughness,
//                       layer, side, two words of each of HG_MEAN_NODES nodes: as above, and y
//                       of the second one the weight in the mean of a smooth surface
//   HG_HELD_FIRST       share that a coat (x) and a sheen (y) hold back of light that glass lets
//                       through: cosine, roughness, layer, roughness of coat or sheen, side
//                       (light comes out of what is denser, or of what is not so dense)
//   HG_HELD_MEANS       of light of all directions: roughness, layer, roughness of coat or sheen,
//                       side
// Of anisotropic surfaces:
//   HG_ANISO_FIRST      what is to be added to the isotropic a and b that hg_aniso_cosine
//                       chooses, as 0.5 + x / (2 HG_ANISO_RANGE): cosine, the azimuth's cosine
//                       (s^2), strength (linear), roughness
//   HG_ANISO_MEANS      likewise of the means: strength, roughness
//   HG_OVER_ANISO_FIRST what is to be added to HG_COAT_FIRST at the cosine and
//                       hg_aniso_roughness, likewise: cosine, the azimuth's cosine (s^2),
//                       strength, roughness, the coat's roughness; then to HG_CLOTH_FIRST
//   HG_OVER_ANISO_MEANS what is to be added to the mean of all that a coat (x) or sheen (y)
//                       holds back of a + b: strength, roughness, roughness of coat or sheen
//   HG_BRUSHED_FIRST    what is to be added to the loss of isotropic glass of hg_aniso_roughness
//                       from outside (x) and from inside (y), as in HG_ANISO_FIRST: cosine, lean
//                       (hg_brushed_lean), strength, roughness, layer of
//                       s = (k + 1) / HG_BRUSHED_IORS
//   HG_BRUSHED_MEANS    the mean loss over that of the isotropic surface, / HG_BRUSHED_MOST:
//                       strength, roughness, layer
// Words between the tables are 0.
void hg_dfg_fill(struct hg_vec2 out[HG_DFG_WORDS]);

#endif
