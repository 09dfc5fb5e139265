#include "renderer/scene/formats/gltf/gltf.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/xform.h"

enum { MAX_TEMPS = 24, MAX_TARGETS = 4096 };

// One primitive while it is read.
struct primitive {
    struct hg_gltf *g;
    struct hg_gltf_at at, attributes, draco_at;
    struct hg_mesh_part *part;
    struct hg_gltf_draco *draco;
    void *temps[MAX_TEMPS];
    uint32_t temp_count;
    uint32_t target_count;
};

// What the specification allows for an attribute, KHR_mesh_quantization included.
enum {
    F = 1, // float
    U = 2, // unsigned integers, normalized
    Q = 4, // more integers with KHR_mesh_quantization
    I = 8, // unsigned integers as they are
};

static bool component_ok(const struct hg_gltf *g, const struct hg_gltf_accessor *a, int allowed)
{
    bool is_float = a->component_type == 5126;
    bool is_small_unsigned = a->component_type == 5121 || a->component_type == 5123;
    if (is_float)
        return allowed & F;
    if (a->component_type == 5125)
        return false;
    if (allowed & I)
        return is_small_unsigned && !a->normalized;
    if (allowed & U && is_small_unsigned && a->normalized)
        return true;
    return (allowed & Q) && g->has_quantization;
}

// ---- reading attributes ------------------------------------------------------------------------

static enum hg_status use_draco(struct primitive *p, const char *name, struct hg_gltf_accessor *a)
{
    struct hg_gltf_at ids = hg_gltf_key(&p->draco_at, "attributes");
    int64_t id = hg_gltf_index(&ids, name);
    if (!p->draco || id < 0)
        return HG_OK;
    uint32_t points = hg_gltf_draco_point_count(p->draco);
    if (a->count != points)
        hg_gltf_warn(p->g, &p->attributes, "%s: %u elements declared, %u in the compressed data",
            name, a->count, points);
    a->count = points;
    a->stride = a->element_bytes;
    a->sparse_count = 0;
    void *data = p->temp_count < MAX_TEMPS
                     ? hg_gltf_alloc(p->g, &p->draco_at, a->count, a->element_bytes)
                     : NULL;
    if (!data)
        return p->temp_count < MAX_TEMPS
                   ? p->g->err->status
                   : hg_gltf_fail(p->g, &p->draco_at, HG_E_LIMIT, "too many compressed attributes");
    p->temps[p->temp_count++] = data;
    a->data = data;
    const struct hg_gltf_draco_attribute wanted = {(uint32_t)id, a->component_type, a->rows};
    struct hg_error err = {0};
    const enum hg_status status = hg_gltf_draco_values(p->g, p->draco, &wanted, data, &err);
    if (status == HG_E_LIMIT || status == HG_E_CANCELLED)
        return hg_gltf_fail(p->g, &p->draco_at, status, "Draco: %.230s", err.reason);
    if (status)
        return hg_gltf_fail(p->g, &p->draco_at, HG_E_FORMAT,
            "attribute %s with id %lld is not in the compressed data", name, (long long)id);
    return HG_OK;
}

// Opens `name` of `attributes`; *found says whether it is there.
static enum hg_status open_attribute(struct primitive *p, const struct hg_gltf_at *attributes,
    const char *name, struct hg_gltf_accessor *a, bool *found)
{
    int64_t index = hg_gltf_index(attributes, name);
    *found = index >= 0;
    if (!*found)
        return HG_OK;
    enum hg_status status = hg_gltf_accessor_open(p->g, (uint64_t)index, a);
    if (!status && attributes == &p->attributes)
        status = use_draco(p, name, a);
    if (status)
        return status;
    struct hg_gltf_at at = hg_gltf_key(attributes, name);
    if (p->part->positions && a->count != p->part->vertex_count)
        return hg_gltf_fail(p->g, &at, HG_E_FORMAT, "%s: %u elements, but POSITION has %u",
            attributes == &p->attributes ? "MESH_PRIMITIVE_UNEQUAL_ACCESSOR_COUNT"
                                         : "MESH_PRIMITIVE_MORPH_TARGET_INVALID_ATTRIBUTE_COUNT",
            a->count, p->part->vertex_count);
    return HG_OK;
}

