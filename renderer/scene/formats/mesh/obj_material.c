// Material libraries of OBJ files (obj.h).
//
// Colours are linear, as the physically based keys are. A specular exponent becomes a roughness as
// import_material.c says.
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "base/alloc.h"
#include "renderer/scene/formats/mesh/obj.h"

static const float sheen_roughness = 0.5f;

static float unit(double v)
{
    return v > 0 ? (v < 1 ? (float)v : 1) : 0;
}

static struct hg_obj_material *material_at(const struct hg_obj *obj, uint64_t i)
{
    return (struct hg_obj_material *)obj->materials.items + i;
}

enum hg_status hg_obj_find_material(struct hg_obj *obj, struct hg_text name, uint32_t *number)
{
    uint32_t key[2];
    hg_key_of_name(name, key);
    enum hg_status status = hg_key_table_number(&obj->file, &obj->material_names, key, number);
    if (status || *number < obj->materials.count)
        return status;
    struct hg_obj_material *room = hg_mesh_array_add(&obj->file, &obj->materials, 1);
    char *text = room ? hg_strndup(name.at, (size_t)(name.end - name.at)) : NULL;
    if (room)
        *room = (struct hg_obj_material){.raw = {.roughness = -1, .opacity = 1}};
    if (text)
        room->material = hg_mesh_file_material(&obj->file, text);
    hg_free(text);
    if (text && room->material)
        return HG_OK;
    obj->materials.count -= room != NULL;
    return obj->file.err->status ? obj->file.err->status : hg_mesh_file_no_memory(&obj->file);
}

// ---- numbers -----------------------------------------------------------------------------------

static bool read_number(struct hg_text line, double *out)
{
    return hg_text_number_word(&line, out) && isfinite(*out);
}

// r, or r g b; "spectral" and "xyz" are not read.
static bool read_rgb(struct hg_text line, float out[3])
{
    double v[3];
    int count = 0;
    while (count < 3 && hg_text_number_word(&line, &v[count]))
        count++;
    for (int c = 0; c < 3 && count > 0; c++)
        out[c] = unit(v[c < count ? c : 0]);
    return count > 0;
}

static bool read_factor(struct hg_obj_material *m, struct hg_text key, struct hg_text line)
{
    struct hg_material *to = m->material;
    double v;
    if (hg_text_is(key, "kd"))
        return read_rgb(line, to->base_color);
    if (hg_text_is(key, "ke"))
        return read_rgb(line, to->emissive);
    if (hg_text_is(key, "ps")) {
        to->sheen.roughness = sheen_roughness;
        return read_rgb(line, to->sheen.color);
    }
    if (!read_number(line, &v))
        return false;
    if (hg_text_is(key, "ns"))
        m->raw.exponent = (float)v;
    else if (hg_text_is(key, "d"))
        m->raw.opacity = unit(v);
    else if (hg_text_is(key, "tr"))
        m->raw.opacity = unit(1 - v);
    else if (hg_text_is(key, "pr"))
        m->raw.roughness = unit(v);
    else if (hg_text_is(key, "pm"))
        to->metallic = unit(v);
    else if (hg_text_is(key, "pc"))
        to->clearcoat.factor = unit(v);
    else if (hg_text_is(key, "pcr"))
        to->clearcoat.roughness = unit(v);
    else if (hg_text_is(key, "aniso"))
        to->anisotropy.strength = unit(v);
    else if (hg_text_is(key, "anisor"))
        to->anisotropy.rotation_rad = unit(v) * 6.2831853f;
    else
        return false;
    return true;
}

// ---- textures ----------------------------------------------------------------------------------

struct map {
    double offset[3], scale[3];
    bool clamp;
    char name[512];
};

