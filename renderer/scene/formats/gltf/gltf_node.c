// Nodes, cameras, skins, instances.
#include "renderer/scene/formats/gltf/gltf.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/xform.h"

// ---- cameras -----------------------------------------------------------------------------------

// glTF knows no lenses and sensors: they are read from the extras of a camera and of the nodes that
// have it (docs/internals/exposure.md, "Cameras of files").
static void read_optics(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_camera *camera)
{
    static const char *const apertures[] = {"f_number", "fNumber", "fstop", NULL};
    static const char *const shutters[] = {"shutter_s", "shutter_time", "exposure_time", NULL};
    static const char *const speeds[] = {"iso", NULL};
    static const char *const sensors[] = {"sensor_mm", "sensor_height", NULL};
    static const char *const distances[] = {"focus_distance", "focusDistance", NULL};
    const struct hg_gltf_at extras = hg_gltf_key(at, "extras");
    struct hg_camera_optics *o = &camera->optics;
    if (!json_is_object(extras.json))
        return;
    const struct {
        const char *const *names;
        float most, *to;
    } values[] = {{apertures, 1000, &o->f_number}, {shutters, 1e6f, &o->shutter_s},
        {speeds, 1e7f, &o->iso}, {sensors, 10000, &o->sensor_mm},
        {distances, 1e12f, &o->focus_distance}};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        const float value =
            hg_gltf_read_extra(g, &extras, "camera", values[i].names, values[i].most);
        *values[i].to = value > 0 ? value : *values[i].to;
    }
}

static void read_camera(const struct hg_gltf_at *at, struct hg_camera *camera)
{
    struct hg_gltf_at perspective = hg_gltf_key(at, "perspective");
    struct hg_gltf_at orthographic = hg_gltf_key(at, "orthographic");
    const struct hg_gltf_at *lens = perspective.json ? &perspective : &orthographic;
    if (perspective.json) {
        double fov = hg_gltf_number(lens, "yfov", 0.785398163);
        camera->kind = HG_CAMERA_PERSPECTIVE;
        camera->vfov_rad = (float)(fov > 0.001 && fov < 3.14 ? fov : 0.785398163);
        camera->aspect = (float)hg_gltf_number(lens, "aspectRatio", 0);
    } else {
        double x = fabs(hg_gltf_number(lens, "xmag", 1)), y = fabs(hg_gltf_number(lens, "ymag", 1));
        camera->kind = HG_CAMERA_ORTHOGRAPHIC;
        camera->half_height = (float)(y > 0 ? y : 1);
        camera->aspect = x > 0 && y > 0 ? (float)(x / y) : 0;
    }
    camera->near = (float)fmax(hg_gltf_number(lens, "znear", 0.01), 0);
    camera->far = (float)hg_gltf_number(lens, "zfar", 0);
    if (camera->far != 0 && camera->far <= camera->near)
        camera->far = 0;
}

enum hg_status hg_gltf_load_cameras(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "cameras");
    for (size_t i = 0; i < hg_gltf_count(&list); i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        struct hg_camera *camera = hg_asset_add_camera(g->asset, hg_gltf_string(&at, "name"));
        if (!camera)
            return hg_gltf_fail(g, &at, HG_E_NOMEM, "no memory for a camera");
        read_camera(&at, camera);
        read_optics(g, &at, camera);
    }
    return HG_OK;
}

// ---- instances ---------------------------------------------------------------------------------

static enum hg_status read_instance_attribute(struct hg_gltf *g, const struct hg_gltf_at *at,
    const char *name, uint32_t components, uint32_t *count, float **out)
{
    int64_t index = hg_gltf_index(at, name);
    if (index < 0)
        return HG_OK;
    struct hg_gltf_at place = hg_gltf_key(at, name);
    struct hg_gltf_accessor a;
    enum hg_status status = hg_gltf_accessor_open(g, (uint64_t)index, &a);
    if (status)
        return status;
    if (a.rows != components || a.columns != 1 || (*count && a.count != *count))
        return hg_gltf_fail(
            g, &place, HG_E_FORMAT, "instances: %u components x %u", a.rows, a.count);
    *count = a.count;
    *out = hg_gltf_alloc(g, &place, a.count, components * sizeof(float));
    if (!*out)
        return g->err->status;
    hg_gltf_read_floats(&a, components, 0, *out);
    return HG_OK;
}

