// render_rig.h - a renderer, a scene and one view of it, for tests of whole pictures.
// Failures end the test with the reason.
#ifndef HG_TESTS_UNIT_RENDER_RIG_H
#define HG_TESTS_UNIT_RENDER_RIG_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "renderer/renderer.h"
#include "tests/support/check.h"

struct rig {
    struct hg_renderer *renderer;
    struct hg_scene *scene;
    struct hg_view *view;
    struct hg_error err;
};

#define PANES TEST_MODELS "/panes.glb" // every alpha mode, lights, glass
#define KNOT  TEST_MODELS "/knot/knot.gltf"
#define WORM  TEST_MODELS "/worm.glb"
#define MORPH TEST_MODELS "/morph.glb"

// A renderer; no scene, no view.
void rig_open_with(struct rig *rig, const struct hg_renderer_params *params);
void rig_open(struct rig *rig, bool validation); // two threads
struct hg_view_report rig_report(const struct rig *rig); // renderer/internal.h
// Also that validation had nothing to say, where it is on.
void rig_close(struct rig *rig);
// A view of rig->scene.
void rig_view(struct rig *rig, const struct hg_view_params *params);
// The same of a scene that is the rig's from now on.
void rig_use_scene(struct rig *rig, struct hg_scene *scene, const struct hg_view_params *params);
void rig_close_scene(struct rig *rig); // and its view
// All of the scene, from a place turned about it by so many radians.
void rig_look_at_scene(struct rig *rig, float turn);
struct hg_frame_info rig_step(struct rig *rig, uint32_t samples);
// Steps of so many samples until the picture is settled, however long what is streamed takes.
struct hg_frame_info rig_settle(struct rig *rig, uint32_t samples);
// Of the newest picture; free with hg_refbuf_unref.
struct hg_refbuf *rig_pixels(struct rig *rig, enum hg_pixel_format format);
// RGBA32F, bit by bit; the test ends with the number of pixels that differ.
void rig_assert_same(const struct hg_refbuf *a, const struct hg_refbuf *b);
// RGBA32F: mean over the channels of |b - a|.
double rig_difference(const struct hg_refbuf *a, const struct hg_refbuf *b);

struct hg_scene *rig_new_scene(void);
// An asset in a grey environment, and a sun with id 7.
struct hg_scene *rig_load(const char *path, struct hg_jobs *jobs);
void *rig_add(struct hg_scene *scene, enum hg_object_kind kind, uint64_t id);
// Of the allocator that meshes free their arrays with.
void *rig_copy(const void *data, size_t size);
// The only part of a mesh: triangles, nothing but what is given; [vertices * 3], [indices].
struct hg_mesh_part *rig_part(struct hg_mesh *mesh, uint32_t vertices, const float *positions,
    const float *normals, uint32_t indices, const uint32_t *index);
// An unlit square at height z, looking along +z, with an id for its node, mesh and material; an
// alpha below 1 blends.
struct hg_node *rig_quad(
    struct hg_scene *scene, uint64_t id, float half, float z, const float color[4]);
// A shadow-casting sun of 2 lux, turned about the x axis; its light and node are number id.
void rig_sun(struct hg_scene *scene, uint64_t id, float sin_half, float cos_half);
// An environment of one colour.
void rig_environment(struct hg_scene *scene, float red, float green, float blue);

#endif
