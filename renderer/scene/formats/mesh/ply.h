// ply.h - parts of the PLY reader: the header (ply_header.c), values and elements (ply.c), and the
// asset (ply_mesh.c).
// Floor 2, private to scene/. Source: G. Turk 1994, "The PLY Polygon File Format".
#ifndef HG_RENDERER_SCENE_FORMATS_MESH_PLY_H
#define HG_RENDERER_SCENE_FORMATS_MESH_PLY_H

#include "renderer/scene/formats/mesh/mesh_file.h"
#include "renderer/scene/formats/mesh/polygons.h"

enum hg_ply_type {
    HG_PLY_INT8,
    HG_PLY_UINT8,
    HG_PLY_INT16,
    HG_PLY_UINT16,
    HG_PLY_INT32,
    HG_PLY_UINT32,
    HG_PLY_FLOAT32,
    HG_PLY_FLOAT64,
    HG_PLY_TYPES
};

enum hg_ply_encoding { HG_PLY_ASCII, HG_PLY_LITTLE, HG_PLY_BIG };

// What a property is read as; coordinates of a vertex in this order.
enum hg_ply_role {
    HG_PLY_X,
    HG_PLY_Y,
    HG_PLY_Z,
    HG_PLY_NX,
    HG_PLY_NY,
    HG_PLY_NZ,
    HG_PLY_U,
    HG_PLY_V,
    HG_PLY_RED,
    HG_PLY_GREEN,
    HG_PLY_BLUE,
    HG_PLY_ALPHA,
    HG_PLY_VERTEX_ROLES,
    HG_PLY_CORNERS = HG_PLY_VERTEX_ROLES, // lists of faces and strips
    HG_PLY_TEXCOORDS,
    HG_PLY_TEXTURE_NUMBER,
    HG_PLY_EDGE_FROM,
    HG_PLY_EDGE_TO,
    HG_PLY_SKIPPED
};

enum hg_ply_kind { HG_PLY_OTHER, HG_PLY_VERTEX, HG_PLY_FACE, HG_PLY_STRIPS, HG_PLY_EDGE };

struct hg_ply_property {
    enum hg_ply_type type, count_type; // count_type: of a list
    bool is_list;
    enum hg_ply_role role;
};

struct hg_ply_element {
    enum hg_ply_kind kind;
    uint64_t count, start, header_offset; // start: of its data
    uint32_t first, property_count;       // of hg_ply.properties
    bool later;                           // it comes before the vertices in the file
};

struct hg_ply {
    struct hg_mesh_file file;
    enum hg_ply_encoding encoding;
    struct hg_mesh_array elements, properties; // struct hg_ply_element, struct hg_ply_property
    struct hg_text texture_file;               // of a comment TextureFile; empty: none
    uint32_t texture_count;
    uint64_t at, value_at; // of the next value; of the last one
    uint64_t vertex_count; // of the element vertex
    bool has_vertex;
    enum hg_ply_type color_type;
    uint32_t roles;           // bits 1 << enum hg_ply_role that vertices have
    struct hg_mesh_array xyz; // double[3]
    float *normals, *uv, *colors;
    struct hg_mesh_array corners; // uint32_t, three a triangle
    struct hg_mesh_array wedges;  // float[2], of each corner
    struct hg_mesh_array lines;   // uint32_t, two a line
    struct hg_mesh_array loop;    // uint32_t: the list that is being read
    struct hg_mesh_array loop_uv; // double
    struct hg_mesh_array loop_xyz;
    struct hg_polygons polygons;
};

// Reads up to the end of "end_header". HG_E_FORMAT.
enum hg_status hg_ply_read_header(struct hg_ply *ply) HG_MUST_CHECK;
// Bytes of one value.
uint32_t hg_ply_type_bytes(enum hg_ply_type type);
// Makes mesh, material and parts from what was read.
enum hg_status hg_ply_make_asset(struct hg_ply *ply) HG_MUST_CHECK;

// What other formats of indexed faces use too. Begin, then set `vertex_count` and `roles`, take the
// arrays and fill them; then polygons; end makes the asset from it.
enum hg_status hg_ply_begin(struct hg_ply *ply, const struct hg_load_params *params,
    const struct hg_refbuf *main, const char *label, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_ply_end(
    struct hg_ply *ply, enum hg_status status, struct hg_asset **out) HG_MUST_CHECK;
enum hg_status hg_ply_take_vertices(struct hg_ply *ply) HG_MUST_CHECK;
// v [HG_PLY_VERTEX_ROLES]; scale is that of colours.
void hg_ply_store_vertex(struct hg_ply *ply, uint64_t i, const double *v, double scale);
// Cuts the polygon of `loop`; has_uv: with the coordinates of `loop_uv`.
enum hg_status hg_ply_add_polygon(struct hg_ply *ply, bool has_uv) HG_MUST_CHECK;

#endif
