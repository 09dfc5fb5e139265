// internal.h - what the parts of the hierarchy builder and its file format share.
// Floor 2, private to geometry/ (tests and the fuzz harness look in too).
//
// Words: a *position* is a point of the lattice; a *vertex* is a position with attributes (several
// at one position make a seam). Lattice coordinates are absolute multiples of the quantum.
#ifndef HG_RENDERER_LOD_INTERNAL_H
#define HG_RENDERER_LOD_INTERNAL_H

#include <math.h>

#include "base/bytes.h"
#include "renderer/lod/lod.h"

#define HG_LOD_NORMAL_STEPS  1023 // octahedral coordinates are -STEPS..STEPS
#define HG_LOD_TANGENT_STEPS 511
#define HG_LOD_RADIUS_STEPS  8
#define HG_LOD_FARTHEST      1e36f     // metres
#define HG_LOD_LATTICE_MAX   (1 << 24) // largest coordinate: exact as a float
#define HG_LOD_ATTRIBUTES    11        // normal 3, uv 2, uv1 2, colour 4
#define HG_LOD_WORDS         8         // per vertex: normal 1, tangent 1, uv 2, uv1 2, colour 2

// Asks for memory that is looked at soon. A function that does no more than this has no effect in
// the eyes of compilers, and calls of it are dropped; so those are inlined in any case.
#define HG_LOD_INLINE __attribute__((always_inline)) static inline
HG_LOD_INLINE void hg_lod_expect(const void *memory)
{
    __builtin_prefetch(memory);
}

// Where the attributes lie in the words of a vertex; -1: absent.
struct hg_lod_format {
    uint32_t flags, words; // HG_DRAW_*
    int32_t normal, tangent, uv, uv1, color;
    int32_t radius;   // of files of points, in quanta / HG_LOD_RADIUS_STEPS
    float quantum;    // of positions
    float uv_quantum; // of uv and uv1
    uint32_t extra_words;
};

void hg_lod_format_set(struct hg_lod_format *format, uint32_t flags, bool has_uv);

// The part after welding: what all levels are made of.
struct hg_lod_mesh {
    struct hg_lod_format format;
    uint32_t position_count, vertex_count, triangle_count;
    int32_t (*lattice)[3]; // [position_count]
    uint32_t *position_of; // [vertex_count]
    uint32_t *words;       // [vertex_count * format.words]
    uint32_t *triangles;   // [triangle_count * 3] vertices
    uint64_t room[4];   // entries that memory was taken for: lattice, position_of, words, triangles
    uint32_t *piece_of; // [position_count] connected piece; NULL: there is one
    float *pieces;      // [piece_count] diagonals of their boxes, metres; NULL: there is one
    uint32_t piece_count;
};

// Memory that counts against params.memory_limit_bytes.
struct hg_lod_budget {
    uint64_t limit, used, peak; // limit 0 = none
};
// Sets *out (zeroed memory). HG_E_LIMIT, HG_E_NOMEM. Not thread-safe.
enum hg_status hg_lod_take(
    struct hg_lod_budget *budget, uint64_t count, size_t size, void *out) HG_MUST_CHECK;
// Gives back what was taken as count x size and sets *ptr to NULL.
void hg_lod_give(struct hg_lod_budget *budget, void *ptr_to_ptr, uint64_t count, size_t size);

// Checks the part and welds it onto the lattice. HG_E_INVAL, HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_lod_weld(const struct hg_mesh_part *part, const struct hg_lod_params *params,
    struct hg_lod_budget *budget, struct hg_lod_mesh *out, struct hg_error *err) HG_MUST_CHECK;
// Numbers positions and vertices in the order in which the triangles name them, so that what is
// near in space is near in memory. Before hg_lod_find_pieces. HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_lod_mesh_reorder(
    struct hg_lod_mesh *mesh, struct hg_lod_budget *budget) HG_MUST_CHECK;
void hg_lod_mesh_finish(struct hg_lod_mesh *mesh, struct hg_lod_budget *budget);

// Finds what is connected; after welding. HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_lod_find_pieces(
    struct hg_lod_mesh *mesh, struct hg_lod_budget *budget) HG_MUST_CHECK;
// Metres; INFINITY when all is one piece.
static inline float hg_lod_piece_size(const struct hg_lod_mesh *mesh, uint32_t position)
{
    return mesh->pieces != NULL ? mesh->pieces[mesh->piece_of[position]] : INFINITY;
}

// Attributes of a vertex as floats: normal, uv, uv1, colour, as far as present; returns their
// count.
uint32_t hg_lod_attributes(
    const struct hg_lod_format *format, const uint32_t *words, float out[HG_LOD_ATTRIBUTES]);
