#include "renderer/scene/formats/mesh/obj.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"

enum { V, VT, VN };

bool hg_obj_next_line(struct hg_mesh_file *f, struct hg_obj_lines *lines, struct hg_text *line)
{
    lines->start = lines->text.at;
    lines->joined.count = 0;
    for (;;) {
        if (!hg_text_line(&lines->text, line)) {
            *line = (struct hg_text){lines->text.end, lines->text.end};
            if (lines->joined.count == 0)
                return false;
        }
        const bool goes_on = line->end > line->at && line->end[-1] == '\\';
        if (!goes_on && lines->joined.count == 0)
            return true;
        const size_t size = (size_t)(line->end - line->at);
        char *room = hg_mesh_array_add(f, &lines->joined, size + 1);
        if (!room)
            return false;
        memcpy(room, line->at, size);
        room[size] = ' ';
        if (goes_on)
            room[size - 1] = ' ';
        else
            break;
    }
    const char *joined = (const char *)lines->joined.items;
    *line = (struct hg_text){joined, joined + lines->joined.count};
    return true;
}

static uint64_t offset_of(const struct hg_obj *obj)
{
    return (uint64_t)(obj->lines.start - (const char *)obj->file.data);
}

static enum hg_status fail(struct hg_obj *obj, const char *reason)
{
    return hg_mesh_file_fail(&obj->file, HG_E_FORMAT, offset_of(obj), "%s", reason);
}

// ---- vertices ----------------------------------------------------------------------------------

// As many numbers as there are, at most `most`; a comment ends them.
static uint32_t read_numbers(struct hg_text *line, double *out, uint32_t most)
{
    uint32_t count = 0;
    while (count < most && hg_text_number_word(line, &out[count]))
        count++;
    return count;
}

static enum hg_status add_color(struct hg_obj *obj, const double *rgb)
{
    const uint64_t more = obj->v.count - obj->colors.count;
    float *room = hg_mesh_array_add(&obj->file, &obj->colors, more);
    if (!room)
        return obj->file.err->status;
    for (uint64_t i = 0; i + 1 < more; i++) // vertices before the first that has one
        room[i * 3] = room[i * 3 + 1] = room[i * 3 + 2] = 1;
    for (int c = 0; c < 3; c++) {
        const float v = rgb[c] > 0 && isfinite(rgb[c]) ? (float)rgb[c] : 0;
        room[(more - 1) * 3 + c] = v;
        obj->most_color = fmaxf(obj->most_color, v);
    }
    return HG_OK;
}

// x y z, then w or a colour or both; w is of curves, which are not read.
static enum hg_status read_vertex(struct hg_obj *obj, struct hg_text *line)
{
    double v[8];
    const uint32_t count = read_numbers(line, v, 8);
    if (count < 3)
        return fail(obj, "a vertex needs three numbers");
    double *room = obj->v.count < INT32_MAX ? hg_mesh_array_add(&obj->file, &obj->v, 1) : NULL;
    if (!room)
        return obj->file.err->status ? obj->file.err->status : fail(obj, "too many vertices");
    memcpy(room, v, 3 * sizeof *v);
    if (count == 6 || count >= 7)
        return add_color(obj, count == 6 ? v + 3 : count == 7 ? v + 3 : v + 4);
    return HG_OK;
}

static enum hg_status read_floats(
    struct hg_obj *obj, struct hg_text *line, struct hg_mesh_array *a, uint32_t width)
{
    double v[3] = {0};
    if (read_numbers(line, v, width) < (width == 3 ? 3u : 1u))
        return fail(obj, width == 3 ? "a normal needs three numbers" : "vt needs a number");
    float *room = a->count < INT32_MAX ? hg_mesh_array_add(&obj->file, a, 1) : NULL;
    if (!room)
        return obj->file.err->status ? obj->file.err->status : fail(obj, "too many vertices");
    if (width == 2)
        v[1] = 1 - v[1]; // v grows upwards
    for (uint32_t c = 0; c < width; c++)
        room[c] = isfinite((float)v[c]) ? (float)v[c] : 0;
    return HG_OK;
}

// ---- primitives --------------------------------------------------------------------------------

// A whole number other than 0; -1 is the last one so far.
static bool read_index(struct hg_text *line, uint64_t so_far, uint32_t *out)
{
    const bool negative = line->at < line->end && *line->at == '-';
    const char *p = line->at + negative;
    uint64_t value = 0;
    const char *first = p;
    for (; p < line->end && *p >= '0' && *p <= '9'; p++)
        value = value < UINT32_MAX ? value * 10 + (uint64_t)(*p - '0') : value;
    line->at = p;
    if (p == first || value == 0 || value >= INT32_MAX || (negative && value > so_far))
        return false;
    *out = (uint32_t)(negative ? so_far - value : value - 1);
    return true;
}

