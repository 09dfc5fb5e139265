// Rules of meshes, morph targets and animations.
#include "renderer/scene/formats/gltf/gltf_check.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct {
    const char *name;
    bool numbered;
} semantics[] = {{"POSITION", false}, {"NORMAL", false}, {"TANGENT", false}, {"TEXCOORD_", true},
    {"COLOR_", true}, {"JOINTS_", true}, {"WEIGHTS_", true}};

// POSITION, TEXCOORD_2, _ANYTHING: what the specification allows.
static bool is_attribute_name(const char *name)
{
    if (name[0] == '_')
        return true;
    for (size_t i = 0; i < sizeof semantics / sizeof *semantics; i++) {
        size_t n = strlen(semantics[i].name);
        if (!semantics[i].numbered && strcmp(name, semantics[i].name) == 0)
            return true;
        if (!semantics[i].numbered || strncmp(name, semantics[i].name, n) != 0)
            continue;
        const char *digits = name + n;
        bool number = *digits && strspn(digits, "0123456789") == strlen(digits);
        return number && (digits[0] != '0' || digits[1] == '\0');
    }
    return false;
}

static bool has_bounds(struct hg_gltf *g, int64_t accessor)
{
    struct hg_gltf_at up;
    if (accessor < 0)
        return true;
    struct hg_gltf_at at = hg_gltf_root_item(g, "accessors", (size_t)accessor, &up);
    return hg_gltf_key(&at, "min").json && hg_gltf_key(&at, "max").json;
}

// Number of consecutive sets of a semantic; warns about gaps.
static uint32_t count_sets(
    struct hg_gltf *g, const struct hg_gltf_at *attributes, const char *semantic)
{
    char name[32];
    uint32_t sets = 0, total = 0;
    size_t n = strlen(semantic);
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)attributes->json, key, value) total +=
        strncmp(key, semantic, n) == 0;
    for (;; sets++) {
        snprintf(name, sizeof name, "%s%u", semantic, sets);
        if (!json_object_get(attributes->json, name))
            break;
    }
    if (sets != total)
        hg_gltf_warn(g, attributes,
            "MESH_PRIMITIVE_INDEXED_SEMANTIC_CONTINUITY: %.20s is numbered with gaps", semantic);
    return sets;
}

static void check_attribute(
    struct hg_gltf *g, const struct hg_gltf_at *place, const char *name, int64_t accessor)
{
    struct hg_gltf_at up, view_up;
    struct hg_gltf_at at =
        hg_gltf_root_item(g, "accessors", accessor < 0 ? SIZE_MAX : (size_t)accessor, &up);
    if (!is_attribute_name(name))
        hg_gltf_warn(g, place, "MESH_PRIMITIVE_INVALID_ATTRIBUTE: the name is not permitted");
    if (hg_gltf_uint(&at, "componentType", 0) == 5125)
        hg_gltf_warn(g, place, "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_UNSIGNED_INT: not for vertices");
    if (strcmp(name, "POSITION") == 0 && !has_bounds(g, accessor))
        hg_gltf_warn(g, place, "MESH_PRIMITIVE_POSITION_ACCESSOR_WITHOUT_BOUNDS: no min and max");
    int64_t view = hg_gltf_index(&at, "bufferView");
    if (view < 0)
        return;
    struct hg_gltf_at view_at = hg_gltf_root_item(g, "bufferViews", (size_t)view, &view_up);
    struct hg_gltf_at compressed = hg_gltf_key(&view_at, "extensions");
    struct hg_gltf_accessor a;
    struct hg_error kept = *g->err;
    if (compressed.json || hg_gltf_accessor_open(g, (uint64_t)accessor, &a)) {
        *g->err = kept;
        return;
    }
    if (hg_gltf_uint(&at, "byteOffset", 0) % 4 || a.stride % 4)
        hg_gltf_warn(g, place,
            "MESH_PRIMITIVE_ACCESSOR_UNALIGNED: vertices must begin on multiples of 4 bytes");
}

