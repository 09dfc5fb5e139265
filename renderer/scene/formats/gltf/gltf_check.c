// Rules that span objects. Loading has succeeded before; here everything else the specification
// calls an error is named in a warning, so that authors can mend their files.
#include "renderer/scene/formats/gltf/gltf_check.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"

static uint64_t item_index(const struct hg_gltf_at *list, size_t i)
{
    return (uint64_t)json_integer_value(json_array_get(list->json, i));
}

// ---- accessors and buffer views ----------------------------------------------------------------

static void check_alignment(struct hg_gltf *g, const struct hg_gltf_at *at,
    const struct hg_gltf_accessor *a, uint64_t view_offset)
{
    uint64_t offset = hg_gltf_uint(at, "byteOffset", 0);
    uint32_t bytes = hg_gltf_component_bytes(a->component_type);
    struct hg_gltf_at place = hg_gltf_key(at, "byteOffset");
    if (offset % bytes)
        hg_gltf_warn(g, &place,
            "ACCESSOR_OFFSET_ALIGNMENT: %llu is not a multiple of the component's %u bytes",
            (unsigned long long)offset, bytes);
    if ((offset + view_offset) % bytes)
        hg_gltf_warn(g, at, "ACCESSOR_TOTAL_OFFSET_ALIGNMENT: byte %llu of the buffer",
            (unsigned long long)(offset + view_offset));
    if (a->columns > 1 && offset % 4)
        hg_gltf_warn(g, &place, "ACCESSOR_MATRIX_ALIGNMENT: %llu is not a multiple of 4",
            (unsigned long long)offset);
}

// min and max of an accessor against its values, where it declares them.
static void check_bounds(
    struct hg_gltf *g, const struct hg_gltf_at *at, const struct hg_gltf_accessor *a)
{
    uint32_t n = a->rows * a->columns;
    struct hg_gltf_at low_at = hg_gltf_key(at, "min"), high_at = hg_gltf_key(at, "max");
    if (hg_gltf_count(&low_at) != n || hg_gltf_count(&high_at) != n) {
        if (low_at.json || high_at.json)
            hg_gltf_warn(g, at, "ARRAY_LENGTH_NOT_IN_LIST: min and max need %u numbers", n);
        return;
    }
    struct hg_gltf_accessor raw = *a;
    raw.normalized = false;
    float *values = hg_calloc((size_t)a->count * n, sizeof *values);
    float low[16], high[16];
    for (uint32_t c = 0; c < n; c++) {
        low[c] = INFINITY;
        high[c] = -INFINITY;
    }
    if (values)
        hg_gltf_read_floats(&raw, n, 0, values);
    for (size_t i = 0; values && i < (size_t)a->count * n; i++) {
        low[i % n] = fminf(low[i % n], values[i]);
        high[i % n] = fmaxf(high[i % n], values[i]);
    }
    for (uint32_t c = 0; values && a->count && c < n; c++) {
        double min = json_number_value(json_array_get(low_at.json, c));
        double max = json_number_value(json_array_get(high_at.json, c));
        double slack = 1e-5 * (1 + fabs(min) + fabs(max));
        if (fabs(min - (double)low[c]) > slack || fabs(max - (double)high[c]) > slack) {
            hg_gltf_warn(g, at,
                "ACCESSOR_MIN_MISMATCH: component %u is %g to %g, declared %g to %g", c,
                (double)low[c], (double)high[c], min, max);
            break;
        }
    }
    hg_free(values);
}

// Whether the accessor fits its view as both are declared.
static bool check_placement(
    struct hg_gltf *g, const struct hg_gltf_at *at, size_t view, const struct hg_gltf_accessor *a)
{
    struct hg_gltf_at list, view_at = hg_gltf_root_item(g, "bufferViews", view, &list);
    check_alignment(g, at, a, hg_gltf_uint(&view_at, "byteOffset", 0));
    uint64_t stride = hg_gltf_uint(&view_at, "byteStride", a->stride);
    uint64_t offset = hg_gltf_uint(at, "byteOffset", 0);
    uint64_t length = hg_gltf_uint(&view_at, "byteLength", 0);
    uint64_t need = a->count ? (a->count - 1) * stride + a->element_bytes : 0;
    if (stride < a->element_bytes)
        hg_gltf_warn(g, at, "ACCESSOR_SMALL_BYTESTRIDE: %llu is less than an element's %u bytes",
            (unsigned long long)stride, a->element_bytes);
    if (!hg_range_ok(offset, need, length))
        hg_gltf_warn(g, at, "ACCESSOR_TOO_LONG: bytes %llu + %llu of a view of %llu",
            (unsigned long long)offset, (unsigned long long)need, (unsigned long long)length);
    return stride >= a->element_bytes && hg_range_ok(offset, need, length);
}

