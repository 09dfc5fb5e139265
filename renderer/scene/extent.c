#include "renderer/scene/extent.h"

#include <math.h>

#include "renderer/scene/xform.h"

enum { MOST_VERTICES = 4 * 1024 * 1024 }; // visited one by one

// ---- boxes -------------------------------------------------------------------------------------

// Every weighted mean of the joints' images of a point lies in the hull of those images, so the
// box under each of the joints bounds the skinned mesh.
static bool visit_skinned_box(const struct hg_skin *skin, const struct hg_mesh_part *part,
    hg_extent_box_fn *visit, void *user)
{
    for (uint32_t j = 0; j < skin->joint_count; j++) {
        float m[16];
        hg_mat4_mul(skin->joints[j]->world, skin->inverse_bind[j], m);
        if (visit(user, m, part->bounds_min, part->bounds_max))
            return true;
    }
    return false;
}

static bool visit_part_boxes(const struct hg_node *node, const struct hg_mesh_part *part,
    hg_extent_box_fn *visit, void *user)
{
    if (node->skin && part->joints)
        return visit_skinned_box(node->skin, part, visit, user);
    if (node->instance_count == 0)
        return visit(user, node->world, part->bounds_min, part->bounds_max);
    for (uint32_t i = 0; i < node->instance_count; i++) {
        float m[16];
        hg_mat4_mul(node->world, node->instances[i], m);
        if (visit(user, m, part->bounds_min, part->bounds_max))
            return true;
    }
    return false;
}

bool hg_extent_visit_boxes(const struct hg_node *node, hg_extent_box_fn *visit, void *user)
{
    for (uint32_t p = 0; node->mesh && node->world_visible && p < node->mesh->part_count; p++)
        if (node->mesh->parts[p].index_count &&
            visit_part_boxes(node, &node->mesh->parts[p], visit, user))
            return true;
    return false;
}

// ---- points ------------------------------------------------------------------------------------

struct point_walk {
    hg_extent_point_fn *visit;
    void *user;
    uint64_t left; // vertices that may still be visited
};

static bool visit_corners(
    void *user, const float matrix[16], const float min[3], const float max[3])
{
    struct point_walk *walk = user;
    for (int corner = 0; corner < 8; corner++) {
        float p[3];
        for (int i = 0; i < 3; i++)
            p[i] = corner >> i & 1 ? max[i] : min[i];
        hg_mat4_point(matrix, p, p);
        walk->visit(walk->user, p);
    }
    return false;
}

static void morphed(
    const struct hg_node *node, const struct hg_mesh_part *part, uint32_t vertex, float out[3])
{
    const float *weights = node->weights ? node->weights : node->mesh->weights;
    memcpy(out, &part->positions[(size_t)vertex * 3], 3 * sizeof *out);
    for (uint32_t t = 0; weights && part->targets && t < node->mesh->target_count; t++)
        for (int i = 0; part->targets[t].positions && i < 3; i++)
            out[i] += weights[t] * part->targets[t].positions[(size_t)vertex * 3 + (size_t)i];
}

// By linear blend skinning; `matrices` of the joints are made as they are needed.
static void skinned(const struct hg_skin *skin, const struct hg_mesh_part *part, uint32_t vertex,
    const float p[3], float out[3])
{
    const size_t per_vertex = (size_t)4 * part->joint_sets, first = vertex * per_vertex;
    float sum[3] = {0, 0, 0};
    for (size_t k = first; k < first + per_vertex; k++) {
        const uint32_t joint = part->joints[k];
        float bound[3], posed[3];
        if (part->weights[k] == 0 || joint >= skin->joint_count)
            continue;
        hg_mat4_point(skin->inverse_bind[joint], p, bound);
        hg_mat4_point(skin->joints[joint]->world, bound, posed);
        for (int i = 0; i < 3; i++)
            sum[i] += part->weights[k] * posed[i];
    }
    memcpy(out, sum, sizeof sum);
}

static void visit_vertices(const struct hg_node *node, const struct hg_mesh_part *part,
    const float world[16], const struct point_walk *walk)
{
    for (uint32_t v = 0; v < part->vertex_count; v++) {
        float p[3];
        morphed(node, part, v, p);
        if (node->skin && part->joints)
            skinned(node->skin, part, v, p, p);
        else
            hg_mat4_point(world, p, p);
        walk->visit(walk->user, p);
    }
}

