// geometry_device.h - a device, small scenes and cameras in double precision, for tests of
// geometry.
#ifndef HG_TESTS_GEOMETRY_DEVICE_H
#define HG_TESTS_GEOMETRY_DEVICE_H

#include "renderer/geometry/geometry_state.h"
#include "shaders/shared/frame.h"

#define TRIANGLES 40 // of a mesh
#define WIDTH     640
#define HEIGHT    360

struct geo {
    struct hg_gpu *gpu;
    struct hg_error err;
    uint32_t random;
    bool facets; // surface points come from facets, not from vertices
};
void geo_check(struct geo *f, enum hg_status status); // fails the test with what f->err says
double geo_random(struct geo *f, double low, double high);
int geo_setup(void **state);
int geo_teardown(void **state); // -1 when the validation layers said anything
void geo_submit(struct geo *f, struct hg_gpu_cmd *cmd);
// A sync and the batch that it belongs to.
void geo_sync(struct geo *f, struct hg_geometry *g, struct hg_scene *scene);

// A mesh of random triangles with all attributes.
struct hg_mesh *geo_add_mesh(struct geo *f, struct hg_scene *scene, uint64_t id);
struct hg_node *geo_add_node(
    struct geo *f, struct hg_scene *scene, uint64_t id, struct hg_mesh *mesh);
// World positions of the corners of a triangle and their indices.
void geo_corners(const struct hg_node *node, uint32_t triangle, double p[3][3], uint32_t i[3]);

struct geo_scene {
    struct hg_scene *scene;
    struct hg_geometry *geometry;
    struct hg_mesh *mesh;
    struct hg_node *nodes[2]; // the second is mirrored
};
struct geo_scene geo_make_scene(struct geo *f);
void geo_destroy_scene(struct geo_scene *s);

void geo_cross(const double a[3], const double b[3], double out[3]);
double geo_dot(const double a[3], const double b[3]);
void geo_normalize(double v[3]);

struct geo_eye {
    double position[3], right[3], up[3], back[3];
    double focal, aspect; // perspective
    bool orthographic;
    double half_height;
};
struct geo_eye geo_look_at(const double position[3], const double target[3], bool orthographic);
void geo_fill_camera(const struct geo_eye *e, const double origin[3], struct hg_gpu_camera *camera);
// Pixel of a point; false behind the eye or off the screen.
bool geo_project(const struct geo_eye *e, const double p[3], double pixel[2]);

#endif
