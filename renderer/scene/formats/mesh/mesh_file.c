#include "renderer/scene/formats/mesh/mesh_file.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/spill.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/formats/texture_file.h"
#include "renderer/scene/xform.h"

enum { PROGRESS_BYTES = 4 << 20 };

static const double grey = 0.6, far_steps = 1000, far_units = 1e5;

enum hg_status hg_mesh_file_begin(struct hg_mesh_file *f, const struct hg_load_params *params,
    const struct hg_refbuf *main, const char *label, struct hg_error *err)
{
    *f = (struct hg_mesh_file){
        .params = params, .err = err, .label = label, .data = main->data, .size = main->size};
    f->memory_limit = params->memory_limit_bytes ? params->memory_limit_bytes : 8ull << 30;
    f->memory_used = main->size;
    f->asset = hg_asset_create(params->asset_number, label);
    f->root = f->asset ? hg_asset_add_node(f->asset, label) : NULL;
    return f->root ? HG_OK : hg_mesh_file_no_memory(f);
}

static bool has_geometry(const struct hg_asset *a)
{
    for (uint32_t m = 0; m < a->mesh_count; m++)
        for (uint32_t p = 0; p < a->meshes[m]->part_count; p++)
            if (a->meshes[m]->parts[p].index_count)
                return true;
    return false;
}

static enum hg_status list_roots(struct hg_mesh_file *f)
{
    struct hg_asset *a = f->asset;
    if (!has_geometry(a))
        return hg_error_set(f->err, HG_E_FORMAT, f->label, NULL,
            "the file has no geometry: no face, line or point");
    a->roots = hg_mesh_file_alloc(f, a->node_count, sizeof *a->roots);
    for (uint32_t n = 0; a->roots && n < a->node_count; n++)
        if (!a->nodes[n]->parent)
            a->roots[a->root_count++] = a->nodes[n];
    return a->roots ? HG_OK : f->err->status;
}

enum hg_status hg_mesh_file_end(
    struct hg_mesh_file *f, enum hg_status status, struct hg_asset **out)
{
    if (!status)
        status = list_roots(f);
    if (!status && !hg_asset_make_names_utf8(f->asset))
        status = hg_mesh_file_no_memory(f);
    if (status)
        hg_asset_destroy(f->asset);
    else
        memcpy(f->asset->file.origin, f->center, sizeof f->center);
    *out = status ? NULL : f->asset;
    f->asset = NULL;
    return status;
}

// ---- errors ------------------------------------------------------------------------------------

void hg_mesh_file_place(const struct hg_mesh_file *f, uint64_t offset, char *out, size_t size)
{
    uint64_t line = 1;
    for (uint64_t i = 0; f->is_text && i < offset && i < f->size; i++)
        line +=
            f->data[i] == '\n' || (f->data[i] == '\r' && i + 1 < f->size && f->data[i + 1] != '\n');
    if (f->is_text)
        snprintf(out, size, "line %llu, byte %llu", (unsigned long long)line,
            (unsigned long long)offset);
    else
        snprintf(out, size, "byte %llu", (unsigned long long)offset);
}

enum hg_status hg_mesh_file_fail(
    struct hg_mesh_file *f, enum hg_status status, uint64_t offset, const char *fmt, ...)
{
    char where[64], reason[256];
    va_list args;
    va_start(args, fmt);
    vsnprintf(reason, sizeof reason, fmt, args);
    va_end(args);
    hg_mesh_file_place(f, offset, where, sizeof where);
    return hg_error_set(f->err, status, f->label, where, "%s", reason);
}

enum hg_status hg_mesh_file_no_memory(struct hg_mesh_file *f)
{
    return hg_error_set(f->err, HG_E_NOMEM, f->label, NULL, "no memory");
}

enum hg_status hg_mesh_file_progress(struct hg_mesh_file *f, uint64_t offset)
{
    if (offset < f->next_progress)
        return HG_OK;
    f->next_progress = offset + PROGRESS_BYTES;
    if (!f->params->progress ||
        f->params->progress(f->params->progress_user, "geometry", offset, f->size))
        return HG_OK;
    return hg_error_set(f->err, HG_E_CANCELLED, f->label, NULL, "cancelled");
}

