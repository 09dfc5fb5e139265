// build.h - the state of a bake, between levels (bake.c) and chunks (chunks.c).
// Floor 2, private to geometry/.
#ifndef HG_RENDERER_LOD_BUILD_H
#define HG_RENDERER_LOD_BUILD_H

#include "renderer/lod/internal.h"

#define HG_LOD_BATCH 256u // groups or chunks between two calls of the progress function

struct hg_lod_held {     // a group that waits for its chunk
    uint32_t *triangles; // [triangle_count * 3] vertices, then the triangles of each cluster
    uint32_t triangle_count, cluster_count;
};

// The clusters that make up the surface at one level, and the groups that they are in.
struct hg_lod_surface {
    struct hg_lod_pieces pool;
    uint32_t *group_of, *members, *first; // of the pool: groups and who is in them
    size_t capacity;                      // of these three
    uint32_t group_count;
    struct hg_lod_group_job *jobs; // [group_count]
};

// Positions that more than one group has stay where they are.
struct hg_lod_borders {
    uint8_t *locked, *open; // [position_count]
    uint32_t *owner;        // [position_count] owner_base + the group that had it last
    uint32_t owner_base;    // of this level, > 0
};

// What is finished, in the order of building.
struct hg_lod_built {
    struct hg_lod_cluster *clusters;
    struct hg_lod_group *groups;
    struct hg_lod_chunk *chunks;
    size_t cluster_capacity, group_capacity, chunk_capacity;
    uint32_t cluster_count, group_count, chunk_count;
    struct hg_writer bytes; // of the chunks
};

// Groups of the coarse levels that wait to be put into chunks together: the last that were built.
// Their chunks come last, coarse to fine, from number first_chunk on.
struct hg_lod_holding {
    struct hg_lod_held *groups;
    size_t capacity;
    uint32_t count, first_chunk;
    bool active; // from this level on
};

struct hg_lod_build {
    const struct hg_lod_params *params;
    struct hg_error *err;
    struct hg_lod_budget budget;
    struct hg_lod_mesh mesh;
    struct hg_lod_report report;
    struct hg_lod_borders borders;
    struct hg_lod_surface surface;
    struct hg_lod_built built;
    struct hg_lod_holding held;
    float min[3], max[3]; // of the discs of points
    uint32_t level;
    uint64_t done, total; // triangles simplified
};

// All levels of a part of points, in place of welding, grouping and simplifying.
enum hg_status hg_lod_build_points(
    struct hg_lod_build *b, const struct hg_mesh_part *part, uint32_t *root_chunks) HG_MUST_CHECK;

// Calls fn for all of [0, count), on the threads of the bake.
void hg_lod_build_each(const struct hg_lod_build *b, size_t count, hg_jobs_fn *fn, void *user);
// Reports progress. HG_E_CANCELLED.
enum hg_status hg_lod_build_tell(struct hg_lod_build *b) HG_MUST_CHECK;

// Decoded bytes of a group, not counting vertices that its clusters share.
uint32_t hg_lod_group_bytes(const struct hg_lod_build *b, const struct hg_lod_group_job *job);
// Encodes the listed jobs, whose groups were added from number `first_group` on.
enum hg_status hg_lod_encode_groups(struct hg_lod_build *b, const uint32_t *jobs, uint32_t count,
    uint32_t first_group) HG_MUST_CHECK;
// Keeps the triangles of a job whose group was added last. HG_E_NOMEM.
enum hg_status hg_lod_hold_group(
    struct hg_lod_build *b, const struct hg_lod_group_job *job) HG_MUST_CHECK;
void hg_lod_drop_held(struct hg_lod_build *b);
// Encodes what was held, as few chunks as it needs, and gives its groups the order of the file.
enum hg_status hg_lod_encode_held(struct hg_lod_build *b, uint32_t *root_chunks) HG_MUST_CHECK;
// The file: chunks and groups from coarse to fine.
enum hg_status hg_lod_assemble(
    struct hg_lod_build *b, uint32_t root_chunks, struct hg_writer *out) HG_MUST_CHECK;

#endif
