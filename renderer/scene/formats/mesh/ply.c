#include "renderer/scene/formats/mesh/ply.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"

enum { MOST_LIST = 1 << 24 };

static const char *const kind_names[] = {"an element", "a vertex", "a face", "a strip", "an edge"};

static uint64_t load(const uint8_t *p, uint32_t bytes, bool big)
{
    uint64_t v = 0;
    for (uint32_t i = 0; i < bytes; i++)
        v |= (uint64_t)p[big ? bytes - 1 - i : i] << 8 * i;
    return v;
}

static double decode(const uint8_t *p, enum hg_ply_type type, bool big)
{
    const uint64_t bits = load(p, hg_ply_type_bytes(type), big);
    const uint32_t word = (uint32_t)bits;
    float single;
    double wide;
    switch (type) {
    case HG_PLY_INT8:
        return (int8_t)bits;
    case HG_PLY_INT16:
        return (int16_t)bits;
    case HG_PLY_INT32:
        return (int32_t)bits;
    case HG_PLY_FLOAT32:
        memcpy(&single, &word, sizeof single);
        return (double)single;
    case HG_PLY_FLOAT64:
        memcpy(&wide, &bits, sizeof wide);
        return wide;
    default:
        return (double)bits;
    }
}

static enum hg_status ends_early(struct hg_ply *ply, enum hg_ply_kind kind)
{
    return hg_mesh_file_fail(
        &ply->file, HG_E_FORMAT, ply->file.size, "the file ends inside %s", kind_names[kind]);
}

static enum hg_status next_word(struct hg_ply *ply, enum hg_ply_kind kind, double *out)
{
    const char *data = (const char *)ply->file.data;
    struct hg_text text = {data + ply->at, data + ply->file.size};
    hg_text_skip_space(&text);
    if (text.at == text.end)
        return ends_early(ply, kind);
    ply->value_at = (uint64_t)(text.at - data);
    if (!hg_text_number_word(&text, out))
        return hg_mesh_file_fail(&ply->file, HG_E_FORMAT, ply->value_at,
            "a number of %s was expected", kind_names[kind]);
    ply->at = (uint64_t)(text.at - data);
    return HG_OK;
}

static enum hg_status next_value(
    struct hg_ply *ply, enum hg_ply_type type, enum hg_ply_kind kind, double *out)
{
    if (ply->encoding == HG_PLY_ASCII)
        return next_word(ply, kind, out);
    const uint32_t bytes = hg_ply_type_bytes(type);
    if (ply->file.size - ply->at < bytes)
        return ends_early(ply, kind);
    *out = decode(ply->file.data + ply->at, type, ply->encoding == HG_PLY_BIG);
    ply->value_at = ply->at;
    ply->at += bytes;
    return HG_OK;
}

// The count of a list, which has to fit in what is left of the file.
static enum hg_status next_count(
    struct hg_ply *ply, const struct hg_ply_property *p, enum hg_ply_kind kind, uint32_t *out)
{
    double count;
    const enum hg_status status = next_value(ply, p->count_type, kind, &count);
    if (status)
        return status;
    const uint64_t left = ply->file.size - ply->at;
    const uint64_t least = ply->encoding == HG_PLY_ASCII ? 2 : hg_ply_type_bytes(p->type);
    if (!(count >= 0 && count <= MOST_LIST) || count != floor(count) ||
        (uint64_t)count * least > left + 1)
        return hg_mesh_file_fail(&ply->file, HG_E_FORMAT, ply->value_at,
            "a list of %.0f values in %llu bytes", count, (unsigned long long)left);
    *out = (uint32_t)count;
    return HG_OK;
}

