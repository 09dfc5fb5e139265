// geometry.c - brings the device in line with a scene. See geometry.h.
//
// A sync first compares a signature of everything it reads; when it differs, lists are made anew
// and the device gets what differs: meshes by {id, revision}, poses by their bytes, tables by
// pieces. New sizes are checked against the budget before anything is taken or dropped.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/cond.h"
#include "base/mix.h"
#include "base/spill.h"
#include "renderer/geometry/internal.h"

enum hg_status hg_geometry_create(struct hg_gpu *gpu, const struct hg_geometry_params *params,
    struct hg_geometry **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_geometry *g = hg_calloc(1, sizeof *g);
    if (g == NULL)
        return hg_error_set(err, HG_E_NOMEM, "geometry", NULL, "no memory");
    g->gpu = gpu;
    if (params != NULL)
        g->params = *params;
    g->draw_table.name = "draws";
    g->instance_table.name = "instances";
    g->part_table.name = "parts";
    g->material_table.name = "materials";
    g->lobe_table.name = "material lobes";
    g->bounds = hg_box_empty();
    enum hg_status status = HG_OK;
    if (g->params.jobs != NULL && g->params.bake_from != HG_GEOMETRY_BAKE_NONE) {
        status = hg_cluster_pool_create(gpu, &g->pool, err);
        if (status == HG_OK)
            status = hg_baker_create(g->params.store, g->params.jobs, &g->baker, err);
    }
    if (status != HG_OK) {
        hg_geometry_destroy(g);
        return status;
    }
    *out = g;
    return HG_OK;
}

void hg_geometry_destroy(struct hg_geometry *g)
{
    if (g == NULL)
        return;
    hg_baker_destroy(g->baker);
    for (uint32_t i = 0; i < g->mesh_count; i++)
        hg_mesh_entry_finish(g->gpu, g->pool, &g->meshes[i]);
    for (uint32_t i = 0; i < g->deform_count; i++)
        hg_deform_finish(g->gpu, &g->deforms[i]);
    hg_facets_finish(g->gpu, &g->facets);
    hg_table_finish(g->gpu, &g->draw_table);
    hg_table_finish(g->gpu, &g->instance_table);
    hg_table_finish(g->gpu, &g->part_table);
    hg_table_finish(g->gpu, &g->material_table);
    hg_table_finish(g->gpu, &g->lobe_table);
    hg_free(g->meshes);
    hg_free(g->deforms);
    hg_free(g->changed);
    hg_free(g->draws);
    hg_cluster_pool_destroy(g->pool);
    hg_free(g);
}

bool hg_geometry_set_origin(struct hg_geometry *g, const double eye_ws[3])
{
    bool moved = false;
    for (int i = 0; i < 3; i++) {
        if (fabs(eye_ws[i] - g->origin[i]) <= 0.75 * HG_GEOMETRY_ORIGIN_STEP)
            continue;
        const double cell = round(eye_ws[i] / HG_GEOMETRY_ORIGIN_STEP) * HG_GEOMETRY_ORIGIN_STEP;
        moved = moved || cell != g->origin[i];
        g->origin[i] = cell;
    }
    return moved;
}

void hg_geometry_origin(const struct hg_geometry *g, double out[3])
{
    memcpy(out, g->origin, sizeof g->origin);
}

// --- signature -----------------------------------------------------------------------------------

// Nodes: where things are and what they look like from afar; without materials.
static uint64_t shape_signature(const struct hg_geometry *g, const struct hg_scene *scene)
{
    uint64_t h = 1;
    for (int i = 0; i < 3; i++)
        h = hg_mix(h, (uint64_t)(int64_t)g->origin[i]);
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++) {
        const struct hg_node *n = (const struct hg_node *)nodes->items[i];
        h = hg_mix_bytes(h, n->world, sizeof n->world); // also of joints, which have no mesh
        if (n->mesh == NULL)
            continue;
        h = hg_mix(h, n->head.id);
        h = hg_mix(h, n->head.revision);
        h = hg_mix(h, n->mesh->head.id);
        h = hg_mix(h, n->mesh->head.revision * 2 + n->world_visible);
        if (n->weights != NULL)
            h = hg_mix_bytes(h, n->weights, n->mesh->target_count * sizeof *n->weights);
    }
    return h | 1;
}

static uint64_t material_signature(const struct hg_scene *scene, const struct hg_textures *textures)
{
    uint64_t h = textures != NULL ? hg_textures_revision(textures) : 0;
    const struct hg_object_list *list = &scene->objects[HG_OBJECT_MATERIAL];
    for (uint32_t i = 0; i < list->count; i++) {
        h = hg_mix(h, list->items[i]->id);
        h = hg_mix(h, list->items[i]->revision);
    }
    for (uint32_t i = 0; i < scene->asset_count; i++)
        h = hg_mix(
            h, (uint64_t)scene->assets[i]->number << 32 | (uint32_t)scene->assets[i]->variant);
    return h;
}

