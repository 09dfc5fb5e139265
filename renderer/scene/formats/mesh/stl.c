// STL files, text and binary. Sources: 3D Systems 1989, "StereoLithography Interface
// Specification"; the two conventions for the 16 attribute bits of a binary triangle as VisCAM and
// Materialise Magics write them.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/formats/mesh/mesh_file.h"
#include "renderer/scene/formats/mesh/polygons.h"

enum {
    HEADER_BYTES = 84, // 80 of text, the count
    TRIANGLE_BYTES = 50,
    NAME_BYTES = 128,
    KEY_WORDS = 4, // of a vertex: its place and its colour
    COLOR_SET = 1 << 15
};

struct solid {
    char name[NAME_BYTES];
    uint64_t first, count; // of the file's triangles
};

struct stl {
    struct hg_mesh_file file;
    struct hg_mesh_array xyz;    // double[9] a triangle
    struct hg_mesh_array solids; // struct solid
    struct hg_mesh_array loop;   // double[3]: the loop that is being read
    struct hg_polygons polygons;
    uint16_t *colors; // [triangles] of a binary file: 15 bits and COLOR_SET; NULL: none
    uint32_t empty_solids;
    float base[3]; // linear; negative: none
};

// ---- binary ------------------------------------------------------------------------------------

static uint32_t read_u32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static double read_float(const uint8_t *p)
{
    const uint32_t bits = read_u32(p);
    float v;
    memcpy(&v, &bits, sizeof v);
    return (double)v;
}

static struct solid *add_solid(struct stl *stl, struct hg_text name)
{
    struct solid *solid = hg_mesh_array_add(&stl->file, &stl->solids, 1);
    if (!solid)
        return NULL;
    *solid = (struct solid){.first = stl->xyz.count};
    snprintf(solid->name, sizeof solid->name, "%.*s",
        (int)(name.end - name.at < NAME_BYTES ? name.end - name.at : NAME_BYTES - 1), name.at);
    return solid;
}

// Magics puts "COLOR=" and four bytes into the header; its triangles have a colour of their own
// where bit 15 is clear, red lowest. VisCAM: where it is set, blue lowest.
static enum hg_status read_colors(struct stl *stl, const uint8_t *triangles, uint64_t count)
{
    struct hg_mesh_file *f = &stl->file;
    const uint8_t *magics = memmem(f->data, 80 - 4, "COLOR=", 6);
    bool any = false;
    for (uint64_t i = 0; !any && i < count; i++) {
        const uint8_t *p = triangles + i * TRIANGLE_BYTES + 48;
        any = magics ? !(p[1] & 0x80) : p[1] & 0x80;
    }
    for (int c = 0; magics && c < 3; c++)
        stl->base[c] = hg_srgb_decode(magics[6 + c] / 255.0);
    if (!any)
        return HG_OK;
    stl->colors = hg_mesh_file_alloc(f, count, sizeof *stl->colors);
    if (!stl->colors)
        return f->err->status;
    for (uint64_t i = 0; i < count; i++) {
        const uint8_t *p = triangles + i * TRIANGLE_BYTES + 48;
        const uint16_t bits = (uint16_t)(p[0] | p[1] << 8);
        if (magics && !(bits & COLOR_SET)) // as VisCAM has it
            stl->colors[i] =
                (uint16_t)(COLOR_SET | (bits & 31) << 10 | (bits & 31 << 5) | (bits >> 10 & 31));
        else if (!magics && bits & COLOR_SET)
            stl->colors[i] = bits;
    }
    return HG_OK;
}