static enum hg_status skip_property(
    struct hg_ply *ply, const struct hg_ply_property *p, enum hg_ply_kind kind)
{
    uint32_t count = 1;
    double value;
    enum hg_status status = p->is_list ? next_count(ply, p, kind, &count) : HG_OK;
    if (!status && ply->encoding != HG_PLY_ASCII) {
        const uint64_t bytes = (uint64_t)count * hg_ply_type_bytes(p->type);
        if (ply->file.size - ply->at < bytes)
            return ends_early(ply, kind);
        ply->at += bytes;
        return HG_OK;
    }
    for (uint32_t i = 0; !status && i < count; i++)
        status = next_value(ply, p->type, kind, &value);
    return status;
}

static const struct hg_ply_property *properties_of(
    const struct hg_ply *ply, const struct hg_ply_element *e)
{
    return (const struct hg_ply_property *)ply->properties.items + e->first;
}

static enum hg_status skip_element(struct hg_ply *ply, const struct hg_ply_element *e)
{
    const struct hg_ply_property *p = properties_of(ply, e);
    enum hg_status status = HG_OK;
    for (uint64_t i = 0; !status && e->property_count && i < e->count; i++) {
        for (uint32_t k = 0; !status && k < e->property_count; k++)
            status = skip_property(ply, &p[k], e->kind);
        if (!status)
            status = hg_mesh_file_progress(&ply->file, ply->at);
    }
    return status;
}

// ---- vertices ----------------------------------------------------------------------------------

static double color_scale(enum hg_ply_type type)
{
    if (type == HG_PLY_FLOAT32 || type == HG_PLY_FLOAT64)
        return 1;
    return type == HG_PLY_INT16 || type == HG_PLY_UINT16 ? 1 / 65535.0 : 1 / 255.0;
}

static bool has_roles(const struct hg_ply *ply, uint32_t first, uint32_t count)
{
    const uint32_t mask = ((1u << count) - 1) << first;
    return (ply->roles & mask) == mask;
}

enum hg_status hg_ply_take_vertices(struct hg_ply *ply)
{
    struct hg_mesh_file *f = &ply->file;
    const uint64_t n = ply->vertex_count;
    bool ok = hg_mesh_array_add(f, &ply->xyz, n) != NULL;
    if (ok && has_roles(ply, HG_PLY_NX, 3))
        ok = (ply->normals = hg_mesh_file_alloc(f, n, 3 * sizeof(float))) != NULL;
    if (ok && has_roles(ply, HG_PLY_U, 2))
        ok = (ply->uv = hg_mesh_file_alloc(f, n, 2 * sizeof(float))) != NULL;
    if (ok && has_roles(ply, HG_PLY_RED, 3))
        ok = (ply->colors = hg_mesh_file_alloc(f, n, 4 * sizeof(float))) != NULL;
    return ok ? HG_OK : f->err->status;
}

static float finite_float(double v)
{
    return isfinite((float)v) ? (float)v : 0;
}

void hg_ply_store_vertex(struct hg_ply *ply, uint64_t i, const double *v, double scale)
{
    memcpy((double *)ply->xyz.items + i * 3, v + HG_PLY_X, 3 * sizeof *v);
    for (int c = 0; ply->normals && c < 3; c++)
        ply->normals[i * 3 + c] = finite_float(v[HG_PLY_NX + c]);
    if (ply->uv) {
        ply->uv[i * 2] = finite_float(v[HG_PLY_U]);
        ply->uv[i * 2 + 1] = finite_float(1 - v[HG_PLY_V]); // v grows upwards
    }
    for (int c = 0; ply->colors && c < 4; c++)
        ply->colors[i * 4 + c] = finite_float(v[HG_PLY_RED + c] * scale);
}

