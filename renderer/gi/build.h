// build.h - one grid of probes and its progress: the schedule of the settled field, the updates of
// the dynamic one. Floor 2, private to renderer/gi. Thread: the render thread.
#ifndef HG_RENDERER_GI_BUILD_H
#define HG_RENDERER_GI_BUILD_H

#include "renderer/gi/waves.h"

#define HG_GI_WARM_WINDOW 4

struct hg_gi_bounds {
    float min[3], max[3];
};

struct hg_gi_build { // zeroed: none
    struct hg_gi_field field;
    struct hg_gi_key key;
    bool keyed;
    uint32_t *list, listed;              // probes that the round updates, ascending
    uint32_t round, next;                // of the schedule; next: of the list
    uint32_t end;                        // rounds of the schedule; 0: not known yet
    double log_light[HG_GI_WARM_WINDOW]; // after the newest rounds
    uint64_t updates; // of the dynamic field since the last change, of all probes
    bool *is_new;     // [field.count] still to be relocated; NULL: none
};

// What waves are cast with.
struct hg_gi_build_params {
    struct hg_gi_waves *waves;
    const struct hg_lighting_sources *sources;
    const struct hg_gi_field *light; // the finest grid that what rays meet is lit by
};

void hg_gi_build_finish(struct hg_gi_build *build, struct hg_gpu *gpu);
bool hg_gi_build_has_key(const struct hg_gi_build *build, const struct hg_gi_key *key);
bool hg_gi_build_is_done(const struct hg_gi_build *build); // all rounds of the schedule are
bool hg_gi_build_is_placed(const struct hg_gi_build *build);

// Empty probes around a box (relative to the geometry's origin); NULL: none, as there is nothing to
// put them around. HG_E_LIMIT (budget, before memory is taken), HG_E_NOMEM.
enum hg_status hg_gi_build_surround(struct hg_gi_build *build, struct hg_gi_waves *waves,
    const struct hg_gi_bounds *box, struct hg_error *err) HG_MUST_CHECK;
// Empty probes of a grid (hg_gi_field_place_grid). HG_E_NOMEM.
enum hg_status hg_gi_build_place(
    struct hg_gi_build *build, const struct hg_gi_field *grid, struct hg_error *err) HG_MUST_CHECK;
// The next waves of the schedule, about *rays of them at most, and takes them off. Device errors.
enum hg_status hg_gi_build_advance(struct hg_gi_build *build,
    const struct hg_gi_build_params *params, uint64_t *rays, struct hg_error *err) HG_MUST_CHECK;

// Marks all probes of a dynamic grid as new, after it was placed. HG_E_NOMEM.
enum hg_status hg_gi_build_begin_new(struct hg_gi_build *build, struct hg_error *err) HG_MUST_CHECK;
// Relocates new probes, by about *rays rays, which are taken off, and fills them with the light of
// coarser grids. Device errors.
enum hg_status hg_gi_build_relocate_new(struct hg_gi_build *build,
    const struct hg_gi_build_params *params, uint64_t *rays, struct hg_error *err) HG_MUST_CHECK;
// What makes the light of probes out of date. Geometry that moves from picture to picture takes
// little of it with it each time: probes go on with the mean of the newest updates.
enum hg_gi_change { HG_GI_LIGHT, HG_GI_MOVED, HG_GI_MOVES };
// moves_on: geometry moved a few pictures ago, too.
static inline enum hg_gi_change hg_gi_change_of(
    const struct hg_gi_key *from, const struct hg_gi_key *to, bool moves_on)
{
    if (from->geometry == to->geometry || from->environment != to->environment)
        return from->geometry == to->geometry ? HG_GI_LIGHT : HG_GI_MOVED;
    return moves_on ? HG_GI_MOVES : HG_GI_MOVED;
}
// Marks what the probes of a dynamic grid hold as out of date.
void hg_gi_build_outdate(struct hg_gi_build *build, enum hg_gi_change change);
// Updates probes that have no light yet: those that slept before geometry moved. Device errors.
enum hg_status hg_gi_build_light_new(struct hg_gi_build *build,
    const struct hg_gi_build_params *params, struct hg_error *err) HG_MUST_CHECK;
// A wave of updates: *rays 0 when none are needed until the next change. Device errors.
enum hg_status hg_gi_build_update(struct hg_gi_build *build,
    const struct hg_gi_build_params *params, uint64_t *rays, struct hg_error *err) HG_MUST_CHECK;
bool hg_gi_build_wants_updates(const struct hg_gi_build *build);

#endif
