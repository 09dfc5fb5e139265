// cluster.h - clustered lights: lists of the lights that reach each froxel.
// Floor 2 (light). Thread: the render thread.
//
// Cells are tiles of the image times slices that grow exponentially with depth.
// Source: Olsson, Billeter and Assarsson 2012, "Clustered Deferred and Forward Shading".
#ifndef HG_RENDERER_LIGHT_CLUSTER_H
#define HG_RENDERER_LIGHT_CLUSTER_H

#include "renderer/light/lights.h"
#include "shaders/shared/frame.h"

#define HG_CLUSTER_X           16
#define HG_CLUSTER_Y           9
#define HG_CLUSTER_Z           24
#define HG_CLUSTER_COUNT       (HG_CLUSTER_X * HG_CLUSTER_Y * HG_CLUSTER_Z)
#define HG_CLUSTER_MIN_LIGHTS  8          // with fewer, looping over all is quicker
#define HG_CLUSTER_MOST_MEAN    32         // entries of a cell, in the mean; lamps that reach all
#define HG_CLUSTER_MOST_ENTRIES (HG_CLUSTER_MOST_MEAN * HG_CLUSTER_COUNT)

// Slice of a depth along the view: log2(depth) * z_scale + z_bias.
struct hg_cluster_slices {
    float z_scale, z_bias;
};

// Zero-initialise.
struct hg_clusters {
    bool used;
    bool overflow; // lists, or the lamps that reach all, would be too long: see light_cut.h
    float z_scale, z_bias;
    uint32_t first[HG_CLUSTER_COUNT + 1];
    uint32_t *entries; // ascending light numbers per cell
    size_t capacity;
    uint32_t entry_count;
};

// Every light with a range is in every cell that its sphere touches (a pixel's margin included, so
// that jitter does not matter): pixels come out the same with and without clusters. HG_E_NOMEM.
enum hg_status hg_clusters_build(struct hg_clusters *clusters, const struct hg_light_set *lights,
    const struct hg_gpu_camera *camera, uint32_t width, uint32_t height) HG_MUST_CHECK;
// Slices from a thousandth of `far`, metres, to all of it.
struct hg_cluster_slices hg_cluster_slices_make(const struct hg_gpu_camera *camera, float far);
// Depth at which slice k begins, were it not the first, which begins at the eye.
float hg_cluster_slice_depth(const struct hg_cluster_slices *slices, int k);
void hg_clusters_finish(struct hg_clusters *clusters); // accepts a zeroed one

#endif