// --- lists of one sync ---------------------------------------------------------------------------

struct material_index {
    uint64_t id;
    uint32_t index;
};

struct sync {
    struct hg_geometry *g;
    const struct hg_scene *scene;
    const struct hg_textures *textures;
    struct hg_mesh_entry *meshes; // the new list by id; entries that stay share their memory with g
    uint32_t mesh_count;
    struct hg_deform_entry *deforms; // likewise, by node id and part
    size_t deform_capacity;
    uint32_t deform_count;
    struct hg_gpu_material *materials; // [0] is the default material
    struct material_index *material_ids;
    uint32_t material_count;
    struct hg_gpu_lobes *lobes; // of the materials that have some
    uint32_t lobe_count;
    bool one_shape; // of the textures of each material
    struct hg_gpu_instance *instances;
    uint32_t instance_count, instance_limit;
    struct hg_draw_entry *draws;
    uint32_t draw_count, draw_limit;
    struct hg_gpu_part *parts;
    uint32_t part_count;
    struct hg_gpu_draw *gpu_draws;
    struct hg_box bounds;
    uint64_t bit_layout;
    uint32_t bit_count;
    uint64_t written, triangles, used_bytes;
    uint32_t uploads;
    bool looks; // at arrays of meshes, which may be spilled
};

static enum hg_status out_of_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "geometry", NULL, "no memory");
}

static int compare_meshes(const void *a, const void *b)
{
    const struct hg_mesh_entry *x = a, *y = b;
    return x->id < y->id ? -1 : x->id > y->id;
}

static int compare_deforms(const void *a, const void *b)
{
    const struct hg_deform_entry *x = a, *y = b;
    if (x->node != y->node)
        return x->node < y->node ? -1 : 1;
    return x->part < y->part ? -1 : x->part > y->part;
}

static int compare_materials(const void *a, const void *b)
{
    const struct material_index *x = a, *y = b;
    return x->id < y->id ? -1 : x->id > y->id;
}

static struct hg_mesh_entry *find_mesh(struct hg_mesh_entry *list, uint32_t count, uint64_t id)
{
    const struct hg_mesh_entry key = {.id = id};
    return count > 0 ? bsearch(&key, list, count, sizeof key, compare_meshes) : NULL;
}

static struct hg_deform_entry *find_deform(
    struct hg_deform_entry *list, uint32_t count, uint64_t node, uint32_t part)
{
    const struct hg_deform_entry key = {.node = node, .part = part};
    return count > 0 ? bsearch(&key, list, count, sizeof key, compare_deforms) : NULL;
}

static enum hg_status collect_meshes(struct sync *s, struct hg_error *err)
{
    const struct hg_object_list *list = &s->scene->objects[HG_OBJECT_MESH];
    const uint32_t from = hg_baked_from(s->g);
    const struct hg_mesh_entry_limits limits = {
        .number_below = hg_gpu_get_caps(s->g->gpu)->is_cpu ? from : 0, .meshlets_below = from};
    s->meshes = hg_calloc(list->count, sizeof *s->meshes);
    if (s->meshes == NULL)
        return out_of_memory(err);
    for (uint32_t i = 0; i < list->count; i++) {
        const struct hg_mesh *mesh = (const struct hg_mesh *)list->items[i];
        struct hg_mesh_entry *entry = &s->meshes[s->mesh_count];
        const struct hg_mesh_entry *old = find_mesh(s->g->meshes, s->g->mesh_count, mesh->head.id);
        if (old != NULL && old->revision == mesh->head.revision) {
            *entry = *old;
            entry->is_new = false;
        } else {
            if (!s->looks)
                hg_spill_begin();
            s->looks = true;
            const enum hg_status status = hg_mesh_entry_init(entry, mesh, &limits, err);
            if (status != HG_OK)
                return status;
            entry->is_new = true;
        }
        entry->mesh = mesh;
        s->mesh_count++;
    }
    qsort(s->meshes, s->mesh_count, sizeof *s->meshes, compare_meshes);
    return HG_OK;
}