// The largest power of two that is not above v; at least FLT_MIN.
float hg_lod_power_below(float v);
// The word of a normal of any length but 0.
uint32_t hg_lod_normal_word(const float normal[3]);

// ---- cutting triangles into clusters ------------------------------------------------------------

// Clusters of triangles that are cut.
struct hg_lod_cut {
    uint32_t *starts; // [hg_lod_cut_bound(triangles) + 1] out: first triangle of each, then the end
    uint32_t *order;  // [triangles] out: where each triangle was before; NULL: not wanted
    uint32_t count;   // out
};

// Reorders triangles so that consecutive ranges are compact clusters.
//
//   triangles   [count * 3]  vertices; reordered in place
//
// `jobs` may be NULL. HG_E_NOMEM, HG_E_LIMIT. Cost O(n log n).
enum hg_status hg_lod_cut(const struct hg_lod_mesh *mesh, uint32_t *triangles, uint32_t count,
    struct hg_lod_cut *out, struct hg_jobs *jobs) HG_MUST_CHECK;

// Most clusters that `count` triangles can be cut into.
static inline uint32_t hg_lod_cut_bound(uint32_t count)
{
    return (count + HG_LOD_CLUSTER_TRIANGLES - 1) / HG_LOD_CLUSTER_TRIANGLES * 2 + 1;
}

// ---- grouping clusters --------------------------------------------------------------------------

struct hg_lod_pool { // the clusters that make up the surface at one level
    uint32_t count;
    const uint32_t *const *triangles; // [count] of each cluster, 3 vertices per triangle
    const uint32_t *triangle_count;   // [count]
    const uint32_t *vertex_count;     // [count]
    const float (*center)[3];         // [count] metres
};

//   group_of  [count]           out: group numbers 0..*group_count-1 in order of the space that
//   they fill open      [position_count]  set to 1 where an edge has one triangle in all; NULL: not
//   wanted
//
// HG_E_NOMEM. Cost O(n log n).
enum hg_status hg_lod_partition(const struct hg_lod_mesh *mesh, const struct hg_lod_pool *pool,
    uint32_t *group_of, uint32_t *group_count, uint8_t *open) HG_MUST_CHECK;

// ---- simplification -----------------------------------------------------------------------------

#define HG_LOD_SAMPLE_OPEN 1u // lies on an open edge: its distance is that to open edges
#define HG_LOD_SAMPLE_SEAM 2u // several vertices at this position: attributes are not compared

// A point of the source surface whose distance to the coarser surfaces is watched.
struct hg_lod_sample {
    uint32_t vertex;      // of the source
    uint32_t anchor : 30; // position of the present surface near it
    uint32_t flags : 2;
    float distance;    // metres, when it was last measured
    uint32_t triangle; // that it was nearest to then
};

struct hg_lod_weights {
    float normal, color, uv;
};

// A vertex that stands for others as well: the word of their mean normal.
struct hg_lod_mean {
    uint32_t vertex, word;
};

struct hg_lod_simplify_job {
    const struct hg_lod_mesh *mesh;
    const uint8_t *locked,
        *open; // [position_count] not 0: must stay; on an open edge of the source
    struct hg_lod_weights weights;
    uint32_t *triangles; // [triangle_count * 3] in and out
    uint32_t triangle_count, target_count;
    struct hg_lod_sample *samples; // [sample_count] anchors and distances are brought up to date
    uint32_t sample_count;
    float error; // out: metres, largest distance of a sample or its like in attributes
    struct hg_lod_mean *means; // out: [mean_count], freed by the caller
    uint32_t mean_count;
};

// Collapses edges onto one of their ends until target_count triangles are left or nothing more can
// be done. Locked positions and the edges between them stay. HG_E_NOMEM. Cost O(n log n).
enum hg_status hg_lod_simplify(struct hg_lod_simplify_job *job) HG_MUST_CHECK;

// A frame of reference that keeps what is far away exact: lengths in `unit`s about `origin`.
struct hg_lod_frame {
    int32_t origin[3];
    float scale; // lattice steps to units
    float unit;  // metres
};

// The triangles of a job in a frame of their own.
struct hg_lod_patch {
    const struct hg_lod_simplify_job *job;
    uint32_t triangle_count, position_count, vertex_count, attribute_count, live;
    struct hg_lod_frame frame;
    float weight[HG_LOD_ATTRIBUTES]; // units per unit of attribute
    uint32_t (*triangles)[4];        // vertices, [3] unused; [0] HG_LOD_NONE: removed
    uint32_t (*places)[4];           // their positions
    uint32_t *next;         // [triangle_count * 4] corner after 4 triangle + k at its position
    uint32_t *head, *tail;  // [position_count] corners
    float (*point)[4];      // [position_count], [3] is 0; aligned to 16 bytes
    uint32_t *global;       // [position_count] position of the mesh
    uint32_t *into;         // [position_count] where it was collapsed to; itself: alive
    uint8_t *fixed;         // [position_count]
    uint32_t *vertex_first; // [position_count] ring of vertices
    uint32_t *position_of, *vertex_next, *vertex_global; // [vertex_count]
    float *attributes; // [vertex_count * attribute_count], times weight
    struct {
        uint32_t *slots, mask; // position + 1; 0: free
    } table;                   // positions by hash of `global`
    void *memory;
};

