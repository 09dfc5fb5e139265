#include "renderer/scene/formats/gltf/draco.h"
#include "renderer/scene/formats/gltf/gltf.h"

enum hg_status hg_gltf_decode_draco(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_draco_mesh **out)
{
    *out = NULL;
    int64_t index = hg_gltf_index(at, "bufferView");
    const struct hg_gltf_view *view;
    enum hg_status status = hg_gltf_view_get(g, index < 0 ? UINT32_MAX : (uint64_t)index, &view);
    if (status)
        return status;
    // A point takes at least 12 bytes and a face 12 once decoded.
    uint64_t left = g->memory_limit - g->memory_used;
    uint64_t most = left / 12 < INT32_MAX / 3 ? left / 12 : INT32_MAX / 3;
    char reason[200] = "";
    status = hg_draco_decode(view->data, view->size, (uint32_t)most, (uint32_t)most, out, reason);
    return status ? hg_gltf_fail(g, at, status, "Draco: %s", reason) : HG_OK;
}
