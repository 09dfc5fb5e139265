// lod_intake.h - which parts get levels of detail, and how they come in from the build queue.
// Floor 2 (geometry). Private to the room. Thread: the render thread.
#ifndef HG_RENDERER_GEOMETRY_LOD_INTAKE_H
#define HG_RENDERER_GEOMETRY_LOD_INTAKE_H

#include "renderer/mesh/mesh_entry.h"

struct hg_geometry;

// Queues parts of many triangles for baking; brings finished ones into their entries (true when
// there were some). Waits for all of them, at most until that time of hg_clock_now_ns.
void hg_lod_intake_queue(struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count);
// Gives proxies to parts that are being baked and are not on the device yet, of a size that fits.
//   used_bytes   what all takes as it is
// HG_E_NOMEM.
enum hg_status hg_lod_intake_show_proxies(struct hg_geometry *g, struct hg_mesh_entry *meshes,
    uint32_t count, uint64_t used_bytes) HG_MUST_CHECK;
// Bytes of parts that have a proxy until they would be baked, and could not be; and of the proxies.
uint64_t hg_lod_intake_lost_bytes(
    const struct hg_mesh_entry *meshes, uint32_t count, uint64_t *proxy_bytes);
// Shows them as they are: there is room now.
enum hg_status hg_lod_intake_drop_proxies(struct hg_geometry *g, struct hg_mesh_entry *meshes,
    uint32_t count, uint64_t *written, struct hg_error *err) HG_MUST_CHECK;
// Triangles from which parts are baked; UINT32_MAX: none are.
uint32_t hg_lod_intake_from(const struct hg_geometry *g);
// The triangle (of points: the point) of a part nearest to a point of the space that `world` leads
// to; 0 when it has none.
uint32_t hg_lod_intake_nearest(
    const struct hg_mesh_part *part, const struct hg_mat4x3 *world, const float point[3]);
bool hg_lod_intake_collect(
    struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count, uint64_t until_ns);

#endif
