#include "renderer/scene/formats/gltf/draco.h"

#include <cstdio>
#include <cstring>
#include <memory>
#include <new>

#include <draco/compression/decode.h>
#include <draco/core/decoder_buffer.h>
#include <draco/mesh/mesh.h>

struct hg_draco_mesh {
    std::unique_ptr<draco::Mesh> mesh;
};

namespace
{

enum hg_status fail(char reason[200], enum hg_status status, const char *text)
{
    std::snprintf(reason, 200, "%s", text);
    return status;
}

enum hg_status decode(const uint8_t *data, size_t size, uint32_t max_points, uint32_t max_faces,
    hg_draco_mesh **out, char reason[200])
{
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char *>(data), size);
    auto type = draco::Decoder::GetEncodedGeometryType(&buffer);
    if (!type.ok())
        return fail(reason, HG_E_FORMAT, type.status().error_msg());
    if (type.value() != draco::TRIANGULAR_MESH)
        return fail(reason, HG_E_FORMAT, "not a triangle mesh");
    draco::Decoder decoder;
    auto mesh = decoder.DecodeMeshFromBuffer(&buffer);
    if (!mesh.ok())
        return fail(reason, HG_E_FORMAT, mesh.status().error_msg());
    auto result = std::make_unique<hg_draco_mesh>();
    result->mesh = std::move(mesh).value();
    if (result->mesh->num_points() > max_points || result->mesh->num_faces() > max_faces)
        return fail(reason, HG_E_LIMIT, "more points or faces than permitted");
    for (draco::FaceIndex f(0); f < result->mesh->num_faces(); ++f)
        for (const auto &point : result->mesh->face(f))
            if (point.value() >= result->mesh->num_points())
                return fail(reason, HG_E_FORMAT, "a face names a missing point");
    *out = result.release();
    return HG_OK;
}

template <typename T>
bool copy_values(
    const draco::PointAttribute &attribute, uint32_t points, uint32_t components, void *out)
{
    T *values = static_cast<T *>(out);
    for (uint32_t i = 0; i < points; i++) {
        auto index = attribute.mapped_index(draco::PointIndex(i));
        if (index.value() >= attribute.size() ||
            !attribute.ConvertValue<T>(
                index, static_cast<int8_t>(components), values + size_t(i) * components))
            return false;
    }
    return true;
}

} // namespace

enum hg_status hg_draco_decode(const uint8_t *data, size_t size, uint32_t max_points,
    uint32_t max_faces, struct hg_draco_mesh **out, char reason[200])
{
    *out = nullptr;
    try {
        return decode(data, size, max_points, max_faces, out, reason);
    } catch (const std::bad_alloc &) {
        return fail(reason, HG_E_NOMEM, "no memory");
    } catch (const std::exception &e) {
        return fail(reason, HG_E_FORMAT, e.what());
    } catch (...) {
        return fail(reason, HG_E_FORMAT, "the decoder failed");
    }
}

void hg_draco_destroy(struct hg_draco_mesh *mesh)
{
    delete mesh;
}

uint32_t hg_draco_point_count(const struct hg_draco_mesh *mesh)
{
    return mesh->mesh->num_points();
}

uint32_t hg_draco_face_count(const struct hg_draco_mesh *mesh)
{
    return mesh->mesh->num_faces();
}

void hg_draco_indices(const struct hg_draco_mesh *mesh, uint32_t *out)
{
    for (draco::FaceIndex f(0); f < mesh->mesh->num_faces(); ++f)
        for (int c = 0; c < 3; c++)
            out[size_t(f.value()) * 3 + c] = mesh->mesh->face(f)[c].value();
}

enum hg_status hg_draco_attribute(const struct hg_draco_mesh *mesh, uint32_t unique_id,
    uint32_t component_type, uint32_t components, void *out)
{
    const draco::PointAttribute *attribute = mesh->mesh->GetAttributeByUniqueId(unique_id);
    if (!attribute)
        return HG_E_NOTFOUND;
    uint32_t points = mesh->mesh->num_points();
    bool ok = false;
    try {
        switch (component_type) {
        case 5120:
            ok = copy_values<int8_t>(*attribute, points, components, out);
            break;
        case 5121:
            ok = copy_values<uint8_t>(*attribute, points, components, out);
            break;
        case 5122:
            ok = copy_values<int16_t>(*attribute, points, components, out);
            break;
        case 5123:
            ok = copy_values<uint16_t>(*attribute, points, components, out);
            break;
        case 5125:
            ok = copy_values<uint32_t>(*attribute, points, components, out);
            break;
        case 5126:
            ok = copy_values<float>(*attribute, points, components, out);
            break;
        default:
            break;
        }
    } catch (...) {
        ok = false;
    }
    return ok ? HG_OK : HG_E_FORMAT;
}
