// bsdf_probe.h - materials through lib/bsdf.glsl on the device (shaders/bsdf.comp): samples,
// values, sums over samples. Test support.
#ifndef HG_TESTS_ANALYTIC_BSDF_PROBE_H
#define HG_TESTS_ANALYTIC_BSDF_PROBE_H

#include "tests/analytic/probe.h"

enum bsdf_op { // of bsdf.comp
    BSDF_SAMPLE,
    BSDF_EVALUATE,
    BSDF_TERMS,
    BSDF_DISPERSION
};

struct bsdf_material { // as bsdf.comp reads it
    float base[3], metallic;
    float roughness, ior, specular, transmission;
    float specular_color[3], thickness;
    float clearcoat, clearcoat_roughness, anisotropy, diffuse_transmission;
    float sheen[3], sheen_roughness;
    float iridescence, film_ior, film_nm, dispersion;
    float behind[3], ior_outside;
    float coat_tilt, tangent_angle, unused[2];
};

// White, of roughness 0.5 and index 1.5.
extern const struct bsdf_material bsdf_white;
bool bsdf_goes_through(const struct bsdf_material *m);

// A direction at this cosine (below 0: from behind) and azimuth; w: whether it sees the front.
struct hg_vec4 bsdf_direction(float cosine, float phi, bool front);

// pairs: [count][2] inputs; out: [count][2].
void bsdf_run(struct probe *probe, enum bsdf_op op, const struct bsdf_material *m, uint32_t count,
    const struct hg_vec4 *pairs, struct hg_vec4 *out);
// Albedo by samples of the lobes, for each of the directions: rgb; w: share of samples that end.
// `samples` of each of ten shifts, at most BSDF_SAMPLES. noise: one standard deviation of each.
enum { BSDF_SAMPLES = 3280 };
void bsdf_albedo(struct probe *probe, const struct bsdf_material *m, uint32_t samples,
    uint32_t count, const struct hg_vec4 *directions, struct hg_vec4 (*albedo_noise)[2]);

#endif