static enum hg_status add_node_deforms(
    struct sync *s, const struct hg_node *node, const struct hg_mesh_entry *mesh)
{
    struct hg_geometry *g = s->g;
    for (uint32_t part = 0; part < mesh->part_count; part++)
        if (mesh->parts[part].clusters != NULL)
            return HG_OK; // has neither joints nor targets
    if (!hg_deform_is_needed(node) && !(g->deform_all && mesh->target_count > 0) &&
        find_deform(g->deforms, g->deform_count, node->head.id, 0) == NULL)
        return HG_OK;
    for (uint32_t part = 0; part < mesh->part_count; part++) {
        const enum hg_status status =
            hg_grow(&s->deforms, &s->deform_capacity, s->deform_count + 1, sizeof *s->deforms);
        if (status != HG_OK)
            return status;
        struct hg_deform_entry fresh;
        hg_deform_init(&fresh, node, part, mesh);
        const struct hg_deform_entry *old =
            find_deform(g->deforms, g->deform_count, node->head.id, part);
        if (old != NULL && old->mesh == fresh.mesh && old->mesh_revision == fresh.mesh_revision &&
            old->joint_count == fresh.joint_count) {
            fresh = *old;
            fresh.source = &mesh->parts[part];
            fresh.is_new = false;
        } else {
            fresh.is_new = true;
        }
        fresh.node_object = node;
        s->deforms[s->deform_count++] = fresh;
    }
    return HG_OK;
}

// Deformations of all visible nodes, and how many draws and instances there will be.
static enum hg_status collect_nodes(struct sync *s, struct hg_error *err)
{
    const struct hg_object_list *list = &s->scene->objects[HG_OBJECT_NODE];
    uint64_t draws = 0, instances = 0;
    for (uint32_t i = 0; i < list->count; i++) {
        const struct hg_node *node = (const struct hg_node *)list->items[i];
        if (node->mesh == NULL || !node->world_visible)
            continue;
        const struct hg_mesh_entry *mesh = find_mesh(s->meshes, s->mesh_count, node->mesh->head.id);
        if (mesh == NULL)
            continue;
        if (add_node_deforms(s, node, mesh) != HG_OK)
            return out_of_memory(err);
        const uint64_t copies = node->instance_count > 0 ? node->instance_count : 1;
        instances += copies;
        draws += copies * mesh->part_count;
    }
    if (draws >= 1u << 28 || instances >= 1u << 28)
        return hg_error_set(err, HG_E_LIMIT, "geometry", NULL, "more than 2^28 draws or instances");
    if (s->deform_count > 0)
        qsort(s->deforms, s->deform_count, sizeof *s->deforms, compare_deforms);
    s->draw_limit = (uint32_t)draws;
    s->instance_limit = (uint32_t)instances;
    s->part_count = s->deform_count;
    for (uint32_t i = 0; i < s->mesh_count; i++)
        s->part_count += s->meshes[i].part_count;
    const struct hg_object_list *materials = &s->scene->objects[HG_OBJECT_MATERIAL];
    s->material_count = materials->count + 1;
    for (uint32_t i = 0; i < materials->count; i++)
        s->lobe_count += hg_material_lobes((const struct hg_material *)materials->items[i]) != 0;
    return HG_OK;
}

static uint64_t bytes_of(const struct sync *s)
{
    uint64_t bytes = s->draw_limit * sizeof(struct hg_gpu_draw) +
                     s->instance_limit * sizeof(struct hg_gpu_instance) +
                     s->part_count * sizeof(struct hg_gpu_part) +
                     s->material_count * sizeof(struct hg_gpu_material) +
                     s->lobe_count * sizeof(struct hg_gpu_lobes);
    bytes += bytes / 2; // tables grow by half
    for (uint32_t i = 0; i < s->mesh_count; i++)
        bytes += s->meshes[i].bytes;
    for (uint32_t i = 0; i < s->deform_count; i++)
        bytes += hg_deform_bytes(&s->deforms[i]);
    return bytes;
}

// What the parts leave of the budget is for chunks; the pool gives back what it has above that, up
// to a block. Returns what it cannot do without.
static uint64_t pool_bytes(struct hg_geometry *g, uint64_t bytes)
{
    struct hg_cluster_pool_stats pool;
    const uint64_t budget = g->params.budget_bytes;
    if (g->pool == NULL)
        return 0;
    hg_geometry_note_peak(g);
    hg_cluster_pool_set_budget(g->pool, budget == 0 ? 0 : budget > bytes ? budget - bytes : 1);
    hg_cluster_pool_stats(g->pool, &pool);
    return pool.root_bytes;
}

