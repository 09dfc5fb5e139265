// mesh_file.h - what the readers of PLY, STL, OBJ and OFF share: errors with places, memory that is
// charged before it is taken, tables, the asset's origin, and parts from vertices.
// Floor 2, private to scene/. One thread per file.
//
// The readers run over the file's bytes once or twice and keep no tree of it. Coordinates are
// doubles until the whole file is known; hg_mesh_file_center then decides what is subtracted from
// them, so that coordinates in the millions keep their digits as floats.
#ifndef HG_RENDERER_SCENE_FORMATS_MESH_MESH_FILE_H
#define HG_RENDERER_SCENE_FORMATS_MESH_MESH_FILE_H

#include "renderer/scene/asset.h"
#include "renderer/scene/formats/formats.h"
#include "renderer/scene/formats/text_scan.h"

struct hg_mesh_file {
    const struct hg_load_params *params;
    struct hg_asset *asset;
    struct hg_error *err;
    const char *label; // name in messages
    const uint8_t *data;
    size_t size;
    bool is_text; // places in messages have lines
    uint64_t memory_used, memory_limit, next_progress;
    double center[3];            // subtracted from all coordinates
    struct hg_node *root, *last; // of the asset; its last child
};

// Starts a file; `main` is borrowed. HG_E_NOMEM.
enum hg_status hg_mesh_file_begin(struct hg_mesh_file *f, const struct hg_load_params *params,
    const struct hg_refbuf *main, const char *label, struct hg_error *err) HG_MUST_CHECK;
// Takes the asset on HG_OK, destroys it otherwise; gives it its list of roots. HG_E_FORMAT when it
// has no geometry.
enum hg_status hg_mesh_file_end(
    struct hg_mesh_file *f, enum hg_status status, struct hg_asset **out) HG_MUST_CHECK;

// Sets the error, at a byte of the file ("line 3, byte 40" in texts).
enum hg_status hg_mesh_file_fail(struct hg_mesh_file *f, enum hg_status status, uint64_t offset,
    const char *fmt, ...) HG_PRINTF(4, 5);
enum hg_status hg_mesh_file_no_memory(struct hg_mesh_file *f);
// "line 3, byte 40" or "byte 40".
void hg_mesh_file_place(const struct hg_mesh_file *f, uint64_t offset, char *out, size_t size);
// To be called often; HG_E_CANCELLED.
enum hg_status hg_mesh_file_progress(struct hg_mesh_file *f, uint64_t offset) HG_MUST_CHECK;

// Zeroed, charged to the file's limit; freed with hg_free. NULL sets the error (HG_E_LIMIT,
// HG_E_NOMEM).
void *hg_mesh_file_alloc(struct hg_mesh_file *f, uint64_t count, size_t size) HG_MUST_CHECK;
// Frees an array and what it was charged.
void hg_mesh_file_free(struct hg_mesh_file *f, void *array, uint64_t count, size_t size);

// ---- growing arrays and tables -----------------------------------------------------------------

struct hg_mesh_array { // zeroed but for item_bytes = empty
    void *items;
    uint64_t count, capacity;
    uint32_t item_bytes;
};

// Room for `more` items at the end, which count from now on; NULL sets the error.
void *hg_mesh_array_add(
    struct hg_mesh_file *f, struct hg_mesh_array *a, uint64_t more) HG_MUST_CHECK;
void hg_mesh_array_finish(struct hg_mesh_file *f, struct hg_mesh_array *a);

// Numbers keys of a few words in the order in which they come: 0, 1, 2, ...
struct hg_key_table { // zeroed but for key.item_bytes = empty
    struct hg_mesh_array keys;
    uint32_t *slots; // [slot_count] 1 + number; a power of two
    uint64_t slot_count;
};

enum { HG_KEY_WORDS = 4 }; // at most, in a key

// HG_E_LIMIT beyond 2^31 keys, HG_E_NOMEM.
enum hg_status hg_key_table_number(struct hg_mesh_file *f, struct hg_key_table *t,
    const uint32_t *key, uint32_t *number) HG_MUST_CHECK;
void hg_key_table_finish(struct hg_mesh_file *f, struct hg_key_table *t);
// A key of two words for a name.
void hg_key_of_name(struct hg_text name, uint32_t key[2]);

// ---- geometry ----------------------------------------------------------------------------------

// Chooses f->center by the bounds of all coordinates (non-finite ones are passed over): zero, but
// for models that lie so far from zero that floats would show steps.
void hg_mesh_file_center(struct hg_mesh_file *f, const double *xyz, uint64_t count);
// Coordinates about the centre; false (and zero) when one is not finite as float.
bool hg_mesh_file_place_vertex(const struct hg_mesh_file *f, const double xyz[3], float out[3]);

// sRGB (IEC 61966-2-1) 0..1 to linear.
float hg_srgb_decode(double value);

// A material that is seen from both sides. Without a colour of the file's: neutral grey.
struct hg_material *hg_mesh_file_material(struct hg_mesh_file *f, const char *name) HG_MUST_CHECK;
// The texture of an image file for a slot; warns where it cannot be read. HG_E_NOMEM.
enum hg_status hg_mesh_file_texture(
    struct hg_mesh_file *f, const char *name, struct hg_texture_ref *slot) HG_MUST_CHECK;
// A mesh with room for parts, in a node of its own below the root.
struct hg_mesh *hg_mesh_file_mesh(
    struct hg_mesh_file *f, const char *name, uint32_t parts) HG_MUST_CHECK;
// What a part needs before it is in a scene: normals by crease angle where it has none, tangents
// where its material wants them, bounds.
enum hg_status hg_mesh_file_finish_part(
    struct hg_mesh_file *f, struct hg_mesh_part *part, const uint32_t *smoothing) HG_MUST_CHECK;
// Drops vertices that no index names.
enum hg_status hg_mesh_part_drop_unused(struct hg_mesh_part *part) HG_MUST_CHECK;

#endif
