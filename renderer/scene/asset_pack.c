// asset_pack.c - one function for each kind of object that writes it or reads it, so that both
// sides agree. Those that read check; those that write have a sound asset.
#include "renderer/scene/asset_pack.h"

#include <stdio.h>

#include "renderer/scene/asset_pack_io.h"

enum { VERSION = 1, MOST_DEPTH = 1100 };

struct family { // of a node that is read
    struct hg_node *last_child;
    uint32_t depth;
};

// ---- textures and materials --------------------------------------------------------------------

enum source { SOURCE_NONE, SOURCE_NAMED, SOURCE_ENCODED, SOURCE_PIXELS, SOURCES };

static void pack_encoded(struct hg_pack *p, struct hg_image_source *source)
{
    uint32_t size = reads(p) ? 0 : (uint32_t)source->encoded->size;
    pack_count(p, &size, 1, 1);
    const uint8_t *bytes = reads(p) ? hg_read_bytes(&p->in, size) : NULL;
    if (!reads(p)) {
        hg_write_bytes(p->out, source->encoded->data, size);
    } else if (goes_on(p)) {
        source->encoded = hg_refbuf_create_spilled(size);
        if (source->encoded)
            memcpy(source->encoded->data, bytes, size);
        else
            fail(p, HG_E_NOMEM, "no memory");
    }
}

static void pack_pixels(struct hg_pack *p, struct hg_image_source *source)
{
    struct hg_image *image = &source->pixels;
    uint32_t width = image->width, height = image->height;
    pack_u32(p, &width);
    pack_u32(p, &height);
    source->pixels_srgb = pack_bool(p, source->pixels_srgb);
    require(
        p, width && height && (uint64_t)width * height <= (p->in.size - p->in.pos) / 4, "an image");
    if (!reads(p)) {
        hg_write_bytes(p->out, image->pixels, image->size_bytes);
    } else if (goes_on(p)) {
        enum hg_status status = hg_image_create(width, height, HG_PIXEL_RGBA8, NULL, image);
        if (status)
            fail(p, status, "an embedded image is too large");
        else
            memcpy(image->pixels, hg_read_bytes(&p->in, image->size_bytes), image->size_bytes);
    }
}

static void pack_source(struct hg_pack *p, struct hg_texture *texture)
{
    struct hg_image_source *source = texture->image;
    uint32_t kind = !source                 ? SOURCE_NONE
                    : source->encoded       ? SOURCE_ENCODED
                    : source->pixels.pixels ? SOURCE_PIXELS
                                            : SOURCE_NAMED;
    kind = pack_choice(p, kind, SOURCES);
    if (kind == SOURCE_NONE)
        return;
    if (reads(p) && !(texture->image = source = hg_image_source_create(""))) {
        fail(p, HG_E_NOMEM, "no memory");
        return;
    }
    pack_text(p, &source->label);
    if (kind == SOURCE_ENCODED)
        pack_encoded(p, source);
    else if (kind == SOURCE_PIXELS)
        pack_pixels(p, source);
}

static void pack_texture(struct hg_pack *p, struct hg_texture *t)
{
    pack_name(p, &t->head.name);
    t->wrap_s = pack_choice(p, t->wrap_s, HG_WRAP_MIRROR + 1);
    t->wrap_t = pack_choice(p, t->wrap_t, HG_WRAP_MIRROR + 1);
    pack_source(p, t);
}

static void pack_material(struct hg_pack *p, struct hg_material *m)
{
    struct hg_asset *a = p->asset;
    pack_name(p, &m->head.name);
    pack_floats(p, m->base_color, 4, 0, 1);
    pack_floats(p, &m->metallic, 1, 0, 1);
    pack_floats(p, &m->roughness, 1, 0, 1);
    pack_floats(p, m->emissive, 3, 0, FLT_MAX);
    m->alpha_mode = pack_choice(p, m->alpha_mode, HG_ALPHA_BLEND + 1);
    m->double_sided = pack_bool(p, m->double_sided);
    for (int i = 0; i < HG_SLOT_COUNT && goes_on(p); i++) {
        struct hg_texture_ref *slot = &m->slots[i];
        slot->texture = REFERENCE(p, slot->texture, a->textures, a->texture_count);
        if (slot->texture)
            slot->uv_set = pack_choice(p, slot->uv_set, 2);
    }
}

// ---- lights and cameras ------------------------------------------------------------------------