static void compose_instances(struct hg_node *node, float *const trs[3])
{
    for (uint32_t i = 0; i < node->instance_count; i++) {
        float t[3] = {0, 0, 0}, q[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
        if (trs[0])
            memcpy(t, trs[0] + (size_t)i * 3, sizeof t);
        if (trs[1])
            memcpy(q, trs[1] + (size_t)i * 4, sizeof q);
        if (trs[2])
            memcpy(s, trs[2] + (size_t)i * 3, sizeof s);
        hg_quat_normalize(q);
        hg_mat4_from_trs(t, q, s, node->instances[i]);
        for (int k = 0; k < 16; k++)
            if (!isfinite(node->instances[i][k])) {
                hg_mat4_identity(node->instances[i]);
                break;
            }
    }
}

static enum hg_status read_instances(
    struct hg_gltf *g, const struct hg_gltf_at *node_at, struct hg_node *node)
{
    struct hg_gltf_at extensions;
    struct hg_gltf_at at = hg_gltf_extension(node_at, "EXT_mesh_gpu_instancing", &extensions);
    struct hg_gltf_at attributes = hg_gltf_key(&at, "attributes");
    static const char *const names[] = {"TRANSLATION", "ROTATION", "SCALE"};
    float *trs[3] = {0};
    uint32_t count = 0;
    enum hg_status status = HG_OK;
    for (int i = 0; !status && i < 3; i++)
        status = read_instance_attribute(g, &attributes, names[i], i == 1 ? 4 : 3, &count, &trs[i]);
    if (!status && count) {
        node->instances = hg_gltf_alloc(g, &at, count, sizeof *node->instances);
        status = node->instances ? HG_OK : g->err->status;
        node->instance_count = status ? 0 : count;
        compose_instances(node, trs);
    }
    for (int i = 0; i < 3; i++)
        hg_free(trs[i]);
    return status;
}

// ---- nodes -------------------------------------------------------------------------------------

static void sanitize(struct hg_gltf *g, const struct hg_gltf_at *at, float *v, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!isfinite(v[i])) {
            hg_gltf_warn(g, at, "a transform is not finite; 0 is used");
            v[i] = 0;
        }
}

static void read_transform(struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_node *node)
{
    node->has_matrix = hg_gltf_numbers(at, "matrix", node->matrix, 16);
    hg_gltf_numbers(at, "translation", node->translation, 3);
    hg_gltf_numbers(at, "scale", node->scale, 3);
    hg_gltf_numbers(at, "rotation", node->rotation, 4);
    sanitize(g, at, node->matrix, 16);
    sanitize(g, at, node->translation, 3);
    sanitize(g, at, node->scale, 3);
    sanitize(g, at, node->rotation, 4);
    node->matrix[3] = node->matrix[7] = node->matrix[11] = 0;
    node->matrix[15] = 1;
    hg_quat_normalize(node->rotation);
}

static enum hg_status read_weights(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_node *node)
{
    uint32_t count = node->mesh ? node->mesh->target_count : 0;
    if (count == 0)
        return HG_OK;
    node->weights = hg_gltf_alloc(g, at, count, sizeof *node->weights);
    if (!node->weights)
        return g->err->status;
    memcpy(node->weights, node->mesh->weights, count * sizeof *node->weights);
    hg_gltf_numbers(at, "weights", node->weights, count);
    return HG_OK;
}