static enum hg_status check_budget(struct sync *s, struct hg_error *err)
{
    struct hg_geometry *g = s->g;
    const uint64_t budget = g->params.budget_bytes;
    uint64_t bytes = bytes_of(s), chunks = pool_bytes(g, bytes);
    if (budget > 0 && g->pool != NULL && bytes + chunks > budget) {
        // Not all parts fit as they are: what can have levels is shown by proxies until it has
        // them.
        hg_baked_queue(g, s->meshes, s->mesh_count);
        if (hg_baked_show_proxies(g, s->meshes, s->mesh_count, bytes + chunks) != HG_OK)
            return out_of_memory(err);
        bytes = bytes_of(s);
        chunks = pool_bytes(g, bytes);
    }
    if (budget > 0 && g->pool != NULL && bytes + chunks > budget) { // parts that are shown already
        hg_baked_collect(g, s->meshes, s->mesh_count, HG_COND_FOREVER);
        bytes = bytes_of(s);
        chunks = pool_bytes(g, bytes);
    }
    const uint64_t lost = hg_baked_lost_bytes(s->meshes, s->mesh_count);
    if (lost > 0)
        return hg_error_set(err, HG_E_LIMIT, "geometry budget", NULL,
            "%llu bytes are meshes that could not get levels of detail, the budget is %llu",
            (unsigned long long)lost, (unsigned long long)budget);
    if (budget > 0 && bytes + chunks > budget)
        return hg_error_set(err, HG_E_LIMIT, "geometry budget", NULL,
            "%llu bytes are needed, the budget is %llu", (unsigned long long)(bytes + chunks),
            (unsigned long long)budget);
    s->used_bytes = bytes;
    return HG_OK;
}

static enum hg_status upload_meshes(struct sync *s, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < s->mesh_count && status == HG_OK; i++) {
        struct hg_mesh_entry *entry = &s->meshes[i];
        if (!entry->is_new)
            continue;
        status = hg_mesh_entry_upload(s->g->gpu, entry, entry->mesh, &s->written, err);
        s->uploads += entry->part_count;
    }
    for (uint32_t i = 0; i < s->deform_count && status == HG_OK; i++) {
        struct hg_deform_entry *entry = &s->deforms[i];
        status = hg_deform_update(s->g->gpu, entry, entry->node_object, &s->written, err);
    }
    return status;
}

// --- tables --------------------------------------------------------------------------------------

static void fill_parts(struct sync *s)
{
    uint32_t next = 0;
    for (uint32_t i = 0; i < s->mesh_count; i++) {
        for (uint32_t p = 0; p < s->meshes[i].part_count; p++) {
            struct hg_part_entry *e = &s->meshes[i].parts[p];
            const uint64_t at = e->buffer.address;
            e->index = next++;
            if (e->clusters != NULL) {
                s->parts[e->index] = (struct hg_gpu_part){.indices = e->clusters->table.address,
                    .extra = hg_cluster_mesh_levels(e->clusters)};
                continue;
            }
            s->parts[e->index] = (struct hg_gpu_part){.indices = at + e->layout.indices,
                .positions = at + e->layout.positions,
                .vertices = at + e->layout.vertices,
                .extra = at + e->layout.extra};
        }
    }
    for (uint32_t i = 0; i < s->deform_count; i++) {
        struct hg_deform_entry *e = &s->deforms[i];
        e->index = next++;
        s->parts[e->index] = s->parts[e->source->index];
        s->parts[e->index].positions = e->output.address;
        s->parts[e->index].vertices = e->output.address + e->vertices_offset;
    }
}

static void fill_materials(struct sync *s)
{
    const struct hg_object_list *list = &s->scene->objects[HG_OBJECT_MATERIAL];
    struct hg_material defaults;
    uint32_t lobes = 0;
    memset(&defaults, 0, sizeof defaults);
    hg_material_set_defaults(&defaults);
    s->one_shape = hg_material_pack(&defaults, NULL, &s->materials[0]);
    for (uint32_t i = 0; i < list->count; i++) {
        s->material_ids[i] = (struct material_index){list->items[i]->id, i + 1};
        const struct hg_material *material = (const struct hg_material *)list->items[i];
        s->one_shape &= hg_material_pack(material, s->textures, &s->materials[i + 1]);
        if (hg_material_lobes(material) != 0) {
            hg_material_pack_lobes(material, s->textures, &s->lobes[lobes++]);
            s->materials[i + 1].lobes = lobes;
        }
    }
    if (list->count > 0)
        qsort(s->material_ids, list->count, sizeof *s->material_ids, compare_materials);
}

static uint32_t find_material(const struct sync *s, const struct hg_material *material)
{
    if (material == NULL || s->material_count == 1)
        return 0;
    const struct material_index key = {.id = material->head.id};
    const struct material_index *found =
        bsearch(&key, s->material_ids, s->material_count - 1, sizeof key, compare_materials);
    return found != NULL ? found->index : 0;
}

