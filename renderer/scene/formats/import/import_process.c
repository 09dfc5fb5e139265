// import_process.c - where FBX and Collada files are parsed: in a process of its own that answers
// with a packed asset, or here where there is none. What the file names is fetched here, after it.
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/asset_pack.h"
#include "renderer/scene/formats/import/import.h"
#include "renderer/scene/formats/texture_file.h"

static bool ask_progress(void *user)
{
    const struct hg_load_params *params = user;
    return !params->progress || params->progress(params->progress_user, "parsing", 0, 1);
}

static enum hg_status parse_isolated(const struct hg_load_params *params,
    const struct hg_refbuf *main, const char *label, struct hg_asset **out, struct hg_error *err)
{
    struct hg_writer args = {0};
    struct hg_isolate_result result;
    hg_write_u64(&args, params->memory_limit_bytes);
    const struct hg_isolate_call call = {.op = HG_ISOLATE_IMPORT,
        .args = args.data,
        .args_size = args.size,
        .data = main->data,
        .data_size = main->size,
        .go_on = ask_progress,
        .user = (void *)params};
    enum hg_status status = args.failed ? HG_E_NOMEM : hg_isolate_once(label, &call, &result, err);
    hg_writer_finish(&args);
    if (status)
        return status;
    const struct hg_asset_unpack unpack = {.data = result.data,
        .size = result.size,
        .asset_number = params->asset_number,
        .memory_limit_bytes = params->memory_limit_bytes,
        .label = label};
    status = hg_asset_unpack(&unpack, out, err);
    hg_isolate_get()->release(&result);
    return status;
}

enum hg_status hg_import_serve(
    struct hg_isolate_request *request, struct hg_writer *out, struct hg_error *err)
{
    const struct hg_load_params params = {
        .asset_number = 1, .memory_limit_bytes = hg_read_u64(&request->args)};
    struct hg_asset *asset = NULL;
    struct hg_refbuf *main = hg_refbuf_create(request->data_size);
    if (!main)
        return HG_E_NOMEM;
    if (request->data)
        memcpy(main->data, request->data, request->data_size);
    enum hg_status status = hg_import_knows(request->name)
                                ? hg_import_parse(&params, main, request->name, &asset, err)
                                : HG_E_INVAL;
    hg_refbuf_unref(main);
    if (!status)
        hg_asset_pack(asset, out);
    hg_asset_destroy(asset);
    return status;
}

// ---- images ------------------------------------------------------------------------------------

static enum hg_status fetch_image(const struct hg_load_params *params, struct hg_asset *asset,
    struct hg_texture *texture, uint64_t limit_bytes)
{
    struct hg_image_source *source = texture->image;
    char *name = hg_strdup(source->label);
    if (!name)
        return HG_E_NOMEM;
    enum hg_status status = source->encoded || source->pixels.pixels
                                ? HG_OK
                                : hg_texture_fetch(params, asset, name, limit_bytes, source);
    if (!status && !hg_texture_is_usable(asset, name, source)) {
        hg_image_source_unref(source);
        texture->image = NULL;
    }
    hg_free(name);
    return status;
}

static enum hg_status fetch_images(
    const struct hg_load_params *params, struct hg_asset *asset, uint64_t limit_bytes)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < asset->texture_count && !status; i++) {
        status = fetch_image(params, asset, asset->textures[i], limit_bytes);
        const struct hg_image_source *source = asset->textures[i]->image;
        const uint64_t taken = source && source->encoded ? source->encoded->size : 0;
        limit_bytes -= taken < limit_bytes ? taken : limit_bytes;
    }
    return status;
}

enum hg_status hg_import_load(const struct hg_load_params *params, const struct hg_refbuf *main,
    const char *label, struct hg_asset **out, struct hg_error *err)
{
    struct hg_load_params limited = *params;
    *out = NULL;
    if (!limited.memory_limit_bytes)
        limited.memory_limit_bytes = 8ull << 30;
    if (main->size > limited.memory_limit_bytes / 8) // what assimp builds is several times the file
        return hg_error_set(
            err, HG_E_LIMIT, label, NULL, "the file is too large for the memory limit");
    enum hg_status status = hg_isolate_get() ? parse_isolated(&limited, main, label, out, err)
                                             : hg_import_parse(&limited, main, label, out, err);
    if (status)
        return status;
    status = fetch_images(params, *out, limited.memory_limit_bytes - main->size);
    if (!status)
        return HG_OK;
    hg_asset_destroy(*out);
    *out = NULL;
    return hg_error_set(err, status, label, NULL, "no memory for a texture");
}
