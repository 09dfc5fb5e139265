// asset_pack.h - an asset as bytes, for its way out of a process that parses foreign formats: what
// importers make, and nothing else (no instances, morph targets, variants, profiles of lights,
// lobes of materials, files of textures). Floor 2, private to scene/. One thread per asset.
//
// The bytes begin with a version and the counts of objects; then come file, textures, materials,
// lights, cameras, meshes, skins, nodes (parents before children), animations, roots, warnings.
// Little endian, arrays as they lie in memory, references as indices. It is no file format: both
// sides are of one build.
#ifndef HG_RENDERER_SCENE_ASSET_PACK_H
#define HG_RENDERER_SCENE_ASSET_PACK_H

#include "renderer/scene/asset.h"

// out->failed when there is no memory. The asset is read only.
void hg_asset_pack(struct hg_asset *asset, struct hg_writer *out);

// Bytes that anybody may have made: every count is held against the bytes that are left before
// memory is taken, every index and every number against its range. `label` is the file's name. An
// image is its encoded bytes, its pixels, or neither: then label names its file. HG_E_FORMAT
// (err->where: the place), HG_E_LIMIT (memory_limit_bytes), HG_E_NOMEM; *out is NULL then.
struct hg_asset_unpack {
    const uint8_t *data;
    size_t size;
    uint32_t asset_number;
    uint64_t memory_limit_bytes;
    const char *label;
};
enum hg_status hg_asset_unpack(const struct hg_asset_unpack *params, struct hg_asset **out,
    struct hg_error *err) HG_MUST_CHECK;

#endif
