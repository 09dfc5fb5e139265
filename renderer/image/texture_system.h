// texture_system.h - OpenImageIO's own texture system, to be measured against (helio bench vt).
// Floor 1. Thread: one at a time.
#ifndef HG_RENDERER_IMAGE_TEXTURE_SYSTEM_H
#define HG_RENDERER_IMAGE_TEXTURE_SYSTEM_H

#include "base/status.h"

struct hg_texture_system;

#ifdef __cplusplus
extern "C" {
#endif

// Keeps at most memory_bytes of decoded tiles. HG_E_NOMEM.
enum hg_status hg_texture_system_create(
    uint64_t memory_bytes, struct hg_texture_system **out, struct hg_error *err) HG_MUST_CHECK;
void hg_texture_system_destroy(struct hg_texture_system *system); // accepts NULL
// Names a file; textures are numbered from 0. HG_E_IO.
enum hg_status hg_texture_system_add(
    struct hg_texture_system *system, const char *path, struct hg_error *err) HG_MUST_CHECK;
// Trilinear, repeating. footprint: side of the square that the sample covers, in texture
// coordinates. False when the file cannot be read.
bool hg_texture_system_sample(struct hg_texture_system *system, uint32_t texture, float u, float v,
    float footprint, float rgba[4]);
// Bytes of tiles decoded since creation.
uint64_t hg_texture_system_decoded_bytes(const struct hg_texture_system *system);
// Such as "OpenImageIO 2.4.7".
const char *hg_texture_system_version(void);

#ifdef __cplusplus
}
#endif

#endif
