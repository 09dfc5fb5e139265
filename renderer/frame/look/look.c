// look.c - see look.h.
#include "renderer/frame/look/look.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"

#define SELECT_STRENGTH 0.6f // of the tint of what is selected

enum hg_status hg_look_create(struct hg_look **out)
{
    static const float color[3] = {1.0f, 0.45f, 0.05f};
    *out = hg_calloc(1, sizeof **out);
    if (*out == NULL)
        return HG_E_NOMEM;
    memcpy((*out)->select_color, color, sizeof color);
    return HG_OK;
}

void hg_look_destroy(struct hg_gpu *gpu, struct hg_look *look)
{
    if (look == NULL)
        return;
    for (uint32_t i = 0; i < look->variant_count; i++)
        hg_free(look->variants[i].name);
    hg_free(look->variants);
    hg_free(look->nodes);
    hg_free(look->selected);
    hg_overlay_destroy(look->overlay);
    hg_view_tables_finish(gpu, &look->tables);
    hg_free(look);
}

// --- overrides -----------------------------------------------------------------------------------

// By node; of one node the newer one, which lies behind in memory, comes last.
static int compare_nodes(const void *a, const void *b)
{
    const struct hg_node_look *x = *(const struct hg_node_look *const *)a,
                              *y = *(const struct hg_node_look *const *)b;
    if (x->node != y->node)
        return x->node < y->node ? -1 : 1;
    return x < y ? -1 : x > y;
}

// Sorted without doubles and without what sets nothing, from `all` to `out`. Returns how many.
static uint32_t merge(const struct hg_node_look **order, uint32_t count, struct hg_node_look *out)
{
    uint32_t kept = 0;
    qsort(order, count, sizeof *order, compare_nodes);
    for (uint32_t i = 0; i < count; i++) {
        const bool newest = i + 1 == count || order[i + 1]->node != order[i]->node;
        if (newest && order[i]->set != 0)
            out[kept++] = *order[i];
    }
    return kept;
}

enum hg_status hg_look_set_nodes(struct hg_look *look, const struct hg_node_look *items,
    uint32_t count, bool clear, struct hg_error *err)
{
    const uint32_t old = clear ? 0 : look->node_count, all = old + count;
    struct hg_node_look *joined = hg_calloc((size_t)all + 1, sizeof *joined);
    struct hg_node_look *kept = hg_calloc((size_t)all + 1, sizeof *kept);
    const struct hg_node_look **order = hg_calloc((size_t)all + 1, sizeof *order);
    enum hg_status status = joined && kept && order ? HG_OK : HG_E_NOMEM;
    uint32_t left = 0;
    if (status == HG_OK) {
        if (old > 0)
            memcpy(joined, look->nodes, old * sizeof *joined);
        if (count > 0)
            memcpy(joined + old, items, count * sizeof *joined);
        for (uint32_t i = 0; i < all; i++)
            order[i] = &joined[i];
        left = merge(order, all, kept);
    }
    if (status == HG_OK && left > HG_LOOK_MOST_NODES)
        status = hg_error_set(err, HG_E_LIMIT, "view_overrides", "overrides",
            "%u nodes, of at most %u that one view may override", left, HG_LOOK_MOST_NODES);
    else if (status != HG_OK)
        hg_error_set(err, status, "view_overrides", NULL, "no memory");
    if (status == HG_OK) {
        hg_free(look->nodes);
        look->nodes = kept;
        look->node_capacity = (size_t)all + 1;
        look->node_count = left;
        look->revision++;
        kept = NULL;
    }
    hg_free(joined);
    hg_free(kept);
    hg_free(order);
    return status;
}

enum hg_status hg_look_set_variant(
    struct hg_look *look, uint32_t asset, const char *name, struct hg_error *err)
{
    uint32_t at = 0;
    char *copy = name != NULL ? hg_strdup(name) : NULL;
    while (at < look->variant_count && look->variants[at].asset != asset)
        at++;
    if ((name != NULL && copy == NULL) ||
        hg_grow(&look->variants, &look->variant_capacity, (size_t)at + 1, sizeof *look->variants)) {
        hg_free(copy);
        return hg_error_set(err, HG_E_NOMEM, "view_variant", NULL, "no memory");
    }
    if (at < look->variant_count)
        hg_free(look->variants[at].name);
    if (name != NULL) {
        look->variants[at] = (struct hg_look_variant){asset, copy};
        look->variant_count += at == look->variant_count;
    } else if (at < look->variant_count) {
        look->variants[at] = look->variants[--look->variant_count];
    }
    look->revision++;
    return HG_OK;
}

// --- what nodes come to --------------------------------------------------------------------------

// A node with what it has of its own and of the nodes above it.
struct resolved {
    const struct hg_node *node;
    uint32_t layers;
    struct hg_node_look look;
    bool done;
};

struct nodes {
    const struct hg_look *look; // may be NULL
    const struct hg_scene *scene;
    struct resolved *items; // by address
    uint32_t count;
    uint32_t *path; // from a node upwards
};

