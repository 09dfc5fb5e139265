// features.h - what a scene makes use of, as a specialisation constant of the passes that shade.
// Floor 0, shared by C and GLSL. Software rasterisers run both sides of every branch, so that code
// for what is nowhere in the scene has to be left out when the pipeline is made. All bits set is
// always right.
#ifndef HG_SHADERS_SHARED_FEATURES_H
#define HG_SHADERS_SHARED_FEATURES_H

#define HG_FEATURE_TEXTURES    0x0001u // base colour, normal or metallic-roughness textures
#define HG_FEATURE_EMISSIVE    0x0002u // emissive textures
#define HG_FEATURE_OCCLUSION   0x0004u // occlusion textures that are not packed with roughness
#define HG_FEATURE_FLOAT       0x0008u // textures in the float pool
#define HG_FEATURE_SAMPLERS    0x0010u // anything but repeat, linear, first uv set, no transform
#define HG_FEATURE_VERTICES    0x0020u // vertex colours, second uv sets, lines or points
#define HG_FEATURE_NO_TANGENTS 0x0040u // normal maps on parts without tangents
#define HG_FEATURE_LIGHTS      0x0080u // punctual lights
#define HG_FEATURE_CLUSTERS    0x0100u // lights in clusters
#define HG_FEATURE_LOCAL       0x0200u // point or spot lights
#define HG_FEATURE_SHADOWS     0x0400u // shadow maps
#define HG_FEATURE_NO_TRIANGLE_CACHE   0x0800u // surface points come from vertices, not from facets (facet.h)
#define HG_FEATURE_STREAM      0x1000u // pages that may not be resident
#define HG_FEATURE_WIDE        0x2000u // textures wider or higher than 65536 texels
#define HG_FEATURE_SHAPES      0x4000u // materials with textures of more than one size
#define HG_FEATURE_LOD         0x8000u // parts with levels of detail
#define HG_FEATURE_NO_SUN      0x10000u // anything but one light, which is directional
#define HG_FEATURE_REST        0x20000u // a view that rests: finer cascades, HG_TEXTURES_EXACT
#define HG_FEATURE_EMITS       0x40000u // emissive materials
#define HG_FEATURE_UNCOMMON    0x80000u // unlit, occlusion, scaled normals, an index other than 1.5
#define HG_FEATURE_SKY_PAGES 0x100000u // of backgrounds alone: the environment has pages
#define HG_FEATURE_SKY_PLAIN 0x200000u // or an image of its own, or none
#define HG_FEATURE_SKY_MIPS  0x400000u // which may be smaller than its texels
// Materials with lobes besides metallic-roughness (hg_gpu_lobes):
#define HG_FEATURE_CLEARCOAT            0x00800000u
#define HG_FEATURE_SHEEN                0x01000000u
#define HG_FEATURE_IRIDESCENCE          0x02000000u
#define HG_FEATURE_ANISOTROPY           0x04000000u
#define HG_FEATURE_SPECULAR             0x08000000u
#define HG_FEATURE_TRANSMISSION         0x10000000u // volume and dispersion too
#define HG_FEATURE_DIFFUSE_TRANSMISSION 0x20000000u
#define HG_FEATURE_LOBE_TEXTURES        0x40000000u // textures of any of these
#define HG_FEATURE_LOBES                0x7f800000u // all of these
#define HG_FEATURE_SMALL_LAYERS         0x80000000u // layers of RGBA8 pages may be small (texture.h)
#define HG_FEATURE_ALL         0xffffffffu

// The second word, another constant: HG_FEATURE2_* from bit 4 on, and lobes of one material that have tables of their own together.
#define HG_FEATURE2_GROUND         0x10u // of backgrounds alone: a ground that catches shadows
#define HG_FEATURE2_PROBES         0x20u // diffuse light comes from a field of probes
#define HG_FEATURE2_GATHERED       0x40u // of opaque surfaces: light from other surfaces was gathered per pixel
#define HG_FEATURE2_LAMPS_GATHERED 0x8000u // with GATHERED: and how much of lamps' light arrives
#define HG_FEATURE2_PROBE_LIGHT    0x80u // of opaque surfaces: the probes' light is in an image
#define HG_FEATURE2_SIZED          0x100u // lights with a size
#define HG_FEATURE2_CHECKERBOARD   0x1000u // HG_FRAME_CHECKERBOARD may be set
#define HG_FEATURE2_LIGHT_TABLES   0x100000u // lights with a profile or an image
#define HG_FEATURE2_MIRRORS        0x200u // of opaque surfaces: planes mirror the scene
#define HG_FEATURE2_SHADOW_PAGES   0x2000u // the sun has pages (a picture in motion)
#define HG_FEATURE2_GLASS          0x400u // of layers: light by way of transmissive ones was gathered
#define HG_FEATURE2_GLASS_RAYS     0x10000u // of layers: rays of the host saw what clear glass shows
#define HG_FEATURE2_ALL           0xffffffffu
#define HG_MIX_ANISOTROPIC_GLASS  0x1u
#define HG_MIX_LAYERED_GLASS      0x2u // below coats or sheens
#define HG_MIX_UNUSUAL_GLASS      0x4u // reflects otherwise than Fresnel's equations say
#define HG_MIX_OF_GLASS           0x7u // only with HG_FEATURE_TRANSMISSION
#define HG_MIX_LAYERED_ANISOTROPY 0x8u
#define HG_MIX_ALL                0xfu

#endif
