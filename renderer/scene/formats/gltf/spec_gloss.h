// spec_gloss.h - specular-glossiness to metallic-roughness.
// Floor 2, private to scene/. Pure.
//
// Source: the equations that accompany KHR_materials_pbrSpecularGlossiness (Khronos glTF
// repository, extensions/2.0/Archived, conversion example). A metallic-roughness surface with
// metalness m, base colour c and dielectric reflectance F0 = 0.04 has
//     diffuse  = c (1 - F0) (1 - m) / (1 - max specular)      (1)
//     specular = F0 (1 - m) + c m                             (2)
// Putting c of (1) into (2), for perceived brightness d and s, gives
//     F0 m^2 + (d k / (1 - F0) + s - 2 F0) m + (F0 - s) = 0,  k = 1 - max specular
// whose root in 0..1 is m (0 when s < F0). c then follows from (1) and from (2); the two are
// blended by m^2 since each is ill-conditioned at one end.
#ifndef HG_RENDERER_SCENE_FORMATS_GLTF_SPEC_GLOSS_H
#define HG_RENDERER_SCENE_FORMATS_GLTF_SPEC_GLOSS_H

// diffuse, specular: linear 0..1. Writes the linear base colour; returns the metalness.
float hg_spec_gloss_convert(const float diffuse[3], const float specular[3], float base_color[3]);

#endif
