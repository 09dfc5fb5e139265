// graph.h - the frame graph: passes declare what they read and write, the graph does the rest.
// Between the device (gpu) and the passes. Thread: the render thread.
//
// Each frame declares its images, buffers and passes again, in any order that reads well:
//
//     hg_graph_begin(graph, width, height);
//     const uint32_t depth = hg_graph_image(graph, &(struct hg_graph_image_params){
//         .name = "depth", .format = VK_FORMAT_D32_SFLOAT});
//     const uint32_t picture = hg_graph_import(graph, "picture", &view->picture);
//     hg_graph_pass(graph, &(struct hg_graph_pass){.name = "visibility", .record = visibility,
//         .accesses = {{depth, HG_GRAPH_DEPTH}}});
//     hg_graph_pass(graph, &(struct hg_graph_pass){.name = "shading", .record = shade,
//         .accesses = {{depth, HG_GRAPH_SAMPLE}, {picture, HG_GRAPH_COLOR}}});
//     hg_graph_want(graph, picture);
//     status = hg_graph_compile(graph, err);            // nothing to do when it is as before
//     status = hg_graph_execute(graph, cmd, data, 0, err);
//
// The graph orders passes by what they need, leaves out those that nothing wanted depends on, puts
// transient images whose lifetimes do not overlap into the same memory, brings every image to the
// use that a pass declares (with its barriers), and times each pass under its name.
//
// Which write does a read see? The last one declared before it. When none is: of an imported or
// persistent image what was in it before the frame; of others, which hold nothing then, the first
// write declared after it. A pass that reads and writes (the _KEEP and UPDATE uses) sees the one
// before. Writes of one resource happen in the order of their declaration.
//
// Source: O'Donnell 2017, "FrameGraph: Extensible Rendering Architecture in Frostbite".
#ifndef HG_RENDERER_GRAPH_GRAPH_H
#define HG_RENDERER_GRAPH_GRAPH_H

#include "base/bytes.h"
#include "renderer/gpu/gpu.h"

#define HG_GRAPH_MAX_RESOURCES 128
#define HG_GRAPH_MAX_PASSES    256
#define HG_GRAPH_MAX_ACCESSES  12
#define HG_GRAPH_ALL_MIPS      UINT32_MAX // down to one texel

struct hg_graph;

// --- resources -----------------------------------------------------------------------------------
//
// A resource is known by a number of this frame's declarations; 0 is none, and accesses of it are
// ignored. Names are string literals: they tell resources apart from frame to frame.

enum hg_graph_life {
    HG_GRAPH_TRANSIENT,  // contents end with the execution
    HG_GRAPH_PERSISTENT, // kept until the size or the declaration changes, or hg_graph_reset
    HG_GRAPH_HISTORY,    // two of them: this frame's, and last frame's by hg_graph_previous
};

enum hg_graph_size { // sides relative to the view, rounded up
    HG_GRAPH_FULL,
    HG_GRAPH_HALF,
    HG_GRAPH_QUARTER,
    HG_GRAPH_EIGHTH,
    HG_GRAPH_ABSOLUTE, // width and height of the parameters
};

struct hg_graph_image_params {
    const char *name;
    VkFormat format;
    enum hg_graph_life life;
    enum hg_graph_size size;
    uint32_t width, height;       // of HG_GRAPH_ABSOLUTE
    uint32_t depth, layers, mips; // depth > 0: a 3D image; layers > 1: an array; mips: 0 = 1
};

// --- passes --------------------------------------------------------------------------------------

enum hg_graph_how {
    HG_GRAPH_SAMPLE,     // through a sampler
    HG_GRAPH_LOAD,       // storage image, read
    HG_GRAPH_STORE,      // storage image, all of it is written
    HG_GRAPH_UPDATE,     // storage image, read and written, or parts of it written
    HG_GRAPH_COLOR,      // attachment, all of it is written
    HG_GRAPH_COLOR_KEEP, // attachment, blended with what is there
    HG_GRAPH_DEPTH,      // attachment, cleared first
    HG_GRAPH_DEPTH_KEEP, // attachment, tested and written
    HG_GRAPH_DEPTH_TEST, // attachment, tested only
    HG_GRAPH_COPY_FROM,  // source of a transfer
    HG_GRAPH_COPY_TO,    // target of a transfer, all of it
    HG_GRAPH_READ,       // of buffers
    HG_GRAPH_WRITE,
    HG_GRAPH_READ_WRITE,
};

struct hg_graph_access {
    uint32_t resource;
    enum hg_graph_how how;
    uint32_t mip_plus_one; // one mip; 0 = all of them
};

