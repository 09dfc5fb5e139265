// view_tables.c - see view_tables.h.
#include "renderer/geometry/view_tables.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/geometry/geometry_state.h"

// A material of the scene, changed.
struct change {
    uint32_t material;
    float tint[4], alpha;
};

struct made {
    struct change change;
    uint32_t index; // of the table; 0: a free place
};

struct maker {
    const struct hg_geometry *geometry;
    const struct hg_scene *scene;
    struct hg_gpu_material *items;
    size_t capacity;
    uint32_t count;
    struct made *made; // hashed, at most half full
    uint32_t places, used;
    const struct hg_material *found; // the newest look-up
    uint32_t found_index;
};

// --- materials -----------------------------------------------------------------------------------

// Index in the scene's table, which has them in the order of the scene behind the default one.
static uint32_t index_of(struct maker *m, const struct hg_material *material)
{
    const struct hg_object_list *list = &m->scene->objects[HG_OBJECT_MATERIAL];
    if (material == NULL)
        return 0;
    for (uint32_t i = 0; m->found != material && i < list->count; i++) {
        if (list->items[i] != &material->head)
            continue;
        m->found = material;
        m->found_index = i + 1;
    }
    const uint32_t last = m->geometry->tables.material_count;
    return m->found == material && m->found_index < last ? m->found_index : 0;
}

static void apply(const struct change *c, struct hg_gpu_material *out)
{
    float *base[3] = {&out->base_color.x, &out->base_color.y, &out->base_color.z};
    for (int i = 0; i < 3; i++)
        *base[i] += (c->tint[i] - *base[i]) * c->tint[3];
    if (c->alpha >= 1.0f)
        return;
    const bool blends = (out->flags & HG_MATERIAL_BLEND) != 0;
    out->base_color.w = (blends ? out->base_color.w : 1.0f) * c->alpha;
    out->flags = (out->flags & ~HG_MATERIAL_MASK) | HG_MATERIAL_BLEND;
}

static uint32_t place_of(const struct made *made, uint32_t places, const struct change *c)
{
    uint32_t at = (uint32_t)hg_hash_mix_bytes(1, c, sizeof *c) & (places - 1);
    while (made[at].index != 0 && memcmp(&made[at].change, c, sizeof *c) != 0)
        at = (at + 1) & (places - 1);
    return at;
}

static enum hg_status make_room(struct maker *m)
{
    if (m->places > 0 && m->used < m->places / 2)
        return HG_OK;
    const uint32_t places = m->places > 0 ? m->places * 2 : 64;
    struct made *grown = hg_calloc(places, sizeof *grown);
    if (grown == NULL)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < m->places; i++)
        if (m->made[i].index != 0)
            grown[place_of(grown, places, &m->made[i].change)] = m->made[i];
    hg_free(m->made);
    m->made = grown;
    m->places = places;
    return HG_OK;
}

// The changed material's index; equal changes have one.
static enum hg_status change_material(struct maker *m, const struct change *c, uint32_t *index)
{
    enum hg_status status = make_room(m);
    if (status == HG_OK)
        status = hg_grow(&m->items, &m->capacity, (size_t)m->count + 1, sizeof *m->items);
    if (status != HG_OK)
        return status;
    struct made *place = &m->made[place_of(m->made, m->places, c)];
    if (place->index == 0) {
        m->items[m->count] = m->items[c->material];
        apply(c, &m->items[m->count]);
        *place = (struct made){*c, m->count++};
        m->used++;
    }
    *index = place->index;
    return HG_OK;
}

// --- draws ---------------------------------------------------------------------------------------

// What a draw's flags say of its material.
static uint32_t flags_of(uint32_t flags, const struct hg_gpu_material *m)
{
    const uint32_t of_material = HG_DRAW_MASK | HG_DRAW_BLEND | HG_DRAW_DOUBLE_SIDED;
    const bool discs = (flags & HG_DRAW_DISCS) != 0;
    return (flags & ~of_material) | (m->flags & HG_MATERIAL_MASK ? HG_DRAW_MASK : 0u) |
           (m->flags & (HG_MATERIAL_BLEND | HG_MATERIAL_TRANSMITS) ? HG_DRAW_BLEND : 0u) |
           (m->flags & HG_MATERIAL_DOUBLE_SIDED || discs ? HG_DRAW_DOUBLE_SIDED : 0u);
}

