// draco.h - KHR_draco_mesh_compression's decoder behind C. The one C++ file is draco.cpp.
// Floor 2, private to scene/. Any thread. No exception leaves it; input is untrusted.
#ifndef HG_RENDERER_SCENE_FORMATS_GLTF_DRACO_H
#define HG_RENDERER_SCENE_FORMATS_GLTF_DRACO_H

#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

#ifdef __cplusplus
extern "C" {
#endif

struct hg_draco_mesh;

// HG_E_FORMAT with the decoder's words in *reason (cut to 200 bytes), HG_E_LIMIT when the stream
// announces more than max_points points or max_faces faces, HG_E_NOMEM. Borrows data for the call.
enum hg_status hg_draco_decode(const uint8_t *data, size_t size, uint32_t max_points,
    uint32_t max_faces, struct hg_draco_mesh **out, char reason[200]) HG_MUST_CHECK;
void hg_draco_destroy(struct hg_draco_mesh *mesh); // accepts NULL

uint32_t hg_draco_point_count(const struct hg_draco_mesh *mesh);
uint32_t hg_draco_face_count(const struct hg_draco_mesh *mesh);
// Writes 3 * face_count indices, each < point_count.
void hg_draco_indices(const struct hg_draco_mesh *mesh, uint32_t *out);
// Writes point_count x components values of a glTF component type, tightly packed, for the
// attribute with this unique id. HG_E_NOTFOUND, HG_E_FORMAT (not convertible).
enum hg_status hg_draco_attribute(const struct hg_draco_mesh *mesh, uint32_t unique_id,
    uint32_t component_type, uint32_t components, void *out) HG_MUST_CHECK;

#ifdef __cplusplus
}
#endif
#endif
