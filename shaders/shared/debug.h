// debug.h - values of the first specialisation constant of debug.frag; as enum hg_debug_view of
// renderer/renderer.h. Floor 0, shared by C and GLSL.
#ifndef HG_SHADERS_SHARED_DEBUG_H
#define HG_SHADERS_SHARED_DEBUG_H

#define HG_DEBUG_VIEW_MIP       1u
#define HG_DEBUG_VIEW_RESIDENCY 2u
#define HG_DEBUG_VIEW_MISSING   3u
#define HG_DEBUG_VIEW_CLUSTER   4u
#define HG_DEBUG_VIEW_LOD       5u
#define HG_DEBUG_VIEW_OVERDRAW  6u
#define HG_DEBUG_VIEW_MOTION    7u // of pictures in motion, by the host (renderer/temporal); at rest
#define HG_DEBUG_VIEW_HISTORY   8u // no motion and no history
#define HG_DEBUG_VIEW_PROBES    9u
#define HG_DEBUG_VIEW_IRRADIANCE 10u
#define HG_DEBUG_VIEW_SHADOWS   11u
#define HG_DEBUG_VIEW_REFLECTIONS 12u // of pictures in motion, by the host; at rest grey
#define HG_DEBUG_VIEW_SCALE     13u // of pictures in motion, by the host; at rest the whole size
#define HG_DEBUG_VIEW_SHADOW_PAGES 14u // in motion by the host; at rest places in the atlas

#define HG_DEBUG_LIGHT_HALF   0.1f  // irradiance over pi that is shown as 0.5
#define HG_DEBUG_PROBE_RADIUS 0.05f // of spheres that stand for probes, spacings

#endif
