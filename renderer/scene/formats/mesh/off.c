// OFF files (texts). Source: Geomview manual, "OFF Files"; the header's counts may be on its first
// line, as those of the Princeton shape benchmark are.
#include <string.h>

#include "renderer/scene/formats/mesh/ply.h"

enum { MOST_NUMBERS = 16, LEAST_BYTES = 6 }; // of a vertex: "0 0 0\n"

struct off {
    struct hg_ply mesh;
    struct hg_text text;
    uint64_t face_count;
    bool has_colors, has_normals, has_uv, has_w;
    bool has_face_colors;
};

static uint64_t offset_of(const struct off *off, const char *at)
{
    return (uint64_t)(at - (const char *)off->mesh.file.data);
}

static enum hg_status fail(struct off *off, const char *at, const char *reason)
{
    return hg_mesh_file_fail(&off->mesh.file, HG_E_FORMAT, offset_of(off, at), "%s", reason);
}

// The next line that is neither empty nor a comment, trimmed.
static bool next_line(struct off *off, struct hg_text *line)
{
    while (hg_text_line(&off->text, line)) {
        const char *comment = memchr(line->at, '#', (size_t)(line->end - line->at));
        line->end = comment ? comment : line->end;
        *line = hg_text_trim(*line);
        if (line->at < line->end)
            return true;
    }
    return false;
}

static uint32_t read_numbers(struct hg_text *line, double *v, uint32_t most)
{
    uint32_t n = 0;
    while (n < most && hg_text_number_word(line, &v[n]))
        n++;
    return n;
}

// "[ST][C][N][4]OFF"; what is left of the word and the line are the counts, or nothing is.
static enum hg_status read_kind(struct off *off, struct hg_text *line)
{
    const char *start = line->at;
    static const char *const marks[] = {"ST", "C", "N", "4"};
    bool *const flags[] = {&off->has_uv, &off->has_colors, &off->has_normals, &off->has_w};
    for (int i = 0; i < 4; i++) {
        const size_t n = strlen(marks[i]);
        *flags[i] = (size_t)(line->end - line->at) > n && memcmp(line->at, marks[i], n) == 0;
        line->at += *flags[i] ? n : 0;
    }
    if (line->end - line->at < 3 || memcmp(line->at, "OFF", 3) != 0)
        return fail(off, start, "not an OFF file: it does not begin with \"OFF\"");
    line->at += 3;
    *line = hg_text_trim(*line);
    return HG_OK;
}

static enum hg_status read_counts(struct off *off)
{
    struct hg_text line;
    double v[3];
    if (!next_line(off, &line))
        return fail(off, off->text.at, "not an OFF file: it is empty");
    const enum hg_status status = read_kind(off, &line);
    if (status)
        return status;
    if (hg_text_is(line, "binary"))
        return hg_mesh_file_fail(&off->mesh.file, HG_E_UNSUPPORTED, offset_of(off, line.at),
            "binary OFF files are not read");
    if (line.at == line.end && !next_line(off, &line))
        return fail(off, off->text.at, "the file ends before its counts");
    const char *at = line.at;
    if (read_numbers(&line, v, 3) < 2 || !(v[0] >= 0 && v[0] < 9e15 && v[1] >= 0 && v[1] < 9e15))
        return fail(off, at, "the counts of vertices and faces were expected");
    const uint64_t left = (uint64_t)(off->text.end - off->text.at) + 1;
    off->mesh.vertex_count = (uint64_t)v[0];
    off->face_count = (uint64_t)v[1];
    if (off->mesh.vertex_count > left / LEAST_BYTES || off->mesh.vertex_count > INT32_MAX)
        return hg_mesh_file_fail(&off->mesh.file, HG_E_FORMAT, offset_of(off, at),
            "%llu vertices do not fit in the %llu bytes that are left",
            (unsigned long long)off->mesh.vertex_count, (unsigned long long)left);
    return HG_OK;
}

