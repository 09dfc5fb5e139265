// gltf_draco.c - compressed meshes are decoded in a process of its own, one for all of a file, or
// here where there is none.
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "renderer/scene/formats/gltf/draco.h"
#include "renderer/scene/formats/gltf/gltf.h"

enum { POINTS_AND_FACES_BYTES = 8 };

struct hg_gltf_draco {
    struct hg_draco_mesh *mesh;      // decoded here
    struct hg_isolated *process;     // or there, borrowed
    struct hg_isolate_result result; // points, faces, indices
    uint32_t point_count, face_count;
};

// ---- in a process of its own -------------------------------------------------------------------

static bool ask_progress(void *user)
{
    const struct hg_load_params *params = user;
    return !params->progress || params->progress(params->progress_user, "meshes", 0, 1);
}

static enum hg_status call(struct hg_gltf *g, struct hg_isolate_call *what,
    const struct hg_writer *args, struct hg_isolate_result *out, struct hg_error *err)
{
    const struct hg_isolate_ops *ops = hg_isolate_get();
    if (args->failed)
        return hg_error_set(err, HG_E_NOMEM, g->file, NULL, "no memory");
    if (!g->draco) {
        const enum hg_status status = ops->open(ops->user, g->file, &g->draco, err);
        if (status)
            return status;
    }
    what->args = args->data;
    what->args_size = args->size;
    what->go_on = ask_progress;
    what->user = (void *)g->params;
    return ops->call(g->draco, what, out, err);
}

// What anybody may have written: counts within the limit, as many indices, each of a point.
static bool is_sound(struct hg_gltf_draco *d, uint32_t most)
{
    struct hg_reader r = hg_reader_make(d->result.data, d->result.size);
    d->point_count = hg_read_u32(&r);
    d->face_count = hg_read_u32(&r);
    if (r.failed || d->point_count > most || d->face_count > most ||
        (uint64_t)d->face_count * 12 != r.size - r.pos)
        return false;
    for (uint64_t i = 0; i < (uint64_t)d->face_count * 3; i++)
        if (hg_read_u32(&r) >= d->point_count)
            return false;
    return true;
}

static enum hg_status decode_isolated(struct hg_gltf *g, const struct hg_gltf_view *view,
    uint32_t most, struct hg_gltf_draco *d, struct hg_error *err)
{
    struct hg_isolate_call what = {
        .op = HG_ISOLATE_DRACO, .data = view->data, .data_size = (size_t)view->size};
    struct hg_writer args = {0};
    hg_write_u32(&args, most);
    enum hg_status status = call(g, &what, &args, &d->result, err);
    hg_writer_finish(&args);
    d->process = g->draco;
    if (!status && !is_sound(d, most))
        status = hg_error_set(err, HG_E_FORMAT, g->file, NULL, "what was decoded is unsound");
    return status;
}

static enum hg_status values_isolated(struct hg_gltf *g, const struct hg_gltf_draco *d,
    const struct hg_gltf_draco_attribute *attribute, void *out, struct hg_error *err)
{
    struct hg_isolate_call what = {.op = HG_ISOLATE_DRACO_VALUES};
    struct hg_isolate_result result;
    struct hg_writer args = {0};
    const uint64_t bytes = (uint64_t)d->point_count * attribute->components *
                           hg_gltf_component_bytes(attribute->component_type);
    hg_write_u32(&args, attribute->id);
    hg_write_u32(&args, attribute->component_type);
    hg_write_u32(&args, attribute->components);
    enum hg_status status = call(g, &what, &args, &result, err);
    hg_writer_finish(&args);
    if (status)
        return status;
    if (result.size == bytes)
        memcpy(out, result.data, result.size);
    else
        status = hg_error_set(err, HG_E_FORMAT, g->file, NULL, "what was decoded is unsound");
    hg_isolate_get()->release(&result);
    return status;
}

// ---- what the mesh reader sees -----------------------------------------------------------------