static enum hg_status read_binary(struct stl *stl)
{
    struct hg_mesh_file *f = &stl->file;
    if (f->size < HEADER_BYTES)
        return hg_mesh_file_fail(f, HG_E_FORMAT, f->size,
            "not an STL file: neither a text that begins with \"solid\" nor 84 bytes long");
    const uint64_t count = read_u32(f->data + 80);
    const uint64_t left = f->size - HEADER_BYTES;
    if (count > left / TRIANGLE_BYTES)
        return hg_mesh_file_fail(f, HG_E_FORMAT, 80,
            "%llu triangles of 50 bytes do not fit in the %llu bytes that are left",
            (unsigned long long)count, (unsigned long long)left);
    if (count > INT32_MAX / 3)
        return hg_mesh_file_fail(f, HG_E_LIMIT, 80, "too many triangles");
    if (left > count * TRIANGLE_BYTES)
        hg_asset_warn(f->asset, NULL, "%llu bytes behind the last triangle are ignored",
            (unsigned long long)(left - count * TRIANGLE_BYTES));
    struct solid *solid = add_solid(stl, (struct hg_text){f->label, f->label + strlen(f->label)});
    double *xyz = solid ? hg_mesh_array_add(f, &stl->xyz, count) : NULL;
    if (!xyz)
        return f->err->status;
    solid->count = count;
    enum hg_status status = HG_OK;
    for (uint64_t i = 0; !status && i < count; i++, xyz += 9) {
        const uint8_t *p = f->data + HEADER_BYTES + i * TRIANGLE_BYTES + 12; // behind the normal
        for (int c = 0; c < 9; c++)
            xyz[c] = read_float(p + c * 4);
        status = hg_mesh_file_progress(f, HEADER_BYTES + i * TRIANGLE_BYTES);
    }
    return status ? status : read_colors(stl, f->data + HEADER_BYTES, count);
}

// ---- text --------------------------------------------------------------------------------------

static enum hg_status fail_at(struct stl *stl, const char *at, const char *reason)
{
    return hg_mesh_file_fail(
        &stl->file, HG_E_FORMAT, (uint64_t)(at - (const char *)stl->file.data), "%s", reason);
}

static enum hg_status read_vertex(struct stl *stl, struct hg_text *text)
{
    double *v = hg_mesh_array_add(&stl->file, &stl->loop, 1);
    if (!v)
        return stl->file.err->status;
    for (int c = 0; c < 3; c++) {
        hg_text_skip_space(text);
        if (!hg_text_number_word(text, &v[c]))
            return fail_at(stl, text->at, "a vertex needs three numbers");
    }
    return HG_OK;
}

static enum hg_status add_loop(struct stl *stl, struct solid *solid)
{
    const double *loop = (const double *)stl->loop.items;
    enum hg_status status =
        hg_polygons_cut(&stl->file, &stl->polygons, loop, (uint32_t)stl->loop.count);
    const uint32_t(*triangles)[3] = stl->polygons.triangles.items;
    for (uint64_t i = 0; !status && i < stl->polygons.triangles.count; i++) {
        double *out =
            stl->xyz.count < INT32_MAX / 3 ? hg_mesh_array_add(&stl->file, &stl->xyz, 1) : NULL;
        if (!out)
            return stl->file.err->status
                       ? stl->file.err->status
                       : hg_mesh_file_fail(&stl->file, HG_E_LIMIT, 0, "too many triangles");
        for (int c = 0; c < 3; c++)
            memcpy(out + (size_t)c * 3, loop + (size_t)triangles[i][c] * 3, 3 * sizeof *out);
        solid->count++;
    }
    return status;
}

// From behind "loop" to its "endloop".
static enum hg_status read_loop(struct stl *stl, struct hg_text *text, struct solid *solid)
{
    stl->loop.count = 0;
    for (;;) {
        const struct hg_text word = hg_text_word(text);
        if (word.at == word.end)
            return fail_at(stl, word.at, "the file ends inside a facet");
        if (hg_text_is(word, "endloop"))
            break;
        if (!hg_text_is(word, "vertex"))
            return fail_at(stl, word.at, "\"vertex\" or \"endloop\" was expected");
        const enum hg_status status = read_vertex(stl, text);
        if (status)
            return status;
    }
    return add_loop(stl, solid);
}

// From behind "facet" to its "endfacet". The normal is that of the vertices, whatever is written.
static enum hg_status read_facet(struct stl *stl, struct hg_text *text, struct solid *solid)
{
    for (;;) {
        const struct hg_text word = hg_text_word(text);
        if (word.at == word.end)
            return fail_at(stl, word.at, "the file ends inside a facet");
        if (hg_text_is(word, "endfacet"))
            return HG_OK;
        if (hg_text_is(word, "facet") || hg_text_is(word, "endsolid"))
            return fail_at(stl, word.at, "\"endfacet\" was expected");
        const enum hg_status status =
            hg_text_is(word, "loop") ? read_loop(stl, text, solid) : HG_OK;
        if (status)
            return status;
    }
}

