// bindings.h - the one descriptor set of the renderer: images, and the uniform block of the frame
// (a uniform load is one broadcast on CPU devices, a load by address is a gather per lane); every
// other buffer is reached by its device address. Floor 0, shared by C and GLSL. Set 0; unused image
// bindings hold a 1x1 dummy.
#ifndef HG_SHADERS_SHARED_BINDINGS_H
#define HG_SHADERS_SHARED_BINDINGS_H

#define HG_BIND_PAGES_SRGB   0  // sampler2DArray, RGBA8_SRGB page pool (texture/)
#define HG_BIND_PAGES_LINEAR 1  // sampler2DArray, RGBA8_UNORM page pool (texture/)
#define HG_BIND_PAGES_FLOAT  2  // sampler2DArray, RGBA16F page pool (texture/)
#define HG_BIND_ENV_SPECULAR 3  // samplerCube, prefiltered radiance (light/)
#define HG_BIND_ENV_RADIANCE 4  // sampler2D, equirectangular radiance for the background (light/)
#define HG_BIND_DFG          5  // sampler2D, split-sum and energy tables (light/)
#define HG_BIND_SHADOW       6  // sampler2D, depth atlas of all shadow maps (light/)
#define HG_BIND_SHADOW_CMP   7  // sampler2DShadow, the same atlas with depth comparison
#define HG_BIND_VISIBILITY   8  // usampler2D, visibility buffer (passes/)
#define HG_BIND_DEPTH        9  // sampler2D, depth of the visibility buffer (passes/)
#define HG_BIND_COLOR_A      10 // sampler2D, pass input (passes/)
#define HG_BIND_COLOR_B      11 // sampler2D, pass input (passes/)
#define HG_BIND_IMAGE_COUNT  12
#define HG_BIND_FRAME        12 // uniform block: struct hg_gpu_frame (frame.h)

// Tables that small scenes have in uniform blocks as well as by address (lib/tables.glsl). A device
// without caches for gathers by address (CPU devices) reads them several times faster this way.
#define HG_BIND_DRAWS      13 // struct hg_gpu_draw[]
#define HG_BIND_INSTANCES  14 // struct hg_gpu_instance[]
#define HG_BIND_PARTS      15 // struct hg_gpu_part[]
#define HG_BIND_MATERIALS  16 // struct hg_gpu_material[]
#define HG_BIND_PAGE_TABLE 17 // uint[]
#define HG_BIND_LIGHTS     18 // struct hg_gpu_light[]
#define HG_BIND_SHADOWS    19 // struct hg_gpu_shadow[]
#define HG_BIND_DFG_TABLE  20 // uint[], the first of it
#define HG_BIND_IRRADIANCE 21 // vec4[]
#define HG_BIND_TRIANGLE_CACHE     22 // uint[] of draws: their first facet
#define HG_BIND_TEXELS     23 // usamplerBuffer, facets (facet.h)
#define HG_BIND_COUNT      24

#define HG_BIND_UNIFORM_FIRST 12
#define HG_BIND_UNIFORM_COUNT 11
#define HG_TABLE_BYTES        65536 // largest table of a uniform block
#define HG_TABLE_BIT(binding) (1u << ((binding)-HG_BIND_UNIFORM_FIRST))

#endif
