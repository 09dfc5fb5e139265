// reflect.h - how surfaces mirror, for the reflections of pictures in motion. Floor 0, shared by C and GLSL.
//
// RG32UI, as large as probe light (gi.h) and of the same surfaces: shading normal (lib/octahedral.glsl);
// perceptual roughness in the low 16 bits, and the greatest channel of the reflectance at normal incidence in the
// high ones. Nothing, and what no light reaches, is as rough as can be.
#ifndef HG_SHADERS_SHARED_REFLECT_H
#define HG_SHADERS_SHARED_REFLECT_H

#define HG_MIRROR_ROUGHNESS_BITS 16
#define HG_MIRROR_MOST           65535

#endif