static void note_index(struct hg_obj *obj, int kind, uint32_t index)
{
    if (index + UINT64_C(1) <= obj->most[kind].index)
        return;
    obj->most[kind].index = index + UINT64_C(1);
    obj->most[kind].offset = offset_of(obj);
}

// v, v/vt, v//vn or v/vt/vn
static enum hg_status read_corner(struct hg_obj *obj, struct hg_text *line)
{
    const uint64_t so_far[3] = {obj->v.count, obj->vt.count, obj->vn.count};
    uint32_t corner[3] = {HG_OBJ_NONE, HG_OBJ_NONE, HG_OBJ_NONE};
    for (int i = 0; i < 3; i++) {
        const bool empty =
            i > 0 && (line->at == line->end || *line->at == '/' || hg_text_is_space(*line->at));
        if (!empty && !read_index(line, so_far[i], &corner[i]))
            return fail(obj, "a corner is not v, v/vt, v//vn or v/vt/vn of vertices before it");
        if (corner[i] != HG_OBJ_NONE)
            note_index(obj, i, corner[i]);
        if (line->at == line->end || *line->at != '/')
            break;
        line->at++;
    }
    if (line->at < line->end && !hg_text_is_space(*line->at))
        return fail(obj, "a corner is not v, v/vt, v//vn or v/vt/vn of vertices before it");
    uint32_t *room = hg_mesh_array_add(&obj->file, &obj->loop, 1);
    if (!room)
        return obj->file.err->status;
    memcpy(room, corner, sizeof corner);
    return HG_OK;
}

static enum hg_status read_loop(struct hg_obj *obj, struct hg_text *line)
{
    obj->loop.count = 0;
    for (;;) {
        hg_text_skip_blanks(line);
        if (line->at == line->end || *line->at == '#')
            return HG_OK;
        const enum hg_status status = read_corner(obj, line);
        if (status)
            return status;
    }
}

// The part that primitives of this kind go to now.
static struct hg_obj_part *find_part(struct hg_obj *obj, enum hg_obj_kind kind)
{
    const struct hg_text unnamed = {obj->file.label, obj->file.label};
    uint32_t number;
    if (obj->material == HG_OBJ_NONE && hg_obj_find_material(obj, unnamed, &obj->material))
        return NULL;
    const uint32_t key[3] = {obj->group, obj->material, kind};
    if (hg_key_table_number(&obj->file, &obj->part_keys, key, &number))
        return NULL;
    if (number < obj->parts.count)
        return (struct hg_obj_part *)obj->parts.items + number;
    struct hg_obj_part *part = hg_mesh_array_add(&obj->file, &obj->parts, 1);
    if (part)
        *part = (struct hg_obj_part){.group = obj->group,
            .material = obj->material,
            .kind = kind,
            .corners.item_bytes = 3 * sizeof(uint32_t),
            .smoothing.item_bytes = sizeof(uint32_t)};
    return part;
}

// Copies corners of the loop to a part.
static enum hg_status add_primitive(
    struct hg_obj *obj, struct hg_obj_part *part, const uint32_t *corner, uint32_t count)
{
    const uint32_t *loop = (const uint32_t *)obj->loop.items;
    uint32_t *room = part->corners.count < INT32_MAX - 3
                         ? hg_mesh_array_add(&obj->file, &part->corners, count)
                         : NULL;
    if (!room)
        return obj->file.err->status ? obj->file.err->status : fail(obj, "too many faces");
    for (uint32_t c = 0; c < count; c++)
        memcpy(room + (size_t)c * 3, loop + (size_t)corner[c] * 3, 3 * sizeof *room);
    if (part->kind != HG_OBJ_UNSHADED)
        return HG_OK;
    uint32_t *group = hg_mesh_array_add(&obj->file, &part->smoothing, 1);
    if (group)
        *group = obj->smoothing;
    return group ? HG_OK : obj->file.err->status;
}

static enum hg_status add_polyline(struct hg_obj *obj)
{
    struct hg_obj_part *part = obj->loop.count > 1 ? find_part(obj, HG_OBJ_LINES) : NULL;
    enum hg_status status = part || obj->loop.count < 2 ? HG_OK : obj->file.err->status;
    for (uint32_t i = 0; !status && i + 1 < obj->loop.count; i++)
        status = add_primitive(obj, part, (const uint32_t[2]){i, i + 1}, 2);
    return status;
}

static enum hg_status add_points(struct hg_obj *obj)
{
    struct hg_obj_part *part = find_part(obj, HG_OBJ_POINTS);
    enum hg_status status = part ? HG_OK : obj->file.err->status;
    for (uint32_t i = 0; !status && i < obj->loop.count; i++)
        status = add_primitive(obj, part, &i, 1);
    return status;
}

