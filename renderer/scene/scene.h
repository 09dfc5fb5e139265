// scene.h - the scene graph: nodes, meshes, materials, textures, lights, cameras, animation.
// Floor 2, first room: plain data in linear units (metres, radians, candela, lux; colours linear
// Rec.709), no Vulkan. A scene belongs to the render thread. An asset is built by any one thread,
// then handed to a scene.
//
// Every object has a u64 id (see protocol/messages.def): asset << 32 | index. Objects are found by
// id, live at stable addresses until removed, and carry the revision at which they last changed, so
// that lower rooms can keep caches keyed by {id, revision}.
#ifndef HG_RENDERER_SCENE_SCENE_H
#define HG_RENDERER_SCENE_SCENE_H

#include "base/refbuf.h"
#include "base/status.h"
#include "renderer/image/image.h"

enum hg_wrap { HG_WRAP_REPEAT, HG_WRAP_CLAMP, HG_WRAP_MIRROR };
enum hg_alpha_mode { HG_ALPHA_OPAQUE, HG_ALPHA_MASK, HG_ALPHA_BLEND };
enum hg_topology { HG_TOPOLOGY_TRIANGLES, HG_TOPOLOGY_LINES, HG_TOPOLOGY_POINTS };
enum hg_object_kind { // same values as the protocol's object_kind
    HG_OBJECT_NODE,
    HG_OBJECT_MESH,
    HG_OBJECT_MATERIAL,
    HG_OBJECT_TEXTURE,
    HG_OBJECT_LIGHT,
    HG_OBJECT_CAMERA,
    HG_OBJECT_KINDS
};

// Common head of every object.
struct hg_object {
    uint64_t id;
    uint64_t revision; // scene revision of the last change
    char *name;        // UTF-8, never NULL, may be ""
};

// Pixels of a texture, shared between textures of an asset. Exactly one source is set.
struct hg_image_source {
    uint32_t refs;             // owned by the scene's thread (the loader's before hand-over)
    char *label;               // uri, "images[3]" or file name, for messages
    struct hg_refbuf *encoded; // bytes of an image file, or NULL
    char *path;                // image file on disk (already checked to lie in the roots), or NULL
    struct hg_image pixels;    // or decoded pixels (client-made, procedural)
    bool pixels_srgb;          // transfer of `pixels` and `tiles`; files: decided by the slot
    const struct hg_image_tiles *tiles; // or made on demand; borrowed, outlives the scene
};

struct hg_texture {
    struct hg_object head;
    struct hg_image_source *image; // NULL: missing; sampled as white
    enum hg_wrap wrap_s, wrap_t;
    bool mag_nearest, min_nearest, mip_nearest, mip_none;
};

enum hg_texture_slot {           // colour slots hold sRGB files, the rest linear data
    HG_SLOT_BASE_COLOR,          // rgb sRGB, a
    HG_SLOT_METALLIC_ROUGHNESS,  // g roughness, b metallic
    HG_SLOT_NORMAL,              // tangent space, rg(b)
    HG_SLOT_OCCLUSION,           // r
    HG_SLOT_EMISSIVE,            // rgb sRGB
    HG_SLOT_CLEARCOAT,           // r
    HG_SLOT_CLEARCOAT_ROUGHNESS, // g
    HG_SLOT_CLEARCOAT_NORMAL,
    HG_SLOT_SHEEN_COLOR,                // rgb sRGB
    HG_SLOT_SHEEN_ROUGHNESS,            // a
    HG_SLOT_TRANSMISSION,               // r
    HG_SLOT_THICKNESS,                  // g
    HG_SLOT_SPECULAR,                   // a
    HG_SLOT_SPECULAR_COLOR,             // rgb sRGB
    HG_SLOT_IRIDESCENCE,                // r
    HG_SLOT_IRIDESCENCE_THICKNESS,      // g
    HG_SLOT_ANISOTROPY,                 // rg direction, b strength
    HG_SLOT_DIFFUSE_TRANSMISSION,       // a
    HG_SLOT_DIFFUSE_TRANSMISSION_COLOR, // rgb sRGB
    HG_SLOT_COUNT
};

// Slots whose files are sRGB-encoded.
bool hg_texture_slot_is_srgb(enum hg_texture_slot slot);

struct hg_texture_ref {
    struct hg_texture *texture; // NULL: no texture, the factor alone counts
    uint32_t uv_set;            // 0 or 1
    float uv_transform[6];      // row-major 2x3: u' = m0 u + m1 v + m2, v' = m3 u + m4 v + m5
};

