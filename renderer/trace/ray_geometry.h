// ray_geometry.h - triangles for ray tracing: every draw at one level of detail, on the host.
// Floor 2 (geometry). Thread: the render thread.
//
// Unless its lens allows resident substitutes, it depends neither on residency and budgets nor on
// earlier pictures: the same scene and lens give the same ray geometry. Draws that nothing
// simplifies have one piece, all of their part. Positions are where the device reads them (object
// space; skinned and morphed parts have been deformed), or copies where the host cannot.
//
// Call it after hg_geometry_sync, when deformations have run (hg_geometry_deforms_done) and no
// batch is open. Sets of culling.h that were added before are not to be drawn any more: the chunks
// that they use may have gone. Lines, and points that have no discs, are left out: they are as wide
// as a pixel, which rays do not have.
#ifndef HG_RENDERER_TRACE_RAY_GEOMETRY_H
#define HG_RENDERER_TRACE_RAY_GEOMETRY_H

#include "base/jobs.h"
#include "renderer/geometry/geometry.h"

// Consecutive triangles of one piece of geometry. Pieces with the same key have the same positions
// and triangles, in this ray geometry and in later ones.
struct hg_ray_geometry_piece {
    uint64_t key;
    uint32_t draw;            // index of the device's draws
    uint32_t first_primitive; // number of the first one in hits: HG_LOD_SHIFT
    uint32_t triangle_count, vertex_count;
    const float *positions;  // [vertex_count * 3], and 4 bytes more may be read
    const float *opening;    // the same at the opening of the shutter; NULL: they do not change
    const uint32_t *indices; // [triangle_count * 3]
    // [vertex_count] of parts with levels of detail, whose vertices are not those of the mesh; else
    // NULL.
    const struct hg_gpu_vertex *vertices;
    const float *normals; // [vertex_count * 3] of others that are not deformed; else NULL
    const float *uv[2];   // [vertex_count * 2] of others; NULL: none
    VkDeviceAddress positions_address, indices_address; // the same on the device
    float world[12];                                    // object to world: 4 columns of 3
    float previous[12];                                 // at the opening of the shutter, or `world`
    uint32_t flags;                                     // HG_DRAW_*
    bool deforms;                                       // positions change under the same key
    bool animated; // its node, or one above, is brought elsewhere by animations
};

struct hg_ray_geometry_lens {
    float eye[3];   // relative to the geometry's origin
    float px_scale; // pixels per radian, or per metre when orthographic
    bool orthographic;
    float near;     // metres, > 0
    float error_px; // greatest projected error; 0: everything as fine as it is
    bool motion; // from hg_ray_geometry_open_shutter to now; else nothing moves while the shutter
                 // is open
    bool addresses; // only they are wanted: positions and indices may be NULL
    // What is not there is not waited for: coarser levels take its place, and it is asked for.
    bool resident;
};

struct hg_ray_geometry;

// Loads what is wanted and not there. HG_E_LIMIT: the geometry budget does not hold it.
// HG_E_NOMEM, device errors. *out: kept and brought up to date when it is not NULL (also after an
// error: then it is empty); its chunks stay resident until it is freed, rebuilt or the geometry
// is synced. Free it before the geometry.
enum hg_status hg_ray_geometry_make(struct hg_geometry *geometry,
    const struct hg_ray_geometry_lens *lens, struct hg_jobs *jobs, struct hg_ray_geometry **out,
    struct hg_error *err) HG_MUST_CHECK;
// Keeps where everything is now, and the positions of deformed parts: what `previous` and `opening`
// are of ray geometry with motion that follows. Draws that were not there then do not move. *out:
// as of hg_ray_geometry_make; what it holds stays. HG_E_NOMEM, device errors.
enum hg_status hg_ray_geometry_open_shutter(
    struct hg_geometry *geometry, struct hg_ray_geometry **out, struct hg_error *err) HG_MUST_CHECK;
void hg_ray_geometry_free(struct hg_ray_geometry *geometry); // accepts NULL
uint32_t hg_ray_geometry_count(const struct hg_ray_geometry *geometry);
// By draw, then primitive.
const struct hg_ray_geometry_piece *hg_ray_geometry_pieces(const struct hg_ray_geometry *geometry);
// Chunks that it goes without; 0 unless the lens asks for what is resident.
uint32_t hg_ray_geometry_missing(const struct hg_ray_geometry *geometry);
// Revision: differs when any content does.
uint64_t hg_ray_geometry_revision(const struct hg_ray_geometry *geometry);

#endif
