// The asset of a PLY file (ply.h): triangles; else lines; else points.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/formats/mesh/ply.h"

static bool is_finite_vertex(const struct hg_ply *ply, uint32_t v)
{
    float out[3];
    return hg_mesh_file_place_vertex(
        &ply->file, (const double *)ply->xyz.items + (size_t)v * 3, out);
}

// Keeps the primitives all of whose vertices have a place.
static uint64_t keep_finite(struct hg_ply *ply, struct hg_mesh_array *indices,
    struct hg_mesh_array *wedges, uint32_t corners)
{
    uint32_t *index = (uint32_t *)indices->items;
    float *wedge = wedges ? (float *)wedges->items : NULL;
    uint64_t kept = 0;
    for (uint64_t i = 0; i + corners <= indices->count; i += corners) {
        bool finite = true;
        for (uint32_t c = 0; c < corners; c++)
            finite = finite && is_finite_vertex(ply, index[i + c]);
        if (!finite)
            continue;
        memmove(index + kept, index + i, corners * sizeof *index);
        if (wedge)
            memmove(wedge + kept * 2, wedge + i * 2, (size_t)corners * 2 * sizeof *wedge);
        kept += corners;
    }
    const uint64_t dropped = indices->count - kept;
    indices->count = kept;
    if (wedges)
        wedges->count = kept;
    return dropped / corners;
}

// The point of every vertex that has a place.
static enum hg_status list_points(struct hg_ply *ply, uint64_t *dropped)
{
    uint32_t *out = hg_mesh_array_add(&ply->file, &ply->lines, ply->vertex_count);
    if (!out)
        return ply->file.err->status;
    uint64_t count = 0;
    for (uint32_t v = 0; v < ply->vertex_count; v++)
        if (is_finite_vertex(ply, v))
            out[count++] = v;
    *dropped = ply->vertex_count - count;
    ply->lines.count = count;
    return HG_OK;
}

// Makes the floats of the part from the doubles, in their place.
static enum hg_status take_positions(struct hg_ply *ply, struct hg_mesh_part *part)
{
    struct hg_mesh_array *a = &ply->xyz;
    const double *xyz = (const double *)a->items;
    for (uint64_t v = 0; v < a->count; v++) {
        double from[3];
        float to[3];
        memcpy(from, xyz + v * 3, sizeof from);
        (void)hg_mesh_file_place_vertex(&ply->file, from, to);
        memcpy((uint8_t *)a->items + v * sizeof to, to, sizeof to);
    }
    part->positions = hg_realloc(a->items, (size_t)a->count, 3 * sizeof(float));
    if (!part->positions)
        return hg_mesh_file_no_memory(&ply->file);
    ply->file.memory_used -= a->capacity * a->item_bytes - a->count * 3 * sizeof(float);
    part->vertex_count = (uint32_t)a->count;
    *a = (struct hg_mesh_array){.item_bytes = a->item_bytes};
    return HG_OK;
}

static void take_indices(struct hg_ply *ply, struct hg_mesh_array *a, struct hg_mesh_part *part)
{
    ply->file.memory_used -= (a->capacity - a->count) * a->item_bytes;
    uint32_t *shrunk = hg_realloc(a->items, (size_t)a->count, sizeof *shrunk);
    part->indices = shrunk ? shrunk : (uint32_t *)a->items;
    part->index_count = (uint32_t)a->count;
    *a = (struct hg_mesh_array){.item_bytes = a->item_bytes};
}

// Colours of files are for displays: sRGB. Floats beyond 1 count to 255.
static void decode_colors(struct hg_ply *ply)
{
    float most = 0, table[256];
    const uint64_t n = ply->vertex_count;
    for (uint64_t i = 0; i < n * 4; i++)
        most = fmaxf(most, i % 4 == 3 ? 0 : ply->colors[i]);
    const float scale = most > 1 ? 1.0f / 255 : 1;
    const bool bytes = ply->color_type <= HG_PLY_UINT8;
    for (int i = 0; i < 256; i++)
        table[i] = hg_srgb_decode(i / 255.0);
    for (uint64_t i = 0; i < n * 4; i++) {
        const float v = fmaxf(0, fminf(ply->colors[i] * scale, 1));
        ply->colors[i] = i % 4 == 3 ? fmaxf(0, fminf(ply->colors[i], 1))
                         : bytes    ? table[(int)(v * 255 + 0.5f)]
                                    : hg_srgb_decode((double)v);
    }
}