// Options, then the name, which may have blanks.
static void read_map(struct hg_text line, struct map *map)
{
    static const struct {
        const char *name;
        uint32_t words;
    } others[] = {{"-blendu", 1}, {"-blendv", 1}, {"-cc", 1}, {"-imfchan", 1}, {"-texres", 1},
        {"-bm", 1}, {"-boost", 1}, {"-type", 1}, {"-mm", 2}};
    *map = (struct map){.scale = {1, 1, 1}};
    for (;;) {
        struct hg_text rest = line;
        const struct hg_text word = hg_text_word(&rest);
        if (word.at == word.end || *word.at != '-')
            break;
        double v[3], turbulence;
        int count = 0;
        const bool is_offset = hg_text_is(word, "-o"), is_scale = hg_text_is(word, "-s");
        while ((is_offset || is_scale) && count < 3 && hg_text_number_word(&rest, &v[count]))
            count++;
        for (int c = 0; c < count; c++)
            (is_offset ? map->offset : map->scale)[c] = isfinite(v[c]) ? v[c] : 0;
        if (hg_text_is(word, "-clamp"))
            map->clamp = hg_text_is(hg_text_word(&rest), "on");
        while (hg_text_is(word, "-t") && hg_text_number_word(&rest, &turbulence))
            ;
        bool known = is_offset || is_scale || hg_text_is(word, "-clamp") || hg_text_is(word, "-t");
        for (size_t i = 0; i < sizeof others / sizeof *others; i++)
            for (uint32_t k = 0; hg_text_is(word, others[i].name) && k < others[i].words; k++) {
                (void)hg_text_word(&rest);
                known = true;
            }
        if (!known)
            break;
        line = rest;
    }
    line = hg_text_trim(line);
    if (line.end - line.at >= 2 && *line.at == '"' && line.end[-1] == '"') {
        line.at++;
        line.end--;
    }
    snprintf(map->name, sizeof map->name, "%.*s",
        (int)(line.end - line.at < 512 ? line.end - line.at : 511), line.at);
}

// v of a library grows upwards, ours downwards.
static void place_map(const struct map *map, struct hg_texture_ref *slot)
{
    slot->uv_transform[0] = (float)map->scale[0];
    slot->uv_transform[2] = (float)map->offset[0];
    slot->uv_transform[4] = (float)map->scale[1];
    slot->uv_transform[5] = (float)(1 - map->scale[1] - map->offset[1]);
    if (map->clamp)
        slot->texture->wrap_s = slot->texture->wrap_t = HG_WRAP_CLAMP;
}

static enum hg_status read_slot(
    struct hg_obj *obj, struct hg_obj_material *m, struct hg_text line, enum hg_texture_slot slot)
{
    struct map map;
    read_map(line, &map);
    struct hg_texture_ref *ref = &m->material->slots[slot];
    if (map.name[0] == 0)
        return HG_OK;
    const enum hg_status status = hg_mesh_file_texture(&obj->file, map.name, ref);
    if (!status)
        place_map(&map, ref);
    return status;
}

static enum hg_status keep_name(struct hg_obj *obj, struct hg_text line, char **out)
{
    struct map map;
    read_map(line, &map);
    hg_free(*out);
    *out = hg_strdup(map.name);
    return *out ? HG_OK : hg_mesh_file_no_memory(&obj->file);
}

// Exporters write normal maps as bump maps, which are heights: names tell.
static bool is_named_normal(struct hg_text line)
{
    static const char *const marks[] = {"normal", "nrm", "_nor", "_n."};
    struct map map;
    read_map(line, &map);
    const char *slash = strrchr(map.name, '/');
    for (size_t i = 0; i < sizeof marks / sizeof *marks; i++)
        if (strcasestr(slash ? slash : map.name, marks[i]))
            return true;
    return false;
}

static enum hg_status read_bump(struct hg_obj *obj, struct hg_obj_material *m, struct hg_text line)
{
    if (is_named_normal(line))
        return read_slot(obj, m, line, HG_SLOT_NORMAL);
    hg_asset_warn(obj->file.asset, m->material->head.name, "height maps (bump) are not shown");
    return HG_OK;
}

