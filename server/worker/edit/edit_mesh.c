#include "server/worker/edit/edit_mesh.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/mesh_tools.h"
#include "server/worker/edit/edit_object.h"

// Copies an array of n x width floats; `bytes` may be empty (then *out is NULL) unless required.
static enum hg_status copy_floats(struct hgp_bytes bytes, size_t n, size_t width, const char *field,
    float **out, struct hg_error *err)
{
    if (!bytes.size)
        return HG_OK;
    if (bytes.size != n * width * sizeof(float))
        return hg_error_set(err, HG_E_INVAL, "mesh_set", field, "%u bytes where %zu belong",
            bytes.size, n * width * sizeof(float));
    *out = hg_spill_calloc(n * width, sizeof(float));
    if (!*out)
        return hg_error_set(err, HG_E_NOMEM, "mesh_set", field, "no memory");
    memcpy(*out, bytes.data, bytes.size);
    for (size_t i = 0; i < n * width; i++)
        if (!isfinite((*out)[i]))
            return hg_error_set(err, HG_E_INVAL, "mesh_set", field, "value %zu is not finite", i);
    return HG_OK;
}

static enum hg_status copy_arrays(
    const struct hgp_mesh_part *m, struct hg_mesh_part *part, struct hg_error *err)
{
    size_t n = m->positions.size / (3 * sizeof(float));
    if (n == 0)
        return hg_error_set(err, HG_E_INVAL, "mesh_set", "positions", "a part needs vertices");
    part->vertex_count = (uint32_t)n;
    const struct {
        struct hgp_bytes bytes;
        size_t width;
        const char *field;
        float **out;
    } arrays[] = {
        {m->positions, 3, "positions", &part->positions},
        {m->normals, 3, "normals", &part->normals},
        {m->tangents, 4, "tangents", &part->tangents},
        {m->uv0, 2, "uv0", &part->uv[0]},
        {m->uv1, 2, "uv1", &part->uv[1]},
        {m->colors, 4, "colors", &part->colors},
    };
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) {
        enum hg_status status =
            copy_floats(arrays[i].bytes, n, arrays[i].width, arrays[i].field, arrays[i].out, err);
        if (status)
            return status;
    }
    return HG_OK;
}

static enum hg_status expand_indices(const uint32_t *in, uint32_t count,
    enum hg_primitive_mode mode, struct hg_mesh_part *part, struct hg_error *err)
{
    for (uint32_t i = 0; in && i < count; i++)
        if (in[i] >= part->vertex_count)
            return hg_error_set(err, HG_E_INVAL, "mesh_set", "indices", "index %u is not below %u",
                in[i], part->vertex_count);
    uint64_t total = hg_mode_list_count(mode, count);
    if (total > UINT32_MAX)
        return hg_error_set(err, HG_E_LIMIT, "mesh_set", "indices",
            "%llu indices as a list, of at most %u", (unsigned long long)total, UINT32_MAX);
    part->indices = hg_spill_calloc((size_t)total, sizeof *part->indices);
    if (!part->indices)
        return hg_error_set(err, HG_E_NOMEM, "mesh_set", "indices", "no memory");
    part->topology = hg_mode_topology(mode);
    part->index_count = (uint32_t)total;
    hg_mode_expand(mode, in, count, part->indices);
    return HG_OK;
}

static enum hg_status copy_indices(
    const struct hgp_mesh_part *m, struct hg_mesh_part *part, struct hg_error *err)
{
    enum hg_primitive_mode mode = (enum hg_primitive_mode)m->mode;
    uint32_t count = m->indices.size / (uint32_t)sizeof(uint32_t);
    if (m->indices.size % sizeof(uint32_t))
        return hg_error_set(err, HG_E_INVAL, "mesh_set", "indices", "not a whole number of u32");
    if (!count)
        return expand_indices(NULL, part->vertex_count, mode, part, err);
    uint32_t *indices =
        hg_spill_calloc(count, sizeof *indices); // the message's bytes are not aligned
    if (!indices)
        return hg_error_set(err, HG_E_NOMEM, "mesh_set", "indices", "no memory");
    memcpy(indices, m->indices.data, m->indices.size);
    enum hg_status status = expand_indices(indices, count, mode, part, err);
    hg_free(indices);
    return status;
}

