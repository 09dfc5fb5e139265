// internal.h - what the files of renderer/graph/ share. Private to this room.
//
//   declare.c  what a frame says          compile.c  order, what is left out, lifetimes
//   place.c    memory and images          execute.c  barriers, stages, history
//   print.c    pictures of it
#ifndef HG_RENDERER_GRAPH_INTERNAL_H
#define HG_RENDERER_GRAPH_INTERNAL_H

#include "renderer/graph/graph.h"

#define HG_GRAPH_PLANS 4 // kept: frames in motion, at rest, with a debug view, ...
#define HG_GRAPH_NONE  UINT32_MAX
#define HG_GRAPH_KEEP  256 // frames for which an image is kept that none of them declares

enum hg_graph_kind { HG_GRAPH_OWN, HG_GRAPH_PREVIOUS, HG_GRAPH_IMPORT, HG_GRAPH_BUFFER };

// Declarations are compared as bytes: they are cleared before they are filled in.
struct hg_graph_resource {
    const char *name;
    enum hg_graph_kind kind;
    enum hg_graph_life life;
    VkFormat format;
    uint32_t width, height, depth, layers, mips; // px; depth 0: not 3D
    uint32_t current;                            // HG_GRAPH_PREVIOUS: whose history it is (index)
    bool wanted;
};

struct hg_graph_use { // one access
    uint8_t resource; // index
    uint8_t how;      // enum hg_graph_how
    uint8_t mip_plus_one, reserved;
};

struct hg_graph_node { // one pass
    const char *name;
    struct hg_graph_use uses[HG_GRAPH_MAX_ACCESSES];
    uint8_t use_count;
    bool keep, once, untimed;
    uint8_t reserved[4];
};

struct hg_graph_frame { // what was declared
    uint32_t width, height, resource_count, node_count;
    struct hg_graph_resource resources[HG_GRAPH_MAX_RESOURCES];
    struct hg_graph_node nodes[HG_GRAPH_MAX_PASSES];
};

// What one transient image came to.
struct hg_graph_slot {
    struct hg_gpu_image image; // zeroed: not transient, or left out
    struct hg_gpu_image_need need;
    uint64_t offset;
    uint32_t first, last; // places in the order
    bool alone;           // memory of its own: nothing can share it
};

// What one set of declarations came to.
struct hg_graph_plan {
    uint32_t width, height, resource_count, node_count;
    struct hg_graph_resource *resources; // copies of what was declared
    struct hg_graph_node *nodes;
    struct hg_graph_slot *slots; // [resource_count]
    uint32_t *order;             // [order_count] passes
    uint32_t order_count;
    uint64_t heap_bytes, unshared_bytes, used; // used: number of the newest frame
};

// A persistent image or a history, by the name of its declaration.
struct hg_graph_store {
    struct hg_graph_resource declared;
    struct hg_gpu_image images[2]; // [1]: of histories
    VkImageUsageFlags usage;
    uint32_t current; // of `images`: this frame's
    bool content[2];  // something was written to it
    bool clear[2];    // it is to be cleared before it is read
    bool written;     // in this frame
    uint64_t used;    // number of the newest frame that declared it
};

struct hg_graph {
    struct hg_gpu *gpu;
    struct hg_graph_frame *frame;
    hg_graph_record **records; // by pass of the frame
    void **users;
    struct hg_gpu_image **imports; // by resource of the frame
    struct hg_error refused;       // what declaring found wrong first
    bool is_refused;
    uint64_t number;                                   // of frames
    uint32_t width, height;                            // of the newest compilation
    struct hg_graph_plan plans[HG_GRAPH_PLANS], *plan; // plan: of this frame; NULL: not compiled
    struct hg_gpu_memory heap;
    struct hg_gpu_image_need heap_need;
    struct hg_graph_store *stores;
    size_t store_capacity;
    uint32_t store_count;
    uint64_t compilations;
    // What buffers were used for since the last barrier.
    bool buffer_read[HG_GRAPH_MAX_RESOURCES], buffer_written[HG_GRAPH_MAX_RESOURCES];
};

struct hg_graph_meaning { // of an enum hg_graph_how
    enum hg_gpu_use use;
    bool reads, writes, buffer;
    VkImageUsageFlags needs; // of the image besides sampling and transfers
    const char *name;
};
extern const struct hg_graph_meaning hg_graph_meanings[];

// place.c
enum hg_status hg_graph_place_all(
    struct hg_graph *graph, struct hg_graph_plan *plan, struct hg_error *err) HG_MUST_CHECK;
void hg_graph_drop_images(struct hg_graph *graph, struct hg_graph_plan *plan);
enum hg_status hg_graph_make_stores(
    struct hg_graph *graph, const struct hg_graph_plan *plan, struct hg_error *err) HG_MUST_CHECK;
struct hg_graph_store *hg_graph_find_store(const struct hg_graph *graph, const char *name);
void hg_graph_drop_old_stores(struct hg_graph *graph);
void hg_graph_drop_store(struct hg_graph *graph, struct hg_graph_store *store);

#endif
