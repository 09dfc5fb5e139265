// draw_list.h - from runs of triangles to draws. Floor 2 (geometry). Private to the room.
// Thread: the render thread.
#ifndef HG_RENDERER_CULL_DRAW_LIST_H
#define HG_RENDERER_CULL_DRAW_LIST_H

#include "renderer/cull/draw_index_list.h"
#include "renderer/cull/occlusion.h"

struct hg_draw_list { // of all sets; zeroed = empty; keeps its memory
    struct hg_culling_item *list;
    size_t capacity;
    uint32_t count;
    struct hg_index_lists listing;
};

// What is being added.
struct hg_draw_list_run {
    const struct hg_geometry *geometry;
    const struct hg_culling_view *view;
    struct hg_culling_set *set;
    struct hg_occlusion *occlusion; // NULL: nothing is tested, all comes at once
};

void hg_draw_list_reset(struct hg_draw_list *items);
void hg_draw_list_finish(struct hg_draw_list *items);
// Items of a set, early and late ones, from its runs in draw order; the set counts them. Changes
// the order of the runs. HG_E_NOMEM.
enum hg_status hg_draw_list_add(struct hg_draw_list *items, const struct hg_draw_list_run *adding,
    struct hg_selection *runs) HG_MUST_CHECK;
// Once the listing is written: what came through its sieve is what is drawn.
void hg_draw_list_narrow(
    struct hg_draw_list *items, struct hg_occlusion *occlusion, struct hg_culling_set *set);

#endif