// The draw's place: class, topology, sides, winding, part, instance.
static uint64_t draw_order(const struct hg_gpu_draw *d)
{
    const uint64_t class = d->flags & HG_DRAW_BLEND  ? HG_DRAW_CLASS_BLEND
                           : d->flags & HG_DRAW_MASK ? HG_DRAW_CLASS_MASK
                                                     : HG_DRAW_CLASS_OPAQUE;
    const uint64_t topology = d->flags & HG_DRAW_POINTS ? 2 : d->flags & HG_DRAW_LINES ? 1 : 0;
    const uint64_t sides =
        (d->flags & HG_DRAW_DOUBLE_SIDED ? 2u : 0u) + (d->flags & HG_DRAW_MIRRORED ? 1u : 0u);
    return class << 62 | topology << 60 | sides << 58 | (uint64_t)d->part << 29 | d->instance;
}

static uint32_t draw_flags(const struct hg_part_entry *part, const struct hg_gpu_material *m)
{
    return part->layout.flags | (part->clusters != NULL ? HG_DRAW_LOD : 0u) |
           (m->flags & HG_MATERIAL_MASK ? HG_DRAW_MASK : 0u) |
           (m->flags & (HG_MATERIAL_BLEND | HG_MATERIAL_TRANSMITS) ? HG_DRAW_BLEND : 0u) |
           (m->flags & HG_MATERIAL_DOUBLE_SIDED ? HG_DRAW_DOUBLE_SIDED : 0u);
}

struct node_draws {
    const struct hg_node *node;
    const struct hg_asset *asset; // of the mesh, or NULL
    const struct hg_mesh_entry *mesh;
};

// Adds instance `number` of a node and the draws of its parts; matrix: to scene space.
static void add_instance(
    struct sync *s, const struct node_draws *n, uint32_t number, const double matrix[16])
{
    struct hg_geometry *g = s->g;
    for (uint32_t p = 0; p < n->mesh->part_count; p++) {
        const struct hg_part_entry *part = &n->mesh->parts[p];
        const struct hg_deform_entry *deform =
            find_deform(s->deforms, s->deform_count, n->node->head.id, p);
        const bool skinned = deform != NULL && deform->joint_count > 0;
        double world[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
        if (skinned)
            memcpy(world + 12, deform->anchor, sizeof deform->anchor);
        else
            memcpy(world, matrix, sizeof world);
        for (int i = 0; i < 3; i++)
            world[12 + i] -= g->origin[i];
        // Parts of one node share its instance, unless only some of them are skinned.
        if (p == 0 || skinned != (s->draws[s->draw_count - 1].skinned)) {
            if (s->instance_count >= s->instance_limit)
                return;
            struct hg_gpu_instance *instance = &s->instances[s->instance_count++];
            memset(instance, 0, sizeof *instance);
            hg_matrix_store4x3(world, &instance->world);
            instance->previous = instance->world;
            instance->node = (uint32_t)n->node->head.id;
        }
        const struct hg_material *material =
            hg_asset_part_material(n->asset, &n->mesh->mesh->parts[p]);
        struct hg_draw_entry *d = &s->draws[s->draw_count++];
        *d = (struct hg_draw_entry){.part = part,
            .node = n->node,
            .material = material,
            .mesh_part = p,
            .instance = number,
            .skinned = skinned,
            .deformed = deform != NULL,
            .deform = deform};
        d->gpu.part = deform != NULL ? deform->index : part->index;
        d->gpu.instance = s->instance_count - 1;
        d->gpu.material = find_material(s, material);
        d->gpu.flags = draw_flags(part, &s->materials[d->gpu.material]) |
                       (hg_matrix_determinant3(world) < 0.0 ? HG_DRAW_MIRRORED : 0u);
        d->order = draw_order(&d->gpu);
        d->bounds = hg_box_transform(deform != NULL ? &deform->bounds : &part->bounds, world);
        hg_box_add(&s->bounds, &d->bounds);
        if (!(d->gpu.flags & (HG_DRAW_LINES | HG_DRAW_POINTS)))
            s->triangles += part->primitive_count;
    }
}

static void fill_draws(struct sync *s)
{
    const struct hg_object_list *list = &s->scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < list->count; i++) {
        const struct hg_node *node = (const struct hg_node *)list->items[i];
        if (node->mesh == NULL || !node->world_visible)
            continue;
        const struct node_draws n = {.node = node,
            .asset = hg_scene_find_asset(s->scene, (uint32_t)(node->mesh->head.id >> 32)),
            .mesh = find_mesh(s->meshes, s->mesh_count, node->mesh->head.id)};
        if (n.mesh == NULL)
            continue;
        double world[16];
        hg_matrix_from_float(node->world, world);
        if (node->instance_count == 0)
            add_instance(s, &n, 0, world);
        for (uint32_t k = 0; k < node->instance_count; k++) {
            double local[16], matrix[16];
            hg_matrix_from_float(node->instances[k], local);
            hg_matrix_multiply(world, local, matrix);
            add_instance(s, &n, k, matrix);
        }
    }
}