static enum hg_status add_polygon(struct hg_obj *obj)
{
    const uint32_t *loop = (const uint32_t *)obj->loop.items;
    const uint32_t count = (uint32_t)obj->loop.count;
    obj->loop_xyz.count = 0;
    double *xyz = hg_mesh_array_add(&obj->file, &obj->loop_xyz, count);
    if (!xyz)
        return obj->file.err->status;
    bool shaded = true, known = true;
    for (uint32_t i = 0; i < count; i++) {
        shaded = shaded && loop[i * 3 + VN] != HG_OBJ_NONE;
        known = known && loop[i * 3 + V] < obj->v.count;
    }
    for (uint32_t i = 0; i < count; i++) // those of later vertices are cut as if convex
        for (uint32_t c = 0; c < 3; c++)
            xyz[i * 3 + c] =
                known ? ((const double *)obj->v.items)[(size_t)loop[i * 3 + V] * 3 + c] : 0;
    struct hg_obj_part *part = find_part(obj, shaded ? HG_OBJ_SHADED : HG_OBJ_UNSHADED);
    enum hg_status status =
        part ? hg_polygons_cut(&obj->file, &obj->polygons, xyz, count) : obj->file.err->status;
    const uint32_t(*triangles)[3] = obj->polygons.triangles.items;
    for (uint64_t i = 0; !status && i < obj->polygons.triangles.count; i++)
        status = add_primitive(obj, part, triangles[i], 3);
    return status;
}

static enum hg_status read_face(struct hg_obj *obj, struct hg_text *line)
{
    const enum hg_status status = read_loop(obj, line);
    if (status || obj->loop.count == 0)
        return status;
    return obj->loop.count > 2   ? add_polygon(obj)
           : obj->loop.count > 1 ? add_polyline(obj)
                                 : add_points(obj);
}

// ---- statements --------------------------------------------------------------------------------

static enum hg_status begin_group(struct hg_obj *obj, struct hg_text name)
{
    uint32_t key[2];
    hg_key_of_name(name, key);
    const enum hg_status status =
        hg_key_table_number(&obj->file, &obj->group_names, key, &obj->group);
    if (status || obj->group < obj->groups.count)
        return status;
    struct hg_text *room = hg_mesh_array_add(&obj->file, &obj->groups, 1);
    if (!room)
        return obj->file.err->status;
    *room = name;
    return HG_OK;
}

// A name in joined lines would not outlive them; only where it lies in the file is it kept.
static struct hg_text lasting(const struct hg_obj *obj, struct hg_text name)
{
    const char *data = (const char *)obj->file.data;
    return name.at >= data && name.end <= data + obj->file.size ? name
                                                                : (struct hg_text){data, data};
}

static enum hg_status read_smoothing(struct hg_obj *obj, struct hg_text line)
{
    double group = 0;
    obj->smoothing = hg_text_number_word(&line, &group) && group > 0 && group < 1e9
                         ? (uint32_t)group
                         : 0; // "off"
    return HG_OK;
}

static enum hg_status read_statement(struct hg_obj *obj, struct hg_text line)
{
    static const char *const free_forms[] = {"curv", "curv2", "surf", "cstype", "vp"};
    const struct hg_text word = hg_text_word(&line);
    enum hg_status status;
    if (word.at == word.end || *word.at == '#')
        return HG_OK;
    if (hg_text_is(word, "v"))
        return read_vertex(obj, &line);
    if (hg_text_is(word, "vt"))
        return read_floats(obj, &line, &obj->vt, 2);
    if (hg_text_is(word, "vn"))
        return read_floats(obj, &line, &obj->vn, 3);
    if (hg_text_is(word, "f") || hg_text_is(word, "fo"))
        return read_face(obj, &line);
    if (hg_text_is(word, "l"))
        return (status = read_loop(obj, &line)) ? status : add_polyline(obj);
    if (hg_text_is(word, "p"))
        return (status = read_loop(obj, &line)) ? status : add_points(obj);
    if (hg_text_is(word, "o") || hg_text_is(word, "g"))
        return begin_group(obj, lasting(obj, hg_text_trim(line)));
    if (hg_text_is(word, "s"))
        return read_smoothing(obj, line);
    if (hg_text_is(word, "usemtl"))
        return hg_obj_find_material(obj, hg_text_trim(line), &obj->material);
    if (hg_text_is(word, "mtllib"))
        return hg_obj_read_libraries(obj, hg_text_trim(line));
    for (size_t i = 0; i < sizeof free_forms / sizeof *free_forms; i++)
        obj->has_free_forms = obj->has_free_forms || hg_text_is(word, free_forms[i]);
    return HG_OK;
}

