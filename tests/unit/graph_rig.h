// graph_rig.h - a device and a graph, and passes that clear, add and copy: for tests of the graph.
#ifndef HG_TESTS_UNIT_GRAPH_RIG_H
#define HG_TESTS_UNIT_GRAPH_RIG_H

#include "renderer/gpu/io.h"
#include "renderer/graph/graph.h"

struct graph_rig {
    struct hg_gpu *gpu;
    struct hg_graph *graph;
    struct hg_gpu_buffer back; // readback
    struct hg_error err;
};

int graph_rig_setup(void **state);    // with validation
int graph_rig_teardown(void **state); // fails when there were validation messages
void graph_rig_ok(struct graph_rig *r, enum hg_status status);
// Compiles and executes in a batch of its own, waits. The last status.
enum hg_status graph_rig_try(struct graph_rig *r);
void graph_rig_run(struct graph_rig *r); // must work
// Texel 0 of a R32F image of the caller.
float graph_rig_texel(struct graph_rig *r, struct hg_gpu_image *image);

// A pass that fills a R32F image with a number (an attachment).
struct graph_clear {
    uint32_t target;
    float value;
};
void graph_rig_clear(struct graph_rig *r, const char *name, const struct graph_clear *clear);
// target = 0.1 * first + second, by a full-screen triangle.
struct graph_blend {
    uint32_t first, second, target;
};
void graph_rig_blend(struct graph_rig *r, const char *name, const struct graph_blend *blend);
// A R32F image of the view's size.
uint32_t graph_rig_image(struct graph_rig *r, const char *name, enum hg_graph_life life);
struct hg_gpu_image graph_rig_outside(struct graph_rig *r, const char *name, uint32_t side);

#endif