static int compare_resolved(const void *a, const void *b)
{
    const uintptr_t x = (uintptr_t)((const struct resolved *)a)->node,
                    y = (uintptr_t)((const struct resolved *)b)->node;
    return x < y ? -1 : x > y;
}

static struct resolved *find_node(const struct nodes *n, const struct hg_node *node)
{
    const struct resolved key = {.node = node};
    return node == NULL ? NULL : bsearch(&key, n->items, n->count, sizeof key, compare_resolved);
}

static int compare_id(const void *key, const void *item)
{
    const uint64_t x = *(const uint64_t *)key, y = ((const struct hg_node_look *)item)->node;
    return x < y ? -1 : x > y;
}

static const struct hg_node_look *find_override(const struct hg_look *look, uint64_t id)
{
    return look == NULL || look->node_count == 0
               ? NULL
               : bsearch(&id, look->nodes, look->node_count, sizeof *look->nodes, compare_id);
}

static void inherit(const struct nodes *n, struct resolved *r, const struct resolved *above)
{
    const struct hg_node_look *own = find_override(n->look, r->node->head.id);
    r->look = above != NULL ? above->look : (struct hg_node_look){.alpha = 1.0f};
    r->layers = r->node->layers != 0 ? r->node->layers : above != NULL ? above->layers : 1u;
    r->done = true;
    if (own == NULL)
        return;
    r->look.set |= own->set;
    if (own->set & HG_LOOK_HIDDEN)
        r->look.hidden = own->hidden;
    if (own->set & HG_LOOK_SELECTED)
        r->look.selected = own->selected;
    if (own->set & HG_LOOK_TINT)
        memcpy(r->look.tint, own->tint, sizeof r->look.tint);
    if (own->set & HG_LOOK_ALPHA)
        r->look.alpha = own->alpha;
}

// A node after those above it that are not known yet: each is looked at once.
static void resolve(const struct nodes *n, struct resolved *r)
{
    uint32_t depth = 0;
    for (struct resolved *at = r; at != NULL && !at->done && depth < n->count;
         at = find_node(n, at->node->parent))
        n->path[depth++] = (uint32_t)(at - n->items);
    while (depth > 0) {
        struct resolved *at = &n->items[n->path[--depth]];
        inherit(n, at, find_node(n, at->node->parent));
    }
}

static void free_nodes(struct nodes *n)
{
    hg_free(n->items);
    hg_free(n->path);
}

static enum hg_status resolve_all(
    const struct hg_look *look, const struct hg_scene *scene, struct nodes *n)
{
    const struct hg_object_list *list = &scene->objects[HG_OBJECT_NODE];
    *n = (struct nodes){.look = look, .scene = scene, .count = list->count};
    n->items = hg_calloc((size_t)list->count + 1, sizeof *n->items);
    n->path = hg_calloc((size_t)list->count + 1, sizeof *n->path);
    if (n->items == NULL || n->path == NULL) {
        free_nodes(n);
        return HG_E_NOMEM;
    }
    for (uint32_t i = 0; i < list->count; i++)
        n->items[i].node = (const struct hg_node *)list->items[i];
    qsort(n->items, n->count, sizeof *n->items, compare_resolved);
    for (uint32_t i = 0; i < n->count; i++)
        resolve(n, &n->items[i]);
    return HG_OK;
}

// --- tables --------------------------------------------------------------------------------------

struct showing {
    struct nodes nodes;
    struct hg_look *look;
    uint32_t draw; // that comes next
};

// Number of the variant that the view has of an asset, -1: the file's own. False: as the scene.
static bool find_variant(const struct hg_look *look, const struct hg_asset *asset, int32_t *chosen)
{
    for (uint32_t i = 0; asset != NULL && i < look->variant_count; i++) {
        if (look->variants[i].asset != asset->number)
            continue;
        *chosen = -1;
        for (uint32_t k = 0; k < asset->variants.count; k++)
            if (strcmp(asset->variants.names[k], look->variants[i].name) == 0)
                *chosen = (int32_t)k;
        return true;
    }
    return false;
}

static void show_variant(
    const struct showing *s, const struct hg_draw_info *draw, struct hg_draw_look *out)
{
    const struct hg_asset *asset =
        s->look->variant_count > 0
            ? hg_scene_find_asset(s->nodes.scene, (uint32_t)(draw->mesh->head.id >> 32))
            : NULL;
    const struct hg_mesh_part *part = &draw->mesh->parts[draw->part];
    int32_t chosen;
    if (!find_variant(s->look, asset, &chosen))
        return;
    out->material = part->material;
    if (chosen >= 0 && part->variants != NULL && part->variants[chosen] != NULL)
        out->material = part->variants[chosen];
    out->has_material = out->material != draw->material;
}

