// Images, samplers, textures and references to them.
#include "renderer/scene/formats/gltf/gltf.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/fetch.h"

enum { MOST_UV_SETS = 255 };

// ---- images ------------------------------------------------------------------------------------

static enum hg_status image_from_view(
    struct hg_gltf *g, const struct hg_gltf_at *at, int64_t index, struct hg_image_source *source)
{
    const struct hg_gltf_view *view;
    enum hg_status status = hg_gltf_view_get(g, (uint64_t)index, &view);
    if (status)
        return status;
    if (view->size > g->memory_limit - g->memory_used)
        return hg_gltf_fail(g, at, HG_E_LIMIT, "the image passes the memory limit");
    source->encoded = hg_refbuf_create_spilled(view->size);
    if (!source->encoded)
        return hg_gltf_fail(g, at, HG_E_NOMEM, "no memory for an image");
    g->memory_used += view->size;
    memcpy(source->encoded->data, view->data, view->size);
    return HG_OK;
}

// A missing or broken image leaves a texture without one (sampled as white) and a warning, as
// viewers do: the shape is still worth seeing. What the roots forbid is refused.
static enum hg_status image_from_uri(
    struct hg_gltf *g, const struct hg_gltf_at *at, const char *uri, struct hg_image_source *source)
{
    struct hg_error kept = *g->err;
    enum hg_status status;
    if (g->params->fetch == hg_fetch_file && hg_gltf_uri_is_relative(uri)) {
        char *path = NULL;
        status = hg_gltf_decode_uri(uri, &path);
        if (status)
            (void)hg_gltf_fail(g, at, status, "INVALID_URI: wrong percent-encoding");
        struct hg_error error = {0};
        if (!status)
            status = hg_fetch_resolve(g->params->fetch_user, path, &source->path, &error);
        if (status && error.status)
            (void)hg_gltf_fail(
                g, at, status, "IO_ERROR: %.60s; searched: %.120s", error.reason, path);
        hg_free(path);
    } else {
        status = hg_gltf_fetch(g, at, uri, &source->encoded, NULL);
    }
    if (status == HG_E_NOTFOUND || status == HG_E_FORMAT || status == HG_E_IO) {
        hg_gltf_warn(g, at, "%.200s; white is shown instead", g->err->reason);
        *g->err = kept;
        return HG_OK;
    }
    return status;
}

static bool probe(
    struct hg_gltf *g, const struct hg_gltf_at *at, const struct hg_image_source *source)
{
    struct hg_image_info info;
    struct hg_error error = {0};
    enum hg_status status =
        source->path ? hg_image_probe_file(source->path, &info, &error)
                     : hg_image_probe_memory(&(struct hg_image_bytes){source->encoded->data,
                                                 source->encoded->size, source->label},
                           &info, &error);
    if (status)
        hg_gltf_warn(g, at, "IMAGE_UNRECOGNIZED_FORMAT: %.180s; white is shown instead",
            error.reason[0] ? error.reason : hg_status_text(status));
    return !status;
}

static void image_label(const struct hg_gltf_at *at, size_t index, const char *uri, char label[256])
{
    const char *name = hg_gltf_string(at, "name");
    if (uri && strncmp(uri, "data:", 5) != 0)
        snprintf(label, 256, "%s", uri);
    else if (name && name[0])
        snprintf(label, 256, "images[%zu] %s", index, name);
    else
        snprintf(label, 256, "images[%zu]", index);
}

static enum hg_status load_image(
    struct hg_gltf *g, const struct hg_gltf_at *at, size_t index, struct hg_image_source **out)
{
    char label[256];
    const char *uri = hg_gltf_string(at, "uri");
    int64_t view = hg_gltf_index(at, "bufferView");
    image_label(at, index, uri, label);
    struct hg_image_source *source = hg_image_source_create(label);
    if (!source)
        return hg_gltf_fail(g, at, HG_E_NOMEM, "no memory for an image");
    struct hg_gltf_at place = hg_gltf_key(at, uri ? "uri" : "bufferView");
    enum hg_status status = HG_OK;
    if (uri)
        status = image_from_uri(g, &place, uri, source);
    else if (view >= 0)
        status = image_from_view(g, &place, view, source);
    else
        hg_gltf_warn(g, at, "ONE_OF_MISMATCH: an image needs uri or bufferView");
    bool usable = !status && (source->path || source->encoded) && probe(g, at, source);
    if (usable)
        *out = source;
    else
        hg_image_source_unref(source);
    return status;
}