static enum hg_status read_node(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_node *node)
{
    struct hg_gltf_at extensions;
    read_transform(g, at, node);
    int64_t mesh = hg_gltf_index(at, "mesh"), camera = hg_gltf_index(at, "camera");
    struct hg_gltf_at punctual = hg_gltf_extension(at, "KHR_lights_punctual", &extensions);
    int64_t light = hg_gltf_index(&punctual, "light");
    if (mesh >= 0 && mesh < g->asset->mesh_count)
        node->mesh = g->asset->meshes[mesh];
    if (camera >= 0 && camera < g->asset->camera_count)
        node->camera = g->asset->cameras[camera];
    if (node->camera)
        read_optics(g, at, node->camera);
    enum hg_status status = HG_OK;
    if (light >= 0 && light < g->punctual_count) {
        node->light = g->asset->lights[light];
        hg_gltf_read_light_size(g, at, node->light);
        status = hg_gltf_read_light_tables(g, at, node->light);
    }
    if (!status)
        status = hg_gltf_read_ies_light(g, at, node);
    struct hg_gltf_at visibility = hg_gltf_extension(at, "KHR_node_visibility", &extensions);
    node->visible = hg_gltf_bool(&visibility, "visible", true);
    if (!status)
        status = read_weights(g, at, node);
    return status ? status : read_instances(g, at, node);
}

// Links children; the tail pointers keep this linear.
static enum hg_status link_children(struct hg_gltf *g, const struct hg_gltf_at *list)
{
    for (uint32_t i = 0; i < g->asset->node_count; i++) {
        struct hg_gltf_at at = hg_gltf_item(list, i), children = hg_gltf_key(&at, "children");
        struct hg_node *parent = g->asset->nodes[i], *tail = NULL;
        for (size_t c = 0; c < hg_gltf_count(&children); c++) {
            struct hg_gltf_at item = hg_gltf_item(&children, c);
            uint64_t index = (uint64_t)json_integer_value(item.json);
            if (index >= g->asset->node_count)
                return hg_gltf_fail(g, &item, HG_E_FORMAT, "UNRESOLVED_REFERENCE: no such node");
            struct hg_node *child = g->asset->nodes[index];
            if (child->parent || child == parent)
                return hg_gltf_fail(g, &item, HG_E_FORMAT, "%s: node %llu",
                    child == parent ? "NODE_LOOP" : "NODE_PARENT_OVERRIDE",
                    (unsigned long long)index);
            child->parent = parent;
            *(tail ? &tail->next_sibling : &parent->first_child) = child;
            tail = child;
        }
    }
    return HG_OK;
}

// With one parent each, a node is in a loop exactly when no root leads to it.
static enum hg_status check_loops(struct hg_gltf *g, const struct hg_gltf_at *list)
{
    struct hg_asset *asset = g->asset;
    uint8_t *state = hg_calloc(asset->node_count, 1); // 1 on the present path, 2 sound
    if (!state)
        return hg_gltf_fail(g, list, HG_E_NOMEM, "no memory for nodes");
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; !status && i < asset->node_count; i++) {
        struct hg_node *n = asset->nodes[i];
        while (n && state[(uint32_t)n->head.id] == 0) {
            state[(uint32_t)n->head.id] = 1;
            n = n->parent;
        }
        if (n && state[(uint32_t)n->head.id] == 1) {
            struct hg_gltf_at at = hg_gltf_item(list, i);
            status = hg_gltf_fail(g, &at, HG_E_FORMAT, "NODE_LOOP: the node is its own ancestor");
        }
        for (n = asset->nodes[i]; n && state[(uint32_t)n->head.id] == 1; n = n->parent)
            state[(uint32_t)n->head.id] = 2;
    }
    hg_free(state);
    return status;
}

// ---- scenes ------------------------------------------------------------------------------------