static void check_accessor(struct hg_gltf *g, size_t index)
{
    struct hg_gltf_at list, at = hg_gltf_root_item(g, "accessors", index, &list);
    int64_t view = hg_gltf_index(&at, "bufferView");
    struct hg_gltf_at place = hg_gltf_key(&at, "byteOffset");
    if (view < 0 && place.json)
        hg_gltf_warn(g, &place, "UNSATISFIED_DEPENDENCY: bufferView must be defined");
    if (hg_gltf_bool(&at, "normalized", false)) {
        uint64_t type = hg_gltf_uint(&at, "componentType", 0);
        struct hg_gltf_at normalized = hg_gltf_key(&at, "normalized");
        if (type == 5126 || type == 5125)
            hg_gltf_warn(g, &normalized, "ACCESSOR_NORMALIZED_INVALID: for small integers only");
    }
    struct hg_error kept = *g->err;
    struct hg_gltf_accessor a = {0};
    bool sound = !hg_gltf_accessor_shape(g, &at, &a);
    if (sound && view >= 0)
        sound = check_placement(g, &at, (size_t)view, &a);
    if (sound && hg_gltf_accessor_open(g, index, &a)) { // not used by anything that was loaded
        hg_asset_warn_text(g->asset, g->err->where, g->err->reason);
        sound = false;
    }
    *g->err = kept;
    if (sound && view >= 0 && (uint64_t)a.count * a.rows * a.columns < 1u << 16)
        check_bounds(g, &at, &a);
}

static void check_view(struct hg_gltf *g, size_t index)
{
    struct hg_gltf_at list, at = hg_gltf_root_item(g, "bufferViews", index, &list);
    struct hg_gltf_at stride_at = hg_gltf_key(&at, "byteStride");
    uint64_t stride = hg_gltf_uint(&at, "byteStride", 0);
    if (stride % 4)
        hg_gltf_warn(g, &stride_at, "VALUE_MULTIPLE_OF: %llu is not a multiple of 4",
            (unsigned long long)stride);
    if (stride_at.json && hg_gltf_uint(&at, "target", 0) == 34963)
        hg_gltf_warn(g, &stride_at, "BUFFER_VIEW_INVALID_BYTE_STRIDE: the target is indices");
    if (stride > hg_gltf_uint(&at, "byteLength", 0))
        hg_gltf_warn(g, &stride_at, "BUFFER_VIEW_TOO_BIG_BYTE_STRIDE: it passes byteLength");
    struct hg_error kept = *g->err;
    const struct hg_gltf_view *view;
    if (hg_gltf_view_get(g, index, &view)) {
        hg_asset_warn_text(g->asset, g->err->where, g->err->reason);
        *g->err = kept;
    }
}

// ---- what buffer views are used for ------------------------------------------------------------

enum use { UNUSED, VERTICES, INDICES, OTHER };

struct view_use {
    uint8_t use;
    uint32_t accessor; // first vertex accessor + 1
    bool shared;       // by several vertex accessors
};

static void use_view(struct hg_gltf *g, struct view_use *uses, const struct hg_gltf_at *place,
    int64_t view, enum use use)
{
    static const char *const strided[] = {"", "",
        "MESH_PRIMITIVE_INDICES_ACCESSOR_WITH_BYTESTRIDE: indices must be tightly packed",
        "BUFFER_VIEW_INVALID_BYTE_STRIDE: only views of vertices may have byteStride"};
    if (view < 0 || view >= g->view_count)
        return;
    struct hg_gltf_at up, at = hg_gltf_root_item(g, "bufferViews", (size_t)view, &up);
    struct hg_gltf_at stride = hg_gltf_key(&at, "byteStride");
    if (use != VERTICES && stride.json)
        hg_gltf_warn(g, place, "%s", strided[use]);
    if (uses[view].use != UNUSED && uses[view].use != use)
        hg_gltf_warn(g, place, "BUFFER_VIEW_TARGET_OVERRIDE: the view is used otherwise too");
    uint64_t target = hg_gltf_uint(&at, "target", 0);
    if ((target == 34962 && use != VERTICES) || (target == 34963 && use != INDICES))
        hg_gltf_warn(g, place, "BUFFER_VIEW_TARGET_OVERRIDE: target %llu says otherwise",
            (unsigned long long)target);
    uses[view].use = (uint8_t)use;
}

