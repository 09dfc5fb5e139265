// draw_tables.c - parts, materials, instances and draws of a scene as the device reads them.
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/geometry/materials.h"
#include "renderer/geometry/sync.h"
#include "renderer/geometry/view_tables.h"

// --- parts and materials -------------------------------------------------------------------------

static void fill_parts(struct hg_sync *s)
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
    for (uint32_t i = 0; i < s->deforms.count; i++) {
        struct hg_deform_entry *e = &s->deforms.items[i];
        e->index = next++;
        s->parts[e->index] = s->parts[e->source->index];
        s->parts[e->index].positions = e->output.address;
        s->parts[e->index].vertices = e->output.address + e->vertices_offset;
    }
}

static int compare_materials(const void *a, const void *b)
{
    const struct hg_material_index *x = a, *y = b;
    return x->id < y->id ? -1 : x->id > y->id;
}

static void fill_materials(struct hg_sync *s)
{
    const struct hg_object_list *list = &s->scene->objects[HG_OBJECT_MATERIAL];
    struct hg_material defaults;
    uint32_t lobes = 0;
    memset(&defaults, 0, sizeof defaults);
    hg_material_set_defaults(&defaults);
    s->materials.one_shape = hg_material_pack(&defaults, NULL, &s->materials.items[0]);
    for (uint32_t i = 0; i < list->count; i++) {
        s->materials.ids[i] = (struct hg_material_index){list->items[i]->id, i + 1};
        const struct hg_material *material = (const struct hg_material *)list->items[i];
        s->materials.one_shape &=
            hg_material_pack(material, s->textures, &s->materials.items[i + 1]);
        if (hg_material_lobes(material) != 0) {
            hg_material_pack_lobes(material, s->textures, &s->materials.lobes[lobes++]);
            s->materials.items[i + 1].lobes = lobes;
        }
    }
    if (list->count > 0)
        qsort(s->materials.ids, list->count, sizeof *s->materials.ids, compare_materials);
}

static uint32_t find_material(const struct hg_sync *s, const struct hg_material *material)
{
    if (material == NULL || s->materials.count == 1)
        return 0;
    const struct hg_material_index key = {.id = material->head.id};
    const struct hg_material_index *found =
        bsearch(&key, s->materials.ids, s->materials.count - 1, sizeof key, compare_materials);
    return found != NULL ? found->index : 0;
}

// --- draws ---------------------------------------------------------------------------------------

// The draw's place: class, topology, sides, winding, part, instance.
static uint64_t draw_order(const struct hg_gpu_draw *d)
{
    const uint64_t class = hg_draw_class_of(d->flags);
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
           (m->flags & HG_MATERIAL_DOUBLE_SIDED || part->layout.flags & HG_DRAW_DISCS
                   ? HG_DRAW_DOUBLE_SIDED
                   : 0u);
}

struct node_draws {
    const struct hg_node *node;
    const struct hg_asset *asset; // of the mesh, or NULL
    const struct hg_mesh_entry *mesh;
};

// Adds instance `number` of a node and the draws of its parts; matrix: to scene space.
static void add_instance(
    struct hg_sync *s, const struct node_draws *n, uint32_t number, const double matrix[16])
{
    struct hg_geometry *g = s->g;
    for (uint32_t p = 0; p < n->mesh->part_count; p++) {
        const struct hg_part_entry *part = &n->mesh->parts[p];
        const struct hg_deform_entry *deform =
            hg_sync_find_deform(&s->deforms, n->node->head.id, p);
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
        const bool mirrored = skinned ? deform->mirrored : hg_matrix_determinant3(world) < 0.0;
        d->gpu.flags = draw_flags(part, &s->materials.items[d->gpu.material]) |
                       (mirrored ? HG_DRAW_MIRRORED : 0u);
        d->order = draw_order(&d->gpu);
        d->bounds = hg_box_transform(deform != NULL ? &deform->bounds : &part->bounds, world);
        hg_box_add(&s->bounds, &d->bounds);
        if (!(d->gpu.flags & (HG_DRAW_LINES | HG_DRAW_POINTS)))
            s->triangles += part->primitive_count;
    }
}

