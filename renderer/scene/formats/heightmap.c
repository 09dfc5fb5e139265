#include "renderer/scene/formats/formats.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/spill.h"
#include "renderer/scene/asset.h"

#define DEGREE_M 111319.5f // one degree of latitude, and of longitude on the equator
#define VOID_M   (-32768)
#define SIDE_MAX 16385u // samples
enum { SAMPLE_BYTES = 4 + 32 + 24 }; // read, a vertex, six indices

struct heights {
    uint32_t width, height;
    float step[2]; // metres east and south
    uint32_t voids;
    float *samples; // [width * height] metres
};

static bool has_suffix(const char *name, const char *suffix)
{
    const size_t n = strlen(name), k = strlen(suffix);
    return n >= k && strcasecmp(name + n - k, suffix) == 0;
}

static bool is_tile(const char *label)
{
    return has_suffix(label, ".hgt");
}

static bool is_picture(const char *label, const struct hg_refbuf *data)
{
    struct hg_image_info info;
    struct hg_error err = {0};
    if (!has_suffix(label, ".png") && !has_suffix(label, ".tif") && !has_suffix(label, ".tiff"))
        return false;
    return hg_image_probe_memory(
               &(struct hg_image_bytes){data->data, data->size, label}, &info, &err) == HG_OK &&
           info.channels == 1 && info.is_16bit && !info.is_float;
}

bool hg_heightmap_knows(const char *label, const struct hg_refbuf *data)
{
    return is_tile(label) || is_picture(label, data);
}

// ---- samples ------------------------------------------------------------------------------------

static uint64_t memory_limit(const struct hg_load_params *params)
{
    return params->memory_limit_bytes ? params->memory_limit_bytes : 8ull << 30;
}

// Before a sample is read: what is refused costs nothing.
static enum hg_status check_size(const struct hg_load_params *params, uint64_t width,
    uint64_t height, const char *label, struct hg_error *err)
{
    const uint64_t bytes = width * height * SAMPLE_BYTES;
    if (width < 2 || height < 2 || width > SIDE_MAX || height > SIDE_MAX)
        return hg_error_set(err, HG_E_LIMIT, label, NULL,
            "%llu x %llu samples; 2 to %u a side are read", (unsigned long long)width,
            (unsigned long long)height, SIDE_MAX);
    if (bytes > memory_limit(params))
        return hg_error_set(err, HG_E_LIMIT, label, NULL, "%llu bytes pass the memory limit",
            (unsigned long long)bytes);
    return HG_OK;
}

static enum hg_status read_tile(const struct hg_load_params *params, const struct hg_refbuf *data,
    const char *label, struct heights *h, struct hg_error *err)
{
    const uint32_t side = data->size == 1201u * 1201u * 2u   ? 1201
                          : data->size == 3601u * 3601u * 2u ? 3601
                                                             : 0;
    if (side == 0)
        return hg_error_set(err, HG_E_FORMAT, label, NULL,
            "%zu bytes are neither 1201 x 1201 nor 3601 x 3601 samples", data->size);
    const enum hg_status status = check_size(params, side, side, label, err);
    if (status != HG_OK)
        return status;
    h->width = h->height = side;
    h->samples = hg_spill_scratch((size_t)side * side, sizeof *h->samples);
    if (h->samples == NULL)
        return hg_error_set(err, HG_E_NOMEM, label, NULL, "no memory");
    for (size_t i = 0; i < (size_t)side * side; i++) {
        const int v = (int16_t)(data->data[i * 2] << 8 | data->data[i * 2 + 1]);
        h->voids += v == VOID_M;
        h->samples[i] = v == VOID_M ? NAN : (float)v;
    }
    return HG_OK;
}

