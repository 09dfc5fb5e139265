// lod.h - a mesh part as a hierarchy of clusters: baked once, stored compressed, streamed in
// chunks. Floor 2 (geometry). Pure: no device, no files; any thread. Lengths in metres of object
// space.
//
// A *cluster* has at most HG_LOD_CLUSTER_TRIANGLES triangles. A *group* is a handful of
// neighbouring clusters that were simplified together, to about half their triangles, with the
// border of the group locked; what came out was cut into clusters again, and those are clusters of
// groups one level up. So the clusters form a DAG, and every cut through it that keeps groups whole
// is free of cracks: all vertices lie on one lattice (`quantum`) and the border of a group is the
// same vertices before and after.
//
// Selection. Let use(G) say that the clusters of group G are fine enough to be looked at instead of
// the coarser ones that were made from G:
//     use(G) = G is terminal, or (G's chunk is resident and projected error of G > threshold)
//     projected error = error / max(distance(eye, center) - radius, near) * pixels per radian
// A cluster is drawn if and only if use(its group) and not use(the group it was made from);
// clusters of source triangles (`made_from` HG_LOD_NONE) only need use(its group). Errors grow and
// spheres contain each other on the way up, so use(G) implies use() of all G's `parents` (the
// groups that hold clusters made from G), and every spot of the surface is drawn exactly once,
// whatever the threshold and the eye. What is streamed must keep this: a chunk may be resident only
// while the chunks of all parents of its groups are. Chunks [0, root_chunk_count) hold the terminal
// groups (and some below them) and are to be resident always.
//
// Error of a group: no point of the source surface is farther from the surface made from this
// group (measured at sampled points of the source, quantisation included), or it belongs to a
// connected piece of the source that is nowhere wider than this; and normals, uvs and colours are
// off by no more than what a displacement of this size would do (weights below). Of clouds of
// points: the root mean square of how far the points were moved, summed over the levels.
//
// Source: Garland and Heckbert 1997, "Surface Simplification Using Quadric Error Metrics"; Hoppe
// 1999, "New Quadric Metric for Simplifying Meshes with Appearance Attributes"; Karis, Stubbe and
// Wihlidal 2021, "A Deep Dive into Nanite Virtualized Geometry" (the DAG of groups); Touma and
// Gotsman 1998, "Triangle Mesh Compression" (parallelogram prediction). See docs/internals/lod.md.
#ifndef HG_RENDERER_LOD_LOD_H
#define HG_RENDERER_LOD_LOD_H

#include "base/jobs.h"
#include "renderer/scene/scene.h"
#include "shaders/shared/geometry.h"

#define HG_LOD_VERSION           12u // grows when a part would bake to other bytes
#define HG_LOD_CLUSTER_TRIANGLES 128
#define HG_LOD_CLUSTER_VERTICES  256    // distinct vertices of one cluster
#define HG_LOD_GROUP_CLUSTERS    32     // clusters of one group, at most
#define HG_LOD_CHUNK_BYTES       131072 // decoded, at most: fits a slot of fixed size
#define HG_LOD_NODE_WIDTH        8      // children of a node, at most
#define HG_LOD_NONE              0xffffffffu

// ---- what a baked hierarchy says ----------------------------------------------------------------

struct hg_lod_cluster {
    float center[3], radius; // sphere around the triangles
    float extent[3];         // half sizes of their box around `center`
    // All triangles face away from the eye if
    // dot(center - eye, cone_axis) >= cone_cutoff * length(center - eye) + radius; cutoff 1: never.
    float cone_axis[3], cone_cutoff; // the axis is a little shorter than 1
    uint32_t group;                  // that it belongs to
    uint32_t made_from;      // group whose simplification made it; HG_LOD_NONE: source triangles
    uint32_t first_index;    // into the indices of the group's chunk
    uint32_t triangle_count; // 1..HG_LOD_CLUSTER_TRIANGLES
};

struct hg_lod_group {
    float center[3], radius; // LOD sphere: holds the clusters and the LOD spheres they came with
    float error;             // of what was made from this group; FLT_MAX: terminal
    uint32_t first_cluster, cluster_count; // consecutive in `clusters`
    uint32_t first_parent, parent_count;   // into `parents`; 0 when terminal
    uint32_t chunk, level;                 // level 0 has source triangles
};

// Tree over all groups, breadth first, node 0 the root. A subtree needs a visit only if its box is
// seen and the projected error of the node's sphere (as of a group) > threshold.
struct hg_lod_node {
    float center[3], radius; // holds the LOD spheres of all its groups
    float error;             // largest of its groups (FLT_MAX: a terminal one is below)
    float min[3], max[3];    // box of all its groups' triangles
    uint32_t first, count;   // nodes or groups [first, first + count)
    uint32_t is_leaf;        // children are groups
};

struct hg_lod_chunk {
    uint64_t offset; // of the encoded bytes in the file
    uint32_t bytes;  // encoded
    uint32_t crc;    // CRC-32 of them
    uint32_t vertex_count, index_count;
    uint32_t first_group, group_count; // consecutive in `groups`
};