static enum hg_status check_format(struct primitive *p, const struct hg_gltf_at *at,
    const struct hg_gltf_accessor *a, uint32_t min_rows, uint32_t max_rows, int allowed)
{
    if (a->columns != 1 || a->rows < min_rows || a->rows > max_rows)
        return hg_gltf_fail(p->g, at, HG_E_FORMAT,
            "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT: %u components, %u expected",
            a->rows * a->columns, max_rows);
    if (!component_ok(p->g, a, allowed))
        hg_gltf_warn(p->g, at,
            "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT: componentType %u%s",
            a->component_type, a->normalized ? ", normalized" : "");
    return HG_OK;
}

static void sanitize(struct hg_gltf *g, const struct hg_gltf_at *at, float *values, size_t count)
{
    size_t bad = 0;
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i])) {
            values[i] = 0;
            bad++;
        }
    if (bad)
        hg_gltf_warn(g, at, "ACCESSOR_INVALID_FLOAT: %zu values are not finite and became 0", bad);
}

struct float_attribute {
    const char *name;
    uint32_t min_rows, rows; // rows = components stored
    int allowed;
    float fill;
};

// Reads an attribute into a new array; *out stays NULL when the primitive does not have it.
static enum hg_status read_floats(struct primitive *p, const struct hg_gltf_at *attributes,
    const struct float_attribute *want, float **out)
{
    struct hg_gltf_accessor a;
    bool found;
    enum hg_status status = open_attribute(p, attributes, want->name, &a, &found);
    if (status || !found)
        return status;
    struct hg_gltf_at at = hg_gltf_key(attributes, want->name);
    status = check_format(p, &at, &a, want->min_rows, want->rows, want->allowed);
    if (status)
        return status;
    *out = hg_gltf_alloc(p->g, &at, a.count, want->rows * sizeof(float));
    if (!*out)
        return p->g->err->status;
    p->part->vertex_count = a.count; // POSITION comes first, the others are equal
    hg_gltf_read_floats(&a, want->rows, want->fill, *out);
    sanitize(p->g, &at, *out, (size_t)a.count * want->rows);
    return HG_OK;
}

static enum hg_status read_positions(struct primitive *p)
{
    static const struct float_attribute want = {"POSITION", 3, 3, F | Q, 0};
    enum hg_status status = read_floats(p, &p->attributes, &want, &p->part->positions);
    if (status)
        return status;
    if (!p->part->positions)
        return hg_gltf_fail(p->g, &p->attributes, HG_E_FORMAT,
            "MESH_PRIMITIVE_NO_POSITION: a primitive needs POSITION");
    return HG_OK;
}

// Normals without a length stay so: hg_part_fill_normals follows. Returns how many these are.
static size_t normalize_normals(
    struct primitive *p, const char *name, float *values, uint32_t width)
{
    size_t zero = 0, off = 0;
    for (uint32_t v = 0; v < p->part->vertex_count; v++) {
        float *n = values + (size_t)v * width;
        float length = sqrtf(hg_dot3(n, n));
        off += !(fabsf(length - 1) < 0.05f);
        if (!hg_normalize3(n)) {
            n[0] = width == 4, n[1] = n[2] = 0;
            zero++;
        }
        if (width == 4)
            n[3] = n[3] < 0 ? -1.0f : 1.0f;
    }
    struct hg_gltf_at at = hg_gltf_key(&p->attributes, name);
    if (off)
        hg_gltf_warn(p->g, &at,
            "ACCESSOR_VECTOR3_NON_UNIT: %zu of %u are not of length 1, %zu have none", off,
            p->part->vertex_count, zero);
    return zero;
}