static enum hg_status read_vertices(struct hg_ply *ply, const struct hg_ply_element *e)
{
    const struct hg_ply_property *p = properties_of(ply, e);
    const double scale = color_scale(ply->color_type);
    double v[HG_PLY_SKIPPED + 1] = {0};
    v[HG_PLY_ALPHA] = 1 / scale;
    enum hg_status status = hg_ply_take_vertices(ply);
    for (uint64_t i = 0; !status && i < e->count; i++) {
        for (uint32_t k = 0; !status && k < e->property_count; k++)
            status = p[k].is_list ? skip_property(ply, &p[k], e->kind)
                                  : next_value(ply, p[k].type, e->kind, &v[p[k].role]);
        if (!status)
            hg_ply_store_vertex(ply, i, v, scale);
        if (!status)
            status = hg_mesh_file_progress(&ply->file, ply->at);
    }
    return status;
}

// ---- faces -------------------------------------------------------------------------------------

static enum hg_status check_index(struct hg_ply *ply, double index, enum hg_ply_kind kind)
{
    if (index >= 0 && index < (double)ply->vertex_count && index == floor(index))
        return HG_OK;
    return hg_mesh_file_fail(&ply->file, HG_E_FORMAT, ply->value_at, "%s names vertex %.0f of %llu",
        kind_names[kind], index, (unsigned long long)ply->vertex_count);
}

// Strips say with -1 that another begins; elsewhere every value is a vertex.
static enum hg_status read_loop(
    struct hg_ply *ply, const struct hg_ply_property *p, enum hg_ply_kind kind)
{
    uint32_t count, *loop = NULL;
    enum hg_status status = next_count(ply, p, kind, &count);
    ply->loop.count = 0;
    if (!status && !(loop = hg_mesh_array_add(&ply->file, &ply->loop, count)))
        return ply->file.err->status;
    for (uint32_t i = 0; !status && i < count; i++) {
        double index;
        status = next_value(ply, p->type, kind, &index);
        if (!status && kind == HG_PLY_STRIPS && index == -1)
            loop[i] = UINT32_MAX;
        else if (!status && !(status = check_index(ply, index, kind)))
            loop[i] = (uint32_t)index;
    }
    return status;
}

static enum hg_status read_loop_uv(struct hg_ply *ply, const struct hg_ply_property *p)
{
    uint32_t count;
    double *uv = NULL;
    enum hg_status status = next_count(ply, p, HG_PLY_FACE, &count);
    ply->loop_uv.count = 0;
    if (!status && !(uv = hg_mesh_array_add(&ply->file, &ply->loop_uv, count)))
        return ply->file.err->status;
    for (uint32_t i = 0; !status && i < count; i++)
        status = next_value(ply, p->type, HG_PLY_FACE, &uv[i]);
    return status;
}

static enum hg_status add_triangle(struct hg_ply *ply, const uint32_t corner[3], bool has_uv)
{
    const uint32_t *loop = (const uint32_t *)ply->loop.items;
    const double *uv = (const double *)ply->loop_uv.items;
    uint32_t *out =
        ply->corners.count < INT32_MAX - 3 ? hg_mesh_array_add(&ply->file, &ply->corners, 3) : NULL;
    float *wedge = out && has_uv ? hg_mesh_array_add(&ply->file, &ply->wedges, 3) : NULL;
    if (!out || (has_uv && !wedge))
        return ply->file.err->status
                   ? ply->file.err->status
                   : hg_mesh_file_fail(&ply->file, HG_E_LIMIT, ply->at, "too many faces");
    for (int c = 0; c < 3; c++) {
        out[c] = loop[corner[c]];
        for (uint32_t i = 0; has_uv && i < 2; i++) {
            const uint64_t at = 2 * (uint64_t)corner[c] + i;
            const double value = at < ply->loop_uv.count ? uv[at] : 0;
            wedge[c * 2 + i] = finite_float(i ? 1 - value : value);
        }
    }
    return HG_OK;
}