enum hg_status hg_gltf_draco_decode(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_gltf_draco **out)
{
    *out = NULL;
    int64_t index = hg_gltf_index(at, "bufferView");
    const struct hg_gltf_view *view;
    enum hg_status status = hg_gltf_view_get(g, index < 0 ? UINT32_MAX : (uint64_t)index, &view);
    if (status)
        return status;
    struct hg_gltf_draco *d = hg_calloc(1, sizeof *d);
    if (!d)
        return hg_gltf_fail(g, at, HG_E_NOMEM, "no memory");
    // A point takes at least 12 bytes and a face 12 once decoded.
    const uint64_t left = g->memory_limit - g->memory_used;
    const uint32_t most = (uint32_t)(left / 12 < INT32_MAX / 3 ? left / 12 : INT32_MAX / 3);
    struct hg_error err = {0};
    char reason[200] = "";
    if (hg_isolate_get()) {
        status = decode_isolated(g, view, most, d, &err);
    } else if (!(status = hg_draco_decode(
                     view->data, (size_t)view->size, most, most, &d->mesh, reason))) {
        d->point_count = hg_draco_point_count(d->mesh);
        d->face_count = hg_draco_face_count(d->mesh);
    }
    if (!status) {
        *out = d;
        return HG_OK;
    }
    hg_gltf_draco_destroy(d);
    return hg_gltf_fail(g, at, status, "Draco: %.230s", err.reason[0] ? err.reason : reason);
}

void hg_gltf_draco_destroy(struct hg_gltf_draco *d)
{
    if (!d)
        return;
    hg_draco_destroy(d->mesh);
    if (d->process)
        hg_isolate_get()->release(&d->result);
    hg_free(d);
}

uint32_t hg_gltf_draco_point_count(const struct hg_gltf_draco *d)
{
    return d->point_count;
}

uint32_t hg_gltf_draco_face_count(const struct hg_gltf_draco *d)
{
    return d->face_count;
}

void hg_gltf_draco_indices(const struct hg_gltf_draco *d, uint32_t *out)
{
    if (d->mesh)
        hg_draco_indices(d->mesh, out);
    else
        memcpy(out, d->result.data + POINTS_AND_FACES_BYTES, (size_t)d->face_count * 12);
}

enum hg_status hg_gltf_draco_values(struct hg_gltf *g, const struct hg_gltf_draco *d,
    const struct hg_gltf_draco_attribute *attribute, void *out, struct hg_error *err)
{
    return d->mesh ? hg_draco_attribute(d->mesh, attribute->id, attribute->component_type,
                         attribute->components, out)
                   : values_isolated(g, d, attribute, out, err);
}

// ---- that process ------------------------------------------------------------------------------

static enum hg_status serve_decode(
    struct hg_isolate_request *request, struct hg_writer *out, struct hg_error *err)
{
    const uint32_t most = hg_read_u32(&request->args);
    struct hg_draco_mesh *mesh;
    char reason[200] = "";
    hg_draco_destroy(request->state);
    request->state = NULL;
    enum hg_status status =
        hg_draco_decode(request->data, request->data_size, most, most, &mesh, reason);
    if (status)
        return hg_error_set(err, status, request->name, NULL, "%s", reason);
    request->state = mesh;
    const uint32_t faces = hg_draco_face_count(mesh);
    uint32_t *indices = hg_calloc(faces, 12);
    if (!indices)
        return HG_E_NOMEM;
    hg_draco_indices(mesh, indices);
    hg_write_u32(out, hg_draco_point_count(mesh));
    hg_write_u32(out, faces);
    hg_write_bytes(out, indices, (size_t)faces * 12);
    hg_free(indices);
    return HG_OK;
}

static enum hg_status serve_values(
    struct hg_isolate_request *request, struct hg_writer *out, struct hg_error *err)
{
    const uint32_t id = hg_read_u32(&request->args), type = hg_read_u32(&request->args);
    const uint32_t components = hg_read_u32(&request->args);
    const struct hg_draco_mesh *mesh = request->state;
    size_t bytes = 0;
    if (!mesh || components > 16 ||
        !hg_mul_size(
            hg_draco_point_count(mesh), (size_t)components * hg_gltf_component_bytes(type), &bytes))
        return hg_error_set(err, HG_E_INVAL, request->name, NULL, "no such attribute");
    void *values = hg_calloc(bytes, 1);
    if (!values)
        return HG_E_NOMEM;
    const enum hg_status status = hg_draco_attribute(mesh, id, type, components, values);
    if (!status)
        hg_write_bytes(out, values, bytes);
    hg_free(values);
    return status;
}

enum hg_status hg_draco_serve(
    struct hg_isolate_request *request, struct hg_writer *out, struct hg_error *err)
{
    return request->op == HG_ISOLATE_DRACO ? serve_decode(request, out, err)
                                           : serve_values(request, out, err);
}
