#include "renderer/scene/load.h"

#include <string.h>
#include <strings.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/demo/demo.h"
#include "renderer/scene/fetch.h"
#include "renderer/scene/formats/formats.h"
#include "renderer/scene/up_axis.h"

static const char *base_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

static bool has_suffix(const char *path, const char *suffix)
{
    size_t n = strlen(path), k = strlen(suffix);
    return n >= k && strcasecmp(path + n - k, suffix) == 0;
}

// Content decides; the name only where a text could be anything.
static bool is_gltf(const char *path, const struct hg_refbuf *data)
{
    if (data->size >= 4 && memcmp(data->data, "glTF", 4) == 0)
        return true;
    return has_suffix(path, ".gltf") || has_suffix(path, ".glb");
}

static enum hg_status load_other(const struct hg_load_params *params, const struct hg_refbuf *data,
    const char *label, struct hg_asset **out, struct hg_error *err)
{
    static const struct {
        const char *suffix, *format;
        hg_format_load_fn *load;
    } readers[] = {{".ply", "ply", hg_ply_load}, {".stl", "stl", hg_stl_load},
        {".obj", "obj", hg_obj_load}, {".off", "off", hg_off_load}};
    if (hg_heightmap_knows(label, data))
        return hg_heightmap_load(params, data, label, out, err);
    for (size_t i = 0; i < sizeof readers / sizeof *readers; i++)
        if (has_suffix(label, readers[i].suffix)) {
            const enum hg_status status = readers[i].load(params, data, label, out, err);
            if (!status)
                memcpy((*out)->file.format, readers[i].format, strlen(readers[i].format) + 1);
            return status;
        }
    if (hg_import_knows(label))
        return hg_import_load(params, data, label, out, err);
    return hg_error_set(err, HG_E_UNSUPPORTED, params->path, NULL,
        "unknown file format; read are " HG_LOAD_FORMATS);
}

// Turns what was loaded upright, if it was asked for.
static enum hg_status turn_upright(const struct hg_load_params *params,
    const struct hg_refbuf *data, struct hg_asset **out, struct hg_error *err)
{
    if (params->up == HG_UP_AS_FILE || !hg_up_axis_apply(params, data, *out))
        return HG_OK;
    hg_asset_destroy(*out);
    *out = NULL;
    return hg_error_set(err, HG_E_NOMEM, params->path, NULL, "no memory");
}

static enum hg_status load_upright(const struct hg_load_params *params,
    const struct hg_refbuf *data, const char *label, struct hg_asset **out, struct hg_error *err)
{
    const enum hg_status status = load_other(params, data, label, out, err);
    return status ? status : turn_upright(params, data, out, err);
}

// A ".gz" is unpacked first; the loaders then see the name without it.
static enum hg_status load_import(const struct hg_load_params *params, struct hg_refbuf *data,
    uint64_t limit, struct hg_asset **out, struct hg_error *err)
{
    const char *label = base_name(params->path);
    if (!has_suffix(label, ".gz"))
        return load_upright(params, data, label, out, err);
    char *inner = hg_strndup(label, strlen(label) - 3);
    struct hg_refbuf *unpacked = NULL;
    enum hg_status status = inner ? hg_import_gunzip(data, limit, label, &unpacked, err)
                                  : hg_error_set(err, HG_E_NOMEM, label, NULL, "no memory");
    if (!status)
        status = load_upright(params, unpacked, inner, out, err);
    hg_refbuf_unref(unpacked);
    hg_free(inner);
    return status;
}

static enum hg_status load_main(
    const struct hg_load_params *params, struct hg_asset **out, struct hg_error *err)
{
    uint64_t limit = params->memory_limit_bytes ? params->memory_limit_bytes : 8ull << 30;
    struct hg_refbuf *data = NULL;
    enum hg_status status =
        params->fetch == hg_fetch_file
            ? hg_fetch_read(params->path, limit, &data, err)
            : params->fetch(params->fetch_user, params->path, limit, &data, err);
    if (status)
        return status;
    if (!is_gltf(params->path, data))
        status = load_import(params, data, limit, out, err);
    else if (!(status = hg_gltf_load(params, data, base_name(params->path), out, err)))
        status = turn_upright(params, data, out, err);
    hg_refbuf_unref(data);
    return status;
}

static void size_points(const struct hg_load_params *params, struct hg_asset *asset)
{
    for (uint32_t m = 0; m < asset->mesh_count; m++) {
        for (uint32_t p = 0; p < asset->meshes[m]->part_count; p++) {
            asset->meshes[m]->parts[p].point_scale = params->point_scale;
            asset->meshes[m]->parts[p].point_diameter = params->point_diameter;
        }
    }
}

// What readers do not count themselves: objects, and what came of a process.
static enum hg_status check_resident(
    const struct hg_load_params *params, struct hg_asset **out, struct hg_error *err)
{
    const uint64_t bytes = hg_asset_resident_bytes(*out), most = params->resident_limit_bytes;
    (*out)->file.resident_bytes = bytes;
    if (!most || bytes <= most)
        return HG_OK;
    hg_asset_destroy(*out);
    *out = NULL;
    hg_error_set(err, HG_E_LIMIT, params->path, NULL,
        "it takes %llu MiB of memory, and may take %llu", (unsigned long long)(bytes >> 20),
        (unsigned long long)(most >> 20));
    return hg_error_limit(err, HG_LOAD_LIMIT_RESIDENT, 0);
}

static enum hg_status load_spilled(
    const struct hg_load_params *params, struct hg_asset **out, struct hg_error *err)
{
    hg_spill_begin(params->path);
    enum hg_status status = load_main(params, out, err);
    if (!status)
        status = check_resident(params, out, err);
    if (!status)
        size_points(params, *out);
    hg_spill_end();
    return status;
}

enum hg_status hg_load_asset(
    const struct hg_load_params *params, struct hg_asset **out, struct hg_error *err)
{
    struct hg_error local = {0};
    err = err ? err : &local;
    *out = NULL;
    if (params->asset_number == 0 || !params->path)
        return hg_error_set(err, HG_E_INVAL, "asset", NULL, "a number >= 1 and a path are needed");
    if (strcmp(params->path, "demo:") == 0)
        return hg_demo_create(params->asset_number, params->jobs, out, err);
    if (params->fetch)
        return load_spilled(params, out, err);
    struct hg_fetch fetch;
    enum hg_status status = hg_fetch_init(&fetch, params, err);
    if (status)
        return status;
    struct hg_load_params with_files = *params;
    with_files.fetch = hg_fetch_file;
    with_files.fetch_user = &fetch;
    status = load_spilled(&with_files, out, err);
    hg_fetch_finish(&fetch);
    return status;
}
