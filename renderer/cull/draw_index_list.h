// draw_index_list.h - lists of indices that are made for one frame. Floor 2 (geometry). Private to
// the room. Thread: one at a time; writing is spread over jobs.
//
// A list takes runs of primitives from one part. It may go through a sieve, and it may be woven:
// then it has vertices of its own, positions and numbers together, in which the first corner of a
// triangle belongs to it alone and holds its number (why: provoking_vertex.h). Corners keep their
// order, so that a triangle has the same depth whatever else is in the list.
#ifndef HG_RENDERER_CULL_DRAW_INDEX_LIST_H
#define HG_RENDERER_CULL_DRAW_INDEX_LIST_H

#include "renderer/cull/triangle_cull.h"

#define HG_INDEX_LIST_NONE         UINT32_MAX
#define HG_INDEX_LIST_MOST_WOVEN   8192u  // vertices of a part
#define HG_INDEX_LIST_MOST_NUMBERS 16384u // triangles of a woven list

struct hg_index_list_vertex {
    float position[3];
    uint32_t number;
};

// Consecutive primitives of a part.
struct hg_index_list_run {
    const uint32_t *indices; // of the part
    uint32_t first, count;   // primitives of it
    uint32_t base;           // of their numbers
    uint64_t to;             // place in the indices
    uint32_t ids;            // place in the ids, if the list has some
    uint32_t list, kept;
};

struct hg_index_list {
    uint32_t corners; // of a primitive
    bool has_ids;     // numbers of its primitives; else they are known otherwise
    bool backwards, sieved, woven;
    struct hg_triangle_cull sieve;
    const float *positions; // of the part, when it is sieved or woven
    uint32_t vertex_count;  // of the part, when it is woven
    // Private, but to read:
    uint32_t first_run, run_count;
    uint64_t first_index, first_vertex;
    uint32_t first_id;
    uint32_t kept; // primitives, once it is written
};

struct hg_index_lists { // zeroed = empty; keeps its memory
    struct hg_index_list *lists;
    struct hg_index_list_run *runs;
    size_t list_capacity, run_capacity;
    uint32_t list_count, run_count;
    uint64_t index_count, vertex_count; // that there must be room for
    uint32_t id_count;
};

// Memory that a listing is written to, as large as it counts.
struct hg_index_lists_memory {
    uint32_t *indices, *ids;
    struct hg_index_list_vertex *vertices;
};

// How the list of an item is made: of the numbered list of its part, or of its chunk. The item has
// its draw, flags, chunk, primitive_count and whether it is numbered.
void hg_index_list_open(const struct hg_geometry *g, const struct hg_culling_view *view,
    const struct hg_culling_item *item, struct hg_index_list *out);
// Whether triangles of a draw of a part that is not baked are culled one by one.
bool hg_index_list_culls_part(
    const struct hg_geometry *g, const struct hg_culling_view *view, uint32_t draw);

void hg_index_lists_reset(struct hg_index_lists *listing);
void hg_index_lists_finish(struct hg_index_lists *listing);
// Begins a list; *index: its number. HG_E_NOMEM.
enum hg_status hg_index_lists_begin(struct hg_index_lists *listing,
    const struct hg_index_list *list, uint32_t *index) HG_MUST_CHECK;
// Adds primitives to the newest list. HG_E_NOMEM.
enum hg_status hg_index_lists_add(
    struct hg_index_lists *listing, const struct hg_index_list_run *run) HG_MUST_CHECK;
// Room for the vertices of the newest list, after its last run.
void hg_index_lists_end(struct hg_index_lists *listing);
// Writes all lists. jobs may be NULL.
void hg_index_lists_write(struct hg_index_lists *listing, struct hg_jobs *jobs,
    const struct hg_index_lists_memory *memory);

#endif