static void look_at(void *user, const struct hg_draw_info *draw, struct hg_draw_look *out)
{
    struct showing *s = user;
    const struct resolved *r = find_node(&s->nodes, draw->node);
    const uint32_t index = s->draw++;
    show_variant(s, draw, out);
    if (r == NULL)
        return;
    out->hidden = r->look.hidden || (s->look->layers != 0 && (r->layers & s->look->layers) == 0);
    out->alpha = r->look.alpha;
    memcpy(out->tint, r->look.tint, sizeof out->tint);
    if (r->look.selected) {
        memcpy(out->tint, s->look->select_color, sizeof s->look->select_color);
        out->tint[3] = SELECT_STRENGTH;
    }
    s->look->selected[index] = r->look.selected && !out->hidden;
    s->look->selects |= s->look->selected[index] != 0;
}

static bool has_tables(const struct hg_look *look)
{
    return look->node_count > 0 || look->variant_count > 0 || look->layers != 0;
}

enum hg_status hg_look_sync(
    struct hg_look *look, const struct hg_scene_gpu *scene_gpu, struct hg_error *err)
{
    struct hg_gpu_geometry scene;
    hg_geometry_fill(scene_gpu->geometry, &scene);
    const struct hg_look_key key = {.look = look->revision,
        .scene = scene_gpu->scene->revision,
        .geometry = hg_geometry_revision(scene_gpu->geometry),
        .draws = scene.draw_count};
    if (memcmp(&key, &look->key, sizeof key) == 0)
        return HG_OK;
    look->key = (struct hg_look_key){0};
    look->selects = false;
    look->tables.draw_count = 0;
    if (!has_tables(look)) {
        look->key = key;
        return HG_OK;
    }
    struct showing s = {.look = look};
    enum hg_status status = hg_grow(&look->selected, &look->selected_capacity,
        (size_t)scene.draw_count + 1, sizeof *look->selected);
    if (status == HG_OK)
        status = resolve_all(look, scene_gpu->scene, &s.nodes);
    if (status != HG_OK)
        return hg_error_set(err, status, "view", NULL, "no memory for how it shows the scene");
    const struct hg_draw_looks looks = {look_at, &s};
    status = hg_view_tables_make(&look->tables, scene_gpu->geometry, scene_gpu->scene, &looks, err);
    free_nodes(&s.nodes);
    if (status == HG_OK)
        look->key = key;
    return status;
}

const struct hg_gpu_draw *hg_look_draws(const struct hg_look *look)
{
    return look != NULL && look->tables.draw_count > 0 ? look->tables.draws : NULL;
}

bool hg_look_sees_through(const struct hg_look *look)
{
    return hg_look_draws(look) != NULL && look->tables.sees_through;
}

bool hg_look_clips(const struct hg_look *look)
{
    return look != NULL && look->clip.count > 0;
}

// --- the key of a picture ------------------------------------------------------------------------

static void write_floats(struct hg_writer *w, const float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        hg_write_f32(w, values[i]);
}

static void write_clip(struct hg_writer *w, const struct hg_clip *clip)
{
    hg_write_u32(w, clip->count);
    for (uint32_t i = 0; i < clip->count; i++)
        write_floats(w, clip->planes[i], 4);
    if (clip->count == 0)
        return;
    hg_write_u32(w, (uint32_t)clip->caps);
    write_floats(w, clip->cap_color, 3);
    hg_write_f32(w, clip->hatch_px);
}

static void write_node(struct hg_writer *w, uint32_t number, const struct resolved *r)
{
    const struct hg_node_look *l = &r->look;
    hg_write_u32(w, number);
    hg_write_u32(w, r->layers);
    hg_write_u8(w, (uint8_t)(l->hidden | l->selected << 1));
    write_floats(w, l->tint, 4);
    hg_write_f32(w, l->alpha);
}

static void write_variants(struct hg_writer *w, const struct hg_look *look)
{
    hg_write_u32(w, look->variant_count);
    for (uint32_t i = 0; i < look->variant_count; i++) {
        hg_write_u32(w, look->variants[i].asset);
        hg_write_bytes(w, look->variants[i].name, strlen(look->variants[i].name) + 1);
    }
}

enum hg_status hg_look_write_key(
    const struct hg_look *look, const struct hg_scene *scene, struct hg_writer *w)
{
    struct nodes nodes;
    if (look == NULL || (look->clip.count == 0 && !has_tables(look)))
        return HG_OK;
    const uint32_t layers = look->layers;
    write_clip(w, &look->clip);
    write_variants(w, look);
    write_floats(w, look->select_color, 3);
    if (look->node_count == 0 && layers == 0)
        return w->failed ? HG_E_NOMEM : HG_OK;
    enum hg_status status = resolve_all(look, scene, &nodes);
    if (status != HG_OK)
        return status;
    const struct hg_object_list *list = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < list->count;
         i++) { // by place in the scene: ids are not of the picture
        const struct resolved *r = find_node(&nodes, (const struct hg_node *)list->items[i]);
        if (r != NULL && (r->look.set != 0 || (layers != 0 && r->layers != 1u)))
            write_node(w, i, r);
    }
    free_nodes(&nodes);
    return w->failed ? HG_E_NOMEM : HG_OK;
}
