#include "renderer/scene/fingerprint.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/sha256.h"
#include "renderer/scene/light_table.h"

enum { PIECES = 64, PIECE_BYTES = 64 << 10, WHOLE_BYTES = 64 << 20, FIRST_ENTRIES = 256 };

struct entry { // of an object that has been hashed; id 0 = free
    uint64_t id, revision;
    enum hg_object_kind kind;
    uint8_t hash[32];
};

struct hg_fingerprint {
    struct entry *entries; // open addressing, at most half full
    size_t capacity, used;
};

struct hg_fingerprint *hg_fingerprint_create(void)
{
    return hg_calloc(1, sizeof(struct hg_fingerprint));
}

void hg_fingerprint_destroy(struct hg_fingerprint *f)
{
    if (f)
        hg_free(f->entries);
    hg_free(f);
}

// ---- what is remembered ------------------------------------------------------------------------

static size_t slot_of(const struct hg_fingerprint *f, enum hg_object_kind kind, uint64_t id)
{
    uint64_t mixed = (id + (uint64_t)kind) * 0x9e3779b97f4a7c15u;
    size_t at = (size_t)(mixed >> 20) & (f->capacity - 1);
    while (f->entries[at].id && (f->entries[at].id != id || f->entries[at].kind != kind))
        at = (at + 1) & (f->capacity - 1);
    return at;
}

static enum hg_status grow(struct hg_fingerprint *f)
{
    struct hg_fingerprint larger = {.capacity = f->capacity ? 2 * f->capacity : FIRST_ENTRIES};
    if (2 * (f->used + 1) <= f->capacity)
        return HG_OK;
    larger.entries = hg_calloc(larger.capacity, sizeof *larger.entries);
    if (!larger.entries)
        return HG_E_NOMEM;
    for (size_t i = 0; i < f->capacity; i++)
        if (f->entries[i].id)
            larger.entries[slot_of(&larger, f->entries[i].kind, f->entries[i].id)] = f->entries[i];
    hg_free(f->entries);
    f->entries = larger.entries;
    f->capacity = larger.capacity;
    return HG_OK;
}

// ---- hashing of parts --------------------------------------------------------------------------

static void add_u64(struct hg_sha256 *h, uint64_t value)
{
    uint8_t bytes[8];
    for (int i = 0; i < 8; i++)
        bytes[i] = (uint8_t)(value >> 8 * i);
    hg_sha256_update(h, bytes, sizeof bytes);
}

// An array that may be absent; its length goes first.
static void add_array(struct hg_sha256 *h, const void *data, uint64_t count, size_t size)
{
    add_u64(h, data ? count + 1 : 0);
    if (data)
        hg_sha256_update(h, data, (size_t)count * size);
}

static void add_text(struct hg_sha256 *h, const char *text)
{
    add_array(h, text, text ? strlen(text) : 0, 1);
}

// How far apart the pieces lie that count of a file: of a large one not all of it does.
static size_t step_of(size_t size)
{
    return size > WHOLE_BYTES ? (size - PIECE_BYTES) / (PIECES - 1) : PIECE_BYTES;
}

static enum hg_status add_piece(
    struct hg_sha256 *h, int fd, off_t at, uint8_t *buffer, const char *path, struct hg_error *err)
{
    ssize_t n = pread(fd, buffer, PIECE_BYTES, at);
    if (n < 0)
        return hg_error_set(
            err, hg_status_from_errno(errno), path, NULL, "cannot read: %s", strerror(errno));
    hg_sha256_update(h, buffer, (size_t)n);
    return HG_OK;
}

static enum hg_status add_open_file(
    struct hg_sha256 *h, int fd, const char *path, struct hg_error *err)
{
    struct stat st;
    uint8_t *buffer = hg_calloc(1, PIECE_BYTES);
    if (!buffer)
        return hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory to read it");
    enum hg_status status = HG_OK;
    if (fstat(fd, &st))
        status = hg_error_set(
            err, hg_status_from_errno(errno), path, NULL, "cannot read: %s", strerror(errno));
    off_t size = status ? 0 : st.st_size;
    off_t step = (off_t)step_of((size_t)size);
    add_u64(h, (uint64_t)size);
    for (off_t at = 0; !status && at < size; at += step)
        status = add_piece(h, fd, at, buffer, path, err);
    hg_free(buffer);
    return status;
}