static enum hg_status choose_roots(struct hg_gltf *g)
{
    struct hg_asset *asset = g->asset;
    struct hg_gltf_at scenes = hg_gltf_key(&g->root, "scenes");
    size_t scene_count = hg_gltf_count(&scenes);
    int64_t chosen = g->params->scene_index;
    if (chosen < 0)
        chosen = hg_gltf_index(&g->root, "scene");
    if (chosen < 0 && scene_count)
        chosen = 0;
    if (chosen >= (int64_t)scene_count)
        return hg_gltf_fail(
            g, &scenes, HG_E_NOTFOUND, "UNRESOLVED_REFERENCE: no scene %lld", (long long)chosen);
    asset->roots = hg_gltf_alloc(g, &scenes, asset->node_count, sizeof *asset->roots);
    if (!asset->roots)
        return g->err->status;
    if (chosen < 0) { // no scenes at all: every root
        for (uint32_t i = 0; i < asset->node_count; i++)
            if (!asset->nodes[i]->parent)
                asset->roots[asset->root_count++] = asset->nodes[i];
        return HG_OK;
    }
    struct hg_gltf_at scene = hg_gltf_item(&scenes, (size_t)chosen);
    struct hg_gltf_at list = hg_gltf_key(&scene, "nodes");
    bool *in_scene = hg_calloc(asset->node_count, sizeof *in_scene);
    if (!in_scene)
        return hg_gltf_fail(g, &list, HG_E_NOMEM, "no memory for nodes");
    for (size_t i = 0; i < hg_gltf_count(&list); i++) {
        struct hg_gltf_at item = hg_gltf_item(&list, i);
        uint64_t index = (uint64_t)json_integer_value(item.json);
        if (index >= asset->node_count || in_scene[index])
            continue;
        in_scene[index] = true;
        if (asset->nodes[index]->parent)
            hg_gltf_warn(
                g, &item, "SCENE_NON_ROOT_NODE: node %llu has a parent", (unsigned long long)index);
        else
            asset->roots[asset->root_count++] = asset->nodes[index];
    }
    for (uint32_t i = 0; i < asset->node_count; i++) // the other scenes' trees stay hidden
        if (!asset->nodes[i]->parent && !in_scene[i])
            asset->nodes[i]->visible = false;
    hg_free(in_scene);
    return HG_OK;
}

enum hg_status hg_gltf_load_nodes(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "nodes");
    size_t count = hg_gltf_count(&list);
    enum hg_status status = HG_OK;
    for (size_t i = 0; !status && i < count; i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        struct hg_node *node = hg_asset_add_node(g->asset, hg_gltf_string(&at, "name"));
        if (!node)
            return hg_gltf_fail(g, &at, HG_E_NOMEM, "no memory for a node");
        status = read_node(g, &at, node);
    }
    if (!status)
        status = link_children(g, &list);
    if (!status)
        status = check_loops(g, &list);
    return status ? status : choose_roots(g);
}

// ---- skins -------------------------------------------------------------------------------------

static enum hg_status read_inverse_binds(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_skin *skin)
{
    skin->inverse_bind = hg_gltf_alloc(g, at, skin->joint_count, sizeof *skin->inverse_bind);
    if (!skin->inverse_bind)
        return g->err->status;
    for (uint32_t j = 0; j < skin->joint_count; j++)
        hg_mat4_identity(skin->inverse_bind[j]);
    int64_t index = hg_gltf_index(at, "inverseBindMatrices");
    if (index < 0)
        return HG_OK;
    struct hg_gltf_at place = hg_gltf_key(at, "inverseBindMatrices");
    struct hg_gltf_accessor a;
    enum hg_status status = hg_gltf_accessor_open(g, (uint64_t)index, &a);
    if (status)
        return status;
    if (a.rows != 4 || a.columns != 4 || a.component_type != 5126 || a.count < skin->joint_count)
        return hg_gltf_fail(g, &place, HG_E_FORMAT,
            "SKIN_IBM_INVALID_FORMAT: %u float MAT4 are needed", skin->joint_count);
    float *all = hg_gltf_alloc(g, &place, a.count, 16 * sizeof *all);
    if (!all)
        return g->err->status;
    hg_gltf_read_floats(&a, 16, 0, all);
    memcpy(skin->inverse_bind, all, skin->joint_count * sizeof *skin->inverse_bind);
    hg_free(all);
    for (uint32_t j = 0; j < skin->joint_count; j++)
        sanitize(g, &place, skin->inverse_bind[j], 16);
    return HG_OK;
}

