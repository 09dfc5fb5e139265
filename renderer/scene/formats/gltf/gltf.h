// gltf.h - what the parts of the glTF 2.0 loader share.
// Floor 2, private to scene/. One load = one struct hg_gltf on one thread (parts of meshes are
// finished on the job pool). Source of every rule: Khronos glTF 2.0 specification and the KHR_ and
// EXT_ extension texts; warnings begin with the names of the glTF validator's issue table.
#ifndef HG_RENDERER_SCENE_FORMATS_GLTF_GLTF_H
#define HG_RENDERER_SCENE_FORMATS_GLTF_GLTF_H

#include <jansson.h>

#include "renderer/scene/asset.h"
#include "renderer/scene/formats/formats.h"

// A place in the JSON: a value and the way to it. Children point to their parents on the stack.
struct hg_gltf_at {
    const json_t *json; // NULL: not there
    const struct hg_gltf_at *up;
    const char *key; // member of an object, or NULL: item of an array
    size_t index;
};

struct hg_gltf_buffer {
    struct hg_refbuf *owner;
    const uint8_t *data; // NULL: no bytes (fallback of a compressed view, or none given)
    uint64_t size;
};

struct hg_gltf_view {
    const uint8_t *data;
    uint64_t size;
    uint32_t stride;  // 0 = tightly packed
    uint8_t *decoded; // owned bytes of EXT_meshopt_compression
    bool ready;
};

// Of a material's primitives: which TEXCOORD_n are uv[0] and uv[1] of the part.
#define HG_GLTF_NO_UV_SET UINT32_MAX
struct hg_gltf_uv_sets {
    uint32_t set[2];
};

struct hg_gltf {
    const struct hg_load_params *params;
    struct hg_asset *asset;
    struct hg_error *err;
    const char *file; // name in messages
    struct hg_refbuf *main;
    const uint8_t *bin; // BIN chunk of a .glb, inside `main`
    uint64_t bin_size;
    json_t *json;
    struct hg_gltf_at root;
    struct hg_gltf_buffer *buffers;  // [buffer_count]
    struct hg_gltf_view *views;      // [view_count]
    struct hg_image_source **images; // [image_count]; NULL: not usable
    struct hg_light_table **profiles; // [profile_count] of EXT_lights_ies; NULL: not usable
    struct hg_gltf_uv_sets *uv_sets;  // [material_count]
    uint32_t buffer_count, view_count, image_count, profile_count;
    uint32_t punctual_count; // lights of KHR_lights_punctual
    uint64_t memory_used, memory_limit;
    uint64_t resident_used;    // of memory_used, what was not spilled
    struct hg_isolated *draco; // decodes compressed meshes; NULL: not started
    bool has_quantization; // KHR_mesh_quantization is declared
};

// One accessor, checked: elements of `components` numbers at data + i * stride.
struct hg_gltf_accessor {
    struct hg_gltf_at at; // its place
    uint32_t count;
    uint32_t component_type; // 5120 ... 5126
    uint32_t rows, columns;  // VECn: rows n, columns 1
    uint32_t element_bytes, column_bytes, stride;
    bool normalized;
    const uint8_t *data; // NULL: zeros
    // Sparse replacement; sparse_count 0 = none.
    uint32_t sparse_count, sparse_index_type;
    const uint8_t *sparse_indices, *sparse_values;
};

// ---- gltf_json.c: places, checked values, errors with JSON pointers ----------------------------

// The place of a member of an object, or of an item of an array; json NULL when absent.
struct hg_gltf_at hg_gltf_key(const struct hg_gltf_at *at, const char *key);
struct hg_gltf_at hg_gltf_item(const struct hg_gltf_at *at, size_t index);
// Member "extensions"/name, json NULL when absent.
struct hg_gltf_at hg_gltf_extension(
    const struct hg_gltf_at *at, const char *name, struct hg_gltf_at *extensions);
size_t hg_gltf_count(const struct hg_gltf_at *at); // items of an array, else 0

