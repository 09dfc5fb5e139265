// features.h - what a scene makes use of, as a specialisation constant of the passes that shade.
// Floor 0, shared by C and GLSL. Software rasterisers run both sides of every branch, so that code
// for what is nowhere in the scene has to be left out when the pipeline is made. All bits set is
// always right.
#ifndef HG_SHADERS_SHARED_FEATURES_H
#define HG_SHADERS_SHARED_FEATURES_H

#define HG_FEATURE_TEXTURES    0x001u // base colour, normal or metallic-roughness textures
#define HG_FEATURE_EMISSIVE    0x002u // emissive textures
#define HG_FEATURE_OCCLUSION   0x004u // occlusion textures that are not packed with roughness
#define HG_FEATURE_FLOAT       0x008u // textures in the float pool
#define HG_FEATURE_SAMPLERS    0x010u // anything but repeat, linear, first uv set, no transform
#define HG_FEATURE_VERTICES    0x020u // vertex colours, second uv sets, lines or points
#define HG_FEATURE_NO_TANGENTS 0x040u // normal maps on parts without tangents
#define HG_FEATURE_LIGHTS      0x080u // punctual lights
#define HG_FEATURE_CLUSTERS    0x100u // lights in clusters
#define HG_FEATURE_LOCAL       0x200u // point or spot lights
#define HG_FEATURE_SHADOWS     0x400u // shadow maps
#define HG_FEATURE_NO_FACETS   0x800u // surface points come from vertices, not from facets (facet.h)
#define HG_FEATURE_ALL         0xffffffffu

#endif