static void fill_draws(struct hg_sync *s)
{
    const struct hg_object_list *list = &s->scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < list->count; i++) {
        const struct hg_node *node = (const struct hg_node *)list->items[i];
        if (node->mesh == NULL || !node->world_visible)
            continue;
        const struct node_draws n = {.node = node,
            .asset = hg_scene_find_asset(s->scene, (uint32_t)(node->mesh->head.id >> 32)),
            .mesh = hg_mesh_entry_find(s->meshes, s->mesh_count, node->mesh->head.id)};
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
static void number_groups(struct hg_sync *s)
{
    s->bits.layout = 1;
    for (uint32_t i = 0; i < s->draw_count; i++) {
        struct hg_draw_entry *d = &s->draws[i];
        const uint32_t groups = (d->part->meshlets.count + HG_MESHLET_GROUP - 1) / HG_MESHLET_GROUP;
        d->first_bit = s->bits.count;
        if (groups > UINT32_MAX - s->bits.count)
            continue; // bits are hints
        s->bits.count += groups;
        s->bits.layout = hg_hash_mix(s->bits.layout, (uint64_t)i << 32 | groups);
    }
}

// --- all of them ---------------------------------------------------------------------------------

enum hg_status hg_draw_tables_make(struct hg_sync *s, struct hg_error *err)
{
    s->parts = hg_calloc(s->part_count, sizeof *s->parts);
    s->materials.items = hg_calloc(s->materials.count, sizeof *s->materials.items);
    s->materials.ids = hg_calloc(s->materials.count, sizeof *s->materials.ids);
    s->materials.lobes = hg_calloc(s->materials.lobe_count, sizeof *s->materials.lobes);
    s->instances = hg_calloc(s->instance_limit, sizeof *s->instances);
    s->draws = hg_calloc(s->draw_limit, sizeof *s->draws);
    s->gpu_draws = hg_calloc(s->draw_limit, sizeof *s->gpu_draws);
    if (s->parts == NULL || s->materials.items == NULL || s->materials.ids == NULL ||
        (s->materials.lobes == NULL && s->materials.lobe_count > 0) || s->instances == NULL ||
        s->draws == NULL || s->gpu_draws == NULL)
        return hg_error_set(err, HG_E_NOMEM, "geometry", NULL, "no memory");
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

enum hg_status hg_draw_tables_write(struct hg_sync *s, struct hg_error *err)
{
    struct hg_geometry *g = s->g;
    enum hg_status status = hg_gpu_array_write(
        g->gpu, &g->tables.parts, s->parts, s->part_count * sizeof *s->parts, &s->written, err);
    if (status == HG_OK)
        status = hg_gpu_array_write(g->gpu, &g->tables.materials, s->materials.items,
            s->materials.count * sizeof *s->materials.items, &s->written, err);
    if (status == HG_OK)
        status = hg_gpu_array_write(g->gpu, &g->tables.lobes, s->materials.lobes,
            s->materials.lobe_count * sizeof *s->materials.lobes, &s->written, err);
    if (status == HG_OK)
        status = hg_gpu_array_write(g->gpu, &g->tables.instances, s->instances,
            s->instance_count * sizeof *s->instances, &s->written, err);
    if (status == HG_OK)
        status = hg_gpu_array_write(g->gpu, &g->tables.draws, s->gpu_draws,
            s->draw_count * sizeof *s->gpu_draws, &s->written, err);
    return status;
}

void hg_draw_tables_finish(struct hg_sync *s)
{
    hg_free(s->materials.items);
    hg_free(s->materials.ids);
    hg_free(s->materials.lobes);
    hg_free(s->instances);
    hg_free(s->draws);
    hg_free(s->parts);
    hg_free(s->gpu_draws);
}

bool hg_geometry_blends(const struct hg_geometry *g)
{
    return g->draw_count > 0 &&
           hg_draw_class_of(g->draws[g->draw_count - 1].gpu.flags) == HG_DRAW_CLASS_BLEND;
}

bool hg_geometry_is_solid(const struct hg_geometry *g)
{
    bool solid = !hg_geometry_blends(g);
    for (uint32_t i = 0; i < g->draw_count && solid; i++)
        solid = (g->draws[i].gpu.flags & (HG_DRAW_LINES | HG_DRAW_POINTS)) == 0;
    return solid;
}

void hg_geometry_untraced(const struct hg_geometry *g, const struct hg_view_tables *shown,
    uint32_t *lines, uint32_t *points)
{
    const uint32_t count = shown != NULL ? shown->draw_count : g->draw_count;
    *lines = *points = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t flags = shown != NULL ? shown->draws[i].flags : g->draws[i].gpu.flags;
        if ((flags & HG_DRAW_HIDDEN) != 0)
            continue;
        *lines += (flags & HG_DRAW_LINES) != 0;
        *points += (flags & HG_DRAW_POINTS) != 0;
    }
}