static enum hg_status read_vectors(struct primitive *p)
{
    static const struct float_attribute normal = {"NORMAL", 3, 3, F | Q, 0};
    static const struct float_attribute tangent = {"TANGENT", 4, 4, F | Q, 1};
    enum hg_status status = read_floats(p, &p->attributes, &normal, &p->part->normals);
    if (!status)
        status = read_floats(p, &p->attributes, &tangent, &p->part->tangents);
    if (status)
        return status;
    if (p->part->normals &&
        normalize_normals(p, "NORMAL", p->part->normals, 3) == p->part->vertex_count) {
        hg_free(p->part->normals); // as good as none
        p->part->normals = NULL;
    }
    if (p->part->tangents && p->part->normals) {
        normalize_normals(p, "TANGENT", p->part->tangents, 4);
    } else if (p->part->tangents) {
        hg_free(p->part->tangents); // to be computed again with the flat normals
        p->part->tangents = NULL;
    }
    return HG_OK;
}

static enum hg_status read_surface(struct primitive *p)
{
    static const struct float_attribute color = {"COLOR_0", 3, 4, F | U, 1};
    const struct hg_gltf_uv_sets sets = hg_gltf_uv_sets_of(p->g, hg_gltf_index(&p->at, "material"));
    enum hg_status status = HG_OK;
    for (int i = 0; i < 2 && !status; i++) {
        char name[24];
        const struct float_attribute want = {name, 2, 2, F | U | Q, 0};
        snprintf(name, sizeof name, "TEXCOORD_%u", sets.set[i]);
        if (sets.set[i] != HG_GLTF_NO_UV_SET)
            status = read_floats(p, &p->attributes, &want, &p->part->uv[i]);
    }
    return status ? status : read_floats(p, &p->attributes, &color, &p->part->colors);
}

// ---- skinning ----------------------------------------------------------------------------------

static enum hg_status read_joint_set(
    struct primitive *p, uint32_t set, uint32_t *joints, float *weights, bool *found)
{
    char joints_name[16], weights_name[16];
    snprintf(joints_name, sizeof joints_name, "JOINTS_%u", set);
    snprintf(weights_name, sizeof weights_name, "WEIGHTS_%u", set);
    struct hg_gltf_accessor a, b;
    bool has_weights;
    enum hg_status status = open_attribute(p, &p->attributes, joints_name, &a, found);
    if (!status)
        status = open_attribute(p, &p->attributes, weights_name, &b, &has_weights);
    if (status || !*found || !has_weights) {
        *found = false;
        return status;
    }
    struct hg_gltf_at a_at = hg_gltf_key(&p->attributes, joints_name);
    struct hg_gltf_at b_at = hg_gltf_key(&p->attributes, weights_name);
    status = check_format(p, &a_at, &a, 4, 4, I);
    if (!status && a.component_type == 5126)
        status = hg_gltf_fail(p->g, &a_at, HG_E_FORMAT,
            "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT: joints are integers");
    if (!status)
        status = check_format(p, &b_at, &b, 4, 4, F | U);
    if (status)
        return status;
    hg_gltf_read_uints(&a, 4, joints);
    hg_gltf_read_floats(&b, 4, 0, weights);
    sanitize(p->g, &b_at, weights, (size_t)b.count * 4);
    return HG_OK;
}

// Scales the weights of each vertex to sum 1; all-zero vertices follow their first joint.
static void normalize_weights(struct primitive *p)
{
    struct hg_mesh_part *part = p->part;
    uint32_t width = 4 * part->joint_sets;
    size_t off = 0;
    for (uint32_t v = 0; v < part->vertex_count; v++) {
        float *w = part->weights + (size_t)v * width, sum = 0;
        for (uint32_t i = 0; i < width; i++) {
            w[i] = w[i] > 0 ? w[i] : 0;
            sum += w[i];
        }
        off += fabsf(sum - 1) > 0.02f;
        for (uint32_t i = 0; i < width && sum > 0; i++)
            w[i] /= sum;
        if (!(sum > 0))
            w[0] = 1;
    }
    if (off)
        hg_gltf_warn(p->g, &p->attributes,
            "ACCESSOR_WEIGHTS_NON_NORMALIZED: weights of %zu vertices do not sum to 1", off);
}