// What a pass is recorded with.
struct hg_graph_run {
    struct hg_graph *graph;
    struct hg_gpu *gpu;
    struct hg_gpu_cmd *cmd;
    void *data;          // of hg_graph_execute
    uint32_t pass;       // for hg_graph_run_image
    uint32_t repetition; // of hg_graph_execute
};

typedef enum hg_status hg_graph_record(
    const struct hg_graph_run *run, void *user, struct hg_error *err);

struct hg_graph_pass {
    const char *name;        // of its stage too
    hg_graph_record *record; // between barriers, outside rendering
    void *user;
    struct hg_graph_access accesses[HG_GRAPH_MAX_ACCESSES];
    bool keep;    // does something besides writing resources: never left out
    bool once;    // in repetition 0 only
    bool untimed; // begins and ends stages itself, or none
};

// --- one frame -----------------------------------------------------------------------------------

// HG_E_NOMEM.
enum hg_status hg_graph_create(
    struct hg_gpu *gpu, struct hg_graph **out, struct hg_error *err) HG_MUST_CHECK;
void hg_graph_destroy(struct hg_graph *graph); // retires its images; accepts NULL

// Forgets the declarations of the frame before. Size of the view in px, >= 1.
void hg_graph_begin(struct hg_graph *graph, uint32_t width, uint32_t height);
uint32_t hg_graph_image(struct hg_graph *graph, const struct hg_graph_image_params *params);
// Last frame's contents of a HG_GRAPH_HISTORY image: to read. Zeros where there are none.
uint32_t hg_graph_previous(struct hg_graph *graph, uint32_t image);
// Of the caller; alive until the batch is over. NULL: none (0).
uint32_t hg_graph_import(struct hg_graph *graph, const char *name, struct hg_gpu_image *image);
// Buffers of the caller that passes reach by address, together under one name: for their order.
uint32_t hg_graph_buffer(struct hg_graph *graph, const char *name);
void hg_graph_pass(struct hg_graph *graph, const struct hg_graph_pass *pass);
// The image is read outside of the graph after execution.
void hg_graph_want(struct hg_graph *graph, uint32_t resource);

// Orders and places everything; keeps what an equal declaration came to before.
// HG_E_INVAL: passes wait for each other, nothing writes what a pass reads, too much is declared
// (err names pass and resource); HG_E_LIMIT, HG_E_NOMEM, device errors: images.
enum hg_status hg_graph_compile(struct hg_graph *graph, struct hg_error *err) HG_MUST_CHECK;
// Records all passes. Repetitions (samples of a frame) follow each other in one batch; transient
// contents end with each. The first error of a pass.
enum hg_status hg_graph_execute(struct hg_graph *graph, struct hg_gpu_cmd *cmd, void *data,
    uint32_t repetition, struct hg_error *err) HG_MUST_CHECK;
// The frame is over: what history images hold becomes last frame's. Of those not written it stays.
void hg_graph_advance(struct hg_graph *graph);
// Invalidates persistent and history images (a camera cut, an error).
void hg_graph_reset(struct hg_graph *graph);

// --- inside and after ----------------------------------------------------------------------------

// The image of a resource that the pass has declared.
struct hg_gpu_image *hg_graph_run_image(const struct hg_graph_run *run, uint32_t resource);
// After compiling: a persistent image; this frame's of a history.
struct hg_gpu_image *hg_graph_get_image(struct hg_graph *graph, uint32_t resource);
// A persistent image holds what an earlier execution wrote; of hg_graph_previous: there is a frame
// before.
bool hg_graph_has_content(const struct hg_graph *graph, uint32_t resource);

struct hg_graph_stats {
    uint32_t passes, passes_left_out;
    uint32_t transient_images;
    uint64_t transient_bytes; // as placed
    uint64_t unshared_bytes;  // the same images without sharing
    uint64_t compilations;    // since creation
};
void hg_graph_stats(const struct hg_graph *graph, struct hg_graph_stats *out);
// Where a compiled transient image lies; false when it is none or was left out.
struct hg_graph_place {
    uint64_t offset, size_bytes;
    uint32_t first, last; // places in the order of passes
};
bool hg_graph_place(const struct hg_graph *graph, uint32_t resource, struct hg_graph_place *out);
// Names of the passes in the order of their execution; NULL past the last.
const char *hg_graph_pass_name(const struct hg_graph *graph, uint32_t place);

enum hg_graph_format { HG_GRAPH_TEXT, HG_GRAPH_MERMAID, HG_GRAPH_DOT };
// The compiled graph for people. out->failed when there is no memory.
void hg_graph_print(
    const struct hg_graph *graph, enum hg_graph_format format, struct hg_writer *out);

#endif