struct hg_material {
    struct hg_object head;
    float base_color[4];                    // linear; default 1 1 1 1
    float metallic, roughness;              // perceptual roughness; defaults 1, 1
    float emissive[3];                      // linear, already times emissive_strength
    float normal_scale, occlusion_strength; // defaults 1, 1
    enum hg_alpha_mode alpha_mode;
    float alpha_cutoff; // default 0.5
    bool double_sided, unlit;
    // Members of KHR_materials_*, with the defaults of each extension.
    float ior;
    bool has_ior;
    float transmission, dispersion;
    struct {
        bool is_set; // the material has the extension
        float factor, color[3];
    } specular;
    struct {
        float factor, roughness, normal_scale;
    } clearcoat;
    struct {
        float color[3], roughness;
    } sheen;
    struct {
        float thickness, attenuation_distance, attenuation_color[3]; // metres
    } volume;
    struct {
        float factor, ior, thickness_min_nm, thickness_max_nm;
    } iridescence;
    struct {
        float strength, rotation_rad;
    } anisotropy;
    struct {
        float factor, color[3];
    } diffuse_transmission;
    struct hg_texture_ref slots[HG_SLOT_COUNT];
};

// Fills the defaults of glTF 2.0 (and of every extension).
void hg_material_set_defaults(struct hg_material *material);
// HG_FEATURE_* of shaders/shared/features.h within HG_FEATURE_LOBES; 0: metallic-roughness alone.
uint32_t hg_material_lobes(const struct hg_material *material);
// HG_MIX_* of its lobes.
uint32_t hg_material_mixes(const struct hg_material *material);
// The slot has a texture, and its lobe is in use.
bool hg_material_uses_slot(const struct hg_material *material, enum hg_texture_slot slot);

// Deltas of one morph target; NULL arrays are zero.
struct hg_morph_target {
    float *positions; // [vertex_count * 3]
    float *normals;   // [vertex_count * 3]
    float *tangents;  // [vertex_count * 3]
};

// One draw: an indexed list (strips, fans and loops are expanded by loaders).
struct hg_mesh_part {
    enum hg_topology topology;
    uint32_t vertex_count, index_count; // index_count is a multiple of 3, 2 or 1
    uint32_t *indices;                  // [index_count], each < vertex_count
    float *positions;                   // [vertex_count * 3] metres, finite
    float *normals;                     // [vertex_count * 3] unit; never NULL for triangles
    float *tangents;                    // [vertex_count * 4] unit xyz, w = +-1; NULL: none needed
    float *uv[2];                       // [vertex_count * 2]; NULL: 0,0
    float *colors;                      // [vertex_count * 4] linear; NULL: white
    uint16_t *joints;                   // [vertex_count * 4 * joint_sets]; NULL: not skinned
    float *weights;                     // [vertex_count * 4 * joint_sets], sums 1
    uint32_t joint_sets;                // 0, 1 or 2
    struct hg_morph_target *targets;    // [mesh.target_count]
    float point_scale;                  // of points: size in spacings of the cloud; 0: 1
    float point_diameter;               // metres; 0: sized by spacing
    struct hg_material *material;       // NULL: default material
    struct hg_material **variants; // [asset.variants.count] replacement per variant, entries may
                                   // be NULL (no change); NULL: no mapping
    float bounds_min[3], bounds_max[3]; // of positions, morph targets at full weight included
};

struct hg_light_table; // light_table.h

struct hg_mesh {
    struct hg_object head;
    struct hg_mesh_part *parts;
    uint32_t part_count, target_count;
    float *weights; // [target_count] defaults
};