static enum hg_status merge_joint_sets(struct primitive *p, uint32_t *joints[2], float *weights[2])
{
    struct hg_mesh_part *part = p->part;
    uint32_t n = part->vertex_count, sets = part->joint_sets;
    part->joints = hg_gltf_alloc(p->g, &p->attributes, n, 4 * sets * sizeof *part->joints);
    part->weights =
        part->joints ? hg_gltf_alloc(p->g, &p->attributes, n, 4 * sets * sizeof(float)) : NULL;
    if (!part->weights)
        return p->g->err->status;
    for (size_t v = 0; v < n; v++)
        for (uint32_t i = 0; i < 4 * sets; i++) {
            uint32_t joint = joints[i / 4][v * 4 + i % 4];
            part->weights[v * 4 * sets + i] =
                joint > UINT16_MAX ? 0 : weights[i / 4][v * 4 + i % 4];
            part->joints[v * 4 * sets + i] = joint > UINT16_MAX ? 0 : (uint16_t)joint;
        }
    normalize_weights(p);
    return HG_OK;
}

static enum hg_status read_skinning(struct primitive *p)
{
    uint32_t *joints[2] = {0};
    float *weights[2] = {0};
    enum hg_status status = HG_OK;
    bool found = hg_gltf_index(&p->attributes, "JOINTS_0") >= 0;
    for (uint32_t set = 0; !status && found && set < 2; set++) {
        joints[set] =
            hg_gltf_alloc(p->g, &p->attributes, p->part->vertex_count, 4 * sizeof(uint32_t));
        weights[set] = joints[set] ? hg_gltf_alloc(p->g, &p->attributes, p->part->vertex_count,
                                         4 * sizeof(float))
                                   : NULL;
        status = weights[set] ? read_joint_set(p, set, joints[set], weights[set], &found)
                              : p->g->err->status;
        p->part->joint_sets += !status && found;
    }
    if (!status && p->part->joint_sets)
        status = merge_joint_sets(p, joints, weights);
    for (int set = 0; set < 2; set++) {
        hg_free(joints[set]);
        hg_free(weights[set]);
    }
    if (!status && hg_gltf_index(&p->attributes, "JOINTS_2") >= 0)
        hg_gltf_warn(p->g, &p->attributes, "only 8 joints per vertex are used");
    return status;
}

// ---- indices -----------------------------------------------------------------------------------

static enum hg_status open_indices(struct primitive *p, uint32_t **raw, uint32_t *count)
{
    if (p->draco) {
        *count = hg_gltf_draco_face_count(p->draco) * 3;
        *raw = hg_gltf_alloc(p->g, &p->draco_at, *count, sizeof **raw);
        if (!*raw)
            return p->g->err->status;
        hg_gltf_draco_indices(p->draco, *raw);
        return HG_OK;
    }
    int64_t index = hg_gltf_index(&p->at, "indices");
    if (index < 0) {
        *count = p->part->vertex_count;
        return HG_OK;
    }
    struct hg_gltf_at at = hg_gltf_key(&p->at, "indices");
    struct hg_gltf_accessor a;
    enum hg_status status = hg_gltf_accessor_open(p->g, (uint64_t)index, &a);
    if (status)
        return status;
    if (a.rows != 1 || a.columns != 1 ||
        (a.component_type != 5121 && a.component_type != 5123 && a.component_type != 5125))
        return hg_gltf_fail(p->g, &at, HG_E_FORMAT,
            "MESH_PRIMITIVE_INDICES_ACCESSOR_INVALID_FORMAT: unsigned scalars are needed");
    *count = a.count;
    *raw = hg_gltf_alloc(p->g, &at, a.count, sizeof **raw);
    if (!*raw)
        return p->g->err->status;
    hg_gltf_read_uints(&a, 1, *raw);
    return HG_OK;
}