// Fills the error with the JSON pointer of `at` and a reason, and returns `status`. Warnings go to
// the asset likewise.
enum hg_status hg_gltf_fail(struct hg_gltf *g, const struct hg_gltf_at *at, enum hg_status status,
    const char *fmt, ...) HG_PRINTF(4, 5);
void hg_gltf_warn(struct hg_gltf *g, const struct hg_gltf_at *at, const char *fmt, ...)
    HG_PRINTF(3, 4);

// Values after the schema has been checked: the fallback stands for what is not there.
uint64_t hg_gltf_uint(const struct hg_gltf_at *at, const char *key, uint64_t fallback);
double hg_gltf_number(const struct hg_gltf_at *at, const char *key, double fallback);
bool hg_gltf_bool(const struct hg_gltf_at *at, const char *key, bool fallback);
const char *hg_gltf_string(const struct hg_gltf_at *at, const char *key); // NULL: absent
// Up to `count` numbers; absent: out is untouched and false is returned.
bool hg_gltf_numbers(const struct hg_gltf_at *at, const char *key, float *out, size_t count);
// Of extras: a number above 0 and at most `most` under one of the names, NULL last; 0: there is
// none. Any other value is reported as a notice that names the owner ("light").
float hg_gltf_read_extra(struct hg_gltf *g, const struct hg_gltf_at *extras, const char *owner,
    const char *const *names, float most);
// Index into an array of the file; -1 when absent.
int64_t hg_gltf_index(const struct hg_gltf_at *at, const char *key);
// Item `index` of the root array `name`. `up` holds the way to it and must live as long.
struct hg_gltf_at hg_gltf_root_item(
    const struct hg_gltf *g, const char *name, size_t index, struct hg_gltf_at *up);

// Memory of the decoded asset, charged against its limit; zeroed. NULL with the error set.
void *hg_gltf_alloc(
    struct hg_gltf *g, const struct hg_gltf_at *at, uint64_t count, size_t size) HG_MUST_CHECK;

// ---- the stages --------------------------------------------------------------------------------

// gltf_container.c: chunks of a .glb, the JSON text, buffers from URIs.
enum hg_status hg_gltf_parse_container(struct hg_gltf *g) HG_MUST_CHECK;
enum hg_status hg_gltf_load_buffers(struct hg_gltf *g) HG_MUST_CHECK;
// Bytes behind a URI: data: decoded, else fetched. `mime` (may be NULL) gets a data URI's type.
enum hg_status hg_gltf_fetch(struct hg_gltf *g, const struct hg_gltf_at *at, const char *uri,
    struct hg_refbuf **out, char mime[64]) HG_MUST_CHECK;
// False for absolute paths and whatever begins with a scheme, drive letters included.
bool hg_gltf_uri_is_relative(const char *uri);
// Percent-decodes a relative reference. HG_E_FORMAT; caller frees.
enum hg_status hg_gltf_decode_uri(const char *uri, char **out) HG_MUST_CHECK;

// gltf_schema.c: types, required members, ranges and references of the whole document.
enum hg_status hg_gltf_check_schema(struct hg_gltf *g) HG_MUST_CHECK;
// gltf_check.c: rules that span objects; warns only.
void hg_gltf_check_rules(struct hg_gltf *g);

// gltf_accessor.c
enum hg_status hg_gltf_view_get(
    struct hg_gltf *g, uint64_t index, const struct hg_gltf_view **out) HG_MUST_CHECK;
enum hg_status hg_gltf_accessor_open(
    struct hg_gltf *g, uint64_t index, struct hg_gltf_accessor *out) HG_MUST_CHECK;
// The declared shape of an accessor alone: count, types, element_bytes, tight stride.
enum hg_status hg_gltf_accessor_shape(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_gltf_accessor *out) HG_MUST_CHECK;
uint32_t hg_gltf_component_bytes(uint32_t component_type); // 0: unknown type
// Writes count x components floats; components beyond the accessor's become `fill`, normalised
// integers become -1..1 or 0..1.
void hg_gltf_read_floats(
    const struct hg_gltf_accessor *a, uint32_t components, float fill, float *out);
// Unsigned integers as they are.
void hg_gltf_read_uints(const struct hg_gltf_accessor *a, uint32_t components, uint32_t *out);

