// demo_build.h - materials, meshes and nodes of the demo scene, as short calls.
// Floor 2, private to the demo. The first failure sticks; later calls do nothing and may return
// NULL, which all of them accept.
#ifndef HG_RENDERER_SCENE_DEMO_DEMO_BUILD_H
#define HG_RENDERER_SCENE_DEMO_DEMO_BUILD_H

#include "renderer/scene/asset.h"
#include "renderer/scene/demo/demo_shapes.h"
#include "renderer/scene/demo/demo_textures.h"

struct hg_demo {
    struct hg_asset *asset;
    struct hg_jobs *jobs;
    enum hg_status status; // first failure
    struct hg_demo_textures {
        struct hg_texture *color, *normal, *orm;
    } sets[HG_DEMO_PATTERNS];
};

struct hg_demo_material {
    const char *name;
    float color[3]; // linear
    float metallic, roughness;
    int set;      // HG_DEMO_*, or -1: no textures
    float metres; // that one texture covers
    float normal_scale;
};

void hg_demo_draw_sets(struct hg_demo *d);
struct hg_material *hg_demo_material(struct hg_demo *d, const struct hg_demo_material *params);
// Takes the shape; makes tangents where the material has a normal map.
struct hg_mesh *hg_demo_mesh(
    struct hg_demo *d, const char *name, struct hg_shape *shape, struct hg_material *material);
// A node at a place, turned about +Y by yaw degrees; parent NULL = a root.
struct hg_node *hg_demo_node(struct hg_demo *d, struct hg_node *parent, const char *name,
    struct hg_mesh *mesh, const float place[3], float yaw_deg);
// Points the node's -Z at a target given in its parent's space (cameras and lights).
void hg_demo_aim(struct hg_node *node, const float target[3]);
// Turns the node once about an axis in `period_s`, from its present rotation, for `length_s`.
void hg_demo_spin(struct hg_demo *d, struct hg_animation *animation, struct hg_node *node,
    const float axis[3], float period_s, float length_s);

#endif