// ---- memory ------------------------------------------------------------------------------------

static bool charge(struct hg_mesh_file *f, uint64_t count, size_t size)
{
    uint64_t bytes, total;
    if (hg_mul_u64(count, size, &bytes) && hg_add_u64(f->memory_used, bytes, &total) &&
        total <= f->memory_limit) {
        f->memory_used = total;
        return true;
    }
    (void)hg_error_set(
        f->err, HG_E_LIMIT, f->label, NULL, "the asset passes the memory limit of the load");
    return false;
}

void *hg_mesh_file_alloc(struct hg_mesh_file *f, uint64_t count, size_t size)
{
    if (!charge(f, count, size))
        return NULL;
    void *memory = hg_spill_calloc((size_t)count, size);
    if (!memory)
        (void)hg_mesh_file_no_memory(f);
    return memory;
}

void hg_mesh_file_free(struct hg_mesh_file *f, void *array, uint64_t count, size_t size)
{
    if (array)
        f->memory_used -= count * size;
    hg_free(array);
}

static bool enlarge(struct hg_mesh_file *f, struct hg_mesh_array *a, uint64_t need)
{
    uint64_t capacity = a->capacity ? a->capacity + a->capacity / 2 : 8;
    if (capacity < need)
        capacity = need;
    if (!charge(f, capacity, a->item_bytes))
        return false;
    void *items = hg_spill_scratch((size_t)capacity, a->item_bytes);
    if (!items) {
        (void)hg_mesh_file_no_memory(f);
        return false;
    }
    if (a->count)
        memcpy(items, a->items, (size_t)a->count * a->item_bytes);
    hg_mesh_file_free(f, a->items, a->capacity, a->item_bytes);
    a->items = items;
    a->capacity = capacity;
    return true;
}

void *hg_mesh_array_add(struct hg_mesh_file *f, struct hg_mesh_array *a, uint64_t more)
{
    uint64_t need;
    if (!hg_add_u64(a->count, more, &need) || (need > a->capacity && !enlarge(f, a, need)))
        return NULL;
    void *room = (uint8_t *)a->items + (size_t)a->count * a->item_bytes;
    a->count = need;
    return room;
}

void hg_mesh_array_finish(struct hg_mesh_file *f, struct hg_mesh_array *a)
{
    hg_mesh_file_free(f, a->items, a->capacity, a->item_bytes);
    *a = (struct hg_mesh_array){.item_bytes = a->item_bytes};
}

// ---- tables ------------------------------------------------------------------------------------

// The finaliser of MurmurHash3 over each word.
static uint64_t hash_key(const uint32_t *key, uint32_t words)
{
    uint64_t h = words;
    for (uint32_t i = 0; i < words; i++) {
        h ^= key[i];
        h *= UINT64_C(0xff51afd7ed558ccd);
        h ^= h >> 32;
    }
    return h ^ h >> 29;
}

static enum hg_status enlarge_table(struct hg_mesh_file *f, struct hg_key_table *t)
{
    const uint32_t words = t->keys.item_bytes / sizeof(uint32_t);
    const uint64_t count = t->slot_count ? t->slot_count * 2 : 64;
    uint32_t *slots =
        charge(f, count, sizeof *slots) ? hg_spill_scratch((size_t)count, sizeof *slots) : NULL;
    if (!slots)
        return f->err->status ? f->err->status : hg_mesh_file_no_memory(f);
    for (uint64_t i = 0; i < t->keys.count; i++) {
        uint64_t at = hash_key((const uint32_t *)t->keys.items + i * words, words) & (count - 1);
        while (slots[at])
            at = (at + 1) & (count - 1);
        slots[at] = (uint32_t)i + 1;
    }
    hg_mesh_file_free(f, t->slots, t->slot_count, sizeof *slots);
    t->slots = slots;
    t->slot_count = count;
    return HG_OK;
}

