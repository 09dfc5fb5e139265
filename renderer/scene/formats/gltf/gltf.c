#include "renderer/scene/formats/gltf/gltf.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/light_table.h"

static const char *const known_extensions[] = {"KHR_texture_transform", "KHR_mesh_quantization",
    "EXT_meshopt_compression", "KHR_draco_mesh_compression", "EXT_texture_webp",
    "KHR_texture_basisu", "EXT_mesh_gpu_instancing", "KHR_lights_punctual", "KHR_materials_unlit",
    "KHR_materials_emissive_strength", "KHR_materials_variants",
    "KHR_materials_pbrSpecularGlossiness", "KHR_materials_clearcoat", "KHR_materials_sheen",
    "KHR_materials_transmission", "KHR_materials_volume", "KHR_materials_ior",
    "KHR_materials_specular", "KHR_materials_iridescence", "KHR_materials_anisotropy",
    "KHR_materials_dispersion", "KHR_materials_diffuse_transmission", "KHR_node_visibility",
    "EXT_lights_ies"};

static bool is_known(const char *name)
{
    for (size_t i = 0; i < sizeof known_extensions / sizeof *known_extensions; i++)
        if (strcmp(known_extensions[i], name) == 0)
            return true;
    return false;
}

static enum hg_status check_required(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "extensionsRequired");
    for (size_t i = 0; i < hg_gltf_count(&list); i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        const char *name = json_string_value(at.json);
        if (name && !is_known(name))
            return hg_gltf_fail(
                g, &at, HG_E_UNSUPPORTED, "UNSUPPORTED_EXTENSION: the file requires %.100s", name);
    }
    return HG_OK;
}

static enum hg_status read_used(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "extensionsUsed");
    size_t count = hg_gltf_count(&list);
    g->asset->file.extensions_used = hg_gltf_alloc(g, &list, count, sizeof(char *));
    if (!g->asset->file.extensions_used)
        return g->err->status;
    for (size_t i = 0; i < count; i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        const char *name = json_string_value(at.json);
        char *copy = hg_strdup(name ? name : "");
        if (!copy)
            return hg_gltf_fail(g, &at, HG_E_NOMEM, "no memory for a name");
        g->asset->file.extensions_used[g->asset->file.extension_count++] = copy;
        g->has_quantization |= strcmp(copy, "KHR_mesh_quantization") == 0;
        if (!is_known(copy))
            hg_gltf_warn(g, &at, "UNSUPPORTED_EXTENSION: %.100s is ignored", copy);
    }
    return HG_OK;
}

static enum hg_status read_variants(struct hg_gltf *g)
{
    struct hg_gltf_at extensions;
    struct hg_gltf_at at = hg_gltf_extension(&g->root, "KHR_materials_variants", &extensions);
    struct hg_gltf_at list = hg_gltf_key(&at, "variants");
    size_t count = hg_gltf_count(&list);
    g->asset->variants.names = hg_gltf_alloc(g, &list, count, sizeof(char *));
    if (!g->asset->variants.names)
        return g->err->status;
    for (size_t i = 0; i < count; i++) {
        struct hg_gltf_at item = hg_gltf_item(&list, i);
        const char *name = hg_gltf_string(&item, "name");
        char *copy = hg_strdup(name ? name : "");
        if (!copy)
            return hg_gltf_fail(g, &item, HG_E_NOMEM, "no memory for a name");
        g->asset->variants.names[g->asset->variants.count++] = copy;
    }
    return HG_OK;
}

// "major.minor" to numbers; false when it is something else.
static bool parse_version(const char *text, long *major, long *minor)
{
    char *end;
    if (!text || text[0] < '0' || text[0] > '9')
        return false;
    *major = strtol(text, &end, 10);
    if (*end != '.' || end[1] < '0' || end[1] > '9')
        return false;
    *minor = strtol(end + 1, &end, 10);
    return *end == '\0';
}