// Place, then normal, then colour, then texture coordinates.
static enum hg_status read_vertex(struct off *off, uint64_t i)
{
    struct hg_text line;
    double v[MOST_NUMBERS], out[HG_PLY_VERTEX_ROLES] = {0};
    if (!next_line(off, &line))
        return fail(off, off->text.at, "the file ends inside its vertices");
    const char *at = line.at;
    const uint32_t count = read_numbers(&line, v, MOST_NUMBERS);
    const uint32_t place = off->has_w ? 4 : 3, normal = off->has_normals ? 3 : 0;
    const uint32_t uv = off->has_uv ? 2 : 0, least = place + normal + uv;
    if (count < least + (off->has_colors ? 3 : 0) || (line.at < line.end))
        return fail(off, at, "the numbers of a vertex were expected");
    memcpy(out + HG_PLY_X, v, 3 * sizeof *v);
    for (int c = 0; c < 3 && off->has_w && v[3] != 0; c++)
        out[HG_PLY_X + c] /= v[3];
    memcpy(out + HG_PLY_NX, v + place, normal * sizeof *v);
    for (int c = 0; c < 3 && off->has_colors; c++)
        out[HG_PLY_RED + c] = v[place + normal + (uint32_t)c];
    out[HG_PLY_ALPHA] = 1;
    memcpy(out + HG_PLY_U, v + count - uv, uv * sizeof *v);
    hg_ply_store_vertex(&off->mesh, i, out, 1);
    return hg_mesh_file_progress(&off->mesh.file, offset_of(off, at));
}

static enum hg_status read_face(struct off *off)
{
    struct hg_mesh_file *f = &off->mesh.file;
    struct hg_text line;
    double count;
    if (!next_line(off, &line))
        return fail(off, off->text.at, "the file ends inside its faces");
    const char *at = line.at;
    if (!hg_text_number_word(&line, &count) || !(count >= 1 && count <= (double)(line.end - at)))
        return fail(off, at, "the number of a face's corners was expected");
    off->mesh.loop.count = 0;
    uint32_t *loop = hg_mesh_array_add(f, &off->mesh.loop, (uint64_t)count);
    if (!loop)
        return f->err->status;
    for (uint64_t i = 0; i < off->mesh.loop.count; i++) {
        double index;
        if (!hg_text_number_word(&line, &index) || !(index >= 0) ||
            index >= (double)off->mesh.vertex_count || index != (double)(uint64_t)index)
            return fail(off, at, "a corner of a face is no vertex of the file");
        loop[i] = (uint32_t)index;
    }
    off->has_face_colors = off->has_face_colors || hg_text_trim(line).at < line.end;
    const enum hg_status status = count > 2 ? hg_ply_add_polygon(&off->mesh, false) : HG_OK;
    return status ? status : hg_mesh_file_progress(f, offset_of(off, at));
}

static enum hg_status read_all(struct off *off)
{
    struct hg_mesh_file *f = &off->mesh.file;
    off->text = (struct hg_text){(const char *)f->data, (const char *)f->data + f->size};
    f->is_text = true;
    enum hg_status status = read_counts(off);
    off->mesh.color_type = HG_PLY_FLOAT32; // of 1, or of 255
    off->mesh.roles = 7u << HG_PLY_X | (off->has_normals ? 7u << HG_PLY_NX : 0) |
                      (off->has_colors ? 7u << HG_PLY_RED : 0) | (off->has_uv ? 3u << HG_PLY_U : 0);
    if (!status)
        status = hg_ply_take_vertices(&off->mesh);
    for (uint64_t i = 0; !status && i < off->mesh.vertex_count; i++)
        status = read_vertex(off, i);
    for (uint64_t i = 0; !status && i < off->face_count; i++)
        status = read_face(off);
    if (!status && off->has_face_colors)
        hg_asset_warn(f->asset, NULL, "colours of faces are not read");
    return status;
}

enum hg_status hg_off_load(const struct hg_load_params *params, const struct hg_refbuf *main,
    const char *label, struct hg_asset **out, struct hg_error *err)
{
    struct off off = {0};
    enum hg_status status = hg_ply_begin(&off.mesh, params, main, label, err);
    if (!status)
        status = read_all(&off);
    return hg_ply_end(&off.mesh, status, out);
}