static enum hg_status read_texture(
    struct hg_obj *obj, struct hg_obj_material *m, struct hg_text key, struct hg_text line)
{
    if (hg_text_is(key, "map_kd")) {
        const enum hg_status status = keep_name(obj, line, &m->raw.color_map);
        return status ? status : read_slot(obj, m, line, HG_SLOT_BASE_COLOR);
    }
    if (hg_text_is(key, "map_ke"))
        return read_slot(obj, m, line, HG_SLOT_EMISSIVE);
    if (hg_text_is(key, "norm") || hg_text_is(key, "map_kn"))
        return read_slot(obj, m, line, HG_SLOT_NORMAL);
    if (hg_text_is(key, "bump") || hg_text_is(key, "map_bump"))
        return read_bump(obj, m, line);
    if (hg_text_is(key, "map_pr"))
        return keep_name(obj, line, &m->raw.rough_map);
    if (hg_text_is(key, "map_pm"))
        return keep_name(obj, line, &m->raw.metal_map);
    if (hg_text_is(key, "map_d"))
        return keep_name(obj, line, &m->raw.alpha_map);
    return HG_OK;
}

// ---- libraries ---------------------------------------------------------------------------------

static enum hg_status begin_material(
    struct hg_obj *obj, struct hg_text name, uint32_t *number, bool *skip)
{
    const enum hg_status status = hg_obj_find_material(obj, name, number);
    if (status)
        return status;
    struct hg_obj_material *m = material_at(obj, *number);
    *skip = m->defined; // the first library that defines it counts
    m->defined = true;
    return HG_OK;
}

static enum hg_status read_library(struct hg_obj *obj, const struct hg_refbuf *data)
{
    struct hg_obj_lines lines = {
        .text = {(const char *)data->data, (const char *)data->data + data->size},
        .joined.item_bytes = 1};
    struct hg_text line;
    uint32_t number = 0;
    bool skip = true;
    enum hg_status status = HG_OK;
    while (!status && hg_obj_next_line(&obj->file, &lines, &line)) {
        const struct hg_text key = hg_text_word(&line);
        if (key.at == key.end || *key.at == '#')
            continue;
        if (hg_text_is(key, "newmtl"))
            status = begin_material(obj, hg_text_trim(line), &number, &skip);
        else if (!skip && !read_factor(material_at(obj, number), key, line))
            status = read_texture(obj, material_at(obj, number), key, line);
    }
    hg_mesh_array_finish(&obj->file, &lines.joined);
    return status ? status : obj->file.err->status;
}

static enum hg_status fetch_library(
    struct hg_obj *obj, struct hg_text name, struct hg_refbuf **out, struct hg_error *error)
{
    struct hg_mesh_file *f = &obj->file;
    char *path = hg_strndup(name.at, (size_t)(name.end - name.at));
    *out = NULL;
    if (!path)
        return hg_mesh_file_no_memory(f);
    for (char *c = path; *c; c++) // Windows exporters
        *c = *c == '\\' ? '/' : *c;
    *error = (struct hg_error){0};
    const enum hg_status status =
        f->params->fetch(f->params->fetch_user, path, f->memory_limit - f->memory_used, out, error);
    hg_free(path);
    return status;
}

static enum hg_status read_one(struct hg_obj *obj, struct hg_text name, bool *found)
{
    struct hg_mesh_file *f = &obj->file;
    struct hg_refbuf *data;
    struct hg_error error;
    enum hg_status status = fetch_library(obj, name, &data, &error);
    *found = status == HG_OK;
    if (status)
        return f->err->status;
    f->memory_used += data->size;
    status = read_library(obj, data);
    obj->has_library = true;
    f->memory_used -= data->size;
    hg_refbuf_unref(data);
    return status;
}