static void use_accessor(struct hg_gltf *g, struct view_use *uses, const struct hg_gltf_at *place,
    int64_t accessor, enum use use)
{
    struct hg_gltf_at up;
    if (accessor < 0)
        return;
    struct hg_gltf_at at = hg_gltf_root_item(g, "accessors", (size_t)accessor, &up);
    int64_t view = hg_gltf_index(&at, "bufferView");
    use_view(g, uses, place, view, use);
    if (view < 0 || view >= g->view_count || use != VERTICES)
        return;
    struct view_use *u = &uses[view];
    u->shared |= u->accessor && u->accessor != (uint32_t)accessor + 1;
    u->accessor = (uint32_t)accessor + 1;
    struct hg_gltf_at view_at = hg_gltf_root_item(g, "bufferViews", (size_t)view, &up);
    if (u->shared && !hg_gltf_key(&view_at, "byteStride").json &&
        !hg_gltf_key(&view_at, "extensions").json)
        hg_gltf_warn(g, place,
            "MESH_PRIMITIVE_ACCESSOR_WITHOUT_BYTESTRIDE: several accessors share the view");
}

static void use_map(struct hg_gltf *g, struct view_use *uses, const struct hg_gltf_at *map)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)map->json, key, value)
    {
        struct hg_gltf_at place = hg_gltf_key(map, key);
        use_accessor(g, uses, &place, hg_gltf_index(map, key), VERTICES);
    }
}

static void use_meshes(struct hg_gltf *g, struct view_use *uses)
{
    struct hg_gltf_at meshes = hg_gltf_key(&g->root, "meshes");
    for (size_t m = 0; m < hg_gltf_count(&meshes); m++) {
        struct hg_gltf_at mesh = hg_gltf_item(&meshes, m);
        struct hg_gltf_at primitives = hg_gltf_key(&mesh, "primitives");
        for (size_t p = 0; p < hg_gltf_count(&primitives); p++) {
            struct hg_gltf_at at = hg_gltf_item(&primitives, p);
            struct hg_gltf_at attributes = hg_gltf_key(&at, "attributes");
            struct hg_gltf_at indices = hg_gltf_key(&at, "indices");
            struct hg_gltf_at targets = hg_gltf_key(&at, "targets");
            use_map(g, uses, &attributes);
            for (size_t t = 0; t < hg_gltf_count(&targets); t++) {
                struct hg_gltf_at target = hg_gltf_item(&targets, t);
                use_map(g, uses, &target);
            }
            use_accessor(g, uses, &indices, hg_gltf_index(&at, "indices"), INDICES);
        }
    }
}

static void use_sparse(struct hg_gltf *g, struct view_use *uses)
{
    struct hg_gltf_at accessors = hg_gltf_key(&g->root, "accessors");
    for (size_t i = 0; i < hg_gltf_count(&accessors); i++) {
        struct hg_gltf_at at = hg_gltf_item(&accessors, i), sparse = hg_gltf_key(&at, "sparse");
        static const char *const keys[] = {"indices", "values"};
        for (int k = 0; sparse.json && k < 2; k++) {
            struct hg_gltf_at part = hg_gltf_key(&sparse, keys[k]);
            struct hg_gltf_at place = hg_gltf_key(&part, "bufferView");
            use_view(g, uses, &place, hg_gltf_index(&part, "bufferView"), OTHER);
        }
    }
}

static void use_samplers(
    struct hg_gltf *g, struct view_use *uses, const struct hg_gltf_at *samplers)
{
    static const char *const keys[] = {"input", "output"};
    for (size_t s = 0; s < hg_gltf_count(samplers); s++)
        for (int k = 0; k < 2; k++) {
            struct hg_gltf_at at = hg_gltf_item(samplers, s), place = hg_gltf_key(&at, keys[k]);
            struct hg_gltf_at up, view_up;
            int64_t index = hg_gltf_index(&at, keys[k]);
            if (index < 0)
                continue;
            struct hg_gltf_at a = hg_gltf_root_item(g, "accessors", (size_t)index, &up);
            int64_t view = hg_gltf_index(&a, "bufferView");
            if (view < 0)
                continue;
            struct hg_gltf_at v = hg_gltf_root_item(g, "bufferViews", (size_t)view, &view_up);
            if (hg_gltf_key(&v, "byteStride").json)
                hg_gltf_warn(g, &place,
                    "ANIMATION_SAMPLER_ACCESSOR_WITH_BYTESTRIDE: keys must be tightly packed");
            else
                use_view(g, uses, &place, view, OTHER);
        }
}

