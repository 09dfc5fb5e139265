#include "renderer/bench/references.h"

#include <stdio.h>
#include <string.h>

#include "base/file.h"
#include "base/sha256.h"
#include "renderer/image/image.h"
#include "renderer/scene/fingerprint.h"

#define PATH_BYTES 4096

enum hg_status hg_bench_references_begin(struct hg_bench_references *r, struct hg_scene *scene,
    const char *folder, const struct hg_view_params *params, struct hg_error *err)
{
    struct hg_fingerprint *fingerprint = hg_fingerprint_create();
    *r = (struct hg_bench_references){.folder = folder, .params = *params};
    if (fingerprint == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
    hg_scene_update(scene);
    const enum hg_status status = hg_fingerprint_scene(fingerprint, scene, r->scene, err);
    hg_fingerprint_destroy(fingerprint);
    return status;
}

static enum hg_status name_file(const struct hg_bench_references *r,
    const struct hg_bench_walk *walk, uint32_t pose, char path[PATH_BYTES], struct hg_error *err)
{
    struct hg_sha256 *hash = hg_sha256_create();
    uint8_t digest[HG_SHA256_BYTES];
    char hex[HG_SHA256_HEX];
    if (hash == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
    hg_sha256_update(hash, r->scene, sizeof r->scene);
    hg_sha256_update(hash, &r->params, sizeof r->params);
    hg_sha256_update(hash, &walk->vfov_rad, sizeof walk->vfov_rad);
    hg_sha256_update(hash, &walk->path[pose], sizeof walk->path[pose]);
    hg_sha256_end(hash, digest);
    hg_sha256_hex(digest, hex);
    return snprintf(path, PATH_BYTES, "%s/%s.png", r->folder, hex) < PATH_BYTES
               ? HG_OK
               : hg_error_set(err, HG_E_LIMIT, "bench", "references", "too long a path");
}

enum hg_status hg_bench_picture_write(const struct hg_bench_walk *walk, const char *path,
    struct hg_refbuf *picture, struct hg_error *err)
{
    const struct hg_image image = {.width = walk->width,
        .height = walk->height,
        .format = HG_PIXEL_RGBA8,
        .has_alpha = true,
        .size_bytes = (size_t)walk->width * walk->height * 4,
        .pixels = picture->data};
    const struct hg_image_encode params = {.file = HG_IMAGE_PNG8};
    struct hg_writer file = {0};
    enum hg_status status = hg_image_encode(&image, &params, &file, err);
    if (status == HG_OK)
        status = hg_file_write_atomic(path, file.data, file.size, err);
    hg_writer_finish(&file);
    return status;
}

// HG_E_NOTFOUND where there is none of that size.
static enum hg_status find(const struct hg_bench_walk *walk, const char *path,
    struct hg_refbuf **out, struct hg_error *err)
{
    struct hg_image image;
    enum hg_status status = hg_image_read_file(path, HG_PIXEL_RGBA8, NULL, &image, err);
    if (status != HG_OK)
        return status;
    if (image.width != walk->width || image.height != walk->height)
        status = hg_error_set(err, HG_E_NOTFOUND, "bench", "references", "of another size");
    *out = status == HG_OK ? hg_refbuf_create(image.size_bytes) : NULL;
    if (*out != NULL)
        memcpy((*out)->data, image.pixels, image.size_bytes);
    else if (status == HG_OK)
        status = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
    hg_image_finish(&image);
    return status;
}

enum hg_status hg_bench_references_get(struct hg_bench_references *r,
    const struct hg_bench_walk *walk, struct hg_view *view, uint32_t pose, struct hg_refbuf **out,
    struct hg_error *err)
{
    char path[PATH_BYTES];
    enum hg_status status = HG_OK;
    *out = NULL;
    if (r->folder != NULL) {
        status = name_file(r, walk, pose, path, err);
        if (status == HG_OK)
            status = find(walk, path, out, err);
        if (status != HG_E_NOTFOUND) {
            r->found += status == HG_OK;
            return status;
        }
    }
    status = hg_bench_walk_settle(walk, view, pose, out, err);
    r->made += status == HG_OK;
    return status == HG_OK && r->folder != NULL ? hg_bench_picture_write(walk, path, *out, err)
                                                : status;
}
