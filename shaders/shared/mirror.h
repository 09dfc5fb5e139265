// mirror.h - planes in which a picture in motion mirrors the scene. Floor 0, shared by C and GLSL.
//
// The mirrored scene is in a picture of its own (RGBA32F, premultiplied): what its texel at a place of the view sees
// by way of the plane; alpha 0 where nothing looked.
#ifndef HG_SHADERS_SHARED_MIRROR_H
#define HG_SHADERS_SHARED_MIRROR_H

#include "shared/types.h"

#define HG_MIRROR_PLANES       2
#define HG_MIRROR_SMOOTH       0.08f // perceptual roughness up to which a plane mirrors sharply,
#define HG_MIRROR_ROUGH        0.14f // and from which on it is no mirror
#define HG_MIRROR_APART        2e-3f // of the depth, that points of a plane may lie off it
#define HG_MIRROR_LEAST_COSINE 0.9998f // between their normals and that of the plane

#endif
