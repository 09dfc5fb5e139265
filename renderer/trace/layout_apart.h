// layout_apart.h - splits moving bodies off the flat structure.
// Floor 2 (trace). Thread: any; no shared state. Private to the room.
//
// The flat structure holds the bodies that were static when it was built. A body that moves, or is
// added later, gets a structure of its own, in world space as well (so hits are bit-identical), and
// keeps it: the flat structure is rebuilt once, later moves rebuild only the one body. When such
// bodies hold more than half as many triangles as the flat structure and nothing has moved since
// the previous sync, all become flat again.
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
