// draw_list.h - from runs of triangles to draws. Floor 2 (geometry). Private to the room.
// Thread: the render thread.
#ifndef HG_RENDERER_CULL_DRAW_LIST_H
#define HG_RENDERER_CULL_DRAW_LIST_H

#include "renderer/cull/draw_index_list.h"
#include "renderer/cull/occlusion.h"

struct hg_items { // of all sets; zeroed = empty; keeps its memory
    struct hg_visible_item *list;
    size_t capacity;
    uint32_t count;
    struct hg_listing listing;
};

// What is being added.
struct hg_adding {
    const struct hg_geometry *geometry;
    const struct hg_visible_view *view;
    struct hg_visible_set *set;
    struct hg_occlusion *occlusion; // NULL: nothing is tested, all comes at once
};

void hg_items_reset(struct hg_items *items);
void hg_items_finish(struct hg_items *items);
// Items of a set, early and late ones, from its runs in draw order; the set counts them. Changes
// the order of the runs. HG_E_NOMEM.
enum hg_status hg_items_add(struct hg_items *items, const struct hg_adding *adding,
    struct hg_selection *runs) HG_MUST_CHECK;
// Once the listing is written: what came through its sieve is what is drawn.
void hg_items_narrow(
    struct hg_items *items, struct hg_occlusion *occlusion, struct hg_visible_set *set);

#endif