enum hg_status hg_lod_patch_init(
    struct hg_lod_patch *patch, const struct hg_lod_simplify_job *job) HG_MUST_CHECK;
void hg_lod_patch_finish(struct hg_lod_patch *patch);
uint32_t hg_lod_patch_find(const struct hg_lod_patch *patch, uint32_t global); // HG_LOD_NONE: none
// Squared distance of a point to triangle abc.
float hg_lod_distance2(const float at[3], const float a[3], const float b[3], const float c[3]);
// The same, and the barycentric weights of the nearest point.
float hg_lod_closest(
    const float at[3], const float a[3], const float b[3], const float c[3], float weights[3]);
// Measures the job's samples against what is left of the patch; *error in metres. HG_E_NOMEM.
enum hg_status hg_lod_measure(const struct hg_lod_patch *patch, float *error) HG_MUST_CHECK;

// ---- clusters and groups while they are built ---------------------------------------------------

// What the simplification of a group made (or the welded mesh): owns what its clusters point to.
struct hg_lod_product {
    uint32_t *triangles; // NULL: the mesh's own
    struct hg_lod_sample *samples;
    uint32_t triangle_count, sample_count;
    uint32_t users; // clusters that still need it
};

struct hg_lod_piece {           // a cluster
    struct hg_lod_cluster info; // group and made_from in the order of building
    const uint32_t *triangles;
    uint32_t vertex_count;
    const struct hg_lod_sample *samples;
    uint32_t sample_count;
    struct hg_lod_product *product;
};

struct hg_lod_pieces {
    struct hg_lod_piece *items;
    size_t capacity;
    uint32_t count;
};

struct hg_lod_sphere {
    float center[3], radius;
};

// A sphere around spheres, with room for rounding.
struct hg_lod_sphere hg_lod_sphere_around(const struct hg_lod_sphere *spheres, uint32_t count);
void hg_lod_product_unref(struct hg_lod_product *product); // frees after the last user

// Simplification of one group of pieces.
struct hg_lod_group_job {
    const struct hg_lod_mesh *mesh;
    const uint8_t *locked, *open;
    struct hg_lod_weights weights;
    const struct hg_lod_piece *pieces; // all of the pool
    const uint32_t *members;           // [member_count] of them
    uint32_t member_count;
    uint32_t samples_per_piece; // that are handed on, at most
    // Out. No product: the group could not be simplified enough.
    struct hg_lod_product *product;
    struct hg_lod_piece *made; // [made_count]
    struct hg_lod_mean *means; // [mean_count]
    uint32_t mean_count;
    uint32_t made_count, triangle_count;
    float error; // of what was made, without that of the lattice
    enum hg_status status;
};
void hg_lod_group_run(struct hg_lod_group_job *job);

// Pieces of the welded mesh, cut at `starts` [count + 1]. HG_E_NOMEM.
enum hg_status hg_lod_first_pieces(const struct hg_lod_mesh *mesh, const uint32_t *starts,
    uint32_t count, struct hg_lod_pieces *pieces) HG_MUST_CHECK;
// Gives them their samples, once it is known which edges are open. HG_E_NOMEM.
enum hg_status hg_lod_first_samples(const struct hg_lod_mesh *mesh, const uint8_t *open,
    struct hg_lod_pieces *pieces) HG_MUST_CHECK;

// ---- chunks -------------------------------------------------------------------------------------

#define HG_LOD_PLANES 16 // components of a vertex, at most: position 3, looks 12, one to spare

// A vertex is coded when a triangle first names it, from those before it: vertex `a`, or across the
// edge a b from c as a + b - c (HG_LOD_NONE: not there).
struct hg_lod_visit {
    uint32_t vertex, a, b, c;
};
// Visits in the order of the triangles; visits and seen have vertex_count entries, indices are
// smaller than that. Returns the number of visits.
uint32_t hg_lod_visits(const uint32_t *indices, uint32_t index_count, uint32_t vertex_count,
    struct hg_lod_visit *visits, uint8_t *seen);

void hg_lod_point_visits(uint32_t count, struct hg_lod_visit *visits);

