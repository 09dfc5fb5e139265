// emitters_rig.h - small scenes of lights for next-event sampling (lib/emitters.glsl): made by
// hand, sampled on the device, and held against closed forms and sums over all lights. Test
// support.
#ifndef HG_TESTS_ANALYTIC_EMITTERS_RIG_H
#define HG_TESTS_ANALYTIC_EMITTERS_RIG_H

#include "tests/analytic/probe.h"

#include "renderer/light/emitters/emitters.h"

#define PI    3.14159265358979323846
#define PICKS 64 // per invocation

enum op { OP_ESTIMATE, OP_ONE, OP_UNIFORM, OP_CHANCE, OP_ENVIRONMENT };

// One emissive mesh, by hand: a draw, an instance, a part and a material each.
struct mesh {
    uint32_t vertices, triangles;
    float *positions;
    uint32_t *indices;
    struct hg_material material;
    struct hg_ray_geometry_piece piece;
    struct hg_gpu_buffer buffers[3]; // positions, vertices, indices
};

#define MOST_MESHES 4
struct rig {
    struct probe probe;
    struct hg_emitters *emitters;
    struct mesh meshes[MOST_MESHES];
    uint32_t mesh_count;
    struct hg_gpu_buffer draws, instances, parts, materials;
    struct hg_gpu_emitters block;
    uint64_t next_id, budget_bytes;
    struct hg_geometry *geometry; // of test_textured alone, in place of tables by hand
    struct hg_textures *textures;
};

struct estimate {
    double mean, sigma; // of one sample
    double error;       // one standard deviation of the mean
    double bad, work;   // samples that are no numbers; nodes looked at per sample
};

extern const float up[3], everywhere[3];

// One device for all tests of a program, a new scene for each.
int rig_setup(void **state);
int rig_teardown(void **state);
void rig_open(struct rig *r);
void rig_close(struct rig *r);
void *rig_add(struct rig *r, enum hg_object_kind kind); // to the scene
struct hg_light *rig_add_light(
    struct rig *r, unsigned kind, float x, float y, float z, float intensity);
struct mesh *rig_add_mesh(struct rig *r, uint32_t vertices, uint32_t triangles, float radiance);
// Faces down (-y) at a height over the origin; so many squares a side.
struct mesh *rig_add_ceiling(struct rig *r, const float center[3], float half_x, float half_z,
    uint32_t squares, float radiance);
struct mesh *rig_add_sphere(
    struct rig *r, const float center[3], float radius, uint32_t rings, float radiance);
struct hg_emitters_stats rig_sync(struct rig *r);
// out: one vec4 per invocation, two of OP_ONE.
void rig_run(
    struct rig *r, enum op op, uint32_t count, const struct hg_vec4 *in, struct hg_vec4 *out);
struct estimate rig_estimate_as(
    struct rig *r, enum op op, const float p[3], const float n[3], uint32_t threads);
struct estimate rig_estimate(struct rig *r, const float p[3], const float n[3]);
// Within four standard deviations, which must be small, and a share for rounding.
void rig_expect(const char *what, struct estimate e, double expected, double most_noise);
// Closed forms and sums: irradiance at p on a surface with normal n.
double rig_polygon(const double (*v)[3], int count, const float p[3], const float n[3]);
double rig_all_triangles(const struct rig *r, const float p[3], const float n[3]);
double rig_all_lights(struct rig *r, const float p[3], const float n[3]);
float rig_random(uint32_t *state);
void rig_add_lights(struct rig *r, uint32_t count, float side, float range);
// An environment with a small square sun.
void rig_set_image(struct rig *r, uint32_t width, float sun, float sky);

#endif