// One name with blanks, or several names.
enum hg_status hg_obj_read_libraries(struct hg_obj *obj, struct hg_text names)
{
    bool found;
    enum hg_status status = read_one(obj, names, &found);
    if (status || found)
        return status;
    const struct hg_text all = names;
    bool any = false;
    while (!status) {
        const struct hg_text name = hg_text_word(&names);
        if (name.at == name.end)
            break;
        if (name.at == all.at && name.end == all.end)
            break; // it is the same
        status = read_one(obj, name, &found);
        any = any || found;
    }
    if (!status && !any) {
        char where[128];
        snprintf(where, sizeof where, "%.*s", (int)(all.end - all.at), all.at);
        hg_asset_warn(obj->file.asset, where,
            "the material library cannot be read: its materials are shown in grey");
    }
    return status;
}

// ---- the whole material ------------------------------------------------------------------------

static enum hg_status finish_maps(struct hg_obj *obj, struct hg_obj_material *m)
{
    struct hg_mesh_file *f = &obj->file;
    struct hg_texture_ref *slot = &m->material->slots[HG_SLOT_METALLIC_ROUGHNESS];
    const char *metal = m->raw.metal_map, *rough = m->raw.rough_map;
    enum hg_status status = HG_OK;
    if (rough && (metal ? strcmp(metal, rough) == 0 : m->material->metallic == 0)) {
        status = hg_mesh_file_texture(f, rough, slot);
        m->material->roughness = 1; // the maps are the values
        m->material->metallic = metal ? 1 : 0;
    } else if (metal || rough) {
        hg_asset_warn(f->asset, m->material->head.name,
            "separate metalness and roughness textures are not read; the factors are used");
    }
    if (!status && m->raw.alpha_map && m->raw.color_map &&
        strcmp(m->raw.alpha_map, m->raw.color_map) == 0)
        m->material->alpha_mode = HG_ALPHA_MASK;
    else if (!status && m->raw.alpha_map)
        hg_asset_warn(f->asset, m->material->head.name,
            "an opacity map (map_d) other than the colour map is not shown");
    return status;
}

static void finish_factors(struct hg_obj *obj, struct hg_obj_material *m)
{
    struct hg_material *to = m->material;
    const float *base = to->base_color, *light = to->emissive;
    if (m->raw.roughness >= 0)
        to->roughness = m->raw.roughness;
    else if (m->raw.exponent > 0)
        to->roughness = powf(2 / (m->raw.exponent + 2), 0.25f);
    if (to->slots[HG_SLOT_BASE_COLOR].texture && base[0] + base[1] + base[2] <= 0)
        for (int c = 0; c < 3; c++) // exporters that mean "the map alone"
            to->base_color[c] = 1;
    if (to->slots[HG_SLOT_EMISSIVE].texture && light[0] + light[1] + light[2] <= 0)
        for (int c = 0; c < 3; c++)
            to->emissive[c] = 1;
    for (int c = 0; c < 3 && !m->defined && obj->colors.count; c++)
        to->base_color[c] = 1; // the colours are those of the vertices
    const bool named = to->head.name != NULL && to->head.name[0] != '\0';
    if (!m->defined && named && obj->has_library)
        hg_asset_warn(obj->file.asset, to->head.name,
            "no material library defines the material: it is shown in %s",
            obj->colors.count ? "white" : "grey");
    if (m->raw.opacity <= 0) {
        hg_asset_warn(obj->file.asset, to->head.name,
            "the material is wholly transparent: it is shown as opaque");
    } else if (m->raw.opacity < 1) {
        to->base_color[3] = m->raw.opacity;
        to->alpha_mode = HG_ALPHA_BLEND;
    }
}

enum hg_status hg_obj_finish_materials(struct hg_obj *obj)
{
    enum hg_status status = HG_OK;
    for (uint64_t i = 0; !status && i < obj->materials.count; i++) {
        struct hg_obj_material *m = material_at(obj, i);
        finish_factors(obj, m);
        status = finish_maps(obj, m);
    }
    return status;
}