static enum hg_status read_picture(const struct hg_load_params *params,
    const struct hg_refbuf *data, const char *label, struct heights *h, struct hg_error *err)
{
    const struct hg_image_limits limits = {.max_side_px = SIDE_MAX,
        .max_pixels = (uint64_t)SIDE_MAX * SIDE_MAX,
        .max_bytes = memory_limit(params)};
    const struct hg_image_bytes bytes = {data->data, data->size, label};
    struct hg_image_info info;
    struct hg_image image;
    enum hg_status status = hg_image_probe_memory(&bytes, &info, err);
    if (status == HG_OK)
        status = check_size(params, info.width, info.height, label, err);
    if (status == HG_OK)
        status = hg_image_read_memory(&bytes, HG_PIXEL_RGBA16, &limits, &image, err);
    if (status != HG_OK)
        return status;
    h->width = image.width;
    h->height = image.height;
    const size_t n = (size_t)image.width * image.height;
    h->samples = hg_spill_scratch(n, sizeof *h->samples);
    const uint16_t *pixels = image.pixels;
    for (size_t i = 0; h->samples != NULL && i < n; i++)
        h->samples[i] = (float)pixels[i * 4];
    hg_image_finish(&image);
    if (h->samples == NULL)
        return hg_error_set(err, HG_E_NOMEM, label, NULL, "no memory");
    return HG_OK;
}

static void fill_voids(struct heights *h)
{
    const size_t n = (size_t)h->width * h->height;
    float least = INFINITY;
    for (size_t i = 0; i < n; i++)
        least = fminf(least, h->samples[i]); // passes over NAN
    for (size_t i = 0; i < n; i++)
        if (isnan(h->samples[i]))
            h->samples[i] = least < INFINITY ? least : 0.0f;
}

// N46E008...: a degree of latitude at 46 to 47 north.
static void set_steps(const char *label, struct heights *h)
{
    const char *p = label;
    h->step[0] = h->step[1] = 1.0f;
    for (int i = 0; i < 7; i++)
        if (i == 0 || i == 3 ? !isalpha((unsigned char)p[i]) : !isdigit((unsigned char)p[i]))
            return;
    const int north = toupper((unsigned char)p[0]), east = toupper((unsigned char)p[3]);
    if ((north != 'N' && north != 'S') || (east != 'E' && east != 'W'))
        return;
    const float degrees = (float)((p[1] - '0') * 10 + (p[2] - '0')) * (north == 'N' ? 1.0f : -1.0f);
    if (fabsf(degrees) >= 90.0f)
        return;
    h->step[1] = DEGREE_M / (float)(h->height - 1);
    h->step[0] = DEGREE_M * cosf((degrees + 0.5f) * 0.017453293f) / (float)(h->width - 1);
}

// ---- the mesh -----------------------------------------------------------------------------------

static float sample(const struct heights *h, uint32_t x, uint32_t y)
{
    return h->samples[(size_t)y * h->width + x];
}

// Normal by differences of the neighbours, one-sided at the edges.
static void set_normal(const struct heights *h, uint32_t x, uint32_t y, float out[3])
{
    const uint32_t x0 = x > 0 ? x - 1 : x, x1 = x + 1 < h->width ? x + 1 : x;
    const uint32_t y0 = y > 0 ? y - 1 : y, y1 = y + 1 < h->height ? y + 1 : y;
    const float east = (sample(h, x1, y) - sample(h, x0, y)) / ((float)(x1 - x0) * h->step[0]);
    const float south = (sample(h, x, y1) - sample(h, x, y0)) / ((float)(y1 - y0) * h->step[1]);
    const float scale = 1.0f / sqrtf(east * east + south * south + 1.0f);
    out[0] = -east * scale;
    out[1] = scale;
    out[2] = -south * scale;
}

static void set_vertices(const struct heights *h, struct hg_mesh_part *part)
{
    size_t i = 0;
    for (uint32_t y = 0; y < h->height; y++) {
        for (uint32_t x = 0; x < h->width; x++, i++) {
            part->positions[i * 3] = ((float)x - 0.5f * (float)(h->width - 1)) * h->step[0];
            part->positions[i * 3 + 1] = sample(h, x, y);
            part->positions[i * 3 + 2] = ((float)y - 0.5f * (float)(h->height - 1)) * h->step[1];
            part->uv[0][i * 2] = (float)x / (float)(h->width - 1);
            part->uv[0][i * 2 + 1] = (float)y / (float)(h->height - 1);
            set_normal(h, x, y, part->normals + i * 3);
        }
    }
}

