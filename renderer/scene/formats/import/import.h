// import.h - FBX and Collada through assimp's C interface.
// Floor 2, private to scene/. One load on one thread. assimp gets the main file and no other.
#ifndef HG_RENDERER_SCENE_FORMATS_IMPORT_IMPORT_H
#define HG_RENDERER_SCENE_FORMATS_IMPORT_IMPORT_H

#include <assimp/scene.h>

#include "renderer/scene/asset.h"
#include "renderer/scene/formats/formats.h"
#include "renderer/scene/formats/import/collada_camera.h"

struct hg_import {
    const struct hg_load_params *params;
    struct hg_asset *asset;
    struct hg_error *err;
    const char *file; // name in messages
    const struct aiScene *scene;
    uint64_t memory_used, memory_limit;
    bool states_sides; // the file says of materials that they are seen from one side
    struct hg_collada_cameras cameras; // of a Collada file
};

// All but the images, which are fetched by name later: their sources hold names, or what the file
// embeds. As hg_import_load; params: asset_number, memory_limit_bytes, progress.
enum hg_status hg_import_parse(const struct hg_load_params *params, const struct hg_refbuf *main,
    const char *label, struct hg_asset **out, struct hg_error *err) HG_MUST_CHECK;

// Parts of hg_import_parse, in this order.
enum hg_status hg_import_materials(struct hg_import *im) HG_MUST_CHECK;
enum hg_status hg_import_meshes(struct hg_import *im) HG_MUST_CHECK;
enum hg_status hg_import_nodes(struct hg_import *im) HG_MUST_CHECK;
enum hg_status hg_import_animations(struct hg_import *im) HG_MUST_CHECK;

// import_morph.c: morph targets of a mesh with one part; the weights of a node that has it;
// channels of an animation, for which there is room (count), by nodes.
enum { HG_IMPORT_TARGETS_MAX = 4096 };
enum hg_status hg_import_targets(
    struct hg_import *im, const struct aiMesh *from, struct hg_mesh *mesh) HG_MUST_CHECK;
enum hg_status hg_import_weights(struct hg_import *im, struct hg_node *node) HG_MUST_CHECK;
uint32_t hg_import_count_morphs(const struct hg_import *im, const struct aiAnimation *from);
enum hg_status hg_import_morphs(struct hg_import *im, const struct aiAnimation *from, double rate,
    struct hg_animation *animation) HG_MUST_CHECK;

// Brings the lights' intensities to candela and lux, when nodes and meshes are there.
void hg_import_light_units(struct hg_import *im);

// *known: false for ambient light, which has no counterpart.
unsigned hg_import_light_kind(const struct aiLight *from, bool *known);
// Metres per unit of lengths that assimp does not scale with the nodes.
float hg_import_file_unit(const struct hg_import *im);
void *hg_import_alloc(struct hg_import *im, uint64_t count, size_t size) HG_MUST_CHECK;
enum hg_status hg_import_fail(
    struct hg_import *im, enum hg_status status, const char *where, const char *reason);

#endif
