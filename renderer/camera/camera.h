// camera.h - camera parameters to the matrices and rays of shaders/shared/frame.h; the pattern of
// samples inside a pixel.
// Floor 1. Pure functions, any thread.
#ifndef HG_RENDERER_CAMERA_CAMERA_H
#define HG_RENDERER_CAMERA_CAMERA_H

#include <stdbool.h>

#include "base/status.h"
#include "shaders/shared/frame.h"

#define HG_CAMERA_DEFAULT_VFOV_RAD 0.7853981633974483f

// In scene space; jitter and near and far are filled in by each step.
struct hg_view_camera_state {
    double eye[3], target[3], up[3];
    bool orthographic;
    float vfov_rad, half_height, near, far;
    float lens_radius, focus_distance; // metres; 0 = no lens, at the target
    uint64_t input_seq;
    uint64_t node;                                  // that it was taken from; 0 = none
    bool moves;                                     // a frame later it stands
    double next_eye[3], next_target[3], next_up[3]; // here; at other times on the line
};

// The part of a picture that is read, px from the top left corner. All else (camera, levels of
// detail, shadow maps, sample pattern) is that of the whole picture, so its pixels are those of the
// whole picture, too. width 0: all of it.
struct hg_picture_region {
    uint32_t x, y, width, height;
};

struct hg_camera_setup {
    double eye[3], target[3], up[3]; // relative to the origin of the geometry room, metres
    bool orthographic;
    float vfov_rad, half_height; // vertical
    float near, far;             // metres; far 0 = infinite (orthographic: must be > near)
    uint32_t width, height;      // px
    double aspect;               // of the picture's sides; 0 = width / height, square pixels
    float jitter_px[2];          // sample position less the pixel centre
};

// Right-handed look-at, reversed depth. All of *out is written.
void hg_camera_fill(const struct hg_camera_setup *setup, struct hg_gpu_camera *out);

// Clip space of `from` (its jitter included) to that of `to`, column-major, for points that `moved`
// takes from one world to the other (NULL: both are the same): to * moved * inverse of from.
void hg_camera_reproject(const struct hg_camera_setup *from, const struct hg_camera_setup *to,
    const double moved[16], double out[16]);

// near and far where the caller gave none (0), so that everything in the bounds is in front of the
// camera and behind near. Perspective: near is a small part of the scene, amid which it is 1 cm at
// most (reversed floating-point depth has the same relative precision everywhere); orthographic:
// the slab that holds the bounds.
void hg_camera_fit_depth(
    struct hg_camera_setup *setup, bool has_bounds, const float min[3], const float max[3]);

// Offset of sample `index` from the pixel centre in px. Sample 0 is the centre; the others follow
// the R2 sequence (Roberts 2018), shaped by importance sampling of a Blackman-Harris window of
// radius 1.5 px, so that all samples have the same weight ("filter importance sampling", Ernst et
// al. 2006; the window as in Cycles). Samples 2k - 1 and 2k mirror each other, so that the picture
// is not shifted. A seed shifts the sequence.
void hg_camera_jitter(uint32_t index, uint32_t seed, float out_px[2]);

#endif