// What is hidden has an alpha of 0 for rays, which the scene's structures still let meet it.
static enum hg_status show(
    struct maker *m, const struct hg_draw_look *look, struct hg_gpu_draw *draw)
{
    struct change change;
    memset(&change, 0, sizeof change); // hashed
    change.material = look->has_material ? index_of(m, look->material) : draw->material;
    change.alpha = look->hidden ? 0.0f : look->alpha;
    if (look->tint[3] > 0.0f)
        memcpy(change.tint, look->tint, sizeof change.tint);
    enum hg_status status = HG_OK;
    draw->material = change.material;
    if (change.alpha < 1.0f || change.tint[3] > 0.0f)
        status = change_material(m, &change, &draw->material);
    if (status == HG_OK && (look->has_material || change.alpha < 1.0f))
        draw->flags = flags_of(draw->flags, &m->items[draw->material]);
    draw->flags |= look->hidden ? HG_DRAW_HIDDEN : 0u;
    return status;
}

static enum hg_status show_all(
    struct hg_view_tables *t, struct maker *m, const struct hg_draw_looks *looks)
{
    const struct hg_geometry *g = m->geometry;
    enum hg_status status =
        hg_grow(&t->draws, &t->draw_capacity, (size_t)g->draw_count + 1, sizeof *t->draws);
    t->sees_through = false;
    for (uint32_t i = 0; i < g->draw_count && status == HG_OK; i++) {
        struct hg_draw_info info;
        struct hg_draw_look look = {.alpha = 1.0f};
        t->draws[i] = g->draws[i].gpu;
        if (!hg_geometry_draw_info(g, i, &info))
            continue;
        looks->look(looks->user, &info, &look);
        status = show(m, &look, &t->draws[i]);
        t->sees_through |= (t->draws[i].flags & HG_DRAW_BLEND & ~g->draws[i].gpu.flags) != 0;
    }
    return status;
}

enum hg_status hg_view_tables_make(struct hg_view_tables *t, const struct hg_geometry *g,
    const struct hg_scene *scene, const struct hg_draw_looks *looks, struct hg_error *err)
{
    struct maker m = {.geometry = g, .scene = scene, .count = g->tables.material_count};
    uint64_t written = 0;
    enum hg_status status = hg_grow(&m.items, &m.capacity, (size_t)m.count + 1, sizeof *m.items);
    if (status == HG_OK && m.count > 0)
        memcpy(m.items, g->tables.materials.shadow, m.count * sizeof *m.items);
    if (status == HG_OK)
        status = show_all(t, &m, looks);
    if (status != HG_OK)
        hg_error_set(err, status, "view", NULL, "no memory for how it shows the scene");
    t->draw_array.name = "draws of a view";
    t->material_array.name = "materials of a view";
    if (status == HG_OK)
        status = hg_gpu_array_write(
            g->gpu, &t->draw_array, t->draws, g->draw_count * sizeof *t->draws, &written, err);
    if (status == HG_OK)
        status = hg_gpu_array_write(
            g->gpu, &t->material_array, m.items, m.count * sizeof *m.items, &written, err);
    t->draw_count = status == HG_OK ? g->draw_count : 0;
    t->material_count = status == HG_OK ? m.count : 0;
    hg_free(m.items);
    hg_free(m.made);
    return status;
}

void hg_view_tables_fill(const struct hg_view_tables *t, struct hg_gpu_geometry *out)
{
    if (t->draw_count == 0 || t->draw_count != out->draw_count)
        return;
    out->draws = t->draw_array.buffer.address;
    out->materials = t->material_array.buffer.address;
    out->material_count = t->material_count;
}

void hg_view_tables_base_color(
    const struct hg_view_tables *t, const struct hg_geometry *g, uint32_t draw, float color[3])
{
    const bool own = t->draw_count > draw;
    const struct hg_gpu_array *table = own ? &t->material_array : &g->tables.materials;
    const struct hg_gpu_material *materials = (const void *)table->shadow;
    memset(color, 0, 3 * sizeof *color);
    if (draw >= g->draw_count || materials == NULL)
        return;
    const uint32_t material = own ? t->draws[draw].material : g->draws[draw].gpu.material;
    memcpy(color, &materials[material].base_color, 3 * sizeof *color);
}

uint64_t hg_view_tables_bytes(const struct hg_view_tables *t)
{
    return t->draw_array.buffer.size_bytes + t->material_array.buffer.size_bytes;
}

void hg_view_tables_finish(struct hg_gpu *gpu, struct hg_view_tables *t)
{
    hg_gpu_array_finish(gpu, &t->draw_array);
    hg_gpu_array_finish(gpu, &t->material_array);
    hg_free(t->draws);
    *t = (struct hg_view_tables){0};
}