// How the words of a vertex are taken apart into components and how these are predicted.
struct hg_lod_component {
    enum { HG_LOD_LATTICE, HG_LOD_NORMAL, HG_LOD_TANGENT, HG_LOD_BYTES, HG_LOD_SHORTS } kind;
    int32_t word;   // first word of the vertex; of positions: axis
    uint32_t index; // component of it
};
// Components after the position; returns their number.
uint32_t hg_lod_components(
    const struct hg_lod_format *format, struct hg_lod_component out[HG_LOD_PLANES]);
int32_t hg_lod_component_get(const struct hg_lod_component *c, const uint32_t *words);
void hg_lod_component_set(const struct hg_lod_component *c, uint32_t *words, int32_t value);
// Prediction of a visited vertex from the values of others: across the edge, or as the neighbour.
static inline int32_t hg_lod_predict_lattice(
    const struct hg_lod_visit *visit, const int32_t *values)
{
    if (visit->a == HG_LOD_NONE)
        return 0;
    const uint32_t a = (uint32_t)values[visit->a];
    if (visit->c == HG_LOD_NONE)
        return (int32_t)a;
    return (int32_t)(a + (uint32_t)values[visit->b] - (uint32_t)values[visit->c]); // may wrap
}
// Prediction of component c of a visited vertex; `values` are those of the chunk's vertices,
// normals the sums of their triangles' (integers, so that all machines agree); NULL: of points.
int32_t hg_lod_predict(const struct hg_lod_component *c, const struct hg_lod_visit *visit,
    const int32_t *values, const int64_t (*normals)[3]);
// normals[vertex_count] out: sums of the triangles' normals, by area.
void hg_lod_sum_normals(const uint32_t *indices, uint32_t index_count, const int32_t (*lattice)[3],
    uint32_t vertex_count, int64_t (*normals)[3]);

// Encodes the triangles of a chunk, cluster by cluster: bytes go to `out`, counts, size and
// checksum to *chunk. The order of triangles and corners in a cluster changes. HG_E_NOMEM.
enum hg_status hg_lod_encode(const struct hg_lod_mesh *mesh, const uint32_t *triangles,
    const uint32_t *cluster_triangles, uint32_t cluster_count, struct hg_writer *out,
    struct hg_lod_chunk *chunk) HG_MUST_CHECK;

// Points of a chunk and sides of each of their discs, from the counts of a chunk of a file of
// points. False: they are not those of discs.
bool hg_lod_disc_counts(const struct hg_lod_chunk *chunk, uint32_t *points, uint32_t *sides);
// The points of a chunk: lattice [count], words [count * format->words]. As hg_lod_encode; decoding
// makes discs of them.
struct hg_lod_points {
    const int32_t (*lattice)[3];
    const uint32_t *words;
    uint32_t count, sides;
};
enum hg_status hg_lod_encode_points(const struct hg_lod_mesh *mesh,
    const struct hg_lod_points *points, struct hg_writer *out,
    struct hg_lod_chunk *chunk) HG_MUST_CHECK;

// Decodes without looking at checksum and tables; dst as in hg_lod_decode.
// HG_E_FORMAT, HG_E_TRUNCATED, HG_E_NOMEM.
enum hg_status hg_lod_decode_payload(const struct hg_lod_format *format,
    const struct hg_lod_chunk *chunk, const uint8_t *encoded, size_t size, uint8_t *dst,
    struct hg_error *err) HG_MUST_CHECK;
void hg_lod_layout_of(const struct hg_lod_format *format, const struct hg_lod_chunk *chunk,
    struct hg_lod_layout *out);

// ---- file ---------------------------------------------------------------------------------------

// What hg_lod_open makes; the public part comes first.
struct hg_lod_file {
    struct hg_lod lod;
    struct hg_lod_format format;
    struct hg_lod_cluster *clusters;
    struct hg_lod_group *groups;
    struct hg_lod_node *nodes;
    struct hg_lod_chunk *chunks;
    uint32_t *parents;
};

// The file: header, tables, chunk bytes. Counts, format and tables are those of `file`.
// HG_E_NOMEM.
enum hg_status hg_lod_write(const struct hg_lod_file *file, const uint8_t *chunks, size_t size,
    struct hg_writer *out) HG_MUST_CHECK;
// Parses unpacked tables (counts in file->lod) and checks every link. HG_E_FORMAT, HG_E_NOMEM.
enum hg_status hg_lod_read_tables(struct hg_lod_file *file, const uint8_t *tables, size_t size,
    struct hg_error *err) HG_MUST_CHECK;
// Makes `parents` and `nodes` of the other tables. HG_E_NOMEM.
enum hg_status hg_lod_link(struct hg_lod_file *file) HG_MUST_CHECK;
// The axis that four bytes in the file stand for.
void hg_lod_cone_axis(const int8_t q[3], float axis[3]);

uint32_t hg_lod_crc(const void *data, size_t size);

#endif