static enum hg_status add_file(struct hg_sha256 *h, const char *path, struct hg_error *err)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) { // drawn white, as it will be found to be
        add_text(h, "gone");
        return HG_OK;
    }
    enum hg_status status = add_open_file(h, fd, path, err);
    close(fd);
    return status;
}

// A file that was sent or lies inside of another counts as one that lies on its own.
static void add_encoded(struct hg_sha256 *h, const struct hg_refbuf *file)
{
    const size_t step = step_of(file->size);
    add_u64(h, file->size);
    for (size_t at = 0; at < file->size; at += step)
        hg_sha256_update(
            h, file->data + at, file->size - at < PIECE_BYTES ? file->size - at : PIECE_BYTES);
}

static enum hg_status add_image(
    struct hg_sha256 *h, const struct hg_image_source *image, struct hg_error *err)
{
    if (!image) {
        add_u64(h, 0);
        return HG_OK;
    }
    add_u64(h, 1 + (uint64_t)image->pixels_srgb);
    add_u64(h, (uint64_t)image->pixels.width << 32 | image->pixels.height);
    add_u64(h, (uint64_t)image->pixels.format);
    add_array(h, image->pixels.pixels, image->pixels.size_bytes, 1);
    add_array(h, image->tiles ? image->tiles->id : NULL, 32, 1);
    if (image->encoded)
        add_encoded(h, image->encoded);
    return image->path ? add_file(h, image->path, err) : HG_OK;
}

// ---- objects, each hashed once -----------------------------------------------------------------

struct work {
    struct hg_fingerprint *f;
    struct hg_error *err;
};

typedef enum hg_status object_fn(const struct work *w, const void *object, struct hg_sha256 *h);

// Adds the hash of an object, or of nothing, made with `add` unless it is known.
static enum hg_status add_object(const struct work *w, struct hg_sha256 *h,
    enum hg_object_kind kind, const struct hg_object *object, object_fn *add)
{
    if (!object) {
        add_u64(h, 0);
        return HG_OK;
    }
    if (grow(w->f))
        return HG_E_NOMEM;
    struct entry *known = &w->f->entries[slot_of(w->f, kind, object->id)];
    if (known->id && known->revision == object->revision) {
        hg_sha256_update(h, known->hash, sizeof known->hash);
        return HG_OK;
    }
    struct entry made = {.id = object->id, .revision = object->revision, .kind = kind};
    struct hg_sha256 *own = hg_sha256_create();
    if (!own)
        return HG_E_NOMEM;
    add_text(own, object->name);
    enum hg_status status = add(w, object, own);
    hg_sha256_end(own, made.hash);
    if (!status && !(status = grow(w->f))) {
        known = &w->f->entries[slot_of(w->f, kind, object->id)];
        w->f->used += known->id == 0;
        *known = made;
        hg_sha256_update(h, made.hash, sizeof made.hash);
    }
    return status;
}

static enum hg_status add_texture(const struct work *w, const void *object, struct hg_sha256 *h)
{
    const struct hg_texture *t = object;
    add_u64(h, (uint64_t)t->wrap_s | (uint64_t)t->wrap_t << 8 | (uint64_t)t->mag_nearest << 16 |
                   (uint64_t)t->min_nearest << 17 | (uint64_t)t->mip_nearest << 18 |
                   (uint64_t)t->mip_none << 19);
    return add_image(h, t->image, w->err);
}

