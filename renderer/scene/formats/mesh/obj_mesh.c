// The asset of an OBJ file (obj.h): a mesh for each group, a part for each of its materials.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/formats/mesh/obj.h"

enum { V, VT, VN };

static enum hg_status check_indices(struct hg_obj *obj)
{
    struct hg_mesh_file *f = &obj->file;
    static const char *const names[] = {"v", "vt", "vn"};
    const uint64_t counts[] = {obj->v.count, obj->vt.count, obj->vn.count};
    if (obj->most[V].index > counts[V])
        return hg_mesh_file_fail(f, HG_E_FORMAT, obj->most[V].offset,
            "a corner names vertex %llu of %llu", (unsigned long long)obj->most[V].index,
            (unsigned long long)counts[V]);
    for (int i = VT; i <= VN; i++) {
        char where[64];
        if (obj->most[i].index <= counts[i])
            continue;
        hg_mesh_file_place(f, obj->most[i].offset, where, sizeof where);
        hg_asset_warn(f->asset, where, "a corner names %s %llu of %llu: those corners go without",
            names[i], (unsigned long long)obj->most[i].index, (unsigned long long)counts[i]);
    }
    return HG_OK;
}

static uint32_t corners_of(enum hg_obj_kind kind)
{
    return kind == HG_OBJ_POINTS ? 1 : kind == HG_OBJ_LINES ? 2 : 3;
}

static bool is_finite_corner(const struct hg_obj *obj, const uint32_t corner[3])
{
    float out[3];
    return hg_mesh_file_place_vertex(
        &obj->file, (const double *)obj->v.items + (size_t)corner[V] * 3, out);
}

// Numbers the corners that differ; *dropped: primitives without a finite place.
static enum hg_status number_corners(struct hg_obj *obj, struct hg_obj_part *from,
    struct hg_key_table *table, struct hg_mesh_part *part, uint64_t *dropped)
{
    const uint32_t n = corners_of(from->kind);
    uint32_t *smoothing = (uint32_t *)from->smoothing.items;
    enum hg_status status = HG_OK;
    for (uint64_t i = 0; !status && i + n <= from->corners.count; i += n) {
        const uint32_t(*corner)[3] = (const uint32_t(*)[3])from->corners.items + i;
        bool finite = true;
        for (uint32_t c = 0; c < n; c++)
            finite = finite && is_finite_corner(obj, corner[c]);
        *dropped += !finite;
        if (!finite)
            continue;
        if (from->smoothing.count)
            smoothing[part->index_count / 3] = smoothing[i / 3];
        for (uint32_t c = 0; !status && c < n; c++)
            status = hg_key_table_number(
                &obj->file, table, corner[c], &part->indices[part->index_count + c]);
        part->index_count += status ? 0 : n;
    }
    return status;
}

// Which arrays the part has.
static bool take_arrays(struct hg_obj *obj, const struct hg_obj_part *from, const uint32_t *keys,
    struct hg_mesh_part *part)
{
    struct hg_mesh_file *f = &obj->file;
    const uint64_t n = part->vertex_count;
    bool has_uv = false, has_normals = from->kind == HG_OBJ_SHADED;
    for (uint64_t v = 0; v < n; v++) {
        has_uv = has_uv || keys[v * 3 + VT] < obj->vt.count;
        has_normals =
            has_normals || (from->kind == HG_OBJ_POINTS && keys[v * 3 + VN] < obj->vn.count);
    }
    part->positions = hg_mesh_file_alloc(f, n, 3 * sizeof(float));
    bool ok = part->positions != NULL;
    if (ok && has_normals)
        ok = (part->normals = hg_mesh_file_alloc(f, n, 3 * sizeof(float))) != NULL;
    if (ok && has_uv)
        ok = (part->uv[0] = hg_mesh_file_alloc(f, n, 2 * sizeof(float))) != NULL;
    if (ok && obj->colors.count)
        ok = (part->colors = hg_mesh_file_alloc(f, n, 4 * sizeof(float))) != NULL;
    return ok;
}

static void set_color(const struct hg_obj *obj, uint32_t vertex, float out[4])
{
    const float *rgb = (const float *)obj->colors.items + (size_t)vertex * 3;
    const float scale = obj->most_color > 1 ? 1.0f / 255 : 1;
    for (int c = 0; c < 3; c++) // of vertices behind the last that has a colour: white
        out[c] = vertex < obj->colors.count ? hg_srgb_decode((double)(rgb[c] * scale)) : 1;
    out[3] = 1;
}

