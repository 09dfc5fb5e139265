// bindings.h - descriptor set 0: the images of the scene, the uniform block of the frame (a uniform
// load is one broadcast on CPU devices, a load by address is a gather per lane) and small tables;
// every other buffer is reached by its device address. What a pass reads and writes besides is set
// 1 (io.h). Floor 0, shared by C and GLSL. Unused image bindings hold a 1x1 dummy.
#ifndef HG_SHADERS_SHARED_BINDINGS_H
#define HG_SHADERS_SHARED_BINDINGS_H

#define HG_BIND_PAGES_SRGB   0 // sampler2DArray, RGBA8_SRGB page pool (texture/)
#define HG_BIND_PAGES_LINEAR 1 // sampler2DArray, RGBA8_UNORM page pool (texture/)
#define HG_BIND_PAGES_FLOAT  2 // sampler2DArray, RGBA16F page pool (texture/)
#define HG_BIND_ENV_SPECULAR 3 // samplerCube, prefiltered radiance (light/)
#define HG_BIND_ENV_RADIANCE 4 // sampler2D, equirectangular radiance for the background (light/)
#define HG_BIND_DFG          5 // sampler2D, split-sum and energy tables (light/)
#define HG_BIND_SHADOW       6 // sampler2D, depth atlas of all shadow maps (light/)
#define HG_BIND_SHADOW_CMP   7 // sampler2DShadow, the same atlas with depth comparison
#define HG_BIND_IMAGE_COUNT  8
#define HG_BIND_FRAME        8 // uniform block: struct hg_gpu_frame (frame.h)

// Tables that small scenes have in uniform blocks as well as by address (lib/tables.glsl). A device
// without caches for gathers by address (CPU devices) reads them several times faster this way.
#define HG_BIND_DRAWS          9  // struct hg_gpu_draw[]
#define HG_BIND_INSTANCES      10 // struct hg_gpu_instance[]
#define HG_BIND_PARTS          11 // struct hg_gpu_part[]
#define HG_BIND_MATERIALS      12 // struct hg_gpu_material[]
#define HG_BIND_PAGE_TABLE     13 // uint[]
#define HG_BIND_LIGHTS         14 // struct hg_gpu_light[]
#define HG_BIND_SHADOWS        15 // struct hg_gpu_shadow[]
#define HG_BIND_DFG_TABLE      16 // uint[], the first of it
#define HG_BIND_IRRADIANCE     17 // vec4[]
#define HG_BIND_TRIANGLE_CACHE 18 // uint[] of draws: their first facet
#define HG_BIND_HISTORY        19 // struct hg_gpu_history (history.h)
#define HG_BIND_TEXELS         20 // usamplerBuffer, facets (facet.h)
#define HG_BIND_COUNT          21

#define HG_BIND_UNIFORM_FIRST 8
#define HG_BIND_UNIFORM_COUNT 12    // what every device allows
#define HG_TABLE_BYTES        65536 // largest table of a uniform block
#define HG_TABLE_BIT(binding) (1u << ((binding)-HG_BIND_UNIFORM_FIRST))

#endif