static void pack_light(struct hg_pack *p, struct hg_light *l)
{
    const char *lacks;
    pack_name(p, &l->head.name);
    l->kind = pack_choice(p, l->kind, HG_LIGHT_TUBE + 1);
    pack_floats(p, l->color, 3, 0, FLT_MAX);
    pack_floats(p, &l->intensity, 1, 0, FLT_MAX);
    pack_floats(p, &l->inner_cone_rad, 1, 0, 1.6f);
    pack_floats(p, &l->outer_cone_rad, 1, 0, 1.6f);
    pack_floats(p, &l->radius, 1, 0, HG_LIGHT_MOST_SIZE_M);
    pack_floats(p, &l->width, 1, 0, HG_LIGHT_MOST_SIZE_M);
    pack_floats(p, &l->height, 1, 0, HG_LIGHT_MOST_SIZE_M);
    require(p, l->inner_cone_rad <= l->outer_cone_rad, "a cone");
    require(p, hg_light_has_size(l, &lacks), "the size of a light");
}

static void pack_camera(struct hg_pack *p, struct hg_camera *c)
{
    pack_name(p, &c->head.name);
    c->kind = pack_choice(p, c->kind, HG_CAMERA_ORTHOGRAPHIC + 1);
    pack_floats(p, &c->vfov_rad, 1, 1e-6f, 3.1415f);
    pack_floats(p, &c->half_height, 1, FLT_MIN, FLT_MAX);
    pack_floats(p, &c->aspect, 1, 0, FLT_MAX);
    pack_floats(p, &c->near, 1, FLT_MIN, FLT_MAX);
    pack_floats(p, &c->far, 1, 0, FLT_MAX);
}

// ---- nodes and skins ---------------------------------------------------------------------------

static void pack_skin(struct hg_pack *p, struct hg_skin *skin)
{
    struct hg_asset *a = p->asset;
    uint32_t count = skin->joint_count;
    pack_count(p, &count, 4 + sizeof *skin->inverse_bind, 0);
    require(p, count <= UINT16_MAX, "a count");
    if (reads(p)) {
        skin->joints = take(p, count, sizeof *skin->joints);
        skin->inverse_bind = take(p, count, sizeof *skin->inverse_bind);
        skin->joint_count = skin->inverse_bind ? count : 0;
    }
    for (uint32_t i = 0; i < skin->joint_count && goes_on(p); i++) {
        skin->joints[i] = REFERENCE(p, skin->joints[i], a->nodes, a->node_count);
        require(p, skin->joints[i] != NULL, "a joint");
        pack_floats(p, skin->inverse_bind[i], 16, -FLT_MAX, FLT_MAX);
    }
}

static bool is_unit(const float q[4])
{
    const float n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    return n > 0.99f && n < 1.01f;
}

static void pack_pose(struct hg_pack *p, struct hg_node *node)
{
    node->has_matrix = pack_bool(p, node->has_matrix);
    if (node->has_matrix) {
        const float *m = node->matrix;
        pack_floats(p, node->matrix, 16, -FLT_MAX, FLT_MAX);
        require(p, m[3] == 0 && m[7] == 0 && m[11] == 0 && m[15] == 1, "a matrix");
        return;
    }
    pack_floats(p, node->translation, 3, -FLT_MAX, FLT_MAX);
    pack_floats(p, node->rotation, 4, -1.01f, 1.01f);
    pack_floats(p, node->scale, 3, -FLT_MAX, FLT_MAX);
    require(p, is_unit(node->rotation), "a rotation");
}

// The parent is an earlier node, so there is no cycle; children keep their order.
static void pack_parent(struct hg_pack *p, struct hg_node *node)
{
    const uint32_t index = (uint32_t)node->head.id;
    struct hg_node *parent = REFERENCE(p, node->parent, p->asset->nodes, index);
    if (!reads(p) || !goes_on(p) || !parent)
        return;
    struct family *family = &p->families[(uint32_t)parent->head.id];
    p->families[index].depth = family->depth + 1;
    require(p, family->depth < MOST_DEPTH, "the depth of the hierarchy");
    node->parent = parent;
    if (family->last_child)
        family->last_child->next_sibling = node;
    else
        parent->first_child = node;
    family->last_child = node;
}

static void pack_node_skin(struct hg_pack *p, struct hg_node *node)
{
    struct hg_asset *a = p->asset;
    uint32_t index = NONE;
    for (uint32_t i = 0; !reads(p) && node->skin && i < a->skin_count; i++)
        index = a->skins[i] == node->skin ? i : index;
    pack_u32(p, &index);
    require(p, index == NONE || (index < a->skin_count && node->mesh), "a reference");
    if (reads(p) && goes_on(p) && index != NONE)
        node->skin = a->skins[index];
}