static enum hg_status find_material(
    const struct request *r, uint64_t id, struct hg_mesh_part *part, struct hg_error *err)
{
    struct hg_object *material =
        id ? hg_scene_find(r->session->scene->scene, HG_OBJECT_MATERIAL, id) : NULL;
    if (id && !material)
        return hg_error_set(
            err, HG_E_NOTFOUND, "mesh_set", "material", "no material %llu", (unsigned long long)id);
    part->material = (struct hg_material *)material;
    return HG_OK;
}

// Client-made materials may get a normal map at any time, so tangents are made in advance.
static enum hg_status make_normals(struct hg_mesh_part *part)
{
    if (part->topology != HG_TOPOLOGY_TRIANGLES)
        return HG_OK;
    enum hg_status status = part->normals ? HG_OK : hg_part_make_flat_normals(part, 0);
    if (status)
        return status;
    return part->tangents || !part->uv[0] ? HG_OK : hg_part_make_tangents(part, 0, 0);
}

static enum hg_status make_part(const struct request *r, const struct hgp_mesh_part *m,
    struct hg_mesh_part *part, struct hg_error *err)
{
    enum hg_status status = copy_arrays(m, part, err);
    if (status)
        return status;
    status = copy_indices(m, part, err);
    if (status)
        return status;
    status = find_material(r, m->material, part, err);
    if (status)
        return status;
    status = make_normals(part);
    if (status)
        return hg_error_set(err, status, "mesh_set", NULL, "%s", hg_status_text(status));
    hg_mesh_part_update_bounds(part, 0);
    return HG_OK;
}

static void free_parts(struct hg_mesh_part *parts, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        hg_mesh_part_finish(&parts[i], 0);
    hg_free(parts);
}

static enum hg_status make_parts(
    const struct request *r, struct hg_mesh_part **out, struct hg_error *err)
{
    const struct hgp_mesh_set *m = &r->message->mesh_set;
    const uint32_t count = m->parts.count;
    struct hg_mesh_part *parts = *out = hg_calloc(count, sizeof *parts);
    if (!parts)
        return hg_error_set(err, HG_E_NOMEM, "mesh_set", NULL, "no memory");
    char name[32];
    snprintf(name, sizeof name, "mesh %llu", (unsigned long long)m->mesh);
    enum hg_status status = HG_OK;
    hg_spill_begin(name);
    for (uint32_t i = 0; i < count && !status; i++)
        status = make_part(r, &m->parts.items[i], &parts[i], err);
    hg_spill_end();
    if (!status)
        return HG_OK;
    free_parts(parts, count);
    *out = NULL;
    return status;
}

static void replace_parts(struct hg_mesh *mesh, struct hg_mesh_part *parts, uint32_t count)
{
    for (uint32_t i = 0; i < mesh->part_count; i++)
        hg_mesh_part_finish(&mesh->parts[i], mesh->target_count);
    hg_free(mesh->parts);
    hg_free(mesh->weights);
    mesh->weights = NULL;
    mesh->target_count = 0;
    mesh->parts = parts;
    mesh->part_count = count;
}

void hg_handle_mesh_set(const struct request *r)
{
    const struct hgp_mesh_set *m = &r->message->mesh_set;
    struct hg_error err = {0};
    struct hg_mesh_part *parts;
    if (make_parts(r, &parts, &err)) {
        hg_reply_error(r->to, &err);
        return;
    }
    struct hg_object *object = hg_edit_find_or_make(r, HG_OBJECT_MESH, m->mesh, "mesh_set");
    if (!object) {
        free_parts(parts, m->parts.count);
        return;
    }
    replace_parts((struct hg_mesh *)object, parts, m->parts.count);
    hg_scene_touch(r->session->scene->scene, object);
    hg_request_edited(r);
}
