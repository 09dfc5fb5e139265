#include "renderer/scene/demo/demo_build.h"

#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/xform.h"

static bool fail(struct hg_demo *d)
{
    if (!d->status)
        d->status = HG_E_NOMEM;
    return false;
}

static struct hg_texture *add_texture(
    struct hg_demo *d, const char *name, struct hg_image *pixels, bool srgb)
{
    struct hg_texture *texture = d->status ? NULL : hg_asset_add_texture(d->asset, name);
    struct hg_image_source *source = texture ? hg_image_source_create(name) : NULL;
    if (!source) {
        hg_image_finish(pixels);
        (void)fail(d);
        return NULL;
    }
    source->pixels = *pixels;
    source->pixels_srgb = srgb;
    memset(pixels, 0, sizeof *pixels);
    texture->image = source;
    return texture;
}

void hg_demo_draw_sets(struct hg_demo *d)
{
    static const char *const names[HG_DEMO_PATTERNS] = {
        "tiles", "marble", "plaster", "cloth", "brass", "water", "glaze", "wood"};
    for (int i = 0; i < HG_DEMO_PATTERNS && !d->status; i++) {
        struct hg_demo_set set;
        d->status = hg_demo_draw((enum hg_demo_pattern)i, d->jobs, &set);
        d->sets[i].color = add_texture(d, names[i], &set.color, true);
        d->sets[i].normal = add_texture(d, names[i], &set.normal, false);
        d->sets[i].orm = add_texture(d, names[i], &set.orm, false);
    }
}

static void set_slot(
    struct hg_material *m, enum hg_texture_slot slot, struct hg_texture *texture, float metres)
{
    m->slots[slot].texture = texture;
    m->slots[slot].uv_transform[0] = m->slots[slot].uv_transform[4] = 1 / metres;
}

struct hg_material *hg_demo_material(struct hg_demo *d, const struct hg_demo_material *params)
{
    struct hg_material *m = d->status ? NULL : hg_asset_add_material(d->asset, params->name);
    if (!m) {
        (void)fail(d);
        return NULL;
    }
    memcpy(m->base_color, params->color, sizeof params->color);
    m->metallic = params->metallic;
    m->roughness = params->roughness;
    if (params->set < 0)
        return m;
    const struct hg_demo_textures *set = &d->sets[params->set];
    set_slot(m, HG_SLOT_BASE_COLOR, set->color, params->metres);
    set_slot(m, HG_SLOT_NORMAL, set->normal, params->metres);
    set_slot(m, HG_SLOT_METALLIC_ROUGHNESS, set->orm, params->metres);
    set_slot(m, HG_SLOT_OCCLUSION, set->orm, params->metres);
    m->normal_scale = params->normal_scale;
    return m;
}

struct hg_mesh *hg_demo_mesh(
    struct hg_demo *d, const char *name, struct hg_shape *shape, struct hg_material *material)
{
    struct hg_mesh *mesh = d->status ? NULL : hg_asset_add_mesh(d->asset, name);
    if (mesh)
        mesh->parts = hg_calloc(1, sizeof *mesh->parts);
    if (!mesh || !mesh->parts) {
        hg_shape_finish(shape);
        (void)fail(d);
        return NULL;
    }
    mesh->part_count = 1;
    d->status = hg_shape_to_part(shape, mesh->parts);
    mesh->parts->material = material;
    if (!d->status && material && material->slots[HG_SLOT_NORMAL].texture)
        d->status = hg_part_make_tangents(mesh->parts, 0, 0);
    if (!d->status)
        hg_mesh_part_update_bounds(mesh->parts, 0);
    return mesh;
}

static void quat_about(const float axis[3], float angle_rad, float q[4])
{
    float s = sinf(angle_rad / 2);
    for (int i = 0; i < 3; i++)
        q[i] = axis[i] * s;
    q[3] = cosf(angle_rad / 2);
}

struct hg_node *hg_demo_node(struct hg_demo *d, struct hg_node *parent, const char *name,
    struct hg_mesh *mesh, const float place[3], float yaw_deg)
{
    static const float up[3] = {0, 1, 0};
    struct hg_node *node = d->status ? NULL : hg_asset_add_node(d->asset, name);
    if (!node) {
        (void)fail(d);
        return NULL;
    }
    node->mesh = mesh;
    memcpy(node->translation, place, sizeof node->translation);
    quat_about(up, yaw_deg * (float)M_PI / 180, node->rotation);
    if (parent)
        hg_node_append_child(parent, node);
    return node;
}

// Unit quaternion of the rotation with these columns (Shepperd 1978).
static void quat_from_axes(const float x[3], const float y[3], const float z[3], float q[4])
{
    const float m[3][3] = {{x[0], y[0], z[0]}, {x[1], y[1], z[1]}, {x[2], y[2], z[2]}};
    float trace = m[0][0] + m[1][1] + m[2][2];
    if (trace > 0) {
        float s = sqrtf(trace + 1) * 2;
        q[3] = s / 4;
        q[0] = (m[2][1] - m[1][2]) / s;
        q[1] = (m[0][2] - m[2][0]) / s;
        q[2] = (m[1][0] - m[0][1]) / s;
        return;
    }
    int i = m[1][1] > m[0][0];
    i = m[2][2] > m[i][i] ? 2 : i;
    int j = (i + 1) % 3, k = (i + 2) % 3;
    float s = sqrtf(1 + m[i][i] - m[j][j] - m[k][k]) * 2;
    q[i] = s / 4;
    q[j] = (m[j][i] + m[i][j]) / s;
    q[k] = (m[k][i] + m[i][k]) / s;
    q[3] = (m[k][j] - m[j][k]) / s;
}

void hg_demo_aim(struct hg_node *node, const float target[3])
{
    if (!node)
        return;
    float z[3], x[3], y[3] = {0, 1, 0};
    for (int i = 0; i < 3; i++)
        z[i] = node->translation[i] - target[i];
    hg_normalize3(z);
    if (fabsf(z[1]) > 0.999f)
        y[0] = 1, y[1] = 0;
    hg_cross3(y, z, x);
    hg_normalize3(x);
    hg_cross3(z, x, y);
    quat_from_axes(x, y, z, node->rotation);
    hg_quat_normalize(node->rotation);
}

static void quat_mul(const float a[4], const float b[4], float out[4])
{
    out[0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1];
    out[1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0];
    out[2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3];
    out[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2];
}

void hg_demo_spin(struct hg_demo *d, struct hg_animation *animation, struct hg_node *node,
    const float axis[3], float period_s, float length_s)
{
    if (d->status || !node || !animation)
        return;
    struct hg_anim_channel *c = &animation->channels[animation->channel_count];
    uint32_t quarters = (uint32_t)(length_s / period_s * 4 + 0.5f);
    c->times = hg_calloc(quarters + 1, sizeof *c->times);
    c->values = hg_calloc(quarters + 1, 4 * sizeof *c->values);
    if (!c->times || !c->values) {
        hg_free(c->times);
        hg_free(c->values);
        memset(c, 0, sizeof *c);
        (void)fail(d);
        return;
    }
    animation->channel_count++;
    c->node = node;
    c->path = HG_ANIM_ROTATION;
    c->interpolation = HG_ANIM_LINEAR;
    c->key_count = quarters + 1;
    c->width = 4;
    for (uint32_t k = 0; k <= quarters; k++) {
        float turn[4];
        quat_about(axis, (float)k * (float)M_PI / 2, turn);
        c->times[k] = (float)k * period_s / 4;
        quat_mul(node->rotation, turn, c->values + (size_t)k * 4);
    }
}
