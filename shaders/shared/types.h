// types.h - the vocabulary of structs shared by C and GLSL.
// Floor 0. Structs use these types only and are laid out alike in C and in GLSL's scalar layout
// (GL_EXT_scalar_block_layout): 4-byte alignment, except HG_PTR which is 8. Put pointers first.
#ifndef HG_SHADERS_SHARED_TYPES_H
#define HG_SHADERS_SHARED_TYPES_H

#ifdef __STDC__ // C
#include <assert.h>
#include <stddef.h>
#include <stdint.h>
struct hg_vec2 {
    float x, y;
};
struct hg_vec3 {
    float x, y, z;
};
struct hg_vec4 {
    float x, y, z, w;
};
struct hg_mat4 {
    float m[16]; // column-major
};
struct hg_mat4x3 {
    float m[12]; // column-major, 4 columns of 3: an affine transform
};
#define HG_VEC2       struct hg_vec2
#define HG_VEC3       struct hg_vec3
#define HG_VEC4       struct hg_vec4
#define HG_MAT4       struct hg_mat4
#define HG_MAT4X3     struct hg_mat4x3
#define HG_PTR(block) uint64_t // device address of a buffer_reference block
#define HG_UINT       uint32_t
#define HG_INT        int32_t
#define HG_FLOAT      float
#define HG_STRUCT(s)  struct s
#define HG_SHARED_SIZE(s, bytes) static_assert(sizeof(struct s) == (bytes), #s)
#else // GLSL
#define HG_VEC2       vec2
#define HG_VEC3       vec3
#define HG_VEC4       vec4
#define HG_MAT4       mat4
#define HG_MAT4X3     mat4x3
#define HG_PTR(block) block
#define HG_UINT       uint
#define HG_INT        int
#define HG_FLOAT      float
#define HG_STRUCT(s)  s
#define HG_SHARED_SIZE(s, bytes)
#endif

#endif
