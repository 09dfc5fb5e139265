// bsdf_surface.glsl - a surface point as lib/bsdf.glsl knows it, and what comes of sampling it.
//
// Include lib/frame.glsl and lib/material.glsl first.
#ifndef HG_LIB_BSDF_SURFACE_GLSL
#define HG_LIB_BSDF_SURFACE_GLSL

#include "lib/brdf.glsl"
#include "lib/lobes.glsl"
#include "lib/material.glsl"

// Bits of hg_bsdf_sample_result.lobe.
#define HG_LOBE_DIFFUSE      1u
#define HG_LOBE_SPECULAR     2u
#define HG_LOBE_TRANSMISSION 4u // the path goes on behind the surface
#define HG_LOBE_DELTA        8u // one direction only: hg_bsdf_evaluate knows nothing of it

// Perceptual roughness below which a lobe is a mirror: narrower than what any picture resolves.
#define HG_DELTA_ROUGHNESS 0.03

struct hg_bsdf {
    hg_brdf base;
    bool delta;          // the base's specular lobe is a mirror
    float p_specular;    // probabilities of hg_bsdf_sample; specular includes transmission
    // All that follows is for HG_FEATURE_LOBES.
    float p_coat, p_sheen, p_behind; // the rest is p_diffuse
    float p_diffuse;
    vec3 t, s;           // tangent frame with base.n
    vec3 v_ts;
    vec2 alpha;          // along t and s
    float mean_roughness; // of the tables of albedo
    float anisotropy;
    vec3 ms_below;       // colour of the dielectric's several bounces
    vec3 ms_dielectric;  // and what of it is taken from what is below, by channel only under films
    vec3 glass_avg, glass_avg_behind; // m_avg and m'_avg of glass
    vec3 glass_v, glass_front; // m(v), a
    vec3 glass_reflected, glass_reflected_behind; // mean of what facets reflect of light of each side
    bool layered;        // there is a coat or sheen over it
    bool layered_glass;  // layers hold back light of glass: hg_bsdf_make_held
    vec3 held_v, held_avg;
    float held_several;  // of what leaves after several bounces
    bool glass_plain;    // its facets reflect what the table's do
    bool exact;          // albedos of the dielectric are needed with Fresnel's equations
    vec3 f0_dielectric;
    float f90, f90_dielectric;
    float metallic;
    float eta;           // index of refraction behind the surface over that in front of it
    bool thin;           // transmission does not lead into another medium
    bool inside;         // the ray came from inside of a volume
    float transmission;  // share of all, metals taken off
    vec3 tint;           // of transmission, f0 of metal: the base colour
    vec3 behind;         // colour of what is diffusely transmitted, times its share
    vec3 attenuation;    // of the medium behind the surface, 1 / m (hg_bsdf_attenuation)
    float iridescence, film_ior, film_nm;
    vec3 coat_n;
    float coat, coat_roughness, coat_alpha, coat_n_dot_v;
    bool coat_delta;
    vec3 sheen;
    float sheen_max, sheen_roughness;
    vec2 sheen_albedo_v; // hg_sheen_albedo
    float coat_v, through_v; // T(v): of the coat, of all layers
    float left_v;            // hg_bsdf_layers.left at v
    vec2 below_v;            // a and b of the base below the layers, at v
    float several_v, several_avg; // U(v), U_avg
    vec3 enter_v, enter_avg, enter_avg_behind; // S(v), S_avg
};

struct hg_bsdf_sample_result {
    vec3 direction;
    vec3 weight; // f |cos| / pdf
    float pdf;   // per solid angle; delta: probability of the lobe; 0: the path ends
    uint lobe;   // HG_LOBE_*
};

#endif