static enum hg_status read_skin(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_skin *skin)
{
    struct hg_gltf_at list = hg_gltf_key(at, "joints");
    size_t count = hg_gltf_count(&list);
    skin->joints = hg_gltf_alloc(g, &list, count, sizeof *skin->joints);
    if (!skin->joints)
        return g->err->status;
    for (size_t j = 0; j < count; j++) {
        struct hg_gltf_at item = hg_gltf_item(&list, j);
        uint64_t index = (uint64_t)json_integer_value(item.json);
        if (index >= g->asset->node_count)
            return hg_gltf_fail(g, &item, HG_E_FORMAT, "UNRESOLVED_REFERENCE: no such node");
        skin->joints[j] = g->asset->nodes[index];
    }
    skin->joint_count = (uint32_t)count;
    return read_inverse_binds(g, at, skin);
}

// Takes the weight of joints beyond the skin's away from a vertex and shares it among the others;
// one that is left without any follows the first joint. Returns how many weights were lost.
static uint32_t clamp_vertex(uint16_t *joints, float *weights, uint32_t width, uint32_t joint_count)
{
    uint32_t lost = 0;
    float sum = 0;
    for (uint32_t i = 0; i < width; i++) {
        if (joints[i] >= joint_count) {
            lost += weights[i] > 0;
            joints[i] = 0;
            weights[i] = 0;
        }
        sum += weights[i];
    }
    for (uint32_t i = 0; i < width && lost; i++)
        weights[i] = sum > 0 ? weights[i] / sum : (float)(i == 0);
    return lost;
}

// After this no later room has to check joints.
static void clamp_joints(
    struct hg_gltf *g, const struct hg_gltf_at *at, struct hg_mesh *mesh, uint32_t joint_count)
{
    size_t bad = 0;
    for (uint32_t p = 0; p < mesh->part_count; p++) {
        struct hg_mesh_part *part = &mesh->parts[p];
        const size_t width = (size_t)4 * part->joint_sets;
        for (size_t v = 0; part->joints && v < part->vertex_count; v++)
            bad += clamp_vertex(
                part->joints + v * width, part->weights + v * width, (uint32_t)width, joint_count);
    }
    if (bad)
        hg_gltf_warn(
            g, at, "ACCESSOR_JOINTS_INDEX_OOB: %zu joints beyond the skin's %u", bad, joint_count);
}

static bool has_joints(const struct hg_mesh *mesh)
{
    for (uint32_t p = 0; mesh && p < mesh->part_count; p++)
        if (mesh->parts[p].joints)
            return true;
    return false;
}

enum hg_status hg_gltf_load_skins(struct hg_gltf *g)
{
    struct hg_gltf_at list = hg_gltf_key(&g->root, "skins");
    for (size_t i = 0; i < hg_gltf_count(&list); i++) {
        struct hg_gltf_at at = hg_gltf_item(&list, i);
        struct hg_skin *skin = hg_asset_add_skin(g->asset);
        if (!skin)
            return hg_gltf_fail(g, &at, HG_E_NOMEM, "no memory for a skin");
        enum hg_status status = read_skin(g, &at, skin);
        if (status)
            return status;
    }
    struct hg_gltf_at nodes = hg_gltf_key(&g->root, "nodes");
    for (uint32_t i = 0; i < g->asset->node_count; i++) {
        struct hg_gltf_at at = hg_gltf_item(&nodes, i);
        struct hg_node *node = g->asset->nodes[i];
        int64_t index = hg_gltf_index(&at, "skin");
        if (index < 0 || index >= g->asset->skin_count || !has_joints(node->mesh) ||
            g->asset->skins[index]->joint_count == 0)
            continue;
        node->skin = g->asset->skins[index];
        clamp_joints(g, &at, node->mesh, node->skin->joint_count);
    }
    return HG_OK;
}
