// path_features.glsl - what is seen in smooth surfaces, for the denoiser's guide: paths are followed through
// mirrors, glass and coats to surfaces that scatter or emit.
//
// Define struct path and vec4 position_at(uint moment, hg_gpu_hit hit) first; include lib/path.glsl and
// lib/bsdf.glsl.
#ifndef HG_LIB_PATH_FEATURES_GLSL
#define HG_LIB_PATH_FEATURES_GLSL

#define HG_FEATURES_SMOOTH_ALPHA 0.0225 // a roughness of 0.15
#define HG_FEATURES_FAR          1e6    // metres that count as infinite

bool hg_features_smooth_base(hg_bsdf b)
{
    if (HG_HAS(HG_FEATURE_LOBES))
        return b.delta || max(b.alpha.x, b.alpha.y) <= HG_FEATURES_SMOOTH_ALPHA;
    return b.delta || b.base.alpha <= HG_FEATURES_SMOOTH_ALPHA;
}

bool hg_features_smooth_coat(hg_bsdf b)
{
    if (!HG_HAS(HG_FEATURE_CLEARCOAT) || b.coat <= 0.0 || b.inside)
        return false;
    return b.coat_delta || (hg_features_smooth_base(b) && b.coat_alpha <= HG_FEATURES_SMOOTH_ALPHA);
}

// Of the lobe that was sampled. Coat and base are one where neither is a mirror.
bool hg_features_is_smooth(hg_bsdf b, uint lobe)
{
    bool coated = HG_HAS(HG_FEATURE_CLEARCOAT) && b.coat > 0.0 && !b.inside;
    return (lobe & HG_LOBE_DELTA) != 0u || ((lobe & HG_LOBE_SPECULAR) != 0u && hg_features_smooth_base(b) &&
        (!coated || hg_features_smooth_coat(b)));
}

// What scattered light is multiplied by, about; what mirrored light is, and light that is let through.
vec3 hg_features_scattering(hg_bsdf b)
{
    return HG_HAS(HG_FEATURE_LOBES) ? b.base.diffuse + b.behind + b.sheen : b.base.diffuse;
}

vec3 hg_features_mirroring(hg_bsdf b)
{
    vec3 albedo = hg_specular_albedo(b.base.f0, b.base.f_ms, b.base.dfg_v);
    if (HG_HAS(HG_FEATURE_LOBES))
        albedo += b.transmission * b.tint * b.enter_v + b.coat * 0.04;
    return albedo;
}

// Light as an albedo.
vec3 hg_features_light_color(vec3 light)
{
    return light / max(hg_max3(light), 1.0);
}

// own: of the first surface.
void hg_features_note(uint slot, vec3 albedo, float depth, bool own)
{
    uint guide = hg_path_out(hg_path.planes[HG_PATH_PLANE_GUIDE]);
    float share = 1.0 / hg_path_branches();
    hg_path_add3(guide + HG_PATH_GUIDE_SEEN_ALBEDO, slot, share * hg_path_finite(albedo));
    hg_path_add(guide + HG_PATH_GUIDE_SEEN_DEPTH, slot, share * log(clamp(depth, 1e-6, HG_FEATURES_FAR)));
    hg_path_add(guide + HG_PATH_GUIDE_SEEN_OWN, slot, own ? share : 0.0);
    hg_path_add(guide + HG_PATH_GUIDE_SEEN, slot, share);
}

vec3 hg_features_tint(path p)
{
    return hg_path_get3(hg_path.split + HG_PATH_SPLIT_WORDS + HG_PATH_SEEN_TINT, p.slot);
}

// Metres to what a path meets after t metres, as far as they are seen along the view direction.
float hg_features_depth(path p, float t)
{
    uint word = hg_path.split + HG_PATH_SPLIT_WORDS;
    return hg_path_get(word + HG_PATH_SEEN_DEPTH, p.slot) +
        hg_path_get(word + HG_PATH_SEEN_COSINE, p.slot) * t;
}

// From the first surface on, which was met along a direction.
void hg_features_begin(inout path p, hg_bsdf b, float depth, uint lobe, vec3 direction)
{
    uint word = hg_path.split + HG_PATH_SPLIT_WORDS;
    if (hg_features_is_smooth(b, lobe)) {
        p.flags |= HG_PATH_FOLLOWED;
        hg_path_set3(word + HG_PATH_SEEN_TINT, p.slot, vec3(1.0));
        hg_path_set(word + HG_PATH_SEEN_DEPTH, p.slot, depth);
        hg_path_set(word + HG_PATH_SEEN_COSINE, p.slot, dot(direction, hg_path_forward()));
    } else if ((lobe & HG_LOBE_SPECULAR) != 0u || !(hg_features_smooth_base(b) || hg_features_smooth_coat(b)))
        hg_features_note(p.slot, vec3(1.0), depth, true);
}

// To where the image of what is seen was: what is met after one plane mirror, which may have moved as
// well, or through glass.
void hg_features_note_moved(path p, hg_gpu_hit hit)
{
    uint moved = hg_path_out(hg_path.planes[HG_PATH_PLANE_MOVED]);
    vec3 by = (position_at(HG_PATH_SHOWN, hit) - position_at(HG_PATH_NOW, hit)).xyz;
    if (p.bounce == 1u) { // the normal is 0 behind glass
        vec3 mirror = hg_path_get3(moved + HG_PATH_MOVED_BY, p.slot);
        by += 2.0 * dot(mirror - by, p.normal) * p.normal;
    }
    hg_path_add3(moved + HG_PATH_MOVED_SEEN, p.slot, by / hg_path_branches());
}

// A surface that is seen in smooth ones: further, if nearly all of its light is mirrored or let through
// by a smooth lobe, and the path goes on there.
void hg_features_follow(inout path p, hg_bsdf b, hg_gpu_hit hit, vec3 medium, vec3 emitted, bool goes_on)
{
    uint word = hg_path.split + HG_PATH_SPLIT_WORDS;
    vec3 scattered = hg_features_scattering(b), mirrored = hg_features_mirroring(b), tint = hg_features_tint(p) * medium;
    if (goes_on && 3.0 * hg_max3(scattered) <= hg_max3(mirrored) && hg_max3(emitted) <= 0.0) {
        hg_path_set3(word + HG_PATH_SEEN_TINT, p.slot, tint * mirrored);
        hg_path_set(word + HG_PATH_SEEN_DEPTH, p.slot, hg_features_depth(p, hit.t));
        return;
    }
    p.flags &= ~HG_PATH_FOLLOWED;
    vec3 albedo = tint * (scattered + mirrored + hg_features_light_color(emitted));
    hg_features_note(p.slot, albedo, hg_features_depth(p, hit.t), false);
    if (HG_PATH_CAN(HG_PATH_MOTION) && HG_PATH_HAS(HG_PATH_PLANE_MOVED))
        hg_features_note_moved(p, hit);
}

#endif
