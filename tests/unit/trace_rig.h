// trace_rig.h - scenes of plain arrays, rays in memory that host and device share, and the answer
// of trying every triangle in double precision.
#ifndef HG_TESTS_TRACE_RIG_H
#define HG_TESTS_TRACE_RIG_H

#include "renderer/geometry/geometry_state.h"
#include "renderer/trace/trace.h"

struct rig {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    struct hg_scene *scene;
    struct hg_geometry *geometry;
    struct hg_ray_geometry *ray_geometry;
    struct hg_trace *trace;
    struct hg_gpu_buffer rays, hits, blocked;
    struct hg_error err;
    uint64_t next_id;
    uint32_t random;
    enum hg_trace_backend backend;
};

struct rig *rig_open(enum hg_trace_backend backend);
void rig_close(struct rig *r);
void rig_check(struct rig *r, enum hg_status status); // fails the test with what r->err says
double rig_random(struct rig *r, double low, double high);

struct hg_mesh *rig_mesh(struct rig *r, const float *positions, uint32_t vertex_count,
    const uint32_t *indices, uint32_t index_count);
// Triangles in [-1, 1]^3 with edges of about `size`.
struct hg_mesh *rig_soup(struct rig *r, uint32_t triangles, double size);
struct hg_material *rig_material(struct rig *r, enum hg_alpha_mode mode);
struct hg_node *rig_node(struct rig *r, struct hg_mesh *mesh, const float matrix[16]);
void rig_pose(struct rig *r); // scene and geometry only
void rig_trace(
    struct rig *r, const struct hg_ray_geometry_lens *lens, uint64_t budget_bytes); // the rest
void rig_sync(struct rig *r); // scene, geometry, ray geometry and structures
enum hg_status rig_try(struct rig *r, uint64_t budget_bytes);

// Rays from around the scene into it.
void rig_fill_rays(struct rig *r, uint32_t count);
struct hg_gpu_ray *rig_rays(struct rig *r, uint32_t count); // room for them and their hits
const struct hg_gpu_hit *rig_closest(struct rig *r, uint32_t count, bool coherent);
const uint32_t *rig_blocked(struct rig *r, uint32_t count, bool coherent);

struct rig_hit {
    bool hit, near_edge; // near_edge: the nearest or a miss passes within rounding of an edge
    double t;
};
// The nearest of all triangles of the scene.
struct rig_hit rig_reference(const struct rig *r, const struct hg_gpu_ray *ray);
// World position of a hit by its draw, primitive and barycentrics.
void rig_position(const struct rig *r, const struct hg_gpu_hit *hit, double out[3]);
// Compares a wave with the reference; returns how many rays near an edge came out otherwise.
uint32_t rig_compare(struct rig *r, uint32_t count, bool coherent);

// The backend that the only argument names; HG_TRACE_AUTO: none does.
enum hg_trace_backend rig_backend(int argc, char **argv);
bool rig_has_ray_query(void); // of the device that tests run on

#endif
