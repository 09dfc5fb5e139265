// select.h - runs of triangles that one view may see, on the host. Private to renderer/geometry/.
#ifndef HG_RENDERER_GEOMETRY_SELECT_H
#define HG_RENDERER_GEOMETRY_SELECT_H

#include "renderer/geometry/internal.h"
#include "renderer/geometry/visible.h"

#define HG_RUN_NO_BIT 0xffffffffu

// Consecutive primitives of one draw.
struct hg_run {
    uint32_t draw;
    uint32_t first, count;      // primitives
    uint32_t bit;               // of histories; HG_RUN_NO_BIT: always drawn
    float center[3], extent[3]; // box, object space; extent < 0: not known
};

struct hg_selection { // zeroed = empty; keeps its memory
    struct hg_run *items;
    size_t capacity;
    uint32_t count;
};

// Appends runs in draw order. HG_E_NOMEM.
enum hg_status hg_select(const struct hg_geometry *geometry, const struct hg_visible_view *view,
    struct hg_jobs *jobs, struct hg_selection *out) HG_MUST_CHECK;

#endif