// Frame keys, which outlive a process, contain these bytes: neither order nor padding may change.
static void add_material_values(struct hg_sha256 *h, const struct hg_material *m)
{
    const float *base = m->base_color, *emissive = m->emissive, *specular = m->specular.color;
    const float *sheen = m->sheen.color, *tint = m->volume.attenuation_color;
    const float *through = m->diffuse_transmission.color;
    const float surface[] = {base[0], base[1], base[2], base[3], m->metallic, m->roughness,
        emissive[0], emissive[1], emissive[2], m->normal_scale, m->occlusion_strength};
    const uint32_t alpha_mode = m->alpha_mode;
    const uint8_t flags[4] = {m->double_sided, m->unlit};
    const float lobes[] = {m->ior, m->specular.factor, specular[0], specular[1], specular[2],
        m->clearcoat.factor, m->clearcoat.roughness, m->clearcoat.normal_scale, sheen[0], sheen[1],
        sheen[2], m->sheen.roughness, m->transmission, m->volume.thickness,
        m->volume.attenuation_distance, tint[0], tint[1], tint[2], m->dispersion,
        m->iridescence.factor, m->iridescence.ior, m->iridescence.thickness_min_nm,
        m->iridescence.thickness_max_nm, m->anisotropy.strength, m->anisotropy.rotation_rad,
        m->diffuse_transmission.factor, through[0], through[1], through[2]};
    const uint8_t extensions[4] = {m->specular.is_set, m->has_ior};
    hg_sha256_update(h, surface, sizeof surface);
    hg_sha256_update(h, &alpha_mode, sizeof alpha_mode);
    hg_sha256_update(h, &m->alpha_cutoff, sizeof m->alpha_cutoff);
    hg_sha256_update(h, flags, sizeof flags);
    hg_sha256_update(h, lobes, sizeof lobes);
    hg_sha256_update(h, extensions, sizeof extensions);
}

static enum hg_status add_material(const struct work *w, const void *object, struct hg_sha256 *h)
{
    const struct hg_material *m = object;
    enum hg_status status = HG_OK;
    add_material_values(h, m);
    for (int i = 0; !status && i < HG_SLOT_COUNT; i++) {
        const struct hg_texture_ref *slot = &m->slots[i];
        if (!slot->texture)
            continue;
        add_u64(h, (uint64_t)i << 32 | slot->uv_set);
        hg_sha256_update(h, slot->uv_transform, sizeof slot->uv_transform);
        status = add_object(w, h, HG_OBJECT_TEXTURE, &slot->texture->head, add_texture);
    }
    return status;
}

static void add_targets(
    struct hg_sha256 *h, const struct hg_mesh *mesh, const struct hg_mesh_part *p)
{
    for (uint32_t t = 0; p->targets && t < mesh->target_count; t++) {
        add_array(h, p->targets[t].positions, p->vertex_count, 12);
        add_array(h, p->targets[t].normals, p->vertex_count, 12);
        add_array(h, p->targets[t].tangents, p->vertex_count, 12);
    }
}

static enum hg_status add_mesh(const struct work *w, const void *object, struct hg_sha256 *h)
{
    const struct hg_mesh *mesh = object;
    (void)w;
    add_u64(h, (uint64_t)mesh->part_count << 32 | mesh->target_count);
    for (uint32_t i = 0; i < mesh->part_count; i++) {
        const struct hg_mesh_part *p = &mesh->parts[i];
        add_u64(h, (uint64_t)p->topology << 32 | p->joint_sets);
        add_array(h, p->indices, p->index_count, 4);
        add_array(h, p->positions, p->vertex_count, 12);
        add_array(h, p->normals, p->vertex_count, 12);
        add_array(h, p->tangents, p->vertex_count, 16);
        add_array(h, p->uv[0], p->vertex_count, 8);
        add_array(h, p->uv[1], p->vertex_count, 8);
        add_array(h, p->colors, p->vertex_count, 16);
        add_array(h, p->joints, (uint64_t)p->vertex_count * p->joint_sets, 8);
        add_array(h, p->weights, (uint64_t)p->vertex_count * p->joint_sets, 16);
        add_targets(h, mesh, p);
    }
    return HG_OK;
}

// ---- nodes: always --------------------------------------------------------------------------

