// scene_files.h - files in memory for tests of loaders, and what the tests ask of assets.
#ifndef HG_TESTS_SCENE_FILES_H
#define HG_TESTS_SCENE_FILES_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "renderer/scene/load.h"
#include "tests/support/check.h"

enum { FILES_MAX = 4 };

struct files {
    struct {
        const char *name;
        const void *data;
        size_t size;
    } list[FILES_MAX]; // the first is the main one
};

static inline enum hg_status files_fetch(
    void *user, const char *uri, uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    const struct files *files = user;
    *out = NULL;
    for (int i = 0; i < FILES_MAX && files->list[i].name; i++) {
        if (strcmp(files->list[i].name, uri) != 0 || files->list[i].size > limit_bytes)
            continue;
        *out = hg_refbuf_create(files->list[i].size);
        if (*out && files->list[i].size)
            memcpy((*out)->data, files->list[i].data, files->list[i].size);
        return *out ? HG_OK : HG_E_NOMEM;
    }
    return hg_error_set(err, HG_E_NOTFOUND, uri, NULL, "no such file");
}

static inline enum hg_status files_load(
    struct files *files, struct hg_asset **out, struct hg_error *err)
{
    *err = (struct hg_error){0};
    return hg_load_asset(&(struct hg_load_params){.path = files->list[0].name,
                             .fetch = files_fetch,
                             .fetch_user = files,
                             .asset_number = 1,
                             .scene_index = -1,
                             .memory_limit_bytes = 64 << 20},
        out, err);
}

static inline struct hg_asset *load_bytes(const char *name, const void *data, size_t size)
{
    struct files files = {{{name, data, size}}};
    struct hg_asset *asset;
    struct hg_error err;
    const enum hg_status status = files_load(&files, &asset, &err);
    if (status)
        fail_msg("%s: %s: %s", name, err.where, err.reason);
    return asset;
}

static inline struct hg_asset *load_text(const char *name, const char *text)
{
    return load_bytes(name, text, strlen(text));
}

// Loads what is refused, and compares parts of the message.
static inline void expect_refusal(const char *name, const void *data, size_t size,
    enum hg_status status, const char *where, const char *reason)
{
    struct files files = {{{name, data, size}}};
    struct hg_asset *asset;
    struct hg_error err;
    assert_int_equal(files_load(&files, &asset, &err), status);
    assert_null(asset);
    if (strcmp(err.where, where) != 0 || !strstr(err.reason, reason))
        fail_msg("%s: %s", err.where, err.reason);
}

static inline void expect_text_refusal(
    const char *name, const char *text, const char *where, const char *reason)
{
    expect_refusal(name, text, strlen(text), HG_E_FORMAT, where, reason);
}

// Each prefix is a scene or an error with a reason; returns how many were scenes.
static inline size_t load_prefixes(const char *name, const void *data, size_t size)
{
    size_t scenes = 0;
    for (size_t n = 0; n <= size; n++) {
        struct files files = {{{name, data, n}}};
        struct hg_asset *asset;
        struct hg_error err;
        const enum hg_status status = files_load(&files, &asset, &err);
        assert_true((status == HG_OK) == (asset != NULL));
        assert_true(status == HG_OK || (err.status == status && err.reason[0] && err.what[0]));
        scenes += status == HG_OK;
        hg_asset_destroy(asset);
    }
    return scenes;
}

static inline const struct hg_mesh_part *only_part(const struct hg_asset *asset)
{
    assert_int_equal(asset->mesh_count, 1);
    assert_int_equal(asset->meshes[0]->part_count, 1);
    return asset->meshes[0]->parts;
}

static inline bool has_warning(const struct hg_asset *asset, const char *text)
{
    for (uint32_t i = 0; i < asset->warning_count; i++)
        if (strstr(asset->warnings[i].reason, text))
            return true;
    return false;
}

// The sum of the triangles' areas along z; *negative counts those that turn the other way.
static inline double area_z(const struct hg_mesh_part *part, uint32_t *negative)
{
    double sum = 0;
    *negative = 0;
    for (uint32_t i = 0; i < part->index_count; i += 3) {
        const float *p[3];
        for (int c = 0; c < 3; c++)
            p[c] = part->positions + (size_t)part->indices[i + c] * 3;
        const double area = ((double)(p[1][0] - p[0][0]) * (double)(p[2][1] - p[0][1]) -
                                (double)(p[1][1] - p[0][1]) * (double)(p[2][0] - p[0][0])) /
                            2;
        sum += area;
        *negative += area < 0;
    }
    return sum;
}

static inline void expect_vector(const float *got, const float *want, uint32_t n, float tolerance)
{
    for (uint32_t i = 0; i < n; i++)
        if (!(fabsf(got[i] - want[i]) <= tolerance))
            fail_msg("component %u: %g, expected %g", i, (double)got[i], (double)want[i]);
}

#endif