static void check_uses(struct hg_gltf *g)
{
    struct view_use *uses = hg_calloc(g->view_count, sizeof *uses);
    if (!uses)
        return;
    use_sparse(g, uses);
    use_meshes(g, uses);
    struct hg_gltf_at animations = hg_gltf_key(&g->root, "animations");
    for (size_t i = 0; i < hg_gltf_count(&animations); i++) {
        struct hg_gltf_at at = hg_gltf_item(&animations, i);
        struct hg_gltf_at samplers = hg_gltf_key(&at, "samplers");
        use_samplers(g, uses, &samplers);
    }
    hg_free(uses);
}

// ---- cameras, nodes, images --------------------------------------------------------------------

static void check_camera(struct hg_gltf *g, const struct hg_gltf_at *at)
{
    struct hg_gltf_at ortho = hg_gltf_key(at, "orthographic");
    struct hg_gltf_at persp = hg_gltf_key(at, "perspective");
    if (!ortho.json == !persp.json)
        hg_gltf_warn(g, at, "ONE_OF_MISMATCH: either perspective or orthographic is needed");
    const struct hg_gltf_at *lens = ortho.json ? &ortho : &persp;
    double near = hg_gltf_number(lens, "znear", 0), far = hg_gltf_number(lens, "zfar", INFINITY);
    if (far <= near)
        hg_gltf_warn(g, lens, "CAMERA_ZFAR_LEQUAL_ZNEAR: %g is not beyond %g", far, near);
    static const char *const sides[] = {"xmag", "ymag"};
    for (int i = 0; ortho.json && i < 2; i++) {
        struct hg_gltf_at place = hg_gltf_key(&ortho, sides[i]);
        double v = hg_gltf_number(&ortho, sides[i], 1);
        if (v == 0)
            hg_gltf_warn(g, &place, "CAMERA_XMAG_YMAG_ZERO: it must not be 0");
        else if (v < 0)
            hg_gltf_warn(g, &place, "CAMERA_XMAG_YMAG_NEGATIVE: it should not be negative");
    }
    struct hg_gltf_at fov = hg_gltf_key(&persp, "yfov");
    if (hg_gltf_number(&persp, "yfov", 1) >= M_PI)
        hg_gltf_warn(g, &fov, "CAMERA_YFOV_GEQUAL_PI: it must be less than pi");
}