static int compare_draws(const void *a, const void *b)
{
    const struct hg_draw_entry *x = a, *y = b;
    return x->order < y->order ? -1 : x->order > y->order;
}

// Which bits of a history are whose.
static void number_groups(struct sync *s)
{
    s->bit_layout = 1;
    for (uint32_t i = 0; i < s->draw_count; i++) {
        struct hg_draw_entry *d = &s->draws[i];
        const uint32_t groups = (d->part->meshlets.count + HG_MESHLET_GROUP - 1) / HG_MESHLET_GROUP;
        d->first_bit = s->bit_count;
        if (groups > UINT32_MAX - s->bit_count)
            continue; // bits are hints
        s->bit_count += groups;
        s->bit_layout = hg_mix(s->bit_layout, (uint64_t)i << 32 | groups);
    }
}

static enum hg_status make_tables(struct sync *s, struct hg_error *err)
{
    s->parts = hg_calloc(s->part_count, sizeof *s->parts);
    s->materials = hg_calloc(s->material_count, sizeof *s->materials);
    s->material_ids = hg_calloc(s->material_count, sizeof *s->material_ids);
    s->lobes = hg_calloc(s->lobe_count, sizeof *s->lobes);
    s->instances = hg_calloc(s->instance_limit, sizeof *s->instances);
    s->draws = hg_calloc(s->draw_limit, sizeof *s->draws);
    s->gpu_draws = hg_calloc(s->draw_limit, sizeof *s->gpu_draws);
    if (s->parts == NULL || s->materials == NULL || s->material_ids == NULL ||
        (s->lobes == NULL && s->lobe_count > 0) || s->instances == NULL || s->draws == NULL ||
        s->gpu_draws == NULL)
        return out_of_memory(err);
    s->bounds = hg_box_empty();
    fill_parts(s);
    fill_materials(s);
    fill_draws(s);
    qsort(s->draws, s->draw_count, sizeof *s->draws, compare_draws);
    for (uint32_t i = 0; i < s->draw_count; i++)
        s->gpu_draws[i] = s->draws[i].gpu;
    number_groups(s);
    return HG_OK;
}

static enum hg_status write_tables(struct sync *s, struct hg_error *err)
{
    struct hg_geometry *g = s->g;
    enum hg_status status = hg_table_write(
        g->gpu, &g->part_table, s->parts, s->part_count * sizeof *s->parts, &s->written, err);
    if (status == HG_OK)
        status = hg_table_write(g->gpu, &g->material_table, s->materials,
            s->material_count * sizeof *s->materials, &s->written, err);
    if (status == HG_OK)
        status = hg_table_write(
            g->gpu, &g->lobe_table, s->lobes, s->lobe_count * sizeof *s->lobes, &s->written, err);
    if (status == HG_OK)
        status = hg_table_write(g->gpu, &g->instance_table, s->instances,
            s->instance_count * sizeof *s->instances, &s->written, err);
    if (status == HG_OK)
        status = hg_table_write(g->gpu, &g->draw_table, s->gpu_draws,
            s->draw_count * sizeof *s->gpu_draws, &s->written, err);
    return status;
}

// --- commit --------------------------------------------------------------------------------------

static enum hg_status list_changed_deforms(struct hg_geometry *g)
{
    const enum hg_status status =
        hg_grow(&g->changed, &g->changed_capacity, g->deform_count, sizeof *g->changed);
    g->changed_count = 0;
    for (uint32_t i = 0; i < g->deform_count && status == HG_OK; i++)
        if (g->deforms[i].changed)
            g->changed[g->changed_count++] = i;
    return status;
}

// Old entries that the new lists did not take over.
static void retire_old(struct sync *s)
{
    struct hg_geometry *g = s->g;
    for (uint32_t i = 0; i < g->mesh_count; i++) {
        const struct hg_mesh_entry *now = find_mesh(s->meshes, s->mesh_count, g->meshes[i].id);
        if (now == NULL || now->is_new)
            hg_mesh_entry_finish(g->gpu, g->pool, &g->meshes[i]);
    }
    for (uint32_t i = 0; i < g->deform_count; i++) {
        const struct hg_deform_entry *now =
            find_deform(s->deforms, s->deform_count, g->deforms[i].node, g->deforms[i].part);
        if (now == NULL || now->is_new)
            hg_deform_finish(g->gpu, &g->deforms[i]);
    }
}