static void visit_part_points(
    const struct hg_node *node, const struct hg_mesh_part *part, struct point_walk *walk)
{
    const bool is_skinned = node->skin && part->joints;
    const uint64_t copies = node->instance_count && !is_skinned ? node->instance_count : 1;
    if (part->vertex_count > walk->left / copies) {
        visit_part_boxes(node, part, visit_corners, walk);
        return;
    }
    walk->left -= part->vertex_count * copies;
    if (!node->instance_count || is_skinned)
        visit_vertices(node, part, node->world, walk);
    for (uint32_t i = 0; i < node->instance_count && !is_skinned; i++) {
        float m[16];
        hg_mat4_mul(node->world, node->instances[i], m);
        visit_vertices(node, part, m, walk);
    }
}

static bool is_below(const struct hg_node *node, const struct hg_node *top)
{
    while (node && node != top)
        node = node->parent;
    return node != NULL;
}

void hg_extent_visit_points(
    const struct hg_scene *scene, const struct hg_node *top, hg_extent_point_fn *visit, void *user)
{
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    struct point_walk walk = {visit, user, MOST_VERTICES};
    for (uint32_t i = 0; i < nodes->count; i++) {
        const struct hg_node *node = (const struct hg_node *)nodes->items[i];
        if (!node->mesh || !node->world_visible || (top && !is_below(node, top)))
            continue;
        for (uint32_t p = 0; p < node->mesh->part_count; p++)
            if (node->mesh->parts[p].index_count)
                visit_part_points(node, &node->mesh->parts[p], &walk);
    }
}

// ---- cameras -----------------------------------------------------------------------------------

struct sight {
    float eye[3], axes[3][3]; // right, up, back; unit
    double slope[2], half[2]; // of the sides; of the picture at the eye (orthographic)
    double near, far;         // far 0 = infinite
    bool any_geometry;
};

// How far a point lies beyond each side of the frustum; positive = outside.
static void outside_by(const struct sight *s, const float p[3], double by[6])
{
    float d[3];
    for (int i = 0; i < 3; i++)
        d[i] = p[i] - s->eye[i];
    const double depth = -(double)hg_dot3(d, s->axes[2]);
    for (int i = 0; i < 2; i++) {
        const double at = (double)hg_dot3(d, s->axes[i]), side = s->half[i] + s->slope[i] * depth;
        by[2 * i] = at - side;
        by[2 * i + 1] = -at - side;
    }
    by[4] = s->near - depth;
    by[5] = s->far > 0 ? depth - s->far : -1;
}

// Not all of its corners are outside of one side. Conservative near the frustum's edges.
static bool sees_box(void *user, const float matrix[16], const float min[3], const float max[3])
{
    struct sight *s = user;
    uint32_t outside = 0x3f; // sides that all corners so far are beyond
    s->any_geometry = true;
    for (int corner = 0; corner < 8; corner++) {
        float p[3];
        double by[6];
        for (int i = 0; i < 3; i++)
            p[i] = corner >> i & 1 ? max[i] : min[i];
        hg_mat4_point(matrix, p, p);
        outside_by(s, p, by);
        for (int side = 0; side < 6; side++)
            outside &= ~(by[side] > 0 ? 0u : 1u << side);
    }
    return outside == 0;
}

static bool has_pose(const struct hg_node *node, struct sight *s)
{
    for (int i = 0; i < 16; i++)
        if (!isfinite(node->world[i]))
            return false;
    memcpy(s->eye, &node->world[12], sizeof s->eye);
    for (int i = 0; i < 3; i++) {
        memcpy(s->axes[i], &node->world[(ptrdiff_t)4 * i], sizeof s->axes[i]);
        if (!hg_normalize3(s->axes[i]))
            return false;
    }
    return true;
}

static bool has_lens(const struct hg_camera *c, double aspect, struct sight *s)
{
    s->near = (double)c->near;
    s->far = (double)c->far;
    if (c->kind == HG_CAMERA_ORTHOGRAPHIC) {
        s->half[1] = (double)c->half_height;
        s->half[0] = s->half[1] * aspect;
        return s->half[1] > 0 && isfinite(s->half[1]);
    }
    if (!(c->vfov_rad > 0 && (double)c->vfov_rad < 3.14))
        return false;
    s->slope[1] = tan((double)c->vfov_rad / 2);
    s->slope[0] = s->slope[1] * aspect;
    return true;
}

const char *hg_extent_camera_fault(
    const struct hg_scene *scene, const struct hg_node *node, double aspect)
{
    struct sight s = {0};
    if (!has_pose(node, &s))
        return "its transform is degenerate";
    if (!has_lens(node->camera, aspect, &s))
        return "its lens has no usable field of view";
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++)
        if (hg_extent_visit_boxes((const struct hg_node *)nodes->items[i], sees_box, &s))
            return NULL;
    return s.any_geometry ? "no geometry is in its view" : NULL;
}