static enum hg_status read_indices(struct primitive *p)
{
    struct hg_gltf_at at = hg_gltf_key(&p->at, "indices");
    uint32_t *raw = NULL, count = 0;
    enum hg_status status = open_indices(p, &raw, &count);
    for (uint32_t i = 0; !status && raw && i < count; i++)
        if (raw[i] >= p->part->vertex_count)
            status = hg_gltf_fail(p->g, &at, HG_E_FORMAT,
                "ACCESSOR_INDEX_OOB: index %u at %u, but there are %u vertices", raw[i], i,
                p->part->vertex_count);
    uint64_t mode = hg_gltf_uint(&p->at, "mode", HG_MODE_TRIANGLES);
    if (!status && mode > HG_MODE_TRIANGLE_FAN)
        status = hg_gltf_fail(
            p->g, &p->at, HG_E_FORMAT, "VALUE_NOT_IN_LIST: mode %llu", (unsigned long long)mode);
    if (p->draco)
        mode = HG_MODE_TRIANGLES; // compressed faces are a list, whatever the primitive says
    if (!status) {
        uint64_t n = hg_mode_list_count((enum hg_primitive_mode)mode, count);
        if (n != count && mode != HG_MODE_LINE_STRIP && mode != HG_MODE_LINE_LOOP &&
            mode < HG_MODE_TRIANGLE_STRIP)
            hg_gltf_warn(p->g, &p->at,
                "MESH_PRIMITIVE_INCOMPATIBLE_MODE: %u indices, the last %u "
                "are left out",
                count, count - (uint32_t)n);
        p->part->topology = hg_mode_topology((enum hg_primitive_mode)mode);
        p->part->indices =
            n <= UINT32_MAX - 3 ? hg_gltf_alloc(p->g, &at, n, sizeof *p->part->indices) : NULL;
        if (!p->part->indices)
            status = n <= UINT32_MAX - 3 ? p->g->err->status
                                         : hg_gltf_fail(p->g, &at, HG_E_LIMIT, "too many indices");
        else
            hg_mode_expand((enum hg_primitive_mode)mode, raw, count, p->part->indices);
        p->part->index_count = status ? 0 : (uint32_t)n;
    }
    hg_free(raw);
    return status;
}

// ---- morph targets, materials ------------------------------------------------------------------

static enum hg_status read_targets(struct primitive *p)
{
    static const struct float_attribute want[] = {
        {"POSITION", 3, 3, F | Q, 0}, {"NORMAL", 3, 3, F | Q, 0}, {"TANGENT", 3, 3, F | Q, 0}};
    struct hg_gltf_at list = hg_gltf_key(&p->at, "targets");
    size_t count = hg_gltf_count(&list);
    if (p->target_count == 0)
        return HG_OK;
    p->part->targets = hg_gltf_alloc(p->g, &list, p->target_count, sizeof *p->part->targets);
    if (!p->part->targets)
        return p->g->err->status;
    for (size_t t = 0; t < count && t < p->target_count; t++) {
        struct hg_gltf_at at = hg_gltf_item(&list, t);
        struct hg_morph_target *target = &p->part->targets[t];
        float **out[] = {&target->positions, &target->normals, &target->tangents};
        for (int i = 0; i < 3; i++) {
            enum hg_status status = read_floats(p, &at, &want[i], out[i]);
            if (status)
                return status;
        }
    }
    return HG_OK;
}

static struct hg_material *find_material(struct hg_gltf *g, int64_t index)
{
    return index >= 0 && index < g->asset->material_count ? g->asset->materials[index] : NULL;
}