// KHR_lights_punctual, and area lights. All shine along the node's -z but points and tubes, whose
// axis is the node's x. Sizes are metres of the world, whatever the node's scale; how intensity
// becomes radiance is in docs/internals/light.md.
struct hg_light {
    struct hg_object head;
    enum {
        HG_LIGHT_DIRECTIONAL,
        HG_LIGHT_POINT,
        HG_LIGHT_SPOT,
        HG_LIGHT_RECTANGLE, // shines from its front
        HG_LIGHT_DISC,      // likewise
        HG_LIGHT_TUBE,      // a cylinder whose ends are dark
    } kind;
    float color[3];
    float intensity; // lux (directional) or candela, where it is greatest
    float range;     // metres, 0 = infinite
    float inner_cone_rad, outer_cone_rad;
    float radius;        // metres; POINT, SPOT: of a sphere, 0 = none; DISC, TUBE: > 0
    float width, height; // metres along x and y; RECTANGLE: > 0; TUBE: its length is the width
    float angular_diameter_rad; // DIRECTIONAL: 0 = parallel light
    bool casts_shadow;
    float lumens; // luminous flux, in place of intensity; 0: none. Not DIRECTIONAL
    // Factor of the intensity by direction (POINT, SPOT), or NULL. `absolute`: intensity is a
    // factor of the candela of its file.
    struct hg_light_table *profile;
    bool absolute;
    // Factor of the colour, or NULL: projected (POINT: all around, equirectangular; SPOT: over the
    // outer cone; DIRECTIONAL: on `width` x `height` around the node, then as the texture wraps),
    // or on the surface (RECTANGLE, DISC). Made of `texture` (hg_light_set_texture).
    struct hg_light_table *image;
    struct hg_texture *texture;
};

// Lux or candela where the light is greatest, by its unit.
float hg_light_peak(const struct hg_light *light);
// Exchanges the texture and makes the image of it; NULL: none. On failure nothing changes.
// HG_E_NOMEM, and what reading the image returns.
enum hg_status hg_light_set_texture(
    struct hg_light *light, struct hg_texture *texture, struct hg_error *err) HG_MUST_CHECK;

#define HG_LIGHT_MOST_ANGLE_RAD 3.0f // largest angular diameter
#define HG_LIGHT_MOST_SIZE_M    1e6f // largest radius, width and height
#define HG_LIGHT_MOST_LUMENS    1e12f
// Whether the light has the size that its kind needs; *what: the member that is not above 0.
bool hg_light_has_size(const struct hg_light *light, const char **what);

struct hg_camera_optics { // what a file says of lens and sensor; 0: nothing
    float f_number, shutter_s, iso, sensor_mm;
    float focus_distance; // metres along the line of sight
};

struct hg_camera {
    struct hg_object head;
    enum { HG_CAMERA_PERSPECTIVE, HG_CAMERA_ORTHOGRAPHIC } kind;
    float vfov_rad, half_height; // vertical; metres
    float aspect;                // of the file, 0 = none: the view's aspect is used
    float near, far;             // metres; far 0 = infinite
    struct hg_camera_optics optics;
};

struct hg_skin {
    struct hg_node **joints; // [joint_count]
    float (*inverse_bind)[16];
    uint32_t joint_count;
};

struct hg_node {
    struct hg_object head;
    struct hg_asset *asset; // NULL: made by a client
    struct hg_node *parent, *first_child, *next_sibling;
    float translation[3], rotation[4], scale[3]; // rotation x y z w, unit
    bool has_matrix;                             // `matrix` instead of TRS
    float matrix[16];                            // column-major
    bool moves; // a client set `next`; posing an animation of the node clears it
    struct {    // local transform one frame later, for motion vectors and motion blur
        float translation[3], rotation[4], scale[3];
    } next;
    bool animated;        // an animation of its asset turns, moves or sizes it
    const struct hg_anim_channel *posed_by[4]; // by enum hg_anim_path: what posed it last, or NULL
    struct {              // of the subtree too
        bool visible;     // false hides it
        bool catches_shadows; // path-traced: seen by the camera only as the shadow on it
        uint32_t layers;      // bits of layers; 0 = those of the parent
    };
    struct hg_mesh *mesh;
    struct hg_light *light;
    struct hg_camera *camera;
    struct hg_skin *skin;
    float *weights; // [mesh->target_count] or NULL: the mesh's
    // EXT_mesh_gpu_instancing: instance transforms relative to the node; 0 = draw once.
    uint32_t instance_count;
    float (*instances)[16];
    // Written by hg_scene_update:
    float world[16], previous_world[16];
    bool world_visible;
};

enum hg_anim_path { HG_ANIM_TRANSLATION, HG_ANIM_ROTATION, HG_ANIM_SCALE, HG_ANIM_WEIGHTS };
enum hg_anim_interpolation { HG_ANIM_STEP, HG_ANIM_LINEAR, HG_ANIM_CUBIC };

struct hg_anim_channel {
    struct hg_node *node;
    enum hg_anim_path path;
    enum hg_anim_interpolation interpolation;
    uint32_t key_count, width; // width: 3, 4 or target_count
    float *times;              // [key_count] seconds, strictly increasing
    float *values;             // [key_count * width], cubic: [key_count * 3 * width] in, value, out
    float *rest; // [width], of the node when the asset was added to a scene; NULL before
    uint32_t animation; // in a scene: that it is of
};

