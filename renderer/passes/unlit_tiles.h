// unlit_tiles.h - cells of the picture that no punctual light reaches, for a pipeline without
// lights. Floor 3. Thread: the render thread.
//
// Software rasterisers cannot skip the lights of a pixel inside a shader; the depth test in front
// of it can. So surfaces are looked at in cells of HG_UNLIT_TILES_CELL_PX before they are shaded. A
// cell is dark when all maps of the lights that might reach what it shows are nearer to the light
// everywhere, which a pyramid over the shadow atlas tells; what is not sure is not dark, and
// pictures are the same bytes without any of this. Depths of surfaces in dark cells become
// HG_UNLIT_TILES_DEPTH, by which shading (passes/shade.h) tells the three kinds of pixels apart.
#ifndef HG_RENDERER_PASSES_UNLIT_TILES_H
#define HG_RENDERER_PASSES_UNLIT_TILES_H

#include "renderer/light/lighting.h"
#include "renderer/passes/pass.h"

// Zeroed = nothing yet.
struct hg_unlit_tiles {
    struct hg_gpu_buffer head, cells, levels;
    uint64_t seen; // hg_lighting_atlas_revision that `levels` were made of; 0 = none
    bool coarse;   // without the finer cascades
};

void hg_unlit_tiles_finish(struct hg_gpu *gpu, struct hg_unlit_tiles *dark);
// Finds the cells of what `depth` holds, with the pass's lights. In front of this the shadow maps
// are drawn, without the finer cascades when coarse. HG_E_NOMEM, device errors.
enum hg_status hg_unlit_tiles_find(struct hg_pass *pass, struct hg_unlit_tiles *dark,
    struct hg_lighting *lighting, bool coarse, struct hg_gpu_image *depth,
    struct hg_error *err) HG_MUST_CHECK;
// Moves their surfaces to HG_UNLIT_TILES_DEPTH (shaders/shared/unlit_tiles.h).
enum hg_status hg_unlit_tiles_mark(struct hg_pass *pass, const struct hg_unlit_tiles *dark,
    struct hg_gpu_image *depth, struct hg_error *err) HG_MUST_CHECK;
// Share of cells that the newest picture had in the dark, 0..1; after the batch was waited for.
float hg_unlit_tiles_share(const struct hg_unlit_tiles *dark, const struct hg_gpu_image *depth);

#endif
