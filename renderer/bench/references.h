// references.h - pictures that others are held against, kept in a folder from run to run.
// Private to renderer/bench. Thread: one.
#ifndef HG_RENDERER_BENCH_REFERENCES_H
#define HG_RENDERER_BENCH_REFERENCES_H

#include "renderer/bench/walk.h"

struct hg_bench_references {      // of one walk under one light
    const char *folder;           // borrowed; NULL: nothing is kept
    uint8_t scene[32];            // fingerprint
    struct hg_view_params params; // that they are made with
    uint32_t found, made;
};

// The folder's pictures of the scene as it is now. HG_E_NOMEM; errors of reading its images.
enum hg_status hg_bench_references_begin(struct hg_bench_references *references,
    struct hg_scene *scene, const char *folder, const struct hg_view_params *params,
    struct hg_error *err) HG_MUST_CHECK;
// The settled picture of a pose as RGBA8: from the folder, where a file's name is the hash of the
// scene, the pose and the parameters, else it is made with the view and put there. HG_E_IO and
// errors of the renderer.
enum hg_status hg_bench_references_get(struct hg_bench_references *references,
    const struct hg_bench_walk *walk, struct hg_view *view, uint32_t pose, struct hg_refbuf **out,
    struct hg_error *err) HG_MUST_CHECK;
// An RGBA8 picture of the walk's size as a PNG file. HG_E_NOMEM, HG_E_IO.
enum hg_status hg_bench_picture_write(const struct hg_bench_walk *walk, const char *path,
    struct hg_refbuf *picture, struct hg_error *err) HG_MUST_CHECK;

#endif