static void pack_node(struct hg_pack *p, struct hg_node *node)
{
    struct hg_asset *a = p->asset;
    pack_name(p, &node->head.name);
    pack_parent(p, node);
    pack_pose(p, node);
    node->visible = pack_bool(p, node->visible);
    node->mesh = REFERENCE(p, node->mesh, a->meshes, a->mesh_count);
    node->light = REFERENCE(p, node->light, a->lights, a->light_count);
    node->camera = REFERENCE(p, node->camera, a->cameras, a->camera_count);
    pack_node_skin(p, node);
    const uint32_t targets = reads(p) && goes_on(p) && node->mesh ? node->mesh->target_count : 0;
    if (targets > 0 && (node->weights = take(p, targets, sizeof *node->weights)))
        memcpy(node->weights, node->mesh->weights, targets * sizeof *node->weights);
}

static void pack_nodes(struct hg_pack *p)
{
    struct hg_asset *a = p->asset;
    p->families = reads(p) ? take(p, a->node_count, sizeof *p->families) : NULL;
    for (uint32_t i = 0; i < a->node_count && goes_on(p); i++)
        pack_node(p, a->nodes[i]);
    hg_free(p->families);
}

// Every joint that a skinned vertex names is one of the node's skin.
static void check_skins(struct hg_pack *p)
{
    const struct hg_asset *a = p->asset;
    for (uint32_t n = 0; n < a->node_count && goes_on(p); n++) {
        const struct hg_node *node = a->nodes[n];
        for (uint32_t i = 0; node->skin && i < node->mesh->part_count; i++) {
            const struct hg_mesh_part *part = &node->mesh->parts[i];
            uint32_t most = 0;
            for (uint64_t k = 0; part->joints && k < (uint64_t)part->vertex_count * 4; k++)
                most = part->joints[k] > most ? part->joints[k] : most;
            require(p, most < node->skin->joint_count, "a joint");
        }
    }
}

// ---- animations --------------------------------------------------------------------------------

static void check_keys(struct hg_pack *p, const struct hg_anim_channel *c)
{
    bool sound = true;
    for (uint32_t k = 0; k < c->key_count; k++) {
        sound &= k == 0 || c->times[k] > c->times[k - 1];
        sound &= c->path != HG_ANIM_ROTATION || is_unit(c->values + (size_t)k * 4);
    }
    require(p, sound, "a key");
}

static void pack_channel(struct hg_pack *p, struct hg_anim_channel *c)
{
    struct hg_asset *a = p->asset;
    c->node = REFERENCE(p, c->node, a->nodes, a->node_count);
    c->path = pack_choice(p, c->path, HG_ANIM_WEIGHTS + 1);
    const bool morphs = c->path == HG_ANIM_WEIGHTS;
    require(p, c->node && (morphs ? c->node->weights != NULL : !c->node->has_matrix), "a channel");
    if (!goes_on(p))
        return;
    c->interpolation = HG_ANIM_LINEAR;
    c->width = morphs ? c->node->mesh->target_count : c->path == HG_ANIM_ROTATION ? 4 : 3;
    uint32_t count = c->key_count;
    pack_count(p, &count, (1 + c->width) * sizeof(float), 0);
    pack_vertices(p, &c->times, count, 1, -FLT_MAX, FLT_MAX);
    pack_vertices(p, &c->values, count, c->width, -FLT_MAX, FLT_MAX);
    c->key_count = goes_on(p) ? count : 0;
    if (reads(p) && goes_on(p))
        check_keys(p, c);
}

static void pack_animation(struct hg_pack *p, struct hg_animation *animation)
{
    pack_name(p, &animation->name);
    pack_f64(p, &animation->duration_s);
    require(p, animation->duration_s >= 0, "a duration");
    uint32_t count = animation->channel_count;
    pack_count(p, &count, 12, 0);
    if (reads(p)) {
        animation->channels = take(p, count, sizeof *animation->channels);
        animation->channel_count = animation->channels ? count : 0;
    }
    for (uint32_t i = 0; i < animation->channel_count && goes_on(p); i++)
        pack_channel(p, &animation->channels[i]);
}

static void pack_animations(struct hg_pack *p)
{
    struct hg_asset *a = p->asset;
    uint32_t count = a->animation_count;
    pack_count(p, &count, 16, 0);
    if (reads(p)) {
        a->animations = take(p, count, sizeof *a->animations);
        a->animation_count = a->animations ? count : 0;
    }
    for (uint32_t i = 0; i < a->animation_count && goes_on(p); i++)
        pack_animation(p, &a->animations[i]);
}

// ---- the whole ---------------------------------------------------------------------------------

static void pack_file(struct hg_pack *p)
{
    struct hg_asset *a = p->asset;
    pack_fixed(p, a->file.format, sizeof a->file.format);
    pack_fixed(p, a->file.version, sizeof a->file.version);
    pack_fixed(p, a->file.generator, sizeof a->file.generator);
    pack_fixed(p, a->file.copyright, sizeof a->file.copyright);
}