// Texture coordinates of corners: vertices are split where they differ.
static enum hg_status apply_wedges(struct hg_ply *ply, struct hg_mesh_part *part)
{
    struct hg_mesh_file *f = &ply->file;
    const float *wedges = (const float *)ply->wedges.items;
    struct hg_key_table table = {.keys.item_bytes = 3 * sizeof(uint32_t)};
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; !status && i < part->index_count; i++) {
        uint32_t key[3] = {part->indices[i]};
        memcpy(key + 1, wedges + (size_t)i * 2, 2 * sizeof *key);
        status = hg_key_table_number(f, &table, key, &part->indices[i]);
    }
    const uint32_t count = (uint32_t)table.keys.count;
    const uint32_t *keys = (const uint32_t *)table.keys.items;
    uint32_t *source = status ? NULL : hg_mesh_file_alloc(f, count, sizeof *source);
    float *uv = source ? hg_mesh_file_alloc(f, count, 2 * sizeof *uv) : NULL;
    for (uint32_t v = 0; uv && v < count; v++) {
        source[v] = keys[(size_t)v * 3];
        memcpy(uv + (size_t)v * 2, keys + (size_t)v * 3 + 1, 2 * sizeof *uv);
    }
    if (!status && !uv)
        status = f->err->status;
    if (!status && hg_mesh_part_remap(part, 0, source, count))
        status = hg_mesh_file_no_memory(f);
    hg_free(part->uv[0]);
    part->uv[0] = uv;
    hg_mesh_file_free(f, source, count, sizeof *source);
    hg_key_table_finish(f, &table);
    return status;
}

static enum hg_status make_material(struct hg_ply *ply, struct hg_mesh_part *part)
{
    struct hg_mesh_file *f = &ply->file;
    struct hg_material *m = hg_mesh_file_material(f, "");
    if (!m)
        return f->err->status;
    part->material = m;
    enum hg_status status = HG_OK;
    if (ply->texture_count && part->uv[0]) {
        char name[256];
        snprintf(name, sizeof name, "%.*s", (int)(ply->texture_file.end - ply->texture_file.at),
            ply->texture_file.at);
        status = hg_mesh_file_texture(f, name, &m->slots[HG_SLOT_BASE_COLOR]);
    }
    if (ply->texture_count > 1 && part->uv[0])
        hg_asset_warn(f->asset, NULL, "%u textures are named: the first is shown on all faces",
            ply->texture_count);
    for (int c = 0; c < 3 && (part->colors || m->slots[HG_SLOT_BASE_COLOR].texture); c++)
        m->base_color[c] = 1; // the colours are the file's
    return status;
}

static enum hg_status make_part(struct hg_ply *ply, struct hg_mesh_part *part)
{
    const bool triangles = ply->corners.count > 0, wedges = ply->wedges.count > 0;
    const bool lines = !triangles && ply->lines.count > 0;
    part->topology = triangles ? HG_TOPOLOGY_TRIANGLES
                     : lines   ? HG_TOPOLOGY_LINES
                               : HG_TOPOLOGY_POINTS;
    uint64_t dropped = 0;
    enum hg_status status = HG_OK;
    if (triangles)
        dropped = keep_finite(ply, &ply->corners, wedges ? &ply->wedges : NULL, 3);
    else if (lines)
        dropped = keep_finite(ply, &ply->lines, NULL, 2);
    else
        status = list_points(ply, &dropped);
    if (dropped)
        hg_asset_warn(ply->file.asset, NULL, "%llu %s without a finite place are left out",
            (unsigned long long)dropped,
            triangles ? "triangles"
            : lines   ? "lines"
                      : "points");
    if (!status)
        status = take_positions(ply, part);
    if (status)
        return status;
    take_indices(ply, triangles ? &ply->corners : &ply->lines, part);
    if (ply->colors)
        decode_colors(ply);
    part->normals = ply->normals;
    part->uv[0] = ply->uv;
    part->colors = ply->colors;
    ply->normals = ply->uv = ply->colors = NULL;
    if (wedges)
        status = apply_wedges(ply, part);
    return status ? status : make_material(ply, part);
}

enum hg_status hg_ply_make_asset(struct hg_ply *ply)
{
    struct hg_mesh_file *f = &ply->file;
    hg_mesh_file_center(f, (const double *)ply->xyz.items, ply->xyz.count);
    if (ply->polygons.gave_up)
        hg_asset_warn(f->asset, NULL, "polygons with too many corners are cut as if convex");
    struct hg_mesh *mesh = hg_mesh_file_mesh(f, f->label, 1);
    if (!mesh)
        return f->err->status;
    struct hg_mesh_part *part = mesh->parts;
    enum hg_status status = make_part(ply, part);
    const bool all_used =
        part->topology == HG_TOPOLOGY_POINTS && part->index_count == part->vertex_count;
    if (!status && !all_used && hg_mesh_part_drop_unused(part))
        status = hg_mesh_file_no_memory(f);
    return status ? status : hg_mesh_file_finish_part(f, part, NULL);
}