enum hg_status hg_gltf_load_images(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "images");
    size_t count = hg_gltf_count(&list);
    g->images = hg_gltf_alloc(g, &list, count, sizeof *g->images);
    if (!g->images)
        return g->err->status;
    g->image_count = (uint32_t)count;
    for (size_t i = 0; i < count; i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        enum hg_status status = load_image(g, &at, i, &g->images[i]);
        if (status)
            return status;
    }
    return HG_OK;
}

// ---- textures ----------------------------------------------------------------------------------

static enum hg_wrap wrap_of(struct hg_gltf *g, const struct hg_gltf_at *sampler, const char *key)
{
    uint64_t value = hg_gltf_uint(sampler, key, 10497);
    if (value == 33071)
        return HG_WRAP_CLAMP;
    if (value == 33648)
        return HG_WRAP_MIRROR;
    if (value != 10497)
        hg_gltf_warn(g, sampler, "VALUE_NOT_IN_LIST: %s %llu", key, (unsigned long long)value);
    return HG_WRAP_REPEAT;
}

static void read_sampler(
    struct hg_gltf *g, const struct hg_gltf_at *sampler, struct hg_texture *texture)
{
    texture->wrap_s = wrap_of(g, sampler, "wrapS");
    texture->wrap_t = wrap_of(g, sampler, "wrapT");
    texture->mag_nearest = hg_gltf_uint(sampler, "magFilter", 9729) == 9728;
    uint64_t min = hg_gltf_uint(sampler, "minFilter", 9987);
    texture->min_nearest = min == 9728 || min == 9984 || min == 9986;
    texture->mip_nearest = min == 9984 || min == 9985;
    texture->mip_none = min == 9728 || min == 9729;
}

// The image of a texture: an extension's that can be read, else its own source.
static int64_t texture_source(const struct hg_gltf *g, const struct hg_gltf_at *at)
{
    static const char *const names[] = {"EXT_texture_webp", "KHR_texture_basisu"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        struct hg_gltf_at extensions;
        const struct hg_gltf_at extension = hg_gltf_extension(at, names[i], &extensions);
        const int64_t source = hg_gltf_index(&extension, "source");
        if (source >= 0 && source < g->image_count && g->images[source])
            return source;
    }
    return hg_gltf_index(at, "source");
}

enum hg_status hg_gltf_load_textures(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "textures");
    for (size_t i = 0; i < hg_gltf_count(&list); i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i), up;
        struct hg_texture *texture = hg_asset_add_texture(g->asset, hg_gltf_string(&at, "name"));
        if (!texture)
            return hg_gltf_fail(g, &at, HG_E_NOMEM, "no memory for a texture");
        int64_t sampler = hg_gltf_index(&at, "sampler"), source = texture_source(g, &at);
        struct hg_gltf_at sampler_at =
            hg_gltf_root_item(g, "samplers", sampler < 0 ? SIZE_MAX : (size_t)sampler, &up);
        read_sampler(g, &sampler_at, texture);
        if (source >= 0 && source < g->image_count && g->images[source])
            texture->image = hg_image_source_ref(g->images[source]);
    }
    return HG_OK;
}

// KHR_texture_transform: uv' = T R S uv.
static void read_transform(const struct hg_gltf_at *at, float m[6])
{
    float offset[2] = {0, 0}, scale[2] = {1, 1};
    hg_gltf_numbers(at, "offset", offset, 2);
    hg_gltf_numbers(at, "scale", scale, 2);
    double r = hg_gltf_number(at, "rotation", 0);
    float c = (float)cos(r), s = (float)sin(r);
    m[0] = c * scale[0];
    m[1] = s * scale[1];
    m[2] = offset[0];
    m[3] = -s * scale[0];
    m[4] = c * scale[1];
    m[5] = offset[1];
}

void hg_gltf_texture_ref(
    struct hg_gltf *g, const struct hg_gltf_at *at, const char *key, struct hg_texture_ref *out)
{
    struct hg_gltf_at info = hg_gltf_key(at, key), extensions;
    int64_t index = hg_gltf_index(&info, "index");
    if (index < 0 || index >= g->asset->texture_count)
        return;
    out->texture = g->asset->textures[index];
    uint64_t set = hg_gltf_uint(&info, "texCoord", 0);
    struct hg_gltf_at transform = hg_gltf_extension(&info, "KHR_texture_transform", &extensions);
    if (transform.json) {
        read_transform(&transform, out->uv_transform);
        set = hg_gltf_uint(&transform, "texCoord", set);
    }
    if (set > MOST_UV_SETS)
        hg_gltf_warn(
            g, &info, "texCoord %llu: there is no such set; 0 is used", (unsigned long long)set);
    out->uv_set = set > MOST_UV_SETS ? 0 : (uint32_t)set; // hg_gltf_choose_uv_sets follows
}
