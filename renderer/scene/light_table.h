// light_table.h - what varies over a light, as tables of words that shaders and the host read
// alike: photometric profiles (factors of an intensity by direction) and images (factors of a
// colour). Floor 2 (scene). A table is immutable. References belong to the thread of the scene, or
// of the load that makes it.
#ifndef HG_RENDERER_SCENE_LIGHT_TABLE_H
#define HG_RENDERER_SCENE_LIGHT_TABLE_H

#include "base/status.h"
#include "renderer/image/image.h"
#include "shaders/shared/light_table.h"

#define HG_LIGHT_IMAGE_MOST_SIDE    512     // larger images are averaged down
#define HG_LIGHT_PROFILE_MOST_BYTES 4194304 // of a file

struct hg_image_source;
struct hg_texture;

struct hg_light_table {
    uint32_t refs, word_count;
    uint64_t hash;     // of the words
    float peak_cd;     // profiles: candela of the file where the factor is 1
    float solid_angle; // profiles: lumens of the whole sphere per candela of the peak
    uint32_t words[];  // [word_count], shaders/shared/light_table.h
};

struct hg_light_table *hg_light_table_ref(struct hg_light_table *table);
void hg_light_table_unref(struct hg_light_table *table); // accepts NULL

// The factors of a profile at thetas x phis directions (HG_LIGHT_PROFILE), of which the greatest
// becomes
// 1. HG_E_NOMEM; HG_E_INVAL where all are 0.
enum hg_status hg_light_profile_create(const float *factors, uint32_t thetas, uint32_t phis,
    struct hg_light_table **out) HG_MUST_CHECK;

// A profile from a file of the format IES LM-63 (1986 to 2019). Types C, B and A of photometry;
// TILT is read and not applied. HG_E_FORMAT with "line N" in err->where, HG_E_LIMIT, HG_E_NOMEM.
// Source: ANSI/IES LM-63-19, "IES Standard File Format for the Electronic Transfer of Photometric
// Data".
enum hg_status hg_light_profile_read_ies(const char *name, const void *bytes, size_t size,
    struct hg_light_table **out, struct hg_error *err) HG_MUST_CHECK;

// Linear colour of a texture, with levels that each are blurred by their own texels. HG_E_NOMEM,
// and what reading the image file returns.
enum hg_status hg_light_image_create(const struct hg_texture *texture, struct hg_light_table **out,
    struct hg_error *err) HG_MUST_CHECK;

// Factor of a profile in a direction of the light's frame, unit length.
float hg_light_profile_at(const uint32_t *words, const float direction[3]);
// Colour of an image, bilinear, finest level.
void hg_light_image_at(const uint32_t *words, float u, float v, float out[3]);

#endif