enum hg_status hg_key_table_number(
    struct hg_mesh_file *f, struct hg_key_table *t, const uint32_t *key, uint32_t *number)
{
    const uint32_t words = t->keys.item_bytes / sizeof(uint32_t);
    if (2 * (t->keys.count + 1) > t->slot_count) {
        enum hg_status status = enlarge_table(f, t);
        if (status)
            return status;
    }
    uint64_t at = hash_key(key, words) & (t->slot_count - 1);
    for (; t->slots[at]; at = (at + 1) & (t->slot_count - 1)) {
        *number = t->slots[at] - 1;
        const uint32_t *other = (const uint32_t *)t->keys.items + (size_t)*number * words;
        if (memcmp(other, key, words * sizeof *key) == 0)
            return HG_OK;
    }
    if (t->keys.count >= INT32_MAX)
        return hg_error_set(f->err, HG_E_LIMIT, f->label, NULL, "too many vertices");
    void *room = hg_mesh_array_add(f, &t->keys, 1);
    if (!room)
        return f->err->status;
    memcpy(room, key, words * sizeof *key);
    *number = (uint32_t)t->keys.count - 1;
    t->slots[at] = *number + 1;
    return HG_OK;
}

void hg_key_table_finish(struct hg_mesh_file *f, struct hg_key_table *t)
{
    hg_mesh_file_free(f, t->slots, t->slot_count, sizeof *t->slots);
    hg_mesh_array_finish(f, &t->keys);
    t->slots = NULL;
    t->slot_count = 0;
}

void hg_key_of_name(struct hg_text name, uint32_t key[2])
{
    uint64_t h = UINT64_C(0xcbf29ce484222325); // FNV-1a
    for (const char *p = name.at; p < name.end; p++)
        h = (h ^ (uint8_t)*p) * UINT64_C(0x100000001b3);
    key[0] = (uint32_t)h;
    key[1] = (uint32_t)(h >> 32);
}

// ---- geometry ----------------------------------------------------------------------------------

// Whole numbers for models larger than a unit, powers of two below: a subtraction is exact then.
static double round_to(double value, double diagonal)
{
    const double step =
        diagonal > 1 ? pow(10, floor(log10(diagonal))) : exp2(floor(log2(diagonal)));
    const double rounded = diagonal > 0 ? round(value / step) * step : round(value);
    return isfinite(rounded) ? rounded : 0;
}

void hg_mesh_file_center(struct hg_mesh_file *f, const double *xyz, uint64_t count)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint64_t i = 0; i < count; i++, xyz += 3) {
        if (!isfinite(xyz[0] + xyz[1] + xyz[2]))
            continue;
        for (int c = 0; c < 3; c++) {
            low[c] = fmin(low[c], xyz[c]);
            high[c] = fmax(high[c], xyz[c]);
        }
    }
    double diagonal = 0, distance = 0;
    for (int c = 0; c < 3; c++) {
        diagonal += (high[c] - low[c]) * (high[c] - low[c]);
        distance = fmax(distance, fabs(high[c] / 2 + low[c] / 2));
    }
    diagonal = sqrt(diagonal);
    // A float has 24 bits: at a thousand diagonals a step is 1/16000 of the model.
    if (!isfinite(diagonal) || distance < diagonal ||
        (distance < far_units && distance < far_steps * diagonal))
        return;
    for (int c = 0; c < 3; c++)
        f->center[c] = round_to(high[c] / 2 + low[c] / 2, diagonal);
}

bool hg_mesh_file_place_vertex(const struct hg_mesh_file *f, const double xyz[3], float out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = (float)(xyz[c] - f->center[c]);
    if (isfinite(out[0]) && isfinite(out[1]) && isfinite(out[2]))
        return true;
    memset(out, 0, 3 * sizeof *out);
    return false;
}

float hg_srgb_decode(double value)
{
    if (!(value > 0))
        return 0;
    return value >= 1
               ? 1
               : (float)(value <= 0.04045 ? value / 12.92 : pow((value + 0.055) / 1.055, 2.4));
}