enum hg_status hg_ply_add_polygon(struct hg_ply *ply, bool has_uv)
{
    const uint32_t *loop = (const uint32_t *)ply->loop.items;
    const uint32_t count = (uint32_t)ply->loop.count;
    if (count == 3)
        return add_triangle(ply, (const uint32_t[3]){0, 1, 2}, has_uv);
    ply->loop_xyz.count = 0;
    double *xyz = hg_mesh_array_add(&ply->file, &ply->loop_xyz, count);
    if (!xyz)
        return ply->file.err->status;
    for (uint32_t i = 0; i < count; i++)
        memcpy(xyz + (size_t)i * 3, (const double *)ply->xyz.items + (size_t)loop[i] * 3,
            3 * sizeof *xyz);
    enum hg_status status = hg_polygons_cut(&ply->file, &ply->polygons, xyz, count);
    const uint32_t(*triangles)[3] = ply->polygons.triangles.items;
    for (uint64_t i = 0; !status && i < ply->polygons.triangles.count; i++)
        status = add_triangle(ply, triangles[i], has_uv);
    return status;
}

static enum hg_status read_faces(struct hg_ply *ply, const struct hg_ply_element *e)
{
    const struct hg_ply_property *p = properties_of(ply, e);
    bool has_uv = false;
    for (uint32_t k = 0; k < e->property_count; k++)
        has_uv = has_uv || p[k].role == HG_PLY_TEXCOORDS;
    enum hg_status status = HG_OK;
    for (uint64_t i = 0; !status && e->property_count && i < e->count; i++) {
        ply->loop.count = ply->loop_uv.count = 0;
        for (uint32_t k = 0; !status && k < e->property_count; k++)
            status = p[k].role == HG_PLY_CORNERS     ? read_loop(ply, &p[k], e->kind)
                     : p[k].role == HG_PLY_TEXCOORDS ? read_loop_uv(ply, &p[k])
                                                     : skip_property(ply, &p[k], e->kind);
        if (!status && ply->loop.count > 2)
            status = hg_ply_add_polygon(ply, has_uv);
        if (!status)
            status = hg_mesh_file_progress(&ply->file, ply->at);
    }
    return status;
}

// Every other triangle of a strip turns the other way.
static enum hg_status add_strips(struct hg_ply *ply)
{
    const uint32_t *loop = (const uint32_t *)ply->loop.items;
    enum hg_status status = HG_OK;
    uint32_t start = 0;
    for (uint32_t i = 0; !status && i < ply->loop.count; i++) {
        if (loop[i] == UINT32_MAX)
            start = i + 1;
        if (i < start + 2)
            continue;
        const uint32_t odd = (i - start) & 1;
        const uint32_t corner[3] = {i - 2, i - 1 + odd, i - odd};
        if (loop[i - 2] != loop[i - 1] && loop[i - 1] != loop[i] && loop[i - 2] != loop[i])
            status = add_triangle(ply, corner, false);
    }
    return status;
}

static enum hg_status read_strips(struct hg_ply *ply, const struct hg_ply_element *e)
{
    const struct hg_ply_property *p = properties_of(ply, e);
    enum hg_status status = HG_OK;
    for (uint64_t i = 0; !status && e->property_count && i < e->count; i++)
        for (uint32_t k = 0; !status && k < e->property_count; k++) {
            const bool strips = p[k].role == HG_PLY_CORNERS;
            status = strips ? read_loop(ply, &p[k], e->kind) : skip_property(ply, &p[k], e->kind);
            if (!status && strips)
                status = add_strips(ply);
        }
    return status;
}

static enum hg_status read_edges(struct hg_ply *ply, const struct hg_ply_element *e)
{
    const struct hg_ply_property *p = properties_of(ply, e);
    enum hg_status status = HG_OK;
    for (uint64_t i = 0; !status && e->property_count && i < e->count; i++) {
        double ends[2] = {-1, -1};
        for (uint32_t k = 0; !status && k < e->property_count; k++)
            status = p[k].role == HG_PLY_EDGE_FROM ? next_value(ply, p[k].type, e->kind, &ends[0])
                     : p[k].role == HG_PLY_EDGE_TO ? next_value(ply, p[k].type, e->kind, &ends[1])
                                                   : skip_property(ply, &p[k], e->kind);
        for (int c = 0; !status && c < 2; c++) {
            status = check_index(ply, ends[c], e->kind);
            uint32_t *out = status ? NULL : hg_mesh_array_add(&ply->file, &ply->lines, 1);
            if (out)
                *out = (uint32_t)ends[c];
            else if (!status)
                status = ply->file.err->status;
        }
    }
    return status;
}

