// rig.h - small scenes from arrays and their pixels through the whole renderer.
// Failures end the test with the reason.
#ifndef HG_TESTS_ANALYTIC_RIG_H
#define HG_TESTS_ANALYTIC_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "renderer/renderer.h"
#include "tests/support/check.h"

struct rig {
    struct hg_renderer *renderer;
    struct hg_scene *scene; // of one test
    uint64_t next_id;
};

void rig_init(struct rig *rig);
void rig_finish(struct rig *rig);
// Who walks the rays of a view that does not say so: with RIG_TRACE=device in the environment the
// device, by ray queries where it has them, by compute shaders where not.
enum hg_view_trace rig_trace(const struct rig *rig, enum hg_view_trace asked);
// The same as fixtures of a group: *state is the rig.
int rig_set_up(void **state);
int rig_tear_down(void **state);
void rig_scene(struct rig *rig); // a new, empty scene in place of the one before

// A new object of the scene.
void *rig_object(struct rig *rig, enum hg_object_kind kind);
// White, rough and not metallic.
struct hg_material *rig_material(struct rig *rig);
// A node with a mesh of one part: copies of all arrays.
struct rig_vertices {
    uint32_t count;
    const float *positions, *normals; // [count * 3]
};
struct hg_node *rig_mesh(struct rig *rig, struct hg_material *material,
    const struct rig_vertices *vertices, uint32_t indices, const uint32_t *index);
// Two triangles between four corners, counter-clockwise; uv 0 0, 1 0, 1 1, 0 1.
struct hg_node *rig_quad(struct rig *rig, struct hg_material *material, const float corners[4][3]);
// Bars, every second of eight columns; the others are holes.
struct hg_texture *rig_bars(struct rig *rig);
// The plane y = 0, 18 m wide, facing up.
struct hg_node *rig_plane(struct rig *rig, struct hg_material *material);
// A face of a box seen from inside (side 1) or outside (-1): across axis which / 2, at its low or
// high (which % 2) end.
struct hg_node *rig_face(
    struct rig *rig, struct hg_material *material, const float box[2][3], int side, int which);
// `rings` from pole to pole, twice as many segments.
struct hg_node *rig_sphere(
    struct rig *rig, struct hg_material *material, const float center[3], float radius, int rings);
// At a place, shining along a direction; white, of intensity 1, no shadows.
struct hg_light *rig_light(
    struct rig *rig, unsigned kind, const double at[3], const double direction[3]);
struct hg_node *rig_node_of(struct rig *rig, const struct hg_light *light);

struct rig_camera {
    double eye[3], target[3], vfov_rad;
    uint32_t width, height, samples, seed;
    enum hg_render_mode mode; // PATH: box filter
    uint32_t max_bounces;
    enum hg_view_gi gi; // REALTIME
};

// Settled linear pixels, 4 floats each, from the top; free with hg_refbuf_unref.
struct hg_refbuf *rig_render(struct rig *rig, const struct rig_camera *camera);
// Ray through a place of the image in px, unit length; up is +y, or -z when looking down.
void rig_ray(const struct rig_camera *camera, double x, double y, double direction[3]);

#endif