static void check_attributes(struct hg_gltf *g, const struct hg_gltf_at *attributes)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)attributes->json, key, value)
    {
        struct hg_gltf_at place = hg_gltf_key(attributes, key);
        check_attribute(g, &place, key, hg_gltf_index(attributes, key));
    }
}

static void check_targets(
    struct hg_gltf *g, const struct hg_gltf_at *targets, const struct hg_gltf_at *attributes)
{
    for (size_t t = 0; t < hg_gltf_count(targets); t++) {
        struct hg_gltf_at target = hg_gltf_item(targets, t);
        check_attributes(g, &target);
        const char *key;
        json_t *value;
        json_object_foreach((json_t *)target.json, key, value)
        {
            struct hg_gltf_at place = hg_gltf_key(&target, key);
            if (!json_object_get(attributes->json, key))
                hg_gltf_warn(g, &place,
                    "MESH_PRIMITIVE_MORPH_TARGET_NO_BASE_ACCESSOR: the primitive has no such "
                    "attribute");
        }
    }
}

// Every texCoord a material names must be there.
static void check_texcoords(struct hg_gltf *g, const struct hg_gltf_at *primitive, uint32_t sets)
{
    static const char *const top[] = {"normalTexture", "occlusionTexture", "emissiveTexture"};
    static const char *const pbr_keys[] = {"baseColorTexture", "metallicRoughnessTexture"};
    struct hg_gltf_at up, place = hg_gltf_key(primitive, "material");
    int64_t index = hg_gltf_index(primitive, "material");
    struct hg_gltf_at at =
        hg_gltf_root_item(g, "materials", index < 0 ? SIZE_MAX : (size_t)index, &up);
    struct hg_gltf_at pbr = hg_gltf_key(&at, "pbrMetallicRoughness");
    for (int i = 0; i < 5; i++) {
        struct hg_gltf_at info =
            i < 3 ? hg_gltf_key(&at, top[i]) : hg_gltf_key(&pbr, pbr_keys[i - 3]);
        if (info.json && hg_gltf_uint(&info, "texCoord", 0) >= sets)
            hg_gltf_warn(g, &place, "MESH_PRIMITIVE_TOO_FEW_TEXCOORDS: %s needs TEXCOORD_%llu",
                info.key, (unsigned long long)hg_gltf_uint(&info, "texCoord", 0));
    }
}

static void check_primitive(struct hg_gltf *g, const struct hg_gltf_at *at)
{
    struct hg_gltf_at attributes = hg_gltf_key(at, "attributes");
    struct hg_gltf_at targets = hg_gltf_key(at, "targets");
    struct hg_gltf_at tangent = hg_gltf_key(&attributes, "TANGENT");
    check_attributes(g, &attributes);
    check_targets(g, &targets, &attributes);
    uint32_t joints = count_sets(g, &attributes, "JOINTS_");
    uint32_t weights = count_sets(g, &attributes, "WEIGHTS_");
    (void)count_sets(g, &attributes, "COLOR_");
    if (joints != weights)
        hg_gltf_warn(g, &attributes,
            "MESH_PRIMITIVE_JOINTS_WEIGHTS_MISMATCH: %u sets of joints, %u of weights", joints,
            weights);
    if (tangent.json && !json_object_get(attributes.json, "NORMAL"))
        hg_gltf_warn(
            g, &tangent, "MESH_PRIMITIVE_TANGENT_WITHOUT_NORMAL: tangents are computed again");
    check_texcoords(g, at, count_sets(g, &attributes, "TEXCOORD_"));
}

