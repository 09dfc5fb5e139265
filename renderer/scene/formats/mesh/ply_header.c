// The header of a PLY file (ply.h).
#include <string.h>

#include "renderer/scene/formats/mesh/ply.h"

static const struct {
    const char *name, *sized_name;
    uint32_t bytes;
} types[HG_PLY_TYPES] = {[HG_PLY_INT8] = {"char", "int8", 1},
    [HG_PLY_UINT8] = {"uchar", "uint8", 1},
    [HG_PLY_INT16] = {"short", "int16", 2},
    [HG_PLY_UINT16] = {"ushort", "uint16", 2},
    [HG_PLY_INT32] = {"int", "int32", 4},
    [HG_PLY_UINT32] = {"uint", "uint32", 4},
    [HG_PLY_FLOAT32] = {"float", "float32", 4},
    [HG_PLY_FLOAT64] = {"double", "float64", 8}};

// Names that exporters use.
static const struct {
    enum hg_ply_kind kind;
    const char *name;
    enum hg_ply_role role;
} roles[] = {{HG_PLY_VERTEX, "x", HG_PLY_X}, {HG_PLY_VERTEX, "y", HG_PLY_Y},
    {HG_PLY_VERTEX, "z", HG_PLY_Z}, {HG_PLY_VERTEX, "nx", HG_PLY_NX},
    {HG_PLY_VERTEX, "ny", HG_PLY_NY}, {HG_PLY_VERTEX, "nz", HG_PLY_NZ},
    {HG_PLY_VERTEX, "normal_x", HG_PLY_NX}, {HG_PLY_VERTEX, "normal_y", HG_PLY_NY},
    {HG_PLY_VERTEX, "normal_z", HG_PLY_NZ}, {HG_PLY_VERTEX, "u", HG_PLY_U},
    {HG_PLY_VERTEX, "v", HG_PLY_V}, {HG_PLY_VERTEX, "s", HG_PLY_U}, {HG_PLY_VERTEX, "t", HG_PLY_V},
    {HG_PLY_VERTEX, "texture_u", HG_PLY_U}, {HG_PLY_VERTEX, "texture_v", HG_PLY_V},
    {HG_PLY_VERTEX, "texture_s", HG_PLY_U}, {HG_PLY_VERTEX, "texture_t", HG_PLY_V},
    {HG_PLY_VERTEX, "red", HG_PLY_RED}, {HG_PLY_VERTEX, "green", HG_PLY_GREEN},
    {HG_PLY_VERTEX, "blue", HG_PLY_BLUE}, {HG_PLY_VERTEX, "alpha", HG_PLY_ALPHA},
    {HG_PLY_VERTEX, "r", HG_PLY_RED}, {HG_PLY_VERTEX, "g", HG_PLY_GREEN},
    {HG_PLY_VERTEX, "b", HG_PLY_BLUE}, {HG_PLY_VERTEX, "diffuse_red", HG_PLY_RED},
    {HG_PLY_VERTEX, "diffuse_green", HG_PLY_GREEN}, {HG_PLY_VERTEX, "diffuse_blue", HG_PLY_BLUE},
    {HG_PLY_FACE, "vertex_indices", HG_PLY_CORNERS}, {HG_PLY_FACE, "vertex_index", HG_PLY_CORNERS},
    {HG_PLY_FACE, "texcoord", HG_PLY_TEXCOORDS}, {HG_PLY_FACE, "texnumber", HG_PLY_TEXTURE_NUMBER},
    {HG_PLY_STRIPS, "vertex_indices", HG_PLY_CORNERS},
    {HG_PLY_STRIPS, "vertex_index", HG_PLY_CORNERS}, {HG_PLY_EDGE, "vertex1", HG_PLY_EDGE_FROM},
    {HG_PLY_EDGE, "vertex2", HG_PLY_EDGE_TO}};

uint32_t hg_ply_type_bytes(enum hg_ply_type type)
{
    return types[type].bytes;
}

static uint64_t offset_of(const struct hg_ply *ply, const char *p)
{
    return (uint64_t)(p - (const char *)ply->file.data);
}

static bool parse_type(struct hg_text word, enum hg_ply_type *out)
{
    for (int i = 0; i < HG_PLY_TYPES; i++)
        if (hg_text_is(word, types[i].name) || hg_text_is(word, types[i].sized_name)) {
            *out = (enum hg_ply_type)i;
            return true;
        }
    return false;
}