// A file of vertices alone is a point cloud.
static enum hg_status add_cloud(struct hg_obj *obj)
{
    const bool with_normals = obj->vn.count == obj->v.count; // one for each, in their order
    struct hg_obj_part *part = find_part(obj, HG_OBJ_POINTS);
    uint32_t *corner = part ? hg_mesh_array_add(&obj->file, &part->corners, obj->v.count) : NULL;
    for (uint32_t v = 0; corner && v < obj->v.count; v++, corner += 3) {
        corner[V] = v;
        corner[VT] = HG_OBJ_NONE;
        corner[VN] = with_normals ? v : HG_OBJ_NONE;
    }
    return obj->file.err->status;
}

static enum hg_status read_statements(struct hg_obj *obj)
{
    struct hg_mesh_file *f = &obj->file;
    struct hg_text line;
    obj->lines.text = (struct hg_text){(const char *)f->data, (const char *)f->data + f->size};
    enum hg_status status =
        begin_group(obj, (struct hg_text){f->label, f->label + strlen(f->label)});
    while (!status && hg_obj_next_line(f, &obj->lines, &line)) {
        status = read_statement(obj, line);
        if (!status)
            status = hg_mesh_file_progress(f, offset_of(obj));
    }
    if (!status && !f->err->status && obj->parts.count == 0 && obj->v.count)
        status = add_cloud(obj);
    return status ? status : f->err->status;
}

// ---- the whole file ----------------------------------------------------------------------------

// Binary files, and those of other programs that end in ".obj" (object files of compilers).
static enum hg_status check_text(struct hg_obj *obj)
{
    struct hg_mesh_file *f = &obj->file;
    const uint8_t *zero = memchr(f->data, 0, f->size < 4096 ? f->size : 4096);
    f->is_text = true;
    if (!zero)
        return HG_OK;
    f->is_text = false;
    return hg_mesh_file_fail(f, HG_E_FORMAT, (uint64_t)(zero - f->data),
        "not a Wavefront OBJ file: texts have no zero bytes");
}

static void finish(struct hg_obj *obj)
{
    struct hg_mesh_file *f = &obj->file;
    for (uint64_t i = 0; i < obj->parts.count; i++) {
        struct hg_obj_part *part = (struct hg_obj_part *)obj->parts.items + i;
        hg_mesh_array_finish(f, &part->corners);
        hg_mesh_array_finish(f, &part->smoothing);
    }
    for (uint64_t i = 0; i < obj->materials.count; i++) {
        struct hg_obj_material *m = (struct hg_obj_material *)obj->materials.items + i;
        hg_free(m->raw.metal_map);
        hg_free(m->raw.rough_map);
        hg_free(m->raw.alpha_map);
        hg_free(m->raw.color_map);
    }
    struct hg_mesh_array *const arrays[] = {&obj->lines.joined, &obj->v, &obj->colors, &obj->vt,
        &obj->vn, &obj->groups, &obj->materials, &obj->parts, &obj->loop, &obj->loop_xyz};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        hg_mesh_array_finish(f, arrays[i]);
    hg_key_table_finish(f, &obj->group_names);
    hg_key_table_finish(f, &obj->material_names);
    hg_key_table_finish(f, &obj->part_keys);
    hg_polygons_finish(f, &obj->polygons);
}

enum hg_status hg_obj_load(const struct hg_load_params *params, const struct hg_refbuf *main,
    const char *label, struct hg_asset **out, struct hg_error *err)
{
    struct hg_obj obj = {.lines.joined.item_bytes = 1,
        .v.item_bytes = 3 * sizeof(double),
        .colors.item_bytes = 3 * sizeof(float),
        .vt.item_bytes = 2 * sizeof(float),
        .vn.item_bytes = 3 * sizeof(float),
        .group_names.keys.item_bytes = 2 * sizeof(uint32_t),
        .material_names.keys.item_bytes = 2 * sizeof(uint32_t),
        .part_keys.keys.item_bytes = 3 * sizeof(uint32_t),
        .groups.item_bytes = sizeof(struct hg_text),
        .materials.item_bytes = sizeof(struct hg_obj_material),
        .parts.item_bytes = sizeof(struct hg_obj_part),
        .loop.item_bytes = 3 * sizeof(uint32_t),
        .loop_xyz.item_bytes = 3 * sizeof(double),
        .material = HG_OBJ_NONE,
        .smoothing = HG_OBJ_NONE};
    hg_polygons_begin(&obj.polygons);
    enum hg_status status = hg_mesh_file_begin(&obj.file, params, main, label, err);
    if (!status)
        status = check_text(&obj);
    if (!status)
        status = read_statements(&obj);
    if (!status)
        status = hg_obj_finish_materials(&obj);
    if (!status)
        status = hg_obj_make_asset(&obj);
    finish(&obj);
    return hg_mesh_file_end(&obj.file, status, out);
}