#define SWAP(a, b)                                                                                 \
    do {                                                                                           \
        __typeof__(a) swap_ = (a);                                                                 \
        (a) = (b);                                                                                 \
        (b) = swap_;                                                                               \
    } while (0)

static enum hg_status commit(struct sync *s, struct hg_error *err)
{
    struct hg_geometry *g = s->g;
    retire_old(s);
    SWAP(g->meshes, s->meshes);
    SWAP(g->deforms, s->deforms);
    SWAP(g->deform_capacity, s->deform_capacity);
    SWAP(g->draws, s->draws);
    g->mesh_count = s->mesh_count;
    g->deform_count = s->deform_count;
    g->draw_count = s->draw_count;
    g->part_count = s->part_count;
    g->material_count = s->material_count;
    g->instance_count = s->instance_count;
    g->bounds = s->bounds;
    g->one_shape = s->one_shape;
    g->bit_layout = s->bit_layout;
    g->bit_count = s->bit_count;
    struct hg_geometry_stats *st = &g->stats;
    st->used_bytes = s->used_bytes;
    hg_geometry_note_peak(g);
    st->uploaded_bytes = s->written;
    st->triangles_total = s->triangles;
    st->draws = s->draw_count;
    st->instances = s->instance_count;
    st->parts = s->part_count;
    st->materials = s->material_count;
    st->deforms = s->deform_count;
    st->parts_uploaded = s->uploads;
    st->proxies = 0;
    for (uint32_t i = 0; i < g->mesh_count; i++)
        for (uint32_t p = 0; p < g->meshes[i].part_count; p++)
            st->proxies += g->meshes[i].parts[p].proxy != NULL;
    if (list_changed_deforms(g) != HG_OK)
        return out_of_memory(err);
    st->deforms_changed = g->changed_count;
    return HG_OK;
}

// New entries go; poses of old ones may have been written, so they run again.
static void roll_back(struct sync *s)
{
    struct hg_geometry *g = s->g;
    for (uint32_t i = 0; i < s->mesh_count; i++)
        if (s->meshes[i].is_new)
            hg_mesh_entry_finish(g->gpu, g->pool, &s->meshes[i]);
    for (uint32_t i = 0; i < s->deform_count; i++)
        if (s->deforms[i].is_new)
            hg_deform_finish(g->gpu, &s->deforms[i]);
    for (uint32_t i = 0; i < g->deform_count; i++)
        if (g->deforms[i].pose != NULL)
            memset(g->deforms[i].pose, 0, g->deforms[i].params_bytes);
    g->signature = 0;
}

static enum hg_status sync_changed(struct sync *s, struct hg_error *err)
{
    enum hg_status status = collect_meshes(s, err);
    if (status == HG_OK)
        status = collect_nodes(s, err);
    if (status == HG_OK)
        status = check_budget(s, err);
    if (status == HG_OK)
        status = upload_meshes(s, err);
    if (status == HG_OK)
        status = make_tables(s, err);
    if (status == HG_OK)
        status = write_tables(s, err);
    if (status != HG_OK) {
        roll_back(s);
        return status;
    }
    return commit(s, err);
}

// Masked draws throw shadows with holes: a change of materials shows there too.
static uint64_t caster_signature(const struct hg_geometry *g, uint64_t shape, uint64_t material)
{
    bool masked = false;
    for (uint32_t i = 0; i < g->draw_count; i++) {
        shape = hg_mix(shape, g->draws[i].gpu.flags);
        masked = masked || (g->draws[i].gpu.flags & HG_DRAW_MASK) != 0;
    }
    return masked ? hg_mix(shape, material) : shape;
}

enum hg_status hg_geometry_sync(struct hg_geometry *g, const struct hg_scene *scene,
    const struct hg_textures *textures, struct hg_error *err)
{
    const uint64_t shape = shape_signature(g, scene);
    const uint64_t material = material_signature(scene, textures);
    const uint64_t signature = hg_mix(shape, material) | 1;
    g->stats.uploaded_bytes = 0;
    g->stats.parts_uploaded = 0;
    g->stats.deforms_changed = g->changed_count;
    if (signature == g->signature)
        return HG_OK;
    struct sync s = {.g = g, .scene = scene, .textures = textures};
    const enum hg_status status = sync_changed(&s, err);
    if (status == HG_OK) {
        const uint64_t casters = caster_signature(g, shape, material);
        g->shape_revision += casters != g->shape_signature;
        g->shape_signature = casters;
        g->signature = signature;
        g->revision++;
        hg_baked_queue(g, g->meshes, g->mesh_count);
    }
    if (s.looks)
        hg_spill_end();
    hg_free(s.meshes);
    hg_free(s.deforms);
    hg_free(s.materials);
    hg_free(s.material_ids);
    hg_free(s.lobes);
    hg_free(s.instances);
    hg_free(s.draws);
    hg_free(s.parts);
    hg_free(s.gpu_draws);
    return status;
}

