// io.h - what passes read and write besides the images of the scene: descriptor set 1.
// Floor 0, shared by C and GLSL.
//
// A pass declares its images once, as a list in pass_io.h:
//
//     #define HG_VIGNETTE_IO(X) X(0, NEAREST_2D, picture) X(1, IMAGE_2D_RGBA16F, sharpness)
//
// with slot, kind and name. HG_VIGNETTE_IO(HG_IO_DECLARE) in GLSL declares hg_picture and
// hg_sharpness; HG_GPU_IO(HG_VIGNETTE_IO) in C is the layout, and HG_VIGNETTE_IO(HG_GPU_IO_MEMBER)
// the members of a struct that names the images to bind (renderer/gpu/io.h).
#ifndef HG_SHADERS_SHARED_IO_H
#define HG_SHADERS_SHARED_IO_H

#ifdef __STDC__
// X(kind, renderer's image kind, texel of a stand-in, linear filter)
#define HG_IO_SAMPLED_KINDS(X)                                                                     \
    X(NEAREST_2D, 2D, R32G32B32A32_SFLOAT, false)                                                  \
    X(NEAREST_U2D, 2D, R32G32_UINT, false)                                                         \
    X(NEAREST_2D_ARRAY, 2D_ARRAY, R16G16B16A16_SFLOAT, false)                                      \
    X(NEAREST_3D, 3D, R16G16B16A16_SFLOAT, false)                                                  \
    X(LINEAR_2D, 2D, R16G16B16A16_SFLOAT, true)                                                    \
    X(LINEAR_2D_ARRAY, 2D_ARRAY, R16G16B16A16_SFLOAT, true)                                        \
    X(LINEAR_3D, 3D, R16G16B16A16_SFLOAT, true)                                                    \
    X(LINEAR_CUBE, CUBE, R16G16B16A16_SFLOAT, true)
// X(kind, renderer's image kind, format); one mip of an image
#define HG_IO_STORAGE_KINDS(X)                                                                     \
    X(IMAGE_2D_RGBA8, 2D, R8G8B8A8_UNORM)                                                          \
    X(IMAGE_2D_RGBA16F, 2D, R16G16B16A16_SFLOAT)                                                   \
    X(IMAGE_2D_RGBA32F, 2D, R32G32B32A32_SFLOAT)                                                   \
    X(IMAGE_2D_R32F, 2D, R32_SFLOAT)                                                               \
    X(IMAGE_2D_R32UI, 2D, R32_UINT)                                                                \
    X(IMAGE_ARRAY_RGBA16F, 2D_ARRAY, R16G16B16A16_SFLOAT)                                          \
    X(IMAGE_ARRAY_R32F, 2D_ARRAY, R32_SFLOAT)                                                      \
    X(IMAGE_3D_RGBA16F, 3D, R16G16B16A16_SFLOAT)                                                   \
    X(IMAGE_3D_R32F, 3D, R32_SFLOAT)                                                               \
    X(IMAGE_3D_R32UI, 3D, R32_UINT)
#else
#define HG_IO_DECLARE(slot, kind, name) HG_IO_##kind(slot, hg_##name)
#define HG_IO_SAMPLED(slot, type, name) layout(set = 1, binding = slot) uniform type name;
#define HG_IO_STORAGE(slot, type, format, name)                                                    \
    layout(set = 1, binding = slot, format) uniform type name;
#define HG_IO_NEAREST_2D(slot, name)          HG_IO_SAMPLED(slot, sampler2D, name)
#define HG_IO_NEAREST_U2D(slot, name)         HG_IO_SAMPLED(slot, usampler2D, name)
#define HG_IO_NEAREST_2D_ARRAY(slot, name)    HG_IO_SAMPLED(slot, sampler2DArray, name)
#define HG_IO_NEAREST_3D(slot, name)          HG_IO_SAMPLED(slot, sampler3D, name)
#define HG_IO_LINEAR_2D(slot, name)           HG_IO_SAMPLED(slot, sampler2D, name)
#define HG_IO_LINEAR_2D_ARRAY(slot, name)     HG_IO_SAMPLED(slot, sampler2DArray, name)
#define HG_IO_LINEAR_3D(slot, name)           HG_IO_SAMPLED(slot, sampler3D, name)
#define HG_IO_LINEAR_CUBE(slot, name)         HG_IO_SAMPLED(slot, samplerCube, name)
#define HG_IO_IMAGE_2D_RGBA8(slot, name)      HG_IO_STORAGE(slot, image2D, rgba8, name)
#define HG_IO_IMAGE_2D_RGBA16F(slot, name)    HG_IO_STORAGE(slot, image2D, rgba16f, name)
#define HG_IO_IMAGE_2D_RGBA32F(slot, name)    HG_IO_STORAGE(slot, image2D, rgba32f, name)
#define HG_IO_IMAGE_2D_R32F(slot, name)       HG_IO_STORAGE(slot, image2D, r32f, name)
#define HG_IO_IMAGE_2D_R32UI(slot, name)      HG_IO_STORAGE(slot, uimage2D, r32ui, name)
#define HG_IO_IMAGE_ARRAY_RGBA16F(slot, name) HG_IO_STORAGE(slot, image2DArray, rgba16f, name)
#define HG_IO_IMAGE_ARRAY_R32F(slot, name)    HG_IO_STORAGE(slot, image2DArray, r32f, name)
#define HG_IO_IMAGE_3D_RGBA16F(slot, name)    HG_IO_STORAGE(slot, image3D, rgba16f, name)
#define HG_IO_IMAGE_3D_R32F(slot, name)       HG_IO_STORAGE(slot, image3D, r32f, name)
#define HG_IO_IMAGE_3D_R32UI(slot, name)      HG_IO_STORAGE(slot, uimage3D, r32ui, name)
#endif

#endif
