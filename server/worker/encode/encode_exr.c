// encode_exr.c - EXR frames: the picture, its planes as further parts, and where they come from.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/cryptomatte.h"
#include "renderer/image/exr.h"
#include "server/worker/encode/encode_exr.h"
#include "server/worker/view/view_params.h"

enum {
    ATTRIBUTES = 17 + HGP_VIEW_PARAM_COUNT,
    MATTE_ATTRIBUTES = 4,
    MATTE_LAYERS = HG_MATTE_RANKS / 2, // parts of a matte
    MOST_PARTS = 1 + ENCODE_MAX_PLANES + ENCODE_MATTES * MATTE_LAYERS,
};

#define PIXELS_LIMIT_BYTES (UINT64_C(16) << 30) // of all parts

enum kind {
    RADIANCE, // as the picture: its type, its exposure
    SQUARES,  // floats, of radiance squared
    HALVES,
    FLOATS,  // also whole numbers: few programs read those of the file format
    VECTORS, // x, y pairs with y down, which point up in files
};

// How a plane stands in the file.
static const struct layout {
    const char *suffixes[4];
    enum kind kind;
} layouts[HG_PLANE_COUNT] = {
    [HG_PLANE_COLOR] = {{"R", "G", "B"}, RADIANCE},
    [HG_PLANE_ALBEDO] = {{"R", "G", "B"}, HALVES},
    [HG_PLANE_NORMAL] = {{"X", "Y", "Z"}, HALVES},
    [HG_PLANE_GEOMETRIC_NORMAL] = {{"X", "Y", "Z"}, HALVES},
    [HG_PLANE_DEPTH] = {{"Z"}, FLOATS},
    [HG_PLANE_POSITION] = {{"X", "Y", "Z"}, FLOATS},
    [HG_PLANE_EMISSION] = {{"R", "G", "B"}, RADIANCE},
    [HG_PLANE_DIRECT_DIFFUSE] = {{"R", "G", "B"}, RADIANCE},
    [HG_PLANE_DIRECT_SPECULAR] = {{"R", "G", "B"}, RADIANCE},
    [HG_PLANE_DIRECT_TRANSMISSION] = {{"R", "G", "B"}, RADIANCE},
    [HG_PLANE_INDIRECT_DIFFUSE] = {{"R", "G", "B"}, RADIANCE},
    [HG_PLANE_INDIRECT_SPECULAR] = {{"R", "G", "B"}, RADIANCE},
    [HG_PLANE_INDIRECT_TRANSMISSION] = {{"R", "G", "B"}, RADIANCE},
    [HG_PLANE_MOTION] = {{"X", "Y", "Z", "W"}, VECTORS},
    [HG_PLANE_OBJECT] = {{"I"}, FLOATS},
    [HG_PLANE_MATERIAL] = {{"I"}, FLOATS},
    [HG_PLANE_SAMPLES] = {{"I"}, FLOATS},
    [HG_PLANE_VARIANCE] = {{"V"}, SQUARES},
    [HG_PLANE_NOISY] = {{"R", "G", "B"}, RADIANCE},
    [HG_PLANE_LIGHT_GROUPS] = {{"R", "G", "B"}, RADIANCE},
};

// A file in the making; its pixel buffers and names live as long.
struct file {
    const struct encode_request *request;
    struct hg_exr_part parts[MOST_PARTS];
    uint32_t count;
    char names[MOST_PARTS][5][32]; // of the channels, and of the part where we make it
    void *buffers[MOST_PARTS];
    struct hg_image_attribute attributes[ATTRIBUTES + ENCODE_MATTES * MATTE_ATTRIBUTES];
    struct hg_view_attributes params;
    char revision[32], keys[ENCODE_MATTES * MATTE_ATTRIBUTES][40];
};

// ---- what the file says ------------------------------------------------------------------------

static void add_text(struct file *f, uint32_t *n, const char *name, const char *text)
{
    if (text[0])
        f->attributes[(*n)++] =
            (struct hg_image_attribute){.name = name, .type = HG_ATTR_STRING, .string = text};
}

static void add_number(struct file *f, uint32_t *n, const char *name, const float *value)
{
    f->attributes[(*n)++] =
        (struct hg_image_attribute){.name = name, .type = HG_ATTR_FLOAT, .floats = value};
}

static void add_count(struct file *f, uint32_t *n, const char *name, uint32_t count)
{
    f->attributes[(*n)++] =
        (struct hg_image_attribute){.name = name, .type = HG_ATTR_INT, .integer = (int)count};
}

static void add_lens(struct file *f, uint32_t *n)
{
    const struct frame_metadata *metadata = &f->request->metadata;
    if (metadata->params.mode != HG_MODE_PATH || !(metadata->lens_radius > 0))
        return;
    add_number(f, n, "heliograph:lensRadius", &metadata->lens_radius);
    add_number(f, n, "heliograph:focusDistance", &metadata->focus_distance);
}

