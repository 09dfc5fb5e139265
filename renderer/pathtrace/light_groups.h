// light_groups.h - light groups and shadow catchers. Private to the room.
// Floor 3.5. Thread: the render thread.
#ifndef HG_RENDERER_PATHTRACE_LIGHT_GROUPS_H
#define HG_RENDERER_PATHTRACE_LIGHT_GROUPS_H

#include "renderer/gpu/gpu.h"
#include "renderer/pathtrace/path.h"
#include "renderer/trace/trace.h"
#include "shaders/shared/path.h"

struct hg_light_groups { // group 0 is the environment
    char names[HG_PATH_MOST_GROUPS][HG_PATH_GROUP_NAME];
    uint32_t count;                             // 0: not requested
    struct hg_gpu_buffer draw_marks, of_lights; // words, mapped
};

// Called after geometry sync, before the film is created. Updates HG_PATH_SPLIT, _GROUPS, _CATCHER,
// _SURFACES and _FOLLOWS in *options. HG_E_NOMEM.
enum hg_status hg_light_groups_make(struct hg_light_groups *groups, struct hg_gpu *gpu,
    const struct hg_scene_gpu *scene_gpu, const struct hg_path_request *request, uint32_t *options,
    struct hg_error *err) HG_MUST_CHECK;
// Marks the draws that rays intersect in object space (bodies with placements). Called after the
// groups are made, and after each rebuild of ray geometry. Updates HG_PATH_PLACED in *options.
void hg_light_groups_mark_placed(struct hg_light_groups *groups, const struct hg_trace *trace,
    uint32_t draws, uint32_t *options);
void hg_light_groups_destroy(struct hg_light_groups *groups, struct hg_gpu *gpu);

#endif