static enum hg_status add_drawn(
    const struct work *w, struct hg_sha256 *h, const struct hg_node *node)
{
    const struct hg_mesh *mesh = node->mesh;
    enum hg_status status = add_object(w, h, HG_OBJECT_MESH, &mesh->head, add_mesh);
    for (uint32_t i = 0; !status && i < mesh->part_count; i++) {
        const struct hg_mesh_part *part = &mesh->parts[i];
        const struct hg_material *m =
            node->asset ? hg_asset_part_material(node->asset, part) : part->material;
        status = add_object(w, h, HG_OBJECT_MATERIAL, m ? &m->head : NULL, add_material);
    }
    add_array(h, node->weights ? node->weights : mesh->weights, mesh->target_count, 4);
    add_array(h, node->instances, node->instance_count, 64);
    const struct hg_skin *skin = node->skin;
    add_u64(h, skin ? skin->joint_count : 0);
    for (uint32_t i = 0; skin && i < skin->joint_count; i++) {
        hg_sha256_update(h, skin->joints[i]->world, sizeof skin->joints[i]->world);
        hg_sha256_update(h, skin->inverse_bind[i], 64);
    }
    return status;
}

static void add_light(struct hg_sha256 *h, const struct hg_light *l)
{
    add_u64(h, (uint64_t)l->kind << 1 | (uint64_t)l->casts_shadow);
    hg_sha256_update(h, l->color, sizeof l->color);
    const float values[] = {l->intensity, l->range, l->inner_cone_rad, l->outer_cone_rad};
    hg_sha256_update(h, values, sizeof values);
    const float sizes[] = {l->radius, l->width, l->height, l->angular_diameter_rad};
    if (l->kind > HG_LIGHT_SPOT || l->radius > 0 || l->angular_diameter_rad > 0)
        hg_sha256_update(h, sizes, sizeof sizes);
    const struct hg_light_table *tables[] = {l->profile, l->image};
    for (int i = 0; i < 2; i++)
        if (tables[i]) {
            add_u64(h, (uint64_t)i);
            hg_sha256_update(h, tables[i]->words, (size_t)tables[i]->word_count * 4);
        }
    if (l->lumens > 0 || l->profile || l->image)
        hg_sha256_update(h, (float[]){hg_light_peak(l), l->width, l->height}, 3 * sizeof(float));
}

static enum hg_status add_node(
    const struct work *w, struct hg_sha256 *h, const struct hg_node *node)
{
    if (!node->world_visible || (!node->mesh && !node->light))
        return HG_OK;
    add_text(h, node->head.name);
    hg_sha256_update(h, node->world, sizeof node->world);
    const struct hg_node *catcher = node;
    while (catcher && !catcher->catches_shadows)
        catcher = catcher->parent;
    if (catcher)
        add_text(h, "catches shadows");
    if (node->light)
        add_light(h, node->light);
    return node->mesh ? add_drawn(w, h, node) : HG_OK;
}

static void add_environment(struct hg_sha256 *h, const struct hg_environment *e)
{
    add_u64(h, (uint64_t)e->kind);
    hg_sha256_update(h, e->image_hash, e->kind == HG_ENV_IMAGE ? sizeof e->image_hash : 0);
    hg_sha256_update(h, e->color, e->kind == HG_ENV_COLOR ? sizeof e->color : 0);
    const float values[] = {e->intensity, e->rotation_rad};
    hg_sha256_update(h, values, sizeof values);
    if (e->kind == HG_ENV_SKY) {
        hg_sha256_update(h, e->sun_direction, sizeof e->sun_direction);
        hg_sha256_update(h, &e->turbidity, sizeof e->turbidity);
        if (e->sun != HG_SKY_SUN_AUTO) // other skies keep their fingerprints
            add_u64(h, (uint64_t)e->sun);
    }
}

enum hg_status hg_fingerprint_scene(struct hg_fingerprint *fingerprint,
    const struct hg_scene *scene, uint8_t hash[32], struct hg_error *err)
{
    struct hg_error inner = {0};
    struct work w = {.f = fingerprint, .err = &inner};
    struct hg_sha256 *h = hg_sha256_create();
    if (!h)
        return hg_error_set(err, HG_E_NOMEM, "scene", NULL, "no memory for its hash");
    enum hg_status status = HG_OK;
    add_environment(h, &scene->environment);
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; !status && i < nodes->count; i++)
        status = add_node(&w, h, (const struct hg_node *)nodes->items[i]);
    hg_sha256_end(h, hash);
    if (!status)
        return HG_OK;
    memset(hash, 0, 32);
    if (inner.status) {
        if (err)
            *err = inner;
        return status;
    }
    return hg_error_set(err, status, "scene", NULL, "no memory for its hash");
}
