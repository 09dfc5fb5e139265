// Photometric profiles (EXT_lights_ies, extras) and textures of lights.
#include "renderer/scene/formats/gltf/gltf.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/light_table.h"

// ---- profiles ----------------------------------------------------------------------------------

// What is missing or broken leaves a light without a profile, and a warning; what the roots forbid
// is refused.
static enum hg_status forgive(struct hg_gltf *g, const struct hg_gltf_at *at, enum hg_status status,
    const struct hg_error *kept)
{
    if (status != HG_E_NOTFOUND && status != HG_E_FORMAT && status != HG_E_IO &&
        status != HG_E_UNSUPPORTED)
        return status;
    hg_gltf_warn(g, at, "%.150s; the light does without", g->err->reason);
    *g->err = *kept;
    return HG_OK;
}

static enum hg_status parse(struct hg_gltf *g, const struct hg_gltf_at *at, const char *name,
    const void *data, size_t size, struct hg_light_table **out)
{
    struct hg_error error = {0};
    const enum hg_status status = hg_light_profile_read_ies(name, data, size, out, &error);
    return status
               ? hg_gltf_fail(g, at, status, "%.60s: %s: %s", error.what, error.where, error.reason)
               : HG_OK;
}

static enum hg_status profile_from_uri(
    struct hg_gltf *g, const struct hg_gltf_at *at, const char *uri, struct hg_light_table **out)
{
    struct hg_refbuf *bytes;
    enum hg_status status = hg_gltf_fetch(g, at, uri, &bytes, NULL);
    if (status)
        return status;
    const char *name = strncmp(uri, "data:", 5) != 0 ? uri : "data URI";
    status = parse(g, at, name, bytes->data, bytes->size, out);
    hg_refbuf_unref(bytes);
    return status;
}

static enum hg_status load_profile(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_light_table **out)
{
    const char *uri = hg_gltf_string(at, "uri");
    const int64_t index = hg_gltf_index(at, "bufferView");
    const struct hg_gltf_at place = hg_gltf_key(at, uri ? "uri" : "bufferView");
    const struct hg_gltf_view *view;
    struct hg_error kept = *g->err;
    enum hg_status status;
    if (uri) {
        status = profile_from_uri(g, &place, uri, out);
    } else if (index >= 0) {
        status = hg_gltf_view_get(g, (uint64_t)index, &view);
        if (!status)
            status = parse(g, &place, "bufferView", view->data, view->size, out);
    } else {
        hg_gltf_warn(g, at, "ONE_OF_MISMATCH: a profile needs uri or bufferView");
        return HG_OK;
    }
    return status ? forgive(g, &place, status, &kept) : HG_OK;
}

enum hg_status hg_gltf_load_light_profiles(struct hg_gltf *g)
{
    struct hg_gltf_at extensions;
    const struct hg_gltf_at ies = hg_gltf_extension(&g->root, "EXT_lights_ies", &extensions);
    const struct hg_gltf_at list = hg_gltf_key(&ies, "lights");
    const size_t count = hg_gltf_count(&list);
    g->profiles = hg_gltf_alloc(g, &list, count, sizeof *g->profiles);
    if (!g->profiles)
        return g->err->status;
    g->profile_count = (uint32_t)count;
    for (size_t i = 0; i < count; i++) {
        const struct hg_gltf_at at = hg_gltf_item(&list, i);
        const enum hg_status status = load_profile(g, &at, &g->profiles[i]);
        if (status)
            return status;
    }
    return HG_OK;
}

static void use_profile(struct hg_light *light, struct hg_light_table *profile, bool absolute)
{
    hg_light_table_unref(light->profile);
    light->profile = hg_light_table_ref(profile);
    light->absolute = absolute;
}

enum hg_status hg_gltf_read_ies_light(
    struct hg_gltf *g, const struct hg_gltf_at *node_at, struct hg_node *node)
{
    struct hg_gltf_at extensions;
    const struct hg_gltf_at at = hg_gltf_extension(node_at, "EXT_lights_ies", &extensions);
    const struct hg_gltf_at place = hg_gltf_key(&at, "light");
    const int64_t index = hg_gltf_index(&at, "light");
    if (!at.json || index < 0)
        return HG_OK;
    if (index >= g->profile_count)
        return hg_gltf_fail(g, &place, HG_E_FORMAT, "UNRESOLVED_REFERENCE: %lld of %u profiles",
            (long long)index, g->profile_count);
    struct hg_light_table *profile = g->profiles[index];
    if (!profile)
        return HG_OK;
    if (node->light) { // exporters write both; the punctual light says how bright it is
        use_profile(node->light, profile, false);
        return HG_OK;
    }
    struct hg_light *light = hg_asset_add_light(g->asset, node->head.name);
    if (!light)
        return hg_gltf_fail(g, &at, HG_E_NOMEM, "no memory for a light");
    light->kind = HG_LIGHT_POINT;
    light->intensity = (float)fmax(hg_gltf_number(&at, "multiplier", 1), 0);
    hg_gltf_numbers(&at, "color", light->color, 3);
    for (int c = 0; c < 3; c++)
        light->color[c] = fminf(fmaxf(light->color[c], 0), 1);
    use_profile(light, profile, true);
    node->light = light;
    return HG_OK;
}

// ---- extras ------------------------------------------------------------------------------------

// "profile": the URI of a photometric file, or a number among the profiles of EXT_lights_ies.
static enum hg_status read_profile(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_light *light)
{
    const char *uri = json_string_value(at->json);
    const json_int_t index = json_integer_value(at->json);
    struct hg_light_table *profile = NULL;
    struct hg_error kept = *g->err;
    enum hg_status status = HG_OK;
    if (!at->json)
        return HG_OK;
    if (uri)
        status = profile_from_uri(g, at, uri, &profile);
    else if (json_is_integer(at->json) && index >= 0 && index < g->profile_count)
        profile = g->profiles[index] ? hg_light_table_ref(g->profiles[index]) : NULL;
    else
        hg_gltf_warn(
            g, at, "VALUE_NOT_IN_LIST: a light's profile is a URI, or a number of EXT_lights_ies");
    if (profile) {
        use_profile(light, profile, false);
        hg_light_table_unref(profile);
    }
    return status ? forgive(g, at, status, &kept) : HG_OK;
}

static enum hg_status read_texture(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_light *light)
{
    const json_int_t index = json_integer_value(at->json);
    struct hg_error error = {0};
    if (!at->json)
        return HG_OK;
    if (!json_is_integer(at->json) || index < 0 || index >= g->asset->texture_count) {
        hg_gltf_warn(g, at, "VALUE_NOT_IN_RANGE: a light's texture is a number among textures");
        return HG_OK;
    }
    const enum hg_status status = hg_light_set_texture(light, g->asset->textures[index], &error);
    if (status == HG_E_NOMEM)
        return hg_gltf_fail(g, at, status, "%s", error.reason);
    if (status)
        hg_gltf_warn(g, at, "%.60s: %.120s; the light does without", error.what, error.reason);
    return HG_OK;
}

enum hg_status hg_gltf_read_light_tables(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_light *light)
{
    const struct hg_gltf_at extras = hg_gltf_key(at, "extras");
    const struct hg_gltf_at profile = hg_gltf_key(&extras, "profile");
    const struct hg_gltf_at texture = hg_gltf_key(&extras, "texture");
    if (!json_is_object(extras.json))
        return HG_OK;
    const enum hg_status status = read_profile(g, &profile, light);
    return status ? status : read_texture(g, &texture, light);
}