static enum hg_status read_variants(struct primitive *p)
{
    struct hg_gltf *g = p->g;
    struct hg_gltf_at extensions;
    struct hg_gltf_at at = hg_gltf_extension(&p->at, "KHR_materials_variants", &extensions);
    struct hg_gltf_at mappings = hg_gltf_key(&at, "mappings");
    const struct hg_gltf_uv_sets own = hg_gltf_uv_sets_of(g, hg_gltf_index(&p->at, "material"));
    if (!mappings.json || g->asset->variants.count == 0)
        return HG_OK;
    p->part->variants = hg_gltf_alloc(g, &at, g->asset->variants.count, sizeof *p->part->variants);
    if (!p->part->variants)
        return g->err->status;
    for (size_t i = 0; i < hg_gltf_count(&mappings); i++) {
        struct hg_gltf_at mapping = hg_gltf_item(&mappings, i);
        struct hg_gltf_at list = hg_gltf_key(&mapping, "variants");
        const int64_t index = hg_gltf_index(&mapping, "material");
        const struct hg_gltf_uv_sets sets = hg_gltf_uv_sets_of(g, index);
        struct hg_material *material = find_material(g, index);
        if (material && memcmp(&sets, &own, sizeof sets) != 0)
            hg_gltf_warn(g, &mapping, "the material uses other UV sets than the primitive's own");
        for (size_t k = 0; k < hg_gltf_count(&list); k++) {
            uint64_t v = (uint64_t)json_integer_value(json_array_get(list.json, k));
            if (v < g->asset->variants.count)
                p->part->variants[v] = material;
        }
    }
    return HG_OK;
}

static enum hg_status read_primitive(struct primitive *p)
{
    struct hg_gltf_at extensions;
    p->attributes = hg_gltf_key(&p->at, "attributes");
    p->draco_at = hg_gltf_extension(&p->at, "KHR_draco_mesh_compression", &extensions);
    enum hg_status status = HG_OK;
    if (p->draco_at.json)
        status = hg_gltf_draco_decode(p->g, &p->draco_at, &p->draco);
    if (!status)
        status = read_positions(p);
    if (!status)
        status = read_vectors(p);
    if (!status)
        status = read_surface(p);
    if (!status)
        status = read_skinning(p);
    if (!status)
        status = read_indices(p);
    if (!status)
        status = read_targets(p);
    if (!status)
        status = read_variants(p);
    p->part->material = find_material(p->g, hg_gltf_index(&p->at, "material"));
    for (uint32_t i = 0; i < p->temp_count; i++)
        hg_free(p->temps[i]);
    hg_gltf_draco_destroy(p->draco);
    return status;
}

// ---- finishing: normals, tangents, bounds ------------------------------------------------------

static bool needs_tangents(const struct hg_material *m, uint32_t *uv_set)
{
    static const enum hg_texture_slot slots[] = {
        HG_SLOT_NORMAL, HG_SLOT_CLEARCOAT_NORMAL, HG_SLOT_ANISOTROPY};
    for (int i = 0; m && i < 3; i++)
        if (m->slots[slots[i]].texture) {
            *uv_set = m->slots[slots[i]].uv_set;
            return true;
        }
    *uv_set = 0;
    return m && m->anisotropy.strength != 0;
}

static bool part_needs_tangents(
    const struct hg_asset *asset, const struct hg_mesh_part *part, uint32_t *uv_set)
{
    bool needs = needs_tangents(part->material, uv_set);
    for (uint32_t v = 0; !needs && part->variants && v < asset->variants.count; v++)
        needs = needs_tangents(part->variants[v], uv_set);
    return needs;
}

struct finish_job {
    struct hg_asset *asset;
    struct finish_item {
        struct hg_mesh_part *part;
        uint32_t target_count;
        enum hg_status status;
    } * items;
};

static enum hg_status finish_part(
    const struct hg_asset *asset, struct hg_mesh_part *part, uint32_t target_count)
{
    uint32_t uv_set;
    enum hg_status status = HG_OK;
    if (part->normals && part->topology != HG_TOPOLOGY_TRIANGLES)
        status = hg_part_fill_normals(part);
    if (!status && part->topology == HG_TOPOLOGY_TRIANGLES) {
        if (!part->normals)
            status = hg_part_make_flat_normals(part, target_count);
        else
            status = hg_part_fill_normals(part);
        if (!status && !part->tangents && part_needs_tangents(asset, part, &uv_set) &&
            part->uv[uv_set])
            status = hg_part_make_tangents(part, target_count, uv_set);
    }
    if (!status)
        hg_mesh_part_update_bounds(part, target_count);
    return status;
}