// A matrix splits into translation, rotation and scale when its axes are at right angles.
static bool is_decomposable(const float m[16])
{
    float length[3], worst = 0;
    for (int c = 0; c < 3; c++)
        length[c] =
            sqrtf(m[c * 4] * m[c * 4] + m[c * 4 + 1] * m[c * 4 + 1] + m[c * 4 + 2] * m[c * 4 + 2]);
    for (int c = 0; c < 3; c++) {
        const float *a = m + c * 4, *b = m + (c + 1) % 3 * 4;
        float scale = length[c] * length[(c + 1) % 3];
        if (!(scale > 0))
            return false;
        worst = fmaxf(worst, fabsf(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / scale);
    }
    return worst < 1e-3f && m[3] == 0 && m[7] == 0 && m[11] == 0 && m[15] == 1;
}

static void check_transform(struct hg_gltf *g, const struct hg_gltf_at *at)
{
    float m[16], q[4];
    struct hg_gltf_at matrix = hg_gltf_key(at, "matrix"), rotation = hg_gltf_key(at, "rotation");
    if (hg_gltf_numbers(at, "matrix", m, 16)) {
        if (rotation.json || hg_gltf_key(at, "translation").json || hg_gltf_key(at, "scale").json)
            hg_gltf_warn(g, &matrix, "NODE_MATRIX_TRS: a node has either a matrix or TRS");
        if (!is_decomposable(m))
            hg_gltf_warn(g, &matrix, "NODE_MATRIX_NON_TRS: it does not split into TRS");
    }
    if (hg_gltf_numbers(at, "rotation", q, 4) &&
        fabsf(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1) > 1e-3f)
        hg_gltf_warn(g, &rotation, "ROTATION_NON_UNIT: the quaternion was normalised");
}

static void check_node(struct hg_gltf *g, const struct hg_gltf_at *at, const struct hg_node *node)
{
    check_transform(g, at);
    struct hg_gltf_at weights = hg_gltf_key(at, "weights"), skin = hg_gltf_key(at, "skin");
    uint32_t targets = node->mesh ? node->mesh->target_count : 0;
    if (weights.json && !node->mesh)
        hg_gltf_warn(g, &weights, "UNSATISFIED_DEPENDENCY: mesh must be defined");
    else if (weights.json && hg_gltf_count(&weights) != targets)
        hg_gltf_warn(g, &weights, "NODE_WEIGHTS_INVALID: %zu weights for %u morph targets",
            hg_gltf_count(&weights), targets);
    bool joints = false, all = node->mesh != NULL;
    for (uint32_t p = 0; node->mesh && p < node->mesh->part_count; p++) {
        joints |= node->mesh->parts[p].joints != NULL;
        all &= node->mesh->parts[p].joints != NULL;
    }
    if (skin.json && !node->mesh)
        hg_gltf_warn(g, &skin, "UNSATISFIED_DEPENDENCY: mesh must be defined");
    else if (skin.json && !all)
        hg_gltf_warn(g, at, "NODE_SKIN_WITH_NON_SKINNED_MESH: the mesh has no joints");
    else if (!skin.json && joints)
        hg_gltf_warn(g, at, "NODE_SKINNED_MESH_WITHOUT_SKIN: the mesh is shown as modelled");
}

static void check_root(struct hg_gltf *g)
{
    struct hg_gltf_at scene = hg_gltf_key(&g->root, "scene");
    if (scene.json && !hg_gltf_key(&g->root, "scenes").json)
        hg_gltf_warn(g, &scene, "UNSATISFIED_DEPENDENCY: scenes must be defined");
    struct hg_gltf_at required = hg_gltf_key(&g->root, "extensionsRequired");
    struct hg_gltf_at used = hg_gltf_key(&g->root, "extensionsUsed");
    for (size_t i = 0; i < hg_gltf_count(&required); i++) {
        const char *name = json_string_value(json_array_get(required.json, i));
        bool found = false;
        for (size_t k = 0; k < hg_gltf_count(&used); k++)
            found |= strcmp(json_string_value(json_array_get(used.json, k)), name) == 0;
        if (!found)
            hg_gltf_warn(
                g, &required, "UNUSED_EXTENSION_REQUIRED: %.80s is not in extensionsUsed", name);
    }
}

static void check_images(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "images");
    for (size_t i = 0; i < hg_gltf_count(&list); i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        struct hg_gltf_at uri = hg_gltf_key(&at, "uri"), view = hg_gltf_key(&at, "bufferView");
        if (uri.json && view.json)
            hg_gltf_warn(g, &at, "ONE_OF_MISMATCH: either uri or bufferView");
        if (view.json && !hg_gltf_key(&at, "mimeType").json)
            hg_gltf_warn(g, &view, "UNSATISFIED_DEPENDENCY: mimeType must be defined");
    }
    struct hg_gltf_at skins = hg_gltf_key(&g->root, "skins");
    for (size_t i = 0; i < hg_gltf_count(&skins); i++) {
        struct hg_gltf_at at = hg_gltf_item(&skins, i), joints = hg_gltf_key(&at, "joints");
        for (size_t k = 1; k < hg_gltf_count(&joints) && k < 512; k++)
            for (size_t j = 0; j < k; j++)
                if (item_index(&joints, j) == item_index(&joints, k)) {
                    struct hg_gltf_at place = hg_gltf_item(&joints, k);
                    hg_gltf_warn(g, &place, "DUPLICATE_ELEMENTS: the joint is listed twice");
                }
    }
}

void hg_gltf_check_rules(struct hg_gltf *g)
{
    check_root(g);
    struct hg_gltf_at accessors = hg_gltf_key(&g->root, "accessors");
    for (uint32_t i = 0; i < g->view_count; i++)
        check_view(g, i);
    for (size_t i = 0; i < hg_gltf_count(&accessors); i++)
        check_accessor(g, i);
    check_uses(g);
    struct hg_gltf_at cameras = hg_gltf_key(&g->root, "cameras");
    for (size_t i = 0; i < hg_gltf_count(&cameras); i++) {
        struct hg_gltf_at at = hg_gltf_item(&cameras, i);
        check_camera(g, &at);
    }
    struct hg_gltf_at nodes = hg_gltf_key(&g->root, "nodes");
    for (size_t i = 0; i < g->asset->node_count; i++) {
        struct hg_gltf_at at = hg_gltf_item(&nodes, i);
        check_node(g, &at, g->asset->nodes[i]);
    }
    check_images(g);
    hg_gltf_check_meshes(g);
    hg_gltf_check_animations(g);
}