// An opened hierarchy: plain arrays, owned by the object; `data` is borrowed. Groups, clusters and
// chunks are ordered from coarse to fine and spatially within a level.
struct hg_lod {
    const struct hg_lod_cluster *clusters;
    const struct hg_lod_group *groups;
    const struct hg_lod_node *nodes;
    const struct hg_lod_chunk *chunks;
    const uint32_t *parents; // group indices
    uint32_t cluster_count, group_count, node_count, chunk_count, parent_count;
    uint32_t root_chunk_count, level_count;
    uint32_t flags;       // HG_DRAW_NORMALS | TANGENTS | UV1 | COLOR8 | COLOR16 of the vertices
    uint32_t extra_words; // per vertex, as in pack.h
    float quantum;        // lattice step of positions
    float source_error;   // of level 0: half the diagonal of a lattice cell
    float min[3], max[3]; // box of level 0
    uint64_t source_triangles, stored_triangles;
    const uint8_t *data;
    size_t size;
};

// Reads and checks header and tables (all ranges, counts, links, nesting); chunks are checked when
// they are decoded. `data` must outlive the object. Memory is bounded by a small multiple of size.
// HG_E_VERSION, HG_E_FORMAT, HG_E_TRUNCATED, HG_E_HASH (a checksum), HG_E_NOMEM.
enum hg_status hg_lod_open(
    const uint8_t *data, size_t size, struct hg_lod **out, struct hg_error *err) HG_MUST_CHECK;
// The same with the bytes up to the first chunk only: chunks are kept elsewhere (store.h).
enum hg_status hg_lod_open_head(
    const uint8_t *head, size_t size, struct hg_lod **out, struct hg_error *err) HG_MUST_CHECK;
void hg_lod_close(struct hg_lod *lod); // accepts NULL

// Byte offsets of a decoded chunk's streams, each a multiple of 16. A chunk is a small part of its
// own: the streams are those of struct hg_gpu_part, indices are u32 and count from the chunk's
// first vertex.
struct hg_lod_layout {
    uint32_t indices, positions, vertices, extra;
    uint32_t total_bytes; // <= HG_LOD_CHUNK_BYTES
};
void hg_lod_chunk_layout(const struct hg_lod *lod, uint32_t chunk, struct hg_lod_layout *out);

// Decodes the chunk's `bytes` encoded bytes (e.g. lod->data + offset) to dst, which has the
// layout's total_bytes and is written, never read (it may be mapped device memory). On failure dst
// holds anything. Thread-safe. HG_E_HASH, HG_E_FORMAT, HG_E_TRUNCATED (size is not `bytes`),
// HG_E_NOMEM.
enum hg_status hg_lod_decode(const struct hg_lod *lod, uint32_t chunk, const uint8_t *encoded,
    size_t size, uint8_t *dst, struct hg_error *err) HG_MUST_CHECK;

// ---- baking -------------------------------------------------------------------------------------

struct hg_lod_params {    // zero = defaults
    struct hg_jobs *jobs; // NULL: this thread alone; the bytes are the same
    // Triangles done of all that will be simplified; return false to cancel. Called from the
    // caller's thread. May be NULL.
    bool (*progress)(void *user, uint64_t done, uint64_t total);
    void *progress_user;
    uint64_t memory_limit_bytes; // besides the part; 0 = unlimited
    float quantum;               // lattice step, rounded down to a power of two; 0 = by edge length
    // Metres of error that a change counts for: of a unit normal and of linear colour, in lengths
    // of the local edges; of uv, in local metres of surface per uv. 0 = default, < 0 = ignored.
    float normal_weight, color_weight, uv_weight; // defaults 0.35, 0.25, 0.5
};

struct hg_lod_report {
    uint64_t source_triangles, stored_triangles;
    uint64_t file_bytes, decoded_bytes, peak_bytes; // peak: working memory taken, result included
    uint32_t clusters, groups, levels, chunks, terminal_clusters;
    float quantum, root_error; // root_error: largest error that is not FLT_MAX
    uint64_t total_ns, weld_ns, cluster_ns, group_ns, simplify_ns, encode_ns;
};

// Whether a part can be baked: triangles or points, neither skinned nor morphed.
bool hg_lod_can_bake(const struct hg_mesh_part *part, uint32_t target_count);

// Bakes a part to the bytes of a file (freed with hg_free). Triangles with an edge of no length are
// left out; a part without triangles gives a hierarchy without clusters. `report` may be NULL.
// HG_E_INVAL (not finite, indices out of range, see hg_lod_can_bake), HG_E_LIMIT (memory limit,
// 2^30 triangles, coordinates beyond 1e36 m), HG_E_NOMEM, HG_E_CANCELLED. Cost O(n log n).
enum hg_status hg_lod_bake(const struct hg_mesh_part *part, const struct hg_lod_params *params,
    uint8_t **data, size_t *size, struct hg_lod_report *report, struct hg_error *err) HG_MUST_CHECK;

// SHA-256 of everything that decides the bytes: the part's arrays, parameters, HG_LOD_VERSION.
// HG_E_NOMEM.
enum hg_status hg_lod_key(const struct hg_mesh_part *part, const struct hg_lod_params *params,
    uint8_t key[32]) HG_MUST_CHECK;

#endif