static void finish_one(void *user, size_t index)
{
    struct finish_job *job = user;
    struct finish_item *item = &job->items[index];
    item->status = finish_part(job->asset, item->part, item->target_count);
}

static enum hg_status finish_parts(struct hg_gltf *g, const struct hg_gltf_at *at)
{
    struct finish_job job = {.asset = g->asset};
    size_t count = 0, n = 0;
    for (uint32_t m = 0; m < g->asset->mesh_count; m++)
        count += g->asset->meshes[m]->part_count;
    job.items = hg_gltf_alloc(g, at, count, sizeof *job.items);
    if (!job.items)
        return g->err->status;
    for (uint32_t m = 0; m < g->asset->mesh_count; m++)
        for (uint32_t i = 0; i < g->asset->meshes[m]->part_count; i++)
            job.items[n++] = (struct finish_item){.part = &g->asset->meshes[m]->parts[i],
                .target_count = g->asset->meshes[m]->target_count};
    if (g->params->jobs)
        hg_jobs_for(g->params->jobs, count, finish_one, &job);
    else
        for (size_t i = 0; i < count; i++)
            finish_one(&job, i);
    enum hg_status status = HG_OK;
    for (size_t i = 0; !status && i < count; i++)
        status = job.items[i].status;
    hg_free(job.items);
    return status ? hg_gltf_fail(g, at, status, "normals or tangents could not be made") : HG_OK;
}

// ---- meshes ------------------------------------------------------------------------------------

static enum hg_status read_weights(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_mesh *mesh)
{
    mesh->weights = hg_gltf_alloc(g, at, mesh->target_count, sizeof *mesh->weights);
    if (!mesh->weights)
        return g->err->status;
    hg_gltf_numbers(at, "weights", mesh->weights, mesh->target_count);
    return HG_OK;
}

static enum hg_status read_mesh(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_mesh *mesh)
{
    struct hg_gltf_at list = hg_gltf_key(at, "primitives");
    size_t count = hg_gltf_count(&list);
    for (size_t i = 0; i < count; i++) {
        struct hg_gltf_at item = hg_gltf_item(&list, i), targets = hg_gltf_key(&item, "targets");
        size_t n = hg_gltf_count(&targets);
        if (n > MAX_TARGETS)
            return hg_gltf_fail(g, &targets, HG_E_LIMIT, "%zu morph targets are too many", n);
        if (n > mesh->target_count)
            mesh->target_count = (uint32_t)n;
    }
    mesh->parts = hg_gltf_alloc(g, &list, count, sizeof *mesh->parts);
    if (!mesh->parts)
        return g->err->status;
    mesh->part_count = (uint32_t)count;
    for (size_t i = 0; i < count; i++) {
        struct primitive p = {.g = g,
            .at = hg_gltf_item(&list, i),
            .part = &mesh->parts[i],
            .target_count = mesh->target_count};
        enum hg_status status = read_primitive(&p);
        if (status)
            return status;
    }
    return mesh->target_count ? read_weights(g, at, mesh) : HG_OK;
}

enum hg_status hg_gltf_load_meshes(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "meshes");
    for (size_t i = 0; i < hg_gltf_count(&list); i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        struct hg_mesh *mesh = hg_asset_add_mesh(g->asset, hg_gltf_string(&at, "name"));
        if (!mesh)
            return hg_gltf_fail(g, &at, HG_E_NOMEM, "no memory for a mesh");
        enum hg_status status = read_mesh(g, &at, mesh);
        if (status)
            return status;
        if (g->params->progress &&
            !g->params->progress(g->params->progress_user, "meshes", i + 1, hg_gltf_count(&list)))
            return hg_gltf_fail(g, &at, HG_E_CANCELLED, "cancelled");
    }
    return finish_parts(g, &list);
}