static enum hg_status read_asset(struct hg_gltf *g)
{
    struct hg_gltf_at at = hg_gltf_key(&g->root, "asset");
    const char *version = hg_gltf_string(&at, "version");
    const char *min_version = hg_gltf_string(&at, "minVersion");
    struct hg_gltf_at place = hg_gltf_key(&at, "version");
    long major, minor;
    if (!at.json || !version)
        return hg_gltf_fail(
            g, &place, HG_E_FORMAT, "UNDEFINED_PROPERTY: asset.version says what this is");
    if (!parse_version(version, &major, &minor))
        return hg_gltf_fail(g, &place, HG_E_FORMAT, "PATTERN_MISMATCH: version '%.40s'", version);
    if (major != 2)
        return hg_gltf_fail(g, &place, HG_E_UNSUPPORTED,
            "UNKNOWN_ASSET_MAJOR_VERSION: %ld; only glTF 2 is read", major);
    if (minor != 0)
        hg_gltf_warn(g, &place, "UNKNOWN_ASSET_MINOR_VERSION: %ld", minor);
    long min_major = 2, min_minor = 0;
    place = hg_gltf_key(&at, "minVersion");
    if (min_version && !parse_version(min_version, &min_major, &min_minor))
        hg_gltf_warn(g, &place, "PATTERN_MISMATCH: minVersion '%.40s'", min_version);
    else if (min_major != 2 || min_minor > 0)
        return hg_gltf_fail(g, &place, HG_E_UNSUPPORTED, "%s: %.40s is needed, 2.0 is read",
            min_minor > minor ? "ASSET_MIN_VERSION_GREATER_THAN_VERSION"
                              : "UNKNOWN_ASSET_MINOR_VERSION",
            min_version);
    const char *generator = hg_gltf_string(&at, "generator");
    const char *copyright = hg_gltf_string(&at, "copyright");
    struct hg_asset *asset = g->asset;
    snprintf(asset->file.version, sizeof asset->file.version, "%.15s", version);
    snprintf(asset->file.generator, sizeof asset->file.generator, "%s", generator ? generator : "");
    snprintf(asset->file.copyright, sizeof asset->file.copyright, "%s", copyright ? copyright : "");
    return HG_OK;
}

static enum hg_status prepare_views(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "bufferViews");
    size_t count = hg_gltf_count(&list);
    g->views = hg_gltf_alloc(g, &list, count, sizeof *g->views);
    if (!g->views)
        return g->err->status;
    g->view_count = (uint32_t)count;
    return HG_OK;
}

typedef enum hg_status stage_fn(struct hg_gltf *g);

static const struct {
    const char *name;
    stage_fn *run;
} stages[] = {{"parse", hg_gltf_parse_container}, {"asset", read_asset},
    {"extensions", check_required}, {"extensions", read_used}, {"schema", hg_gltf_check_schema},
    {"buffers", hg_gltf_load_buffers}, {"buffers", prepare_views}, {"images", hg_gltf_load_images},
    {"textures", hg_gltf_load_textures}, {"materials", read_variants},
    {"materials", hg_gltf_load_materials}, {"materials", hg_gltf_choose_uv_sets},
    {"cameras", hg_gltf_load_cameras}, {"lights", hg_gltf_load_light_profiles},
    {"lights", hg_gltf_load_lights}, {"meshes", hg_gltf_load_meshes}, {"nodes", hg_gltf_load_nodes},
    {"skins", hg_gltf_load_skins}, {"animations", hg_gltf_load_animations}};

static enum hg_status run_stages(struct hg_gltf *g)
{
    size_t count = sizeof stages / sizeof *stages;
    for (size_t i = 0; i < count; i++) {
        if (g->params->progress &&
            !g->params->progress(g->params->progress_user, stages[i].name, i, count))
            return hg_error_set(g->err, HG_E_CANCELLED, g->file, NULL, "cancelled");
        enum hg_status status = stages[i].run(g);
        if (status)
            return status;
    }
    hg_gltf_check_rules(g);
    return HG_OK;
}

static void finish(struct hg_gltf *g)
{
    for (uint32_t i = 0; i < g->buffer_count; i++)
        hg_refbuf_unref(g->buffers[i].owner);
    for (uint32_t i = 0; i < g->view_count; i++)
        hg_free(g->views[i].decoded);
    for (uint32_t i = 0; i < g->image_count; i++)
        hg_image_source_unref(g->images[i]);
    for (uint32_t i = 0; i < g->profile_count; i++)
        hg_light_table_unref(g->profiles[i]);
    hg_free(g->profiles);
    hg_free(g->uv_sets);
    hg_free(g->buffers);
    hg_free(g->views);
    hg_free(g->images);
    json_decref(g->json);
    if (g->draco)
        hg_isolate_get()->close(g->draco);
    hg_asset_destroy(g->asset);
}

enum hg_status hg_gltf_load(const struct hg_load_params *params, struct hg_refbuf *main,
    const char *label, struct hg_asset **out, struct hg_error *err)
{
    struct hg_gltf g = {.params = params, .err = err, .file = label, .main = main};
    g.memory_limit = params->memory_limit_bytes ? params->memory_limit_bytes : 8ull << 30;
    g.memory_used = main->size;
    *out = NULL;
    g.asset = hg_asset_create(params->asset_number, label);
    enum hg_status status =
        g.asset ? run_stages(&g) : hg_error_set(err, HG_E_NOMEM, label, NULL, "no memory");
    if (!status) {
        *out = g.asset;
        g.asset = NULL;
    }
    finish(&g);
    return status;
}