// --- what others read ----------------------------------------------------------------------------

void hg_geometry_fill(const struct hg_geometry *g, struct hg_gpu_geometry *out)
{
    *out = (struct hg_gpu_geometry){.draws = g->draw_table.buffer.address,
        .instances = g->instance_table.buffer.address,
        .parts = g->part_table.buffer.address,
        .materials = g->material_table.buffer.address,
        .lobes = g->lobe_table.buffer.address,
        .draw_count = g->draw_count,
        .instance_count = g->instance_count,
        .part_count = g->part_count,
        .material_count = g->material_count};
}

void hg_geometry_note_peak(struct hg_geometry *g)
{
    struct hg_geometry_stats now;
    hg_geometry_stats(g, &now);
    g->stats.peak_bytes = now.peak_bytes;
}

void hg_geometry_stats(const struct hg_geometry *g, struct hg_geometry_stats *out)
{
    *out = g->stats;
    if (g->pool != NULL) {
        hg_cluster_pool_stats(g->pool, &out->chunks);
        out->used_bytes += out->chunks.used_bytes;
        out->baking = hg_baker_pending(g->baker);
    }
    out->budget_bytes = g->params.budget_bytes;
    out->facet_bytes = g->facets.buffer.size_bytes;
    if (out->peak_bytes < out->used_bytes)
        out->peak_bytes = out->used_bytes;
}

uint64_t hg_geometry_shape_revision(const struct hg_geometry *g)
{
    return g->shape_revision;
}

uint64_t hg_geometry_revision(const struct hg_geometry *g)
{
    return g->revision;
}

bool hg_geometry_bounds(const struct hg_geometry *g, float min[3], float max[3])
{
    const bool some = !hg_box_is_empty(&g->bounds);
    for (int i = 0; i < 3; i++) {
        min[i] = some ? g->bounds.min[i] : 0.0f;
        max[i] = some ? g->bounds.max[i] : 0.0f;
    }
    return some;
}

bool hg_geometry_one_shape(const struct hg_geometry *g)
{
    return g->one_shape;
}

bool hg_geometry_draw_info(const struct hg_geometry *g, uint32_t draw, struct hg_draw_info *out)
{
    memset(out, 0, sizeof *out);
    if (draw >= g->draw_count)
        return false;
    const struct hg_draw_entry *d = &g->draws[draw];
    *out = (struct hg_draw_info){.node = d->node,
        .mesh = d->node->mesh,
        .material = d->material,
        .part = d->mesh_part,
        .instance = d->instance};
    return true;
}

uint32_t hg_geometry_source_primitive(
    const struct hg_geometry *g, uint32_t draw, uint32_t primitive, const float position[3])
{
    if (draw >= g->draw_count)
        return primitive;
    const struct hg_draw_entry *d = &g->draws[draw];
    const struct hg_part_entry *part = d->part;
    if (part->clusters != NULL || part->proxy != NULL) {
        const struct hg_gpu_instance *instances =
            (const struct hg_gpu_instance *)(const void *)g->instance_table.shadow;
        hg_spill_begin();
        primitive = hg_baked_nearest(
            &d->node->mesh->parts[d->mesh_part], &instances[d->gpu.instance].world, position);
        hg_spill_end();
        return primitive;
    }
    if (primitive >= part->primitive_count && primitive < hg_part_primitives(part))
        return part->posed.sources[primitive - part->primitive_count];
    return part->meshlets.order != NULL && primitive < part->primitive_count
               ? part->meshlets.order[primitive]
               : primitive;
}

uint32_t hg_geometry_deform_count(const struct hg_geometry *g)
{
    return g->changed_count;
}

struct hg_deform_job hg_geometry_deform(const struct hg_geometry *g, uint32_t index)
{
    const struct hg_deform_entry *e = &g->deforms[g->changed[index]];
    return (struct hg_deform_job){e->params.address, e->vertex_count};
}

void hg_geometry_deforms_done(struct hg_geometry *g)
{
    for (uint32_t i = 0; i < g->changed_count; i++)
        g->deforms[g->changed[i]].changed = false;
    g->changed_count = 0;
}