struct hg_material *hg_mesh_file_material(struct hg_mesh_file *f, const char *name)
{
    struct hg_material *m = hg_asset_add_material(f->asset, name);
    if (!m) {
        (void)hg_mesh_file_no_memory(f);
        return NULL;
    }
    for (int c = 0; c < 3; c++)
        m->base_color[c] = (float)grey;
    m->metallic = 0;
    m->double_sided = true;
    return m;
}

enum hg_status hg_mesh_file_texture(
    struct hg_mesh_file *f, const char *name, struct hg_texture_ref *slot)
{
    slot->texture = hg_texture_find(f->asset, name);
    if (slot->texture)
        return HG_OK;
    struct hg_texture *texture = hg_asset_add_texture(f->asset, name);
    char *path = texture ? hg_strdup(name) : NULL;
    struct hg_image_source *source = path ? hg_image_source_create(name) : NULL;
    enum hg_status status = source ? HG_OK : HG_E_NOMEM;
    if (!status)
        status =
            hg_texture_fetch(f->params, f->asset, path, f->memory_limit - f->memory_used, source);
    if (!status && source->encoded)
        f->memory_used += source->encoded->size;
    if (!status && hg_texture_is_usable(f->asset, name, source))
        texture->image = source;
    else
        hg_image_source_unref(source);
    hg_free(path);
    slot->texture = texture;
    return status ? hg_mesh_file_no_memory(f) : HG_OK;
}

struct hg_mesh *hg_mesh_file_mesh(struct hg_mesh_file *f, const char *name, uint32_t parts)
{
    struct hg_mesh *mesh = hg_asset_add_mesh(f->asset, name);
    struct hg_node *node = mesh ? hg_asset_add_node(f->asset, name) : NULL;
    if (!node) {
        (void)hg_mesh_file_no_memory(f);
        return NULL;
    }
    node->mesh = mesh;
    node->parent = f->root;
    *(f->last ? &f->last->next_sibling : &f->root->first_child) = node;
    f->last = node;
    mesh->parts = hg_mesh_file_alloc(f, parts, sizeof *mesh->parts);
    mesh->part_count = mesh->parts ? parts : 0;
    return mesh->parts ? mesh : NULL;
}

enum hg_status hg_mesh_part_drop_unused(struct hg_mesh_part *part)
{
    uint32_t *number = hg_spill_scratch(part->vertex_count, sizeof *number); // 1 + new
    uint32_t *source = hg_spill_scratch(part->vertex_count, sizeof *source);
    uint32_t count = 0;
    for (uint32_t i = 0; number && source && i < part->index_count; i++)
        number[part->indices[i]] = 1;
    for (uint32_t v = 0; number && source && v < part->vertex_count; v++)
        if (number[v]) {
            source[count] = v;
            number[v] = ++count;
        }
    enum hg_status status = number && source ? HG_OK : HG_E_NOMEM;
    if (!status && count < part->vertex_count) {
        for (uint32_t i = 0; i < part->index_count; i++)
            part->indices[i] = number[part->indices[i]] - 1;
        status = hg_mesh_part_remap(part, 0, source, count);
    }
    hg_free(number);
    hg_free(source);
    return status;
}

enum hg_status hg_mesh_file_finish_part(
    struct hg_mesh_file *f, struct hg_mesh_part *part, const uint32_t *smoothing)
{
    enum hg_status status = HG_OK;
    const struct hg_texture_ref *normal =
        part->material ? &part->material->slots[HG_SLOT_NORMAL] : NULL;
    const bool triangles = part->topology == HG_TOPOLOGY_TRIANGLES;
    for (size_t v = 0; part->normals && v < part->vertex_count; v++)
        if (!hg_normalize3(part->normals + v * 3))
            part->normals[v * 3 + 2] = 1;
    if (triangles && !part->normals)
        status = hg_part_make_crease_normals(part, smoothing);
    if (!status && triangles && normal && normal->texture && part->uv[0])
        status = hg_part_make_tangents(part, 0, 0);
    if (!status)
        hg_mesh_part_update_bounds(part, 0);
    return status ? hg_mesh_file_no_memory(f) : HG_OK;
}