static enum hg_status read_solid(struct stl *stl, struct hg_text *text, bool *ended)
{
    struct hg_text name = {text->at, text->at};
    (void)hg_text_line(text, &name);
    struct solid *solid = add_solid(stl, hg_text_trim(name));
    enum hg_status status = solid ? HG_OK : stl->file.err->status;
    *ended = false;
    while (!status && !*ended) {
        const struct hg_text word = hg_text_word(text);
        if (word.at == word.end)
            break;
        *ended = hg_text_is(word, "endsolid") || hg_text_is(word, "end");
        if (hg_text_is(word, "facet"))
            status = read_facet(stl, text, solid);
        else if (!*ended)
            return fail_at(stl, word.at, "\"facet\" or \"endsolid\" was expected");
        if (!status)
            status = hg_mesh_file_progress(
                &stl->file, (uint64_t)(text->at - (const char *)stl->file.data));
    }
    if (*ended)
        (void)hg_text_line(text, &name); // the name again
    if (!status && solid->count == 0) {
        stl->empty_solids++;
        stl->solids.count--;
    }
    return status;
}

static enum hg_status read_text(struct stl *stl)
{
    struct hg_mesh_file *f = &stl->file;
    struct hg_text text = {(const char *)f->data, (const char *)f->data + f->size};
    enum hg_status status = HG_OK;
    bool ended = true;
    f->is_text = true;
    while (!status) {
        const struct hg_text word = hg_text_word(&text);
        if (word.at == word.end)
            break;
        if (hg_text_is(word, "solid")) {
            status = read_solid(stl, &text, &ended);
            continue;
        }
        return fail_at(stl, word.at, "\"solid\" was expected");
    }
    if (!status && !ended)
        hg_asset_warn(f->asset, NULL, "the file ends without \"endsolid\"");
    if (!status && stl->empty_solids)
        hg_asset_warn(f->asset, NULL, "%u %s no facets", stl->empty_solids,
            stl->empty_solids == 1 ? "solid has" : "solids have");
    return status;
}

// Binary files may begin with "solid" too: their size gives them away, or a zero among the first
// bytes.
static bool is_text(const struct hg_mesh_file *f)
{
    struct hg_text text = {(const char *)f->data, (const char *)f->data + f->size};
    if (!hg_text_is(hg_text_word(&text), "solid"))
        return false;
    if (f->size >= HEADER_BYTES &&
        f->size == HEADER_BYTES + (uint64_t)read_u32(f->data + 80) * TRIANGLE_BYTES)
        return false;
    return memchr(f->data, 0, f->size < 512 ? f->size : 512) == NULL;
}

// ---- the asset ---------------------------------------------------------------------------------

static void set_colors(const struct stl *stl, const struct hg_key_table *table, float *colors)
{
    const uint32_t *keys = (const uint32_t *)table->keys.items;
    for (uint64_t v = 0; v < table->keys.count; v++) {
        const uint32_t bits = keys[v * KEY_WORDS + 3];
        for (int c = 0; c < 3; c++) {
            const float plain = stl->base[c] >= 0 ? stl->base[c] : 0.6f;
            colors[v * 4 + c] =
                bits & COLOR_SET ? hg_srgb_decode((bits >> (10 - 5 * c) & 31) / 31.0) : plain;
        }
        colors[v * 4 + 3] = 1;
    }
}

// The vertices of a part are the places that its triangles name, once for each colour.
static enum hg_status number_vertices(struct stl *stl, const struct solid *solid,
    struct hg_key_table *table, struct hg_mesh_part *part)
{
    enum hg_status status = HG_OK;
    for (uint64_t t = solid->first; !status && t < solid->first + solid->count; t++) {
        const double *xyz = (const double *)stl->xyz.items + t * 9;
        uint32_t key[3][KEY_WORDS];
        bool finite = true;
        for (int c = 0; c < 3; c++) {
            float p[3];
            finite = hg_mesh_file_place_vertex(&stl->file, xyz + (size_t)c * 3, p) && finite;
            for (int i = 0; i < 3; i++)
                p[i] += 0.0f; // -0 is 0
            memcpy(key[c], p, sizeof p);
            key[c][3] = stl->colors ? stl->colors[t] : 0;
        }
        for (int c = 0; finite && !status && c < 3; c++)
            status = hg_key_table_number(
                &stl->file, table, key[c], &part->indices[part->index_count + (uint32_t)c]);
        part->index_count += finite && !status ? 3 : 0;
    }
    return status;
}

