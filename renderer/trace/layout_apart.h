// layout_apart.h - keeps what stands still in the flat structure, and what has moved out of it.
// Floor 2 (trace). Thread: any; no shared state. Private to the room.
//
// The flat structure holds what stood still when it was built. What moves, or comes later, leaves
// it for a body of its own, in world space as well (so hits have the same bits), and stays there:
// the flat structure is built anew once, and from then on a move builds the one body. When such
// bodies hold more than half as many triangles as the flat structure and nothing has moved since
// the sync before, all become flat again.
#ifndef HG_RENDERER_TRACE_LAYOUT_APART_H
#define HG_RENDERER_TRACE_LAYOUT_APART_H

#include "base/status.h"

struct hg_trace_layout;

struct hg_trace_apart { // zeroed = empty; hg_trace_apart_finish
    uint64_t *flat;     // hashes of the places in the flat structure, ascending
    uint64_t *before;   // of all that could be there, at the sync before
    uint32_t flat_count, before_count;
};

// Takes places out of flat bodies, which are in order, and appends bodies for them. HG_E_NOMEM.
enum hg_status hg_trace_apart_split(struct hg_trace_layout *layout) HG_MUST_CHECK;
void hg_trace_apart_finish(struct hg_trace_apart *apart);

#endif
