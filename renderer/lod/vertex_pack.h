// vertex_pack.h - vertices of a mesh part as the device reads them. Floor 2 (geometry). Pure: any
// thread.
//
// Precision: positions and uvs stay f32. Normals are octahedral, 2 x snorm16 (error below 0.0025
// degrees); tangents 16 + 15 bits (below 0.006 degrees). Colours are RGBA8 when that is exact to
// half a step of 1/255 and in range, else RGBA16 (0..1; brighter ones are clamped, as glTF allows).
// Source: Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit Vectors"
// (oct32P: of the four roundings the nearest is taken).
#ifndef HG_RENDERER_LOD_VERTEX_PACK_H
#define HG_RENDERER_LOD_VERTEX_PACK_H

#include "renderer/scene/scene.h"
#include "shaders/shared/geometry.h"

// normal: unit. tangent: unit, and the sign of the bitangent, +1 or -1, in its fourth number.
uint32_t hg_pack_normal(const float normal[3]);
uint32_t hg_pack_tangent(const float tangent[4]);
// The inverses, as shaders read the words.
void hg_unpack_normal(uint32_t word, float normal[3]);
void hg_unpack_tangent(uint32_t word, float tangent[4]);

// Byte offsets of a part's streams in one buffer, each a multiple of 256; absent streams are 0
// bytes long.
struct hg_pack_layout {
    uint64_t indices, positions, vertices, extra, joints, weights, targets, total_bytes;
    uint32_t flags;       // HG_DRAW_* of the vertex format
    uint32_t extra_words; // per vertex
};

// HG_E_LIMIT when sizes do not fit 64 bits or a count does not fit the formats.
enum hg_status hg_pack_layout_of(const struct hg_mesh_part *part, uint32_t target_count,
    struct hg_pack_layout *out) HG_MUST_CHECK;
// Writes all streams to dst (layout->total_bytes); gaps are zeroed. order: [triangles] which one
// comes where; NULL: as they are.
void hg_pack_part(const struct hg_mesh_part *part, uint32_t target_count, const uint32_t *order,
    const struct hg_pack_layout *layout, uint8_t *dst);
// Float offsets of a target's deltas in the targets stream (HG_DEFORM_ABSENT: none).
struct hg_gpu_morph hg_pack_morph(const struct hg_mesh_part *part, uint32_t target);

#endif