static enum hg_status fill_part(
    struct stl *stl, const struct solid *solid, struct hg_mesh_part *part)
{
    struct hg_mesh_file *f = &stl->file;
    struct hg_key_table table = {.keys.item_bytes = KEY_WORDS * sizeof(uint32_t)};
    part->indices = hg_mesh_file_alloc(f, solid->count * 3, sizeof *part->indices);
    enum hg_status status =
        part->indices ? number_vertices(stl, solid, &table, part) : f->err->status;
    const uint32_t count = (uint32_t)table.keys.count;
    const uint32_t *keys = (const uint32_t *)table.keys.items;
    if (!status && !(part->positions = hg_mesh_file_alloc(f, count, 3 * sizeof(float))))
        status = f->err->status;
    if (!status && stl->colors && !(part->colors = hg_mesh_file_alloc(f, count, 4 * sizeof(float))))
        status = f->err->status;
    for (size_t v = 0; !status && v < count; v++)
        memcpy(part->positions + v * 3, keys + v * KEY_WORDS, 3 * sizeof(float));
    part->vertex_count = status ? 0 : count;
    if (!status && part->colors)
        set_colors(stl, &table, part->colors);
    hg_key_table_finish(f, &table);
    return status;
}

static enum hg_status make_asset(struct stl *stl)
{
    struct hg_mesh_file *f = &stl->file;
    hg_mesh_file_center(f, (const double *)stl->xyz.items, stl->xyz.count * 3);
    struct hg_material *material = hg_mesh_file_material(f, "");
    enum hg_status status = material ? HG_OK : f->err->status;
    for (int c = 0; material && c < 3; c++)
        material->base_color[c] = stl->colors         ? 1
                                  : stl->base[c] >= 0 ? stl->base[c]
                                                      : material->base_color[c];
    uint64_t dropped = 0;
    for (uint64_t i = 0; !status && i < stl->solids.count; i++) {
        const struct solid *solid = (const struct solid *)stl->solids.items + i;
        struct hg_mesh *mesh = hg_mesh_file_mesh(f, solid->name, 1);
        status = mesh ? fill_part(stl, solid, mesh->parts) : f->err->status;
        if (status)
            return status;
        mesh->parts->material = material;
        dropped += solid->count - mesh->parts->index_count / 3;
        status = hg_mesh_file_finish_part(f, mesh->parts, NULL);
    }
    if (dropped)
        hg_asset_warn(f->asset, NULL, "%llu triangles without a finite place are left out",
            (unsigned long long)dropped);
    return status;
}

enum hg_status hg_stl_load(const struct hg_load_params *params, const struct hg_refbuf *main,
    const char *label, struct hg_asset **out, struct hg_error *err)
{
    struct stl stl = {.xyz.item_bytes = 9 * sizeof(double),
        .solids.item_bytes = sizeof(struct solid),
        .loop.item_bytes = 3 * sizeof(double),
        .base = {-1, -1, -1}};
    hg_polygons_begin(&stl.polygons);
    enum hg_status status = hg_mesh_file_begin(&stl.file, params, main, label, err);
    if (!status)
        status = is_text(&stl.file) ? read_text(&stl) : read_binary(&stl);
    if (!status)
        status = make_asset(&stl);
    hg_mesh_array_finish(&stl.file, &stl.xyz);
    hg_mesh_array_finish(&stl.file, &stl.solids);
    hg_mesh_array_finish(&stl.file, &stl.loop);
    hg_polygons_finish(&stl.file, &stl.polygons);
    hg_free(stl.colors);
    return hg_mesh_file_end(&stl.file, status, out);
}