struct hg_animation {
    char *name;
    struct hg_anim_channel *channels;
    uint32_t channel_count;
    double duration_s;
    bool conflicts; // in a scene: it moves what an earlier one does that has no conflict
    bool posed;     // by hg_asset_pose, at
    double time_s;  // this time
};

struct hg_warning { // about an asset, kept for `helio info` and sent as notices
    char what[256], where[128], reason[256];
};

// The axis of a file's coordinates that points up.
enum hg_up_axis {
    HG_UP_AS_FILE, // of loads: coordinates are taken as they are
    HG_UP_AUTO,    // of loads: found out (up_axis.h)
    HG_UP_X,
    HG_UP_Y,
    HG_UP_Z,
    HG_UP_MINUS_X,
    HG_UP_MINUS_Y,
    HG_UP_MINUS_Z,
};

// Everything one file brought. Owned by the scene after hg_scene_add_asset.
struct hg_asset {
    struct hg_scene *scene; // that it was added to; NULL: none
    uint32_t number;
    char *label; // file name
    struct {     // what the file states about itself
        char format[16], version[16], generator[128], copyright[256];
        char **extensions_used;
        uint32_t extension_count;
        double origin[3];      // its coordinates of the asset's zero: far models are moved there
        enum hg_up_axis up;    // that became +Y; HG_UP_AS_FILE: it was not asked for
        const char *up_reason; // why, for people; NULL as long as up is AS_FILE
        uint64_t resident_bytes; // that it took as it was loaded (hg_asset_resident_bytes)
    } file;
    struct hg_node **nodes;
    uint32_t node_count; // ids number << 32 | index
    struct hg_mesh **meshes;
    uint32_t mesh_count;
    struct hg_material **materials;
    uint32_t material_count;
    struct hg_texture **textures;
    uint32_t texture_count;
    struct hg_light **lights;
    uint32_t light_count;
    struct hg_camera **cameras;
    uint32_t camera_count;
    struct hg_skin **skins;
    uint32_t skin_count;
    struct hg_animation *animations;
    uint32_t animation_count;
    struct {
        char **names;
        uint32_t count;
        int32_t chosen; // -1 = none
    } variants;
    struct hg_warning *warnings;
    uint32_t warning_count;
    struct hg_node **roots;
    uint32_t root_count; // of the chosen scene of the file
};

enum hg_environment_kind { HG_ENV_NONE, HG_ENV_COLOR, HG_ENV_IMAGE, HG_ENV_SKY };

// Whether a sky has its sun, its disc and direct light, or its scattered light alone.
enum hg_sky_sun {
    HG_SKY_SUN_AUTO, // unless the scene has a directional light, which stands for it
    HG_SKY_SUN_ON,
    HG_SKY_SUN_OFF,
};

struct hg_environment {
    enum hg_environment_kind kind;
    uint64_t revision;
    struct hg_image image; // IMAGE: RGBA32F equirectangular radiance; direction convention below
    // IMAGE: the file behind `image`, which then is what light is made from and may be smaller
    // (renderer/light/env/env_file.h); what is seen comes from the file's pages. Its image is NULL:
    // what is seen is `image`. head.revision grows with every exchange.
    struct hg_texture background;
    // u = atan2(d.z, d.x) / (2 pi) + 0.5, v = 0.5 - asin(d.y) / pi (v from the top)
    uint8_t image_hash[32]; // SHA-256 of the file, key of prefilter caches
    float color[3];         // COLOR
    float intensity;        // default 1
    float rotation_rad;     // about +Y; turns a sky with its sun
    float sun_direction[3]; // SKY: towards the sun, unit
    float turbidity;        // SKY: 1..10
    enum hg_sky_sun sun;    // SKY
    // None was chosen: default_light.h writes kind, intensity and sun, from these where they apply.
    bool automatic;
    bool fills; // what it wrote is a fill to the scene's lights
    float wanted_intensity;
    enum hg_sky_sun wanted_sun;
};

