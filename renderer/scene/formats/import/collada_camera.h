// collada_camera.h - the optics of a Collada document's cameras, which assimp 5.2 does not read.
// Floor 2, private to scene/. One document on one thread.
// Source: Collada 1.4.1 specification, <camera>, <optics>, <perspective>, <orthographic>.
#ifndef HG_RENDERER_SCENE_FORMATS_IMPORT_COLLADA_CAMERA_H
#define HG_RENDERER_SCENE_FORMATS_IMPORT_COLLADA_CAMERA_H

#include "renderer/scene/formats/text_scan.h"

enum { HG_COLLADA_CAMERAS_MAX = 4096 };

// Values that the file does not state are 0. They are finite and not negative.
struct hg_collada_optics {
    bool orthographic;
    double x, y;      // whole angles, degrees (xfov, yfov); half the sides, units (xmag, ymag)
    double aspect;    // width / height
    double near, far; // units
};

struct hg_collada_camera {
    struct hg_text id;
    struct hg_collada_optics optics;
};

// An <instance_camera>: `node` is the id of the node that holds it, else its sid, else empty.
struct hg_collada_camera_use {
    struct hg_text node, camera;
    bool taken;
};

// Views of the text, which has to outlive this.
struct hg_collada_cameras {
    struct hg_collada_camera *cameras;  // [camera_count]
    struct hg_collada_camera_use *uses; // [use_count]
    uint32_t camera_count, use_count;   // at most HG_COLLADA_CAMERAS_MAX; more are not kept
    double unit_m;                      // metres per unit, 1 unless stated
};

// Reads the elements of `text`, as hg_collada_clean left it, in one pass. Tags that do not end and
// nodes that are not closed end or cut what is found. False: no memory, and nothing is kept.
bool hg_collada_read_cameras(struct hg_text text, struct hg_collada_cameras *out);
void hg_collada_cameras_finish(struct hg_collada_cameras *cameras);

// The optics of the next camera that a node of this name holds, in the order of the document. A
// name that no node has stands for nodes without one. NULL: there is none.
const struct hg_collada_optics *hg_collada_next_camera(
    struct hg_collada_cameras *cameras, const char *node);

// Vertical angle (radians) of a perspective camera, and its aspect ratio, 0 unless stated. Where
// only the horizontal angle is known `aspect_else` is the picture's. False: no angle is stated, or
// none that a camera can have.
bool hg_collada_vertical_angle(
    const struct hg_collada_optics *optics, double aspect_else, float *vfov_rad, float *aspect);
// Half the height of what an orthographic camera sees, in metres, likewise.
bool hg_collada_half_height(const struct hg_collada_optics *optics, double unit_m,
    double aspect_else, float *half_height, float *aspect);

#endif