static void add_params(struct file *f, uint32_t *n)
{
    for (uint32_t i = 0; i < f->params.count; i++)
        f->attributes[(*n)++] = f->params.items[i];
}

static uint32_t list_attributes(struct file *f, const float *time_s)
{
    const struct hgp_frame *frame = &f->request->frame;
    const struct frame_metadata *metadata = &f->request->metadata;
    uint32_t n = 0;
    if (metadata->frame_key[0]) // depends on the scene alone, not on how many edits led to it
        snprintf(f->revision, sizeof f->revision, "%.16s", metadata->scene_hash);
    else
        snprintf(
            f->revision, sizeof f->revision, "%llu", (unsigned long long)frame->scene_revision);
    add_text(f, &n, "heliograph:version", HELIO_VERSION);
    add_text(f, &n, "heliograph:renderer", frame->has_mode ? "path" : "realtime");
    add_text(f, &n, "heliograph:device", metadata->device);
    add_text(f, &n, "heliograph:sceneRevision", f->revision);
    add_text(f, &n, ENCODE_FRAME_KEY_ATTRIBUTE, metadata->frame_key);
    add_count(f, &n, "heliograph:samples", frame->samples);
    add_number(f, &n, "heliograph:time", time_s);
    if (frame->has_noise)
        add_number(f, &n, "heliograph:noise", &frame->noise);
    // Standard attribute of OpenEXR; its numbers have a sign.
    if (metadata->rate[0] && metadata->rate[0] <= INT32_MAX && metadata->rate[1] <= INT32_MAX)
        f->attributes[n++] = (struct hg_image_attribute){.name = "framesPerSecond",
            .type = HG_ATTR_RATIO,
            .integer = (int)metadata->rate[0],
            .count = metadata->rate[1]};
    add_params(f, &n);
    add_lens(f, &n);
    // Standard attributes of OpenEXR; its vectors are rows, so that our columns are its rows.
    f->attributes[n++] = (struct hg_image_attribute){
        .name = "worldToCamera", .type = HG_ATTR_MAT4, .floats = metadata->world_to_camera};
    f->attributes[n++] = (struct hg_image_attribute){
        .name = "worldToNDC", .type = HG_ATTR_MAT4, .floats = metadata->world_to_ndc};
    return n;
}

// ---- pixels ------------------------------------------------------------------------------------

// EXR holds colour times alpha by definition of the format.
static enum hg_status add_picture(struct file *f, uint32_t attribute_count)
{
    const struct encode_request *request = f->request;
    const size_t count = (size_t)request->frame.width * request->frame.height;
    const float *from = (const float *)request->pixels->data;
    struct hg_exr_part *part = &f->parts[f->count];
    *part = (struct hg_exr_part){.name = "rgba",
        .channels = {"R", "G", "B", "A"},
        .channel_count = request->opaque ? 3 : 4,
        .stride = 4,
        .type = request->frame.encoding == HGP_encoding_EXR_FLOAT ? HG_EXR_FLOAT : HG_EXR_HALF,
        .pixels = from,
        .size_bytes = request->pixels->size,
        .attributes = f->attributes,
        .attribute_count = attribute_count};
    if (!request->opaque) {
        float *to = hg_calloc(count, 16);
        if (!to)
            return HG_E_NOMEM;
        for (size_t i = 0; i < 4 * count; i++)
            to[i] = i % 4 == 3 ? from[i] : from[i] * from[i | 3];
        part->pixels = f->buffers[f->count] = to;
    }
    f->count++;
    return HG_OK;
}

// Values as they stand in the file: radiance with the picture's exposure, y up.
static enum hg_status convert(
    struct file *f, const struct encode_plane *p, enum kind kind, struct hg_exr_part *part)
{
    const float factor = f->params.exposure;
    const float exposure = kind == RADIANCE ? factor : kind == SQUARES ? factor * factor : 1.0f;
    const size_t values = p->values->size / sizeof(float);
    const float *from = (const float *)p->values->data;
    part->pixels = from;
    part->size_bytes = p->values->size;
    if (exposure == 1.0f && kind != VECTORS)
        return HG_OK;
    float *to = hg_calloc(values, sizeof *to);
    if (!to)
        return HG_E_NOMEM;
    for (size_t i = 0; i < values; i++)
        to[i] = kind == VECTORS && i % 2 == 1 ? 0.0f - from[i] : from[i] * exposure;
    f->buffers[f->count] = to;
    part->pixels = to;
    return HG_OK;
}