struct hg_scene {
    uint64_t revision; // grows with every published change
    struct hg_environment environment;
    // Live objects by kind, in order of creation; NULL-free.
    struct hg_object_list {
        struct hg_object **items;
        size_t capacity;
        uint32_t count;
    } objects[HG_OBJECT_KINDS];
    struct hg_asset **assets;
    size_t asset_capacity;
    uint32_t asset_count;
    struct hg_id_map { // id -> object, per kind
        struct hg_id_slot *slots;
        uint32_t capacity, used;
    } ids[HG_OBJECT_KINDS];
};
// An empty scene. HG_E_NOMEM.
enum hg_status hg_scene_create(struct hg_scene **out) HG_MUST_CHECK;
void hg_scene_destroy(struct hg_scene *scene); // accepts NULL

// NULL when there is none. The _node, _mesh, ... forms cast.
struct hg_object *hg_scene_find(
    const struct hg_scene *scene, enum hg_object_kind kind, uint64_t id);

// Adds a zeroed object (with its kind's defaults) under a new id. HG_E_EXISTS, HG_E_NOMEM.
enum hg_status hg_scene_add(struct hg_scene *scene, enum hg_object_kind kind, uint64_t id,
    struct hg_object **out) HG_MUST_CHECK;
// Removes a client-made object; references to it become NULL, children of a node become roots.
// HG_E_NOTFOUND; HG_E_STATE for objects of an asset.
enum hg_status hg_scene_remove(struct hg_scene *scene, enum hg_object_kind kind, uint64_t id,
    struct hg_error *err) HG_MUST_CHECK;
// Re-parents; HG_E_INVAL when it would make a cycle. parent NULL = root.
enum hg_status hg_scene_set_parent(
    struct hg_scene *scene, struct hg_node *node, struct hg_node *parent) HG_MUST_CHECK;
// Marks an object changed at the scene's next revision.
void hg_scene_touch(struct hg_scene *scene, struct hg_object *object);
// One published change: revision + 1.
void hg_scene_publish(struct hg_scene *scene);

// Takes ownership of the asset on success and registers its objects. HG_E_EXISTS, HG_E_NOMEM.
enum hg_status hg_scene_add_asset(
    struct hg_scene *scene, struct hg_asset *asset, struct hg_node *parent) HG_MUST_CHECK;
enum hg_status hg_scene_remove_asset(struct hg_scene *scene, uint32_t number) HG_MUST_CHECK;
struct hg_asset *hg_scene_find_asset(const struct hg_scene *scene, uint32_t number);
void hg_asset_destroy(struct hg_asset *asset); // one not owned by a scene; accepts NULL

// Poses the nodes of an asset and marks those of a scene as changed at its next revision.
// animation -1 = all without conflicts; time is clamped to each channel's range. Others that were
// posed and move the same things end: what they alone move goes back to rest. HG_E_NOTFOUND for an
// unknown animation.
enum hg_status hg_asset_pose(
    struct hg_asset *asset, int32_t animation, double time_s) HG_MUST_CHECK;
// Whether any of the scene's animations was posed or any node moves: only then anything does in
// time.
bool hg_scene_moves(const struct hg_scene *scene);
// For a look at other times: poses what was posed before at its time plus offset_s, and nodes that
// move `frames` on their way (places and sizes on the line, turns at one speed; before it
// backwards), without a change of revisions, and keeps what was there (a zeroed *kept; further
// calls leave it). The caller updates the scene and puts things back before other code looks at
// it. HG_E_NOMEM.
struct hg_pose_kept {
    float *values;
    size_t capacity, moved; // values of animations come first
    bool taken;
};
enum hg_status hg_scene_pose_shift(struct hg_scene *scene, double offset_s, double frames,
    struct hg_pose_kept *kept) HG_MUST_CHECK;
// Likewise, with what was posed in its rest pose, that of the file; nodes that move stay.
// HG_E_NOMEM.
enum hg_status hg_scene_pose_rest(struct hg_scene *scene, struct hg_pose_kept *kept) HG_MUST_CHECK;
void hg_scene_pose_restore(struct hg_scene *scene, struct hg_pose_kept *kept); // frees, too
// Material that a part shows under the asset's chosen variant; NULL = default material.
struct hg_material *hg_asset_part_material(
    const struct hg_asset *asset, const struct hg_mesh_part *part);

// Recomputes world matrices and visibility of all nodes.
void hg_scene_update(struct hg_scene *scene);
// World bounds of a node's subtree (NULL = all), skins and morphs included conservatively.
// False when there is no geometry. Call after hg_scene_update.
bool hg_scene_bounds(
    const struct hg_scene *scene, const struct hg_node *node, float min[3], float max[3]);

#endif
