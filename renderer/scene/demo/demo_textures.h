// demo_textures.h - procedural texture sets of the demo scene.
// Floor 2, private to the demo. Fixed seeds: the same pixels on every run. All tile.
#ifndef HG_RENDERER_SCENE_DEMO_DEMO_TEXTURES_H
#define HG_RENDERER_SCENE_DEMO_DEMO_TEXTURES_H

#include "base/jobs.h"
#include "renderer/image/image.h"

enum hg_demo_pattern {
    HG_DEMO_TILES,   // limestone and slate, inlaid
    HG_DEMO_MARBLE,  // veined
    HG_DEMO_PLASTER, // trowelled
    HG_DEMO_CLOTH,   // plain weave with stripes
    HG_DEMO_BRASS,   // brushed, with age in its pores
    HG_DEMO_WATER,   // ripples
    HG_DEMO_GLAZE,   // painted stars under glaze
    HG_DEMO_WOOD,    // oak boards
    HG_DEMO_PATTERNS
};

struct hg_demo_set {
    struct hg_image color;  // RGBA8 sRGB
    struct hg_image normal; // RGBA8, tangent space
    struct hg_image orm;    // RGBA8: occlusion, roughness, metalness
};

// Draws one set. HG_E_NOMEM; the caller finishes the images either way.
enum hg_status hg_demo_draw(
    enum hg_demo_pattern pattern, struct hg_jobs *jobs, struct hg_demo_set *out) HG_MUST_CHECK;

#endif