static enum hg_status add_plane(struct file *f, const struct encode_plane *p)
{
    const struct layout *layout = &layouts[p->plane];
    const uint32_t channels = hg_plane_channels(p->plane);
    struct hg_exr_part *part = &f->parts[f->count];
    *part = (struct hg_exr_part){.name = p->name[0] ? p->name : hg_plane_name(p->plane),
        .channel_count = channels < 3 || layout->kind == VECTORS ? channels : 3,
        .stride = channels,
        .type = layout->kind == RADIANCE ? f->parts[0].type
                : layout->kind == HALVES ? HG_EXR_HALF
                                         : HG_EXR_FLOAT};
    enum hg_status status = convert(f, p, layout->kind, part);
    for (uint32_t i = 0; i < part->channel_count; i++) {
        char *channel = f->names[f->count][i];
        snprintf(channel, sizeof f->names[0][0], "%s.%s", part->name, layout->suffixes[i]);
        part->channels[i] = channel;
    }
    f->count++;
    return status;
}

static const char *const matte_names[ENCODE_MATTES] = {
    [HG_MATTE_OBJECT] = "CryptoObject",
    [HG_MATTE_MATERIAL] = "CryptoMaterial",
    [HG_MATTE_ASSET] = "CryptoAsset",
};

// Cryptomatte's own attributes, in the first part with the others.
static uint32_t list_mattes(struct file *f, uint32_t n)
{
    static const char *const keys[MATTE_ATTRIBUTES] = {"name", "hash", "conversion", "manifest"};
    for (uint32_t i = 0; i < ENCODE_MATTES; i++) {
        const struct hg_matte *m = &f->request->mattes[i];
        const char *const values[MATTE_ATTRIBUTES] = {
            matte_names[i], "MurmurHash3_32", "uint32_to_float32", m->manifest};
        char prefix[24];
        hg_cryptomatte_prefix(matte_names[i], prefix);
        for (uint32_t k = 0; m->ranks && k < MATTE_ATTRIBUTES; k++) {
            char *key = f->keys[i * MATTE_ATTRIBUTES + k];
            snprintf(key, sizeof f->keys[0], "%s%s", prefix, keys[k]);
            if (values[k])
                add_text(f, &n, key, values[k]);
        }
    }
    return n;
}

// Two ranks a part: CryptoObject00, CryptoObject01, ...
static void add_matte(struct file *f, const char *name, const struct hg_refbuf *ranks)
{
    static const char *const suffixes[] = {"R", "G", "B", "A"};
    for (uint32_t layer = 0; layer < MATTE_LAYERS; layer++) {
        struct hg_exr_part *part = &f->parts[f->count];
        char(*names)[32] = f->names[f->count];
        const size_t offset = (size_t)layer * 4 * sizeof(float);
        snprintf(names[4], sizeof names[4], "%s%02u", name, layer);
        *part = (struct hg_exr_part){.name = names[4],
            .channel_count = 4,
            .stride = 2 * HG_MATTE_RANKS,
            .type = HG_EXR_FLOAT,
            .pixels = ranks->data + offset,
            .size_bytes = ranks->size - offset};
        for (uint32_t i = 0; i < 4; i++) {
            snprintf(names[i], sizeof names[i], "%s.%s", names[4], suffixes[i]);
            part->channels[i] = names[i];
        }
        f->count++;
    }
}

enum hg_status hg_encode_exr(
    const struct encode_request *request, struct hg_writer *out, struct hg_error *err)
{
    struct file f = {.request = request};
    const struct hg_view_params *p = &request->metadata.params;
    struct hg_exr_window window = {.width = request->frame.width, .height = request->frame.height};
    const float time_s = (float)request->metadata.time_s;
    hg_view_params_attributes(&request->metadata.params, &f.params);
    if (p->region[2] > 0) {
        const struct hg_view_params whole = hg_view_params_filled(p);
        window.x = (uint32_t)p->region[0];
        window.y = (uint32_t)p->region[1];
        window.full_width = whole.width;
        window.full_height = whole.height;
    }
    enum hg_status status = add_picture(&f, list_mattes(&f, list_attributes(&f, &time_s)));
    for (uint32_t i = 0; !status && i < request->plane_count; i++)
        status = add_plane(&f, &request->planes[i]);
    for (uint32_t i = 0; !status && i < ENCODE_MATTES; i++)
        if (request->mattes[i].ranks)
            add_matte(&f, matte_names[i], request->mattes[i].ranks);
    if (status)
        hg_error_set(err, status, "frame", NULL, "no memory for the parts of an EXR file");
    else
        status = hg_exr_encode(&window, f.parts, f.count, PIXELS_LIMIT_BYTES, out, err);
    for (uint32_t i = 0; i < MOST_PARTS; i++)
        hg_free(f.buffers[i]);
    return status;
}