// gltf_meshopt.c, gltf_draco.c
enum hg_status hg_gltf_decode_meshopt(
    struct hg_gltf *g, const struct hg_gltf_at *extension, struct hg_gltf_view *view) HG_MUST_CHECK;
struct hg_gltf_draco; // a decoded mesh; the next one of the load is decoded after its destruction
struct hg_gltf_draco_attribute {
    uint32_t id, component_type, components; // as the accessor has it
};
enum hg_status hg_gltf_draco_decode(struct hg_gltf *g, const struct hg_gltf_at *extension,
    struct hg_gltf_draco **out) HG_MUST_CHECK;
void hg_gltf_draco_destroy(struct hg_gltf_draco *draco); // accepts NULL
uint32_t hg_gltf_draco_point_count(const struct hg_gltf_draco *draco);
uint32_t hg_gltf_draco_face_count(const struct hg_gltf_draco *draco);
void hg_gltf_draco_indices(const struct hg_gltf_draco *draco, uint32_t *out); // 3 a face
// Tightly packed values of all points. HG_E_NOTFOUND, HG_E_FORMAT (not convertible); err->reason
// where it says more.
enum hg_status hg_gltf_draco_values(struct hg_gltf *g, const struct hg_gltf_draco *draco,
    const struct hg_gltf_draco_attribute *attribute, void *out, struct hg_error *err) HG_MUST_CHECK;

// gltf_mesh.c, gltf_material.c, gltf_texture.c, gltf_light.c, gltf_node.c, gltf_anim.c
enum hg_status hg_gltf_load_images(struct hg_gltf *g) HG_MUST_CHECK;
enum hg_status hg_gltf_load_textures(struct hg_gltf *g) HG_MUST_CHECK;
enum hg_status hg_gltf_load_materials(struct hg_gltf *g) HG_MUST_CHECK;
// gltf_uv_sets.c: turns the sets that slots name into 0 and 1 of the two that the material has.
enum hg_status hg_gltf_choose_uv_sets(struct hg_gltf *g) HG_MUST_CHECK;
struct hg_gltf_uv_sets hg_gltf_uv_sets_of(const struct hg_gltf *g, int64_t material); // index
enum hg_status hg_gltf_load_meshes(struct hg_gltf *g) HG_MUST_CHECK;
enum hg_status hg_gltf_load_cameras(struct hg_gltf *g) HG_MUST_CHECK;
enum hg_status hg_gltf_load_lights(struct hg_gltf *g) HG_MUST_CHECK;
enum hg_status hg_gltf_load_nodes(struct hg_gltf *g) HG_MUST_CHECK;
enum hg_status hg_gltf_load_skins(struct hg_gltf *g) HG_MUST_CHECK;
enum hg_status hg_gltf_load_animations(struct hg_gltf *g) HG_MUST_CHECK;
// gltf_light.c: from the extras of a light, or of a node that has it; warns only.
void hg_gltf_read_light_size(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_light *light);
// gltf_light_table.c: profiles of EXT_lights_ies; the light of a node that has one; profile and
// texture from the extras of a light, or of a node that has it. What cannot be read is a warning.
enum hg_status hg_gltf_load_light_profiles(struct hg_gltf *g) HG_MUST_CHECK;
enum hg_status hg_gltf_read_ies_light(
    struct hg_gltf *g, const struct hg_gltf_at *node_at, struct hg_node *node) HG_MUST_CHECK;
enum hg_status hg_gltf_read_light_tables(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_light *light) HG_MUST_CHECK;
// gltf_specgloss.c: converts KHR_materials_pbrSpecularGlossiness.
enum hg_status hg_gltf_convert_spec_gloss(struct hg_gltf *g, const struct hg_gltf_at *extension,
    struct hg_material *material) HG_MUST_CHECK;
// A textureInfo at `at`/key into a slot (texture, UV set, KHR_texture_transform).
void hg_gltf_texture_ref(
    struct hg_gltf *g, const struct hg_gltf_at *at, const char *key, struct hg_texture_ref *out);

#endif