void hg_gltf_check_meshes(struct hg_gltf *g)
{
    struct hg_gltf_at meshes = hg_gltf_key(&g->root, "meshes");
    for (size_t m = 0; m < hg_gltf_count(&meshes); m++) {
        struct hg_gltf_at mesh = hg_gltf_item(&meshes, m);
        struct hg_gltf_at list = hg_gltf_key(&mesh, "primitives");
        struct hg_gltf_at weights = hg_gltf_key(&mesh, "weights");
        size_t first = 0;
        for (size_t p = 0; p < hg_gltf_count(&list); p++) {
            struct hg_gltf_at at = hg_gltf_item(&list, p), targets = hg_gltf_key(&at, "targets");
            size_t count = hg_gltf_count(&targets);
            check_primitive(g, &at);
            if (p == 0)
                first = count;
            else if (count != first)
                hg_gltf_warn(g, &targets,
                    "MESH_PRIMITIVES_UNEQUAL_TARGETS_COUNT: %zu morph targets, others have %zu",
                    count, first);
        }
        if (weights.json && hg_gltf_count(&weights) != first)
            hg_gltf_warn(g, &weights, "MESH_INVALID_WEIGHTS_COUNT: %zu weights, %zu morph targets",
                hg_gltf_count(&weights), first);
    }
}

// ---- animations --------------------------------------------------------------------------------

static void check_sampler(struct hg_gltf *g, const struct hg_gltf_at *at)
{
    struct hg_gltf_at place = hg_gltf_key(at, "input"), up;
    int64_t input = hg_gltf_index(at, "input");
    struct hg_gltf_at accessor =
        hg_gltf_root_item(g, "accessors", input < 0 ? SIZE_MAX : (size_t)input, &up);
    const char *type = hg_gltf_string(&accessor, "type");
    const char *interpolation = hg_gltf_string(at, "interpolation");
    if (!has_bounds(g, input))
        hg_gltf_warn(g, &place,
            "ANIMATION_SAMPLER_INPUT_ACCESSOR_WITHOUT_BOUNDS: min and max must be defined");
    if ((type && strcmp(type, "SCALAR") != 0) ||
        hg_gltf_uint(&accessor, "componentType", 5126) != 5126)
        hg_gltf_warn(
            g, &place, "ANIMATION_SAMPLER_INPUT_ACCESSOR_INVALID_FORMAT: float scalars are needed");
    if (interpolation && strcmp(interpolation, "CUBICSPLINE") == 0 &&
        hg_gltf_uint(&accessor, "count", 2) < 2)
        hg_gltf_warn(g, &place,
            "ANIMATION_SAMPLER_INPUT_ACCESSOR_TOO_FEW_ELEMENTS: cubic splines need 2 keys");
}

static void check_duplicates(struct hg_gltf *g, const struct hg_gltf_at *channels)
{
    size_t count = hg_gltf_count(channels);
    for (size_t i = 0; i < count && count <= 4096; i++) {
        struct hg_gltf_at a = hg_gltf_item(channels, i), target = hg_gltf_key(&a, "target");
        const char *path = hg_gltf_string(&target, "path");
        int64_t node = hg_gltf_index(&target, "node");
        for (size_t k = i + 1; path && node >= 0 && k < count; k++) {
            struct hg_gltf_at b = hg_gltf_item(channels, k), other = hg_gltf_key(&b, "target");
            const char *other_path = hg_gltf_string(&other, "path");
            if (hg_gltf_index(&other, "node") == node && other_path &&
                strcmp(path, other_path) == 0)
                hg_gltf_warn(g, &target, "ANIMATION_DUPLICATE_TARGETS: channel %zu has it too", k);
        }
    }
}

void hg_gltf_check_animations(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "animations");
    for (size_t i = 0; i < hg_gltf_count(&list); i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        struct hg_gltf_at samplers = hg_gltf_key(&at, "samplers");
        struct hg_gltf_at channels = hg_gltf_key(&at, "channels");
        for (size_t s = 0; s < hg_gltf_count(&samplers); s++) {
            struct hg_gltf_at sampler = hg_gltf_item(&samplers, s);
            check_sampler(g, &sampler);
        }
        check_duplicates(g, &channels);
    }
}