static struct hg_ply_element *last_element(struct hg_ply *ply)
{
    return (struct hg_ply_element *)ply->elements.items + ply->elements.count - 1;
}

static enum hg_ply_role role_of(enum hg_ply_kind kind, struct hg_text name, bool is_list)
{
    for (size_t i = 0; i < sizeof roles / sizeof *roles; i++)
        if (roles[i].kind == kind && hg_text_is(name, roles[i].name)) {
            const bool wants_list =
                roles[i].role == HG_PLY_CORNERS || roles[i].role == HG_PLY_TEXCOORDS;
            return wants_list == is_list ? roles[i].role : HG_PLY_SKIPPED;
        }
    return HG_PLY_SKIPPED;
}

static enum hg_status read_property(struct hg_ply *ply, struct hg_text line)
{
    if (ply->elements.count == 0)
        return hg_mesh_file_fail(&ply->file, HG_E_FORMAT, offset_of(ply, line.at),
            "a property before the first element");
    struct hg_ply_property property = {0};
    struct hg_text word = hg_text_word(&line);
    property.is_list = hg_text_is(word, "list");
    if (property.is_list) {
        word = hg_text_word(&line);
        if (!parse_type(word, &property.count_type) || property.count_type >= HG_PLY_FLOAT32)
            return hg_mesh_file_fail(&ply->file, HG_E_FORMAT, offset_of(ply, word.at),
                "the count of a list has no known integer type");
        word = hg_text_word(&line);
    }
    if (!parse_type(word, &property.type))
        return hg_mesh_file_fail(
            &ply->file, HG_E_FORMAT, offset_of(ply, word.at), "a property of no known type");
    struct hg_ply_element *e = last_element(ply);
    property.role = role_of(e->kind, hg_text_word(&line), property.is_list);
    struct hg_ply_property *room = hg_mesh_array_add(&ply->file, &ply->properties, 1);
    if (!room)
        return ply->file.err->status;
    *room = property;
    e->property_count++;
    if (e->kind == HG_PLY_VERTEX && property.role < HG_PLY_VERTEX_ROLES)
        ply->roles |= 1u << property.role;
    if (property.role == HG_PLY_RED)
        ply->color_type = property.type;
    return HG_OK;
}

static enum hg_status read_element(struct hg_ply *ply, struct hg_text line)
{
    static const struct {
        const char *name;
        enum hg_ply_kind kind;
    } kinds[] = {{"vertex", HG_PLY_VERTEX}, {"face", HG_PLY_FACE}, {"tristrips", HG_PLY_STRIPS},
        {"edge", HG_PLY_EDGE}};
    const struct hg_text name = hg_text_word(&line);
    const uint64_t offset = offset_of(ply, name.at);
    double count = -1;
    if (!hg_text_number_word(&line, &count) || !(count >= 0 && count < 9e15) ||
        count != (double)(uint64_t)count)
        return hg_mesh_file_fail(&ply->file, HG_E_FORMAT, offset, "an element without a count");
    struct hg_ply_element *e = hg_mesh_array_add(&ply->file, &ply->elements, 1);
    if (!e)
        return ply->file.err->status;
    *e = (struct hg_ply_element){.count = (uint64_t)count,
        .header_offset = offset,
        .first = (uint32_t)ply->properties.count};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (hg_text_is(name, kinds[i].name))
            e->kind = kinds[i].kind;
    if (e->kind != HG_PLY_VERTEX)
        return HG_OK;
    if (ply->has_vertex)
        return hg_mesh_file_fail(&ply->file, HG_E_FORMAT, offset, "a second element vertex");
    ply->has_vertex = true;
    ply->vertex_count = e->count;
    return HG_OK;
}

static enum hg_status read_format(struct hg_ply *ply, struct hg_text line)
{
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    const struct hg_text word = hg_text_word(&line);
    for (int i = 0; i < 3; i++)
        if (hg_text_is(word, names[i])) {
            ply->encoding = (enum hg_ply_encoding)i;
            return HG_OK;
        }
    return hg_mesh_file_fail(&ply->file, HG_E_FORMAT, offset_of(ply, word.at),
        "the format is neither ascii nor binary_little_endian nor binary_big_endian");
}