static void fill_arrays(const struct hg_obj *obj, const uint32_t *keys, struct hg_mesh_part *part)
{
    for (size_t i = 0; i < part->vertex_count; i++) {
        const uint32_t v = keys[i * 3 + V], vt = keys[i * 3 + VT], vn = keys[i * 3 + VN];
        (void)hg_mesh_file_place_vertex(
            &obj->file, (const double *)obj->v.items + (size_t)v * 3, part->positions + i * 3);
        if (part->normals && vn < obj->vn.count)
            memcpy(part->normals + i * 3, (const float *)obj->vn.items + (size_t)vn * 3,
                3 * sizeof(float));
        if (part->uv[0] && vt < obj->vt.count)
            memcpy(part->uv[0] + i * 2, (const float *)obj->vt.items + (size_t)vt * 2,
                2 * sizeof(float));
        if (part->colors)
            set_color(obj, v, part->colors + i * 4);
    }
}

// NULL where no statement s came before any of the triangles.
static const uint32_t *smoothing_of(const struct hg_obj_part *from)
{
    const uint32_t *groups = (const uint32_t *)from->smoothing.items;
    for (uint64_t i = 0; i < from->smoothing.count; i++)
        if (groups[i] != HG_OBJ_NONE)
            return groups;
    return NULL;
}

static enum hg_status make_part(
    struct hg_obj *obj, struct hg_obj_part *from, struct hg_mesh_part *part, uint64_t *dropped)
{
    static const enum hg_topology topologies[] = {
        HG_TOPOLOGY_TRIANGLES, HG_TOPOLOGY_TRIANGLES, HG_TOPOLOGY_LINES, HG_TOPOLOGY_POINTS};
    struct hg_mesh_file *f = &obj->file;
    struct hg_key_table table = {.keys.item_bytes = 3 * sizeof(uint32_t)};
    part->topology = topologies[from->kind];
    part->material =
        ((const struct hg_obj_material *)obj->materials.items)[from->material].material;
    part->indices = hg_mesh_file_alloc(f, from->corners.count, sizeof *part->indices);
    enum hg_status status =
        part->indices ? number_corners(obj, from, &table, part, dropped) : f->err->status;
    if (!status) {
        const uint32_t *keys = (const uint32_t *)table.keys.items;
        part->vertex_count = (uint32_t)table.keys.count;
        if (take_arrays(obj, from, keys, part))
            fill_arrays(obj, keys, part);
        else
            status = f->err->status;
    }
    hg_key_table_finish(f, &table);
    if (!status)
        status = hg_mesh_file_finish_part(f, part, smoothing_of(from));
    hg_mesh_array_finish(f, &from->corners);
    hg_mesh_array_finish(f, &from->smoothing);
    return status;
}

static int compare_parts(const void *a, const void *b)
{
    const struct hg_obj_part *x = a, *y = b;
    if (x->group != y->group)
        return x->group < y->group ? -1 : 1;
    if (x->material != y->material)
        return x->material < y->material ? -1 : 1;
    return x->kind < y->kind ? -1 : x->kind > y->kind;
}

static enum hg_status make_group(
    struct hg_obj *obj, struct hg_obj_part *parts, uint32_t count, uint64_t *dropped)
{
    const struct hg_text name = ((const struct hg_text *)obj->groups.items)[parts->group];
    char *text = hg_strndup(name.at, (size_t)(name.end - name.at));
    struct hg_mesh *mesh = text ? hg_mesh_file_mesh(&obj->file, text, count) : NULL;
    enum hg_status status = mesh   ? HG_OK
                            : text ? obj->file.err->status
                                   : hg_mesh_file_no_memory(&obj->file);
    for (uint32_t i = 0; !status && i < count; i++)
        status = make_part(obj, &parts[i], &mesh->parts[i], dropped);
    hg_free(text);
    return status;
}

enum hg_status hg_obj_make_asset(struct hg_obj *obj)
{
    struct hg_mesh_file *f = &obj->file;
    struct hg_obj_part *parts = (struct hg_obj_part *)obj->parts.items;
    uint64_t dropped = 0;
    enum hg_status status = check_indices(obj);
    if (status)
        return status;
    if (obj->has_free_forms)
        hg_asset_warn(f->asset, NULL, "curves and surfaces of free form are not read");
    if (obj->polygons.gave_up)
        hg_asset_warn(f->asset, NULL, "polygons with too many corners are cut as if convex");
    hg_mesh_file_center(f, (const double *)obj->v.items, obj->v.count);
    if (parts)
        qsort(parts, (size_t)obj->parts.count, sizeof *parts, compare_parts);
    for (uint64_t i = 0, end; !status && i < obj->parts.count; i = end) {
        for (end = i + 1; end < obj->parts.count && parts[end].group == parts[i].group; end++)
            ;
        status = make_group(obj, &parts[i], (uint32_t)(end - i), &dropped);
    }
    if (dropped)
        hg_asset_warn(f->asset, NULL, "%llu primitives without a finite place are left out",
            (unsigned long long)dropped);
    return status;
}
