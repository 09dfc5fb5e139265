// encode_depth.h - how far the surfaces of a frame are, for clients that reproject it.
// Floor 6, private to server/worker. Thread: the grid belongs to one thread at a time.
//
// A grid of equal cells of about 4 x 4 px, quantised to 12 bits between the nearest and the
// farthest one: docs/protocol.md has the format. Perspective frames have 1 / depth, which is affine
// over the picture of a plane, orthographic ones the depth, which is that there.
#ifndef HG_SERVER_WORKER_ENCODE_ENCODE_DEPTH_H
#define HG_SERVER_WORKER_ENCODE_ENCODE_DEPTH_H

#include <stdbool.h>
#include <stdint.h>

#include "base/bytes.h"
#include "base/status.h"

enum { HG_DEPTH_CELL_PX = 4, HG_DEPTH_STEPS = 4094 };

struct hg_depth_grid {
    uint32_t columns, rows;
    bool orthographic;
    float *depths;    // [rows][columns] at the centres, along the view, metres; infinite: none
    uint64_t read_ns; // how long reading them took
};

// For a picture of that size, px; the caller fills in the depths. HG_E_NOMEM.
enum hg_status hg_depth_grid_create(uint32_t width, uint32_t height, bool orthographic,
    struct hg_depth_grid **out, struct hg_error *err) HG_MUST_CHECK;
void hg_depth_grid_destroy(struct hg_depth_grid *grid); // accepts NULL
// The data of the frame's `depth`. HG_E_NOMEM.
enum hg_status hg_depth_encode(
    const struct hg_depth_grid *grid, struct hg_writer *out, struct hg_error *err) HG_MUST_CHECK;

#endif
