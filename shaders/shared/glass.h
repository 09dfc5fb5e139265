// glass.h - what rays brought to clear glass in pictures in motion (renderer/reflect/glass.h).
// Floor 0, shared by C and GLSL.
//
// RGBA32UI, at the size of the picture or a fraction of it. Radiance that arrives from behind the
// glass, along the bent ray, as far as it is not the environment's: RGB9E5; the direction in which
// that ray leaves the scene, octahedral (lib/octahedral.glsl) in 16 and 15 bits, and HG_GLASS_THERE;
// what the glass lets through of the environment there: RGB9E5, 0: the ray met something; radiance
// that arrives from the mirror direction: RGB9E5, or HG_GLASS_SKY: the ray left the scene.
#ifndef HG_SHADERS_SHARED_GLASS_H
#define HG_SHADERS_SHARED_GLASS_H

#define HG_GLASS_THERE 1u          // of the second word; all are 0 where there is no clear glass
#define HG_GLASS_SKY   0xffffffffu // of the last word: no RGB9E5 of less than 65408 is that

#endif