// MeshLab and photogrammetry programs name their textures in comments, in the order of texnumber.
static void read_comment(struct hg_ply *ply, struct hg_text line)
{
    if (!hg_text_is(hg_text_word(&line), "texturefile"))
        return;
    if (ply->texture_count++ == 0)
        ply->texture_file = hg_text_trim(line);
}

static enum hg_status read_line(
    struct hg_ply *ply, struct hg_text line, bool *has_format, bool *is_end)
{
    const uint64_t offset = offset_of(ply, line.at);
    const struct hg_text word = hg_text_word(&line);
    if (hg_text_is(word, "format")) {
        *has_format = true;
        return read_format(ply, line);
    }
    if (hg_text_is(word, "element"))
        return read_element(ply, line);
    if (hg_text_is(word, "property"))
        return read_property(ply, line);
    if (hg_text_is(word, "comment"))
        read_comment(ply, line);
    else if (hg_text_is(word, "end_header"))
        *is_end = true;
    else if (!hg_text_is(word, "obj_info") && word.at < word.end)
        return hg_mesh_file_fail(&ply->file, HG_E_FORMAT, offset, "not a line of a PLY header");
    return HG_OK;
}

// Bytes that one instance of an element takes at least: lists may be empty.
static uint64_t least_bytes(const struct hg_ply *ply, const struct hg_ply_element *e)
{
    const struct hg_ply_property *p = (const struct hg_ply_property *)ply->properties.items;
    uint64_t bytes = 0;
    for (uint32_t i = 0; i < e->property_count; i++) {
        const struct hg_ply_property *property = &p[e->first + i];
        bytes += ply->encoding == HG_PLY_ASCII
                     ? 2
                     : hg_ply_type_bytes(property->is_list ? property->count_type : property->type);
    }
    return bytes;
}

// Counts are held against the file's size before anything is made from them.
static enum hg_status check_counts(struct hg_ply *ply)
{
    uint64_t left = ply->file.size - ply->at + (ply->encoding == HG_PLY_ASCII);
    const struct hg_ply_element *elements = (const struct hg_ply_element *)ply->elements.items;
    for (uint64_t i = 0; i < ply->elements.count; i++) {
        const struct hg_ply_element *e = &elements[i];
        const uint64_t least = least_bytes(ply, e);
        if (least && e->count > left / least)
            return hg_mesh_file_fail(&ply->file, HG_E_FORMAT, e->header_offset,
                "%llu elements of at least %llu bytes do not fit in the %llu bytes that are left",
                (unsigned long long)e->count, (unsigned long long)least, (unsigned long long)left);
        left -= e->count * least;
    }
    if (ply->vertex_count > INT32_MAX)
        return hg_mesh_file_fail(&ply->file, HG_E_LIMIT, 0, "more than 2^31 vertices");
    return HG_OK;
}

enum hg_status hg_ply_read_header(struct hg_ply *ply)
{
    struct hg_mesh_file *f = &ply->file;
    struct hg_text text = {(const char *)f->data, (const char *)f->data + f->size}, line;
    bool has_format = false, is_end = false;
    f->is_text = true;
    if (!hg_text_line(&text, &line) || !hg_text_is(hg_text_trim(line), "ply"))
        return hg_mesh_file_fail(
            f, HG_E_FORMAT, 0, "not a PLY file: it does not begin with \"ply\"");
    // Where lines end with CR alone, a first byte of the data that is LF is not part of one.
    const bool bare_cr = text.at[-1] == '\r';
    while (!is_end && hg_text_line(&text, &line)) {
        enum hg_status status = read_line(ply, line, &has_format, &is_end);
        if (status)
            return status;
    }
    if (!is_end)
        return hg_mesh_file_fail(f, HG_E_FORMAT, f->size, "the file ends in its header");
    if (!has_format)
        return hg_mesh_file_fail(f, HG_E_FORMAT, 0, "the header names no format");
    ply->at = offset_of(ply, text.at);
    if (bare_cr && ply->encoding != HG_PLY_ASCII && text.at - line.end == 2)
        ply->at--;
    if (!(ply->roles & 1u << HG_PLY_X) || !(ply->roles & 1u << HG_PLY_Y) ||
        !(ply->roles & 1u << HG_PLY_Z))
        return hg_mesh_file_fail(f, HG_E_FORMAT, 0, "no element vertex with properties x, y and z");
    const enum hg_status status = check_counts(ply);
    f->is_text = ply->encoding == HG_PLY_ASCII;
    return status;
}
