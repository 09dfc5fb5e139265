// env_file.h - an environment from a file of any size, which is never decoded whole.
// Floor 2 (light). Any thread.
//
// The background is sampled from its pages, like every texture (hg_environment.background); of
// files of at most HG_ENVIRONMENT_PLAIN_TEXELS from a plain image, without page table lookups, in
// at most 16 MiB. Lighting is computed from an image of at most HG_ENVIRONMENT_IMAGE_WIDTH texels,
// twice the resolution of the finest prefiltered level; larger files are box-filtered to it row by
// row while they are read.
#ifndef HG_RENDERER_LIGHT_ENV_ENV_FILE_H
#define HG_RENDERER_LIGHT_ENV_ENV_FILE_H

#include <stdatomic.h>

#include "renderer/scene/scene.h"

#define HG_ENVIRONMENT_IMAGE_WIDTH  4096u // half of it high: 128 MiB at most
#define HG_ENVIRONMENT_PLAIN_TEXELS (2048u * 1024u)

// Zeroed = none.
struct hg_environment_file {
    struct hg_image image;          // RGBA32F; the file's own texels when it is no larger
    uint8_t hash[32];               // SHA-256 of the file
    struct hg_image_source *source; // NULL: there are no pages
};

// cancel (may be NULL) is looked at between bands of rows. HG_E_CANCELLED, statuses of reader.h.
// *out is zeroed on failure.
enum hg_status hg_environment_file_read(const char *path, const atomic_bool *cancel,
    struct hg_environment_file *out, struct hg_error *err) HG_MUST_CHECK;
void hg_environment_file_finish(struct hg_environment_file *file); // accepts a zeroed one

// The scene's environment becomes the file's, which is taken (zeroed).
void hg_environment_file_use(struct hg_environment_file *file, struct hg_environment *environment);

#endif