static void set_indices(const struct heights *h, struct hg_mesh_part *part)
{
    uint32_t *to = part->indices;
    for (uint32_t y = 0; y + 1 < h->height; y++) {
        for (uint32_t x = 0; x + 1 < h->width; x++) {
            const uint32_t a = y * h->width + x, b = a + 1, c = a + h->width, d = c + 1;
            const uint32_t quad[6] = {a, c, b, b, c, d}; // facing up
            memcpy(to, quad, sizeof quad);
            to += 6;
        }
    }
}

static enum hg_status make_part(const struct heights *h, struct hg_mesh_part *part)
{
    part->topology = HG_TOPOLOGY_TRIANGLES;
    part->vertex_count = h->width * h->height;
    part->index_count = (h->width - 1) * (h->height - 1) * 6;
    part->indices = hg_spill_calloc(part->index_count, sizeof *part->indices);
    part->positions = hg_spill_calloc(part->vertex_count, 12);
    part->normals = hg_spill_calloc(part->vertex_count, 12);
    part->uv[0] = hg_spill_calloc(part->vertex_count, 8);
    if (part->indices == NULL || part->positions == NULL || part->normals == NULL ||
        part->uv[0] == NULL)
        return HG_E_NOMEM;
    set_vertices(h, part);
    set_indices(h, part);
    hg_mesh_part_update_bounds(part, 0);
    return HG_OK;
}

static enum hg_status make_asset(const struct heights *h, const char *label, struct hg_asset *asset)
{
    struct hg_material *material = hg_asset_add_material(asset, "terrain");
    struct hg_mesh *mesh = hg_asset_add_mesh(asset, label);
    struct hg_node *node = hg_asset_add_node(asset, label);
    asset->roots = hg_calloc(1, sizeof *asset->roots);
    if (material == NULL || mesh == NULL || node == NULL || asset->roots == NULL)
        return HG_E_NOMEM;
    material->metallic = 0.0f;
    material->roughness = 0.9f;
    material->base_color[0] = material->base_color[1] = material->base_color[2] = 0.5f;
    mesh->parts = hg_calloc(1, sizeof *mesh->parts);
    if (mesh->parts == NULL)
        return HG_E_NOMEM;
    mesh->part_count = 1;
    mesh->parts[0].material = material;
    node->mesh = mesh;
    node->asset = asset;
    asset->roots[0] = node;
    asset->root_count = 1;
    if (h->voids > 0)
        hg_asset_warn(asset, NULL, "%u samples are void and take the lowest height", h->voids);
    return make_part(h, &mesh->parts[0]);
}

enum hg_status hg_heightmap_load(const struct hg_load_params *params, const struct hg_refbuf *data,
    const char *label, struct hg_asset **out, struct hg_error *err)
{
    struct heights h = {0};
    *out = NULL;
    enum hg_status status = is_tile(label) ? read_tile(params, data, label, &h, err)
                                           : read_picture(params, data, label, &h, err);
    if (status == HG_OK && params->progress != NULL &&
        !params->progress(params->progress_user, "meshes", 0, 1))
        status = hg_error_set(err, HG_E_CANCELLED, label, NULL, "cancelled");
    struct hg_asset *asset = status == HG_OK ? hg_asset_create(params->asset_number, label) : NULL;
    if (status == HG_OK) {
        fill_voids(&h);
        set_steps(label, &h);
        status = asset != NULL ? make_asset(&h, label, asset) : HG_E_NOMEM;
        if (status != HG_OK)
            status = hg_error_set(err, status, label, NULL, "no memory");
    }
    if (status == HG_OK) {
        snprintf(asset->file.format, sizeof asset->file.format, "heightmap");
        *out = asset;
    } else {
        hg_asset_destroy(asset);
    }
    hg_free(h.samples);
    return status;
}