// ---- elements ----------------------------------------------------------------------------------

static enum hg_status read_element(struct hg_ply *ply, const struct hg_ply_element *e)
{
    ply->at = e->start;
    switch (e->kind) {
    case HG_PLY_VERTEX:
        return read_vertices(ply, e);
    case HG_PLY_FACE:
        return read_faces(ply, e);
    case HG_PLY_STRIPS:
        return read_strips(ply, e);
    case HG_PLY_EDGE:
        return read_edges(ply, e);
    default:
        return skip_element(ply, e);
    }
}

// What comes before the vertices is read when these are there.
static enum hg_status read_elements(struct hg_ply *ply)
{
    struct hg_ply_element *elements = (struct hg_ply_element *)ply->elements.items;
    bool has_vertices = false;
    enum hg_status status = HG_OK;
    for (uint64_t i = 0; !status && i < ply->elements.count; i++) {
        struct hg_ply_element *e = &elements[i];
        e->start = ply->at;
        e->later = !has_vertices && e->kind != HG_PLY_VERTEX;
        has_vertices = has_vertices || e->kind == HG_PLY_VERTEX;
        status = e->later ? skip_element(ply, e) : read_element(ply, e);
    }
    for (uint64_t i = 0; !status && i < ply->elements.count; i++)
        if (elements[i].later && elements[i].kind != HG_PLY_OTHER)
            status = read_element(ply, &elements[i]);
    return status;
}

enum hg_status hg_ply_begin(struct hg_ply *ply, const struct hg_load_params *params,
    const struct hg_refbuf *main, const char *label, struct hg_error *err)
{
    *ply = (struct hg_ply){.elements.item_bytes = sizeof(struct hg_ply_element),
        .properties.item_bytes = sizeof(struct hg_ply_property),
        .xyz.item_bytes = 3 * sizeof(double),
        .corners.item_bytes = sizeof(uint32_t),
        .wedges.item_bytes = 2 * sizeof(float),
        .lines.item_bytes = sizeof(uint32_t),
        .loop.item_bytes = sizeof(uint32_t),
        .loop_uv.item_bytes = sizeof(double),
        .loop_xyz.item_bytes = 3 * sizeof(double)};
    hg_polygons_begin(&ply->polygons);
    return hg_mesh_file_begin(&ply->file, params, main, label, err);
}

enum hg_status hg_ply_end(struct hg_ply *ply, enum hg_status status, struct hg_asset **out)
{
    if (!status)
        status = hg_ply_make_asset(ply);
    struct hg_mesh_array *const arrays[] = {&ply->elements, &ply->properties, &ply->xyz,
        &ply->corners, &ply->wedges, &ply->lines, &ply->loop, &ply->loop_uv, &ply->loop_xyz};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        hg_mesh_array_finish(&ply->file, arrays[i]);
    hg_polygons_finish(&ply->file, &ply->polygons);
    hg_free(ply->normals);
    hg_free(ply->uv);
    hg_free(ply->colors);
    return hg_mesh_file_end(&ply->file, status, out);
}

enum hg_status hg_ply_load(const struct hg_load_params *params, const struct hg_refbuf *main,
    const char *label, struct hg_asset **out, struct hg_error *err)
{
    struct hg_ply ply;
    enum hg_status status = hg_ply_begin(&ply, params, main, label, err);
    if (!status)
        status = hg_ply_read_header(&ply);
    if (!status)
        status = read_elements(&ply);
    return hg_ply_end(&ply, status, out);
}