// How many objects of each kind follow; reading makes them.
static void pack_objects(struct hg_pack *p)
{
    struct hg_asset *a = p->asset;
#define OBJECTS(one, many, least)                                                                  \
    do {                                                                                           \
        uint32_t count = a->many##_count;                                                          \
        pack_count(p, &count, least, sizeof(struct hg_##one));                                     \
        for (uint32_t i = 0; reads(p) && goes_on(p) && i < count; i++)                             \
            if (!hg_asset_add_##one(a ADDED))                                                      \
                fail(p, HG_E_NOMEM, "no memory");                                                  \
    } while (0)
#define ADDED , NULL
    OBJECTS(texture, texture, 16);
    OBJECTS(material, material, 44);
    OBJECTS(light, light, 40);
    OBJECTS(camera, camera, 28);
    OBJECTS(mesh, mesh, 8);
    OBJECTS(node, node, 68);
#undef ADDED
#define ADDED
    OBJECTS(skin, skin, 4);
#undef ADDED
#undef OBJECTS
}

static void pack_roots(struct hg_pack *p)
{
    struct hg_asset *a = p->asset;
    uint32_t count = a->root_count;
    pack_count(p, &count, 4, 0);
    if (reads(p)) {
        a->roots = take(p, count, sizeof *a->roots);
        a->root_count = a->roots ? count : 0;
    }
    for (uint32_t i = 0; i < a->root_count && goes_on(p); i++) {
        a->roots[i] = REFERENCE(p, a->roots[i], a->nodes, a->node_count);
        require(p, a->roots[i] && !a->roots[i]->parent, "a root");
        require(
            p, !goes_on(p) || i == 0 || a->roots[i]->head.id > a->roots[i - 1]->head.id, "a root");
    }
}

static void pack_warnings(struct hg_pack *p)
{
    struct hg_asset *a = p->asset;
    uint32_t count = a->warning_count;
    pack_count(p, &count, 8, 0);
    require(p, count <= HG_ASSET_MAX_WARNINGS, "a count");
    for (uint32_t i = 0; i < count && goes_on(p); i++) {
        struct hg_warning read = {0}, *w = reads(p) ? &read : &a->warnings[i];
        pack_fixed(p, w->where, sizeof w->where);
        pack_fixed(p, w->reason, sizeof w->reason);
        if (reads(p) && goes_on(p))
            hg_asset_warn_text(a, w->where, w->reason);
    }
}

static void pack_asset(struct hg_pack *p)
{
    struct hg_asset *a = p->asset;
    uint32_t version = VERSION;
    pack_u32(p, &version);
    require(p, version == VERSION, "the version");
    pack_file(p);
    pack_objects(p);
    for (uint32_t i = 0; i < a->texture_count && goes_on(p); i++)
        pack_texture(p, a->textures[i]);
    for (uint32_t i = 0; i < a->material_count && goes_on(p); i++)
        pack_material(p, a->materials[i]);
    for (uint32_t i = 0; i < a->light_count && goes_on(p); i++)
        pack_light(p, a->lights[i]);
    for (uint32_t i = 0; i < a->camera_count && goes_on(p); i++)
        pack_camera(p, a->cameras[i]);
    for (uint32_t i = 0; i < a->mesh_count && goes_on(p); i++)
        hg_asset_pack_mesh(p, a->meshes[i]);
    for (uint32_t i = 0; i < a->skin_count && goes_on(p); i++)
        pack_skin(p, a->skins[i]);
    pack_nodes(p);
    pack_animations(p);
    pack_roots(p);
    pack_warnings(p);
    if (reads(p))
        check_skins(p);
    require(p, p->in.pos == p->in.size, "the end");
}

void hg_asset_pack(struct hg_asset *asset, struct hg_writer *out)
{
    struct hg_pack p = {.out = out, .asset = asset};
    pack_asset(&p);
}

enum hg_status hg_asset_unpack(
    const struct hg_asset_unpack *params, struct hg_asset **out, struct hg_error *err)
{
    struct hg_pack p = {.in = hg_reader_make(params->data, params->size),
        .left_bytes = params->memory_limit_bytes,
        .asset = hg_asset_create(params->asset_number, params->label)};
    *out = NULL;
    if (!p.asset)
        return hg_error_set(err, HG_E_NOMEM, params->label, NULL, "no memory");
    pack_asset(&p);
    if (p.in.failed && !p.status)
        fail(&p, HG_E_FORMAT, "a length");
    if (!p.status) {
        *out = p.asset;
        return HG_OK;
    }
    hg_asset_destroy(p.asset);
    if (p.status != HG_E_FORMAT)
        return hg_error_set(err, p.status, params->label, NULL, "%s", p.wrong);
    char where[32];
    snprintf(where, sizeof where, "byte %zu", p.in.pos);
    return hg_error_set(err, HG_E_FORMAT, params->label, where,
        "what its reader made of it is unsound: %s", p.wrong);
}
