// cryptomatte_ids.h - groups draws by name, for each Cryptomatte list. Private to the room.
// Floor 3.5. Thread: the render thread.
#ifndef HG_RENDERER_PATHTRACE_CRYPTOMATTE_IDS_H
#define HG_RENDERER_PATHTRACE_CRYPTOMATTE_IDS_H

#include "renderer/gpu/gpu.h"
#include "renderer/pathtrace/path.h"

struct hg_cryptomatte_ids {
    struct hg_gpu_buffer names; // [list_count][draws] words, mapped: the first draw of that name
    uint32_t list_count, draws;
};

// Before the film is made. HG_E_NOMEM.
enum hg_status hg_cryptomatte_ids_make(struct hg_cryptomatte_ids *ids, struct hg_gpu *gpu,
    const struct hg_geometry *geometry, const struct hg_path_settings *settings,
    struct hg_error *err) HG_MUST_CHECK;
void hg_cryptomatte_ids_destroy(struct hg_cryptomatte_ids *ids, struct hg_gpu *gpu);
// The list that holds names of a kind; false: none.
bool hg_cryptomatte_ids_list(
    const struct hg_path_settings *settings, uint32_t kind, uint32_t *list);

#endif
