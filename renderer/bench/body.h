// body.h - a body that benchmarks move through a scene. Private to renderer/bench.
#ifndef HG_RENDERER_BENCH_BODY_H
#define HG_RENDERER_BENCH_BODY_H

#include "renderer/scene/scene.h"

// A white cube of `half` metres on each side of its origin, unlit; not visible until it is
// placed. HG_E_NOMEM.
enum hg_status hg_bench_body_add(
    struct hg_scene *scene, float half, struct hg_node **out) HG_MUST_CHECK;
// at NULL: it is not visible.
void hg_bench_body_place(struct hg_scene *scene, struct hg_node *body, const float at[3]);

#endif
