// reflect.h - how surfaces mirror, for the reflections of pictures in motion. Floor 0, shared by C and GLSL.
//
// RG32UI, as large as probe light (gi.h) and of the same surfaces: shading normal (lib/octahedral.glsl);
// perceptual roughness in the low 8 bits, the greatest channel of the reflectance at normal incidence in the next 8,
// and the normal of the triangle, on the eye's side, in twice 8. Nothing, and what no light reaches, is as rough as can be.
#ifndef HG_SHADERS_SHARED_REFLECT_H
#define HG_SHADERS_SHARED_REFLECT_H

#define HG_MIRROR_MOST        255
#define HG_MIRROR_F0_SHIFT    8
#define HG_MIRROR_FACET_SHIFT 16

#endif
