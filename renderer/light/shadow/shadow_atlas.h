// shadow_atlas.h - the depth atlases that the views of a scene draw their shadow maps to, and which
// maps each of them holds. Floor 2 (light). Thread: the render thread.
//
// What does not depend on a camera (a lamp's maps, the sun's map of the whole scene) is drawn once
// for all views: one that moves takes an atlas that holds it. A view that rests keeps an atlas to
// itself while it refines, for the finer cascades of its camera, and lets go of it when it moves or
// is settled. Of HG_SHADOW_ATLASES one is always left to views that move; those that refine beyond
// that take turns. No view draws to an atlas that another one keeps.
#ifndef HG_RENDERER_LIGHT_SHADOW_SHADOW_ATLAS_H
#define HG_RENDERER_LIGHT_SHADOW_SHADOW_ATLAS_H

#include "renderer/light/lighting.h"
#include "renderer/light/shadow/shadow_plan.h"
#include "renderer/light/shadow/shadow_pool.h"

#define HG_SHADOW_ATLASES 4

struct hg_shadow_atlas {
    struct hg_gpu_image image;   // width 0: there is none
    struct hg_shadow_plan held;  // maps that it holds; stale where casters moved since, in part
    struct hg_shadow_pool *pool; // what it holds where `held` has a pool; NULL: it never had one
    uint64_t shape;              // revision of the shapes that they show
    const void *owner;           // whose alone it is; NULL: everybody's
    bool busy;                   // the owner draws it over several steps
    const void *user;            // whose plan was drawn to it last, and that plan as it is since;
    struct hg_shadow_plan *plan; // NULL: `held` knows all of it
    uint64_t used_ns, revision;  // revision: grows when it is drawn to or made; never 0
};

// Zero-initialise.
struct hg_shadow_atlases {
    struct hg_gpu *gpu;
    struct hg_gpu_image none; // 1x1, bound where there is no atlas
    struct hg_shadow_atlas items[HG_SHADOW_ATLASES];
    uint64_t revision; // the newest of any
};

enum hg_status hg_shadow_atlases_init(
    struct hg_shadow_atlases *atlases, struct hg_gpu *gpu, struct hg_error *err) HG_MUST_CHECK;
void hg_shadow_atlases_finish(struct hg_shadow_atlases *atlases); // accepts a zeroed one

enum hg_shadow_keeping {
    HG_SHADOW_SHARES,  // draws to one that no view keeps
    HG_SHADOW_REFINES, // to its own, unless another holds all that it needs
    HG_SHADOW_KEEPS,   // to its own, over several steps
};

// Who asks for an atlas, and what for.
struct hg_shadow_user {
    const void *lighting; // identity
    enum hg_shadow_keeping keeping;
    const struct hg_lighting_view *view;
    struct hg_shadow_plan *plan;
};

// An atlas for the maps of a plan, made if there is none: of the plan's side; for a view that
// moves, or is drawn once, at least of that, and where its maps are does not matter. Maps over
// which casters moved are stale in part from then on, and all of them where it is not known what
// moved. HG_E_LIMIT, HG_E_NOMEM, device errors.
enum hg_status hg_shadow_atlases_take(struct hg_shadow_atlases *atlases,
    const struct hg_shadow_user *user, struct hg_shadow_atlas **out,
    struct hg_error *err) HG_MUST_CHECK;
// What it kept is everybody's; one atlas too many goes.
void hg_shadow_atlases_release(struct hg_shadow_atlases *atlases, const void *owner);
// The same, and its plan is looked at no more.
void hg_shadow_atlases_leave(struct hg_shadow_atlases *atlases, const void *owner);

// Which maps of a plan are to be drawn, and where; what becomes of them is read from the plan when
// the atlas is taken again. The plan stays where it is until then, or until its user leaves.
enum hg_status hg_shadow_atlas_plan(
    struct hg_shadow_atlas *atlas, const struct hg_shadow_user *user) HG_MUST_CHECK; // HG_E_NOMEM
// What became of them so far, and of pages that are due; its user may change the plan.
void hg_shadow_atlases_note(struct hg_shadow_atlases *atlases, const void *user);
void hg_shadow_atlases_note_drawn(
    struct hg_shadow_atlases *atlases, struct hg_shadow_atlas *atlas); // its contents changed

#endif
